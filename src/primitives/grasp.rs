//! Where and how a gripper takes hold of a closed part.

use nalgebra::{Matrix3, Rotation3, UnitQuaternion};
use serde::{Deserialize, Serialize};

use super::clear;
use crate::config;
use crate::hands::{Trajectory, grip_std_m};
use crate::math::{Point, Pose, Vector, any_orthogonal, reject, unit};
use crate::twin::{Part, Role, Solid};

/// What fingers close on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Hold {
    /// A handle.
    Handle,
    /// Nothing: the model has no handle, only a place at which the part was held.
    Surface,
}

/// A contact on the closed part, world.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Contact {
    /// What is there.
    pub hold: Hold,
    /// Where the middle between the fingertips goes, metres.
    pub point: Point,
    /// Unit: the way that the gripper comes.
    pub approach: Vector,
    /// Unit: fingers close along it and against it.
    pub closing: Vector,
    /// Size of the handle along `closing`, metres; `None` without a handle.
    pub width_m: Option<f64>,
    /// How far the fingertips are apart before they close, metres.
    pub gripper_opening_m: f64,
    /// Turns about the bar, the gripper's y, from straight at the part's face: of the closed part (`approach` and `closing`
    /// have it) and of the open one, rad; in between by the opening.
    pub tilt_rad: [f64; 2],
}

/// A gripper's pose in the world.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct GripperPose {
    /// The middle between the fingertips, metres.
    pub position: Point,
    /// `world_from_gripper`, w first: z is the approach, x the way that fingers close, y = z cross x.
    pub rotation_wxyz: [f64; 4],
}

impl From<Pose> for GripperPose {
    fn from(pose: Pose) -> Self {
        Self { position: Point::from(pose.translation.vector), rotation_wxyz: wxyz(&pose.rotation) }
    }
}

/// A rotation with a scalar part that is not negative.
pub(super) fn wxyz(rotation: &UnitQuaternion<f64>) -> [f64; 4] {
    let q = rotation.quaternion();
    let sign = if q.w < 0.0 { -1.0 } else { 1.0 };
    [q.w, q.i, q.j, q.k].map(|c| sign * c)
}

/// The same contact with the gripper turned about the bar.
#[must_use]
pub(super) fn tilted(contact: &Contact, tilt_rad: [f64; 2]) -> Contact {
    let turned = pose(contact).rotation * clear::turn(tilt_rad[0]);
    Contact { approach: turned * Vector::z(), closing: turned * Vector::x(), tilt_rad, ..*contact }
}

/// The contact of a part: straight at its face, fingers across the bar of its handle.
#[must_use]
pub fn contact(part: &Part, config: &config::Primitives) -> Contact {
    let [right, out] = [0, 2].map(|i| part.bounds.rotation.column(i).into_owned());
    let approach = -out;
    let handle = part.solids.iter().filter(|s| s.role == Role::Handle).max_by(|a, b| length(a).total_cmp(&length(b)));
    // Across the bar; a knob is held level.
    let across = handle.and_then(|bar| {
        let (axis, half) = (longest(bar), bar.shape.half);
        // Geometry: a bar, not a knob.
        let is_long = half.max() > 1.5 * (half.sum() - half.max() - half.min());
        unit(&approach.cross(&axis)).filter(|_| is_long)
    });
    let level = unit(&reject(&right, &approach)).unwrap_or_else(|| any_orthogonal(&approach));
    let closing = across.unwrap_or(level);
    // One of the two senses, the same for all parts of a face.
    let up = part.bounds.rotation.column(1);
    let closing = if closing.dot(&right) + 0.5 * closing.dot(&up) < 0.0 { -closing } else { closing };
    let width = handle.map(|bar| {
        let local = bar.shape.rotation.transpose() * closing;
        2.0 * local.abs().dot(&bar.shape.half)
    });
    Contact {
        hold: if handle.is_some() { Hold::Handle } else { Hold::Surface },
        point: part.handle,
        approach,
        closing,
        width_m: width,
        gripper_opening_m: width.map_or(config.widest_m, |w| (w + 2.0 * config.beside_handle_m).min(config.widest_m)),
        tilt_rad: [0.0; 2],
    }
}

fn length(solid: &Solid) -> f64 {
    solid.shape.half.max()
}

fn longest(solid: &Solid) -> Vector {
    solid.shape.rotation.column(solid.shape.half.imax()).into_owned()
}

/// `world_from_gripper` at a contact.
#[must_use]
pub fn pose(contact: &Contact) -> Pose {
    let side = contact.approach.cross(&contact.closing);
    let axes = Matrix3::from_columns(&[contact.closing, side, contact.approach]);
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(axes));
    Pose::from_parts(contact.point.coords.into(), rotation)
}

/// How well the hands tell where the part is held when closed, metres along the motion; `None` without hands.
#[must_use]
pub fn point_std_m(hands: &[(String, &Trajectory)], rules: &config::Grips) -> Option<f64> {
    hands.iter().map(|(_, hand)| grip_std_m(hand.closed_end_seen(), rules)).min_by(f64::total_cmp)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::primitives::tests::{door, drawer};

    #[test]
    fn fingers_close_across_the_bar_and_come_straight_at_the_face() {
        // An upright bar is held from the sides, a level one from above and below.
        for (part, across) in [(door(), Vector::x()), (drawer(), Vector::z())] {
            let contact = contact(&part, &config::Primitives::default());
            assert!((contact.approach - Vector::y()).norm() < 1e-12, "{contact:?}");
            assert!((contact.closing - across).norm() < 1e-12, "{contact:?}");
            assert!((contact.width_m.unwrap() - 0.012).abs() < 1e-12);
            assert!((contact.gripper_opening_m - config::Primitives::default().widest_m).abs() < 1e-12);
            assert_eq!((contact.hold, contact.point), (Hold::Handle, part.handle));
            let pose = pose(&contact);
            assert!((pose.rotation * Vector::z() - contact.approach).norm() < 1e-9);
            assert!((pose.rotation * Vector::x() - contact.closing).norm() < 1e-9);
        }
    }

    #[test]
    fn a_part_without_a_handle_says_so() {
        let mut part = door();
        part.solids.retain(|s| s.role != Role::Handle);
        let contact = contact(&part, &config::Primitives::default());
        assert_eq!(
            (contact.hold, contact.width_m, contact.gripper_opening_m),
            (Hold::Surface, None, config::Primitives::default().widest_m)
        );
        assert!((contact.closing - Vector::x()).norm() < 1e-12);
    }
}
