//! Clips of one part to one joint of the scene (§C.2).

use rayon::prelude::*;

use super::clip::{self, part_shape};
use super::closed::{self, Grip, by_trust};
use super::refit;
use super::{ClipResult, Hypothesis, SceneJoint, Told, told, weigh, without_depth};
use crate::articulation::{Action, Articulation, JointKind};
use crate::config::{Config, InferenceMethod, SceneRules};
use crate::geometry::Rect;
use crate::geometry::{AxisCandidate, AxisSource, Face, candidates};
use crate::hands::{self, Trajectory};
use crate::inference::same_part::{Name, Sight};
use crate::inference::{self, aggregate, grouping, uncertainty};
use crate::localization::Footage;
use crate::math::Point;
use crate::part::{front, outline, views as open_state};
use crate::reasoning::{self, Answer, Reasoner};
use crate::recording::narration;

/// Whether a joint's hinge tells two parts apart: where its type is sure, or nobody computed how sure it is.
fn sure(type_probability: Option<f64>, config: &Config) -> bool {
    type_probability.is_none_or(|p| p > config.inference.scene.sure)
}

/// Clips to scene-level joints (§C.2).
pub(super) fn merge(
    footage: &Footage,
    clips: &[ClipResult],
    reasoner: &dyn Reasoner,
    config: &Config,
) -> Vec<SceneJoint> {
    // Clips with a hand take part even where they have no answer of their own: what they show counts.
    let mut seen: Vec<(usize, &ClipResult, &Trajectory)> =
        clips.iter().enumerate().filter_map(|(i, c)| c.trajectory.as_ref().map(|t| (i, c, t))).collect();
    // Clips may be listed in any order; people open before they close.
    seen.sort_by_key(|(i, c, _)| (c.clip.start_frame, *i));
    let paths: Vec<Vec<Point>> = seen.iter().map(|(.., trajectory)| trajectory.positions()).collect();
    let named: Vec<Option<narration::Reading>> = seen.iter().map(|(_, clip, _)| naming(clip)).collect();
    let held: Vec<grouping::Held> = seen
        .iter()
        .zip(paths.iter().zip(&named))
        .map(|((_, clip, hand), (path, named))| held(clip, hand, path, named.as_ref(), config))
        .collect();
    let unseen = unseen(&seen, clips);
    let missed: Vec<grouping::Missed> = unseen
        .iter()
        .map(|lost| grouping::Missed { after: lost.after, action: lost.action, name: Name::of(lost.named.as_ref()) })
        .collect();
    let grouped = grouping::group(&held, &missed, config);
    let groups: Vec<Vec<usize>> = grouped
        .parts
        .into_iter()
        .map(|g| g.into_iter().map(|i| seen[i].0).collect::<Vec<usize>>())
        .filter(|g| g.iter().any(|&c| clips[c].joint.found().is_some()))
        .collect();
    let first = merged(footage, clips, &groups, reasoner, config);
    let again = |groups: &[Vec<usize>]| merged(footage, clips, groups, reasoner, config);
    let mut joints: Vec<SceneJoint> =
        regrouped(first, clips, again, config).into_iter().map(|(_, joint)| joint).collect();
    for (i, joint) in joints.iter_mut().enumerate() {
        joint.id = format!("joint_{i}");
    }
    let name = |clip: usize| clips[clip].clip.clip.clone();
    let ties = grouped.ties.iter().map(|tie| Told {
        clip: name(unseen[tie.missed].clip),
        with: name(seen[tie.with].0),
        action: tie.action,
    });
    told::tie(&mut joints, ties, clips);
    joints
}

/// What a clip with a hand shows of the part that it moves.
fn held<'a>(
    clip: &'a ClipResult,
    hand: &Trajectory,
    path: &'a [Point],
    named: Option<&'a narration::Reading>,
    config: &Config,
) -> grouping::Held<'a> {
    let joint = clip.joint.found().filter(|j| sure(j.type_probability, config)).map(|j| j.joint);
    grouping::Held {
        sight: Sight {
            grip: hand.closed_grip(),
            grip_std_m: hands::grip_std_m(hand.closed_end_seen()),
            face: clip.face.filter(|f| !f.is_assumed()),
            outline: clip.part,
            joint,
            name: Name::of(named),
        },
        action: hand.action,
        open: hand.open_grip(),
        open_std_m: hands::grip_std_m(hand.open_end_seen()),
        path,
        voxels: clip.region.as_ref().map_or_else(Default::default, |region| region.voxels.as_slice()),
    }
}

/// What a narration says that names the furniture.
fn naming(clip: &ClipResult) -> Option<narration::Reading> {
    Some(narration::read(&clip.clip)).filter(narration::Reading::names_furniture)
}

/// A clip that moves something without a hand that was followed.
struct Unseen {
    /// Its index.
    clip: usize,
    /// How many of the clips with a hand come before it.
    after: usize,
    /// What its narration says that it does, and what it names.
    action: Option<Action>,
    named: Option<narration::Reading>,
}

/// All of them, in the order of time.
fn unseen(seen: &[(usize, &ClipResult, &Trajectory)], clips: &[ClipResult]) -> Vec<Unseen> {
    let order = |i: usize| (clips[i].clip.start_frame, i);
    let before = |i: usize| seen.partition_point(|(s, ..)| order(*s) < order(i));
    let mut all: Vec<Unseen> = clips
        .iter()
        .enumerate()
        .filter(|(_, clip)| clip.trajectory.is_none())
        .filter_map(|(i, clip)| {
            let reading = narration::read(&clip.clip);
            (reading.moves_joint == Some(true)).then(|| Unseen {
                clip: i,
                after: before(i),
                action: reading.action,
                named: naming(clip),
            })
        })
        .collect();
    all.sort_by_key(|lost| order(lost.clip));
    all
}

/// Groups with their joints, those whose fronts turn out to be one judged `again` together: outlines are known better once all
/// clips of a part were judged together.
fn regrouped(
    mut joints: Vec<(Vec<usize>, SceneJoint)>,
    clips: &[ClipResult],
    again: impl Fn(&[Vec<usize>]) -> Vec<(Vec<usize>, SceneJoint)>,
    config: &Config,
) -> Vec<(Vec<usize>, SceneJoint)> {
    loop {
        let named: Vec<Option<narration::Reading>> =
            joints.iter().map(|(members, _)| members.iter().find_map(|&c| naming(&clips[c]))).collect();
        let fronts: Vec<Option<Sight>> = joints
            .iter()
            .zip(&named)
            .map(|((members, joint), named)| front_of(members, joint, clips, named.as_ref(), config))
            .collect();
        let sets = grouping::same_fronts(&fronts, config);
        if sets.len() == joints.len() {
            return joints;
        }
        let (alone, together): (Vec<_>, Vec<_>) = sets.into_iter().partition(|set| set.len() == 1);
        let groups: Vec<Vec<usize>> = together
            .iter()
            .map(|set| {
                let mut members: Vec<usize> = set.iter().flat_map(|&j| joints[j].0.iter().copied()).collect();
                members.sort_by_key(|&c| (clips[c].clip.start_frame, c));
                members
            })
            .collect();
        joints = alone.iter().flatten().map(|&j| joints[j].clone()).chain(again(&groups)).collect();
        joints.sort_by_key(|(members, _)| members.first().map(|&c| (clips[c].clip.start_frame, c)));
    }
}

/// What all clips of a part together show of it; none where no front or no outline is known.
fn front_of<'a>(
    members: &[usize],
    joint: &SceneJoint,
    clips: &[ClipResult],
    named: Option<&'a narration::Reading>,
    config: &Config,
) -> Option<Sight<'a>> {
    let mut trajectories = members.iter().filter_map(|&c| clips[c].trajectory.as_ref());
    let seen = trajectories.any(Trajectory::closed_end_seen);
    Some(Sight {
        grip: joint.grip,
        grip_std_m: hands::grip_std_m(seen),
        face: Some(joint.face?),
        outline: Some(joint.part?),
        joint: Some(joint.joint).filter(|_| sure(joint.type_probability, config)),
        name: Name::of(named),
    })
}

/// The groups that have a joint, and it.
fn merged(
    footage: &Footage,
    clips: &[ClipResult],
    groups: &[Vec<usize>],
    reasoner: &dyn Reasoner,
    config: &Config,
) -> Vec<(Vec<usize>, SceneJoint)> {
    groups
        .par_iter()
        .filter_map(|members| {
            let joint = merge_group(&Group { footage: *footage, clips, members, config }, reasoner)?;
            Some((members.clone(), joint))
        })
        .collect()
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
    let mut all = candidates::at_sides(face, outlines, grip);
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

/// What the clips of one part say together.
struct Judged {
    /// The clip that saw the closed part best: it gives the face, the grip and the part's outline.
    best: usize,
    /// That clip's grip when closed, world.
    grip: Point,
    /// How the part could move, the answer first; never empty.
    likely: Vec<Likely>,
    /// Of the answer; `None` where nobody computed them.
    type_probability: Option<f64>,
    joint_probability: Option<f64>,
}

/// One way in which a part could move; see [`inference::Explanation`].
struct Likely {
    joint: Articulation,
    /// The candidate that stands for it.
    chosen: AxisCandidate,
    share: f64,
    type_share: f64,
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
            let joint = if merged { aggregate::consensus(&seed, &members) } else { seed };
            let chosen = candidates[head].clone();
            Some(Likely { joint, chosen, share: e.share, type_share: e.type_share })
        })
        .collect()
}

/// Clips of one part, and what they are judged with.
#[derive(Clone, Copy)]
struct Group<'a> {
    footage: Footage<'a>,
    clips: &'a [ClipResult],
    /// Indices into `clips`.
    members: &'a [usize],
    config: &'a Config,
}

impl<'a> Group<'a> {
    /// The clips in which a hand was followed.
    fn shown(&self) -> Vec<(&'a ClipResult, &'a Trajectory)> {
        let clips = self.members.iter().map(|&c| &self.clips[c]);
        clips.filter_map(|clip| Some((clip, clip.trajectory.as_ref()?))).collect()
    }

    /// Whether no clip saw anything of the furniture.
    fn is_assumed(&self) -> bool {
        self.members.iter().all(|&c| self.clips[c].region.is_none())
    }

    /// The front under a joint: that of the clip `best`, which saw it best; where nothing was seen the one that goes with the joint.
    fn front(&self, best: usize, joint: &Articulation, grip: &Point) -> Option<Face> {
        if !self.is_assumed() {
            return self.clips[best].face;
        }
        let others = self.members.iter().filter(|c| **c != best);
        let faces = std::iter::once(&best).chain(others).filter_map(|&c| self.clips[c].face.as_ref());
        let up = self.footage.recording.up();
        Some(without_depth::front(joint, grip, faces, &up, self.config))
    }
}

/// One part's joint, and how else it could move.
fn merge_group(group: &Group, reasoner: &dyn Reasoner) -> Option<SceneJoint> {
    let Group { clips, members, .. } = *group;
    let (look, hypotheses) = borne_out(group, reasoner)?;
    let answer = hypotheses.first()?.clone();
    Some(SceneJoint {
        id: String::new(),
        joint: answer.joint,
        clips: members.iter().map(|&c| clips[c].clip.clip.clone()).collect(),
        told: Vec::new(),
        // Where people said "it", a model may have seen what it was.
        furniture: members
            .iter()
            .find_map(|&c| narration::read(&clips[c].clip).furniture)
            .or_else(|| members.iter().find_map(|&c| clips[c].words.as_ref()?.furniture.clone())),
        type_probability: look.type_probability,
        joint_probability: look.joint_probability,
        uncertainty: answer.uncertainty,
        grip: look.grip,
        face: group.front(look.best, &answer.joint, &look.grip),
        part: answer.part,
        observed_range: answer.observed_range,
        moved: answer.moved,
        // Without a posterior there are no shares to tell.
        hypotheses: if look.joint_probability.is_some() { hypotheses } else { Vec::new() },
    })
}

/// What the clips say together of the front of the one that saw it closed best. Where that leaves hands unexplained that another
/// clip's front explains by far, it was no front of this part, and that other one's answer stands: hands are the evidence that
/// asks for no front, and evidence under two fronts is not comparable otherwise.
fn borne_out(group: &Group, reasoner: &dyn Reasoner) -> Option<(Judged, Vec<Hypothesis>)> {
    let config = group.config;
    let by_far = config.part.by_far_nats;
    let trusted = by_trust(group.clips, group.members, config);
    let first = under_front(group, reasoner, &trusted)?;
    let hands = Hands::of(group);
    if config.inference.method == InferenceMethod::Paper || hands.best() - hands.nats(&first.1) <= by_far {
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
struct Hands<'a> {
    paths: Vec<Vec<Point>>,
    config: &'a Config,
}

impl<'a> Hands<'a> {
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
    let mut look = judged(group, reasoner, trusted, &[])?;
    let config = group.config;
    let rules = &config.inference.scene;
    let around = around(group, look.best);
    // Without the depth of the open states there are no other outlines than before.
    if config.inference.method == InferenceMethod::Posterior && config.inference.second_look && config.inference.refit {
        let worth = look.likely.iter().enumerate().filter(|(i, l)| *i == 0 || l.share >= rules.outlined_share);
        // One round tells how far the part reaches; a second one is for the hinge.
        let outlines: Vec<Rect> = worth.filter_map(|(_, l)| built(group, &look, l, &around, 1).part).collect();
        if !outlines.is_empty() {
            look = judged(group, reasoner, trusted, &outlines)?;
        }
    }
    // What physics will not be asked about is not built.
    let asked = if config.validation.feedback { look.likely.len() } else { 1 };
    let hypotheses: Vec<Hypothesis> =
        look.likely.iter().take(asked).map(|l| built(group, &look, l, &around, rules.rounds)).collect();
    Some((look, hypotheses))
}

/// All candidates of all clips of one part, judged on every clip: the best explains all of them. `trusted`: the clips with an
/// answer; the first gives the face, the grip and the part's outline.
///
/// `outlines`: of the part on the face of the clip that saw it best, one for each way in which it could move and left one, by
/// falling likelihood; none in a first look, which takes what that clip knows. Every candidate is judged under the outline
/// that suits it best.
fn judged(group: &Group, reasoner: &dyn Reasoner, trusted: &[usize], outlines: &[Rect]) -> Option<Judged> {
    let Group { clips, members, config, .. } = *group;
    let best = *trusted.first()?;
    let best_joint = clips[best].joint.found()?;
    let grip = best_joint.grip;
    let (mut joint, mut type_probability) = (best_joint.joint, best_joint.type_probability);
    let mut joint_probability = best_joint.joint_probability;
    let mut all_likely = Vec::new();
    // The clip whose answer the joint is built on.
    let mut speaker = best;
    let judged_before = members.len() == 1 && outlines.is_empty();
    if members.len() > 1 && config.inference.method == InferenceMethod::Paper {
        let (speakers, own): (Vec<usize>, Vec<&inference::ClipJoint>) =
            members.iter().filter_map(|&c| Some((c, clips[c].joint.found()?))).unzip();
        let paths: Vec<Vec<Point>> = group.shown().iter().map(|(_, hand)| hand.positions()).collect();
        if let Some((winner, merged)) = inference::paper::together(&own, &paths, &config.inference) {
            (speaker, joint) = (speakers[winner], merged);
        }
    } else if !judged_before {
        let most = config.inference.scene.offering;
        let mut offering: Vec<usize> = members.to_vec();
        if members.len() > most {
            offering.retain(|c| trusted.iter().take(most).any(|t| t == c));
        }
        let (pooled, answer) = match group.is_assumed() {
            true => without_depth::together(clips, members, &offering, config)?,
            false => asked(group, reasoner, best, &offering, outlines)?,
        };
        let weights = answer.log_weights();
        let revolute_probability = answer.revolute_probability(&pooled);
        let revolute = revolute_probability >= 0.5;
        let of_kind = |k: &AxisCandidate| (k.joint.kind == JointKind::Revolute) == revolute;
        let top = (0..pooled.len())
            .filter(|&i| of_kind(&pooled[i]) && weights[i].is_finite())
            .max_by(|&a, &b| weights[a].total_cmp(&weights[b]).then(b.cmp(&a)));
        if let Some(top) = top {
            let all: Vec<(Articulation, f64)> =
                pooled.iter().zip(&weights).map(|(k, w)| (k.joint, (w - weights[top]).exp())).collect();
            joint = aggregate::consensus(&pooled[top].joint, &all);
            let of_type = revolute_probability.max(1.0 - revolute_probability);
            type_probability = Some(of_type);
            joint_probability = Some(of_type * inference::agreeing_share(&pooled[top].joint, &all));
            all_likely = likely(&pooled, &answer, true, &config.inference.scene);
        }
    } else if let (InferenceMethod::Posterior, Some(answer)) = (config.inference.method, &clips[best].answer) {
        all_likely = likely(&clips[best].candidates, answer, false, &config.inference.scene);
    }
    match all_likely.first_mut() {
        Some(answer) => answer.joint = joint,
        None => {
            let own = clips[speaker].joint.found().unwrap_or(best_joint);
            let chosen = uncertainty::chosen(own, &clips[speaker].candidates);
            // The only one; where nobody computed a share, none is told.
            let [share, type_share] = [joint_probability, type_probability].map(|p| p.unwrap_or(1.0));
            all_likely.push(Likely { joint, chosen, share, type_share });
        }
    }
    Some(Judged { best, grip, likely: all_likely, type_probability, joint_probability })
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
    let best_std_m = Grip::of(clips, best)?.std_m();
    let paths: Vec<Vec<Point>> =
        members.iter().filter_map(|&c| clips[c].trajectory.as_ref()).map(Trajectory::positions).collect();
    let pooled = pooled(clips, offering, best, &grip, outlines, &config.inference);
    let pooled = weigh::settled(&pooled, &paths, config);
    // Of the best clip: of each way in which the part could move its own outline.
    let rects: Vec<Option<Rect>> =
        if outlines.is_empty() { vec![clips[best].part] } else { outlines.iter().copied().map(Some).collect() };
    let shown = |&c: &usize| {
        let trajectory = clips[c].trajectory.as_ref()?;
        let (own_grip, own_std_m) = (trajectory.closed_grip(), hands::grip_std_m(trajectory.closed_end_seen()));
        // Depth and hands are biased clip by clip: the face and the grip of the clip itself fit its views best, those
        // of the best clip stand in where it did not see its closed end. Every candidate gets the same choice.
        let own = clips[c].face.filter(|own| {
            face.is_some_and(|f| {
                crate::math::signed_angle(&own.normal, &f.normal) < config.inference.merge_angle_deg.to_radians()
            })
        });
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

/// What a part's outline is told from, beside its joint.
struct Around {
    /// Points of the furniture, world.
    surface: Vec<Point>,
    /// Lines on its face.
    stops: Vec<outline::Stop>,
}

/// Of the clip that saw the closed part best.
fn around(group: &Group, best: usize) -> Around {
    let clip = &group.clips[best];
    let surface = clip
        .region
        .as_ref()
        .map_or_else(Vec::new, |region| clip::surface(&group.footage, region, &clip.views, group.config));
    Around {
        surface,
        stops: clip.face.as_ref().map_or_else(Vec::new, |face| clip::edges_on(face, &clip.lines, group.config)),
    }
}

/// A part under one of its joints: which way it opens, then hinge, openings and outline from the depth of the open state, so many
/// `rounds` of it.
fn built(group: &Group, judged: &Judged, likely: &Likely, around: &Around, rounds: usize) -> Hypothesis {
    let Group { footage, clips, config, .. } = *group;
    let best = judged.best;
    let face = group.front(best, &likely.joint, &judged.grip);
    let shown = group.shown();
    let trajectories = shown.iter().map(|(_, t)| *t);
    // A front that is where the hand says tells no sense of its own, and nothing saw the part open.
    let seen = face.filter(|_| !group.is_assumed());
    let mut joint = inference::opening_sense(likely.joint, seen.as_ref(), &judged.grip, trajectories);
    let mut depth = None;
    let mut part = clips[best].part;
    let mut moved: Vec<f64> = match config.inference.method {
        InferenceMethod::Posterior => refit::by_hand(&shown, &joint, config),
        InferenceMethod::Paper => {
            shown.iter().map(|(_, t)| inference::observed_range(&joint, &t.closed_grip(), &t.positions())).collect()
        }
    };
    let mut widest = moved.iter().copied().fold(0.0, f64::max);
    if config.inference.refit
        && let Some(face) = seen
    {
        // A part of which no outline was seen to move: the piece of it around the grip.
        let mut rect = part.unwrap_or_else(|| outline::smallest(&config.part));
        let start = refit::Believed { joint, hinge_m: config.reasoning.hand_std_m };
        let mut believed = start;
        for _ in 0..rounds {
            let closed = refit::Closed { face, rect, surface: &around.surface };
            let Some(fit) = refit::refitted(&footage, &shown, &believed, &closed, config) else { break };
            // With the openings known better the part's outline is, too.
            let seen = front::Seen {
                face: &face,
                rect: &rect,
                surface: &around.surface,
                views: &fit.views,
                joint: &fit.joint,
                openings: &fit.openings,
                stops: &around.stops,
            };
            part = front::fit(&seen, config).or(part);
            rect = part.unwrap_or(rect);
            believed = start.at_side(&fit, &face, &rect, &around.stops, config);
            (joint, moved, widest, depth) = (fit.joint, fit.ranges, fit.widest, Some(fit.depth));
        }
    }
    let evidence = uncertainty::Evidence {
        joint: &joint,
        chosen: &likely.chosen,
        face: face.as_ref(),
        hands: &shown.iter().map(|(_, t)| *t).collect::<Vec<_>>(),
        settled: config.inference.method == InferenceMethod::Posterior,
        moved: &moved,
        depth: depth.as_ref(),
    };
    let uncertainty = uncertainty::of(&evidence, &config.reasoning, &config.part);
    Hypothesis {
        joint,
        share: likely.share,
        type_share: likely.type_share,
        uncertainty,
        part,
        observed_range: widest,
        moved,
        refuted: None,
    }
}
