//! The surface in a volume (surface nets, Gibson 1998): one vertex a cell that the surface runs through, one quad an edge.

use rayon::prelude::*;

use super::fuse::{BlockIndex, COUNT, SIDE, Volume};
use super::local::Local;

/// A voxel with less weight than one view from four metres, well slanted, is not known.
const LEAST_WEIGHT: f32 = 0.01;
/// Between neighbours a distance changes by a voxel at the most. More is where one surface hides another, in voxels.
const STEEP: f32 = 2.5;
/// Corners of the cells of a block, along an edge.
const CORNERS: usize = SIDE + 1;
/// No vertex in this cell.
const NONE: u16 = u16::MAX;

/// Triangles, counter-clockwise seen from the side that cameras were on.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct SurfaceMesh {
    pub(super) positions: Vec<Local>,
    pub(super) triangles: Vec<[u32; 3]>,
}

impl SurfaceMesh {
    /// Across a triangle, twice as long as its area.
    pub(super) fn across(&self, triangle: &[u32; 3]) -> Local {
        let [a, b, c] = triangle.map(|v| self.positions[v as usize]);
        (b - a).cross(&(c - a))
    }

    /// The same with the vertices that no triangle uses left out, the others in their order.
    pub(super) fn compacted(self) -> Self {
        let mut number = vec![u32::MAX; self.positions.len()];
        self.triangles.iter().flatten().for_each(|v| number[*v as usize] = 0);
        let mut positions = Vec::new();
        for (n, p) in number.iter_mut().zip(&self.positions).filter(|(n, _)| **n == 0) {
            *n = positions.len() as u32;
            positions.push(*p);
        }
        let triangles = self.triangles.iter().map(|t| t.map(|v| number[v as usize])).collect();
        Self { positions, triangles }
    }
}

/// A block's cells.
struct Cells {
    /// Of the voxels of the block and the next ones: whether they are known to be inside.
    inside: Vec<bool>,
    vertices: Vec<Local>,
    /// Vertex of each cell.
    table: Vec<u16>,
}

/// The surface of a volume.
pub(super) fn surface(volume: &Volume) -> SurfaceMesh {
    let cells: Vec<Option<Cells>> = (0..volume.blocks.len()).into_par_iter().map(|b| cells(volume, b)).collect();
    let mut first = Vec::with_capacity(cells.len());
    let mut positions: Vec<Local> = Vec::new();
    for cells in &cells {
        first.push(positions.len() as u32);
        positions.extend(cells.iter().flat_map(|c| &c.vertices));
    }
    let triangles: Vec<Vec<[u32; 3]>> = (0..cells.len())
        .into_par_iter()
        .map(|b| match &cells[b] {
            Some(own) => quads(volume, b, own, &|block: usize, cell: usize| {
                let vertex = *cells[block].as_ref()?.table.get(cell)?;
                (vertex != NONE).then(|| first[block] + u32::from(vertex))
            })
            .into_iter()
            .flat_map(|quad| split(quad, &positions))
            .collect(),
            None => Vec::new(),
        })
        .collect();
    SurfaceMesh { positions, triangles: triangles.into_iter().flatten().collect() }
}

/// Positions of the neighbours of a block, by `offset * axis`: bit k of the number is axis k.
fn neighbours(volume: &Volume, index: &BlockIndex, offset: i32) -> [Option<usize>; 8] {
    std::array::from_fn(|bits| {
        let at: BlockIndex = std::array::from_fn(|k| index[k] + if bits >> k & 1 == 1 { offset } else { 0 });
        volume.find(&at)
    })
}

/// Distances at the voxels of a block and the next ones; not a number where they are not known.
fn corners(volume: &Volume, block: usize) -> Vec<f32> {
    let next = neighbours(volume, &volume.blocks[block].index, 1);
    let mut out = vec![f32::NAN; CORNERS * CORNERS * CORNERS];
    for (i, value) in out.iter_mut().enumerate() {
        let at = [i % CORNERS, i / CORNERS % CORNERS, i / (CORNERS * CORNERS)];
        let bits = (0..3).map(|k| usize::from(at[k] == SIDE) << k).sum::<usize>();
        let Some(there) = next[bits] else { continue };
        let [x, y, z] = at.map(|c| c % SIDE);
        let [distance, weight] = volume.blocks[there].voxels[(z * SIDE + y) * SIDE + x];
        if weight >= LEAST_WEIGHT {
            *value = distance;
        }
    }
    out
}

/// A cell's corner with number `i`, by the bits of `bits`, among the block's corners.
fn corner_of(cell: usize, bits: usize) -> usize {
    let at = [cell % SIDE, cell / SIDE % SIDE, cell / (SIDE * SIDE)];
    let [x, y, z] = std::array::from_fn(|k| at[k] + (bits >> k & 1));
    (z * CORNERS + y) * CORNERS + x
}

/// Vertices of a block's cells; `None` where no surface runs through it.
fn cells(volume: &Volume, block: usize) -> Option<Cells> {
    let here = &volume.blocks[block];
    if !here.voxels.iter().any(|v| v[0].abs() < 2.0 * volume.voxel && v[1] >= LEAST_WEIGHT) {
        return None;
    }
    let corners = corners(volume, block);
    let mut vertices = Vec::new();
    let mut table = vec![NONE; COUNT];
    for (cell, vertex) in table.iter_mut().enumerate() {
        let values: [f32; 8] = std::array::from_fn(|bits| corners[corner_of(cell, bits)]);
        let Some(within) = crossing(&values, STEEP * volume.voxel) else { continue };
        let at = [cell % SIDE, cell / SIDE % SIDE, cell / (SIDE * SIDE)];
        let place: [f32; 3] = std::array::from_fn(|k| (here.index[k] * SIDE as i32 + at[k] as i32) as f32 + within[k]);
        *vertex = vertices.len() as u16;
        vertices.push(volume.place(place));
    }
    let inside = corners.iter().map(|distance| *distance < 0.0).collect();
    (!vertices.is_empty()).then_some(Cells { inside, vertices, table })
}

/// Where in a cell (0 to 1 along each axis) the surface runs: the mean of where it meets the edges. `None` where it does not,
/// or not all corners are known.
fn crossing(values: &[f32; 8], steep: f32) -> Option<[f32; 3]> {
    let inside = values.iter().filter(|v| **v < 0.0).count();
    if inside == 0 || inside == 8 || values.iter().any(|v| v.is_nan()) {
        return None;
    }
    let (mut sum, mut count) = ([0.0f32; 3], 0.0f32);
    for low in 0..8usize {
        for axis in (0..3).filter(|axis| low >> axis & 1 == 0) {
            let (a, b) = (values[low], values[low | 1 << axis]);
            if (a < 0.0) == (b < 0.0) {
                continue;
            }
            if (a - b).abs() > steep {
                return None;
            }
            for (k, s) in sum.iter_mut().enumerate() {
                *s += if k == axis { a / (a - b) } else { (low >> k & 1) as f32 };
            }
            count += 1.0;
        }
    }
    Some(sum.map(|s| s / count))
}

/// Quads across the edges of a block that the surface meets, by the vertices of the four cells around each.
fn quads(volume: &Volume, block: usize, own: &Cells, vertex: &dyn Fn(usize, usize) -> Option<u32>) -> Vec<[u32; 4]> {
    let before = neighbours(volume, &volume.blocks[block].index, -1);
    let mut out = Vec::new();
    for cell in (0..COUNT).filter(|&cell| own.table[cell] != NONE) {
        let at = [cell % SIDE, cell / SIDE % SIDE, cell / (SIDE * SIDE)];
        let here = own.inside[corner_of(cell, 0)];
        for axis in 0..3 {
            if here == own.inside[corner_of(cell, 1 << axis)] {
                continue;
            }
            let (b, c) = ((axis + 1) % 3, (axis + 2) % 3);
            // The cell that lies one back along some axes.
            let back = |axes: &[usize]| -> Option<u32> {
                let (mut bits, mut place) = (0, at);
                for &k in axes {
                    if place[k] == 0 {
                        bits |= 1 << k;
                        place[k] = SIDE;
                    }
                    place[k] -= 1;
                }
                vertex(before[bits]?, (place[2] * SIDE + place[1]) * SIDE + place[0])
            };
            // Around the axis by the right-hand rule: seen from its positive end.
            if let (Some(v0), Some(v1), Some(v2), Some(v3)) = (back(&[b, c]), back(&[c]), back(&[]), back(&[b])) {
                // Outside is where the distance is positive.
                out.push(if here { [v0, v1, v2, v3] } else { [v3, v2, v1, v0] });
            }
        }
    }
    out
}

/// A quad as two triangles, along the shorter diagonal.
fn split([a, b, c, d]: [u32; 4], positions: &[Local]) -> [[u32; 3]; 2] {
    let length = |i: u32, k: u32| (positions[i as usize] - positions[k as usize]).norm_squared();
    if length(a, c) <= length(b, d) { [[a, b, c], [a, c, d]] } else { [[a, b, d], [b, c, d]] }
}

/// Drops pieces that hang together with nothing and are smaller than an area.
pub(super) fn without_shards(mesh: SurfaceMesh, least_m2: f64) -> SurfaceMesh {
    let mut parent: Vec<u32> = (0..mesh.positions.len() as u32).collect();
    for &[a, b, c] in &mesh.triangles {
        for other in [b, c] {
            let (x, y) = (root(&mut parent, a), root(&mut parent, other));
            parent[x.max(y) as usize] = x.min(y);
        }
    }
    let mut area = vec![0.0f64; mesh.positions.len()];
    for triangle in &mesh.triangles {
        area[root(&mut parent, triangle[0]) as usize] += 0.5 * f64::from(mesh.across(triangle).norm());
    }
    let triangles =
        mesh.triangles.iter().filter(|t| area[root(&mut parent, t[0]) as usize] >= least_m2).copied().collect();
    SurfaceMesh { triangles, positions: mesh.positions }.compacted()
}

/// The root of a vertex's piece; ways are halved as they are walked.
pub(super) fn root(parent: &mut [u32], mut vertex: u32) -> u32 {
    while parent[vertex as usize] != vertex {
        let above = parent[parent[vertex as usize] as usize];
        parent[vertex as usize] = above;
        vertex = above;
    }
    vertex
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::appearance::fuse::VoxelBlock;

    /// A square of so many centimetres in steps of one, at such a height above each of its points.
    pub(in crate::appearance) fn sheet(n: u32, height: impl Fn(f32, f32) -> f32) -> SurfaceMesh {
        let at = |i: u32| {
            let (x, y) = (0.01 * (i % (n + 1)) as f32, 0.01 * (i / (n + 1)) as f32);
            Local::new(x, y, height(x, y))
        };
        let quad = |i: u32| {
            let a = i / n * (n + 1) + i % n;
            [[a, a + 1, a + n + 2], [a, a + n + 2, a + n + 1]]
        };
        SurfaceMesh {
            positions: (0..(n + 1) * (n + 1)).map(at).collect(),
            triangles: (0..n * n).flat_map(quad).collect(),
        }
    }

    /// A ball of 0.23 m about a point in voxels of 2 cm.
    fn ball() -> Volume {
        let voxel = 0.02f32;
        let mut volume = Volume { voxel, blocks: Vec::new() };
        let range = -3..3;
        for x in range.clone() {
            for y in range.clone() {
                for z in range.clone() {
                    let voxels = (0..COUNT)
                        .map(|i| {
                            let at = [i % SIDE, i / SIDE % SIDE, i / (SIDE * SIDE)];
                            let corner = [x, y, z].map(|c: i32| (c * SIDE as i32) as f32);
                            let p = volume.place(std::array::from_fn(|k| corner[k] + at[k] as f32));
                            [(p - Local::new(0.01, -0.02, 0.03)).norm() - 0.23, 1.0]
                        })
                        .collect();
                    volume.blocks.push(VoxelBlock { index: [x, y, z], voxels });
                }
            }
        }
        volume
    }

    #[test]
    fn a_ball_is_closed_and_faces_outwards() {
        let mesh = surface(&ball());
        assert!(mesh.triangles.len() > 2000);
        let mut edges = std::collections::BTreeMap::new();
        for t in &mesh.triangles {
            for k in 0..3 {
                let (a, b) = (t[k], t[(k + 1) % 3]);
                *edges.entry((a.min(b), a.max(b))).or_insert(0) += if a < b { 1 } else { -1 };
            }
            let middle = (0..3).fold(Local::zeros(), |sum, k| sum + mesh.positions[t[k] as usize]) / 3.0;
            assert!(mesh.across(t).dot(&(middle - Local::new(0.01, -0.02, 0.03))) > 0.0);
        }
        assert!(edges.values().all(|sum| *sum == 0), "an open edge");
        let off = mesh.positions.iter().map(|p| ((p - Local::new(0.01, -0.02, 0.03)).norm() - 0.23).abs());
        assert!(off.fold(0.0, f32::max) < 0.004);
    }

    #[test]
    fn shards_go_and_the_rest_stays() {
        let mut mesh = surface(&ball());
        let whole = mesh.triangles.len();
        let at = mesh.positions.len() as u32;
        mesh.positions.extend([Local::new(2.0, 0.0, 0.0), Local::new(2.1, 0.0, 0.0), Local::new(2.0, 0.1, 0.0)]);
        mesh.triangles.push([at, at + 1, at + 2]);
        let kept = without_shards(mesh, 0.03);
        assert_eq!((kept.triangles.len(), kept.positions.len()), (whole, at as usize));
    }
}
