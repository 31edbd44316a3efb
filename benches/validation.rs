//! What a proof costs: one joint's clip with its rivals, and a whole kitchen.

#![allow(clippy::unwrap_used, missing_docs, reason = "a bench that cannot run should say so at once")]

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use nalgebra::Matrix3;
use paws_twin::articulation::{Action, Articulation, JointKind};
use paws_twin::config::Config;
use paws_twin::hands::{Sample, Trajectory};
use paws_twin::math::{Point, Vector};
use paws_twin::twin::{Furniture, Joint, OrientedBox, Part, Role, Solid, Twin};
use paws_twin::validation::validate;

/// A box of a front that looks towards -y: right, up and out of it.
fn board(center: [f64; 3], half: [f64; 3]) -> OrientedBox {
    OrientedBox {
        center: Point::from(center),
        half: Vector::from(half),
        rotation: Matrix3::from_columns(&[Vector::x(), Vector::z(), -Vector::y()]),
    }
}

/// A unit 0.5 m wide whose left end is at `x`: a door on its left edge, or a drawer.
fn unit(number: usize, x: f64, z: f64) -> Furniture {
    let door = number.is_multiple_of(2);
    let solid = |name: &str, role: Role, center: [f64; 3], half: [f64; 3]| Solid {
        name: format!("unit_{number}_{name}"),
        role,
        shape: board([x + center[0], center[1], z + center[2]], half),
        seen: true,
    };
    let mut solids = vec![
        solid("front", Role::Front, [0.25, 0.009, 0.35], [0.247, 0.347, 0.009]),
        solid("bar", Role::Handle, [0.45, -0.035, 0.35], [0.006, 0.06, 0.006]),
    ];
    if !door {
        solids.push(solid("bottom", Role::Tray, [0.25, 0.22, 0.1], [0.21, 0.009, 0.2]));
        solids.push(solid("left", Role::Tray, [0.05, 0.22, 0.2], [0.009, 0.09, 0.2]));
        solids.push(solid("right", Role::Tray, [0.45, 0.22, 0.2], [0.009, 0.09, 0.2]));
    }
    let articulation = if door {
        Articulation { kind: JointKind::Revolute, axis: -Vector::z(), origin: Point::new(x + 0.003, 0.0, z + 0.35) }
    } else {
        Articulation { kind: JointKind::Prismatic, axis: -Vector::y(), origin: Point::new(x + 0.25, 0.0, z + 0.35) }
    };
    Furniture {
        name: format!("unit_{number}"),
        carcass: vec![
            solid("side_a", Role::Carcass, [0.009, 0.3, 0.35], [0.009, 0.35, 0.275]),
            solid("side_b", Role::Carcass, [0.491, 0.3, 0.35], [0.009, 0.35, 0.275]),
            solid("floor", Role::Carcass, [0.25, 0.3, 0.009], [0.23, 0.009, 0.275]),
            solid("top", Role::Carcass, [0.25, 0.3, 0.691], [0.23, 0.009, 0.275]),
            solid("back", Role::Carcass, [0.25, 0.57, 0.35], [0.23, 0.33, 0.009]),
        ],
        part: Part {
            id: format!("joint_{number}"),
            label: "unit".to_owned(),
            joint: Joint {
                articulation,
                upper: if door { 1.6 } else { 0.4 },
                observed: if door { 1.2 } else { 0.3 },
                expected: if door { 1.6 } else { 0.4 },
                damping: if door { 0.5 } else { 5.0 },
                friction: if door { 0.2 } else { 2.0 },
                resistance_seen: false,
                balanced: false,
                probability: None,
            },
            bounds: board([x + 0.25, 0.009, z + 0.35], [0.247, 0.347, 0.009]),
            solids,
            handle: Point::new(x + 0.45, -0.035, z + 0.35),
        },
    }
}

/// A hand that opens a unit in two seconds, 30 samples a second.
fn hand(furniture: &Furniture) -> Trajectory {
    let part = &furniture.part;
    let samples = (0..=60)
        .map(|i| {
            let s = f64::from(i) / 60.0;
            let opening = part.joint.observed * s.powi(3) * (10.0 - 15.0 * s + 6.0 * s * s);
            let p = part.joint.articulation.motion(opening) * part.handle;
            Sample { frame: i as usize, time_secs: 2.0 * s, observed: p, smoothed: p, accepted: true }
        })
        .collect();
    Trajectory { side: None, samples, action: Action::Open, ends_seen: [true; 2] }
}

fn kitchen(units: usize) -> Twin {
    // Two rows, one above the other.
    let furniture = (0..units).map(|i| unit(i, 0.5 * (i / 2) as f64, 0.72 * (i % 2) as f64)).collect();
    Twin {
        name: "kitchen".to_owned(),
        density_kg_per_m3: 700.0,
        drives: paws_twin::config::Drives::default(),
        furniture,
        room: Vec::new(),
        left_out: Vec::new(),
    }
}

fn proof(c: &mut Criterion, name: &str, units: usize) {
    let twin = kitchen(units);
    let trajectories: Vec<Trajectory> = twin.furniture.iter().map(hand).collect();
    let hands: Vec<Vec<(String, &Trajectory)>> = trajectories.iter().map(|t| vec![("clip".to_owned(), t)]).collect();
    let config = Config::default().validation;
    let up = Vector::z();
    c.bench_function(name, |b| {
        b.iter(|| black_box(validate(black_box(&twin), &hands, &up, &config).unwrap()));
    });
}

fn one_clip(c: &mut Criterion) {
    proof(c, "one clip with its rivals", 1);
}

fn whole_kitchen(c: &mut Criterion) {
    proof(c, "a kitchen of 50 joints", 50);
}

criterion_group! {
    name = validation;
    config = Criterion::default().sample_size(10);
    targets = one_clip, whole_kitchen
}
criterion_main!(validation);
