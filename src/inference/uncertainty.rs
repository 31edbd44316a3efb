//! How sure a joint is: covariances of its axis and its hinge, standard deviations of its openings, in closed form (ours).
//!
//! All of it holds where type and hypothesis are right: its hypothesis' `share` says how likely they are. What each part is:
//!
//! - An axis of a face or of the room has the error of such a frame: a prior. The hand chose the axis and did not turn
//!   it.
//! - An axis of a front that the hand alone suggests: upright as fronts are, its heading as the hand's path tells it.
//! - A free axis: the prior of its line times what the hands' paths say, a Laplace approximation: the Fisher information
//!   of an evenly drawn arc or pull.
//! - A hinge whose open state was seen: the fit of `part::openings`, a Laplace approximation (the normal matrix where
//!   the fit ended, its robust weights held) under the priors that it has: the front's plane, the hand's noise, and a line
//!   along the part's side where there is one.
//! - Any other hinge: the prior of its source times what the hands' arcs say of their centre, the radius free: a Laplace
//!   approximation again, the same Fisher information.
//! - An opening whose open state was seen: the same fit, all else integrated out; of a part that was found as it was
//!   left, of both clips. What depth says of hinges and openings is widened (`inference.shared_errors`): its covariance is
//!   multiplied, and a hinge has the error of one spot's depth that no number of views makes smaller.
//! - Any other opening: the prior of a grip, and what the hinge's error adds to first order.

use nalgebra::{Matrix2, Matrix3, Vector2};
use serde::{Deserialize, Serialize};

use super::{ClipJoint, ENDS, openings};
use crate::articulation::{Articulation, JointKind};
use crate::config;
use crate::geometry::{AxisCandidate, AxisSource, Face};
use crate::hands::{GripStd, Trajectory};
use crate::math::{Point, Vector, any_orthogonal, reject, rotation, stats, unit};

/// A covariance over two directions across an axis, by rows.
pub type Covariance = [[f64; 2]; 2];

/// How sure a joint is, given that its type and hypothesis are right.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Uncertainty {
    /// The two directions that the covariances are over: world, unit, square to each other and to the axis. Of a joint whose
    /// axis lies in its face: out of the face, and along it. Of one whose axis leaves its face: up the face, and across it.
    /// Without a face: any two.
    pub across: [Vector; 2],
    /// Covariance of the axis' turns about the two directions, rad^2.
    pub axis_cov_rad2: Covariance,
    /// Covariance of the hinge along the two directions, at the middle of the part, m^2; none for slides.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub origin_cov_m2: Option<Covariance>,
    /// Standard deviation of the largest opening that a clip went through, rad or m.
    pub observed_range_std: f64,
    /// Standard deviation of the opening that each clip went through, rad or m.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub moved_std: Vec<f64>,
}

impl Uncertainty {
    /// The same about an axis a little beside the joint's, as furniture is set upright: the directions turn with it.
    #[must_use]
    pub fn about(self, axis: &Vector) -> Self {
        let Some(first) = unit(&reject(&self.across[0], axis)) else { return self };
        let second = axis.cross(&first);
        let second = if second.dot(&self.across[1]) < 0.0 { -second } else { second };
        Self { across: [first, second], ..self }
    }

    /// Whether it can be worked with, for a joint with this unit axis. `Err` says what is wrong.
    ///
    /// # Errors
    /// The first fault, in words.
    pub fn check(&self, axis: &Vector) -> Result<(), String> {
        let frame = Matrix3::from_columns(&[self.across[0], self.across[1], *axis]);
        let orthonormal = (frame.transpose() * frame - Matrix3::identity()).norm() < 1e-3;
        if !orthonormal {
            return Err("across must be two unit vectors, square to each other and to the axis".to_owned());
        }
        let covariances =
            [("axis_cov_rad2", Some(&self.axis_cov_rad2)), ("origin_cov_m2", self.origin_cov_m2.as_ref())];
        for (name, covariance) in covariances {
            if covariance.is_some_and(|c| !is_covariance(c)) {
                return Err(format!("{name} must be finite, symmetric and positive definite"));
            }
        }
        if !std::iter::once(&self.observed_range_std).chain(&self.moved_std).all(|s| s.is_finite() && *s > 0.0) {
            return Err("standard deviations must be finite and positive".to_owned());
        }
        Ok(())
    }
}

fn is_covariance(covariance: &Covariance) -> bool {
    let [[a, b], [c, d]] = *covariance;
    let finite = [a, b, c, d].iter().all(|x| x.is_finite());
    finite && a > 0.0 && d > 0.0 && (b - c).abs() <= 1e-6 * (a + d) && a * d - b * c > 0.0
}

/// Length of an error in standard deviations along it (Mahalanobis); none where the matrix is no covariance.
#[must_use]
pub fn sigmas(covariance: &Covariance, error: [f64; 2]) -> Option<f64> {
    let [[a, b], [c, d]] = *covariance;
    let [x, y] = error;
    is_covariance(covariance)
        .then(|| ((d * x * x - (b + c) * x * y + a * y * y) / (a * d - b * c)).max(0.0).sqrt())
        .filter(|length| length.is_finite())
}

/// The two directions of [`Uncertainty::across`] for a unit axis.
#[must_use]
pub fn across(axis: &Vector, face: Option<&Face>) -> [Vector; 2] {
    /// Geometry: an axis at more than 45 degrees to the face leaves it.
    const LEAVES: f64 = std::f64::consts::FRAC_1_SQRT_2;
    let first = face
        .map(|f| if axis.dot(&f.normal).abs() < LEAVES { f.normal } else { f.up })
        .and_then(|direction| unit(&reject(&direction, axis)))
        .unwrap_or_else(|| any_orthogonal(axis));
    [first, axis.cross(&first)]
}

/// What the depth of the open states told about a joint.
#[derive(Debug, Clone, PartialEq)]
pub struct OpenStates {
    /// Directions of `hinge_cov_m2`, world, unit, square to each other and to the axis.
    pub across: [Vector; 2],
    /// Covariance of a hinge along them, m^2; none for slides.
    pub hinge_cov_m2: Option<Covariance>,
    /// Standard deviation of each clip's opening, rad or m; not finite where a clip has no view.
    pub moved_std: Vec<f64>,
}

/// What the uncertainty of a joint follows from.
#[derive(Debug, Clone, Copy)]
pub struct Evidence<'a> {
    /// The joint.
    pub joint: &'a Articulation,
    /// The candidate that it was: its source is its prior.
    pub chosen: &'a AxisCandidate,
    /// The touched face.
    pub face: Option<&'a Face>,
    /// The hand of each clip.
    pub hands: &'a [&'a Trajectory],
    /// Whether the hands' paths moved the hinge ([`crate::geometry::candidates::settled`]); the paper's rules leave lines
    /// where they are.
    pub settled: bool,
    /// Opening that each clip went through, rad or m.
    pub moved: &'a [f64],
    /// What depth told, where the open state was seen.
    pub depth: Option<&'a OpenStates>,
}

/// The candidate that a clip's joint was; where it is none of them, what is known of its source.
#[must_use]
pub fn chosen(joint: &ClipJoint, candidates: &[AxisCandidate], sources: &config::AxisSources) -> AxisCandidate {
    let same = |c: &&AxisCandidate| c.source == joint.source && c.joint.origin == joint.joint.origin;
    candidates.iter().find(same).cloned().unwrap_or_else(|| AxisCandidate::new(joint.joint, joint.source, sources))
}

/// How sure a joint is; `None` without a hand, and where a number is lost to rounding.
#[must_use]
pub fn of(
    evidence: &Evidence,
    reasoning: &config::Reasoning,
    part: &config::Part,
    grips: &config::Grips,
) -> Option<Uncertainty> {
    let Evidence { joint, chosen, hands, depth, .. } = *evidence;
    let across = across(&joint.axis, evidence.face);
    let paths: Vec<Vec<Point>> = hands.iter().filter(|_| evidence.settled).map(|hand| hand.positions()).collect();
    let axis = match evidence.face.filter(|f| f.is_assumed()) {
        Some(face) => heading_information(joint, face, &paths, &across, reasoning).try_inverse()?,
        None => axis_information(joint, chosen, &paths, &across, reasoning).try_inverse()?,
    };
    let origin = match joint.kind {
        JointKind::Prismatic => None,
        JointKind::Revolute => Some(match depth.and_then(|d| Some((d.across, d.hinge_cov_m2?))) {
            Some((from, seen)) => turned(&seen, &from, &across),
            None => hinge_information(joint, chosen, &paths, &across, reasoning).try_inverse()?,
        }),
    };
    let moved_std: Vec<f64> = hands
        .iter()
        .enumerate()
        .map(|(i, hand)| {
            let seen = depth.and_then(|d| d.moved_std.get(i).copied());
            seen.filter(|std| std.is_finite() && *std > 0.0)
                .unwrap_or_else(|| hand_range_std(joint, hand, &across, origin.as_ref(), part.least_lever_m, grips))
        })
        .collect();
    let largest = evidence.moved.iter().zip(&moved_std).max_by(|a, b| a.0.total_cmp(b.0));
    let uncertainty = Uncertainty {
        across,
        axis_cov_rad2: rows(&axis),
        origin_cov_m2: origin.as_ref().map(rows),
        observed_range_std: *largest?.1,
        moved_std,
    };
    uncertainty.check(&joint.axis).is_ok().then_some(uncertainty)
}

fn rows(m: &Matrix2<f64>) -> Covariance {
    [[m[(0, 0)], m[(0, 1)]], [m[(1, 0)], m[(1, 1)]]]
}

/// A covariance over two directions as one over two others of the same plane.
fn turned(covariance: &Covariance, from: &[Vector; 2], to: &[Vector; 2]) -> Matrix2<f64> {
    let [[a, b], [c, d]] = *covariance;
    let turn = Matrix2::from_fn(|i, j| to[i].dot(&from[j]));
    turn * Matrix2::new(a, b, c, d) * turn.transpose()
}

/// Information about the axis' turns about the two directions, rad^-2.
fn axis_information(
    joint: &Articulation,
    chosen: &AxisCandidate,
    paths: &[Vec<Point>],
    across: &[Vector; 2],
    reasoning: &config::Reasoning,
) -> Matrix2<f64> {
    // A line at a face has a side, and the face's direction.
    let (prior_std, free) = match (chosen.source, chosen.side) {
        (AxisSource::Line, None) => (reasoning.directions.line_std_rad, true),
        (AxisSource::HandPath, _) => (reasoning.directions.free_std_rad, true),
        _ => (reasoning.directions.frame_std_deg.to_radians(), false),
    };
    let prior = Matrix2::identity() * prior_std.powi(-2);
    paths.iter().filter(|_| free).fold(prior, |sum, path| {
        let each = match joint.kind {
            JointKind::Revolute => Arc::of(path, joint, across).map_or_else(Matrix2::zeros, |arc| arc.of_tilt()),
            JointKind::Prismatic => of_pull(path, joint),
        };
        sum + each * worth(path, reasoning)
    })
}

/// The same for an axis of a front that the hand suggests: it stands upright as furniture does, and which way it looks the hand
/// tells. An upright axis has no heading.
fn heading_information(
    joint: &Articulation,
    face: &Face,
    paths: &[Vec<Point>],
    across: &[Vector; 2],
    reasoning: &config::Reasoning,
) -> Matrix2<f64> {
    let vertical = if face.normal.z.abs() > face.up.z.abs() { face.normal } else { face.up };
    let told = paths.iter().fold(Matrix2::zeros(), |sum: Matrix2<f64>, path| {
        let each = match joint.kind {
            JointKind::Revolute => Arc::of(path, joint, across).map_or_else(Matrix2::zeros, |arc| arc.of_tilt()),
            JointKind::Prismatic => of_pull(path, joint),
        };
        sum + each * worth(path, reasoning)
    });
    let known = |k: usize| match across[k].dot(&vertical).abs() > std::f64::consts::FRAC_1_SQRT_2 {
        true => reasoning.directions.free_std_rad.powi(-2) + told[(k, k)],
        false => reasoning.directions.frame_std_deg.to_radians().powi(-2),
    };
    Matrix2::from_diagonal(&Vector2::new(known(0), known(1)))
}

/// Information about the hinge along the two directions, m^-2.
fn hinge_information(
    joint: &Articulation,
    chosen: &AxisCandidate,
    paths: &[Vec<Point>],
    across: &[Vector; 2],
    reasoning: &config::Reasoning,
) -> Matrix2<f64> {
    let prior = Matrix2::identity() * chosen.position_std_m.powi(-2);
    paths.iter().fold(prior, |sum, path| {
        let each = Arc::of(path, joint, across).map_or_else(Matrix2::zeros, |arc| arc.of_center());
        sum + each * worth(path, reasoning)
    })
}

/// Independent samples in a path over the variance of one, m^-2.
fn worth(path: &[Point], reasoning: &config::Reasoning) -> f64 {
    reasoning.effective_samples.min(path.len() as f64) / reasoning.hand_std_m.powi(2)
}

/// Least and largest opening along a path against its first point, without the extreme 3 % of the samples as in
/// [`super::observed_range`].
fn extent(path: &[Point], joint: &Articulation) -> Option<[f64; 2]> {
    let all = openings(joint, path.first()?, path);
    Some([stats::quantile(&all, ENDS)?, stats::quantile(&all, 1.0 - ENDS)?])
}

/// Information that one sample (of unit variance) of an even pull holds about the direction's turns: the variance of a
/// place along it, m^2.
fn of_pull(path: &[Point], joint: &Articulation) -> Matrix2<f64> {
    let variance = extent(path, joint).map_or(0.0, |[low, high]| (high - low).powi(2) / 12.0);
    Matrix2::identity() * variance
}

/// An arc about a hinge, drawn evenly, in the coordinates of two directions across the axis.
#[derive(Debug, Clone, Copy)]
struct Arc {
    radius_m: f64,
    /// Half of the angle between its ends, radians.
    half_angle: f64,
    /// Unit, from the hinge to the arc's middle.
    middle: Vector2<f64>,
}

impl Arc {
    /// `None` for a path that begins on the axis.
    fn of(path: &[Point], joint: &Articulation, across: &[Vector; 2]) -> Option<Self> {
        let [low, high] = extent(path, joint)?;
        let start = unit(&reject(&(path.first()? - joint.origin), &joint.axis))?;
        let middle = rotation(&joint.axis, 0.5 * (low + high)) * start;
        let distances: Vec<f64> = path.iter().map(|p| joint.lever(p)).collect();
        Some(Self {
            radius_m: stats::mean(&distances)?,
            half_angle: 0.5 * (high - low),
            middle: Vector2::new(middle.dot(&across[0]), middle.dot(&across[1])),
        })
    }

    /// Variance of the points of the unit arc, towards its middle and along its chord.
    fn spread(&self) -> [f64; 2] {
        let half = self.half_angle;
        // Arithmetic: below this the closed form is rounding.
        if half < 1e-3 {
            return [0.0, half * half / 3.0];
        }
        let (double, mean) = ((2.0 * half).sin() / (4.0 * half), half.sin() / half);
        [(0.5 + double - mean * mean).max(0.0), (0.5 - double).max(0.0)]
    }

    /// The directions to the middle and of the chord, each times itself.
    fn directions(&self) -> [Matrix2<f64>; 2] {
        let chord = Vector2::new(-self.middle.y, self.middle.x);
        [self.middle * self.middle.transpose(), chord * chord.transpose()]
    }

    /// Information that one sample (of unit variance) holds about the centre when the radius is free: moving the centre
    /// moves a point by its ray's share of that, and the mean of all rays is a change of the radius.
    fn of_center(&self) -> Matrix2<f64> {
        let ([towards, along], [middle, chord]) = (self.spread(), self.directions());
        middle * towards + chord * along
    }

    /// The same about the axis' turns, m^2: turned about the chord, the points leave their plane by how far they lie towards
    /// the middle, about the middle by how far along the chord. Where along the axis the arc lies is free.
    fn of_tilt(&self) -> Matrix2<f64> {
        let ([towards, along], [middle, chord]) = (self.spread(), self.directions());
        (chord * towards + middle * along) * self.radius_m.powi(2)
    }
}

/// Standard deviation of the opening that a clip went through as its hand tells it, rad or m. As in `part::openings` the
/// hand is off by as much all along a clip; an open end that was not seen adds the way that it may still have gone.
/// `least_lever_m`: hands hold parts no nearer to their hinge.
fn hand_range_std(
    joint: &Articulation,
    hand: &Trajectory,
    across: &[Vector; 2],
    origin: Option<&Matrix2<f64>>,
    least_lever_m: f64,
    grips: &config::Grips,
) -> f64 {
    let [closed, open] = [hand.closed_grip(), hand.open_grip()];
    let GripStd { closed_m, lost_m } = GripStd::of(hand, grips);
    let grip_m = if hand.open_end_seen() { closed_m } else { closed_m.hypot(lost_m) };
    let by_grip = grip_m / joint.lever(&closed).max(least_lever_m);
    let by_hinge = origin.map_or(0.0, |covariance| {
        // How the direction from the hinge to a grip turns when the hinge moves.
        let turn = |grip: &Point| {
            let ray = reject(&(grip - joint.origin), &joint.axis);
            let by = joint.axis.cross(&ray) / ray.norm().max(least_lever_m).powi(2);
            Vector2::new(by.dot(&across[0]), by.dot(&across[1]))
        };
        let gradient = turn(&closed) - turn(&open);
        gradient.dot(&(covariance * gradient)).max(0.0)
    });
    (by_grip * by_grip + by_hinge).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::articulation::Action;
    use crate::hands::Sample;
    use crate::math::{circle, plane::Plane};
    use nalgebra::Point2;
    use rand::SeedableRng;
    use rand_distr::{Distribution, Normal};

    /// `reasoning.directions.frame_std_deg` and `free_std_rad`.
    const FRAME_STD_RAD: f64 = std::f64::consts::PI / 180.0;
    const FREE_STD_RAD: f64 = 0.5;

    /// An upright hinge at the origin and a front to its right that looks to -y.
    fn door() -> Articulation {
        Articulation { kind: JointKind::Revolute, axis: -Vector::z(), origin: Point::origin() }
    }

    fn face() -> Face {
        Face {
            center: Point::new(0.5, 0.0, 0.0),
            right: Vector::x(),
            up: Vector::z(),
            normal: -Vector::y(),
            extent: [[-0.5, 0.1], [-0.4, 0.4]],
            support: 1.0,
        }
    }

    /// A hand that takes a joint from closed to `opening`.
    fn hand(joint: &Articulation, opening: f64, open_end_seen: bool) -> Trajectory {
        let grip = Point::new(0.5, 0.0, 0.0);
        let samples = (0..60)
            .map(|i| {
                let p = joint.motion(opening * f64::from(i) / 59.0) * grip;
                Sample { frame: i as usize, time_secs: f64::from(i), observed: p, smoothed: p, accepted: true }
            })
            .collect();
        Trajectory { side: None, samples, action: Action::Open, ends_seen: [true, open_end_seen] }
    }

    fn candidate(joint: &Articulation, source: AxisSource) -> AxisCandidate {
        AxisCandidate::new(*joint, source, &config::AxisSources::default())
    }

    /// Under the default config.
    fn told(evidence: &Evidence) -> Option<Uncertainty> {
        let (reasoning, part) = (config::Reasoning::default(), config::Part::default());
        of(evidence, &reasoning, &part, &config::Grips::default())
    }

    fn known(
        joint: &Articulation,
        source: AxisSource,
        hands: &[&Trajectory],
        depth: Option<&OpenStates>,
    ) -> Uncertainty {
        let moved: Vec<f64> =
            hands.iter().map(|h| super::super::observed_range(joint, &h.closed_grip(), &h.positions())).collect();
        let (chosen, face) = (candidate(joint, source), face());
        let evidence =
            Evidence { joint, chosen: &chosen, face: Some(&face), hands, settled: true, moved: &moved, depth };
        told(&evidence).unwrap()
    }

    #[test]
    fn the_closed_form_of_an_arc_is_the_spread_of_its_fits() {
        const SAMPLES: usize = 40;
        const TRIALS: usize = 500;
        const STD_M: f64 = 0.01;
        let arc = Arc { radius_m: 0.5, half_angle: 60f64.to_radians(), middle: Vector2::x() };
        let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(11);
        let noise = Normal::new(0.0, STD_M).unwrap();
        // Towards the middle and along the chord: the circle's centre; about both: the turn of the arc's plane.
        let (mut center, mut tilt) = ([0.0; 2], [0.0; 2]);
        for _ in 0..TRIALS {
            let points: Vec<Point> = (0..SAMPLES)
                .map(|i| {
                    let a = arc.half_angle * (2.0 * (i as f64 + 0.5) / SAMPLES as f64 - 1.0);
                    let exact = Vector::new(a.cos(), a.sin(), 0.0) * arc.radius_m;
                    Point::from(exact + Vector::from_fn(|_, _| noise.sample(&mut rng)))
                })
                .collect();
            let flat: Vec<Point2<f64>> = points.iter().map(|p| Point2::new(p.x, p.y)).collect();
            let found = circle::fit(&flat).unwrap().center;
            center[0] += found.x * found.x;
            center[1] += found.y * found.y;
            let normal = Plane::fit(&points).unwrap().normal;
            // A turn about x moves the tip of z along y, one about y along x.
            tilt[0] += (normal.y / normal.z).powi(2);
            tilt[1] += (normal.x / normal.z).powi(2);
        }
        let worth = SAMPLES as f64 / (STD_M * STD_M);
        for (name, information, sums) in [("centre", arc.of_center(), center), ("tilt", arc.of_tilt(), tilt)] {
            let covariance = (information * worth).try_inverse().unwrap();
            for k in 0..2 {
                let (said, found) = (covariance[(k, k)].sqrt(), (sums[k] / TRIALS as f64).sqrt());
                assert!((said / found - 1.0).abs() < 0.25, "{name} {k}: {said} {found}");
            }
        }
    }

    #[test]
    fn a_wide_arc_places_a_hinge_better_than_its_source_and_a_second_clip_better_still() {
        let (short, wide) = (hand(&door(), 0.1, true), hand(&door(), 1.6, true));
        let hinge = |hands: &[&Trajectory]| known(&door(), AxisSource::HandArc, hands, None).origin_cov_m2.unwrap();
        let prior = AxisSource::HandArc.position_std_m(&config::AxisSources::default()).powi(2);
        let [none, one, two] = [hinge(&[&short]), hinge(&[&wide]), hinge(&[&wide, &wide])];
        assert!(none[0][0] > 0.4 * prior && none[1][1] > 0.9 * prior, "{none:?}");
        for k in 0..2 {
            assert!(one[k][k] < 0.3 * prior && two[k][k] < 0.7 * one[k][k], "{one:?} {two:?}");
        }
    }

    #[test]
    fn a_frames_axis_is_as_good_as_the_frame_and_a_pull_as_good_as_it_is_long() {
        let drawer = Articulation { kind: JointKind::Prismatic, axis: -Vector::y(), origin: Point::origin() };
        let axis_std = |source: AxisSource, travel: f64| {
            let found = known(&drawer, source, &[&hand(&drawer, travel, true)], None);
            assert!(found.origin_cov_m2.is_none());
            found.axis_cov_rad2[0][0].sqrt()
        };
        assert!((axis_std(AxisSource::FaceNormal, 0.4) - FRAME_STD_RAD).abs() < 1e-9);
        let [short, long] = [axis_std(AxisSource::HandPath, 0.1), axis_std(AxisSource::HandPath, 0.4)];
        assert!(long < 0.4 * short && short < FREE_STD_RAD && long > FRAME_STD_RAD, "{short} {long}");
    }

    #[test]
    fn the_heading_of_an_assumed_front_is_as_good_as_the_pull_and_upright_axes_stay_upright() {
        let drawer = Articulation { kind: JointKind::Prismatic, axis: -Vector::y(), origin: Point::origin() };
        let assumed = Face { support: 0.0, ..face() };
        let axis_std = |joint: &Articulation, source: AxisSource, travel: f64| {
            let (chosen, hand) = (candidate(joint, source), hand(joint, travel, true));
            let moved = [travel];
            let evidence = Evidence {
                joint,
                chosen: &chosen,
                face: Some(&assumed),
                hands: &[&hand],
                settled: true,
                moved: &moved,
                depth: None,
            };
            let covariance = told(&evidence).unwrap().axis_cov_rad2;
            [covariance[0][0].sqrt(), covariance[1][1].sqrt()]
        };
        let largest = |[a, b]: [f64; 2]| a.max(b);
        let [short, long] = [0.1, 0.4].map(|travel| largest(axis_std(&drawer, AxisSource::FaceNormal, travel)));
        assert!(long < 0.4 * short && long > 2.0 * FRAME_STD_RAD, "{short} {long}");
        assert!(largest(axis_std(&door(), AxisSource::HandArc, 1.0)) < 1.01 * FRAME_STD_RAD);
    }

    #[test]
    fn what_depth_told_stands_and_its_directions_are_turned_to_the_faces() {
        let hand = hand(&door(), 1.0, true);
        let across = across(&door().axis, Some(&face()));
        assert_eq!(across[0], -Vector::y());
        let depth = OpenStates {
            across: [across[1], across[0]],
            hinge_cov_m2: Some([[4e-4, 1e-5], [1e-5, 1e-4]]),
            moved_std: vec![0.02, f64::INFINITY],
        };
        let found = known(&door(), AxisSource::Line, &[&hand, &hand], Some(&depth));
        let [[a, b], [_, d]] = found.origin_cov_m2.unwrap();
        assert!((a - 1e-4).abs() < 1e-12 && (d - 4e-4).abs() < 1e-12 && (b - 1e-5).abs() < 1e-12, "{found:?}");
        // The clip without a view has the hand's word: three centimetres at half a metre, and what the hinge adds.
        assert!(found.moved_std[0] == 0.02 && (0.06..0.1).contains(&found.moved_std[1]), "{found:?}");
    }

    #[test]
    fn an_end_that_was_not_seen_leaves_the_range_open() {
        let std =
            |seen: bool| known(&door(), AxisSource::PlaneEdge, &[&hand(&door(), 1.0, seen)], None).observed_range_std;
        assert!(std(true) >= 0.06 && std(false) > 2.0 * std(true), "{} {}", std(true), std(false));
        let (joint, chosen) = (door(), candidate(&door(), AxisSource::Line));
        let nobody =
            Evidence { joint: &joint, chosen: &chosen, face: None, hands: &[], settled: true, moved: &[], depth: None };
        assert_eq!(told(&nobody), None);
    }

    #[test]
    fn errors_are_counted_in_their_own_standard_deviations() {
        let covariance = [[4.0, 1.9], [1.9, 1.0]];
        let [along, aside] = [[2.0, 1.0], [2.0, -1.0]].map(|e| sigmas(&covariance, e).unwrap());
        assert!(along < 1.1 && aside > 4.0, "{along} {aside}");
        assert!((sigmas(&[[4.0, 0.0], [0.0, 9.0]], [2.0, 3.0]).unwrap() - 2f64.sqrt()).abs() < 1e-12);
        assert_eq!(sigmas(&[[1.0, 2.0], [2.0, 1.0]], [1.0, 0.0]), None);
    }

    #[test]
    fn directions_stay_square_to_an_axis_that_was_set_upright() {
        let found = known(&door(), AxisSource::Line, &[&hand(&door(), 1.0, true)], None);
        let upright = rotation(&Vector::x(), 0.05) * door().axis;
        assert!(found.check(&door().axis).is_ok() && found.check(&upright).unwrap_err().contains("across"));
        let about = found.clone().about(&upright);
        assert!(about.check(&upright).is_ok() && about.across[0].dot(&found.across[0]) > 0.99);
        let flat = Uncertainty { axis_cov_rad2: [[1.0, 1.0], [1.0, 1.0]], ..found };
        assert!(flat.check(&door().axis).unwrap_err().contains("axis_cov_rad2"));
    }
}
