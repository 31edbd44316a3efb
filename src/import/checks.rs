//! What an assembled recording says against the conventions it was read with.
//!
//! Poses, depth, hands, up and clocks are held against each other by [`crate::recording::conventions`]; here what is found is put
//! into the options that set it right. A hand's own size tells its unit.

use nalgebra::Matrix3;

use super::axes::{Convention, upright};
use super::capture::{CameraAxes, Capture, Direction, QuaternionOrder, RawPose, RawRotation};
use super::finding::{Change, ImportFinding};
use super::imported::Imported;
use super::joint_orders::{PALM, TIPS};
use crate::math::{Point, Pose, Vector, stats};
use crate::recording::conventions::{self, Fix, Reading, Subject, readings_of};

/// Length of a grown person's palm from the wrist to the middle knuckle, metres, with room for children and errors.
const PALM_M: std::ops::Range<f64> = 0.04..0.16;

/// All findings. A few images of depth and masks are decoded.
#[must_use]
pub fn findings(imported: &Imported) -> Vec<ImportFinding> {
    let Some(posed) = posed(imported) else { return palm(imported).into_iter().collect() };
    let subject = subject(imported, posed);
    let found = conventions::findings(&subject);
    palm(imported).into_iter().chain(found.into_iter().map(|f| in_options(f, imported, posed, &subject))).collect()
}

/// The capture with the poses.
fn posed(imported: &Imported) -> Option<&Capture> {
    imported.captures.iter().find(|c| c.poses.as_ref().is_some_and(|p| !p.items.is_empty()))
}

/// Up in the source's world made right-handed, which the recording's world was turned by.
fn declared_up(imported: &Imported) -> Vector {
    imported.report.up.as_ref().map_or_else(Vector::z, |up| Vector::from(up.direction))
}

/// How the numbers of a pose in a file are read, all lengths in metres already.
fn convention(imported: &Imported, posed: &Capture) -> Convention {
    // Quaternions are written x y z w here, whatever the file has.
    Convention { unit_m: 1.0, quaternion: QuaternionOrder::Xyzw, ..Convention::of(posed, &imported.options) }
}

/// Order of the quaternions in the file; `None` where its rotations are no quaternions.
fn order(imported: &Imported, posed: &Capture) -> Option<QuaternionOrder> {
    let first = posed.poses.as_ref()?.items.first()?;
    matches!(first.pose.turn, RawRotation::Quaternion(_)).then(|| Convention::of(posed, &imported.options).quaternion)
}

fn subject<'a>(imported: &'a Imported, posed: &Capture) -> Subject<'a> {
    let having = |has: &dyn Fn(&super::imported::ImportedFrame) -> bool| -> Vec<usize> {
        imported.frames.iter().enumerate().filter(|(_, f)| has(f)).map(|(i, _)| i).collect()
    };
    let hands = imported.hands.iter().filter_map(|h| {
        let [thumb, index, middle] = TIPS.map(|i| h.joints.get(i).copied().flatten());
        Some((h.frame, Point::from((thumb?.coords + index?.coords + middle?.coords) / 3.0), h.side))
    });
    Subject {
        camera: imported.view.camera,
        poses: imported.frames.iter().map(|f| f.world_from_camera).collect(),
        secs: imported.frames.iter().map(|f| f.time_secs).collect(),
        readings: readings(imported, posed),
        hands: hands.collect(),
        with_depth: having(&|f| f.depth.is_some()),
        with_mask: having(&|f| f.mask.is_some()),
        depth: Box::new(move |frame| imported.depth_grid(imported.frames.get(frame)?).ok().flatten()),
        mask: Box::new(move |frame| imported.mask_grid(imported.frames.get(frame)?).ok().flatten()),
    }
}

/// The poses under other readings of the numbers in their file.
fn readings(imported: &Imported, posed: &Capture) -> Vec<(Reading, Vec<Pose>)> {
    let (convention, order) = (convention(imported, posed), order(imported, posed));
    let scale = imported.report.scale.as_ref().map_or(1.0, |s| s.metres_per_unit);
    let rotated = |turn| Pose::from_parts(Vector::zeros().into(), turn);
    let turned = rotated(imported.view.source_from_output);
    let world = rotated(upright(&declared_up(imported)));
    let raw: Vec<Pose> = imported
        .frames
        .iter()
        .map(|f| {
            let place = f.source_pose.translation.vector * scale;
            convention.raw(&Pose::from_parts(place.into(), f.source_pose.rotation))
        })
        .collect();
    let is_possible = |kind: Reading| match kind {
        Reading::WFirst => order == Some(QuaternionOrder::Xyzw),
        Reading::WLast => order == Some(QuaternionOrder::Wxyz),
        _ => true,
    };
    let again = |p: &Pose| Some(world * convention.world_from_camera(&RawPose::from_pose(p))? * turned);
    readings_of(&raw)
        .into_iter()
        .filter(|(kind, _)| is_possible(*kind))
        .filter_map(|(kind, poses)| Some((kind, poses.iter().map(again).collect::<Option<Vec<Pose>>>()?)))
        .collect()
}

/// A finding with the options that set it right, in the place of an edit.
fn in_options(found: conventions::Finding, imported: &Imported, posed: &Capture, subject: &Subject) -> ImportFinding {
    let changes = found.fix.as_ref().and_then(|fix| changes(fix, imported, posed, subject)).unwrap_or_default();
    let option = if changes.is_empty() {
        found.remedy.clone()
    } else {
        changes.iter().map(Change::words).collect::<Vec<_>>().join(" ")
    };
    let (certain, can_be_fixed) = (found.is_certain(), found.can_be_fixed() && !changes.is_empty());
    ImportFinding { what: found.what, evidence: found.evidence, option, certain, can_be_fixed, changes }
}

/// A fix as changes of options; `None` where no option does it.
fn changes(fix: &Fix, imported: &Imported, posed: &Capture, subject: &Subject) -> Option<Vec<Change>> {
    let convention = Convention::of(posed, &imported.options);
    match fix {
        Fix::Poses { reading, axes } => {
            let mut out = Vec::new();
            match reading {
                Reading::Declared => {}
                Reading::Inverse => out.push(Change::Poses(match convention.direction {
                    Direction::WorldFromCamera => Direction::CameraFromWorld,
                    Direction::CameraFromWorld => Direction::WorldFromCamera,
                })),
                Reading::WFirst => out.push(Change::Quaternion(QuaternionOrder::Wxyz)),
                Reading::WLast => out.push(Change::Quaternion(QuaternionOrder::Xyzw)),
                _ => return None,
            }
            out.extend(other_axes(axes, imported, &convention)?);
            Some(out)
        }
        Fix::Scale { factor, .. } => Some(vec![match &imported.report.scale {
            Some(scale) => Change::Scale(scale.metres_per_unit * factor),
            None => Change::Unit(convention.unit_m * factor),
        }]),
        Fix::Up(up) => {
            let source = convention.source_vector(&(upright(&declared_up(imported)).inverse() * up));
            let at = source.iamax();
            let mut axis = Vector::zeros();
            axis[at] = source[at].signum();
            // Only an axis can be given.
            (source[at].abs() > 0.99 * source.norm()).then(|| vec![Change::Up(axis)])
        }
        Fix::HandLag(frames) => {
            let steps: Vec<f64> = subject.secs.windows(2).map(|w| w[1] - w[0]).collect();
            let secs = *frames as f64 * stats::median(&steps)?;
            Some(vec![Change::HandLag(imported.options.hand_lag_secs - secs)])
        }
        Fix::PoseLag(_) | Fix::HandUnit(_) => None,
    }
}

/// The option for other axes of the camera, none where they stay; `None` where no option has them.
fn other_axes(axes: &Matrix3<f64>, imported: &Imported, convention: &Convention) -> Option<Option<Change>> {
    // Images may be turned against the camera that was posed.
    let turn = imported.view.source_from_output.to_rotation_matrix().into_inner();
    let axes = turn * axes * turn.transpose();
    if (axes - Matrix3::identity()).norm() < 1e-6 {
        return Some(None);
    }
    let opengl = Matrix3::from_diagonal(&Vector::new(1.0, -1.0, -1.0));
    let other = match convention.axes {
        CameraAxes::Opencv => CameraAxes::Opengl,
        CameraAxes::Opengl => CameraAxes::Opencv,
        CameraAxes::Unity => return None,
    };
    // Beside a body the camera's own axes are not an option's.
    ((axes - opengl).norm() < 1e-6 && convention.body_from_camera.is_none()).then_some(Some(Change::CameraAxes(other)))
}

/// A hand's own size tells the unit of the hands.
fn palm(imported: &Imported) -> Option<ImportFinding> {
    let lengths: Vec<f64> = imported
        .hands
        .iter()
        .filter_map(|h| {
            let [wrist, knuckle] = PALM.map(|i| h.joints.get(i).copied().flatten());
            Some((knuckle? - wrist?).norm())
        })
        .collect();
    let length = stats::median(&lengths)?;
    (!PALM_M.contains(&length)).then(|| ImportFinding {
        what: "the hands are not in metres".to_owned(),
        evidence: format!(
            "from the wrist to the middle knuckle are {length:.4} m (median), a hand's palm is 0.07 to 0.11"
        ),
        option: "--unit METRES for hands in the poses' world, else convert the hands".to_owned(),
        certain: false,
        can_be_fixed: false,
        changes: Vec::new(),
    })
}
