//! A recording with a fix applied.

use nalgebra::UnitQuaternion;

use super::reading::with_axes;
use super::{Finding, Fix};
use crate::math::{Point, Pose, Vector, any_orthogonal, unit};
use crate::recording::Recording;

/// The recording with all certain fixes of the findings, and what was done, one sentence each.
#[must_use]
pub fn repaired(mut recording: Recording, findings: &[Finding]) -> (Recording, Vec<String>) {
    let mut done = Vec::new();
    for finding in findings.iter().filter(|f| f.can_be_fixed()) {
        if let Some(fix) = &finding.fix {
            apply(&mut recording, fix);
            done.push(format!("{}: {}", finding.what, finding.remedy));
        }
    }
    (recording, done)
}

fn apply(recording: &mut Recording, fix: &Fix) {
    match fix {
        Fix::Poses { reading, axes } => {
            for frame in &mut recording.frames {
                frame.world_from_camera = with_axes(&reading.of(&frame.world_from_camera), axes);
            }
        }
        Fix::Scale { factor, .. } => {
            for frame in &mut recording.frames {
                frame.world_from_camera.translation.vector *= *factor;
            }
        }
        Fix::Up(up) => turn_up(recording, up),
        Fix::PoseLag(lag) => {
            let poses: Vec<Pose> = recording.frames.iter().map(|f| f.world_from_camera).collect();
            for (i, frame) in recording.frames.iter_mut().enumerate() {
                if let Some(pose) = shifted(i, *lag).and_then(|i| poses.get(i.min(poses.len().saturating_sub(1)))) {
                    frame.world_from_camera = *pose;
                }
            }
        }
        Fix::HandLag(lag) => {
            let frames = recording.frames.len();
            recording.hands.retain_mut(|hand| match shifted(hand.frame, lag.saturating_neg()) {
                Some(frame) if frame < frames => {
                    hand.frame = frame;
                    true
                }
                _ => false,
            });
        }
        Fix::HandUnit(factor) => {
            for tip in recording.hands.iter_mut().flat_map(|h| &mut h.tips) {
                *tip = Point::from(tip.coords * *factor);
            }
        }
    }
}

/// A frame number moved by a lag; before the first one there is none.
fn shifted(frame: usize, lag: i64) -> Option<usize> {
    usize::try_from(i64::try_from(frame).ok()?.saturating_add(lag)).ok()
}

/// Turns the world so that `up` becomes +Z.
fn turn_up(recording: &mut Recording, up: &Vector) {
    let Some(up) = unit(up) else { return };
    let turn = UnitQuaternion::rotation_between(&up, &Vector::z())
        .unwrap_or_else(|| UnitQuaternion::from_scaled_axis(any_orthogonal(&up) * std::f64::consts::PI));
    for frame in &mut recording.frames {
        frame.world_from_camera = turn * frame.world_from_camera;
    }
    for tip in recording.hands.iter_mut().flat_map(|h| &mut h.tips) {
        *tip = turn * *tip;
    }
    for point in &mut recording.reconstruction {
        *point = turn * *point;
    }
}
