//! Which topics hold colour, depth and their cameras.

use std::path::Path;

use super::bag::{Bag, ImageContent, TopicImage};
use crate::error::{Error, Result};
use crate::import::ImportOptions;
use crate::import::capture::{ImageSource, PixelCoding};
use crate::import::ros::CameraInfo;

/// Topics by which the Stera app's recordings are known.
const STERA: [&str; 2] = ["/camera/rgb/compressed", "/camera/pose"];

/// The topics that were told or guessed.
pub(super) struct TopicChoice<'a> {
    /// Of colour images.
    pub color: Option<&'a str>,
    /// Of depth.
    pub depth: Option<&'a str>,
    /// Whether the Stera app wrote the recording.
    pub is_stera: bool,
}

fn is_color(seen: &TopicImage) -> bool {
    matches!(seen.content, ImageContent::Color(_))
}

fn is_depth(seen: &TopicImage) -> bool {
    matches!(seen.content, ImageContent::Depth(..))
}

/// Chooses topics.
///
/// # Errors
/// Where a topic that the user told does not hold what it should.
pub(super) fn choose<'a>(path: &Path, bag: &'a Bag, options: &ImportOptions) -> Result<TopicChoice<'a>> {
    let [image, pose] = STERA;
    let is_stera = bag.images.contains_key(image) && bag.poses.contains_key(pose);
    let color = topic(path, bag, options, "color", is_color, |name, seen| {
        let has = |words: &[&str]| words.iter().any(|w| name.contains(w));
        let grey = |s: &TopicImage| {
            matches!(s.content, ImageContent::Color(ImageSource::Raw { coding: PixelCoding::Grey, .. }))
        };
        let is_named = has(&["rgb", "color", "colour"]) && !has(&["depth"]);
        (is_named, !seen.iter().any(grey), camera(bag, name).is_some(), seen.len())
    })?;
    let seen_by = color.and_then(|c| frame(bag, c));
    let depth = topic(path, bag, options, "depth", is_depth, |name, seen| {
        let is_aligned = name.contains("aligned") || name.contains("registered");
        (frame(bag, name) == seen_by, is_aligned, camera(bag, name).is_some(), seen.len())
    })?;
    Ok(TopicChoice { color, depth, is_stera })
}

/// The topic that the user told, else the one of the highest rank among those that hold what is wanted.
fn topic<'a, R: Ord>(
    path: &Path,
    bag: &'a Bag,
    options: &ImportOptions,
    what: &str,
    fits: fn(&TopicImage) -> bool,
    rank: impl Fn(&str, &[TopicImage]) -> R,
) -> Result<Option<&'a str>> {
    let fitting: Vec<(&'a String, &'a Vec<TopicImage>)> =
        bag.images.iter().filter(|(_, seen)| seen.iter().any(fits)).collect();
    let Some(told) = options.topics.get(what) else {
        return Ok(fitting.iter().max_by_key(|(name, seen)| rank(name, seen)).map(|(name, _)| name.as_str()));
    };
    if let Some((name, _)) = fitting.iter().find(|(name, _)| *name == told) {
        return Ok(Some(name.as_str()));
    }
    let names: Vec<&str> = fitting.iter().map(|(name, _)| name.as_str()).collect();
    let found = if names.is_empty() { "no topic does".to_owned() } else { format!("these do: {}", names.join(", ")) };
    let why = bag.images.get(told).into_iter().flatten().find_map(|s| match &s.content {
        ImageContent::Unread(why) => Some(format!(" but {why}")),
        _ => None,
    });
    let message = format!("holds no images of {what} that are read{}; {found}", why.unwrap_or_default());
    Err(Error::format(path, format!("topic {told}"), message))
}

/// Name of the frame of a topic's images; `None` where they have none.
pub(super) fn frame<'a>(bag: &'a Bag, topic: &str) -> Option<&'a str> {
    let seen = bag.images.get(topic)?.first()?;
    Some(seen.frame.as_str()).filter(|f| !f.is_empty())
}

/// Whether a topic's images are rectified.
pub(super) fn is_rectified(topic: &str) -> bool {
    topic.contains("rect")
}

/// The camera of a topic's images: of their frame, of the nearest name space that holds them, else the only one there is.
pub(super) fn camera<'a>(bag: &'a Bag, topic: &str) -> Option<(&'a str, &'a CameraInfo)> {
    let frame = frame(bag, topic);
    let near = bag.cameras.iter().filter_map(|(name, info)| {
        let (space, _) = name.rsplit_once('/')?;
        let is_in = topic.strip_prefix(space).is_some_and(|rest| rest.is_empty() || rest.starts_with('/'));
        let depth = is_in.then_some(space.len());
        let is_frame = frame == Some(info.header.frame.as_str());
        (is_frame || depth.is_some()).then_some(((is_frame, depth), name.as_str(), info))
    });
    match near.max_by_key(|(rank, ..)| *rank) {
        Some((_, name, info)) => Some((name, info)),
        None if bag.cameras.len() == 1 => bag.cameras.iter().next().map(|(name, info)| (name.as_str(), info)),
        None => None,
    }
}
