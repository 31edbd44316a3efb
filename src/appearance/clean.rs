//! What noise leaves of a surface is taken away: rims that hardly any frame saw, and pieces that hang together with nothing.

use rayon::prelude::*;

use super::boxes::{self, holds};
use super::fuse::Volume;
use super::local::Local;
use super::surface_mesh::{SurfaceMesh, root};
use crate::config;
use crate::math::{Point, Vector};
use crate::twin::{OrientedBox, Solid, Twin};

/// Pieces on furniture stay from this share of a shard's length on: what stands there is small.
const ON_FURNITURE: f64 = 0.2;
/// What turns less from a front (cosine) is of the front, or looks like it.
const FLAT: f32 = 0.7;
/// What the names of the room's boxes begin with that carry nothing: people stand on the floor, and walls are upright.
const BARE: [&str; 2] = ["room_floor", "room_wall"];

/// Whether each vertex is on an open edge.
pub(super) fn rims(mesh: &SurfaceMesh) -> Vec<bool> {
    // Around a vertex with surface on all sides each neighbour comes once before it and once after it.
    let mut sums = vec![0i64; mesh.positions.len()];
    for &[a, b, c] in &mesh.triangles {
        for (own, next, before) in [(a, b, c), (b, c, a), (c, a, b)] {
            sums[own as usize] += i64::from(next) - i64::from(before);
        }
    }
    sums.into_iter().map(|sum| sum != 0).collect()
}

/// Takes triangles off open edges, one after the other from the outside, where the volume's weight is below `config.rim_weight`, no
/// further inwards than `config.rim_m`. Where depth ends at random the rim is frayed, and its colours are those of edges.
pub(super) fn without_frays(mut mesh: SurfaceMesh, volume: &Volume, config: &config::Appearance) -> SurfaceMesh {
    let rounds = (config.rim_m as f32 / volume.voxel).ceil() as usize;
    let least = config.rim_weight as f32;
    for _ in 0..rounds {
        let frayed: Vec<bool> = rims(&mesh)
            .par_iter()
            .zip(&mesh.positions)
            .map(|(is_rim, p)| *is_rim && volume.weight(p) < least)
            .collect();
        let before = mesh.triangles.len();
        mesh.triangles.retain(|t| !t.iter().any(|v| frayed[*v as usize]));
        if mesh.triangles.len() == before {
            break;
        }
    }
    mesh.compacted()
}

/// Cuts the surface along the seams around the fronts of closed parts: what lies within as a front does is theirs. Boards that end
/// behind a front stay. `origin` is the local one, world.
pub(super) fn without_fronts(
    mut mesh: SurfaceMesh,
    twin: &Twin,
    origin: &Point,
    config: &config::Appearance,
) -> SurfaceMesh {
    for front in twin.furniture.iter().flat_map(|f| boxes::fronts(&f.part, config.slab_m)) {
        cut(&mut mesh, &front, origin);
    }
    mesh.compacted()
}

/// Takes what lies flat within a front out of a surface, and moves what is left of triangles at its sides onto them.
fn cut(mesh: &mut SurfaceMesh, front: &OrientedBox, origin: &Point) {
    let world = |p: &Local| origin + p.map(f64::from);
    let out: Local = front.rotation.column(front.half.imin()).map(|c| c as f32);
    let mut within: Vec<bool> = mesh.positions.par_iter().map(|p| holds(front, &world(p))).collect();
    let mut left = Vec::with_capacity(mesh.triangles.len());
    let mut boards = Vec::new();
    for triangle in &mesh.triangles {
        let across = mesh.across(triangle);
        if !triangle.iter().all(|v| within[*v as usize]) {
            left.push(*triangle);
        } else if across.dot(&out).abs() <= FLAT * across.norm() {
            boards.push(*triangle);
        }
    }
    for v in boards.iter().flatten() {
        within[*v as usize] = false;
    }
    for (p, _) in mesh.positions.iter_mut().zip(&within).filter(|(_, within)| **within) {
        *p = (at_seam(front, &world(p)) - origin).map(|c| c as f32);
    }
    left.extend(boards);
    mesh.triangles = left;
}

/// The place on the nearest of a front's narrow sides, for a point within.
fn at_seam(front: &OrientedBox, p: &Point) -> Point {
    let local = front.rotation.transpose() * (p - front.center);
    let thin = front.half.imin();
    let room = |axis: &usize| front.half[*axis] - local[*axis].abs();
    let nearest = (0..3).filter(|axis| *axis != thin).min_by(|a, b| room(a).total_cmp(&room(b)));
    let mut moved = local;
    if let Some(axis) = nearest {
        moved[axis] = front.half[axis].copysign(local[axis]);
    }
    front.center + front.rotation * moved
}

/// A piece of surface that hangs together: its square metres, and the corners of its box.
#[derive(Clone, Copy)]
struct SurfacePiece {
    area: f64,
    low: Local,
    high: Local,
}

/// Drops pieces that hang together with nothing: smaller than `config.shard_m2`, or shorter than `config.shard_m`. On furniture
/// pieces are what stands there, and a fifth of the length is enough. `origin` is the local one, world.
pub(super) fn without_shards(
    mesh: SurfaceMesh,
    twin: &Twin,
    origin: &Point,
    config: &config::Appearance,
) -> SurfaceMesh {
    let mut parent: Vec<u32> = (0..mesh.positions.len() as u32).collect();
    for &[a, b, c] in &mesh.triangles {
        for other in [b, c] {
            let (x, y) = (root(&mut parent, a), root(&mut parent, other));
            parent[x.max(y) as usize] = x.min(y);
        }
    }
    let nothing = SurfacePiece { area: 0.0, low: Local::repeat(f32::INFINITY), high: Local::repeat(f32::NEG_INFINITY) };
    let mut pieces = vec![nothing; mesh.positions.len()];
    for triangle in &mesh.triangles {
        let piece = &mut pieces[root(&mut parent, triangle[0]) as usize];
        piece.area += 0.5 * f64::from(mesh.across(triangle).norm());
        for p in triangle.map(|v| mesh.positions[v as usize]) {
            piece.low = piece.low.inf(&p);
            piece.high = piece.high.sup(&p);
        }
    }
    let furniture = furniture(twin, config.shard_m);
    let stays: Vec<bool> = pieces
        .iter()
        .map(|piece| {
            let length = f64::from((piece.high - piece.low).max());
            if piece.area >= config.shard_m2 && length >= config.shard_m {
                return true;
            }
            let middle = origin + ((piece.low + piece.high) * 0.5).map(f64::from);
            length >= ON_FURNITURE * config.shard_m && furniture.iter().any(|around| holds(around, &middle))
        })
        .collect();
    let triangles = mesh.triangles.iter().filter(|t| stays[root(&mut parent, t[0]) as usize]).copied().collect();
    SurfaceMesh { triangles, positions: mesh.positions }.compacted()
}

/// Boxes (world) around each piece of furniture, and around what carries things in the room, wider by `around_m`.
fn furniture(twin: &Twin, around_m: f64) -> Vec<OrientedBox> {
    let bare = |s: &&Solid| !BARE.iter().any(|name| s.name.starts_with(name));
    let of_room = twin.room.iter().filter(bare).map(|s| s.shape);
    let pieces = twin.furniture.iter().map(|f| {
        let turn = f.part.bounds.rotation;
        let solids = f.carcass.iter().chain(&f.part.solids);
        let nothing = [Vector::repeat(f64::INFINITY), Vector::repeat(f64::NEG_INFINITY)];
        let [low, high] = solids.flat_map(|s| s.shape.corners()).fold(nothing, |[low, high], corner| {
            let local = turn.transpose() * corner.coords;
            [low.inf(&local), high.sup(&local)]
        });
        OrientedBox { center: Point::from(turn * ((low + high) * 0.5)), half: (high - low) * 0.5, rotation: turn }
    });
    let wider = |shape: OrientedBox| OrientedBox { half: shape.half.map(|h| h + around_m), ..shape };
    pieces.chain(of_room).map(wider).collect()
}

#[cfg(test)]
mod tests {
    use super::super::fuse::{COUNT, SIDE, VoxelBlock};
    use super::*;
    use crate::twin::Role;

    /// A square in the plane z = `z` with its lower corner at a place, in steps of 2 cm.
    fn sheet(mesh: &mut SurfaceMesh, corner: [f32; 2], z: f32, steps: u32) {
        let first = mesh.positions.len() as u32;
        let at = |i: u32| [0.02 * (i % (steps + 1)) as f32, 0.02 * (i / (steps + 1)) as f32];
        let places = (0..(steps + 1) * (steps + 1)).map(at);
        mesh.positions.extend(places.map(|[x, y]| Local::new(corner[0] + x, corner[1] + y, z)));
        for i in 0..steps * steps {
            let a = first + i / steps * (steps + 1) + i % steps;
            mesh.triangles.extend([[a, a + 1, a + steps + 2], [a, a + steps + 2, a + steps + 1]]);
        }
    }

    fn bare() -> Twin {
        Twin::of(Vec::new())
    }

    #[test]
    fn rims_are_the_sides_of_a_sheet() {
        let mut mesh = SurfaceMesh::default();
        sheet(&mut mesh, [0.0, 0.0], 0.0, 5);
        let inner = rims(&mesh).iter().filter(|rim| !**rim).count();
        assert_eq!(inner, 16);
    }

    #[test]
    fn a_rim_goes_where_hardly_any_frame_saw_it_and_not_further_than_it_may() {
        // Seen well where x is below half a metre, badly beyond it.
        let voxel = 0.02f32;
        let mut volume = Volume { voxel, blocks: Vec::new() };
        for (x, y) in (0..7).flat_map(|x| (0..7).map(move |y| (x, y))) {
            let seen = |i: usize| if voxel * (x as usize * SIDE + i % SIDE) as f32 >= 0.5 { 0.02 } else { 1.0 };
            volume.blocks.push(VoxelBlock { index: [x, y, 0], voxels: (0..COUNT).map(|i| [0.0, seen(i)]).collect() });
        }
        let mut mesh = SurfaceMesh::default();
        sheet(&mut mesh, [0.1, 0.1], 0.03, 40);
        let widest = |mesh: &SurfaceMesh| mesh.positions.iter().map(|p| p.x).fold(0.0, f32::max);
        let config = config::Appearance { rim_m: 0.1, ..Default::default() };
        let few = without_frays(mesh.clone(), &volume, &config);
        assert!((widest(&few) - 0.8).abs() < 0.011, "{}", widest(&few));
        let all = without_frays(mesh.clone(), &volume, &config::Appearance { rim_m: 5.0, ..Default::default() });
        assert!((widest(&all) - 0.5).abs() < 0.031, "{}", widest(&all));
        // Where it was seen well it stays.
        assert!(few.positions.iter().any(|p| p.x < 0.101 && p.y < 0.101));
    }

    #[test]
    fn a_front_is_cut_out_along_its_outline_and_boards_behind_it_stay() {
        let mut mesh = SurfaceMesh::default();
        sheet(&mut mesh, [0.0, 0.0], 0.0, 20);
        let square = mesh.triangles.len();
        // A board that ends behind the front: a strip across it.
        let first = mesh.positions.len() as u32;
        let board = [[0.2, 0.15, -0.01], [0.2, 0.17, -0.01], [0.2, 0.15, 0.005]].map(Local::from);
        mesh.positions.extend(board);
        mesh.triangles.push([first, first + 1, first + 2]);
        let half = Vector::new(0.105, 0.083, 0.02);
        let turn = nalgebra::Matrix3::identity();
        let front = OrientedBox { center: Point::new(0.2, 0.2, 1.0), half, rotation: turn };
        cut(&mut mesh, &front, &Point::new(0.0, 0.0, 1.0));
        assert!(mesh.triangles.len() < square);
        assert_eq!(mesh.triangles.last().map(|t| t.map(|v| mesh.positions[v as usize])), Some(board));
        let flat: f32 = mesh.triangles.iter().rev().skip(1).map(|t| 0.5 * mesh.across(t).norm()).sum();
        // Corners are cut off by half a triangle.
        let missing = 0.16 - flat;
        assert!((missing - 4.0 * 0.105 * 0.083).abs() < 4.0 * 0.0002, "{missing}");
        let inside = |p: &Local| (p.x - 0.2).abs() < 0.104 && (p.y - 0.2).abs() < 0.082;
        let flat = mesh.triangles.iter().rev().skip(1).flatten();
        assert!(flat.clone().count() > 0 && !flat.clone().any(|v| inside(&mesh.positions[*v as usize])));
    }

    #[test]
    fn shards_go_but_for_those_on_furniture() {
        let config = config::Appearance { shard_m2: 0.02, shard_m: 0.1, ..Default::default() };
        let mut mesh = SurfaceMesh::default();
        sheet(&mut mesh, [0.0, 0.0], 0.0, 20);
        let floor = mesh.triangles.len();
        // 6 cm wide, one over the floor, one on a worktop; and a crumb there.
        sheet(&mut mesh, [1.0, 0.0], 0.1, 3);
        sheet(&mut mesh, [2.0, 0.0], 0.91, 3);
        mesh.positions.extend([Local::new(2.0, 0.3, 0.91), Local::new(2.01, 0.3, 0.91), Local::new(2.0, 0.31, 0.91)]);
        let last = mesh.positions.len() as u32;
        mesh.triangles.push([last - 3, last - 2, last - 1]);
        let origin = Point::new(0.0, 0.0, 1.0);
        let mut twin = bare();
        assert_eq!(without_shards(mesh.clone(), &twin, &origin, &config).triangles.len(), floor);
        let block = |name: &str, center: [f64; 3], half: [f64; 3]| Solid {
            name: name.to_owned(),
            role: Role::Room,
            shape: OrientedBox {
                center: Point::from(center),
                half: Vector::from(half),
                rotation: nalgebra::Matrix3::identity(),
            },
            seen: true,
        };
        twin.room.push(block("room_floor", [0.0, 0.0, 0.95], [3.0, 3.0, 0.05]));
        twin.room.push(block("room_000", [2.0, 0.0, 1.85], [0.5, 0.5, 0.05]));
        assert_eq!(without_shards(mesh, &twin, &origin, &config).triangles.len(), floor + 18);
    }
}
