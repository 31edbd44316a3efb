use nalgebra::Matrix3;

use super::*;
use crate::twin::{Joint, OrientedBox, Role, Solid};

/// A drawer's front that slides to -y.
fn front() -> Part {
    let bounds = OrientedBox {
        center: Point::new(0.0, 0.0, 0.5),
        half: Vector::new(0.2, 0.1, 0.01),
        // Right, up, out of the face.
        rotation: Matrix3::from_columns(&[Vector::x(), Vector::z(), -Vector::y()]),
    };
    let handle = Point::new(0.0, -0.03, 0.5);
    let articulation = Articulation { kind: JointKind::Prismatic, axis: -Vector::y(), origin: handle };
    let joint = Joint {
        articulation,
        upper: 0.4,
        observed: 0.3,
        expected: 0.4,
        probability: None,
        damping: 1.0,
        friction: 1.0,
        resistance_seen: false,
        balanced: false,
    };
    let solid = Solid { name: "front".to_owned(), role: Role::Front, shape: bounds, seen: true };
    Part { id: "drawer".to_owned(), label: "drawer".to_owned(), joint, solids: vec![solid], handle, bounds }
}

/// A hand's way of 0.3 m, replayed.
fn replayed(part: &Part, config: &config::Validation) -> ClipCheck {
    let path: Vec<Point> =
        (0..=60).map(|i| part.joint.articulation.motion(0.005 * f64::from(i)) * part.handle).collect();
    let times_secs = (0..=60).map(|i| f64::from(i) / 30.0).collect();
    let drive = Drive { times_secs, path, grip: part.handle, back: false };
    let up = Vector::z();
    let around = Surroundings::none(&up, 700.0);
    ClipCheck {
        clip: "clip".to_owned(),
        action: Action::Open,
        observed_range: 0.3,
        distance_m: 0.0,
        held_out_rms_m: None,
        noise_m: 0.0,
        samples: 8.0,
        replay: simulate(part, &part.joint.articulation, part.joint.upper, &around, &drive, config).unwrap(),
        rival: None,
    }
}

#[test]
fn a_part_that_nobody_saw_neither_passes_nor_fails_by_what_stands_around_it() {
    let config = config::Validation::default();
    let mut part = front();
    let good = replayed(&part, &config);
    let mut stopped = good.clone();
    stopped.replay.reached = [0.0, 0.1];
    let told = |part: &Part, clip: &ClipCheck| judge(part, vec![clip.clone()], Vec::new(), None, &config).verdict;
    assert_eq!((told(&part, &good), told(&part, &stopped)), (Verdict::Pass, Verdict::Fail));
    part.solids.iter_mut().for_each(|solid| solid.seen = false);
    assert_eq!((told(&part, &good), told(&part, &stopped)), (Verdict::Undetermined, Verdict::Undetermined));
    // A hand that it cannot follow is a hand that was seen.
    let mut wild = good.clone();
    wild.replay.rms_m = 0.3;
    assert_eq!(told(&part, &wild), Verdict::Fail);
}

#[test]
fn a_simulation_that_blew_up_refutes_nothing() {
    let config = config::Validation::default();
    let part = front();
    let good = replayed(&part, &config);
    assert_eq!(good.replay.untrusted, None);
    let mut wild = good.clone();
    wild.replay.rms_m = 0.3;
    wild.replay.reached = [0.0, 0.01];
    let told = |clips: &[&ClipCheck]| {
        let clips = clips.iter().map(|c| (*c).clone()).collect();
        judge(&part, clips, Vec::new(), None, &config)
    };
    assert_eq!(told(&[&wild]).verdict, Verdict::Fail);
    wild.replay.untrusted = Some("the handle moved at 90 m/s".to_owned());
    let check = told(&[&wild]);
    assert_eq!(check.verdict, Verdict::Undetermined);
    assert!(check.reason.contains("not to be trusted here, because the handle moved at 90 m/s"), "{}", check.reason);
    // Beside good ones a bad one costs only itself.
    assert_eq!(told(&[&good, &wild, &good]).verdict, Verdict::Pass);
}
