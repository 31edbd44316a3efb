//! Clips of one part to one joint of the scene (§C.2).

use std::cmp::Ordering;
use std::collections::BTreeMap;

use rayon::prelude::*;

use super::clip::{self, part_shape};
use super::{ClipResult, SceneJoint};
use crate::articulation::{Action, Articulation, JointKind};
use crate::config::{Config, InferenceMethod};
use crate::geometry::moved::{Hold, Rect};
use crate::geometry::openings::{self, OpenState, Opening};
use crate::geometry::{AxisCandidate, Face, candidates, moved};
use crate::hands::{self, Trajectory};
use crate::inference::{self, aggregate};
use crate::math::Point;
use crate::reasoning::{Answer, Question, Reasoner};
use crate::recording::Recording;
use crate::recording::narration;
use crate::recording::sketch::Sketch;

/// Clips to scene-level joints (§C.2).
pub(super) fn merge(
    recording: &Recording,
    sketches: &BTreeMap<usize, Sketch>,
    clips: &[ClipResult],
    reasoner: &dyn Reasoner,
    config: &Config,
) -> Vec<SceneJoint> {
    // Clips with a hand take part even where they have no answer of their own: what they show counts.
    let mut seen: Vec<(usize, &ClipResult, &Trajectory)> =
        clips.iter().enumerate().filter_map(|(i, c)| c.trajectory.as_ref().map(|t| (i, c, t))).collect();
    // Clips may be listed in any order; people open before they close.
    seen.sort_by_key(|(i, c, _)| (c.clip.start_frame, *i));
    let held: Vec<aggregate::Held> = seen
        .iter()
        .map(|(_, clip, trajectory)| aggregate::Held {
            action: trajectory.action,
            closed: trajectory.closed_grip(),
            open: trajectory.open_grip(),
            normal: clip.face.map(|f| f.normal),
            kind: narration::read(&clip.clip).kind.filter(|_| !narration::read(&clip.clip).generic),
            part: clip.face.zip(clip.part),
            joint: clip.joint.found().filter(|j| j.type_probability > 0.7).map(|j| j.joint),
        })
        .collect();
    let groups: Vec<Vec<usize>> = aggregate::group(&held, &config.inference)
        .into_iter()
        .map(|g| g.into_iter().map(|i| seen[i].0).collect::<Vec<usize>>())
        .filter(|g| g.iter().any(|&c| clips[c].joint.found().is_some()))
        .collect();
    let merged: Vec<Option<SceneJoint>> =
        groups.par_iter().map(|g| merge_group(recording, sketches, clips, g, reasoner, config)).collect();
    let mut joints: Vec<SceneJoint> = merged.into_iter().flatten().collect();
    for (i, joint) in joints.iter_mut().enumerate() {
        joint.id = format!("joint_{i}");
    }
    joints
}

/// The candidates of all clips of a part as far as they fit the face of the clip that saw it best.
fn pooled(
    clips: &[ClipResult],
    group: &[usize],
    best: usize,
    grip: &Point,
    config: &crate::config::Inference,
) -> Vec<AxisCandidate> {
    let mut all = clips[best].candidates.clone();
    let Some(face) = &clips[best].face else { return all };
    let snap = config.snap_deg.to_radians();
    for &c in group.iter().filter(|&&c| c != best) {
        for candidate in &clips[c].candidates {
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

/// All candidates of all clips of one part, judged on every clip: the best explains all of them.
fn merge_group(
    recording: &Recording,
    sketches: &BTreeMap<usize, Sketch>,
    clips: &[ClipResult],
    group: &[usize],
    reasoner: &dyn Reasoner,
    config: &Config,
) -> Option<SceneJoint> {
    // The clip that saw the closed part best gives the face, the grip and the part's outline.
    let trust = |c: usize| -> f64 {
        let clip = &clips[c];
        let (Some(face), Some(region)) = (&clip.face, &clip.region) else { return 0.0 };
        let standoff = face.coordinates(&region.grip)[2];
        let held = (-0.5 * ((standoff - config.geometry.grip_standoff_m) / 0.05).powi(2)).exp();
        held * (0.2 + face.support) * if clip.part.is_some() { 2.0 } else { 1.0 }
    };
    let &best = group
        .iter()
        .filter(|&&c| clips[c].joint.found().is_some())
        .max_by(|&&a, &&b| trust(a).total_cmp(&trust(b)).then(b.cmp(&a)))?;
    let best_joint = clips[best].joint.found()?;
    let grip = best_joint.grip;
    let face = clips[best].face;
    let (mut joint, mut type_probability) = (best_joint.joint, best_joint.type_probability);
    let mut joint_probability = best_joint.joint_probability;
    if group.len() > 1 && config.inference.method == InferenceMethod::Paper {
        // The clips' own joints, one voice each.
        let all: Vec<(Articulation, f64)> =
            group.iter().filter_map(|&c| clips[c].joint.found()).map(|j| (j.joint, 1.0)).collect();
        joint = aggregate::consensus(&joint, &all);
    } else if group.len() > 1 {
        let paths: Vec<Vec<Point>> =
            group.iter().filter_map(|&c| clips[c].trajectory.as_ref()).map(Trajectory::positions).collect();
        let pooled: Vec<AxisCandidate> = pooled(clips, group, best, &grip, &config.inference)
            .iter()
            .map(|c| candidates::settled(c, &paths, &config.reasoning))
            .collect();
        let mut answers = Vec::new();
        for &c in group {
            let Some(trajectory) = &clips[c].trajectory else { continue };
            let open = moved::open_views(recording, sketches, &clips[c].clip, trajectory);
            let path = trajectory.positions();
            // Depth and hands are biased clip by clip: the face and the grip of the clip itself fit its views best, those
            // of the best clip stand in where it did not see its closed end. Every candidate gets the same choice.
            let own = clips[c].face.filter(|own| {
                face.is_some_and(|f| {
                    crate::math::signed_angle(&own.normal, &f.normal) < config.inference.merge_angle_deg.to_radians()
                })
            });
            let own_grip = trajectory.closed_grip();
            let contexts: Vec<(Face, Option<Rect>, Point)> = [
                face.map(|f| (f, clips[best].part, grip)),
                face.map(|f| (f, clips[best].part, own_grip)),
                own.map(|f| (f, clips[c].part, own_grip)),
            ]
            .into_iter()
            .flatten()
            .collect();
            let contexts: Vec<(moved::Sights, Point)> =
                contexts.iter().map(|(f, rect, grip)| (moved::Sights::of(f, rect.as_ref(), &open), *grip)).collect();
            let grip_std_m = hands::grip_std_m(trajectory.closed_end_seen());
            let agreement: Vec<(f64, usize)> = pooled
                .iter()
                .map(|k| {
                    contexts
                        .iter()
                        .map(|(sights, grip)| moved::agreement(sights, &k.joint, grip, grip_std_m))
                        // A share of few points is noise.
                        .max_by(|a, b| {
                            let rank = |x: &(f64, usize)| (x.1 >= moved::MIN_POINTS, x.0);
                            rank(a).partial_cmp(&rank(b)).unwrap_or(Ordering::Equal)
                        })
                        .unwrap_or((0.0, 0))
                })
                .collect();
            answers.push(reasoner.answer(&Question {
                reading: &narration::read(&clips[c].clip),
                words: clips[c].words.as_ref(),
                path: &path,
                grip,
                candidates: &pooled,
                agreement: &agreement,
                part: clips[best].part.as_ref().map(part_shape),
                face: face.as_ref(),
                up: recording.up(),
            }));
        }
        let answer = Answer::together(&answers)?;
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
            let raw = revolute_probability.max(1.0 - revolute_probability);
            let temperature = config.inference.temperature;
            type_probability = inference::tempered(raw, temperature);
            joint_probability =
                inference::tempered(raw * inference::agreeing_share(&pooled[top].joint, &all), temperature);
        }
    }
    let trajectories = || group.iter().filter_map(|&c| clips[c].trajectory.as_ref());
    joint = inference::opening_sense(joint, face.as_ref(), &grip, trajectories());
    let shown: Vec<(&ClipResult, &Trajectory)> =
        group.iter().filter_map(|&c| Some((&clips[c], clips[c].trajectory.as_ref()?))).collect();
    let mut hinge_std_m = None;
    let mut part = clips[best].part;
    let mut moved: Vec<f64> =
        shown.iter().map(|(_, t)| inference::observed_range(&joint, &t.closed_grip(), &t.positions())).collect();
    if config.inference.refit
        && let Some((face, rect)) = face.zip(clips[best].part)
        && let Some(fit) = refitted(recording, sketches, &shown, &joint, &face, &rect, config)
    {
        joint = fit.joint;
        hinge_std_m = (joint.kind == JointKind::Revolute).then_some(fit.position_std_m);
        moved = fit.ranges;
        // With the openings known better the part's outline is, too.
        if let Some(region) = &clips[best].region {
            let reach = config.localization.reach_m;
            let surface = clip::surface(recording, region, &clips[best].views, sketches, reach);
            let stops = clip::edges_on(&face, &clips[best].lines);
            let votes = moved::vote(&face, &surface, &fit.views, Some((&joint, &fit.openings)), &config.fitting);
            part = votes.moving_rect(&stops).or(part);
        }
    }
    let observed_range = moved.iter().copied().fold(0.0, f64::max);
    Some(SceneJoint {
        id: String::new(),
        joint,
        clips: group.iter().map(|&c| clips[c].clip.clip.clone()).collect(),
        // Where people said "it", a model may have seen what it was.
        furniture: group
            .iter()
            .find_map(|&c| narration::read(&clips[c].clip).furniture)
            .or_else(|| group.iter().find_map(|&c| clips[c].words.as_ref()?.furniture.clone())),
        type_probability,
        joint_probability,
        hinge_std_m,
        grip,
        face,
        part,
        observed_range,
        moved,
    })
}

/// A joint after its open views were looked at.
struct Refitted<'a> {
    joint: Articulation,
    /// All clips' views of the open state, and the opening in each.
    views: Vec<moved::View<'a>>,
    openings: Vec<f64>,
    position_std_m: f64,
    /// Opening that each clip went through, rad or m.
    ranges: Vec<f64>,
}

/// The hinge and the openings that the depth of the open states tells. `None` where they were not seen.
#[allow(clippy::too_many_arguments, reason = "what a group of clips knows")]
fn refitted<'a>(
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
    let lever = if joint.kind == JointKind::Revolute { joint.line().distance(&state.grip).max(0.1) } else { 1.0 };
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
