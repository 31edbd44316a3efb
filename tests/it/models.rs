//! Anybody's URDF and glTF in the ways that people meet: what simulators refuse is told, what is valid is read.

use std::path::{Path, PathBuf};

use paws_twin::model::check::{self, CheckedPoint, PointVerdict};
use paws_twin::model::{self, glb};

use crate::common::{paws, stderr};

fn data(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/models").join(name)
}

/// Faults with the numbers of their points.
fn faults(points: &[CheckedPoint]) -> Vec<(u8, String)> {
    points.iter().flat_map(|p| p.faults.iter().map(move |f| (p.id, f.clone()))).collect()
}

#[test]
fn what_simulators_refuse_of_a_urdf_is_a_fault() {
    for (name, id, word) in [
        ("mesh_case", 1, "there is door.obj, and capitals count"),
        ("mesh_lfs", 1, "Git LFS pointer"),
        ("mesh_dae", 1, "is not OBJ or binary STL (.dae): MuJoCo refuses"),
        ("mesh_scale1", 1, "one number as scale: MuJoCo refuses"),
        ("mesh_backslash", 1, "has a backslash: PyBullet"),
        ("mesh_mm", 5, "millimetres need scale="),
        ("mimic_self", 1, "mimics itself: MuJoCo refuses"),
        ("mimic_missing", 1, "mimics fix2, which does not exist"),
        ("floating", 1, "floats on base, which is not the world: MuJoCo refuses"),
        ("zero", 2, "MuJoCo takes them for no limits"),
        ("reversed", 2, "swap them"),
        ("sphere0", 1, "size that is not positive: MuJoCo refuses"),
        ("flat_box", 1, "size that is not positive: MuJoCo refuses"),
        ("plane", 1, "is no geometry of URDF"),
        ("empty_geometry", 1, "has no geometry: MuJoCo refuses"),
        ("two_axes", 1, "<axis> is there twice"),
        ("two_limits", 1, "<limit> is there twice"),
        ("visual_only", 5, "none of its part's shapes takes part in contacts"),
    ] {
        let model = model::read(&data(&format!("urdf/{name}.urdf"))).unwrap();
        let found = faults(&check::model(&model, None));
        assert!(found.iter().any(|(i, f)| *i == id && f.contains(word)), "{name}: {found:?}");
    }
    for name in ["ok", "mesh_ok_subdir", "mesh_mirror", "planar"] {
        let model = model::read(&data(&format!("urdf/{name}.urdf"))).unwrap();
        let found = faults(&check::model(&model, None));
        assert!(found.is_empty(), "{name}: {found:?}");
        assert_eq!(model.notes.iter().any(|n| n.contains("planar joints are not judged")), name == "planar");
    }
}

#[test]
fn units_and_names_of_a_urdf_that_are_wrong_are_faults() {
    let good = std::fs::read_to_string(data("urdf/ok.urdf")).unwrap();
    let dir = tempfile::tempdir().unwrap();
    std::fs::create_dir(dir.path().join("meshes")).unwrap();
    std::fs::copy(data("urdf/meshes/door.obj"), dir.path().join("meshes/door.obj")).unwrap();
    let four = "v 0 0 0\nv .5 0 0\nv 0 .02 0\nv 0 0 .7\n";
    std::fs::write(dir.path().join("meshes/beyond.obj"), format!("{four}f 1 2 9\n")).unwrap();
    std::fs::write(dir.path().join("cut.png"), b"\x89PNG\r\n\x1a\n").unwrap();
    let panel = "<box size=\"0.59 0.02 0.78\"/>";
    let visual = |material: &str| {
        format!(
            "<visual><geometry><box size=\".1 .1 .1\"/></geometry>{material}</visual><collision name=\"door_panel\">"
        )
    };
    let oak = visual("<material name=\"oak\"/>");
    let cut = visual("<material name=\"oak\"><texture filename=\"cut.png\"/></material>");
    let cases: [(&str, &str, u8, &str); 12] = [
        (
            "xyz=\"-0.3 0 0.5\"",
            "xyz=\"-300 0 500\"",
            5,
            "hinge: stands 583.10 m from the origin of base, which reaches 1.0",
        ),
        (
            panel,
            "<mesh filename=\"meshes/door.obj\" scale=\"0.001 0.001 0.001\"/>",
            5,
            "mm large; sizes are metres here, look at the scale of its mesh",
        ),
        (
            panel,
            "<box size=\"590 20 780\"/>",
            5,
            "is 780 m large; sizes are metres here, write 780 millimetres as 0.780",
        ),
        (panel, "<mesh filename=\"meshes/beyond.obj\"/>", 1, "names vertex 9, there are 4: MuJoCo refuses"),
        (
            "fusestatic=\"false\"",
            "fusestatic=\"no\"",
            1,
            "fusestatic=\"no\": expected one of false, true: MuJoCo refuses",
        ),
        ("<mujoco>", "<mujoco/><mujoco>", 1, "<mujoco> is there twice"),
        ("<compiler ", "<size memory=\"10Q\"/><compiler ", 1, "memory=\"10Q\" is no size"),
        ("xyz=\"0 0 -1\"", "xyz=\"0 0 1e-9\"", 1, "its axis is 0: MuJoCo refuses"),
        ("xyz=\"-0.3 0 0.5\"", "xyz=\"-0.3 0 0.5\" rpy=\"0 0 90\"", 5, "90 degrees are 1.5708"),
        ("<collision name=\"door_panel\">", &oak, 1, "door: material oak (line 8) is described nowhere"),
        ("<collision name=\"door_panel\">", &cut, 1, "texture cut.png is a PNG that is cut off"),
        ("</robot>", "<transmission name=\"t\"><joint name=\"nope\"/></transmission></robot>", 1, "its joint nope"),
    ];
    for (from, to, id, word) in cases {
        let text = good.replacen(from, to, 1);
        assert_ne!(text, good, "{from}");
        let path = dir.path().join("m.urdf");
        std::fs::write(&path, text).unwrap();
        let found = faults(&check::model(&model::read(&path).unwrap(), None));
        assert!(found.iter().any(|(i, f)| *i == id && f.contains(word)), "{to}: {found:?}");
        // Boxes have no scale.
        assert!(to.contains("mesh") || found.iter().all(|(_, f)| !f.contains("scale=")), "{to}: {found:?}");
    }
    for (from, to) in [
        ("fusestatic=\"false\"", "fusestatic=\"false\" foo=\"no\""),
        ("xyz=\"0 0 -1\"", "xyz=\"0 0 -1e-6\""),
        ("xyz=\"-0.3 0 0.5\"", "xyz=\"-0.3 0 0.5\" rpy=\"0 0 -3.1\""),
    ] {
        let path = dir.path().join("m.urdf");
        std::fs::write(&path, good.replacen(from, to, 1)).unwrap();
        let found = faults(&check::model(&model::read(&path).unwrap(), None));
        assert!(found.iter().all(|(id, _)| ![1, 5].contains(id)), "{to}: {found:?}");
    }
}

#[test]
fn a_reason_is_told_whole() {
    let model = model::read(&data("urdf/comment_first.urdf")).unwrap();
    let found = faults(&check::model(&model, None));
    assert!(found.iter().any(|(i, f)| *i == 1 && f.contains("urdf-rs") && !f.ends_with("...")), "{found:?}");
}

#[test]
fn meshes_that_mujoco_does_not_find_or_decode_are_told_from_those_that_it_does() {
    let dir = tempfile::tempdir().unwrap();
    let good = std::fs::read_to_string(data("urdf/mesh_ok_subdir.urdf")).unwrap();
    let folder = dir.path().join("kitchen");
    std::fs::create_dir_all(folder.join("meshes")).unwrap();
    for name in ["door.obj", "ascii.stl"] {
        std::fs::copy(data("urdf/meshes").join(name), folder.join("meshes").join(name)).unwrap();
    }
    std::fs::write(folder.join("meshes/flat.obj"), "v 0 0 0\nv 1 0 0\nv 0 0 1\nv 1 0 1\n").unwrap();
    std::fs::write(folder.join("meshes/three.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 1\n").unwrap();
    let strip = "<compiler strippath=\"true\" meshdir=\"meshes\" ";
    for (file, compiler, word) in [
        ("meshes/door.obj", "<compiler ", ""),
        ("package://kitchen/meshes/door.obj", "<compiler ", "MuJoCo does not look for packages"),
        ("package://kitchen/meshes/door.obj", strip, ""),
        ("door.obj", "<compiler meshdir=\"meshes\" ", ""),
        ("package://elsewhere/door.obj", "<compiler ", "is not there: MuJoCo and PyBullet refuse"),
        ("meshes/ascii.stl", "<compiler ", "no whole binary STL"),
        ("meshes/flat.obj", "<compiler ", "is flat"),
        ("meshes/three.obj", "<compiler ", "fewer than 4 vertices"),
    ] {
        let text = good.replace("meshes/door.obj", file).replace("<compiler ", compiler);
        std::fs::write(folder.join("m.urdf"), text).unwrap();
        let model = model::read(&folder.join("m.urdf")).unwrap();
        let found: Vec<_> = faults(&check::model(&model, None)).into_iter().filter(|(id, _)| *id == 1).collect();
        if word.is_empty() {
            assert!(found.is_empty(), "{file}: {found:?}");
        } else {
            assert!(found.len() == 1 && found[0].1.contains(word), "{file}: {found:?}");
        }
    }
}

/// Faults of a glTF file, and how many nodes it moves.
fn scene(path: &Path) -> (Vec<(u8, String)>, usize) {
    let scene = glb::read(path).unwrap_or_else(|e| panic!("{e}"));
    (faults(&check::scene(&scene, None)), scene.moved.len())
}

#[test]
fn valid_gltf_is_read_whatever_it_requires() {
    for (name, moved) in [
        ("ok.glb", 1),
        ("embedded.gltf", 1),
        ("data_uri.glb", 1),
        ("step.glb", 1),
        ("norm_short.glb", 1),
        ("turn270.glb", 1),
        ("trailing.glb", 1),
        ("empty_scene.glb", 1),
        ("mm_scaled_root.glb", 1),
        ("target_no_node.glb", 0),
        ("key1.glb", 0),
        ("scale_anim.glb", 0),
        ("phys_ok.glb", 0),
        ("req_KHR_draco_mesh_compression.glb", 1),
        ("req_EXT_meshopt_compression.glb", 1),
        ("req_EXT_texture_webp.glb", 1),
        ("req_KHR_lights_punctual.glb", 1),
        ("req_KHR_materials_unlit.glb", 1),
        ("req_KHR_materials_variants.glb", 1),
        ("req_KHR_mesh_quantization.glb", 1),
        ("req_KHR_texture_basisu.glb", 1),
    ] {
        let (found, count) = scene(&data("gltf").join(name));
        assert!(found.is_empty() && count == moved, "{name}: {count} {found:?}");
    }
    // The door of all of these turns by 86 degrees.
    for name in ["ok.glb", "norm_short.glb", "step.glb", "embedded.gltf"] {
        let reaches = glb::read(&data("gltf").join(name)).unwrap().moved[0].reaches;
        assert!((reaches - 1.5).abs() < 1e-3, "{name}: {reaches}");
    }
}

#[test]
fn what_is_wrong_in_a_gltf_is_a_fault_of_its_point() {
    for (name, id, word) in [
        ("mm_slide.glb", 7, "glTF is in metres"),
        ("cubic.glb", 7, "it has 2 values for 2 keyframes, 3 for each are wanted"),
        ("huge_count.glb", 7, "outside the file"),
        ("matrix_animated.glb", 7, "has a matrix"),
        ("minversion.glb", 7, "2.1 at least"),
        ("zero_quat.glb", 7, "a quaternion of length 1"),
        ("req_FOO_nobody.glb", 7, "no extension that vendors share"),
        ("used_KHR_mesh_quantization.glb", 7, "must be in extensionsRequired"),
        ("external_bin.glb", 1, "x.bin, which is not there"),
        ("phys_degrees.glb", 2, "limits are radians"),
        ("phys_reversed.glb", 2, "swap them"),
        ("phys_nolimits.glb", 2, "without limits"),
    ] {
        let (found, _) = scene(&data("gltf").join(name));
        assert!(found.iter().any(|(i, f)| *i == id && f.contains(word)), "{name}: {found:?}");
    }
}

/// What is said of a text glTF that lies in a folder of its own.
fn of_gltf(json: &serde_json::Value) -> Vec<CheckedPoint> {
    let dir = tempfile::tempdir().unwrap();
    let folder = dir.path().join("m");
    std::fs::create_dir(&folder).unwrap();
    std::fs::write(dir.path().join("x.bin"), [0; 64]).unwrap();
    std::fs::write(folder.join("m.gltf"), json.to_string()).unwrap();
    check::scene(&glb::read(&folder.join("m.gltf")).unwrap(), None)
}

fn verdict(points: &[CheckedPoint], id: u8) -> PointVerdict {
    points.iter().find(|p| p.id == id).unwrap().verdict
}

#[test]
fn a_registered_extension_that_is_required_is_worth_knowing() {
    let text = std::fs::read_to_string(data("gltf/embedded.gltf")).unwrap();
    let good: serde_json::Value = serde_json::from_str(&text).unwrap();
    for name in ["MSFT_texture_dds", "OMI_physics_body", "VRMC_vrm", "ADOBE_materials_x"] {
        let mut json = good.clone();
        json["extensionsUsed"] = serde_json::json!([name]);
        json["extensionsRequired"] = serde_json::json!([name]);
        let points = of_gltf(&json);
        assert_eq!(verdict(&points, 7), PointVerdict::Pass, "{name}: {points:?}");
        let seven = points.iter().find(|p| p.id == 7).unwrap();
        assert!(seven.told.iter().any(|t| t.starts_with(name)), "{seven:?}");
    }
}

#[test]
fn animations_that_break_the_format_are_faults_and_unread_ones_are_not_judged() {
    let text = std::fs::read_to_string(data("gltf/embedded.gltf")).unwrap();
    let good: serde_json::Value = serde_json::from_str(&text).unwrap();
    let pointer = |to: &str| {
        let mut json = good.clone();
        json["extensionsUsed"] = serde_json::json!(["KHR_animation_pointer"]);
        json["animations"][0]["channels"][0]["target"] =
            serde_json::json!({"path": "pointer", "extensions": {"KHR_animation_pointer": {"pointer": to}}});
        json
    };
    let mut twice = good.clone();
    let channel = twice["animations"][0]["channels"][0].clone();
    twice["animations"][0]["channels"].as_array_mut().unwrap().push(channel);
    // The rotations, twice as long.
    let mut long = good.clone();
    let turns: Vec<u8> =
        [0f32, 1.0, 0.0, 0.0, 0.0, 2.0, 0.0, 1.0, 0.0, 1.7].iter().flat_map(|x| x.to_le_bytes()).collect();
    let uri = "data:application/octet-stream;base64,";
    let bytes = base64::Engine::encode(&base64::engine::general_purpose::STANDARD, turns);
    long["buffers"] = serde_json::json!([{"byteLength": 40, "uri": format!("{uri}{bytes}")}]);
    long["bufferViews"] = serde_json::json!([{"buffer": 0, "byteLength": 8},
        {"buffer": 0, "byteOffset": 8, "byteLength": 32}, {"buffer": 0, "byteLength": 24}]);
    for (json, word) in [
        (pointer("/nodes/99/rotation"), "an animation points at /nodes/99/rotation, there are 3 nodes"),
        (pointer("/materials/0/emissiveFactor"), "there are 0 materials"),
        (pointer("nodes"), "pointers begin with /"),
        (twice, "door_pivot: two channels of one animation set its rotation"),
        (long, "a rotation has length 2"),
    ] {
        let found = faults(&of_gltf(&json));
        assert!(found.len() == 1 && found[0].0 == 7 && found[0].1.contains(word), "{word}: {found:?}");
    }
    let mut sparse = good.clone();
    sparse["accessors"][1]["sparse"] = serde_json::json!({"count": 1,
        "indices": {"bufferView": 0, "componentType": 5125}, "values": {"bufferView": 1}});
    let mut elsewhere = good.clone();
    elsewhere["buffers"] = serde_json::json!([{"byteLength": 64, "uri": "../x.bin"}]);
    let mut picture = good.clone();
    picture["images"] = serde_json::json!([{"uri": "https://example.org/x.png"}]);
    for (json, one, seven) in [
        (pointer("/nodes/1/rotation"), PointVerdict::Pass, PointVerdict::Pass),
        (pointer("/nodes/1/weights"), PointVerdict::Pass, PointVerdict::Pass),
        (sparse, PointVerdict::Pass, PointVerdict::NotJudged),
        (elsewhere, PointVerdict::NotJudged, PointVerdict::NotJudged),
        (picture, PointVerdict::NotJudged, PointVerdict::Pass),
    ] {
        let points = of_gltf(&json);
        assert_eq!((verdict(&points, 1), verdict(&points, 7)), (one, seven), "{points:?}");
    }
}

#[test]
fn splines_pointers_and_files_beside_are_motion_like_any_other() {
    let text = std::fs::read_to_string(data("gltf/embedded.gltf")).unwrap();
    let good: serde_json::Value = serde_json::from_str(&text).unwrap();
    let dir = tempfile::tempdir().unwrap();
    let times: Vec<u8> = [0f32, 1.0].iter().flat_map(|x| x.to_le_bytes()).collect();
    // A slope, the value, a slope; slopes must not be taken for places.
    let rows = [[9f32, 9.0, 9.0], [0.0, 0.0, 0.0], [9.0, 9.0, 9.0], [9.0, 9.0, 9.0], [0.0, 0.0, 0.4], [9.0, 9.0, 9.0]];
    let bytes: Vec<u8> = rows.iter().flatten().flat_map(|x| x.to_le_bytes()).collect();
    std::fs::create_dir(dir.path().join("a b")).unwrap();
    std::fs::write(dir.path().join("a b/x.bin"), [times, bytes].concat()).unwrap();
    let mut spline = good;
    spline["buffers"] = serde_json::json!([{"byteLength": 80, "uri": "a%20b/x.bin"}]);
    spline["bufferViews"] = serde_json::json!([{"buffer": 0, "byteLength": 8},
        {"buffer": 0, "byteOffset": 8, "byteLength": 72}]);
    spline["accessors"] = serde_json::json!([{"bufferView": 0, "componentType": 5126, "count": 2, "type": "SCALAR"},
        {"bufferView": 1, "componentType": 5126, "count": 6, "type": "VEC3"}]);
    spline["animations"] = serde_json::json!([{"channels": [{"sampler": 0, "target": {"path": "pointer",
        "extensions": {"KHR_animation_pointer": {"pointer": "/nodes/1/translation"}}}}],
        "samplers": [{"input": 0, "output": 1, "interpolation": "CUBICSPLINE"}]}]);
    let path = dir.path().join("spline.gltf");
    std::fs::write(&path, spline.to_string()).unwrap();
    let read = glb::read(&path).unwrap();
    assert!(read.missing.is_empty() && read.faults.is_empty(), "{:?} {:?}", read.missing, read.faults);
    assert!((read.moved[0].reaches - 0.4).abs() < 1e-6, "{:?}", read.moved);
}

#[test]
fn files_of_other_kinds_are_named_with_what_is_wanted() {
    for (name, word) in [
        ("html404.urdf", "web page (HTML)"),
        ("lfs_pointer.urdf", "Git LFS pointer"),
        ("sdf.sdf", "SDF"),
        ("utf16.urdf", "UTF-16"),
        ("root_upper.urdf", "the name is <robot>"),
        ("prefix_ns.urdf", "the name is <robot>"),
        ("z.urdf.gz", "gzip"),
        ("scene.usda", "OpenUSD"),
        ("door.obj", "is a mesh (.obj)"),
        ("lfs.glb", "Git LFS pointer"),
        ("zip.glb", "ZIP"),
        ("v1.glb", "version 2 is read"),
        ("truncated.glb", "cut off"),
        ("bad_index.glb", "its input is 99, there are 3 accessors"),
        ("cycle.glb", "lead back to it"),
    ] {
        let out = paws(&["check", name], &data("other"));
        let message = stderr(&out);
        assert_eq!(out.status.code(), Some(2), "{name}: {message}");
        assert!(message.contains(name) && message.contains(word) && !message.contains("panicked"), "{name}: {message}");
    }
}

#[test]
fn one_unreadable_file_costs_only_itself() {
    let dir = tempfile::tempdir().unwrap();
    let folder = dir.path().join("models");
    std::fs::create_dir(&folder).unwrap();
    // A URDF by what it holds, though it is called .xml.
    std::fs::copy(data("urdf/ok.urdf"), folder.join("a.xml")).unwrap();
    std::fs::copy(data("other/truncated.urdf"), folder.join("b.urdf")).unwrap();
    std::fs::copy(data("gltf/embedded.gltf"), folder.join("c.gltf")).unwrap();
    let out = paws(&["check", "models", "nowhere.urdf"], dir.path());
    let (text, message) = (String::from_utf8_lossy(&out.stdout), stderr(&out));
    assert_eq!(out.status.code(), Some(1), "{message}");
    assert!(text.contains("a.xml") && text.contains("c.gltf") && text.contains("not read"), "{text}");
    assert!(message.contains("b.urdf") && message.contains("nowhere.urdf: no such file"), "{message}");
    let out = paws(&["check", "models", "--json"], dir.path());
    let all: serde_json::Value = serde_json::from_slice(&out.stdout).unwrap();
    let errors: Vec<bool> = all.as_array().unwrap().iter().map(|c| c["error"].is_string()).collect();
    assert_eq!(errors, [false, true, false]);
    assert!(all[0]["points"].as_array().unwrap().iter().all(|p| p["verdict"] != "fail"), "{all}");
    // Where nothing could be read at all it is an error.
    let out = paws(&["check", "models/b.urdf", "nowhere.urdf"], dir.path());
    assert_eq!(out.status.code(), Some(2));
    assert!(stderr(&out).contains("b.urdf") && stderr(&out).contains("nowhere.urdf"), "{}", stderr(&out));
}
