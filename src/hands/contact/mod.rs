//! When a hand holds something (§A.2 takes a detector's word for it): from the depth that is seen around the fingertips, the
//! furniture before and after, and a detector's flags as far as they agree with these.
//!
//! A hand that holds a part has the part's surface at its fingertips in every frame; one that reaches or withdraws has air
//! there. It rests where it takes hold and where it lets go, and goes along a line or an arc in between. How far the surface
//! is from the fingertips, how much that varies, how much hands tremble and how often flags are right is measured in each
//! recording.

pub(super) mod alone;
pub(super) mod motion;
pub(super) mod view;

use rayon::prelude::*;

use super::{Every, widened};
use crate::config;
use crate::error::Result;
use crate::math::{Point, stats};
use crate::recording::{AtWork, Clip, HandSample, Recording, Side, narration};
use view::View;

/// The stretch of a clip in which a hand holds something.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Hold {
    /// Which hand.
    pub side: Side,
    /// First and last frame, included; in both the hand was seen.
    pub frames: [usize; 2],
}

/// For each clip the stretch in which a hand holds something; `None` where the narration moves nothing, no hand was seen or
/// nothing speaks for contact.
///
/// # Errors
/// Images that cannot be decoded.
pub fn holds(recording: &Recording, at_work: &AtWork, config: &config::Hands) -> Result<Vec<Option<Hold>>> {
    if !config.use_contact || !config.contact_from_depth {
        return Ok(vec![None; recording.clips.len()]);
    }
    let mut tracks: Vec<Vec<Track>> = recording
        .clips
        .par_iter()
        .map(|clip| match narration::read(clip).moves_joint {
            Some(false) => Ok(Vec::new()),
            _ => clip_tracks(recording, clip, at_work, config),
        })
        .collect::<Result<_>>()?;
    let spans = settled(&mut tracks, config);
    Ok(tracks
        .iter()
        .zip(&spans)
        .map(|(tracks, span)| {
            let span = span.as_ref()?;
            let track = &tracks[span.track];
            Some(Hold { side: track.side, frames: [track.frames[span.first], track.frames[span.last]] })
        })
        .collect())
}

/// Holds, widths and flags explain each other: some rounds, in the last of which the flags speak, too.
fn settled(tracks: &mut [Vec<Track>], config: &config::Hands) -> Vec<Option<Span>> {
    let ways = tracks.iter().flatten().map(|t| (t.times.as_slice(), t.places.as_slice()));
    let tremble = motion::tremble_m(ways, config);
    for track in tracks.iter_mut().flatten() {
        track.rests = motion::rests(&track.times, &track.places, tremble, config);
    }
    if alone::is_blind(tracks) {
        return alone::settled(tracks, tremble, config);
    }
    let rules = &config.contact;
    let mut widths = Widths::unknown(rules);
    let mut found = spans(tracks, &widths, &Flags::default(), config);
    for round in 1..=rules.rounds {
        widths = Widths::of(tracks, &found, rules);
        let flags = if round == rules.rounds { Flags::of(tracks, &found, config) } else { Flags::default() };
        for (tracks, span) in tracks.iter_mut().zip(&found) {
            let Some(span) = span else { continue };
            let track = &mut tracks[span.track];
            track.on_path = motion::on_path(&track.places, [span.first, span.last], tremble, config);
        }
        found = spans(tracks, &widths, &flags, config);
    }
    found
}

/// One hand in and around a clip.
#[derive(Debug, Clone)]
struct Track {
    side: Side,
    /// Frames in which it was seen, and their times, seconds.
    frames: Vec<usize>,
    times: Vec<f64>,
    /// Where the fingertips are, world.
    places: Vec<Point>,
    /// Distance of the fingertips to the nearest surface that is not a hand, metres: now, before and after the clip.
    /// `None` where nobody knows.
    now: Vec<Option<f64>>,
    before: Vec<Option<f64>>,
    after: Vec<Option<f64>>,
    flags: Vec<Option<bool>>,
    /// Distance between the tips of thumb and index, metres.
    openings: Vec<f64>,
    /// When the clip begins and ends by its narration, seconds.
    told_secs: [f64; 2],
    /// Log odds of each sample for being the first and the last of a hold, by whether the hand rests.
    rests: Vec<[f64; 2]>,
    /// Log odds of contact by the line or arc of the hold that was found before; `None` where it shows none.
    on_path: Option<Vec<f64>>,
    /// A hold stays within one stretch.
    stretches: Vec<usize>,
    /// A hold starts at this sample at the latest and ends at that one at the earliest: it overlaps the clip.
    starts_by: usize,
    ends_from: usize,
}

/// A stretch of a track, and how much speaks for it.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Span {
    track: usize,
    first: usize,
    last: usize,
    nats: f64,
}

/// Frames whose depth [`holds`] asks about a clip, in no order. Images are not read.
#[must_use]
pub fn frames(recording: &Recording, clip: &Clip, at_work: &AtWork, config: &config::Hands) -> Vec<usize> {
    let mut all = looked_at(recording, &hand_tracks(recording, clip, config), config.contact_every_secs);
    all.extend(still_frames(recording, clip, at_work, &config.contact).into_iter().map(|(frame, _)| frame));
    all
}

/// The hands in and around a clip, of which nothing has been looked at yet.
fn hand_tracks(recording: &Recording, clip: &Clip, config: &config::Hands) -> Vec<Track> {
    let [from, to] = widened(recording, clip, config.widen_secs);
    let around = recording.hands_in(from, to);
    let mut tracks: Vec<Track> = Vec::new();
    for side in [Side::Right, Side::Left] {
        let samples: Vec<&HandSample> = around.iter().filter(|s| s.side == side).collect();
        let (Some(ends_from), Some(starts_by)) = (
            samples.iter().position(|s| s.frame >= clip.start_frame),
            samples.iter().rposition(|s| s.frame <= clip.end_frame),
        ) else {
            continue;
        };
        let n = samples.len();
        let times: Vec<f64> = samples.iter().map(|s| recording.frames[s.frame].timestamp_secs).collect();
        let places: Vec<Point> = samples.iter().map(|s| s.grasp()).collect();
        tracks.push(Track {
            side,
            frames: samples.iter().map(|s| s.frame).collect(),
            stretches: motion::stretches(&times, &places, config),
            times,
            places,
            rests: vec![[0.0; 2]; n],
            on_path: None,
            now: vec![None; n],
            before: vec![None; n],
            after: vec![None; n],
            flags: samples.iter().map(|s| s.contact).collect(),
            openings: samples.iter().map(|s| (s.tips[0] - s.tips[1]).norm()).collect(),
            told_secs: [clip.start_frame, clip.end_frame]
                .map(|f| recording.frames.get(f).map_or(0.0, |frame| frame.timestamp_secs)),
            starts_by,
            ends_from,
        });
    }
    tracks
}

fn clip_tracks(recording: &Recording, clip: &Clip, at_work: &AtWork, config: &config::Hands) -> Result<Vec<Track>> {
    let mut tracks = hand_tracks(recording, clip, config);
    for frame in looked_at(recording, &tracks, config.contact_every_secs) {
        let Some(view) = View::of(recording, frame, &config.contact)? else { continue };
        for track in &mut tracks {
            // Two rows of one frame and side are rare; the first has the distance.
            if let Ok(i) = track.frames.binary_search(&frame) {
                track.now[i] = view.nearest_m(&track.places[i], &config.contact);
            }
        }
    }
    for (still, is_before) in still_frames(recording, clip, at_work, &config.contact) {
        let Some(view) = View::of(recording, still, &config.contact)? else { continue };
        for track in &mut tracks {
            let known = if is_before { &mut track.before } else { &mut track.after };
            for (known, place) in known.iter_mut().zip(&track.places) {
                let seen = view.nearest_m(place, &config.contact);
                *known = match (*known, seen) {
                    (Some(a), Some(b)) => Some(a.min(b)),
                    (a, b) => a.or(b),
                };
            }
        }
    }
    for track in &mut tracks {
        track.now = between(&track.times, &track.now, config.contact.between_looks * config.contact_every_secs);
    }
    Ok(tracks)
}

/// Frames with a hand, one every so many seconds, and the first and the last.
fn looked_at(recording: &Recording, tracks: &[Track], every_secs: f64) -> Vec<usize> {
    let mut frames: Vec<usize> = tracks.iter().flat_map(|t| t.frames.iter().copied()).collect();
    frames.sort_unstable();
    frames.dedup();
    let mut every = Every::secs(every_secs);
    let last = frames.last().copied();
    frames.retain(|&f| every.is_due(recording.frames[f].timestamp_secs) || Some(f) == last);
    frames
}

/// Frames without an interaction near a clip, and whether they are before it.
fn still_frames(recording: &Recording, clip: &Clip, at_work: &AtWork, rules: &config::Contact) -> Vec<(usize, bool)> {
    let time = |f: usize| recording.frames.get(f).map_or(f64::INFINITY, |x| x.timestamp_secs);
    let (start, end) = (time(clip.start_frame), time(clip.end_frame));
    let still = |f: &usize| !at_work.any(*f) && recording.frames[*f].files.depth.is_some();
    let before = (0..clip.start_frame).rev().take_while(|&f| start - time(f) <= rules.still_within_secs);
    let after = (clip.end_frame + 1..recording.frames.len()).take_while(|&f| time(f) - end <= rules.still_within_secs);
    let before = before.filter(still).take(rules.still_frames).map(|f| (f, true));
    before.chain(after.filter(still).take(rules.still_frames).map(|f| (f, false))).collect()
}

/// Values at times where they are known, linear in between where the gap is no longer than `gap_secs`.
pub(super) fn between(times: &[f64], known: &[Option<f64>], gap_secs: f64) -> Vec<Option<f64>> {
    let mut all = known.to_vec();
    let mut last: Option<(usize, f64)> = None;
    for (i, value) in known.iter().enumerate() {
        let Some(value) = value else { continue };
        if let Some((j, before)) = last {
            let span = times[i] - times[j];
            if span > 0.0 && span <= gap_secs {
                for k in j + 1..i {
                    all[k] = Some(before + (value - before) * (times[k] - times[j]) / span);
                }
            }
        }
        last = Some((i, *value));
    }
    all
}

/// How far the held surface is from the fingertips.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Widths {
    /// Over all clips, metres.
    pub(super) mean: f64,
    /// From sample to sample.
    pub(super) std: f64,
    /// From clip to clip: hands keep an error for a whole clip.
    pub(super) between: f64,
    /// Each clip's own mean, drawn towards that of all as far as it rests on few samples.
    pub(super) by_clip: Vec<Option<f64>>,
}

impl Widths {
    /// Nothing measured yet: a fingertip is at the surface.
    fn unknown(rules: &config::Contact) -> Self {
        Self { mean: 0.0, std: rules.unknown_std_m, between: 0.0, by_clip: Vec::new() }
    }

    fn of(tracks: &[Vec<Track>], spans: &[Option<Span>], rules: &config::Contact) -> Self {
        // The middle half: the hand surely holds the part there.
        let cores: Vec<Vec<f64>> = tracks
            .iter()
            .zip(spans)
            .map(|(tracks, span)| {
                let Some(span) = span else { return Vec::new() };
                let trim = (span.last - span.first) / 4;
                tracks[span.track].now[span.first + trim..=span.last - trim].iter().copied().flatten().collect()
            })
            .collect();
        let medians: Vec<Option<f64>> = cores.iter().map(|c| stats::median(c)).collect();
        let all: Vec<f64> = cores.iter().flatten().copied().collect();
        let Some(mean) = stats::median(&all) else { return Self::unknown(rules) };
        let spread = |deviations: Vec<f64>| stats::NORMAL_PER_MEDIAN * stats::median(&deviations).unwrap_or(0.0);
        let own = cores.iter().zip(&medians).filter(|(core, _)| core.len() > 2);
        let deviations = own.flat_map(|(core, m)| core.iter().map(move |d| (d - m.unwrap_or(*d)).abs()));
        let std = spread(deviations.collect()).max(rules.least_std_m);
        let between = spread(medians.iter().flatten().map(|m| (m - mean).abs()).collect()).max(rules.least_between_m);
        let by_clip = cores
            .iter()
            .zip(&medians)
            .map(|(core, median)| {
                // Neighbouring samples share their error.
                let news = (core.len() as f64 / rules.samples_a_news).max(1.0);
                let weight = between.powi(2) / (between.powi(2) + std.powi(2) / news);
                median.map(|m| weight * m + (1.0 - weight) * mean)
            })
            .collect();
        Self { mean, std, between, by_clip }
    }

    /// Log odds of contact for a distance to a surface in a clip.
    pub(super) fn nats(&self, clip: usize, distance_m: Option<f64>, rules: &config::Contact) -> f64 {
        let Some(d) = distance_m else { return 0.0 };
        let (mean, std) = match self.by_clip.get(clip).copied().flatten() {
            // The middle of a hold is steadier than its ends.
            Some(mean) => (mean, rules.ends_widen * self.std),
            None => (self.mean, self.std.hypot(self.between)),
        };
        let (astray, most) = (rules.astray_share, rules.says_at_most_nats);
        let free = (-d / rules.free_m).exp() / rules.free_m;
        let bell = (-0.5 * ((d - mean) / std).powi(2)).exp() / (std * std::f64::consts::TAU.sqrt());
        let held = (1.0 - astray) * bell + astray * free;
        (held / free).ln().clamp(-most, most)
    }
}

/// What a detector's flags are worth in this recording: log odds of contact for a flag that is set, and for one that is not.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Flags {
    set: f64,
    unset: f64,
}

impl Flags {
    fn of(tracks: &[Vec<Track>], spans: &[Option<Span>], config: &config::Hands) -> Self {
        // What a flag is taken for before anything is seen counts as much as so many samples.
        let ([wrong, right], most) = (config.contact.flags_before, config.contact.says_at_most_nats);
        let (mut inside, mut outside) = ([wrong, right], [right, wrong]);
        for (tracks, span) in tracks.iter().zip(spans) {
            let Some(span) = span else { continue };
            for (i, flag) in tracks[span.track].flags.iter().enumerate() {
                let count = if (span.first..=span.last).contains(&i) { &mut inside } else { &mut outside };
                match flag {
                    Some(true) => count[1] += 1.0,
                    Some(false) => count[0] += 1.0,
                    None => {}
                }
            }
        }
        let share = |count: [f64; 2], value: usize| count[value] / (count[0] + count[1]);
        let nats = |value: usize| f64::ln(share(inside, value) / share(outside, value));
        // A flag that is set more often without contact says nothing, rather than the reverse.
        Self { set: nats(1).clamp(0.0, most), unset: nats(0).clamp(-most, 0.0) }
    }

    /// What flags are taken for before anything is known about them.
    pub(super) fn unknown(config: &config::Hands) -> Self {
        Self::of(&[], &[], config)
    }

    pub(super) fn nats(&self, flag: Option<bool>, config: &config::Hands) -> f64 {
        config.contact.flag_news
            * match flag {
                Some(true) => self.set,
                Some(false) => self.unset,
                None => 0.0,
            }
    }
}

/// The stretch of each clip that most speaks for.
fn spans(tracks: &[Vec<Track>], widths: &Widths, flags: &Flags, config: &config::Hands) -> Vec<Option<Span>> {
    tracks
        .iter()
        .enumerate()
        .map(|(clip, tracks)| {
            let best =
                tracks.iter().enumerate().filter_map(|(t, track)| best_span((t, track), clip, widths, flags, config));
            best.fold(None, |best: Option<Span>, span| match best {
                Some(b) if b.nats >= span.nats => Some(b),
                _ => Some(span),
            })
        })
        .collect()
}

/// Sum of what each sample says, of how near the furniture is to the first sample before the clip and to the last one after
/// it, and of how long holds last: before, during and after are one chain.
fn best_span(
    (index, track): (usize, &Track),
    clip: usize,
    widths: &Widths,
    flags: &Flags,
    config: &config::Hands,
) -> Option<Span> {
    let rules = &config.contact;
    let says = track.now.iter().zip(&track.flags).enumerate().map(|(i, (now, flag))| {
        let on_path = track.on_path.as_ref().map_or(0.0, |nats| nats[i]);
        let nats = widths.nats(clip, *now, rules) + flags.nats(*flag, config) + on_path;
        nats.clamp(-rules.says_at_most_nats, rules.says_at_most_nats)
    });
    // `sums[i]`: what all samples before the i-th say.
    let mut sums = vec![0.0];
    for nats in says {
        sums.push(sums[sums.len() - 1] + nats);
    }
    let ends: Vec<f64> = (0..track.frames.len())
        .map(|j| sums[j + 1] + widths.nats(clip, track.after[j], rules) + track.rests[j][1])
        .collect();
    let mut best: Option<Span> = None;
    for (first, sum) in sums.iter().enumerate().take(track.starts_by + 1) {
        let begin = widths.nats(clip, track.before[first], rules) + track.rests[first][0] - sum;
        for (last, end) in ends.iter().enumerate().skip(first.max(track.ends_from)) {
            if track.stretches[last] != track.stretches[first] {
                break;
            }
            let nats = begin + end + lasts(track.times[last] - track.times[first], rules);
            if nats > 0.0 && best.is_none_or(|b| nats > b.nats) {
                best = Some(Span { track: index, first, last, nats });
            }
        }
    }
    best
}

/// Log likelihood of how long a hold lasts, against the most likely one.
pub(super) fn lasts(secs: f64, rules: &config::Contact) -> f64 {
    -0.5 * ((secs.max(rules.hold_least_secs) / rules.hold_secs).ln() / rules.hold_log_std).powi(2)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A hand that comes from 25 cm away in 8 samples, holds for 20 and goes in 8.
    fn track(flag: impl Fn(usize, bool) -> Option<bool>) -> Track {
        let distance = |i: usize| match i {
            0..8 => 0.25 - 0.028 * i as f64,
            8..28 => 0.03 + 0.01 * ((i * 7 % 5) as f64 / 4.0 - 0.5),
            _ => 0.03 + 0.03 * (i - 27) as f64,
        };
        let n = 36usize;
        let held = |i: usize| (8..28).contains(&i);
        Track {
            side: Side::Right,
            frames: (100..100 + n).collect(),
            times: (0..n).map(|i| i as f64 / 12.0).collect(),
            places: vec![Point::origin(); n],
            rests: vec![[0.0; 2]; n],
            on_path: None,
            stretches: vec![0; n],
            now: (0..n).map(|i| Some(distance(i))).collect(),
            before: (0..n).map(|i| (i < 12).then_some(distance(i))).collect(),
            after: (0..n).map(|i| (i > 24).then_some(distance(i))).collect(),
            flags: (0..n).map(|i| flag(i, held(i))).collect(),
            openings: vec![0.02; n],
            told_secs: [4.0 / 12.0, 30.0 / 12.0],
            starts_by: 30,
            ends_from: 4,
        }
    }

    fn found(track: Track) -> (Span, Flags) {
        let tracks = vec![vec![track]];
        let mut spans =
            spans(&tracks, &Widths::unknown(&config::Contact::default()), &Flags::default(), &config::Hands::default());
        let widths = Widths::of(&tracks, &spans, &config::Contact::default());
        spans = super::spans(&tracks, &widths, &Flags::default(), &config::Hands::default());
        let flags = Flags::of(&tracks, &spans, &config::Hands::default());
        (super::spans(&tracks, &widths, &flags, &config::Hands::default())[0].unwrap(), flags)
    }

    #[test]
    fn a_hold_is_found_without_flags_to_two_samples() {
        let (span, flags) = found(track(|_, _| None));
        assert!(span.first.abs_diff(8) <= 2 && span.last.abs_diff(27) <= 2, "{span:?}");
        // Nothing was flagged: the flags keep what they are taken for.
        assert!((flags.set - 9f64.ln()).abs() < 1e-9);
    }

    #[test]
    fn flags_that_are_always_set_say_next_to_nothing() {
        let (span, flags) = found(track(|_, _| Some(true)));
        assert!(flags.set < 0.7, "{flags:?}");
        assert!(span.first.abs_diff(8) <= 2 && span.last.abs_diff(27) <= 2, "{span:?}");
    }

    #[test]
    fn one_wrong_flag_in_seven_moves_no_end() {
        let (span, flags) = found(track(|i, held| Some(held != (i % 7 == 3))));
        assert!(flags.set > 1.0 && flags.unset < -1.0, "{flags:?}");
        assert!(span.first.abs_diff(8) <= 2 && span.last.abs_diff(27) <= 2, "{span:?}");
    }

    #[test]
    fn a_hand_in_the_air_holds_nothing() {
        let mut waving = track(|_, _| None);
        for d in [&mut waving.now, &mut waving.before, &mut waving.after] {
            d.iter_mut().for_each(|d| *d = Some(0.25));
        }
        assert_eq!(
            spans(
                &[vec![waving]],
                &Widths::unknown(&config::Contact::default()),
                &Flags::default(),
                &config::Hands::default()
            ),
            [None]
        );
    }

    #[test]
    fn gaps_are_filled_only_where_they_are_short() {
        let known = [Some(0.0), None, Some(1.0), None, Some(2.0)];
        assert_eq!(
            between(&[0.0, 0.1, 0.2, 5.0, 9.0], &known, 0.5),
            [Some(0.0), Some(0.5), Some(1.0), None, Some(2.0)]
        );
    }
}
