//! The exported files in the simulators that people use: installed from PyPI into an environment of the tests' own.
//!
//! Without Python 3 or without a network the test says so and is skipped, except where `CI` or `PAWS_REQUIRE_SIMULATORS`
//! is set: there a check that cannot run is a failure.

use std::path::Path;
use std::process::Command;

use paws_twin::synth::{Options, Tier};

use crate::common::{optional_data, paws, python, record, stderr};

#[test]
fn mujoco_loads_both_files_and_every_joint_rests_opens_and_closes() {
    let Some(python) = python("simulators") else { return };
    let dir = tempfile::tempdir().unwrap();
    let mut folders = Vec::new();
    for (seed, tier) in [(21, Tier::Clean), (22, Tier::Realistic)] {
        let name = format!("kitchen_{seed}");
        record(&Options { seed, tier, width: 240, parts: 5 }, &dir.path().join(&name));
        folders.push((name.clone(), dir.path().join(name)));
    }
    if let Some(root) = optional_data("recordings") {
        for name in ["apartment_clean", "apartment_realistic", "apartment_hard"] {
            folders.push((name.to_owned(), root.join(name)));
        }
    }
    let mut twins = Vec::new();
    for (name, recording) in folders {
        let out = format!("twin_{name}");
        let result = paws(&["twin", recording.to_str().unwrap(), "--out", &out], dir.path());
        assert_ne!(result.status.code(), Some(2), "{name}: {}", stderr(&result));
        twins.push(out);
    }
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/simulators/check_mujoco.py");
    let out = Command::new(python).arg(script).args(&twins).current_dir(dir.path()).output().unwrap();
    let text = format!("{}{}", String::from_utf8_lossy(&out.stdout), String::from_utf8_lossy(&out.stderr));
    eprintln!("{text}");
    assert!(out.status.success(), "{text}");
    assert_eq!(text.matches(" ok ").count(), 2 * twins.len(), "every twin is checked in two formats");
}
