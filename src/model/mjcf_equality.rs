//! Equalities of an MJCF that hold a joint fast.
//!
//! Of a weld or a connection the joints between its two ends are looked at where the file shows them: a joint that moves in
//! no motion that the constraint leaves is held.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::DMatrix;

use super::links::{JointType, Model, WORLD};
use super::mjcf_context::{Context, MAIN, switched_off};
use super::mjcf_schema::place;
use super::tree::Tree;
use super::xml::{Element, brief};
use crate::articulation::JointKind;
use crate::math::{Point, Pose, Vector, unit};

/// What a constraint leaves free to less than this counts as held, m or rad for each of the joint's: a connection nearer to
/// a hinge's line leaves the hinge free.
const LEAST_MOTION: f64 = 1e-3;

/// More joints between two bodies than furniture has are not looked at.
const MAX_JOINTS: usize = 64;

/// Keeps every joint that a constraint holds, with a fault, and a note for each other constraint.
pub(super) fn read(c: &Context, root: &Element, model: &mut Model) {
    let off = switched_off(root, &["equality", "constraint"]);
    // Without a tree nothing is rigidly connected; that is a fault of its own.
    let Ok(tree) = model.tree() else { return };
    let active: Vec<&Element> =
        root.all("equality").flat_map(|e| &e.children).filter(|element| !off && is_active(c, element)).collect();
    let (held, others) = sorted(&active, root, model, &tree);
    for (joint, why) in &held {
        let name = &model.joints[*joint].name;
        let fault = format!(
            "{name}: {why}; take the constraint away, or write active=\"false\" and switch it on where it is wanted"
        );
        model.faults.push((2, fault));
    }
    model.held = held;
    for (name, count) in others {
        model.notes.push(format!("not read: {count} x <{name}> in <equality>: joints are taken to move by themselves"));
    }
}

/// The joints that constraints hold, with what holds them, and how many constraints of each kind hold none.
fn sorted(
    active: &[&Element],
    root: &Element,
    model: &Model,
    tree: &Tree,
) -> (Vec<(usize, String)>, BTreeMap<String, usize>) {
    let mut ties = Ties::new(root, model, tree);
    let mut held = Vec::new();
    let mut others: BTreeMap<String, usize> = BTreeMap::new();
    for element in active {
        let joints = ties.held(element);
        if joints.is_empty() {
            *others.entry(brief(&element.name)).or_default() += 1;
        }
        let at = place(&model.source, element);
        held.extend(joints.into_iter().map(|joint| (joint, format!("{at} holds it fast"))));
    }
    (held, others)
}

fn is_active(c: &Context, element: &Element) -> bool {
    let class = c.classes.get(element.get("class").unwrap_or(MAIN)).and_then(|class| class.get("equality"));
    let active = element.get("active").or_else(|| class.and_then(|a| a.get("active")).map(String::as_str));
    active != Some("false")
}

/// A model where its file shows it.
struct Ties<'a> {
    root: &'a Element,
    model: &'a Model,
    tree: &'a Tree,
    /// For each joint the link that it moves.
    children: Vec<Option<usize>>,
    /// `world_from_link`; worked out where it is asked for.
    poses: Vec<Pose>,
    /// Bodies that are moved from outside.
    mocaps: BTreeSet<&'a str>,
}

impl<'a> Ties<'a> {
    fn new(root: &'a Element, model: &'a Model, tree: &'a Tree) -> Self {
        let mut children: Vec<Option<usize>> = vec![None; model.joints.len()];
        for (link, carrier) in tree.carrier.iter().enumerate() {
            if let Some(slot) = carrier.and_then(|joint| children.get_mut(joint)) {
                *slot = Some(link);
            }
        }
        let mut mocaps = BTreeSet::new();
        moved_from_outside(root, &mut mocaps);
        Self { root, model, tree, children, poses: Vec::new(), mocaps }
    }

    /// The joints that a constraint holds, by index.
    fn held(&mut self, element: &Element) -> Vec<usize> {
        match element.name.as_str() {
            "joint" => self.set(element).into_iter().collect(),
            "tendon" => self.wound(element).into_iter().collect(),
            "weld" | "connect" => self.tied(element).unwrap_or_default(),
            _ => Vec::new(),
        }
    }

    fn joint(&self, name: &str) -> Option<usize> {
        self.model.moving().find(|(_, j)| j.name == name).map(|(i, _)| i)
    }

    /// The joint whose position is set, or follows another's.
    fn set(&self, element: &Element) -> Option<usize> {
        // The position, or how it follows the other's: a polynomial, by default the same.
        let follows = element.get("joint2").is_some_and(|j| !j.is_empty()) && moves(element);
        self.joint(element.get("joint1")?).filter(|_| !follows)
    }

    /// The joint that alone makes the length of a tendon which is set.
    fn wound(&self, element: &Element) -> Option<usize> {
        if element.get("tendon2").is_some_and(|t| !t.is_empty()) && moves(element) {
            return None;
        }
        let name = element.get("tendon1")?;
        let tendon = self.root.all("tendon").flat_map(|t| t.all("fixed")).find(|t| t.get("name") == Some(name))?;
        let turns = |j: &&Element| j.number("coef").ok().flatten().is_some_and(|c| c != 0.0);
        let mut joints = tendon.all("joint").filter(turns);
        let (only, more) = (joints.next()?, joints.next());
        self.joint(only.get("joint")?).filter(|_| more.is_none())
    }

    /// The joints between two ends that are tied to each other; none where one of them is not known, or moved from outside.
    fn tied(&mut self, element: &Element) -> Option<Vec<usize>> {
        let (first, second) = ends(element, self.model)?;
        let outside = |end: &TiedPoint| self.mocaps.contains(self.model.links[end.link].name.as_str());
        if outside(&first) || outside(&second) {
            return None;
        }
        let joints = self.between(first.link, second.link)?;
        if joints.is_empty() || joints.len() > MAX_JOINTS {
            return None;
        }
        if self.poses.is_empty() {
            let begins: Vec<f64> = self.model.joints.iter().map(|j| j.start).collect();
            self.poses = self.model.poses(self.tree, &begins);
        }
        let point = self.poses[first.link] * first.point;
        let turns = element.name == "weld";
        // What each joint does to the tie: three rows of shifts, and of turns where these are tied, too.
        let mut motions = DMatrix::zeros(if turns { 6 } else { 3 }, joints.len());
        for (column, joint) in joints.iter().enumerate() {
            let (shift, turn) = self.motion(*joint, &point)?;
            for row in 0..3 {
                motions[(row, column)] = shift[row];
                if turns {
                    motions[(row + 3, column)] = turn[row];
                }
            }
        }
        let free = free(&motions)?;
        Some(joints.into_iter().zip(free).filter(|(_, free)| !free).map(|(joint, _)| joint).collect())
    }

    /// The hinges and slides on the way from one link to another; none where something else moves on it.
    fn between(&self, a: usize, b: usize) -> Option<Vec<usize>> {
        let above = |link: usize| {
            let (mut all, mut here) = (BTreeSet::new(), Some(link));
            while let Some(i) = here {
                all.extend(self.tree.carrier[i]);
                here = self.tree.parent[i];
            }
            all
        };
        let way: Vec<usize> = above(a).symmetric_difference(&above(b)).copied().collect();
        let elsewhere = |j: &usize| matches!(self.model.joints[*j].kind, JointType::Free | JointType::Other);
        if way.iter().any(elsewhere) {
            return None;
        }
        Some(way.into_iter().filter(|j| self.model.joints[*j].moves().is_some()).collect())
    }

    /// How a joint moves and turns what is at a point of the world, a radian or metre of it.
    fn motion(&self, joint: usize, point: &Point) -> Option<(Vector, Vector)> {
        let frame = self.poses[self.children[joint]?];
        let joint = &self.model.joints[joint];
        let axis = unit(&(frame.rotation * joint.axis))?;
        Some(match joint.moves()? {
            JointKind::Revolute => (axis.cross(&(point - frame * joint.anchor)), axis),
            JointKind::Prismatic => (axis, Vector::zeros()),
        })
    }
}

/// Names of bodies that are moved from outside.
fn moved_from_outside<'a>(element: &'a Element, names: &mut BTreeSet<&'a str>) {
    if element.get("mocap") == Some("true") {
        names.extend(element.get("name"));
    }
    element.children.iter().for_each(|c| moved_from_outside(c, names));
}

/// Whether a polynomial of a constraint is more than a number; without one it is the identity.
fn moves(element: &Element) -> bool {
    let factors = element.get("polycoef").unwrap_or("0 1 0 0 0");
    factors.split_ascii_whitespace().skip(1).any(|w| w.parse::<f64>().is_ok_and(|v| v != 0.0))
}

/// For each column whether it has a part in a combination of columns that is nothing; none where something lies so far away
/// that numbers do not tell.
fn free(columns: &DMatrix<f64>) -> Option<Vec<bool>> {
    const FAR_M: f64 = 1e6;
    if !columns.iter().all(|x| x.abs() < FAR_M) {
        return None;
    }
    // The squares of singular values are the eigenvalues of this; small ones belong to what stays free.
    let eigen = (columns.transpose() * columns).symmetric_eigen();
    let lost: Vec<usize> =
        (0..columns.ncols()).filter(|k| eigen.eigenvalues[*k] < LEAST_MOTION * LEAST_MOTION).collect();
    let moves = |column: usize| lost.iter().any(|k| eigen.eigenvectors[(column, *k)].abs() > LEAST_MOTION);
    Some((0..columns.ncols()).map(moves).collect())
}

/// One end of a constraint: a link, and a point of it, link frame, metres.
struct TiedPoint {
    link: usize,
    point: Point,
}

/// The two ends of a weld or connection; the second is the world where it is not named.
fn ends(element: &Element, model: &Model) -> Option<(TiedPoint, TiedPoint)> {
    let anchor =
        element.numbers::<3>("anchor").ok().flatten().map_or(Point::origin(), |a| Point::from(Vector::from(a)));
    let body = |name: &str| {
        let link = model.links.iter().position(|l| l.name == name)?;
        Some(TiedPoint { link, point: anchor })
    };
    let site = |name: &str| {
        let mut all = model.links.iter().enumerate();
        all.find_map(|(link, l)| l.sites.iter().find(|(n, _)| n == name).map(|(_, p)| TiedPoint { link, point: *p }))
    };
    match (element.get("site1"), element.get("site2")) {
        (Some(a), Some(b)) => site(a).zip(site(b)),
        _ => body(element.get("body1")?).zip(body(element.get("body2").unwrap_or(WORLD))),
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::super::{mjcf, xml};

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
            ("<tendon tendon1=\"rope\"/>", true),
            ("<tendon tendon1=\"both\"/>", false),
            ("<weld body1=\"hand\" body2=\"leaf\"/>", false),
            ("<weld body1=\"knob\" body2=\"frame\"/>", true),
            ("<connect body1=\"knob\" body2=\"frame\" anchor=\"0 0 0\"/>", true),
            ("<weld body1=\"leaf\" body2=\"leaf2\"/>", false),
            ("<weld body1=\"leaf\" body2=\"leaf3\"/>", true),
        ] {
            let text = format!(
                r#"<mujoco><default><default class="off"><equality active="false"/></default></default>
                <worldbody><body name="frame"><site name="t"/>
                  <body name="leaf"><joint name="hinge"/><geom size="0.1"/><body name="grip"><site name="s"/></body>
                    <body name="knob" pos="0.5 0 0"><joint name="turn" axis="0 1 0"/><geom size="0.1"/></body></body>
                  <body name="leaf3" pos="0.6 0 0"><joint name="third"/><geom size="0.1"/></body>
                  <body name="leaf2"><joint name="other"/><geom size="0.1"/></body></body>
                  <body name="hand" mocap="true"/></worldbody>
                <tendon><fixed name="rope"><joint joint="hinge" coef="2"/></fixed>
                  <fixed name="both"><joint joint="hinge" coef="2"/><joint joint="other" coef="1"/></fixed></tendon>
                <equality>{constraint}</equality></mujoco>"#
            );
            let root = xml::parse(Path::new("m.xml"), &text).unwrap();
            let model = mjcf::from_element(Path::new("m.xml"), root).unwrap();
            let found = model.faults.iter().any(|(point, f)| *point == 2 && f.starts_with("hinge: line 10, <"));
            assert_eq!(found, held, "{constraint}: {:?}", model.faults);
            let hinge = model.joints.iter().position(|j| j.name == "hinge").unwrap();
            assert_eq!(model.held.iter().any(|(joint, _)| *joint == hinge), held, "{constraint}");
        }
    }
}
