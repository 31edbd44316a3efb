//! Frustum test and farthest-point reselection of global views (§3.2, §A.3).

use crate::config;
use crate::math::{Point, centroid};
use crate::recording::Recording;

use super::Region;

/// Selects up to `global_views` frames outside the interactions that see the region, spread over camera positions.
///
/// The first is the one nearest to the region (the paper leaves the start open), each next one the farthest from all
/// before it.
#[must_use]
pub fn reselect(recording: &Recording, region: &Region, config: &config::Localization) -> Vec<usize> {
    let centers = region.centers();
    let Some(middle) = centroid(&centers) else { return Vec::new() };
    let mut candidates: Vec<usize> = (0..recording.frames.len())
        .filter(|&f| !interacting(recording, f) && recording.frames[f].files.rgb.is_some())
        .filter(|&f| visible_share(recording, f, &centers) >= config.min_visible_share)
        .collect();
    // The local frames show the closed state from near by, whatever the clips' bounds say.
    candidates.extend(region.local_frames.iter().filter(|f| recording.frames[**f].files.rgb.is_some()));
    candidates.sort_unstable();
    candidates.dedup();

    let distance = |f: usize| (recording.frames[f].center() - middle).norm();
    let start = (0..candidates.len())
        .min_by(|&a, &b| distance(candidates[a]).total_cmp(&distance(candidates[b])))
        .unwrap_or(0);
    spread(recording, &candidates, start, config.global_views)
}

/// Up to `count` frames outside the interactions, spread over camera positions: what the room looks like when nothing moves.
#[must_use]
pub fn survey(recording: &Recording, count: usize) -> Vec<usize> {
    let candidates: Vec<usize> =
        (0..recording.frames.len()).filter(|&f| !interacting(recording, f) && recording.has_depth(f)).collect();
    spread(recording, &candidates, 0, count)
}

/// Whether a narrated interaction is going on.
#[must_use]
pub fn interacting(recording: &Recording, frame: usize) -> bool {
    recording.clips.iter().any(|c| c.end_frame > c.start_frame && (c.start_frame..=c.end_frame).contains(&frame))
}

/// Farthest-point sampling over camera positions from `candidates[start]` on; ascending.
fn spread(recording: &Recording, candidates: &[usize], start: usize, count: usize) -> Vec<usize> {
    let position = |f: usize| recording.frames[f].center();
    let mut distance: Vec<f64> = vec![f64::INFINITY; candidates.len()];
    let mut chosen = Vec::new();
    let mut next = (start < candidates.len()).then_some(start);
    while let Some(i) = next {
        chosen.push(candidates[i]);
        if chosen.len() >= count.min(candidates.len()) {
            break;
        }
        let from = position(candidates[i]);
        distance[i] = f64::NEG_INFINITY;
        for (d, &f) in distance.iter_mut().zip(candidates) {
            *d = d.min((position(f) - from).norm());
        }
        next = (0..candidates.len())
            .filter(|&j| distance[j] > f64::NEG_INFINITY)
            .max_by(|&a, &b| distance[a].total_cmp(&distance[b]).then(b.cmp(&a)));
    }
    chosen.sort_unstable();
    chosen
}

/// Share of the points inside a frame's frustum, between 0.2 and 3 m from the camera.
fn visible_share(recording: &Recording, frame: usize, points: &[Point]) -> f64 {
    let camera_from_world = recording.frames[frame].world_from_camera.inverse();
    let inside = points
        .iter()
        .filter(|p| {
            let local = camera_from_world * **p;
            (0.2..3.0).contains(&local.z)
                && recording.camera.project(&local).is_some_and(|(u, v)| recording.camera.contains(u, v))
        })
        .count();
    inside as f64 / points.len().max(1) as f64
}
