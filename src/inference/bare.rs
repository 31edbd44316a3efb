//! A joint from a bare trajectory: no images, no furniture, only points that moved with the part (and its orientation).

use serde::{Deserialize, Serialize};

use super::bend;
pub(crate) use super::bend::robust;
use crate::articulation::{Articulation, JointKind, Outcome};
use crate::config;
use crate::geometry::candidates::arc_about;
use crate::math::plane::Plane;
use crate::math::{Point, Vector, centroid, path, principal_directions, stats, unit};
use crate::recording::trajectory::BareTrajectory;

/// What a bare trajectory tells.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct BareJoint {
    /// The joint; positive in the sense of the motion from the first sample to the farthest.
    pub joint: Articulation,
    /// Range of the motion, rad or m.
    pub range: f64,
    /// Root mean square distance of the points from the joint's path, metres.
    pub residual_m: f64,
    /// The same for the best joint of the other type.
    pub other_residual_m: Option<f64>,
    /// Radius of the best circle through the points, whatever the type, metres.
    pub circle_radius_m: Option<f64>,
    /// Turn of the recorded orientations, where there are any, radians.
    pub turn_rad: Option<f64>,
    /// Whether both types explain the points: the answer is then the simpler one.
    pub ambiguous: bool,
    /// Why this type.
    pub reason: String,
}

/// Infers the joint of a bare trajectory.
#[must_use]
pub fn infer(trajectory: &BareTrajectory, config: &config::Inference) -> Outcome<BareJoint> {
    let rules = &config.bare;
    let points = robust(&trajectory.positions, rules);
    let Some(extent) = centroid(&points).map(|c| points.iter().map(|p| (p - c).norm()).fold(0.0, f64::max)) else {
        return Outcome::Abstained("no positions".to_owned());
    };
    if points.len() < rules.least_positions {
        let least = rules.least_positions;
        return Outcome::Abstained(format!("{} positions, at least {least} are needed", points.len()));
    }
    // Less travel than twice the paper's slide tolerance cannot be told from noise.
    if extent < config.prismatic_tolerance_m {
        return Outcome::Abstained(format!("the points stay within {:.0} mm: nothing moved", 2000.0 * extent));
    }
    if !bend::progresses(&points) {
        return Outcome::Abstained(format!(
            "the points scatter over {:.0} mm and get nowhere: nothing moved",
            2000.0 * extent
        ));
    }
    let Some(slide) = slide(&points) else { return Outcome::Abstained("the points have no direction".to_owned()) };
    let turn = turn(trajectory, rules);
    let turned = turn.as_ref().filter(|t| t.angle >= rules.turned_rad);
    let (hinge, contradicted) = hinge(&points, turned.map(|t| t.axis), rules);
    let slide_residual = path::across(&points, &slide.axis).map_or(f64::INFINITY, f64::sqrt);
    let hinge_fit = hinge.and_then(|j| path::about_line(&points, &j.line()).map(|f| (j, f)));
    if turned.is_none() && !bend::stands_out(&points, hinge_fit.map(|(_, f)| f.variance()), rules) {
        return Outcome::Abstained(format!(
            "the points wander over {:.0} mm, hardly farther one way than another: nothing moved",
            2000.0 * extent
        ));
    }
    let nats = bend::hinge_over_slide(&points, hinge.as_ref(), config).unwrap_or(0.0);
    let radius = hinge_fit.map(|(_, f)| f.radius);

    let (kind, ambiguous, mut reason) = match (&turn, radius) {
        (Some(t), Some(_)) if t.angle >= rules.turned_rad => {
            (JointKind::Revolute, false, format!("the part itself turned by {:.0} deg", t.whole.to_degrees()))
        }
        (Some(t), _) if extent > rules.slid_m && t.angle < rules.turned_rad => {
            (JointKind::Prismatic, false, format!("the part itself turned by only {:.0} deg", t.whole.to_degrees()))
        }
        (_, radius) => {
            let beside = [Some(slide_residual), hinge_fit.map(|(_, f)| f.variance().sqrt())];
            by_the_path(nats, radius, beside.map(|m| m.unwrap_or(f64::INFINITY)), config)
        }
    };
    if contradicted {
        reason += "; the orientations turn about another axis than the path does: is w written first? Name the columns";
    }
    let (joint, residual_m, other_residual_m) = match (kind, hinge_fit) {
        (JointKind::Revolute, Some((joint, fit))) => (joint, fit.variance().sqrt(), Some(slide_residual)),
        _ => (slide, slide_residual, hinge_fit.map(|(_, f)| f.variance().sqrt())),
    };
    let first = points[0];
    let openings = super::openings(&joint, &first, &points);
    let range = bend::range(&joint, &openings, radius.unwrap_or(1.0), residual_m, rules);
    let sense = openings.iter().copied().max_by(|a, b| a.abs().total_cmp(&b.abs())).unwrap_or(0.0);
    let joint = if sense < 0.0 { joint.reversed() } else { joint };
    Outcome::Found(BareJoint {
        joint,
        range,
        residual_m,
        other_residual_m,
        circle_radius_m: radius,
        turn_rad: turn.map(|t| t.whole),
        ambiguous,
        reason,
    })
}

/// Type, whether it is ambiguous, and why, by how much likelier a hinge makes the path than a slide (nats). Where neither is
/// surely better the simpler one is taken. `beside_m`: how far the points are from the best slide's path and from their own circle.
fn by_the_path(
    nats: f64,
    radius: Option<f64>,
    beside_m: [f64; 2],
    config: &config::Inference,
) -> (JointKind, bool, String) {
    let (max_radius_m, sure) = (config.max_radius_m, config.bare.sure_nats);
    if let Some(r) = radius.filter(|r| *r <= max_radius_m && nats >= sure) {
        return (JointKind::Revolute, false, format!("a circle of radius {r:.2} m explains the points"));
    }
    if nats > -sure {
        return (JointKind::Prismatic, true, undecided(radius, beside_m, config));
    }
    match radius {
        // A hook that slips on a sliding door bends its path, but no door is this wide.
        Some(r) if r > max_radius_m => {
            let text = format!("the best circle has a radius of {r:.2} m, wider than any door");
            (JointKind::Prismatic, false, text)
        }
        _ => (JointKind::Prismatic, false, "a line explains the points better than a circle does".to_owned()),
    }
}

/// Why neither type is surely the better one, in words.
fn undecided(radius: Option<f64>, [line_m, circle_m]: [f64; 2], config: &config::Inference) -> String {
    let (max_radius_m, explains_m) = (config.max_radius_m, config.bare.explains_m);
    let own = radius.unwrap_or(max_radius_m);
    match (line_m <= explains_m, circle_m <= explains_m) {
        // Where the points' own circle is wider than any door, the widest door was compared.
        (true, true) => format!(
            "a line and a circle of radius {:.2} m both explain the points; the simpler one is taken",
            own.min(max_radius_m)
        ),
        (true, false) => "a line explains the points, but not surely better than a circle".to_owned(),
        (false, true) if own > max_radius_m => format!(
            "no line explains the points ({:.0} cm beside), and their circle has a radius of {own:.2} m, wider than any door: is \
             the unit right?",
            100.0 * line_m
        ),
        (false, true) => {
            format!("a circle of radius {own:.2} m explains the points, but not surely better than a line")
        }
        (false, false) => format!(
            "neither a line nor a circle explains the points ({:.0} and {:.0} cm beside); the simpler one is taken",
            100.0 * line_m,
            100.0 * circle_m
        ),
    }
}

/// How the recorded orientations turned.
struct Turn {
    /// About this, unit.
    axis: Vector,
    /// Between the two ends of the motion, medians over many pairs, radians: what a decision rests on.
    angle: f64,
    /// Over the whole motion, radians.
    whole: f64,
}

/// Rotation between the orientations at the two ends of the motion, and over all of it. `None` without orientations.
fn turn(trajectory: &BareTrajectory, rules: &config::Bare) -> Option<Turn> {
    let q = &trajectory.orientations;
    if q.len() != trajectory.positions.len() || q.len() < rules.least_orientations {
        return None;
    }
    // The farthest tenth of the samples against the tenth nearest to the start.
    let start = trajectory.positions[0];
    let mut order: Vec<usize> = (0..q.len()).collect();
    let distance = |i: usize| (trajectory.positions[i] - start).norm();
    order.sort_by(|&a, &b| distance(a).total_cmp(&distance(b)));
    let tenth = (q.len() / 10).max(1);
    let mut axes = Vec::new();
    let mut angles = Vec::new();
    for (&a, &b) in order[..tenth].iter().zip(&order[order.len() - tenth..]) {
        let relative = q[b] * q[a].inverse();
        angles.push(relative.angle());
        if let Some(axis) = relative.axis() {
            axes.push((axis.into_inner(), relative.angle()));
        }
    }
    let axis = super::mean_direction(&axes)?;
    let first = q.first()?.inverse();
    let about: Vec<f64> = q
        .iter()
        .map(|q| {
            let relative = (q * first).into_inner();
            2.0 * axis.dot(&relative.imag()).atan2(relative.scalar())
        })
        .collect();
    let joint = Articulation { kind: JointKind::Revolute, axis, origin: start };
    let whole = bend::range(&joint, &stats::unwrap_angles(&about), 1.0, f64::INFINITY, rules);
    Some(Turn { axis, angle: stats::median(&angles)?, whole })
}

fn slide(points: &[Point]) -> Option<Articulation> {
    let (axes, _) = principal_directions(points)?;
    let axis = unit(&axes.column(0).into_owned())?;
    Some(Articulation { kind: JointKind::Prismatic, axis, origin: points[0] })
}

/// The circle about the direction in which the orientations turned, else in the points' own plane; and whether the two
/// contradict each other, which makes the points' own the better one.
fn hinge(points: &[Point], turned: Option<Vector>, rules: &config::Bare) -> (Option<Articulation>, bool) {
    let own = Plane::fit(points).and_then(|plane| arc_about(points, &plane.normal));
    let Some(direction) = turned else { return (own, false) };
    let about = arc_about(points, &direction);
    let off = |joint: &Articulation| path::about_line(points, &joint.line()).map_or(f64::INFINITY, |f| f.variance());
    let contradicted = own.as_ref().is_some_and(|own| {
        bend::contradicts(&direction, &own.axis, rules)
            && about.as_ref().is_none_or(|about| rules.own_circle * off(own) < off(about))
    });
    if contradicted { (own, true) } else { (about.or(own), false) }
}

#[cfg(test)]
mod tests {
    use nalgebra::UnitQuaternion;

    use super::*;

    fn bare(points: Vec<Point>) -> BareTrajectory {
        BareTrajectory { positions: points, ..Default::default() }
    }

    #[test]
    fn an_arc_is_a_hinge_and_a_line_is_a_slide() {
        let arc: Vec<Point> = (0..60)
            .map(|i| {
                let a = f64::from(i) * 0.015;
                Point::new(0.4 * a.cos(), 0.4 * a.sin(), 0.3)
            })
            .collect();
        let found = infer(&bare(arc), &config::Inference::default());
        let joint = found.found().unwrap();
        assert_eq!(joint.joint.kind, JointKind::Revolute);
        assert!(joint.joint.axis.z > 0.999 && joint.joint.line().distance(&Point::origin()) < 1e-3);
        assert!((joint.range - 0.885).abs() < 1e-6);

        let line: Vec<Point> =
            (0..60).map(|i| Point::new(0.005 * f64::from(i), 0.001 * f64::from(i % 2), 0.0)).collect();
        let found = infer(&bare(line), &config::Inference::default());
        assert_eq!(found.found().unwrap().joint.kind, JointKind::Prismatic);
    }

    #[test]
    fn standing_still_is_no_motion() {
        let still = vec![Point::new(1.0, 2.0, 3.0); 50];
        assert!(infer(&bare(still), &config::Inference::default()).reason().unwrap().contains("nothing moved"));
    }

    fn arc(n: u32, degrees: f64) -> Vec<Point> {
        (0..n)
            .map(|i| {
                let a = degrees.to_radians() * f64::from(i) / f64::from(n - 1);
                Point::new(0.55 * a.cos(), 0.55 * a.sin(), 0.3)
            })
            .collect()
    }

    /// Noise of a normal distribution's kind, the same each time: sums of a congruential generator.
    fn noise(seed: &mut u64) -> f64 {
        (0..12)
            .map(|_| {
                *seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                (*seed >> 11) as f64 / (1u64 << 53) as f64 - 0.5
            })
            .sum()
    }

    fn shaken(points: &[Point], std_m: f64) -> Vec<Point> {
        let mut seed = 7;
        points.iter().map(|p| p + Vector::new(noise(&mut seed), noise(&mut seed), noise(&mut seed)) * std_m).collect()
    }

    #[test]
    fn exact_points_give_the_whole_range_however_few_they_are() {
        for n in [5, 7, 10, 20, 60, 400] {
            for degrees in [20.0, 69.0, 110.0] {
                let found = infer(&bare(arc(n, degrees)), &config::Inference::default());
                let joint = found.found().unwrap();
                assert_eq!(joint.joint.kind, JointKind::Revolute, "{n} {degrees}");
                let off = (joint.range.to_degrees() - degrees).abs();
                assert!(off < 0.05, "{n} {degrees}: {off}");
            }
            let line = (0..n).map(|i| Point::new(0.4 * f64::from(i) / f64::from(n - 1), 0.0, 0.0)).collect();
            let found = infer(&bare(line), &config::Inference::default());
            let joint = found.found().unwrap();
            assert!(joint.joint.kind == JointKind::Prismatic && !joint.ambiguous, "{}", joint.reason);
            assert!((joint.range - 0.4).abs() < 1e-4, "{n}");
        }
    }

    #[test]
    fn a_short_noisy_arc_is_ambiguous_and_a_wide_one_and_a_long_line_are_not() {
        let config = config::Inference::default();
        for (degrees, ambiguous) in [(10.0, true), (15.0, true), (45.0, false), (90.0, false)] {
            let found = infer(&bare(shaken(&arc(90, degrees), 0.003)), &config);
            let joint = found.found().unwrap();
            assert_eq!(joint.ambiguous, ambiguous, "{degrees}: {}", joint.reason);
            assert_eq!(joint.joint.kind == JointKind::Prismatic, ambiguous, "{degrees}");
        }
        let line: Vec<Point> = (0..60).map(|i| Point::new(0.4 * f64::from(i) / 59.0, 0.0, 0.0)).collect();
        let found = infer(&bare(shaken(&line, 0.003)), &config);
        assert!(found.found().is_some_and(|j| !j.ambiguous && j.joint.kind == JointKind::Prismatic));
    }

    #[test]
    fn a_still_hand_that_trembles_moved_nothing() {
        let still = shaken(&[Point::new(1.0, 2.0, 3.0); 120], 0.01);
        let found = infer(&bare(still), &config::Inference::default());
        assert!(found.reason().unwrap().contains("nothing moved"), "{found:?}");
    }

    #[test]
    fn a_still_hand_that_drifts_moved_nothing_and_a_part_that_goes_round_did() {
        // Errors that last for ten samples.
        let mut seed = 3;
        let mut at = Vector::zeros();
        let still: Vec<Point> = (0..300)
            .map(|_| {
                at = 0.9 * at + 0.44 * 0.01 * Vector::new(noise(&mut seed), noise(&mut seed), noise(&mut seed));
                Point::new(1.0, 2.0, 3.0) + at
            })
            .collect();
        let found = infer(&bare(still), &config::Inference::default());
        assert!(found.reason().is_some_and(|r| r.contains("nothing moved")), "{found:?}");
        let found = infer(&bare(shaken(&arc(120, 330.0), 0.005)), &config::Inference::default());
        assert!(found.found().is_some_and(|j| j.joint.kind == JointKind::Revolute), "{found:?}");
    }

    #[test]
    fn the_turn_that_is_told_is_that_of_the_whole_motion() {
        let turned = |degrees: f64| -> BareTrajectory {
            let at = |i: u32| UnitQuaternion::from_euler_angles(0.2, -0.3, degrees.to_radians() * f64::from(i) / 61.0);
            // Of the two quaternions of a rotation either may be written.
            let sign = |i: u32| if i.is_multiple_of(2) { 1.0 } else { -1.0 };
            let orientations = (0..62).map(|i| UnitQuaternion::new_unchecked(at(i).into_inner() * sign(i))).collect();
            BareTrajectory { positions: arc(62, degrees), orientations, ..Default::default() }
        };
        for degrees in [30.0, 69.0, 110.0] {
            let found = infer(&turned(degrees), &config::Inference::default());
            let joint = found.found().unwrap();
            assert_eq!(joint.reason, format!("the part itself turned by {degrees:.0} deg"));
            assert!(joint.turn_rad.is_some_and(|t| (t.to_degrees() - degrees).abs() < 0.1), "{:?}", joint.turn_rad);
        }
    }

    #[test]
    fn a_type_from_which_the_points_are_far_does_not_explain_them() {
        let feet: Vec<Point> = arc(62, 69.0).iter().map(|p| p / 0.3048).collect();
        let found = infer(&bare(feet), &config::Inference::default());
        let joint = found.found().unwrap();
        assert!(!joint.reason.contains("both explain"), "{}", joint.reason);
        let said = |beside: [f64; 2]| undecided(Some(1.8), beside, &config::Inference::default());
        assert!(said([0.01, 0.0]).contains("both explain") && said([0.1, 0.0]).contains("is the unit right?"));
        assert!(said([0.01, 0.2]).contains("a line explains") && said([0.1, 0.2]).contains("neither"));
    }

    #[test]
    fn a_single_jump_is_no_motion_and_orientations_about_another_axis_are_told() {
        let mut points = arc(60, 69.0);
        points[30] = Point::new(-1.0, -1.0, -1.0);
        let found = infer(&bare(points.clone()), &config::Inference::default());
        assert!((found.found().unwrap().range.to_degrees() - 69.0).abs() < 1.5);
        // About z, with w written first.
        let half = |i: usize| 0.5 * 69f64.to_radians() * i as f64 / 59.0;
        let swapped = |i: usize| nalgebra::Quaternion::new(half(i).sin(), half(i).cos(), 0.0, 0.0);
        let orientations = (0..60).map(|i| nalgebra::UnitQuaternion::from_quaternion(swapped(i))).collect();
        let odd = BareTrajectory { positions: arc(60, 69.0), orientations, ..Default::default() };
        let found = infer(&odd, &config::Inference::default());
        let joint = found.found().unwrap();
        assert!(joint.joint.kind == JointKind::Revolute && joint.joint.axis.z.abs() > 0.99, "{}", joint.reason);
        assert!(joint.reason.contains("w written first"), "{}", joint.reason);
    }
}
