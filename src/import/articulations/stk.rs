//! The scene toolkit's articulations: Articulate3D's `SCENE_articulation.json` (below `data`), which USDNet learns from, and
//! S2O's `MODEL.art-stk.json` (below `annotation`, or at the top).
//!
//! `indices` and `score` are ours: the part as points of a reconstruction, and how sure a network is of it.

use serde::Deserialize;
use serde_json::Value;

use super::found::{FoundJoint, JointScene, JointSource, StatedJoint, picked};
use super::shape;
use crate::error::Result;
use crate::import::ply::Cloud;

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct StkMotion {
    #[serde(rename = "type")]
    kind: String,
    axis: [f64; 3],
    origin: [f64; 3],
    range_min: Option<f64>,
    range_max: Option<f64>,
    /// How far the part stands open in the scan, rad or m.
    state: Option<f64>,
}

impl StkMotion {
    /// The joint, and how far it stands open in the scan, rad or m.
    pub(super) fn joint(self, label: String) -> std::result::Result<(FoundJoint, f64), String> {
        let range = self.range_min.zip(self.range_max).map(|(low, high)| [low, high]);
        let joint = StatedJoint { label, kind: self.kind, axis: self.axis, origin: self.origin, range }.joint()?;
        Ok((joint, self.state.unwrap_or(0.0)))
    }
}

#[derive(Deserialize)]
struct About {
    pid: Value,
    label: Option<String>,
    indices: Option<Vec<usize>>,
    score: Option<f64>,
}

const PLACES: [&[&str]; 3] = [&["data", "articulations"], &["annotation", "articulations"], &["articulations"]];

/// Where the list is.
fn place(value: &Value) -> Option<&'static [&'static str]> {
    PLACES.into_iter().find(|keys| {
        let list = keys.iter().try_fold(value, |v, key| v.get(key)).and_then(Value::as_array);
        list.is_some_and(|l| l.first().is_none_or(|first| first.get("pid").is_some()))
    })
}

pub(super) fn detect(value: &Value) -> bool {
    place(value).is_some()
}

pub(super) fn read(source: &JointSource<'_>) -> Result<JointScene> {
    let keys = place(source.value).unwrap_or(PLACES[0]);
    let entries = source.list(keys)?;
    let mut scene = JointScene::empty(source.path, "articulate3d");
    scene.name = scene.name.trim_end_matches("_articulation").to_owned();
    let cloud = match entries.iter().any(|e| e.get("indices").is_some()) {
        true => source.cloud(&[format!("{}.ply", scene.name), "mesh_aligned_0.05.ply".to_owned()])?,
        false => None,
    };
    if cloud.is_none() {
        scene
            .notes
            .push("without the reconstruction that `indices` count (--points FILE.ply) parts have no boxes".to_owned());
    }
    for (i, entry) in entries.iter().enumerate() {
        scene.take(format!("{}[{i}]", keys.join(".")), joint(entry, cloud.as_ref()));
    }
    Ok(scene)
}

fn joint(entry: &Value, cloud: Option<&Cloud>) -> std::result::Result<FoundJoint, String> {
    let about: About = JointSource::entry(entry)?;
    let pid = match &about.pid {
        Value::String(text) => text.clone(),
        other => other.to_string(),
    };
    let motion: StkMotion = JointSource::entry(entry)?;
    let (mut joint, state) = motion.joint(about.label.unwrap_or(pid))?;
    if let Some(mut numbers) = about.indices {
        if let Some(cloud) = cloud {
            let points = picked(cloud, &mut numbers)?;
            joint.part = shape::around(&points, &joint.axis).map(|b| b.moved(&joint.articulation(), -state));
        } else {
            numbers.sort_unstable();
            numbers.dedup();
        }
        joint.points = Some(numbers);
    }
    joint.score = about.score.filter(|s| s.is_finite());
    Ok(joint)
}
