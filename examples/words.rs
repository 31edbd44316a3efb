//! Accuracy with a simulated language model that errs: a table over synthetic kitchens, our method beside the paper's.
//!
//! `cargo run --release --example words -- [clean|realistic|hard] [first seed] [kitchens]`

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use paws_twin::articulation::{Articulation, JointKind};
use paws_twin::config::Config;
use paws_twin::evaluation::{Predictions, Rule, Truth, evaluate};
use paws_twin::fitting;
use paws_twin::geometry::segments::Lsd;
use paws_twin::pipeline;
use paws_twin::reasoning::Reasoner;
use paws_twin::reasoning::heuristic::Geometric;
use paws_twin::recording::Recording;
use paws_twin::report::files::predictions;
use paws_twin::synth::{Recorded, SynthOptions, Tier};

#[path = "../tests/it/simulated.rs"]
mod simulated;

use simulated::{Errors, Simulated};

type Failure = Box<dyn std::error::Error>;

#[allow(clippy::print_stdout, reason = "an example prints")]
fn main() -> Result<(), Failure> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let tier = match args.first().map(String::as_str) {
        Some("clean") => Tier::Clean,
        Some("realistic") => Tier::Realistic,
        None | Some("hard") => Tier::Hard,
        Some(other) => return Err(format!("\"{other}\" is not clean, realistic or hard").into()),
    };
    let first: u64 = args.get(1).map_or(Ok(1001), |s| s.parse())?;
    let count: u64 = args.get(2).map_or(Ok(6), |s| s.parse())?;

    let work = tempfile::tempdir()?;
    let mut folders = Vec::new();
    for seed in first..first + count {
        let folder = work.path().join(format!("kitchen_{seed}"));
        render(&SynthOptions { seed, tier, width: 320, parts: 6 }, &folder)?;
        folders.push(folder);
    }
    let configs = [Config::default(), Config::paper()];
    let geometric = Geometric::of(&configs[0]);
    println!("| model | ours: M | MA | MAO | paper: M | MA | MAO |\n| --- | --- | --- | --- | --- | --- | --- |");
    let none = |config: &Config| row(&folders, config, |_| Ok(Box::new(geometric.clone())));
    println!("| none | {} | {} |", none(&configs[0])?, none(&configs[1])?);
    let random = [0.0, 0.1, 0.2, 0.3, 0.4, 0.5]
        .map(|e| (format!("{:.0} % wrong", 100.0 * e), Errors::Random { kind: e, line: e }));
    let always =
        [JointKind::Revolute, JointKind::Prismatic].map(|k| (format!("always {}", k.word()), Errors::Always(k)));
    for (name, errors) in random.into_iter().chain(always) {
        let shares = |config: &Config| {
            row(&folders, config, |folder| {
                Ok(Box::new(Simulated { geometric: &geometric, truth: joints(folder)?, errors, seed: 1 }))
            })
        };
        println!("| {name} | {} | {} |", shares(&configs[0])?, shares(&configs[1])?);
    }
    Ok(())
}

fn render(options: &SynthOptions, folder: &Path) -> Result<(), Failure> {
    let recorded = Recorded::new(options)?;
    let write = |name: &str, bytes: &[u8]| -> std::io::Result<()> {
        let path = folder.join(name);
        std::fs::create_dir_all(path.parent().unwrap_or(folder))?;
        std::fs::write(path, bytes)
    };
    for (name, text) in recorded.tables()? {
        write(&name, text.as_bytes())?;
    }
    for frame in 0..recorded.frames() {
        for (name, bytes) in recorded.images(frame)? {
            write(&name, &bytes)?;
        }
    }
    Ok(())
}

/// The true joint of every clip that shows one.
fn joints(folder: &Path) -> Result<BTreeMap<String, Articulation>, Failure> {
    let truth = Truth::read(folder)?;
    let known = truth.clips.into_iter().filter_map(|(name, clip)| clip.map(|c| (name, c)));
    Ok(known.map(|(name, c)| (name, Articulation { kind: c.kind, axis: c.axis, origin: c.origin })).collect())
}

/// Shares of all clips of all kitchens, USDNet's rule.
fn row<'a>(
    folders: &[PathBuf],
    config: &Config,
    reasoner: impl Fn(&Path) -> Result<Box<dyn Reasoner + 'a>, Failure>,
) -> Result<String, Failure> {
    let (mut all, mut truths) = (Predictions::default(), Vec::new());
    for folder in folders {
        let recording = Recording::open(folder)?;
        let scene = pipeline::infer(&recording, config, &Lsd, &*reasoner(folder)?, &|_, _, _| {})?;
        let twin = fitting::fit(&scene, &recording.up(), &config.fitting, &config.priors);
        all.predictions.extend(predictions(&scene, &twin).predictions);
        truths.push(Truth::read(folder)?);
    }
    let report = evaluate(&all, &truths);
    let shares = report.rules.iter().find(|r| r.rule == Rule::UsdnetMaoSt).map(|r| r.micro).ok_or("no such rule")?;
    Ok(format!("{:.3} | {:.3} | {:.3}", shares.m, shares.ma, shares.mao))
}
