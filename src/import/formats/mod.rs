//! The formats that can be read: one file each, one row of [`ALL`] each.
//!
//! A reader fills a [`Capture`] with what the files hold and declares it; it converts nothing. It reads tables at once and
//! leaves images as blobs. Its errors name file, place and way out. `detect` looks at names and first lines only.

mod colmap;
mod colmap_binary;
mod ego_vision;
mod egodex;
mod frames;
mod mcap;
mod polycam;
mod record3d;
mod stera;
mod stray;
mod tum;

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
        name: "stera",
        title: "Stera SDK episode (iPhone Pro): annotation.hdf5, rgb.mp4, calibrations",
        holds: "poses, images, depth, hands",
        detect: stera::detect,
        read: stera::read,
    },
    Format {
        name: "mcap",
        title: "ROS 2 recording in MCAP, file or rosbag2 folder (RGB-D robots, Stera app)",
        holds: "poses, images, depth",
        detect: mcap::detect,
        read: mcap::read,
    },
    Format {
        name: "record3d",
        title: "Record3D .r3d archive, or its EXR + JPG folder (iPhone, iPad)",
        holds: "poses, images, depth",
        detect: record3d::detect,
        read: record3d::read,
    },
    Format {
        name: "polycam",
        title: "Polycam raw data (iPhone, iPad with LiDAR)",
        holds: "poses, images, depth",
        detect: polycam::detect,
        read: polycam::read,
    },
    Format {
        name: "egodex",
        title: "EgoDex recording (Vision Pro): N.hdf5 beside N.mp4",
        holds: "poses, images, hands, clips",
        detect: egodex::detect,
        read: egodex::read,
    },
    Format {
        name: "ego-vision",
        title: "ego-vision result (JSON)",
        holds: "poses, intrinsics, hands",
        detect: ego_vision::detect,
        read: ego_vision::read,
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
