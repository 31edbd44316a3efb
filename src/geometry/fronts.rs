//! Fronts that nobody saw (ours): where the way of a hand, lines, sparse points, the room and the person say that one could be.
//!
//! A hand that takes hold stands off a front by what handles do, and what opens leaves its front at a right angle at first: a
//! drawer all along, a door along the tangent of its arc. So a pull tells one heading, an arc and each upright line another (the
//! front through the hinge), a sliding door the one square to its way; a lid lies level. Which of these it is the hand's path
//! decides with the candidates on each ([`super::candidates::on_assumed`]).

use super::candidates::{IN_FACE, arc_about, outwardness};
use super::face::{LEVEL_COS, leaves, seen_from};
use super::{Face, LineTrack, ManhattanFrame};
use crate::articulation::{Articulation, JointKind};
use crate::config::{self, Priors};
use crate::math::{Point, Vector, any_orthogonal, reject, signed_angle, unit, unsigned_angle};

/// A front that a part could have.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Front {
    /// Where it is. Its support is zero unless points show it.
    pub face: Face,
    /// Log of how far it is believed in before the hand's path is asked; all fronts of a part share one.
    pub log_prior: f64,
}

/// What is known where a hand took hold.
#[derive(Debug, Clone, Copy)]
pub struct Around<'a> {
    /// The grip when closed, world.
    pub grip: Point,
    /// The hand's way from closed to open, world.
    pub path: &'a [Point],
    /// Where the person's eyes are meanwhile, world.
    pub viewpoint: Point,
    /// Against gravity, unit.
    pub up: Vector,
    /// The room's frame.
    pub manhattan: Option<&'a ManhattanFrame>,
    /// Lines near the grip.
    pub lines: &'a [LineTrack],
    /// A plane through sparse points off which the grip stands.
    pub through_points: Option<Face>,
    /// Share of such furniture whose moving face is level, by its name; one half where nothing is known.
    pub level: f64,
}

/// All fronts that a part could have; never empty.
#[must_use]
pub fn assumed(
    around: &Around,
    geometry: &config::Geometry,
    reasoning: &config::Reasoning,
    priors: &Priors,
) -> Vec<Front> {
    let (standoff_m, rules) = (priors.handles.standoff_m, &geometry.fronts);
    let same = rules.same_rad;
    let mut faces: Vec<Face> = around.through_points.iter().map(|f| Face { extent: extent(), ..*f }).collect();
    let seen = faces.len();
    for normal in headings(around, standoff_m, rules) {
        if !faces.iter().any(|f| signed_angle(&f.normal, &normal) < same) {
            faces.push(face(&around.grip, normal, around.up, standoff_m));
        }
    }
    for away in lids(around, rules) {
        let is_it = |f: &Face| f.normal.dot(&around.up) > LEVEL_COS && unsigned_angle(&f.up, &away) < same;
        if !faces.iter().any(is_it) {
            faces.push(face(&around.grip, around.up, away, standoff_m));
        }
    }
    // Seen by points, along a wall, anywhere.
    let group = |i: usize, f: &Face| if i < seen { 0 } else { 1 + usize::from(!is_aligned(f, around, rules)) };
    let groups: Vec<usize> = faces.iter().enumerate().map(|(i, f)| group(i, f)).collect();
    // However many headings are tried, upright fronts together are as usual as they are, and so are lids.
    let is_lid = |i: usize| faces[i].normal.dot(&around.up) > LEVEL_COS;
    let alike = |i: usize| (0..faces.len()).filter(|&k| groups[k] == groups[i] && is_lid(k) == is_lid(i)).count();
    let weights: Vec<f64> = faces
        .iter()
        .enumerate()
        .map(|(i, f)| habit(f, around, rules, &priors.fronts) / alike(i).max(1) as f64)
        .collect();
    let [points, walls] = [reasoning.points_front_share, priors.fronts.along_walls_share];
    let shares = [points, (1.0 - points) * walls, (1.0 - points) * (1.0 - walls)];
    let sums = [0, 1, 2].map(|g| (0..faces.len()).filter(|&i| groups[i] == g).map(|i| weights[i]).sum::<f64>());
    let there: f64 = (0..3).filter(|&g| sums[g] > 0.0).map(|g| shares[g]).sum();
    let log_prior = |i: usize| (shares[groups[i]] / there * weights[i] / sums[groups[i]]).ln();
    faces.iter().enumerate().map(|(i, face)| Front { face: *face, log_prior: log_prior(i) }).collect()
}

fn extent() -> [[f64; 2]; 2] {
    /// Geometry: a front that nobody saw has no end; metres from the grip to each side, farther than any hinge is.
    const EXTENT_M: f64 = 0.95;
    [[-EXTENT_M, EXTENT_M]; 2]
}

/// A face with this normal off which a grip stands; `up` is made square to the normal.
fn face(grip: &Point, normal: Vector, up: Vector, standoff_m: f64) -> Face {
    let up = unit(&reject(&up, &normal)).unwrap_or_else(|| any_orthogonal(&normal));
    let center = grip - normal * standoff_m;
    Face { center, right: up.cross(&normal), up, normal, extent: extent(), support: 0.0 }
}

/// Level directions in which an upright front could look, the likeliest first; never empty.
fn headings(around: &Around, standoff_m: f64, rules: &config::AssumedFronts) -> Vec<Vector> {
    let Around { grip, path, viewpoint, up, .. } = *around;
    let to_person = unit(&reject(&(viewpoint - grip), &up)).unwrap_or_else(|| any_orthogonal(&up));
    let way = path.first().zip(path.last()).map_or_else(Vector::zeros, |(from, to)| reject(&(to - from), &up));
    let pull = unit(&way).filter(|_| way.norm() >= rules.least_way_m);
    let mut out: Vec<Vector> = Vec::new();
    for axis in around.manhattan.iter().flat_map(|m| m.axes) {
        out.extend(
            unit(&reject(&axis, &up)).filter(|_| axis.dot(&up).abs() < LEVEL_COS).into_iter().flat_map(|a| [a, -a]),
        );
    }
    out.extend(pull);
    if let Some(arc) = arc_about(path, &up) {
        out.extend(upright_through(&grip, &arc.origin, &up, standoff_m));
    }
    let upright = |line: &&LineTrack| line.segment.line.direction.dot(&up).abs() > rules.upright_cos;
    for line in around.lines.iter().filter(upright).take(rules.most_lines) {
        out.extend(upright_through(&grip, &line.segment.middle(), &up, standoff_m));
    }
    out.extend(pull.iter().map(|pull| up.cross(pull)).flat_map(|a| [a, -a]));
    // People stand before what they open: at a slant, but not behind it.
    out.retain(|normal| normal.dot(&to_person) > -rules.behind_cos);
    out.push(to_person);
    out
}

/// Level normals of the two upright fronts through a place off which a grip stands; none where the place is too near.
fn upright_through(grip: &Point, at: &Point, up: &Vector, standoff_m: f64) -> Vec<Vector> {
    let aside = reject(&(at - grip), up);
    let Some(towards) = unit(&aside).filter(|_| aside.norm() > 2.0 * standoff_m) else { return Vec::new() };
    let sine = standoff_m / aside.norm();
    let cosine = (1.0 - sine * sine).sqrt();
    let square = up.cross(&towards);
    [square, -square].map(|side| side * cosine - towards * sine).to_vec()
}

/// Level directions away from the person along which a lid could lie: the way of a hand that lifts it, and the person's own view
/// along the room's walls, or as it is.
fn lids(around: &Around, rules: &config::AssumedFronts) -> Vec<Vector> {
    let Around { grip, path, viewpoint, up, .. } = *around;
    let Some(away) = unit(&reject(&(grip - viewpoint), &up)) else { return Vec::new() };
    let way = path.first().zip(path.last()).map_or_else(Vector::zeros, |(from, to)| reject(&(to - from), &up));
    let lifted = unit(&way).filter(|lift| way.norm() >= rules.least_way_m && lift.dot(&away) > rules.lifted_cos);
    let walls = around.manhattan.iter().flat_map(|m| m.axes).flat_map(|a| [a, -a]);
    let wall = walls.filter(|a| a.dot(&up).abs() < LEVEL_COS).max_by(|a, b| a.dot(&away).total_cmp(&b.dot(&away)));
    [wall.and_then(|wall| unit(&reject(&wall, &up))), lifted, Some(away)].into_iter().flatten().collect()
}

/// Whether a front stands along the room's walls.
fn is_aligned(face: &Face, around: &Around, rules: &config::AssumedFronts) -> bool {
    let heading = if face.normal.dot(&around.up) > LEVEL_COS { face.up } else { face.normal };
    around
        .manhattan
        .is_some_and(|m| m.axes.iter().any(|axis| unsigned_angle(axis, &heading) < rules.aligned_deg.to_radians()))
}

/// How usual a front is, whatever path the hand took: people stand before it, what opens leaves it, and few are lids.
fn habit(face: &Face, around: &Around, rules: &config::AssumedFronts, fronts: &config::Fronts) -> f64 {
    /// Arithmetic: what keeps odds and logarithms finite.
    const NONE: f64 = 1e-6;
    let way = around.path.first().zip(around.path.last()).map_or_else(Vector::zeros, |(from, to)| to - from);
    let left = leaves(&face.normal, &way, rules.least_way_m, fronts);
    let odds = around.level / (1.0 - around.level).max(1e-3) * fronts.lid_share / (1.0 - fronts.lid_share);
    let lid = odds / (1.0 + odds);
    if face.normal.dot(&around.up) > LEVEL_COS {
        return left * lid.max(NONE);
    }
    let to_person = reject(&(around.viewpoint - around.grip), &around.up);
    left * seen_from(&face.normal, &to_person, rules.before_cos, fronts) * (1.0 - lid).max(NONE)
}

/// Whether a part with this face, held at `grip` when closed, could have this joint: what opens leaves its front at a right
/// angle or slides within it.
#[must_use]
pub fn may_be_front(face: &Face, joint: &Articulation, grip: &Point) -> bool {
    /// Geometry: the motion leaves the front squarely from this cosine on (32 degrees).
    const SQUARE: f64 = 0.85;
    let out = outwardness(joint, face, grip).abs();
    match joint.kind {
        JointKind::Revolute => out > SQUARE && joint.axis.dot(&face.normal).abs() < IN_FACE,
        JointKind::Prismatic => !(IN_FACE..=SQUARE).contains(&out),
    }
}

/// The front that a joint suggests whose part was held at `grip` (world) when closed: square to how the grip leaves it, the hinge in
/// its plane.
#[must_use]
pub fn of_joint(joint: &Articulation, grip: &Point, up: &Vector, standoff_m: f64) -> Face {
    /// Geometry: the extent of a front of which the joint is all that is known, metres to each side.
    const OF_JOINT_M: f64 = 0.3;
    let looking = |normal: Vector, up: Vector| Face {
        extent: [[-OF_JOINT_M, OF_JOINT_M]; 2],
        ..face(grip, normal, up, standoff_m)
    };
    if joint.kind == JointKind::Prismatic {
        return looking(joint.axis, *up);
    }
    let to_hinge = reject(&(joint.origin - grip), &joint.axis);
    let (Some(towards), Some(leaving)) = (unit(&to_hinge), unit(&to_hinge.cross(&joint.axis))) else {
        return looking(any_orthogonal(&joint.axis), *up);
    };
    // A grip on its hinge has no front; it is left as if the front ran through both.
    let sine = if to_hinge.norm() > 2.0 * standoff_m { standoff_m / to_hinge.norm() } else { 0.0 };
    let normal = leaving * (1.0 - sine * sine).sqrt() - towards * sine;
    // A lid's face has its hinge at its far side.
    looking(normal, if normal.dot(up).abs() > LEVEL_COS { towards } else { *up })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn around(path: &[Point]) -> Around<'_> {
        Around {
            grip: path[0],
            path,
            viewpoint: Point::new(0.2, -0.8, 1.6),
            up: Vector::z(),
            manhattan: None,
            lines: &[],
            through_points: None,
            level: 0.5,
        }
    }

    fn fronts(around: &Around) -> Vec<Front> {
        assumed(around, &config::Geometry::default(), &config::Reasoning::default(), &Priors::default())
    }

    /// A door hung at x = -0.4 in the plane y = 0, held 3.5 cm before it.
    fn door(opening: f64) -> Articulation {
        assert!(opening > 0.0);
        Articulation { kind: JointKind::Revolute, axis: -Vector::z(), origin: Point::new(-0.4, 0.0, 0.0) }
    }

    fn arc(opening: f64) -> Vec<Point> {
        let grip = Point::new(0.0, -0.035, 0.8);
        (0..=30).map(|i| door(opening).motion(opening * f64::from(i) / 30.0) * grip).collect()
    }

    #[test]
    fn a_pull_and_an_arc_each_have_their_front_among_those_that_are_tried() {
        let pull: Vec<Point> = (0..30).map(|i| Point::new(0.0, -0.01 * f64::from(i), 0.8)).collect();
        for path in [pull, arc(1.2)] {
            let found = fronts(&around(&path));
            let off = |f: &Front| signed_angle(&f.face.normal, &-Vector::y());
            assert!(found.iter().any(|f| off(f) < 1e-6), "{found:#?}");
            assert!(found.iter().all(|f| f.face.is_assumed() && f.log_prior.is_finite()));
            assert!((found.iter().map(|f| f.log_prior.exp()).sum::<f64>() - 1.0).abs() < 1e-9);
        }
    }

    #[test]
    fn walls_and_points_are_believed_more_and_names_tell_lids() {
        let path = arc(0.6);
        let room = ManhattanFrame { axes: [Vector::x(), Vector::y(), Vector::z()], frames: 5 };
        let along = Around { manhattan: Some(&room), ..around(&path) };
        let share = |found: &[Front], is: &dyn Fn(&Face) -> bool| -> f64 {
            found.iter().filter(|f| is(&f.face)).map(|f| f.log_prior.exp()).sum()
        };
        let aligned = |f: &Face| is_aligned(f, &along, &config::AssumedFronts::default());
        assert!((share(&fronts(&along), &aligned) - 0.7).abs() < 1e-9);
        let through_points = Some(Face { support: 0.4, ..face(&path[0], -Vector::y(), Vector::z(), 0.035) });
        let seen = fronts(&Around { through_points, ..along });
        assert!((share(&seen, &|f| !f.is_assumed()) - 0.8).abs() < 1e-9);
        let lid = |f: &Face| f.normal.z > 0.9;
        let [plain, chest] = [0.5, 0.95].map(|level| share(&fronts(&Around { level, ..around(&path) }), &lid));
        assert!(plain < 0.2 && chest > 2.0 * plain, "{plain} {chest}");
    }

    #[test]
    fn a_joint_has_one_front_and_another_heading_is_none_of_it() {
        let (joint, grip) = (door(1.0), Point::new(0.0, -0.035, 0.8));
        let front = of_joint(&joint, &grip, &Vector::z(), 0.035);
        assert!((front.normal + Vector::y()).norm() < 1e-9 && front.coordinates(&joint.origin)[2].abs() < 1e-9);
        assert!(may_be_front(&front, &joint, &grip));
        let turned = face(&grip, Vector::new(-1.0, -1.0, 0.0).normalize(), Vector::z(), 0.035);
        assert!(!may_be_front(&turned, &joint, &grip));
        // A lid's hinge is at its upper side, away from who lifts it.
        let lid = Articulation { kind: JointKind::Revolute, axis: Vector::x(), origin: Point::new(0.0, 0.5, 0.8) };
        let front =
            of_joint(&Articulation { axis: -lid.axis, ..lid }, &Point::new(0.0, 0.0, 0.835), &Vector::z(), 0.035);
        assert!(front.normal.z.abs() > 0.99 && front.coordinates(&lid.origin)[1] > 0.4, "{front:?}");
    }
}
