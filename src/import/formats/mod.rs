//! The formats that can be read: one file each, one row of [`ALL`] each.
//!
//! A reader fills a [`Capture`] with what the files hold and declares it; it converts nothing. It reads tables at once and
//! leaves images as blobs. Its errors name file, place and way out. `detect` looks at names and first lines only.

mod aria;
mod aria_camera;
mod aria_depth;
mod aria_walk;
mod colmap;
mod colmap_binary;
mod frames;
mod hdepic;
mod hololens;
mod quest;
mod quest_hands;
mod stray;
mod tum;
mod visionpro;

use std::path::Path;

use super::{Capture, Options};
use crate::error::{Error, Result};

/// A format.
#[derive(Debug, Clone, Copy)]
pub struct Format {
    /// Its name on the command line.
    pub name: &'static str,
    /// What it is, for people.
    pub title: &'static str,
    /// The streams that it can hold.
    pub holds: &'static str,
    /// Whether a path looks like it.
    pub detect: fn(&Path) -> bool,
    /// Reads a path.
    pub read: fn(&Path, &Options) -> Result<Capture>,
}

/// All formats. Where several fit a path, the first one is taken: special ones stand before general ones.
pub const ALL: &[Format] = &[
    Format {
        name: "stray",
        title: "Stray Scanner folder (iPhone, iPad with LiDAR)",
        holds: "poses, images, depth",
        detect: stray::detect,
        read: stray::read,
    },
    Format {
        name: "aria",
        title: "Project Aria glasses with MPS results; Aria Gen 2 pilot recordings",
        holds: "poses, hands, points, images or depth beside it",
        detect: aria::detect,
        read: aria::read,
    },
    Format {
        name: "hdepic",
        title: "HD-EPIC: a trajectory of its tools, or a storage folder with one video",
        holds: "poses, images, points, narrations",
        detect: hdepic::detect,
        read: hdepic::read,
    },
    Format {
        name: "hololens",
        title: "HoloLens 2 recording of StreamRecorder (HoloLens2ForCV)",
        holds: "poses, images, depth, hands",
        detect: hololens::detect,
        read: hololens::read,
    },
    Format {
        name: "quest",
        title: "Quest 3 recording of QuestRealityCapture",
        holds: "poses, images, depth",
        detect: quest::detect,
        read: quest::read,
    },
    Format {
        name: "quest-hands",
        title: "Hand Tracking Streamer (Quest), its lines in a text file",
        holds: "hands, poses of the head",
        detect: quest_hands::detect,
        read: quest_hands::read,
    },
    Format {
        name: "visionpro",
        title: "Vision Pro recording of Tracking Streamer",
        holds: "poses, hands, images",
        detect: visionpro::detect,
        read: visionpro::read,
    },
    Format {
        name: "colmap",
        title: "COLMAP reconstruction (text or binary)",
        holds: "poses, intrinsics, points, images beside it",
        detect: colmap::detect,
        read: colmap::read,
    },
    Format {
        name: "tum",
        title: "TUM RGB-D folder, or a trajectory `t x y z qx qy qz qw`",
        holds: "poses, images, depth",
        detect: tum::detect,
        read: tum::read,
    },
    Format {
        name: "frames",
        title: "a folder of images, or a video file (mp4, mov)",
        holds: "images",
        detect: frames::detect,
        read: frames::read,
    },
];

/// The format of a name.
#[must_use]
pub fn named(name: &str) -> Option<&'static Format> {
    ALL.iter().find(|f| f.name == name)
}

/// The format that a path looks like.
///
/// # Errors
/// Where the path is not there or looks like none.
pub fn detect(path: &Path) -> Result<&'static Format> {
    if !path.exists() {
        return Err(Error::Io { path: path.to_owned(), message: "no such file or folder".to_owned() });
    }
    ALL.iter().find(|f| (f.detect)(path)).ok_or_else(|| {
        let names: Vec<&str> = ALL.iter().map(|f| f.name).collect();
        Error::Io {
            path: path.to_owned(),
            message: format!(
                "looks like none of the formats that are read ({}); `paws import --list` says what they are, KIND=PATH forces \
                 one",
                names.join(", ")
            ),
        }
    })
}
