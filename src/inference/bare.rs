//! A joint from a bare trajectory: no images, no furniture, only points that moved with the part (and its orientation).

use serde::{Deserialize, Serialize};

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

/// A part that turns by more than this has a hinge, whatever its path looks like: markers are read to a few degrees.
const MIN_TURN_RAD: f64 = 0.26;

/// Infers the joint of a bare trajectory.
#[must_use]
pub fn infer(trajectory: &BareTrajectory, config: &config::Inference) -> Outcome<BareJoint> {
    let points = robust(&trajectory.positions);
    let Some(extent) = centroid(&points).map(|c| points.iter().map(|p| (p - c).norm()).fold(0.0, f64::max)) else {
        return Outcome::Abstained("no positions".to_owned());
    };
    if points.len() < 5 {
        return Outcome::Abstained(format!("{} positions, at least 5 are needed", points.len()));
    }
    // Less travel than twice the paper's slide tolerance cannot be told from noise.
    if extent < config.prismatic_tolerance_m {
        return Outcome::Abstained(format!("the points stay within {:.0} mm: nothing moved", 2000.0 * extent));
    }
    let turn = turn(trajectory);
    let Some(slide) = slide(&points) else { return Outcome::Abstained("the points have no direction".to_owned()) };
    let hinge = hinge(&points, turn.as_ref().filter(|t| t.angle >= MIN_TURN_RAD).map(|t| t.axis));
    let slide_residual = path::across(&points, &slide.axis).map_or(f64::INFINITY, f64::sqrt);
    let hinge_fit = hinge.and_then(|j| path::about_line(&points, &j.line()).map(|f| (j, f)));
    let circle_radius_m = hinge_fit.map(|(_, f)| f.radius);
    let hinge_residual = hinge_fit.map(|(_, f)| f.variance().sqrt());

    let (kind, ambiguous, reason) = match (&turn, hinge_fit, hinge_residual) {
        (Some(t), Some(_), _) if t.angle >= MIN_TURN_RAD => {
            (JointKind::Revolute, false, format!("the part itself turned by {:.0} deg", t.angle.to_degrees()))
        }
        (Some(t), _, _) if extent > 0.1 && t.angle < MIN_TURN_RAD => {
            (JointKind::Prismatic, false, format!("the part itself turned by only {:.0} deg", t.angle.to_degrees()))
        }
        (_, Some((_, fit)), Some(residual)) => {
            let bend = residual < 0.5 * slide_residual && slide_residual > 0.002;
            if !bend {
                (JointKind::Prismatic, false, "a line explains the points as well as a circle does".to_owned())
            } else if fit.radius > config.max_radius_m {
                // A hook that slips on a sliding door bends its path, but no door is this wide. Up to twice the widest
                // door it could still be one, read badly.
                let text = format!("the best circle has a radius of {:.2} m, wider than any door", fit.radius);
                (JointKind::Prismatic, fit.radius < 2.0 * config.max_radius_m, text)
            } else {
                (JointKind::Revolute, false, format!("a circle of radius {:.2} m explains the points", fit.radius))
            }
        }
        _ => (JointKind::Prismatic, false, "the points lie on a line".to_owned()),
    };
    let (joint, residual_m, other_residual_m) = match (kind, hinge_fit) {
        (JointKind::Revolute, Some((joint, fit))) => (joint, fit.variance().sqrt(), Some(slide_residual)),
        _ => (slide, slide_residual, hinge_residual),
    };
    let first = points[0];
    let openings = super::openings(&joint, &first, &points);
    let range = stats::quantile(&openings, 0.99).unwrap_or(0.0) - stats::quantile(&openings, 0.01).unwrap_or(0.0);
    let sense = openings.iter().copied().max_by(|a, b| a.abs().total_cmp(&b.abs())).unwrap_or(0.0);
    let joint = if sense < 0.0 { joint.reversed() } else { joint };
    Outcome::Found(BareJoint {
        joint,
        range,
        residual_m,
        other_residual_m,
        circle_radius_m,
        turn_rad: turn.map(|t| t.angle),
        ambiguous,
        reason,
    })
}

/// The points without single jumps: each replaced by the median of its neighbourhood.
pub(crate) fn robust(points: &[Point]) -> Vec<Point> {
    const REACH: usize = 2;
    (0..points.len())
        .map(|i| {
            let window = &points[i.saturating_sub(REACH)..(i + REACH + 1).min(points.len())];
            let coordinate =
                |k: usize| stats::median(&window.iter().map(|p| p[k]).collect::<Vec<_>>()).unwrap_or(points[i][k]);
            Point::new(coordinate(0), coordinate(1), coordinate(2))
        })
        .collect()
}

struct Turn {
    axis: Vector,
    angle: f64,
}

/// Rotation between the orientations at the two ends of the motion: medians over many pairs. `None` without orientations.
fn turn(trajectory: &BareTrajectory) -> Option<Turn> {
    let q = &trajectory.orientations;
    if q.len() != trajectory.positions.len() || q.len() < 10 {
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
    Some(Turn { axis: super::mean_direction(&axes)?, angle: stats::median(&angles)? })
}

fn slide(points: &[Point]) -> Option<Articulation> {
    let (axes, _) = principal_directions(points)?;
    let axis = unit(&axes.column(0).into_owned())?;
    Some(Articulation { kind: JointKind::Prismatic, axis, origin: points[0] })
}

/// The circle in the points' own plane, or about a known direction.
fn hinge(points: &[Point], direction: Option<Vector>) -> Option<Articulation> {
    let direction = match direction {
        Some(d) => d,
        None => Plane::fit(points)?.normal,
    };
    arc_about(points, &direction)
}

#[cfg(test)]
mod tests {
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
        assert!((joint.range - 0.885).abs() < 0.05);

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
}
