//! What stands around and does not move: cells of a grid in which several views saw a surface, and those that they saw
//! through (ours).

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::config;
use crate::geometry::ManhattanFrame;
use crate::localization::{self, Footage};
use crate::math::{Point, Vector, any_orthogonal, reject, unit};
use crate::recording::Recording;
use crate::recording::sketch::Sketch;

use super::through::Through;

/// One cell with a surface in it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct RoomCell {
    /// Index along the grid's axes: `floor(coordinate / edge)`.
    pub index: [i32; 3],
    /// Distinct views that saw a surface in it.
    pub views: u32,
    /// `[low, high]` of the surface along the grid's axes, metres, within the cell: the even layer that has the mean and the
    /// variance of the points.
    pub extent: [[f64; 2]; 3],
}

/// Empty cells one above the other.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct FreeRun {
    /// Their first two indices.
    pub column: [i32; 2],
    /// Their lowest and highest third index.
    pub span: [i32; 2],
}

/// The static scene on a grid.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RoomCells {
    /// The grid's axes, world, orthonormal and right-handed: two along the room's walls, the upright one last.
    pub axes: [Vector; 3],
    /// Edge of a cell, metres.
    pub edge_m: f64,
    /// Cells that enough views saw, by index.
    pub cells: Vec<RoomCell>,
    /// Cells that views saw through more often than they saw a surface there, by column and span. What is neither here nor in
    /// `cells` is unknown: inside of furniture, behind walls, or nobody looked.
    #[serde(default)]
    pub free: Vec<FreeRun>,
}

/// How a room is gathered.
#[derive(Debug, Clone, Copy)]
pub struct Gathering<'a> {
    /// Axes of the grid: world, orthonormal.
    pub axes: [Vector; 3],
    /// Edge of a cell, metres.
    pub edge_m: f64,
    /// Every so many samples of a view count as surface.
    pub stride: usize,
    /// Views that must see a surface in a cell.
    pub views: usize,
    /// Views that must see through a cell.
    pub free_views: usize,
    /// What counts as seen, and as seen through.
    pub rules: &'a config::GatheredRoom,
}

/// Gathers the depth of frames in which nobody is at work, and the static reconstruction where there is one. `None` where
/// the room is not wanted or nothing was seen of it.
///
/// Parts that were left open are in it: whoever builds them knows where they go and leaves that space free.
pub(super) fn cells(
    footage: &Footage,
    manhattan: Option<&ManhattanFrame>,
    up: &Vector,
    config: &config::Fitting,
) -> Option<RoomCells> {
    if !config.room {
        return None;
    }
    let Footage { recording, sketches, at_work, .. } = *footage;
    let still: Vec<&Sketch> = sketches.values().filter(|s| !at_work.any(s.frame)).collect();
    let how = Gathering {
        axes: grid_axes(manhattan, up),
        edge_m: config.room_voxel_m,
        stride: config.gathered.stride,
        views: config.room_min_views,
        free_views: config.room_free_views,
        rules: &config.gathered,
    };
    let room = gather(recording, &still, &how);
    (!room.cells.is_empty()).then_some(room)
}

/// Gathers views (of frames of the recording, in which nothing moves) and the static reconstruction.
#[must_use]
pub fn gather(recording: &Recording, views: &[&Sketch], how: &Gathering) -> RoomCells {
    let Gathering { axes, edge_m, stride, .. } = *how;
    let near_m = how.rules.near_m;
    let needed = how.views as u32;
    // A frame without depth of its own has the reconstruction's, which is taken whole below.
    let own = |s: &&&Sketch| recording.frames.get(s.frame).is_some_and(|f| f.files.depth.is_some());
    let with_depth: Vec<&Sketch> = views.iter().filter(own).copied().collect();
    let mut bins: Vec<Bin> = Vec::new();
    // In pieces: the bins of all views of a long recording together are larger than the room by far.
    for some in with_depth.chunks(64) {
        let by_view: Vec<Vec<Bin>> = some
            .par_iter()
            .map(|sketch| {
                let eye = recording.frames[sketch.frame].center();
                let points = localization::points(recording, sketch, None);
                let near = points.iter().step_by(stride).filter(|p| (*p - eye).norm() <= near_m);
                folded(near.filter_map(|p| Bin::of(p, &axes, edge_m, 1)).collect(), |one, _| one)
            })
            .collect();
        bins.extend(by_view.into_iter().flatten());
        bins = folded(bins, u32::saturating_add);
    }
    // A reconstruction has been through many views already. In pieces: it may have millions of points.
    for points in recording.reconstruction.chunks(1 << 16) {
        bins.extend(folded(points.iter().filter_map(|p| Bin::of(p, &axes, edge_m, needed)).collect(), |one, _| one));
    }
    let bins = folded(bins, u32::saturating_add);
    let seen = bins.iter().filter(|b| b.views >= needed).map(|b| b.index);
    let through = Through::of(recording, views, how, seen);
    // Noise leaves surface before the surface; most views see through it.
    let cells = bins
        .iter()
        .filter(|b| b.views >= needed && through.at(&b.index) <= b.views)
        .map(|b| RoomCell { index: b.index, views: b.views, extent: b.extent(edge_m) })
        .collect();
    RoomCells { axes, edge_m, cells, free: free(&through, &bins, how.free_views) }
}

/// Cells that at least so many views saw through, and more than twice as many as saw a surface there.
fn free(through: &Through, bins: &[Bin], least: usize) -> Vec<FreeRun> {
    let surface = |index: &[i32; 3]| {
        let bin = bins.binary_search_by(|b| b.index.cmp(index)).ok().and_then(|i| bins.get(i));
        bin.map_or(0, |b| b.views)
    };
    let mut empty: Vec<[i32; 3]> = through
        .cells()
        .filter(|(index, views)| *views as usize >= least && *views > surface(index).saturating_mul(2))
        .map(|(index, _)| index)
        .collect();
    empty.sort_unstable();
    let mut runs: Vec<FreeRun> = Vec::new();
    for [x, y, z] in empty {
        match runs.last_mut() {
            Some(run) if run.column == [x, y] && run.span[1] + 1 == z => run.span[1] = z,
            _ => runs.push(FreeRun { column: [x, y], span: [z, z] }),
        }
    }
    runs
}

/// The heading of the room's frame about the vertical, or any: furniture is set upright, and so is what surrounds it.
fn grid_axes(manhattan: Option<&ManhattanFrame>, up: &Vector) -> [Vector; 3] {
    let first = manhattan.and_then(|m| unit(&reject(&m.axes[0], up))).unwrap_or_else(|| any_orthogonal(up));
    [first, up.cross(&first), *up]
}

/// Points of one cell: their number and, from the cell's lower corner, the sums of their coordinates and squares.
#[derive(Debug, Clone, Copy)]
struct Bin {
    index: [i32; 3],
    views: u32,
    count: f64,
    sum: [f64; 3],
    squares: [f64; 3],
}

impl Bin {
    /// `None` for a point that is not in any room.
    fn of(p: &Point, axes: &[Vector; 3], edge_m: f64, views: u32) -> Option<Self> {
        /// Numerics: no recording walks further from its world's origin, and indices of cells stay within 32 bits.
        const FAR_M: f64 = 1e5;
        let at = axes.map(|a| a.dot(&p.coords));
        if !at.iter().all(|c| c.abs() < FAR_M) {
            return None;
        }
        let index = at.map(|c| (c / edge_m).floor() as i32);
        let within: [f64; 3] = std::array::from_fn(|k| at[k] - f64::from(index[k]) * edge_m);
        Some(Self { index, views, count: 1.0, sum: within, squares: within.map(|c| c * c) })
    }

    fn extent(&self, edge_m: f64) -> [[f64; 2]; 3] {
        std::array::from_fn(|k| {
            let mean = self.sum[k] / self.count;
            let variance = (self.squares[k] / self.count - mean * mean).max(0.0);
            // An even layer of half-width h has the variance h^2 / 3.
            let half = (3.0 * variance).sqrt();
            let corner = f64::from(self.index[k]) * edge_m;
            [corner + (mean - half).max(0.0), corner + (mean + half).min(edge_m)]
        })
    }
}

/// One bin for each index, by index; `views` joins the views of two.
fn folded(mut bins: Vec<Bin>, views: impl Fn(u32, u32) -> u32) -> Vec<Bin> {
    // Stable: sums are taken in the order of the views, so that they are the same on any number of threads.
    bins.sort_by_key(|b| b.index);
    let mut out: Vec<Bin> = Vec::new();
    for bin in bins {
        match out.last_mut() {
            Some(last) if last.index == bin.index => {
                last.views = views(last.views, bin.views);
                last.count += bin.count;
                last.sum.iter_mut().zip(bin.sum).for_each(|(sum, more)| *sum += more);
                last.squares.iter_mut().zip(bin.squares).for_each(|(sum, more)| *sum += more);
            }
            _ => out.push(bin),
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Evenly spread points of a wall at x = 0.12, twenty to a cell's edge.
    fn wall(views: u32) -> Vec<Bin> {
        let axes = [Vector::x(), Vector::y(), Vector::z()];
        let mut bins = Vec::new();
        for view in 0..views {
            for i in 0..400 {
                let p = Point::new(0.12, 0.0025 * f64::from(i % 20), 0.0025 * f64::from(i / 20));
                let p = p + Vector::repeat(0.001) + Vector::x() * (0.002 * (f64::from(view) - 1.0));
                bins.extend(Bin::of(&p, &axes, 0.05, 1));
            }
        }
        folded(bins, u32::max)
    }

    #[test]
    fn a_wall_fills_its_cell_along_itself_and_lies_thin_across() {
        let bins = wall(3);
        assert_eq!(bins.len(), 1);
        assert_eq!(bins[0].index, [2, 0, 0]);
        let [x, y, z] = bins[0].extent(0.05);
        assert!((x[0] + x[1] - 0.242).abs() < 1e-9 && x[1] - x[0] < 0.006, "{x:?}");
        assert!(y[0] < 0.002 && y[1] > 0.048 && z[0] < 0.002 && z[1] > 0.048, "{y:?} {z:?}");
    }

    #[test]
    fn the_grid_has_the_rooms_heading_and_stands_upright() {
        let tilt = crate::math::rotation(&Vector::new(1.0, 2.0, 0.0), 0.03);
        let turn = crate::math::rotation(&Vector::z(), 0.4);
        let frame =
            ManhattanFrame { axes: [Vector::x(), Vector::y(), Vector::z()].map(|a| tilt * turn * a), frames: 1 };
        let axes = grid_axes(Some(&frame), &Vector::z());
        assert_eq!(axes[2], Vector::z());
        assert!(axes[0].dot(&(turn * Vector::x())) > 0.999);
        assert!((axes[0].cross(&axes[1]) - axes[2]).norm() < 1e-12);
    }
}
