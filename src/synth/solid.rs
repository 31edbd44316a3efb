//! The true kitchen as a twin, for simulations of what a robot does in it. Never an input of the pipeline.

use nalgebra::Matrix3;

use super::kitchen::{BOARD, HANDLE, Kitchen, OpenPart, TRAY};
use crate::articulation::JointKind;
use crate::config;
use crate::math::Vector;
use crate::twin::{Furniture, Joint, OrientedBox, Part, Role, Solid, Twin};

/// The kitchen, closed: its parts with damping and friction of the table, what does not move as the room.
pub(super) fn twin(kitchen: &Kitchen, name: String, up: &Vector, priors: &config::Priors) -> Twin {
    let room = kitchen.fixed.iter().enumerate().map(|(i, block)| Solid {
        name: format!("fixed_{i:03}"),
        role: Role::Room,
        shape: block.shape,
        seen: true,
    });
    Twin {
        name,
        density_kg_per_m3: priors.boards.density_kg_per_m3,
        drives: priors.drives.clone(),
        furniture: kitchen.parts.iter().map(|part| furniture(part, up, priors)).collect(),
        room: room.filter(|solid| solid.check().is_ok()).collect(),
        left_out: Vec::new(),
    }
}

fn furniture(part: &OpenPart, up: &Vector, priors: &config::Priors) -> Furniture {
    let id = &part.id;
    let solids = part.blocks.iter().enumerate().map(|(i, block)| {
        let (word, role) = match block.color {
            HANDLE => ("handle", Role::Handle),
            TRAY => ("tray", Role::Tray),
            _ => ("front", Role::Front),
        };
        Solid { name: format!("{id}_{word}_{i}"), role, shape: block.shape, seen: true }
    });
    let phi = part.articulation;
    let slide = phi.kind == JointKind::Prismatic;
    let (damping, friction) = match phi.kind {
        JointKind::Prismatic => (priors.resistance.slide_damping, priors.resistance.slide_friction),
        JointKind::Revolute => (priors.resistance.hinge_damping, priors.resistance.hinge_friction),
    };
    Furniture {
        name: format!("{id}_base"),
        carcass: vec![Solid { name: format!("{id}_back"), role: Role::Carcass, shape: back(&part.base), seen: true }],
        part: Part {
            id: id.clone(),
            label: part.noun.to_owned(),
            joint: Joint {
                articulation: crate::articulation::Articulation {
                    origin: if slide { part.bounds.center } else { phi.line().project(&part.bounds.center) },
                    ..phi
                },
                upper: part.upper,
                observed: part.upper,
                expected: part.upper,
                probability: None,
                damping,
                friction,
                resistance_seen: false,
                // Springs carry what would fall open or shut.
                balanced: !slide && phi.axis.dot(up).abs() < 0.5,
            },
            solids: solids.filter(|solid| solid.check().is_ok()).collect(),
            handle: part.handle,
            bounds: faced(&part.bounds),
        },
    }
}

/// The board at the back of a piece: its boxes' y goes out of the furniture.
fn back(base: &OrientedBox) -> OrientedBox {
    let half = Vector::new(base.half.x, 0.5 * BOARD, base.half.z);
    OrientedBox { center: base.center - base.rotation * Vector::new(0.0, base.half.y - half.y, 0.0), half, ..*base }
}

/// The same box in the axes of its face: right, up, out.
fn faced(bounds: &OrientedBox) -> OrientedBox {
    let [x, y, z] = [0, 1, 2].map(|i| bounds.rotation.column(i).into_owned());
    OrientedBox {
        half: Vector::new(bounds.half.x, bounds.half.z, bounds.half.y),
        rotation: Matrix3::from_columns(&[-x, z, y]),
        ..*bounds
    }
}

#[cfg(test)]
mod tests {
    use crate::synth::{Recorded, SynthOptions, Tier};
    use crate::twin::Role;

    #[test]
    fn a_true_kitchen_can_be_built_and_has_its_handles_where_they_are_held() {
        for (seed, tier) in [(1, Tier::Realistic), (2, Tier::T2), (3, Tier::Nonm)] {
            let recorded = Recorded::new(&SynthOptions { seed, tier, width: 64, parts: 3 }).unwrap();
            let twin = recorded.twin();
            assert_eq!(twin.furniture.len(), recorded.kitchen().parts.len());
            assert!(twin.room.len() > 5);
            for furniture in &twin.furniture {
                furniture.check().unwrap();
                let part = &furniture.part;
                let held = part.solids.iter().filter(|s| s.role == Role::Handle).any(|s| {
                    let half = s.shape.half.map(|h| h + 1e-6);
                    crate::twin::OrientedBox { half, ..s.shape }.contains(&part.handle)
                });
                assert!(held, "seed {seed}: {}", part.id);
                // Its box has the axes of its face: the handle stands out of it.
                let out = part.bounds.rotation.column(2).dot(&(part.handle - part.bounds.center));
                assert!(out > 0.0 || part.label == "bin" || part.label == "chest", "seed {seed}: {}", part.id);
            }
        }
    }
}
