//! Segments of several views that are one line in the world (§3.2: "2D line correspondences", left open by the paper).

use serde::{Deserialize, Serialize};

use super::segments::{LiftedSegment, fit_segment};
use crate::config;
use crate::localization::{Region, voxels};
use crate::math::line::Segment;
use crate::math::{Point, unsigned_angle};

/// A 3D line seen in several views: a candidate hinge.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LineTrack {
    /// The line with its ends.
    pub segment: Segment,
    /// Frames that see it, ascending.
    pub views: Vec<usize>,
    /// Root mean square distance of its samples, metres.
    pub rms_m: f64,
}

/// Whether a segment lies at the region: two of its quarter points within a voxel of a confident one.
fn at_region(segment: &Segment, inside: &std::collections::HashSet<[i32; 3]>, voxel_m: f64) -> bool {
    let hits = [0.0, 0.25, 0.5, 0.75, 1.0]
        .iter()
        .filter(|t| {
            let p = segment.line.point + segment.line.direction * (segment.span[0] + **t * segment.length());
            let [x, y, z] = voxels::index(&p, voxel_m);
            (-1..=1).any(|dx| (-1..=1).any(|dy| (-1..=1).any(|dz| inside.contains(&[x + dx, y + dy, z + dz]))))
        })
        .count();
    hits >= 2
}

/// Groups lifted segments at the region into tracks and fits each with LO-RANSAC, best supported first.
#[must_use]
pub fn build(lifted: &[&LiftedSegment], region: &Region, config: &config::Geometry, seed: u64) -> Vec<LineTrack> {
    let inside: std::collections::HashSet<[i32; 3]> = region.voxels.iter().copied().collect();
    let mut near: Vec<&LiftedSegment> =
        lifted.iter().copied().filter(|s| at_region(&s.segment, &inside, region.voxel_m)).collect();
    // Long segments found the tracks: their direction is known best.
    near.sort_by(|a, b| b.segment.length().total_cmp(&a.segment.length()).then(a.view.cmp(&b.view)));

    let mut groups: Vec<(Segment, Vec<&LiftedSegment>)> = Vec::new();
    for candidate in near {
        let home = groups.iter_mut().find(|(seed, _)| same_line(seed, &candidate.segment, config));
        match home {
            Some((_, members)) => members.push(candidate),
            None => groups.push((candidate.segment, vec![candidate])),
        }
    }
    let mut tracks: Vec<LineTrack> = groups
        .into_iter()
        .enumerate()
        .filter_map(|(i, (_, members))| {
            let mut views: Vec<usize> = members.iter().map(|m| m.view).collect();
            views.sort_unstable();
            views.dedup();
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
            let rms_m = (near.iter().sum::<f64>() / near.len().max(1) as f64).sqrt();
            Some(LineTrack { segment, views, rms_m })
        })
        .collect();
    tracks.sort_by(|a, b| {
        let support = |t: &LineTrack| t.views.len() as f64 * t.segment.length();
        support(b).total_cmp(&support(a))
    });
    tracks
}

/// Whether two lifted segments can be one line: near in angle and distance, and overlapping or nearly so.
fn same_line(a: &Segment, b: &Segment, config: &config::Geometry) -> bool {
    // A line broken by a hand or a glare leaves a gap; a wider one is another edge.
    const GAP_M: f64 = 0.1;
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
    low <= a.span[1] + GAP_M && high >= a.span[0] - GAP_M
}
