//! How true the boxes of a room are: what they fill although views saw through it, what they lack although views saw it, and
//! whether they stand in a part's way. Depth of the recording is all that is needed.

use std::collections::BTreeMap;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::config;
use crate::error::Result;
use crate::fitting::{body, overlap, sweep};
use crate::localization::views;
use crate::math::{Point, Vector};
use crate::pipeline::{Gathering, RoomCell, RoomCells, Scene, gather};
use crate::recording::sketch::Sketch;
use crate::recording::{AtWork, Recording};
use crate::twin::{OrientedBox, Part, Twin};

/// Edge of a cell, metres, and how far boxes may be off: the noise of depth at arm's length.
pub const CELL_M: f64 = 0.03;
/// Frames that tell: as many as the room is surveyed with.
const FRAMES: usize = 60;
/// Openings at which each part is held against the room.
const OPENINGS: u32 = 60;

/// The boxes of one room, or of several pooled, against depth.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct RoomFit {
    /// Boxes of the room.
    pub room_boxes: usize,
    /// Boards of furniture that do not move.
    pub carcass_boxes: usize,
    /// Cells of [`CELL_M`] in which views saw a surface, but for parts on their way and what furniture holds inside.
    pub surface_cells: usize,
    /// Of them, cells whose surface, fused with that around, is further than `CELL_M` from every box of the twin.
    pub missing_cells: usize,
    /// Cells that views saw through, further than a cell from any surface, whose middle is in a box of the room.
    pub filled_cells: usize,
    /// Openings, of 61 for each part from shut to its limit, at which it shares space with a box of the room.
    pub blocked_openings: usize,
}

impl RoomFit {
    /// Missing surface as a share of the room's; `None` where no surface was seen.
    #[must_use]
    pub fn missing(&self) -> Option<f64> {
        self.share(self.missing_cells)
    }

    /// Filled air in layers of one cell as a share of the room's surface; `None` where no surface was seen.
    #[must_use]
    pub fn filled(&self) -> Option<f64> {
        self.share(self.filled_cells)
    }

    fn share(&self, cells: usize) -> Option<f64> {
        (self.surface_cells > 0).then(|| cells as f64 / self.surface_cells as f64)
    }

    /// Numbers of several rooms together.
    #[must_use]
    pub fn pooled<'a>(all: impl IntoIterator<Item = &'a Self>) -> Self {
        all.into_iter().fold(Self::default(), |sum, one| Self {
            room_boxes: sum.room_boxes + one.room_boxes,
            carcass_boxes: sum.carcass_boxes + one.carcass_boxes,
            surface_cells: sum.surface_cells + one.surface_cells,
            missing_cells: sum.missing_cells + one.missing_cells,
            filled_cells: sum.filled_cells + one.filled_cells,
            blocked_openings: sum.blocked_openings + one.blocked_openings,
        })
    }
}

/// Holds a twin against the depth of frames in which nobody is at work, of the recording that the scene was inferred from.
///
/// # Errors
/// Where a frame's depth or mask cannot be read.
pub fn measure(recording: &Recording, scene: &Scene, twin: &Twin, config: &config::Fitting) -> Result<RoomFit> {
    let recording = Recording { depth_factors: scene.depth_factors.clone(), ..recording.clone() };
    let frames = views::survey(&recording, &AtWork::of(&recording), FRAMES);
    let sketches: Vec<Option<Sketch>> = frames
        .par_iter()
        .map(|&frame| {
            let Some(depth) = recording.depth_as_read(frame)? else { return Ok(None) };
            Ok(Some(Sketch::of(frame, &depth, recording.mask(frame)?.as_ref())))
        })
        .collect::<Result<_>>()?;
    let views: Vec<&Sketch> = sketches.iter().flatten().collect();
    let how = Gathering {
        axes: scene.surroundings.as_ref().map_or([Vector::x(), Vector::y(), Vector::z()], |room| room.axes),
        edge_m: CELL_M,
        stride: 1,
        views: config.room_min_views,
        free_views: config.room_free_views,
        rules: &config.gathered,
    };
    Ok(held_against(&gather(&recording, &views, &how), twin, config))
}

/// Holds a twin against what is known of the cells around it.
#[must_use]
pub fn held_against(cells: &RoomCells, twin: &Twin, config: &config::Fitting) -> RoomFit {
    let grown = |shape: &OrientedBox| OrientedBox { half: shape.half.map(|h| h + cells.edge_m), ..*shape };
    let room: Vec<OrientedBox> = twin.room.iter().map(|s| s.shape).collect();
    let carcasses = twin.furniture.iter().flat_map(|f| &f.carcass).count();
    let closed = twin.furniture.iter().flat_map(|f| f.carcass.iter().chain(&f.part.solids)).map(|s| s.shape);
    let all: Vec<OrientedBox> = room.iter().copied().chain(closed).map(|b| grown(&b)).collect();
    // Views of an open door show its leaf and what is behind it: that is not the room's.
    let bodies = twin.furniture.iter().map(body);
    let moving: Vec<OrientedBox> =
        twin.furniture.iter().flat_map(|f| sweep(&f.part, config)).chain(bodies).map(|b| grown(&b)).collect();
    let inside = |boxes: &[OrientedBox], p: &Point| boxes.iter().any(|b| b.contains(p));
    let surfaces: BTreeMap<[i32; 3], &RoomCell> = cells.cells.iter().map(|c| (c.index, c)).collect();
    let [surface, missing] = cells
        .cells
        .par_iter()
        .map(|cell| {
            let p = world(cells, fused(&surfaces, middle(cell), cells.edge_m));
            let there = inside(&all, &p);
            let counts = there || !inside(&moving, &p);
            [usize::from(counts), usize::from(counts && !there)]
        })
        .reduce(|| [0; 2], |a, b| [a[0] + b[0], a[1] + b[1]]);
    RoomFit {
        room_boxes: twin.room.len(),
        carcass_boxes: carcasses,
        surface_cells: surface,
        missing_cells: missing,
        filled_cells: filled(cells, &surfaces, &room),
        blocked_openings: blocked(twin),
    }
}

/// Middle of a cell's surface along the grid's axes.
fn middle(cell: &RoomCell) -> [f64; 3] {
    cell.extent.map(|[low, high]| 0.5 * (low + high))
}

/// A point moved onto the middle of the surfaces around it, weighted by the views that saw them (mean shift): the errors of
/// single views spread a surface to both sides of where it is. Along the grid's axes.
fn fused(surfaces: &BTreeMap<[i32; 3], &RoomCell>, mut p: [f64; 3], edge: f64) -> [f64; 3] {
    const REACH: i32 = 2;
    const ROUNDS: usize = 2;
    for _ in 0..ROUNDS {
        let [x, y, z] = p.map(|c| (c / edge).floor() as i32);
        let (mut sum, mut weight) = ([0.0; 3], 0.0);
        for i in 0..25 {
            let [x, y] = [x + i % 5 - REACH, y + i / 5 - REACH];
            for (_, cell) in surfaces.range([x, y, z - REACH]..=[x, y, z + REACH]) {
                let views = f64::from(cell.views);
                weight += views;
                sum.iter_mut().zip(middle(cell)).for_each(|(sum, c)| *sum += views * c);
            }
        }
        if weight > 0.0 {
            p = sum.map(|c| c / weight);
        }
    }
    p
}

/// A point along the axes of a room's grid in the world.
fn world(cells: &RoomCells, along: [f64; 3]) -> Point {
    Point::from(cells.axes.iter().zip(along).fold(Vector::zeros(), |sum, (axis, c)| sum + axis * c))
}

/// Free cells in boxes, those beside a surface left out.
fn filled(cells: &RoomCells, surfaces: &BTreeMap<[i32; 3], &RoomCell>, boxes: &[OrientedBox]) -> usize {
    let beside = |[x, y, z]: [i32; 3]| {
        (0..9).any(|i| {
            surfaces
                .range([x + i % 3 - 1, y + i / 3 - 1, z - 1]..=[x + i % 3 - 1, y + i / 3 - 1, z + 1])
                .next()
                .is_some()
        })
    };
    cells
        .free
        .par_iter()
        .map(|run| {
            let [x, y] = run.column;
            (run.span[0]..=run.span[1])
                .filter(|&z| {
                    let p = world(cells, [x, y, z].map(|i| (f64::from(i) + 0.5) * cells.edge_m));
                    boxes.iter().any(|b| b.contains(&p)) && !beside([x, y, z])
                })
                .count()
        })
        .sum()
}

/// Openings at which a part shares space with the room.
fn blocked(twin: &Twin) -> usize {
    let meets = |part: &Part, opening: f64| {
        let motion = part.joint.articulation.motion(opening);
        part.solids.iter().any(|s| {
            let moved = s.shape.moved(&motion);
            twin.room.iter().any(|other| overlap::boxes(&moved, &other.shape))
        })
    };
    let of_part = |part: &Part| {
        let opening = |i: &u32| part.joint.upper * f64::from(*i) / f64::from(OPENINGS);
        (0..=OPENINGS).filter(|i| meets(part, opening(i))).count()
    };
    twin.furniture.iter().map(|f| of_part(&f.part)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pipeline::FreeRun;
    use crate::twin::{Role, Solid};
    use nalgebra::Matrix3;

    fn twin(room: Vec<([f64; 3], [f64; 3])>) -> Twin {
        let solid = |(center, half): ([f64; 3], [f64; 3])| Solid {
            name: String::new(),
            role: Role::Room,
            shape: OrientedBox { center: Point::from(center), half: Vector::from(half), rotation: Matrix3::identity() },
            seen: true,
        };
        Twin {
            name: String::new(),
            density_kg_per_m3: 700.0,
            drives: crate::config::Drives::default(),
            furniture: Vec::new(),
            room: room.into_iter().map(solid).collect(),
            left_out: Vec::new(),
        }
    }

    /// Boxes of a room, by centre and half sizes, against its cells.
    fn against(cells: &RoomCells, room: Vec<([f64; 3], [f64; 3])>) -> RoomFit {
        held_against(cells, &twin(room), &config::Fitting::default())
    }

    /// A wall of a square metre at x = 1.005, and free air for a metre before it, two cells away.
    fn wall() -> RoomCells {
        let span = |i: i32| [0.03 * f64::from(i), 0.03 * f64::from(i + 1)];
        let cell = |y: i32, z: i32| RoomCell { index: [33, y, z], views: 3, extent: [[1.0, 1.01], span(y), span(z)] };
        RoomCells {
            axes: [Vector::x(), Vector::y(), Vector::z()],
            edge_m: CELL_M,
            cells: (0..33).flat_map(|y| (0..33).map(move |z| (y, z))).map(|(y, z)| cell(y, z)).collect(),
            free: (0..32).flat_map(|x| (0..33).map(move |y| FreeRun { column: [x, y], span: [0, 32] })).collect(),
        }
    }

    #[test]
    fn a_box_at_the_wall_is_true_and_one_that_is_off_fills_air_or_lacks_the_wall() {
        let cells = wall();
        let of = |low: f64, high: f64| {
            let (middle, half) = (0.5 * (low + high), 0.5 * (high - low));
            against(&cells, vec![([middle, 0.5, 0.5], [half, 0.6, 0.6])])
        };
        let exact = of(1.005, 1.055);
        assert_eq!((exact.room_boxes, exact.surface_cells), (1, 33 * 33));
        assert_eq!((exact.missing(), exact.filled()), (Some(0.0), Some(0.0)));
        // Two centimetres off to either side are no error, a cell and more is.
        assert_eq!((of(0.985, 1.05).filled_cells, of(1.025, 1.05).missing_cells), (0, 0));
        assert_eq!(of(1.05, 1.1).missing(), Some(1.0));
        let thick = of(0.89, 1.05);
        assert_eq!((thick.missing_cells, thick.filled()), (0, Some(2.0)));
        assert_eq!(against(&cells, Vec::new()).missing(), Some(1.0));
        let pooled = RoomFit::pooled([&exact, &thick]);
        assert_eq!((pooled.room_boxes, pooled.filled()), (2, Some(1.0)));
        assert_eq!(RoomFit::default().filled(), None);
    }

    #[test]
    fn noise_to_both_sides_of_a_surface_is_no_missing_surface() {
        // Of all cells of the wall every third lies 4 cm before it, every third 4 cm behind.
        let mut cells = wall();
        for (i, cell) in cells.cells.iter_mut().enumerate() {
            let off = 0.04 * ((i % 3) as f64 - 1.0);
            cell.extent[0] = cell.extent[0].map(|x| x + off);
            cell.index[0] = (0.5 * (cell.extent[0][0] + cell.extent[0][1]) / CELL_M).floor() as i32;
        }
        let fit = against(&cells, vec![([1.03, 0.5, 0.5], [0.025, 0.6, 0.6])]);
        assert!(fit.missing_cells < 40, "{fit:?}");
        let fit = against(&cells, vec![([1.09, 0.5, 0.5], [0.025, 0.6, 0.6])]);
        assert!(fit.missing() > Some(0.9), "{fit:?}");
    }
}
