//! MJCF files as people have them, held to what MuJoCo makes of them.

use std::path::{Path, PathBuf};

use paws_twin::error::Result;
use paws_twin::math::{Point, Vector};
use paws_twin::model::check::{self, PointVerdict};
use paws_twin::model::furniture::to_twin;
use paws_twin::model::{self, JointType, Model};

use crate::common::{paws, stderr};

fn file(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/mjcf").join(name)
}

fn read(name: &str) -> Result<Model> {
    model::read(&file(name))
}

fn points(name: &str) -> Vec<check::CheckedPoint> {
    check::model(&read(name).unwrap(), None)
}

fn point(name: &str, id: u8) -> check::CheckedPoint {
    points(name).into_iter().find(|p| p.id == id).unwrap()
}

#[test]
fn what_mujoco_refuses_does_not_load_without_a_word() {
    for (name, word) in [
        ("actuator_bad", "there is no joint \"nojoint\""),
        ("autolimits_false_range", "autolimits is off"),
        ("b_plugin_sdf", "needs a mesh"),
        ("dup_body_name", "\"frame\" is the name of a second body"),
        ("dup_geom_name", "\"panel\" is the name of a second geom"),
        ("exclude_bad", "there is no body \"nobody\""),
        ("inertial_nodiag", "leaf: moves, and neither it"),
        ("inertial_nopos", "needs the attribute \"pos\""),
        ("keyframe_bad", "qpos has 3 numbers, the model 1"),
        ("limited_true_norange", "which is no range"),
        ("material_unknown", "there is no material \"wood\""),
        ("mesh_builtin", "its mesh is flat and cannot collide"),
        ("mesh_missing", "nowhere.obj: there is no such file"),
        ("plane_body", "a plane may only stand still"),
        ("texture_missing", "no.png: there is no such file"),
        ("typo_elem", "line 8, <goem name=\"x\">: MJCF has no such element"),
        ("unknown_attr", "has no attribute \"apirate\""),
        ("unknown_elem", "<region name=\"r\">: MJCF has no such element"),
    ] {
        let one = point(&format!("12_mjcf/{name}.xml"), 1);
        assert_eq!(one.verdict, PointVerdict::Fail, "{name}");
        assert!(one.faults.iter().any(|f| f.contains(word)), "{name}: {:?}", one.faults);
    }
    for (name, word) in [
        ("12_mjcf/class_unknown.xml", "no default class \"nope\""),
        ("12_mjcf/coord_global.xml", "global coordinates"),
        ("12_mjcf/pos_nan.xml", "not finite"),
        ("12_mjcf/b_inc.xml", "expected <robot>"),
        ("13_include/twice.xml", "a second time"),
    ] {
        let error = read(name).unwrap_err().to_string();
        assert!(error.contains(word), "{name}: {error}");
    }
}

#[test]
fn what_mujoco_loads_loads() {
    for name in [
        "b_actuatorfrc",
        "b_body_in_default",
        "b_damping0",
        "b_euler",
        "b_exclude_world",
        "b_fit_geom",
        "b_gravity",
        "b_joint_pos",
        "b_margin_gap",
        "b_meshdir_include",
        "b_mirror_mesh",
        "b_nameless",
        "b_overlap_static_parent",
        "b_range_deg_in_rad",
        "b_range_rad_in_deg",
        "b_stiff_spring",
        "b_two_joints",
        "ball",
        "bom",
        "childclass",
        "class_override",
        "contype0",
        "degree_explicit_drawer",
        "degrees_default",
        "equality_joint",
        "equality_weld",
        "eulerseq_bad",
        "eulerseq_xyz_caps",
        "exclude_welded",
        "frame_wrap",
        "free_door",
        "fromto_box",
        "gravcomp",
        "limited_false_range",
        "mesh_inline",
        "mesh_offcentre",
        "mesh_refpos",
        "mocap_door",
        "no_angles_drawer",
        "ok",
        "range00_auto",
        "range_reversed_auto",
        "ref",
        "replicate",
        "settotalmass",
        "size_nconmax",
        "springref",
        "strippath",
        "two_defaults",
    ] {
        let one = point(&format!("12_mjcf/{name}.xml"), 1);
        assert_eq!(one.verdict, PointVerdict::Pass, "{name}: {:?}", one.faults);
    }
}

/// What point 1 says of a text: its verdict and its faults.
fn loads(text: &str) -> (PointVerdict, Vec<String>) {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("m.xml");
    std::fs::write(&path, text).unwrap();
    let one = check::model(&model::read(&path).unwrap(), None).into_iter().find(|p| p.id == 1).unwrap();
    (one.verdict, one.faults)
}

/// A body with a hinge, one that floats, and more beside the world.
fn scene(before: &str, body: &str, after: &str) -> String {
    format!(
        r#"<mujoco>{before}<worldbody><body name="a"><joint name="j"/><geom name="g" size=".1"/><site name="s"/></body>
        <body name="b"><freejoint name="free"/><geom name="h" size=".1"/><site name="t"/></body>{body}</worldbody>{after}</mujoco>"#
    )
}

#[test]
fn values_that_mujoco_refuses_are_told() {
    // Each is refused by MuJoCo 4.0.
    for (body, word) in [
        ("<geom type='plane' size='1 1'/>", "third size of a plane"),
        ("<geom type='plane'/>", "third size of a plane"),
        ("<geom size='1' condim='5'/>", "it is 1, 3, 4 or 6"),
        ("<geom size='1' group='1.5'/>", "no whole number"),
        ("<geom size='1' quat='1 0 0 0' euler='0 0 1'/>", "says how it is turned"),
        ("<body><geom size='.1' mass='-1'/></body>", "is negative"),
        ("<body><joint axis='0 0 0'/><geom size='.1'/></body>", "its axis is 0"),
        ("<body><joint type='ball' range='1 10'/><geom size='.1'/></body>", "begins at 0"),
        ("<body><joint springdamper='0 1'/><geom size='.1'/></body>", "springdamper"),
        ("<body><joint actuatorfrclimited='true'/><geom size='.1'/></body>", "actuatorfrcrange"),
        ("<body><joint type='ball'/><joint/><geom size='.1'/></body>", "behind a ball"),
        (
            "<body><joint/><joint/><joint/><joint/><joint/><joint/><joint/><geom size='.1'/></body>",
            "more than 6 degrees of freedom",
        ),
        ("<frame><joint/></frame>", "the world has no joints"),
        ("<camera fovy='180'/>", "below 180"),
        ("<site size='-1'/>", "must be positive"),
        ("<site type='plane'/>", "not for sites"),
        ("<site fromto='0 0 0 0 0 1' type='sphere'/>", "fromto is not for"),
        ("<body><plugin plugin='foo'/><geom size='.1'/></body>", "no plugin \"foo\" is declared in <extension>"),
        ("<body><plugin/><geom size='.1'/></body>", "neither plugin nor instance"),
        (
            "<body><joint/><inertial pos='0 0 0' mass='1' fullinertia='1 1 1 0 0 0' diaginertia='1 1 1'/></body>",
            "both fullinertia and diaginertia",
        ),
        ("<body><joint axis='0 0 1e-8'/><geom size='.1'/></body>", "its axis is 0"),
    ] {
        let (verdict, faults) = loads(&scene("", body, ""));
        assert!(verdict == PointVerdict::Fail && faults.iter().any(|f| f.contains(word)), "{body}: {faults:?}");
    }
    for (before, word) in [
        ("<asset><texture name='t'/></asset>", "neither file nor builtin"),
        ("<asset><texture type='2d' name='t' builtin='flat' width='4'/></asset>", "width and height"),
        ("<asset><texture builtin='flat' width='4' height='4'/></asset>", "has no name"),
        ("<asset><material/></asset>", "has no name"),
        ("<asset><hfield name='h' nrow='1' ncol='2' size='1 1 1 1'/></asset>", "2 or more"),
        ("<asset><hfield name='h' nrow='2' ncol='2' size='1 1 0 1'/></asset>", "must be positive"),
        ("<asset><model name='m' file='gone.xml'/></asset>", "gone.xml: there is no such file"),
        ("<statistic extent='0'/>", "extent must be positive"),
        ("<extension><plugin plugin='foo.bar'/></extension>", "plugin \"foo.bar\" does not come with MuJoCo"),
        ("<size memory='10Q'/>", "memory=\"10Q\" is no size"),
        ("<size memory=''/>", "is no size"),
        ("<size memory='10M' njmax='5'/>", "both memory and njmax"),
        ("<size nstack='-2'/>", "nstack must not be below -1"),
        ("<custom><text name='a' data=''/></custom>", "its text is empty"),
        ("<custom><numeric name='a'/></custom>", "holds 0 numbers"),
        ("<custom><numeric name='a' size='1' data='1 2'/></custom>", "more numbers than size"),
        ("<custom><tuple name='a'/></custom>", "is empty: add elements"),
    ] {
        let (verdict, faults) = loads(&scene(before, "", ""));
        assert!(verdict == PointVerdict::Fail && faults.iter().any(|f| f.contains(word)), "{before}: {faults:?}");
    }
    for (after, word) in [
        ("<equality><weld/></equality>", "ties nothing"),
        ("<equality><connect body1='a' body2='b'/></equality>", "ties nothing"),
        ("<equality><weld body1='a' body2='a'/></equality>", "ties a body to itself"),
        ("<equality><joint joint1='free'/></equality>", "neither a hinge nor a slide"),
        ("<equality><joint joint1='j' joint2='j'/></equality>", "ties a joint to itself"),
        ("<actuator><motor joint='j' ctrllimited='true'/></actuator>", "no ctrlrange that goes up"),
        ("<actuator><motor joint='j' forcelimited='true' forcerange='1 0'/></actuator>", "no forcerange that goes up"),
        ("<actuator><damper joint='j' kv='1'/></actuator>", "no ctrlrange that goes up"),
        ("<actuator><motor cranksite='s'/></actuator>", "slidersite"),
        ("<tendon><fixed/></tendon>", "its path is empty"),
        ("<tendon><fixed limited='true'><joint joint='j' coef='1'/></fixed></tendon>", "no range that goes up"),
        (
            "<tendon><fixed actuatorfrclimited='true'><joint joint='j' coef='1'/></fixed></tendon>",
            "no actuatorfrcrange",
        ),
        ("<tendon><fixed springlength='1 0'><joint joint='j' coef='1'/></fixed></tendon>", "springlength"),
        ("<tendon><spatial width='0'><site site='s'/><site site='t'/></spatial></tendon>", "width must be positive"),
        (
            "<compiler autolimits='false'/><tendon><fixed range='0 1'><joint joint='j' coef='1'/></fixed></tendon>",
            "autolimits is off",
        ),
        (
            "<default><tendon limited='true'/></default><tendon><fixed><joint joint='j' coef='1'/></fixed></tendon>",
            "no range that goes up",
        ),
        ("<tendon><fixed><joint joint='j'/></fixed></tendon>", "needs the attribute \"coef\""),
        ("<tendon><fixed><joint joint='free' coef='1'/></fixed></tendon>", "neither a hinge nor a slide"),
        ("<tendon><spatial><site site='s'/></spatial></tendon>", "two sites or geoms"),
        ("<sensor><jointpos joint='free'/></sensor>", "neither a hinge nor a slide"),
        ("<sensor><ballquat joint='j'/></sensor>", "is no ball"),
        ("<sensor><jointlimitpos joint='j'/></sensor>", "has no limits"),
        ("<sensor><jointpos joint='j' noise='-1'/></sensor>", "must not be negative"),
        ("<keyframe><key ctrl='0'/></keyframe>", "ctrl has 1 numbers, the model 0"),
    ] {
        let (verdict, faults) = loads(&scene("", "", after));
        assert!(verdict == PointVerdict::Fail && faults.iter().any(|f| f.contains(word)), "{after}: {faults:?}");
    }
}

#[test]
fn values_that_mujoco_takes_pass() {
    for (before, body, after) in [
        ("", "<geom type='plane' size='0 0 .1'/>", ""),
        ("", "<geom size='1' condim='4' group=' 1 ' priority='+1'/>", ""),
        (
            "",
            "<body><joint/><inertial pos='0 0 0' mass='1' diaginertia='1 1 1'/><geom size='.1' mass='-1'/></body>",
            "",
        ),
        ("", "<body><joint type='ball' axis='0 0 0'/><geom size='.1'/></body>", ""),
        ("", "<body><joint/><joint type='ball'/><geom size='.1'/></body>", ""),
        ("", "<site type='box' size='1'/>", ""),
        ("<asset><texture type='skybox' builtin='gradient' width='4'/></asset>", "", ""),
        ("<asset><texture name='t' builtin='flat' width='4'/></asset>", "", ""),
        // All actuators share their defaults.
        (
            "<default><general ctrlrange='-1 1'/></default>",
            "",
            "<actuator><motor joint='j' ctrllimited='true'/></actuator>",
        ),
        ("", "", "<actuator><motor joint='j' ctrlrange='1 0'/></actuator>"),
        ("", "", "<equality><connect site1='s' site2='t'/></equality>"),
        (
            "<size memory='10k' nconmax='5'/>",
            "",
            "<custom><text name='a' data=' '/><numeric name='b' size='3'/></custom>",
        ),
        (
            "<extension><plugin plugin='mujoco.elasticity.cable'><instance name='i'/></plugin></extension>",
            "<body><plugin instance='i'/><geom size='.1'/></body><body><plugin plugin='mujoco.elasticity.cable'/></body>",
            "<tendon><fixed limited='true' range='0 1'><joint joint='j' coef='1'/></fixed></tendon>",
        ),
        ("", "<body><inertial pos='0 0 0' mass='1' fullinertia='1 1 1 0 0 0' diaginertia='0 0 0'/></body>", ""),
        // The rest is the model's own pose.
        ("", "", "<keyframe><key qpos='0' qvel='0 0'/></keyframe>"),
        (
            "<asset><mesh name='m' builtin='plate' params='4 4'/></asset>",
            "<geom type='mesh' mesh='m' contype='0' conaffinity='0'/>",
            "",
        ),
    ] {
        let (verdict, faults) = loads(&scene(before, body, after));
        assert_eq!(verdict, PointVerdict::Pass, "{before}{body}{after}: {faults:?}");
    }
}

#[test]
fn an_order_of_euler_angles_is_judged_where_it_is_used() {
    let turned = |attributes: &str| {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("m.xml");
        let text = scene("<compiler eulerseq='zxq'/>", &format!("<body {attributes}><geom size='.1'/></body>"), "");
        std::fs::write(&path, text).unwrap();
        model::read(&path).map(|_| ()).map_err(|e| e.to_string())
    };
    assert_eq!(turned("quat='0 1 0 0'"), Ok(()));
    assert!(turned("euler='0 0 1'").unwrap_err().contains("eulerseq has a letter that is none of"));
}

#[test]
fn a_flag_that_switches_limits_off_leaves_none() {
    let door = std::fs::read_to_string(file("12_mjcf/ok.xml")).unwrap();
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("m.xml");
    for (flags, limited) in [
        ("<flag limit=\"disable\"/>", false),
        ("<flag constraint=\"disable\"/>", false),
        ("<flag limit=\"disable\"/></option><option><flag limit=\"enable\"/>", true),
        ("<flag contact=\"enable\"/>", true),
    ] {
        let text = door.replacen("<worldbody>", &format!("<option>{flags}</option><worldbody>"), 1);
        std::fs::write(&path, text).unwrap();
        let model = model::read(&path).unwrap();
        assert_eq!(model.moving().all(|(_, j)| j.limits().is_some()), limited, "{flags}");
        let two = check::model(&model, None).into_iter().find(|p| p.id == 2).unwrap();
        assert_eq!(
            two.faults.iter().any(|f| f.contains("a <flag> of the file switches all limits off")),
            !limited,
            "{two:?}"
        );
    }
}

#[test]
fn a_joint_that_is_held_is_left_out_of_the_twin_with_its_reason() {
    let (twin, _) = to_twin(&read("12_mjcf/equality_weld.xml").unwrap());
    assert!(twin.furniture.is_empty() && twin.left_out.len() == 1, "{:?}", twin.left_out);
    assert!(twin.left_out[0].id == "hinge" && twin.left_out[0].reason.contains("<weld> holds it fast"));
    let (twin, notes) = to_twin(&read("12_mjcf/contype0.xml").unwrap());
    assert_eq!(twin.furniture.len(), 1);
    assert!(
        notes.iter().any(|n| n.starts_with("hinge: none of its part's shapes takes part in contacts")),
        "{notes:?}"
    );
}

#[test]
fn bodies_beside_the_world_are_lost_and_not_refused() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("m.xml");
    std::fs::write(&path, "<mujoco>\n<body name=\"lost\"><geom size=\"1\"/></body></mujoco>").unwrap();
    let points = check::model(&model::read(&path).unwrap(), None);
    assert_eq!(points[0].verdict, PointVerdict::Pass, "{points:?}");
    let four = points.iter().find(|p| p.id == 4).unwrap();
    assert!(four.faults.iter().any(|f| f.starts_with("line 2, <body name=\"lost\">: stands outside")), "{four:?}");
}

#[test]
fn an_attached_model_brings_its_own_materials() {
    let dir = tempfile::tempdir().unwrap();
    std::fs::write(dir.path().join("child.xml"), "<mujoco><asset><material name=\"oak\"/></asset></mujoco>").unwrap();
    let path = dir.path().join("m.xml");
    let text = r#"<mujoco><asset><model name="c" file="child.xml"/></asset><worldbody>
        <geom size="1" material="oak"/><attach model="c" prefix=""/></worldbody></mujoco>"#;
    std::fs::write(&path, text).unwrap();
    let points = check::model(&model::read(&path).unwrap(), None);
    assert_eq!(points[0].verdict, PointVerdict::NotJudged, "{points:?}");
}

#[test]
fn includes_are_read_where_mujoco_reads_them() {
    for name in ["inside.xml", "nested_beside.xml", "scene/outside.xml"] {
        let name = format!("13_include/{name}");
        let model = read(&name).unwrap();
        assert_eq!(model.moving().map(|(_, j)| j.name.as_str()).collect::<Vec<_>>(), ["hinge"], "{name}");
        assert!(model.unread.is_empty() && model.moving().all(|(_, j)| j.limits() == Some([0.0, 1.5])), "{name}");
        assert!(points(&name).iter().all(|p| p.faults.is_empty()), "{name}: {:?}", points(&name));
    }
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("m.xml");
    std::fs::write(&path, "<mujoco>\n<include file=\"gone.xml\"/>\n</mujoco>").unwrap();
    let points = check::model(&model::read(&path).unwrap(), None);
    // What cannot be read without the missing file says so.
    let other = dir.path().join("other.xml");
    std::fs::write(&other, "<mujoco><include file=\"gone.xml\"/><worldbody><geom class=\"c\"/></worldbody></mujoco>")
        .unwrap();
    let error = model::read(&other).unwrap_err().to_string();
    assert!(error.contains("includes gone.xml, which is not there") && error.contains("class \"c\""), "{error}");
    let fault = "line 2, <include>: includes gone.xml, which is not there";
    assert!(points[0].faults.iter().any(|f| f.contains(fault)), "{points:?}");
    assert_eq!(points[1].verdict, PointVerdict::NotJudged);
}

#[test]
fn each_point_says_what_is_wrong() {
    for (name, id, word) in [
        ("12_mjcf/b_overlap_static_parent.xml", 11, "when closed"),
        ("12_mjcf/contype0.xml", 5, "none of its part's shapes takes part in contacts"),
        ("12_mjcf/equality_weld.xml", 2, "<weld> holds it fast"),
        ("12_mjcf/equality_joint.xml", 2, "<joint> holds it fast"),
        ("12_mjcf/range00_auto.xml", 2, "without limits"),
        ("12_mjcf/range_reversed_auto.xml", 2, "without limits"),
        ("12_mjcf/degrees_default.xml", 6, "angles are degrees"),
        ("18_hairline/g0.0010.xml", 11, "which stops it"),
        ("18_hairline/g0.0015.xml", 11, "which stops it"),
        ("18_hairline/t0.05.xml", 11, "which stops it"),
    ] {
        let point = point(name, id);
        assert!(
            point.verdict == PointVerdict::Fail && point.faults.iter().any(|f| f.contains(word)),
            "{name}: {point:?}"
        );
    }
    for (name, id) in [
        ("12_mjcf/exclude_welded.xml", 11),
        ("12_mjcf/no_angles_drawer.xml", 6),
        ("12_mjcf/degree_explicit_drawer.xml", 6),
        ("12_mjcf/ref.xml", 2),
        ("12_mjcf/replicate.xml", 11),
        ("18_hairline/g0.0021.xml", 11),
        ("18_hairline/g0.0022.xml", 11),
        ("18_hairline/g0.004.xml", 11),
        ("22_inertia_static/static_base.xml", 3),
    ] {
        let point = point(name, id);
        assert_eq!(point.verdict, PointVerdict::Pass, "{name}: {point:?}");
    }
    let ball = point("12_mjcf/ball.xml", 2);
    assert!(ball.told.iter().any(|t| t.contains("hinge: moves in several directions")), "{ball:?}");
    for name in ["b_stiff_spring", "springref"] {
        let notes = read(&format!("12_mjcf/{name}.xml")).unwrap().notes;
        assert!(notes.iter().any(|n| n.starts_with("hinge: its spring (stiffness")), "{name}: {notes:?}");
    }
}

#[test]
fn what_was_not_read_is_not_judged() {
    for name in ["b_attach.xml", "b_flex.xml"] {
        let out = paws(&["check", name, "--json"], &file("12_mjcf"));
        assert_eq!(out.status.code(), Some(1), "{name}: {}", stderr(&out));
        let all: serde_json::Value = serde_json::from_slice(&out.stdout).unwrap();
        // Nor whether it loads: what is not read may be refused.
        for id in [1, 2] {
            let point = all[0]["points"].as_array().unwrap().iter().find(|p| p["id"] == id).unwrap();
            assert_eq!(point["verdict"], "not judged", "{name}");
        }
        let out = paws(&["check", name], &file("12_mjcf"));
        assert!(String::from_utf8_lossy(&out.stdout).contains('?'), "{name}");
    }
    // Copies are read.
    let model = read("12_mjcf/replicate.xml").unwrap();
    assert!(model.unread.is_empty());
    let links: Vec<&str> = model.moving().map(|(_, j)| j.child.as_str()).collect();
    assert_eq!(links, ["leaf0", "leaf1"]);
    let poses = model.poses(&model.tree().unwrap(), &[]);
    let at = |name: &str| poses[model.links.iter().position(|l| l.name == name).unwrap()].translation.vector;
    assert!((at("leaf1") - at("leaf0") - Vector::z()).norm() < 1e-12);
}

#[test]
fn copies_stand_where_mujoco_puts_them() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("m.xml");
    let text = r#"<mujoco><worldbody><replicate count="3" offset="1 0 0" euler="0 0 30" sep="_">
        <body name="b"><geom size="0.1" pos="0 1 0"/></body></replicate></worldbody></mujoco>"#;
    std::fs::write(&path, text).unwrap();
    let model = model::read(&path).unwrap();
    let poses = model.poses(&model.tree().unwrap(), &[]);
    // From MuJoCo 4.0.
    let wanted = [[0.0, 1.0, 0.0], [0.5, 0.866_025_403_784, 0.0], [1.0, 1.0, 0.0]];
    for (i, wanted) in wanted.into_iter().enumerate() {
        let link = model.links.iter().position(|l| l.name == format!("b_{i}")).unwrap();
        let at = poses[link] * model.links[link].shapes[0].bounds.center;
        assert!((at - Point::from(wanted)).norm() < 1e-9, "{i}: {at}");
    }
}

#[test]
fn a_reference_is_where_the_file_shows_the_joint() {
    let model = read("12_mjcf/ref.xml").unwrap();
    let tree = model.tree().unwrap();
    let (index, hinge) = model.moving().next().unwrap();
    assert_eq!((hinge.start, hinge.closed_and_open()), (0.2, [0.2, 1.7]));
    let link = model.links.iter().position(|l| l.name == "leaf").unwrap();
    // Where MuJoCo 4.0 has the handle at these positions.
    for (position, wanted) in [(0.2, [0.25, -0.03, 0.5]), (1.0, [0.061_668_01, -0.415_447_05, 0.5])] {
        let mut positions = vec![0.0; model.joints.len()];
        positions[index] = position;
        let handle = model.poses(&tree, &positions)[link] * Point::new(0.55, -0.03, 0.0);
        assert!((handle - Point::from(wanted)).norm() < 1e-7, "{position}: {handle}");
    }
    // The pose that is shown is the closed one for whoever replays it.
    let (twin, _) = to_twin(&model);
    let part = &twin.furniture[0].part;
    assert!((part.handle - Point::new(0.25, -0.03, 0.5)).norm() < 1e-9 && (part.joint.upper - 1.5).abs() < 1e-12);
}

#[test]
fn meshes_lie_where_mujoco_has_them() {
    for (name, center) in
        [("mesh_refpos", [0.0, 0.0, 0.0]), ("strippath", [0.3, 0.0, 0.0]), ("mesh_inline", [0.3, 0.0, 0.0])]
    {
        let model = read(&format!("12_mjcf/{name}.xml")).unwrap();
        let leaf = model.links.iter().find(|l| l.name == "leaf").unwrap();
        let panel = leaf.shapes.iter().find(|s| s.name.as_deref() == Some("panel")).unwrap();
        assert!((panel.bounds.center - Point::from(center)).norm() < 1e-6, "{name}: {}", panel.bounds.center);
        assert!(!leaf.incomplete && leaf.collides_as_mesh, "{name}");
    }
    let missing = read("12_mjcf/mesh_missing.xml").unwrap();
    assert!(missing.links.iter().any(|l| l.incomplete));
}

#[test]
fn a_board_whose_contact_is_excluded_holds_no_part() {
    let (twin, notes) = to_twin(&read("12_mjcf/exclude_welded.xml").unwrap());
    assert_eq!(twin.furniture.len(), 1);
    let boards = twin.furniture[0].carcass.iter().chain(&twin.room).map(|s| s.name.as_str()).collect::<Vec<_>>();
    assert!(!boards.contains(&"c"), "{boards:?}");
    assert!(notes.iter().any(|n| n.starts_with("1 boards that a part goes through")), "{notes:?}");
}

#[test]
fn a_joint_keeps_its_name_beside_a_geom_of_that_name() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("m.xml");
    let text = r#"<mujoco><compiler angle="radian"/><worldbody>
        <body name="a"><joint name="upper" range="0 1"/><geom name="lower" size="0.1"/>
          <body name="b"><joint name="lower" range="0 1"/><geom size="0.1"/></body></body></worldbody></mujoco>"#;
    std::fs::write(&path, text).unwrap();
    let (twin, _) = to_twin(&model::read(&path).unwrap());
    let ids: Vec<&str> = twin.furniture.iter().map(|f| f.part.id.as_str()).collect();
    assert_eq!(ids, ["upper", "lower"]);
}

#[test]
fn all_bodies_together_weigh_what_the_file_says() {
    let model = read("12_mjcf/settotalmass.xml").unwrap();
    let total: f64 = model.links.iter().filter_map(|l| l.mass).sum();
    assert!((total - 20.0).abs() < 1e-9, "{total}");
    assert!(model.joints.iter().any(|j| j.kind == JointType::Revolute));
}
