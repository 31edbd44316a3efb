//! The result files: `articulations.json`, `predictions.json`.

use serde::Serialize;

use super::words;
use crate::articulation::{Articulation, Outcome};
use crate::evaluation::truth::Stage;
use crate::evaluation::{Prediction, Predictions};
use crate::inference::{ClipJoint, Uncertainty};
use crate::math::Point;
use crate::pipeline::{ClipResult, Scene, Told};
use crate::reasoning::words::Words;
use crate::twin::Twin;

/// One joint of `articulations.json`.
#[derive(Debug, Serialize)]
struct JointEntry<'a> {
    id: &'a str,
    furniture: Option<&'a str>,
    #[serde(flatten)]
    joint: Articulation,
    type_probability: f64,
    observed_range: f64,
    grip: Point,
    clips: &'a [String],
    /// Clips without a hand, by their narrations.
    #[serde(skip_serializing_if = "<[Told]>::is_empty")]
    told: &'a [Told],
    #[serde(skip_serializing_if = "Vec::is_empty")]
    refuted: Vec<String>,
}

/// One clip of `articulations.json`.
#[derive(Debug, Serialize)]
struct ClipEntry<'a> {
    clip: &'a str,
    narration: &'a str,
    joint_of_scene: Option<&'a str>,
    outcome: &'a Outcome<ClipJoint>,
    #[serde(skip_serializing_if = "Option::is_none")]
    words: Option<&'a Words>,
    evidence: Evidence,
}

/// How much of everything there was.
#[derive(Debug, Serialize)]
struct Evidence {
    hand_samples: usize,
    rejected_hand_samples: usize,
    confident_voxels: usize,
    local_frames: Vec<usize>,
    global_views: usize,
    lines: usize,
    candidates: usize,
    face_found: bool,
    part_seen_to_move: bool,
}

#[derive(Debug, Serialize)]
struct ArticulationsFile<'a> {
    recording: &'a str,
    frame: &'static str,
    reasoner: &'a str,
    manhattan: Option<[crate::math::Vector; 3]>,
    joints: Vec<JointEntry<'a>>,
    clips: Vec<ClipEntry<'a>>,
}

/// `articulations.json`: every joint and every clip with its evidence.
///
/// # Errors
/// Where a number cannot be written, which would be a bug.
pub fn articulations(scene: &Scene, reasoner: &str) -> crate::error::Result<String> {
    let file = ArticulationsFile {
        recording: &scene.recording,
        frame: "world of the recording; metres, radians; positive motion opens",
        reasoner,
        manhattan: scene.manhattan.map(|m| m.axes),
        joints: scene
            .joints
            .iter()
            .map(|j| JointEntry {
                id: &j.id,
                furniture: j.furniture.as_deref(),
                joint: j.joint,
                type_probability: j.type_probability,
                observed_range: j.observed_range,
                grip: j.grip,
                clips: &j.clips,
                told: &j.told,
                refuted: words::refuted(j),
            })
            .collect(),
        clips: scene
            .clips
            .iter()
            .map(|c| ClipEntry {
                clip: &c.clip.clip,
                narration: &c.clip.narration,
                joint_of_scene: scene.joint_of(&c.clip.clip).map(|j| j.id.as_str()),
                outcome: &c.joint,
                words: c.words.as_ref(),
                evidence: Evidence {
                    hand_samples: c.trajectory.as_ref().map_or(0, |t| t.samples.len()),
                    rejected_hand_samples: c
                        .trajectory
                        .as_ref()
                        .map_or(0, |t| t.samples.iter().filter(|s| !s.accepted).count()),
                    confident_voxels: c.region.as_ref().map_or(0, |r| r.voxels.len()),
                    local_frames: c.region.as_ref().map_or_else(Vec::new, |r| r.local_frames.clone()),
                    global_views: c.views.len(),
                    lines: c.lines.len(),
                    candidates: c.candidates.len(),
                    face_found: c.face.is_some(),
                    part_seen_to_move: c.part.is_some(),
                },
            })
            .collect(),
    };
    crate::json::text(&file)
}

/// The step that gave a clip up.
fn stage(clip: &ClipResult) -> Stage {
    match (&clip.trajectory, &clip.region) {
        (None, _) => Stage::Hands,
        (_, None) => Stage::Localization,
        _ => Stage::Inference,
    }
}

/// One row a clip: the scene's joint where the clip shows one or is told to move it, the range of the clip that shows it, the
/// twin's box.
#[must_use]
pub fn predictions(scene: &Scene, twin: &Twin) -> Predictions {
    let rows = scene
        .clips
        .iter()
        .map(|c| {
            let mut row = Prediction {
                recording: scene.recording.clone(),
                clip: c.clip.clip.clone(),
                kind: None,
                axis: None,
                origin: None,
                contact_pivot: None,
                range: None,
                range_std: None,
                uncertainty: None,
                part_box: None,
                confidence: None,
                joint_confidence: None,
                joint: None,
                reason: c.joint.reason().map(str::to_owned),
                stage: c.joint.reason().map(|_| stage(c)),
                refuted: Vec::new(),
            };
            let Some((joint, at)) = scene.joint_of(&c.clip.clip).and_then(|j| Some((j, j.shown_by(&c.clip.clip)?)))
            else {
                return row;
            };
            let part = twin.furniture.iter().map(|f| &f.part).find(|p| p.id == joint.id);
            // A joint that could not be built is still an answer.
            let phi = part.map_or(joint.joint, |p| p.joint.articulation);
            let path = c.trajectory.as_ref().map(crate::hands::Trajectory::positions).unwrap_or_default();
            (row.reason, row.stage) = (None, None);
            row.kind = Some(phi.kind);
            row.axis = Some(phi.axis);
            row.origin = Some(phi.origin);
            row.contact_pivot = crate::math::centroid(&path).map(|p| match phi.kind {
                crate::articulation::JointKind::Revolute => phi.line().project(&p),
                crate::articulation::JointKind::Prismatic => path[0],
            });
            let said = joint.uncertainty.as_ref();
            row.range = joint.moved.get(at).copied();
            row.range_std = said.and_then(|u| u.moved_std.get(at).copied());
            // The joint's other clips have rows of their own.
            row.uncertainty = said.map(|u| Uncertainty { moved_std: Vec::new(), ..u.clone().about(&phi.axis) });
            row.part_box = part.map(|p| p.bounds);
            row.confidence = Some(joint.type_probability);
            row.joint_confidence = Some(joint.joint_probability);
            row.joint = Some(joint.id.clone());
            row.refuted = words::refuted(joint);
            row
        })
        .collect();
    Predictions { predictions: rows }
}
