//! Recordings of one place joined to one: the first one's world is the scene's, the others are laid into it.

use super::Progress;
use crate::config::Config;
use crate::error::Result;
use crate::geometry::alignment::{self, Map};
use crate::math::Pose;
use crate::recording::Recording;
use crate::recording::videos::{self, LeftOut, Placed, Placement};

/// A recording that fits nowhere so far.
struct Waiting {
    /// Its place in the order of time.
    order: usize,
    recording: Recording,
    map: Map,
    /// Why it fits nowhere.
    reason: String,
    /// How many recordings it was held against.
    tried: usize,
}

/// Joins recordings of one place, in the order of time, into the world of the first one. Where the worlds lie is found by their
/// surfaces ([`alignment::place`]); with `one_world` it was said that they are one. What fits nowhere is left out, beside what
/// was `left_out` before.
///
/// # Errors
/// No recording at all, and two of one name.
pub fn together(
    recordings: Vec<Recording>,
    left_out: Vec<LeftOut>,
    one_world: bool,
    config: &Config,
    progress: Progress,
) -> Result<Recording> {
    videos::distinct(recordings.iter())?;
    let gap_secs = config.alignment.gap_secs;
    if one_world {
        let told = |(i, recording): (usize, Recording)| Placed {
            recording,
            scene_from_own: Pose::identity(),
            placement: if i == 0 { Placement::First } else { Placement::Told },
        };
        return videos::joined(recordings.into_iter().enumerate().map(told).collect(), left_out, gap_secs);
    }
    let total = recordings.len();
    let mut scene = Map::default();
    let mut placed: Vec<(usize, Placed)> = Vec::new();
    let mut waiting: Vec<Waiting> = Vec::new();
    for (order, recording) in recordings.into_iter().enumerate() {
        progress("aligning", order, total);
        let map = alignment::map_of(&recording, config);
        let next = Waiting { order, recording, map, reason: String::new(), tried: 0 };
        waiting.extend(tried(next, &mut scene, &mut placed, config));
    }
    // What overlaps with none before it may overlap with one after it.
    while waiting.iter().any(|w| w.tried < placed.len()) {
        let again = std::mem::take(&mut waiting);
        for next in again {
            let left =
                if next.tried < placed.len() { tried(next, &mut scene, &mut placed, config) } else { Some(next) };
            waiting.extend(left);
        }
    }
    placed.sort_by_key(|(order, _)| *order);
    waiting.sort_by_key(|w| w.order);
    let refused = waiting.into_iter().map(|w| LeftOut { name: w.recording.name, reason: w.reason });
    let left_out = left_out.into_iter().chain(refused).collect();
    videos::joined(placed.into_iter().map(|(_, placed)| placed).collect(), left_out, gap_secs)
}

/// Lays a recording into the scene; gives it back where it does not fit.
fn tried(next: Waiting, scene: &mut Map, placed: &mut Vec<(usize, Placed)>, config: &Config) -> Option<Waiting> {
    let place = match placed.is_empty() {
        true => Ok((Pose::identity(), Placement::First)),
        false => alignment::place(scene, &next.map, &config.alignment),
    };
    match place {
        Ok((scene_from_own, placement)) => {
            scene.take_in(&next.map, &scene_from_own, &config.alignment);
            placed.push((next.order, Placed { recording: next.recording, scene_from_own, placement }));
            None
        }
        Err(reason) => Some(Waiting { reason, tried: placed.len(), ..next }),
    }
}
