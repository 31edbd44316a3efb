//! How a model's links hang together, and where each of them is.

use std::collections::BTreeMap;

use super::links::{JointType, Model};
use crate::math::Pose;

/// How the links hang together; indices are those of [`Model::links`] and [`Model::joints`].
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Tree {
    /// Links, each after its parent.
    pub order: Vec<usize>,
    /// The joint that moves each link; `None` for the root.
    pub carrier: Vec<Option<usize>>,
    /// Each link's parent; `None` for the root.
    pub parent: Vec<Option<usize>>,
    /// For each link the one that stands for all that are rigidly connected with it: the nearest to the root.
    pub body: Vec<usize>,
}

impl Tree {
    /// For each link whether a joint moves it.
    #[must_use]
    pub fn beyond(&self, joint: usize) -> Vec<bool> {
        let mut inside = vec![false; self.carrier.len()];
        for &link in &self.order {
            inside[link] = self.carrier[link] == Some(joint) || self.parent[link].is_some_and(|p| inside[p]);
        }
        inside
    }
}

/// What hangs on what, as far as the joints tell; indices are those of [`Model::links`] and [`Model::joints`].
struct Hanging {
    /// The joint that moves each link.
    carrier: Vec<Option<usize>>,
    /// Each link's parent.
    parent: Vec<Option<usize>>,
    /// The links right below each link.
    children: Vec<Vec<usize>>,
}

impl Hanging {
    /// Follows every joint; what is wrong with one goes to `faults`.
    fn of(model: &Model, faults: &mut Vec<String>) -> Self {
        let count = model.links.len();
        let mut index: BTreeMap<&str, usize> = BTreeMap::new();
        for (i, link) in model.links.iter().enumerate() {
            if index.insert(&link.name, i).is_some() {
                faults.push(format!("two links are named {}: rename one", link.name));
            }
        }
        let mut out = Self { carrier: vec![None; count], parent: vec![None; count], children: vec![Vec::new(); count] };
        for (j, joint) in model.joints.iter().enumerate() {
            let mut end = |name: &str, what: &str| {
                let found = index.get(name).copied();
                if found.is_none() {
                    faults.push(format!("{}: its {what} link {name} does not exist", joint.name));
                }
                found
            };
            let (from, to) = (end(&joint.parent, "parent"), end(&joint.child, "child"));
            let (Some(from), Some(to)) = (from, to) else { continue };
            if let Some(other) = out.carrier[to].replace(j) {
                let other = &model.joints[other].name;
                faults.push(format!("{} is the child of two joints, {other} and {}", joint.child, joint.name));
            }
            out.parent[to] = Some(from);
            out.children[from].push(to);
        }
        out
    }
}

impl Model {
    /// The links as a tree.
    ///
    /// # Errors
    /// Everything that keeps them from being one, in words.
    pub fn tree(&self) -> Result<Tree, Vec<String>> {
        let count = self.links.len();
        let mut faults = Vec::new();
        let Hanging { carrier, parent, children } = Hanging::of(self, &mut faults);
        let roots: Vec<usize> = (0..count).filter(|i| carrier[*i].is_none()).collect();
        let mut order = Vec::with_capacity(count);
        match roots.as_slice() {
            [] if count == 0 => faults.push("there are no links".to_owned()),
            [] => faults.push("every link has a parent: the joints form a cycle".to_owned()),
            [root] => order.push(*root),
            several => faults.push(format!(
                "{} links have no parent ({}): connect all but one with joints",
                several.len(),
                self.some_names(several)
            )),
        }
        if !faults.is_empty() {
            return Err(faults);
        }
        let mut next = 0;
        while let Some(&link) = order.get(next) {
            order.extend(&children[link]);
            next += 1;
        }
        if order.len() < count {
            let mut reached = vec![false; count];
            order.iter().for_each(|i| reached[*i] = true);
            let lost: Vec<usize> = (0..count).filter(|i| !reached[*i]).collect();
            let names = self.some_names(&lost);
            return Err(vec![format!("{names} are not connected with the root: their joints form a cycle")]);
        }
        let mut body: Vec<usize> = (0..count).collect();
        for &link in &order {
            if let (Some(joint), Some(above)) = (carrier[link], parent[link])
                && self.joints[joint].kind == JointType::Fixed
            {
                body[link] = body[above];
            }
        }
        Ok(Tree { order, carrier, parent, body })
    }

    /// The names of links by index, the first few of many.
    fn some_names(&self, links: &[usize]) -> String {
        let shown: Vec<&str> = links.iter().take(5).map(|i| self.links[*i].name.as_str()).collect();
        let more = if links.len() > 5 { ", ..." } else { "" };
        format!("{}{more}", shown.join(", "))
    }

    /// `world_from_link` of every link; `positions` are those of the joints, rad or m.
    #[must_use]
    pub fn poses(&self, tree: &Tree, positions: &[f64]) -> Vec<Pose> {
        let mut poses = vec![Pose::identity(); self.links.len()];
        for &link in &tree.order {
            if let (Some(joint), Some(parent)) = (tree.carrier[link], tree.parent[link]) {
                let position = positions.get(joint).copied().unwrap_or(0.0);
                let joint = &self.joints[joint];
                poses[link] = poses[parent] * joint.parent_from_child * joint.motion(position);
            }
        }
        poses
    }
}

#[cfg(test)]
mod tests {
    use std::path::PathBuf;

    use super::super::links::{Link, ModelFormat, ModelJoint};
    use super::*;
    use crate::math::{Point, Vector};

    fn joint(name: &str, parent: &str, child: &str) -> ModelJoint {
        ModelJoint {
            name: name.to_owned(),
            kind: JointType::Revolute,
            parent: parent.to_owned(),
            child: child.to_owned(),
            parent_from_child: Pose::translation(1.0, 0.0, 0.0),
            axis: Vector::z() * 2.0,
            anchor: Point::origin(),
            lower: Some(-1.5),
            upper: Some(0.0),
            effort: None,
            velocity: None,
            damping: None,
            friction: None,
            armature: None,
            limited: None,
            start: 0.0,
        }
    }

    fn model(joints: Vec<ModelJoint>) -> Model {
        let link = |name: &str| Link::named(name.to_owned());
        Model {
            name: "m".to_owned(),
            source: PathBuf::from("m.urdf"),
            format: ModelFormat::Urdf { keeps_links: true, complaint: None, faults: Vec::new() },
            links: ["a", "b", "c"].map(link).to_vec(),
            joints,
            excludes: Vec::new(),
            notes: Vec::new(),
            unread: Vec::new(),
            held: Vec::new(),
            faults: Vec::new(),
        }
    }

    #[test]
    fn a_tree_is_told_from_what_is_none() {
        let chain = model(vec![joint("j", "a", "b"), joint("k", "b", "c")]);
        let tree = chain.tree().unwrap();
        assert_eq!((tree.order.as_slice(), tree.beyond(1)), ([0, 1, 2].as_slice(), vec![false, false, true]));
        // A quarter turn of the first joint carries the second link's frame around.
        let poses = chain.poses(&tree, &[std::f64::consts::FRAC_PI_2, 0.0]);
        assert!((poses[2].translation.vector - Vector::new(1.0, 1.0, 0.0)).norm() < 1e-12);
        assert_eq!(chain.closed(), [0.0, 0.0]);
        for (joints, word) in [
            (vec![joint("j", "a", "b")], "2 links have no parent (a, c)"),
            (vec![joint("j", "a", "b"), joint("k", "d", "c")], "parent link d does not exist"),
            (vec![joint("j", "b", "c"), joint("k", "c", "b")], "form a cycle"),
            (vec![joint("j", "a", "b"), joint("k", "a", "c"), joint("l", "b", "c")], "child of two joints"),
        ] {
            let faults = model(joints).tree().unwrap_err();
            assert!(faults.iter().any(|f| f.contains(word)), "{faults:?}");
        }
    }
}
