//! The rest of the room as few boxes that do not move: floor, walls, worktops, furniture that nobody opened (ours).
//!
//! Cells that several views saw ([`crate::pipeline::RoomCells`]) are set onto the room's flat surfaces (`planes.rs`). The floor
//! and the walls become one box each; what is left is covered by boxes that are as large as what was seen through lets them be
//! (`cover.rs`). None is where furniture stands or a part moves.

use std::collections::{BTreeMap, HashSet};

use super::cells::{Block, Extent, Index, Known, drop_specks, within};
use super::planes::{Grid, Plane, around, flattened};
use super::{cover, limits, overlap, turned};
use crate::articulation::JointKind;
use crate::config;
use crate::math::{Vector, stats};
use crate::pipeline::RoomCells;
use crate::twin::{Furniture, OrientedBox, Part, Role, Solid};

/// Boxes of the room around placed furniture; floor and walls first, the rest by falling surface. Nothing of it is within a
/// centimetre of a part anywhere in its range so far (0..=`upper`). Empty where there is no furniture.
pub(super) fn boxes(cells: &RoomCells, furniture: &[Furniture], config: &config::Fitting) -> Vec<Solid> {
    let rules = &config.boxes;
    let grid = Grid { axes: cells.axes, edge: cells.edge_m };
    if furniture.is_empty() {
        return Vec::new();
    }
    let bodies: Vec<OrientedBox> = furniture.iter().map(body).collect();
    let standing = grid.bounds(bodies.iter().flat_map(OrientedBox::corners));
    let reach = config.room_reach_m;
    let near = |index: &Index| {
        (0..3).all(|k| (standing[k][0] - reach..=standing[k][1] + reach).contains(&grid.middle(index[k])))
    };
    let mut occupied: BTreeMap<Index, Extent> =
        cells.cells.iter().filter(|c| near(&c.index)).map(|c| (c.index, c.extent)).collect();
    let planes = flattened(&mut occupied, grid.edge, rules);
    let all: Vec<Index> = occupied.keys().copied().collect();

    let swept: Vec<OrientedBox> = furniture.iter().flat_map(|f| sweep(&f.part, config)).collect();
    let blockers: Vec<OrientedBox> = bodies.iter().chain(&swept).map(|b| grown(b, rules.margin_m)).collect();
    let taken = taken(&blockers, &occupied, &grid);
    occupied.retain(|index, _| !taken.contains(index));
    let mut known = Known { occupied, free: &cells.free, taken };

    let mut solids = Vec::new();
    let mut add = |name: String, extent: &Extent| {
        solids.push(Solid { name, role: Role::Room, shape: grid.shape(extent), seen: true });
    };
    let floor = floor(&planes, &standing, &grid, &swept, rules);
    if let Some((slab, surface)) = &floor {
        take(&mut known.occupied, slab, 2, |z| z <= surface + rules.cell_share * grid.edge, &grid);
        add("room_floor".to_owned(), slab);
    }
    let ground = floor.map(|(slab, _)| slab[2][1]);
    // A carcass that was assumed too deep may reach into the wall, a part may not.
    let free = |slab: &Extent| swept.iter().all(|s| !overlap::boxes(&grown(s, rules.margin_m), &grid.shape(slab)));
    let upright = planes.iter().filter(|p| p.axis < 2);
    let walls: Vec<Wall> = upright
        .filter_map(|p| wall(p, (all.as_slice(), ground), &known, &grid, rules))
        .filter(|w| free(&w.slab))
        .collect();
    for (i, wall) in walls.iter().enumerate() {
        let Wall { axis, offset, outward, .. } = *wall;
        let slab = Some(met(wall, &walls, rules)).filter(&free).unwrap_or(wall.slab);
        take(&mut known.occupied, &slab, axis, |c| outward * (c - offset) > -rules.cell_share * grid.edge, &grid);
        add(format!("room_wall_{i}"), &slab);
    }
    if config.room_boxes > 0 {
        drop_specks(&mut known.occupied, rules.speck_cells);
        for (i, shape) in rest(known, &planes, &blockers, &grid, config).into_iter().enumerate() {
            solids.push(Solid { name: format!("room_{i:03}"), role: Role::Room, shape, seen: true });
        }
    }
    solids
}

/// The boxes beside floor and walls, by falling surface: what stands turned against the room first, in its own axes.
fn rest(
    mut known: Known,
    planes: &[Plane],
    blockers: &[OrientedBox],
    grid: &Grid,
    config: &config::Fitting,
) -> Vec<OrientedBox> {
    let mut found = Vec::new();
    for heading in turned::headings(&known.occupied, planes, grid, &config.turned) {
        let (mut occupied, free) = heading.known(&known, planes, grid);
        flattened(&mut occupied, grid.edge, &config.boxes);
        let taken = taken(blockers, &occupied, &heading.grid);
        occupied.retain(|index, _| !taken.contains(index));
        let some = covered(&Known { occupied, free: &free, taken }, blockers, &heading.grid, config);
        let reach: Vec<OrientedBox> =
            some.iter().map(|(_, shape)| grown(shape, config.boxes.cell_share * grid.edge)).collect();
        known.occupied.retain(|_, extent| {
            let p = grid.shape(extent).center;
            !reach.iter().any(|shape| shape.contains(&p))
        });
        found.extend(some);
    }
    found.extend(covered(&known, blockers, grid, config));
    found.sort_by_key(|(count, _)| std::cmp::Reverse(*count));
    found.into_iter().take(config.room_boxes).map(|(_, shape)| shape).collect()
}

/// The boxes that cover what is known, with the cells of surface in each.
fn covered(
    known: &Known,
    blockers: &[OrientedBox],
    grid: &Grid,
    config: &config::Fitting,
) -> Vec<(usize, OrientedBox)> {
    let limits = cover::Limits {
        surface: (config.room_box_m2 / grid.edge.powi(2)).ceil().clamp(1.0, 1e9) as usize,
        solid: (config.room_solid_m / grid.edge).ceil().clamp(1.0, 1e6) as i32,
    };
    let thin = config.room_box_thin_m;
    let shape = |(count, block): &(usize, Block)| {
        let extent = widened(block, known, blockers, grid, config).map(|side| no_thinner(side, thin));
        let mut sides = extent.map(|[low, high]| high - low);
        sides.sort_by(f64::total_cmp);
        (sides[1] >= config.room_box_side_m).then(|| (*count, grid.shape(&extent)))
    };
    cover::blocks(known, &limits, &config.cover).iter().filter_map(shape).collect()
}

fn no_thinner([low, high]: [f64; 2], thin: f64) -> [f64; 2] {
    let (middle, half) = (0.5 * (low + high), 0.5 * (high - low).max(thin));
    [middle - half, middle + half]
}

/// A block's box: its faces where surfaces are, then as far out as they should be and nothing is in the way.
fn widened(block: &Block, known: &Known, blockers: &[OrientedBox], grid: &Grid, config: &config::Fitting) -> Extent {
    /// Numerics: steps in which a face is moved out.
    const TRIES: u32 = 8;
    let rules = &config.boxes;
    let mut extent = cover::extent(block, known, grid.edge, config.cover.face_share);
    let reach = grown(&grid.shape(&extent), 2.0 * grid.edge + rules.wall_m);
    let near: Vec<&OrientedBox> = blockers.iter().filter(|b| overlap::boxes(b, &reach)).collect();
    let clear = |extent: &Extent| near.iter().all(|b| !overlap::boxes(b, &grid.shape(extent)));
    // A surface may lie a little outside of its cells; within them nothing is in the way.
    for (axis, end) in sides() {
        if clear(&extent) {
            break;
        }
        let borders = [block[0][axis], block[1][axis]].map(|i| f64::from(i) * grid.edge);
        extent[axis][end] = extent[axis][end].clamp(borders[0], borders[1]);
    }
    for (axis, end) in sides() {
        let from = extent[axis][end];
        let by = wanted(block, &extent, (axis, end), known, grid.edge, rules) - from;
        for i in (1..=TRIES).rev().filter(|_| by != 0.0) {
            let mut wider = extent;
            wider[axis][end] = from + by * f64::from(i) / f64::from(TRIES);
            if clear(&wider) {
                extent = wider;
                break;
            }
        }
    }
    extent
}

/// Axis and end of all faces.
fn sides() -> impl Iterator<Item = (usize, usize)> {
    (0..3).flat_map(|axis| [(axis, 0), (axis, 1)])
}

/// Where one face of a block's box should be, metres along the axis: a sheet that was seen from one side becomes as thick as a
/// wall towards the other; what ends at the cells that furniture or the way of a part takes should end right before these.
fn wanted(
    block: &Block,
    extent: &Extent,
    (axis, end): (usize, usize),
    known: &Known,
    edge: f64,
    rules: &config::RoomBoxes,
) -> f64 {
    // The layer outside of an end, and the way out.
    let outside = |end: usize| if end == 0 { (block[0][axis] - 1, -1) } else { (block[1][axis], 1) };
    let open = |end: usize| cover::is_open(block, axis, outside(end).0, outside(end).1, known);
    let (at, way) = outside(end);
    let thickness = extent[axis][1] - extent[axis][0];
    let taken = known.share(block, axis, at, |index| known.taken.contains(index));
    if taken >= rules.taken_share && known.share(block, axis, at, |index| known.is_free(index)) < rules.free_share {
        f64::from(block[end][axis] + way) * edge
    } else if thickness < rules.wall_m && !open(end) && open(1 - end) {
        extent[axis][end] + f64::from(way) * (rules.wall_m - thickness)
    } else {
        extent[axis][end]
    }
}

/// The box around a whole piece of furniture, closed, in the axes of its face: what it holds inside is its own. World, metres.
#[must_use]
pub fn body(piece: &Furniture) -> OrientedBox {
    let rotation = piece.part.bounds.rotation;
    let axes = [0, 1, 2].map(|k| rotation.column(k).into_owned());
    let grid = Grid { axes, edge: 1.0 };
    let solids = piece.carcass.iter().chain(&piece.part.solids);
    grid.shape(&grid.bounds(solids.flat_map(|s| s.shape.corners())))
}

/// The part's boxes (world, metres) wherever they are over the part's range, and as far beyond as a part may have been left by a
/// hand whose motion was seen to end there; from one pose to the next nothing goes further than 2 cm.
#[must_use]
pub fn sweep(part: &Part, config: &config::Fitting) -> Vec<OrientedBox> {
    /// Geometry: from one pose of a part to the next no corner of it goes further, metres: half of it stays within the margin.
    const TRAVEL_M: f64 = 0.02;
    let phi = part.joint.articulation;
    let lever = match phi.kind {
        JointKind::Prismatic => 1.0,
        JointKind::Revolute => {
            let corners = part.solids.iter().flat_map(|s| s.shape.corners());
            corners.map(|c| phi.line().distance(&c)).fold(0.05, f64::max)
        }
    };
    limits::motions(part, 0.0, part.joint.upper + limits::noise(phi.kind, config), TRAVEL_M / lever)
        .iter()
        .flat_map(|(_, motion)| part.solids.iter().map(move |s| s.shape.moved(motion)))
        .collect()
}

fn grown(shape: &OrientedBox, by: f64) -> OrientedBox {
    OrientedBox { half: shape.half.map(|h| h + by), ..*shape }
}

/// The cells within the occupied ones' bounds that share space with a box (and, at its edges, a few that do not).
fn taken(blockers: &[OrientedBox], occupied: &BTreeMap<Index, Extent>, grid: &Grid) -> HashSet<Index> {
    let mut bounds = [[i32::MAX; 3], [i32::MIN; 3]];
    for index in occupied.keys() {
        for (k, i) in index.iter().enumerate() {
            bounds[0][k] = bounds[0][k].min(*i);
            bounds[1][k] = bounds[1][k].max(*i);
        }
    }
    let mut out = HashSet::new();
    for shape in blockers {
        let layers = grid.bounds(shape.corners()).map(|b| b.map(|c| (c / grid.edge).floor() as i32));
        let low: Index = std::array::from_fn(|k| layers[k][0].max(bounds[0][k]));
        let high: Index = std::array::from_fn(|k| layers[k][1].min(bounds[1][k]).saturating_add(1));
        // Half of a cell as seen along each of the box's axes.
        let cell: [f64; 3] = std::array::from_fn(|i| {
            0.5 * grid.edge * grid.axes.iter().map(|a| a.dot(&shape.rotation.column(i)).abs()).sum::<f64>()
        });
        out.extend(within([low, high]).filter(|index| {
            let middle = grid.axes.iter().zip(index).fold(Vector::zeros(), |sum, (a, i)| sum + a * grid.middle(*i));
            let local = shape.rotation.transpose() * (middle - shape.center.coords);
            (0..3).all(|i| local[i].abs() <= shape.half[i] + cell[i])
        }));
    }
    out
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

/// The floor's slab and the height of its surface: the largest of the lowest levels, where all furniture stands on or above it. The
/// slab is as wide as the floor was seen and the furniture stands, and a little lower where a part needs the space.
fn floor(
    planes: &[Plane],
    standing: &Extent,
    grid: &Grid,
    swept: &[OrientedBox],
    rules: &config::RoomBoxes,
) -> Option<(Extent, f64)> {
    let noise_m = rules.floor_noise_m;
    let level = || planes.iter().filter(move |p| p.axis == 2 && area(p, grid) >= rules.floor_m2);
    // Noise leaves levels below the floor, too; the floor is the largest.
    let deepest = level().map(|p| p.offset).min_by(f64::total_cmp)?;
    let near = level().filter(|p| p.offset <= deepest + noise_m);
    let plane = near.max_by_key(|p| p.cells.len()).filter(|p| p.offset <= standing[2][0] + noise_m)?;
    let lowest = grid.bounds(swept.iter().flat_map(OrientedBox::corners))[2][0];
    let top = plane.offset.min(lowest - rules.margin_m);
    if top < plane.offset - noise_m {
        return None;
    }
    let seen = rectangle(plane, grid)?;
    let mut slab = around(&seen, standing);
    slab[2] = [top - rules.wall_m, top];
    Some((slab, plane.offset))
}

/// A wall.
struct Wall {
    slab: Extent,
    /// The axis across it, its surface along that, metres, and the sense (+1, -1) in which it faces away from the room.
    axis: usize,
    offset: f64,
    outward: f64,
}

/// The wall that a plane is: a large upright surface behind which next to nothing was seen. It reaches down to the ground.
fn wall(
    plane: &Plane,
    (all, ground): (&[Index], Option<f64>),
    known: &Known,
    grid: &Grid,
    rules: &config::RoomBoxes,
) -> Option<Wall> {
    let mut slab = rectangle(plane, grid)?;
    if area(plane, grid) < rules.wall_m2 || slab[2][1] - slab[2][0] < rules.wall_height_m {
        return None;
    }
    let outward = [1.0, -1.0].into_iter().find(|outward| {
        let behind = |index: &&Index| outward * (grid.middle(index[plane.axis]) - plane.offset) > 1.5 * grid.edge;
        all.iter().filter(behind).count() as f64 <= rules.behind_share * all.len() as f64
    })?;
    let at = (plane.offset / grid.edge).floor() as i32;
    let block = [0, 1].map(|end| slab.map(|side| (side[end] / grid.edge).round() as i32));
    let through = |index: &Index| known.is_free(index) && plane.cells.binary_search(index).is_err();
    if known.share(&block, plane.axis, at, through) > rules.through_share {
        return None;
    }
    let back = plane.offset + outward * rules.wall_m;
    slab[plane.axis] = [plane.offset.min(back), plane.offset.max(back)];
    if let Some(ground) = ground {
        slab[2][0] = slab[2][0].min(ground);
    }
    Some(Wall { slab, axis: plane.axis, offset: plane.offset, outward })
}

/// A wall's slab, drawn out to the back of the walls that it nearly meets.
fn met(wall: &Wall, walls: &[Wall], rules: &config::RoomBoxes) -> Extent {
    let mut slab = wall.slab;
    for other in walls.iter().filter(|w| w.axis != wall.axis) {
        let end = usize::from(other.outward > 0.0);
        let side = &mut slab[other.axis][end];
        if (*side - other.offset).abs() < rules.met_m {
            *side = other.offset + other.outward * rules.wall_m;
        }
    }
    slab
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
    use nalgebra::Matrix3;

    use crate::articulation::Articulation;
    use crate::math::Point;
    use crate::pipeline::{FreeRun, RoomCell};
    use crate::twin::Joint;

    const EDGE: f64 = 0.05;
    const MARGIN_M: f64 = 0.02;
    const WALL_M: f64 = 0.05;

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
        RoomCells { axes: grid.axes, edge_m: EDGE, cells, free: Vec::new() }
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
        let body = grid.bounds(
            sweep(&piece.part, &config::Fitting::default())
                .iter()
                .chain([&body(&piece)])
                .flat_map(OrientedBox::corners),
        );
        let (mut away, mut covered) = (0u32, 0usize);
        for cell in &room.cells {
            let middle = cell.extent.map(|[low, high]| 0.5 * (low + high));
            if (0..3).all(|k| (body[k][0] - 0.1..=body[k][1] + 0.1).contains(&middle[k])) {
                continue;
            }
            let p = Point::from(middle);
            away += 1;
            covered += usize::from(solids.iter().any(|s| grown(&s.shape, MARGIN_M).contains(&p)));
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
        let planes = flattened(&mut occupied, EDGE, &config::RoomBoxes::default());
        assert_eq!(planes.len(), 1);
        assert_eq!(planes[0].axis, 0);
        let known = Known { occupied, free: &[], taken: HashSet::new() };
        let sheet = cover::blocks(&known, &cover::Limits { surface: 40, solid: 20 }, &config::Cover::default());
        assert_eq!(sheet.len(), 1);
        assert_eq!(sheet[0].0, 400);
        let [low, high] = cover::extent(&sheet[0].1, &known, EDGE, 0.25)[0];
        assert!((low - 0.04).abs() < 1e-9 && (high - 0.06).abs() < 1e-9, "{low} {high}");
    }

    /// Air before and above everything of [`room`], and inside of the door's furniture, as far as views saw it.
    fn air() -> Vec<FreeRun> {
        (-30..40)
            .flat_map(|x| (-40..12).map(move |y| [x, y]))
            .map(|[x, y]| FreeRun { column: [x, y], span: [if y < -1 { 2 } else { 19 }, 46] })
            .collect()
    }

    #[test]
    fn fronts_and_worktop_become_solid_and_the_air_before_them_stays_free() {
        let room = RoomCells { free: air(), ..room() };
        let piece = door();
        let solids = boxes(&room, std::slice::from_ref(&piece), &config::Fitting::default());
        // Floor, wall, the furniture to both sides, the worktop above the door.
        assert!((5..8).contains(&solids.len()), "{:?}", solids.iter().map(|s| &s.name).collect::<Vec<_>>());
        let inside = |p: [f64; 3]| solids.iter().any(|s| s.shape.contains(&Point::from(p)));
        for p in [[-0.7, 0.3, 0.5], [1.2, 0.3, 0.5], [-0.7, 0.05, 0.2], [0.2, 0.3, 0.85], [-0.1, 0.3, 0.5]] {
            assert!(inside(p), "nothing at {p:?}: {solids:?}");
        }
        for p in [[-0.7, -0.03, 0.5], [0.3, 0.3, 0.5], [0.3, -0.2, 0.5], [0.0, -1.0, 1.0], [-0.7, 0.3, 0.9]] {
            assert!(!inside(p), "something at {p:?}: {solids:?}");
        }
        // Surfaces lie where they were seen: fronts, worktop.
        let left = solids.iter().find(|s| s.shape.contains(&Point::new(-0.7, 0.3, 0.5))).unwrap().shape;
        assert!((left.center.y - left.half.y - 0.004).abs() < 1e-6, "{left:?}");
        assert!(solids.iter().any(|s| (s.shape.center.z + s.shape.half.z - 0.86).abs() < 1e-6), "{solids:?}");
        let sides = |s: &Solid| s.shape.half.iter().all(|h| *h >= 0.005);
        assert!(solids.iter().all(sides));
    }

    #[test]
    fn a_passage_is_no_wall() {
        let mut room = RoomCells { free: air(), ..room() };
        // Half of the wall is missing, and views saw through the gap.
        room.cells.retain(|c| c.index[1] != 12 || !(-10..25).contains(&c.index[0]) || c.index[2] > 43);
        room.free.extend((-10..25).flat_map(|x| (12..20).map(move |y| FreeRun { column: [x, y], span: [19, 43] })));
        room.free.sort_by_key(|run| (run.column, run.span));
        let solids = boxes(&room, std::slice::from_ref(&door()), &config::Fitting::default());
        assert!(!solids.iter().any(|s| s.name.starts_with("room_wall")), "{solids:?}");
        let inside = |p: [f64; 3]| solids.iter().any(|s| s.shape.contains(&Point::from(p)));
        assert!(inside([-1.0, 0.62, 1.5]) && inside([1.6, 0.62, 1.5]) && !inside([0.3, 0.62, 1.5]), "{solids:?}");
    }

    #[test]
    fn walls_meet_in_their_corner() {
        let wall = |axis: usize, offset: f64, outward: f64, side: [f64; 2]| {
            let mut slab = [[0.0, 0.0], [0.0, 0.0], [0.0, 2.5]];
            slab[axis] = if outward > 0.0 { [offset, offset + WALL_M] } else { [offset - WALL_M, offset] };
            slab[1 - axis] = side;
            Wall { slab, axis, offset, outward }
        };
        let walls = [wall(0, 3.0, 1.0, [0.1, 2.0]), wall(1, 0.0, -1.0, [0.0, 2.9]), wall(1, 4.0, 1.0, [0.0, 2.9])];
        assert_eq!(met(&walls[0], &walls, &config::RoomBoxes::default())[1], [-WALL_M, 2.0]);
        assert_eq!(met(&walls[1], &walls, &config::RoomBoxes::default())[0], [0.0, 3.0 + WALL_M]);
    }
}
