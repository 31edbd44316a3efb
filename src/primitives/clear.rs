//! How far a gripper is turned about the bar that it holds, so that it meets nothing.
//!
//! Fingers can stand at any angle around a bar. A gripper that keeps straight at the face goes under an oven's door, where
//! there is a floor, and between a lid and the wall behind it.

use nalgebra::{Translation3, UnitQuaternion};

use super::grasp::{Contact, STANDOFF_M, pose};
use crate::articulation::JointKind;
use crate::math::{Point, Pose, Vector};
use crate::twin::{OrientedBox, Role, Twin};

/// A common parallel gripper, gripper's axes, metres: centre and half sizes of its palm, half sizes of a finger, and how far
/// a finger's middle is behind the fingertips' middle.
const PALM: [[f64; 3]; 2] = [[0.0, 0.0, -0.065], [0.05, 0.02, 0.02]];
const FINGER: [f64; 3] = [0.005, 0.010, 0.030];
const FINGER_BACK_M: f64 = 0.015;
/// Everything of the gripper is within this of the fingertips' middle, metres.
const REACH_M: f64 = 0.13;
/// Kept free around what is not the part, metres: half of how far the samples of a palm are apart, and of what furniture's
/// place is known to.
const FREE_M: f64 = 0.015;
/// Kept free between the gripper and the part that it holds, whose place it knows, metres.
const OWN_FREE_M: f64 = 0.002;
/// Without a handle's size: fingers that hold something thin, metres.
const THIN_M: f64 = 0.02;
/// Turns that are tried, degrees: of the closed part with open fingers, of which one is between bar and front; then of the
/// open part. Farther, a palm would be in the front.
const CLOSED_DEG: [f64; 5] = [0.0, 15.0, -15.0, 30.0, -30.0];
const OPEN_DEG: [f64; 7] = [0.0, 30.0, -30.0, 60.0, -60.0, 75.0, -75.0];
/// Places on the way to the part, and with it, that are looked at.
const APPROACH: usize = 5;
const WAY: usize = 13;

/// Boxes, a little larger than they are.
struct Obstacles(Vec<OrientedBox>);

impl Obstacles {
    fn of<'a>(boxes: impl Iterator<Item = &'a OrientedBox>, free: f64) -> Self {
        Self(boxes.map(|b| OrientedBox { half: b.half.map(|h| h + free), ..*b }).collect())
    }

    /// How many points of a gripper at a pose are inside of them.
    fn hits(&self, gripper: &[Point], at: &Pose) -> usize {
        let middle = Point::from(at.translation.vector);
        let near: Vec<&OrientedBox> =
            self.0.iter().filter(|b| (b.center - middle).norm() < b.half.norm() + REACH_M).collect();
        if near.is_empty() {
            return 0;
        }
        gripper.iter().map(|p| at * p).filter(|p| near.iter().any(|b| b.contains(p))).count()
    }
}

/// Points of a box at even steps along its axes.
fn samples(center: [f64; 3], half: [f64; 3], counts: [usize; 3]) -> Vec<Point> {
    let at = |axis: usize, i: usize| {
        let share = i as f64 / (counts[axis] - 1) as f64;
        center[axis] + half[axis] * (2.0 * share - 1.0)
    };
    let mut points = Vec::new();
    for i in 0..counts[0] {
        for j in 0..counts[1] {
            points.extend((0..counts[2]).map(|k| Point::new(at(0, i), at(1, j), at(2, k))));
        }
    }
    points
}

/// A gripper whose fingertips are a width apart, in its own axes.
fn gripper(width: f64) -> Vec<Point> {
    let mut points = samples(PALM[0], PALM[1], [5, 3, 3]);
    for side in [-1.0, 1.0] {
        points.extend(samples([side * (0.5 * width + FINGER[0]), 0.0, -FINGER_BACK_M], FINGER, [2, 2, 4]));
    }
    points
}

/// A turn about the bar, which is the gripper's y, rad.
pub(super) fn turn(angle: f64) -> UnitQuaternion<f64> {
    UnitQuaternion::from_axis_angle(&Vector::y_axis(), angle)
}

/// The turns about the bar, rad, of a gripper that would come as the contact says: when the part is closed, and when it is
/// open. The least with which the gripper meets no other furniture, no box of the room and not the part itself; where there
/// is none, those with which it meets least. A slide is held the same all the way. All other furniture is closed.
pub(super) fn tilt(twin: &Twin, index: usize, contact: &Contact) -> [f64; 2] {
    let Some(furniture) = twin.furniture.get(index) else { return [0.0; 2] };
    let part = &furniture.part;
    let others = twin.furniture.iter().enumerate().filter(|(i, _)| *i != index).flat_map(|(_, f)| &f.part.solids);
    let fixed = twin.furniture.iter().flat_map(|f| &f.carcass).chain(&twin.room);
    let around = Obstacles::of(fixed.chain(others).map(|s| &s.shape), FREE_M);
    let own = Obstacles::of(part.solids.iter().filter(|s| s.role != Role::Handle).map(|s| &s.shape), OWN_FREE_M);
    let (open, holding) = (gripper(contact.gripper_opening_m), gripper(contact.width_m.unwrap_or(THIN_M)));
    let (phi, upper) = (part.joint.articulation, part.joint.upper);
    let grasp = pose(contact);
    let hits = |[closed_at, open_at]: [f64; 2]| {
        let mut count = 0;
        let held = grasp * turn(closed_at);
        for i in 0..APPROACH {
            let back = STANDOFF_M * (1.0 - i as f64 / (APPROACH - 1) as f64);
            let at = held * Translation3::new(0.0, 0.0, -back);
            count += around.hits(&open, &at) + own.hits(&open, &at);
        }
        for i in 0..WAY {
            let share = i as f64 / (WAY - 1) as f64;
            let at = grasp * turn(closed_at + (open_at - closed_at) * share);
            // The part goes with the gripper.
            count += own.hits(&holding, &at) + around.hits(&holding, &(phi.motion(share * upper) * at));
        }
        count
    };
    let mut best = ([0.0; 2], usize::MAX);
    for turns in turns(phi.kind) {
        let count = hits(turns);
        if count < best.1 {
            best = (turns, count);
        }
        if count == 0 {
            break;
        }
    }
    best.0
}

/// The turns that are tried, rad: the least first, that of the closed part counting twice, as the handle must be found so.
fn turns(kind: JointKind) -> Vec<[f64; 2]> {
    let mut all: Vec<[f64; 2]> = match kind {
        JointKind::Prismatic => CLOSED_DEG.iter().map(|a| [*a, *a]).collect(),
        JointKind::Revolute => CLOSED_DEG.iter().flat_map(|a| OPEN_DEG.iter().map(move |b| [*a, *b])).collect(),
    };
    let size = |turns: &[f64; 2]| 2.0 * turns[0].abs() + turns[1].abs();
    all.sort_by(|a, b| size(a).total_cmp(&size(b)));
    all.into_iter().map(|turns| turns.map(f64::to_radians)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::articulation::Articulation;
    use crate::primitives::grasp;
    use crate::primitives::tests::{door, twin_of};
    use crate::twin::Solid;

    fn slab(name: &str, center: Point, half: Vector) -> Solid {
        let shape = OrientedBox { center, half, rotation: nalgebra::Matrix3::identity() };
        Solid { name: name.to_owned(), role: Role::Room, shape, seen: true }
    }

    #[test]
    fn where_the_way_is_free_a_gripper_comes_straight() {
        let twin = twin_of(vec![door()]);
        assert_eq!(tilt(&twin, 0, &grasp::contact(&twin.furniture[0].part)), [0.0; 2]);
    }

    #[test]
    fn a_gripper_gives_way_to_the_floor_under_a_door_that_falls_open() {
        let mut part = door();
        // Hinged below, its level bar near the upper edge: open, the bar is 10 cm over a floor, and a gripper that kept straight
        // would be in it.
        let hinge = Point::new(0.25, 0.0, 0.1);
        part.joint.articulation = Articulation { kind: JointKind::Revolute, axis: Vector::x(), origin: hinge };
        part.joint.upper = std::f64::consts::FRAC_PI_2;
        part.handle = Point::new(0.25, -0.035, 0.85);
        part.solids[1].shape.center = part.handle;
        part.solids[1].shape.half = Vector::new(0.06, 0.006, 0.006);
        let mut twin = twin_of(vec![part]);
        let contact = grasp::contact(&twin.furniture[0].part);
        assert_eq!(tilt(&twin, 0, &contact), [0.0; 2]);
        twin.room.push(slab("room_floor", Point::new(0.0, 0.0, -0.08), Vector::new(3.0, 3.0, 0.05)));
        let [closed, open] = tilt(&twin, 0, &contact);
        assert!(closed == 0.0 && open.abs() > 0.5, "{closed} {open}");
        // It turns towards the person, who stands at -y: there is the palm of the open door's gripper.
        let phi = twin.furniture[0].part.joint.articulation;
        let held = phi.motion(twin.furniture[0].part.joint.upper) * grasp::pose(&contact) * turn(open);
        assert!((held * Point::new(0.0, 0.0, -0.065)).y < (held * Point::origin()).y - 0.02);
    }

    #[test]
    fn a_slide_is_held_the_same_all_the_way() {
        assert!(turns(JointKind::Prismatic).iter().all(|t| t[0] == t[1]));
        let hinge = turns(JointKind::Revolute);
        assert_eq!((hinge[0], hinge.len()), ([0.0; 2], CLOSED_DEG.len() * OPEN_DEG.len()));
    }
}
