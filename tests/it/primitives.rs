//! Motion primitives: what the commands write, and a gripper that executes them in MuJoCo.

use std::path::Path;
use std::process::Command;

use paws_twin::primitives::{Primitives, SCHEMA, TimingSource};

use crate::common::{SMALL, paws, python, stderr};

fn read(path: &Path) -> Primitives {
    serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap()
}

#[test]
fn a_twins_folder_exports_the_primitives_that_it_came_with() {
    let dir = tempfile::tempdir().unwrap();
    let made = paws(&["twin", SMALL.path().to_str().unwrap(), "--out", "t"], dir.path());
    assert_ne!(made.status.code(), Some(2), "{}", stderr(&made));
    let written = dir.path().join("t/primitives.json");
    let primitives = read(&written);
    assert_eq!((primitives.schema.as_str(), primitives.left_out.len()), (SCHEMA, 0));
    assert!(!primitives.joints.is_empty());
    for joint in &primitives.joints {
        assert!(joint.uncertainty.verdict.is_some() && joint.uncertainty.axis_std_rad.is_some(), "{joint:?}");
        assert!(joint.uncertainty.contact_std_m.is_some_and(|m| m > 0.0));
        // Somebody opened or closed it.
        assert_ne!(joint.opening.timing.source, TimingSource::MinimumJerk);
        assert!(joint.opening.timing.clip.is_some());
        assert_eq!([joint.opening.to, joint.closing.from], [joint.limits.upper; 2]);
    }
    let out = paws(&["export", "t", "--format", "primitives", "--out", "again"], dir.path());
    assert!(out.status.success(), "{}", stderr(&out));
    let again = std::fs::read(dir.path().join("again/primitives.json")).unwrap();
    assert!(again == std::fs::read(&written).unwrap(), "export writes other primitives than twin");
    // A hand that is no motion is told, not used.
    std::fs::write(
        dir.path().join("t/trajectories.json"),
        r#"[{"joint": "joint_0", "clips": [["c", {"side": null, "samples": [], "action": "open"}]]}]"#,
    )
    .unwrap();
    let out = paws(&["export", "t", "--format", "primitives", "--out", "none"], dir.path());
    assert_eq!(out.status.code(), Some(2));
    assert!(stderr(&out).contains("trajectories.json: clip c: no samples"), "{}", stderr(&out));
}

#[test]
fn joints_of_elsewhere_have_primitives_without_a_hand() {
    let dir = tempfile::tempdir().unwrap();
    let example = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/joints.json");
    let out = paws(&["export", example.to_str().unwrap(), "--format", "primitives", "--out", "f"], dir.path());
    assert!(out.status.success(), "{}", stderr(&out));
    let primitives = read(&dir.path().join("f/primitives.json"));
    assert_eq!(primitives.joints.len(), 2);
    for joint in &primitives.joints {
        assert_eq!(joint.opening.timing.source, TimingSource::MinimumJerk);
        assert!(joint.uncertainty.verdict.is_none() && joint.uncertainty.contact_std_m.is_none());
    }
}

#[test]
fn a_true_kitchen_stays_out_of_the_recording() {
    let dir = tempfile::tempdir().unwrap();
    let synth = |kitchen: &str| {
        paws(
            &["synth", "--seed", "3", "--tier", "clean", "--width", "64", "--parts", "1", "--out", "rec"]
                .into_iter()
                .chain(["--kitchen", kitchen])
                .collect::<Vec<_>>(),
            dir.path(),
        )
    };
    let inside = synth("rec/truth");
    assert_eq!(inside.status.code(), Some(2));
    assert!(stderr(&inside).contains("choose another --kitchen"), "{}", stderr(&inside));
    let out = synth("truth");
    assert!(out.status.success(), "{}", stderr(&out));
    for file in ["scene.xml", "twin.json", "ground_truth.json"] {
        assert!(dir.path().join("truth").join(file).is_file(), "{file}");
    }
    assert!(!dir.path().join("rec/scene.xml").exists());
}

/// The example for people, on joints whose answer is known.
#[test]
fn a_gripper_opens_every_joint_by_its_primitive() {
    let Some(python) = python("robot") else { return };
    let dir = tempfile::tempdir().unwrap();
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let example = root.join("examples/joints.json");
    let out = paws(&["export", example.to_str().unwrap(), "--out", "kitchen"], dir.path());
    assert!(out.status.success(), "{}", stderr(&out));
    let open = |more: &[&str]| {
        let mut command = Command::new(&python);
        command.arg(root.join("examples/python/open_doors.py")).arg("kitchen").args(["--out", "table.json"]);
        command.args(more).current_dir(dir.path()).output().unwrap()
    };
    let table = || -> serde_json::Value {
        serde_json::from_slice(&std::fs::read(dir.path().join("table.json")).unwrap()).unwrap()
    };
    for more in [[].as_slice(), ["--truth", "kitchen", "--look"].as_slice()] {
        let out = open(more);
        let said = String::from_utf8_lossy(&out.stdout).into_owned();
        assert!(out.status.success(), "{more:?}: {said}{}", stderr(&out));
        assert_eq!((table()["opened"].as_u64(), table()["closed"].as_u64()), (Some(2), Some(2)), "{more:?}: {said}");
    }
    // It can fail: on another kitchen's handles there is nothing to take hold of.
    let scene = std::fs::read_to_string(dir.path().join("kitchen/primitives.json")).unwrap();
    let mut moved: serde_json::Value = serde_json::from_str(&scene).unwrap();
    for joint in moved["joints"].as_array_mut().unwrap() {
        joint["contact"]["point"][0] = serde_json::json!(5.0);
    }
    std::fs::write(dir.path().join("kitchen/primitives.json"), moved.to_string()).unwrap();
    let out = open(&["--truth", "kitchen"]);
    assert_eq!((out.status.code(), table()["opened"].as_u64()), (Some(1), Some(0)));
}
