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
    }
}

/// Name of a role's material.
pub(crate) fn material(role: Role) -> &'static str {
    match role {
        Role::Front => "front",
        Role::Handle => "handle",
        Role::Tray => "tray",
        Role::Carcass => "carcass",
    }
}

/// Pose of a box in a frame with the world's axes at `origin`.
pub(crate) fn local_pose(shape: &OrientedBox, origin: &Point) -> Pose {
    Pose::from_parts((shape.center - origin).into(), shape.orientation())
}

/// Refuses what no simulator loads: names that repeat or have other characters than `[A-Za-z0-9_]`, sizes and masses
/// that are not positive, limits that are not in order.
///
/// # Errors
/// Naming the part and what is wrong with it.
pub fn check(twin: &Twin) -> Result<()> {
    let mut names = std::collections::BTreeSet::new();
    for f in &twin.furniture {
        for name in [&f.name, &f.part.id].into_iter().chain(f.carcass.iter().chain(&f.part.solids).map(|s| &s.name)) {
            if name.is_empty() || !name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_') {
                return Err(Error::Export(format!(
                    "name \"{name}\": only letters, digits and _ are safe in all formats"
                )));
            }
            if !names.insert(name) {
                return Err(Error::Export(format!("name \"{name}\" is used twice")));
            }
        }
        for s in f.carcass.iter().chain(&f.part.solids) {
            let positive = s.shape.half.iter().all(|h| h.is_finite() && *h > 0.0);
            let rotation =
                (s.shape.rotation.transpose() * s.shape.rotation - nalgebra::Matrix3::identity()).norm() < 1e-6;
            if !positive || !rotation || s.shape.center.coords.iter().any(|c| !c.is_finite()) {
                return Err(Error::Export(format!(
                    "box {}: sizes must be positive, axes orthonormal, all finite",
                    s.name
                )));
            }
        }
        let joint = &f.part.joint;
        let unit = (joint.articulation.axis.norm() - 1.0).abs() < 1e-6;
        if f.part.solids.is_empty() || f.carcass.is_empty() {
            return Err(Error::Export(format!("{}: a part and its base need at least one box each", f.part.id)));
        }
        let opens = joint.upper.is_finite() && joint.upper > 0.0;
        let resists = joint.damping >= 0.0 && joint.friction >= 0.0;
        if !(unit && opens && resists) {
            return Err(Error::Export(format!(
                "{}: the axis must be a unit vector, the upper limit positive, damping and friction not negative",
                f.part.id
            )));
        }
    }
    Ok(())
}
