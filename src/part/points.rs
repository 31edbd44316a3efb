//! What the open views show of a part's points: where a joint puts them, and where they were (ours).
//!
//! Of the points that the joint moves clearly, depth within its noise ([`super::pixel`]) says of each whether it is there. Points are
//! robust, but a joint that hardly moves any escapes them.

use nalgebra::Matrix3;

use super::outline::smallest;
use super::views::{Hold, View};
use crate::articulation::Articulation;
use crate::config;
use crate::geometry::{Face, Rect};
use crate::math::{Point, Vector};

/// Points of a face's part, closed, and what the open views see there: the same for every joint that it could have.
#[derive(Debug, Clone)]
pub(super) struct Points<'a> {
    face: &'a Face,
    bounds: [[f64; 2]; 2],
    pub(super) views: &'a [View<'a>],
    /// (right, up) of the part's points on the face.
    points: Vec<[f64; 2]>,
    /// For each view and point [`View::gap`].
    closed: Vec<Vec<Option<(f64, f64)>>>,
    config: &'a config::PointOdds,
    /// A share of fewer sights is noise.
    pub(super) least_sights: usize,
}

impl<'a> Points<'a> {
    /// A grid over the part, or over a piece of its face around the grip where the part is not known.
    pub(super) fn of(face: &'a Face, rect: Option<&Rect>, views: &'a [View<'a>], config: &'a config::Part) -> Self {
        let bounds = rect.copied().unwrap_or_else(|| smallest(config)).bounds;
        let side = config.points.grid;
        let at = |k: usize, b: [f64; 2]| b[0] + (b[1] - b[0]) * (k as f64 + 0.5) / side as f64;
        let points: Vec<[f64; 2]> =
            (0..side * side).map(|i| [at(i % side, bounds[0]), at(i / side, bounds[1])]).collect();
        let gap = |view: &View, [right, up]: [f64; 2]| view.gap(&face.point(right, up, 0.0));
        let closed = views.iter().map(|view| points.iter().map(|p| gap(view, *p)).collect()).collect();
        let config = &config.points;
        let least_sights = (config.least_sights * points.len() as f64) as usize;
        Self { face, bounds, views, points, closed, config, least_sights }
    }

    /// What a share of so many sights ([`seen_share`]) is worth, in nats: of the points that a right joint moves about four fifths
    /// are seen in their place, of a wrong one's about a third by chance. Neighbouring points share their fate, so all of them
    /// count as a few.
    pub(super) fn log_likelihood(&self, (share, count): (f64, usize)) -> f64 {
        let config::PointOdds { enough_sights, right, wrong, independent, .. } = *self.config;
        // With few points the share is noise; with none it says nothing.
        let enough = (enough_sights * self.points.len() as f64).floor();
        let weight = independent * (count as f64 / enough).min(1.0);
        weight * (share * (right / wrong).ln() + (1.0 - share) * ((1.0 - right) / (1.0 - wrong)).ln())
    }
}

/// What changes evenly over a face: where its points go, seen from somewhere.
struct Linear {
    /// At the face's centre.
    center: Vector,
    /// Per metre to the right and up.
    right: Vector,
    up: Vector,
}

impl Linear {
    /// Of the face's points, moved by `turn` and then `way`.
    fn of(face: &Face, turn: &Matrix3<f64>, way: &Vector) -> Self {
        Self { center: turn * face.center.coords + way, right: turn * face.right, up: turn * face.up }
    }

    fn at(&self, [right, up]: [f64; 2]) -> Vector {
        self.center + self.right * right + self.up * up
    }
}

/// Of the points that a joint moves clearly, the share that the views of one sort see where it puts them rather than seen through
/// there (but edge-on), and no longer where they were; and the number of such sights. `offset` (rad or m) is added to the opening
/// that the hand tells.
pub(super) fn seen_share(
    points: &Points,
    joint: &Articulation,
    grip: &Point,
    holds: &[Hold],
    offset: f64,
) -> (f64, usize) {
    let Points { face, bounds, .. } = points;
    let face_from_world = face.from_world();
    let (mut explained, mut count) = (0usize, 0usize);
    for (view, closed) in points.views.iter().zip(&points.closed).filter(|(v, _)| holds.contains(&v.hold)) {
        let motion = joint.motion(joint.opening_at(grip, &view.grip) + offset);
        let noise = &view.noise;
        let (turn, way) = (motion.rotation.to_rotation_matrix().into_inner(), motion.translation.vector);
        // What is asked of a point changes evenly over the face: where it goes in the camera's frame, how far it goes in the
        // world's, and which point of the face's frame comes to where it was.
        let seen = &view.camera_from_world;
        let turned = seen * turn;
        let facing = turned * face.normal;
        let goes = Linear::of(face, &turned, &(seen * (way - view.eye.coords)));
        let travels = Linear::of(face, &(turn - Matrix3::identity()), &way);
        let back = face_from_world * turn.transpose();
        let comes = Linear::of(face, &back, &-(back * way + face_from_world * face.center.coords));
        for (here, closed) in points.points.iter().zip(closed) {
            let travel = travels.at(*here);
            let moves = |z: f64| travel.norm_squared() >= (2.0 * noise.tolerance(z)).powi(2);
            // Less than twice the least tolerance is no motion anywhere.
            if !moves(0.0) {
                continue;
            }
            // Where it goes. Within the face there is a surface whether the part slid there or not, and edge-on a small error
            // of the opening is a large one of the depth: both tell nothing.
            let there = goes.at(*here);
            if !view.edge_on(&there, &facing)
                && let Some((gap, z)) = view.gap_at(&Point::from(there))
                && moves(z)
                && gap >= -noise.tolerance(z)
                && travel.dot(&face.normal).abs() > noise.tolerance(z)
            {
                count += 1;
                explained += usize::from(gap <= noise.tolerance(z));
            }
            // Where it was, unless another piece of it is there now.
            if let Some((gap, z)) = *closed
                && moves(z)
                && gap >= -noise.tolerance(z)
            {
                let [right, up, out]: [f64; 3] = comes.at(*here).into();
                let within = |x: f64, b: [f64; 2]| (b[0]..=b[1]).contains(&x);
                let covered = out.abs() <= noise.tolerance(z) && within(right, bounds[0]) && within(up, bounds[1]);
                if !covered {
                    count += 1;
                    explained += usize::from(gap > noise.tolerance(z));
                }
            }
        }
    }
    (explained as f64 / count.max(1) as f64, count)
}
