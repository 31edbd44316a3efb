//! An output folder that is either whole or not there.

use std::path::{Path, PathBuf};

use anyhow::{Context, bail};

/// What a folder of ours holds: only a folder of the same kind is replaced.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// A twin.
    Twin,
    /// A synthetic recording.
    Recording,
}

impl Kind {
    /// The file that marks such a folder.
    fn marker(self) -> &'static str {
        match self {
            Self::Twin => ".paws-twin",
            Self::Recording => ".paws-recording",
        }
    }
}

/// A folder that is written beside its place and moved there when it is complete.
pub struct Output {
    target: PathBuf,
    staging: PathBuf,
    kind: Kind,
    done: bool,
}

impl Output {
    /// Prepares to write `target`. An existing folder is replaced only if this program made it as the same kind, or if it
    /// is empty; never if it is, or contains, one of the `inputs`.
    pub fn new(target: &Path, kind: Kind, inputs: &[&Path]) -> anyhow::Result<Self> {
        if let Ok(out) = target.canonicalize() {
            for input in inputs {
                if input.canonicalize().is_ok_and(|i| i.starts_with(&out)) {
                    bail!("{}: is or contains the input {}; choose another --out", target.display(), input.display());
                }
            }
        }
        if target.exists() {
            let ours = target.join(kind.marker()).is_file();
            let empty = target.is_dir() && std::fs::read_dir(target).is_ok_and(|mut d| d.next().is_none());
            if !ours && !empty {
                bail!(
                    "{}: exists and was not made by paws; choose another --out, or remove it yourself",
                    target.display()
                );
            }
        }
        let name = target.file_name().map_or_else(|| "out".into(), |n| n.to_string_lossy().into_owned());
        let parent = target.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
        std::fs::create_dir_all(parent).with_context(|| parent.display().to_string())?;
        let staging = parent.join(format!(".{name}.partial-{}", std::process::id()));
        std::fs::create_dir_all(&staging).with_context(|| staging.display().to_string())?;
        Ok(Self { target: target.to_owned(), staging, kind, done: false })
    }

    /// Writes one file, creating folders on the way.
    pub fn write(&self, name: &str, bytes: impl AsRef<[u8]>) -> anyhow::Result<()> {
        let path = self.path(name)?;
        std::fs::write(&path, bytes).with_context(|| path.display().to_string())
    }

    /// The staged path of a file, its folder made.
    pub fn path(&self, name: &str) -> anyhow::Result<PathBuf> {
        let path = self.staging.join(name);
        if name.split('/').any(|part| part.is_empty() || part == "..") {
            bail!("{name}: not a name for a file of the output");
        }
        if let Some(dir) = path.parent() {
            std::fs::create_dir_all(dir).with_context(|| dir.display().to_string())?;
        }
        Ok(path)
    }

    /// Moves the folder to its place.
    pub fn finish(mut self) -> anyhow::Result<()> {
        self.write(self.kind.marker(), "made by paws; replaced as a whole when the command runs again\n")?;
        if self.target.exists() {
            std::fs::remove_dir_all(&self.target).with_context(|| self.target.display().to_string())?;
        }
        std::fs::rename(&self.staging, &self.target).with_context(|| self.target.display().to_string())?;
        self.done = true;
        Ok(())
    }
}

impl Drop for Output {
    fn drop(&mut self) {
        if !self.done {
            // Nothing half-written stays; there is nobody left to tell if this fails too.
            let _ = std::fs::remove_dir_all(&self.staging);
        }
    }
}

/// Writes one file through a temporary one beside it.
pub fn write_file(path: &Path, bytes: impl AsRef<[u8]>) -> anyhow::Result<()> {
    let name = path.file_name().map_or_else(|| "out".into(), |n| n.to_string_lossy().into_owned());
    let staging = path.with_file_name(format!(".{name}.partial-{}", std::process::id()));
    let result = std::fs::write(&staging, bytes).and_then(|()| std::fs::rename(&staging, path));
    if result.is_err() {
        let _ = std::fs::remove_file(&staging);
    }
    result.with_context(|| path.display().to_string())
}
