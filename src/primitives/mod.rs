//! What a robot needs to open and close each joint of a twin: where to take hold, the way of the gripper, and a Dynamic
//! Movement Primitive of joint and gripper (the paper's section on manipulation). `docs/primitives.md` has every key.

mod clear;
pub mod dmp;
pub mod grasp;
pub mod timing;

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::articulation::{Action, Articulation, JointKind};
use crate::config;
use crate::hands::Trajectory;
use crate::inference::Uncertainty;
use crate::math::{Point, Pose, Vector, unit};
use crate::twin::{LeftOut, Part, Twin};

pub use dmp::{Dmp, Forcing, System};
pub use grasp::{Contact, GripperPose, Hold};
pub use timing::{Timing, TimingSource};

/// What the file calls its own format.
pub const SCHEMA: &str = "paws-primitives/1";
/// Format: samples of a path in the file: a full turn of a door's handle is then known to a millimetre between them.
const PATH: usize = 61;
/// Numerics: samples that a primitive is fitted to.
const FITTED: usize = 201;

/// What a recording says about one joint.
#[derive(Debug, Clone, Default)]
pub struct Seen<'a> {
    /// Clip names and hands.
    pub hands: Vec<(String, &'a Trajectory)>,
    /// How sure axis and hinge are.
    pub uncertainty: Option<&'a Uncertainty>,
    /// What the replay says: pass, fail, undetermined.
    pub verdict: Option<&'a str>,
}

/// `primitives.json`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Primitives {
    /// [`SCHEMA`].
    pub schema: String,
    /// The twin's name.
    pub scene: String,
    /// Frames and units in words.
    pub frame: String,
    /// How far before a grasp a gripper waits, and how far it goes back after it let go, metres.
    pub standoff_m: f64,
    /// What all primitives share.
    pub dmp: System,
    /// One entry a joint, in the twin's order.
    pub joints: Vec<JointPrimitives>,
    /// Joints of the twin that have no primitive, with the reason.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub left_out: Vec<LeftOut>,
}

/// All of one joint.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct JointPrimitives {
    /// The joint's id, as in all other files.
    pub joint: String,
    /// Words for people.
    pub label: String,
    /// Type of motion.
    #[serde(rename = "type")]
    pub kind: JointKind,
    /// Unit, world; positive motion opens.
    pub axis: Vector,
    /// A point on the hinge; of a slide, any point. World, metres.
    pub origin: Point,
    /// Unit: where the contact goes first when the part opens.
    pub opening_direction: Vector,
    /// How far the part goes.
    pub limits: Limits,
    /// How sure all of this is.
    pub uncertainty: Sureness,
    /// Where to take hold of the closed part.
    pub contact: Contact,
    /// Before the grasp.
    pub pregrasp: GripperPose,
    /// Fingers around the handle of the closed part.
    pub grasp: GripperPose,
    /// From closed to open.
    pub opening: Motion,
    /// From open to closed.
    pub closing: Motion,
}

/// Openings, rad or m.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Limits {
    /// Closed.
    pub lower: f64,
    /// As far as the twin's part goes.
    pub upper: f64,
    /// Largest opening that was observed.
    pub observed: f64,
    /// What a person would expect of such furniture.
    pub expected: f64,
}

/// How sure a joint and its contact are. What nobody computed is `None`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Sureness {
    /// Probability of just this joint (8 degrees, 8 cm).
    pub probability: Option<f64>,
    /// What the replay in simulation says: pass, fail, undetermined.
    pub verdict: Option<String>,
    /// The two directions that the next two are about and along: world, unit, square to the axis.
    pub across: Option<[Vector; 2]>,
    /// Standard deviations of the axis' turns about them, rad.
    pub axis_std_rad: Option<[f64; 2]>,
    /// Standard deviations of the hinge along them, metres; none for slides.
    pub origin_std_m: Option<[f64; 2]>,
    /// Standard deviation of the largest observed opening, rad or m.
    pub observed_std: Option<f64>,
    /// Standard deviation of the contact along the motion, metres.
    pub contact_std_m: Option<f64>,
}

/// One way through the range.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Motion {
    /// Opening at its begin, rad or m.
    pub from: f64,
    /// Opening at its end.
    pub to: f64,
    /// Whose timing it has.
    pub timing: Timing,
    /// The gripper's way while it holds the part.
    pub path: Path,
    /// Primitive of the opening.
    pub dmp_joint: Dmp,
    /// Primitive of the gripper: three coordinates of its position (world, metres), then its rotation since the begin as a
    /// vector (world axes, rad): `R(t) = exp(r(t)) R(0)`.
    pub dmp_pose: Dmp,
}

/// A path, sampled at equal steps of time.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Path {
    /// Seconds from the begin.
    pub times_secs: Vec<f64>,
    /// Opening of the joint, rad or m.
    pub openings: Vec<f64>,
    /// Of the gripper, world, metres.
    pub positions: Vec<Point>,
    /// `world_from_gripper`, w first, without jumps of sign.
    pub rotations_wxyz: Vec<[f64; 4]>,
}

/// The primitives of a twin. `seen` is by the joint's id; a joint that is not in it has neither hands nor verdict. `grips` tells how
/// well hands tell where they hold a part.
#[must_use]
pub fn of(twin: &Twin, seen: &BTreeMap<&str, Seen>, grips: &config::Grips, config: &config::Primitives) -> Primitives {
    let system = System::default();
    let nothing = Seen::default();
    let (mut joints, mut left_out) = (Vec::new(), Vec::new());
    for (index, part) in twin.furniture.iter().map(|f| &f.part).enumerate() {
        let straight = grasp::contact(part, config);
        let contact = grasp::tilted(&straight, clear::tilt(twin, index, &straight, config));
        let seen = seen.get(part.id.as_str()).unwrap_or(&nothing);
        match of_joint(part, contact, seen, &system, grips, config) {
            Some(joint) => joints.push(joint),
            None => left_out.push(LeftOut {
                id: part.id.clone(),
                reason: "no primitive can be fitted: its range or its place is not finite, or the range is 0"
                    .to_owned(),
            }),
        }
    }
    Primitives {
        schema: SCHEMA.to_owned(),
        scene: twin.name.clone(),
        frame: "world of the twin, +Z up; metres, radians, seconds; positive motion opens; poses are world_from_gripper: z \
                approaches, x is the way that fingers close, the origin is between the fingertips"
            .to_owned(),
        standoff_m: config.standoff_m,
        dmp: system,
        joints,
        left_out,
    }
}

fn of_joint(
    part: &Part,
    contact: Contact,
    seen: &Seen,
    system: &System,
    grips: &config::Grips,
    config: &config::Primitives,
) -> Option<JointPrimitives> {
    let (joint, phi) = (&part.joint, part.joint.articulation);
    let grasp = grasp::pose(&contact);
    let held = Held { phi, grasp, turn: contact.tilt_rad[1] - contact.tilt_rad[0], upper: joint.upper };
    let back = Pose::from_parts((contact.approach * -config.standoff_m).into(), nalgebra::UnitQuaternion::identity());
    let [opening, closing] =
        [(Action::Open, 0.0, joint.upper), (Action::Close, joint.upper, 0.0)].map(|(action, from, to)| {
            let timing = timing::timing(part, &seen.hands, action, config);
            motion(&held, [from, to], timing, system)
        });
    Some(JointPrimitives {
        joint: part.id.clone(),
        label: part.label.clone(),
        kind: phi.kind,
        axis: phi.axis,
        origin: phi.origin,
        opening_direction: opening_direction(&phi, &contact.point),
        limits: Limits { lower: 0.0, upper: joint.upper, observed: joint.observed, expected: joint.expected },
        uncertainty: sureness(part, seen, grips),
        contact,
        pregrasp: (back * grasp).into(),
        grasp: grasp.into(),
        opening: opening?,
        closing: closing?,
    })
}

/// Where a point of the closed part goes first; a point on the hinge goes nowhere, its direction is then the axis.
fn opening_direction(phi: &Articulation, point: &Point) -> Vector {
    match phi.kind {
        JointKind::Prismatic => phi.axis,
        JointKind::Revolute => unit(&phi.axis.cross(&(point - phi.origin))).unwrap_or(phi.axis),
    }
}

fn sureness(part: &Part, seen: &Seen, grips: &config::Grips) -> Sureness {
    let said = seen.uncertainty;
    let stds = |c: &[[f64; 2]; 2]| [0, 1].map(|i| c[i][i].max(0.0).sqrt());
    Sureness {
        probability: part.joint.probability,
        verdict: seen.verdict.map(str::to_owned),
        across: said.map(|u| u.across),
        axis_std_rad: said.map(|u| stds(&u.axis_cov_rad2)),
        origin_std_m: said.and_then(|u| u.origin_cov_m2.as_ref().map(stds)),
        observed_std: said.map(|u| u.observed_range_std),
        contact_std_m: grasp::point_std_m(&seen.hands, grips),
    }
}

/// A gripper at a part.
struct Held {
    /// The part's joint.
    phi: Articulation,
    /// The gripper at the closed part.
    grasp: Pose,
    /// How far it turns about the bar while the part opens, rad.
    turn: f64,
    /// The opening at which it has.
    upper: f64,
}

impl Held {
    fn turned(&self, opening: f64) -> f64 {
        self.turn * opening / self.upper
    }

    /// Where the gripper is at an opening.
    fn at(&self, opening: f64) -> Pose {
        self.phi.motion(opening) * self.grasp * clear::turn(self.turned(opening))
    }

    /// Its rotation since another opening as a vector in world axes, beyond half a turn too: that of the hinge and that about
    /// the bar add up where they are parallel. Elsewhere the logarithm is taken, which is short of half a turn.
    fn since(&self, from: f64, opening: f64) -> Vector {
        let hinge = match self.phi.kind {
            JointKind::Revolute => self.phi.axis * (opening - from),
            JointKind::Prismatic => Vector::zeros(),
        };
        let bar = self.at(from).rotation * Vector::y();
        let about = bar * (self.turned(opening) - self.turned(from));
        if hinge.cross(&about).norm() < 1e-9 {
            return hinge + about;
        }
        (self.at(opening).rotation * self.at(from).rotation.inverse()).scaled_axis()
    }
}

/// The way from one opening to another of a gripper that holds a part.
fn motion(held: &Held, [from, to]: [f64; 2], timing: Timing, system: &System) -> Option<Motion> {
    let opening = |share: f64| from + (to - from) * timing::progress(share, timing.skew);
    let shares = |count: usize| (0..count).map(move |i| i as f64 / (count - 1) as f64);
    let fitted: Vec<f64> = shares(FITTED).map(opening).collect();
    let poses: Vec<[f64; 6]> = fitted
        .iter()
        .map(|x| {
            let (position, turn) = (held.at(*x).translation.vector, held.since(from, *x));
            [position.x, position.y, position.z, turn.x, turn.y, turn.z]
        })
        .collect();
    let joint: Vec<[f64; 1]> = fitted.iter().map(|x| [*x]).collect();
    let secs = timing.duration_secs;
    let dmp_joint = dmp::fit(&joint, secs, Forcing::Scaled, system)?;
    // Of the six coordinates most end where they began.
    let dmp_pose = dmp::fit(&poses, secs, Forcing::Unscaled, system)?;
    let openings: Vec<f64> = shares(PATH).map(opening).collect();
    let mut path = Path {
        times_secs: shares(PATH).map(|share| secs * share).collect(),
        positions: openings.iter().map(|x| Point::from(held.at(*x).translation.vector)).collect(),
        rotations_wxyz: openings.iter().map(|x| grasp::wxyz(&held.at(*x).rotation)).collect(),
        openings,
    };
    let mut before: Option<[f64; 4]> = None;
    for q in &mut path.rotations_wxyz {
        if before.is_some_and(|p| p.iter().zip(q.iter()).map(|(a, b)| a * b).sum::<f64>() < 0.0) {
            *q = q.map(|c| -c);
        }
        before = Some(*q);
    }
    Some(Motion { from, to, timing, path, dmp_joint, dmp_pose })
}

#[cfg(test)]
pub(crate) mod tests;
