//! The frames that [`super::infer`] looks at, told before they have depth: a network that makes depth, masks or lines need see no
//! others. Hands, poses and clips tell most of them. Which views show a front depends on where it is; until it is seen a cube
//! around the grip stands for it.

use std::collections::{BTreeMap, BTreeSet};

use rayon::prelude::*;
use serde::Serialize;

use super::clip;
use crate::config::{Config, Localization};
use crate::error::Result;
use crate::hands::{Trajectory, contact, find};
use crate::localization::{Region, views, voxels};
use crate::recording::{AtWork, Recording, narration};

/// What a frame is looked at for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Why {
    /// A part is closed in it, and its grip is in view.
    Closed,
    /// A part stands open in it.
    Open,
    /// Whether a hand holds something.
    Contact,
    /// What the room looks like when nothing moves.
    Survey,
    /// A front's lines, from elsewhere.
    Views,
    /// Interactions that nobody told.
    Search,
}

impl Why {
    /// All, in the order of their values.
    pub const ALL: [Self; 6] = [Self::Closed, Self::Open, Self::Contact, Self::Survey, Self::Views, Self::Search];

    /// Its name.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Closed => "closed",
            Self::Open => "open",
            Self::Contact => "contact",
            Self::Survey => "survey",
            Self::Views => "views",
            Self::Search => "search",
        }
    }
}

/// A frame that is looked at.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Wanted {
    /// Its index.
    pub frame: usize,
    /// What for; never empty.
    pub why: Vec<Why>,
}

/// The frames with an image that the pipeline looks at, in order. Where nobody told clips, what is found by the hands stands for
/// them, and the frames that finding asks are among these: where depth is new, ask once more.
///
/// # Errors
/// Images of depth that is there and cannot be decoded.
pub fn wanted(recording: &Recording, config: &Config) -> Result<Vec<Wanted>> {
    let mut by_frame: BTreeMap<usize, BTreeSet<Why>> = BTreeMap::new();
    let mut add = |frames: &[usize], why: Why| {
        for &frame in frames {
            by_frame.entry(frame).or_default().insert(why);
        }
    };
    let mut told = recording.clone();
    let mut deep = everywhere_deep(recording);
    if told.clips.is_empty() {
        add(&find::frames(&deep, &config.hands), Why::Search);
        told.clips = find::interactions(recording, &config.hands);
        deep.clips.clone_from(&told.clips);
    }
    let at_work = AtWork::of(&told);
    let holds = contact::holds(&told, &at_work, &config.hands)?;
    let followed: Vec<clip::Followed> = told
        .clips
        .par_iter()
        .zip(&holds)
        .map(|(clip, hold)| clip::follow(&deep, clip, hold.as_ref(), &at_work, config))
        .collect();
    let idle = views::idle(&deep, &at_work, &config.localization);
    for (clip, followed) in told.clips.iter().zip(&followed) {
        add(&followed.closed, Why::Closed);
        add(&followed.open, Why::Open);
        if narration::read(clip).moves_joint != Some(false) {
            add(&contact::frames(&deep, clip, &at_work, &config.hands), Why::Contact);
        }
        let region = followed.hand.found().and_then(|t| around(&deep, t, &followed.closed, &config.localization));
        if let Some(region) = region {
            add(&views::reselect(&deep, &idle, &region, None, &config.localization), Why::Views);
        }
    }
    add(&views::survey(&deep, &at_work, config.localization.survey_frames), Why::Survey);
    let seen = |frame: usize| recording.frames.get(frame).is_some_and(|f| f.files.rgb.is_some());
    Ok(by_frame
        .into_iter()
        .filter(|(frame, _)| seen(*frame))
        .map(|(frame, why)| Wanted { frame, why: why.into_iter().collect() })
        .collect())
}

/// The recording as if every image had its depth, which is not to be read.
fn everywhere_deep(recording: &Recording) -> Recording {
    let mut deep = recording.clone();
    for frame in &mut deep.frames {
        if frame.files.depth.is_none() {
            frame.files.depth.clone_from(&frame.files.rgb);
        }
    }
    deep
}

/// What stands for the touched furniture before it is seen: a cube around the grip.
fn around(recording: &Recording, trajectory: &Trajectory, closed: &[usize], config: &Localization) -> Option<Region> {
    /// Numerics: voxels to each side; finer ones tell no more here.
    const MOST: i32 = 8;
    let half_m = config.unseen_half_m;
    let viewpoint = recording.frames.get(*closed.first()?)?.center();
    let grip = trajectory.closed_grip();
    let voxel_m = config.voxel_m.max(half_m / f64::from(MOST));
    let [x, y, z] = voxels::index(&grip, voxel_m);
    let half = ((half_m / voxel_m).ceil() as i32).min(MOST);
    let mut filled = Vec::new();
    for i in -half..=half {
        for j in -half..=half {
            filled.extend((-half..=half).map(|k| [x.saturating_add(i), y.saturating_add(j), z.saturating_add(k)]));
        }
    }
    Some(Region {
        voxel_m,
        voxels: filled,
        min_views: 1,
        class: None,
        local_frames: closed.to_vec(),
        other_frames: Vec::new(),
        viewpoint,
        grip,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reasons_are_listed_in_the_order_of_their_values() {
        assert!(Why::ALL.is_sorted());
        for why in Why::ALL {
            assert_eq!(serde_json::to_value(why).unwrap(), why.word());
        }
    }
}
