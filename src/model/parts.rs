//! Whether moving parts are as large as furniture.

use std::collections::BTreeSet;

use super::check::{Said, plain};
use super::{Link, Model, Tree};
use crate::math::Vector;

/// A part that moves is not longer than a room, metres; longer ones are millimetres that were taken for metres.
const MAX_PART_M: f64 = 10.0;
/// What carries it is not longer than a hall, metres.
const MAX_BASE_M: f64 = 100.0;
/// No part is smaller than a key, metres; smaller ones were scaled twice.
const MIN_PART_M: f64 = 5e-3;
/// From here on neighbouring single-precision numbers are a millimetre apart, metres.
const MAX_REACH_M: f64 = 8192.0;

/// Adds what is wrong with the sizes and the places of parts.
pub(super) fn parts(said: &mut Said, model: &Model, tree: &Tree) {
    sizes(said, model, tree);
    let poses = model.poses(tree, &model.closed());
    let far = |pose: &crate::math::Pose| pose.translation.vector.amax();
    // What is not a number is far too.
    if let Some(i) = poses.iter().position(|p| far(p).is_nan() || far(p) > MAX_REACH_M) {
        said.fault(format!(
            "{}: stands {} m from the origin, where simulators with single precision have no millimetres",
            model.links[i].name,
            plain(far(&poses[i]))
        ));
    }
}

fn sizes(said: &mut Said, model: &Model, tree: &Tree) {
    let bodies: BTreeSet<usize> = (0..model.links.len())
        .filter(|i| tree.carrier[*i].is_some_and(|c| model.joints[c].moves().is_some()))
        .collect();
    let bases: BTreeSet<&str> = model.moving().map(|(_, j)| j.parent.as_str()).collect();
    for (i, link) in model.links.iter().enumerate() {
        let moves = bodies.contains(&tree.body[i]);
        // The world has floors of any size.
        let carries = bases.contains(link.name.as_str()) && link.name != super::mjcf::WORLD;
        let most = if moves { MAX_PART_M } else { MAX_BASE_M };
        let extent = extent(link);
        if (moves || carries) && extent > most {
            said.fault(format!(
                "{}: is {} m large; sizes are metres here, millimetres need scale=\"0.001 0.001 0.001\"",
                link.name,
                plain(extent)
            ));
        }
    }
    for body in bodies {
        let links = || (0..model.links.len()).filter(|i| tree.body[*i] == body).map(|i| &model.links[i]);
        let largest = links().map(extent).fold(0.0, f64::max);
        if largest > 0.0 && largest < MIN_PART_M && !links().any(|l| l.incomplete) {
            said.fault(format!(
                "{}: is only {:.2} mm large; sizes are metres here, look at the scale of its meshes",
                model.links[body].name,
                1000.0 * largest
            ));
        }
    }
}

/// The longest side of the box around a link's shapes, metres; 0 without shapes.
fn extent(link: &Link) -> f64 {
    let corners = link.shapes.iter().flat_map(|s| s.bounds.corners()).map(|p| p.coords);
    let ends = corners.fold(None, |ends: Option<[Vector; 2]>, p| {
        Some(ends.map_or([p, p], |[low, high]| [low.inf(&p), high.sup(&p)]))
    });
    ends.map_or(0.0, |[low, high]| (high - low).max())
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::super::{urdf, xml};
    use super::*;

    /// Faults of a door in a cabinet.
    fn faults(door: &str, origin: &str) -> Vec<String> {
        let text = format!(
            "<robot name=\"r\"><link name=\"world\"/><link name=\"door\">{door}</link><joint name=\"hinge\" type=\"revolute\">\
             <parent link=\"world\"/><child link=\"door\"/>{origin}</joint></robot>"
        );
        let path = Path::new("m.urdf");
        let model = urdf::from_element(path, &text, &xml::parse(path, &text).unwrap()).unwrap();
        let mut said = Said::default();
        parts(&mut said, &model, &model.tree().unwrap());
        said.faults
    }

    #[test]
    fn a_part_is_as_large_as_furniture() {
        let board = |tag: &str, width: &str| {
            format!("<{tag}><geometry><box size=\"{width} 0.02 {width}\"/></geometry></{tag}>")
        };
        assert!(faults(&board("collision", "0.6"), "").is_empty());
        for (found, word) in [
            (faults(&board("collision", "590"), ""), "millimetres"),
            (faults(&board("collision", "590").replace("0.02", "20"), ""), "is 590 m large"),
            (faults(&board("collision", "0.0006").replace("0.02", "0.00002"), ""), "only 0.60 mm"),
            (faults(&board("collision", "0.6"), "<origin xyz=\"1e200 0 0\"/>"), "stands 1e200 m"),
        ] {
            assert!(found.len() == 1 && found[0].contains(word), "{word}: {found:?}");
        }
    }
}
