//! Joints of other data sets and programs: a truth to measure against, or joints to build and to replay.
//!
//! A reader turns one JSON file into a [`JointScene`]: metres and radians in the file's own frame, unit axes. What is wrong with
//! one joint costs that joint, with place and reason ([`JointScene::left_out`]); an error is what makes the file unusable.
//! Formats are told from what files hold.

mod arti4d;
mod artipoint;
mod found;
mod mobility;
mod multiscan;
mod ours;
mod s2o;
mod scenefun3d;
pub mod shape;
mod stk;
mod yaml;

pub use found::{FoundJoint, JointOptions, JointScene, JointSource, UnusableJoint};

use std::path::{Path, PathBuf};

use serde_json::Value;

use super::blob;
use crate::error::{Error, Result};
use crate::json;

/// A format.
#[derive(Clone, Copy)]
pub struct JointFormat {
    /// Its name on the command line.
    pub name: &'static str,
    /// What it is, for people.
    pub title: &'static str,
    /// Whether a file holds it.
    pub detect: fn(&Value) -> bool,
    /// Reads a file.
    pub read: fn(&JointSource<'_>) -> Result<JointScene>,
}

/// All formats. Where several fit, the first one is taken.
pub const ALL: &[JointFormat] = &[
    JointFormat {
        name: "paws",
        title: "joints.json, articulations.json, twin.json",
        detect: ours::detect,
        read: ours::read,
    },
    JointFormat {
        name: "artipoint",
        title: "ArtiPoint, axis_info.json or the folder of its segments",
        detect: artipoint::detect,
        read: artipoint::read,
    },
    JointFormat {
        name: "multiscan",
        title: "MultiScan, SCAN.annotations.json (parts from SCAN.ply)",
        detect: multiscan::detect,
        read: multiscan::read,
    },
    JointFormat {
        name: "scenefun3d",
        title: "SceneFun3D, VISIT_motions.json (with VISIT_laser_scan.ply)",
        detect: scenefun3d::detect,
        read: scenefun3d::read,
    },
    JointFormat {
        name: "articulate3d",
        title: "Articulate3D, USDNet, S2O: SCENE_articulation.json, MODEL.art-stk.json",
        detect: stk::detect,
        read: stk::read,
    },
    JointFormat {
        name: "mobility",
        title: "PartNet-Mobility, mobility_v2.json (parts from result.json and textured_objs)",
        detect: mobility::detect,
        read: mobility::read,
    },
    JointFormat { name: "s2o", title: "S2O's and OPD's predicted motions", detect: s2o::detect, read: s2o::read },
    JointFormat {
        name: "arti4d",
        title: "Arti4D, SEQUENCE.json (types from metadata.yaml)",
        detect: arti4d::detect,
        read: arti4d::read,
    },
];

/// The names of all formats, for people.
#[must_use]
pub fn names() -> String {
    ALL.iter().map(|f| f.name).collect::<Vec<_>>().join(", ")
}

/// The format of a name.
///
/// # Errors
/// Where there is none, with those that are.
pub fn named(name: &str) -> Result<&'static JointFormat> {
    ALL.iter()
        .find(|f| f.name == name)
        .ok_or_else(|| Error::Config(format!("\"{name}\" is no format of joints; there are {}", names())))
}

/// The format that a file's content has.
#[must_use]
pub fn detect(value: &Value) -> Option<&'static JointFormat> {
    ALL.iter().find(|f| (f.detect)(value))
}

/// Files of a folder that are looked at; more are no folder of joints.
const MAX_FILES: usize = 10_000;
/// Larger files of a folder are not looked at, bytes: those that list the points of parts are smaller.
const MAX_FILE_BYTES: u64 = 256 << 20;

/// The JSON files of a folder, and of the folders in it that ArtiPoint makes.
fn files(folder: &Path) -> Vec<PathBuf> {
    let mut out = blob::files(folder, &["json"]);
    let segments =
        std::fs::read_dir(folder).into_iter().flatten().filter_map(|e| Some(e.ok()?.path().join("axis_info.json")));
    let mut segments: Vec<PathBuf> = segments.filter(|p| p.is_file()).collect();
    // segment_10 stands behind segment_9.
    segments.sort_by_key(|p| (p.as_os_str().len(), p.clone()));
    out.extend(segments);
    out.truncate(MAX_FILES);
    out.retain(|p| std::fs::metadata(p).is_ok_and(|m| m.len() <= MAX_FILE_BYTES));
    out
}

/// Whether a path holds joints of one of the formats. What cannot be read is for its reader to tell.
#[must_use]
pub fn holds(path: &Path) -> bool {
    if path.is_dir() {
        return files(path).iter().any(|p| json::read::<Value>(p).is_ok_and(|v| detect(&v).is_some()));
    }
    path.is_file() && json::read::<Value>(path).is_ok_and(|v| detect(&v).is_some())
}

/// Reads the joints of a file; of a folder those of all its files of the first format that one of them has.
///
/// # Errors
/// Where nothing can be read, no format fits, or no joint can be used.
pub fn read(path: &Path, format: Option<&str>, options: &JointOptions) -> Result<JointScene> {
    let forced = format.map(named).transpose()?;
    let mut values = Vec::new();
    let mut broken = Vec::new();
    if path.is_dir() {
        for file in files(path) {
            match json::read::<Value>(&file) {
                Ok(value) => values.push((file, value)),
                Err(error) => broken.push(UnusableJoint { place: shown(&file), reason: error.to_string() }),
            }
        }
    } else {
        values.push((path.to_owned(), json::read(path)?));
    }
    let found = ALL.iter().find(|f| values.iter().any(|(_, v)| (f.detect)(v)));
    let Some(format) = forced.or(found) else {
        let message =
            format!("holds no joints of a format that is read ({}); docs/joints-format.md says more", names());
        return Err(Error::Io { path: path.to_owned(), message });
    };
    if path.is_dir() {
        values.retain(|(_, value)| (format.detect)(value));
    }
    let mut scene = JointScene::empty(path, format.name);
    scene.left_out = broken;
    for (file, value) in &values {
        let one = (format.read)(&JointSource { path: file, value, options })?;
        scene.up = one.up;
        if path.is_file() {
            scene.name.clone_from(&one.name);
        }
        scene.joints.extend(one.joints);
        scene.left_out.extend(one.left_out);
        for note in one.notes {
            if !scene.notes.contains(&note) {
                scene.notes.push(note);
            }
        }
    }
    if scene.joints.is_empty() {
        let (place, reason) = match scene.left_out.first() {
            Some(left) => (left.place.clone(), left.reason.clone()),
            None => ("joints".to_owned(), "there are none".to_owned()),
        };
        return Err(Error::format(path, place, reason));
    }
    scene.name_joints();
    Ok(scene)
}

/// A file's name, for people.
fn shown(path: &Path) -> String {
    path.file_name().map_or_else(|| path.display().to_string(), |n| n.to_string_lossy().into_owned())
}
