//! Clips in which no hand was followed, tied to the joints that they move (ours). What they move is found with the other clips:
//! [`crate::inference::grouping`].

use super::{ClipResult, SceneJoint, Told};
use crate::articulation::Action;

/// Ties clips without a hand to the joints that they move, where these are opened and closed in turn with them: groups may have
/// been joined since.
pub(super) fn tie(joints: &mut [SceneJoint], ties: impl Iterator<Item = Told>, clips: &[ClipResult]) {
    for told in ties {
        if let Some(joint) = joints.iter_mut().find(|j| j.clips.contains(&told.with))
            && in_turn(&told, &joint.clips, clips)
        {
            joint.told.push(told);
        }
    }
}

/// Whether a part is opened and closed in turn with that clip among those that show it.
fn in_turn(told: &Told, shown: &[String], clips: &[ClipResult]) -> bool {
    let of = |name: &str| clips.iter().find(|c| c.clip.clip == name);
    let (Some(lost), Some(with)) = (of(&told.clip), of(&told.with)) else { return false };
    let Some(action) = with.trajectory.as_ref().map(|t| t.action) else { return false };
    let later = with.clip.start_frame <= lost.clip.start_frame;
    let mut others: Vec<(usize, Action)> = shown
        .iter()
        .filter_map(|name| of(name))
        .filter(|c| c.clip.clip != told.with && (c.clip.start_frame >= with.clip.start_frame) == later)
        .filter_map(|c| Some((c.clip.start_frame.abs_diff(with.clip.start_frame), c.trajectory.as_ref()?.action)))
        .collect();
    others.sort_by_key(|(frames, _)| *frames);
    others.first().is_none_or(|(_, next)| *next == action)
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::hands::{Sample, Trajectory};
    use crate::math::Point;
    use crate::recording::{Clip, narration};

    /// Clips by narration and whether a hand was followed, in the order of time.
    pub(in crate::pipeline) fn clips(said: &[(&str, bool)]) -> Vec<ClipResult> {
        let clip = |(i, (narration, hand)): (usize, &(&str, bool))| {
            let [verb, noun] = [(); 2].map(|()| String::new());
            let narration = (*narration).to_owned();
            let clip = Clip { clip: i.to_string(), start_frame: 20 * i, end_frame: 20 * i + 9, narration, verb, noun };
            let mut out = ClipResult::unanswered(clip, "no hand".to_owned());
            let at = Point::origin();
            let samples = vec![Sample { frame: 0, time_secs: 0.0, observed: at, smoothed: at, accepted: true }];
            let action = narration::read(&out.clip).action.unwrap_or(Action::Open);
            out.trajectory = hand.then_some(Trajectory { side: None, samples, action, ends_seen: [true; 2] });
            out
        };
        said.iter().enumerate().map(clip).collect()
    }

    #[test]
    fn what_is_shut_already_is_not_closed_and_what_stands_open_not_opened() {
        let told = |clip: &str, with: &str, action| Told { clip: clip.to_owned(), with: with.to_owned(), action };
        let tied = |said: &[(&str, bool)], told: &Told, shown: &[&str]| {
            let shown: Vec<String> = shown.iter().map(|&s| s.to_owned()).collect();
            in_turn(told, &shown, &clips(said))
        };
        let open_twice = [("open the oven", true), ("open it", false), ("close the oven", true)];
        let opened = told("1", "2", Action::Open);
        assert!(!tied(&open_twice, &opened, &["0", "2"]) && tied(&open_twice, &opened, &["2"]));
        let shut_twice = [("open the oven", true), ("close it", false), ("close the oven", true)];
        let closed = told("1", "0", Action::Close);
        assert!(!tied(&shut_twice, &closed, &["0", "2"]) && tied(&shut_twice, &closed, &["0"]));
    }
}
