//! What the tests share: recordings made once, the binary, data that may be there.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::{LazyLock, Mutex};

use paws_twin::config::Config;
use paws_twin::fitting;
use paws_twin::geometry::segments::Lsd;
use paws_twin::math::Pose;
use paws_twin::pipeline::{self, Scene};
use paws_twin::reasoning::heuristic::Geometric;
use paws_twin::recording::Recording;
use paws_twin::synth::{Changes, Recorded, SynthOptions, Tier};
use paws_twin::twin::Twin;
use serde_json::Value;
use tempfile::TempDir;

use crate::skips;

/// A small clean recording that tests copy and break; rendered once.
pub static SMALL: LazyLock<TempDir> = LazyLock::new(|| {
    let dir = tempfile::tempdir().unwrap();
    record(&SynthOptions { seed: 3, tier: Tier::Clean, width: 160, parts: 1 }, dir.path());
    dir
});

/// Renders a recording into a folder.
pub fn record(options: &SynthOptions, dir: &Path) {
    record_varied(options, &Changes::default(), dir);
}

/// The same with changes; answers with the recording's world from the one that takes of a kitchen share.
pub fn record_varied(options: &SynthOptions, changes: &Changes, dir: &Path) -> Pose {
    let recorded = Recorded::varied(options, changes).unwrap();
    let write = |name: &str, bytes: &[u8]| {
        let path = dir.join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, bytes).unwrap();
    };
    for (name, text) in recorded.tables().unwrap() {
        write(&name, text.as_bytes());
    }
    for frame in 0..recorded.frames() {
        for (name, bytes) in recorded.images(frame).unwrap() {
            write(&name, &bytes);
        }
    }
    recorded.own_from_kitchen()
}

/// The whole inference on a folder.
pub fn twin_of(dir: &Path) -> (Recording, Scene, Twin) {
    let config = Config::default();
    let recording = Recording::open(dir).unwrap();
    let reasoner = Geometric::of(&config);
    let scene = pipeline::infer(&recording, &config, &Lsd, &reasoner, &|_, _, _| {}).unwrap();
    let twin = fitting::fit(&scene, &recording.up(), &config.fitting, &config.priors);
    (recording, scene, twin)
}

/// Copies a folder.
pub fn copy(from: &Path, to: &Path) {
    std::fs::create_dir_all(to).unwrap();
    for entry in std::fs::read_dir(from).unwrap() {
        let entry = entry.unwrap();
        let target = to.join(entry.file_name());
        if entry.file_type().unwrap().is_dir() {
            copy(&entry.path(), &target);
        } else {
            std::fs::copy(entry.path(), target).unwrap();
        }
    }
}

/// All files below a folder with their bytes.
pub fn tree(dir: &Path) -> BTreeMap<String, Vec<u8>> {
    fn collect(dir: &Path, prefix: &str, out: &mut BTreeMap<String, Vec<u8>>) {
        for entry in std::fs::read_dir(dir).unwrap() {
            let entry = entry.unwrap();
            let name = format!("{prefix}{}", entry.file_name().to_string_lossy());
            if entry.path().is_dir() {
                collect(&entry.path(), &format!("{name}/"), out);
            } else {
                out.insert(name, std::fs::read(entry.path()).unwrap());
            }
        }
    }
    let mut all = BTreeMap::new();
    collect(dir, "", &mut all);
    all
}

/// Runs `paws`.
pub fn paws(args: &[&str], dir: &Path) -> Output {
    Command::new(env!("CARGO_BIN_EXE_paws")).args(args).current_dir(dir).output().unwrap()
}

/// Standard error as text.
pub fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// What `paws twin` wrote into `articulations.json` of an output folder, after a look that its clips with an answer open and then
/// close one thing. What is found in error has no answer.
pub fn opened_and_closed(out: &Path) -> Value {
    let found: Value = serde_json::from_str(&std::fs::read_to_string(out.join("articulations.json")).unwrap()).unwrap();
    let clips = found["clips"].as_array().unwrap().iter();
    let verbs: Vec<&str> =
        clips.filter(|c| !c["outcome"]["found"].is_null()).filter_map(|c| c["verb"].as_str()).collect();
    assert_eq!(verbs, ["open", "close"], "{found}");
    found
}

/// Optional data beside the project (`PAWS_DATA`, else `../shared/data`). Without that folder a test that uses it is skipped,
/// which is counted; a folder that is there and lacks it is a failure.
pub fn optional_data(name: &str) -> Option<PathBuf> {
    let named = std::env::var_os("PAWS_DATA").filter(|v| !v.is_empty());
    let root =
        named.as_ref().map_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/data"), PathBuf::from);
    match data_at(&root, named.is_some(), name) {
        Ok(Some(path)) => Some(path),
        Ok(None) => {
            skipped(&format!("there is no {} for \"{name}\" (set PAWS_DATA to a folder that has it)", root.display()));
            None
        }
        Err(missing) => panic!("{missing}"),
    }
}

/// Data in a folder; `None` where there is no such folder and nobody `named` it, an error where it lacks the data.
pub fn data_at(root: &Path, named: bool, name: &str) -> Result<Option<PathBuf>, String> {
    let path = root.join(name);
    match path.exists() {
        true => Ok(Some(path)),
        false if named || root.is_dir() => {
            Err(format!("{} is not there, but its folder is to be used", path.display()))
        }
        false => Ok(None),
    }
}

/// The list of this run, empty at first.
static SKIPS: LazyLock<Mutex<()>> = LazyLock::new(|| {
    std::fs::write(skips::list(), skips::begun(&skips::run())).unwrap();
    Mutex::new(())
});

/// Begins the list of what was skipped, once: what an earlier run has left is gone.
pub fn begin_skips() {
    LazyLock::force(&SKIPS);
}

/// Says that a check was skipped, past the capture of passing tests, and puts it on the list.
pub fn skipped(why: &str) {
    use std::io::Write;
    let line = why.split_whitespace().collect::<Vec<_>>().join(" ");
    let _ = writeln!(std::io::stderr(), "skipped: {line}");
    let _one_at_a_time = SKIPS.lock().unwrap();
    let mut list = std::fs::OpenOptions::new().append(true).open(skips::list()).unwrap();
    writeln!(list, "{line}").unwrap();
}

/// Whether a check that cannot run is a failure.
pub fn required() -> bool {
    ["CI", "PAWS_REQUIRE_SIMULATORS"].iter().any(|v| std::env::var_os(v).is_some_and(|x| !x.is_empty()))
}

/// Python with what `tests/NAME/requirements.txt` asks for, in an environment of the tests' own, made on first use.
///
/// `None`, and a word, where there is no Python 3 or no PyPI; there `CI` or `PAWS_REQUIRE_SIMULATORS` make it a failure.
pub fn python(name: &str) -> Option<PathBuf> {
    match environment(name) {
        Ok(python) => Some(python),
        Err(reason) if required() => panic!("the checks of tests/{name} cannot run: {reason}"),
        Err(reason) => {
            skipped(&format!("the checks of tests/{name} need python3 and PyPI ({reason})"));
            None
        }
    }
}

fn environment(name: &str) -> Result<PathBuf, String> {
    let requirements = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests").join(name).join("requirements.txt");
    let home = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
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
