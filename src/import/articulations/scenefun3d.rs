//! SceneFun3D: `VISIT_motions.json`, with the annotated elements (handles, knobs) beside it and the laser scan whose points
//! both count.

use std::collections::BTreeMap;

use serde::Deserialize;
use serde_json::Value;

use super::found::{FoundJoint, JointScene, JointSource, StatedJoint, picked};
use crate::error::Result;
use crate::import::ply::Cloud;
use crate::json;
use crate::math::centroid;

#[derive(Deserialize)]
struct PartMotion {
    motion_id: Option<String>,
    annot_id: String,
    motion_type: String,
    motion_dir: [f64; 3],
    motion_origin_idx: usize,
}

#[derive(Deserialize)]
struct PartAnnotation {
    annot_id: String,
    #[serde(default)]
    indices: Vec<usize>,
    label: Option<String>,
}

pub(super) fn detect(value: &Value) -> bool {
    let motions = value.get("motions").and_then(Value::as_array);
    motions.is_some_and(|m| m.first().is_none_or(|first| first.get("motion_dir").is_some()))
}

pub(super) fn read(source: &JointSource<'_>) -> Result<JointScene> {
    let mut scene = JointScene::empty(source.path, "scenefun3d");
    let prefix = scene.name.trim_end_matches("motions").to_owned();
    scene.name = prefix.trim_end_matches('_').to_owned();
    let motions = source.list(&["motions"])?;
    let Some(cloud) = source.cloud(&[format!("{prefix}laser_scan.ply")])? else {
        return Err(source.fault(
            "motions[0].motion_origin_idx",
            format!("counts the points of {prefix}laser_scan.ply; put it beside this file, or say --points FILE.ply"),
        ));
    };
    let annotations = annotations(source, &prefix, &mut scene)?;
    scene.notes.push("SceneFun3D marks what a hand takes, not the part that moves: parts have no boxes".to_owned());
    for (i, value) in motions.iter().enumerate() {
        scene.take(format!("motions[{i}]"), joint(value, &cloud, &annotations));
    }
    Ok(scene)
}

/// The annotated elements by their ids; none where the file is not there.
fn annotations(
    source: &JointSource<'_>,
    prefix: &str,
    scene: &mut JointScene,
) -> Result<BTreeMap<String, PartAnnotation>> {
    let name = format!("{prefix}annotations.json");
    let Some(path) = source.beside(&name) else {
        scene.notes.push(format!("without {name} beside it nothing tells which points an element has"));
        return Ok(BTreeMap::new());
    };
    let value: Value = json::read(&path)?;
    let list = value.get("annotations").and_then(Value::as_array).map(Vec::as_slice).unwrap_or_default();
    Ok(list
        .iter()
        .filter_map(|a| JointSource::entry::<PartAnnotation>(a).ok())
        .map(|a| (a.annot_id.clone(), a))
        .collect())
}

fn joint(
    value: &Value,
    cloud: &Cloud,
    annotations: &BTreeMap<String, PartAnnotation>,
) -> std::result::Result<FoundJoint, String> {
    let motion: PartMotion = JointSource::entry(value)?;
    let origin = cloud.points.get(motion.motion_origin_idx).ok_or_else(|| {
        format!(
            "motion_origin_idx: {} is beyond the {} points of the laser scan; is it another one?",
            motion.motion_origin_idx,
            cloud.points.len()
        )
    })?;
    let element = annotations.get(&motion.annot_id);
    let label = element.and_then(|e| e.label.clone()).or(motion.motion_id).unwrap_or(motion.annot_id);
    let mut joint = StatedJoint {
        label,
        kind: motion.motion_type,
        axis: motion.motion_dir,
        origin: [origin.x, origin.y, origin.z],
        range: None,
    }
    .joint()?;
    if let Some(element) = element.filter(|e| !e.indices.is_empty()) {
        let mut numbers = element.indices.clone();
        joint.handle = centroid(&picked(cloud, &mut numbers)?);
        joint.points = Some(numbers);
    }
    Ok(joint)
}
