//! A twin as URDF, MJCF and glTF: `&Twin -> bytes`, no IO, no recording.
//!
//! All formats share one set of frames: a part's link sits at its joint's origin with the world's axes, a base at the
//! world's origin. Boxes keep their own orientation.

pub mod gltf;
pub mod mjcf;
pub mod urdf;

use crate::error::{Error, Result};
use crate::math::{Point, Pose};
use crate::twin::{OrientedBox, Role, Twin};

/// RGBA of a role.
pub(crate) fn color(role: Role) -> [f64; 4] {
    match role {
        Role::Front => [0.80, 0.68, 0.52, 1.0],
        Role::Handle => [0.25, 0.26, 0.28, 1.0],
        Role::Tray => [0.88, 0.86, 0.82, 1.0],
        Role::Carcass => [0.72, 0.73, 0.74, 1.0],
        Role::Room => [0.62, 0.63, 0.62, 1.0],
    }
}

/// Name of a role's material.
pub(crate) fn material(role: Role) -> &'static str {
    match role {
        Role::Front => "front",
        Role::Handle => "handle",
        Role::Tray => "tray",
        Role::Carcass => "carcass",
        Role::Room => "room",
    }
}

/// Pose of a box in a frame with the world's axes at `origin`.
pub(crate) fn local_pose(shape: &OrientedBox, origin: &Point) -> Pose {
    Pose::from_parts((shape.center - origin).into(), shape.orientation())
}

/// Refuses what no simulator loads: names that repeat or have other characters than `[A-Za-z0-9_]`, sizes and masses
/// that are not positive, limits that no part has, anything farther away than a home is wide.
///
/// # Errors
/// Naming the part and what is wrong with it.
pub fn check(twin: &Twin) -> Result<()> {
    // A home is smaller, and single precision still tells millimetres there.
    const FAR_M: f64 = 1e3;
    let fault = |text: String| Err(Error::Export(text));
    if !(twin.density_kg_per_m3.is_finite() && twin.density_kg_per_m3 > 0.0) {
        return fault(format!("density {} must be positive", twin.density_kg_per_m3));
    }
    if twin.name.chars().any(char::is_control) {
        return fault("the twin's name has control characters".to_owned());
    }
    // Names that the formats add must not be taken either.
    let mut names: std::collections::BTreeSet<String> =
        ["world", "floor", "scene", mjcf::ROOT].map(str::to_owned).into();
    for f in &twin.furniture {
        let id = &f.part.id;
        let derived = [format!("{}_fixed", f.name), format!("{id}_link"), format!("{id}_handle")];
        let solids = || f.carcass.iter().chain(&f.part.solids);
        let own = [&f.name, id].into_iter().chain(solids().map(|s| &s.name)).cloned();
        for name in own.chain(derived).chain(solids().map(|s| format!("{}_visual", s.name))) {
            if name.is_empty() || !name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_') {
                return fault(format!("name \"{name}\": only letters, digits and _ are safe in all formats"));
            }
            if let Some(name) = names.replace(name) {
                return fault(format!("name \"{name}\" is used twice"));
            }
        }
        for s in solids() {
            let b = &s.shape;
            let sizes = b.half.iter().all(|h| *h > 0.0 && *h < FAR_M);
            let orthonormal = (b.rotation.transpose() * b.rotation - nalgebra::Matrix3::identity()).norm() < 1e-6;
            if !(sizes && orthonormal && b.rotation.determinant() > 0.0 && near(&b.center, FAR_M)) {
                return fault(format!(
                    "box {}: sizes must be positive, axes right-handed and orthonormal, all within {FAR_M} m",
                    s.name
                ));
            }
        }
        if f.part.solids.is_empty() || f.carcass.is_empty() {
            return fault(format!("{id}: a part and its base need at least one box each"));
        }
        let joint = &f.part.joint;
        let unit = (joint.articulation.axis.norm() - 1.0).abs() < 1e-6;
        // A turn, or the length of a room.
        let most = match joint.articulation.kind {
            crate::articulation::JointKind::Revolute => std::f64::consts::TAU,
            crate::articulation::JointKind::Prismatic => 10.0,
        };
        let opens = joint.upper > 0.0 && joint.upper <= most;
        let resists = [joint.damping, joint.friction].iter().all(|x| x.is_finite() && *x >= 0.0);
        if !(unit && opens && resists && near(&joint.articulation.origin, FAR_M) && near(&f.part.handle, FAR_M)) {
            return fault(format!(
                "{id}: the axis must be a unit vector, the upper limit positive and at most {most:.2}, damping and friction \
                 not negative, origin and handle within {FAR_M} m"
            ));
        }
    }
    Ok(())
}

fn near(p: &Point, limit: f64) -> bool {
    p.coords.iter().all(|c| c.abs() < limit)
}
