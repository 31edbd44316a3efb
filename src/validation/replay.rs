//! One part pulled by a compliant hand along a recorded path, and pushed back.

use serde::{Deserialize, Serialize};

use super::verdict::amount;
use super::world::{Contact, Surroundings, World};
use crate::articulation::{Articulation, JointKind};
use crate::config;
use crate::error::{Error, Result};
use crate::math::{Point, Vector, reject};
use crate::twin::{GRAVITY, MassProperties, Part, mass_properties};

/// Where the hand wants the grip to be.
#[derive(Debug, Clone, PartialEq)]
pub struct Drive {
    /// Seconds, not decreasing, from 0.
    pub times_secs: Vec<f64>,
    /// World positions, one for each time.
    pub path: Vec<Point>,
    /// The grip on the part when closed, world.
    pub grip: Point,
    /// Whether the hand then takes the part back the same way.
    pub back: bool,
}

/// What the simulation showed. All but `return_error` and `contacts` is about the way there.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Replay {
    /// Root mean square distance between hand and handle, metres.
    pub rms_m: f64,
    /// Largest distance between hand and handle, metres.
    pub max_m: f64,
    /// Root mean square of the distance's part along the joint's axis, metres.
    pub along_m: f64,
    /// Root mean square of the distance's part across the joint's axis, metres.
    pub across_m: f64,
    /// Largest force of the hand, newton.
    pub peak_force_n: f64,
    /// Largest torque of the hand about the hinge, N m; along a slide its largest force, N.
    pub peak_effort: f64,
    /// Opening at the start, rad or m.
    pub start: f64,
    /// Least and largest opening reached, rad or m.
    pub reached: [f64; 2],
    /// Steps of the simulation at the closed and at the open limit with the hand pulling beyond it.
    pub limit_steps: [usize; 2],
    /// Opening left after the hand brought the part back along its path, relative to the start; 0 where it did not.
    pub return_error: f64,
    /// What the part touched, the strongest contact first.
    pub contacts: Vec<Contact>,
    /// Solids of the part and others that share space or touch when closed: there are no contacts between them.
    pub closed_overlaps: Vec<[String; 2]>,
    /// Largest energy of the part's motion, J.
    pub kinetic_max_j: f64,
    /// Most work that hand and weight had done on the part, J: its motion cannot hold more.
    pub work_max_j: f64,
    /// Furthest that the part was off its joint, metres.
    pub drift_m: f64,
    /// Time (s), opening (rad or m), hand force (N), distance between hand and handle (m): about thirty a second.
    pub trace: Vec<[f64; 4]>,
    /// The hand at the times of the trace, world.
    pub hand: Vec<Point>,
    /// The grip on the part at the times of the trace, world.
    pub handle: Vec<Point>,
    /// The grip on the closed part, world.
    pub grip: Point,
    /// Why the simulation itself is not to be believed, in words; `None` where nothing speaks against it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub untrusted: Option<String>,
}

impl Replay {
    /// Before the first step.
    fn standing(opening: f64, grip: Point) -> Self {
        Self {
            rms_m: 0.0,
            max_m: 0.0,
            along_m: 0.0,
            across_m: 0.0,
            peak_force_n: 0.0,
            peak_effort: 0.0,
            start: opening,
            reached: [opening, opening],
            limit_steps: [0, 0],
            return_error: 0.0,
            contacts: Vec::new(),
            closed_overlaps: Vec::new(),
            kinetic_max_j: 0.0,
            work_max_j: 0.0,
            drift_m: 0.0,
            trace: Vec::new(),
            hand: Vec::new(),
            handle: Vec::new(),
            grip,
            untrusted: None,
        }
    }

    /// The deepest that the part was inside anything, metres, and inside what.
    #[must_use]
    pub fn worst_penetration(&self) -> Option<(f64, &str)> {
        self.contacts
            .iter()
            .filter(|c| c.depth_m > 0.0)
            .max_by(|a, b| a.depth_m.total_cmp(&b.depth_m))
            .map(|c| (c.depth_m, c.with.as_str()))
    }
}

/// Pulls `part` along `drive` under `joint` (which may be a rival of the part's own) with the limits 0..`upper`.
///
/// The hand is a spring and a damper of `hand_stiffness_n_per_m`, critical on the mass of the part, and no stronger than
/// `hand_force_max_n`. Fingers move on a handle: within `grip_slack_m` the spring does not pull. A part of grams moves with
/// the hand's own mass. A simulation that blew up all the same says so in [`Replay::untrusted`].
///
/// # Errors
/// Where rapier refuses the joint, or the path's times cannot be seconds of one motion.
pub fn simulate(
    part: &Part,
    joint: &Articulation,
    upper: f64,
    around: &Surroundings,
    drive: &Drive,
    config: &config::Validation,
) -> Result<Replay> {
    let (first, end) = beginning_and_end(part, drive, config)?;
    let dt = config.step_secs;
    let start = joint.opening_at(&drive.grip, &first).clamp(0.0, upper);
    let properties = mass_properties(&part.solids, around.density);
    let mass = properties.map_or(0.0, |m| m.mass);
    let damping = 2.0 * (config.hand_stiffness_n_per_m * mass.max(config.least_mass_kg)).sqrt();
    let held = properties.map_or(0.0, |p| held_inertia(joint, &drive.grip, &p, damping * dt / config.taken_share));
    let mut world = World::new(part, joint, upper, start, held, around, config)?;
    let start = world.start;

    let target = |t: f64| -> Point {
        let t = if t <= end { t } else { (2.0 * end + config.rest_secs - t).clamp(0.0, end) };
        at(&drive.times_secs, &drive.path, t)
    };
    let forward = ((end / dt).ceil() as usize).max(1);
    let steps =
        if drive.back { (((2.0 * end + 2.0 * config.rest_secs) / dt).ceil() as usize).max(forward) } else { forward };
    let every = ((1.0 / config.trace_hz / dt).round() as usize).max(1);

    // Weight does its work at the centre of mass.
    let center = properties.map(|m| m.center).filter(|_| !part.joint.balanced);
    let height = |world: &World| center.map_or(0.0, |c| (world.point(&c).0 - c).dot(around.up));
    let height_at_start = height(&world);
    let mut hand_work = 0.0;

    let mut out = Replay { closed_overlaps: world.closed_overlaps(), ..Replay::standing(start, drive.grip) };
    // Squared distances of the handle from the hand: all of it, and along the axis.
    let (mut sum, mut sum_along, mut counted) = (0.0, 0.0, 0usize);
    let mut fastest: f64 = 0.0;
    let mut opening = start;
    for step in 0..steps {
        let t = step as f64 * dt;
        let wanted = target(t);
        let wanted_velocity = (target(t + dt) - wanted) / dt;
        let (p, v) = world.point(&drive.grip);
        let force = pull(&(wanted - p), &(wanted_velocity - v), damping, config);
        world.step(&p, &force);
        let (now, speed) = world.point(&drive.grip);
        let state = [force.norm(), now.coords.norm(), speed.norm(), world.kinetic_energy()];
        if state.iter().any(|x| !x.is_finite()) {
            out.untrusted = Some(format!("the part's state was no number any more after {t:.2} s"));
            break;
        }
        fastest = fastest.max(speed.norm());
        let angle = joint.opening_at(&drive.grip, &now);
        // Continuous past half a turn.
        opening = if joint.kind == JointKind::Revolute {
            angle - ((angle - opening) / std::f64::consts::TAU).round() * std::f64::consts::TAU
        } else {
            angle
        };
        if step >= forward {
            continue;
        }
        let strength = force.norm();
        let turning = joint.effort(&now, &force);
        let error = target(t + dt) - now;
        let distance = error.norm();
        sum += distance * distance;
        sum_along += error.dot(&joint.axis).powi(2);
        counted += 1;
        hand_work += force.dot(&(now - p));
        let weight_work = -GRAVITY * mass * (height(&world) - height_at_start);
        out.max_m = out.max_m.max(distance);
        out.peak_force_n = out.peak_force_n.max(strength);
        out.peak_effort = out.peak_effort.max(turning.abs());
        out.reached = [out.reached[0].min(opening), out.reached[1].max(opening)];
        out.kinetic_max_j = out.kinetic_max_j.max(world.kinetic_energy());
        out.work_max_j = out.work_max_j.max(hand_work + weight_work);
        out.drift_m = out.drift_m.max(drift(&world, joint));
        out.limit_steps[0] += usize::from(opening < config.at_stop && turning < 0.0);
        out.limit_steps[1] += usize::from(opening > upper - config.at_stop && turning > 0.0);
        if step % every == 0 {
            out.trace.push([t, opening, strength, distance]);
            out.hand.push(target(t + dt));
            out.handle.push(now);
        }
    }
    if world.broke() && out.untrusted.is_none() {
        out.untrusted = Some("the physics engine gave the part up".to_owned());
    }
    if out.untrusted.is_none() {
        out.untrusted = beyond_reason(&out, joint, upper, fastest, config);
    }
    let count = counted.max(1) as f64;
    out.rms_m = (sum / count).sqrt();
    out.along_m = (sum_along / count).sqrt();
    out.across_m = ((sum - sum_along).max(0.0) / count).sqrt();
    out.return_error = if drive.back { opening - start } else { 0.0 };
    out.contacts = world.contacts();
    Ok(out)
}

/// Where a path begins, world, and how long it takes, seconds.
fn beginning_and_end(part: &Part, drive: &Drive, config: &config::Validation) -> Result<(Point, f64)> {
    let (Some(&first), Some(&end)) = (drive.path.first(), drive.times_secs.last()) else {
        return Err(Error::Simulation(format!("{}: an empty path", part.id)));
    };
    if !(0.0..=config.longest_secs).contains(&end) {
        return Err(Error::Simulation(format!(
            "{}: the recorded hand takes {end:.3e} s; time stamps must be seconds and must not go back",
            part.id
        )));
    }
    Ok((first, end))
}

/// The inertia (kg m^2 about a hinge, kg along a slide) that a joint lacks for a hand that is felt once a step: fingers that
/// hold a part of grams move with it, and a damper that takes most of a velocity in one step makes the part fly. `least_kg`, at
/// the grip: the hand's damping times the step, over the share of a velocity that it may take.
fn held_inertia(joint: &Articulation, grip: &Point, part: &MassProperties, least_kg: f64) -> f64 {
    let own = match joint.kind {
        JointKind::Prismatic => part.mass,
        JointKind::Revolute => {
            let arm = reject(&(part.center - joint.origin), &joint.axis);
            joint.axis.dot(&(part.inertia * joint.axis)) + part.mass * arm.norm_squared()
        }
    };
    (least_kg * joint.lever(grip).powi(2) - own).max(0.0)
}

/// Why a simulation's result cannot be: limits and joints hold in it as far as a motion counts as explained, no hand that
/// opens furniture throws it, and a part has no more energy than was put into it.
fn beyond_reason(
    replay: &Replay,
    joint: &Articulation,
    upper: f64,
    fastest: f64,
    config: &config::Validation,
) -> Option<String> {
    let [least, most] = replay.reached;
    let beyond = (most - upper).max(-least).max(0.0);
    if beyond * joint.lever(&replay.grip) > config.pass_rms_m {
        return Some(format!("the part went {} beyond its limits", amount(joint.kind, beyond)));
    }
    if replay.drift_m > config.pass_rms_m {
        return Some(format!("the part left its joint by {:.0} cm", 100.0 * replay.drift_m));
    }
    if fastest > config.thrown_m_per_s {
        return Some(format!("the handle moved at {fastest:.0} m/s"));
    }
    let most_j = config.spare_work * replay.work_max_j.max(0.0) + config.spare_j;
    (replay.kinetic_max_j > most_j).then(|| {
        format!(
            "the part moved with {:.1} J after {:.1} J of work had been done on it",
            replay.kinetic_max_j, replay.work_max_j
        )
    })
}

/// Force of the hand for its distance from the grip and the difference of their velocities.
fn pull(distance: &Vector, velocity: &Vector, damping: f64, config: &config::Validation) -> Vector {
    let far = distance.norm();
    let taut = if far > config.grip_slack_m { 1.0 - config.grip_slack_m / far } else { 0.0 };
    let force = distance * (taut * config.hand_stiffness_n_per_m) + velocity * damping;
    let strength = force.norm();
    if strength > config.hand_force_max_n { force * (config.hand_force_max_n / strength) } else { force }
}

/// How far the part is off its joint: the hinge's point and, a metre along it, its direction; the slide's side steps.
fn drift(world: &World, joint: &Articulation) -> f64 {
    let (shift, turn) = world.moved();
    match joint.kind {
        JointKind::Revolute => shift.norm().max((turn * joint.axis - joint.axis).norm()),
        JointKind::Prismatic => reject(&shift, &joint.axis).norm().max(turn.angle()),
    }
}

/// Position on a path at time `t`, linear between samples.
fn at(times: &[f64], path: &[Point], t: f64) -> Point {
    let last = path.len().min(times.len()).saturating_sub(1);
    let i = times.partition_point(|&x| x <= t);
    if i == 0 {
        return path[0];
    }
    if i > last {
        return path[last];
    }
    let span = times[i] - times[i - 1];
    let share = if span > 0.0 { (t - times[i - 1]) / span } else { 1.0 };
    path[i - 1] + (path[i] - path[i - 1]) * share
}
