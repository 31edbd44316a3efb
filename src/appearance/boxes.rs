//! Where a part's surfaces are in a frame, and which pixels may see them.

use super::frame_choice::State;
use super::local::Local;
use super::sight_camera::SightCamera;
use crate::math::{Point, Vector};
use crate::twin::{OrientedBox, Part, Role};

/// The surface around a closed front goes on to so far within its outline, metres, and is cut there afterwards: where a surface ends
/// fusion loses a voxel of it.
const WITHIN_M: f64 = 0.015;
/// Between a front and what is around it, metres.
const SEAM_M: f64 = 0.003;
/// Handles are bars in the twin and any shape in the kitchen, metres.
const HANDLE_M: f64 = 0.02;
/// Places at which a part on its way is looked for.
const ON_WAY: u32 = 10;

/// Boxes (world) in which all that is seen belongs to the part: closed its front's slab and its handle, open wherever it stands,
/// with a drawer's content, on its way everywhere that it goes.
pub(super) fn of_part(part: &Part, state: State, slab_m: f64) -> Vec<OrientedBox> {
    match state {
        State::Closed => part
            .solids
            .iter()
            .filter(|s| s.role != Role::Tray)
            .map(|s| if s.role == Role::Front { slab(&s.shape, -WITHIN_M, slab_m) } else { grown(&s.shape, HANDLE_M) })
            .collect(),
        State::Open(opening) => standing(part, opening, slab_m),
        State::Moving => {
            let most = part.joint.upper.max(part.joint.observed);
            (0..=ON_WAY).flat_map(|i| standing(part, most * f64::from(i) / f64::from(ON_WAY), slab_m)).collect()
        }
    }
}

fn standing(part: &Part, opening: f64, slab_m: f64) -> Vec<OrientedBox> {
    let motion = part.joint.articulation.motion(opening);
    match part.joint.articulation.kind {
        crate::articulation::JointKind::Prismatic => vec![grown(&part.bounds, slab_m).moved(&motion)],
        crate::articulation::JointKind::Revolute => {
            let of = |s: &crate::twin::Solid| match s.role {
                Role::Front => slab(&s.shape, slab_m, slab_m).moved(&motion),
                _ => grown(&s.shape, slab_m).moved(&motion),
            };
            part.solids.iter().map(of).collect()
        }
    }
}

/// A board made wider by `edge_m` and thicker by `slab_m` to either side.
fn slab(shape: &OrientedBox, edge_m: f64, slab_m: f64) -> OrientedBox {
    let thin = shape.half.imin();
    let more = Vector::from_fn(|i, _| if i == thin { slab_m } else { edge_m });
    OrientedBox { half: (shape.half + more).map(|h| h.max(0.0)), ..*shape }
}

/// The fronts of a closed part with the seam around them, as far out as what is seen of them is off. Boards end behind them.
pub(super) fn fronts(part: &Part, slab_m: f64) -> impl Iterator<Item = OrientedBox> {
    // A part's axes are right, up and out of its face.
    let before = part.bounds.rotation.column(2) * (0.5 * slab_m);
    part.solids.iter().filter(|s| s.role == Role::Front).map(move |s| {
        let shape = slab(&s.shape, SEAM_M, 0.5 * slab_m);
        OrientedBox { center: shape.center + before, ..shape }
    })
}

/// Whether a point (world) is in a box.
pub(super) fn holds(shape: &OrientedBox, p: &Point) -> bool {
    let local = shape.rotation.transpose() * (p - shape.center);
    local.iter().zip(shape.half.iter()).all(|(l, h)| l.abs() <= *h)
}

fn grown(shape: &OrientedBox, by: f64) -> OrientedBox {
    OrientedBox { half: shape.half.map(|h| h + by), ..*shape }
}

/// Columns and rows of the pixels that may see a ball (camera frame).
pub(super) fn window(lens: &SightCamera, middle: &Local, radius: f32) -> [std::ops::Range<usize>; 2] {
    let sizes = [lens.width, lens.height];
    if middle.z + radius <= 0.0 {
        return sizes.map(|_| 0..0);
    }
    let near = middle.z - radius;
    // A ball around the eye may be anywhere.
    if near < 0.05 {
        return sizes.map(|size| 0..size);
    }
    std::array::from_fn(|k| {
        // Of a cube around the ball the corners are the outermost.
        let at = |side: f32, z: f32| lens.focal[k] * (middle[k] + side * radius) / z + lens.center[k];
        let far = middle.z + radius;
        let low = at(-1.0, near).min(at(-1.0, far)).floor().clamp(0.0, sizes[k] as f32);
        let high = (at(1.0, near).max(at(1.0, far)).ceil() + 1.0).clamp(0.0, sizes[k] as f32);
        low as usize..(high as usize).max(low as usize)
    })
}
