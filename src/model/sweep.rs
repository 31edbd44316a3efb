//! What a file's joints run into: everything closed, and each joint over its range.

use std::collections::{BTreeMap, BTreeSet};

use rayon::prelude::*;

use super::check::{MAX_SLIDE_M, Said};
use super::{Format, Kind, Model, ModelJoint, Shape, Tree, penetration};
use crate::math::Pose;
use crate::twin::OrientedBox;

/// What a simulator's contacts forgive, metres.
const TOUCH_M: f64 = 1e-3;
/// What makes a part jam or jump, metres.
const JAM_M: f64 = 5e-3;
/// Poses over a joint's range.
const POSES: usize = 51;
/// Pairs of boxes over all poses, above which a sweep would take minutes.
const MAX_PAIRS: usize = 1_000_000_000;

/// A box that touches, where it is when everything is closed.
struct Solid<'a> {
    link: usize,
    shape: &'a Shape,
    world: OrientedBox,
    /// Of the sphere around it.
    radius: f64,
}

/// What a joint's sweep found.
#[derive(Default)]
struct Swept {
    /// Pairs of links that share space when closed: depth in metres, indices of boxes.
    closed: BTreeMap<(usize, usize), (f64, usize, usize)>,
    /// Deepest pair of boxes on the way, with the share of the range.
    deepest: Option<(f64, f64, usize, usize)>,
    /// The same where one of the two is no box: the boxes around them overlap, they need not.
    perhaps: Option<(f64, f64, usize, usize)>,
}

pub(super) fn sweep(model: &Model, tree: &Tree) -> Said {
    let poses = model.poses(tree, &model.closed());
    let solids: Vec<Solid> = model
        .links
        .iter()
        .enumerate()
        .flat_map(|(link, l)| l.shapes.iter().filter(|s| !s.visual).map(move |shape| (link, shape)))
        .map(|(link, shape)| Solid {
            link,
            shape,
            world: shape.bounds.moved(&poses[link]),
            radius: shape.bounds.half.norm(),
        })
        .collect();
    // A joint without sound limits has no range to sweep: point 2 says so.
    let sound = |j: &ModelJoint| {
        let most = if j.kind == Kind::Prismatic { MAX_SLIDE_M } else { std::f64::consts::TAU };
        j.limits().is_some_and(|[lower, upper]| upper - lower <= most)
    };
    let joints: Vec<usize> = model.moving().filter(|(_, j)| sound(j)).map(|(i, _)| i).collect();
    let mut said = Said::about(!joints.is_empty() && !solids.is_empty());
    let work = joints.len().saturating_mul(solids.len()).saturating_mul(solids.len() / 4 + 1).saturating_mul(POSES);
    if work > MAX_PAIRS {
        said.concerned = false;
        said.tell(format!("{} joints and {} boxes are too many to sweep", joints.len(), solids.len()));
        return said;
    }
    let swept: Vec<Swept> = joints.par_iter().map(|j| sweep_joint(model, tree, &poses, &solids, *j)).collect();
    let label = |i: usize| {
        let link = &model.links[solids[i].link].name;
        match &solids[i].shape.name {
            Some(name) if name != link => format!("{name} ({link})"),
            _ => link.clone(),
        }
    };
    let mm = |depth: f64| format!("{:.1} mm", 1000.0 * depth);
    let way_out = match model.format {
        Format::Urdf { .. } => "URDF cannot switch a contact off: leave a gap of 1 mm",
        Format::Mjcf { .. } => "leave a gap of 1 mm, or <exclude> the pair",
    };
    // Two joints of one piece of furniture see the same pair.
    let mut reported = BTreeSet::new();
    for (joint, result) in joints.iter().zip(swept) {
        let name = &model.joints[*joint].name;
        for (pair, (depth, a, b)) in &result.closed {
            let text = format!("{} and {} share {} when closed", label(*a), label(*b), mm(*depth));
            if !reported.insert(*pair) {
                continue;
            }
            if *depth > TOUCH_M && !filtered(model, tree, *pair) {
                said.fault(format!("{name}: {text}, and push each other apart; {way_out}"));
            } else {
                said.tell(format!("{name}: {text}"));
            }
        }
        if let Some((depth, share, a, b)) = result.deepest {
            let pair = (solids[a].link, solids[b].link);
            let known = result.closed.get(&pair).is_some_and(|(closed, ..)| depth <= closed + TOUCH_M);
            let text = format!("{name}: {} goes {} into {} at {share:.2} of its range", label(a), mm(depth), label(b));
            if depth > JAM_M {
                said.fault(format!("{text}; move one of the two, or limit the range"));
            } else if depth > TOUCH_M && !known {
                said.tell(text);
            }
        }
        if let Some((depth, share, a, b)) = result.perhaps.filter(|p| p.0 > JAM_M) {
            said.tell(format!(
                "{name}: the boxes around {} and {} overlap by {} at {share:.2} of its range; look at the shapes in them",
                label(a),
                label(b),
                mm(depth)
            ));
        }
    }
    said
}

/// Whether the file has the contact between two links switched off: excluded, or, in MuJoCo, parent and child of which
/// neither is fixed to the world.
fn filtered(model: &Model, tree: &Tree, (a, b): (usize, usize)) -> bool {
    let (name_a, name_b) = (&model.links[a].name, &model.links[b].name);
    let excluded = model.excludes.iter().any(|[x, y]| (x == name_a && y == name_b) || (x == name_b && y == name_a));
    let (body_a, body_b) = (tree.body[a], tree.body[b]);
    let ground = tree.order.first().map(|root| tree.body[*root]);
    let above = |body: usize| tree.parent[body].map(|p| tree.body[p]);
    let family = above(body_a) == Some(body_b) || above(body_b) == Some(body_a);
    let free = Some(body_a) != ground && Some(body_b) != ground;
    excluded || (matches!(model.format, Format::Mjcf { .. }) && family && free)
}

fn sweep_joint(model: &Model, tree: &Tree, poses: &[Pose], solids: &[Solid], index: usize) -> Swept {
    let mut out = Swept::default();
    let joint = &model.joints[index];
    let beyond = tree.beyond(index);
    let child = tree.carrier.iter().position(|c| *c == Some(index));
    let Some(parent) = child.and_then(|c| tree.parent[c]) else { return out };
    let (moving, still): (Vec<usize>, Vec<usize>) = (0..solids.len()).partition(|i| beyond[solids[*i].link]);
    let [shut, open] = joint.closed_and_open();
    let foot = poses[parent] * joint.parent_from_child;
    let back = joint.motion(shut).inverse() * foot.inverse();
    for pose in 0..POSES {
        let share = pose as f64 / (POSES - 1) as f64;
        let motion = foot * joint.motion(shut + (open - shut) * share) * back;
        for &a in &moving {
            let moved = solids[a].world.moved(&motion);
            for &b in &still {
                let other = &solids[b];
                let near = (moved.center - other.world.center).norm() < solids[a].radius + other.radius;
                if !near || !solids[a].shape.meets(other.shape) {
                    continue;
                }
                let depth = penetration(&moved, &other.world);
                // A tenth of a millimetre is contact, not shared space.
                if depth < 1e-4 {
                    continue;
                }
                let exact = solids[a].shape.exact && other.shape.exact;
                let slot = if exact { &mut out.deepest } else { &mut out.perhaps };
                if slot.is_none_or(|(deepest, ..)| depth > deepest) {
                    *slot = Some((depth, share, a, b));
                }
                if pose == 0 && exact {
                    let pair = out.closed.entry((solids[a].link, other.link)).or_insert((depth, a, b));
                    if depth > pair.0 {
                        *pair = (depth, a, b);
                    }
                }
            }
        }
    }
    out
}
