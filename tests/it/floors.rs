//! Data flows one way: a module uses only lower floors; two on one floor are strangers.

use std::collections::BTreeMap;
use std::path::Path;

const FLOORS: [&[&str]; 22] = [
    &["error"],
    &["json", "math"],
    &["articulation", "vlm"],
    &["config"],
    &["recording"],
    &["raster"],
    &["twin", "look", "import"],
    &["model"],
    &["hands", "synth"],
    &["localization"],
    &["geometry"],
    &["part"],
    &["reasoning"],
    &["inference"],
    &["pipeline"],
    &["fitting"],
    &["appearance", "export", "validation", "evaluation"],
    &["feedback", "primitives"],
    &["make"],
    &["report"],
    &["batch"],
    &["cli"],
];

fn uses(dir: &Path, module: &str, out: &mut Vec<(String, String)>) {
    for entry in std::fs::read_dir(dir).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_stem().unwrap().to_string_lossy().into_owned();
        let module = if module.is_empty() { name.clone() } else { module.to_owned() };
        if path.is_dir() {
            uses(&path, &module, out);
            continue;
        }
        let text = std::fs::read_to_string(&path).unwrap();
        // Comments may point anywhere.
        let code: Vec<&str> = text.lines().filter(|l| !l.trim_start().starts_with("//")).collect();
        let text = code.join("\n");
        for (i, _) in text.match_indices("crate::") {
            let rest = &text[i + "crate::".len()..];
            // `use crate::{a, b::c}` names several.
            let list = rest.strip_prefix('{').and_then(|r| r.split_once("};")).map_or(rest, |(inside, _)| inside);
            let parts: Vec<&str> = if rest.starts_with('{') { list.split(',').collect() } else { vec![rest] };
            for part in parts {
                let word: String = part.trim().chars().take_while(|c| c.is_ascii_alphanumeric() || *c == '_').collect();
                if !word.is_empty() {
                    out.push((module.clone(), word));
                }
            }
        }
    }
}

#[test]
fn modules_use_lower_floors_only() {
    let floor: BTreeMap<&str, usize> =
        FLOORS.iter().enumerate().flat_map(|(i, names)| names.iter().map(move |n| (*n, i))).collect();
    let mut all = Vec::new();
    uses(&Path::new(env!("CARGO_MANIFEST_DIR")).join("src"), "", &mut all);
    assert!(all.len() > 100, "the scan found next to nothing");
    for (module, used) in all {
        if ["lib", "main"].contains(&module.as_str()) || module == used {
            continue;
        }
        let (Some(here), Some(there)) = (floor.get(module.as_str()), floor.get(used.as_str())) else {
            panic!("{module} uses {used}: one of them stands on no floor; add it to FLOORS");
        };
        assert!(there < here, "{module} (floor {here}) uses {used} (floor {there})");
    }
}

#[test]
fn only_the_command_line_and_the_store_of_answers_write_files() {
    /// A file of tests, which its module takes in as such.
    fn is_test(path: &Path) -> bool {
        let Some(dir) = path.parent().filter(|_| path.file_name().is_some_and(|name| name == "tests.rs")) else {
            return false;
        };
        let taken_in =
            |file: &Path| std::fs::read_to_string(file).is_ok_and(|text| text.contains("#[cfg(test)]\nmod tests;"));
        taken_in(&dir.join("mod.rs")) || taken_in(&dir.with_extension("rs"))
    }
    fn scan(dir: &Path) {
        for entry in std::fs::read_dir(dir).unwrap() {
            let path = entry.unwrap().path();
            // An answer costs money: it is kept the moment it arrives, whatever becomes of the run.
            if path.ends_with("vlm/store.rs") || is_test(&path) {
                continue;
            }
            if path.is_dir() {
                if !path.ends_with("cli") {
                    scan(&path);
                }
                continue;
            }
            let text = std::fs::read_to_string(&path).unwrap();
            let code = text.split("#[cfg(test)]").next().unwrap();
            for word in ["fs::write", "File::create", "create_dir", "println!", "eprintln!"] {
                assert!(!code.contains(word), "{} has {word}", path.display());
            }
        }
    }
    scan(&Path::new(env!("CARGO_MANIFEST_DIR")).join("src"));
}

#[test]
fn one_place_asks_which_method_chooses_joints() {
    fn askers(dir: &Path, out: &mut Vec<String>) {
        for entry in std::fs::read_dir(dir).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                askers(&path, out);
                continue;
            }
            let text = std::fs::read_to_string(&path).unwrap();
            if text.split("#[cfg(test)]").next().unwrap().contains("InferenceMethod::") {
                out.push(path.to_string_lossy().replace('\\', "/"));
            }
        }
    }
    let src = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut found = Vec::new();
    askers(&src, &mut found);
    // The config says which it is; what it is asked for is what a `Method` answers.
    found.retain(|file| !file.ends_with("src/config.rs") && !file.contains("src/config/"));
    assert!(found.len() == 1 && found[0].ends_with("src/pipeline/method/mod.rs"), "{found:?}");
}
