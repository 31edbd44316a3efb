//! Hands against what is seen where they project to: a hand's own pixels where there are masks, else depth, which tells a lag
//! and a mirror image by what hands hide ([`super::hiding`]) and all else by being near.

use nalgebra::Matrix3;
use rayon::prelude::*;

use super::agreement::student;
use super::looks::FrameLook;
use super::reading::axes;
use super::{Finding, Fix, LIKELY_NATS, Subject, hiding, sides};
use crate::math::{Point, Pose, Vector, stats};
use crate::recording::{Grid, HAND_CLASS};

/// Masks that are decoded at the most: all of a short recording, else stretches of so many frames, in which each hand meets the
/// masks before and after its own.
const MASKS: usize = 200;
const STRETCH: usize = 40;
/// Differences of one frame that count as independent: a hand stays where it is for some frames.
const INDEPENDENT: f64 = 0.25;
/// Frames by which hands could be late or early at the most.
pub(super) const MOST_LAG: i64 = 15;
/// A lag below is harmless, frames.
pub(super) const LEAST_LAG: i64 = 4;
/// The same in seconds, for fast cameras: a hand at work moves by a few centimetres in that time.
pub(super) const HARMLESS_SECS: f64 = 0.15;
/// Frames with a hand that are needed to judge.
pub(super) const LEAST: usize = 8;
/// What the best of some readings or lags gains by chance, nats: there are some 60 readings; neighbouring lags say the same.
const CHANCE_NATS: f64 = 4.1;
pub(super) const LAG_NATS: f64 = 1.0;
/// Right hands are seen where they are more often than this.
pub(super) const RIGHT: f64 = 0.5;
/// Where hands are seen nearly as often as declared, they are right: chance moves the best of many.
pub(super) const NEARLY: f64 = 0.7;
/// Distances of a hand from the head, metres, with room for errors.
pub(super) const REACH_M: std::ops::Range<f64> = 0.05..2.5;

/// What one frame sees.
enum Sight<'a> {
    Mask(Grid<u8>),
    Depth(&'a FrameLook),
}

/// A frame and what it sees.
struct Witness<'a> {
    frame: usize,
    sight: Sight<'a>,
}

/// Where a hand's point lies in the world, of the point as it is written and `world_from_camera`.
type Place = Box<dyn Fn(&Point, &Pose) -> Point + Send + Sync>;

/// Another meaning of the hands' numbers.
struct Meaning {
    what: String,
    remedy: String,
    fix: Option<Fix>,
    place: Place,
}

/// Seconds between frames, the median.
pub(super) fn period(secs: &[f64]) -> f64 {
    let steps: Vec<f64> = secs.windows(2).map(|w| w[1] - w[0]).collect();
    stats::median(&steps).unwrap_or(0.0)
}

/// What is seen at the hands over their own distance, the median; `None` where they are not in the images.
pub(super) fn depth_ratio(subject: &Subject, looks: &[FrameLook]) -> Option<f64> {
    let (mut all, mut ratios) = (0usize, Vec::new());
    for look in looks {
        let Some(pose) = subject.poses.get(look.frame) else { continue };
        for hand in at(subject, look.frame) {
            all += 1;
            let Some((u, v, z)) = projected(subject, pose, hand) else { continue };
            ratios.extend(look.depth_at(u, v).map(|d| d / z));
        }
    }
    stats::median(&ratios).filter(|_| ratios.len() >= LEAST && 10 * ratios.len() >= 7 * all)
}

/// Findings about hands under poses that are right.
pub(super) fn judge(subject: &Subject, looks: &[FrameLook]) -> Option<Finding> {
    // A mirror image changes sides, too.
    placed(subject, looks).or_else(|| sides::judge(subject))
}

/// What is wrong about where hands are.
fn placed(subject: &Subject, looks: &[FrameLook]) -> Option<Finding> {
    let witnesses = witnesses(subject, looks);
    // Hands of another time are not where they are seen either: where a lag explains it, nothing else is asked.
    if matches!(witnesses.first().map(|w| &w.sight), Some(Sight::Mask(_))) {
        return late(subject, &witnesses).or_else(|| misread(subject, &witnesses));
    }
    let hiding = hiding::Hiding::of(subject);
    let near = || (witnesses.len() >= LEAST).then(|| misread(subject, &witnesses)).flatten();
    hiding.late().or_else(|| hiding.mirrored()).or_else(near)
}

/// Hands of a frame.
fn at<'a>(subject: &'a Subject, frame: usize) -> impl Iterator<Item = &'a Point> {
    let first = subject.hands.partition_point(|h| h.0 < frame);
    subject.hands.iter().skip(first).take_while(move |h| h.0 == frame).map(|h| &h.1)
}

/// Pixel and distance along the axis of a place; `None` outside of the image.
pub(super) fn projected(subject: &Subject, pose: &Pose, place: &Point) -> Option<(f64, f64, f64)> {
    let p = pose.inverse() * place;
    let (u, v) = subject.camera.project(&p).filter(|(u, v)| subject.camera.contains(*u, *v))?;
    Some((u, v, p.z))
}

/// Whether a frame is within the largest lag of a hand.
pub(super) fn is_near(subject: &Subject, frame: usize) -> bool {
    let most = MOST_LAG.unsigned_abs() as usize;
    let first = subject.hands.partition_point(|h| h.0 < frame.saturating_sub(most));
    subject.hands.get(first).is_some_and(|h| h.0 <= frame.saturating_add(most))
}

/// Frames around hands with masks that show hands, else the looks.
fn witnesses<'a>(subject: &Subject, looks: &'a [FrameLook]) -> Vec<Witness<'a>> {
    let wanted: Vec<usize> = subject.with_mask.iter().copied().filter(|&f| is_near(subject, f)).collect();
    let masks: Vec<Witness> = stretches(&wanted, MASKS)
        .into_par_iter()
        .filter_map(|frame| Some(Witness { frame, sight: Sight::Mask((subject.mask)(frame)?) }))
        .collect();
    let shows = |w: &&Witness| matches!(&w.sight, Sight::Mask(m) if m.data.contains(&HAND_CLASS));
    // Masks of furniture alone say nothing about hands.
    if masks.len() >= LEAST && 2 * masks.iter().filter(shows).count() > masks.len() {
        return masks;
    }
    looks
        .iter()
        .filter(|l| is_near(subject, l.frame))
        .map(|l| Witness { frame: l.frame, sight: Sight::Depth(l) })
        .collect()
}

/// All of a list that is not longer than `most`; of a longer one evenly spread stretches.
pub(super) fn stretches(all: &[usize], most: usize) -> Vec<usize> {
    if all.len() <= most {
        return all.to_vec();
    }
    let count = (most / STRETCH).max(2);
    let length = (most / count).min(all.len());
    let last = all.len() - length;
    (0..count)
        .flat_map(|i| all.iter().skip(i * last / (count - 1)).take(length))
        .copied()
        .collect::<std::collections::BTreeSet<usize>>()
        .into_iter()
        .collect()
}

/// Whether a frame sees a hand at a place: hand pixels there, or depth within this ratio of the hand's.
fn sees(subject: &Subject, witness: &Witness, place: &Point, ratio: f64) -> bool {
    let Some(pose) = subject.poses.get(witness.frame) else { return false };
    let Some((u, v, z)) = projected(subject, pose, place) else { return false };
    let is_near = REACH_M.contains(&(place - Point::from(pose.translation.vector)).norm());
    is_near
        && match &witness.sight {
            Sight::Mask(mask) => is_hand(mask, u, v),
            Sight::Depth(look) => look.depth_at(u, v).is_some_and(|d| (d / z).ln().abs() < ratio.ln()),
        }
}

/// Whether a pixel of a hand is near.
fn is_hand(mask: &Grid<u8>, u: f64, v: f64) -> bool {
    // Fingertips lie at the rim of a hand: a percent of the image beside it is on it.
    let reach = (mask.width / 100).max(1) as i64;
    let step = |c: f64, by: i64| usize::try_from(c.round() as i64 + by).ok();
    (-reach..=reach).any(|dy| {
        (-reach..=reach).any(|dx| {
            step(u, dx).zip(step(v, dy)).and_then(|(x, y)| mask.get(x, y)).is_some_and(|class| class == HAND_CLASS)
        })
    })
}

/// Shares of hands that are seen where they are, frame by frame, of those frames `lag` later that have hands.
fn shares(
    subject: &Subject,
    witnesses: &[Witness],
    lag: i64,
    ratio: f64,
    meaning: Option<&Meaning>,
) -> Vec<Option<f64>> {
    witnesses
        .iter()
        .map(|w| {
            let frame = usize::try_from(i64::try_from(w.frame).ok()?.saturating_add(lag)).ok()?;
            let (mut all, mut seen) = (0usize, 0usize);
            for hand in at(subject, frame) {
                let place = match (meaning, subject.poses.get(frame)) {
                    (Some(m), Some(pose)) => (m.place)(hand, pose),
                    _ => *hand,
                };
                all += 1;
                seen += usize::from(sees(subject, w, &place, ratio));
            }
            (all > 0).then(|| seen as f64 / all as f64)
        })
        .collect()
}

fn mean(shares: &[Option<f64>]) -> f64 {
    let known: Vec<f64> = shares.iter().flatten().copied().collect();
    stats::mean(&known).unwrap_or(0.0)
}

/// Log odds that hands are seen better in one way than in another, of frames that tell both.
fn nats(better: &[Option<f64>], worse: &[Option<f64>]) -> f64 {
    let differences: Vec<f64> = better.iter().zip(worse).filter_map(|(a, b)| Some((*a)? - (*b)?)).collect();
    if differences.len() < LEAST { 0.0 } else { student(&differences, INDEPENDENT * differences.len() as f64) }
}

/// What a share is of.
fn kind(witnesses: &[Witness]) -> &'static str {
    match witnesses.first().map(|w| &w.sight) {
        Some(Sight::Mask(_)) => "of the hands lie on a hand's pixels",
        _ => "of the hands lie in the image, near what is seen there",
    }
}

/// Hands in another frame or unit.
fn misread(subject: &Subject, witnesses: &[Witness]) -> Option<Finding> {
    /// Depth beside a hand is within this ratio of the hand's: the wall behind it, a counter before it.
    const RATIO: f64 = 2.0;
    /// Hands that are nowhere to be seen under any meaning.
    const LOST: f64 = 0.25;
    let declared = shares(subject, witnesses, 0, RATIO, None);
    let (count, share) = (declared.iter().flatten().count(), mean(&declared));
    if share >= RIGHT || count < LEAST {
        return None;
    }
    let rated: Vec<(Meaning, Vec<Option<f64>>)> = meanings()
        .into_par_iter()
        .map(|m| {
            let shares = shares(subject, witnesses, 0, RATIO, Some(&m));
            (m, shares)
        })
        .collect();
    let (best, found) = rated.into_iter().rev().max_by(|a, b| mean(&a.1).total_cmp(&mean(&b.1)))?;
    let gain = nats(&found, &declared) - CHANCE_NATS;
    if mean(&found) > (2.0 * share).max(RIGHT) && gain > LIKELY_NATS {
        return Some(Finding {
            what: best.what,
            evidence: format!(
                "{:.0} % {} as declared, {:.0} % so read ({count} frames)",
                100.0 * share,
                kind(witnesses),
                100.0 * mean(&found)
            ),
            remedy: best.remedy,
            nats: gain,
            ruinous: true,
            fix: best.fix,
        });
    }
    (share < LOST).then(|| Finding {
        what: "hands are not where the images show them".to_owned(),
        evidence: format!("{:.0} % {} ({count} frames)", 100.0 * share, kind(witnesses)),
        remedy: "hands and camera poses must share one world, one unit (metres) and one clock".to_owned(),
        nats: LIKELY_NATS,
        ruinous: true,
        fix: None,
    })
}

/// All other meanings, those that people mix up first.
fn meanings() -> Vec<Meaning> {
    let gl = Vector::new(1.0, -1.0, -1.0);
    let mut out = vec![
        Meaning {
            what: "the hands are in the camera's frame, not in the world's".to_owned(),
            remedy: "multiply hands by world_from_camera of their frame".to_owned(),
            fix: None,
            place: Box::new(|p, pose| pose * p),
        },
        Meaning {
            what: "the hands are in the frame of a camera with OpenGL's axes".to_owned(),
            remedy: "negate y and z of the hands and multiply them by world_from_camera of their frame".to_owned(),
            fix: None,
            place: Box::new(move |p, pose| pose * Point::from(p.coords.component_mul(&gl))),
        },
    ];
    for factor in [0.001, 0.01, 0.0254, 0.1, 10.0, 39.37, 100.0, 1000.0] {
        out.push(Meaning {
            what: format!("the hands' unit is {factor} m"),
            remedy: format!("multiply hands by {factor}"),
            fix: Some(Fix::HandUnit(factor)),
            place: Box::new(move |p, _| p * factor),
        });
    }
    for axis in 0..3 {
        let (what, remedy) = mirror_words(axis);
        out.push(Meaning { what, remedy, fix: None, place: Box::new(move |p, pose| mirrored(p, pose, axis)) });
    }
    out.extend(axes().into_iter().skip(1).map(|turn: Matrix3<f64>| Meaning {
        what: format!("the hands are in a world of other axes: {}", world_words(&turn)),
        remedy: "bring hands and camera poses into one world".to_owned(),
        fix: None,
        place: Box::new(move |p, _| Point::from(turn * p.coords)),
    }));
    out
}

/// A place mirrored in an axis of the camera.
pub(super) fn mirrored(place: &Point, pose: &Pose, axis: usize) -> Point {
    let mut seen = pose.inverse() * place;
    if let Some(coordinate) = seen.coords.get_mut(axis) {
        *coordinate = -*coordinate;
    }
    pose * seen
}

/// What a mirror image is called, and what sets it right.
pub(super) fn mirror_words(axis: usize) -> (String, String) {
    let name = ["x", "y", "z"].get(axis).copied().unwrap_or("x");
    (
        format!("the hands are mirrored in the camera's {name}"),
        format!("negate the hands' {name} in the camera's frame before they are moved into the world"),
    )
}

/// Axes of a world in words.
fn world_words(turn: &Matrix3<f64>) -> String {
    let row = |r: usize| {
        let at = (0..3).find(|c| turn[(r, *c)].abs() > 0.5).unwrap_or(0);
        let sign = if turn[(r, at)] < 0.0 { "-" } else { "+" };
        format!("{sign}{}", ["x", "y", "z"][at])
    };
    format!("the poses' x, y, z are the hands' {}, {}, {}", row(0), row(1), row(2))
}

/// Hands that come too late or too early, where masks show hands.
fn late(subject: &Subject, witnesses: &[Witness]) -> Option<Finding> {
    let now = shares(subject, witnesses, 0, 1.0, None);
    let (lag, best) = (-MOST_LAG..=MOST_LAG)
        .map(|lag| (lag, shares(subject, witnesses, lag, 1.0, None)))
        .filter(|(_, s)| s.iter().flatten().count() >= LEAST)
        .max_by(|a, b| mean(&a.1).total_cmp(&mean(&b.1)).then(b.0.abs().cmp(&a.0.abs())))?;
    let gain = nats(&best, &now) - LAG_NATS;
    if lag.abs() < LEAST_LAG || mean(&best) < RIGHT || mean(&now) > NEARLY * mean(&best) || gain < LIKELY_NATS {
        return None;
    }
    let evidence = format!(
        "{:.0} % {} at their own times, {:.0} % when shifted ({} frames)",
        100.0 * mean(&now),
        kind(witnesses),
        100.0 * mean(&best),
        witnesses.len()
    );
    told_lag(subject, lag, evidence, gain)
}

/// The words for hands of another time; `None` where the lag is too short to do harm.
pub(super) fn told_lag(subject: &Subject, lag: i64, evidence: String, nats: f64) -> Option<Finding> {
    let secs = lag as f64 * period(&subject.secs);
    let word = if lag > 0 { "late" } else { "early" };
    (secs.abs() >= HARMLESS_SECS).then(|| Finding {
        what: format!("the hands come {:.2} s ({} frames) too {word} for the images", secs.abs(), lag.abs()),
        evidence,
        remedy: format!("subtract {secs:.2} s from the hands' times"),
        nats,
        // Narrations still find the hands, and most joints.
        ruinous: false,
        fix: Some(Fix::HandLag(lag)),
    })
}
