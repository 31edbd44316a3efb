//! From replays to a verdict with its reason.

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::replay::{Drive, Replay, simulate};
use super::rivals::{Evidence, REVERSED, Resolution, Rival, anchored, distance2, log_likelihood, path_distance2};
use super::rivals::{resolution, rivals};
use super::world::Surroundings;
use crate::articulation::{Action, Articulation, JointKind};
use crate::config;
use crate::error::Result;
use crate::hands::Trajectory;
use crate::inference::observed_range;
use crate::math::{Point, Vector, centroid, stats};
use crate::twin::{ContactRules, Furniture, Part, Twin};

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

/// A rival against the joint, over all clips.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RivalCheck {
    /// What it is: "hinge on the left", "slide straight out", ...
    pub name: String,
    /// The rival joint.
    pub articulation: Articulation,
    /// Root mean square distance of the hands from the path that it forces on them, metres.
    pub distance_m: f64,
    /// How much more likely the joint makes the hands than this rival does, nats; negative where the rival does better.
    pub margin_nats: f64,
}

/// The best rival's replay of a clip, without obstacles and one way.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RivalReplay {
    /// The rival's name.
    pub name: String,
    /// Tracking error, metres.
    pub rms_m: f64,
    /// Largest force of the hand, newton.
    pub peak_force_n: f64,
    /// The grip on the part at the times of the joint's own trace, world.
    pub handle: Vec<Point>,
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
    /// Root mean square distance of the hand from the path that the joint forces on it, metres.
    pub distance_m: f64,
    /// The same with the handle held where the other clips held it, metres; `None` for an only clip.
    pub held_out_rms_m: Option<f64>,
    /// Noise of the hand that no joint explains, metres.
    pub noise_m: f64,
    /// How many independent samples the clip is worth.
    pub samples: f64,
    /// Among the furniture and walls of the scene.
    pub replay: Replay,
    /// The best rival's.
    pub rival: Option<RivalReplay>,
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
    /// How much more likely the joint makes the hands of all clips than its best rival does, nats; `None` without clips.
    pub margin_nats: Option<f64>,
    /// The errors of the joint that its clips would show.
    pub resolves: Option<Resolution>,
    /// The rivals, best first.
    pub rivals: Vec<RivalCheck>,
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
/// Where rapier refuses a joint, or a hand's times cannot be seconds of one motion.
pub fn validate(twin: &Twin, hands: &[Hands], up: &Vector, config: &config::Validation) -> Result<Validation> {
    validate_ruled(twin, None, hands, up, config)
}

/// The same where a model says which of its solids touch each other.
///
/// # Errors
/// Those of [`validate`].
pub fn validate_ruled(
    twin: &Twin,
    rules: Option<&ContactRules>,
    hands: &[Hands],
    up: &Vector,
    config: &config::Validation,
) -> Result<Validation> {
    let joints = twin
        .furniture
        .par_iter()
        .enumerate()
        .map(|(i, furniture)| {
            let around = Surroundings { rules, ..Surroundings::of(twin, i, up) };
            check_joint(furniture, hands.get(i).map(Vec::as_slice).unwrap_or_default(), &around, config)
        })
        .collect::<Result<_>>()?;
    Ok(Validation { joints })
}

/// Rivals over all clips in closed form, the joint and its best rival replayed on each.
fn check_joint(
    furniture: &Furniture,
    hands: &[(String, &Trajectory)],
    around: &Surroundings,
    config: &config::Validation,
) -> Result<JointCheck> {
    let part = &furniture.part;
    let own = part.joint.articulation;
    let (named, clips): (Vec<(&str, Action)>, Vec<Evidence>) = hands
        .iter()
        .filter_map(|(name, t)| Evidence::of(t, config).map(|clip| ((name.as_str(), t.action), clip)))
        .unzip();
    let compared = compared(part, &clips, config);
    let replayed = named
        .iter()
        .zip(&clips)
        .enumerate()
        .map(|(i, (&(name, action), clip))| {
            let grip = anchored(&own, clip);
            let drive = Drive { times_secs: clip.times_secs.clone(), path: clip.path.clone(), grip, back: true };
            let rival = match compared.first() {
                Some(best) => Some(replay_rival(part, best, clip, around, config)?),
                None => None,
            };
            let mut check = ClipCheck {
                clip: name.to_owned(),
                action,
                observed_range: observed_range(&own, &grip, &clip.path),
                distance_m: distance2(&own, clip).sqrt(),
                held_out_rms_m: held_out(&own, &clips, i),
                noise_m: clip.noise_m,
                samples: clip.samples,
                replay: simulate(part, &own, part.joint.upper, around, &drive, config)?,
                rival,
            };
            if check.replay.untrusted.is_none() && is_left_behind(part, &check, config) {
                check.replay.untrusted = clip.doubt(config);
            }
            Ok(check)
        })
        .collect::<Result<Vec<ClipCheck>>>()?;
    let resolves = (!clips.is_empty()).then(|| resolution(&own, &clips, config));
    Ok(judge(part, replayed, compared, resolves, config))
}

/// The rivals of a part's joint over all clips, best first; none without clips.
fn compared(part: &Part, clips: &[Evidence], config: &config::Validation) -> Vec<RivalCheck> {
    let own = part.joint.articulation;
    let closed: Vec<Point> = clips.iter().map(|c| c.closed).collect();
    let Some(grip) = centroid(&closed) else { return Vec::new() };
    let likely = log_likelihood(&own, clips, config);
    let mut compared: Vec<RivalCheck> = rivals(part, &grip, config)
        .into_iter()
        .map(|Rival { name, articulation }| RivalCheck {
            name,
            articulation,
            distance_m: pooled_distance(&articulation, clips),
            margin_nats: likely - log_likelihood(&articulation, clips, config),
        })
        .collect();
    compared.sort_by(|a, b| a.margin_nats.total_cmp(&b.margin_nats));
    compared
}

/// The best of `rivals` where it is clearly better than the joint: by the margin that decides, and by the price of having had
/// several to choose from; and where it explains the hands itself.
fn ahead<'a>(rivals: &'a [RivalCheck], config: &config::Validation) -> Option<&'a RivalCheck> {
    rivals.first().filter(|r| {
        r.margin_nats <= -config.margin_nats - (rivals.len() as f64).ln() && r.distance_m <= 2.0 * config.pass_rms_m
    })
}

/// The rival to which a part's joint clearly loses by the hands of all its clips, in closed form.
pub(crate) fn beaten(part: &Part, hands: &[&Trajectory], config: &config::Validation) -> Option<RivalCheck> {
    let clips: Vec<Evidence> = hands.iter().filter_map(|hand| Evidence::of(hand, config)).collect();
    ahead(&compared(part, &clips, config), config).cloned()
}

/// A rival pulled by the same hand. It gets all the room it wants: what is compared is how well the motion fits.
fn replay_rival(
    part: &Part,
    rival: &RivalCheck,
    clip: &Evidence,
    around: &Surroundings,
    config: &config::Validation,
) -> Result<RivalReplay> {
    let joint = rival.articulation;
    // Half a turn, or more than any slide.
    let upper = if joint.kind == JointKind::Revolute { std::f64::consts::PI } else { config.rival_slide_m };
    let drive = Drive {
        times_secs: clip.times_secs.clone(),
        path: clip.path.clone(),
        grip: anchored(&joint, clip),
        back: false,
    };
    let alone = Surroundings::none(around.up, around.density);
    let replay = simulate(part, &joint, upper, &alone, &drive, config)?;
    Ok(RivalReplay {
        name: rival.name.clone(),
        rms_m: replay.rms_m,
        peak_force_n: replay.peak_force_n,
        handle: replay.handle,
    })
}

/// Root mean square over all samples of all clips.
fn pooled_distance(joint: &Articulation, clips: &[Evidence]) -> f64 {
    let count: usize = clips.iter().map(|c| c.path.len()).sum();
    let sum: f64 = clips.iter().map(|c| distance2(joint, c) * c.path.len() as f64).sum();
    (sum / count.max(1) as f64).sqrt()
}

/// How far clip `i` is from the joint's path through where the other clips held the handle.
fn held_out(joint: &Articulation, clips: &[Evidence], i: usize) -> Option<f64> {
    let grips: Vec<Point> =
        clips.iter().enumerate().filter(|(k, _)| *k != i).map(|(_, c)| anchored(joint, c)).collect();
    let clip = clips.get(i)?;
    centroid(&grips).map(|grip| path_distance2(joint, &grip, &clip.path).sqrt())
}

/// The verdict.
///
/// **Fail**, where any of these holds:
/// - *A rival refutes it*: the best rival makes the hands of all clips more likely by `margin_nats` and by what the best of
///   so many rivals gains by chance (the logarithm of their number), and is itself not refuted: within twice `pass_rms_m`.
/// - *It is blocked*: on some clip the part goes through less than `pass_range_share` of the observed range, and what lacks
///   at the handle is more than grip and noise make up: the slack at both ends, and two standard deviations of the difference
///   of two positions of the hand. What it ran into is named.
/// - *It cannot follow*: on more than half of the clips the tracking error is above twice `pass_rms_m` and above twice the
///   noise that is left when any hinge or slide may explain the hand. Where none does, the hand is to blame.
///
/// The last two are asked only of simulations that can be trusted ([`Replay::untrusted`]), and what a hand shows that was recorded
/// at a few places only, or that is faster than any ([`Evidence::doubt`]), is asked only what the part ran into.
///
/// A part of which nothing was seen, as in recordings without depth, stands where the hand says that it could, among furniture of
/// which the same is true: what it runs into refutes nothing, and what it does not run into proves nothing.
///
/// **Undetermined**, else, where there is no hand, where nothing of the part was seen, where the simulations of half of the
/// clips blew up, where the tracking error is above `pass_rms_m`, or where the best rival is within `margin_nats`: a motion
/// too small for its noise cannot tell them apart. As rivals stand `rival_shift_m` beside a hinge, what passes is at least
/// known to that. And where the joint's own log odds, after hand, depth, words and physics, are below `margin_nats`: a hand
/// alone follows some joints that depth speaks against.
///
/// **Pass** else.
fn judge(
    part: &Part,
    clips: Vec<ClipCheck>,
    rivals: Vec<RivalCheck>,
    resolves: Option<Resolution>,
    config: &config::Validation,
) -> JointCheck {
    // A simulation that blew up says nothing about the joint.
    let trusted: Vec<&ClipCheck> = clips.iter().filter(|c| c.replay.untrusted.is_none()).collect();
    let errors: Vec<f64> = trusted.iter().map(|c| c.replay.rms_m).collect();
    let rms_m = stats::median(&errors).unwrap_or(0.0);
    let best = rivals.first();
    let blocked = trusted.iter().filter_map(|c| blocked(part, c, config)).max_by(|a, b| a.0.total_cmp(&b.0));
    let blocked = blocked.map(|(_, why)| why);
    let found = Findings { part, clips: &clips, trusted: &trusted, best, rms_m, blocked, config };
    let faults = found.faults(ahead(&rivals, config));
    let (verdict, reason) = if !faults.is_empty() {
        (Verdict::Fail, faults.join("; "))
    } else if let Some(why) = found.undecided() {
        (Verdict::Undetermined, why)
    } else {
        (Verdict::Pass, found.proof(resolves.as_ref()))
    };
    let share = |c: &ClipCheck| reached(c) / c.observed_range.max(1e-6);
    JointCheck {
        id: part.id.clone(),
        verdict,
        reason,
        rms_m,
        peak_force_n: trusted.iter().map(|c| c.replay.peak_force_n).fold(0.0, f64::max),
        reached_share: trusted.iter().copied().map(share).fold(1.0, f64::min),
        margin_nats: best.map(|r| r.margin_nats),
        resolves,
        rivals,
        clips,
    }
}

/// What a joint is judged by.
struct Findings<'a> {
    part: &'a Part,
    clips: &'a [ClipCheck],
    /// Those whose simulation did not blow up.
    trusted: &'a [&'a ClipCheck],
    /// The best rival.
    best: Option<&'a RivalCheck>,
    /// Median tracking error, metres.
    rms_m: f64,
    /// What the part runs into.
    blocked: Option<String>,
    config: &'a config::Validation,
}

impl Findings<'_> {
    /// Why simulation refutes the joint. `ahead`: a rival that explains the hands better.
    fn faults(&self, ahead: Option<&RivalCheck>) -> Vec<String> {
        let mut faults: Vec<String> = Vec::new();
        if let Some(rival) = ahead {
            faults.push(if rival.name == REVERSED {
                "the recorded hand opens it the other way".to_owned()
            } else {
                let own = pooled_over(self.clips);
                format!(
                    "a {} explains the recorded hand better: to {} instead of {}",
                    rival.name,
                    centimetres(rival.distance_m),
                    centimetres(own)
                )
            });
        }
        faults.extend(self.blocked.clone().filter(|_| !is_assumed(self.part)));
        let off = self.trusted.iter().filter(|c| cannot_follow(c, self.config)).count();
        if 2 * off > self.trusted.len() {
            faults.push(format!("the handle stays {} (RMS) away from the recorded hand", centimetres(self.rms_m)));
        }
        faults
    }

    /// Why the recording cannot decide, where nothing refutes the joint.
    fn undecided(&self) -> Option<String> {
        let Self { part, clips, trusted, config, rms_m, .. } = *self;
        if clips.is_empty() {
            return Some("no recorded hand to replay".to_owned());
        }
        if let Some(why) = blew_up(clips).filter(|_| 2 * trusted.len() <= clips.len()) {
            return Some(format!("the simulation is not to be trusted here, because {why}"));
        }
        if rms_m > config.pass_rms_m {
            let noises: Vec<f64> = clips.iter().map(|c| c.noise_m).collect();
            let noise = stats::median(&noises).unwrap_or(0.0);
            return Some(if noise > config.pass_rms_m {
                format!("the recorded hand trembles by {}: no joint could be told from it", centimetres(noise))
            } else {
                format!("follows the recorded hand only to {}: hinge or hand are off", centimetres(rms_m))
            });
        }
        if let Some(rival) = self.best.filter(|r| r.margin_nats < config.margin_nats) {
            return Some(if clips.iter().map(way).fold(0.0, f64::max) < config.glimpse_m {
                "the hand was seen for a moment only: no motion to replay".to_owned()
            } else if rival.margin_nats >= 0.0 {
                format!("over {} a {} would look about the same", self.went(), rival.name)
            } else {
                format!("over {} a {} looks better, but not by enough to decide", self.went(), rival.name)
            });
        }
        if let Some(p) = part.joint.probability.filter(|p| log_odds(*p) < config.margin_nats) {
            return Some(format!(
                "follows the recorded hand to {}, but after all evidence other joints keep a share of {:.0} %",
                centimetres(rms_m),
                100.0 * (1.0 - p)
            ));
        }
        is_assumed(part).then(|| match &self.blocked {
            Some(why) => format!("its front is assumed, and so is what stands around it: {why}"),
            None => format!(
                "follows the recorded hand to {} over {}, but its front is assumed: nothing was seen of it",
                centimetres(rms_m),
                self.went()
            ),
        })
    }

    /// What speaks for a joint that passes.
    fn proof(&self, resolves: Option<&Resolution>) -> String {
        let rivals = self.best.map_or(String::new(), |r| {
            format!("; the best rival, a {}, is {} as likely", r.name, one_in(r.margin_nats))
        });
        let sees = resolves.map_or(String::new(), |r| format!("; {}", sees(self.part.joint.articulation.kind, r)));
        format!("follows the recorded hand to {} over {}{rivals}{sees}", centimetres(self.rms_m), self.went())
    }

    /// How far the part went, in words.
    fn went(&self) -> String {
        let range = self.clips.iter().map(|c| c.observed_range).fold(0.0, f64::max);
        amount(self.part.joint.articulation.kind, range)
    }
}

/// Whether nothing of a part was seen.
fn is_assumed(part: &Part) -> bool {
    !part.solids.is_empty() && part.solids.iter().all(|solid| !solid.seen)
}

/// Why the first simulation that blew up is not to be trusted.
fn blew_up(clips: &[ClipCheck]) -> Option<&str> {
    clips.iter().find_map(|c| c.replay.untrusted.as_deref())
}

/// Log odds of a probability, nats; finite, and minus infinity for what is no number.
#[must_use]
pub fn log_odds(probability: f64) -> f64 {
    if probability.is_nan() {
        return f64::NEG_INFINITY;
    }
    let p = probability.clamp(1e-12, 1.0 - 1e-12);
    (p / (1.0 - p)).ln()
}

/// How far the hand went from where it was first seen, metres.
fn way(clip: &ClipCheck) -> f64 {
    let hand = &clip.replay.hand;
    hand.first().map_or(0.0, |start| hand.iter().map(|p| (p - start).norm()).fold(0.0, f64::max))
}

/// Root mean square of the clips' distances.
fn pooled_over(clips: &[ClipCheck]) -> f64 {
    let squares: Vec<f64> = clips.iter().map(|c| c.distance_m.powi(2)).collect();
    stats::mean(&squares).unwrap_or(0.0).sqrt()
}

/// Opening that the simulated part went through.
fn reached(clip: &ClipCheck) -> f64 {
    clip.replay.reached[1] - clip.replay.reached[0]
}

/// Metres that lack at the handle where a part goes through too little of the range that the hand went through (rad or m);
/// `None` where it does not, or where grip and a hand of this noise make it up.
pub(crate) fn lacking(
    part: &Part,
    replay: &Replay,
    observed_range: f64,
    noise_m: f64,
    config: &config::Validation,
) -> Option<f64> {
    let reached = replay.reached[1] - replay.reached[0];
    let lacking = (observed_range - reached) * part.joint.articulation.lever(&replay.grip);
    let enough = reached >= config.pass_range_share * observed_range || lacking <= made_up_m(noise_m, config);
    (!enough).then_some(lacking)
}

/// Metres at the handle that grip and a hand of this noise make up: the slack at both ends, and two standard deviations of
/// the difference of two positions of the hand.
pub(crate) fn made_up_m(noise_m: f64, config: &config::Validation) -> f64 {
    2.0 * config.grip_slack_m + 2.0 * std::f64::consts::SQRT_2 * noise_m.max(config.hand_std_m)
}

/// Whether a part stays behind the hand although nothing stands in its way: then a hand that went otherwise explains it, too.
fn is_left_behind(part: &Part, clip: &ClipCheck, config: &config::Validation) -> bool {
    let replay = &clip.replay;
    let lacks = lacking(part, replay, clip.observed_range, clip.noise_m, config).is_some();
    let is_stopped = lacks && (replay.limit_steps[1] > 0 || !replay.contacts.is_empty());
    !is_stopped && (lacks || cannot_follow(clip, config))
}

/// Whether a part stays further from the hand than the hand's own noise makes it.
fn cannot_follow(clip: &ClipCheck, config: &config::Validation) -> bool {
    clip.replay.rms_m > 2.0 * config.pass_rms_m.max(clip.noise_m)
}

/// What keeps a part from going where the hand went: metres lacking at the handle, and why in words.
fn blocked(part: &Part, clip: &ClipCheck, config: &config::Validation) -> Option<(f64, String)> {
    let joint = &part.joint;
    let kind = joint.articulation.kind;
    let replay = &clip.replay;
    let lacking = lacking(part, replay, clip.observed_range, clip.noise_m, config)?;
    let why = if replay.limit_steps[1] > 0 {
        format!("it stops at its limit of {}", amount(kind, joint.upper))
    } else if let Some(contact) = replay.contacts.first() {
        format!("its {} runs into {}", contact.solid, contact.with)
    } else if replay.peak_force_n >= config.hand_force_max_n {
        format!("it takes more than the {:.0} N of an arm", config.hand_force_max_n)
    } else if replay.limit_steps[0] > 0 {
        "the hand pushes it shut".to_owned()
    } else {
        "it does not follow".to_owned()
    };
    let text = format!(
        "the part opens by {} of the {} that the hand went through: {why}",
        amount(kind, reached(clip)),
        amount(kind, clip.observed_range)
    );
    Some((lacking, text))
}

/// What a hinge or slide that is off by less would look like.
fn sees(kind: JointKind, resolution: &Resolution) -> String {
    let tilt = resolution.tilt_rad.map_or("any tilt".to_owned(), |t| format!("a tilt below {:.0}°", t.to_degrees()));
    match kind {
        JointKind::Prismatic => format!("{tilt} would look the same"),
        JointKind::Revolute => {
            let shift =
                resolution.shift_m.map_or("any shift".to_owned(), |s| format!("a shift below {:.0} cm", 100.0 * s));
            format!("{shift} or {tilt} would look the same")
        }
    }
}

/// How likely a rival is beside the joint: "1/20", "less than a millionth".
fn one_in(nats: f64) -> String {
    /// Format: beyond this the hands' own model is in doubt, not the rival.
    const MOST: f64 = 1e6;
    let odds = nats.exp();
    match odds {
        odds if odds > MOST => "less than a millionth".to_owned(),
        odds if odds < 100.0 => format!("1/{odds:.0}"),
        // More than two digits are the noise's.
        odds => {
            let unit = 10f64.powf(odds.log10().floor() - 1.0);
            format!("1/{:.0}", (odds / unit).round() * unit)
        }
    }
}

/// An opening for people: degrees or centimetres.
pub(crate) fn amount(kind: JointKind, opening: f64) -> String {
    match kind {
        JointKind::Revolute => format!("{:.0}°", opening.to_degrees()),
        JointKind::Prismatic => format!("{:.0} cm", 100.0 * opening),
    }
}

fn centimetres(metres: f64) -> String {
    format!("{:.1} cm", 100.0 * metres)
}

#[cfg(test)]
mod tests;
