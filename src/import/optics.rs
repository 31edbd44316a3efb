//! Cameras with their lenses.

use crate::math::{Point, Vector};

/// The longer side of an image over the shorter one, at the most; panoramas have 4.
const MOST_STRETCHED: usize = 16;

/// How a lens bends rays, with x = X/Z and y = Y/Z, or the angle to the axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum LensModel {
    /// Not at all.
    Pinhole,
    /// OpenCV's: `(1 + k1 r2 + k2 r4 + k3 r6) / (1 + k4 r2 + k5 r4 + k6 r6)` and tangential p1, p2. COLMAP's radial models are
    /// this one with zeros.
    OpenCv {
        /// k1 to k6.
        k: [f64; 6],
        /// p1, p2.
        p: [f64; 2],
    },
    /// OpenCV's fisheye: `angle (1 + k1 a2 + k2 a4 + k3 a6 + k4 a8)`.
    Fisheye {
        /// k1 to k4.
        k: [f64; 4],
    },
    /// Project Aria's: six radial coefficients of the angle, then tangential, then thin prism.
    FisheyeRadTanThinPrism {
        /// k0 to k5.
        k: [f64; 6],
        /// p0, p1.
        p: [f64; 2],
        /// s0 to s3.
        s: [f64; 4],
    },
}

/// A camera in OpenCV axes; integer pixels are pixel centres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Optics {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Focal length in x, pixels.
    pub fx: f64,
    /// Focal length in y, pixels.
    pub fy: f64,
    /// Principal point, x.
    pub cx: f64,
    /// Principal point, y.
    pub cy: f64,
    /// The lens.
    pub lens: LensModel,
}

/// A principal point that is counted from the corner of the first pixel (COLMAP, nerfstudio), counted from its centre.
#[must_use]
pub fn from_corner(c: f64) -> f64 {
    c - 0.5
}

/// A principal point at another size of the image, both counted from pixel centres.
pub(super) fn scaled_center(c: f64, factor: f64) -> f64 {
    (c + 0.5) * factor - 0.5
}

/// Whether `f` grows up to `x`: beyond the fold of a polynomial two rays would share a pixel.
fn grows(f: impl Fn(f64) -> f64, x: f64) -> bool {
    let mut last = 0.0;
    (1..=8).all(|i| {
        let next = f(x * f64::from(i) / 8.0);
        let is_more = next >= last;
        last = next;
        is_more
    })
}

impl Optics {
    /// A pinhole camera.
    #[must_use]
    pub fn pinhole(width: usize, height: usize, [fx, fy, cx, cy]: [f64; 4]) -> Self {
        Self { width, height, fx, fy, cx, cy, lens: LensModel::Pinhole }
    }

    /// What is wrong with the numbers; `None` where nothing is.
    #[must_use]
    pub fn fault(&self) -> Option<String> {
        let (w, h) = (self.width, self.height);
        if w == 0 || h == 0 || w.saturating_mul(h) > 64 << 20 {
            return Some(format!("an image of {w} x {h} pixels is not a camera's"));
        }
        // The size of the output follows from the shape: a strip of a pixel's width would ask for millions of rows.
        if w.max(h) / w.min(h) > MOST_STRETCHED {
            return Some(format!("an image of {w} x {h} pixels has no camera's shape"));
        }
        // A thousand image widths see a thousandth of a radian, which no lens here does: as recordings have it.
        let widest = 1e3 * w.max(h) as f64;
        if ![self.fx, self.fy].iter().all(|f| *f > 1.0 && *f < widest) {
            return Some(format!("fx {}, fy {} must be focal lengths in pixels", self.fx, self.fy));
        }
        if ![self.cx, self.cy].iter().all(|c| c.abs() < widest) {
            return Some(format!("cx {}, cy {} must be pixels on the image or near it", self.cx, self.cy));
        }
        let finite = match self.lens {
            LensModel::Pinhole => true,
            LensModel::OpenCv { k, p } => k.iter().chain(&p).all(|x| x.is_finite()),
            LensModel::Fisheye { k } => k.iter().all(|x| x.is_finite()),
            LensModel::FisheyeRadTanThinPrism { k, p, s } => k.iter().chain(&p).chain(&s).all(|x| x.is_finite()),
        };
        (!finite).then(|| "a distortion coefficient is not finite".to_owned())
    }

    /// Whether the lens may see beside itself and behind.
    #[must_use]
    pub fn is_fisheye(&self) -> bool {
        matches!(self.lens, LensModel::Fisheye { .. } | LensModel::FisheyeRadTanThinPrism { .. })
    }

    /// The same camera at another size of its images.
    #[must_use]
    pub fn resized(&self, width: usize, height: usize) -> Self {
        if (width, height) == (self.width, self.height) {
            return *self;
        }
        let (sx, sy) = (width as f64 / self.width as f64, height as f64 / self.height as f64);
        Self {
            width,
            height,
            fx: self.fx * sx,
            fy: self.fy * sy,
            cx: scaled_center(self.cx, sx),
            cy: scaled_center(self.cy, sy),
            lens: self.lens,
        }
    }

    /// Whether an image of this size is the camera's, made larger or smaller: both sides by one factor, to a hundredth.
    #[must_use]
    pub fn has_shape(&self, width: usize, height: usize) -> bool {
        let (sx, sy) = (width as f64 / self.width as f64, height as f64 / self.height as f64);
        (sx / sy - 1.0).abs() < 0.01
    }

    /// Pixel of a point in the camera's frame; `None` where the lens does not see it.
    #[must_use]
    pub fn project(&self, p: &Point) -> Option<(f64, f64)> {
        let (x, y) = match self.lens {
            LensModel::Pinhole | LensModel::OpenCv { .. } if p.z <= 1e-9 => return None,
            LensModel::Pinhole => (p.x / p.z, p.y / p.z),
            LensModel::OpenCv { k, p: tangential } => radial_tangential(p.x / p.z, p.y / p.z, &k, tangential)?,
            LensModel::Fisheye { k } => {
                let (x, y, _) = bent(p, &k)?;
                (x, y)
            }
            LensModel::FisheyeRadTanThinPrism { k, p: [p0, p1], s } => {
                let (x, y, _) = bent(p, &k)?;
                let r2 = x * x + y * y;
                let dot = 2.0 * (x * p0 + y * p1);
                (x + dot * x + r2 * p0 + s[0] * r2 + s[1] * r2 * r2, y + dot * y + r2 * p1 + s[2] * r2 + s[3] * r2 * r2)
            }
        };
        let (u, v) = (self.fx * x + self.cx, self.fy * y + self.cy);
        (u.is_finite() && v.is_finite()).then_some((u, v))
    }

    /// Unit direction of a pixel in the camera's frame; `None` where none is found to a twentieth of a pixel.
    #[must_use]
    pub fn direction(&self, u: f64, v: f64) -> Option<Vector> {
        let (x, y) = ((u - self.cx) / self.fx, (v - self.cy) / self.fy);
        if self.lens == LensModel::Pinhole {
            return crate::math::unit(&Vector::new(x, y, 1.0));
        }
        // Newton's method on the ray's angle times its direction in the image, which suits every lens.
        let ray = |m: [f64; 2]| {
            let angle = m[0].hypot(m[1]);
            let s = if angle > 1e-12 { angle.sin() / angle } else { 1.0 };
            Vector::new(m[0] * s, m[1] * s, angle.cos())
        };
        let at = |m: [f64; 2]| self.project(&Point::from(ray(m)));
        let mut m = if self.is_fisheye() {
            [x, y]
        } else {
            let r = x.hypot(y);
            let s = if r > 1e-12 { r.atan() / r } else { 1.0 };
            [x * s, y * s]
        };
        // Back from where the lens sees nothing.
        let mut halvings = 0;
        while at(m).is_none() && halvings < 20 {
            m = [m[0] * 0.8, m[1] * 0.8];
            halvings += 1;
        }
        const STEP: f64 = 1e-6;
        for _ in 0..20 {
            let (pu, pv) = at(m)?;
            let (eu, ev) = (u - pu, v - pv);
            if eu.hypot(ev) < 1e-6 {
                break;
            }
            let (au, av) = at([m[0] + STEP, m[1]])?;
            let (bu, bv) = at([m[0], m[1] + STEP])?;
            let (a, b, c, d) = ((au - pu) / STEP, (bu - pu) / STEP, (av - pv) / STEP, (bv - pv) / STEP);
            let determinant = a * d - b * c;
            if !determinant.is_finite() || determinant.abs() < 1e-9 {
                return None;
            }
            let step = [(d * eu - b * ev) / determinant, (a * ev - c * eu) / determinant];
            // Shorter steps until the lens sees the new ray.
            let mut share = 1.0;
            let mut next = m;
            for _ in 0..10 {
                next = [m[0] + share * step[0], m[1] + share * step[1]];
                if at(next).is_some() {
                    break;
                }
                share *= 0.5;
            }
            m = next;
        }
        let (pu, pv) = at(m)?;
        ((pu - u).hypot(pv - v) < 0.05).then(|| ray(m))
    }
}

fn radial_tangential(x: f64, y: f64, k: &[f64; 6], [p1, p2]: [f64; 2]) -> Option<(f64, f64)> {
    let factor = |r: f64| {
        let r2 = r * r;
        (1.0 + r2 * (k[0] + r2 * (k[1] + r2 * k[2]))) / (1.0 + r2 * (k[3] + r2 * (k[4] + r2 * k[5])))
    };
    let r = x.hypot(y);
    if !grows(|r| r * factor(r), r) {
        return None;
    }
    let (r2, f) = (r * r, factor(r));
    Some((x * f + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x), y * f + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y))
}

/// Where a point falls by the polynomial of its angle: x, y, and the angle; `None` straight behind and beyond the fold.
fn bent(p: &Point, k: &[f64]) -> Option<(f64, f64, f64)> {
    let r = p.x.hypot(p.y);
    let angle = r.atan2(p.z);
    if r < 1e-12 {
        return (p.z > 0.0).then_some((0.0, 0.0, 0.0));
    }
    let bend = |a: f64| {
        let a2 = a * a;
        a * (1.0 + a2 * k.iter().rev().fold(0.0, |sum, k| k + a2 * sum))
    };
    if !grows(bend, angle) {
        return None;
    }
    let b = bend(angle);
    Some((p.x / r * b, p.y / r * b, angle))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lenses() -> Vec<Optics> {
        let base = Optics::pinhole(640, 480, [400.0, 410.0, 310.0, 250.0]);
        vec![
            base,
            Optics { lens: LensModel::OpenCv { k: [-0.1, 0.02, 0.0, 0.0, 0.0, 0.0], p: [0.001, -0.002] }, ..base },
            Optics { lens: LensModel::Fisheye { k: [0.01, -0.02, 0.003, 0.0] }, ..base },
            Optics {
                lens: LensModel::FisheyeRadTanThinPrism {
                    k: [0.4, -0.4, 0.15, 1.1, -1.6, 0.6],
                    p: [0.0003, -0.0002],
                    s: [0.001, -0.0001, -0.0004, 0.0001],
                },
                ..base
            },
        ]
    }

    #[test]
    fn directions_are_where_pixels_come_from() {
        for optics in lenses() {
            for (u, v) in [(310.0, 250.0), (0.0, 0.0), (639.0, 100.0), (500.0, 479.0)] {
                let ray = optics.direction(u, v).unwrap();
                let (pu, pv) = optics.project(&Point::from(ray * 2.5)).unwrap();
                assert!((pu - u).hypot(pv - v) < 0.05, "{:?}: {u} {v} is {pu} {pv}", optics.lens);
            }
        }
    }

    /// OpenCV's own formulas, worked out by hand for one point.
    #[test]
    fn lenses_have_the_values_of_their_formulas() {
        let one = Optics::pinhole(10, 10, [1.0, 1.0, 0.0, 0.0]);
        let p = Point::new(0.3, 0.4, 1.0);
        let cv = Optics { lens: LensModel::OpenCv { k: [0.1, 0.0, 0.0, 0.0, 0.0, 0.0], p: [0.01, 0.0] }, ..one };
        let (u, v) = cv.project(&p).unwrap();
        assert!((u - (0.3 * 1.025 + 0.0024)).abs() < 1e-12 && (v - (0.4 * 1.025 + 0.0057)).abs() < 1e-12, "{u} {v}");
        let fish = Optics { lens: LensModel::Fisheye { k: [0.0; 4] }, ..one };
        let (u, v) = fish.project(&p).unwrap();
        assert!((u.hypot(v) - 0.5f64.atan()).abs() < 1e-12 && (u / v - 0.75).abs() < 1e-12);
        // Straight to the side: only a fisheye sees it.
        assert!(
            fish.project(&Point::new(1.0, 0.0, 0.0)).is_some() && one.project(&Point::new(1.0, 0.0, 0.0)).is_none()
        );
    }

    #[test]
    fn what_no_camera_has_is_refused_in_words() {
        for (width, height, focal, word) in [
            (640, 480, 400.0, ""),
            (0, 480, 400.0, "is not a camera's"),
            (1 << 40, 1 << 40, 400.0, "is not a camera's"),
            (1, 1 << 26, 400.0, "no camera's shape"),
            (1 << 20, 16, 400.0, "no camera's shape"),
            (640, 480, f64::INFINITY, "focal lengths"),
            (640, 480, 1e9, "focal lengths"),
            (640, 480, f64::NAN, "focal lengths"),
        ] {
            let fault = Optics::pinhole(width, height, [focal, focal, 1.0, 1.0]).fault().unwrap_or_default();
            assert!(fault.contains(word) && fault.is_empty() == word.is_empty(), "{word}: {fault}");
        }
    }

    #[test]
    fn beyond_its_fold_a_lens_sees_nothing() {
        let base = Optics::pinhole(640, 480, [400.0, 400.0, 319.5, 239.5]);
        let optics = Optics { lens: LensModel::OpenCv { k: [-0.3, 0.0, 0.0, 0.0, 0.0, 0.0], p: [0.0; 2] }, ..base };
        assert!(optics.project(&Point::new(0.5, 0.0, 1.0)).is_some());
        assert!(optics.project(&Point::new(1.6, 0.0, 1.0)).is_none());
    }
}
