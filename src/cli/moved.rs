//! What a recorded path of somebody's point did to somebody's part: which one it moved, which way, and whether it can be.

use std::path::Path;

use anyhow::bail;

use super::shown;
use crate::articulation::{Action, Articulation, JointKind};
use crate::config;
use crate::inference::{bare, openings};
use crate::math::{Point, Vector, path, rounded, unsigned_angle};
use crate::model::{Model, ModelFormat};
use crate::recording::trajectory::BareTrajectory;
use crate::twin::{OrientedBox, Part, Twin};
use crate::validation::rivals::path_distance2;

/// A point of a part is no further from its boxes, metres: fingers, and shapes that are not in the file.
const ON_PART_M: f64 = 0.05;
/// Who never comes nearer to a part holds nothing of it, metres, whatever its joint is: handles and markers stand out by less.
const OFF_PART_M: f64 = 0.3;
/// A path that goes there and back goes further than this, metres.
const BACK_M: f64 = 0.03;
/// So far apart are the farthest of many samples of a still hand, in root mean squares of its noise across a path: three
/// standard deviations to each side.
const NOISE_SPREAD: f64 = 4.0;

/// What a path does to a part.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Motion {
    /// Opening or closing.
    pub action: Action,
    /// Samples that belong to it, from the first: a path that closes and opens again is cut where it turns.
    pub samples: usize,
}

/// What a path does, by its motion along the part's joint: where on the part the point is says nothing about it.
///
/// Only on a hinge the place may overrule the motion: where the end that would be closed is off the closed part and the other
/// end is on it, the joint opens the other way than the recorded part.
pub fn motion(part: &Part, points: &[Point]) -> Motion {
    let phi = part.joint.articulation;
    let all = Motion { action: Action::Open, samples: points.len() };
    let (Some(first), Some(last)) = (points.first(), points.last()) else { return all };
    let along = openings(&phi, first, points);
    let net = along.last().copied().unwrap_or(0.0);
    let extreme =
        |sign: f64| along.iter().map(|q| sign * q).enumerate().max_by(|a, b| a.1.total_cmp(&b.1)).unwrap_or((0, 0.0));
    let ((highest, up), (lowest, down)) = (extreme(1.0), extreme(-1.0));
    let lever = |i: usize| points.get(i).map_or(0.0, |p| phi.lever(p));
    let spread_m = up * lever(highest) + down * lever(lowest);
    if net.abs() < 0.5 * (up + down) && spread_m > BACK_M.max(NOISE_SPREAD * path::beside_any_joint(points)) {
        // There and back.
        return if up >= down { all } else { Motion { action: Action::Close, samples: lowest + 1 } };
    }
    let opens = net >= 0.0;
    let off = |p: &Point| from_box(&part.bounds, p);
    let (closed, open) = if opens { (first, last) } else { (last, first) };
    let other_way = phi.kind == JointKind::Revolute && off(open) <= ON_PART_M && off(closed) > 2.0 * ON_PART_M;
    Motion { action: if opens == other_way { Action::Close } else { Action::Open }, ..all }
}

/// Distance of a point from a box, metres; 0 inside.
fn from_box(shape: &OrientedBox, p: &Point) -> f64 {
    let local = shape.rotation.transpose() * (p - shape.center);
    (local.abs() - shape.half).map(|x| x.max(0.0)).norm()
}

/// The part that a path moved: the one whose joint explains it best from where it is held closed, be it anywhere on the part;
/// and how far both are off, metres. Of parts that do so to the centimetre the one whose handle is nearest.
pub fn nearest(twin: &Twin, points: &[Point]) -> (usize, f64) {
    let off = |part: &Part| {
        let moved = motion(part, points);
        let path = points.get(..moved.samples).unwrap_or(points);
        let closed = if moved.action == Action::Open { path.first() } else { path.last() };
        let Some(closed) = closed else { return (f64::INFINITY, 0.0) };
        let beside = path_distance2(&part.joint.articulation, closed, path).sqrt();
        (beside.hypot(from_box(&part.bounds, closed)), (part.handle - closed).norm())
    };
    let all: Vec<(usize, f64, f64)> = twin
        .furniture
        .iter()
        .enumerate()
        .map(|(i, f)| {
            let (off, handle) = off(&f.part);
            (i, off, handle)
        })
        .collect();
    let least = all.iter().map(|(_, off, _)| *off).fold(f64::INFINITY, f64::min);
    all.iter()
        .filter(|(_, off, _)| *off <= least + 0.01)
        .min_by(|a, b| a.2.total_cmp(&b.2))
        .map_or((0, f64::INFINITY), |(i, off, _)| (*i, *off))
}

/// Refuses time stamps that no motion has.
pub fn check_times(file: &Path, recorded: &BareTrajectory) -> anyhow::Result<()> {
    // No hand that holds a part is as fast, m/s.
    const FASTEST: f64 = 20.0;
    let (Some(first), Some(last)) = (recorded.times_secs.first(), recorded.times_secs.last()) else { return Ok(()) };
    let way_out = "time stamps must be seconds; without the column 30 samples a second are taken";
    let (mut way, mut at_once, mut count) = (0.0, 0.0, 0);
    for (times, points) in recorded.times_secs.windows(2).zip(recorded.positions.windows(2)) {
        let step = (points[1] - points[0]).norm();
        way += step;
        if times[1] <= times[0] && step > 0.0 {
            at_once += step;
            count += 1;
        }
    }
    if count > 0 && at_once > 0.5 * way {
        bail!(
            "{}: {count} samples have the time stamp of the one before and are elsewhere (between {first} and {last}): \
             {way_out}",
            shown(file)
        );
    }
    let seconds = last - first;
    let farthest = recorded.positions.first().map_or(0.0, |start| {
        let all: Vec<f64> = recorded.positions.iter().map(|p| (p - start).norm()).collect();
        crate::math::stats::quantile(&all, 0.95).unwrap_or(0.0)
    });
    if farthest > FASTEST * seconds && recorded.positions.len() > 1 {
        bail!("{}: the hand goes {} m in {seconds:.2e} s: {way_out}", shown(file), rounded(farthest, 2));
    }
    Ok(())
}

/// Refuses a path that is nowhere on the part that it is said to have moved, be it that it is in another frame, and limits that
/// the path shows to be radians which were read as degrees. A path that is beside the part is told.
pub fn check_place(file: &Path, model: Option<&Model>, part: &Part, points: &[Point]) -> anyhow::Result<()> {
    check_limits(file, model, part, points)?;
    if let Some(where_it_is) = same_arc_elsewhere(part, points) {
        bail!(
            "{}: the path is such an arc as {} makes, but {where_it_is}; it must be in the model's world frame",
            shown(file),
            part.label
        );
    }
    let near = distance(part, points);
    if near > OFF_PART_M {
        bail!(
            "{}: the path never comes nearer to {} than {} m; it must be in the model's world frame and in metres \
             (--units mm, --units cm; JOINT=FILE where it moved another part)",
            shown(file),
            part.label,
            rounded(near, 1)
        );
    }
    if near > ON_PART_M {
        eprintln!(
            "{}: the path never comes nearer to {} than {:.0} cm: is it in the model's world frame?",
            shown(file),
            part.label,
            100.0 * near
        );
    }
    Ok(())
}

/// How near a path comes to a part, metres, wherever between closed and open that is.
fn distance(part: &Part, points: &[Point]) -> f64 {
    // Between two of these openings a door's edge moves by less than a finger's length.
    const STEPS: u32 = 48;
    // More points of a path tell nothing new.
    const POINTS: usize = 500;
    let phi = part.joint.articulation;
    let ways: Vec<_> =
        (0..=STEPS).map(|k| phi.motion(part.joint.upper * f64::from(k) / f64::from(STEPS)).inverse()).collect();
    points
        .iter()
        .step_by(points.len().div_ceil(POINTS).max(1))
        .flat_map(|p| ways.iter().map(move |back| from_box(&part.bounds, &(back * p))))
        .fold(f64::INFINITY, f64::min)
}

/// Where the arc of a path lies, in words, that a hinge's part could have made if the hinge were there: about another axis or
/// beside the hinge, and not begun or ended at the closed part, or behind it. `None` where the path is none. A path that begins
/// at the closed part and leaves it to the front may be that of another joint, which is what a replay tells.
fn same_arc_elsewhere(part: &Part, points: &[Point]) -> Option<String> {
    // What differs by less is taken for the same, as shares and in metres.
    const SAME: f64 = 0.1;
    const SAME_M: f64 = 0.03;
    // From here on another axis is up, radians: 30 degrees.
    const TURNED: f64 = 0.52;
    let own = part.joint.articulation;
    if own.kind != JointKind::Revolute {
        return None;
    }
    let recorded = BareTrajectory { positions: points.to_vec(), ..BareTrajectory::default() };
    let inference = config::Inference::default();
    let outcome = bare::infer(&recorded, &inference);
    let arc = outcome.found().filter(|j| j.joint.kind == JointKind::Revolute)?;
    let (radius, handle) = (arc.circle_radius_m?, own.lever(&part.handle));
    let is_such = arc.residual_m <= inference.prismatic_tolerance_m
        && (radius - handle).abs() <= SAME_M.max(SAME * handle)
        && arc.range <= (1.0 + SAME) * part.joint.upper;
    let ends = [points.first()?, points.last()?];
    let begins_closed = ends.iter().any(|p| from_box(&part.bounds, p) <= 2.0 * ON_PART_M);
    if !is_such {
        return None;
    }
    if unsigned_angle(&arc.joint.axis, &own.axis) > TURNED {
        let axes = [axis_words(&arc.joint), axis_words(&own)];
        return (!begins_closed).then(|| format!("about {} instead of {} (is another axis up?)", axes[0], axes[1]));
    }
    let beside = own.line().distance(&arc.joint.origin);
    let is_elsewhere = beside > SAME_M.max(0.5 * radius) && (!begins_closed || is_behind(part, points));
    is_elsewhere.then(|| format!("{beside:.1} m beside its hinge (is the world turned or moved?)"))
}

/// Whether a path lies where the part does not go when it opens.
fn is_behind(part: &Part, points: &[Point]) -> bool {
    let own = part.joint.articulation;
    let opening: Vector = own.axis.cross(&(part.handle - own.line().project(&part.handle)));
    let before = |p: &Point| (p - part.bounds.center).dot(&opening) / opening.norm().max(1e-9);
    let mean = points.iter().map(before).sum::<f64>() / points.len().max(1) as f64;
    mean < -ON_PART_M
}

/// The direction of a joint's axis for people: `Y` where it is nearly that, else its numbers.
fn axis_words(joint: &Articulation) -> String {
    // Within 15 degrees.
    const NEARLY: f64 = 0.96;
    let axis = joint.axis;
    match (0..3).find(|k| axis[*k].abs() > NEARLY) {
        Some(k) => ["X", "Y", "Z"].get(k).map_or_else(String::new, |name| (*name).to_owned()),
        None => format!("({:.2} {:.2} {:.2})", axis.x, axis.y, axis.z),
    }
}

/// Refuses limits that the path shows to be radians which were read as degrees.
fn check_limits(file: &Path, model: Option<&Model>, part: &Part, points: &[Point]) -> anyhow::Result<()> {
    let phi = part.joint.articulation;
    let along = points.first().map_or_else(Vec::new, |first| openings(&phi, first, points));
    let range =
        along.iter().copied().fold(f64::NEG_INFINITY, f64::max) - along.iter().copied().fold(f64::INFINITY, f64::min);
    // Half a turn in radians, taken for degrees; and a motion that is none of so few of them.
    let few = std::f64::consts::PI.to_radians();
    if phi.kind == JointKind::Revolute && part.joint.upper < few && range > 10.0 * part.joint.upper {
        let why = match model.map(|m| m.format.clone()) {
            Some(ModelFormat::Mjcf { radian: false, .. }) => {
                "the file's angles are degrees; write <compiler angle=\"radian\"/>"
            }
            _ => "are its limits degrees that were converted twice? they must be radians here",
        };
        bail!(
            "{}: the path turns {} by {:.0}°, its limits allow {:.1}°: {why}",
            shown(file),
            part.label,
            range.to_degrees(),
            part.joint.upper.to_degrees()
        );
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::furniture::to_twin;

    fn twin(text: &str) -> Twin {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("m.xml");
        std::fs::write(&path, text).unwrap();
        to_twin(&crate::model::read(&path).unwrap()).0
    }

    fn path(part: &Part, held: &Point, from: f64, to: f64) -> Vec<Point> {
        (0..=40).map(|i| part.joint.articulation.motion(from + (to - from) * f64::from(i) / 40.0) * held).collect()
    }

    const TWO: &str = r#"<mujoco><compiler angle="radian"/><worldbody><body name="box">
        <geom name="back" type="box" size="0.5 0.01 0.5" pos="0 0.6 0.5"/>
        <body name="tray" pos="0 0 0.2"><joint name="drawer" type="slide" axis="0 -1 0" range="0 0.4"/>
          <geom type="box" size="0.28 0.2 0.1" pos="0 0.2 0"/></body>
        <body name="leaf" pos="-0.3 0 0.7"><joint name="door" axis="0 0 -1" range="0 1.5"/>
          <geom type="box" size="0.29 0.01 0.2" pos="0.3 0 0"/></body></body></worldbody></mujoco>"#;

    #[test]
    fn the_motion_along_the_joint_tells_the_action_wherever_the_point_is() {
        let twin = twin(TWO);
        for (index, held, far) in [
            (0, Point::new(0.0, 0.0, 0.2), 0.3),
            (0, Point::new(0.1, 0.35, 0.2), 0.3),
            // Behind the part, as bodies' origins are.
            (0, Point::new(0.0, 0.55, 0.2), 0.1),
            (1, Point::new(0.25, 0.01, 0.7), 1.2),
            (1, Point::new(-0.1, -0.01, 0.6), 0.4),
        ] {
            let part = &twin.furniture[index].part;
            assert_eq!(motion(part, &path(part, &held, 0.0, far)).action, Action::Open, "{held}");
            assert_eq!(motion(part, &path(part, &held, far, 0.0)).action, Action::Close, "{held}");
            assert_eq!(motion(part, &path(part, &held, 0.2 * far, far)).action, Action::Open, "{held}");
            assert_eq!(nearest(&twin, &path(part, &held, 0.0, far)).0, index, "{held}");
            let mut back = path(part, &held, far, 0.0);
            back.extend(path(part, &held, 0.0, far).into_iter().skip(1));
            assert_eq!(motion(part, &back), Motion { action: Action::Close, samples: 41 });
        }
    }

    #[test]
    fn noise_along_a_path_that_does_not_move_the_joint_cuts_it_nowhere() {
        let twin = twin(TWO);
        let part = &twin.furniture[1].part;
        // Away from the hinge, shaken by millimetres.
        let shaken = |k: u32| 0.006 * (f64::from(k * 7 % 11) / 10.0 - 0.5);
        let pulled: Vec<Point> =
            (0..=60).map(|k| Point::new(0.1 + f64::from(k) / 150.0, shaken(k), 0.7 + shaken(k + 3))).collect();
        assert_eq!(motion(part, &pulled).samples, pulled.len());
    }

    #[test]
    fn a_path_in_another_frame_is_refused_with_what_is_odd_about_it() {
        let twin = twin(TWO);
        let part = &twin.furniture[1].part;
        let held = part.handle;
        let opened = path(part, &held, 0.0, 1.2);
        let said = |points: &[Point]| {
            check_place(Path::new("p.txt"), None, part, points).map_or_else(|e| e.to_string(), |()| "fine".to_owned())
        };
        let moved = |by: &dyn Fn(&Point) -> Point| -> Vec<Point> { opened.iter().map(by).collect() };
        assert_eq!(said(&opened), "fine");
        for (points, word) in [
            (moved(&|p| Point::new(p.x, p.y, p.z + 1.2)), "never comes nearer"),
            (moved(&|p| Point::new(p.x, p.z, -p.y)), "is another axis up?"),
            (moved(&|p| Point::new(-p.x, -p.y, p.z)), "turned or moved?"),
            (moved(&|p| Point::new(-p.y, p.x, p.z)), "turned or moved?"),
        ] {
            assert!(said(&points).contains(word), "{word}: {}", said(&points));
        }
        // Another joint of the same part is no other frame: a flap, and a door hinged on the other side.
        let flap = Articulation { axis: Vector::x(), origin: Point::new(0.0, 0.0, 0.5), ..part.joint.articulation };
        let right = Articulation { axis: Vector::z(), origin: Point::new(0.3, 0.0, 0.7), ..part.joint.articulation };
        for (joint, held) in [(flap, Point::new(0.0, 0.0, 0.88)), (right, Point::new(-0.28, 0.0, 0.7))] {
            let other: Vec<Point> = (0..=40).map(|i| joint.motion(0.03 * f64::from(i)) * held).collect();
            assert_eq!(said(&other), "fine");
        }
    }

    #[test]
    fn a_door_that_was_opened_the_other_way_is_not_taken_to_be_closed() {
        let twin = twin(TWO);
        let part = &twin.furniture[1].part;
        let wrong = path(part, &Point::new(0.25, 0.0, 0.7), 0.0, -1.0);
        assert_eq!(motion(part, &wrong).action, Action::Open);
    }
}
