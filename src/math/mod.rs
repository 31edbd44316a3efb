//! Ground floor: geometry and estimation that know no kitchen. f64, metres, radians.

pub mod circle;
pub mod directions;
pub mod kalman;
pub mod line;
pub mod ou;
pub mod path;
pub mod plane;
pub mod ransac;
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
    fn any_orthogonal_is_orthogonal_for_every_axis() {
        for v in [Vector::x(), Vector::y(), Vector::z(), Vector::new(1.0, 1.0, 1.0).normalize()] {
            let o = any_orthogonal(&v);
            assert!(o.dot(&v).abs() < 1e-12 && (o.norm() - 1.0).abs() < 1e-12);
        }
    }
}
