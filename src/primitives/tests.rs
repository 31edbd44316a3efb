//! A door and a drawer, the hands that open them, and what their primitives have to hold.

use nalgebra::{Matrix3, UnitQuaternion};

use super::*;
use crate::hands::Sample;
use crate::math::rotation;
use crate::twin::{Furniture, Joint, OrientedBox, Role, Solid};

/// A part whose face looks along -y, its handle's bar along one axis of the face.
fn part(id: &str, articulation: Articulation, upper: f64, handle: Point, bar_up: bool) -> Part {
    let axes = Matrix3::from_columns(&[Vector::x(), Vector::z(), -Vector::y()]);
    let solid = |name: &str, role: Role, center: Point, half: Vector| Solid {
        name: format!("{id}_{name}"),
        role,
        shape: OrientedBox { center, half, rotation: axes },
        seen: true,
    };
    let bar = if bar_up { Vector::new(0.006, 0.06, 0.006) } else { Vector::new(0.06, 0.006, 0.006) };
    let front = Point::new(0.25, 0.009, 0.5);
    Part {
        id: id.to_owned(),
        label: "cupboard".to_owned(),
        joint: Joint {
            articulation,
            upper,
            observed: 0.9 * upper,
            expected: upper,
            probability: Some(0.9),
            damping: 0.5,
            friction: 0.2,
            resistance_seen: false,
            balanced: false,
        },
        solids: vec![
            solid("front", Role::Front, front, Vector::new(0.25, 0.4, 0.009)),
            solid("handle_bar", Role::Handle, handle, bar),
        ],
        handle,
        bounds: OrientedBox { center: front, half: Vector::new(0.25, 0.4, 0.03), rotation: axes },
    }
}

/// Hinged at the left, seen from the front.
pub(crate) fn door() -> Part {
    let hinge = Articulation { kind: JointKind::Revolute, axis: -Vector::z(), origin: Point::new(0.0, 0.0, 0.5) };
    part("door", hinge, 1.9, Point::new(0.45, -0.035, 0.6), true)
}

pub(crate) fn drawer() -> Part {
    let slide = Articulation { kind: JointKind::Prismatic, axis: -Vector::y(), origin: Point::new(0.25, 0.0, 0.5) };
    let mut drawer = part("drawer", slide, 0.44, Point::new(0.25, -0.035, 0.6), false);
    // Beside the door, out of its way.
    let aside = Vector::new(3.0, 0.0, 0.0);
    drawer.handle += aside;
    drawer.bounds.center += aside;
    for solid in &mut drawer.solids {
        solid.shape.center += aside;
    }
    drawer
}

/// A hand that goes over a range of a part from or to closed, 30 samples a second.
pub(crate) fn hand(part: &Part, action: Action, secs: f64, skew: f64, range: f64) -> Trajectory {
    let count = (30.0 * secs) as usize;
    let samples = (0..=count)
        .map(|i| {
            let share = i as f64 / count as f64;
            let done = timing::progress(share, skew);
            let opening = range * if action == Action::Open { done } else { 1.0 - done };
            let p = part.joint.articulation.motion(opening) * part.handle;
            Sample { frame: i, time_secs: 7.0 + secs * share, observed: p, smoothed: p, accepted: true }
        })
        .collect();
    Trajectory { side: None, samples, action, ends_seen: [true; 2] }
}

/// A twin of parts alone.
pub(crate) fn twin_of(parts: Vec<Part>) -> Twin {
    let furniture = parts
        .into_iter()
        .map(|part| Furniture { name: format!("{}_base", part.id), carcass: Vec::new(), part })
        .collect();
    Twin::of(furniture)
}

/// A door and, beside it, a drawer.
fn twin() -> Twin {
    twin_of(vec![door(), drawer()])
}

#[test]
fn the_path_is_the_joints_and_the_primitive_stays_on_it_to_millimetres() {
    let twin = twin();
    let made = of(&twin, &BTreeMap::new(), &config::Grips::default(), &config::Primitives::default());
    assert_eq!((made.joints.len(), made.left_out.len()), (2, 0));
    for (joint, furniture) in made.joints.iter().zip(&twin.furniture) {
        let phi = furniture.part.joint.articulation;
        for motion in [&joint.opening, &joint.closing] {
            let path = &motion.path;
            for (opening, p) in path.openings.iter().zip(&path.positions) {
                assert!((phi.motion(*opening) * furniture.part.handle - p).norm() < 1e-9);
            }
            assert_eq!([path.openings[0], path.openings[PATH - 1]], [motion.from, motion.to]);
            // The primitive: where it is at any time, the joint could have brought it.
            let dmp = &motion.dmp_pose;
            let secs = dmp.duration_secs;
            let rolled = dmp.rollout(&made.dmp, &dmp.goal, secs, 0.001 * secs, secs);
            let start = phi.motion(motion.from);
            for y in &rolled {
                let p = Point::new(y[0], y[1], y[2]);
                let opening = phi.opening_at(&furniture.part.handle, &p);
                assert!((phi.motion(opening) * furniture.part.handle - p).norm() < 2e-3, "{} {y:?}", joint.joint);
                let turned = UnitQuaternion::from_scaled_axis(Vector::new(y[3], y[4], y[5])) * start.rotation;
                assert!(turned.angle_to(&phi.motion(opening).rotation) < 0.01);
            }
            let end = &rolled[rolled.len() - 1];
            let goal = Point::new(dmp.goal[0], dmp.goal[1], dmp.goal[2]);
            assert!((Point::new(end[0], end[1], end[2]) - goal).norm() < 2e-3);
        }
    }
}

#[test]
fn opening_leaves_the_face_and_the_gripper_waits_before_it() {
    let made = of(&twin(), &BTreeMap::new(), &config::Grips::default(), &config::Primitives::default());
    for joint in &made.joints {
        assert!(joint.opening_direction.y < -0.9, "{:?}", joint.opening_direction);
        let way = joint.grasp.position - joint.pregrasp.position;
        assert!((way - joint.contact.approach * made.standoff_m).norm() < 1e-12);
        assert_eq!(joint.grasp.rotation_wxyz, joint.pregrasp.rotation_wxyz);
        assert_eq!(joint.opening.path.positions[0], joint.grasp.position);
        assert!(joint.opening.path.rotations_wxyz.windows(2).all(|q| {
            let dot: f64 = q[0].iter().zip(&q[1]).map(|(a, b)| a * b).sum();
            dot > 0.99
        }));
    }
}

#[test]
fn hands_verdicts_and_covariances_stand_beside_their_joint() {
    let door = door();
    let (open, close) = (hand(&door, Action::Open, 2.0, 1.0, 1.7), hand(&door, Action::Close, 1.0, 1.0, 1.7));
    let said = Uncertainty {
        across: [Vector::x(), Vector::y()],
        axis_cov_rad2: [[0.01, 0.0], [0.0, 0.04]],
        origin_cov_m2: Some([[1e-4, 0.0], [0.0, 4e-4]]),
        observed_range_std: 0.05,
        moved_std: Vec::new(),
    };
    let seen = Seen {
        hands: vec![("a".to_owned(), &open), ("b".to_owned(), &close)],
        uncertainty: Some(&said),
        verdict: Some("pass"),
    };
    let made =
        of(&twin(), &BTreeMap::from([("door", seen)]), &config::Grips::default(), &config::Primitives::default());
    let [door, drawer] = &made.joints[..] else { panic!("{:?}", made.joints) };
    assert_eq!(door.opening.timing.clip.as_deref(), Some("a"));
    assert_eq!(door.closing.timing.clip.as_deref(), Some("b"));
    assert!(door.opening.timing.duration_secs > 1.5 * door.closing.timing.duration_secs);
    let sure = &door.uncertainty;
    assert_eq!(sure.verdict.as_deref(), Some("pass"));
    for (got, wanted) in [(sure.axis_std_rad, [0.1, 0.2]), (sure.origin_std_m, [0.01, 0.02])] {
        assert!(got.unwrap().iter().zip(wanted).all(|(a, b)| (a - b).abs() < 1e-12), "{got:?}");
    }
    assert_eq!(sure.contact_std_m, Some(0.03));
    assert_eq!(drawer.opening.timing.source, TimingSource::MinimumJerk);
    assert!(drawer.uncertainty.axis_std_rad.is_none() && drawer.uncertainty.contact_std_m.is_none());
}

#[test]
fn a_joint_that_cannot_move_costs_itself() {
    let mut twin = twin();
    twin.furniture[0].part.handle = Point::new(f64::NAN, 0.0, 0.0);
    let made = of(&twin, &BTreeMap::new(), &config::Grips::default(), &config::Primitives::default());
    assert_eq!((made.joints.len(), made.left_out.len()), (1, 1));
    assert_eq!((made.joints[0].joint.as_str(), made.left_out[0].id.as_str()), ("drawer", "door"));
}

/// A gripper that turns about the bar while the part turns about its hinge, the two parallel.
#[test]
fn a_turn_about_the_bar_is_in_path_and_primitive() {
    let part = door();
    let contact = grasp::tilted(&grasp::contact(&part, &config::Primitives::default()), [0.2, -0.8]);
    let (grips, config) = (config::Grips::default(), config::Primitives::default());
    let made = of_joint(&part, contact, &Seen::default(), &System::default(), &grips, &config).unwrap();
    assert!((made.opening.path.positions[PATH - 1] - made.closing.path.positions[0]).norm() < 1e-9);
    for motion in [&made.opening, &made.closing] {
        let quaternion = |i: usize| {
            let [w, x, y, z] = motion.path.rotations_wxyz[i];
            UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(w, x, y, z))
        };
        let goal = Vector::new(motion.dmp_pose.goal[3], motion.dmp_pose.goal[4], motion.dmp_pose.goal[5]);
        let end = UnitQuaternion::from_scaled_axis(goal) * quaternion(0);
        assert!(end.angle_to(&quaternion(PATH - 1)) < 1e-6);
    }
    // From 0.2 to -0.8 about the bar, which is upright as the hinge is.
    assert!((made.opening.dmp_pose.goal[5].abs() - 1.9).abs() > 0.9);
}

/// A joint that turns further than half a turn keeps turning.
#[test]
fn a_turn_of_more_than_half_is_one_turn() {
    let mut part = door();
    part.joint.upper = 3.6;
    let made = of_joint(
        &part,
        grasp::contact(&part, &config::Primitives::default()),
        &Seen::default(),
        &System::default(),
        &config::Grips::default(),
        &config::Primitives::default(),
    )
    .unwrap();
    let goal = &made.opening.dmp_pose.goal;
    assert!((goal[5] + 3.6).abs() < 1e-9, "{goal:?}");
    let end = made.opening.path.rotations_wxyz[PATH - 1];
    let wanted = rotation(&-Vector::z(), 3.6) * grasp::pose(&made.contact).rotation;
    let dot: f64 = end.iter().zip(grasp::wxyz(&wanted)).map(|(a, b)| a * b).sum();
    assert!((dot.abs() - 1.0).abs() < 1e-9);
}

fn keys(value: &serde_json::Value) -> Vec<&str> {
    value.as_object().unwrap().keys().map(String::as_str).collect()
}

/// What readers of the file rely on. A key that goes or changes its meaning needs another [`SCHEMA`].
#[test]
fn the_file_has_the_keys_that_its_schema_promises_and_is_read_back() {
    let made = of(&twin(), &BTreeMap::new(), &config::Grips::default(), &config::Primitives::default());
    let text = crate::json::text(&made).unwrap();
    let file: serde_json::Value = serde_json::from_str(&text).unwrap();
    assert_eq!(file["schema"], "paws-primitives/1");
    let sorted = |names: &str| {
        let mut names: Vec<String> = names.split(' ').map(str::to_owned).collect();
        names.sort();
        names
    };
    let joint = &file["joints"][0];
    for (value, names) in [
        (&file, "schema scene frame standoff_m dmp joints"),
        (&file["dmp"], "alpha beta phase_decay centers widths"),
        (
            joint,
            "joint label type axis origin opening_direction limits uncertainty contact pregrasp grasp opening closing",
        ),
        (&joint["limits"], "lower upper observed expected"),
        (&joint["uncertainty"], "probability verdict across axis_std_rad origin_std_m observed_std contact_std_m"),
        (&joint["contact"], "hold point approach closing width_m gripper_opening_m tilt_rad"),
        (&joint["grasp"], "position rotation_wxyz"),
        (&joint["opening"], "from to timing path dmp_joint dmp_pose"),
        (&joint["opening"]["timing"], "source clip duration_secs skew"),
        (&joint["opening"]["path"], "times_secs openings positions rotations_wxyz"),
        (&joint["opening"]["dmp_pose"], "forcing duration_secs start goal weights"),
    ] {
        let mut found = keys(value);
        found.sort_unstable();
        assert_eq!(found, sorted(names));
    }
    assert_eq!(joint["opening"]["dmp_joint"]["forcing"], "scaled");
    assert_eq!(joint["opening"]["dmp_pose"]["forcing"], "unscaled");
    assert_eq!(joint["opening"]["dmp_pose"]["weights"].as_array().unwrap().len(), 6);
    assert_eq!(joint["opening"]["timing"]["source"], "minimum_jerk");
    assert_eq!(serde_json::from_str::<Primitives>(&text).unwrap(), made);
}
