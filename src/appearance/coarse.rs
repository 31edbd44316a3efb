//! Fewer vertices by merging those of a cell (Rossignac and Borrel 1993): before simplification where the surface is flat, so that it
//! has less to go through; after it where noise lies on itself so closely that no edge can be collapsed.

use rayon::prelude::*;

use super::charts::normals;
use super::clean::rims;
use super::local::Local;
use super::simplify;
use super::surface_mesh::SurfaceMesh;
use crate::config;

/// Edges of the cells in which flat surface is merged, in voxels, one after the other: the first averages noise for the second.
const FLAT_CELLS: [f32; 2] = [2.0, 4.0];
/// Flat is what is no farther from a cell's plane, in voxels, and turns no more from its normal (cosine).
const FLAT_VOXELS: f32 = 0.25;
const FLAT_COSINE: f32 = 0.8;
/// A triangle that turns by more (cosine) when vertices are merged keeps its own.
const TURN: f32 = 0.5;
/// Largest cells in which anything is merged, in voxels: a hand's length at a centimetre.
const COARSEST: u32 = 16;

/// At most as many triangles as the config says, or as few as can be had.
pub(super) fn reduced(mesh: SurfaceMesh, voxel: f32, config: &config::Appearance) -> SurfaceMesh {
    if mesh.triangles.len() <= config.triangles {
        return mesh;
    }
    let flat = FLAT_CELLS.iter().fold(mesh, |mesh, cells| flat_merged(mesh, cells * voxel, FLAT_VOXELS * voxel));
    let mut mesh = simplify::simplify(flat, config.triangles);
    let mut cells = 2u32;
    while mesh.triangles.len() > config.triangles && cells <= COARSEST {
        mesh = simplify::simplify(merged(&mesh, cells as f32 * voxel), config.triangles);
        cells += cells.div_ceil(2);
    }
    mesh
}

/// Which cell a point lies in.
fn cell(p: &Local, edge: f32) -> [i32; 3] {
    [p.x, p.y, p.z].map(|c| (c / edge).floor() as i32)
}

/// Where each vertex goes: the number of the one that stands for it, and the places of those.
struct Merging {
    into: Vec<u32>,
    places: Vec<Local>,
}

impl Merging {
    /// Nothing goes anywhere.
    fn none(mesh: &SurfaceMesh) -> Self {
        Self { into: (0..mesh.positions.len() as u32).collect(), places: mesh.positions.clone() }
    }

    /// The vertices of a group go to the place of the first.
    fn join(&mut self, group: impl Iterator<Item = u32> + Clone, place: Local) {
        let Some(first) = group.clone().next() else { return };
        group.for_each(|v| self.into[v as usize] = first);
        self.places[first as usize] = place;
    }

    /// The mesh with what has become a line or a point left out, and of triangles with the same corners all but the first.
    fn applied(self, mesh: &SurfaceMesh) -> SurfaceMesh {
        let mut triangles: Vec<[u32; 3]> =
            mesh.triangles.iter().map(|t| t.map(|v| self.into[v as usize])).filter(has_corners).collect();
        let mut keys: Vec<([u32; 3], u32)> = triangles
            .iter()
            .enumerate()
            .map(|(i, t)| {
                let mut corners = *t;
                corners.sort_unstable();
                (corners, i as u32)
            })
            .collect();
        keys.par_sort_unstable();
        let mut twice = vec![false; triangles.len()];
        for pair in keys.windows(2) {
            if let [(before, _), (corners, i)] = pair
                && before == corners
            {
                twice[*i as usize] = true;
            }
        }
        let mut twice = twice.into_iter();
        triangles.retain(|_| !twice.next().unwrap_or(false));
        SurfaceMesh { positions: self.places, triangles }.compacted()
    }
}

/// Whether a triangle has three corners.
fn has_corners([a, b, c]: &[u32; 3]) -> bool {
    a != b && b != c && c != a
}

/// The way that a vertex looks: twice the axis along which its normal is longest, and one more where it looks along it.
fn facing(normal: &Local) -> usize {
    let axis = normal.iamax();
    2 * axis + usize::from(normal[axis] > 0.0)
}

/// Merges the vertices of each cell in which the surface lies within `off_m` of a plane. Open edges stay, and no triangle turns over.
///
/// Cells are columns along the way that vertices look, cut where these leave a gap: a wall may lie on any border of fixed cells.
fn flat_merged(mesh: SurfaceMesh, edge: f32, off_m: f32) -> SurfaceMesh {
    let (normals, rims) = (normals(&mesh), rims(&mesh));
    // Facing and column, then the height in eighths of an edge.
    let key = |p: &Local, n: &Local| {
        let facing = facing(n);
        let [u, v, height] = [1, 2, 3].map(|k| p[(facing / 2 + k) % 3] / edge);
        ([facing as i32, u.floor() as i32, v.floor() as i32], (8.0 * height).floor() as i32)
    };
    let mut keys: Vec<([i32; 3], i32, u32)> = mesh
        .positions
        .par_iter()
        .zip(&normals)
        .enumerate()
        .filter(|(i, _)| !rims[*i])
        .map(|(i, (p, n))| {
            let (column, height) = key(p, n);
            (column, height, i as u32)
        })
        .collect();
    keys.par_sort_unstable();
    let mut merging = Merging::none(&mesh);
    let hang_together = |a: &([i32; 3], i32, u32), b: &([i32; 3], i32, u32)| a.0 == b.0 && b.1 - a.1 <= 4;
    for group in keys.chunk_by(hang_together).filter(|group| group.len() > 1) {
        let own = || group.iter().map(|(_, _, v)| *v);
        let sum = |list: &[Local]| own().fold(Local::zeros(), |sum, v| sum + list[v as usize]);
        let middle = sum(&mesh.positions) / group.len() as f32;
        let Some(normal) = sum(&normals).try_normalize(1e-6) else { continue };
        let flat = own().all(|v| {
            let (p, n) = (&mesh.positions[v as usize], &normals[v as usize]);
            n.dot(&normal) >= FLAT_COSINE && (p - middle).dot(&normal).abs() <= off_m
        });
        if flat {
            merging.join(own(), middle);
        }
    }
    keep_facing(&mesh, &mut merging);
    merging.applied(&mesh)
}

/// Takes merged groups apart until no triangle turns over.
fn keep_facing(mesh: &SurfaceMesh, merging: &mut Merging) {
    loop {
        let mut apart = vec![false; mesh.positions.len()];
        let mut any = false;
        for triangle in &mesh.triangles {
            let new = triangle.map(|v| merging.into[v as usize]);
            if !has_corners(&new) {
                continue;
            }
            let [a, b, c] = new.map(|v| merging.places[v as usize]);
            let (before, now) = (mesh.across(triangle), (b - a).cross(&(c - a)));
            // A triangle whose corners stay is as it was.
            if now.dot(&before) < TURN * now.norm() * before.norm()
                && [a, b, c] != triangle.map(|v| mesh.positions[v as usize])
            {
                new.iter().for_each(|v| apart[*v as usize] = true);
                any = true;
            }
        }
        if !any {
            return;
        }
        for (v, place) in mesh.positions.iter().enumerate() {
            if apart[merging.into[v] as usize] {
                merging.into[v] = v as u32;
                merging.places[v] = *place;
            }
        }
    }
}

/// Merges the vertices of each cell that look the same way, whatever the surface is like there.
fn merged(mesh: &SurfaceMesh, edge: f32) -> SurfaceMesh {
    let normals = normals(mesh);
    let mut keys: Vec<([i32; 3], usize, u32)> = mesh
        .positions
        .iter()
        .zip(&normals)
        .enumerate()
        // Both sides of a board stay apart.
        .map(|(i, (p, n))| (cell(p, edge), facing(n), i as u32))
        .collect();
    keys.par_sort_unstable();
    let mut merging = Merging::none(mesh);
    for group in keys.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)).filter(|group| group.len() > 1) {
        let own = || group.iter().map(|(_, _, v)| *v);
        let middle = own().fold(Local::zeros(), |sum, v| sum + mesh.positions[v as usize]) / group.len() as f32;
        merging.join(own(), middle);
    }
    merging.applied(mesh)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::appearance::surface_mesh::tests::sheet;

    const VOXEL: f32 = 0.01;

    /// A square of a metre in steps of a voxel, with a hill of a hand's size in its middle.
    fn hill() -> SurfaceMesh {
        sheet(100, |x, y| (0.08 - (x - 0.5).hypot(y - 0.5)).max(0.0))
    }

    fn area(mesh: &SurfaceMesh) -> f32 {
        mesh.triangles.iter().map(|t| 0.5 * mesh.across(t).norm()).sum()
    }

    #[test]
    fn flat_surface_gets_larger_triangles_and_the_rest_stays() {
        let whole = hill();
        let few = flat_merged(whole.clone(), 2.0 * VOXEL, FLAT_VOXELS * VOXEL);
        assert!(few.triangles.len() * 10 < whole.triangles.len() * 4, "{}", few.triangles.len());
        assert!((area(&few) / area(&whole) - 1.0).abs() < 2e-3, "{} of {}", area(&few), area(&whole));
        assert!(few.triangles.iter().all(|t| few.across(t).z > 0.0));
        let top = few.positions.iter().map(|p| p.z).fold(0.0, f32::max);
        assert!((top - 0.08).abs() < 0.003, "{top}");
        // A wall on a border of cells, a millimetre rough, is as flat.
        let mut rough = whole.clone();
        rough.positions.iter_mut().enumerate().for_each(|(i, p)| p.z += 5e-4 * ((7 * i % 11) as f32 / 5.0 - 1.0));
        let fewer = flat_merged(rough, 2.0 * VOXEL, FLAT_VOXELS * VOXEL);
        assert!(fewer.triangles.len() * 10 < whole.triangles.len() * 4, "{}", fewer.triangles.len());
        // Open edges are where they were.
        let at_side = |m: &SurfaceMesh| m.positions.iter().filter(|p| p.x < 1e-6).count();
        assert_eq!(at_side(&few), at_side(&whole));
    }

    #[test]
    fn a_budget_is_kept_where_no_edge_can_be_collapsed() {
        // Tetrahedra of a centimetre: none can become less than a triangle with two sides.
        let mut mesh = SurfaceMesh::default();
        for i in 0..300u32 {
            let at = Local::new(0.02 * (i % 20) as f32, 0.02 * (i / 20) as f32, 0.0);
            mesh.positions.extend([Local::zeros(), Local::x(), Local::y(), Local::z()].map(|d| at + d * 0.01));
            let corner = 4 * i;
            mesh.triangles.extend([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]].map(|t| t.map(|v| corner + v)));
        }
        assert!(simplify::simplify(mesh.clone(), 200).triangles.len() > 200);
        let config = config::Appearance { triangles: 200, ..Default::default() };
        let few = reduced(mesh, VOXEL, &config);
        assert!((1..=200).contains(&few.triangles.len()), "{}", few.triangles.len());
    }

    #[test]
    fn both_sides_of_a_board_stay_apart() {
        let quad = |z: f32| [[0.0, 0.0], [0.1, 0.0], [0.1, 0.1], [0.0, 0.1]].map(|[x, y]| Local::new(x, y, z));
        let mesh = SurfaceMesh {
            positions: quad(0.012).into_iter().chain(quad(0.008)).collect(),
            triangles: vec![[0, 1, 2], [0, 2, 3], [4, 6, 5], [4, 7, 6]],
        };
        assert_eq!(merged(&mesh, 0.05), mesh);
    }
}
