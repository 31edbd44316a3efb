//! Moving parts as textured boxes, and the assumed inside of furniture that no frame looked into.

use super::boxes;
use super::charts::Chart;
use super::frame_choice::State;
use super::frame_sights::FrameSight;
use super::local::Local;
use crate::math::{Point, Vector};
use crate::twin::{Furniture, OrientedBox, Role, Twin};

/// Samples of one frame that show the inside of a piece of furniture.
const ENOUGH: usize = 150;
/// Nearer to a piece's outline than this a sample may be of its neighbours, metres.
const OUTLINE_M: f64 = 0.04;
/// Nearer to the front than this it may be the front, metres.
const FRONT_M: f64 = 0.08;

/// Faces that look out of the front (cosine).
const FRONTAL: f64 = 0.7;

/// All faces of the parts' boxes, and the inner faces of boards that only assumption has.
pub(super) fn charts(twin: &Twin, origin: &Point, sights: &[FrameSight]) -> Vec<Chart> {
    let mut out = Vec::new();
    for (number, piece) in twin.furniture.iter().enumerate() {
        for solid in &piece.part.solids {
            for (axis, sense) in [0, 1, 2].into_iter().flat_map(|axis| [(axis, 1.0), (axis, -1.0)]) {
                let chart = face(&solid.shape, axis, sense, origin);
                // Of a closed part the front and what is on it are seen. A part's axes are right, up and out of its face.
                let out_of_front = piece.part.bounds.rotation.column(2).dot(&solid.shape.rotation.column(axis)) * sense;
                let shut_in = solid.role != Role::Handle && out_of_front < FRONTAL;
                out.push(Chart { owner: Some(number), shut_in, ..chart });
            }
        }
        if !looked_into(piece, number, origin, sights) {
            out.extend(inside(piece, number, origin));
        }
    }
    out
}

/// One side of a box.
fn face(shape: &OrientedBox, axis: usize, sense: f64, origin: &Point) -> Chart {
    let along = |k: usize| -> Vector { shape.rotation.column(k % 3).into_owned() * shape.half[k % 3] };
    let (u, v) = (along(axis + 1), along(axis + 2));
    let out: Vector = shape.rotation.column(axis).into_owned() * sense;
    let middle = shape.center + along(axis) * sense;
    let corners = [middle - u - v, middle + u - v, middle + u + v, middle - u + v];
    let positions = corners.map(|p| (p - origin).map(|c| c as f32)).to_vec();
    // The box's axes are right-handed: u x v is its axis.
    let triangles = if sense > 0.0 { vec![[0, 1, 2], [0, 2, 3]] } else { vec![[0, 2, 1], [0, 3, 2]] };
    let out = out.map(|c| c as f32);
    Chart::new(positions, vec![out; 4], triangles, &out)
}

/// The faces of a piece's boards that look inwards: what is seen through its front. From outside they are not seen.
fn inside(piece: &Furniture, number: usize, origin: &Point) -> Vec<Chart> {
    let count = piece.carcass.len().max(1) as f64;
    let middle = piece.carcass.iter().fold(Vector::zeros(), |sum, s| sum + s.shape.center.coords) / count;
    piece
        .carcass
        .iter()
        .map(|board| {
            let shape = &board.shape;
            let thin = shape.half.imin();
            let sense = (middle - shape.center.coords).dot(&shape.rotation.column(thin)).signum();
            Chart { assumed: Some(number), ..face(shape, thin, sense, origin) }
        })
        .collect()
}

/// Whether a frame in which the part stands open shows surfaces within the furniture.
fn looked_into(piece: &Furniture, number: usize, origin: &Point, sights: &[FrameSight]) -> bool {
    let Some(room) = hollow(piece) else { return false };
    let rotation = room.rotation.transpose().map(|c| c as f32);
    let center: Local = (room.center - origin).map(|c| c as f32);
    let half = room.half.map(|c| c as f32);
    let mut open = sights.iter().filter(|s| matches!(s.states.get(number), Some(State::Open(_))));
    open.any(|sight| {
        let [xs, ys] = boxes::window(&sight.lens, &sight.pose.apply(&center), half.norm());
        let within = |index: usize, x: usize, y: usize| {
            let depth = sight.depth(index);
            depth > 0.0 && sight.slant(index) > 0.0 && {
                let local = rotation * (sight.point(x, y, depth) - center);
                local.iter().zip(half.iter()).all(|(l, h)| l.abs() <= *h)
            }
        };
        let pixels = ys.flat_map(|y| xs.clone().map(move |x| (y * sight.lens.width + x, x, y)));
        pixels.filter(|&(index, x, y)| within(index, x, y)).take(ENOUGH).count() == ENOUGH
    })
}

/// What a piece of furniture holds: the box around its boards in its part's axes, smaller by what is uncertain.
fn hollow(piece: &Furniture) -> Option<OrientedBox> {
    let bounds = &piece.part.bounds;
    let mut low = Vector::repeat(f64::INFINITY);
    let mut high = Vector::repeat(f64::NEG_INFINITY);
    for corner in piece.carcass.iter().flat_map(|s| s.shape.corners()) {
        let local = bounds.rotation.transpose() * corner.coords;
        low = low.inf(&local);
        high = high.sup(&local);
    }
    // A part's axes are right, up and out of its face.
    low += Vector::new(OUTLINE_M, OUTLINE_M, 0.0);
    high -= Vector::new(OUTLINE_M, OUTLINE_M, FRONT_M);
    let half = (high - low) * 0.5;
    half.iter().all(|h| *h > 0.0).then(|| OrientedBox {
        center: Point::from(bounds.rotation * ((low + high) * 0.5)),
        half,
        rotation: bounds.rotation,
    })
}
