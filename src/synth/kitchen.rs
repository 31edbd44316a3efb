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
pub struct ColoredBox {
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
    /// What it is: "drawer", "door", "sliding door", "flap", "lid", "oven", ...
    pub kind: &'static str,
    /// The word for its furniture.
    pub noun: &'static str,
    /// Its joint; positive opens.
    pub articulation: Articulation,
    /// Fully open, rad or m.
    pub upper: f64,
    /// Where it is held, closed.
    pub handle: Point,
    /// Along the handle's bar.
    pub handle_along: Vector,
    /// Out of the furniture.
    pub out: Vector,
    /// Box of the part, closed, handle included.
    pub bounds: OrientedBox,
    /// The furniture behind it.
    pub base: OrientedBox,
    /// Its boxes.
    pub blocks: Vec<ColoredBox>,
}

/// The whole kitchen.
#[derive(Debug, Clone)]
pub struct Kitchen {
    /// What does not move.
    pub fixed: Vec<ColoredBox>,
    /// What does.
    pub parts: Vec<OpenPart>,
    /// Names of the mask classes, from class 1.
    pub classes: &'static [&'static str],
}

/// Thickness of boards and fronts.
pub(super) const BOARD: f64 = 0.018;
/// Free space around a front.
pub(super) const GAP: f64 = 0.003;
/// Depth of base furniture.
pub(super) const DEPTH: f64 = 0.58;
/// Body and inside of furniture.
pub(super) const WOOD: [u8; 3] = [214, 210, 202];
/// Trays of drawers.
pub(super) const TRAY: [u8; 3] = [226, 222, 214];
/// Bars of handles.
pub(super) const HANDLE: [u8; 3] = [58, 60, 64];

/// Appliances of metal.
pub(super) const STEEL: [u8; 3] = [176, 178, 182];
/// Worktops.
pub(super) const STONE: [u8; 3] = [70, 66, 64];
/// Below the furniture.
pub(super) const PLINTH: [u8; 3] = [60, 60, 62];
/// The room.
pub(super) const WALL: [u8; 3] = [206, 204, 196];
pub(super) const FLOOR: [u8; 3] = [150, 146, 140];
/// What fronts may be: oak, white, green, grey-blue, walnut.
pub(super) const FRONTS: [[u8; 3]; 5] =
    [[196, 164, 122], [226, 226, 222], [104, 128, 118], [168, 176, 186], [150, 108, 78]];

/// The colour of the raised frame of a front of a colour.
pub(super) fn rail(front: [u8; 3]) -> [u8; 3] {
    front.map(|c| c - c / 12)
}

/// Bounds of an upright box in kitchen coordinates: low and high in x, y and z.
pub(super) type BoxBounds = [[f64; 2]; 3];

/// Builds in kitchen coordinates (x along the row, y out of the wall, z up) and places the result in the world.
pub(super) struct KitchenBuilder {
    pub(super) world_from_kitchen: Pose,
    pub(super) fixed: Vec<ColoredBox>,
    pub(super) parts: Vec<OpenPart>,
    pub(super) front: [u8; 3],
}

/// A part in kitchen coordinates, closed.
pub(super) struct Moving {
    pub(super) kind: &'static str,
    pub(super) noun: &'static str,
    pub(super) class: u8,
    /// Its boxes with their colours.
    pub(super) boxes: Vec<(BoxBounds, [u8; 3])>,
    pub(super) joint: JointKind,
    pub(super) axis: Vector,
    pub(super) origin: Point,
    pub(super) upper: f64,
    pub(super) handle: Point,
    pub(super) handle_along: Vector,
    pub(super) base: BoxBounds,
}

impl KitchenBuilder {
    /// A box from its bounds in kitchen coordinates.
    pub(super) fn shape(&self, bounds: BoxBounds) -> OrientedBox {
        let middle = Point::from(bounds.map(|b| 0.5 * (b[0] + b[1])));
        OrientedBox {
            center: self.world_from_kitchen * middle,
            half: Vector::from(bounds.map(|b| 0.5 * (b[1] - b[0]))),
            rotation: *self.world_from_kitchen.rotation.to_rotation_matrix().matrix(),
        }
    }

    pub(super) fn block(&self, bounds: BoxBounds, color: [u8; 3], class: u8) -> ColoredBox {
        ColoredBox { shape: self.shape(bounds), color, class }
    }

    /// Adds a box that does not move.
    pub(super) fn fix(&mut self, bounds: BoxBounds, color: [u8; 3], class: u8) {
        let block = self.block(bounds, color, class);
        self.fixed.push(block);
    }

    /// Boards of an open box, its front towards +y.
    pub(super) fn carcass(&mut self, x: [f64; 2], y: [f64; 2], z: [f64; 2], class: u8) {
        let inner = [x[0] + BOARD, x[1] - BOARD];
        for bounds in [
            [[x[0], x[0] + BOARD], y, z],
            [[x[1] - BOARD, x[1]], y, z],
            [inner, y, [z[0], z[0] + BOARD]],
            [inner, y, [z[1] - BOARD, z[1]]],
            [inner, [y[0], y[0] + BOARD], [z[0] + BOARD, z[1] - BOARD]],
        ] {
            self.fix(bounds, WOOD, class);
        }
    }

    /// A front with its handle and joint. `hinge`: `None` slides, else the side seen from the person.
    fn part(&mut self, noun: &'static str, x: [f64; 2], z: [f64; 2], hinge: Option<HingeEdge>, base: BoxBounds) {
        let class = CLASSES.iter().position(|c| *c == noun).map_or(0, |i| i as u8 + 1);
        let face = DEPTH + BOARD + GAP;
        let (fx, fz) = ([x[0] + 0.5 * GAP, x[1] - 0.5 * GAP], [z[0] + 0.5 * GAP, z[1] - 0.5 * GAP]);
        let mut boxes = vec![([fx, [face - BOARD, face], fz], self.front)];
        let (middle_x, middle_z) = (0.5 * (fx[0] + fx[1]), 0.5 * (fz[0] + fz[1]));
        let (hx, hz, upright) = match hinge {
            Some(side) => grip(side, fx, fz),
            None => (middle_x, if fz[1] - fz[0] > 0.25 { fz[1] - 0.06 } else { middle_z }, false),
        };
        if hinge.is_none() {
            boxes.extend(tray(x, z, face).map(|b| (b, TRAY)));
        }
        boxes.push((bar(hx, hz, face, upright), HANDLE));
        let (joint, (axis, origin)) = match hinge {
            Some(side) => (JointKind::Revolute, hinge_line(side, fx, fz, face)),
            None => (JointKind::Prismatic, (Vector::y(), Point::new(middle_x, face, middle_z))),
        };
        let upper = match hinge {
            Some(HingeEdge::Bottom) => 1.4,
            Some(HingeEdge::Top) => 1.5,
            Some(_) => 1.7,
            None => 0.42,
        };
        let kind = match (noun, hinge) {
            ("cupboard", Some(HingeEdge::Top)) => "flap",
            ("cupboard", _) => "door",
            _ => noun,
        };
        let handle = Point::new(hx, face + 0.035, hz);
        let handle_along = if upright { Vector::z() } else { Vector::x() };
        self.add(Moving { kind, noun, class, boxes, joint, axis, origin, upper, handle, handle_along, base });
    }

    /// Places a part in the world.
    pub(super) fn add(&mut self, part: Moving) {
        let whole: BoxBounds = std::array::from_fn(|i| {
            [
                part.boxes.iter().map(|(b, _)| b[i][0]).fold(f64::INFINITY, f64::min),
                part.boxes.iter().map(|(b, _)| b[i][1]).fold(f64::NEG_INFINITY, f64::max),
            ]
        });
        let here = self.world_from_kitchen;
        let blocks = part.boxes.iter().map(|(b, color)| self.block(*b, *color, part.class)).collect();
        let placed = OpenPart {
            id: format!("part_{:02}", self.parts.len()),
            kind: part.kind,
            noun: part.noun,
            articulation: Articulation { kind: part.joint, axis: here * part.axis, origin: here * part.origin },
            upper: part.upper,
            handle: here * part.handle,
            handle_along: here * part.handle_along,
            out: here * Vector::y(),
            bounds: self.shape(whole),
            base: self.shape(part.base),
            blocks,
        };
        self.parts.push(placed);
    }
}

/// Side boards, bottom and back of a drawer behind its front.
pub(super) fn tray(x: [f64; 2], z: [f64; 2], face: f64) -> [BoxBounds; 4] {
    let inner = [x[0] + BOARD + 0.01, x[1] - BOARD - 0.01];
    let (low, high) = (z[0] + BOARD + 0.01, z[0] + BOARD + 0.01 + 0.6 * (z[1] - z[0]));
    let y = [0.06, face - BOARD];
    [
        [[inner[0], inner[0] + 0.012], y, [low, high]],
        [[inner[1] - 0.012, inner[1]], y, [low, high]],
        [inner, y, [low, low + 0.012]],
        [inner, [y[0], y[0] + 0.012], [low, high]],
    ]
}

/// A handle's bar on a front whose surface is at `face`.
pub(super) fn bar(hx: f64, hz: f64, face: f64, upright: bool) -> BoxBounds {
    let (bar, thin) = (0.07, 0.006);
    if upright {
        [[hx - thin, hx + thin], [face, face + 0.04], [hz - bar, hz + bar]]
    } else {
        [[hx - bar, hx + bar], [face, face + 0.04], [hz - thin, hz + thin]]
    }
}

/// Where the handle of a hinged front sits (x, z), and whether its bar is upright. The person looks along -y: their left
/// is +x.
pub(super) fn grip(side: HingeEdge, fx: [f64; 2], fz: [f64; 2]) -> (f64, f64, bool) {
    match side {
        HingeEdge::Left => (fx[0] + 0.045, handle_height(fz), true),
        HingeEdge::Right => (fx[1] - 0.045, handle_height(fz), true),
        HingeEdge::Bottom => (0.5 * (fx[0] + fx[1]), fz[1] - 0.05, false),
        HingeEdge::Top => (0.5 * (fx[0] + fx[1]), fz[0] + 0.05, false),
    }
}

/// Axis and origin of a hinged front. Hinges run along the front edge of the leaf; positive turns the free edge out (+y).
pub(super) fn hinge_line(side: HingeEdge, fx: [f64; 2], fz: [f64; 2], face: f64) -> (Vector, Point) {
    let (middle_x, middle_z) = (0.5 * (fx[0] + fx[1]), 0.5 * (fz[0] + fz[1]));
    match side {
        HingeEdge::Left => (-Vector::z(), Point::new(fx[1], face, middle_z)),
        HingeEdge::Right => (Vector::z(), Point::new(fx[0], face, middle_z)),
        HingeEdge::Bottom => (-Vector::x(), Point::new(middle_x, face, fz[0])),
        HingeEdge::Top => (Vector::x(), Point::new(middle_x, face, fz[1])),
    }
}

/// Where the hinge is, seen by the person who stands before the furniture.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum HingeEdge {
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

/// Bottom and top of base furniture, metres.
const BASE_Z: [f64; 2] = [0.1, 0.82];

/// Builds a kitchen.
#[must_use]
pub fn build(rng: &mut Pcg64Mcg) -> Kitchen {
    let yaw = rng.random_range(-3.1..3.1);
    let place = Vector::new(rng.random_range(-3.0..3.0), rng.random_range(-3.0..3.0), rng.random_range(-0.5..0.5));
    let world_from_kitchen = Pose::from_parts(place.into(), rotation(&Vector::z(), yaw));
    let front = FRONTS[rng.random_range(0..FRONTS.len())];
    let mut b = KitchenBuilder { world_from_kitchen, fixed: Vec::new(), parts: Vec::new(), front };
    let row = b.base_row(rng);
    b.wall_row(row, rng);
    // The fridge at the end of the row: a freezer door below, the fridge door above.
    let span = [row, row + 0.6];
    for (z, side) in [([0.1, 0.72], rng.random_bool(0.5)), ([0.72, 1.95], rng.random_bool(0.5))] {
        b.carcass(span, [0.0, DEPTH], z, 3);
        let side = if side { HingeEdge::Left } else { HingeEdge::Right };
        b.part("fridge", span, z, Some(side), [span, [0.0, DEPTH], z]);
    }
    // A sideboard across the room, turned against it: nothing about it follows the room's directions.
    b.sideboard(rng);
    b.surroundings(row, rng);
    Kitchen { fixed: b.fixed, parts: b.parts, classes: &CLASSES }
}

impl KitchenBuilder {
    /// Base furniture side by side from x = 0; returns where the row ends.
    fn base_row(&mut self, rng: &mut Pcg64Mcg) -> f64 {
        let [low, high] = BASE_Z;
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
                        self.carcass(span, [0.0, DEPTH], z, 1);
                        self.part("drawer", span, z, None, [span, [0.0, DEPTH], z]);
                        top -= h;
                    }
                }
                1 => {
                    self.carcass(span, [0.0, DEPTH], [low, high], 2);
                    let side = if rng.random_bool(0.5) { HingeEdge::Left } else { HingeEdge::Right };
                    self.part("cupboard", span, [low, high], Some(side), base);
                }
                _ => {
                    self.carcass(span, [0.0, DEPTH], [low, high], 4);
                    self.part("dishwasher", span, [low, high], Some(HingeEdge::Bottom), base);
                }
            }
            x += width;
        }
        x
    }

    /// Wall cupboards over part of a row that ends at `row`; some open upwards.
    fn wall_row(&mut self, row: f64, rng: &mut Pcg64Mcg) {
        let mut x = 0.1;
        while x + 0.5 < row - 0.3 {
            let width = [0.4, 0.5][rng.random_range(0..2)];
            let (span, z) = ([x, x + width], [1.38, 2.02]);
            let side = [HingeEdge::Left, HingeEdge::Right, HingeEdge::Top][rng.random_range(0..3)];
            self.wall_cupboard(span, z, side);
            x += width;
        }
    }

    /// Worktop, plinth, wall, floor, and a few things on the worktop of a row that ends at `row`.
    fn surroundings(&mut self, row: f64, rng: &mut Pcg64Mcg) {
        let [low, high] = BASE_Z;
        let far = [-1.5, row + 2.1];
        for (bounds, color) in [
            ([[0.0, row], [0.0, DEPTH + 0.03], [high, high + 0.04]], STONE),
            ([[0.0, row + 0.6], [0.0, DEPTH - 0.05], [0.0, low]], PLINTH),
            ([far, [-0.05, 0.0], [0.0, 2.6]], WALL),
            ([far, [-0.05, 5.0], [-0.05, 0.0]], FLOOR),
        ] {
            self.fix(bounds, color, 0);
        }
        for _ in 0..4 {
            let (px, py) = (rng.random_range(0.1..row - 0.2), rng.random_range(0.1..0.35));
            let (w, h) = (rng.random_range(0.04..0.1), rng.random_range(0.08..0.28));
            let color = [rng.random_range(60..220u8), rng.random_range(60..220u8), rng.random_range(60..220u8)];
            self.fix([[px, px + w], [py, py + w], [high + 0.04, high + 0.04 + h]], color, 0);
        }
    }
}

impl KitchenBuilder {
    /// A low cupboard and a drawer side by side, standing free, turned by 15 to 75 degrees.
    fn sideboard(&mut self, rng: &mut Pcg64Mcg) {
        let here = self.world_from_kitchen;
        let turn = rotation(&Vector::z(), rng.random_range(0.26..1.3));
        self.world_from_kitchen = here * Pose::from_parts(Vector::new(-1.4, 2.4, 0.0).into(), turn);
        let (left, right, z) = ([0.0, 0.5], [0.5, 1.0], [0.08, 0.6]);
        let base = |span: [f64; 2]| [span, [0.0, DEPTH], z];
        let side = if rng.random_bool(0.5) { HingeEdge::Left } else { HingeEdge::Right };
        self.carcass(left, [0.0, DEPTH], z, 2);
        self.part("cupboard", left, z, Some(side), base(left));
        self.carcass(right, [0.0, DEPTH], z, 1);
        self.part("drawer", right, z, None, base(right));
        self.world_from_kitchen = here;
    }

    /// A shallow cupboard on the wall whose front is in the plane of its own carcass.
    fn wall_cupboard(&mut self, x: [f64; 2], z: [f64; 2], side: HingeEdge) {
        // Wall furniture is 0.35 m deep; shifting the frame keeps all fronts built by one rule.
        let shift = Pose::translation(0.0, 0.35 - DEPTH, 0.0);
        let here = self.world_from_kitchen;
        self.world_from_kitchen = here * shift;
        let y = [DEPTH - 0.35, DEPTH];
        self.carcass(x, y, z, 2);
        self.part("cupboard", x, z, Some(side), [x, y, z]);
        self.world_from_kitchen = here;
    }
}

impl Kitchen {
    /// All boxes with the parts at the given openings and the hand's boxes. `swallowed`: a part whose furniture shows
    /// another mask class.
    #[must_use]
    pub fn posed(&self, openings: &[f64], hand: &[OrientedBox], swallowed: Option<(usize, u8)>) -> Vec<ColoredBox> {
        let mut blocks = self.fixed.clone();
        if let Some((part, class)) = swallowed.and_then(|(index, class)| Some((self.parts.get(index)?, class))) {
            for block in blocks.iter_mut().filter(|b| b.class != 0 && part.base.contains(&b.shape.center)) {
                block.class = class;
            }
        }
        for (index, (part, opening)) in self.parts.iter().zip(openings).enumerate() {
            let motion = part.articulation.motion(*opening);
            let class = swallowed.filter(|(swallowed, _)| *swallowed == index).map(|(_, class)| class);
            blocks.extend(part.blocks.iter().map(|b| ColoredBox {
                shape: b.shape.moved(&motion),
                class: class.unwrap_or(b.class),
                ..*b
            }));
        }
        blocks.extend(hand.iter().map(|h| ColoredBox { shape: *h, color: [206, 150, 120], class: HAND_CLASS }));
        blocks
    }

    /// The same kitchen moved as a whole.
    #[must_use]
    pub fn moved(&self, motion: &Pose) -> Self {
        let block = |b: &ColoredBox| ColoredBox { shape: b.shape.moved(motion), ..*b };
        let part = |p: &OpenPart| OpenPart {
            articulation: Articulation {
                axis: motion * p.articulation.axis,
                origin: motion * p.articulation.origin,
                ..p.articulation
            },
            handle: motion * p.handle,
            handle_along: motion * p.handle_along,
            out: motion * p.out,
            bounds: p.bounds.moved(motion),
            base: p.base.moved(motion),
            blocks: p.blocks.iter().map(block).collect(),
            ..p.clone()
        };
        Self {
            fixed: self.fixed.iter().map(block).collect(),
            parts: self.parts.iter().map(part).collect(),
            classes: self.classes,
        }
    }

    /// Whether a point has this much free space around it, everything closed.
    #[must_use]
    pub fn is_free(&self, point: &Point, margin: f64) -> bool {
        let holds = |b: &OrientedBox| OrientedBox { half: b.half.map(|h| h + margin), ..*b }.contains(point);
        !self.fixed.iter().any(|b| holds(&b.shape)) && !self.parts.iter().any(|p| holds(&p.bounds) || holds(&p.base))
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
