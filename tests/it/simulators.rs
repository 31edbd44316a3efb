//! The exported files in the simulators that people use: `tests/simulators`, installed into an environment of their own.
//!
//! What cannot be installed (no Python 3, no npm, no network) is said and left out, except where `CI` or
//! `PAWS_REQUIRE_SIMULATORS` is set: there a check that cannot run is a failure.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use paws_twin::synth::{SynthOptions, Tier};

use crate::common::{optional_data, paws, record, required, skipped, stderr};

fn script(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/simulators").join(name)
}

fn text(out: &Output) -> String {
    format!("{}{}", String::from_utf8_lossy(&out.stdout), String::from_utf8_lossy(&out.stderr))
}

/// The Python of the simulators' environment, made on first use; `None` where there is none and none is required.
fn python() -> Option<PathBuf> {
    let home = Path::new(env!("CARGO_TARGET_TMPDIR")).join("simulators");
    let mut install = Command::new("python3");
    install.arg(script("install.py")).arg(&home);
    if required() {
        install.arg("--require");
    }
    let words = match install.output() {
        Ok(out) if out.status.success() => text(&out),
        Ok(out) => format!("{}cannot run", text(&out)),
        Err(e) => format!("python3: {e}: cannot run"),
    };
    let python = home.join("python/bin/python");
    if words.contains("cannot run") {
        assert!(!required(), "the simulator checks cannot run: {words}");
        skipped(&format!("some simulator checks need Python 3, PyPI, npm and Debian's packages: {words}"));
    }
    // The core of the checks is Python's; without it nothing can be asked.
    home.join("python.installed").exists().then_some(python)
}

/// Twins that no recording was needed for: the folders of twenty kitchens of 1 to 40 joints.
fn kitchens(python: &Path, dir: &Path) -> Vec<String> {
    let mut make = Command::new(python);
    make.arg(script("kitchens.py")).arg("kitchens").args(["--paws", env!("CARGO_BIN_EXE_paws")]).current_dir(dir);
    let made = make.output().unwrap();
    assert!(made.status.success(), "{}", text(&made));
    let mut folders: Vec<String> = std::fs::read_dir(dir.join("kitchens"))
        .unwrap()
        .map(|entry| format!("kitchens/{}", entry.unwrap().file_name().to_string_lossy()))
        .collect();
    folders.sort();
    assert_eq!(folders.len(), 20);
    folders
}

#[test]
fn twins_are_ready_for_every_simulator() {
    let Some(python) = python() else { return };
    let dir = tempfile::tempdir().unwrap();
    let mut folders = Vec::new();
    for (seed, tier, parts) in
        [(21, Tier::Clean, 5), (22, Tier::Realistic, 5), (23, Tier::Clean, 1), (24, Tier::Hard, 6)]
    {
        let name = format!("kitchen_{seed}");
        record(&SynthOptions { seed, tier, width: 240, parts }, &dir.path().join(&name));
        folders.push((name.clone(), dir.path().join(name)));
    }
    if let Some(root) = optional_data("recordings") {
        for name in ["apartment_clean", "apartment_realistic", "apartment_hard"] {
            folders.push((name.to_owned(), root.join(name)));
        }
    }
    // Looks are real and small: what is tried is whether they load, not how long that takes.
    std::fs::write(dir.path().join("look.toml"), "[appearance]\ntriangles = 4000\ntexel_m = 0.02\n").unwrap();
    let mut twins = Vec::new();
    for (name, recording) in folders {
        let out = format!("twin_{name}");
        let result = paws(&["twin", recording.to_str().unwrap(), "--config", "look.toml", "--out", &out], dir.path());
        assert_ne!(result.status.code(), Some(2), "{name}: {}", stderr(&result));
        twins.push(out);
    }
    // One with a look that is known.
    crate::common::copy(&dir.path().join(&twins[0]), &dir.path().join("dressed"));
    crate::looks::dress_up(&dir.path().join("dressed"));
    twins.push("dressed".to_owned());
    twins.extend(kitchens(&python, dir.path()));
    let mut matrix = Command::new(&python);
    matrix.arg(script("matrix.py")).args(&twins).args(["--paws", env!("CARGO_BIN_EXE_paws")]).current_dir(dir.path());
    if required() {
        matrix.arg("--require");
    }
    let matrix = matrix.output().unwrap();
    eprintln!("{}", text(&matrix));
    assert!(matrix.status.success(), "{}", text(&matrix));
    // Checks that never fail are worth nothing: faults put into the files must be noticed.
    let faults =
        Command::new(&python).arg(script("mutations.py")).arg("dressed").current_dir(dir.path()).output().unwrap();
    assert!(faults.status.success(), "{}", text(&faults));
}
