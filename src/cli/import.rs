//! `paws import`.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use clap::Args;
use rayon::prelude::*;

use super::output::{Kind, Output};
use super::progress::Steps;
use super::{Answer, print, shown};
use crate::import::capture::{CameraAxes, Direction, QuaternionOrder};
use crate::import::formats::{self, ImportFormat};
use crate::import::optics::Optics;
use crate::import::{Capture, ImportOptions, Imported, Written, assemble, axes};
use crate::math::Vector;
use crate::report::table::aligned;

/// Frames that are decoded at a time: enough for all cores, few enough for the memory.
const AT_ONCE: usize = 16;
/// Image width where the user says none, pixels: twice the width that the pipeline was measured at.
const WIDTH: u32 = 640;
/// Items that could not be read that are listed before "and n more".
const MAX_LISTED: usize = 5;

#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    paws import scan hands.jsonl said.srt --out rec     a phone's scan, hands of a network, subtitles\n  \
    paws import walk moge=DEPTH --rotate 90 --out rec   Project Aria, depth of MoGe-2\n  \
    paws import work/sparse/0 IMAGES moge=DEPTH hands.jsonl said.srt --source-fps 10 --out rec\n\
    What each device lacks and what fills it: README.md; step by step: docs/import.md.")]
pub struct ImportArgs {
    /// Files and folders, the most important one first; each stream is taken from the first source that has it. The formats
    /// are told from the files; a format's name before them, or KIND=PATH, forces one
    #[arg(value_name = "[KIND] SOURCE", required_unless_present = "list")]
    sources: Vec<PathBuf>,
    /// Print the formats
    #[arg(long)]
    list: bool,
    /// Folder for the recording
    #[arg(long, value_name = "DIR", required_unless_present_any = ["list", "check"])]
    out: Option<PathBuf>,
    /// Set the options that certainly are right where the poses, hands or clocks as declared contradict each other
    #[arg(long)]
    fix: bool,
    /// Write nothing: say what of the given recordings (folders of ours) contradicts itself, and what sets it right
    #[arg(long, conflicts_with_all = ["out", "fix"])]
    check: bool,
    #[command(flatten)]
    frames: FrameArgs,
    #[command(flatten)]
    convention: ConventionArgs,
}

/// Which frames, and how they look.
#[derive(Debug, Args)]
pub struct FrameArgs {
    /// Frames a second that are kept; 0 keeps all
    #[arg(long, value_name = "HZ", default_value_t = 10.0)]
    fps: f64,
    /// Frames a second of images that hold no times; narrations and hands by time need it [default: 30]
    #[arg(long, value_name = "HZ")]
    source_fps: Option<f64>,
    /// Largest distance in time at which two streams are joined [default: half of the frames' period]
    #[arg(long, value_name = "SECS")]
    max_gap: Option<f64>,
    /// Largest distance in time of two poses that are interpolated
    #[arg(long, value_name = "SECS", default_value_t = 0.2)]
    pose_gap: f64,
    /// Image width of the recording at the most; images are never enlarged [default: 640; of `paws perceive` 960]
    #[arg(long, value_name = "PIXELS", value_parser = clap::value_parser!(u32).range(64..=4096))]
    width: Option<u32>,
    /// Field of view of the recording at the most, along the width [default: 100 for fisheyes]
    #[arg(long, value_name = "DEGREES")]
    fov: Option<f64>,
    /// Turn the images clockwise: 90 for Project Aria
    #[arg(long, value_name = "DEGREES", default_value = "0", value_parser = quarters)]
    rotate: u8,
    /// Intrinsics of the images, where no source has them: WIDTH,HEIGHT,FX,FY,CX,CY in pixels
    #[arg(long, value_name = "W,H,FX,FY,CX,CY", value_parser = camera)]
    camera: Option<Optics>,
    /// A topic of a ROS recording: color=/TOPIC, depth=/TOPIC or poses=/TOPIC (or poses=tf); may be given several times
    /// [default: guessed from types, names and frames]
    #[arg(long, value_name = "WHAT=TOPIC", value_parser = topic)]
    topic: Vec<(String, String)>,
    /// The ffmpeg program, ffprobe beside it [default: the installed one]
    #[arg(long, value_name = "PATH")]
    ffmpeg: Option<PathBuf>,
}

/// What is said over a source's own declarations.
#[derive(Debug, Args)]
pub struct ConventionArgs {
    /// Up in the axes of the source with the poses: x, y, z, -x, -y or -z
    #[arg(long, value_name = "AXIS", allow_hyphen_values = true, value_parser = axes::axis)]
    up: Option<Vector>,
    /// Metres per unit of the source with the poses: 0.001 for millimetres
    #[arg(long, value_name = "METRES")]
    unit: Option<f64>,
    /// What poses map
    #[arg(long, value_enum)]
    poses: Option<Direction>,
    /// Axes of the posed camera
    #[arg(long, value_enum)]
    camera_axes: Option<CameraAxes>,
    /// Order of a quaternion's numbers
    #[arg(long, value_enum)]
    quaternion: Option<QuaternionOrder>,
    /// Metres per unit of a source of arbitrary scale [default: from depth, or from the size of hands]
    #[arg(long, value_name = "METRES")]
    scale: Option<f64>,
    /// Added to the hands' times: negative where hands come late
    #[arg(long, value_name = "SECS", default_value_t = 0.0, allow_negative_numbers = true)]
    hand_lag: f64,
}

fn quarters(text: &str) -> Result<u8, String> {
    match text {
        "0" => Ok(0),
        "90" => Ok(1),
        "180" => Ok(2),
        "270" => Ok(3),
        _ => Err("write 0, 90, 180 or 270".to_owned()),
    }
}

fn camera(text: &str) -> Result<Optics, String> {
    let numbers: Vec<f64> = text.split(',').filter_map(|n| n.trim().parse().ok()).collect();
    let [width, height, fx, fy, cx, cy] = numbers[..] else {
        return Err(format!("\"{text}\" is not WIDTH,HEIGHT,FX,FY,CX,CY"));
    };
    let optics = Optics::pinhole(width.max(0.0) as usize, height.max(0.0) as usize, [fx, fy, cx, cy]);
    optics.fault().map_or(Ok(optics), Err)
}

fn topic(text: &str) -> Result<(String, String), String> {
    match text.split_once('=') {
        Some((what @ ("color" | "depth" | "poses"), topic)) if !topic.is_empty() => {
            Ok((what.to_owned(), topic.to_owned()))
        }
        _ => Err("write color=/TOPIC, depth=/TOPIC or poses=/TOPIC".to_owned()),
    }
}

/// The options that the arguments say. `width`: the images', pixels, where they do not say it.
pub fn options(f: &FrameArgs, c: &ConventionArgs, width: u32) -> anyhow::Result<ImportOptions> {
    for (name, value) in [
        ("--source-fps", f.source_fps),
        ("--fov", f.fov),
        ("--unit", c.unit),
        ("--scale", c.scale),
        ("--max-gap", f.max_gap),
        ("--pose-gap", Some(f.pose_gap)),
    ] {
        if let Some(value) = value.filter(|v| !v.is_finite() || *v <= 0.0) {
            bail!("{name} {value}: give a number above 0");
        }
    }
    if !f.fps.is_finite() || f.fps < 0.0 || !c.hand_lag.is_finite() {
        bail!("--fps {} and --hand-lag {}: give finite numbers, --fps from 0 on", f.fps, c.hand_lag);
    }
    Ok(ImportOptions {
        fps: f.fps,
        source_fps: f.source_fps,
        max_gap_secs: f.max_gap,
        pose_gap_secs: f.pose_gap,
        width: f.width.unwrap_or(width) as usize,
        fov_deg: f.fov,
        rotate_quarters: f.rotate,
        camera: f.camera,
        up: c.up,
        unit_m: c.unit,
        poses: c.poses,
        camera_axes: c.camera_axes,
        quaternion: c.quaternion,
        scale: c.scale,
        hand_lag_secs: c.hand_lag,
        topics: f.topic.iter().cloned().collect(),
        ffmpeg: f.ffmpeg.clone(),
    })
}

/// The sources with their formats. A first word that names a format and no file is the format of all that name none.
pub fn resolve(sources: &[PathBuf]) -> anyhow::Result<Vec<(&'static ImportFormat, PathBuf)>> {
    let (forced, rest) = match sources {
        [first, rest @ ..] if !first.exists() => match first.to_str().and_then(formats::named) {
            Some(format) => (Some(format), rest),
            None => (None, sources),
        },
        _ => (None, sources),
    };
    if rest.is_empty() {
        bail!("a source is needed: paws import [KIND] SOURCE... --out DIR; --list prints the formats");
    }
    let mut out = Vec::new();
    for source in rest {
        let pair = source.to_str().filter(|_| !source.exists()).and_then(|text| text.split_once('='));
        out.push(match (pair.and_then(|(kind, path)| Some((formats::named(kind)?, path))), forced) {
            (Some((format, path)), _) => (format, PathBuf::from(path)),
            (None, Some(format)) => (format, source.clone()),
            (None, None) => (formats::detect(source)?, source.clone()),
        });
    }
    if let Some((_, path)) = out.iter().find(|(_, path)| !path.exists()) {
        bail!("{}: no such file or folder", path.display());
    }
    Ok(out)
}

pub fn run(args: &ImportArgs) -> anyhow::Result<Answer> {
    if args.list {
        print(&list())?;
        return Ok(Answer::Yes);
    }
    if args.check {
        return super::door::check(&args.sources);
    }
    let Some(out) = &args.out else { bail!("--out DIR is needed") };
    let options = options(&args.frames, &args.convention, WIDTH)?;
    let sources = resolve(&args.sources)?;
    let inputs: Vec<&Path> = sources.iter().map(|(_, path)| path.as_path()).collect();
    let output = Output::new(out, Kind::Recording, &inputs)?;
    let steps = Steps::new();
    let mut captures: Vec<Capture> = Vec::new();
    for (i, (format, path)) in sources.iter().enumerate() {
        steps.report("reading", i, sources.len());
        captures.push((format.read)(path, &options)?);
    }
    let mut imported = if args.fix { fixed(&captures, options)? } else { assemble(captures, &options)? };
    write(&mut imported, &output, &steps)?;
    steps.finish();
    output.finish()?;
    print(&told(&imported, out))?;
    Ok(if imported.report.findings.is_empty() { Answer::Yes } else { Answer::No })
}

/// The recording under the options that its own findings ask for, where they are certain.
fn fixed(captures: &[Capture], mut options: ImportOptions) -> anyhow::Result<Imported> {
    /// Corrections may uncover what they hid: up, after poses that were inverted.
    const ROUNDS: usize = 3;
    let mut done = Vec::new();
    let mut imported = assemble(captures.to_vec(), &options)?;
    for _ in 0..ROUNDS {
        let certain: Vec<_> = imported.report.findings.iter().filter(|f| f.can_be_fixed).cloned().collect();
        if certain.is_empty() {
            break;
        }
        for finding in certain {
            finding.changes.iter().for_each(|change| change.apply(&mut options));
            done.push(format!("corrected by {}: {}: {}", finding.option, finding.what, finding.evidence));
        }
        imported = assemble(captures.to_vec(), &options)?;
    }
    imported.report.changes.extend(done);
    Ok(imported)
}

/// Writes images, then the tables that name them.
pub fn write(imported: &mut Imported, output: &Output, steps: &Steps) -> anyhow::Result<()> {
    let pictures = imported.video_pictures();
    if pictures > 0 {
        steps.report("decoding video", 0, pictures);
        imported.extract(|number| {
            let inside = output.path(&format!(".video/{number:03}/000001.jpg"))?;
            inside.parent().map(Path::to_owned).context("a folder for pictures")
        })?;
    }
    let total = imported.frames.len();
    let mut names = BTreeSet::new();
    let mut faults = Vec::new();
    for first in (0..total).step_by(AT_ONCE) {
        let end = (first + AT_ONCE).min(total);
        let written: Vec<Written> = (first..end).into_par_iter().map(|frame| imported.images(frame)).collect();
        for frame in written {
            for (name, bytes) in frame.files {
                output.write(&name, bytes)?;
                names.insert(name);
            }
            faults.extend(frame.faults);
        }
        steps.report("images", end, total);
    }
    if pictures > 0 {
        let folder = output.path(".video/x")?;
        if let Some(folder) = folder.parent() {
            std::fs::remove_dir_all(folder).with_context(|| folder.display().to_string())?;
        }
    }
    imported.report.faults.extend(faults);
    for (name, text) in imported.tables(&names)? {
        output.write(&name, text)?;
    }
    Ok(())
}

fn list() -> String {
    let mut rows = vec![["kind", "what", "holds"].map(str::to_owned).to_vec()];
    rows.extend(formats::ALL.iter().map(|f| [f.name, f.title, f.holds].map(str::to_owned).to_vec()));
    aligned(&rows)
}

/// What came out, for the terminal.
pub fn told(imported: &Imported, out: &Path) -> String {
    let report = &imported.report;
    let mut rows = vec![["stream", "count", "of", "source", "joined by"].map(str::to_owned).to_vec()];
    rows.extend(
        report.streams.iter().map(|s| {
            vec![s.stream.clone(), s.count.to_string(), s.of.to_string(), s.source.clone(), s.joined_by.clone()]
        }),
    );
    let mut text = aligned(&rows);
    if let Some(scale) = &report.scale {
        let off = scale.relative_std.map_or_else(String::new, |s| format!(", to {:.1} %", 100.0 * s));
        text += &format!("scale: {:.5} m a unit, from {}{off}\n", scale.metres_per_unit, scale.from);
    }
    if let Some(up) = &report.up {
        let [x, y, z] = up.direction;
        text += &format!("up: {x:.3} {y:.3} {z:.3} of the source, to {:.0} degrees, from {}\n", up.std_deg, up.from);
    }
    for change in &report.changes {
        text += &format!("note: {change}\n");
    }
    for dropped in &report.dropped {
        text += &format!("left out: {dropped}\n");
    }
    for fault in report.faults.iter().take(MAX_LISTED) {
        text += &format!("cannot be read: {fault}\n");
    }
    if report.faults.len() > MAX_LISTED {
        text += &format!("cannot be read: {} more, all in import.json\n", report.faults.len() - MAX_LISTED);
    }
    for missing in &report.missing {
        text += &format!("missing: {} ({})\n  {}\n", missing.what, missing.why, missing.command);
    }
    for finding in &report.findings {
        text += &format!("doubtful: {}: {}\n  {}\n", finding.what, finding.evidence, finding.option);
    }
    text + &format!("{}\n", shown(out))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_source_forces_its_format_and_a_file_of_that_name_does_not() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("track.txt");
        std::fs::write(&path, "0 0 0 0 0 0 0 1\n").unwrap();
        let kinds = |sources: &[PathBuf]| -> Vec<&'static str> {
            resolve(sources).unwrap().iter().map(|(f, _)| f.name).collect()
        };
        assert_eq!(kinds(std::slice::from_ref(&path)), ["tum"]);
        assert_eq!(kinds(&["frames".into(), path.clone()]), ["frames"]);
        let pair = PathBuf::from(format!("stray={}", path.display()));
        assert_eq!(kinds(&[path.clone(), pair]), ["tum", "stray"]);
        for (sources, word) in [
            (vec![PathBuf::from("tum")], "a source is needed"),
            (vec![PathBuf::from("nowhere")], "nowhere: no such file"),
            (vec![PathBuf::from("tum"), PathBuf::from("nowhere")], "nowhere: no such file"),
        ] {
            let error = resolve(&sources).unwrap_err().to_string();
            assert!(error.contains(word), "{error}");
        }
    }

    #[test]
    fn arguments_are_checked() {
        assert_eq!(quarters("90"), Ok(1));
        assert!(quarters("45").is_err());
        assert_eq!(camera("640,480,400,400,319.5,239.5").unwrap().width, 640);
        assert_eq!(topic("color=/a/b").unwrap(), ("color".to_owned(), "/a/b".to_owned()));
        assert!(topic("colour=/a").is_err() && topic("color").is_err() && topic("depth=").is_err());
        assert!(camera("640,480,400").is_err() && camera("0,0,1,1,1,1").is_err());
    }
}
