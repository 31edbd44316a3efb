//! Polycam's raw data (iPhone, iPad with LiDAR): `keyframes/` with a camera, an image and depth for each time, microseconds.
//!
//! Corrected cameras and images are taken where both are there. ARKit's world (y up), cameras with OpenGL axes, depth in
//! millimetres; confidence is 0, 127 or 255.

use std::path::{Path, PathBuf};

use serde::Deserialize;

use crate::error::{Error, Result};
use crate::import::ImportOptions;
use crate::import::blob::{Blob, files, inside};
use crate::import::capture::{
    At, CameraAxes, Capture, Depth, DepthAt, DepthCoding, ImageAt, ImageSource, PoseAt, Poses, RawPose, RawRotation,
    SourceWorld,
};
use crate::import::optics::Optics;
use crate::math::Vector;

/// Between "low" and "medium": low is noise at edges and on dark surfaces.
const LEAST_CONFIDENCE: u8 = 64;
/// Key frames that are this far apart show no motion, seconds.
const SPARSE_SECS: f64 = 0.5;

fn keyframes(path: &Path) -> PathBuf {
    if path.join("cameras").is_dir() { path.to_owned() } else { path.join("keyframes") }
}

pub(super) fn detect(path: &Path) -> bool {
    let folder = keyframes(path);
    let has = |name: &str| folder.join(name).is_dir();
    (has("cameras") || has("corrected_cameras")) && (has("images") || has("corrected_images"))
}

/// A file of a camera. Its other numbers (blur, neighbours) are not needed.
#[derive(Deserialize)]
struct PolycamCamera {
    fx: f64,
    fy: f64,
    cx: f64,
    cy: f64,
    width: usize,
    height: usize,
    t_00: f64,
    t_01: f64,
    t_02: f64,
    t_03: f64,
    t_10: f64,
    t_11: f64,
    t_12: f64,
    t_13: f64,
    t_20: f64,
    t_21: f64,
    t_22: f64,
    t_23: f64,
}

impl PolycamCamera {
    fn optics(&self) -> Optics {
        Optics::pinhole(self.width, self.height, [self.fx, self.fy, self.cx, self.cy])
    }

    fn pose(&self) -> RawPose {
        RawPose {
            position: [self.t_03, self.t_13, self.t_23],
            turn: RawRotation::Matrix([
                [self.t_00, self.t_01, self.t_02],
                [self.t_10, self.t_11, self.t_12],
                [self.t_20, self.t_21, self.t_22],
            ]),
        }
    }
}

pub(super) fn read(path: &Path, _options: &ImportOptions) -> Result<Capture> {
    let root = keyframes(path);
    let is_corrected = ["corrected_cameras", "corrected_images"].iter().all(|n| root.join(n).is_dir());
    let (cameras, pictures) =
        if is_corrected { ("corrected_cameras", "corrected_images") } else { ("cameras", "images") };
    let listed = files(&root.join(cameras), &["json"]);
    let (mut poses, mut images, mut depth) = (Vec::new(), Vec::new(), Vec::new());
    let mut first_fault: Option<Error> = None;
    let mut faults = 0;
    for file in &listed {
        let camera: PolycamCamera = match crate::json::read(file) {
            Ok(camera) => camera,
            Err(error) => {
                faults += 1;
                first_fault.get_or_insert(error);
                continue;
            }
        };
        let stem = file.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let time_secs = stem.parse::<f64>().ok().map(|us| 1e-6 * us).filter(|t| t.is_finite());
        let at = At { time_secs, name: Some(stem.clone()), index: None };
        let optics = Some(camera.optics());
        poses.push(PoseAt { at: at.clone(), pose: camera.pose(), optics });
        if let Some(image) = inside(&root, &format!("{pictures}/{stem}.jpg"))? {
            images.push(ImageAt { at: at.clone(), picture: ImageSource::Still(Blob::File(image)), optics });
        }
        if let Some(image) = inside(&root, &format!("depth/{stem}.png"))? {
            let confidence = inside(&root, &format!("confidence/{stem}.png"))?.map(Blob::File);
            depth.push(DepthAt { at, blob: Blob::File(image), confidence, optics, pose: None });
        }
    }
    if poses.is_empty() {
        let none = || Error::format(&root.join(cameras), "files", "there is no camera; export \"raw data\" in the app");
        return Err(first_fault.unwrap_or_else(none));
    }
    let mut notes = Vec::new();
    if !is_corrected {
        notes.push("there are no corrected cameras: ARKit's own poses drift".to_owned());
    }
    if let Some(error) = first_fault {
        notes.push(format!("{faults} cameras cannot be read, the first one: {error}"));
    }
    notes.extend(sparse(&poses));
    let optics = poses.first().and_then(|p: &PoseAt| p.optics);
    Ok(Capture {
        kind: "polycam".to_owned(),
        source: path.to_owned(),
        title: "Polycam raw data".to_owned(),
        notes,
        world: SourceWorld { up: Some(Vector::y()), ..SourceWorld::default() },
        optics,
        poses: Some(Poses { axes: CameraAxes::Opengl, items: poses, ..Poses::default() }),
        images,
        depth: (!depth.is_empty()).then_some(Depth {
            least_confidence: LEAST_CONFIDENCE,
            ..Depth::of(DepthCoding::Png16 { unit_m: 1e-3 }, depth)
        }),
        ..Capture::default()
    })
}

/// A warning where the key frames are too far apart to show a hand at work.
fn sparse(poses: &[PoseAt]) -> Option<String> {
    let period = crate::import::join::half_period(poses.iter().filter_map(|p| p.at.time_secs))? * 2.0;
    (period > SPARSE_SECS).then(|| {
        format!("key frames are {period:.1} s apart: record a scan with automatic shutter, or the motion is not seen")
    })
}
