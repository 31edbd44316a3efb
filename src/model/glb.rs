//! What a glTF file (`.glb`) does when its animations run: where things are, and how far it opens.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use gltf::accessor::{DataType, Dimensions};
use gltf::animation::{Interpolation, Property};
use nalgebra::{Matrix4, Quaternion, UnitQuaternion};

use super::xml;
use crate::error::{Error, Result};
use crate::math::{Point, Vector};

/// Scenes of furniture are boxes; what is larger than this is none.
const MAX_BYTES: u64 = 256 << 20;
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
    /// How far the animation opens it, rad or m.
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
    /// Extensions without which the file cannot be shown.
    pub required: Vec<String>,
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
enum Value {
    Turn(UnitQuaternion<f64>),
    Shift(Vector),
}

/// Reads a binary glTF file.
///
/// # Errors
/// Where it cannot be read or is no valid glTF.
pub fn read(path: &Path) -> Result<Scene> {
    let bytes = xml::read_bytes(path, MAX_BYTES)?;
    let fault = |text: &str| Error::format(path, "glTF", format!("is not valid ({})", xml::brief(text)));
    // The crate takes the header's length for granted.
    let length = bytes.get(8..12).and_then(|b| b.try_into().ok()).map_or(0, u32::from_le_bytes);
    if bytes.starts_with(b"glTF") && (length as usize) < 12 {
        return Err(fault("its header states no length"));
    }
    let file = gltf::Gltf::from_slice(&bytes).map_err(|e| fault(&e.to_string()))?;
    let blob = file.blob.as_deref().unwrap_or_default();
    let nodes: Vec<gltf::Node> = file.nodes().collect();
    let mut parents: Vec<Option<usize>> = vec![None; nodes.len()];
    for node in &nodes {
        for child in node.children() {
            parents[child.index()] = Some(node.index());
        }
    }
    let channels: usize = file.animations().map(|a| a.channels().count()).sum();
    if nodes.len().saturating_mul(channels) > MAX_WORK {
        return Err(fault("too many nodes and animations for a piece of furniture"));
    }
    let mut scene = Scene {
        source: path.to_owned(),
        moved: Vec::new(),
        places: BTreeMap::new(),
        is_physics: file.extensions_used().any(|e| e == "KHR_physics_rigid_bodies"),
        required: file.extensions_required().map(str::to_owned).collect(),
        notes: Vec::new(),
    };
    let still: Vec<Matrix4<f64>> = nodes.iter().map(|n| matrix(n.transform().matrix())).collect();
    for animation in file.animations() {
        for channel in animation.channels() {
            let node = channel.target().node().index();
            let name = nodes[node].name().map_or_else(|| format!("node {node}"), str::to_owned);
            let channel = match keys(&channel, blob) {
                Ok(channel) => channel,
                Err(why) => {
                    scene.notes.push(format!("{name}: its animation is not read: {why}"));
                    continue;
                }
            };
            let (open, reaches) = channel.farthest();
            let above = parents[node].map_or(Matrix4::identity(), |p| world(p, &still, &parents));
            for (k, share) in SHARES.into_iter().enumerate() {
                let (from, to) = (channel.times[0], channel.times[open]);
                let local = replaced(&nodes[node], &channel.at(from + (to - from) * share));
                let mut seen = BTreeSet::from([node]);
                let mut todo = vec![(node, above * local)];
                while let Some((i, pose)) = todo.pop() {
                    if let Some(name) = nodes[i].name() {
                        let p = pose.transform_point(&Point::origin());
                        // glTF's +Y up is our +Z up.
                        let places = scene.places.entry(name.to_owned()).or_insert([Point::origin(); 3]);
                        places[k] = Point::new(p.x, -p.z, p.y);
                    }
                    let below = nodes[i].children().map(|c| c.index()).filter(|c| seen.insert(*c));
                    todo.extend(below.map(|c| (c, pose * still[c])));
                }
            }
            let extras =
                nodes[node].extras().as_ref().and_then(|e| serde_json::from_str::<serde_json::Value>(e.get()).ok());
            let upper = extras.and_then(|e| e["joint"]["upper"].as_f64());
            let is_pivot = nodes[node].children().next().is_some();
            scene.moved.push(Moved { name, reaches, upper, is_pivot });
        }
    }
    Ok(scene)
}

fn matrix(columns: [[f32; 4]; 4]) -> Matrix4<f64> {
    Matrix4::from_fn(|r, c| f64::from(columns[c][r]))
}

/// `world_from_node`; a cycle of ancestors is left where it closes.
fn world(node: usize, local: &[Matrix4<f64>], parents: &[Option<usize>]) -> Matrix4<f64> {
    let mut seen = BTreeSet::new();
    let mut pose = Matrix4::identity();
    let mut here = Some(node);
    while let Some(i) = here.filter(|i| seen.insert(*i)) {
        pose = local[i] * pose;
        here = parents[i];
    }
    pose
}

/// The node's local transform with one of its parts replaced.
fn replaced(node: &gltf::Node, value: &Value) -> Matrix4<f64> {
    let (translation, rotation, scale) = node.transform().decomposed();
    let [x, y, z, w] = rotation.map(f64::from);
    let turn = match value {
        Value::Turn(turn) => *turn,
        Value::Shift(_) => UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z)),
    };
    let shift = match value {
        Value::Shift(shift) => *shift,
        Value::Turn(_) => Vector::from(translation.map(f64::from)),
    };
    Matrix4::new_translation(&shift)
        * turn.to_homogeneous()
        * Matrix4::new_nonuniform_scaling(&Vector::from(scale.map(f64::from)))
}

/// Keyframes of a channel; `Err` says why they are not read.
fn keys(channel: &gltf::animation::Channel, blob: &[u8]) -> std::result::Result<Channel, String> {
    let sampler = channel.sampler();
    if sampler.interpolation() != Interpolation::Linear {
        return Err("only linear interpolation is".to_owned());
    }
    let times: Vec<f64> = floats(&sampler.input(), 1, blob)?.concat();
    let values = match channel.target().property() {
        Property::Rotation => {
            let turn = |v: &Vec<f64>| UnitQuaternion::try_new(Quaternion::new(v[3], v[0], v[1], v[2]), 1e-6);
            let turns: Option<Vec<_>> = floats(&sampler.output(), 4, blob)?.iter().map(turn).collect();
            Values::Turns(turns.ok_or("a rotation is 0")?)
        }
        Property::Translation => {
            Values::Shifts(floats(&sampler.output(), 3, blob)?.iter().map(|v| Vector::new(v[0], v[1], v[2])).collect())
        }
        Property::Scale | Property::MorphTargetWeights => return Err("it neither turns nor shifts".to_owned()),
    };
    let count = match &values {
        Values::Turns(v) => v.len(),
        Values::Shifts(v) => v.len(),
    };
    let rises = times.windows(2).all(|w| w[0] < w[1]);
    if times.len() < 2 || times.len() != count || !rises {
        return Err("it needs two keyframes at least, a value for each, and times that rise".to_owned());
    }
    Ok(Channel { times, values })
}

/// Rows of single-precision numbers of an accessor into the file's own buffer.
fn floats(accessor: &gltf::Accessor, width: usize, blob: &[u8]) -> std::result::Result<Vec<Vec<f64>>, String> {
    let fits = match accessor.dimensions() {
        Dimensions::Scalar => 1,
        Dimensions::Vec3 => 3,
        Dimensions::Vec4 => 4,
        _ => 0,
    };
    if accessor.data_type() != DataType::F32 || fits != width || accessor.sparse().is_some() {
        return Err(format!("its numbers are not plain floats, {width} a keyframe"));
    }
    let view = accessor.view().ok_or("its numbers are nowhere")?;
    if !matches!(view.buffer().source(), gltf::buffer::Source::Bin) {
        return Err("its numbers lie in another file".to_owned());
    }
    let stride = view.stride().unwrap_or(4 * width);
    let outside = || "its numbers lie outside the file".to_owned();
    let bytes =
        view.offset().checked_add(view.length()).and_then(|end| blob.get(view.offset()..end)).ok_or_else(outside)?;
    // More rows than bytes cannot be there.
    if accessor.count() > bytes.len() {
        return Err(outside());
    }
    let mut rows = Vec::new();
    for i in 0..accessor.count() {
        let start = i.checked_mul(stride).and_then(|s| s.checked_add(accessor.offset())).ok_or_else(outside)?;
        let row = start.checked_add(4 * width).and_then(|end| bytes.get(start..end)).ok_or_else(outside)?;
        let row: Vec<f64> =
            row.chunks_exact(4).map(|b| f64::from(f32::from_le_bytes(b.try_into().unwrap_or([0; 4])))).collect();
        if row.iter().any(|v| !v.is_finite()) {
            return Err("a number is not finite".to_owned());
        }
        rows.push(row);
    }
    Ok(rows)
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
    fn at(&self, time: f64) -> Value {
        let last = self.times.len() - 1;
        let i = self.times.partition_point(|t| *t <= time).clamp(1, last);
        let share = ((time - self.times[i - 1]) / (self.times[i] - self.times[i - 1])).clamp(0.0, 1.0);
        match &self.values {
            Values::Shifts(s) => Value::Shift(s[i - 1].lerp(&s[i], share)),
            // Half a turn has no shortest way; the first key is as good as any.
            Values::Turns(t) => Value::Turn(t[i - 1].try_slerp(&t[i], share, 1e-9).unwrap_or(t[i - 1])),
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
        let Value::Turn(half) = channel.at(1.5) else { panic!("a turn") };
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
