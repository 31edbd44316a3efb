//! Ground floor: geometry and estimation that know no kitchen. f64, metres, radians.

pub mod circle;
pub mod directions;
pub mod kalman;
pub mod line;
pub mod ou;
pub mod path;
pub mod plane;
pub mod ransac;
pub mod sampling;
pub mod stats;

use nalgebra::{Matrix3, Point3, SymmetricEigen, Unit, UnitQuaternion, Vector3};

/// A point in metres.
pub type Point = Point3<f64>;
/// A vector in metres (or a direction).
pub type Vector = Vector3<f64>;
/// A rigid transform `target_from_source`.
pub type Pose = nalgebra::Isometry3<f64>;

/// Mean of points; `None` for an empty slice.
#[must_use]
pub fn centroid(points: &[Point]) -> Option<Point> {
    if points.is_empty() {
        return None;
    }
    let sum = points.iter().fold(Vector::zeros(), |sum, p| sum + p.coords);
    Some(Point::from(sum / points.len() as f64))
}

/// Principal directions of points about their mean: unit vectors as columns, by falling variance, and the variances (m^2).
#[must_use]
pub fn principal_directions(points: &[Point]) -> Option<(Matrix3<f64>, Vector)> {
    let mean = centroid(points)?;
    let mut covariance = Matrix3::zeros();
    for p in points {
        let d = p - mean;
        covariance += d * d.transpose();
    }
    Some(eigen_descending(covariance / points.len() as f64))
}

/// Eigenvectors (columns) and eigenvalues of a symmetric matrix, largest eigenvalue first.
#[must_use]
pub fn eigen_descending(matrix: Matrix3<f64>) -> (Matrix3<f64>, Vector) {
    let eigen = SymmetricEigen::new(matrix);
    let mut order = [0usize, 1, 2];
    order.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]));
    let columns = order.map(|i| eigen.eigenvectors.column(i).into_owned());
    (Matrix3::from_columns(&columns), Vector::from_iterator(order.iter().map(|&i| eigen.eigenvalues[i])))
}

/// A number for people, with all its digits: large and small ones with their power of ten.
#[must_use]
pub fn plain(value: f64) -> String {
    let size = value.abs();
    if size == 0.0 || (1e-6..1e7).contains(&size) { value.to_string() } else { format!("{value:e}") }
}

/// The length of a vector, also of one whose square no number holds.
#[must_use]
pub fn length(vector: &Vector) -> f64 {
    let most = vector.amax();
    if most > 0.0 && most.is_finite() { (vector / most).norm() * most } else { vector.norm() }
}

/// A number for people with some digits behind its point; from ten million on with its power of ten.
#[must_use]
pub fn rounded(value: f64, digits: usize) -> String {
    const LONG: f64 = 1e7;
    if value.abs() < LONG || !value.is_finite() {
        return format!("{value:.digits$}");
    }
    let short: f64 = format!("{value:.2e}").parse().unwrap_or(value);
    format!("{short:e}")
}

/// Any unit vector orthogonal to `direction`.
#[must_use]
pub fn any_orthogonal(direction: &Vector) -> Vector {
    let axis = match direction.iamin() {
        0 => Vector::x(),
        1 => Vector::y(),
        _ => Vector::z(),
    };
    direction.cross(&axis).normalize()
}

/// The part of `vector` orthogonal to the unit vector `direction`.
#[must_use]
pub fn reject(vector: &Vector, direction: &Vector) -> Vector {
    vector - direction * vector.dot(direction)
}

/// Angle between two unit directions regardless of their sign, in radians, 0..=pi/2.
#[must_use]
pub fn unsigned_angle(a: &Vector, b: &Vector) -> f64 {
    a.dot(b).abs().min(1.0).acos()
}

/// Angle between two unit directions, in radians, 0..=pi.
#[must_use]
pub fn signed_angle(a: &Vector, b: &Vector) -> f64 {
    a.dot(b).clamp(-1.0, 1.0).acos()
}

/// Rotation of `angle` radians about a unit axis, by the right-hand rule.
#[must_use]
pub fn rotation(axis: &Vector, angle: f64) -> UnitQuaternion<f64> {
    UnitQuaternion::from_axis_angle(&Unit::new_normalize(*axis), angle)
}

/// Distance of a point from the segment between two others in a plane; beyond the ends it is that of the end.
#[must_use]
pub fn segment_distance(p: [f64; 2], from: [f64; 2], to: [f64; 2]) -> f64 {
    let d = [to[0] - from[0], to[1] - from[1]];
    let length2 = (d[0] * d[0] + d[1] * d[1]).max(1e-12);
    let t = (((p[0] - from[0]) * d[0] + (p[1] - from[1]) * d[1]) / length2).clamp(0.0, 1.0);
    (p[0] - from[0] - t * d[0]).hypot(p[1] - from[1] - t * d[1])
}

/// Unit vector, or `None` where the input is too short or not finite.
#[must_use]
pub fn unit(vector: &Vector) -> Option<Vector> {
    let norm = vector.norm();
    (norm.is_finite() && norm > 1e-12).then(|| vector / norm)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn principal_direction_of_a_line_is_the_line() {
        let d = Vector::new(1.0, 2.0, -1.0).normalize();
        let points: Vec<Point> = (0..20).map(|i| Point::new(3.0, 1.0, 2.0) + d * f64::from(i) * 0.1).collect();
        let (axes, variances) = principal_directions(&points).unwrap();
        assert!(unsigned_angle(&axes.column(0).into_owned(), &d) < 1e-7);
        assert!(variances[1].abs() < 1e-12);
    }

    #[test]
    fn beyond_its_ends_a_segment_is_as_far_as_its_end() {
        let distance = |p| segment_distance(p, [0.0, 0.0], [2.0, 0.0]);
        assert_eq!([distance([1.0, 3.0]), distance([5.0, 4.0]), distance([-3.0, -4.0])], [3.0, 5.0, 5.0]);
        assert_eq!(segment_distance([3.0, 4.0], [0.0; 2], [0.0; 2]), 5.0);
    }

    #[test]
    fn any_orthogonal_is_orthogonal_for_every_axis() {
        for v in [Vector::x(), Vector::y(), Vector::z(), Vector::new(1.0, 1.0, 1.0).normalize()] {
            let o = any_orthogonal(&v);
            assert!(o.dot(&v).abs() < 1e-12 && (o.norm() - 1.0).abs() < 1e-12);
        }
    }
}
