//! One error for the whole library, sorted by who can mend it.

use std::path::{Path, PathBuf};

/// What can go wrong. "No answer" is not an error: see [`crate::articulation::Outcome`].
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The operating system refused a path.
    #[error("{}: {message}", path.display())]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// What the system said, and the way out where there is one.
        message: String,
    },
    /// A file is there but is not what it should be.
    #[error("{}: {place}: {message}", path.display())]
    Format {
        /// The file.
        path: PathBuf,
        /// Where in the file: a line, a frame, a key.
        place: String,
        /// What was found, what was expected, and the way out.
        message: String,
    },
    /// A recording that cannot be used, with all its faults at once.
    #[error("{}: the recording cannot be used:\n  - {}", path.display(), faults.join("\n  - "))]
    Recording {
        /// The recording's folder.
        path: PathBuf,
        /// One sentence a fault; each names its file and place.
        faults: Vec<String>,
    },
    /// A configuration value that cannot be used.
    #[error("config: {0}")]
    Config(String),
    /// A twin that cannot be written in the format asked for.
    #[error("export: {0}")]
    Export(String),
    /// The physics simulation gave no usable result.
    #[error("simulation: {0}")]
    Simulation(String),
    /// A language model that cannot be asked at all: a bad address, a refused key. A failed answer is not an error.
    #[error("language model: {0}")]
    Vlm(String),
}

/// Result with this crate's [`Error`].
pub type Result<T> = std::result::Result<T, Error>;

impl Error {
    /// An IO error with its path; a missing file says so in plain words.
    pub fn io(path: &Path, source: &std::io::Error) -> Self {
        let message = match source.kind() {
            std::io::ErrorKind::NotFound => "no such file or folder".to_owned(),
            _ => source.to_string(),
        };
        Self::Io { path: path.to_owned(), message }
    }

    /// A format error at a place in a file.
    pub fn format(path: &Path, place: impl Into<String>, message: impl Into<String>) -> Self {
        Self::Format { path: path.to_owned(), place: place.into(), message: message.into() }
    }
}
