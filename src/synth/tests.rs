use std::collections::BTreeSet;

use clap::ValueEnum;

use super::*;
use crate::articulation::{Action, Articulation, JointKind};
use crate::math::Point;
use crate::twin::OrientedBox;

const BENCHMARK: [Tier; 7] = [Tier::T0, Tier::T1, Tier::T2, Tier::Hd, Tier::T3, Tier::Short, Tier::Nonm];

fn recorded(seed: u64, tier: Tier, parts: usize, changes: &Changes) -> Recorded {
    Recorded::varied(&SynthOptions { seed, tier, width: 64, parts }, changes).unwrap()
}

fn plain(seed: u64, tier: Tier) -> Recorded {
    recorded(seed, tier, 6, &Changes::default())
}

#[cfg(feature = "cli")]
#[test]
fn tiers_have_one_name() {
    use clap::ValueEnum;
    assert_eq!(Tier::value_variants(), Tier::ALL);
    for tier in Tier::ALL {
        assert_eq!(tier.to_possible_value().unwrap().get_name(), tier.name());
    }
}

#[test]
fn the_same_seed_gives_the_same_bytes_and_another_seed_others() {
    for tier in BENCHMARK {
        let [a, b, other] = [41, 41, 42].map(|seed| plain(seed, tier));
        assert_eq!(a.tables().unwrap(), b.tables().unwrap());
        assert_ne!(a.tables().unwrap(), other.tables().unwrap());
        for frame in [0, 40, a.frames() - 1] {
            assert_eq!(a.images(frame).unwrap(), b.images(frame).unwrap());
        }
    }
}

/// Recordings of these tiers are what earlier measurements were made on: their draws stay in their order.
#[test]
fn the_other_kitchens_stay_as_they_are() {
    for (tier, frames, hands, eye, wrist) in [
        (
            Tier::Clean,
            249,
            219,
            [-1.095738133104573, -3.539430672677363, 1.2542663298351522],
            [-1.0333137130316268, -3.3766696049446483, 0.8577592000585434],
        ),
        (
            Tier::Realistic,
            249,
            185,
            [-1.09586864130664, -3.5379575783677653, 1.2482309368243838],
            [-1.0416253654480352, -3.3762380424648426, 0.8722174702212279],
        ),
        (
            Tier::Hard,
            252,
            156,
            [-1.0618110913696521, -3.5006196545359947, 1.2513616137517867],
            [-0.9891836276524365, -3.2965788813079753, 0.8016514107600368],
        ),
    ] {
        let r = recorded(5, tier, 3, &Changes::default());
        assert_eq!((r.frames(), r.seen.hands.len(), r.take.clips.len()), (frames, hands, 7));
        let (pose, hand) = (r.seen.poses.last().unwrap(), r.seen.hands.last().unwrap());
        assert!((pose.translation.vector - Vector::from(eye)).norm() < 1e-9, "{tier:?} {:?}", pose.translation.vector);
        assert!((hand.wrist - Point::from(wrist)).norm() < 1e-9, "{tier:?} {:?}", hand.wrist);
    }
}

#[test]
fn tiers_share_kitchens_and_motions_and_changes_leave_the_rest_alone() {
    let (easy, hard) = (plain(7, Tier::T1), plain(7, Tier::T3));
    let used = |r: &Recorded| r.take.clips.iter().map(|c| (c.part.clone(), c.true_span)).collect::<Vec<_>>();
    assert_eq!(used(&easy), used(&hard));
    let close = |a: &OrientedBox, b: &OrientedBox| (a.center - b.center).norm() < 1e-9;
    assert!(easy.kitchen.parts.iter().zip(&hard.kitchen.parts).all(|(a, b)| close(&a.bounds, &b.bounds)));

    let changes = Changes { word_error: Some(1.0), mask_error: Some(1.0), few_hands: Some(2), ..Changes::default() };
    let changed = recorded(7, Tier::T1, 6, &changes);
    assert_eq!(easy.seen.poses, changed.seen.poses);
    let kept = |h: &noise::SeenHand| easy.seen.hands.iter().any(|e| e.frame == h.frame && e.grasp == h.grasp);
    assert!(!changed.seen.hands.is_empty() && changed.seen.hands.iter().all(kept));
    assert!(changed.seen.masks.iter().any(|m| m.swallowed.is_some()));
    for clip in changed.take.clips.iter().filter(|c| c.part.is_some()) {
        let part = changed.kitchen.parts.iter().find(|p| Some(&p.id) == clip.part.as_ref()).unwrap();
        let wrong = if part.articulation.kind == JointKind::Revolute { "drawer" } else { "cupboard" };
        assert_eq!(clip.noun, wrong);
    }
    let blind = recorded(7, Tier::T1, 1, &Changes { no_masks: true, ..Changes::default() });
    assert!(blind.images(0).unwrap().iter().all(|(name, _)| !name.starts_with("masks")));
    assert!(blind.tables().unwrap().iter().all(|(name, _)| name != "labels.json"));
}

#[test]
fn no_two_frames_have_one_time() {
    for tier in Tier::ALL {
        for seed in [5, 6] {
            let options = SynthOptions { seed, tier, width: 64, parts: 3 };
            let r = Recorded::new(&options).unwrap();
            let times: Vec<f64> = r.take.frames.iter().map(|f| f.time_secs).collect();
            assert!(times.windows(2).all(|w| w[1] > w[0]), "{tier:?} {seed}");
        }
    }
}

#[test]
fn impossible_changes_are_refused() {
    let options = SynthOptions { tier: Tier::Hard, ..SynthOptions::default() };
    for (changes, word) in [
        (Changes { clips_per_part: Some(5), ..Changes::default() }, "hard"),
        (Changes { word_error: Some(1.5), ..Changes::default() }, "word error"),
        (Changes { hand_noise_m: Some(f64::NAN), ..Changes::default() }, "hand noise"),
        (Changes { few_hands: Some(0), ..Changes::default() }, "0 hands"),
    ] {
        let error = Recorded::varied(&options, &changes).unwrap_err().to_string();
        assert!(error.contains(word), "{error}");
    }
}

#[test]
fn the_hand_is_where_the_truth_puts_the_handle() {
    for (tier, reach) in [(Tier::T0, 0.02), (Tier::Nonm, 0.2)] {
        let r = plain(3, tier);
        let truth = r.truth();
        let read = |v: &serde_json::Value| -> [f64; 3] { serde_json::from_value(v.clone()).unwrap() };
        for clip in truth["clips"].as_array().unwrap() {
            let joint = truth["joints"].as_array().unwrap().iter().find(|j| j["id"] == clip["joint"]).unwrap();
            let phi = Articulation {
                kind: serde_json::from_value(joint["type"].clone()).unwrap(),
                axis: Vector::from(read(&joint["axis"])),
                origin: Point::from(read(&joint["origin"])),
            };
            let handle = Point::from(read(&joint["handle_closed"]));
            let start = clip["true_start_frame"].as_u64().unwrap() as usize;
            let mut held = 0;
            for (i, x) in clip["x"].as_array().unwrap().iter().enumerate() {
                let frame = &r.take.frames[start + i];
                if frame.contact {
                    let expected = phi.motion(x.as_f64().unwrap()) * handle;
                    assert!((frame.grasp.unwrap().0 - expected).norm() < reach, "{tier:?}, {clip}");
                    held += 1;
                }
            }
            assert!(held > 5);
            let upper = joint["range"][1].as_f64().unwrap();
            assert!(clip["x"].as_array().unwrap().iter().all(|x| (0.0..=upper + 1e-9).contains(&x.as_f64().unwrap())));
        }
        assert_eq!(truth["tier"], tier.name());
        let up = Vector::from(read(&truth["up"]));
        assert!((up.norm() - 1.0).abs() < 1e-9 && up.z > 0.999);
    }
}

/// Points inside a box, its surface left out.
fn inside(shape: &OrientedBox) -> Vec<Point> {
    const STEPS: i32 = 4;
    let half = shape.half.map(|h| (h - 0.0015).max(0.0));
    let at = |i: i32| f64::from(2 * i) / f64::from(STEPS) - 1.0;
    let mut points = Vec::new();
    for (i, j, k) in (0..=STEPS).flat_map(|i| (0..=STEPS).flat_map(move |j| (0..=STEPS).map(move |k| (i, j, k)))) {
        let local = Vector::new(at(i) * half.x, at(j) * half.y, at(k) * half.z);
        points.push(shape.center + shape.rotation * local);
    }
    points
}

#[test]
fn no_part_passes_through_another_on_its_way() {
    for seed in 0..3 {
        for turned in [None, Some([0.3, 0.5])] {
            let kitchen = fitted::build(&mut RandomUse::Kitchen.rng(seed), turned);
            for (index, part) in kitchen.parts.iter().enumerate() {
                for step in 0..=10 {
                    let motion = part.articulation.motion(part.upper * f64::from(step) / 10.0);
                    for block in &part.blocks {
                        let shape = block.shape.moved(&motion);
                        let radius = shape.half.norm();
                        let others = kitchen.parts.iter().enumerate().filter(|(i, _)| *i != index);
                        let near: Vec<_> = others
                            .flat_map(|(_, other)| other.blocks.iter().map(move |b| (other, b)))
                            .filter(|(_, b)| (b.shape.center - shape.center).norm() < radius + b.shape.half.norm())
                            .collect();
                        if near.is_empty() {
                            continue;
                        }
                        for p in inside(&shape) {
                            for (other, b) in &near {
                                let (a, o) = (part.kind, other.kind);
                                assert!(!b.shape.contains(&p), "seed {seed}: {a} {} in {o} {}", part.id, other.id);
                            }
                        }
                    }
                }
            }
        }
    }
}

#[test]
fn sliding_leaves_pass_each_other_in_their_unit() {
    let kitchen = fitted::build(&mut RandomUse::Kitchen.rng(1), None);
    let leaves: Vec<_> = kitchen.parts.iter().filter(|p| p.kind == "sliding door").collect();
    assert_eq!(leaves.len(), 2);
    for leaf in &leaves {
        let across = leaf.articulation.axis;
        assert!(across.dot(&leaf.out).abs() < 1e-9 && across.z.abs() < 1e-9);
        // Open, the leaf does not stand over the end of its unit.
        let moved = leaf.blocks[0].shape.moved(&leaf.articulation.motion(leaf.upper));
        let end = (leaf.base.center - moved.center).dot(&across).abs() + moved.half.x;
        assert!(end <= leaf.base.half.x + 1e-9, "{end}");
    }
    let air = (leaves[0].blocks[0].shape.center - leaves[1].blocks[0].shape.center).dot(&leaves[0].out).abs();
    assert!((air - kitchen::BOARD - 0.02).abs() < 1e-9, "{air}");
}

#[test]
fn turned_furniture_keeps_off_the_rooms_directions_and_the_room_does_not_turn() {
    for seed in 0..5 {
        let (straight, turned) = (plain(seed, Tier::T2), plain(seed, Tier::Nonm));
        // The floor is the last but the boards on it; all share the room's axes.
        let room = turned.kitchen.fixed.last().unwrap().shape.rotation;
        assert!((straight.kitchen.fixed.last().unwrap().shape.rotation - room).norm() < 1e-9);
        for part in &turned.kitchen.parts {
            let along = (room.transpose() * part.out).normalize();
            let angle = along.y.atan2(along.x).to_degrees().rem_euclid(90.0);
            assert!((11.0..=34.0).contains(&angle.min(90.0 - angle)), "{angle}");
        }
    }
}

#[test]
fn kitchens_and_takes_are_as_varied_as_they_should_be() {
    let takes: Vec<Recorded> = (0..30).map(|seed| plain(seed, Tier::T3)).collect();
    let (mut clips, mut opening, mut sliding, mut misnamed, mut distractors) = (0.0, 0.0, 0.0, 0.0, 0);
    let mut kinds = BTreeSet::new();
    for r in &takes {
        let boxes = r.kitchen.fixed.len() + r.kitchen.parts.iter().map(|p| p.blocks.len()).sum::<usize>();
        assert!(boxes < 450, "{boxes} boxes");
        assert!(r.kitchen.parts.len() >= 20, "{} parts", r.kitchen.parts.len());
        for clip in &r.take.clips {
            let Some(part) = r.kitchen.parts.iter().find(|p| Some(&p.id) == clip.part.as_ref()) else {
                distractors += 1;
                continue;
            };
            kinds.insert(part.kind);
            clips += 1.0;
            opening += f64::from(u8::from(clip.action == Some(Action::Open)));
            sliding += f64::from(u8::from(part.articulation.kind == JointKind::Prismatic));
            misnamed += f64::from(u8::from(clip.noun != part.noun));
        }
    }
    assert_eq!((clips, distractors), (360.0, 30));
    assert!((0.52..0.68).contains(&(opening / clips)), "{opening} of {clips} open");
    assert!((0.2..0.5).contains(&(sliding / clips)), "{sliding} of {clips} slide");
    assert!((0.17..0.33).contains(&(misnamed / clips)), "{misnamed} of {clips} have a wrong or vague noun");
    for kind in ["drawer", "door", "sliding door", "flap", "lid", "oven", "dishwasher", "microwave", "fridge", "pantry"]
    {
        assert!(kinds.contains(kind), "no {kind} is ever opened");
    }
}

#[test]
fn a_part_is_shown_as_often_as_asked_with_others_in_between() {
    let r = recorded(2, Tier::Hd, 2, &Changes { clips_per_part: Some(5), ..Changes::default() });
    let order: Vec<(String, Action)> = r.take.clips.iter().filter_map(|c| Some((c.part.clone()?, c.action?))).collect();
    let names: BTreeSet<&String> = order.iter().map(|(part, _)| part).collect();
    assert_eq!((order.len(), names.len()), (10, 2));
    for name in names {
        assert_eq!(order.iter().filter(|(part, _)| part == name).count(), 5);
    }
    // Nothing is closed that was not just opened.
    for pair in order.windows(2).filter(|pair| pair[1].1 == Action::Close) {
        assert!(pair[0].0 == pair[1].0 && pair[0].1 == Action::Open);
    }
}

#[test]
fn takes_share_the_kitchen_and_its_parts_and_nothing_else() {
    for tier in [Tier::Clean, Tier::T2] {
        let take = |take: u64| recorded(11, tier, 3, &Changes { take, ..Changes::default() });
        let (first, second, third) = (take(0), take(1), take(2));
        assert_eq!(first.tables().unwrap(), recorded(11, tier, 3, &Changes::default()).tables().unwrap());
        let used = |r: &Recorded| r.take.clips.iter().filter_map(|c| c.part.clone()).collect::<BTreeSet<String>>();
        assert_eq!(used(&first), used(&second));
        let bounds = |r: &Recorded| r.kitchen.parts.iter().map(|p| p.bounds.center).collect::<Vec<Point>>();
        assert_eq!(bounds(&first), bounds(&second));
        let kitchen = |r: &Recorded| r.truth()["kitchen"].clone();
        assert_eq!(kitchen(&first), kitchen(&second));
        for (a, b) in [(&first, &second), (&second, &third)] {
            assert_ne!(a.seen.poses.last(), b.seen.poses.last());
        }
    }
}

#[test]
fn a_world_of_its_own_moves_all_of_a_recording_and_the_truth_says_how() {
    let changes = Changes { take: 1, own_world: true, ..Changes::default() };
    let [kitchen, own] = [Changes { own_world: false, ..changes }, changes].map(|c| recorded(11, Tier::T2, 2, &c));
    let motion = own.own_from_kitchen();
    assert!(motion.translation.vector.norm() > 0.1 && motion.rotation.angle() > 0.01);
    assert!(((motion * Vector::z()) - Vector::z()).norm() < 1e-12);
    let (pose, moved) = (kitchen.seen.poses[20], own.seen.poses[20]);
    assert!(((motion * pose).inverse() * moved).translation.vector.norm() < 1e-9);
    let (hand, there) = (kitchen.seen.hands[5].grasp, own.seen.hands[5].grasp);
    assert!((motion * hand - there).norm() < 1e-9);
    let read = |r: &Recorded| {
        Point::from(serde_json::from_value::<[f64; 3]>(r.truth()["joints"][0]["origin"].clone()).unwrap())
    };
    assert!((motion * read(&kitchen) - read(&own)).norm() < 1e-9);
    let said: [f64; 3] = serde_json::from_value(own.truth()["own_from_kitchen"]["position"].clone()).unwrap();
    assert!((Vector::from(said) - motion.translation.vector).norm() < 1e-12);
    // What the cameras see is the same.
    assert_eq!(kitchen.frames(), own.frames());
}

#[test]
fn tiers_of_the_benchmark_are_those_with_a_table_of_sizes() {
    for tier in Tier::value_variants() {
        assert_eq!(tier.is_benchmark(), tiers::sizes(*tier, &Changes::default()).is_some(), "{}", tier.name());
    }
}

#[test]
fn materials_change_pictures_and_nothing_else() {
    for tier in [Tier::Clean, Tier::Realistic, Tier::Hard, Tier::T2] {
        let flat = recorded(4, tier, 3, &Changes::default());
        let dressed = recorded(4, tier, 3, &Changes { materials: true, ..Changes::default() });
        assert_eq!(flat.tables().unwrap(), dressed.tables().unwrap());
        for frame in [0, 30, flat.frames() - 1] {
            let (before, after) = (flat.images(frame).unwrap(), dressed.images(frame).unwrap());
            assert_eq!(before.len(), after.len());
            for ((name, a), (same_name, b)) in before.iter().zip(&after) {
                assert_eq!(name, same_name);
                assert_eq!(a == b, !name.starts_with("frames/"), "{tier:?} {name}");
            }
        }
    }
}

#[test]
fn materials_are_in_recordings_in_memory_too() {
    let changes = [false, true].map(|materials| Changes { materials, ..Changes::default() });
    let [flat, dressed] = changes.map(|c| recorded(4, Tier::Clean, 1, &c).recording().unwrap());
    assert_ne!(flat.rgb(30).unwrap().unwrap().data, dressed.rgb(30).unwrap().unwrap().data);
    assert_eq!(flat.depth(30).unwrap().unwrap().data, dressed.depth(30).unwrap().unwrap().data);
    assert_eq!(flat.mask(30).unwrap().unwrap().data, dressed.mask(30).unwrap().unwrap().data);
}

#[test]
fn every_box_but_those_of_hands_has_a_material() {
    for tier in [Tier::Realistic, Tier::T2] {
        let r = recorded(6, tier, 2, &Changes { materials: true, ..Changes::default() });
        let closed = vec![0.0; r.kitchen.parts.len()];
        assert_eq!(r.coats.len(), r.kitchen.posed(&closed, &[], None).len());
        assert!(recorded(6, tier, 2, &Changes::default()).coats.is_empty());
    }
}

#[test]
fn a_material_is_the_same_in_every_take_and_world() {
    let coats = |take: u64, own_world: bool| {
        recorded(6, Tier::T2, 2, &Changes { materials: true, take, own_world, ..Changes::default() }).coats
    };
    assert_eq!(coats(0, false), coats(1, false));
    assert_eq!(coats(0, false), coats(0, true));
}
