//! `paws demo`.

use std::path::PathBuf;

use clap::Args;

use super::door::Door;
use super::{Answer, Opening, twin};
use crate::config::Config;

#[derive(Debug, Args)]
pub struct DemoArgs {
    /// Folder for the recording (kitchen/) and its twin (twin/)
    #[arg(long, value_name = "DIR", default_value = "demo")]
    out: PathBuf,
    /// Leave the furniture and the room the plain boxes that they collide as
    #[arg(long)]
    no_textures: bool,
}

/// The demo's kitchen: the seed says which.
const SEED: u64 = 7;

pub fn run(args: &DemoArgs) -> anyhow::Result<Answer> {
    let (recording, twin) = (args.out.join("kitchen"), args.out.join("twin"));
    eprintln!("rendering a recording of a kitchen into {} ...", recording.display());
    super::synth::write(&crate::synth::Options { seed: SEED, width: 480, parts: 6, ..Default::default() }, &recording)?;
    eprintln!("making its twin ...");
    let given = twin::Given { recording: &recording, opening: Opening::default(), door: Door::default() };
    let wishes = twin::Wishes { steps: true, textures: !args.no_textures };
    twin::make(given, &twin, &Config::default(), wishes, None)
}
