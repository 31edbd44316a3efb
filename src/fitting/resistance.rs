//! What a hand's path shows of damping and friction (ours).
//!
//! A path has no forces in it: while a hand holds a part, it moves as the hand likes, whatever the part resists with. Only
//! what the part does by itself tells something, and of that a recording keeps one thing: a hand lets go of a part that
//! still moves, and the next hand finds it elsewhere. In between the part coasted. With inertia `J` (that of the boxes as
//! fitted), damping `d` and dry friction `f` a part that is let go at speed `v` coasts over
//!
//! ```text
//! J dv/dt = -d v - f   =>   s = (J / d) (v - w ln(1 + v / w)),   w = f / d
//! ```
//!
//! One length tells one number: the ratio `w` stays that of the table, `d` follows. The inertia is an assumption (density,
//! what is in the furniture), and so the result is worth a factor of two, not digits.

use crate::articulation::{Action, Articulation, JointKind};
use crate::config;
use crate::hands::Trajectory;
use crate::inference;
use crate::math::{Vector, stats};
use crate::twin::{Part, mass_properties};

/// A part that a hand left open, and the next hand found.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Left {
    /// Speed at release, rad/s or m/s.
    pub(super) speed: f64,
    /// Opening at release, rad or m.
    pub(super) released: f64,
    /// Opening at which it was found, rad or m.
    pub(super) found: f64,
}

/// Openings that are each followed by a closing of the same joint. `clips` in the order of time.
pub(super) fn left_open(joint: &Articulation, clips: &[&Trajectory], rules: &config::Coast) -> Vec<Left> {
    let pair = |opened: &Trajectory, closed: &Trajectory| {
        if opened.action != Action::Open || closed.action != Action::Close {
            return None;
        }
        let grip = opened.closed_grip();
        let openings = inference::openings(joint, &grip, &opened.positions());
        let end = opened.samples.last()?.time_secs;
        let last: Vec<[f64; 2]> = opened
            .samples
            .iter()
            .zip(&openings)
            .map(|(s, q)| [s.time_secs - end, *q])
            .filter(|[t, _]| *t >= -rules.window_secs)
            .collect();
        let (released, speed) = line_at_zero(&last)?;
        Some(Left { speed, released, found: joint.opening_at(&grip, &closed.open_grip()) })
    };
    clips.iter().zip(clips.iter().skip(1)).filter_map(|(&a, &b)| pair(a, b)).collect()
}

/// Value and slope at `t = 0` of the straight line through samples `[t, value]`; `None` for fewer than three of them or
/// for a single instant.
fn line_at_zero(samples: &[[f64; 2]]) -> Option<(f64, f64)> {
    let n = samples.len() as f64;
    if samples.len() < 3 {
        return None;
    }
    let mean = [0, 1].map(|k| samples.iter().map(|s| s[k]).sum::<f64>() / n);
    let spread: f64 = samples.iter().map(|s| (s[0] - mean[0]).powi(2)).sum();
    let together: f64 = samples.iter().map(|s| (s[0] - mean[0]) * (s[1] - mean[1])).sum();
    let slope = together / spread;
    slope.is_finite().then_some((mean[1] - slope * mean[0], slope))
}

/// Damping and friction that the coasts of a part show, with the ratio of the `table`'s (damping, friction); `None` where
/// none is told clearly, or where gravity moves the part too.
pub(super) fn seen(
    part: &Part,
    left: &[Left],
    table: [f64; 2],
    up: &Vector,
    density: f64,
    rules: &config::Coast,
) -> Option<[f64; 2]> {
    let phi = part.joint.articulation;
    let mass = mass_properties(&part.solids, density)?;
    let along = phi.axis.dot(up).abs();
    let (inertia, lever, weightless) = match phi.kind {
        JointKind::Prismatic => (mass.mass, 1.0, along < rules.level_rad.sin()),
        JointKind::Revolute => {
            let line = phi.line();
            let about = phi.axis.dot(&(mass.inertia * phi.axis)) + mass.mass * line.distance(&mass.center).powi(2);
            (about, line.distance(&part.handle), along > rules.level_rad.cos())
        }
    };
    if !weightless {
        return None;
    }
    let [damping, friction] = table;
    let ratio = friction / damping;
    let told = |l: &&Left| {
        l.speed * lever >= rules.least_speed_m_per_s
            && (l.found - l.released) * lever >= rules.least_coast_m
            && (part.joint.upper - l.found) * lever >= rules.stop_m
    };
    let dampings: Vec<f64> = left
        .iter()
        .filter(told)
        .map(|l| inertia * (l.speed - ratio * (l.speed / ratio).ln_1p()) / (l.found - l.released))
        .collect();
    let found = stats::median(&dampings)?;
    let plausible = (damping / rules.plausible..=damping * rules.plausible).contains(&found);
    plausible.then_some([found, found * ratio])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hands::Sample;
    use crate::math::Point;
    use crate::twin::{Joint, OrientedBox, Role, Solid};
    use nalgebra::Matrix3;

    /// A door of 0.5 x 0.7 m on an upright hinge at the origin.
    fn door() -> Part {
        let shape = OrientedBox {
            center: Point::new(0.25, 0.009, 0.35),
            half: Vector::new(0.25, 0.009, 0.35),
            rotation: Matrix3::identity(),
        };
        Part {
            id: String::new(),
            label: String::new(),
            joint: Joint {
                articulation: Articulation { kind: JointKind::Revolute, axis: -Vector::z(), origin: Point::origin() },
                upper: 1.9,
                observed: 1.2,
                expected: 1.9,
                damping: 0.5,
                friction: 0.2,
                resistance_seen: false,
                balanced: false,
                probability: None,
            },
            solids: vec![Solid { name: String::new(), role: Role::Front, shape, seen: true }],
            handle: Point::new(0.45, -0.03, 0.4),
            bounds: shape,
        }
    }

    fn hand(part: &Part, action: Action, times: &[f64], opening: impl Fn(f64) -> f64) -> Trajectory {
        let samples = times
            .iter()
            .enumerate()
            .map(|(frame, &t)| {
                let p = part.joint.articulation.motion(opening(t)) * part.handle;
                Sample { frame, time_secs: t, observed: p, smoothed: p, accepted: true }
            })
            .collect();
        Trajectory { side: None, samples, action, ends_seen: [true; 2] }
    }

    /// Where a door with a damping and a friction comes to rest that is let go at an opening and a speed.
    fn rest(damping: f64, friction: f64, mut opening: f64, mut speed: f64) -> f64 {
        // Thin boards about their edge: m w^2 / 3, and what the thickness adds.
        let mass = 700.0 * 0.5 * 0.7 * 0.018;
        let inertia = mass * (0.5f64.powi(2) + 0.018f64.powi(2)) / 3.0;
        let dt = 1e-5;
        while speed > 0.0 {
            opening += speed * dt;
            speed -= (damping * speed + friction) / inertia * dt;
        }
        opening
    }

    fn shown(damping: f64, friction: f64, speed: f64) -> Option<[f64; 2]> {
        let part = door();
        let times: Vec<f64> = (0..=20).map(|i| f64::from(i) / 20.0).collect();
        // Pushed evenly and let go after a second.
        let opened = hand(&part, Action::Open, &times, |t| speed * t);
        let found = rest(damping, friction, speed, speed);
        let later: Vec<f64> = times.iter().map(|t| t + 5.0).collect();
        // Four samples at rest before the hand moves it.
        let closed = hand(&part, Action::Close, &later, |t| found * (1.0 - ((t - 5.2) / 0.8).max(0.0)));
        let left = left_open(&part.joint.articulation, &[&opened, &closed], &config::Coast::default());
        assert_eq!(left.len(), 1);
        seen(&part, &left, [0.5, 0.2], &Vector::z(), 700.0, &config::Coast::default())
    }

    #[test]
    fn the_coast_of_a_door_shows_its_damping() {
        // The ratio of friction and damping is the table's.
        for factor in [0.7, 0.85, 1.0] {
            let [damping, friction] = shown(0.5 * factor, 0.2 * factor, 1.0).unwrap();
            assert!((damping / (0.5 * factor) - 1.0).abs() < 0.05, "{factor}: {damping}");
            assert!((friction / damping - 0.4).abs() < 1e-12);
        }
    }

    #[test]
    fn a_hand_that_stops_the_part_shows_nothing() {
        // Let go at a snail's pace; found where it was left.
        assert_eq!(shown(0.5, 0.2, 0.2), None);
        let part = door();
        let still = Left { speed: 1.0, released: 0.8, found: 0.82 };
        assert_eq!(seen(&part, &[still], [0.5, 0.2], &Vector::z(), 700.0, &config::Coast::default()), None);
        // Found at its stop.
        let stopped = Left { speed: 1.0, released: 0.8, found: 1.88 };
        assert_eq!(seen(&part, &[stopped], [0.5, 0.2], &Vector::z(), 700.0, &config::Coast::default()), None);
        // A level hinge: gravity has its share.
        let coasted = Left { speed: 1.0, released: 0.8, found: 1.3 };
        assert!(seen(&part, &[coasted], [0.5, 0.2], &Vector::z(), 700.0, &config::Coast::default()).is_some());
        assert_eq!(seen(&part, &[coasted], [0.5, 0.2], &Vector::x(), 700.0, &config::Coast::default()), None);
    }
}
