//! Anybody's URDF or MJCF with recorded paths, in the form in which our own twins are validated.

use std::path::Path;

use anyhow::bail;
use clap::{Args, ValueEnum};
use nalgebra::UnitQuaternion;

use super::joints::JointArgs;
use super::moved::{self, Motion};
use super::shown;
use super::units::UnitsArgs;
use crate::articulation::Action;
use crate::fitting::joints::upright;
use crate::hands::{Sample, Trajectory};
use crate::inference::bare;
use crate::make::JointHands;
use crate::math::{Point, stats};
use crate::model::{self, furniture};
use crate::recording::trajectory::{self, BareTrajectory};
use crate::twin::{ContactRules, Part, Twin};

/// Arguments of `paws validate` for models that are not ours.
#[derive(Debug, Clone, Default, Args)]
pub struct ForeignArgs {
    /// For a URDF or MJCF file, or joints: the recorded path of a point of the moved part in the file's world frame, as lines of
    /// x y z [qx qy qz qw] with or without a time stamp first; JOINT= says what it moved. May be repeated
    #[arg(long = "trajectory", value_name = "[JOINT=]FILE")]
    trajectories: Vec<String>,
    /// Whether a trajectory opens or closes its part: once for all, or once for each [default: told from its motion along
    /// the joint]
    #[arg(long, value_enum)]
    action: Vec<Way>,
    #[command(flatten)]
    units: UnitsArgs,
}

/// What a trajectory does.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Way {
    Open,
    Close,
}

impl ForeignArgs {
    /// Refuses the arguments beside a folder of ours, which has its own trajectories.
    pub fn refuse(&self) -> anyhow::Result<()> {
        if self.trajectories.is_empty() && self.action.is_empty() && self.units.length().is_none() {
            return Ok(());
        }
        bail!(
            "--trajectory, --action and --units belong to a URDF or MJCF file or to joints; a folder of `paws twin` has its own \
             hands"
        )
    }

    fn action(&self, i: usize) -> anyhow::Result<Option<Action>> {
        let way = match self.action.as_slice() {
            [] => return Ok(None),
            [one] => one,
            several if several.len() == self.trajectories.len() => &several[i],
            several => bail!(
                "{} times --action for {} trajectories; give it once, or once for each",
                several.len(),
                self.trajectories.len()
            ),
        };
        Ok(Some(match way {
            Way::Open => Action::Open,
            Way::Close => Action::Close,
        }))
    }
}

/// Whether a path is a model rather than a folder of ours.
pub fn is_model(path: &Path) -> bool {
    path.is_file() && path.extension().is_none_or(|e| !e.eq_ignore_ascii_case("json"))
}

/// A model with what was recorded of it.
pub struct Loaded {
    /// The model as a twin.
    pub twin: Twin,
    /// What of it touches what.
    pub rules: ContactRules,
    /// The hands of its joints, in the twin's order.
    pub hands: Vec<JointHands>,
}

/// The model as a twin with the hands of its joints; what was decided on the way is told.
pub fn load(path: &Path, args: &ForeignArgs) -> anyhow::Result<Loaded> {
    if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("glb") || e.eq_ignore_ascii_case("usda")) {
        bail!("{}: cannot be simulated here; give the model as URDF or MJCF", shown(path));
    }
    let model = model::read(path)?;
    let (twin, rules, notes) = furniture::to_ruled_twin(&model);
    for note in &notes {
        eprintln!("{}: {note}", shown(path));
    }
    tell_left_out(path, &twin);
    let names: Vec<&str> = twin.furniture.iter().map(|f| f.part.label.as_str()).collect();
    if names.is_empty() {
        let why: Vec<String> = twin.left_out.iter().take(3).map(|l| format!("; {}: {}", l.id, l.reason)).collect();
        bail!("{}: no joint of it can be simulated (`paws check` says more){}", shown(path), why.concat());
    }
    let frame = Frame { path, model: Some(&model), turn: UnitQuaternion::identity(), names };
    let hands = hands(&frame, &twin, args)?;
    Ok(Loaded { twin, rules, hands })
}

/// Joints that another program found, with the hands that moved them, both in the twin's frame: +Z up.
pub fn load_joints(path: &Path, joints: &JointArgs, args: &ForeignArgs) -> anyhow::Result<(Twin, Vec<JointHands>)> {
    let (twin, up) = joints.twin(path)?;
    tell_left_out(path, &twin);
    let names: Vec<&str> = twin.furniture.iter().map(|f| f.part.id.as_str()).collect();
    if names.is_empty() {
        bail!("{}: no joint of it can be built", shown(path));
    }
    let frame = Frame { path, model: None, turn: upright(&up)?, names };
    let hands = hands(&frame, &twin, args)?;
    Ok((twin, hands))
}

fn tell_left_out(path: &Path, twin: &Twin) {
    for left in &twin.left_out {
        eprintln!("{}: {} is left out: {}", shown(path), left.id, left.reason);
    }
}

/// What the recorded paths are read against.
struct Frame<'a> {
    path: &'a Path,
    model: Option<&'a model::Model>,
    /// From the file's frame to the twin's.
    turn: UnitQuaternion<f64>,
    /// What the joints are called, in the twin's order.
    names: Vec<&'a str>,
}

/// The recorded paths, each with the joint that it moved.
fn hands(frame: &Frame<'_>, twin: &Twin, args: &ForeignArgs) -> anyhow::Result<Vec<JointHands>> {
    let (path, names) = (frame.path, &frame.names);
    if args.trajectories.is_empty() {
        bail!(
            "{}: give recorded paths to replay, --trajectory [JOINT=]FILE; its joints: {}",
            shown(path),
            names.join(", ")
        );
    }
    let mut hands: Vec<JointHands> =
        twin.furniture.iter().map(|f| JointHands { joint: f.part.id.clone(), clips: Vec::new() }).collect();
    for (i, argument) in args.trajectories.iter().enumerate() {
        let (wanted, file) = match argument.split_once('=') {
            Some((joint, file)) if !Path::new(argument).is_file() => (Some(joint), Path::new(file)),
            _ => (None, Path::new(argument.as_str())),
        };
        let mut recorded = read(file, args)?;
        for p in &mut recorded.positions {
            *p = frame.turn * *p;
        }
        let points = bare::robust(&recorded.positions, &crate::config::Bare::default());
        let index = match wanted {
            Some(name) => match twin.furniture.iter().position(|f| f.part.label == name || f.part.id == name) {
                Some(index) => index,
                None => {
                    let left = twin.left_out.iter().find(|left| left.id == name);
                    let why = left.map_or_else(String::new, |left| format!(" ({})", left.reason));
                    let there = names.join(", ");
                    bail!("{}: no joint {name} that can be simulated{why}; there are {there}", shown(path))
                }
            },
            None if names.len() == 1 => 0,
            None => {
                let (index, off) = moved::nearest(twin, &points);
                eprintln!(
                    "{}: taken to move {}, whose motion is nearest ({:.1} cm, RMS); JOINT=FILE says otherwise",
                    shown(file),
                    names[index],
                    100.0 * off
                );
                index
            }
        };
        let part = &twin.furniture[index].part;
        moved::check_place(file, frame.model, part, &points)?;
        let motion = match args.action(i)? {
            Some(action) => Motion { action, samples: points.len() },
            None => told(file, part, &points),
        };
        let step = if recorded.times_secs.is_empty() { step_secs(file, &points) } else { 0.0 };
        let made = as_hand(&recorded, &points, motion, step);
        if let Err(fault) = made.check() {
            bail!("{}: {fault}", shown(file));
        }
        let name = file.file_stem().map_or_else(|| shown(file), |s| s.to_string_lossy().into_owned());
        hands[index].clips.push((name, made));
    }
    Ok(hands)
}

/// Samples a second of a path without time stamps, at the most: a video's.
const RATE_HZ: f64 = 30.0;
/// How fast a hand is taken to go where samples without time stamps are far apart, m/s: an easy pull.
const EASY_M_PER_S: f64 = 0.5;
/// Share of the steps by which that is told: single jumps are none of the hand's.
const STEPS_SHARE: f64 = 0.95;

/// A recorded path; what was left out of it, and what its time stamps are, is told.
fn read(file: &Path, args: &ForeignArgs) -> anyhow::Result<BareTrajectory> {
    let recorded = trajectory::read_in(file, args.units.length())?;
    for note in &recorded.notes {
        eprintln!("{}: {note}", shown(file));
    }
    moved::check_times(file, &recorded)?;
    Ok(recorded)
}

/// Seconds from one sample to the next of a path without time stamps, which is told: a video's, or what an easy pull takes from
/// one to the next where they are further apart.
fn step_secs(file: &Path, points: &[Point]) -> f64 {
    let steps: Vec<f64> = points.windows(2).map(|w| (w[1] - w[0]).norm()).collect();
    let step = stats::quantile(&steps, STEPS_SHARE).unwrap_or(0.0);
    let taken = (step / EASY_M_PER_S).max(1.0 / RATE_HZ);
    if taken > 1.0 / RATE_HZ {
        eprintln!(
            "{}: has no time stamps, and its samples are up to {:.0} cm apart; {taken:.2} s are taken from one to the next",
            shown(file),
            100.0 * step
        );
    } else {
        eprintln!("{}: has no time stamps; {RATE_HZ} samples a second are taken", shown(file));
    }
    taken
}

/// What a path does to its part, by its motion along the joint, which is told.
fn told(file: &Path, part: &Part, points: &[Point]) -> Motion {
    let motion = moved::motion(part, points);
    let word = match motion.action {
        Action::Open => "open",
        Action::Close => "close",
    };
    eprintln!(
        "{}: taken to {word} {}, from the motion along its joint; --action says otherwise",
        shown(file),
        part.label
    );
    if motion.samples < points.len() {
        eprintln!("{}: goes there and back; it is replayed up to where it turns", shown(file));
    }
    motion
}

/// The path as a hand's; its samples are `step_secs` apart where it has no time stamps.
fn as_hand(recorded: &BareTrajectory, points: &[Point], motion: Motion, step_secs: f64) -> Trajectory {
    let samples = points
        .iter()
        .zip(&recorded.positions)
        .take(motion.samples)
        .enumerate()
        .map(|(k, (smoothed, observed))| Sample {
            frame: k,
            time_secs: recorded.times_secs.get(k).copied().unwrap_or(k as f64 * step_secs),
            observed: *observed,
            smoothed: *smoothed,
            accepted: true,
        })
        .collect();
    Trajectory { side: None, samples, action: motion.action, ends_seen: [true; 2] }
}
