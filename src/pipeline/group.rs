//! The clips of one part, and what is made of a judgement about them: the part under each of its likely joints.

use super::{ClipResult, Hypothesis, clip, method, refit, without_depth};
use crate::articulation::Articulation;
use crate::config::Config;
use crate::geometry::{AxisCandidate, Face, Rect};
use crate::hands::Trajectory;
use crate::inference;
use crate::inference::uncertainty::{self, OpenStates};
use crate::localization::Footage;
use crate::math::Point;
use crate::part::{front, outline};

/// Clips of one part, and what they are judged with.
#[derive(Clone, Copy)]
pub(super) struct Group<'a> {
    pub(super) footage: Footage<'a>,
    pub(super) clips: &'a [ClipResult],
    /// Indices into `clips`.
    pub(super) members: &'a [usize],
    pub(super) config: &'a Config,
}

impl<'a> Group<'a> {
    /// The clips in which a hand was followed.
    pub(super) fn shown(&self) -> Vec<(&'a ClipResult, &'a Trajectory)> {
        let clips = self.members.iter().map(|&c| &self.clips[c]);
        clips.filter_map(|clip| Some((clip, clip.trajectory.as_ref()?))).collect()
    }

    /// Whether no clip saw anything of the furniture.
    pub(super) fn is_assumed(&self) -> bool {
        self.members.iter().all(|&c| self.clips[c].region.is_none())
    }

    /// The front under a joint: that of the clip `best`, which saw it best; where nothing was seen the one that goes with the joint.
    pub(super) fn front(&self, best: usize, joint: &Articulation, grip: &Point) -> Option<Face> {
        if !self.is_assumed() {
            return self.clips[best].face;
        }
        let others = self.members.iter().filter(|c| **c != best);
        let faces = std::iter::once(&best).chain(others).filter_map(|&c| self.clips[c].face.as_ref());
        let up = self.footage.recording.up();
        Some(without_depth::front(joint, grip, faces, &up, self.config))
    }
}

/// What the clips of one part say together.
pub(super) struct Judged {
    /// The clip that saw the closed part best: it gives the face, the grip and the part's outline.
    pub(super) best: usize,
    /// That clip's grip when closed, world.
    pub(super) grip: Point,
    /// Whether the hands' paths moved the hinges that follow, see [`uncertainty::Evidence::settled`].
    pub(super) settled: bool,
    /// How the part could move, the answer first; never empty.
    pub(super) likely: Vec<Likely>,
    /// Of the answer; `None` where nobody computed them.
    pub(super) type_probability: Option<f64>,
    pub(super) joint_probability: Option<f64>,
}

/// One way in which a part could move; see [`inference::Explanation`].
pub(super) struct Likely {
    pub(super) joint: Articulation,
    /// The candidate that stands for it.
    pub(super) chosen: AxisCandidate,
    pub(super) share: f64,
    pub(super) type_share: f64,
}

impl Likely {
    /// The only way that is known, as likely as the answer is; where nobody computed that, it has it all.
    pub(super) fn only(
        joint: Articulation,
        chosen: AxisCandidate,
        joint_probability: Option<f64>,
        type_probability: Option<f64>,
    ) -> Self {
        let [share, type_share] = [joint_probability, type_probability].map(|p| p.unwrap_or(1.0));
        Self { joint, chosen, share, type_share }
    }
}

/// What a part's outline is told from, beside its joint.
pub(super) struct Around<'a> {
    /// Points of the furniture, world.
    surface: Vec<Point>,
    /// Lines on its face.
    stops: Vec<outline::Stop>,
    /// What all clips show of the part.
    views: refit::Views<'a>,
}

impl<'a> Around<'a> {
    /// `best`: the clip that saw the closed part best.
    pub(super) fn of(group: &Group<'a>, best: usize) -> Self {
        let clip = &group.clips[best];
        let surface = clip
            .region
            .as_ref()
            .map_or_else(Vec::new, |region| clip::surface(&group.footage, region, &clip.views, group.config));
        let stops = clip.face.as_ref().map_or_else(Vec::new, |face| clip::edges_on(face, &clip.lines, group.config));
        let views = refit::Views::of(&group.footage, &group.shown(), group.config);
        Self { surface, stops, views }
    }
}

/// What is known of a part under one of its joints.
struct Known {
    joint: Articulation,
    part: Option<Rect>,
    /// Opening that each clip went through, rad or m.
    moved: Vec<f64>,
    /// Largest opening, rad or m.
    widest: f64,
    /// What depth said, where it said something.
    depth: Option<OpenStates>,
}

/// A part under one of its joints: which way it opens, then hinge, openings and outline from the depth of the open state, so many
/// `rounds` of it.
pub(super) fn built(group: &Group, judged: &Judged, likely: &Likely, around: &Around, rounds: usize) -> Hypothesis {
    let Group { clips, config, .. } = *group;
    let best = judged.best;
    let face = group.front(best, &likely.joint, &judged.grip);
    let shown = group.shown();
    let hands: Vec<&Trajectory> = shown.iter().map(|(_, t)| *t).collect();
    // A front that is where the hand says tells no sense of its own, and nothing saw the part open.
    let seen = face.filter(|_| !group.is_assumed());
    let joint = inference::opening_sense(likely.joint, seen.as_ref(), &judged.grip, hands.iter().copied());
    let moved = method::of(config).moved(&shown, &joint, config);
    let widest = moved.iter().copied().fold(0.0, f64::max);
    let mut known = Known { joint, part: clips[best].part, moved, widest, depth: None };
    if config.inference.refit
        && let Some(face) = seen
    {
        known = by_depth(group, &shown, &face, around, known, rounds);
    }
    let evidence = uncertainty::Evidence {
        joint: &known.joint,
        chosen: &likely.chosen,
        face: face.as_ref(),
        hands: &hands,
        settled: judged.settled,
        moved: &known.moved,
        depth: known.depth.as_ref(),
    };
    let uncertainty = uncertainty::of(&evidence, &config.reasoning, &config.part, &config.hands.grips);
    Hypothesis {
        joint: known.joint,
        share: likely.share,
        type_share: likely.type_share,
        uncertainty,
        part: known.part,
        observed_range: known.widest,
        moved: known.moved,
        refuted: None,
    }
}

/// The same after so many `rounds` of looking at the depth of the open states; what it does not tell stays as it was.
fn by_depth(
    group: &Group,
    shown: &[(&ClipResult, &Trajectory)],
    face: &Face,
    around: &Around,
    mut known: Known,
    rounds: usize,
) -> Known {
    let config = group.config;
    // A part of which no outline was seen to move: the piece of it around the grip.
    let mut rect = known.part.unwrap_or_else(|| outline::smallest(&config.part));
    let start = refit::Believed { joint: known.joint, hinge_m: config.reasoning.hand_std_m };
    let mut believed = start;
    for _ in 0..rounds {
        let closed = refit::Closed { face: *face, rect, surface: &around.surface };
        let Some(fit) = refit::refitted(shown, &around.views, &believed, &closed, config) else { break };
        // With the openings known better the part's outline is, too.
        let seen = front::Seen {
            face,
            rect: &rect,
            surface: &around.surface,
            views: &fit.views,
            joint: &fit.joint,
            openings: &fit.openings,
            stops: &around.stops,
        };
        let part = front::fit(&seen, config).or(known.part);
        rect = part.unwrap_or(rect);
        believed = start.at_side(&fit, face, &rect, &around.stops, config);
        let refit::Refitted { joint, ranges: moved, widest, depth, .. } = fit;
        known = Known { joint, part, moved, widest, depth: Some(depth) };
    }
    known
}
