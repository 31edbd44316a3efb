//! 2D line segments of a view and their lift into the world with depth (§3.2).

use super::detector;
pub use super::segment2::Segment2;
use crate::config::{self, LineMethod};
use crate::error::Result;
use crate::math::line::{Line, Segment};
use crate::math::ransac::{Search, lo_ransac};
use crate::math::{Point, Vector, centroid, principal_directions, stats, unit};
use crate::recording::{Grid, HAND_CLASS, Recording};

/// Whatever finds line segments in a grey image.
pub trait LineDetector: Sync {
    /// Segments of at least a length, pixels; integer coordinates are pixel centres. The rules are the built-in detector's.
    fn detect(&self, image: &Grid<u8>, min_length_px: f64, rules: &config::EdgeDetector) -> Vec<Segment2>;
}

/// The built-in detector ([`detector`]).
#[derive(Debug, Clone, Copy, Default)]
pub struct Lsd;

impl LineDetector for Lsd {
    fn detect(&self, image: &Grid<u8>, min_length_px: f64, rules: &config::EdgeDetector) -> Vec<Segment2> {
        detector::detect(image, min_length_px, rules)
    }
}

/// A 2D segment lifted into the world from one view.
#[derive(Debug, Clone, PartialEq)]
pub struct LiftedSegment {
    /// Frame index.
    pub view: usize,
    /// The segment in the image.
    pub image: Segment2,
    /// The segment in the world, as this view's depth has it.
    pub segment: Segment,
    /// Camera centre.
    pub eye: Point,
    /// Unit normal of the plane through the camera centre and the segment, world.
    pub plane: Vector,
    /// Points of the paper's method that support the segment, world; empty for ours.
    pub samples: Vec<Point>,
}

impl LiftedSegment {
    /// The same with its view's depth multiplied by a factor.
    #[must_use]
    pub fn scaled(&self, factor: f64) -> Self {
        let moved = |p: &Point| self.eye + (p - self.eye) * factor;
        let line = Line { point: moved(&self.segment.line.point), ..self.segment.line };
        Self {
            segment: Segment { line, span: self.segment.span.map(|s| s * factor) },
            samples: self.samples.iter().map(moved).collect(),
            ..self.clone()
        }
    }
}

/// A 2D segment of one view with the plane that it spans with its camera: all that a view without depth tells.
#[derive(Debug, Clone, PartialEq)]
pub struct SeenSegment {
    /// Frame index.
    pub view: usize,
    /// The segment in the image.
    pub image: Segment2,
    /// Camera centre, world.
    pub eye: Point,
    /// From the camera centre to the two ends, world, unit.
    pub rays: [Vector; 2],
    /// Unit normal of the plane through the camera centre and the segment, world.
    pub plane: Vector,
}

/// Segments of one frame without depth; of its own detector's or in the image, as in [`lift`].
///
/// # Errors
/// Images and files of segments that cannot be read.
pub fn seen(
    recording: &Recording,
    frame: usize,
    detector: &dyn LineDetector,
    config: &config::Geometry,
) -> Result<Vec<SeenSegment>> {
    let mask = recording.mask(frame)?;
    let Some(at) = recording.frames.get(frame) else { return Ok(Vec::new()) };
    let camera = recording.camera_of(frame);
    let ray = |p: [f64; 2]| unit(&(at.world_from_camera.rotation * camera.unproject(p[0], p[1], 1.0).coords));
    let found = in_image(recording, frame, mask.as_ref(), detector, config)?;
    Ok(found
        .into_iter()
        .filter_map(|image| {
            let rays = [ray(image.a)?, ray(image.b)?];
            let plane = unit(&rays[0].cross(&rays[1]))?;
            Some(SeenSegment { view: frame, image, eye: at.center(), rays, plane })
        })
        .collect())
}

/// Segments in the image of one frame that are long enough and no hand's.
fn in_image(
    recording: &Recording,
    frame: usize,
    mask: Option<&Grid<u8>>,
    detector: &dyn LineDetector,
    config: &config::Geometry,
) -> Result<Vec<Segment2>> {
    let mut found: Vec<Segment2> = match recording.segments(frame)? {
        Some(ends) => ends.into_iter().map(|[a, b]| Segment2 { a, b }).collect(),
        None => match recording.grey(frame)? {
            Some(grey) => detector.detect(&grey, config.min_segment_px, &config.detector),
            None => Vec::new(),
        },
    };
    found.retain(|image| image.length() >= config.min_segment_px && !on_hand(image, mask, &config.segments));
    Ok(found)
}

/// Segments of one frame, lifted with its depth as read: its own detector's where the recording has them, else what
/// `detector` finds in the image; none where the frame has neither.
pub fn lift(
    recording: &Recording,
    frame: usize,
    depth: &Grid<f32>,
    mask: Option<&Grid<u8>>,
    detector: &dyn LineDetector,
    config: &config::Geometry,
    seed: u64,
) -> Result<Vec<LiftedSegment>> {
    let found = in_image(recording, frame, mask, detector, config)?;
    let pose = &recording.frames[frame].world_from_camera;
    let eye = recording.frames[frame].center();
    let camera = recording.camera_of(frame);
    let ray = |p: [f64; 2]| pose.rotation * camera.unproject(p[0], p[1], 1.0).coords;
    let lifted = found
        .into_iter()
        .filter_map(|image| {
            let plane = unit(&ray(image.a).cross(&ray(image.b)))?;
            let (segment, samples) = match config.lines {
                LineMethod::Unprojected => {
                    let samples = unproject(recording, frame, &image, depth, config.samples_per_segment);
                    let segment = fit_segment(&samples, config, seed ^ frame as u64)?;
                    let near = |p: &Point| segment.line.distance(p) <= config.line_tolerance_m;
                    (segment, samples.into_iter().filter(near).collect())
                }
                LineMethod::Triangulated => {
                    let [start, end] = inverse_depth(&image, depth, config.samples_per_segment, &config.segments)?;
                    let at = |p: [f64; 2], w: f64| eye + ray(p) / w;
                    (Segment::between(&at(image.a, start), &at(image.b, end))?, Vec::new())
                }
            };
            Some(LiftedSegment { view: frame, image, segment, eye, plane, samples })
        })
        .collect();
    Ok(lifted)
}

/// Whether more than a fifth of a segment runs along or over a hand.
fn on_hand(segment: &Segment2, mask: Option<&Grid<u8>>, rules: &config::SegmentRules) -> bool {
    let margin = rules.hand_margin_px;
    let Some(mask) = mask else { return false };
    let across = segment.across();
    let hits = (0..=20)
        .filter(|i| {
            let [u, v] = segment.at(f64::from(*i) / 20.0);
            [-margin, 0.0, margin]
                .iter()
                .any(|s| mask.nearest(u + across[0] * s, v + across[1] * s) == Some(HAND_CLASS))
        })
        .count();
    hits > 4
}

/// Inverse depths at the two ends of a segment, on one surface: the nearer of its two sides, or both where they agree.
///
/// At an edge of furniture half of the pixels belong to the background, and estimated depth smears the step over a few
/// pixels; the edge is the nearer surface's. Along a straight line in space inverse depth is linear in the image.
fn inverse_depth(
    segment: &Segment2,
    depth: &Grid<f32>,
    count: usize,
    rules: &config::SegmentRules,
) -> Option<[f64; 2]> {
    let across = segment.across();
    let scale = (depth.width as f64 / 640.0).max(1.0);
    let side = |sign: f64| -> Option<[f64; 2]> {
        let samples: Vec<[f64; 2]> = (0..count)
            .flat_map(|i| rules.side_px.map(|s| ((i as f64 + 0.5) / count as f64, sign * s * scale)))
            .filter_map(|(t, s)| {
                let [u, v] = segment.at(t);
                let z = f64::from(depth.nearest(u + across[0] * s, v + across[1] * s)?);
                (z > 0.0 && z.is_finite()).then_some([t, 1.0 / z])
            })
            .collect();
        // Mostly holes: a line through what is left would be a guess.
        if 2 * samples.len() < count * rules.side_px.len() {
            return None;
        }
        robust_ends(&samples, rules.depth_std)
    };
    match (side(-1.0), side(1.0)) {
        (Some(a), Some(b)) => {
            let middle = |e: &[f64; 2]| 0.5 * (e[0] + e[1]);
            // Two boards that meet, or one face left and right of a seam.
            if (middle(&a) - middle(&b)).abs() < rules.one_surface * middle(&a) {
                Some([0, 1].map(|k| 0.5 * (a[k] + b[k])))
            } else {
                Some(if middle(&a) > middle(&b) { a } else { b })
            }
        }
        (a, b) => a.or(b),
    }
    .filter(|e| e.iter().all(|w| *w > rules.least_inverse_depth))
}

/// Values at 0 and 1 of the line through (t, value), by reweighted least squares about its median: a few samples may lie on
/// another surface. `None` where less than half agree.
fn robust_ends(samples: &[[f64; 2]], depth_std: f64) -> Option<[f64; 2]> {
    let values: Vec<f64> = samples.iter().map(|s| s[1]).collect();
    let start = stats::median(&values)?;
    // As in inverse depth.
    let spread = depth_std * start;
    let (mut offset, mut slope) = (start, 0.0);
    for round in 0..6 {
        // Wide at first: the line's own slope is not yet known.
        let scale = if round == 0 { 10.0 * spread } else { 2.0 * spread };
        let (mut w0, mut wt, mut wtt, mut wv, mut wtv) = (1e-9, 0.0, 1e-9, 0.0, 0.0);
        for [t, value] in samples {
            let t = t - 0.5;
            let w = 1.0 / (1.0 + ((value - offset - slope * t) / scale).powi(2)).powi(2);
            w0 += w;
            wt += w * t;
            wtt += w * t * t;
            wv += w * value;
            wtv += w * t * value;
        }
        let determinant = w0 * wtt - wt * wt;
        if determinant <= 1e-9 {
            break;
        }
        (offset, slope) = ((wv * wtt - wt * wtv) / determinant, (w0 * wtv - wt * wv) / determinant);
    }
    let near = samples.iter().filter(|[t, v]| (v - offset - slope * (t - 0.5)).abs() < 3.0 * spread).count();
    (2 * near >= samples.len()).then_some([offset - 0.5 * slope, offset + 0.5 * slope])
}

/// World points along a segment as its own pixels' depth has them: the paper's unprojection.
fn unproject(recording: &Recording, frame: usize, segment: &Segment2, depth: &Grid<f32>, count: usize) -> Vec<Point> {
    let pose = &recording.frames[frame].world_from_camera;
    let camera = recording.camera_of(frame);
    (0..count)
        .filter_map(|i| {
            let [u, v] = segment.at((i as f64 + 0.5) / count as f64);
            let z = f64::from(depth.nearest(u, v)?);
            (z > 0.0 && z.is_finite()).then(|| pose * camera.unproject(u, v, z))
        })
        .collect()
}

/// LO-RANSAC line through points, cut to the 5 to 95 % span of its inliers (§3.2). `None` where fewer than half agree.
#[must_use]
pub fn fit_segment(points: &[Point], config: &config::Geometry, seed: u64) -> Option<Segment> {
    let found = lo_ransac::<Line, 2>(
        points.len(),
        Search { draws: config.line_draws, tolerance: config.line_tolerance_m, seed },
        |s| unit(&(points[s[1]] - points[s[0]])).map(|direction| Line { point: points[s[0]], direction }),
        |ids| fit_line(&ids.iter().map(|&i| points[i]).collect::<Vec<_>>()),
        |line, i| line.distance(&points[i]),
    )?;
    if found.inliers.len() * 2 < points.len() || found.inliers.len() < 3 {
        return None;
    }
    let coordinates: Vec<f64> = found.inliers.iter().map(|&i| found.model.coordinate(&points[i])).collect();
    let span = [
        stats::quantile(&coordinates, config.segments.rim_share)?,
        stats::quantile(&coordinates, 1.0 - config.segments.rim_share)?,
    ];
    (span[1] - span[0] > 1e-3).then_some(Segment { line: found.model, span })
}

/// Least-squares line.
fn fit_line(points: &[Point]) -> Option<Line> {
    if points.len() < 2 {
        return None;
    }
    let (axes, _) = principal_directions(points)?;
    Some(Line { point: centroid(points)?, direction: axes.column(0).into_owned() })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::unsigned_angle;

    #[test]
    fn a_line_is_found_among_background_samples() {
        let d = Vector::new(0.0, 0.1, 1.0).normalize();
        let points: Vec<Point> = (0..24)
            .map(|i| {
                let on = Point::new(1.0, 2.0, 0.0) + d * (f64::from(i) * 0.03);
                if i % 3 == 0 { on + Vector::new(0.5, 0.0, 0.0) } else { on }
            })
            .collect();
        let s = fit_segment(&points, &config::Geometry::default(), 1).unwrap();
        assert!(unsigned_angle(&s.line.direction, &d) < 0.02, "{s:?}");
        assert!(s.line.distance(&points[1]) < 0.005);
        assert!((0.5..0.72).contains(&s.length()));
    }

    #[test]
    fn the_edge_of_a_door_stays_on_the_door() {
        // A slanted door left of u = 320, a wall 40 cm behind it, the step smeared over 3 pixels, one sample in nine a hole.
        let mut depth = Grid::filled(640, 480, 0.0f32);
        for y in 0..480 {
            for x in 0..640 {
                let door = 1.0 / (0.8 + 0.0005 * y as f64);
                let share = ((x as f64 - 318.5) / 3.0).clamp(0.0, 1.0);
                depth.data[y * 640 + x] = if (x + y) % 9 == 0 { 0.0 } else { (door + 0.4 * share) as f32 };
            }
        }
        let edge = Segment2 { a: [320.0, 100.0], b: [320.0, 380.0] };
        let [start, end] = inverse_depth(&edge, &depth, 24, &config::SegmentRules::default()).unwrap();
        assert!((start - 0.85).abs() < 2e-3 && (end - 0.99).abs() < 2e-3, "{start} {end}");
    }

    #[test]
    fn the_detector_finds_the_edges_of_a_square() {
        let mut image = Grid::filled(120, 100, 40u8);
        for y in 30..70 {
            for x in 20..90 {
                image.data[y * 120 + x] = 200;
            }
        }
        let long = Lsd.detect(&image, 30.0, &config::EdgeDetector::default());
        assert_eq!(long.len(), 4, "{long:?}");
    }
}
