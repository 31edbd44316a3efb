//! 3D lines without depth (ours): where the planes of several views meet, of segments that may run along a known direction.
//!
//! Without depth nobody tells which segments of two views are one line. Along a known direction (up, the walls of a room) the
//! plane that a segment spans with its camera leaves the line one degree of freedom: across the direction it is a line in a
//! plane, on which the camera lies. Where those of three views or more meet, and their stretches overlap, is a line in space.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::{Matrix2, Matrix3, Matrix3x2, Vector2};

use super::line_track::{LineTrack, best_first};
use super::segments::SeenSegment;
use super::triangulation::common_span;
use crate::config;
use crate::math::line::{Line, Segment};
use crate::math::{Point, Vector, any_orthogonal};
use crate::recording::Camera;

/// Lines near a `place` (world) along `directions` (world, unit), best supported first. `min_track_views` of them must show
/// each.
#[must_use]
pub fn lines(
    camera: &Camera,
    segments: &[&SeenSegment],
    place: &Point,
    directions: &[Vector],
    config: &config::Geometry,
) -> Vec<LineTrack> {
    let mut out: Vec<LineTrack> =
        directions.iter().flat_map(|direction| along(camera, segments, place, direction, config)).collect();
    best_first(&mut out);
    out
}

/// What a segment leaves open of a line along a direction, in coordinates across that direction from the place.
struct Trace {
    view: usize,
    /// Unit, across the segment's plane.
    normal: Vector2<f64>,
    eye: Vector2<f64>,
    /// Of the camera centre, along the direction.
    eye_along: f64,
    /// Rays to the segment's ends, across and along.
    rays: [(Vector2<f64>, f64); 2],
    length_px: f64,
}

/// A frame of coordinates: the place, two directions across and one along.
struct Frame {
    place: Point,
    across: [Vector; 2],
    along: Vector,
}

impl Frame {
    fn of(place: &Point, along: &Vector) -> Self {
        let first = any_orthogonal(along);
        Self { place: *place, across: [first, along.cross(&first)], along: *along }
    }

    fn flat(&self, v: &Vector) -> Vector2<f64> {
        Vector2::new(v.dot(&self.across[0]), v.dot(&self.across[1]))
    }
}

impl Trace {
    /// `None` for a segment that cannot run along the direction.
    fn of(seen: &SeenSegment, frame: &Frame, config: &config::Geometry) -> Option<Self> {
        let length_px = seen.image.length();
        // Arithmetic: both ends are off independently; poses and the direction itself add the rest.
        let tolerance = config.directed.along_sin + 3.4 * config.tracks.detection_std_px / length_px.max(1.0);
        if seen.plane.dot(&frame.along).abs() > tolerance {
            return None;
        }
        let eye = seen.eye - frame.place;
        Some(Self {
            view: seen.view,
            normal: frame.flat(&seen.plane).try_normalize(1e-6)?,
            eye: frame.flat(&eye),
            eye_along: eye.dot(&frame.along),
            rays: seen.rays.map(|ray| (frame.flat(&ray), ray.dot(&frame.along))),
            length_px,
        })
    }

    /// Distance of the line at `at` from the segment's plane, metres.
    fn off(&self, at: &Vector2<f64>) -> f64 {
        self.normal.dot(&(at - self.eye))
    }

    /// The stretch along the direction that the segment covers of the line at `at`; `None` behind the camera, and seen end on.
    fn span(&self, at: &Vector2<f64>) -> Option<[f64; 2]> {
        let way = at - self.eye;
        let end = |(across, along): (Vector2<f64>, f64)| {
            let square = across.norm_squared();
            let reach = way.dot(&across) / square.max(1e-12);
            // Geometry: not seen end on, and before the camera.
            (square > 0.03 && reach > 0.2).then_some(self.eye_along + reach * along)
        };
        let (a, b) = (end(self.rays[0])?, end(self.rays[1])?);
        Some([a.min(b), a.max(b)])
    }

    /// Standard deviation of the plane at a line, metres.
    fn std_m(&self, at: &Vector2<f64>, camera: &Camera, rules: &config::Tracks) -> f64 {
        ((at - self.eye).norm() * rules.detection_std_px / camera.fx).hypot(rules.pose_std_m)
    }
}

/// Where two segments would be one line.
struct Crossing {
    traces: [usize; 2],
    at: Vector2<f64>,
}

fn along(
    camera: &Camera,
    segments: &[&SeenSegment],
    place: &Point,
    direction: &Vector,
    config: &config::Geometry,
) -> Vec<LineTrack> {
    let frame = Frame::of(place, direction);
    let traces = traces(segments, &frame, config);
    let rules = &config.directed;
    let mut cells: BTreeMap<[i64; 2], Vec<Crossing>> = BTreeMap::new();
    for crossing in crossings(&traces, rules) {
        let cell = [crossing.at.x, crossing.at.y].map(|c| (c / rules.cell_m).floor() as i64);
        cells.entry(cell).or_default().push(crossing);
    }
    let mut free = vec![true; traces.len()];
    let mut out = Vec::new();
    while out.len() < rules.most_lines {
        // The cell in which most views agree, the first of equals.
        let mut best: Option<([i64; 2], usize)> = None;
        for (cell, members) in &cells {
            let views = views_of(members, &traces, &free);
            if views >= config.min_track_views && best.is_none_or(|(_, most)| views > most) {
                best = Some((*cell, views));
            }
        }
        let Some((cell, _)) = best else { break };
        let start = middle(cells.remove(&cell).unwrap_or_default().iter(), &free);
        let Some((track, members)) =
            start.and_then(|at| settled((traces.as_slice(), free.as_slice()), at, &frame, camera, config))
        else {
            continue;
        };
        members.into_iter().for_each(|i| free[i] = false);
        out.push(track);
    }
    out
}

/// The traces of all segments that may run along the direction, the longest of each view.
fn traces(segments: &[&SeenSegment], frame: &Frame, config: &config::Geometry) -> Vec<Trace> {
    let mut all: Vec<Trace> = segments.iter().filter_map(|s| Trace::of(s, frame, config)).collect();
    all.sort_by(|a, b| a.view.cmp(&b.view).then(b.length_px.total_cmp(&a.length_px)));
    let mut taken: BTreeMap<usize, usize> = BTreeMap::new();
    all.retain(|trace| {
        let count = taken.entry(trace.view).or_default();
        *count += 1;
        *count <= config.directed.most_of_a_view
    });
    all
}

/// Where pairs of traces of different views meet near the place.
fn crossings(traces: &[Trace], rules: &config::Directed) -> Vec<Crossing> {
    let mut out = Vec::new();
    for (i, a) in traces.iter().enumerate() {
        for (j, b) in traces.iter().enumerate().skip(i + 1).filter(|(_, b)| b.view != a.view) {
            let system = Matrix2::new(a.normal.x, a.normal.y, b.normal.x, b.normal.y);
            if system.determinant().abs() < rules.least_sine {
                continue;
            }
            let Some(inverse) = system.try_inverse() else { continue };
            let at = inverse * Vector2::new(a.normal.dot(&a.eye), b.normal.dot(&b.eye));
            if at.norm() <= rules.reach_m && share(a.span(&at), b.span(&at), rules) {
                out.push(Crossing { traces: [i, j], at });
            }
        }
    }
    out
}

/// Whether two stretches overlap within reach of the place.
fn share(a: Option<[f64; 2]>, b: Option<[f64; 2]>, rules: &config::Directed) -> bool {
    let reach_m = rules.reach_m;
    let Some(([a0, a1], [b0, b1])) = a.zip(b) else { return false };
    a1.min(b1).min(reach_m) - a0.max(b0).max(-reach_m) >= rules.shared_m
}

/// Different views among the crossings of free traces.
fn views_of(crossings: &[Crossing], traces: &[Trace], free: &[bool]) -> usize {
    let alive = crossings.iter().filter(|c| c.traces.iter().all(|&i| free[i]));
    alive.flat_map(|c| c.traces.map(|i| traces[i].view)).collect::<BTreeSet<usize>>().len()
}

/// Mean place of the crossings of free traces.
fn middle<'a>(crossings: impl Iterator<Item = &'a Crossing>, free: &[bool]) -> Option<Vector2<f64>> {
    let alive = crossings.filter(|c| c.traces.iter().all(|&i| free[i]));
    let (sum, count) = alive.fold((Vector2::zeros(), 0.0), |(sum, count), c| (sum + c.at, count + 1.0));
    (count > 0.0).then(|| sum / count)
}

/// The line that the free traces near `at` show, by least squares that one odd view does not move, and those traces.
fn settled(
    (traces, free): (&[Trace], &[bool]),
    start: Vector2<f64>,
    frame: &Frame,
    camera: &Camera,
    config: &config::Geometry,
) -> Option<(LineTrack, Vec<usize>)> {
    let (rules, noise) = (&config.directed, &config.tracks);
    let reach_m = rules.reach_m;
    let near = |at: &Vector2<f64>, within: f64| -> Vec<usize> {
        let shows = |t: &Trace| {
            let is_there = t.span(at).is_some_and(|[low, high]| high > -reach_m && low < reach_m);
            is_there && t.off(at).abs() <= within * t.std_m(at, camera, noise)
        };
        (0..traces.len()).filter(|&i| free[i] && shows(&traces[i])).collect()
    };
    let mut at = start;
    let mut members = near(&at, 2.0 * rules.tolerance);
    for _ in 0..4 {
        let (mut information, mut pull) = (Matrix2::zeros(), Vector2::zeros());
        for t in members.iter().map(|&i| &traces[i]) {
            let std = t.std_m(&at, camera, noise);
            let weight = (std * std).recip() / (1.0 + (t.off(&at) / std).powi(2));
            information += t.normal * t.normal.transpose() * weight;
            pull += t.normal * (weight * t.normal.dot(&t.eye));
        }
        at = information.try_inverse()? * pull;
        members = near(&at, rules.tolerance);
    }
    let members = one_of_each_view(traces, &members, &at, rules.pieces_m);
    let track = track((traces, members.as_slice()), &at, frame, camera, config)?;
    (track.views.len() >= config.min_track_views && track.position_std_m() <= rules.worst_std_m && at.norm() <= reach_m)
        .then_some((track, members))
}

/// Of each view the segments of one edge: a board's two edges are both near; those beside the nearest one go.
fn one_of_each_view(traces: &[Trace], members: &[usize], at: &Vector2<f64>, pieces_m: f64) -> Vec<usize> {
    let mut nearest: BTreeMap<usize, f64> = BTreeMap::new();
    for t in members.iter().map(|&i| &traces[i]) {
        let off = t.off(at);
        let best = nearest.entry(t.view).or_insert(off);
        if off.abs() < best.abs() {
            *best = off;
        }
    }
    let is_piece = |t: &Trace| nearest.get(&t.view).is_some_and(|best| (t.off(at) - best).abs() <= pieces_m);
    members.iter().copied().filter(|&i| is_piece(&traces[i])).collect()
}

/// The line at `at` as its members show it.
fn track(
    (traces, members): (&[Trace], &[usize]),
    at: &Vector2<f64>,
    frame: &Frame,
    camera: &Camera,
    config: &config::Geometry,
) -> Option<LineTrack> {
    let rules = &config.directed;
    let mut information = Matrix2::zeros();
    let (mut squares, mut expected) = (0.0f64, 0.0f64);
    for t in members.iter().map(|&i| &traces[i]) {
        let variance = t.std_m(at, camera, &config.tracks).powi(2);
        information += t.normal * t.normal.transpose() / variance;
        squares += t.off(at).powi(2);
        expected += variance;
    }
    // Where the views disagree by more than assumed, poses are worse than assumed.
    let flat = information.try_inverse()? * (squares / f64::max(expected, 1e-12)).max(1.0);
    let spans: Vec<[f64; 2]> = members.iter().filter_map(|&i| traces[i].span(at)).collect();
    let [low, high] = common_span(&spans)?;
    let (low, high) = (low.max(-rules.reach_m), high.min(rules.reach_m));
    if high - low < rules.shared_m {
        return None;
    }
    let basis = Matrix3x2::from_columns(&frame.across);
    let point = frame.place + basis * at + frame.along * (0.5 * (low + high));
    let half = 0.5 * (high - low);
    let beside = Matrix3::identity() - frame.along * frame.along.transpose();
    let views: BTreeSet<usize> = members.iter().map(|&i| traces[i].view).collect();
    Some(LineTrack {
        segment: Segment { line: Line { point, direction: frame.along }, span: [-half, half] },
        views: views.into_iter().collect(),
        rms_m: (squares / members.len().max(1) as f64).sqrt(),
        position_covariance: basis * flat * basis.transpose(),
        direction_covariance: beside * rules.direction_std_deg.to_radians().powi(2),
    })
}

#[cfg(test)]
mod tests {
    use super::super::segments::Segment2;
    use super::*;
    use crate::math::Pose;

    const CAMERA: Camera = Camera { width: 640, height: 480, fx: 400.0, fy: 400.0, cx: 319.5, cy: 239.5 };

    /// Six cameras about a metre and a half before the plane y = 0, upright, looking along +y.
    fn views() -> Vec<Pose> {
        let turn = nalgebra::UnitQuaternion::from_axis_angle(&Vector::x_axis(), -std::f64::consts::FRAC_PI_2);
        (0..6)
            .map(|i| {
                let eye =
                    Vector::new(-0.6 + 0.25 * f64::from(i), -1.5 - 0.1 * f64::from(i % 3), 0.1 * f64::from(i % 2));
                Pose::from_parts(eye.into(), turn)
            })
            .collect()
    }

    fn seen(poses: &[Pose], ends: [Point; 2]) -> Vec<SeenSegment> {
        let of_view = |(view, pose): (usize, &Pose)| {
            let eye = Point::from(pose.translation.vector);
            let rays = ends.map(|p| (p - eye).normalize());
            let [a, b] = ends.map(|p| {
                let (u, v) = CAMERA.project(&(pose.inverse() * p)).unwrap();
                [u, v]
            });
            SeenSegment { view, image: Segment2 { a, b }, eye, rays, plane: rays[0].cross(&rays[1]).normalize() }
        };
        poses.iter().enumerate().map(of_view).collect()
    }

    #[test]
    fn upright_edges_are_found_where_they_are_and_a_slanted_one_is_none_of_them() {
        let poses = views();
        let mut all = Vec::new();
        for x in [-0.3, 0.0, 0.3] {
            all.extend(seen(&poses, [Point::new(x, 0.0, -0.4), Point::new(x, 0.0, 0.3)]));
        }
        all.extend(seen(&poses, [Point::new(0.5, 0.0, -0.4), Point::new(0.1, 0.0, 0.4)]));
        let place = Point::new(0.05, -0.06, 0.0);
        let segments: Vec<&SeenSegment> = all.iter().collect();
        let found = lines(&CAMERA, &segments, &place, &[Vector::z()], &config::Geometry::default());
        let mut at: Vec<f64> = found.iter().map(|t| t.segment.middle().x).collect();
        at.sort_by(f64::total_cmp);
        assert_eq!(at.len(), 3, "{found:#?}");
        for (found, want) in at.iter().zip([-0.3, 0.0, 0.3]) {
            assert!((found - want).abs() < 2e-3, "{at:?}");
        }
        for track in &found {
            assert!(track.segment.middle().y.abs() < 2e-3 && (track.segment.length() - 0.7).abs() < 0.02, "{track:?}");
            assert!(track.views.len() == 6 && track.position_std_m() < 0.02);
        }
    }

    #[test]
    fn two_views_are_no_line() {
        let poses = views();
        let all = seen(&poses[..2], [Point::new(0.0, 0.0, -0.4), Point::new(0.0, 0.0, 0.3)]);
        let segments: Vec<&SeenSegment> = all.iter().collect();
        assert!(lines(&CAMERA, &segments, &Point::origin(), &[Vector::z()], &config::Geometry::default()).is_empty());
    }
}
