//! What a language model says about a clip (§3.3, §A.6): how the part moves, frame by frame, and which lines could be its
//! hinge, view by view. Evidence like any other: counted, weighed, and never a verdict.

use serde::{Deserialize, Serialize};

use crate::articulation::JointKind;
use crate::config;
use crate::geometry::LineTrack;
use crate::localization::Region;
use crate::recording::{Clip, Recording};

/// How often a line was shown, and how often it was taken for the hinge.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct LineVote {
    /// Index among the clip's lines.
    pub line: usize,
    /// Views in which it was offered and the answer was usable.
    pub offered: usize,
    /// Of them, those in which it was chosen.
    pub chosen: usize,
}

/// All that a language model said about one clip.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Words {
    /// Frames called a rotation.
    pub revolute: usize,
    /// Frames called a translation.
    pub prismatic: usize,
    /// Frames without a usable answer.
    pub unknown: usize,
    /// The furniture's name, in lower case.
    pub furniture: Option<String>,
    /// The type of the whole clip, read off the frames' answers.
    pub summary: Option<JointKind>,
    /// Lines that were offered, by index.
    pub lines: Vec<LineVote>,
}

impl Words {
    /// Log odds of a hinge over a slide, from a model that is right in a share `vlm_accuracy` of clips.
    ///
    /// The balance of the frames counts in full from two thirds on, and more with four frames or more than with fewer;
    /// the summary, which saw the frames in order, counts as much as their balance.
    #[must_use]
    pub fn log_odds(&self, config: &config::Reasoning) -> f64 {
        let votes = self.revolute + self.prismatic;
        if votes == 0 {
            return 0.0;
        }
        let balance = (self.revolute as f64 - self.prismatic as f64) / votes as f64;
        let counted = (config.vlm_balance_gain * balance).clamp(-1.0, 1.0);
        let opinion = match self.summary {
            Some(JointKind::Revolute) => 0.5 * (counted + 1.0),
            Some(JointKind::Prismatic) => 0.5 * (counted - 1.0),
            None => counted,
        };
        let strength = if votes >= config.vlm_enough_frames { config.vlm_enough_gain } else { 1.0 };
        strength * opinion * (config.vlm_accuracy / (1.0 - config.vlm_accuracy)).ln()
    }

    /// For each of the clip's lines the share of the views that offered it in which it was chosen.
    #[must_use]
    pub fn named(&self, lines: usize) -> Vec<f64> {
        let mut shares = vec![0.0; lines];
        for vote in self.lines.iter().filter(|v| v.offered > 0) {
            if let Some(share) = shares.get_mut(vote.line) {
                *share = vote.chosen as f64 / vote.offered as f64;
            }
        }
        shares
    }
}

/// What a model may look at.
#[derive(Debug, Clone, Copy)]
pub struct AskedClip<'a> {
    /// The recording.
    pub recording: &'a Recording,
    /// The clip.
    pub clip: &'a Clip,
    /// The touched furniture.
    pub region: &'a Region,
    /// The clip's global views.
    pub views: &'a [usize],
    /// The clip's 3D lines.
    pub lines: &'a [LineTrack],
}

impl AskedClip<'_> {
    /// What the masks call the furniture at the hand.
    #[must_use]
    pub fn fixture(&self) -> Option<&str> {
        self.region.class.and_then(|class| self.recording.labels.get(&class)).map(String::as_str)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn words(revolute: usize, prismatic: usize, summary: Option<JointKind>) -> f64 {
        Words { revolute, prismatic, summary, ..Words::default() }
            .log_odds(&config::Reasoning { vlm_accuracy: 0.9, ..Default::default() })
    }

    #[test]
    fn votes_weigh_by_their_balance_and_never_decide_alone() {
        use JointKind::{Prismatic, Revolute};
        let full = 1.4 * 9f64.ln();
        assert_eq!(words(0, 0, Some(Revolute)), 0.0);
        assert!((words(10, 0, Some(Revolute)) - full).abs() < 1e-12);
        assert!((words(0, 10, Some(Prismatic)) + full).abs() < 1e-12);
        assert!((words(2, 0, None) - 9f64.ln()).abs() < 1e-12);
        // Five to five says nothing without a summary, and half of what it could with one.
        assert_eq!(words(5, 5, None), 0.0);
        assert!((words(5, 5, Some(Revolute)) - 0.5 * full).abs() < 1e-12);
        // The summary against the frames: they cancel.
        assert!(words(10, 0, Some(Prismatic)).abs() < 1e-12);
        // The most that words can say: 96 % sure.
        assert!((1.0 / (1.0 + (-full).exp()) - 0.956).abs() < 1e-3);
    }

    #[test]
    fn lines_are_named_by_the_share_of_views_that_chose_them() {
        let lines = [(0, 1, 0), (2, 3, 2), (5, 1, 1)]
            .map(|(line, offered, chosen)| LineVote { line, offered, chosen })
            .to_vec();
        let words = Words { lines, ..Words::default() };
        assert_eq!(words.named(4), [0.0, 0.0, 2.0 / 3.0, 0.0]);
    }
}
