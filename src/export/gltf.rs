//! Binary glTF: for viewers with one pivot node per joint at its hinge, boxes below it and an open-and-close animation per
//! joint; for engines with bodies, colliders and joints.
//!
//! Two files, because where a node is animated the animation moves it, not the physics.

use gltf::binary::{Glb, Header};
use serde_json::{Value, json};

use super::dress::{self, Dress, Piece};
use super::shared::{ROLES, ROOM, check, color, from_x, local_pose, material, principal};
use crate::articulation::JointKind;
use crate::error::{Error, Result};
use crate::look::{Look, Texture};
use crate::math::{Point, Pose, Vector, rotation};
use crate::twin::{Part, Solid, Twin, mass_properties};

/// Extensions of the file with physics. Readers that do not know them still show the scene: none is required.
const RIGID_BODIES: &str = "KHR_physics_rigid_bodies";
const SHAPES: &str = "KHR_implicit_shapes";
/// Format: seconds to open; closing takes as long again.
const OPEN_SECS: f32 = 1.5;
/// Format: rotations are interpolated the short way round: keyframes lie at most this far apart.
const MAX_STEP_RAD: f64 = 1.2;

/// Format: what views of the buffer are for, vertices.
const ARRAY_BUFFER: u32 = 34962;
/// Format: and indices.
const ELEMENT_ARRAY_BUFFER: u32 = 34963;
/// Format: component type of an accessor.
const U16: u32 = 5123;
/// Format: another one.
const U32: u32 = 5125;

/// Verdicts to show with the joints: (joint id, verdict).
pub type Verdicts<'a> = &'a [(String, String)];

/// Bytes of the binary chunk, and the accessors into them.
#[derive(Default)]
struct GltfBuffer {
    bytes: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
}

impl GltfBuffer {
    /// Adds a view; returns its index.
    fn view(&mut self, data: &[u8], target: Option<u32>) -> usize {
        while !self.bytes.len().is_multiple_of(4) {
            self.bytes.push(0);
        }
        let mut view = json!({"buffer": 0, "byteOffset": self.bytes.len(), "byteLength": data.len()});
        if let Some(target) = target {
            view["target"] = json!(target);
        }
        self.bytes.extend_from_slice(data);
        self.views.push(view);
        self.views.len() - 1
    }

    fn push(&mut self, data: &[u8], target: Option<u32>, mut accessor: Value) -> usize {
        accessor["bufferView"] = json!(self.view(data, target));
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

    /// One point or direction a vertex, with the bounds.
    fn vectors(&mut self, rows: &[[f32; 3]]) -> usize {
        let bound = |pick: fn(f32, f32) -> f32, start: f32| -> [f32; 3] {
            rows.iter().fold([start; 3], |b, r| std::array::from_fn(|c| pick(b[c], r[c])))
        };
        let data: Vec<u8> = rows.iter().flatten().flat_map(|f| f.to_le_bytes()).collect();
        let accessor = json!({
            "componentType": 5126, "count": rows.len(), "type": "VEC3",
            "min": bound(f32::min, f32::INFINITY), "max": bound(f32::max, f32::NEG_INFINITY),
        });
        self.push(&data, Some(ARRAY_BUFFER), accessor)
    }

    /// Texture coordinates, as shares of 65535.
    fn shares(&mut self, rows: &[[u16; 2]]) -> usize {
        let data: Vec<u8> = rows.iter().flatten().flat_map(|s| s.to_le_bytes()).collect();
        let accessor = json!({"componentType": U16, "normalized": true, "count": rows.len(), "type": "VEC2"});
        self.push(&data, Some(ARRAY_BUFFER), accessor)
    }

    /// Vertex numbers, in as few bytes as hold them: the largest number of a type is not allowed.
    fn indices(&mut self, triangles: &[[u32; 3]], vertices: usize) -> usize {
        let all = triangles.iter().flatten();
        let (kind, data): (u32, Vec<u8>) = if vertices <= usize::from(u16::MAX) {
            (U16, all.flat_map(|i| (*i as u16).to_le_bytes()).collect())
        } else {
            (U32, all.flat_map(|i| i.to_le_bytes()).collect())
        };
        let accessor = json!({"componentType": kind, "count": 3 * triangles.len(), "type": "SCALAR"});
        self.push(&data, Some(ELEMENT_ARRAY_BUFFER), accessor)
    }
}

/// Where a camera (OpenCV axes, `world_from_camera`) stands in the files written here: a matrix, column by column, to their
/// scene (+Y up) from a camera that looks along its -Z with +Y up.
#[must_use]
pub fn camera(world_from_camera: &Pose) -> [f64; 16] {
    let turn = rotation(&Vector::x(), -std::f64::consts::FRAC_PI_2);
    let over = rotation(&Vector::x(), std::f64::consts::PI);
    let pose = Pose::from_parts(
        (turn * world_from_camera.translation.vector).into(),
        turn * world_from_camera.rotation * over,
    );
    let matrix = pose.to_homogeneous();
    // Micrometres; no minus zero.
    std::array::from_fn(|i| (matrix[(i % 4, i / 4)] * 1e6).round() / 1e6 + 0.0)
}

/// A file in the making.
struct GltfDocument {
    buffer: GltfBuffer,
    meshes: Vec<Value>,
    materials: Vec<Value>,
    nodes: Vec<Value>,
    images: Vec<Value>,
}

impl GltfDocument {
    /// Materials, one box mesh a role, and node 0: -90 degrees about x turn +Z up into +Y up.
    fn new() -> Self {
        let mut buffer = GltfBuffer::default();
        let (positions, normals, indices) = unit_cube(&mut buffer);
        let materials = ROLES
            .iter()
            .map(|r| {
                json!({"name": material(*r), "pbrMetallicRoughness":
                    {"baseColorFactor": color(*r), "metallicFactor": 0.0, "roughnessFactor": 0.7}})
            })
            .collect();
        let meshes = ROLES
            .iter()
            .enumerate()
            .map(|(i, r)| {
                json!({"name": format!("box_{}", material(*r)), "primitives": [
                    {"attributes": {"POSITION": positions, "NORMAL": normals}, "indices": indices, "material": i}]})
            })
            .collect();
        let half = std::f64::consts::FRAC_1_SQRT_2;
        let nodes = vec![json!({"name": "scene", "rotation": [-half, 0.0, 0.0, half]})];
        Self { buffer, meshes, materials, nodes, images: Vec::new() }
    }

    /// Embeds pictures with a material each: plain surfaces, so that viewers light them as they light the rest.
    fn pictures(&mut self, textures: &[Texture]) -> Result<()> {
        for (texture, jpeg) in textures.iter().zip(dress::jpegs(textures)?) {
            let view = self.buffer.view(&jpeg, None);
            self.materials.push(json!({"name": dress::material(texture), "pbrMetallicRoughness":
                {"baseColorTexture": {"index": self.images.len()}, "metallicFactor": 0.0, "roughnessFactor": 1.0}}));
            self.images.push(json!({"name": texture.name, "bufferView": view, "mimeType": "image/jpeg"}));
        }
        Ok(())
    }

    /// Adds a textured mesh in a node of its own; returns the node. `link` is the part whose mesh it is, or the room.
    fn textured(&mut self, piece: &Piece, link: &str) -> usize {
        let positions = self.buffer.vectors(&piece.positions);
        let normals = self.buffer.vectors(&piece.normals);
        let uv = self.buffer.shares(&piece.uv);
        let indices = self.buffer.indices(&piece.triangles, piece.positions.len());
        self.meshes.push(json!({"name": piece.name, "primitives": [{
            "attributes": {"POSITION": positions, "NORMAL": normals, "TEXCOORD_0": uv},
            "indices": indices, "material": ROLES.len() + piece.index}]}));
        let mesh = self.meshes.len() - 1;
        self.push(json!({"name": piece.name, "mesh": mesh, "extras": {"look": {"link": link, "seen": piece.seen}}}))
    }

    /// Adds a node; returns its index.
    fn push(&mut self, node: Value) -> usize {
        self.nodes.push(node);
        self.nodes.len() - 1
    }

    /// The file: `more` are further entries of its root object.
    fn finish(mut self, name: &str, roots: &[usize], more: Vec<(&str, Value)>) -> Result<Vec<u8>> {
        if !roots.is_empty() {
            self.nodes[0]["children"] = json!(roots);
        }
        while !self.buffer.bytes.len().is_multiple_of(4) {
            self.buffer.bytes.push(0);
        }
        let mut root = json!({
            "asset": {"version": "2.0", "generator": concat!("paws ", env!("CARGO_PKG_VERSION"))},
            "scene": 0,
            "scenes": [{"name": name, "nodes": [0]}],
            "buffers": [{"byteLength": self.buffer.bytes.len()}],
        });
        // Moved: within `json!` each would be copied, node by node.
        for (key, list) in [
            ("nodes", self.nodes),
            ("meshes", self.meshes),
            ("materials", self.materials),
            ("accessors", self.buffer.accessors),
            ("bufferViews", self.buffer.views),
        ] {
            root[key] = Value::Array(list);
        }
        if !self.images.is_empty() {
            let textures: Vec<Value> = (0..self.images.len()).map(|i| json!({"source": i, "sampler": 0})).collect();
            root["textures"] = Value::Array(textures);
            // Smooth near and far; an atlas does not repeat.
            root["samplers"] = json!([{"magFilter": 9729, "minFilter": 9987, "wrapS": 33071, "wrapT": 33071}]);
            root["images"] = Value::Array(self.images);
        }
        for (key, value) in more {
            root[key] = value;
        }
        let text = serde_json::to_vec(&root).map_err(|e| Error::Export(format!("glTF: {e}")))?;
        let glb = Glb {
            header: Header { magic: *b"glTF", version: 2, length: 0 },
            json: text.into(),
            bin: Some(self.buffer.bytes.into()),
        };
        glb.to_vec().map_err(|e| Error::Export(format!("glTF: {e}")))
    }
}

/// The twin as GLB for viewers, with its look where it has one. World +Z up becomes glTF's +Y up in the root node.
///
/// A node of a textured mesh has `look` in its extras: the `link` (a joint's id, or `room`) and the share of its surface
/// that was `seen`. Boxes that it hides keep their nodes, without meshes.
///
/// # Errors
/// Where the twin cannot be a scene (see [`super::check`]), or what is wrong with the look.
pub fn write(twin: &Twin, look: Option<&Look>, verdicts: Verdicts) -> Result<Vec<u8>> {
    let dress = Dress::of(twin, look)?;
    let mut scene = GltfDocument::new();
    scene.pictures(dress.textures)?;
    let fixed = dress.room.is_empty();
    let mut roots = Vec::new();
    let mut animations = Vec::new();
    for f in &twin.furniture {
        let base = scene.push(json!({"name": f.name}));
        let mut children: Vec<usize> =
            f.carcass.iter().map(|s| push_box(&mut scene.nodes, s, &Point::origin(), fixed)).collect();
        let part = &f.part;
        let own = dress.part(&part.id);
        let origin = part.joint.articulation.origin;
        let mut extras = extras(part, twin);
        let verdict = verdicts.iter().find(|(id, _)| *id == part.id).map_or("unknown", |(_, v)| v.as_str());
        extras["joint"]["verdict"] = json!(verdict);
        let pivot = scene.push(json!({
            "name": part.id, "translation": array(origin.coords.as_slice()), "extras": extras,
        }));
        let mut part_children: Vec<usize> =
            part.solids.iter().map(|s| push_box(&mut scene.nodes, s, &origin, own.is_empty())).collect();
        part_children.extend(own.iter().map(|piece| scene.textured(piece, &part.id)));
        part_children.push(scene.push(handle(part)));
        scene.nodes[pivot]["children"] = json!(part_children);
        children.push(pivot);
        scene.nodes[base]["children"] = json!(children);
        roots.push(base);
        animations.push(animation(&mut scene.buffer, pivot, part));
    }
    if !(twin.room.is_empty() && fixed) {
        let room = scene.push(json!({"name": ROOM}));
        let mut children: Vec<usize> =
            twin.room.iter().map(|s| push_box(&mut scene.nodes, s, &Point::origin(), fixed)).collect();
        children.extend(dress.room.iter().map(|piece| scene.textured(piece, ROOM)));
        scene.nodes[room]["children"] = json!(children);
        roots.push(room);
    }
    let more = if animations.is_empty() { Vec::new() } else { vec![("animations", Value::Array(animations))] };
    scene.finish(&twin.name, &roots, more)
}

/// The twin as GLB for engines, with `KHR_physics_rigid_bodies` and `KHR_implicit_shapes`: each part is a body with mass
/// and inertia, each box a collider, each joint two frames with limits in radians or metres and a damper; carcasses and
/// the room collide and do not move. There is no animation in it, and no dry friction: the extension has none. Nor has it a
/// look: an engine's user sees what collides.
///
/// # Errors
/// Where the twin cannot be a scene (see [`super::check`]).
pub fn write_physics(twin: &Twin) -> Result<Vec<u8>> {
    check(twin)?;
    let mut scene = GltfDocument::new();
    let (mut shapes, mut joints, mut roots) = (Vec::new(), Vec::new(), Vec::new());
    for f in &twin.furniture {
        let part = &f.part;
        let phi = part.joint.articulation;
        let origin = array(phi.origin.coords.as_slice());
        let q = from_x(&phi.axis);
        let turn = array(&[q.i, q.j, q.k, q.w]);
        let base = scene.push(json!({"name": f.name}));
        let mut children = colliders(&mut scene, &mut shapes, &f.carcass, &Point::origin());

        let mut inside = colliders(&mut scene, &mut shapes, &part.solids, &phi.origin);
        inside.push(scene.push(handle(part)));
        // Frames are relative to the body they are in; closed, both of a joint are in the same place.
        let frame = scene.push(json!({"name": format!("{}_frame", part.id), "rotation": turn}));
        inside.push(frame);
        let body = scene.push(json!({
            "name": format!("{}_link", part.id), "translation": origin, "children": inside,
            "extensions": {RIGID_BODIES: {"motion": motion(part, twin.density_kg_per_m3)}},
        }));
        children.push(body);
        // The joint is the base's node: an opening is where the part is, seen from there.
        let joint = scene.push(json!({
            "name": part.id, "translation": origin, "rotation": turn,
            "extensions": {RIGID_BODIES: {"joint":
                {"connectedNode": frame, "joint": joints.len(), "enableCollision": false}}},
            "extras": extras(part, twin),
        }));
        children.push(joint);
        joints.push(limits(part));
        scene.nodes[base]["children"] = json!(children);
        roots.push(base);
    }
    if !twin.room.is_empty() {
        let children = colliders(&mut scene, &mut shapes, &twin.room, &Point::origin());
        roots.push(scene.push(json!({"name": ROOM, "children": children})));
    }
    let mut extensions = json!({});
    let mut used = Vec::new();
    if !shapes.is_empty() {
        extensions[SHAPES]["shapes"] = Value::Array(shapes);
        used.extend([SHAPES, RIGID_BODIES]);
    }
    if !joints.is_empty() {
        extensions[RIGID_BODIES]["physicsJoints"] = Value::Array(joints);
    }
    let more =
        if used.is_empty() { Vec::new() } else { vec![("extensionsUsed", json!(used)), ("extensions", extensions)] };
    scene.finish(&twin.name, &roots, more)
}

/// What a joint's node says to those who read no extension: rad, m, N, kg.
fn extras(part: &Part, twin: &Twin) -> Value {
    let (joint, phi) = (&part.joint, part.joint.articulation);
    json!({"joint": {
        "id": part.id, "label": part.label, "kind": phi.kind, "axis": phi.axis.as_slice(),
        "lower": 0.0, "upper": joint.upper, "observed": joint.observed, "expected": joint.expected,
        "damping": joint.damping, "friction": joint.friction, "resistance_seen": joint.resistance_seen,
        "balanced": joint.balanced, "effort": joint.effort(&twin.drives),
        "velocity": joint.velocity(&twin.drives),
        "mass": mass_properties(&part.solids, twin.density_kg_per_m3).map(|m| m.mass),
    }})
}

fn handle(part: &Part) -> Value {
    let local = part.handle - part.joint.articulation.origin;
    json!({"name": format!("{}_handle", part.id), "translation": array(local.as_slice())})
}

/// A part's mass and inertia in the frame of its node.
fn motion(part: &Part, density: f64) -> Value {
    let mut motion = json!({});
    if let Some(m) = mass_properties(&part.solids, density) {
        let (moments, axes) = principal(&m.inertia);
        let q = axes.quaternion();
        motion = json!({
            "mass": single(m.mass),
            "centerOfMass": array((m.center - part.joint.articulation.origin).as_slice()),
            "inertiaDiagonal": array(moments.as_slice()),
            "inertiaOrientation": array(&[q.i, q.j, q.k, q.w]),
        });
    }
    if part.joint.balanced {
        motion["gravityFactor"] = json!(0.0);
    }
    motion
}

/// A joint's limits and damper about or along the X axis of its frames.
fn limits(part: &Part) -> Value {
    let joint = &part.joint;
    let upper = single(joint.upper);
    let drive = |kind: &str| json!([{"type": kind, "mode": "force", "axis": 0, "velocityTarget": 0.0, "damping": single(joint.damping)}]);
    match joint.articulation.kind {
        JointKind::Revolute => json!({
            "limits": [
                {"linearAxes": [0, 1, 2], "min": 0.0, "max": 0.0},
                {"angularAxes": [1, 2], "min": 0.0, "max": 0.0},
                {"angularAxes": [0], "min": 0.0, "max": upper},
            ],
            "drives": drive("angular"),
        }),
        JointKind::Prismatic => json!({
            "limits": [
                {"linearAxes": [1, 2], "min": 0.0, "max": 0.0},
                {"angularAxes": [0, 1, 2], "min": 0.0, "max": 0.0},
                {"linearAxes": [0], "min": 0.0, "max": upper},
            ],
            "drives": drive("linear"),
        }),
    }
}

/// Boxes as colliders, each with its picture below it: a collider's node is not scaled. Returns the colliders' nodes.
fn colliders(scene: &mut GltfDocument, shapes: &mut Vec<Value>, solids: &[Solid], origin: &Point) -> Vec<usize> {
    let mut nodes = Vec::with_capacity(solids.len());
    for s in solids {
        let pose = local_pose(&s.shape, origin);
        let q = pose.rotation.quaternion();
        let size = array((s.shape.half * 2.0).as_slice());
        let picture = scene.push(json!({"name": format!("{}_visual", s.name), "mesh": mesh(s), "scale": size}));
        nodes.push(scene.push(json!({
            "name": s.name,
            "translation": array(pose.translation.vector.as_slice()),
            "rotation": array(&[q.i, q.j, q.k, q.w]),
            "children": [picture],
            "extensions": {RIGID_BODIES: {"collider": {"geometry": {"shape": shapes.len()}}}},
            "extras": {"role": s.role, "seen": s.seen},
        })));
        shapes.push(json!({"type": "box", "box": {"size": size}}));
    }
    nodes
}

/// The mesh of a box: one a role.
fn mesh(solid: &Solid) -> usize {
    ROLES.iter().position(|r| *r == solid.role).unwrap_or(0)
}

fn single(value: f64) -> f64 {
    // glTF numbers are single precision; the nearest one is written, not 17 digits that a reader rounds anyway.
    f64::from(value as f32)
}

fn array(values: &[f64]) -> Vec<f64> {
    values.iter().map(|v| single(*v)).collect()
}

/// Adds a box's node, with its mesh where it is `shown`: the node's scale is the box's size in any case.
fn push_box(nodes: &mut Vec<Value>, solid: &Solid, origin: &Point, shown: bool) -> usize {
    let pose = local_pose(&solid.shape, origin);
    let q = pose.rotation.quaternion();
    let mut node = json!({
        "name": solid.name,
        "translation": array(pose.translation.vector.as_slice()),
        "rotation": array(&[q.i, q.j, q.k, q.w]),
        "scale": array((solid.shape.half * 2.0).as_slice()),
        "extras": {"role": solid.role, "seen": solid.seen},
    });
    if shown {
        node["mesh"] = json!(mesh(solid));
    }
    nodes.push(node);
    nodes.len() - 1
}

/// A cube of side 1 with flat normals: accessors of positions, normals, indices.
fn unit_cube(buffer: &mut GltfBuffer) -> (usize, usize, usize) {
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
    let accessor = json!({"componentType": U16, "count": indices.len(), "type": "SCALAR"});
    let i = buffer.push(&data, Some(ELEMENT_ARRAY_BUFFER), accessor);
    (p, n, i)
}

/// Closed, open, closed.
fn animation(buffer: &mut GltfBuffer, node: usize, part: &Part) -> Value {
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
