//! The library as a program calls it: recordings in memory, one call, and a source of pictures of one's own.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use paws_twin::recording::segments::Ends;
use paws_twin::recording::{FolderFrames, Source};
use paws_twin::synth::{Recorded, SynthOptions, Tier};
use paws_twin::{
    Camera, Config, Frames, Grid, JointKind, Made, MemoryFrame, MemoryRecording, Recording, Verdict, json, make,
};

use crate::common::{SMALL, paws, stderr};

/// All that a folder has, in memory.
fn held(seen: &Recording) -> MemoryRecording {
    let frame = |index: usize| MemoryFrame {
        depth: seen.depth(index).unwrap(),
        rgb: seen.rgb(index).unwrap(),
        mask: seen.mask(index).unwrap(),
        normals: seen.normals(index).unwrap(),
        segments: seen.segments(index).unwrap(),
        ..MemoryFrame::new(seen.frames[index].timestamp_secs, seen.frames[index].world_from_camera)
    };
    MemoryRecording {
        frames: (0..seen.frames.len()).map(frame).collect(),
        clips: seen.clips.clone(),
        hands: seen.hands.clone(),
        labels: seen.labels.clone(),
        reconstruction: seen.reconstruction.clone(),
        ..MemoryRecording::new(seen.name.clone(), seen.camera)
    }
}

/// All that is made of a recording, as text and bytes.
fn answer(made: &Made) -> (String, Vec<(String, Vec<u8>)>) {
    let text = [json::text(&made.scene), json::text(&made.twin), json::text(&made.validation), json::text(&made.hands)];
    (text.map(Result::unwrap).concat(), made.files(None).unwrap())
}

#[test]
fn memory_gives_the_same_bytes_as_the_folder_and_as_the_command() {
    let folder = Recording::open(SMALL.path()).unwrap();
    let made = Made::of(&folder, &Config::default()).unwrap();
    assert!(!made.scene.joints.is_empty() && made.lost.is_empty());
    let memory = Recording::from_memory(held(&folder)).unwrap();
    assert!(answer(&made) == answer(&Made::of(&memory, &Config::default()).unwrap()), "memory");
    let dir = tempfile::tempdir().unwrap();
    let rec = SMALL.path().to_str().unwrap();
    let out = paws(&["twin", rec, "--out", "twin", "--no-textures"], dir.path());
    assert_eq!(out.status.code(), Some(0), "{}", stderr(&out));
    for (name, bytes) in made.files(None).unwrap() {
        assert!(bytes == std::fs::read(dir.path().join("twin").join(&name)).unwrap(), "{name}");
    }
}

/// Files, and how often they were asked for.
#[derive(Debug, Default)]
struct Counted(AtomicUsize);

impl Counted {
    fn files(&self) -> &FolderFrames {
        self.0.fetch_add(1, Ordering::Relaxed);
        &FolderFrames
    }
}

impl Frames for Counted {
    fn depth(&self, name: &Path, camera: &Camera) -> paws_twin::Result<Grid<f32>> {
        self.files().depth(name, camera)
    }

    fn rgb(&self, name: &Path, camera: &Camera) -> paws_twin::Result<Grid<[u8; 3]>> {
        self.files().rgb(name, camera)
    }

    fn mask(&self, name: &Path, camera: &Camera) -> paws_twin::Result<Grid<u8>> {
        self.files().mask(name, camera)
    }

    fn normals(&self, name: &Path, camera: &Camera) -> paws_twin::Result<Grid<[f32; 3]>> {
        self.files().normals(name, camera)
    }

    fn segments(&self, name: &Path) -> paws_twin::Result<Vec<Ends>> {
        self.files().segments(name)
    }
}

#[test]
fn a_source_of_ones_own_is_asked_for_every_picture() {
    let folder = Recording::open(SMALL.path()).unwrap();
    let counted = Arc::new(Counted::default());
    let own = Recording { source: Source::Given(counted.clone()), ..folder.clone() }.checked().unwrap();
    let [made, of_own] = [&folder, &own].map(|recording| Made::of(recording, &Config::default()).unwrap());
    assert!(answer(&made) == answer(&of_own));
    assert!(counted.0.load(Ordering::Relaxed) > 10);
}

#[test]
fn a_picture_that_is_not_held_is_named_and_costs_only_itself() {
    let folder = Recording::open(SMALL.path()).unwrap();
    let mut memory = Recording::from_memory(held(&folder)).unwrap();
    let looked_at = Made::of(&memory, &Config::default()).unwrap().scene.clips[0].closed_frames[0];
    memory.frames[looked_at].files.mask = Some("nowhere".into());
    let error = memory.mask(looked_at).unwrap_err().to_string();
    assert!(error.starts_with("nowhere: memory: "), "{error}");
    let made = Made::of(&memory, &Config::default()).unwrap();
    assert_eq!(made.lost, [error]);
    assert!(!made.scene.joints.is_empty());
}

#[test]
fn a_few_damaged_pictures_cost_themselves_and_many_the_recording() {
    let folder = Recording::open(SMALL.path()).unwrap();
    let memory = Recording::from_memory(held(&folder)).unwrap();
    let looked_at = Made::of(&memory, &Config::default()).unwrap().scene.clips[0].closed_frames.clone();
    assert!(looked_at.len() > 2);
    // Two kinds of pictures, in frames that hands and surfaces are told from and in others.
    let mut few = memory.clone();
    let last = few.frames.len() - 1;
    for frame in [looked_at[0], looked_at[2], last] {
        few.frames[frame].files.mask = Some(format!("mask {frame}").into());
    }
    for frame in [looked_at[1], last - 1] {
        few.frames[frame].files.depth = Some(format!("depth {frame}").into());
    }
    let made = Made::of(&few, &Config::default()).unwrap();
    assert_eq!(made.lost.iter().filter(|why| why.starts_with("mask ")).count(), 3, "{:?}", made.lost);
    assert_eq!(made.lost.iter().filter(|why| why.starts_with("depth ")).count(), 2, "{:?}", made.lost);
    assert_eq!(made.scene.joints[0].joint.kind, JointKind::Revolute);
    // What is lost to the joints is lost to the look, and to no more.
    let (look, unseen) = make::look(&few, &made.scene, &made.twin, &Config::default()).unwrap();
    assert!(look.is_some_and(|look| !look.room.is_empty()));
    assert!(!unseen.is_empty() && unseen.iter().all(|why| made.lost.contains(why)), "{unseen:?}");

    let mut many = memory;
    let count = many.frames.len();
    for (i, frame) in many.frames.iter_mut().enumerate() {
        if i % 3 == 0 {
            frame.files.depth = Some(format!("depth {i}").into());
        }
    }
    let error = Made::of(&many, &Config::default()).map(|_| ()).unwrap_err().to_string();
    assert!(error.contains(&format!("depth: {} of {count} cannot be read", count.div_ceil(3))), "{error}");
    assert!(error.contains("depth 0: memory: "), "{error}");
}

#[test]
fn a_recording_that_nobody_checked_is_checked() {
    let mut wrong = Recording::open(SMALL.path()).unwrap();
    wrong.hands[0].frame = usize::MAX;
    let error = Made::of(&wrong, &Config::default()).map(|_| ()).unwrap_err().to_string();
    assert!(error.contains("frame 18446744073709551615"), "{error}");
}

#[test]
fn a_played_kitchen_needs_no_folder() {
    let options = SynthOptions { seed: 3, tier: Tier::Clean, width: 160, parts: 1 };
    let recording = Recorded::new(&options).unwrap().recording().unwrap();
    // What a folder of it knows, and no more.
    let folder = Recording::open(SMALL.path()).unwrap();
    assert_eq!((&recording.clips, &recording.labels), (&folder.clips, &folder.labels));
    assert_eq!((recording.camera, recording.frames.len()), (folder.camera, folder.frames.len()));
    assert_eq!(recording.hands.len(), folder.hands.len());
    let made = Made::of(&recording, &Config::default()).unwrap();
    assert_eq!(made.scene.joints[0].joint.kind, JointKind::Revolute);
    assert_eq!(made.validation.joints[0].verdict, Verdict::Pass);
    let (look, lost) = make::look(&recording, &made.scene, &made.twin, &Config::default()).unwrap();
    assert!(lost.is_empty());
    assert!(look.is_some_and(|look| !look.room.is_empty()));
}

#[test]
fn a_configuration_that_no_step_could_work_with_is_refused_whoever_built_it() {
    let recording = Recording::open(SMALL.path()).unwrap();
    let mut config = Config::default();
    config.reasoning.hand_std_m = -1.0;
    let error = Made::of(&recording, &config).map(|_| ()).unwrap_err().to_string();
    assert!(error.contains("reasoning.hand_std_m = -1"), "{error}");
}

#[test]
fn faults_of_a_recording_in_memory_are_told_all_at_once() {
    let mut wrong = held(&Recording::open(SMALL.path()).unwrap());
    wrong.frames[1].depth.as_mut().unwrap().width -= 1;
    wrong.frames[2].timestamp_secs = f64::NAN;
    wrong.hands[0].frame = usize::MAX;
    let error = Recording::from_memory(wrong).unwrap_err().to_string();
    for word in
        ["memory:", "frame 1: depth is 159 x 120", "frame 2: timestamp NaN", "hands: frame 18446744073709551615"]
    {
        assert!(error.contains(word), "{word}: {error}");
    }
}
