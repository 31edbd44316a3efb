//! Equalities of an MJCF that hold a joint fast.

use std::collections::BTreeMap;

use super::mjcf_context::{Context, MAIN};
use super::mjcf_schema::place;
use super::xml::{Element, brief};
use super::{Model, Tree, mjcf};
use crate::articulation::JointKind;
use crate::math::{Point, Vector, unit};

/// A connection nearer to the hinge's line than this leaves the hinge free, metres.
const ON_AXIS_M: f64 = 1e-3;

/// Adds a fault for every joint that a constraint holds, and a note for each other constraint.
pub(super) fn read(c: &Context, root: &Element, model: &mut Model) {
    let switched_off = root
        .all("option")
        .flat_map(|o| o.all("flag"))
        .any(|f| ["equality", "constraint"].iter().any(|w| f.get(w) == Some("disable")));
    // Without a tree nothing is rigidly connected; that is a fault of its own.
    let Ok(tree) = model.tree() else { return };
    let mut children: Vec<Option<usize>> = vec![None; model.joints.len()];
    for (link, carrier) in tree.carrier.iter().enumerate() {
        if let Some(slot) = carrier.and_then(|joint| children.get_mut(joint)) {
            *slot = Some(link);
        }
    }
    let mut others: BTreeMap<String, usize> = BTreeMap::new();
    for element in root.all("equality").flat_map(|e| &e.children) {
        if switched_off || !is_active(c, element) {
            continue;
        }
        match held(element, model, &tree, &children) {
            Some(held) => {
                let at = place(&model.source, element);
                let fault = format!(
                    "{held}: {at} holds it fast; take the constraint away, or write active=\"false\" and switch it on \
                     where it is wanted"
                );
                model.faults.push((2, fault));
            }
            None => *others.entry(brief(&element.name)).or_default() += 1,
        }
    }
    for (name, count) in others {
        model.notes.push(format!("not read: {count} x <{name}> in <equality>: joints are taken to move by themselves"));
    }
}

fn is_active(c: &Context, element: &Element) -> bool {
    let class = c.classes.get(element.get("class").unwrap_or(MAIN)).and_then(|class| class.get("equality"));
    let active = element.get("active").or_else(|| class.and_then(|a| a.get("active")).map(String::as_str));
    active != Some("false")
}

/// The joint that a constraint holds, by name; `children` are the links that the joints move.
fn held(element: &Element, model: &Model, tree: &Tree, children: &[Option<usize>]) -> Option<String> {
    if element.name == "joint" {
        let name = element.get("joint1")?;
        // The position, or how it follows the other's: a polynomial, by default the same.
        let follows = element.get("joint2").is_some_and(|j| !j.is_empty());
        let factors = element.get("polycoef").unwrap_or("0 1 0 0 0");
        let moves = factors.split_ascii_whitespace().skip(1).any(|w| w.parse::<f64>().is_ok_and(|v| v != 0.0));
        let known = model.moving().any(|(_, j)| j.name == name);
        return (known && !(follows && moves)).then(|| name.to_owned());
    }
    if !["weld", "connect"].contains(&element.name.as_str()) {
        return None;
    }
    let (first, second) = ends(element, model)?;
    for (index, joint) in model.moving() {
        let Some(child) = children.get(index).copied().flatten() else { continue };
        let Some(parent) = tree.parent[child] else { continue };
        let bodies = (tree.body[first.link], tree.body[second.link]);
        let (moved, still) = (tree.body[child], tree.body[parent]);
        if bodies != (moved, still) && bodies != (still, moved) {
            continue;
        }
        // A point on the hinge's line may be held.
        let poses = model.poses(tree, &model.joints.iter().map(|j| j.start).collect::<Vec<_>>());
        let frame = poses[child];
        let held_at = poses[first.link] * first.point;
        let line = unit(&(frame.rotation * joint.axis));
        let off = line.map_or(0.0, |axis| (held_at - frame * joint.anchor).cross(&axis).norm());
        let free = element.name == "connect" && joint.moves() == Some(JointKind::Revolute) && off < ON_AXIS_M;
        if !free {
            return Some(joint.name.clone());
        }
    }
    None
}

/// One end of a constraint: a link, and a point of it, link frame, metres.
struct End {
    link: usize,
    point: Point,
}

/// The two ends of a weld or connection; the second is the world where it is not named.
fn ends(element: &Element, model: &Model) -> Option<(End, End)> {
    let anchor =
        element.numbers::<3>("anchor").ok().flatten().map_or(Point::origin(), |a| Point::from(Vector::from(a)));
    let body = |name: &str| {
        let link = model.links.iter().position(|l| l.name == name)?;
        Some(End { link, point: anchor })
    };
    let site = |name: &str| {
        let mut all = model.links.iter().enumerate();
        all.find_map(|(link, l)| l.sites.iter().find(|(n, _)| n == name).map(|(_, p)| End { link, point: *p }))
    };
    match (element.get("site1"), element.get("site2")) {
        (Some(a), Some(b)) => site(a).zip(site(b)),
        _ => body(element.get("body1")?).zip(body(element.get("body2").unwrap_or(mjcf::WORLD))),
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::super::xml;
    use super::*;

    #[test]
    fn a_joint_that_is_held_is_told_from_one_that_is_not() {
        for (constraint, held) in [
            ("<weld body1=\"leaf\" body2=\"frame\"/>", true),
            ("<weld body1=\"leaf\"/>", true),
            ("<weld body1=\"grip\" body2=\"frame\"/>", true),
            ("<weld site1=\"s\" site2=\"t\"/>", true),
            ("<weld body1=\"leaf\" body2=\"frame\" active=\"false\"/>", false),
            ("<weld body1=\"leaf\" body2=\"frame\" class=\"off\"/>", false),
            ("<weld body1=\"leaf\" body2=\"grip\"/>", false),
            ("<connect body1=\"leaf\" body2=\"frame\" anchor=\"0.5 0 0\"/>", true),
            ("<connect body1=\"leaf\" body2=\"frame\" anchor=\"0 0 1\"/>", false),
            ("<joint joint1=\"hinge\"/>", true),
            ("<joint joint1=\"hinge\" joint2=\"other\"/>", false),
            ("<joint joint1=\"hinge\" joint2=\"other\" polycoef=\"0.1 0 0 0 0\"/>", true),
            ("<tendon tendon1=\"x\"/>", false),
        ] {
            let text = format!(
                r#"<mujoco><default><default class="off"><equality active="false"/></default></default>
                <worldbody><body name="frame"><site name="t"/>
                  <body name="leaf"><joint name="hinge"/><geom size="0.1"/><body name="grip"><site name="s"/></body></body>
                  <body name="leaf2"><joint name="other"/><geom size="0.1"/></body></body></worldbody>
                <equality>{constraint}</equality></mujoco>"#
            );
            let root = xml::parse(Path::new("m.xml"), &text).unwrap();
            let model = mjcf::from_element(Path::new("m.xml"), root).unwrap();
            let found = model.faults.iter().any(|(point, f)| *point == 2 && f.starts_with("hinge: line 5, <"));
            assert_eq!(found, held, "{constraint}: {:?}", model.faults);
        }
    }
}
