//! The part that one joint of a model moves: its boxes, its handle, how it opens.

use std::collections::BTreeMap;

use nalgebra::Matrix3;

use super::links::{JointType, Link, Model, ModelJoint, Shape};
use super::tree::Tree;
use super::{check, traps};
use crate::articulation::{Articulation, JointKind};
use crate::math::{Point, Pose, Vector, any_orthogonal, centroid, plain, reject, rounded, unit};
use crate::twin::{ContactRule, Joint, OrientedBox, Part, Role, Solid};

/// A sheet is this thick in a simulation, metres.
pub(super) const THINNEST_M: f64 = 1e-3;

/// Frames, and links between two joints of one body, weigh nothing.
fn weightless(link: &Link) -> bool {
    link.between || (link.mass.is_none() && link.shapes.is_empty() && link.meshes.is_empty())
}

/// Names that are safe in every format, each once.
#[derive(Default)]
pub(super) struct Names {
    /// How often each was asked for again.
    asked: BTreeMap<String, usize>,
    /// What the solids that were named may touch.
    pub(super) solids: BTreeMap<String, ContactRule>,
}

impl Names {
    pub(super) fn safe(&mut self, wanted: &str) -> String {
        let clean: String =
            wanted.chars().take(64).map(|c| if c.is_ascii_alphanumeric() || c == '_' { c } else { '_' }).collect();
        let clean = if clean.is_empty() { "unnamed".to_owned() } else { clean };
        let mut number = self.asked.get(&clean).copied().unwrap_or(0);
        let mut name = clean.clone();
        while self.asked.contains_key(&name) {
            number += 1;
            name = format!("{clean}_{}", number + 1);
        }
        self.asked.insert(clean, number);
        self.asked.entry(name.clone()).or_insert(0);
        name
    }

    /// The name of a link's shape, which is remembered with what the shape may touch.
    pub(super) fn solid(&mut self, wanted: &str, shape: &Shape, link: usize, tree: &Tree) -> String {
        let name = self.safe(wanted);
        let masks = if shape.visual { [0, 0] } else { shape.masks };
        self.solids.insert(name.clone(), ContactRule { link, body: tree.body[link], masks });
        name
    }
}

/// The shapes of a link that stand for it.
pub(super) fn solid_shapes(link: &Link) -> Vec<&Shape> {
    let colliding: Vec<&Shape> = link.shapes.iter().filter(|s| !s.visual).collect();
    if colliding.is_empty() { link.shapes.iter().collect() } else { colliding }
}

fn solid(name: String, shape: &Shape, pose: &Pose, role: Role) -> Solid {
    Solid { name, role, shape: shape.bounds.moved(pose).thickened(THINNEST_M), seen: true }
}

/// One joint of a model.
pub(super) struct MovingJoint<'a> {
    pub(super) model: &'a Model,
    pub(super) tree: &'a Tree,
    /// `world_from_link` with everything closed.
    pub(super) poses: &'a [Pose],
    pub(super) index: usize,
    pub(super) joint: &'a ModelJoint,
}

/// How a joint opens, and between which links.
struct JointOpening {
    kind: JointKind,
    /// The link that it moves, and the one that it hangs on, by index.
    child: usize,
    base: usize,
    /// World, unit, of the sense that opens.
    axis: Vector,
    /// The position that counts as closed, and how far it opens from there, rad or m.
    closed: f64,
    upper: f64,
}

impl MovingJoint<'_> {
    /// For each link whether it moves with the part.
    fn inside(&self) -> Vec<bool> {
        self.tree.beyond(self.index)
    }

    /// What the part weighs, kg; `None` where one of its links does not tell.
    pub(super) fn mass(&self) -> Option<f64> {
        let inside = self.inside();
        let links = self.model.links.iter().enumerate().filter(|(i, _)| inside[*i]).map(|(_, l)| l);
        links.map(|l| if weightless(l) { Some(0.0) } else { l.mass }).sum()
    }

    /// How it opens; `Err` says why no path can be judged by it.
    fn opening(&self) -> Result<JointOpening, String> {
        let (joint, tree) = (self.joint, self.tree);
        let kind = joint.moves().ok_or("it does not move")?;
        if let Some((_, why)) = self.model.held.iter().find(|(held, _)| *held == self.index) {
            return Err(format!("{why}: no hand can move it, so that no path is judged by it"));
        }
        let child = tree.carrier.iter().position(|c| *c == Some(self.index)).ok_or("it moves no link")?;
        let base = tree.parent[child].ok_or("it hangs on no link")?;
        if let (Some(lower), Some(upper)) = (joint.lower, joint.upper)
            && lower >= upper
        {
            return Err(format!("its limits {} to {} leave no range", plain(lower), plain(upper)));
        }
        let written = unit(&joint.axis).ok_or("its axis has no direction")?;
        let [closed, open] = joint.closed_and_open();
        let sense = if open >= closed { 1.0 } else { -1.0 };
        let axis = self.poses[child].rotation * written * sense;
        let upper = (open - closed).abs();
        other_unit(kind, upper)?;
        Ok(JointOpening { kind, child, base, axis, closed, upper })
    }

    /// The boxes of the part; `inside` are its links.
    fn solids(&self, inside: &[bool], names: &mut Names) -> Vec<Solid> {
        let mut solids = Vec::new();
        for (i, link) in self.model.links.iter().enumerate().filter(|(i, _)| inside[*i]) {
            for (k, shape) in solid_shapes(link).into_iter().enumerate() {
                let wanted = shape.name.clone().unwrap_or_else(|| format!("{}_{k}", link.name));
                let is_handle = wanted.to_ascii_lowercase().contains("handle");
                let role = if is_handle { Role::Handle } else { Role::Front };
                solids.push(solid(names.solid(&wanted, shape, i, self.tree), shape, &self.poses[i], role));
            }
        }
        solids
    }

    /// The part, and the link that it hangs on; `Err` says why there is none.
    pub(super) fn part(&self, id: &str, names: &mut Names, notes: &mut Vec<String>) -> Result<(Part, usize), String> {
        let joint = self.joint;
        let JointOpening { kind, child, base, axis, closed, upper } = self.opening()?;
        let inside = self.inside();
        self.tell(&inside, [closed, upper], notes);
        let solids = self.solids(&inside, names);
        let corners = corners_of(&solids)?;
        let anchor = self.poses[child] * joint.anchor;
        let line = Articulation { kind, axis, origin: anchor };
        let handle = match check::handle(self.model, self.tree, child) {
            Some((link, p)) => self.poses[link] * p,
            None => farthest(&line, &corners),
        };
        let origin = match kind {
            JointKind::Revolute => line.line().project(&centroid(&corners).unwrap_or(anchor)),
            JointKind::Prismatic => handle,
        };
        let articulation = Articulation { origin, ..line };
        let part = Part {
            id: id.to_owned(),
            label: joint.name.clone(),
            joint: Joint {
                articulation,
                upper,
                observed: upper,
                expected: upper,
                damping: joint.damping.unwrap_or(0.0).max(0.0),
                friction: joint.friction.unwrap_or(0.0).max(0.0),
                resistance_seen: false,
                balanced: false,
                probability: None,
            },
            bounds: bounds(&solids, &corners, &articulation, &handle),
            solids,
            handle,
        };
        Ok((part, base))
    }

    /// Notes about what is taken for granted; `inside` are the links that move with the part, `closed` and `upper` its closed
    /// position and how far it opens, rad or m.
    fn tell(&self, inside: &[bool], [closed, upper]: [f64; 2], notes: &mut Vec<String>) {
        let joint = self.joint;
        let amount = |x: f64| match joint.kind {
            JointType::Prismatic => format!("{x:.3} m"),
            _ => format!("{:.0}°", x.to_degrees()),
        };
        match joint.limits() {
            None => notes.push(format!("{}: has no limits; it is taken to open by {}", joint.name, amount(upper))),
            Some([lower, _]) if lower != 0.0 => {
                notes.push(format!(
                    "{}: closed is taken to be at {}, the limit nearest to 0",
                    joint.name,
                    amount(closed)
                ));
            }
            Some(_) => {}
        }
        let further: Vec<&str> = self
            .model
            .moving()
            .filter(|(_, j)| self.is_inside(inside, &j.parent))
            .map(|(_, j)| j.name.as_str())
            .collect();
        if !further.is_empty() {
            notes.push(format!("{}: {} further down are kept closed", joint.name, further.join(", ")));
        }
        for (what, value) in [("damping", joint.damping), ("friction", joint.friction)] {
            if value.is_none() {
                notes.push(format!("{}: has no {what}; none is taken", joint.name));
            }
        }
        if !traps::is_touched(self.model, inside) {
            notes.push(format!(
                "{}: none of its part's shapes takes part in contacts: no hand can touch it, and it meets nothing on its \
                 way; only its motion is judged",
                joint.name
            ));
        }
    }

    fn is_inside(&self, inside: &[bool], link: &str) -> bool {
        self.model.links.iter().position(|l| l.name == link).is_some_and(|i| inside[i])
    }
}

/// Nothing that a person opens is longer, metres.
const HUGE_M: f64 = 20.0;

/// The corners of a part's boxes; `Err` says why no person opens such a part.
fn corners_of(solids: &[Solid]) -> Result<Vec<Point>, String> {
    if solids.is_empty() {
        return Err("its part has no shape that is read".to_owned());
    }
    let corners: Vec<Point> = solids.iter().flat_map(|s| s.shape.corners()).collect();
    if !corners.iter().all(is_near) {
        return Err(format!("its part lies farther than {FAR_M} m away"));
    }
    let size = solids.iter().map(|s| 2.0 * s.shape.half.max()).fold(0.0, f64::max);
    if size > HUGE_M {
        let long = rounded(size, 0);
        return Err(format!("its part is {long} m long; write it in metres (a mesh with a scale of 0.001)"));
    }
    Ok(corners)
}

/// Refuses a range that only another unit explains.
fn other_unit(kind: JointKind, upper: f64) -> Result<(), String> {
    // Knobs go round twice at the most.
    const TURNS_RAD: f64 = 4.0 * std::f64::consts::PI + 0.1;
    match kind {
        JointKind::Revolute if upper > TURNS_RAD => Err(format!(
            "it turns by {} rad, {} times round; write its limits in radians (MJCF: or say angle=\"degree\")",
            rounded(upper, 0),
            rounded(upper / std::f64::consts::TAU, 0)
        )),
        JointKind::Prismatic if upper > HUGE_M => {
            Err(format!("it slides by {} m; write its limits in metres, not in millimetres", rounded(upper, 0)))
        }
        _ => Ok(()),
    }
}

/// A home is smaller, metres.
const FAR_M: f64 = 1e3;

pub(super) fn is_near(p: &Point) -> bool {
    p.coords.iter().all(|x| x.abs() < FAR_M)
}

/// The corner that is farthest from a hinge, or farthest out along a slide.
fn farthest(joint: &Articulation, corners: &[Point]) -> Point {
    let reach = |p: &Point| match joint.kind {
        JointKind::Revolute => joint.line().distance(p),
        JointKind::Prismatic => p.coords.dot(&joint.axis),
    };
    corners.iter().copied().max_by(|a, b| reach(a).total_cmp(&reach(b))).unwrap_or(joint.origin)
}

/// The box around a part, z out of its face: the axis of its largest box that is nearest to the way it opens.
fn bounds(solids: &[Solid], corners: &[Point], joint: &Articulation, handle: &Point) -> OrientedBox {
    let way = match joint.kind {
        JointKind::Prismatic => joint.axis,
        JointKind::Revolute => {
            unit(&joint.axis.cross(&(handle - joint.origin))).unwrap_or_else(|| any_orthogonal(&joint.axis))
        }
    };
    let largest = solids.iter().max_by(|a, b| a.shape.volume().total_cmp(&b.shape.volume()));
    let out = largest
        .map(|s| [0, 1, 2].map(|i| s.shape.rotation.column(i).into_owned()))
        .and_then(|axes| axes.into_iter().max_by(|a, b| a.dot(&way).abs().total_cmp(&b.dot(&way).abs())))
        .and_then(|axis| unit(&if axis.dot(&way) < 0.0 { -axis } else { axis }))
        .unwrap_or(way);
    // Up as far as the face has it; a lid's up is along its hinge.
    let up = unit(&reject(&Vector::z(), &out)).filter(|_| out.z.abs() < 0.9);
    let up = up.or_else(|| unit(&reject(&joint.axis, &out))).unwrap_or_else(|| any_orthogonal(&out));
    let rotation = Matrix3::from_columns(&[up.cross(&out), up, out]);
    let mut low = Vector::repeat(f64::INFINITY);
    let mut high = Vector::repeat(f64::NEG_INFINITY);
    for c in corners {
        let local = rotation.transpose() * c.coords;
        (low, high) = (low.inf(&local), high.sup(&local));
    }
    OrientedBox { center: Point::from(rotation * ((low + high) * 0.5)), half: (high - low) * 0.5, rotation }
}
