//! Interactions in a recording in which nobody said when they are: a hand takes hold, moves along a line or an arc, lets go, and
//! what is around has changed. Without depth the motion and flags alone tell, which asks for more of them and is less sure.

use rayon::prelude::*;

use super::Every;
use super::contact::view::View;
use super::contact::{Flags, Widths, between, lasts};
use super::contact::{alone, motion};
use crate::config;
use crate::math::{Point, stats};
use crate::recording::{Clip, Recording, Side};

/// Clips of all interactions that open or close something, in time order; of words they have "open" and "close" at most, where
/// one takes back what another did.
/// A frame that cannot be decoded tells nothing here; the pipeline names it.
#[must_use]
pub fn interactions(recording: &Recording, config: &config::Hands) -> Vec<Clip> {
    let rules = &config.found;
    let mut walks: Vec<Walk> = [Side::Right, Side::Left].iter().map(|side| Walk::of(recording, *side, rules)).collect();
    let tremble = motion::tremble_m(walks.iter().map(|w| (w.times.as_slice(), w.places.as_slice())), config);
    distances_now(recording, &mut walks, config);
    distances_still(recording, &mut walks, config);
    let by_motion = with_depth(recording).is_empty().then_some(config.found_by_motion_nats);
    let mut candidates: Vec<Candidate> =
        walks.iter().enumerate().flat_map(|(w, walk)| walk.candidates(w, tremble, by_motion, config)).collect();
    candidates
        .sort_by(|a, b| b.nats.total_cmp(&a.nats).then((a.walk, a.first, a.last).cmp(&(b.walk, b.first, b.last))));
    let mut chosen: Vec<Candidate> = Vec::new();
    for candidate in candidates {
        if chosen.iter().all(|other| candidate.is_another_than(other, &walks, rules)) {
            chosen.push(candidate);
        }
    }
    let temperature = (config.correlation_secs / rules.sample_secs).max(1.0);
    let seen: Vec<f64> = chosen.par_iter().map(|c| changed_nats(recording, &walks, c, config)).collect();
    let mut likely: Vec<(Candidate, f64)> = Vec::new();
    for (candidate, seen) in chosen.into_iter().zip(seen) {
        // Of two hands at work at once one holds and one goes along, unless both are seen to have changed something.
        let alone = likely.iter().all(|(other, theirs)| {
            other.walk == candidate.walk || !candidate.overlaps(other, &walks, rules) || (seen > 0.0 && *theirs > 0.0)
        });
        let is_enough = by_motion.is_some() || candidate.nats / temperature + seen > rules.enough_nats;
        if alone && is_enough {
            likely.push((candidate, seen));
        }
    }
    let mut moves: Vec<Move> = likely.iter().map(|(c, _)| walks[c.walk].moved(c, config)).collect();
    moves.sort_by_key(|m| m.frames);
    let moves = in_one_go(recording, &moves, rules);
    clips(recording, &moves, rules)
}

/// A found interaction.
#[derive(Debug, Clone, Copy)]
struct Move {
    /// The hand.
    walk: usize,
    /// First and last frame of the hold.
    frames: [usize; 2],
    /// Where the hand is there.
    ends: [Point; 2],
}

/// Moves in time order; what went on where it had stopped a moment before, and the same way, is one.
fn in_one_go(recording: &Recording, moves: &[Move], rules: &config::Found) -> Vec<Move> {
    let time = |f: usize| recording.frames[f].timestamp_secs;
    let mut joined: Vec<Move> = Vec::new();
    for next in moves {
        let goes_on = joined.iter_mut().rfind(|last| last.walk == next.walk).filter(|last| {
            let (a, b) = (last.ends[1] - last.ends[0], next.ends[1] - next.ends[0]);
            time(next.frames[0]) - time(last.frames[1]) <= rules.pause_secs
                && (next.ends[0] - last.ends[1]).norm() <= rules.pause_m
                // A door turns by less than a right angle in each go.
                && a.dot(&b) > 0.0
        });
        match goes_on {
            Some(last) => (last.frames[1], last.ends[1]) = (next.frames[1], next.ends[1]),
            None => joined.push(*next),
        }
    }
    joined
}

/// Which of two moves of one part opens it: the one that a later one takes back. Empty where a move has no counterpart.
fn verbs(moves: &[Move], rules: &config::Found) -> Vec<&'static str> {
    let mut verbs = vec![""; moves.len()];
    for later in 0..moves.len() {
        // The last one that stands open: what is closed twice was opened in between.
        let back = (0..later).rev().find(|&earlier| {
            let (a, b) = (&moves[earlier], &moves[later]);
            let length = (a.ends[1] - a.ends[0]).norm().max((b.ends[1] - b.ends[0]).norm());
            let reversed = (a.ends[1] - a.ends[0]).dot(&(b.ends[1] - b.ends[0])) < -rules.back_share * length * length;
            let near = (a.ends[1] - b.ends[0]).norm() < rules.same_m;
            verbs[earlier] != "close" && near && reversed
        });
        if let Some(earlier) = back {
            (verbs[earlier], verbs[later]) = ("open", "close");
        }
    }
    verbs
}

/// Clips around holds; neighbours share no frame.
fn clips(recording: &Recording, moves: &[Move], rules: &config::Found) -> Vec<Clip> {
    let holds: Vec<[usize; 2]> = moves.iter().map(|m| m.frames).collect();
    let verbs = verbs(moves, rules);
    let time = |f: usize| recording.frames[f].timestamp_secs;
    (0..holds.len())
        .map(|i| {
            let [first, last] = holds[i];
            let floor = i.checked_sub(1).map_or(0, |j| holds[j][1].midpoint(first).max(holds[j][1]) + 1).min(first);
            let ceiling = holds.get(i + 1).map_or(recording.frames.len() - 1, |next| last.midpoint(next[0])).max(last);
            let start_frame = (floor..=first).find(|&f| time(first) - time(f) <= rules.around_secs).unwrap_or(first);
            let end_frame = (last..=ceiling).rev().find(|&f| time(f) - time(last) <= rules.around_secs).unwrap_or(last);
            let verb = verbs[i].to_owned();
            Clip {
                clip: format!("found_{i:03}"),
                start_frame,
                end_frame,
                narration: String::new(),
                verb,
                noun: String::new(),
            }
        })
        .collect()
}

/// One hand through the whole recording.
struct Walk {
    frames: Vec<usize>,
    times: Vec<f64>,
    places: Vec<Point>,
    /// Distance to the nearest surface, metres: now, before the hand came, after it left. `None` where nobody knows.
    now: Vec<Option<f64>>,
    before: Vec<Option<f64>>,
    after: Vec<Option<f64>>,
    /// What a detector said of contact.
    flags: Vec<Option<bool>>,
}

#[derive(Debug, Clone, Copy)]
struct Candidate {
    walk: usize,
    first: usize,
    last: usize,
    nats: f64,
}

impl Candidate {
    /// Whether both can be interactions: one hand holds one thing at a time, and two hands that go one way are at one part.
    fn is_another_than(&self, other: &Self, walks: &[Walk], rules: &config::Found) -> bool {
        let way = |c: &Self| walks[c.walk].places[c.last] - walks[c.walk].places[c.first];
        let (one, two) = (way(self), way(other));
        let together = (one - two).norm() < rules.together_share * one.norm().max(two.norm());
        match self.walk == other.walk {
            true => self.shared_secs(other, walks) <= 0.0,
            false => !self.overlaps(other, walks, rules) || !together,
        }
    }

    /// Seconds that two share; below 0 the time between them.
    fn shared_secs(&self, other: &Self, walks: &[Walk]) -> f64 {
        let ([from, to], [a, b]) = (self.times(walks), other.times(walks));
        to.min(b) - from.max(a)
    }

    fn overlaps(&self, other: &Self, walks: &[Walk], rules: &config::Found) -> bool {
        let secs = |c: &Self| c.times(walks)[1] - c.times(walks)[0];
        self.shared_secs(other, walks) > rules.shared * secs(self).min(secs(other))
    }

    fn times(&self, walks: &[Walk]) -> [f64; 2] {
        [self.first, self.last].map(|i| walks[self.walk].times[i])
    }
}

impl Walk {
    fn of(recording: &Recording, side: Side, rules: &config::Found) -> Self {
        let mut every = Every::secs(rules.sample_secs);
        let own = recording.hands.iter().filter(|s| s.side == side);
        let samples: Vec<_> = own.filter(|s| every.is_due(recording.frames[s.frame].timestamp_secs)).collect();
        let n = samples.len();
        Self {
            frames: samples.iter().map(|s| s.frame).collect(),
            times: samples.iter().map(|s| recording.frames[s.frame].timestamp_secs).collect(),
            places: samples.iter().map(|s| s.grasp()).collect(),
            now: vec![None; n],
            before: vec![None; n],
            after: vec![None; n],
            flags: samples.iter().map(|s| s.contact).collect(),
        }
    }

    fn moved(&self, candidate: &Candidate, config: &config::Hands) -> Move {
        let calm = motion::calmed(&self.times, &self.places, config);
        let ends = [candidate.first, candidate.last];
        Move { walk: candidate.walk, frames: ends.map(|i| self.frames[i]), ends: ends.map(|i| calm[i]) }
    }

    /// Whether the hand was elsewhere right before the one sample and right after the other, as it is around a hold: one that
    /// reaches begins where it was at rest.
    fn comes_and_goes(&self, first: usize, last: usize, rules: &config::Found) -> bool {
        let away = |from: usize, i: usize| (self.places[i] - self.places[from]).norm() >= rules.elsewhere_m;
        (0..first)
            .rev()
            .take_while(|&i| self.times[first] - self.times[i] <= rules.elsewhere_within_secs)
            .any(|i| away(first, i))
            && (last + 1..self.times.len())
                .take_while(|&i| self.times[i] - self.times[last] <= rules.elsewhere_within_secs)
                .any(|i| away(last, i))
    }

    /// All pairs of a start and an end of a hold for which enough speaks: `by_motion`, nats, where nothing is seen around the
    /// hand. Flags speak there alone, as depth tells more.
    fn candidates(
        &self,
        walk: usize,
        tremble_m: f64,
        by_motion: Option<f64>,
        config: &config::Hands,
    ) -> Vec<Candidate> {
        let (rules, contact) = (&config.found, &config.contact);
        let widths = Widths { mean: rules.held_at_m, std: rules.held_std_m, between: 0.0, by_clip: Vec::new() };
        let rests = motion::rests(&self.times, &self.places, tremble_m, config);
        let stretches = motion::stretches(&self.times, &self.places, config);
        let calm = motion::calmed(&self.times, &self.places, config);
        let mut sums = vec![0.0];
        let flags = by_motion.map_or_else(Flags::default, |_| Flags::unknown(config));
        for (now, flag) in self.now.iter().zip(&self.flags) {
            sums.push(sums[sums.len() - 1] + widths.nats(0, *now, contact) + flags.nats(*flag, config));
        }
        let flagged = self.flags.iter().any(Option::is_some);
        let least = rules.least_move_m.max(rules.least_trembles * tremble_m);
        let n = self.times.len();
        (0..n)
            .into_par_iter()
            .filter(|&i| rests[i][0] >= -rules.unrest_nats)
            .flat_map_iter(|i| {
                let mut found = Vec::new();
                let begin = widths.nats(0, self.before[i], contact) + rests[i][0] - sums[i];
                let mut farthest = 0.0f64;
                for j in i + 1..n {
                    let secs = self.times[j] - self.times[i];
                    let torn = self.times[j] - self.times[j - 1] > rules.gap_secs || stretches[j] != stretches[i];
                    if secs > rules.longest_secs || torn {
                        break;
                    }
                    let moved = (calm[j] - calm[i]).norm();
                    farthest = farthest.max(moved);
                    // The way there, not there and back: that is two interactions.
                    if rests[j][1] < -rules.unrest_nats || moved < least || moved < rules.one_way_share * farthest {
                        continue;
                    }
                    let nats = begin
                        + sums[j + 1]
                        + widths.nats(0, self.after[j], contact)
                        + rests[j][1]
                        + lasts(secs, contact);
                    // Most of what is far below stays below with the path, too, whose fit is what takes time.
                    if nats <= -rules.hopeless_nats {
                        continue;
                    }
                    let (path, enough) = match by_motion {
                        Some(enough) => (alone::along(&self.places[i..=j], tremble_m, config), enough),
                        None => (motion::path_nats(&self.places[i..=j], tremble_m, config), rules.held_nats),
                    };
                    let nats = nats + path;
                    let is_hold = by_motion.is_none() || flagged || self.comes_and_goes(i, j, rules);
                    if nats > enough && is_hold {
                        found.push(Candidate { walk, first: i, last: j, nats });
                    }
                }
                found
            })
            .collect()
    }
}

/// Frames whose depth [`interactions`] asks, in no order. Images are not read.
#[must_use]
pub fn frames(recording: &Recording, config: &config::Hands) -> Vec<usize> {
    let walks = [Side::Right, Side::Left].map(|side| Walk::of(recording, side, &config.found));
    let mut all = now_frames(recording, &walks, config);
    all.extend(spaced(recording, with_depth(recording), config.found.view_secs));
    all
}

/// Frames with hands, every so often.
fn now_frames(recording: &Recording, walks: &[Walk], config: &config::Hands) -> Vec<usize> {
    let mut frames: Vec<usize> = walks.iter().flat_map(|w| w.frames.iter().copied()).collect();
    frames.sort_unstable();
    frames.dedup();
    spaced(recording, frames, config.contact_every_secs)
}

/// Distances in the frames with hands, every so often; in between they are interpolated.
fn distances_now(recording: &Recording, walks: &mut [Walk], config: &config::Hands) {
    let frames = now_frames(recording, walks, config);
    let seen: Vec<Vec<Option<f64>>> = frames
        .par_iter()
        .map(|&frame| {
            let view = view(recording, frame, config);
            let distance = |walk: &Walk| {
                let at = walk.frames.binary_search(&frame).ok()?;
                view.as_ref()?.nearest_m(&walk.places[at], &config.contact)
            };
            walks.iter().map(distance).collect()
        })
        .collect();
    for (w, walk) in walks.iter_mut().enumerate() {
        for (&frame, seen) in frames.iter().zip(&seen) {
            if let Ok(at) = walk.frames.binary_search(&frame) {
                walk.now[at] = seen[w];
            }
        }
        walk.now = between(&walk.times, &walk.now, config.contact.between_looks * config.contact_every_secs);
    }
}

/// Distances to what stood at each sample's place before the hand came and after it left: each view is decoded once.
fn distances_still(recording: &Recording, walks: &mut [Walk], config: &config::Hands) {
    let views = spaced(recording, with_depth(recording), config.found.view_secs);
    // View, walk, sample, before or after.
    let mut asked: Vec<(usize, usize, usize, bool)> = Vec::new();
    for (w, walk) in walks.iter().enumerate() {
        for (i, (place, time)) in walk.places.iter().zip(&walk.times).enumerate() {
            for before in [true, false] {
                let near = still_views(recording, &views, place, (*time, before), &config.found);
                asked.extend(near.into_iter().map(|view| (view, w, i, before)));
            }
        }
    }
    asked.sort_unstable();
    let groups: Vec<&[(usize, usize, usize, bool)]> = asked.chunk_by(|a, b| a.0 == b.0).collect();
    let answers: Vec<Vec<Option<f64>>> = groups
        .par_iter()
        .map(|group| {
            let view = view(recording, group[0].0, config);
            group.iter().map(|(_, w, i, _)| view.as_ref()?.nearest_m(&walks[*w].places[*i], &config.contact)).collect()
        })
        .collect();
    let mut sums: Vec<Vec<[(f64, f64); 2]>> = walks.iter().map(|w| vec![[(0.0, 0.0); 2]; w.frames.len()]).collect();
    for (group, answers) in groups.iter().zip(&answers) {
        for ((_, w, i, before), answer) in group.iter().zip(answers) {
            if let Some(distance) = answer {
                let sum = &mut sums[*w][*i][usize::from(*before)];
                *sum = (sum.0 + distance, sum.1 + 1.0);
            }
        }
    }
    let mean = |sum: (f64, f64)| (sum.1 > 0.0).then(|| sum.0 / sum.1);
    for (walk, sums) in walks.iter_mut().zip(&sums) {
        walk.before = sums.iter().map(|s| mean(s[1])).collect();
        walk.after = sums.iter().map(|s| mean(s[0])).collect();
    }
}

fn view<'a>(recording: &'a Recording, frame: usize, config: &config::Hands) -> Option<View<'a>> {
    View::of(recording, frame, &config.contact).ok().flatten()
}

fn with_depth(recording: &Recording) -> Vec<usize> {
    (0..recording.frames.len()).filter(|&f| recording.frames[f].files.depth.is_some()).collect()
}

/// Of frames in order those at least this far apart in time.
fn spaced(recording: &Recording, frames: Vec<usize>, secs: f64) -> Vec<usize> {
    let mut every = Every::secs(secs);
    frames.into_iter().filter(|&f| every.is_due(recording.frames[f].timestamp_secs)).collect()
}

/// The nearest views before or after a moment that show a place without a hand near it.
fn still_views(
    recording: &Recording,
    views: &[usize],
    place: &Point,
    (time, before): (f64, bool),
    rules: &config::Found,
) -> Vec<usize> {
    let at = |f: usize| recording.frames[f].timestamp_secs;
    let shows = |f: &&usize| {
        let local = recording.frames[**f].world_from_camera.inverse() * place;
        let camera = recording.camera_of(**f);
        let pixel = camera.project(&local).filter(|_| local.z > rules.nearest_m);
        let seen = pixel.is_some_and(|(u, v)| camera.contains(u, v));
        let hands = recording.hands_in(**f, **f);
        seen && hands.iter().all(|h| (h.grasp() - place).norm() >= rules.hands_away_m)
    };
    if before {
        let end = views.partition_point(|&f| at(f) < time - rules.now_secs);
        let near = views[..end].iter().rev().take_while(|f| time - at(**f) <= rules.views_within_secs);
        near.filter(shows).take(rules.views).copied().collect()
    } else {
        let start = views.partition_point(|&f| at(f) <= time + rules.now_secs);
        let near = views[start..].iter().take_while(|f| at(**f) - time <= rules.views_within_secs);
        near.filter(shows).take(rules.views).copied().collect()
    }
}

/// What depth around the way of a hand says, which is another after something was opened: log odds; 0 where nobody can tell.
fn changed_nats(recording: &Recording, walks: &[Walk], candidate: &Candidate, config: &config::Hands) -> f64 {
    let rules = &config.found;
    let walk = &walks[candidate.walk];
    let [a, b] = [candidate.first, candidate.last].map(|i| walk.places[i]);
    let [from, to] = candidate.times(walks);
    let views = spaced(recording, with_depth(recording), rules.view_secs);
    let middle = nalgebra::center(&a, &b);
    let reach = rules.changed_around_m + (b - a).norm();
    let before = still_views(recording, &views, &middle, (from, true), rules);
    let after = still_views(recording, &views, &middle, (to, false), rules);
    let decoded = |frames: &[usize]| frames.iter().filter_map(|&f| view(recording, f, config)).collect::<Vec<_>>();
    let (before, after) = (decoded(&before), decoded(&after));
    let mut shares = Vec::new();
    for x in &before {
        for y in &after {
            for (one, other) in [(x, y), (y, x)] {
                let off = one.depth_against(other, &middle, reach, rules.changed_step_m);
                // A frame's depth is off by a factor of its own.
                let Some(factor) = stats::median(&off.iter().map(|(seen, there)| seen / there).collect::<Vec<_>>())
                else {
                    continue;
                };
                let errors: Vec<f64> = off.iter().map(|(seen, there)| (seen / factor - there).abs()).collect();
                let noise = stats::median(&errors).unwrap_or(0.0);
                if errors.len() >= rules.changed_samples {
                    let limit = rules.changed_m.max(rules.changed_stds * stats::NORMAL_PER_MEDIAN * noise);
                    shares.push(errors.iter().filter(|e| **e > limit).count() as f64 / errors.len() as f64);
                }
            }
        }
    }
    let [openings, others] = [rules.changed_openings, rules.changed_others];
    stats::median(&shares).map_or(0.0, |share| match share >= rules.changed_share {
        true => f64::ln(openings / others),
        false => f64::ln((1.0 - openings) / (1.0 - others)),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn moved(from: [f64; 3], to: [f64; 3]) -> Move {
        Move { walk: 0, frames: [0, 0], ends: [Point::from(from), Point::from(to)] }
    }

    #[test]
    fn what_is_taken_back_was_opened() {
        let drawer = moved([0.0, 0.0, 1.0], [0.4, 0.0, 1.0]);
        let other = moved([2.0, 0.0, 1.0], [2.0, 0.3, 1.0]);
        let back = moved([0.38, 0.05, 1.0], [0.02, 0.0, 1.0]);
        assert_eq!(verbs(&[drawer, other, back], &config::Found::default()), ["open", "", "close"]);
        assert_eq!(verbs(&[drawer, back, drawer, back], &config::Found::default()), ["open", "close", "open", "close"]);
        // In two goes: both open.
        let further = moved([0.4, 0.0, 1.0], [0.6, 0.0, 1.0]);
        assert_eq!(verbs(&[drawer, further], &config::Found::default()), ["", ""]);
        // Of two openings in a row the later one is taken back.
        assert_eq!(verbs(&[drawer, drawer, back], &config::Found::default()), ["", "open", "close"]);
    }
}
