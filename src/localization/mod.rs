//! Where the touched furniture is: confident voxels from local frames, and the global views that see them (§3.1, §3.2, §A.3).

pub mod views;
pub mod voxels;

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::articulation::{Action, Outcome};
use crate::config;
use crate::error::Result;
use crate::hands::Trajectory;
use crate::math::Point;
use crate::recording::{Clip, Grid, HAND_CLASS, Recording};

/// The touched piece of furniture, coarsely: `V_conf`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Region {
    /// Edge of a voxel, metres.
    pub voxel_m: f64,
    /// Confident voxels connected with the hand, as indices `floor(p / voxel_m)`, sorted.
    pub voxels: Vec<[i32; 3]>,
    /// Distinct views that a voxel needed in the end (the configured number, or fewer where nothing reached it).
    pub min_views: usize,
    /// Points of the local frames inside the confident voxels, world, metres.
    #[serde(skip)]
    pub points: Vec<Point>,
    /// Mask class of the touched furniture, where masks tell.
    pub class: Option<u8>,
    /// The local frames.
    pub local_frames: Vec<usize>,
    /// Camera centre of the local frame nearest to the interaction: the side from which the furniture is used.
    pub viewpoint: Point,
    /// The grip at the closed end.
    pub grip: Point,
}

impl Region {
    /// Centres of the confident voxels.
    #[must_use]
    pub fn centers(&self) -> Vec<Point> {
        self.voxels.iter().map(|v| voxels::center(v, self.voxel_m)).collect()
    }
}

/// A decoded local frame: its index, depth and mask.
type LocalImage = (usize, Grid<f32>, Option<Grid<u8>>);

/// Finds the confident region of one clip.
pub fn localize(
    recording: &Recording,
    clip: &Clip,
    trajectory: &Trajectory,
    config: &config::Localization,
) -> Result<Outcome<Region>> {
    let grip = trajectory.closed_grip();
    let frames = local_frames(recording, clip, trajectory, &grip, config);
    let Some(&nearest) = frames.first() else {
        return Ok(Outcome::Abstained("no frame with depth sees the grip while the furniture is closed".to_owned()));
    };
    let mut images: Vec<LocalImage> = Vec::new();
    for &frame in &frames {
        if let Some(depth) = recording.depth(frame)? {
            images.push((frame, depth, recording.mask(frame)?));
        }
    }
    let class = touched_class(recording, &images, &grip);
    let mut seen: Vec<(u32, Point)> = Vec::new();
    for (view, (frame, depth, mask)) in images.iter().enumerate() {
        for p in points(recording, *frame, depth, mask.as_ref(), class, config.pixel_step) {
            if (p - grip).norm() <= config.reach_m {
                seen.push((view as u32, p));
            }
        }
    }
    if seen.is_empty() {
        return Ok(Outcome::Abstained("no depth within reach of the hand in the local frames".to_owned()));
    }
    let counts = voxels::count_views(&seen, config.voxel_m);
    // Fewer views than asked for where nothing reaches them: a coarse region is better than none, and it says so.
    for min_views in (1..=config.min_views.min(images.len())).rev() {
        let confident: Vec<[i32; 3]> =
            counts.iter().filter(|(_, n)| **n as usize >= min_views).map(|(v, _)| *v).collect();
        let connected = voxels::connected_with(&confident, &grip, config.voxel_m);
        // A face of 30 x 30 cm fills 36 voxels of 5 cm; a third of that is no furniture.
        if connected.len() >= 12 {
            let inside: std::collections::HashSet<[i32; 3]> = connected.iter().copied().collect();
            let points = seen
                .iter()
                .filter(|(_, p)| inside.contains(&voxels::index(p, config.voxel_m)))
                .map(|(_, p)| *p)
                .collect();
            return Ok(Outcome::Found(Region {
                voxel_m: config.voxel_m,
                voxels: connected,
                min_views,
                points,
                class,
                local_frames: frames,
                viewpoint: recording.frames[nearest].center(),
                grip,
            }));
        }
    }
    Ok(Outcome::Abstained("no confident voxels near the hand".to_owned()))
}

/// World points of a frame's depth, hands and other classes left out.
#[must_use]
pub fn points(
    recording: &Recording,
    frame: usize,
    depth: &Grid<f32>,
    mask: Option<&Grid<u8>>,
    class: Option<u8>,
    step: usize,
) -> Vec<Point> {
    let pose = &recording.frames[frame].world_from_camera;
    let step = step.max(1);
    let mut out = Vec::new();
    for y in (0..depth.height).step_by(step) {
        for x in (0..depth.width).step_by(step) {
            let z = depth.data[y * depth.width + x];
            if z <= 0.0 || !z.is_finite() {
                continue;
            }
            if let Some(mask) = mask {
                let here = mask.data[y * depth.width + x];
                if here == HAND_CLASS || class.is_some_and(|c| here != c) {
                    continue;
                }
            }
            out.push(pose * recording.camera.unproject(x as f64, y as f64, f64::from(z)));
        }
    }
    out
}

/// Frames from which the region is built, the one nearest to the interaction first.
fn local_frames(
    recording: &Recording,
    clip: &Clip,
    trajectory: &Trajectory,
    grip: &Point,
    config: &config::Localization,
) -> Vec<usize> {
    let [first, last] = trajectory.contact_frames();
    let usable = |frame: &usize| {
        let f = &recording.frames[*frame];
        (f.files.depth.is_some() || !recording.reconstruction.is_empty()) && sees(recording, *frame, grip)
    };
    if !config.closed_state_frames {
        let active: Vec<usize> = (first..=last).filter(usable).collect();
        return spread(&active, config.local_frames);
    }
    let in_other_clip = |frame: usize| {
        recording.clips.iter().any(|c| {
            c.clip != clip.clip && (c.start_frame..=c.end_frame).contains(&frame) && c.end_frame > c.start_frame
        })
    };
    // Twice as many neighbours as needed, thinned evenly: viewpoints differ and one bad frame does not decide.
    let want = 2 * config.local_frames;
    let mut chosen: Vec<usize> = match trajectory.action {
        // The first moment of contact has not moved the part yet.
        Action::Open => {
            (0..=(first + 1).min(last)).rev().filter(|f| !in_other_clip(*f)).filter(usable).take(want).collect()
        }
        Action::Close => (last.saturating_sub(1).max(first)..recording.frames.len())
            .take_while(|f| !in_other_clip(*f))
            .filter(usable)
            .take(want)
            .collect(),
    };
    if chosen.len() < config.min_views {
        // The gaze left early: a recording starts with its furniture closed.
        let start =
            recording.clips.iter().filter(|c| c.end_frame > c.start_frame).map(|c| c.start_frame).min().unwrap_or(0);
        chosen.extend((0..start).rev().filter(usable).take(want - chosen.len()));
    }
    spread(&chosen, config.local_frames)
}

/// Evenly spaced members of a list, its first member always among them.
fn spread(list: &[usize], count: usize) -> Vec<usize> {
    if list.len() <= count {
        return list.to_vec();
    }
    (0..count).map(|i| list[i * (list.len() - 1) / count.saturating_sub(1).max(1)]).collect()
}

/// Whether a point is in front of a frame's camera, on its image and near enough for its depth to mean something.
fn sees(recording: &Recording, frame: usize, p: &Point) -> bool {
    let local = recording.frames[frame].world_from_camera.inverse() * p;
    // Beyond three metres a metre-scale depth estimate is worth less than a voxel.
    local.z < 3.0 && recording.camera.project(&local).is_some_and(|(u, v)| recording.camera.contains(u, v))
}

/// The class that most pixels around the grip show, at the grip's depth, in frames that see it.
fn touched_class(recording: &Recording, images: &[LocalImage], grip: &Point) -> Option<u8> {
    // A fist's size around the grip, and the depth of a handle with its face behind it.
    const RADIUS_M: f64 = 0.06;
    const DEPTH_M: f64 = 0.12;
    let mut votes: BTreeMap<u8, usize> = BTreeMap::new();
    for (frame, depth, mask) in images {
        let Some(mask) = mask else { continue };
        let local = recording.frames[*frame].world_from_camera.inverse() * grip;
        let Some((u, v)) = recording.camera.project(&local) else { continue };
        let radius = (RADIUS_M / local.z * recording.camera.fx).clamp(3.0, 80.0) as i64;
        for dy in -radius..=radius {
            for dx in -radius..=radius {
                let (x, y) = (u + dx as f64, v + dy as f64);
                let (Some(class), Some(z)) = (mask.nearest(x, y), depth.nearest(x, y)) else { continue };
                if class != 0 && class != HAND_CLASS && z > 0.0 && (f64::from(z) - local.z).abs() < DEPTH_M {
                    *votes.entry(class).or_default() += 1;
                }
            }
        }
    }
    votes.into_iter().max_by_key(|(class, n)| (*n, std::cmp::Reverse(*class))).map(|(class, _)| class)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spreading_keeps_the_nearest_frame() {
        assert_eq!(spread(&[9, 8, 7, 6, 5, 4, 3, 2, 1], 3), [9, 5, 1]);
        assert_eq!(spread(&[4, 3], 5), [4, 3]);
        assert_eq!(spread(&[], 5), [0usize; 0]);
    }
}
