//! The depth folder of the Aria Gen 2 pilot data: `pinhole_camera_parameters.json`, `depth/`, `rectified_images/`.
//!
//! Each image has its own pinhole camera with its own pose in the world. Depth is 16-bit millimetres; nothing says whether along
//! the ray or along the axis, so it is told from points of the reconstruction that the images show.

use std::path::{Path, PathBuf};

use serde_json::Value;

use super::aria_camera::{numbers, projection};
use crate::error::{Error, Result};
use crate::import::axes;
use crate::import::blob::{Blob, inside};
use crate::import::capture::{
    Along, At, Depth, DepthAt, DepthCoding, ImageAt, ImageSource, QuaternionOrder, RawPose, RawRotation,
};
use crate::import::decode;
use crate::import::optics::Optics;
use crate::math::{Point, Pose, Vector, stats};

/// The list of cameras.
pub(super) const LIST: &str = "pinhole_camera_parameters.json";
/// Depth images that are compared with the points.
const LOOKED_AT: usize = 12;
/// Where distance and depth differ by less than this share, noise decides.
const LEAST_SLANT: f64 = 1.05;
/// Points that a decision needs.
const LEAST_POINTS: usize = 100;
/// Depth that is off by more than this share shows another surface.
const SAME_SURFACE: f64 = 0.3;

/// An image of the stereo camera.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct StereoImage {
    /// Seconds of the glasses' clock.
    pub time_secs: f64,
    /// The camera in the world.
    pub world_from_camera: Pose,
    /// The camera.
    pub optics: Optics,
    /// Its depth.
    depth: Option<PathBuf>,
    /// Its grey image.
    image: Option<PathBuf>,
}

impl StereoImage {
    /// Whether its grey image is there.
    pub fn has_image(&self) -> bool {
        self.image.is_some()
    }
}

/// Reads the list of a folder.
///
/// # Errors
/// With the entry that is not what it should be, or where no entry has a file.
pub(super) fn read(folder: &Path) -> Result<Vec<StereoImage>> {
    let path = folder.join(LIST);
    let json: Value = crate::json::read(&path)?;
    let Some(list) = json.as_array() else {
        return Err(Error::format(&path, "content", "expected a list of cameras, one for each depth image"));
    };
    let mut out = Vec::new();
    let mut size: Option<[usize; 2]> = None;
    for (i, entry) in list.iter().enumerate() {
        let index = entry["index"].as_u64().unwrap_or(i as u64);
        let depth = inside(folder, &format!("depth/depth_{index:08}.png"))?;
        let image = inside(folder, &format!("rectified_images/image_{index:08}.png"))?;
        let Some(file) = depth.as_ref().or(image.as_ref()) else { continue };
        if size.is_none() {
            size = image::image_dimensions(file).ok().map(|(w, h)| [w as usize, h as usize]);
        }
        let fault = |message: String| Error::format(&path, format!("[{i}]"), message);
        let size = size.ok_or_else(|| fault(format!("{} is no image that can be read", file.display())))?;
        let (time_secs, world_from_camera, optics) = camera(entry, size).map_err(fault)?;
        out.push(StereoImage { time_secs, world_from_camera, optics, depth, image });
    }
    if out.is_empty() {
        let message = format!("none of the images of its {} entries is in depth/ or rectified_images/", list.len());
        return Err(Error::format(&path, "entries", message));
    }
    Ok(out)
}

/// Time, pose and camera of an entry.
fn camera(entry: &Value, size: [usize; 2]) -> std::result::Result<(f64, Pose, Optics), String> {
    let time = entry["frameTimestampNs"].as_f64().ok_or("frameTimestampNs: expected a number of nanoseconds")?;
    let place = &entry["T_world_camera"];
    let (t, q) = (numbers(&place["Translation"])?, numbers(&place["QuaternionXYZW"])?);
    let ([x, y, z], [a, b, c, d]) = (t.as_slice(), q.as_slice()) else {
        return Err("T_world_camera: expected Translation [x, y, z] and QuaternionXYZW [x, y, z, w]".to_owned());
    };
    let turn = axes::quaternion([*a, *b, *c, *d], QuaternionOrder::Xyzw)
        .ok_or("T_world_camera: QuaternionXYZW has not the length 1")?;
    let pose = Pose::from_parts(Vector::new(*x, *y, *z).into(), turn);
    let model = entry["camera"]["ModelName"].as_str().unwrap_or_default();
    let optics = projection(model, &numbers(&entry["camera"]["Parameters"])?, size)?;
    Ok((time * 1e-9, pose, optics))
}

/// The depth stream, and in words what its values were found to measure. `None` where no image has depth.
pub(super) fn stream(seen: &[StereoImage], points: &[Point]) -> Option<(Depth, String)> {
    let item = |s: &StereoImage| {
        let pose = RawPose {
            position: s.world_from_camera.translation.vector.into(),
            turn: RawRotation::Quaternion(s.world_from_camera.rotation.coords.into()),
        };
        let blob = Blob::File(s.depth.clone()?);
        Some(DepthAt { at: At::time(s.time_secs), blob, confidence: None, optics: Some(s.optics), pose: Some(pose) })
    };
    let items: Vec<DepthAt> = seen.iter().filter_map(item).collect();
    let mut depth = Depth::of(DepthCoding::Png16 { unit_m: 1e-3 }, items);
    if depth.items.is_empty() {
        return None;
    }
    let (off_z, off_ray) = deviations(&depth, seen, points);
    let (z, ray) = (stats::median(&off_z), stats::median(&off_ray));
    let told = match (z, ray) {
        (Some(z), Some(ray)) if off_z.len() >= LEAST_POINTS && z.max(ray) > 1.25 * z.min(ray) => {
            depth.along = if ray < z { Along::Ray } else { Along::Z };
            let what = if ray < z { "the ray" } else { "the optical axis" };
            format!(
                "depth is along {what}: at {} slanted points it is off by {z:.3} as depth along the axis, by {ray:.3} as \
                     distance (median shares)",
                off_z.len()
            )
        }
        _ => "depth is taken to be along the optical axis, as no points show the difference".to_owned(),
    };
    Some((depth, told))
}

/// How far depth is off from the points, as a share, taken along the axis and along the ray; where the two differ.
fn deviations(depth: &Depth, seen: &[StereoImage], points: &[Point]) -> (Vec<f64>, Vec<f64>) {
    let with: Vec<(&StereoImage, &PathBuf)> = seen.iter().filter_map(|s| Some((s, s.depth.as_ref()?))).collect();
    let step = with.len().div_ceil(LOOKED_AT).max(1);
    let (mut off_z, mut off_ray) = (Vec::new(), Vec::new());
    for (s, file) in with.into_iter().step_by(step) {
        // An image that cannot be read is told when it is written.
        let Ok(grid) = decode::depth(&Blob::File(file.clone()), None, depth) else { continue };
        let optics = s.optics.resized(grid.width, grid.height);
        let camera_from_world = s.world_from_camera.inverse();
        for p in points {
            let p = camera_from_world * p;
            let range = p.coords.norm();
            if p.z < 0.1 || range < LEAST_SLANT * p.z {
                continue;
            }
            let Some(d) = optics.project(&p).and_then(|(u, v)| grid.nearest(u, v)).map(f64::from) else { continue };
            let (z, ray) = ((d / p.z - 1.0).abs(), (d / range - 1.0).abs());
            if d > 0.0 && z.min(ray) < SAME_SURFACE {
                off_z.push(z);
                off_ray.push(ray);
            }
        }
    }
    (off_z, off_ray)
}

/// The grey images, each with its camera.
pub(super) fn images(seen: &[StereoImage]) -> Vec<ImageAt> {
    let image = |s: &StereoImage| {
        let picture = ImageSource::Still(Blob::File(s.image.clone()?));
        Some(ImageAt { at: At::time(s.time_secs), picture, optics: Some(s.optics) })
    };
    seen.iter().filter_map(image).collect()
}
