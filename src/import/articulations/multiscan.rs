//! MultiScan: `SCAN.annotations.json`; faces of `SCAN.ply` say which part they are.

use std::collections::BTreeMap;

use nalgebra::Matrix3;
use serde::Deserialize;
use serde_json::Value;

use super::found::{FoundJoint, JointScene, JointSource};
use super::shape::{self, PartBox};
use super::stk::StkMotion;
use crate::error::Result;
use crate::import::ply::Cloud;
use crate::math::{Point, Vector};

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct MultiScanPart {
    part_id: i64,
    #[serde(default)]
    label: String,
    parent_id: Option<i64>,
    #[serde(default)]
    articulations: Vec<Value>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct MultiScanObject {
    #[serde(default)]
    label: String,
    #[serde(default)]
    part_ids: Vec<i64>,
    obb: Option<Obb>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Obb {
    centroid: [f64; 3],
    /// Whole lengths.
    axes_lengths: [f64; 3],
    /// By columns.
    normalized_axes: [f64; 9],
}

impl Obb {
    fn shape(&self) -> Option<PartBox> {
        let rotation = Matrix3::from_column_slice(&self.normalized_axes);
        let half = Vector::from(self.axes_lengths) * 0.5;
        let usable = half.iter().all(|h| h.is_finite() && *h > 0.0) && (rotation.determinant() - 1.0).abs() < 0.01;
        usable.then_some(PartBox { center: Point::from(self.centroid), half, rotation })
    }
}

pub(super) fn detect(value: &Value) -> bool {
    let first = value
        .get("parts")
        .and_then(Value::as_array)
        .is_some_and(|parts| parts.is_empty() || parts.iter().any(|p| p.get("partId").is_some()));
    let by_label = value.get("articulations").is_some_and(Value::is_object);
    value.get("objects").is_some_and(Value::is_array) && (first || by_label)
}

pub(super) fn read(source: &JointSource<'_>) -> Result<JointScene> {
    let mut scene = JointScene::empty(source.path, "multiscan");
    scene.name = scene.name.trim_end_matches(".annotations").to_owned();
    if let Some(by_label) = source.value.get("articulations").and_then(Value::as_object) {
        for (label, motion) in by_label {
            let joint = JointSource::entry::<StkMotion>(motion).and_then(|m| m.joint(label.clone()));
            scene.take(format!("articulations.{label}"), joint.map(|(joint, _)| joint));
        }
        scene.notes.push("this version of MultiScan's files does not tell which part a joint moves".to_owned());
        return Ok(scene);
    }
    let parts = parts(source, &mut scene)?;
    let objects: Vec<MultiScanObject> =
        source.list(&["objects"])?.iter().filter_map(|o| JointSource::entry::<MultiScanObject>(o).ok()).collect();
    let cloud = source.cloud(&[format!("{}.ply", scene.name)])?;
    let points = match &cloud {
        Some(cloud) => points_of(&parts, cloud),
        None => {
            scene.notes.push(format!(
                "without {}.ply beside it (or --points FILE.ply), whose faces say which part they are, parts have no boxes",
                scene.name
            ));
            BTreeMap::new()
        }
    };
    for part in &parts {
        for (i, motion) in part.articulations.iter().enumerate() {
            let place = format!("part {} ({}): articulations[{i}]", part.part_id, part.label);
            let moved = cloud.as_ref().zip(points.get(&part.part_id));
            scene.take(place, joint(part, motion, &objects, moved));
        }
    }
    Ok(scene)
}

/// The parts; those that are none are left out.
fn parts(source: &JointSource<'_>, scene: &mut JointScene) -> Result<Vec<MultiScanPart>> {
    let mut parts = Vec::new();
    for (i, value) in source.list(&["parts"])?.iter().enumerate() {
        // Moved parts alone matter.
        match JointSource::entry::<MultiScanPart>(value) {
            Ok(part) => parts.push(part),
            Err(reason) => scene.take(format!("parts[{i}]"), Err(reason)),
        }
    }
    Ok(parts)
}

fn joint(
    part: &MultiScanPart,
    motion: &Value,
    objects: &[MultiScanObject],
    moved: Option<(&Cloud, &Vec<usize>)>,
) -> std::result::Result<FoundJoint, String> {
    let object = objects.iter().find(|o| o.part_ids.contains(&part.part_id));
    let label = match object {
        Some(object) if !object.label.is_empty() && !part.label.contains(':') => {
            format!("{}:{}", object.label, part.label)
        }
        _ => part.label.clone(),
    };
    let motion: StkMotion = JointSource::entry(motion)?;
    let (joint, state) = motion.joint(label)?;
    // The scan shows the part as it stood; boxes are of closed parts.
    let part = moved.and_then(|(cloud, numbers)| {
        let points: Vec<Point> = numbers.iter().filter_map(|i| cloud.points.get(*i)).copied().collect();
        Some(shape::around(&points, &joint.axis)?.moved(&joint.articulation(), -state))
    });
    let base = object.and_then(|o| o.obb.as_ref()?.shape());
    Ok(FoundJoint { part, base, points: moved.map(|(_, numbers)| numbers.clone()), ..joint })
}

/// The points of each part that has a joint, with what is fixed to it: a handle is the door's.
fn points_of(parts: &[MultiScanPart], cloud: &Cloud) -> BTreeMap<i64, Vec<usize>> {
    let by_id: BTreeMap<i64, &MultiScanPart> = parts.iter().map(|p| (p.part_id, p)).collect();
    let owner = |mut id: i64| {
        // No chain is longer than the list.
        for _ in 0..=parts.len() {
            let part = by_id.get(&id)?;
            if !part.articulations.is_empty() {
                return Some(id);
            }
            id = part.parent_id?;
        }
        None
    };
    let mut owners: BTreeMap<i64, Option<i64>> = BTreeMap::new();
    let mut points: BTreeMap<i64, Vec<usize>> = BTreeMap::new();
    for face in &cloud.faces {
        let Some(id) = face.part else { continue };
        if let Some(owner) = *owners.entry(id).or_insert_with(|| owner(id)) {
            let corners = face.corners.iter().copied().filter(|c| *c < cloud.points.len());
            points.entry(owner).or_default().extend(corners);
        }
    }
    for numbers in points.values_mut() {
        numbers.sort_unstable();
        numbers.dedup();
    }
    points
}
