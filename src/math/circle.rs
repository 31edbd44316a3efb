//! Circles in a plane: algebraic fit (Taubin), then geometric refinement.

use nalgebra::{Matrix3, Point2, Vector2, Vector3};

/// A circle, metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Circle {
    /// Centre.
    pub center: Point2<f64>,
    /// Radius.
    pub radius: f64,
}

impl Circle {
    /// Root mean square of the radial residuals.
    #[must_use]
    pub fn rms(&self, points: &[Point2<f64>]) -> f64 {
        let sum: f64 = points.iter().map(|p| ((p - self.center).norm() - self.radius).powi(2)).sum();
        (sum / points.len().max(1) as f64).sqrt()
    }
}

/// Least-squares circle through three points or more; `None` where they lie on a line to working precision.
#[must_use]
pub fn fit(points: &[Point2<f64>]) -> Option<Circle> {
    let n = points.len() as f64;
    if points.len() < 3 {
        return None;
    }
    let mean = points.iter().fold(Vector2::zeros(), |s, p| s + p.coords) / n;
    // Algebraic start (Kasa in centred coordinates): |p|^2 = 2 c.p + k.
    let mut normal = Matrix3::zeros();
    let mut rhs = Vector3::zeros();
    for p in points {
        let d = p.coords - mean;
        let row = Vector3::new(2.0 * d.x, 2.0 * d.y, 1.0);
        normal += row * row.transpose();
        rhs += row * d.norm_squared();
    }
    let solution = normal.lu().solve(&rhs)?;
    let mut center = Vector2::new(solution[0], solution[1]);
    let mut radius = (solution[2] + center.norm_squared()).max(0.0).sqrt();
    if !radius.is_finite() || radius > 1e4 {
        return None;
    }
    // Gauss-Newton on the radial distance: the algebraic fit shrinks short noisy arcs.
    for _ in 0..50 {
        let mut h = Matrix3::zeros();
        let mut g = Vector3::zeros();
        for p in points {
            let d = p.coords - mean - center;
            let r = d.norm().max(1e-9);
            let j = Vector3::new(-d.x / r, -d.y / r, -1.0);
            h += j * j.transpose();
            g += j * (r - radius);
        }
        h += Matrix3::identity() * (1e-9 * n);
        let step = h.lu().solve(&g)?;
        center -= Vector2::new(step[0], step[1]);
        radius -= step[2];
        if step.norm() < 1e-10 {
            break;
        }
        if !center.norm().is_finite() || center.norm() > 1e3 {
            return None;
        }
    }
    (radius > 0.0).then(|| Circle { center: Point2::from(center + mean), radius })
}

/// How far the common centre of several arcs may lie from where it is expected.
#[derive(Debug, Clone, Copy)]
pub struct CenterPrior {
    /// Expected centre.
    pub center: Point2<f64>,
    /// Its standard deviation, metres.
    pub std_m: f64,
    /// Standard deviation of the points about their circles, metres.
    pub point_std_m: f64,
    /// Independent samples that one arc is worth (errors of neighbouring points are correlated).
    pub effective_samples: f64,
}

/// Most probable common centre of arcs that may each have a radius of their own: Gauss-Newton on heavy-tailed radial
/// residuals (Student, 4 degrees of freedom) and the prior.
#[must_use]
pub fn common_center(arcs: &[Vec<Point2<f64>>], prior: &CenterPrior) -> Point2<f64> {
    const FREEDOM: f64 = 4.0;
    let mut center = prior.center;
    for _ in 0..15 {
        let precision = prior.std_m.powi(-2);
        let mut h = nalgebra::Matrix2::identity() * precision;
        let mut g = (center - prior.center) * precision;
        for arc in arcs.iter().filter(|a| !a.is_empty()) {
            let n = arc.len() as f64;
            let rays: Vec<Vector2<f64>> = arc.iter().map(|p| p - center).collect();
            let distances: Vec<f64> = rays.iter().map(|r| r.norm().max(1e-6)).collect();
            let radius = crate::math::stats::median(&distances).unwrap_or(0.0);
            let mean_ray = rays.iter().zip(&distances).fold(Vector2::zeros(), |s, (r, d)| s + r / *d) / n;
            let each = prior.effective_samples.min(n) / n / prior.point_std_m.powi(2);
            for (ray, d) in rays.iter().zip(&distances) {
                let e = d - radius;
                let weight = each * (FREEDOM + 1.0) / (FREEDOM + (e / prior.point_std_m).powi(2));
                let j = mean_ray - ray / *d;
                h += j * j.transpose() * weight;
                g += j * (e * weight);
            }
        }
        let Some(step) = h.try_inverse().map(|inverse| inverse * g) else { break };
        center -= step;
        if step.norm() < 1e-6 {
            break;
        }
    }
    center
}

#[cfg(test)]
mod tests {
    use super::*;

    fn arc(radius: f64, degrees: f64) -> Vec<Point2<f64>> {
        (0..40)
            .map(|i| {
                let a = f64::from(i) / 39.0 * degrees.to_radians();
                Point2::new(1.0 + radius * a.cos(), -2.0 + radius * a.sin())
            })
            .collect()
    }

    #[test]
    fn recovers_a_short_arc() {
        let c = fit(&arc(0.5, 20.0)).unwrap();
        assert!((c.radius - 0.5).abs() < 1e-6 && (c.center - Point2::new(1.0, -2.0)).norm() < 1e-6);
        assert!(c.rms(&arc(0.5, 20.0)) < 1e-8);
    }

    #[test]
    fn a_straight_line_has_no_circle_of_furniture_size() {
        let line: Vec<_> = (0..20).map(|i| Point2::new(f64::from(i) * 0.01, 0.0)).collect();
        assert!(fit(&line).is_none_or(|c| c.radius > 100.0));
    }

    #[test]
    fn a_wide_arc_corrects_the_expected_centre_and_a_short_one_leaves_it() {
        let prior =
            CenterPrior { center: Point2::new(1.07, -2.0), std_m: 0.06, point_std_m: 0.02, effective_samples: 8.0 };
        let off = |degrees: f64| {
            (common_center(&[arc(0.5, degrees), arc(0.45, degrees)], &prior) - Point2::new(1.0, -2.0)).norm()
        };
        assert!(off(90.0) < 0.02, "{}", off(90.0));
        assert!(off(5.0) > 0.06, "{}", off(5.0));
        assert!((common_center(&[], &prior) - prior.center).norm() < 1e-12);
    }
}
