//! A discrete Dynamic Movement Primitive (Ijspeert et al. 2013): a spring to the goal, and a learned push that dies out.
//!
//! With `tau` the duration, `y` a coordinate, `g` its goal, `y0` its start and `x` the phase:
//!
//! ```text
//! tau x' = -phase_decay x                    x(0) = 1
//! tau y' = z
//! tau z' = alpha (beta (g - y) - z) + push   beta = alpha / 4: critically damped
//! f(x)   = x sum_i w_i psi_i(x) / sum_i psi_i(x),   psi_i(x) = exp(-h_i (x - c_i)^2)
//! scaled:   push = f(x) (g - y0)
//! unscaled: push = alpha beta (f(x) - (g - y0) x)
//! ```
//!
//! The scaled push is the original one. It learns nothing of a coordinate that comes back to where it began, and a goal
//! that is a little off throws such a coordinate far. The unscaled one (Hoffmann et al. 2009) has neither fault: the whole
//! motion is bent to the new goal, its shape stays.

use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};

/// Format: how stiff the spring is, for a duration of 1: what is left at the end of a motion that is pushed no more is gone after
/// another third of it.
const ALPHA: f64 = 25.0;
/// Format: the phase ends at a hundredth: the push is nearly gone, and the last basis functions are still apart.
const PHASE_DECAY: f64 = 4.605_170_185_988_092;
/// Format: basis functions; a minimum jerk of any skew is met to 2 in 1000 of its way.
const BASES: usize = 20;
/// Numerics: share of the mean square of a basis function that keeps weights small where nothing tells them.
const RIDGE: f64 = 1e-9;
/// Numerics: a coordinate whose start and goal are nearer than this has no way to scale by, rad or m.
const STILL: f64 = 1e-6;
/// Numerics: a rollout has at most this many steps.
const MOST_STEPS: usize = 1_000_000;

/// What all primitives of a file share.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct System {
    /// Stiffness of the spring.
    pub alpha: f64,
    /// A quarter of `alpha`.
    pub beta: f64,
    /// How fast the phase decays: `x = exp(-phase_decay t / tau)`.
    pub phase_decay: f64,
    /// `c_i`: phases at which the basis functions are largest.
    pub centers: Vec<f64>,
    /// `h_i`.
    pub widths: Vec<f64>,
}

impl Default for System {
    fn default() -> Self {
        let last = (BASES - 1) as f64;
        // Evenly in time.
        let centers: Vec<f64> = (0..BASES).map(|i| (-PHASE_DECAY * i as f64 / last).exp()).collect();
        let mut widths: Vec<f64> = centers.windows(2).map(|pair| (pair[0] - pair[1]).powi(-2)).collect();
        let narrowest = widths.last().copied();
        widths.extend(narrowest);
        Self { alpha: ALPHA, beta: 0.25 * ALPHA, phase_decay: PHASE_DECAY, centers, widths }
    }
}

impl System {
    /// The phase after a share of the duration.
    #[must_use]
    pub fn phase(&self, share: f64) -> f64 {
        (-self.phase_decay * share).exp()
    }

    /// What each weight is multiplied by at a phase.
    fn features(&self, x: f64) -> Vec<f64> {
        let psi: Vec<f64> = self.centers.iter().zip(&self.widths).map(|(c, h)| (-h * (x - c).powi(2)).exp()).collect();
        let sum = psi.iter().sum::<f64>().max(f64::MIN_POSITIVE);
        psi.iter().map(|p| p * x / sum).collect()
    }
}

/// How the push knows about start and goal.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Forcing {
    /// Times the way from start to goal.
    Scaled,
    /// As it was learned.
    Unscaled,
}

/// One primitive of one or more coordinates.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Dmp {
    /// How the push knows about start and goal.
    pub forcing: Forcing,
    /// `tau`, seconds.
    pub duration_secs: f64,
    /// `y0` of each coordinate.
    pub start: Vec<f64>,
    /// `g` of each coordinate.
    pub goal: Vec<f64>,
    /// `w_i` of each coordinate.
    pub weights: Vec<Vec<f64>>,
}

/// Fits a primitive to samples at equal steps of time, at rest at both ends; the last one is the goal. A push that cannot be
/// scaled, as a coordinate ends where it began, is left unscaled. `None` for fewer samples than basis functions, for a
/// duration that is none, and where numbers are not finite.
#[must_use]
pub fn fit<const D: usize>(samples: &[[f64; D]], duration_secs: f64, wanted: Forcing, system: &System) -> Option<Dmp> {
    let (start, goal) = (*samples.first()?, *samples.last()?);
    let (count, bases) = (samples.len(), system.centers.len());
    let finite = duration_secs.is_finite() && samples.iter().flatten().all(|v| v.is_finite());
    if count < bases.max(3) || duration_secs <= 0.0 || !finite {
        return None;
    }
    let still = start.iter().zip(&goal).any(|(y0, g)| (g - y0).abs() < STILL);
    let forcing = if still { Forcing::Unscaled } else { wanted };
    // In shares of the duration: tau is 1.
    let step = 1.0 / (count - 1) as f64;
    let velocity = slopes(samples, step);
    let acceleration = slopes(&velocity, step);
    let phases: Vec<f64> = (0..count).map(|i| system.phase(i as f64 * step)).collect();
    let rows: Vec<f64> = phases.iter().flat_map(|x| system.features(*x)).collect();
    let features = DMatrix::from_row_slice(count, bases, &rows);
    let mut normal = features.tr_mul(&features);
    let ridge = RIDGE * normal.trace() / bases as f64;
    for i in 0..bases {
        normal[(i, i)] += ridge;
    }
    let solver = normal.cholesky()?;
    let weights = (0..D)
        .map(|k| {
            let way = goal[k] - start[k];
            let targets = DVector::from_fn(count, |i, _| {
                let spring = system.alpha * (system.beta * (goal[k] - samples[i][k]) - velocity[i][k]);
                let push = acceleration[i][k] - spring;
                match forcing {
                    Forcing::Scaled => push / way,
                    Forcing::Unscaled => push / (system.alpha * system.beta) + way * phases[i],
                }
            });
            solver.solve(&features.tr_mul(&targets)).iter().copied().collect()
        })
        .collect();
    Some(Dmp { forcing, duration_secs, start: start.to_vec(), goal: goal.to_vec(), weights })
}

/// Derivatives of three or more samples at equal steps, of second order at the ends too.
fn slopes<const D: usize>(values: &[[f64; D]], step: f64) -> Vec<[f64; D]> {
    let last = values.len() - 1;
    (0..=last)
        .map(|i| {
            std::array::from_fn(|k| {
                let at = |j: usize| values[j][k];
                let twice = if i == 0 {
                    -3.0 * at(0) + 4.0 * at(1) - at(2)
                } else if i == last {
                    3.0 * at(last) - 4.0 * at(last - 1) + at(last - 2)
                } else {
                    at(i + 1) - at(i - 1)
                };
                twice / (2.0 * step)
            })
        })
        .collect()
}

impl Dmp {
    /// The motion to a goal within a duration (seconds), from its own start, every `step_secs` until `until_secs`, which may
    /// be after its end. Good to a thousandth of its way for steps of a thousandth of the duration. A coordinate without a
    /// goal stays.
    #[must_use]
    pub fn rollout(
        &self,
        system: &System,
        goal: &[f64],
        duration_secs: f64,
        step_secs: f64,
        until_secs: f64,
    ) -> Vec<Vec<f64>> {
        let mut places = self.start.clone();
        let mut speeds = vec![0.0; places.len()];
        let mut all = vec![places.clone()];
        let step = step_secs / duration_secs;
        let stiffness = system.alpha * system.beta;
        // The cast of what is no number of steps gives 0.
        for i in 0..((until_secs / step_secs).round() as usize).min(MOST_STEPS) {
            let x = system.phase(i as f64 * step);
            let features = system.features(x);
            for (k, (y, z)) in places.iter_mut().zip(&mut speeds).enumerate() {
                let (Some(g), Some(y0), Some(weights)) = (goal.get(k), self.start.get(k), self.weights.get(k)) else {
                    continue;
                };
                let f: f64 = weights.iter().zip(&features).map(|(w, feature)| w * feature).sum();
                let push = match self.forcing {
                    Forcing::Scaled => f * (g - y0),
                    Forcing::Unscaled => stiffness * (f - (g - y0) * x),
                };
                *z += step * (system.alpha * (system.beta * (g - *y) - *z) + push);
                *y += step * *z;
            }
            all.push(places.clone());
        }
        all
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::primitives::timing::progress;

    const COUNT: usize = 201;

    fn shares() -> impl Iterator<Item = f64> {
        (0..COUNT).map(|i| i as f64 / (COUNT - 1) as f64)
    }

    fn worst(rolled: &[Vec<f64>], wanted: impl Fn(f64) -> f64) -> f64 {
        let last = (rolled.len() - 1) as f64;
        rolled.iter().enumerate().map(|(i, y)| (y[0] - wanted(i as f64 / last)).abs()).fold(0.0, f64::max)
    }

    #[test]
    fn a_minimum_jerk_of_any_skew_is_met_to_a_hundredth_of_its_range() {
        let system = System::default();
        for skew in [0.7, 1.0, 1.5] {
            for forcing in [Forcing::Scaled, Forcing::Unscaled] {
                let motion = |share: f64| 0.2 + 1.9 * progress(share, skew);
                let samples: Vec<[f64; 1]> = shares().map(|s| [motion(s)]).collect();
                let dmp = fit(&samples, 2.0, forcing, &system).unwrap();
                assert_eq!((dmp.forcing, dmp.weights.len(), dmp.weights[0].len()), (forcing, 1, BASES));
                let off = worst(&dmp.rollout(&system, &dmp.goal, 2.0, 0.002, 2.0), motion);
                assert!(off < 0.01 * 1.9, "{skew} {forcing:?}: {off}");
            }
        }
    }

    #[test]
    fn another_goal_and_duration_keep_the_shape() {
        let system = System::default();
        let samples: Vec<[f64; 1]> = shares().map(|s| [0.4 * progress(s, 1.2)]).collect();
        let dmp = fit(&samples, 1.5, Forcing::Scaled, &system).unwrap();
        for (goal, secs) in [(0.8, 6.0), (0.1, 0.5), (-0.4, 1.5)] {
            let rolled = dmp.rollout(&system, &[goal], secs, 0.001 * secs, secs);
            assert_eq!(rolled.len(), 1001);
            let off = worst(&rolled, |share| goal * progress(share, 1.2));
            assert!(off < 0.01 * goal.abs(), "{goal} {secs}: {off}");
        }
    }

    #[test]
    fn it_comes_to_rest_at_its_goal() {
        let system = System::default();
        let samples: Vec<[f64; 1]> = shares().map(|s| [1.9 * progress(s, 1.0)]).collect();
        for forcing in [Forcing::Scaled, Forcing::Unscaled] {
            let dmp = fit(&samples, 1.0, forcing, &system).unwrap();
            let rolled = dmp.rollout(&system, &[1.2], 1.0, 0.001, 3.0);
            let [before, end] = [&rolled[rolled.len() - 2], &rolled[rolled.len() - 1]];
            assert!((end[0] - 1.2).abs() < 1e-4 && (end[0] - before[0]).abs() < 1e-6, "{forcing:?}: {end:?}");
        }
    }

    #[test]
    fn a_coordinate_that_comes_back_is_learned_unscaled() {
        let system = System::default();
        let there_and_back = |share: f64| (std::f64::consts::TAU * progress(share, 1.0)).cos() - 1.0;
        let samples: Vec<[f64; 2]> = shares().map(|s| [there_and_back(s), progress(s, 1.0)]).collect();
        let dmp = fit(&samples, 1.0, Forcing::Scaled, &system).unwrap();
        assert_eq!(dmp.forcing, Forcing::Unscaled);
        let off = worst(&dmp.rollout(&system, &dmp.goal, 1.0, 0.001, 1.0), there_and_back);
        assert!(off < 0.02, "{off}");
        // A goal that is a centimetre off bends the motion by a centimetre.
        let bent = dmp.rollout(&system, &[dmp.goal[0] + 0.01, dmp.goal[1]], 1.0, 0.001, 1.0);
        assert!(worst(&bent, there_and_back) < 0.03);
    }

    #[test]
    fn what_is_no_motion_has_no_primitive() {
        let system = System::default();
        let samples = [[0.0]; COUNT];
        assert!(fit(&samples[..5], 1.0, Forcing::Scaled, &system).is_none());
        assert!(fit(&samples, 0.0, Forcing::Scaled, &system).is_none());
        assert!(fit(&[[f64::NAN]; COUNT], 1.0, Forcing::Scaled, &system).is_none());
        assert!(fit::<1>(&[], 1.0, Forcing::Scaled, &system).is_none());
    }
}
