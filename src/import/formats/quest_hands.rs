//! Hand Tracking Streamer (Quest): its lines of text, as a program that received them wrote them down.
//!
//! `Right wrist | f = 1 | t = 123456: , x, y, z, qx, qy, qz, qw` and `Right landmarks ...: , x, y, z, ...` (21 joints in the wrist's
//! frame), `Head pose ...` alike. Unity's world and axes (left-handed, +Y up, metres). Only lines with `t` (nanoseconds of the
//! headset's running clock) can be joined with anything.

use std::collections::BTreeMap;
use std::path::Path;

use nalgebra::{Quaternion, UnitQuaternion};

use super::quest::CLOCK;
use crate::error::{Error, Result};
use crate::import::capture::{
    At, CameraAxes, Capture, HandAt, Hands, JointFrame, PoseAt, Poses, QuaternionOrder, RawPose, Turn, World,
};
use crate::import::joints::JointOrder;
use crate::import::text::Lines;
use crate::import::{Options, axes};
use crate::math::{Pose, Vector};
use crate::recording::Side;

/// Joints of a hand, MANO's order.
const JOINTS: usize = 21;

/// What a line is about.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum About {
    Wrist(Side),
    Landmarks(Side),
    Head,
}

/// What a line is about, its time in seconds, and its numbers as text. `None` for other lines.
fn parts(line: &str) -> Option<(About, Option<f64>, &str)> {
    let (head, numbers) = line.split_once(':')?;
    let mut words = head.split('|').map(str::trim);
    let about = match words.next()? {
        "Left wrist" => About::Wrist(Side::Left),
        "Right wrist" => About::Wrist(Side::Right),
        "Left landmarks" => About::Landmarks(Side::Left),
        "Right landmarks" => About::Landmarks(Side::Right),
        "Head pose" => About::Head,
        _ => return None,
    };
    let time = words.filter_map(|w| w.split_once('=')).find(|(key, _)| key.trim() == "t");
    let secs = time.and_then(|(_, ns)| ns.trim().parse::<u64>().ok()).map(|ns| ns as f64 * 1e-9);
    Some((about, secs, numbers))
}

pub(super) fn detect(path: &Path) -> bool {
    let ending = path.extension().and_then(|e| e.to_str()).unwrap_or_default();
    if !["txt", "log", "csv"].contains(&ending) || !path.is_file() {
        return false;
    }
    let first = Lines::open(path).and_then(|mut lines| lines.content());
    first.ok().flatten().is_some_and(|line| parts(&line).is_some())
}

/// Numbers behind the colon.
fn numbers(lines: &Lines, text: &str, count: usize) -> Result<Vec<f64>> {
    let cells: Vec<&str> = text.split(',').map(str::trim).filter(|c| !c.is_empty()).collect();
    if cells.len() != count {
        return Err(lines.fault(format!("{} numbers, expected {count}", cells.len())));
    }
    cells.into_iter().map(|c| lines.number("value", c)).collect()
}

/// A pose in Unity's axes; `None` where the quaternion has not the length 1.
fn pose(values: &[f64]) -> Option<(RawPose, Pose)> {
    let [x, y, z, a, b, c, d] = *values else { return None };
    axes::quaternion([a, b, c, d], QuaternionOrder::Xyzw)?;
    let turn = UnitQuaternion::from_quaternion(Quaternion::new(d, a, b, c));
    let raw = RawPose { position: [x, y, z], turn: Turn::Quaternion(turn.coords.into()) };
    Some((raw, Pose::from_parts(Vector::new(x, y, z).into(), turn)))
}

pub(super) fn read(path: &Path, _options: &Options) -> Result<Capture> {
    let mut lines = Lines::open(path)?;
    let (mut head, mut items) = (Vec::new(), Vec::new());
    let mut wrists: BTreeMap<Side, Pose> = BTreeMap::new();
    let (mut timeless, mut other) = (0, 0);
    while let Some(line) = lines.content()? {
        let Some((about, secs, text)) = parts(&line) else {
            other += 1;
            continue;
        };
        let Some(secs) = secs else {
            timeless += 1;
            continue;
        };
        match about {
            About::Head => {
                let values = numbers(&lines, text, 7)?;
                head.extend(pose(&values).map(|(raw, _)| PoseAt { at: At::time(secs), pose: raw, optics: None }));
            }
            About::Wrist(side) => {
                let values = numbers(&lines, text, 7)?;
                match pose(&values) {
                    Some((_, wrist)) => wrists.insert(side, wrist),
                    None => wrists.remove(&side),
                };
            }
            About::Landmarks(side) => {
                let values = numbers(&lines, text, 3 * JOINTS)?;
                // The wrist of the same packet stands in the line before; one wrist serves one hand.
                let Some(wrist) = wrists.remove(&side) else { continue };
                let joint = |p: &[f64]| -> Option<[f64; 3]> {
                    let [x, y, z] = *p else { return None };
                    Some((wrist.translation.vector + wrist.rotation * Vector::new(x, y, z)).into())
                };
                let joints = values.chunks_exact(3).map(joint).collect();
                items.push(HandAt { at: At::time(secs), side, joints, contact: None, score: None });
            }
        }
    }
    if items.is_empty() && head.is_empty() {
        let message = format!(
            "none of its lines has a time ({timeless} of wrists, hands and head without one): switch \"Show debug info\" on in \
             the app, which then writes \"| t = NANOSECONDS\""
        );
        return Err(Error::format(path, "lines", message));
    }
    let mut notes =
        vec!["hands without contact; the head stands for the camera where no other source has poses".to_owned()];
    for (count, what) in [(timeless, "lines without a time"), (other, "lines of something else")] {
        if count > 0 {
            notes.push(format!("{count} {what} were left out"));
        }
    }
    Ok(Capture {
        kind: "quest-hands".to_owned(),
        source: path.to_owned(),
        title: "Hand Tracking Streamer (Quest)".to_owned(),
        notes,
        clock: Some(CLOCK.to_owned()),
        world: World { up: Some(Vector::y()), unit_m: Some(1.0), left_handed: true },
        poses: (!head.is_empty()).then(|| Poses { axes: CameraAxes::Unity, items: head, ..Poses::default() }),
        hands: (!items.is_empty()).then_some(Hands {
            frame: JointFrame::World,
            order: JointOrder::Mano,
            unit_m: 1.0,
            items,
        }),
        ..Capture::default()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_say_what_they_are_about_and_when() {
        assert_eq!(parts("Left wrist:, 1, 2"), Some((About::Wrist(Side::Left), None, ", 1, 2")));
        let (about, secs, _) = parts("Right landmarks | f = 7 | t = 2500000000:, 1").unwrap();
        assert_eq!((about, secs), (About::Landmarks(Side::Right), Some(2.5)));
        assert_eq!(parts("1.0 2.0"), None);
    }

    /// The sum of both, in whatever handedness they are: only the wrist's turn and place count.
    #[test]
    fn joints_are_put_at_the_wrist() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("hands.txt");
        let joints = [", 0.1, 0, 0"; JOINTS].concat();
        // A quarter turn about Y takes x to -z.
        let text = format!(
            "Left wrist | f = 1 | t = 1000000000:, 1, 2, 3, 0, 0.70711, 0, 0.70711\nLeft landmarks | f = 1 | t = 1000000000:{joints}\n"
        );
        std::fs::write(&path, text).unwrap();
        assert!(detect(&path));
        let hands = read(&path, &Options::default()).unwrap().hands.unwrap();
        let [x, y, z] = hands.items[0].joints[20].unwrap();
        assert!((x - 1.0).abs() < 1e-4 && y == 2.0 && (z - 2.9).abs() < 1e-4, "{x} {y} {z}");
        std::fs::write(&path, "Left wrist:, 1, 2, 3, 0, 0, 0, 1\n").unwrap();
        assert!(read(&path, &Options::default()).unwrap_err().to_string().contains("debug info"));
    }
}
