//! `paws ablate`: what each choice is worth, the feedback of physics (as `paws infer --physics` has it) among them.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use clap::Args;
use serde::Serialize;

use super::infer::predict;
use super::output::write_file;
use super::words::{self as model, Asked, WordsArgs};
use super::{Answer, Opening, evaluate as truth, print, shown};
use crate::config::Config;
use crate::evaluation::{EvaluationReport, Paired, Predictions, Rule, Truth, compare, evaluate};
use crate::json;
use crate::recording::Recording;
use crate::report::accuracy;
use crate::report::table::aligned;
use crate::vlm::Usage;

/// The configurations that are compared where none are named.
const BUILT_IN: [(&str, &str); 25] = [
    ("ours", include_str!("../../examples/ablations/ours.toml")),
    ("ours_clustered_room", include_str!("../../examples/ablations/ours_clustered_room.toml")),
    ("ours_no_closed_state", include_str!("../../examples/ablations/ours_no_closed_state.toml")),
    ("ours_no_contact_from_depth", include_str!("../../examples/ablations/ours_no_contact_from_depth.toml")),
    ("ours_no_depth_scale", include_str!("../../examples/ablations/ours_no_depth_scale.toml")),
    ("ours_no_face_normal", include_str!("../../examples/ablations/ours_no_face_normal.toml")),
    ("ours_no_feedback", include_str!("../../examples/ablations/ours_no_feedback.toml")),
    ("ours_no_hand_filter", include_str!("../../examples/ablations/ours_no_hand_filter.toml")),
    ("ours_no_merge", include_str!("../../examples/ablations/ours_no_merge.toml")),
    ("ours_no_names", include_str!("../../examples/ablations/ours_no_names.toml")),
    ("ours_no_occlusion", include_str!("../../examples/ablations/ours_no_occlusion.toml")),
    ("ours_no_second_look", include_str!("../../examples/ablations/ours_no_second_look.toml")),
    ("ours_paper_rule", include_str!("../../examples/ablations/ours_paper_rule.toml")),
    ("ours_uninformed_no_names", include_str!("../../examples/ablations/ours_uninformed_no_names.toml")),
    ("ours_uninformed_priors", include_str!("../../examples/ablations/ours_uninformed_priors.toml")),
    ("ours_unprojected_lines", include_str!("../../examples/ablations/ours_unprojected_lines.toml")),
    ("ours_untempered", include_str!("../../examples/ablations/ours_untempered.toml")),
    ("paper", include_str!("../../examples/ablations/paper.toml")),
    ("paper_closed_state", include_str!("../../examples/ablations/paper_closed_state.toml")),
    ("paper_few_views", include_str!("../../examples/ablations/paper_few_views.toml")),
    ("paper_gravity_room", include_str!("../../examples/ablations/paper_gravity_room.toml")),
    ("paper_no_hand_filter", include_str!("../../examples/ablations/paper_no_hand_filter.toml")),
    ("paper_s", include_str!("../../examples/ablations/paper_s.toml")),
    ("paper_s_places", include_str!("../../examples/ablations/paper_s_places.toml")),
    ("paper_triangulated_lines", include_str!("../../examples/ablations/paper_triangulated_lines.toml")),
];

#[derive(Debug, Args)]
pub struct AblateArgs {
    /// Folders of recordings with a ground_truth.json
    #[arg(required = true)]
    recordings: Vec<PathBuf>,
    /// A configuration with its name in the table, once for each; the others are compared with the first
    #[arg(long, value_name = "NAME=FILE", value_parser = named)]
    config: Vec<(String, PathBuf)>,
    /// All *.toml files of a folder, in the order of their names [default: the built-in set, examples/ablations]
    #[arg(long, value_name = "DIR")]
    configs: Option<PathBuf>,
    /// Write every configuration's whole report as JSON to this file
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    #[command(flatten)]
    opening: Opening,
    #[command(flatten)]
    words: WordsArgs,
}

/// What one configuration is worth.
#[derive(Serialize)]
struct Row {
    config: String,
    report: EvaluationReport,
    /// The difference to the first configuration.
    #[serde(skip_serializing_if = "Option::is_none")]
    against_first: Option<Vec<Paired>>,
}

pub fn run(args: &AblateArgs) -> anyhow::Result<Answer> {
    let configs = args.read()?;
    let asked = args.words.open()?;
    if asked.as_ref().is_some_and(Asked::is_dry) {
        bail!("--dry-run counts for one configuration: use it with `paws infer --config FILE`");
    }
    let (opened, truths) = args.opened()?;
    let mut whole = opened.len() == args.recordings.len();
    if truths.iter().all(|t| t.clips.values().all(Option::is_none)) {
        bail!("no clip of these recordings moves a joint: there is nothing to compare");
    }
    let mut rows: Vec<Row> = Vec::new();
    let mut total: Option<Usage> = None;
    for (config, values) in configs {
        eprintln!("{config} ...");
        let mut all = Predictions::default();
        for recording in &opened {
            let predicted = match predict(recording, &values, asked.as_ref(), None) {
                Ok(predicted) => predicted,
                Err(error) if opened.len() == 1 => return Err(error),
                // Its clips have no answer then, which is wrong.
                Err(error) => {
                    eprintln!("no answer under {config}: {error:#}");
                    whole = false;
                    continue;
                }
            };
            total = model::added(total, predicted.usage);
            all.predictions.extend(predicted.predictions.predictions);
        }
        let report = evaluate(&all, &truths);
        let against_first = rows.first().and_then(|first| compare(&report, &first.report));
        rows.push(Row { config, report, against_first });
    }
    print(&table(&rows))?;
    if let Some(path) = &args.json {
        write_file(path, json::text(&rows)?)?;
    }
    if let Some((asked, usage)) = asked.as_ref().zip(total) {
        eprintln!("{}", usage.sentence(asked.model()));
    }
    Ok(if whole { Answer::Yes } else { Answer::No })
}

/// A name and a file.
fn named(text: &str) -> Result<(String, PathBuf), String> {
    match text.split_once('=') {
        Some((name, file)) if !name.is_empty() && !file.is_empty() => Ok((name.to_owned(), PathBuf::from(file))),
        _ => Err("a configuration is NAME=FILE".to_owned()),
    }
}

impl AblateArgs {
    /// The recordings that can be read, each with its truth, of which the inference sees nothing. One that cannot costs only itself.
    fn opened(&self) -> anyhow::Result<(Vec<Recording>, Vec<Truth>)> {
        let open = |folder: &Path| -> crate::error::Result<(Recording, Truth)> {
            Ok((self.opening.open(folder)?, Truth::read(folder)?))
        };
        let (opened, truths): (Vec<_>, Vec<_>) = truth::opened(&self.recordings, open)?.into_iter().unzip();
        truth::check_names(&truths)?;
        Ok((opened, truths))
    }

    /// The configurations in the order of the table.
    fn read(&self) -> anyhow::Result<Vec<(String, Config)>> {
        let mut all = Vec::new();
        for (name, file) in &self.config {
            all.push((name.clone(), Config::read(file)?));
        }
        if let Some(dir) = &self.configs {
            all.extend(of_folder(dir)?);
        }
        if all.is_empty() {
            all = built_in()?;
        }
        let names: BTreeSet<&str> = all.iter().map(|(name, _)| name.as_str()).collect();
        if names.len() != all.len() {
            bail!("two configurations have one name");
        }
        Ok(all)
    }
}

fn of_folder(dir: &Path) -> anyhow::Result<Vec<(String, Config)>> {
    let mut files = Vec::new();
    for entry in std::fs::read_dir(dir).with_context(|| shown(dir))? {
        let path = entry.with_context(|| shown(dir))?.path();
        if path.extension().is_some_and(|e| e == "toml") {
            files.push(path);
        }
    }
    if files.is_empty() {
        bail!("{}: no *.toml file", dir.display());
    }
    files.sort_by(|a, b| a.file_stem().cmp(&b.file_stem()));
    let mut all = Vec::new();
    for file in files {
        let name = file.file_stem().map_or_else(String::new, |s| s.to_string_lossy().into_owned());
        all.push((name, Config::read(&file)?));
    }
    Ok(all)
}

fn built_in() -> anyhow::Result<Vec<(String, Config)>> {
    let mut all = Vec::new();
    for (name, text) in BUILT_IN {
        let file = PathBuf::from(format!("examples/ablations/{name}.toml"));
        all.push((name.to_owned(), Config::parse(text, &file)?));
    }
    Ok(all)
}

/// Shares of all clips; the last columns are the difference to the first row.
fn table(rows: &[Row]) -> String {
    let header =
        ["config", "coverage", "M", "MA", "MAO point", "MAO line", "STRICT", "SIM", "MAO line: less the first", "95 %"];
    let mut cells = vec![header.map(str::to_owned).to_vec()];
    for row in rows {
        let of = |rule: Rule| row.report.rules.iter().find(|r| r.rule == rule).map(|r| r.micro);
        let share = |value: Option<f64>| value.map_or_else(|| "-".to_owned(), |v| format!("{v:.3}"));
        let line = row.against_first.iter().flatten().find(|p| p.rule == Rule::PawsLine);
        cells.push(vec![
            row.config.clone(),
            share(Some(row.report.match_share)),
            share(of(Rule::Paws).map(|s| s.m)),
            share(of(Rule::Paws).map(|s| s.ma)),
            share(of(Rule::Paws).map(|s| s.mao)),
            share(of(Rule::PawsLine).map(|s| s.mao)),
            share(of(Rule::Strict).map(|s| s.mao)),
            share(of(Rule::Sim).map(|s| s.mao)),
            line.map_or_else(|| "-".to_owned(), |p| format!("{:+.3}", p.difference.mao)),
            line.and_then(|p| p.interval).map_or_else(|| "-".to_owned(), |i| accuracy::signed_interval(i.mao)),
        ]);
    }
    let clips = rows.first().map_or(0, |r| r.report.clips);
    format!("{}\nOf all {clips} clips that move a joint; no answer is wrong.\n", aligned(&cells))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_built_in_set_is_the_folder_and_begins_with_ours() {
        let dir = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/ablations");
        let all = built_in().unwrap();
        assert_eq!(all, of_folder(&dir).unwrap());
        assert_eq!(all[0], ("ours".to_owned(), Config::default()));
        for (name, expected) in [("paper", Config::paper()), ("paper_s", Config::paper_s())] {
            assert!(all.iter().any(|(n, config)| n == name && *config == expected), "{name}");
        }
        for (i, (name, config)) in all.iter().enumerate() {
            assert!(all[..i].iter().all(|(_, earlier)| earlier != config), "{name} is another one under a new name");
            let base = if name.starts_with("paper") { Config::paper() } else { Config::default() };
            assert_eq!(config.method, base.method, "{name}");
        }
        assert!(BUILT_IN.iter().all(|(_, text)| text.starts_with("# ")));
    }

    #[test]
    fn a_configuration_needs_a_name_and_a_file() {
        assert_eq!(named("a=b.toml"), Ok(("a".to_owned(), PathBuf::from("b.toml"))));
        assert!(named("b.toml").is_err() && named("=b").is_err() && named("a=").is_err());
    }
}
