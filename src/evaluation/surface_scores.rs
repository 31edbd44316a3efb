//! The shape of the room that does not move, against a kitchen that is known: precision, recall and F-score of surface points.
//!
//! Only what the recording's cameras see is asked for, as nobody can build what nobody saw: points of either side are those
//! that some camera sees of it, parts closed.

use std::path::Path;

use nalgebra::Vector3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::likeness::{STATIC, box_mesh};
use crate::config;
use crate::error::Result;
use crate::json;
use crate::math::{Point, Vector};
use crate::raster::{self, Mesh, Surface};
use crate::recording::{Camera, Recording};
use crate::twin::{OrientedBox, Twin};

/// Owner of what moves.
const MOVING: u16 = 1;
/// Triangles are found by cells of this edge, metres.
const CELL_M: f64 = 0.2;

/// A kitchen as it really is, everything closed.
#[derive(Debug, Clone, PartialEq)]
pub struct TrueRoom {
    /// What does not move in the recording: also parts that nobody opened.
    pub fixed: Vec<OrientedBox>,
    /// Parts that somebody opened.
    pub moving: Vec<OrientedBox>,
}

#[derive(Deserialize)]
struct OpenedJointsFile {
    clips: Vec<OpenedJoint>,
}

#[derive(Deserialize)]
struct OpenedJoint {
    joint: String,
}

impl TrueRoom {
    /// Reads the folder that `paws synth --kitchen` wrote: `twin.json`, and `ground_truth.json` for what was opened.
    ///
    /// # Errors
    /// Where a file is missing or is not what it should be.
    pub fn read(kitchen: &Path) -> Result<Self> {
        let twin: Twin = json::read(&kitchen.join("twin.json"))?;
        let truth: OpenedJointsFile = json::read(&kitchen.join("ground_truth.json"))?;
        let mut room = Self { fixed: twin.room.iter().map(|s| s.shape).collect(), moving: Vec::new() };
        for piece in &twin.furniture {
            let moved = truth.clips.iter().any(|clip| clip.joint == piece.part.id);
            let own = piece.part.solids.iter().map(|s| s.shape);
            if moved { room.moving.extend(own) } else { room.fixed.extend(own) }
        }
        Ok(room)
    }
}

/// How much of a surface is right, and how much of the true one is there.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ShapeScore {
    /// A point is right within this distance, metres.
    pub within_m: f64,
    /// Points of the surface, and of the true one.
    pub points: [usize; 2],
    /// Share of the surface's points that lie on the true surface.
    pub precision: f64,
    /// Share of the true surface's points that lie on the surface.
    pub recall: f64,
    /// Harmonic mean of both; 0 where either is 0.
    pub f_score: f64,
}

/// Measures what does not move of some surfaces (owner [`STATIC`]; all others hide what is behind them) as the cameras of some
/// frames see it.
#[must_use]
pub fn measure(
    surfaces: &[Surface],
    truth: &TrueRoom,
    recording: &Recording,
    frames: &[usize],
    config: &config::Comparison,
    depth_max_m: f64,
) -> ShapeScore {
    let views = Views { recording, frames, cell_m: config.shape_cell_m, width: config.shape_width, far_m: depth_max_m };
    let meshes = |shapes: &[OrientedBox]| -> Vec<Mesh> { shapes.iter().map(box_mesh).collect() };
    let [fixed, moving] = [meshes(&truth.fixed), meshes(&truth.moving)];
    let true_surfaces: Vec<Surface> = fixed
        .iter()
        .map(|mesh| mesh.surface(STATIC, false))
        .chain(moving.iter().map(|mesh| mesh.surface(MOVING, false)))
        .collect();
    let (found, wanted) = (views.points(surfaces), views.points(&true_surfaces));
    let within_m = config.shape_m;
    let right = found.par_iter().filter(|p| truth.fixed.iter().any(|b| off_surface(p, b) <= within_m)).count();
    let triangles = Triangles::of(surfaces, &wanted, within_m);
    let there = wanted.par_iter().filter(|p| triangles.is_near(p)).count();
    let share = |part: usize, all: usize| part as f64 / all.max(1) as f64;
    let (precision, recall) = (share(right, found.len()), share(there, wanted.len()));
    let both = precision + recall;
    let f_score = if both > 0.0 { 2.0 * precision * recall / both } else { 0.0 };
    ShapeScore { within_m, points: [found.len(), wanted.len()], precision, recall, f_score }
}

/// Distance of a point from a box's surface, inside as outside.
fn off_surface(p: &Point, shape: &OrientedBox) -> f64 {
    let beyond = (shape.rotation.transpose() * (p - shape.center)).abs() - shape.half;
    let outside = beyond.map(|c| c.max(0.0)).norm();
    if outside > 0.0 { outside } else { -beyond.max() }
}

/// Where points are taken from.
struct Views<'a> {
    recording: &'a Recording,
    frames: &'a [usize],
    cell_m: f64,
    width: usize,
    far_m: f64,
}

impl Views<'_> {
    /// Points that the cameras see of what does not move, one a cell: of several the first frame's.
    fn points(&self, surfaces: &[Surface]) -> Vec<Point> {
        let of_frame = |frame: &usize| -> Vec<Point> {
            let camera = smaller(self.recording.camera_of(*frame), self.width);
            let Some(from) = self.recording.frames.get(*frame) else { return Vec::new() };
            let view = raster::render(surfaces, &from.world_from_camera, &camera);
            let seen = |i: usize| {
                let z = f64::from(view.depth.data[i]);
                (view.owner.data[i] == STATIC && z > 0.0 && z <= self.far_m).then(|| {
                    let (x, y) = (i % camera.width, i / camera.width);
                    from.world_from_camera * camera.unproject(x as f64, y as f64, z)
                })
            };
            (0..view.depth.data.len()).filter_map(seen).collect()
        };
        let all: Vec<Point> = self.frames.par_iter().flat_map_iter(of_frame).collect();
        let mut cells: Vec<(Vector3<i64>, usize)> =
            all.iter().enumerate().map(|(i, p)| ((p.coords / self.cell_m).map(|c| c.floor() as i64), i)).collect();
        cells.sort_unstable_by_key(|(cell, i)| ([cell.x, cell.y, cell.z], *i));
        cells.dedup_by_key(|(cell, _)| *cell);
        cells.iter().filter_map(|(_, i)| all.get(*i).copied()).collect()
    }
}

/// The same camera with fewer pixels.
fn smaller(camera: &Camera, width: usize) -> Camera {
    let step = (camera.width as f64 / width as f64).max(1.0);
    Camera {
        width: ((camera.width as f64 / step) as usize).max(1),
        height: ((camera.height as f64 / step) as usize).max(1),
        fx: camera.fx / step,
        fy: camera.fy / step,
        cx: (camera.cx + 0.5) / step - 0.5,
        cy: (camera.cy + 0.5) / step - 0.5,
    }
}

/// Triangles of what does not move, by the cells that they come near, as far as points may be asked for.
struct Triangles {
    within_m: f64,
    all: Vec<[Point; 3]>,
    /// Cell and number of a triangle, sorted.
    cells: Vec<([i32; 3], u32)>,
}

fn cell_of(c: f64) -> i32 {
    (c / CELL_M).floor() as i32
}

impl Triangles {
    fn of(surfaces: &[Surface], asked: &[Point], within_m: f64) -> Self {
        let bounds = bounds(asked);
        let mut all: Vec<[Point; 3]> = Vec::new();
        for surface in surfaces.iter().filter(|s| s.owner == STATIC) {
            let corner = |v: u32| surface.positions.get(v as usize).map(|p| surface.world_from_surface * p);
            all.extend(surface.triangles.iter().filter_map(|t| {
                let [a, b, c] = t.map(corner);
                let triangle = [a?, b?, c?];
                triangle.iter().all(|p| p.coords.iter().all(|c| c.abs() < crate::twin::FAR_M)).then_some(triangle)
            }));
        }
        let near: Vec<Vec<([i32; 3], u32)>> = all
            .par_iter()
            .enumerate()
            .map(|(i, t)| near_cells(t, &bounds, within_m).map(|c| (c, i as u32)).collect())
            .collect();
        let mut cells: Vec<([i32; 3], u32)> = near.into_iter().flatten().collect();
        cells.sort_unstable();
        Self { within_m, all, cells }
    }

    /// Whether a triangle is within the distance.
    fn is_near(&self, p: &Point) -> bool {
        let cell = [p.x, p.y, p.z].map(cell_of);
        let first = self.cells.partition_point(|(c, _)| *c < cell);
        let here = self.cells.iter().skip(first).take_while(|(c, _)| *c == cell);
        here.filter_map(|(_, i)| self.all.get(*i as usize)).any(|t| (nearest(t, p) - p).norm() <= self.within_m)
    }
}

/// Lowest and highest coordinates of points.
fn bounds(points: &[Point]) -> [Vector; 2] {
    let none = [Vector::repeat(f64::INFINITY), Vector::repeat(f64::NEG_INFINITY)];
    points.iter().fold(none, |[low, high], p| [low.inf(&p.coords), high.sup(&p.coords)])
}

/// Cells within some bounds that may hold points within a distance of a triangle.
fn near_cells(t: &[Point; 3], within: &[Vector; 2], within_m: f64) -> impl Iterator<Item = [i32; 3]> {
    let own = bounds(t);
    let range = |k: usize| {
        cell_of((own[0][k] - within_m).max(within[0][k]))..=cell_of((own[1][k] + within_m).min(within[1][k]))
    };
    let (xs, ys, zs) = (range(0), range(1), range(2));
    let [a, b, c] = *t;
    let normal = crate::math::unit(&(b - a).cross(&(c - a)));
    // Half of a cell's diagonal.
    let reach = within_m + 0.5 * CELL_M * 3f64.sqrt();
    let cells = xs.flat_map(move |x| {
        let zs = zs.clone();
        ys.clone().flat_map(move |y| zs.clone().map(move |z| [x, y, z]))
    });
    cells.filter(move |cell| {
        let middle = Point::from(cell.map(|c| (f64::from(c) + 0.5) * CELL_M));
        normal.is_none_or(|n| n.dot(&(middle - a)).abs() <= reach)
    })
}

/// The point of a triangle that is nearest to `p` (Ericson, Real-Time Collision Detection, 5.1.5).
fn nearest([a, b, c]: &[Point; 3], p: &Point) -> Point {
    let (ab, ac): (Vector, Vector) = (b - a, c - a);
    let of = |from: &Point| (ab.dot(&(p - from)), ac.dot(&(p - from)));
    let ((d1, d2), (d3, d4), (d5, d6)) = (of(a), of(b), of(c));
    if d1 <= 0.0 && d2 <= 0.0 {
        return *a;
    }
    if d3 >= 0.0 && d4 <= d3 {
        return *b;
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        return a + ab * (d1 / (d1 - d3));
    }
    if d6 >= 0.0 && d5 <= d6 {
        return *c;
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        return a + ac * (d2 / (d2 - d6));
    }
    let va = d3 * d6 - d5 * d4;
    if va <= 0.0 && d4 - d3 >= 0.0 && d5 - d6 >= 0.0 {
        return b + (c - b) * ((d4 - d3) / ((d4 - d3) + (d5 - d6)));
    }
    let sum = va + vb + vc;
    a + ab * (vb / sum) + ac * (vc / sum)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Pose;
    use crate::recording::Frame;

    #[test]
    fn the_nearest_point_lies_inside_on_an_edge_or_at_a_corner() {
        let t = [Point::origin(), Point::new(1.0, 0.0, 0.0), Point::new(0.0, 1.0, 0.0)];
        for (p, expected) in [
            ([0.2, 0.3, 0.5], [0.2, 0.3, 0.0]),
            ([0.5, -1.0, 0.0], [0.5, 0.0, 0.0]),
            ([-1.0, 0.4, 0.2], [0.0, 0.4, 0.0]),
            ([1.0, 1.0, 0.0], [0.5, 0.5, 0.0]),
            ([-1.0, -1.0, 3.0], [0.0, 0.0, 0.0]),
            ([3.0, -1.0, 0.0], [1.0, 0.0, 0.0]),
            ([-1.0, 3.0, 0.0], [0.0, 1.0, 0.0]),
        ] {
            let found = nearest(&t, &Point::from(p));
            assert!((found - Point::from(expected)).norm() < 1e-12, "{p:?} {found}");
        }
    }

    fn wall(z: f64, half_width: f64) -> OrientedBox {
        OrientedBox {
            center: Point::new(0.0, 0.0, z + 0.1),
            half: Vector::new(half_width, 2.0, 0.1),
            rotation: nalgebra::Matrix3::identity(),
        }
    }

    fn looking_ahead() -> Recording {
        Recording {
            name: "r".to_owned(),
            frames: vec![Frame { timestamp_secs: 0.0, world_from_camera: Pose::identity(), files: Default::default() }],
            ..Recording::empty(Camera { width: 60, height: 40, fx: 40.0, fy: 40.0, cx: 29.5, cy: 19.5 })
        }
    }

    fn score(own: &[OrientedBox], truth: &TrueRoom) -> ShapeScore {
        let meshes: Vec<Mesh> = own.iter().map(box_mesh).collect();
        let surfaces: Vec<Surface> = meshes.iter().map(|m| m.surface(STATIC, false)).collect();
        measure(&surfaces, truth, &looking_ahead(), &[0], &config::Comparison::default(), 5.0)
    }

    #[test]
    fn what_is_off_is_wrong_and_what_is_missing_is_missed() {
        let truth = TrueRoom { fixed: vec![wall(2.0, 9.0)], moving: Vec::new() };
        let same = score(&[wall(2.0, 9.0)], &truth);
        assert_eq!((same.precision, same.recall, same.f_score), (1.0, 1.0, 1.0));
        assert_eq!(score(&[wall(2.015, 9.0)], &truth).f_score, 1.0);
        assert_eq!(score(&[wall(2.03, 9.0)], &truth).f_score, 0.0);
        // Half of what is seen: all of it is right, half of it is missing.
        let half = OrientedBox { center: Point::new(-9.0, 0.0, 2.1), ..wall(2.0, 9.0) };
        let score = score(&[half], &truth);
        assert_eq!(score.precision, 1.0);
        assert!((score.recall - 0.5).abs() < 0.03, "{score:?}");
        assert!((score.f_score - 2.0 / 3.0).abs() < 0.03, "{score:?}");
    }

    #[test]
    fn what_moves_is_not_asked_for_and_hides_what_is_behind_it() {
        // A door that covers all that is seen of the wall.
        let truth = TrueRoom { fixed: vec![wall(2.0, 9.0)], moving: vec![wall(1.5, 9.0)] };
        assert_eq!(score(&[wall(2.0, 9.0)], &truth).points[1], 0);
    }
}
