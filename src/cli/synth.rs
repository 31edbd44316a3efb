//! `paws synth`.

use std::path::{Path, PathBuf};

use anyhow::bail;
use clap::Args;

use super::output::{Kind, Output};
use super::progress::Steps;
use super::{Answer, print, shown};
use crate::synth::{self, Changes, SynthOptions, Tier};
use crate::{export, json};

#[derive(Debug, Args)]
pub struct SynthArgs {
    /// Which kitchen and which person; below 1000 for development, from 1000 on for reports only
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// How noisy the recording is
    #[arg(long, value_enum, default_value_t = Tier::Realistic)]
    tier: Tier,
    /// Image width in pixels (height is three quarters of it)
    #[arg(long, default_value_t = 320, value_parser = clap::value_parser!(u32).range(64..=2048))]
    width: u32,
    /// Parts that are opened and closed
    #[arg(long, default_value_t = 4, value_parser = clap::value_parser!(u32).range(1..=12))]
    parts: u32,
    /// Clips of each part, other parts' between them (tiers t0 to nonm) [default: 2]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=20))]
    clips_per_part: Option<u32>,
    /// Standard deviation of hand positions in each direction, outliers apart
    #[arg(long, value_name = "CM")]
    hand_noise: Option<f64>,
    /// Relative standard deviation of the hands' distance, the same for a whole clip
    #[arg(long, value_name = "SHARE")]
    depth_bias: Option<f64>,
    /// Hand samples with contact that remain of each clip; all others are left out
    #[arg(long, value_name = "K", value_parser = clap::value_parser!(u32).range(1..))]
    few_hands: Option<u32>,
    /// Share of clips whose noun is of the wrong joint type
    #[arg(long, value_name = "SHARE")]
    word_error: Option<f64>,
    /// Share of clips in whose frames the mask covers a neighbouring part, too
    #[arg(long, value_name = "SHARE")]
    mask_error: Option<f64>,
    /// Write no masks
    #[arg(long)]
    no_masks: bool,
    /// Which take of the kitchen of this seed: the same kitchen and parts, other motions, views and errors
    #[arg(long, value_name = "N", default_value_t = 0)]
    take: u64,
    /// A world of the recording's own, as every start of a headset makes one: turned and moved, which ground_truth.json tells.
    /// Otherwise all takes of a kitchen have one world
    #[arg(long)]
    own_frame: bool,
    /// Surfaces of wood, tiles, stone and brushed steel in the place of flat colours; all but the pictures stays the same bytes
    #[arg(long)]
    materials: bool,
    /// Folder for the recording
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Folder for the true kitchen: scene.xml, twin.json and ground_truth.json, to execute primitives on it
    /// (docs/primitives.md); the parts are the truth's, not the recording's
    #[arg(long, value_name = "DIR")]
    kitchen: Option<PathBuf>,
}

pub fn run(args: &SynthArgs) -> anyhow::Result<Answer> {
    let options =
        SynthOptions { seed: args.seed, tier: args.tier, width: args.width as usize, parts: args.parts as usize };
    let changes = Changes {
        clips_per_part: args.clips_per_part.map(|n| n as usize),
        hand_noise_m: args.hand_noise.map(|cm| 0.01 * cm),
        depth_bias: args.depth_bias,
        few_hands: args.few_hands.map(|n| n as usize),
        word_error: args.word_error,
        mask_error: args.mask_error,
        no_masks: args.no_masks,
        take: args.take,
        own_world: args.own_frame,
        materials: args.materials,
    };
    if let Some(kitchen) = &args.kitchen {
        let [a, b] = [std::path::absolute(kitchen)?, std::path::absolute(&args.out)?];
        if a.starts_with(&b) || b.starts_with(&a) {
            bail!("{}: is in --out, or --out in it; choose another --kitchen", shown(kitchen));
        }
        write_kitchen(&options, &changes, kitchen)?;
    }
    write(&options, &changes, &args.out)?;
    for made in args.kitchen.iter().chain([&args.out]) {
        print(&format!("{}\n", shown(made)))?;
    }
    Ok(Answer::Yes)
}

/// Writes the true kitchen into a folder.
fn write_kitchen(options: &SynthOptions, changes: &Changes, out: &Path) -> anyhow::Result<()> {
    let output = Output::new(out, Kind::Twin, &[])?;
    let recording = synth::Recorded::varied(options, changes)?;
    let twin = recording.twin();
    output.write("scene.xml", export::mjcf::write(&twin, None)?)?;
    output.write("twin.json", json::text(&twin)?)?;
    for (name, text) in recording.tables()?.into_iter().filter(|(name, _)| name == "ground_truth.json") {
        output.write(&name, text)?;
    }
    output.finish()
}

/// Renders a recording into a folder.
pub fn write(options: &SynthOptions, changes: &Changes, out: &Path) -> anyhow::Result<()> {
    let output = Output::new(out, Kind::Recording, &[])?;
    let recording = synth::Recorded::varied(options, changes)?;
    for (name, text) in recording.tables()? {
        output.write(&name, text)?;
    }
    let steps = Steps::new();
    let total = recording.frames();
    for first in (0..total).step_by(16) {
        use rayon::prelude::*;
        let rendered: Vec<Vec<(String, Vec<u8>)>> = (first..(first + 16).min(total))
            .into_par_iter()
            .map(|frame| recording.images(frame))
            .collect::<crate::error::Result<_>>()?;
        for (name, bytes) in rendered.into_iter().flatten() {
            output.write(&name, bytes)?;
        }
        steps.report("rendering", (first + 16).min(total), total);
    }
    steps.finish();
    output.finish()
}
