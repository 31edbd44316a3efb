//! `paws frames`: which frames `paws twin` would look at, so that networks need see no others.

use std::collections::BTreeMap;
use std::path::PathBuf;

use clap::Args;
use serde_json::{Value, json};

use super::output::write_file;
use super::{Answer, ConfigFile, Opening, print};
use crate::pipeline::frames::{Wanted, Why, wanted};
use crate::recording::Recording;
use crate::report::table::aligned;

#[derive(Debug, Args)]
#[command(
    after_help = "Depth, masks and lines of other frames change nothing in a twin's joints. What is told is known from hands, \
                        poses and clips alone; where clips are to be found by depth, ask again once these frames have it."
)]
pub struct FramesArgs {
    /// The recording's folder; it needs poses and hands
    recording: PathBuf,
    /// Write the frames as JSON to this file, with their images and what each is looked at for
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    #[command(flatten)]
    opening: Opening,
    #[command(flatten)]
    config: ConfigFile,
}

pub fn run(args: &FramesArgs) -> anyhow::Result<Answer> {
    let config = args.config.read()?;
    let recording = args.opening.open(&args.recording)?;
    let frames = wanted(&recording, &config)?;
    if let Some(path) = &args.json {
        write_file(path, crate::json::text(&as_json(&recording, &frames))?)?;
    }
    print(&table(&recording, &frames))?;
    Ok(if frames.is_empty() { Answer::No } else { Answer::Yes })
}

/// The frames with their images, by their paths in the recording's folder.
pub fn as_json(recording: &Recording, frames: &[Wanted]) -> Value {
    let image = |frame: usize| {
        let path = recording.frames.get(frame)?.files.rgb.as_ref()?;
        Some(path.strip_prefix(&recording.dir).unwrap_or(path).to_string_lossy().into_owned())
    };
    let rows: Vec<Value> =
        frames.iter().map(|f| json!({"frame": f.frame, "file": image(f.frame), "why": f.why})).collect();
    json!({"recording": recording.name, "frames": rows})
}

/// How many frames are looked at for what, and their numbers.
fn table(recording: &Recording, frames: &[Wanted]) -> String {
    let mut counts: BTreeMap<Why, usize> = BTreeMap::new();
    for why in frames.iter().flat_map(|f| &f.why) {
        *counts.entry(*why).or_default() += 1;
    }
    let mut rows = vec![["looked at for", "frames"].map(str::to_owned).to_vec()];
    for why in Why::ALL {
        if let Some(count) = counts.get(&why) {
            rows.push(vec![meaning(why).to_owned(), count.to_string()]);
        }
    }
    rows.push(vec!["any of it".to_owned(), format!("{} of {}", frames.len(), recording.frames.len())]);
    let numbers: Vec<String> =
        runs(frames).iter().map(|[a, b]| if a == b { a.to_string() } else { format!("{a}-{b}") }).collect();
    format!("{}\n{}\n", aligned(&rows), numbers.join(" "))
}

fn meaning(why: Why) -> &'static str {
    match why {
        Why::Closed => "a part that is closed",
        Why::Open => "a part that stands open",
        Why::Contact => "whether a hand holds something",
        Why::Survey => "the room when nothing moves",
        Why::Views => "a front's lines",
        Why::Search => "interactions that nobody told",
    }
}

/// First and last of each run of frames that follow each other.
fn runs(frames: &[Wanted]) -> Vec<[usize; 2]> {
    let mut out: Vec<[usize; 2]> = Vec::new();
    for frame in frames.iter().map(|f| f.frame) {
        match out.last_mut() {
            Some(run) if run[1] + 1 == frame => run[1] = frame,
            _ => out.push([frame, frame]),
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_that_follow_each_other_are_told_as_one_run() {
        let frames: Vec<Wanted> = [1, 2, 3, 7, 9, 10].map(|frame| Wanted { frame, why: vec![Why::Open] }).to_vec();
        assert_eq!(runs(&frames), [[1, 3], [7, 7], [9, 10]]);
        assert!(runs(&[]).is_empty());
    }
}
