//! Hands (and cameras) as JSON lines, which `examples/import/` writes of HaWoR's, WiLoR's and HOI4D's results on a user's
//! machine, as their joints need a body model that each user has to get.
//!
//! The first line is `{"format": "paws-hands", "space": "camera" | "world"}`; `fps` counts times from frames, `up` (x, y, z of a
//! world), `focal_per_width` (the focal length that hands in the camera were placed with, as a share of the image's width),
//! `title` and `licence` may stand there too. Each other line is a hand, a camera, or both in turn:
//!
//! ```text
//! {"image": "0012", "side": "left", "joints": [[x, y, z], ... 21 in MANO's order], "score": 0.9, "contact": true}
//! {"frame": 12, "time": 0.4, "camera": [x, y, z, qx, qy, qz, qw]}
//! ```
//!
//! Metres; cameras are OpenCV's, `camera` maps the camera into the world. `image` is a name, `frame` a number in the video,
//! `time` seconds: one of them is needed.

use std::path::Path;

use serde::Deserialize;

use crate::error::{Error, Result};
use crate::import::ImportOptions;
use crate::import::capture::{
    At, CameraAxes, Capture, HandAt, HandStream, JointFrame, PoseAt, Poses, RawPose, RawRotation, SourceWorld,
};
use crate::import::joint_orders::JointOrder;
use crate::import::names::{ending, head};
use crate::import::text::{Lines, Unread};
use crate::math::{Vector, unit};
use crate::recording::Side;

const FORMAT: &str = "paws-hands";
/// Joints of a hand.
const JOINTS: usize = 21;

#[derive(Deserialize)]
struct HandFileHeader {
    format: String,
    space: Space,
    fps: Option<f64>,
    up: Option<[f64; 3]>,
    focal_per_width: Option<f64>,
    title: Option<String>,
    licence: Option<String>,
}

#[derive(Deserialize, PartialEq)]
#[serde(rename_all = "lowercase")]
enum Space {
    Camera,
    World,
}

#[derive(Deserialize)]
struct HandRow {
    image: Option<String>,
    frame: Option<usize>,
    time: Option<f64>,
    side: Option<Side>,
    joints: Option<Vec<Option<[f64; 3]>>>,
    contact: Option<bool>,
    score: Option<f64>,
    camera: Option<[f64; 7]>,
}

pub(super) fn detect(path: &Path) -> bool {
    path.is_file() && ending(path) == "jsonl" && head(path, 4096).contains(FORMAT)
}

pub(super) fn read(path: &Path, _options: &ImportOptions) -> Result<Capture> {
    let mut lines = Lines::open(path)?;
    let Some(first) = lines.content()? else {
        return Err(lines.fault(format!("the file is empty; expected {{\"format\": \"{FORMAT}\", ...}}")));
    };
    let header: HandFileHeader = parse(&lines, &first)?;
    if header.format != FORMAT {
        return Err(lines.fault(format!("the format is not \"{FORMAT}\"")));
    }
    let (mut hands, mut poses) = (Vec::new(), Vec::new());
    let mut unread = Unread::default();
    while let Some(line) = lines.content()? {
        let Some((pose, hand)) = unread.keep(told(&lines, &line, &header)) else { continue };
        poses.extend(pose);
        hands.extend(hand);
    }
    let dropped = unread.told("lines", hands.len() + poses.len())?;
    if hands.is_empty() && poses.is_empty() {
        return Err(Error::format(path, "lines", "no hand and no camera follows the first line"));
    }
    let frame = if header.space == Space::World { JointFrame::World } else { JointFrame::Camera(CameraAxes::Opencv) };
    let items = HandStream { frame, order: JointOrder::Mano, unit_m: 1.0, items: hands };
    Ok(Capture {
        kind: "hands".to_owned(),
        source: path.to_owned(),
        title: header.title.unwrap_or_else(|| "hands as JSON lines".to_owned()),
        licence: header.licence,
        dropped: dropped.into_iter().collect(),
        world: SourceWorld { up: header.up.and_then(|v| unit(&Vector::from(v))), ..SourceWorld::default() },
        poses: (!poses.is_empty()).then(|| Poses { items: poses, ..Poses::default() }),
        hands: (!items.items.is_empty()).then_some(items),
        hands_focal_per_width: header.focal_per_width,
        ..Capture::default()
    })
}

/// What a line tells: a camera, a hand, or both.
fn told(lines: &Lines, line: &str, header: &HandFileHeader) -> Result<(Option<PoseAt>, Option<HandAt>)> {
    let row: HandRow = parse(lines, line)?;
    let at = place(&row, header).ok_or_else(|| lines.fault("has neither image, frame nor time"))?;
    let pose = row.camera.map(|[x, y, z, a, b, c, d]| {
        let pose = RawPose { position: [x, y, z], turn: RawRotation::Quaternion([a, b, c, d]) };
        PoseAt { at: at.clone(), pose, optics: None }
    });
    match (row.joints, row.side) {
        (Some(joints), Some(side)) if joints.len() == JOINTS => {
            Ok((pose, Some(HandAt { at, side, joints, contact: row.contact, score: row.score })))
        }
        (Some(joints), Some(_)) => {
            Err(lines.fault(format!("{} joints, expected {JOINTS} in MANO's order", joints.len())))
        }
        (Some(_), None) => Err(lines.fault("has joints and no side (left or right)")),
        (None, _) if pose.is_none() => Err(lines.fault("has neither joints nor a camera")),
        (None, _) => Ok((pose, None)),
    }
}

fn parse<T: serde::de::DeserializeOwned>(lines: &Lines, text: &str) -> Result<T> {
    serde_json::from_str(text).map_err(|e| {
        // One line holds it all: only the column says more.
        let said = e.to_string();
        let said = said.split(" at line ").next().unwrap_or_default().to_owned();
        lines.fault(format!("column {}: {said}", e.column()))
    })
}

fn place(row: &HandRow, header: &HandFileHeader) -> Option<At> {
    let at = At {
        time_secs: row.time.or_else(|| {
            let fps = header.fps.filter(|f| f.is_finite() && *f > 0.0)?;
            let number = row.frame.or_else(|| row.image.as_ref()?.parse().ok())?;
            Some(number as f64 / fps)
        }),
        name: row.image.as_ref().and_then(|name| At::name(name).name),
        index: row.frame,
    };
    (at != At::default()).then_some(at)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read_text(text: &str) -> Result<Capture> {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("hands.jsonl");
        std::fs::write(&path, text).unwrap();
        read(&path, &ImportOptions::default())
    }

    fn joints(count: usize) -> String {
        format!("[{}]", vec!["[0.1, 0.2, 0.5]"; count].join(", "))
    }

    #[test]
    fn hands_and_cameras_are_read() {
        let text = format!(
            "{{\"format\": \"paws-hands\", \"space\": \"camera\", \"fps\": 30}}\n\n\
             {{\"image\": \"0015\", \"side\": \"left\", \"joints\": {}, \"contact\": true}}\n\
             {{\"frame\": 30, \"camera\": [0, 0, 1, 0, 0, 0, 1]}}\n",
            joints(21)
        );
        let capture = read_text(&text).unwrap();
        let hand = &capture.hands.as_ref().unwrap().items[0];
        assert_eq!((hand.at.name.as_deref(), hand.at.time_secs, hand.contact), (Some("0015"), Some(0.5), Some(true)));
        let pose = &capture.poses.as_ref().unwrap().items[0];
        assert_eq!((pose.at.index, pose.at.time_secs, pose.pose.position), (Some(30), Some(1.0), [0.0, 0.0, 1.0]));
    }

    #[test]
    fn what_is_wrong_is_named_with_its_line() {
        let head = "{\"format\": \"paws-hands\", \"space\": \"camera\"}\n";
        for (text, word) in [
            (String::new(), "empty"),
            ("{\"format\": \"other\", \"space\": \"camera\"}\n".to_owned(), "line 1: the format"),
            ("{\"format\": \"paws-hands\", \"space\": \"image\"}\n".to_owned(), "line 1: column"),
            (head.to_owned(), "no hand and no camera"),
            (format!("{head}{{\"frame\": 1}}\n"), "line 2: has neither joints nor a camera"),
            (format!("{head}{{\"frame\": 1, \"side\": \"left\", \"joints\": {}}}\n", joints(20)), "line 2: 20 joints"),
            (format!("{head}{{\"frame\": 1, \"joints\": {}}}\n", joints(21)), "line 2: has joints and no side"),
            (format!("{head}{{\"side\": \"left\", \"joints\": {}}}\n", joints(21)), "neither image, frame nor time"),
            (format!("{head}{{\"frame\": \"1\", \"camera\": [0]}}\n"), "line 2: column"),
            (format!("{head}{{\"frame\": 1, \"camera\": [NaN, 0, 0, 0, 0, 0, 1]}}\n"), "line 2: column"),
            (format!("{head}{{\"frame\": 1, \"cam"), "line 2: column"),
        ] {
            let error = read_text(&text).unwrap_err().to_string();
            assert!(error.contains(word) && error.contains("hands.jsonl"), "{text}: {error}");
        }
    }
}
