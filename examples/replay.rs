//! How long one replay of a recorded hand takes in rapier, clip by clip of a twin.
//!
//! `cargo run --release --example replay -- TWIN`
//!
//! TWIN is a folder that `paws twin` wrote. Told is, as JSON lines, the median of five runs on one thread, the world's making
//! included; `benches/replay_side_by_side.py` sets other simulators beside it.

#![allow(clippy::print_stdout, clippy::print_stderr, reason = "a command")]

use std::path::Path;
use std::time::Instant;

use paws_twin::config::Config;
use paws_twin::error::Result;
use paws_twin::hands::Trajectory;
use paws_twin::json;
use paws_twin::math::{Vector, stats};
use paws_twin::twin::Twin;
use paws_twin::validation::{Drive, Surroundings, Validation, simulate};
use serde::Deserialize;

/// A joint's recorded hands.
#[derive(Deserialize)]
struct Hands {
    joint: String,
    clips: Vec<(String, Trajectory)>,
}

fn main() -> Result<()> {
    let Some(folder) = std::env::args().nth(1) else {
        eprintln!("usage: replay TWIN");
        std::process::exit(2);
    };
    let at = |name: &str| Path::new(&folder).join(name);
    let config = Config::read(&at("config.toml"))?.validation;
    let twin: Twin = json::read(&at("twin.json"))?;
    let hands: Vec<Hands> = json::read(&at("trajectories.json"))?;
    let proof: Validation = json::read(&at("validation.json"))?;
    let up = Vector::z();
    for (i, furniture) in twin.furniture.iter().enumerate() {
        let part = &furniture.part;
        let around = Surroundings::of(&twin, i, &up);
        let of_part = hands.iter().filter(|h| h.joint == part.id).flat_map(|h| &h.clips);
        for (name, hand) in of_part {
            let checks = proof.joints.iter().filter(|j| j.id == part.id).flat_map(|j| &j.clips);
            let Some(check) = checks.into_iter().find(|c| c.clip == *name) else { continue };
            let first = hand.samples.first().map_or(0.0, |s| s.time_secs);
            let times_secs = hand.samples.iter().map(|s| s.time_secs - first).collect();
            let drive = Drive { times_secs, path: hand.positions(), grip: check.replay.grip, back: false };
            let mut secs = Vec::new();
            let mut rms_m = f64::NAN;
            for _ in 0..5 {
                let start = Instant::now();
                rms_m = simulate(part, &part.joint.articulation, part.joint.upper, &around, &drive, &config)?.rms_m;
                secs.push(start.elapsed().as_secs_f64());
            }
            let secs = stats::median(&secs).unwrap_or(f64::NAN);
            println!("{}", serde_json::json!({ "part": part.id, "clip": name, "secs": secs, "rms_m": rms_m }));
        }
    }
    Ok(())
}
