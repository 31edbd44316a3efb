//! The benchmark's kitchens: fitted furniture in an L, with every kind of part that opens.

use rand::RngExt;
use rand_pcg::Pcg64Mcg;

use super::kitchen::{
    BOARD, BoxBounds, DEPTH, FLOOR, FRONTS, GAP, HANDLE, HingeEdge, Kitchen, KitchenBuilder, Moving, PLINTH, STEEL,
    STONE, TRAY, WALL, bar, grip, hinge_line, rail, tray,
};
use crate::articulation::JointKind;
use crate::math::{Point, Pose, Vector, rotation};

/// Mask classes from 1.
const CLASSES: [&str; 8] = ["drawer", "cupboard", "fridge", "dishwasher", "oven", "microwave", "bin", "chest"];

/// Bottom and top of base furniture.
const BASE_Z: [f64; 2] = [0.1, 0.82];
/// Top of the worktop.
const WORKTOP_Z: f64 = 0.86;
/// Bottom and top of wall cupboards.
const WALL_Z: [f64; 2] = [1.38, 2.02];
/// Depth of wall cupboards.
const WALL_DEPTH: f64 = 0.35;
/// From the corner of the L to the first front of a row: a door that is opened past a right angle, with its handle, does
/// not meet the other row.
const CORNER: f64 = 0.9;
/// Surface of base fronts.
const FACE: f64 = DEPTH + BOARD + GAP;
/// How far parts open at most: doors, bottom-hinged doors, flaps, lids, drawers.
const DOOR_RAD: f64 = 1.85;
const DROP_RAD: f64 = 1.5;
const FLAP_RAD: f64 = 1.5;
const LID_RAD: f64 = 1.4;
const DRAWER_M: f64 = 0.46;
/// Share of kitchens with raised frames on their fronts, and of fronts with a dark stripe.
const SHAKER: f64 = 0.45;
const STRIPED: f64 = 0.3;
/// Colours.
pub(super) const GLASS: [u8; 3] = [26, 28, 32];
pub(super) const STRIPE: [u8; 3] = [66, 58, 50];
pub(super) const TILE: [u8; 3] = [216, 214, 206];
const WHITE: [u8; 3] = [228, 228, 226];

/// A hinged front and where it sits.
struct HingedFront {
    kind: &'static str,
    noun: &'static str,
    class: &'static str,
    /// The opening that it covers.
    x: [f64; 2],
    z: [f64; 2],
    /// Its surface.
    face: f64,
    side: HingeEdge,
    color: [u8; 3],
    /// It may carry a raised frame and a stripe.
    wooden: bool,
    /// It has a window.
    window: bool,
    base: BoxBounds,
}

struct Fitter<'a> {
    b: KitchenBuilder,
    rng: &'a mut Pcg64Mcg,
    shaker: bool,
}

fn class(name: &str) -> u8 {
    CLASSES.iter().position(|c| *c == name).map_or(0, |i| i as u8 + 1)
}

/// Half a gap off each side.
fn inset(span: [f64; 2]) -> [f64; 2] {
    [span[0] + 0.5 * GAP, span[1] - 0.5 * GAP]
}

fn middle(span: [f64; 2]) -> f64 {
    0.5 * (span[0] + span[1])
}

/// Builds a kitchen; `turned_rad`: by how much its furniture is turned against the room. The same draws make the same
/// kitchen, turned or not.
#[must_use]
pub fn build(rng: &mut Pcg64Mcg, turned_rad: Option<[f64; 2]>) -> Kitchen {
    let yaw = rng.random_range(-3.1..3.1);
    let place = Vector::new(rng.random_range(-3.0..3.0), rng.random_range(-3.0..3.0), rng.random_range(-0.5..0.5));
    let share: f64 = rng.random();
    let sign = if rng.random_bool(0.5) { 1.0 } else { -1.0 };
    let turn = turned_rad.map_or(0.0, |[low, high]| sign * (low + (high - low) * share));
    let world_from_room = Pose::from_parts(place.into(), rotation(&Vector::z(), yaw));
    let world_from_kitchen = world_from_room * turned(turn);
    let front = FRONTS[rng.random_range(0..FRONTS.len())];
    let shaker = rng.random_bool(SHAKER);
    let b = KitchenBuilder { world_from_kitchen, fixed: Vec::new(), parts: Vec::new(), front };
    let mut fitter = Fitter { b, rng, shaker };
    let end = fitter.long_row();
    fitter.bin(end + 0.35);
    fitter.short_row(&world_from_kitchen);
    let mut b = fitter.b;
    b.world_from_kitchen = world_from_room;
    room(&mut b);
    Kitchen { fixed: b.fixed, parts: b.parts, classes: &CLASSES }
}

fn turned(angle: f64) -> Pose {
    Pose::from_parts(Vector::zeros().into(), rotation(&Vector::z(), angle))
}

/// Walls just behind the furniture, and the floor with its boards.
fn room(b: &mut KitchenBuilder) {
    const FAR: f64 = 8.0;
    let room_from_world = b.world_from_kitchen.inverse();
    let shapes = b.fixed.iter().map(|block| block.shape).chain(b.parts.iter().map(|p| p.bounds));
    let corners = shapes.flat_map(|shape| shape.corners()).map(|c| room_from_world * c);
    let (x, y) = corners.fold((0.0f64, 0.0f64), |(x, y), c| (x.min(c.x), y.min(c.y)));
    let (x, y) = (x - 0.01, y - 0.01);
    b.fix([[x, FAR], [y - 0.05, y], [0.0, 2.6]], WALL, 0);
    b.fix([[x - 0.05, x], [y, FAR], [0.0, 2.6]], WALL, 0);
    b.fix([[x - 0.05, FAR], [y - 0.05, FAR], [-0.05, 0.0]], FLOOR, 0);
    for i in 1..6 {
        let at = y + 0.9 * f64::from(i);
        b.fix([[x, FAR], [at, at + 0.006], [0.0, 0.001]], STRIPE, 0);
    }
}

impl Fitter<'_> {
    /// The row along the first wall; returns where it ends.
    fn long_row(&mut self) -> f64 {
        let mut units = [0u8, 1, 2, 3, 4];
        for i in (1..units.len()).rev() {
            units.swap(i, self.rng.random_range(0..=i));
        }
        let mut x = CORNER;
        for unit in units {
            let width = match unit {
                0 | 1 => self.width(),
                2 => 0.8,
                _ => 0.6,
            };
            let span = [x, x + width];
            match unit {
                0 => self.drawers(span),
                1 => self.base_door(span),
                2 => self.double_door(span),
                3 => self.oven(span),
                _ => self.dishwasher(span),
            }
            x += width;
        }
        let low_end = x;
        self.fridge([x, x + 0.6]);
        let end = x + 0.6;
        self.wall_cupboards(CORNER, low_end - 0.05, false);
        // The microwave stands somewhere on the worktop, away from the fridge and from the corner.
        let microwave = self.rng.random_range(CORNER + 0.1..low_end - 0.8);
        self.microwave(microwave);
        for _ in 0..5 {
            let (px, py) = (self.rng.random_range(CORNER..low_end - 0.2), self.rng.random_range(0.1..0.35));
            let (w, h) = (self.rng.random_range(0.04..0.1), self.rng.random_range(0.08..0.28));
            let color =
                [self.rng.random_range(60..220u8), self.rng.random_range(60..220u8), self.rng.random_range(60..220u8)];
            // Nothing stands beside the microwave, where its door turns.
            if px + w < microwave - 0.05 || px > microwave + 0.7 {
                self.b.fix([[px, px + w], [py, py + w], [WORKTOP_Z, WORKTOP_Z + h]], color, 0);
            }
        }
        let b = &mut self.b;
        b.fix([[0.0, low_end], [0.0, DEPTH + 0.03], [BASE_Z[1], WORKTOP_Z]], STONE, 0);
        b.fix([[DEPTH, end], [0.0, DEPTH - 0.05], [0.0, BASE_Z[0]]], PLINTH, 0);
        b.fix([[FACE, CORNER - GAP], [DEPTH, FACE], BASE_Z], b.front, 0);
        self.tiles([0.0, low_end]);
        end
    }

    /// The row along the second wall, at a right angle: the person looks along -x of the kitchen.
    fn short_row(&mut self, world_from_kitchen: &Pose) {
        let widths = [0.5, self.width(), self.width(), 1.1];
        let length: f64 = widths.iter().sum();
        let corner_y = CORNER + length;
        let quarter = rotation(&Vector::z(), -std::f64::consts::FRAC_PI_2);
        self.b.world_from_kitchen =
            world_from_kitchen * Pose::from_parts(Vector::new(0.0, corner_y, 0.0).into(), quarter);
        let pantry = [0.0, widths[0]];
        self.pantry(pantry);
        let mut units = [0u8, 1, 2];
        for i in (1..units.len()).rev() {
            units.swap(i, self.rng.random_range(0..=i));
        }
        let mut x = pantry[1];
        for unit in units {
            let width = widths[1 + usize::from(unit)];
            let span = [x, x + width];
            match unit {
                0 => self.drawers(span),
                1 => self.base_door(span),
                _ => self.sliding(span),
            }
            x += width;
        }
        self.wall_cupboards(pantry[1] + 0.05, length, true);
        self.chest([-1.05, -0.35]);
        // Up to the other row's worktop.
        let meet = corner_y - DEPTH - 0.03;
        let b = &mut self.b;
        b.fix([[pantry[1], meet], [0.0, DEPTH + 0.03], [BASE_Z[1], WORKTOP_Z]], STONE, 0);
        b.fix([[0.0, corner_y - DEPTH], [0.0, DEPTH - 0.05], [0.0, BASE_Z[0]]], PLINTH, 0);
        b.fix([[length + GAP, corner_y - FACE], [DEPTH, FACE], BASE_Z], b.front, 0);
        self.tiles([pantry[1], meet]);
    }

    fn width(&mut self) -> f64 {
        [0.4, 0.5, 0.6][self.rng.random_range(0..3)]
    }

    fn side(&mut self) -> HingeEdge {
        if self.rng.random_bool(0.5) { HingeEdge::Left } else { HingeEdge::Right }
    }

    /// Three or four drawers, one over the other.
    fn drawers(&mut self, x: [f64; 2]) {
        let heights: &[f64] = if self.rng.random_bool(0.5) { &[0.16, 0.24, 0.32] } else { &[0.14, 0.16, 0.2, 0.22] };
        self.b.carcass(x, [0.0, DEPTH], BASE_Z, class("drawer"));
        let mut top = BASE_Z[1];
        for height in heights {
            self.drawer(x, [top - height, top]);
            top -= height;
        }
    }

    fn drawer(&mut self, x: [f64; 2], z: [f64; 2]) {
        let (fx, fz) = (inset(x), inset(z));
        let mut boxes = vec![([fx, [FACE - BOARD, FACE], fz], self.b.front)];
        boxes.extend(self.ornaments(fx, fz, FACE));
        boxes.extend(tray(x, z, FACE).map(|b| (b, TRAY)));
        let (hx, hz) = (middle(fx), if fz[1] - fz[0] > 0.25 { fz[1] - 0.06 } else { middle(fz) });
        boxes.push((bar(hx, hz, FACE, false), HANDLE));
        self.b.add(Moving {
            kind: "drawer",
            noun: "drawer",
            class: class("drawer"),
            boxes,
            joint: JointKind::Prismatic,
            axis: Vector::y(),
            origin: Point::new(hx, FACE, middle(fz)),
            upper: DRAWER_M,
            handle: Point::new(hx, FACE + 0.035, hz),
            handle_along: Vector::x(),
            base: [x, [0.0, DEPTH], z],
        });
    }

    fn base_door(&mut self, x: [f64; 2]) {
        let side = self.side();
        let base = [x, [0.0, DEPTH], BASE_Z];
        self.b.carcass(x, [0.0, DEPTH], BASE_Z, class("cupboard"));
        self.cupboard_door(x, BASE_Z, FACE, side, base);
    }

    /// Two leaves that meet in the middle.
    fn double_door(&mut self, x: [f64; 2]) {
        let base = [x, [0.0, DEPTH], BASE_Z];
        self.b.carcass(x, [0.0, DEPTH], BASE_Z, class("cupboard"));
        self.cupboard_door([x[0], middle(x)], BASE_Z, FACE, HingeEdge::Right, base);
        self.cupboard_door([middle(x), x[1]], BASE_Z, FACE, HingeEdge::Left, base);
    }

    fn cupboard_door(&mut self, x: [f64; 2], z: [f64; 2], face: f64, side: HingeEdge, base: BoxBounds) {
        let kind = if side == HingeEdge::Top { "flap" } else { "door" };
        let color = self.b.front;
        let (noun, class) = ("cupboard", "cupboard");
        self.front(&HingedFront { kind, noun, class, x, z, face, side, color, wooden: true, window: false, base });
    }

    fn pantry(&mut self, x: [f64; 2]) {
        let (z, side, color) = ([BASE_Z[0], 2.02], self.side(), self.b.front);
        let base = [x, [0.0, DEPTH], z];
        self.b.carcass(x, [0.0, DEPTH], z, class("cupboard"));
        let (kind, noun, class) = ("pantry", "pantry", "cupboard");
        self.front(&HingedFront {
            kind,
            noun,
            class,
            x,
            z,
            face: FACE,
            side,
            color,
            wooden: true,
            window: false,
            base,
        });
    }

    /// A freezer's door below, the fridge's above, hinged on one side.
    fn fridge(&mut self, x: [f64; 2]) {
        let (side, color) = (self.side(), if self.rng.random_bool(0.5) { WHITE } else { STEEL });
        let (kind, noun, class_name) = ("fridge", "fridge", "fridge");
        for z in [[0.1, 0.72], [0.72, 1.95]] {
            let base = [x, [0.0, DEPTH], z];
            self.b.carcass(x, [0.0, DEPTH], z, class(class_name));
            let (class, face) = (class_name, FACE);
            self.front(&HingedFront { kind, noun, class, x, z, face, side, color, wooden: false, window: false, base });
        }
    }

    /// An oven over a drawer.
    fn oven(&mut self, x: [f64; 2]) {
        let split = 0.24;
        let low = [BASE_Z[0], split];
        self.b.carcass(x, [0.0, DEPTH], low, class("drawer"));
        self.drawer(x, low);
        let z = [split, BASE_Z[1]];
        let base = [x, [0.0, DEPTH], z];
        self.b.carcass(x, [0.0, DEPTH], z, class("oven"));
        let (kind, noun, class, side) = ("oven", "oven", "oven", HingeEdge::Bottom);
        let (face, color) = (FACE, STEEL);
        self.front(&HingedFront { kind, noun, class, x, z, face, side, color, wooden: false, window: true, base });
    }

    fn dishwasher(&mut self, x: [f64; 2]) {
        let (z, base) = (BASE_Z, [x, [0.0, DEPTH], BASE_Z]);
        self.b.carcass(x, [0.0, DEPTH], z, class("dishwasher"));
        let color = if self.rng.random_bool(0.5) { STEEL } else { self.b.front };
        let (kind, noun, class, side) = ("dishwasher", "dishwasher", "dishwasher", HingeEdge::Bottom);
        self.front(&HingedFront {
            kind,
            noun,
            class,
            x,
            z,
            face: FACE,
            side,
            color,
            wooden: false,
            window: false,
            base,
        });
    }

    /// A row of cupboards on the wall. `flap`: the first one opens upwards; of the others every fifth does.
    fn wall_cupboards(&mut self, from: f64, to: f64, flap: bool) {
        let (mut x, mut first) = (from, flap);
        loop {
            let span = [x, x + self.width()];
            if span[1] > to {
                return;
            }
            let draw = self.rng.random_range(0..5);
            let split = self.rng.random_bool(0.5);
            let base = |z: [f64; 2]| [span, [0.0, WALL_DEPTH], z];
            let face = WALL_DEPTH + BOARD + GAP;
            self.b.carcass(span, [0.0, WALL_DEPTH], WALL_Z, class("cupboard"));
            match (first || draw == 4, split) {
                (true, true) => {
                    for z in [[WALL_Z[0], middle(WALL_Z)], [middle(WALL_Z), WALL_Z[1]]] {
                        self.cupboard_door(span, z, face, HingeEdge::Top, base(z));
                    }
                }
                (true, false) => self.cupboard_door(span, WALL_Z, face, HingeEdge::Top, base(WALL_Z)),
                (false, _) => {
                    let side = if draw < 2 { HingeEdge::Left } else { HingeEdge::Right };
                    self.cupboard_door(span, WALL_Z, face, side, base(WALL_Z));
                }
            }
            first = false;
            x = span[1];
        }
    }

    fn microwave(&mut self, x: f64) {
        let (z, y) = ([WORKTOP_Z + 0.002, 1.14], [0.06, 0.4]);
        let (panel, door) = ([x, x + 0.11], [x + 0.11, x + 0.46]);
        let face = y[1] + BOARD + GAP;
        let class_number = class("microwave");
        self.b.carcass([x, x + 0.46], y, z, class_number);
        self.b.fix([inset(panel), [y[1], face], inset(z)], GLASS, class_number);
        let (kind, noun, class, side) = ("microwave", "microwave", "microwave", HingeEdge::Left);
        let base = [[x, x + 0.46], y, z];
        self.front(&HingedFront {
            kind,
            noun,
            class,
            x: door,
            z,
            face,
            side,
            color: STEEL,
            wooden: false,
            window: true,
            base,
        });
    }

    /// A front that turns, with its handle.
    fn front(&mut self, f: &HingedFront) {
        let (fx, fz) = (inset(f.x), inset(f.z));
        let mut boxes = vec![([fx, [f.face - BOARD, f.face], fz], f.color)];
        if f.wooden {
            boxes.extend(self.ornaments(fx, fz, f.face));
        }
        if f.window {
            let margin = 0.25 * (fz[1] - fz[0]);
            let window = [fx[0] + 0.08, fx[1] - 0.06];
            boxes.push(([window, [f.face, f.face + 0.003], [fz[0] + margin, fz[1] - margin]], GLASS));
        }
        let (hx, hz, upright) = grip(f.side, fx, fz);
        boxes.push((bar(hx, hz, f.face, upright), HANDLE));
        let (axis, origin) = hinge_line(f.side, fx, fz, f.face);
        let upper = match f.side {
            HingeEdge::Left | HingeEdge::Right => DOOR_RAD,
            HingeEdge::Bottom => DROP_RAD,
            HingeEdge::Top => FLAP_RAD,
        };
        self.b.add(Moving {
            kind: f.kind,
            noun: f.noun,
            class: class(f.class),
            boxes,
            joint: JointKind::Revolute,
            axis,
            origin,
            upper,
            handle: Point::new(hx, f.face + 0.035, hz),
            handle_along: if upright { Vector::z() } else { Vector::x() },
            base: f.base,
        });
    }

    /// Two leaves in two planes, 2 cm of air between them; each slides behind or before the other.
    fn sliding(&mut self, x: [f64; 2]) {
        // What the leaves overlap when closed, and what the rear one leaves free in its frame.
        const OVERLAP: f64 = 0.02;
        const AIR: f64 = 0.02;
        const PLAY: f64 = 0.002;
        // The grips are flat enough to pass between the leaves.
        const GRIP: f64 = 0.014;
        let base = [x, [0.0, DEPTH], BASE_Z];
        self.b.carcass(x, [0.0, DEPTH], BASE_Z, class("cupboard"));
        let front_is_first = self.rng.random_bool(0.5);
        let half = 0.5 * (x[1] - x[0]);
        for first in [true, false] {
            let (face, rim) =
                if first == front_is_first { (FACE, 0.5 * GAP) } else { (FACE - BOARD - AIR, BOARD + PLAY) };
            let fx = if first { [x[0] + rim, middle(x) + OVERLAP] } else { [middle(x) - OVERLAP, x[1] - rim] };
            let fz = [BASE_Z[0] + rim, BASE_Z[1] - rim];
            let hx = if first { fx[0] + 0.045 } else { fx[1] - 0.045 };
            let (hz, thin) = (BASE_Z[1] - 0.2, 0.012);
            let boxes = vec![
                ([fx, [face - BOARD, face], fz], self.b.front),
                ([[hx - thin, hx + thin], [face, face + GRIP], [hz - 0.06, hz + 0.06]], HANDLE),
            ];
            self.b.add(Moving {
                kind: "sliding door",
                noun: "sliding door",
                class: class("cupboard"),
                boxes,
                joint: JointKind::Prismatic,
                axis: if first { Vector::x() } else { -Vector::x() },
                origin: Point::new(middle(fx), face, middle(fz)),
                // The grip stays in sight.
                upper: half - 0.1,
                handle: Point::new(hx, face + GRIP, hz),
                handle_along: Vector::z(),
                base,
            });
        }
    }

    fn chest(&mut self, x: [f64; 2]) {
        let color = self.b.front;
        self.lidded("chest", x, [0.02, 0.47], 0.5, color);
    }

    fn bin(&mut self, x: f64) {
        self.lidded("bin", [x, x + 0.3], [0.05, 0.37], 0.62, STEEL);
    }

    /// A box, open at the top, under a lid with its hinge at the back.
    fn lidded(&mut self, noun: &'static str, x: [f64; 2], y: [f64; 2], height: f64, color: [u8; 3]) {
        let class = class(noun);
        let (z, lid) = ([0.0, height], [height + GAP, height + GAP + BOARD]);
        let inner = [x[0] + BOARD, x[1] - BOARD];
        for bounds in [
            [[x[0], x[0] + BOARD], y, z],
            [[x[1] - BOARD, x[1]], y, z],
            [inner, [y[0], y[0] + BOARD], z],
            [inner, [y[1] - BOARD, y[1]], z],
            [inner, [y[0] + BOARD, y[1] - BOARD], [0.0, BOARD]],
        ] {
            self.b.fix(bounds, color, class);
        }
        let (hx, hz) = (middle(x), middle(lid));
        let rim = [y[1], y[1] + 0.03];
        self.b.add(Moving {
            kind: "lid",
            noun,
            class,
            boxes: vec![([x, y, lid], color), ([[hx - 0.07, hx + 0.07], rim, [hz - 0.006, hz + 0.006]], HANDLE)],
            joint: JointKind::Revolute,
            axis: Vector::x(),
            origin: Point::new(hx, y[0], lid[1]),
            upper: LID_RAD,
            handle: Point::new(hx, rim[1] - 0.005, hz),
            handle_along: Vector::x(),
            base: [x, y, z],
        });
    }

    /// The raised frame and the stripe of a wooden front.
    fn ornaments(&mut self, fx: [f64; 2], fz: [f64; 2], face: f64) -> Vec<(BoxBounds, [u8; 3])> {
        // The frame keeps off the edge, so that it turns past its neighbour's.
        const EDGE: f64 = 0.008;
        let color = rail(self.b.front);
        let (x, z) = ([fx[0] + EDGE, fx[1] - EDGE], [fz[0] + EDGE, fz[1] - EDGE]);
        let rail = (0.2 * (z[1] - z[0])).min(0.06);
        let raised = [face, face + 0.006];
        let mut boxes = Vec::new();
        if self.shaker {
            boxes.extend([
                ([[x[0], x[0] + rail], raised, z], color),
                ([[x[1] - rail, x[1]], raised, z], color),
                ([[x[0] + rail, x[1] - rail], raised, [z[0], z[0] + rail]], color),
                ([[x[0] + rail, x[1] - rail], raised, [z[1] - rail, z[1]]], color),
            ]);
        }
        let (striped, at) = (self.rng.random_bool(STRIPED), self.rng.random_range(0.3..0.7));
        if striped {
            let thin = [face, face + 0.001];
            let about = |span: [f64; 2]| {
                let here = span[0] + at * (span[1] - span[0]);
                [here - 0.002, here + 0.002]
            };
            let upright = z[1] - z[0] > x[1] - x[0];
            boxes.push((if upright { [about(x), thin, z] } else { [x, thin, about(z)] }, STRIPE));
        }
        boxes
    }

    /// A tiled panel between worktop and wall cupboards.
    fn tiles(&mut self, x: [f64; 2]) {
        const SIZE: f64 = 0.3;
        let z = [WORKTOP_Z, WALL_Z[0]];
        self.b.fix([x, [-0.01, 0.0], z], TILE, 0);
        let joint = [0.0, 0.001];
        let middle_z = middle(z);
        self.b.fix([x, joint, [middle_z, middle_z + 0.004]], STRIPE, 0);
        let count = ((x[1] - x[0]) / SIZE) as usize;
        for i in 1..=count {
            let at = x[0] + SIZE * i as f64;
            self.b.fix([[at - 0.004, at], joint, z], STRIPE, 0);
        }
    }
}
