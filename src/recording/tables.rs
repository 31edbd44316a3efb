//! The tables of a recording as they stand in its files; nothing is judged here.

use std::collections::BTreeMap;
use std::path::Path;

use serde::Deserialize;

use super::{Clip, Side};
use crate::error::{Error, Result};
use crate::json;

/// Thumb, index and middle tips in MANO/OpenPose order.
pub(crate) const TIP_JOINTS: [usize; 3] = [4, 8, 12];

/// `cameras.json`.
#[derive(Deserialize)]
pub(crate) struct CamerasFile {
    pub width: usize,
    pub height: usize,
    pub fx: f64,
    pub fy: f64,
    pub cx: f64,
    pub cy: f64,
    pub frames: Vec<FrameEntry>,
    #[serde(default)]
    pub units: Option<String>,
    #[serde(default)]
    pub distortion: Option<serde_json::Value>,
}

/// A frame in it.
#[derive(Deserialize)]
pub(crate) struct FrameEntry {
    pub frame: usize,
    #[serde(default)]
    pub file: Option<String>,
    pub timestamp: f64,
    pub position: [f64; 3],
    pub rotation_wxyz: [f64; 4],
}

/// `clips.json`.
#[derive(Deserialize)]
pub(crate) struct ClipsFile {
    pub clips: Vec<Clip>,
}

/// `hands.json`.
#[derive(Deserialize)]
pub(crate) struct HandsFile {
    pub frames: Vec<HandsFrame>,
}

/// The hands of a frame in it.
#[derive(Deserialize)]
pub(crate) struct HandsFrame {
    pub frame: usize,
    pub hands: Vec<HandEntry>,
}

/// A hand.
#[derive(Deserialize)]
pub(crate) struct HandEntry {
    pub side: Side,
    #[serde(default)]
    pub contact: Option<bool>,
    /// The detector's confidence, 0 to 1; whatever else stands there is none.
    #[serde(default)]
    pub score: Option<serde_json::Value>,
    pub joints_world: Vec<[f64; 3]>,
}

/// `labels.json`: mask classes and their names; empty where the folder has none.
pub(crate) fn labels(dir: &Path) -> Result<BTreeMap<u8, String>> {
    let path = dir.join("labels.json");
    if !path.is_file() {
        return Ok(BTreeMap::new());
    }
    let raw: BTreeMap<String, String> = json::read(&path)?;
    raw.into_iter()
        .map(|(class, name)| match class.parse::<u8>() {
            Ok(class) => Ok((class, name)),
            Err(_) => Err(Error::format(&path, format!("key \"{class}\""), "classes are numbers 1 to 255")),
        })
        .collect()
}
