//! Data sets that come as several downloads, written of a synthetic kitchen.

use std::fmt::Write as _;
use std::path::Path;

use paws_twin::math::Pose;

use crate::common::{paws, stderr};
use crate::import::{FRAMES, apart, copy, depth_mm, edit, import, json, poses, same_bytes, small, still, write};
use crate::import_devices::npy;

const SEQUENCE: &str = "ZY20210800001/H1/C4/N11/S259/s02/T1";

/// HOI4D, decoded: images, depth and poses in three downloads, cameras beside them.
fn write_hoi4d(root: &Path) -> Vec<Pose> {
    let recording = small();
    let c = recording.camera;
    let of = |download: &str, name: &str| root.join(download).join(SEQUENCE).join(name);
    let mut log = String::new();
    let mut out = Vec::new();
    for (i, frame) in recording.frames.iter().take(FRAMES).enumerate() {
        copy(&still("frames", i), &of("HOI4D_release", &format!("align_rgb/{i:05}.jpg")));
        copy(&still("depth", i), &of("HOI4D_depth_video", &format!("align_depth/{i:05}.png")));
        let m = frame.world_from_camera.to_homogeneous();
        writeln!(log, "{i} {i} {}", i + 1).unwrap();
        for row in 0..4 {
            writeln!(log, "{} {} {} {}", m[(row, 0)], m[(row, 1)], m[(row, 2)], m[(row, 3)]).unwrap();
        }
        out.push(frame.world_from_camera);
    }
    write(&of("HOI4D_annotations", "3Dseg/output.log"), log);
    let k = [c.fx, 0.0, c.cx, 0.0, c.fy, c.cy, 0.0, 0.0, 1.0];
    write(&root.join("camera_params/ZY20210800001/intrin.npy"), npy("(3, 3)", &k));
    out
}

#[test]
fn hoi4d_comes_back_with_its_depth_from_the_downloads_beside() {
    let dir = tempfile::tempdir().unwrap();
    let truth = write_hoi4d(dir.path());
    let source = format!("HOI4D_release/{SEQUENCE}");
    import(&[&source, "--fps", "0", "--up", "z"], dir.path());
    let out = dir.path().join("out");
    let (m, deg) = apart(&truth, &poses(&out));
    assert!(m < 1e-9 && deg < 1e-5, "{m} m, {deg} degrees");
    assert_eq!(depth_mm(&out.join("depth/000003.png")), depth_mm(&still("depth", 3)));
    assert!(same_bytes(&still("frames", 3), &out.join("frames/000003.jpg")));
    let (cameras, c) = (json(&out.join("cameras.json")), small().camera);
    assert!((cameras["fx"].as_f64().unwrap() - c.fx).abs() < 1e-4 && cameras["width"] == c.width);
    assert_eq!(json(&out.join("import.json"))["sources"][0]["kind"], "hoi4d");
}

#[test]
fn hoi4ds_packed_depth_is_told_with_the_command_that_unpacks_it() {
    let dir = tempfile::tempdir().unwrap();
    write_hoi4d(dir.path());
    let depth = dir.path().join("HOI4D_depth_video").join(SEQUENCE).join("align_depth");
    std::fs::remove_dir_all(&depth).unwrap();
    write(&depth.join("depth_video.avi"), "16 bits");
    let source = format!("HOI4D_annotations/{SEQUENCE}");
    let text = import(&[&source, "--fps", "0", "--up", "z"], dir.path());
    assert!(text.contains("missing: depth (it is in a video") && text.contains("align_depth/%05d.png"), "{text}");
}

/// A bad pose in a source costs its frame and is told with its place.
#[test]
fn one_bad_pose_costs_only_its_frame() {
    let dir = tempfile::tempdir().unwrap();
    write_hoi4d(dir.path());
    let log = dir.path().join("HOI4D_annotations").join(SEQUENCE).join("3Dseg/output.log");
    edit(&log, "\n3 3 4\n", "\n3 3 4\nnan ");
    let text = import(&[&format!("HOI4D_release/{SEQUENCE}"), "--fps", "0", "--up", "z"], dir.path());
    assert!(text.contains("1 poses that cannot be read") && text.contains("output.log: line"), "{text}");

    let recording = small();
    let mut trajectory = String::new();
    for (i, frame) in recording.frames.iter().take(FRAMES).enumerate() {
        let (t, q) = (frame.world_from_camera.translation.vector, frame.world_from_camera.rotation.coords);
        let y = if i == 7 { "nan".to_owned() } else { t.y.to_string() };
        writeln!(trajectory, "{} {} {y} {} {} {} {} {}", 0.1 * i as f64, t.x, t.z, q.x, q.y, q.z, q.w).unwrap();
    }
    write(&dir.path().join("poses.txt"), trajectory + "4.9 1 2\n");
    let c = recording.camera;
    let numbers = format!("{},{},{},{},{},{}", c.width, c.height, c.fx, c.fy, c.cx, c.cy);
    let out =
        paws(&["import", "poses.txt", "--camera", &numbers, "--up", "z", "--fps", "0", "--out", "tum"], dir.path());
    let text = String::from_utf8_lossy(&out.stdout);
    assert!(text.contains("2 poses that cannot be read") && text.contains("line 8"), "{text}{}", stderr(&out));
    assert_eq!(poses(&dir.path().join("tum")).len(), FRAMES - 1);
    // Where most are bad nothing is imported.
    write(&dir.path().join("bad.txt"), "0 0 0 0 0 0 0 1\n1 nan 0 0 0 0 0 1\n2 0 0 nan 0 0 0 1\n");
    let out = paws(&["import", "bad.txt", "--camera", &numbers, "--out", "none"], dir.path());
    assert!(out.status.code() == Some(2) && stderr(&out).contains("bad.txt: line 2"), "{}", stderr(&out));
}

#[test]
fn what_is_not_read_is_named_with_the_way_out() {
    let dir = tempfile::tempdir().unwrap();
    write(&dir.path().join("walk.vrs"), "VisionRe");
    write(&dir.path().join("scan.json"), "version https://git-lfs.github.com/spec/v1\noid sha256:00\nsize 9\n");
    for (file, word) in [("walk.vrs", "examples/import/aria_vrs.py"), ("scan.json", "git lfs pull")] {
        let out = paws(&["import", file, "--out", "out"], dir.path());
        assert!(out.status.code() == Some(2) && stderr(&out).contains(word), "{file}: {}", stderr(&out));
    }
}

#[test]
fn one_bad_matrix_of_nerfstudio_costs_only_its_frame() {
    let dir = tempfile::tempdir().unwrap();
    let recording = small();
    let c = recording.camera;
    let rows = |i: usize| {
        let m = recording.frames[i].world_from_camera.to_homogeneous();
        let flip = [1.0, -1.0, -1.0, 1.0];
        let row = |r: usize| -> Vec<f64> { (0..4).map(|k| m[(r, k)] * flip[k]).collect() };
        if i == 5 { serde_json::json!([row(0), row(1)]) } else { serde_json::json!([row(0), row(1), row(2), row(3)]) }
    };
    let frames: Vec<_> = (0..FRAMES)
        .map(|i| {
            copy(&still("frames", i), &dir.path().join(format!("scene/images/{i:05}.jpg")));
            serde_json::json!({"file_path": format!("images/{i:05}.jpg"), "transform_matrix": rows(i)})
        })
        .collect();
    let transforms = serde_json::json!({"w": c.width, "h": c.height, "fl_x": c.fx, "fl_y": c.fy, "cx": c.cx + 0.5,
                                        "cy": c.cy + 0.5, "frames": frames});
    write(&dir.path().join("scene/transforms.json"), transforms.to_string());
    let text = import(&["scene", "--fps", "0", "--up", "z", "--unit", "1"], dir.path());
    assert!(text.contains("1 frames that cannot be read") && text.contains("frame images/00005.jpg"), "{text}");
    assert_eq!(poses(&dir.path().join("out")).len(), FRAMES - 1);
}
