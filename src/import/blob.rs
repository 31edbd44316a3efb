//! Where bytes are. Nothing is read before it is needed, and never more than a limit.

use std::fs::File;
use std::io::{BufReader, Read, Seek, SeekFrom};
use std::path::{Component, Path, PathBuf};
use std::sync::Arc;

pub use super::believable::MAX_BLOB_BYTES;
use super::h5::Hdf5;
pub use super::pack::Packing;
use crate::error::{Error, Result};

/// Where the bytes of one item are.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Blob {
    /// A whole file.
    File(PathBuf),
    /// An entry of a zip archive.
    Entry {
        /// The archive.
        archive: PathBuf,
        /// The entry's name.
        name: String,
    },
    /// A piece of a file.
    Range {
        /// The file.
        file: PathBuf,
        /// Its first byte.
        offset: u64,
        /// How many bytes.
        length: u64,
    },
    /// Bytes in memory.
    Inline(Arc<[u8]>),
    /// A piece of what other bytes are when they are unpacked.
    Packed {
        /// The packed bytes.
        outer: Box<Blob>,
        /// How they are packed.
        packing: Packing,
        /// The piece's first byte in what is packed.
        start: u64,
        /// How many bytes; `None`: all that follow.
        length: Option<u64>,
    },
    /// Unsigned 16-bit numbers of a row of an HDF5 dataset, least significant byte first.
    Counts {
        /// The file.
        file: PathBuf,
        /// The dataset's path in it.
        dataset: String,
        /// The row, along the first dimension.
        row: u64,
    },
}

impl Blob {
    /// The file that holds the bytes; "memory" for those that no file holds.
    #[must_use]
    pub fn file(&self) -> &Path {
        match self {
            Self::File(path)
            | Self::Entry { archive: path, .. }
            | Self::Range { file: path, .. }
            | Self::Counts { file: path, .. } => path,
            Self::Packed { outer, .. } => outer.file(),
            Self::Inline(_) => Path::new("memory"),
        }
    }

    /// The place in that file, for messages.
    #[must_use]
    pub fn place(&self) -> String {
        match self {
            Self::File(_) => "content".to_owned(),
            Self::Entry { name, .. } => format!("entry {name}"),
            Self::Range { offset, length, .. } => format!("bytes {offset} to {}", offset.saturating_add(*length)),
            Self::Inline(bytes) => format!("{} bytes", bytes.len()),
            Self::Packed { outer, start, .. } if *start > 0 => format!("{}, unpacked from byte {start}", outer.place()),
            Self::Packed { outer, .. } => outer.place(),
            Self::Counts { dataset, row, .. } => format!("{dataset}, row {row}"),
        }
    }

    /// An error about the bytes.
    #[must_use]
    pub fn fault(&self, message: impl Into<String>) -> Error {
        Error::format(self.file(), self.place(), message)
    }

    /// The bytes.
    ///
    /// # Errors
    /// Where the file cannot be read, is shorter than it should be, or holds more than [`MAX_BLOB_BYTES`].
    pub fn read(&self) -> Result<Vec<u8>> {
        match self {
            Self::Inline(bytes) => Ok(bytes.to_vec()),
            Self::File(path) => self.bounded(File::open(path).map_err(|e| Error::io(path, &e))?),
            Self::Range { file, offset, length } => {
                let mut reader = File::open(file).map_err(|e| Error::io(file, &e))?;
                reader.seek(SeekFrom::Start(*offset)).map_err(|e| Error::io(file, &e))?;
                let bytes = self.bounded(reader.take(*length))?;
                if (bytes.len() as u64) < *length {
                    return Err(self.fault("the file ends before; was it copied as a whole?"));
                }
                Ok(bytes)
            }
            Self::Entry { archive, name } => {
                let file = File::open(archive).map_err(|e| Error::io(archive, &e))?;
                let mut zip = zip::ZipArchive::new(BufReader::new(file))
                    .map_err(|e| self.fault(format!("is no zip archive ({e}); was it copied as a whole?")))?;
                let entry = zip.by_name(name).map_err(|e| self.fault(format!("cannot be read ({e})")))?;
                self.bounded(entry)
            }
            Self::Packed { outer, packing, start, length } => self.unpacked(&outer.read()?, *packing, *start, *length),
            Self::Counts { file, dataset, row } => Hdf5::open(file)?.counts(dataset, *row),
        }
    }

    fn unpacked(&self, packed: &[u8], packing: Packing, start: u64, length: Option<u64>) -> Result<Vec<u8>> {
        let most = MAX_BLOB_BYTES + 1;
        let bytes = packing
            .unpack(packed, |reader| {
                std::io::copy(&mut Read::take(&mut *reader, start), &mut std::io::sink())?;
                let mut bytes = Vec::new();
                Read::take(reader, length.unwrap_or(most).min(most)).read_to_end(&mut bytes)?;
                Ok(bytes)
            })
            .map_err(|e| self.fault(format!("cannot be unpacked ({e}); was the file copied as a whole?")))?;
        let found = bytes.len() as u64;
        if found > MAX_BLOB_BYTES {
            return Err(self.fault(format!("is above {} MiB", MAX_BLOB_BYTES >> 20)));
        }
        if let Some(wanted) = length.filter(|n| found < *n) {
            return Err(self.fault(format!("unpacks to {found} bytes, {wanted} were expected")));
        }
        Ok(bytes)
    }

    fn bounded(&self, reader: impl Read) -> Result<Vec<u8>> {
        let mut bytes = Vec::new();
        let read = reader
            .take(MAX_BLOB_BYTES + 1)
            .read_to_end(&mut bytes)
            .map_err(|e| self.fault(format!("cannot be read ({e})")))?;
        if read as u64 > MAX_BLOB_BYTES {
            return Err(self.fault(format!("is above {} MiB", MAX_BLOB_BYTES >> 20)));
        }
        Ok(bytes)
    }
}

/// The path of a file that a source names, inside the source's folder. `Ok(None)` where there is no such file.
///
/// # Errors
/// Where the name is absolute, climbs out with `..`, or is a link to somewhere outside.
pub fn inside(root: &Path, name: &str) -> Result<Option<PathBuf>> {
    let outside = || {
        Error::format(
            root,
            format!("\"{name}\""),
            "lies outside the source's folder; copy it there, names stay relative",
        )
    };
    let relative = Path::new(name);
    if relative.components().any(|c| !matches!(c, Component::Normal(_) | Component::CurDir)) {
        return Err(outside());
    }
    let path = root.join(relative);
    if !path.exists() {
        return Ok(None);
    }
    let (Ok(real), Ok(real_root)) = (path.canonicalize(), root.canonicalize()) else { return Ok(None) };
    if real.starts_with(&real_root) { Ok(Some(path)) } else { Err(outside()) }
}

/// The path of a file that lies in the folder of another one. `Ok(None)` where there is no such file.
///
/// # Errors
/// As [`inside`].
pub fn beside(file: &Path, name: &str) -> Result<Option<PathBuf>> {
    // A bare name has an empty folder, which is no path.
    let folder = file.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    inside(folder, name)
}

/// Files of a folder (not of its subfolders) with one of the endings, in the order of their names, numbers by value. Empty
/// where the folder is not there. Hidden files and links that lead out of the folder are left out.
#[must_use]
pub fn files(folder: &Path, endings: &[&str]) -> Vec<PathBuf> {
    let Ok(entries) = std::fs::read_dir(folder) else { return Vec::new() };
    let mut out: Vec<PathBuf> = entries
        .filter_map(|e| e.ok().map(|e| e.path()))
        .filter(|p| {
            let name = p.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
            let ending = p.extension().map(|e| e.to_string_lossy().to_ascii_lowercase()).unwrap_or_default();
            !name.starts_with('.') && endings.contains(&ending.as_str()) && p.is_file() && inside(folder, &name).is_ok()
        })
        .collect();
    out.sort_by_key(|p| natural(&p.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default()));
    out
}

/// A key that sorts `frame_10` behind `frame_9`: runs of digits by value, then the text itself.
fn natural(name: &str) -> (Vec<(String, u128)>, String) {
    let mut key = Vec::new();
    let mut rest = name;
    while !rest.is_empty() {
        let text: String = rest.chars().take_while(|c| !c.is_ascii_digit()).collect();
        rest = &rest[text.len()..];
        let digits: String = rest.chars().take_while(char::is_ascii_digit).collect();
        rest = &rest[digits.len()..];
        key.push((text, digits.parse().unwrap_or(u128::MAX)));
    }
    (key, name.to_owned())
}

/// Entries of a zip archive with what their bytes are read from: stored ones straight from the file. Names that climb out
/// are left out, as no name of an entry is ever used as a path on disk.
///
/// # Errors
/// Where the archive cannot be read.
pub fn entries(archive: &Path) -> Result<Vec<(String, Blob)>> {
    let broken = |e: zip::result::ZipError| {
        Error::format(archive, "archive", format!("cannot be read ({e}); was it copied as a whole?"))
    };
    let file = File::open(archive).map_err(|e| Error::io(archive, &e))?;
    let mut zip = zip::ZipArchive::new(BufReader::new(file)).map_err(broken)?;
    let mut out = Vec::with_capacity(zip.len());
    for index in 0..zip.len() {
        let entry = zip.by_index(index).map_err(broken)?;
        if entry.is_dir() || entry.enclosed_name().is_none() {
            continue;
        }
        let name = entry.name().map_err(broken)?.into_owned();
        let is_stored = entry.compression() == zip::CompressionMethod::Stored && !entry.encrypted();
        let blob = match entry.data_start() {
            Some(offset) if is_stored => Blob::Range { file: archive.to_owned(), offset, length: entry.size() },
            _ => Blob::Entry { archive: archive.to_owned(), name: name.clone() },
        };
        out.push((name, blob));
    }
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_that_lead_outside_are_refused() {
        let dir = tempfile::tempdir().unwrap();
        std::fs::create_dir(dir.path().join("in")).unwrap();
        std::fs::write(dir.path().join("secret"), "x").unwrap();
        std::fs::write(dir.path().join("in/a.png"), "x").unwrap();
        let root = dir.path().join("in");
        assert!(inside(&root, "a.png").unwrap().is_some());
        assert!(inside(&root, "b.png").unwrap().is_none());
        for name in ["../secret", "/etc/passwd", "x/../../secret"] {
            let error = inside(&root, name).unwrap_err().to_string();
            assert!(error.contains("outside"), "{error}");
        }
    }

    #[cfg(unix)]
    #[test]
    fn links_that_lead_outside_are_refused() {
        let dir = tempfile::tempdir().unwrap();
        let root = dir.path().join("in");
        std::fs::create_dir(&root).unwrap();
        std::fs::write(dir.path().join("secret.png"), "x").unwrap();
        std::os::unix::fs::symlink(dir.path().join("secret.png"), root.join("a.png")).unwrap();
        assert!(inside(&root, "a.png").is_err());
        assert!(files(&root, &["png"]).is_empty());
    }

    #[test]
    fn files_come_in_the_order_of_their_numbers() {
        let dir = tempfile::tempdir().unwrap();
        for name in ["f_10.png", "f_9.png", "f_009b.png", "x.txt", ".hidden.png"] {
            std::fs::write(dir.path().join(name), "x").unwrap();
        }
        let names: Vec<String> =
            files(dir.path(), &["png"]).iter().map(|p| p.file_name().unwrap().to_string_lossy().into_owned()).collect();
        assert_eq!(names, ["f_9.png", "f_009b.png", "f_10.png"]);
    }

    #[test]
    fn a_range_beyond_the_end_is_named() {
        let dir = tempfile::tempdir().unwrap();
        let file = dir.path().join("a.bin");
        std::fs::write(&file, [0u8; 10]).unwrap();
        assert_eq!(Blob::Range { file: file.clone(), offset: 4, length: 6 }.read().unwrap().len(), 6);
        let error = Blob::Range { file, offset: 4, length: 7 }.read().unwrap_err().to_string();
        assert!(error.contains("a.bin") && error.contains("ends before"), "{error}");
    }
}
