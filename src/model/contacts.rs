//! Which contacts between links a file switches off, as MuJoCo applies it.

use std::collections::{BTreeMap, BTreeSet};

use super::links::{Model, ModelFormat};
use super::tree::Tree;

/// The contacts of a model that its file switches off.
pub(super) struct Contacts<'a> {
    tree: &'a Tree,
    /// Pairs of links, the smaller index first.
    excluded: BTreeSet<(usize, usize)>,
    /// For each link the rigid body that carries its own; none where only the world does, or outside MJCF.
    carrier: Vec<Option<usize>>,
}

impl<'a> Contacts<'a> {
    /// What holds for a model whose links are a tree.
    pub(super) fn of(model: &Model, tree: &'a Tree) -> Self {
        let index: BTreeMap<&str, usize> = model.links.iter().enumerate().map(|(i, l)| (l.name.as_str(), i)).collect();
        let find = |name: &str| index.get(name).copied();
        let excluded = model
            .excludes
            .iter()
            .filter_map(|[a, b]| find(a).zip(find(b)))
            .map(|(a, b)| (a.min(b), a.max(b)))
            .collect();
        let is_mjcf = matches!(model.format, ModelFormat::Mjcf { .. });
        let ground = tree.order.first().copied();
        let carrier = |link: usize| {
            let mut above = tree.parent[tree.body[link]]?;
            // Links between the joints of one body are no bodies.
            while model.links[above].between {
                above = tree.parent[above]?;
            }
            Some(tree.body[above]).filter(|body| Some(*body) != ground)
        };
        let carrier = (0..model.links.len()).map(|l| if is_mjcf { carrier(l) } else { None }).collect();
        Self { tree, excluded, carrier }
    }

    /// Pairs of links that the file excludes, the smaller index first.
    pub(super) fn excluded_pairs(&self) -> BTreeSet<[usize; 2]> {
        self.excluded.iter().map(|&(a, b)| [a, b]).collect()
    }

    /// Pairs of rigid bodies, the smaller index first, of which one carries the other and is not fixed to the world.
    pub(super) fn families(&self) -> BTreeSet<[usize; 2]> {
        let carried = self.tree.body.iter().zip(&self.carrier);
        carried.filter_map(|(&body, carrier)| carrier.map(|c| [body.min(c), body.max(c)])).collect()
    }

    /// Whether two links never touch: the pair is excluded, or one body carries the other and is not fixed to the world.
    /// What is rigidly connected is one body for this, but not for the excluded pairs.
    pub(super) fn off(&self, a: usize, b: usize) -> bool {
        let (body_a, body_b) = (self.tree.body[a], self.tree.body[b]);
        self.excluded.contains(&(a.min(b), a.max(b)))
            || self.carrier[a] == Some(body_b)
            || self.carrier[b] == Some(body_a)
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::super::{mjcf, xml};
    use super::*;

    #[test]
    fn pairs_are_left_out_as_mujoco_does() {
        let text = r#"<mujoco><worldbody><body name="cabinet"><body name="front"/>
            <body name="door"><joint name="a"/><joint name="b" type="slide"/><geom size="0.1"/><body name="grip"/>
              <body name="knob"><joint name="c"/><geom size="0.1"/></body></body></body></worldbody>
            <contact><exclude body1="door" body2="cabinet"/><exclude body1="front" body2="knob"/></contact></mujoco>"#;
        let root = xml::parse(Path::new("m.xml"), text).unwrap();
        let model = mjcf::from_element(Path::new("m.xml"), root).unwrap();
        let tree = model.tree().unwrap();
        let contacts = Contacts::of(&model, &tree);
        let at = |name: &str| model.links.iter().position(|l| l.name == name).unwrap();
        for (a, b, off) in [
            ("cabinet", "door", true),
            // An exclude names bodies, not what is fixed to them.
            ("front", "door", false),
            ("front", "knob", true),
            // Parent and child, also of what is fixed to the parent; not where the parent stands in the world.
            ("door", "knob", true),
            ("grip", "knob", true),
            ("cabinet", "knob", false),
            ("cabinet", "grip", false),
        ] {
            assert_eq!((contacts.off(at(a), at(b)), contacts.off(at(b), at(a))), (off, off), "{a} {b}");
        }
    }
}
