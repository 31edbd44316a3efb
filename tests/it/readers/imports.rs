//! The formats of `paws import`, each a target of its own (`import-NAME`): a new one needs seeds and no code here.

use std::collections::BTreeSet;
use std::path::PathBuf;

use paws_twin::import::capture::{At, Capture, PoseAt, Poses, RawPose};
use paws_twin::import::formats::ImportFormat;
use paws_twin::import::optics::Optics;
use paws_twin::import::{ImportOptions, assemble};

use super::files::Files;
use super::targets::told;

/// Files of one input.
const MAX_FILES: usize = 32;

/// Reads an input as a source of a format, joins it with nothing (what has no poses with a walk), and writes the result's tables
/// and two frames. Whether the input is such a source.
pub fn run(format: &ImportFormat, files: &mut Files, bytes: &[u8]) -> bool {
    let options = options(bytes);
    let Some(capture) = read(format, files, bytes, &options) else { return false };
    let captures = if capture.poses.is_none() { vec![capture, walk()] } else { vec![capture] };
    let Some(imported) = told(assemble(captures, &options)) else { return true };
    let mut names = BTreeSet::new();
    for frame in 0..imported.frames.len().min(2) {
        names.extend(imported.images(frame).files.into_iter().map(|(name, _)| name));
    }
    told(imported.tables(&names));
    true
}

fn read(format: &ImportFormat, files: &mut Files, bytes: &[u8], options: &ImportOptions) -> Option<Capture> {
    let parts = sections(bytes);
    files.only(&parts);
    let root = files.root().to_owned();
    let path = match parts.as_slice() {
        [(name, _)] if !(format.detect)(&root) => root.join(name),
        _ => root,
    };
    std::hint::black_box((format.detect)(&path));
    told((format.read)(&path, options))
}

fn options(bytes: &[u8]) -> ImportOptions {
    ImportOptions {
        width: 64,
        // Programs cost milliseconds each.
        ffmpeg: Some(PathBuf::from("/nowhere/ffmpeg")),
        // With and without; most scales are not known.
        scale: (!bytes.len().is_multiple_of(3)).then_some(1.0),
        camera: bytes.len().is_multiple_of(2).then(|| Optics::pinhole(64, 48, [40.0, 40.0, 31.5, 23.5])),
        ..ImportOptions::default()
    }
}

/// Three poses of a level camera, from the first tenth of a second on.
fn walk() -> Capture {
    let pose = |i: u8| {
        let t = 0.1 * f64::from(i);
        let rows = [1.0, 0.0, 0.0, t, 0.0, 0.0, 1.0, 0.0, 0.0, -1.0, 0.0, 1.5];
        Some(PoseAt { at: At::time(t), pose: RawPose::from_rows(&rows)?, optics: None })
    };
    let poses = Poses { items: (0..3).filter_map(pose).collect(), ..Poses::default() };
    Capture { kind: "walk".to_owned(), source: PathBuf::from("walk"), poses: Some(poses), ..Capture::default() }
}

/// Files as `fuzz/run --pack` writes them: `=== NAME`, a line end, the bytes, a line end. Bytes without a name are one file.
fn sections(bytes: &[u8]) -> Vec<(String, &[u8])> {
    const SIGN: &[u8] = b"=== ";
    let mut starts: Vec<usize> = if bytes.starts_with(SIGN) { vec![0] } else { Vec::new() };
    starts.extend(
        bytes.windows(SIGN.len() + 1).enumerate().filter(|(_, w)| w.starts_with(b"\n=== ")).map(|(i, _)| i + 1),
    );
    let mut out: Vec<(String, &[u8])> = Vec::new();
    for (i, start) in starts.iter().enumerate().take(MAX_FILES) {
        let end = starts.get(i + 1).map_or(bytes.len(), |next| next - 1);
        let section = bytes.get(start + SIGN.len()..end).unwrap_or_default();
        let line = section.iter().position(|b| *b == b'\n').unwrap_or(section.len());
        let (name, rest) = section.split_at(line);
        if let Some(name) = safe(name).filter(|n| out.iter().all(|(other, _)| other != n)) {
            out.push((name, rest.get(1..).unwrap_or_default()));
        }
    }
    if out.is_empty() {
        out.push(("source".to_owned(), bytes));
    }
    out
}

/// A name that stays in the folder.
fn safe(name: &[u8]) -> Option<String> {
    let name = std::str::from_utf8(name).ok()?;
    let plain = |part: &str| {
        !part.is_empty()
            && !part.starts_with('.')
            && part.len() <= 64
            && part.bytes().all(|b| b.is_ascii_alphanumeric() || b"._- ()".contains(&b))
    };
    (name.split('/').count() <= 5 && name.split('/').all(plain)).then(|| name.to_owned())
}
