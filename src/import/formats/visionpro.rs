//! Vision Pro Tracking Streamer: a folder with `tracking.jsonl`, `metadata.json`, and `video.mp4` where a camera was mounted.
//!
//! Matrices are 16 numbers column by column. Head and wrists are in ARKit's world (+Y up, OpenGL axes), joints in the wrist's
//! frame. A hand that is not tracked repeats its last values, at first nothing but ones and zeros.

use std::path::Path;

use nalgebra::{Matrix4, UnitQuaternion};
use serde_json::Value;

use crate::error::{Error, Result};
use crate::import::blob::inside;
use crate::import::capture::{
    At, CameraAxes, Capture, HandAt, HandStream, ImageAt, ImageSource, JointFrame, Missing, PoseAt, Poses, RawPose,
    SourceWorld,
};
use crate::import::joint_orders::JointOrder;
use crate::import::optics::{LensModel, Optics};
use crate::import::text::{Lines, Unread};
use crate::import::{ImportOptions, video};
use crate::math::{Pose, Vector};
use crate::recording::Side;

/// Joints behind the wrist, ARKit's order.
const JOINTS: [&str; 24] = [
    "thumbKnuckle",
    "thumbIntermediateBase",
    "thumbIntermediateTip",
    "thumbTip",
    "indexMetacarpal",
    "indexKnuckle",
    "indexIntermediateBase",
    "indexIntermediateTip",
    "indexTip",
    "middleMetacarpal",
    "middleKnuckle",
    "middleIntermediateBase",
    "middleIntermediateTip",
    "middleTip",
    "ringMetacarpal",
    "ringKnuckle",
    "ringIntermediateBase",
    "ringIntermediateTip",
    "ringTip",
    "littleMetacarpal",
    "littleKnuckle",
    "littleIntermediateBase",
    "littleIntermediateTip",
    "littleTip",
];

pub(super) fn detect(path: &Path) -> bool {
    path.join("tracking.jsonl").is_file() && path.join("metadata.json").is_file()
}

/// The content of `tracking.jsonl`.
#[derive(Default)]
struct Tracked {
    poses: Vec<PoseAt>,
    hands: Vec<HandAt>,
    /// Seconds since 1970 of every line.
    times: Vec<f64>,
    /// Columns of the video, from the first line.
    width: usize,
    /// Hands that were left out.
    stale: usize,
    /// What of the lines cannot be read, in words.
    dropped: Option<String>,
}

pub(super) fn read(path: &Path, options: &ImportOptions) -> Result<Capture> {
    let tracked = tracking(&path.join("tracking.jsonl"))?;
    let file = path.join("metadata.json");
    let metadata: Value = crate::json::read(&file)?;
    let mut notes = vec!["a hand that repeats its last values is taken for one that is not tracked".to_owned()];
    if tracked.stale > 0 {
        notes.push(format!("{} hands were not tracked and left out", tracked.stale));
    }
    let optics = written(&metadata, "intrinsicCalibration", &file)?.map(|v| intrinsics(&v, &file)).transpose()?;
    let camera = written(&metadata, "extrinsicCalibration", &file)?.map(|v| mounted(&v, &file)).transpose()?;
    let film = inside(path, "video.mp4")?;
    let mut missing = Vec::new();
    let is_pair = optics.is_some_and(|o| tracked.width == 2 * o.width);
    let images = match &film {
        Some(_) if is_pair => {
            missing.push(Missing {
                what: "images".to_owned(),
                why: "the video shows both eyes side by side, its calibration is one eye's".to_owned(),
                command: "ffmpeg -i video.mp4 -vf crop=iw/2:ih:0:0 left.mp4; put it in video.mp4's place".to_owned(),
            });
            Vec::new()
        }
        Some(film) => pictures(film, &tracked.times, options, &mut notes),
        None => Vec::new(),
    };
    if camera.is_none() && film.is_some() {
        notes.push("no extrinsicCalibration tells where the camera sits: the head stands for it".to_owned());
    }
    missing.push(Missing {
        what: "depth".to_owned(),
        why: "the headset gives no depth to apps: joints come from the hands, fronts and boxes are assumed".to_owned(),
        command: "run a metric depth network (MoGe-2) on the video's pictures and import its folder too".to_owned(),
    });
    Ok(Capture {
        kind: "visionpro".to_owned(),
        source: path.to_owned(),
        title: "Vision Pro recording (Tracking Streamer)".to_owned(),
        notes,
        dropped: tracked.dropped.into_iter().collect(),
        clock: Some("unix".to_owned()),
        world: SourceWorld { up: Some(Vector::y()), ..SourceWorld::default() },
        optics,
        poses: Some(Poses {
            axes: CameraAxes::Opengl,
            body_from_camera: camera,
            items: tracked.poses,
            ..Poses::default()
        }),
        images,
        hands: (!tracked.hands.is_empty()).then_some(HandStream {
            frame: JointFrame::World,
            order: JointOrder::Arkit,
            unit_m: 1.0,
            items: tracked.hands,
        }),
        missing,
        ..Capture::default()
    })
}

/// A matrix of a file, column by column; `None` where it is not 16 finite numbers.
fn matrix(json: &Value) -> Option<Matrix4<f64>> {
    let values: Vec<f64> = json.as_array()?.iter().map(Value::as_f64).collect::<Option<_>>()?;
    (values.len() == 16).then(|| Matrix4::from_column_slice(&values))
}

fn tracking(path: &Path) -> Result<Tracked> {
    let mut lines = Lines::open(path)?;
    let mut out = Tracked::default();
    let mut last: [Option<Value>; 2] = [None, None];
    let mut unread = Unread::default();
    while let Some(line) = lines.content()? {
        let mut json: Value = serde_json::from_str(&line).map_err(|e| {
            lines.fault(format!("is no JSON ({e}); a file that ends early is a copy that was not finished"))
        })?;
        let Some(time) = json["systemTime"].as_f64() else {
            return Err(lines.fault("systemTime: expected a number, the seconds since 1970"));
        };
        if out.times.is_empty() {
            out.width = json["videoWidth"].as_u64().unwrap_or(0) as usize;
        }
        let index = out.times.len();
        out.times.push(time);
        let at = At::time(time).with_index(index);
        if !json["headMatrix"].is_null() {
            let head = matrix(&json["headMatrix"]).ok_or_else(|| lines.fault("headMatrix: expected 16 numbers"));
            let rows = unread.keep(head).map(|head| head.transpose().iter().copied().collect::<Vec<f64>>());
            let pose = rows.and_then(|rows| RawPose::from_rows(&rows));
            out.poses.extend(pose.map(|pose| PoseAt { at: at.clone(), pose, optics: None }));
        }
        for ((side, key), last) in [(Side::Left, "leftHand"), (Side::Right, "rightHand")].into_iter().zip(&mut last) {
            let hand = json[key].take();
            if hand.is_null() {
                continue;
            }
            let joints = unread.keep(joints(&hand).map_err(|e| lines.fault(format!("{key}.{e}"))));
            let Some(joints) = joints else { continue };
            let is_tracked = joints.is_some() && last.as_ref() != Some(&hand);
            *last = Some(hand);
            match joints {
                Some(joints) if is_tracked => {
                    out.hands.push(HandAt { at: at.clone(), side, joints, contact: None, score: None });
                }
                _ => out.stale += 1,
            }
        }
    }
    out.dropped = unread.told("matrices or hands", out.poses.len() + out.hands.len())?;
    if out.poses.is_empty() {
        return Err(Error::format(
            path,
            "headMatrix",
            "no line has a pose of the head; was the recording stopped at once?",
        ));
    }
    Ok(out)
}

/// Joints in the world; `None` for a wrist that was never tracked.
fn joints(hand: &Value) -> std::result::Result<Option<Vec<Option<[f64; 3]>>>, String> {
    let wrist = matrix(&hand["wrist"]).ok_or_else(|| "wrist: expected 16 numbers".to_owned())?;
    if wrist == Matrix4::identity() {
        return Ok(None);
    }
    let place = |m: &Matrix4<f64>| Some([m[(0, 3)], m[(1, 3)], m[(2, 3)]]);
    let mut out = Vec::with_capacity(JOINTS.len() + 1);
    out.push(place(&wrist));
    for name in JOINTS {
        let joint = matrix(&hand[name]).ok_or_else(|| format!("{name}: expected 16 numbers"))?;
        out.push(place(&(wrist * joint)));
    }
    Ok(Some(out))
}

/// A calibration of the metadata: JSON in a string. `None` where there is none.
fn written(metadata: &Value, key: &str, file: &Path) -> Result<Option<Value>> {
    match &metadata[key] {
        Value::Null => Ok(None),
        Value::String(text) => serde_json::from_str(text)
            .map(Some)
            .map_err(|e| Error::format(file, key, format!("the string holds no JSON ({e})"))),
        other => Ok(Some(other.clone())),
    }
}

/// The left or only camera, OpenCV's lens.
fn intrinsics(json: &Value, file: &Path) -> Result<Optics> {
    let left = &json["leftIntrinsics"];
    let number = |key: &str| {
        let fault = || Error::format(file, format!("intrinsicCalibration.leftIntrinsics.{key}"), "expected a number");
        left[key].as_f64().filter(|n| n.is_finite()).ok_or_else(fault)
    };
    let d: Vec<f64> = left["distortionCoeffs"].as_array().into_iter().flatten().filter_map(Value::as_f64).collect();
    let at = |i: usize| d.get(i).copied().unwrap_or(0.0);
    // OpenCV's order: k1, k2, p1, p2, k3 to k6.
    let lens = LensModel::OpenCv { k: [at(0), at(1), at(4), at(5), at(6), at(7)], p: [at(2), at(3)] };
    let (width, height) = (number("imageWidth")?.max(0.0) as usize, number("imageHeight")?.max(0.0) as usize);
    let lens = if d.iter().all(|c| *c == 0.0) { LensModel::Pinhole } else { lens };
    let optics =
        Optics { width, height, fx: number("fx")?, fy: number("fy")?, cx: number("cx")?, cy: number("cy")?, lens };
    match optics.fault() {
        Some(fault) => Err(Error::format(file, "intrinsicCalibration.leftIntrinsics", fault)),
        None => Ok(optics),
    }
}

/// The camera on the head, both with OpenCV axes. The file's matrix leads from the head (OpenGL axes) into the camera, whose
/// axes it does not name: a camera that looks where the head looks is told by where ahead leads.
fn mounted(json: &Value, file: &Path) -> Result<Pose> {
    let key = "extrinsicCalibration.leftHeadToCamera";
    let fault = || Error::format(file, key, "expected 16 numbers, a rigid transform column by column");
    let m = matrix(&json["leftHeadToCamera"]).ok_or_else(fault)?;
    let turn = m.fixed_view::<3, 3>(0, 0).into_owned();
    if (turn * turn.transpose() - nalgebra::Matrix3::identity()).norm() > 0.05 || turn.determinant() < 0.0 {
        return Err(fault());
    }
    let rotation = UnitQuaternion::from_rotation_matrix(&nalgebra::Rotation3::from_matrix_unchecked(turn));
    let camera_from_head = Pose::from_parts(Vector::new(m[(0, 3)], m[(1, 3)], m[(2, 3)]).into(), rotation);
    let half_turn = UnitQuaternion::from_scaled_axis(Vector::x() * std::f64::consts::PI);
    let flip = Pose::from_parts(Vector::zeros().into(), half_turn);
    let ahead = rotation * -Vector::z();
    let camera_from_head = if ahead.z < 0.0 { flip * camera_from_head } else { camera_from_head };
    Ok(flip * camera_from_head.inverse())
}

/// The video's pictures: one a line where they are as many, else by the file's own times.
fn pictures(film: &Path, times: &[f64], options: &ImportOptions, notes: &mut Vec<String>) -> Vec<ImageAt> {
    let own = video::times(options.ffmpeg.as_deref(), film).unwrap_or_default();
    let first = times.first().copied().unwrap_or(0.0);
    let times: Vec<f64> = if own.is_empty() || own.len() == times.len() {
        times.to_vec()
    } else {
        notes.push(format!("the video has {} pictures for {} lines: its own times are taken", own.len(), times.len()));
        own.iter().map(|t| first + t).collect()
    };
    let image = |(index, time): (usize, &f64)| ImageAt {
        at: At::time(*time).with_index(index),
        picture: ImageSource::Video { file: film.to_owned(), index, upright: true },
        optics: None,
    };
    times.iter().enumerate().map(image).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    /// 3 cm above and 5 cm before the head, looking where it looks: told alike in both axes that the file may have.
    #[test]
    fn a_mounted_camera_is_where_it_is_in_either_axes() {
        // Camera from head, OpenCV axes: x, -y, -z, then the place of the head in it.
        let opencv = [1, 0, 0, 0, 0, -1, 0, 0, 0, 0, -1, 0].map(f64::from);
        let opengl = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0].map(f64::from);
        for (turn, place) in [(opencv, [0.0, 0.03, -0.05, 1.0]), (opengl, [0.0, -0.03, 0.05, 1.0])] {
            let numbers = [turn.to_vec(), place.to_vec()].concat();
            let pose = mounted(&json!({"leftHeadToCamera": numbers}), Path::new("m")).unwrap();
            assert!(pose.rotation.angle() < 1e-9, "{pose}");
            assert!((pose.translation.vector - Vector::new(0.0, -0.03, 0.05)).norm() < 1e-9, "{pose}");
        }
        assert!(mounted(&json!({"leftHeadToCamera": [1, 2]}), Path::new("m")).is_err());
    }
}
