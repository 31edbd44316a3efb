//! Which side of a part's box is its front, and where a hand holds it.

use super::joints::fault;
use crate::articulation::{Articulation, JointKind};
use crate::config;
use crate::error::Result;
use crate::geometry::{Face, Rect};
use crate::math::{Point, Vector, reject, unit};
use crate::twin::OrientedBox;

/// Geometry: what is thinner, metres, slides along its own face, if its motion is square to its thickness and its face upright: a door.
pub(super) const LEAF_M: f64 = 0.06;
/// Format: a front that a handle fits on, metres.
const LEAST_FRONT_M: f64 = 0.05;
/// Format: no handle stands farther before its front, metres ...
const HANDLE_BEFORE_M: f64 = 0.3;
/// Format: ... or behind its part, where a hand that was measured badly may be.
const HANDLE_BEHIND_M: f64 = 0.15;

/// Which of a box's sides is the front: the index of its axis, and the direction out of it.
pub(super) struct Side {
    axis: usize,
    out: Vector,
}

/// The box's axis, with its sign, nearest to a direction, among some.
fn nearest(part: &OrientedBox, direction: &Vector, among: &[usize]) -> Side {
    let column = |i: usize| part.rotation.column(i).into_owned();
    let best = among.iter().copied().fold(None, |best: Option<usize>, i| match best {
        Some(b) if column(b).dot(direction).abs() >= column(i).dot(direction).abs() => best,
        _ => Some(i),
    });
    let axis = best.unwrap_or(0);
    let out = if column(axis).dot(direction) < 0.0 { -column(axis) } else { column(axis) };
    Side { axis, out }
}

/// The side of a part's box that is its front: the one that is told, else that opening moves outward.
pub(super) fn front_side(
    id: &str,
    joint: &Articulation,
    part: &OrientedBox,
    handle: Option<&Point>,
    front: Option<&Vector>,
) -> Result<Side> {
    let direction = match (front, joint.kind) {
        (Some(front), _) => *front,
        // Opening moves a leaf's middle out of its face.
        (None, JointKind::Revolute) => unit(&joint.axis.cross(&(part.center - joint.origin)))
            .ok_or_else(|| fault(id, "part_box", "its centre lies on the hinge; give \"front\""))?,
        (None, JointKind::Prismatic) => {
            let thin = part.half.imin();
            let across = part.rotation.column(thin).into_owned();
            let leaf = 2.0 * part.half[thin] < LEAF_M && across.dot(&joint.axis).abs() < 0.5 && across.z.abs() < 0.5;
            match handle {
                _ if !leaf => joint.axis,
                Some(handle) => across * (handle - part.center).dot(&across).signum(),
                None => {
                    return Err(fault(id, "front", "is missing: nothing tells which way a sliding door looks"));
                }
            }
        }
    };
    Ok(nearest(part, &direction, &[0, 1, 2]))
}

/// The face with the grip as its origin, the part's rectangle on it, and how thick the part is behind it.
pub(super) fn front_of(
    id: &str,
    joint: &Articulation,
    part: &OrientedBox,
    handle: Option<&Point>,
    out: &Side,
    handles: &config::Handles,
) -> Result<(Face, Rect, f64)> {
    let rim_m = handles.from_edge_m;
    let others: Vec<usize> = (0..3).filter(|i| *i != out.axis).collect();
    // Away from the hinge, in the face; zero on a slide.
    let away = match joint.kind {
        JointKind::Revolute => reject(&reject(&(part.center - joint.origin), &joint.axis), &out.out),
        JointKind::Prismatic => Vector::zeros(),
    };
    // On a lid, up is towards the hinge, where the person is not.
    let upward = if out.out.z.abs() > 0.7 /* geometry: a level face */ { -away } else { Vector::z() };
    let up = nearest(part, &upward, &others);
    let right = others.iter().copied().find(|i| *i != up.axis).unwrap_or(up.axis);
    let (half_right, half_up, half_out) = (part.half[right], part.half[up.axis], part.half[out.axis]);
    for (what, half) in [("wide", half_right), ("tall", half_up)] {
        if 2.0 * half < LEAST_FRONT_M {
            let message = format!("its front is {:.3} m {what}: at least {LEAST_FRONT_M} m are needed", 2.0 * half);
            return Err(fault(id, "part_box.half", &message));
        }
    }
    let middle = part.center + out.out * half_out;
    let mut face = Face {
        center: middle,
        right: up.out.cross(&out.out),
        up: up.out,
        normal: out.out,
        extent: [[-half_right, half_right], [-half_up, half_up]],
        support: 1.0,
    };
    let [r, u] = match handle {
        Some(handle) => {
            let [r, u, before] = face.coordinates(handle);
            let outside = (r.abs() - half_right).max(u.abs() - half_up);
            if outside > 2.0 * rim_m {
                return Err(fault(id, "handle", &format!("is {outside:.2} m beside the part's front")));
            }
            let behind = -before - 2.0 * half_out;
            if before > HANDLE_BEFORE_M || behind > HANDLE_BEHIND_M {
                let place = if before > 0.0 { "before the part's front" } else { "behind the part" };
                return Err(fault(id, "handle", &format!("is {:.2} m {place}", before.max(behind))));
            }
            [r.clamp(-half_right, half_right), u.clamp(-half_up, half_up)]
        }
        None => {
            let toward = [(face.right, half_right), (face.up, half_up)];
            let free =
                toward.map(|(d, half)| if d.dot(&away).abs() > 0.5 * half { d.dot(&away).signum() } else { 0.0 });
            [0, 1].map(|i| free[i] * (toward[i].1 - rim_m).max(0.0))
        }
    };
    face.center = face.point(r, u, 0.0);
    let rect = Rect { bounds: [[-half_right - r, half_right - r], [-half_up - u, half_up - u]] };
    face.extent = rect.bounds;
    Ok((face, rect, 2.0 * half_out))
}
