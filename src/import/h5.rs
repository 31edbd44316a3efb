//! HDF5 files: tables that fit into memory, single rows of those that do not.

use std::path::{Path, PathBuf};

use super::believable::MAX_BLOB_BYTES;
use crate::error::{Error, Result};

/// An open file.
pub struct Hdf5 {
    file: hdf5_pure::File,
    path: PathBuf,
}

/// Whether a file begins as HDF5 files do.
#[must_use]
pub fn is_hdf5(path: &Path) -> bool {
    path.is_file() && hdf5_pure::is_hdf5(path).unwrap_or(false)
}

impl Hdf5 {
    /// Opens a file; nothing but its first tables is read.
    ///
    /// # Errors
    /// Where it cannot be read or is no HDF5.
    pub fn open(path: &Path) -> Result<Self> {
        std::fs::File::open(path).map_err(|e| Error::io(path, &e))?;
        let file = hdf5_pure::File::open_streaming(path)
            .map_err(|e| Error::format(path, "HDF5", format!("cannot be read ({e}); was it copied as a whole?")))?;
        Ok(Self { file, path: path.to_owned() })
    }

    /// An error about something in the file.
    #[must_use]
    pub fn fault(&self, place: &str, message: impl Into<String>) -> Error {
        Error::format(&self.path, place, message)
    }

    /// Whether there is a dataset.
    #[must_use]
    pub fn has(&self, dataset: &str) -> bool {
        self.file.dataset(dataset).is_ok()
    }

    fn dataset(&self, name: &str) -> Result<hdf5_pure::Dataset> {
        self.file.dataset(name).map_err(|e| self.fault(name, format!("the dataset cannot be read ({e})")))
    }

    fn unread(&self, name: &str, e: &hdf5_pure::Error) -> Error {
        self.fault(name, format!("cannot be read ({e})"))
    }

    /// Lengths of a dataset's dimensions.
    ///
    /// # Errors
    /// Where it is not there.
    pub fn shape(&self, dataset: &str) -> Result<Vec<u64>> {
        self.dataset(dataset)?.shape().map_err(|e| self.unread(dataset, &e))
    }

    /// A dataset whose shape is checked (`None`: any length) and that is small enough to read at once.
    fn checked(&self, name: &str, shape: &[Option<u64>]) -> Result<hdf5_pure::Dataset> {
        let dataset = self.dataset(name)?;
        let found = dataset.shape().map_err(|e| self.unread(name, &e))?;
        let fits = found.len() == shape.len() && found.iter().zip(shape).all(|(a, b)| b.is_none_or(|b| *a == b));
        if !fits {
            let wanted: Vec<String> =
                shape.iter().map(|n| n.map_or_else(|| "frames".to_owned(), |n| n.to_string())).collect();
            return Err(self.fault(name, format!("has shape {found:?}, expected [{}]", wanted.join(", "))));
        }
        let bytes = dataset.element_size().map_err(|e| self.unread(name, &e))?;
        let total = found.iter().fold(bytes, |sum, n| sum.saturating_mul(*n));
        // Numbers of four bytes become numbers of eight.
        if total.saturating_mul(2) > MAX_BLOB_BYTES {
            return Err(self.fault(name, format!("claims {total} bytes; cut the recording into pieces")));
        }
        Ok(dataset)
    }

    /// All numbers of a dataset, row by row. `shape`: the lengths of its dimensions, `None` for any.
    ///
    /// # Errors
    /// Where it is not there, has another shape, holds no numbers or too many.
    pub fn numbers(&self, dataset: &str, shape: &[Option<u64>]) -> Result<Vec<f64>> {
        let found = self.checked(dataset, shape)?;
        found.read_f64().map_err(|e| self.fault(dataset, format!("holds no numbers that can be read ({e})")))
    }

    /// All truth values of a dataset of one dimension, a byte each.
    ///
    /// # Errors
    /// Where it is not there or holds something else.
    pub fn flags(&self, dataset: &str) -> Result<Vec<bool>> {
        let found = self.checked(dataset, &[None])?;
        if found.element_size().map_err(|e| self.unread(dataset, &e))? != 1 {
            return Err(self.fault(dataset, "must hold truth values of one byte each"));
        }
        let bytes = found.read_raw().map_err(|e| self.unread(dataset, &e))?;
        Ok(bytes.into_iter().map(|b| b != 0).collect())
    }

    /// A text that is attached to a group (`/`: to the file).
    #[must_use]
    pub fn text(&self, group: &str, name: &str) -> Option<String> {
        let group = if group == "/" { self.file.root() } else { self.file.group(group).ok()? };
        let attributes = group.attrs().ok()?;
        attributes.get(name)?.as_str().map(str::to_owned)
    }

    /// Unsigned 16-bit numbers of a row (along the first dimension), least significant byte first.
    ///
    /// # Errors
    /// Where the dataset is not there, ends before, holds no numbers or too many.
    pub fn counts(&self, dataset: &str, row: u64) -> Result<Vec<u8>> {
        let found = self.dataset(dataset)?;
        let shape = found.shape().map_err(|e| self.unread(dataset, &e))?;
        let Some((rows, inner)) = shape.split_first().filter(|(rows, _)| row < **rows) else {
            return Err(self.fault(dataset, format!("has no row {row}, its shape is {shape:?}")));
        };
        if inner.iter().fold(2u64, |sum, n| sum.saturating_mul(*n)) > MAX_BLOB_BYTES {
            return Err(self.fault(dataset, format!("claims {rows} rows of shape {inner:?}, which no camera makes")));
        }
        let counts = found.read_u16_rows(row, 1).map_err(|e| self.unread(dataset, &e))?;
        Ok(counts.into_iter().flat_map(u16::to_le_bytes).collect())
    }
}
