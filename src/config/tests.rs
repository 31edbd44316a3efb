use super::*;

#[test]
fn the_printed_config_reads_back_as_itself() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("c.toml");
    std::fs::write(&path, Config::default().to_toml()).unwrap();
    assert_eq!(Config::read(&path).unwrap(), Config::default());
}

#[test]
fn every_hyperparameter_of_the_paper_has_its_value() {
    let rows = Config::default().rows();
    let value = |key: &str| rows.iter().find(|r| r.key == key).map(|r| r.value.clone()).unwrap();
    for (key, expected) in [
        ("hands.observation_std_m", "0.05"),
        ("hands.gate_p_value", "0.05"),
        ("localization.voxel_m", "0.05"),
        ("localization.min_views", "4"),
        ("localization.local_frames", "5"),
        ("localization.global_views", "50"),
        ("reasoning.vlm_frames", "10"),
        ("reasoning.vlm_lines_per_view", "4"),
        ("reasoning.vlm_temperature", "0.5"),
        ("reasoning.vlm_top_p", "0.3"),
        ("inference.torus_tolerance_ratio", "0.15"),
        ("inference.torus_tolerance_min_m", "0.015"),
        ("inference.torus_tolerance_max_m", "0.05"),
        ("inference.max_radius_m", "1.0"),
        ("inference.prismatic_tolerance_m", "0.02"),
        ("inference.prismatic_min_inliers", "0.3"),
    ] {
        assert_eq!(value(key), expected, "{key}");
    }
}

#[test]
fn the_papers_method_is_a_word_in_a_file_and_single_keys_may_differ() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("c.toml");
    std::fs::write(&path, "method = \"paper\"\n[geometry]\ndepth_scale = true\n").unwrap();
    let mut expected = Config::paper();
    expected.geometry.depth_scale = true;
    assert_eq!(Config::read(&path).unwrap(), expected);
    std::fs::write(&path, Config::paper().to_toml()).unwrap();
    assert_eq!(Config::read(&path).unwrap(), Config::paper());
    assert_ne!(Config::paper(), Config::default());
}

#[test]
fn impossible_values_are_named() {
    let dir = tempfile::tempdir().unwrap();
    for (text, word) in [
        ("[hands]\nobservation_std_m = -1.0", "observation_std_m"),
        ("[hands]\nobservation_std_m = nan", "observation_std_m"),
        ("[hands]\nobservaton_std_m = 1.0", "observaton_std_m"),
        ("[localization]\nmin_views = 9", "min_views"),
        ("[part.pixel]\nbefore = 0.9", "part.pixel"),
        ("[part.openings]\nwidest = [3.0, 100.0]", "part.openings.widest"),
        ("[hands", "c.toml"),
    ] {
        let path = dir.path().join("c.toml");
        std::fs::write(&path, text).unwrap();
        let error = Config::read(&path).unwrap_err().to_string();
        assert!(error.contains(word), "{error}");
    }
}

#[test]
fn every_row_says_where_its_value_is_from_in_the_same_words() {
    let rows = Config::default().rows();
    let row = |key: &str| rows.iter().find(|r| r.key == key).unwrap();
    for (key, source) in [
        ("hands.observation_std_m", "paper B.1"),
        ("hands.seen_secs", "ours: judgement"),
        ("hands.contact.reach_m", "ours: judgement"),
        ("inference.merge_voxel_iou", "ours: measured"),
        ("primitives.widest_m", "source"),
        ("priors.boards.density_kg_per_m3", "ours: judgement"),
        ("geometry.depth_scale", "ours"),
    ] {
        assert_eq!(row(key).source, source, "{key}");
    }
    assert_eq!(row("priors.boards.density_kg_per_m3").grounds, "particle board");
    assert!(rows.iter().all(|r| !r.meaning.ends_with(" Judgement.")));
    let kinds = ["source", "ours", "ours: judgement", "ours: measured"];
    assert!(rows.iter().all(|r| kinds.contains(&r.source.as_str()) || r.source.starts_with("paper ")));
}
