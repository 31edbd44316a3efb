//! What is kept of each chosen frame: depth at no more than VGA resolution, with hands taken out, how surfaces slant, and which
//! of it is the room's.

use nalgebra::Matrix3;
use rayon::prelude::*;

use super::frames::{State, Timeline};
use super::{Local, Motion, boxes};
use crate::config;
use crate::error::Result;
use crate::math::{Point, Pose};
use crate::pipeline::Scene;
use crate::recording::{Camera, Grid, HAND_CLASS, Recording};
use crate::twin::Twin;

/// Samples kept of a frame at the most: VGA.
const MAX_SAMPLES: usize = 640 * 480;
/// Nearer than this there are hands and hair, metres.
const NEAREST_M: f32 = 0.15;
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
pub(super) struct Sight {
    pub(super) frame: usize,
    /// Pixels of the full image between samples.
    pub(super) step: usize,
    /// Its pixels are the samples.
    pub(super) lens: Lens,
    /// Camera from local.
    pub(super) pose: Motion,
    /// Of each of the twin's parts.
    pub(super) states: Vec<State>,
    /// A sample each: depth in millimetres (16 bits, 0 = none or a hand), then what a step along the ray is worth across the
    /// surface (8 bits, 255 = all of it; 0 = no place of the room: grazing, at an edge, or on a part).
    pub(super) samples: Vec<u32>,
}

/// A pinhole camera in single precision.
#[derive(Debug, Clone, Copy)]
pub(super) struct Lens {
    pub(super) width: usize,
    pub(super) height: usize,
    pub(super) focal: [f32; 2],
    pub(super) center: [f32; 2],
}

impl Lens {
    fn of(camera: &Camera) -> Self {
        Self {
            width: camera.width,
            height: camera.height,
            focal: [camera.fx as f32, camera.fy as f32],
            center: [camera.cx as f32, camera.cy as f32],
        }
    }

    /// Pixel of a point before the camera.
    pub(super) fn project(&self, p: &Local) -> [f32; 2] {
        let inverse = 1.0 / p.z;
        [self.focal[0] * p.x * inverse + self.center[0], self.focal[1] * p.y * inverse + self.center[1]]
    }

    /// Whether some of a ball (camera frame) may be in the image.
    pub(super) fn meets(&self, middle: &Local, radius: f32) -> bool {
        if middle.z + radius < NEAREST_M {
            return false;
        }
        // Distance to each side plane of the frustum, which runs through the eye.
        let beyond = |along: f32, focal: f32, low: f32, high: f32| {
            let side = |edge: f32, sense: f32| {
                let slope = edge / focal;
                sense * (along - slope * middle.z) / slope.hypot(1.0) > radius
            };
            side(low, -1.0) || side(high, 1.0)
        };
        let [w, h] = [self.width as f32, self.height as f32];
        !beyond(middle.x, self.focal[0], -0.5 - self.center[0], w - 0.5 - self.center[0])
            && !beyond(middle.y, self.focal[1], -0.5 - self.center[1], h - 0.5 - self.center[1])
    }
}

impl Sight {
    /// Depth of a sample, metres; 0 = none.
    pub(super) fn depth(&self, index: usize) -> f32 {
        (self.samples[index] & 0xffff) as f32 * 1e-3
    }

    /// See [`Sight::samples`]; 0 to 1.
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
pub(super) fn load(setting: &Setting, frames: &[usize]) -> Result<Vec<Sight>> {
    let hidden = hidden_classes(setting.recording);
    let sights: Vec<Option<Sight>> =
        frames.par_iter().map(|&frame| sight(setting, frame, &hidden)).collect::<Result<_>>()?;
    Ok(sights.into_iter().flatten().collect())
}

/// Mask classes of hands and people.
fn hidden_classes(recording: &Recording) -> [bool; 256] {
    let mut hidden = [false; 256];
    hidden[usize::from(HAND_CLASS)] = true;
    for (class, name) in &recording.labels {
        hidden[usize::from(*class)] |= is_of_person(name);
    }
    hidden
}

/// Whether a class is of a person: "left hand", not "hand towel".
fn is_of_person(name: &str) -> bool {
    const PEOPLE: [&str; 12] = [
        "hand", "hands", "arm", "arms", "forearm", "forearms", "finger", "fingers", "person", "people", "human",
        "wearer",
    ];
    const BESIDE: [&str; 6] = ["left", "right", "camera", "the", "of", "s"];
    let name = name.to_lowercase();
    let words = || name.split(|c: char| !c.is_alphabetic()).filter(|word| !word.is_empty());
    words().any(|word| PEOPLE.contains(&word)) && words().all(|word| PEOPLE.contains(&word) || BESIDE.contains(&word))
}

fn sight(setting: &Setting, frame: usize, hidden: &[bool; 256]) -> Result<Option<Sight>> {
    let Setting { recording, scene, twin, .. } = *setting;
    let Some(from) = recording.frames.get(frame) else { return Ok(None) };
    let Some(depth) = recording.depth_as_read(frame)? else { return Ok(None) };
    let mask = recording.mask(frame)?;
    // A reconstruction is metric already.
    let factor = if from.files.depth.is_some() { scene.depth_factors.of(frame) as f32 } else { 1.0 };
    let camera = &recording.camera;
    let step = ((depth.data.len() as f64 / MAX_SAMPLES as f64).sqrt().ceil() as usize).max(1);
    let first = step / 2;
    let lens = Lens::of(&Camera {
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
        grow(&mut hands, lens.width, (lens.width / 100).max(1));
        z.iter_mut().zip(&hands).filter(|(_, hand)| **hand).for_each(|(z, _)| *z = 0.0);
    }
    let mut world_from_camera = from.world_from_camera;
    world_from_camera.translation.vector -= setting.origin.coords;
    let pose = Motion::of(&world_from_camera.inverse());
    let states = twin.furniture.iter().map(|piece| {
        let joint = scene.joints.iter().position(|j| j.id == piece.part.id);
        joint.and_then(|i| setting.timelines.get(i)).map_or(State::Closed, |t| t.at(from.timestamp_secs))
    });
    let states: Vec<State> = states.collect();
    let mut sight = Sight { frame, step, lens, pose, states, samples: Vec::new() };
    without_arms(setting, &sight, &world_from_camera, &mut z);
    sight.samples = z
        .iter()
        .enumerate()
        .map(|(i, depth)| {
            let slant = (255.0 * slant(&z, &lens, i)).round() as u32;
            // Rounded to the millimetre, as depth on disk is.
            let millimetres = (*depth * 1e3).round() as u32;
            millimetres.min(0xffff) | (slant << 16)
        })
        .collect();
    without_parts(setting, &mut sight);
    Ok(Some(sight))
}

/// Every n-th pixel of an image.
fn sampled<T: Copy, S>(image: &Grid<T>, step: usize, lens: &Lens, of: impl Fn(T) -> S) -> Vec<S> {
    let at = |i: usize| {
        let (x, y) = (i % lens.width, i / lens.width);
        (y * step + step / 2) * image.width + x * step + step / 2
    };
    (0..lens.width * lens.height).map(|i| of(image.data[at(i)])).collect()
}

/// Grows what is marked by some samples to all four sides, row by row and column by column.
fn grow(marked: &mut [bool], width: usize, reach: usize) {
    let height = marked.len() / width.max(1);
    let mut spread = |start: usize, stride: usize, count: usize| {
        let line: Vec<bool> = (0..count).map(|i| marked[start + i * stride]).collect();
        for at in (0..count).filter(|&i| line[i]) {
            // Only the ends of a run mark anything new.
            let inner = at > 0 && line[at - 1] && at + 1 < count && line[at + 1];
            if !inner {
                for i in at.saturating_sub(reach)..(at + reach + 1).min(count) {
                    marked[start + i * stride] = true;
                }
            }
        }
    };
    (0..height).for_each(|y| spread(y * width, 1, width));
    (0..width).for_each(|x| spread(x, width, height));
}

/// What a step along the ray is worth across the surface at a sample: the cosine of the surface's slant times the ray's length.
/// 0 where there is none, at specks between two surfaces, and where a surface is seen edge-on.
fn slant(z: &[f32], lens: &Lens, index: usize) -> f32 {
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
    let ray = (dx / fx).hypot(dy / fy).hypot(1.0);
    let worth = depth / normal.norm();
    if worth / ray >= LEAST_SLANT { worth.min(1.0) } else { 0.0 }
}

/// Takes out what is near fingertips, and near the way from them to the body: masks may be missing or miss an arm.
fn without_arms(setting: &Setting, sight: &Sight, world_from_camera: &Pose, z: &mut [f32]) {
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
fn without_parts(setting: &Setting, sight: &mut Sight) {
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
    fn hands_are_of_a_person_and_hand_towels_are_not() {
        for (name, expected) in
            [("left_hand", true), ("Person", true), ("hand towel", false), ("armchair", false), ("left", false)]
        {
            assert_eq!(is_of_person(name), expected, "{name}");
        }
    }

    #[test]
    fn a_mark_grows_to_a_square() {
        let mut marked = vec![false; 49];
        marked[24] = true;
        grow(&mut marked, 7, 2);
        let expected: Vec<bool> = (0..49).map(|i| (1..=5).contains(&(i % 7)) && (1..=5).contains(&(i / 7))).collect();
        assert_eq!(marked, expected);
    }

    #[test]
    fn a_slanted_wall_has_its_slant_and_an_edge_does_not_spoil_its_side() {
        let lens = Lens { width: 200, height: 150, focal: [100.0; 2], center: [99.5, 74.5] };
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

    #[test]
    fn balls_outside_the_image_are_told_from_those_at_its_rim() {
        let lens = Lens { width: 100, height: 80, focal: [50.0; 2], center: [49.5, 39.5] };
        for (middle, radius, expected) in [
            ([0.0, 0.0, 2.0], 0.1, true),
            ([2.1, 0.0, 2.0], 0.2, true),
            ([2.5, 0.0, 2.0], 0.2, false),
            ([0.0, -3.0, 2.0], 0.2, false),
            ([0.0, 0.0, -1.0], 0.2, false),
        ] {
            assert_eq!(lens.meets(&Local::from(middle), radius), expected, "{middle:?}");
        }
    }
}
