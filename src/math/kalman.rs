//! Kalman filter with a chi-square gate and Rauch-Tung-Striebel smoother for a hand under the integrated OU model (§A.2).
//!
//! With isotropic observation noise the three coordinates have one and the same 2 x 2 covariance: it is propagated once,
//! the three means ride along as rows.

use nalgebra::{Matrix2, Matrix3x2, RowVector2};

use super::ou::IntegratedOu;
use super::{Point, Vector};

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
    /// Velocity at each observation time, m/s.
    pub velocities: Vec<Vector>,
    /// Variance of each coordinate of each position, m^2.
    pub variances: Vec<f64>,
    /// Whether the observation passed the gate.
    pub accepted: Vec<bool>,
}

/// The prediction of one step: transition, mean, covariance, and whether the filter started (again) here.
type Predicted = (Matrix2<f64>, Matrix3x2<f64>, Matrix2<f64>, bool);

/// Filters forward and smooths backward. `times` (s) must not decrease; both slices have one length.
///
/// A start that the following samples contradict (a few samples, then a restart) was wrong: it is rejected and the filter
/// begins after it.
#[must_use]
pub fn smooth(times: &[f64], observations: &[Point], filter: &Filter) -> Smoothed {
    let n = observations.len().min(times.len());
    let mut first = 0;
    loop {
        let (smoothed, restart) = pass(&times[first..n], &observations[first..n], filter);
        match restart {
            Some(lead) if first + lead < n => first += lead,
            _ => {
                // Before the first believed sample: its state, backwards in time.
                let mut out = Smoothed {
                    positions: Vec::with_capacity(n),
                    velocities: Vec::with_capacity(n),
                    variances: Vec::with_capacity(n),
                    accepted: vec![false; first],
                };
                if let (Some(p), Some(v)) = (smoothed.positions.first(), smoothed.variances.first()) {
                    out.positions.resize(first, *p);
                    out.velocities.resize(first, Vector::zeros());
                    out.variances.resize(first, *v);
                }
                out.positions.extend(smoothed.positions);
                out.velocities.extend(smoothed.velocities);
                out.variances.extend(smoothed.variances);
                out.accepted.extend(smoothed.accepted);
                return out;
            }
        }
    }
}

/// One forward and backward pass; also how many samples a contradicted start has, if there is one.
fn pass(times: &[f64], observations: &[Point], filter: &Filter) -> (Smoothed, Option<usize>) {
    let n = observations.len().min(times.len());
    let r = filter.observation_std_m.powi(2);
    let prior = Matrix2::new(r, 0.0, 0.0, filter.motion.velocity_variance());
    let start = |p: &Point| Matrix3x2::new(p.x, 0.0, p.y, 0.0, p.z, 0.0);

    let mut means: Vec<Matrix3x2<f64>> = Vec::with_capacity(n);
    let mut covariances: Vec<Matrix2<f64>> = Vec::with_capacity(n);
    // Predictions of step t from t-1, kept for the backward pass; identity transition at t = 0 and at a restart.
    let mut predicted: Vec<Predicted> = Vec::with_capacity(n);
    let mut accepted = vec![false; n];
    let mut rejected_in_a_row = 0;
    let mut contradicted = None;

    for t in 0..n {
        let z = &observations[t];
        if t == 0 {
            means.push(start(z));
            covariances.push(prior);
            predicted.push((Matrix2::identity(), start(z), prior, true));
            accepted[0] = true;
            continue;
        }
        let (f, q) = filter.motion.discretise((times[t] - times[t - 1]).max(0.0));
        let mean = means[t - 1] * f.transpose();
        let covariance = f * covariances[t - 1] * f.transpose() + q;
        let s = covariance[(0, 0)] + r;
        let innovation = z.coords - mean.column(0);
        let mahalanobis = innovation.norm_squared() / s;
        let restart =
            filter.restart_after > 0 && rejected_in_a_row >= filter.restart_after && mahalanobis > filter.gate;
        if restart {
            // As many samples as it takes to restart are needed to be believed against them.
            let lead = accepted[..t].iter().filter(|a| **a).count();
            if lead <= filter.restart_after && contradicted.is_none() && predicted[1..].iter().all(|p| !p.3) {
                contradicted = Some(t - rejected_in_a_row);
            }
            means.push(start(z));
            covariances.push(prior);
            predicted.push((Matrix2::identity(), start(z), prior, true));
            accepted[t] = true;
            rejected_in_a_row = 0;
        } else if mahalanobis <= filter.gate {
            let gain = covariance.column(0) / s;
            means.push(mean + innovation * gain.transpose());
            covariances.push(covariance - gain * RowVector2::new(covariance[(0, 0)], covariance[(0, 1)]));
            predicted.push((f, mean, covariance, false));
            accepted[t] = true;
            rejected_in_a_row = 0;
        } else {
            means.push(mean);
            covariances.push(covariance);
            predicted.push((f, mean, covariance, false));
            rejected_in_a_row += 1;
        }
    }

    for t in (0..n.saturating_sub(1)).rev() {
        let (f, predicted_mean, predicted_covariance, restarted) = predicted[t + 1];
        // A restart cuts the chain: what follows says nothing about what came before.
        let Some(inverse) = predicted_covariance.try_inverse().filter(|_| !restarted) else { continue };
        let gain = covariances[t] * f.transpose() * inverse;
        let mean_step = means[t + 1] - predicted_mean;
        let covariance_step = covariances[t + 1] - predicted_covariance;
        means[t] += mean_step * gain.transpose();
        covariances[t] += gain * covariance_step * gain.transpose();
    }
    let smoothed = Smoothed {
        positions: means.iter().map(|m| Point::from(m.column(0).into_owned())).collect(),
        velocities: means.iter().map(|m| m.column(1).into_owned()).collect(),
        variances: covariances.iter().map(|c| c[(0, 0)]).collect(),
        accepted,
    };
    (smoothed, contradicted)
}

#[cfg(test)]
mod tests {
    use super::*;
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
            let (step, q) = f.motion.discretise(times[t] - times[t - 1]);
            let qi = q.try_inverse().unwrap();
            let mut j = nalgebra::DMatrix::<f64>::zeros(2, 2 * n);
            j.view_mut((0, 2 * t - 2), (2, 2)).copy_from(&(-step));
            j.view_mut((0, 2 * t), (2, 2)).copy_from(&Matrix2::identity());
            let q_dyn = nalgebra::DMatrix::from_fn(2, 2, |a, b| qi[(a, b)]);
            information += j.transpose() * q_dyn * j;
        }
        let solution = information.lu().solve(&vector).unwrap();
        for t in 0..n {
            assert!((solution[2 * t] - out.positions[t].x).abs() < 1e-9);
        }
    }

    #[test]
    fn empty_in_empty_out() {
        assert!(smooth(&[], &[], &filter()).positions.is_empty());
    }
}
