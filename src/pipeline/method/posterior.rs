//! Ours: all hypotheses are weighed by hand, depth, shape and words; the clips of a part are judged together, twice.

use super::Method;
use crate::articulation::{Articulation, JointKind, Outcome};
use crate::config::{Config, SceneRules};
use crate::geometry::{AxisCandidate, AxisSource, Rect, candidates};
use crate::hands::{self, Trajectory};
use crate::inference::{self, ClipJoint, aggregate, uncertainty};
use crate::localization::Footage;
use crate::math::Point;
use crate::part::views as open_state;
use crate::pipeline::clip::part_shape;
use crate::pipeline::closed::{self, Grip, SeenFront, by_trust};
use crate::pipeline::group::{Around, Group, Judged, Likely, built};
use crate::pipeline::{ClipResult, Hypothesis, refit, weigh, without_depth};
use crate::reasoning::{self, Answer, Reasoner};
use crate::recording::narration::{self, Reading};

/// All hypotheses, weighed.
pub(super) struct Posterior;

impl Method for Posterior {
    fn needs_depth(&self) -> bool {
        false
    }

    fn candidates(&self, evidence: &candidates::Evidence, config: &Config) -> Vec<AxisCandidate> {
        weigh::settled(&candidates::collect(evidence, &config.inference), &[evidence.path.to_vec()], config)
    }

    fn joint(
        &self,
        clip: &ClipResult,
        hand: &Trajectory,
        answer: &Answer,
        reading: &Reading,
        config: &Config,
    ) -> Outcome<ClipJoint> {
        let vouched_for = clip.part.is_some() || (clip.face.is_some() && reading.names_furniture());
        let (face, Config { reasoning, inference, .. }) = (clip.face.as_ref(), config);
        inference::infer(hand, &clip.candidates, answer, face, vouched_for, reasoning, inference)
    }

    /// How well its front bears out where all hands were, and how much of what is near lies on it.
    fn trust(&self, front: &SeenFront, grips: &[Grip], config: &Config) -> f64 {
        // A front is most of what is seen around a hand that holds it: half the support counts a quarter.
        let stds = &config.hands.grips;
        front.bears_out(grips, stds) + (front.face.support.powi(2) * front.moved / front.own.std_m(stds)).ln()
    }

    fn part(&self, group: &Group, reasoner: &dyn Reasoner) -> Option<(Judged, Vec<Hypothesis>)> {
        borne_out(group, reasoner)
    }

    fn moved(&self, shown: &[(&ClipResult, &Trajectory)], joint: &Articulation, config: &Config) -> Vec<f64> {
        refit::by_hand(shown, joint, config)
    }
}

/// What the clips say together of the front of the one that saw it closed best. Where that leaves hands unexplained that another
/// clip's front explains by far, it was no front of this part, and that other one's answer stands: hands are the evidence that
/// asks for no front, and evidence under two fronts is not comparable otherwise.
fn borne_out(group: &Group, reasoner: &dyn Reasoner) -> Option<(Judged, Vec<Hypothesis>)> {
    let config = group.config;
    let by_far = config.part.by_far_nats;
    let trusted = by_trust(group.clips, group.members, config);
    let first = under_front(group, reasoner, &trusted)?;
    let hands = HandEvidence::of(group);
    if hands.best() - hands.nats(&first.1) <= by_far {
        return Some(first);
    }
    let others = closed::other_fronts(group.clips, &trusted, config);
    others
        .into_iter()
        .take(config.inference.scene.other_fronts)
        .filter_map(|clip| {
            let of: Vec<usize> = std::iter::once(clip).chain(trusted.iter().copied().filter(|c| *c != clip)).collect();
            under_front(group, reasoner, &of)
        })
        .filter(|other| hands.nats(&other.1) - hands.nats(&first.1) > by_far)
        .reduce(|best, next| if hands.nats(&next.1) > hands.nats(&best.1) { next } else { best })
        .or(Some(first))
}

/// The hands of a part's clips as evidence of its joint.
struct HandEvidence<'a> {
    paths: Vec<Vec<Point>>,
    config: &'a Config,
}

impl<'a> HandEvidence<'a> {
    fn of(group: &Group<'a>) -> Self {
        Self { paths: group.shown().iter().map(|(_, hand)| hand.positions()).collect(), config: group.config }
    }

    /// How likely they are under an answer.
    fn nats(&self, hypotheses: &[Hypothesis]) -> f64 {
        let Config { reasoning, inference, .. } = self.config;
        let of = |path: &[Point], joint| reasoning::path_log_likelihood(joint, path, reasoning, inference);
        hypotheses.first().map_or(f64::NEG_INFINITY, |answer| {
            self.paths.iter().map(|path| of(path, &answer.joint)).sum::<f64>() / reasoning.evidence_temperature
        })
    }

    /// How likely they could be under any joint, each under its own.
    fn best(&self) -> f64 {
        let reasoning = &self.config.reasoning;
        let of = |path: &Vec<Point>| {
            let beside = crate::math::path::beside_any_joint(path);
            reasoning::beside_log_likelihood(beside * beside, path.len(), reasoning)
        };
        self.paths.iter().map(of).sum::<f64>() / reasoning.evidence_temperature
    }
}

/// The answer under the front of `trusted[0]`, the other clips behind it, and its hypotheses built.
fn under_front(group: &Group, reasoner: &dyn Reasoner, trusted: &[usize]) -> Option<(Judged, Vec<Hypothesis>)> {
    let mut judgement = judged(group, reasoner, trusted, &[])?;
    let config = group.config;
    let rules = &config.inference.scene;
    let around = Around::of(group, judgement.best);
    // Without the depth of the open states there are no other outlines than before.
    if config.inference.second_look && config.inference.refit {
        let worth = judgement.likely.iter().enumerate().filter(|(i, l)| *i == 0 || l.share >= rules.outlined_share);
        // One round tells how far the part reaches; a second one is for the hinge.
        let outlines: Vec<Rect> = worth.filter_map(|(_, l)| built(group, &judgement, l, &around, 1).part).collect();
        if !outlines.is_empty() {
            judgement = judged(group, reasoner, trusted, &outlines)?;
        }
    }
    // What physics will not be asked about is not built.
    let asked = if config.validation.feedback { judgement.likely.len() } else { 1 };
    let hypotheses: Vec<Hypothesis> =
        judgement.likely.iter().take(asked).map(|l| built(group, &judgement, l, &around, rules.rounds)).collect();
    Some((judgement, hypotheses))
}

/// What all clips of one part say together. `trusted`: the clips with an answer; the first gives the face, the grip and the part's
/// outline.
///
/// `outlines`: of the part on the face of the clip that saw it best, one for each way in which it could move and left one, by
/// falling likelihood; none in a first look, which takes what that clip knows. Every candidate is judged under the outline
/// that suits it best.
fn judged(group: &Group, reasoner: &dyn Reasoner, trusted: &[usize], outlines: &[Rect]) -> Option<Judged> {
    let Group { clips, members, config, .. } = *group;
    let best = *trusted.first()?;
    let clip = &clips[best];
    let own = clip.joint.found()?;
    let rules = &config.inference.scene;
    let mut said = Said::of(own);
    if members.len() > 1 || !outlines.is_empty() {
        let (pooled, answer) = answered(group, reasoner, trusted, outlines)?;
        said = chosen(&pooled, &answer, rules).unwrap_or(said);
    } else if let Some(answer) = &clip.answer {
        // One clip alone has been judged before.
        said.likely = likely(&clip.candidates, answer, false, rules);
    }
    let Said { joint, type_probability, joint_probability, mut likely } = said;
    match likely.first_mut() {
        Some(answer) => answer.joint = joint,
        None => {
            let chosen = uncertainty::chosen(own, &clip.candidates, &config.inference.sources);
            likely.push(Likely::only(joint, chosen, joint_probability, type_probability));
        }
    }
    Some(Judged { best, grip: own.grip, settled: true, likely, type_probability, joint_probability })
}

/// A joint, how sure it is, and what else the part could do.
struct Said {
    joint: Articulation,
    type_probability: Option<f64>,
    joint_probability: Option<f64>,
    /// The joint first, if any.
    likely: Vec<Likely>,
}

impl Said {
    /// By one clip alone.
    fn of(own: &ClipJoint) -> Self {
        let ClipJoint { joint, type_probability, joint_probability, .. } = *own;
        Self { joint, type_probability, joint_probability, likely: Vec::new() }
    }
}

/// All candidates of all clips of one part, and what is answered about them on every clip: the best explains all of them.
fn answered(
    group: &Group,
    reasoner: &dyn Reasoner,
    trusted: &[usize],
    outlines: &[Rect],
) -> Option<(Vec<AxisCandidate>, Answer)> {
    let Group { clips, members, config, .. } = *group;
    let most = config.inference.scene.offering;
    let mut offering: Vec<usize> = members.to_vec();
    if members.len() > most {
        offering.retain(|c| trusted.iter().take(most).any(|t| t == c));
    }
    match group.is_assumed() {
        true => without_depth::together(clips, members, &offering, config),
        false => asked(group, reasoner, *trusted.first()?, &offering, outlines),
    }
}

/// Of the likelier type the likeliest candidate, with those that agree. `None` where everything is ruled out.
fn chosen(pooled: &[AxisCandidate], answer: &Answer, rules: &SceneRules) -> Option<Said> {
    let weights = answer.log_weights();
    let revolute_probability = answer.revolute_probability(pooled);
    let revolute = revolute_probability >= 0.5;
    let of_kind = |k: &AxisCandidate| (k.joint.kind == JointKind::Revolute) == revolute;
    let top = (0..pooled.len())
        .filter(|&i| of_kind(&pooled[i]) && weights[i].is_finite())
        .max_by(|&a, &b| weights[a].total_cmp(&weights[b]).then(b.cmp(&a)))?;
    let all: Vec<(Articulation, f64)> =
        pooled.iter().zip(&weights).map(|(k, w)| (k.joint, (w - weights[top]).exp())).collect();
    let of_type = revolute_probability.max(1.0 - revolute_probability);
    Some(Said {
        joint: aggregate::consensus(&pooled[top].joint, &all, rules),
        type_probability: Some(of_type),
        joint_probability: Some(of_type * inference::agreeing_share(&pooled[top].joint, &all)),
        likely: likely(pooled, answer, true, rules),
    })
}

/// The answer and what else is worth a look. `merged`: judged together, so that those that agree are averaged.
fn likely(candidates: &[AxisCandidate], answer: &Answer, merged: bool, rules: &SceneRules) -> Vec<Likely> {
    let weights = answer.log_weights();
    inference::explanations(candidates, answer)
        .into_iter()
        .enumerate()
        .filter(|(i, e)| *i == 0 || e.share >= rules.kept_share)
        .take(rules.kept)
        .filter_map(|(_, e)| {
            let &head = e.members.first()?;
            let members: Vec<(Articulation, f64)> =
                e.members.iter().map(|&i| (candidates[i].joint, (weights[i] - weights[head]).exp())).collect();
            let seed = candidates[head].joint;
            let joint = if merged { aggregate::consensus(&seed, &members, rules) } else { seed };
            let chosen = candidates[head].clone();
            Some(Likely { joint, chosen, share: e.share, type_share: e.type_share })
        })
        .collect()
}

/// The candidates that clips of a part are `offering`, and what all its clips answer about them together.
fn asked(
    group: &Group,
    reasoner: &dyn Reasoner,
    best: usize,
    offering: &[usize],
    outlines: &[Rect],
) -> Option<(Vec<AxisCandidate>, Answer)> {
    let Group { footage: Footage { recording, sketches, .. }, clips, members, config } = *group;
    let (grip, face) = (clips[best].joint.found()?.grip, clips[best].face);
    let best_std_m = Grip::of(clips, best)?.std_m(&config.hands.grips);
    let paths: Vec<Vec<Point>> =
        members.iter().filter_map(|&c| clips[c].trajectory.as_ref()).map(Trajectory::positions).collect();
    let pooled = pooled(clips, offering, best, &grip, outlines, &config.inference);
    let pooled = weigh::settled(&pooled, &paths, config);
    // Of the best clip: of each way in which the part could move its own outline.
    let rects: Vec<Option<Rect>> =
        if outlines.is_empty() { vec![clips[best].part] } else { outlines.iter().copied().map(Some).collect() };
    let shown = |&c: &usize| {
        let trajectory = clips[c].trajectory.as_ref()?;
        let own_grip = trajectory.closed_grip();
        let own_std_m = hands::grip_std_m(trajectory.closed_end_seen(), &config.hands.grips);
        // Depth and hands are biased clip by clip: the face and the grip of the clip itself fit its views best, those
        // of the best clip stand in where it did not see its closed end. Every candidate gets the same choice.
        let own = clips[c].face.filter(|own| face.is_some_and(|face| closed::face_alike(own, &face, config)));
        let mut closed = Vec::new();
        for &rect in &rects {
            closed.extend(face.map(|face| weigh::ClosedFront { face, rect, grip, grip_std_m: best_std_m }));
            // Of the best clip all of these are one.
            let other = face.filter(|_| c != best);
            closed.extend(other.map(|face| weigh::ClosedFront { face, rect, grip: own_grip, grip_std_m: own_std_m }));
        }
        let own = own.filter(|_| c != best);
        let rect = clips[c].part;
        closed.extend(own.map(|face| weigh::ClosedFront { face, rect, grip: own_grip, grip_std_m: own_std_m }));
        Some(weigh::ClipEvidence {
            reading: narration::read(&clips[c].clip),
            words: clips[c].words.as_ref(),
            path: trajectory.positions(),
            open: open_state::open_views(recording, sketches, &clips[c].clip, trajectory, &config.part),
            closed,
        })
    };
    let shown: Vec<weigh::ClipEvidence> = members.iter().filter_map(shown).collect();
    let shape = outlines.first().or(clips[best].part.as_ref()).map(part_shape);
    let answers = weigh::answers(
        &shown,
        &weigh::AskedPart { grip, face: face.as_ref(), shape },
        &pooled,
        recording,
        reasoner,
        config,
    );
    let answer = Answer::together(&answers)?;
    Some((pooled, answer))
}

/// The candidates of the clips of a part (`group`, the one that saw it best among them) as far as they fit the face of that one.
/// Where outlines are known, their sides stand for those of the clips' own ones.
fn pooled(
    clips: &[ClipResult],
    group: &[usize],
    best: usize,
    grip: &Point,
    outlines: &[Rect],
    config: &crate::config::Inference,
) -> Vec<AxisCandidate> {
    let kept = |c: &&AxisCandidate| outlines.is_empty() || c.source != AxisSource::PartEdge;
    let own = clips[best].candidates.iter().filter(kept).cloned();
    let Some(face) = &clips[best].face else { return own.collect() };
    let mut all = candidates::at_sides(face, outlines, grip, &config.sources);
    all.extend(own);
    let snap = config.snap_deg.to_radians();
    for &c in group.iter().filter(|&&c| c != best) {
        for candidate in clips[c].candidates.iter().filter(kept) {
            // The other clips' slides are this face's or the room's, which are there already.
            if candidate.joint.kind == JointKind::Prismatic {
                continue;
            }
            let axis = candidate.joint.axis;
            let Some(along) = [face.up, face.right].into_iter().find(|a| crate::math::unsigned_angle(a, &axis) <= snap)
            else {
                continue;
            };
            let side = candidates::side_at(face, &along, &candidate.joint.origin);
            let joint = candidates::outward(Articulation { axis: along, ..candidate.joint }, face, grip);
            all.push(AxisCandidate { joint, side: Some(side), ..candidate.clone() });
        }
    }
    all
}
