//! Kalman filter with a chi-square gate and Rauch-Tung-Striebel smoother for a hand under the integrated OU model (§A.2).
//!
//! With isotropic observation noise the three coordinates have one and the same 2 x 2 covariance: it is propagated once,
//! the three means ride along, side by side. Everything is symmetric and small, so the matrices are written out.

use wide::f64x4;

use super::Point;
use super::ou::{IntegratedOu, Transition};

/// How to filter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Filter {
    /// The motion model.
    pub motion: IntegratedOu,
    /// Standard deviation of an observed coordinate, metres.
    pub observation_std_m: f64,
    /// An observation with a larger squared Mahalanobis distance (3 degrees of freedom) is rejected.
    pub gate: f64,
    /// After this many rejections in a row the filter believes the observations and starts again from the next one
    /// (the paper has no such rule: one wrong first sample would otherwise cost the clip). 0 = never.
    pub restart_after: usize,
}

/// The smoothed trajectory.
#[derive(Debug, Clone, PartialEq)]
pub struct Smoothed {
    /// Position at each observation time.
    pub positions: Vec<Point>,
    /// Whether the observation passed the gate.
    pub accepted: Vec<bool>,
}

/// A symmetric 2 x 2 matrix: `[[p, c], [c, v]]`.
#[derive(Debug, Clone, Copy)]
struct Symmetric {
    p: f64,
    c: f64,
    v: f64,
}

/// The hand at one observation: the three coordinates side by side, and the covariance that each of them had at the time.
#[derive(Debug, Clone, Copy)]
struct Step {
    /// Metres.
    position: f64x4,
    /// Metres a second.
    velocity: f64x4,
    covariance: Symmetric,
    /// The covariance before the observation was seen.
    predicted: Symmetric,
    /// Transition from the step before, `[[1, f], [0, e]]`. Where the filter starts (again) nothing of it is left.
    kept: f64,
    f: f64,
    e: f64,
}

/// Filters forward and smooths backward. `times` (s) must not decrease; both slices have one length.
///
/// A start that the following samples contradict (a few samples, then a restart) was wrong: it is rejected and the filter
/// begins after it.
#[must_use]
pub fn smooth(times: &[f64], observations: &[Point], filter: &Filter) -> Smoothed {
    let n = observations.len().min(times.len());
    let mut accepted = vec![false; n];
    let mut steps = Vec::with_capacity(n);
    let mut first = 0;
    while let Some(lead) =
        forward(&times[first..n], &observations[first..n], filter, &mut steps, &mut accepted[first..])
    {
        accepted[first..first + lead].fill(false);
        first += lead;
    }
    backward(&mut steps);
    // Before the first believed sample: its position.
    let steps = steps.first().into_iter().cycle().take(first).chain(&steps);
    let point = |step: &Step| {
        let [x, y, z, _] = step.position.to_array();
        Point::new(x, y, z)
    };
    Smoothed { positions: steps.map(point).collect(), accepted }
}

/// What the motion model expects of a step before its observation is seen.
struct Expected {
    position: f64x4,
    velocity: f64x4,
    covariance: Symmetric,
    f: f64,
    e: f64,
}

impl Expected {
    /// After a step, by the transition to the next one.
    fn after(step: &Step, transition: Transition) -> Self {
        let Step { position, velocity, covariance: before, .. } = *step;
        let Transition { f, e, q11, q12, q22 } = transition;
        let moved = before.c + f * before.v;
        let covariance =
            Symmetric { p: before.p + f * (before.c + moved) + q11, c: e * moved + q12, v: e * e * before.v + q22 };
        Self { position: position + velocity * f, velocity: velocity * e, covariance, f, e }
    }

    /// The step itself: `innovation` is the observation less the expected position, `r` its variance, m^2. An observation that
    /// is not believed changes nothing.
    fn step(&self, innovation: f64x4, r: f64, believed: bool) -> Step {
        let predicted = self.covariance;
        let s = predicted.p + r;
        // Weight of the innovation a variance, and what is left of the variance.
        let (share, left, innovation) = if believed { (1.0 / s, r / s, innovation) } else { (0.0, 1.0, f64x4::ZERO) };
        Step {
            position: self.position + innovation * (predicted.p * share),
            velocity: self.velocity + innovation * (predicted.c * share),
            covariance: Symmetric {
                p: predicted.p * left,
                c: predicted.c * left,
                v: predicted.v - predicted.c * predicted.c * share,
            },
            predicted,
            kept: 1.0,
            f: self.f,
            e: self.e,
        }
    }
}

/// Filters forward, into `steps` and `accepted`; of a start that is contradicted, how many samples it has.
fn forward(
    times: &[f64],
    observations: &[Point],
    filter: &Filter,
    steps: &mut Vec<Step>,
    accepted: &mut [bool],
) -> Option<usize> {
    let r = filter.observation_std_m.powi(2);
    let prior = Symmetric { p: r, c: 0.0, v: filter.motion.velocity_variance() };
    let start = |position: f64x4| Step {
        position,
        velocity: f64x4::ZERO,
        covariance: prior,
        predicted: prior,
        kept: 0.0,
        f: 0.0,
        e: 0.0,
    };
    let mut rejected_in_a_row = 0;
    let mut restarted = false;
    steps.clear();
    for (t, z) in observations.iter().enumerate() {
        let z = f64x4::from([z.x, z.y, z.z, 0.0]);
        let Some(last) = steps.last() else {
            steps.push(start(z));
            accepted[t] = true;
            continue;
        };
        let expected = Expected::after(last, filter.motion.discretise((times[t] - times[t - 1]).max(0.0)));
        let innovation = z - expected.position;
        let s = expected.covariance.p + r;
        let (off, gate) = ((innovation * innovation).reduce_add(), filter.gate * s);
        if off > gate && filter.restart_after > 0 && rejected_in_a_row >= filter.restart_after {
            // As many samples as it takes to restart are needed to be believed against them.
            let lead = accepted[..t].iter().filter(|a| **a).count();
            if lead <= filter.restart_after && !restarted {
                return Some(t - rejected_in_a_row);
            }
            restarted = true;
            rejected_in_a_row = 0;
            accepted[t] = true;
            steps.push(start(z));
            continue;
        }
        let believed = off <= gate;
        accepted[t] = believed;
        rejected_in_a_row = if believed { 0 } else { rejected_in_a_row + 1 };
        steps.push(expected.step(innovation, r, believed));
    }
    None
}

/// Turns the means of `steps` from what was known at the time into what is known of all observations. A restart cuts the
/// chain: what follows says nothing about what came before.
fn backward(steps: &mut [Step]) {
    for t in (1..steps.len()).rev() {
        let Step { position, velocity, predicted: Symmetric { p, c, v }, kept, f, e, .. } = steps[t];
        let now = &mut steps[t - 1];
        let old = now.covariance;
        // Covariance of this step with the next one, times the inverse of the next one's.
        let (pp, pv) = (kept * old.p + f * old.c, e * old.c);
        let (vp, vv) = (kept * old.c + f * old.v, e * old.v);
        let determinant = p * v - c * c;
        let share = if determinant > 0.0 { 1.0 / determinant } else { 0.0 };
        let position = (position - (now.position + now.velocity * f)) * share;
        let velocity = (velocity - now.velocity * e) * share;
        now.position += position * (pp * v - pv * c) + velocity * (pv * p - pp * c);
        now.velocity += position * (vp * v - vv * c) + velocity * (vv * p - vp * c);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Vector;
    use rand::SeedableRng;
    use rand_distr::{Distribution, Normal};

    fn filter() -> Filter {
        Filter {
            motion: IntegratedOu::from_time_and_speed(1.0 / 3.0, 0.3),
            observation_std_m: 0.02,
            gate: 11.345,
            restart_after: 3,
        }
    }

    /// A drawer pulled 30 cm in 1.5 s with minimum jerk, seen at 20 Hz.
    fn pull() -> (Vec<f64>, Vec<Point>) {
        (0..31)
            .map(|i| {
                let t = f64::from(i) * 0.05;
                let s = t / 1.5;
                let x = 0.3 * (10.0 * s.powi(3) - 15.0 * s.powi(4) + 6.0 * s.powi(5));
                (t, Point::new(x, 0.0, 1.0))
            })
            .unzip()
    }

    #[test]
    fn noise_falls_and_a_jump_is_rejected() {
        let (times, truth) = pull();
        let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(3);
        let noise = Normal::new(0.0, 0.02).unwrap();
        let mut seen: Vec<Point> = truth.iter().map(|p| p + Vector::from_fn(|_, _| noise.sample(&mut rng))).collect();
        seen[15] += Vector::new(0.0, 0.0, 0.4);
        let out = smooth(&times, &seen, &filter());
        assert!(!out.accepted[15]);
        assert_eq!(out.accepted.iter().filter(|a| !**a).count(), 1);
        let rms = |points: &[Point]| {
            let sum: f64 = points
                .iter()
                .zip(&truth)
                .enumerate()
                .filter(|(i, _)| *i != 15)
                .map(|(_, (a, b))| (a - b).norm_squared())
                .sum();
            (sum / 30.0).sqrt()
        };
        assert!(rms(&out.positions) < 0.7 * rms(&seen), "{} {}", rms(&out.positions), rms(&seen));
        assert!((out.positions[15] - truth[15]).norm() < 0.03);
    }

    #[test]
    fn a_wrong_first_sample_does_not_cost_the_clip() {
        let (times, truth) = pull();
        let mut seen = truth.clone();
        seen[0] += Vector::new(1.0, 0.0, 0.0);
        let out = smooth(&times, &seen, &filter());
        let worst = out.positions.iter().zip(&truth).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max);
        assert!(worst < 0.02, "{worst}");
        assert!(!out.accepted[0] && out.accepted[1..].iter().all(|a| *a), "{:?}", out.accepted);
    }

    /// The smoother is the exact posterior mean: it must equal the minimiser of the joint quadratic cost.
    #[test]
    fn equals_the_batch_least_squares_solution() {
        let (times, truth) = pull();
        let times = &times[..6];
        let f = Filter { gate: f64::INFINITY, ..filter() };
        let out = smooth(times, &truth[..6], &f);
        let n = 6;
        let mut information = nalgebra::DMatrix::<f64>::zeros(2 * n, 2 * n);
        let mut vector = nalgebra::DVector::<f64>::zeros(2 * n);
        let r = f.observation_std_m.powi(2);
        // The first sample both starts the state and is not observed twice.
        information[(0, 0)] += 1.0 / r;
        information[(1, 1)] += 1.0 / f.motion.velocity_variance();
        vector[0] += truth[0].x / r;
        for t in 1..n {
            information[(2 * t, 2 * t)] += 1.0 / r;
            vector[2 * t] += truth[t].x / r;
            let (step, q) = f.motion.discretise(times[t] - times[t - 1]).matrices();
            let qi = q.try_inverse().unwrap();
            let mut j = nalgebra::DMatrix::<f64>::zeros(2, 2 * n);
            j.view_mut((0, 2 * t - 2), (2, 2)).copy_from(&(-step));
            j.view_mut((0, 2 * t), (2, 2)).copy_from(&nalgebra::Matrix2::identity());
            let q_dyn = nalgebra::DMatrix::from_fn(2, 2, |a, b| qi[(a, b)]);
            information += j.transpose() * q_dyn * j;
        }
        let solution = information.lu().solve(&vector).unwrap();
        for t in 0..n {
            assert!((solution[2 * t] - out.positions[t].x).abs() < 1e-9);
        }
    }

    #[test]
    fn a_restart_cuts_the_chain() {
        let (times, truth) = pull();
        let away = Vector::new(0.0, 1.0, 0.0);
        let seen: Vec<Point> = truth.iter().enumerate().map(|(i, p)| if i < 12 { *p } else { p + away }).collect();
        let out = smooth(&times, &seen, &filter());
        assert_eq!(out.accepted, (0..31).map(|i| !(12..15).contains(&i)).collect::<Vec<_>>());
        let alone = |r: std::ops::Range<usize>| smooth(&times[r.clone()], &seen[r], &filter()).positions;
        // What was rejected follows what it was rejected by.
        assert_eq!(out.positions[15..], alone(15..31));
        assert!(out.positions[..15].iter().all(|p| p.y.abs() < 1e-9), "{:?}", out.positions);
    }

    #[test]
    fn what_is_rejected_leaves_nothing_and_equal_times_are_no_step() {
        let (times, mut seen) = pull();
        seen[15].z = f64::NAN;
        let out = smooth(&times, &seen, &filter());
        assert!(!out.accepted[15] && out.positions.iter().all(|p| p.coords.iter().all(|x| x.is_finite())));
        let twice = smooth(&[0.0, 0.0], &[seen[0], seen[1]], &filter()).positions;
        assert!(
            (twice[0] - twice[1]).norm() < 1e-12 && (twice[0] - nalgebra::center(&seen[0], &seen[1])).norm() < 1e-12
        );
        assert_eq!(smooth(&[0.0], &seen[..1], &filter()).positions, seen[..1]);
    }

    #[test]
    fn empty_in_empty_out() {
        assert!(smooth(&[], &[], &filter()).positions.is_empty());
    }
}
