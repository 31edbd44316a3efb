//! ArtiPoint: `segment_N/axis_info.json`, one joint for each stretch of frames in which a hand moved something.

use serde::Deserialize;
use serde_json::Value;

use super::found::{FoundJoint, JointScene, JointSource, StatedJoint};
use crate::error::Result;
use crate::math::Vector;

#[derive(Deserialize)]
struct AxisInfo {
    axis: [f64; 3],
    joint_type: String,
    center: [f64; 3],
    /// Turn, then shift, for one unit of `thetas`.
    twist: Option<[f64; 6]>,
    /// How far the part stood from its first pose, frame by frame.
    thetas: Option<Vec<f64>>,
    start_frame: Option<i64>,
    end_frame: Option<i64>,
}

pub(super) fn detect(value: &Value) -> bool {
    ["axis", "joint_type", "center"].iter().all(|key| value.get(key).is_some())
}

pub(super) fn read(source: &JointSource<'_>) -> Result<JointScene> {
    let mut scene = JointScene::empty(source.path, "artipoint");
    scene.notes.push("what the hand did is taken for opening, from closed: ArtiPoint tells neither".to_owned());
    let folder = source.path.parent().and_then(|p| p.file_name()).map(|n| n.to_string_lossy().into_owned());
    let own = super::found::stem(source.path);
    // All files have one name; the folders tell them apart.
    let name = folder.filter(|f| own == "axis_info" && !f.is_empty()).unwrap_or(own);
    let joint = JointSource::entry::<AxisInfo>(source.value).and_then(|info| joint(&name, &info));
    scene.take(name, joint);
    Ok(scene)
}

fn joint(name: &str, info: &AxisInfo) -> std::result::Result<FoundJoint, String> {
    let joint = StatedJoint {
        label: name.to_owned(),
        kind: info.joint_type.clone(),
        axis: info.axis,
        origin: info.center,
        range: None,
    }
    .joint()?;
    let label = match (info.start_frame, info.end_frame) {
        (Some(start), Some(end)) => format!("{name}, frames {start} to {end}"),
        _ => name.to_owned(),
    };
    let range = range(info, joint.kind == crate::articulation::JointKind::Revolute)?;
    Ok(FoundJoint { id: name.to_owned(), label, range, ..joint })
}

/// The opening that the hand went through, rad or m.
fn range(info: &AxisInfo, turns: bool) -> std::result::Result<Option<[f64; 2]>, String> {
    let Some(thetas) = info.thetas.as_ref().filter(|t| !t.is_empty()) else { return Ok(None) };
    let unit = match info.twist {
        Some([x, y, z, ..]) if turns => Vector::new(x, y, z).norm(),
        Some([.., x, y, z]) => Vector::new(x, y, z).norm(),
        None => 1.0,
    };
    let low = unit * thetas.iter().copied().fold(0.0, f64::min);
    let high = unit * thetas.iter().copied().fold(0.0, f64::max);
    if turns && high - low > std::f64::consts::TAU {
        return Err(format!("thetas: a way of {:.1} rad is more than a whole turn", high - low));
    }
    Ok((high > low).then_some([low, high]))
}
