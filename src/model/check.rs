//! What "simulation-ready" means, as far as a file alone can tell: the static points, numbered and named as in
//! `tests/simulators/definition.py`, which asks the rest of every simulator.
//!
//! A fault is something that at least one simulator gets wrong or refuses; what is only worth knowing is told beside it.

use std::collections::{BTreeMap, BTreeSet};

use serde::Serialize;

use super::findings::Findings;
use super::glb::GltfScene;
use super::joint_limits::limits;
use super::links::{JointType, Model, ModelFormat, Shape, WORLD};
use super::masses::masses;
use super::part_sizes::parts;
use super::places::{animations, places, same_places};
use super::rigid_bodies;
use super::sweep::sweep;
use super::traps;
use super::tree::Tree;
use crate::math;
use crate::twin::Twin;

/// What a file says to a point of the definition.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum PointVerdict {
    /// It holds.
    Pass,
    /// It does not.
    Fail,
    /// The file has nothing that the point is about.
    NotApplicable,
    /// Something that the point is about was not read: nothing speaks against it, and nothing for it.
    #[serde(rename = "not judged")]
    NotJudged,
}

/// A point of the definition, and what a file says to it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct CheckedPoint {
    /// Its number in the definition.
    pub id: u8,
    /// Its words.
    pub title: &'static str,
    /// The verdict.
    pub verdict: PointVerdict,
    /// What is wrong, each with the way out.
    pub faults: Vec<String>,
    /// What is worth knowing and no fault.
    pub told: Vec<String>,
}

/// The static points.
pub const POINTS: [(u8, &str); 9] = [
    (1, "loads without a word"),
    (2, "limits: closed at 0, positive opens, a part stays in its furniture"),
    (3, "masses, centres, inertias of the boxes"),
    (4, "fixed base, nothing lost"),
    (5, "a box per board, safe names, handles"),
    (6, "MJCF: radians, limited, excludes, visual geoms that do not collide"),
    (7, "glTF: validator, pivots, animations, +Y up"),
    (9, "handles closed, half, open in the same place in all files"),
    (11, "sweep: no penetration over each range, a millimetre free when closed"),
];

fn points(mut said: BTreeMap<u8, Findings>) -> Vec<CheckedPoint> {
    POINTS
        .into_iter()
        .map(|(id, title)| {
            let Findings { concerned, unjudged, faults, told } = said.remove(&id).unwrap_or_default();
            let verdict = match (faults.is_empty(), unjudged, concerned) {
                (false, ..) => PointVerdict::Fail,
                (true, true, _) => PointVerdict::NotJudged,
                (true, false, true) => PointVerdict::Pass,
                (true, false, false) => PointVerdict::NotApplicable,
            };
            CheckedPoint { id, title, verdict, faults, told }
        })
        .collect()
}

/// All points about a URDF or MJCF model; `twin` is the model that the file was written from, where there is one.
#[must_use]
pub fn model(model: &Model, twin: Option<&Twin>) -> Vec<CheckedPoint> {
    let (tree, broken) = match model.tree() {
        Ok(tree) => (Some(tree), Vec::new()),
        Err(faults) => (None, faults),
    };
    let mut said = BTreeMap::from([
        (1, loads(model, tree.as_ref(), broken)),
        (2, limits(model, tree.as_ref())),
        (3, masses(model, tree.as_ref(), twin)),
        (5, names(model, tree.as_ref())),
        (6, mjcf(model)),
    ]);
    if let Some(tree) = &tree {
        said.insert(4, base(model, tree));
        said.insert(11, sweep(model, tree));
        if let Some(twin) = twin {
            said.insert(9, same_places(twin, &places(model, tree)));
        }
    }
    for (point, fault) in &model.faults {
        said.entry(*point).or_default().fault(fault.clone());
    }
    if !model.unread.is_empty() {
        // The points about joints and shapes; and what is not read may be what a simulator refuses.
        for point in [1, 2, 3, 4, 5, 9, 11] {
            if let Some(said) = said.get_mut(&point) {
                said.unjudged = true;
            }
        }
    }
    points(said)
}

/// All points about a glTF scene; `twin` is the model that the file was written from, where there is one.
#[must_use]
pub fn scene(scene: &GltfScene, twin: Option<&Twin>) -> Vec<CheckedPoint> {
    let there = |missing: &String| format!("{missing}; viewers refuse the file, or show it without");
    let loads = Findings {
        concerned: true,
        unjudged: !scene.unread.is_empty(),
        faults: scene.missing.iter().map(there).collect(),
        told: scene.unread.clone(),
    };
    let mut said = BTreeMap::from([(1, loads), (2, rigid_bodies::limits(&scene.joints)), (7, animations(scene, twin))]);
    // A file for physics engines must not be animated; what moves in it is not told by where its nodes are.
    if let Some(twin) = twin.filter(|_| !scene.is_physics) {
        said.insert(9, same_places(twin, &scene.places));
    }
    points(said)
}

fn loads(model: &Model, tree: Option<&Tree>, broken: Vec<String>) -> Findings {
    let mut said = Findings { concerned: true, faults: broken, ..Findings::default() };
    if let ModelFormat::Urdf { complaint, faults, .. } = &model.format {
        said.faults.extend(faults.iter().cloned());
        if let Some(complaint) = complaint {
            said.fault(format!("urdf-rs, and whoever reads with it, refuses the file: {complaint}"));
        }
    }
    traps::floating(&mut said, model, tree);
    said
}

fn base(model: &Model, tree: &Tree) -> Findings {
    let mut said = Findings::about(true);
    if let (ModelFormat::Urdf { keeps_links, .. }, Some(root)) = (&model.format, tree.order.first()) {
        let root = &model.links[*root].name;
        if root != WORLD {
            said.fault(format!(
                "nothing holds {root}: Drake and others let it fall; add <link name=\"world\"/> and a fixed joint from it to {root}"
            ));
        }
        if !keeps_links {
            said.fault(
                "MuJoCo melts fixed links into the world and drops visuals; add <mujoco><compiler fusestatic=\"false\" \
                 discardvisual=\"false\"/></mujoco>"
                    .to_owned(),
            );
        }
    }
    let mut loose = BTreeSet::new();
    for (index, _) in model.moving() {
        let mut link = tree.carrier.iter().position(|c| *c == Some(index));
        while let Some(i) = link {
            if let Some(carrier) = tree.carrier[i].filter(|c| model.joints[*c].kind == JointType::Free) {
                loose.insert(model.joints[carrier].child.as_str());
            }
            link = tree.parent[i];
        }
    }
    for name in loose {
        said.fault(format!("{name} carries moving parts and floats: take its free joint away, or fix it"));
    }
    said
}

/// A few of many, for a message.
fn some(names: &BTreeSet<String>) -> String {
    let shown: Vec<String> = names.iter().take(5).map(|n| format!("\"{}\"", super::xml::brief(n))).collect();
    let more = names.len().saturating_sub(shown.len());
    if more == 0 { shown.join(", ") } else { format!("{} and {more} more", shown.join(", ")) }
}

/// Point 5: safe names, boxes that can be touched, parts as large as furniture, handles.
fn names(model: &Model, tree: Option<&Tree>) -> Findings {
    let mut said = Findings::about(true);
    name_faults(&mut said, &all_names(model));
    for link in model.links.iter().filter(|l| l.collides_as_mesh) {
        said.tell(format!(
            "{}: collides as a mesh, that is as the mesh's convex hull in most simulators; a hollow part needs a box per board",
            link.name
        ));
    }
    let Some(tree) = tree else { return said };
    traps::untouchable(&mut said, model, tree);
    parts(&mut said, model, tree);
    for (index, joint) in model.moving() {
        let Some(child) = tree.carrier.iter().position(|c| *c == Some(index)) else { continue };
        if !model.links[child].between && handle(model, tree, child).is_none() {
            said.fault(format!(
                "{}: no handle; name a link, geom or site of the part so that \"handle\" is in its name",
                joint.name
            ));
        }
    }
    said
}

/// Everything that has a name of its file: what it is, and its name.
fn all_names(model: &Model) -> Vec<(&'static str, &str)> {
    let urdf = matches!(model.format, ModelFormat::Urdf { .. });
    let mut all: Vec<(&'static str, &str)> = Vec::new();
    all.extend(model.links.iter().map(|l| ("link", l.name.as_str())));
    // MJCF has no fixed joints: those names are ours.
    all.extend(model.joints.iter().filter(|j| urdf || j.kind != JointType::Fixed).map(|j| ("joint", j.name.as_str())));
    for link in &model.links {
        let kind = |s: &Shape| {
            if !urdf {
                "geom"
            } else if s.visual {
                "visual"
            } else {
                "collision"
            }
        };
        all.extend(link.shapes.iter().filter_map(|s| s.name.as_deref().map(|n| (kind(s), n))));
        all.extend(link.sites.iter().map(|(n, _)| ("site", n.as_str())).filter(|(_, n)| !n.is_empty()));
    }
    all
}

/// Names that some program cannot take, that are there twice, or that things of different kinds share.
fn name_faults(said: &mut Findings, all: &[(&'static str, &str)]) {
    let safe = |n: &str| !n.is_empty() && n.chars().all(|c| c.is_ascii_alphanumeric() || c == '_');
    let unsafe_names: BTreeSet<String> = all.iter().filter(|(_, n)| !safe(n)).map(|(_, n)| (*n).to_owned()).collect();
    if !unsafe_names.is_empty() {
        said.fault(format!("{}: only letters, digits and _ are safe in names everywhere", some(&unsafe_names)));
    }
    let (mut seen, mut kinds) = (BTreeSet::new(), BTreeMap::<&str, BTreeSet<&str>>::new());
    let (mut twice, mut shared) = (BTreeSet::new(), BTreeSet::new());
    for &(kind, name) in all {
        if !seen.insert((kind, name)) {
            twice.insert(format!("{kind} {name}"));
        }
        kinds.entry(name).or_default().insert(kind);
    }
    for (name, kinds) in &kinds {
        // A visual may be called as the collision that it shows.
        if kinds.len() > 1 && !kinds.iter().all(|k| ["visual", "collision"].contains(k)) {
            shared.insert((*name).to_owned());
        }
    }
    if !twice.is_empty() {
        said.fault(format!("{}: used more than once; names must be unique", some(&twice)));
    }
    if !shared.is_empty() {
        said.tell(format!(
            "{}: named alike though of different kinds; converters that have one list rename them",
            some(&shared)
        ));
    }
}

/// Where the handle of the rigid body around a link is, in the frame of the link that it belongs to: a site before a
/// shape before a link, of whose name "handle" is a part.
pub(super) fn handle(model: &Model, tree: &Tree, link: usize) -> Option<(usize, math::Point)> {
    let is = |name: &str| name.to_ascii_lowercase().contains("handle");
    let body: Vec<usize> = (0..model.links.len()).filter(|i| tree.body[*i] == tree.body[link]).collect();
    let site = |i: &usize| model.links[*i].sites.iter().find(|(n, _)| is(n)).map(|(_, p)| (*i, *p));
    let shapes = |i: &usize, named: bool| {
        let found: Vec<math::Point> = model.links[*i]
            .shapes
            .iter()
            .filter(|s| !named || s.name.as_deref().is_some_and(is))
            .map(|s| s.bounds.center)
            .collect();
        math::centroid(&found).map(|p| (*i, p))
    };
    // A handle of several boxes is held by the one that says bar, else at their middle.
    let bar = |i: &usize| {
        let name = |s: &&Shape| s.name.as_deref().is_some_and(|n| is(n) && n.to_ascii_lowercase().contains("bar"));
        model.links[*i].shapes.iter().find(name).map(|s| (*i, s.bounds.center))
    };
    let of_link =
        |i: &usize| is(&model.links[*i].name).then(|| shapes(i, false).unwrap_or((*i, math::Point::origin())));
    let named = |i: &usize| shapes(i, true);
    body.iter()
        .find_map(site)
        .or_else(|| body.iter().find_map(bar))
        .or_else(|| body.iter().find_map(named))
        .or_else(|| body.iter().find_map(of_link))
}

fn mjcf(model: &Model) -> Findings {
    let ModelFormat::Mjcf { radian, .. } = model.format else { return Findings::default() };
    let mut said = Findings::about(true);
    if !radian {
        said.fault(
            "angles are degrees; write radians and <compiler angle=\"radian\"/>: one setting holds for all files that \
             include each other"
                .to_owned(),
        );
    }
    for (_, joint) in model.moving() {
        if joint.limits().is_some() && joint.limited != Some(true) {
            said.fault(format!(
                "{}: its limits hang on autolimits, which PyBullet does not know; write limited=\"true\"",
                joint.name
            ));
        }
    }
    said
}

#[cfg(test)]
mod tests {
    use std::path::PathBuf;

    use nalgebra::Matrix3;

    use super::super::links::{Link, MassSource, ModelJoint};
    use super::*;
    use crate::math::Pose;
    use crate::math::Vector;
    use crate::twin::OrientedBox;

    /// A link with one box.
    fn link(name: &str, center: Vector, half: Vector, shape: &str) -> Link {
        Link {
            mass: Some(4.0),
            mass_source: MassSource::Stated,
            center: center.into(),
            inertia: Matrix3::identity() * 0.1,
            shapes: vec![Shape {
                name: Some(shape.to_owned()),
                bounds: OrientedBox { center: center.into(), half, rotation: Matrix3::identity() },
                exact: true,
                is_mesh: false,
                visual: false,
                masks: [1, 1],
            }],
            ..Link::named(name.to_owned())
        }
    }

    fn joint(name: &str, kind: JointType, parent: &str, child: &str) -> ModelJoint {
        ModelJoint {
            name: name.to_owned(),
            kind,
            parent: parent.to_owned(),
            child: child.to_owned(),
            parent_from_child: Pose::identity(),
            axis: Vector::z(),
            anchor: math::Point::new(-0.3, 0.0, 0.0),
            lower: Some(0.0),
            upper: Some(1.5),
            effort: Some(50.0),
            velocity: Some(6.0),
            damping: Some(0.5),
            friction: Some(0.2),
            armature: None,
            limited: Some(true),
            start: 0.0,
        }
    }

    fn cabinet() -> Model {
        Model {
            name: "c".to_owned(),
            source: PathBuf::from("c.urdf"),
            format: ModelFormat::Urdf { keeps_links: true, complaint: None, faults: Vec::new() },
            links: vec![
                Link { inertia: Matrix3::identity() * 0.1, ..Link::named("world".to_owned()) },
                // A board behind a door that opens towards -y, about its left edge.
                link("base", Vector::new(0.0, 0.3, 0.0), Vector::new(0.3, 0.25, 0.4), "board"),
                link("door_link", Vector::zeros(), Vector::new(0.3, 0.01, 0.4), "door_handle"),
            ],
            joints: vec![
                joint("fix", JointType::Fixed, "world", "base"),
                ModelJoint { axis: -Vector::z(), ..joint("door", JointType::Revolute, "base", "door_link") },
            ],
            excludes: Vec::new(),
            notes: Vec::new(),
            unread: Vec::new(),
            held: Vec::new(),
            faults: Vec::new(),
        }
    }

    fn faults(model: &Model) -> Vec<(u8, String)> {
        super::model(model, None).into_iter().flat_map(|p| p.faults.into_iter().map(move |f| (p.id, f))).collect()
    }

    #[test]
    fn a_sound_cabinet_passes() {
        let points = super::model(&cabinet(), None);
        assert!(faults(&cabinet()).is_empty(), "{:?}", faults(&cabinet()));
        let verdicts: Vec<(u8, PointVerdict)> = points.iter().map(|p| (p.id, p.verdict)).collect();
        assert_eq!(verdicts[..2], [(1, PointVerdict::Pass), (2, PointVerdict::Pass)]);
        assert!(verdicts.contains(&(6, PointVerdict::NotApplicable)) && verdicts.contains(&(11, PointVerdict::Pass)));
    }

    #[test]
    fn each_fault_fails_its_point_alone() {
        type Break = fn(&mut Model);
        let cases: [(u8, &str, Break); 9] = [
            (2, "lower limit 2 is above", |m| m.joints[1].lower = Some(2.0)),
            (2, "0, where every simulator begins", |m| m.joints[1].lower = Some(0.5)),
            (2, "more than once around", |m| m.joints[1].upper = Some(110.0)),
            (2, "axis has length 2", |m| m.joints[1].axis *= 2.0),
            (3, "no <inertial>", |m| m.links[2].mass_source = MassSource::Nothing),
            (3, "must be positive", |m| m.links[2].inertia = Matrix3::zeros()),
            (3, "none may exceed", |m| m.links[2].inertia[(0, 0)] = 9.0),
            (3, "50.0 mm outside", |m| m.links[2].center.x = 0.35),
            (5, "no handle", |m| m.links[2].shapes[0].name = None),
        ];
        for (id, word, break_it) in cases {
            let mut broken = cabinet();
            break_it(&mut broken);
            let found = faults(&broken);
            assert!(
                found.iter().all(|(i, _)| *i == id) && found.iter().any(|(_, f)| f.contains(word)),
                "{word}: {found:?}"
            );
        }
    }

    #[test]
    fn overlap_when_closed_is_told_from_excluded_overlap_and_from_a_jam() {
        let mut tight = cabinet();
        tight.links[1].shapes[0].bounds.center.y = 0.258;
        let found = faults(&tight);
        assert_eq!(found.len(), 1, "{found:?}");
        assert!(found[0].0 == 11 && found[0].1.contains("share 2.0 mm when closed"), "{found:?}");
        tight.format = ModelFormat::Mjcf { radian: true, limitless: false };
        tight.excludes.push(["door_link".to_owned(), "base".to_owned()]);
        assert!(faults(&tight).is_empty(), "{:?}", faults(&tight));
        // The other way round it opens into the board.
        let mut jams = cabinet();
        jams.joints[1].axis = Vector::z();
        let found = faults(&jams);
        assert!(found.iter().all(|(id, f)| *id == 11 && f.contains("door_handle (door_link) goes")), "{found:?}");
        assert!(!found.is_empty());
        // Shapes that never meet may share what they like.
        jams.links[1].shapes[0].masks = [0, 0];
        assert!(faults(&jams).is_empty(), "{:?}", faults(&jams));
    }
}
