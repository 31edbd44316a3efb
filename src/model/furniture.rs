//! A model as furniture: one piece for each joint that moves, in the world frame with everything closed.

use std::collections::BTreeMap;

use nalgebra::Matrix3;

use super::contacts::Contacts;
use super::sweep::GRAZE_M;
use super::{Kind, Model, ModelJoint, Shape, Tree, check, penetration};
use crate::articulation::{Articulation, JointKind};
use crate::math::{Point, Pose, Vector, any_orthogonal, centroid, reject, unit};
use crate::twin::{ContactRule, ContactRules, Furniture, Joint, LeftOut, OrientedBox, Part, Role, Solid, Twin};

/// Where a model states no mass: light wood and board, kg/m^3.
const DENSITY: f64 = 700.0;
/// A sheet is this thick in a simulation, metres.
const THINNEST_M: f64 = 1e-3;

/// The model as a twin, and what had to be decided on the way.
///
/// Closed is the limit nearest to 0, and the axis' sign opens from there; joints further down are frozen closed. A part is
/// the joint's child with all that is fixed to it; a board of the other side goes to the nearest part that hangs on it.
/// A joint that cannot be used is in [`Twin::left_out`] with its reason. Colliding shapes are taken, visible ones where a
/// link has no others, and the boxes around what is no box.
#[must_use]
pub fn to_twin(model: &Model) -> (Twin, Vec<String>) {
    let (twin, _, notes) = to_ruled_twin(model);
    (twin, notes)
}

/// The same with what the model says about its contacts: shapes that are only seen, masks, excluded pairs, and in MJCF parent
/// and child of which neither is fixed to the world.
#[must_use]
pub fn to_ruled_twin(model: &Model) -> (Twin, ContactRules, Vec<String>) {
    let mut notes = model.notes.clone();
    notes.extend(model.unread.iter().cloned());
    let mut twin = Twin {
        name: model.name.chars().filter(|c| !c.is_control()).collect(),
        density_kg_per_m3: DENSITY,
        furniture: Vec::new(),
        room: Vec::new(),
        left_out: Vec::new(),
    };
    let tree = match model.tree() {
        Ok(tree) => tree,
        Err(faults) => {
            let reason = few(&faults);
            twin.left_out =
                model.moving().map(|(_, j)| LeftOut { id: j.name.clone(), reason: reason.clone() }).collect();
            notes.push(format!("the links are no tree: {reason}"));
            return (twin, ContactRules::default(), notes);
        }
    };
    let poses = model.poses(&tree, &model.closed());
    let mut names = Names::default();
    let (mut mass, mut volume) = (0.0, 0.0);
    let mut built: Vec<(usize, usize)> = Vec::new();
    // Joints come first: they are asked for by name, and what else has that name gets another.
    let ids: Vec<String> = model.moving().map(|(_, j)| names.safe(&j.name)).collect();
    for ((index, joint), id) in model.moving().zip(ids) {
        let piece = Piece { model, tree: &tree, poses: &poses, index, joint };
        match piece.part(&id, &mut names, &mut notes) {
            Ok((part, base)) => {
                let inside = piece.inside();
                let links = || model.links.iter().enumerate().filter(|(i, _)| inside[*i]).map(|(_, l)| l);
                if let Some(kilograms) =
                    links().map(|l| if weightless(l) { Some(0.0) } else { l.mass }).sum::<Option<f64>>()
                {
                    mass += kilograms;
                    volume += part.solids.iter().map(|s| s.shape.volume()).sum::<f64>();
                }
                let name = names.safe(&format!("{}_base", part.id));
                twin.furniture.push(Furniture { name, carcass: Vec::new(), part });
                built.push((index, base));
            }
            Err(reason) => twin.left_out.push(LeftOut { id, reason }),
        }
    }
    for joint in model.joints.iter().filter(|j| j.kind == Kind::Other) {
        let reason = "it moves in several directions at once; only hinges and slides are replayed".to_owned();
        twin.left_out.push(LeftOut { id: names.safe(&joint.name), reason });
    }
    if mass > 0.0 && volume > 0.0 && mass.is_finite() {
        twin.density_kg_per_m3 = mass / volume;
        notes.push(format!(
            "all parts have one density: {:.0} kg/m^3, their mass over the volume of their boxes",
            twin.density_kg_per_m3
        ));
    } else if !twin.furniture.is_empty() {
        notes.push(format!("no part states its mass; {DENSITY} kg/m^3 is taken"));
    }
    boards(model, &tree, &poses, &built, &mut twin, &mut names, &mut notes);
    let contacts = Contacts::of(model, &tree);
    let rules = ContactRules { solids: names.solids, excluded: contacts.excluded_pairs(), family: contacts.families() };
    (twin, rules, notes)
}

/// The first faults in one text: every joint gets it as its reason.
fn few(faults: &[String]) -> String {
    const MOST: usize = 5;
    let shown = faults.get(..MOST).unwrap_or(faults).join("; ");
    if faults.len() > MOST { format!("{shown}; and {} more", faults.len() - MOST) } else { shown }
}

/// Frames, and links between two joints of one body, weigh nothing.
fn weightless(link: &super::Link) -> bool {
    link.between || (link.mass.is_none() && link.shapes.is_empty() && link.meshes.is_empty())
}

/// Names that are safe in every format, each once.
#[derive(Default)]
struct Names {
    /// How often each was asked for again.
    asked: BTreeMap<String, usize>,
    /// What the solids that were named may touch.
    solids: BTreeMap<String, ContactRule>,
}

impl Names {
    fn safe(&mut self, wanted: &str) -> String {
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
    fn solid(&mut self, wanted: &str, shape: &Shape, link: usize, tree: &Tree) -> String {
        let name = self.safe(wanted);
        let masks = if shape.visual { [0, 0] } else { shape.masks };
        self.solids.insert(name.clone(), ContactRule { link, body: tree.body[link], masks });
        name
    }
}

/// The shapes of a link that stand for it.
fn solid_shapes(link: &super::Link) -> Vec<&Shape> {
    let colliding: Vec<&Shape> = link.shapes.iter().filter(|s| !s.visual).collect();
    if colliding.is_empty() { link.shapes.iter().collect() } else { colliding }
}

fn solid(name: String, shape: &Shape, pose: &Pose, role: Role) -> Solid {
    Solid { name, role, shape: shape.bounds.moved(pose).thickened(THINNEST_M), seen: true }
}

/// One joint of a model.
struct Piece<'a> {
    model: &'a Model,
    tree: &'a Tree,
    poses: &'a [Pose],
    index: usize,
    joint: &'a ModelJoint,
}

impl Piece<'_> {
    /// For each link whether it moves with the part.
    fn inside(&self) -> Vec<bool> {
        self.tree.beyond(self.index)
    }

    /// The part, and the link that it hangs on; `Err` says why there is none.
    fn part(&self, id: &str, names: &mut Names, notes: &mut Vec<String>) -> Result<(Part, usize), String> {
        let (joint, tree) = (self.joint, self.tree);
        let kind = joint.moves().ok_or("it does not move")?;
        let child = tree.carrier.iter().position(|c| *c == Some(self.index)).ok_or("it moves no link")?;
        let base = tree.parent[child].ok_or("it hangs on no link")?;
        if let (Some(lower), Some(upper)) = (joint.lower, joint.upper)
            && lower >= upper
        {
            return Err(format!("its limits {lower} to {upper} leave no range"));
        }
        let frame = self.poses[child];
        let written = unit(&joint.axis).ok_or("its axis has no direction")?;
        let [closed, open] = joint.closed_and_open();
        let sense = if open >= closed { 1.0 } else { -1.0 };
        let axis = frame.rotation * written * sense;
        let upper = (open - closed).abs();
        other_unit(kind, upper)?;
        let amount = |x: f64| match kind {
            JointKind::Revolute => format!("{:.0}°", x.to_degrees()),
            JointKind::Prismatic => format!("{x:.3} m"),
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
        let inside = self.inside();
        let further: Vec<&str> = self
            .model
            .moving()
            .filter(|(_, j)| self.is_inside(&inside, &j.parent))
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
        let mut solids = Vec::new();
        for (i, link) in self.model.links.iter().enumerate().filter(|(i, _)| inside[*i]) {
            for (k, shape) in solid_shapes(link).into_iter().enumerate() {
                let wanted = shape.name.clone().unwrap_or_else(|| format!("{}_{k}", link.name));
                let is_handle = wanted.to_ascii_lowercase().contains("handle");
                let role = if is_handle { Role::Handle } else { Role::Front };
                solids.push(solid(names.solid(&wanted, shape, i, tree), shape, &self.poses[i], role));
            }
        }
        if solids.is_empty() {
            return Err("its part has no shape that is read".to_owned());
        }
        let corners: Vec<Point> = solids.iter().flat_map(|s| s.shape.corners()).collect();
        if !corners.iter().all(is_near) {
            return Err(format!("its part lies farther than {FAR_M} m away"));
        }
        let size = solids.iter().map(|s| 2.0 * s.shape.half.max()).fold(0.0, f64::max);
        if size > HUGE_M {
            return Err(format!("its part is {size:.0} m long; write it in metres (a scale of 0.001 for millimetres)"));
        }
        let anchor = frame * joint.anchor;
        let line = Articulation { kind, axis, origin: anchor };
        let handle = match check::handle(self.model, tree, child) {
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

    fn is_inside(&self, inside: &[bool], link: &str) -> bool {
        self.model.links.iter().position(|l| l.name == link).is_some_and(|i| inside[i])
    }
}

/// Nothing that a person opens is longer, metres.
const HUGE_M: f64 = 20.0;

/// Refuses a range that only another unit explains.
fn other_unit(kind: JointKind, upper: f64) -> Result<(), String> {
    // Knobs go round twice at the most.
    const TURNS_RAD: f64 = 4.0 * std::f64::consts::PI + 0.1;
    match kind {
        JointKind::Revolute if upper > TURNS_RAD => Err(format!(
            "it turns by {upper:.0} rad, {:.0} times round; write its limits in radians (MJCF: or say angle=\"degree\")",
            upper / std::f64::consts::TAU
        )),
        JointKind::Prismatic if upper > HUGE_M => {
            Err(format!("it slides by {upper:.0} m; write its limits in metres, not in millimetres"))
        }
        _ => Ok(()),
    }
}

/// A home is smaller, metres.
const FAR_M: f64 = 1e3;

fn is_near(p: &Point) -> bool {
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

/// Gives the boards that parts hang on to the nearest of those parts, and the rest to the room. A board that stands inside
/// another part would hold that part fast in a simulation: it is left out. So is one that a part goes through because the
/// file switches their contacts off.
fn boards(
    model: &Model,
    tree: &Tree,
    poses: &[Pose],
    built: &[(usize, usize)],
    twin: &mut Twin,
    names: &mut Names,
    notes: &mut Vec<String>,
) {
    let mut moves = vec![false; model.links.len()];
    for (index, _) in built {
        for (slot, inside) in moves.iter_mut().zip(tree.beyond(*index)) {
            *slot |= inside;
        }
    }
    let contacts = Contacts::of(model, tree);
    let (mut left, mut passed) = (0, 0);
    for (i, link) in model.links.iter().enumerate().filter(|(i, _)| !moves[*i]) {
        // The joints that hang on this very link, else on what is fixed to it.
        let on = |is: &dyn Fn(usize) -> bool| -> Vec<usize> {
            built.iter().enumerate().filter(|(_, (_, base))| is(*base)).map(|(k, _)| k).collect()
        };
        let mut owners = on(&|base| base == i);
        // What no joint hangs on belongs to what is fixed to it, if that has no boxes of its own; else it is the room.
        let is_room = owners.is_empty() && built.iter().all(|(_, base)| !solid_shapes(&model.links[*base]).is_empty());
        if owners.is_empty() {
            owners = on(&|base| tree.body[base] == tree.body[i]);
        }
        for (k, shape) in solid_shapes(link).into_iter().enumerate() {
            let board = shape.bounds.moved(&poses[i]).thickened(THINNEST_M);
            let distance = |owner: &usize| (twin.furniture[*owner].part.bounds.center - board.center).norm();
            let Some(&owner) = owners.iter().min_by(|a, b| distance(a).total_cmp(&distance(b))) else { continue };
            let in_the_way = twin
                .furniture
                .iter()
                .enumerate()
                .any(|(k, f)| k != owner && f.part.solids.iter().any(|s| penetration(&s.shape, &board) > 1e-3));
            if in_the_way || !is_near(&board.center) {
                left += 1;
                continue;
            }
            let mut parts = built.iter().zip(&twin.furniture);
            let passes = parts.any(|((index, _), f)| {
                let inside = tree.beyond(*index);
                let passage = Passage { model, poses, inside: &inside, part: &f.part };
                passage.is_through(&board, |l, s| contacts.off(l, i) || !s.meets(shape))
            });
            if passes {
                passed += 1;
                continue;
            }
            let wanted = shape.name.clone().unwrap_or_else(|| format!("{}_{k}", link.name));
            let name = names.solid(&wanted, shape, i, tree);
            if is_room {
                twin.room.push(Solid { name, role: Role::Room, shape: board, seen: true });
            } else {
                twin.furniture[owner].carcass.push(Solid { name, role: Role::Carcass, shape: board, seen: true });
            }
        }
    }
    if left > 0 {
        notes.push(format!(
            "{left} boards (or boxes around meshes) share space with a part when closed and are left out"
        ));
    }
    if passed > 0 {
        notes.push(format!(
            "{passed} boards that a part goes through, as the file switches their contacts off, are left out"
        ));
    }
}

/// A part on its way, from closed to open.
struct Passage<'a> {
    model: &'a Model,
    poses: &'a [Pose],
    /// For each link whether it moves with the part.
    inside: &'a [bool],
    part: &'a Part,
}

impl Passage<'_> {
    /// Whether the part, closed or on its way, stands in a board with a shape of a link that `slips` past it.
    fn is_through(&self, board: &OrientedBox, slips: impl Fn(usize, &Shape) -> bool) -> bool {
        // Poses over the range: a door's edge comes no farther than a board is thick between two of them.
        const POSES: u32 = 24;
        let joint = &self.part.joint;
        let links = self.model.links.iter().enumerate().filter(|(l, _)| self.inside[*l]);
        links.flat_map(|(l, link)| solid_shapes(link).into_iter().map(move |s| (l, s))).any(|(l, shape)| {
            slips(l, shape) && {
                let closed = shape.bounds.moved(&self.poses[l]);
                (0..=POSES).any(|i| {
                    let opening = joint.upper * f64::from(i) / f64::from(POSES);
                    penetration(&closed.moved(&joint.articulation.motion(opening)), board) > GRAZE_M
                })
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::super::{mjcf, xml};
    use super::*;

    fn twin(text: &str) -> (Twin, Vec<String>) {
        let root = xml::parse(Path::new("m.xml"), text).unwrap();
        to_twin(&mjcf::from_element(Path::new("m.xml"), root).unwrap())
    }

    #[test]
    fn a_joint_that_opens_towards_minus_is_turned_round() {
        let (twin, notes) = twin(
            r#"<mujoco><compiler angle="radian"/><worldbody><body name="box" pos="0 1 0">
            <geom name="back" type="box" size="0.3 0.01 0.4" pos="0 0.5 0"/>
            <body name="left door" pos="-0.3 0 0"><joint name="hinge" range="-1.5 0" damping="1" frictionloss="1"/>
              <geom name="panel" type="box" size="0.3 0.01 0.4" pos="0.3 0 0" mass="4"/>
              <geom name="handle" type="box" size="0.01 0.02 0.1" pos="0.55 -0.05 0" mass="0.1"/>
              <body name="knob"><joint name="turn" type="hinge" axis="0 1 0" range="0 1"/><geom name="k" size="0.01"/></body>
            </body></body></worldbody></mujoco>"#,
        );
        assert_eq!(twin.furniture.len(), 2, "{:?}", twin.left_out);
        let door = &twin.furniture[0].part;
        let phi = door.joint.articulation;
        assert_eq!((phi.axis, door.joint.upper), (-Vector::z(), 1.5));
        assert!(phi.line().distance(&Point::new(-0.3, 1.0, 7.0)) < 1e-12);
        assert!((door.handle - Point::new(0.25, 0.95, 0.0)).norm() < 1e-12);
        // It opens towards -y, and so does its face look.
        assert!((phi.motion(0.1) * door.handle - door.handle).y < 0.0);
        assert!((door.bounds.rotation.column(2) + Vector::y()).norm() < 1e-9);
        assert!((door.bounds.rotation.determinant() - 1.0).abs() < 1e-9);
        assert_eq!(door.solids.iter().filter(|s| s.role == Role::Handle).count(), 1);
        assert_eq!(twin.furniture[0].carcass.len(), 1);
        assert!(notes.iter().any(|n| n.contains("turn further down")), "{notes:?}");
        assert!(notes.iter().any(|n| n.contains("turn: has no damping")), "{notes:?}");
    }

    #[test]
    fn a_board_inside_a_part_does_not_hold_it() {
        let (twin, notes) = twin(
            r#"<mujoco><worldbody><body name="cabinet"><geom name="hull" type="box" size="0.5 0.5 0.5"/>
            <body name="a"><joint name="upper" type="slide" axis="0 -1 0" range="0 0.4"/>
              <geom type="box" size="0.4 0.4 0.1" pos="0 0 0.3"/></body>
            <body name="b"><joint name="lower" type="slide" axis="0 -1 0" range="0 0.4"/>
              <geom type="box" size="0.4 0.4 0.1" pos="0 0 -0.3"/></body>
            <body name="c"><joint name="loose" type="slide" axis="0 0 0"/><geom size="0.1"/></body>
            </body></worldbody></mujoco>"#,
        );
        assert_eq!(twin.furniture.len(), 2);
        assert!(twin.furniture.iter().all(|f| f.carcass.is_empty()));
        assert!(notes.iter().any(|n| n.starts_with("1 boards")), "{notes:?}");
        assert!(twin.left_out[0].id == "loose" && twin.left_out[0].reason.contains("no direction"));
        assert!((twin.density_kg_per_m3 - 1000.0).abs() < 1e-6);
    }
}
