//! Anybody's URDF or MJCF with recorded paths, in the form in which our own twins are validated.

use std::path::Path;

use anyhow::bail;
use clap::{Args, ValueEnum};

use super::shown;
use super::twin::JointHands;
use crate::articulation::Action;
use crate::hands::{Sample, Trajectory};
use crate::inference::bare;
use crate::math::Point;
use crate::model::{self, furniture};
use crate::recording::trajectory;
use crate::twin::{Part, Twin};

/// Arguments of `paws validate` for models that are not ours.
#[derive(Debug, Clone, Default, Args)]
pub struct ForeignArgs {
    /// For a URDF or MJCF file: the recorded path of a point of the moved part in the model's world frame, as lines of
    /// x y z [qx qy qz qw] with or without a time stamp first; JOINT= says what it moved. May be repeated
    #[arg(long = "trajectory", value_name = "[JOINT=]FILE")]
    trajectories: Vec<String>,
    /// Whether a trajectory opens or closes its part: once for all, or once for each [default: told from its ends]
    #[arg(long, value_enum)]
    action: Vec<Way>,
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
        if self.trajectories.is_empty() && self.action.is_empty() {
            return Ok(());
        }
        bail!("--trajectory and --action belong to a URDF or MJCF file; a folder of `paws twin` has its own hands")
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

/// The model as a twin with the hands of its joints, in the twin's order; what was decided on the way is told.
pub fn load(path: &Path, args: &ForeignArgs) -> anyhow::Result<(Twin, Vec<JointHands>)> {
    if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("glb") || e.eq_ignore_ascii_case("usda")) {
        bail!("{}: cannot be simulated here; give the model as URDF or MJCF", shown(path));
    }
    let model = model::read(path)?;
    let (twin, notes) = furniture::to_twin(&model);
    for note in &notes {
        eprintln!("{}: {note}", shown(path));
    }
    for left in &twin.left_out {
        eprintln!("{}: {} is left out: {}", shown(path), left.id, left.reason);
    }
    let names: Vec<&str> = twin.furniture.iter().map(|f| f.part.label.as_str()).collect();
    if names.is_empty() {
        bail!("{}: no joint of it can be simulated (`paws check` says more)", shown(path));
    }
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
        let recorded = trajectory::read(file)?;
        let points = bare::robust(&recorded.positions);
        let index = match wanted {
            Some(name) => match twin.furniture.iter().position(|f| f.part.label == name || f.part.id == name) {
                Some(index) => index,
                None => bail!("{}: no joint {name} that can be simulated; there are {}", shown(path), names.join(", ")),
            },
            None if names.len() == 1 => 0,
            None => {
                let (index, off) = nearest(&twin, &points);
                eprintln!(
                    "{}: taken to move {}, whose handle's path is nearest ({:.1} cm, RMS); JOINT=FILE says otherwise",
                    shown(file),
                    names[index],
                    100.0 * off
                );
                index
            }
        };
        let part = &twin.furniture[index].part;
        let action = match args.action(i)? {
            Some(action) => action,
            None => guessed(part, &points),
        };
        if recorded.times_secs.is_empty() {
            eprintln!("{}: has no time stamps; {RATE_HZ} samples a second are taken", shown(file));
        }
        let samples = points
            .iter()
            .enumerate()
            .map(|(k, p)| Sample {
                frame: k,
                time_secs: recorded.times_secs.get(k).copied().unwrap_or(k as f64 / RATE_HZ),
                observed: recorded.positions[k],
                smoothed: *p,
                accepted: true,
            })
            .collect();
        let made = Trajectory { side: None, samples, action, ends_seen: [true; 2] };
        if let Err(fault) = made.check() {
            bail!("{}: {fault}", shown(file));
        }
        let name = file.file_stem().map_or_else(|| shown(file), |s| s.to_string_lossy().into_owned());
        hands[index].clips.push((name, made));
    }
    Ok((twin, hands))
}

/// Samples a second of a path without time stamps: a video's.
const RATE_HZ: f64 = 30.0;

/// The part whose handle's path is nearest to the points, and the root mean square distance, metres.
fn nearest(twin: &Twin, points: &[Point]) -> (usize, f64) {
    let off = |part: &Part| {
        let phi = part.joint.articulation;
        let squares: f64 = points
            .iter()
            .map(|p| {
                let opening = phi.opening_at(&part.handle, p).clamp(0.0, part.joint.upper);
                (phi.motion(opening) * part.handle - p).norm_squared()
            })
            .sum();
        (squares / points.len().max(1) as f64).sqrt()
    };
    twin.furniture
        .iter()
        .map(|f| off(&f.part))
        .enumerate()
        .min_by(|a, b| a.1.total_cmp(&b.1))
        .unwrap_or((0, f64::INFINITY))
}

/// What begins nearer to the closed handle than it ends opens.
fn guessed(part: &Part, points: &[Point]) -> Action {
    let far = |p: Option<&Point>| p.map_or(0.0, |p| (p - part.handle).norm());
    if far(points.first()) <= far(points.last()) { Action::Open } else { Action::Close }
}
