//! Joints of clips of one part averaged to one (§3.4, §C.2).

use super::{mean_direction, near};
use crate::articulation::{Articulation, JointKind};
use crate::config::SceneRules;
use crate::math::{Point, Vector};

/// Consensus about `seed`: of the joints of its type those that agree with it (`agree_deg`, `agree_m`) are averaged, directions
/// by PCA, origins where they pass the seed's.
#[must_use]
pub fn consensus(seed: &Articulation, joints: &[(Articulation, f64)], rules: &SceneRules) -> Articulation {
    let agreeing: Vec<(Articulation, f64)> = joints
        .iter()
        .filter(|(j, w)| *w > 0.0 && j.kind == seed.kind && near(seed, j, rules.agree_deg, rules.agree_m))
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
    use crate::math::{rotation, unsigned_angle};

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
        let merged = consensus(&joints[0].0, &joints, &SceneRules::default());
        assert!(unsigned_angle(&merged.axis, &Vector::z()) < 1e-3);
        assert!(merged.line().distance(&Point::origin()) < 2e-3, "{merged:?}");
    }
}
