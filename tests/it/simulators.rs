//! The exported files in the simulators that people use: installed from PyPI into an environment of the tests' own.
//!
//! Without Python 3 or without a network the test says so and is skipped, except where `CI` or `PAWS_REQUIRE_SIMULATORS`
//! is set: there a check that cannot run is a failure.

use std::path::{Path, PathBuf};
use std::process::Command;

use paws_twin::synth::{Options, Tier};

use crate::common::{optional_data, paws, record, skipped, stderr};

fn required() -> bool {
    ["CI", "PAWS_REQUIRE_SIMULATORS"].iter().any(|v| std::env::var_os(v).is_some_and(|x| !x.is_empty()))
}

/// The environment's Python, made on first use; `Err` says why there is none.
fn python() -> Result<PathBuf, String> {
    let requirements = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/simulators/requirements.txt");
    let home = Path::new(env!("CARGO_TARGET_TMPDIR")).join("simulators");
    let python = home.join("bin/python");
    let stamp = home.join("requirements.txt");
    let wanted = std::fs::read_to_string(&requirements).map_err(|e| e.to_string())?;
    if std::fs::read_to_string(&stamp).is_ok_and(|have| have == wanted) {
        return Ok(python);
    }
    let run = |what: &str, command: &mut Command| -> Result<(), String> {
        let out = command.output().map_err(|e| format!("{what}: {e}"))?;
        let tail: String = String::from_utf8_lossy(&out.stderr).lines().rev().take(3).collect::<Vec<_>>().join(" | ");
        if out.status.success() { Ok(()) } else { Err(format!("{what} failed: {tail}")) }
    };
    run("python3 -m venv", Command::new("python3").args(["-m", "venv", "--clear"]).arg(&home))?;
    run("pip install", Command::new(&python).args(["-m", "pip", "install", "--quiet", "-r"]).arg(&requirements))?;
    std::fs::write(&stamp, wanted).map_err(|e| e.to_string())?;
    Ok(python)
}

#[test]
fn mujoco_loads_both_files_and_every_joint_rests_opens_and_closes() {
    let python = match python() {
        Ok(python) => python,
        Err(reason) if required() => panic!("the simulator checks cannot run: {reason}"),
        Err(reason) => {
            skipped(&format!("the simulator checks need python3 and PyPI ({reason})"));
            return;
        }
    };
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
