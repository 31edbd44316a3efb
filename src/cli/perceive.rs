//! `paws perceive`: the streams that a recording lacks, made by networks that the Python package in `perceive/` runs.
//!
//! What a source holds is joined by the code of `paws import`; this command finds out what is missing, starts the package for
//! each such stream, and leaves a recording that is whole or not there. Nothing here knows a network.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use clap::Args;
use serde_json::json;

use super::import::{self, ConventionArgs, FrameArgs};
use super::output::{Kind, Output};
use super::perceive_package::Python;
use super::perceive_streams::{self as streams, Choice, Job, Stream};
use super::progress::Steps;
use super::{Answer, print, shown};
use crate::import::formats::ImportFormat;
use crate::import::{Capture, ImportOptions, assemble};

/// Image width of the recording where the user says none, pixels: hands at arm's length are some 100 pixels large then.
const WIDTH: u32 = 960;
/// Frames a second of images without times, where nobody says it.
const SOURCE_FPS: f64 = 30.0;
/// What is not copied of a recording whose hands are made anew.
const HANDS: [&str; 2] = ["hands.json", "fingertips.csv"];

#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    paws perceive --plan scan said.srt                  what would run, how long, under which licences; runs nothing\n  \
    paws perceive scan said.srt --out rec               a phone's scan with depth: its hands, on a CPU\n  \
    paws perceive rec --redo hands --out better         a recording of ours, its hands made anew\n  \
    paws perceive walk.mp4 moge=DEPTH said.srt --out rec\n  \
    paws perceive walk.mp4 --depth-model MODEL --make masks --weights DIR --gpu --out rec\n\
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
    /// Make a stream that is made only where it is asked for: masks (of hands by their joints; of furniture, too, by networks
    /// in --weights), lines; may be given several times
    #[arg(long, value_name = "STREAM", value_enum)]
    make: Vec<Stream>,
    /// Who makes a stream, where several can: poses=mapanything, hands=wilor, lines=limap; may be given several times
    #[arg(long, value_name = "STREAM=NETWORK", value_parser = streams::choice)]
    by: Vec<Choice>,
    /// Accept a network's licence that forbids some uses; the networks say which; may be given several times
    #[arg(long, value_name = "NETWORK", visible_alias = "accept-license")]
    accept_licence: Vec<String>,
    /// A folder with the networks' weights, for those whose weights do not come with the packages
    #[arg(long, value_name = "DIR")]
    weights: Option<PathBuf>,
    /// Make depth by a metric model of the `transformers` library, or MoGe-2: its folder, as its authors publish it
    #[arg(long, value_name = "DIR")]
    depth_model: Option<PathBuf>,
    /// Make depth, masks and lines of all frames, not only of those that `paws twin` looks at (`paws frames`)
    #[arg(long)]
    all_frames: bool,
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

/// What the sources hold.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Facts {
    images: usize,
    frames: usize,
    poses: bool,
    depth: bool,
    hands: bool,
    masks: bool,
    lines: bool,
    clips: bool,
}

impl Facts {
    fn of(captures: &[Capture], options: &ImportOptions) -> Self {
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
            masks: any(|c| c.masks.is_some()),
            lines: any(|c| !c.segments.is_empty()),
            clips: any(|c| !c.clips.is_empty()),
        }
    }

    fn text(self) -> String {
        let Self { images, frames, poses, depth, hands, masks, lines, clips } = self;
        json!({"images": images, "frames": frames, "poses": poses, "depth": depth, "hands": hands, "masks": masks,
            "lines": lines, "clips": clips})
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
    if let Some(model) = args.depth_model.as_ref().filter(|m| !m.is_dir()) {
        bail!(
            "{}: --depth-model wants a folder with config.json and model.safetensors in it, or with MoGe's model.pt",
            shown(model)
        );
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

/// A recording of ours: it is copied, and what it lacks is made.
fn recording(args: &PerceiveArgs, source: &Path) -> anyhow::Result<Answer> {
    if args.plan {
        return streams::planned(&args.job(Path::new("")), &[source.as_os_str()]);
    }
    let Some(out) = &args.out else { bail!("--out DIR is needed") };
    let wants = |stream: Stream| args.redo.contains(&stream) || args.make.contains(&stream);
    if wants(Stream::Poses) {
        bail!(
            "{}: is a recording, whose poses stay; other poses are made of the sources it was made of",
            shown(source)
        );
    }
    if wants(Stream::Depth) && args.depth_model.is_none() {
        bail!("depth: name the folder of a model that makes it: --depth-model DIR");
    }
    let has_hands = HANDS.iter().any(|name| source.join(name).is_file());
    let wanted = !has_hands || wants(Stream::Hands);
    let more = args.depth_model.is_some() || wants(Stream::Masks) || wants(Stream::Lines);
    let python = (wanted || more).then(|| Python::find(args.python.as_deref())).transpose()?;
    let output = Output::new(out, Kind::Recording, &[source])?;
    copy(source, "", &output, wanted)?;
    let found = match &python {
        Some(python) => args.job(out).fill(python, &output, wanted)?,
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
fn sources(args: &PerceiveArgs, options: &ImportOptions) -> anyhow::Result<Answer> {
    let mut sources = import::resolve(&args.sources)?;
    let mut captures = read(&sources, options)?;
    let facts = Facts::of(&captures, options);
    if args.plan {
        return streams::planned(&args.job(Path::new("")), &[OsStr::new("--facts"), OsStr::new(&facts.text())]);
    }
    let Some(out) = &args.out else { bail!("--out DIR is needed") };
    let job = args.job(out);
    // Told before hours of work, not after them. Hands that are there may yet meet no frame.
    let python = Python::find(args.python.as_deref());
    let redo_hands = args.redo.contains(&Stream::Hands);
    let asks = args.depth_model.is_some() || !args.make.is_empty() || !args.redo.is_empty();
    let idle = facts.poses && facts.hands && !asks;
    let python = if idle { python.ok() } else { Some(python?) };
    let inputs: Vec<PathBuf> = sources.iter().map(|(_, path)| path.clone()).collect();
    let inputs: Vec<&Path> = inputs.iter().map(PathBuf::as_path).collect();
    let output = Output::new(out, Kind::Recording, &inputs)?;
    if facts.poses && args.redo.contains(&Stream::Poses) {
        bail!("--redo poses: the sources have poses of their own, which are taken");
    }
    let mut made = Vec::new();
    if let Some(python) = python.as_ref().filter(|_| !idle) {
        if !facts.poses {
            made.push(job.posed(python, &mut sources, options)?);
        }
        made.extend(job.scaled(python, &mut sources, facts.depth)?);
    }
    if !made.is_empty() {
        captures = read(&sources, options)?;
    }
    if redo_hands {
        captures.iter_mut().for_each(|c| c.hands = None);
    }
    let mut imported = assemble(captures, options)?;
    imported.report.changes.extend(made.iter().map(|m| m.note.clone()));
    let steps = Steps::new();
    import::write(&mut imported, &output, &steps)?;
    steps.finish();
    streams::add_origins(&output, &made)?;
    let wants_hands = imported.hands.is_empty();
    let mut found = true;
    match &python {
        Some(python) => found = job.fill(python, &output, wants_hands)?,
        None if wants_hands => bail!("none of the given hands meets a frame, and making others needs uv or Python"),
        None => {}
    }
    let depth = args.depth_model.is_some();
    let is_made = |what: &str| (wants_hands && what == Stream::Hands.name()) || (depth && what == Stream::Depth.name());
    imported.report.missing.retain(|m| !(found && is_made(m.what.as_str())));
    output.finish()?;
    print(&import::told(&imported, out))?;
    Ok(if found && imported.report.findings.is_empty() { Answer::Yes } else { Answer::No })
}

fn read(sources: &[(&'static ImportFormat, PathBuf)], options: &ImportOptions) -> anyhow::Result<Vec<Capture>> {
    let mut captures = Vec::with_capacity(sources.len());
    for (format, path) in sources {
        captures.push((format.read)(path, options)?);
    }
    Ok(captures)
}

impl PerceiveArgs {
    /// What the streams need to know, for a recording at a place.
    fn job<'a>(&'a self, out: &'a Path) -> Job<'a> {
        Job {
            out,
            cache: self.cache.as_deref(),
            device: if self.gpu && !self.cpu { "gpu" } else { "cpu" },
            redo: &self.redo,
            make: &self.make,
            by: &self.by,
            accepted: &self.accept_licence,
            weights: self.weights.as_deref(),
            depth_model: self.depth_model.as_deref(),
            all_frames: self.all_frames,
            python: self.python.as_deref(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::import::capture::{At, ImageAt, ImageSource};

    #[test]
    fn the_facts_count_the_frames_that_will_be_kept() {
        let image = |secs: f64| ImageAt {
            at: At::time(secs),
            picture: ImageSource::Video { file: "walk.mp4".into(), index: 0, upright: true },
            optics: None,
        };
        let capture = Capture { images: (0..300).map(|i| image(f64::from(i) / 30.0)).collect(), ..Capture::default() };
        let facts = Facts::of(&[capture], &ImportOptions::default());
        assert_eq!((facts.images, facts.frames), (300, 100));
        assert!(!facts.poses && !facts.hands && !facts.depth && !facts.clips);
        assert!(facts.text().contains("\"frames\":100"));
        assert_eq!(Facts::of(&[], &ImportOptions::default()).frames, 0);
    }
}
