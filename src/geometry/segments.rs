//! 2D line segments of a view and their unprojection with depth (§3.2).

use serde::{Deserialize, Serialize};

use crate::config;
use crate::error::Result;
use crate::math::line::{Line, Segment};
use crate::math::ransac::{Search, lo_ransac};
use crate::math::{Point, centroid, principal_directions, unit};
use crate::recording::{Grid, HAND_CLASS, Recording};

/// A segment in an image, pixels.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Segment2 {
    /// One end (u, v).
    pub a: [f64; 2],
    /// The other end.
    pub b: [f64; 2],
}

impl Segment2 {
    /// Length in pixels.
    #[must_use]
    pub fn length(&self) -> f64 {
        (self.b[0] - self.a[0]).hypot(self.b[1] - self.a[1])
    }
}

/// Whatever finds line segments in a grey image.
pub trait LineDetector: Sync {
    /// Segments in pixels; integer coordinates are pixel centres.
    fn detect(&self, image: &Grid<u8>) -> Vec<Segment2>;
}

/// The built-in detector (LSD).
#[derive(Debug, Clone, Copy, Default)]
pub struct Lsd;

impl LineDetector for Lsd {
    fn detect(&self, image: &Grid<u8>) -> Vec<Segment2> {
        lsdetect::detect(&image.data, image.width, image.height, lsdetect::SCALE)
            .unwrap_or_default()
            .into_iter()
            .map(|s| Segment2 { a: [s.x1, s.y1], b: [s.x2, s.y2] })
            .collect()
    }
}

/// A 2D segment lifted into the world from one view.
#[derive(Debug, Clone, PartialEq)]
pub struct LiftedSegment {
    /// Frame index.
    pub view: usize,
    /// The segment in the image.
    pub image: Segment2,
    /// The segment in the world.
    pub segment: Segment,
    /// The unprojected samples that support it, world.
    pub samples: Vec<Point>,
}

/// What one view tells about the static scene.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ViewGeometry {
    /// Line segments in the world.
    pub segments: Vec<LiftedSegment>,
    /// Surface points, world, with their mask class (0 where there is no mask); hands left out.
    pub points: Vec<(Point, u8)>,
}

/// Segments and surface points of one frame; nothing where the frame has no image or no depth.
pub fn lift_view(
    recording: &Recording,
    frame: usize,
    detector: &dyn LineDetector,
    config: &config::Geometry,
    seed: u64,
) -> Result<ViewGeometry> {
    let (Some(grey), Some(depth)) = (recording.grey(frame)?, recording.depth(frame)?) else {
        return Ok(ViewGeometry::default());
    };
    let mask = recording.mask(frame)?;
    let mut lifted = Vec::new();
    for image in detector.detect(&grey) {
        if image.length() < config.min_segment_px || on_hand(&image, mask.as_ref()) {
            continue;
        }
        let samples = unproject(recording, frame, &image, &depth, config.samples_per_segment);
        let Some(segment) = fit_segment(&samples, config, seed ^ frame as u64) else { continue };
        let near = |p: &Point| segment.line.distance(p) <= config.line_tolerance_m;
        let samples: Vec<Point> = samples.into_iter().filter(near).collect();
        lifted.push(LiftedSegment { view: frame, image, segment, samples });
    }
    Ok(ViewGeometry { segments: lifted, points: surface_points(recording, frame, &depth, mask.as_ref(), config) })
}

/// A regular sample of the view's depth.
fn surface_points(
    recording: &Recording,
    frame: usize,
    depth: &Grid<f32>,
    mask: Option<&Grid<u8>>,
    config: &config::Geometry,
) -> Vec<(Point, u8)> {
    let pose = &recording.frames[frame].world_from_camera;
    let step = ((depth.data.len() as f64 / config.points_per_view as f64).sqrt().round() as usize).max(1);
    let mut points = Vec::new();
    for y in (step / 2..depth.height).step_by(step) {
        for x in (step / 2..depth.width).step_by(step) {
            let z = depth.data[y * depth.width + x];
            let class = mask.map_or(0, |m| m.data[y * m.width + x]);
            if z > 0.0 && z.is_finite() && class != HAND_CLASS {
                points.push((pose * recording.camera.unproject(x as f64, y as f64, f64::from(z)), class));
            }
        }
    }
    points
}

/// Whether more than a fifth of a segment runs along or over a hand.
fn on_hand(segment: &Segment2, mask: Option<&Grid<u8>>) -> bool {
    let Some(mask) = mask else { return false };
    // An edge between a hand and what is behind it lies a pixel or two beside the hand's mask.
    const MARGIN_PX: f64 = 3.0;
    let [du, dv] = [segment.b[0] - segment.a[0], segment.b[1] - segment.a[1]];
    let length = segment.length().max(1e-9);
    let normal = [-dv / length * MARGIN_PX, du / length * MARGIN_PX];
    let hits = (0..=20)
        .filter(|i| {
            let t = f64::from(*i) / 20.0;
            let (u, v) = (segment.a[0] + du * t, segment.a[1] + dv * t);
            [-1.0, 0.0, 1.0].iter().any(|s| mask.nearest(u + normal[0] * s, v + normal[1] * s) == Some(HAND_CLASS))
        })
        .count();
    hits > 4
}

/// World points along a segment.
///
/// At a furniture edge half of the pixels belong to the background: of the depths on, left and right of the segment the
/// nearest surface is taken, because the edge that makes the segment is the nearer surface's.
fn unproject(recording: &Recording, frame: usize, segment: &Segment2, depth: &Grid<f32>, count: usize) -> Vec<Point> {
    const SIDE_PX: f64 = 2.0;
    let pose = &recording.frames[frame].world_from_camera;
    let [du, dv] = [segment.b[0] - segment.a[0], segment.b[1] - segment.a[1]];
    let length = segment.length().max(1e-9);
    let side = [-dv / length * SIDE_PX, du / length * SIDE_PX];
    (0..count)
        .filter_map(|i| {
            let t = (i as f64 + 0.5) / count as f64;
            let (u, v) = (segment.a[0] + du * t, segment.a[1] + dv * t);
            let z = [-1.0, 0.0, 1.0]
                .iter()
                .filter_map(|s| depth.nearest(u + side[0] * s, v + side[1] * s))
                .filter(|z| *z > 0.0 && z.is_finite())
                .fold(f32::INFINITY, f32::min);
            z.is_finite().then(|| pose * recording.camera.unproject(u, v, f64::from(z)))
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
    let span = [crate::math::stats::quantile(&coordinates, 0.05)?, crate::math::stats::quantile(&coordinates, 0.95)?];
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
    use crate::math::{Vector, unsigned_angle};

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
    fn the_detector_finds_the_edges_of_a_square() {
        let mut image = Grid::filled(120, 100, 40u8);
        for y in 30..70 {
            for x in 20..90 {
                image.data[y * 120 + x] = 200;
            }
        }
        let long: Vec<f64> = Lsd.detect(&image).iter().map(Segment2::length).filter(|l| *l > 30.0).collect();
        assert_eq!(long.len(), 4, "{long:?}");
    }
}
