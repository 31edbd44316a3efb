//! How well poses explain depth, and how sure a comparison of two readings is.

use nalgebra::Matrix3;

use super::Subject;
use super::looks::FrameLook;
use crate::math::{Pose, Vector};

/// Pairs of looks that are compared at the most: more hardly tell more, and all readings are asked about each.
const PAIRS: usize = 200;
/// Looks that are turned against each other by more hardly see one place, radians. Every reading has the same angle.
const TURN: f64 = 0.7;

/// Two looks that may see one place.
#[derive(Debug, Clone, Copy)]
pub(super) struct Pair {
    /// Index of the look whose places are moved.
    pub a: usize,
    /// Index of the look that they are moved into.
    pub b: usize,
    /// The angle between both, radians.
    pub angle: f64,
}

/// A way to read poses.
#[derive(Debug, Clone, Copy)]
pub(super) struct Candidate<'a> {
    /// The poses of all frames.
    pub poses: &'a [Pose],
    /// The right camera's axes in the poses' camera's.
    pub axes: Matrix3<f64>,
    /// What positions are multiplied by.
    pub scale: f64,
    /// The pose of frame `i + lag` belongs to frame `i`.
    pub lag: i64,
}

impl Candidate<'_> {
    fn pose(&self, frame: usize) -> Option<&Pose> {
        let last = self.poses.len().checked_sub(1)?;
        let shifted = i64::try_from(frame).ok()?.saturating_add(self.lag).max(0);
        self.poses.get(usize::try_from(shifted).ok()?.min(last))
    }

    /// Of each pair, the share of places that meet.
    pub fn shares(&self, looks: &[FrameLook], pairs: &[Pair]) -> Vec<f64> {
        pairs.iter().map(|p| self.share(looks.get(p.a), looks.get(p.b)).unwrap_or(0.0)).collect()
    }

    fn share(&self, a: Option<&FrameLook>, b: Option<&FrameLook>) -> Option<f64> {
        let (a, b) = (a?, b?);
        let (from, to) = (self.pose(a.frame)?, self.pose(b.frame)?);
        let back = to.rotation.inverse();
        let turn = (back * from.rotation).to_rotation_matrix().into_inner();
        let shift: Vector = back * (from.translation.vector - to.translation.vector);
        let turn = self.axes * turn * self.axes.transpose();
        Some(b.meets(&a.places, &turn, &(self.axes * shift * self.scale)))
    }
}

/// Pairs of looks that may overlap, evenly thinned. Read as declared: angles between poses are the same in most readings.
pub(super) fn pairs(subject: &Subject, looks: &[FrameLook]) -> Vec<Pair> {
    let mut all = Vec::new();
    for (a, from) in looks.iter().enumerate() {
        for (b, to) in looks.iter().enumerate().skip(a + 1) {
            let (Some(p), Some(q)) = (subject.poses.get(from.frame), subject.poses.get(to.frame)) else { continue };
            let angle = p.rotation.angle_to(&q.rotation);
            if angle < TURN {
                all.push(Pair { a, b, angle });
            }
        }
    }
    let step = all.len().div_ceil(PAIRS).max(1);
    all.into_iter().step_by(step).collect()
}

/// Mean of shares; 0 for none.
pub(super) fn mean(shares: &[f64]) -> f64 {
    crate::math::stats::mean(shares).unwrap_or(0.0)
}

/// Log odds that `better` is better than `worse`: a likelihood ratio of Student's t over looks. Pairs of one look share their
/// errors, and each pair has two looks, so that half of the looks count as independent. Negative where it is worse.
pub(super) fn nats(better: &[f64], worse: &[f64], pairs: &[Pair], looks: usize) -> f64 {
    let mut by_look: Vec<(f64, f64)> = vec![(0.0, 0.0); looks];
    for ((x, y), pair) in better.iter().zip(worse).zip(pairs) {
        for look in [pair.a, pair.b] {
            if let Some((sum, count)) = by_look.get_mut(look) {
                *sum += x - y;
                *count += 1.0;
            }
        }
    }
    let means: Vec<f64> = by_look.iter().filter(|(_, n)| *n > 0.0).map(|(sum, n)| sum / n).collect();
    student(&means, 0.5 * means.len() as f64)
}

/// Log likelihood ratio of a mean other than 0 against 0, with its sign, of differences that count as `independent` ones.
pub(super) fn student(differences: &[f64], independent: f64) -> f64 {
    /// Spread of a share that no sample makes smaller: a percent.
    const LEAST_STD: f64 = 0.01;
    let Some(mean) = crate::math::stats::mean(differences).filter(|_| independent > 0.0) else { return 0.0 };
    let variance =
        differences.iter().map(|d| (d - mean).powi(2)).sum::<f64>() / differences.len() as f64 + LEAST_STD * LEAST_STD;
    (0.5 * independent * (mean * mean / variance).ln_1p()).copysign(mean)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn evidence_grows_with_what_agrees_and_has_its_sign() {
        assert_eq!(student(&[], 3.0), 0.0);
        let weak = student(&[0.1, -0.1, 0.2, 0.0], 4.0);
        let strong = student(&[0.1, 0.11, 0.09, 0.1], 4.0);
        assert!(0.0 < weak && weak < 1.0 && strong > 5.0, "{weak} {strong}");
        assert!(student(&[-0.1, -0.11, -0.09, -0.1], 4.0) < -5.0);
    }
}
