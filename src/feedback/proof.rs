//! A joint that loses its own proof clearly gives way to what beats it.
//!
//! The posterior weighs hand, depth, shape and words together; the proof asks the hands alone, of all clips of a part. Where one
//! of the part's rivals makes them more likely by a margin that decides, something was misread:
//!
//! - a clip's hand, where more of the others' fit: that clip keeps its part and is no longer evidence about it;
//! - else the joint: the first of these takes its place that the hands prefer by the same margin, that can be built and that does
//!   not run into its own furniture: a hypothesis of the part that agrees with the rival, or the rival.
//!
//! Where nothing takes its place the joint stays, and its verdict says that it fails.

use std::collections::BTreeMap;

use rayon::prelude::*;

use super::{FULL, Refutation, reweighed};
use crate::articulation::{Action, Articulation};
use crate::config::{self, Config};
use crate::fitting;
use crate::hands::Trajectory;
use crate::inference::{self, observed_range};
use crate::math::Vector;
use crate::pipeline::{Hypothesis, Scene, SceneJoint, Told};
use crate::twin::{Part, Solid};
use crate::validation::RivalCheck;
use crate::validation::rivals::{Evidence, anchored, distance2, log_likelihood};
use crate::validation::verdict::beaten;

/// Lets the scene's joints that clearly lose to a rival give way. Nothing changes where `validation.feedback` is off, and where
/// nobody computed hypotheses.
pub fn prove(scene: &mut Scene, up: &Vector, config: &Config) {
    if !config.validation.feedback {
        return;
    }
    let parts = parts(scene, &scene.joints, up, config);
    let proved: Vec<Option<SceneJoint>> = scene
        .joints
        .par_iter()
        .map(|joint| {
            let part = parts.get(&joint.id).filter(|_| !joint.hypotheses.is_empty())?;
            beaten(part, &hands(scene, joint), &config.validation)?;
            Some(without_misread(scene, joint, config))
        })
        .collect();
    if proved.iter().all(Option::is_none) {
        return;
    }
    let walls = super::walls(scene, up, config);
    for (index, proved) in proved.into_iter().enumerate() {
        let (Some(joint), Some(part)) = (proved, scene.joints.get(index).and_then(|j| parts.get(&j.id))) else {
            continue;
        };
        scene.joints[index] = joint;
        let joint = &scene.joints[index];
        if let Some(rival) = beaten(part, &hands(scene, joint), &config.validation)
            && let Some(instead) = instead(scene, index, &rival, &walls, up, config)
        {
            scene.joints[index] = instead;
        }
    }
}

/// The parts that these joints get, by their names; none for what cannot be built.
fn parts(scene: &Scene, joints: &[SceneJoint], up: &Vector, config: &Config) -> BTreeMap<String, Part> {
    let bare = config::Fitting { room: false, ..config.fitting.clone() };
    let twin = fitting::fit_joints(scene, joints, up, &bare, &config.priors);
    twin.furniture.into_iter().map(|f| (f.part.id.clone(), f.part)).collect()
}

fn hand<'a>(scene: &'a Scene, clip: &str) -> Option<&'a Trajectory> {
    scene.clips.iter().find(|c| c.clip.clip == clip)?.trajectory.as_ref()
}

/// The hands that moved a joint.
fn hands<'a>(scene: &'a Scene, joint: &SceneJoint) -> Vec<&'a Trajectory> {
    joint.clips.iter().filter_map(|clip| hand(scene, clip)).collect()
}

/// A joint without the hands that it leaves unexplained, where more of them are explained. Those clips are still told to move it.
fn without_misread(scene: &Scene, joint: &SceneJoint, config: &Config) -> SceneJoint {
    // `None`: there is no hand to explain.
    let explained = |clip: &String| {
        let evidence = Evidence::of(hand(scene, clip)?, &config.validation)?;
        let limit_m = 2.0 * config.validation.pass_rms_m.max(evidence.noise_m);
        Some(distance2(&joint.joint, &evidence).sqrt() <= limit_m)
    };
    let fits: Vec<Option<bool>> = joint.clips.iter().map(explained).collect();
    let count = |wanted: bool| fits.iter().filter(|fit| **fit == Some(wanted)).count();
    let with = fits.iter().position(|fit| *fit == Some(true)).and_then(|i| joint.clips.get(i));
    let Some(with) = with.filter(|_| count(true) > count(false)) else { return joint.clone() };
    let kept = |i: usize| fits.get(i).is_none_or(|fit| *fit != Some(false));
    let moved = |all: &[f64]| -> Vec<f64> { (0..all.len()).filter(|i| kept(*i)).map(|i| all[i]).collect() };
    let farthest = |moved: &[f64]| moved.iter().copied().fold(0.0, f64::max);
    let mut out = joint.clone();
    out.clips = (0..joint.clips.len()).filter(|i| kept(*i)).map(|i| joint.clips[i].clone()).collect();
    out.moved = moved(&joint.moved);
    out.observed_range = farthest(&out.moved);
    for hypothesis in &mut out.hypotheses {
        hypothesis.moved = moved(&hypothesis.moved);
        hypothesis.observed_range = farthest(&hypothesis.moved);
    }
    for (clip, _) in joint.clips.iter().zip(&fits).filter(|(_, fit)| **fit == Some(false)) {
        let action = hand(scene, clip).map_or(Action::Open, |hand| hand.action);
        out.told.push(Told { clip: clip.clone(), with: with.clone(), action });
    }
    out
}

fn instead(
    scene: &Scene,
    index: usize,
    rival: &RivalCheck,
    walls: &[Solid],
    up: &Vector,
    config: &Config,
) -> Option<SceneJoint> {
    let joint = scene.joints.get(index)?;
    let known = as_hypothesis(scene, joint, &rival.articulation, config);
    let hands = hands(scene, joint);
    let clips: Vec<Evidence> = hands.iter().filter_map(|h| Evidence::of(h, &config.validation)).collect();
    let own = log_likelihood(&joint.joint, &clips, &config.validation);
    let preferred =
        |h: &&Hypothesis| log_likelihood(&h.joint, &clips, &config.validation) - own >= config.validation.margin_nats;
    let agreeing = joint.hypotheses.iter().skip(1).filter(|h| inference::is_right(&rival.articulation, &h.joint));
    let chosen = agreeing.chain([&known]).filter(preferred).find(|h| stands(scene, index, h, walls, up, config))?;
    let why = format!(
        "it loses its proof: a {} explains the recorded hand better, to {:.1} cm",
        rival.name,
        100.0 * rival.distance_m
    );
    Some(replaced(joint, chosen, rival, &why))
}

/// A rival as one more way in which the part could move. Its share is what the listed ones leave.
fn as_hypothesis(scene: &Scene, joint: &SceneJoint, rival: &Articulation, config: &Config) -> Hypothesis {
    let range = |clip: &String| {
        let evidence = hand(scene, clip).and_then(|hand| Evidence::of(hand, &config.validation));
        evidence.map_or(0.0, |e| observed_range(rival, &anchored(rival, &e), &e.path))
    };
    let moved: Vec<f64> = joint.clips.iter().map(range).collect();
    let type_share = joint.hypotheses.iter().find(|h| h.joint.kind == rival.kind).map(|h| h.type_share);
    let listed: f64 = joint.hypotheses.iter().map(|h| h.share).sum();
    let share = (1.0 - listed).max(0.0);
    Hypothesis {
        joint: *rival,
        share,
        type_share: type_share.unwrap_or(share),
        uncertainty: None,
        part: joint.part,
        observed_range: moved.iter().copied().fold(0.0, f64::max),
        moved,
        refuted: None,
    }
}

/// Whether a part can be built under a hypothesis and has nothing certain in its way.
fn stands(scene: &Scene, index: usize, hypothesis: &Hypothesis, walls: &[Solid], up: &Vector, config: &Config) -> bool {
    let mut joints = scene.joints.clone();
    let Some(joint) = joints.get_mut(index) else { return false };
    *joint = joint.under(hypothesis);
    let id = joint.id.clone();
    let refutation = super::judged(scene, index, hypothesis, walls, up, config);
    refutation.is_none_or(|Refutation { weight, .. }| weight < FULL)
        && parts(scene, &joints, up, config).contains_key(&id)
}

/// The joint under what takes its place. What was refuted loses the nats by which it was beaten.
fn replaced(joint: &SceneJoint, chosen: &Hypothesis, rival: &RivalCheck, why: &str) -> SceneJoint {
    let mut listed = joint.hypotheses.clone();
    if let Some(own) = listed.first_mut() {
        own.refuted = Some(why.to_owned());
    }
    let at = listed.iter().position(|h| h == chosen).unwrap_or_else(|| {
        listed.push(chosen.clone());
        listed.len() - 1
    });
    let nats: Vec<f64> = (0..listed.len()).map(|i| if i == 0 { (-rival.margin_nats).max(0.0) } else { 0.0 }).collect();
    let mut hypotheses = reweighed(&listed, &nats);
    hypotheses[..=at].rotate_right(1);
    let answer = hypotheses[0].clone();
    let agreeing: f64 =
        hypotheses.iter().filter(|h| inference::is_right(&answer.joint, &h.joint)).map(|h| h.share).sum();
    SceneJoint {
        type_probability: Some(answer.type_share),
        joint_probability: Some(agreeing.min(answer.type_share)),
        hypotheses,
        ..joint.under(&answer)
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{DOOR, DRAWER, GRIP, doubtful, hand, hypothesis, scene, text};
    use super::*;
    use crate::articulation::JointKind;
    use crate::pipeline::ClipResult;

    /// The scene of one part that clips `a`, `b`, ... moved, each along one of these joints.
    fn moved_along(joint: SceneJoint, ways: &[(Articulation, f64)]) -> Scene {
        let names: Vec<String> = ('a'..).take(ways.len()).map(String::from).collect();
        let moved: Vec<f64> = ways.iter().map(|(_, range)| *range).collect();
        let mut joint = SceneJoint { clips: names.clone(), moved: moved.clone(), ..joint };
        joint.hypotheses.iter_mut().for_each(|h| h.moved.clone_from(&moved));
        let mut out = scene(vec![joint]);
        let first = out.clips[0].clip.clone();
        let clip = |(name, (way, range)): (&String, &(Articulation, f64))| {
            let clip = crate::recording::Clip { clip: name.clone(), ..first.clone() };
            ClipResult { trajectory: Some(hand(way, &GRIP, *range)), ..ClipResult::unanswered(clip, String::new()) }
        };
        out.clips = names.iter().zip(ways).map(clip).collect();
        out
    }

    fn door() -> SceneJoint {
        let hypotheses = vec![hypothesis(DOOR, 0.6, 0.605, 1.1), hypothesis(DRAWER, 0.39, 0.395, 0.4)];
        SceneJoint { joint: DOOR, observed_range: 1.1, hypotheses, ..doubtful() }
    }

    fn after(mut scene: Scene) -> SceneJoint {
        prove(&mut scene, &Vector::z(), &Config::default());
        scene.joints.remove(0)
    }

    #[test]
    fn a_joint_that_the_hand_refutes_gives_way_to_the_hypothesis_that_it_prefers() {
        let joint = after(moved_along(doubtful(), &[(DOOR, 1.1)]));
        assert_eq!((joint.joint, joint.hypotheses.len()), (DOOR, 2));
        let [door, drawer] = [&joint.hypotheses[0], &joint.hypotheses[1]];
        assert!(door.refuted.is_none() && drawer.refuted.as_ref().is_some_and(|why| why.contains("loses its proof")));
        assert!(drawer.share < 0.05 && joint.joint_probability.is_some_and(|p| p > 0.5), "{joint:?}");
    }

    #[test]
    fn a_joint_that_its_hands_bear_out_stays_as_it_is_and_so_does_all_without_feedback() {
        let mut scene = moved_along(door(), &[(DOOR, 1.1), (DOOR, 0.8)]);
        let before = text(&scene.joints);
        prove(&mut scene, &Vector::z(), &Config::default());
        assert_eq!(text(&scene.joints), before);
        let mut config = Config::default();
        config.validation.feedback = false;
        let mut refuted = moved_along(doubtful(), &[(DOOR, 1.1)]);
        let before = text(&refuted.joints);
        prove(&mut refuted, &Vector::z(), &config);
        assert_eq!(text(&refuted.joints), before);
    }

    #[test]
    fn one_misread_hand_of_three_costs_its_clip_and_not_the_joint() {
        // A hand that goes up by 60 cm holds no door.
        let up = Articulation { axis: Vector::z(), ..DRAWER };
        let scene = moved_along(door(), &[(DOOR, 1.1), (up, 0.6), (DOOR, 0.9)]);
        let joint = without_misread(&scene, &scene.joints[0], &Config::default());
        assert_eq!((joint.joint, joint.clips.as_slice()), (DOOR, &["a".to_owned(), "c".to_owned()][..]));
        assert_eq!((joint.moved.as_slice(), joint.observed_range), (&[1.1, 0.9][..], 1.1));
        assert_eq!(joint.told, [Told { clip: "b".to_owned(), with: "a".to_owned(), action: Action::Open }]);
        assert_eq!(joint.shown_by("b"), Some(0));
    }

    #[test]
    fn a_joint_that_most_hands_refute_keeps_no_clip_for_the_one_that_fits() {
        let joint = after(moved_along(door(), &[(DOOR, 1.1), (DRAWER, 0.44), (DRAWER, 0.4), (DRAWER, 0.42)]));
        assert_eq!((joint.joint.kind, joint.clips.len(), joint.told.len()), (JointKind::Prismatic, 4, 0), "{joint:?}");
    }
}
