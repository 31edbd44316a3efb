//! What names of files tell: stems, numbers, times; and first looks into files.

use std::fs::File;
use std::io::Read;
use std::path::Path;

/// The file's name without its folder and ending; empty where there is none.
#[must_use]
pub fn stem(path: &Path) -> String {
    path.file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default()
}

/// The last part of a path.
#[must_use]
pub fn last(path: &Path) -> String {
    path.file_name().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default()
}

/// The ending in lower case.
#[must_use]
pub fn ending(path: &Path) -> String {
    path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase()).unwrap_or_default()
}

/// A name as what stands before the digits at its end, and their number; `None` without such digits.
#[must_use]
pub fn numbered(name: &str) -> Option<(&str, u64)> {
    let head = name.trim_end_matches(|c: char| c.is_ascii_digit());
    let number = name.get(head.len()..)?.parse().ok()?;
    Some((head, number))
}

/// The first bytes of a file as text, what is no UTF-8 replaced; empty where it cannot be read.
#[must_use]
pub fn head(path: &Path, bytes: u64) -> String {
    let Ok(file) = File::open(path) else { return String::new() };
    let mut out = Vec::new();
    if file.take(bytes).read_to_end(&mut out).is_err() {
        return String::new();
    }
    String::from_utf8_lossy(&out).into_owned()
}

/// Seconds from `12.5`, `MM:SS.ff` or `HH:MM:SS,fff`; `None` for anything else.
#[must_use]
pub fn seconds(text: &str) -> Option<f64> {
    let text = text.trim().replace(',', ".");
    let parts: Vec<&str> = text.split(':').collect();
    if parts.len() > 3 {
        return None;
    }
    let mut sum = 0.0;
    for (i, part) in parts.iter().enumerate() {
        let value = part.trim().parse::<f64>().ok().filter(|v| v.is_finite())?;
        // Within hours and minutes nothing is negative and all but the last part whole.
        if parts.len() > 1 && (value < 0.0 || (i + 1 < parts.len() && value.fract() != 0.0)) {
            return None;
        }
        sum = sum * 60.0 + value;
    }
    Some(sum)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_read_in_every_way_that_subtitles_and_tables_write_them() {
        for (text, secs) in
            [("12.5", Some(12.5)), ("01:02.5", Some(62.5)), ("00:01:02,500", Some(62.5)), ("1:00:00", Some(3600.0))]
        {
            assert_eq!(seconds(text), secs, "{text}");
        }
        for text in ["", "nan", "inf", "1:2:3:4", "-1:00", "1.5:00", "soon"] {
            assert_eq!(seconds(text), None, "{text}");
        }
    }

    #[test]
    fn a_name_ends_with_its_number() {
        assert_eq!(numbered("frame_0000000080"), Some(("frame_", 80)));
        assert_eq!(numbered("000012"), Some(("", 12)));
        assert_eq!(numbered("left"), None);
        assert_eq!(numbered(&"9".repeat(40)), None);
    }
}
