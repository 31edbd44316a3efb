//! The grid of a room's cells, and the large flat surfaces in it: noise and the grid spread a surface over several layers of
//! cells, here it becomes one.

use std::collections::{BTreeMap, HashSet};

use nalgebra::Matrix3;

use super::cells::{Extent, Index};
use crate::config;
use crate::math::{Point, Vector, stats};
use crate::twin::OrientedBox;

/// Axes and edge of the cells.
#[derive(Debug, Clone, Copy)]
pub(super) struct Grid {
    /// World, orthonormal.
    pub(super) axes: [Vector; 3],
    /// Edge of a cell, metres.
    pub(super) edge: f64,
}

impl Grid {
    /// Of a point along the axes, metres.
    pub(super) fn coordinates(&self, p: &Point) -> [f64; 3] {
        self.axes.map(|a| a.dot(&p.coords))
    }

    /// Middle of a cell's layer along an axis.
    pub(super) fn middle(&self, layer: i32) -> f64 {
        (f64::from(layer) + 0.5) * self.edge
    }

    /// A box of the grid in the world.
    pub(super) fn shape(&self, extent: &Extent) -> OrientedBox {
        let middle = extent.map(|[low, high]| 0.5 * (low + high));
        let center = self.axes.iter().zip(middle).fold(Vector::zeros(), |sum, (axis, c)| sum + axis * c);
        OrientedBox {
            center: Point::from(center),
            half: Vector::from(extent.map(|[low, high]| 0.5 * (high - low))),
            rotation: Matrix3::from_columns(&self.axes),
        }
    }

    /// Bounds of points along the grid's axes; empty (low above high) for no points.
    pub(super) fn bounds(&self, points: impl IntoIterator<Item = Point>) -> Extent {
        let mut bounds = [[f64::INFINITY, f64::NEG_INFINITY]; 3];
        for p in points {
            for (b, c) in bounds.iter_mut().zip(self.coordinates(&p)) {
                *b = [b[0].min(c), b[1].max(c)];
            }
        }
        bounds
    }
}

/// A flat surface across one of the grid's axes.
#[derive(Debug, Clone)]
pub(super) struct Plane {
    pub(super) axis: usize,
    /// Along the axis, metres.
    pub(super) offset: f64,
    /// Its cells, all in one layer, by index.
    pub(super) cells: Vec<Index>,
}

/// Finds the large flat surfaces across the grid's axes and sets their cells into one thin layer each: noise and the grid
/// spread a surface over two or three. Level ones first.
pub(super) fn flattened(occupied: &mut BTreeMap<Index, Extent>, edge: f64, rules: &config::RoomBoxes) -> Vec<Plane> {
    let mut planes: Vec<Plane> = Vec::new();
    let mut settled: HashSet<Index> = HashSet::new();
    for axis in [2, 0, 1] {
        let there: HashSet<Index> = occupied.keys().copied().collect();
        let mut flat: Vec<(f64, Index)> = occupied
            .iter()
            .filter(|(index, _)| !settled.contains(*index) && lies_across(&there, index, axis))
            .map(|(index, extent)| (0.5 * (extent[axis][0] + extent[axis][1]), *index))
            .collect();
        flat.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        for _ in 0..rules.planes {
            let heights: Vec<f64> = flat.iter().map(|(h, _)| *h).collect();
            let Some(window) =
                stats::densest(&heights, edge).filter(|w| w.len() as f64 * edge * edge >= rules.plane_m2)
            else {
                break;
            };
            let Some(offset) = stats::median(&heights[window]) else { break };
            let layer = (offset / edge).floor() as i32;
            let onto = |index: &Index| {
                let mut index = *index;
                index[axis] = layer;
                index
            };
            // A rim goes on to one side only.
            let mut members: Vec<Index> = flat
                .iter()
                .filter(|(h, _)| (h - offset).abs() <= edge)
                .flat_map(|(_, index)| beside(onto(index), axis))
                .collect();
            members.sort_unstable();
            members.dedup();
            flat.retain(|(h, _)| (h - offset).abs() > edge);
            // The members, and what lies on them as thinly as noise does.
            let on: Vec<Index> = occupied
                .iter()
                .filter(|(index, extent)| {
                    (0.5 * (extent[axis][0] + extent[axis][1]) - offset).abs() <= edge
                        && !settled.contains(*index)
                        && members.binary_search(&onto(index)).is_ok()
                })
                .map(|(index, _)| *index)
                .collect();
            let sheet = sheet(occupied, &on, axis, onto, rules.sheet_half_m);
            let cells: Vec<Index> = sheet.keys().copied().collect();
            settled.extend(cells.iter().copied());
            occupied.extend(sheet);
            planes.push(Plane { axis, offset, cells });
        }
    }
    planes
}

/// Takes cells out and puts them together where `onto` says. Each keeps the mean place of its surface across the axis: fronts
/// of one plane may be a few centimetres apart.
fn sheet(
    occupied: &mut BTreeMap<Index, Extent>,
    cells: &[Index],
    axis: usize,
    onto: impl Fn(&Index) -> Index,
    half_m: f64,
) -> BTreeMap<Index, Extent> {
    let mut sums: BTreeMap<Index, (Extent, f64, f64)> = BTreeMap::new();
    for index in cells {
        let Some(extent) = occupied.remove(index) else { continue };
        let middle = 0.5 * (extent[axis][0] + extent[axis][1]);
        let (all, sum, count) = sums.entry(onto(index)).or_insert((extent, 0.0, 0.0));
        *all = around(all, &extent);
        *sum += middle;
        *count += 1.0;
    }
    let placed = |(index, (mut extent, sum, count)): (Index, (Extent, f64, f64))| {
        extent[axis] = [sum / count - half_m, sum / count + half_m];
        (index, extent)
    };
    sums.into_iter().map(placed).collect()
}

/// A cell and its neighbours within its layer across an axis.
fn beside(index: Index, axis: usize) -> impl Iterator<Item = Index> {
    let [a, b] = match axis {
        0 => [1, 2],
        1 => [0, 2],
        _ => [0, 1],
    };
    (0..9).map(move |i| {
        let mut other = index;
        other[a] += i % 3 - 1;
        other[b] += i / 3 - 1;
        other
    })
}

/// The extent around both.
pub(super) fn around(a: &Extent, b: &Extent) -> Extent {
    std::array::from_fn(|k| [a[k][0].min(b[k][0]), a[k][1].max(b[k][1])])
}

/// Whether a surface runs through a cell across an axis: it goes on to all four sides, give or take a layer, and is not
/// itself the middle of something that goes on along the axis.
fn lies_across(there: &HashSet<Index>, index: &Index, axis: usize) -> bool {
    let at = |along: usize, by: i32, shift: i32| {
        let mut other = *index;
        other[along] += by;
        other[axis] += shift;
        there.contains(&other)
    };
    let goes_on = |along: usize| [-1, 1].iter().all(|&by| [0, -1, 1].iter().any(|&shift| at(along, by, shift)));
    let deep = at(axis, 0, 2) && at(axis, 0, -2);
    !deep && (0..3).filter(|k| *k != axis).all(goes_on)
}
