//! How far a gripper is turned about the bar that it holds, so that it meets nothing.
//!
//! Fingers can stand at any angle around a bar. A gripper that keeps straight at the face goes under an oven's door, where
//! there is a floor, and between a lid and the wall behind it.

use nalgebra::{Translation3, UnitQuaternion};

use super::grasp::{Contact, pose};
use crate::articulation::JointKind;
use crate::config;
use crate::math::{Point, Pose, Vector};
use crate::twin::{OrientedBox, Role, Twin};

/// Numerics: places on the way to the part that are looked at.
const APPROACH: usize = 5;
/// Numerics: places on the way with the part.
const WAY: usize = 13;

/// Boxes, a little larger than they are.
struct Obstacles(Vec<OrientedBox>);

impl Obstacles {
    fn of<'a>(boxes: impl Iterator<Item = &'a OrientedBox>, free: f64) -> Self {
        Self(boxes.map(|b| OrientedBox { half: b.half.map(|h| h + free), ..*b }).collect())
    }

    /// How many points of a gripper at a pose are inside of them.
    fn hits(&self, gripper: &[Point], at: &Pose, reach_m: f64) -> usize {
        let middle = Point::from(at.translation.vector);
        let near: Vec<&OrientedBox> =
            self.0.iter().filter(|b| (b.center - middle).norm() < b.half.norm() + reach_m).collect();
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
fn gripper(width: f64, config: &config::Primitives) -> Vec<Point> {
    let ([center, half], finger) = (config.palm_m, config.finger_m);
    let mut points = samples(center, half, [5, 3, 3]);
    for side in [-1.0, 1.0] {
        points.extend(samples([side * (0.5 * width + finger[0]), 0.0, -config.finger_back_m], finger, [2, 2, 4]));
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
pub(super) fn tilt(twin: &Twin, index: usize, contact: &Contact, config: &config::Primitives) -> [f64; 2] {
    let Some(furniture) = twin.furniture.get(index) else { return [0.0; 2] };
    let part = &furniture.part;
    let others = twin.furniture.iter().enumerate().filter(|(i, _)| *i != index).flat_map(|(_, f)| &f.part.solids);
    let fixed = twin.furniture.iter().flat_map(|f| &f.carcass).chain(&twin.room);
    let around = Obstacles::of(fixed.chain(others).map(|s| &s.shape), config.around_m);
    let own =
        Obstacles::of(part.solids.iter().filter(|s| s.role != Role::Handle).map(|s| &s.shape), config.around_part_m);
    let (open, holding) =
        (gripper(contact.gripper_opening_m, config), gripper(contact.width_m.unwrap_or(config.thin_m), config));
    let (phi, upper) = (part.joint.articulation, part.joint.upper);
    let (grasp, reach_m) = (pose(contact), config.reach_m);
    let hits = |[closed_at, open_at]: [f64; 2]| {
        let mut count = 0;
        let held = grasp * turn(closed_at);
        for i in 0..APPROACH {
            let back = config.standoff_m * (1.0 - i as f64 / (APPROACH - 1) as f64);
            let at = held * Translation3::new(0.0, 0.0, -back);
            count += around.hits(&open, &at, reach_m) + own.hits(&open, &at, reach_m);
        }
        for i in 0..WAY {
            let share = i as f64 / (WAY - 1) as f64;
            let at = grasp * turn(closed_at + (open_at - closed_at) * share);
            // The part goes with the gripper.
            count +=
                own.hits(&holding, &at, reach_m) + around.hits(&holding, &(phi.motion(share * upper) * at), reach_m);
        }
        count
    };
    let mut best = ([0.0; 2], usize::MAX);
    for turns in turns(phi.kind, config) {
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
fn turns(kind: JointKind, config: &config::Primitives) -> Vec<[f64; 2]> {
    let both =
        |degrees: &[f64]| -> Vec<f64> { std::iter::once(0.0).chain(degrees.iter().flat_map(|d| [*d, -d])).collect() };
    let (closed, open) = (both(&config.turns_closed_deg), both(&config.turns_open_deg));
    let mut all: Vec<[f64; 2]> = match kind {
        JointKind::Prismatic => closed.iter().map(|a| [*a, *a]).collect(),
        JointKind::Revolute => closed.iter().flat_map(|a| open.iter().map(move |b| [*a, *b])).collect(),
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
        assert_eq!(
            tilt(
                &twin,
                0,
                &grasp::contact(&twin.furniture[0].part, &config::Primitives::default()),
                &config::Primitives::default()
            ),
            [0.0; 2]
        );
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
        let contact = grasp::contact(&twin.furniture[0].part, &config::Primitives::default());
        assert_eq!(tilt(&twin, 0, &contact, &config::Primitives::default()), [0.0; 2]);
        twin.room.push(slab("room_floor", Point::new(0.0, 0.0, -0.08), Vector::new(3.0, 3.0, 0.05)));
        let [closed, open] = tilt(&twin, 0, &contact, &config::Primitives::default());
        assert!(closed == 0.0 && open.abs() > 0.5, "{closed} {open}");
        // It turns towards the person, who stands at -y: there is the palm of the open door's gripper.
        let phi = twin.furniture[0].part.joint.articulation;
        let held = phi.motion(twin.furniture[0].part.joint.upper) * grasp::pose(&contact) * turn(open);
        assert!((held * Point::new(0.0, 0.0, -0.065)).y < (held * Point::origin()).y - 0.02);
    }

    #[test]
    fn a_slide_is_held_the_same_all_the_way() {
        assert!(turns(JointKind::Prismatic, &config::Primitives::default()).iter().all(|t| t[0] == t[1]));
        let hinge = turns(JointKind::Revolute, &config::Primitives::default());
        assert_eq!((hinge[0], hinge.len()), ([0.0; 2], 5 * 7));
    }
}
