//! From replays to a verdict with its reason.

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::replay::{Drive, Replay, Surroundings, simulate};
use crate::articulation::{Action, Articulation, JointKind};
use crate::config;
use crate::error::Result;
use crate::hands::Trajectory;
use crate::math::{Vector, stats};
use crate::twin::{Furniture, OrientedBox, Twin};

/// What physics says about a joint.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Verdict {
    /// The recorded motion is explained by this joint and by none of its rivals.
    Pass,
    /// The simulation refutes the joint.
    Fail,
    /// The recording cannot decide.
    Undetermined,
}

impl Verdict {
    /// The word.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Pass => "pass",
            Self::Fail => "fail",
            Self::Undetermined => "undetermined",
        }
    }
}

/// A rival's replay of the same hand.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RivalCheck {
    /// What it is: "mirrored hinge", "slide", ...
    pub name: String,
    /// Tracking error, metres.
    pub rms_m: f64,
}

/// One clip's replay.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ClipCheck {
    /// The clip.
    pub clip: String,
    /// Opening or closing.
    pub action: Action,
    /// Opening that the hand went through under this joint, rad or m.
    pub observed_range: f64,
    /// Among the furniture of the scene.
    pub replay: Replay,
    /// Tracking error without the rest of the scene: what the rivals are compared with, metres.
    pub free_rms_m: f64,
    /// The rivals on the same hand, best first.
    pub rivals: Vec<RivalCheck>,
}

/// One joint's verdict.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct JointCheck {
    /// The joint.
    pub id: String,
    /// Verdict.
    pub verdict: Verdict,
    /// Why, in words.
    pub reason: String,
    /// Median over the clips of the tracking error, metres.
    pub rms_m: f64,
    /// Largest force of the hand over the clips, newton.
    pub peak_force_n: f64,
    /// Share of the observed range that the simulated part went through, least over the clips.
    pub reached_share: f64,
    /// Least over the clips of (best rival's error / own error).
    pub margin: Option<f64>,
    /// One entry a clip.
    pub clips: Vec<ClipCheck>,
}

/// The whole validation.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Validation {
    /// Joints in the twin's order.
    pub joints: Vec<JointCheck>,
}

impl Validation {
    /// (joint, verdict in a word), as the scene's files carry them.
    #[must_use]
    pub fn words(&self) -> Vec<(String, String)> {
        self.joints.iter().map(|j| (j.id.clone(), j.verdict.word().to_owned())).collect()
    }
}

/// A clip's hand for a joint: (clip name, trajectory).
pub type Hands<'a> = Vec<(String, &'a Trajectory)>;

/// Replays every joint of the twin under the hands of its clips. `hands[i]` belongs to `twin.furniture[i]`.
///
/// # Errors
/// Where a simulation gives no finite state.
pub fn validate(twin: &Twin, hands: &[Hands], up: &Vector, config: &config::Validation) -> Result<Validation> {
    let joints = twin
        .furniture
        .par_iter()
        .enumerate()
        .map(|(i, furniture)| {
            let empty = Hands::new();
            let clips = hands.get(i).unwrap_or(&empty);
            let obstacles = obstacles(twin, i);
            let around = Surroundings { obstacles: &obstacles, up, density: twin.density_kg_per_m3 };
            let checks: Vec<ClipCheck> =
                clips.iter().map(|(name, t)| check_clip(name, t, furniture, around, config)).collect::<Result<_>>()?;
            Ok(judge(furniture, checks, config))
        })
        .collect::<Result<_>>()?;
    Ok(Validation { joints })
}

/// Everything else in the scene, closed.
fn obstacles(twin: &Twin, moving: usize) -> Vec<OrientedBox> {
    twin.furniture
        .iter()
        .enumerate()
        .filter(|(i, _)| *i != moving)
        .flat_map(|(_, f)| f.carcass.iter().chain(&f.part.solids))
        .map(|s| s.shape)
        .collect()
}

fn check_clip(
    name: &str,
    trajectory: &Trajectory,
    furniture: &Furniture,
    around: Surroundings,
    config: &config::Validation,
) -> Result<ClipCheck> {
    let path = trajectory.positions();
    let t0 = trajectory.samples.first().map_or(0.0, |s| s.time_secs);
    let times_secs: Vec<f64> = trajectory.samples.iter().map(|s| s.time_secs - t0).collect();
    let grip = trajectory.closed_grip();
    let part = &furniture.part;
    let own = part.joint.articulation;
    let drive = Drive { times_secs, path, grip };
    // Rivals get all the room they want: what is compared is how well the motion fits, not a limit.
    let ample = |j: &Articulation| if j.kind == JointKind::Revolute { std::f64::consts::PI } else { 2.0 };
    let replay = simulate(part, &own, part.joint.upper, around, &drive, config)?;
    let alone = Surroundings { obstacles: &[], ..around };
    let free = simulate(part, &own, ample(&own), alone, &drive, config)?;
    let mut rivals = Vec::new();
    for (name, rival) in rivals_of(furniture, &trajectory.closed_grip()) {
        let r = simulate(part, &rival, ample(&rival), alone, &drive, config)?;
        rivals.push(RivalCheck { name, rms_m: r.rms_m });
    }
    rivals.sort_by(|a, b| a.rms_m.total_cmp(&b.rms_m));
    Ok(ClipCheck {
        clip: name.to_owned(),
        action: trajectory.action,
        observed_range: crate::inference::observed_range(&own, &grip, &drive.path),
        replay,
        free_rms_m: free.rms_m,
        rivals,
    })
}

/// What else the part could be: hinged at each other edge of its front, or sliding straight out.
fn rivals_of(furniture: &Furniture, grip: &crate::math::Point) -> Vec<(String, Articulation)> {
    let part = &furniture.part;
    let own = part.joint.articulation;
    let bounds = &part.bounds;
    let [right, up, out] = [0, 1, 2].map(|i| bounds.rotation.column(i).into_owned());
    let mut rivals = Vec::new();
    for (axis, across, half, names) in [
        (up, right, bounds.half.x, ["left hinge", "right hinge"]),
        (right, up, bounds.half.y, ["lower hinge", "upper hinge"]),
    ] {
        for (name, sign) in names.into_iter().zip([-1.0, 1.0]) {
            let origin = bounds.center + across * (half * sign);
            let hinge = Articulation { kind: JointKind::Revolute, axis, origin };
            let opens_out = axis.cross(&(grip - origin)).dot(&out) >= 0.0;
            let hinge = if opens_out { hinge } else { hinge.reversed() };
            let near = own.kind == JointKind::Revolute
                && crate::math::unsigned_angle(&axis, &own.axis) < 0.3
                && own.line().distance(&origin) < 0.5 * half.max(0.1);
            // A hinge through the hand explains nothing and would not be built.
            if !near && hinge.line().distance(grip) > 0.05 {
                rivals.push((name.to_owned(), hinge));
            }
        }
    }
    if own.kind == JointKind::Revolute {
        rivals
            .push(("slide".to_owned(), Articulation { kind: JointKind::Prismatic, axis: out, origin: bounds.center }));
    }
    rivals
}

/// The rules, in the order in which they speak.
fn judge(furniture: &Furniture, clips: Vec<ClipCheck>, config: &config::Validation) -> JointCheck {
    let part = &furniture.part;
    let hinge = part.joint.articulation.kind == JointKind::Revolute;
    let least = if hinge { config.min_turn_deg.to_radians() } else { config.min_travel_m };
    let range = clips.iter().map(|c| c.observed_range).fold(0.0, f64::max);
    // A clip that hardly moves the part says nothing against it, unless there is no other.
    let telling: Vec<&ClipCheck> = clips.iter().filter(|c| range < least || c.observed_range >= least).collect();
    let errors: Vec<f64> = telling.iter().map(|c| c.replay.rms_m).collect();
    let rms_m = stats::median(&errors).unwrap_or(0.0);
    let peak_force_n = telling.iter().map(|c| c.replay.peak_force_n).fold(0.0, f64::max);
    let share = |c: &&ClipCheck| {
        let range = c.observed_range.max(1e-6);
        ((c.replay.reached[1] - c.replay.reached[0]) / range).min(1.0)
    };
    let reached_share = telling.iter().map(share).fold(1.0, f64::min);
    // Errors below half a centimetre are equal.
    let closest = telling
        .iter()
        .filter_map(|c| c.rivals.first().map(|r| (r.rms_m.max(0.005) / c.free_rms_m.max(0.005), r.name.as_str())))
        .min_by(|a, b| a.0.total_cmp(&b.0));
    let margin = closest.map(|(m, _)| m);
    let best_rival = closest.map_or("", |(_, name)| name).to_owned();
    let amount = |x: f64| if hinge { format!("{:.0}°", x.to_degrees()) } else { format!("{:.0} cm", 100.0 * x) };

    let (verdict, reason) = if clips.is_empty() {
        (Verdict::Undetermined, "no recorded hand to replay".to_owned())
    } else if margin.is_some_and(|m| m < 1.0 / config.rival_margin) {
        (Verdict::Fail, format!("a {best_rival} explains the recorded hand better"))
    } else if rms_m > 2.0 * config.pass_rms_m {
        let text = format!("the handle stays {:.1} cm (RMS) away from the recorded hand", 100.0 * rms_m);
        (Verdict::Fail, text)
    } else if rms_m > config.pass_rms_m && reached_share >= config.pass_range_share {
        let text = format!(
            "follows the recorded hand better than its rivals, but only to {:.1} cm: hinge or hand are off",
            100.0 * rms_m
        );
        (Verdict::Undetermined, text)
    } else if reached_share < config.pass_range_share {
        let text = format!(
            "the part goes through only {:.0} % of the range that the hand went through",
            100.0 * reached_share
        );
        (Verdict::Fail, text)
    } else if range < least {
        let text = format!("the part moved by only {}: too little to tell a hinge from a slide", amount(range));
        (Verdict::Undetermined, text)
    } else if margin.is_some_and(|m| m < config.rival_margin) {
        (Verdict::Undetermined, format!("a {best_rival} explains the recorded hand about as well"))
    } else {
        let rivals = margin.map_or(String::new(), |m| format!("; the best rival ({best_rival}) is {m:.1} times worse"));
        (Verdict::Pass, format!("follows the recorded hand to {:.1} cm over {}{rivals}", 100.0 * rms_m, amount(range)))
    };
    JointCheck { id: part.id.clone(), verdict, reason, rms_m, peak_force_n, reached_share, margin, clips }
}
