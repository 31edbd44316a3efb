//! When a part stood closed, stood open or moved, by the hands that moved it and by what narrations tell.

use super::Trajectory;
use crate::articulation::Action;
use crate::config;
use crate::recording::{Clip, Recording};

/// Where a part is in a frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum State {
    /// Closed.
    Closed,
    /// It stands open by so much, rad or m.
    Open(f64),
    /// It moves.
    Moving,
}

/// A motion of a part.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Motion {
    /// First and last frame.
    pub frames: [usize; 2],
    /// Whether it opens.
    pub opens: bool,
    /// How far it opens, or how far the part stood open, rad or m.
    pub opening: f64,
}

impl Motion {
    /// The motion of a clip whose hand was followed. A hand that was lost may have held the part as long as the narration
    /// says.
    #[must_use]
    pub fn held(clip: &Clip, hand: &Trajectory, opening: f64) -> Self {
        let [mut first, mut last] = hand.contact_frames();
        if !hand.ends_seen[0] {
            first = first.min(clip.start_frame);
        }
        if !hand.ends_seen[1] {
            last = last.max(clip.end_frame);
        }
        Self { frames: [first, last], opens: hand.action == Action::Open, opening }
    }
}

/// The same in seconds.
#[derive(Debug, Clone, Copy)]
struct Event {
    from: f64,
    to: f64,
    opens: bool,
    opening: f64,
}

/// All motions of one part, in the order of time.
#[derive(Debug, Clone, Default)]
pub struct Timeline {
    events: Vec<Event>,
}

impl Timeline {
    /// Of a part's motions, in any order; a part that never moves is closed.
    #[must_use]
    pub fn of(recording: &Recording, motions: &[Motion], config: &config::Hands) -> Self {
        let time = |frame: usize| {
            recording.frames.get(frame).or(recording.frames.last()).map_or(0.0, |frame| frame.timestamp_secs)
        };
        let event = |m: &Motion| Event {
            from: time(m.frames[0]) - config.moves_around_secs,
            to: time(m.frames[1]) + config.moves_around_secs,
            opens: m.opens,
            opening: m.opening,
        };
        let mut events: Vec<Event> = motions.iter().map(event).collect();
        events.sort_by(|a: &Event, b: &Event| a.from.total_cmp(&b.from));
        let cuts: Vec<f64> = recording.videos.joined.iter().skip(1).map(|v| time(v.first_frame)).collect();
        let unseen = unseen(&events, &cuts);
        events.extend(unseen);
        events.sort_by(|a: &Event, b: &Event| a.from.total_cmp(&b.from));
        Self { events }
    }

    /// Where the part is at a time, seconds.
    #[must_use]
    pub fn at(&self, secs: f64) -> State {
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

/// What happens out of sight between two videos: a part that opens twice in a row was closed in between, and the other way round;
/// in videos in between nobody knows how it stands. `cuts`: when each video but the first begins, seconds.
fn unseen(events: &[Event], cuts: &[f64]) -> Vec<Event> {
    /// Numerics: so long before the first frame of a video it is over.
    const BEFORE_SECS: f64 = 1e-3;
    let between = |pair: &[Event]| {
        let [before, after] = pair else { return None };
        let mut inside = cuts.iter().filter(|cut| **cut > before.to && **cut <= after.to);
        let first = *inside.next()?;
        let last = inside.next_back().copied().unwrap_or(first);
        let (from, to) = (first - 2.0 * BEFORE_SECS, last - BEFORE_SECS);
        let event = Event { from, to, opens: !before.opens, opening: after.opening };
        (before.opens == after.opens).then_some(event)
    };
    events.windows(2).filter_map(between).collect()
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

    #[test]
    fn what_opens_in_two_videos_was_closed_between_them() {
        let event = |from: f64, opens: bool| Event { from, to: from + 1.0, opens, opening: 0.7 };
        let of = |mut events: Vec<Event>| {
            // Videos from 0, 100, 200 and 300 s on.
            let more = unseen(&events, &[100.0, 200.0, 300.0]);
            events.extend(more);
            events.sort_by(|a, b| a.from.total_cmp(&b.from));
            Timeline { events }
        };
        let twice = of(vec![event(10.0, true), event(210.0, true)]);
        let at = [5.0, 20.0, 120.0, 200.0, 220.0, 310.0].map(|secs| twice.at(secs));
        let open = State::Open(0.7);
        assert_eq!(at, [State::Closed, open, State::Moving, State::Closed, open, open]);
        // Left open in one video it is open in the next; within a video nothing is made up.
        let left = of(vec![event(10.0, true), event(20.0, true), event(110.0, false)]);
        assert_eq!([left.at(15.0), left.at(100.0), left.at(120.0)], [open, open, State::Closed]);
        let closed_twice = of(vec![event(10.0, false), event(110.0, false)]);
        assert_eq!([closed_twice.at(50.0), closed_twice.at(100.0)], [State::Closed, open]);
    }
}
