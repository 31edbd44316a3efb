//! What the projects' own writers write is read: COLMAP's through its Python module, in text and binary files.
//!
//! projectaria-tools reads what Aria's services write and writes none of it, so that it has no test here.

use std::path::Path;
use std::process::Command;

use paws_twin::math::Pose;
use serde_json::json;

use crate::common::{python, skipped, stderr};
use crate::import::{FRAMES, apart, copy, import, json as read_json, poses, same_bytes, small, still, write};

/// Its wheel is large: only where that is asked for.
fn is_asked_for() -> bool {
    std::env::var_os("PAWS_WRITERS").is_some_and(|v| !v.is_empty())
}

/// What the script gives to COLMAP's writer.
fn given() -> (serde_json::Value, Vec<Pose>) {
    let recording = small();
    let c = recording.camera;
    let truth: Vec<Pose> = recording.frames.iter().take(FRAMES).map(|f| f.world_from_camera).collect();
    let images: Vec<_> = truth
        .iter()
        .enumerate()
        .map(|(i, pose)| {
            let inverse = pose.inverse();
            let (q, t) = (inverse.rotation.quaternion(), inverse.translation.vector);
            json!([format!("frame {i:04}.jpg"), q.w, q.i, q.j, q.k, t.x, t.y, t.z])
        })
        .collect();
    let points: Vec<_> = (0..200u32).map(|i| [0.1 * f64::from(i % 10), 2.0, 0.1 * f64::from(i / 10)]).collect();
    let camera = json!([c.width, c.height, c.fx, c.fy, c.cx + 0.5, c.cy + 0.5]);
    (json!({"camera": camera, "images": images, "points": points}), truth)
}

#[test]
fn what_colmap_itself_writes_comes_back() {
    if !is_asked_for() {
        return skipped("what COLMAP's own writer writes is read where PAWS_WRITERS is set");
    }
    let Some(python) = python("writers") else { return };
    let dir = tempfile::tempdir().unwrap();
    let (input, truth) = given();
    write(&dir.path().join("input.json"), input.to_string());
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/writers/colmap.py");
    let run = Command::new(python).arg(script).args(["input.json", "text", "binary"]).current_dir(dir.path()).output();
    let run = run.unwrap();
    assert!(run.status.success(), "{}", stderr(&run));
    for (folder, ending) in [("text", "txt"), ("binary", "bin")] {
        assert!(dir.path().join(folder).join(format!("images.{ending}")).is_file());
        for i in 0..FRAMES {
            copy(&still("frames", i), &dir.path().join(folder).join(format!("images/frame {i:04}.jpg")));
        }
        import(&[folder, "--scale", "1", "--up", "z", "--fps", "0"], dir.path());
        let out = dir.path().join("out");
        let (m, deg) = apart(&truth, &poses(&out));
        assert!(m < 1e-9 && deg < 1e-5, "{folder}: {m} m, {deg} degrees");
        let c = small().camera;
        assert!((read_json(&out.join("cameras.json"))["cx"].as_f64().unwrap() - c.cx).abs() < 1e-9, "{folder}");
        assert!(same_bytes(&still("frames", 3), &out.join("frames/000003.jpg")), "{folder}");
        assert!(out.join("reconstruction.ply").is_file(), "{folder}");
        std::fs::remove_dir_all(&out).unwrap();
    }
}
