//! What a glTF file (`.glb`, `.gltf`) does when its animations run: where things are, and how far it opens.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use nalgebra::{Matrix4, Quaternion, UnitQuaternion};
use serde_json::Value;

use super::gltf_file::{self, GltfFile, Unavailable, index, list, row};
use super::gltf_keyframes::{KeyframeValue, KeyframeValues, Keyframes, UNIT_ERROR, keys};
pub use super::rigid_bodies::{PhysicsJoint, PhysicsLimit};
use super::{gltf_extensions, rigid_bodies, xml};
use crate::articulation::JointKind;
use crate::error::{Error, Result};
use crate::math::{Point, Vector, rounded};

/// Nodes times channels, and keyframes of all channels together: furniture has far fewer.
const MAX_WORK: usize = 20_000_000;

/// Where something is when a joint is closed, half open and open; world, +Z up, metres.
pub type PlacesOverRange = [Point; 3];

/// The shares of a joint's range that [`PlacesOverRange`] stands for.
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

/// What a file shows, and what moves in it.
#[derive(Debug, Clone, PartialEq)]
pub struct GltfScene {
    /// The file.
    pub source: PathBuf,
    /// Moved nodes, in the order of the animations.
    pub moved: Vec<Moved>,
    /// Named nodes at and below moved ones.
    pub places: BTreeMap<String, PlacesOverRange>,
    /// The file describes rigid bodies and joints for a physics engine (`KHR_physics_rigid_bodies`).
    pub is_physics: bool,
    /// Its joints for a physics engine.
    pub joints: Vec<PhysicsJoint>,
    /// Extensions without which the file cannot be shown.
    pub required: Vec<String>,
    /// Files and bytes that it names and that are not there.
    pub missing: Vec<String>,
    /// Files that it names and that are not looked at: they lie outside of the model's folder.
    pub unread: Vec<String>,
    /// Whether something turns or slides in a way that is not read.
    pub hides_motion: bool,
    /// What breaks the format's rules.
    pub faults: Vec<String>,
    /// What its extensions mean for what is judged here.
    pub told: Vec<String>,
    /// What was not read.
    pub notes: Vec<String>,
}

/// A node as it stands in the file.
struct GltfNode {
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
pub fn read(path: &Path) -> Result<GltfScene> {
    let file = gltf_file::open(path)?;
    let json = &file.json;
    let mut scene = unmoved(path, &file);
    let nodes: Vec<GltfNode> =
        list(json, "nodes").iter().enumerate().map(|(i, n)| node(i, n, &mut scene.faults)).collect();
    let fault = |text: &str| Error::format(path, "glTF", format!("is not valid ({text})"));
    let parents = parents(&nodes).map_err(|e| fault(&e))?;
    let still: Vec<Matrix4<f64>> = nodes.iter().map(GltfNode::local).collect();
    let channels: usize = list(json, "animations").iter().map(|a| list(a, "channels").len()).sum();
    if nodes.len().saturating_mul(channels) > MAX_WORK {
        return Err(fault("too many nodes and animations for a piece of furniture"));
    }
    let mut player = AnimationPlayer {
        file: &file,
        nodes: &nodes,
        still: &still,
        parents: &parents,
        left: MAX_WORK,
        scene: &mut scene,
    };
    for animation in list(json, "animations") {
        let mut set = BTreeSet::new();
        for channel in list(animation, "channels") {
            player.channel(animation, channel, &mut set);
        }
    }
    let is_lost = |p: &Point| !p.coords.iter().all(|x| x.is_finite());
    let lost = scene.places.iter().find(|(_, places)| places.iter().any(is_lost)).map(|(name, _)| name);
    if let Some(name) = lost {
        scene.faults.push(format!("{name}: its place is beyond all numbers; look at the scales and shifts above it"));
    }
    Ok(scene)
}

/// A scene before its animations are played, with what its file lacks.
fn unmoved(path: &Path, file: &GltfFile) -> GltfScene {
    let json = &file.json;
    let mut scene = GltfScene {
        source: path.to_owned(),
        moved: Vec::new(),
        places: BTreeMap::new(),
        is_physics: gltf_extensions::uses(json, rigid_bodies::NAME),
        joints: rigid_bodies::joints(json),
        required: gltf_extensions::required(json),
        missing: Vec::new(),
        unread: Vec::new(),
        hides_motion: false,
        faults: gltf_extensions::faults(json),
        told: gltf_extensions::told(json),
        notes: Vec::new(),
    };
    for why in file.missing(path) {
        match why {
            Unavailable::Broken(why) => scene.missing.push(why),
            Unavailable::NotRead(why) => scene.unread.push(why),
        }
    }
    if file.trailing > 0 {
        scene.notes.push(format!("{} bytes follow the end that its header states", file.trailing));
    }
    if list(json, "scenes").iter().all(|s| list(s, "nodes").is_empty()) && !list(json, "nodes").is_empty() {
        scene.told.push("no scene of it shows a node: viewers show nothing".to_owned());
    }
    scene
}

/// Plays a file's animations, a channel at a time, and keeps in the scene what they move.
struct AnimationPlayer<'a> {
    file: &'a GltfFile,
    nodes: &'a [GltfNode],
    /// `parent_from_node` as the file has it.
    still: &'a [Matrix4<f64>],
    parents: &'a [Option<usize>],
    /// Keyframes that may still be looked at.
    left: usize,
    scene: &'a mut GltfScene,
}

impl AnimationPlayer<'_> {
    /// Plays one channel; `set` are the nodes and properties that the same animation has set before.
    fn channel<'v>(&mut self, animation: &'v Value, channel: &'v Value, set: &mut BTreeSet<(usize, &'v str)>) {
        let Some((target, path)) = target(channel, &self.file.json, self.scene) else { return };
        let Some(node) = self.nodes.get(target) else { return };
        let name = node.name.clone().unwrap_or_else(|| format!("node {target}"));
        if !set.insert((target, path)) {
            let shown = xml::brief(path);
            self.scene.faults.push(format!("{name}: two channels of one animation set its {shown}; take one of them"));
            return;
        }
        if node.matrix.is_some() {
            self.scene
                .faults
                .push(format!("{name}: is animated and has a matrix; write translation, rotation and scale instead"));
            return;
        }
        match self.keyframes(animation, channel, path) {
            Ok(keys) => self.play(target, &name, &keys),
            Err(Unavailable::NotRead(why)) => {
                self.scene.hides_motion |= ["rotation", "translation"].contains(&path);
                self.scene.notes.push(format!("{name}: its animation is not read: {why}"));
            }
            Err(Unavailable::Broken(why)) => {
                self.scene.faults.push(format!("{name}: its animation is broken: {why}"));
            }
        }
    }

    /// The keyframes of a channel, unless all channels together have too many.
    fn keyframes(
        &mut self,
        animation: &Value,
        channel: &Value,
        path: &str,
    ) -> std::result::Result<Keyframes, Unavailable> {
        let too_many = || Unavailable::NotRead("there are too many keyframes".to_owned());
        // Once there are too many, none is looked at any more: channels may share their numbers.
        if self.left == 0 {
            return Err(too_many());
        }
        let keys = keys(self.file, animation, channel, path)?;
        let rest = self.left.checked_sub(keys.times.len());
        self.left = rest.unwrap_or(0);
        rest.map(|_| keys).ok_or_else(too_many)
    }

    /// Moves a node, and what it carries, through its keyframes.
    fn play(&mut self, node: usize, name: &str, keys: &Keyframes) {
        let above = world(self.parents.get(node).copied().flatten(), self.still, self.parents);
        let tree = NodeTree { nodes: self.nodes, still: self.still, above };
        let json = &list(&self.file.json, "nodes")[node];
        let moved = tree.moved(node, name, keys, json, &mut self.scene.places);
        if moved.reaches > 0.0 {
            self.scene.moved.push(moved);
        } else {
            self.scene.notes.push(format!("{name}: its animation moves nothing"));
        }
    }
}

fn node(number: usize, value: &Value, faults: &mut Vec<String>) -> GltfNode {
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
    if (quaternion.norm() - 1.0).abs() > UNIT_ERROR {
        faults.push(format!(
            "{}: its rotation has length {}; a quaternion of length 1 is wanted",
            label(),
            rounded(quaternion.norm(), 3)
        ));
    }
    GltfNode {
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

impl GltfNode {
    /// `parent_from_node` as the file has it.
    fn local(&self) -> Matrix4<f64> {
        self.matrix.unwrap_or_else(|| self.with(None))
    }

    /// The same with one of its parts replaced.
    fn with(&self, value: Option<&KeyframeValue>) -> Matrix4<f64> {
        let (mut shift, mut turn) = (self.translation, self.rotation);
        match value {
            Some(KeyframeValue::Shift(s)) => shift = *s,
            Some(KeyframeValue::Turn(t)) => turn = *t,
            None => {}
        }
        Matrix4::new_translation(&shift) * turn.to_homogeneous() * Matrix4::new_nonuniform_scaling(&self.scale)
    }
}

/// Each node's parent; `Err` where nodes are no trees.
fn parents(nodes: &[GltfNode]) -> std::result::Result<Vec<Option<usize>>, String> {
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

/// The node that a channel moves and how; `None`, and a note or a fault, where it moves none.
fn target<'a>(channel: &'a Value, json: &Value, scene: &mut GltfScene) -> Option<(usize, &'a str)> {
    let target = &channel["target"];
    if let Some(pointer) = target["extensions"]["KHR_animation_pointer"]["pointer"].as_str() {
        if let Some(fault) = astray(json, pointer) {
            scene.faults.push(fault);
            return None;
        }
        let inside = pointer.strip_prefix("/nodes/").and_then(|p| p.split_once('/'));
        let moves = inside.filter(|(_, path)| ["rotation", "translation"].contains(path));
        let found = moves.and_then(|(n, path)| Some((n.parse::<usize>().ok()?, path)));
        if found.is_none() {
            scene.notes.push(format!("what animates {} is not read", xml::brief(pointer)));
        }
        return found;
    }
    let found = index(target, "node").and_then(|n| Some((n, target["path"].as_str()?)));
    if found.is_none() {
        scene.notes.push("an animation's channel moves no node and is passed over".to_owned());
    }
    found
}

/// What is wrong with the pointer of an animation: that it is none, or that the entry of a list which it names is not there.
fn astray(json: &Value, pointer: &str) -> Option<String> {
    const LISTS: [&str; 6] = ["nodes", "materials", "meshes", "cameras", "skins", "scenes"];
    let shown = xml::brief(pointer);
    let Some(inside) = pointer.strip_prefix('/') else {
        return Some(format!("an animation's pointer \"{shown}\" is none: pointers begin with /"));
    };
    let (what, rest) = inside.split_once('/')?;
    let number = rest.split('/').next().unwrap_or_default();
    let there = match &json[what] {
        Value::Array(entries) => entries.len(),
        Value::Null if LISTS.contains(&what) => 0,
        _ => return None,
    };
    let is_there = number.parse::<usize>().is_ok_and(|n| n < there);
    (!is_there).then(|| format!("an animation points at {shown}, there are {there} {what}"))
}

/// Nodes with what is above the one that moves.
struct NodeTree<'a> {
    nodes: &'a [GltfNode],
    still: &'a [Matrix4<f64>],
    above: Matrix4<f64>,
}

impl NodeTree<'_> {
    /// What a channel does to a node; where all named nodes below are goes to `places`.
    fn moved(
        &self,
        node: usize,
        name: &str,
        keys: &Keyframes,
        json: &Value,
        places: &mut BTreeMap<String, PlacesOverRange>,
    ) -> Moved {
        let (open, mut reaches) = keys.farthest();
        if let KeyframeValues::Shifts(shifts) = &keys.values {
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
            KeyframeValues::Turns(_) => JointKind::Revolute,
            KeyframeValues::Shifts(_) => JointKind::Prismatic,
        };
        let is_pivot = !self.nodes[node].children.is_empty();
        Moved { name: name.to_owned(), kind, reaches, upper: json["extras"]["joint"]["upper"].as_f64(), is_pivot }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
