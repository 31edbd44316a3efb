//! The line that several views' segments have in common, from the planes that they span with their cameras.

use nalgebra::{Matrix2, Matrix3, SymmetricEigen};

use super::line_track::LineTrack;
use super::segments::LiftedSegment;
use crate::config;
use crate::math::line::{Line, Segment};
use crate::math::ransac::{Search, lo_ransac};
use crate::math::{Point, Vector, any_orthogonal, reject, unit};
use crate::recording::Recording;

/// What one view says about a line.
pub(super) struct LineView {
    plane: Vector,
    eye: Point,
    middle: Point,
    along: Vector,
    /// Standard deviations: of the plane at the line (m), of the line's direction out of the plane, of depth (m), of the
    /// direction within the plane as depth has it.
    std: [f64; 4],
}

impl LineView {
    fn new(recording: &Recording, member: &LiftedSegment, rules: &config::Tracks) -> Self {
        let middle = member.segment.middle();
        let range = (middle - member.eye).norm();
        let across = (range * rules.detection_std_px / recording.camera_of(member.view).fx).hypot(rules.pose_std_m);
        let length = member.segment.length().max(rules.least_length_m);
        let depth = rules.depth_std * range;
        Self {
            plane: member.plane,
            eye: member.eye,
            middle,
            along: member.segment.line.direction,
            // Arithmetic: both ends are off independently, the direction by sqrt(12)/2 of it over the length.
            std: [across, 1.7 * across / length, depth, 1.7 * depth / length],
        }
    }

    /// Distance of a line from what was seen, in standard deviations.
    fn misfit(&self, line: &Line) -> f64 {
        let across = self.plane.dot(&(line.point - self.eye)) / self.std[0];
        let turn = self.plane.dot(&line.direction) / self.std[1];
        let depth = line.distance(&self.middle) / self.std[2];
        (across * across + turn * turn + 0.25 * depth * depth).sqrt()
    }
}

/// Least squares over some sights: the line and its information matrices (position, direction).
fn common_line(sights: &[LineView], ids: &[usize]) -> Option<(Line, [Matrix3<f64>; 2])> {
    let first = ids.iter().map(|&i| &sights[i]).min_by(|a, b| a.std[1].total_cmp(&b.std[1]))?;
    let mut position = Matrix3::zeros();
    let mut turning = Matrix3::zeros();
    let mut pull = Vector::zeros();
    let mut middle = Vector::zeros();
    for sight in ids.iter().map(|&i| &sights[i]) {
        let [across, turn, depth, depth_turn] = sight.std;
        let plane = sight.plane * sight.plane.transpose();
        let by_plane = plane / (across * across);
        // Depth places the line along the ray; along the line itself it says nothing.
        let ray = unit(&reject(&(sight.middle - sight.eye), &sight.along))?;
        let by_depth = ray * ray.transpose() / (depth * depth);
        position += by_plane + by_depth;
        pull += by_plane * sight.eye.coords + by_depth * sight.middle.coords;
        middle += sight.middle.coords / ids.len() as f64;
        // In the viewing plane, depth alone tells the direction.
        let in_plane = unit(&sight.plane.cross(&sight.along))?;
        turning += plane / (turn * turn) + in_plane * in_plane.transpose() / (depth_turn * depth_turn);
    }
    let eigen = SymmetricEigen::new(turning);
    let found = eigen.eigenvectors.column(eigen.eigenvalues.imin()).into_owned();
    let direction = if found.dot(&first.along) < 0.0 { -found } else { found };
    // Along the line the place is free: the middle of the sights.
    let free = direction * direction.transpose() * (1e-6 * position.trace());
    let point = Point::from((position + free).try_inverse()? * (pull + free * middle));
    Some((Line { point, direction }, [position, turning]))
}

/// The line that the viewing planes of a group have in common (LO-RANSAC over pairs of views); depth says little more than
/// where along the rays it lies.
pub(super) fn triangulate(
    recording: &Recording,
    members: &[&LiftedSegment],
    config: &config::Geometry,
    seed: u64,
) -> Option<LineTrack> {
    if views_of(members).len() < config.min_track_views {
        return None;
    }
    let sights: Vec<LineView> = members.iter().map(|m| LineView::new(recording, m, &config.tracks)).collect();
    let pair = |ids: &[usize; 2]| -> Option<Line> {
        let [a, b] = ids.map(|i| &sights[i]);
        if a.plane.cross(&b.plane).norm() < config.tracks.least_sine {
            // Seen from one direction only: depth has to help.
            return common_line(&sights, ids).map(|(line, _)| line);
        }
        let direction = a.plane.cross(&b.plane).normalize();
        let middle = Point::from(0.5 * (a.middle.coords + b.middle.coords));
        let system = Matrix3::from_rows(&[a.plane.transpose(), b.plane.transpose(), direction.transpose()]);
        let rhs = Vector::new(a.plane.dot(&a.eye.coords), b.plane.dot(&b.eye.coords), direction.dot(&middle.coords));
        Some(Line { point: Point::from(system.try_inverse()? * rhs), direction })
    };
    // As many draws as there are pairs are enough for a small group.
    let draws = config.line_draws.min(sights.len() * (sights.len() - 1));
    let found = lo_ransac::<Line, 2>(
        sights.len(),
        Search { draws, tolerance: config.tracks.tolerance, seed },
        pair,
        |ids| common_line(&sights, ids).map(|(line, _)| line),
        |line, i| sights[i].misfit(line),
    )?;
    let kept: Vec<&LiftedSegment> = found.inliers.iter().map(|&i| members[i]).collect();
    let views = views_of(&kept);
    if views.len() < config.min_track_views {
        return None;
    }
    let (line, [position, turning]) = common_line(&sights, &found.inliers)?;
    let of = |f: &dyn Fn(&LineView) -> f64| {
        found.inliers.iter().map(|&i| f(&sights[i])).sum::<f64>() / found.inliers.len().max(1) as f64
    };
    let variance = of(&|s| s.plane.dot(&(line.point - s.eye)).powi(2));
    // Where the views disagree by more than assumed, poses are worse than assumed.
    let inflation = (variance / of(&|s| s.std[0].powi(2)).max(1e-12)).max(1.0);
    let spans: Vec<[f64; 2]> = kept.iter().filter_map(|m| span_on(&line, m)).collect();
    let span = common_span(&spans)?;
    let segment = Segment { line, span };
    let half = 0.5 * segment.length();
    Some(LineTrack {
        segment: Segment { line: Line { point: segment.middle(), ..line }, span: [-half, half] },
        views,
        rms_m: variance.sqrt(),
        position_covariance: across_covariance(&position, &line.direction) * inflation,
        direction_covariance: across_covariance(&turning, &line.direction) * inflation,
    })
}

/// Inverse of an information matrix in the plane across a direction.
fn across_covariance(information: &Matrix3<f64>, direction: &Vector) -> Matrix3<f64> {
    let e1 = any_orthogonal(direction);
    let e2 = direction.cross(&e1);
    let of = |a: &Vector, b: &Vector| a.dot(&(information * b));
    let flat = Matrix2::new(of(&e1, &e1), of(&e1, &e2), of(&e2, &e1), of(&e2, &e2));
    let Some(inverse) = flat.try_inverse() else { return Matrix3::identity() };
    let basis = nalgebra::Matrix3x2::from_columns(&[e1, e2]);
    basis * inverse * basis.transpose()
}

/// The stretch of a line that a view's segment covers: where the line passes nearest to the rays of its ends.
pub(super) fn span_on(line: &Line, member: &LiftedSegment) -> Option<[f64; 2]> {
    let at = |end: &Point| -> Option<f64> {
        let ray = unit(&(end - member.eye))?;
        let cosine = ray.dot(&line.direction);
        let rest = 1.0 - cosine * cosine;
        // Geometry: seen end on, within 10 degrees, a line shows no length.
        if rest < 0.03 {
            return None;
        }
        let between = line.point - member.eye;
        Some((ray.dot(&between) * cosine - line.direction.dot(&between)) / rest)
    };
    let [a, b] = member.segment.ends();
    let (a, b) = (at(&a)?, at(&b)?);
    Some([a.min(b), a.max(b)])
}

/// The stretch that several views cover: each end is reached by three of them, or by half where there are fewer.
pub(super) fn common_span(spans: &[[f64; 2]]) -> Option<[f64; 2]> {
    let rank = (spans.len() / 2).min(2);
    let end = |k: usize, sign: f64| -> Option<f64> {
        let mut values: Vec<f64> = spans.iter().map(|s| sign * s[k]).collect();
        values.sort_by(f64::total_cmp);
        values.get(rank).map(|v| sign * v)
    };
    /// Geometry: a shorter stretch is a point, metres.
    const LEAST_M: f64 = 0.02;
    let span = [end(0, 1.0)?, end(1, -1.0)?];
    (span[1] - span[0] > LEAST_M).then_some(span)
}

pub(super) fn views_of(members: &[&LiftedSegment]) -> Vec<usize> {
    let mut views: Vec<usize> = members.iter().map(|m| m.view).collect();
    views.sort_unstable();
    views.dedup();
    views
}
