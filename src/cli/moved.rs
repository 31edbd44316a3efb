//! What a recorded path of somebody's point did to somebody's part: which one it moved, which way, and whether it can be.

use std::path::Path;

use anyhow::bail;

use super::shown;
use crate::articulation::{Action, JointKind};
use crate::inference::openings;
use crate::math::Point;
use crate::model::{Format, Model};
use crate::recording::trajectory::BareTrajectory;
use crate::twin::{OrientedBox, Part, Twin};
use crate::validation::rivals::path_distance2;

/// A point of a part is no further from its boxes, metres: fingers, and shapes that are not in the file.
const ON_PART_M: f64 = 0.05;

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
    let ((_, up), (lowest, down)) = (extreme(1.0), extreme(-1.0));
    if net.abs() < 0.5 * (up + down) {
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
        bail!("{}: the hand goes {farthest:.2} m in {seconds:.2e} s: {way_out}", shown(file));
    }
    Ok(())
}

/// Refuses a path that is nowhere near the part that it is said to have moved, and limits that the path shows to be radians
/// which were read as degrees.
pub fn check_place(file: &Path, model: Option<&Model>, part: &Part, points: &[Point]) -> anyhow::Result<()> {
    // Between two of these openings a part moves by less than its own size.
    const STEPS: u32 = 12;
    let phi = part.joint.articulation;
    let ways: Vec<_> =
        (0..=STEPS).map(|k| phi.motion(part.joint.upper * f64::from(k) / f64::from(STEPS)).inverse()).collect();
    let near = points
        .iter()
        .flat_map(|p| ways.iter().map(move |back| from_box(&part.bounds, &(back * p))))
        .fold(f64::INFINITY, f64::min);
    // Who never comes nearer than a whole part's size holds nothing of it, whatever its joint is.
    let size = (2.0 * part.bounds.half.norm()).max(0.5);
    if near > size {
        bail!(
            "{}: the path never comes nearer to {} than {near:.1} m; it must be in the model's world frame and in metres \
             (--units mm, --units cm; JOINT=FILE where it moved another part)",
            shown(file),
            part.label
        );
    }
    let along = points.first().map_or_else(Vec::new, |first| openings(&phi, first, points));
    let range =
        along.iter().copied().fold(f64::NEG_INFINITY, f64::max) - along.iter().copied().fold(f64::INFINITY, f64::min);
    // Half a turn in radians, taken for degrees; and a motion that is none of so few of them.
    let few = std::f64::consts::PI.to_radians();
    if phi.kind == JointKind::Revolute && part.joint.upper < few && range > 10.0 * part.joint.upper {
        let why = match model.map(|m| m.format.clone()) {
            Some(Format::Mjcf { radian: false }) => "the file's angles are degrees; write <compiler angle=\"radian\"/>",
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
    fn a_door_that_was_opened_the_other_way_is_not_taken_to_be_closed() {
        let twin = twin(TWO);
        let part = &twin.furniture[1].part;
        let wrong = path(part, &Point::new(0.25, 0.0, 0.7), 0.0, -1.0);
        assert_eq!(motion(part, &wrong).action, Action::Open);
    }
}
