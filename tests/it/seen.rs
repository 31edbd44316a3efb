//! A twin beside the recorded frames: what is compared, what is not, and what the command writes.

use std::path::Path;
use std::process::Command;
use std::sync::LazyLock;

use paws_twin::appearance;
use paws_twin::config::{self, Config};
use paws_twin::evaluation::likeness::{self, Contender, ContenderSummary, FrameLikeness, Over};
use paws_twin::evaluation::shots::{self, Shot};
use paws_twin::look::Look;
use paws_twin::recording::{HAND_CLASS, Recording};
use paws_twin::report::page_frames;
use paws_twin::twin::Twin;
use tempfile::TempDir;

use crate::common::{SMALL, copy, paws, stderr, tree, twin_of};

/// The small recording's twin, in `twin` of this folder; made once.
static TWIN: LazyLock<TempDir> = LazyLock::new(|| {
    let dir = tempfile::tempdir().unwrap();
    let out = paws(&["twin", SMALL.path().to_str().unwrap(), "--out", "twin"], dir.path());
    assert_ne!(out.status.code(), Some(2), "{}", stderr(&out));
    dir
});

fn compared(recording: &Recording, twin: &Twin, look: &Look, shots: &[Shot]) -> Vec<FrameLikeness> {
    let contender = Contender { name: "twin".to_owned(), surfaces: likeness::surfaces(twin, Some(look), &[]) };
    likeness::compare(recording, twin, &[contender], shots, &config::Comparison::default()).unwrap()
}

fn closed(rows: &[FrameLikeness]) -> ContenderSummary {
    let all = likeness::summaries(&["twin".to_owned()], rows);
    all.into_iter().find(|s| s.over == Over::Closed).unwrap()
}

#[test]
fn a_twin_looks_more_like_its_recording_than_a_grey_one_and_people_are_left_out() {
    let (recording, scene, twin) = twin_of(SMALL.path());
    let config = config::Appearance { triangles: 20_000, ..Default::default() };
    let look = appearance::look(&recording, &scene, &twin, &config::Hands::default(), &config).unwrap();
    let timelines = page_frames::timelines(&recording, &scene, &twin, &config::Hands::default());
    let few = config::Comparison { frames: 6, open_frames: 2, ..Default::default() };
    let shots = shots::choose(&recording, &twin, &timelines, &few);
    assert!(shots.closed.len() > 6 && shots.chosen.iter().any(|s| !s.opened().is_empty()), "{shots:?}");
    let rows = compared(&recording, &twin, &look, &shots.chosen);
    assert_eq!(rows.len(), shots.chosen.len());
    let colored = closed(&rows);
    let mut grey = look.clone();
    grey.textures.iter_mut().for_each(|t| t.rgb.fill(160));
    let plain = closed(&compared(&recording, &twin, &grey, &shots.chosen));
    assert!(colored.coverage > 0.8 && (colored.coverage - plain.coverage).abs() < 1e-12, "{colored:?}");
    assert!(colored.psnr_db.unwrap() > plain.psnr_db.unwrap() + 2.0, "{colored:?} {plain:?}");
    assert!(colored.ssim.unwrap() > plain.ssim.unwrap(), "{colored:?} {plain:?}");
    masked(&twin, &look, shots.closed[0]);
}

/// What stands where a mask says that there is a person changes no number.
fn masked(twin: &Twin, look: &Look, frame: usize) {
    let rows = |paint: bool| {
        let dir = tempfile::tempdir().unwrap();
        copy(SMALL.path(), dir.path());
        let mask = dir.path().join(format!("masks/{frame:06}.png"));
        let mut classes = image::open(&mask).unwrap().into_luma8();
        let picture = dir.path().join(format!("frames/{frame:06}.jpg"));
        let mut colors = image::open(&picture).unwrap().into_rgb8();
        for (x, y) in (40..90).flat_map(|x| (30..80).map(move |y| (x, y))) {
            classes.put_pixel(x, y, image::Luma([HAND_CLASS]));
            if paint {
                colors.put_pixel(x, y, image::Rgb([255, 0, 255]));
            }
        }
        classes.save(&mask).unwrap();
        // Told by its first bytes, not by its name.
        colors.save_with_format(&picture, image::ImageFormat::Png).unwrap();
        let recording = Recording::open(dir.path()).unwrap();
        compared(&recording, twin, look, &[Shot { frame, openings: vec![0.0; twin.furniture.len()] }])
    };
    let (as_it_was, painted) = (rows(false), rows(true));
    assert_eq!(as_it_was, painted);
    assert!(as_it_was[0].own[0].pixels[0] < 160 * 120 - 2500);
}

fn compare(extra: &[&str], dir: &Path, threads: &str) -> serde_json::Value {
    let twin = TWIN.path().join("twin");
    let out = Command::new(env!("CARGO_BIN_EXE_paws"))
        .args(["compare", twin.to_str().unwrap(), SMALL.path().to_str().unwrap(), "--json", "c.json"])
        .args(extra)
        .env("RAYON_NUM_THREADS", threads)
        .current_dir(dir)
        .output()
        .unwrap();
    assert_eq!(out.status.code(), Some(0), "{}", stderr(&out));
    assert!(String::from_utf8_lossy(&out.stdout).contains("coverage"));
    serde_json::from_slice(&std::fs::read(dir.join("c.json")).unwrap()).unwrap()
}

/// A number of the row of a contender over frames of a kind.
fn number(file: &serde_json::Value, name: &str, over: &str, key: &str) -> f64 {
    let rows = file["summary"].as_array().unwrap();
    let row = rows.iter().find(|r| r["name"] == name && r["over"] == over);
    row.unwrap_or_else(|| panic!("no {name}, {over} in {rows:?}"))[key].as_f64().unwrap()
}

#[test]
fn one_thread_and_two_compare_and_draw_the_same() {
    let run = |threads: &str| {
        let dir = tempfile::tempdir().unwrap();
        compare(&["--out", "pictures"], dir.path(), threads);
        tree(dir.path())
    };
    let (one, two) = (run("1"), run("2"));
    assert!(one.keys().any(|name| name.starts_with("pictures/closed_")), "{:?}", one.keys());
    assert_eq!(one.keys().collect::<Vec<_>>(), two.keys().collect::<Vec<_>>());
    assert!(one.iter().all(|(name, bytes)| *bytes == two[name]));
}

#[test]
fn the_same_surfaces_from_a_file_look_the_same_and_boxes_do_not() {
    let dir = tempfile::tempdir().unwrap();
    let glb = TWIN.path().join("twin/scene.glb");
    let file = compare(&["--against", glb.to_str().unwrap()], dir.path(), "2");
    for over in ["closed", "closed_common"] {
        let [own, other] = ["twin", "scene.glb"].map(|name| number(&file, name, over, "psnr_db"));
        // Its pictures are JPEGs.
        assert!((own - other).abs() < 1.0, "{over}: {own} {other}");
        let [own, other] = ["twin", "scene.glb"].map(|name| number(&file, name, over, "coverage"));
        assert!((own - other).abs() < 0.05, "{over}: {own} {other}");
    }
    let boxes = compare(&["--boxes"], dir.path(), "2");
    assert!(number(&file, "twin", "closed", "psnr_db") > number(&boxes, "twin", "closed", "psnr_db"));
    // A mesh alone: compared with the frames in which nobody works.
    let recording = SMALL.path().to_str().unwrap();
    let out = paws(&["compare", glb.to_str().unwrap(), recording], dir.path());
    assert_eq!(out.status.code(), Some(0), "{}", stderr(&out));
}

#[test]
fn shape_and_fronts_are_measured_where_there_is_a_truth() {
    let dir = tempfile::tempdir().unwrap();
    let out = paws(
        &["synth", "--seed", "3", "--tier", "clean", "--width", "64", "--parts", "1", "--out", "r", "--kitchen", "k"],
        dir.path(),
    );
    assert!(out.status.success(), "{}", stderr(&out));
    let file = compare(&["--kitchen", "k"], dir.path(), "2");
    let score = &file["shape"][0][1];
    assert!(score["f_score"].as_f64().unwrap() > 0.6, "{score}");
    let fronts = &file["fronts"];
    assert_eq!((fronts["parts"].as_u64(), fronts["fronts"].as_array().map(Vec::len)), (Some(1), Some(1)));
    assert!(fronts["worst_edge_m"].as_f64().unwrap() < 0.1, "{fronts}");
}

#[test]
fn the_page_has_recorded_frames_to_look_from() {
    let page = std::fs::read_to_string(TWIN.path().join("twin/index.html")).unwrap();
    let shots: Vec<&str> = page.split("<button type=\"button\" data-view=\"").skip(1).collect();
    assert!((3..=Config::default().comparison.page_frames).contains(&shots.len()), "{}", shots.len());
    for shot in &shots {
        let (view, rest) = shot.split_once('"').unwrap();
        let view: serde_json::Value = serde_json::from_str(&view.replace("&quot;", "\"")).unwrap();
        assert_eq!((view["pose"].as_array().map(Vec::len), view["width"].as_u64()), (Some(16), Some(160)), "{view}");
        assert!(rest.contains("src=\"data:image/jpeg;base64,"));
    }
    let bytes: usize = shots.iter().filter_map(|s| s.split("base64,").nth(1)?.find('"')).sum();
    assert!(bytes < 1_000_000, "{bytes}");
    assert!(shots.iter().any(|shot| shot.contains("all closed")) && shots.iter().any(|shot| shot.contains(" open\"")));
}

#[test]
fn what_cannot_be_compared_is_named() {
    let dir = tempfile::tempdir().unwrap();
    std::fs::create_dir(dir.path().join("empty")).unwrap();
    std::fs::write(
        dir.path().join("points.ply"),
        "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nend_header\n1\n",
    )
    .unwrap();
    let recording = SMALL.path().to_str().unwrap();
    for (twin, words) in [("nowhere", "no such file or folder"), ("empty", "twin.json"), ("points.ply", "no triangles")]
    {
        let out = paws(&["compare", twin, recording], dir.path());
        assert_eq!(out.status.code(), Some(2), "{twin}");
        assert!(stderr(&out).contains(words), "{twin}: {}", stderr(&out));
    }
}
