//! What is asked of a recording's pictures before, and while, they are used: whether they can be decoded, and whether depth is in
//! the hands' unit.

use std::path::{Path, PathBuf};

use rayon::prelude::*;

use super::{FrameFiles, Recording};
use crate::config;
use crate::error::{Error, Result};
use crate::math::stats;

/// A kind of pictures.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Picture {
    Image,
    Depth,
    Normals,
    Mask,
    Segments,
}

impl Picture {
    pub(crate) const ALL: [Self; 5] = [Self::Image, Self::Depth, Self::Normals, Self::Mask, Self::Segments];

    fn word(self) -> &'static str {
        match self {
            Self::Image => "images",
            Self::Depth => "depth",
            Self::Normals => "normals",
            Self::Mask => "masks",
            Self::Segments => "segments",
        }
    }

    fn file(self, files: &FrameFiles) -> Option<&Path> {
        match self {
            Self::Image => files.rgb.as_deref(),
            Self::Depth => files.depth.as_deref(),
            Self::Normals => files.normals.as_deref(),
            Self::Mask => files.mask.as_deref(),
            Self::Segments => files.segments.as_deref(),
        }
    }

    /// The name of a frame's picture of this kind, to take it away.
    pub(crate) fn file_mut(self, files: &mut FrameFiles) -> &mut Option<PathBuf> {
        match self {
            Self::Image => &mut files.rgb,
            Self::Depth => &mut files.depth,
            Self::Normals => &mut files.normals,
            Self::Mask => &mut files.mask,
            Self::Segments => &mut files.segments,
        }
    }

    /// Whether an error is about a picture of this kind.
    pub(crate) fn is_meant(self, recording: &Recording, error: &Error) -> bool {
        let (Error::Format { path, .. } | Error::Io { path, .. }) = error else { return false };
        recording.frames.iter().any(|frame| self.file(&frame.files) == Some(path))
    }

    /// The frames whose picture of this kind cannot be decoded, and why: all pictures of this kind are decoded.
    ///
    /// # Errors
    /// So many of them that the recording was not exported as it should be.
    pub(crate) fn damaged(self, recording: &Recording, rules: &config::Pictures) -> Result<Vec<(usize, String)>> {
        let there: Vec<usize> =
            (0..recording.frames.len()).filter(|&f| self.file(&recording.frames[f].files).is_some()).collect();
        let decoded = |frame: usize| match self {
            Self::Image => recording.rgb(frame).map(drop),
            Self::Depth => recording.depth_as_read(frame).map(drop),
            Self::Normals => recording.normals(frame).map(drop),
            Self::Mask => recording.mask(frame).map(drop),
            Self::Segments => recording.segments(frame).map(drop),
        };
        let damaged: Vec<(usize, String)> =
            there.par_iter().filter_map(|&f| Some((f, decoded(f).err()?.to_string()))).collect();
        let allowed = (rules.damaged_share * there.len() as f64).max(rules.damaged as f64);
        let Some((_, first)) = damaged.first().filter(|_| damaged.len() as f64 > allowed) else { return Ok(damaged) };
        let (bad, all, kind) = (damaged.len(), there.len(), self.word());
        Err(Error::Recording {
            path: recording.dir.clone(),
            faults: vec![format!("{kind}: {bad} of {all} cannot be read: export them again; the first one: {first}")],
        })
    }
}

/// Zero depth everywhere, or depth in another unit than the hands, is an export gone wrong, not a scene; a few frames tell.
///
/// # Errors
/// Either of them, and depth that cannot be decoded.
pub(crate) fn check_depth(recording: &Recording, rules: &config::Pictures) -> Result<()> {
    let has_depth = |frame: usize| recording.frames[frame].files.depth.is_some();
    let with_depth: Vec<usize> = (0..recording.frames.len()).filter(|&f| has_depth(f)).collect();
    if with_depth.is_empty() {
        return Ok(());
    }
    let wrong = |fault: String| Err(Error::Recording { path: recording.dir.clone(), faults: vec![fault] });
    // Hands tell what depth should be where they are: a ratio far from 1 is a unit, not an error of estimation.
    let mut ratios = Vec::new();
    let mut is_any = false;
    let with_hand: Vec<_> = recording.hands.iter().filter(|h| has_depth(h.frame)).collect();
    for hand in evenly(&with_hand, rules.asked) {
        let Some(depth) = recording.depth(hand.frame)? else { continue };
        is_any |= depth.data.iter().any(|z| *z > 0.0);
        let local = recording.frames[hand.frame].world_from_camera.inverse() * hand.grasp();
        let seen = recording.camera_of(hand.frame).project(&local).and_then(|(u, v)| depth.nearest(u, v));
        ratios.extend(seen.filter(|z| *z > 0.0).map(|z| f64::from(z) / local.z));
    }
    let [least, most] = rules.depth_per_distance;
    if let Some(ratio) = stats::median(&ratios).filter(|r| !(least..most).contains(r)) {
        return wrong(format!(
            "depth: where hands are, depth is {ratio:.3} times their distance: hands and depth disagree on the unit; depth must be \
             16-bit millimetres, hands metres"
        ));
    }
    if is_any {
        return Ok(());
    }
    for frame in evenly(&with_depth, rules.asked) {
        if recording.depth(*frame)?.is_some_and(|d| d.data.iter().any(|z| *z > 0.0)) {
            return Ok(());
        }
    }
    wrong(
        "depth: every value is 0 = no value; depth must be 16-bit PNG in millimetres (were metres written as integers?)"
            .to_owned(),
    )
}

/// So many of all, evenly; all where they are fewer.
fn evenly<T>(all: &[T], count: usize) -> impl Iterator<Item = &T> {
    let count = count.min(all.len());
    (0..count).map(move |i| &all[i * all.len() / count])
}
