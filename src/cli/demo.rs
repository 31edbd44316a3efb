//! `paws demo`.

use std::path::PathBuf;

use clap::Args;

use super::door::Door;
use super::many::Given;
use super::{Answer, Opening, twin};
use crate::config::Config;
use crate::synth::{Changes, SynthOptions};

#[derive(Debug, Args)]
pub struct DemoArgs {
    /// Folder for the recording (kitchen/) and its twin (twin/)
    #[arg(long, value_name = "DIR", default_value = "demo")]
    out: PathBuf,
    /// Show plain boxes: no textures from the images
    #[arg(long)]
    no_textures: bool,
    /// Render flat colours in the place of wood, tiles, stone and brushed steel
    #[arg(long)]
    plain: bool,
}

/// The demo's kitchen: the seed says which.
const SEED: u64 = 7;

pub fn run(args: &DemoArgs) -> anyhow::Result<Answer> {
    let (recording, twin) = (args.out.join("kitchen"), args.out.join("twin"));
    eprintln!("rendering a recording of a kitchen into {} ...", recording.display());
    let options = SynthOptions { seed: SEED, width: 480, parts: 6, ..Default::default() };
    super::synth::write(&options, &Changes { materials: !args.plain, ..Default::default() }, &recording)?;
    eprintln!("making its twin ...");
    let recordings = [recording];
    let (opening, door) = (Opening::default(), Door::default());
    let given = Given { recordings: &recordings, opening, door, one_frame: false, cache: None };
    let wishes = twin::Wishes { steps: true, textures: !args.no_textures };
    twin::make(given, &twin, &Config::default(), wishes, None)
}
