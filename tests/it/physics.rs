//! Replays against closed forms, and verdicts on joints that are right, wrong, or cannot be told apart.

use nalgebra::Matrix3;
use paws_twin::articulation::{Action, Articulation, JointKind};
use paws_twin::config::Config;
use paws_twin::hands::{Sample, Trajectory};
use paws_twin::math::{Point, Vector};
use paws_twin::report::drawings;
use paws_twin::twin::{ContactRule, ContactRules, Furniture, Joint, OrientedBox, Part, Role, Solid, Twin};
use paws_twin::validation::{Drive, JointCheck, Surroundings, Verdict, simulate, validate};
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;

/// A door 0.5 m wide and 0.7 m tall, hinged at x = 0 on an upright axis, its front towards -y, held at its free edge.
fn door() -> Furniture {
    let leaf = OrientedBox {
        center: Point::new(0.25, 0.009, 0.35),
        half: Vector::new(0.248, 0.009, 0.348),
        // Right, up, out of the face.
        rotation: Matrix3::from_columns(&[Vector::x(), Vector::z(), -Vector::y()]),
    };
    let leaf = OrientedBox { half: Vector::new(0.248, 0.348, 0.009), ..leaf };
    let board = OrientedBox { center: Point::new(0.25, 0.4, 0.35), ..leaf };
    Furniture {
        name: "base".to_owned(),
        carcass: vec![solid("back", Role::Carcass, board)],
        part: Part {
            id: "door".to_owned(),
            label: "door".to_owned(),
            joint: Joint {
                articulation: Articulation {
                    kind: JointKind::Revolute,
                    axis: -Vector::z(),
                    origin: Point::new(0.0, 0.0, 0.35),
                },
                upper: 1.6,
                observed: 1.2,
                damping: 0.5,
                friction: 0.2,
                expected: 1.9,
                resistance_seen: false,
                balanced: false,
                probability: None,
            },
            solids: vec![solid("front", Role::Front, leaf)],
            handle: Point::new(0.45, -0.03, 0.4),
            bounds: leaf,
        },
    }
}

fn solid(name: &str, role: Role, shape: OrientedBox) -> Solid {
    Solid { name: name.to_owned(), role, shape, seen: true }
}

/// An upright box, sides along the axes.
fn upright(center: Point, half: Vector) -> OrientedBox {
    OrientedBox { center, half, rotation: Matrix3::identity() }
}

/// The door on another joint.
fn on(articulation: Articulation) -> Furniture {
    let mut furniture = door();
    furniture.part.joint.articulation = articulation;
    furniture
}

/// A grip that goes where a hand went, when it did.
fn drive(hand: &Trajectory, grip: Point, back: bool) -> Drive {
    Drive { times_secs: hand.samples.iter().map(|s| s.time_secs).collect(), path: hand.positions(), grip, back }
}

/// A hand that opens `joint` by `range` in two seconds, holding the door's handle.
fn hand(joint: &Articulation, range: f64) -> Trajectory {
    let handle = door().part.handle;
    let samples = (0..=40)
        .map(|i| {
            let s = f64::from(i) / 40.0;
            let opening = range * s.powi(3) * (10.0 - 15.0 * s + 6.0 * s * s);
            let p = joint.motion(opening) * handle;
            Sample { frame: i as usize, time_secs: 2.0 * s, observed: p, smoothed: p, accepted: true }
        })
        .collect();
    Trajectory { side: None, samples, action: Action::Open, ends_seen: [true; 2] }
}

/// The same hand as it is measured: errors of `std_m` a coordinate that last 0.3 s.
fn shaken(steady: &Trajectory, std_m: f64, seed: u64) -> Trajectory {
    let mut rng = Pcg64Mcg::seed_from_u64(seed);
    let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
    let mut error = Vector::from_fn(|_, _| normal());
    let mut last = 0.0;
    let mut hand = steady.clone();
    for sample in &mut hand.samples {
        let keep = (-(sample.time_secs - last) / 0.3).exp();
        last = sample.time_secs;
        error = error * keep + Vector::from_fn(|_, _| normal()) * (1.0 - keep * keep).sqrt();
        sample.observed += error * std_m;
        sample.smoothed = sample.observed;
    }
    hand
}

fn twin(furniture: Vec<Furniture>, room: Vec<Solid>) -> Twin {
    Twin {
        name: "t".to_owned(),
        density_kg_per_m3: 700.0,
        drives: paws_twin::config::Drives::default(),
        furniture,
        room,
        left_out: vec![],
    }
}

/// The first joint's check under clips that are its own.
fn check(twin: &Twin, clips: &[Trajectory]) -> JointCheck {
    let clips: Vec<(String, &Trajectory)> = clips.iter().enumerate().map(|(i, t)| (format!("clip_{i}"), t)).collect();
    let mut validation = validate(twin, &[clips], &Vector::z(), &Config::default().validation).unwrap();
    validation.joints.remove(0)
}

fn verdict(furniture: Furniture, trajectory: &Trajectory) -> (Verdict, String) {
    let check = check(&twin(vec![furniture], vec![]), std::slice::from_ref(trajectory));
    (check.verdict, check.reason)
}

/// Joints that the door does not have: mirrored, inward, of the other type, and 25 cm off to every side.
fn wrong_joints() -> [(&'static str, Articulation); 8] {
    let truth = door().part.joint.articulation;
    let at = |x: f64, y: f64| Articulation { origin: Point::new(x, y, 0.35), ..truth };
    [
        ("other side", Articulation { axis: Vector::z(), origin: Point::new(0.5, 0.0, 0.35), ..truth }),
        ("inward", truth.reversed()),
        ("slide", Articulation { kind: JointKind::Prismatic, axis: -Vector::y(), ..truth }),
        ("lower edge", Articulation { axis: Vector::x(), origin: Point::new(0.25, 0.0, 0.0), ..truth }),
        ("nearer to the hand", at(0.25, 0.0)),
        ("farther from it", at(-0.25, 0.0)),
        ("in front", at(0.0, -0.25)),
        ("behind", at(0.0, 0.25)),
    ]
}

#[test]
fn a_joint_that_depth_or_words_doubt_does_not_pass_on_the_word_of_a_hand() {
    let judged = |probability: Option<f64>| {
        let mut furniture = door();
        let truth = furniture.part.joint.articulation;
        furniture.part.joint.probability = probability;
        verdict(furniture, &hand(&truth, 1.2))
    };
    // Twenty to one is what a rival must be less likely by, too.
    assert_eq!([None, Some(0.96)].map(|p| judged(p).0), [Verdict::Pass; 2]);
    let (doubted, why) = judged(Some(0.7));
    assert!(doubted == Verdict::Undetermined && why.contains("30 %"), "{why}");
}

#[test]
fn the_right_hinge_passes_and_wrong_ones_fail() {
    let truth = door().part.joint.articulation;
    let hand = hand(&truth, 1.2);
    let right = check(&twin(vec![door()], vec![]), std::slice::from_ref(&hand));
    assert_eq!(right.verdict, Verdict::Pass, "{}", right.reason);
    assert!(right.rms_m < 0.02 && right.reached_share > 0.9 && right.margin_nats.unwrap() > 3.0, "{}", right.reason);
    let replay = &right.clips[0].replay;
    assert!(replay.drift_m < 1e-4 && replay.return_error.abs() < 0.1, "{} {}", replay.drift_m, replay.return_error);
    assert!(replay.kinetic_max_j < 1.01 * replay.work_max_j, "{} {}", replay.kinetic_max_j, replay.work_max_j);
    for (name, wrong) in wrong_joints() {
        let (verdict, reason) = verdict(on(wrong), &hand);
        assert_eq!(verdict, Verdict::Fail, "{name}: {reason}");
        assert_eq!(reason.contains("other way"), name == "inward", "{name}: {reason}");
    }
}

/// The grades that count: no right joint may fail, no wrong one may pass, however the hand shakes and whatever moves.
#[test]
fn right_joints_never_fail_and_wrong_ones_never_pass_under_a_hand_that_is_off_by_centimetres() {
    let hinge = door().part.joint.articulation;
    let slide = Articulation { kind: JointKind::Prismatic, axis: -Vector::y(), ..hinge };
    let mut passed = 0;
    for seed in 0..4 {
        for std_m in [0.01, 0.03, 0.05] {
            let hand =
                |joint: &Articulation, range: f64| [0, 1].map(|k| shaken(&hand(joint, range), std_m, 2 * seed + k));
            let judged =
                |articulation: Articulation, clips: &[Trajectory]| check(&twin(vec![on(articulation)], vec![]), clips);
            let (turned, pulled) = (hand(&hinge, 1.2), hand(&slide, 0.3));
            for (truth, clips) in [(hinge, &turned), (slide, &pulled)] {
                let check = judged(truth, clips);
                assert_ne!(check.verdict, Verdict::Fail, "{std_m} {seed}: {}", check.reason);
                passed += u32::from(check.verdict == Verdict::Pass && std_m < 0.02);
            }
            let wrong = wrong_joints().map(|(name, joint)| (name, joint, &turned));
            let others = [("hinge", hinge, &pulled), ("into the wall", slide.reversed(), &pulled)];
            for (name, joint, clips) in wrong.into_iter().chain(others) {
                let check = judged(joint, clips);
                assert_ne!(check.verdict, Verdict::Pass, "{std_m} {seed} {name}: {}", check.reason);
            }
        }
    }
    // A verdict that never passes anything would hold all of the above.
    assert!(passed >= 6, "{passed} of 8");
}

#[test]
fn a_short_motion_decides_nothing() {
    let hand = hand(&door().part.joint.articulation, 10f64.to_radians());
    let check = check(&twin(vec![door()], vec![]), std::slice::from_ref(&hand));
    assert_eq!(check.verdict, Verdict::Undetermined, "{}", check.reason);
    assert!(check.reason.contains("over 10°") && check.reason.contains("look"), "{}", check.reason);
    assert_eq!(check.resolves.unwrap().shift_m, None);
}

#[test]
fn a_limit_below_the_recorded_range_is_seen() {
    let mut furniture = door();
    furniture.part.joint.upper = 0.5;
    let (verdict, reason) = verdict(furniture, &hand(&door().part.joint.articulation, 1.2));
    assert_eq!(verdict, Verdict::Fail, "{reason}");
    assert!(reason.contains("limit of 29°"), "{reason}");
}

#[test]
fn a_door_that_runs_into_something_fails_and_the_thing_is_named() {
    let hand = hand(&door().part.joint.articulation, 1.2);
    let island = solid("island", Role::Room, upright(Point::new(0.25, -0.35, 0.35), Vector::new(0.5, 0.02, 0.5)));
    let check = check(&twin(vec![door()], vec![island]), std::slice::from_ref(&hand));
    assert_eq!(check.verdict, Verdict::Fail, "{}", check.reason);
    assert!(check.reason.contains("runs into island"), "{}", check.reason);
    let (depth_m, with) = check.clips[0].replay.worst_penetration().unwrap();
    assert!(with == "island" && depth_m < 0.02, "{depth_m} {with}");
}

/// A neighbour on a joint of its own gives way where a board would not.
#[test]
fn a_door_pushes_a_neighbour_open() {
    let truth = door().part.joint.articulation;
    let hand = hand(&truth, 1.2);
    let leaf = upright(Point::new(0.5, -0.36, 0.35), Vector::new(0.4, 0.005, 0.3));
    let mut neighbour = door();
    neighbour.name = "neighbour".to_owned();
    neighbour.carcass.clear();
    let part = &mut neighbour.part;
    (part.id, part.bounds, part.solids) = ("flap".to_owned(), leaf, vec![solid("flap_front", Role::Front, leaf)]);
    // Hinged at its far end, it turns away from the door.
    part.joint.articulation = Articulation { axis: Vector::z(), origin: Point::new(0.9, -0.36, 0.35), ..truth };
    let gives_way = check(&twin(vec![door(), neighbour.clone()], vec![]), std::slice::from_ref(&hand));
    assert_eq!(gives_way.verdict, Verdict::Pass, "{}", gives_way.reason);
    assert_eq!(gives_way.clips[0].replay.contacts[0].with, "flap_front");
    let stands = check(&twin(vec![door()], neighbour.part.solids), std::slice::from_ref(&hand));
    assert_eq!(stands.verdict, Verdict::Fail, "{}", stands.reason);
}

#[test]
fn boards_that_overlap_a_closed_part_are_told_and_do_not_hold_it() {
    let mut furniture = door();
    let side = upright(Point::new(0.0, 0.2, 0.35), Vector::new(0.009, 0.2, 0.35));
    furniture.carcass.push(solid("side", Role::Carcass, side));
    let hand = hand(&door().part.joint.articulation, 1.2);
    let check = check(&twin(vec![furniture], vec![]), std::slice::from_ref(&hand));
    assert_eq!(check.verdict, Verdict::Pass, "{}", check.reason);
    assert_eq!(check.clips[0].replay.closed_overlaps, [["front".to_owned(), "side".to_owned()]]);
}

#[test]
fn clips_of_one_joint_decide_together() {
    let truth = door().part.joint.articulation;
    let clips = [0.85, 0.9, 0.8].map(|range| hand(&truth, range));
    let one = check(&twin(vec![door()], vec![]), &clips[..1]);
    let all = check(&twin(vec![door()], vec![]), &clips);
    assert_eq!((one.verdict, all.verdict), (Verdict::Undetermined, Verdict::Pass), "{}; {}", one.reason, all.reason);
    assert!(one.clips[0].held_out_rms_m.is_none());
    assert!(all.clips.iter().all(|c| c.held_out_rms_m.unwrap() < 0.01), "{:?}", all.clips[0].held_out_rms_m);
}

#[test]
fn a_kitchen_a_kilometre_away_gets_the_same_verdict() {
    let truth = door().part.joint.articulation;
    let away = Vector::new(1000.0, -700.0, 40.0);
    for range in [0.15, 1.2] {
        let near = hand(&truth, range);
        let mut far = near.clone();
        for sample in &mut far.samples {
            sample.observed += away;
            sample.smoothed += away;
        }
        let mut furniture = door();
        let part = &mut furniture.part;
        part.joint.articulation.origin += away;
        part.handle += away;
        part.bounds.center += away;
        for solid in part.solids.iter_mut().chain(&mut furniture.carcass) {
            solid.shape.center += away;
        }
        let here = check(&twin(vec![door()], vec![]), std::slice::from_ref(&near));
        let there = check(&twin(vec![furniture], vec![]), std::slice::from_ref(&far));
        assert_eq!(here.verdict, there.verdict, "{}; {}", here.reason, there.reason);
        assert!((here.rms_m - there.rms_m).abs() < 1e-4, "{} {}", here.rms_m, there.rms_m);
    }
}

#[test]
fn one_thread_and_two_give_the_same_bytes_and_a_picture_that_parses() {
    let truth = door().part.joint.articulation;
    let hands: Vec<Trajectory> = (0..4).map(|seed| shaken(&hand(&truth, 1.2), 0.01, seed)).collect();
    let kitchen = twin(vec![door(); 4], vec![]);
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let clips: Vec<_> = hands.iter().map(|t| vec![("<clip & co>".to_owned(), t)]).collect();
        pool.install(|| validate(&kitchen, &clips, &Vector::z(), &Config::default().validation)).unwrap()
    };
    let (one, two) = (run(1), run(2));
    let text = paws_twin::json::text(&one).unwrap();
    assert_eq!(text, paws_twin::json::text(&two).unwrap());
    assert_eq!(serde_json::from_str::<paws_twin::validation::Validation>(&text).unwrap(), one);
    let svg = drawings::proof(&kitchen.furniture[0], &one.joints[0]);
    assert!(svg.contains("recorded hand") && !svg.contains("NaN") && !svg.contains("inf"), "{svg}");
    let mut reader = quick_xml::Reader::from_str(&svg);
    while reader.read_event().unwrap() != quick_xml::events::Event::Eof {}
}

/// With a hand that hardly moves the joint's own damping, friction and inertia set the pace: constant force `F` at radius
/// `r` on a hinge of inertia `J`, damping `d` and friction `f` gives
/// `q(t) = (F r - f)/d (t - J/d (1 - exp(-d t / J)))`.
#[test]
fn a_constant_pull_follows_the_closed_form() {
    let furniture = door();
    let part = &furniture.part;
    let mut config = Config::default().validation;
    // A target far ahead with the force capped is a constant force towards it.
    config.hand_force_max_n = 3.0;
    config.hand_stiffness_n_per_m = 800.0;
    let far = Point::new(part.handle.x, -1000.0, part.handle.z);
    let seconds = 0.5;
    let times_secs = vec![0.0, 1e-9, seconds];
    let drive = Drive { times_secs, path: vec![part.handle, far, far], grip: part.handle, back: false };
    let up = Vector::z();
    let around = Surroundings::none(&up, 700.0);
    let joint = part.joint.articulation;
    let replay = simulate(part, &joint, 3.0, &around, &drive, &config).unwrap();
    let start = replay.start;
    let m = paws_twin::twin::mass_properties(&part.solids, 700.0).unwrap();
    let arm = m.center - joint.origin;
    let inertia = m.inertia[(2, 2)] + m.mass * (arm.x * arm.x + arm.y * arm.y);
    // The force keeps its direction while the door turns: its lever is r cos(q) to first order; small angles only.
    let (d, f, r) = (part.joint.damping, part.joint.friction, part.handle.x);
    let t: f64 = 0.25;
    let torque = 3.0 * r - f;
    let expected = torque / d * (t - inertia / d * (1.0 - (-d * t / inertia).exp()));
    let at = replay.trace.iter().min_by(|a, b| (a[0] - t).abs().total_cmp(&(b[0] - t).abs())).unwrap();
    let t = at[0] + config.step_secs;
    let expected_there = torque / d * (t - inertia / d * (1.0 - (-d * t / inertia).exp()));
    assert!(expected > 0.03, "the test would prove nothing: {expected}");
    let opened = at[1] - start;
    assert!((opened / expected_there - 1.0).abs() < 0.05, "{opened} against {expected_there}");
}

/// The same pull with a wall in the way ends at the wall.
#[test]
fn furniture_in_the_way_stops_the_part() {
    let furniture = door();
    let part = &furniture.part;
    let joint = part.joint.articulation;
    let hand = hand(&joint, 1.2);
    let drive = drive(&hand, part.handle, true);
    let wall = solid("wall", Role::Room, upright(Point::new(0.25, -0.35, 0.35), Vector::new(0.5, 0.02, 0.5)));
    let config = Config::default().validation;
    let up = Vector::z();
    let replay = |fixed: Vec<&Solid>| {
        let around = Surroundings { fixed, ..Surroundings::none(&up, 700.0) };
        simulate(part, &joint, 1.6, &around, &drive, &config).unwrap()
    };
    assert!(replay(vec![]).reached[1] > 1.1);
    // The free edge meets the wall where 0.5 m sin(q) = 0.33 m.
    let blocked = replay(vec![&wall]).reached[1];
    assert!((0.6..0.8).contains(&blocked), "{blocked}");
}

#[test]
fn a_motion_that_begins_inside_something_begins_before_it() {
    let furniture = door();
    let part = &furniture.part;
    let joint = part.joint.articulation;
    let mut hand = hand(&joint, 1.2);
    hand.samples.reverse();
    let times_secs = (0..hand.samples.len()).map(|i| 0.05 * i as f64).collect();
    let drive = Drive { times_secs, ..drive(&hand, part.handle, true) };
    // Where the leaf stands when it is open.
    let there = joint.motion(1.2) * part.bounds.center;
    let block = solid("block", Role::Room, upright(there, Vector::new(0.1, 0.1, 0.5)));
    let up = Vector::z();
    let around = Surroundings { fixed: vec![&block], ..Surroundings::none(&up, 700.0) };
    let replay = simulate(part, &joint, 1.6, &around, &drive, &Config::default().validation).unwrap();
    assert!(replay.start > 0.1 && replay.start < 1.1, "{}", replay.start);
    assert!(replay.reached[1] < 1.2 && replay.max_m < 1.0, "{:?}", replay.reached);
    assert!(replay.worst_penetration().is_none_or(|(depth, _)| depth < 0.01));
}

#[test]
fn a_part_of_grams_follows_the_hand_and_is_not_thrown() {
    let furniture = door();
    let part = &furniture.part;
    let joint = part.joint.articulation;
    let hand = hand(&joint, 1.2);
    let drive = drive(&hand, part.handle, true);
    let up = Vector::z();
    // 620, 62, 6 and 0.6 g.
    for density in [100.0, 10.0, 1.0, 0.1] {
        let around = Surroundings::none(&up, density);
        let replay = simulate(part, &joint, 1.6, &around, &drive, &Config::default().validation).unwrap();
        assert_eq!(replay.untrusted, None, "{density}");
        assert!(replay.rms_m < 0.03, "{density}: {}", replay.rms_m);
    }
}

#[test]
fn a_tenth_of_a_millimetre_is_no_obstacle_and_a_millimetre_is_one() {
    let furniture = door();
    let part = &furniture.part;
    let joint = part.joint.articulation;
    let hand = hand(&joint, 1.2);
    let drive = drive(&hand, part.handle, false);
    let up = Vector::z();
    // The leaf's outer edge passes 0.498 m from the hinge: a post beyond it, away from the closed leaf, reaches into its way.
    for (depth, stopped) in [(5e-5, false), (4e-3, true)] {
        let direction = joint.motion(0.6) * Point::new(1.0, 0.0, 0.35) - joint.motion(0.6) * Point::new(0.0, 0.0, 0.35);
        let edge = joint.motion(0.6) * Point::new(0.0, 0.0, 0.35) + direction * (0.498f64.hypot(0.018) - depth + 0.02);
        let along = Matrix3::from_columns(&[direction, Vector::z().cross(&direction), Vector::z()]);
        let post = OrientedBox { center: edge, half: Vector::new(0.02, 0.002, 0.2), rotation: along };
        let post = solid("post", Role::Room, post);
        let around = Surroundings { fixed: vec![&post], ..Surroundings::none(&up, 700.0) };
        let replay = simulate(part, &joint, 1.6, &around, &drive, &Config::default().validation).unwrap();
        assert_eq!(replay.reached[1] < 0.8, stopped, "{depth}: {:?}", replay.reached);
    }
}

#[test]
fn what_a_model_excludes_does_not_stand_in_the_way() {
    let furniture = door();
    let part = &furniture.part;
    let joint = part.joint.articulation;
    let hand = hand(&joint, 1.2);
    let drive = drive(&hand, part.handle, false);
    let wall = solid("wall", Role::Room, upright(Point::new(0.25, -0.35, 0.35), Vector::new(0.5, 0.02, 0.5)));
    let rule = |link: usize, masks: [u32; 2]| ContactRule { link, body: link, masks };
    let up = Vector::z();
    for (masks, excluded, free) in
        [([1, 1], false, false), ([1, 1], true, true), ([2, 2], false, true), ([0, 1], false, false)]
    {
        let mut rules = ContactRules::default();
        rules.solids.insert("front".to_owned(), rule(1, [1, 1]));
        rules.solids.insert("wall".to_owned(), rule(0, masks));
        if excluded {
            rules.excluded.insert([0, 1]);
        }
        let around = Surroundings { fixed: vec![&wall], rules: Some(&rules), ..Surroundings::none(&up, 700.0) };
        let replay = simulate(part, &joint, 1.6, &around, &drive, &Config::default().validation).unwrap();
        assert_eq!(replay.reached[1] > 1.1, free, "{masks:?} {excluded}: {:?}", replay.reached);
    }
}
