//! When a hand holds something by its motion alone, where a recording has no depth: of all stretches between two rests the one
//! that is a line or an arc, lasts as holds do, lies where the narration says, and in which the hand is as fast and its fingers
//! as far apart as in the recording's other holds. Flags speak from the start: there is nothing else that tells contact.

use rayon::prelude::*;

use super::{Flags, Span, Track, lasts, motion};
use crate::config;
use crate::hands::Every;
use crate::math::{Point, stats};

/// Whether nothing was seen around any hand.
pub(super) fn is_blind(tracks: &[Vec<Track>]) -> bool {
    let none = |known: &[Option<f64>]| known.iter().all(Option::is_none);
    tracks.iter().flatten().all(|t| none(&t.now) && none(&t.before) && none(&t.after))
}

/// The hold of each clip; rests of the tracks are known.
pub(super) fn settled(tracks: &[Vec<Track>], tremble_m: f64, config: &config::Hands) -> Vec<Option<Span>> {
    let calm: Vec<Vec<Vec<Point>>> =
        tracks.iter().map(|clip| clip.iter().map(|t| motion::calmed(&t.times, &t.places, config)).collect()).collect();
    let mut flags = Flags::unknown(config);
    let mut measures = Measures::default();
    let mut found = Vec::new();
    for _ in 0..config.contact.rounds {
        found = tracks
            .par_iter()
            .zip(&calm)
            .map(|(clip, calm)| {
                let each = clip.iter().zip(calm).enumerate();
                each.filter_map(|(t, (track, calm))| {
                    best_span(t, (track, calm.as_slice()), tremble_m, (&flags, &measures), config)
                })
                .fold(None, |best: Option<Span>, span| best.filter(|b| b.nats >= span.nats).or(Some(span)))
            })
            .collect();
        flags = Flags::of(tracks, &found, config);
        measures = Measures::of(tracks, &found, &config.alone);
    }
    found
}

/// The stretch of a track that most speaks for.
fn best_span(
    index: usize,
    (track, calm): (&Track, &[Point]),
    tremble_m: f64,
    (flags, measures): (&Flags, &Measures),
    config: &config::Hands,
) -> Option<Span> {
    let (rules, most) = (&config.alone, config.contact.says_at_most_nats);
    let mut sums = vec![0.0];
    for (i, flag) in track.flags.iter().enumerate() {
        let says = flags.nats(*flag, config) + measures.nats(track, i, rules);
        sums.push(sums[sums.len() - 1] + says.clamp(-most, most));
    }
    let beside = |time: f64, told: f64| -0.5 * ((time - told) / rules.narration_std_secs).powi(2);
    let least = rules.least_move_m.max(rules.least_trembles * tremble_m);
    let due = tried(&track.times, rules.tried_secs);
    let is_tried = |i: usize| due[i];
    let mut best: Option<Span> = None;
    for first in (0..=track.starts_by).filter(|&i| is_tried(i) && track.rests[i][0] >= -rules.unrest_nats) {
        let begin = track.rests[first][0] + beside(track.times[first], track.told_secs[0]) - sums[first];
        let mut farthest = 0.0f64;
        for last in first + 1..track.times.len() {
            let secs = track.times[last] - track.times[first];
            if secs > rules.longest_secs || track.stretches[last] != track.stretches[first] {
                break;
            }
            let moved = (calm[last] - calm[first]).norm();
            farthest = farthest.max(moved);
            // The way there, not there and back: that is two interactions.
            if last < track.ends_from || !is_tried(last) || moved < least || moved < rules.one_way_share * farthest {
                continue;
            }
            let end = track.rests[last][1] + beside(track.times[last], track.told_secs[1]) + sums[last + 1];
            let nats = begin + end + lasts(secs, &config.contact);
            // A path adds no more than that; its fit is what takes time.
            if track.rests[last][1] < -rules.unrest_nats
                || best.is_some_and(|b| nats + 2.0 * rules.independent < b.nats)
            {
                continue;
            }
            let nats = nats + along(&track.places[first..=last], tremble_m, config);
            if nats > 0.0 && best.is_none_or(|b| nats > b.nats) {
                best = Some(Span { track: index, first, last, nats });
            }
        }
    }
    best
}

/// Samples at which a hold may begin or end: all of a slow track, every so often of a fast one.
fn tried(times: &[f64], every_secs: f64) -> Vec<bool> {
    let mut every = Every::secs(every_secs);
    times.iter().map(|&time| every.is_due(time)).collect()
}

/// What a stretch says by being one line or arc, nats.
pub(crate) fn along(places: &[Point], tremble_m: f64, config: &config::Hands) -> f64 {
    let count = places.len() as f64;
    motion::path_nats(places, tremble_m, config) * (config.alone.independent / count).min(1.0)
}

/// How the samples of holds differ from the others in this recording.
#[derive(Debug, Default)]
struct Measures {
    speed: Option<Measure>,
    opening: Option<Measure>,
}

impl Measures {
    fn of(tracks: &[Vec<Track>], spans: &[Option<Span>], rules: &config::HandAlone) -> Self {
        let [mut speed, mut opening]: [[Vec<f64>; 2]; 2] = Default::default();
        for (tracks, span) in tracks.iter().zip(spans) {
            let Some(span) = span else { continue };
            let track = &tracks[span.track];
            for i in 0..track.times.len() {
                let held = usize::from((span.first..=span.last).contains(&i));
                speed[held].extend(speed_of(track, i, rules));
                opening[held].extend(track.openings.get(i));
            }
        }
        Self { speed: Measure::of(&speed, rules), opening: Measure::of(&opening, rules) }
    }

    fn nats(&self, track: &Track, i: usize, rules: &config::HandAlone) -> f64 {
        let of = |measure: &Option<Measure>, value: Option<f64>| {
            measure.as_ref().zip(value).map_or(0.0, |(measure, value)| measure.nats(value, rules.measure_nats))
        };
        of(&self.speed, speed_of(track, i, rules)) + of(&self.opening, track.openings.get(i).copied())
    }
}

/// Speed of a hand at a sample, m/s; `None` at the ends of a track and beside gaps.
fn speed_of(track: &Track, i: usize, rules: &config::HandAlone) -> Option<f64> {
    let (before, after) = (i.checked_sub(1)?, i + 1);
    let secs = track.times.get(after)? - track.times.get(before)?;
    (secs > 1e-3 && secs < rules.gap_secs).then(|| (track.places[after] - track.places[before]).norm() / secs)
}

/// A measure of free and of held samples: mean and standard deviation each.
#[derive(Debug, Clone, Copy)]
struct Measure {
    free: [f64; 2],
    held: [f64; 2],
}

impl Measure {
    /// Of the values of free and of held samples; `None` where there are few, or where they do not differ.
    fn of(values: &[Vec<f64>; 2], rules: &config::HandAlone) -> Option<Self> {
        if values.iter().any(|v| v.len() < rules.least_samples) {
            return None;
        }
        let bell = |values: &[f64]| -> Option<[f64; 2]> {
            let middle = stats::median(values)?;
            let off: Vec<f64> = values.iter().map(|v| (v - middle).abs()).collect();
            Some([middle, stats::NORMAL_PER_MEDIAN * stats::median(&off)?])
        };
        let (mut free, mut held) = (bell(&values[0])?, bell(&values[1])?);
        let least = rules.least_std_share * free[1].max(held[1]);
        (free[1], held[1]) = (free[1].max(least), held[1].max(least));
        let differs = least > 0.0 && (free[0] - held[0]).abs() > rules.differ_stds * free[1].hypot(held[1]);
        differs.then_some(Self { free, held })
    }

    fn nats(&self, value: f64, says: f64) -> f64 {
        let of = |[mean, std]: [f64; 2]| -0.5 * ((value - mean) / std).powi(2) - std.ln();
        (says * (of(self.held) - of(self.free))).clamp(-says, says)
    }
}

#[cfg(test)]
mod tests {
    use super::super::Side;
    use super::*;
    use crate::math::Vector;

    /// A hand that reaches for 0.7 s, opens a door of half a metre by 60 degrees in 1.5 s, and withdraws; 3 mm of noise.
    fn track(flag: Option<bool>, gap: f64) -> Track {
        let step = |s: f64| s.powi(3) * (10.0 - 15.0 * s + 6.0 * s * s);
        let on_arc = |s: f64| {
            let a = 1.05 * s;
            Point::new(0.5 - 0.5 * a.cos(), -0.5 * a.sin(), 1.0)
        };
        let rest = Point::new(0.3, -0.6, 1.2);
        let at = |i: usize| match i {
            0..8 => rest + (on_arc(0.0) - rest) * step((i + 1) as f64 / 8.0),
            8..26 => on_arc(step((i - 8) as f64 / 17.0)),
            _ => on_arc(1.0) + (rest - on_arc(1.0)) * step((i - 25) as f64 / 8.0),
        };
        let noise = |i: usize, k: usize| 0.003 * (((i * 37 + k * 11) % 17) as f64 / 8.0 - 1.0);
        let places: Vec<Point> = (0..34).map(|i| at(i) + Vector::new(noise(i, 0), noise(i, 1), noise(i, 2))).collect();
        let times: Vec<f64> = (0..34).map(|i| f64::from(i) / 12.0).collect();
        let held = |i: &usize| (8..26).contains(i);
        Track {
            side: Side::Right,
            frames: (0..34).collect(),
            rests: vec![[0.0; 2]; 34],
            on_path: None,
            stretches: vec![0; 34],
            now: vec![None; 34],
            before: vec![None; 34],
            after: vec![None; 34],
            flags: (0..34).map(|i| flag.map(|right| held(&i) == right)).collect(),
            openings: (0..34).map(|i| if held(&i) { 0.02 } else { 0.02 + gap }).collect(),
            told_secs: [4.0 / 12.0, 29.0 / 12.0],
            starts_by: 29,
            ends_from: 4,
            times,
            places,
        }
    }

    fn found(mut track: Track) -> Span {
        let tremble = motion::tremble_m(
            std::iter::once((track.times.as_slice(), track.places.as_slice())),
            &config::Hands::default(),
        );
        track.rests = motion::rests(&track.times, &track.places, tremble, &config::Hands::default());
        let tracks = vec![vec![track]];
        assert!(is_blind(&tracks));
        settled(&tracks, tremble, &config::Hands::default())[0].unwrap()
    }

    #[test]
    fn the_arc_between_two_rests_is_the_hold() {
        for flag in [None, Some(true)] {
            let span = found(track(flag, 0.0));
            assert!(span.first.abs_diff(8) <= 3 && span.last.abs_diff(25) <= 3, "{flag:?}: {span:?}");
        }
    }

    #[test]
    fn fingers_that_close_in_holds_tell_them_and_fingers_that_do_not_say_nothing() {
        let of = |gap: f64| {
            let tracks: Vec<Vec<Track>> = (0..3).map(|_| vec![track(None, gap)]).collect();
            let span = Some(Span { track: 0, first: 8, last: 25, nats: 1.0 });
            Measures::of(&tracks, &[span; 3], &config::HandAlone::default()).opening
        };
        assert!(of(0.0).is_none());
        let values = [(0..40).map(|i| 0.06 + 0.001 * f64::from(i % 7)).collect(), vec![0.02; 40]];
        let measure = Measure::of(&values, &config::HandAlone::default()).unwrap();
        assert!(measure.nats(0.02, 0.25) > 0.2 && measure.nats(0.063, 0.25) < -0.2);
    }
}
