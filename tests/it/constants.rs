//! Numbers that can be chosen stand in the config or in the priors; a number that stands in code says why.

use std::path::{Path, PathBuf};

/// The folders and files of `src` that this is asked of.
const PLACES: [&str; 13] = [
    "export",
    "feedback",
    "fitting",
    "geometry",
    "hands",
    "inference",
    "localization",
    "part",
    "pipeline",
    "primitives",
    "reasoning",
    "twin.rs",
    "validation",
];

/// With what the comment above a number begins that is not chosen: it follows from geometry or arithmetic, a format, a file's
/// limits or a published definition has it, or it only says how finely something is computed.
const KINDS: [&str; 5] = ["Geometry", "Arithmetic", "Format", "Numerics", "Definition"];

/// Decimal fractions other than halves and quarters that may stand within code. They are class boundaries of angles, rounding,
/// quantiles, colours; the number may fall.
const FRACTIONS: usize = 59;

fn files(dir: &Path, out: &mut Vec<PathBuf>) {
    let mut entries: Vec<PathBuf> = std::fs::read_dir(dir).unwrap().map(|e| e.unwrap().path()).collect();
    entries.sort();
    for path in entries {
        if path.is_dir() {
            files(&path, out);
        } else if path.extension().is_some_and(|e| e == "rs") && !path.ends_with("tests.rs") {
            out.push(path);
        }
    }
}

/// A file of `src`, or the files of a folder, each with its code without the tests at its end.
fn code(place: &str) -> Vec<(String, String)> {
    let src = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut all = Vec::new();
    match src.join(place) {
        folder if folder.is_dir() => files(&folder, &mut all),
        file => all.push(file),
    }
    let name = |path: &Path| path.strip_prefix(&src).unwrap().to_string_lossy().replace('\\', "/");
    let of = |path: &PathBuf| {
        let text = std::fs::read_to_string(path).unwrap();
        let tests = ["#[cfg(test)]\nmod ", "#[cfg(test)]\npub(super) mod "];
        let end = tests.iter().filter_map(|start| text.find(start)).min().unwrap_or(text.len());
        (name(path), text[..end].to_owned())
    };
    all.iter().map(of).collect()
}

/// The same of all places that this is asked of.
fn asked() -> Vec<(String, String)> {
    PLACES.iter().flat_map(|place| code(place)).collect()
}

/// The name of a constant that a line declares, if it is a number or an array of numbers.
fn number(line: &str) -> Option<&str> {
    let line = line.trim_start();
    let line = line.strip_prefix("pub").map_or(line, |rest| rest.trim_start_matches(|c| c != ' ').trim_start());
    let (name, rest) = line.strip_prefix("const ")?.split_once(": ")?;
    let (ty, _) = rest.split_once(" = ")?;
    let mut words = ty.split(|c: char| !c.is_alphanumeric() && c != '_').filter(|word| !word.is_empty());
    let numeric = |word: &str| {
        word.parse::<usize>().is_ok()
            || ["f32", "f64", "u8", "u16", "u32", "u64", "usize", "i32", "i64"].contains(&word)
    };
    words.all(numeric).then_some(name).filter(|_| !ty.contains('&'))
}

/// Numbers whose comment does not begin with a kind, as "file NAME".
fn chosen(file: &str, code: &str) -> Vec<String> {
    let lines: Vec<&str> = code.lines().collect();
    let mut out = Vec::new();
    for (i, line) in lines.iter().enumerate() {
        let Some(name) = number(line) else { continue };
        let above = lines[..i].iter().rev().take_while(|l| l.trim_start().starts_with("///"));
        let first = above.last().map_or("", |l| l.trim_start().trim_start_matches('/').trim_start());
        if !KINDS.iter().any(|kind| first.starts_with(kind)) {
            out.push(format!("{file} {name}"));
        }
    }
    out
}

#[test]
fn a_number_that_stands_in_code_says_why_it_is_not_chosen() {
    let files = asked();
    assert!(files.len() > 50, "the scan found next to nothing");
    let found: Vec<String> = files.iter().flat_map(|(name, code)| chosen(name, code)).collect();
    assert!(
        found.is_empty(),
        "{found:?}: a number that can be chosen belongs into src/config, or into assets/priors.toml where it says how furniture \
         usually is; of another one the comment begins with one of {KINDS:?}"
    );
}

/// Decimal fractions in a line of code that are no halves or quarters: "0.3", not "1.0", "0.25", "x.0".
fn fractions(line: &str) -> usize {
    let code = line.split("//").next().unwrap_or_default();
    // What stands between quotes is text.
    let outside: String = code.split('"').step_by(2).collect::<Vec<_>>().join(" ");
    let is_part = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '.';
    let words = outside.split(|c: char| !is_part(c));
    let value = |word: &str| {
        let digits = word.trim_end_matches("f64").trim_end_matches("f32");
        let decimal = digits.split_once('.').is_some_and(|(a, b)| !a.is_empty() && !b.is_empty());
        digits.parse::<f64>().ok().filter(|_| decimal)
    };
    words.filter_map(value).filter(|v| (4.0 * v).fract() != 0.0).count()
}

#[test]
fn fractions_within_code_grow_no_more() {
    let in_code = |code: &str| code.lines().filter(|l| number(l).is_none()).map(fractions).sum::<usize>();
    let found: usize = asked().iter().map(|(_, code)| in_code(code)).sum();
    assert!(found <= FRACTIONS, "{found} fractions within code, {FRACTIONS} at the most");
}

#[test]
fn the_scan_sees_what_it_is_asked_for() {
    let text = "/// How far.\nconst FAR_M: f64 = 2.0;\n    /// Geometry: a quarter.\n    pub(super) const Q: [f64; 2] = [0.25; 2];\n\
                const NAME: &str = \"x\";\nconst BARE: usize = 3;\n";
    assert_eq!(chosen("a.rs", text), ["a.rs FAR_M", "a.rs BARE"]);
    assert_eq!(fractions("let x = 0.3 * y.0 + 1.0 - 0.25 + f(\"0.7\"); // 0.9"), 1);
    assert_eq!([fractions("0.94f64.acos()"), fractions("let [a, b] = [0.05, 0.95];")], [0, 2]);
}
