//! What links are made of, and the boxes around it.

use std::f64::consts::PI;

use nalgebra::Matrix3;

use crate::math::{Point, Pose, Vector};
use crate::twin::OrientedBox;

/// A solid about its own origin; round ones stand along z. Metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Primitive {
    /// Half sizes.
    Cuboid(Vector),
    /// Radius.
    Sphere(f64),
    /// Half axes.
    Ellipsoid(Vector),
    /// Radius and half length.
    Cylinder(f64, f64),
    /// Radius and half length without the caps.
    Capsule(f64, f64),
    /// The corners of what is around it.
    Mesh([Point; 2]),
}

impl Primitive {
    /// The box around it, moved to `pose`.
    pub fn bounds(&self, pose: &Pose) -> OrientedBox {
        let (center, half) = match *self {
            Self::Cuboid(half) | Self::Ellipsoid(half) => (Point::origin(), half),
            Self::Sphere(r) => (Point::origin(), Vector::repeat(r)),
            Self::Cylinder(r, h) => (Point::origin(), Vector::new(r, r, h)),
            Self::Capsule(r, h) => (Point::origin(), Vector::new(r, r, r + h)),
            Self::Mesh([low, high]) => (nalgebra::center(&low, &high), (high - low) * 0.5),
        };
        OrientedBox { center, half, rotation: Matrix3::identity() }.moved(pose)
    }

    /// Whether it is its box.
    pub fn is_box(&self) -> bool {
        matches!(self, Self::Cuboid(_))
    }

    /// Volume, m^3; a mesh's is not known.
    pub fn volume(&self) -> Option<f64> {
        match *self {
            Self::Cuboid(half) => Some(8.0 * half.product()),
            Self::Sphere(r) => Some(4.0 / 3.0 * PI * r.powi(3)),
            Self::Ellipsoid(half) => Some(4.0 / 3.0 * PI * half.product()),
            Self::Cylinder(r, h) => Some(2.0 * PI * r * r * h),
            Self::Capsule(r, h) => Some(2.0 * PI * r * r * h + 4.0 / 3.0 * PI * r.powi(3)),
            Self::Mesh(_) => None,
        }
    }

    /// Moments of inertia about its own axes, kg m^2; a mesh's are not known.
    pub fn moments(&self, mass: f64) -> Option<Vector> {
        let squares = |half: Vector, share: f64| {
            let [x, y, z] = [half.x * half.x, half.y * half.y, half.z * half.z];
            Vector::new(y + z, x + z, x + y) * (mass * share)
        };
        match *self {
            Self::Cuboid(half) => Some(squares(half, 1.0 / 3.0)),
            Self::Sphere(r) => Some(squares(Vector::repeat(r), 0.2)),
            Self::Ellipsoid(half) => Some(squares(half, 0.2)),
            Self::Cylinder(r, h) => {
                let across = mass * (0.25 * r * r + h * h / 3.0);
                Some(Vector::new(across, across, 0.5 * mass * r * r))
            }
            Self::Capsule(r, h) => {
                let tube = mass * 2.0 * h / (2.0 * h + 4.0 / 3.0 * r);
                let caps = mass - tube;
                let across = tube * (0.25 * r * r + h * h / 3.0) + caps * (0.4 * r * r + h * h + 0.75 * h * r);
                Some(Vector::new(across, across, 0.5 * tube * r * r + 0.4 * caps * r * r))
            }
            Self::Mesh(_) => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_capsule_lies_between_a_sphere_and_a_cylinder() {
        let ball = Primitive::Sphere(0.1).moments(2.0).unwrap();
        let short = Primitive::Capsule(0.1, 1e-12).moments(2.0).unwrap();
        assert!((ball - short).norm() < 1e-9);
        let long = Primitive::Capsule(1e-3, 1.0).moments(2.0).unwrap();
        let rod = Primitive::Cylinder(1e-3, 1.0).moments(2.0).unwrap();
        assert!((long - rod).norm() < 5e-3 * rod.norm());
    }

    #[test]
    fn the_box_around_a_mesh_is_where_the_mesh_is() {
        let mesh = Primitive::Mesh([Point::new(0.0, 0.0, 0.0), Point::new(2.0, 1.0, 0.5)]);
        let b = mesh.bounds(&Pose::translation(1.0, 0.0, 0.0));
        assert_eq!((b.center, b.half), (Point::new(2.0, 0.5, 0.25), Vector::new(1.0, 0.5, 0.25)));
    }
}
