//! Depth of a few frames, thinned: all that is decoded for the checks of poses.

use std::sync::Arc;

use nalgebra::Matrix3;
use rayon::prelude::*;

use super::Subject;
use crate::math::{Point, Vector};
use crate::recording::sketch::Sketch;
use crate::recording::{Camera, Grid};

/// Frames that are looked at.
const FRAMES: usize = 48;
/// Pixels that are decoded at the most, together: 48 images of 640 x 480. Larger images get fewer looks, but at least 20.
const PIXELS: usize = 15_000_000;
const LEAST_FRAMES: usize = 20;
/// Places of a look that are moved into others.
const PLACES: f64 = 80.0;

/// A look.
pub(super) struct FrameLook {
    /// Its frame.
    pub frame: usize,
    /// Places that it sees, its camera's frame.
    pub places: Vec<Point>,
    /// Normals of surfaces that it sees, its camera's frame.
    pub normals: Vec<Vector>,
    camera: Camera,
    sketch: Arc<Sketch>,
}

/// Evenly spread looks, in the order of frames.
pub(super) fn looks(subject: &Subject) -> Vec<FrameLook> {
    let area = (subject.camera.width * subject.camera.height).max(1);
    let most = (PIXELS / area).clamp(LEAST_FRAMES, FRAMES);
    at(subject, &spread(&subject.with_depth, most))
}

/// Looks at these frames, in their order; frames whose depth cannot be read are left out.
pub(super) fn at(subject: &Subject, frames: &[usize]) -> Vec<FrameLook> {
    frames.par_iter().filter_map(|&frame| Some(look(frame, &(subject.depth)(frame)?, &subject.camera))).collect()
}

/// At the most so many of a list, evenly spread, both ends among them.
fn spread(all: &[usize], most: usize) -> Vec<usize> {
    if all.len() <= most || most < 2 {
        return all.iter().copied().take(most).collect();
    }
    (0..most).filter_map(|i| all.get(i * (all.len() - 1) / (most - 1)).copied()).collect()
}

fn look(frame: usize, depth: &Grid<f32>, full: &Camera) -> FrameLook {
    let sketch = Sketch::of(frame, depth, None);
    let (width, height) = (sketch.depth_mm.width, sketch.depth_mm.height);
    let stride = (((width * height) as f64 / PLACES).sqrt() as usize).max(1);
    let grid = move |step: usize| {
        (step / 2..height).step_by(step).flat_map(move |y| (step / 2..width).step_by(step).map(move |x| (x, y)))
    };
    let places = grid(stride).filter_map(|(x, y)| sketch.point(full, x, y)).collect();
    // Wide enough to average pixel noise, narrow enough for a drawer's front.
    let reach = (width / 40).max(2);
    let normals = grid((stride / 2).max(1)).filter_map(|(x, y)| sketch.normal(full, x, y, reach)).collect();
    FrameLook { frame, places, normals, camera: sketch.camera(full), sketch: Arc::new(sketch) }
}

impl FrameLook {
    /// The same places where they are through another camera of the full image's size, without their normals.
    pub fn through(&self, full: &Camera) -> Self {
        let camera = self.sketch.camera(full);
        let moved = |p: &Point| self.camera.project(p).map(|(u, v)| camera.unproject(u, v, p.z));
        Self {
            frame: self.frame,
            places: self.places.iter().filter_map(moved).collect(),
            normals: Vec::new(),
            camera,
            sketch: Arc::clone(&self.sketch),
        }
    }

    /// The share of another look's places, moved by `turn * p + shift` into this one, that are where this one sees something.
    /// One factor of all depth is free: estimated depth has one of its own in each frame.
    pub fn meets(&self, places: &[Point], turn: &Matrix3<f64>, shift: &Vector) -> f64 {
        /// Depth that differs by less is one place: estimated depth is bent by this much.
        const SAME: f64 = 0.03;
        /// The largest factor that is left free.
        const FACTOR: f64 = 0.25;
        /// Fewer places tell no factor.
        const LEAST: usize = 8;
        let mut off: Vec<f64> = places
            .iter()
            .filter_map(|p| {
                let p = Point::from(turn * p.coords + shift);
                let (u, v) = self.camera.project(&p).filter(|_| p.z > 0.1)?;
                let (x, y) = self.sketch.nearest(u, v)?;
                let z = f64::from(self.sketch.depth_m(y * self.sketch.depth_mm.width + x));
                (z > 0.0).then(|| (z / p.z).ln())
            })
            .collect();
        let mut factor = 0.0;
        if off.len() > LEAST {
            let middle = off.len() / 2;
            let (_, median, _) = off.select_nth_unstable_by(middle, f64::total_cmp);
            factor = median.clamp(-FACTOR, FACTOR);
        }
        let met = off.iter().filter(|x| (**x - factor).abs() < SAME).count();
        met as f64 / places.len().max(1) as f64
    }

    /// Depth at a pixel of the full image, metres; `None` outside and where there is none.
    pub fn depth_at(&self, u: f64, v: f64) -> Option<f64> {
        let (x, y) = self.sketch.sample(u, v)?;
        let z = f64::from(self.sketch.depth_m(y * self.sketch.depth_mm.width + x));
        (z > 0.0).then_some(z)
    }

    /// Median depth, metres.
    pub fn median_depth(&self) -> Option<f64> {
        let z: Vec<f64> = self.places.iter().map(|p| p.z).collect();
        crate::math::stats::median(&z)
    }
}
