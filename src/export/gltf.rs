//! Binary glTF: one pivot node per joint at its hinge, boxes below it, an open-and-close animation per joint.

use gltf::binary::{Glb, Header};
use serde_json::{Value, json};

use super::{color, material};
use crate::articulation::JointKind;
use crate::error::{Error, Result};
use crate::math::{Point, rotation};
use crate::twin::{Role, Solid, Twin};

const ROLES: [Role; 4] = [Role::Front, Role::Handle, Role::Tray, Role::Carcass];
/// Seconds to open; closing takes as long again.
const OPEN_SECS: f32 = 1.5;
/// Rotations are interpolated the short way round: keyframes lie at most this far apart.
const MAX_STEP_RAD: f64 = 1.2;

/// Verdicts to show with the joints: (joint id, verdict).
pub type Verdicts<'a> = &'a [(String, String)];

/// Bytes of the binary chunk, and the accessors into them.
#[derive(Default)]
struct Buffer {
    bytes: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
}

impl Buffer {
    fn push(&mut self, data: &[u8], target: Option<u32>, accessor: Value) -> usize {
        while !self.bytes.len().is_multiple_of(4) {
            self.bytes.push(0);
        }
        let mut view = json!({"buffer": 0, "byteOffset": self.bytes.len(), "byteLength": data.len()});
        if let Some(target) = target {
            view["target"] = json!(target);
        }
        self.bytes.extend_from_slice(data);
        self.views.push(view);
        let mut accessor = accessor;
        accessor["bufferView"] = json!(self.views.len() - 1);
        self.accessors.push(accessor);
        self.accessors.len() - 1
    }

    fn floats(&mut self, rows: &[Vec<f32>], kind: &str, target: Option<u32>) -> usize {
        let width = rows.first().map_or(0, Vec::len);
        let bound = |pick: fn(f32, f32) -> f32, start: f32| -> Vec<f32> {
            (0..width).map(|c| rows.iter().map(|r| r[c]).fold(start, pick)).collect()
        };
        let data: Vec<u8> = rows.iter().flatten().flat_map(|f| f.to_le_bytes()).collect();
        let accessor = json!({
            "componentType": 5126, "count": rows.len(), "type": kind,
            "min": bound(f32::min, f32::INFINITY), "max": bound(f32::max, f32::NEG_INFINITY),
        });
        self.push(&data, target, accessor)
    }
}

/// The twin as GLB. World +Z up becomes glTF's +Y up in the root node.
///
/// # Errors
/// Where the twin cannot be a scene (see [`super::check`]).
pub fn write(twin: &Twin, verdicts: Verdicts) -> Result<Vec<u8>> {
    super::check(twin)?;
    let mut buffer = Buffer::default();
    let (positions, normals, indices) = unit_cube(&mut buffer);
    let materials: Vec<Value> = ROLES
        .iter()
        .map(|r| {
            json!({"name": material(*r), "pbrMetallicRoughness":
                {"baseColorFactor": color(*r), "metallicFactor": 0.0, "roughnessFactor": 0.7}})
        })
        .collect();
    let meshes: Vec<Value> = ROLES
        .iter()
        .enumerate()
        .map(|(i, r)| {
            json!({"name": format!("box_{}", material(*r)), "primitives": [
                {"attributes": {"POSITION": positions, "NORMAL": normals}, "indices": indices, "material": i}]})
        })
        .collect();

    // Node 0 is the root: -90 degrees about x turns +Z up into +Y up.
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let mut nodes: Vec<Value> = vec![json!({"name": "scene", "rotation": [-half, 0.0, 0.0, half]})];
    let mut roots = Vec::new();
    let mut animations = Vec::new();
    for f in &twin.furniture {
        let base = nodes.len();
        nodes.push(json!({"name": f.name}));
        let mut children: Vec<usize> = f.carcass.iter().map(|s| push_box(&mut nodes, s, &Point::origin())).collect();
        let part = &f.part;
        let phi = part.joint.articulation;
        let pivot = nodes.len();
        let verdict = verdicts.iter().find(|(id, _)| *id == part.id).map_or("unknown", |(_, v)| v.as_str());
        nodes.push(json!({
            "name": part.id,
            "translation": array(phi.origin.coords.as_slice()),
            "extras": {"joint": {
                "id": part.id, "label": part.label, "kind": phi.kind, "axis": phi.axis.as_slice(),
                "lower": 0.0, "upper": part.joint.upper, "observed": part.joint.observed, "verdict": verdict,
                "damping": part.joint.damping, "friction": part.joint.friction,
            }},
        }));
        let mut part_children: Vec<usize> = part.solids.iter().map(|s| push_box(&mut nodes, s, &phi.origin)).collect();
        part_children.push(nodes.len());
        nodes.push(
            json!({"name": format!("{}_handle", part.id), "translation": array((part.handle - phi.origin).as_slice())}),
        );
        nodes[pivot]["children"] = json!(part_children);
        children.push(pivot);
        nodes[base]["children"] = json!(children);
        roots.push(base);
        animations.push(animation(&mut buffer, pivot, part));
    }
    if !roots.is_empty() {
        nodes[0]["children"] = json!(roots);
    }
    while !buffer.bytes.len().is_multiple_of(4) {
        buffer.bytes.push(0);
    }
    let mut root = json!({
        "asset": {"version": "2.0", "generator": concat!("paws ", env!("CARGO_PKG_VERSION"))},
        "scene": 0,
        "scenes": [{"name": twin.name, "nodes": [0]}],
        "nodes": nodes, "meshes": meshes, "materials": materials,
        "accessors": buffer.accessors, "bufferViews": buffer.views,
        "buffers": [{"byteLength": buffer.bytes.len()}],
    });
    if !animations.is_empty() {
        root["animations"] = json!(animations);
    }
    let text = serde_json::to_vec(&root).map_err(|e| Error::Export(format!("glTF: {e}")))?;
    let glb = Glb {
        header: Header { magic: *b"glTF", version: 2, length: 0 },
        json: text.into(),
        bin: Some(buffer.bytes.into()),
    };
    glb.to_vec().map_err(|e| Error::Export(format!("glTF: {e}")))
}

fn array(values: &[f64]) -> Vec<f64> {
    // glTF numbers are single precision; the nearest one is written, not 17 digits that a reader rounds anyway.
    values.iter().map(|v| f64::from(*v as f32)).collect()
}

fn push_box(nodes: &mut Vec<Value>, solid: &Solid, origin: &Point) -> usize {
    let pose = super::local_pose(&solid.shape, origin);
    let q = pose.rotation.quaternion();
    let mesh = ROLES.iter().position(|r| *r == solid.role).unwrap_or(0);
    nodes.push(json!({
        "name": solid.name, "mesh": mesh,
        "translation": array(pose.translation.vector.as_slice()),
        "rotation": array(&[q.i, q.j, q.k, q.w]),
        "scale": array((solid.shape.half * 2.0).as_slice()),
        "extras": {"role": solid.role, "seen": solid.seen},
    }));
    nodes.len() - 1
}

/// A cube of side 1 with flat normals: accessors of positions, normals, indices.
fn unit_cube(buffer: &mut Buffer) -> (usize, usize, usize) {
    const ARRAY_BUFFER: u32 = 34962;
    const ELEMENT_ARRAY_BUFFER: u32 = 34963;
    let (mut positions, mut normals, mut indices) = (Vec::new(), Vec::new(), Vec::<u16>::new());
    for axis in 0..3 {
        for sign in [-1.0f32, 1.0] {
            let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
            let first = positions.len() as u16;
            for (a, b) in [(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)] {
                let mut p = vec![0.0f32; 3];
                (p[axis], p[u], p[v]) = (0.5 * sign, a, b);
                let mut n = vec![0.0f32; 3];
                n[axis] = sign;
                positions.push(p);
                normals.push(n);
            }
            let winding = if sign > 0.0 { [0, 1, 2, 0, 2, 3] } else { [0, 2, 1, 0, 3, 2] };
            indices.extend(winding.map(|i| first + i));
        }
    }
    let data: Vec<u8> = indices.iter().flat_map(|i| i.to_le_bytes()).collect();
    let p = buffer.floats(&positions, "VEC3", Some(ARRAY_BUFFER));
    let n = buffer.floats(&normals, "VEC3", Some(ARRAY_BUFFER));
    let accessor = json!({"componentType": 5123, "count": indices.len(), "type": "SCALAR"});
    let i = buffer.push(&data, Some(ELEMENT_ARRAY_BUFFER), accessor);
    (p, n, i)
}

/// Closed, open, closed.
fn animation(buffer: &mut Buffer, node: usize, part: &crate::twin::Part) -> Value {
    let phi = part.joint.articulation;
    let steps = match phi.kind {
        JointKind::Revolute => (part.joint.upper / MAX_STEP_RAD).ceil().max(1.0) as usize,
        JointKind::Prismatic => 1,
    };
    let keys: Vec<f64> = (0..=2 * steps).map(|i| 1.0 - (i as f64 / steps as f64 - 1.0).abs()).collect();
    let times: Vec<Vec<f32>> = (0..=2 * steps).map(|i| vec![2.0 * OPEN_SECS * i as f32 / (2 * steps) as f32]).collect();
    let (path, kind, rows): (&str, &str, Vec<Vec<f32>>) = match phi.kind {
        JointKind::Revolute => (
            "rotation",
            "VEC4",
            keys.iter()
                .map(|k| {
                    let q = rotation(&phi.axis, part.joint.upper * k);
                    [q.i, q.j, q.k, q.w].map(|c| c as f32).to_vec()
                })
                .collect(),
        ),
        JointKind::Prismatic => (
            "translation",
            "VEC3",
            keys.iter()
                .map(|k| {
                    let p = phi.origin + phi.axis * (part.joint.upper * k);
                    p.coords.iter().map(|c| *c as f32).collect()
                })
                .collect(),
        ),
    };
    let input = buffer.floats(&times, "SCALAR", None);
    let output = buffer.floats(&rows, kind, None);
    json!({
        "name": format!("{}_open_close", part.id),
        "samplers": [{"input": input, "output": output, "interpolation": "LINEAR"}],
        "channels": [{"sampler": 0, "target": {"node": node, "path": path}}],
    })
}
