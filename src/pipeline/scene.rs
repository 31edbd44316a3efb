//! Clips of one part to one joint of the scene (§C.2).

use rayon::prelude::*;

use super::group::Group;
use super::{ClipResult, SceneJoint, Told, method, told};
use crate::articulation::Action;
use crate::config::Config;
use crate::hands::{self, Trajectory};
use crate::inference::grouping;
use crate::inference::same_part::{Name, Sight};
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
    let held: Vec<grouping::Held> = seen
        .iter()
        .zip(paths.iter().zip(&named))
        .map(|((_, clip, hand), (path, named))| held(clip, hand, path, named.as_ref(), config))
        .collect();
    let unseen = unseen(&seen, clips);
    let missed: Vec<grouping::Missed> = unseen
        .iter()
        .map(|lost| grouping::Missed { after: lost.after, action: lost.action, name: Name::of(lost.named.as_ref()) })
        .collect();
    let grouped = grouping::group(&held, &missed, config);
    let groups: Vec<Vec<usize>> = grouped
        .parts
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
    let name = |clip: usize| clips[clip].clip.clip.clone();
    let ties = grouped.ties.iter().map(|tie| Told {
        clip: name(unseen[tie.missed].clip),
        with: name(seen[tie.with].0),
        action: tie.action,
    });
    told::tie(&mut joints, ties, clips);
    joints
}

/// What a clip with a hand shows of the part that it moves.
fn held<'a>(
    clip: &'a ClipResult,
    hand: &Trajectory,
    path: &'a [Point],
    named: Option<&'a narration::Reading>,
    config: &Config,
) -> grouping::Held<'a> {
    let joint = clip.joint.found().filter(|j| sure(j.type_probability, config)).map(|j| j.joint);
    grouping::Held {
        sight: Sight {
            grip: hand.closed_grip(),
            grip_std_m: hands::grip_std_m(hand.closed_end_seen(), &config.hands.grips),
            face: clip.face.filter(|f| !f.is_assumed()),
            outline: clip.part,
            joint,
            name: Name::of(named),
        },
        action: hand.action,
        open: hand.open_grip(),
        open_std_m: hands::grip_std_m(hand.open_end_seen(), &config.hands.grips),
        path,
        voxels: clip.region.as_ref().map_or_else(Default::default, |region| region.voxels.as_slice()),
    }
}

/// What a narration says that names the furniture.
fn naming(clip: &ClipResult) -> Option<narration::Reading> {
    Some(narration::read(&clip.clip)).filter(narration::Reading::names_furniture)
}

/// A clip that moves something without a hand that was followed.
struct Unseen {
    /// Its index.
    clip: usize,
    /// How many of the clips with a hand come before it.
    after: usize,
    /// What its narration says that it does, and what it names.
    action: Option<Action>,
    named: Option<narration::Reading>,
}

/// All of them, in the order of time.
fn unseen(seen: &[(usize, &ClipResult, &Trajectory)], clips: &[ClipResult]) -> Vec<Unseen> {
    let order = |i: usize| (clips[i].clip.start_frame, i);
    let before = |i: usize| seen.partition_point(|(s, ..)| order(*s) < order(i));
    let mut all: Vec<Unseen> = clips
        .iter()
        .enumerate()
        .filter(|(_, clip)| clip.trajectory.is_none())
        .filter_map(|(i, clip)| {
            let reading = narration::read(&clip.clip);
            (reading.moves_joint == Some(true)).then(|| Unseen {
                clip: i,
                after: before(i),
                action: reading.action,
                named: naming(clip),
            })
        })
        .collect();
    all.sort_by_key(|lost| order(lost.clip));
    all
}

/// Groups with their joints, those whose fronts turn out to be one judged `again` together: outlines are known better once all
/// clips of a part were judged together.
fn regrouped(
    mut joints: Vec<(Vec<usize>, SceneJoint)>,
    clips: &[ClipResult],
    again: impl Fn(&[Vec<usize>]) -> Vec<(Vec<usize>, SceneJoint)>,
    config: &Config,
) -> Vec<(Vec<usize>, SceneJoint)> {
    loop {
        let named: Vec<Option<narration::Reading>> =
            joints.iter().map(|(members, _)| members.iter().find_map(|&c| naming(&clips[c]))).collect();
        let fronts: Vec<Option<Sight>> = joints
            .iter()
            .zip(&named)
            .map(|((members, joint), named)| front_of(members, joint, clips, named.as_ref(), config))
            .collect();
        let sets = grouping::same_fronts(&fronts, config);
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
        let merged = again(&groups);
        if merged.len() < groups.len() {
            // Clips that tell nothing together keep what they told alone.
            return joints;
        }
        joints = alone.iter().flatten().map(|&j| joints[j].clone()).chain(merged).collect();
        joints.sort_by_key(|(members, _)| members.first().map(|&c| (clips[c].clip.start_frame, c)));
    }
}

/// What all clips of a part together show of it; none where no front or no outline is known.
fn front_of<'a>(
    members: &[usize],
    joint: &SceneJoint,
    clips: &[ClipResult],
    named: Option<&'a narration::Reading>,
    config: &Config,
) -> Option<Sight<'a>> {
    // The grip is one clip's, and so is how well it was seen.
    let mut hands = members.iter().filter_map(|&c| clips[c].trajectory.as_ref());
    let seen = hands.any(|hand| hand.closed_grip() == joint.grip && hand.closed_end_seen());
    Some(Sight {
        grip: joint.grip,
        grip_std_m: hands::grip_std_m(seen, &config.hands.grips),
        face: Some(joint.face?),
        outline: Some(joint.part?),
        joint: Some(joint.joint).filter(|_| sure(joint.type_probability, config)),
        name: Name::of(named),
    })
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
    let (judged, hypotheses) = method::of(config).part(group, reasoner)?;
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
        type_probability: judged.type_probability,
        joint_probability: judged.joint_probability,
        uncertainty: answer.uncertainty,
        grip: judged.grip,
        face: group.front(judged.best, &answer.joint, &judged.grip),
        part: answer.part,
        observed_range: answer.observed_range,
        moved: answer.moved,
        // Without a posterior there are no shares to tell.
        hypotheses: if judged.joint_probability.is_some() { hypotheses } else { Vec::new() },
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::articulation::{Articulation, JointKind};
    use crate::geometry::{Face, Rect};
    use crate::math::Vector;

    fn face() -> Face {
        let [right, up, normal] = [Vector::x(), Vector::z(), -Vector::y()];
        Face { center: Point::origin(), right, up, normal, extent: [[-0.5, 0.5]; 2], support: 0.5 }
    }

    fn joint(clip: usize) -> SceneJoint {
        SceneJoint {
            id: String::new(),
            joint: Articulation { kind: JointKind::Prismatic, axis: -Vector::y(), origin: Point::origin() },
            clips: vec![clip.to_string()],
            told: Vec::new(),
            furniture: None,
            type_probability: None,
            joint_probability: None,
            uncertainty: None,
            grip: Point::new(clip as f64, 0.0, 0.0),
            face: Some(face()),
            part: Some(Rect { bounds: [[-0.2, 0.2]; 2] }),
            observed_range: 0.0,
            moved: Vec::new(),
            hypotheses: Vec::new(),
        }
    }

    /// Clips with a hand at `(clip, 0, 0)` that is lost in the second one.
    fn clips() -> Vec<ClipResult> {
        let mut all = told::tests::clips(&[("open it", true), ("open it", true)]);
        for (i, clip) in all.iter_mut().enumerate() {
            let hand = clip.trajectory.as_mut().unwrap();
            hand.samples[0].smoothed = Point::new(i as f64, 0.0, 0.0);
            hand.ends_seen = [i == 0; 2];
        }
        all
    }

    #[test]
    fn a_grip_is_as_sure_as_the_hand_of_its_own_clip() {
        let (clips, config) = (clips(), Config::default());
        let std_m = |of: usize| front_of(&[0, 1], &joint(of), &clips, None, &config).unwrap().grip_std_m;
        assert_eq!(std_m(0), config.hands.grips.seen_std_m);
        assert_eq!(std_m(1), config.hands.grips.lost_std_m);
    }

    #[test]
    fn parts_that_turn_out_to_be_one_are_judged_again_and_kept_where_that_tells_nothing() {
        let (clips, config) = (clips(), Config::default());
        let one = |clip: usize| SceneJoint { grip: Point::origin(), ..joint(clip) };
        let two = || vec![(vec![0], one(0)), (vec![1], one(1))];
        let again = |groups: &[Vec<usize>]| {
            assert_eq!(groups, [vec![0, 1]]);
            vec![(vec![0, 1], one(0))]
        };
        assert_eq!(regrouped(two(), &clips, again, &config).len(), 1);
        let kept = regrouped(two(), &clips, |_| Vec::new(), &config);
        assert_eq!(kept.iter().map(|(members, _)| members.clone()).collect::<Vec<_>>(), [vec![0], vec![1]]);
    }
}
