//! A frame's depth and mask at every n-th pixel: small enough to keep for hundreds of frames.

use super::{Camera, Grid, HAND_CLASS};
use crate::math::{Point, Vector, unit};

/// Samples kept of a frame at the most.
const MAX_SAMPLES: usize = 20_000;

/// Depth and mask class of a frame on a regular grid of its pixels.
#[derive(Debug, Clone, PartialEq)]
pub struct Sketch {
    /// Frame index.
    pub frame: usize,
    /// Pixels between samples.
    pub step: usize,
    /// Depth along the optical axis as read (no factor applied), millimetres, as recordings on disk have it; 0 = none, or a hand.
    /// A long recording keeps ten thousands of sketches.
    pub depth_mm: Grid<u16>,
    /// Mask class; `None` where the frame has no mask.
    pub class: Option<Grid<u8>>,
}

impl Sketch {
    /// Samples decoded images of one size.
    #[must_use]
    pub fn of(frame: usize, depth: &Grid<f32>, mask: Option<&Grid<u8>>) -> Self {
        let step = ((depth.data.len() as f64 / MAX_SAMPLES as f64).sqrt().ceil() as usize).max(1);
        let (width, height) = (depth.width / step, depth.height / step);
        let source = |x: usize, y: usize| (y * step + step / 2) * depth.width + x * step + step / 2;
        let mut depth_mm = Grid::filled(width, height, 0u16);
        for y in 0..height {
            for x in 0..width {
                let z = depth.data[source(x, y)];
                let hand = mask.is_some_and(|m| m.data[source(x, y)] == HAND_CLASS);
                // Beyond the range of 16 bits, 65 m, is out of the window.
                let mm = (1000.0 * z).round();
                if mm > 0.0 && mm <= f32::from(u16::MAX) && !hand {
                    depth_mm.data[y * width + x] = mm as u16;
                }
            }
        }
        let class = mask.map(|m| {
            let rows = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
            Grid { width, height, data: rows.map(|(x, y)| m.data[source(x, y)]).collect() }
        });
        Self { frame, step, depth_mm, class }
    }

    /// Depth of the sample with this index, along the optical axis as read, metres; 0 = none.
    #[must_use]
    pub fn depth_m(&self, index: usize) -> f32 {
        f32::from(self.depth_mm.data[index]) * 1e-3
    }

    /// Pixel of the full image at sample (x, y).
    #[must_use]
    pub fn pixel(&self, x: usize, y: usize) -> (f64, f64) {
        ((x * self.step + self.step / 2) as f64, (y * self.step + self.step / 2) as f64)
    }

    /// Sample nearest to a pixel of the full image; `None` outside.
    #[must_use]
    pub fn sample(&self, u: f64, v: f64) -> Option<(usize, usize)> {
        let at = |c: f64| (c - (self.step / 2) as f64) / self.step as f64;
        self.nearest(at(u), at(v))
    }

    /// A camera whose pixels are the samples, of the full image's.
    #[must_use]
    pub fn camera(&self, full: &Camera) -> Camera {
        let (step, first) = (self.step as f64, (self.step / 2) as f64);
        Camera {
            width: self.depth_mm.width,
            height: self.depth_mm.height,
            fx: full.fx / step,
            fy: full.fy / step,
            cx: (full.cx - first) / step,
            cy: (full.cy - first) / step,
        }
    }

    /// Sample nearest to a pixel of [`Sketch::camera`]; `None` outside.
    #[must_use]
    pub fn nearest(&self, x: f64, y: f64) -> Option<(usize, usize)> {
        // Rounded by hand: half a sample outside is outside, and what is left is positive.
        let (x, y) = (x + 0.5, y + 0.5);
        (x >= 0.0 && y >= 0.0)
            .then_some((x as usize, y as usize))
            .filter(|(x, y)| *x < self.depth_mm.width && *y < self.depth_mm.height)
    }

    /// Point of a sample in the camera frame, with depth as read; `None` where there is none.
    #[must_use]
    pub fn point(&self, camera: &Camera, x: usize, y: usize) -> Option<Point> {
        let z = f64::from(self.depth_m(y * self.depth_mm.width + x));
        let (u, v) = self.pixel(x, y);
        (z > 0.0).then(|| camera.unproject(u, v, z))
    }

    /// Normal of the surface at a sample, camera frame, facing the camera: the slope over `reach` samples to each side.
    /// `None` at the rim, at depth edges and in holes.
    #[must_use]
    pub fn normal(&self, camera: &Camera, x: usize, y: usize, reach: usize) -> Option<Vector> {
        let centre = self.point(camera, x, y)?;
        let (x0, y0) = (x.checked_sub(reach)?, y.checked_sub(reach)?);
        let (x1, y1) = (x + reach, y + reach);
        if x1 >= self.depth_mm.width || y1 >= self.depth_mm.height {
            return None;
        }
        let (left, right) = (self.point(camera, x0, y)?, self.point(camera, x1, y)?);
        let (above, below) = (self.point(camera, x, y0)?, self.point(camera, x, y1)?);
        // Both sides of a pixel lie on one plane; at an edge the middle does not lie between them. In inverse depth a
        // plane is linear in the image.
        let bend = |a: &Point, b: &Point| (0.5 / a.z + 0.5 / b.z - 1.0 / centre.z).abs() * centre.z;
        if bend(&left, &right) > 0.015 || bend(&above, &below) > 0.015 {
            return None;
        }
        let normal = unit(&(right - left).cross(&(below - above)))?;
        Some(if normal.dot(&centre.coords) > 0.0 { -normal } else { normal })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sketch_of_a_slanted_wall_has_its_points_and_normal() {
        let camera = Camera { width: 640, height: 480, fx: 400.0, fy: 400.0, cx: 319.5, cy: 239.5 };
        let normal = Vector::new(0.3, -0.2, -1.0).normalize();
        let mut depth = Grid::filled(640, 480, 0.0f32);
        for y in 0..480 {
            for x in 0..640 {
                let ray = camera.unproject(x as f64, y as f64, 1.0).coords;
                depth.data[y * 640 + x] = (-2.0 / normal.dot(&ray)) as f32;
            }
        }
        let sketch = Sketch::of(0, &depth, None);
        assert!(sketch.depth_mm.data.len() <= MAX_SAMPLES);
        let p = sketch.point(&camera, 10, 20).unwrap();
        // Depth is kept to the millimetre: half of one along the ray at most.
        let ray = p.coords / p.z;
        assert!((normal.dot(&p.coords) + 2.0).abs() < 5.01e-4 * normal.dot(&ray).abs());
        let (u, v) = sketch.pixel(10, 20);
        assert_eq!(sketch.sample(u, v), Some((10, 20)));
        assert!((sketch.camera(&camera).unproject(10.0, 20.0, p.z) - p).norm() < 1e-12);
        // Over six samples of 5 cm, half a millimetre turns it by less than a hundredth.
        assert!((sketch.normal(&camera, 10, 20, 3).unwrap() - normal).norm() < 1e-2);
        assert!(sketch.normal(&camera, 1, 20, 3).is_none());
    }
}
