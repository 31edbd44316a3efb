//! What of a batch is finished: lines of JSON, each written and flushed to the disk when its recording is.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

/// How a recording ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Status {
    /// Its twin is there, whole and without a refuted joint.
    Done,
    /// Its twin is there; a joint is refuted, none was found, or a part could not be done.
    No,
    /// There is no twin.
    Failed,
}

impl Status {
    /// The word of tables.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Done => "done",
            Self::No => "no",
            Self::Failed => "failed",
        }
    }
}

/// What a result was made of: another key is another result.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct JournalKey {
    /// The recordings' folders, as the system resolves them.
    pub recordings: Vec<String>,
    /// Hash of all parameters.
    pub config: String,
    /// Version of `paws`.
    pub version: String,
}

/// One finished recording.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct JournalEntry {
    /// Its name.
    pub name: String,
    /// What it was made of.
    #[serde(flatten)]
    pub key: JournalKey,
    /// How it ended.
    pub status: Status,
    /// Exit code; `None` where it was ended by a signal, or never begun.
    pub code: Option<i32>,
    /// Why there is no twin, or what is not right with it; empty where all is.
    pub reason: String,
    /// How long it took, seconds.
    pub secs: f64,
}

/// A journal as it was found.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Journal {
    /// Entries by name; of several the last.
    pub entries: BTreeMap<String, JournalEntry>,
    /// Bytes that are whole lines; what follows was cut off by the end of a run.
    pub whole_bytes: usize,
    /// Numbers of lines, from 1, that are no entries.
    pub unread: Vec<usize>,
}

/// Reads a journal. A line without an end was being written when the run ended, and does not count.
#[must_use]
pub fn parse(bytes: &[u8]) -> Journal {
    let whole_bytes = bytes.iter().rposition(|b| *b == b'\n').map_or(0, |last| last + 1);
    let mut journal = Journal { whole_bytes, ..Journal::default() };
    let whole = bytes.get(..whole_bytes).unwrap_or_default();
    for (i, line) in whole.split(|b| *b == b'\n').enumerate().filter(|(_, line)| !line.is_empty()) {
        match serde_json::from_slice::<JournalEntry>(line) {
            Ok(entry) => {
                journal.entries.insert(entry.name.clone(), entry);
            }
            Err(_) => journal.unread.push(i + 1),
        }
    }
    journal
}

/// An entry as a line, with its end.
///
/// # Errors
/// Where it cannot be written as JSON, which would be a bug.
pub fn line(entry: &JournalEntry) -> serde_json::Result<String> {
    serde_json::to_string(entry).map(|text| text + "\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn entry(name: &str, status: Status) -> JournalEntry {
        let key = JournalKey { recordings: vec!["/r".to_owned()], config: "c".to_owned(), version: "1".to_owned() };
        JournalEntry { name: name.to_owned(), key, status, code: Some(0), reason: "two\nlines".to_owned(), secs: 1.5 }
    }

    #[test]
    fn a_journal_cut_off_at_any_byte_keeps_its_whole_lines() {
        let entries = [entry("a", Status::Done), entry("b", Status::Failed), entry("a", Status::No)];
        let text: String = entries.iter().map(|e| line(e).unwrap()).collect();
        for cut in 0..=text.len() {
            let bytes = &text.as_bytes()[..cut];
            let journal = parse(bytes);
            assert!(journal.unread.is_empty(), "{cut}");
            let lines = bytes.iter().filter(|b| **b == b'\n').count();
            assert_eq!(journal.whole_bytes == cut, cut == 0 || bytes[cut - 1] == b'\n', "{cut}");
            assert_eq!(journal.entries.len(), lines.min(2), "{cut}");
        }
        let whole = parse(text.as_bytes());
        assert_eq!(whole.entries["a"], entries[2]);
        assert_eq!(whole.entries["b"], entries[1]);
    }

    #[test]
    fn a_line_that_is_no_entry_costs_itself() {
        let text =
            format!("{}junk\n{}", line(&entry("a", Status::Done)).unwrap(), line(&entry("b", Status::Done)).unwrap());
        let journal = parse(text.as_bytes());
        assert_eq!((journal.entries.len(), journal.unread), (2, vec![2]));
    }
}
