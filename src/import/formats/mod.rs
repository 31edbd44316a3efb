//! The formats that can be read: one file each, one row of [`ALL`] each.
//!
//! A reader fills a [`Capture`] with what the files hold and declares it; it converts nothing. It reads tables at once and
//! leaves images as blobs. Its errors name file, place and way out. `detect` looks at names and first lines only.

mod aria;
mod aria_camera;
mod aria_depth;
mod aria_walk;
mod arkitscenes;
mod arti4d;
pub(crate) mod cloud;
mod colmap;
mod colmap_binary;
mod colmap_model;
mod ego_vision;
mod egodex;
mod epic_fields;
mod frames;
mod grounded_sam;
mod hands;
mod hands23;
mod hdepic;
mod hoi4d;
mod hololens;
mod lines2d;
mod mapanything;
mod mcap;
mod moge;
mod narrations;
mod nerfstudio;
mod polycam;
mod quest;
mod quest_hands;
mod record3d;
mod recording;
mod stera;
mod stray;
mod subtitles;
pub mod surface;
mod tum;
mod visionpro;
mod wilor;

use std::path::Path;

use super::names::{ending, head};
use super::{Capture, ImportOptions};
use crate::error::{Error, Result};
use crate::json::POINTER;

/// A format.
#[derive(Debug, Clone, Copy)]
pub struct ImportFormat {
    /// Its name on the command line.
    pub name: &'static str,
    /// What it is, for people.
    pub title: &'static str,
    /// The streams that it can hold.
    pub holds: &'static str,
    /// Whether a path looks like it.
    pub detect: fn(&Path) -> bool,
    /// Reads a path.
    pub read: fn(&Path, &ImportOptions) -> Result<Capture>,
}

/// All formats. Where several fit a path, the first one is taken: special ones stand before general ones.
pub const ALL: &[ImportFormat] = &[
    ImportFormat {
        name: "recording",
        title: "a recording of ours, for what networks made of its frames/",
        holds: "all streams",
        detect: recording::detect,
        read: recording::read,
    },
    ImportFormat {
        name: "stray",
        title: "Stray Scanner folder (iPhone, iPad with LiDAR)",
        holds: "poses, images, depth",
        detect: stray::detect,
        read: stray::read,
    },
    ImportFormat {
        name: "stera",
        title: "Stera SDK episode (iPhone Pro): annotation.hdf5, rgb.mp4, calibrations",
        holds: "poses, images, depth, hands",
        detect: stera::detect,
        read: stera::read,
    },
    ImportFormat {
        name: "mcap",
        title: "ROS 2 recording in MCAP, file or rosbag2 folder (RGB-D robots, Stera app)",
        holds: "poses, images, depth",
        detect: mcap::detect,
        read: mcap::read,
    },
    ImportFormat {
        name: "record3d",
        title: "Record3D .r3d archive, or its EXR + JPG folder (iPhone, iPad)",
        holds: "poses, images, depth",
        detect: record3d::detect,
        read: record3d::read,
    },
    ImportFormat {
        name: "polycam",
        title: "Polycam raw data (iPhone, iPad with LiDAR)",
        holds: "poses, images, depth",
        detect: polycam::detect,
        read: polycam::read,
    },
    ImportFormat {
        name: "egodex",
        title: "EgoDex recording (Vision Pro): N.hdf5 beside N.mp4",
        holds: "poses, images, hands, clips",
        detect: egodex::detect,
        read: egodex::read,
    },
    ImportFormat {
        name: "ego-vision",
        title: "ego-vision result (JSON)",
        holds: "poses, intrinsics, hands",
        detect: ego_vision::detect,
        read: ego_vision::read,
    },
    ImportFormat {
        name: "aria",
        title: "Project Aria glasses with MPS results; Aria Gen 2 pilot recordings",
        holds: "poses, hands, points, images or depth beside it",
        detect: aria::detect,
        read: aria::read,
    },
    ImportFormat {
        name: "hdepic",
        title: "HD-EPIC: a trajectory of its tools, or a storage folder with one video",
        holds: "poses, images, points, narrations",
        detect: hdepic::detect,
        read: hdepic::read,
    },
    ImportFormat {
        name: "hololens",
        title: "HoloLens 2 recording of StreamRecorder (HoloLens2ForCV)",
        holds: "poses, images, depth, hands",
        detect: hololens::detect,
        read: hololens::read,
    },
    ImportFormat {
        name: "quest",
        title: "Quest 3 recording of QuestRealityCapture",
        holds: "poses, images, depth",
        detect: quest::detect,
        read: quest::read,
    },
    ImportFormat {
        name: "quest-hands",
        title: "Hand Tracking Streamer (Quest), its lines in a text file",
        holds: "hands, poses of the head",
        detect: quest_hands::detect,
        read: quest_hands::read,
    },
    ImportFormat {
        name: "visionpro",
        title: "Vision Pro recording of Tracking Streamer",
        holds: "poses, hands, images",
        detect: visionpro::detect,
        read: visionpro::read,
    },
    ImportFormat {
        name: "colmap",
        title: "COLMAP reconstruction (text or binary)",
        holds: "poses, intrinsics, points, images beside it",
        detect: colmap::detect,
        read: colmap::read,
    },
    ImportFormat {
        name: "tum",
        title: "TUM RGB-D folder, or a trajectory `t x y z qx qy qz qw`",
        holds: "poses, images, depth",
        detect: tum::detect,
        read: tum::read,
    },
    ImportFormat {
        name: "arkitscenes",
        title: "ARKitScenes raw scan",
        holds: "poses, images, depth",
        detect: arkitscenes::detect,
        read: arkitscenes::read,
    },
    ImportFormat {
        name: "arti4d",
        title: "Arti4D sequence",
        holds: "poses, images, depth, clips",
        detect: arti4d::detect,
        read: arti4d::read,
    },
    ImportFormat {
        name: "hoi4d",
        title: "HOI4D sequence: align_rgb, align_depth, 3Dseg/output.log",
        holds: "poses, intrinsics, images, depth",
        detect: hoi4d::detect,
        read: hoi4d::read,
    },
    ImportFormat {
        name: "nerfstudio",
        title: "nerfstudio, instant-ngp: transforms.json",
        holds: "poses, intrinsics, images, depth, points",
        detect: nerfstudio::detect,
        read: nerfstudio::read,
    },
    ImportFormat {
        name: "epic-fields",
        title: "EPIC-Fields JSON",
        holds: "poses, intrinsics, points",
        detect: epic_fields::detect,
        read: epic_fields::read,
    },
    ImportFormat {
        name: "mapanything",
        title: "MapAnything, as COLMAP files (to be named)",
        holds: "poses, intrinsics, points, images",
        detect: mapanything::detect,
        read: mapanything::read,
    },
    ImportFormat {
        name: "moge",
        title: "MoGe-2 folders (--maps)",
        holds: "depth, normals, images",
        detect: moge::detect,
        read: moge::read,
    },
    ImportFormat {
        name: "wilor",
        title: "WiLoR or HaMeR meshes (OBJ)",
        holds: "hands",
        detect: wilor::detect,
        read: wilor::read,
    },
    ImportFormat {
        name: "hands",
        title: "hands and cameras as JSON lines (examples/import: HaWoR, WiLoR, HOI4D)",
        holds: "hands, poses",
        detect: hands::detect,
        read: hands::read,
    },
    ImportFormat {
        name: "hands23",
        title: "Hands23 result.json",
        holds: "contact, masks of hands",
        detect: hands23::detect,
        read: hands23::read,
    },
    ImportFormat {
        name: "grounded-sam",
        title: "Grounded-SAM-2 results",
        holds: "masks",
        detect: grounded_sam::detect,
        read: grounded_sam::read,
    },
    ImportFormat {
        name: "deeplsd",
        title: "DeepLSD npz files",
        holds: "line segments",
        detect: lines2d::detect_deeplsd,
        read: lines2d::read_deeplsd,
    },
    ImportFormat {
        name: "limap",
        title: "LIMAP segments",
        holds: "line segments",
        detect: lines2d::detect_limap,
        read: lines2d::read_limap,
    },
    ImportFormat {
        name: "narrations",
        title: "narrations (EPIC-KITCHENS, HD-EPIC, any): CSV or JSON lines",
        holds: "clips",
        detect: narrations::detect,
        read: narrations::read,
    },
    ImportFormat {
        name: "subtitles",
        title: "subtitles: SRT, WebVTT",
        holds: "clips",
        detect: subtitles::detect,
        read: subtitles::read,
    },
    ImportFormat {
        name: "cloud",
        title: "a static reconstruction: OBJ, PLY, glTF, CSV of points",
        holds: "points",
        detect: cloud::detect,
        read: cloud::read,
    },
    ImportFormat {
        name: "frames",
        title: "a folder of images, or a video file (mp4, mov)",
        holds: "images",
        detect: frames::detect,
        read: frames::read,
    },
];

/// The format of a name.
#[must_use]
pub fn named(name: &str) -> Option<&'static ImportFormat> {
    ALL.iter().find(|f| f.name == name)
}

/// What a file is that is not read, with the way out.
fn known(path: &Path) -> Option<&'static str> {
    if head(path, POINTER.0.len() as u64).as_bytes() == POINTER.0 {
        return Some(POINTER.1);
    }
    (ending(path) == "vrs").then_some(
        "VRS files are not read: pip install projectaria-tools pillow; python examples/import/aria_vrs.py FILE.vrs FOLDER/rgb, \
         then import FOLDER with the glasses' MPS results in it",
    )
}

/// The format that a path looks like.
///
/// # Errors
/// Where the path is not there or looks like none.
pub fn detect(path: &Path) -> Result<&'static ImportFormat> {
    if !path.exists() {
        return Err(Error::Io { path: path.to_owned(), message: "no such file or folder".to_owned() });
    }
    ALL.iter().find(|f| (f.detect)(path)).ok_or_else(|| {
        if let Some(what) = known(path) {
            return Error::Io { path: path.to_owned(), message: what.to_owned() };
        }
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
