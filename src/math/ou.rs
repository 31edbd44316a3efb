//! The integrated Ornstein-Uhlenbeck motion model, discretised exactly (§A.2).
//!
//! One coordinate has the state (position, velocity) with `dv = -lambda v dt + sqrt(psi) dW`. The three coordinates of a
//! hand share the model, so the paper's 6 x 6 matrices are `kron(I3, .)` of the 2 x 2 ones here.

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

    /// One step of `dt` seconds.
    #[must_use]
    pub fn discretise(&self, dt: f64) -> Transition {
        let Self { lambda, psi } = *self;
        let x = lambda * dt;
        // Below this the closed form cancels to nothing; the limit is a velocity random walk.
        if x.abs() < 1e-4 {
            return Transition {
                f: dt,
                e: 1.0 - x,
                q11: psi * dt.powi(3) / 3.0,
                q12: psi * dt * dt / 2.0,
                q22: psi * dt,
            };
        }
        // `1 - exp(-x)` as it is, so that short steps keep their digits; `1 - exp(-2x)` follows from it.
        let gone = -(-x).exp_m1();
        let gone_twice = gone * (2.0 - gone);
        let time = 1.0 / lambda;
        let half = 0.5 * psi * time;
        Transition {
            f: gone * time,
            e: 1.0 - gone,
            q11: half * time * time * (2.0 * (x - 2.0 * gone) + gone_twice),
            q12: half * time * gone * gone,
            q22: half * gone_twice,
        }
    }
}

/// A step of the process for one coordinate: (position, velocity) is multiplied by `F = [[1, f], [0, e]]` and gains the noise
/// `Q = [[q11, q12], [q12, q22]]`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Transition {
    /// Seconds for which the velocity counts.
    pub f: f64,
    /// Share of the velocity that is left.
    pub e: f64,
    /// Variance that the position gains, m^2.
    pub q11: f64,
    /// Covariance that both gain, m^2/s.
    pub q12: f64,
    /// Variance that the velocity gains, m^2/s^2.
    pub q22: f64,
}

#[cfg(test)]
impl Transition {
    /// `F` and `Q`.
    pub(super) fn matrices(&self) -> (nalgebra::Matrix2<f64>, nalgebra::Matrix2<f64>) {
        let Self { f, e, q11, q12, q22 } = *self;
        (nalgebra::Matrix2::new(1.0, f, 0.0, e), nalgebra::Matrix2::new(q11, q12, q12, q22))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Reference values from a matrix exponential (van Loan) of the same process.
    #[test]
    fn matches_the_matrix_exponential() {
        let (f, q) = IntegratedOu { lambda: 0.1, psi: 2e-5 }.discretise(1.0).matrices();
        assert!((f[(0, 1)] - 0.951_625_820).abs() < 1e-8);
        assert!((f[(1, 1)] - 0.904_837_418).abs() < 1e-8);
        assert!((q[(0, 0)] - 6.189_190_66e-6).abs() < 1e-12, "{q}");
        assert!((q[(0, 1)] - 9.055_917_01e-6).abs() < 1e-12);
        assert!((q[(1, 1)] - 1.812_692_47e-5).abs() < 1e-12);
    }

    #[test]
    fn two_half_steps_equal_one_step() {
        let ou = IntegratedOu::from_time_and_speed(1.0 / 3.0, 0.3);
        let (f, q) = ou.discretise(0.2).matrices();
        let (fh, qh) = ou.discretise(0.1).matrices();
        assert!((fh * fh - f).norm() < 1e-12);
        assert!((fh * qh * fh.transpose() + qh - q).norm() < 1e-12);
    }

    #[test]
    fn the_limit_of_small_steps_is_continuous() {
        let ou = IntegratedOu { lambda: 3.0, psi: 0.5 };
        let below = ou.discretise(0.99e-4 / 3.0);
        let above = ou.discretise(1.01e-4 / 3.0);
        assert!((above.q22 / below.q22 - 1.01 / 0.99).abs() < 1e-3);
        assert!((above.f / below.f - 1.01 / 0.99).abs() < 1e-3);
    }
}
