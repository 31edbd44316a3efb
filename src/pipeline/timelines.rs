//! When the part of each joint of a scene stood closed, stood open or moved.

use super::{Scene, SceneJoint};
use crate::articulation::Action;
use crate::config;
use crate::hands::timeline::{Motion, Timeline};
use crate::recording::Recording;

impl Scene {
    /// The timeline of every joint, in their order.
    #[must_use]
    pub fn timelines(&self, recording: &Recording, config: &config::Hands) -> Vec<Timeline> {
        self.joints.iter().map(|joint| Timeline::of(recording, &self.motions(joint), config)).collect()
    }

    /// What moved a joint's part: clips whose hands were followed, and clips that are told to move it.
    fn motions(&self, joint: &SceneJoint) -> Vec<Motion> {
        let named = |name: &str| self.clips.iter().find(|c| c.clip.clip == name);
        let mut motions = Vec::new();
        for (name, opening) in joint.clips.iter().zip(&joint.moved) {
            let Some(clip) = named(name) else { continue };
            let Some(hand) = &clip.trajectory else { continue };
            motions.push(Motion::held(&clip.clip, hand, *opening));
        }
        for told in &joint.told {
            let Some(clip) = named(&told.clip) else { continue };
            let opening = joint.shown_by(&told.clip).and_then(|i| joint.moved.get(i)).copied().unwrap_or(0.0);
            let frames = [clip.clip.start_frame, clip.clip.end_frame];
            motions.push(Motion { frames, opens: told.action == Action::Open, opening });
        }
        motions
    }
}
