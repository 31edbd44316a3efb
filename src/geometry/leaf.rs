//! A leaf at an opening, compared with the depth of a view (ours).

use super::Face;
use super::face::Rect;
use super::moved::{View, edge_on};
use crate::articulation::Articulation;
use crate::math::{Point, Pose, Vector, stats, unit};

/// Error of a frame's depth at one point of a surface, beside the one that all its points share, metres. It bends over a few
/// decimetres, so a leaf is worth few points.
pub(super) const OWN_STD_M: f64 = 0.015;
pub(super) const INDEPENDENT: f64 = 30.0;
/// Of the leaf's place against the front it was fitted to, shared by all points of a view, metres: of the plane (1.5 cm) and of
/// the view's depth (1 cm).
const SHARED_STD_M: f64 = 0.018;
/// Beyond this a view looks past the leaf or at what hides it, metres.
pub(super) const TIGHT_M: f64 = 0.03;
/// Points of the leaf that are compared, each way.
const STEPS: usize = 14;

/// Points of a leaf, closed, world, with its outward normal.
pub(super) struct Leaf {
    points: Vec<Point>,
    normal: Vector,
    board_m: f64,
}

/// The surface that a view sees where a point of a leaf should be.
pub(super) struct Behind {
    /// How far it lies from the leaf's point, along the leaf's normal there, metres.
    pub(super) along_normal: f64,
    /// The leaf's point where the view sees it, world.
    pub(super) at: Point,
    /// Out of the leaf's front there, world.
    pub(super) normal: Vector,
    /// The point's way from its closed place, metres.
    pub(super) way: f64,
    /// Depth of the point, metres.
    pub(super) depth: f64,
}

impl Leaf {
    pub(super) fn of(face: &Face, rect: &Rect, board_m: f64) -> Self {
        // The rim is where an outline is off by a cell.
        const RIM: f64 = 0.06;
        let at = |k: usize, b: [f64; 2]| {
            let share = RIM + (1.0 - 2.0 * RIM) * (k as f64 + 0.5) / STEPS as f64;
            b[0] + (b[1] - b[0]) * share
        };
        let points = (0..STEPS * STEPS)
            .map(|i| face.point(at(i % STEPS, rect.bounds[0]), at(i / STEPS, rect.bounds[1]), 0.0))
            .collect();
        Self { points, normal: face.normal, board_m }
    }

    /// A front of any points.
    pub(super) fn through(points: Vec<Point>, normal: Vector, board_m: f64) -> Self {
        Self { points, normal, board_m }
    }

    /// Out of the closed front.
    pub(super) fn normal(&self) -> Vector {
        self.normal
    }

    /// Closed, world.
    pub(super) fn points(&self) -> &[Point] {
        &self.points
    }

    /// What a view sees where `motion` takes `point` (closed, world). `None` where nothing is seen or at a grazing slant.
    pub(super) fn behind(&self, point: &Point, motion: &Pose, view: &View) -> Option<Behind> {
        let normal = motion.rotation * self.normal;
        let front = motion * point;
        let ray = unit(&(front - view.eye))?;
        if edge_on(&ray, &normal) {
            return None;
        }
        let slant = normal.dot(&ray);
        // Seen from behind, the surface is the leaf's back.
        let at = if slant < 0.0 { front } else { front - normal * self.board_m };
        let (gap, depth) = view.gap(&at)?;
        let along_ray = gap * (at - view.eye).norm() / depth;
        Some(Behind { along_normal: along_ray * slant, at, normal, way: (front - point).norm(), depth })
    }
}

/// Share of the leaf's points that have to be seen: a person hides half of a leaf now and then, and what shows in less of it may
/// be anything.
const LEAST_SEEN: f64 = 0.3;

/// Whether a view sees the place of the closed leaf.
pub(super) fn shows(leaf: &Leaf, view: &View) -> bool {
    let shut = Pose::identity();
    let seen = leaf.points().iter().filter(|p| leaf.behind(p, &shut, view).is_some()).count();
    seen as f64 >= LEAST_SEEN * leaf.points().len() as f64
}

/// How far the front beside the leaf is seen out of the face in a view, along its normal, metres: an error of that view's
/// depth, which the leaf shares. Zero where too little of the front is seen.
pub(super) fn front_bias_m(face: &Face, rect: &Rect, view: &View) -> f64 {
    /// What is further off is another surface, metres.
    const SAME_M: f64 = 0.1;
    const LEAST: usize = 20;
    let beside = |p: &Point| {
        let at = face.coordinates(p);
        (0..2).any(|k| at[k] < rect.bounds[k][0] || at[k] > rect.bounds[k][1])
    };
    let front = Leaf::of(face, &Rect { bounds: face.extent }, 0.0);
    let shut = Pose::identity();
    let off: Vec<f64> = front
        .points()
        .iter()
        .filter(|p| beside(p))
        .filter_map(|p| front.behind(p, &shut, view))
        .map(|seen| seen.along_normal)
        .filter(|off| off.abs() < SAME_M)
        .collect();
    if off.len() < LEAST { 0.0 } else { stats::median(&off).unwrap_or(0.0) }
}

/// Log odds of a leaf that stands at `x` (rad or m) against one that is shut, from one view's depth; zero where it shows too
/// little of either place. `bias_m`: the view's, as [`front_bias_m`]. `counts`: which of the leaf's points; all where `None`.
pub(super) fn odds(
    leaf: &Leaf,
    joint: &Articulation,
    x: f64,
    view: &View,
    bias_m: f64,
    counts: Option<&[bool]>,
) -> f64 {
    let (motion, shut) = (joint.motion(x), Pose::identity());
    let both: Vec<[f64; 2]> = leaf
        .points()
        .iter()
        .enumerate()
        .filter(|(i, _)| counts.is_none_or(|c| c.get(*i).copied().unwrap_or(false)))
        .filter_map(|(_, p)| {
            let behind = |motion: &Pose| leaf.behind(p, motion, view).map(|seen| seen.along_normal - bias_m);
            Some([behind(&motion)?, behind(&shut)?])
        })
        .collect();
    if (both.len() as f64) < LEAST_SEEN * leaf.points().len() as f64 {
        return 0.0;
    }
    let worth = (INDEPENDENT / both.len() as f64).min(1.0);
    let [open, shut] = [0, 1].map(|k| explained(both.iter().map(move |r| r[k]), worth));
    open - shut
}

/// How well a leaf's place explains the depth: robust, under the best error that all points share.
fn explained(residuals: impl Iterator<Item = f64> + Clone, worth: f64) -> f64 {
    const BIASES: i32 = 4;
    (-BIASES..=BIASES)
        .map(|k| f64::from(k) / f64::from(BIASES) * 2.0 * SHARED_STD_M)
        .map(|bias| {
            let misfit: f64 = residuals.clone().map(|r| cost(r - bias)).sum();
            -worth * misfit - 0.5 * (bias / SHARED_STD_M).powi(2)
        })
        .fold(f64::NEG_INFINITY, f64::max)
}

/// Of one point, bounded: what hides the leaf or lies behind its edge says no more against one place than against another.
fn cost(residual: f64) -> f64 {
    let [x, bound] = [residual, TIGHT_M].map(|r| (r / OWN_STD_M).powi(2));
    0.5 * x * bound / (x + bound)
}
