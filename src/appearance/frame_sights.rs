//! What is kept of each chosen frame: depth at no more than VGA resolution, with hands taken out, how surfaces slant, and which
//! of it is the room's.

use nalgebra::Matrix3;
use rayon::prelude::*;

use super::boxes;
use super::frame_choice::{State, Timeline};
use super::local::{Local, RigidMotion};
use super::sight_camera::{NEAREST_M, SightCamera};
use crate::config;
use crate::error::Result;
use crate::math::{Point, Pose};
use crate::pipeline::Scene;
use crate::recording::{Camera, Grid, Recording, people};
use crate::twin::Twin;

/// Samples kept of a frame at the most: VGA.
const MAX_SAMPLES: usize = 640 * 480;
/// Surfaces seen at less than this slant (cosine) tell their place badly.
const LEAST_SLANT: f32 = 0.15;

/// What a look is made from.
#[derive(Clone, Copy)]
pub(super) struct Setting<'a> {
    pub(super) recording: &'a Recording,
    pub(super) scene: &'a Scene,
    pub(super) twin: &'a Twin,
    /// Of the scene's joints.
    pub(super) timelines: &'a [Timeline],
    /// World; all else is relative to it.
    pub(super) origin: Point,
    pub(super) config: &'a config::Appearance,
}

/// A frame's depth, ready to be compared with surfaces.
#[derive(Debug, Clone)]
pub(super) struct FrameSight {
    pub(super) frame: usize,
    /// Pixels of the full image between samples.
    pub(super) step: usize,
    /// Its pixels are the samples.
    pub(super) lens: SightCamera,
    /// Camera from local.
    pub(super) pose: RigidMotion,
    /// Of each of the twin's parts.
    pub(super) states: Vec<State>,
    /// A sample each: depth in millimetres (16 bits, 0 = none or a hand), then what a step along the ray is worth across the
    /// surface (8 bits, 255 = all of it; 0 = no place of the room: grazing, at an edge, or on a part).
    pub(super) samples: Vec<u32>,
}

impl FrameSight {
    /// Depth of a sample, metres; 0 = none.
    pub(super) fn depth(&self, index: usize) -> f32 {
        (self.samples[index] & 0xffff) as f32 * 1e-3
    }

    /// See [`FrameSight::samples`]; 0 to 1.
    pub(super) fn slant(&self, index: usize) -> f32 {
        (self.samples[index] >> 16) as f32 / 255.0
    }

    /// Whether the surface at a pixel of the samples' camera and a depth is what is seen there: nothing before it, and itself
    /// within `tolerance` metres. `None` where it is not, else how well both agree, 0 to 1.
    pub(super) fn agrees(&self, [u, v]: [f32; 2], z: f32, tolerance: f32, of_room: bool) -> Option<f32> {
        let lens = &self.lens;
        if !(u >= 0.0 && v >= 0.0) {
            return None;
        }
        let (x, y) = (u as usize, v as usize);
        if x + 1 >= lens.width || y + 1 >= lens.height {
            return None;
        }
        // A thing that stands before it covers any of the four samples around.
        let first = y * lens.width + x;
        for index in [first, first + 1, first + lens.width, first + lens.width + 1] {
            let depth = self.depth(index);
            if depth > 0.0 && depth < z - tolerance {
                return None;
            }
        }
        let nearest = ((v + 0.5) as usize) * lens.width + (u + 0.5) as usize;
        let depth = self.depth(nearest);
        let off = (depth - z).abs();
        if depth == 0.0 || off > tolerance || (of_room && self.slant(nearest) == 0.0) {
            return None;
        }
        Some(1.0 - 0.75 * off / tolerance)
    }

    /// Whether something is seen at a pixel of the samples' camera that stands before a depth, by no more than `most` metres.
    pub(super) fn shows_before(&self, [u, v]: [f32; 2], z: f32, most: f32) -> bool {
        let [x, y] = [u + 0.5, v + 0.5];
        if !(x >= 0.0 && y >= 0.0 && x < self.lens.width as f32 && y < self.lens.height as f32) {
            return false;
        }
        let depth = self.depth(y as usize * self.lens.width + x as usize);
        depth > 0.0 && (z - most..z).contains(&depth)
    }

    /// Whether what is seen at the middle of a ball (camera frame) stands far before all of it.
    pub(super) fn hides(&self, middle: &Local, radius: f32) -> bool {
        /// What stands nearer may hide the middle alone.
        const BEFORE_M: f32 = 0.3;
        if middle.z <= radius.max(NEAREST_M) {
            return false;
        }
        let [u, v] = self.lens.project(middle).map(|c| c + 0.5);
        if !(u >= 0.0 && v >= 0.0 && u < self.lens.width as f32 && v < self.lens.height as f32) {
            return false;
        }
        let depth = self.depth(v as usize * self.lens.width + u as usize);
        depth > 0.0 && depth < middle.z - radius - BEFORE_M
    }

    /// The local point at a sample of this depth.
    pub(super) fn point(&self, x: usize, y: usize, z: f32) -> Local {
        let [fx, fy] = self.lens.focal;
        let [cx, cy] = self.lens.center;
        let p = Local::new((x as f32 - cx) / fx * z, (y as f32 - cy) / fy * z, z);
        self.pose.rotation.transpose() * (p - self.pose.translation)
    }
}

/// Decodes depth and mask of each frame, once. Frames without depth are left out.
pub(super) fn load(setting: &Setting, frames: &[usize]) -> Result<Vec<FrameSight>> {
    let hidden = people::classes(setting.recording);
    let sights: Vec<Option<FrameSight>> =
        frames.par_iter().map(|&frame| sight(setting, frame, &hidden)).collect::<Result<_>>()?;
    Ok(sights.into_iter().flatten().collect())
}

fn sight(setting: &Setting, frame: usize, hidden: &[bool; 256]) -> Result<Option<FrameSight>> {
    let Setting { recording, scene, twin, .. } = *setting;
    let Some(from) = recording.frames.get(frame) else { return Ok(None) };
    let Some(depth) = recording.depth_as_read(frame)? else { return Ok(None) };
    let mask = recording.mask(frame)?;
    // A reconstruction is metric already.
    let factor = if from.files.depth.is_some() { scene.depth_factors.of(frame) as f32 } else { 1.0 };
    let camera = recording.camera_of(frame);
    let step = ((depth.data.len() as f64 / MAX_SAMPLES as f64).sqrt().ceil() as usize).max(1);
    let first = step / 2;
    let lens = SightCamera::of(&Camera {
        width: depth.width / step,
        height: depth.height / step,
        fx: camera.fx / step as f64,
        fy: camera.fy / step as f64,
        cx: (camera.cx - first as f64) / step as f64,
        cy: (camera.cy - first as f64) / step as f64,
    });
    let far = setting.config.depth_max_m as f32;
    let mut z = sampled(&depth, step, &lens, |z| {
        let z = z * factor;
        if z >= NEAREST_M && z <= far { z } else { 0.0 }
    });
    if let Some(mask) = &mask {
        let mut hands = sampled(mask, step, &lens, |class: u8| hidden[usize::from(class)]);
        // Masks end at the skin's edge, blur and depth a little beyond: a hundredth of the image.
        people::grow(&mut hands, lens.width, (lens.width / 100).max(1));
        z.iter_mut().zip(&hands).filter(|(_, hand)| **hand).for_each(|(z, _)| *z = 0.0);
    }
    let mut world_from_camera = from.world_from_camera;
    world_from_camera.translation.vector -= setting.origin.coords;
    let pose = RigidMotion::of(&world_from_camera.inverse());
    let states = twin.furniture.iter().map(|piece| {
        let joint = scene.joints.iter().position(|j| j.id == piece.part.id);
        joint.and_then(|i| setting.timelines.get(i)).map_or(State::Closed, |t| t.at(from.timestamp_secs))
    });
    let states: Vec<State> = states.collect();
    let mut sight = FrameSight { frame, step, lens, pose, states, samples: Vec::new() };
    without_arms(setting, &sight, &world_from_camera, &mut z);
    sight.samples = z
        .iter()
        .enumerate()
        .map(|(i, depth)| {
            // Neither is negative: half a step more and cut off is rounded.
            let slant = (255.0 * slant(&z, &lens, i) + 0.5) as u32;
            // To the millimetre, as depth on disk is.
            let millimetres = (*depth * 1e3 + 0.5) as u32;
            millimetres.min(0xffff) | (slant << 16)
        })
        .collect();
    without_parts(setting, &mut sight);
    Ok(Some(sight))
}

/// Every n-th pixel of an image.
fn sampled<T: Copy, S>(image: &Grid<T>, step: usize, lens: &SightCamera, of: impl Fn(T) -> S) -> Vec<S> {
    let at = |i: usize| {
        let (x, y) = (i % lens.width, i / lens.width);
        (y * step + step / 2) * image.width + x * step + step / 2
    };
    (0..lens.width * lens.height).map(|i| of(image.data[at(i)])).collect()
}

/// What a step along the ray is worth across the surface at a sample: the cosine of the surface's slant times the ray's length.
/// 0 where there is none, at specks between two surfaces, and where a surface is seen edge-on.
fn slant(z: &[f32], lens: &SightCamera, index: usize) -> f32 {
    /// Change of depth from one compared sample to the next, as a share, that is another surface.
    const JUMP: f32 = 0.06;
    let depth = z[index];
    if depth == 0.0 {
        return 0.0;
    }
    // Wide enough to average pixel noise, narrow enough for a handle.
    let reach = (lens.width / 200).max(1);
    let (x, y) = (index % lens.width, index / lens.width);
    let slope = |before: Option<usize>, after: Option<usize>| -> Option<f32> {
        let side = |other: Option<usize>| {
            let other = z[other?];
            (other > 0.0 && (other - depth).abs() <= JUMP * depth).then_some((other - depth) / reach as f32)
        };
        match (side(before), side(after)) {
            (Some(before), Some(after)) => Some(0.5 * (after - before)),
            (Some(before), None) => Some(-before),
            (None, after) => after,
        }
    };
    let along_x = slope((x >= reach).then(|| index - reach), (x + reach < lens.width).then(|| index + reach));
    let row = reach * lens.width;
    let along_y = slope((y >= reach).then(|| index - row), (y + reach < lens.height).then(|| index + row));
    let (Some(p), Some(q)) = (along_x, along_y) else { return 0.0 };
    let (dx, dy) = (x as f32 - lens.center[0], y as f32 - lens.center[1]);
    let [fx, fy] = lens.focal;
    let normal = Local::new(fx * p, fy * q, depth + dx * p + dy * q);
    let (right, down) = (dx / fx, dy / fy);
    let ray = (right * right + down * down + 1.0).sqrt();
    let worth = depth / normal.norm();
    if worth / ray >= LEAST_SLANT { worth.min(1.0) } else { 0.0 }
}

/// Takes out what is near fingertips, and near the way from them to the body: masks may be missing or miss an arm.
fn without_arms(setting: &Setting, sight: &FrameSight, world_from_camera: &Pose, z: &mut [f32]) {
    /// Of a forearm and more, metres.
    const ARM_M: f32 = 0.4;
    /// Shoulders are below the eyes, metres.
    const SHOULDER_M: f64 = 0.3;
    let recording = setting.recording;
    let reach = setting.config.hand_m as f32;
    let eye = world_from_camera.translation.vector;
    let body = (eye - recording.up() * SHOULDER_M).map(|c| c as f32);
    for hand in recording.hands_in(sight.frame, sight.frame) {
        let grasp = (hand.grasp() - setting.origin).map(|c| c as f32);
        let way = body - grasp;
        let along = way / way.norm().max(1e-3);
        let end = grasp + along * ARM_M.min(way.norm());
        let near = |p: &Local| {
            let t = (p - grasp).dot(&along).clamp(0.0, ARM_M.min(way.norm()));
            (p - (grasp + along * t)).norm() < reach
        };
        let middle = sight.pose.apply(&((grasp + end) * 0.5));
        let [xs, ys] = boxes::window(&sight.lens, &middle, 0.5 * ARM_M + reach);
        for y in ys {
            for x in xs.clone() {
                let depth = z[y * sight.lens.width + x];
                if depth > 0.0 && near(&sight.point(x, y, depth)) {
                    z[y * sight.lens.width + x] = 0.0;
                }
            }
        }
    }
}

/// Marks samples on parts, wherever these are in the frame, as no places of the room.
fn without_parts(setting: &Setting, sight: &mut FrameSight) {
    /// What estimated depth is off by, a share of it.
    const OFF: f64 = 0.01;
    let states: Vec<State> = sight.states.clone();
    for (piece, state) in setting.twin.furniture.iter().zip(states) {
        let away = (piece.part.bounds.center - setting.origin).map(|c| c as f32);
        let slab_m = setting.config.slab_m + OFF * f64::from(sight.pose.apply(&away).norm());
        for shape in boxes::of_part(&piece.part, state, slab_m) {
            let rotation: Matrix3<f32> = shape.rotation.transpose().map(|c| c as f32);
            let center = (shape.center - setting.origin).map(|c| c as f32);
            let half = shape.half.map(|c| c as f32);
            let [xs, ys] = boxes::window(&sight.lens, &sight.pose.apply(&center), half.norm());
            for y in ys {
                for x in xs.clone() {
                    let index = y * sight.lens.width + x;
                    let depth = sight.depth(index);
                    if depth == 0.0 {
                        continue;
                    }
                    let local = rotation * (sight.point(x, y, depth) - center);
                    if local.iter().zip(half.iter()).all(|(l, h)| l.abs() <= *h) {
                        sight.samples[index] &= 0xffff;
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slanted_wall_has_its_slant_and_an_edge_does_not_spoil_its_side() {
        let lens = SightCamera { width: 200, height: 150, focal: [100.0; 2], center: [99.5, 74.5] };
        let normal = Local::new(0.5, 0.1, -1.0).normalize();
        let mut z: Vec<f32> = (0..200 * 150)
            .map(|i| {
                let ray = Local::new((i % 200) as f32 - 99.5, (i / 200) as f32 - 74.5, 100.0) / 100.0;
                -2.0 / normal.dot(&ray)
            })
            .collect();
        let at = 75 * 200 + 100;
        let expected = -normal.z;
        assert!((slant(&z, &lens, at) - expected).abs() < 0.02, "{}", slant(&z, &lens, at));
        z[at + 1] = 0.5;
        assert!((slant(&z, &lens, at) - expected).abs() < 0.05, "{}", slant(&z, &lens, at));
        z[at - 1] = 0.5;
        assert_eq!(slant(&z, &lens, at), 0.0);
    }
}
