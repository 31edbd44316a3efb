//! What a joint says that every ray of an open view meets (ours).
//!
//! The leaf where the joint puts it, whatever lies behind the place that the leaf left, the rest of the front where it was. All
//! joints are judged on the same rays against the same alternative, that nothing moved: a joint gains nothing by saying little,
//! and loses by leaving unexplained what stands before the closed front.

use nalgebra::Matrix3;

use super::pixel::Noise;
use super::views::{Hold, View};
use crate::articulation::{Articulation, JointKind};
use crate::config;
use crate::geometry::{Face, Rect};
use crate::math::{Point, Vector, rotation};

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
    fn ratio(&self, leaf: f64, on_leaf: f64, drawer: bool, noise: &Noise) -> f64 {
        if on_leaf <= 0.0 && self.part <= 0.0 {
            return 1.0;
        }
        let left = match self.part {
            0.0 => 0.0,
            part if drawer && leaf > 0.0 && leaf < self.front => {
                part * noise.tray(self.depth, leaf, self.front) * self.by_still
            }
            part => part * self.left,
        };
        let stays = 1.0 - self.part;
        let met = if on_leaf > 0.0 { on_leaf * noise.surface(self.depth, leaf) * self.by_still } else { 0.0 };
        // Behind the front a leaf is seen through its own hole.
        if leaf <= self.front + 1e-9 {
            met + (1.0 - on_leaf) * (left + stays)
        } else {
            stays + self.part * met + (1.0 - on_leaf) * left
        }
    }
}

/// Numerics: rays that are worked on at once.
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
    fn of(some: &[(Vector, Ray)], edge_on_cos: f64) -> Self {
        let mut out = Self { ways: [[0.0; AT_ONCE]; 3], grazing: [0.0; AT_ONCE], rays: Vec::new() };
        for (i, (way, ray)) in some.iter().enumerate() {
            for k in 0..3 {
                out.ways[k][i] = way[k];
            }
            out.grazing[i] = edge_on_cos * way.norm();
            out.rays.push(*ray);
        }
        out
    }

    /// For each ray the depth at which it meets the leaf's plane, and the probability that it meets the leaf. The rays are
    /// turned `back`, and start at the `eye` that was moved back with the part, so that the leaf is where it was when closed.
    fn meets(&self, back: &Matrix3<f64>, eye: &Vector, part: &Reach) -> ([f64; AT_ONCE], [f64; AT_ONCE]) {
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
        let met: [f64; AT_ONCE] = match &part.outline {
            Some(rect) => std::array::from_fn(|i| part.within(rect, x[i], y[i])),
            None => std::array::from_fn(|i| part.near_grip(x[i], y[i])),
        };
        let seen = |i: usize| (leaf[i] > part.nearest_m) & (z[i].abs() > self.grazing[i]);
        let met = std::array::from_fn(|i| if seen(i) { met[i] } else { 0.0 });
        (leaf, met)
    }
}

/// The rays of one view.
#[derive(Debug, Clone)]
struct ViewRays {
    hold: Hold,
    noise: Noise,
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
    part: Reach,
    views: Vec<ViewRays>,
    /// What a ray's log likelihood counts.
    weight: f64,
    /// Cosine with the normal from which on a slide has a tray.
    tray_cos: f64,
}

/// How far a part reaches over its front, and what a ray needs to meet it there.
#[derive(Debug, Clone, Copy)]
struct Reach {
    outline: Option<Rect>,
    /// Probability that the part is where it is believed to be.
    on_part: f64,
    /// One over the width in which an outline ends, 1/m.
    per_rim: f64,
    /// Without an outline: the mean distance to which a part reaches from its handle, metres.
    mean_m: f64,
    /// A leaf nearer to the eye is not met, metres.
    nearest_m: f64,
}

impl Reach {
    fn of(outline: Option<&Rect>, config: &config::Part) -> Self {
        let rays = &config.rays;
        Self {
            outline: outline.copied(),
            on_part: rays.on_part,
            per_rim: 1.0 / rays.rim_m,
            mean_m: rays.mean_reach_m,
            nearest_m: config.views.nearest_m,
        }
    }

    /// Probability that the part reaches a point of its front: inside its outline, or near the grip where there is none.
    fn membership(&self, right: f64, up: f64) -> f64 {
        self.outline.as_ref().map_or_else(|| self.near_grip(right, up), |rect| self.within(rect, right, up))
    }

    /// [`Reach::membership`] of an outline.
    #[inline]
    fn within(&self, rect: &Rect, right: f64, up: f64) -> f64 {
        let [[left, right_end], [low, high]] = rect.bounds;
        // Without branches; what is not a number, as of rays that meet no leaf, may come out as anything.
        let lesser = |a: f64, b: f64| if a < b { a } else { b };
        let inside = lesser(lesser(right - left, right_end - right), lesser(up - low, high - up));
        let share = lesser(0.5 + inside * self.per_rim, 1.0);
        self.on_part * if share > 0.0 { share } else { 0.0 }
    }

    /// [`Reach::membership`] without one.
    #[inline]
    fn near_grip(&self, right: f64, up: f64) -> f64 {
        self.on_part * (-right.hypot(up) / self.mean_m).exp()
    }
}

impl Rays {
    /// The rays of `views` near the part that `outline` has on `face`, or near the grip where no outline is known.
    pub(super) fn of(face: &Face, outline: Option<&Rect>, views: &[View], config: &config::Part) -> Self {
        let rules = &config.rays;
        let reached = Reach::of(outline, config);
        let face_from_world = face.from_world();
        let [right, up] = outline.map_or([0.0; 2], |r| r.bounds.map(|b| 0.5 * (b[0] + b[1])));
        let middle = Vector::new(right, up, 0.0);
        let reach = rules.reach_m + outline.map_or(rules.unknown_half_m, |r| 0.5 * r.size()[0].hypot(r.size()[1]));
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
                let step = near.len().div_ceil(rules.most).max(1);
                let ray = |(way, depth): (Vector, f64)| {
                    let way = face_from_camera * way;
                    let front = -eye.z / way.z;
                    if view.edge_on(&way, &Vector::z()) || front < reached.nearest_m {
                        let (front, by_still) = (f64::INFINITY, view.noise.room_m());
                        return (way, Ray { depth, front, part: 0.0, by_still, left: 0.0 });
                    }
                    let at = eye + way * front;
                    let part = reached.membership(at.x, at.y);
                    // Of what lies beside the front nothing is known.
                    let seen = between(at.x, face.extent[0]) && between(at.y, face.extent[1]);
                    let filled = rules.filled * if seen { 1.0 } else { part };
                    let left = view.noise.through(depth, front);
                    let by_still = 1.0 / (filled * view.noise.surface(depth, front) + (1.0 - filled) * left);
                    (way, Ray { depth, front, part, by_still, left: left * by_still })
                };
                let rays: Vec<(Vector, Ray)> = near.into_iter().step_by(step).map(ray).collect();
                let edge_on_cos = config.views.edge_on_cos;
                ViewRays {
                    hold: view.hold,
                    noise: view.noise,
                    grip: view.grip,
                    eye,
                    batches: rays.chunks(AT_ONCE).map(|some| Batch::of(some, edge_on_cos)).collect(),
                }
            })
            .collect();
        let on_part: f64 = views.iter().flat_map(|v| &v.batches).flat_map(|b| &b.rays).map(|r| r.part).sum();
        let weight = (rules.independent / on_part.max(1.0)).min(1.0);
        Self { face_from_world, center: face.center, part: reached, views, weight, tray_cos: rules.tray_cos }
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
            let drawer = joint.kind == JointKind::Prismatic && axis.z > self.tray_cos && opening > 0.0;
            for batch in &view.batches {
                let (leaf, on_leaf) = batch.meets(&back, &eye, &self.part);
                let ratios = batch.rays.iter().zip(leaf.into_iter().zip(on_leaf));
                let ratios = ratios.map(|(ray, (leaf, on_leaf))| ray.ratio(leaf, on_leaf, drawer, &view.noise));
                // One logarithm for all: each ratio is within 1e-4 and 1e4.
                sum += ratios.product::<f64>().ln();
            }
        }
        sum * self.weight
    }
}
