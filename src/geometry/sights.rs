//! How well a joint explains what is seen of the part while it is open (ours).
//!
//! Two readings of the same depth. The part's points: of those that the joint moves clearly, how many are seen where it puts
//! them and no longer where they were. And the views' rays ([`super::rays`]): of all that is seen there, how much better the
//! joint explains it than that nothing moved. Points are robust, but a joint that hardly moves any escapes them; rays ask
//! every joint the same, but need the outline more. They share the depth's errors and are pooled as opinions are, by weighted
//! sums of their logarithms.

use std::cmp::Ordering;

use nalgebra::Matrix3;

use super::Face;
use super::face::Rect;
use super::moved::{Hold, View, edge_on, tolerance};
use super::outline::SMALLEST;
use super::rays::Rays;
use crate::articulation::{Articulation, JointKind};
use crate::math::stats::log_sum;
use crate::math::{Point, Vector};

/// What the two readings count in the pool: of (1, 0), (0.75, 0.5) and (0.5, 1) the pair that explained the development seeds of
/// four tiers best, with finer offsets than now.
const POINTS_WEIGHT: f64 = 0.75;
const RAYS_WEIGHT: f64 = 0.5;
/// The rays' word before it is pooled, at most, nats: where an outline is wrong they are all wrong together.
const MOST_NATS: f64 = 10.0;
/// Offsets go so many standard deviations to each side.
const REACH: f64 = 2.0;
/// Between two offsets, metres, at least: what the depth's tolerance bridges. They are half a standard deviation apart where
/// that is more: finer ones cost twice as much and found no more joints.
const STEP_M: f64 = 0.03;

/// Views whose offsets are one when joints are judged: what lets a wrong joint choose freely tells less.
const TOGETHER: [&[Hold]; 3] = [&[Hold::Sure, Hold::Free], &[Hold::Lost], &[Hold::Left]];

/// Points of a part are a grid of so many to each side.
const GRID: usize = 9;
/// A share of fewer sights is noise: of seven tenths of the points in one view.
const LEAST_SIGHTS: usize = 7 * GRID * GRID / 10;
/// So many sights tell all that points can tell, of which neighbouring ones share their fate.
const ENOUGH_SIGHTS: usize = 7 * GRID * GRID / 5;

/// Hinges nearer to the hand are no candidates (`inference.min_radius_m`), metres.
const LEAST_LEVER_M: f64 = 0.05;

/// How well a joint explains the open views, in nats: the points' word is a right joint's against a wrong one's, the rays' is
/// this joint's against that nothing moved. Only differences between joints mean something.
///
/// Hands and depth disagree by a few centimetres that stay the same over a clip (a hand's distance is the least certain thing
/// about it): the opening that the hand tells has an offset of its own, of which `grip_std_m` is the spread along the motion,
/// metres.
#[must_use]
pub fn agreement(sights: &Sights, joint: &Articulation, grip: &Point, grip_std_m: f64) -> f64 {
    POINTS_WEIGHT * log_likelihood(by_points(sights, joint, grip, grip_std_m))
        + RAYS_WEIGHT * by_rays(sights, joint, grip, grip_std_m)
}

/// [`agreement`] of each joint: joints that are the same to what depth can tell are asked about once.
#[must_use]
pub fn agreements<'j>(
    sights: &Sights,
    joints: impl Iterator<Item = &'j Articulation>,
    grip: &Point,
    grip_std_m: f64,
) -> Vec<f64> {
    let mut known: Vec<(&Articulation, f64)> = Vec::new();
    joints
        .map(|joint| match known.iter().find(|(other, _)| all_but_same(joint, other)) {
            Some((_, nats)) => *nats,
            None => {
                let nats = agreement(sights, joint, grip, grip_std_m);
                known.push((joint, nats));
                nats
            }
        })
        .collect()
}

/// Whether two joints differ by less than a tenth of what depth tells apart.
fn all_but_same(a: &Articulation, b: &Articulation) -> bool {
    const ANGLE: f64 = 0.005;
    const OFFSET_M: f64 = 0.002;
    a.kind == b.kind
        && (a.axis - b.axis).norm() < ANGLE
        && (a.kind == JointKind::Prismatic || b.line().distance(&a.origin) < OFFSET_M)
}

/// Offsets of the opening at the grip that views of these sorts may share, metres, from the middle outwards, each with the log of
/// how far it is believed in against none. Their spread is that of the surest sort that there is: views after a hand let go
/// are held to the offset of those before.
fn offsets(together: &[Hold], views: &[View], grip_std_m: f64) -> Vec<(f64, f64)> {
    let of = |h: &Hold| views.iter().any(|v| v.hold == *h).then(|| h.std_m(grip_std_m));
    let std_m = together.iter().filter_map(of).fold(f64::INFINITY, f64::min);
    let step = STEP_M.max(0.5 * std_m);
    let reach = (REACH * std_m / step).round() as i32;
    let steps = std::iter::once(0).chain((1..=reach).flat_map(|k| [-k, k]));
    steps.map(|k| f64::from(k) * step).map(|offset| (offset, -0.5 * (offset / std_m).powi(2))).collect()
}

/// The rays' word: all offsets count, each as far as it is believed in.
fn by_rays(sights: &Sights, joint: &Articulation, grip: &Point, grip_std_m: f64) -> f64 {
    let lever = joint.lever(grip).max(LEAST_LEVER_M);
    // Where a hand was lost before it let go, the views after that have an offset of their own.
    let of = |holds: &[Hold]| -> f64 {
        let (priors, together): (Vec<f64>, Vec<f64>) = offsets(holds, sights.views, grip_std_m)
            .into_iter()
            .map(|(offset, prior)| (prior, prior + sights.rays.log_likelihood(joint, grip, holds, offset / lever)))
            .unzip();
        log_sum(&together) - log_sum(&priors)
    };
    let total: f64 = TOGETHER.into_iter().filter(|holds| sights.rays.has(holds)).map(of).sum();
    MOST_NATS * (total / MOST_NATS).tanh()
}

/// The points' word: of the face's points that a joint moves clearly, the share that is seen where it puts them rather than seen
/// through there (but edge-on), and no longer where they were; and the number of such sights.
///
/// Of all offsets (see [`agreement`]) the one that explains most is taken, less what so large an offset is believed in.
fn by_points(sights: &Sights, joint: &Articulation, grip: &Point, grip_std_m: f64) -> (f64, usize) {
    /// A nat against what the whole share is worth in [`log_likelihood`].
    const SHARE_PER_NAT: f64 = 1.0 / 18.0;
    let lever = joint.lever(grip).max(LEAST_LEVER_M);
    // Where a hand was lost before it let go, the views after that have an offset of their own.
    let of = |holds: &[Hold]| -> (f64, usize) {
        let found = offsets(holds, sights.views, grip_std_m).into_iter().map(|(offset, prior)| {
            let (share, count) = seen_share(sights, joint, grip, holds, offset / lever);
            ((share + SHARE_PER_NAT * prior).max(0.0), count)
        });
        // An offset under which nothing moves clearly explains nothing; of equal offsets the first is kept.
        let better = |next: &(f64, usize), best: &(f64, usize)| {
            (next.1 >= LEAST_SIGHTS, next.0).partial_cmp(&(best.1 >= LEAST_SIGHTS, best.0)) == Some(Ordering::Greater)
        };
        found.reduce(|best, next| if better(&next, &best) { next } else { best }).unwrap_or((0.0, 0))
    };
    let (mut explained, mut count) = (0.0, 0);
    for holds in TOGETHER.iter().filter(|holds| sights.views.iter().any(|v| holds.contains(&v.hold))) {
        let (share, points) = of(holds);
        explained += share * points as f64;
        count += points;
    }
    (explained / count.max(1) as f64, count)
}

/// What [`by_points`] is worth, in nats: of the points that a right joint moves about four fifths are seen in their place, of
/// a wrong one's about a third by chance. Neighbouring points share their fate, so all of them count as a few.
pub(super) fn log_likelihood((share, count): (f64, usize)) -> f64 {
    const RIGHT: f64 = 0.8;
    const WRONG: f64 = 0.3;
    const INDEPENDENT: f64 = 8.0;
    // With few points the share is noise; with none it says nothing.
    let weight = INDEPENDENT * (count as f64 / ENOUGH_SIGHTS as f64).min(1.0);
    weight * (share * (RIGHT / WRONG).ln() + (1.0 - share) * ((1.0 - RIGHT) / (1.0 - WRONG)).ln())
}

/// Points of a face's part, closed, and what the open views see there: the same for every joint that it could have.
#[derive(Debug, Clone)]
pub struct Sights<'a> {
    rays: Rays,
    face: &'a Face,
    bounds: [[f64; 2]; 2],
    views: &'a [View<'a>],
    /// (right, up) of the part's points on the face.
    points: Vec<[f64; 2]>,
    /// For each view and point [`View::gap`].
    closed: Vec<Vec<Option<(f64, f64)>>>,
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

impl<'a> Sights<'a> {
    /// A grid over the part, or over a piece of its face around the grip where the part is not known.
    #[must_use]
    pub fn of(face: &'a Face, rect: Option<&Rect>, views: &'a [View<'a>]) -> Self {
        let bounds = rect.unwrap_or(&SMALLEST).bounds;
        let at = |k: usize, b: [f64; 2]| b[0] + (b[1] - b[0]) * (k as f64 + 0.5) / GRID as f64;
        let points: Vec<[f64; 2]> =
            (0..GRID * GRID).map(|i| [at(i % GRID, bounds[0]), at(i / GRID, bounds[1])]).collect();
        let gap = |view: &View, [right, up]: [f64; 2]| view.gap(&face.point(right, up, 0.0));
        let closed = views.iter().map(|view| points.iter().map(|p| gap(view, *p)).collect()).collect();
        Self { rays: Rays::of(face, rect, views), face, bounds, views, points, closed }
    }
}

/// The share of [`by_points`] in the views of one sort, with `offset` (rad or m) added to the opening that the hand tells.
pub(super) fn seen_share(
    sights: &Sights,
    joint: &Articulation,
    grip: &Point,
    holds: &[Hold],
    offset: f64,
) -> (f64, usize) {
    let Sights { face, bounds, .. } = sights;
    let face_from_world = face.from_world();
    let (mut explained, mut count) = (0usize, 0usize);
    for (view, closed) in sights.views.iter().zip(&sights.closed).filter(|(v, _)| holds.contains(&v.hold)) {
        let motion = joint.motion(joint.opening_at(grip, &view.grip) + offset);
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
        for (here, closed) in sights.points.iter().zip(closed) {
            let travel = travels.at(*here);
            let moves = |z: f64| travel.norm_squared() >= (2.0 * tolerance(z)).powi(2);
            // Less than twice the least tolerance is no motion anywhere.
            if !moves(0.0) {
                continue;
            }
            // Where it goes. Within the face there is a surface whether the part slid there or not, and edge-on a small error
            // of the opening is a large one of the depth: both tell nothing.
            let there = goes.at(*here);
            if !edge_on(&there, &facing)
                && let Some((gap, z)) = view.gap_at(&Point::from(there))
                && moves(z)
                && gap >= -tolerance(z)
                && travel.dot(&face.normal).abs() > tolerance(z)
            {
                count += 1;
                explained += usize::from(gap <= tolerance(z));
            }
            // Where it was, unless another piece of it is there now.
            if let Some((gap, z)) = *closed
                && moves(z)
                && gap >= -tolerance(z)
            {
                let [right, up, out]: [f64; 3] = comes.at(*here).into();
                let within = |x: f64, b: [f64; 2]| (b[0]..=b[1]).contains(&x);
                let covered = out.abs() <= tolerance(z) && within(right, bounds[0]) && within(up, bounds[1]);
                if !covered {
                    count += 1;
                    explained += usize::from(gap > tolerance(z));
                }
            }
        }
    }
    (explained as f64 / count.max(1) as f64, count)
}

#[cfg(test)]
mod tests {
    use super::super::moved::drawn;
    use super::*;

    const GRIP_STD_M: f64 = 0.03;

    fn door() -> Articulation {
        let origin = Point::new(-0.25, 0.0, 0.0);
        Articulation { kind: JointKind::Revolute, axis: -Vector::z(), origin }
    }

    fn slide(axis: Vector) -> Articulation {
        Articulation { kind: JointKind::Prismatic, axis, origin: door().origin }
    }

    /// The part moves by `opening`, the hand by `told`: what `of` makes of it.
    fn ask<T>(
        moves: &Articulation,
        opening: f64,
        told: f64,
        rect: Option<&Rect>,
        of: impl Fn(&Sights, &Point) -> T,
    ) -> T {
        let poses = [drawn::pose(Point::new(0.3, -1.0, 0.5)), drawn::pose(Point::new(0.1, -1.1, 0.4))];
        let (face, grip) = (drawn::face(), drawn::face().center);
        let sketches = poses.map(|pose| drawn::sketch(&pose, moves, opening));
        let hand = moves.motion(told) * grip;
        let views: Vec<View> = sketches.iter().zip(&poses).map(|(s, pose)| drawn::view(s, pose, hand)).collect();
        of(&Sights::of(&face, rect, &views), &grip)
    }

    #[test]
    fn a_joint_explains_its_own_motion_and_a_slide_within_the_face_must_uncover_something() {
        let (out, aside) = (slide(-Vector::y()), slide(-Vector::x()));
        let share = |moves: &Articulation, opening: f64, told: f64, claims: &Articulation| {
            ask(moves, opening, told, Some(&drawn::rect()), |s, grip| by_points(s, claims, grip, GRIP_STD_M))
        };
        // Whoever claims the motion that was made explains nearly all.
        for (joint, opening) in [(door(), 0.9), (out, 0.3), (aside, 0.3)] {
            let (own, count) = share(&joint, opening, opening, &joint);
            assert!(own > 0.9 && count > LEAST_SIGHTS, "{joint:?} {own} {count}");
        }
        let (as_slide, _) = share(&door(), 0.9, 0.9, &out);
        assert!(as_slide < 0.7, "{as_slide}");
        // A front that stayed shut has the surface of a slide's other end, and uncovered nothing.
        let (still, count) = share(&aside, 0.0, 0.3, &aside);
        assert!(still < 0.1 && count > LEAST_SIGHTS, "{still} {count}");
    }

    #[test]
    fn a_leaf_seen_edge_on_tells_nothing_about_where_it_is() {
        // The eye lies in the plane of the leaf at this opening; a hand that is off by a few degrees puts it elsewhere.
        let pose = drawn::pose(Point::new(0.3, -1.0, 0.5));
        let edge_on = 1.0f64.atan2(0.55);
        let (face, grip, rect) = (drawn::face(), drawn::face().center, drawn::rect());
        let sketch = drawn::sketch(&pose, &door(), edge_on);
        let told = |opening: f64| {
            let views = [drawn::view(&sketch, &pose, door().motion(opening) * grip)];
            by_points(&Sights::of(&face, Some(&rect), &views), &door(), &grip, 0.001)
        };
        let ((right, all), (off, rest)) = (told(edge_on), told(edge_on - 0.1));
        assert!(right > 0.95 && off > 0.95, "{right} {off}");
        // What it uncovered still speaks.
        assert!(all >= LEAST_SIGHTS && rest >= LEAST_SIGHTS, "{all} {rest}");
        // Turned on towards the eye it is seen, and is not there.
        let (wrong, _) = told(edge_on - 0.5);
        assert!(wrong < 0.8, "{wrong}");
    }

    #[test]
    fn rays_prefer_the_motion_that_was_made_with_and_without_an_outline() {
        let joints = [(door(), 0.9), (slide(-Vector::y()), 0.3), (slide(-Vector::x()), 0.3)];
        let rect = drawn::rect();
        for outline in [Some(&rect), None] {
            for (moves, opening) in &joints {
                let found = joints.map(|(claims, _)| {
                    ask(moves, *opening, *opening, outline, |s, grip| by_rays(s, &claims, grip, GRIP_STD_M))
                });
                let best = (0..3).max_by(|&a, &b| found[a].total_cmp(&found[b])).unwrap();
                assert!(joints[best].0 == *moves && found[best] > 1.0, "{outline:?} {moves:?} {found:?}");
            }
        }
    }

    #[test]
    fn rays_tell_a_short_pull_from_a_slide_that_stays_in_the_front() {
        // Seven centimetres are less than depth at a metre needs to call a point moved.
        let (out, aside) = (slide(-Vector::y()), slide(-Vector::x()));
        let of = |claims: &Articulation| ask(&out, 0.07, 0.07, None, |s, grip| by_rays(s, claims, grip, GRIP_STD_M));
        assert!(of(&out) > of(&aside) + 1.0, "{} {}", of(&out), of(&aside));
    }

    #[test]
    fn a_front_that_stayed_shut_speaks_against_all_motions() {
        for joint in [door(), slide(-Vector::y()), slide(-Vector::x())] {
            let told = if joint.kind == JointKind::Revolute { 0.9 } else { 0.3 };
            let found = ask(&joint, 0.0, told, Some(&drawn::rect()), |s, grip| by_rays(s, &joint, grip, GRIP_STD_M));
            // Most of what a slide within the front covers is covered by the front that stayed.
            let leaves = joint.axis.x.abs() < 0.5;
            assert!(found < if leaves { -1.0 } else { 0.0 }, "{joint:?} {found}");
        }
    }

    #[test]
    fn joints_that_depth_cannot_tell_apart_are_asked_about_once() {
        let (out, near) = (slide(-Vector::y()), slide(Vector::new(0.003, -1.0, 0.0).normalize()));
        let hinge = Articulation { origin: door().origin + Vector::x() * 0.001, ..door() };
        let asked = [out, door(), near, hinge, slide(-Vector::x())];
        let rect = drawn::rect();
        let found = ask(&out, 0.3, 0.3, Some(&rect), |s, grip| agreements(s, asked.iter(), grip, GRIP_STD_M));
        let alone = asked.map(|j| ask(&out, 0.3, 0.3, Some(&rect), |s, grip| agreement(s, &j, grip, GRIP_STD_M)));
        assert_eq!([found[0], found[1], found[4]], [alone[0], alone[1], alone[4]]);
        assert_eq!([found[2], found[3]], [found[0], found[1]]);
        assert!(found[0] > found[1] && found[0] > found[4]);
    }
}
