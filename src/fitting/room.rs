//! The rest of the room as boxes that do not move: floor, walls, worktops, furniture that nobody opened (ours).
//!
//! Cells that several views saw ([`crate::pipeline::RoomCells`]) are set onto the room's flat surfaces, emptied where
//! furniture stands or a part moves, and joined into boxes. The floor and the walls become one box each.

use std::collections::{BTreeMap, HashSet};

use nalgebra::Matrix3;

use super::cells::{Extent, Index, drop_specks, joined};
use super::{limits, overlap};
use crate::articulation::JointKind;
use crate::config;
use crate::math::{Point, Vector, stats};
use crate::pipeline::RoomCells;
use crate::twin::{Furniture, OrientedBox, Part, Role, Solid};

/// Free space kept around a part on its way, metres.
const MARGIN_M: f64 = 0.02;
/// From one pose of a part to the next no corner of it goes further, metres: half of it stays within the margin.
const TRAVEL_M: f64 = 0.02;
/// Half the thickness of a flat surface that is not a floor or a wall, metres.
const SHEET_M: f64 = 0.01;
/// Thickness of floor and walls, metres.
const WALL_M: f64 = 0.05;

/// Axes and edge of the cells.
#[derive(Debug, Clone, Copy)]
struct Grid {
    axes: [Vector; 3],
    edge: f64,
}

impl Grid {
    fn coordinates(&self, p: &Point) -> [f64; 3] {
        self.axes.map(|a| a.dot(&p.coords))
    }

    /// Middle of a cell's layer along an axis.
    fn middle(&self, layer: i32) -> f64 {
        (f64::from(layer) + 0.5) * self.edge
    }

    fn shape(&self, extent: &Extent) -> OrientedBox {
        let middle = extent.map(|[low, high]| 0.5 * (low + high));
        let center = self.axes.iter().zip(middle).fold(Vector::zeros(), |sum, (axis, c)| sum + axis * c);
        OrientedBox {
            center: Point::from(center),
            half: Vector::from(extent.map(|[low, high]| 0.5 * (high - low))),
            rotation: Matrix3::from_columns(&self.axes),
        }
    }

    /// Bounds of points along the grid's axes; empty (low above high) for no points.
    fn bounds(&self, points: impl IntoIterator<Item = Point>) -> Extent {
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
struct Plane {
    axis: usize,
    /// Along the axis, metres.
    offset: f64,
    /// Its cells, all in one layer, by index.
    cells: Vec<Index>,
}

/// Boxes of the room around placed furniture; floor and walls first, the rest by falling size. Nothing of it is within a
/// centimetre of a part anywhere in its range so far (0..=`upper`). Empty where there is no furniture.
pub(super) fn boxes(cells: &RoomCells, furniture: &[Furniture], config: &config::Fitting) -> Vec<Solid> {
    let grid = Grid { axes: cells.axes, edge: cells.edge_m };
    if furniture.is_empty() {
        return Vec::new();
    }
    let bodies: Vec<OrientedBox> = furniture.iter().map(hull).collect();
    let standing = grid.bounds(bodies.iter().flat_map(OrientedBox::corners));
    let reach = config.room_reach_m;
    let near = |index: &Index| {
        (0..3).all(|k| (standing[k][0] - reach..=standing[k][1] + reach).contains(&grid.middle(index[k])))
    };
    let mut occupied: BTreeMap<Index, Extent> =
        cells.cells.iter().filter(|c| near(&c.index)).map(|c| (c.index, c.extent)).collect();
    let planes = flattened(&mut occupied, grid.edge);
    let all: Vec<Index> = occupied.keys().copied().collect();

    let swept: Vec<OrientedBox> = furniture.iter().flat_map(|f| sweep(&f.part)).collect();
    for shape in bodies.iter().chain(&swept) {
        empty(&mut occupied, shape, &grid);
    }
    let mut solids = Vec::new();
    let mut add = |name: String, extent: &Extent| {
        solids.push(Solid { name, role: Role::Room, shape: grid.shape(extent), seen: true });
    };
    let floor = floor(&planes, &standing, &grid, &swept);
    if let Some((slab, surface)) = &floor {
        take(&mut occupied, slab, 2, |z| z <= surface + 0.6 * grid.edge, &grid);
        add("room_floor".to_owned(), slab);
    }
    let ground = floor.map(|(slab, _)| slab[2][1]);
    let mut walls = 0;
    for plane in planes.iter().filter(|p| p.axis < 2) {
        let Some((slab, outward)) = wall(plane, &all, ground, &grid) else { continue };
        let shape = grid.shape(&slab);
        // A carcass that was assumed too deep may reach into the wall, a part may not.
        if swept.iter().any(|s| overlap::boxes(&grown(s), &shape)) {
            continue;
        }
        take(&mut occupied, &slab, plane.axis, |c| outward * (c - plane.offset) > -0.6 * grid.edge, &grid);
        add(format!("room_wall_{walls}"), &slab);
        walls += 1;
    }
    drop_specks(&mut occupied);
    let mut rest = joined(&occupied);
    rest.sort_by_key(|(count, _)| std::cmp::Reverse(*count));
    for (i, (_, extent)) in rest.iter().take(config.room_boxes).enumerate() {
        add(format!("room_{i:03}"), extent);
    }
    solids
}

/// The box around a whole piece of furniture, closed, in the axes of its face: what it holds inside is its own.
fn hull(piece: &Furniture) -> OrientedBox {
    let rotation = piece.part.bounds.rotation;
    let axes = [0, 1, 2].map(|k| rotation.column(k).into_owned());
    let grid = Grid { axes, edge: 1.0 };
    let solids = piece.carcass.iter().chain(&piece.part.solids);
    grid.shape(&grid.bounds(solids.flat_map(|s| s.shape.corners())))
}

/// The part's boxes wherever they are over the part's range, and as far beyond as a part may have been left by a hand whose
/// motion was seen to end there.
fn sweep(part: &Part) -> Vec<OrientedBox> {
    let phi = part.joint.articulation;
    let lever = match phi.kind {
        JointKind::Prismatic => 1.0,
        JointKind::Revolute => {
            let corners = part.solids.iter().flat_map(|s| s.shape.corners());
            corners.map(|c| phi.line().distance(&c)).fold(0.05, f64::max)
        }
    };
    limits::motions(part, 0.0, part.joint.upper + limits::noise(phi.kind), TRAVEL_M / lever)
        .iter()
        .flat_map(|(_, motion)| part.solids.iter().map(move |s| s.shape.moved(motion)))
        .collect()
}

fn grown(shape: &OrientedBox) -> OrientedBox {
    OrientedBox { half: shape.half.map(|h| h + MARGIN_M), ..*shape }
}

/// Empties all cells that come within the margin of a box (and, at its edges, a few that do not).
fn empty(occupied: &mut BTreeMap<Index, Extent>, shape: &OrientedBox, grid: &Grid) {
    let shape = grown(shape);
    let layers = grid.bounds(shape.corners()).map(|b| b.map(|c| (c / grid.edge).floor() as i32));
    // Half of a cell as seen along each of the box's axes.
    let cell: [f64; 3] = std::array::from_fn(|i| {
        0.5 * grid.edge * grid.axes.iter().map(|a| a.dot(&shape.rotation.column(i)).abs()).sum::<f64>()
    });
    let rows = (layers[0][0]..=layers[0][1]).flat_map(|x| (layers[1][0]..=layers[1][1]).map(move |y| (x, y)));
    let gone: Vec<Index> = rows
        .flat_map(|(x, y)| occupied.range([x, y, layers[2][0]]..=[x, y, layers[2][1]]).map(|(index, _)| *index))
        .filter(|index| {
            let middle = grid.axes.iter().zip(index).fold(Vector::zeros(), |sum, (a, i)| sum + a * grid.middle(*i));
            let local = shape.rotation.transpose() * (middle - shape.center.coords);
            (0..3).all(|i| local[i].abs() <= shape.half[i] + cell[i])
        })
        .collect();
    for index in gone {
        occupied.remove(&index);
    }
}

/// Finds the large flat surfaces across the grid's axes and sets their cells into one thin layer each: noise and the grid
/// spread a surface over two or three. Level ones first.
fn flattened(occupied: &mut BTreeMap<Index, Extent>, edge: f64) -> Vec<Plane> {
    /// A front of 40 x 50 cm; smaller surfaces stay as their cells have them.
    const LEAST_M2: f64 = 0.2;
    /// More planes along one axis are clutter.
    const MOST: usize = 16;
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
        for _ in 0..MOST {
            let heights: Vec<f64> = flat.iter().map(|(h, _)| *h).collect();
            let Some(window) = densest(&heights, edge).filter(|w| w.len() as f64 * edge * edge >= LEAST_M2) else {
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
            let mut sheet: BTreeMap<Index, Extent> = BTreeMap::new();
            for index in on {
                let Some(mut extent) = occupied.remove(&index) else { continue };
                extent[axis] = [offset - SHEET_M, offset + SHEET_M];
                sheet.entry(onto(&index)).and_modify(|e| *e = around(e, &extent)).or_insert(extent);
            }
            let cells: Vec<Index> = sheet.keys().copied().collect();
            settled.extend(cells.iter().copied());
            occupied.extend(sheet);
            planes.push(Plane { axis, offset, cells });
        }
    }
    planes
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

fn around(a: &Extent, b: &Extent) -> Extent {
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

/// The members of a sorted list within the window that holds most of them.
fn densest(sorted: &[f64], window: f64) -> Option<std::ops::Range<usize>> {
    let mut best: Option<std::ops::Range<usize>> = None;
    let mut start = 0;
    for (end, &last) in sorted.iter().enumerate() {
        while last - sorted[start] > window {
            start += 1;
        }
        if best.as_ref().is_none_or(|b| end + 1 - start > b.len()) {
            best = Some(start..end + 1);
        }
    }
    best
}

/// Bounds of a plane's cells within itself, without its last few.
fn rectangle(plane: &Plane, grid: &Grid) -> Option<Extent> {
    let mut extent = [[plane.offset; 2]; 3];
    for (k, bounds) in extent.iter_mut().enumerate().filter(|(k, _)| *k != plane.axis) {
        let at: Vec<f64> = plane.cells.iter().map(|c| grid.middle(c[k])).collect();
        let half = 0.5 * grid.edge;
        *bounds = [stats::quantile(&at, 0.01)? - half, stats::quantile(&at, 0.99)? + half];
    }
    Some(extent)
}

fn area(plane: &Plane, grid: &Grid) -> f64 {
    plane.cells.len() as f64 * grid.edge * grid.edge
}

/// The floor's slab and the height of its surface: the lowest large level, where all furniture stands on or above it. The
/// slab is as wide as the floor was seen and the furniture stands, and a little lower where a part needs the space.
fn floor(planes: &[Plane], standing: &Extent, grid: &Grid, swept: &[OrientedBox]) -> Option<(Extent, f64)> {
    /// Less is a mat or a shelf.
    const LEAST_M2: f64 = 0.5;
    /// Furniture and floor are known to this.
    const NOISE_M: f64 = 0.1;
    let plane = planes
        .iter()
        .filter(|p| p.axis == 2 && area(p, grid) >= LEAST_M2)
        .min_by(|a, b| a.offset.total_cmp(&b.offset))
        .filter(|p| p.offset <= standing[2][0] + NOISE_M)?;
    let lowest = grid.bounds(swept.iter().flat_map(OrientedBox::corners))[2][0];
    let top = plane.offset.min(lowest - MARGIN_M);
    if top < plane.offset - NOISE_M {
        return None;
    }
    let seen = rectangle(plane, grid)?;
    let mut slab = around(&seen, standing);
    slab[2] = [top - WALL_M, top];
    Some((slab, plane.offset))
}

/// A wall's slab and the sense (+1, -1) in which it faces away from the room along the plane's axis: a large upright
/// surface behind which next to nothing was seen. It reaches down to the ground.
fn wall(plane: &Plane, all: &[Index], ground: Option<f64>, grid: &Grid) -> Option<(Extent, f64)> {
    const LEAST_M2: f64 = 1.0;
    /// A row of base cupboards is lower.
    const LEAST_HEIGHT_M: f64 = 1.2;
    /// Noise behind a wall.
    const BEHIND_SHARE: f64 = 0.02;
    let mut slab = rectangle(plane, grid)?;
    if area(plane, grid) < LEAST_M2 || slab[2][1] - slab[2][0] < LEAST_HEIGHT_M {
        return None;
    }
    let outward = [1.0, -1.0].into_iter().find(|outward| {
        let behind = |index: &&Index| outward * (grid.middle(index[plane.axis]) - plane.offset) > 1.5 * grid.edge;
        all.iter().filter(behind).count() as f64 <= BEHIND_SHARE * all.len() as f64
    })?;
    let back = plane.offset + outward * WALL_M;
    slab[plane.axis] = [plane.offset.min(back), plane.offset.max(back)];
    if let Some(ground) = ground {
        slab[2][0] = slab[2][0].min(ground);
    }
    Some((slab, outward))
}

/// Takes the cells away that a slab stands for: those before its face, for which `belongs` holds along the axis.
fn take(
    occupied: &mut BTreeMap<Index, Extent>,
    slab: &Extent,
    axis: usize,
    belongs: impl Fn(f64) -> bool,
    grid: &Grid,
) {
    occupied.retain(|index, _| {
        let before = (0..3).filter(|k| *k != axis).all(|k| (slab[k][0]..=slab[k][1]).contains(&grid.middle(index[k])));
        !(before && belongs(grid.middle(index[axis])))
    });
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::articulation::Articulation;
    use crate::pipeline::RoomCell;
    use crate::twin::Joint;

    const EDGE: f64 = 0.05;

    /// A door 0.5 m wide between x = 0 and 0.5, its front at y = 0 looking towards -y, hinged at x = 0; behind it its back.
    fn door() -> Furniture {
        let solid = |role: Role, center: [f64; 3], half: [f64; 3]| Solid {
            name: String::new(),
            role,
            shape: OrientedBox { center: Point::from(center), half: Vector::from(half), rotation: Matrix3::identity() },
            seen: true,
        };
        let front = solid(Role::Front, [0.25, 0.009, 0.45], [0.248, 0.009, 0.348]);
        Furniture {
            name: String::new(),
            carcass: vec![solid(Role::Carcass, [0.25, 0.5, 0.45], [0.25, 0.009, 0.35])],
            part: Part {
                id: "door".to_owned(),
                label: String::new(),
                joint: Joint {
                    articulation: Articulation {
                        kind: JointKind::Revolute,
                        axis: -Vector::z(),
                        origin: Point::new(0.0, 0.0, 0.45),
                    },
                    upper: 1.5,
                    observed: 1.5,
                    expected: 1.9,
                    damping: 0.5,
                    friction: 0.2,
                    resistance_seen: false,
                    balanced: false,
                    probability: None,
                },
                handle: Point::new(0.45, -0.03, 0.5),
                bounds: front.shape,
                solids: vec![front],
            },
        }
    }

    /// Points every centimetre over a rectangle: a corner and two sides.
    fn sheet(corner: [f64; 3], a: Vector, b: Vector) -> Vec<Point> {
        let (n, m) = ((a.norm() / 0.01) as usize, (b.norm() / 0.01) as usize);
        let at = |i: usize, n: usize| (i as f64 + 0.5) / n as f64;
        (0..n * m).map(|i| Point::from(corner) + a * at(i % n, n) + b * at(i / n, m)).collect()
    }

    /// Floor, wall, fronts on both sides of the door, a worktop above, and the door's leaf as it was left open for a while.
    fn room() -> RoomCells {
        let (x, y, z) = (Vector::x(), Vector::y(), Vector::z());
        let turned = crate::math::rotation(&-z, 1.0) * x;
        let sheets = [
            sheet([-1.5, -2.0, 0.013], x * 3.5, y * 2.6),
            sheet([-1.5, 0.612, 0.0], x * 3.5, z * 2.4),
            sheet([-1.5, 0.004, 0.1], x * 1.5, z * 0.7),
            sheet([0.5, 0.004, 0.1], x * 1.5, z * 0.7),
            sheet([-1.5, -0.02, 0.86], x * 3.5, y * 0.63),
            sheet([0.0, 0.0, 0.1], turned * 0.5, z * 0.7),
        ];
        let grid = Grid { axes: [x, y, z], edge: EDGE };
        let mut cells: BTreeMap<Index, Extent> = BTreeMap::new();
        for p in sheets.iter().flatten() {
            let at = grid.coordinates(p);
            let extent = at.map(|c| [c, c]);
            cells
                .entry(at.map(|c| (c / EDGE).floor() as i32))
                .and_modify(|e| *e = around(e, &extent))
                .or_insert(extent);
        }
        let cells = cells.into_iter().map(|(index, extent)| RoomCell { index, views: 3, extent }).collect();
        RoomCells { axes: grid.axes, edge_m: EDGE, cells }
    }

    #[test]
    fn a_room_becomes_floor_wall_and_boxes_that_leave_the_doors_way_free() {
        let (room, piece) = (room(), door());
        let config = config::Fitting::default();
        let solids = boxes(&room, std::slice::from_ref(&piece), &config);
        assert_eq!(solids, boxes(&room, std::slice::from_ref(&piece), &config));
        let named = |name: &str| solids.iter().find(|s| s.name == name).map(|s| s.shape);
        let (floor, wall) = (named("room_floor").unwrap(), named("room_wall_0").unwrap());
        assert!((floor.center.z + floor.half.z - 0.013).abs() < 1e-6, "{floor:?}");
        assert!((wall.center.y - wall.half.y - 0.612).abs() < 1e-6 && wall.half.x > 1.7, "{wall:?}");
        assert!(named("room_wall_1").is_none() && solids.len() < 30, "{}", solids.len());

        for step in 0..=300 {
            let motion = piece.part.joint.articulation.motion(1.5 * f64::from(step) / 300.0);
            let leaf = piece.part.solids[0].shape.moved(&motion);
            for solid in &solids {
                assert!(!overlap::boxes(&leaf, &solid.shape), "{} at step {step}", solid.name);
            }
        }
        // Fronts beside the door are there, flush with it.
        for x in [-0.6, 1.1] {
            let beside = Point::new(x, 0.004, 0.5);
            let front = solids.iter().find(|s| s.shape.contains(&beside)).unwrap().shape;
            assert!(front.center.y - front.half.y > -0.011, "{front:?}");
        }
        // All that is seen away from the door is there.
        let grid = Grid { axes: room.axes, edge: EDGE };
        let body = grid.bounds(sweep(&piece.part).iter().chain([&hull(&piece)]).flat_map(OrientedBox::corners));
        let (mut away, mut covered) = (0u32, 0usize);
        for cell in &room.cells {
            let middle = cell.extent.map(|[low, high]| 0.5 * (low + high));
            if (0..3).all(|k| (body[k][0] - 0.1..=body[k][1] + 0.1).contains(&middle[k])) {
                continue;
            }
            let p = Point::from(middle);
            away += 1;
            covered += usize::from(solids.iter().any(|s| grown(&s.shape).contains(&p)));
        }
        assert!(away > 5000 && covered as f64 > 0.95 * f64::from(away), "{covered} of {away}");
    }

    #[test]
    fn specks_go_and_the_largest_boxes_stay() {
        let mut room = room();
        let speck = RoomCell { index: [0, -20, 20], views: 3, extent: [[0.0, 0.05], [-1.0, -0.95], [1.0, 1.05]] };
        room.cells.push(speck);
        let piece = door();
        let at = |solids: &[Solid]| solids.iter().any(|s| s.shape.contains(&Point::new(0.02, -0.98, 1.02)));
        let solids = boxes(&room, std::slice::from_ref(&piece), &config::Fitting::default());
        assert!(!at(&solids));
        let few = config::Fitting { room_boxes: 2, ..Default::default() };
        let fewer = boxes(&room, std::slice::from_ref(&piece), &few);
        assert_eq!(fewer.len(), 4);
        assert_eq!(fewer[..], solids[..4]);
        assert!(boxes(&room, &[], &few).is_empty());
    }

    #[test]
    fn a_surface_between_two_layers_is_one_sheet() {
        // A wall at the border of two layers: every other cell falls into either.
        let mut occupied: BTreeMap<Index, Extent> = BTreeMap::new();
        for y in 0..20 {
            for z in 0..20 {
                let x = (y + z) % 2;
                let extent = |i: i32| [f64::from(i) * EDGE, f64::from(i + 1) * EDGE];
                occupied.insert([x, y, z], [[0.045 + 0.01 * f64::from(x); 2], extent(y), extent(z)]);
            }
        }
        let planes = flattened(&mut occupied, EDGE);
        assert_eq!(planes.len(), 1);
        assert_eq!(planes[0].axis, 0);
        let sheet = joined(&occupied);
        assert_eq!(sheet.len(), 1);
        assert_eq!(sheet[0].0, 400);
        let [low, high] = sheet[0].1[0];
        assert!((low - 0.04).abs() < 1e-9 && (high - 0.06).abs() < 1e-9, "{low} {high}");
    }
}
