//! The Python module: its wheel is built, installed into a fresh environment, and its tests and the scripts of
//! `examples/python` run there.

use std::path::Path;
use std::process::Command;

use crate::common::{required, skipped};

/// Building the module compiles the library once more, which takes minutes: only where that is asked for, by `PAWS_PYTHON=1`, or
/// `PAWS_PYTHON=gallery` with all programs that the scripts of the gallery can use.
fn asked_for() -> Option<String> {
    std::env::var("PAWS_PYTHON").ok().filter(|v| !v.is_empty())
}

/// What a manifest says of release builds, without comments.
fn release_profiles(manifest: &str) -> Vec<String> {
    let text = std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join(manifest)).unwrap();
    let mut is_release = false;
    let mut lines = Vec::new();
    for line in text.lines().map(str::trim).filter(|line| !line.is_empty() && !line.starts_with('#')) {
        if line.starts_with('[') {
            is_release = line.starts_with("[profile.release");
        }
        if is_release {
            lines.push(line.to_owned());
        }
    }
    lines
}

/// Else all dependencies are built twice.
#[test]
fn the_wheel_is_built_as_the_crate_is() {
    let crate_s = release_profiles("Cargo.toml");
    assert!(crate_s.len() > 3, "the scan found next to nothing: {crate_s:?}");
    assert_eq!(crate_s, release_profiles("python/Cargo.toml"));
}

#[test]
fn the_wheel_installs_and_its_scripts_run() {
    let Some(asked) = asked_for() else {
        skipped("the Python module is tested where PAWS_PYTHON is set");
        return;
    };
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let home = Path::new(env!("CARGO_TARGET_TMPDIR")).join("python_module");
    let mut run = Command::new("bash");
    run.arg(root.join("python/run")).arg(&home);
    if asked == "gallery" {
        run.arg("gallery");
    }
    // A folder of its own that stays: the next run builds what has changed.
    run.env("CARGO_TARGET_DIR", home.join("target"));
    // What cargo tells its tests is about another crate.
    for (name, _) in std::env::vars_os() {
        let name_text = name.to_string_lossy();
        if name_text.starts_with("CARGO_PKG_") || name_text.starts_with("CARGO_MANIFEST_") {
            run.env_remove(&name);
        }
    }
    let out = match run.output() {
        Ok(out) => out,
        Err(error) if required() => panic!("bash: {error}"),
        Err(error) => {
            skipped(&format!("the Python module is built by bash: {error}"));
            return;
        }
    };
    let text = format!("{}{}", String::from_utf8_lossy(&out.stdout), String::from_utf8_lossy(&out.stderr));
    let tail: Vec<&str> = text.lines().rev().take(40).collect();
    let tail: Vec<&str> = tail.into_iter().rev().collect();
    assert!(out.status.success(), "{}", tail.join("\n"));
    for line in text.lines().filter(|line| line.starts_with("SKIPPED ") || line.starts_with("not installed: ")) {
        skipped(line);
    }
}
