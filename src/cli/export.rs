//! `paws export`.

use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use clap::{Args, ValueEnum};
use rayon::prelude::*;

use super::joints::{JointArgs, is_joints};
use super::output::{restore, write_file};
use super::primitives::{hands_beside, rows_beside, seen};
use super::twin::JointHands;
use super::{Answer, look, print, shown};
use crate::evaluation::Predictions;
use crate::export::annotations::{self, Shown};
use crate::import::ply::Cloud;
use crate::import::{articulations, ply};
use crate::look::Look;
use crate::validation::Validation;
use crate::{export, json, primitives, twin::Twin};

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
    /// OpenUSD with UsdPhysics, for Isaac: as text, and with its pictures as one file
    Usd,
    /// What a robot needs to open each joint: grasp, path, Dynamic Movement Primitive (primitives.json; docs/primitives.md)
    Primitives,
    /// Arti4D's list of joints (arti4d.json)
    Arti4d,
    /// EgoArti's list of clips and their annotations (egoarti_list.json, egoarti.json)
    Egoarti,
    /// What USDNet is trained on: parts as points of --points, with their joints (usdnet_articulation.json, usdnet.npy,
    /// usdnet_instance_gt.txt)
    Usdnet,
}

#[derive(Debug, Args)]
pub struct ExportArgs {
    /// A twin.json, the folder that `paws twin` wrote, or joints found elsewhere: our own format, or those of data sets and
    /// other programs (docs/joints-format.md)
    twin: PathBuf,
    /// Formats, separated by commas
    #[arg(long, value_delimiter = ',', default_value = "urdf,mjcf,gltf,gltf-physics,usd,primitives")]
    format: Vec<Format>,
    #[command(flatten)]
    joints: JointArgs,
    /// Leave out what the twin looks like, which is read from the folder that `paws twin` wrote
    #[arg(long)]
    no_textures: bool,
    /// Folder for scene.urdf, scene.xml, kitchen.xml, scene.glb, physics.glb, scene.usda, scene.usdz, look/, primitives.json;
    /// and for twin.json where joints were given
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
        return Ok(if is_joints(path) { Given::Joints } else { Given::Twin });
    }
    let value: serde_json::Value = json::read(path)?;
    match (value.get("furniture").is_some(), value.get("joints").is_some()) {
        (true, _) => Ok(Given::Twin),
        (false, true) => Ok(Given::Joints),
        (false, false) if articulations::detect(&value).is_some() => Ok(Given::Joints),
        (false, false) if value.is_array() => bail!(
            "{}: is a list; an object is wanted, with \"furniture\" (a twin) or with \"scene\" and \"joints\", or joints as \
             other programs write them (docs/joints-format.md)",
            shown(path)
        ),
        (false, false) => bail!(
            "{}: neither a twin (it has no \"furniture\") nor joints (it has no \"joints\", and is in no other format that is \
             read: {}; see docs/joints-format.md)",
            shown(path),
            articulations::names()
        ),
    }
}

/// A file's name and contents.
type File = (String, Vec<u8>);

impl Format {
    /// Whether its files show the meshes and pictures beside them.
    fn needs_look(self) -> bool {
        matches!(self, Self::Urdf | Self::Mjcf | Self::Usd)
    }
}

/// What formats need beside the twin.
struct Beside {
    /// Verdicts of joints.
    verdicts: Vec<(String, String)>,
    /// Clips with their joints.
    clips: Vec<Shown>,
    /// Recorded hands of each joint.
    hands: Vec<JointHands>,
    /// How sure each joint is, by its clips.
    rows: Predictions,
    /// The reconstruction.
    cloud: Option<Cloud>,
    /// What the twin looks like.
    look: Option<Look>,
}

impl Beside {
    /// What the asked formats need; `beside_twin` is the folder that a twin lies in.
    fn of(
        args: &ExportArgs,
        verdicts: Vec<(String, String)>,
        look: Option<Look>,
        beside_twin: Option<&Path>,
    ) -> anyhow::Result<Self> {
        let clips = if args.format.contains(&Format::Egoarti) { clips(&args.twin)? } else { Vec::new() };
        let cloud = match (&args.joints.points, args.format.contains(&Format::Usdnet)) {
            (_, false) => None,
            (Some(points), true) => Some(ply::read(points)?),
            (None, true) => bail!("usdnet: parts are points of a reconstruction: give it by --points FILE.ply"),
        };
        // Joints found elsewhere have no recording, whatever else lies in their folder.
        let (hands, rows) = match (beside_twin, args.format.contains(&Format::Primitives)) {
            (Some(dir), true) => (hands_beside(dir)?, rows_beside(dir)?),
            _ => (Vec::new(), Predictions { predictions: Vec::new() }),
        };
        Ok(Self { verdicts, clips, hands, rows, cloud, look })
    }
}

/// The clips of the predictions beside a twin, with the joints that they show.
fn clips(twin: &Path) -> anyhow::Result<Vec<Shown>> {
    let path = match twin.is_dir() {
        true => twin.join("predictions.json"),
        false => twin.with_file_name("predictions.json"),
    };
    if !path.is_file() {
        bail!("{}: no such file; egoarti lists clips, which a folder that `paws twin` wrote has", shown(&path));
    }
    let rows = Predictions::read(&path)?.predictions;
    Ok(rows
        .into_iter()
        .filter_map(|row| Some(Shown { recording: row.recording, clip: row.clip, joint: row.joint? }))
        .collect())
}

/// The files of one format.
fn written(format: Format, twin: &Twin, beside: &Beside) -> crate::error::Result<Vec<File>> {
    let look = beside.look.as_ref();
    let files: Vec<(&str, Vec<u8>)> = match format {
        Format::Urdf => vec![("scene.urdf", export::urdf::write(twin, look)?.into_bytes())],
        Format::Mjcf => vec![
            ("scene.xml", export::mjcf::write(twin, look)?.into_bytes()),
            ("kitchen.xml", export::mjcf::write_model(twin, look)?.into_bytes()),
        ],
        Format::Gltf => vec![("scene.glb", export::gltf::write(twin, look, &beside.verdicts)?)],
        Format::GltfPhysics => vec![("physics.glb", export::gltf::write_physics(twin)?)],
        Format::Usd => vec![
            ("scene.usda", export::usd::write(twin, look)?.into_bytes()),
            ("scene.usdz", export::usd::write_package(twin, look)?),
        ],
        Format::Primitives => {
            let seen = seen(&beside.hands, &beside.verdicts, &beside.rows);
            vec![("primitives.json", json::text(&primitives::of(twin, &seen))?.into_bytes())]
        }
        Format::Arti4d => vec![("arti4d.json", annotations::arti4d(twin)?.into_bytes())],
        Format::Egoarti => {
            let [list, all] = annotations::egoarti(twin, &beside.clips)?;
            vec![("egoarti_list.json", list.into_bytes()), ("egoarti.json", all.into_bytes())]
        }
        Format::Usdnet => {
            let Some(cloud) = &beside.cloud else { return Ok(Vec::new()) };
            let parts = annotations::usdnet(twin, cloud)?;
            for id in &parts.unseen {
                eprintln!("usdnet: {id}: no point of the reconstruction lies on it; it is left out");
            }
            vec![
                ("usdnet_articulation.json", parts.articulation.into_bytes()),
                ("usdnet.npy", parts.points),
                ("usdnet_instance_gt.txt", parts.instances.into_bytes()),
            ]
        }
    };
    Ok(files.into_iter().map(|(name, bytes)| (name.to_owned(), bytes)).collect())
}

pub fn run(args: &ExportArgs) -> anyhow::Result<Answer> {
    // Every format is made before the first is written: nothing half-done is left behind.
    let mut files: Vec<File> = Vec::new();
    let given = if args.joints.is_forced() { Given::Joints } else { kind_of(&args.twin)? };
    // What could not be built of a twin was said when it was made.
    let made_here = matches!(given, Given::Joints);
    let (twin, verdicts, look) = match given {
        Given::Twin => {
            // With its verdicts and its look, where they lie beside the twin: the same file as `paws twin` wrote.
            let dir =
                if args.twin.is_dir() { args.twin.as_path() } else { args.twin.parent().unwrap_or(Path::new("")) };
            let beside = dir.join("validation.json");
            let verdicts = if beside.is_file() { json::read::<Validation>(&beside)?.words() } else { Vec::new() };
            let twin = read_twin(&args.twin)?;
            let look = if args.no_textures { None } else { look::read(dir, &twin)? };
            (twin, verdicts, look)
        }
        Given::Joints => {
            let path = &args.twin;
            let (twin, _) = args.joints.twin(path)?;
            let target = args.out.join("twin.json");
            if target.canonicalize().is_ok_and(|t| path.canonicalize().is_ok_and(|p| p == t)) {
                bail!("{}: would be replaced by the twin made of it; choose another --out", shown(path));
            }
            files.push(("twin.json".to_owned(), json::text(&twin)?.into_bytes()));
            (twin, Vec::new(), None)
        }
    };
    let folder = match args.twin.is_dir() {
        true => Some(args.twin.as_path()),
        false => args.twin.parent(),
    };
    let beside = Beside::of(args, verdicts, look, folder.filter(|_| !made_here))?;
    let made: Vec<crate::error::Result<Vec<File>>> =
        args.format.par_iter().map(|format| written(*format, &twin, &beside)).collect();
    for format in made {
        files.extend(format?);
    }
    if let Some(look) = beside.look.as_ref().filter(|_| args.format.iter().any(|f| f.needs_look())) {
        files.extend(export::dress::files(&twin, look)?);
    }
    for (name, bytes) in files {
        let path = args.out.join(name);
        let folder = path.parent().unwrap_or(&args.out);
        std::fs::create_dir_all(folder).with_context(|| shown(folder))?;
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
