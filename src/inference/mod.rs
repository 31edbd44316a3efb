//! Trajectory, geometry and the answers to the two questions become a joint (§3.4, §A.7).

pub mod aggregate;
pub mod bare;
mod bend;
pub mod grouping;
pub mod paper;
pub mod same_part;
pub mod uncertainty;

use serde::{Deserialize, Serialize};

use crate::articulation::{Action, Articulation, JointKind, Outcome};
use crate::config;
use crate::geometry::candidates::{IN_FACE, outwardness};
use crate::geometry::{AxisCandidate, AxisSource, Face};
use crate::hands::Trajectory;
use crate::math::{Point, Vector, path, stats};
use crate::reasoning::Answer;
pub use uncertainty::Uncertainty;

/// The joint of one clip, with what speaks for it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ClipJoint {
    /// The joint; positive opens.
    pub joint: Articulation,
    /// The hand centroid's projection on the axis, the paper's origin (§A.7); for a slide the first contact point.
    pub contact_pivot: Point,
    /// Where the axis comes from.
    pub source: AxisSource,
    /// Probability of the type; `None` where nobody computed one, as under the paper's rule.
    pub type_probability: Option<f64>,
    /// Probability that type, axis and hinge are right, see [`is_right`]: of the weight of all explanations the share under
    /// which they are; `None` as above.
    pub joint_probability: Option<f64>,
    /// Root mean square distance of the smoothed hand from the joint's path, metres.
    pub residual_m: f64,
    /// Share of hand samples within the torus (§B.1) or the slide's tolerance.
    pub inliers: f64,
    /// Distance of the hand from the hinge, metres.
    pub radius_m: Option<f64>,
    /// Opening that the hand went through, rad or m.
    pub observed_range: f64,
    /// The grip when closed, world.
    pub grip: Point,
    /// Opening or closing.
    pub action: Action,
}

/// Applies the rules of §A.7 to the candidates under the reasoner's weights. `vouched_for`: depth shows that a part moved, or
/// the touched furniture is known by name, so that a hand that was seen for a moment only is enough.
#[must_use]
pub fn infer(
    trajectory: &Trajectory,
    candidates: &[AxisCandidate],
    answer: &Answer,
    face: Option<&Face>,
    vouched_for: bool,
    reasoning: &config::Reasoning,
    config: &config::Inference,
) -> Outcome<ClipJoint> {
    let positions = trajectory.positions();
    let extent = positions.iter().map(|p| (p - positions[0]).norm()).fold(0.0, f64::max);
    if extent < config.least_extent_m && !vouched_for {
        return Outcome::Abstained(format!("the hand in contact moved by only {:.1} cm", 100.0 * extent));
    }
    let revolute_probability = answer.revolute_probability(candidates);
    let kind = if revolute_probability >= 0.5 { JointKind::Revolute } else { JointKind::Prismatic };
    let mut ranked: Vec<(f64, &AxisCandidate)> = answer
        .log_weights()
        .iter()
        .zip(candidates)
        .filter(|(w, c)| c.joint.kind == kind && w.is_finite())
        .map(|(w, c)| (*w, c))
        .collect();
    ranked.sort_by(|a, b| b.0.total_cmp(&a.0));
    let Some(&(_, best)) = ranked.first() else {
        return Outcome::Abstained(match kind {
            JointKind::Revolute => format!(
                "no candidate hinge between {} and {} m from the hand",
                config.min_radius_m, config.max_radius_m
            ),
            JointKind::Prismatic => "no direction for a slide".to_owned(),
        });
    };
    let path = trajectory.positions();
    let joint = opening_sense(best.joint, face, &trajectory.closed_grip(), std::iter::once(trajectory));
    let (residual, inliers, radius_m) = match kind {
        JointKind::Revolute => {
            let inliers = path::torus_inliers(&path, &joint.line(), |r| torus_tolerance(r, config));
            let Some((fit, inliers)) = path::about_line(&path, &joint.line()).zip(inliers) else {
                return Outcome::Abstained("no hand samples".to_owned());
            };
            (fit.variance().sqrt(), inliers, Some(fit.radius))
        }
        JointKind::Prismatic => {
            // The paper's 2 cm contradicts its own 5 cm of hand noise: twice the noise is what a valid path needs.
            let tolerance = config.prismatic_tolerance_m.max(2.0 * reasoning.hand_std_m);
            let inliers = path::line_inliers(&path, &joint.axis, tolerance);
            let Some((variance, inliers)) = path::across(&path, &joint.axis).zip(inliers) else {
                return Outcome::Abstained("no hand samples".to_owned());
            };
            if inliers < config.prismatic_min_inliers && !vouched_for {
                return Outcome::Abstained(format!(
                    "only {:.0} % of the hand samples lie on any slide ({:.0} % are needed)",
                    100.0 * inliers,
                    100.0 * config.prismatic_min_inliers
                ));
            }
            (variance.sqrt(), inliers, None)
        }
    };
    let contact_pivot = match kind {
        JointKind::Revolute => crate::math::centroid(&path).map_or(joint.origin, |c| joint.line().project(&c)),
        JointKind::Prismatic => path[0],
    };
    let all: Vec<(Articulation, f64)> = ranked.iter().map(|(w, c)| (c.joint, (w - ranked[0].0).exp())).collect();
    let type_probability = revolute_probability.max(1.0 - revolute_probability);
    let grip = trajectory.closed_grip();
    Outcome::Found(ClipJoint {
        joint,
        contact_pivot,
        source: best.source,
        type_probability: Some(type_probability),
        joint_probability: Some(type_probability * agreeing_share(&best.joint, &all)),
        residual_m: residual,
        inliers,
        radius_m,
        observed_range: observed_range(&joint, &grip, &path),
        grip,
        action: trajectory.action,
    })
}

/// Half-thickness of the torus about a mean radius (§B.1).
#[must_use]
pub fn torus_tolerance(radius: f64, config: &config::Inference) -> f64 {
    (config.torus_tolerance_ratio * radius).clamp(config.torus_tolerance_min_m, config.torus_tolerance_max_m)
}

/// Definition: share of a path's samples that are left out at each end where its opening is read off.
pub(crate) const ENDS: f64 = 0.03;

/// Opening that the path goes through: from the closed to the open end without the extreme 3 % of the samples, rad or m.
#[must_use]
pub fn observed_range(joint: &Articulation, grip: &Point, path: &[Point]) -> f64 {
    let openings = openings(joint, grip, path);
    let [low, high] = [ENDS, 1.0 - ENDS].map(|q| stats::quantile(&openings, q));
    low.zip(high).map_or(0.0, |(low, high)| high - low)
}

/// Opening at each point of a path, continuous.
#[must_use]
pub fn openings(joint: &Articulation, grip: &Point, path: &[Point]) -> Vec<f64> {
    let raw: Vec<f64> = path.iter().map(|p| joint.opening_at(grip, p)).collect();
    if joint.kind == JointKind::Revolute { stats::unwrap_angles(&raw) } else { raw }
}

/// Positive opens. The face tells for joints that leave it; within the face, and without one, the motions do.
#[must_use]
pub fn opening_sense<'a>(
    joint: Articulation,
    face: Option<&Face>,
    grip: &Point,
    trajectories: impl Iterator<Item = &'a Trajectory>,
) -> Articulation {
    if face.is_some_and(|f| outwardness(&joint, f, grip).abs() > IN_FACE) {
        return joint;
    }
    let opened: f64 = trajectories.map(|t| joint.opening_at(&t.closed_grip(), &t.open_grip())).sum();
    if opened < 0.0 { joint.reversed() } else { joint }
}

/// One way to explain a motion: candidates that are the same joint.
#[derive(Debug, Clone, PartialEq)]
pub struct Explanation {
    /// Indices of the candidates, the likeliest first; never empty.
    pub members: Vec<usize>,
    /// Probability of its type.
    pub type_share: f64,
    /// Probability of its type and axis.
    pub share: f64,
}

/// The explanations of a motion under the reasoner's weights, each candidate in one of them: first the answer (of the
/// likelier type the likeliest candidate, with those that agree), then the others by falling share. The shares add up to 1.
#[must_use]
pub fn explanations(candidates: &[AxisCandidate], answer: &Answer) -> Vec<Explanation> {
    let revolute = answer.revolute_probability(candidates);
    let weights = answer.log_weights();
    let mut all = Vec::new();
    for (kind, type_share) in [(JointKind::Revolute, revolute), (JointKind::Prismatic, 1.0 - revolute)] {
        let mut left: Vec<(usize, f64)> = candidates
            .iter()
            .zip(&weights)
            .enumerate()
            .filter(|(_, (c, w))| c.joint.kind == kind && w.is_finite())
            .map(|(i, (_, w))| (i, *w))
            .collect();
        left.sort_by(|a, b| b.1.total_cmp(&a.1));
        let Some(&(_, top)) = left.first() else { continue };
        let mass = |some: &[(usize, f64)]| some.iter().map(|(_, w)| (w - top).exp()).sum::<f64>();
        let total = mass(&left);
        while let Some(&(head, _)) = left.first() {
            let joint = candidates[head].joint;
            let (same, rest): (Vec<_>, Vec<_>) =
                left.into_iter().partition(|(i, _)| *i == head || same_axis(&candidates[*i].joint, &joint));
            let share = type_share * mass(&same) / total;
            all.push(Explanation { members: same.into_iter().map(|(i, _)| i).collect(), type_share, share });
            left = rest;
        }
    }
    let likelier = if revolute >= 0.5 { JointKind::Revolute } else { JointKind::Prismatic };
    let is_likelier = |e: &Explanation| e.members.first().is_some_and(|&i| candidates[i].joint.kind == likelier);
    if let Some(at) = all.iter().position(is_likelier) {
        all[..=at].rotate_right(1);
        all[1..].sort_by(|a, b| b.share.total_cmp(&a.share));
    }
    all
}

/// Of the weight of all joints of `best`'s type the share of those under which it is right ([`is_right`]).
#[must_use]
pub fn agreeing_share(best: &Articulation, all: &[(Articulation, f64)]) -> f64 {
    let of_type = || all.iter().filter(|(j, _)| j.kind == best.kind);
    let total: f64 = of_type().map(|(_, w)| w).sum();
    let agreeing: f64 = of_type().filter(|(j, _)| is_right(best, j)).map(|(_, w)| w).sum();
    if total > 0.0 { agreeing / total } else { 0.0 }
}

/// Whether an answer is right if `other` is the joint, by the paper's limits (§4) as [`crate::evaluation::Rule::PawsLine`] reads
/// them: of its type, directions within 15 degrees, the true hinge within 25 cm of the answer's line.
#[must_use]
pub fn is_right(answer: &Articulation, other: &Articulation) -> bool {
    /// Definition (§4), degrees and metres.
    const ANGLE_DEG: f64 = 15.0;
    /// Definition: the same of hinges, metres.
    const HINGE_M: f64 = 0.25;
    answer.kind == other.kind && near(answer, other, ANGLE_DEG, HINGE_M)
}

/// Whether two joints are one explanation: hand and depth seldom tell joints apart that are within 8 degrees and 8 cm.
fn same_axis(a: &Articulation, b: &Articulation) -> bool {
    /// Definition: what the probability of a joint is the probability of, degrees and metres.
    const ANGLE_DEG: f64 = 8.0;
    /// Definition: the same of hinges, metres.
    const HINGE_M: f64 = 0.08;
    near(a, b, ANGLE_DEG, HINGE_M)
}

/// Whether directions without sign, and the lines of hinges, are within these.
fn near(a: &Articulation, b: &Articulation, angle_deg: f64, hinge_m: f64) -> bool {
    crate::math::unsigned_angle(&a.axis, &b.axis) <= angle_deg.to_radians()
        && (a.kind == JointKind::Prismatic || a.line().distance(&b.origin) <= hinge_m)
}

/// A unit vector as the mean of directions without sign, the first one giving the sense.
pub(crate) fn mean_direction(directions: &[(Vector, f64)]) -> Option<Vector> {
    let mut scatter = nalgebra::Matrix3::zeros();
    for (d, w) in directions {
        scatter += d * d.transpose() * *w;
    }
    let (axes, _) = crate::math::eigen_descending(scatter);
    let axis: Vector = axes.column(0).into_owned();
    let first = directions.first()?.0;
    Some(if axis.dot(&first) < 0.0 { -axis } else { axis })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn candidate(kind: JointKind, x: f64) -> AxisCandidate {
        let axis = if kind == JointKind::Revolute { Vector::z() } else { -Vector::y() };
        let joint = Articulation { kind, axis, origin: Point::new(x, 0.0, 0.0) };
        AxisCandidate::new(joint, AxisSource::Line, &config::AxisSources::default())
    }

    #[test]
    fn an_answer_is_as_sure_as_the_joints_under_which_it_would_be_right() {
        let hinge = |x: f64| candidate(JointKind::Revolute, x).joint;
        // Another type does not count here, a hinge 20 cm beside is right for the paper, one 30 cm beside is not.
        let all = [
            (hinge(0.0), 0.4),
            (hinge(0.2), 0.3),
            (hinge(0.3), 0.1),
            (candidate(JointKind::Prismatic, 0.0).joint, 0.9),
        ];
        assert!((agreeing_share(&hinge(0.0), &all) - 0.7 / 0.8).abs() < 1e-12);
        let turned = |degrees: f64| {
            let axis = nalgebra::Rotation3::from_axis_angle(&Vector::x_axis(), degrees.to_radians()) * Vector::z();
            Articulation { axis, ..hinge(0.0) }
        };
        assert!(is_right(&hinge(0.0), &turned(14.0)) && !is_right(&hinge(0.0), &turned(16.0)));
        // The sense of an axis is another question.
        assert!(is_right(&hinge(0.0), &turned(180.0)));
    }

    #[test]
    fn candidates_of_one_joint_are_one_explanation_and_the_answer_comes_first() {
        let hinge = |x: f64| candidate(JointKind::Revolute, x);
        // A hinge seen twice outweighs the likeliest one, which stays the answer; a slide; a hinge that is ruled out.
        let candidates = [candidate(JointKind::Prismatic, 0.0), hinge(0.5), hinge(-0.5), hinge(-0.47), hinge(0.0)];
        let weights: [f64; 5] = [0.2, 0.3, 0.25, 0.25, 0.0];
        let answer = Answer {
            log_likelihoods: weights.iter().map(|w| w.ln()).collect(),
            log_priors: vec![0.0; 5],
            words_log_odds: 0.0,
        };
        let all = explanations(&candidates, &answer);
        let members: Vec<&[usize]> = all.iter().map(|e| e.members.as_slice()).collect();
        let expected: [&[usize]; 3] = [&[1], &[2, 3], &[0]];
        assert_eq!(members, expected);
        for (e, (share, type_share)) in all.iter().zip([(0.3, 0.8), (0.5, 0.8), (0.2, 0.2)]) {
            assert!((e.share - share).abs() < 1e-12 && (e.type_share - type_share).abs() < 1e-12, "{e:?}");
        }
        // Words count for the types, not within them.
        let told = explanations(&candidates, &Answer { words_log_odds: -(2f64.ln()), ..answer });
        assert!((told[0].share - 0.3 / 0.8 * told[0].type_share).abs() < 1e-12 && told[0].type_share < 0.8);
        assert!((told.iter().map(|e| e.share).sum::<f64>() - 1.0).abs() < 1e-12);
        let nothing = Answer { log_likelihoods: vec![], log_priors: vec![], words_log_odds: 1.0 };
        assert!(explanations(&[], &nothing).is_empty());
    }
}
