//! Cells that sight went through: what a view shows behind a cell tells that the cell is empty (ours).

use std::collections::BTreeSet;

use nalgebra::Matrix3;
use rayon::prelude::*;

use super::room::Gathering;
use crate::config;
use crate::math::Vector;
use crate::recording::sketch::Sketch;
use crate::recording::{Camera, Recording};

/// Numerics: cells along the edge of a block.
const SIDE: i32 = 8;
/// Arithmetic: cells of a block.
const COUNT: usize = 512;

/// How many views saw through each cell of the blocks around some cells.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Through {
    /// Ascending: block (0, 0, 0) has its lower corner at the grid's origin.
    blocks: Vec<[i32; 3]>,
    /// Views by cell, the third index runs fastest; none where no view went through the block.
    counts: Vec<Vec<u16>>,
}

impl Through {
    /// Counts `views` up to some metres from their cameras, in all blocks that hold one of the cells or touch a block that does.
    pub(super) fn of(
        recording: &Recording,
        views: &[&Sketch],
        how: &Gathering,
        cells: impl Iterator<Item = [i32; 3]>,
    ) -> Self {
        let held: BTreeSet<[i32; 3]> = cells.map(|index| index.map(|i| i.div_euclid(SIDE))).collect();
        let around: BTreeSet<[i32; 3]> = held
            .iter()
            .flat_map(|b| (0..27).map(move |i| [b[0] + i % 3 - 1, b[1] + i / 3 % 3 - 1, b[2] + i / 9 - 1]))
            .collect();
        let blocks: Vec<[i32; 3]> = around.into_iter().collect();
        let views: Vec<View> = views.iter().filter_map(|sketch| View::of(recording, sketch, &how.axes)).collect();
        let counts = blocks.par_iter().map(|block| counted(block, &views, how.edge_m, how.rules)).collect();
        Self { blocks, counts }
    }

    /// Views that saw through a cell.
    pub(super) fn at(&self, index: &[i32; 3]) -> u32 {
        let block = index.map(|i| i.div_euclid(SIDE));
        let [x, y, z] = index.map(|i| i.rem_euclid(SIDE) as usize);
        let counts = self.blocks.binary_search(&block).ok().and_then(|i| self.counts.get(i));
        counts.and_then(|c| c.get((x * SIDE as usize + y) * SIDE as usize + z)).map_or(0, |n| u32::from(*n))
    }

    /// All cells that a view saw through, with the number of such views.
    pub(super) fn cells(&self) -> impl Iterator<Item = ([i32; 3], u32)> + '_ {
        self.blocks.iter().zip(&self.counts).flat_map(|(block, counts)| {
            counts.iter().enumerate().filter(|(_, n)| **n > 0).map(move |(i, n)| {
                let i = i as i32;
                let within = [i / (SIDE * SIDE), i / SIDE % SIDE, i % SIDE];
                let index: [i32; 3] = std::array::from_fn(|k| block[k] * SIDE + within[k]);
                (index, u32::from(*n))
            })
        })
    }
}

/// A view of the grid.
struct View<'a> {
    sketch: &'a Sketch,
    /// Its pixels are the samples.
    camera: Camera,
    /// Rotation `camera_from_grid`.
    turn: Matrix3<f64>,
    /// The grid's origin in the camera frame, metres.
    shift: Vector,
    /// Depth as read for a metre, millimetres.
    mm_per_m: f64,
}

impl<'a> View<'a> {
    fn of(recording: &Recording, sketch: &'a Sketch, axes: &[Vector; 3]) -> Option<Self> {
        let camera_from_world = recording.frames.get(sketch.frame)?.world_from_camera.inverse();
        Some(Self {
            sketch,
            camera: sketch.camera(recording.camera_of(sketch.frame)),
            turn: camera_from_world.rotation.to_rotation_matrix().matrix() * Matrix3::from_columns(axes),
            shift: camera_from_world.translation.vector,
            mm_per_m: 1000.0 / recording.depth_factor(sketch.frame),
        })
    }

    /// Whether a ball (camera frame, metres) may be in the image and near enough.
    fn meets(&self, middle: &Vector, radius: f64, near_m: f64) -> bool {
        let Camera { width, height, fx, fy, cx, cy } = self.camera;
        let inside = |along: f64, focal: f64, edge: f64| focal * along + edge * middle.z > -radius * focal.hypot(edge);
        (-radius..near_m + radius).contains(&middle.z)
            && inside(middle.x, fx, cx + 0.5)
            && inside(-middle.x, fx, width as f64 - 0.5 - cx)
            && inside(middle.y, fy, cy + 0.5)
            && inside(-middle.y, fy, height as f64 - 0.5 - cy)
    }

    /// Whether sight goes on `behind_m` behind a point (camera frame, metres): at its sample and at all around it, so that neither
    /// a slanted surface nor an edge is taken for empty.
    fn goes_through(&self, p: &Vector, behind_m: f64, rules: &config::GatheredRoom) -> bool {
        if !(rules.blind_m..=rules.near_m).contains(&p.z) {
            return false;
        }
        let (u, v) = (self.camera.fx * p.x / p.z + self.camera.cx, self.camera.fy * p.y / p.z + self.camera.cy);
        let Some((x, y)) = self.sketch.nearest(u, v) else { return false };
        let depth = &self.sketch.depth_mm;
        if x == 0 || y == 0 || x + 1 >= depth.width || y + 1 >= depth.height {
            return false;
        }
        let least = self.mm_per_m * (p.z + behind_m + rules.behind_per_m * p.z);
        let beyond = |x: usize, y: usize| depth.get(x, y).is_some_and(|mm| f64::from(mm) > least);
        beyond(x, y) && (y - 1..=y + 1).all(|row| (x - 1..=x + 1).all(|column| beyond(column, row)))
    }
}

/// Views that saw through each cell of a block.
fn counted(block: &[i32; 3], views: &[View], edge: f64, rules: &config::GatheredRoom) -> Vec<u16> {
    let side = f64::from(SIDE) * edge;
    let corner = Vector::from(block.map(|i| f64::from(i) * side));
    let middle = corner + Vector::repeat(0.5 * side);
    // Half the diagonal of a cube.
    let radius = 0.867 * side;
    let mut counts = vec![0u16; COUNT];
    let mut any = false;
    for view in views {
        if !view.meets(&(view.turn * middle + view.shift), radius, rules.near_m) {
            continue;
        }
        let first: Vector = view.turn * (corner + Vector::repeat(0.5 * edge)) + view.shift;
        let step = |k: usize| -> Vector { view.turn.column(k) * edge };
        let (dx, dy, dz) = (step(0), step(1), step(2));
        for (i, count) in counts.iter_mut().enumerate() {
            let side = SIDE as usize;
            let p: Vector =
                first + dx * (i / (side * side)) as f64 + dy * (i / side % side) as f64 + dz * (i % side) as f64;
            if view.goes_through(&p, rules.behind_share * edge, rules) {
                *count = count.saturating_add(1);
                any = true;
            }
        }
    }
    if any { counts } else { Vec::new() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Pose;
    use crate::recording::{DepthFactors, Frame, Grid};

    /// A camera at the origin that looks along +z at a wall 2 m away; depth as read is twice that.
    fn facing_a_wall() -> (Recording, Sketch) {
        let recording = Recording {
            frames: vec![Frame {
                timestamp_secs: 0.0,
                world_from_camera: Pose::identity(),
                files: crate::recording::FrameFiles { depth: Some("0.png".into()), ..Default::default() },
            }],
            depth_factors: DepthFactors { other: 0.5, ..Default::default() },
            ..Recording::empty(Camera { width: 160, height: 120, fx: 100.0, fy: 100.0, cx: 79.5, cy: 59.5 })
        };
        let sketch = Sketch::of(0, &Grid::filled(160, 120, 4.0f32), None);
        (recording, sketch)
    }

    #[test]
    fn what_is_before_a_wall_is_seen_through_and_the_wall_and_what_it_hides_is_not() {
        let (recording, sketch) = facing_a_wall();
        let axes = [Vector::x(), Vector::y(), Vector::z()];
        let rules = &config::GatheredRoom::default();
        let how = Gathering { axes, edge_m: 0.05, stride: 1, views: 1, free_views: 1, rules };
        let wall = [[0, 0, 40], [10, 0, 40]];
        let through = Through::of(&recording, &[&sketch, &sketch], &how, wall.into_iter());
        let before: Vec<u32> = (32..48).map(|z| through.at(&[0, 0, z])).collect();
        // The middle of cell 38 is 7.5 cm before the wall, that of cell 39 a whole cell nearer.
        assert_eq!(before[..7], [2; 7]);
        assert_eq!(before[7..], [0; 9]);
        // Beside the image and far from the cells nothing is known.
        assert_eq!((through.at(&[-36, 0, 36]), through.at(&[0, 0, 4])), (0, 0));
        let all: Vec<([i32; 3], u32)> = through.cells().collect();
        assert!(all.contains(&([0, 0, 37], 2)) && all.iter().all(|(index, n)| through.at(index) == *n));
    }
}
