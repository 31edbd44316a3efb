//! Predicted motions of S2O (`opmotion/MODEL-PART.json`, or its parts as a list) and of OPD (a list, one entry a detection).

use serde::Deserialize;
use serde_json::Value;

use super::found::{FoundJoint, JointScene, JointSource, StatedJoint};
use crate::error::Result;

#[derive(Deserialize)]
struct Short {
    mtype: Value,
    morigin: [f64; 3],
    maxis: [f64; 3],
    image_id: Option<Value>,
    score: Option<f64>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Long {
    id: Option<Value>,
    cat: Option<String>,
    motion_type: Option<String>,
    motion_axis: Option<[f64; 3]>,
    motion_origin: Option<[f64; 3]>,
}

fn is_motion(value: &Value) -> bool {
    let has = |keys: [&str; 2]| keys.iter().all(|key| value.get(key).is_some());
    has(["mtype", "maxis"]) || has(["motionType", "motionAxis"])
}

pub(super) fn detect(value: &Value) -> bool {
    is_motion(value) || value.as_array().and_then(|list| list.first()).is_some_and(is_motion)
}

pub(super) fn read(source: &JointSource<'_>) -> Result<JointScene> {
    let mut scene = JointScene::empty(source.path, "s2o");
    let name = scene.name.clone();
    let Some(list) = source.value.as_array() else {
        if let Some(joint) = joint(source.value, &name).transpose() {
            scene.take(name, joint);
        }
        return Ok(scene);
    };
    if list.iter().any(|entry| entry.get("image_id").is_some()) {
        scene
            .notes
            .push("OPD predicts in the camera of each image: joints of several images share no frame".to_owned());
    }
    for (i, entry) in list.iter().enumerate() {
        if let Some(joint) = joint(entry, &format!("part_{i}")).transpose() {
            scene.take(format!("[{i}]"), joint);
        }
    }
    Ok(scene)
}

/// `None` for parts that do not move.
fn joint(value: &Value, name: &str) -> std::result::Result<Option<FoundJoint>, String> {
    if value.get("mtype").is_some() {
        let short: Short = JointSource::entry(value)?;
        let kind = match &short.mtype {
            Value::Number(n) if n.as_f64() == Some(0.0) => "revolute".to_owned(),
            Value::Number(n) if n.as_f64() == Some(1.0) => "prismatic".to_owned(),
            Value::String(word) => word.clone(),
            other => return Err(format!("mtype: {other} is neither 0 (a hinge) nor 1 (a slide)")),
        };
        let label = match &short.image_id {
            Some(image) => format!("image {}, {name}", text(image)),
            None => name.to_owned(),
        };
        let said = StatedJoint { label, kind, axis: short.maxis, origin: short.morigin, range: None };
        return Ok(Some(FoundJoint { score: short.score.filter(|s| s.is_finite()), ..said.joint()? }));
    }
    let long: Long = JointSource::entry(value)?;
    let Some(kind) = long.motion_type.filter(|kind| kind != "fixed") else { return Ok(None) };
    let axis = long.motion_axis.ok_or("motionAxis: is missing")?;
    let origin = long.motion_origin.ok_or("motionOrigin: is missing")?;
    let id = long.id.as_ref().map_or_else(|| name.to_owned(), text);
    let label = long.cat.map_or_else(|| id.clone(), |cat| format!("{cat} {id}"));
    StatedJoint { label, kind, axis, origin, range: None }.joint().map(Some)
}

fn text(value: &Value) -> String {
    value.as_str().map_or_else(|| value.to_string(), str::to_owned)
}
