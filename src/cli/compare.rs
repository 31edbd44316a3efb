//! `paws compare`: how a twin looks beside the recorded frames, and where its surfaces are beside a truth.

use std::path::{Path, PathBuf};

use anyhow::bail;
use clap::Args;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::door::Door;
use super::output::{Kind, Output, restore, write_file};
use super::primitives::{hands_beside, rows_beside};
use super::progress::Steps;
use super::{Answer, ConfigFile, Opening, look, print, shown};
use crate::articulation::Action;
use crate::config::{self, Config};
use crate::evaluation::front_errors::{self, FrontErrors};
use crate::evaluation::likeness::{self, Contender, ContenderSummary, FrameLikeness, STATIC};
use crate::evaluation::shots::{self, Shot, Shots};
use crate::evaluation::surface_scores::{self, ShapeScore, TrueRoom};
use crate::evaluation::{Predictions, Truth};
use crate::hands::timeline::{Motion, Timeline};
use crate::import::formats::surface;
use crate::json;
use crate::look::Look;
use crate::raster::Mesh;
use crate::recording::{Clip, Recording, Videos};
use crate::report::likeness_table as told;
use crate::twin::Twin;

#[derive(Debug, Args)]
pub struct CompareArgs {
    /// The folder that `paws twin` wrote; or a mesh in the recording's world frame (PLY, OBJ, glTF) by any other program, which
    /// is compared with the frames in which nobody works
    twin: PathBuf,
    /// The recording's folder
    recording: PathBuf,
    /// Meshes of other programs, in the recording's world frame, to compare with the same frames and pixels
    #[arg(long, value_name = "MESH", num_args = 1..)]
    against: Vec<PathBuf>,
    /// Draw the twin's plain boxes in the place of its textured surfaces
    #[arg(long)]
    boxes: bool,
    /// The true kitchen that `paws synth --kitchen` wrote: the shape of what does not move is compared with it
    #[arg(long, value_name = "DIR")]
    kitchen: Option<PathBuf>,
    /// Write all numbers, and which frames show everything closed, as JSON to this file
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Folder for pictures: frame, twin and difference beside each other
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    #[command(flatten)]
    opening: Opening,
    #[command(flatten)]
    door: Door,
    #[command(flatten)]
    config: ConfigFile,
}

/// The JSON file.
#[derive(Serialize)]
struct File<'a> {
    recording: &'a str,
    /// Means over frames.
    summary: Vec<ContenderSummary>,
    /// Every compared frame.
    frames: &'a [FrameLikeness],
    /// All frames in which everything is closed and nobody works.
    closed_frames: &'a [usize],
    /// The shape of what does not move, where the true kitchen was given.
    #[serde(skip_serializing_if = "<[(String, ShapeScore)]>::is_empty")]
    shape: &'a [(String, ShapeScore)],
    /// Edges of the parts, where the recording has a truth.
    #[serde(skip_serializing_if = "Option::is_none")]
    fronts: Option<&'a FrontErrors>,
}

/// What is compared, as it was read.
struct Given {
    /// Without furniture where a mesh was given.
    twin: Twin,
    /// The folder of the twin; `None` for a mesh.
    folder: Option<PathBuf>,
    look: Option<Look>,
    /// The twin's boxes with their owners.
    boxes: Vec<(u16, Mesh)>,
    /// Meshes of others, each with its name.
    meshes: Vec<(String, Vec<Mesh>)>,
}

impl Given {
    fn read(args: &CompareArgs) -> anyhow::Result<Self> {
        let named = |path: &Path| -> anyhow::Result<(String, Vec<Mesh>)> {
            Ok((shown(path.file_name().map_or(path, Path::new)), surface::read(path)?))
        };
        restore(&args.twin);
        if !args.twin.exists() {
            bail!("{}: no such file or folder", shown(&args.twin));
        }
        let others = || args.against.iter().map(|path| named(path)).collect::<anyhow::Result<Vec<_>>>();
        if !args.twin.is_dir() && args.twin.extension().is_none_or(|e| e != "json") {
            let mut meshes = vec![named(&args.twin)?];
            meshes.extend(others()?);
            let twin = Twin {
                name: String::new(),
                density_kg_per_m3: 1.0,
                drives: config::Drives::default(),
                furniture: Vec::new(),
                room: Vec::new(),
                left_out: Vec::new(),
            };
            return Ok(Self { twin, folder: None, look: None, boxes: Vec::new(), meshes });
        }
        let twin = super::export::read_twin(&args.twin)?;
        let folder = if args.twin.is_dir() { args.twin.clone() } else { folder_of(&args.twin) };
        let look = if args.boxes { None } else { look::read(&folder, &twin)? };
        if look.is_none() && !args.boxes {
            eprintln!("{}: has no look: its plain boxes are compared", shown(&args.twin));
        }
        let boxes = likeness::boxes(&twin);
        Ok(Self { twin, folder: Some(folder), look, boxes, meshes: others()? })
    }

    fn contenders(&self) -> Vec<Contender<'_>> {
        let twin = self.folder.is_some().then(|| Contender {
            name: "twin".to_owned(),
            surfaces: likeness::surfaces(&self.twin, self.look.as_ref(), &self.boxes),
        });
        // Nobody knows which side of another program's triangles is the outer one.
        let others = self.meshes.iter().map(|(name, meshes)| Contender {
            name: name.clone(),
            surfaces: meshes.iter().map(|mesh| mesh.surface(STATIC, mesh.two_sided)).collect(),
        });
        twin.into_iter().chain(others).collect()
    }
}

fn folder_of(file: &Path) -> PathBuf {
    file.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new(".")).to_owned()
}

pub fn run(args: &CompareArgs) -> anyhow::Result<Answer> {
    let config = args.config.read()?;
    let output = match &args.out {
        Some(out) => Some(Output::new(out, Kind::Comparison, &[args.recording.as_path(), args.twin.as_path()])?),
        None => None,
    };
    let mut recording = args.door.open(args.opening, &args.recording)?;
    let given = Given::read(args)?;
    let timelines = match &given.folder {
        Some(folder) => timelines(folder, &given.twin, &mut recording, &config.hands)?,
        None => Vec::new(),
    };
    let shots = shots::choose(&recording, &given.twin, &timelines, &config.comparison);
    if shots.chosen.is_empty() {
        bail!(
            "{}: no frame with an image shows the furniture at rest; nothing can be compared",
            shown(&args.recording)
        );
    }
    let contenders = given.contenders();
    let rows = compared(&recording, &given.twin, &contenders, &shots, &config)?;
    let names: Vec<String> = contenders.iter().map(|c| c.name.clone()).collect();
    let summary = likeness::summaries(&names, &rows);
    print(&format!("{}\n\n{}", recording.name, told::likeness(&summary)))?;
    let shape = shapes(args, &contenders, &recording, &shots, &config)?;
    if !shape.is_empty() {
        print(&format!("\n{}", told::shapes(&shape)))?;
    }
    let fronts = fronts_of(args, &given)?;
    if let Some(fronts) = &fronts {
        print(&format!("\n{}", told::fronts(fronts)))?;
    }
    if let Some(output) = output {
        pictures(&output, &recording, &given.twin, &contenders, &shots, &config)?;
        output.finish()?;
    }
    if let Some(path) = &args.json {
        let file = File {
            recording: &recording.name,
            summary,
            frames: &rows,
            closed_frames: &shots.closed,
            shape: &shape,
            fronts: fronts.as_ref(),
        };
        write_file(path, json::text(&file)?)?;
    }
    Ok(Answer::Yes)
}

/// All chosen frames, a few at a time.
fn compared(
    recording: &Recording,
    twin: &Twin,
    contenders: &[Contender],
    shots: &Shots,
    config: &Config,
) -> anyhow::Result<Vec<FrameLikeness>> {
    /// Frames between two words about how far it is.
    const AT_ONCE: usize = 8;
    let steps = Steps::new();
    let mut rows = Vec::new();
    for (i, some) in shots.chosen.chunks(AT_ONCE).enumerate() {
        steps.report("comparing", i * AT_ONCE, shots.chosen.len());
        rows.extend(likeness::compare(recording, twin, contenders, some, &config.comparison)?);
    }
    steps.finish();
    Ok(rows)
}

/// A clip of `articulations.json`.
#[derive(Deserialize)]
struct ClipFrames {
    clip: String,
    frames: [usize; 2],
}

/// A clip that is tied to another one.
#[derive(Deserialize)]
struct ToldClip {
    clip: String,
    with: String,
    action: Action,
}

#[derive(Deserialize)]
struct JointTold {
    id: String,
    #[serde(default)]
    told: Vec<ToldClip>,
}

/// What is needed of `articulations.json`.
#[derive(Deserialize)]
struct Articulations {
    /// Of the recordings that it was joined of.
    #[serde(default)]
    videos: Videos,
    joints: Vec<JointTold>,
    clips: Vec<ClipFrames>,
}

/// When each part of a twin stood closed or open, by the answer beside it. Clips that were found in the recording become its own.
fn timelines(
    folder: &Path,
    twin: &Twin,
    recording: &mut Recording,
    config: &config::Hands,
) -> anyhow::Result<Vec<Timeline>> {
    let path = folder.join("articulations.json");
    if !path.is_file() {
        bail!("{}: no such file; a folder that `paws twin` wrote has one", shown(&path));
    }
    let answer: Articulations = json::read(&path)?;
    if !answer.videos.joined.is_empty() {
        bail!("{}: a twin of several recordings; compare that of one recording", shown(&path));
    }
    let as_clip = |c: &ClipFrames| {
        let [narration, verb, noun] = [(); 3].map(|()| String::new());
        Clip { clip: c.clip.clone(), start_frame: c.frames[0], end_frame: c.frames[1], narration, verb, noun }
    };
    let clips: Vec<Clip> = answer.clips.iter().map(as_clip).collect();
    if recording.clips.is_empty() {
        recording.clips.clone_from(&clips);
    }
    let (hands, rows) = (hands_beside(folder)?, rows_beside(folder)?);
    let clip = |name: &str| clips.iter().find(|c| c.clip == name);
    let range = |name: &str| rows.predictions.iter().find(|r| r.clip == name).and_then(|r| r.range);
    let motions = |id: &str| -> Vec<Motion> {
        let held: Vec<_> = hands.iter().filter(|j| j.joint == id).flat_map(|j| &j.clips).collect();
        let shown = held.iter().filter_map(|(name, hand)| Some(Motion::held(clip(name)?, hand, range(name)?)));
        let told = answer.joints.iter().filter(|j| j.id == id).flat_map(|j| &j.told).filter_map(|told| {
            let own = clip(&told.clip)?;
            let frames = [own.start_frame, own.end_frame];
            Some(Motion { frames, opens: told.action == Action::Open, opening: range(&told.with)? })
        });
        shown.chain(told).collect()
    };
    Ok(twin.furniture.iter().map(|f| Timeline::of(recording, &motions(&f.part.id), config)).collect())
}

/// The shape of what does not move, where the true kitchen is known.
fn shapes(
    args: &CompareArgs,
    contenders: &[Contender],
    recording: &Recording,
    shots: &Shots,
    config: &Config,
) -> anyhow::Result<Vec<(String, ShapeScore)>> {
    let Some(kitchen) = &args.kitchen else { return Ok(Vec::new()) };
    let truth = TrueRoom::read(kitchen)?;
    let frames: Vec<usize> = shots.chosen.iter().filter(|s| s.opened().is_empty()).map(|s| s.frame).collect();
    let far = config.appearance.depth_max_m;
    let score =
        |c: &Contender| surface_scores::measure(&c.surfaces, &truth, recording, &frames, &config.comparison, far);
    Ok(contenders.iter().map(|c| (c.name.clone(), score(c))).collect())
}

/// Edges of the twin's fronts, where the recording has a truth.
fn fronts_of(args: &CompareArgs, given: &Given) -> anyhow::Result<Option<FrontErrors>> {
    let Some(folder) = given.folder.as_ref().filter(|_| args.recording.join("ground_truth.json").is_file()) else {
        return Ok(None);
    };
    let rows: Predictions = rows_beside(folder)?;
    Ok(Some(front_errors::compare(&rows, &Truth::read(&args.recording)?)))
}

/// Pictures of a few frames of each kind.
fn pictures(
    output: &Output,
    recording: &Recording,
    twin: &Twin,
    contenders: &[Contender],
    shots: &Shots,
    config: &Config,
) -> anyhow::Result<()> {
    /// Of each kind, at most.
    const MOST: usize = 8;
    let (closed, open): (Vec<&Shot>, Vec<&Shot>) = shots.chosen.iter().partition(|s| s.opened().is_empty());
    let few = |all: &[&Shot]| -> Vec<Shot> {
        all.iter().step_by(all.len().div_ceil(MOST).max(1)).map(|s| (*s).clone()).collect()
    };
    let chosen: Vec<(&str, Shot)> =
        few(&closed).into_iter().map(|s| ("closed", s)).chain(few(&open).into_iter().map(|s| ("open", s))).collect();
    let draw = |(_, shot): &(&str, Shot)| -> crate::error::Result<Option<Vec<u8>>> {
        let sight = likeness::look_at(recording, twin, contenders, shot, &config.comparison)?;
        sight.as_ref().map(told::panel).transpose()
    };
    let drawn: Vec<Option<Vec<u8>>> = chosen.par_iter().map(draw).collect::<crate::error::Result<_>>()?;
    for ((kind, shot), bytes) in chosen.iter().zip(drawn) {
        if let Some(bytes) = bytes {
            output.write(&format!("{kind}_{:06}.png", shot.frame), bytes)?;
        }
    }
    Ok(())
}
