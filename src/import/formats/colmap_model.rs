//! What a COLMAP model holds, whether its files are text or binary: cameras, registered images, points.

use std::collections::BTreeMap;

use crate::import::capture::{RawPose, RawRotation};
use crate::import::optics::{LensModel, Optics, from_corner};
use crate::math::Point;

/// Points that are kept; of more, every second one, fourth one, and so on.
const MAX_POINTS: usize = 1_000_000;

/// Cameras by their number.
pub(super) type Cameras = BTreeMap<u64, Optics>;

/// A registered image.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct RegisteredImage {
    /// World to camera.
    pub pose: RawPose,
    /// Number of the camera.
    pub camera: u64,
    /// Name, with folders.
    pub name: String,
}

/// A pose from `qw qx qy qz tx ty tz`.
pub(super) fn pose([qw, qx, qy, qz, x, y, z]: [f64; 7]) -> RawPose {
    RawPose { position: [x, y, z], turn: RawRotation::Quaternion([qw, qx, qy, qz]) }
}

/// Points, evenly thinned as they come so that never more than twice the most are held.
#[derive(Debug, Default)]
pub(super) struct Thinned {
    pub(super) kept: Vec<Point>,
    step: usize,
    seen: usize,
}

impl Thinned {
    /// Those that are kept.
    pub fn into_kept(self) -> Vec<Point> {
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
    let radial = |k1: f64, k2: f64| LensModel::OpenCv { k: [k1, k2, 0.0, 0.0, 0.0, 0.0], p: [0.0; 2] };
    let fish = |k1: f64, k2: f64| LensModel::Fisheye { k: [k1, k2, 0.0, 0.0] };
    let (f, lens) = match (model, p) {
        ("SIMPLE_PINHOLE", &[f, cx, cy]) => ([f, f, cx, cy], LensModel::Pinhole),
        ("PINHOLE", &[fx, fy, cx, cy]) => ([fx, fy, cx, cy], LensModel::Pinhole),
        ("SIMPLE_RADIAL", &[f, cx, cy, k]) => ([f, f, cx, cy], radial(k, 0.0)),
        ("RADIAL", &[f, cx, cy, k1, k2]) => ([f, f, cx, cy], radial(k1, k2)),
        ("SIMPLE_RADIAL_FISHEYE", &[f, cx, cy, k]) => ([f, f, cx, cy], fish(k, 0.0)),
        ("RADIAL_FISHEYE", &[f, cx, cy, k1, k2]) => ([f, f, cx, cy], fish(k1, k2)),
        ("OPENCV", &[fx, fy, cx, cy, k1, k2, p1, p2]) => {
            ([fx, fy, cx, cy], LensModel::OpenCv { k: [k1, k2, 0.0, 0.0, 0.0, 0.0], p: [p1, p2] })
        }
        ("OPENCV_FISHEYE", &[fx, fy, cx, cy, k1, k2, k3, k4]) => {
            ([fx, fy, cx, cy], LensModel::Fisheye { k: [k1, k2, k3, k4] })
        }
        ("FULL_OPENCV", &[fx, fy, cx, cy, k1, k2, p1, p2, k3, k4, k5, k6]) => {
            ([fx, fy, cx, cy], LensModel::OpenCv { k: [k1, k2, k3, k4, k5, k6], p: [p1, p2] })
        }
        ("RAD_TAN_THIN_PRISM_FISHEYE", &[fx, fy, cx, cy, k0, k1, k2, k3, k4, k5, p0, p1, s0, s1, s2, s3]) => (
            [fx, fy, cx, cy],
            LensModel::FisheyeRadTanThinPrism { k: [k0, k1, k2, k3, k4, k5], p: [p0, p1], s: [s0, s1, s2, s3] },
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
