//! A joint of the scene once more, from the depth of all its clips' open states: where its hinge is, how far each clip went.

use std::collections::BTreeMap;

use super::ClipResult;
use crate::articulation::{Action, Articulation};
use crate::config::Config;
use crate::geometry::moved::{self, Hold};
use crate::geometry::openings::{self, OpenState, Opening};
use crate::geometry::{Face, Rect};
use crate::hands::{self, Trajectory};
use crate::recording::Recording;
use crate::recording::sketch::Sketch;

/// A joint after its open views were looked at.
pub(super) struct Refitted<'a> {
    pub(super) joint: Articulation,
    /// All clips' views of the open state, and the opening in each.
    pub(super) views: Vec<moved::View<'a>>,
    pub(super) openings: Vec<f64>,
    pub(super) position_std_m: f64,
    /// Opening that each clip went through, rad or m.
    pub(super) ranges: Vec<f64>,
}

/// The hinge and the openings that the depth of the open states tells. `None` where they were not seen.
#[allow(clippy::too_many_arguments, reason = "what a group of clips knows")]
pub(super) fn refitted<'a>(
    recording: &Recording,
    sketches: &'a BTreeMap<usize, Sketch>,
    shown: &[(&ClipResult, &Trajectory)],
    joint: &Articulation,
    face: &Face,
    rect: &Rect,
    config: &Config,
) -> Option<Refitted<'a>> {
    let noise = openings::Noise { hinge_m: config.reasoning.hand_std_m, board_m: config.fitting.board_m };
    let views: Vec<Vec<moved::View>> =
        shown.iter().map(|(clip, t)| moved::open_views(recording, sketches, &clip.clip, t)).collect();
    let states: Vec<OpenState> = shown
        .iter()
        .zip(&views)
        .map(|((_, t), views)| OpenState {
            grip: t.closed_grip(),
            grip_std_m: hands::grip_std_m(t.closed_end_seen()),
            views,
        })
        .collect();
    let fit = openings::refit(face, rect, joint, &states, &noise)?;
    let ends: Vec<Opening> = shown
        .iter()
        .zip(&states)
        .zip(&fit.openings)
        .map(|(((_, t), state), seen)| open_end(&fit.joint, t, state, seen))
        .collect();
    let ranges = left_where_found(shown, &ends).into_iter().map(|end| end.max(0.0)).collect();
    let openings = fit.openings.iter().flatten().map(|o| o.value).collect();
    let views = views.into_iter().flatten().collect();
    Some(Refitted { joint: fit.joint, views, openings, position_std_m: fit.position_std_m, ranges })
}

/// Opening at the open end of a clip. After the hand let go the part stands there: what those views show counts, else what is
/// seen while the hand holds it, brought to the end of the hand's way.
fn open_end(joint: &Articulation, trajectory: &Trajectory, state: &OpenState, seen: &[Opening]) -> Opening {
    let told = moved::told(joint, &state.grip, state.views);
    let end = joint.opening_at(&state.grip, &trajectory.open_grip());
    let mean = |of: &dyn Fn(usize) -> Option<f64>| -> Option<f64> {
        let (mut sum, mut total) = (0.0, 0.0);
        for (i, opening) in seen.iter().enumerate() {
            let weight = 1.0 / (opening.std * opening.std);
            if let Some(value) = of(i) {
                sum += weight * value;
                total += weight;
            }
        }
        (total > 0.0).then(|| sum / total)
    };
    let of = |hold: Hold| mean(&|i| (state.views[i].hold == hold && seen[i].informed).then_some(seen[i].value));
    let after = of(Hold::Left).or(of(Hold::Lost));
    let during = mean(&|i| (state.views[i].hold == Hold::Sure && told[i] > 0.8 * end).then(|| seen[i].value - told[i]));
    let value = after.or(during.map(|offset| end + offset)).unwrap_or(end);
    // The views share the hand's and the depth's errors: together they are as sure as the surest of them. A hand that was lost
    // and a part that nobody saw afterwards leave the end open.
    let surest = seen.iter().map(|o| o.std).fold(f64::INFINITY, f64::min);
    let lever = joint.lever(&state.grip).max(openings::LEAST_LEVER_M);
    let unseen = after.is_none() && !trajectory.open_end_seen();
    let std = if unseen { surest.hypot(hands::grip_std_m(false) / lever) } else { surest };
    Opening { value, std, informed: !unseen }
}

/// A part stays where it was left: the open end of a clip is where the next clip of the part finds it. Both clips' values
/// become their weighted mean.
fn left_where_found(shown: &[(&ClipResult, &Trajectory)], ends: &[Opening]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..shown.len()).collect();
    order.sort_by_key(|&i| (shown[i].0.clip.start_frame, i));
    let mut out: Vec<f64> = ends.iter().map(|e| e.value).collect();
    for pair in order.windows(2) {
        let (a, b) = (pair[0], pair[1]);
        if shown[a].1.action == Action::Open && shown[b].1.action == Action::Close {
            let [wa, wb] = [a, b].map(|i| ends[i].std.powi(-2));
            if (wa + wb).is_finite() && wa + wb > 0.0 {
                let mean = (wa * ends[a].value + wb * ends[b].value) / (wa + wb);
                (out[a], out[b]) = (mean, mean);
            }
        }
    }
    out
}
