//! What a glTF file (`.glb`, `.gltf`) does when its animations run: where things are, and how far it opens.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use nalgebra::{Matrix4, Quaternion, UnitQuaternion};
use serde_json::Value;

use super::gltf_file::{self, File, Why, index, list, row};
pub use super::rigid_bodies::{PhysicsJoint, PhysicsLimit};
use super::{gltf_extensions, rigid_bodies, xml};
use crate::articulation::JointKind;
use crate::error::{Error, Result};
use crate::math::{Point, Vector};

/// Nodes times channels, and keyframes of all channels together: furniture has far fewer.
const MAX_WORK: usize = 20_000_000;

/// Where something is when a joint is closed, half open and open; world, +Z up, metres.
pub type Places = [Point; 3];

/// The shares of a joint's range that [`Places`] stands for.
pub const SHARES: [f64; 3] = [0.0, 0.5, 1.0];

/// A node that an animation moves.
#[derive(Debug, Clone, PartialEq)]
pub struct Moved {
    /// The node's name.
    pub name: String,
    /// Whether it turns or slides.
    pub kind: JointKind,
    /// How far the animation opens it, rad or m; metres are those of the world.
    pub reaches: f64,
    /// Upper limit in the node's extras (`joint.upper`), rad or m.
    pub upper: Option<f64>,
    /// Whether the node carries something.
    pub is_pivot: bool,
}

/// A scene.
#[derive(Debug, Clone, PartialEq)]
pub struct Scene {
    /// The file.
    pub source: PathBuf,
    /// Moved nodes, in the order of the animations.
    pub moved: Vec<Moved>,
    /// Named nodes at and below moved ones.
    pub places: BTreeMap<String, Places>,
    /// The file describes rigid bodies and joints for a physics engine (`KHR_physics_rigid_bodies`).
    pub is_physics: bool,
    /// Its joints for a physics engine.
    pub joints: Vec<PhysicsJoint>,
    /// Extensions without which the file cannot be shown.
    pub required: Vec<String>,
    /// Files and bytes that it names and that are not there.
    pub missing: Vec<String>,
    /// What breaks the format's rules.
    pub faults: Vec<String>,
    /// What its extensions mean for what is judged here.
    pub told: Vec<String>,
    /// What was not read.
    pub notes: Vec<String>,
}

/// Keyframes of one channel.
struct Channel {
    times: Vec<f64>,
    values: Values,
}

enum Values {
    Turns(Vec<UnitQuaternion<f64>>),
    Shifts(Vec<Vector>),
}

/// A node's value at a key or between two.
enum Placed {
    Turn(UnitQuaternion<f64>),
    Shift(Vector),
}

/// A node as it stands in the file.
struct Node {
    name: Option<String>,
    children: Vec<usize>,
    translation: Vector,
    rotation: UnitQuaternion<f64>,
    scale: Vector,
    /// Instead of the three.
    matrix: Option<Matrix4<f64>>,
}

/// Reads a glTF file, binary or text.
///
/// # Errors
/// Where it cannot be read, is no glTF 2, refers to what it does not have, or its nodes are no trees.
pub fn read(path: &Path) -> Result<Scene> {
    let file = gltf_file::open(path)?;
    let json = &file.json;
    let mut scene = Scene {
        source: path.to_owned(),
        moved: Vec::new(),
        places: BTreeMap::new(),
        is_physics: gltf_extensions::uses(json, rigid_bodies::NAME),
        joints: rigid_bodies::joints(json),
        required: gltf_extensions::required(json),
        missing: file.missing(path),
        faults: gltf_extensions::faults(json),
        told: gltf_extensions::told(json),
        notes: Vec::new(),
    };
    if file.trailing > 0 {
        scene.notes.push(format!("{} bytes follow the end that its header states", file.trailing));
    }
    if list(json, "scenes").iter().all(|s| list(s, "nodes").is_empty()) && !list(json, "nodes").is_empty() {
        scene.told.push("no scene of it shows a node: viewers show nothing".to_owned());
    }
    let nodes: Vec<Node> = list(json, "nodes").iter().enumerate().map(|(i, n)| node(i, n, &mut scene.faults)).collect();
    let fault = |text: &str| Error::format(path, "glTF", format!("is not valid ({text})"));
    let parents = parents(&nodes).map_err(|e| fault(&e))?;
    let still: Vec<Matrix4<f64>> = nodes.iter().map(Node::local).collect();
    let channels: usize = list(json, "animations").iter().map(|a| list(a, "channels").len()).sum();
    if nodes.len().saturating_mul(channels) > MAX_WORK {
        return Err(fault("too many nodes and animations for a piece of furniture"));
    }
    let mut left = MAX_WORK;
    for animation in list(json, "animations") {
        for channel in list(animation, "channels") {
            let Some((target, path)) = target(channel, nodes.len(), &mut scene.notes) else { continue };
            let Some(moved_node) = nodes.get(target) else { continue };
            let name = moved_node.name.clone().unwrap_or_else(|| format!("node {target}"));
            if moved_node.matrix.is_some() {
                scene.faults.push(format!(
                    "{name}: is animated and has a matrix; write translation, rotation and scale instead"
                ));
                continue;
            }
            let too_many = || Why::NotRead("there are too many keyframes".to_owned());
            // Once there are too many, none is looked at any more: channels may share their numbers.
            let keys = if left > 0 { keys(&file, animation, channel, path) } else { Err(too_many()) };
            let keys = keys.and_then(|k| {
                let rest = left.checked_sub(k.times.len());
                left = rest.unwrap_or(0);
                rest.map(|_| k).ok_or_else(too_many)
            });
            match keys {
                Ok(keys) => {
                    let above = world(parents.get(target).copied().flatten(), &still, &parents);
                    let tree = Hung { nodes: &nodes, still: &still, above };
                    let moved = tree.moved(target, &name, &keys, &list(json, "nodes")[target], &mut scene.places);
                    if moved.reaches > 0.0 {
                        scene.moved.push(moved);
                    } else {
                        scene.notes.push(format!("{name}: its animation moves nothing"));
                    }
                }
                Err(Why::NotRead(why)) => scene.notes.push(format!("{name}: its animation is not read: {why}")),
                Err(Why::Broken(why)) => scene.faults.push(format!("{name}: its animation is broken: {why}")),
            }
        }
    }
    let lost: Vec<&String> = scene
        .places
        .iter()
        .filter(|(_, p)| p.iter().any(|p| !p.coords.iter().all(|x| x.is_finite())))
        .map(|(n, _)| n)
        .collect();
    if let Some(name) = lost.first() {
        scene.faults.push(format!("{name}: its place is beyond all numbers; look at the scales and shifts above it"));
    }
    Ok(scene)
}

fn node(number: usize, value: &Value, faults: &mut Vec<String>) -> Node {
    let name = value["name"].as_str().map(str::to_owned);
    let label = || name.clone().unwrap_or_else(|| format!("node {number}"));
    let mut wrong = |key: &str, count: usize| faults.push(format!("{}: its {key} is not {count} numbers", label()));
    let three = |key: &str| if value[key].is_null() { Some(None) } else { row::<3>(value, key).map(Some) };
    let translation = three("translation").unwrap_or_else(|| {
        wrong("translation", 3);
        None
    });
    let scale = three("scale").unwrap_or_else(|| {
        wrong("scale", 3);
        None
    });
    let matrix = row::<16>(value, "matrix");
    if matrix.is_none() && !value["matrix"].is_null() {
        wrong("matrix", 16);
    }
    let [x, y, z, w] = row::<4>(value, "rotation").unwrap_or_else(|| {
        if !value["rotation"].is_null() {
            wrong("rotation", 4);
        }
        [0.0, 0.0, 0.0, 1.0]
    });
    let quaternion = Quaternion::new(w, x, y, z);
    // What a validator forgives of rounding.
    if (quaternion.norm() - 1.0).abs() > 1e-2 {
        faults.push(format!(
            "{}: its rotation has length {:.3}; a quaternion of length 1 is wanted",
            label(),
            quaternion.norm()
        ));
    }
    Node {
        children: list(value, "children")
            .iter()
            .filter_map(|c| c.as_u64().and_then(|c| usize::try_from(c).ok()))
            .collect(),
        translation: translation.map_or_else(Vector::zeros, Vector::from),
        rotation: UnitQuaternion::try_new(quaternion, 1e-9).unwrap_or_else(UnitQuaternion::identity),
        scale: scale.map_or_else(|| Vector::repeat(1.0), Vector::from),
        matrix: matrix.map(|m| Matrix4::from_column_slice(&m)),
        name,
    }
}

impl Node {
    /// `parent_from_node` as the file has it.
    fn local(&self) -> Matrix4<f64> {
        self.matrix.unwrap_or_else(|| self.with(None))
    }

    /// The same with one of its parts replaced.
    fn with(&self, value: Option<&Placed>) -> Matrix4<f64> {
        let (mut shift, mut turn) = (self.translation, self.rotation);
        match value {
            Some(Placed::Shift(s)) => shift = *s,
            Some(Placed::Turn(t)) => turn = *t,
            None => {}
        }
        Matrix4::new_translation(&shift) * turn.to_homogeneous() * Matrix4::new_nonuniform_scaling(&self.scale)
    }
}

/// Each node's parent; `Err` where nodes are no trees.
fn parents(nodes: &[Node]) -> std::result::Result<Vec<Option<usize>>, String> {
    let mut parents: Vec<Option<usize>> = vec![None; nodes.len()];
    for (i, node) in nodes.iter().enumerate() {
        for child in &node.children {
            if let Some(other) = parents.get_mut(*child).and_then(|p| p.replace(i)) {
                return Err(format!("node {child} is the child of two nodes, {other} and {i}"));
            }
        }
    }
    // From the roots down every node of a tree is reached.
    let mut todo: Vec<usize> = (0..nodes.len()).filter(|i| parents[*i].is_none()).collect();
    let mut reached = vec![false; nodes.len()];
    while let Some(i) = todo.pop() {
        reached[i] = true;
        todo.extend(&nodes[i].children);
    }
    match reached.iter().position(|r| !r) {
        Some(i) => Err(format!("the children of node {i} lead back to it")),
        None => Ok(parents),
    }
}

/// `world_from_node`; the identity for what stands in the world.
fn world(node: Option<usize>, local: &[Matrix4<f64>], parents: &[Option<usize>]) -> Matrix4<f64> {
    let mut pose = Matrix4::identity();
    let mut here = node;
    while let Some(i) = here {
        pose = local[i] * pose;
        here = parents[i];
    }
    pose
}

/// The node that a channel moves and how; `None`, and a note, where it moves none.
fn target<'a>(channel: &'a Value, nodes: usize, notes: &mut Vec<String>) -> Option<(usize, &'a str)> {
    let target = &channel["target"];
    if let Some(pointer) = target["extensions"]["KHR_animation_pointer"]["pointer"].as_str() {
        let inside = pointer.strip_prefix("/nodes/").and_then(|p| p.split_once('/'));
        let moves = inside.filter(|(_, path)| ["rotation", "translation"].contains(path));
        let found = moves.and_then(|(n, path)| Some((n.parse::<usize>().ok().filter(|n| *n < nodes)?, path)));
        if found.is_none() {
            notes.push(format!("what animates {} is not read", xml::brief(pointer)));
        }
        return found;
    }
    let found = index(target, "node").and_then(|n| Some((n, target["path"].as_str()?)));
    if found.is_none() {
        notes.push("an animation's channel moves no node and is passed over".to_owned());
    }
    found
}

/// Keyframes of a channel that turns or shifts.
fn keys(file: &File, animation: &Value, channel: &Value, path: &str) -> std::result::Result<Channel, Why> {
    let broken = |text: &str| Why::Broken(text.to_owned());
    let sampler = index(channel, "sampler").and_then(|s| list(animation, "samplers").get(s));
    let sampler = sampler.ok_or_else(|| broken("it has no sampler"))?;
    let width = match path {
        "rotation" => 4,
        "translation" => 3,
        "scale" | "weights" => return Err(Why::NotRead("it neither turns nor shifts".to_owned())),
        other => return Err(Why::Broken(format!("it animates \"{}\", which nodes do not have", xml::brief(other)))),
    };
    let accessor = |key: &str| index(sampler, key).ok_or_else(|| Why::Broken(format!("its sampler has no {key}")));
    let times: Vec<f64> = file.rows(accessor("input")?, 1)?.concat();
    let rows = file.rows(accessor("output")?, width)?;
    // A spline's keyframe is a slope, the value, a slope.
    let a_key = match sampler["interpolation"].as_str() {
        None | Some("LINEAR" | "STEP") => 1,
        Some("CUBICSPLINE") => 3,
        Some(other) => return Err(Why::Broken(format!("\"{}\" is no interpolation", xml::brief(other)))),
    };
    if times.is_empty() || times.len().checked_mul(a_key) != Some(rows.len()) {
        let (have, keys) = (rows.len(), times.len());
        return Err(Why::Broken(format!("it has {have} values for {keys} keyframes, {a_key} for each are wanted")));
    }
    if !times.windows(2).all(|w| w[0] < w[1]) {
        return Err(broken("its times do not rise"));
    }
    let rows = rows.iter().skip(a_key / 2).step_by(a_key);
    let values = if width == 4 {
        let turn = |v: &Vec<f64>| match v[..] {
            [x, y, z, w] => UnitQuaternion::try_new(Quaternion::new(w, x, y, z), 1e-6),
            _ => None,
        };
        let turns: Option<Vec<_>> = rows.map(turn).collect();
        Values::Turns(turns.ok_or_else(|| broken("a rotation is 0"))?)
    } else {
        Values::Shifts(rows.map(|v| Vector::from_column_slice(v)).collect())
    };
    Ok(Channel { times, values })
}

/// Nodes with what is above the one that moves.
struct Hung<'a> {
    nodes: &'a [Node],
    still: &'a [Matrix4<f64>],
    above: Matrix4<f64>,
}

impl Hung<'_> {
    /// What a channel does to a node; where all named nodes below are goes to `places`.
    fn moved(
        &self,
        node: usize,
        name: &str,
        keys: &Channel,
        json: &Value,
        places: &mut BTreeMap<String, Places>,
    ) -> Moved {
        let (open, mut reaches) = keys.farthest();
        if let Values::Shifts(shifts) = &keys.values {
            // Metres of the world: scales above count.
            reaches = self.above.transform_vector(&(shifts[open] - shifts[0])).norm();
        }
        for (k, share) in SHARES.into_iter().enumerate() {
            let (from, to) = (keys.times[0], keys.times[open]);
            let local = self.nodes[node].with(Some(&keys.at(from + (to - from) * share)));
            let mut todo = vec![(node, self.above * local)];
            while let Some((i, pose)) = todo.pop() {
                if let Some(name) = &self.nodes[i].name {
                    let p = pose.transform_point(&Point::origin());
                    // glTF's +Y up is our +Z up.
                    let places = places.entry(name.clone()).or_insert([Point::origin(); 3]);
                    places[k] = Point::new(p.x, -p.z, p.y);
                }
                todo.extend(self.nodes[i].children.iter().map(|c| (*c, pose * self.still[*c])));
            }
        }
        let kind = match keys.values {
            Values::Turns(_) => JointKind::Revolute,
            Values::Shifts(_) => JointKind::Prismatic,
        };
        let is_pivot = !self.nodes[node].children.is_empty();
        Moved { name: name.to_owned(), kind, reaches, upper: json["extras"]["joint"]["upper"].as_f64(), is_pivot }
    }
}

impl Channel {
    /// The key that is farthest from the first, and how far that is, rad or m.
    fn farthest(&self) -> (usize, f64) {
        let mut best = (0, 0.0f64);
        match &self.values {
            Values::Shifts(shifts) => {
                for (i, s) in shifts.iter().enumerate() {
                    let far = (s - shifts[0]).norm();
                    if far > best.1 {
                        best = (i, far);
                    }
                }
            }
            Values::Turns(turns) => {
                // Added up step by step: whole turns count.
                let (mut angle, mut about) = (0.0f64, Vector::zeros());
                for (i, pair) in turns.windows(2).enumerate() {
                    let step = (pair[1] * pair[0].inverse()).scaled_axis();
                    if about == Vector::zeros() {
                        about = step;
                    }
                    angle += if step.dot(&about) < 0.0 { -step.norm() } else { step.norm() };
                    if angle > best.1 {
                        best = (i + 1, angle);
                    }
                }
            }
        }
        best
    }

    /// The value at a time, linear between keys.
    fn at(&self, time: f64) -> Placed {
        let last = self.times.len() - 1;
        // One keyframe holds still.
        if last == 0 {
            return match &self.values {
                Values::Shifts(s) => Placed::Shift(s[0]),
                Values::Turns(t) => Placed::Turn(t[0]),
            };
        }
        let i = self.times.partition_point(|t| *t <= time).clamp(1, last);
        let share = ((time - self.times[i - 1]) / (self.times[i] - self.times[i - 1])).clamp(0.0, 1.0);
        match &self.values {
            Values::Shifts(s) => Placed::Shift(s[i - 1].lerp(&s[i], share)),
            // Half a turn has no shortest way; the first key is as good as any.
            Values::Turns(t) => Placed::Turn(t[i - 1].try_slerp(&t[i], share, 1e-9).unwrap_or(t[i - 1])),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::rotation;

    #[test]
    fn more_than_half_a_turn_is_counted_as_such() {
        let turns: Vec<_> = [0.0, 1.2, 2.4, 3.6, 2.4, 1.2, 0.0].map(|a| rotation(&Vector::y(), a)).to_vec();
        let times = (0..7).map(f64::from).collect();
        let channel = Channel { times, values: Values::Turns(turns) };
        let (open, reaches) = channel.farthest();
        assert_eq!(open, 3);
        assert!((reaches - 3.6).abs() < 1e-9);
        let Placed::Turn(half) = channel.at(1.5) else { panic!("a turn") };
        assert!((half.angle() - 1.8).abs() < 1e-9);
    }

    #[test]
    fn what_is_no_gltf_is_refused() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("x.glb");
        for bytes in [&b""[..], b"glTF", b"glTF\x02\0\0\0\xff\xff\xff\xff", b"glTF\x02\0\0\0\0\0\0\0", b"{}"] {
            std::fs::write(&path, bytes).unwrap();
            let error = read(&path).unwrap_err().to_string();
            assert!(error.contains("x.glb"), "{error}");
        }
    }
}
