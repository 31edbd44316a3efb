//! `paws demo`.

use std::path::PathBuf;

use clap::Args;

use super::{Answer, twin};
use crate::config::Config;

#[derive(Debug, Args)]
pub struct DemoArgs {
    /// Folder for the recording and its twin
    #[arg(long, value_name = "DIR", default_value = "twin")]
    out: PathBuf,
}

/// The demo's kitchen: the seed says which.
const SEED: u64 = 7;

pub fn run(args: &DemoArgs) -> anyhow::Result<Answer> {
    let scratch = args.out.with_file_name(format!(
        "{}-recording",
        args.out.file_name().map_or_else(|| "twin".into(), |n| n.to_string_lossy().into_owned())
    ));
    eprintln!("rendering a recording of a kitchen into {} ...", scratch.display());
    super::synth::write(&crate::synth::Options { seed: SEED, ..Default::default() }, &scratch)?;
    eprintln!("making its twin ...");
    twin::make(&scratch, &args.out, &Config::default(), true)
}
