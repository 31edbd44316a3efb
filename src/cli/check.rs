//! `paws check`: the static points of "simulation-ready", for anybody's files.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use clap::Args;
use serde::Serialize;

use super::{Answer, print, shown};
use crate::json;
use crate::model::check::{self, Point, Verdict};
use crate::model::{self, glb};
use crate::report::table::aligned;
use crate::twin::Twin;

#[derive(Debug, Args)]
pub struct CheckArgs {
    /// URDF, MJCF and GLB files, or folders with such files; a folder of `paws twin` is also held to its twin.json
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
    points: Vec<Point>,
    /// What was not read.
    notes: Vec<String>,
}

/// More of one kind are counted, not printed.
const SHOWN: usize = 20;

pub fn run(args: &CheckArgs) -> anyhow::Result<Answer> {
    let mut all = Vec::new();
    for input in &args.inputs {
        if input.is_dir() {
            let twin = match input.join("twin.json") {
                file if file.is_file() => Some(super::export::read_twin(&file)?),
                _ => None,
            };
            for file in models_in(input)? {
                all.push(checked(&file, twin.as_ref())?);
            }
        } else {
            all.push(checked(input, None)?);
        }
    }
    print(&if args.json { json::text(&all)? } else { table(&all) })?;
    // What was not judged is no yes.
    let is_no = |p: &Point| matches!(p.verdict, Verdict::Fail | Verdict::NotJudged);
    let no = all.iter().flat_map(|c| &c.points).any(is_no);
    Ok(if no { Answer::No } else { Answer::Yes })
}

/// The models right in a folder, by name.
fn models_in(dir: &Path) -> anyhow::Result<Vec<PathBuf>> {
    let mut found = BTreeSet::new();
    for entry in std::fs::read_dir(dir).with_context(|| shown(dir))? {
        let path = entry.with_context(|| shown(dir))?.path();
        let is_model = path.is_file()
            && match extension(&path).as_str() {
                "urdf" | "glb" | "mjcf" => true,
                // Much else is XML too.
                "xml" => model::root_name(&path).is_ok_and(|name| name == "mujoco"),
                _ => false,
            };
        if is_model {
            found.insert(path);
        }
    }
    if found.is_empty() {
        bail!("{}: no URDF, MJCF (.xml, .mjcf) or GLB file in it", shown(dir));
    }
    Ok(found.into_iter().collect())
}

fn extension(path: &Path) -> String {
    path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase()).unwrap_or_default()
}

fn checked(path: &Path, twin: Option<&Twin>) -> anyhow::Result<Checked> {
    let (points, notes) = if extension(path) == "glb" {
        let scene = glb::read(path)?;
        (check::scene(&scene, twin), scene.notes)
    } else {
        let model = model::read(path)?;
        (check::model(&model, twin), model.notes)
    };
    Ok(Checked { file: shown(path), points, notes })
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
                Some(Verdict::Pass) => "ok",
                Some(Verdict::Fail) => "FAIL",
                Some(Verdict::NotJudged) => "?",
                Some(Verdict::NotApplicable) | None => "-",
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
