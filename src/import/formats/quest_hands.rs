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
    At, CameraAxes, Capture, HandAt, HandStream, JointFrame, PoseAt, Poses, QuaternionOrder, RawPose, RawRotation,
    SourceWorld,
};
use crate::import::joint_orders::JointOrder;
use crate::import::text::Lines;
use crate::import::{ImportOptions, axes};
use crate::math::{Pose, Vector};
use crate::recording::Side;

/// Joints of a hand, MANO's order.
const JOINTS: usize = 21;

/// What a line is about.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum LineSubject {
    Wrist(Side),
    Landmarks(Side),
    Head,
}

/// What a line is about, its time in seconds, and its numbers as text. `None` for other lines.
fn parts(line: &str) -> Option<(LineSubject, Option<f64>, &str)> {
    let (head, numbers) = line.split_once(':')?;
    let mut words = head.split('|').map(str::trim);
    let subject = match words.next()? {
        "Left wrist" => LineSubject::Wrist(Side::Left),
        "Right wrist" => LineSubject::Wrist(Side::Right),
        "Left landmarks" => LineSubject::Landmarks(Side::Left),
        "Right landmarks" => LineSubject::Landmarks(Side::Right),
        "Head pose" => LineSubject::Head,
        _ => return None,
    };
    let time = words.filter_map(|w| w.split_once('=')).find(|(key, _)| key.trim() == "t");
    let secs = time.and_then(|(_, ns)| ns.trim().parse::<u64>().ok()).map(|ns| ns as f64 * 1e-9);
    Some((subject, secs, numbers))
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
    let raw = RawPose { position: [x, y, z], turn: RawRotation::Quaternion(turn.coords.into()) };
    Some((raw, Pose::from_parts(Vector::new(x, y, z).into(), turn)))
}

/// What has been read of a file.
#[derive(Default)]
struct Packets {
    head: Vec<PoseAt>,
    hands: Vec<HandAt>,
    /// The wrist of each hand whose joints have not come yet.
    wrists: BTreeMap<Side, Pose>,
    /// Lines without a time, and lines of something else.
    timeless: usize,
    other: usize,
}

impl Packets {
    /// Takes one line.
    fn take(&mut self, lines: &Lines, line: &str) -> Result<()> {
        let Some((subject, secs, text)) = parts(line) else {
            self.other += 1;
            return Ok(());
        };
        let Some(secs) = secs else {
            self.timeless += 1;
            return Ok(());
        };
        match subject {
            LineSubject::Head => {
                let values = numbers(lines, text, 7)?;
                self.head.extend(pose(&values).map(|(raw, _)| PoseAt { at: At::time(secs), pose: raw, optics: None }));
            }
            LineSubject::Wrist(side) => {
                let values = numbers(lines, text, 7)?;
                match pose(&values) {
                    Some((_, wrist)) => self.wrists.insert(side, wrist),
                    None => self.wrists.remove(&side),
                };
            }
            LineSubject::Landmarks(side) => {
                let values = numbers(lines, text, 3 * JOINTS)?;
                // The wrist of the same packet stands in the line before; one wrist serves one hand.
                let Some(wrist) = self.wrists.remove(&side) else { return Ok(()) };
                let joint = |p: &[f64]| -> Option<[f64; 3]> {
                    let [x, y, z] = *p else { return None };
                    Some((wrist.translation.vector + wrist.rotation * Vector::new(x, y, z)).into())
                };
                let joints = values.chunks_exact(3).map(joint).collect();
                self.hands.push(HandAt { at: At::time(secs), side, joints, contact: None, score: None });
            }
        }
        Ok(())
    }
}

pub(super) fn read(path: &Path, _options: &ImportOptions) -> Result<Capture> {
    let mut lines = Lines::open(path)?;
    let mut packets = Packets::default();
    while let Some(line) = lines.content()? {
        packets.take(&lines, &line)?;
    }
    let Packets { head, hands: items, timeless, other, .. } = packets;
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
        world: SourceWorld { up: Some(Vector::y()), unit_m: Some(1.0), left_handed: true },
        poses: (!head.is_empty()).then(|| Poses { axes: CameraAxes::Unity, items: head, ..Poses::default() }),
        hands: (!items.is_empty()).then_some(HandStream {
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
        assert_eq!(parts("Left wrist:, 1, 2"), Some((LineSubject::Wrist(Side::Left), None, ", 1, 2")));
        let (about, secs, _) = parts("Right landmarks | f = 7 | t = 2500000000:, 1").unwrap();
        assert_eq!((about, secs), (LineSubject::Landmarks(Side::Right), Some(2.5)));
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
        let hands = read(&path, &ImportOptions::default()).unwrap().hands.unwrap();
        let [x, y, z] = hands.items[0].joints[20].unwrap();
        assert!((x - 1.0).abs() < 1e-4 && y == 2.0 && (z - 2.9).abs() < 1e-4, "{x} {y} {z}");
        std::fs::write(&path, "Left wrist:, 1, 2, 3, 0, 0, 0, 1\n").unwrap();
        assert!(read(&path, &ImportOptions::default()).unwrap_err().to_string().contains("debug info"));
    }
}
