//! ROS 2 recordings in MCAP: a file, or a folder of rosbag2. Among them those of the Stera app (iPhone).
//!
//! Images and depth are told from each other by their encodings, cameras belong to the images of their name space or frame,
//! poses are an odometry's, else poses with a time stamp, else those of tf. What is guessed is noted; `--topic` tells it.

mod bag;
mod choice;
mod tracked;

use std::path::Path;

use bag::{Bag, ImageContent};

use crate::error::{Error, Result};
use crate::import::ImportOptions;
use crate::import::blob::files;
use crate::import::capture::{At, Capture, Depth, DepthAt, ImageAt};
use crate::import::mcap_file::scan;

/// Endings of the files that ROS records to.
const ENDINGS: [&str; 4] = ["mcap", "db3", "bag", "zstd"];
/// Times after this are of the clock that counts from 1970, seconds.
const YEAR_2001_SECS: f64 = 1e9;

fn ending(path: &Path) -> String {
    path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase()).unwrap_or_default()
}

pub(super) fn detect(path: &Path) -> bool {
    if path.is_dir() {
        return path.join("metadata.yaml").is_file() && !files(path, &ENDINGS).is_empty();
    }
    path.is_file() && ["mcap", "db3", "bag"].contains(&ending(path).as_str())
}

pub(super) fn read(path: &Path, options: &ImportOptions) -> Result<Capture> {
    let parts = if path.is_dir() { files(path, &ENDINGS) } else { vec![path.to_owned()] };
    let mut bag = Bag::default();
    let mut notes = Vec::new();
    for part in &parts {
        let way_out = match ending(part).as_str() {
            "db3" | "bag" => Some("pip install rosbags; rosbags-convert --src BAG --dst OUT --dst-storage mcap"),
            "zstd" => Some("unpack it: zstd -d FILE"),
            _ => None,
        };
        if let Some(way_out) = way_out {
            return Err(Error::format(part, "storage", format!("only MCAP is read; {way_out}")));
        }
        let name = part.file_name().unwrap_or_default().to_string_lossy().into_owned();
        notes.extend(scan(part, &mut bag)?.into_iter().map(|fault| format!("{name}: {fault}")));
    }
    capture(path, &bag, notes, options)
}

fn capture(path: &Path, bag: &Bag, mut notes: Vec<String>, options: &ImportOptions) -> Result<Capture> {
    let choice = choice::choose(path, bag, options)?;
    // Where there are no images, depth stands for them.
    let view = choice.color.or(choice.depth);
    let frame = view.and_then(|topic| choice::frame(bag, topic)).unwrap_or_default();
    let tracked = tracked::poses(path, bag, frame, choice.is_stera, options, &mut notes)?;
    let images: Vec<ImageAt> = choice.color.map(|topic| pictures(bag, topic)).unwrap_or_default();
    let optics = view.and_then(|topic| choice::camera(bag, topic)).and_then(|(_, info)| {
        let optics = info.optics(view.is_some_and(choice::is_rectified));
        if optics.is_none() {
            notes.push(format!("the camera's lens \"{}\" with {} coefficients is not known", info.model, info.d.len()));
        }
        optics
    });
    let depth = choice.depth.and_then(|topic| depth(bag, topic, choice.color, &mut notes));
    if images.is_empty() && depth.is_none() && tracked.is_none() {
        return Err(nothing(path, bag));
    }
    for (what, topic) in [("colour", choice.color), ("depth", choice.depth)] {
        notes.extend(topic.map(|topic| format!("{what} is {topic}")));
    }
    notes.extend(bag.broken.iter().map(|(topic, n)| format!("{n} messages of {topic} cannot be read")));
    let first = images
        .first()
        .and_then(|i| i.at.time_secs)
        .or_else(|| tracked.as_ref().and_then(|t| t.poses.items.first()).and_then(|p| p.at.time_secs));
    let (poses, world) = tracked.map(|t| (t.poses, t.world)).unzip();
    let (kind, title) =
        if choice.is_stera { ("stera", "recording of the Stera app") } else { ("mcap", "ROS 2 recording") };
    Ok(Capture {
        kind: kind.to_owned(),
        source: path.to_owned(),
        title: title.to_owned(),
        notes,
        clock: first.filter(|t| *t > YEAR_2001_SECS).map(|_| "unix".to_owned()),
        world: world.unwrap_or_default(),
        optics,
        poses,
        images,
        depth,
        ..Capture::default()
    })
}

/// Colour images of a topic.
fn pictures(bag: &Bag, topic: &str) -> Vec<ImageAt> {
    let seen = bag.images.get(topic).into_iter().flatten();
    seen.filter_map(|seen| match &seen.content {
        ImageContent::Color(picture) => {
            Some(ImageAt { at: At::time(seen.time_secs), picture: picture.clone(), optics: None })
        }
        _ => None,
    })
    .collect()
}

/// Depth of a topic: what is coded as the first image is.
fn depth(bag: &Bag, topic: &str, color: Option<&str>, notes: &mut Vec<String>) -> Option<Depth> {
    let seen = bag.images.get(topic)?;
    let coding = seen.iter().find_map(|s| match &s.content {
        ImageContent::Depth(coding, _) => Some(coding.clone()),
        _ => None,
    })?;
    let items: Vec<DepthAt> = seen
        .iter()
        .filter_map(|s| match &s.content {
            ImageContent::Depth(c, blob) if *c == coding => {
                let at = At::time(s.time_secs);
                Some(DepthAt { at, blob: blob.clone(), confidence: None, optics: None, pose: None })
            }
            _ => None,
        })
        .collect();
    if items.len() < seen.len() {
        notes.push(format!("{} images of {topic} are coded in another way than its first", seen.len() - items.len()));
    }
    let own = choice::camera(bag, topic);
    let of_color = color.and_then(|c| choice::camera(bag, c));
    let is_same = own.map(|(name, _)| name) == of_color.map(|(name, _)| name);
    let optics = own.filter(|_| !is_same).and_then(|(_, info)| info.optics(choice::is_rectified(topic)));
    let color_from_depth = color.and_then(|color| {
        let (color, depth) = (choice::frame(bag, color)?, choice::frame(bag, topic)?);
        if color == depth {
            return None;
        }
        let pose = bag.tree.chain(color, depth).and_then(|chain| chain.at(items.first()?.at.time_secs?));
        if pose.is_none() {
            notes.push(format!(
                "tf does not lead from {color} to {depth}: depth and colour are taken to be of one camera"
            ));
        }
        pose
    });
    Some(Depth { optics, color_from_depth, ..Depth::of(coding, items) })
}

/// A recording without anything to read.
fn nothing(path: &Path, bag: &Bag) -> Error {
    let topics: Vec<&str> = bag.topics.iter().map(String::as_str).take(30).collect();
    let told =
        if topics.is_empty() { "it has no topics".to_owned() } else { format!("its topics: {}", topics.join(", ")) };
    let encodings: Vec<&str> = bag.encodings.iter().map(String::as_str).collect();
    let way_out = if encodings.is_empty() {
        String::new()
    } else {
        let other = encodings.join(", ");
        format!("; messages encoded as {other} are not read: pip install rosbags; rosbags-convert --dst-storage mcap")
    };
    let message =
        format!("no images, depth or poses of ROS 2 (sensor_msgs, nav_msgs, geometry_msgs, tf2_msgs); {told}{way_out}");
    Error::format(path, "topics", message)
}
