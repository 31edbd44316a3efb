//! Narrations as a table or as JSON: EPIC-KITCHENS, HD-EPIC (its pickle written as CSV or JSON lines), or anybody's.
//!
//! A table (`.csv`) has a header, JSON (`.jsonl`, `.json`) one object a narration; columns and keys have the names below. Times
//! are seconds or `HH:MM:SS.ff` from the video's start, frames the video's. EPIC-KITCHENS counts frames as its images are
//! numbered, `frame_0000000001` being the first.

use std::collections::BTreeMap;
use std::path::Path;

use serde_json::Value;

use crate::error::{Error, Result};
use crate::import::ImportOptions;
use crate::import::capture::{At, Capture, ClipAt};
use crate::import::names::{ending, head, seconds};
use crate::import::text::{Lines, TextTable};

const TEXT: [&str; 7] = ["narration", "text", "caption", "sentence", "description", "label", "action"];
const START: [&str; 8] =
    ["start_timestamp", "start", "start_time", "start_secs", "start_sec", "start_seconds", "begin", "onset"];
const END: [&str; 11] = [
    "end_timestamp",
    "stop_timestamp",
    "end",
    "stop",
    "end_time",
    "stop_time",
    "end_secs",
    "end_sec",
    "end_seconds",
    "stop_secs",
    "finish",
];
const START_FRAME: [&str; 1] = ["start_frame"];
const END_FRAME: [&str; 2] = ["end_frame", "stop_frame"];
const NAME: [&str; 5] = ["unique_narration_id", "narration_id", "clip", "id", "name"];
const VIDEO: [&str; 2] = ["video_id", "video"];
const VERB: [&str; 2] = ["verb", "verbs"];
const NOUN: [&str; 2] = ["noun", "nouns"];
/// Faults that are told one by one before the rest is counted.
const TOLD: usize = 3;

/// Cells of a narration by their names in lower case.
type NarrationCells = BTreeMap<String, String>;

pub(super) fn detect(path: &Path) -> bool {
    if is_pickle(path) {
        return true;
    }
    if !path.is_file() || !["csv", "json", "jsonl"].contains(&ending(path).as_str()) {
        return false;
    }
    let start = head(path, 4096).to_ascii_lowercase();
    let has = |names: &[&str]| names.iter().any(|name| has_word(&start, name));
    has(&TEXT) && ((has(&START) && has(&END)) || (has(&START_FRAME) && has(&END_FRAME)))
}

/// Whether a file is HD-EPIC's table as pandas keeps it. What reads a pickle runs what stands in it, so that is left to the user.
fn is_pickle(path: &Path) -> bool {
    path.is_file() && ["pkl", "pickle"].contains(&ending(path).as_str())
}

/// Whether a text holds a name that no letter, digit or underscore goes on with.
fn has_word(text: &str, name: &str) -> bool {
    let goes_on = |c: Option<char>| c.is_some_and(|c| c.is_ascii_alphanumeric() || c == '_');
    text.match_indices(name).any(|(at, _)| {
        let (before, after) = (text.get(..at).unwrap_or_default(), text.get(at + name.len()..).unwrap_or_default());
        !goes_on(before.chars().next_back()) && !goes_on(after.chars().next())
    })
}

pub(super) fn read(path: &Path, _options: &ImportOptions) -> Result<Capture> {
    if is_pickle(path) {
        let message = "is a pickle, which is not read; write it as JSON lines: python3 -c \"import pandas, sys; \
                       pandas.read_pickle(sys.argv[1]).to_json('narrations.jsonl', orient='records', lines=True)\" FILE.pkl";
        return Err(Error::Io { path: path.to_owned(), message: message.to_owned() });
    }
    let rows = if ending(path) == "csv" { table(path)? } else { objects(path)? };
    let mut capture = Capture {
        kind: "narrations".to_owned(),
        source: path.to_owned(),
        title: "narrations".to_owned(),
        ..Capture::default()
    };
    let mut faults = Vec::new();
    for (place, row) in &rows {
        match clip(row) {
            Ok(clip) => {
                capture.clips.push(clip);
                capture.clip_videos.push(cell(row, &VIDEO).to_owned());
            }
            Err(fault) => faults.push(format!("{place}: {fault}")),
        }
    }
    if capture.clips.is_empty() {
        let first = faults.first().cloned().unwrap_or_else(|| "there is none".to_owned());
        return Err(Error::format(path, "narrations", first));
    }
    capture.notes.extend(faults.iter().take(TOLD).map(|f| format!("left out, {f}")));
    if faults.len() > TOLD {
        capture.notes.push(format!("and {} more narrations left out", faults.len() - TOLD));
    }
    Ok(capture)
}

fn table(path: &Path) -> Result<Vec<(String, NarrationCells)>> {
    let mut table = TextTable::open(path)?;
    let known = [&TEXT[..], &START, &END, &START_FRAME, &END_FRAME, &NAME, &VIDEO, &VERB, &NOUN].concat();
    let known: Vec<&str> = known.into_iter().filter(|name| table.has(name)).collect();
    if !known.iter().any(|name| TEXT.contains(name)) {
        table.need(&TEXT[..1])?;
    }
    let has = |names: &[&str]| known.iter().any(|name| names.contains(name));
    if !(has(&START) && has(&END) || has(&START_FRAME) && has(&END_FRAME)) {
        let missing = if has(&START) { "end" } else { "start" };
        table.need(&[missing])?;
    }
    let mut out = Vec::new();
    while let Some(row) = table.row()? {
        let cells = known.iter().map(|name| ((*name).to_owned(), first_of_list(row.text(name)))).collect();
        out.push((format!("row {}", out.len() + 1), cells));
    }
    Ok(out)
}

/// One object a line, or a list of them, which may stand in an object.
fn objects(path: &Path) -> Result<Vec<(String, NarrationCells)>> {
    if ending(path) == "json" {
        let value: Value = crate::json::read(path)?;
        let list = match &value {
            Value::Object(object) => object.values().find_map(Value::as_array),
            other => other.as_array(),
        };
        let Some(list) = list else {
            return Err(Error::format(path, "the whole file", "holds no list of narrations"));
        };
        return Ok(list.iter().enumerate().map(|(i, v)| (format!("entry {}", i + 1), cells_of(v))).collect());
    }
    let mut lines = Lines::open(path)?;
    let mut out = Vec::new();
    let mut number = 0;
    while let Some(line) = lines.line()? {
        number += 1;
        if line.is_empty() {
            continue;
        }
        let value: Value = serde_json::from_str(&line)
            .map_err(|e| lines.fault(format!("is no JSON ({e}); one object a line is wanted")))?;
        out.push((format!("line {number}"), cells_of(&value)));
    }
    Ok(out)
}

fn cells_of(value: &Value) -> NarrationCells {
    let Some(object) = value.as_object() else { return NarrationCells::new() };
    object.iter().map(|(key, value)| (key.to_ascii_lowercase(), word(value))).collect()
}

/// A value as text; of a list its first value.
fn word(value: &Value) -> String {
    match value {
        Value::String(text) => text.trim().to_owned(),
        Value::Number(number) => number.to_string(),
        Value::Array(list) => list.first().map(word).unwrap_or_default(),
        _ => String::new(),
    }
}

/// A cell as it stands, or the first word of a list that Python wrote: `['open', 'pull']`.
fn first_of_list(cell: &str) -> String {
    let Some(list) = cell.strip_prefix(['[', '(']).and_then(|c| c.strip_suffix([']', ')'])) else {
        return cell.to_owned();
    };
    list.split(',').next().unwrap_or_default().trim().trim_matches(['\'', '"']).to_owned()
}

/// The first of several cells that is there and not empty; "" where none is.
fn cell<'a>(row: &'a NarrationCells, names: &[&str]) -> &'a str {
    names.iter().filter_map(|name| row.get(*name)).map(String::as_str).find(|text| !text.is_empty()).unwrap_or_default()
}

/// Where a narration begins or ends.
fn place(row: &NarrationCells, times: &[&str], frames: &[&str], what: &str) -> std::result::Result<At, String> {
    let (time, frame) = (cell(row, times), cell(row, frames));
    let mut at = At::default();
    if !time.is_empty() {
        at.time_secs = Some(seconds(time).ok_or_else(|| {
            let time: String = time.chars().take(40).collect();
            format!("{what}: \"{time}\" is no time; write seconds or HH:MM:SS.ff")
        })?);
    }
    // Tables that were saved as numbers with a point still count frames.
    if let Some(number) = frame.parse::<f64>().ok().filter(|n| n.fract() == 0.0 && (0.0..1e15).contains(n)) {
        let number = number as usize;
        at = at.with_index(number);
        at.name = Some(format!("frame_{number:010}"));
    } else if time.is_empty() {
        return Err(format!("has no {what}"));
    }
    Ok(at)
}

fn clip(row: &NarrationCells) -> std::result::Result<ClipAt, String> {
    let narration = cell(row, &TEXT);
    if narration.is_empty() {
        return Err("has no narration".to_owned());
    }
    Ok(ClipAt {
        name: cell(row, &NAME).to_owned(),
        start: place(row, &START, &START_FRAME, "start")?,
        end: place(row, &END, &END_FRAME, "end")?,
        narration: narration.to_owned(),
        verb: cell(row, &VERB).to_owned(),
        noun: cell(row, &NOUN).to_owned(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read_text(name: &str, text: &str) -> Result<Capture> {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join(name);
        std::fs::write(&path, text).unwrap();
        assert!(detect(&path), "{name}");
        read(&path, &ImportOptions::default())
    }

    #[test]
    fn the_same_narration_is_read_from_every_table() {
        let epic = "narration_id,video_id,start_timestamp,stop_timestamp,start_frame,stop_frame,narration,verb,noun,all_nouns\n\
                    P01_01_0,P01_01,00:00:01.50,00:00:03.00,90,180,\"open door, slowly\",open,door,\"['door']\"\n";
        let hd = "unique_narration_id,video_id,narration,start_timestamp,end_timestamp,nouns,verbs\n\
                  P01_01_0,P01_01,\"open door, slowly\",1.5,3.0,\"['door', 'handle']\",\"('open',)\"\n";
        let lines = "{\"unique_narration_id\": \"P01_01_0\", \"video_id\": \"P01_01\", \"narration\": \"open door, slowly\", \
                     \"start_timestamp\": 1.5, \"end_timestamp\": 3.0, \"nouns\": [\"door\"], \"verbs\": [\"open\"]}\n\n";
        let plain = "id;begin;end;text;verb;noun\nP01_01_0;1.5;3;open door, slowly;open;door\n";
        for (name, text) in [("e.csv", epic), ("h.csv", hd), ("h.jsonl", lines), ("p.csv", plain)] {
            let capture = read_text(name, text).unwrap();
            let [clip] = capture.clips.as_slice() else { panic!("{name}: {:?}", capture.clips) };
            assert_eq!((clip.start.time_secs, clip.end.time_secs), (Some(1.5), Some(3.0)), "{name}");
            assert_eq!(
                (clip.narration.as_str(), clip.verb.as_str(), clip.noun.as_str()),
                ("open door, slowly", "open", "door")
            );
            assert_eq!(clip.name, "P01_01_0", "{name}");
            assert_eq!(clip.start.index, (name == "e.csv").then_some(90));
        }
    }

    #[test]
    fn a_bad_row_costs_itself_and_a_bad_table_is_named() {
        let capture = read_text("a.csv", "start,end,narration\nsoon,2,open it\n1,2,close it\n1,inf,x\n").unwrap();
        assert_eq!(capture.clips.len(), 1);
        assert!(
            capture.notes.iter().any(|n| n.contains("row 1") && n.contains("\"soon\" is no time")),
            "{:?}",
            capture.notes
        );
        let error = read_text("a.csv", "start,end,narration\nnan,2,open it\n").unwrap_err().to_string();
        assert!(error.contains("a.csv") && error.contains("\"nan\" is no time"), "{error}");
        let error =
            read_text("a.jsonl", "{\"start\": 1, \"end\": 2, \"text\": \"x\"}\n{\"start\"\n").unwrap_err().to_string();
        assert!(error.contains("line 2") && error.contains("no JSON"), "{error}");
        let error = read_text("HD_EPIC_Narrations.pkl", "").unwrap_err().to_string();
        assert!(error.contains("JSON lines") && error.contains("read_pickle"), "{error}");
        let error = read_text("a.csv", "start,end,narration\n").unwrap_err().to_string();
        assert!(error.contains("there is none"), "{error}");
    }
}
