//! Where parts are while they open: whether a file's animations go as far as its joints, and everything is where the twin has it.

use std::collections::BTreeMap;

use super::findings::Findings;
use super::glb::{GltfScene, Moved, PlacesOverRange, SHARES};
use super::joint_limits::MAX_SLIDE_M;
use super::links::Model;
use super::tree::Tree;
use crate::articulation::JointKind;
use crate::math::{self, plain, rounded};
use crate::twin::Twin;

/// A handle must be in the same place in all files to within this, metres.
const PLACE_M: f64 = 1e-5;

/// Whether a scene's animations turn pivots, as far as the joints go.
pub(super) fn animations(scene: &GltfScene, twin: Option<&Twin>) -> Findings {
    let mut said = Findings {
        concerned: true,
        unjudged: scene.hides_motion,
        faults: scene.faults.clone(),
        told: scene.told.clone(),
    };
    if scene.moved.is_empty() && twin.is_none() {
        let what = match (scene.hides_motion, scene.notes.is_empty()) {
            (true, _) => "what turns or slides in it is not read",
            (false, true) => "nothing in it is animated",
            (false, false) => "nothing in it turns or slides",
        };
        said.tell(what.to_owned());
    }
    for moved in &scene.moved {
        animation(&mut said, moved);
    }
    if scene.is_physics {
        if let Some(moved) = scene.moved.first() {
            said.fault(format!(
                "{}: is animated, and animations override physics; keep them in another file",
                moved.name
            ));
        }
        return said;
    }
    for part in twin.iter().flat_map(|t| &t.furniture).map(|f| &f.part) {
        match scene.moved.iter().find(|m| m.name == part.id) {
            None => said.fault(format!("{}: has no animation", part.id)),
            Some(m) if (m.reaches - part.joint.upper).abs() > 1e-3 => {
                said.fault(format!(
                    "{}: its animation opens to {:.4}, the model to {:.4}",
                    part.id, m.reaches, part.joint.upper
                ));
            }
            Some(_) => {}
        }
    }
    said
}

/// Whether an animation turns a pivot, in the right unit and as far as its joint goes.
fn animation(said: &mut Findings, moved: &Moved) {
    let name = &moved.name;
    if !moved.is_pivot {
        said.fault(format!(
            "{name}: is animated and carries nothing; animate a node at the hinge with the part below it"
        ));
    }
    match moved.kind {
        JointKind::Prismatic if moved.reaches > MAX_SLIDE_M => {
            said.fault(format!("{name}: its animation slides it by {} m; glTF is in metres", plain(moved.reaches)));
        }
        JointKind::Revolute if moved.reaches > std::f64::consts::TAU + 1e-6 => {
            let degrees = rounded(moved.reaches.to_degrees(), 0);
            said.fault(format!("{name}: its animation turns it by {degrees}°, more than once around"));
        }
        _ => {}
    }
    if let Some(upper) = moved.upper
        && (moved.reaches - upper).abs() > 1e-3
    {
        let [reaches, upper] = [moved.reaches, upper].map(|x| rounded(x, 4));
        said.fault(format!("{name}: its animation opens to {reaches}, its limit is {upper}"));
    }
}

/// Where links, named shapes and sites of each moving part are; every other joint is closed. World, metres.
#[must_use]
pub fn places(model: &Model, tree: &Tree) -> BTreeMap<String, PlacesOverRange> {
    let closed = model.closed();
    let mut out = BTreeMap::new();
    for (index, joint) in model.moving() {
        let beyond = tree.beyond(index);
        let [shut, open] = joint.closed_and_open();
        for (k, share) in SHARES.into_iter().enumerate() {
            let mut positions = closed.clone();
            positions[index] = shut + (open - shut) * share;
            let poses = model.poses(tree, &positions);
            for (i, link) in model.links.iter().enumerate().filter(|(i, _)| beyond[*i]) {
                let shapes = link.shapes.iter().filter_map(|s| s.name.as_ref().map(|n| (n, s.bounds.center)));
                let sites = link.sites.iter().map(|(n, p)| (n, *p));
                for (name, p) in [(&link.name, math::Point::origin())].into_iter().chain(shapes).chain(sites) {
                    out.entry(name.clone()).or_insert([math::Point::origin(); 3])[k] = poses[i] * p;
                }
            }
        }
    }
    out
}

/// Whether handles and boxes are where the twin has them: closed, half open, open.
pub(super) fn same_places(twin: &Twin, read: &BTreeMap<String, PlacesOverRange>) -> Findings {
    let mut said = Findings::about(!twin.furniture.is_empty());
    for part in twin.furniture.iter().map(|f| &f.part) {
        let joint = &part.joint;
        let handle = format!("{}_handle", part.id);
        let solids = part.solids.iter().map(|s| (s.name.as_str(), s.shape.center));
        let wanted = [(handle.as_str(), part.handle)].into_iter().chain(solids);
        let (mut found, mut worst) = (false, (0.0f64, String::new()));
        for (name, closed) in wanted {
            let Some(have) = read.get(name) else { continue };
            found = true;
            for (share, p) in SHARES.into_iter().zip(have) {
                let off = (joint.articulation.motion(share * joint.upper) * closed - p).norm();
                // What is not a number is off too.
                if off > worst.0 || off.is_nan() {
                    worst = (off, format!("{name} at {share} of its range"));
                }
            }
        }
        if !found {
            said.fault(format!("{}: neither its handle nor any of its boxes is in the file", part.id));
        } else if worst.0 > PLACE_M || worst.0.is_nan() {
            said.fault(format!("{}: {} is {:.3} mm off", part.id, worst.1, 1000.0 * worst.0));
        }
    }
    said
}
