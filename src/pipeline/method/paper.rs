//! The paper's method: every clip by its own rule, clips of one part by RANSAC over their answers. The rules themselves are in
//! [`crate::inference::paper`].

use super::Method;
use crate::articulation::{Articulation, Outcome};
use crate::config::Config;
use crate::geometry::{AxisCandidate, candidates};
use crate::hands::Trajectory;
use crate::inference::{self, ClipJoint, paper, uncertainty};
use crate::math::Point;
use crate::pipeline::closed::{Grip, SeenFront, by_trust};
use crate::pipeline::group::{Around, Group, Judged, Likely, built};
use crate::pipeline::{ClipResult, Hypothesis};
use crate::reasoning::{Answer, Reasoner};
use crate::recording::narration::Reading;

/// The paper's rules.
pub(super) struct Paper;

impl Method for Paper {
    /// It localises clips by depth.
    fn needs_depth(&self) -> bool {
        true
    }

    /// The paper knows no face: its lines and directions stay as they are.
    fn candidates(&self, evidence: &candidates::Evidence, config: &Config) -> Vec<AxisCandidate> {
        candidates::collect(&candidates::Evidence { face: None, ..*evidence }, &config.inference)
    }

    /// The words decide the type, the hand alone the axis: nothing is weighed.
    fn joint(
        &self,
        clip: &ClipResult,
        hand: &Trajectory,
        _answer: &Answer,
        reading: &Reading,
        config: &Config,
    ) -> Outcome<ClipJoint> {
        let told = paper::told(clip.words.as_ref(), reading);
        paper::infer(hand, &clip.candidates, told, clip.face.as_ref(), &config.inference, config.seed)
    }

    /// Of the other clips' hands the paper says nothing: the clip's own hand, and how much of what is near lies on its front.
    fn trust(&self, front: &SeenFront, _grips: &[Grip], config: &Config) -> f64 {
        let thin_support = config.inference.closed.thin_support;
        (front.near_own() * (thin_support + front.face.support) * front.moved).ln()
    }

    /// There is no other way than the answer: nobody computed how likely one would be.
    fn part(&self, group: &Group, _reasoner: &dyn Reasoner) -> Option<(Judged, Vec<Hypothesis>)> {
        let Group { clips, members, config, .. } = *group;
        let best = *by_trust(clips, members, config).first()?;
        let own = clips[best].joint.found()?;
        // One clip alone keeps its own origin.
        let together = if members.len() > 1 { together(group) } else { None };
        let (speaker, joint) = together.unwrap_or((best, own.joint));
        let spoken = clips[speaker].joint.found()?;
        let chosen = uncertainty::chosen(spoken, &clips[speaker].candidates, &config.inference.sources);
        let (type_probability, joint_probability) = (own.type_probability, own.joint_probability);
        let answer = Likely::only(joint, chosen, joint_probability, type_probability);
        let likely = vec![answer];
        let judged = Judged { best, grip: own.grip, settled: false, likely, type_probability, joint_probability };
        let (around, rounds) = (Around::of(group, best), config.inference.scene.rounds);
        let hypotheses = judged.likely.iter().map(|l| built(group, &judged, l, &around, rounds)).collect();
        Some((judged, hypotheses))
    }

    /// Each clip's own: where the one before it left the part is not asked.
    fn moved(&self, shown: &[(&ClipResult, &Trajectory)], joint: &Articulation, _config: &Config) -> Vec<f64> {
        let of = |hand: &Trajectory| inference::observed_range(joint, &hand.closed_grip(), &hand.positions());
        shown.iter().map(|(_, hand)| of(hand)).collect()
    }
}

/// The joint of several clips, and the clip whose answer it is built on.
fn together(group: &Group) -> Option<(usize, Articulation)> {
    let Group { clips, members, config, .. } = *group;
    let (speakers, own): (Vec<usize>, Vec<&ClipJoint>) =
        members.iter().filter_map(|&c| Some((c, clips[c].joint.found()?))).unzip();
    let paths: Vec<Vec<Point>> = group.shown().iter().map(|(_, hand)| hand.positions()).collect();
    let (winner, joint) = paper::together(&own, &paths, &config.inference)?;
    Some((speakers[winner], joint))
}
