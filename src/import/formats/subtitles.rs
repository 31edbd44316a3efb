//! Subtitles (SubRip `.srt`, WebVTT `.vtt`): what is said, with times from the video's start.

use std::path::Path;

use crate::error::{Error, Result};
use crate::import::ImportOptions;
use crate::import::capture::{At, Capture, ClipAt};
use crate::import::names::{ending, seconds};
use crate::import::text::Lines;

pub(super) fn detect(path: &Path) -> bool {
    path.is_file() && ["srt", "vtt"].contains(&ending(path).as_str())
}

pub(super) fn read(path: &Path, _options: &ImportOptions) -> Result<Capture> {
    let mut lines = Lines::open(path)?;
    let mut clips = Vec::new();
    while let Some(line) = lines.line()? {
        // A cue's number, headers and notes stand between cues and are not needed.
        let Some((start, rest)) = line.split_once("-->") else { continue };
        // WebVTT writes how a cue looks behind its times.
        let end = rest.split_whitespace().next().unwrap_or_default();
        let (Some(start), Some(end)) = (seconds(start), seconds(end)) else {
            return Err(lines.fault("expected HH:MM:SS,fff --> HH:MM:SS,fff"));
        };
        let mut text = Vec::new();
        while let Some(line) = lines.line()?.filter(|l| !l.is_empty()) {
            text.push(plain(&line));
        }
        let narration = text.join(" ").trim().to_owned();
        if narration.is_empty() {
            continue;
        }
        clips.push(ClipAt {
            name: String::new(),
            start: At::time(start),
            end: At::time(end),
            narration,
            verb: String::new(),
            noun: String::new(),
        });
    }
    if clips.is_empty() {
        return Err(Error::format(
            path,
            "cues",
            "there is none; expected lines of HH:MM:SS,fff --> HH:MM:SS,fff and text",
        ));
    }
    Ok(Capture {
        kind: "subtitles".to_owned(),
        source: path.to_owned(),
        title: "subtitles".to_owned(),
        clips,
        ..Capture::default()
    })
}

/// A line without marks of style: `<i>open</i>`, `{\an8}`.
fn plain(line: &str) -> String {
    let mut depth = 0usize;
    let mut out = String::new();
    for c in line.chars() {
        match c {
            '<' | '{' => depth += 1,
            '>' | '}' if depth > 0 => depth -= 1,
            _ if depth == 0 => out.push(c),
            _ => {}
        }
    }
    // A lone "<" is no mark.
    if depth == 0 { out.trim().to_owned() } else { line.trim().to_owned() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cues_are_clips_with_plain_words() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.srt");
        let text = "1\r\n00:00:01,500 --> 00:00:03,000\r\n<i>open</i>\r\nthe door\r\n\r\n\
                    2\r\n00:00:04,000 --> 00:00:05,000\r\n\r\n";
        std::fs::write(&path, text).unwrap();
        let capture = read(&path, &ImportOptions::default()).unwrap();
        let [clip] = capture.clips.as_slice() else { panic!("{:?}", capture.clips) };
        assert_eq!((clip.start.time_secs, clip.end.time_secs), (Some(1.5), Some(3.0)));
        assert_eq!(clip.narration, "open the door");
        std::fs::write(&path, "WEBVTT\n\n00:01.000 --> 00:02.000 align:start\nclose it\n").unwrap();
        assert_eq!(read(&path, &ImportOptions::default()).unwrap().clips[0].end.time_secs, Some(2.0));
    }

    #[test]
    fn broken_times_are_named() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.srt");
        for (text, word) in [("1\nsoon --> later\nx\n", "line 2"), ("", "there is none")] {
            std::fs::write(&path, text).unwrap();
            let error = read(&path, &ImportOptions::default()).unwrap_err().to_string();
            assert!(error.contains(word) && error.contains("a.srt"), "{error}");
        }
    }
}
