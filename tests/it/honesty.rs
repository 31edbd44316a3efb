//! Inference knows no truth, and what was not checked is told.

use std::path::Path;

use crate::common::{SMALL, begin_skips, copy, data_at, paws, stderr};
use crate::skips;

/// What stands between a recording and a twin, and whatever that uses.
const INFERS: [&str; 17] = [
    "articulation",
    "config",
    "error",
    "feedback",
    "fitting",
    "geometry",
    "hands",
    "inference",
    "json",
    "localization",
    "make",
    "math",
    "pipeline",
    "reasoning",
    "recording",
    "twin",
    "vlm",
];

/// Files of these that open files; all others see what was read.
const READS: [&str; 5] = ["config.rs", "json.rs", "reasoning/prompts.rs", "recording/", "vlm/store.rs"];

/// Words of the code, without comments and the tests at the end of a file.
fn words(text: &str) -> Vec<&str> {
    let code = text.rfind("\n#[cfg(test)]").map_or(text, |end| &text[..end]);
    code.lines()
        .filter(|line| !line.trim_start().starts_with("//"))
        .flat_map(|line| line.split(|c: char| !(c.is_alphanumeric() || c == '_')))
        .filter(|word| !word.is_empty())
        .collect()
}

/// How a file could reach the truth: through the modules that have it, a name for it, or the disk. `file`: below `src`.
fn breaches(file: &str, text: &str) -> Vec<String> {
    let reads = READS.iter().any(|r| file.starts_with(r));
    words(text)
        .into_iter()
        .filter(|word| {
            ["synth", "evaluation", "cli", "report"].contains(word)
                || word.to_lowercase().contains("truth")
                || (!reads && ["fs", "File"].contains(word))
        })
        .map(|word| format!("{file} has {word}"))
        .collect()
}

/// Files below `src`, each with its text.
fn sources(dir: &Path, prefix: &str, out: &mut Vec<(String, String)>) {
    for entry in std::fs::read_dir(dir).unwrap() {
        let path = entry.unwrap().path();
        let name = format!("{prefix}{}", path.file_name().unwrap().to_string_lossy());
        if path.is_dir() {
            sources(&path, &format!("{name}/"), out);
        } else {
            out.push((name, std::fs::read_to_string(&path).unwrap()));
        }
    }
}

#[test]
fn no_type_that_inference_sees_carries_the_truth() {
    let mut all = Vec::new();
    sources(&Path::new(env!("CARGO_MANIFEST_DIR")).join("src"), "", &mut all);
    for module in INFERS {
        let of = |file: &str| file == format!("{module}.rs") || file.starts_with(&format!("{module}/"));
        assert!(all.iter().any(|(file, _)| of(file)), "{module} is gone");
        // Files of tests, that their module takes in as such, are not the library's.
        let is_test = |file: &str| {
            let parent = file.strip_suffix("/tests.rs").map(|p| [format!("{p}.rs"), format!("{p}/mod.rs")]);
            let taken_in =
                |name: &String| all.iter().any(|(f, text)| f == name && text.contains("#[cfg(test)]\nmod tests;"));
            parent.is_some_and(|names| names.iter().any(taken_in))
        };
        for (file, text) in all.iter().filter(|(file, _)| of(file) && !is_test(file)) {
            assert!(breaches(file, text).is_empty(), "{:?}", breaches(file, text));
        }
    }
}

#[test]
fn a_way_to_the_truth_would_be_found() {
    for (file, text) in [
        ("hands/mod.rs", "use crate::synth::Recorded;"),
        ("inference/mod.rs", "use crate::{config, evaluation::Truth};"),
        ("recording/mod.rs", "pub struct Recording {\n    pub truth: BTreeMap<String, Articulation>,\n}"),
        ("recording/read.rs", "let path = dir.join(\"ground_truth.json\");"),
        ("pipeline/mod.rs", "let text = std::fs::read_to_string(recording.dir.join(name));"),
        ("geometry/face.rs", "fn a() {}\n#[cfg(test)]\nfn b() {}\nfn c(f: File) {}\n\n#[cfg(test)]\nmod tests {}"),
    ] {
        assert!(!breaches(file, text).is_empty(), "{file}: {text}");
    }
    for (file, text) in [
        ("hands/mod.rs", "// As crate::synth has it.\nuse crate::config;\n#[cfg(test)]\nmod tests { fn truth() {} }"),
        ("recording/read.rs", "use std::fs::File;"),
    ] {
        assert!(breaches(file, text).is_empty(), "{:?}", breaches(file, text));
    }
}

#[test]
fn a_truth_beside_a_recording_changes_no_answer() {
    let predicted = |change: &dyn Fn(&Path)| {
        let dir = tempfile::tempdir().unwrap();
        copy(SMALL.path(), &dir.path().join("rec"));
        change(&dir.path().join("rec/ground_truth.json"));
        let out = paws(&["infer", "rec", "--physics", "--out", "p.json"], dir.path());
        assert_eq!(out.status.code(), Some(0), "{}", stderr(&out));
        std::fs::read(dir.path().join("p.json")).unwrap()
    };
    let with = predicted(&|truth| assert!(truth.exists()));
    assert!(with == predicted(&|truth| std::fs::remove_file(truth).unwrap()), "without");
    assert!(with == predicted(&|truth| std::fs::write(truth, "{\"joints\": [").unwrap()), "with a broken one");
}

#[test]
fn the_papers_answers_have_no_probability_and_can_be_evaluated() {
    let dir = tempfile::tempdir().unwrap();
    copy(SMALL.path(), &dir.path().join("rec"));
    for (config, groups) in [("paper", false), ("paper_s", true)] {
        let out = paws(&["config", "--config", config, "--toml"], dir.path());
        let text = String::from_utf8(out.stdout).unwrap();
        assert!(text.contains(&format!("merge_clips = {groups}")) && text.contains("grouping = \"voxels\""), "{text}");
        let out = paws(&["infer", "rec", "--config", config, "--out", "p.json"], dir.path());
        assert_eq!(out.status.code(), Some(0), "{config}: {}", stderr(&out));
        let told = String::from_utf8(out.stdout).unwrap();
        assert!(!told.contains(" sure"), "{told}");
        let file: serde_json::Value =
            serde_json::from_slice(&std::fs::read(dir.path().join("p.json")).unwrap()).unwrap();
        let rows = file["predictions"].as_array().unwrap();
        assert!(rows.iter().any(|row| !row["type"].is_null()), "{config}: {file}");
        let sure = rows.iter().any(|row| !row["confidence"].is_null() || !row["joint_confidence"].is_null());
        assert!(!sure, "{config}: {file}");
        let out = paws(&["evaluate", "p.json", "rec", "--details"], dir.path());
        assert!(out.status.success(), "{config}: {}", stderr(&out));
    }
}

#[test]
fn without_names_no_answer_depends_on_one() {
    let dir = tempfile::tempdir().unwrap();
    std::fs::write(dir.path().join("it.toml"), "[reasoning]\nuse_names = false\n").unwrap();
    copy(SMALL.path(), &dir.path().join("rec"));
    let predicted = || {
        let out = paws(&["infer", "rec", "--config", "it.toml", "--out", "p.json"], dir.path());
        assert_ne!(out.status.code(), Some(2), "{}", stderr(&out));
        std::fs::read(dir.path().join("p.json")).unwrap()
    };
    let before = predicted();
    // All furniture by another name, of the other type.
    let path = dir.path().join("rec/clips.json");
    let text = std::fs::read_to_string(&path).unwrap();
    let renamed = text.replace("drawer", "\u{1}").replace("cupboard", "drawer").replace('\u{1}', "cupboard");
    let renamed = ["fridge", "oven", "dishwasher", "door"].iter().fold(renamed, |t, name| t.replace(name, "drawer"));
    assert_ne!(text, renamed, "no name in {text}");
    std::fs::write(&path, renamed).unwrap();
    assert!(before == predicted());
}

#[test]
fn skipped_checks_are_listed_and_counted() {
    begin_skips();
    let list = std::fs::read_to_string(skips::list()).unwrap();
    assert!(skips::reasons(&list, &skips::run()).is_some(), "{list}");
    assert_eq!(skips::reasons("run 1\na\nb\n", "run 1"), Some(vec!["a", "b"]));
    assert_eq!((skips::reasons("run 1\na\n", "run 2"), skips::reasons("", "run 2")), (None, None));
    assert_eq!(skips::sentence(&[]), "0 checks skipped");
    assert_eq!(skips::sentence(&["no data"]), "1 check skipped: no data");
    assert_eq!(skips::sentence(&["no data", "no npm", "no data"]), "3 checks skipped: no data; no npm");
}

#[test]
fn data_that_lies_beside_the_project_must_be_whole() {
    let dir = tempfile::tempdir().unwrap();
    std::fs::create_dir(dir.path().join("recordings")).unwrap();
    assert_eq!(data_at(dir.path(), false, "recordings"), Ok(Some(dir.path().join("recordings"))));
    assert!(data_at(dir.path(), false, "trajectories").is_err_and(|e| e.contains("trajectories")));
    let nowhere = dir.path().join("nowhere");
    assert_eq!(data_at(&nowhere, false, "recordings"), Ok(None));
    assert!(data_at(&nowhere, true, "recordings").is_err());
}
