//! Clips of one part to one joint of the scene (§C.2).

use rayon::prelude::*;

use super::group::Group;
use super::{ClipResult, SceneJoint, method, told};
use crate::config::{Config, GroupingMethod};
use crate::hands::Trajectory;
use crate::inference::aggregate;
use crate::localization::Footage;
use crate::math::Point;
use crate::reasoning::Reasoner;
use crate::recording::narration;

/// Whether a joint's hinge tells two parts apart: where its type is sure, or nobody computed how sure it is.
fn sure(type_probability: Option<f64>, config: &Config) -> bool {
    type_probability.is_none_or(|p| p > config.inference.scene.sure)
}

/// Clips to scene-level joints (§C.2).
pub(super) fn merge(
    footage: &Footage,
    clips: &[ClipResult],
    reasoner: &dyn Reasoner,
    config: &Config,
) -> Vec<SceneJoint> {
    // Clips with a hand take part even where they have no answer of their own: what they show counts.
    let mut seen: Vec<(usize, &ClipResult, &Trajectory)> =
        clips.iter().enumerate().filter_map(|(i, c)| c.trajectory.as_ref().map(|t| (i, c, t))).collect();
    // Clips may be listed in any order; people open before they close.
    seen.sort_by_key(|(i, c, _)| (c.clip.start_frame, *i));
    let paths: Vec<Vec<Point>> = seen.iter().map(|(.., trajectory)| trajectory.positions()).collect();
    let named: Vec<Option<narration::Reading>> = seen.iter().map(|(_, clip, _)| naming(clip)).collect();
    let held: Vec<aggregate::Held> = seen
        .iter()
        .zip(paths.iter().zip(&named))
        .map(|((_, clip, trajectory), (path, named))| aggregate::Held {
            action: trajectory.action,
            closed: trajectory.closed_grip(),
            open: trajectory.open_grip(),
            normal: clip.face.filter(|f| !f.is_assumed()).map(|f| f.normal),
            path,
            furniture: named.as_ref().and_then(|r| r.furniture.as_deref()),
            kind: named.as_ref().and_then(|r| r.kind),
            part: clip.face.zip(clip.part),
            joint: clip.joint.found().filter(|j| sure(j.type_probability, config)).map(|j| j.joint),
            voxels: clip.region.as_ref().map_or_else(Default::default, |region| region.voxels.as_slice()),
        })
        .collect();
    let unseen = unseen(&seen, clips);
    let missed: Vec<aggregate::Missed> = unseen
        .iter()
        .map(|(after, furniture)| aggregate::Missed { after: *after, furniture: furniture.as_deref() })
        .collect();
    let groups: Vec<Vec<usize>> = aggregate::group(&held, &missed, &config.inference)
        .into_iter()
        .map(|g| g.into_iter().map(|i| seen[i].0).collect::<Vec<usize>>())
        .filter(|g| g.iter().any(|&c| clips[c].joint.found().is_some()))
        .collect();
    let first = merged(footage, clips, &groups, reasoner, config);
    let again = |groups: &[Vec<usize>]| merged(footage, clips, groups, reasoner, config);
    let mut joints: Vec<SceneJoint> =
        regrouped(first, clips, again, config).into_iter().map(|(_, joint)| joint).collect();
    for (i, joint) in joints.iter_mut().enumerate() {
        joint.id = format!("joint_{i}");
    }
    // Clips without a hand have no voxels: the paper's grouping leaves them out.
    if config.inference.merge_clips && config.inference.grouping == GroupingMethod::Places {
        told::tie(&mut joints, clips);
    }
    joints
}

/// What a narration says that names the furniture.
fn naming(clip: &ClipResult) -> Option<narration::Reading> {
    Some(narration::read(&clip.clip)).filter(narration::Reading::names_furniture)
}

/// Clips that move something without a hand that was followed: how many of `seen` come before each, and the furniture's name.
fn unseen(seen: &[(usize, &ClipResult, &Trajectory)], clips: &[ClipResult]) -> Vec<(usize, Option<String>)> {
    let order = |i: usize| (clips[i].clip.start_frame, i);
    let before = |i: usize| seen.iter().filter(|(s, ..)| order(*s) < order(i)).count();
    clips
        .iter()
        .enumerate()
        .filter(|(_, c)| c.trajectory.is_none() && narration::read(&c.clip).moves_joint == Some(true))
        .map(|(i, c)| (before(i), naming(c).and_then(|r| r.furniture)))
        .collect()
}

/// Groups with their joints, those whose fronts turn out to be one judged `again` together: outlines are known better once all
/// clips of a part were judged together.
fn regrouped(
    mut joints: Vec<(Vec<usize>, SceneJoint)>,
    clips: &[ClipResult],
    again: impl Fn(&[Vec<usize>]) -> Vec<(Vec<usize>, SceneJoint)>,
    config: &Config,
) -> Vec<(Vec<usize>, SceneJoint)> {
    let front = |joint: &SceneJoint| {
        let hung = Some(joint.joint).filter(|_| sure(joint.type_probability, config));
        let (face, rect) = joint.face.zip(joint.part)?;
        Some(aggregate::Front { face, rect, grip: joint.grip, joint: hung })
    };
    loop {
        let fronts: Vec<Option<aggregate::Front>> = joints.iter().map(|(_, joint)| front(joint)).collect();
        let sets = aggregate::same_fronts(&fronts, &config.inference);
        if sets.len() == joints.len() {
            return joints;
        }
        let (alone, together): (Vec<_>, Vec<_>) = sets.into_iter().partition(|set| set.len() == 1);
        let groups: Vec<Vec<usize>> = together
            .iter()
            .map(|set| {
                let mut members: Vec<usize> = set.iter().flat_map(|&j| joints[j].0.iter().copied()).collect();
                members.sort_by_key(|&c| (clips[c].clip.start_frame, c));
                members
            })
            .collect();
        joints = alone.iter().flatten().map(|&j| joints[j].clone()).chain(again(&groups)).collect();
        joints.sort_by_key(|(members, _)| members.first().map(|&c| (clips[c].clip.start_frame, c)));
    }
}

/// The groups that have a joint, and it.
fn merged(
    footage: &Footage,
    clips: &[ClipResult],
    groups: &[Vec<usize>],
    reasoner: &dyn Reasoner,
    config: &Config,
) -> Vec<(Vec<usize>, SceneJoint)> {
    groups
        .par_iter()
        .filter_map(|members| {
            let joint = merge_group(&Group { footage: *footage, clips, members, config }, reasoner)?;
            Some((members.clone(), joint))
        })
        .collect()
}

/// One part's joint, and how else it could move.
fn merge_group(group: &Group, reasoner: &dyn Reasoner) -> Option<SceneJoint> {
    let Group { clips, members, config, .. } = *group;
    let (look, hypotheses) = method::of(config).part(group, reasoner)?;
    let answer = hypotheses.first()?.clone();
    Some(SceneJoint {
        id: String::new(),
        joint: answer.joint,
        clips: members.iter().map(|&c| clips[c].clip.clip.clone()).collect(),
        told: Vec::new(),
        // Where people said "it", a model may have seen what it was.
        furniture: members
            .iter()
            .find_map(|&c| narration::read(&clips[c].clip).furniture)
            .or_else(|| members.iter().find_map(|&c| clips[c].words.as_ref()?.furniture.clone())),
        type_probability: look.type_probability,
        joint_probability: look.joint_probability,
        uncertainty: answer.uncertainty,
        grip: look.grip,
        face: group.front(look.best, &answer.joint, &look.grip),
        part: answer.part,
        observed_range: answer.observed_range,
        moved: answer.moved,
        // Without a posterior there are no shares to tell.
        hypotheses: if look.joint_probability.is_some() { hypotheses } else { Vec::new() },
    })
}
