//! The streams of `paws perceive`, each by one run of the Python package.

use std::collections::BTreeSet;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, bail};
use clap::ValueEnum;
use serde::Deserialize;
use serde_json::{Value, json};

use super::output::{Output, write_file};
use super::perceive_package::{self as package, Python};
use super::{Answer, print, shown};
use crate::config::Config;
use crate::import::ImportOptions;
use crate::import::formats::{self, ImportFormat};
use crate::pipeline::frames;
use crate::recording::{Recording, narration};

/// Images whose depth tells the scale of a reconstruction without a unit: more tell it no better.
const SCALE_IMAGES: usize = 48;
/// Frames are chosen anew where depth of the first choice told more, but no more often than this.
const ROUNDS: usize = 2;

/// A stream that can be made here.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Stream {
    /// Camera poses.
    Poses,
    /// Depth, and normals where the network has them.
    Depth,
    /// Hands.
    Hands,
    /// Masks.
    Masks,
    /// Line segments.
    Lines,
}

impl Stream {
    /// Its name in the package.
    pub fn name(self) -> &'static str {
        match self {
            Self::Poses => "poses",
            Self::Depth => "depth",
            Self::Hands => "hands",
            Self::Masks => "masks",
            Self::Lines => "lines",
        }
    }
}

/// Who is to make a stream.
#[derive(Debug, Clone)]
pub struct Choice {
    stream: Stream,
    network: String,
}

/// A choice from "STREAM=NETWORK".
pub fn choice(text: &str) -> Result<Choice, String> {
    let Some((stream, network)) = text.split_once('=').filter(|(_, network)| !network.is_empty()) else {
        return Err("write STREAM=NETWORK, as poses=mapanything".to_owned());
    };
    match stream {
        "poses" => Ok(Choice { stream: Stream::Poses, network: network.to_owned() }),
        "hands" => Ok(Choice { stream: Stream::Hands, network: network.to_owned() }),
        "lines" => Ok(Choice { stream: Stream::Lines, network: network.to_owned() }),
        _ => {
            Err("poses, hands and lines can be made by several; the network of depth is told by --depth-model"
                .to_owned())
        }
    }
}

/// What a stream was made by.
pub struct Made {
    /// For `import.json`.
    origin: Value,
    /// The same for people.
    pub note: String,
}

/// What the package writes of poses.
#[derive(Deserialize)]
struct Posed {
    images: PathBuf,
    model: PathBuf,
    format: String,
    made: Value,
}

/// What the package writes of the depth of a folder of images.
#[derive(Deserialize)]
struct Measured {
    depth: PathBuf,
    made: Value,
}

/// What all streams are told.
#[derive(Clone, Copy)]
pub struct Job<'a> {
    /// The recording that comes out.
    pub out: &'a Path,
    /// Where what was computed is kept, if the user says it.
    pub cache: Option<&'a Path>,
    /// "cpu" or "gpu".
    pub device: &'static str,
    /// Streams to make anew.
    pub redo: &'a [Stream],
    /// Streams to make that are made only where somebody asks.
    pub make: &'a [Stream],
    /// Who makes them.
    pub by: &'a [Choice],
    /// Networks whose licences are accepted.
    pub accepted: &'a [String],
    /// Weights.
    pub weights: Option<&'a Path>,
    /// The model of depth.
    pub depth_model: Option<&'a Path>,
    /// Whether all frames get depth, masks and lines.
    pub all_frames: bool,
    /// The Python that the user named.
    pub python: Option<&'a Path>,
}

impl Job<'_> {
    fn wants(&self, stream: Stream) -> bool {
        self.make.contains(&stream) || self.redo.contains(&stream)
    }

    /// The folder of what was computed.
    fn cache(&self) -> anyhow::Result<PathBuf> {
        let folder = self.cache.map_or_else(
            || {
                let mut name = self.out.file_name().unwrap_or(self.out.as_os_str()).to_owned();
                name.push(".cache");
                self.out.with_file_name(name)
            },
            Path::to_owned,
        );
        std::fs::create_dir_all(&folder).with_context(|| shown(&folder))?;
        folder.canonicalize().with_context(|| shown(&folder))
    }

    /// Arguments of every stream, `--redo` apart.
    fn common(&self, command: &mut Command) {
        command.args(["--device", self.device]);
        if let Some(weights) = self.weights {
            command.arg("--weights").arg(weights);
        }
        for network in self.accepted {
            command.args(["--accept-licence", network.as_str()]);
        }
    }

    fn redo(&self, command: &mut Command) {
        for stream in self.redo {
            command.args(["--redo", stream.name()]);
        }
    }

    fn by(&self, stream: Stream, command: &mut Command) {
        if let Some(choice) = self.by.iter().find(|choice| choice.stream == stream) {
            command.args(["--by", choice.network.as_str()]);
        }
    }

    /// The command of a stream that works on something.
    fn command(&self, python: &Python, stream: Stream, on: &Path, cache: &Path) -> Command {
        // Masks of hands need what hands need, not the libraries of networks.
        let furniture = self.weights.is_some_and(|w| w.join("grounding-dino").is_dir());
        let extra = if stream == Stream::Masks && !furniture { Stream::Hands.name() } else { stream.name() };
        let mut command = python.command(Some(extra));
        command.arg(stream.name()).arg(on).arg("--cache").arg(cache);
        self.common(&mut command);
        command
    }

    /// Makes poses of the video or the folder of images, and puts them and the images they belong to in its place.
    pub fn posed(
        &self,
        python: &Python,
        sources: &mut Vec<(&'static ImportFormat, PathBuf)>,
        options: &ImportOptions,
    ) -> anyhow::Result<Made> {
        let Some(at) = sources.iter().position(|(format, _)| format.name == "frames") else {
            bail!(
                "no source has poses, and poses are made of a video or a folder of images: give one, or a source with poses"
            );
        };
        let cache = self.cache()?;
        let answer = cache.join("poses.json");
        let (format, source) = sources.remove(at);
        let mut command = self.command(python, Stream::Poses, &source, &cache);
        command.arg("--out").arg(&answer);
        self.redo(&mut command);
        self.by(Stream::Poses, &mut command);
        if options.fps > 0.0 {
            command.arg("--fps").arg(options.fps.to_string());
        }
        if let Some(ffmpeg) = &options.ffmpeg {
            command.arg("--ffmpeg").arg(ffmpeg);
        }
        python.run(command, Stream::Poses.name(), &cache)?;
        let posed: Posed = crate::json::read(&answer)?;
        let Some(reader) = formats::named(&posed.format) else { bail!("no reader for {}", posed.format) };
        if posed.images != source {
            eprintln!("poses: other networks may run on the same images: {}", shown(&posed.images));
        }
        sources.insert(0, (format, posed.images));
        sources.insert(0, (reader, posed.model));
        let counts: Vec<u64> = posed
            .made
            .get("models")
            .and_then(Value::as_array)
            .into_iter()
            .flatten()
            .filter_map(Value::as_u64)
            .collect();
        let (registered, pieces) = (counts.first().copied().unwrap_or(0), counts.len());
        let images = posed.made.get("images").and_then(Value::as_u64).unwrap_or(0);
        let note = format!(
            "poses were made by {} ({}): {registered} of {images} images, the largest of {pieces} piece{}",
            text(&posed.made, "adapter"),
            text(&posed.made, "licence"),
            if pieces == 1 { "" } else { "s" }
        );
        Ok(Made { origin: posed.made, note })
    }

    /// Makes depth of a few of the images where they lie in a folder, and puts it behind the sources: it tells the scale of poses
    /// that have none. `None` where no model was named, there is depth, or there is no such folder.
    pub fn scaled(
        &self,
        python: &Python,
        sources: &mut Vec<(&'static ImportFormat, PathBuf)>,
        has_depth: bool,
    ) -> anyhow::Result<Option<Made>> {
        let folder = sources.iter().find(|(format, path)| format.name == "frames" && path.is_dir());
        let (Some(model), Some((_, images))) = (self.depth_model.filter(|_| !has_depth), folder) else {
            return Ok(None);
        };
        let cache = self.cache()?;
        let answer = cache.join("depth.json");
        let mut command = self.command(python, Stream::Depth, images, &cache);
        command.arg("--out").arg(&answer).arg("--depth-model").arg(model);
        command.arg("--most").arg(SCALE_IMAGES.to_string());
        self.redo(&mut command);
        python.run(command, Stream::Depth.name(), &cache)?;
        let measured: Measured = crate::json::read(&answer)?;
        let Some(moge) = formats::named("moge") else { bail!("no reader for depth") };
        sources.push((moge, measured.depth));
        let [by, kind, licence] = ["adapter", "kind", "licence"].map(|key| text(&measured.made, key).to_owned());
        let note = format!("depth was made by {by}, {kind} ({licence})");
        Ok(Some(Made { origin: measured.made, note }))
    }

    /// Makes in the staged recording what it lacks and what was asked for; whether there are hands.
    pub fn fill(&self, python: &Python, output: &Output, wants_hands: bool) -> anyhow::Result<bool> {
        let folder = folder_of(output)?;
        let mut found = true;
        if wants_hands {
            found = self.hands(python, &folder, true)?;
        }
        if let Some(model) = self.depth_model {
            if found {
                found = self.depth(python, &folder, model, wants_hands)?;
            } else {
                eprintln!("depth: is not made, as nobody's hand opens anything");
            }
        }
        let cache = self.cache()?;
        for stream in [Stream::Masks, Stream::Lines].into_iter().filter(|&stream| self.wants(stream)) {
            if stream == Stream::Lines && python.is_uv() {
                bail!("lines: DeepLSD and LIMAP run in a Python of their own: name it with --python PATH");
            }
            let mut command = self.command(python, stream, &folder, &cache);
            self.redo(&mut command);
            self.by(stream, &mut command);
            if stream == Stream::Masks {
                command.arg("--words").arg(narration::furniture_names().join(","));
            }
            if let Some(numbers) = self.looked_at(&folder) {
                command.arg("--frames").arg(frames_file(&cache, &numbers.into_iter().collect::<Vec<_>>())?);
            }
            python.run(command, stream.name(), &cache)?;
        }
        Ok(found)
    }

    /// Depth of the frames that are looked at. Hands that were made are made again after it: where they are is told by depth. Whether
    /// there are hands.
    fn depth(&self, python: &Python, folder: &Path, model: &Path, wants_hands: bool) -> anyhow::Result<bool> {
        let cache = self.cache()?;
        let mut done: BTreeSet<usize> = BTreeSet::new();
        let mut found = true;
        for round in 0..ROUNDS {
            let wanted = self.looked_at(folder);
            let fresh: Option<Vec<usize>> = wanted.map(|w| w.difference(&done).copied().collect());
            if fresh.as_ref().is_some_and(Vec::is_empty) {
                break;
            }
            let mut command = self.command(python, Stream::Depth, folder, &cache);
            command.arg("--depth-model").arg(model);
            // What the round before has made is not made again.
            if round == 0 {
                self.redo(&mut command);
            }
            if let Some(numbers) = &fresh {
                command.arg("--frames").arg(frames_file(&cache, numbers)?);
            }
            python.run(command, Stream::Depth.name(), &cache)?;
            if wants_hands {
                found = self.hands(python, folder, false)?;
            }
            match fresh {
                Some(numbers) if found => done.extend(numbers),
                _ => break,
            }
        }
        Ok(found)
    }

    /// The frames that `paws twin` would look at; `None`: all, as the user wishes or as nobody can tell.
    fn looked_at(&self, folder: &Path) -> Option<BTreeSet<usize>> {
        if self.all_frames {
            return None;
        }
        let wanted = Recording::open_unjudged(folder, false)
            .and_then(|recording| Ok((frames::wanted(&recording, &Config::default())?, recording.frames.len())));
        match wanted {
            Ok((wanted, count)) if !wanted.is_empty() => {
                eprintln!("{} of {count} frames are looked at; --all-frames takes all", wanted.len());
                Some(wanted.into_iter().map(|w| w.frame).collect())
            }
            Ok(_) => None,
            Err(error) => {
                eprintln!("all frames are taken, as which are looked at cannot be told: {error}");
                None
            }
        }
    }

    /// Makes the hands of the staged recording; whether there are any. `first`: not made in this run before.
    fn hands(&self, python: &Python, folder: &Path, first: bool) -> anyhow::Result<bool> {
        let cache = self.cache()?;
        let mut command = self.command(python, Stream::Hands, folder, &cache);
        self.by(Stream::Hands, &mut command);
        if first {
            self.redo(&mut command);
        }
        let found = python.run(command, Stream::Hands.name(), &cache)?;
        if !folder.join("hands.json").is_file() {
            bail!("hands: nothing was written; the reason stands above");
        }
        Ok(found)
    }
}

/// A text of what the package says of a stream.
fn text<'a>(made: &'a Value, key: &str) -> &'a str {
    made.get(key).and_then(Value::as_str).unwrap_or("-")
}

/// The staged recording's folder.
fn folder_of(output: &Output) -> anyhow::Result<PathBuf> {
    match output.path("hands.json")?.parent() {
        Some(folder) => Ok(folder.to_owned()),
        None => bail!("a folder for streams"),
    }
}

/// Writes numbers of frames where the package reads them.
fn frames_file(cache: &Path, numbers: &[usize]) -> anyhow::Result<PathBuf> {
    let path = cache.join("frames.json");
    write_file(&path, json!(numbers).to_string())?;
    Ok(path)
}

/// Adds to the staged `import.json` who made streams before the recording was joined.
pub fn add_origins(output: &Output, made: &[Made]) -> anyhow::Result<()> {
    if made.is_empty() {
        return Ok(());
    }
    let mut report: Value = crate::json::read(&output.path("import.json")?)?;
    if let Some(report) = report.as_object_mut() {
        report.insert("perceived".to_owned(), made.iter().map(|m| m.origin.clone()).collect());
    }
    output.write("import.json", crate::json::text(&report)?)
}

/// Prints what would run.
pub fn planned(job: &Job, what: &[&OsStr]) -> anyhow::Result<Answer> {
    let python = Python::plain(job.python)?;
    let mut command = python.command(None);
    command.arg("plan").args(what);
    job.common(&mut command);
    job.redo(&mut command);
    for stream in job.make {
        command.args(["--make", stream.name()]);
    }
    for choice in job.by {
        command.arg("--by").arg(format!("{}={}", choice.stream.name(), choice.network));
    }
    if let Some(model) = job.depth_model {
        command.arg("--depth-model").arg(model);
    }
    print(&package::said(command)?)?;
    Ok(Answer::Yes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn networks_are_chosen_for_the_streams_that_several_make() {
        let chosen = choice("poses=mapanything").unwrap();
        assert_eq!((chosen.stream, chosen.network.as_str()), (Stream::Poses, "mapanything"));
        for wrong in ["poses", "poses=", "=wilor", "depth=moge", "clips=x"] {
            assert!(choice(wrong).is_err(), "{wrong}");
        }
    }
}
