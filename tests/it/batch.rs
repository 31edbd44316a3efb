//! `paws batch`: many recordings, one of which is always broken, and runs that are killed.

use std::collections::BTreeMap;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Duration;

use paws_twin::synth::{SynthOptions, Tier};

use crate::common::{paws, record, stderr, tree};

/// Recordings `r0`, `r1`, ... and a manifest of them.
fn recordings(dir: &Path, count: u64) {
    let mut manifest = "name,recording\n".to_owned();
    for i in 0..count {
        let options = SynthOptions { seed: 3 + i, tier: Tier::Clean, width: 96, parts: 1 };
        record(&options, &dir.join(format!("r{i}")));
        manifest += &format!("k{i},r{i}\n");
    }
    std::fs::write(dir.join("m.csv"), manifest).unwrap();
}

/// A table's rows by their names.
fn rows(table: &Path) -> BTreeMap<String, Vec<String>> {
    let text = std::fs::read_to_string(table).unwrap();
    text.lines()
        .skip(1)
        .map(|line| {
            let cells: Vec<String> = line.split(',').map(str::to_owned).collect();
            (cells[0].clone(), cells)
        })
        .collect()
}

fn journal(out: &Path) -> Vec<serde_json::Value> {
    let text = std::fs::read_to_string(out.join("journal.jsonl")).unwrap();
    text.lines().map(|line| serde_json::from_str(line).unwrap()).collect()
}

/// The tables that hold no times.
fn tables(out: &Path) -> Vec<String> {
    ["results", "joints", "predictions"]
        .map(|name| std::fs::read_to_string(out.join(format!("{name}.csv"))).unwrap())
        .into()
}

#[test]
fn a_broken_recording_costs_its_row_and_nothing_is_made_twice() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path();
    recordings(path, 2);
    let manifest = std::fs::read_to_string(path.join("m.csv")).unwrap();
    std::fs::create_dir_all(path.join("empty")).unwrap();
    let more = "lost,nowhere\nempty,empty\nagain,./r0\n";
    std::fs::write(path.join("m.csv"), manifest + more).unwrap();
    let first = paws(&["batch", "m.csv", "--out", "out", "--jobs", "2"], path);
    assert_eq!(first.status.code(), Some(1), "{}", stderr(&first));
    let out = path.join("out");
    let results = rows(&out.join("results.csv"));
    let names: Vec<&str> = results.keys().map(String::as_str).collect();
    assert_eq!(names, ["again", "empty", "k0", "k1", "lost"]);
    for (name, status, reason) in [
        ("k0", "done", ""),
        ("k1", "done", ""),
        ("lost", "failed", "no such folder"),
        ("empty", "failed", "cameras.json"),
        ("again", "failed", "is the recording of k0 (line 2)"),
    ] {
        let row = &results[name];
        assert_eq!(row[2], status, "{row:?}");
        assert!(row[11..].join(",").contains(reason), "{row:?}");
    }
    // A twin of a batch is the twin.
    let alone = paws(&["twin", "r0", "--out", "alone"], path);
    assert_eq!(alone.status.code(), Some(0), "{}", stderr(&alone));
    let model = |twin: &str| std::fs::read(path.join(twin).join("scene.xml")).unwrap();
    assert_eq!(model("alone"), model("out/twins/k0"));
    assert!(rows(&out.join("joints.csv")).contains_key("k0"));

    // The journal grows by what never began at the most, and no twin is written again.
    let (before, written) = (tables(&out), tree(&out.join("twins")));
    let length = journal(&out).len();
    std::fs::write(out.join("twins/k0/seen"), "").unwrap();
    let second = paws(&["batch", "m.csv", "--out", "out"], path);
    assert_eq!(second.status.code(), Some(1), "{}", stderr(&second));
    assert!(stderr(&second).contains("3 of 5 recordings are finished already"), "{}", stderr(&second));
    assert_eq!(journal(&out).len(), length);
    assert!(out.join("twins/k0/seen").is_file());
    assert_eq!(tables(&out), before);
    std::fs::remove_file(out.join("twins/k0/seen")).unwrap();
    assert_eq!(tree(&out.join("twins")), written);
}

#[test]
fn results_of_another_version_or_other_parameters_are_made_again() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path();
    recordings(path, 1);
    assert_eq!(paws(&["batch", "m.csv", "--out", "out", "--no-textures"], path).status.code(), Some(0));
    let file = path.join("out/journal.jsonl");
    let text = std::fs::read_to_string(&file).unwrap();
    let version = format!("\"version\":\"{}\"", env!("CARGO_PKG_VERSION"));
    assert!(text.contains(&version), "{text}");
    std::fs::write(&file, text.replace(&version, "\"version\":\"0.0.1\"")).unwrap();
    assert_eq!(paws(&["batch", "m.csv", "--out", "out", "--no-textures"], path).status.code(), Some(0));
    assert_eq!(journal(&path.join("out")).len(), 2);
    std::fs::write(path.join("c.toml"), "seed = 5\n").unwrap();
    assert_eq!(
        paws(&["batch", "m.csv", "--out", "out", "--no-textures", "--config", "c.toml"], path).status.code(),
        Some(0)
    );
    assert_eq!(journal(&path.join("out")).len(), 3);
    // So is one whose twin is gone.
    std::fs::remove_dir_all(path.join("out/twins/k0")).unwrap();
    assert_eq!(
        paws(&["batch", "m.csv", "--out", "out", "--no-textures", "--config", "c.toml"], path).status.code(),
        Some(0)
    );
    assert_eq!(journal(&path.join("out")).len(), 4);
}

#[test]
fn a_batch_that_is_killed_again_and_again_loses_nothing_and_makes_nothing_twice() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path();
    recordings(path, 4);
    let whole = paws(&["batch", "m.csv", "--out", "whole", "--no-textures"], path);
    assert_eq!(whole.status.code(), Some(0), "{}", stderr(&whole));
    // Longer and longer, so that it ends; the moments differ from run to run by what the machine does.
    for round in 1..=12 {
        let mut command = Command::new(env!("CARGO_BIN_EXE_paws"));
        command.args(["batch", "m.csv", "--out", "out", "--no-textures", "--jobs", "2"]).current_dir(path);
        let mut child = command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
        std::thread::sleep(Duration::from_millis(90 * round));
        child.kill().unwrap();
        child.wait().unwrap();
        // What it had started ends with it, but not in no time.
        std::thread::sleep(Duration::from_millis(100));
    }
    let last = paws(&["batch", "m.csv", "--out", "out", "--no-textures", "--jobs", "2"], path);
    assert_eq!(last.status.code(), Some(0), "{}", stderr(&last));
    let mut names: Vec<String> =
        journal(&path.join("out")).iter().map(|entry| entry["name"].as_str().unwrap().to_owned()).collect();
    names.sort();
    assert_eq!(names, ["k0", "k1", "k2", "k3"]);
    assert_eq!(tables(&path.join("out")), tables(&path.join("whole")));
    let models = |out: &str| -> BTreeMap<String, Vec<u8>> {
        let all = tree(&path.join(out).join("twins"));
        all.into_iter().filter(|(name, _)| name.ends_with(".json") || name.ends_with(".xml")).collect()
    };
    assert_eq!(models("out"), models("whole"));
}

#[test]
fn shards_together_are_the_whole() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path();
    recordings(path, 3);
    for shard in ["1/2", "2/2"] {
        let out = paws(&["batch", "m.csv", "--out", "out", "--no-textures", "--shard", shard], path);
        assert_eq!(out.status.code(), Some(0), "{}", stderr(&out));
        assert!(!path.join("out/results.csv").exists());
    }
    let gathered = paws(&["batch", "m.csv", "--out", "out", "--no-textures"], path);
    assert!(stderr(&gathered).contains("3 of 3 recordings are finished already"), "{}", stderr(&gathered));
    assert_eq!(paws(&["batch", "m.csv", "--out", "whole", "--no-textures"], path).status.code(), Some(0));
    assert_eq!(tables(&path.join("out")), tables(&path.join("whole")));
}

#[cfg(unix)]
#[test]
fn a_worker_that_dies_costs_its_row_and_is_tried_again() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path();
    recordings(path, 2);
    let program = path.join("dies");
    // Dies over the second recording only.
    let paws_itself = env!("CARGO_BIN_EXE_paws");
    script(&program, &format!("#!/bin/sh\ncase \"$*\" in *r1*) kill -9 $$;; esac\nexec \"{paws_itself}\" \"$@\"\n"));
    let mut command = Command::new(env!("CARGO_BIN_EXE_paws"));
    command.args(["batch", "m.csv", "--out", "out", "--no-textures", "--worker"]).arg(&program).current_dir(path);
    let out = command.output().unwrap();
    assert_eq!(out.status.code(), Some(1), "{}", stderr(&out));
    let results = rows(&path.join("out/results.csv"));
    assert_eq!((results["k0"][2].as_str(), results["k1"][2].as_str()), ("done", "failed"));
    assert!(results["k1"][11].contains("signal"), "{results:?}");
    let again = paws(&["batch", "m.csv", "--out", "out", "--no-textures"], path);
    assert_eq!(again.status.code(), Some(0), "{}", stderr(&again));
    assert_eq!(journal(&path.join("out")).len(), 3);
}

/// The script for Slurm, run by a stand-in for `sbatch` that does one task of the array after the other.
#[cfg(unix)]
#[test]
fn an_array_of_slurm_is_the_whole() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path();
    recordings(path, 3);
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let program = Path::new(env!("CARGO_BIN_EXE_paws")).parent().unwrap();
    let search = format!("{}:{}", program.display(), std::env::var("PATH").unwrap());
    let sbatch = |words: &[&str]| {
        let mut command = Command::new("bash");
        command.arg(root.join("tests/slurm/sbatch")).arg(words[0]).arg(root.join("examples/batch.sbatch"));
        command.args(["m.csv", "out"]).args(&words[1..]).current_dir(path);
        let done = command.env("PATH", &search).env("PAWS_BATCH_OPTIONS", "--no-textures").output().unwrap();
        assert!(done.status.success(), "{}", stderr(&done));
    };
    sbatch(&["--array=1-2"]);
    for part in ["journal-1-of-2.jsonl", "journal-2-of-2.jsonl"] {
        assert!(path.join("out").join(part).is_file(), "{part}");
    }
    // A part again makes nothing again.
    sbatch(&["--array=2-2", "2"]);
    let gathered = paws(&["batch", "m.csv", "--out", "out", "--no-textures"], path);
    assert!(stderr(&gathered).contains("3 of 3 recordings are finished already"), "{}", stderr(&gathered));
    assert_eq!(paws(&["batch", "m.csv", "--out", "whole", "--no-textures"], path).status.code(), Some(0));
    assert_eq!(tables(&path.join("out")), tables(&path.join("whole")));
}

/// A program for `--worker` that is a shell script.
#[cfg(unix)]
fn script(path: &Path, text: &str) {
    use std::os::unix::fs::PermissionsExt;
    std::fs::write(path, text).unwrap();
    std::fs::set_permissions(path, std::fs::Permissions::from_mode(0o755)).unwrap();
}

#[cfg(unix)]
#[test]
fn the_recordings_of_one_kitchen_go_to_one_process() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path();
    for folder in ["a", "b"] {
        std::fs::create_dir_all(path.join(folder)).unwrap();
    }
    script(&path.join("says"), "#!/bin/sh\necho \"error: $*\" >&2\nexit 2\n");
    std::fs::write(path.join("m.jsonl"), "{\"name\": \"k\", \"recordings\": [\"a\", \"b\"]}\n").unwrap();
    let worker = path.join("says");
    let worker = worker.to_str().unwrap();
    let out = paws(&["batch", "m.jsonl", "--out", "out", "--worker", worker, "--worker=-v"], path);
    assert_eq!(out.status.code(), Some(1), "{}", stderr(&out));
    let row = &rows(&path.join("out/results.csv"))["k"];
    assert_eq!(row[1], "a; b");
    assert_eq!(row[11], "-v twin --with-parent --out out/twins/k -- a b");
    let recordings = &journal(&path.join("out"))[0]["recordings"];
    assert_eq!(recordings.as_array().map(Vec::len), Some(2), "{recordings}");
}

#[cfg(unix)]
#[test]
fn a_process_that_does_not_end_costs_its_row_and_is_tried_again() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path();
    std::fs::create_dir_all(path.join("a")).unwrap();
    script(&path.join("sleeps"), "#!/bin/sh\nexec sleep 100\n");
    std::fs::write(path.join("m.csv"), "recording\na\n").unwrap();
    let worker = path.join("sleeps");
    let worker = worker.to_str().unwrap();
    for length in [1, 2] {
        let begun = std::time::Instant::now();
        let out = paws(&["batch", "m.csv", "--out", "out", "--worker", worker, "--time-limit", "1"], path);
        assert_eq!(out.status.code(), Some(1), "{}", stderr(&out));
        assert!(begun.elapsed() < Duration::from_secs(50));
        assert!(rows(&path.join("out/results.csv"))["a"][11].contains("longer than --time-limit 1"));
        assert_eq!(journal(&path.join("out")).len(), length);
    }
}

#[test]
fn what_is_no_manifest_or_no_output_is_an_error_before_anything_runs() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path();
    std::fs::create_dir_all(path.join("mine")).unwrap();
    std::fs::write(path.join("mine/file"), "").unwrap();
    std::fs::write(path.join("good.csv"), "recording\nnowhere\n").unwrap();
    std::fs::write(path.join("twice.csv"), "recording\na/x\nb/x\n").unwrap();
    for (manifest, out, words) in [
        ("absent.csv", "out", "absent.csv: no such file"),
        ("twice.csv", "out", "line 3: name \"x\" is that of line 2, too"),
        ("good.csv", "mine", "is no folder of a batch"),
    ] {
        let result = paws(&["batch", manifest, "--out", out], path);
        assert_eq!(result.status.code(), Some(2), "{}", stderr(&result));
        assert!(stderr(&result).contains(words), "{}", stderr(&result));
        assert!(!path.join("out").exists());
    }
}
