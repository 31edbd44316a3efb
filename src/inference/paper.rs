//! The paper's rules to the letter (§3.4, §A.7): the type from words, the slide along a direction of the room, the hinge at the
//! line of least variance of the radius.

use crate::articulation::{Articulation, JointKind, Outcome};
use crate::config;
use crate::geometry::{AxisCandidate, AxisSource, Face};
use crate::hands::Trajectory;
use crate::math::{centroid, path, principal_directions};

use super::{ClipJoint, observed_range, opening_sense};

/// Infers the joint of one clip. `words_log_odds`: of a hinge over a slide, from the furniture's name or a language model.
///
/// The paper leaves open what happens without a word: the rule whose axis leaves the smaller variance then decides.
#[must_use]
pub fn infer(
    trajectory: &Trajectory,
    candidates: &[AxisCandidate],
    words_log_odds: f64,
    face: Option<&Face>,
    config: &config::Inference,
) -> Outcome<ClipJoint> {
    let path = trajectory.positions();
    // What words rule out is not looked for.
    let hinge = (words_log_odds >= 0.0).then(|| hinge(&path, candidates, config)).flatten();
    let slide = (words_log_odds <= 0.0).then(|| slide(&path, candidates)).flatten();
    let revolute = match (&hinge, &slide) {
        _ if words_log_odds != 0.0 => words_log_odds > 0.0,
        (Some((_, turn)), Some((_, pull))) => turn.radial_variance < *pull,
        (hinge, _) => hinge.is_some(),
    };
    let (candidate, residual_m, inliers, radius_m) = match (revolute, hinge, slide) {
        (true, Some((c, fit)), _) => {
            let inliers = path::torus_inliers(&path, &c.joint.line(), |r| super::torus_tolerance(r, config));
            (c, fit.radial_variance.sqrt(), inliers, Some(fit.radius))
        }
        (true, None, _) => return Outcome::Abstained("no 3D line could be the hinge".to_owned()),
        (false, _, Some((c, variance))) => {
            let inliers = path::line_inliers(&path, &c.joint.axis, config.prismatic_tolerance_m);
            (c, variance.sqrt(), inliers, None)
        }
        (false, _, None) => return Outcome::Abstained("no direction of the room for a slide".to_owned()),
    };
    // Whatever has a variance has samples.
    let inliers = inliers.unwrap_or(0.0);
    let line = candidate.joint.line();
    let contact_pivot = match candidate.joint.kind {
        JointKind::Revolute => centroid(&path).map_or(candidate.joint.origin, |c| line.project(&c)),
        JointKind::Prismatic => path[0],
    };
    let grip = trajectory.closed_grip();
    let joint = Articulation { origin: contact_pivot, ..candidate.joint };
    let joint = opening_sense(joint, face, &grip, std::iter::once(trajectory));
    Outcome::Found(ClipJoint {
        joint,
        contact_pivot,
        source: candidate.source,
        type_probability: 1.0 / (1.0 + (-words_log_odds.abs()).exp()),
        joint_probability: 1.0,
        residual_m,
        inliers,
        radius_m,
        observed_range: observed_range(&joint, &grip, &path),
        grip,
        action: trajectory.action,
    })
}

/// The line of least variance of the hand's distance: of those that a language model named, or of all.
fn hinge<'a>(
    path: &[crate::math::Point],
    candidates: &'a [AxisCandidate],
    config: &config::Inference,
) -> Option<(&'a AxisCandidate, path::AboutLine)> {
    let lines = || candidates.iter().filter(|c| c.source == AxisSource::Line);
    let named = lines().any(|c| c.named > 0.0);
    let asked: Vec<_> = lines().filter(|c| !named || c.named > 0.0).collect();
    let fits = path::about_lines(path, &asked.iter().map(|c| c.joint.line()).collect::<Vec<_>>());
    let within = asked.into_iter().zip(fits).filter(|(_, fit)| fit.radius <= config.max_radius_m);
    within.min_by(|a, b| a.1.radial_variance.total_cmp(&b.1.radial_variance))
}

/// The direction of the room that the hand's path runs along best, and what variance across it is left, m^2.
fn slide<'a>(path: &[crate::math::Point], candidates: &'a [AxisCandidate]) -> Option<(&'a AxisCandidate, f64)> {
    let (axes, _) = principal_directions(path)?;
    let along = |c: &AxisCandidate| axes.column(0).dot(&c.joint.axis).abs();
    let best =
        candidates.iter().filter(|c| c.source == AxisSource::Manhattan).max_by(|a, b| along(a).total_cmp(&along(b)))?;
    Some((best, path::across(path, &best.joint.axis)?))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::articulation::Action;
    use crate::hands::Sample;
    use crate::math::{Point, Vector};

    fn trajectory(points: impl Iterator<Item = Point>) -> Trajectory {
        let samples = points
            .enumerate()
            .map(|(i, p)| Sample { frame: i, time_secs: i as f64, observed: p, smoothed: p, accepted: true })
            .collect();
        Trajectory { side: None, samples, action: Action::Open, ends_seen: [true; 2] }
    }

    fn candidate(kind: JointKind, axis: Vector, origin: Point, source: AxisSource) -> AxisCandidate {
        AxisCandidate::new(Articulation { kind, axis, origin }, source)
    }

    #[test]
    fn a_door_turns_about_the_line_of_least_variance_if_words_say_so() {
        let door = trajectory((0..30).map(|i| {
            let a = 0.04 * f64::from(i);
            Point::new(0.5 * a.cos(), 0.5 * a.sin(), 1.0)
        }));
        let candidates = [
            candidate(JointKind::Revolute, Vector::z(), Point::new(0.3, 0.1, 0.0), AxisSource::Line),
            candidate(JointKind::Revolute, Vector::z(), Point::new(0.0, 0.0, 0.4), AxisSource::Line),
            candidate(JointKind::Prismatic, Vector::y(), Point::origin(), AxisSource::Manhattan),
        ];
        let config = config::Inference::default();
        let found = infer(&door, &candidates, 2.0, None, &config);
        let joint = found.found().unwrap();
        assert!(joint.joint.kind == JointKind::Revolute && joint.contact_pivot.coords.xy().norm() < 1e-9);
        assert!((joint.contact_pivot.z - 1.0).abs() < 1e-9 && joint.joint.axis.z > 0.99);
        let slide = infer(&door, &candidates, -2.0, None, &config);
        assert_eq!(slide.found().unwrap().joint.kind, JointKind::Prismatic);
        assert!(infer(&door, &candidates[2..], 2.0, None, &config).reason().unwrap().contains("line"));
    }
}
