//! Boxes around the points of a part.

use nalgebra::Matrix3;

use crate::articulation::Articulation;
use crate::math::{Point, Vector, any_orthogonal};

/// A scan shows the face of a board; the board behind it is at least as thick, metres (half).
const LEAST_HALF_M: f64 = 0.009;
/// Turns that are tried within a quarter, one a half degree: 60 cm of a door are then off by 3 mm at the most.
const TURNS: u32 = 180;

/// A box of any orientation, in a file's frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PartBox {
    /// Centre, metres.
    pub center: Point,
    /// Half sizes along the box's own axes, metres.
    pub half: Vector,
    /// The box's axes as columns, right-handed.
    pub rotation: Matrix3<f64>,
}

impl PartBox {
    /// The box after its joint opened by `opening` (rad or m).
    #[must_use]
    pub fn moved(&self, joint: &Articulation, opening: f64) -> Self {
        let motion = joint.motion(opening);
        Self {
            center: motion * self.center,
            half: self.half,
            rotation: motion.rotation.to_rotation_matrix().matrix() * self.rotation,
        }
    }
}

/// The box around points with one side along the unit `axis` and the smallest area across it: parts lie along their joints.
/// `None` where there are no finite points.
#[must_use]
pub fn around(points: &[Point], axis: &Vector) -> Option<PartBox> {
    let across = any_orthogonal(axis);
    let up = axis.cross(&across);
    let flat: Vec<[f64; 3]> = points
        .iter()
        .filter(|p| p.coords.iter().all(|x| x.is_finite()))
        .map(|p| [p.coords.dot(&across), p.coords.dot(&up), p.coords.dot(axis)])
        .collect();
    if flat.is_empty() {
        return None;
    }
    let [_, turn, spans] = (0..TURNS)
        .map(|k| {
            let (sin, cos) = (std::f64::consts::FRAC_PI_2 * f64::from(k) / f64::from(TURNS)).sin_cos();
            let u = span(flat.iter().map(|[x, y, _]| x * cos + y * sin));
            let v = span(flat.iter().map(|[x, y, _]| y * cos - x * sin));
            let area = (u[1] - u[0]) * (v[1] - v[0]);
            [[area, 0.0, 0.0, 0.0], [sin, cos, 0.0, 0.0], [u[0], u[1], v[0], v[1]]]
        })
        .min_by(|a, b| a[0][0].total_cmp(&b[0][0]))?;
    let (right, forward) = (across * turn[1] + up * turn[0], up * turn[1] - across * turn[0]);
    let along = span(flat.iter().map(|[_, _, z]| *z));
    let sides = [[spans[0], spans[1]], [spans[2], spans[3]], along];
    let middle = sides.map(|[low, high]| 0.5 * (low + high));
    Some(PartBox {
        center: Point::from(right * middle[0] + forward * middle[1] + axis * middle[2]),
        half: Vector::from(sides.map(|[low, high]| (0.5 * (high - low)).max(LEAST_HALF_M))),
        rotation: Matrix3::from_columns(&[right, forward, *axis]),
    })
}

fn span(values: impl Iterator<Item = f64>) -> [f64; 2] {
    values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| [low.min(x), high.max(x)])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::articulation::JointKind;

    #[test]
    fn a_turned_door_has_its_own_box() {
        // 60 cm wide, 70 cm tall, 2 cm thick, turned by 30 degrees about the upright.
        let turn = crate::math::rotation(&Vector::z(), 30f64.to_radians());
        let mut points = Vec::new();
        for i in 0..8 {
            let sign = |bit: usize| if i >> bit & 1 == 0 { -1.0 } else { 1.0 };
            points.push(Point::new(1.0, 2.0, 1.0) + turn * Vector::new(0.3 * sign(0), 0.01 * sign(1), 0.35 * sign(2)));
        }
        let b = around(&points, &Vector::z()).unwrap();
        let mut sides = [b.half.x, b.half.y, b.half.z];
        sides.sort_by(f64::total_cmp);
        assert!((sides[0] - 0.01).abs() < 1e-9 && (sides[1] - 0.3).abs() < 1e-9 && (sides[2] - 0.35).abs() < 1e-9);
        assert!((b.center - Point::new(1.0, 2.0, 1.0)).norm() < 1e-9);
        assert!((b.rotation.determinant() - 1.0).abs() < 1e-9);
        assert!(around(&[], &Vector::z()).is_none());
    }

    #[test]
    fn a_box_goes_with_its_joint() {
        let points = [Point::new(0.0, 0.0, 0.0), Point::new(0.6, 0.02, 0.7)];
        let b = around(&points, &Vector::z()).unwrap();
        let hinge = Articulation { kind: JointKind::Revolute, axis: Vector::z(), origin: Point::origin() };
        let open = b.moved(&hinge, std::f64::consts::FRAC_PI_2);
        assert!((open.center - Point::new(-0.01, 0.3, 0.35)).norm() < 1e-9, "{}", open.center);
    }
}
