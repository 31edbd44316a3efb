//! One part in a rapier world, pulled by a compliant hand along a recorded path.

use rapier3d::prelude::{
    ColliderBuilder, GenericJointBuilder, JointAxesMask, JointAxis, PhysicsWorld, Pose as RapierPose, RigidBodyBuilder,
    RigidBodyHandle, Vector as RapierVector,
};
use serde::{Deserialize, Serialize};

use crate::articulation::{Articulation, JointKind};
use crate::config;
use crate::error::{Error, Result};
use crate::math::{Point, Vector};
use crate::twin::{OrientedBox, Part};

/// Where the hand wants the grip to be.
#[derive(Debug, Clone, PartialEq)]
pub struct Drive {
    /// Seconds, not decreasing, from 0.
    pub times_secs: Vec<f64>,
    /// World positions.
    pub path: Vec<Point>,
    /// The grip on the part when closed, world.
    pub grip: Point,
}

/// What surrounds the part.
#[derive(Debug, Clone, Copy)]
pub struct Surroundings<'a> {
    /// Boxes fixed in the world, world frame.
    pub obstacles: &'a [OrientedBox],
    /// Against gravity, unit.
    pub up: &'a Vector,
    /// Density of the part's boxes, kg/m^3.
    pub density: f64,
}

/// What the simulation showed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Replay {
    /// Root mean square distance between hand and handle, metres.
    pub rms_m: f64,
    /// Largest distance between hand and handle, metres.
    pub max_m: f64,
    /// Largest force of the hand, newton.
    pub peak_force_n: f64,
    /// Opening at the start, rad or m.
    pub start: f64,
    /// Least and largest opening reached.
    pub reached: [f64; 2],
    /// Opening left after the hand brought the part back along its path, relative to the start.
    pub return_error: f64,
    /// Time, opening, hand force, distance between hand and handle: about thirty a second.
    pub trace: Vec<[f64; 4]>,
}

/// Converts to the simulation's single precision, relative to `origin`: rooms may lie far from the world's origin.
fn local(p: &Point, origin: &Point) -> RapierVector {
    (p - origin).cast::<f32>().into()
}

fn collider(shape: &OrientedBox, origin: &Point, density: f32) -> ColliderBuilder {
    let pose = crate::math::Pose::from_parts((shape.center - origin).into(), shape.orientation()).cast::<f32>();
    let half = shape.half.cast::<f32>();
    // Boards and fronts of furniture slide on each other more than they stick.
    ColliderBuilder::cuboid(half.x, half.y, half.z).position(RapierPose::from(pose)).density(density).friction(0.2)
}

/// Pulls `part` along `drive` and back under `joint` (which may be a rival of the part's own) with the limits 0..`upper`.
///
/// # Errors
/// Where the simulation gives no finite state.
pub fn simulate(
    part: &Part,
    joint: &Articulation,
    upper: f64,
    around: Surroundings,
    drive: &Drive,
    config: &config::Validation,
) -> Result<Replay> {
    let (Some(&first), Some(&end)) = (drive.path.first(), drive.times_secs.last()) else {
        return Err(Error::Simulation(format!("{}: an empty path", part.id)));
    };
    let Surroundings { obstacles, up, density } = around;
    // A person opens a part within seconds; ten minutes are another unit.
    const MAX_SECS: f64 = 600.0;
    if !(0.0..=MAX_SECS).contains(&end) {
        return Err(Error::Simulation(format!(
            "{}: the recorded hand takes {end:.3e} s; time stamps must be seconds and must not go back",
            part.id
        )));
    }
    let origin = joint.origin;
    let dt = config.step_secs;
    let mut world = PhysicsWorld::new();
    world.gravity = (up * -9.81).cast::<f32>().into();
    world.integration_parameters.dt = dt as f32;
    let base = world.insert_body(RigidBodyBuilder::fixed());
    // A body of their own: the joint switches contacts off between the two bodies that it connects.
    let fixed = world.insert_body(RigidBodyBuilder::fixed());
    for shape in obstacles {
        world.insert_collider(collider(shape, &origin, 0.0), Some(fixed));
    }
    let body = world.insert_body(RigidBodyBuilder::dynamic().can_sleep(false));
    for solid in &part.solids {
        world.insert_collider(collider(&solid.shape, &origin, density as f32), Some(body));
    }
    let axis: RapierVector = joint.axis.cast::<f32>().into();
    let (locked, free) = match joint.kind {
        JointKind::Revolute => (JointAxesMask::LOCKED_REVOLUTE_AXES, JointAxis::AngX),
        JointKind::Prismatic => (JointAxesMask::LOCKED_PRISMATIC_AXES, JointAxis::LinX),
    };
    let data = GenericJointBuilder::new(locked)
        .local_axis1(axis)
        .local_axis2(axis)
        .limits(free, [0.0, upper as f32])
        .contacts_enabled(false)
        .build();
    let handle = world
        .insert_multibody_joint(base, body, data)
        .ok_or_else(|| Error::Simulation(format!("{}: rapier refused the joint", part.id)))?;
    let start = joint.opening_at(&drive.grip, &first).clamp(0.0, upper);
    if let Some((multibody, _)) = world.multibody_joints.get_mut(handle) {
        // The first pass learns that the root is fixed, which leaves the joint's single degree of freedom.
        multibody.forward_kinematics(&world.bodies, true);
        if multibody.damping().len() != 1 {
            return Err(Error::Simulation(format!("{}: {} degrees of freedom", part.id, multibody.damping().len())));
        }
        // rapier damps angular joints by 0.1 unless told otherwise.
        multibody.damping_mut().fill(part.joint.damping as f32);
        multibody.frictions_mut().fill(part.joint.friction as f32);
        multibody.apply_displacements(&[start as f32]);
        multibody.forward_kinematics(&world.bodies, false);
        multibody.update_rigid_bodies(&mut world.bodies, true);
    }

    let mass: f64 = part.solids.iter().map(|s| s.shape.volume() * density).sum();
    // Critical damping of the hand on the mass it moves.
    let hand_damping = 2.0 * (config.hand_stiffness_n_per_m * mass.max(0.1)).sqrt();
    let grip_local = Point::from(drive.grip - origin);
    let grip_now = |world: &PhysicsWorld, body: RigidBodyHandle| -> (Point, Vector) {
        let b = &world.bodies[body];
        let pose: nalgebra::Isometry3<f32> = (*b.position()).into();
        let p = origin + (pose.cast::<f64>() * grip_local).coords;
        let v: nalgebra::Vector3<f32> = b.velocity_at_point(local(&p, &origin)).into();
        (p, v.cast::<f64>())
    };
    // There and back; in between the hand rests where it let go.
    const REST_SECS: f64 = 0.25;
    let target = |t: f64| -> Point {
        let t = if t <= end { t } else { (2.0 * end + REST_SECS - t).clamp(0.0, end) };
        at(&drive.times_secs, &drive.path, t)
    };
    let steps = (((2.0 * end + 2.0 * REST_SECS) / dt).ceil() as usize).max(1);
    let forward = ((end / dt).ceil() as usize).max(1);
    let (mut sum, mut max_m, mut peak) = (0.0, 0.0f64, 0.0f64);
    let mut reached = [start, start];
    let mut trace = Vec::new();
    let every = ((1.0 / 30.0 / dt).round() as usize).max(1);
    let mut opening = start;
    for step in 0..steps {
        let t = step as f64 * dt;
        let wanted = target(t);
        let wanted_velocity = (target(t + dt) - wanted) / dt;
        let (p, v) = grip_now(&world, body);
        let mut force = (wanted - p) * config.hand_stiffness_n_per_m + (wanted_velocity - v) * hand_damping;
        let strength = force.norm();
        if !strength.is_finite() {
            return Err(Error::Simulation(format!("{}: the state is not finite after {t:.2} s", part.id)));
        }
        if strength > config.hand_force_max_n {
            force *= config.hand_force_max_n / strength;
        }
        if let Some(b) = world.bodies.get_mut(body) {
            b.reset_forces(false);
            b.reset_torques(false);
            b.add_force_at_point(force.cast::<f32>().into(), local(&p, &origin), true);
        }
        world.step();
        let (p, _) = grip_now(&world, body);
        let angle = joint.opening_at(&drive.grip, &p);
        // Continuous past half a turn.
        opening = if joint.kind == JointKind::Revolute {
            angle - ((angle - opening) / std::f64::consts::TAU).round() * std::f64::consts::TAU
        } else {
            angle
        };
        if step < forward {
            let error = (target(t + dt) - p).norm();
            sum += error * error;
            max_m = max_m.max(error);
            peak = peak.max(force.norm());
            reached = [reached[0].min(opening), reached[1].max(opening)];
            if step % every == 0 {
                trace.push([t, opening, force.norm(), error]);
            }
        }
    }
    if !world.quarantine().is_empty() {
        return Err(Error::Simulation(format!("{}: rapier put the part in quarantine", part.id)));
    }
    Ok(Replay {
        rms_m: (sum / forward as f64).sqrt(),
        max_m,
        peak_force_n: peak,
        start,
        reached,
        return_error: opening - start,
        trace,
    })
}

/// Position on a path at time `t`, linear between samples.
fn at(times: &[f64], path: &[Point], t: f64) -> Point {
    let i = times.partition_point(|&x| x <= t);
    if i == 0 {
        return path[0];
    }
    if i >= path.len() {
        return path[path.len() - 1];
    }
    let span = times[i] - times[i - 1];
    let share = if span > 0.0 { (t - times[i - 1]) / span } else { 1.0 };
    path[i - 1] + (path[i] - path[i - 1]) * share
}
