//! Interactions in a recording in which nobody said when they are: a hand takes hold, moves along a line or an arc, lets go, and
//! what is around has changed.

use rayon::prelude::*;

use super::contact::motion;
use super::contact::view::View;
use super::contact::{Widths, between, lasts};
use crate::config;
use crate::math::{Point, stats};
use crate::recording::{Clip, Recording, Side};

/// Interactions last no longer than this, seconds.
const LONGEST_SECS: f64 = 6.0;
/// A hand that is not seen for longer may have let go, seconds.
const GAP_SECS: f64 = 1.0;
/// Samples of a hand are taken at most this often, seconds: twelve a second follow any hand.
const SAMPLE_SECS: f64 = 0.08;
/// What is opened moves by at least this, metres, and by three times what hands tremble.
const LEAST_MOVE_M: f64 = 0.06;
/// Frames at this distance in time are looked at for how things stand, seconds; so far away from a moment at the most.
const VIEW_SECS: f64 = 0.4;
const VIEWS_WITHIN_SECS: f64 = 6.0;
/// Views that are asked before and after a moment.
const VIEWS: usize = 2;
/// A view counts only where no hand is nearer to the place than this, metres.
const HANDS_AWAY_M: f64 = 0.35;
/// An interaction needs this much evidence, nats: odds of fifty to one.
const ENOUGH_NATS: f64 = 4.0;
/// Ends at which a hand surely does not rest are not tried, nats.
const UNREST_NATS: f64 = -2.0;
/// Fingertips are about this far from what they hold, and it varies by so much, metres: estimated hands, estimated depth.
const HELD_AT_M: f64 = 0.05;
const HELD_STD_M: f64 = 0.04;
/// What a clip shows beside the hold itself, seconds: reaching and withdrawing.
const AROUND_SECS: f64 = 0.5;
/// Two interactions share no more than this of the shorter one: two hands at one part are one interaction.
const SHARED: f64 = 0.25;

/// Clips of all interactions that open or close something, in time order; of words they have "open" and "close" at most, where
/// one takes back what another did.
/// A frame that cannot be decoded tells nothing here; the pipeline names it.
#[must_use]
pub fn interactions(recording: &Recording, config: &config::Hands) -> Vec<Clip> {
    let mut walks: Vec<Walk> = [Side::Right, Side::Left].iter().map(|side| Walk::of(recording, *side)).collect();
    let tremble = motion::tremble_m(walks.iter().map(|w| (w.times.as_slice(), w.places.as_slice())));
    distances_now(recording, &mut walks, config);
    distances_still(recording, &mut walks);
    let mut candidates: Vec<Candidate> =
        walks.iter().enumerate().flat_map(|(w, walk)| walk.candidates(w, tremble)).collect();
    candidates
        .sort_by(|a, b| b.nats.total_cmp(&a.nats).then((a.walk, a.first, a.last).cmp(&(b.walk, b.first, b.last))));
    let mut chosen: Vec<Candidate> = Vec::new();
    for candidate in candidates {
        let [from, to] = candidate.times(&walks);
        let free = chosen.iter().all(|other| {
            let [a, b] = other.times(&walks);
            to.min(b) - from.max(a) <= SHARED * (to - from).min(b - a)
        });
        if free {
            chosen.push(candidate);
        }
    }
    let changed: Vec<bool> = chosen.par_iter().map(|c| something_changed(recording, &walks, c)).collect();
    let mut moves: Vec<Move> =
        chosen.iter().zip(changed).filter(|(_, changed)| *changed).map(|(c, _)| walks[c.walk].moved(c)).collect();
    moves.sort_by_key(|m| m.frames);
    clips(recording, &moves)
}

/// A found interaction.
#[derive(Debug, Clone, Copy)]
struct Move {
    /// First and last frame of the hold.
    frames: [usize; 2],
    /// Where the hand is there.
    ends: [Point; 2],
}

/// Which of two moves of one part opens it: the one that a later one takes back. Empty where a move has no counterpart.
fn verbs(moves: &[Move]) -> Vec<&'static str> {
    /// Hands take hold of one handle within this, metres, at the open end; at the closed end, which both reach, too.
    const SAME_M: f64 = 0.2;
    let mut verbs = vec![""; moves.len()];
    for later in 0..moves.len() {
        // The last one that stands open: what is closed twice was opened in between.
        let back = (0..later).rev().find(|&earlier| {
            let (a, b) = (&moves[earlier], &moves[later]);
            let length = (a.ends[1] - a.ends[0]).norm().max((b.ends[1] - b.ends[0]).norm());
            let reversed = (a.ends[1] - a.ends[0]).dot(&(b.ends[1] - b.ends[0])) < -0.25 * length * length;
            let near = (a.ends[1] - b.ends[0]).norm() < SAME_M;
            verbs[earlier] != "close" && near && reversed
        });
        if let Some(earlier) = back {
            (verbs[earlier], verbs[later]) = ("open", "close");
        }
    }
    verbs
}

/// Clips around holds; neighbours share no frame.
fn clips(recording: &Recording, moves: &[Move]) -> Vec<Clip> {
    let holds: Vec<[usize; 2]> = moves.iter().map(|m| m.frames).collect();
    let verbs = verbs(moves);
    let time = |f: usize| recording.frames[f].timestamp_secs;
    (0..holds.len())
        .map(|i| {
            let [first, last] = holds[i];
            let floor = i.checked_sub(1).map_or(0, |j| holds[j][1].midpoint(first).max(holds[j][1]) + 1).min(first);
            let ceiling = holds.get(i + 1).map_or(recording.frames.len() - 1, |next| last.midpoint(next[0])).max(last);
            let start_frame = (floor..=first).find(|&f| time(first) - time(f) <= AROUND_SECS).unwrap_or(first);
            let end_frame = (last..=ceiling).rev().find(|&f| time(f) - time(last) <= AROUND_SECS).unwrap_or(last);
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
}

#[derive(Debug, Clone, Copy)]
struct Candidate {
    walk: usize,
    first: usize,
    last: usize,
    nats: f64,
}

impl Candidate {
    fn times(&self, walks: &[Walk]) -> [f64; 2] {
        [self.first, self.last].map(|i| walks[self.walk].times[i])
    }
}

impl Walk {
    fn of(recording: &Recording, side: Side) -> Self {
        let mut due = f64::NEG_INFINITY;
        let samples: Vec<_> = recording
            .hands
            .iter()
            .filter(|s| s.side == side)
            .filter(|s| {
                let time = recording.frames[s.frame].timestamp_secs;
                let taken = time >= due - 1e-6;
                if taken {
                    due = time + SAMPLE_SECS;
                }
                taken
            })
            .collect();
        let n = samples.len();
        Self {
            frames: samples.iter().map(|s| s.frame).collect(),
            times: samples.iter().map(|s| recording.frames[s.frame].timestamp_secs).collect(),
            places: samples.iter().map(|s| s.grasp()).collect(),
            now: vec![None; n],
            before: vec![None; n],
            after: vec![None; n],
        }
    }

    fn moved(&self, candidate: &Candidate) -> Move {
        let calm = motion::calmed(&self.times, &self.places);
        let ends = [candidate.first, candidate.last];
        Move { frames: ends.map(|i| self.frames[i]), ends: ends.map(|i| calm[i]) }
    }

    /// All pairs of a start and an end of a hold for which enough speaks.
    fn candidates(&self, walk: usize, tremble_m: f64) -> Vec<Candidate> {
        let widths = Widths { mean: HELD_AT_M, std: HELD_STD_M, between: 0.0, by_clip: Vec::new() };
        let rests = motion::rests(&self.times, &self.places, tremble_m);
        let stretches = motion::stretches(&self.times, &self.places);
        let calm = motion::calmed(&self.times, &self.places);
        let mut sums = vec![0.0];
        for now in &self.now {
            sums.push(sums[sums.len() - 1] + widths.nats(0, *now));
        }
        let least = LEAST_MOVE_M.max(3.0 * tremble_m);
        let n = self.times.len();
        (0..n)
            .into_par_iter()
            .filter(|&i| rests[i][0] >= UNREST_NATS)
            .flat_map_iter(|i| {
                let mut found = Vec::new();
                let begin = widths.nats(0, self.before[i]) + rests[i][0] - sums[i];
                let mut farthest = 0.0f64;
                for j in i + 1..n {
                    let secs = self.times[j] - self.times[i];
                    let torn = self.times[j] - self.times[j - 1] > GAP_SECS || stretches[j] != stretches[i];
                    if secs > LONGEST_SECS || torn {
                        break;
                    }
                    let moved = (calm[j] - calm[i]).norm();
                    farthest = farthest.max(moved);
                    // The way there, not there and back: that is two interactions.
                    if rests[j][1] < UNREST_NATS || moved < least || moved < 0.65 * farthest {
                        continue;
                    }
                    let nats = begin + sums[j + 1] + widths.nats(0, self.after[j]) + rests[j][1] + lasts(secs);
                    // Most of what is far below stays below with the path, too, whose fit is what takes time.
                    if nats <= -5.0 {
                        continue;
                    }
                    let nats = nats + motion::path_nats(&self.places[i..=j], tremble_m);
                    if nats > ENOUGH_NATS {
                        found.push(Candidate { walk, first: i, last: j, nats });
                    }
                }
                found
            })
            .collect()
    }
}

/// Distances in the frames with hands, every so often; in between they are interpolated.
fn distances_now(recording: &Recording, walks: &mut [Walk], config: &config::Hands) {
    let mut frames: Vec<usize> = walks.iter().flat_map(|w| w.frames.iter().copied()).collect();
    frames.sort_unstable();
    frames.dedup();
    let frames = spaced(recording, frames, config.contact_every_secs);
    let seen: Vec<Vec<Option<f64>>> = frames
        .par_iter()
        .map(|&frame| {
            let view = view(recording, frame);
            let distance = |walk: &Walk| {
                let at = walk.frames.binary_search(&frame).ok()?;
                view.as_ref()?.nearest_m(&walk.places[at])
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
        walk.now = between(&walk.times, &walk.now, 2.5 * config.contact_every_secs);
    }
}

/// Distances to what stood at each sample's place before the hand came and after it left: each view is decoded once.
fn distances_still(recording: &Recording, walks: &mut [Walk]) {
    let views = spaced(recording, with_depth(recording), VIEW_SECS);
    // View, walk, sample, before or after.
    let mut asked: Vec<(usize, usize, usize, bool)> = Vec::new();
    for (w, walk) in walks.iter().enumerate() {
        for (i, (place, time)) in walk.places.iter().zip(&walk.times).enumerate() {
            for before in [true, false] {
                let near = still_views(recording, &views, place, *time, before);
                asked.extend(near.into_iter().map(|view| (view, w, i, before)));
            }
        }
    }
    asked.sort_unstable();
    let groups: Vec<&[(usize, usize, usize, bool)]> = asked.chunk_by(|a, b| a.0 == b.0).collect();
    let answers: Vec<Vec<Option<f64>>> = groups
        .par_iter()
        .map(|group| {
            let view = view(recording, group[0].0);
            group.iter().map(|(_, w, i, _)| view.as_ref()?.nearest_m(&walks[*w].places[*i])).collect()
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

fn view(recording: &Recording, frame: usize) -> Option<View<'_>> {
    View::of(recording, frame).ok().flatten()
}

fn with_depth(recording: &Recording) -> Vec<usize> {
    (0..recording.frames.len()).filter(|&f| recording.frames[f].files.depth.is_some()).collect()
}

/// Of frames in order those at least this far apart in time.
fn spaced(recording: &Recording, frames: Vec<usize>, secs: f64) -> Vec<usize> {
    let mut due = f64::NEG_INFINITY;
    frames
        .into_iter()
        .filter(|&f| {
            let time = recording.frames[f].timestamp_secs;
            let taken = time >= due - 1e-6;
            if taken {
                due = time + secs;
            }
            taken
        })
        .collect()
}

/// The nearest views before or after a moment that show a place without a hand near it.
fn still_views(recording: &Recording, views: &[usize], place: &Point, time: f64, before: bool) -> Vec<usize> {
    /// What is this near in time is the moment itself.
    const NOW_SECS: f64 = 0.2;
    let at = |f: usize| recording.frames[f].timestamp_secs;
    let shows = |f: &&usize| {
        let local = recording.frames[**f].world_from_camera.inverse() * place;
        let pixel = recording.camera.project(&local).filter(|_| local.z > 0.1);
        let seen = pixel.is_some_and(|(u, v)| recording.camera.contains(u, v));
        let hands = recording.hands_in(**f, **f);
        seen && hands.iter().all(|h| (h.grasp() - place).norm() >= HANDS_AWAY_M)
    };
    if before {
        let end = views.partition_point(|&f| at(f) < time - NOW_SECS);
        let near = views[..end].iter().rev().take_while(|f| time - at(**f) <= VIEWS_WITHIN_SECS);
        near.filter(shows).take(VIEWS).copied().collect()
    } else {
        let start = views.partition_point(|&f| at(f) <= time + NOW_SECS);
        let near = views[start..].iter().take_while(|f| at(**f) - time <= VIEWS_WITHIN_SECS);
        near.filter(shows).take(VIEWS).copied().collect()
    }
}

/// Whether depth around the way of a hand is another after than before; also where nobody can tell.
fn something_changed(recording: &Recording, walks: &[Walk], candidate: &Candidate) -> bool {
    /// Surfaces so near to the ends of the way are compared, metres, beside the way's own length.
    const AROUND_M: f64 = 0.35;
    /// They have changed where they are off by this, metres, and by four times what the frames' depth is off.
    const CHANGED_M: f64 = 0.06;
    /// Share of what both frames see that has to have changed.
    const CHANGED_SHARE: f64 = 0.05;
    /// Fewer common samples tell nothing.
    const LEAST_SAMPLES: usize = 60;
    let walk = &walks[candidate.walk];
    let [a, b] = [candidate.first, candidate.last].map(|i| walk.places[i]);
    let [from, to] = candidate.times(walks);
    let views = spaced(recording, with_depth(recording), VIEW_SECS);
    let middle = nalgebra::center(&a, &b);
    let reach = AROUND_M + (b - a).norm();
    let before = still_views(recording, &views, &middle, from, true);
    let after = still_views(recording, &views, &middle, to, false);
    let mut shares = Vec::new();
    for &x in &before {
        for &y in &after {
            let (Some(x), Some(y)) = (view(recording, x), view(recording, y)) else { continue };
            for (one, other) in [(&x, &y), (&y, &x)] {
                let off = one.depth_against(other, &middle, reach);
                // A frame's depth is off by a factor of its own.
                let Some(factor) = stats::median(&off.iter().map(|(seen, there)| seen / there).collect::<Vec<_>>())
                else {
                    continue;
                };
                let errors: Vec<f64> = off.iter().map(|(seen, there)| (seen / factor - there).abs()).collect();
                let noise = stats::median(&errors).unwrap_or(0.0);
                if errors.len() >= LEAST_SAMPLES {
                    let limit = CHANGED_M.max(4.0 * 1.4826 * noise);
                    shares.push(errors.iter().filter(|e| **e > limit).count() as f64 / errors.len() as f64);
                }
            }
        }
    }
    stats::median(&shares).is_none_or(|share| share >= CHANGED_SHARE)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn moved(from: [f64; 3], to: [f64; 3]) -> Move {
        Move { frames: [0, 0], ends: [Point::from(from), Point::from(to)] }
    }

    #[test]
    fn what_is_taken_back_was_opened() {
        let drawer = moved([0.0, 0.0, 1.0], [0.4, 0.0, 1.0]);
        let other = moved([2.0, 0.0, 1.0], [2.0, 0.3, 1.0]);
        let back = moved([0.38, 0.05, 1.0], [0.02, 0.0, 1.0]);
        assert_eq!(verbs(&[drawer, other, back]), ["open", "", "close"]);
        assert_eq!(verbs(&[drawer, back, drawer, back]), ["open", "close", "open", "close"]);
        // In two goes: both open.
        let further = moved([0.4, 0.0, 1.0], [0.6, 0.0, 1.0]);
        assert_eq!(verbs(&[drawer, further]), ["", ""]);
        // Of two openings in a row the later one is taken back.
        assert_eq!(verbs(&[drawer, drawer, back]), ["", "open", "close"]);
    }
}
