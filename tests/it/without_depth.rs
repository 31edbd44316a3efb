//! Recordings without depth: the hand alone, sparse points, images. Joints with honest doubt, boxes that say that they are assumed.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::LazyLock;

use paws_twin::config::Config;
use paws_twin::evaluation::{EvaluationReport, Rule, Truth, evaluate};
use paws_twin::fitting;
use paws_twin::geometry::segments::Lsd;
use paws_twin::hands::find;
use paws_twin::math::{Point, Vector};
use paws_twin::pipeline::{self, Scene};
use paws_twin::reasoning::heuristic::Geometric;
use paws_twin::recording::{FrameFiles, Recording, Surfaces};
use paws_twin::report::files::predictions;
use paws_twin::synth::{SynthOptions, Tier};
use paws_twin::twin::Twin;
use tempfile::TempDir;

use crate::common::{SMALL, copy, paws, record, stderr, tree};

/// An easy kitchen; rendered once.
static EASY: LazyLock<TempDir> = LazyLock::new(|| {
    let dir = tempfile::tempdir().unwrap();
    record(&SynthOptions { seed: 107, tier: Tier::Clean, width: 240, parts: 4 }, dir.path());
    dir
});

/// What is left of a recording.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Left {
    Hands,
    Points,
    Images,
}

/// Points of a room as structure from motion leaves them: few, off by a centimetre.
fn sparse(recording: &Recording) -> Vec<Point> {
    const STEP: usize = 14;
    let mut out = Vec::new();
    let still = (0..recording.frames.len()).filter(|&f| recording.hands_in(f, f).is_empty()).take(18);
    for frame in still {
        let depth = recording.depth(frame).unwrap().unwrap();
        for y in (frame % STEP..depth.height).step_by(STEP) {
            for x in (3 * frame % STEP..depth.width).step_by(STEP) {
                let z = f64::from(depth.get(x, y).unwrap());
                if z > 0.0 && z < 3.5 {
                    let off = 0.01 * (((x * 31 + y * 17 + frame * 7) % 21) as f64 / 10.0 - 1.0);
                    let local = recording.camera.unproject(x as f64, y as f64, z + off);
                    out.push(recording.frames[frame].world_from_camera * local);
                }
            }
        }
    }
    out
}

fn stripped(left: Left) -> Recording {
    let mut recording = Recording::open(EASY.path()).unwrap();
    let points = if left == Left::Points { sparse(&recording) } else { Vec::new() };
    for frame in &mut recording.frames {
        let rgb = frame.files.rgb.take().filter(|_| left == Left::Images);
        frame.files = FrameFiles { rgb, ..FrameFiles::default() };
    }
    recording.reconstruction = points;
    recording
}

fn inferred(recording: &Recording) -> (Scene, Twin) {
    let config = Config::default();
    let reasoner = Geometric::of(&config);
    let scene = pipeline::infer(recording, &config, &Lsd, &reasoner, &|_, _, _| {}).unwrap();
    let twin = fitting::fit(&scene, &recording.up(), &config.fitting, &config.priors);
    (scene, twin)
}

fn judged(scene: &Scene, twin: &Twin) -> EvaluationReport {
    evaluate(&predictions(scene, twin), &[Truth::read(EASY.path()).unwrap()])
}

#[test]
fn most_joints_of_an_easy_kitchen_are_right_whatever_is_left_of_it() {
    let cases = [(Left::Hands, Surfaces::Nothing), (Left::Points, Surfaces::Points), (Left::Images, Surfaces::Images)];
    for (left, surfaces) in cases {
        let recording = stripped(left);
        assert_eq!(recording.surfaces(), surfaces);
        let (scene, twin) = inferred(&recording);
        let report = judged(&scene, &twin);
        let line = report.rules.iter().find(|r| r.rule == Rule::PawsLine).unwrap().micro;
        assert!(line.m > 0.7 && line.ma > 0.6 && line.mao > 0.5, "{left:?}: {line:?} {:#?}", report.per_clip);
        assert_eq!(report.false_positives, 0, "{left:?}");
        assert!(!twin.furniture.is_empty() && scene.joints.iter().all(|j| scene.is_assumed(j)));
        for piece in &twin.furniture {
            piece.check().unwrap();
            let mut solids = piece.part.solids.iter().chain(&piece.carcass);
            assert!(solids.all(|solid| !solid.seen), "{left:?}: {}", piece.part.id);
        }
        // Nothing of the room was seen.
        assert!(twin.room.is_empty());
        let lines = scene.clips.iter().map(|c| c.lines.len()).sum::<usize>();
        assert_eq!(lines > 0, left == Left::Images, "{left:?}: {lines} lines");
        let seen = scene.clips.iter().filter_map(|c| c.face).filter(|f| !f.is_assumed()).count();
        assert!(seen == 0 || left == Left::Points, "{left:?}: {seen} fronts seen");
    }
}

#[test]
fn how_sure_an_answer_is_without_depth_is_less_than_with_it() {
    let mean = |recording: &Recording| {
        let (scene, _) = inferred(recording);
        let said: Vec<f64> = scene.joints.iter().filter_map(|j| j.joint_probability).collect();
        said.iter().sum::<f64>() / said.len().max(1) as f64
    };
    let with = mean(&Recording::open(EASY.path()).unwrap());
    let without = mean(&stripped(Left::Hands));
    assert!(without > 0.2 && without < with, "{without} {with}");
    let (scene, _) = inferred(&stripped(Left::Hands));
    for joint in &scene.joints {
        let said = joint.uncertainty.as_ref().unwrap();
        said.check(&joint.joint.axis).unwrap();
        // Axes that do not stand upright have the heading of a hand's path, which is never known to a degree.
        let largest = said.axis_cov_rad2[0][0].max(said.axis_cov_rad2[1][1]).sqrt().to_degrees();
        assert!(joint.joint.axis.dot(&Vector::z()).abs() > 0.9 || largest > 2.0, "{}: {largest}", joint.id);
    }
}

#[test]
fn interactions_are_found_by_motion_alone_and_few_are_made_up() {
    let mut recording = stripped(Left::Hands);
    let told: Vec<[usize; 2]> =
        recording.clips.iter().filter(|c| c.end_frame > c.start_frame).map(|c| [c.start_frame, c.end_frame]).collect();
    recording.clips.clear();
    let overlap = |a: &[usize; 2], b: &[usize; 2]| a[1].min(b[1]) > a[0].max(b[0]);
    for flags in [true, false] {
        if !flags {
            recording.hands.iter_mut().for_each(|h| h.contact = None);
        }
        let found = find::interactions(&recording, &Config::default().hands);
        let spans: Vec<[usize; 2]> = found.iter().map(|c| [c.start_frame, c.end_frame]).collect();
        let right = told.iter().filter(|t| spans.iter().any(|s| overlap(t, s))).count();
        assert!(2 * right > told.len(), "flags {flags}: {right} of {} found: {spans:?} {told:?}", told.len());
        assert!(spans.len() <= 2 * told.len(), "flags {flags}: {spans:?} {told:?}");
    }
}

#[test]
fn one_thread_and_three_infer_the_same() {
    for left in [Left::Points, Left::Images] {
        let recording = stripped(left);
        let on = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| {
                let (scene, twin) = inferred(&recording);
                serde_json::to_string(&(scene, twin)).unwrap()
            })
        };
        assert!(on(1) == on(3), "{left:?}");
    }
}

/// A small recording on disk without depth and what is made with it; without images where `images` is false.
fn small(dir: &Path, images: bool) {
    copy(SMALL.path(), dir);
    for name in ["depth", "normals", "masks"] {
        let _ = std::fs::remove_dir_all(dir.join(name));
    }
    std::fs::remove_file(dir.join("labels.json")).unwrap();
    if !images {
        std::fs::remove_dir_all(dir.join("frames")).unwrap();
        let path = dir.join("cameras.json");
        let mut cameras: serde_json::Value = serde_json::from_str(&std::fs::read_to_string(&path).unwrap()).unwrap();
        for frame in cameras["frames"].as_array_mut().unwrap() {
            frame.as_object_mut().unwrap().remove("file");
        }
        std::fs::write(&path, cameras.to_string()).unwrap();
    }
}

#[test]
fn a_twin_is_made_to_its_end_and_says_what_is_assumed() {
    for images in [false, true] {
        let dir = tempfile::tempdir().unwrap();
        small(&dir.path().join("rec"), images);
        let out = paws(&["twin", "rec", "--out", "t"], dir.path());
        let (text, message) = (String::from_utf8_lossy(&out.stdout).into_owned(), stderr(&out));
        // 1: no joint is proved, and neither is any refuted; what cannot be built says so.
        assert!(out.status.code().is_some_and(|code| code < 2), "{message}");
        assert!(
            !message.contains("panicked") && text.contains("no depth: fronts and boxes are assumed"),
            "{text} {message}"
        );
        let files: BTreeMap<String, Vec<u8>> = tree(&dir.path().join("t"));
        let of = |name: &str| String::from_utf8_lossy(&files[name]).into_owned();
        assert!(of("index.html").contains("no depth: fronts and boxes are assumed"));
        for name in ["scene.urdf", "scene.xml", "scene.glb", "scene.usda", "primitives.json", "predictions.json"] {
            assert!(!files[name].is_empty(), "{name}");
        }
        let checks: serde_json::Value = serde_json::from_str(&of("validation.json")).unwrap();
        let verdicts = checks["joints"].as_array().unwrap();
        assert!(!verdicts.is_empty() && verdicts.iter().all(|j| j["verdict"] != "pass"), "{verdicts:?}");
        let twin: Twin = serde_json::from_str(&of("twin.json")).unwrap();
        assert!(twin.furniture.iter().flat_map(|f| &f.part.solids).all(|solid| !solid.seen));
    }
}
