//! `paws evaluate`.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use anyhow::bail;
use clap::Args;
use serde::Serialize;

use super::evaluate_joints::{self, Compared};
use super::joints::JointArgs;
use super::output::write_file;
use super::{Answer, print, shown};
use crate::error::Result;
use crate::evaluation::point_parts::PartReport;
use crate::evaluation::truth::read_each;
use crate::evaluation::{EvaluationReport, Paired, Predictions, Truth, compare, evaluate, frame_contradictions};
use crate::json;
use crate::report::accuracy;

#[derive(Debug, Args)]
pub struct EvaluateArgs {
    /// predictions.json, or a folder that `paws twin` wrote; then the recordings with a ground_truth.json, or such files.
    /// A scene of several recordings is held against the truth of each. With --truth all are predictions, taken together.
    /// Joints of data sets (docs/joints-format.md) are compared as well: PREDICTED TRUE
    #[arg(required = true, value_name = "PREDICTIONS RECORDING")]
    inputs: Vec<PathBuf>,
    /// Recordings with a ground_truth.json, or such files; or the true joints of as many predictions
    #[arg(long, value_name = "RECORDING", num_args = 1..)]
    truth: Vec<PathBuf>,
    /// One line a clip as well
    #[arg(long)]
    clips: bool,
    /// All the rest: what became of the clips, other denominators, groups, errors, calibration
    #[arg(long)]
    details: bool,
    /// Other predictions for the same clips: the difference, with its interval
    #[arg(long, value_name = "PREDICTIONS")]
    against: Option<PathBuf>,
    /// Write the whole report as JSON to this file
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Write one row a clip with every measure and every rule's verdict as CSV to this file
    #[arg(long, value_name = "FILE")]
    csv: Option<PathBuf>,
    #[command(flatten)]
    joints: JointArgs,
}

/// The JSON report.
#[derive(Serialize)]
struct File<'a> {
    #[serde(flatten)]
    report: &'a EvaluationReport,
    /// The difference to other predictions.
    #[serde(skip_serializing_if = "Option::is_none")]
    against: Option<Vec<Paired>>,
    /// Found parts, where both sides list the points of parts.
    #[serde(skip_serializing_if = "<[PartReport]>::is_empty")]
    parts: &'a [PartReport],
}

pub fn run(args: &EvaluateArgs) -> anyhow::Result<Answer> {
    let (files, recordings) = match (args.truth.as_slice(), args.inputs.as_slice()) {
        ([], [_]) => bail!("no truth: name recordings with a ground_truth.json after the predictions"),
        ([], [file, recordings @ ..]) => (std::slice::from_ref(file), recordings),
        (recordings, files) => (files, recordings),
    };
    if args.joints.is_forced() || recordings.iter().any(|p| evaluate_joints::is_scene(p)) {
        return of_joints(args, files, recordings);
    }
    let truths = truths(recordings)?;
    let report = evaluate(&predictions(files, &truths)?, &truths);
    let against = match &args.against {
        None => None,
        Some(file) => {
            let other = evaluate(&predictions(std::slice::from_ref(file), &truths)?, &truths);
            Some(compare(&report, &other).ok_or_else(|| anyhow::anyhow!("no clip of the truth moves a joint"))?)
        }
    };
    if args.clips {
        print(&accuracy::per_clip(&report))?;
    }
    print(&accuracy::headline(&report))?;
    if args.details {
        print(&accuracy::details(&report))?;
    }
    if let Some((file, rows)) = args.against.as_ref().zip(against.as_ref()) {
        print(&format!("\nminus {}, on the same clips\n{}", shown(file), accuracy::paired(rows)))?;
    }
    if let Some(path) = &args.csv {
        write_file(path, accuracy::csv(&report))?;
    }
    if let Some(path) = &args.json {
        write_file(path, json::text(&File { report: &report, against, parts: &[] })?)?;
    }
    Ok(Answer::Yes)
}

/// Joints against the joints of a data set.
fn of_joints(args: &EvaluateArgs, files: &[PathBuf], truths: &[PathBuf]) -> anyhow::Result<Answer> {
    if args.against.is_some() {
        bail!("--against compares predictions about recordings; evaluate both files against the joints instead");
    }
    let Compared { report, parts } = evaluate_joints::run(files, truths, &args.joints)?;
    if args.clips {
        print(&accuracy::per_clip(&report))?;
    }
    print(&accuracy::headline(&report))?;
    if args.details {
        print(&accuracy::details(&report))?;
    }
    print(&crate::report::part_table::table(&parts))?;
    if let Some(path) = &args.csv {
        write_file(path, accuracy::csv(&report))?;
    }
    if let Some(path) = &args.json {
        write_file(path, json::text(&File { report: &report, against: None, parts: &parts })?)?;
    }
    Ok(Answer::Yes)
}

/// The truths of recordings, each of another name.
pub fn truths(recordings: &[PathBuf]) -> anyhow::Result<Vec<Truth>> {
    let truths: Vec<Truth> = recordings.iter().map(|p| Truth::read(p)).collect::<Result<_>>()?;
    check_names(&truths)?;
    Ok(truths)
}

/// What can be read of recordings, in their order; why others are left out goes to standard error.
pub fn opened<T>(recordings: &[PathBuf], open: impl Fn(&Path) -> Result<T>) -> anyhow::Result<Vec<T>> {
    let (opened, left_out) = read_each(recordings, open)?;
    for error in left_out {
        eprintln!("left out: {error}");
    }
    if opened.is_empty() {
        bail!("none of the {} recordings can be read", recordings.len());
    }
    Ok(opened)
}

/// Refuses truths of recordings with one name: predictions name their recording.
pub fn check_names(truths: &[Truth]) -> anyhow::Result<()> {
    let names: BTreeSet<&str> = truths.iter().map(|t| t.recording.as_str()).collect();
    if names.len() != truths.len() {
        bail!("two of the truths are of recordings with one name; rename a folder");
    }
    Ok(())
}

/// Predictions of several files together; a clip may have a row in one of them only.
fn predictions(files: &[PathBuf], truths: &[Truth]) -> anyhow::Result<Predictions> {
    let mut all = Predictions::default();
    let mut seen = BTreeSet::new();
    for path in files {
        let file = if path.is_dir() { path.join("predictions.json") } else { path.clone() };
        let read = Predictions::read(&file)?;
        for truth in truths {
            if let Some(why) = frame_contradictions::contradiction(&read.predictions, truth) {
                bail!("{}: recording {}: {why}", file.display(), truth.recording);
            }
        }
        for row in read.predictions {
            if !seen.insert((row.recording.clone(), row.clip.clone())) {
                bail!("{}: {}/{} is in an earlier file already", file.display(), row.recording, row.clip);
            }
            all.predictions.push(row);
        }
    }
    Ok(all)
}
