//! Frustum test and farthest-point reselection of global views (§3.2, §A.3).

use std::collections::{BTreeMap, HashMap};

use rayon::prelude::*;

use crate::config;
use crate::math::sampling::{farthest, stride};
use crate::math::{Point, centroid};
use crate::recording::sketch::Sketch;
use crate::recording::{AtWork, Recording};

use super::{Region, voxels};

/// Where surfaces are, on a coarse grid of the whole scene: what may stand between a camera and a place.
#[derive(Debug)]
pub struct Occupancy {
    low: [i32; 3],
    size: [usize; 3],
    full: Vec<bool>,
    /// Edge of a cell, metres.
    cell_m: f64,
    /// What is this near to either end of a sight does not hide it, metres.
    clear_m: f64,
}

impl Occupancy {
    /// From the depth of all frames that were looked at.
    #[must_use]
    pub fn of(recording: &Recording, sketches: &BTreeMap<usize, Sketch>, config: &config::Localization) -> Self {
        /// Numerics: more cells than a house of 20 x 20 x 4 m has: a scene with a stray point far away is not gridded whole.
        const MAX_CELLS: usize = 8_000_000;
        let rules = &config.occupied;
        let (cell_m, clear_m) = (rules.cell_m, rules.clear_m);
        let cells = |p: &Point| voxels::index(p, cell_m);
        let sketches: Vec<&Sketch> = sketches.values().collect();
        // Views that see each cell.
        let mut seen: HashMap<[i32; 3], u32> = HashMap::new();
        for some in sketches.chunks(64) {
            let clouds: Vec<Vec<[i32; 3]>> = some
                .par_iter()
                .map(|sketch| {
                    let mut seen: Vec<[i32; 3]> =
                        super::points(recording, sketch, None).iter().step_by(rules.every).map(cells).collect();
                    seen.sort_unstable();
                    seen.dedup();
                    seen
                })
                .collect();
            for cell in clouds.into_iter().flatten() {
                *seen.entry(cell).or_default() += 1;
            }
        }
        let bound = |k: usize, q: f64| -> i32 {
            let mut along: BTreeMap<i32, u64> = BTreeMap::new();
            for (cell, views) in &seen {
                *along.entry(cell[k]).or_default() += u64::from(*views);
            }
            let at_rank = |rank: u64| {
                let mut below = 0;
                let at = along.iter().find(|(_, views)| {
                    below += **views;
                    below > rank
                });
                at.map_or(0.0, |(at, _)| f64::from(*at))
            };
            // As `stats::quantile` has it.
            let position = q * along.values().sum::<u64>().saturating_sub(1) as f64;
            let (low, high) = (at_rank(position.floor() as u64), at_rank(position.ceil() as u64));
            (low + (high - low) * (position - position.floor())) as i32
        };
        let low = [0, 1, 2].map(|k| bound(k, rules.rim_share));
        let size = [0, 1, 2].map(|k| (bound(k, 1.0 - rules.rim_share) - low[k] + 1).max(1) as usize);
        if size.iter().product::<usize>() > MAX_CELLS {
            return Self { low, size: [0; 3], full: Vec::new(), cell_m, clear_m };
        }
        let mut grid = Self { low, size, full: Vec::new(), cell_m, clear_m };
        let mut full = vec![false; size.iter().product()];
        for (cell, _) in seen.iter().filter(|(_, views)| **views as usize >= rules.views) {
            if let Some(i) = grid.index(cell) {
                full[i] = true;
            }
        }
        grid.full = full;
        grid
    }

    fn index(&self, cell: &[i32; 3]) -> Option<usize> {
        cell.iter().zip(&self.low).zip(&self.size).try_fold(0, |index, ((cell, low), size)| {
            let at = usize::try_from(cell - low).ok().filter(|at| at < size)?;
            Some(index * size + at)
        })
    }

    /// Whether something stands between two points, apart from what is around either.
    #[must_use]
    pub fn hides(&self, eye: &Point, target: &Point) -> bool {
        let way = target - eye;
        let length = way.norm();
        // Arithmetic: in such steps no cell is missed but at its corners.
        let step = 0.7 * self.cell_m;
        let steps = ((length - 2.0 * self.clear_m) / step).floor().max(0.0) as usize;
        (0..steps).any(|i| {
            let p = eye + way * ((self.clear_m + step * i as f64) / length);
            self.index(&voxels::index(&p, self.cell_m)).is_some_and(|i| self.full[i])
        })
    }
}

/// Frames with an image in which nobody is at work: where global views are looked for. Where some frames have depth, of these
/// alone, as the others show no place of anything. In a long recording every n-th of them: the same places are seen again and
/// again.
#[must_use]
pub fn idle(recording: &Recording, at_work: &AtWork, config: &config::Localization) -> Vec<usize> {
    let deep = (0..recording.frames.len()).any(|f| recording.has_depth(f));
    let usable = |f: &usize| recording.frames[*f].files.rgb.is_some() && (!deep || recording.has_depth(*f));
    let all: Vec<usize> = (0..recording.frames.len()).filter(|f| usable(f) && !at_work.any(*f)).collect();
    let every = stride(all.len(), config.idle_frames);
    all.into_iter().step_by(every).collect()
}

/// Selects up to `global_views` of the `idle` frames that see the region, spread over camera positions.
///
/// The first is the one nearest to the region (the paper leaves the start open), each next one the farthest from all
/// before it. With an `occupancy` a voxel counts as seen only where nothing hides it.
#[must_use]
pub fn reselect(
    recording: &Recording,
    idle: &[usize],
    region: &Region,
    occupancy: Option<&Occupancy>,
    config: &config::Localization,
) -> Vec<usize> {
    let centers = region.centers();
    let Some(middle) = centroid(&centers) else { return Vec::new() };
    let probes: Vec<Point> = centers.iter().copied().step_by(stride(centers.len(), config.probes)).collect();
    let mut candidates: Vec<usize> = idle
        .par_iter()
        .copied()
        .filter(|&f| visible_share(recording, f, &probes, occupancy, (config.min_visible_share, config.seen_m)))
        .collect();
    // The local frames show the closed state from near by, whatever the clips' bounds say.
    candidates.extend(region.local_frames.iter().filter(|f| recording.frames[**f].files.rgb.is_some()));
    candidates.sort_unstable();
    candidates.dedup();
    let distance = |f: usize| (recording.frames[f].center() - middle).norm();
    let start =
        (0..candidates.len()).min_by(|&a, &b| distance(candidates[a]).total_cmp(&distance(candidates[b]))).unwrap_or(0);
    spread(recording, &candidates, start, config.global_views)
}

/// Up to `count` of the `idle` frames that have a place within three metres before them, spread over camera positions; the one
/// nearest to it is among them.
#[must_use]
pub fn sighting(
    recording: &Recording,
    idle: &[usize],
    place: &Point,
    count: usize,
    config: &config::Localization,
) -> Vec<usize> {
    let place_only = std::slice::from_ref(place);
    let candidates: Vec<usize> =
        idle.iter().copied().filter(|&f| visible_share(recording, f, place_only, None, (1.0, config.seen_m))).collect();
    let distance = |f: usize| (recording.frames[f].center() - place).norm();
    let start =
        (0..candidates.len()).min_by(|&a, &b| distance(candidates[a]).total_cmp(&distance(candidates[b]))).unwrap_or(0);
    spread(recording, &candidates, start, count)
}

/// Up to `count` frames outside the interactions, spread over camera positions: what the room looks like when nothing moves.
#[must_use]
pub fn survey(recording: &Recording, at_work: &AtWork, count: usize) -> Vec<usize> {
    let candidates: Vec<usize> =
        (0..recording.frames.len()).filter(|&f| !at_work.any(f) && recording.has_depth(f)).collect();
    spread(recording, &candidates, 0, count)
}

/// Farthest-point sampling over camera positions from `candidates[start]` on; ascending.
fn spread(recording: &Recording, candidates: &[usize], start: usize, count: usize) -> Vec<usize> {
    let places: Vec<Point> = candidates.iter().map(|&f| recording.frames[f].center()).collect();
    let chosen = farthest(places.len(), start, count.max(1), |a, b| (places[b] - places[a]).norm());
    let mut frames: Vec<usize> = chosen.into_iter().map(|i| candidates[i]).collect();
    frames.sort_unstable();
    frames
}

/// Whether at least a share of the points is inside a frame's frustum, between two distances from the camera, and not hidden.
fn visible_share(
    recording: &Recording,
    frame: usize,
    points: &[Point],
    occupancy: Option<&Occupancy>,
    (share, [nearest_m, farthest_m]): (f64, [f64; 2]),
) -> bool {
    let camera_from_world = recording.frames[frame].world_from_camera.inverse();
    let eye = recording.frames[frame].center();
    let camera = recording.camera_of(frame);
    let needed = (share * points.len() as f64).ceil() as usize;
    let inside = |p: &&Point| {
        let local = camera_from_world * **p;
        (nearest_m..farthest_m).contains(&local.z) && camera.project(&local).is_some_and(|(u, v)| camera.contains(u, v))
    };
    // The cheap test first: most frames of a long recording look elsewhere.
    let in_frustum: Vec<&Point> = points.iter().filter(inside).collect();
    in_frustum.len() >= needed
        && occupancy.is_none_or(|o| in_frustum.iter().filter(|p| !o.hides(&eye, p)).count() >= needed)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wall_hides_what_is_behind_it_and_not_what_is_before_or_on_it() {
        let mut full = vec![false; 40 * 40 * 40];
        let mut grid = Occupancy { low: [0; 3], size: [40; 3], full: Vec::new(), cell_m: 0.1, clear_m: 0.25 };
        for y in 0..40 {
            for z in 0..40 {
                full[grid.index(&[20, y, z]).unwrap()] = true;
            }
        }
        grid.full = full;
        let eye = Point::new(0.55, 2.0, 2.0);
        assert!(grid.hides(&eye, &Point::new(3.5, 2.2, 1.8)));
        assert!(!grid.hides(&eye, &Point::new(2.05, 2.0, 2.0)));
        assert!(!grid.hides(&eye, &Point::new(1.5, 2.5, 2.0)));
        assert!(!grid.hides(&Point::new(-3.0, 0.0, 9.0), &Point::new(-3.0, 5.0, 9.0)));
    }
}
