//! Arti4D: `SEQUENCE.json`, a point and an axis for each object; what kind of joint it is stands in `metadata.yaml`.

use std::path::PathBuf;

use serde::Deserialize;
use serde_json::Value;

use super::found::{FoundJoint, JointScene, JointSource, StatedJoint, kind_of};
use super::yaml::{self, Yaml};
use crate::error::Result;

#[derive(Deserialize)]
struct Arti4dObject {
    position: [f64; 3],
    axis: [f64; 3],
    #[serde(rename = "type", alias = "joint_type", alias = "axis_type")]
    kind: Option<String>,
}

pub(super) fn detect(value: &Value) -> bool {
    let has = |object: &Value| object.get("position").is_some() && object.get("axis").is_some();
    value.as_object().is_some_and(|all| !all.is_empty() && all.values().any(has))
}

/// The file of types: the user's, else in the file's folder or one of the two above (SCENE/SEQUENCE/SEQUENCE.json).
fn types_file(source: &JointSource<'_>) -> Option<PathBuf> {
    let mut above = source.path.ancestors().skip(1).take(3).map(|folder| folder.join("metadata.yaml"));
    source.options.types.clone().or_else(|| above.find(|p| p.is_file()))
}

pub(super) fn read(source: &JointSource<'_>) -> Result<JointScene> {
    let mut scene = JointScene::empty(source.path, "arti4d");
    let Some(objects) = source.value.as_object() else {
        return Err(source.fault("the whole file", "an object with a key for each object is wanted"));
    };
    let types = types_file(source).map(|path| yaml::read(&path)).transpose()?;
    // Sequences of several scenes share object names.
    let of_sequence = types.as_ref().map(|all| all.find(&scene.name).unwrap_or(all));
    for (name, value) in objects {
        let listed = of_sequence.and_then(|all| listed(all, name));
        let joint = joint(name, value, listed);
        scene.take(name.clone(), joint);
    }
    Ok(scene)
}

/// An object's word for its type, below its name.
fn listed<'a>(types: &'a Yaml, name: &str) -> Option<&'a str> {
    let entry = types.find(name)?;
    entry.text().or_else(|| entry.find_like("type")?.text())
}

fn joint(name: &str, value: &Value, listed: Option<&str>) -> std::result::Result<FoundJoint, String> {
    let object: Arti4dObject = JointSource::entry(value)?;
    let Some(kind) = object.kind.or_else(|| listed.map(str::to_owned)) else {
        return Err(format!(
            "type: nothing tells whether it is a hinge or a slide; give metadata.yaml (--types FILE), or \"type\": \
             \"revolute\" beside the axis of {name}"
        ));
    };
    kind_of(&kind)?;
    StatedJoint { label: name.to_owned(), kind, axis: object.axis, origin: object.position, range: None }.joint()
}
