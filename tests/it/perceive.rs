//! `paws perceive`: the plan, the package's own tests, hands of a real network, and what is told where something is missing.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::LazyLock;

use paws_twin::math::Point;
use serde_json::Value;
use tempfile::TempDir;

use crate::common::{SMALL, copy, optional_data, python, skipped, stderr, tree};

/// A Python with the networks' packages, made once.
static PYTHON: LazyLock<Option<PathBuf>> = LazyLock::new(|| python("perceive"));

/// Runs `paws perceive` with an own folder for the package, and only the programs of `path`, if one is given.
fn perceive(args: &[&OsStr], home: &Path, path: Option<&Path>) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_paws"));
    command.arg("perceive").args(args).current_dir(home).env("XDG_CACHE_HOME", home.join("packages"));
    if let Some(path) = path {
        command.env("PATH", path);
    }
    command.output().unwrap()
}

fn words(args: &[&str], home: &Path, path: Option<&Path>) -> Output {
    let args: Vec<&OsStr> = args.iter().map(OsStr::new).collect();
    perceive(&args, home, path)
}

/// A small recording without hands, as `rec` of a folder.
fn without_hands() -> TempDir {
    let home = tempfile::tempdir().unwrap();
    let rec = home.path().join("rec");
    copy(SMALL.path(), &rec);
    for name in ["hands.json", "fingertips.csv"] {
        let _ = std::fs::remove_file(rec.join(name));
    }
    home
}

/// A Python that runs at all.
fn plain_python() -> Option<&'static str> {
    let found = ["python3", "python"].into_iter().find(|name| Command::new(name).arg("--version").output().is_ok());
    if found.is_none() {
        skipped("the plan of paws perceive needs python3");
    }
    found
}

#[test]
fn the_plan_says_what_would_run_and_runs_nothing() {
    if plain_python().is_none() {
        return;
    }
    let home = without_hands();
    let before = tree(&home.path().join("rec"));
    let out = words(&["--plan", "rec"], home.path(), None);
    let text = String::from_utf8_lossy(&out.stdout).into_owned();
    assert_eq!(out.status.code(), Some(0), "{}", stderr(&out));
    for word in ["mediapipe-hands", "Apache-2.0", "is there", "nothing was run"] {
        assert!(text.contains(word), "{word}: {text}");
    }
    // What any source lacks, whatever it is.
    std::fs::create_dir(home.path().join("images")).unwrap();
    let image = std::fs::read_dir(home.path().join("rec/frames")).unwrap().next().unwrap().unwrap();
    std::fs::copy(image.path(), home.path().join("images/000000.jpg")).unwrap();
    let out = words(&["--plan", "images", "--gpu"], home.path(), None);
    let text = String::from_utf8_lossy(&out.stdout).into_owned();
    assert_eq!(out.status.code(), Some(0), "{}", stderr(&out));
    for word in ["pycolmap", "BSD-3-Clause", "moge infer", "subtitles"] {
        assert!(text.contains(word), "{word}: {text}");
    }
    assert_eq!(before, tree(&home.path().join("rec")));
    let mut names: Vec<String> = std::fs::read_dir(home.path())
        .unwrap()
        .map(|e| e.unwrap().file_name().to_string_lossy().into_owned())
        .collect();
    names.sort();
    assert_eq!(names, ["images", "packages", "rec"]);
}

#[test]
fn without_uv_and_python_it_says_what_to_install_and_leaves_nothing() {
    let home = without_hands();
    let empty = home.path().join("no programs");
    std::fs::create_dir(&empty).unwrap();
    let here = |name: &str| home.path().join(name).exists();
    for line in ["rec --out out", "--plan rec", "rec --out out --python nowhere/python"] {
        let args: Vec<&str> = line.split(' ').collect();
        let out = words(&args, home.path(), Some(&empty));
        let said = stderr(&out);
        assert_eq!(out.status.code(), Some(2), "{args:?}: {said}");
        assert!(said.contains("install uv (https://docs.astral.sh/uv)") && said.contains("Python 3.10"), "{said}");
        assert!(!here("out") && !here("out.cache"), "{args:?}");
    }
}

#[test]
fn sources_that_cannot_be_perceived_are_told() {
    let home = without_hands();
    std::fs::write(home.path().join("empty.mp4"), "").unwrap();
    std::fs::write(home.path().join("said.srt"), "1\n00:00:01,000 --> 00:00:02,000\nopen the drawer\n").unwrap();
    for (line, word) in [
        ("empty.mp4 --out out", "empty.mp4"),
        ("rec said.srt --out out", "is a recording already"),
        ("nowhere --out out", "nowhere: no such file"),
        ("rec --out out --weights nowhere", "--weights wants a folder"),
        ("rec --out out --redo poses", "whose poses stay"),
        ("rec --out out --redo depth", "--depth-model DIR"),
        ("rec --out out --by depth=moge", "--depth-model"),
        ("rec --out out --by poses", "STREAM=NETWORK"),
        ("rec --out out --depth-model nowhere", "--depth-model wants a folder"),
    ] {
        let args: Vec<&str> = line.split(' ').collect();
        let out = words(&args, home.path(), None);
        assert_eq!(out.status.code(), Some(2), "{args:?}: {}", stderr(&out));
        assert!(stderr(&out).contains(word), "{args:?}: {}", stderr(&out));
        assert!(!home.path().join("out").exists(), "{args:?}");
    }
}

#[test]
fn a_python_without_the_packages_is_told_which_and_a_recording_with_hands_needs_none() {
    let Some(python) = plain_python() else { return };
    let home = without_hands();
    if Command::new(python).args(["-c", "import mediapipe"]).output().is_ok_and(|o| o.status.success()) {
        skipped("the message about a missing mediapipe, as the installed Python has it");
    } else {
        let out = words(&["rec", "--out", "out", "--python", python], home.path(), None);
        assert_eq!(out.status.code(), Some(2), "{}", stderr(&out));
        assert!(stderr(&out).contains("mediapipe==0.10.21"), "{}", stderr(&out));
        assert!(!home.path().join("out").exists());
    }
    copy(SMALL.path(), &home.path().join("whole"));
    let empty = home.path().join("no programs");
    std::fs::create_dir(&empty).unwrap();
    let out = words(&["whole", "--out", "copied"], home.path(), Some(&empty));
    assert_eq!(out.status.code(), Some(0), "{}", stderr(&out));
    let [mut from, mut to] = ["whole", "copied"].map(|name| tree(&home.path().join(name)));
    from.remove(".paws-recording");
    to.remove(".paws-recording");
    assert!(from == to, "the copy differs");
}

#[test]
fn the_package_passes_its_own_tests() {
    let Some(python) = &*PYTHON else { return };
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("perceive");
    let out = Command::new(python)
        .args(["-m", "pytest", "-q", "-p", "no:cacheprovider"])
        .env("PYTHONDONTWRITEBYTECODE", "1")
        .current_dir(root)
        .output()
        .unwrap();
    assert!(out.status.success(), "{}\n{}", String::from_utf8_lossy(&out.stdout), stderr(&out));
}

/// The first frames of a drawer's opening: enough hands, few enough seconds.
const FIRST: u64 = 210;
const FRAMES: u64 = 50;

/// A stretch of a recording, without hands.
fn stretch(from: &Path, to: &Path) {
    let read = |name: &str| -> Value { serde_json::from_slice(&std::fs::read(from.join(name)).unwrap()).unwrap() };
    let mut cameras = read("cameras.json");
    let kept = |frame: &Value| frame["frame"].as_u64().is_some_and(|n| (FIRST..FIRST + FRAMES).contains(&n));
    cameras["frames"].as_array_mut().unwrap().retain(kept);
    for folder in ["frames", "depth"] {
        std::fs::create_dir_all(to.join(folder)).unwrap();
    }
    for n in FIRST..FIRST + FRAMES {
        for name in [format!("frames/{n:06}.jpg"), format!("depth/{n:06}.png")] {
            std::fs::copy(from.join(&name), to.join(&name)).unwrap();
        }
    }
    std::fs::write(to.join("cameras.json"), cameras.to_string()).unwrap();
    std::fs::copy(from.join("clips.json"), to.join("clips.json")).unwrap();
}

/// The middle of each hand by frame.
fn middles(recording: &Path) -> Vec<(u64, Point)> {
    let table: Value = serde_json::from_slice(&std::fs::read(recording.join("hands.json")).unwrap()).unwrap();
    let mut out = Vec::new();
    for frame in table["frames"].as_array().unwrap() {
        for hand in frame["hands"].as_array().unwrap() {
            let joints: Vec<[f64; 3]> = serde_json::from_value(hand["joints_world"].clone()).unwrap();
            let sum = joints.iter().fold(Point::origin().coords, |sum, &joint| sum + Point::from(joint).coords);
            out.push((frame["frame"].as_u64().unwrap(), Point::from(sum / joints.len() as f64)));
        }
    }
    out
}

#[test]
fn the_real_network_finds_rendered_hands_where_they_are() {
    let Some(python) = &*PYTHON else { return };
    let Some(truth) = optional_data("recordings/apartment_clean") else { return };
    if !Command::new(python).args(["-c", "import mediapipe"]).output().is_ok_and(|o| o.status.success()) {
        skipped("hands of MediaPipe need Python 3.10 to 3.12 and libGL");
        return;
    }
    let home = tempfile::tempdir().unwrap();
    let rec = home.path().join("rec");
    stretch(&truth, &rec);
    let python = python.to_string_lossy().into_owned();
    let run = |out: &str| words(&["rec", "--out", out, "--cache", "kept", "--python", &python], home.path(), None);
    let out = run("out");
    assert_eq!(out.status.code(), Some(0), "{}", stderr(&out));
    let (found, true_ones) = (middles(&home.path().join("out")), middles(&truth));
    let mut away: Vec<f64> = found
        .iter()
        .filter_map(|(frame, middle)| {
            true_ones.iter().filter(|(n, _)| n == frame).map(|(_, m)| (m - middle).norm()).min_by(f64::total_cmp)
        })
        .collect();
    away.sort_by(f64::total_cmp);
    assert!(found.len() as u64 * 10 >= FRAMES * 8, "{} hands in {FRAMES} frames", found.len());
    assert!(away.len() == found.len() && away[away.len() / 2] < 0.06 && away[away.len() * 9 / 10] < 0.12, "{away:?}");
    let origin: PathBuf = home.path().join("out/import.json");
    assert!(std::fs::read_to_string(origin).unwrap().contains("Apache-2.0"));
    // From the cache the same comes out.
    assert_eq!(run("again").status.code(), Some(0));
    let [one, two] = ["out", "again"].map(|name| std::fs::read(home.path().join(name).join("hands.json")).unwrap());
    assert!(one == two);
    // Masks of hands are made of their joints.
    let args = ["out", "--make", "masks", "--out", "masked", "--cache", "kept", "--python", &python];
    let out = words(&args, home.path(), None);
    assert_eq!(out.status.code(), Some(0), "{}", stderr(&out));
    let masks = std::fs::read_dir(home.path().join("masked/masks")).unwrap().count();
    assert!(masks as u64 == FRAMES, "{masks}: {}", stderr(&out));
    let origin = std::fs::read_to_string(home.path().join("masked/import.json")).unwrap();
    assert!(origin.contains("hand-joints") && origin.contains("mediapipe-hands"), "{origin}");
}
