//! `paws export`.

use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use anyhow::{Context, bail};
use clap::Args;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use rayon::prelude::*;

use super::joints::{JointArgs, is_joints};
use super::output::{restore, write_file};
use super::primitives::{hands_beside, rows_beside, seen};
use super::{Answer, look, print, shown};
use crate::evaluation::Predictions;
use crate::export::annotations::Shown;
use crate::export::{ExportContext, ExportFormat, ExportedFiles, FORMATS, Need, Purpose};
use crate::import::ply::Cloud;
use crate::import::{articulations, ply};
use crate::make::JointHands;
use crate::validation::Validation;
use crate::{export, json, primitives, twin::Twin};

/// Takes the name of a format; the help lists all of them.
fn format_parser() -> impl TypedValueParser<Value = &'static ExportFormat> {
    let names = FORMATS.iter().map(|format| PossibleValue::new(format.name).help(format.help));
    PossibleValuesParser::new(names).try_map(|name| export::named(&name).ok_or("no such format"))
}

/// The formats that are written where none are named.
static DEFAULT_FORMATS: LazyLock<String> = LazyLock::new(|| {
    let names: Vec<&str> = FORMATS.iter().filter(|f| f.purpose != Purpose::DataSet).map(|f| f.name).collect();
    names.join(",")
});

/// What goes to `--out`.
fn out_help() -> String {
    let [models, robot] =
        [Purpose::Model, Purpose::Robot].map(|purpose| export::names_of(purpose).collect::<Vec<_>>().join(", "));
    format!("Folder for {models}, look/, {robot}; and for twin.json where joints were given")
}

#[derive(Debug, Args)]
pub struct ExportArgs {
    /// A twin.json, the folder that `paws twin` wrote, or joints found elsewhere: our own format, or those of data sets and
    /// other programs (docs/joints-format.md)
    twin: PathBuf,
    /// Formats, separated by commas
    #[arg(long, value_delimiter = ',', value_parser = format_parser(), default_value = DEFAULT_FORMATS.as_str())]
    format: Vec<&'static ExportFormat>,
    #[command(flatten)]
    joints: JointArgs,
    /// Leave out what the twin looks like, which is read from the folder that `paws twin` wrote
    #[arg(long)]
    no_textures: bool,
    #[arg(long, value_name = "DIR", default_value = ".", help = out_help())]
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
type NamedFile = (String, Vec<u8>);

/// What the chosen formats need beside the twin, as far as it lies in files.
struct Gathered {
    /// Clips with their joints.
    clips: Vec<Shown>,
    /// Recorded hands of each joint.
    hands: Vec<JointHands>,
    /// How sure each joint is, by its clips.
    rows: Predictions,
    /// The reconstruction.
    cloud: Option<Cloud>,
}

impl Gathered {
    /// What the asked formats need; `beside_twin` is the folder that a twin lies in.
    fn of(args: &ExportArgs, beside_twin: Option<&Path>) -> anyhow::Result<Self> {
        let clips = if args.needs(Need::Clips) { clips(&args.twin)? } else { Vec::new() };
        let cloud = match (&args.joints.points, args.needs(Need::Points)) {
            (_, false) => None,
            (Some(points), true) => Some(ply::read(points)?),
            (None, true) => bail!("usdnet: parts are points of a reconstruction: give it by --points FILE.ply"),
        };
        // Joints found elsewhere have no recording, whatever else lies in their folder.
        let (hands, rows) = match (beside_twin, args.needs(Need::Primitives)) {
            (Some(dir), true) => (hands_beside(dir)?, rows_beside(dir)?),
            _ => (Vec::new(), Predictions { predictions: Vec::new() }),
        };
        Ok(Self { clips, hands, rows, cloud })
    }
}

impl ExportArgs {
    /// Whether a chosen format needs something.
    fn needs(&self, need: Need) -> bool {
        self.format.iter().any(|format| format.need == need)
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

/// The files of all chosen formats; what could not be written of a twin goes to standard error.
fn written(args: &ExportArgs, twin: &Twin, beside: &ExportContext) -> crate::error::Result<Vec<NamedFile>> {
    let made: Vec<crate::error::Result<ExportedFiles>> =
        args.format.par_iter().map(|format| (format.write)(twin, beside)).collect();
    let mut files = Vec::new();
    for (format, made) in args.format.iter().zip(made) {
        let made = made?;
        for why in &made.left_out {
            eprintln!("{}: {why}", format.name);
        }
        files.extend(format.files.iter().zip(made.files).map(|(file, bytes)| (file.name.to_owned(), bytes)));
    }
    if let Some(look) = beside.look.filter(|_| args.needs(Need::LookFiles)) {
        files.extend(export::dress::files(twin, look)?);
    }
    Ok(files)
}

pub fn run(args: &ExportArgs) -> anyhow::Result<Answer> {
    // Every format is made before the first is written: nothing half-done is left behind.
    let mut files: Vec<NamedFile> = Vec::new();
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
    let gathered = Gathered::of(args, folder.filter(|_| !made_here))?;
    let primitives = match args.needs(Need::Primitives) {
        true => json::text(&primitives::of(
            &twin,
            &seen(&gathered.hands, &verdicts, &gathered.rows),
            &crate::config::Grips::default(),
            &crate::config::Primitives::default(),
        ))?,
        false => String::new(),
    };
    let beside = ExportContext {
        look: look.as_ref(),
        verdicts: &verdicts,
        clips: &gathered.clips,
        cloud: gathered.cloud.as_ref(),
        primitives: &primitives,
    };
    files.extend(written(args, &twin, &beside)?);
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
