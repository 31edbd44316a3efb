//! A leaf at an opening, compared with the depth of a view (ours).

use super::pixel::Noise;
use super::views::View;
use crate::articulation::Articulation;
use crate::config;
use crate::geometry::{Face, Rect};
use crate::math::{Point, Pose, Vector, stats, unit};

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
    /// 1 where the view sees the leaf's front, so that what is along its normal is before it; -1 where it sees the back.
    pub(super) facing: f64,
}

impl Behind {
    /// How far the surface lies behind the leaf's point as the view sees it, across the leaf, metres.
    pub(super) fn behind_m(&self) -> f64 {
        -self.facing * self.along_normal
    }
}

impl Leaf {
    pub(super) fn of(face: &Face, rect: &Rect, board_m: f64, config: &config::LeafRules) -> Self {
        let (rim, steps) = (config.rim_share, config.points);
        let at = |k: usize, b: [f64; 2]| {
            let share = rim + (1.0 - 2.0 * rim) * (k as f64 + 0.5) / steps as f64;
            b[0] + (b[1] - b[0]) * share
        };
        let points = (0..steps * steps)
            .map(|i| face.point(at(i % steps, rect.bounds[0]), at(i / steps, rect.bounds[1]), 0.0))
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
        if view.edge_on(&ray, &normal) {
            return None;
        }
        let slant = normal.dot(&ray);
        // Seen from behind, the surface is the leaf's back.
        let at = if slant < 0.0 { front } else { front - normal * self.board_m };
        let (gap, depth) = view.gap(&at)?;
        let along_ray = gap * (at - view.eye).norm() / depth;
        Some(Behind {
            along_normal: along_ray * slant,
            at,
            normal,
            way: (front - point).norm(),
            depth,
            facing: -slant.signum(),
        })
    }
}

/// Whether a view sees the place of the closed leaf.
pub(super) fn shows(leaf: &Leaf, view: &View) -> bool {
    let shut = Pose::identity();
    let seen = leaf.points().iter().filter(|p| leaf.behind(p, &shut, view).is_some()).count();
    seen as f64 >= view.config.leaf.least_seen * leaf.points().len() as f64
}

/// How far the front beside the leaf is seen out of the face in a view, along its normal, metres: an error of that view's
/// depth, which the leaf shares. Zero where too little of the front is seen.
pub(super) fn front_bias_m(face: &Face, rect: &Rect, view: &View) -> f64 {
    let rules = &view.config.leaf;
    let beside = |p: &Point| {
        let at = face.coordinates(p);
        (0..2).any(|k| at[k] < rect.bounds[k][0] || at[k] > rect.bounds[k][1])
    };
    let front = Leaf::of(face, &Rect { bounds: face.extent }, 0.0, rules);
    let shut = Pose::identity();
    let off: Vec<f64> = front
        .points()
        .iter()
        .filter(|p| beside(p))
        .filter_map(|p| front.behind(p, &shut, view))
        .map(|seen| seen.along_normal)
        .filter(|off| off.abs() < rules.same_m)
        .collect();
    if off.len() < rules.least_beside { 0.0 } else { stats::median(&off).unwrap_or(0.0) }
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
    let both: Vec<[Behind; 2]> = leaf
        .points()
        .iter()
        .enumerate()
        .filter(|(i, _)| counts.is_none_or(|c| c.get(*i).copied().unwrap_or(false)))
        .filter_map(|(_, p)| Some([leaf.behind(p, &motion, view)?, leaf.behind(p, &shut, view)?]))
        .collect();
    let rules = &view.config.leaf;
    if (both.len() as f64) < rules.least_seen * leaf.points().len() as f64 {
        return 0.0;
    }
    let worth = (rules.independent / both.len() as f64).min(1.0);
    let [open, shut] = [0, 1].map(|k| {
        let points: Vec<&Behind> = both.iter().map(|b| &b[k]).collect();
        explained(&points, bias_m, worth, &view.noise)
    });
    open - shut
}

/// How well a leaf's place explains the depth: robust, under the best error that all points share about `bias_m`.
fn explained(points: &[&Behind], bias_m: f64, worth: f64, noise: &Noise) -> f64 {
    /// Numerics: errors to each side, of up to two standard deviations, that are tried.
    const BIASES: i32 = 4;
    let distance = points.iter().map(|p| p.depth).sum::<f64>() / points.len().max(1) as f64;
    let shared = noise.shared_std(distance);
    (-BIASES..=BIASES)
        .map(|k| f64::from(k) / f64::from(BIASES) * 2.0 * shared)
        .map(|bias| {
            let misfit: f64 = points.iter().map(|p| cost(p.behind_m() + bias_m + bias, p.depth, noise)).sum();
            -worth * misfit - 0.5 * (bias / shared).powi(2)
        })
        .fold(f64::NEG_INFINITY, f64::max)
}

/// Of one point, bounded: what hides the leaf or lies behind its edge says no more against one place than against another. What is
/// before the place counts against it: a leaf that stands elsewhere is before some of its other places.
fn cost(off: f64, z: f64, noise: &Noise) -> f64 {
    let [x, bound] = [off, noise.tight(z)].map(|r| (r / noise.own_std(z)).powi(2));
    0.5 * x * bound / (x + bound)
}
