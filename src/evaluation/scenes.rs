//! Joints of one file against joints of another: which belong together, and the rows that the rules judge.

use super::truth::{Orientation, Prediction, TrueClip, Truth};
use crate::articulation::JointKind;
use crate::import::articulations::shape::PartBox;
use crate::import::articulations::{FoundJoint, JointScene};
use crate::math::{Point, Vector};
use crate::twin::OrientedBox;

/// Joints farther apart are not taken for each other, metres: as far as a large door is wide.
const MOST_APART_M: f64 = 1.0;
/// Where nothing but a line is known of a hinge, its origin may lie anywhere along it: that far counts this much only.
const ALONG: f64 = 0.1;

/// Which prediction belongs to which joint of the truth; each to one at the most.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Pairing {
    /// For each joint of the truth its prediction's number.
    pub predicted: Vec<Option<usize>>,
    /// Predictions that belong to none.
    pub extra: Vec<usize>,
}

/// Pairs joints: by the points that parts have in common where both list their points, else the nearest ones, within a metre,
/// by parts, handles or lines. Types and axes have no say.
#[must_use]
pub fn pair(predicted: &[FoundJoint], truth: &[FoundJoint]) -> Pairing {
    let mut all: Vec<(f64, usize, usize)> = Vec::new();
    for (t, joint) in truth.iter().enumerate() {
        for (p, other) in predicted.iter().enumerate() {
            all.extend(cost(other, joint).map(|cost| (cost, t, p)));
        }
    }
    all.sort_by(|a, b| a.0.total_cmp(&b.0).then((a.1, a.2).cmp(&(b.1, b.2))));
    let mut found = vec![None; truth.len()];
    let mut taken = vec![false; predicted.len()];
    for (_, t, p) in all {
        if found[t].is_none() && !taken[p] {
            (found[t], taken[p]) = (Some(p), true);
        }
    }
    Pairing { predicted: found, extra: (0..predicted.len()).filter(|p| !taken[*p]).collect() }
}

/// How little two joints have to do with each other: below 1 where points are shared, else 1 and the distance, metres.
fn cost(a: &FoundJoint, b: &FoundJoint) -> Option<f64> {
    if let (Some(of_a), Some(of_b)) = (&a.points, &b.points) {
        let both = common(of_a, of_b);
        return (both > 0).then(|| 1.0 - iou(both, of_a.len(), of_b.len()));
    }
    let apart = apart(a, b);
    (apart <= MOST_APART_M).then_some(1.0 + apart)
}

fn apart(a: &FoundJoint, b: &FoundJoint) -> f64 {
    let body = |j: &FoundJoint| j.part.map(|part| part.center).or(j.handle);
    if let (Some(a), Some(b)) = (body(a), body(b)) {
        return (a - b).norm();
    }
    let between = (a.place() - b.place()).norm();
    if a.kind == JointKind::Prismatic || b.kind == JointKind::Prismatic {
        return between;
    }
    let line = |j: &FoundJoint| j.articulation().line();
    line(a).distance(&b.origin).max(line(b).distance(&a.origin)) + ALONG * between
}

/// How many numbers two rising lists share.
#[must_use]
pub fn common(a: &[usize], b: &[usize]) -> usize {
    let (mut i, mut j, mut count) = (0, 0, 0);
    while let (Some(x), Some(y)) = (a.get(i), b.get(j)) {
        count += usize::from(x == y);
        i += usize::from(x <= y);
        j += usize::from(y <= x);
    }
    count
}

/// Intersection over union of sets by their sizes.
#[must_use]
pub fn iou(common: usize, a: usize, b: usize) -> f64 {
    common as f64 / (a + b).saturating_sub(common).max(1) as f64
}

/// A part's box as the twin has boxes.
#[must_use]
pub fn oriented(part: &PartBox) -> OrientedBox {
    OrientedBox { center: part.center, half: part.half, rotation: part.rotation }
}

/// The axis that opens, by the range's longer side, and how far the joint opens, rad or m.
fn opening(joint: &FoundJoint) -> (Vector, Option<f64>) {
    match joint.range {
        Some([low, high]) if -low > high => (-joint.axis, Some(high - low)),
        Some([low, high]) => (joint.axis, Some(high - low)),
        None => (joint.axis, None),
    }
}

/// A joint of the truth as the rules judge it.
#[must_use]
pub fn true_clip(joint: &FoundJoint, up: &Vector) -> TrueClip {
    let (axis, moved) = opening(joint);
    let turns = joint.kind == JointKind::Revolute;
    let on_hinge = |p: Point| if turns { joint.articulation().line().project(&p) } else { p };
    TrueClip {
        joint: joint.id.clone(),
        kind: joint.kind,
        axis,
        origin: joint.origin,
        origin_handle: joint.handle.map_or(joint.origin, on_hinge),
        moved: moved.unwrap_or(0.0),
        part_box: joint.part.as_ref().map(oriented),
        base_box: joint.base.as_ref().map(oriented),
        handle: joint.handle,
        noun: None,
        action: None,
        orientation: turns.then(|| Orientation::of(&axis, up)),
    }
}

/// A predicted joint as an answer about a joint of the truth.
#[must_use]
pub fn answer(joint: &FoundJoint, truth: &FoundJoint, recording: &str) -> Prediction {
    let (axis, range) = opening(joint);
    Prediction {
        recording: recording.to_owned(),
        clip: truth.id.clone(),
        kind: Some(joint.kind),
        axis: Some(axis),
        origin: Some(joint.origin),
        // Against a truth without a range there is nothing to hold it.
        range: range.filter(|_| truth.range.is_some()),
        part_box: joint.part.as_ref().map(oriented),
        joint_confidence: joint.score.filter(|s| (0.0..=1.0).contains(s)),
        joint: Some(joint.id.clone()),
        ..Prediction::default()
    }
}

/// A scene of the truth with the answers about it: one "clip" a joint.
#[must_use]
pub fn rows(predicted: &JointScene, truth: &JointScene) -> (Vec<Prediction>, Truth, Pairing) {
    let pairing = pair(&predicted.joints, &truth.joints);
    let answers = truth.joints.iter().zip(&pairing.predicted).filter_map(|(joint, p)| {
        let found = predicted.joints.get((*p)?)?;
        Some(answer(found, joint, &truth.name))
    });
    let answers: Vec<Prediction> = answers.collect();
    let clips = truth.joints.iter().map(|j| (j.id.clone(), Some(true_clip(j, &truth.up)))).collect();
    (answers, Truth { recording: truth.name.clone(), tier: None, place: None, clips }, pairing)
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// An upright hinge through `(x, 0, 1)`, or a slide along z there.
    pub(in crate::evaluation) fn joint(id: &str, kind: JointKind, x: f64, points: Option<Vec<usize>>) -> FoundJoint {
        FoundJoint {
            id: id.to_owned(),
            label: id.to_owned(),
            kind,
            axis: Vector::z(),
            origin: Point::new(x, 0.0, 1.0),
            range: None,
            part: None,
            base: None,
            handle: None,
            points,
            score: None,
        }
    }

    pub(in crate::evaluation) fn scene(name: &str, joints: Vec<FoundJoint>) -> JointScene {
        JointScene {
            name: name.to_owned(),
            format: "paws",
            up: Vector::z(),
            joints,
            left_out: Vec::new(),
            notes: Vec::new(),
        }
    }

    #[test]
    fn the_nearest_belong_together_once_each() {
        use JointKind::Revolute;
        let truth = [joint("a", Revolute, 0.0, None), joint("b", Revolute, 0.6, None), joint("c", Revolute, 9.0, None)];
        // Between two, and nearer to the second; its origin far up the line counts little.
        let mut near_b = joint("q", Revolute, 0.5, None);
        near_b.origin.z = 3.0;
        let predicted = [near_b, joint("p", Revolute, 0.1, None), joint("r", Revolute, 0.0, None)];
        let pairing = pair(&predicted, &truth);
        assert_eq!(pairing.predicted, [Some(2), Some(0), None]);
        assert_eq!(pairing.extra, [1]);
    }

    #[test]
    fn shared_points_pair_parts_however_far_their_axes_are() {
        use JointKind::{Prismatic, Revolute};
        let truth = [joint("a", Revolute, 0.0, Some(vec![1, 2, 3, 4]))];
        let predicted =
            [joint("p", Revolute, 0.0, Some(vec![7, 8])), joint("q", Prismatic, 5.0, Some(vec![2, 3, 4, 9]))];
        assert_eq!(pair(&predicted, &truth).predicted, [Some(1)]);
        assert_eq!(common(&[1, 2, 3, 4], &[2, 3, 4, 9]), 3);
        assert!((iou(3, 4, 4) - 0.6).abs() < 1e-12);
    }

    #[test]
    fn a_range_on_the_negative_side_turns_the_axis_around() {
        let mut given = joint("a", JointKind::Revolute, 0.0, None);
        given.range = Some([-1.5, 0.0]);
        let clip = true_clip(&given, &Vector::z());
        assert_eq!((clip.axis, clip.moved), (-Vector::z(), 1.5));
        let free = joint("t", JointKind::Revolute, 0.0, None);
        assert_eq!(answer(&given, &free, "r").range, None);
        assert_eq!(answer(&given, &given, "r").range, Some(1.5));
    }
}
