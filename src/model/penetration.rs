//! How deep boxes stand in each other.

use crate::math::Vector;
use crate::twin::OrientedBox;

/// How deep two boxes stand in each other, metres: the shortest way apart, along one of the directions that can separate
/// boxes (faces and pairs of edges). Not positive where they are apart.
#[must_use]
pub fn penetration(a: &OrientedBox, b: &OrientedBox) -> f64 {
    let between = b.center - a.center;
    let axes = |o: &OrientedBox| [0, 1, 2].map(|i| o.rotation.column(i).into_owned());
    let (axes_a, axes_b) = (axes(a), axes(b));
    let reach =
        |half: &Vector, axes: &[Vector; 3], n: &Vector| -> f64 { (0..3).map(|i| half[i] * axes[i].dot(n).abs()).sum() };
    let overlap = |n: &Vector| reach(&a.half, &axes_a, n) + reach(&b.half, &axes_b, n) - between.dot(n).abs();
    let mut least = f64::INFINITY;
    for n in axes_a.iter().chain(&axes_b) {
        least = least.min(overlap(n));
    }
    for u in &axes_a {
        for v in &axes_b {
            let n = u.cross(v);
            // Parallel edges add no direction to the faces'.
            if n.norm() > 1e-6 {
                least = least.min(overlap(&n.normalize()));
            }
        }
    }
    least
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{Point, rotation};

    fn cube(x: f64, angle: f64) -> OrientedBox {
        let turn = rotation(&Vector::new(1.0, 0.0, 1.0).normalize(), angle);
        OrientedBox {
            center: Point::new(x, 0.0, 0.0),
            half: Vector::repeat(0.5),
            rotation: *turn.to_rotation_matrix().matrix(),
        }
    }

    #[test]
    fn penetration_is_the_shortest_way_apart() {
        assert!((penetration(&cube(0.0, 0.0), &cube(0.9, 0.0)) - 0.1).abs() < 1e-12);
        assert!((penetration(&cube(0.0, 0.0), &cube(1.25, 0.0)) + 0.25).abs() < 1e-12);
        // A corner reaches farther than a face, and whoever is asked first.
        let (a, b) = (cube(0.0, 0.0), cube(1.1, 0.8));
        assert!(penetration(&a, &b) > 0.0);
        assert!((penetration(&a, &b) - penetration(&b, &a)).abs() < 1e-12);
    }
}
