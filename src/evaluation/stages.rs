//! The steps around the joint inference, measured: lines, room frame, region and depth scale against a truth, the boxes of the
//! room against depth.

use std::path::Path;

use serde::{Deserialize, Serialize};

use super::room_fit::RoomFit;
use crate::articulation::JointKind;
use crate::config;
use crate::error::{Error, Result};
use crate::geometry::segments::{LineDetector, Segment2};
use crate::json;
use crate::localization::{Region, views};
use crate::math::line::{Line, Segment};
use crate::math::{Point, Vector, stats, unit, unsigned_angle};
use crate::pipeline::Scene;
use crate::recording::{AtWork, Recording};
use crate::twin::OrientedBox;

/// A line this near to an edge of furniture, and this parallel to it, is that edge.
const NEAR_M: f64 = 0.03;
const NEAR_RAD: f64 = 3.0 * std::f64::consts::PI / 180.0;
/// Handles stand off their fronts by about this; boxes of moving parts include them.
const HANDLE_M: f64 = 0.035;

/// What the steps are measured against.
#[derive(Debug, Clone, PartialEq)]
pub struct SceneTruth {
    joints: Vec<StageJoint>,
    clips: Vec<StageClip>,
    depth_scale: Option<Vec<f64>>,
    depth_scale_recording: Option<f64>,
}

#[derive(Debug, Clone, PartialEq, Deserialize)]
struct StageJoint {
    id: String,
    #[serde(rename = "type")]
    kind: JointKind,
    axis: Vector,
    origin: Point,
    part_box: OrientedBox,
    handle_closed: Point,
    #[serde(default)]
    base_box: Option<OrientedBox>,
}

#[derive(Debug, Clone, PartialEq, Deserialize)]
struct StageClip {
    clip: String,
    joint: String,
}

#[derive(Deserialize)]
struct StagesFile {
    joints: Vec<StageJoint>,
    clips: Vec<StageClip>,
    #[serde(default)]
    depth_scale: Option<Vec<f64>>,
    #[serde(default)]
    depth_scale_recording: Option<f64>,
}

/// The best 3D line of one clip whose part turns.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct BestLine {
    /// Distance of the true origin (middle of the part's edge) from the line, metres.
    pub distance_m: f64,
    /// Angle to the true hinge, radians.
    pub angle_rad: f64,
}

/// What the steps of one recording, or of several pooled, are worth.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Stages {
    /// Clips that move a joint.
    pub clips: usize,
    /// Of them, clips with a confident region.
    pub localized: usize,
    /// One entry for each clip of a hinge that has a region: its best line, if any lies within 25 cm and 15 degrees.
    pub best_lines: Vec<Option<BestLine>>,
    /// Lines that are an edge of some piece of furniture, and all lines.
    pub lines_on_edges: [usize; 2],
    /// Largest angle between an axis of the room's frame and the furniture's, radians, one a recording.
    pub manhattan_rad: Vec<f64>,
    /// Share of the moving part's front that lies in the confident region, one a clip that has one.
    pub coverage: Vec<f64>,
    /// Points of furniture edges that are visible in still frames, and those of them that a 2D segment runs along.
    pub edge_points: [usize; 2],
    /// 2D segments of those frames.
    pub segments: usize,
    /// Left error of the corrected depth scale (0 = exact), one a frame, or one a recording where the truth has only that.
    pub depth_scale_error: Vec<f64>,
    /// The twin's boxes against the recording's depth; empty where no twin was measured.
    pub room: RoomFit,
}

impl SceneTruth {
    /// Reads a recording's `ground_truth.json`.
    pub fn read(recording: &Path) -> Result<Self> {
        let path = recording.join("ground_truth.json");
        let file: StagesFile = json::read(&path)?;
        for joint in &file.joints {
            if unit(&joint.axis).is_none() {
                return Err(Error::format(&path, format!("joint {}", joint.id), "the axis is zero or not finite"));
            }
        }
        let StagesFile { joints, clips, depth_scale, depth_scale_recording } = file;
        Ok(Self { joints, clips, depth_scale, depth_scale_recording })
    }

    fn of_clip(&self, clip: &str) -> Option<&StageJoint> {
        let id = &self.clips.iter().find(|c| c.clip == clip)?.joint;
        self.joints.iter().find(|j| j.id == *id)
    }

    /// All edges of all boxes.
    fn edges(&self) -> Vec<Segment> {
        let boxes = self.joints.iter().flat_map(|j| [Some(j.part_box), j.base_box]).flatten();
        boxes.flat_map(|b| box_edges(&b)).collect()
    }

    /// The room's axes: those that most joints' boxes share.
    fn axes(&self) -> Option<[Vector; 3]> {
        let axes_of = |j: &StageJoint| [0, 1, 2].map(|i| j.part_box.rotation.column(i).into_owned());
        let off = |a: &[Vector; 3], b: &[Vector; 3]| {
            a.iter().map(|x| b.iter().map(|y| unsigned_angle(x, y)).fold(f64::INFINITY, f64::min)).fold(0.0, f64::max)
        };
        let sharing = |j: &StageJoint| self.joints.iter().filter(|k| off(&axes_of(j), &axes_of(k)) < NEAR_RAD).count();
        self.joints.iter().max_by_key(|j| sharing(j)).map(axes_of)
    }
}

impl StageJoint {
    fn line(&self) -> Line {
        Line { point: self.origin, direction: self.axis.normalize() }
    }

    /// Points of the closed part's front, 2.5 cm apart.
    fn front(&self) -> Vec<Point> {
        const STEP_M: f64 = 0.025;
        let motion = match self.kind {
            JointKind::Prismatic => self.axis,
            JointKind::Revolute => self.axis.cross(&(self.handle_closed - self.origin)),
        };
        let b = &self.part_box;
        let Some(out) = (0..3).max_by(|&i, &j| {
            let along = |k: usize| b.rotation.column(k).dot(&motion).abs();
            along(i).total_cmp(&along(j))
        }) else {
            return Vec::new();
        };
        let sign = b.rotation.column(out).dot(&motion).signum();
        let plane = b.center + b.rotation.column(out) * (sign * (b.half[out] - HANDLE_M));
        let (u, v) = ((out + 1) % 3, (out + 2) % 3);
        let count = |k: usize| ((2.0 * b.half[k] / STEP_M).round() as usize).max(1);
        let at = |i: usize, k: usize| ((i as f64 + 0.5) / count(k) as f64 * 2.0 - 1.0) * b.half[k];
        (0..count(u) * count(v))
            .map(|i| plane + b.rotation.column(u) * at(i % count(u), u) + b.rotation.column(v) * at(i / count(u), v))
            .collect()
    }
}

/// The twelve edges of a box.
fn box_edges(b: &OrientedBox) -> Vec<Segment> {
    (0..12)
        .map(|i| {
            let (axis, signs) = (i / 4, [i & 1, i >> 1 & 1].map(|s| if s == 0 { -1.0 } else { 1.0 }));
            let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
            let point = b.center
                + b.rotation.column(u) * (signs[0] * b.half[u])
                + b.rotation.column(v) * (signs[1] * b.half[v]);
            let direction = b.rotation.column(axis).into_owned();
            Segment { line: Line { point, direction }, span: [-b.half[axis], b.half[axis]] }
        })
        .collect()
}

/// Measures what the pipeline found in one recording.
#[must_use]
pub fn measure(scene: &Scene, truth: &SceneTruth) -> Stages {
    let mut out = Stages::default();
    let edges = truth.edges();
    let is_edge = |s: &Segment| {
        edges.iter().any(|e| {
            let at = e.line.coordinate(&s.middle());
            unsigned_angle(&e.line.direction, &s.line.direction) < NEAR_RAD
                && e.line.distance(&s.middle()) < NEAR_M
                && (e.span[0] - NEAR_M..e.span[1] + NEAR_M).contains(&at)
        })
    };
    for clip in &scene.clips {
        let Some(joint) = truth.of_clip(&clip.clip.clip) else { continue };
        out.clips += 1;
        let Some(region) = &clip.region else { continue };
        out.localized += 1;
        out.coverage.push(coverage(region, &joint.front()));
        out.lines_on_edges[0] += clip.lines.iter().filter(|l| is_edge(&l.segment)).count();
        out.lines_on_edges[1] += clip.lines.len();
        if joint.kind == JointKind::Revolute {
            let hinge = joint.line();
            let best = clip
                .lines
                .iter()
                .map(|l| BestLine {
                    distance_m: l.segment.line.distance(&joint.origin),
                    angle_rad: unsigned_angle(&l.segment.line.direction, &hinge.direction),
                })
                .filter(|b| b.distance_m < 0.25 && b.angle_rad < 15f64.to_radians())
                .min_by(|a, b| {
                    // One degree weighs as much as one centimetre: on a door of half a metre they are as bad.
                    let cost = |l: &BestLine| l.distance_m.hypot(l.angle_rad.to_degrees() * 0.01);
                    cost(a).total_cmp(&cost(b))
                });
            out.best_lines.push(best);
        }
    }
    if let (Some(found), Some(axes)) = (&scene.manhattan, truth.axes()) {
        let off = |a: &Vector| axes.iter().map(|b| unsigned_angle(a, b)).fold(f64::INFINITY, f64::min);
        out.manhattan_rad.push(found.axes.iter().map(off).fold(0.0, f64::max));
    }
    let factors = &scene.depth_factors;
    let left = |scale: f64, factor: f64| (scale * factor - 1.0).abs();
    if let Some(scales) = &truth.depth_scale {
        let frames: Vec<usize> = match factors.by_frame.is_empty() {
            true => (0..scales.len()).collect(),
            false => factors.by_frame.keys().copied().collect(),
        };
        out.depth_scale_error = frames.iter().filter_map(|&f| scales.get(f).map(|s| left(*s, factors.of(f)))).collect();
    } else if let Some(scale) = truth.depth_scale_recording {
        out.depth_scale_error = vec![left(scale, factors.other)];
    }
    out
}

/// How much of the furniture's edges 2D segments find: points every 2 cm along all true edges, projected into up to twenty
/// still frames; visible where depth within two pixels agrees to 3 cm; found where a segment within 6 degrees runs by within
/// four pixels. Edges between boards of one colour cannot be seen, so that all detectors stay well below 1: compare.
pub fn measure_segments(
    recording: &Recording,
    truth: &SceneTruth,
    detector: &dyn LineDetector,
    rules: &config::EdgeDetector,
    stages: &mut Stages,
) -> Result<()> {
    const FRAMES: usize = 20;
    const STEP_M: f64 = 0.02;
    const LEAST_PX: f64 = 20.0;
    let edges = truth.edges();
    for frame in views::survey(recording, &AtWork::of(recording), FRAMES) {
        let segments: Vec<Segment2> = match (recording.segments(frame)?, recording.grey(frame)?) {
            (Some(ends), _) => ends.into_iter().map(|[a, b]| Segment2 { a, b }).collect(),
            (None, Some(grey)) => detector.detect(&grey, LEAST_PX, rules),
            (None, None) => continue,
        };
        let segments: Vec<Segment2> = segments.into_iter().filter(|s| s.length() >= LEAST_PX).collect();
        let Some(depth) = recording.depth_as_read(frame)? else { continue };
        let camera = recording.camera_of(frame);
        let scale = match (&truth.depth_scale, truth.depth_scale_recording) {
            (Some(scales), _) => scales.get(frame).copied().unwrap_or(1.0),
            (None, scale) => scale.unwrap_or(1.0),
        };
        stages.segments += segments.len();
        let camera_from_world = recording.frames[frame].world_from_camera.inverse();
        for edge in &edges {
            let count = (edge.length() / STEP_M).ceil().max(2.0) as usize;
            let visible: Vec<[f64; 2]> = (0..=count)
                .filter_map(|i| {
                    let at = edge.span[0] + edge.length() * i as f64 / count as f64;
                    let local = camera_from_world * (edge.line.point + edge.line.direction * at);
                    let (u, v) = camera.project(&local).filter(|_| local.z > 0.3)?;
                    let near = |du: f64, dv: f64| {
                        depth
                            .nearest(u + du, v + dv)
                            .is_some_and(|z| z > 0.0 && (f64::from(z) / scale - local.z).abs() < NEAR_M)
                    };
                    let sees = [-2.0, 0.0, 2.0].iter().any(|&du| [-2.0, 0.0, 2.0].iter().any(|&dv| near(du, dv)));
                    sees.then_some([u, v])
                })
                .collect();
            let (Some(first), Some(last)) = (visible.first(), visible.last()) else { continue };
            let whole = Segment2 { a: *first, b: *last };
            if whole.length() < LEAST_PX || visible.len() < 5 {
                continue;
            }
            let along: Vec<&Segment2> = segments
                .iter()
                .filter(|s| {
                    let ([a, b], [c, d]) = (s.across(), whole.across());
                    (a * c + b * d).abs() > 6f64.to_radians().cos()
                })
                .collect();
            let found = |p: &&[f64; 2]| along.iter().any(|s| s.distance(**p) < 4.0);
            stages.edge_points[0] += visible.len();
            stages.edge_points[1] += visible.iter().filter(found).count();
        }
    }
    Ok(())
}

/// Share of points with a confident voxel around them: in it, or half a voxel beside it.
fn coverage(region: &Region, points: &[Point]) -> f64 {
    let inside: std::collections::HashSet<[i32; 3]> = region.voxels.iter().copied().collect();
    let half = 0.5 * region.voxel_m;
    let near = |p: &Point| {
        (0..27).any(|i| {
            let shift = Vector::from([i % 3, i / 3 % 3, i / 9].map(|k| (f64::from(k) - 1.0) * half));
            inside.contains(&crate::localization::voxels::index(&(p + shift), region.voxel_m))
        })
    };
    points.iter().filter(|p| near(p)).count() as f64 / points.len().max(1) as f64
}

impl Stages {
    /// Numbers of several recordings together.
    #[must_use]
    pub fn pooled(all: &[Self]) -> Self {
        let mut out = Self::default();
        for s in all {
            out.clips += s.clips;
            out.localized += s.localized;
            out.best_lines.extend(s.best_lines.iter().cloned());
            out.lines_on_edges = [0, 1].map(|i| out.lines_on_edges[i] + s.lines_on_edges[i]);
            out.manhattan_rad.extend(&s.manhattan_rad);
            out.coverage.extend(&s.coverage);
            out.depth_scale_error.extend(&s.depth_scale_error);
            out.edge_points = [0, 1].map(|i| out.edge_points[i] + s.edge_points[i]);
            out.segments += s.segments;
        }
        out.room = RoomFit::pooled(all.iter().map(|s| &s.room));
        out
    }

    /// Median distance (metres) and angle (radians) of the best lines where there is one.
    #[must_use]
    pub fn best_line(&self) -> Option<[f64; 2]> {
        let of = |f: fn(&BestLine) -> f64| stats::median(&self.best_lines.iter().flatten().map(f).collect::<Vec<_>>());
        Some([of(|b| b.distance_m)?, of(|b| b.angle_rad)?])
    }

    /// Share of the hinges that have a line within 3 degrees and 3 cm.
    #[must_use]
    pub fn recall(&self) -> Option<f64> {
        let hit = |b: &&BestLine| b.distance_m <= NEAR_M && b.angle_rad <= NEAR_RAD;
        let hits = self.best_lines.iter().flatten().filter(hit).count();
        (!self.best_lines.is_empty()).then(|| hits as f64 / self.best_lines.len() as f64)
    }

    /// Share of the visible edge points that a 2D segment runs along.
    #[must_use]
    pub fn edges_seen(&self) -> Option<f64> {
        let [all, seen] = self.edge_points;
        (all > 0).then(|| seen as f64 / all as f64)
    }

    /// Share of the lines that are edges of furniture.
    #[must_use]
    pub fn precision(&self) -> Option<f64> {
        let [on, all] = self.lines_on_edges;
        (all > 0).then(|| on as f64 / all as f64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_box_has_twelve_edges_of_its_three_lengths() {
        let b = OrientedBox {
            center: Point::new(1.0, 2.0, 3.0),
            half: Vector::new(0.1, 0.2, 0.3),
            rotation: nalgebra::Matrix3::identity(),
        };
        let total: f64 = box_edges(&b).iter().map(Segment::length).sum();
        assert!((total - 4.0 * (0.2 + 0.4 + 0.6)).abs() < 1e-12);
        assert!(
            box_edges(&b).iter().all(|e| e.ends().iter().all(|p| b
                .thickened(0.0)
                .corners()
                .iter()
                .any(|c| (c - p).norm() < 1e-9)))
        );
    }

    #[test]
    fn half_a_front_is_half_covered() {
        let voxels: Vec<[i32; 3]> = (0..10).map(|i| [i, 0, 0]).collect();
        let region = Region {
            voxel_m: 0.05,
            voxels,
            min_views: 4,
            class: None,
            local_frames: Vec::new(),
            other_frames: Vec::new(),
            viewpoint: Point::origin(),
            grip: Point::origin(),
        };
        let points: Vec<Point> = (0..40).map(|i| Point::new(0.025 * f64::from(i) + 0.01, 0.02, 0.02)).collect();
        let share = coverage(&region, &points);
        assert!((0.5..0.56).contains(&share), "{share}");
    }
}
