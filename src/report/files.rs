//! The result files: `articulations.json`, `predictions.json`.

use serde::Serialize;

use super::phrases;
use crate::articulation::{Articulation, Outcome};
use crate::evaluation::truth::{InScene, Stage};
use crate::evaluation::{Prediction, Predictions};
use crate::inference::{ClipJoint, Uncertainty};
use crate::math::Point;
use crate::pipeline::{ClipResult, Scene, Told};
use crate::reasoning::words::Words;
use crate::recording::Videos;
use crate::twin::Twin;

/// One joint of `articulations.json`.
#[derive(Debug, Serialize)]
struct JointEntry<'a> {
    id: &'a str,
    furniture: Option<&'a str>,
    #[serde(flatten)]
    joint: Articulation,
    /// `null` where nobody computed one.
    type_probability: Option<f64>,
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
    /// First and last frame.
    frames: [usize; 2],
    narration: &'a str,
    #[serde(skip_serializing_if = "str::is_empty")]
    verb: &'a str,
    joint_of_scene: Option<&'a str>,
    outcome: &'a Outcome<ClipJoint>,
    #[serde(skip_serializing_if = "Option::is_none")]
    words: Option<&'a Words>,
    evidence: EvidenceCounts,
}

/// How much of everything there was.
#[derive(Debug, Serialize)]
struct EvidenceCounts {
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
    #[serde(skip_serializing_if = "Videos::is_empty")]
    videos: &'a Videos,
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
        videos: &scene.videos,
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
                refuted: phrases::refuted(j),
            })
            .collect(),
        clips: scene
            .clips
            .iter()
            .map(|c| ClipEntry {
                clip: &c.clip.clip,
                frames: [c.clip.start_frame, c.clip.end_frame],
                narration: &c.clip.narration,
                verb: &c.clip.verb,
                joint_of_scene: scene.joint_of(&c.clip.clip).map(|j| j.id.as_str()),
                outcome: &c.joint,
                words: c.words.as_ref(),
                evidence: EvidenceCounts {
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
        // Without depth nothing is localised and all of it inferred.
        (_, None) if clip.candidates.is_empty() => Stage::Localization,
        _ => Stage::Inference,
    }
}

/// One row a clip: the scene's joint where the clip shows one or is told to move it, the range of the clip that shows it, the
/// twin's box. Clips of a joined recording have the names of their own recording and of their clip there.
#[must_use]
pub fn predictions(scene: &Scene, twin: &Twin) -> Predictions {
    let rows = scene
        .clips
        .iter()
        .map(|c| {
            let of_video = scene.videos.of_clip(&c.clip.clip);
            let mut row = Prediction {
                recording: of_video.map_or(&scene.recording, |(video, _)| &video.name).clone(),
                clip: of_video.map_or(c.clip.clip.as_str(), |(_, own)| own).to_owned(),
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
                in_scene: of_video.map(|(video, _)| InScene {
                    scene: scene.recording.clone(),
                    own_from_scene: video.scene_from_own.inverse(),
                }),
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
            row.confidence = joint.type_probability;
            row.joint_confidence = joint.joint_probability;
            row.joint = Some(joint.id.clone());
            row.refuted = phrases::refuted(joint);
            row
        })
        .collect();
    Predictions { predictions: rows }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::articulation::JointKind;
    use crate::math::Vector;
    use crate::pipeline::SceneJoint;
    use crate::recording::Clip;

    /// A drawer seen to open by 30 cm, told to close, and a clip that nobody can place.
    #[test]
    fn a_told_clip_has_the_row_of_the_clip_that_shows_its_joint() {
        let clip = |name: &str| {
            let [narration, verb, noun] = [(); 3].map(|()| String::new());
            let clip = Clip { clip: name.to_owned(), start_frame: 0, end_frame: 9, narration, verb, noun };
            ClipResult::unanswered(clip, "no hand was detected in the clip".to_owned())
        };
        let joint = Articulation { kind: JointKind::Prismatic, axis: -Vector::y(), origin: Point::origin() };
        let drawer = SceneJoint {
            id: "joint_0".to_owned(),
            joint,
            clips: vec!["other".to_owned(), "seen".to_owned()],
            told: vec![Told {
                clip: "told".to_owned(),
                with: "seen".to_owned(),
                action: crate::articulation::Action::Close,
            }],
            furniture: None,
            type_probability: Some(0.9),
            joint_probability: Some(0.8),
            uncertainty: None,
            grip: Point::origin(),
            face: None,
            part: None,
            observed_range: 0.3,
            moved: vec![0.2, 0.3],
            hypotheses: vec![],
        };
        let scene = Scene {
            recording: "kitchen".to_owned(),
            manhattan: None,
            depth_factors: crate::recording::DepthFactors::default(),
            videos: Default::default(),
            clips: ["other", "seen", "told", "lost"].map(clip).to_vec(),
            joints: vec![drawer],
            surroundings: None,
        };
        let twin = Twin::of(Vec::new());
        let rows = predictions(&scene, &twin).predictions;
        let (told, seen, lost) = (&rows[2], &rows[1], &rows[3]);
        assert_eq!((told.kind, told.range, told.joint_confidence), (Some(JointKind::Prismatic), Some(0.3), Some(0.8)));
        assert_eq!(Prediction { clip: seen.clip.clone(), ..told.clone() }, *seen);
        // Its own reason for having no answer is none any more; that of a clip that nothing is told of stays.
        assert!(told.reason.is_none() && told.stage.is_none() && told.contact_pivot.is_none());
        assert!(lost.kind.is_none() && lost.stage == Some(Stage::Hands) && lost.reason.is_some());
        let written: serde_json::Value = serde_json::from_str(&articulations(&scene, "words").unwrap()).unwrap();
        assert_eq!(written["joints"][0]["told"][0]["clip"], "told");
        assert_eq!(written["clips"][2]["joint_of_scene"], "joint_0");
        assert!(written["clips"][3]["joint_of_scene"].is_null());
    }
}
