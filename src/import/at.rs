//! When something was recorded: a time, a frame's number, an image's name.

use std::path::Path;

/// Where in the recording an item belongs. A reader fills in all that it knows.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct At {
    /// Seconds on the capture's clock.
    pub time_secs: Option<f64>,
    /// The image's file name without folder and ending.
    pub name: Option<String>,
    /// Frame of the video, from 0.
    pub index: Option<usize>,
}

impl At {
    /// At a time, seconds.
    #[must_use]
    pub fn time(secs: f64) -> Self {
        Self { time_secs: Some(secs), ..Self::default() }
    }

    /// At a frame of the video, from 0.
    #[must_use]
    pub fn index(index: usize) -> Self {
        Self { index: Some(index), ..Self::default() }
    }

    /// At an image, by its file name; folder and ending are left out.
    #[must_use]
    pub fn name(file: &str) -> Self {
        let stem = Path::new(file).file_stem().map(|s| s.to_string_lossy().into_owned());
        Self { name: stem, ..Self::default() }
    }

    /// The same so many seconds later.
    #[must_use]
    pub fn later(&self, secs: f64) -> Self {
        Self { time_secs: self.time_secs.map(|t| t + secs), ..self.clone() }
    }

    /// The same with a frame of the video, from 0.
    #[must_use]
    pub fn with_index(self, index: usize) -> Self {
        Self { index: Some(index), ..self }
    }

    /// The same with the name of an image.
    #[must_use]
    pub fn with_name(self, file: &str) -> Self {
        Self { name: Self::name(file).name, ..self }
    }
}
