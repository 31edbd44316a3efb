//! Joints of clips of one part averaged to one (§3.4, §C.2).

use super::mean_direction;
use crate::articulation::{Articulation, JointKind};
use crate::math::{Point, Vector, unsigned_angle};

/// Consensus about `seed`: of the joints of its type those that agree with it (10 degrees, 12 cm) are averaged, directions
/// by PCA, origins where they pass the seed's.
#[must_use]
pub fn consensus(seed: &Articulation, joints: &[(Articulation, f64)]) -> Articulation {
    /// Definition: what agrees, degrees and metres.
    const ANGLE_DEG: f64 = 10.0;
    /// Definition: the same of hinges, metres.
    const HINGE_M: f64 = 0.12;
    let agreeing: Vec<(Articulation, f64)> = joints
        .iter()
        .filter(|(j, w)| {
            *w > 0.0
                && j.kind == seed.kind
                && unsigned_angle(&j.axis, &seed.axis) < ANGLE_DEG.to_radians()
                && (j.kind == JointKind::Prismatic || seed.line().distance(&j.origin) < HINGE_M)
        })
        .copied()
        .collect();
    let total: f64 = agreeing.iter().map(|(_, w)| w).sum();
    let directions: Vec<(Vector, f64)> =
        std::iter::once((seed.axis, 1e-9)).chain(agreeing.iter().map(|(j, w)| (j.axis, *w))).collect();
    let (Some(axis), true) = (mean_direction(&directions), total > 0.0) else { return *seed };
    let origin = agreeing.iter().fold(Vector::zeros(), |sum, (j, w)| {
        // Along a hinge an origin is free.
        let here = if seed.kind == JointKind::Revolute { j.line().project(&seed.origin) } else { j.origin };
        sum + here.coords * (w / total)
    });
    Articulation { kind: seed.kind, axis, origin: Point::from(origin) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::rotation;

    fn hinge(tilt: f64, x: f64) -> Articulation {
        Articulation {
            kind: JointKind::Revolute,
            axis: rotation(&Vector::x(), tilt) * Vector::z(),
            origin: Point::new(x, 0.0, 3.0 * x),
        }
    }

    #[test]
    fn an_outlier_does_not_move_the_consensus() {
        let joints = [
            (hinge(0.02, 0.01), 1.0),
            (hinge(-0.02, -0.01), 1.0),
            (hinge(0.0, 0.6), 1.0),
            (Articulation { kind: JointKind::Prismatic, ..hinge(0.0, 0.0) }, 5.0),
        ];
        let merged = consensus(&joints[0].0, &joints);
        assert!(unsigned_angle(&merged.axis, &Vector::z()) < 1e-3);
        assert!(merged.line().distance(&Point::origin()) < 2e-3, "{merged:?}");
    }
}
