//! JSON files in and out: errors that name the file, the place and the way out.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::error::{Error, Result};

/// Text files above this are refused: hours of hands fit in it, and a broken export must not fill the memory.
const MAX_TEXT_BYTES: u64 = 1 << 30;

fn read_text(path: &Path) -> Result<String> {
    let file = File::open(path).map_err(|e| {
        let mut error = Error::io(path, &e);
        if let (Error::Io { message, .. }, Some(name)) = (&mut error, path.file_name()) {
            *message += match name.to_str() {
                Some("cameras.json") => "; a recording needs intrinsics and a pose per frame there",
                Some("clips.json") => "; a recording needs its narrated segments there",
                _ => "",
            };
        }
        error
    })?;
    let mut text = String::new();
    let read = file
        .take(MAX_TEXT_BYTES + 1)
        .read_to_string(&mut text)
        .map_err(|e| Error::format(path, "text", format!("is not UTF-8 text ({e})")))?;
    if read as u64 > MAX_TEXT_BYTES {
        return Err(Error::format(path, "size", "is above 1 GiB; split the recording"));
    }
    Ok(text)
}

/// Reads and parses a file; an error says line, column, the frame it stands in, and what NaN means there.
pub fn read<T: DeserializeOwned>(path: &Path) -> Result<T> {
    let text = read_text(path)?;
    serde_json::from_str(&text).map_err(|e| {
        let offset: usize =
            text.lines().take(e.line().saturating_sub(1)).map(|l| l.len() + 1).sum::<usize>() + e.column();
        let mut start = offset.saturating_sub(24).min(text.len());
        while !text.is_char_boundary(start) {
            start -= 1;
        }
        let mut end = (offset + 8).min(text.len());
        while !text.is_char_boundary(end) {
            end += 1;
        }
        let near = &text[start..end];
        let hint = if near.contains("NaN") || near.contains("Infinity") {
            "; NaN and Infinity are not JSON: leave the frame out instead"
        } else {
            ""
        };
        let frame = text[..end].rfind("\"frame\":").map_or(String::new(), |at| {
            let digits: String = text[at + 8..].trim_start().chars().take_while(char::is_ascii_digit).collect();
            format!(", frame {digits}")
        });
        // The parser says the place too, behind its message.
        let said = e.to_string();
        let message = said.split(" at line ").next().unwrap_or(&said);
        Error::format(path, format!("line {}, column {}{frame}", e.line(), e.column()), format!("{message}{hint}"))
    })
}

/// Pretty JSON with a final newline.
///
/// # Errors
/// Where a value cannot be written as JSON.
pub fn text<T: Serialize>(value: &T) -> Result<String> {
    let mut text =
        serde_json::to_string_pretty(value).map_err(|e| Error::Export(format!("cannot be written as JSON: {e}")))?;
    text.push('\n');
    Ok(text)
}
