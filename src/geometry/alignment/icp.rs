//! Point-to-plane ICP with a turn about the vertical and a shift.

use std::collections::HashMap;

use nalgebra::{Matrix4, Vector4};

use super::map::Surfel;
use super::turned;
use crate::config;
use crate::localization::voxels;
use crate::math::{Point, Pose, Vector, centroid, sampling};

/// Numerics: steps at each gate.
const STEPS: usize = 8;
/// Numerics: a step below, metres and radians, is none.
const SETTLED: f64 = 1e-5;

/// Surfaces by their place.
pub(super) struct Index<'a> {
    surfels: &'a [Surfel],
    rules: &'a config::Icp,
    /// For each gate the surfels of each cell of its size.
    grids: Vec<HashMap<[i32; 3], Vec<u32>>>,
}

impl<'a> Index<'a> {
    pub(super) fn of(surfels: &'a [Surfel], rules: &'a config::Icp) -> Self {
        let grid = |edge_m: f64| {
            let mut cells: HashMap<[i32; 3], Vec<u32>> = HashMap::new();
            for (i, s) in surfels.iter().enumerate() {
                cells.entry(voxels::index(&s.at, edge_m)).or_default().push(i as u32);
            }
            cells
        };
        Self { surfels, rules, grids: rules.gates_m.iter().map(|gate| grid(*gate)).collect() }
    }

    /// The nearest surface within a gate that faces the same way.
    fn nearest(&self, gate: usize, surfel: &Surfel) -> Option<&Surfel> {
        let (grid, edge_m) = (self.grids.get(gate)?, *self.rules.gates_m.get(gate)?);
        let [x, y, z] = voxels::index(&surfel.at, edge_m);
        let mut best: Option<(f64, &Surfel)> = None;
        for dx in -1..=1 {
            for dy in -1..=1 {
                for dz in -1..=1 {
                    for &i in grid.get(&[x + dx, y + dy, z + dz]).into_iter().flatten() {
                        let Some(other) = self.surfels.get(i as usize) else { continue };
                        let distance = (other.at - surfel.at).norm();
                        let near = distance <= edge_m && best.is_none_or(|(least, _)| distance < least);
                        if near && other.normal.dot(&surfel.normal) > self.rules.same_way_cos {
                            best = Some((distance, other));
                        }
                    }
                }
            }
        }
        best.map(|(_, surfel)| surfel)
    }

    /// An alignment of other surfaces with these, from `start` on.
    pub(super) fn refined(&self, other: &[Surfel], start: Pose) -> Pose {
        let some: Vec<Surfel> = thin(other, self.rules.compared).copied().collect();
        let Some(about) = centroid(&some.iter().map(|s| s.at).collect::<Vec<Point>>()) else { return start };
        let mut pose = start;
        for gate in 0..self.rules.gates_m.len() {
            for _ in 0..STEPS {
                let Some([angle, shift]) = self.step(gate, &some, &pose, &about) else { break };
                pose = turned(&(pose * about).coords, angle.x, &shift) * pose;
                if angle.x.abs() < SETTLED && shift.norm() < SETTLED {
                    break;
                }
            }
        }
        pose
    }

    /// The turn about the vertical through `about` (x of the first vector) and the shift that bring surfaces nearer; `None` where
    /// next to nothing is near.
    fn step(&self, gate: usize, other: &[Surfel], pose: &Pose, about: &Point) -> Option<[Vector; 2]> {
        let scale = self.rules.gate_scale * self.rules.gates_m.get(gate)?;
        let about = pose * about;
        let (mut matrix, mut rhs, mut count) = (Matrix4::<f64>::zeros(), Vector4::<f64>::zeros(), 0);
        for surfel in other {
            let moved = surfel.moved(pose);
            let Some(target) = self.nearest(gate, &moved) else { continue };
            let off = target.normal.dot(&(moved.at - target.at));
            let turn = target.normal.dot(&Vector::z().cross(&(moved.at - about)));
            let row = Vector4::new(turn, target.normal.x, target.normal.y, target.normal.z);
            let weight = (1.0 + (off / scale).powi(2)).powi(-2);
            matrix += row * row.transpose() * weight;
            rhs -= row * (off * weight);
            count += 1;
        }
        if count < self.rules.least_pairs {
            return None;
        }
        // Numerics: along what no surface tells, nothing moves.
        matrix += Matrix4::identity() * (1e-3 * count as f64);
        let found = matrix.cholesky()?.solve(&rhs);
        found
            .iter()
            .all(|x| x.is_finite())
            .then(|| [Vector::new(found[0], 0.0, 0.0), Vector::new(found[1], found[2], found[3])])
    }

    /// How far other surfaces, moved by `pose`, are from those that they meet, across them, metres.
    pub(super) fn distances(&self, other: &[Surfel], pose: &Pose) -> Vec<f64> {
        let last = self.rules.gates_m.len() - 1;
        thin(other, self.rules.compared)
            .filter_map(|surfel| {
                let moved = surfel.moved(pose);
                let target = self.nearest(last, &moved)?;
                Some(target.normal.dot(&(moved.at - target.at)).abs())
            })
            .collect()
    }
}

/// Every n-th, so that enough are left.
fn thin(surfels: &[Surfel], most: usize) -> impl Iterator<Item = &Surfel> {
    surfels.iter().step_by(sampling::stride(surfels.len(), most))
}
