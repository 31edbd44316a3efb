//! How well candidate joints explain what clips show: one clip alone, or all clips of a part (§3.3; the depth is ours).

use crate::articulation::Articulation;
use crate::config::Config;
use crate::geometry::{AxisCandidate, Face, Rect, candidates};
use crate::hands::GripStd;
use crate::math::Point;
use crate::part::likelihood::{self, OpenDepth};
use crate::part::views::View;
use crate::reasoning::words::Words;
use crate::reasoning::{Answer, PartShape, Question, Reasoner};
use crate::recording::Recording;
use crate::recording::narration::Reading;

/// A closed front that may be the part's, and the hand that holds it there.
#[derive(Clone)]
pub(super) struct ClosedFront {
    pub(super) face: Face,
    /// The part's outline on it; `None` where it was not seen.
    pub(super) rect: Option<Rect>,
    /// The grip when closed, world.
    pub(super) grip: Point,
    /// Its standard deviation along the motion, metres.
    pub(super) grip_std_m: f64,
}

/// What one clip shows of a part.
pub(super) struct ClipEvidence<'a> {
    pub(super) reading: Reading,
    pub(super) words: Option<&'a Words>,
    /// The hand's positions, world.
    pub(super) path: Vec<Point>,
    /// Views of the open state.
    pub(super) open: Vec<View<'a>>,
    /// Each candidate is held against the depth under each of these and keeps the best. None where no front was found.
    pub(super) closed: Vec<ClosedFront>,
}

/// The part that candidates are asked about: what they are all held to.
pub(super) struct AskedPart<'a> {
    /// The grip when closed, world.
    pub(super) grip: Point,
    pub(super) face: Option<&'a Face>,
    pub(super) shape: Option<PartShape>,
}

/// Candidates where all the hands have them, each between its source and the hands.
pub(super) fn settled(candidates: &[AxisCandidate], paths: &[Vec<Point>], config: &Config) -> Vec<AxisCandidate> {
    candidates.iter().map(|c| candidates::settled(c, paths, &config.reasoning)).collect()
}

/// What each clip answers about the candidates.
pub(super) fn answers(
    shown: &[ClipEvidence],
    part: &AskedPart,
    candidates: &[AxisCandidate],
    recording: &Recording,
    reasoner: &dyn Reasoner,
    config: &Config,
) -> Vec<Answer> {
    let answer = |clip: &ClipEvidence| {
        reasoner.answer(&Question {
            reading: &clip.reading,
            words: clip.words,
            path: &clip.path,
            grip: part.grip,
            candidates,
            agreement: &with_depth(clip, candidates.iter().map(|c| &c.joint), config),
            part: part.shape,
            face: part.face,
            up: recording.up(),
        })
    };
    shown.iter().map(answer).collect()
}

/// How well each joint explains the depth of a clip's open state, nats.
fn with_depth<'j>(
    clip: &ClipEvidence,
    joints: impl Iterator<Item = &'j Articulation> + Clone,
    config: &Config,
) -> Vec<f64> {
    clip.closed
        .iter()
        .map(|ClosedFront { face, rect, grip, grip_std_m }| {
            let depth = OpenDepth::of(face, rect.as_ref(), &clip.open, &config.part);
            let std = GripStd { closed_m: *grip_std_m, lost_m: config.hands.grips.lost_std_m };
            likelihood::log_likelihoods(&depth, joints.clone(), grip, std)
        })
        .reduce(|best, next| best.iter().zip(&next).map(|(a, b)| a.max(*b)).collect())
        .unwrap_or_else(|| vec![0.0; joints.count()])
}
