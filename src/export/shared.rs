//! What all formats share: names, roles and their colours, poses of boxes, and what no format can say.

use std::collections::BTreeSet;

use nalgebra::{Matrix3, Rotation3, UnitQuaternion};

use crate::error::{Error, Result};
use crate::math::{Point, Pose, Vector, eigen_descending};
use crate::twin::{OrientedBox, Role, Twin};

/// The body that holds all furniture, and the default prim of USD: a scene can move the kitchen as one, and Pinocchio reads one
/// root body only.
pub(super) const ROOT: &str = "kitchen";

/// The scope of USD's materials.
pub(super) const MATERIALS: &str = "materials";

/// Every role, in the order of the materials.
pub(super) const ROLES: [Role; 5] = [Role::Front, Role::Handle, Role::Tray, Role::Carcass, Role::Room];

/// The body that holds the room's boxes, where there are any.
pub(crate) const ROOM: &str = "room";

/// RGBA of a role.
pub(super) fn color(role: Role) -> [f64; 4] {
    match role {
        Role::Front => [0.80, 0.68, 0.52, 1.0],
        Role::Handle => [0.25, 0.26, 0.28, 1.0],
        Role::Tray => [0.88, 0.86, 0.82, 1.0],
        Role::Carcass => [0.72, 0.73, 0.74, 1.0],
        Role::Room => [0.62, 0.63, 0.62, 1.0],
    }
}

/// Name of a role's material.
pub(super) fn material(role: Role) -> &'static str {
    match role {
        Role::Front => "front",
        Role::Handle => "handle",
        Role::Tray => "tray",
        Role::Carcass => "carcass",
        Role::Room => "room",
    }
}

/// Pose of a box in a frame with the world's axes at `origin`.
pub(super) fn local_pose(shape: &OrientedBox, origin: &Point) -> Pose {
    Pose::from_parts((shape.center - origin).into(), shape.orientation())
}

/// Rotation that turns +X onto a unit axis: for formats whose joints turn about or slide along an axis of their frame.
pub(super) fn from_x(axis: &Vector) -> UnitQuaternion<f64> {
    // Straight back, every half turn about a direction square to X does.
    UnitQuaternion::rotation_between(&Vector::x(), axis)
        .unwrap_or_else(|| UnitQuaternion::from_axis_angle(&Vector::z_axis(), std::f64::consts::PI))
}

/// Principal moments of an inertia (kg m^2, largest first), and the rotation from the principal axes to its own.
pub(super) fn principal(inertia: &Matrix3<f64>) -> (Vector, UnitQuaternion<f64>) {
    let (mut axes, moments) = eigen_descending(*inertia);
    if axes.determinant() < 0.0 {
        let last = -axes.column(2).into_owned();
        axes.set_column(2, &last);
    }
    (moments, UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(axes)))
}

/// Refuses what no simulator loads: names that repeat, begin with a digit or have other characters than `[A-Za-z0-9_]`,
/// sizes and masses that are not positive, limits that no part has, anything farther away than a home is wide.
///
/// # Errors
/// Naming the part and what is wrong with it.
pub fn check(twin: &Twin) -> Result<()> {
    names(twin).map(|_| ())
}

/// All names that the formats give to what is in a checked twin.
pub(super) fn names(twin: &Twin) -> Result<BTreeSet<String>> {
    let fault = |text: String| Err(Error::Export(text));
    if !(twin.density_kg_per_m3.is_finite() && twin.density_kg_per_m3 > 0.0) {
        return fault(format!("density {} must be positive", twin.density_kg_per_m3));
    }
    let drives = &twin.drives;
    let most = [drives.hinge_effort, drives.hinge_velocity, drives.slide_effort, drives.slide_velocity];
    if !most.iter().all(|x| x.is_finite() && *x > 0.0) {
        return fault("drives: efforts and velocities must be positive".to_owned());
    }
    if twin.name.chars().any(char::is_control) {
        return fault("the twin's name has control characters".to_owned());
    }
    // Names that the formats add must not be taken either.
    let mut names: BTreeSet<String> =
        ["world", "floor", "scene", ROOT, ROOM, "room_fixed", MATERIALS].map(str::to_owned).into();
    let mut take = |name: String| {
        if !is_name(&name) {
            return Err(Error::Export(format!(
                "name \"{name}\": only letters, digits and _, the first no digit, are safe in all formats"
            )));
        }
        match names.replace(name) {
            Some(name) => Err(Error::Export(format!("name \"{name}\" is used twice"))),
            None => Ok(()),
        }
    };
    for f in &twin.furniture {
        let id = &f.part.id;
        let derived = [
            format!("{}_fixed", f.name),
            format!("{id}_link"),
            format!("{id}_handle"),
            format!("{id}_frame"),
            format!("{id}_furniture"),
        ];
        for name in [&f.name, id].into_iter().cloned().chain(derived) {
            take(name)?;
        }
        for s in f.carcass.iter().chain(&f.part.solids) {
            take(s.name.clone())?;
            take(format!("{}_visual", s.name))?;
        }
        f.check().map_err(Error::Export)?;
    }
    for s in &twin.room {
        take(s.name.clone())?;
        take(format!("{}_visual", s.name))?;
        s.check().map_err(Error::Export)?;
    }
    Ok(names)
}

/// Whether a name is one in all formats: USD's are identifiers.
pub(super) fn is_name(name: &str) -> bool {
    name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_')
        && name.chars().next().is_some_and(|c| !c.is_ascii_digit())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn x_is_turned_onto_every_axis() {
        let nearly_back = Vector::new(-1.0, 1e-9, 0.0).normalize();
        for axis in [Vector::x(), -Vector::x(), Vector::y(), -Vector::z(), nearly_back, Vector::repeat(1.0).normalize()]
        {
            assert!((from_x(&axis) * Vector::x() - axis).norm() < 1e-7, "{axis}");
        }
    }

    #[test]
    fn principal_axes_and_moments_make_the_inertia_again() {
        let turn = Rotation3::from_euler_angles(0.3, -0.8, 2.0);
        for moments in [Vector::new(0.1, 0.5, 0.55), Vector::new(0.2, 0.2, 0.3), Vector::repeat(0.4)] {
            let inertia = turn.matrix() * Matrix3::from_diagonal(&moments) * turn.matrix().transpose();
            let (found, axes) = principal(&inertia);
            let axes = *axes.to_rotation_matrix().matrix();
            assert!((axes * Matrix3::from_diagonal(&found) * axes.transpose() - inertia).norm() < 1e-12);
        }
    }
}
