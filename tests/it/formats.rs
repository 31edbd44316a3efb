//! One model in every format: what is written is read back by other code and means the same.

use std::collections::{BTreeMap, BTreeSet};

use paws_twin::articulation::JointKind;
use paws_twin::export::{self, ExportContext, FORMATS, Purpose};
use paws_twin::math::{Point, Pose, Vector};
use paws_twin::synth::{SynthOptions, Tier};
use paws_twin::twin::{OrientedBox, Role, Solid, Twin, mass_properties};
use quick_xml::Reader;
use quick_xml::events::Event;

use crate::common::{record, twin_of};

fn sample() -> Twin {
    let dir = tempfile::tempdir().unwrap();
    record(&SynthOptions { seed: 11, tier: Tier::Clean, width: 240, parts: 4 }, dir.path());
    let twin = twin_of(dir.path()).2;
    assert_eq!(twin.furniture.len(), 4);
    let kinds: Vec<JointKind> = twin.furniture.iter().map(|f| f.part.joint.articulation.kind).collect();
    assert!(kinds.contains(&JointKind::Revolute) && kinds.contains(&JointKind::Prismatic), "{kinds:?}");
    twin
}

/// Where a format puts each handle at a share of its joint's range.
type Handles = BTreeMap<String, [Point; 3]>;
const SHARES: [f64; 3] = [0.0, 0.5, 1.0];

fn of_model(twin: &Twin) -> Handles {
    let at = |p: &paws_twin::twin::Part| SHARES.map(|s| p.joint.articulation.motion(s * p.joint.upper) * p.handle);
    twin.furniture.iter().map(|f| (f.part.id.clone(), at(&f.part))).collect()
}

fn of_urdf(text: &str) -> Handles {
    let robot = urdf_rs::read_from_string(text).unwrap();
    let mut out = Handles::new();
    for joint in robot.joints.iter().filter(|j| j.joint_type != urdf_rs::JointType::Fixed) {
        let link = robot.links.iter().find(|l| l.name == joint.child.link).unwrap();
        let bar = link.collision.iter().find(|c| c.name.as_deref().unwrap().ends_with("handle_bar")).unwrap();
        let (origin, axis) = (Point::from(*joint.origin.xyz), Vector::from(*joint.axis.xyz));
        assert!((joint.limit.lower, joint.limit.effort > 0.0, joint.limit.velocity > 0.0) == (0.0, true, true));
        let dynamics = joint.dynamics.as_ref().unwrap();
        assert!(dynamics.damping > 0.0 && dynamics.friction > 0.0);
        assert!(joint.origin.rpy.iter().all(|r| *r == 0.0));
        let local = Vector::from(*bar.origin.xyz);
        let places = SHARES.map(|s| {
            let q = s * joint.limit.upper;
            match joint.joint_type {
                urdf_rs::JointType::Prismatic => origin + local + axis * q,
                _ => origin + nalgebra::UnitQuaternion::from_scaled_axis(axis * q) * local,
            }
        });
        out.insert(joint.name.clone(), places);
    }
    out
}

fn numbers(text: &str) -> Vec<f64> {
    text.split_whitespace().map(|w| w.parse().unwrap()).collect()
}

fn of_mjcf(text: &str) -> Handles {
    let mut reader = Reader::from_str(text);
    let (mut out, mut bodies, mut joint) = (Handles::new(), Vec::<Vector>::new(), None);
    loop {
        let event = reader.read_event().unwrap();
        let (element, empty) = match &event {
            Event::Start(e) => (e, false),
            Event::Empty(e) => (e, true),
            Event::End(e) => {
                if e.name().as_ref() == "body" {
                    bodies.pop();
                }
                continue;
            }
            Event::Eof => break,
            _ => continue,
        };
        let get = |name: &str| element.try_get_attribute(name).unwrap().map(|a| a.value.to_string());
        match element.name().as_ref() {
            "body" => {
                assert!(!empty);
                bodies.push(get("pos").map_or(Vector::zeros(), |p| Vector::from_row_slice(&numbers(&p))));
            }
            "joint" if get("axis").is_some() => {
                let slide = get("class").unwrap() == "slide";
                let axis = Vector::from_row_slice(&numbers(&get("axis").unwrap()));
                joint = Some((get("name").unwrap(), slide, axis, numbers(&get("range").unwrap())[1]));
            }
            "site" => {
                let (name, slide, axis, upper) = joint.clone().unwrap();
                let body = bodies.iter().fold(Vector::zeros(), |s, b| s + b);
                let local = Vector::from_row_slice(&numbers(&get("pos").unwrap()));
                let places = SHARES.map(|s| {
                    let q = s * upper;
                    let moved = if slide {
                        local + axis * q
                    } else {
                        nalgebra::UnitQuaternion::from_scaled_axis(axis * q) * local
                    };
                    Point::from(body + moved)
                });
                out.insert(name, places);
            }
            _ => {}
        }
    }
    out
}

/// From the nodes and the keyframes of the animation (closed, ..., open in the middle).
fn of_glb(bytes: &[u8]) -> Handles {
    let gltf = gltf::Gltf::from_slice(bytes).unwrap();
    let blob = gltf.blob.as_deref().unwrap();
    let root = gltf.default_scene().unwrap().nodes().next().unwrap();
    let (_, rotation, _) = root.transform().decomposed();
    let up = nalgebra::UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(
        f64::from(rotation[3]),
        f64::from(rotation[0]),
        f64::from(rotation[1]),
        f64::from(rotation[2]),
    ));
    assert!((up * Vector::z() - Vector::y()).norm() < 1e-6, "+Z up must become +Y up");
    let vector = |v: [f32; 3]| Vector::new(f64::from(v[0]), f64::from(v[1]), f64::from(v[2]));
    let mut out = Handles::new();
    for animation in gltf.animations() {
        let channel = animation.channels().next().unwrap();
        let node = channel.target().node();
        let name = node.name().unwrap().to_owned();
        let extras: serde_json::Value = serde_json::from_str(node.extras().as_ref().unwrap().get()).unwrap();
        let upper = extras["joint"]["upper"].as_f64().unwrap();
        let axis: Vector = serde_json::from_value(extras["joint"]["axis"].clone()).unwrap();
        let handle = node.children().find(|c| c.name() == Some(&format!("{name}_handle"))).unwrap();
        let local = vector(handle.transform().decomposed().0);
        let origin = vector(node.transform().decomposed().0);
        let reader = channel.reader(|_| Some(blob));
        let opened: Pose = match reader.read_outputs().unwrap() {
            gltf::animation::util::ReadOutputs::Rotations(r) => {
                let all: Vec<[f32; 4]> = r.into_f32().collect();
                let q = all[all.len() / 2].map(f64::from);
                let q = nalgebra::UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(q[3], q[0], q[1], q[2]));
                Pose::from_parts(origin.into(), q)
            }
            gltf::animation::util::ReadOutputs::Translations(t) => {
                let all: Vec<[f32; 3]> = t.collect();
                Pose::from_parts(vector(all[all.len() / 2]).into(), nalgebra::UnitQuaternion::identity())
            }
            _ => panic!("unexpected channel"),
        };
        let slide = extras["joint"]["kind"] == "prismatic";
        let half = if slide {
            origin + axis * (0.5 * upper) + local
        } else {
            origin + nalgebra::UnitQuaternion::from_scaled_axis(axis * (0.5 * upper)) * local
        };
        out.insert(name, [Point::from(origin + local), Point::from(half), opened * Point::from(local)]);
    }
    out
}

/// A joint that turns about or slides along the X axis of its frame, opened by `q`.
fn along_x(slide: bool, q: f64) -> Pose {
    if slide { Pose::translation(q, 0.0, 0.0) } else { Pose::rotation(Vector::x() * q) }
}

fn pose(position: &[f64], [w, i, j, k]: [f64; 4]) -> Pose {
    let turn = nalgebra::UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(w, i, j, k));
    Pose::from_parts(Vector::from_row_slice(position).into(), turn)
}

fn same(a: &Pose, b: &Pose) -> bool {
    (a.translation.vector - b.translation.vector).norm() < 1e-5 && a.rotation.angle_to(&b.rotation) < 1e-5
}

/// A prim of our USD: its type and what is said of it, by name, as text.
struct Prim {
    kind: String,
    said: BTreeMap<String, String>,
}

impl Prim {
    fn numbers(&self, name: &str) -> Vec<f64> {
        let plain = self.said[name].replace(['(', ')', '[', ']', ','], " ");
        numbers(&plain)
    }

    fn number(&self, name: &str) -> f64 {
        self.numbers(name)[0]
    }

    /// Where it is in its parent: our bodies are only shifted.
    fn place(&self) -> Vector {
        Vector::from_row_slice(&self.numbers("xformOp:translate"))
    }

    fn target(&self, name: &str) -> &str {
        self.said[name].trim_matches(['<', '>'])
    }
}

/// Prims by their paths. Reads the USD that we write, a statement a line, and no other.
fn prims(text: &str) -> BTreeMap<String, Prim> {
    let mut all = BTreeMap::<String, Prim>::new();
    let (mut path, mut metadata) = (Vec::<String>::new(), false);
    for line in text.lines().map(str::trim) {
        if let Some(head) = line.strip_prefix("def ") {
            let (kind, name) = head.split_once(' ').unwrap();
            metadata = name.ends_with('(');
            path.push(name.trim_end_matches([' ', '(']).trim_matches('"').to_owned());
            let prim = Prim { kind: kind.to_owned(), said: BTreeMap::new() };
            assert!(all.insert(format!("/{}", path.join("/")), prim).is_none(), "{path:?} twice");
        } else if line == "(" || line == ")" {
            metadata = line == "(";
        } else if line == "}" && !metadata {
            path.pop().unwrap();
        } else if let (Some((left, right)), false) = (line.split_once(" = "), path.is_empty()) {
            let prim = all.get_mut(&format!("/{}", path.join("/"))).unwrap();
            prim.said.insert(left.rsplit(' ').next().unwrap().to_owned(), right.to_owned());
        }
    }
    assert!(path.is_empty());
    all
}

fn of_usda(text: &str) -> Handles {
    let all = prims(text);
    let mut out = Handles::new();
    for (path, joint) in &all {
        let slide = match joint.kind.as_str() {
            "PhysicsRevoluteJoint" => false,
            "PhysicsPrismaticJoint" => true,
            _ => continue,
        };
        assert_eq!((joint.said["physics:axis"].as_str(), joint.number("physics:lowerLimit")), ("\"X\"", 0.0));
        let [(base, in_base), (_, in_part)] = [0, 1].map(|i| {
            let body = &all[joint.target(&format!("physics:body{i}"))];
            let turn: [f64; 4] = joint.numbers(&format!("physics:localRot{i}")).try_into().unwrap();
            let frame = pose(&joint.numbers(&format!("physics:localPos{i}")), turn);
            (Pose::from_parts(body.place().into(), nalgebra::UnitQuaternion::identity()), frame)
        });
        let part = joint.target("physics:body1");
        let closed = Pose::from_parts(all[part].place().into(), nalgebra::UnitQuaternion::identity());
        assert!(same(&(base * in_base), &(closed * in_part)), "{path}: its frames differ");
        let id = path.rsplit('/').next().unwrap();
        let local = Point::from(all[&format!("{part}/{id}_handle")].place());
        let unit = if slide { 1.0 } else { std::f64::consts::PI / 180.0 };
        let upper = joint.number("physics:upperLimit") * unit;
        let places = SHARES.map(|s| base * in_base * along_x(slide, s * upper) * in_part.inverse() * local);
        out.insert(id.to_owned(), places);
    }
    out
}

const RIGID_BODIES: &str = "KHR_physics_rigid_bodies";

fn json_of(glb: &[u8]) -> serde_json::Value {
    serde_json::from_slice(&gltf::binary::Glb::from_slice(glb).unwrap().json).unwrap()
}

fn of_physics(bytes: &[u8]) -> Handles {
    // It is a file for every reader of glTF.
    assert!(gltf::Gltf::from_slice(bytes).unwrap().animations().next().is_none());
    let json = json_of(bytes);
    assert!(json.get("extensionsRequired").is_none());
    let nodes = json["nodes"].as_array().unwrap();
    let list = |v: &serde_json::Value| -> Vec<f64> { serde_json::from_value(v.clone()).unwrap() };
    let parent = |i: usize| {
        nodes
            .iter()
            .position(|n| n["children"].as_array().is_some_and(|c| c.iter().any(|c| c.as_u64() == Some(i as u64))))
    };
    let local = |i: usize| {
        let position = nodes[i].get("translation").map_or(vec![0.0; 3], list);
        let turn = nodes[i].get("rotation").map_or([1.0, 0.0, 0.0, 0.0], |r| {
            let q = list(r);
            [q[3], q[0], q[1], q[2]]
        });
        pose(&position, turn)
    };
    // In the world: the root, node 0, only turns it.
    let world = |mut i: usize| {
        let mut at = local(i);
        while let Some(above) = parent(i).filter(|p| *p != 0) {
            at = local(above) * at;
            i = above;
        }
        at
    };
    let limits = &json["extensions"][RIGID_BODIES]["physicsJoints"];
    let mut out = Handles::new();
    for (i, node) in nodes.iter().enumerate() {
        let joint = &node["extensions"][RIGID_BODIES]["joint"];
        let Some(connected) = joint["connectedNode"].as_u64() else { continue };
        let frame = connected as usize;
        let body = parent(frame).unwrap();
        assert!(nodes[body]["extensions"][RIGID_BODIES]["motion"]["mass"].as_f64().unwrap() > 0.0);
        assert!(same(&world(i), &world(frame)), "{node}");
        let free = &limits[joint["joint"].as_u64().unwrap() as usize]["limits"][2];
        let slide = free.get("linearAxes").is_some();
        assert_eq!(free[if slide { "linearAxes" } else { "angularAxes" }], serde_json::json!([0]));
        let name = node["name"].as_str().unwrap().to_owned();
        let handle = nodes.iter().position(|n| n["name"] == format!("{name}_handle").as_str()).unwrap();
        assert_eq!(parent(handle), Some(body));
        let hand = Point::from(local(handle).translation.vector);
        let upper = free["max"].as_f64().unwrap();
        out.insert(name, SHARES.map(|s| world(i) * along_x(slide, s * upper) * local(frame).inverse() * hand));
    }
    out
}

#[test]
fn handles_are_in_the_same_place_in_every_format() {
    let twin = sample();
    let truth = of_model(&twin);
    let formats = [
        ("urdf", of_urdf(&export::urdf::write(&twin, None).unwrap())),
        ("mjcf", of_mjcf(&export::mjcf::write(&twin, None).unwrap())),
        ("gltf", of_glb(&export::gltf::write(&twin, None, &[]).unwrap())),
        ("gltf-physics", of_physics(&export::gltf::write_physics(&twin).unwrap())),
        ("usd", of_usda(&export::usd::write(&twin, None).unwrap())),
    ];
    let models = FORMATS.iter().filter(|format| format.purpose == Purpose::Model).map(|format| format.name);
    assert_eq!(formats.iter().map(|(name, _)| *name).collect::<BTreeSet<_>>(), models.collect::<BTreeSet<_>>());
    for (name, handles) in formats {
        assert_eq!(handles.len(), truth.len(), "{name}");
        for (id, places) in &truth {
            for (share, (a, b)) in SHARES.iter().zip(places.iter().zip(&handles[id])) {
                assert!((a - b).norm() < 1e-5, "{name} {id} at {share}: {a} {b}");
            }
        }
    }
}

#[test]
fn masses_are_density_times_volume_and_inertias_are_possible() {
    let twin = sample();
    let robot = urdf_rs::read_from_string(&export::urdf::write(&twin, None).unwrap()).unwrap();
    let usd = prims(&export::usd::write(&twin, None).unwrap());
    let physics = json_of(&export::gltf::write_physics(&twin).unwrap());
    let viewed = json_of(&export::gltf::write(&twin, None, &[]).unwrap());
    let node = |json: &serde_json::Value, name: &str| {
        json["nodes"].as_array().unwrap().iter().find(|n| n["name"] == name).unwrap().clone()
    };
    for f in &twin.furniture {
        let id = &f.part.id;
        let mass = mass_properties(&f.part.solids, twin.density_kg_per_m3).unwrap().mass;
        let body = node(&physics, &format!("{id}_link"));
        let single = body["extensions"][RIGID_BODIES]["motion"]["mass"].as_f64().unwrap();
        assert!((single - mass).abs() < 1e-6 * mass);
        assert_eq!(node(&viewed, id)["extras"]["joint"]["mass"], mass);
        for (name, solids) in [(&f.name, &f.carcass), (&format!("{}_link", f.part.id), &f.part.solids)] {
            let link = robot.links.iter().find(|l| l.name == *name).unwrap();
            let m = mass_properties(solids, twin.density_kg_per_m3).unwrap();
            let volume: f64 = solids.iter().map(|s| s.shape.volume()).sum();
            assert!((link.inertial.mass.value - 700.0 * volume).abs() < 1e-9 * m.mass.max(1.0));
            assert!((0.05..200.0).contains(&m.mass), "{name}: {} kg", m.mass);
            let prim = &usd[&format!("/kitchen/{id}_furniture/{name}")];
            assert!((prim.number("physics:mass") - m.mass).abs() < 1e-6 * m.mass);
            let mut i = m.inertia.symmetric_eigenvalues();
            i.as_mut_slice().sort_by(f64::total_cmp);
            assert!(i[0] > 0.0 && i[0] + i[1] >= i[2], "{name}: {i}");
        }
    }
}

/// A twin with a floor and a wall, and a spring on its first part.
fn furnished() -> Twin {
    let mut twin = sample();
    for (i, piece) in twin.furniture.iter_mut().enumerate() {
        piece.part.joint.balanced = i == 0;
    }
    let solid = |name: &str, center: Point, half: Vector| Solid {
        name: name.to_owned(),
        role: Role::Room,
        shape: OrientedBox { center, half, rotation: nalgebra::Matrix3::identity() },
        seen: true,
    };
    twin.room = vec![
        solid("room_floor", Point::new(0.0, 0.0, -1.05), Vector::new(4.0, 4.0, 0.05)),
        solid("room_wall", Point::new(0.0, 9.0, 1.0), Vector::new(4.0, 0.05, 2.0)),
    ];
    twin
}

#[test]
fn no_part_sticks_in_the_floors_plane() {
    let mut twin = furnished();
    let corners = |twin: &Twin| -> f64 {
        let solids = twin.furniture.iter().flat_map(|f| &f.part.solids);
        solids.flat_map(|s| s.shape.corners()).map(|c| c.z).fold(f64::INFINITY, f64::min)
    };
    let lowest = corners(&twin);
    // Its surface is 5 cm above the lowest part; the room's own floor may end before that part, a plane does not.
    twin.room[0].shape.center.z = lowest;
    let text = export::mjcf::write(&twin, None).unwrap();
    let floor = text.split("name=\"floor\"").nth(1).unwrap();
    let place = floor.split("pos=\"").nth(1).unwrap().split('"').next().unwrap();
    let height: f64 = place.split(' ').nth(2).unwrap().parse().unwrap();
    assert!(height < lowest, "{height} {lowest}");
}

#[test]
fn the_room_stands_still_and_springs_carry_in_every_format_that_can_say_so() {
    let twin = furnished();
    let balanced = &twin.furniture[0].part.id;

    let text = export::urdf::write(&twin, None).unwrap();
    let robot = urdf_rs::read_from_string(&text).unwrap();
    let holds = |name: &str| {
        robot
            .joints
            .iter()
            .any(|j| j.joint_type == urdf_rs::JointType::Fixed && j.parent.link == "world" && j.child.link == name)
    };
    assert!(holds("room") && twin.furniture.iter().all(|f| holds(&f.name)));
    assert_eq!(robot.links.iter().find(|l| l.name == "room").unwrap().collision.len(), 2);
    assert_eq!(text.matches("<limit").count(), twin.furniture.len(), "fixed joints have no limits");

    let text = export::mjcf::write(&twin, None).unwrap();
    assert_eq!(text.matches("gravcomp=\"1\"").count(), 1);
    assert!(text.contains(&format!("<body name=\"{balanced}_link\"")) && text.contains("<body name=\"room\">"));
    let plane = text.lines().find(|l| l.contains("type=\"plane\"")).unwrap();
    assert_eq!(numbers(plane.split("pos=\"").nth(1).unwrap().split('"').next().unwrap())[2], -1.0);

    let usd = prims(&export::usd::write(&twin, None).unwrap());
    let with = |api: &str| usd.values().filter(|p| p.said.get("apiSchemas").is_some_and(|a| a.contains(api))).count();
    assert_eq!(with("PhysicsArticulationRootAPI"), twin.furniture.len());
    assert_eq!(with("PhysicsRigidBodyAPI"), 2 * twin.furniture.len());
    assert_eq!(with("PhysxRigidBodyAPI"), 1);
    let solids: usize = twin.furniture.iter().map(|f| f.carcass.len() + f.part.solids.len()).sum();
    assert_eq!(with("PhysicsCollisionAPI"), solids + 2);
    assert!(usd.contains_key("/kitchen/room/room_wall") && !usd["/kitchen/room"].said.contains_key("apiSchemas"));

    let physics = json_of(&export::gltf::write_physics(&twin).unwrap());
    let nodes = physics["nodes"].as_array().unwrap();
    let moving: Vec<&str> = nodes
        .iter()
        .filter(|n| n["extensions"][RIGID_BODIES]["motion"].is_object())
        .map(|n| n["name"].as_str().unwrap())
        .collect();
    assert_eq!(moving, twin.furniture.iter().map(|f| format!("{}_link", f.part.id)).collect::<Vec<_>>());
    assert_eq!(nodes.iter().filter(|n| n["extensions"][RIGID_BODIES]["collider"].is_object()).count(), solids + 2);
    // The extension wants colliders on nodes that are not scaled.
    assert!(nodes.iter().all(|n| n["extensions"].is_null() || n["scale"].is_null()));
    let floating = nodes.iter().filter(|n| n["extensions"][RIGID_BODIES]["motion"]["gravityFactor"] == 0.0).count();
    assert_eq!(floating, 1);
    for glb in [physics, json_of(&export::gltf::write(&twin, None, &[]).unwrap())] {
        let room = glb["nodes"].as_array().unwrap().iter().find(|n| n["name"] == "room").unwrap().clone();
        assert_eq!(room["children"].as_array().unwrap().len(), 2);
    }
}

#[test]
fn usd_counts_hinges_in_degrees() {
    let twin = sample();
    let usd = prims(&export::usd::write(&twin, None).unwrap());
    for f in &twin.furniture {
        let prim = &usd[&format!("/kitchen/{0}_furniture/{0}", f.part.id)];
        let joint = &f.part.joint;
        let (drive, per) = match joint.articulation.kind {
            JointKind::Revolute => ("angular", 180.0 / std::f64::consts::PI),
            JointKind::Prismatic => ("linear", 1.0),
        };
        let near = |value: f64, wanted: f64| (value - wanted).abs() < 1e-6 * wanted;
        assert!(near(prim.number("physics:upperLimit"), joint.upper * per));
        assert!(near(prim.number(&format!("drive:{drive}:physics:damping")), joint.damping / per));
        assert_eq!(prim.number(&format!("drive:{drive}:physics:stiffness")), 0.0);
        assert_eq!(prim.said["physics:collisionEnabled"], "0");
        assert_eq!((prim.number("observed"), prim.number("expected")), (joint.observed, joint.expected));
        // Held to the world, which is not named.
        let fixed = &usd[&format!("/kitchen/{}_furniture/{}_fixed", f.part.id, f.name)];
        assert!(fixed.kind == "PhysicsFixedJoint" && !fixed.said.contains_key("physics:body0"));
    }
}

#[test]
fn joints_of_elsewhere_become_files_in_every_format() {
    let dir = tempfile::tempdir().unwrap();
    let example = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/joints.json");
    let out = crate::common::paws(&["export", example.to_str().unwrap(), "--out", "files"], dir.path());
    assert!(out.status.success(), "{}", crate::common::stderr(&out));
    let files = crate::common::tree(&dir.path().join("files"));
    let names: Vec<&str> = files.keys().map(String::as_str).collect();
    let wanted = [
        "kitchen.xml",
        "physics.glb",
        "primitives.json",
        "scene.glb",
        "scene.urdf",
        "scene.usda",
        "scene.usdz",
        "scene.xml",
        "twin.json",
    ];
    assert_eq!(names, wanted);
    let twin: Twin = serde_json::from_slice(&files["twin.json"]).unwrap();
    assert_eq!(of_model(&twin).len(), 2);
    assert_eq!(twin.furniture[1].part.joint.articulation.axis, -Vector::y(), "positive opens");

    let good = std::fs::read_to_string(&example).unwrap();
    for (from, to, words) in [
        ("\"axis\": [0, 0, -1]", "\"axis\": [0, 0, -2]", ["wall_door", "axis"]),
        ("\"axis\": [0, 0, -1]", "\"axis\": [0, 0, NaN]", ["line 10", "NaN and Infinity are not JSON"]),
        ("\"range\": [0, 1.92]", "\"range\": [0, 110]", ["wall_door", "degrees"]),
        ("\"origin\": [-0.3, 0, 1.6]", "\"origin\": [-300, 0, 1600]", ["wall_door", "millimetres"]),
        ("\"label\": \"cutlery\"", "\"lable\": \"cutlery\"", ["lable", "label"]),
        ("\"joints\"", "\"joint\"", ["furniture", "joints-format.md"]),
    ] {
        let broken = good.replace(from, to);
        assert_ne!(broken, good, "{from}");
        std::fs::write(dir.path().join("broken.json"), broken).unwrap();
        let out = crate::common::paws(&["export", "broken.json", "--out", "none"], dir.path());
        let message = crate::common::stderr(&out);
        assert_eq!(out.status.code(), Some(2), "{message}");
        assert!(words.iter().chain(&["broken.json"]).all(|w| message.contains(w)), "{message}, not {words:?}");
        assert!(!dir.path().join("none").exists());
    }
}

#[test]
fn other_loaders_read_what_we_write() {
    let dir = tempfile::tempdir().unwrap();
    let twin = sample();
    let urdf = dir.path().join("scene.urdf");
    std::fs::write(&urdf, export::urdf::write(&twin, None).unwrap()).unwrap();
    let (robot, _) =
        rapier3d_urdf::UrdfRobot::from_file(&urdf, rapier3d_urdf::UrdfLoaderOptions::default(), None).unwrap();
    let moving = robot.joints.iter().filter(|j| !j.joint.limit_axes.is_empty()).count();
    assert_eq!(moving, 4);

    let mjcf = dir.path().join("scene.xml");
    std::fs::write(&mjcf, export::mjcf::write(&twin, None).unwrap()).unwrap();
    let (robot, _) = rapier3d_mjcf::MjcfRobot::from_file(&mjcf, rapier3d_mjcf::MjcfLoaderOptions::default()).unwrap();
    assert!(robot.bodies.len() >= 8);
}

#[test]
fn the_command_exports_the_formats_asked_for() {
    let dir = tempfile::tempdir().unwrap();
    std::fs::write(dir.path().join("twin.json"), paws_twin::json::text(&sample()).unwrap()).unwrap();
    let out = crate::common::paws(&["export", "twin.json", "--format", "urdf,gltf", "--out", "files"], dir.path());
    assert!(out.status.success(), "{}", crate::common::stderr(&out));
    let mut names: Vec<String> = std::fs::read_dir(dir.path().join("files"))
        .unwrap()
        .map(|e| e.unwrap().file_name().to_string_lossy().into_owned())
        .collect();
    names.sort();
    assert_eq!(names, ["scene.glb", "scene.urdf"]);
}

#[test]
fn a_twin_that_no_simulator_takes_is_refused() {
    let good = furnished();
    for (break_it, word) in [
        ((|t: &mut Twin| t.furniture[0].part.joint.upper = f64::NAN) as fn(&mut Twin), "upper limit"),
        (|t: &mut Twin| t.furniture[0].part.joint.articulation.axis *= 2.0, "unit vector"),
        (|t: &mut Twin| t.furniture[0].part.solids[0].shape.half.x = 0.0, "sizes must be positive"),
        (|t: &mut Twin| t.furniture[0].part.solids[0].shape.half.x = 1e300, "within 1000 m"),
        (|t: &mut Twin| t.furniture[0].part.joint.upper = 1e12, "upper limit"),
        (|t: &mut Twin| t.density_kg_per_m3 = 0.0, "density"),
        (|t: &mut Twin| t.furniture[0].name = "world".to_owned(), "used twice"),
        (|t: &mut Twin| t.room[0].name = "room".to_owned(), "used twice"),
        (|t: &mut Twin| t.room[1].shape.half.y = -1.0, "room_wall: sizes must be positive"),
        (|t: &mut Twin| t.furniture[0].name = "1st".to_owned(), "no digit"),
        (|t: &mut Twin| t.furniture[0].part.id = "a\"><b".to_owned(), "letters, digits"),
        (|t: &mut Twin| t.furniture[1].name = t.furniture[0].name.clone(), "used twice"),
    ] {
        let mut twin = good.clone();
        break_it(&mut twin);
        for format in FORMATS.iter().filter(|format| format.purpose == Purpose::Model) {
            let error = (format.write)(&twin, &ExportContext::default()).unwrap_err().to_string();
            assert!(error.contains(word), "{}: {error}", format.name);
        }
    }
}
