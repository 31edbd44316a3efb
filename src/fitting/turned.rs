//! Furniture that stands turned against the room: the same cells on a grid that is turned as it is, so that it becomes boxes
//! and not stairs.

use std::collections::{BTreeMap, BTreeSet};

use super::cells::{Extent, Index, Known};
use super::planes::{Grid, Plane};
use crate::config;
use crate::math::{Point, Vector, principal_directions, stats};
use crate::pipeline::FreeRun;

/// A heading other than the room's.
pub(super) struct Heading {
    /// The turned grid: the same edge, the same upright axis.
    pub(super) grid: Grid,
    /// Bounds along its axes of the upright surfaces that have it, metres.
    bounds: Extent,
}

/// Headings of upright surfaces that lie on none of the room's own planes, the one with most surface first.
pub(super) fn headings(
    occupied: &BTreeMap<Index, Extent>,
    planes: &[Plane],
    grid: &Grid,
    rules: &config::Turned,
) -> Vec<Heading> {
    let settled: BTreeSet<&Index> = planes.iter().flat_map(|p| &p.cells).collect();
    let mut turned: Vec<(f64, Point)> = occupied
        .iter()
        .filter(|(index, _)| !settled.contains(index))
        .filter_map(|(index, extent)| Some((heading(index, occupied, rules)?, middle(extent))))
        .filter(|(degrees, _)| degrees.abs() >= rules.least_deg)
        .collect();
    let mut found = Vec::new();
    while found.len() < rules.headings {
        let near = |at: f64| turned.iter().filter(move |(degrees, _)| between(at, *degrees).abs() <= rules.spread_deg);
        // Of as many the first: whole degrees, so that the order is one.
        let Some(peak) = (-45..45).map(f64::from).max_by_key(|&at| (near(at).count(), std::cmp::Reverse(at as i32)))
        else {
            break;
        };
        let own: Vec<(f64, Point)> = near(peak).copied().collect();
        if (own.len() as f64) * grid.edge.powi(2) < rules.least_m2 {
            break;
        }
        let offsets: Vec<f64> = own.iter().map(|(degrees, _)| between(peak, *degrees)).collect();
        let angle = (peak + stats::mean(&offsets).unwrap_or(0.0)).to_radians();
        let [first, second, up] = grid.axes;
        let axes = [first * angle.cos() + second * angle.sin(), second * angle.cos() - first * angle.sin(), up];
        let turned_grid = Grid { axes, edge: grid.edge };
        if let Some(bounds) = bounds(own.iter().map(|(_, p)| turned_grid.coordinates(&world(p, grid))), rules.rim_share)
        {
            found.push(Heading { grid: turned_grid, bounds });
        }
        turned.retain(|(degrees, _)| between(peak, *degrees).abs() > 2.0 * rules.spread_deg);
    }
    found
}

/// How far a heading is from another, degrees: right angles lie between the sides of one thing.
fn between(from: f64, to: f64) -> f64 {
    (to - from + 45.0).rem_euclid(90.0) - 45.0
}

/// Heading of the surface around a cell against the grid, degrees from -45 to 45; `None` where there is no upright surface.
fn heading(index: &Index, occupied: &BTreeMap<Index, Extent>, rules: &config::Turned) -> Option<f64> {
    /// Geometry: cells to each side.
    const REACH: i32 = 2;
    let around = |k: usize| index[k] - REACH..=index[k] + REACH;
    let columns = around(0).flat_map(|x| around(1).map(move |y| (x, y)));
    let rows = columns.flat_map(|(x, y)| occupied.range([x, y, index[2] - REACH]..=[x, y, index[2] + REACH]));
    let points: Vec<Point> = rows.map(|(_, extent)| middle(extent)).collect();
    if points.len() < rules.least_cells {
        return None;
    }
    let (axes, variances) = principal_directions(&points)?;
    let normal = axes.column(2);
    (variances[2] < rules.flat * variances[1] && normal[2].abs() < rules.lean_sin)
        .then(|| between(0.0, normal[1].atan2(normal[0]).to_degrees()))
}

/// The middle of a surface in a cell, along the grid's axes.
fn middle(extent: &Extent) -> Point {
    Point::from(extent.map(|[low, high]| 0.5 * (low + high)))
}

/// A point along the grid's axes in the world.
fn world(p: &Point, grid: &Grid) -> Point {
    let [a, b, c] = grid.axes;
    Point::from(a * p.x + b * p.y + c * p.z)
}

/// Bounds of points, a few left out on each side; `None` for no points.
fn bounds(points: impl Iterator<Item = [f64; 3]>, rim_share: f64) -> Option<Extent> {
    let points: Vec<[f64; 3]> = points.collect();
    let mut out = [[0.0; 2]; 3];
    for (k, side) in out.iter_mut().enumerate() {
        let along: Vec<f64> = points.iter().map(|p| p[k]).collect();
        *side = [stats::quantile(&along, rim_share)?, stats::quantile(&along, 1.0 - rim_share)?];
    }
    Some(out)
}

impl Heading {
    /// What is known around the turned surfaces on the turned grid: surfaces that are not on the room's own upright planes, and
    /// what was seen through. What is taken is told by blocks alone.
    pub(super) fn known(
        &self,
        known: &Known,
        planes: &[Plane],
        grid: &Grid,
    ) -> (BTreeMap<Index, Extent>, Vec<FreeRun>) {
        let Self { grid: turned, bounds } = self;
        let rooms: BTreeSet<&Index> = planes.iter().filter(|p| p.axis < 2).flat_map(|p| &p.cells).collect();
        // Cells near a corner have no heading.
        let margin = 4.0 * turned.edge;
        let mut occupied = BTreeMap::new();
        for (index, extent) in known.occupied.iter().filter(|(index, _)| !rooms.contains(index)) {
            let p = turned.coordinates(&world(&middle(extent), grid));
            if !(0..3).all(|k| (bounds[k][0] - margin..=bounds[k][1] + margin).contains(&p[k])) {
                continue;
            }
            let quarter = 0.25 * turned.edge;
            let placed: Extent = [[p[0] - quarter, p[0] + quarter], [p[1] - quarter, p[1] + quarter], extent[2]];
            let own = p.map(|c| (c / turned.edge).floor() as i32);
            occupied.entry([own[0], own[1], index[2]]).or_insert(placed);
            // Cells of the turned grid have their middle in the cell as well, or it would have holes.
            for i in 0..9 {
                let other = [own[0] + i % 3 - 1, own[1] + i / 3 - 1, index[2]];
                if column(&other, turned, grid) == [index[0], index[1]] {
                    occupied.entry(other).or_insert(placed);
                }
            }
        }
        let side = |k: usize| {
            let [low, high] = bounds[k].map(|c| (c / turned.edge).floor() as i32);
            low - 6..high + 7
        };
        let mut free = Vec::new();
        for (x, y) in side(0).flat_map(|x| side(1).map(move |y| (x, y))) {
            let from = column(&[x, y, 0], turned, grid);
            let first = known.free.partition_point(|run| run.column < from);
            let runs = known.free.iter().skip(first).take_while(|run| run.column == from);
            free.extend(runs.map(|run| FreeRun { column: [x, y], span: run.span }));
        }
        (occupied, free)
    }
}

/// The column of the room's grid that holds the middle of a turned cell.
fn column(index: &Index, turned: &Grid, grid: &Grid) -> [i32; 2] {
    let p: Vector = turned.axes[0] * turned.middle(index[0]) + turned.axes[1] * turned.middle(index[1]);
    [0, 1].map(|k| (grid.axes[k].dot(&p) / grid.edge).floor() as i32)
}

#[cfg(test)]
mod tests {
    use super::super::cells::within;
    use super::super::cover;
    use super::super::planes::flattened;
    use super::*;
    use std::collections::HashSet;

    const EDGE: f64 = 0.05;

    /// Cells of points on a chest of 1.2 x 0.5 x 0.8 m, turned by `degrees`, and the air around it.
    fn chest(degrees: f64) -> (BTreeMap<Index, Extent>, Vec<FreeRun>) {
        let turn = crate::math::rotation(&Vector::z(), degrees.to_radians());
        let mut cells: BTreeMap<Index, Extent> = BTreeMap::new();
        for i in 0..120 {
            for j in 0..80 {
                let (a, b) = (0.01 * f64::from(i) + 0.005, 0.01 * f64::from(j) + 0.005);
                // Depth on the sides and on the top.
                let (side, top) = (0.01 * f64::from(i % 50), 0.01 * f64::from(j % 50));
                for p in [[a, 0.0, b], [0.0, side, b], [1.2, side, b], [a, top, 0.8]] {
                    // A front is wider than a side is deep.
                    let p = turn * Vector::from(p) + Vector::new(2.0, 1.0, 0.0);
                    let at = [p.x, p.y, p.z];
                    let around = |e: &mut Extent| {
                        *e = std::array::from_fn(|k| [e[k][0].min(at[k]), e[k][1].max(at[k])]);
                    };
                    let index = at.map(|c| (c / EDGE).floor() as i32);
                    cells.entry(index).and_modify(around).or_insert(at.map(|c| [c, c]));
                }
            }
        }
        let mut free = Vec::new();
        for x in 0..80 {
            for y in 0..60 {
                let p = Vector::new((f64::from(x) + 0.5) * EDGE - 2.0, (f64::from(y) + 0.5) * EDGE - 1.0, 0.0);
                let local = turn.inverse() * p;
                let beside = local.x < -0.05 || local.x > 1.25 || local.y < -0.05;
                free.push(FreeRun { column: [x, y], span: [if beside { 0 } else { 18 }, 30] });
            }
        }
        (cells, free)
    }

    #[test]
    fn a_turned_chest_is_one_box_in_its_own_axes() {
        let (mut occupied, free) = chest(25.0);
        let grid = Grid { axes: [Vector::x(), Vector::y(), Vector::z()], edge: EDGE };
        let planes = flattened(&mut occupied, EDGE, &config::RoomBoxes::default());
        let found = headings(&occupied, &planes, &grid, &config::Turned::default());
        assert_eq!(found.len(), 1);
        let angle = found[0].grid.axes[0].y.atan2(found[0].grid.axes[0].x).to_degrees();
        assert!((angle - 25.0).abs() < 1.0, "{angle}");
        let known = Known { occupied, free: &free, taken: HashSet::new() };
        let (mut turned, runs) = found[0].known(&known, &planes, &grid);
        flattened(&mut turned, EDGE, &config::RoomBoxes::default());
        let turned = Known { occupied: turned, free: &runs, taken: HashSet::new() };
        let blocks = cover::blocks(&turned, &cover::Limits { surface: 40, solid: 20 }, &config::Cover::default());
        let shape = found[0].grid.shape(&cover::extent(&blocks[0].1, &turned, EDGE, 0.25));
        let middle = crate::math::rotation(&Vector::z(), 25f64.to_radians()) * Vector::new(0.6, 0.25, 0.4);
        assert!((shape.center.coords - middle - Vector::new(2.0, 1.0, 0.0)).norm() < 0.06, "{shape:?}");
        assert!((shape.half - Vector::new(0.6, 0.25, 0.4)).amax() < 0.05, "{shape:?}");
        let held: usize = blocks.iter().map(|(_, block)| within(*block).count()).sum();
        assert!(blocks.len() < 4 && held < 8000, "{blocks:?}");
    }

    #[test]
    fn what_stands_as_the_room_does_has_no_heading_of_its_own() {
        let (mut occupied, _) = chest(0.0);
        let grid = Grid { axes: [Vector::x(), Vector::y(), Vector::z()], edge: EDGE };
        let planes = flattened(&mut occupied, EDGE, &config::RoomBoxes::default());
        assert!(headings(&occupied, &planes, &grid, &config::Turned::default()).is_empty());
    }
}
