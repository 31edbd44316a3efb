//! The integrated Ornstein-Uhlenbeck motion model, discretised exactly (§A.2).
//!
//! One coordinate has the state (position, velocity) with `dv = -lambda v dt + sqrt(psi) dW`. The three coordinates of a
//! hand share the model, so the paper's 6 x 6 matrices are `kron(I3, .)` of the 2 x 2 ones here.

use nalgebra::Matrix2;

/// Parameters of the process.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct IntegratedOu {
    /// Mean reversion of the velocity, 1/s.
    pub lambda: f64,
    /// Diffusion of the velocity, m^2/s^3. The stationary velocity variance is `psi / (2 lambda)`.
    pub psi: f64,
}

impl IntegratedOu {
    /// From the velocity's correlation time (s) and stationary standard deviation (m/s).
    #[must_use]
    pub fn from_time_and_speed(correlation_secs: f64, speed_std: f64) -> Self {
        let lambda = 1.0 / correlation_secs;
        Self { lambda, psi: 2.0 * speed_std * speed_std * lambda }
    }

    /// Stationary variance of the velocity, m^2/s^2.
    #[must_use]
    pub fn velocity_variance(&self) -> f64 {
        self.psi / (2.0 * self.lambda)
    }

    /// Transition `F(dt)` and process noise `Q(dt)` over `dt` seconds.
    #[must_use]
    pub fn discretise(&self, dt: f64) -> (Matrix2<f64>, Matrix2<f64>) {
        let Self { lambda, psi } = *self;
        let x = lambda * dt;
        // Below this the closed form cancels to nothing; the limit is a velocity random walk.
        if x.abs() < 1e-4 {
            let q11 = psi * dt.powi(3) / 3.0;
            let q12 = psi * dt * dt / 2.0;
            return (Matrix2::new(1.0, dt, 0.0, 1.0 - x), Matrix2::new(q11, q12, q12, psi * dt));
        }
        let e = (-x).exp();
        let one_minus_e = -(-x).exp_m1();
        let q11 = psi / lambda.powi(2) * (dt - 2.0 * one_minus_e / lambda - (-2.0 * x).exp_m1() / (2.0 * lambda));
        let q12 = psi / (2.0 * lambda.powi(2)) * one_minus_e.powi(2);
        let q22 = -psi / (2.0 * lambda) * (-2.0 * x).exp_m1();
        (Matrix2::new(1.0, one_minus_e / lambda, 0.0, e), Matrix2::new(q11, q12, q12, q22))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Reference values from a matrix exponential (van Loan) of the same process.
    #[test]
    fn matches_the_matrix_exponential() {
        let (f, q) = IntegratedOu { lambda: 0.1, psi: 2e-5 }.discretise(1.0);
        assert!((f[(0, 1)] - 0.951_625_820).abs() < 1e-8);
        assert!((f[(1, 1)] - 0.904_837_418).abs() < 1e-8);
        assert!((q[(0, 0)] - 6.189_190_66e-6).abs() < 1e-12, "{q}");
        assert!((q[(0, 1)] - 9.055_917_01e-6).abs() < 1e-12);
        assert!((q[(1, 1)] - 1.812_692_47e-5).abs() < 1e-12);
    }

    #[test]
    fn two_half_steps_equal_one_step() {
        let ou = IntegratedOu::from_time_and_speed(1.0 / 3.0, 0.3);
        let (f, q) = ou.discretise(0.2);
        let (fh, qh) = ou.discretise(0.1);
        assert!((fh * fh - f).norm() < 1e-12);
        assert!((fh * qh * fh.transpose() + qh - q).norm() < 1e-12);
    }

    #[test]
    fn the_limit_of_small_steps_is_continuous() {
        let ou = IntegratedOu { lambda: 3.0, psi: 0.5 };
        let below = ou.discretise(0.99e-4 / 3.0).1;
        let above = ou.discretise(1.01e-4 / 3.0).1;
        assert!((above[(1, 1)] / below[(1, 1)] - 1.01 / 0.99).abs() < 1e-3);
    }
}
