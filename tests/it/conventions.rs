//! Recordings whose conventions are wrong are told with the cause; right ones are left alone.

use std::sync::LazyLock;

use nalgebra::{Matrix3, Quaternion, Rotation3, UnitQuaternion};
use paws_twin::math::{Point, Pose, Vector};
use paws_twin::recording::conventions::{Finding, Subject, findings, repaired};
use paws_twin::recording::{Recording, Side};
use paws_twin::synth::{SynthOptions, Tier};
use serde_json::Value;
use tempfile::TempDir;

use crate::common::{SMALL, copy, optional_data, paws, record, stderr};

/// Recordings of every size of errors, rendered once.
static TIERS: LazyLock<Vec<(Tier, TempDir)>> = LazyLock::new(|| {
    [Tier::Clean, Tier::T1, Tier::T2, Tier::Hd, Tier::T3]
        .into_iter()
        .map(|tier| {
            let dir = tempfile::tempdir().unwrap();
            record(&SynthOptions { seed: 1, tier, width: 160, parts: 3 }, dir.path());
            (tier, dir)
        })
        .collect()
});

fn found(recording: &Recording) -> Vec<Finding> {
    findings(&Subject::of(recording))
}

fn poses(recording: &mut Recording, change: impl Fn(&Pose) -> Pose) {
    for frame in &mut recording.frames {
        frame.world_from_camera = change(&frame.world_from_camera);
    }
}

/// Turns poses and hands.
fn world(recording: &mut Recording, turn: UnitQuaternion<f64>) {
    poses(recording, |p| turn * p);
    for tip in recording.hands.iter_mut().flat_map(|h| &mut h.tips) {
        *tip = turn * *tip;
    }
}

/// World and camera mirrored, which leaves a rigid transform.
fn mirrored(pose: &Pose, world: [f64; 3], camera: [f64; 3]) -> Pose {
    let [world, camera] = [world, camera].map(|d| Matrix3::from_diagonal(&Vector::from(d)));
    let turn = world * pose.rotation.to_rotation_matrix().into_inner() * camera;
    let place = world * pose.translation.vector;
    Pose::from_parts(place.into(), UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(turn)))
}

fn shift_poses(recording: &mut Recording, by: usize) {
    let old: Vec<Pose> = recording.frames.iter().map(|f| f.world_from_camera).collect();
    for (i, frame) in recording.frames.iter_mut().enumerate() {
        frame.world_from_camera = old[i.saturating_sub(by)];
    }
}

fn shift_hands(recording: &mut Recording, by: usize) {
    let frames = recording.frames.len();
    recording.hands.iter_mut().for_each(|h| h.frame += by);
    recording.hands.retain(|h| h.frame < frames);
}

/// Mirrors hands in the x of their frame's camera.
fn mirror_hands(recording: &mut Recording) {
    let frames = recording.frames.clone();
    for hand in &mut recording.hands {
        let pose = frames[hand.frame].world_from_camera;
        hand.tips = hand.tips.map(|p| {
            let seen = pose.inverse() * p;
            pose * Point::new(-seen.x, seen.y, seen.z)
        });
    }
}

fn without_masks(recording: &mut Recording) {
    recording.frames.iter_mut().for_each(|f| f.files.mask = None);
}

/// A wrong convention: its name, what it does, words of its finding.
type Wrong = (&'static str, fn(&mut Recording), &'static str);

const WRONG: [Wrong; 12] = [
    ("inverted poses", |r| poses(r, Pose::inverse), "the poses are inverted"),
    (
        "inverted rotations",
        |r| poses(r, |p| Pose::from_parts(p.translation, p.rotation.inverse())),
        "the rotations of the poses are inverted",
    ),
    (
        "a quaternion in another order",
        |r| {
            poses(r, |p| {
                let q = p.rotation.quaternion();
                // x y z w in the file, read as w x y z.
                let q = Quaternion::new(q.i, q.j, q.k, q.w);
                Pose::from_parts(p.translation, UnitQuaternion::from_quaternion(q))
            });
        },
        "order x y z w",
    ),
    ("OpenGL's camera", |r| poses(r, |p| mirrored(p, [1.0; 3], [1.0, -1.0, -1.0])), "OpenGL"),
    ("a mirrored x axis", |r| poses(r, |p| mirrored(p, [-1.0, 1.0, 1.0], [-1.0, 1.0, 1.0])), "right = -x"),
    (
        "Y up",
        |r| world(r, UnitQuaternion::from_axis_angle(&Vector::x_axis(), -std::f64::consts::FRAC_PI_2)),
        "up is +Y",
    ),
    ("upside down", |r| world(r, UnitQuaternion::from_axis_angle(&Vector::x_axis(), std::f64::consts::PI)), "up is -Z"),
    (
        "half the scale",
        |r| poses(r, |p| Pose::from_parts((0.5 * p.translation.vector).into(), p.rotation)),
        "of the scale",
    ),
    (
        "millimetres",
        |r| poses(r, |p| Pose::from_parts((1e3 * p.translation.vector).into(), p.rotation)),
        "of the scale",
    ),
    ("late poses", |r| shift_poses(r, 8), "the poses come"),
    ("late hands", |r| shift_hands(r, 10), "the hands come"),
    (
        "hands of the camera",
        |r| {
            let frames = r.frames.clone();
            for hand in &mut r.hands {
                let inverse = frames[hand.frame].world_from_camera.inverse();
                hand.tips = hand.tips.map(|p| inverse * p);
            }
        },
        "the hands are in the camera's frame",
    ),
];

#[test]
fn every_wrong_convention_is_named() {
    let mut lost = Vec::new();
    for (tier, dir) in TIERS.iter().filter(|(tier, _)| *tier != Tier::T3) {
        let right = Recording::open(dir.path()).unwrap();
        for (name, change, words) in WRONG {
            let mut wrong = right.clone();
            change(&mut wrong);
            let all = found(&wrong);
            if !all.iter().any(|f| f.what.contains(words) && !f.evidence.is_empty() && !f.remedy.is_empty()) {
                lost.push(format!("{} {name}: {all:#?}", tier.name()));
            }
        }
    }
    assert!(lost.is_empty(), "{}", lost.join("\n"));
}

/// Wrong intrinsics: their name, what they are, words of their finding and its remedy.
type WrongLens = (&'static str, fn(&mut Recording), [&'static str; 2]);

fn focal(recording: &mut Recording, factor: f64) {
    recording.camera.fx *= factor;
    recording.camera.fy *= factor;
}

const WRONG_LENS: [WrongLens; 7] = [
    ("half", |r| focal(r, 0.5), ["fx and fy are 0.50 times", "by 2.00"]),
    ("three quarters", |r| focal(r, 0.75), ["fx and fy are 0.75 times", "by 1.33"]),
    ("twice", |r| focal(r, 2.0), ["fx and fy are 2.00 times", "by 0.50"]),
    (
        "of an image twice as large",
        |r| {
            focal(r, 2.0);
            (r.camera.cx, r.camera.cy) = (2.0 * r.camera.cx + 0.5, 2.0 * r.camera.cy + 0.5);
        },
        ["of images 2.00 times as large", "fx, fy, cx and cy by 0.50"],
    ),
    (
        "of an image half as large",
        |r| {
            focal(r, 0.5);
            (r.camera.cx, r.camera.cy) = (0.5 * r.camera.cx - 0.25, 0.5 * r.camera.cy - 0.25);
        },
        ["of images 0.50 times as large", "fx, fy, cx and cy by 2.00"],
    ),
    (
        "a principal point of another image",
        |r| (r.camera.cx, r.camera.cy) = (0.5 * r.camera.cx, 0.5 * r.camera.cy),
        ["is not the middle of the images", "put cx and cy in the middle"],
    ),
    (
        "a principal point of another image, and positions that are too small",
        |r| {
            (r.camera.cx, r.camera.cy) = (0.5 * r.camera.cx, 0.5 * r.camera.cy);
            poses(r, |p| Pose::from_parts((0.8 * p.translation.vector).into(), p.rotation));
        },
        ["is not the middle of the images", "put cx and cy in the middle"],
    ),
];

#[test]
fn wrong_intrinsics_are_named_and_nothing_else_is() {
    let mut lost = Vec::new();
    let mut check = |name: &str, right: &Recording| {
        for (what, change, words) in WRONG_LENS {
            let mut wrong = right.clone();
            change(&mut wrong);
            let all = found(&wrong);
            let is_told = |f: &Finding| f.what.contains(words[0]) && f.remedy.contains(words[1]) && f.ruinous;
            if all.len() != 1 || !is_told(&all[0]) {
                lost.push(format!("{name} {what}: {all:#?}"));
            }
        }
    };
    for (tier, dir) in TIERS.iter() {
        check(tier.name(), &Recording::open(dir.path()).unwrap());
    }
    for name in ["apartment_clean", "apartment_realistic"] {
        if let Some(dir) = optional_data(&format!("recordings/{name}")) {
            check(name, &Recording::open(&dir).unwrap());
        }
    }
    assert!(lost.is_empty(), "{}", lost.join("\n"));
}

#[test]
fn hands_are_judged_by_what_they_hide_where_no_mask_shows_them() {
    const LATE: [Tier; 3] = [Tier::Clean, Tier::T1, Tier::T2];
    const MIRRORED: [Tier; 4] = [Tier::Clean, Tier::T1, Tier::T2, Tier::Hd];
    type Damage = fn(&mut Recording);
    let wrong: [(&[Tier], Damage, &str); 2] = [
        (&LATE, |r| shift_hands(r, 10), "the hands come 0.83 s (10 frames) too late"),
        (&MIRRORED, mirror_hands, "mirrored in the camera's x"),
    ];
    for (tier, dir) in TIERS.iter() {
        for (tiers, change, words) in wrong {
            if !tiers.contains(tier) {
                continue;
            }
            let mut recording = Recording::open(dir.path()).unwrap();
            without_masks(&mut recording);
            change(&mut recording);
            let all = found(&recording);
            let told = all.iter().find(|f| f.what.contains(words));
            let said = told.is_some_and(|f| f.evidence.contains("hide what is behind them") && !f.remedy.is_empty());
            assert!(said && all.len() == 1, "{} {words}: {all:#?}", tier.name());
        }
    }
}

#[test]
fn swapped_sides_of_third_party_hands_are_named() {
    let Some(dir) = optional_data("recordings/apartment_realistic") else { return };
    let mut recording = Recording::open(&dir).unwrap();
    for hand in &mut recording.hands {
        hand.side = if hand.side == Side::Left { Side::Right } else { Side::Left };
    }
    let all = found(&recording);
    assert!(all.len() == 1 && all[0].what.contains("swapped") && !all[0].ruinous, "{all:#?}");
}

#[test]
fn right_recordings_raise_no_alarm() {
    let shift: fn(&mut Recording) = |r| shift_hands(r, 2);
    type Change = (&'static str, fn(&mut Recording));
    let harmless: [Change; 7] = [
        ("as it is", |_| {}),
        ("a focal length 5 % off", |r| {
            r.camera.fx *= 1.05;
            r.camera.fy *= 1.05;
        }),
        ("hands two frames late", shift),
        ("no masks", without_masks),
        ("no masks, hands two frames late", |r| {
            without_masks(r);
            shift_hands(r, 2);
        }),
        ("no masks, a focal length 5 % off", |r| {
            without_masks(r);
            r.camera.fx *= 1.05;
            r.camera.fy *= 1.05;
        }),
        ("no depth", |r| r.frames.iter_mut().for_each(|f| f.files.depth = None)),
    ];
    for (tier, dir) in TIERS.iter() {
        let right = Recording::open(dir.path()).unwrap();
        for (name, change) in harmless {
            let mut recording = right.clone();
            change(&mut recording);
            let all = found(&recording);
            assert!(all.is_empty(), "{} {name}: {all:#?}", tier.name());
        }
    }
    let small = Recording::open(SMALL.path()).unwrap();
    let all = found(&small);
    assert!(all.is_empty(), "{all:#?}");
}

#[test]
fn third_party_recordings_raise_no_alarm() {
    for name in ["apartment_clean", "apartment_realistic", "apartment_hard"] {
        let Some(dir) = optional_data(&format!("recordings/{name}")) else { return };
        let mut recording = Recording::open(&dir).unwrap();
        let all = found(&recording);
        assert!(all.is_empty(), "{name}: {all:#?}");
        without_masks(&mut recording);
        let all = found(&recording);
        assert!(all.is_empty(), "{name} without masks: {all:#?}");
    }
}

#[test]
fn third_party_hands_of_another_time_are_named_without_masks() {
    for name in ["apartment_clean", "apartment_realistic"] {
        let Some(dir) = optional_data(&format!("recordings/{name}")) else { return };
        let mut recording = Recording::open(&dir).unwrap();
        without_masks(&mut recording);
        shift_hands(&mut recording, 10);
        let all = found(&recording);
        assert!(
            all.iter().any(|f| f.what.contains("the hands come") && f.what.contains("too late")),
            "{name}: {all:#?}"
        );
    }
}

#[test]
fn what_is_certain_can_be_corrected() {
    let (_, dir) = &TIERS[2];
    let right = Recording::open(dir.path()).unwrap();
    for (name, change, _) in WRONG {
        let mut wrong = right.clone();
        change(&mut wrong);
        let mut all = found(&wrong);
        let can = |all: &[Finding]| all.iter().any(Finding::can_be_fixed);
        if !can(&all) {
            continue;
        }
        for _ in 0..3 {
            let (next, done) = repaired(wrong, &all);
            assert_eq!(done.is_empty(), !can(&all), "{name}");
            wrong = next;
            all = found(&wrong);
            if all.is_empty() {
                break;
            }
        }
        assert!(all.is_empty(), "{name}: {all:#?}");
        // Where the camera looks from is the same again, to the steps of a scale.
        let place = |r: &Recording| r.frames[40].center() - r.frames[5].center();
        let (a, b) = (place(&wrong).norm(), place(&right).norm());
        assert!((a - b).abs() < 0.35 * b + 0.05, "{name}: {a} {b}");
    }
}

/// A copy of the small recording with other poses.
fn small_with(change: impl Fn(&Pose) -> Pose) -> TempDir {
    let dir = tempfile::tempdir().unwrap();
    let rec = dir.path().join("rec");
    copy(SMALL.path(), &rec);
    let file = rec.join("cameras.json");
    let mut cameras: Value = serde_json::from_str(&std::fs::read_to_string(&file).unwrap()).unwrap();
    for frame in cameras["frames"].as_array_mut().unwrap() {
        let read = |v: &Value| -> Vec<f64> { serde_json::from_value(v.clone()).unwrap() };
        let (p, q) = (read(&frame["position"]), read(&frame["rotation_wxyz"]));
        let q = UnitQuaternion::from_quaternion(Quaternion::new(q[0], q[1], q[2], q[3]));
        let pose = change(&Pose::from_parts(Point::new(p[0], p[1], p[2]).coords.into(), q));
        let q = pose.rotation.quaternion();
        frame["position"] = serde_json::json!(pose.translation.vector.as_slice());
        frame["rotation_wxyz"] = serde_json::json!([q.w, q.i, q.j, q.k]);
    }
    std::fs::write(&file, cameras.to_string()).unwrap();
    dir
}

#[test]
fn a_recording_that_contradicts_itself_is_not_made_a_twin_of_without_a_word() {
    let dir = small_with(|p| mirrored(p, [1.0; 3], [1.0, -1.0, -1.0]));
    let out = paws(&["twin", "rec", "--out", "twin"], dir.path());
    let message = stderr(&out);
    assert_eq!(out.status.code(), Some(2), "{message}");
    for word in ["OpenGL", "as declared", "--fix", "--as-is"] {
        assert!(message.contains(word), "{word}: {message}");
    }
    assert!(!dir.path().join("twin").exists());
    let out = paws(&["twin", "rec", "--out", "twin", "--fix"], dir.path());
    assert!(stderr(&out).contains("corrected: "), "{}", stderr(&out));
    assert!(dir.path().join("twin/scene.urdf").is_file());
}

#[test]
fn hands_out_of_reach_are_told_with_the_poses_that_put_them_there() {
    let dir = small_with(Pose::inverse);
    for command in [&["twin", "rec", "--out", "twin"][..], &["infer", "rec"]] {
        let out = paws(command, dir.path());
        let message = stderr(&out);
        assert_eq!(out.status.code(), Some(2), "{message}");
        assert!(message.contains("the poses are inverted"), "{message}");
    }
    let out = paws(&["import", "--check", "rec"], dir.path());
    assert_eq!(out.status.code(), Some(1));
    let text = String::from_utf8(out.stdout).unwrap();
    assert!(text.contains("the poses are inverted") && text.contains("invert every pose"), "{text}");
    let out = paws(&["import", "--check", SMALL.path().to_str().unwrap()], dir.path());
    assert_eq!(out.status.code(), Some(0), "{}", stderr(&out));
}
