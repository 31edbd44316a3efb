//! Replays against closed forms, and verdicts on joints that are right, wrong, or cannot be told apart.

use nalgebra::Matrix3;
use paws_twin::articulation::{Action, Articulation, JointKind};
use paws_twin::config::Config;
use paws_twin::hands::{Sample, Trajectory};
use paws_twin::math::{Point, Vector};
use paws_twin::twin::{Furniture, Joint, OrientedBox, Part, Role, Solid, Twin};
use paws_twin::validation::replay::Surroundings;
use paws_twin::validation::{Drive, Verdict, simulate, validate};

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
    let solid = |name: &str, role, shape| Solid { name: name.to_owned(), role, shape, seen: true };
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
            },
            solids: vec![solid("front", Role::Front, leaf)],
            handle: Point::new(0.45, -0.03, 0.4),
            bounds: leaf,
        },
    }
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
    Trajectory { side: None, samples, action: Action::Open }
}

fn verdict(furniture: Furniture, trajectory: &Trajectory) -> (Verdict, String) {
    let twin = Twin {
        name: "t".to_owned(),
        density_kg_per_m3: 700.0,
        furniture: vec![furniture],
        room: vec![],
        left_out: vec![],
    };
    let hands = vec![vec![("clip".to_owned(), trajectory)]];
    let validation = validate(&twin, &hands, &Vector::z(), &Config::default().validation).unwrap();
    (validation.joints[0].verdict, validation.joints[0].reason.clone())
}

#[test]
fn the_right_hinge_passes_and_wrong_ones_fail() {
    let truth = door().part.joint.articulation;
    let hand = hand(&truth, 1.2);
    assert_eq!(verdict(door(), &hand).0, Verdict::Pass, "{}", verdict(door(), &hand).1);

    let with = |articulation: Articulation| {
        let mut furniture = door();
        furniture.part.joint.articulation = articulation;
        furniture
    };
    let other_side = Articulation { axis: Vector::z(), origin: Point::new(0.5, 0.0, 0.35), ..truth };
    let inward = truth.reversed();
    let slide = Articulation { kind: JointKind::Prismatic, axis: -Vector::y(), ..truth };
    let beside = Articulation { origin: Point::new(0.25, 0.0, 0.35), ..truth };
    for (name, wrong) in [("other side", other_side), ("inward", inward), ("slide", slide), ("25 cm beside", beside)] {
        let (verdict, reason) = verdict(with(wrong), &hand);
        assert_eq!(verdict, Verdict::Fail, "{name}: {reason}");
    }
}

#[test]
fn a_short_motion_decides_nothing() {
    let hand = hand(&door().part.joint.articulation, 0.15);
    let (verdict, reason) = verdict(door(), &hand);
    assert_eq!(verdict, Verdict::Undetermined, "{reason}");
    assert!(reason.contains("too little"), "{reason}");
}

#[test]
fn a_limit_below_the_recorded_range_is_seen() {
    let mut furniture = door();
    furniture.part.joint.upper = 0.5;
    let (verdict, reason) = verdict(furniture, &hand(&door().part.joint.articulation, 1.2));
    assert_eq!(verdict, Verdict::Fail, "{reason}");
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
    let drive = Drive { times_secs, path: vec![part.handle, far, far], grip: part.handle };
    let around = Surroundings { obstacles: &[], up: &Vector::z(), density: 700.0 };
    let joint = part.joint.articulation;
    let replay = simulate(part, &joint, 3.0, around, &drive, &config).unwrap();
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
    let drive = Drive {
        times_secs: hand.samples.iter().map(|s| s.time_secs).collect(),
        path: hand.positions(),
        grip: part.handle,
    };
    let wall = OrientedBox {
        center: Point::new(0.25, -0.35, 0.35),
        half: Vector::new(0.5, 0.02, 0.5),
        rotation: Matrix3::identity(),
    };
    let config = Config::default().validation;
    let replay = |obstacles: &[OrientedBox]| {
        let around = Surroundings { obstacles, up: &Vector::z(), density: 700.0 };
        simulate(part, &joint, 1.6, around, &drive, &config).unwrap()
    };
    assert!(replay(&[]).reached[1] > 1.1);
    // The free edge meets the wall where 0.5 m sin(q) = 0.33 m.
    let blocked = replay(&[wall]).reached[1];
    assert!((0.6..0.8).contains(&blocked), "{blocked}");
}
