//! EPIC-Fields: a JSON file a video with one camera, a pose an image and points, all of COLMAP.
//!
//! Poses are world to camera, `qw qx qy qz tx ty tz`, OpenCV axes; the scale is arbitrary, gravity unknown. Images are named
//! `frame_0000000080.jpg` by their number in the video.

use std::collections::BTreeMap;
use std::path::Path;

use serde::Deserialize;

use super::colmap_model::{self, Thinned};
use crate::error::{Error, Result};
use crate::import::ImportOptions;
use crate::import::capture::{At, Capture, Direction, Missing, PoseAt, Poses, QuaternionOrder, SourceWorld};
use crate::import::names::{ending, head, numbered, stem};
use crate::import::text::Unread;
use crate::math::Point;

#[derive(Deserialize)]
struct EpicFieldsFile {
    camera: EpicCamera,
    images: BTreeMap<String, Vec<f64>>,
    #[serde(default)]
    points: Vec<Vec<f64>>,
}

#[derive(Deserialize)]
struct EpicCamera {
    model: String,
    width: usize,
    height: usize,
    params: Vec<f64>,
}

pub(super) fn detect(path: &Path) -> bool {
    if !path.is_file() || ending(path) != "json" {
        return false;
    }
    let start = head(path, 4096);
    start.contains("\"camera\"") && start.contains("\"params\"") && start.contains("\"model\"")
}

pub(super) fn read(path: &Path, _options: &ImportOptions) -> Result<Capture> {
    let content: EpicFieldsFile = crate::json::read(path)?;
    let c = &content.camera;
    let optics =
        colmap_model::optics(&c.model, c.width, c.height, &c.params).map_err(|e| Error::format(path, "camera", e))?;
    let mut items = Vec::with_capacity(content.images.len());
    let mut unread = Unread::default();
    for (name, numbers) in &content.images {
        let whole: Option<[f64; 7]> = numbers.as_slice().try_into().ok();
        let whole = whole.filter(|n| n.iter().all(|x| x.is_finite())).ok_or_else(|| {
            let message = format!("{} numbers, expected qw qx qy qz tx ty tz", numbers.len());
            Error::format(path, format!("images.{name}"), message)
        });
        let Some(whole) = unread.keep(whole) else { continue };
        let mut at = At::name(name);
        if let Some((_, number)) = numbered(&stem(Path::new(name))) {
            at = at.with_index(number as usize);
        }
        items.push(PoseAt { at, pose: colmap_model::pose(whole), optics: None });
    }
    let dropped = unread.told("poses", items.len())?;
    if items.is_empty() {
        return Err(Error::format(path, "images", "none is registered; nothing to import"));
    }
    let mut points = Thinned::default();
    for p in &content.points {
        if let [x, y, z, ..] = p.as_slice() {
            points.push(Point::new(*x, *y, *z));
        }
    }
    Ok(Capture {
        kind: "epic-fields".to_owned(),
        source: path.to_owned(),
        title: "EPIC-Fields poses".to_owned(),
        licence: Some("CC BY-NC 4.0 (EPIC-KITCHENS)".to_owned()),
        dropped: dropped.into_iter().collect(),
        world: SourceWorld { up: None, unit_m: None, left_handed: false },
        optics: Some(optics),
        poses: Some(Poses {
            direction: Direction::CameraFromWorld,
            quaternion: QuaternionOrder::Wxyz,
            items,
            ..Poses::default()
        }),
        points: points.into_kept(),
        missing: vec![Missing {
            what: "images".to_owned(),
            why: "poses only; the images are EPIC-KITCHENS' own".to_owned(),
            command:
                "paws import VIDEO.json FRAMES narrations=EPIC_100_train.csv --out DIR, FRAMES being the folder of \
                      frame_0000000001.jpg and so on"
                    .to_owned(),
        }],
        ..Capture::default()
    })
}
