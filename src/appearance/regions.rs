//! Which triangles make one chart: those that hang together and look the same way. What is too small for a chart of its own joins
//! what it borders on most: noise turns single triangles every way, and each chart costs the vertices of its rim twice.

use super::local::Local;
use super::surface_mesh::{SurfaceMesh, root};

/// Rounds in which small regions join others; each at least halves their number.
const ROUNDS: usize = 12;
/// A triangle seen at less than this (cosine) from its chart's direction would be smeared.
const LEAST_COSINE: f32 = 0.3;

/// Triangles of one chart.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct ChartRegion {
    /// Index of its direction.
    pub(super) direction: usize,
    /// Those that may lie on a chart of this direction, then the others, each ascending.
    pub(super) triangles: Vec<u32>,
}

/// The regions of a mesh, in the order of their first triangles: `labels` are directions by triangle, `beside` the triangles across
/// each triangle's edges. Regions smaller than `least_m2` are left only where they border on nothing.
pub(super) fn regions(
    mesh: &SurfaceMesh,
    beside: &[[u32; 3]],
    labels: &[u8],
    directions: &[Local],
    least_m2: f64,
) -> Vec<ChartRegion> {
    let mut parent: Vec<u32> = (0..mesh.triangles.len() as u32).collect();
    unite(&mut parent, beside, labels);
    // Square metres, at each region's root.
    let mut area = vec![0.0f64; mesh.triangles.len()];
    for (i, triangle) in mesh.triangles.iter().enumerate() {
        area[root(&mut parent, i as u32) as usize] += 0.5 * f64::from(mesh.across(triangle).norm());
    }
    for _ in 0..ROUNDS {
        let pairs = longest_borders(mesh, beside, &mut parent, &area, least_m2);
        if pairs.is_empty() {
            break;
        }
        for (small, other) in pairs {
            let (a, b) = (root(&mut parent, small), root(&mut parent, other));
            if a == b {
                continue;
            }
            let (joins, stays) = if area[a as usize] > area[b as usize] { (b, a) } else { (a, b) };
            parent[joins as usize] = stays;
            area[stays as usize] += area[joins as usize];
        }
    }
    // What lay between two regions of one direction may be gone.
    let mut labels = vec![0u8; mesh.triangles.len()];
    for region in gathered(mesh, &mut parent, directions) {
        region.triangles.iter().for_each(|i| labels[*i as usize] = region.direction as u8);
    }
    unite(&mut parent, beside, &labels);
    gathered(mesh, &mut parent, directions)
}

/// Joins neighbours of one label.
fn unite(parent: &mut [u32], beside: &[[u32; 3]], labels: &[u8]) {
    for (i, (label, beside)) in labels.iter().zip(beside).enumerate() {
        for &other in beside.iter().filter(|o| labels.get(**o as usize) == Some(label)) {
            let (a, b) = (root(parent, i as u32), root(parent, other));
            parent[a.max(b) as usize] = a.min(b);
        }
    }
}

/// For each region smaller than `least_m2` the region with which it shares most of its border; by root, ascending.
fn longest_borders(
    mesh: &SurfaceMesh,
    beside: &[[u32; 3]],
    parent: &mut [u32],
    area: &[f64],
    least_m2: f64,
) -> Vec<(u32, u32)> {
    let mut borders: Vec<(u32, u32, f32)> = Vec::new();
    for (i, (triangle, beside)) in mesh.triangles.iter().zip(beside).enumerate() {
        let own = root(parent, i as u32);
        if area[own as usize] >= least_m2 {
            continue;
        }
        for (k, other) in beside.iter().enumerate().filter(|(_, o)| (**o as usize) < mesh.triangles.len()) {
            let other = root(parent, *other);
            if other != own {
                let [from, to] = [triangle[k], triangle[(k + 1) % 3]].map(|v| mesh.positions[v as usize]);
                borders.push((own, other, (to - from).norm()));
            }
        }
    }
    // Stable: sums are of the same numbers in the same order.
    borders.sort_by_key(|(own, other, _)| (*own, *other));
    let mut best: Vec<(u32, u32, f32)> = Vec::new();
    for same in borders.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)) {
        let Some((own, other, _)) = same.first().copied() else { continue };
        let length: f32 = same.iter().map(|(_, _, length)| length).sum();
        match best.last_mut() {
            Some(last) if last.0 == own => {
                if length > last.2 {
                    *last = (own, other, length);
                }
            }
            _ => best.push((own, other, length)),
        }
    }
    best.into_iter().map(|(own, other, _)| (own, other)).collect()
}

/// The triangles by their roots.
fn gathered(mesh: &SurfaceMesh, parent: &mut [u32], directions: &[Local]) -> Vec<ChartRegion> {
    let mut number = vec![usize::MAX; mesh.triangles.len()];
    let mut lists: Vec<Vec<u32>> = Vec::new();
    for i in 0..mesh.triangles.len() as u32 {
        let own = &mut number[root(parent, i) as usize];
        if *own == usize::MAX {
            *own = lists.len();
            lists.push(Vec::new());
        }
        lists[*own].push(i);
    }
    let region = |mut triangles: Vec<u32>| {
        let across = |i: &u32| mesh.across(&mesh.triangles[*i as usize]);
        let sum = triangles.iter().fold(Local::zeros(), |sum, i| sum + across(i));
        let direction = nearest(&sum, directions);
        // Where triangles lie on each other the first one's colours are kept.
        triangles.sort_by_key(|i| !fits(&across(i), direction, directions));
        ChartRegion { direction, triangles }
    };
    lists.into_iter().map(region).collect()
}

/// The direction that is nearest to that of a vector; the first of several.
pub(super) fn nearest(across: &Local, directions: &[Local]) -> usize {
    let along = directions.iter().map(|d| d.dot(across)).enumerate();
    along.max_by(|a, b| a.1.total_cmp(&b.1).then(b.0.cmp(&a.0))).map_or(0, |best| best.0)
}

/// Whether a triangle may lie on a chart of a direction.
pub(super) fn fits(across: &Local, direction: usize, directions: &[Local]) -> bool {
    directions.get(direction).is_some_and(|d| d.dot(across) > LEAST_COSINE * across.norm())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_triangle_that_looks_elsewhere_joins_the_sheet_around_it() {
        // Squares of 10 cm in a row; the third one is said to look another way, the last one does.
        let at = |i: u32| Local::new(0.1 * (i / 2) as f32, 0.1 * (i % 2) as f32, if i < 12 { 0.0 } else { 0.3 });
        let quad = |i: u32| [[2 * i, 2 * i + 2, 2 * i + 3], [2 * i, 2 * i + 3, 2 * i + 1]];
        let mesh = SurfaceMesh { positions: (0..14).map(at).collect(), triangles: (0..6).flat_map(quad).collect() };
        let beside: Vec<[u32; 3]> = (0..6u32)
            .flat_map(|i| {
                let (before, next) =
                    (if i > 0 { 2 * i - 2 } else { u32::MAX }, if i < 5 { 2 * i + 3 } else { u32::MAX });
                [[u32::MAX, next, 2 * i + 1], [2 * i, u32::MAX, before]]
            })
            .collect();
        let directions = [Local::z(), -Local::x()];
        let labels: Vec<u8> = [0, 0, 0, 0, 1, 1, 0, 0, 0, 0, 1, 1].to_vec();
        let whole = regions(&mesh, &beside, &labels, &directions, 0.015);
        assert_eq!(whole.iter().map(|r| r.direction).collect::<Vec<_>>(), [0, 1]);
        assert_eq!(whole[0].triangles, (0..10).collect::<Vec<u32>>());
        assert_eq!(whole[1].triangles, [10, 11]);
        // However small, what borders on nothing stays.
        let alone = vec![[u32::MAX; 3]; 12];
        assert_eq!(regions(&mesh, &alone, &labels, &directions, 1.0).len(), 12);
    }
}
