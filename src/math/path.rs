//! How well a motion of one degree of freedom explains a path: distances to a line, and to a direction (§A.7).

use nalgebra::Point2;
use wide::f64x4;

use super::line::Line;
use super::{Point, Vector, centroid, circle, principal_directions, reject, stats};

/// A path about a line.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AboutLine {
    /// Mean distance from the line, `r_l` (m).
    pub radius: f64,
    /// Variance of that distance: the paper's criterion (m^2).
    pub radial_variance: f64,
    /// Variance along the line, which a rotation leaves at zero too (m^2).
    pub axial_variance: f64,
}

impl AboutLine {
    /// Mean squared distance from the best circle about the line, m^2.
    #[must_use]
    pub fn variance(&self) -> f64 {
        self.radial_variance + self.axial_variance
    }
}

/// Lines that are worked on at once.
const AT_ONCE: usize = 4;

/// Measures a path about a line. `None` for an empty path.
#[must_use]
pub fn about_line(path: &[Point], line: &Line) -> Option<AboutLine> {
    about(path, std::slice::from_ref(line)).map(|fits| fits[0])
}

/// Measures a path about each of many lines, as [`about_line`] does, several at a time. Empty for an empty path.
#[must_use]
pub fn about_lines(path: &[Point], lines: &[Line]) -> Vec<AboutLine> {
    let mut out = Vec::with_capacity(lines.len());
    for some in lines.chunks(AT_ONCE) {
        out.extend(about(path, some).into_iter().flatten().take(some.len()));
    }
    out
}

/// A path about one to [`AT_ONCE`] lines; what stands where there is none means nothing.
fn about(path: &[Point], lines: &[Line]) -> Option<[AboutLine; AT_ONCE]> {
    let of = |value: &dyn Fn(&Line) -> f64| {
        f64x4::from(std::array::from_fn::<f64, AT_ONCE, _>(|i| lines.get(i).map_or(0.0, value)))
    };
    let [x, y, z] = [0, 1, 2].map(|k| of(&|l| l.point[k]));
    let [along_x, along_y, along_z] = [0, 1, 2].map(|k| of(&|l| l.direction[k]));
    let at = |p: &Point| {
        let [x, y, z] = [f64x4::splat(p.x) - x, f64x4::splat(p.y) - y, f64x4::splat(p.z) - z];
        let along = x * along_x + y * along_y + z * along_z;
        let square = x * x + y * y + z * z - along * along;
        (square.max(f64x4::splat(0.0)).sqrt(), along)
    };
    // One pass: sums about the first point's values lose no digits where the spread is small.
    let (first_distance, first_along) = at(path.first()?);
    let [mut d, mut dd, mut h, mut hh] = [f64x4::splat(0.0); 4];
    for p in path {
        let (distance, along) = at(p);
        let (distance, along) = (distance - first_distance, along - first_along);
        d += distance;
        dd += distance * distance;
        h += along;
        hh += along * along;
    }
    let share = f64x4::splat(1.0 / path.len() as f64);
    let variance = |sum: f64x4, squares: f64x4| {
        let mean = share * sum;
        (share * squares - mean * mean).max(f64x4::splat(0.0)).to_array()
    };
    let radius = (first_distance + share * d).to_array();
    let (radial, axial) = (variance(d, dd), variance(h, hh));
    let fit = |i: usize| AboutLine { radius: radius[i], radial_variance: radial[i], axial_variance: axial[i] };
    Some(std::array::from_fn(fit))
}

/// Share of a path within a torus about a line (§B.1): no further than `tolerance` of the median radius from the circle of the
/// median radius at the median height. `None` for an empty path.
#[must_use]
pub fn torus_inliers(path: &[Point], line: &Line, tolerance: impl Fn(f64) -> f64) -> Option<f64> {
    let d: Vec<f64> = path.iter().map(|p| line.distance(p)).collect();
    let h: Vec<f64> = path.iter().map(|p| line.coordinate(p)).collect();
    let (radius, height) = (stats::median(&d)?, stats::median(&h)?);
    let tolerance = tolerance(radius);
    let inside = d.iter().zip(&h).filter(|(d, h)| (**d - radius).hypot(**h - height) <= tolerance).count();
    Some(inside as f64 / path.len() as f64)
}

/// Mean squared distance of a path from the best line along a unit direction, m^2. `None` for an empty path.
#[must_use]
pub fn across(path: &[Point], direction: &Vector) -> Option<f64> {
    let mean = centroid(path)?;
    Some(path.iter().map(|p| reject(&(p - mean), direction).norm_squared()).sum::<f64>() / path.len() as f64)
}

/// Share of a path within `tolerance` of the best line along a unit direction. `None` for an empty path.
#[must_use]
pub fn line_inliers(path: &[Point], direction: &Vector, tolerance: f64) -> Option<f64> {
    let mean = centroid(path)?;
    let inside = path.iter().filter(|p| reject(&(*p - mean), direction).norm() <= tolerance).count();
    Some(inside as f64 / path.len() as f64)
}

/// Root mean square distance of a path from the best circle or line of all, metres.
#[must_use]
pub fn beside_any_joint(path: &[Point]) -> f64 {
    let Some((axes, variances)) = principal_directions(path) else { return 0.0 };
    let Some(mean) = centroid(path) else { return 0.0 };
    let flat: Vec<Point2<f64>> = path
        .iter()
        .map(|p| {
            let d = p - mean;
            Point2::new(d.dot(&axes.column(0)), d.dot(&axes.column(1)))
        })
        .collect();
    let line = variances[1] + variances[2];
    let arc = circle::fit(&flat).map_or(f64::INFINITY, |c| c.rms(&flat).powi(2) + variances[2]);
    line.min(arc).max(0.0).sqrt()
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
        let fit = about_line(&arc, &axis).unwrap();
        assert!((fit.radius - 0.5).abs() < 1e-12 && fit.variance() < 1e-20);
        let lines: Vec<Line> =
            (0..11).map(|i| Line { point: Point::new(0.1 * f64::from(i), 0.0, 1.0), ..axis }).collect();
        let one_by_one: Vec<_> = lines.iter().filter_map(|l| about_line(&arc, l)).collect();
        assert_eq!(about_lines(&arc, &lines), one_by_one);
        // By hand, off the axis, in the chunk that is not full.
        let distances: Vec<f64> = arc.iter().map(|p| lines[9].distance(p)).collect();
        let mean = distances.iter().sum::<f64>() / 20.0;
        let variance = distances.iter().map(|d| (d - mean).powi(2)).sum::<f64>() / 20.0;
        assert!(
            (one_by_one[9].radius - mean).abs() < 1e-12 && (one_by_one[9].radial_variance - variance).abs() < 1e-12
        );
        assert!(about_lines(&[], &lines).is_empty() && about_lines(&arc, &[]).is_empty());
        assert_eq!(torus_inliers(&arc, &axis, |_| 0.02), Some(1.0));
        let pull: Vec<Point> = (0..20).map(|i| Point::new(0.02 * f64::from(i), 1.0, 0.5)).collect();
        assert!(across(&pull, &Vector::x()).unwrap() < 1e-20 && across(&arc, &Vector::x()).unwrap() > 1e-3);
        assert_eq!(line_inliers(&pull, &Vector::x(), 0.02), Some(1.0));
        assert!(line_inliers(&arc, &Vector::x(), 0.02).unwrap() < 0.5);
    }
}
