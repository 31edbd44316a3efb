//! What a file's joints run into: everything closed, and each joint over its range.

use std::collections::{BTreeMap, BTreeSet};

use rayon::prelude::*;

use super::contacts::Contacts;
use super::findings::Findings;
use super::joint_limits::MAX_SLIDE_M;
use super::links::{JointType, Model, ModelFormat, ModelJoint, Shape};
use super::penetration::penetration;
use super::tree::Tree;
use crate::math::{Pose, rounded};
use crate::twin::OrientedBox;

/// What a simulator's contacts forgive where boxes stand in each other when closed, metres.
const TOUCH_M: f64 = 1e-3;
/// What they forgive a part on its way, metres: a hand of 20 N pushes a door past a board that it grazes by 0.1 mm, and
/// 50 N do not by 0.25 mm (MuJoCo's default contacts, a dishwasher's door).
pub(super) const GRAZE_M: f64 = 1e-4;
/// Above this the boxes around shapes that are no boxes overlap by more than such boxes do, metres.
const LOOSE_M: f64 = 5e-3;
/// Poses over a joint's range.
const POSES: usize = 51;
/// Pairs of boxes over all poses, above which a sweep would take minutes.
const MAX_PAIRS: usize = 1_000_000_000;

/// A box that touches, where it is when everything is closed.
struct TouchingBox<'a> {
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
    /// Pairs of links that share space on the way: depth where it is deepest, share of the range, indices of boxes.
    deepest: BTreeMap<(usize, usize), (f64, f64, usize, usize)>,
    /// The deepest where one of the two is no box: the boxes around them overlap, they need not.
    perhaps: Option<(f64, f64, usize, usize)>,
}

/// Point 11: each joint over its range, everything else closed.
pub(super) fn sweep(model: &Model, tree: &Tree) -> Findings {
    let poses = model.poses(tree, &model.closed());
    let boxes = touching(model, &poses);
    // A joint without sound limits has no range to sweep: point 2 says so.
    let sound = |j: &ModelJoint| {
        let most = if j.kind == JointType::Prismatic { MAX_SLIDE_M } else { std::f64::consts::TAU };
        j.limits().is_some_and(|[lower, upper]| upper - lower <= most)
    };
    let joints: Vec<usize> = model.moving().filter(|(_, j)| sound(j)).map(|(i, _)| i).collect();
    let mut said = Findings::about(!joints.is_empty() && !boxes.is_empty());
    let work = joints.len().saturating_mul(boxes.len()).saturating_mul(boxes.len() / 4 + 1).saturating_mul(POSES);
    if work > MAX_PAIRS {
        said.unjudged = true;
        said.tell(format!("{} joints and {} boxes are too many to sweep", joints.len(), boxes.len()));
        return said;
    }
    let contacts = Contacts::of(model, tree);
    let closed = ClosedModel { model, tree, poses: &poses, boxes: &boxes, contacts: &contacts };
    let swept: Vec<Swept> = joints.par_iter().map(|j| closed.sweep(*j)).collect();
    // Two joints of one piece of furniture see the same pair.
    let mut reported = BTreeSet::new();
    for (joint, result) in joints.iter().zip(&swept) {
        closed.tell_closed(*joint, result, &mut reported, &mut said);
        closed.tell_way(*joint, result, &mut said);
    }
    said
}

/// All boxes of a model that take part in contacts; `poses` are those of its links.
fn touching<'a>(model: &'a Model, poses: &[Pose]) -> Vec<TouchingBox<'a>> {
    let links = model.links.iter().enumerate();
    links
        .flat_map(|(link, l)| l.shapes.iter().filter(|s| !s.visual).map(move |shape| (link, shape)))
        .map(|(link, shape)| TouchingBox {
            link,
            shape,
            world: shape.bounds.moved(&poses[link]),
            radius: shape.bounds.half.norm(),
        })
        .collect()
}

/// A depth for people.
fn mm(depth: f64) -> String {
    format!("{} mm", rounded(1000.0 * depth, 1))
}

/// A model with everything closed.
struct ClosedModel<'a> {
    model: &'a Model,
    tree: &'a Tree,
    poses: &'a [Pose],
    boxes: &'a [TouchingBox<'a>],
    contacts: &'a Contacts<'a>,
}

impl ClosedModel<'_> {
    /// A box by its name and its link's.
    fn label(&self, index: usize) -> String {
        let link = &self.model.links[self.boxes[index].link].name;
        match &self.boxes[index].shape.name {
            Some(name) if name != link => format!("{name} ({link})"),
            _ => link.clone(),
        }
    }

    /// Tells what shares space while everything is closed; `reported` are the pairs of links that were told before.
    fn tell_closed(&self, joint: usize, result: &Swept, reported: &mut BTreeSet<(usize, usize)>, said: &mut Findings) {
        let name = &self.model.joints[joint].name;
        let way_out = match self.model.format {
            ModelFormat::Urdf { .. } => "URDF cannot switch a contact off: leave a gap of 1 mm",
            ModelFormat::Mjcf { .. } => "leave a gap of 1 mm, or <exclude> the pair",
        };
        for (pair, (depth, a, b)) in &result.closed {
            let text = format!("{} and {} share {} when closed", self.label(*a), self.label(*b), mm(*depth));
            if !reported.insert(*pair) {
                continue;
            }
            if *depth > TOUCH_M {
                said.fault(format!("{name}: {text}, and push each other apart; {way_out}"));
            } else {
                said.tell(format!("{name}: {text}"));
            }
        }
    }

    /// Tells what stops a part on its way, or may do so.
    fn tell_way(&self, joint: usize, result: &Swept, said: &mut Findings) {
        let name = &self.model.joints[joint].name;
        // What stands in something else when closed and goes no deeper does not jam.
        let jams = |pair: &(usize, usize), depth: f64| {
            depth > GRAZE_M + result.closed.get(pair).map_or(0.0, |(closed, ..)| *closed)
        };
        let worst = result.deepest.iter().filter(|(pair, (depth, ..))| jams(pair, *depth));
        if let Some((_, (depth, share, a, b))) = worst.max_by(|a, b| a.1.0.total_cmp(&b.1.0)) {
            said.fault(format!(
                "{name}: {} goes {} into {} at {share:.2} of its range, which stops it; move one of the two, or limit the range",
                self.label(*a),
                mm(*depth),
                self.label(*b)
            ));
        }
        if let Some((depth, share, a, b)) = result.perhaps.filter(|p| p.0 > LOOSE_M) {
            said.tell(format!(
                "{name}: the boxes around {} and {} overlap by {} at {share:.2} of its range; look at the shapes in them",
                self.label(a),
                self.label(b),
                mm(depth)
            ));
        }
    }

    /// What a joint's part meets on its way from closed to open.
    fn sweep(&self, index: usize) -> Swept {
        let Self { model, tree, poses, boxes, contacts } = *self;
        let mut out = Swept::default();
        let joint = &model.joints[index];
        let beyond = tree.beyond(index);
        let child = tree.carrier.iter().position(|c| *c == Some(index));
        let Some(parent) = child.and_then(|c| tree.parent[c]) else { return out };
        let (moving, still): (Vec<usize>, Vec<usize>) = (0..boxes.len()).partition(|i| beyond[boxes[*i].link]);
        let [shut, open] = joint.closed_and_open();
        let foot = poses[parent] * joint.parent_from_child;
        let back = joint.motion(shut).inverse() * foot.inverse();
        for pose in 0..POSES {
            let share = pose as f64 / (POSES - 1) as f64;
            let motion = foot * joint.motion(shut + (open - shut) * share) * back;
            for &a in &moving {
                let moved = boxes[a].world.moved(&motion);
                for &b in &still {
                    let other = &boxes[b];
                    let near = (moved.center - other.world.center).norm() < boxes[a].radius + other.radius;
                    if !near || !boxes[a].shape.meets(other.shape) || contacts.off(boxes[a].link, other.link) {
                        continue;
                    }
                    let depth = penetration(&moved, &other.world);
                    if depth < GRAZE_M {
                        continue;
                    }
                    let pair = (boxes[a].link, other.link);
                    let exact = boxes[a].shape.exact && other.shape.exact;
                    if exact {
                        let deepest = out.deepest.entry(pair).or_insert((depth, share, a, b));
                        if depth > deepest.0 {
                            *deepest = (depth, share, a, b);
                        }
                    } else if out.perhaps.is_none_or(|(deepest, ..)| depth > deepest) {
                        out.perhaps = Some((depth, share, a, b));
                    }
                    if pose == 0 && exact {
                        let closed = out.closed.entry(pair).or_insert((depth, a, b));
                        if depth > closed.0 {
                            *closed = (depth, a, b);
                        }
                    }
                }
            }
        }
        out
    }
}
