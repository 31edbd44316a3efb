//! A joint against its rivals in closed form: how far the recorded hand is from the path that each would force on it.
//!
//! A simulated replay without obstacles adds next to nothing to this distance, and costs a thousand times as much: all
//! rivals are compared here, the best one is then simulated.

use serde::{Deserialize, Serialize};

use crate::articulation::{Articulation, JointKind};
use crate::config;
use crate::hands::Trajectory;
use crate::inference::openings;
use crate::math::{Point, Vector, path, reject, stats, unit, unsigned_angle};
use crate::twin::{Part, Role};

/// One clip's hand as evidence.
#[derive(Debug, Clone, PartialEq)]
pub struct Evidence {
    /// Seconds from the first sample, one for each point of the path.
    pub times_secs: Vec<f64>,
    /// The smoothed hand, world; never empty.
    pub path: Vec<Point>,
    /// The hand at the closed end of the motion, world.
    pub closed: Point,
    /// How many independent samples the path is worth.
    pub samples: f64,
    /// Noise of the hand: what is left of its path beside the best hinge or slide of all, or what the smoother took away,
    /// whichever is more; root mean square, metres.
    pub noise_m: f64,
}

impl Evidence {
    /// What a trajectory says; `None` without samples.
    #[must_use]
    pub fn of(trajectory: &Trajectory, config: &config::Validation) -> Option<Self> {
        let (first, last) = (trajectory.samples.first()?, trajectory.samples.last()?);
        let path = trajectory.positions();
        let seconds = (last.time_secs - first.time_secs).max(0.0);
        let samples = config.effective_samples.min(path.len() as f64).min(1.0 + seconds / config.hand_correlation_secs);
        let kept: Vec<f64> = trajectory
            .samples
            .iter()
            .filter(|s| s.accepted)
            .map(|s| (s.observed - s.smoothed).norm_squared())
            .collect();
        let smoothed_away = (kept.iter().sum::<f64>() / kept.len().max(1) as f64).sqrt();
        Some(Self {
            times_secs: trajectory.samples.iter().map(|s| s.time_secs - first.time_secs).collect(),
            closed: trajectory.closed_grip(),
            samples,
            noise_m: smoothed_away.max(path::beside_any_joint(&path)),
            path,
        })
    }

    /// Why a joint that does not follow this hand is not refuted by it, in words: it was recorded at so few places that its way
    /// between them is not known, or it is faster than a hand that holds something. `None` where neither is so.
    #[must_use]
    pub fn doubt(&self, config: &config::Validation) -> Option<String> {
        if self.path.len() < config.least_samples {
            return Some(format!(
                "the hand was recorded at {} places only: its way between them is not known",
                self.path.len()
            ));
        }
        let speed = self.speed(config);
        (speed > config.hand_speed_max_m_per_s).then(|| {
            format!("the hand goes at {speed:.1} m/s, which no hand that holds something does: its times are off")
        })
    }

    /// The speed that a tenth of the motion exceeds, m/s, each over a time in which noise adds little to it; the mean one of a
    /// shorter motion.
    fn speed(&self, config: &config::Validation) -> f64 {
        let samples: Vec<(f64, &Point)> = self.times_secs.iter().copied().zip(&self.path).collect();
        let between = |a: &(f64, &Point), b: &(f64, &Point)| match ((b.1 - a.1).norm(), b.0 - a.0) {
            (0.0, _) => 0.0,
            (way, time) => way / time,
        };
        let speeds: Vec<f64> = samples
            .iter()
            .enumerate()
            .filter_map(|(i, a)| {
                let b = samples.iter().skip(i + 1).find(|b| b.0 - a.0 >= config.speed_window_secs)?;
                Some(between(a, b))
            })
            .collect();
        let whole = samples.first().zip(samples.last()).map_or(0.0, |(a, b)| between(a, b));
        stats::quantile(&speeds, 1.0 - config.speed_share).unwrap_or(whole)
    }
}

/// The grip on the closed part that suits a whole path best (errors of the closed end alone would move the entire motion),
/// and the path's mean squared distance from where opening takes it, m^2. No opening is below closed. On a hinge the grip's
/// distance and height are those of the path, its angle is that of `closed`.
fn fitted(joint: &Articulation, closed: &Point, path: &[Point]) -> (Point, f64) {
    let count = path.len().max(1) as f64;
    let arm = reject(&(closed - joint.origin), &joint.axis);
    match (joint.kind, unit(&arm)) {
        (JointKind::Prismatic, _) => {
            // Side steps from the line through `closed`, and squares of what lies before it.
            let steps: Vec<(Vector, f64)> = path
                .iter()
                .map(|p| {
                    let d = p - closed;
                    (reject(&d, &joint.axis), d.dot(&joint.axis).min(0.0).powi(2))
                })
                .collect();
            let mean = steps.iter().fold(Vector::zeros(), |sum, (side, _)| sum + side) / count;
            let sum: f64 = steps.iter().map(|(side, before)| (side - mean).norm_squared() + before).sum();
            (closed + mean, sum / count)
        }
        (JointKind::Revolute, Some(arm)) => {
            let side = joint.axis.cross(&arm);
            let mut last = 0.0;
            // Distance from the hinge (of what lies before the closed end: along the closed arm), height, and the square of
            // what lies beside the closed arm.
            let places: Vec<[f64; 3]> = path
                .iter()
                .map(|p| {
                    let d = p - joint.origin;
                    let (x, y) = (d.dot(&arm), d.dot(&side));
                    let turn = std::f64::consts::TAU;
                    let angle = y.atan2(x);
                    last = angle - ((angle - last) / turn).round() * turn;
                    let (distance, beside) = if last >= 0.0 { (x.hypot(y), 0.0) } else { (x, y * y) };
                    [distance, d.dot(&joint.axis), beside]
                })
                .collect();
            let mean = |k: usize| places.iter().map(|p| p[k]).sum::<f64>() / count;
            let (radius, height) = (mean(0).max(0.0), mean(1));
            let sum: f64 =
                places.iter().map(|[r, h, beside]| (r - radius).powi(2) + (h - height).powi(2) + beside).sum();
            (joint.origin + arm * radius + joint.axis * height, sum / count)
        }
        // A hand on the hinge itself is held there.
        (JointKind::Revolute, None) => (*closed, path_distance2(joint, closed, path)),
    }
}

/// The grip on the closed part that suits a clip best, world.
#[must_use]
pub fn anchored(joint: &Articulation, clip: &Evidence) -> Point {
    fitted(joint, &clip.closed, &clip.path).0
}

/// Mean squared distance of a clip's hand from the path that a joint would force on it, m^2.
#[must_use]
pub fn distance2(joint: &Articulation, clip: &Evidence) -> f64 {
    fitted(joint, &clip.closed, &clip.path).1
}

/// Mean squared distance of a path from where opening takes the part's point `grip`, m^2.
#[must_use]
pub fn path_distance2(joint: &Articulation, grip: &Point, path: &[Point]) -> f64 {
    let sum: f64 = path
        .iter()
        .zip(openings(joint, grip, path))
        .map(|(p, opening)| (p - joint.motion(opening.max(0.0)) * grip).norm_squared())
        .sum();
    sum / path.len().max(1) as f64
}

/// How likely a joint makes the hands of all clips, in nats up to a constant. Heavy-tailed: beyond the expected noise only
/// the ratio of the distances counts, so that a badly measured hand decides less.
#[must_use]
pub fn log_likelihood(joint: &Articulation, clips: &[Evidence], config: &config::Validation) -> f64 {
    let expected = 2.0 * config.hand_std_m.powi(2);
    clips.iter().map(|clip| -clip.samples * (1.0 + distance2(joint, clip) / expected).ln()).sum()
}

/// What else a joint could be.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Rival {
    /// In words: "hinge on the left", "slide straight out", ...
    pub name: String,
    /// The joint.
    pub articulation: Articulation,
}

/// The name of a joint's own axis with the other sense of opening.
pub const REVERSED: &str = "joint that opens the other way";

/// What else a part could be: hinged at the edges of its front, sliding along an axis of its face, hinged beside its hinge,
/// or opening the other way. `grip` is where hands hold it closed.
#[must_use]
pub fn rivals(part: &Part, grip: &Point, config: &config::Validation) -> Vec<Rival> {
    let own = part.joint.articulation;
    let bounds = &part.bounds;
    let [right, up, out] = [0, 1, 2].map(|i| bounds.rotation.column(i).into_owned());
    let mut all = vec![rival(REVERSED, own.reversed())];
    // A drawer's bounds reach far behind its front, where no hinge is.
    let front = part.solids.iter().find(|s| s.role == Role::Front).map_or(bounds.center, |s| s.shape.center);
    let depth = out * out.dot(&(front - bounds.center));
    for (axis, across, half, names) in [
        (up, right, bounds.half.x, ["hinge on the left", "hinge on the right"]),
        (right, up, bounds.half.y, ["hinge below", "hinge above"]),
    ] {
        for (name, sign) in names.into_iter().zip([-1.0, 1.0]) {
            let origin = bounds.center + depth + across * (half * sign);
            let hinge = opening_towards(Articulation { kind: JointKind::Revolute, axis, origin }, grip, &out);
            let near = own.kind == JointKind::Revolute
                && unsigned_angle(&axis, &own.axis) < config.same_way_rad
                && own.line().distance(&origin) < 0.5 * half.max(config.least_half_m);
            // A hinge through the hand explains nothing and would not be built.
            if !near && hinge.line().distance(grip) > config.least_lever_m {
                all.push(rival(name, hinge));
            }
        }
    }
    for (name, axis) in [
        ("slide straight out", out),
        ("slide to the right", right),
        ("slide to the left", -right),
        ("slide upwards", up),
        ("slide downwards", -up),
    ] {
        if own.kind == JointKind::Revolute || unsigned_angle(&axis, &own.axis) > config.same_way_rad {
            all.push(rival(name, Articulation { kind: JointKind::Prismatic, axis, origin: *grip }));
        }
    }
    if let (JointKind::Revolute, Some(arm)) = (own.kind, unit(&reject(&(grip - own.origin), &own.axis))) {
        let opening = own.axis.cross(&arm);
        let by = (100.0 * config.rival_shift_m).round();
        for (place, direction) in
            [("nearer to the hand", arm), ("farther from the hand", -arm), ("in front", opening), ("behind", -opening)]
        {
            let moved = Articulation { origin: own.origin + direction * config.rival_shift_m, ..own };
            all.push(rival(&format!("hinge {by:.0} cm {place}"), opening_towards(moved, grip, &opening)));
        }
    }
    all
}

fn rival(name: &str, articulation: Articulation) -> Rival {
    Rival { name: name.to_owned(), articulation }
}

/// The sense of a hinge in which the grip goes out.
fn opening_towards(hinge: Articulation, grip: &Point, out: &Vector) -> Articulation {
    if hinge.axis.cross(&(grip - hinge.origin)).dot(out) >= 0.0 { hinge } else { hinge.reversed() }
}

/// The errors of a joint that its recordings would show.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Resolution {
    /// The least shift of a hinge that is seen in every direction, metres; `None` for a slide, and where half a metre is
    /// not seen.
    pub shift_m: Option<f64>,
    /// The least tilt of the axis that is seen in every direction, rad; `None` where 45 degrees are not seen.
    pub tilt_rad: Option<f64>,
}

/// Moves a joint in every direction until its recordings speak against it. In steps of 1 cm and 1 degree.
#[must_use]
pub fn resolution(joint: &Articulation, clips: &[Evidence], config: &config::Validation) -> Resolution {
    let none = Resolution { shift_m: None, tilt_rad: None };
    let Some(grip) = clips.first().map(|c| c.closed) else { return none };
    let arm =
        unit(&reject(&(grip - joint.origin), &joint.axis)).unwrap_or_else(|| crate::math::any_orthogonal(&joint.axis));
    let across = joint.axis.cross(&arm);
    let start = log_likelihood(joint, clips, config);
    let seen = |moved: &Articulation| start - log_likelihood(moved, clips, config) >= config.seen_nats;
    // What the worst direction needs.
    let least = |steps: u32, moved: &dyn Fn(&Vector, f64) -> Articulation| -> Option<u32> {
        [arm, -arm, across, -across]
            .iter()
            .map(|direction| (1..=steps).find(|step| seen(&moved(direction, f64::from(*step)))))
            .collect::<Option<Vec<u32>>>()
            .and_then(|all| all.into_iter().max())
    };
    let shifted =
        |direction: &Vector, step: f64| Articulation { origin: joint.origin + direction * (0.01 * step), ..*joint };
    // About the point of the axis beside the hand: elsewhere a tilt would be a shift too.
    let pivot = joint.line().project(&grip);
    let tilted = |direction: &Vector, step: f64| Articulation {
        axis: crate::math::rotation(direction, step.to_radians()) * joint.axis,
        origin: pivot,
        ..*joint
    };
    Resolution {
        shift_m: (joint.kind == JointKind::Revolute)
            .then(|| least(50, &shifted))
            .flatten()
            .map(|s| 0.01 * f64::from(s)),
        tilt_rad: least(45, &tilted).map(|s| f64::from(s).to_radians()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HINGE: Articulation = Articulation {
        kind: JointKind::Revolute,
        axis: Vector::new(0.0, 0.0, -1.0),
        origin: Point::new(0.0, 0.0, 0.0),
    };

    fn evidence(joint: &Articulation, range: f64) -> Evidence {
        let grip = Point::new(0.45, -0.03, 0.4);
        let path: Vec<Point> = (0..=30).map(|i| joint.motion(range * f64::from(i) / 30.0) * grip).collect();
        Evidence {
            times_secs: (0..=30).map(|i| 0.1 * f64::from(i)).collect(),
            closed: path[0],
            samples: 8.0,
            noise_m: 0.0,
            path,
        }
    }

    #[test]
    fn a_joint_is_at_no_distance_from_its_own_motion_and_its_reverse_is_stuck() {
        let slide = Articulation { kind: JointKind::Prismatic, axis: -Vector::y(), ..HINGE };
        for (joint, range) in [(HINGE, 1.2), (slide, 0.3)] {
            let clip = evidence(&joint, range);
            assert!(distance2(&joint, &clip) < 1e-20);
            // The other way to the same number.
            for other in [joint.reversed(), slide, HINGE] {
                let there = path_distance2(&other, &anchored(&other, &clip), &clip.path);
                assert!((there - distance2(&other, &clip)).abs() < 1e-12, "{other:?}");
            }
            assert!((anchored(&joint, &clip) - clip.closed).norm() < 1e-9);
            // All that a reversed joint can do is stay closed.
            let middle = clip.path[15] - clip.closed;
            assert!(distance2(&joint.reversed(), &clip).sqrt() > 0.4 * middle.norm());
        }
    }

    #[test]
    fn a_wide_arc_shows_a_small_shift_and_a_narrow_one_does_not() {
        let config = config::Validation::default();
        let wide = resolution(&HINGE, &[evidence(&HINGE, 1.6)], &config);
        let narrow = resolution(&HINGE, &[evidence(&HINGE, 0.3)], &config);
        let (shift, tilt) = (wide.shift_m.unwrap(), wide.tilt_rad.unwrap());
        assert!(shift < 0.12 && tilt < 0.35, "{wide:?}");
        assert!(narrow.shift_m.is_none_or(|s| s > 2.0 * shift), "{narrow:?}");
        assert!(narrow.tilt_rad.is_none_or(|t| t > 1.5 * tilt), "{narrow:?}");
    }

    #[test]
    fn a_hand_of_few_places_or_faster_than_any_is_doubted() {
        let config = config::Validation::default();
        let clip = evidence(&HINGE, 1.2);
        assert_eq!(clip.doubt(&config), None);
        let kept = |n: usize| Evidence {
            times_secs: clip.times_secs.iter().step_by(30 / n).copied().collect(),
            path: clip.path.iter().step_by(30 / n).copied().collect(),
            ..clip.clone()
        };
        assert!(kept(3).doubt(&config).is_some_and(|d| d.contains("at 4 places only")));
        assert_eq!(kept(5).doubt(&config), None);
        let fast = Evidence { times_secs: clip.times_secs.iter().map(|t| 0.02 * t).collect(), ..clip.clone() };
        assert!(fast.doubt(&config).is_some_and(|d| d.contains("its times are off")));
        // A single jump is no speed of the hand.
        let mut jumps = clip;
        jumps.path[15] += Vector::new(0.0, 0.0, 1.0);
        assert_eq!(jumps.doubt(&config), None);
    }

    #[test]
    fn a_trembling_hand_is_noisy_whatever_the_joint_and_a_clean_arc_is_not() {
        let clean = evidence(&HINGE, 1.2).path;
        assert!(path::beside_any_joint(&clean) < 1e-6);
        let shaken: Vec<Point> = clean
            .iter()
            .enumerate()
            .map(|(i, p)| p + Vector::new(0.0, 0.0, if i % 2 == 0 { 0.05 } else { -0.05 }))
            .collect();
        assert!((path::beside_any_joint(&shaken) - 0.05).abs() < 0.01);
    }
}
