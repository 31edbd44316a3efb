//! Segments of several views that are one line in the world (§3.2: "2D line correspondences", left open by the paper).
//!
//! The paper's method fits a line to the unprojected points of all views ([`unprojected`]). Ours ([`triangulated`]) finds it
//! from the planes that each view's segment spans with its camera: depth, which is off by centimetres, only says which
//! segments belong together.

use std::collections::{BTreeMap, HashMap, HashSet};

use nalgebra::Matrix3;
use rayon::prelude::*;

pub use super::line_track::LineTrack;
use super::line_track::best_first;
use super::segments::{LiftedSegment, fit_segment};
use super::triangulation::{span_on, triangulate, views_of};
use crate::config;
use crate::localization::{Region, voxels};
use crate::math::line::Segment;
use crate::math::{Point, unsigned_angle};
use crate::recording::Recording;

/// Lines that run along the region, cut to the stretch that does. Best supported first.
#[must_use]
pub fn at_region(tracks: &[LineTrack], region: &Region) -> Vec<LineTrack> {
    let near = Nearness::new(region);
    let mut out: Vec<LineTrack> = tracks
        .iter()
        .filter_map(|t| {
            let span = near.stretch(&t.segment)?;
            let middle = 0.5 * (span[0] + span[1]);
            // The covariance of the direction moves with the middle only where it stays near it; a rod's ends are less sure.
            let lever = middle - 0.5 * (t.segment.span[0] + t.segment.span[1]);
            Some(LineTrack {
                segment: Segment { span, ..t.segment },
                position_covariance: t.position_covariance + t.direction_covariance * (lever * lever),
                ..t.clone()
            })
        })
        .collect();
    best_first(&mut out);
    out
}

/// The surroundings of a region: its confident voxels and their neighbours.
struct Nearness {
    voxels: HashSet<[i32; 3]>,
    voxel_m: f64,
}

impl Nearness {
    fn new(region: &Region) -> Self {
        let mut voxels = HashSet::new();
        for [x, y, z] in &region.voxels {
            for i in 0..27 {
                voxels.insert([x + i % 3 - 1, y + i / 3 % 3 - 1, z + i / 9 - 1]);
            }
        }
        Self { voxels, voxel_m: region.voxel_m }
    }

    /// The stretch of a segment that runs along the region; `None` where that is under three voxels, or under two fifths of
    /// a segment shorter than that.
    fn stretch(&self, segment: &Segment) -> Option<[f64; 2]> {
        let count = (2.0 * segment.length() / self.voxel_m).ceil().max(4.0) as usize;
        let at = |i: usize| segment.span[0] + segment.length() * i as f64 / count as f64;
        let inside = |i: &usize| {
            let p = segment.line.point + segment.line.direction * at(*i);
            self.voxels.contains(&voxels::index(&p, self.voxel_m))
        };
        let hits = (0..=count).filter(inside).count();
        let first = (0..=count).find(inside)?;
        let last = (0..=count).rev().find(inside)?;
        let along = hits as f64 / (count + 1) as f64 * segment.length();
        (along >= (3.0 * self.voxel_m).min(0.4 * segment.length()) && last > first).then(|| [at(first), at(last)])
    }
}

/// The paper's lines: lifted segments of a clip's views at its region, grouped and fitted with LO-RANSAC.
#[must_use]
pub fn unprojected(lifted: &[&LiftedSegment], region: &Region, config: &config::Geometry, seed: u64) -> Vec<LineTrack> {
    let around = Nearness::new(region);
    let near: Vec<&LiftedSegment> = lifted.iter().copied().filter(|s| around.stretch(&s.segment).is_some()).collect();
    let mut tracks: Vec<LineTrack> = groups(&near, config)
        .into_iter()
        .enumerate()
        .filter_map(|(i, members)| {
            let views = views_of(&members);
            if views.len() < config.min_track_views {
                return None;
            }
            let samples: Vec<Point> = members.iter().flat_map(|m| m.samples.iter().copied()).collect();
            let segment = fit_segment(&samples, config, seed ^ (i as u64) << 20)?;
            let near: Vec<f64> = samples
                .iter()
                .map(|p| segment.line.distance(p).powi(2))
                .filter(|d| *d <= config.line_tolerance_m.powi(2))
                .collect();
            let variance = near.iter().sum::<f64>() / near.len().max(1) as f64;
            // The points of a view share their errors: as many independent ones as there are views.
            let across = Matrix3::identity() - segment.line.direction * segment.line.direction.transpose();
            let position_covariance = across * (0.5 * variance / views.len() as f64);
            let lever = (segment.length() / 12f64.sqrt()).max(config.tracks.least_lever_m);
            let direction_covariance = position_covariance / (lever * lever);
            Some(LineTrack { segment, views, rms_m: variance.sqrt(), position_covariance, direction_covariance })
        })
        .collect();
    best_first(&mut tracks);
    tracks
}

/// Lines of the whole scene from the segments of all views.
#[must_use]
pub fn triangulated(
    recording: &Recording,
    lifted: &[&LiftedSegment],
    config: &config::Geometry,
    seed: u64,
) -> Vec<LineTrack> {
    let mut tracks: Vec<LineTrack> = Vec::new();
    let mut left: Vec<&LiftedSegment> = lifted.to_vec();
    // Depth groups coarsely: of two edges a few centimetres apart the better seen one wins a group, and what it leaves
    // makes a group of its own in the next round.
    for _ in 0..config.tracks.rounds {
        let fresh: Vec<LineTrack> =
            groups(&left, config).par_iter().filter_map(|m| triangulate(recording, m, config, seed)).collect();
        if fresh.is_empty() {
            break;
        }
        tracks.extend(fresh);
        tracks = merged(tracks, &config.tracks);
        let (assigned, rest) = assign(recording, &left, &tracks, &config.tracks);
        let settled: Vec<LineTrack> =
            assigned.par_iter().filter_map(|m| triangulate(recording, m, config, seed)).collect();
        // A track that lost its members to a neighbour keeps what earlier rounds gave it.
        tracks = merged(tracks.into_iter().chain(settled).collect(), &config.tracks);
        left = rest;
    }
    best_first(&mut tracks);
    tracks
}

/// A grid of the places that segments run through.
struct Places {
    cells: HashMap<[i32; 3], Vec<u32>>,
}

impl Places {
    /// Numerics: about the reach of a comparison: a segment is looked for in its own cell and the ones around it.
    const CELL_M: f64 = 0.2;

    fn add(&mut self, id: usize, segment: &Segment) {
        let steps = (segment.length() / (0.5 * Self::CELL_M)).ceil().max(1.0) as usize;
        let mut last = None;
        for i in 0..=steps {
            let at = segment.span[0] + segment.length() * i as f64 / steps as f64;
            let cell = voxels::index(&(segment.line.point + segment.line.direction * at), Self::CELL_M);
            if last != Some(cell) {
                self.cells.entry(cell).or_default().push(id as u32);
                last = Some(cell);
            }
        }
    }

    /// Ids of segments that run near a point, ascending.
    fn near(&self, p: &Point, out: &mut Vec<u32>) {
        out.clear();
        let [x, y, z] = voxels::index(p, Self::CELL_M);
        for dx in -1..=1 {
            for dy in -1..=1 {
                for dz in -1..=1 {
                    out.extend(self.cells.get(&[x + dx, y + dy, z + dz]).into_iter().flatten());
                }
            }
        }
        out.sort_unstable();
        out.dedup();
    }
}

/// Greedy groups of segments that can be one line, by angle, distance and overlap in space.
fn groups<'a>(lifted: &[&'a LiftedSegment], config: &config::Geometry) -> Vec<Vec<&'a LiftedSegment>> {
    let mut order: Vec<&LiftedSegment> = lifted.to_vec();
    // Long segments found the groups: their direction is known best.
    order.sort_by(|a, b| b.segment.length().total_cmp(&a.segment.length()).then(a.view.cmp(&b.view)));
    let mut places = Places { cells: HashMap::new() };
    let mut groups: Vec<Vec<&LiftedSegment>> = Vec::new();
    let mut near = Vec::new();
    for candidate in order {
        places.near(&candidate.segment.middle(), &mut near);
        let home = near.iter().find(|&&g| same_line(&groups[g as usize][0].segment, &candidate.segment, config));
        match home {
            Some(&g) => groups[g as usize].push(candidate),
            None => {
                places.add(groups.len(), &candidate.segment);
                groups.push(vec![candidate]);
            }
        }
    }
    groups
}

/// Whether two lifted segments can be one line: near in angle and distance, and overlapping or nearly so.
fn same_line(a: &Segment, b: &Segment, config: &config::Geometry) -> bool {
    if unsigned_angle(&a.line.direction, &b.line.direction) > config.track_angle_deg.to_radians() {
        return false;
    }
    let ends = b.ends();
    if ends.iter().any(|p| a.line.distance(p) > config.track_distance_m) {
        return false;
    }
    let coordinates = ends.map(|p| a.line.coordinate(&p));
    let low = coordinates[0].min(coordinates[1]);
    let high = coordinates[0].max(coordinates[1]);
    low <= a.span[1] + config.tracks.gap_m && high >= a.span[0] - config.tracks.gap_m
}

/// Gives each segment to the track that its image shows best: by the track's projection into its view. Returns the members
/// of each track and the segments that no track explains.
fn assign<'a>(
    recording: &Recording,
    lifted: &[&'a LiftedSegment],
    tracks: &[LineTrack],
    rules: &config::Tracks,
) -> (Vec<Vec<&'a LiftedSegment>>, Vec<&'a LiftedSegment>) {
    let mut places = Places { cells: HashMap::new() };
    for (i, track) in tracks.iter().enumerate() {
        places.add(i, &track.segment);
    }
    let inverses: BTreeMap<usize, crate::math::Pose> =
        lifted.iter().map(|s| (s.view, recording.frames[s.view].world_from_camera.inverse())).collect();
    let mut members: Vec<Vec<&LiftedSegment>> = vec![Vec::new(); tracks.len()];
    let mut rest = Vec::new();
    let mut near = Vec::new();
    for &segment in lifted {
        places.near(&segment.segment.middle(), &mut near);
        let best = near
            .iter()
            .filter_map(|&t| {
                let cost = misfit(recording, &inverses[&segment.view], segment, &tracks[t as usize], rules)?;
                Some((cost, t))
            })
            .min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        match best {
            Some((_, t)) => members[t as usize].push(segment),
            None => rest.push(segment),
        }
    }
    (members, rest)
}

/// How far a segment's image lies from a track's, in tolerances; `None` where it is another line.
fn misfit(
    recording: &Recording,
    camera_from_world: &crate::math::Pose,
    segment: &LiftedSegment,
    track: &LineTrack,
    rules: &config::Tracks,
) -> Option<f64> {
    let direction = &track.segment.line.direction;
    if unsigned_angle(direction, &segment.segment.line.direction) > rules.assigned_turn_rad {
        return None;
    }
    let middle = segment.segment.middle();
    let range = (middle - segment.eye).norm();
    let tolerance =
        2.0 * (range * rules.detection_std_px / recording.camera_of(segment.view).fx).hypot(rules.pose_std_m);
    let across = segment.plane.dot(&(track.segment.line.point - segment.eye)).abs();
    let turn = segment.plane.dot(direction).abs();
    if turn > rules.assigned_rad + 1.7 * tolerance / segment.segment.length().max(rules.least_length_m) {
        return None;
    }
    // The track's point nearest to the segment lies in the viewing plane, on the segment's stretch, and about as far away.
    let [low, high] = span_on(&track.segment.line, segment)?;
    if low > track.segment.span[1] + rules.beyond_m || high < track.segment.span[0] - rules.beyond_m {
        return None;
    }
    let at = (0.5 * (low + high)).clamp(track.segment.span[0], track.segment.span[1]);
    let p = track.segment.line.point + direction * at;
    let off = segment.plane.dot(&(p - segment.eye)).abs().min(across.max(0.0));
    let local = camera_from_world * p;
    let depth = (local.z - (camera_from_world * middle).z).abs();
    if off > tolerance || depth > rules.depth_slack_m + 2.0 * rules.depth_std * range {
        return None;
    }
    Some(off / tolerance + turn / rules.assigned_rad + depth / range)
}

/// Of tracks that are one line the best supported one is kept, with the views of all.
fn merged(mut tracks: Vec<LineTrack>, rules: &config::Tracks) -> Vec<LineTrack> {
    best_first(&mut tracks);
    let mut places = Places { cells: HashMap::new() };
    let mut kept: Vec<LineTrack> = Vec::new();
    let mut near = Vec::new();
    for track in tracks {
        places.near(&track.segment.middle(), &mut near);
        let twin = near.iter().find(|&&k| {
            let other = &kept[k as usize].segment;
            let at = other.line.coordinate(&track.segment.middle());
            unsigned_angle(&other.line.direction, &track.segment.line.direction) < rules.one_rad
                && other.line.distance(&track.segment.middle()) < rules.one_m
                && (other.span[0] - rules.beyond_m..other.span[1] + rules.beyond_m).contains(&at)
        });
        match twin {
            Some(&k) => {
                let home = &mut kept[k as usize];
                home.views.extend(&track.views);
                home.views.sort_unstable();
                home.views.dedup();
            }
            None => {
                places.add(kept.len(), &track.segment);
                kept.push(track);
            }
        }
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{Pose, Vector};
    use crate::recording::{Camera, Frame};

    fn camera() -> Camera {
        Camera { width: 640, height: 480, fx: 400.0, fy: 400.0, cx: 319.5, cy: 239.5 }
    }

    /// Views from eight places about two metres away, all upright, looking along +y.
    fn recording() -> Recording {
        let frames = (0..8)
            .map(|i| {
                let eye =
                    Vector::new(-0.7 + 0.2 * f64::from(i), -1.6 - 0.05 * f64::from(i % 3), 0.1 * f64::from(i % 4));
                let turn = nalgebra::UnitQuaternion::from_axis_angle(&Vector::x_axis(), -std::f64::consts::FRAC_PI_2);
                let world_from_camera = Pose::from_parts(eye.into(), turn);
                Frame { timestamp_secs: f64::from(i), world_from_camera, files: Default::default() }
            })
            .collect();
        Recording { frames, ..Recording::empty(camera()) }
    }

    /// What each view makes of an edge: exact in the image, its depth off by a share of its own.
    fn lift(recording: &Recording, ends: [Point; 2], depth_error: impl Fn(usize) -> f64) -> Vec<LiftedSegment> {
        (0..recording.frames.len())
            .map(|view| {
                let eye = recording.frames[view].center();
                let far = ends.map(|p| eye + (p - eye) * (1.0 + depth_error(view)));
                let inverse = recording.frames[view].world_from_camera.inverse();
                let [a, b] = ends.map(|p| {
                    let (u, v) = recording.camera.project(&(inverse * p)).unwrap();
                    [u, v]
                });
                LiftedSegment {
                    view,
                    image: super::super::segments::Segment2 { a, b },
                    segment: Segment::between(&far[0], &far[1]).unwrap(),
                    eye,
                    plane: (ends[0] - eye).cross(&(ends[1] - eye)).normalize(),
                    samples: Vec::new(),
                }
            })
            .collect()
    }

    #[test]
    fn depth_errors_of_three_centimetres_leave_a_triangulated_line_within_what_it_says_of_itself() {
        let recording = recording();
        let ends = [Point::new(0.1, 0.0, -0.3), Point::new(0.1, 0.02, 0.4)];
        let lifted = lift(&recording, ends, |v| if v % 2 == 0 { 0.02 } else { -0.015 });
        let tracks = triangulated(&recording, &lifted.iter().collect::<Vec<_>>(), &config::Geometry::default(), 0);
        assert_eq!(tracks.len(), 1, "{tracks:#?}");
        let track = &tracks[0];
        assert_eq!(track.views.len(), 8);
        for end in &ends {
            assert!(track.segment.line.distance(end) < track.position_std_m());
        }
        assert!((track.segment.length() - 0.7).abs() < 0.02);
        assert!(track.position_std_m() < 0.012);
    }

    #[test]
    fn two_edges_of_a_worktop_stay_two_lines() {
        let recording = recording();
        let edge = |z: f64| [Point::new(-0.4, 0.0, z), Point::new(0.4, 0.0, z)];
        let mut lifted = lift(&recording, edge(0.0), |v| 0.01 * (v % 3) as f64);
        lifted.extend(lift(&recording, edge(0.035), |v| -0.01 * (v % 2) as f64));
        let tracks = triangulated(&recording, &lifted.iter().collect::<Vec<_>>(), &config::Geometry::default(), 0);
        let mut heights: Vec<f64> = tracks.iter().map(|t| t.segment.middle().z).collect();
        heights.sort_by(f64::total_cmp);
        assert_eq!(heights.len(), 2, "{heights:?}");
        assert!(heights[0].abs() < 3e-3 && (heights[1] - 0.035).abs() < 3e-3, "{heights:?}");
    }
}
