//! Whether moving parts are as large as furniture.

use std::collections::BTreeSet;

use super::findings::Findings;
use super::links::{Link, Model, Shape, WORLD};
use super::tree::Tree;
use crate::math::{Vector, plain, rounded};

/// A part that moves is not longer than a room, metres; longer ones are millimetres that were taken for metres.
const MAX_PART_M: f64 = 10.0;
/// What carries it is not longer than a hall, metres.
const MAX_BASE_M: f64 = 100.0;
/// No part is smaller than a key, metres; smaller ones were scaled twice.
const MIN_PART_M: f64 = 5e-3;
/// No box or mesh of a part is smaller than the head of a nail, metres.
const MIN_SHAPE_M: f64 = 3e-3;
/// A hinge or slide may be as far from its parent's origin as the parent reaches, times this, ...
const FAR_JOINT: f64 = 5.0;
/// ... and this far in any case, metres.
const NEAR_JOINT_M: f64 = 5.0;
/// From here on neighbouring single-precision numbers are a millimetre apart, metres.
const MAX_REACH_M: f64 = 8192.0;

/// Adds what is wrong with the sizes and the places of parts.
pub(super) fn parts(said: &mut Findings, model: &Model, tree: &Tree) {
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
        return;
    }
    origins(said, model, tree);
}

/// Joints that stand so far from what carries them that another unit was meant.
fn origins(said: &mut Findings, model: &Model, tree: &Tree) {
    for (index, joint) in model.moving() {
        let Some(child) = tree.carrier.iter().position(|c| *c == Some(index)) else { continue };
        let Some(parent) = tree.parent[child].and_then(|p| model.links.get(p)) else { continue };
        // As far as its shapes reach from the parent's origin; without shapes, as far as halls do.
        let corners = parent.shapes.iter().flat_map(|s| s.bounds.corners());
        let reach = corners.map(|p| p.coords.norm()).fold(0.0, f64::max);
        let is_known = !parent.shapes.is_empty() && !parent.incomplete;
        let most = if is_known { NEAR_JOINT_M.max(FAR_JOINT * reach) } else { MAX_BASE_M };
        let away = joint.parent_from_child.translation.vector.norm();
        if away > most {
            let size = if is_known { format!(", which reaches {} m", rounded(reach, 2)) } else { String::new() };
            said.fault(format!(
                "{}: stands {} m from the origin of {}{size}; positions are metres here: write {} millimetres as {}",
                joint.name,
                rounded(away, 2),
                parent.name,
                rounded(away, 0),
                rounded(1e-3 * away, 3)
            ));
        }
    }
}

fn sizes(said: &mut Findings, model: &Model, tree: &Tree) {
    let bodies: BTreeSet<usize> = (0..model.links.len())
        .filter(|i| tree.carrier[*i].is_some_and(|c| model.joints[c].moves().is_some()))
        .collect();
    let bases: BTreeSet<&str> = model.moving().map(|(_, j)| j.parent.as_str()).collect();
    for (i, link) in model.links.iter().enumerate() {
        let moves = bodies.contains(&tree.body[i]);
        // The world has floors of any size.
        let carries = bases.contains(link.name.as_str()) && link.name != WORLD;
        let most = if moves { MAX_PART_M } else { MAX_BASE_M };
        let extent = extent(&link.shapes);
        if (moves || carries) && extent > most {
            // Boxes have no scale.
            let is_mesh = largest(link).is_some_and(|s| s.is_mesh);
            let way_out = if is_mesh {
                "millimetres need scale=\"0.001 0.001 0.001\"".to_owned()
            } else {
                format!("write {} millimetres as {}", rounded(extent, 0), rounded(1e-3 * extent, 3))
            };
            said.fault(format!("{}: is {} m large; sizes are metres here, {way_out}", link.name, plain(extent)));
        }
    }
    for body in bodies {
        let links = || (0..model.links.len()).filter(|i| tree.body[*i] == body).map(|i| &model.links[i]);
        let largest = links().map(|l| extent(&l.shapes)).fold(0.0, f64::max);
        if largest > 0.0 && largest < MIN_PART_M && !links().any(|l| l.incomplete) {
            said.fault(format!(
                "{}: is only {:.2} mm large; sizes are metres here, look at the scale of its meshes",
                model.links[body].name,
                1000.0 * largest
            ));
            continue;
        }
        for link in links() {
            specks(said, link);
        }
    }
}

/// Boxes and meshes of a part that are too small to be any of its pieces, though others are not. Balls of that size are marks.
fn specks(said: &mut Findings, link: &Link) {
    let counts = |s: &Shape| s.is_mesh || (s.exact && !s.visual);
    for (i, shape) in link.shapes.iter().enumerate().filter(|(_, s)| counts(s)) {
        let size = 2.0 * shape.bounds.half.max();
        if size > 0.0 && size < MIN_SHAPE_M {
            let name = shape.name.clone().unwrap_or_else(|| format!("shape {}", i + 1));
            let what = if shape.is_mesh { "look at the scale of its mesh" } else { "look at its sizes" };
            said.fault(format!(
                "{}: {name} is only {:.2} mm large; sizes are metres here, {what}",
                link.name,
                1000.0 * size
            ));
        }
    }
}

/// The shape of a link with the longest side.
fn largest(link: &Link) -> Option<&Shape> {
    let size = |s: &Shape| s.bounds.half.amax();
    link.shapes.iter().max_by(|a, b| size(a).total_cmp(&size(b)))
}

/// The longest side of the box around shapes, metres; 0 without any.
fn extent(shapes: &[Shape]) -> f64 {
    let corners = shapes.iter().flat_map(|s| s.bounds.corners()).map(|p| p.coords);
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
        let mut said = Findings::default();
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
            (faults(&board("collision", "590"), ""), "write 590 millimetres as 0.590"),
            (
                faults(
                    &[board("collision", "0.00078"), board("collision", "0.1")].concat().replace("0.02", "0.0005"),
                    "",
                ),
                "shape 1 is only 0.78 mm large; sizes are metres here, look at its sizes",
            ),
            (
                faults(&board("collision", "0.6"), "<origin xyz=\"-300 0 500\"/>"),
                "stands 583.10 m from the origin of world",
            ),
            (faults(&board("collision", "590").replace("0.02", "20"), ""), "is 590 m large"),
            (faults(&board("collision", "0.0006").replace("0.02", "0.00002"), ""), "only 0.60 mm"),
            (faults(&board("collision", "0.6"), "<origin xyz=\"1e200 0 0\"/>"), "stands 1e200 m"),
        ] {
            assert!(found.len() == 1 && found[0].contains(word), "{word}: {found:?}");
        }
    }
}
