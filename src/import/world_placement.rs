//! The world of the result: metres and +Z up, from what the source says, from the user, or from the recording itself.

use nalgebra::{Matrix3, UnitQuaternion};

use super::axes::{Convention, upright};
use super::capture::{Capture, JointFrame};
use super::choices::ImportOptions;
use super::frame_timeline::{Draft, FrameTimeline};
use super::joint_orders::PALM;
use super::report::{ImportReport, Scale, Up};
use super::{decode, warp};
use crate::error::{Error, Result};
use crate::math::directions::mean_shift;
use crate::math::{Point, Pose, Vector, eigen_descending, signed_angle, stats, unit};
use crate::recording::Camera;

/// Frames whose depth is looked at for scale and gravity: enough for a median, few enough to take seconds.
const LOOKED_AT: usize = 16;
/// Length of a palm from the wrist to the middle knuckle, metres: the mean of grown people, and its spread as a share.
const PALM_M: f64 = 0.09;
const PALM_SPREAD: f64 = 0.1;
/// How far what the cameras tell may be from gravity: heads bend down to what hands do.
const CAMERA_UP_STD_DEG: f64 = 15.0;
/// The same once a dominant level surface near it was found.
const ROOM_UP_STD_DEG: f64 = 2.0;

/// From the source's world (right-handed) to the result's.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct WorldPlacement {
    turn: UnitQuaternion<f64>,
    scale: f64,
}

impl WorldPlacement {
    /// A pose.
    pub fn pose(&self, pose: &Pose) -> Pose {
        Pose::from_parts((self.turn * pose.translation.vector * self.scale).into(), self.turn * pose.rotation)
    }

    /// A point.
    pub fn point(&self, p: &Point) -> Point {
        self.turn * (p * self.scale)
    }
}

/// Depth of a frame as the output's camera sees it, to look at.
fn depth_of(
    captures: &[Capture],
    frame: &Draft,
    options: &ImportOptions,
) -> Result<Option<(crate::recording::Grid<f32>, super::output_view::OutputView)>> {
    let Some(item) = frame.depth else { return Ok(None) };
    let Some(depth) = captures.get(item.capture).and_then(|c| c.depth.as_ref()) else { return Ok(None) };
    let Some(at) = depth.items.get(item.item) else { return Ok(None) };
    let view = super::output_view::OutputView::of(&frame.optics, &ImportOptions { width: 160, ..options.clone() });
    let grid = decode::depth(&at.blob, None, depth)?;
    let camera = super::imported::depth_camera(depth, at, &frame.optics, &grid);
    let is_ray = depth.along == super::capture::Along::Ray;
    Ok(Some((warp::depth(&grid, is_ray, camera, depth.color_from_depth.as_ref(), &view), view)))
}

/// Some frames, evenly over all.
fn some(frames: &[Draft]) -> impl Iterator<Item = &Draft> {
    let with: Vec<&Draft> = frames.iter().filter(|f| f.depth.is_some()).collect();
    let step = with.len().div_ceil(LOOKED_AT).max(1);
    with.into_iter().step_by(step)
}

/// Finds scale and gravity. Both are told in the report.
///
/// # Errors
/// Where the source's scale is arbitrary and nothing tells it.
pub(super) fn place(
    captures: &[Capture],
    timeline: &FrameTimeline,
    options: &ImportOptions,
    report: &mut ImportReport,
) -> Result<WorldPlacement> {
    let capture = &captures[timeline.posed];
    let convention = Convention::of(capture, options);
    let is_metric = capture.world.unit_m.is_some() || options.unit_m.is_some();
    let scale = match options.scale {
        Some(factor) => Some(Scale { metres_per_unit: factor, relative_std: None, from: "--scale".to_owned() }),
        None if is_metric => None,
        None => Some(found_scale(captures, timeline, &convention, options)?),
    };
    let factor = scale.as_ref().map_or(1.0, |s| s.metres_per_unit);
    if !(factor.is_finite() && factor > 0.0) {
        return Err(Error::Config(format!("import: a scale of {factor} is not a factor; give a number above 0")));
    }
    report.scale = scale;
    let up = match (options.up, capture.world.up) {
        (Some(up), _) => Up { direction: convention.vector(&up).into(), std_deg: 0.0, from: "--up".to_owned() },
        (None, Some(up)) => {
            Up { direction: convention.vector(&up).into(), std_deg: 1.0, from: "the source".to_owned() }
        }
        (None, None) => found_up(captures, timeline, options),
    };
    let turn = upright(&Vector::from(up.direction));
    report.up = Some(up);
    Ok(WorldPlacement { turn, scale: factor })
}

/// Metres per unit, from metric depth where points of the reconstruction are seen, else from the size of hands in the same
/// world.
fn found_scale(
    captures: &[Capture],
    timeline: &FrameTimeline,
    convention: &Convention,
    options: &ImportOptions,
) -> Result<Scale> {
    let capture = &captures[timeline.posed];
    let ratios = depth_ratios(captures, timeline, convention, options, true);
    if let (Some(median), true) = (stats::median(&ratios), ratios.len() >= 3) {
        let off: Vec<f64> = ratios.iter().map(|r| (r / median - 1.0).abs()).collect();
        // 1.48 times the median deviation is a normal distribution's standard deviation.
        let spread = 1.48 * stats::median(&off).unwrap_or(0.0) / (ratios.len() as f64).sqrt();
        return Ok(Scale {
            metres_per_unit: median,
            relative_std: Some(spread),
            from: format!("metric depth at the points of the reconstruction in {} frames", ratios.len()),
        });
    }
    let palms = palms(capture);
    if let Some(palm) = stats::median(&palms).filter(|p| *p > 0.0) {
        return Ok(Scale {
            metres_per_unit: PALM_M / (palm * convention.unit_m),
            relative_std: Some(PALM_SPREAD),
            from: format!("the size of {} hands, a palm being {PALM_M} m", palms.len()),
        });
    }
    Err(Error::Format {
        path: capture.source.clone(),
        place: "scale".to_owned(),
        message: "its unit of length is arbitrary, and neither metric depth at its points nor hands in its world tell it; add \
                  metric depth (and points3D), or give --scale METRES_PER_UNIT"
            .to_owned(),
    })
}

/// What depth up to one factor is multiplied by to be metres, from the points of the reconstruction; 1 where depth is metric,
/// `None` where nothing tells it.
pub(super) fn depth_factor(
    captures: &[Capture],
    timeline: &FrameTimeline,
    place: &WorldPlacement,
    options: &ImportOptions,
) -> Option<f64> {
    let source = timeline.frames.iter().find_map(|f| f.depth).and_then(|d| captures.get(d.capture)?.depth.as_ref());
    if source.is_none_or(|d| d.is_metric) {
        return Some(1.0);
    }
    let convention = Convention::of(captures.get(timeline.posed)?, options);
    let ratios = depth_ratios(captures, timeline, &convention, options, false);
    Some(place.scale / stats::median(&ratios)?)
}

/// The capture whose points are in the world of the one with the poses: that one, else the first one that has points and no
/// poses, so no world of its own.
pub(super) fn with_points(captures: &[Capture], posed: usize) -> Option<&Capture> {
    let own = captures.get(posed).filter(|c| !c.points.is_empty());
    own.or_else(|| captures.iter().find(|c| !c.points.is_empty() && c.poses.is_none()))
}

/// Of each frame that was looked at: depth (metric or not) over the depth of the points there, the median.
fn depth_ratios(
    captures: &[Capture],
    timeline: &FrameTimeline,
    convention: &Convention,
    options: &ImportOptions,
    metric: bool,
) -> Vec<f64> {
    /// Points of a frame that a ratio needs.
    const LEAST: usize = 20;
    let Some(capture) = with_points(captures, timeline.posed) else { return Vec::new() };
    let points: Vec<Point> = capture.points.iter().map(|p| convention.point(p)).collect();
    let is_meant = |f: &&Draft| {
        let depth = f.depth.and_then(|d| captures.get(d.capture)).and_then(|c| c.depth.as_ref());
        depth.is_some_and(|d| d.is_metric == metric)
    };
    let mut ratios = Vec::new();
    for frame in some(&timeline.frames).filter(is_meant) {
        // A frame whose depth cannot be read is told when it is written.
        let Ok(Some((depth, view))) = depth_of(captures, frame, options) else { continue };
        let output_from_world =
            (frame.world_from_camera * Pose::from_parts(Vector::zeros().into(), view.source_from_output)).inverse();
        let seen: Vec<f64> = points
            .iter()
            .filter_map(|p| {
                let p = output_from_world * p;
                let (u, v) = view.camera.project(&p)?;
                let z = f64::from(depth.nearest(u, v)?);
                (z > 0.0).then(|| z / p.z)
            })
            .collect();
        if seen.len() >= LEAST {
            ratios.extend(stats::median(&seen));
        }
    }
    ratios
}

/// Lengths of palms in the capture's world, its units.
fn palms(capture: &Capture) -> Vec<f64> {
    let Some(hands) = capture.hands.as_ref().filter(|h| h.frame == JointFrame::World) else { return Vec::new() };
    hands
        .items
        .iter()
        .filter_map(|h| {
            let joints = hands.order.to_mano(&h.joints);
            let [wrist, knuckle] = PALM.map(|i| joints.get(i).copied().flatten().map(Point::from));
            Some((knuckle? - wrist?).norm())
        })
        .collect()
}

/// Up as the cameras tell it. Heads hardly roll, so that their right is level wherever they look; they bend down, so that
/// their mean up leans, and counts only where they look one way.
fn cameras_up(frames: &[Draft], options: &ImportOptions) -> Vector {
    /// Weight of the mean up beside all rights together: as much as a head that turns by 15 degrees.
    const LEAN_WEIGHT: f64 = 0.05;
    let along = |f: &Draft, axis: Vector| f.world_from_camera.rotation * (source_from_output(options) * axis);
    let sum: Vector = frames.iter().map(|f| along(f, -Vector::y())).sum();
    let mean = unit(&sum).unwrap_or_else(Vector::z);
    let mut level = (Matrix3::identity() - mean * mean.transpose()) * LEAN_WEIGHT;
    for frame in frames {
        let right = along(frame, Vector::x());
        level += right * right.transpose() / frames.len() as f64;
    }
    let (axes, _) = eigen_descending(level);
    let up = axes.column(2).into_owned();
    if up.dot(&mean) < 0.0 { -up } else { up }
}

/// How images are turned against the source's.
fn source_from_output(options: &ImportOptions) -> UnitQuaternion<f64> {
    let angle = -std::f64::consts::FRAC_PI_2 * f64::from(options.rotate_quarters % 4);
    UnitQuaternion::from_scaled_axis(Vector::z() * angle)
}

/// Up, from the cameras and the dominant surface that is level by them.
fn found_up(captures: &[Capture], timeline: &FrameTimeline, options: &ImportOptions) -> Up {
    let mean = cameras_up(&timeline.frames, options);
    let mut normals: Vec<Vector> = Vec::new();
    for frame in some(&timeline.frames) {
        let Ok(Some((depth, view))) = depth_of(captures, frame, options) else { continue };
        let turn = frame.world_from_camera.rotation * view.source_from_output;
        normals.extend(slopes(&depth, &view.camera).into_iter().map(|n| turn * n));
    }
    // Level surfaces show their normal near that; walls stand across it.
    let level: Vec<(Vector, f64)> = normals
        .iter()
        .map(|n| if n.dot(&mean) < 0.0 { -*n } else { *n })
        .filter(|n| signed_angle(n, &mean) < 40f64.to_radians())
        .map(|n| (n, 1.0))
        .collect();
    let step = level.len().div_ceil(600).max(1);
    let level: Vec<(Vector, f64)> = level.into_iter().step_by(step).collect();
    match mean_shift(&level, 6f64.to_radians()).first() {
        // A surface, and not the odd normals of clutter: a third of all that are near level.
        Some(mode) if mode.weight >= 30.0 && 3.0 * mode.weight >= level.len() as f64 => {
            let axis = if mode.axis.dot(&mean) < 0.0 { -mode.axis } else { mode.axis };
            Up {
                direction: axis.into(),
                std_deg: ROOM_UP_STD_DEG,
                from: "the dominant level surface as cameras that hardly roll see it".to_owned(),
            }
        }
        _ => Up {
            direction: mean.into(),
            std_deg: CAMERA_UP_STD_DEG,
            from: "cameras that hardly roll; give --up AXIS where you know it".to_owned(),
        },
    }
}

/// Normals of the surface at every fourth pixel, facing the camera; none at edges.
fn slopes(depth: &crate::recording::Grid<f32>, camera: &Camera) -> Vec<Vector> {
    const STEP: usize = 4;
    let at = |x: usize, y: usize| {
        let z = f64::from(depth.get(x, y)?);
        (z > 0.0).then(|| camera.unproject(x as f64, y as f64, z))
    };
    let mut out = Vec::new();
    for y in (STEP..depth.height.saturating_sub(STEP)).step_by(STEP) {
        for x in (STEP..depth.width.saturating_sub(STEP)).step_by(STEP) {
            let around = (at(x - STEP, y), at(x + STEP, y), at(x, y - STEP), at(x, y + STEP), at(x, y));
            let (Some(left), Some(right), Some(above), Some(below), Some(middle)) = around else { continue };
            // In inverse depth a plane is linear in the image.
            let bend = |a: &Point, b: &Point| (0.5 / a.z + 0.5 / b.z - 1.0 / middle.z).abs() * middle.z;
            if bend(&left, &right) > 0.01 || bend(&above, &below) > 0.01 {
                continue;
            }
            let Some(normal) = unit(&(right - left).cross(&(below - above))) else { continue };
            out.push(if normal.dot(&middle.coords) > 0.0 { -normal } else { normal });
        }
    }
    out
}
