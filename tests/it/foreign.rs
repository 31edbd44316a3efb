//! Anybody's files: our own exports read back, the ways in which models are broken, hostile files, a stranger's cabinet.

use std::collections::BTreeSet;
use std::path::Path;
use std::sync::LazyLock;

use paws_twin::articulation::JointKind;
use paws_twin::export::{self, ExportContext, FORMATS, Purpose};
use paws_twin::math::{Point, Vector};
use paws_twin::model::check::{self, PointVerdict};
use paws_twin::model::furniture::to_twin;
use paws_twin::model::{self, Model, glb};
use paws_twin::synth::{SynthOptions, Tier};
use paws_twin::twin::{Role, Twin};

use crate::common::{paws, record, stderr, twin_of};

static SAMPLE: LazyLock<Twin> = LazyLock::new(|| {
    let dir = tempfile::tempdir().unwrap();
    record(&SynthOptions { seed: 11, tier: Tier::Clean, width: 240, parts: 4 }, dir.path());
    twin_of(dir.path()).2
});

/// The sample's files, as `paws twin` writes them.
fn write_all(twin: &Twin, dir: &Path) {
    std::fs::write(dir.join("twin.json"), paws_twin::json::text(twin).unwrap()).unwrap();
    std::fs::write(dir.join("scene.urdf"), export::urdf::write(twin, None).unwrap()).unwrap();
    std::fs::write(dir.join("scene.xml"), export::mjcf::write(twin, None).unwrap()).unwrap();
    std::fs::write(dir.join("kitchen.xml"), export::mjcf::write_model(twin, None).unwrap()).unwrap();
    std::fs::write(dir.join("scene.glb"), export::gltf::write(twin, None, &[]).unwrap()).unwrap();
}

fn read_text(name: &str, text: &str) -> Model {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join(name);
    std::fs::write(&path, text).unwrap();
    model::read(&path).unwrap()
}

fn failing(model: &Model) -> Vec<(u8, String)> {
    check::model(model, None).into_iter().flat_map(|p| p.faults.into_iter().map(move |f| (p.id, f))).collect()
}

#[test]
fn every_model_that_we_write_is_judged_or_told_why_not() {
    let (twin, dir) = (&*SAMPLE, tempfile::tempdir().unwrap());
    for format in FORMATS.iter().filter(|format| format.purpose == Purpose::Model) {
        let written = (format.write)(twin, &ExportContext::default()).unwrap().files;
        for (file, bytes) in format.files.iter().zip(written) {
            let path = dir.path().join(file.name);
            std::fs::write(&path, bytes).unwrap();
            match (model::is_model(&path), model::is_gltf(&path)) {
                (true, true) => drop(glb::read(&path).unwrap()),
                (true, false) => drop(model::read(&path).unwrap()),
                (false, _) => {
                    let error = model::read(&path).unwrap_err().to_string();
                    assert!(error.contains(file.name) && error.contains(": is "), "{error}");
                }
            }
        }
    }
}

#[test]
fn what_we_write_is_read_back_as_the_same_twin() {
    let twin = &*SAMPLE;
    let urdf = read_text("scene.urdf", &export::urdf::write(twin, None).unwrap());
    let mjcf = read_text("scene.xml", &export::mjcf::write(twin, None).unwrap());
    for (model, handle_m) in [(urdf, 1e-5), (mjcf, 1e-9)] {
        let (back, notes) = to_twin(&model);
        let name = model.source.display();
        assert!(back.left_out.is_empty(), "{name}: {:?}", back.left_out);
        assert!((back.density_kg_per_m3 / twin.density_kg_per_m3 - 1.0).abs() < 1e-9, "{name}: {notes:?}");
        assert_eq!(back.furniture.len(), twin.furniture.len());
        for (f, g) in twin.furniture.iter().zip(&back.furniture) {
            let (a, b) = (&f.part.joint, &g.part.joint);
            let id = &f.part.id;
            assert_eq!(*id, g.part.id, "{name}");
            assert_eq!(a.articulation.kind, b.articulation.kind, "{name} {id}");
            assert!((a.articulation.axis - b.articulation.axis).norm() < 1e-9, "{name} {id}");
            if a.articulation.kind == JointKind::Revolute {
                assert!(a.articulation.line().distance(&b.articulation.origin) < 1e-9, "{name} {id}");
            }
            for (x, y) in [(a.upper, b.upper), (a.damping, b.damping), (a.friction, b.friction)] {
                assert!((x - y).abs() < 1e-9, "{name} {id}: {x} {y}");
            }
            assert!((f.part.handle - g.part.handle).norm() < handle_m, "{name} {id}");
            for (mine, theirs) in [(&f.part.solids, &g.part.solids), (&f.carcass, &g.carcass)] {
                assert_eq!(mine.len(), theirs.len(), "{name} {id}");
                for s in mine {
                    let t = theirs.iter().find(|t| t.name == s.name).unwrap();
                    assert!((s.shape.center - t.shape.center).norm() < 1e-9, "{name} {}", s.name);
                    assert!((s.shape.half - t.shape.half).norm() < 1e-9, "{name} {}", s.name);
                    assert!((s.shape.rotation - t.shape.rotation).norm() < 1e-9, "{name} {}", s.name);
                }
            }
            for share in [0.0, 0.3, 1.0] {
                let p = f.part.handle;
                let (here, there) =
                    (a.articulation.motion(share * a.upper) * p, b.articulation.motion(share * b.upper) * p);
                assert!((here - there).norm() < 1e-9, "{name} {id} at {share}");
            }
        }
    }
}

#[test]
fn what_we_write_passes_every_point_that_concerns_it() {
    let dir = tempfile::tempdir().unwrap();
    write_all(&SAMPLE, dir.path());
    for name in ["scene.urdf", "scene.xml", "kitchen.xml"] {
        let points = check::model(&model::read(&dir.path().join(name)).unwrap(), Some(&SAMPLE));
        let not: Vec<_> = points.iter().filter(|p| p.verdict == PointVerdict::NotApplicable).map(|p| p.id).collect();
        assert!(points.iter().all(|p| p.faults.is_empty()), "{name}: {points:?}");
        assert_eq!(not, if name == "scene.urdf" { vec![6, 7] } else { vec![7] }, "{name}");
    }
    let scene = glb::read(&dir.path().join("scene.glb")).unwrap();
    let points = check::scene(&scene, Some(&SAMPLE));
    assert!(points.iter().all(|p| p.faults.is_empty()), "{points:?}");
    assert_eq!(scene.moved.len(), SAMPLE.furniture.len());

    let out = paws(&["check", "."], dir.path());
    let text = String::from_utf8_lossy(&out.stdout);
    assert_eq!(out.status.code(), Some(0), "{text}{}", stderr(&out));
    assert!(text.contains("scene.urdf") && text.contains("kitchen.xml") && text.contains("scene.glb"), "{text}");
    assert!(text.contains("loads without a word") && !text.contains("FAIL"), "{text}");

    // One file that has drifted from the model fails the folder.
    let path = dir.path().join("scene.urdf");
    let id = &SAMPLE.furniture[0].part.id;
    let drifted = in_joint(&std::fs::read_to_string(&path).unwrap(), id, |joint| {
        between(joint, "<origin xyz=\"", "\"", |_| "<origin xyz=\"1 2 3\"".to_owned())
    });
    std::fs::write(&path, drifted).unwrap();
    let out = paws(&["check", ".", "--json"], dir.path());
    assert_eq!(out.status.code(), Some(1), "{}", stderr(&out));
    let all: serde_json::Value = serde_json::from_slice(&out.stdout).unwrap();
    let urdf = all.as_array().unwrap().iter().find(|c| c["file"].as_str().unwrap().ends_with("scene.urdf")).unwrap();
    let nine = urdf["points"].as_array().unwrap().iter().find(|p| p["id"] == 9).unwrap();
    assert_eq!(nine["verdict"], "fail");
    assert!(nine["faults"][0].as_str().unwrap().contains("mm off"), "{nine}");
}

/// Changes what stands between two texts, the first time they occur.
fn between(text: &str, from: &str, to: &str, change: impl Fn(&str) -> String) -> String {
    let start = text.find(from).unwrap_or_else(|| panic!("no {from}"));
    let after = start + from.len();
    let end = after + text[after..].find(to).unwrap() + to.len();
    format!("{}{}{}", &text[..start], change(&text[start..end]), &text[end..])
}

fn in_joint(urdf: &str, id: &str, change: impl Fn(&str) -> String) -> String {
    between(urdf, &format!("<joint name=\"{id}\""), "</joint>", change)
}

fn in_link(urdf: &str, id: &str, change: impl Fn(&str) -> String) -> String {
    between(urdf, &format!("<link name=\"{id}_link\""), "</link>", change)
}

/// The first part of a kind.
fn part_of(kind: JointKind) -> &'static str {
    &SAMPLE.furniture.iter().find(|f| f.part.joint.articulation.kind == kind).unwrap().part.id
}

/// Expects faults in these points and no others, one of them with these words.
fn expect(what: &str, model: &Model, points: &[u8], word: &str) {
    let found = failing(model);
    let ids: BTreeSet<u8> = found.iter().map(|(id, _)| *id).collect();
    assert_eq!(ids.into_iter().collect::<Vec<_>>(), points, "{what}: {found:?}");
    assert!(found.iter().any(|(_, f)| f.contains(word)), "{what}: {found:?}");
}

#[test]
fn each_broken_urdf_fails_the_point_that_is_broken() {
    let good = export::urdf::write(&SAMPLE, None).unwrap();
    let door = part_of(JointKind::Revolute);
    let any = |joint: &str| joint.to_owned();
    let without = |from: &'static str, to: &'static str| move |text: &str| between(text, from, to, |_| String::new());
    let axis = |change: fn(f64) -> f64| {
        move |joint: &str| {
            between(joint, "<axis xyz=\"", "\"/>", |found| {
                let numbers = found.trim_start_matches("<axis xyz=\"").trim_end_matches("\"/>");
                let changed: Vec<String> =
                    numbers.split_whitespace().map(|x| change(x.parse().unwrap()).to_string()).collect();
                format!("<axis xyz=\"{}\"/>", changed.join(" "))
            })
        }
    };
    assert!(failing(&read_text("m.urdf", &in_joint(&good, door, any))).is_empty());
    let cases: [(&str, String, &[u8], &str); 15] = [
        ("no limit", in_joint(&good, door, without("<limit ", "/>")), &[2], "no limits"),
        ("lower above upper", in_joint(&good, door, |j| j.replace("lower=\"0\"", "lower=\"9\"")), &[2], "is above"),
        ("0 outside", in_joint(&good, door, |j| j.replace("lower=\"0\"", "lower=\"0.01\"")), &[2], "is outside"),
        (
            "degrees",
            in_joint(&good, door, |j| between(j, "upper=\"", "\"", |_| "upper=\"110\"".to_owned())),
            &[2],
            "more than once around",
        ),
        ("axis 0", in_joint(&good, door, axis(|_| 0.0)), &[1, 2], "its axis is 0"),
        ("axis not unit", in_joint(&good, door, axis(|x| 2.0 * x)), &[2], "its axis has length 2"),
        ("no velocity", in_joint(&good, door, without(" velocity=\"", "\"")), &[1, 2], "no velocity"),
        ("no dynamics", in_joint(&good, door, without("<dynamics ", "/>")), &[2], "no damping"),
        ("no inertial", in_link(&good, door, without("<inertial>", "</inertial>")), &[3], "no <inertial>"),
        (
            "zero inertia",
            in_link(&good, door, |l| {
                let zero = "<inertia ixx=\"0\" ixy=\"0\" ixz=\"0\" iyy=\"0\" iyz=\"0\" izz=\"0\"/>";
                between(l, "<inertia ", "/>", |_| zero.to_owned())
            }),
            &[1, 3],
            "must be positive",
        ),
        ("no body's inertia", in_link(&good, door, |l| l.replacen("ixx=\"", "ixx=\"9", 1)), &[1, 3], "none may exceed"),
        (
            "light as a feather",
            in_link(&good, door, |l| between(l, "<mass value=\"", "\"", |_| "<mass value=\"0.004\"".to_owned())),
            &[3],
            "furniture's parts weigh",
        ),
        ("no world", good.replace("\"world\"", "\"site\""), &[4], "nothing holds site"),
        ("fused", between(&good, "<mujoco>", "</mujoco>", |_| String::new()), &[4], "melts"),
        (
            "no such link",
            in_joint(&good, door, |j| between(j, "<child link=\"", "\"/>", |_| "<child link=\"x\"/>".to_owned())),
            &[1],
            "child link x does not exist",
        ),
    ];
    for (what, text, points, word) in cases {
        // The texts that are cut must have been there.
        assert_ne!(text, good, "{what}");
        if what == "no such link" {
            let found = failing(&read_text("m.urdf", &text));
            assert!(found.iter().any(|(id, f)| *id == 1 && f.contains(word)), "{found:?}");
            continue;
        }
        expect(what, &read_text("m.urdf", &text), points, word);
    }
    let names: Vec<&str> = SAMPLE.furniture[0].part.solids.iter().map(|s| s.name.as_str()).collect();
    let twice =
        good.replace(&format!("<collision name=\"{}\"", names[1]), &format!("<collision name=\"{}\"", names[0]));
    let found = failing(&read_text("m.urdf", &twice));
    assert!(
        found.iter().any(|(id, f)| *id == 5 && f.contains("used more than once") && f.contains(names[0])),
        "{found:?}"
    );
}

/// The sample with every front pushed into its furniture.
fn deep(metres: f64) -> Twin {
    let mut twin = (*SAMPLE).clone();
    for f in &mut twin.furniture {
        let inward = -f.part.bounds.rotation.column(2).into_owned();
        for s in f.part.solids.iter_mut().filter(|s| s.role == Role::Front) {
            s.shape.center += inward * metres;
        }
    }
    twin
}

#[test]
fn fronts_that_stand_in_their_furniture_are_told_unless_excluded() {
    // The gap is 3 mm.
    let twin = deep(0.007);
    let urdf = failing(&read_text("m.urdf", &export::urdf::write(&twin, None).unwrap()));
    assert!(urdf.iter().any(|(id, f)| *id == 11 && f.contains("when closed")), "{urdf:?}");
    let text = export::mjcf::write(&twin, None).unwrap();
    let mjcf = failing(&read_text("m.xml", &text));
    assert!(!mjcf.iter().any(|(_, f)| f.contains("when closed")), "{mjcf:?}");
    let contact = between(&text, "<contact>", "</contact>", |_| String::new());
    let mjcf = failing(&read_text("m.xml", &contact));
    assert!(mjcf.iter().any(|(id, f)| *id == 11 && f.contains("when closed") && f.contains("<exclude>")), "{mjcf:?}");
}

#[test]
fn each_broken_mjcf_fails_the_point_that_is_broken() {
    let good = export::mjcf::write(&SAMPLE, None).unwrap();
    expect(
        "degrees",
        &read_text("m.xml", &good.replace("angle=\"radian\"", "angle=\"degree\"")),
        &[2, 6],
        "angles are degrees",
    );
    expect("autolimits", &read_text("m.xml", &good.replace(" limited=\"true\"", "")), &[6], "hang on autolimits");
    let mut light = good.clone();
    while light.contains("<inertial ") {
        light = between(&light, "<inertial ", "/>", |_| String::new());
    }
    expect("no inertial", &read_text("m.xml", &light), &[3], "as heavy as water");
    let door = part_of(JointKind::Revolute);
    let floats = good.replacen("<body name=\"kitchen\">", "<body name=\"kitchen\"><freejoint name=\"float\"/>", 1);
    let floating = read_text("m.xml", &floats);
    expect("free base", &floating, &[4], "kitchen carries moving parts and floats");
    // The keyframes are those of a base that stands.
    assert!(floating.notes.iter().any(|n| n.contains("MuJoCo takes the rest from the model")), "{:?}", floating.notes);
    let nan = between(&good, &format!("<joint name=\"{door}\""), "/>", |j| j.replacen("range=\"0 ", "range=\"NaN ", 1));
    let dir = tempfile::tempdir().unwrap();
    std::fs::write(dir.path().join("nan.xml"), nan).unwrap();
    let error = model::read(&dir.path().join("nan.xml")).unwrap_err().to_string();
    assert!(
        error.contains("nan.xml") && error.contains(door) && error.contains("not finite") && error.contains("line"),
        "{error}"
    );
}

#[test]
fn hostile_files_are_refused_by_name() {
    let dir = tempfile::tempdir().unwrap();
    let good = export::urdf::write(&SAMPLE, None).unwrap();
    let write = |name: &str, bytes: &[u8]| std::fs::write(dir.path().join(name), bytes).unwrap();
    write("empty.urdf", b"");
    write("cut.urdf", &good.as_bytes()[..good.len() / 2]);
    write("deep.urdf", format!("<robot>{}", "<link>".repeat(1_000_000)).as_bytes());
    write("name.urdf", format!("<robot><link name=\"{}\"/></robot>", "x".repeat(10 << 20)).as_bytes());
    write(
        "numbers.urdf",
        format!(
            "<robot><link name=\"a\"><visual><geometry><box size=\"{}\"/></geometry></visual></link></robot>",
            "1 ".repeat(1 << 20)
        )
        .as_bytes(),
    );
    write("text.urdf", b"\xff\xfe\x00\x01");
    write("other.xml", b"<html/>");
    write("entities.xml", b"<!DOCTYPE m [<!ENTITY a \"aaaa\"><!ENTITY b \"&a;&a;\">]><mujoco model=\"&b;\"/>");
    write("loop_a.xml", b"<mujoco><include file=\"loop_b.xml\"/></mujoco>");
    write("loop_b.xml", b"<mujoco><include file=\"loop_a.xml\"/></mujoco>");
    write("broken.glb", b"glTF\x02\0\0\0\x01\0\0\0");
    std::fs::File::create(dir.path().join("large.urdf")).unwrap().set_len(70 << 20).unwrap();
    for (name, word) in [
        ("empty.urdf", "no XML element"),
        ("cut.urdf", "cut off"),
        ("deep.urdf", "deeper than"),
        ("name.urdf", "longer than 256 bytes"),
        ("numbers.urdf", "expected 3 numbers"),
        ("text.urdf", "not UTF-8"),
        ("other.xml", "expected <robot>"),
        ("entities.xml", "entities"),
        ("loop_a.xml", "a second time"),
        ("broken.glb", "not valid"),
        ("large.urdf", "above 64 MiB"),
        ("nowhere.urdf", "no such file"),
    ] {
        let out = paws(&["check", name], dir.path());
        let message = stderr(&out);
        assert_eq!(out.status.code(), Some(2), "{name}: {message}");
        let file = if name == "loop_a.xml" { "loop_b.xml" } else { name };
        assert!(message.contains(file) && message.contains(word), "{name}: {message}");
        assert!(!message.contains("panicked") && message.len() < 1000, "{name}: {message}");
    }
    // What MuJoCo reads is read, from a sibling folder, too.
    write("outside.xml", b"<mujoco><worldbody><body name=\"beside\"/></worldbody></mujoco>");
    std::fs::create_dir(dir.path().join("inner")).unwrap();
    write("inner/m.xml", b"<mujoco><include file=\"../outside.xml\"/></mujoco>");
    let model = model::read(&dir.path().join("inner/m.xml")).unwrap();
    assert!(model.links.iter().any(|l| l.name == "beside") && model.unread.is_empty(), "{:?}", model.unread);
}

/// A cabinet as others write them: nested classes, degrees, another sequence of angles, a door that opens towards minus.
const CABINET: &str = r#"<mujoco model="cabinet">
  <compiler eulerseq="zyx"/>
  <option timestep="0.002"/>
  <default>
    <geom density="600"/>
    <default class="furniture">
      <joint damping="1" frictionloss="0.5" limited="true"/>
      <default class="panel"><geom type="box"/></default>
      <default class="hinge"><joint axis="0 0 3" range="-110 0" armature="0.01"/></default>
    </default>
  </default>
  <worldbody>
    <geom type="plane" size="5 5 0.1"/>
    <body name="cabinet" pos="1 2 0.4" euler="90 0 0" childclass="furniture">
      <geom class="panel" size="0.01 0.25 0.4" pos="-0.29 0 0"/>
      <geom class="panel" size="0.01 0.25 0.4" pos="0.29 0 0"/>
      <geom class="panel" size="0.3 0.01 0.4" pos="0 0.24 0"/>
      <body name="door" pos="-0.3 -0.27 0">
        <joint name="door_joint" class="hinge"/>
        <geom class="panel" size="0.295 0.009 0.39" pos="0.3 0 0"/>
        <geom name="door_handle" type="capsule" size="0.01" fromto="0.55 -0.05 -0.1 0.55 -0.05 0.1" mass="0.1"/>
      </body>
    </body>
  </worldbody>
</mujoco>
"#;

/// Lines of `t x y z` of a handle that is opened.
fn opening(part: &paws_twin::twin::Part, far: f64) -> String {
    let phi = part.joint.articulation;
    (0..=60)
        .map(|i| {
            // Slow at both ends, as a hand is.
            let s = f64::from(i) / 60.0;
            let p = phi.motion(far * s * s * (3.0 - 2.0 * s)) * part.handle;
            format!("{} {} {} {}\n", f64::from(i) / 30.0, p.x, p.y, p.z)
        })
        .collect()
}

#[test]
fn a_strangers_cabinet_is_read_checked_and_replayed() {
    let dir = tempfile::tempdir().unwrap();
    std::fs::write(dir.path().join("cabinet.xml"), CABINET).unwrap();
    let model = model::read(&dir.path().join("cabinet.xml")).unwrap();
    let j = &model.joints[1];
    assert_eq!((j.name.as_str(), j.damping, j.friction, j.armature), ("door_joint", Some(1.0), Some(0.5), Some(0.01)));
    expect("the cabinet", &model, &[6], "angles are degrees");
    let (twin, notes) = to_twin(&model);
    let part = &twin.furniture[0].part;
    let phi = part.joint.articulation;
    assert!((phi.axis + Vector::z()).norm() < 1e-12 && phi.line().distance(&Point::new(1.27, 1.7, 9.0)) < 1e-12);
    assert!((part.joint.upper - 110f64.to_radians()).abs() < 1e-12);
    assert!((part.handle - Point::new(1.32, 2.25, 0.4)).norm() < 1e-12, "{}", part.handle);
    assert_eq!((part.solids.len(), twin.furniture[0].carcass.len()), (2, 3));
    assert!(notes.iter().any(|n| n.contains("closed is taken to be at")), "{notes:?}");

    std::fs::write(dir.path().join("open.csv"), opening(part, 1.4)).unwrap();
    for argument in ["open.csv", "door_joint=open.csv"] {
        let out = paws(&["validate", "cabinet.xml", "--trajectory", argument, "--out", "v.json"], dir.path());
        let text = String::from_utf8_lossy(&out.stdout);
        assert_ne!(out.status.code(), Some(2), "{}", stderr(&out));
        assert!(text.contains("door_joint") && text.contains("open"), "{text}");
        assert!(dir.path().join("v.json").exists());
    }
    for (args, word) in [
        (&["validate", "cabinet.xml"][..], "--trajectory [JOINT=]FILE"),
        (&["validate", "cabinet.xml", "--trajectory", "drawer=open.csv"][..], "no joint drawer"),
        (&["validate", "cabinet.xml", "--trajectory", "gone.csv"][..], "gone.csv: no such file"),
    ] {
        let out = paws(args, dir.path());
        assert_eq!(out.status.code(), Some(2), "{word}");
        assert!(stderr(&out).contains(word), "{}", stderr(&out));
    }
}

#[test]
fn a_path_without_a_name_goes_to_the_joint_that_it_fits() {
    let dir = tempfile::tempdir().unwrap();
    write_all(&SAMPLE, dir.path());
    let part = &SAMPLE.furniture.last().unwrap().part;
    std::fs::write(dir.path().join("path.csv"), opening(part, 0.8 * part.joint.upper)).unwrap();
    let out = paws(&["validate", "scene.urdf", "--trajectory", "path.csv"], dir.path());
    assert_ne!(out.status.code(), Some(2), "{}", stderr(&out));
    assert!(stderr(&out).contains(&format!("taken to move {}", part.id)), "{}", stderr(&out));
}
