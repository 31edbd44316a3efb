//! Recorded motions of real doors, drawers and dishwashers, where they are at hand.

use paws_twin::articulation::JointKind;
use paws_twin::config::Config;
use paws_twin::inference::bare;
use paws_twin::math::{Vector, unsigned_angle};
use paws_twin::recording::trajectory;

use crate::common::optional_data;

#[derive(serde::Deserialize)]
struct Label {
    file: String,
    motion: JointKind,
    axis: Option<Vector>,
}

#[test]
fn the_type_and_axis_of_real_motions_follow_from_the_path_alone() {
    let Some(root) = optional_data("tum_articulation") else { return };
    let labels: Vec<Label> = paws_twin::json::read(&root.join("labels.json")).unwrap();
    assert!(labels.len() >= 38);
    for label in &labels {
        let path = trajectory::read(&root.join(&label.file)).unwrap();
        let outcome = bare::infer(&path, &Config::default().inference);
        let found = outcome.found().unwrap_or_else(|| panic!("{}: {:?}", label.file, outcome.reason()));
        assert_eq!(found.joint.kind, label.motion, "{}: {}", label.file, found.reason);
        if let Some(axis) = label.axis {
            let off = unsigned_angle(&found.joint.axis, &axis.normalize()).to_degrees();
            assert!(off <= 15.0, "{}: {off:.1} deg", label.file);
        }
    }
}
