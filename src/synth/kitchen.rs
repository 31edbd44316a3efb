//! A kitchen of boxes: a row of base furniture with fronts, a tall fridge, wall cupboards, a sideboard turned against
//! the room.

use nalgebra::Matrix3;
use rand::RngExt;
use rand_pcg::Pcg64Mcg;

use crate::articulation::{Articulation, JointKind};
use crate::math::{Point, Pose, Vector, rotation};
use crate::recording::HAND_CLASS;
use crate::twin::OrientedBox;

/// Mask classes from 1.
pub const CLASSES: [&str; 4] = ["drawer", "cupboard", "fridge", "dishwasher"];

/// A coloured box.
#[derive(Debug, Clone, Copy)]
pub struct Block {
    /// Where, closed.
    pub shape: OrientedBox,
    /// RGB.
    pub color: [u8; 3],
    /// Mask class; 0 = nothing.
    pub class: u8,
}

/// A part that opens.
#[derive(Debug, Clone)]
pub struct OpenPart {
    /// Name.
    pub id: String,
    /// The word for its furniture.
    pub noun: &'static str,
    /// Its joint; positive opens.
    pub articulation: Articulation,
    /// Fully open, rad or m.
    pub upper: f64,
    /// Where it is held, closed.
    pub handle: Point,
    /// Out of the furniture.
    pub out: Vector,
    /// Box of the part, closed, handle included.
    pub bounds: OrientedBox,
    /// The furniture behind it.
    pub base: OrientedBox,
    /// Its boxes.
    pub blocks: Vec<Block>,
}

/// The whole kitchen.
#[derive(Debug, Clone)]
pub struct Kitchen {
    /// What does not move.
    pub fixed: Vec<Block>,
    /// What does.
    pub parts: Vec<OpenPart>,
}

const BOARD: f64 = 0.018;
const GAP: f64 = 0.003;
const DEPTH: f64 = 0.58;

/// Builds in kitchen coordinates (x along the row, y out of the wall, z up) and places the result in the world.
struct Builder {
    world_from_kitchen: Pose,
    fixed: Vec<Block>,
    parts: Vec<OpenPart>,
    front: [u8; 3],
}

impl Builder {
    /// A box from its bounds in kitchen coordinates.
    fn shape(&self, bounds: [[f64; 2]; 3]) -> OrientedBox {
        let middle = Point::from(bounds.map(|b| 0.5 * (b[0] + b[1])));
        OrientedBox {
            center: self.world_from_kitchen * middle,
            half: Vector::from(bounds.map(|b| 0.5 * (b[1] - b[0]))),
            rotation: *self.world_from_kitchen.rotation.to_rotation_matrix().matrix(),
        }
    }

    fn block(&self, bounds: [[f64; 2]; 3], color: [u8; 3], class: u8) -> Block {
        Block { shape: self.shape(bounds), color, class }
    }

    /// Boards of an open box, its front at y = 0 side towards +y.
    fn carcass(&mut self, x: [f64; 2], z: [f64; 2], class: u8) {
        let (wood, y) = ([214, 210, 202], [0.0, DEPTH]);
        let inner = [x[0] + BOARD, x[1] - BOARD];
        for bounds in [
            [[x[0], x[0] + BOARD], y, z],
            [[x[1] - BOARD, x[1]], y, z],
            [inner, y, [z[0], z[0] + BOARD]],
            [inner, y, [z[1] - BOARD, z[1]]],
            [inner, [0.0, BOARD], [z[0] + BOARD, z[1] - BOARD]],
        ] {
            let block = self.block(bounds, wood, class);
            self.fixed.push(block);
        }
    }

    /// A front with its handle and joint. `hinge`: `None` slides, else the side seen from the person.
    fn part(&mut self, noun: &'static str, x: [f64; 2], z: [f64; 2], hinge: Option<Side>, base: [[f64; 2]; 3]) {
        let class = CLASSES.iter().position(|c| *c == noun).map_or(0, |i| i as u8 + 1);
        let face = DEPTH + BOARD + GAP;
        let (fx, fz) = ([x[0] + 0.5 * GAP, x[1] - 0.5 * GAP], [z[0] + 0.5 * GAP, z[1] - 0.5 * GAP]);
        let mut bounds = vec![[fx, [face - BOARD, face], fz]];
        // The person looks along -y: their left is +x.
        let (hx, hz, upright) = match hinge {
            Some(Side::Left) => (fx[0] + 0.045, handle_height(fz), true),
            Some(Side::Right) => (fx[1] - 0.045, handle_height(fz), true),
            Some(Side::Bottom) => (0.5 * (fx[0] + fx[1]), fz[1] - 0.05, false),
            Some(Side::Top) => (0.5 * (fx[0] + fx[1]), fz[0] + 0.05, false),
            None => {
                (0.5 * (fx[0] + fx[1]), if fz[1] - fz[0] > 0.25 { fz[1] - 0.06 } else { 0.5 * (fz[0] + fz[1]) }, false)
            }
        };
        let (bar, thin) = (0.07, 0.006);
        let handle_bounds = if upright {
            [[hx - thin, hx + thin], [face, face + 0.04], [hz - bar, hz + bar]]
        } else {
            [[hx - bar, hx + bar], [face, face + 0.04], [hz - thin, hz + thin]]
        };
        if hinge.is_none() {
            // The tray.
            let inner = [x[0] + BOARD + 0.01, x[1] - BOARD - 0.01];
            let (low, high) = (z[0] + BOARD + 0.01, z[0] + BOARD + 0.01 + 0.6 * (z[1] - z[0]));
            let y = [0.06, face - BOARD];
            bounds.push([[inner[0], inner[0] + 0.012], y, [low, high]]);
            bounds.push([[inner[1] - 0.012, inner[1]], y, [low, high]]);
            bounds.push([inner, y, [low, low + 0.012]]);
            bounds.push([inner, [y[0], y[0] + 0.012], [low, high]]);
        }
        let mut blocks: Vec<Block> = bounds
            .iter()
            .enumerate()
            .map(|(i, b)| self.block(*b, if i == 0 { self.front } else { [226, 222, 214] }, class))
            .collect();
        blocks.push(self.block(handle_bounds, [58, 60, 64], class));
        bounds.push(handle_bounds);
        let whole: [[f64; 2]; 3] = std::array::from_fn(|i| {
            [
                bounds.iter().map(|b| b[i][0]).fold(f64::INFINITY, f64::min),
                bounds.iter().map(|b| b[i][1]).fold(f64::NEG_INFINITY, f64::max),
            ]
        });
        let at = |x: f64, y: f64, z: f64| self.world_from_kitchen * Point::new(x, y, z);
        let along = |v: Vector| self.world_from_kitchen * v;
        let (middle_x, middle_z) = (0.5 * (fx[0] + fx[1]), 0.5 * (fz[0] + fz[1]));
        // Hinges run along the front edge of the leaf; positive turns the free edge out (+y).
        let articulation = match hinge {
            Some(Side::Left) => {
                Articulation { kind: JointKind::Revolute, axis: along(-Vector::z()), origin: at(fx[1], face, middle_z) }
            }
            Some(Side::Right) => {
                Articulation { kind: JointKind::Revolute, axis: along(Vector::z()), origin: at(fx[0], face, middle_z) }
            }
            Some(Side::Bottom) => {
                Articulation { kind: JointKind::Revolute, axis: along(-Vector::x()), origin: at(middle_x, face, fz[0]) }
            }
            Some(Side::Top) => {
                Articulation { kind: JointKind::Revolute, axis: along(Vector::x()), origin: at(middle_x, face, fz[1]) }
            }
            None => Articulation {
                kind: JointKind::Prismatic,
                axis: along(Vector::y()),
                origin: at(middle_x, face, middle_z),
            },
        };
        let upper = match hinge {
            Some(Side::Bottom) => 1.4,
            Some(Side::Top) => 1.5,
            Some(_) => 1.7,
            None => 0.42,
        };
        let part = OpenPart {
            id: format!("part_{:02}", self.parts.len()),
            noun,
            articulation,
            upper,
            handle: at(hx, face + 0.035, hz),
            out: along(Vector::y()),
            bounds: self.shape(whole),
            base: self.shape(base),
            blocks,
        };
        self.parts.push(part);
    }
}

/// Where the hinge is, seen by the person who stands before the furniture.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Side {
    Left,
    Right,
    Top,
    Bottom,
}

/// Within reach on tall doors, near the top on base doors.
fn handle_height(z: [f64; 2]) -> f64 {
    if z[1] > 1.3 && z[0] < 1.0 {
        1.05
    } else if z[0] > 1.0 {
        z[0] + 0.12
    } else {
        z[1] - 0.12
    }
}

/// Builds a kitchen.
#[must_use]
pub fn build(rng: &mut Pcg64Mcg) -> Kitchen {
    let yaw = rng.random_range(-3.1..3.1);
    let place = Vector::new(rng.random_range(-3.0..3.0), rng.random_range(-3.0..3.0), rng.random_range(-0.5..0.5));
    let palettes = [[196, 164, 122], [226, 226, 222], [104, 128, 118], [168, 176, 186], [150, 108, 78]];
    let world_from_kitchen = Pose::from_parts(place.into(), rotation(&Vector::z(), yaw));
    let front = palettes[rng.random_range(0..palettes.len())];
    let mut b = Builder { world_from_kitchen, fixed: Vec::new(), parts: Vec::new(), front };

    let (low, high) = (0.1, 0.82);
    let mut x = 0.0;
    let mut units: Vec<u8> = vec![0, 1, 2, 1, 0];
    // Any order of drawers (0), doors (1) and the dishwasher (2).
    for i in (1..units.len()).rev() {
        units.swap(i, rng.random_range(0..=i));
    }
    for unit in units {
        let width = if unit == 2 { 0.6 } else { [0.4, 0.5, 0.6][rng.random_range(0..3)] };
        let span = [x, x + width];
        let base = [span, [0.0, DEPTH], [low, high]];
        match unit {
            0 => {
                let heights: &[f64] = if rng.random_bool(0.5) { &[0.18, 0.54] } else { &[0.16, 0.24, 0.32] };
                let mut top = high;
                for h in heights {
                    let z = [top - h, top];
                    b.carcass(span, z, 1);
                    b.part("drawer", span, z, None, [span, [0.0, DEPTH], z]);
                    top -= h;
                }
            }
            1 => {
                b.carcass(span, [low, high], 2);
                let side = if rng.random_bool(0.5) { Side::Left } else { Side::Right };
                b.part("cupboard", span, [low, high], Some(side), base);
            }
            _ => {
                b.carcass(span, [low, high], 4);
                b.part("dishwasher", span, [low, high], Some(Side::Bottom), base);
            }
        }
        x += width;
    }
    let row = x;
    // Wall cupboards over part of the row; some open upwards.
    let mut upper_x = 0.1;
    while upper_x + 0.5 < row - 0.3 {
        let width = [0.4, 0.5][rng.random_range(0..2)];
        let (span, z) = ([upper_x, upper_x + width], [1.38, 2.02]);
        let side = [Side::Left, Side::Right, Side::Top][rng.random_range(0..3)];
        b.wall_cupboard(span, z, side);
        upper_x += width;
    }
    // The fridge at the end of the row: a freezer door below, the fridge door above.
    let span = [row, row + 0.6];
    for (z, side) in [([0.1, 0.72], rng.random_bool(0.5)), ([0.72, 1.95], rng.random_bool(0.5))] {
        b.carcass(span, z, 3);
        b.part("fridge", span, z, Some(if side { Side::Left } else { Side::Right }), [span, [0.0, DEPTH], z]);
    }
    // A sideboard across the room, turned against it: nothing about it follows the room's directions.
    b.sideboard(rng);
    // Worktop, plinth, wall, floor, and a few things on the worktop.
    let far = [-1.5, row + 2.1];
    for (bounds, color) in [
        ([[0.0, row], [0.0, DEPTH + 0.03], [high, high + 0.04]], [70, 66, 64]),
        ([[0.0, row + 0.6], [0.0, DEPTH - 0.05], [0.0, low]], [60, 60, 62]),
        ([far, [-0.05, 0.0], [0.0, 2.6]], [206, 204, 196]),
        ([far, [-0.05, 5.0], [-0.05, 0.0]], [150, 146, 140]),
    ] {
        let block = b.block(bounds, color, 0);
        b.fixed.push(block);
    }
    for _ in 0..4 {
        let (px, py) = (rng.random_range(0.1..row - 0.2), rng.random_range(0.1..0.35));
        let (w, h) = (rng.random_range(0.04..0.1), rng.random_range(0.08..0.28));
        let color = [rng.random_range(60..220u8), rng.random_range(60..220u8), rng.random_range(60..220u8)];
        let block = b.block([[px, px + w], [py, py + w], [high + 0.04, high + 0.04 + h]], color, 0);
        b.fixed.push(block);
    }
    Kitchen { fixed: b.fixed, parts: b.parts }
}

impl Builder {
    /// A low cupboard and a drawer side by side, standing free, turned by 15 to 75 degrees.
    fn sideboard(&mut self, rng: &mut Pcg64Mcg) {
        let here = self.world_from_kitchen;
        let turn = rotation(&Vector::z(), rng.random_range(0.26..1.3));
        self.world_from_kitchen = here * Pose::from_parts(Vector::new(-1.4, 2.4, 0.0).into(), turn);
        let (left, right, z) = ([0.0, 0.5], [0.5, 1.0], [0.08, 0.6]);
        let base = |span: [f64; 2]| [span, [0.0, DEPTH], z];
        let side = if rng.random_bool(0.5) { Side::Left } else { Side::Right };
        self.carcass(left, z, 2);
        self.part("cupboard", left, z, Some(side), base(left));
        self.carcass(right, z, 1);
        self.part("drawer", right, z, None, base(right));
        self.world_from_kitchen = here;
    }

    /// A shallow cupboard on the wall whose front is in the plane of its own carcass.
    fn wall_cupboard(&mut self, x: [f64; 2], z: [f64; 2], side: Side) {
        // Wall furniture is 0.35 m deep; shifting the frame keeps all fronts built by one rule.
        let shift = Pose::translation(0.0, 0.35 - DEPTH, 0.0);
        let here = self.world_from_kitchen;
        self.world_from_kitchen = here * shift;
        let wood = [214, 210, 202];
        let y = [DEPTH - 0.35, DEPTH];
        for bounds in [
            [[x[0], x[0] + BOARD], y, z],
            [[x[1] - BOARD, x[1]], y, z],
            [[x[0] + BOARD, x[1] - BOARD], y, [z[0], z[0] + BOARD]],
            [[x[0] + BOARD, x[1] - BOARD], y, [z[1] - BOARD, z[1]]],
            [[x[0] + BOARD, x[1] - BOARD], [y[0], y[0] + BOARD], [z[0] + BOARD, z[1] - BOARD]],
        ] {
            let block = self.block(bounds, wood, 2);
            self.fixed.push(block);
        }
        self.part("cupboard", x, z, Some(side), [x, y, z]);
        self.world_from_kitchen = here;
    }
}

impl Kitchen {
    /// All boxes with the parts at the given openings and the hand's boxes.
    #[must_use]
    pub fn posed(&self, openings: &[f64], hand: &[OrientedBox]) -> Vec<Block> {
        let mut blocks = self.fixed.clone();
        for (part, opening) in self.parts.iter().zip(openings) {
            let motion = part.articulation.motion(*opening);
            blocks.extend(part.blocks.iter().map(|b| Block { shape: b.shape.moved(&motion), ..*b }));
        }
        blocks.extend(hand.iter().map(|h| Block { shape: *h, color: [206, 150, 120], class: HAND_CLASS }));
        blocks
    }
}

/// A box from a point along a direction: hands and arms.
#[must_use]
pub fn limb(from: &Point, to: &Point, half_width: f64) -> OrientedBox {
    let along = crate::math::unit(&(to - from)).unwrap_or_else(Vector::z);
    let side = crate::math::any_orthogonal(&along);
    OrientedBox {
        center: from + (to - from) * 0.5,
        half: Vector::new(half_width, 0.7 * half_width, 0.5 * (to - from).norm()),
        rotation: Matrix3::from_columns(&[side, along.cross(&side), along]),
    }
}
