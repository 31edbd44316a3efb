//! A model as furniture: one piece for each joint that moves, in the world frame with everything closed.

use super::contacts::Contacts;
use super::links::{JointType, Model, Shape};
use super::moving_joint::{MovingJoint, Names, THINNEST_M, is_near, solid_shapes};
use super::penetration::penetration;
use super::sweep::GRAZE_M;
use super::tree::Tree;
use crate::math::Pose;
use crate::twin::{ContactRules, Furniture, LeftOut, OrientedBox, Part, Role, Solid, Twin};

/// Where a model states no mass: light wood and board, kg/m^3.
const DENSITY: f64 = 700.0;
/// A board that stands deeper in a closed part shares space with it, metres.
const SHARED_M: f64 = 1e-3;

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
        drives: crate::config::Drives::default(),
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
    let mut building =
        Building { model, tree: &tree, poses: &poses, names: Names::default(), built: Vec::new(), twin, notes };
    building.parts();
    building.boards();
    let Building { names, twin, notes, .. } = building;
    let contacts = Contacts::of(model, &tree);
    let rules = ContactRules { solids: names.solids, excluded: contacts.excluded_pairs(), family: contacts.families() };
    (twin, rules, notes)
}

/// A twin in the making.
struct Building<'a> {
    model: &'a Model,
    tree: &'a Tree,
    /// `world_from_link` with everything closed.
    poses: &'a [Pose],
    names: Names,
    /// For each piece of furniture its joint and the link that the part hangs on, by index.
    built: Vec<(usize, usize)>,
    twin: Twin,
    notes: Vec<String>,
}

impl Building<'_> {
    /// A part for each joint that a hand can move, and the reason for each other one.
    fn parts(&mut self) {
        let (model, tree, poses) = (self.model, self.tree, self.poses);
        let (mut mass, mut volume) = (0.0, 0.0);
        // Joints come first: they are asked for by name, and what else has that name gets another.
        let ids: Vec<String> = model.moving().map(|(_, j)| self.names.safe(&j.name)).collect();
        for ((index, joint), id) in model.moving().zip(ids) {
            let moving = MovingJoint { model, tree, poses, index, joint };
            match moving.part(&id, &mut self.names, &mut self.notes) {
                Ok((part, base)) => {
                    if let Some(kilograms) = moving.mass() {
                        mass += kilograms;
                        volume += part.solids.iter().map(|s| s.shape.volume()).sum::<f64>();
                    }
                    let name = self.names.safe(&format!("{}_base", part.id));
                    self.twin.furniture.push(Furniture { name, carcass: Vec::new(), part });
                    self.built.push((index, base));
                }
                Err(reason) => self.twin.left_out.push(LeftOut { id, reason }),
            }
        }
        for joint in model.joints.iter().filter(|j| j.kind == JointType::Other) {
            let reason = "it moves in several directions at once; only hinges and slides are replayed".to_owned();
            self.twin.left_out.push(LeftOut { id: self.names.safe(&joint.name), reason });
        }
        self.density(mass, volume);
    }

    /// One density for all, from the mass (kg) and the volume (m^3) of the parts that state one.
    fn density(&mut self, mass: f64, volume: f64) {
        if mass > 0.0 && volume > 0.0 && mass.is_finite() {
            self.twin.density_kg_per_m3 = mass / volume;
            self.notes.push(format!(
                "all parts have one density: {:.0} kg/m^3, their mass over the volume of their boxes",
                self.twin.density_kg_per_m3
            ));
        } else if !self.twin.furniture.is_empty() {
            self.notes.push(format!("no part states its mass; {DENSITY} kg/m^3 is taken"));
        }
    }

    /// Gives the boards that parts hang on to the nearest of those parts, and the rest to the room. A board that stands
    /// inside another part would hold that part fast in a simulation: it is left out. So is one that a part goes through
    /// because the file switches their contacts off.
    fn boards(&mut self) {
        let (model, tree) = (self.model, self.tree);
        let mut moves = vec![false; model.links.len()];
        for (index, _) in &self.built {
            for (slot, inside) in moves.iter_mut().zip(tree.beyond(*index)) {
                *slot |= inside;
            }
        }
        let contacts = Contacts::of(model, tree);
        let (mut left, mut passed) = (0, 0);
        for (i, link) in model.links.iter().enumerate().filter(|(i, _)| !moves[*i]) {
            let (owners, is_room) = self.owners(i);
            for (k, shape) in solid_shapes(link).into_iter().enumerate() {
                let board = shape.bounds.moved(&self.poses[i]).thickened(THINNEST_M);
                let distance = |owner: &usize| (self.twin.furniture[*owner].part.bounds.center - board.center).norm();
                let Some(&owner) = owners.iter().min_by(|a, b| distance(a).total_cmp(&distance(b))) else { continue };
                if self.is_in_another_part(&board, owner) || !is_near(&board.center) {
                    left += 1;
                    continue;
                }
                if self.is_passed(&board, shape, i, &contacts) {
                    passed += 1;
                    continue;
                }
                let wanted = shape.name.clone().unwrap_or_else(|| format!("{}_{k}", link.name));
                let name = self.names.solid(&wanted, shape, i, tree);
                if is_room {
                    self.twin.room.push(Solid { name, role: Role::Room, shape: board, seen: true });
                } else {
                    let carcass = &mut self.twin.furniture[owner].carcass;
                    carcass.push(Solid { name, role: Role::Carcass, shape: board, seen: true });
                }
            }
        }
        if left > 0 {
            self.notes.push(format!(
                "{left} boards (or boxes around meshes) share space with a part when closed and are left out"
            ));
        }
        if passed > 0 {
            self.notes.push(format!(
                "{passed} boards that a part goes through, as the file switches their contacts off, are left out"
            ));
        }
    }

    /// The pieces of furniture that a link's boards may belong to, by index, and whether the boards are the room's.
    fn owners(&self, link: usize) -> (Vec<usize>, bool) {
        // The joints that hang on this very link, else on what is fixed to it.
        let on = |is: &dyn Fn(usize) -> bool| -> Vec<usize> {
            self.built.iter().enumerate().filter(|(_, (_, base))| is(*base)).map(|(k, _)| k).collect()
        };
        let owners = on(&|base| base == link);
        if !owners.is_empty() {
            return (owners, false);
        }
        // What no joint hangs on belongs to what is fixed to it, if that has no boxes of its own; else it is the room.
        let has_boxes = |(_, base): &(usize, usize)| !solid_shapes(&self.model.links[*base]).is_empty();
        (on(&|base| self.tree.body[base] == self.tree.body[link]), self.built.iter().all(has_boxes))
    }

    /// Whether a board stands in a part of another piece of furniture than its owner, all closed.
    fn is_in_another_part(&self, board: &OrientedBox, owner: usize) -> bool {
        let others = self.twin.furniture.iter().enumerate().filter(|(k, _)| *k != owner);
        others.flat_map(|(_, f)| &f.part.solids).any(|s| penetration(&s.shape, board) > SHARED_M)
    }

    /// Whether a part goes through a board of a link, whose contact with it the file switches off.
    fn is_passed(&self, board: &OrientedBox, shape: &Shape, link: usize, contacts: &Contacts) -> bool {
        self.built.iter().zip(&self.twin.furniture).any(|((index, _), f)| {
            let inside = self.tree.beyond(*index);
            let passage = Passage { model: self.model, poses: self.poses, inside: &inside, part: &f.part };
            passage.is_through(board, |l, s| contacts.off(l, link) || !s.meets(shape))
        })
    }
}

/// The first faults in one text: every joint gets it as its reason.
fn few(faults: &[String]) -> String {
    const MOST: usize = 5;
    let shown = faults.get(..MOST).unwrap_or(faults).join("; ");
    if faults.len() > MOST { format!("{shown}; and {} more", faults.len() - MOST) } else { shown }
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
    use crate::math::{Point, Vector};

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
