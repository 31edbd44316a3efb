//! Several recordings of one place, read as one.

use std::path::{Path, PathBuf};

use super::door::Door;
use super::progress::Steps;
use super::{Opening, shown};
use crate::config::Config;
use crate::pipeline;
use crate::recording::Recording;
use crate::recording::videos::LeftOut;

/// Recordings that are still to be read.
#[derive(Clone, Copy)]
pub struct Given<'a> {
    /// Their folders, in the order of time.
    pub recordings: &'a [PathBuf],
    /// What may be read of them.
    pub opening: Opening,
    /// What is done where one contradicts itself.
    pub door: Door,
    /// Whether somebody said that their worlds are one.
    pub one_frame: bool,
    /// Where what frames show is kept between runs.
    pub cache: Option<&'a Path>,
}

impl Given<'_> {
    /// Reads one recording as it is, several as one, and says where each of them lies. Of several, one that cannot be used, or
    /// that fits nowhere, is left out.
    pub fn open(&self, config: &Config, steps: &Steps) -> anyhow::Result<Recording> {
        if let [dir] = self.recordings {
            return self.door.open(self.opening, dir);
        }
        let (mut opened, mut left_out) = (Vec::new(), Vec::new());
        for dir in self.recordings {
            match self.door.open(self.opening, dir) {
                Ok(recording) => opened.push(recording),
                // A folder that is not there is a slip of the hand.
                Err(error) if !dir.is_dir() => return Err(error),
                Err(error) => left_out.push(LeftOut { name: shown(dir), reason: format!("{error:#}") }),
            }
        }
        if opened.is_empty()
            && let Some(first) = left_out.first()
        {
            anyhow::bail!("none of {} recordings can be used; the first: {}", left_out.len(), first.reason);
        }
        let report = |step: &str, done: usize, total: usize| steps.report(step, done, total);
        let joined = pipeline::together(opened, left_out, self.one_frame, config, &report)?;
        for video in &joined.videos.joined {
            eprintln!("{}: {}", video.name, video.placement.words());
        }
        for left in &joined.videos.left_out {
            eprintln!("left out: {}: {}", left.name, left.reason);
        }
        Ok(joined)
    }
}
