//! Dynamic interaction: fingertips to a contact-trimmed, smoothed trajectory (§3.1, §A.2).

pub mod contact;
pub mod find;
pub mod timeline;

use serde::{Deserialize, Serialize};
use statrs::distribution::{ChiSquared, ContinuousCDF};

use crate::articulation::{Action, Outcome};
use crate::config;
use crate::math::kalman::{self, Filter};
use crate::math::ou::IntegratedOu;
use crate::math::{Point, Vector, centroid};
use crate::recording::narration::Reading;
use crate::recording::{Clip, HandSample, Recording, Side};

/// One sample of the hand while it holds the part.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Sample {
    /// Frame index.
    pub frame: usize,
    /// Seconds.
    pub time_secs: f64,
    /// `z_t`: mean of the three fingertips as detected, world.
    pub observed: Point,
    /// `p_t`: after gate and RTS smoothing, world.
    pub smoothed: Point,
    /// Whether the observation passed the gate.
    pub accepted: bool,
}

/// The hand's path while it is in contact.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Trajectory {
    /// Which hand; `None` for a bare trajectory.
    pub side: Option<Side>,
    /// Samples in contact, in time order; never empty.
    pub samples: Vec<Sample>,
    /// Opening or closing: from the narration, else from the motion relative to the person.
    pub action: Action,
    /// Whether the hand was seen just before the first and just after the last sample, not in contact: else it may have
    /// held the part for longer than it was seen.
    #[serde(default = "both_seen")]
    pub ends_seen: [bool; 2],
}

/// Thins what comes in the order of time.
pub(crate) struct Every {
    secs: f64,
    due_secs: f64,
}

impl Every {
    /// One in so many seconds.
    pub(crate) fn secs(secs: f64) -> Self {
        Self { secs, due_secs: f64::NEG_INFINITY }
    }

    /// Whether what comes now is to be taken.
    pub(crate) fn is_due(&mut self, time_secs: f64) -> bool {
        /// Arithmetic: seconds; what comes at just this rate is taken whole.
        const HAIR_SECS: f64 = 1e-6;
        let is_due = time_secs >= self.due_secs - HAIR_SECS;
        if is_due {
            self.due_secs = time_secs + self.secs;
        }
        is_due
    }
}

/// Standard deviation along the motion, metres, of a grip where the hand was seen to take hold or let go, or where it was lost on
/// the way.
#[must_use]
pub fn grip_std_m(end_seen: bool, rules: &config::Grips) -> f64 {
    if end_seen { rules.seen_std_m } else { rules.lost_std_m }
}

/// How well a hand tells where its grip is along the motion: standard deviations, metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GripStd {
    /// Of the grip at the closed end.
    pub closed_m: f64,
    /// Of a grip where the hand was lost on the way.
    pub lost_m: f64,
}

impl GripStd {
    /// Of a hand.
    #[must_use]
    pub fn of(hand: &Trajectory, rules: &config::Grips) -> Self {
        Self { closed_m: grip_std_m(hand.closed_end_seen(), rules), lost_m: grip_std_m(false, rules) }
    }
}

fn both_seen() -> [bool; 2] {
    [true; 2]
}

impl Trajectory {
    /// First and last frame in contact.
    #[must_use]
    pub fn contact_frames(&self) -> [usize; 2] {
        [self.samples.first().map_or(0, |s| s.frame), self.samples.last().map_or(0, |s| s.frame)]
    }

    /// Whether it can be worked with: at least one sample, all finite, time not going back. `Err` says what is wrong.
    ///
    /// # Errors
    /// The first fault, in words.
    pub fn check(&self) -> Result<(), String> {
        /// Format: metres; farther than around the world is an overflow, which would spoil every sum that it is part of.
        const MAX_M: f64 = 1e8;
        if self.samples.is_empty() {
            return Err("no samples".to_owned());
        }
        let mut last = f64::NEG_INFINITY;
        for (i, s) in self.samples.iter().enumerate() {
            let mut coordinates = s.smoothed.coords.iter().chain(s.observed.coords.iter());
            if !coordinates.all(|x| x.abs() < MAX_M) || !s.time_secs.is_finite() {
                return Err(format!("sample {i} is not finite, or farther away than {MAX_M:e} m"));
            }
            if s.time_secs < last {
                return Err(format!("sample {i}: time goes back from {last} s to {} s", s.time_secs));
            }
            last = s.time_secs;
        }
        Ok(())
    }

    /// Smoothed positions.
    #[must_use]
    pub fn positions(&self) -> Vec<Point> {
        self.samples.iter().map(|s| s.smoothed).collect()
    }

    /// Where the grip is at the closed end of the motion: the mean of the samples nearest to it.
    #[must_use]
    pub fn closed_grip(&self) -> Point {
        self.end(self.action == Action::Open)
    }

    /// Whether the hand was seen to take hold of, or to let go of, the part at the closed end.
    #[must_use]
    pub fn closed_end_seen(&self) -> bool {
        self.ends_seen[usize::from(self.action == Action::Close)]
    }

    /// The same at the open end.
    #[must_use]
    pub fn open_end_seen(&self) -> bool {
        self.ends_seen[usize::from(self.action == Action::Open)]
    }

    /// Where the grip is at the open end of the motion.
    #[must_use]
    pub fn open_grip(&self) -> Point {
        self.end(self.action == Action::Close)
    }

    fn end(&self, first: bool) -> Point {
        let positions = self.positions();
        // A few samples: one is noisy, many have already moved.
        let count = (positions.len() / 8).clamp(1, 4);
        let part = if first { &positions[..count] } else { &positions[positions.len() - count..] };
        centroid(part).unwrap_or(positions[0])
    }
}

/// Extracts the trajectory of the hand that does the work in a clip: the samples of `hold`, where it is known
/// ([`contact::holds`]), else the stretch that a detector's flags tell.
#[must_use]
pub fn trajectory(
    recording: &Recording,
    clip: &Clip,
    reading: &Reading,
    hold: Option<&contact::Hold>,
    config: &config::Hands,
) -> Outcome<Trajectory> {
    let samples_of = |side: Side, from: usize, to: usize| -> Vec<&HandSample> {
        recording.hands_in(from, to).iter().filter(|s| s.side == side).collect()
    };
    let flagged = recording.contact_known();
    let use_contact = config.use_contact && flagged;
    let [from, to] = widened(recording, clip, config.widen_secs);
    let mut in_clip = 0;
    let best = [Side::Right, Side::Left]
        .into_iter()
        .map(|side| {
            let samples = samples_of(side, clip.start_frame, clip.end_frame);
            in_clip += samples.len();
            if let Some(hold) = hold {
                let held =
                    if side == hold.side { samples_of(side, hold.frames[0], hold.frames[1]) } else { Vec::new() };
                return (held.len(), side, held);
            }
            if !use_contact {
                return (samples.len(), side, samples);
            }
            let (score, span) = contact_span(&flags(&samples));
            let seed = samples[span].iter().map(|s| s.frame);
            let (first, last) = (seed.clone().min().unwrap_or(0), seed.max().unwrap_or(0));
            let around = samples_of(side, from, to);
            let held = match score {
                // Detectors miss contacts more often than people narrate what they do not touch.
                0 if config.contact_from_words && reading.names_furniture() => samples,
                0 => Vec::new(),
                _ => grown(recording, &around, [first, last], config.gap_secs),
            };
            (score, side, held)
        })
        .max_by_key(|(score, side, held)| (*score, if *score == 0 { held.len() } else { 0 }, *side == Side::Right));
    if in_clip == 0 {
        return Outcome::Abstained("no hand was detected in the clip".to_owned());
    }
    let Some((score, side, held)) = best.filter(|(_, _, held)| held.len() >= config.min_samples) else {
        let none = match config.min_samples {
            0 | 1 => "no hand sample".to_owned(),
            least => format!("fewer than {least} hand samples"),
        };
        return Outcome::Abstained(format!("{none} in contact ({in_clip} seen in the clip)"));
    };
    // Without a flag the samples are the narration's, which knows neither end.
    let knows_ends = hold.is_some() || (flagged && !(use_contact && score == 0));
    let around = samples_of(side, from.saturating_sub(1), to + 1);
    let ends_seen = if knows_ends { seen_beside(recording, &held, &around, config.seen_secs) } else { [false; 2] };
    let samples = smoothed(recording, &held, config);
    // A rejected sample at an end is held in place by nothing: the ends are where the grip is read off.
    let believed = |s: &Sample| s.accepted;
    let (Some(from), Some(to)) = (samples.iter().position(believed), samples.iter().rposition(believed)) else {
        return Outcome::Abstained("no hand sample passed the gate".to_owned());
    };
    let samples = samples[from..=to].to_vec();
    if samples.len() < config.min_samples {
        return Outcome::Abstained(format!("fewer than {} believable hand samples in contact", config.min_samples));
    }
    let action = reading.action.unwrap_or_else(|| action_by_person(recording, &samples));
    let trajectory = Trajectory { side: Some(side), samples, action, ends_seen };
    // Finite input can leave the numbers of a filter: such a clip has no hand, the others have theirs.
    match trajectory.check() {
        Ok(()) => Outcome::Found(trajectory),
        Err(fault) => Outcome::Abstained(format!("the hand cannot be followed: {fault}")),
    }
}

/// Whether a hand was seen within so many seconds before the first and after the last of the samples that hold something.
/// `around`: its samples then. `held` is not empty.
fn seen_beside(recording: &Recording, held: &[&HandSample], around: &[&HandSample], secs: f64) -> [bool; 2] {
    let time = |s: &HandSample| recording.frames[s.frame].timestamp_secs;
    let (first, last) = (held[0], held[held.len() - 1]);
    [
        around.iter().any(|s| s.frame < first.frame && time(first) - time(s) <= secs),
        around.iter().any(|s| s.frame > last.frame && time(s) - time(last) <= secs),
    ]
}

/// The path of the fingertips after gate and smoother (§A.2).
fn smoothed(recording: &Recording, held: &[&HandSample], config: &config::Hands) -> Vec<Sample> {
    let times: Vec<f64> = held.iter().map(|s| recording.frames[s.frame].timestamp_secs).collect();
    let observed: Vec<Point> = held.iter().map(|s| s.grasp()).collect();
    let smoothed = kalman::smooth(&times, &observed, &filter(config));
    let sample = |(i, s): (usize, &&HandSample)| Sample {
        frame: s.frame,
        time_secs: times[i],
        observed: observed[i],
        smoothed: smoothed.positions[i],
        accepted: smoothed.accepted[i],
    };
    held.iter().enumerate().map(sample).collect()
}

/// The filter of §A.2 with the gate of its p-value.
#[must_use]
pub fn filter(config: &config::Hands) -> Filter {
    // A constructor of three degrees of freedom cannot fail; infinity would switch the gate off.
    let gate = ChiSquared::new(3.0).map_or(f64::INFINITY, |d| d.inverse_cdf(1.0 - config.gate_p_value));
    Filter {
        motion: IntegratedOu::from_time_and_speed(config.correlation_secs, config.speed_std_m_per_s),
        observation_std_m: config.observation_std_m,
        gate,
        restart_after: config.restart_after,
    }
}

fn flags(samples: &[&HandSample]) -> Vec<bool> {
    samples.iter().map(|s| s.contact == Some(true)).collect()
}

/// The clip's bounds moved outward by at most `secs`, without entering another narrated interaction.
fn widened(recording: &Recording, clip: &Clip, secs: f64) -> [usize; 2] {
    let time = |f: usize| recording.frames.get(f).map_or(0.0, |x| x.timestamp_secs);
    let others: Vec<&Clip> =
        recording.clips.iter().filter(|c| c.clip != clip.clip && c.end_frame > c.start_frame).collect();
    let floor = others.iter().filter(|c| c.start_frame < clip.start_frame).map(|c| c.end_frame + 1).max().unwrap_or(0);
    let ceiling = others
        .iter()
        .filter(|c| c.end_frame > clip.end_frame)
        .map(|c| c.start_frame.saturating_sub(1))
        .min()
        .unwrap_or(recording.frames.len().saturating_sub(1));
    let first = (floor.min(clip.start_frame)..=clip.start_frame)
        .find(|&f| time(clip.start_frame) - time(f) <= secs)
        .unwrap_or(clip.start_frame);
    let last = (clip.end_frame..=ceiling.max(clip.end_frame))
        .rev()
        .find(|&f| time(f) - time(clip.end_frame) <= secs)
        .unwrap_or(clip.end_frame);
    [first, last]
}

/// A stretch of contact that began inside the narration goes on as long as the flags say so: narrations are shifted by
/// about a second. Each side takes the extension of the largest sum (+1 in contact, -1 not), and stops at a gap.
fn grown<'a>(
    recording: &Recording,
    around: &[&'a HandSample],
    [first, last]: [usize; 2],
    gap_secs: f64,
) -> Vec<&'a HandSample> {
    let time = |s: &HandSample| recording.frames[s.frame].timestamp_secs;
    let (Some(start), Some(end)) =
        (around.iter().position(|s| s.frame >= first), around.iter().rposition(|s| s.frame <= last))
    else {
        return Vec::new();
    };
    let reach = |order: &mut dyn Iterator<Item = usize>, from: usize| -> usize {
        let (mut best, mut best_sum, mut sum, mut last) = (from, 0i64, 0i64, from);
        for i in order {
            if (time(around[i]) - time(around[last])).abs() > gap_secs {
                break;
            }
            sum += if around[i].contact == Some(true) { 1 } else { -1 };
            if sum > best_sum {
                (best, best_sum) = (i, sum);
            }
            last = i;
        }
        best
    };
    let low = reach(&mut (0..start).rev(), start);
    let high = reach(&mut (end + 1..around.len()), end);
    around[low..=high.max(low)].to_vec()
}

/// The one stretch of contact that explains noisy flags best, and its score.
///
/// With equal rates of false and missed contact the likelihood of a stretch is the sum of +1 for each flagged and -1 for
/// each other sample in it (a left-to-right chain before, during, after), so the best one is the maximum-sum stretch.
fn contact_span(flags: &[bool]) -> (usize, std::ops::Range<usize>) {
    let (mut best, mut best_span) = (0i64, 0..0);
    let (mut sum, mut start) = (0i64, 0);
    for (i, &flag) in flags.iter().enumerate() {
        if sum <= 0 {
            (sum, start) = (0, i);
        }
        sum += if flag { 1 } else { -1 };
        if sum > best {
            (best, best_span) = (sum, start..i + 1);
        }
    }
    (best.unsigned_abs() as usize, best_span)
}

/// Without a word for it: what opens comes towards the person.
fn action_by_person(recording: &Recording, samples: &[Sample]) -> Action {
    let (Some(first), Some(last)) = (samples.first(), samples.last()) else { return Action::Open };
    let center = samples.iter().fold(Vector::zeros(), |sum, s| sum + recording.frames[s.frame].center().coords)
        / samples.len() as f64;
    let distance = |p: &Point| (p.coords - center).norm();
    if distance(&last.smoothed) <= distance(&first.smoothed) { Action::Open } else { Action::Close }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn contact_is_one_stretch_despite_wrong_flags() {
        let flags: Vec<bool> = "0100011101111011110010".chars().map(|c| c == '1').collect();
        let (_, span) = contact_span(&flags);
        assert_eq!(span, 5..18);
        assert_eq!(contact_span(&[false, false]).1, 0..0);
        assert_eq!(contact_span(&[]).1, 0..0);
    }

    #[test]
    fn the_gate_is_the_papers() {
        assert!((filter(&config::Hands::default()).gate - 7.814_728).abs() < 1e-5);
    }

    #[test]
    fn where_a_detector_misses_all_contact_a_named_drawer_is_touched_and_it_is_not() {
        let frames = (0..6).map(|i| crate::recording::Frame {
            timestamp_secs: 0.1 * f64::from(i),
            world_from_camera: crate::math::Pose::identity(),
            files: Default::default(),
        });
        let tip = |i: usize| Point::new(0.0, 0.05 * i as f64, 0.6);
        let hand =
            |i: usize| HandSample { frame: i, side: Side::Left, contact: Some(false), tips: [tip(i); 3], joints: None };
        let clip = |narration: &str| Clip {
            clip: "c".to_owned(),
            start_frame: 1,
            end_frame: 4,
            narration: narration.to_owned(),
            verb: String::new(),
            noun: String::new(),
        };
        let recording = Recording {
            frames: frames.collect(),
            hands: (0..6).map(hand).collect(),
            ..Recording::empty(crate::recording::Camera {
                width: 64,
                height: 48,
                fx: 50.0,
                fy: 50.0,
                cx: 31.5,
                cy: 23.5,
            })
        };
        let follow = |narration: &str, config: &config::Hands| {
            let clip = clip(narration);
            trajectory(&recording, &clip, &crate::recording::narration::read(&clip), None, config)
        };
        let config = config::Hands::default();
        let found = follow("open the drawer", &config);
        let found = found.found().unwrap();
        assert_eq!((found.side, found.contact_frames()), (Some(Side::Left), [1, 4]));
        assert_eq!(found.ends_seen, [false; 2]);
        assert!(follow("open it", &config).found().is_none());
        let strict = config::Hands { contact_from_words: false, ..config };
        assert!(follow("open the drawer", &strict).found().is_none());
    }
}
