//! How well a motion of one degree of freedom explains a path: distances to a line, and to a direction (§A.7).

use super::line::Line;
use super::{Point, Vector, centroid, reject, stats};

/// A path about a line.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AboutLine {
    /// Mean distance from the line, `r_l` (m).
    pub radius: f64,
    /// Variance of that distance: the paper's criterion (m^2).
    pub radial_variance: f64,
    /// Variance along the line, which a rotation leaves at zero too (m^2).
    pub axial_variance: f64,
    /// Share of points within `tolerance` of the mean circle (the torus test of §B.1).
    pub inliers: f64,
}

impl AboutLine {
    /// Mean squared distance from the best circle about the line, m^2.
    #[must_use]
    pub fn variance(&self) -> f64 {
        self.radial_variance + self.axial_variance
    }
}

/// Measures a path about a line. `tolerance(radius)` is the torus' half-thickness. `None` for an empty path.
#[must_use]
pub fn about_line(path: &[Point], line: &Line, tolerance: impl Fn(f64) -> f64) -> Option<AboutLine> {
    let d: Vec<f64> = path.iter().map(|p| line.distance(p)).collect();
    let h: Vec<f64> = path.iter().map(|p| line.coordinate(p)).collect();
    let (radius, height) = (stats::median(&d)?, stats::median(&h)?);
    let tolerance = tolerance(radius);
    let inside = d.iter().zip(&h).filter(|(d, h)| (**d - radius).hypot(**h - height) <= tolerance).count();
    Some(AboutLine {
        radius: stats::mean(&d)?,
        radial_variance: stats::variance(&d)?,
        axial_variance: stats::variance(&h)?,
        inliers: inside as f64 / path.len() as f64,
    })
}

/// A path along a direction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AlongDirection {
    /// Mean squared distance from the best line of that direction, m^2.
    pub variance: f64,
    /// Share of points within the tolerance of that line.
    pub inliers: f64,
}

/// Measures a path along a unit direction. `None` for an empty path.
#[must_use]
pub fn along(path: &[Point], direction: &Vector, tolerance: f64) -> Option<AlongDirection> {
    let mean = centroid(path)?;
    let distances: Vec<f64> = path.iter().map(|p| reject(&(p - mean), direction).norm()).collect();
    let variance = distances.iter().map(|d| d * d).sum::<f64>() / path.len() as f64;
    let inside = distances.iter().filter(|d| **d <= tolerance).count();
    Some(AlongDirection { variance, inliers: inside as f64 / path.len() as f64 })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_arc_has_no_variance_about_its_axis_and_a_pull_none_along_its_direction() {
        let arc: Vec<Point> = (0..20)
            .map(|i| {
                let a = f64::from(i) * 0.05;
                Point::new(0.5 * a.cos(), 0.5 * a.sin(), 1.2)
            })
            .collect();
        let axis = Line { point: Point::new(0.0, 0.0, 5.0), direction: Vector::z() };
        let fit = about_line(&arc, &axis, |_| 0.02).unwrap();
        assert!((fit.radius - 0.5).abs() < 1e-12 && fit.variance() < 1e-20 && fit.inliers == 1.0);
        let pull: Vec<Point> = (0..20).map(|i| Point::new(0.02 * f64::from(i), 1.0, 0.5)).collect();
        assert!(along(&pull, &Vector::x(), 0.02).unwrap().variance < 1e-20);
        assert!(along(&arc, &Vector::x(), 0.02).unwrap().variance > 1e-3);
    }
}
