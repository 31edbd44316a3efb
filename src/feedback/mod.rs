//! Physics as evidence about joints that are in doubt, not as a veto (ours).
//!
//! Where the posterior leaves more than one hypothesis about a part, the twin is built under each of them, all other joints
//! as they are, and the part's recorded hands are replayed in it. How well its path fits the hand has been weighed already;
//! what a clip alone could not know is what stands around:
//!
//! | against a hypothesis | weight |
//! |---|---|
//! | it opens into its own furniture | 1 |
//! | the part stops before it has gone where the hand went: something stands there that was seen | 1 |
//! | the same, but what stands there was assumed | 1/2 |
//! | a hinge was opened beyond half a turn | 1 |
//! | a slide was opened beyond its tray or its leaf, whose length is assumed | 1/2 |
//! | the hand pushes it shut, which is the hand's word again | 1/2 |
//! | an arm strains and it does not follow: its mass is assumed | 1/2 |
//! | surer furniture leaves no place to build it | 1/2 |
//!
//! What is told by replays is the mean over the clips that could be replayed. Of all that speaks against a hypothesis the
//! weightiest counts, times `validation.refuted_nats`. One round: every joint is judged among the others as they were before.
//! Of the room, floor and walls count. What else of it stands in the way may be this very part, seen where it was left open.

mod proof;

use rayon::prelude::*;

use crate::articulation::JointKind;
use crate::config::{self, Config};
use crate::fitting;
use crate::geometry::candidates::{IN_FACE, outwardness};
use crate::geometry::{Face, fronts};
use crate::hands::Trajectory;
use crate::inference::{self, observed_range};
use crate::math::{Point, Vector};
use crate::pipeline::{Hypothesis, Scene, SceneJoint};
use crate::twin::{Part, Solid, Twin};
use crate::validation::rivals::{Evidence, anchored};
use crate::validation::verdict::{amount, lacking, made_up_m};
use crate::validation::{Drive, Replay, Surroundings, simulate};

pub use proof::prove;

/// Definition: the weight of what speaks against a hypothesis for sure, and of what is half assumed.
const FULL: f64 = 1.0;
/// Definition: see [`FULL`].
const HALF: f64 = 0.5;

/// What speaks against a hypothesis.
#[derive(Debug, Clone, PartialEq)]
struct Refutation {
    /// 0..=1 of `validation.refuted_nats`.
    weight: f64,
    /// Why, in words.
    reason: String,
}

/// The scene's joints after physics spoke about those in doubt: shares and probabilities of their hypotheses, and another
/// joint where the own one was refuted and another is now likelier. As they are where `validation.feedback` is off.
#[must_use]
pub fn weighed(scene: &Scene, up: &Vector, config: &Config) -> Vec<SceneJoint> {
    if !config.validation.feedback || !scene.joints.iter().any(in_doubt) {
        return scene.joints.clone();
    }
    let walls = walls(scene, up, config);
    scene
        .joints
        .par_iter()
        .enumerate()
        .map(|(index, joint)| {
            if !in_doubt(joint) {
                return joint.clone();
            }
            let against: Vec<Option<Refutation>> =
                joint.hypotheses.iter().map(|h| judged(scene, index, h, &walls, up, config)).collect();
            rechosen(joint, &against, config)
        })
        .collect()
}

fn in_doubt(joint: &SceneJoint) -> bool {
    joint.hypotheses.len() > 1
}

/// Floor and walls as they are while the parts in doubt stay closed: a twin has none where its parts go.
fn walls(scene: &Scene, up: &Vector, config: &Config) -> Vec<Solid> {
    let shut = |joint: &SceneJoint| match in_doubt(joint) {
        true => SceneJoint { observed_range: 0.0, moved: vec![0.0; joint.moved.len()], ..joint.clone() },
        false => joint.clone(),
    };
    let joints: Vec<SceneJoint> = scene.joints.iter().map(shut).collect();
    let bare = config::Fitting { room_boxes: 0, ..config.fitting.clone() };
    fitting::fit_joints(scene, &joints, up, &bare, &config.priors).room
}

/// The twin under one hypothesis about the joint `index` of the scene, and what speaks against it there.
fn judged(
    scene: &Scene,
    index: usize,
    hypothesis: &Hypothesis,
    walls: &[Solid],
    up: &Vector,
    config: &Config,
) -> Option<Refutation> {
    let mut joints = scene.joints.clone();
    let joint = joints.get_mut(index)?;
    *joint = joint.under(hypothesis);
    let SceneJoint { id, face, clips, grip, .. } = joint.clone();
    let bare = config::Fitting { room: false, ..config.fitting.clone() };
    let mut twin = fitting::fit_joints(scene, &joints, up, &bare, &config.priors);
    twin.room = walls.to_vec();
    if let Some(left) = twin.left_out.iter().find(|l| l.id == id) {
        return Some(Refutation { weight: HALF, reason: left.reason.clone() });
    }
    let at = twin.furniture.iter().position(|f| f.part.id == id)?;
    let hands: Vec<&Trajectory> = clips
        .iter()
        .filter_map(|name| scene.clips.iter().find(|c| c.clip.clip == *name)?.trajectory.as_ref())
        .collect();
    let face = face.filter(|f| !f.is_assumed() || fronts::may_be_front(f, &hypothesis.joint, &grip));
    refutation(twin, at, face.as_ref(), &hands, up, &config.validation)
}

/// What speaks against the joint of `twin.furniture[at]`, which these hands moved.
fn refutation(
    mut twin: Twin,
    at: usize,
    face: Option<&Face>,
    hands: &[&Trajectory],
    up: &Vector,
    config: &config::Validation,
) -> Option<Refutation> {
    let part = &twin.furniture.get(at)?.part;
    let phi = part.joint.articulation;
    if face.is_some_and(|f| outwardness(&phi, f, &part.handle) < -IN_FACE) {
        return Some(Refutation { weight: FULL, reason: "it opens into its own furniture".to_owned() });
    }
    let beyond = beyond(part, config);
    let clips: Vec<(Evidence, Point, f64)> = hands
        .iter()
        .filter_map(|hand| Evidence::of(hand, config))
        .map(|clip| {
            let grip = anchored(&phi, &clip);
            let range = observed_range(&phi, &grip, &clip.path);
            (clip, grip, range)
        })
        .collect();
    // As far as the hands went: the part then stops at what stands there, which has a name, and not at a limit before it.
    let most = if phi.kind == JointKind::Revolute { std::f64::consts::PI } else { f64::INFINITY };
    let furthest = clips.iter().map(|(.., range)| *range).fold(part.joint.upper.max(part.joint.observed), f64::max);
    let upper = furthest.min(most);
    twin.furniture.get_mut(at)?.part.joint.upper = upper;
    let part = &twin.furniture.get(at)?.part;
    let around = Surroundings::of(&twin, at, up);
    let told: Vec<Option<Refutation>> = clips
        .iter()
        .filter_map(|(clip, grip, range)| {
            let drive =
                Drive { times_secs: clip.times_secs.clone(), path: clip.path.clone(), grip: *grip, back: false };
            // What cannot be simulated says nothing about the kitchen, for or against.
            let replay = simulate(part, &phi, upper, &around, &drive, config).ok().filter(|r| r.untrusted.is_none())?;
            let lacks = lacking(part, &replay, *range, clip.noise_m, config).is_some();
            Some(if lacks { stopped(&twin, &replay, config) } else { None })
        })
        .collect();
    let mean = told.iter().flatten().map(|r| r.weight).sum::<f64>() / told.len().max(1) as f64;
    let reason = weightiest(told.into_iter().flatten()).map(|r| r.reason);
    weightiest(beyond.into_iter().chain(reason.map(|reason| Refutation { weight: mean, reason })))
}

/// The first of the weightiest.
fn weightiest(all: impl Iterator<Item = Refutation>) -> Option<Refutation> {
    all.reduce(|best, next| if next.weight > best.weight { next } else { best })
}

/// Opened further than such a part can be: half a turn, the length of its tray, the width of its leaf.
fn beyond(part: &Part, config: &config::Validation) -> Option<Refutation> {
    let joint = &part.joint;
    let kind = joint.articulation.kind;
    let too_far_m = (joint.observed - joint.expected) * joint.articulation.lever(&part.handle);
    (too_far_m > made_up_m(config.hand_std_m, config)).then(|| Refutation {
        weight: if kind == JointKind::Revolute { FULL } else { HALF },
        reason: format!(
            "it was opened by {}, and can open by {} at the most",
            amount(kind, joint.observed),
            amount(kind, joint.expected)
        ),
    })
}

/// Why a part did not go where the hand went; `None` where physics has no reason.
fn stopped(twin: &Twin, replay: &Replay, config: &config::Validation) -> Option<Refutation> {
    let trace = &replay.trace;
    let secs = trace.last().map_or(0.0, |t| t[0]).max(config.step_secs);
    let strained = trace.iter().filter(|t| t[2] > config.strained_share * config.hand_force_max_n).count() as f64;
    if let Some(contact) = replay.contacts.first() {
        let assumed = solids(twin).any(|s| s.name == contact.with && !s.seen);
        Some(Refutation {
            weight: if assumed { HALF } else { FULL },
            reason: format!("its {} runs into {}", contact.solid, contact.with),
        })
    } else if replay.limit_steps[0] as f64 * config.step_secs > config.blocked_time_share * secs {
        Some(Refutation { weight: HALF, reason: "the hand pushes it shut".to_owned() })
    } else if strained > config.blocked_time_share * trace.len() as f64 {
        let reason = format!("it takes more than the {:.0} N of an arm", config.hand_force_max_n);
        Some(Refutation { weight: HALF, reason })
    } else {
        None
    }
}

fn solids(twin: &Twin) -> impl Iterator<Item = &Solid> {
    twin.furniture.iter().flat_map(|f| f.carcass.iter().chain(&f.part.solids)).chain(&twin.room)
}

/// A joint with what speaks against each of its hypotheses. Only the differences count: what all of them run into says
/// nothing. A joint that is refuted by no more than the others stays; else the type of the largest share is chosen, and of
/// that type the hypothesis of the largest.
fn rechosen(joint: &SceneJoint, against: &[Option<Refutation>], config: &Config) -> SceneJoint {
    let nats: Vec<f64> =
        against.iter().map(|r| r.as_ref().map_or(0.0, |r| r.weight * config.validation.refuted_nats)).collect();
    let least = nats.iter().copied().fold(f64::INFINITY, f64::min);
    let nats: Vec<f64> = nats.iter().map(|n| n - least).collect();
    let mut hypotheses = reweighed(&joint.hypotheses, &nats);
    for (hypothesis, refutation) in hypotheses.iter_mut().zip(against) {
        hypothesis.refuted = refutation.as_ref().map(|r| r.reason.clone());
    }
    if nats.iter().all(|n| *n <= 0.0) {
        return SceneJoint { hypotheses, ..joint.clone() };
    }
    let order =
        |a: &Hypothesis, b: &Hypothesis| a.type_share.total_cmp(&b.type_share).then(a.share.total_cmp(&b.share));
    let chosen = match nats.first() {
        Some(own) if *own > 0.0 => {
            (0..hypotheses.len()).rev().max_by(|&a, &b| order(&hypotheses[a], &hypotheses[b])).unwrap_or(0)
        }
        _ => 0,
    };
    hypotheses[..=chosen].rotate_right(1);
    let answer = hypotheses[0].clone();
    let right = |of: &[Hypothesis]| -> f64 {
        of.iter().filter(|h| inference::is_right(&answer.joint, &h.joint)).map(|h| h.share).sum()
    };
    // What was too unlikely to be listed and agrees with an answer that stays is counted, too. It is no more than is left of
    // the type beside all that is listed: what was listed, agreed when it was judged and no longer does once fitted, is not it.
    let unlisted = if chosen == 0 {
        let listed: f64 = joint.hypotheses.iter().filter(|h| h.joint.kind == answer.joint.kind).map(|h| h.share).sum();
        let beside = (joint.hypotheses[0].type_share - listed).max(0.0);
        joint.joint_probability.map_or(0.0, |p| (p - right(&joint.hypotheses)).clamp(0.0, beside))
    } else {
        0.0
    };
    let joint_probability = right(&hypotheses) + unlisted / left(&joint.hypotheses, &nats);
    let joint_probability = Some(joint_probability.min(answer.type_share));
    SceneJoint { type_probability: Some(answer.type_share), joint_probability, hypotheses, ..joint.under(&answer) }
}

/// Share that hypotheses of which `of` holds lose with their nats.
fn lost(hypotheses: &[Hypothesis], nats: &[f64], of: impl Fn(&Hypothesis) -> bool) -> f64 {
    hypotheses.iter().zip(nats).filter(|(h, _)| of(h)).map(|(h, n)| -(-n).exp_m1() * h.share).sum()
}

/// What is left of all shares, those of hypotheses that are not listed among them.
fn left(hypotheses: &[Hypothesis], nats: &[f64]) -> f64 {
    (1.0 - lost(hypotheses, nats, |_| true)).max(f64::MIN_POSITIVE)
}

/// Hypotheses after each lost its nats. What was too unlikely to be listed, and so was not asked about, loses none.
fn reweighed(hypotheses: &[Hypothesis], nats: &[f64]) -> Vec<Hypothesis> {
    let left = left(hypotheses, nats);
    hypotheses
        .iter()
        .zip(nats)
        .map(|(h, n)| Hypothesis {
            share: h.share * (-n).exp() / left,
            type_share: ((h.type_share - lost(hypotheses, nats, |other| other.joint.kind == h.joint.kind)) / left)
                .min(1.0),
            ..h.clone()
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use nalgebra::Matrix3;

    use super::*;
    use crate::articulation::{Action, Articulation};
    use crate::geometry::Rect;
    use crate::hands::Sample;
    use crate::pipeline::{ClipResult, RoomCell, RoomCells};
    use crate::recording::Clip;
    use crate::twin::{Furniture, Joint, OrientedBox, Role};

    pub(super) const DOOR: Articulation = Articulation {
        kind: JointKind::Revolute,
        axis: Vector::new(0.0, 0.0, -1.0),
        origin: Point::new(-0.3, 0.0, 0.7),
    };
    pub(super) const DRAWER: Articulation = Articulation {
        kind: JointKind::Prismatic,
        axis: Vector::new(0.0, -1.0, 0.0),
        origin: Point::new(0.2, 0.0, 0.8),
    };
    pub(super) const GRIP: Point = Point::new(0.2, -0.035, 0.8);

    pub(super) fn hypothesis(joint: Articulation, share: f64, type_share: f64, moved: f64) -> Hypothesis {
        let part = Some(Rect { bounds: [[-0.5, 0.06], [-0.3, 0.1]] });
        let uncertainty = None;
        let observed_range = moved;
        Hypothesis { joint, share, type_share, uncertainty, part, observed_range, moved: vec![moved], refuted: None }
    }

    /// A front of 56 x 40 cm in the plane y = 0, seen from -y: a drawer, or a door hinged on the left at x = -0.3.
    pub(super) fn doubtful() -> SceneJoint {
        let drawer = hypothesis(DRAWER, 0.6, 0.605, 0.445);
        SceneJoint {
            id: "joint_0".to_owned(),
            joint: DRAWER,
            clips: vec!["a".to_owned()],
            told: vec![],
            furniture: None,
            type_probability: Some(0.6),
            joint_probability: Some(0.6),
            uncertainty: None,
            grip: GRIP,
            face: Some(Face {
                center: Point::new(0.2, 0.0, 0.8),
                right: Vector::x(),
                up: Vector::z(),
                normal: -Vector::y(),
                extent: [[-0.5, 0.5], [-0.5, 0.5]],
                support: 1.0,
            }),
            part: drawer.part,
            observed_range: 0.445,
            moved: vec![0.445],
            hypotheses: vec![drawer, hypothesis(DOOR, 0.39, 0.395, 1.1)],
        }
    }

    /// A cabinet across the corner on the right, 33 cm before that front: in the way of the drawer's right end, just out of
    /// the door's reach.
    fn neighbour() -> SceneJoint {
        let slide = Articulation { axis: -Vector::x(), origin: Point::new(0.2, -0.53, 0.8), ..DRAWER };
        let alone =
            Hypothesis { part: Some(Rect { bounds: [[-0.2, 0.2], [-0.3, 0.1]] }), ..hypothesis(slide, 1.0, 1.0, 0.0) };
        SceneJoint {
            id: "joint_1".to_owned(),
            joint: slide,
            clips: vec![],
            told: vec![],
            type_probability: Some(0.9),
            joint_probability: Some(0.9),
            grip: Point::new(0.165, -0.53, 0.8),
            face: Some(Face {
                center: slide.origin,
                right: -Vector::y(),
                up: Vector::z(),
                normal: -Vector::x(),
                extent: [[-0.2, 0.2], [-0.3, 0.1]],
                support: 1.0,
            }),
            part: alone.part,
            observed_range: 0.1,
            moved: vec![],
            hypotheses: vec![alone],
            ..doubtful()
        }
    }

    /// A hand that opens `joint` by `range` in two seconds.
    pub(super) fn hand(joint: &Articulation, grip: &Point, range: f64) -> Trajectory {
        let samples = (0..=40)
            .map(|i| {
                let s = f64::from(i) / 40.0;
                let p = joint.motion(range * s.powi(3) * (10.0 - 15.0 * s + 6.0 * s * s)) * grip;
                Sample { frame: i as usize, time_secs: 2.0 * s, observed: p, smoothed: p, accepted: true }
            })
            .collect();
        Trajectory { side: None, samples, action: Action::Open, ends_seen: [true; 2] }
    }

    /// The joints, the first one opened by a hand on an arc of 63 degrees.
    pub(super) fn scene(joints: Vec<SceneJoint>) -> Scene {
        let clip = Clip {
            clip: "a".to_owned(),
            start_frame: 0,
            end_frame: 40,
            narration: String::new(),
            verb: String::new(),
            noun: String::new(),
        };
        let clip =
            ClipResult { trajectory: Some(hand(&DOOR, &GRIP, 1.1)), ..ClipResult::unanswered(clip, String::new()) };
        Scene {
            recording: "r".to_owned(),
            manhattan: None,
            depth_factors: Default::default(),
            videos: Default::default(),
            clips: vec![clip],
            joints,
            surroundings: None,
        }
    }

    pub(super) fn text(joints: &[SceneJoint]) -> String {
        serde_json::to_string(joints).unwrap()
    }

    fn refuted(weight: f64) -> Option<Refutation> {
        Some(Refutation { weight, reason: "so".to_owned() })
    }

    #[test]
    fn a_refuted_hypothesis_loses_its_nats_and_nothing_else_changes_hands() {
        let (config, joint) = (Config::default(), doubtful());
        let odds = |h: &[Hypothesis]| (h[0].share / h[1].share).ln();
        let after = rechosen(&joint, &[None, refuted(0.5)], &config);
        assert!((odds(&after.hypotheses) - odds(&joint.hypotheses) - 1.5).abs() < 1e-12);
        // Of what was not asked about half a hundredth is of each type.
        let [drawer, door] = [&after.hypotheses[0], &after.hypotheses[1]];
        assert!((drawer.type_share + door.type_share - 1.0).abs() < 1e-12);
        assert!(((drawer.type_share - drawer.share) / drawer.share - 0.005 / 0.6).abs() < 1e-12);
        assert_eq!((after.joint, door.refuted.as_deref()), (DRAWER, Some("so")));
        assert_eq!(after.type_probability, Some(drawer.type_share));
        assert!(drawer.type_share > 0.6 && after.joint_probability.unwrap() < drawer.type_share);
    }

    #[test]
    fn an_answer_that_physics_speaks_for_is_surer_with_all_that_agrees_with_it() {
        let (config, mut joint) = (Config::default(), doubtful());
        // The answer, one like it 15 cm beside, its rival; 0.03 that are like the answer are not listed.
        joint.hypotheses[0].share = 0.45;
        let beside = Articulation { origin: DRAWER.origin + Vector::new(0.15, 0.0, 0.0), ..DRAWER };
        joint.hypotheses.push(hypothesis(beside, 0.1, 0.605, 0.445));
        joint.joint_probability = Some(0.58);
        let after = rechosen(&joint, &[None, refuted(1.0), None], &config);
        let left = 1.0 + 0.39 * (-config.validation.refuted_nats).exp_m1();
        assert!(after.joint == DRAWER && (after.joint_probability.unwrap() - 0.58 / left).abs() < 1e-12, "{after:?}");
    }

    #[test]
    fn an_answer_is_never_surer_than_its_type() {
        let (config, mut joint) = (Config::default(), doubtful());
        // One that agreed with the answer when it was judged, and is beside it since it was fitted.
        joint.hypotheses[0].share = 0.3;
        let beside = Articulation { axis: Vector::z(), ..DRAWER };
        joint.hypotheses.push(hypothesis(beside, 0.3, 0.605, 0.445));
        joint.joint_probability = Some(0.6);
        let after = rechosen(&joint, &[None, refuted(1.0), refuted(1.0)], &config);
        let share = after.hypotheses[0].share;
        assert!(after.joint == DRAWER && after.joint_probability >= Some(share), "{after:?}");
        assert!(after.joint_probability <= after.type_probability && after.type_probability <= Some(1.0), "{after:?}");
    }

    #[test]
    fn what_speaks_against_all_says_nothing_and_what_speaks_against_one_may_not_be_enough() {
        let config = Config::default();
        let joint = doubtful();
        let equal = rechosen(&joint, &[refuted(1.0), refuted(1.0)], &config);
        assert!(equal.hypotheses.iter().all(|h| h.refuted.is_some()));
        assert_eq!((equal.joint, equal.type_probability), (joint.joint, joint.type_probability));
        assert_eq!(equal.hypotheses[0].share, joint.hypotheses[0].share);
        let mut surer = joint.clone();
        (surer.hypotheses[0].share, surer.hypotheses[0].type_share) = (0.975, 0.975);
        (surer.hypotheses[1].share, surer.hypotheses[1].type_share) = (0.02, 0.025);
        assert_eq!(rechosen(&surer, &[refuted(1.0), None], &config).joint, DRAWER);
        let turned = rechosen(&joint, &[refuted(1.0), None], &config);
        assert_eq!((turned.joint, &turned.moved, turned.observed_range), (DOOR, &vec![1.1], 1.1));
        assert_eq!(turned.hypotheses[1].refuted.as_deref(), Some("so"));
    }

    #[test]
    fn a_drawer_that_runs_into_the_cabinet_at_the_corner_loses_to_a_door_that_does_not() {
        let scene = scene(vec![doubtful(), neighbour()]);
        let joints = weighed(&scene, &Vector::z(), &Config::default());
        let why = joints[0].hypotheses.iter().find_map(|h| h.refuted.clone()).unwrap_or_default();
        assert_eq!(joints[0].joint, DOOR, "{why}");
        assert!(why.contains("runs into joint_1_"), "{why}");
        assert!(joints[0].hypotheses[0].refuted.is_none() && joints[0].type_probability > Some(0.5));
        assert_eq!(text(&joints[1..]), text(&scene.joints[1..]));
    }

    #[test]
    fn switched_off_and_without_doubt_nothing_changes() {
        let mut config = Config::default();
        let mut scene = scene(vec![doubtful(), neighbour()]);
        config.validation.feedback = false;
        assert_eq!(text(&weighed(&scene, &Vector::z(), &config)), text(&scene.joints));
        // The drawer runs into the cabinet as before, but it is all that it could be.
        config.validation.feedback = true;
        scene.joints[0].hypotheses.truncate(1);
        assert_eq!(text(&weighed(&scene, &Vector::z(), &config)), text(&scene.joints));
    }

    /// A wall 33 cm before the front, 2 m wide and tall.
    #[test]
    fn a_wall_that_the_twin_would_give_up_for_the_part_stands_against_its_hypotheses() {
        let extent = |i: i32| [0.05 * f64::from(i), 0.05 * f64::from(i + 1)];
        let wall = [-0.335, -0.325];
        let cells = (-20..20)
            .flat_map(|x| (0..40).map(move |z| [x, -7, z]))
            .map(|index: [i32; 3]| RoomCell { index, views: 9, extent: [extent(index[0]), wall, extent(index[2])] })
            .collect();
        let mut scene = scene(vec![doubtful()]);
        scene.surroundings =
            Some(RoomCells { axes: [Vector::x(), Vector::y(), Vector::z()], edge_m: 0.05, cells, free: vec![] });
        let config = Config::default();
        let is_wall = |s: &Solid| s.name.starts_with("room_wall");
        assert!(!fitting::fit(&scene, &Vector::z(), &config.fitting, &config.priors).room.iter().any(is_wall));
        let walls = walls(&scene, &Vector::z(), &config);
        assert!(walls.len() == 1 && walls.iter().all(is_wall), "{walls:?}");
        let joints = weighed(&scene, &Vector::z(), &config);
        for h in &joints[0].hypotheses {
            assert!(h.refuted.as_ref().is_some_and(|why| why.contains("room_wall")), "{h:?}");
        }
        assert_eq!(joints[0].joint, DRAWER);
    }

    /// A door 0.5 m wide, hinged at x = 0, opened by `range`, with a board across its way.
    fn blocked(seen: bool, joint: Articulation) -> (Twin, Trajectory) {
        let boxed = |center: [f64; 3], half: [f64; 3]| OrientedBox {
            center: Point::from(center),
            half: Vector::from(half),
            rotation: Matrix3::identity(),
        };
        let solid =
            |name: &str, role: Role, seen: bool, shape: OrientedBox| Solid { name: name.to_owned(), role, shape, seen };
        let leaf = boxed([0.25, 0.009, 0.35], [0.248, 0.009, 0.348]);
        let board = solid("board", Role::Carcass, seen, boxed([0.25, -0.35, 0.35], [0.5, 0.02, 0.5]));
        let handle = Point::new(0.45, -0.03, 0.4);
        let door = Furniture {
            name: "base".to_owned(),
            carcass: vec![board],
            part: Part {
                id: "door".to_owned(),
                label: "door".to_owned(),
                joint: Joint {
                    articulation: joint,
                    upper: 0.5,
                    observed: 1.2,
                    expected: 1.9,
                    damping: 0.5,
                    friction: 0.2,
                    resistance_seen: false,
                    balanced: false,
                    probability: None,
                },
                solids: vec![solid("front", Role::Front, true, leaf)],
                handle,
                bounds: leaf,
            },
        };
        let twin = Twin {
            name: "t".to_owned(),
            density_kg_per_m3: 700.0,
            drives: crate::config::Drives::default(),
            furniture: vec![door],
            room: vec![],
            left_out: vec![],
        };
        let hinge = Articulation { origin: Point::new(0.0, 0.0, 0.35), ..DOOR };
        (twin, hand(&hinge, &handle, 1.2))
    }

    #[test]
    fn what_was_assumed_counts_for_half_and_ways_that_no_joint_has_count() {
        let config = Config::default().validation;
        let hinge = Articulation { origin: Point::new(0.0, 0.0, 0.35), ..DOOR };
        let found = |(twin, hand): (Twin, Trajectory)| {
            refutation(twin, 0, doubtful().face.as_ref(), &[&hand], &Vector::z(), &config)
        };
        let seen = found(blocked(true, hinge)).unwrap();
        assert_eq!((seen.weight, seen.reason.as_str()), (FULL, "its front runs into board"));
        assert_eq!(found(blocked(false, hinge)).unwrap().weight, HALF);
        let (mut free, hand) = blocked(true, hinge);
        free.furniture[0].carcass[0].shape.center.y = 0.5;
        assert_eq!(found((free.clone(), hand.clone())), None);
        free.furniture[0].part.joint.observed = 4.0;
        free.furniture[0].part.joint.expected = 3.1;
        assert_eq!(found((free, hand)).unwrap().weight, FULL);
        // The face looks towards -y.
        let inward = found(blocked(true, hinge.reversed())).unwrap();
        assert_eq!((inward.weight, inward.reason.as_str()), (FULL, "it opens into its own furniture"));
    }

    #[test]
    fn a_hand_that_pushes_a_part_shut_counts_for_half() {
        let (mut twin, _) = blocked(true, DRAWER);
        twin.furniture[0].carcass[0].shape.center.y = 0.5;
        let pushed = hand(&DRAWER.reversed(), &Point::new(0.45, -0.03, 0.4), 0.4);
        let found = refutation(twin, 0, None, &[&pushed], &Vector::z(), &Config::default().validation).unwrap();
        assert_eq!((found.weight, found.reason.as_str()), (HALF, "the hand pushes it shut"));
    }
}
