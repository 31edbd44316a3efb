//! Where a recording's files may lie: in its own folder, unless the caller allows more.

use std::path::{Path, PathBuf};

use crate::error::{Error, Result};

/// Coordinates beyond this are overflows or garbage, whatever their unit: a continent in millimetres is smaller.
pub(super) const MAX_COORDINATE: f64 = 1e10;

/// A recording's folder.
pub(super) struct Folder {
    dir: PathBuf,
    /// Where the folder really is.
    root: PathBuf,
    follow_links: bool,
}

impl Folder {
    pub(super) fn new(dir: &Path, follow_links: bool) -> Result<Self> {
        let root = dir.canonicalize().map_err(|e| Error::io(dir, &e))?;
        Ok(Self { dir: dir.to_owned(), root, follow_links })
    }

    /// The path of a file by its name in the folder; `None` where there is none.
    ///
    /// What counts is where the file really lies: a picture from elsewhere could travel to a language model's server.
    ///
    /// # Errors
    /// In words, where the file lies outside of the folder and that was not allowed.
    pub(super) fn file(&self, name: &str) -> std::result::Result<Option<PathBuf>, String> {
        let path = self.dir.join(name);
        if !path.is_file() {
            return Ok(None);
        }
        if self.follow_links {
            return Ok(Some(path));
        }
        match path.canonicalize() {
            Ok(real) if real.starts_with(&self.root) => Ok(Some(path)),
            Ok(real) => Err(format!(
                "{name} leads out of the recording, to {}; bring the file into the folder, or allow it with --follow-links",
                real.display()
            )),
            Err(e) => Err(format!("{name}: {e}")),
        }
    }
}
