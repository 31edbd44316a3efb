//! Joints that other programs and data sets have, as arguments and as twins.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use clap::Args;
use serde_json::Value;

use super::shown;
use crate::articulation::JointKind;
use crate::config::Config;
use crate::evaluation::scenes::oriented;
use crate::fitting::joints::{self, Entry, JointsFile, Units};
use crate::import::articulations::shape::PartBox;
use crate::import::articulations::{self, FoundJoint, JointOptions, JointScene};
use crate::json;
use crate::math::Vector;
use crate::model::{self, furniture};
use crate::twin::{LeftOut, OrientedBox, Part, Twin};

/// How far a hinge is taken to open where its file does not say, radians: 110 degrees, as our own.
const HINGE_RAD: f64 = 110.0 * std::f64::consts::PI / 180.0;
/// How much of its depth a slide is taken to open where its file does not say, as our own.
const SLIDE_SHARE: f64 = 0.8;

/// Arguments about joints of other programs.
#[derive(Debug, Clone, Default, Args)]
pub struct JointArgs {
    /// Format of joints found elsewhere, where the file does not tell it: paws, artipoint, multiscan, scenefun3d, articulate3d,
    /// mobility, s2o, arti4d
    #[arg(long, value_name = "FORMAT")]
    from: Option<String>,
    /// Reconstruction whose points the file counts, or which is to be labelled (PLY) [default: the one beside the file]
    #[arg(long, value_name = "FILE")]
    pub points: Option<PathBuf>,
    /// Arti4D's metadata.yaml, which tells hinges from slides [default: the one in the folders above]
    #[arg(long, value_name = "FILE")]
    types: Option<PathBuf>,
}

impl JointArgs {
    /// Whether a format is forced.
    pub fn is_forced(&self) -> bool {
        self.from.is_some()
    }

    /// The same for predictions, whose format a forced one does not have to be.
    pub fn of_prediction(&self) -> Self {
        Self { from: None, ..self.clone() }
    }

    /// The joints of a file or folder, or of a URDF or MJCF file; what was taken for granted is told.
    pub fn read(&self, path: &Path) -> anyhow::Result<JointScene> {
        if self.from.is_none() && is_model(path) {
            return of_model(path);
        }
        let options = JointOptions { points: self.points.clone(), types: self.types.clone() };
        let scene = articulations::read(path, self.from.as_deref(), &options)?;
        for note in &scene.notes {
            eprintln!("{}: {note}", shown(path));
        }
        Ok(scene)
    }

    /// The twin of joints found elsewhere, in our own format or in another one, and up in their file's frame.
    pub fn twin(&self, path: &Path) -> anyhow::Result<(Twin, Vector)> {
        let config = Config::default();
        if self.from.is_none() && is_ours(path)? {
            return of_ours(path, &config);
        }
        let scene = self.read(path)?;
        let mut left_out: Vec<LeftOut> =
            scene.left_out.iter().map(|left| LeftOut { id: left.place.clone(), reason: left.reason.clone() }).collect();
        let mut file = JointsFile { scene: scene.name.clone(), up: scene.up, units: Units::M, joints: Vec::new() };
        for joint in &scene.joints {
            // Alone first: what is wrong with one joint costs that joint.
            let built = entry(joint, &scene).and_then(|entry| buildable(&entry, &file, &config).map(|()| entry));
            match built {
                Ok(entry) => file.joints.push(entry),
                Err(reason) => left_out.push(LeftOut { id: joint.id.clone(), reason }),
            }
        }
        if file.joints.is_empty() {
            let reasons: Vec<String> =
                left_out.iter().take(3).map(|left| format!("{}: {}", left.id, left.reason)).collect();
            bail!("{}: no joint of it can be built: {}", shown(path), reasons.join("; "));
        }
        let mut twin = joints::from_joints(&file, &config.fitting, &config.priors).with_context(|| shown(path))?;
        twin.left_out.extend(left_out);
        Ok((twin, file.up))
    }
}

/// The twin of a file in our own format, and up in its frame. Where fewer than half of its joints are wrong they cost
/// themselves; a file of which more is wrong is in another unit, frame or format, and is refused with its first fault.
fn of_ours(path: &Path, config: &Config) -> anyhow::Result<(Twin, Vector)> {
    let whole = json::read::<JointsFile>(path).map_err(anyhow::Error::from);
    let whole = whole.and_then(|file| {
        let twin = joints::from_joints(&file, &config.fitting, &config.priors).with_context(|| shown(path))?;
        Ok((twin, file.up))
    });
    let refused = match whole {
        Ok(built) => return Ok(built),
        Err(refused) => refused,
    };
    let mut value: Value = json::read(path)?;
    let Some(Value::Array(all)) = value.get_mut("joints").map(Value::take) else { return Err(refused) };
    value["joints"] = Value::Array(Vec::new());
    let Ok(mut file) = json::of_value::<JointsFile>(&value) else { return Err(refused) };
    let mut left_out = Vec::new();
    let mut ids = BTreeSet::new();
    for (i, joint) in all.iter().enumerate() {
        let built = json::of_value::<Entry>(joint).and_then(|entry| {
            buildable(&entry, &file, config)?;
            if ids.insert(entry.id.clone()) { Ok(entry) } else { Err("id: is used twice".to_owned()) }
        });
        match built {
            Ok(entry) => file.joints.push(entry),
            Err(reason) => {
                let id = joint.get("id").and_then(Value::as_str).filter(|id| !id.is_empty());
                left_out.push(LeftOut { id: id.map_or_else(|| format!("joints[{i}]"), str::to_owned), reason });
            }
        }
    }
    if 2 * left_out.len() >= all.len() {
        return Err(refused);
    }
    let mut twin = joints::from_joints(&file, &config.fitting, &config.priors).with_context(|| shown(path))?;
    twin.left_out.extend(left_out);
    Ok((twin, file.up))
}

/// Whether a joint can be built, were it alone in its file; why not, behind its name.
fn buildable(entry: &Entry, file: &JointsFile, config: &Config) -> Result<(), String> {
    let alone = JointsFile { joints: vec![entry.clone()], ..file.clone() };
    joints::from_joints(&alone, &config.fitting, &config.priors).map(|_| ()).map_err(|e| {
        let said = e.to_string();
        said.strip_prefix(&format!("export: joint {}: ", entry.id)).map_or_else(|| said.clone(), str::to_owned)
    })
}

/// Whether a file is a URDF or MJCF, by its name.
pub fn is_model(path: &Path) -> bool {
    path.is_file() && path.extension().is_some_and(|e| e.eq_ignore_ascii_case("urdf") || e.eq_ignore_ascii_case("xml"))
}

/// The joints of a URDF or MJCF file in its world frame, closed.
fn of_model(path: &Path) -> anyhow::Result<JointScene> {
    let (twin, notes) = furniture::to_twin(&model::read(path)?);
    for note in &notes {
        eprintln!("{}: {note}", shown(path));
    }
    let joint = |part: &Part| {
        let (phi, bounds) = (part.joint.articulation, part.bounds);
        FoundJoint {
            id: part.id.clone(),
            label: part.label.clone(),
            kind: phi.kind,
            axis: phi.axis,
            origin: phi.origin,
            range: Some([0.0, part.joint.upper]),
            part: Some(PartBox { center: bounds.center, half: bounds.half, rotation: bounds.rotation }),
            base: None,
            handle: Some(part.handle),
            points: None,
            score: None,
        }
    };
    Ok(JointScene {
        name: twin.name.clone(),
        format: "model",
        up: Vector::z(),
        joints: twin.furniture.iter().map(|f| joint(&f.part)).collect(),
        left_out: twin
            .left_out
            .iter()
            .map(|left| articulations::UnusableJoint { place: left.id.clone(), reason: left.reason.clone() })
            .collect(),
        notes: Vec::new(),
    })
}

/// Whether a file is in our own format, which is read to the letter.
fn is_ours(path: &Path) -> anyhow::Result<bool> {
    if path.is_dir() {
        return Ok(false);
    }
    let value: Value = json::read(path)?;
    Ok(value.get("joints").is_some() && value.get("clips").is_none())
}

/// Whether a path is joints rather than a twin or its folder. What is no JSON is for the reader of joints to tell.
pub fn is_joints(path: &Path) -> bool {
    if path.is_dir() {
        return !path.join("twin.json").exists() && articulations::holds(path);
    }
    let is_json = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("json"));
    path.is_file() && is_json && !json::read::<Value>(path).is_ok_and(|v| v.get("furniture").is_some())
}

/// A joint in our own format.
fn entry(joint: &FoundJoint, scene: &JointScene) -> Result<Entry, String> {
    let Some(part) = joint.part.as_ref().map(oriented) else {
        return Err(format!(
            "part_box: is missing: {} tells no shape of this part; write its box in our own format (docs/joints-format.md)",
            scene.format
        ));
    };
    let range = joint.range.unwrap_or_else(|| [0.0, usual(joint, &part)]);
    Ok(Entry {
        id: joint.id.clone(),
        kind: Some(joint.kind.name().to_owned()),
        axis: Some(joint.axis),
        origin: Some(joint.origin),
        range: Some(range),
        part_box: Some(part),
        handle: joint.handle,
        front: None,
        base_box: joint.base.as_ref().map(oriented),
        label: Some(joint.label.clone()),
        boxes: Vec::new(),
    })
}

/// How far a part is taken to open, rad or m.
fn usual(joint: &FoundJoint, part: &OrientedBox) -> f64 {
    match joint.kind {
        JointKind::Revolute => HINGE_RAD,
        JointKind::Prismatic => {
            let along: Vector = part.rotation.transpose() * joint.axis;
            SLIDE_SHARE * 2.0 * along.abs().dot(&part.half)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_joint_without_a_part_says_what_it_needs_and_one_without_a_range_opens_as_usual() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.json");
        std::fs::write(
            &path,
            r#"{"joints": [{"id": "d", "type": "prismatic", "axis": [0,1,0], "origin": [0,0,1],
            "part_box": {"center": [0,0,1], "half": [0.3,0.25,0.1], "R": [[1,0,0],[0,1,0],[0,0,1]]}}], "clips": []}"#,
        )
        .unwrap();
        let args = JointArgs::default();
        let scene = args.read(&path).unwrap();
        let made = entry(&scene.joints[0], &scene).unwrap();
        assert!((made.range.unwrap()[1] - 0.4).abs() < 1e-12);
        let bare = FoundJoint { part: None, ..scene.joints[0].clone() };
        assert!(entry(&bare, &scene).unwrap_err().starts_with("part_box: is missing: paws"));
        let (twin, up) = args.twin(&path).unwrap();
        assert_eq!((twin.furniture.len(), up), (1, Vector::z()));
    }

    #[test]
    fn a_wrong_joint_among_right_ones_costs_itself() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.json");
        let joint = |id: &str, x: f64, axis: &str| {
            format!(
                r#"{{"id": "{id}", "type": "prismatic", "axis": {axis}, "origin": [{x},0,1], "range": [0, 0.3],
                "part_box": {{"center": [{x},0,1], "half": [0.3,0.25,0.1], "R": [[1,0,0],[0,1,0],[0,0,1]]}}}}"#
            )
        };
        let twin = |wrong: &[String]| {
            let good = [joint("a", 0.0, "[0,1,0]"), joint("b", 2.0, "[0,1,0]")];
            let text = format!(r#"{{"scene": "s", "joints": [{}]}}"#, [&good[..], wrong].concat().join(","));
            std::fs::write(&path, text).unwrap();
            JointArgs::default().twin(&path).map(|(twin, _)| twin).map_err(|e| format!("{e:#}"))
        };
        for (wrong, id, reason) in [
            (joint("c", 4.0, "[0,0,0]"), "c", "axis: has length 0.0000"),
            (joint("a", 4.0, "[0,1,0]"), "a", "id: is used twice"),
            (joint("c", 4.0, "[0,1,0]").replace("\"R\"", "\"Q\""), "c", "part_box: the key \"R\" is missing"),
            ("7".to_owned(), "joints[2]", "the number 7 is given"),
        ] {
            let made = twin(&[wrong]).unwrap();
            assert_eq!((made.furniture.len(), made.left_out.len()), (2, 1), "{:?}", made.left_out);
            assert!(made.left_out[0].id == id && made.left_out[0].reason.contains(reason), "{:?}", made.left_out);
        }
        let two = [joint("c", 4.0, "[0,0,0]"), joint("d", 6.0, "[0,2,0]")];
        assert!(twin(&two).unwrap_err().contains("joint c: axis: has length 0"), "half of the joints are wrong");
    }
}
