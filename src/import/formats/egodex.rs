//! EgoDex (Vision Pro): `N.hdf5` with the camera and all joints in ARKit's world (y up), `N.mp4` beside it, 30 frames a second.
//!
//! The camera has OpenCV axes. `camera/intrinsic` is of the video's size, whose middle the principal point is.

use std::path::Path;

use crate::error::Result;
use crate::import::ImportOptions;
use crate::import::blob::beside;
use crate::import::capture::{
    At, Capture, ClipAt, HandAt, HandStream, ImageAt, ImageSource, JointFrame, Missing, PoseAt, Poses, RawPose,
    SourceWorld,
};
use crate::import::h5::{Hdf5, is_hdf5};
use crate::import::joint_orders::{ARKIT_NAMES, JointOrder};
use crate::import::optics::Optics;
use crate::math::Vector;
use crate::recording::Side;

/// Frames a second of all of the set's recordings.
const FPS: f64 = 30.0;

pub(super) fn detect(path: &Path) -> bool {
    is_hdf5(path) && Hdf5::open(path).is_ok_and(|h5| h5.has("transforms/camera") && h5.has("transforms/leftHand"))
}

pub(super) fn read(path: &Path, _options: &ImportOptions) -> Result<Capture> {
    let h5 = Hdf5::open(path)?;
    let cameras = h5.numbers("transforms/camera", &[None, Some(4), Some(4)])?;
    let count = cameras.len() / 16;
    if count == 0 {
        return Err(h5.fault("transforms/camera", "holds no frames"));
    }
    let at = |index: usize| At::time(index as f64 / FPS).with_index(index);
    let poses = cameras
        .chunks_exact(16)
        .enumerate()
        .filter_map(|(i, rows)| Some(PoseAt { at: at(i), pose: RawPose::from_rows(rows)?, optics: None }));
    let stem = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let video = beside(path, &format!("{stem}.mp4"))?;
    let images = video.iter().flat_map(|file| {
        (0..count).map(move |index| {
            let picture = ImageSource::Video { file: file.clone(), index, upright: false };
            ImageAt { at: at(index), picture, optics: None }
        })
    });
    let mut hands = Vec::new();
    for (side, name) in [(Side::Left, "left"), (Side::Right, "right")] {
        let tracks = joints(&h5, name, count)?;
        for index in 0..count {
            let joints: Vec<Option<[f64; 3]>> = tracks.iter().map(|t| t.get(index).copied().flatten()).collect();
            if joints.iter().any(Option::is_some) {
                hands.push(HandAt { at: at(index), side, joints, contact: None, score: None });
            }
        }
    }
    Ok(Capture {
        kind: "egodex".to_owned(),
        source: path.to_owned(),
        title: "EgoDex recording".to_owned(),
        licence: Some("CC BY-NC-ND".to_owned()),
        notes: vec![format!("times are counted at {FPS} frames a second; joints of confidence 0 are left out")],
        world: SourceWorld { up: Some(Vector::y()), ..SourceWorld::default() },
        optics: Some(optics(&h5)?),
        poses: Some(Poses { items: poses.collect(), ..Poses::default() }),
        images: images.collect(),
        hands: Some(HandStream { frame: JointFrame::World, order: JointOrder::Mano, unit_m: 1.0, items: hands }),
        clips: clip(&h5, &stem, at(0), at(count - 1)).into_iter().collect(),
        missing: vec![Missing {
            what: "depth".to_owned(),
            why: "the headset's depth is not in the data set: joints come from the hands, fronts and boxes are assumed"
                .to_owned(),
            command: "run a metric depth network (MoGe-2) on the video's pictures and import its folder too".to_owned(),
        }],
        ..Capture::default()
    })
}

fn optics(h5: &Hdf5) -> Result<Optics> {
    let k = h5.numbers("camera/intrinsic", &[Some(3), Some(3)])?;
    let &[fx, _, cx, _, fy, cy, ..] = k.as_slice() else {
        return Err(h5.fault("camera/intrinsic", "must be a 3 x 3 matrix"));
    };
    let size = |c: f64| (2.0 * c).round().clamp(0.0, 1e5) as usize;
    let optics = Optics::pinhole(size(cx), size(cy), [fx, fy, cx, cy]);
    match optics.fault() {
        None => Ok(optics),
        Some(fault) => Err(h5.fault("camera/intrinsic", format!("{fault}; --camera stands for it"))),
    }
}

/// Places of a hand's joints in MANO's order: one track a joint, with nothing where ARKit had no idea.
fn joints(h5: &Hdf5, side: &str, count: usize) -> Result<Vec<Vec<Option<[f64; 3]>>>> {
    let frames = Some(count as u64);
    let mut tracks = Vec::with_capacity(ARKIT_NAMES.len());
    for joint in ARKIT_NAMES {
        let rows = h5.numbers(&format!("transforms/{side}{joint}"), &[frames, Some(4), Some(4)])?;
        let confidence = format!("confidences/{side}{joint}");
        let sure = if h5.has(&confidence) { h5.numbers(&confidence, &[frames])? } else { vec![1.0; count] };
        let places = rows.chunks_exact(16).zip(&sure).map(|(row, sure)| match *row {
            [_, _, _, x, _, _, _, y, _, _, _, z, ..] if *sure > 0.0 => Some([x, y, z]),
            _ => None,
        });
        tracks.push(places.collect());
    }
    Ok(tracks)
}

/// The description of what is done, over the whole recording.
fn clip(h5: &Hdf5, name: &str, start: At, end: At) -> Option<ClipAt> {
    let which = h5.text("/", "which_llm_description").unwrap_or_default();
    let key = if which == "2" { "llm_description2" } else { "llm_description" };
    let narration = h5.text("/", key).or_else(|| h5.text("/", "llm_description"))?;
    let (name, verb, noun) = (name.to_owned(), String::new(), String::new());
    Some(ClipAt { name, start, end, narration, verb, noun })
}
