//! `paws export`.

use std::path::{Path, PathBuf};

use anyhow::Context;
use clap::{Args, ValueEnum};

use super::output::write_file;
use super::{Answer, print, shown};
use crate::json;
use crate::validation::Validation;
use crate::{export, twin::Twin};

/// A file format.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Format {
    /// Robot description for ROS, PyBullet, Drake, Pinocchio
    Urdf,
    /// MuJoCo model
    Mjcf,
    /// Binary glTF 2.0
    Gltf,
}

#[derive(Debug, Args)]
pub struct ExportArgs {
    /// A twin.json, or the folder that `paws twin` wrote
    twin: PathBuf,
    /// Formats, separated by commas
    #[arg(long, value_delimiter = ',', default_value = "urdf,mjcf,gltf")]
    format: Vec<Format>,
    /// Folder for scene.urdf, scene.xml, kitchen.xml, scene.glb
    #[arg(long, value_name = "DIR", default_value = ".")]
    out: PathBuf,
}

/// Reads a twin from its file or folder.
pub fn read_twin(path: &Path) -> anyhow::Result<Twin> {
    let file = if path.is_dir() { path.join("twin.json") } else { path.to_owned() };
    Ok(json::read(&file)?)
}

pub fn run(args: &ExportArgs) -> anyhow::Result<Answer> {
    let twin = read_twin(&args.twin)?;
    // With its verdicts, where they lie beside the twin: the same file as `paws twin` wrote.
    let beside = match args.twin.is_dir() {
        true => args.twin.join("validation.json"),
        false => args.twin.with_file_name("validation.json"),
    };
    let verdicts = if beside.is_file() { json::read::<Validation>(&beside)?.words() } else { Vec::new() };
    // Every format is made before the first is written: nothing half-done is left behind.
    let mut files: Vec<(&str, Vec<u8>)> = Vec::new();
    for format in &args.format {
        match format {
            Format::Urdf => files.push(("scene.urdf", export::urdf::write(&twin)?.into_bytes())),
            Format::Mjcf => {
                files.push(("scene.xml", export::mjcf::write(&twin)?.into_bytes()));
                files.push(("kitchen.xml", export::mjcf::write_model(&twin)?.into_bytes()));
            }
            Format::Gltf => files.push(("scene.glb", export::gltf::write(&twin, &verdicts)?)),
        }
    }
    std::fs::create_dir_all(&args.out).with_context(|| shown(&args.out))?;
    for (name, bytes) in files {
        let path = args.out.join(name);
        write_file(&path, bytes)?;
        print(&format!("{}\n", shown(&path)))?;
    }
    Ok(Answer::Yes)
}
