//! `paws infer`: joints from recordings, or from a bare trajectory.

use std::path::{Path, PathBuf};

use anyhow::bail;
use clap::Args;

use super::door::Door;
use super::output::write_file;
use super::progress::Steps;
use super::units::UnitsArgs;
use super::words::{self as model, Asked, WordsArgs};
use super::{Answer, ConfigFile, Opening, print, shown};
use crate::articulation::Outcome;
use crate::config::Config;
use crate::evaluation::Predictions;
use crate::inference::bare::{self, BareJoint};
use crate::json;
use crate::pipeline::Scene;
use crate::recording::Recording;
use crate::recording::trajectory::{self, LengthUnit};
use crate::report::table::aligned;
use crate::report::{files, words};
use crate::vlm::Usage;

#[derive(Debug, Args)]
pub struct InferArgs {
    /// Folders of recordings, or files of bare trajectories (x y z [qx qy qz qw], with or without a time stamp first, or as a
    /// header names the columns)
    #[arg(required = true)]
    inputs: Vec<PathBuf>,
    /// Write predictions (recordings) or joints (trajectories) as JSON to this file
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Let physics speak, too, as `paws twin` does: what runs into furniture loses weight (recordings; unless the
    /// parameters switch validation.feedback off)
    #[arg(long)]
    physics: bool,
    #[command(flatten)]
    opening: Opening,
    #[command(flatten)]
    door: Door,
    #[command(flatten)]
    units: UnitsArgs,
    #[command(flatten)]
    config: ConfigFile,
    #[command(flatten)]
    words: WordsArgs,
}

pub fn run(args: &InferArgs) -> anyhow::Result<Answer> {
    let mut config = args.config.read()?;
    config.validation.feedback &= args.physics;
    if let Some(missing) = args.inputs.iter().find(|p| !p.exists()) {
        bail!(
            "{}: no such file or folder; give recordings (folders) or bare trajectories (files of x y z)",
            shown(missing)
        );
    }
    let (folders, trajectories): (Vec<&PathBuf>, Vec<&PathBuf>) = args.inputs.iter().partition(|p| !p.is_file());
    if !folders.is_empty() && !trajectories.is_empty() {
        bail!("give recordings (folders) or bare trajectories (files), not both at once");
    }
    if folders.is_empty() && args.physics {
        bail!("--physics is for recordings (folders): around a bare trajectory there is nothing to run into");
    }
    if !folders.is_empty() && args.units.length().is_some() {
        bail!("--units is for bare trajectories (files): a recording is in metres");
    }
    if folders.is_empty() {
        bare_trajectories(&trajectories, args.units.length(), &config, args.out.as_deref())
    } else {
        recordings(&folders, (args.opening, args.door), &config, args.words.open()?.as_ref(), args.out.as_deref())
    }
}

fn recordings(
    folders: &[&PathBuf],
    (opening, door): (Opening, Door),
    config: &Config,
    asked: Option<&Asked>,
    out: Option<&Path>,
) -> anyhow::Result<Answer> {
    let mut all = Predictions::default();
    let header = ["recording", "clip", "narration", "joint", "outcome"];
    let mut rows = vec![header.map(str::to_owned).to_vec()];
    // All are opened before the first is worked on: one that cannot be read is told at once.
    let opened: Vec<Recording> = folders.iter().map(|f| door.open(opening, f)).collect::<Result<_, _>>()?;
    if let Some(asked) = asked.filter(|a| a.is_dry()) {
        return asked.count(&opened, config);
    }
    let mut total: Option<Usage> = None;
    let mut whole = true;
    for recording in &opened {
        let Predicted { scene, predictions, usage, is_whole } = predict(recording, config, asked)?;
        whole &= is_whole;
        total = model::added(total, usage);
        for c in &scene.clips {
            let joint = scene.joint_of(&c.clip.clip);
            rows.push(vec![
                scene.recording.clone(),
                c.clip.clip.clone(),
                c.clip.narration.clone(),
                joint.map_or("-".to_owned(), |j| j.id.clone()),
                words::clip_reason(c, joint),
            ]);
        }
        all.predictions.extend(predictions.predictions);
    }
    print(&aligned(&rows))?;
    if let Some(out) = out {
        write_file(out, json::text(&all)?)?;
        eprintln!("predictions: {}", shown(out));
    }
    whole &= total.as_ref().is_none_or(|u| u.damaged.is_empty());
    if let Some((asked, usage)) = asked.zip(total) {
        eprintln!("{}", usage.sentence(asked.model()));
    }
    let found = all.predictions.iter().any(|p| p.kind.is_some());
    Ok(if found && whole { Answer::Yes } else { Answer::No })
}

/// What is predicted for a recording.
pub struct Predicted {
    /// The scene.
    pub scene: Scene,
    /// One row a clip.
    pub predictions: Predictions,
    /// What a model was asked so far, where one is.
    pub usage: Option<Usage>,
    /// Whether every file of its frames could be read.
    pub is_whole: bool,
}

/// Inference, what physics says to it where the configuration asks, and fit of one recording.
pub fn predict(recording: &Recording, config: &Config, asked: Option<&Asked>) -> anyhow::Result<Predicted> {
    let steps = Steps::new();
    let model::Inferred { mut scene, usage, lost, .. } = model::infer(recording, config, asked, &steps, false)?;
    weigh(&mut scene, recording, config, &steps);
    let twin = crate::fitting::fit(&scene, &recording.up(), &config.fitting);
    steps.finish();
    let predictions = files::predictions(&scene, &twin);
    Ok(Predicted { scene, predictions, usage, is_whole: lost.is_empty() })
}

/// What physics says to a scene's joints, where the configuration asks for it.
pub fn weigh(scene: &mut Scene, recording: &Recording, config: &Config, steps: &Steps) {
    if config.validation.feedback {
        steps.report("weighing", 0, 1);
        scene.joints = crate::feedback::weighed(scene, &recording.up(), config);
    }
}

fn bare_trajectories(
    paths: &[&PathBuf],
    unit: Option<LengthUnit>,
    config: &Config,
    out: Option<&Path>,
) -> anyhow::Result<Answer> {
    let header = ["trajectory", "type", "axis", "range", "residual", "other type's", "why"];
    let mut rows = vec![header.map(str::to_owned).to_vec()];
    let mut results = Vec::new();
    let mut found = false;
    let mut unread = Vec::new();
    for path in paths {
        let read = match trajectory::read_in(path, unit) {
            Ok(read) => read,
            // One that cannot be read costs only itself.
            Err(error) => {
                unread.push(error.to_string());
                continue;
            }
        };
        for note in &read.notes {
            eprintln!("{}: {note}", shown(path));
        }
        let outcome = bare::infer(&read, &config.inference);
        found |= outcome.found().is_some();
        rows.push(row(path, &outcome));
        results.push(serde_json::json!({"file": shown(path), "outcome": outcome}));
    }
    if rows.len() > 1 {
        print(&aligned(&rows))?;
        if let Some(out) = out {
            write_file(out, json::text(&results)?)?;
            eprintln!("joints: {}", shown(out));
        }
    }
    if !unread.is_empty() {
        bail!("{}", unread.join("\n       "));
    }
    Ok(if found { Answer::Yes } else { Answer::No })
}

/// A trajectory's row of the table.
fn row(path: &Path, outcome: &Outcome<BareJoint>) -> Vec<String> {
    let mut row = vec![shown(path)];
    match outcome {
        Outcome::Found(j) => {
            let a = j.joint.axis;
            let doubt = if j.ambiguous { " (ambiguous)" } else { "" };
            row.extend([
                format!("{}{doubt}", j.joint.kind.word()),
                format!("{:.3} {:.3} {:.3}", a.x, a.y, a.z),
                words::amount(j.joint.kind, j.range),
                words::centimetres(j.residual_m),
                j.other_residual_m.map_or("-".to_owned(), words::centimetres),
                j.reason.clone(),
            ]);
        }
        Outcome::Abstained(reason) => {
            row.extend(["-", "-", "-", "-", "-"].map(str::to_owned));
            row.push(format!("abstained: {reason}"));
        }
    }
    row
}
