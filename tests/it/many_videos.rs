//! Several videos of one kitchen: one scene of all of them.

use std::collections::HashMap;
use std::ops::Range;
use std::path::PathBuf;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{LazyLock, Mutex};

use paws_twin::config::Config;
use paws_twin::geometry::segments::Lsd;
use paws_twin::math::{Point, Pose};
use paws_twin::pipeline::{self, LookStore, Scene};
use paws_twin::reasoning::heuristic::Geometric;
use paws_twin::recording::videos::Placement;
use paws_twin::recording::{Clip, HandSample, Recording};
use paws_twin::synth::{Changes, SynthOptions, Tier};
use tempfile::TempDir;

use crate::common::{SMALL, paws, record_varied, stderr};

/// Recordings of one kitchen, and of another one.
struct Visits {
    dir: TempDir,
    /// Of `friday`.
    own_from_kitchen: Pose,
}

impl Visits {
    fn path(&self, name: &str) -> PathBuf {
        self.dir.path().join(name)
    }

    fn open(&self, names: &[&str]) -> Vec<Recording> {
        names.iter().map(|name| Recording::open(&self.path(name)).unwrap()).collect()
    }
}

/// `monday` and `tuesday` have one world; `friday` has one of its own and a smaller camera; `other` is another kitchen.
static VISITS: LazyLock<Visits> = LazyLock::new(|| {
    let dir = tempfile::tempdir().unwrap();
    let visit = |name: &str, seed: u64, width: usize, take: u64, own_world: bool| {
        let options = SynthOptions { seed, tier: Tier::Clean, width, parts: 1 };
        let changes = Changes { take, own_world, ..Changes::default() };
        record_varied(&options, &changes, &dir.path().join(name))
    };
    visit("monday", 3, 160, 0, false);
    visit("tuesday", 3, 160, 1, false);
    let own_from_kitchen = visit("friday", 3, 128, 2, true);
    visit("other", 8, 160, 0, true);
    Visits { dir, own_from_kitchen }
});

fn together(names: &[&str]) -> Recording {
    pipeline::together(VISITS.open(names), Vec::new(), false, &Config::default(), &|_, _, _| {}).unwrap()
}

fn scene_of(recording: &Recording) -> Scene {
    let config = Config::default();
    let reasoner = Geometric::of(&config);
    pipeline::infer(recording, &config, &Lsd, &reasoner, &|_, _, _| {}).unwrap()
}

#[test]
fn videos_of_one_world_stay_where_they_are() {
    let joined = together(&["monday", "tuesday"]);
    let videos = &joined.videos.joined;
    assert_eq!((videos.len(), joined.videos.left_out.len()), (2, 0));
    assert!(matches!(videos[1].placement, Placement::SameWorld(_)), "{}", videos[1].placement.words());
    assert_eq!(videos[1].scene_from_own, Pose::identity());
}

#[test]
fn a_video_with_a_world_of_its_own_is_aligned_to_three_centimetres_and_a_degree() {
    let joined = together(&["monday", "friday"]);
    let friday = joined.videos.joined.get(1).unwrap_or_else(|| panic!("{:?}", joined.videos.left_out));
    assert!(matches!(friday.placement, Placement::Aligned(_)), "{}", friday.placement.words());
    let off = friday.scene_from_own * VISITS.own_from_kitchen;
    assert!(off.rotation.angle().to_degrees() < 1.0, "{}", off.rotation.angle().to_degrees());
    // Where the furniture is: on the way from the cameras to what they look at.
    let monday = &joined.frames[0];
    let there = monday.world_from_camera * Point::new(0.0, 0.0, 1.0);
    assert!((off * there - there).norm() < 0.03, "{}", (off * there - there).norm());
    // Its frames, hands and clips came along.
    assert_eq!(joined.camera_of(friday.first_frame).width, 128);
    assert!(joined.clips.iter().any(|c| c.clip.starts_with("friday/") && c.start_frame >= friday.first_frame));
    let times: Vec<f64> = joined.frames.iter().map(|f| f.timestamp_secs).collect();
    assert!(times.windows(2).all(|w| w[1] > w[0]));
}

#[test]
fn a_video_of_another_kitchen_is_left_out_and_the_rest_goes_on() {
    let joined = together(&["monday", "other", "tuesday"]);
    let names: Vec<&str> = joined.videos.joined.iter().map(|v| v.name.as_str()).collect();
    assert_eq!(names, ["monday", "tuesday"]);
    assert_eq!(joined.videos.left_out.len(), 1);
    let left = &joined.videos.left_out[0];
    assert!(left.name == "other" && left.reason.contains("overlap"), "{left:?}");
}

#[test]
fn clips_of_one_part_in_videos_of_different_cameras_are_one_joint() {
    let scene = scene_of(&together(&["monday", "friday"]));
    let of_both = |clips: &[String]| ["monday/", "friday/"].iter().all(|v| clips.iter().any(|c| c.starts_with(v)));
    assert_eq!(scene.joints.len(), 1, "{:?}", scene.joints.iter().map(|j| &j.clips).collect::<Vec<_>>());
    assert!(of_both(&scene.joints[0].clips), "{:?}", scene.joints[0].clips);
}

/// Frames of a recording as one of their own.
fn piece(recording: &Recording, name: &str, frames: Range<usize>) -> Recording {
    let inside = |c: &&Clip| frames.contains(&c.start_frame) && frames.contains(&c.end_frame);
    let shifted = |c: &Clip| Clip {
        start_frame: c.start_frame - frames.start,
        end_frame: c.end_frame - frames.start,
        ..c.clone()
    };
    let hands = recording.hands.iter().filter(|h| frames.contains(&h.frame));
    Recording {
        name: name.to_owned(),
        frames: recording.frames[frames.clone()].to_vec(),
        clips: recording.clips.iter().filter(inside).map(shifted).collect(),
        hands: hands.map(|h| HandSample { frame: h.frame - frames.start, ..*h }).collect(),
        ..recording.clone()
    }
}

#[test]
fn a_part_left_open_in_one_video_and_closed_in_the_next_is_one_joint() {
    let whole = Recording::open(SMALL.path()).unwrap();
    let clip = |verb: &str| whole.clips.iter().find(|c| c.verb == verb).unwrap();
    let cut = clip("open").end_frame.midpoint(clip("close").start_frame);
    let parts = vec![piece(&whole, "first", 0..cut), piece(&whole, "second", cut..whole.frames.len())];
    let joined = pipeline::together(parts, Vec::new(), true, &Config::default(), &|_, _, _| {}).unwrap();
    assert!(matches!(joined.videos.joined[1].placement, Placement::Told));
    let scene = scene_of(&joined);
    assert_eq!(scene.joints.len(), 1, "{:?}", scene.joints.iter().map(|j| &j.clips).collect::<Vec<_>>());
    let names: Vec<String> =
        [("first", "open"), ("second", "close")].map(|(v, verb)| format!("{v}/{}", clip(verb).clip)).to_vec();
    assert_eq!(scene.joints[0].clips, names);
}

/// Keeps looks in memory and counts.
#[derive(Default)]
struct Memory {
    looks: Mutex<HashMap<(usize, bool), Vec<u8>>>,
    kept: AtomicUsize,
    found: AtomicUsize,
}

impl LookStore for Memory {
    fn find(&self, _: &Recording, frame: usize, with_lines: bool) -> Option<Vec<u8>> {
        let look = self.looks.lock().unwrap().get(&(frame, with_lines)).cloned();
        self.found.fetch_add(usize::from(look.is_some()), Ordering::Relaxed);
        look
    }

    fn keep(&self, _: &Recording, frame: usize, with_lines: bool, look: &[u8]) {
        self.kept.fetch_add(1, Ordering::Relaxed);
        self.looks.lock().unwrap().insert((frame, with_lines), look.to_vec());
    }
}

#[test]
fn looks_that_were_kept_are_used_and_change_no_byte() {
    let recording = Recording::open(SMALL.path()).unwrap();
    let (config, memory) = (Config::default(), Memory::default());
    let reasoner = Geometric::of(&config);
    let scene = || {
        let scene = pipeline::infer_keeping(&recording, &config, &Lsd, &reasoner, &|_, _, _| {}, &memory).unwrap();
        serde_json::to_string(&scene).unwrap()
    };
    let plain = serde_json::to_string(&scene_of(&recording)).unwrap();
    assert!(plain == scene());
    let kept = memory.kept.load(Ordering::Relaxed);
    assert!(kept > 10 && memory.found.load(Ordering::Relaxed) == 0);
    assert!(plain == scene());
    assert_eq!([memory.kept.load(Ordering::Relaxed), memory.found.load(Ordering::Relaxed)], [kept, kept]);
}

#[test]
fn the_cache_changes_no_byte_and_damaged_entries_are_ignored() {
    let dir = tempfile::tempdir().unwrap();
    let small = SMALL.path().to_string_lossy().into_owned();
    let predicted = |more: &[&str]| {
        let out = paws(&[&["infer", small.as_str(), "--out", "p.json"][..], more].concat(), dir.path());
        assert_eq!(out.status.code(), Some(0), "{}", stderr(&out));
        std::fs::read(dir.path().join("p.json")).unwrap()
    };
    let plain = predicted(&[]);
    assert!(plain == predicted(&["--cache", "looks"]));
    let files = || -> Vec<PathBuf> {
        let folders = std::fs::read_dir(dir.path().join("looks")).unwrap().map(|e| e.unwrap().path());
        let files = folders.flat_map(|folder| std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().path()));
        files.collect()
    };
    let kept = files();
    assert!(kept.len() > 10);
    for (i, file) in kept.iter().enumerate() {
        let mut bytes = std::fs::read(file).unwrap();
        match i % 3 {
            0 => bytes.truncate(20),
            1 => bytes[50] ^= 1,
            _ => {}
        }
        std::fs::write(file, bytes).unwrap();
    }
    assert!(plain == predicted(&["--cache", "looks"]));
    assert_eq!(files().len(), kept.len());
}

#[test]
fn one_twin_of_several_videos_is_judged_by_the_truth_of_each() {
    let out = tempfile::tempdir().unwrap();
    let target = out.path().join("twin").to_string_lossy().into_owned();
    let args = ["twin", "monday", "friday", "other", "--out", target.as_str(), "--no-textures", "--keep"];
    let made = paws(&args, VISITS.dir.path());
    // One was left out.
    assert_eq!(made.status.code(), Some(1), "{}", stderr(&made));
    assert!(stderr(&made).contains("left out: other: "), "{}", stderr(&made));
    let page = std::fs::read_to_string(out.path().join("twin/index.html")).unwrap().replace("&#x2f;", "/");
    for word in ["<h2>Videos", "friday/clip_000", "aligned: surfaces", "paws twin monday friday other"] {
        assert!(page.contains(word), "{word}");
    }
    assert!(out.path().join("twin/steps/friday_clip_000/clip.json").is_file());
    let report = out.path().join("report.json").to_string_lossy().into_owned();
    let args = ["evaluate", target.as_str(), "monday", "friday", "--json", report.as_str()];
    let evaluated = paws(&args, VISITS.dir.path());
    assert!(evaluated.status.success(), "{}", stderr(&evaluated));
    let report: serde_json::Value = serde_json::from_slice(&std::fs::read(&report).unwrap()).unwrap();
    assert_eq!((report["clips"].as_u64(), report["unknown"].as_array().map(Vec::len)), (Some(4), Some(0)));
    assert_eq!((report["answered"].as_u64(), report["pairs"]["true_pairs"].as_u64()), (Some(4), Some(6)));
    // In the worlds of both: where one alone is wrong, its frame is.
    let line = report["rules"].as_array().unwrap().iter().find(|r| r["rule"] == "paws_line").unwrap();
    assert!(line["micro"]["mao"].as_f64().unwrap() > 0.99, "{line}");
}

#[test]
fn what_cannot_be_joined_is_told() {
    let dir = tempfile::tempdir().unwrap();
    let monday = VISITS.path("monday").to_string_lossy().into_owned();
    let monday = monday.as_str();
    for (args, word) in [
        (vec!["twin", monday, monday, "--out", "t"], "rename"),
        (vec!["twin", monday, "nowhere", "--out", "t"], "nowhere: no such folder"),
        (vec!["twin", monday, "--out", "t", "--cache", "t/looks"], "choose another --cache"),
    ] {
        let out = paws(&args, dir.path());
        assert_eq!(out.status.code(), Some(2), "{args:?}");
        assert!(stderr(&out).contains(word), "{}", stderr(&out));
    }
}
