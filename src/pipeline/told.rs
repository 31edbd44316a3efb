//! Clips in which no hand was followed, tied by their narrations to the joints that they move (ours).

use super::{ClipResult, SceneJoint, Told};
use crate::articulation::Action;
use crate::recording::narration;

/// Ties clips without a hand to the joints that they move by their narrations.
pub(super) fn tie(joints: &mut [SceneJoint], clips: &[ClipResult]) {
    for told in told(clips) {
        if let Some(joint) = joints.iter_mut().find(|j| j.clips.contains(&told.with))
            && in_turn(&told, &joint.clips, clips)
        {
            joint.told.push(told);
        }
    }
}

/// Clips without a hand, and what they move by their narrations: who closes something closes what was just opened, unless
/// it has another name.
fn told(clips: &[ClipResult]) -> Vec<Told> {
    let mut moving: Vec<(&ClipResult, narration::Reading)> = clips
        .iter()
        .map(|clip| {
            let reading = narration::read(&clip.clip);
            (
                clip,
                narration::Reading { action: clip.trajectory.as_ref().map(|t| t.action).or(reading.action), ..reading },
            )
        })
        .filter(|(clip, reading)| clip.trajectory.is_some() || reading.moves_joint == Some(true))
        .collect();
    moving.sort_by_key(|(clip, _)| clip.clip.start_frame);
    moving
        .windows(2)
        .filter_map(|pair| {
            let [(before, opens), (after, closes)] = pair else { return None };
            let name = |reading: &narration::Reading| reading.furniture.clone().filter(|_| reading.names_furniture());
            let one = name(opens).zip(name(closes)).is_none_or(|(a, b)| a == b);
            let actions = [opens.action, closes.action] == [Some(Action::Open), Some(Action::Close)];
            let (lost, with) = match [before, after].map(|c| c.trajectory.is_some()) {
                [true, false] => (after, before),
                [false, true] => (before, after),
                _ => return None,
            };
            let action = if lost.clip.start_frame == after.clip.start_frame { Action::Close } else { Action::Open };
            (one && actions).then(|| Told { clip: lost.clip.clip.clone(), with: with.clip.clip.clone(), action })
        })
        .collect()
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
    use crate::recording::Clip;

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
    fn a_clip_without_a_hand_moves_what_its_narration_says() {
        let told = |said: &[(&str, bool)]| -> Vec<[String; 2]> {
            told(&clips(said)).into_iter().map(|t| [t.clip, t.with]).collect()
        };
        let pair = |clip: &str, with: &str| vec![[clip.to_owned(), with.to_owned()]];
        assert_eq!(told(&[("open the oven", true), ("close the oven", false)]), pair("1", "0"));
        assert_eq!(told(&[("open the drawer", false), ("close it", true)]), pair("0", "1"));
        // What moves nothing does not come between.
        let between = [("open the oven", true), ("wash hands", false), ("close the oven", false)];
        assert_eq!(told(&between), pair("2", "0"));
        for said in [
            [("open the oven", true), ("close the drawer", false)],
            [("close the oven", true), ("close the oven", false)],
            [("open the oven", false), ("open the oven", true)],
            [("open the oven", false), ("close the oven", false)],
            [("open the oven", true), ("close the oven", true)],
        ] {
            assert!(told(&said).is_empty(), "{said:?}");
        }
        // What is shut already is not closed, what stands open not opened.
        let tied = |said: &[(&str, bool)], shown: &[&str]| {
            let clips = clips(said);
            let shown: Vec<String> = shown.iter().map(|&s| s.to_owned()).collect();
            super::told(&clips).iter().filter(|t| in_turn(t, &shown, &clips)).count()
        };
        let open_twice = [("open the oven", true), ("open it", false), ("close the oven", true)];
        let shut_twice = [("open the oven", true), ("close it", false), ("close the oven", true)];
        assert_eq!((tied(&open_twice, &["0", "2"]), tied(&open_twice, &["2"])), (0, 1));
        assert_eq!((tied(&shut_twice, &["0", "2"]), tied(&shut_twice, &["0"])), (0, 1));
    }
}
