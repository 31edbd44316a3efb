//! `paws validate`.

use std::path::{Path, PathBuf};

use clap::Args;

use super::joints::{self, JointArgs};
use super::output::write_file;
use super::{Answer, ConfigFile, foreign, print};
use crate::json;
use crate::make::{JointHands, as_hands};
use crate::math::Vector;
use crate::report::phrases;
use crate::report::table::aligned;
use crate::twin::Twin;
use crate::validation::{self, Verdict};

#[derive(Debug, Args)]
pub struct ValidateArgs {
    /// The folder that `paws twin` wrote (twin.json and trajectories.json), a URDF or MJCF file, or joints found elsewhere
    /// (docs/joints-format.md)
    twin: PathBuf,
    /// Write the report as JSON to this file
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    #[command(flatten)]
    foreign: foreign::ForeignArgs,
    #[command(flatten)]
    joints: JointArgs,
    #[command(flatten)]
    config: ConfigFile,
}

pub fn run(args: &ValidateArgs) -> anyhow::Result<Answer> {
    let config = args.config.read()?;
    let (twin, rules, in_order) = if foreign::is_model(&args.twin) {
        let foreign::Loaded { twin, rules, hands } = foreign::load(&args.twin, &args.foreign)?;
        (twin, Some(rules), hands)
    } else if joints::is_joints(&args.twin) {
        let (twin, hands) = foreign::load_joints(&args.twin, &args.joints, &args.foreign)?;
        (twin, None, hands)
    } else {
        args.foreign.refuse()?;
        let (twin, hands) = ours(&args.twin)?;
        (twin, None, hands)
    };
    let hands = as_hands(&in_order);
    let report = validation::validate_ruled(&twin, rules.as_ref(), &hands, &Vector::z(), &config.validation)?;
    let header = [
        "joint",
        "clip",
        "action",
        "tracking error",
        "largest",
        "other clips",
        "peak force",
        "reached",
        "observed",
        "deepest contact",
        "best rival",
    ];
    let mut rows = vec![header.map(str::to_owned).to_vec()];
    let mut verdicts = String::new();
    for (check, f) in report.joints.iter().zip(&twin.furniture) {
        let kind = f.part.joint.articulation.kind;
        // Other people's joints go by the names that they have in their file.
        let name = if rules.is_some() { &f.part.label } else { &check.id };
        for c in &check.clips {
            let replay = &c.replay;
            rows.push(vec![
                name.clone(),
                c.clip.clone(),
                format!("{:?}", c.action).to_lowercase(),
                phrases::centimetres(replay.rms_m),
                phrases::centimetres(replay.max_m),
                c.held_out_rms_m.map_or("-".to_owned(), phrases::centimetres),
                format!("{:.0} N", replay.peak_force_n),
                phrases::amount(kind, replay.reached[1] - replay.reached[0]),
                phrases::amount(kind, c.observed_range),
                replay.worst_penetration().map_or("-".to_owned(), |(m, with)| format!("{:.1} mm {with}", 1000.0 * m)),
                c.rival.as_ref().map_or("-".to_owned(), |r| format!("{} {}", r.name, phrases::centimetres(r.rms_m))),
            ]);
        }
        let odds = check.margin_nats.map_or(String::new(), |nats| format!(" ({})", phrases::margin(Some(nats))));
        verdicts += &format!("{name}: {}{odds}: {}\n", check.verdict.word(), check.reason);
    }
    print(&aligned(&rows))?;
    print(&format!("\n{verdicts}"))?;
    if let Some(out) = &args.out {
        write_file(out, json::text(&report)?)?;
    }
    let refuted = report.joints.iter().any(|j| j.verdict == Verdict::Fail);
    Ok(if refuted { Answer::No } else { Answer::Yes })
}

/// The twin and the recorded hands of a folder of ours, the hands in the twin's order.
fn ours(path: &Path) -> anyhow::Result<(Twin, Vec<JointHands>)> {
    let twin = super::export::read_twin(path)?;
    // The same points that every exporter insists on: a broken twin is told before it is simulated.
    crate::export::check(&twin)?;
    let recorded = path.join("trajectories.json");
    if !recorded.exists() {
        anyhow::bail!(
            "{}: no such file: a twin without a recording (`paws export`) has no hands to replay; validate its scene.urdf with \
             --trajectory FILE",
            recorded.display()
        );
    }
    let hands: Vec<JointHands> = json::read(&recorded)?;
    for (name, trajectory) in hands.iter().flat_map(|h| &h.clips) {
        if let Err(fault) = trajectory.check() {
            anyhow::bail!("{}: clip {name}: {fault}", recorded.display());
        }
    }
    let in_order = twin
        .furniture
        .iter()
        .map(|f| JointHands {
            joint: f.part.id.clone(),
            clips: hands.iter().filter(|h| h.joint == f.part.id).flat_map(|h| h.clips.clone()).collect(),
        })
        .collect();
    Ok((twin, in_order))
}
