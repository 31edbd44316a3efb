//! Clips of one joint merged into one scene-level joint by RANSAC and PCA (§3.4, §C.2).

use std::collections::BTreeMap;

use super::{ClipJoint, mean_direction};
use crate::articulation::{Articulation, JointKind};
use crate::config;
use crate::geometry::Face;
use crate::math::{Point, signed_angle, unsigned_angle};

/// A clip's joint with its place in the scene.
#[derive(Debug, Clone)]
pub struct Member<'a> {
    /// Index of the clip in the recording.
    pub clip: usize,
    /// What was inferred.
    pub joint: &'a ClipJoint,
    /// The touched face.
    pub face: Option<&'a Face>,
}

/// One joint of the scene.
#[derive(Debug, Clone, PartialEq)]
pub struct SceneJoint {
    /// The merged joint.
    pub joint: Articulation,
    /// Indices of the clips that show it, in order.
    pub clips: Vec<usize>,
    /// The grip when closed: mean over the clips.
    pub grip: Point,
    /// Probability of the type, all clips together.
    pub type_probability: f64,
}

/// Groups clips that show one joint: same closed grip, same face, in any order of time.
///
/// The type is not asked: two clips that hold the same handle of the same face show the same joint even where one of
/// them was read wrongly; the merge then decides.
#[must_use]
pub fn group(members: &[Member], config: &config::Inference) -> Vec<Vec<usize>> {
    let mut groups: Vec<Vec<usize>> = Vec::new();
    for (i, member) in members.iter().enumerate() {
        let nearest = groups
            .iter_mut()
            .filter(|g| g.iter().all(|&j| same_part(&members[j], member, config)))
            .min_by(|a, b| grip_distance(a, members, member).total_cmp(&grip_distance(b, members, member)));
        match nearest {
            Some(group) if config.merge_clips => group.push(i),
            _ => groups.push(vec![i]),
        }
    }
    groups
}

fn grip_distance(group: &[usize], members: &[Member], member: &Member) -> f64 {
    group.iter().map(|&j| (members[j].joint.grip - member.joint.grip).norm()).fold(f64::INFINITY, f64::min)
}

fn same_part(a: &Member, b: &Member, config: &config::Inference) -> bool {
    let angle = config.merge_angle_deg.to_radians();
    let faces_agree = match (a.face, b.face) {
        (Some(fa), Some(fb)) => signed_angle(&fa.normal, &fb.normal) <= angle,
        _ => true,
    };
    // A part is opened and closed in turn: two openings in a row are two parts unless their grips nearly coincide.
    let same_action = a.joint.action == b.joint.action;
    let limit = if same_action { 0.6 * config.merge_grip_m } else { config.merge_grip_m };
    faces_agree && (a.joint.grip - b.joint.grip).norm() <= limit
}

/// Merges one group. The type goes to the larger sum of log-odds; the axis is the consensus (each member tried as the
/// seed, the heaviest agreement wins) averaged by PCA; the origin is averaged on it.
#[must_use]
pub fn merge(members: &[Member], group: &[usize]) -> Option<SceneJoint> {
    // One overconfident clip must not outvote two others.
    const MAX_LOG_ODDS: f64 = 3.9;
    let log_odds: f64 = group
        .iter()
        .map(|&i| {
            let j = members[i].joint;
            let p = j.type_probability.clamp(0.5, 1.0 - 1e-9);
            let odds = (p / (1.0 - p)).ln().min(MAX_LOG_ODDS);
            if j.joint.kind == JointKind::Revolute { odds } else { -odds }
        })
        .sum();
    let kind = if log_odds >= 0.0 { JointKind::Revolute } else { JointKind::Prismatic };
    let of_kind: Vec<&ClipJoint> = group.iter().map(|&i| members[i].joint).filter(|j| j.joint.kind == kind).collect();
    let weight = |j: &ClipJoint| j.axis_probability / (1.02 - j.axis_probability.min(1.0)) * j.observed_range.max(1e-3);
    let agrees = |a: &ClipJoint, b: &ClipJoint| {
        unsigned_angle(&a.joint.axis, &b.joint.axis) < 10f64.to_radians()
            && (kind == JointKind::Prismatic || a.joint.line().distance(&b.joint.origin) < 0.12)
    };
    let support = |seed: &ClipJoint| of_kind.iter().filter(|j| agrees(seed, j)).map(|j| weight(j)).sum::<f64>();
    let seed = of_kind.iter().max_by(|a, b| support(a).total_cmp(&support(b)))?;
    let mut consensus: Vec<&ClipJoint> = of_kind.iter().copied().filter(|j| agrees(seed, j)).collect();
    consensus.sort_by(|a, b| weight(b).total_cmp(&weight(a)));
    let axis = mean_direction(&consensus.iter().map(|j| (j.joint.axis, weight(j))).collect::<Vec<_>>())?;
    // The sense by the heavier side of the members.
    let sense: f64 = consensus.iter().map(|j| j.joint.axis.dot(&axis) * weight(j)).sum();
    let axis = if sense < 0.0 { -axis } else { axis };
    let total: f64 = consensus.iter().map(|j| weight(j)).sum();
    let anchor = consensus.first()?.joint.origin;
    let origin = consensus.iter().fold(crate::math::Vector::zeros(), |sum, j| {
        // Hinges are compared where they pass the first one's origin: along the axis an origin is free.
        let on_axis = if kind == JointKind::Revolute { j.joint.line().project(&anchor) } else { j.joint.origin };
        sum + on_axis.coords * (weight(j) / total)
    });
    let grips: Vec<Point> = group.iter().map(|&i| members[i].joint.grip).collect();
    Some(SceneJoint {
        joint: Articulation { kind, axis, origin: Point::from(origin) },
        clips: group.iter().map(|&i| members[i].clip).collect(),
        grip: crate::math::centroid(&grips)?,
        type_probability: 1.0 / (1.0 + (-log_odds.abs()).exp()),
    })
}

/// Members by clip index, for reports.
#[must_use]
pub fn joint_of_clip(joints: &[SceneJoint]) -> BTreeMap<usize, usize> {
    joints.iter().enumerate().flat_map(|(j, s)| s.clips.iter().map(move |&c| (c, j))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::articulation::Action;
    use crate::geometry::AxisSource;
    use crate::math::{Vector, rotation};

    fn clip(kind: JointKind, tilt: f64, origin: Point, grip: Point, action: Action, p: f64) -> ClipJoint {
        ClipJoint {
            joint: Articulation { kind, axis: rotation(&Vector::x(), tilt) * Vector::z(), origin },
            contact_pivot: origin,
            source: AxisSource::Line,
            type_probability: p,
            axis_probability: 0.9,
            residual_m: 0.01,
            inliers: 1.0,
            radius_m: None,
            observed_range: 1.0,
            grip,
            action,
        }
    }

    #[test]
    fn an_outlier_does_not_move_the_merged_hinge() {
        let grip = Point::new(0.5, 0.0, 1.0);
        let clips = [
            clip(JointKind::Revolute, 0.02, Point::new(0.01, 0.0, 0.2), grip, Action::Open, 0.9),
            clip(JointKind::Revolute, -0.02, Point::new(-0.01, 0.0, 1.7), grip, Action::Close, 0.9),
            clip(JointKind::Revolute, 0.0, Point::new(0.6, 0.0, 1.0), grip, Action::Open, 0.9),
            clip(JointKind::Prismatic, 0.0, grip, grip, Action::Close, 0.7),
        ];
        let members: Vec<Member> =
            clips.iter().enumerate().map(|(i, j)| Member { clip: i, joint: j, face: None }).collect();
        let groups = group(&members, &config::Inference::default());
        assert_eq!(groups, [vec![0, 1, 2, 3]]);
        let merged = merge(&members, &groups[0]).unwrap();
        assert_eq!(merged.joint.kind, JointKind::Revolute);
        assert!(merged.joint.line().distance(&Point::new(0.0, 0.0, 1.0)) < 0.03, "{merged:?}");
    }

    #[test]
    fn drawers_of_a_stack_stay_apart() {
        let clips = [
            clip(JointKind::Prismatic, 0.0, Point::origin(), Point::new(0.0, 0.0, 0.7), Action::Open, 0.9),
            clip(JointKind::Prismatic, 0.0, Point::origin(), Point::new(0.0, 0.0, 0.5), Action::Open, 0.9),
            clip(JointKind::Prismatic, 0.0, Point::origin(), Point::new(0.0, 0.02, 0.52), Action::Close, 0.9),
        ];
        let members: Vec<Member> =
            clips.iter().enumerate().map(|(i, j)| Member { clip: i, joint: j, face: None }).collect();
        assert_eq!(group(&members, &config::Inference::default()), [vec![0], vec![1, 2]]);
    }
}
