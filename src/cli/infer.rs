//! `paws infer`: joints from recordings, or from a bare trajectory.

use std::path::{Path, PathBuf};

use anyhow::bail;
use clap::Args;

use super::door::Door;
use super::many::Given;
use super::output::write_file;
use super::progress::Steps;
use super::units::UnitsArgs;
use super::words::{self as model, Asked, WordsArgs};
use super::{Answer, ConfigFile, Opening, cache, print, shown};
use crate::articulation::Outcome;
use crate::config::Config;
use crate::evaluation::Predictions;
use crate::inference::bare::{self, BareJoint};
use crate::json;
use crate::pipeline::Scene;
use crate::recording::trajectory::{self, LengthUnit};
use crate::recording::{LeftOut, Recording};
use crate::report::table::aligned;
use crate::report::{files, phrases};
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
    /// Use physics as evidence, as `paws twin` does: a hypothesis that runs into furniture loses weight (recordings only; not
    /// where the parameters switch validation.feedback off)
    #[arg(long)]
    physics: bool,
    /// The recordings are of one place, in the order of time: all of them are one scene, as `paws twin` has it
    #[arg(long)]
    together: bool,
    /// The recordings already share one world: do not align them
    #[arg(long, requires = "together")]
    one_frame: bool,
    /// Keep intermediate results in DIR; a later run reuses them. The answers are the same with and without
    #[arg(long, value_name = "DIR")]
    cache: Option<PathBuf>,
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
    let (folders, trajectories): (Vec<PathBuf>, Vec<PathBuf>) = args.inputs.iter().cloned().partition(|p| !p.is_file());
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
        let given = Given {
            recordings: &folders,
            opening: args.opening,
            door: args.door,
            one_frame: args.one_frame,
            cache: args.cache.as_deref(),
        };
        let asked = args.words.open()?;
        let (asked, out) = (asked.as_ref(), args.out.as_deref());
        match args.together {
            true => recordings(1, &|_| given.open(&config, &Steps::new()), &config, asked, given.cache, out),
            false => {
                let open = |i: usize| args.door.open(args.opening, &folders[i]);
                recordings(folders.len(), &open, &config, asked, given.cache, out)
            }
        }
    }
}

/// Recordings that are opened one by one.
fn recordings(
    count: usize,
    open: &dyn Fn(usize) -> anyhow::Result<Recording>,
    config: &Config,
    asked: Option<&Asked>,
    cache: Option<&Path>,
    out: Option<&Path>,
) -> anyhow::Result<Answer> {
    if let Some(asked) = asked.filter(|a| a.is_dry()) {
        let opened: Vec<Recording> = (0..count).map(open).collect::<Result<_, _>>()?;
        return asked.count(&opened, config);
    }
    let mut all = Predictions::default();
    let header = ["recording", "clip", "narration", "joint", "outcome"];
    let mut rows = vec![header.map(str::to_owned).to_vec()];
    let mut total: Option<Usage> = None;
    let mut bad = 0;
    let mut whole = true;
    for i in 0..count {
        let predicted = open(i).and_then(|recording| predict(&recording, config, asked, cache));
        let Predicted { scene, predictions, usage, is_whole } = match predicted {
            Ok(predicted) => predicted,
            Err(error) if count == 1 => return Err(error),
            // One that cannot be worked with costs only itself.
            Err(error) => {
                eprintln!("left out: {error:#}");
                bad += 1;
                continue;
            }
        };
        whole &= is_whole;
        total = model::added(total, usage);
        for c in &scene.clips {
            let joint = scene.joint_of(&c.clip.clip);
            rows.push(vec![
                scene.recording.clone(),
                c.clip.clip.clone(),
                c.clip.narration.clone(),
                joint.map_or("-".to_owned(), |j| j.id.clone()),
                phrases::clip_reason(c, joint),
            ]);
        }
        all.predictions.extend(predictions.predictions);
    }
    if bad == count {
        bail!("none of the {bad} recordings can be worked with");
    }
    whole &= bad == 0;
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
    /// Whether all of it could be read (every file of its frames, every clip, every hand), and every recording of one place be joined.
    pub is_whole: bool,
}

/// Inference, what physics says to it where the configuration asks, and fit of one recording.
///
/// `cache`: where what frames show is kept.
pub fn predict(
    recording: &Recording,
    config: &Config,
    asked: Option<&Asked>,
    cache: Option<&Path>,
) -> anyhow::Result<Predicted> {
    let steps = Steps::new();
    let store = cache::open(cache, config)?;
    let how = model::How { config, asked, store: &*store, keep: false };
    let model::Inferred { mut scene, usage, lost, .. } = model::infer(recording, how, &steps)?;
    weigh(&mut scene, recording, config, &steps);
    let twin = crate::fitting::fit(&scene, &recording.up(), &config.fitting, &config.priors);
    steps.finish();
    let predictions = files::predictions(&scene, &twin);
    let is_whole = lost.is_empty() && scene.videos.left_out.is_empty() && recording.left_out == LeftOut::default();
    Ok(Predicted { scene, predictions, usage, is_whole })
}

/// What physics says to a scene's joints, where the configuration asks for it.
pub fn weigh(scene: &mut Scene, recording: &Recording, config: &Config, steps: &Steps) {
    if config.validation.feedback {
        steps.report("weighing", 0, 1);
    }
    crate::make::weigh(scene, &recording.up(), config);
}

fn bare_trajectories(
    paths: &[PathBuf],
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
    if unread.len() == paths.len() {
        bail!("{}", unread.join("\n       "));
    }
    for error in &unread {
        eprintln!("left out: {error}");
    }
    Ok(if found && unread.is_empty() { Answer::Yes } else { Answer::No })
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
                phrases::amount(j.joint.kind, j.range),
                phrases::centimetres(j.residual_m),
                j.other_residual_m.map_or("-".to_owned(), phrases::centimetres),
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
