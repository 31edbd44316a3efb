//! `paws perceive`: the streams that a recording lacks, made by networks that the Python package in `perceive/` runs.
//!
//! What a source holds is joined by the code of `paws import`; this command finds out what is missing, starts the package for
//! each such stream, and leaves a recording that is whole or not there. Nothing here knows a network.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use clap::{Args, ValueEnum};
use serde::Deserialize;
use serde_json::json;

use super::import::{self, ConventionArgs, FrameArgs};
use super::output::{Kind, Output};
use super::perceive_package::{self as package, Python};
use super::progress::Steps;
use super::{Answer, print, shown};
use crate::import::formats::Format;
use crate::import::{Capture, Options, assemble};

/// Image width of the recording where the user says none, pixels: hands at arm's length are some 100 pixels large then.
const WIDTH: u32 = 960;
/// Frames a second of images without times, where nobody says it.
const SOURCE_FPS: f64 = 30.0;
/// What is not copied of a recording whose hands are made anew.
const HANDS: [&str; 2] = ["hands.json", "fingertips.csv"];

/// A stream that can be made here.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Stream {
    /// Camera poses.
    Poses,
    /// Depth.
    Depth,
    /// Hands.
    Hands,
}

impl Stream {
    /// Its name in the package.
    fn name(self) -> &'static str {
        match self {
            Self::Poses => "poses",
            Self::Depth => "depth",
            Self::Hands => "hands",
        }
    }
}

#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    paws perceive --plan scan said.srt                  what would run, how long, under which licences; runs nothing\n  \
    paws perceive scan said.srt --out rec               a phone's scan with depth: its hands, on a CPU\n  \
    paws perceive rec --redo hands --out better         a recording of ours, its hands made anew\n  \
    paws perceive walk.mp4 moge=DEPTH said.srt --out rec\n\
    Step by step: docs/perceive.md.")]
pub struct PerceiveArgs {
    /// What `paws import` reads (files and folders, the most important one first), a video, a folder of images, or one
    /// recording of ours
    #[arg(value_name = "[KIND] SOURCE", required = true)]
    sources: Vec<PathBuf>,
    /// Folder for the recording
    #[arg(long, value_name = "DIR", required_unless_present = "plan")]
    out: Option<PathBuf>,
    /// Say what would run, on what, how long, with how much memory and under which licences; run nothing
    #[arg(long)]
    plan: bool,
    /// Make a stream anew that is there or that is kept in the cache; may be given several times
    #[arg(long, value_name = "STREAM", value_enum)]
    redo: Vec<Stream>,
    /// A folder with the networks' weights, in place of those that come with the packages
    #[arg(long, value_name = "DIR")]
    weights: Option<PathBuf>,
    /// Make depth by a metric model of the `transformers` library: its folder, as its authors publish it
    #[arg(long, value_name = "DIR")]
    depth_model: Option<PathBuf>,
    /// Where what was computed is kept, so that a run that was stopped goes on there; safe to delete [default: OUT.cache]
    #[arg(long, value_name = "DIR")]
    cache: Option<PathBuf>,
    /// Run on the CPU (the default)
    #[arg(long, conflicts_with = "gpu")]
    cpu: bool,
    /// Use a GPU where a network can
    #[arg(long)]
    gpu: bool,
    /// A Python that has the packages, in place of uv
    #[arg(long, value_name = "PATH")]
    python: Option<PathBuf>,
    #[command(flatten)]
    frames: FrameArgs,
    #[command(flatten)]
    convention: ConventionArgs,
}

/// What the package writes of poses.
#[derive(Deserialize)]
struct Posed {
    images: PathBuf,
    model: PathBuf,
    made: PosesMade,
}

#[derive(Deserialize)]
struct PosesMade {
    adapter: String,
    licence: String,
    images: usize,
    models: Vec<usize>,
}

/// What the package writes of depth.
#[derive(Deserialize)]
struct Measured {
    depth: PathBuf,
    made: DepthMade,
}

#[derive(Deserialize)]
struct DepthMade {
    adapter: String,
    kind: String,
    licence: String,
}

/// What the sources hold.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Facts {
    images: usize,
    frames: usize,
    poses: bool,
    depth: bool,
    hands: bool,
    clips: bool,
}

impl Facts {
    fn of(captures: &[Capture], options: &Options) -> Self {
        let any = |has: fn(&Capture) -> bool| captures.iter().any(has);
        let images = captures.iter().map(|c| &c.images).find(|i| !i.is_empty());
        let times: Vec<f64> = images.into_iter().flatten().filter_map(|i| i.at.time_secs).collect();
        let count = images.map_or(0, Vec::len);
        let first = times.iter().copied().fold(f64::INFINITY, f64::min);
        let last = times.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let secs = if last > first { last - first } else { count as f64 / options.source_fps.unwrap_or(SOURCE_FPS) };
        let frames = if options.fps > 0.0 { ((secs * options.fps) as usize + 1).min(count) } else { count };
        Self {
            images: count,
            frames,
            poses: any(|c| c.poses.is_some()),
            depth: any(|c| c.depth.is_some() || !c.points.is_empty()),
            hands: any(|c| c.hands.is_some()),
            clips: any(|c| !c.clips.is_empty()),
        }
    }

    fn text(self) -> String {
        let Self { images, frames, poses, depth, hands, clips } = self;
        json!({"images": images, "frames": frames, "poses": poses, "depth": depth, "hands": hands, "clips": clips})
            .to_string()
    }
}

/// Whether a folder is a recording of ours.
fn is_recording(path: &Path) -> bool {
    path.join("cameras.json").is_file()
}

pub fn run(args: &PerceiveArgs) -> anyhow::Result<Answer> {
    let options = import::options(&args.frames, &args.convention, WIDTH)?;
    if let Some(weights) = args.weights.as_ref().filter(|w| !w.is_dir()) {
        bail!("{}: --weights wants a folder with the networks' files", shown(weights));
    }
    if let Some(model) = args.depth_model.as_ref().filter(|m| !m.join("config.json").is_file()) {
        bail!("{}: --depth-model wants a folder with config.json and model.safetensors in it", shown(model));
    }
    match args.sources.as_slice() {
        [one] if is_recording(one) => recording(args, one),
        many => {
            if let Some(ours) = many.iter().find(|s| is_recording(s)) {
                bail!(
                    "{}: is a recording already and joins no other source; name it alone, or the sources it was made of",
                    shown(ours)
                );
            }
            sources(args, &options)
        }
    }
}

/// A recording of ours: it is copied, and its hands are made.
fn recording(args: &PerceiveArgs, source: &Path) -> anyhow::Result<Answer> {
    if args.plan {
        return planned(args, &[source.as_os_str()]);
    }
    let Some(out) = &args.out else { bail!("--out DIR is needed") };
    if args.depth_model.is_some() || args.redo.iter().any(|&stream| stream != Stream::Hands) {
        bail!(
            "{}: is a recording, of which hands alone are made; --redo poses, --redo depth and --depth-model are for the \
             sources it was made of",
            shown(source)
        );
    }
    let has_hands = HANDS.iter().any(|name| source.join(name).is_file());
    let wanted = !has_hands || args.redo.contains(&Stream::Hands);
    let python = wanted.then(|| Python::find(args.python.as_deref())).transpose()?;
    let output = Output::new(out, Kind::Recording, &[source])?;
    copy(source, "", &output, wanted)?;
    let found = match &python {
        Some(python) => hands(args, python, out, &output)?,
        None => {
            eprintln!("{}: has poses and hands; --redo hands makes its hands anew", shown(source));
            true
        }
    };
    output.finish()?;
    print(&format!("{}\n", shown(out)))?;
    Ok(if found { Answer::Yes } else { Answer::No })
}

/// Copies the files of a recording, without our own marks and, where hands are made, without those that are there.
fn copy(source: &Path, below: &str, output: &Output, without_hands: bool) -> anyhow::Result<()> {
    let folder = source.join(below);
    let entries = std::fs::read_dir(&folder).with_context(|| shown(&folder))?;
    for entry in entries {
        let entry = entry.with_context(|| shown(&folder))?;
        let file = entry.file_name().to_string_lossy().into_owned();
        let name = if below.is_empty() { file.clone() } else { format!("{below}/{file}") };
        let kind = entry.file_type().with_context(|| name.clone())?;
        if file.starts_with('.') || (without_hands && HANDS.contains(&name.as_str())) {
            continue;
        }
        if kind.is_symlink() {
            bail!("{}: is a link; put the file itself there", shown(&entry.path()));
        } else if kind.is_dir() {
            copy(source, &name, output, without_hands)?;
        } else {
            let target = output.path(&name)?;
            std::fs::copy(entry.path(), &target).with_context(|| shown(&target))?;
        }
    }
    Ok(())
}

/// Whatever `paws import` reads.
fn sources(args: &PerceiveArgs, options: &Options) -> anyhow::Result<Answer> {
    let mut sources = import::resolve(&args.sources)?;
    let mut captures = read(&sources, options)?;
    let facts = Facts::of(&captures, options);
    if args.plan {
        return planned(args, &[OsStr::new("--facts"), OsStr::new(&facts.text())]);
    }
    let Some(out) = &args.out else { bail!("--out DIR is needed") };
    // Told before hours of work, not after them. Hands that are there may yet meet no frame.
    let python = Python::find(args.python.as_deref());
    let redo_hands = args.redo.contains(&Stream::Hands);
    let wants_depth = !facts.depth && args.depth_model.is_some();
    let python = if facts.poses && facts.hands && !redo_hands && !wants_depth { python.ok() } else { Some(python?) };
    let inputs: Vec<PathBuf> = sources.iter().map(|(_, path)| path.clone()).collect();
    let inputs: Vec<&Path> = inputs.iter().map(PathBuf::as_path).collect();
    let output = Output::new(out, Kind::Recording, &inputs)?;
    let mut notes = Vec::new();
    if facts.poses && args.redo.contains(&Stream::Poses) {
        bail!("--redo poses: the sources have poses of their own, which are taken");
    }
    if let Some(python) = python.as_ref().filter(|_| !facts.poses || wants_depth) {
        if !facts.poses {
            notes.push(posed(args, python, out, &mut sources, options)?);
        }
        if let Some(model) = args.depth_model.as_ref().filter(|_| wants_depth) {
            notes.push(measured(args, python, out, &mut sources, model)?);
        }
        captures = read(&sources, options)?;
    }
    if redo_hands {
        captures.iter_mut().for_each(|c| c.hands = None);
    }
    let mut imported = assemble(captures, options)?;
    imported.report.changes.extend(notes);
    let steps = Steps::new();
    import::write(&mut imported, &output, &steps)?;
    steps.finish();
    let mut found = true;
    if imported.hands.is_empty() {
        let Some(python) = &python else {
            bail!("none of the given hands meets a frame, and making others needs uv or Python")
        };
        found = hands(args, python, out, &output)?;
        imported.report.missing.retain(|m| !(found && m.what == Stream::Hands.name()));
    }
    output.finish()?;
    print(&import::told(&imported, out))?;
    Ok(if found && imported.report.findings.is_empty() { Answer::Yes } else { Answer::No })
}

fn read(sources: &[(&'static Format, PathBuf)], options: &Options) -> anyhow::Result<Vec<Capture>> {
    let mut captures = Vec::with_capacity(sources.len());
    for (format, path) in sources {
        captures.push((format.read)(path, options)?);
    }
    Ok(captures)
}

/// Makes poses of the video or the folder of images, and puts them and the images they belong to in its place. Returns what
/// is to be noted.
fn posed(
    args: &PerceiveArgs,
    python: &Python,
    out: &Path,
    sources: &mut Vec<(&'static Format, PathBuf)>,
    options: &Options,
) -> anyhow::Result<String> {
    let Some(at) = sources.iter().position(|(format, _)| format.name == "frames") else {
        bail!(
            "no source has poses, and poses are made of a video or a folder of images: give one, or a source with poses"
        );
    };
    let cache = cache(args, out)?;
    let answer = cache.join("poses.json");
    let (format, source) = sources.remove(at);
    let mut command = python.command(Some(Stream::Poses.name()));
    command.arg("poses").arg(&source).arg("--out").arg(&answer).arg("--cache").arg(&cache);
    command.args(common(args));
    if options.fps > 0.0 {
        command.arg("--fps").arg(options.fps.to_string());
    }
    if let Some(ffmpeg) = &options.ffmpeg {
        command.arg("--ffmpeg").arg(ffmpeg);
    }
    python.run(command, Stream::Poses.name(), &cache)?;
    let posed: Posed = crate::json::read(&answer)?;
    let Some(colmap) = crate::import::formats::named("colmap") else { bail!("no reader for COLMAP") };
    if posed.images != source {
        eprintln!("poses: other networks may run on the same images: {}", shown(&posed.images));
    }
    sources.insert(0, (format, posed.images));
    sources.insert(0, (colmap, posed.model));
    let made = posed.made;
    let registered = made.models.first().copied().unwrap_or(0);
    let pieces = made.models.len();
    Ok(format!(
        "poses were made by {} ({}): {registered} of {} images, the largest of {pieces} piece{}",
        made.adapter,
        made.licence,
        made.images,
        if pieces == 1 { "" } else { "s" }
    ))
}

/// Makes depth of the folder of images, and puts it behind the sources. Returns what is to be noted.
fn measured(
    args: &PerceiveArgs,
    python: &Python,
    out: &Path,
    sources: &mut Vec<(&'static Format, PathBuf)>,
    model: &Path,
) -> anyhow::Result<String> {
    let Some((_, images)) = sources.iter().find(|(format, path)| format.name == "frames" && path.is_dir()) else {
        bail!("--depth-model: depth is made of a folder of images, or of a video without poses: no source is one");
    };
    let cache = cache(args, out)?;
    let answer = cache.join("depth.json");
    let mut command = python.command(Some(Stream::Depth.name()));
    command.arg("depth").arg(images).arg("--out").arg(&answer).arg("--cache").arg(&cache);
    command.arg("--depth-model").arg(model).args(common(args));
    python.run(command, Stream::Depth.name(), &cache)?;
    let measured: Measured = crate::json::read(&answer)?;
    let Some(moge) = crate::import::formats::named("moge") else { bail!("no reader for depth") };
    sources.push((moge, measured.depth));
    let made = measured.made;
    Ok(format!("depth was made by {}, {} ({})", made.adapter, made.kind, made.licence))
}

/// Makes the hands of the staged recording; whether there are any.
fn hands(args: &PerceiveArgs, python: &Python, out: &Path, output: &Output) -> anyhow::Result<bool> {
    let cache = cache(args, out)?;
    let written = output.path("hands.json")?;
    let Some(folder) = written.parent() else { bail!("a folder for hands") };
    let mut command = python.command(Some(Stream::Hands.name()));
    command.arg("hands").arg(folder).arg("--cache").arg(&cache);
    command.args(common(args));
    if let Some(weights) = &args.weights {
        command.arg("--weights").arg(weights);
    }
    let found = python.run(command, Stream::Hands.name(), &cache)?;
    if !written.is_file() {
        bail!("hands: nothing was written; the reason stands above");
    }
    Ok(found)
}

/// Arguments of every stream.
fn common(args: &PerceiveArgs) -> Vec<String> {
    let mut out = vec!["--device".to_owned(), if args.gpu && !args.cpu { "gpu" } else { "cpu" }.to_owned()];
    for stream in &args.redo {
        out.extend(["--redo".to_owned(), stream.name().to_owned()]);
    }
    out
}

/// The folder of what was computed.
fn cache(args: &PerceiveArgs, out: &Path) -> anyhow::Result<PathBuf> {
    let folder = args.cache.clone().unwrap_or_else(|| {
        let mut name = out.file_name().unwrap_or(out.as_os_str()).to_owned();
        name.push(".cache");
        out.with_file_name(name)
    });
    std::fs::create_dir_all(&folder).with_context(|| shown(&folder))?;
    folder.canonicalize().with_context(|| shown(&folder))
}

/// Prints what would run.
fn planned(args: &PerceiveArgs, what: &[&OsStr]) -> anyhow::Result<Answer> {
    let python = Python::plain(args.python.as_deref())?;
    let mut command = python.command(None);
    command.arg("plan").args(what).args(common(args));
    if let Some(model) = &args.depth_model {
        command.arg("--depth-model").arg(model);
    }
    let text = package::said(command)?;
    print(&text)?;
    Ok(Answer::Yes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::import::capture::{At, ImageAt, Picture};

    #[test]
    fn the_facts_count_the_frames_that_will_be_kept() {
        let image = |secs: f64| ImageAt {
            at: At::time(secs),
            picture: Picture::Video { file: "walk.mp4".into(), index: 0, upright: true },
            optics: None,
        };
        let capture = Capture { images: (0..300).map(|i| image(f64::from(i) / 30.0)).collect(), ..Capture::default() };
        let facts = Facts::of(&[capture], &Options::default());
        assert_eq!((facts.images, facts.frames), (300, 100));
        assert!(!facts.poses && !facts.hands && !facts.depth && !facts.clips);
        assert!(facts.text().contains("\"frames\":100"));
        assert_eq!(Facts::of(&[], &Options::default()).frames, 0);
    }
}
