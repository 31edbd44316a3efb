//! PartNet-Mobility: `mobility_v2.json`; the shapes of its parts are named in `result.json` and lie in `textured_objs`.

use std::collections::BTreeMap;
use std::path::Path;

use serde::Deserialize;
use serde_json::Value;

use super::found::{FoundJoint, JointScene, JointSource, StatedJoint};
use super::shape;
use crate::error::Result;
use crate::import::blob;
use crate::import::text::Lines;
use crate::json;
use crate::math::{Point, Vector};

#[derive(Deserialize)]
struct MobilityLink {
    id: i64,
    joint: String,
    name: Option<String>,
    #[serde(default)]
    parts: Vec<MobilityPart>,
}

#[derive(Deserialize)]
struct MobilityPart {
    id: i64,
}

#[derive(Deserialize)]
struct Data {
    #[serde(rename = "jointData")]
    data: JointData,
}

#[derive(Deserialize)]
struct JointData {
    axis: Axis,
    limit: Limit,
}

#[derive(Deserialize)]
struct Axis {
    origin: [f64; 3],
    direction: [f64; 3],
}

#[derive(Deserialize)]
struct Limit {
    /// Either may be the upper one; degrees of hinges.
    a: Option<f64>,
    b: Option<f64>,
    #[serde(default, rename = "noLimit")]
    no_limit: bool,
}

/// Words for links that do not move on a joint of one degree of freedom, or are not part of the object.
const NO_JOINTS: [&str; 4] = ["static", "free", "heavy", "junk"];

/// Vertices of a part that are read: its box needs no more.
const MAX_VERTICES: usize = 5_000_000;

pub(super) fn detect(value: &Value) -> bool {
    let first = value.as_array().and_then(|list| list.first());
    first.is_some_and(|link| link.get("joint").is_some() && link.get("jointData").is_some())
}

pub(super) fn read(source: &JointSource<'_>) -> Result<JointScene> {
    let mut scene = JointScene::empty(source.path, "mobility");
    let folder = source.path.parent().and_then(|p| p.file_name()).map(|n| n.to_string_lossy().into_owned());
    scene.name = folder.unwrap_or(scene.name);
    // Meshes and axes are as ShapeNet has them.
    scene.up = Vector::y();
    scene.notes.push("lengths of PartNet-Mobility have no unit; they are taken for metres".to_owned());
    let shapes = source.beside("result.json").map(|path| json::read::<Value>(&path)).transpose()?;
    let mut objs = BTreeMap::new();
    match &shapes {
        Some(value) => value.as_array().into_iter().flatten().for_each(|node| named(node, &[], &mut objs)),
        None => scene.notes.push("without result.json and textured_objs beside it parts have no boxes".to_owned()),
    }
    for (i, value) in source.list(&[])?.iter().enumerate() {
        let link: MobilityLink = match JointSource::entry(value) {
            Ok(link) => link,
            Err(reason) => {
                scene.take(format!("[{i}]"), Err(reason));
                continue;
            }
        };
        if NO_JOINTS.contains(&link.joint.as_str()) {
            continue;
        }
        let place = format!("[{i}] ({})", link.name.as_deref().unwrap_or_default());
        let joint = joint(&link, value, &mut scene.notes).and_then(|joint| with_shape(joint, &link, source, &objs));
        scene.take(place, joint);
    }
    Ok(scene)
}

/// The mesh files of every node of the part tree: a node's are those of what is below it, too.
fn named(node: &Value, above: &[i64], objs: &mut BTreeMap<i64, Vec<String>>) {
    let mut chain = above.to_vec();
    chain.extend(node.get("id").and_then(Value::as_i64));
    for name in node.get("objs").and_then(Value::as_array).into_iter().flatten().filter_map(Value::as_str) {
        for id in &chain {
            objs.entry(*id).or_default().push(name.to_owned());
        }
    }
    for child in node.get("children").and_then(Value::as_array).into_iter().flatten() {
        named(child, &chain, objs);
    }
}

fn joint(link: &MobilityLink, value: &Value, notes: &mut Vec<String>) -> std::result::Result<FoundJoint, String> {
    let JointData { axis, limit } = JointSource::entry::<Data>(value)?.data;
    let label = format!("{}_{}", link.name.as_deref().unwrap_or("part"), link.id);
    let kind = link.joint.trim_end_matches('+');
    if kind != link.joint {
        notes.push(format!("{label} slides and turns; its slide is taken"));
    }
    let unit = if kind == "hinge" { std::f64::consts::PI / 180.0 } else { 1.0 };
    let range = match (limit.a, limit.b) {
        (Some(a), Some(b)) if !limit.no_limit => Some([a.min(b) * unit, a.max(b) * unit]),
        _ => None,
    };
    StatedJoint { label, kind: kind.to_owned(), axis: axis.direction, origin: axis.origin, range }.joint()
}

/// The joint with the box around its part's meshes.
fn with_shape(
    joint: FoundJoint,
    link: &MobilityLink,
    source: &JointSource<'_>,
    objs: &BTreeMap<i64, Vec<String>>,
) -> std::result::Result<FoundJoint, String> {
    let folder = source.path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let mut points = Vec::new();
    for name in link.parts.iter().filter_map(|leaf| objs.get(&leaf.id)).flatten() {
        let name = format!("textured_objs/{name}.obj");
        if let Some(file) = blob::inside(folder, &name).map_err(|e| e.to_string())? {
            vertices(&file, &mut points).map_err(|e| e.to_string())?;
        }
    }
    Ok(FoundJoint { part: shape::around(&points, &joint.axis), ..joint })
}

/// Adds the vertices of an OBJ file.
fn vertices(path: &Path, points: &mut Vec<Point>) -> Result<()> {
    let mut lines = Lines::open(path)?;
    while let Some(line) = lines.line()? {
        let mut words = line.split_whitespace();
        if words.next() != Some("v") {
            continue;
        }
        let mut xyz = [0.0; 3];
        for value in &mut xyz {
            let Some(word) = words.next() else { return Err(lines.fault("a vertex needs three numbers")) };
            *value = lines.number("vertex", word)?;
        }
        if points.len() >= MAX_VERTICES {
            return Err(lines.fault(format!("more than {MAX_VERTICES} vertices in one part")));
        }
        points.push(Point::from(xyz));
    }
    Ok(())
}
