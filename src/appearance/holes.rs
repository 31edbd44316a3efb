//! Small holes in flat surface are closed: behind a handle, or whatever else hides a little of a front from all views, nobody saw the
//! front. Holes that a view looked through stay, and so does what a part moves out of.

use std::collections::BTreeMap;

use rayon::prelude::*;

use super::boxes::{self, holds};
use super::fuse::Volume;
use super::local::Local;
use super::surface_mesh::SurfaceMesh;
use crate::config;
use crate::math::Point;
use crate::twin::{OrientedBox, Twin};

/// A rim is flat where it lies within so many voxels of its plane in the mean, and nowhere further off than so many.
const FLAT_VOXELS: [f32; 2] = [1.0, 4.0];
/// Surface around a hole looks the way that the hole does (cosine, in the mean: at a handle it bends out); around an island it looks
/// the other way.
const SAME_WAY: f32 = 0.3;
/// A hole was looked through where more of it than this is known to be free.
const FREE_SHARE: f32 = 0.1;

/// Closes the holes that are no longer than `config.hole_m`. `origin` is the local one, world.
pub(super) fn closed(
    mut mesh: SurfaceMesh,
    volume: &Volume,
    twin: &Twin,
    origin: &Point,
    config: &config::Appearance,
) -> SurfaceMesh {
    let parts: Vec<OrientedBox> = twin.furniture.iter().flat_map(|f| boxes::fronts(&f.part, config.slab_m)).collect();
    let (edges, ways) = open_edges(&mesh);
    let mut more = Vec::new();
    for rim in rims(&edges) {
        let Some(plane) = Plane::around(&mesh, &rim, &ways, volume.voxel, config.hole_m as f32) else { continue };
        let middle = origin + plane.middle.map(f64::from);
        if parts.iter().any(|part| holds(part, &middle)) {
            continue;
        }
        let patch = plane.patch(&mesh, &rim);
        let free = patch.iter().filter(|t| {
            let middle = t.iter().map(|v| mesh.positions[*v as usize]).sum::<Local>() / 3.0;
            volume.is_free(&middle)
        });
        if free.count() as f32 <= FREE_SHARE * patch.len() as f32 {
            more.extend(patch);
        }
    }
    mesh.triangles.extend(more);
    mesh
}

/// Vertex to vertex along the rims of what is missing, the surface on the right; and which way the surface looks there.
type OpenEdges = (BTreeMap<u32, Vec<u32>>, BTreeMap<[u32; 2], Local>);

fn open_edges(mesh: &SurfaceMesh) -> OpenEdges {
    let sides = |&[a, b, c]: &[u32; 3]| [[a, b], [b, c], [c, a]];
    let key = |[from, to]: [u32; 2]| u64::from(from) << 32 | u64::from(to);
    let mut directed: Vec<u64> = mesh.triangles.par_iter().flat_map_iter(|t| sides(t).map(key)).collect();
    directed.par_sort_unstable();
    let is_open = |&[from, to]: &[u32; 2]| directed.binary_search(&key([to, from])).is_err();
    let open: Vec<([u32; 2], Local)> = mesh
        .triangles
        .par_iter()
        .flat_map_iter(|triangle| {
            let way = || mesh.across(triangle).try_normalize(1e-12).unwrap_or_default();
            sides(triangle).into_iter().filter(is_open).map(move |[from, to]| ([to, from], way()))
        })
        .collect();
    let (mut edges, mut ways) = (BTreeMap::<u32, Vec<u32>>::new(), BTreeMap::new());
    for ([from, to], way) in open {
        edges.entry(from).or_default().push(to);
        ways.insert([from, to], way);
    }
    (edges, ways)
}

/// Closed ways along open edges that meet no vertex twice.
fn rims(edges: &BTreeMap<u32, Vec<u32>>) -> Vec<Vec<u32>> {
    let mut left = edges.clone();
    let mut all = Vec::new();
    for &start in edges.keys() {
        let mut way: Vec<u32> = vec![start];
        let mut place: BTreeMap<u32, usize> = BTreeMap::from([(start, 0)]);
        while let Some(next) = way.last().and_then(|last| left.get_mut(last)).and_then(Vec::pop) {
            match place.get(&next).copied() {
                // Back where it has been: what lies between is a rim of its own.
                Some(first) => {
                    let rim = way.split_off(first);
                    for vertex in &rim {
                        place.remove(vertex);
                    }
                    all.push(rim);
                    way.push(next);
                    place.insert(next, first);
                }
                None => {
                    place.insert(next, way.len());
                    way.push(next);
                }
            }
        }
    }
    all
}

/// The plane of a hole.
struct Plane {
    middle: Local,
    /// Unit; towards where cameras were.
    out: Local,
}

impl Plane {
    /// Of a rim; `None` where it is no flat, small hole in one surface.
    fn around(
        mesh: &SurfaceMesh,
        rim: &[u32],
        ways: &BTreeMap<[u32; 2], Local>,
        voxel: f32,
        longest: f32,
    ) -> Option<Self> {
        if rim.len() < 3 {
            return None;
        }
        let places: Vec<Local> = rim.iter().map(|v| mesh.positions[*v as usize]).collect();
        let [low, high] = places.iter().fold([places[0]; 2], |[low, high], p| [low.inf(p), high.sup(p)]);
        if (high - low).norm() > longest {
            return None;
        }
        let count = places.len() as f32;
        let middle = places.iter().sum::<Local>() / count;
        let next = |i: usize| (i + 1) % places.len();
        let area = (0..places.len())
            .fold(Local::zeros(), |sum, i| sum + (places[i] - middle).cross(&(places[next(i)] - middle)));
        let out = area.try_normalize(1e-9)?;
        let off = places.iter().map(|p| (p - middle).dot(&out).abs());
        let [mean, most] = FLAT_VOXELS.map(|voxels| voxels * voxel);
        if off.clone().sum::<f32>() > mean * count || off.fold(0.0, f32::max) > most {
            return None;
        }
        let along = (0..rim.len()).filter_map(|i| ways.get(&[rim[i], rim[next(i)]]));
        let same = along.map(|way| way.dot(&out)).sum::<f32>();
        (same >= SAME_WAY * count).then_some(Self { middle, out })
    }

    /// Triangles over a rim, ears first. A rim that bends so that it crosses itself on the plane has none in the end, and is closed as
    /// it comes.
    fn patch(&self, mesh: &SurfaceMesh, rim: &[u32]) -> Vec<[u32; 3]> {
        let right = self.out.cross(&if self.out.x.abs() < 0.7 { Local::x() } else { Local::y() }).normalize();
        let up = self.out.cross(&right);
        let flat = |v: u32| {
            let from = mesh.positions[v as usize] - self.middle;
            [from.dot(&right), from.dot(&up)]
        };
        let mut left: Vec<(u32, [f32; 2])> = rim.iter().map(|v| (*v, flat(*v))).collect();
        let mut out = Vec::with_capacity(left.len().saturating_sub(2));
        while left.len() > 2 {
            let count = left.len();
            // The ear whose third side is shortest: no needles.
            let third = |i: &usize| length(left[(i + count - 1) % count].1, left[(i + 1) % count].1);
            let shortest = |of: &mut dyn Iterator<Item = usize>| of.min_by(|a, b| third(a).total_cmp(&third(b)));
            let ear = shortest(&mut (0..count).filter(|&i| is_ear(&left, i))).or_else(|| shortest(&mut (0..count)));
            let Some(ear) = ear else { break };
            out.push([left[(ear + count - 1) % count].0, left[ear].0, left[(ear + 1) % count].0]);
            left.remove(ear);
        }
        out
    }
}

fn length(a: [f32; 2], b: [f32; 2]) -> f32 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

/// Twice the area of a triangle, positive counter-clockwise.
fn twice_area(a: [f32; 2], b: [f32; 2], c: [f32; 2]) -> f32 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

/// Whether the corner `i` of a counter-clockwise polygon can be cut off.
fn is_ear(polygon: &[(u32, [f32; 2])], i: usize) -> bool {
    let count = polygon.len();
    let [before, after] = [(i + count - 1) % count, (i + 1) % count];
    let [a, b, c] = [before, i, after].map(|k| polygon[k].1);
    if twice_area(a, b, c) <= 0.0 {
        return false;
    }
    polygon
        .iter()
        .enumerate()
        .filter(|(k, _)| ![before, i, after].contains(k))
        .all(|(_, (_, p))| twice_area(a, b, *p) < 0.0 || twice_area(b, c, *p) < 0.0 || twice_area(c, a, *p) < 0.0)
}

#[cfg(test)]
mod tests {
    use super::super::fuse::{COUNT, SIDE, VoxelBlock};
    use super::*;

    const STEP: f32 = 0.01;

    /// A sheet of 40 by 40 cm in z = 0 that looks up, without the squares of a rectangle.
    fn sheet(missing: [std::ops::Range<u32>; 2]) -> SurfaceMesh {
        let side = 41;
        let positions = (0..side * side).map(|i| Local::new((i % side) as f32, (i / side) as f32, 0.0) * STEP);
        let squares = (0..40 * 40u32).filter(|i| !(missing[0].contains(&(i % 40)) && missing[1].contains(&(i / 40))));
        let triangles = squares.flat_map(|i| {
            let a = i / 40 * side + i % 40;
            [[a, a + 1, a + side + 1], [a, a + side + 1, a + side]]
        });
        SurfaceMesh { positions: positions.collect(), triangles: triangles.collect() }
    }

    /// All voxels around the sheet as far in front of a surface as said, or behind.
    fn volume(distance: f32) -> Volume {
        let index = |i: i32| [i % 7 - 1, i / 7 % 7 - 1, i / 49 - 1];
        let mut blocks: Vec<VoxelBlock> =
            (0..7 * 7 * 3).map(|i| VoxelBlock { index: index(i), voxels: vec![[distance, 1.0]; COUNT] }).collect();
        blocks.sort_by_key(|b| b.index);
        assert!(SIDE as f32 * STEP * 6.0 > 0.41);
        Volume { voxel: STEP, blocks }
    }

    fn bare() -> Twin {
        Twin::of(Vec::new())
    }

    fn area(mesh: &SurfaceMesh) -> f32 {
        mesh.triangles.iter().map(|t| 0.5 * mesh.across(t).norm()).sum()
    }

    fn filled(mesh: SurfaceMesh, distance: f32) -> SurfaceMesh {
        closed(mesh, &volume(distance), &bare(), &Point::origin(), &config::Appearance::default())
    }

    #[test]
    fn a_small_hole_is_closed_and_a_long_one_stays() {
        let whole = area(&sheet([0..0, 0..0]));
        // Behind a handle.
        let small = filled(sheet([12..27, 20..23]), -0.03);
        assert!((area(&small) - whole).abs() < 1e-6, "{} {whole}", area(&small));
        assert!(small.triangles.iter().all(|t| small.across(t).z > 0.0), "a triangle looks back");
        // The rim of the sheet itself is no hole, and neither is a compartment.
        assert_eq!(filled(sheet([0..0, 0..0]), -0.03), sheet([0..0, 0..0]));
        assert_eq!(filled(sheet([4..36, 4..36]), -0.03), sheet([4..36, 4..36]));
    }

    #[test]
    fn a_hole_that_was_looked_through_stays() {
        let open = sheet([12..27, 20..23]);
        assert_eq!(filled(open.clone(), 0.03), open);
    }

    #[test]
    fn holes_that_touch_are_closed_one_by_one() {
        let mut mesh = sheet([10..13, 10..13]);
        // A second hole that shares a corner with the first.
        let more = sheet([13..16, 13..16]);
        mesh.triangles.retain(|t| more.triangles.contains(t));
        let whole = area(&sheet([0..0, 0..0]));
        let closed = filled(mesh, -0.03);
        assert!((area(&closed) - whole).abs() < 1e-6, "{} {whole}", area(&closed));
    }
}
