//! Seconds that a reader of `paws import` takes for a source, read again and again, as JSON:
//!
//! `cargo run --release --example read_source -- FORMAT PATH [REPEATS]`. FORMAT is one of `paws import --list`, or `npy` for depth in
//! metres as numpy saves it. Nothing is joined or written; images are not decoded. `benches/import_side_by_side.py` runs it.

#![allow(clippy::print_stdout, reason = "its output")]

use std::hint::black_box;
use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::Context as _;
use paws_twin::import::blob::Blob;
use paws_twin::import::capture::{Depth, DepthCoding};
use paws_twin::import::{ImportOptions, decode, formats};

fn main() -> anyhow::Result<()> {
    let mut words = std::env::args().skip(1);
    let name = words.next().context("which format? FORMAT PATH [REPEATS]")?;
    let path = PathBuf::from(words.next().context("which source? FORMAT PATH [REPEATS]")?);
    let repeats = words.next().map_or(Ok(1), |n| n.parse::<usize>()).context("REPEATS is a number")?;
    let mut secs = Vec::new();
    for _ in 0..repeats {
        let began = Instant::now();
        read(&name, &path)?;
        secs.push(began.elapsed().as_secs_f64());
    }
    println!("{}", serde_json::to_string(&secs)?);
    Ok(())
}

/// Reads the source once and drops what was read.
fn read(name: &str, path: &Path) -> anyhow::Result<()> {
    if name == "npy" {
        let how = Depth::of(DepthCoding::Npy { unit_m: 1.0 }, Vec::new());
        black_box(decode::depth(&Blob::File(path.to_owned()), None, &how)?);
        return Ok(());
    }
    let format = formats::named(name).with_context(|| format!("{name}: no such format, see `paws import --list`"))?;
    black_box((format.read)(path, &ImportOptions::default())?);
    Ok(())
}
