//! Which recordings a batch is about: a table (CSV) or JSON lines, with columns or keys `recording`, `name`, `config`.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::Deserialize;

use crate::error::{Error, Result};
use crate::import::text::{Lines, Table};

/// The longest name, bytes: with what is put around it, a file's name stays below the 255 of most file systems.
const MAX_NAME_BYTES: usize = 200;

/// A recording of a batch.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Row {
    /// Number of its line in the manifest, from 1.
    pub line: usize,
    /// Name of its twin's folder, unique in the manifest; the recording's where the manifest has none.
    pub name: String,
    /// The recording as the manifest has it.
    pub given: String,
    /// The recording's folder.
    pub recording: PathBuf,
    /// Its parameters: a word, or a file beside the manifest; `None`: those of the batch.
    pub config: Option<PathBuf>,
}

/// A line of JSON.
#[derive(Deserialize)]
struct Line {
    recording: String,
    #[serde(default)]
    name: Option<String>,
    #[serde(default)]
    config: Option<String>,
}

/// Reads a manifest; paths in it count from its folder. Columns and keys that are not known are passed over.
///
/// # Errors
/// With the first line that is no row, and where names are missing, not usable as folders, or given twice: all of them.
pub fn read(path: &Path) -> Result<Vec<Row>> {
    let rows = match path.extension().map(|e| e.to_ascii_lowercase()) {
        Some(end) if end == "jsonl" || end == "ndjson" => json_lines(path),
        Some(end) if end == "csv" => table(path),
        Some(end) if end == "parquet" => Err(Error::format(
            path,
            "file",
            "Parquet is not read; write CSV or JSON lines of it, by polars: \
             pl.read_parquet(FILE).select(\"name\", \"recording\").write_csv(\"manifest.csv\")",
        )),
        _ => Err(Error::format(path, "file", "its name says no format; a manifest is a .csv or .jsonl file")),
    }?;
    if rows.is_empty() {
        return Err(Error::format(path, "rows", "there are none; a row names a recording"));
    }
    let faults = faults(&rows);
    match faults.is_empty() {
        true => Ok(rows),
        false => {
            Err(Error::format(path, "names", format!("the manifest cannot be used:\n  - {}", faults.join("\n  - "))))
        }
    }
}

fn table(path: &Path) -> Result<Vec<Row>> {
    let mut table = Table::open(path)?;
    table.need(&["recording"])?;
    let mut rows = Vec::new();
    while let Some((row, cells)) = next(&mut table)? {
        let [recording, name, config] = cells;
        rows.push(entry(path, row, recording, Some(name), Some(config)));
    }
    Ok(rows)
}

/// The next row of a table: the number of its line, recording, name and config.
fn next(table: &mut Table) -> Result<Option<(usize, [String; 3])>> {
    let Some(row) = table.row()? else { return Ok(None) };
    let cells = ["recording", "name", "config"].map(|column| row.text(column).trim().to_owned());
    Ok(Some((row.line(), cells)))
}

fn json_lines(path: &Path) -> Result<Vec<Row>> {
    let mut lines = Lines::open(path)?;
    let mut rows = Vec::new();
    while let Some(text) = lines.content()? {
        let line: Line = serde_json::from_str(&text).map_err(|e| {
            lines.fault(format!(
                "{e}; a line is {{\"name\": \"...\", \"recording\": \"FOLDER\"}} with \"config\" if need be"
            ))
        })?;
        rows.push(entry(path, lines.last(), line.recording, line.name, line.config));
    }
    Ok(rows)
}

/// A row; what is empty counts as left out.
fn entry(path: &Path, line: usize, given: String, name: Option<String>, config: Option<String>) -> Row {
    let beside = path.parent().unwrap_or(Path::new("."));
    let recording = beside.join(&given);
    let own = || recording.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
    let name = name.filter(|n| !n.is_empty()).unwrap_or_else(own);
    let config = config.filter(|c| !c.is_empty()).map(|config| match config.as_str() {
        "paper" | "paper_s" => PathBuf::from(&config),
        file => beside.join(file),
    });
    Row { line, name, given, recording, config }
}

/// What is wrong with the names of rows.
fn faults(rows: &[Row]) -> Vec<String> {
    let mut seen: BTreeMap<String, usize> = BTreeMap::new();
    let mut faults = Vec::new();
    for row in rows {
        if row.given.is_empty() {
            faults.push(format!("line {}: no recording", row.line));
            continue;
        }
        if let Some(why) = unusable(&row.name) {
            faults.push(format!("line {}: name \"{}\": {why}", row.line, row.name));
        }
        // Some file systems do not tell small from capital letters.
        if let Some(first) = seen.insert(row.name.to_lowercase(), row.line) {
            faults.push(format!(
                "line {}: name \"{}\" is that of line {first}, too; write a column \"name\" with a name for each",
                row.line, row.name
            ));
        }
    }
    faults
}

/// Why a name cannot be that of a folder everywhere.
fn unusable(name: &str) -> Option<&'static str> {
    let is_plain = |c: char| c.is_alphanumeric() || matches!(c, '_' | '-' | '.' | ' ' | '+' | '=' | '@');
    if name.is_empty() {
        Some("is empty; write one")
    } else if name.len() > MAX_NAME_BYTES {
        Some("is longer than 200 bytes")
    } else if name.starts_with(['.', ' ', '-']) || name.ends_with(['.', ' ']) || !name.chars().all(is_plain) {
        Some("cannot be a folder's everywhere; take letters, digits, _ and -")
    } else {
        None
    }
}

/// Why each row cannot be run: its recording is not there, is one of an earlier row with the same parameters, lies within
/// another one's, or holds the output. `out` is the output's folder as the system resolves it.
#[must_use]
pub fn unfit(rows: &[Row], out: Option<&Path>) -> Vec<Option<String>> {
    let resolved: Vec<Option<PathBuf>> =
        rows.iter().map(|row| row.recording.canonicalize().ok().filter(|p| p.is_dir())).collect();
    let mut first_of: BTreeMap<(&Path, Option<&Path>), &Row> = BTreeMap::new();
    let mut any_of: BTreeMap<&Path, &Row> = BTreeMap::new();
    for (row, path) in rows.iter().zip(&resolved) {
        if let Some(path) = path {
            first_of.entry((path.as_path(), row.config.as_deref())).or_insert(row);
            any_of.entry(path.as_path()).or_insert(row);
        }
    }
    rows.iter()
        .zip(&resolved)
        .map(|(row, path)| {
            let shown = row.recording.display();
            let Some(path) = path else {
                let what = if row.recording.exists() { "is no folder" } else { "no such folder" };
                return Some(format!("{shown}: {what}"));
            };
            let first = first_of.get(&(path.as_path(), row.config.as_deref())).filter(|first| first.line != row.line);
            let outer = path.ancestors().skip(1).find_map(|above| any_of.get(above));
            if let Some(first) = first {
                Some(format!("{shown}: is the recording of {} (line {}), too", first.name, first.line))
            } else if let Some(outer) = outer {
                Some(format!(
                    "{shown}: lies within the recording of {} (line {}); give one of them",
                    outer.name, outer.line
                ))
            } else if out.is_some_and(|out| out.starts_with(path)) {
                Some(format!("{shown}: the output would lie within it; choose another --out"))
            } else {
                None
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(name: &str, text: &str) -> Result<Vec<Row>> {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join(name);
        std::fs::write(&path, text).unwrap();
        read(&path).map(|mut rows| {
            for row in &mut rows {
                row.recording = row.recording.strip_prefix(dir.path()).unwrap().to_owned();
            }
            rows
        })
    }

    #[test]
    fn tables_and_lines_say_the_same() {
        let table = of("m.csv", "Name,recording,config,note\na,x/one,,\"hi, you\"\n,x/two,paper,\n").unwrap();
        let lines = of(
            "m.jsonl",
            "{\"recording\": \"x/one\", \"name\": \"a\", \"note\": 1}\n{\"recording\": \"x/two\", \"config\": \"paper\"}\n",
        )
        .unwrap();
        let told = |rows: &[Row]| -> Vec<(String, String, PathBuf, Option<PathBuf>)> {
            rows.iter().map(|r| (r.name.clone(), r.given.clone(), r.recording.clone(), r.config.clone())).collect()
        };
        assert_eq!(told(&table), told(&lines));
        assert_eq!(table[1].name, "two");
        assert_eq!((table[0].line, table[1].line), (2, 3));
        assert_eq!((&table[0].config, &table[1].config), (&None, &Some("paper".into())));
    }

    #[test]
    fn what_is_no_manifest_is_told_with_its_place() {
        for (name, text, words) in [
            ("m.csv", "", "line 1: the file is empty"),
            ("m.csv", "recording\n", "there are none"),
            ("m.csv", "name,folder\na,b\n", "no column \"recording\""),
            ("m.csv", "name,recording\na,b\nc\n", "line 3: 1 cells, the header has 2"),
            ("m.csv", "name,recording\na,b\nA,c\n", "line 3: name \"A\" is that of line 2, too"),
            ("m.csv", "name,recording\n../a,b\n", "line 2: name \"../a\": cannot be a folder's everywhere"),
            ("m.csv", "name,recording\na,\n", "line 2: no recording"),
            ("m.jsonl", "{\"recording\": \"a\"}\n{\"name\": \"b\"}\n", "line 2: missing field `recording`"),
            ("m.parquet", "PAR1", "Parquet is not read"),
            ("m.dat", "x", "its name says no format"),
        ] {
            let error = of(name, text).unwrap_err().to_string();
            assert!(error.contains(words), "{text}: {error}");
        }
    }

    #[test]
    fn recordings_that_are_missing_given_twice_or_nested_are_no_rows_to_run() {
        let dir = tempfile::tempdir().unwrap();
        std::fs::create_dir_all(dir.path().join("a/inner")).unwrap();
        std::fs::create_dir_all(dir.path().join("b/out")).unwrap();
        std::fs::write(dir.path().join("file"), "").unwrap();
        let path = dir.path().join("m.csv");
        let text = "name,recording,config\n1,a,\n2,./a/../a,\n3,a,paper\n4,a/inner,\n5,nowhere,\n6,file,\n7,b,\n";
        std::fs::write(&path, text).unwrap();
        let out = dir.path().join("b/out").canonicalize().unwrap();
        let why = unfit(&read(&path).unwrap(), Some(&out));
        let has = |row: usize, words: &str| why[row].as_ref().is_some_and(|w| w.contains(words));
        assert!(why[0].is_none() && why[2].is_none(), "{why:?}");
        assert!(has(1, "is the recording of 1 (line 2), too"), "{why:?}");
        assert!(has(3, "lies within the recording of 1 (line 2)"), "{why:?}");
        assert!(has(4, "no such folder") && has(5, "is no folder") && has(6, "the output would lie within"), "{why:?}");
    }
}
