//! JSON files in and out: errors that name the file, the place and the way out.

mod place;
mod typed;

use std::fs::File;
use std::io::Read;
use std::path::Path;

use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::error::Category;

use crate::error::{Error, Result};

/// Text files above this are refused: hours of hands fit in it, and a broken export must not fill the memory.
const MAX_TEXT_BYTES: u64 = 1 << 30;

/// The text of a file, for readers that mend it before they parse it.
///
/// # Errors
/// Where it cannot be read or is no text.
pub(crate) fn read_text(path: &Path) -> Result<String> {
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
    let mut bytes = Vec::new();
    let read = file.take(MAX_TEXT_BYTES + 1).read_to_end(&mut bytes).map_err(|e| Error::io(path, &e))?;
    if read as u64 > MAX_TEXT_BYTES {
        return Err(Error::format(path, "size", "is above 1 GiB; split the recording"));
    }
    if let Some(what) = binary(&bytes) {
        return Err(Error::format(path, "first bytes", what));
    }
    // A byte order mark says nothing in UTF-8, and no JSON begins with one.
    if bytes.starts_with(b"\xef\xbb\xbf") {
        bytes.drain(..3);
    }
    String::from_utf8(bytes)
        .map_err(|e| Error::format(path, format!("byte {}", e.utf8_error().valid_up_to()), "is not UTF-8 text"))
}

/// How a pointer begins that stands for a file which was not fetched, and what to say of it.
pub(crate) const POINTER: (&[u8], &str) = (
    b"version https://git-lfs.github.com/spec/",
    "is a Git LFS pointer, not the file that it stands for; fetch it with git lfs pull",
);

/// What a file is that begins as no JSON does, and the way out.
fn binary(bytes: &[u8]) -> Option<&'static str> {
    match bytes {
        _ if bytes.starts_with(POINTER.0) => Some(POINTER.1),
        _ if bytes.starts_with(b"#ROSBAG V") => Some("is a ROS 1 bag; a JSON file is wanted"),
        [0x1f, 0x8b, ..] => Some("is compressed (gzip); unpack it first"),
        [0x28, 0xb5, 0x2f, 0xfd, ..] => Some("is compressed (zstd); unpack it first"),
        [b'B', b'Z', b'h', ..] => Some("is compressed (bzip2); unpack it first"),
        [0xfd, b'7', b'z', b'X', b'Z', ..] => Some("is compressed (xz); unpack it first"),
        [b'P', b'K', 3, 4, ..] => Some("is a zip archive; unpack it first"),
        // With a mark, or by the zero bytes of Latin letters.
        [0xff, 0xfe, ..] | [0xfe, 0xff, ..] | [0, 1..=0x7f, ..] | [1..=0x7f, 0, ..] => {
            Some("is UTF-16 text; save it as UTF-8")
        }
        _ => None,
    }
}

/// Reads and parses a file.
///
/// # Errors
/// With the place (the way through lists and keys, with the name of the joint, clip or frame; line and column of what is
/// no JSON), what was given and what is wanted.
pub fn read<T: DeserializeOwned>(path: &Path) -> Result<T> {
    let text = read_text(path)?;
    parse(&text, path)
}

/// Reads a value that was parsed already: for lists of which one bad entry costs only itself.
///
/// # Errors
/// The way from the value to what does not fit, what was given and what is wanted.
pub fn of_value<T: DeserializeOwned>(value: &serde_json::Value) -> std::result::Result<T, String> {
    match typed::explain::<T>(value) {
        Some((place, message)) if place == typed::WHOLE => Err(message),
        Some((place, message)) => Err(format!("{place}: {message}")),
        None => <T as serde::Deserialize<'_>>::deserialize(value).map_err(|e| e.to_string()),
    }
}

/// Parses a text that stands in a file, as [`read`] does.
///
/// # Errors
/// As [`read`].
pub(crate) fn parse<T: DeserializeOwned>(text: &str, path: &Path) -> Result<T> {
    let error = match serde_json::from_str(text) {
        Ok(value) => return Ok(value),
        Err(error) => error,
    };
    // JSON, but not what is wanted: the value tells better than the parser what stands where.
    match serde_json::from_str::<serde_json::Value>(text) {
        Ok(value) => match typed::explain::<T>(&value) {
            Some((place, message)) => Err(Error::format(path, place, message)),
            None => Err(no_json(text, path, &error)),
        },
        // What is no JSON further on is worse than what is not wanted.
        Err(worse) if error.classify() == Category::Data => Err(no_json(text, path, &worse)),
        Err(_) => Err(no_json(text, path, &error)),
    }
}

/// What is wrong with text that is no JSON.
fn no_json(text: &str, path: &Path, error: &serde_json::Error) -> Error {
    let offset: usize =
        text.split('\n').take(error.line().saturating_sub(1)).map(|l| l.len() + 1).sum::<usize>() + error.column();
    let place = match place::at(text, offset) {
        way if way.is_empty() => way,
        way => format!(", {way}"),
    };
    // The parser says the place too, behind its message.
    let said = error.to_string();
    let said = said.split(" at line ").next().unwrap_or(&said);
    let hint = match hint(text, offset, &place) {
        "" if said.starts_with("EOF") => "; the file is cut off",
        "" if said == "trailing characters" => "; one value a file is wanted, more follows",
        hint => hint,
    };
    Error::format(path, format!("line {}, column {}{place}", error.line(), error.column()), format!("{said}{hint}"))
}

/// The way out, where the text shows what its writer took for JSON.
fn hint(text: &str, offset: usize, place: &str) -> &'static str {
    let mut start = offset.saturating_sub(24).min(text.len());
    while !text.is_char_boundary(start) {
        start -= 1;
    }
    let mut end = offset.saturating_add(8).min(text.len());
    while !text.is_char_boundary(end) {
        end += 1;
    }
    let near = text.get(start..end).unwrap_or_default();
    let begins = text.trim_start();
    let here = near.get(offset.saturating_sub(1).saturating_sub(start)..).unwrap_or_default();
    if begins.is_empty() {
        "; the file is empty"
    } else if begins.starts_with('<') {
        "; this is XML or HTML, a JSON file is wanted"
    } else if near.contains("NaN") || near.contains("Infinity") {
        if place.contains("(frame ") || place.contains("frames[") {
            "; NaN and Infinity are not JSON: leave the frame out instead"
        } else {
            "; NaN and Infinity are not JSON: write a number, or leave the entry out"
        }
    } else if here.starts_with('/') || here.starts_with('#') {
        "; JSON has no comments: remove them"
    } else if here.starts_with('\'') {
        "; JSON takes double quotes (\")"
    } else if !begins.starts_with(['{', '[', '"']) {
        "; this is not JSON (is it YAML or TOML? write it as JSON)"
    } else if here.starts_with(['T', 'F', 'N']) {
        "; JSON writes true, false and null"
    } else {
        ""
    }
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

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::Value;

    #[test]
    fn what_a_file_really_is_is_said() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.json");
        let utf16: Vec<u8> = "\u{feff}{}".encode_utf16().flat_map(u16::to_le_bytes).collect();
        let cases: [(&[u8], &str); 15] = [
            (b"\x1f\x8b\x08\x00", "gzip"),
            (&utf16, "UTF-16"),
            (b"{\x00}\x00", "UTF-16"),
            (b"version https://git-lfs.github.com/spec/v1\noid sha256:0\n", "git lfs pull"),
            (b"#ROSBAG V2.0\n", "ROS 1 bag"),
            (b"<robot/>", "XML"),
            (b"scene: s\njoints: []\n", "YAML"),
            (b"// made by hand\n{}", "comments"),
            (b"{'a': 1}", "double quotes"),
            (b"{\"a\": [1, NaN]}", "line 1, column 11, a[1]: expected value; NaN"),
            (b"{\"a\": True}", "true, false"),
            (b"", "empty"),
            (b"{\"a\": [1, 2", "the file is cut off"),
            (b"{\"a\": 1}\n{\"a\": 2}\n", "line 2, column 1: trailing characters; one value a file"),
            (b"{\"a\": \"\xff\"}", "byte 7: is not UTF-8"),
        ];
        for (bytes, words) in cases {
            std::fs::write(&path, bytes).unwrap();
            let error = read::<Value>(&path).unwrap_err().to_string();
            assert!(error.contains(words) && error.contains("a.json"), "{words}: {error}");
        }
        std::fs::write(&path, b"\xef\xbb\xbf{\"a\": 1}").unwrap();
        assert_eq!(read::<Value>(&path).unwrap(), serde_json::json!({"a": 1}));
    }
}
