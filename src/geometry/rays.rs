//! What a joint says that every ray of an open view meets (ours).
//!
//! The leaf where the joint puts it, whatever lies behind the place that the leaf left, the rest of the front where it was. All
//! joints are judged on the same rays against the same alternative, that nothing moved: a joint gains nothing by saying little,
//! and loses by leaving unexplained what stands before the closed front.

use nalgebra::Matrix3;

use super::Face;
use super::face::Rect;
use super::moved::{GRAZING, Hold, NEAREST_M, View, edge_on, tolerance};
use crate::articulation::{Articulation, JointKind};
use crate::math::{Point, Vector, rotation};

/// Rays of a view that are looked at, at most.
const RAYS: usize = 200;
/// Rays that pass the part further away than this meet nothing of it, however it opens, metres beside its own size.
const REACH_M: f64 = 0.6;
/// Neighbouring rays and following views share their errors: all rays on a clip's part count as this many.
const INDEPENDENT: f64 = 3.0;
/// An outline is seldom exact, and not all of a part is seen to move.
const ON_PART: f64 = 0.9;
/// Of a front's extent so much is front.
const FILLED: f64 = 0.95;
/// Share of rays that something before what is expected hides: arms, hands, other doors.
const BEFORE: f64 = 0.25;
/// Share of rays that go on behind where a surface is expected.
const BEHIND: f64 = 0.15;
/// Share of rays that meet a surface where they are expected to go on.
const BLOCKED: f64 = 0.1;
/// Over this far behind a surface a depth may lie anywhere, metres: a kitchen's width.
const ROOM_M: f64 = 4.0;

/// What a ray of a view saw.
#[derive(Debug, Clone, Copy)]
struct Ray {
    /// Depth seen, metres.
    depth: f64,
    /// Depth at which the ray meets the closed front; infinite where it does not.
    front: f64,
    /// Probability that the front is the part there.
    part: f64,
    /// One over the likelihood (1/m) of the depth if nothing moved, metres.
    by_still: f64,
    /// Likelihood of the depth if the part left its place, against that if nothing moved.
    left: f64,
}

impl Ray {
    /// Likelihood of its depth if the part moved against that if nothing did. `leaf`: the depth at which the ray meets the
    /// leaf's plane, `on_leaf`: probability that it meets the leaf there. `drawer`: whether a tray follows the leaf.
    fn ratio(&self, leaf: f64, on_leaf: f64, drawer: bool) -> f64 {
        if on_leaf <= 0.0 && self.part <= 0.0 {
            return 1.0;
        }
        let left = match self.part {
            0.0 => 0.0,
            part if drawer && leaf > 0.0 && leaf < self.front => {
                part * tray(self.depth, leaf, self.front) * self.by_still
            }
            part => part * self.left,
        };
        let stays = 1.0 - self.part;
        let met = if on_leaf > 0.0 { on_leaf * surface(self.depth, leaf) * self.by_still } else { 0.0 };
        // Behind the front a leaf is seen through its own hole.
        if leaf <= self.front + 1e-9 {
            met + (1.0 - on_leaf) * (left + stays)
        } else {
            stays + self.part * met + (1.0 - on_leaf) * left
        }
    }
}

/// Rays that are worked on at once.
const AT_ONCE: usize = 16;

/// Rays of a view. Where they meet a leaf is worked out for all of them, step by step, which processors do several at a time.
#[derive(Debug, Clone)]
struct Batch {
    /// Ways per metre of depth, face coordinates (right, up, out); zero beyond the last ray.
    ways: [[f64; AT_ONCE]; 3],
    /// Slopes of the ways against a leaf, below which the leaf is seen edge-on.
    grazing: [f64; AT_ONCE],
    /// One to [`AT_ONCE`].
    rays: Vec<Ray>,
}

impl Batch {
    fn of(some: &[(Vector, Ray)]) -> Self {
        let mut out = Self { ways: [[0.0; AT_ONCE]; 3], grazing: [0.0; AT_ONCE], rays: Vec::new() };
        for (i, (way, ray)) in some.iter().enumerate() {
            for k in 0..3 {
                out.ways[k][i] = way[k];
            }
            out.grazing[i] = GRAZING * way.norm();
            out.rays.push(*ray);
        }
        out
    }

    /// For each ray the depth at which it meets the leaf's plane, and the probability that it meets the leaf. The rays are
    /// turned `back`, and start at the `eye` that was moved back with the part, so that the leaf is where it was when closed.
    fn meets(&self, back: &Matrix3<f64>, eye: &Vector, outline: Option<&Rect>) -> ([f64; AT_ONCE], [f64; AT_ONCE]) {
        let [right, up, out] = &self.ways;
        let turned = |k: usize| -> [f64; AT_ONCE] {
            let row = [back[(k, 0)], back[(k, 1)], back[(k, 2)]];
            std::array::from_fn(|i| row[0] * right[i] + row[1] * up[i] + row[2] * out[i])
        };
        let [x, y, z] = [turned(0), turned(1), turned(2)];
        let leaf: [f64; AT_ONCE] = std::array::from_fn(|i| -eye.z / z[i]);
        let x: [f64; AT_ONCE] = std::array::from_fn(|i| eye.x + x[i] * leaf[i]);
        let y: [f64; AT_ONCE] = std::array::from_fn(|i| eye.y + y[i] * leaf[i]);
        // One choice for all: a choice for each would keep them apart.
        let met: [f64; AT_ONCE] = match outline {
            Some(rect) => std::array::from_fn(|i| within(rect, x[i], y[i])),
            None => std::array::from_fn(|i| near_grip(x[i], y[i])),
        };
        let met =
            std::array::from_fn(|i| if (leaf[i] > NEAREST_M) & (z[i].abs() > self.grazing[i]) { met[i] } else { 0.0 });
        (leaf, met)
    }
}

/// The rays of one view.
#[derive(Debug, Clone)]
struct ViewRays {
    hold: Hold,
    /// The grip, world.
    grip: Point,
    /// The eye in face coordinates.
    eye: Vector,
    batches: Vec<Batch>,
}

/// A face's part, closed, and the rays of the open views near it: the same for every joint that it could have.
#[derive(Debug, Clone)]
pub(super) struct Rays {
    face_from_world: Matrix3<f64>,
    center: Point,
    outline: Option<Rect>,
    views: Vec<ViewRays>,
    /// What a ray's log likelihood counts.
    weight: f64,
}

/// Probability that the part reaches a point of its front: inside its outline, or near the grip where there is none.
fn membership(outline: Option<&Rect>, right: f64, up: f64) -> f64 {
    outline.map_or_else(|| near_grip(right, up), |rect| within(rect, right, up))
}

/// [`membership`] of an outline.
fn within(rect: &Rect, right: f64, up: f64) -> f64 {
    /// An outline is a few cells off: from inside to outside over 12 cm; 1/m.
    const PER_RIM: f64 = 1.0 / 0.12;
    let [[left, right_end], [low, high]] = rect.bounds;
    // Without branches; what is not a number, as of rays that meet no leaf, may come out as anything.
    let lesser = |a: f64, b: f64| if a < b { a } else { b };
    let inside = lesser(lesser(right - left, right_end - right), lesser(up - low, high - up));
    let share = lesser(0.5 + inside * PER_RIM, 1.0);
    ON_PART * if share > 0.0 { share } else { 0.0 }
}

/// [`membership`] without one.
fn near_grip(right: f64, up: f64) -> f64 {
    /// A part reaches this far from its handle, in the mean of all directions of all sorts of fronts, metres.
    const MEAN_REACH_M: f64 = 0.12;
    ON_PART * (-right.hypot(up) / MEAN_REACH_M).exp()
}

/// Likelihood (1/m) of a depth where a surface is expected.
fn surface(depth: f64, expected: f64) -> f64 {
    /// The integral of 1 / (1 + x^4): a top as flat as the tolerance is wide.
    const AREA: f64 = std::f64::consts::PI / std::f64::consts::SQRT_2;
    let flat = tolerance(expected);
    let hit = (1.0 - BEFORE - BEHIND) / AREA * flat.powi(3) / (flat.powi(4) + (depth - expected).powi(4));
    hit + if depth < expected { BEFORE / expected } else { BEHIND / ROOM_M }
}

/// Likelihood (1/m) of a depth where the view goes on behind the closed front at `front`.
fn opened(depth: f64, front: f64) -> f64 {
    /// What furniture is deep, metres; beyond it, half as likely.
    const INSIDE_M: f64 = 1.0;
    let free = (1.0 - BEFORE - BLOCKED) / (INSIDE_M + 0.5 * (ROOM_M - INSIDE_M));
    match depth - front {
        d if d < -tolerance(front) => BEFORE / front,
        d if d < tolerance(front) => BLOCKED / (2.0 * tolerance(front)),
        d if d < INSIDE_M => free,
        _ => 0.5 * free,
    }
}

/// Likelihood (1/m) of a depth where the view passes a drawer's front at `leaf` and its closed place at `front`: between them,
/// or some way behind, it meets the tray and what lies in it.
fn tray(depth: f64, leaf: f64, front: f64) -> f64 {
    /// What is seen of the tray's inside behind the closed front, metres.
    const INSIDE_M: f64 = 0.3;
    match depth {
        d if d < leaf => BEFORE / leaf,
        d if d < front + INSIDE_M => (1.0 - BEFORE - BLOCKED) / (front + INSIDE_M - leaf),
        _ => BLOCKED / ROOM_M,
    }
}

impl Rays {
    /// The rays of `views` near the part that `outline` has on `face`, or near the grip where no outline is known.
    pub(super) fn of(face: &Face, outline: Option<&Rect>, views: &[View]) -> Self {
        /// Half of what a part without an outline may measure across, metres.
        const UNKNOWN_M: f64 = 0.3;
        let face_from_world = face.from_world();
        let [right, up] = outline.map_or([0.0; 2], |r| r.bounds.map(|b| 0.5 * (b[0] + b[1])));
        let middle = Vector::new(right, up, 0.0);
        let reach = REACH_M + outline.map_or(UNKNOWN_M, |r| 0.5 * r.size()[0].hypot(r.size()[1]));
        let between = |x: f64, b: [f64; 2]| (b[0]..=b[1]).contains(&x);
        let views: Vec<ViewRays> = views
            .iter()
            .map(|view| {
                let eye = face_from_world * (view.eye - face.center);
                let to = middle - eye;
                let face_from_camera = face_from_world * view.world_from_camera();
                let to_in_camera = face_from_camera.transpose() * to;
                let beyond = to.norm_squared() - reach * reach;
                let mut near: Vec<(Vector, f64)> = Vec::new();
                view.each_depth(|way, depth| {
                    // Nearer than the reach: |to|² - (along / |way|)² < reach².
                    let along = to_in_camera.dot(&way);
                    if along > 0.0 && beyond * way.norm_squared() < along * along {
                        near.push((way, depth));
                    }
                });
                let step = near.len().div_ceil(RAYS).max(1);
                let rays: Vec<(Vector, Ray)> = near
                    .into_iter()
                    .step_by(step)
                    .map(|(way, depth)| {
                        let way = face_from_camera * way;
                        let front = -eye.z / way.z;
                        if edge_on(&way, &Vector::z()) || front < NEAREST_M {
                            let front = f64::INFINITY;
                            return (way, Ray { depth, front, part: 0.0, by_still: ROOM_M, left: 0.0 });
                        }
                        let at = eye + way * front;
                        let part = membership(outline, at.x, at.y);
                        // Of what lies beside the front nothing is known.
                        let seen = between(at.x, face.extent[0]) && between(at.y, face.extent[1]);
                        let filled = FILLED * if seen { 1.0 } else { part };
                        let left = opened(depth, front);
                        let by_still = 1.0 / (filled * surface(depth, front) + (1.0 - filled) * left);
                        (way, Ray { depth, front, part, by_still, left: left * by_still })
                    })
                    .collect();
                ViewRays {
                    hold: view.hold,
                    grip: view.grip,
                    eye,
                    batches: rays.chunks(AT_ONCE).map(Batch::of).collect(),
                }
            })
            .collect();
        let on_part: f64 = views.iter().flat_map(|v| &v.batches).flat_map(|b| &b.rays).map(|r| r.part).sum();
        let weight = (INDEPENDENT / on_part.max(1.0)).min(1.0);
        Self { face_from_world, center: face.center, outline: outline.copied(), views, weight }
    }

    /// Whether any view has one of these holds.
    pub(super) fn has(&self, holds: &[Hold]) -> bool {
        self.views.iter().any(|v| holds.contains(&v.hold))
    }

    /// Log likelihood of the views of one sort under a joint, against that nothing moved, in nats. `offset` (rad or m) is
    /// added to the opening that the hand tells.
    pub(super) fn log_likelihood(&self, joint: &Articulation, grip: &Point, holds: &[Hold], offset: f64) -> f64 {
        let axis = self.face_from_world * joint.axis;
        let origin = self.face_from_world * (joint.origin - self.center);
        let mut sum = 0.0;
        for view in self.views.iter().filter(|v| holds.contains(&v.hold)) {
            let opening = joint.opening_at(grip, &view.grip) + offset;
            // The leaf stays and the eye goes back instead, with its rays.
            let (back, eye) = match joint.kind {
                JointKind::Revolute => {
                    let back = rotation(&axis, -opening).to_rotation_matrix().into_inner();
                    (back, back * (view.eye - origin) + origin)
                }
                JointKind::Prismatic => (Matrix3::identity(), view.eye - axis * opening),
            };
            // Out of the front within 26 degrees, as fitting tells drawers from sliding doors.
            let drawer = joint.kind == JointKind::Prismatic && axis.z > 0.9 && opening > 0.0;
            let outline = self.outline.as_ref();
            for batch in &view.batches {
                let (leaf, on_leaf) = batch.meets(&back, &eye, outline);
                let ratios = batch.rays.iter().zip(leaf.into_iter().zip(on_leaf));
                let ratios = ratios.map(|(ray, (leaf, on_leaf))| ray.ratio(leaf, on_leaf, drawer));
                // One logarithm for all: each ratio is within 1e-4 and 1e4.
                sum += ratios.product::<f64>().ln();
            }
        }
        sum * self.weight
    }
}
