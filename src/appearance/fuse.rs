//! Depth of many frames as one signed distance (TSDF), on blocks of voxels around what was seen (Curless and Levoy 1996).
//!
//! Each block goes through all frames that may see it, in their order, alone: no locks, no look-ups within a block, and the same
//! sums on any number of threads.

use rayon::prelude::*;
use wide::f32x8;

use super::frame_sights::FrameSight;
use super::local::Local;
use super::sight_camera::SightCamera;
use crate::config;

/// Voxels along the edge of a block.
pub(super) const SIDE: usize = 8;
/// Voxels of a block.
pub(super) const COUNT: usize = SIDE * SIDE * SIDE;
/// Bytes of a voxel.
const VOXEL_BYTES: usize = 8;
/// A ray that goes on through a place says less than one that ends there: depth noise would eat thin things.
const FREE_WEIGHT: f32 = 0.3;
/// Nearer than this depth is no surer, metres.
const SURE_M: f32 = 0.5;

/// A block by its index: block (0, 0, 0) has its lower corner at the local origin.
pub(super) type BlockIndex = [i32; 3];

/// A cube of voxels.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct VoxelBlock {
    pub(super) index: BlockIndex,
    /// Signed distance in metres, positive on the side that cameras were on, and its weight; x runs fastest.
    pub(super) voxels: Vec<[f32; 2]>,
}

/// Blocks of voxels.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Volume {
    /// Edge of a voxel, metres.
    pub(super) voxel: f32,
    /// By index, ascending.
    pub(super) blocks: Vec<VoxelBlock>,
}

impl Volume {
    /// Position of a block in the list.
    pub(super) fn find(&self, index: &BlockIndex) -> Option<usize> {
        self.blocks.binary_search_by(|b| b.index.cmp(index)).ok()
    }

    /// The weight of the voxel that is nearest to a place; 0 where there is none.
    pub(super) fn weight(&self, p: &Local) -> f32 {
        self.nearest(p).map_or(0.0, |voxel| voxel[1])
    }

    /// Whether views looked through a place: it is known to be more than a voxel before any surface.
    pub(super) fn is_free(&self, p: &Local) -> bool {
        self.nearest(p).is_some_and(|[distance, weight]| weight > 0.0 && distance > self.voxel)
    }

    /// Distance and weight of the voxel that is nearest to a place.
    fn nearest(&self, p: &Local) -> Option<[f32; 2]> {
        let at = [p.x, p.y, p.z].map(|c| (c / self.voxel - 0.5).round() as i32);
        let [x, y, z] = at.map(|c| c.rem_euclid(SIDE as i32) as usize);
        let block = self.find(&at.map(|c| c.div_euclid(SIDE as i32))).and_then(|b| self.blocks.get(b));
        block.and_then(|b| b.voxels.get((z * SIDE + y) * SIDE + x)).copied()
    }

    /// Where a voxel of the whole grid is, counted from the origin.
    pub(super) fn place(&self, voxel: [f32; 3]) -> Local {
        Local::from(voxel.map(|c| (c + 0.5) * self.voxel))
    }
}

/// Fuses frames. Voxels are as large as asked for, or as what was seen needs to fit into the budget.
pub(super) fn fuse(sights: &[FrameSight], config: &config::Appearance) -> Volume {
    let most = (config.fuse_mb * 1e6 / (VOXEL_BYTES * COUNT) as f64) as usize;
    let mut voxel = config.voxel_m as f32;
    let reach = |voxel: f32| (config.truncation_m as f32).max(3.0 * voxel);
    let mut indices = touched(sights, voxel, reach(voxel));
    // Blocks along a surface grow fewer with the square of their edge, or nearly.
    for _ in 0..8 {
        if indices.len() <= most.max(1) {
            break;
        }
        voxel *= (1.05 * (indices.len() as f32 / most.max(1) as f32).sqrt()).clamp(1.05, 8.0);
        indices = touched(sights, voxel, reach(voxel));
    }
    let reach = reach(voxel);
    let blocks = indices.par_iter().filter_map(|index| integrated(*index, sights, voxel, reach)).collect();
    Volume { voxel, blocks }
}

/// Blocks within `reach` of what any frame sees of the room, ascending.
fn touched(sights: &[FrameSight], voxel: f32, reach: f32) -> Vec<BlockIndex> {
    let edge = voxel * SIDE as f32;
    let mut all: Vec<BlockIndex> = Vec::new();
    // In pieces: the same blocks are seen again and again.
    for some in sights.chunks(32) {
        let by_sight: Vec<Vec<BlockIndex>> = some.par_iter().map(|sight| touched_by(sight, edge, reach)).collect();
        all.extend(by_sight.into_iter().flatten());
        all.par_sort_unstable();
        all.dedup();
    }
    all
}

fn touched_by(sight: &FrameSight, edge: f32, reach: f32) -> Vec<BlockIndex> {
    /// Further from the first camera nothing is of the room, in blocks.
    const FAR: f32 = 1e6;
    let lens = &sight.lens;
    let farthest = (0..sight.samples.len()).map(|i| sight.depth(i)).fold(0.0, f32::max);
    if farthest <= 0.0 {
        return Vec::new();
    }
    // From one sample to the next the surface goes on by half a block at the most, where it is not slanted much.
    let focal = lens.focal[0].min(lens.focal[1]);
    let stride = ((0.5 * edge * focal / farthest) as usize).clamp(1, 8);
    // Along the ray, no block between left out; and a cell to all sides, as a surface seen edge-on goes along the ray.
    let steps = (4.0 * reach / edge).ceil().max(2.0) as usize;
    let aside = 1.5 * edge / SIDE as f32;
    let sides = [Local::x(), Local::y(), Local::z()].into_iter().flat_map(|axis| [axis * aside, -axis * aside]);
    let places: Vec<(f32, Local)> = (0..=steps)
        .map(|i| ((2.0 * i as f32 / steps as f32 - 1.0) * reach, Local::zeros()))
        .chain(sides.map(|side| (0.0, side)))
        .collect();
    let mut out: Vec<BlockIndex> = Vec::new();
    let mut before: Vec<BlockIndex> = vec![[i32::MAX; 3]; places.len()];
    for y in (0..lens.height).step_by(stride) {
        for x in (0..lens.width).step_by(stride) {
            let index = y * lens.width + x;
            let depth = sight.depth(index);
            if depth == 0.0 || sight.slant(index) == 0.0 {
                continue;
            }
            for ((along, side), last) in places.iter().zip(&mut before) {
                let p = (sight.point(x, y, depth + along) + side) / edge;
                if !p.iter().all(|c| c.abs() < FAR) {
                    continue;
                }
                let block: BlockIndex = [p.x, p.y, p.z].map(|c| c.floor() as i32);
                if block != *last {
                    *last = block;
                    out.push(block);
                }
            }
        }
    }
    out.sort_unstable();
    out.dedup();
    out
}

/// A block after all frames; `None` where none sees it.
fn integrated(index: BlockIndex, sights: &[FrameSight], voxel: f32, reach: f32) -> Option<VoxelBlock> {
    let edge = voxel * SIDE as f32;
    let corner = Local::from(index.map(|i| i as f32)) * edge;
    let middle = corner + Local::repeat(0.5 * edge);
    // Half the diagonal of a cube.
    let radius = 0.867 * edge;
    let mut voxels = vec![[0.0f32; 2]; COUNT];
    let mut any = false;
    for sight in sights {
        let center = sight.pose.apply(&middle);
        if !sight.lens.meets(&center, radius) || sight.hides(&center, radius + reach) {
            continue;
        }
        any |= add(sight, &corner, voxel, reach, &mut voxels);
    }
    if !any {
        return None;
    }
    for v in voxels.iter_mut().filter(|v| v[1] > 0.0) {
        v[0] /= v[1];
    }
    Some(VoxelBlock { index, voxels })
}

/// Adds a frame's weighted distances to the sums of a block's voxels; whether any was told something.
fn add(sight: &FrameSight, corner: &Local, voxel: f32, reach: f32, voxels: &mut [[f32; 2]]) -> bool {
    let lens = &sight.lens;
    let [width, height] = [lens.width as f32, lens.height as f32];
    let first = sight.pose.apply(&(corner + Local::repeat(0.5 * voxel)));
    let step = |k: usize| -> Local { sight.pose.rotation.column(k) * voxel };
    let (dx, dy, dz) = (step(0), step(1), step(2));
    let mut any = false;
    for (row, line) in voxels.chunks_exact_mut(SIDE).enumerate() {
        let start = first + dy * (row % SIDE) as f32 + dz * (row / SIDE) as f32;
        let [us, vs, zs] = projected(lens, &start, &dx);
        for (i, sum) in line.iter_mut().enumerate() {
            let (u, v, z) = (us[i], vs[i], zs[i]);
            if z < 0.05 || !(u >= 0.0 && v >= 0.0 && u < width && v < height) {
                continue;
            }
            let sample = sight.samples[v as usize * lens.width + u as usize];
            let slant = (sample >> 16) as f32 * (1.0 / 255.0);
            if slant == 0.0 {
                continue;
            }
            let distance = ((sample & 0xffff) as f32 * 1e-3 - z) * slant;
            if distance < -reach {
                continue;
            }
            let near = z.max(SURE_M);
            let mut weight = slant * slant / (near * near);
            if distance > reach {
                weight *= FREE_WEIGHT;
            }
            sum[0] += weight * distance.min(reach);
            sum[1] += weight;
            any = true;
        }
    }
    any
}

/// Column, row and depth of a line of voxels in the samples' camera, several at a time; columns and rows are whole within a pixel.
fn projected(lens: &SightCamera, start: &Local, step: &Local) -> [[f32; SIDE]; 3] {
    let steps = f32x8::from([0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0]);
    let along = |k: usize| f32x8::splat(start[k]) + f32x8::splat(step[k]) * steps;
    let z = along(2);
    let inverse = f32x8::splat(1.0) / z;
    // Half a pixel more: whole numbers are pixel centres.
    let pixel = |k: usize| along(k) * f32x8::splat(lens.focal[k]) * inverse + f32x8::splat(lens.center[k] + 0.5);
    [pixel(0).to_array(), pixel(1).to_array(), z.to_array()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_of_voxels_is_seen_where_its_voxels_are() {
        let lens = SightCamera { width: 640, height: 480, focal: [390.0, 400.0], center: [319.5, 239.5] };
        let (start, step) = (Local::new(0.3, -0.2, 2.0), Local::new(0.006, 0.003, -0.007));
        let [us, vs, zs] = projected(&lens, &start, &step);
        for (i, ((column, row), depth)) in us.iter().zip(&vs).zip(&zs).enumerate() {
            let p = start + step * i as f32;
            let [u, v] = lens.project(&p).map(|c| c + 0.5);
            assert!((column - u).abs() < 1e-3 && (row - v).abs() < 1e-3 && (depth - p.z).abs() < 1e-6);
        }
    }

    #[test]
    fn a_place_has_the_weight_of_its_nearest_voxel() {
        let mut volume = Volume { voxel: 0.1, blocks: Vec::new() };
        let mut voxels = vec![[0.0, 1.0]; COUNT];
        voxels[SIDE - 1] = [0.0, 5.0];
        volume.blocks.push(VoxelBlock { index: [-1, 0, 0], voxels });
        assert_eq!(volume.weight(&Local::new(-0.06, 0.04, 0.09)), 5.0);
        assert_eq!(volume.weight(&Local::new(-0.16, 0.04, 0.09)), 1.0);
        assert_eq!(volume.weight(&Local::new(0.06, 0.04, 0.09)), 0.0);
    }
}
