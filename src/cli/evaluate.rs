//! `paws evaluate`.

use std::path::PathBuf;

use anyhow::bail;
use clap::Args;

use super::output::write_file;
use super::{Answer, print};
use crate::evaluation::summary::Shares;
use crate::evaluation::{Predictions, Report, Truth, evaluate};
use crate::json;
use crate::report::table::aligned;
use crate::report::words;

#[derive(Debug, Args)]
pub struct EvaluateArgs {
    /// predictions.json, or a folder that `paws twin` wrote
    predictions: PathBuf,
    /// Recordings with a ground_truth.json, or such files
    #[arg(required = true)]
    truth: Vec<PathBuf>,
    /// One line a clip as well
    #[arg(long)]
    clips: bool,
    /// Write the whole report as JSON to this file
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

pub fn run(args: &EvaluateArgs) -> anyhow::Result<Answer> {
    let file =
        if args.predictions.is_dir() { args.predictions.join("predictions.json") } else { args.predictions.clone() };
    let predictions = Predictions::read(&file)?;
    let truths: Vec<Truth> = args.truth.iter().map(|p| Truth::read(p)).collect::<Result<_, _>>()?;
    let mut names: Vec<&str> = truths.iter().map(|t| t.recording.as_str()).collect();
    names.sort_unstable();
    names.dedup();
    if names.len() != truths.len() {
        bail!("two of the truths are of recordings with one name; rename a folder");
    }
    check_units(&predictions, &truths, &file)?;
    let report = evaluate(&predictions, &truths);
    if args.clips {
        print(&per_clip(&report))?;
    }
    print(&text(&report))?;
    if let Some(path) = &args.json {
        write_file(path, json::text(&report)?)?;
    }
    Ok(Answer::Yes)
}

/// A prediction a hundred metres from its truth is in another unit or another world frame, not merely wrong.
fn check_units(predictions: &Predictions, truths: &[Truth], file: &std::path::Path) -> anyhow::Result<()> {
    for truth in truths {
        let distances: Vec<f64> = predictions
            .predictions
            .iter()
            .filter(|p| p.recording == truth.recording)
            .filter_map(|p| Some((p.origin? - truth.clips.get(&p.clip)?.as_ref()?.origin).norm()))
            .collect();
        if let Some(median) = crate::math::stats::median(&distances).filter(|d| *d > 100.0) {
            bail!(
                "{}: recording {}: origins lie {median:.0} from the truth (median): predictions and truth disagree on the \
                 unit (metres) or the world frame",
                file.display(),
                truth.recording
            );
        }
    }
    Ok(())
}

fn text(report: &Report) -> String {
    let mut text = format!(
        "clips that move a joint: {}   answered (Match): {} = {:.3} micro, {:.3} macro\n\
         clips that move none: {}   answered all the same (false positives): {}\n\n",
        report.clips,
        report.answered,
        report.match_share,
        report.match_macro,
        report.distractors,
        report.false_positives
    );
    let header = ["rule", "of", "average", "M", "MA", "MAO"];
    let mut rows = vec![header.map(str::to_owned).to_vec()];
    let mut row = |rule: &str, of: &str, average: &str, s: Option<Shares>| {
        let cell = |f: fn(&Shares) -> f64| s.as_ref().map_or("-".to_owned(), |s| format!("{:.3}", f(s)));
        rows.push(vec![
            rule.to_owned(),
            of.to_owned(),
            average.to_owned(),
            cell(|s| s.m),
            cell(|s| s.ma),
            cell(|s| s.mao),
        ]);
    };
    for r in &report.rules {
        let name = r.rule.name();
        row(name, "all clips", "micro", Some(r.micro));
        row(name, "all clips", "macro", Some(r.macro_));
        row(name, "answered", "micro", r.micro_conditional);
        row(name, "answered", "macro", r.macro_conditional);
    }
    text += &aligned(&rows);
    if !report.unknown.is_empty() {
        text += &format!("\npredictions that no truth knows: {}\n", report.unknown.join(", "));
    }
    text
}

fn per_clip(report: &Report) -> String {
    let header =
        ["recording", "clip", "joint", "type", "axis", "point to point", "hinge off by", "range off by", "box IoU"];
    let mut rows = vec![header.map(str::to_owned).to_vec()];
    for c in &report.per_clip {
        let mut row = vec![c.recording.clone(), c.clip.clone(), c.joint.clone()];
        match &c.measured {
            None => row.push(format!("no answer: {}", c.reason.as_deref().unwrap_or("not in the predictions"))),
            Some(m) => {
                let inward = if m.signed_axis_rad > std::f64::consts::FRAC_PI_2 { ", inward" } else { "" };
                let metres = |d: Option<f64>| d.map_or("-".to_owned(), words::centimetres);
                row.extend([
                    if m.type_right { "right" } else { "wrong" }.to_owned(),
                    format!("{:.1}°{inward}", m.axis_rad.to_degrees()),
                    metres(m.point_to_point_m),
                    metres(m.truth_to_line_m),
                    m.range_error.map_or("-".to_owned(), |r| words::amount(m.kind, r)),
                    m.box_iou.map_or("-".to_owned(), |v| format!("{v:.2}")),
                ]);
            }
        }
        rows.push(row);
    }
    format!("{}\n", aligned(&rows))
}
