//! Which recordings a batch is about: a table (CSV) or JSON lines, with columns or keys `recording`, `name`, `config`; JSON
//! lines may have `recordings` instead, several visits of one kitchen.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::Deserialize;

use crate::error::{Error, Result};
use crate::import::text::{Lines, TextTable};

/// The longest name, bytes: with what is put around it, a file's name stays below the 255 of most file systems.
const MAX_NAME_BYTES: usize = 200;

/// A twin of a batch: of one recording, or of several of one kitchen.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ManifestRow {
    /// Number of its line in the manifest, from 1.
    pub line: usize,
    /// Name of its twin's folder, unique in the manifest; the first recording's where the manifest has none.
    pub name: String,
    /// The recordings as the manifest has them.
    pub given: Vec<String>,
    /// The recordings' folders.
    pub recordings: Vec<PathBuf>,
    /// Its parameters: a word, or a file beside the manifest; `None`: those of the batch.
    pub config: Option<PathBuf>,
}

/// A line of JSON.
#[derive(Deserialize)]
#[serde(expecting = "an object")]
struct ManifestLine {
    #[serde(default)]
    recording: Option<String>,
    #[serde(default)]
    recordings: Option<Vec<String>>,
    #[serde(default)]
    name: Option<String>,
    #[serde(default)]
    config: Option<String>,
}

/// What a line of JSON looks like.
const LINE: &str = "a line is {\"name\": \"...\", \"recording\": \"FOLDER\"} with \"config\" if need be, or with \
                    \"recordings\": [\"FOLDER\", ...] for one kitchen";

/// Reads a manifest; paths in it count from `root`, or from its own folder. Columns and keys that are not known are passed over.
///
/// # Errors
/// With the first line that is no row, and where names are missing, not usable as folders, or given twice: all of them.
pub fn read(path: &Path, root: Option<&Path>) -> Result<Vec<ManifestRow>> {
    let root = root.or_else(|| path.parent()).unwrap_or(Path::new("."));
    let rows = match path.extension().map(|e| e.to_ascii_lowercase()) {
        Some(end) if end == "jsonl" || end == "ndjson" => json_lines(path, root),
        Some(end) if end == "csv" => table(path, root),
        Some(end) if end == "parquet" => Err(Error::format(
            path,
            "file",
            "Parquet is not read; the Python module does (paws_twin.batch.run), or write CSV or JSON lines of it, by polars: \
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

fn table(path: &Path, root: &Path) -> Result<Vec<ManifestRow>> {
    let mut table = TextTable::open(path)?;
    if table.has("recordings") {
        let why = "a table has one \"recording\" a row; lists are for JSON lines (.jsonl)";
        return Err(Error::format(path, "column \"recordings\"", why));
    }
    table.need(&["recording"])?;
    let mut rows = Vec::new();
    while let Some((row, cells)) = next(&mut table)? {
        let [recording, name, config] = cells;
        rows.push(entry(root, row, vec![recording], Some(name), Some(config)));
    }
    Ok(rows)
}

/// The next row of a table: the number of its line, recording, name and config.
fn next(table: &mut TextTable) -> Result<Option<(usize, [String; 3])>> {
    let Some(row) = table.row()? else { return Ok(None) };
    let cells = ["recording", "name", "config"].map(|column| row.text(column).trim().to_owned());
    Ok(Some((row.line(), cells)))
}

fn json_lines(path: &Path, root: &Path) -> Result<Vec<ManifestRow>> {
    let mut lines = Lines::open(path)?;
    let mut rows = Vec::new();
    while let Some(text) = lines.content()? {
        let line: ManifestLine = serde_json::from_str(&text).map_err(|e| lines.fault(format!("{e}; {LINE}")))?;
        let given = match (line.recording, line.recordings) {
            (Some(one), None) => vec![one],
            (None, Some(several)) => several,
            (None, None) => return Err(lines.fault(format!("missing field `recording`; {LINE}"))),
            (Some(_), Some(_)) => {
                return Err(lines.fault(format!("both `recording` and `recordings`; {LINE}")));
            }
        };
        rows.push(entry(root, lines.last(), given, line.name, line.config));
    }
    Ok(rows)
}

/// A row; what is empty counts as left out.
fn entry(root: &Path, line: usize, given: Vec<String>, name: Option<String>, config: Option<String>) -> ManifestRow {
    let recordings: Vec<PathBuf> = given.iter().map(|one| root.join(one)).collect();
    let first = recordings.first().and_then(|r| r.file_name());
    let own = || first.map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
    let name = name.filter(|n| !n.is_empty()).unwrap_or_else(own);
    let config = config.filter(|c| !c.is_empty()).map(|config| match config.as_str() {
        "paper" | "paper_s" => PathBuf::from(&config),
        file => root.join(file),
    });
    ManifestRow { line, name, given, recordings, config }
}

/// What is wrong with the names of rows.
fn faults(rows: &[ManifestRow]) -> Vec<String> {
    let mut seen: BTreeMap<String, usize> = BTreeMap::new();
    let mut faults = Vec::new();
    for row in rows {
        if row.given.is_empty() || row.given.iter().any(String::is_empty) {
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

/// Why each row cannot be run: a recording is not there, is given twice, is one of an earlier row with the same parameters, lies
/// within another one's, or holds the output. `out` is the output's folder as the system resolves it.
#[must_use]
pub fn unfit(rows: &[ManifestRow], out: Option<&Path>) -> Vec<Option<String>> {
    let folders: Vec<Vec<Option<PathBuf>>> = rows
        .iter()
        .map(|row| row.recordings.iter().map(|r| r.canonicalize().ok().filter(|p| p.is_dir())).collect())
        .collect();
    // Of rows all of whose recordings are there.
    let whole: Vec<Option<Vec<&Path>>> = folders.iter().map(|own| own.iter().map(Option::as_deref).collect()).collect();
    let mut first_of: BTreeMap<(&[&Path], Option<&Path>), &ManifestRow> = BTreeMap::new();
    let mut any_of: BTreeMap<&Path, &ManifestRow> = BTreeMap::new();
    for ((row, own), whole) in rows.iter().zip(&folders).zip(&whole) {
        if let Some(whole) = whole {
            first_of.entry((whole.as_slice(), row.config.as_deref())).or_insert(row);
        }
        for path in own.iter().flatten() {
            any_of.entry(path.as_path()).or_insert(row);
        }
    }
    rows.iter()
        .zip(&folders)
        .zip(&whole)
        .map(|((row, own), whole)| {
            let Some(whole) = whole.as_deref() else { return absent(row, own) };
            let same = first_of.get(&(whole, row.config.as_deref())).filter(|first| first.line != row.line);
            match same {
                Some(first) => {
                    let shown = row.recordings.first().map(|r| r.display().to_string()).unwrap_or_default();
                    Some(format!("{shown}: is the recording of {} (line {}), too", first.name, first.line))
                }
                None => misplaced(row, whole, &any_of, out),
            }
        })
        .collect()
}

/// The first recording of a row that is not there; `folders` are those that are.
fn absent(row: &ManifestRow, folders: &[Option<PathBuf>]) -> Option<String> {
    let (missing, _) = row.recordings.iter().zip(folders).find(|(_, folder)| folder.is_none())?;
    let what = if missing.exists() { "is no folder" } else { "no such folder" };
    Some(format!("{}: {what}", missing.display()))
}

/// The first recording of a row that lies where it cannot be used. `folders` are those of the row, `any_of` the first row of each
/// folder of the manifest, `out` the output's folder, all resolved.
fn misplaced(
    row: &ManifestRow,
    folders: &[&Path],
    any_of: &BTreeMap<&Path, &ManifestRow>,
    out: Option<&Path>,
) -> Option<String> {
    row.recordings.iter().zip(folders).enumerate().find_map(|(i, (given, folder))| {
        let shown = given.display();
        let outer = folder.ancestors().skip(1).find_map(|above| any_of.get(above));
        if folders.iter().take(i).any(|earlier| earlier == folder) {
            Some(format!("{shown}: is given twice in one row"))
        } else if let Some(outer) = outer {
            Some(format!(
                "{shown}: lies within the recording of {} (line {}); give one of them",
                outer.name, outer.line
            ))
        } else if out.is_some_and(|out| out.starts_with(folder)) {
            Some(format!("{shown}: the output would lie within it; choose another --out"))
        } else {
            None
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(name: &str, text: &str) -> Result<Vec<ManifestRow>> {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join(name);
        std::fs::write(&path, text).unwrap();
        read(&path, None).map(|mut rows| {
            for recording in rows.iter_mut().flat_map(|row| &mut row.recordings) {
                *recording = recording.strip_prefix(dir.path()).unwrap().to_owned();
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
        let told = |r: &ManifestRow| (r.name.clone(), r.given.clone(), r.recordings.clone(), r.config.clone());
        assert_eq!(table.iter().map(told).collect::<Vec<_>>(), lines.iter().map(told).collect::<Vec<_>>());
        assert_eq!(table[1].name, "two");
        assert_eq!((table[0].line, table[1].line), (2, 3));
        assert_eq!((&table[0].config, &table[1].config), (&None, &Some("paper".into())));
    }

    #[test]
    fn one_kitchen_may_have_several_recordings_and_paths_may_count_from_elsewhere() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("m.jsonl");
        let text = "{\"name\": \"k\", \"recordings\": [\"a\", \"b\"]}\n{\"recordings\": [\"b\", \"c\"], \"config\": \"c.toml\"}\n";
        std::fs::write(&path, text).unwrap();
        let rows = read(&path, Some(Path::new("/data"))).unwrap();
        assert_eq!(rows[0].recordings, [Path::new("/data/a"), Path::new("/data/b")]);
        assert_eq!((rows[1].name.as_str(), rows[1].config.as_deref()), ("b", Some(Path::new("/data/c.toml"))));
        for folder in ["a", "b"] {
            std::fs::create_dir_all(dir.path().join(folder)).unwrap();
        }
        // A recording may be alone in one row and with others in the next.
        let text = "{\"name\": \"1\", \"recordings\": [\"a\", \"b\"]}\n{\"name\": \"2\", \"recording\": \"a\"}\n\
                    {\"name\": \"3\", \"recordings\": [\"a\", \"./a\"]}\n{\"name\": \"4\", \"recordings\": [\"a\", \"c\"]}\n\
                    {\"name\": \"5\", \"recordings\": [\"./a\", \"b\"]}\n";
        std::fs::write(&path, text).unwrap();
        let why = unfit(&read(&path, None).unwrap(), None);
        let has = |row: usize, words: &str| why[row].as_ref().is_some_and(|w| w.contains(words));
        assert!(why[0].is_none() && why[1].is_none(), "{why:?}");
        assert!(has(2, "is given twice in one row") && has(3, "no such folder"), "{why:?}");
        assert!(has(4, "is the recording of 1 (line 1), too"), "{why:?}");
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
            ("m.jsonl", "{\"recordings\": []}\n", "line 1: no recording"),
            ("m.jsonl", "{\"recording\": \"a\", \"recordings\": [\"b\"]}\n", "line 1: both `recording`"),
            ("m.csv", "name,recordings\na,b\n", "lists are for JSON lines"),
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
        let why = unfit(&read(&path, None).unwrap(), Some(&out));
        let has = |row: usize, words: &str| why[row].as_ref().is_some_and(|w| w.contains(words));
        assert!(why[0].is_none() && why[2].is_none(), "{why:?}");
        assert!(has(1, "is the recording of 1 (line 2), too"), "{why:?}");
        assert!(has(3, "lies within the recording of 1 (line 2)"), "{why:?}");
        assert!(has(4, "no such folder") && has(5, "is no folder") && has(6, "the output would lie within"), "{why:?}");
    }
}
