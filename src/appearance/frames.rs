//! Which frames show what: when each part stood closed or open, and the frames that tell most about the room.

use crate::articulation::Action;
use crate::config;
use crate::math::Vector;
use crate::pipeline::{Scene, SceneJoint};
use crate::recording::{AtWork, Recording};

/// Contact flags begin late and end early by a fraction of a second.
const AROUND_SECS: f64 = 0.3;
/// Fewer frames than this with a depth factor of their own do not show a room: then all count.
const ENOUGH: usize = 30;

/// Where a part is in a frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum State {
    /// Closed.
    Closed,
    /// It stands open by so much, rad or m.
    Open(f64),
    /// It moves.
    Moving,
}

/// A motion of a part: seconds from and to, and the opening that it ends at.
#[derive(Debug, Clone, Copy)]
struct Event {
    from: f64,
    to: f64,
    opens: bool,
    opening: f64,
}

/// All motions of one joint, in the order of time.
#[derive(Debug, Clone, Default)]
pub(super) struct Timeline {
    events: Vec<Event>,
}

impl Timeline {
    fn of(recording: &Recording, scene: &Scene, joint: &SceneJoint) -> Self {
        let time = |frame: usize| {
            recording.frames.get(frame).or(recording.frames.last()).map_or(0.0, |frame| frame.timestamp_secs)
        };
        let named = |name: &str| scene.clips.iter().find(|c| c.clip.clip == name);
        let mut events = Vec::new();
        for (name, opening) in joint.clips.iter().zip(&joint.moved) {
            let Some(clip) = named(name) else { continue };
            let Some(hand) = &clip.trajectory else { continue };
            let [mut first, mut last] = hand.contact_frames();
            // A hand that was lost may have held the part as long as the narration says.
            if !hand.ends_seen[0] {
                first = first.min(clip.clip.start_frame);
            }
            if !hand.ends_seen[1] {
                last = last.max(clip.clip.end_frame);
            }
            events.push(Event {
                from: time(first) - AROUND_SECS,
                to: time(last) + AROUND_SECS,
                opens: hand.action == Action::Open,
                opening: *opening,
            });
        }
        for told in &joint.told {
            let Some(clip) = named(&told.clip) else { continue };
            let Some(hand) = named(&told.with).and_then(|c| c.trajectory.as_ref()) else { continue };
            let opening = joint.shown_by(&told.clip).and_then(|i| joint.moved.get(i)).copied().unwrap_or(0.0);
            events.push(Event {
                from: time(clip.clip.start_frame) - AROUND_SECS,
                to: time(clip.clip.end_frame) + AROUND_SECS,
                opens: hand.action == Action::Close,
                opening,
            });
        }
        events.sort_by(|a: &Event, b: &Event| a.from.total_cmp(&b.from));
        Self { events }
    }

    /// Where the part is at a time, seconds.
    pub(super) fn at(&self, secs: f64) -> State {
        if self.events.iter().any(|e| (e.from..=e.to).contains(&secs)) {
            return State::Moving;
        }
        let before = self.events.iter().rfind(|e| e.to < secs);
        match (before, self.events.first()) {
            (Some(event), _) if event.opens => State::Open(event.opening),
            // What is closed first was open before.
            (None, Some(event)) if !event.opens => State::Open(event.opening),
            _ => State::Closed,
        }
    }
}

/// The timeline of every joint of a scene, in its order.
pub(super) fn timelines(recording: &Recording, scene: &Scene) -> Vec<Timeline> {
    scene.joints.iter().map(|joint| Timeline::of(recording, scene, joint)).collect()
}

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
    let Some(frame) = recording.frames.get(frame) else { return false };
    let before = joint.face.is_none_or(|face| face.normal.dot(&(frame.center() - face.center)) > 0.0);
    let local = frame.world_from_camera.inverse() * joint.grip;
    let there = recording.camera.project(&local).is_some_and(|(u, v)| recording.camera.contains(u, v));
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
    let mut distance = vec![f64::INFINITY; views.len()];
    let mut chosen = Vec::new();
    let mut next = (!views.is_empty() && count > 0).then_some(0);
    while let Some(i) = next {
        chosen.push(candidates[i]);
        if chosen.len() >= count.min(views.len()) {
            break;
        }
        let from = views[i];
        distance[i] = f64::NEG_INFINITY;
        for (d, view) in distance.iter_mut().zip(&views) {
            *d = d.min((view[0] - from[0]).norm() + (view[1] - from[1]).norm());
        }
        next = (0..views.len())
            .filter(|&j| distance[j] > f64::NEG_INFINITY)
            .max_by(|&a, &b| distance[a].total_cmp(&distance[b]).then(b.cmp(&a)));
    }
    chosen.sort_unstable();
    chosen
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_part_is_open_from_its_opening_to_its_closing_and_moves_in_between() {
        let event = |from: f64, to: f64, opens: bool| Event { from, to, opens, opening: 0.7 };
        let timeline = Timeline { events: vec![event(2.0, 3.0, true), event(6.0, 7.0, false)] };
        for (secs, expected) in [
            (1.0, State::Closed),
            (2.5, State::Moving),
            (4.0, State::Open(0.7)),
            (6.5, State::Moving),
            (8.0, State::Closed),
        ] {
            assert_eq!(timeline.at(secs), expected, "{secs}");
        }
        let left_open = Timeline { events: vec![event(6.0, 7.0, false)] };
        assert_eq!([left_open.at(1.0), left_open.at(9.0)], [State::Open(0.7), State::Closed]);
        assert_eq!(Timeline::default().at(1.0), State::Closed);
    }
}
