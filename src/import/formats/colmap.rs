//! COLMAP: `cameras`, `images` and `points3D`, `.bin` or `.txt`; the folder itself, or one with `sparse/0` or `sparse` in it.
//!
//! Poses are world to camera, OpenCV axes, quaternions w x y z; the scale is arbitrary and gravity unknown. Principal points
//! count from the corner of the first pixel. Observations of points are passed over, so memory is that of poses and points.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use super::colmap_binary;
use crate::error::{Error, Result};
use crate::import::Options;
use crate::import::blob::{Blob, inside};
use crate::import::capture::{
    At, Capture, Direction, ImageAt, Missing, Picture, PoseAt, Poses, QuaternionOrder, RawPose, Turn, World,
};
use crate::import::optics::{Lens, Optics, from_corner};
use crate::import::text::{Lines, cells};
use crate::math::Point;

/// Points that are kept; of more, every second one, fourth one, and so on.
const MAX_POINTS: usize = 1_000_000;

/// Cameras by their number.
pub(super) type Cameras = BTreeMap<u64, Optics>;

/// The folder with the model, and its ending.
fn model(path: &Path) -> Option<(PathBuf, &'static str)> {
    // COLMAP itself prefers binary files where both are there.
    let of = |folder: PathBuf| {
        let has = |ending: &str| ["cameras", "images"].iter().all(|n| folder.join(format!("{n}.{ending}")).is_file());
        let ending = ["bin", "txt"].into_iter().find(|e| has(e))?;
        Some((folder, ending))
    };
    [path.to_owned(), path.join("sparse/0"), path.join("sparse")].into_iter().find_map(of)
}

pub(super) fn detect(path: &Path) -> bool {
    model(path).is_some()
}

pub(super) fn read(path: &Path, _options: &Options) -> Result<Capture> {
    let Some((folder, ending)) = model(path) else {
        let message =
            "holds no cameras and images (.bin or .txt), nor does its sparse/0; point at the folder of one model";
        return Err(Error::Io { path: path.to_owned(), message: message.to_owned() });
    };
    let file = |name: &str| folder.join(format!("{name}.{ending}"));
    let points_file = file("points3D");
    let mut points = Thinned::default();
    let (cameras, posed) = if ending == "bin" {
        let cameras = colmap_binary::cameras(&file("cameras"))?;
        let posed = colmap_binary::images(&file("images"))?;
        if points_file.is_file() {
            colmap_binary::points(&points_file, &mut points)?;
        }
        (cameras, posed)
    } else {
        let cameras = text_cameras(&file("cameras"))?;
        let posed = text_images(&file("images"))?;
        if points_file.is_file() {
            text_points(&points_file, &mut points)?;
        }
        (cameras, posed)
    };
    if posed.is_empty() {
        return Err(Error::format(
            &file("images"),
            "images",
            "none is registered; is this the folder of the largest model?",
        ));
    }
    let mut items = Vec::with_capacity(posed.len());
    let mut images = Vec::new();
    for image in posed {
        let Some(optics) = cameras.get(&image.camera).copied() else {
            let message = format!("its camera {} is not among the cameras", image.camera);
            return Err(Error::format(&file("images"), format!("image {}", image.name), message));
        };
        let at = At::name(&image.name);
        if let Some(found) = inside(path, &format!("images/{}", image.name))? {
            let picture = Picture::Still(Blob::File(found));
            images.push(ImageAt { at: at.clone(), picture, optics: Some(optics) });
        }
        items.push(PoseAt { at, pose: image.pose, optics: Some(optics) });
    }
    // Videos' frames are numbered by their names, which is the order that they were taken in.
    images.sort_by(|a, b| a.at.name.cmp(&b.at.name));
    let optics = items.first().and_then(|i| i.optics);
    let missing = images.is_empty().then(|| Missing {
        what: "images".to_owned(),
        why: "the model's folder has no images/ with the pictures that it names".to_owned(),
        command: "paws import IMAGES MODEL --out DIR, IMAGES being the folder or video that COLMAP was run on"
            .to_owned(),
    });
    Ok(Capture {
        kind: "colmap".to_owned(),
        source: path.to_owned(),
        title: "COLMAP reconstruction".to_owned(),
        world: World { up: None, unit_m: None, left_handed: false },
        optics,
        poses: Some(Poses {
            direction: Direction::CameraFromWorld,
            quaternion: QuaternionOrder::Wxyz,
            items,
            ..Poses::default()
        }),
        images,
        points: points.kept,
        missing: missing.into_iter().collect(),
        ..Capture::default()
    })
}

/// A registered image.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Posed {
    /// World to camera.
    pub pose: RawPose,
    /// Number of the camera.
    pub camera: u64,
    /// Name, with folders.
    pub name: String,
}

/// A pose from `qw qx qy qz tx ty tz`.
pub(super) fn pose([qw, qx, qy, qz, x, y, z]: [f64; 7]) -> RawPose {
    RawPose { position: [x, y, z], turn: Turn::Quaternion([qw, qx, qy, qz]) }
}

/// Points, evenly thinned as they come so that never more than twice the most are held.
#[derive(Debug, Default)]
pub(super) struct Thinned {
    kept: Vec<Point>,
    step: usize,
    seen: usize,
}

impl Thinned {
    /// The points that were kept.
    pub fn into_points(self) -> Vec<Point> {
        self.kept
    }

    /// One more point.
    pub fn push(&mut self, p: Point) {
        self.step = self.step.max(1);
        if self.seen.is_multiple_of(self.step) && p.iter().all(|x| x.is_finite()) {
            self.kept.push(p);
        }
        self.seen += 1;
        if self.kept.len() >= 2 * MAX_POINTS {
            let mut index = 0;
            self.kept.retain(|_| {
                index += 1;
                index % 2 == 1
            });
            self.step *= 2;
        }
    }
}

/// Names of the models by their number in binary files, with how many parameters each has.
pub(super) const MODELS: [(&str, usize); 12] = [
    ("SIMPLE_PINHOLE", 3),
    ("PINHOLE", 4),
    ("SIMPLE_RADIAL", 4),
    ("RADIAL", 5),
    ("OPENCV", 8),
    ("OPENCV_FISHEYE", 8),
    ("FULL_OPENCV", 12),
    ("FOV", 5),
    ("SIMPLE_RADIAL_FISHEYE", 4),
    ("RADIAL_FISHEYE", 5),
    ("THIN_PRISM_FISHEYE", 12),
    ("RAD_TAN_THIN_PRISM_FISHEYE", 16),
];

/// A camera of a model's name and parameters.
///
/// # Errors
/// What is wrong with it, and the way out.
pub(super) fn optics(model: &str, width: usize, height: usize, p: &[f64]) -> std::result::Result<Optics, String> {
    let known = MODELS.iter().find(|(name, _)| *name == model);
    let Some((_, count)) = known else { return Err(format!("the camera model {model} is not known")) };
    if p.len() != *count {
        return Err(format!("{model} has {count} parameters, here are {}", p.len()));
    }
    let radial = |k1: f64, k2: f64| Lens::OpenCv { k: [k1, k2, 0.0, 0.0, 0.0, 0.0], p: [0.0; 2] };
    let fish = |k1: f64, k2: f64| Lens::Fisheye { k: [k1, k2, 0.0, 0.0] };
    let (f, lens) = match (model, p) {
        ("SIMPLE_PINHOLE", &[f, cx, cy]) => ([f, f, cx, cy], Lens::Pinhole),
        ("PINHOLE", &[fx, fy, cx, cy]) => ([fx, fy, cx, cy], Lens::Pinhole),
        ("SIMPLE_RADIAL", &[f, cx, cy, k]) => ([f, f, cx, cy], radial(k, 0.0)),
        ("RADIAL", &[f, cx, cy, k1, k2]) => ([f, f, cx, cy], radial(k1, k2)),
        ("SIMPLE_RADIAL_FISHEYE", &[f, cx, cy, k]) => ([f, f, cx, cy], fish(k, 0.0)),
        ("RADIAL_FISHEYE", &[f, cx, cy, k1, k2]) => ([f, f, cx, cy], fish(k1, k2)),
        ("OPENCV", &[fx, fy, cx, cy, k1, k2, p1, p2]) => {
            ([fx, fy, cx, cy], Lens::OpenCv { k: [k1, k2, 0.0, 0.0, 0.0, 0.0], p: [p1, p2] })
        }
        ("OPENCV_FISHEYE", &[fx, fy, cx, cy, k1, k2, k3, k4]) => {
            ([fx, fy, cx, cy], Lens::Fisheye { k: [k1, k2, k3, k4] })
        }
        ("FULL_OPENCV", &[fx, fy, cx, cy, k1, k2, p1, p2, k3, k4, k5, k6]) => {
            ([fx, fy, cx, cy], Lens::OpenCv { k: [k1, k2, k3, k4, k5, k6], p: [p1, p2] })
        }
        ("RAD_TAN_THIN_PRISM_FISHEYE", &[fx, fy, cx, cy, k0, k1, k2, k3, k4, k5, p0, p1, s0, s1, s2, s3]) => (
            [fx, fy, cx, cy],
            Lens::FisheyeRadTanThinPrism { k: [k0, k1, k2, k3, k4, k5], p: [p0, p1], s: [s0, s1, s2, s3] },
        ),
        _ => {
            return Err(format!(
                "the lens model {model} is not read; run colmap image_undistorter and import its output"
            ));
        }
    };
    let [fx, fy, cx, cy] = f;
    let optics = Optics { width, height, fx, fy, cx: from_corner(cx), cy: from_corner(cy), lens };
    optics.fault().map_or(Ok(optics), Err)
}

/// `ID MODEL WIDTH HEIGHT PARAMS...` a line.
fn text_cameras(path: &Path) -> Result<Cameras> {
    let mut lines = Lines::open(path)?;
    let mut out = Cameras::new();
    while let Some(line) = lines.content()? {
        let cells = cells(&line);
        let [id, model, width, height, params @ ..] = cells.as_slice() else {
            return Err(lines.fault(format!("{} cells, expected ID MODEL WIDTH HEIGHT PARAMS", cells.len())));
        };
        let id = lines.whole("camera number", id)? as u64;
        let (width, height) = (lines.whole("width", width)?, lines.whole("height", height)?);
        let params = params.iter().map(|p| lines.number("parameter", p)).collect::<Result<Vec<f64>>>()?;
        out.insert(id, optics(model, width, height, &params).map_err(|e| lines.fault(e))?);
    }
    Ok(out)
}

/// Two lines an image: `ID QW QX QY QZ TX TY TZ CAMERA NAME`, then its observations, which may be none.
fn text_images(path: &Path) -> Result<Vec<Posed>> {
    let mut lines = Lines::open(path)?;
    let mut out = Vec::new();
    while let Some(line) = lines.content()? {
        let mut rest = line.as_str();
        let mut word = || {
            rest = rest.trim_start();
            let end = rest.find(char::is_whitespace).unwrap_or(rest.len());
            let (first, after) = rest.split_at(end);
            rest = after;
            first
        };
        let head: [&str; 9] = std::array::from_fn(|_| word());
        // A name may hold spaces.
        let name = rest.trim();
        if name.is_empty() {
            return Err(lines.fault("expected ID QW QX QY QZ TX TY TZ CAMERA NAME"));
        }
        let [_, numbers @ .., camera] = head;
        let mut values = [0.0; 7];
        for (value, cell) in values.iter_mut().zip(numbers) {
            *value = lines.number("pose", cell)?;
        }
        let camera = lines.whole("camera number", camera)? as u64;
        out.push(Posed { pose: pose(values), camera, name: name.to_owned() });
        lines.skip()?;
    }
    Ok(out)
}

/// `ID X Y Z R G B ERROR TRACK...` a line.
fn text_points(path: &Path, out: &mut Thinned) -> Result<()> {
    let mut lines = Lines::open(path)?;
    while let Some(line) = lines.content()? {
        let mut cells = line.split_whitespace().skip(1);
        let mut p = [0.0; 3];
        for value in &mut p {
            *value = lines.number("point", cells.next().unwrap_or_default())?;
        }
        out.push(Point::from(p));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_model_has_its_parameters_where_they_belong() {
        let at = |optics: &Optics| optics.project(&Point::new(0.2, 0.1, 1.0)).unwrap();
        let plain = optics("PINHOLE", 640, 480, &[400.0, 400.0, 320.0, 240.0]).unwrap();
        assert_eq!((plain.cx, plain.cy), (319.5, 239.5));
        let (u, v) = at(&plain);
        // With all coefficients 0 every model without a fisheye is the pinhole.
        for (model, head) in [("SIMPLE_RADIAL", 3), ("RADIAL", 3), ("OPENCV", 4), ("FULL_OPENCV", 4)] {
            let count = MODELS.iter().find(|m| m.0 == model).unwrap().1;
            let mut p = if head == 3 { vec![400.0, 320.0, 240.0] } else { vec![400.0, 400.0, 320.0, 240.0] };
            p.resize(count, 0.0);
            let (pu, pv) = at(&optics(model, 640, 480, &p).unwrap());
            assert!((pu - u).abs() < 1e-9 && (pv - v).abs() < 1e-9, "{model}");
        }
        for (model, p, word) in [
            ("FOV", &[1.0; 5][..], "undistort"),
            ("PINHOLE", &[400.0; 3][..], "4 parameters"),
            ("NEW", &[][..], "not known"),
            ("PINHOLE", &[f64::NAN, 400.0, 1.0, 1.0][..], "focal"),
        ] {
            let error = optics(model, 640, 480, p).unwrap_err();
            assert!(error.contains(word), "{error}");
        }
    }

    #[test]
    fn points_are_thinned_evenly() {
        let mut points = Thinned::default();
        for i in 0..(2 * MAX_POINTS + 10) {
            points.push(Point::new(i as f64, 0.0, 0.0));
        }
        assert!(points.kept.len() <= MAX_POINTS + 10);
        assert!(points.kept.windows(2).all(|w| (w[1].x - w[0].x - 2.0).abs() < 1e-9));
    }
}
