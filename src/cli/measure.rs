//! `paws measure`: what the steps before the joint inference, and the boxes of the room, are worth.

use std::path::PathBuf;

use clap::Args;

use super::output::write_file;
use super::progress::Steps;
use super::{Answer, ConfigFile, Opening, evaluate, print};
use crate::evaluation::room_fit;
use crate::evaluation::stages::{SceneTruth, Stages, measure, measure_segments};
use crate::fitting;
use crate::geometry::segments::Lsd;
use crate::json;
use crate::math::stats;
use crate::pipeline;
use crate::reasoning::heuristic::Geometric;
use crate::report::table::aligned;

#[derive(Debug, Args)]
pub struct MeasureArgs {
    /// Recordings with a ground_truth.json
    #[arg(required = true)]
    recordings: Vec<PathBuf>,
    /// One line a recording as well
    #[arg(long)]
    each: bool,
    /// Write all numbers as JSON to this file
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    #[command(flatten)]
    opening: Opening,
    #[command(flatten)]
    config: ConfigFile,
}

pub fn run(args: &MeasureArgs) -> anyhow::Result<Answer> {
    let config = args.config.read()?;
    let opened =
        evaluate::opened(&args.recordings, |folder| Ok((args.opening.open(folder)?, SceneTruth::read(folder)?)))?;
    let mut rows = vec![HEADER.map(str::to_owned).to_vec()];
    let mut all: Vec<Stages> = Vec::new();
    let steps = Steps::new();
    for (i, (recording, truth)) in opened.iter().enumerate() {
        steps.report("measuring", i, opened.len());
        let reasoner = Geometric::of(&config);
        let scene = pipeline::infer(recording, &config, &Lsd, &reasoner, &|_, _, _| {})?;
        let mut stages = measure(&scene, truth);
        measure_segments(recording, truth, &Lsd, &config.geometry.detector, &mut stages)?;
        let twin = fitting::fit(&scene, &recording.up(), &config.fitting, &config.priors);
        stages.room = room_fit::measure(recording, &scene, &twin, &config.fitting)?;
        if args.each {
            rows.push(row(&recording.name, &stages));
        }
        all.push(stages);
    }
    steps.finish();
    rows.push(row(&format!("all ({})", all.len()), &Stages::pooled(&all)));
    print(&aligned(&rows))?;
    if let Some(path) = &args.json {
        write_file(path, json::text(&all)?)?;
    }
    Ok(if opened.len() == args.recordings.len() { Answer::Yes } else { Answer::No })
}

const HEADER: [&str; 15] = [
    "recordings",
    "clips",
    "localised",
    "2D edges seen",
    "hinge line off by",
    "and by",
    "recall 3°, 3 cm",
    "precision",
    "room frame off by",
    "front covered",
    "depth scale off by",
    "room boxes",
    "air filled",
    "surface missing",
    "openings blocked",
];

fn row(name: &str, s: &Stages) -> Vec<String> {
    let share = |v: Option<f64>| v.map_or("-".to_owned(), |v| format!("{v:.2}"));
    let percent = |v: Option<f64>| v.map_or("-".to_owned(), |v| format!("{:.1} %", 100.0 * v));
    let best = s.best_line();
    let median = |values: &[f64]| stats::median(values);
    vec![
        name.to_owned(),
        s.clips.to_string(),
        s.localized.to_string(),
        share(s.edges_seen()),
        best.map_or("-".to_owned(), |b| format!("{:.1} cm", 100.0 * b[0])),
        best.map_or("-".to_owned(), |b| format!("{:.2}°", b[1].to_degrees())),
        share(s.recall()),
        share(s.precision()),
        median(&s.manhattan_rad).map_or("-".to_owned(), |a| format!("{:.2}°", a.to_degrees())),
        share(median(&s.coverage)),
        percent(median(&s.depth_scale_error)),
        s.room.room_boxes.to_string(),
        percent(s.room.filled()),
        percent(s.room.missing()),
        s.room.blocked_openings.to_string(),
    ]
}
