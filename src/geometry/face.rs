//! The front face of the touched furniture: its plane, its own axes, its visible extent.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::LineTrack;
use super::manhattan::ManhattanFrame;
use crate::config::{self, Priors};
use crate::math::plane::Plane;
use crate::math::ransac::{Search, lo_ransac};
use crate::math::stats::{densest, quantile};
use crate::math::{Point, Vector, any_orthogonal, reject, unit};

/// A front face with a right-handed frame (`right`, `up`, `normal`) seen from the person's side.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Face {
    /// The grip projected onto the face: origin of the face's coordinates.
    pub center: Point,
    /// To the viewer's right, in the face.
    pub right: Vector,
    /// Up in the face; on a lid, away from the person.
    pub up: Vector,
    /// Out of the furniture.
    pub normal: Vector,
    /// Visible extent `[right, up][min, max]` of the region in face coordinates, metres. It covers the whole piece of
    /// furniture where masks do.
    pub extent: [[f64; 2]; 2],
    /// Share of the region's points near the grip that lie on the plane; zero of a face that is assumed.
    pub support: f64,
}

impl Face {
    /// Face coordinates (right, up, out) of a world point.
    #[must_use]
    pub fn coordinates(&self, p: &Point) -> [f64; 3] {
        let d = p - self.center;
        [d.dot(&self.right), d.dot(&self.up), d.dot(&self.normal)]
    }

    /// Rotation from the world's axes to the face's (right, up, out).
    #[must_use]
    pub fn from_world(&self) -> nalgebra::Matrix3<f64> {
        nalgebra::Matrix3::from_rows(&[self.right, self.up, self.normal].map(|axis| axis.transpose()))
    }

    /// World point at face coordinates.
    #[must_use]
    pub fn point(&self, right: f64, up: f64, out: f64) -> Point {
        self.center + self.right * right + self.up * up + self.normal * out
    }

    /// Whether nothing was seen on it: it is where the hand says that a front could be.
    #[must_use]
    pub fn is_assumed(&self) -> bool {
        self.support <= 0.0
    }

    /// Whether the face is nearer to horizontal than to vertical: a lid, a chest.
    #[must_use]
    pub fn is_horizontal(&self, world_up: &Vector) -> bool {
        self.normal.dot(world_up).abs() > LEVEL_COS
    }
}

/// Geometry: a normal nearer to the vertical than to any level direction has a larger cosine with it (45 degrees).
pub(super) const LEVEL_COS: f64 = 0.7;

/// A rectangle in face coordinates, metres: `[right, up][min, max]`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Rect {
    /// `[[right_min, right_max], [up_min, up_max]]`.
    pub bounds: [[f64; 2]; 2],
}

impl Rect {
    /// Width (along right) and height (along up).
    #[must_use]
    pub fn size(&self) -> [f64; 2] {
        self.bounds.map(|b| b[1] - b[0])
    }
}

/// What is known about the touched furniture before its face is.
#[derive(Debug, Clone, Copy)]
pub struct Surroundings<'a> {
    /// Points of the touched furniture from local and global views, world.
    pub surface: &'a [Point],
    /// The grip at the closed and at the open end of the motion.
    pub grips: [Point; 2],
    /// Where the person stands.
    pub viewpoint: Point,
    /// The room's frame.
    pub manhattan: Option<&'a ManhattanFrame>,
    /// 3D lines at the furniture.
    pub lines: &'a [LineTrack],
    /// The world's up direction.
    pub up: Vector,
    /// Share of such furniture whose moving face is level, a lid; one half where nothing is known.
    pub level: f64,
}

/// Fits the face that the grip stands off, oriented to the viewpoint. `None` where no plane is near the grip.
///
/// A plane is the better a face the more of the surroundings lie on it (squared: a front is most of what is seen around a hand
/// that holds it, while any plane has a few points), the better the grip stands off it as hands hold handles, the more the motion
/// leaves it, the nearer it is to upright or level and to the room's directions, and as the furniture's name has it level or not.
#[must_use]
pub fn fit(around: &Surroundings, config: &config::Geometry, priors: &Priors, seed: u64) -> Option<Face> {
    let (grip, rules) = (around.grips[0], &config.face);
    let near: Vec<Point> =
        around.surface.iter().copied().filter(|p| (p - grip).norm() < rules.neighbourhood_m).collect();
    // Every n-th point is enough for a plane, and keeps the cost independent of the image size.
    let near: Vec<Point> = near.iter().copied().step_by((near.len() / rules.points).max(1)).collect();
    if near.len() < rules.least_points {
        return None;
    }
    let tolerance = config.face_tolerance_m;
    let share =
        |plane: &Plane| near.iter().filter(|p| plane.height(p).abs() <= tolerance).count() as f64 / near.len() as f64;
    let score = |plane: &Plane| share(plane).powi(2) * face_prior(plane, around, rules, priors);
    let refine = |plane: Plane| {
        let inliers: Vec<Point> = near.iter().copied().filter(|p| plane.height(p).abs() <= tolerance).collect();
        Plane::fit(&inliers).map_or(plane, |p| p.facing(&around.viewpoint))
    };
    let mut candidates: Vec<Plane> = Vec::new();
    for axis in around.manhattan.iter().flat_map(|m| m.axes) {
        let normal = if (around.viewpoint - grip).dot(&axis) < 0.0 { -axis } else { axis };
        let mut heights: Vec<f64> = near.iter().map(|p| normal.dot(&p.coords)).collect();
        heights.sort_by(f64::total_cmp);
        // The densest slab of all, and the densest where a handle's face would be.
        let behind: Vec<f64> = {
            let at = normal.dot(&grip.coords);
            let [behind_m, before_m] = rules.behind_grip_m;
            heights.iter().copied().filter(|h| (at - behind_m..at + before_m).contains(h)).collect()
        };
        for offset in [&heights, &behind].into_iter().filter_map(|of| densest_middle(of, 2.0 * tolerance)) {
            let slab = Plane { normal, offset };
            candidates.extend([slab, refine(slab)]);
        }
    }
    // Furniture turned against the room, or no room frame at all: planes from the points themselves. Several rounds, each
    // without the points that the planes before it explained.
    let mut left: Vec<Point> = near.clone();
    for round in 0..rules.rounds {
        let found = lo_ransac::<Plane, 3>(
            left.len(),
            Search { draws: rules.draws, tolerance, seed: seed ^ round },
            |s| Plane::through(&left[s[0]], &left[s[1]], &left[s[2]]),
            |ids| Plane::fit(&ids.iter().map(|&i| left[i]).collect::<Vec<_>>()),
            |plane, i| plane.height(&left[i]).abs(),
        );
        let Some(found) = found else { break };
        candidates.push(found.model.facing(&around.viewpoint));
        left.retain(|p| found.model.height(p).abs() > 2.0 * tolerance);
        if left.len() < rules.least_points {
            break;
        }
    }
    let plane = candidates.into_iter().max_by(|a, b| score(a).total_cmp(&score(b)))?;
    let plane = uprighted(plane, &around.up, &near, config);
    let support = share(&plane);
    // A twentieth of the neighbourhood on a plane happens by chance; a face fills far more.
    if support < rules.least_support {
        return None;
    }
    let normal = plane.normal;
    let up = face_up(&plane, around, rules);
    let right = up.cross(&normal);
    let mut face = Face { center: plane.project(&grip), right, up, normal, extent: [[0.0; 2]; 2], support };
    let on_face: Vec<[f64; 3]> = around
        .surface
        .iter()
        .map(|p| face.coordinates(p))
        .filter(|c| c[2].abs() <= 4.0 * config.face_tolerance_m)
        .collect();
    let seen = seen_places(&on_face, rules);
    // Sparse points fill no cell; then they are all there is.
    let seen = if seen.is_empty() { on_face.iter().map(|c| [c[0], c[1]]).collect() } else { seen };
    for axis in 0..2 {
        let values: Vec<f64> = seen.iter().map(|place| place[axis]).collect();
        face.extent[axis] =
            [quantile(&values, rules.rim_share)?.min(0.0), quantile(&values, 1.0 - rules.rim_share)?.max(0.0)];
    }
    Some(face)
}

/// Middle of the densest window of sorted heights.
fn densest_middle(sorted: &[f64], window: f64) -> Option<f64> {
    let within = sorted.get(densest(sorted, window)?)?;
    Some(0.5 * (within.first()? + within.last()?))
}

/// Corners of the pieces of a face where surface was seen, `[right, up]`, as far as points reach: the top of a tall door is as much
/// of it as what is seen in every frame.
fn seen_places(on_face: &[[f64; 3]], rules: &config::FaceRules) -> Vec<[f64; 2]> {
    let mut cells: BTreeMap<[i64; 2], (usize, [[f64; 2]; 2])> = BTreeMap::new();
    for [right, up, _] in on_face {
        let at = [*right, *up];
        let (count, [low, high]) = cells.entry(at.map(|x| (x / rules.cell_m).floor() as i64)).or_insert((0, [at, at]));
        *count += 1;
        for k in 0..2 {
            low[k] = low[k].min(at[k]);
            high[k] = high[k].max(at[k]);
        }
    }
    let seen = cells.into_values().filter(|(count, _)| *count >= rules.cell_points);
    seen.flat_map(|(_, corners)| corners).collect()
}

/// A front that is nearly upright is upright: furniture stands on its feet, and a drawer that runs downhill opens by
/// itself. The offset follows from the points that lay on the plane.
fn uprighted(plane: Plane, up: &Vector, near: &[Point], config: &config::Geometry) -> Plane {
    if plane.normal.dot(up).abs() > config.face.upright_deg.to_radians().sin() {
        return plane;
    }
    let Some(normal) = unit(&reject(&plane.normal, up)) else { return plane };
    let offsets: Vec<f64> = near
        .iter()
        .filter(|p| plane.height(p).abs() <= config.face_tolerance_m)
        .map(|p| normal.dot(&p.coords))
        .collect();
    crate::math::stats::median(&offsets).map_or(plane, |offset| Plane { normal, offset })
}

/// How likely a plane is a front that opens, whatever the points say: 1 at best, half of it where no name tells.
fn face_prior(plane: &Plane, around: &Surroundings, rules: &config::FaceRules, priors: &Priors) -> f64 {
    let (fronts, handles) = (&priors.fronts, &priors.handles);
    let [closed, open] = around.grips;
    let standoff = (plane.height(&closed) - handles.standoff_m) / handles.standoff_std_m;
    let held = habit(handles.not_held, (-0.5 * standoff * standoff).exp());
    let left = leaves(&plane.normal, &(open - closed), rules.least_travel_m, fronts);
    let seen = seen_from(&plane.normal, &(around.viewpoint - closed), rules.before_cos, fronts);
    let tilt = plane.normal.dot(&around.up).abs();
    let [upright, level] = rules.aslant_cos;
    let straight = if !(upright..=level).contains(&tilt) { 1.0 } else { fronts.aslant };
    let off_room = around.manhattan.map_or(0.0, |m| {
        m.axes.iter().map(|a| crate::math::unsigned_angle(a, &plane.normal)).fold(f64::INFINITY, f64::min)
    });
    let [on_wall, near_wall] = rules.walls_deg;
    let in_room = match off_room.to_degrees() {
        d if d < on_wall => 1.0,
        d if d < near_wall => fronts.nearly_on_walls,
        _ => fronts.off_walls,
    };
    let named = if tilt > LEVEL_COS { around.level } else { 1.0 - around.level };
    held * left * seen * straight * in_room * named
}

/// Weight of what fits a habit to a share, where what fits it not at all weighs `least`.
fn habit(least: f64, share: f64) -> f64 {
    least + (1.0 - least) * share
}

/// How well a motion leaves a front of that outward normal: a drawer straight, a door by half of its chord or more; a way that is
/// shorter than `least_m` tells nothing. Sliding doors stay in theirs.
pub(super) fn leaves(normal: &Vector, way: &Vector, least_m: f64, fronts: &config::Fronts) -> f64 {
    let far = way.norm();
    if far < least_m { 1.0 } else { habit(fronts.not_left, (normal.dot(way) / far).clamp(0.0, 1.0)) }
}

/// How well a person stands before a front of that outward normal: squarely up to this cosine of the angle to the front's own
/// normal. People stand before what they open, not beside it.
pub(super) fn seen_from(normal: &Vector, to_person: &Vector, before_cos: f64, fronts: &config::Fronts) -> f64 {
    let towards = unit(to_person).map_or(1.0, |d| normal.dot(&d));
    habit(fronts.from_beside, (towards / before_cos).clamp(0.0, 1.0))
}

/// Up within the face; on a lid, away from the person along the furniture's own edges.
fn face_up(plane: &Plane, around: &Surroundings, rules: &config::FaceRules) -> Vector {
    let normal = plane.normal;
    if normal.dot(&around.up).abs() <= LEVEL_COS {
        return unit(&reject(&around.up, &normal)).unwrap_or_else(|| any_orthogonal(&normal));
    }
    let away = reject(&(around.grips[0] - around.viewpoint), &normal);
    let ahead = |d: Vector| if d.dot(&away) < 0.0 { -d } else { d };
    let Some(d) = level_direction(plane, around, rules) else {
        return unit(&away).unwrap_or_else(|| any_orthogonal(&normal));
    };
    let [d, across] = [ahead(d), ahead(normal.cross(&d))];
    if d.dot(&away) >= across.dot(&away) { d } else { across }
}

/// One of the two directions in which a level face's edges run: that of most of the lines on it, the room's walls counting as
/// one more.
fn level_direction(plane: &Plane, around: &Surroundings, rules: &config::FaceRules) -> Option<Vector> {
    let normal = plane.normal;
    let on_face = around.lines.iter().filter(|line| {
        let middle = line.segment.middle();
        plane.height(&middle).abs() <= rules.edges_within_m
            && (middle - around.grips[0]).norm() <= 2.0 * rules.neighbourhood_m
            && line.segment.line.direction.dot(&normal).abs() < rules.edges_level_sin
    });
    let walls = around
        .manhattan
        .iter()
        .flat_map(|m| m.axes)
        .filter(|a| a.dot(&normal).abs() < 0.5 /* geometry: 60 degrees and more */);
    let directions: Vec<(Vector, f64)> = on_face
        .map(|line| (line.segment.line.direction, line.segment.length()))
        .chain(walls.take(1).map(|a| (a, rules.walls_m)))
        .filter_map(|(d, weight)| Some((unit(&reject(&d, &normal))?, weight)))
        .collect();
    // Edges of furniture are square to each other: the angle counts up to quarter turns, -45 to 45 degrees.
    let off = |a: &Vector, b: &Vector| {
        let (sine, cosine) = (a.cross(b).dot(&normal), a.dot(b));
        0.25 * (4.0 * sine.atan2(cosine)).sin().atan2((4.0 * sine.atan2(cosine)).cos())
    };
    let support = |d: &Vector| -> f64 {
        directions
            .iter()
            .map(|(other, weight)| weight * (-0.5 * (off(d, other) / rules.edges_spread_rad).powi(2)).exp())
            .sum()
    };
    let (best, _) = directions
        .iter()
        .map(|(d, _)| (*d, support(d)))
        .reduce(|best, next| if next.1 > best.1 { next } else { best })?;
    // The mean of those that agree.
    let agreeing =
        directions.iter().map(|(d, w)| (off(&best, d), *w)).filter(|(a, _)| a.abs() <= 2.0 * rules.edges_spread_rad);
    let (sum, total) = agreeing.fold((0.0, 0.0), |(sum, total), (a, w)| (sum + a * w, total + w));
    Some(crate::math::rotation(&normal, sum / total) * best)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A cabinet front at y = 0 with a worktop above it: the front is the face, its frame looks at the person.
    #[test]
    fn the_front_is_chosen_over_the_worktop() {
        let mut points = Vec::new();
        for i in 0..40 {
            for j in 0..40 {
                let (a, b) = (f64::from(i) * 0.02 - 0.4, f64::from(j) * 0.02);
                points.push(Point::new(a, 0.0, b));
                points.push(Point::new(a, b, 0.82));
            }
        }
        let around = Surroundings {
            surface: &points,
            grips: [Point::new(0.05, -0.035, 0.7), Point::new(0.05, -0.3, 0.7)],
            viewpoint: Point::new(0.2, -0.8, 1.6),
            manhattan: None,
            up: Vector::z(),
            level: 0.5,
            lines: &[],
        };
        let face = fit(&around, &config::Geometry::default(), &Priors::default(), 0).unwrap();
        assert!((face.normal + Vector::y()).norm() < 1e-6, "{face:?}");
        assert!((face.right - Vector::x()).norm() < 1e-6 && (face.up - Vector::z()).norm() < 1e-6);
        assert!((face.coordinates(&Point::new(0.05, -0.035, 0.7))[2] - 0.035).abs() < 1e-9);
        assert!((face.extent[0][0] + 0.45).abs() < 0.03 && (face.extent[1][1] - 0.1).abs() < 0.05, "{face:?}");
    }

    /// A hand that was lost 30 cm before a front, at a leaf that stands open there: a fifth of what is near lies on the leaf.
    #[test]
    fn most_of_what_is_near_outweighs_the_place_of_a_hand() {
        let mut points = Vec::new();
        for i in 0..40 {
            for j in 0..40 {
                points.push(Point::new(f64::from(i) * 0.02 - 0.4, 0.0, f64::from(j) * 0.02));
            }
        }
        let leaf =
            points.iter().filter(|p| p.x.abs() < 0.11 && (p.z - 0.4).abs() < 0.2).map(|p| p - 0.265 * Vector::y());
        let leaf: Vec<Point> = leaf.collect();
        let fitted = |surface: &[Point]| {
            let around = Surroundings {
                surface,
                grips: [Point::new(0.05, -0.3, 0.4), Point::new(0.05, -0.5, 0.4)],
                viewpoint: Point::new(0.2, -0.8, 1.6),
                manhattan: Some(&ManhattanFrame { axes: [Vector::x(), Vector::y(), Vector::z()], frames: 5 }),
                up: Vector::z(),
                level: 0.5,
                lines: &[],
            };
            fit(&around, &config::Geometry::default(), &Priors::default(), 0).unwrap().center.y
        };
        let both: Vec<Point> = points.iter().chain(&leaf).copied().collect();
        assert!(fitted(&both).abs() < 0.01, "{}", fitted(&both));
        // With half of the front gone, and as little seen of it as of the leaf, the hand decides.
        points.retain(|p| (p.z - 0.4).abs() > 0.2);
        let hidden: Vec<Point> = points.iter().chain(&leaf).copied().collect();
        assert!((fitted(&hidden) + 0.265).abs() < 0.01, "{}", fitted(&hidden));
    }

    #[test]
    fn a_lid_lies_as_its_edges_do_and_not_as_the_person_stands() {
        let edge = |angle: f64, at: Point| {
            let d = Vector::new(angle.cos(), angle.sin(), 0.0);
            LineTrack {
                segment: crate::math::line::Segment::between(&(at - 0.2 * d), &(at + 0.2 * d)).unwrap(),
                views: vec![0, 1, 2],
                rms_m: 0.002,
                position_covariance: nalgebra::Matrix3::zeros(),
                direction_covariance: nalgebra::Matrix3::zeros(),
            }
        };
        let room = ManhattanFrame { axes: [Vector::x(), Vector::y(), Vector::z()], frames: 5 };
        let plane = Plane { normal: Vector::z(), offset: 0.5 };
        // Two edges of a lid that is turned by 20 degrees, one of something else, one far below.
        let lines = [
            edge(0.349, Point::new(0.0, 0.0, 0.5)),
            edge(0.349 + std::f64::consts::FRAC_PI_2, Point::new(0.2, 0.2, 0.51)),
            edge(0.349, Point::new(0.0, 0.4, 0.5)),
            edge(1.0, Point::new(0.1, 0.1, 0.5)),
            edge(1.0, Point::new(0.1, 0.1, 0.1)),
        ];
        let up = |lines: &[LineTrack], manhattan| {
            let grip = Point::new(0.0, 0.0, 0.53);
            let around = Surroundings {
                surface: &[],
                grips: [grip, grip],
                viewpoint: Point::new(0.25, -0.8, 1.6),
                manhattan,
                lines,
                up: Vector::z(),
                level: 0.5,
            };
            face_up(&plane, &around, &config::FaceRules::default())
        };
        let turned = Vector::new(-(0.349f64.sin()), 0.349f64.cos(), 0.0);
        assert!((up(&lines, Some(&room)) - turned).norm() < 0.01, "{}", up(&lines, Some(&room)));
        assert!((up(&[], Some(&room)) - Vector::y()).norm() < 1e-9);
        assert!(crate::math::unsigned_angle(&up(&[], None), &Vector::new(-0.25, 0.8, 0.0).normalize()) < 1e-6);
    }
}
