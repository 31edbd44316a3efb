//! Joints for physics engines in glTF (`KHR_physics_rigid_bodies`): what their limits allow.

use serde_json::Value;

use super::findings::Findings;
use super::gltf_file::{index, list};
use super::joint_limits::MAX_SLIDE_M;
use super::xml;
use crate::math::plain;

/// The extension with bodies and joints.
pub(super) const NAME: &str = "KHR_physics_rigid_bodies";
/// The extension with their shapes.
pub(super) const SHAPES: &str = "KHR_implicit_shapes";

/// A range about or along axes of a joint's frame.
#[derive(Debug, Clone, PartialEq)]
pub struct PhysicsLimit {
    /// Whether it is about axes (rad) or along them (m).
    pub is_angular: bool,
    /// The axes: 0, 1, 2 for x, y, z.
    pub axes: Vec<u64>,
    /// Lower and upper end; `None` is without end.
    pub range: [Option<f64>; 2],
}

/// A joint of a node.
#[derive(Debug, Clone, PartialEq)]
pub struct PhysicsJoint {
    /// The name of its node, or the node's number.
    pub name: String,
    /// What is limited, or why that is not known.
    pub limits: Result<Vec<PhysicsLimit>, String>,
}

/// The joints of all nodes, in the nodes' order.
pub(super) fn joints(json: &Value) -> Vec<PhysicsJoint> {
    let described = list(&json["extensions"][NAME], "physicsJoints");
    let nodes = list(json, "nodes");
    let read = |(i, node): (usize, &Value)| -> Option<PhysicsJoint> {
        let joint = &node["extensions"][NAME]["joint"];
        if !joint.is_object() {
            return None;
        }
        let name = node["name"].as_str().map_or_else(|| format!("node {i}"), xml::brief);
        let connected = index(joint, "connectedNode");
        let limits = match index(joint, "joint").and_then(|j| described.get(j)) {
            _ if connected.is_none_or(|c| c >= nodes.len()) => Err("its connectedNode does not exist".to_owned()),
            None => Err(format!("its joint is none of the {} in physicsJoints", described.len())),
            Some(joint) => Ok(list(joint, "limits").iter().flat_map(limits_of).collect()),
        };
        Some(PhysicsJoint { name, limits })
    };
    nodes.iter().enumerate().filter_map(read).collect()
}

/// The ranges of one entry, which may be about and along axes.
fn limits_of(limit: &Value) -> Vec<PhysicsLimit> {
    let range = [limit["min"].as_f64(), limit["max"].as_f64()];
    [(false, "linearAxes"), (true, "angularAxes")]
        .into_iter()
        .filter(|(_, key)| !limit[*key].is_null())
        .map(|(is_angular, key)| PhysicsLimit {
            is_angular,
            axes: list(limit, key).iter().filter_map(Value::as_u64).collect(),
            range,
        })
        .collect()
}

/// The second point, for joints of glTF.
pub(super) fn limits(joints: &[PhysicsJoint]) -> Findings {
    let mut said = Findings::about(!joints.is_empty());
    for joint in joints {
        let name = &joint.name;
        let limits = match &joint.limits {
            Ok(limits) => limits,
            Err(why) => {
                said.fault(format!("{name}: {why}"));
                continue;
            }
        };
        for limit in limits {
            ends(&mut said, name, limit);
        }
        for (is_angular, what) in [(false, "slides along"), (true, "turns about")] {
            let free: Vec<&str> = [(0, "x"), (1, "y"), (2, "z")]
                .into_iter()
                .filter(|(axis, _)| !limits.iter().any(|l| l.is_angular == is_angular && l.axes.contains(axis)))
                .map(|(_, axis)| axis)
                .collect();
            if !free.is_empty() {
                said.fault(format!("{name}: {what} {} without limits; write min and max", free.join(", ")));
            }
        }
    }
    said
}

fn ends(said: &mut Findings, name: &str, limit: &PhysicsLimit) {
    if limit.axes.iter().any(|a| *a > 2) {
        said.fault(format!("{name}: limits an axis that is none of 0, 1, 2"));
    }
    let [Some(lower), Some(upper)] = limit.range else {
        said.fault(format!("{name}: a limit has no min or no max; write both"));
        return;
    };
    let (unit, most, wanted) =
        if limit.is_angular { ("rad", std::f64::consts::TAU, "radians") } else { ("m", MAX_SLIDE_M, "metres") };
    let [low, high] = [lower, upper].map(plain);
    if lower > upper {
        said.fault(format!("{name}: lower limit {low} is above upper limit {high}; swap them"));
    } else if upper - lower > most {
        said.fault(format!("{name}: goes from {low} to {high} {unit}; limits are {wanted} here"));
    } else if upper > lower && !(lower..=upper).contains(&0.0) {
        said.tell(format!("{name}: 0 is outside its limits {low} to {high}"));
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn limits_are_held_to_what_doors_do() {
        let with = |limits: Value| {
            let json = json!({"nodes": [{"name": "a", "extensions": {NAME: {"joint": {"connectedNode": 0, "joint": 0}}}}],
                "extensions": {NAME: {"physicsJoints": [{"limits": limits}]}}});
            super::limits(&joints(&json)).faults
        };
        let hinge = |lower: f64, upper: f64| {
            with(json!([{"linearAxes": [0, 1, 2], "min": 0, "max": 0}, {"angularAxes": [0, 2], "min": 0, "max": 0},
                {"angularAxes": [1], "min": lower, "max": upper}]))
        };
        assert!(hinge(0.0, 1.5).is_empty(), "{:?}", hinge(0.0, 1.5));
        for (faults, word) in [
            (hinge(1.5, 0.0), "swap them"),
            (hinge(0.0, 90.0), "radians"),
            (with(json!([])), "without limits"),
            (with(json!([{"linearAxes": [0, 1, 2], "angularAxes": [0, 1, 2], "min": 0}])), "no max"),
            (
                with(
                    json!([{"angularAxes": [0, 1, 2], "min": 0, "max": 0}, {"linearAxes": [0, 1], "min": 0, "max": 0},
                {"linearAxes": [2], "min": 0, "max": 400}]),
                ),
                "metres",
            ),
        ] {
            assert!(faults.iter().any(|f| f.contains(word)), "{word}: {faults:?}");
        }
    }
}
