//! Which recorded frames a twin is compared with, and how far its parts stand open in each.

use std::collections::BTreeMap;

use crate::config;
use crate::hands::timeline::{State, Timeline};
use crate::recording::{AtWork, Recording};
use crate::twin::Twin;

/// A frame to compare with.
#[derive(Debug, Clone, PartialEq)]
pub struct Shot {
    /// Frame index.
    pub frame: usize,
    /// Opening of each of the twin's parts, rad or m; 0 = closed.
    pub openings: Vec<f64>,
}

impl Shot {
    /// Numbers of the parts that stand open.
    #[must_use]
    pub fn opened(&self) -> Vec<usize> {
        (0..self.openings.len()).filter(|i| self.openings[*i] != 0.0).collect()
    }
}

/// The frames of a recording by how things stand in them.
#[derive(Debug, Clone, PartialEq)]
pub struct Shots {
    /// All frames with an image in which everything is closed and nobody works; where there is none of these, those in which
    /// everything is closed.
    pub closed: Vec<usize>,
    /// The chosen ones of them and of those in which parts stand open and none moves, ascending.
    pub chosen: Vec<Shot>,
}

/// Chooses frames. `timelines`: of the twin's parts, in its order.
#[must_use]
pub fn choose(recording: &Recording, twin: &Twin, timelines: &[Timeline], config: &config::Comparison) -> Shots {
    let at_work = AtWork::of(recording);
    let with_image =
        (0..recording.frames.len()).filter(|f| recording.frames.get(*f).is_some_and(|f| f.files.rgb.is_some()));
    let resting: Vec<Shot> = with_image.filter_map(|frame| standing(recording, timelines, frame)).collect();
    let all_closed: Vec<usize> = resting.iter().filter(|s| s.opened().is_empty()).map(|s| s.frame).collect();
    let quiet: Vec<usize> = all_closed.iter().copied().filter(|f| !at_work.any(*f)).collect();
    let closed = if quiet.is_empty() { all_closed } else { quiet };
    let mut chosen: BTreeMap<usize, Shot> = BTreeMap::new();
    for frame in evenly(&closed, config.frames) {
        chosen.insert(frame, Shot { frame, openings: vec![0.0; timelines.len()] });
    }
    for part in 0..timelines.len() {
        let shown: Vec<usize> = (0..resting.len()).filter(|i| shows(recording, twin, &resting[*i], part)).collect();
        for i in evenly(&shown, config.open_frames) {
            chosen.insert(resting[i].frame, resting[i].clone());
        }
    }
    Shots { closed, chosen: chosen.into_values().collect() }
}

/// How the parts stand in a frame; `None` where one moves.
fn standing(recording: &Recording, timelines: &[Timeline], frame: usize) -> Option<Shot> {
    let secs = recording.frames.get(frame)?.timestamp_secs;
    let opening = |timeline: &Timeline| match timeline.at(secs) {
        State::Closed => Some(0.0),
        State::Open(opening) => Some(opening),
        State::Moving => None,
    };
    Some(Shot { frame, openings: timelines.iter().map(opening).collect::<Option<_>>()? })
}

/// Whether a part stands open in a frame and its middle is in the image.
fn shows(recording: &Recording, twin: &Twin, shot: &Shot, part: usize) -> bool {
    let Some(opening) = shot.openings.get(part).filter(|o| **o != 0.0) else { return false };
    let (Some(frame), Some(piece)) = (recording.frames.get(shot.frame), twin.furniture.get(part)) else { return false };
    let middle = piece.part.joint.articulation.motion(*opening) * piece.part.bounds.center;
    let local = frame.world_from_camera.inverse() * middle;
    let camera = recording.camera_of(shot.frame);
    camera.project(&local).is_some_and(|(u, v)| camera.contains(u, v))
}

/// Up to `count` of a list, evenly over it.
fn evenly(list: &[usize], count: usize) -> Vec<usize> {
    let count = count.min(list.len());
    (0..count).map(|i| list[(2 * i + 1) * list.len() / (2 * count)]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_list_is_taken_from_evenly() {
        let list: Vec<usize> = (10..20).collect();
        assert_eq!(evenly(&list, 2), [12, 17]);
        assert_eq!(evenly(&list, 99), list);
        assert!(evenly(&[], 3).is_empty() && evenly(&list, 0).is_empty());
    }
}
