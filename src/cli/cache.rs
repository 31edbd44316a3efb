//! `--cache`: what frames show, kept between runs.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

use anyhow::Context;
use sha2::{Digest, Sha256};

use super::shown;
use crate::config::{Config, LineMethod};
use crate::pipeline::{Forgetful, LookStore};
use crate::recording::Recording;

/// Raised where the same files would show something else: another line detector, another way to thin depth.
const VERSION: &[u8] = b"paws look 1";

/// A folder with a file for each look, named by a hash of all that it depends on: the bytes of the frame's files, its pose and
/// camera, the classes of its mask, and the configuration of the lines. Files that are damaged, and what cannot be written, cost
/// a look at the frame.
pub struct Cache {
    dir: PathBuf,
    settings: String,
    /// Whether a look depends on the frame's number: the paper's line fits draw by it.
    by_number: bool,
    written: AtomicUsize,
}

/// The store of a folder; without one nothing is kept.
pub fn open(dir: Option<&Path>, config: &Config) -> anyhow::Result<Box<dyn LookStore>> {
    let Some(dir) = dir else { return Ok(Box::new(Forgetful)) };
    std::fs::create_dir_all(dir).with_context(|| shown(dir))?;
    Ok(Box::new(Cache {
        dir: dir.to_owned(),
        settings: format!("{:?} {}", config.geometry, config.seed),
        by_number: config.geometry.lines == LineMethod::Unprojected,
        written: AtomicUsize::new(0),
    }))
}

impl Cache {
    /// The file of a look; `None` where a frame has no depth of its own, and where a file cannot be read, which is told by who
    /// looks at it.
    fn path(&self, recording: &Recording, frame: usize, with_lines: bool) -> Option<PathBuf> {
        let seen = recording.frames.get(frame)?;
        let mut hash = Sha256::new();
        // Lengths in front, so that no two looks run together to the same bytes.
        let mut add = |bytes: &[u8]| {
            hash.update((bytes.len() as u64).to_le_bytes());
            hash.update(bytes);
        };
        add(VERSION);
        add(env!("CARGO_PKG_VERSION").as_bytes());
        add(&std::fs::read(seen.files.depth.as_ref()?).ok()?);
        let of_lines = [&seen.files.rgb, &seen.files.segments].into_iter().filter(|_| with_lines);
        for file in std::iter::once(&seen.files.mask).chain(of_lines) {
            match file {
                Some(file) => add(&std::fs::read(file).ok()?),
                None => add(b"none"),
            }
        }
        let camera = recording.camera_of(frame);
        let pose = &seen.world_from_camera;
        let place = [pose.translation.vector.as_slice(), pose.rotation.coords.as_slice()].concat();
        let lens = [camera.fx, camera.fy, camera.cx, camera.cy];
        for number in place.into_iter().chain(lens) {
            add(&number.to_le_bytes());
        }
        add(format!("{} {} {with_lines}", camera.width, camera.height).as_bytes());
        add(recording.classes_of(frame));
        add(self.settings.as_bytes());
        if self.by_number {
            add(&(frame as u64).to_le_bytes());
        }
        let name: String = hash.finalize().iter().map(|byte| format!("{byte:02x}")).collect();
        let (folder, rest) = name.split_at_checked(2)?;
        Some(self.dir.join(folder).join(format!("{rest}.look")))
    }
}

impl LookStore for Cache {
    fn find(&self, recording: &Recording, frame: usize, with_lines: bool) -> Option<Vec<u8>> {
        std::fs::read(self.path(recording, frame, with_lines)?).ok()
    }

    fn keep(&self, recording: &Recording, frame: usize, with_lines: bool, look: &[u8]) {
        let Some(path) = self.path(recording, frame, with_lines) else { return };
        let number = self.written.fetch_add(1, Ordering::Relaxed);
        let staging = self.dir.join(format!(".partial-{}-{number}", std::process::id()));
        let folder = path.parent().unwrap_or(&self.dir);
        let kept = std::fs::create_dir_all(folder)
            .and_then(|()| std::fs::write(&staging, look))
            .and_then(|()| std::fs::rename(&staging, &path));
        if kept.is_err() {
            let _ = std::fs::remove_file(&staging);
        }
    }
}
