//! `paws frames`: the depth of the frames that it names is all that a twin's joints ask for.

use std::collections::BTreeSet;

use serde_json::Value;

use crate::common::{SMALL, copy, paws, stderr, twin_of};

#[test]
fn depth_of_the_named_frames_alone_gives_the_joints_of_all_depth() {
    let dir = tempfile::tempdir().unwrap();
    let rec = dir.path().join("rec");
    copy(SMALL.path(), &rec);
    // As before any network of depth has run.
    std::fs::rename(rec.join("depth"), dir.path().join("depth")).unwrap();
    let out = paws(&["frames", "rec", "--json", "frames.json"], dir.path());
    assert_eq!(out.status.code(), Some(0), "{}", stderr(&out));
    let text = String::from_utf8_lossy(&out.stdout).into_owned();
    assert!(text.contains("a part that is closed") && text.contains("any of it"), "{text}");
    let told: Value = serde_json::from_str(&std::fs::read_to_string(dir.path().join("frames.json")).unwrap()).unwrap();
    let rows = told["frames"].as_array().unwrap();
    let numbers: BTreeSet<u64> = rows.iter().map(|f| f["frame"].as_u64().unwrap()).collect();
    let all = std::fs::read_dir(dir.path().join("depth")).unwrap().count();
    assert!(!numbers.is_empty() && numbers.len() < all, "{} of {all}", numbers.len());
    for row in rows {
        let name = format!("frames/{:06}.jpg", row["frame"].as_u64().unwrap());
        assert!(row["file"] == name.as_str() && !row["why"].as_array().unwrap().is_empty(), "{row}");
    }

    std::fs::create_dir(rec.join("depth")).unwrap();
    for number in &numbers {
        let name = format!("depth/{number:06}.png");
        std::fs::copy(dir.path().join(&name), rec.join(&name)).unwrap();
    }
    let ((_, sparse, _), (_, whole, _)) = (twin_of(&rec), twin_of(SMALL.path()));
    assert_eq!(sparse.joints.len(), whole.joints.len());
    for (a, b) in sparse.joints.iter().zip(&whole.joints) {
        assert_eq!((a.joint.kind, &a.clips), (b.joint.kind, &b.clips));
        let off = a.joint.axis.angle(&b.joint.axis).to_degrees();
        let away = (a.joint.origin - b.joint.origin).norm();
        assert!(off < 2.0 && away < 0.02, "{off} degrees, {away} m");
    }
}

#[test]
fn where_nobody_told_clips_the_frames_that_finding_asks_are_named_too() {
    let dir = tempfile::tempdir().unwrap();
    let rec = dir.path().join("rec");
    copy(SMALL.path(), &rec);
    std::fs::remove_file(rec.join("clips.json")).unwrap();
    std::fs::remove_dir_all(rec.join("depth")).unwrap();
    let out = paws(&["frames", "rec"], dir.path());
    assert_eq!(out.status.code(), Some(0), "{}", stderr(&out));
    let text = String::from_utf8_lossy(&out.stdout).into_owned();
    assert!(text.contains("interactions that nobody told"), "{text}");
}
