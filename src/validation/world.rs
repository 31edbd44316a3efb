//! The rapier world of one moving part: its joint, what stands around it, what it touches. Single precision, relative to the
//! joint's origin: rooms may lie far from the world's.

use std::collections::{BTreeMap, BTreeSet};

use parry3d::query;
use parry3d::shape::Cuboid;
use rapier3d::prelude::{
    ActiveHooks, ColliderBuilder, ColliderHandle, GenericJointBuilder, Group, InteractionGroups, InteractionTestMode,
    JointAxesMask, JointAxis, PairFilterContext, PhysicsHooks, PhysicsWorld, Pose as RapierPose, RigidBodyBuilder,
    RigidBodyHandle, SolverFlags, Vector as RapierVector,
};
use serde::{Deserialize, Serialize};

use crate::articulation::{Articulation, JointKind};
use crate::config;
use crate::error::{Error, Result};
use crate::fitting::overlap;
use crate::math::{Point, Pose, Vector};
use crate::twin::{ContactRules, GRAVITY, OrientedBox, Part, Solid, Twin};

/// What surrounds a part, world frame, everything closed.
#[derive(Debug, Clone)]
pub struct Surroundings<'a> {
    /// What stays where it is.
    pub fixed: Vec<&'a Solid>,
    /// Parts on joints of their own that contact and gravity may move.
    pub movable: Vec<&'a Part>,
    /// Against gravity, unit.
    pub up: &'a Vector,
    /// Density of all parts, kg/m^3.
    pub density: f64,
    /// Which of all solids touch at all; `None` where all do.
    pub rules: Option<&'a ContactRules>,
}

/// Solids of two bodies that touched.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Contact {
    /// The solid of the moving part.
    pub solid: String,
    /// What it touched.
    pub with: String,
    /// Deepest that the one was inside the other, metres.
    pub depth_m: f64,
    /// How long they pressed on each other, seconds.
    pub secs: f64,
    /// Force between them over time, N s.
    pub impulse_n_s: f64,
}

/// Geometry: solids nearer than this when closed touch there, metres: models from elsewhere set fronts right onto their carcass.
const TOUCH_M: f64 = 1e-3;
/// Numerics: shared space that simulators' soft contacts forgive, metres: no obstacle. The moving part is this much smaller all around.
const FORGIVEN_M: f64 = 1e-4;

impl<'a> Surroundings<'a> {
    /// Nothing but gravity.
    #[must_use]
    pub fn none(up: &'a Vector, density: f64) -> Self {
        Self { fixed: Vec::new(), movable: Vec::new(), up, density, rules: None }
    }

    /// What the part of `twin.furniture[moving]` can meet on its way. What is out of its reach changes nothing.
    #[must_use]
    pub fn of(twin: &'a Twin, moving: usize, up: &'a Vector) -> Self {
        let mut around = Self::none(up, twin.density_kg_per_m3);
        let Some(own) = twin.furniture.get(moving).map(|f| &f.part) else { return around };
        let reach = Reach::of(own, own);
        for (i, furniture) in twin.furniture.iter().enumerate() {
            around.fixed.extend(furniture.carcass.iter().filter(|s| reach.meets(&s.shape)));
            let part = &furniture.part;
            if i == moving {
                continue;
            }
            let touched = part.solids.iter().any(|s| reach.meets(&s.shape));
            if touched
                || ((!part.joint.balanced && part.opens_by_itself(up, twin.density_kg_per_m3))
                    && reach.overlaps(&Reach::of(part, own)))
            {
                around.movable.push(part);
            }
        }
        around.fixed.extend(twin.room.iter().filter(|s| reach.meets(&s.shape)));
        around
    }
}

/// Bounds of all that a part passes on its way, along the axes of a part's front.
struct Reach {
    rotation: nalgebra::Matrix3<f64>,
    origin: Point,
    low: Vector,
    high: Vector,
}

impl Reach {
    /// Of `part`, along the axes of `frame`.
    fn of(part: &Part, frame: &Part) -> Self {
        /// Geometry: between two of the steps a hinge of a metre and half a turn passes a centimetre beyond both.
        const STEPS: u32 = 12;
        /// Geometry: that centimetre.
        const MARGIN_M: f64 = 0.01;
        let mut reach = Self {
            rotation: frame.bounds.rotation,
            origin: frame.joint.articulation.origin,
            low: Vector::repeat(f64::INFINITY),
            high: Vector::repeat(f64::NEG_INFINITY),
        };
        let corners: Vec<Point> = part.solids.iter().flat_map(|s| s.shape.corners()).collect();
        for step in 0..=STEPS {
            let motion = part.joint.articulation.motion(part.joint.upper * f64::from(step) / f64::from(STEPS));
            for corner in &corners {
                let local = reach.local(&(motion * corner));
                reach.low = reach.low.inf(&local);
                reach.high = reach.high.sup(&local);
            }
        }
        reach.low.add_scalar_mut(-MARGIN_M);
        reach.high.add_scalar_mut(MARGIN_M);
        reach
    }

    fn local(&self, p: &Point) -> Vector {
        self.rotation.transpose() * (p - self.origin)
    }

    fn meets(&self, shape: &OrientedBox) -> bool {
        let corners = shape.corners().map(|p| self.local(&p));
        (0..3).all(|k| {
            let (low, high) = corners
                .iter()
                .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), c| (low.min(c[k]), high.max(c[k])));
            low <= self.high[k] && high >= self.low[k]
        })
    }

    /// Both along the same axes.
    fn overlaps(&self, other: &Self) -> bool {
        (0..3).all(|k| self.low[k] <= other.high[k] && self.high[k] >= other.low[k])
    }
}

/// Pairs of colliders between which there are no contacts: (number of the moving solid, number of the other).
struct Apart(BTreeSet<(u128, u128)>);

impl PhysicsHooks for Apart {
    fn filter_contact_pair(&self, context: &PairFilterContext) -> Option<SolverFlags> {
        let number = |h: ColliderHandle| context.colliders.get(h).map_or(u128::MAX, |c| c.user_data);
        let (a, b) = (number(context.collider1), number(context.collider2));
        if self.0.contains(&(a.min(b), a.max(b))) { None } else { Some(SolverFlags::COMPUTE_RIGID_IMPULSES) }
    }
}

/// A running simulation. Colliders are numbered, the moving part's first.
pub(super) struct World<'a> {
    /// Opening at the start, rad or m.
    pub(super) start: f64,
    physics: PhysicsWorld,
    body: RigidBodyHandle,
    origin: Point,
    solids: Vec<&'a Solid>,
    apart: Apart,
    /// Those of them that share space or touch when closed.
    overlaps: Vec<(u128, u128)>,
    /// Depth (m), time (s) and impulse (N s) of each pair that touched.
    touched: BTreeMap<(u128, u128), [f64; 3]>,
    dt: f64,
}

fn local(p: &Point, origin: &Point) -> RapierVector {
    (p - origin).cast::<f32>().into()
}

fn local_pose(shape: &OrientedBox, origin: &Point) -> RapierPose {
    RapierPose::from(Pose::from_parts((shape.center - origin).into(), shape.orientation()).cast::<f32>())
}

impl<'a> World<'a> {
    /// A part on `joint` (which may be a rival of its own) with the limits 0..`upper`, opened by `start`, at rest. Where it
    /// would stand inside something there, it is opened as far as it can be instead. `held` is the inertia that the hand
    /// adds to the joint, kg m^2 or kg.
    pub(super) fn new(
        part: &'a Part,
        joint: &Articulation,
        upper: f64,
        start: f64,
        held: f64,
        around: &Surroundings<'a>,
        config: &config::Validation,
    ) -> Result<Self> {
        let (origin, dt) = (joint.origin, config.step_secs);
        let mut physics = PhysicsWorld::new();
        physics.gravity = (around.up * -GRAVITY).cast::<f32>().into();
        physics.integration_parameters.dt = dt as f32;

        let mut solids: Vec<&'a Solid> = Vec::new();
        let mut add = |more: &[&'a Solid], moves: bool, density: f64| -> Vec<ColliderBuilder> {
            let first = solids.len();
            solids.extend_from_slice(more);
            let build = |(s, number): (&&Solid, usize)| {
                collider(s, number, moves, density, &origin).friction(config.board_friction as f32)
            };
            more.iter().zip(first..).map(build).collect()
        };
        let own: Vec<&'a Solid> = part.solids.iter().collect();
        let own = add(&own, true, around.density);
        let fixed = add(&around.fixed, false, 0.0);
        let mut neighbours = Vec::new();
        for neighbour in &around.movable {
            let theirs: Vec<&'a Solid> = neighbour.solids.iter().collect();
            neighbours.push((*neighbour, add(&theirs, false, around.density)));
        }

        let mut overlaps = touching(&solids, part.solids.len(), &origin);
        let mut apart = Apart(overlaps.iter().copied().collect());
        if let Some(rules) = around.rules {
            let off = ruled_apart(&solids, part.solids.len(), rules);
            overlaps.retain(|pair| !off.contains(pair));
            apart.0.extend(off);
        }
        let start = free_start(&solids, part.solids.len(), joint, start, &apart);
        let body = hang(&mut physics, part, joint, upper, start, held, &origin, own)?;
        let room = physics.insert_body(RigidBodyBuilder::fixed());
        for collider in fixed {
            physics.insert_collider(collider, Some(room));
        }
        for (neighbour, colliders) in neighbours {
            let joint = &neighbour.joint;
            hang(&mut physics, neighbour, &joint.articulation, joint.upper, 0.0, 0.0, &origin, colliders)?;
        }
        Ok(Self { start, physics, body, origin, solids, apart, overlaps, touched: BTreeMap::new(), dt })
    }

    /// The part's motion from closed about the joint's origin: how far that point of the part has gone, and the rotation.
    pub(super) fn moved(&self) -> (Vector, nalgebra::UnitQuaternion<f64>) {
        let pose: nalgebra::Isometry3<f32> = (*self.physics.bodies[self.body].position()).into();
        let pose = pose.cast::<f64>();
        (pose.translation.vector, pose.rotation)
    }

    /// Where a point of the closed part is now, and its velocity.
    pub(super) fn point(&self, closed: &Point) -> (Point, Vector) {
        let (shift, turn) = self.moved();
        let p = self.origin + shift + turn * (closed - self.origin);
        let body = &self.physics.bodies[self.body];
        let v: nalgebra::Vector3<f32> = body.velocity_at_point(local(&p, &self.origin)).into();
        (p, v.cast::<f64>())
    }

    /// Energy of the moving part's motion, J.
    pub(super) fn kinetic_energy(&self) -> f64 {
        f64::from(self.physics.bodies[self.body].kinetic_energy())
    }

    /// One step with a force of the hand at a point.
    pub(super) fn step(&mut self, at: &Point, force: &Vector) {
        if let Some(body) = self.physics.bodies.get_mut(self.body) {
            // Forces and torques stay until they are reset, each by its own call.
            body.reset_forces(false);
            body.reset_torques(false);
            body.add_force_at_point(force.cast::<f32>().into(), local(at, &self.origin), true);
        }
        self.physics.step_with_events(&self.apart, &());
        let Self { physics, touched, dt, .. } = self;
        for pair in physics.narrow_phase.contact_pairs().filter(|p| p.has_any_active_contact()) {
            let depth = pair.find_deepest_contact().map_or(0.0, |(_, c)| f64::from(-c.dist));
            let impulse = f64::from(pair.total_impulse_magnitude());
            if depth <= 0.0 && impulse <= 0.0 {
                continue;
            }
            let number = |h: ColliderHandle| physics.colliders.get(h).map_or(u128::MAX, |c| c.user_data);
            let (a, b) = (number(pair.collider1), number(pair.collider2));
            let entry = touched.entry((a.min(b), a.max(b))).or_insert([0.0; 3]);
            entry[0] = entry[0].max(depth);
            entry[1] += if impulse > 0.0 { *dt } else { 0.0 };
            entry[2] += impulse;
        }
    }

    /// What the part touched so far, the strongest contact first.
    pub(super) fn contacts(&self) -> Vec<Contact> {
        let mut all: Vec<Contact> = self
            .touched
            .iter()
            .map(|((a, b), [depth_m, secs, impulse_n_s])| Contact {
                solid: self.name(*a),
                with: self.name(*b),
                depth_m: *depth_m,
                secs: *secs,
                impulse_n_s: *impulse_n_s,
            })
            .collect();
        all.sort_by(|a, b| b.impulse_n_s.total_cmp(&a.impulse_n_s));
        all
    }

    /// Solids that share space or touch when closed, between which there are no contacts: (of the part, the other).
    pub(super) fn closed_overlaps(&self) -> Vec<[String; 2]> {
        self.overlaps.iter().map(|(a, b)| [self.name(*a), self.name(*b)]).collect()
    }

    /// Whether rapier took a body out because its state was not finite.
    pub(super) fn broke(&self) -> bool {
        !self.physics.quarantine().is_empty()
    }

    fn name(&self, number: u128) -> String {
        usize::try_from(number).ok().and_then(|i| self.solids.get(i)).map_or_else(String::new, |s| s.name.clone())
    }
}

/// A solid's collider with its number. Only the moving part meets anything: what stands around it stands apart.
fn collider(solid: &Solid, number: usize, moves: bool, density: f64, origin: &Point) -> ColliderBuilder {
    let (own, others) = if moves { (Group::GROUP_1, Group::GROUP_2) } else { (Group::GROUP_2, Group::GROUP_1) };
    // Of a sheet a tenth at the most is given away, and its weight stays what it is.
    let shrunk = if moves { solid.shape.half.map(|h| (h - FORGIVEN_M).max(0.9 * h)) } else { solid.shape.half };
    let volume = shrunk.product();
    let density = if volume > 0.0 { density * solid.shape.half.product() / volume } else { density };
    let half = shrunk.cast::<f32>();
    ColliderBuilder::cuboid(half.x, half.y, half.z)
        .position(local_pose(&solid.shape, origin))
        .density(density as f32)
        .user_data(number as u128)
        .collision_groups(InteractionGroups::new(own, others, InteractionTestMode::And))
        .active_hooks(if moves { ActiveHooks::FILTER_CONTACT_PAIRS } else { ActiveHooks::empty() })
}

/// Puts a part on a joint of one degree of freedom to the world; `held` is the inertia that a hand adds to the joint.
#[allow(clippy::too_many_arguments, reason = "a part, its joint and where it hangs")]
fn hang(
    physics: &mut PhysicsWorld,
    part: &Part,
    joint: &Articulation,
    upper: f64,
    start: f64,
    held: f64,
    origin: &Point,
    colliders: Vec<ColliderBuilder>,
) -> Result<RigidBodyHandle> {
    let base = physics.insert_body(RigidBodyBuilder::fixed());
    let weight = if part.joint.balanced { 0.0 } else { 1.0 };
    let body = physics.insert_body(RigidBodyBuilder::dynamic().can_sleep(false).gravity_scale(weight));
    for collider in colliders {
        physics.insert_collider(collider, Some(body));
    }
    let axis: RapierVector = joint.axis.cast::<f32>().into();
    let anchor = local(&joint.origin, origin);
    let (locked, free) = match joint.kind {
        JointKind::Revolute => (JointAxesMask::LOCKED_REVOLUTE_AXES, JointAxis::AngX),
        JointKind::Prismatic => (JointAxesMask::LOCKED_PRISMATIC_AXES, JointAxis::LinX),
    };
    let data = GenericJointBuilder::new(locked)
        .local_axis1(axis)
        .local_axis2(axis)
        .local_anchor1(anchor)
        .local_anchor2(anchor)
        .limits(free, [0.0, upper as f32])
        .contacts_enabled(false)
        .build();
    let handle = physics
        .insert_multibody_joint(base, body, data)
        .ok_or_else(|| Error::Simulation(format!("{}: rapier refused the joint", part.id)))?;
    if let Some((multibody, _)) = physics.multibody_joints.get_mut(handle) {
        // The first pass learns that the root is fixed, which leaves the joint's single degree of freedom.
        multibody.forward_kinematics(&physics.bodies, true);
        if multibody.damping().len() != 1 {
            return Err(Error::Simulation(format!("{}: {} degrees of freedom", part.id, multibody.damping().len())));
        }
        // rapier damps angular joints by 0.1 unless told otherwise.
        multibody.damping_mut().fill(part.joint.damping as f32);
        multibody.frictions_mut().fill(part.joint.friction as f32);
        multibody.armature_mut().fill(held as f32);
        multibody.apply_displacements(&[start as f32]);
        multibody.forward_kinematics(&physics.bodies, false);
        multibody.update_rigid_bodies(&mut physics.bodies, true);
    }
    Ok(body)
}

/// The largest opening up to `start` at which the moving solids (the first `moving`) share space with nothing but what they
/// touch when closed: a simulation that begins inside something flies apart.
fn free_start(solids: &[&Solid], moving: usize, joint: &Articulation, start: f64, apart: &Apart) -> f64 {
    /// Numerics: openings that are tried.
    const STEPS: u32 = 60;
    let free = |opening: f64| {
        let motion = joint.motion(opening);
        solids.iter().take(moving).enumerate().all(|(i, own)| {
            let moved = own.shape.moved(&motion);
            let mut others = solids.iter().enumerate().skip(moving);
            others.all(|(j, other)| apart.0.contains(&(i as u128, j as u128)) || !overlap::boxes(&moved, &other.shape))
        })
    };
    (0..STEPS).map(|k| start * f64::from(STEPS - k) / f64::from(STEPS)).find(|&q| free(q)).unwrap_or(0.0)
}

/// Numbers of the pairs of a moving solid (the first `moving`) and another that touch when closed.
fn touching(solids: &[&Solid], moving: usize, origin: &Point) -> Vec<(u128, u128)> {
    let shapes: Vec<(RapierPose, Cuboid)> = solids
        .iter()
        .map(|s| {
            let half = s.shape.half.map(|h| h + 0.5 * TOUCH_M).cast::<f32>();
            (local_pose(&s.shape, origin), Cuboid::new(half.into()))
        })
        .collect();
    let mut pairs = Vec::new();
    for (i, (pose, shape)) in shapes.iter().enumerate().take(moving) {
        for (j, (other_pose, other)) in shapes.iter().enumerate().skip(moving) {
            if query::intersection_test(pose, shape, other_pose, other).is_ok_and(|hit| hit.intersecting) {
                pairs.push((i as u128, j as u128));
            }
        }
    }
    pairs
}

/// Numbers of the pairs of a moving solid (the first `moving`) and another between which the model has no contacts.
fn ruled_apart(solids: &[&Solid], moving: usize, rules: &ContactRules) -> BTreeSet<(u128, u128)> {
    let mut pairs = BTreeSet::new();
    for (i, own) in solids.iter().enumerate().take(moving) {
        for (j, other) in solids.iter().enumerate().skip(moving) {
            if !rules.meet(&own.name, &other.name) {
                pairs.insert((i as u128, j as u128));
            }
        }
    }
    pairs
}
