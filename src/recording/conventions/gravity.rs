//! Where up is: heads hardly roll and look down a little, level surfaces are seen from above, heads keep their height.

use nalgebra::Matrix3;

use super::looks::FrameLook;
use super::{Finding, Fix, LIKELY_NATS};
use crate::math::{Pose, Vector, eigen_descending, stats, unit};

/// Frames that count as independent for how a head is held, at the most: it looks about every few seconds.
const INDEPENDENT_ROLLS: f64 = 20.0;
/// The same for how far it looks down, which a kitchen settles for minutes.
const INDEPENDENT_PITCHES: f64 = 8.0;
/// Roll of a head, degrees (Laplace), with one frame in ten of any roll.
const ROLL_DEG: f64 = 8.0;
/// How far heads at work look down, and its spread, degrees.
const PITCH_DEG: f64 = 35.0;
const PITCH_STD_DEG: f64 = 30.0;
const STRAY: f64 = 0.1;
/// Weight of surfaces and of the head's height: each is about one thing that was seen, not one a frame.
const WEIGHT: f64 = 3.0;
/// How steadily a head keeps its height at best, metres.
const HEIGHT_STD_M: f64 = 0.05;
/// A world that leans by less is told by other steps, which bear it, or is not to be told from how heads are held: 25 degrees.
const LEAN: f64 = 0.44;
/// Two numbers of a direction that is fitted instead of named.
const FREE_NATS: f64 = 3.0;
/// Frames that are needed to judge.
const LEAST: usize = 6;
/// A normal within so much of a direction is along it: the cosine of 20 degrees.
const ALONG: f64 = 0.94;

/// What is known about one direction.
struct Evidence {
    nats: f64,
    roll_deg: f64,
    down_deg: f64,
    above: f64,
    below: f64,
    height_std_m: f64,
}

/// Compares the six axes of the world, and the one that cameras tell, with +Z.
pub(super) fn judge(poses: &[Pose], looks: &[FrameLook]) -> Option<Finding> {
    if poses.len() < LEAST {
        return None;
    }
    let normals: Vec<Vector> = looks
        .iter()
        .filter_map(|l| Some((l, poses.get(l.frame)?)))
        .flat_map(|(l, pose)| l.normals.iter().map(|n| pose.rotation * n))
        .collect();
    let of = |up: &Vector| evidence(poses, &normals, up);
    let declared = of(&Vector::z());
    let axes = [Vector::x(), Vector::y(), -Vector::x(), -Vector::y(), -Vector::z()];
    let named = axes.iter().map(|up| (*up, of(up))).max_by(|a, b| a.1.nats.total_cmp(&b.1.nats))?;
    let free = cameras_up(poses)?;
    let fitted = of(&free);
    // An axis is likelier than any direction beside it, by which heads at work lean.
    let is_axis = free.angle(&named.0) < LEAN || fitted.nats - FREE_NATS < named.1.nats + LIKELY_NATS;
    let (up, best) = if named.1.nats > declared.nats && is_axis {
        named
    } else if free.angle(&Vector::z()) > LEAN && fitted.nats - FREE_NATS > declared.nats {
        (free, fitted)
    } else {
        return None;
    };
    let nats = best.nats - declared.nats;
    (nats > LIKELY_NATS).then(|| finding(&up, &best, &declared, nats))
}

fn finding(up: &Vector, best: &Evidence, declared: &Evidence, nats: f64) -> Finding {
    let name = name(up);
    let words = |e: &Evidence| {
        format!(
            "cameras roll by {:.0} degrees and look down by {:.0} (medians), {:.0} % of what they see faces up and {:.0} % down, \
             heads keep their height to {:.2} m",
            e.roll_deg,
            e.down_deg,
            100.0 * e.above,
            100.0 * e.below,
            e.height_std_m
        )
    };
    Finding {
        what: format!("up is {name} of the world and not +Z"),
        evidence: format!("with {name} up {}; with +Z up {}", words(best), words(declared)),
        remedy: format!("turn the world (poses, hands, reconstruction) so that its {name} becomes +Z"),
        nats,
        ruinous: true,
        fix: Some(Fix::Up(*up)),
    }
}

/// An axis by its name, another direction by its numbers.
fn name(up: &Vector) -> String {
    let at = up.iamax();
    if up[at].abs() < 0.999 {
        return format!("({:.2}, {:.2}, {:.2})", up.x, up.y, up.z);
    }
    let sign = if up[at] < 0.0 { '-' } else { '+' };
    format!("{sign}{}", ["X", "Y", "Z"].get(at).copied().unwrap_or("Z"))
}

fn evidence(poses: &[Pose], normals: &[Vector], up: &Vector) -> Evidence {
    let mut rolls = Vec::with_capacity(poses.len());
    let mut downs = Vec::with_capacity(poses.len());
    for pose in poses {
        let along = |axis: Vector| (pose.rotation * axis).dot(up).clamp(-1.0, 1.0);
        rolls.push(along(Vector::x()).asin().abs().to_degrees());
        // About the camera's own right, so that beyond straight down is upside down.
        downs.push((-along(Vector::z())).atan2(-along(Vector::y())).to_degrees());
    }
    let logs = |values: &[f64], density: &dyn Fn(f64) -> f64| -> f64 {
        values.iter().map(|v| density(*v).ln()).sum::<f64>() / values.len() as f64
    };
    let roll = logs(&rolls, &|r| (1.0 - STRAY) * (-r / ROLL_DEG).exp() / ROLL_DEG + STRAY / 90.0);
    let pitch = logs(&downs, &|d| {
        let off = (d - PITCH_DEG) / PITCH_STD_DEG;
        let normal = (-0.5 * off * off).exp() / (PITCH_STD_DEG * std::f64::consts::TAU.sqrt());
        (1.0 - STRAY) * normal + STRAY / 360.0
    });
    let share = |sign: f64| {
        let along = normals.iter().filter(|n| sign * n.dot(up) > ALONG).count();
        along as f64 / normals.len().max(1) as f64
    };
    let (above, below) = (share(1.0), share(-1.0));
    let heights: Vec<f64> = poses.iter().map(|p| p.translation.vector.dot(up)).collect();
    let mean = stats::mean(&heights).unwrap_or(0.0);
    let variance = heights.iter().map(|h| (h - mean).powi(2)).sum::<f64>() / heights.len() as f64;
    let frames = poses.len() as f64;
    let nats = frames.min(INDEPENDENT_ROLLS) * roll
        + frames.min(INDEPENDENT_PITCHES) * pitch
        + WEIGHT * ((above + 0.05) / (below + 0.05)).ln()
        - 0.5 * WEIGHT * (variance + HEIGHT_STD_M * HEIGHT_STD_M).ln();
    Evidence {
        nats,
        roll_deg: stats::median(&rolls).unwrap_or(0.0),
        down_deg: stats::median(&downs).unwrap_or(0.0),
        above,
        below,
        height_std_m: variance.sqrt(),
    }
}

/// Up as cameras tell it that do not roll: their right is level wherever they look; their mean up, which leans where they look
/// down one way, has little say.
fn cameras_up(poses: &[Pose]) -> Option<Vector> {
    const LEAN_WEIGHT: f64 = 0.05;
    let mean = unit(&poses.iter().map(|p| p.rotation * -Vector::y()).sum::<Vector>())?;
    let mut level = (Matrix3::identity() - mean * mean.transpose()) * LEAN_WEIGHT;
    for pose in poses {
        let right = pose.rotation * Vector::x();
        level += right * right.transpose() / poses.len() as f64;
    }
    let (axes, _) = eigen_descending(level);
    let up = axes.column(2).into_owned();
    Some(if up.dot(&mean) < 0.0 { -up } else { up })
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::UnitQuaternion;

    /// A head that walks along a wall, turns to both sides and looks down.
    fn walk() -> Vec<Pose> {
        (0..30)
            .map(|i| {
                let t = f64::from(i);
                let level = UnitQuaternion::from_axis_angle(&Vector::x_axis(), -std::f64::consts::FRAC_PI_2);
                let down = UnitQuaternion::from_axis_angle(&Vector::x_axis(), -0.6 + 0.1 * (t % 3.0));
                let yaw = UnitQuaternion::from_axis_angle(&Vector::z_axis(), 0.8 * (0.5 * t).sin());
                Pose::from_parts(Vector::new(0.1 * t, 0.05 * (t % 5.0), 1.6).into(), yaw * level * down)
            })
            .collect()
    }

    #[test]
    fn a_head_that_walks_tells_up_and_every_other_axis_is_named() {
        let right = walk();
        assert!(right.iter().all(|p| (p.rotation * -Vector::y()).z > 0.0));
        assert_eq!(judge(&right, &[]), None);
        for (name, up) in [("+Y", Vector::y()), ("-Y", -Vector::y()), ("+X", Vector::x()), ("-Z", -Vector::z())] {
            let turn = UnitQuaternion::rotation_between(&Vector::z(), &up)
                .unwrap_or_else(|| UnitQuaternion::from_axis_angle(&Vector::x_axis(), std::f64::consts::PI));
            let wrong: Vec<Pose> = right.iter().map(|p| turn * p).collect();
            let found = judge(&wrong, &[]).unwrap();
            assert!(found.what.contains(&format!("up is {name} ")) && found.is_certain(), "{name}: {found:?}");
            assert_eq!(found.fix, Some(Fix::Up(up)));
        }
    }

    #[test]
    fn a_world_that_leans_by_half_a_right_angle_is_named_and_one_by_a_few_degrees_is_not() {
        let leaning = |deg: f64| -> Vec<Pose> {
            let turn = UnitQuaternion::from_axis_angle(&Vector::x_axis(), deg.to_radians());
            walk().iter().map(|p| turn * p).collect()
        };
        assert_eq!(judge(&leaning(5.0), &[]), None);
        let found = judge(&leaning(45.0), &[]).unwrap();
        assert!(found.what.contains("up is ("), "{}", found.what);
    }
}
