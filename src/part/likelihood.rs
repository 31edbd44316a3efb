//! How likely what is seen of a part while it is open is under a joint (ours).
//!
//! One model of a pixel's depth ([`super::pixel`]) is asked in two ways: along the views' rays ([`super::rays`]), of all that is seen
//! near the part; and at the part's points ([`super::points`]), of what clearly moved. Rays ask every joint the same, but need the
//! outline more. They share the depth's errors and are pooled as opinions are, by weighted sums of their logarithms. Rays alone lose
//! one clip in twenty under errors of usual size.

use std::cmp::Ordering;

use super::points::{self, Points};
use super::rays::Rays;
use super::views::{Hold, View};
use crate::articulation::{Articulation, JointKind};
use crate::config;
use crate::geometry::{Face, Rect};
use crate::hands::GripStd;
use crate::math::Point;
use crate::math::stats::log_sum;

/// Views whose offsets are one when joints are judged: what lets a wrong joint choose freely tells less.
const TOGETHER: [&[Hold]; 3] = [&[Hold::Sure, Hold::Free], &[Hold::Lost], &[Hold::Left]];

/// What the open views of a clip show of a part: the same for every joint that it could have.
#[derive(Debug, Clone)]
pub struct OpenDepth<'a> {
    rays: Rays,
    points: Points<'a>,
    config: &'a config::Part,
}

impl<'a> OpenDepth<'a> {
    /// Near the part that `outline` has on `face`, or near the grip where no outline is known.
    #[must_use]
    pub fn of(face: &'a Face, outline: Option<&Rect>, views: &'a [View<'a>], config: &'a config::Part) -> Self {
        let rays = Rays::of(face, outline, views, config);
        Self { rays, points: Points::of(face, outline, views, config), config }
    }

    /// The rays' word: all offsets count, each as far as it is believed in.
    fn by_rays(&self, joint: &Articulation, grip: &Point, std: GripStd) -> f64 {
        let (rays, most_nats) = (&self.rays, self.config.likelihood.rays_most_nats);
        let lever = joint.lever(grip).max(self.config.likelihood.least_lever_m);
        // Where a hand was lost before it let go, the views after that have an offset of their own.
        let of = |holds: &[Hold]| -> f64 {
            let (priors, together): (Vec<f64>, Vec<f64>) = offsets(holds, |h| rays.has(&[h]), std, self.config)
                .into_iter()
                .map(|(offset, prior)| (prior, prior + rays.log_likelihood(joint, grip, holds, offset / lever)))
                .unzip();
            log_sum(&together) - log_sum(&priors)
        };
        let total: f64 = TOGETHER.into_iter().filter(|holds| rays.has(holds)).map(of).sum();
        most_nats * (total / most_nats).tanh()
    }

    /// The points' word: of the face's points that a joint moves clearly, the share that is seen where it puts them rather than
    /// seen through there (but edge-on), and no longer where they were; and the number of such sights.
    ///
    /// Of all offsets (see [`log_likelihood`]) the one that explains most is taken, less what so large an offset is believed in.
    fn by_points(&self, joint: &Articulation, grip: &Point, std: GripStd) -> (f64, usize) {
        let (points, rules) = (&self.points, &self.config.likelihood);
        let share_per_nat = 1.0 / rules.whole_share_nats;
        let has = |h: Hold| points.views.iter().any(|v| v.hold == h);
        let lever = joint.lever(grip).max(rules.least_lever_m);
        // Where a hand was lost before it let go, the views after that have an offset of their own.
        let of = |holds: &[Hold]| -> (f64, usize) {
            let found = offsets(holds, has, std, self.config).into_iter().map(|(offset, prior)| {
                let (share, count) = points::seen_share(points, joint, grip, holds, offset / lever);
                ((share + share_per_nat * prior).max(0.0), count)
            });
            // An offset under which nothing moves clearly explains nothing; of equal offsets the first is kept.
            let least = points.least_sights;
            let better = |next: &(f64, usize), best: &(f64, usize)| {
                (next.1 >= least, next.0).partial_cmp(&(best.1 >= least, best.0)) == Some(Ordering::Greater)
            };
            found.reduce(|best, next| if better(&next, &best) { next } else { best }).unwrap_or((0.0, 0))
        };
        let (mut explained, mut count) = (0.0, 0);
        for holds in TOGETHER.iter().filter(|holds| points.views.iter().any(|v| holds.contains(&v.hold))) {
            let (share, sights) = of(holds);
            explained += share * sights as f64;
            count += sights;
        }
        (explained / count.max(1) as f64, count)
    }
}

/// How well a joint explains the open views, in nats: the points' word is a right joint's against a wrong one's, the rays' is
/// this joint's against that nothing moved. Only differences between joints mean something.
///
/// Hands and depth disagree by a few centimetres that stay the same over a clip (a hand's distance is the least certain thing
/// about it): the opening that the hand tells has an offset of its own, of which `std` is the spread along the motion.
#[must_use]
pub fn log_likelihood(depth: &OpenDepth, joint: &Articulation, grip: &Point, std: GripStd) -> f64 {
    let rules = &depth.config.likelihood;
    rules.points_weight * depth.points.log_likelihood(depth.by_points(joint, grip, std))
        + rules.rays_weight * depth.by_rays(joint, grip, std)
}

/// [`log_likelihood`] of each joint: joints that are the same to what depth can tell are asked about once.
#[must_use]
pub fn log_likelihoods<'j>(
    depth: &OpenDepth,
    joints: impl Iterator<Item = &'j Articulation>,
    grip: &Point,
    std: GripStd,
) -> Vec<f64> {
    let mut known: Vec<(&Articulation, f64)> = Vec::new();
    joints
        .map(|joint| match known.iter().find(|(other, _)| all_but_same(joint, other, &depth.config.likelihood)) {
            Some((_, nats)) => *nats,
            None => {
                let nats = log_likelihood(depth, joint, grip, std);
                known.push((joint, nats));
                nats
            }
        })
        .collect()
}

/// Whether two joints differ by less than a tenth of what depth tells apart.
fn all_but_same(a: &Articulation, b: &Articulation, rules: &config::JointOdds) -> bool {
    a.kind == b.kind
        && (a.axis - b.axis).norm() < rules.same_rad
        && (a.kind == JointKind::Prismatic || b.line().distance(&a.origin) < rules.same_m)
}

/// Offsets of the opening at the grip that views of these sorts may share, metres, from the middle outwards, each with the log of
/// how far it is believed in against none. Their spread is that of the surest sort that there is: views after a hand let go
/// are held to the offset of those before.
fn offsets(together: &[Hold], has: impl Fn(Hold) -> bool, std: GripStd, config: &config::Part) -> Vec<(f64, f64)> {
    let of = |h: &Hold| has(*h).then(|| h.std_m(std, &config.views));
    let std_m = together.iter().filter_map(of).fold(f64::INFINITY, f64::min);
    let step = config.likelihood.step_m.max(0.5 * std_m);
    let reach = (config.likelihood.reach_stds * std_m / step).round() as i32;
    let steps = std::iter::once(0).chain((1..=reach).flat_map(|k| [-k, k]));
    steps.map(|k| f64::from(k) * step).map(|offset| (offset, -0.5 * (offset / std_m).powi(2))).collect()
}

#[cfg(test)]
mod tests {
    use super::super::views::{View, drawn};
    use super::*;
    use crate::geometry::Rect;
    use crate::math::Vector;

    const GRIP_STD: GripStd = GripStd { closed_m: 0.03, lost_m: 0.12 };
    /// Of the 81 points in one view.
    const LEAST_SIGHTS: usize = 56;

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
        of: impl Fn(&OpenDepth, &Point) -> T,
    ) -> T {
        let poses = [drawn::pose(Point::new(0.3, -1.0, 0.5)), drawn::pose(Point::new(0.1, -1.1, 0.4))];
        let (face, grip) = (drawn::face(), drawn::face().center);
        let sketches = poses.map(|pose| drawn::sketch(&pose, moves, opening));
        let hand = moves.motion(told) * grip;
        let views: Vec<View> = sketches.iter().zip(&poses).map(|(s, pose)| drawn::view(s, pose, hand)).collect();
        of(&OpenDepth::of(&face, rect, &views, &drawn::CONFIG), &grip)
    }

    #[test]
    fn a_joint_explains_its_own_motion_and_a_slide_within_the_face_must_uncover_something() {
        let (out, aside) = (slide(-Vector::y()), slide(-Vector::x()));
        let share = |moves: &Articulation, opening: f64, told: f64, claims: &Articulation| {
            ask(moves, opening, told, Some(&drawn::rect()), |s, grip| s.by_points(claims, grip, GRIP_STD))
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
        let std = GripStd { closed_m: 0.001, ..GRIP_STD };
        let told = |opening: f64| {
            let views = [drawn::view(&sketch, &pose, door().motion(opening) * grip)];
            OpenDepth::of(&face, Some(&rect), &views, &drawn::CONFIG).by_points(&door(), &grip, std)
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
                    ask(moves, *opening, *opening, outline, |s, grip| s.by_rays(&claims, grip, GRIP_STD))
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
        let of = |claims: &Articulation| ask(&out, 0.07, 0.07, None, |s, grip| s.by_rays(claims, grip, GRIP_STD));
        assert!(of(&out) > of(&aside) + 1.0, "{} {}", of(&out), of(&aside));
    }

    #[test]
    fn a_front_that_stayed_shut_speaks_against_all_motions() {
        for joint in [door(), slide(-Vector::y()), slide(-Vector::x())] {
            let told = if joint.kind == JointKind::Revolute { 0.9 } else { 0.3 };
            let found = ask(&joint, 0.0, told, Some(&drawn::rect()), |s, grip| s.by_rays(&joint, grip, GRIP_STD));
            // Most of what a slide within the front covers is covered by the front that stayed.
            let leaves = joint.axis.x.abs() < 0.5;
            assert!(found < if leaves { -1.0 } else { 0.0 }, "{joint:?} {found}");
        }
    }

    #[test]
    fn both_readings_count_as_the_config_has_it() {
        let (face, rect, pose) = (drawn::face(), drawn::rect(), drawn::pose(Point::new(0.3, -1.0, 0.5)));
        let sketch = drawn::sketch(&pose, &door(), 0.9);
        let views = [drawn::view(&sketch, &pose, door().motion(0.9) * face.center)];
        let nats = |points_weight: f64, rays_weight: f64| {
            let likelihood = config::JointOdds { points_weight, rays_weight, ..Default::default() };
            let config = config::Part { likelihood, ..Default::default() };
            log_likelihood(&OpenDepth::of(&face, Some(&rect), &views, &config), &door(), &face.center, GRIP_STD)
        };
        let [points, rays, usual] = [nats(1.0, 0.0), nats(0.0, 1.0), nats(0.75, 0.5)];
        assert!(points != 0.0 && rays != 0.0 && (0.75 * points + 0.5 * rays - usual).abs() < 1e-9, "{points} {rays}");
    }

    #[test]
    fn joints_that_depth_cannot_tell_apart_are_asked_about_once() {
        let (out, near) = (slide(-Vector::y()), slide(Vector::new(0.003, -1.0, 0.0).normalize()));
        let hinge = Articulation { origin: door().origin + Vector::x() * 0.001, ..door() };
        let asked = [out, door(), near, hinge, slide(-Vector::x())];
        let rect = drawn::rect();
        let found = ask(&out, 0.3, 0.3, Some(&rect), |s, grip| log_likelihoods(s, asked.iter(), grip, GRIP_STD));
        let alone = asked.map(|j| ask(&out, 0.3, 0.3, Some(&rect), |s, grip| log_likelihood(s, &j, grip, GRIP_STD)));
        assert_eq!([found[0], found[1], found[4]], [alone[0], alone[1], alone[4]]);
        assert_eq!([found[2], found[3]], [found[0], found[1]]);
        assert!(found[0] > found[1] && found[0] > found[4]);
    }
}
