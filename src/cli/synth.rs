//! `paws synth`.

use std::path::{Path, PathBuf};

use clap::Args;

use super::output::{Kind, Output};
use super::progress::Steps;
use super::{Answer, print, shown};
use crate::synth::{self, Options, Tier};

#[derive(Debug, Args)]
pub struct SynthArgs {
    /// Which kitchen and which person
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
    /// Folder for the recording
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

pub fn run(args: &SynthArgs) -> anyhow::Result<Answer> {
    let options = Options { seed: args.seed, tier: args.tier, width: args.width as usize, parts: args.parts as usize };
    write(&options, &args.out)?;
    print(&format!("{}\n", shown(&args.out)))?;
    Ok(Answer::Yes)
}

/// Renders a recording into a folder.
pub fn write(options: &Options, out: &Path) -> anyhow::Result<()> {
    let output = Output::new(out, Kind::Recording, &[])?;
    let recording = synth::Recorded::new(options)?;
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
