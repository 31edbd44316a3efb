//! `paws check`: the static points of "simulation-ready", for anybody's files.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use clap::Args;
use serde::Serialize;

use super::{Answer, print, shown};
use crate::json;
use crate::model::check::{self, CheckedPoint, PointVerdict};
use crate::model::{self, glb};
use crate::report::table::aligned;
use crate::twin::Twin;

#[derive(Debug, Args)]
pub struct CheckArgs {
    /// URDF, MJCF and glTF files (.glb, .gltf), or folders with such files; a folder of `paws twin` is also held to its
    /// twin.json. A file that cannot be read says why; the others are judged
    #[arg(required = true)]
    inputs: Vec<PathBuf>,
    /// Print JSON instead of a table
    #[arg(long)]
    json: bool,
}

/// A file's answers.
#[derive(Debug, Serialize)]
struct Checked {
    file: String,
    /// Why it could not be read; there are no points then.
    #[serde(skip_serializing_if = "Option::is_none")]
    error: Option<String>,
    points: Vec<CheckedPoint>,
    /// What was not read.
    notes: Vec<String>,
}

/// More of one kind are counted, not printed.
const SHOWN: usize = 20;

pub fn run(args: &CheckArgs) -> anyhow::Result<Answer> {
    let all: Vec<Checked> = args.inputs.iter().flat_map(|input| judged(input)).collect();
    let errors: Vec<&str> = all.iter().filter_map(|c| c.error.as_deref()).collect();
    if errors.len() == all.len() {
        bail!("{}", errors.join("\n"));
    }
    for error in &errors {
        eprintln!("error: {error}");
    }
    print(&if args.json { json::text(&all)? } else { table(&all) })?;
    // What was not judged is no yes.
    let is_no = |p: &CheckedPoint| matches!(p.verdict, PointVerdict::Fail | PointVerdict::NotJudged);
    let no = all.iter().flat_map(|c| &c.points).any(is_no);
    Ok(if no || !errors.is_empty() { Answer::No } else { Answer::Yes })
}

/// A file, or the models of a folder.
fn judged(input: &Path) -> Vec<Checked> {
    if !input.is_dir() {
        return vec![told(input, checked(input, None))];
    }
    let mut all = Vec::new();
    let twin_file = input.join("twin.json");
    let twin = if twin_file.is_file() { super::export::read_twin(&twin_file).map(Some) } else { Ok(None) };
    let twin = twin.unwrap_or_else(|e| {
        all.push(told(&twin_file, Err(e)));
        None
    });
    match models_in(input) {
        Ok(files) => all.extend(files.iter().map(|file| told(file, checked(file, twin.as_ref())))),
        Err(e) => all.push(told(input, Err(e))),
    }
    all
}

/// What is told of a file, be it why it was not read.
fn told(file: &Path, result: anyhow::Result<(Vec<CheckedPoint>, Vec<String>)>) -> Checked {
    let (error, (points, notes)) = match result {
        Ok(said) => (None, said),
        Err(e) => (Some(format!("{e:#}")), (Vec::new(), Vec::new())),
    };
    Checked { file: shown(file), error, points, notes }
}

/// The models right in a folder, by name.
fn models_in(dir: &Path) -> anyhow::Result<Vec<PathBuf>> {
    let mut found = BTreeSet::new();
    for entry in std::fs::read_dir(dir).with_context(|| shown(dir))? {
        let path = entry.with_context(|| shown(dir))?.path();
        if path.is_file() && model::is_model(&path) {
            found.insert(path);
        }
    }
    if found.is_empty() {
        bail!("{}: no URDF (.urdf, .xml), MJCF (.xml, .mjcf) or glTF (.glb, .gltf) file in it", shown(dir));
    }
    Ok(found.into_iter().collect())
}

/// Points and notes of one file.
fn checked(path: &Path, twin: Option<&Twin>) -> anyhow::Result<(Vec<CheckedPoint>, Vec<String>)> {
    if model::is_gltf(path) {
        let scene = glb::read(path)?;
        return Ok((check::scene(&scene, twin), scene.notes));
    }
    let model = model::read(path)?;
    Ok((check::model(&model, twin), model.notes))
}

fn table(all: &[Checked]) -> String {
    let mut header = vec!["point".to_owned()];
    header.extend(all.iter().map(|c| c.file.clone()));
    let mut rows = vec![header];
    for (id, title) in check::POINTS {
        let mut row = vec![format!("{id:>2} {title}")];
        row.extend(all.iter().map(|c| {
            let verdict = c.points.iter().find(|p| p.id == id).map(|p| p.verdict);
            match verdict {
                None if c.error.is_some() => "not read",
                Some(PointVerdict::Pass) => "ok",
                Some(PointVerdict::Fail) => "FAIL",
                Some(PointVerdict::NotJudged) => "?",
                Some(PointVerdict::NotApplicable) | None => "-",
            }
            .to_owned()
        }));
        rows.push(row);
    }
    let mut text = aligned(&rows);
    for c in all {
        for p in &c.points {
            text += &listed(&format!("{}, point {}, wrong", c.file, p.id), &p.faults);
        }
        for p in &c.points {
            text += &listed(&format!("{}, point {}, worth knowing", c.file, p.id), &p.told);
        }
        text += &listed(&format!("{}, not read or simplified", c.file), &c.notes);
    }
    text
}

fn listed(title: &str, lines: &[String]) -> String {
    if lines.is_empty() {
        return String::new();
    }
    let mut text = format!("\n{title}:\n");
    for line in lines.iter().take(SHOWN) {
        text += &format!("  {line}\n");
    }
    if lines.len() > SHOWN {
        text += &format!("  and {} more\n", lines.len() - SHOWN);
    }
    text
}
