//! Our own: `joints.json`, `articulations.json`, `twin.json`.

use nalgebra::Matrix3;
use serde::Deserialize;
use serde_json::Value;

use super::found::{FoundJoint, JointScene, JointSource, StatedJoint};
use super::shape::PartBox;
use crate::error::Result;
use crate::math::{Point, Vector, unit};

#[derive(Deserialize)]
struct JointFileEntry {
    id: String,
    #[serde(rename = "type", alias = "kind")]
    kind: String,
    axis: [f64; 3],
    origin: [f64; 3],
    range: Option<[f64; 2]>,
    observed_range: Option<f64>,
    part_box: Option<BoxEntry>,
    handle: Option<[f64; 3]>,
    grip: Option<[f64; 3]>,
    joint_probability: Option<f64>,
}

#[derive(Deserialize)]
struct BoxEntry {
    center: [f64; 3],
    half: [f64; 3],
    #[serde(rename = "R")]
    rows: [[f64; 3]; 3],
}

impl BoxEntry {
    fn shape(&self) -> PartBox {
        let [a, b, c] = self.rows;
        PartBox {
            center: Point::from(self.center),
            half: Vector::from(self.half),
            rotation: Matrix3::new(a[0], a[1], a[2], b[0], b[1], b[2], c[0], c[1], c[2]),
        }
    }
}

#[derive(Deserialize)]
struct FurnitureEntry {
    part: TwinPart,
}

#[derive(Deserialize)]
struct TwinPart {
    id: String,
    joint: TwinJoint,
    bounds: BoxEntry,
    handle: [f64; 3],
}

#[derive(Deserialize)]
struct TwinJoint {
    articulation: Articulated,
    upper: f64,
    probability: Option<f64>,
}

#[derive(Deserialize)]
struct Articulated {
    kind: String,
    axis: [f64; 3],
    origin: [f64; 3],
}

/// A recording's truth has joints as well, and clips that show them.
fn is_truth(value: &Value) -> bool {
    match value.get("joints").and_then(|joints| joints.get(0)) {
        Some(joint) => joint.get("origin_handle").is_some(),
        None => value.get("clips").is_some(),
    }
}

pub(super) fn detect(value: &Value) -> bool {
    let list = |key: &str| value.get(key).is_some_and(Value::is_array);
    list("furniture") || (list("joints") && !is_truth(value))
}

pub(super) fn read(source: &JointSource<'_>) -> Result<JointScene> {
    let mut scene = JointScene::empty(source.path, "paws");
    if source.value.get("furniture").is_some() {
        for (i, value) in source.list(&["furniture"])?.iter().enumerate() {
            scene.take(format!("furniture[{i}]"), of_twin(value));
        }
        return Ok(scene);
    }
    let metres = match source.value.get("units").and_then(Value::as_str) {
        Some("cm") => 0.01,
        Some("mm") => 0.001,
        _ => 1.0,
    };
    if let Some(up) =
        source.value.get("up").and_then(|up| JointSource::entry::<Vector>(up).ok()).and_then(|up| unit(&up))
    {
        scene.up = up;
    }
    for (i, value) in source.list(&["joints"])?.iter().enumerate() {
        scene.take(format!("joints[{i}]"), of_entry(value, metres));
    }
    Ok(scene)
}

fn of_entry(value: &Value, metres: f64) -> std::result::Result<FoundJoint, String> {
    let entry: JointFileEntry = JointSource::entry(value)?;
    let long = |p: [f64; 3]| p.map(|x| x * metres);
    let range = entry.range.or(entry.observed_range.map(|upper| [0.0, upper]));
    let slides = super::found::kind_of(&entry.kind)? == crate::articulation::JointKind::Prismatic;
    let range = range.map(|r| if slides { r.map(|q| q * metres) } else { r });
    let joint = StatedJoint { label: entry.id, kind: entry.kind, axis: entry.axis, origin: long(entry.origin), range }
        .joint()?;
    let part = entry.part_box.map(|b| BoxEntry { center: long(b.center), half: long(b.half), ..b }.shape());
    let handle = entry.handle.or(entry.grip).map(|p| Point::from(long(p)));
    Ok(FoundJoint { part, handle, score: entry.joint_probability, ..joint })
}

fn of_twin(value: &Value) -> std::result::Result<FoundJoint, String> {
    let TwinPart { id, joint, bounds, handle } = JointSource::entry::<FurnitureEntry>(value)?.part;
    let Articulated { kind, axis, origin } = joint.articulation;
    let said = StatedJoint { label: id, kind, axis, origin, range: Some([0.0, joint.upper]) }.joint()?;
    Ok(FoundJoint { part: Some(bounds.shape()), handle: Some(Point::from(handle)), score: joint.probability, ..said })
}
