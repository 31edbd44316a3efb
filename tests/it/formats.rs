//! One model in every format: what is written is read back by other code and means the same.

use std::collections::BTreeMap;

use paws_twin::articulation::JointKind;
use paws_twin::export;
use paws_twin::math::{Point, Pose, Vector};
use paws_twin::synth::{Options, Tier};
use paws_twin::twin::{Twin, mass_properties};
use quick_xml::Reader;
use quick_xml::events::Event;

use crate::common::{record, twin_of};

fn sample() -> Twin {
    let dir = tempfile::tempdir().unwrap();
    record(&Options { seed: 11, tier: Tier::Clean, width: 240, parts: 4 }, dir.path());
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

#[test]
fn handles_are_in_the_same_place_in_every_format() {
    let twin = sample();
    let truth = of_model(&twin);
    let formats = [
        ("urdf", of_urdf(&export::urdf::write(&twin).unwrap())),
        ("mjcf", of_mjcf(&export::mjcf::write(&twin).unwrap())),
        ("gltf", of_glb(&export::gltf::write(&twin, &[]).unwrap())),
    ];
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
    let robot = urdf_rs::read_from_string(&export::urdf::write(&twin).unwrap()).unwrap();
    for f in &twin.furniture {
        for (name, solids) in [(&f.name, &f.carcass), (&format!("{}_link", f.part.id), &f.part.solids)] {
            let link = robot.links.iter().find(|l| l.name == *name).unwrap();
            let m = mass_properties(solids, twin.density_kg_per_m3).unwrap();
            let volume: f64 = solids.iter().map(|s| s.shape.volume()).sum();
            assert!((link.inertial.mass.value - 700.0 * volume).abs() < 1e-9 * m.mass.max(1.0));
            assert!((0.05..200.0).contains(&m.mass), "{name}: {} kg", m.mass);
            let mut i = m.inertia.symmetric_eigenvalues();
            i.as_mut_slice().sort_by(f64::total_cmp);
            assert!(i[0] > 0.0 && i[0] + i[1] >= i[2], "{name}: {i}");
        }
    }
}

#[test]
fn other_loaders_read_what_we_write() {
    let dir = tempfile::tempdir().unwrap();
    let twin = sample();
    let urdf = dir.path().join("scene.urdf");
    std::fs::write(&urdf, export::urdf::write(&twin).unwrap()).unwrap();
    let (robot, _) =
        rapier3d_urdf::UrdfRobot::from_file(&urdf, rapier3d_urdf::UrdfLoaderOptions::default(), None).unwrap();
    let moving = robot.joints.iter().filter(|j| !j.joint.limit_axes.is_empty()).count();
    assert_eq!(moving, 4);

    let mjcf = dir.path().join("scene.xml");
    std::fs::write(&mjcf, export::mjcf::write(&twin).unwrap()).unwrap();
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
    let good = sample();
    for (break_it, word) in [
        ((|t: &mut Twin| t.furniture[0].part.joint.upper = f64::NAN) as fn(&mut Twin), "upper limit"),
        (|t: &mut Twin| t.furniture[0].part.joint.articulation.axis *= 2.0, "unit vector"),
        (|t: &mut Twin| t.furniture[0].part.solids[0].shape.half.x = 0.0, "sizes must be positive"),
        (|t: &mut Twin| t.furniture[0].part.solids[0].shape.half.x = 1e300, "within 1000 m"),
        (|t: &mut Twin| t.furniture[0].part.joint.upper = 1e12, "upper limit"),
        (|t: &mut Twin| t.density_kg_per_m3 = 0.0, "density"),
        (|t: &mut Twin| t.furniture[0].name = "world".to_owned(), "used twice"),
        (|t: &mut Twin| t.furniture[0].part.id = "a\"><b".to_owned(), "letters, digits"),
        (|t: &mut Twin| t.furniture[1].name = t.furniture[0].name.clone(), "used twice"),
    ] {
        let mut twin = good.clone();
        break_it(&mut twin);
        for error in [
            export::urdf::write(&twin).unwrap_err().to_string(),
            export::mjcf::write(&twin).unwrap_err().to_string(),
            export::gltf::write(&twin, &[]).unwrap_err().to_string(),
        ] {
            assert!(error.contains(word), "{error}");
        }
    }
}
