//! `predictions.json` and `ground_truth.json`.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::articulation::{Action, JointKind};
use crate::error::{Error, Result};
use crate::inference::Uncertainty;
use crate::json;
use crate::math::{Point, Pose, Vector, length, plain, rounded, unit};
use crate::twin::OrientedBox;

/// All predictions of a file.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Predictions {
    /// One row a clip; a clip left out or of type null is a missed detection.
    pub predictions: Vec<Prediction>,
}

/// The step after which a clip had no answer.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Stage {
    /// No hand, or too little of it.
    Hands,
    /// The hand is known, the furniture is not.
    Localization,
    /// The furniture is known; no joint explains the hand.
    Inference,
}

/// The prediction for one clip.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Prediction {
    /// Name of the recording.
    pub recording: String,
    /// Name of the clip.
    pub clip: String,
    /// Motion type; null = no answer. A file without the key is another program's, not one without answers.
    #[serde(rename = "type", deserialize_with = "said")]
    pub kind: Option<JointKind>,
    /// Unit axis, world; positive opens.
    #[serde(default)]
    pub axis: Option<Vector>,
    /// Point on the hinge nearest to the middle of the part.
    #[serde(default)]
    pub origin: Option<Point>,
    /// The paper's origin: the hand centroid's projection on the hinge (§A.7).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub contact_pivot: Option<Point>,
    /// Opening that the clip went through, rad or m.
    #[serde(default)]
    pub range: Option<f64>,
    /// Standard deviation of `range`, rad or m.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub range_std: Option<f64>,
    /// How sure axis and hinge are, and the largest opening of the joint; of the clip's own opening `range_std` tells.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub uncertainty: Option<Uncertainty>,
    /// Box of the moving part, closed.
    #[serde(default)]
    pub part_box: Option<OrientedBox>,
    /// Probability that the answer's type is right.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub confidence: Option<f64>,
    /// Probability that type, axis and origin are right.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub joint_confidence: Option<f64>,
    /// Which joint of the scene.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub joint: Option<String>,
    /// Why there is no answer.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reason: Option<String>,
    /// Where the answer was lost, if there is none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stage: Option<Stage>,
    /// What physics says against ways in which the part could move, where it was asked.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub refuted: Vec<String>,
    /// Of a scene of several recordings: all of the row is in its world. Else it is in the recording's own.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub in_scene: Option<InScene>,
}

/// The scene of several recordings that a prediction is part of.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct InScene {
    /// Its name.
    pub scene: String,
    /// Its world to that of the prediction's recording.
    pub own_from_scene: Pose,
}

impl Prediction {
    /// The same in the world of its own recording, where the truth is.
    #[must_use]
    pub fn in_own_world(&self) -> Self {
        let Some(InScene { own_from_scene: pose, .. }) = &self.in_scene else { return self.clone() };
        Self {
            axis: self.axis.map(|axis| pose * axis),
            origin: self.origin.map(|p| pose * p),
            contact_pivot: self.contact_pivot.map(|p| pose * p),
            part_box: self.part_box.map(|b| b.moved(pose)),
            uncertainty: self.uncertainty.clone().map(|u| Uncertainty { across: u.across.map(|a| pose * a), ..u }),
            ..self.clone()
        }
    }
}

/// A value that may be null, but has to be there.
fn said<'de, D: serde::Deserializer<'de>>(deserializer: D) -> std::result::Result<Option<JointKind>, D::Error> {
    Option::deserialize(deserializer)
}

/// Whether a pose that was read is one.
fn is_rigid(pose: &Pose) -> bool {
    let finite = pose.translation.vector.iter().all(|x| x.is_finite());
    finite && (pose.rotation.coords.norm() - 1.0).abs() < 1e-6
}

/// What is wrong with the opening that a clip went through, rad or m.
fn range_fault(kind: JointKind, range: f64) -> Option<String> {
    // Less than nothing by rounding is nothing.
    const ROUNDING: f64 = 1e-6;
    // Nothing of a kitchen slides as far as a room is long.
    const ROOM_M: f64 = 10.0;
    if !range.is_finite() {
        Some(format!("{} is not finite", plain(range)))
    } else if range < -ROUNDING {
        Some(format!(
            "{} is negative: how far the clip opened or closed the part is wanted; the axis says which way opens",
            plain(range)
        ))
    } else if kind == JointKind::Revolute && range > std::f64::consts::TAU {
        Some(format!("{} rad is more than a whole turn: are these degrees?", plain(range)))
    } else if kind == JointKind::Prismatic && range > ROOM_M {
        Some(format!("{} m is longer than a room: are these millimetres or centimetres?", plain(range)))
    } else {
        None
    }
}

/// What is wrong with a point of the world, metres.
fn place_fault(point: &Point) -> Option<String> {
    // Coordinates of maps are as large.
    const FARTHEST_M: f64 = 1e8;
    let far = length(&point.coords);
    if !far.is_finite() {
        return Some("is not finite".to_owned());
    }
    (far > FARTHEST_M)
        .then(|| format!("lies {} m from the world's origin, farther than anything on Earth", rounded(far, 0)))
}

impl Predictions {
    /// Reads a file and checks its rows.
    pub fn read(path: &Path) -> Result<Self> {
        let mut all: Self = json::read(path)?;
        let mut seen = std::collections::BTreeSet::new();
        for (i, p) in all.predictions.iter_mut().enumerate() {
            let place = format!("predictions[{i}] ({}/{})", p.recording, p.clip);
            if !seen.insert((p.recording.clone(), p.clip.clone())) {
                return Err(Error::format(path, place, "this clip has a row already; one row a clip"));
            }
            if let Some(b) = &p.part_box {
                let orthonormal = (b.rotation.transpose() * b.rotation - nalgebra::Matrix3::identity()).norm() < 1e-3;
                if !orthonormal || !b.half.iter().all(|h| h.is_finite() && *h > 0.0) {
                    let message = "part_box: half sizes must be positive, the columns of R orthonormal";
                    return Err(Error::format(path, place, message));
                }
            }
            for (name, value) in [("confidence", p.confidence), ("joint_confidence", p.joint_confidence)] {
                if value.is_some_and(|v| !(0.0..=1.0).contains(&v)) {
                    return Err(Error::format(path, place, format!("{name} must be a probability, from 0 to 1")));
                }
            }
            if p.range_std.is_some_and(|std| !std.is_finite() || std <= 0.0) {
                return Err(Error::format(path, place, "range_std must be finite and positive"));
            }
            if p.in_scene.as_ref().is_some_and(|s| !is_rigid(&s.own_from_scene)) {
                let message = "in_scene: own_from_scene must be finite, its rotation a quaternion of length 1";
                return Err(Error::format(path, place, message));
            }
            let Some(kind) = p.kind else { continue };
            if let Some(fault) = p.range.and_then(|range| range_fault(kind, range)) {
                return Err(Error::format(path, place, format!("range: {fault}")));
            }
            let axis = p.axis.and_then(|a| unit(&a)).ok_or_else(|| {
                Error::format(path, place.clone(), "a prediction with a type needs a finite axis that is not zero")
            })?;
            p.axis = Some(axis);
            if let Some(Err(fault)) = p.uncertainty.as_ref().map(|u| u.check(&axis)) {
                return Err(Error::format(path, place, format!("uncertainty: {fault}")));
            }
            for (name, point) in [
                ("origin", p.origin),
                ("contact_pivot", p.contact_pivot),
                ("part_box: center", p.part_box.map(|b| b.center)),
            ] {
                if let Some(fault) = point.and_then(|point| place_fault(&point)) {
                    return Err(Error::format(path, place, format!("{name}: {fault}")));
                }
            }
        }
        Ok(all)
    }
}

/// The truth of one recording.
#[derive(Debug, Clone, PartialEq)]
pub struct Truth {
    /// Name of the recording.
    pub recording: String,
    /// How noisy the recording is, as its maker calls it; else the word for it in the recording's name.
    pub tier: Option<String>,
    /// The place that was recorded, as all recordings of it call it, with the same joints; `None` where nobody says so.
    pub place: Option<String>,
    /// Every narrated clip; `None` where it moves no joint.
    pub clips: BTreeMap<String, Option<TrueClip>>,
}

/// How a hinge lies.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Orientation {
    /// Within 37 degrees of up.
    Upright,
    /// Within 12 degrees of level.
    Level,
    /// Between the two.
    Other,
}

impl Orientation {
    /// Of a unit axis; `up` is unit.
    #[must_use]
    pub fn of(axis: &Vector, up: &Vector) -> Self {
        match axis.dot(up).abs() {
            along if along > 0.8 => Self::Upright,
            along if along < 0.2 => Self::Level,
            _ => Self::Other,
        }
    }

    /// The word for people.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Upright => "upright",
            Self::Level => "level",
            Self::Other => "other",
        }
    }
}

/// What a clip really shows.
#[derive(Debug, Clone, PartialEq)]
pub struct TrueClip {
    /// Id of the joint.
    pub joint: String,
    /// Motion type.
    pub kind: JointKind,
    /// Unit axis; positive opens.
    pub axis: Vector,
    /// Projection of the closed part's box centre on the hinge; for a slide the box centre.
    pub origin: Point,
    /// Projection of the closed handle on the hinge.
    pub origin_handle: Point,
    /// Opening that the clip went through, rad or m.
    pub moved: f64,
    /// Box of the moving part, closed; `None` where the truth has no shapes.
    pub part_box: Option<OrientedBox>,
    /// Box of the furniture without its moving parts.
    pub base_box: Option<OrientedBox>,
    /// The handle when closed.
    pub handle: Option<Point>,
    /// What people call the furniture.
    pub noun: Option<String>,
    /// Opening or closing.
    pub action: Option<Action>,
    /// How a hinge lies; `None` for slides.
    pub orientation: Option<Orientation>,
}

/// Words for how noisy a recording is that are looked for in its name.
const TIERS: [&str; 9] = ["clean", "realistic", "hard", "t0", "t1", "t2", "t3", "hd", "short"];

#[derive(Deserialize)]
struct TruthFile {
    #[serde(default)]
    tier: Option<String>,
    #[serde(default)]
    up: Option<Vector>,
    #[serde(default)]
    kitchen: Option<String>,
    joints: Vec<TrueJoint>,
    clips: Vec<TruthClip>,
}

#[derive(Deserialize)]
struct TrueJoint {
    id: String,
    #[serde(rename = "type")]
    kind: JointKind,
    axis: Vector,
    origin: Point,
    origin_handle: Point,
    part_box: OrientedBox,
    #[serde(default)]
    base_box: Option<OrientedBox>,
    #[serde(default)]
    handle_closed: Option<Point>,
    #[serde(default)]
    noun: Option<String>,
}

#[derive(Deserialize)]
struct TruthClip {
    clip: String,
    joint: String,
    #[serde(default)]
    action: Option<Action>,
    x: Vec<f64>,
}

#[derive(Deserialize)]
struct ClipNames {
    clips: Vec<crate::recording::Clip>,
}

impl Truth {
    /// Reads a recording's folder (`ground_truth.json` beside `clips.json`), or such a file.
    pub fn read(path: &Path) -> Result<Self> {
        let (dir, file) = if path.is_dir() {
            (path.to_owned(), path.join("ground_truth.json"))
        } else {
            (path.parent().unwrap_or(Path::new(".")).to_owned(), path.to_owned())
        };
        let truth: TruthFile = json::read(&file)?;
        let names: ClipNames = json::read(&dir.join("clips.json"))?;
        let recording = dir
            .canonicalize()
            .ok()
            .and_then(|d| d.file_name().map(|n| n.to_string_lossy().into_owned()))
            .ok_or_else(|| Error::format(&file, "folder", "has no name"))?;
        let up = truth.up.and_then(|up| unit(&up)).unwrap_or_else(Vector::z);
        let tier = truth.tier.or_else(|| tier_in(&recording));
        let mut clips: BTreeMap<String, Option<TrueClip>> = names.clips.into_iter().map(|c| (c.clip, None)).collect();
        for clip in truth.clips {
            let place = format!("clip {}", clip.clip);
            let joint =
                truth.joints.iter().find(|j| j.id == clip.joint).ok_or_else(|| {
                    Error::format(&file, place.clone(), format!("joint {} is not in joints", clip.joint))
                })?;
            let axis = unit(&joint.axis).ok_or_else(|| Error::format(&file, place.clone(), "the axis is zero"))?;
            let low = clip.x.iter().copied().fold(f64::INFINITY, f64::min);
            let high = clip.x.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            let entry = TrueClip {
                joint: joint.id.clone(),
                kind: joint.kind,
                axis,
                origin: joint.origin,
                origin_handle: joint.origin_handle,
                moved: if high >= low { high - low } else { 0.0 },
                part_box: Some(joint.part_box),
                base_box: joint.base_box,
                handle: joint.handle_closed,
                noun: joint.noun.clone(),
                action: clip.action,
                orientation: (joint.kind == JointKind::Revolute).then(|| Orientation::of(&axis, &up)),
            };
            clips.insert(clip.clip, Some(entry));
        }
        Ok(Self { recording, tier, place: truth.kitchen, clips })
    }
}

/// Reads something of each of several recordings, in their order, and tells why others are left out: one that cannot be read
/// costs only itself.
///
/// # Errors
/// That of the only recording.
pub fn read_each<T>(recordings: &[PathBuf], read: impl Fn(&Path) -> Result<T>) -> Result<(Vec<T>, Vec<Error>)> {
    let (mut found, mut left_out) = (Vec::new(), Vec::new());
    for folder in recordings {
        match read(folder) {
            Ok(one) => found.push(one),
            Err(error) if recordings.len() == 1 => return Err(error),
            Err(error) => left_out.push(error),
        }
    }
    Ok((found, left_out))
}

/// The word for how noisy a recording is in its name.
fn tier_in(recording: &str) -> Option<String> {
    let name = recording.to_lowercase();
    let mut words = name.split(|c: char| !c.is_ascii_alphanumeric());
    words.find(|w| TIERS.contains(w)).map(str::to_owned)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_recording_that_cannot_be_read_costs_only_itself() {
        let folders = ["a", "b", "c"].map(PathBuf::from);
        let read = |folder: &Path| match folder.to_str() {
            Some("b") => Err(Error::format(folder, "file", "is broken")),
            name => Ok(name.map(str::to_owned)),
        };
        let (found, left_out) = read_each(&folders, read).unwrap();
        assert_eq!(found, [Some("a".to_owned()), Some("c".to_owned())]);
        assert_eq!(left_out.len(), 1);
        assert!(read_each(&folders[1..2], read).is_err());
        assert!(read_each(&[], read).unwrap().0.is_empty());
    }

    #[test]
    fn a_tier_is_a_word_of_the_name_not_a_part_of_one() {
        assert_eq!(tier_in("apartment_Hard").as_deref(), Some("hard"));
        assert_eq!(tier_in("T2-0013").as_deref(), Some("t2"));
        assert_eq!(tier_in("hardware_store"), None);
    }

    #[test]
    fn a_row_of_a_scene_is_judged_in_its_recordings_own_world() {
        let turn = crate::math::rotation(&Vector::z(), std::f64::consts::FRAC_PI_2);
        let own_from_scene = Pose::from_parts(Vector::new(0.0, 0.0, 1.0).into(), turn);
        let row = Prediction {
            kind: Some(JointKind::Prismatic),
            axis: Some(Vector::x()),
            origin: Some(Point::new(2.0, 0.0, 0.0)),
            in_scene: Some(InScene { scene: "s".to_owned(), own_from_scene }),
            ..Prediction::default()
        };
        let own = row.in_own_world();
        assert!((own.axis.unwrap() - Vector::y()).norm() < 1e-12);
        assert!((own.origin.unwrap() - Point::new(0.0, 2.0, 1.0)).norm() < 1e-12);
        let alone = Prediction { in_scene: None, ..row.clone() };
        assert_eq!(alone.in_own_world(), alone);
        // Written and read back as it is; a pose that is none is told.
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("p.json");
        let all = Predictions { predictions: vec![row] };
        std::fs::write(&path, crate::json::text(&all).unwrap()).unwrap();
        assert_eq!(Predictions::read(&path).unwrap(), all);
        let mut broken = all;
        let long = nalgebra::Unit::new_unchecked(nalgebra::Quaternion::new(2.0, 0.0, 0.0, 0.0));
        let pose = Pose::from_parts(Vector::zeros().into(), long);
        broken.predictions[0].in_scene = Some(InScene { scene: "s".to_owned(), own_from_scene: pose });
        std::fs::write(&path, crate::json::text(&broken).unwrap()).unwrap();
        assert!(Predictions::read(&path).unwrap_err().to_string().contains("own_from_scene"));
    }

    #[test]
    fn confidences_are_probabilities() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("p.json");
        let row = r#"{"predictions": [{"recording": "r", "clip": "c", "type": null, "joint_confidence": 1.2}]}"#;
        std::fs::write(&path, row).unwrap();
        let error = Predictions::read(&path).unwrap_err().to_string();
        assert!(error.contains("r/c") && error.contains("joint_confidence"), "{error}");
        std::fs::write(&path, row.replace("\"joint_confidence\": 1.2", "\"stage\": \"localization\"")).unwrap();
        assert_eq!(Predictions::read(&path).unwrap().predictions[0].stage, Some(Stage::Localization));
    }

    #[test]
    fn a_row_needs_a_type_or_null_and_an_opening_that_a_part_can_have() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("p.json");
        for (rest, words) in [
            ("", "predictions[0] (r/c): the key \"type\" is missing"),
            (", \"type\": null, \"range\": 90", ""),
            (", \"type\": \"revolute\", \"axis\": [0,0,1], \"range\": 1.6", ""),
            (", \"type\": \"revolute\", \"axis\": [0,0,1], \"range\": 90", "range: 90 rad is more than a whole turn"),
            (", \"type\": \"prismatic\", \"axis\": [0,0,1], \"range\": 380", "range: 380 m is longer than a room"),
            (", \"type\": \"prismatic\", \"axis\": [0,0,1], \"range\": -0.3", "range: -0.3 is negative"),
            (
                ", \"type\": \"prismatic\", \"axis\": [0,0,1], \"range\": [0, 1]",
                "range: a list of 2 is given, a number",
            ),
        ] {
            let text = format!("{{\"predictions\": [{{\"recording\": \"r\", \"clip\": \"c\"{rest}}}]}}");
            std::fs::write(&path, text).unwrap();
            let error = Predictions::read(&path).err().map(|e| e.to_string()).unwrap_or_default();
            assert!(error.contains(words) && error.is_empty() == words.is_empty(), "{rest}: {error}");
        }
    }

    #[test]
    fn what_is_said_about_errors_can_be_worked_with() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("p.json");
        let row = r#"{"predictions": [{"recording": "r", "clip": "c", "type": "revolute", "axis": [0, 0, 2],
            "range_std": 0.1, "uncertainty": {"across": [[1, 0, 0], [0, 1, 0]], "axis_cov_rad2": [[1e-3, 0], [0, 1e-3]],
            "observed_range_std": 0.1}}]}"#;
        std::fs::write(&path, row).unwrap();
        let read = Predictions::read(&path).unwrap();
        assert_eq!(read.predictions[0].uncertainty.as_ref().unwrap().origin_cov_m2, None);
        for (good, bad, word) in [
            ("\"range_std\": 0.1, \"u", "\"range_std\": 0, \"u", "range_std"),
            ("[0, 1, 0]]", "[0, 0, 1]]", "across"),
            ("[0, 1e-3]]", "[0, -1e-3]]", "axis_cov_rad2"),
        ] {
            assert!(row.contains(good));
            std::fs::write(&path, row.replace(good, bad)).unwrap();
            let error = Predictions::read(&path).unwrap_err().to_string();
            assert!(error.contains("r/c") && error.contains(word), "{error}");
        }
    }
}
