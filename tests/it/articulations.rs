//! Joints of other data sets and programs: read to the letter, built, replayed, compared, and written in their forms.

use std::path::{Path, PathBuf};

use paws_twin::articulation::JointKind::{self, Prismatic, Revolute};
use paws_twin::import::articulations::{self, FoundJoint, JointOptions, JointScene};
use paws_twin::math::{Point, Vector};
use serde_json::{Value, json};

use crate::common::{paws, stderr};

/// The files of a folder.
fn folder(files: &[(&str, &str)]) -> tempfile::TempDir {
    let dir = tempfile::tempdir().unwrap();
    for (name, text) in files {
        let path = dir.path().join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, text).unwrap();
    }
    dir
}

fn read(path: &Path) -> JointScene {
    articulations::read(path, None, &JointOptions::default()).unwrap()
}

fn data(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/joints").join(name)
}

/// A joint's type, axis, origin and range.
type Expected = (JointKind, [f64; 3], [f64; 3], Option<[f64; 2]>);

fn check(joint: &FoundJoint, expected: Expected) {
    let (kind, axis, origin, range) = expected;
    assert_eq!(joint.kind, kind, "{}", joint.id);
    assert!((joint.axis - Vector::from(axis)).norm() < 1e-9, "{}: {}", joint.id, joint.axis);
    assert!((joint.origin - Point::from(origin)).norm() < 1e-9, "{}: {}", joint.id, joint.origin);
    match (joint.range, range) {
        (None, None) => {}
        (Some(found), Some(range)) => {
            assert!((0..2).all(|i| (found[i] - range[i]).abs() < 1e-9), "{}: {found:?}", joint.id);
        }
        (found, _) => panic!("{}: {found:?} is not {range:?}", joint.id),
    }
}

/// A PLY file of points.
fn ply(points: &[[f64; 3]]) -> String {
    let mut text = format!(
        "ply\nformat ascii 1.0\nelement vertex {}\nproperty double x\nproperty double y\nproperty double z\nend_header\n",
        points.len()
    );
    for [x, y, z] in points {
        text += &format!("{x} {y} {z}\n");
    }
    text
}

const TAU: f64 = std::f64::consts::TAU;

#[test]
fn artipoints_segments_are_joints_with_the_openings_of_their_hands() {
    let hinge = r#"{"twist": [0, 0, 2, 0.6, 0, 0], "thetas": [0.0, 0.3, 0.7], "axis": [0, 0, 1], "joint_type": "revolute",
        "pitch": 0, "center": [0.3, 0, 1], "start_frame": 10, "end_frame": 60}"#;
    let slide = r#"{"twist": [0, 0, 0, 0, 0.5, 0], "thetas": [0.0, -0.2, -0.6], "axis": [0, 1, 0],
        "joint_type": "prismatic", "pitch": 0, "center": [1, 2, 0.5], "start_frame": 70, "end_frame": 99}"#;
    let dir = folder(&[
        ("out/segment_10/axis_info.json", slide),
        ("out/segment_9/axis_info.json", hinge),
        ("out/segment_9/metadata.json", r#"{"start_frame": 10, "end_frame": 60, "id": 9}"#),
    ]);
    let scene = read(&dir.path().join("out"));
    assert_eq!((scene.format, scene.name.as_str(), scene.joints.len()), ("artipoint", "out", 2));
    check(&scene.joints[0], (Revolute, [0.0, 0.0, 1.0], [0.3, 0.0, 1.0], Some([0.0, 1.4])));
    check(&scene.joints[1], (Prismatic, [0.0, 1.0, 0.0], [1.0, 2.0, 0.5], Some([-0.3, 0.0])));
    assert_eq!(
        (scene.joints[0].id.as_str(), scene.joints[0].label.as_str()),
        ("segment_9", "segment_9, frames 10 to 60")
    );
}

#[test]
fn arti4ds_types_come_from_the_metadata_above() {
    let sequence = r#"{"fridge": {"position": [1, 2, 0.9], "axis": [0, 0, -2]},
        "drawer": {"position": [0, 0, 0.4], "axis": [0, 1, 0]}, "lamp": {"position": [0, 0, 2], "axis": [0, 0, 1]}}"#;
    let metadata = "din080:\n  seq_1:\n    difficulty: easy  # of three\n    fridge: revolute\n    drawer: {axis_type: prismatic}\n  \
                    seq_2:\n    lamp: revolute\n";
    let dir = folder(&[("raw/metadata.yaml", metadata), ("raw/din080/seq_1/seq_1.json", sequence)]);
    let scene = read(&dir.path().join("raw/din080/seq_1/seq_1.json"));
    let by_name = |id: &str| scene.joints.iter().find(|j| j.id == id).unwrap();
    check(by_name("fridge"), (Revolute, [0.0, 0.0, -1.0], [1.0, 2.0, 0.9], None));
    check(by_name("drawer"), (Prismatic, [0.0, 1.0, 0.0], [0.0, 0.0, 0.4], None));
    // Another sequence's word is not this one's.
    assert_eq!((scene.left_out.len(), scene.left_out[0].place.as_str()), (1, "lamp"));
    assert!(scene.left_out[0].reason.contains("--types"), "{}", scene.left_out[0].reason);
}

#[test]
fn the_scene_toolkits_lists_are_read_wherever_they_stand() {
    let entry =
        r#"{"pid": 7, "type": "rotation", "axis": [0, 0, 1], "origin": [0.3, 0, 1], "rangeMin": 0, "rangeMax": 1.57}"#;
    for text in [
        format!(r#"{{"scan_id": "abc", "data": {{"articulations": [{entry}]}}}}"#),
        format!(r#"{{"annotation": {{"articulations": [{entry}]}}}}"#),
        format!(r#"{{"articulations": [{entry}]}}"#),
    ] {
        let dir = folder(&[("abc_articulation.json", &text)]);
        let scene = read(dir.path());
        assert_eq!(scene.joints[0].id, "joint_7");
        check(&scene.joints[0], (Revolute, [0.0, 0.0, 1.0], [0.3, 0.0, 1.0], Some([0.0, 1.57])));
    }
}

/// A door of 60 by 70 cm that stands open by 0.5 rad, with its handle; the hinge is at the origin, closed it lies along x and
/// looks to -y.
fn multiscan() -> tempfile::TempDir {
    let (sin, cos) = (-0.5f64).sin_cos();
    let at = |x: f64, y: f64, z: f64| format!("{} {} {z}\n", x * cos - y * sin, x * sin + y * cos);
    let mut vertices = String::new();
    for (x, y, z) in
        [(0.0, 0.0, 0.0), (0.6, 0.0, 0.0), (0.6, 0.0, 0.7), (0.0, 0.0, 0.7), (0.55, -0.04, 0.3), (0.55, -0.04, 0.4)]
    {
        vertices += &at(x, y, z);
    }
    let scan = format!(
        "ply\nformat ascii 1.0\nelement vertex 7\nproperty double x\nproperty double y\nproperty double z\nelement face 4\n\
         property list uchar int vertex_indices\nproperty ushort objectId\nproperty ushort partId\nend_header\n{vertices}\
         5 5 5\n3 0 1 2 1 2\n3 0 2 3 1 2\n3 1 4 5 1 3\n3 6 0 1 1 1\n"
    );
    let annotations = r#"{"version": "multiscan@0.0.1", "scanId": "scene_00000_00", "objects": [{"objectId": 1,
        "label": "cabinet.1", "mobilityType": "fixed", "partIds": [1, 2, 3], "obb": {"centroid": [0.3, 0.25, 0.35],
        "axesLengths": [0.6, 0.7, 0.5], "normalizedAxes": [-1, 0, 0, 0, 0, 1, 0, 1, 0], "front": [0, -1, 0], "up": [0, 0, 1]}}],
        "parts": [{"partId": 1, "label": "cabinet.1"}, {"partId": 2, "label": "door.1", "parentId": 1, "articulations": [{
        "type": "rotation", "origin": [0, 0, 0.35], "axis": [0, 0, -1], "state": 0.5, "rangeMin": 0, "rangeMax": 1.5,
        "isClosed": false}]}, {"partId": 3, "label": "handle.1", "parentId": 2}]}"#;
    folder(&[("scene_00000_00.annotations.json", annotations), ("scene_00000_00.ply", &scan)])
}

#[test]
fn multiscans_parts_have_their_boxes_closed_with_what_is_fixed_to_them() {
    let dir = multiscan();
    let scene = read(dir.path());
    let door = &scene.joints[0];
    assert_eq!((door.id.as_str(), door.label.as_str()), ("cabinet_1_door_1", "cabinet.1:door.1"));
    check(door, (Revolute, [0.0, 0.0, -1.0], [0.0, 0.0, 0.35], Some([0.0, 1.5])));
    assert_eq!(door.points, Some(vec![0, 1, 2, 3, 4, 5]));
    let part = door.part.unwrap();
    assert!((part.center - Point::new(0.3, -0.02, 0.35)).norm() < 0.01, "{}", part.center);
    assert!(door.base.is_some());
}

#[test]
fn scenefun3ds_origins_are_points_of_the_laser_scan() {
    let scan = ply(&[[0.0, 0.0, 0.0], [1.0, 2.0, 3.0], [0.5, 0.5, 1.0], [0.5, 0.7, 1.0]]);
    let motions = r#"{"visit_id": "420673", "motions": [
        {"motion_id": "m0", "annot_id": "a0", "motion_type": "rot", "motion_dir": [0, 0, 1], "motion_origin_idx": 1},
        {"motion_id": "m1", "annot_id": "a1", "motion_type": "trans", "motion_dir": [0, -1, 0], "motion_origin_idx": 0},
        {"motion_id": "m2", "annot_id": "a0", "motion_type": "rot", "motion_dir": [0, 0, 1], "motion_origin_idx": 4}]}"#;
    let annotations = r#"{"annotations": [{"annot_id": "a0", "label": "hook_pull", "indices": [3, 2]}]}"#;
    let dir = folder(&[
        ("420673_motions.json", motions),
        ("420673_annotations.json", annotations),
        ("420673_laser_scan.ply", &scan),
    ]);
    let scene = read(dir.path());
    check(&scene.joints[0], (Revolute, [0.0, 0.0, 1.0], [1.0, 2.0, 3.0], None));
    check(&scene.joints[1], (Prismatic, [0.0, -1.0, 0.0], [0.0, 0.0, 0.0], None));
    assert_eq!((&scene.joints[0].points, scene.joints[0].id.as_str()), (&Some(vec![2, 3]), "hook_pull"));
    assert!((scene.joints[0].handle.unwrap() - Point::new(0.5, 0.6, 1.0)).norm() < 1e-9);
    assert_eq!(scene.left_out[0].place, "motions[2]");
    assert!(scene.left_out[0].reason.contains("4 is beyond the 4 points"), "{}", scene.left_out[0].reason);
    std::fs::remove_file(dir.path().join("420673_laser_scan.ply")).unwrap();
    let error = articulations::read(dir.path(), None, &JointOptions::default()).unwrap_err().to_string();
    assert!(error.contains("420673_laser_scan.ply") && error.contains("--points"), "{error}");
}

#[test]
fn partnets_hinges_are_degrees_and_its_parts_are_meshes() {
    let mobility = r#"[{"id": 0, "parent": 1, "joint": "hinge", "name": "door", "parts": [{"id": 3, "name": "board"}],
        "jointData": {"axis": {"origin": [0.3, 0, 1], "direction": [0, 1, 0]}, "limit": {"a": 90, "b": 0, "noLimit": false}}},
        {"id": 2, "parent": 1, "joint": "slider", "name": "drawer", "parts": [], "jointData": {"axis": {"origin": [0, 0, 0],
        "direction": [0, 0, 1]}, "limit": {"a": 0.4, "b": 0, "noLimit": false}}},
        {"id": 1, "parent": -1, "joint": "heavy", "name": "body", "parts": [], "jointData": {}}]"#;
    let result = r#"[{"id": 0, "name": "cabinet", "children": [{"id": 3, "name": "board", "children": [
        {"id": 4, "name": "panel", "objs": ["original-1"]}]}]}]"#;
    let mesh = "# panel\nv -0.3 -0.4 1\nv 0.3 -0.4 1\nv 0.3 0.4 1\nv -0.3 0.4 1\nf 1 2 3\nf 1 3 4\n";
    let dir = folder(&[
        ("7130/mobility_v2.json", mobility),
        ("7130/result.json", result),
        ("7130/textured_objs/original-1.obj", mesh),
    ]);
    let scene = read(&dir.path().join("7130/mobility_v2.json"));
    assert_eq!((scene.name.as_str(), scene.up, scene.joints.len()), ("7130", Vector::y(), 2));
    check(&scene.joints[0], (Revolute, [0.0, 1.0, 0.0], [0.3, 0.0, 1.0], Some([0.0, TAU / 4.0])));
    check(&scene.joints[1], (Prismatic, [0.0, 0.0, 1.0], [0.0; 3], Some([0.0, 0.4])));
    assert!((scene.joints[0].part.unwrap().center - Point::new(0.0, 0.0, 1.0)).norm() < 1e-9);
    assert!(scene.joints[1].part.is_none());
    let out = paws(&["export", "7130", "--out", "out", "--format", "urdf"], dir.path());
    assert_eq!(out.status.code(), Some(1), "{}", stderr(&out));
    assert!(stderr(&out).contains("drawer_2: not built: part_box: is missing: mobility"), "{}", stderr(&out));
    assert!(dir.path().join("out/scene.urdf").exists());
}

#[test]
fn predicted_motions_are_joints() {
    let dir = folder(&[
        ("m/7130-3.json", r#"{"mtype": 0, "morigin": [0.3, 0, 1], "maxis": [0, 0, 1]}"#),
        ("m/7130-4.json", r#"{"mtype": 1, "morigin": [0, 0, 1], "maxis": [-1, 0, 0]}"#),
        (
            "info.json",
            r#"[{"id": 1, "cat": "door", "motionType": "revolute", "motionAxis": [0, 0, 1], "motionOrigin": [1, 0, 0]},
                {"id": 2, "cat": "base", "motionType": "fixed", "motionAxis": null, "motionOrigin": null}]"#,
        ),
    ]);
    let scene = read(&dir.path().join("m"));
    check(&scene.joints[0], (Revolute, [0.0, 0.0, 1.0], [0.3, 0.0, 1.0], None));
    check(&scene.joints[1], (Prismatic, [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0], None));
    let info = read(&dir.path().join("info.json"));
    assert_eq!((info.joints.len(), info.joints[0].label.as_str()), (1, "door 1"));
}

#[test]
fn broken_files_are_told_by_name_place_and_field() {
    let dir = tempfile::tempdir().unwrap();
    for (text, words) in [
        (r#"{"axis": [0, 0, "1"], "joint_type": "revolute", "center": [0, 0, 0]}"#, "axis[2]: the text \"1\" is given"),
        (r#"{"axis": [0, 0, 0], "joint_type": "revolute", "center": [0, 0, 0]}"#, "axis: is no direction"),
        (r#"{"axis": [0, 0, 1], "joint_type": "screw", "center": [0, 0, 0]}"#, "type: \"screw\" is neither a hinge"),
        (r#"{"axis": [0, 0, 1], "joint_type": "revolute", "center": [0, NaN, 0]}"#, "NaN and Infinity are not JSON"),
        (
            r#"{"articulations": [{"pid": 1, "type": "rotation", "axis": [0, 0, 1]}]}"#,
            "articulations[0]: the key \"origin\"",
        ),
        (
            r#"{"articulations": [{"pid": 1, "type": "rotation", "axis": [0, 1], "origin": [0, 0, 0]}]}"#,
            "axis: a list of 2 is given, a list of 3 values is wanted",
        ),
        (
            r#"{"articulations": [{"pid": 1, "type": "rotation", "axis": [0,0,1], "origin": [0,0,0], "rangeMin": 0, "rangeMax": 90}]}"#,
            "range: 90.0 rad are more than a whole turn: are these degrees?",
        ),
        (r#"{"articulations": []}"#, "there are none"),
        (
            r#"[{"joint": "hinge", "jointData": {}, "id": 1, "name": "door"}]"#,
            "[0] (door): jointData: the key \"axis\" is missing",
        ),
        (r#"[{"mtype": 2, "morigin": [0, 0, 0], "maxis": [0, 0, 1]}]"#, "mtype: 2 is neither 0 (a hinge) nor 1"),
        (r#"{"door": {"position": [0, 0, 0], "axis": [0, 0, 1]}}"#, "door: type: nothing tells"),
        (r#"{"what": 1}"#, "holds no joints of a format that is read (paws, artipoint"),
        (r#"{"axis": [0, 0"#, "line 1, column"),
    ] {
        let path = dir.path().join("joints.json");
        std::fs::write(&path, text).unwrap();
        let error = articulations::read(&path, None, &JointOptions::default()).unwrap_err().to_string();
        assert!(error.contains(words) && error.contains("joints.json"), "\"{words}\" is not in: {error}");
    }
    let error = articulations::read(&data("ok.json"), Some("opd"), &JointOptions::default()).unwrap_err().to_string();
    assert!(error.contains("\"opd\" is no format of joints; there are paws"), "{error}");
}

#[test]
fn export_says_what_a_format_does_not_tell() {
    let dir = tempfile::tempdir().unwrap();
    for (file, words) in [
        ("artipoint_axis_info.json", "part_box: is missing: artipoint tells no shape of this part"),
        ("articulate3d.json", "joint_7: part_box: is missing: articulate3d"),
        ("multiscan.json", "cabinet_1_door_1: part_box: is missing: multiscan"),
        ("mobility_v2.json", "door_0: part_box: is missing: mobility"),
        ("opd_predictions.json", "part_box: is missing: s2o"),
        ("s2o_like.json", "neither a twin (it has no \"furniture\") nor joints"),
        ("physx.json", "neither a twin (it has no \"furniture\") nor joints"),
    ] {
        let out = paws(&["export", data(file).to_str().unwrap(), "--out", "out"], dir.path());
        assert_eq!(out.status.code(), Some(2), "{file}: {}", stderr(&out));
        assert!(stderr(&out).contains(words), "{file}: \"{words}\" is not in: {}", stderr(&out));
        assert!(!dir.path().join("out").exists(), "{file}");
    }
}

#[test]
fn a_scan_with_its_parts_becomes_a_twin() {
    let dir = multiscan();
    let file = "scene_00000_00.annotations.json";
    let out = paws(&["export", file, "--out", "out", "--format", "urdf"], dir.path());
    assert_eq!(out.status.code(), Some(0), "{}", stderr(&out));
    let twin: Value =
        serde_json::from_str(&std::fs::read_to_string(dir.path().join("out/twin.json")).unwrap()).unwrap();
    let joint = &twin["furniture"][0]["part"]["joint"];
    assert_eq!((&joint["articulation"]["kind"], &joint["upper"]), (&json!("revolute"), &json!(1.5)));
}

#[test]
fn joints_of_one_data_set_are_measured_against_anothers() {
    let truth = r#"{"door": {"position": [0.3, 0, 1], "axis": [0, 0, 1], "type": "revolute"},
        "drawer": {"position": [2, 0, 0.5], "axis": [0, 1, 0], "type": "prismatic"}}"#;
    let info = |axis: &str, kind: &str, center: &str| {
        format!(r#"{{"axis": {axis}, "joint_type": "{kind}", "center": {center}, "start_frame": 1, "end_frame": 9}}"#)
    };
    let dir = folder(&[
        ("truth.json", truth),
        ("pred/segment_0/axis_info.json", &info("[0, 0, 1]", "revolute", "[0.35, 0, 1.1]")),
        ("pred/segment_1/axis_info.json", &info("[0, 1, 0.8]", "prismatic", "[2, 0.1, 0.5]")),
        ("pred/segment_2/axis_info.json", &info("[0, 0, 1]", "revolute", "[9, 9, 1]")),
    ]);
    let out = paws(&["evaluate", "pred", "truth.json", "--json", "r.json"], dir.path());
    assert!(out.status.success(), "{}", stderr(&out));
    assert!(stderr(&out).contains("2 of 3 joints are paired with 2 true ones") && stderr(&out).contains("OPDMulti"));
    let report: Value = serde_json::from_str(&std::fs::read_to_string(dir.path().join("r.json")).unwrap()).unwrap();
    let paws_rule = report["rules"].as_array().unwrap().iter().find(|r| r["rule"] == "paws").unwrap();
    // Types are right, one axis is 39 degrees off.
    assert_eq!((&paws_rule["micro"]["m"], &paws_rule["micro"]["mao"]), (&json!(1.0), &json!(0.5)));
    let wrong = paws(&["evaluate", "pred", "pred", "--truth", "truth.json"], dir.path());
    assert!(
        wrong.status.code() == Some(2) && stderr(&wrong).contains("2 predictions for 1 truths"),
        "{}",
        stderr(&wrong)
    );
}

#[test]
fn a_recorded_path_is_held_against_joints_found_elsewhere() {
    let mut path = String::new();
    // The handle of the wall door, about the upright hinge at x = -0.3 m.
    for i in 0..=60 {
        let (sin, cos) = (-1.5 * f64::from(i) / 60.0).sin_cos();
        let (x, y) = (0.55, -0.035);
        path += &format!("{} {} {} 1.35\n", f64::from(i) / 30.0, -0.3 + x * cos - y * sin, x * sin + y * cos);
    }
    let dir = folder(&[("path.txt", &path)]);
    let joints = data("ok.json");
    let out = paws(&["validate", joints.to_str().unwrap(), "--trajectory", "wall_door=path.txt"], dir.path());
    let text = String::from_utf8_lossy(&out.stdout).into_owned();
    assert_eq!(out.status.code(), Some(0), "{text}{}", stderr(&out));
    assert!(text.contains("wall_door: pass") || text.contains("wall_door: undetermined"), "{text}");
    let none = paws(&["validate", joints.to_str().unwrap()], dir.path());
    assert!(none.status.code() == Some(2) && stderr(&none).contains("wall_door, top_drawer"), "{}", stderr(&none));
}

/// The front of the wall door of `ok.json` every 2 cm, and a wall far from it.
fn reconstruction() -> String {
    let mut points = Vec::new();
    for i in 0..29 {
        for k in 0..34 {
            let (x, z) = (-0.28 + 0.02 * f64::from(i), 1.27 + 0.02 * f64::from(k));
            points.extend([[x, 0.0, z], [x, -3.0, z]]);
        }
    }
    ply(&points)
}

#[test]
fn parts_as_points_are_written_for_usdnet_and_found_again() {
    let dir = folder(&[("scan.ply", &reconstruction())]);
    let joints = data("ok.json");
    let joints = joints.to_str().unwrap();
    let out = paws(&["export", joints, "--out", ".", "--format", "usdnet", "--points", "scan.ply"], dir.path());
    assert_eq!(out.status.code(), Some(0), "{}", stderr(&out));
    assert!(stderr(&out).contains("top_drawer: no point of the reconstruction"), "{}", stderr(&out));
    let read = |name: &str| std::fs::read_to_string(dir.path().join(name)).unwrap();
    let written: Value = serde_json::from_str(&read("usdnet_articulation.json")).unwrap();
    let door = &written["data"]["articulations"][0];
    assert_eq!((&door["type"], &door["pid"], &door["origin"][0]), (&json!("rotation"), &json!(1), &json!(-0.3)));
    // Every second point is the wall's.
    let indices: Vec<u64> = door["indices"].as_array().unwrap().iter().map(|i| i.as_u64().unwrap()).collect();
    assert!(indices.len() > 900 && indices.iter().all(|i| i % 2 == 0), "{}", indices.len());
    let labels = read("usdnet_instance_gt.txt");
    assert_eq!(
        (labels.lines().next(), labels.lines().nth(1), labels.lines().count()),
        (Some("1002"), Some("1"), 2 * 29 * 34)
    );
    assert_eq!(std::fs::metadata(dir.path().join("usdnet.npy")).unwrap().len() % 4, 0);
    let same = [
        "evaluate",
        "usdnet_articulation.json",
        "usdnet_articulation.json",
        "--points",
        "scan.ply",
        "--json",
        "r.json",
    ];
    let out = paws(&same, dir.path());
    assert!(out.status.success(), "{}", stderr(&out));
    let report: Value = serde_json::from_str(&read("r.json")).unwrap();
    assert_eq!(
        (&report["parts"][0]["iou"], &report["parts"][0]["recall"]),
        (&json!(0.5), &json!([1.0, 1.0, 1.0, 1.0, 1.0]))
    );
    assert!(String::from_utf8_lossy(&out.stdout).contains("MSAO_ST (USDNet)"));
    let missing = paws(&["export", joints, "--format", "usdnet"], dir.path());
    assert!(missing.status.code() == Some(2) && stderr(&missing).contains("--points FILE.ply"), "{}", stderr(&missing));
}

#[test]
fn lists_of_arti4d_and_egoarti_are_written() {
    let rows = json!({"predictions": [
        {"recording": "P01-20240202-110250", "clip": "P01-20240202-110250-1", "type": "revolute", "axis": [0, 0, -1],
         "origin": [-0.3, 0, 1.6], "joint": "wall_door"},
        {"recording": "P01-20240202-110250", "clip": "P01-20240202-110250-2", "type": null}]});
    let dir = folder(&[("predictions.json", &rows.to_string())]);
    let joints = data("ok.json");
    let made = paws(&["export", joints.to_str().unwrap(), "--format", "urdf"], dir.path());
    assert_eq!(made.status.code(), Some(0), "{}", stderr(&made));
    let out = paws(&["export", "twin.json", "--format", "arti4d,egoarti"], dir.path());
    assert_eq!(out.status.code(), Some(0), "{}", stderr(&out));
    let read = |name: &str| -> Value {
        serde_json::from_str(&std::fs::read_to_string(dir.path().join(name)).unwrap()).unwrap()
    };
    assert_eq!(read("egoarti_list.json"), json!({"P01-20240202-110250-1": "wall_cupboard.001"}));
    let clip = &read("egoarti.json")["P01-20240202-110250-1"];
    assert_eq!((&clip["type"], &clip["object"]), (&json!("revolute"), &json!("wall_cupboard.001")));
    assert_eq!(read("arti4d.json")["wall_door"]["type"], "revolute");
    // What was written is read again.
    let scene = articulations::read(&dir.path().join("arti4d.json"), None, &JointOptions::default()).unwrap();
    assert_eq!((scene.format, scene.joints.len()), ("arti4d", 2));
    std::fs::remove_file(dir.path().join("predictions.json")).unwrap();
    let none = paws(&["export", "twin.json", "--format", "egoarti"], dir.path());
    assert!(none.status.code() == Some(2) && stderr(&none).contains("egoarti lists clips"), "{}", stderr(&none));
}
