//! Which frames show what: when each part stood closed or open, and the frames that tell most about the room.

use crate::config;
pub(super) use crate::hands::timeline::{State, Timeline};
use crate::math::{Vector, sampling};
use crate::pipeline::{Scene, SceneJoint};
use crate::recording::{AtWork, Recording};

/// Fewer frames than this with a depth factor of their own do not show a room: then all count.
const ENOUGH: usize = 30;

/// The frames to look at, ascending: spread over viewpoints, those in which all is closed and nobody works first, and for each
/// joint some in which its part stands open.
pub(super) fn choose(
    recording: &Recording,
    scene: &Scene,
    timelines: &[Timeline],
    config: &config::Appearance,
) -> Vec<usize> {
    let at_work = AtWork::of(recording);
    let with_depth: Vec<usize> = (0..recording.frames.len()).filter(|&f| recording.has_depth(f)).collect();
    let known: Vec<usize> =
        with_depth.iter().copied().filter(|f| scene.depth_factors.by_frame.contains_key(f)).collect();
    // Another frame's depth is off by a factor that nobody knows.
    let candidates = if known.len() >= ENOUGH { &known } else { &with_depth };
    let states = |frame: usize| {
        let secs = recording.frames.get(frame).map_or(0.0, |f| f.timestamp_secs);
        timelines.iter().map(move |t| t.at(secs))
    };
    let quiet: Vec<usize> =
        candidates.iter().copied().filter(|&f| !at_work.any(f) && states(f).all(|s| s == State::Closed)).collect();
    let mut chosen = spread(recording, &quiet, config.frames);
    if chosen.len() < config.frames / 2 {
        let rest: Vec<usize> = candidates
            .iter()
            .copied()
            .filter(|f| quiet.binary_search(f).is_err() && states(*f).all(|s| s != State::Moving))
            .collect();
        chosen.extend(spread(recording, &rest, config.frames - chosen.len()));
    }
    for (joint, timeline) in scene.joints.iter().zip(timelines) {
        let open = |&f: &usize| {
            let secs = recording.frames.get(f).map_or(0.0, |f| f.timestamp_secs);
            matches!(timeline.at(secs), State::Open(_))
                && states(f).all(|s| s != State::Moving)
                && faces(recording, f, joint)
        };
        let mut shown: Vec<usize> = candidates.iter().copied().filter(open).collect();
        if shown.is_empty() {
            shown = with_depth.iter().copied().filter(open).collect();
        }
        chosen.extend(spread(recording, &shown, config.open_frames));
    }
    chosen.sort_unstable();
    chosen.dedup();
    chosen
}

/// Whether the place of a joint's grip is in a frame, from before the front and near enough to tell its inside.
fn faces(recording: &Recording, frame: usize, joint: &SceneJoint) -> bool {
    const NEAR_M: f64 = 3.5;
    let camera = recording.camera_of(frame);
    let Some(frame) = recording.frames.get(frame) else { return false };
    let before = joint.face.is_none_or(|face| face.normal.dot(&(frame.center() - face.center)) > 0.0);
    let local = frame.world_from_camera.inverse() * joint.grip;
    let there = camera.project(&local).is_some_and(|(u, v)| camera.contains(u, v));
    before && there && (0.2..NEAR_M).contains(&local.z)
}

/// Up to `count` of the candidates by farthest-point sampling over where cameras are and where they look.
fn spread(recording: &Recording, candidates: &[usize], count: usize) -> Vec<usize> {
    /// A turn by one radian shows as much of something else as a step of this many metres.
    const TURN_M: f64 = 1.0;
    let views: Vec<[Vector; 2]> = candidates
        .iter()
        .filter_map(|&f| recording.frames.get(f))
        .map(|f| [f.center().coords, f.world_from_camera.rotation * Vector::z() * TURN_M])
        .collect();
    let apart = |a: usize, b: usize| (views[b][0] - views[a][0]).norm() + (views[b][1] - views[a][1]).norm();
    let chosen = sampling::farthest(views.len(), 0, count, apart);
    let mut frames: Vec<usize> = chosen.into_iter().filter_map(|i| candidates.get(i).copied()).collect();
    frames.sort_unstable();
    frames
}
