//! ego-vision: a JSON file with cameras and hands (MANO's 21 joints) in one world, frame by frame of a video.
//!
//! Cameras map to the world and have OpenCV axes. The file is written with bare `NaN`, which no JSON knows: here it is "no
//! value". Hands that were filled in between two that were seen are left out.

use std::io::Read;
use std::path::Path;

use serde::Deserialize;

use crate::error::{Error, Result};
use crate::import::ImportOptions;
use crate::import::capture::{
    At, Capture, HandAt, HandStream, JointFrame, Missing, PoseAt, Poses, RawPose, SourceWorld,
};
use crate::import::joint_orders::JointOrder;
use crate::import::optics::Optics;
use crate::import::text::Unread;
use crate::recording::Side;

/// Frames a second where the file does not say.
const USUAL_FPS: f64 = 30.0;
/// The keys that tell the format stand within the first bytes.
const LOOKED_AT_BYTES: u64 = 64 << 10;

pub(super) fn detect(path: &Path) -> bool {
    let is_json = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("json"));
    let mut start = Vec::new();
    let read = std::fs::File::open(path).and_then(|f| f.take(LOOKED_AT_BYTES).read_to_end(&mut start));
    let text = String::from_utf8_lossy(&start);
    is_json && read.is_ok() && text.contains("\"camera_trajectory\"")
}

/// A number that may be missing.
type Maybe = Option<f64>;

#[derive(Deserialize)]
struct Document {
    fps: Option<f64>,
    camera_trajectory: Vec<Vec<Vec<Maybe>>>,
    intrinsics: Option<CameraMatrices>,
    hands_world: Option<HandTracks>,
}

/// One camera, or one a frame.
#[derive(Deserialize)]
#[serde(untagged)]
enum CameraMatrices {
    Each(Vec<[[Maybe; 3]; 3]>),
    One([[Maybe; 3]; 3]),
    Named { fx: f64, fy: f64, cx: f64, cy: f64 },
}

#[derive(Deserialize)]
struct HandTracks {
    left: Option<HandTrack>,
    right: Option<HandTrack>,
}

#[derive(Deserialize)]
struct HandTrack {
    joints_world: Vec<Vec<[Maybe; 3]>>,
    confidence: Option<Vec<Maybe>>,
    infilled: Option<Vec<Flag>>,
}

#[derive(Deserialize)]
#[serde(untagged)]
enum Flag {
    Is(bool),
    Count(Maybe),
}

impl Flag {
    fn is_set(&self) -> bool {
        match self {
            Self::Is(is) => *is,
            Self::Count(n) => n.is_some_and(|n| n != 0.0),
        }
    }
}

pub(super) fn read(path: &Path, options: &ImportOptions) -> Result<Capture> {
    let document: Document = crate::json::parse(&without_nan(&crate::json::read_text(path)?), path)?;
    let fps = options.source_fps.or(document.fps).filter(|f| f.is_finite() && *f > 0.0).unwrap_or(USUAL_FPS);
    let at = |index: usize| At::time(index as f64 / fps).with_index(index);
    let mut notes = vec![format!(
        "times are counted at {fps} frames a second; distances are the networks' own, --scale sets them right"
    )];
    let (poses, dropped) = cameras(&document, path, &at)?;
    let optics = document.intrinsics.as_ref().and_then(optics);
    match &optics {
        Some(o) => {
            notes.push(format!("the video is taken to be {} x {}: twice the principal point", o.width, o.height))
        }
        None => notes.push("there are no intrinsics: give --camera".to_owned()),
    }
    let mut items = Vec::new();
    let mut filled = 0;
    let both = document.hands_world.unwrap_or(HandTracks { left: None, right: None });
    for (side, track) in [(Side::Left, both.left), (Side::Right, both.right)] {
        let Some(track) = track else { continue };
        filled += hands(&track, side, &at, &mut items);
    }
    if filled > 0 {
        notes.push(format!("{filled} hands that were filled in are left out"));
    }
    let hands = HandStream { frame: JointFrame::World, order: JointOrder::Mano, unit_m: 1.0, items };
    Ok(Capture {
        kind: "ego-vision".to_owned(),
        source: path.to_owned(),
        title: "result of ego-vision".to_owned(),
        notes,
        dropped: dropped.into_iter().collect(),
        world: SourceWorld::default(),
        optics,
        poses: Some(Poses { items: poses, ..Poses::default() }),
        hands: (!hands.items.is_empty()).then_some(hands),
        missing: vec![Missing {
            what: "images".to_owned(),
            why: "the file holds no images".to_owned(),
            command: "add the video that it was made from: paws import RESULT.json VIDEO.mp4 --out DIR".to_owned(),
        }],
        ..Capture::default()
    })
}

/// The cameras that were found, and what could not be read of them.
fn cameras(document: &Document, path: &Path, at: &dyn Fn(usize) -> At) -> Result<(Vec<PoseAt>, Option<String>)> {
    let mut poses = Vec::new();
    let mut unread = Unread::default();
    for (index, rows) in document.camera_trajectory.iter().enumerate() {
        if rows.len() < 3 || rows.iter().any(|row| row.len() != 4) {
            let message = "must be a matrix of 3 or 4 rows of 4 numbers";
            unread.keep::<()>(Err(Error::format(path, format!("camera_trajectory[{index}]"), message)));
            continue;
        }
        // A camera that was not found is no pose.
        let numbers: Option<Vec<f64>> = rows.iter().flatten().copied().collect();
        if let Some(pose) = numbers.and_then(|n| RawPose::from_rows(&n)) {
            poses.push(PoseAt { at: at(index), pose, optics: None });
        }
    }
    let dropped = unread.told("cameras", poses.len())?;
    if poses.is_empty() {
        return Err(Error::format(path, "camera_trajectory", "holds no cameras"));
    }
    Ok((poses, dropped))
}

/// Hands that were seen; how many were not.
fn hands(track: &HandTrack, side: Side, at: &dyn Fn(usize) -> At, out: &mut Vec<HandAt>) -> usize {
    let mut filled = 0;
    for (index, joints) in track.joints_world.iter().enumerate() {
        let score = track.confidence.as_ref().map(|c| c.get(index).copied().flatten().unwrap_or(0.0));
        if track.infilled.as_ref().and_then(|f| f.get(index)).is_some_and(Flag::is_set) {
            filled += 1;
            continue;
        }
        let joints: Vec<Option<[f64; 3]>> = joints.iter().map(|[x, y, z]| Some([(*x)?, (*y)?, (*z)?])).collect();
        if score.is_none_or(|s| s > 0.0) && joints.iter().any(Option::is_some) {
            out.push(HandAt { at: at(index), side, joints, contact: None, score });
        }
    }
    filled
}

/// The camera; of cameras frame by frame the middle one, as they differ by the network's noise.
fn optics(intrinsics: &CameraMatrices) -> Option<Optics> {
    let of = |[[fx, _, cx], [_, fy, cy], _]: [[Maybe; 3]; 3]| Some([fx?, fy?, cx?, cy?]);
    let [fx, fy, cx, cy] = match intrinsics {
        CameraMatrices::Named { fx, fy, cx, cy } => [*fx, *fy, *cx, *cy],
        CameraMatrices::One(k) => of(*k)?,
        CameraMatrices::Each(all) => {
            let mut found: Vec<[f64; 4]> = all.iter().filter_map(|k| of(*k)).collect();
            found.sort_by(|a, b| a[0].total_cmp(&b[0]));
            *found.get(found.len() / 2)?
        }
    };
    let size = |c: f64| (2.0 * c).round().clamp(0.0, 1e5) as usize;
    let optics = Optics::pinhole(size(cx), size(cy), [fx, fy, cx, cy]);
    optics.fault().is_none().then_some(optics)
}

/// The text with `null` for numbers that are none (`NaN`, `Infinity`, `-Infinity`), outside of strings.
fn without_nan(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    let mut rest = text;
    let mut is_string = false;
    while let Some(at) = rest.find(['"', '\\', 'N', 'I', '-']) {
        let (before, after) = rest.split_at(at);
        out.push_str(before);
        let word = (!is_string)
            .then(|| ["NaN", "-NaN", "Infinity", "-Infinity"].into_iter().find(|word| after.starts_with(*word)))
            .flatten();
        let used = match word {
            Some(word) => {
                out.push_str("null");
                word.len()
            }
            None => {
                is_string ^= after.starts_with('"');
                // What follows a backslash in a string ends none.
                let escaped = after.chars().next().filter(|c| *c == '\\' && is_string);
                let used = escaped.map_or(1, |_| 1 + after.chars().nth(1).map_or(0, char::len_utf8));
                out.push_str(after.get(..used).unwrap_or_default());
                used
            }
        };
        rest = after.get(used..).unwrap_or_default();
    }
    out + rest
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_that_are_none_become_null_and_words_stay() {
        for (text, expected) in [
            ("[NaN, -Infinity,Infinity, -1.5]", "[null, null,null, -1.5]"),
            (r#"{"NaN": "a \" NaN \\", "b": NaN}"#, r#"{"NaN": "a \" NaN \\", "b": null}"#),
            (r#"{"é": "\é Infinity"}"#, r#"{"é": "\é Infinity"}"#),
            ("", ""),
        ] {
            assert_eq!(without_nan(text), expected);
        }
    }
}
