//! What keeps joints from moving, or hands from moving them, though each of a file's numbers is sound.

use super::findings::Findings;
use super::links::{JointType, Link, Model, ModelFormat, ModelJoint, WORLD};
use super::tree::Tree;
use crate::math::plain;

/// Free joints that begin elsewhere than in the world.
pub(super) fn floating(said: &mut Findings, model: &Model, tree: Option<&Tree>) {
    // Unless it is told to keep links, MuJoCo melts what is fixed to a URDF's root into the world.
    let melts = matches!(model.format, ModelFormat::Urdf { keeps_links: false, .. });
    let root = tree.and_then(|t| t.order.first().map(|root| (&t.body, root)));
    let stands = |name: &str| {
        root.is_some_and(|(body, root)| model.links.iter().zip(body).any(|(l, b)| l.name == name && b == root))
    };
    let free = model.joints.iter().filter(|j| j.kind == JointType::Free && j.parent != WORLD);
    for joint in free.filter(|j| !(melts && stands(&j.parent))) {
        said.fault(format!(
            "{}: floats freely below {}; MuJoCo refuses free joints that do not begin in the world",
            joint.name, joint.parent
        ));
    }
}

/// Joints that are neither hinge nor slide.
pub(super) fn others(said: &mut Findings, model: &Model) {
    for joint in model.joints.iter().filter(|j| j.kind == JointType::Other) {
        said.tell(format!(
            "{}: moves in several directions at once (a ball or a plane): only hinges and slides are looked at",
            joint.name
        ));
    }
}

/// Limits that MuJoCo takes for none; whether they are such.
pub(super) fn unlimited(said: &mut Findings, model: &Model, joint: &ModelJoint, [lower, upper]: [f64; 2]) -> bool {
    // With limited="true" the file is refused, which is said elsewhere.
    let is = lower >= upper && joint.limited != Some(true) && matches!(model.format, ModelFormat::Mjcf { .. });
    if is {
        said.fault(format!(
            "{}: {} to {} is no range: MuJoCo lets the joint move without limits; write the smaller number first, or \
             make the joint fixed",
            joint.name,
            plain(lower),
            plain(upper)
        ));
    }
    is
}

/// A joint that begins elsewhere than at 0.
pub(super) fn begins(said: &mut Findings, joint: &ModelJoint) {
    if joint.start != 0.0 {
        said.tell(format!(
            "{}: begins at {} (ref), which MuJoCo reads and others do not; a body drawn at position 0 needs no ref",
            joint.name,
            plain(joint.start)
        ));
    }
}

/// Whether something of a part takes part in contacts; `inside` are its links.
pub(super) fn is_touched(model: &Model, inside: &[bool]) -> bool {
    let touches = |l: &Link| l.collides_as_mesh || l.shapes.iter().any(|s| !s.visual);
    model.links.iter().zip(inside).any(|(link, inside)| *inside && touches(link))
}

/// Parts that nothing can touch.
pub(super) fn untouchable(said: &mut Findings, model: &Model, tree: &Tree) {
    for (index, joint) in model.moving() {
        let inside = tree.beyond(index);
        let between = model.links.iter().any(|l| l.between && l.name == joint.child);
        if !between && !is_touched(model, &inside) {
            said.fault(format!(
                "{}: none of its part's shapes takes part in contacts: hands and things go through it; give it colliding \
                 boxes",
                joint.name
            ));
        }
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::super::{urdf, xml};
    use super::*;

    #[test]
    fn a_part_without_a_shape_that_collides_cannot_be_touched() {
        let faults = |shape: &str| {
            let text = format!(
                "<robot name=\"r\"><link name=\"world\"/><link name=\"door\">{shape}</link>\
                 <joint name=\"hinge\" type=\"revolute\"><parent link=\"world\"/><child link=\"door\"/></joint></robot>"
            );
            let path = Path::new("m.urdf");
            let model = urdf::from_element(path, &text, &xml::parse(path, &text).unwrap()).unwrap();
            let mut said = Findings::default();
            untouchable(&mut said, &model, &model.tree().unwrap());
            said.faults
        };
        let board = |tag: &str| format!("<{tag}><geometry><box size=\"0.6 0.02 0.6\"/></geometry></{tag}>");
        assert!(faults(&board("collision")).is_empty());
        for shape in [board("visual"), String::new()] {
            let found = faults(&shape);
            assert!(found.len() == 1 && found[0].contains("hinge: none of its part's shapes"), "{found:?}");
        }
    }
}
