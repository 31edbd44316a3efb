//! Where the touched furniture is: confident voxels from local frames, and the global views that see them (§3.1, §3.2, §A.3).

pub mod views;
pub mod voxels;

use std::collections::{BTreeMap, HashSet};

use serde::{Deserialize, Serialize};

use crate::articulation::{Action, Outcome};
use crate::config;
use crate::hands::{Trajectory, grip_std_m};
use crate::math::Point;
use crate::math::sampling::{evenly, stride};
use crate::recording::sketch::Sketch;
use crate::recording::{AtWork, Clip, HAND_CLASS, Recording};

/// The touched piece of furniture, coarsely: `V_conf`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Region {
    /// Edge of a voxel, metres.
    pub voxel_m: f64,
    /// Confident voxels connected with the hand, as indices `floor(p / voxel_m)`, sorted.
    pub voxels: Vec<[i32; 3]>,
    /// Distinct views that a voxel needed in the end (the configured number, or fewer where nothing reached it).
    pub min_views: usize,
    /// Mask class of the touched furniture, where masks tell.
    pub class: Option<u8>,
    /// The local frames.
    pub local_frames: Vec<usize>,
    /// Frames of the whole recording in which nobody is at work that show it, too.
    #[serde(skip)]
    pub other_frames: Vec<usize>,
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

/// A recording with what was looked at of it.
#[derive(Debug, Clone, Copy)]
pub struct Footage<'a> {
    /// The recording.
    pub recording: &'a Recording,
    /// The frames that were looked at, those of [`local_frames`] among them.
    pub sketches: &'a BTreeMap<usize, Sketch>,
    /// When somebody is at work.
    pub at_work: &'a AtWork,
    /// The recording with the depth factors under which regions are found: their voxels hold its points.
    pub located: &'a Recording,
}

/// Finds the confident region of one clip, of which `frames` are the [`local_frames`].
#[must_use]
pub fn localize(
    footage: &Footage,
    clip: &Clip,
    trajectory: &Trajectory,
    frames: &[usize],
    config: &config::Localization,
    grips: &config::Grips,
) -> Outcome<Region> {
    let Footage { recording, sketches, .. } = *footage;
    let grip = trajectory.closed_grip();
    let Some(&nearest) = frames.first() else {
        return Outcome::Abstained("no frame with depth sees the grip while the furniture is closed".to_owned());
    };
    let images: Vec<&Sketch> = frames.iter().filter_map(|f| sketches.get(f)).collect();
    let class = touched_class(recording, &images, &grip, config);
    let mut seen = within_reach(recording, &images, 0, class, &grip, config);
    if seen.is_empty() {
        return Outcome::Abstained("no depth within reach of the hand in the local frames".to_owned());
    }
    // A person at a door sees half of it: frames of the whole recording in which nobody is at work show the rest.
    let others = if config.closed_state_frames { others(footage, clip, frames, &grip, config) } else { Vec::new() };
    if !others.is_empty() {
        seen.extend(within_reach(recording, &others, images.len(), class, &grip, config));
    }
    let counts = voxels::count_views(&seen, config.voxel_m);
    // A grip stands off its face by a handle, and hands are estimated to a few centimetres. One that was first seen on the way
    // is as far from where it took hold as it is uncertain; frames of the interaction itself show the part where the hand is.
    let held = trajectory.closed_end_seen() || !config.closed_state_frames;
    let near_m = if held { config.near_m } else { config.near_m + 2.0 * grip_std_m(false, grips) };
    // Fewer views than asked for where nothing reaches them: a coarse region is better than none, and it says so.
    for min_views in (1..=config.min_views).rev() {
        let confident: Vec<[i32; 3]> =
            counts.iter().filter(|(_, n)| *n as usize >= min_views).map(|(v, _)| *v).collect();
        let connected = voxels::connected_with(&confident, &grip, config.voxel_m, near_m);
        if connected.len() >= config.least_voxels {
            return Outcome::Found(Region {
                voxel_m: config.voxel_m,
                voxels: connected,
                min_views,
                class,
                local_frames: frames.to_vec(),
                other_frames: others.iter().map(|s| s.frame).collect(),
                viewpoint: recording.frames[nearest].center(),
                grip,
            });
        }
    }
    Outcome::Abstained("no confident voxels near the hand".to_owned())
}

/// Points within reach of a grip, with the number of the view that shows each, from `first` on.
fn within_reach(
    recording: &Recording,
    views: &[&Sketch],
    first: usize,
    class: Option<u8>,
    grip: &Point,
    config: &config::Localization,
) -> Vec<(u32, Point)> {
    let near = |p: &Point| (p - grip).norm() <= config.reach_m;
    let of_view = |(view, sketch): (usize, &&Sketch)| {
        let view = (first + view) as u32;
        points(recording, sketch, class).into_iter().filter(near).map(move |p| (view, p)).collect::<Vec<_>>()
    };
    views.iter().enumerate().flat_map(of_view).collect()
}

/// Points inside a region's voxels, of the views that it was found in: world, metres; at most `most_points`.
#[must_use]
pub fn inside(footage: &Footage, region: &Region, config: &config::Localization) -> Vec<Point> {
    let Footage { located, sketches, .. } = *footage;
    let frames = region.local_frames.iter().chain(&region.other_frames);
    let views: Vec<&Sketch> = frames.filter_map(|f| sketches.get(f)).collect();
    let voxels: HashSet<[i32; 3]> = region.voxels.iter().copied().collect();
    let points: Vec<Point> = within_reach(located, &views, 0, region.class, &region.grip, config)
        .into_iter()
        .map(|(_, p)| p)
        .filter(|p| voxels.contains(&voxels::index(p, region.voxel_m)))
        .collect();
    points.iter().copied().step_by(stride(points.len(), config.most_points)).collect()
}

/// Frames of the whole recording that see the grip while nobody is at work, other than the local ones: `other_frames` at most, spread
/// over the recording.
fn others<'a>(
    footage: &Footage<'a>,
    clip: &Clip,
    local: &[usize],
    grip: &Point,
    config: &config::Localization,
) -> Vec<&'a Sketch> {
    let at_work = |f: usize| (clip.start_frame..=clip.end_frame).contains(&f) || footage.at_work.any(f);
    let all: Vec<&Sketch> = footage
        .sketches
        .values()
        .filter(|s| !at_work(s.frame) && !local.contains(&s.frame) && sees(footage.recording, s.frame, grip, config))
        .collect();
    let count = all.len().min(config.other_frames);
    (0..count).map(|i| all[i * all.len() / count]).collect()
}

/// World points of a frame's depth, hands and (where there are masks) other classes left out.
#[must_use]
pub fn points(recording: &Recording, sketch: &Sketch, class: Option<u8>) -> Vec<Point> {
    let pose = &recording.frames[sketch.frame].world_from_camera;
    let factor = recording.depth_factor(sketch.frame);
    let camera = recording.camera_of(sketch.frame);
    let width = sketch.depth_mm.width;
    let mut out = Vec::new();
    for i in 0..sketch.depth_mm.data.len() {
        if sketch.class.as_ref().zip(class).is_some_and(|(of, c)| of.data[i] != c) {
            continue;
        }
        if let Some(p) = sketch.point(camera, i % width, i / width) {
            out.push(pose * Point::from(p.coords * factor));
        }
    }
    out
}

/// Frames from which the region is built, the one nearest to the interaction first.
#[must_use]
pub fn local_frames(
    recording: &Recording,
    clip: &Clip,
    trajectory: &Trajectory,
    at_work: &AtWork,
    config: &config::Localization,
) -> Vec<usize> {
    let grip = &trajectory.closed_grip();
    let [first, last] = trajectory.contact_frames();
    let usable = |frame: &usize| recording.has_depth(*frame) && sees(recording, *frame, grip, config);
    if !config.closed_state_frames {
        let active: Vec<usize> = (first..=last).filter(usable).collect();
        return evenly(&active, config.local_frames);
    }
    // What another video shows was another time.
    let video = recording.video_frames(clip.start_frame);
    // Twice as many neighbours as needed, thinned evenly: viewpoints differ and one bad frame does not decide.
    let want = 2 * config.local_frames;
    // A hand that was not seen to take hold may have moved the part before it was seen: the narration tells where.
    let [begin, end] = [
        if trajectory.ends_seen[0] { first + 1 } else { first.min(clip.start_frame) },
        if trajectory.ends_seen[1] { last.saturating_sub(1) } else { last.max(clip.end_frame) },
    ];
    let mut chosen: Vec<usize> = match trajectory.action {
        // The first moment of contact has not moved the part yet.
        Action::Open => (video.start..=begin.min(last))
            .rev()
            .filter(|f| !at_work.other(*f, clip))
            .filter(usable)
            .take(want)
            .collect(),
        Action::Close => {
            (end.max(first)..video.end).take_while(|f| !at_work.other(*f, clip)).filter(usable).take(want).collect()
        }
    };
    if chosen.len() < config.min_views {
        // The gaze left early: a recording starts with its furniture closed.
        let start =
            recording.clips.iter().filter(|c| c.end_frame > c.start_frame).map(|c| c.start_frame).min().unwrap_or(0);
        chosen.extend((0..start).rev().filter(usable).take(want - chosen.len()));
    }
    evenly(&chosen, config.local_frames)
}

/// Whether a point is in front of a frame's camera, on its image and near enough for its depth to mean something.
fn sees(recording: &Recording, frame: usize, p: &Point, config: &config::Localization) -> bool {
    let local = recording.frames[frame].world_from_camera.inverse() * p;
    let camera = recording.camera_of(frame);
    local.z < config.seen_m[1] && camera.project(&local).is_some_and(|(u, v)| camera.contains(u, v))
}

/// The class that most pixels around the grip show, at the grip's depth, in frames that see it.
fn touched_class(recording: &Recording, images: &[&Sketch], grip: &Point, config: &config::Localization) -> Option<u8> {
    let [radius_m, depth_m] = config.grip_m;
    let [least_px, most_px] = config.grip_px;
    let mut votes: BTreeMap<u8, usize> = BTreeMap::new();
    for (sketch, classes) in images.iter().filter_map(|s| Some((s, s.class.as_ref()?))) {
        let local = recording.frames[sketch.frame].world_from_camera.inverse() * grip;
        let camera = recording.camera_of(sketch.frame);
        let Some((u, v)) = camera.project(&local) else { continue };
        let radius = (radius_m / local.z * camera.fx).clamp(least_px, most_px);
        let factor = recording.depth_factor(sketch.frame);
        let step = sketch.step as f64;
        let reach = (radius / step).ceil() as i64;
        for dy in -reach..=reach {
            for dx in -reach..=reach {
                let Some((x, y)) = sketch.sample(u + dx as f64 * step, v + dy as f64 * step) else { continue };
                let i = y * sketch.depth_mm.width + x;
                let (class, z) = (classes.data[i], f64::from(sketch.depth_m(i)) * factor);
                if class != 0 && class != HAND_CLASS && z > 0.0 && (z - local.z).abs() < depth_m {
                    *votes.entry(class).or_default() += 1;
                }
            }
        }
    }
    votes.into_iter().max_by_key(|(class, n)| (*n, std::cmp::Reverse(*class))).map(|(class, _)| class)
}
