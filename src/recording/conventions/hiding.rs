//! Hands in depth, where no mask shows them: a hand hides what is behind it, where and while it is there.
//!
//! At the pixel of a hand's middle depth is the hand's own or that of its arm, which is nearer; when the hand is elsewhere it is
//! that of the furniture behind. So the share of hands that are seen so has a peak at the right time, however noisy hands and
//! depth are, and a flat one, or none, under a wrong reading. A surface that is merely near is none: a door that is held is where
//! the hand is for a whole clip. Depth that shows no hands, such as a reconstruction's, has no peak and says nothing.

use super::agreement::student;
use super::hands::{
    HARMLESS_SECS, LAG_NATS, LEAST, LEAST_LAG, MOST_LAG, NEARLY, REACH_M, RIGHT, is_near, mirror_words, mirrored,
    period, projected, stretches, told_lag,
};
use super::looks::{self, FrameLook};
use super::{Finding, LIKELY_NATS, Subject};
use crate::math::{Point, stats};

/// What is seen at a hand's middle, nearer (its back, its arm) and farther (noise) than it, metres.
const BEFORE_M: std::ops::Range<f64> = -0.25..0.04;
/// Depth images that are decoded at the most and, however large they are, at the least.
const FRAMES: [usize; 2] = [80, 200];
/// Their pixels together: 200 images of 640 x 480.
const PIXELS: usize = 60_000_000;
/// A hand at work is elsewhere after this long, seconds: samples that are nearer in time share their errors.
const INDEPENDENT_SECS: f64 = 1.0 / 6.0;
/// A peak is this many times as high as what lies beside it.
const PEAK: f64 = 1.15;

/// Whether each hand is seen, in the order of the subject's hands; `None` where its frame was not looked at.
type Seen = Vec<Option<f64>>;

/// Depth around hands.
pub(super) struct Hiding<'a> {
    subject: &'a Subject<'a>,
    /// By frame, rising.
    looks: Vec<FrameLook>,
}

/// How often hands are seen at a lag, and in the whole neighbourhood of it.
struct Peak {
    lag: i64,
    seen: Seen,
    /// The highest share at lags that are not beside this one.
    beside: f64,
}

impl<'a> Hiding<'a> {
    /// Decodes depth around hands: all of a short recording, else stretches.
    pub fn of(subject: &'a Subject<'a>) -> Self {
        let area = subject.camera.width.saturating_mul(subject.camera.height).max(1);
        let wanted: Vec<usize> = subject.with_depth.iter().copied().filter(|&f| is_near(subject, f)).collect();
        let frames = stretches(&wanted, (PIXELS / area).clamp(FRAMES[0], FRAMES[1]));
        Self { subject, looks: looks::at(subject, &frames) }
    }

    /// Hands that come too late or too early.
    pub fn late(&self) -> Option<Finding> {
        let now = self.seen(0, false);
        let best = self.peak(false, None)?;
        let gain = self.nats(&best.seen, &now) - LAG_NATS;
        if best.lag.abs() < LEAST_LAG || !is_better(&best, &now) || gain < LIKELY_NATS {
            return None;
        }
        told_lag(self.subject, best.lag, self.words(&now, &best.seen, "at their own times", "when shifted"), gain)
    }

    /// Hands whose x is that of the other side of the image.
    pub fn mirrored(&self) -> Option<Finding> {
        let now = self.seen(0, false);
        let best = self.peak(true, Some(0))?;
        let gain = self.nats(&best.seen, &now) - LAG_NATS;
        let (what, remedy) = mirror_words(0);
        (is_better(&best, &now) && gain >= LIKELY_NATS).then(|| Finding {
            what,
            evidence: self.words(&now, &best.seen, "as declared", "so read"),
            remedy,
            nats: gain,
            ruinous: true,
            fix: None,
        })
    }

    fn words(&self, now: &[Option<f64>], best: &[Option<f64>], declared: &str, read: &str) -> String {
        format!(
            "{:.0} % of the hands hide what is behind them {declared}, {:.0} % {read} ({} hands, depth of {} frames)",
            100.0 * mean(now),
            100.0 * mean(best),
            now.iter().flatten().count(),
            self.looks.len()
        )
    }

    /// Whether hands are seen if those of frame `i + lag` belong to frame `i`.
    fn seen(&self, lag: i64, is_mirrored: bool) -> Seen {
        self.subject.hands.iter().map(|(frame, place, _)| self.sees(*frame, place, lag, is_mirrored)).collect()
    }

    fn sees(&self, frame: usize, place: &Point, lag: i64, is_mirrored: bool) -> Option<f64> {
        let at = usize::try_from(i64::try_from(frame).ok()?.checked_sub(lag)?).ok()?;
        let look = self.looks.get(self.looks.binary_search_by_key(&at, |l| l.frame).ok()?)?;
        let place = if is_mirrored { mirrored(place, self.subject.poses.get(frame)?, 0) } else { *place };
        let pose = self.subject.poses.get(at)?;
        let reach = (place.coords - pose.translation.vector).norm();
        let hides = projected(self.subject, pose, &place)
            .and_then(|(u, v, z)| Some(look.depth_at(u, v)? - z))
            .is_some_and(|before| BEFORE_M.contains(&before));
        Some(f64::from(u8::from(hides && REACH_M.contains(&reach))))
    }

    /// The lag at which hands are seen most often, or the one that is asked for.
    fn peak(&self, is_mirrored: bool, wanted: Option<i64>) -> Option<Peak> {
        let rated: Vec<(i64, Seen)> = (-MOST_LAG..=MOST_LAG)
            .map(|lag| (lag, self.seen(lag, is_mirrored)))
            .filter(|(_, seen)| seen.iter().flatten().count() >= LEAST)
            .collect();
        let by_share =
            |a: &&(i64, Seen), b: &&(i64, Seen)| mean(&a.1).total_cmp(&mean(&b.1)).then(b.0.abs().cmp(&a.0.abs()));
        let best = match wanted {
            Some(lag) => rated.iter().find(|(l, _)| *l == lag),
            None => rated.iter().max_by(by_share),
        };
        let (lag, seen) = best?;
        let width = self.width();
        let shares = rated.iter().filter(|(l, _)| (l - lag).abs() >= width).map(|(_, s)| mean(s));
        // Without a neighbourhood there is no peak.
        let beside = shares.max_by(f64::total_cmp)?;
        Some(Peak { lag: *lag, seen: seen.clone(), beside })
    }

    /// Half the width of a peak, frames: a hand has left its own size in twice the time of a harmless lag.
    fn width(&self) -> i64 {
        let step = period(&self.subject.secs);
        let frames = if step > 0.0 { (2.0 * HARMLESS_SECS / step).ceil() } else { 0.0 };
        // Saturates where the clock hardly moves.
        (frames as i64).max(LEAST_LAG)
    }

    /// Log odds that hands are seen better in one way than in another, of the hands that both ways tell.
    fn nats(&self, better: &[Option<f64>], worse: &[Option<f64>]) -> f64 {
        let differences: Vec<f64> = better.iter().zip(worse).filter_map(|(a, b)| Some((*a)? - (*b)?)).collect();
        if differences.len() < LEAST {
            return 0.0;
        }
        let share = (period(&self.subject.secs) / INDEPENDENT_SECS).clamp(0.0, 1.0);
        student(&differences, share * differences.len() as f64)
    }
}

fn mean(seen: &[Option<f64>]) -> f64 {
    let known: Vec<f64> = seen.iter().flatten().copied().collect();
    stats::mean(&known).unwrap_or(0.0)
}

/// Whether a peak is one, and clearly above what is declared.
fn is_better(peak: &Peak, now: &[Option<f64>]) -> bool {
    let best = mean(&peak.seen);
    best >= RIGHT && mean(now) <= NEARLY * best && best > PEAK * peak.beside
}
