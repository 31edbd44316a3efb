//! What a frame's depth shows around a place, without hands.

use crate::config;
use crate::error::Result;
use crate::math::{Point, segment_distance};
use crate::recording::{Camera, Frame, Grid, HAND_CLASS, HandSample, Recording};

/// A frame's depth without hands.
pub(crate) struct View<'a> {
    camera: &'a Camera,
    frame: &'a Frame,
    depth: Grid<f32>,
    mask: Option<Grid<u8>>,
    /// Bones of the hands that the mask misses, in pixels: ends and half width.
    bones: Vec<([f64; 2], [f64; 2], f64)>,
    /// Pixels by which masks are taken to be off at a hand's rim.
    rim: isize,
}

impl<'a> View<'a> {
    /// `None` where the frame has no depth of its own.
    pub(crate) fn of(recording: &'a Recording, index: usize, config: &config::Contact) -> Result<Option<Self>> {
        let Some(frame) = recording.frames.get(index).filter(|f| f.files.depth.is_some()) else { return Ok(None) };
        let Some(depth) = recording.depth(index)? else { return Ok(None) };
        let mask = recording.mask(index)?;
        let camera = recording.camera_of(index);
        let rim = ((camera.width as f64 / config.mask_rims).round() as isize).max(1);
        let mut view = Self { camera, frame, depth, mask, bones: Vec::new(), rim };
        for hand in recording.hands_in(index, index) {
            view.bones.extend(view.missed_bones(hand, config.finger_half_m));
        }
        Ok(Some(view))
    }

    /// A hand's bones where the mask does not show the hand.
    fn missed_bones(&self, hand: &HandSample, half_width_m: f64) -> Vec<([f64; 2], [f64; 2], f64)> {
        let camera_from_world = self.frame.world_from_camera.inverse();
        let camera = self.camera;
        let on_image = |p: &Point| {
            let local = camera_from_world * p;
            camera.project(&local).map(|(u, v)| ([u, v], half_width_m * camera.fx / local.z))
        };
        let points = hand.skeleton();
        let seen: Vec<[f64; 2]> = points.iter().filter_map(|p| on_image(p).map(|(uv, _)| uv)).collect();
        let masked = seen.iter().filter(|uv| self.is_masked(uv[0], uv[1])).count();
        if seen.is_empty() || 3 * masked > seen.len() {
            return Vec::new();
        }
        let bones = hand.bones();
        bones
            .iter()
            .filter_map(|[a, b]| {
                let ((a, wide), (b, _)) = (on_image(a)?, on_image(b)?);
                Some((a, b, wide))
            })
            .collect()
    }

    fn is_masked(&self, u: f64, v: f64) -> bool {
        let Some(mask) = &self.mask else { return false };
        let (u, v) = (u.round() as isize, v.round() as isize);
        [-self.rim, 0, self.rim].iter().any(|dv| {
            [-self.rim, 0, self.rim].iter().any(|du| {
                let (x, y) = (u + du, v + dv);
                x >= 0
                    && y >= 0
                    && (x as usize) < mask.width
                    && (y as usize) < mask.height
                    && mask.data[y as usize * mask.width + x as usize] == HAND_CLASS
            })
        })
    }

    fn is_hand(&self, u: f64, v: f64) -> bool {
        self.is_masked(u, v) || self.bones.iter().any(|(a, b, wide)| segment_distance([u, v], *a, *b) < *wide)
    }

    /// Distance to the nearest surface that is not a hand, at most `contact.reach_m`; `None` where the place is not in view.
    pub(crate) fn nearest_m(&self, place: &Point, config: &config::Contact) -> Option<f64> {
        let camera = self.camera;
        let local = self.frame.world_from_camera.inverse() * place;
        let (u, v) = camera.project(&local).filter(|(u, v)| camera.contains(*u, *v))?;
        let pixels_per_m = camera.fx / local.z;
        let step = ((config.surface_step_m * pixels_per_m) as usize).max(1);
        let reach = config.reach_m * pixels_per_m;
        let range = |c: f64, size: usize| {
            let (low, high) = ((c - reach).max(0.0) as usize, (c + reach).max(0.0) as usize);
            (low / step * step..(high + 1).min(size)).step_by(step)
        };
        let mut best = config.reach_m;
        for y in range(v, self.depth.height) {
            for x in range(u, self.depth.width) {
                let z = f64::from(self.depth.data[y * self.depth.width + x]);
                if z <= 0.0 || (z - local.z).abs() >= best {
                    continue;
                }
                let distance = (camera.unproject(x as f64, y as f64, z) - local).norm();
                if distance < best && !self.is_hand(x as f64, y as f64) {
                    best = distance;
                }
            }
        }
        Some(best)
    }

    /// Depth of this view's surfaces around a place as the other view sees it there, and as it has to be there, metres along the
    /// other's axis. Without hands, and without what the other view does not show.
    pub(crate) fn depth_against(&self, other: &View, place: &Point, reach_m: f64, step_m: f64) -> Vec<(f64, f64)> {
        let camera = self.camera;
        let local = self.frame.world_from_camera.inverse() * place;
        if local.z < 0.1 {
            return Vec::new();
        }
        let step = ((step_m * camera.fx / local.z) as usize).max(1);
        let other_from_own = other.frame.world_from_camera.inverse() * self.frame.world_from_camera;
        let mut pairs = Vec::new();
        for y in (0..self.depth.height).step_by(step) {
            for x in (0..self.depth.width).step_by(step) {
                let z = f64::from(self.depth.data[y * self.depth.width + x]);
                if z <= 0.0 {
                    continue;
                }
                let point = camera.unproject(x as f64, y as f64, z);
                if (point - local).norm() > reach_m || self.is_hand(x as f64, y as f64) {
                    continue;
                }
                let there = other_from_own * point;
                let pixel = other.camera.project(&there).filter(|(u, v)| other.camera.contains(*u, *v));
                let Some((u, v)) = pixel.filter(|(u, v)| !other.is_hand(*u, *v)) else { continue };
                pairs.extend(other.depth.nearest(u, v).filter(|z| *z > 0.0).map(|z| (f64::from(z), there.z)));
            }
        }
        pairs
    }
}
