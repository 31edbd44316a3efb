//! Anybody's URDF or MJCF as plain data: links, joints, boxes. Readers, the points of "simulation-ready" that need no
//! simulator ([`check`]), and the way to a [`crate::twin::Twin`] ([`furniture::to_twin`]).
//!
//! A link's frame is the one that its file gives it; a joint's `parent_from_child` is the pose at position 0. What a
//! reader passes over is listed in [`Model::notes`].

pub mod check;
mod contacts;
pub mod furniture;
pub mod glb;
mod gltf_extensions;
mod gltf_file;
mod kinds;
mod limits;
mod masses;
mod mesh;
pub mod mjcf;
mod mjcf_assets;
mod mjcf_context;
mod mjcf_equality;
mod mjcf_geoms;
mod mjcf_refusals;
mod mjcf_schema;
mod mjcf_tree;
mod mjcf_values;
mod parts;
mod places;
mod rigid_bodies;
mod shapes;
mod sweep;
mod traps;
pub mod urdf;
mod urdf_geometry;
mod weights;
mod xml;

pub use kinds::is_gltf;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use nalgebra::Matrix3;

use crate::articulation::{Articulation, JointKind};
use crate::error::{Error, Result};
use crate::math::{Point, Pose, Vector, unit};
use crate::twin::OrientedBox;

/// The file that a model comes from, with what only its format has.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Format {
    /// URDF.
    Urdf {
        /// Whether the file tells MuJoCo to keep fixed links and visuals.
        keeps_links: bool,
        /// Why `urdf-rs` does not read the file, where it does not.
        complaint: Option<String>,
        /// What else simulators refuse or complain about, with their names.
        faults: Vec<String>,
    },
    /// MJCF.
    Mjcf {
        /// Whether `<compiler angle="radian">` is written, or no angle is; the format's default are degrees.
        radian: bool,
    },
}

/// A model: a tree of links, as far as its file is sound ([`Model::tree`] tells).
#[derive(Debug, Clone, PartialEq)]
pub struct Model {
    /// Name in the file, or the file's own.
    pub name: String,
    /// The file.
    pub source: PathBuf,
    /// Its format.
    pub format: Format,
    /// Links in the file's order; an MJCF model begins with `world`.
    pub links: Vec<Link>,
    /// Joints in the file's order, fixed ones included.
    pub joints: Vec<ModelJoint>,
    /// Pairs of links that may touch without a contact (MJCF).
    pub excludes: Vec<[String; 2]>,
    /// What was not read, or read as something simpler.
    pub notes: Vec<String>,
    /// What may hide joints or shapes and was not read: verdicts about the whole are not to be had.
    pub unread: Vec<String>,
    /// What the file's reader found wrong: the number of a point of [`check::POINTS`], and words.
    pub faults: Vec<(u8, String)>,
}

/// Where a link's mass comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MassSource {
    /// It is written with the link.
    Stated,
    /// From masses or densities that are written with its shapes.
    Shapes,
    /// At least one shape has neither: MuJoCo takes 1000 kg/m^3.
    Assumed,
    /// There is none.
    Nothing,
}

/// A rigid body.
#[derive(Debug, Clone, PartialEq)]
pub struct Link {
    /// Name.
    pub name: String,
    /// kg; `None` where nothing tells, or only a mesh would.
    pub mass: Option<f64>,
    /// Where the mass comes from.
    pub mass_source: MassSource,
    /// Centre of mass, link frame, metres.
    pub center: Point,
    /// About the centre, in the link's axes, kg m^2.
    pub inertia: Matrix3<f64>,
    /// Boxes, and boxes around whatever is no box.
    pub shapes: Vec<Shape>,
    /// Files of meshes that the link is made of.
    pub meshes: Vec<String>,
    /// Whether one of the meshes takes part in contacts.
    pub collides_as_mesh: bool,
    /// Whether one of the meshes could not be measured: the boxes are not the whole link then.
    pub incomplete: bool,
    /// Named points, link frame, metres (MJCF).
    pub sites: Vec<(String, Point)>,
    /// Stands between two joints of one MJCF body and has no mass of its own.
    pub between: bool,
}

impl Link {
    /// A link of which no more is known than its name.
    #[must_use]
    pub fn named(name: String) -> Self {
        Self {
            name,
            mass: None,
            mass_source: MassSource::Nothing,
            center: Point::origin(),
            inertia: Matrix3::zeros(),
            shapes: Vec::new(),
            meshes: Vec::new(),
            collides_as_mesh: false,
            incomplete: false,
            sites: Vec::new(),
            between: false,
        }
    }
}

/// A box of a link.
#[derive(Debug, Clone, PartialEq)]
pub struct Shape {
    /// Name; many files have none.
    pub name: Option<String>,
    /// Link frame.
    pub bounds: OrientedBox,
    /// Whether the shape is this box (true) or only lies in it.
    pub exact: bool,
    /// Only seen: it touches nothing.
    pub visual: bool,
    /// MuJoCo's `contype` and `conaffinity`; `[1, 1]` in URDF.
    pub masks: [u32; 2],
}

impl Shape {
    /// Whether two shapes can touch at all.
    #[must_use]
    pub fn meets(&self, other: &Self) -> bool {
        let [a, b] = [self.masks, other.masks];
        !self.visual && !other.visual && (a[0] & b[1] != 0 || b[0] & a[1] != 0)
    }
}

/// What a joint allows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// Nothing.
    Fixed,
    /// Rotation about its axis.
    Revolute,
    /// The same without limits.
    Continuous,
    /// Translation along its axis.
    Prismatic,
    /// Everything.
    Free,
    /// Something else: a ball, a plane.
    Other,
}

/// A joint. Values that its file does not have are `None`.
#[derive(Debug, Clone, PartialEq)]
pub struct ModelJoint {
    /// Name.
    pub name: String,
    /// What it allows.
    pub kind: Kind,
    /// Name of the link that carries it.
    pub parent: String,
    /// Name of the link that it moves.
    pub child: String,
    /// Pose of the child's frame at position 0.
    pub parent_from_child: Pose,
    /// Axis in the child's frame as written, of any length.
    pub axis: Vector,
    /// A point on the axis, child's frame, metres.
    pub anchor: Point,
    /// Lower limit, rad or m.
    pub lower: Option<f64>,
    /// Upper limit, rad or m.
    pub upper: Option<f64>,
    /// Largest force or torque, N or N m.
    pub effort: Option<f64>,
    /// Largest velocity, m/s or rad/s.
    pub velocity: Option<f64>,
    /// Viscous damping, N s/m or N m s/rad.
    pub damping: Option<f64>,
    /// Dry friction, N or N m.
    pub friction: Option<f64>,
    /// Inertia that the joint adds, kg or kg m^2 (MJCF).
    pub armature: Option<f64>,
    /// What `limited` says where it is written (MJCF).
    pub limited: Option<bool>,
    /// The position that simulators begin at and the file shows, rad or m: MJCF's `ref`, else 0.
    pub start: f64,
}

/// How far a joint without limits is taken to open: half a turn, rad, or a long drawer, m.
const UNLIMITED: [f64; 2] = [std::f64::consts::PI, 1.0];

impl ModelJoint {
    /// Its type where it has one degree of freedom.
    #[must_use]
    pub fn moves(&self) -> Option<JointKind> {
        match self.kind {
            Kind::Revolute | Kind::Continuous => Some(JointKind::Revolute),
            Kind::Prismatic => Some(JointKind::Prismatic),
            Kind::Fixed | Kind::Free | Kind::Other => None,
        }
    }

    /// Both limits, where there are both and they are in order.
    #[must_use]
    pub fn limits(&self) -> Option<[f64; 2]> {
        let (lower, upper) = (self.lower?, self.upper?);
        (lower < upper).then_some([lower, upper])
    }

    /// Closed and open position, rad or m: the limit nearest to 0 and the other one; where there are no limits, where
    /// the file shows the joint, and half a turn or a metre from there.
    #[must_use]
    pub fn closed_and_open(&self) -> [f64; 2] {
        match self.limits() {
            Some([lower, upper]) if lower.abs() <= upper.abs() => [lower, upper],
            Some([lower, upper]) => [upper, lower],
            None => [self.start, self.start + UNLIMITED[usize::from(self.kind == Kind::Prismatic)]],
        }
    }

    /// The pose `child_at_0_from_child` at a position (rad or m); none where the axis has no direction.
    #[must_use]
    pub fn motion(&self, position: f64) -> Pose {
        match (self.moves(), unit(&self.axis)) {
            (Some(kind), Some(axis)) => Articulation { kind, axis, origin: self.anchor }.motion(position),
            _ => Pose::identity(),
        }
    }
}

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

impl Model {
    /// The links as a tree.
    ///
    /// # Errors
    /// Everything that keeps them from being one, in words.
    pub fn tree(&self) -> std::result::Result<Tree, Vec<String>> {
        let count = self.links.len();
        let mut faults = Vec::new();
        let mut index: BTreeMap<&str, usize> = BTreeMap::new();
        for (i, link) in self.links.iter().enumerate() {
            if index.insert(&link.name, i).is_some() {
                faults.push(format!("two links are named {}: rename one", link.name));
            }
        }
        let mut carrier = vec![None; count];
        let mut parent = vec![None; count];
        let mut children: Vec<Vec<usize>> = vec![Vec::new(); count];
        for (j, joint) in self.joints.iter().enumerate() {
            let mut end = |name: &str, what: &str| {
                let found = index.get(name).copied();
                if found.is_none() {
                    faults.push(format!("{}: its {what} link {name} does not exist", joint.name));
                }
                found
            };
            let (from, to) = (end(&joint.parent, "parent"), end(&joint.child, "child"));
            let (Some(from), Some(to)) = (from, to) else { continue };
            if let Some(other) = carrier[to].replace(j) {
                let other = &self.joints[other].name;
                faults.push(format!("{} is the child of two joints, {other} and {}", joint.child, joint.name));
            }
            parent[to] = Some(from);
            children[from].push(to);
        }
        let roots: Vec<usize> = (0..count).filter(|i| carrier[*i].is_none()).collect();
        let names = |of: &[usize]| {
            let shown: Vec<&str> = of.iter().take(5).map(|i| self.links[*i].name.as_str()).collect();
            let more = if of.len() > 5 { ", ..." } else { "" };
            format!("{}{more}", shown.join(", "))
        };
        let mut order = Vec::with_capacity(count);
        match roots.as_slice() {
            [] if count == 0 => faults.push("there are no links".to_owned()),
            [] => faults.push("every link has a parent: the joints form a cycle".to_owned()),
            [root] => order.push(*root),
            several => faults.push(format!(
                "{} links have no parent ({}): connect all but one with joints",
                several.len(),
                names(several)
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
            return Err(vec![format!("{} are not connected with the root: their joints form a cycle", names(&lost))]);
        }
        let mut body: Vec<usize> = (0..count).collect();
        for &link in &order {
            if let (Some(joint), Some(above)) = (carrier[link], parent[link])
                && self.joints[joint].kind == Kind::Fixed
            {
                body[link] = body[above];
            }
        }
        Ok(Tree { order, carrier, parent, body })
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

    /// The joints' closed positions, rad or m; 0 for those that do not move.
    #[must_use]
    pub fn closed(&self) -> Vec<f64> {
        self.joints.iter().map(|j| if j.moves().is_some() { j.closed_and_open()[0] } else { 0.0 }).collect()
    }

    /// Joints of one degree of freedom, by index.
    pub fn moving(&self) -> impl Iterator<Item = (usize, &ModelJoint)> {
        self.joints.iter().enumerate().filter(|(_, j)| j.moves().is_some())
    }
}

/// Reads a URDF or MJCF file, whichever it is.
///
/// # Errors
/// Where it cannot be read, is neither of the two, or holds what no model can.
pub fn read(path: &Path) -> Result<Model> {
    if let Some(found) = kinds::foreign(path, &kinds::head(path)) {
        return Err(Error::format(path, "file", format!("{found}; {}", kinds::WANTED)));
    }
    let text = xml::read_text(path)?;
    let root = xml::parse(path, &text)?;
    if root.name == "mujoco" {
        return mjcf::from_element(path, root);
    }
    if root.name == "robot" {
        return urdf::from_element(path, &text, &root);
    }
    let place = format!("line {}", root.line);
    Err(Error::format(path, place, format!("{}; {}", kinds::foreign_root(&root.name), kinds::WANTED)))
}

/// Name of an XML file's first element.
///
/// # Errors
/// Where the file cannot be read or has none.
pub fn root_name(path: &Path) -> Result<String> {
    xml::root_name(path, &xml::read_text(path)?)
}

/// Whole kitchens have hundreds of links.
const MAX_LINKS: usize = 10_000;

/// Refuses more links than any furniture has.
fn bounded(model: &Model) -> Result<()> {
    if model.links.len() > MAX_LINKS {
        let message = format!("{} links, more than {MAX_LINKS}; split the scene", model.links.len());
        return Err(Error::format(&model.source, "whole file", message));
    }
    Ok(())
}

/// The model's name, else the file's.
fn named(name: Option<&str>, path: &Path) -> String {
    match name.filter(|n| !n.trim().is_empty()) {
        Some(name) => name.to_owned(),
        None => path.file_stem().map_or_else(|| "model".to_owned(), |s| s.to_string_lossy().into_owned()),
    }
}

/// How deep two boxes stand in each other, metres: the shortest way apart, along one of the directions that can separate
/// boxes (faces and pairs of edges). Not positive where they are apart.
#[must_use]
pub fn penetration(a: &OrientedBox, b: &OrientedBox) -> f64 {
    let between = b.center - a.center;
    let axes = |o: &OrientedBox| [0, 1, 2].map(|i| o.rotation.column(i).into_owned());
    let (axes_a, axes_b) = (axes(a), axes(b));
    let reach =
        |half: &Vector, axes: &[Vector; 3], n: &Vector| -> f64 { (0..3).map(|i| half[i] * axes[i].dot(n).abs()).sum() };
    let overlap = |n: &Vector| reach(&a.half, &axes_a, n) + reach(&b.half, &axes_b, n) - between.dot(n).abs();
    let mut least = f64::INFINITY;
    for n in axes_a.iter().chain(&axes_b) {
        least = least.min(overlap(n));
    }
    for u in &axes_a {
        for v in &axes_b {
            let n = u.cross(v);
            // Parallel edges add no direction to the faces'.
            if n.norm() > 1e-6 {
                least = least.min(overlap(&n.normalize()));
            }
        }
    }
    least
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::rotation;

    fn cube(x: f64, angle: f64) -> OrientedBox {
        let turn = rotation(&Vector::new(1.0, 0.0, 1.0).normalize(), angle);
        OrientedBox {
            center: Point::new(x, 0.0, 0.0),
            half: Vector::repeat(0.5),
            rotation: *turn.to_rotation_matrix().matrix(),
        }
    }

    #[test]
    fn penetration_is_the_shortest_way_apart() {
        assert!((penetration(&cube(0.0, 0.0), &cube(0.9, 0.0)) - 0.1).abs() < 1e-12);
        assert!((penetration(&cube(0.0, 0.0), &cube(1.25, 0.0)) + 0.25).abs() < 1e-12);
        // A corner reaches farther than a face, and whoever is asked first.
        let (a, b) = (cube(0.0, 0.0), cube(1.1, 0.8));
        assert!(penetration(&a, &b) > 0.0);
        assert!((penetration(&a, &b) - penetration(&b, &a)).abs() < 1e-12);
    }

    fn joint(name: &str, parent: &str, child: &str) -> ModelJoint {
        ModelJoint {
            name: name.to_owned(),
            kind: Kind::Revolute,
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
            format: Format::Urdf { keeps_links: true, complaint: None, faults: Vec::new() },
            links: ["a", "b", "c"].map(link).to_vec(),
            joints,
            excludes: Vec::new(),
            notes: Vec::new(),
            unread: Vec::new(),
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
