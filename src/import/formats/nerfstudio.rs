//! nerfstudio (and instant-ngp, Blender's NeRF sets): `transforms.json`, or the folder with it.
//!
//! Matrices are camera to world, OpenGL cameras; principal points count from the corner of the first pixel. Intrinsics are of
//! all images or of each. Neither unit nor up are in the file; where it names depth images (16 bits, millimetres) their unit is
//! the poses' too.

use std::path::{Path, PathBuf};

use serde_json::Value;

use super::cloud;
use crate::error::{Error, Result};
use crate::import::ImportOptions;
use crate::import::blob::{Blob, inside};
use crate::import::capture::{
    At, CameraAxes, Capture, Depth, DepthAt, DepthCoding, ImageAt, ImageSource, Missing, PoseAt, Poses, RawPose,
    SourceWorld,
};
use crate::import::names::{ending, head};
use crate::import::optics::{LensModel, Optics, from_corner};
use crate::import::text::Unread;

/// Endings that Blender's sets leave out.
const ENDINGS: [&str; 4] = ["", ".png", ".jpg", ".jpeg"];

/// Intrinsics as far as they are there.
#[derive(Clone, Default)]
struct NerfIntrinsics {
    camera_model: Option<String>,
    is_fisheye: Option<bool>,
    w: Option<f64>,
    h: Option<f64>,
    fl_x: Option<f64>,
    fl_y: Option<f64>,
    cx: Option<f64>,
    cy: Option<f64>,
    camera_angle_x: Option<f64>,
    k1: Option<f64>,
    k2: Option<f64>,
    k3: Option<f64>,
    k4: Option<f64>,
    p1: Option<f64>,
    p2: Option<f64>,
}

fn file(path: &Path) -> PathBuf {
    if path.is_dir() { path.join("transforms.json") } else { path.to_owned() }
}

pub(super) fn detect(path: &Path) -> bool {
    let file = file(path);
    file.is_file() && ending(&file) == "json" && head(&file, 1 << 16).contains("\"transform_matrix\"")
}

pub(super) fn read(path: &Path, _options: &ImportOptions) -> Result<Capture> {
    let file = file(path);
    let content: Value = crate::json::read(&file)?;
    let root = file.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or_else(|| Path::new("."));
    let of_all = NerfIntrinsics::of(&content).map_err(|e| Error::format(&file, "intrinsics", e))?;
    let frames = frames(&content, &file)?;
    let (mut items, mut images, mut depth) = (Vec::new(), Vec::new(), Vec::new());
    let mut unread = Unread::default();
    for (name, frame) in &frames {
        let fault = |message: String| {
            Error::format(&file, format!("frame {}", name.chars().take(80).collect::<String>()), message)
        };
        let found = image(root, name)?;
        let posed = placed(frame, &of_all, found.as_deref()).map_err(fault);
        let Some((pose, optics)) = unread.keep(posed) else { continue };
        let at = At::name(name);
        items.push(PoseAt { at: at.clone(), pose, optics });
        if let Some(found) = found {
            images.push(ImageAt { at: at.clone(), picture: ImageSource::Still(Blob::File(found)), optics });
        }
        if let Some(name) = frame.get("depth_file_path").and_then(Value::as_str)
            && let Some(found) = inside(root, name)?
        {
            depth.push(DepthAt { at, blob: Blob::File(found), confidence: None, optics: None, pose: None });
        }
    }
    let dropped = unread.told("frames", items.len())?;
    let points = match content.get("ply_file_path").and_then(Value::as_str) {
        Some(name) => inside(root, name)?.map(|p| cloud::points(&p)).transpose()?.unwrap_or_default(),
        None => Vec::new(),
    };
    let has_depth = !depth.is_empty();
    let unit_m = depth_unit(&content, &file)?;
    let missing = images.is_empty().then(|| Missing {
        what: "images".to_owned(),
        why: "none of the images that transforms.json names lies beside it".to_owned(),
        command: "paws import transforms.json IMAGES --out DIR".to_owned(),
    });
    let notes = notes(frames.len(), images.len(), has_depth);
    Ok(Capture {
        kind: "nerfstudio".to_owned(),
        source: path.to_owned(),
        title: "nerfstudio transforms.json".to_owned(),
        notes,
        dropped: dropped.into_iter().collect(),
        world: SourceWorld { up: None, unit_m: has_depth.then_some(1.0), left_handed: false },
        optics: items.first().and_then(|i: &PoseAt| i.optics),
        poses: Some(Poses { axes: CameraAxes::Opengl, items, ..Poses::default() }),
        images,
        depth: has_depth.then_some(Depth::of(DepthCoding::Png16 { unit_m }, depth)),
        points,
        missing: missing.into_iter().collect(),
        ..Capture::default()
    })
}

/// Metres per count of the depth images.
fn depth_unit(content: &Value, file: &Path) -> Result<f64> {
    let unit_m = content.get("depth_unit_scale_factor").and_then(Value::as_f64).unwrap_or(1e-3);
    if !(unit_m.is_finite() && unit_m > 0.0) {
        return Err(Error::format(file, "depth_unit_scale_factor", format!("{unit_m} is no unit; write 0.001 for mm")));
    }
    Ok(unit_m)
}

/// What a user should know; `images` of `frames` images are there.
fn notes(frames: usize, images: usize, has_depth: bool) -> Vec<String> {
    let mut notes = Vec::new();
    if images > 0 && images < frames {
        notes.push(format!("{} of {frames} images that transforms.json names are not there", frames - images));
    }
    notes.push(if has_depth {
        "world in metres, as the depth images that transforms.json names; up is not told (--up z where it is z)"
            .to_owned()
    } else {
        "neither unit nor up are told: --unit 1 --up z where it was made of poses in metres with z up".to_owned()
    });
    notes
}

/// The pose and the camera of a frame.
fn placed(
    frame: &Value,
    of_all: &NerfIntrinsics,
    image: Option<&Path>,
) -> std::result::Result<(RawPose, Option<Optics>), String> {
    let optics = NerfIntrinsics::of(frame)?.over(of_all).optics(image)?;
    let pose = frame.get("transform_matrix").and_then(matrix);
    pose.map(|pose| (pose, optics)).ok_or_else(|| "transform_matrix must be 4 rows of 4 finite numbers".to_owned())
}

/// The image that a frame names, its ending given or not.
fn image(root: &Path, name: &str) -> Result<Option<PathBuf>> {
    for ending in ENDINGS {
        if let Some(found) = inside(root, &format!("{name}{ending}"))?
            && found.is_file()
        {
            return Ok(Some(found));
        }
    }
    Ok(None)
}

/// Frames by the names of their images.
fn frames<'a>(content: &'a Value, file: &Path) -> Result<Vec<(&'a str, &'a Value)>> {
    let Some(list) = content.get("frames").and_then(Value::as_array).filter(|l| !l.is_empty()) else {
        return Err(Error::format(file, "frames", "must be a list of images with their poses, and holds none"));
    };
    let mut out = Vec::with_capacity(list.len());
    for (i, frame) in list.iter().enumerate() {
        let Some(name) = frame.get("file_path").and_then(Value::as_str) else {
            return Err(Error::format(file, format!("frames[{i}]"), "file_path, the image's name, is not there"));
        };
        out.push((name, frame));
    }
    out.sort_by(|a, b| a.0.cmp(b.0));
    Ok(out)
}

fn matrix(rows: &Value) -> Option<RawPose> {
    let rows = rows.as_array()?;
    let mut numbers = Vec::new();
    let mut is_whole = (3..=4).contains(&rows.len());
    for row in rows {
        let row = row.as_array()?;
        is_whole &= row.len() == 4;
        for value in row {
            numbers.push(value.as_f64()?);
        }
    }
    if !is_whole || numbers.iter().any(|x| !x.is_finite()) {
        return None;
    }
    RawPose::from_rows(&numbers)
}

impl NerfIntrinsics {
    /// Those that stand in an object.
    fn of(value: &Value) -> std::result::Result<Self, String> {
        let given = |key: &str| value.get(key).filter(|v| !v.is_null());
        let number = |key: &str| match given(key) {
            None => Ok(None),
            Some(v) => v.as_f64().map(Some).ok_or_else(|| format!("{key} must be a number")),
        };
        Ok(Self {
            camera_model: given("camera_model").and_then(Value::as_str).map(str::to_owned),
            is_fisheye: given("is_fisheye").and_then(Value::as_bool),
            w: number("w")?,
            h: number("h")?,
            fl_x: number("fl_x")?,
            fl_y: number("fl_y")?,
            cx: number("cx")?,
            cy: number("cy")?,
            camera_angle_x: number("camera_angle_x")?,
            k1: number("k1")?,
            k2: number("k2")?,
            k3: number("k3")?,
            k4: number("k4")?,
            p1: number("p1")?,
            p2: number("p2")?,
        })
    }

    /// These, and what they lack from others.
    fn over(&self, other: &Self) -> Self {
        Self {
            camera_model: self.camera_model.clone().or_else(|| other.camera_model.clone()),
            is_fisheye: self.is_fisheye.or(other.is_fisheye),
            w: self.w.or(other.w),
            h: self.h.or(other.h),
            fl_x: self.fl_x.or(other.fl_x),
            fl_y: self.fl_y.or(other.fl_y),
            cx: self.cx.or(other.cx),
            cy: self.cy.or(other.cy),
            camera_angle_x: self.camera_angle_x.or(other.camera_angle_x),
            k1: self.k1.or(other.k1),
            k2: self.k2.or(other.k2),
            k3: self.k3.or(other.k3),
            k4: self.k4.or(other.k4),
            p1: self.p1.or(other.p1),
            p2: self.p2.or(other.p2),
        }
    }

    /// The camera; `None` where the file does not tell it. The size is the image's where it is not told.
    fn optics(&self, image: Option<&Path>) -> std::result::Result<Option<Optics>, String> {
        let size = match (self.w, self.h) {
            (Some(w), Some(h)) => Some((w, h)),
            _ => image.and_then(|file| image::image_dimensions(file).ok()).map(|(w, h)| (f64::from(w), f64::from(h))),
        };
        let Some((w, h)) = size else { return Ok(None) };
        let by_angle = self.camera_angle_x.map(|angle| 0.5 * w / (0.5 * angle).tan());
        let Some(fx) = self.fl_x.or(by_angle) else { return Ok(None) };
        let fy = self.fl_y.unwrap_or(fx);
        let [k1, k2, k3, k4, p1, p2] = [self.k1, self.k2, self.k3, self.k4, self.p1, self.p2].map(|k| k.unwrap_or(0.0));
        let is_straight = [k1, k2, k3, k4, p1, p2].iter().all(|k| *k == 0.0);
        let model = self.camera_model.as_deref().unwrap_or("OPENCV");
        let lens = match model {
            _ if self.is_fisheye == Some(true) => LensModel::Fisheye { k: [k1, k2, k3, k4] },
            "OPENCV_FISHEYE" => LensModel::Fisheye { k: [k1, k2, k3, k4] },
            "PINHOLE" | "SIMPLE_PINHOLE" => LensModel::Pinhole,
            "OPENCV" | "FULL_OPENCV" | "RADIAL" | "SIMPLE_RADIAL" if is_straight => LensModel::Pinhole,
            "OPENCV" | "FULL_OPENCV" | "RADIAL" | "SIMPLE_RADIAL" => {
                // Of the models here only the fisheye has a k4.
                LensModel::OpenCv { k: [k1, k2, k3, 0.0, 0.0, 0.0], p: [p1, p2] }
            }
            other => {
                let other: String = other.chars().take(40).collect();
                return Err(format!("the camera model {other} is not read; write the images undistorted, as PINHOLE"));
            }
        };
        let center = |c: Option<f64>, size: f64| from_corner(c.unwrap_or(0.5 * size));
        let optics = Optics {
            width: w.max(0.0) as usize,
            height: h.max(0.0) as usize,
            fx,
            fy,
            cx: center(self.cx, w),
            cy: center(self.cy, h),
            lens,
        };
        optics.fault().map_or(Ok(Some(optics)), Err)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn intrinsics(text: &str) -> NerfIntrinsics {
        NerfIntrinsics::of(&serde_json::from_str(text).unwrap()).unwrap()
    }

    #[test]
    fn a_frames_own_intrinsics_stand_over_the_files() {
        let file = intrinsics(r#"{"w": 640, "h": 480, "fl_x": 400.0, "cx": 320, "cy": 240, "k1": 0.1}"#);
        let frame = intrinsics(r#"{"fl_x": 500, "fl_y": 510}"#);
        let optics = frame.over(&file).optics(None).unwrap().unwrap();
        assert_eq!((optics.fx, optics.fy, optics.cx), (500.0, 510.0, 319.5));
        assert!(matches!(optics.lens, LensModel::OpenCv { .. }));
        let blender = intrinsics(r#"{"w": 800, "h": 800, "camera_angle_x": 1.5707963267948966}"#);
        let optics = blender.optics(None).unwrap().unwrap();
        assert!((optics.fx - 400.0).abs() < 1e-9 && optics.lens == LensModel::Pinhole);
        assert!(intrinsics("{}").optics(None).unwrap().is_none());
        let other = intrinsics(r#"{"w": 8, "h": 8, "fl_x": 400, "camera_model": "EQUIRECTANGULAR"}"#);
        assert!(other.optics(None).unwrap_err().contains("undistorted"));
    }

    #[test]
    fn matrices_are_whole_or_none() {
        let read = |text: &str| matrix(&serde_json::from_str(text).unwrap());
        assert!(read("[[1, 0, 0, 2], [0, 1, 0, 2], [0, 0, 1, 2]]").is_some());
        for text in [
            "[[1, 0, 0, 2], [0, 1, 0, 2]]",
            "[[1, 0, 0, 2], [0, 1, 0, 2], [0, 0, 1]]",
            "[[1, 0, 0, 2], [0, 1, 0, 2], [0, 0, \"1\", 2]]",
            "3",
        ] {
            assert!(read(text).is_none(), "{text}");
        }
        assert!(NerfIntrinsics::of(&serde_json::json!({"fl_x": "wide"})).err().unwrap().contains("fl_x"));
    }
}
