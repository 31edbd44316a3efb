//! `paws export`.

use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use clap::{Args, ValueEnum};
use rayon::prelude::*;

use super::output::{restore, write_file};
use super::{Answer, print, shown};
use crate::config::Config;
use crate::fitting::joints::{self, JointsFile};
use crate::validation::Validation;
use crate::{export, json, twin::Twin};

/// A file format.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Format {
    /// Robot description for ROS, PyBullet, Drake, Pinocchio
    Urdf,
    /// MuJoCo model
    Mjcf,
    /// Binary glTF 2.0 with animations, for viewers
    Gltf,
    /// Binary glTF 2.0 with KHR_physics_rigid_bodies, for engines
    GltfPhysics,
    /// OpenUSD text with UsdPhysics, for Isaac
    Usd,
}

#[derive(Debug, Args)]
pub struct ExportArgs {
    /// A twin.json, the folder that `paws twin` wrote, or joints found elsewhere (docs/joints-format.md)
    twin: PathBuf,
    /// Formats, separated by commas
    #[arg(long, value_delimiter = ',', default_value = "urdf,mjcf,gltf,gltf-physics,usd")]
    format: Vec<Format>,
    /// Folder for scene.urdf, scene.xml, kitchen.xml, scene.glb, physics.glb, scene.usda; and for twin.json where joints
    /// were given
    #[arg(long, value_name = "DIR", default_value = ".")]
    out: PathBuf,
}

/// Reads a twin from its file or folder.
pub fn read_twin(path: &Path) -> anyhow::Result<Twin> {
    restore(path);
    let file = if path.is_dir() { path.join("twin.json") } else { path.to_owned() };
    if path.is_dir() && !file.exists() {
        bail!("{}: no such file; a folder that `paws twin` wrote has one", shown(&file));
    }
    Ok(json::read(&file)?)
}

/// What `paws export` was given.
enum Given {
    /// A twin.
    Twin,
    /// Joints found elsewhere.
    Joints,
}

/// Tells a twin from joints by the keys of the file.
fn kind_of(path: &Path) -> anyhow::Result<Given> {
    if path.is_dir() {
        return Ok(Given::Twin);
    }
    let value: serde_json::Value = json::read(path)?;
    match (value.get("furniture").is_some(), value.get("joints").is_some()) {
        (true, _) => Ok(Given::Twin),
        (false, true) => Ok(Given::Joints),
        (false, false) if value.is_array() => bail!(
            "{}: is a list; an object is wanted, with \"furniture\" (a twin) or with \"scene\" and \"joints\" \
             (docs/joints-format.md)",
            shown(path)
        ),
        (false, false) => bail!(
            "{}: neither a twin (it has no \"furniture\") nor joints (it has no \"joints\"; see docs/joints-format.md)",
            shown(path)
        ),
    }
}

/// A file's name and contents.
type File = (&'static str, Vec<u8>);

/// The files of one format.
fn written(format: Format, twin: &Twin, verdicts: &[(String, String)]) -> crate::error::Result<Vec<File>> {
    Ok(match format {
        Format::Urdf => vec![("scene.urdf", export::urdf::write(twin)?.into_bytes())],
        Format::Mjcf => vec![
            ("scene.xml", export::mjcf::write(twin)?.into_bytes()),
            ("kitchen.xml", export::mjcf::write_model(twin)?.into_bytes()),
        ],
        Format::Gltf => vec![("scene.glb", export::gltf::write(twin, verdicts)?)],
        Format::GltfPhysics => vec![("physics.glb", export::gltf::write_physics(twin)?)],
        Format::Usd => vec![("scene.usda", export::usd::write(twin)?.into_bytes())],
    })
}

pub fn run(args: &ExportArgs) -> anyhow::Result<Answer> {
    // Every format is made before the first is written: nothing half-done is left behind.
    let mut files: Vec<File> = Vec::new();
    let given = kind_of(&args.twin)?;
    // What could not be built of a twin was said when it was made.
    let made_here = matches!(given, Given::Joints);
    let (twin, verdicts) = match given {
        Given::Twin => {
            // With its verdicts, where they lie beside the twin: the same file as `paws twin` wrote.
            let beside = match args.twin.is_dir() {
                true => args.twin.join("validation.json"),
                false => args.twin.with_file_name("validation.json"),
            };
            let verdicts = if beside.is_file() { json::read::<Validation>(&beside)?.words() } else { Vec::new() };
            (read_twin(&args.twin)?, verdicts)
        }
        Given::Joints => {
            let path = &args.twin;
            let file: JointsFile = json::read(path)?;
            let twin = joints::from_joints(&file, &Config::default().fitting).with_context(|| shown(path))?;
            let target = args.out.join("twin.json");
            if target.canonicalize().is_ok_and(|t| path.canonicalize().is_ok_and(|p| p == t)) {
                bail!("{}: would be replaced by the twin made of it; choose another --out", shown(path));
            }
            files.push(("twin.json", json::text(&twin)?.into_bytes()));
            (twin, Vec::new())
        }
    };
    let made: Vec<crate::error::Result<Vec<File>>> =
        args.format.par_iter().map(|format| written(*format, &twin, &verdicts)).collect();
    for format in made {
        files.extend(format?);
    }
    std::fs::create_dir_all(&args.out).with_context(|| shown(&args.out))?;
    for (name, bytes) in files {
        let path = args.out.join(name);
        write_file(&path, bytes)?;
        print(&format!("{}\n", shown(&path)))?;
    }
    if !made_here || twin.left_out.is_empty() {
        return Ok(Answer::Yes);
    }
    for left in &twin.left_out {
        eprintln!("{}: not built: {}", left.id, left.reason);
    }
    Ok(Answer::No)
}
