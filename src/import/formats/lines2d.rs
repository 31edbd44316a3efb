//! A line detector's output: DeepLSD's `{image}_deeplsd.npz`, or LIMAP's folder with `segments/segments_{number}.txt`.
//!
//! LIMAP's `image_list.txt` (`number, name` a line) says which image a number is; without it the number is the image's.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use crate::error::{Error, Result};
use crate::import::ImportOptions;
use crate::import::blob::files;
use crate::import::capture::{At, Capture, SegmentsAt};
use crate::import::names::{numbered, stem};
use crate::import::text::Lines;
use crate::recording::segments;

/// What the detectors put behind an image's name.
const SUFFIXES: [&str; 2] = ["_deeplsd_ext", "_deeplsd"];

/// LIMAP's files: in the folder itself, or in its `segments`.
fn limap(path: &Path) -> Vec<PathBuf> {
    let of = |folder: &Path| -> Vec<PathBuf> {
        files(folder, &["txt"]).into_iter().filter(|f| stem(f).starts_with("segments_")).collect()
    };
    let found = of(path);
    if found.is_empty() { of(&path.join("segments")) } else { found }
}

fn deeplsd(path: &Path) -> Vec<PathBuf> {
    files(path, &["npz"]).into_iter().filter(|f| SUFFIXES.iter().any(|s| stem(f).ends_with(s))).collect()
}

pub(super) fn detect_deeplsd(path: &Path) -> bool {
    path.is_dir() && !deeplsd(path).is_empty()
}

pub(super) fn detect_limap(path: &Path) -> bool {
    path.is_dir() && !limap(path).is_empty()
}

pub(super) fn read_deeplsd(path: &Path, _options: &ImportOptions) -> Result<Capture> {
    let found = deeplsd(path).into_iter().map(|file| {
        let stem = stem(&file);
        let name = SUFFIXES.iter().find_map(|s| stem.strip_suffix(s)).unwrap_or(&stem).to_owned();
        (At { name: Some(name), ..At::default() }, file)
    });
    read(path, "deeplsd", "DeepLSD line segments", found.collect())
}

pub(super) fn read_limap(path: &Path, _options: &ImportOptions) -> Result<Capture> {
    let names = image_list(path)?;
    let found = limap(path).into_iter().filter_map(|file| {
        let number = numbered(&stem(&file))?.1;
        let at = match &names {
            Some(names) => At::name(names.get(&number)?),
            None => At::index(number as usize),
        };
        Some((at, file))
    });
    read(path, "limap", "LIMAP line segments", found.collect())
}

fn read(path: &Path, kind: &str, title: &str, found: Vec<(At, PathBuf)>) -> Result<Capture> {
    let mut capture =
        Capture { kind: kind.to_owned(), source: path.to_owned(), title: title.to_owned(), ..Capture::default() };
    let mut first = None;
    for (at, file) in found {
        match segments::read(&file) {
            Ok(segments) => capture.segments.push(SegmentsAt { at, segments }),
            // One bad file costs its image.
            Err(error) => {
                capture.notes.push(format!("left out: {error}"));
                first.get_or_insert(error);
            }
        }
    }
    if capture.segments.is_empty() {
        return Err(first.unwrap_or_else(|| Error::Io {
            path: path.to_owned(),
            message: "holds no line segments of an image that image_list.txt names".to_owned(),
        }));
    }
    Ok(capture)
}

/// Names of images by their number: a line with how many there are, then `number, name`. `None` where there is no list.
fn image_list(path: &Path) -> Result<Option<BTreeMap<u64, String>>> {
    let file = [path.join("image_list.txt"), path.join("../image_list.txt")].into_iter().find(|f| f.is_file());
    let Some(file) = file else { return Ok(None) };
    let mut lines = Lines::open(&file)?;
    let mut out = BTreeMap::new();
    while let Some(line) = lines.content()? {
        let Some((number, name)) = line.split_once(',') else {
            return Err(lines.fault("expected \"number, name\""));
        };
        // The first line counts them.
        if let Ok(number) = number.trim().parse::<u64>() {
            out.insert(number, name.trim().to_owned());
        }
    }
    Ok(Some(out))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write as _;

    /// DeepLSD's exporter: an array `lines` of shape (1, 2, 2), rows before columns.
    fn npz() -> Vec<u8> {
        let mut header = "{'descr': '<f4', 'fortran_order': False, 'shape': (1, 2, 2), }".to_owned();
        while !(10 + header.len() + 1).is_multiple_of(64) {
            header.push(' ');
        }
        header.push('\n');
        let mut npy = b"\x93NUMPY\x01\x00".to_vec();
        npy.extend((header.len() as u16).to_le_bytes());
        npy.extend(header.as_bytes());
        npy.extend([10f32, 20.0, 30.0, 40.0].iter().flat_map(|v| v.to_le_bytes()));
        let mut zip = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
        let options = zip::write::SimpleFileOptions::default().compression_method(zip::CompressionMethod::Stored);
        zip.start_file("lines.npy", options).unwrap();
        zip.write_all(&npy).unwrap();
        zip.finish().unwrap().into_inner()
    }

    #[test]
    fn deeplsds_files_are_named_after_their_images_and_a_bad_one_costs_itself() {
        let dir = tempfile::tempdir().unwrap();
        std::fs::write(dir.path().join("000003_deeplsd.npz"), npz()).unwrap();
        std::fs::write(dir.path().join("000004_deeplsd_ext.npz"), &npz()[..40]).unwrap();
        assert!(detect_deeplsd(dir.path()) && !detect_limap(dir.path()));
        let capture = read_deeplsd(dir.path(), &ImportOptions::default()).unwrap();
        assert_eq!(capture.segments.len(), 1);
        assert_eq!(capture.segments[0].at.name.as_deref(), Some("000003"));
        assert_eq!(capture.segments[0].segments, [[[20.0, 10.0], [40.0, 30.0]]]);
        assert!(capture.notes[0].contains("000004_deeplsd_ext.npz"), "{:?}", capture.notes);
        std::fs::remove_file(dir.path().join("000003_deeplsd.npz")).unwrap();
        assert!(read_deeplsd(dir.path(), &ImportOptions::default()).is_err());
    }
}
