//! One clip: what it shows, what was predicted, how far that is off, and what became of it.

use std::collections::BTreeMap;

use serde::Serialize;

use super::bootstrap::ClipCluster;
use super::failures::Failure;
use super::rules::{AnswerErrors, Rule, measure};
use super::truth::{Orientation, Prediction, TrueClip, Truth};
use crate::articulation::{Action, JointKind};

/// One clip's line in the report.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ClipReport {
    /// Recording.
    pub recording: String,
    /// Clip.
    pub clip: String,
    /// True joint.
    pub joint: String,
    /// True type.
    pub kind: JointKind,
    /// How a true hinge lies.
    pub orientation: Option<Orientation>,
    /// Opening or closing.
    pub action: Option<Action>,
    /// How noisy the recording is.
    pub tier: Option<String>,
    /// What people call the furniture.
    pub noun: Option<String>,
    /// The place that was recorded, where the truth names it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub place: Option<String>,
    /// Joint of the scene that the prediction puts the clip on.
    pub predicted_joint: Option<String>,
    /// The scene of several recordings that this joint is of.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub predicted_scene: Option<String>,
    /// Confidence in the type.
    pub confidence: Option<f64>,
    /// Confidence in the joint.
    pub joint_confidence: Option<f64>,
    /// Distances and angles; null where there was no answer.
    pub measured: Option<AnswerErrors>,
    /// What became of it.
    pub failure: Failure,
    /// Why there was no answer.
    pub reason: Option<String>,
}

impl ClipReport {
    /// Compares the prediction for a clip, where there is one, with what the clip shows.
    pub(super) fn new(truth: &Truth, name: &str, clip: &TrueClip, prediction: Option<&Prediction>) -> Self {
        let measured = prediction.and_then(|p| measure(p, clip));
        Self {
            recording: truth.recording.clone(),
            clip: name.to_owned(),
            joint: clip.joint.clone(),
            kind: clip.kind,
            orientation: clip.orientation,
            action: clip.action,
            tier: truth.tier.clone(),
            noun: clip.noun.clone(),
            place: truth.place.clone(),
            predicted_joint: prediction.and_then(|p| p.joint.clone()),
            predicted_scene: prediction.and_then(|p| p.in_scene.as_ref()).map(|s| s.scene.clone()),
            confidence: prediction.and_then(|p| p.confidence),
            joint_confidence: prediction.and_then(|p| p.joint_confidence),
            failure: Failure::of(prediction, measured.as_ref()),
            measured,
            reason: prediction.and_then(|p| p.reason.clone()),
        }
    }

    /// The place whose joints it shows: the one that was recorded, else the recording.
    #[must_use]
    pub fn home(&self) -> &str {
        self.place.as_deref().unwrap_or(&self.recording)
    }

    /// `[M, MA, MAO]` under a rule; no answer is wrong.
    #[must_use]
    pub fn judge(&self, rule: Rule) -> [bool; 3] {
        self.measured.as_ref().map_or([false; 3], |m| rule.judge(m))
    }
}

/// Values of clips (by index) summed over the clips of each joint of each place.
pub(super) fn clusters(clips: &[ClipReport], value: impl Fn(usize) -> f64) -> Vec<ClipCluster> {
    let mut of_joints: BTreeMap<(&str, &str), ClipCluster> = BTreeMap::new();
    for (i, c) in clips.iter().enumerate() {
        let cluster = of_joints.entry((c.home(), c.joint.as_str())).or_insert(ClipCluster { sum: 0.0, clips: 0 });
        cluster.sum += value(i);
        cluster.clips += 1;
    }
    of_joints.into_values().collect()
}
