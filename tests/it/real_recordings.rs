//! Rendered recordings of third-party furniture, where they are at hand.

use paws_twin::config::Config;
use paws_twin::evaluation::{Rule, Truth, evaluate, room_fit};
use paws_twin::report::files::predictions;

use crate::common::{optional_data, twin_of};

#[test]
fn every_clip_has_an_answer_or_a_reason_and_clean_and_realistic_ones_are_right() {
    let Some(root) = optional_data("recordings") else { return };
    for name in ["apartment_clean", "apartment_realistic", "apartment_hard"] {
        let dir = root.join(name);
        let (recording, scene, twin) = twin_of(&dir);
        for clip in &scene.clips {
            assert!(clip.joint.reason().is_none_or(|r| r.len() > 10), "{name} {}", clip.clip.clip);
        }
        let report = evaluate(&predictions(&scene, &twin), &[Truth::read(&dir).unwrap()]);
        let micro = report.rules.iter().find(|r| r.rule == Rule::Paws).unwrap().micro;
        eprintln!("{name}: M {:.2} MA {:.2} MAO {:.2} of {} clips", micro.m, micro.ma, micro.mao, report.clips);
        if name != "apartment_hard" {
            assert!(micro.m >= 0.9 && micro.ma >= 0.8, "{name}: {micro:?}");
        }
        assert_eq!(report.false_positives, 0, "{name}");
        // The room is few boxes that stand in no part's way, fill no air and lack next to nothing of what was seen.
        let fit = room_fit::measure(&recording, &scene, &twin, &Config::default().fitting).unwrap();
        eprintln!("{name}: {fit:?}");
        assert!(fit.room_boxes + fit.carcass_boxes < 60 && fit.blocked_openings == 0, "{name}: {fit:?}");
        if name != "apartment_hard" {
            let [filled, missing] = [fit.filled(), fit.missing()].map(|share| share.expect("surface was seen"));
            assert!(filled < 0.02 && missing < 0.02, "{name}: {fit:?}");
        }
    }
}
