//! The whole pipeline on kitchens whose answer is known: without noise, then with the errors of real estimators.

use paws_twin::articulation::JointKind;
use paws_twin::config::Config;
use paws_twin::evaluation::{EvaluationReport, Rule, Truth, evaluate, room_fit};
use paws_twin::fitting::overlap;
use paws_twin::report::files::predictions;
use paws_twin::synth::{SynthOptions, Tier};

use crate::common::{record, twin_of};

fn report(seed: u64, tier: Tier, parts: usize) -> EvaluationReport {
    let dir = tempfile::tempdir().unwrap();
    record(&SynthOptions { seed, tier, width: 320, parts }, dir.path());
    let (_, scene, twin) = twin_of(dir.path());
    evaluate(&predictions(&scene, &twin), &[Truth::read(dir.path()).unwrap()])
}

fn shares(report: &EvaluationReport, rule: Rule) -> [f64; 3] {
    let micro = report.rules.iter().find(|r| r.rule == rule).unwrap().micro;
    [micro.m, micro.ma, micro.mao]
}

#[test]
fn without_noise_every_joint_is_right_to_a_degree_and_a_few_centimetres() {
    let report = report(101, Tier::Clean, 6);
    assert_eq!((report.answered, report.clips, report.false_positives), (12, 12, 0));
    assert_eq!(shares(&report, Rule::Sim), [1.0; 3], "{:#?}", report.per_clip);
    for clip in &report.per_clip {
        let m = clip.measured.as_ref().unwrap();
        assert!(m.type_right && m.signed_axis_rad < 1f64.to_radians(), "{clip:?}");
        // A slide's line may run anywhere along its front: origins of slides are exempt in every rule.
        assert!(m.kind == JointKind::Prismatic || m.truth_to_line_m.unwrap() < 0.04, "{clip:?}");
    }
    // Every answer says how sure it is; slides have no hinge.
    let hinges = report.per_clip.iter().filter(|c| c.kind == JointKind::Revolute).count();
    let said: Vec<(&str, usize)> = report.coverage.iter().map(|c| (c.of, c.answers)).collect();
    assert_eq!(said, [("axis", 12), ("hinge", hinges), ("range", 12)]);
}

#[test]
fn parts_open_as_far_as_expected_and_touch_neither_neighbours_nor_the_room() {
    let dir = tempfile::tempdir().unwrap();
    record(&SynthOptions { seed: 105, tier: Tier::Clean, width: 320, parts: 6 }, dir.path());
    let (_, _, twin) = twin_of(dir.path());
    assert!(!twin.room.is_empty(), "nothing of the room was built");
    for (i, f) in twin.furniture.iter().enumerate() {
        let joint = &f.part.joint;
        assert!(joint.expected >= joint.upper && joint.upper > 0.0, "{joint:?}");
        let others = twin.furniture.iter().enumerate().filter(|(j, _)| *j != i).map(|(_, f)| f);
        let closed = others.flat_map(|f| f.carcass.iter().chain(&f.part.solids));
        let around: Vec<_> = closed.chain(&twin.room).collect();
        for step in 0..=60 {
            let motion = joint.articulation.motion(joint.upper * f64::from(step) / 60.0);
            for solid in &f.part.solids {
                let moved = solid.shape.moved(&motion);
                for other in &around {
                    assert!(!overlap::boxes(&moved, &other.shape), "{} in {} at {step}", solid.name, other.name);
                }
            }
        }
    }
    let further = twin.furniture.iter().filter(|f| f.part.joint.upper > f.part.joint.observed + 0.02).count();
    assert!(2 * further > twin.furniture.len(), "{further} of {} open further than seen", twin.furniture.len());
}

#[test]
fn the_room_is_few_boxes_that_fill_no_air_and_lack_little() {
    // Without noise depth is the truth.
    let dir = tempfile::tempdir().unwrap();
    record(&SynthOptions { seed: 106, tier: Tier::Clean, width: 320, parts: 3 }, dir.path());
    let (recording, scene, twin) = twin_of(dir.path());
    let fit = room_fit::measure(&recording, &scene, &twin, &Config::default().fitting).unwrap();
    assert!(fit.surface_cells > 10_000, "{fit:?}");
    assert!(fit.room_boxes + fit.carcass_boxes < 60 && fit.blocked_openings == 0, "{fit:?}");
    // Of what is missing most is smaller than the smallest box.
    let [filled, missing] = [fit.filled(), fit.missing()].map(|share| share.expect("surface was seen"));
    assert!(filled < 0.02 && missing < 0.05, "{fit:?}");
}

#[test]
fn twice_the_noise_short_motions_and_vague_words_lose_few() {
    let report = report(104, Tier::Hard, 6);
    assert_eq!(report.false_positives, 0);
    let [m, ma, _] = shares(&report, Rule::UsdnetMaoSt);
    assert!(m >= 0.8 && ma >= 0.75, "{m} {ma}");
}

#[test]
fn with_noise_and_outliers_types_axes_and_hinges_hold() {
    for seed in [102, 103] {
        let report = report(seed, Tier::Realistic, 5);
        assert_eq!((report.answered, report.clips, report.false_positives), (10, 10, 0), "seed {seed}");
        let [m, ma, mao] = shares(&report, Rule::UsdnetMaoSt);
        assert!(m >= 0.9 && ma >= 0.9 && mao >= 0.9, "seed {seed}: {m} {ma} {mao}");
    }
}
