//! Anybody's URDF or MJCF as plain data: links, joints, boxes. Readers, the points of "simulation-ready" that need no
//! simulator ([`check`]), and the way to a [`crate::twin::Twin`] ([`furniture::to_twin`]).
//!
//! A link's frame is the one that its file gives it; a joint's `parent_from_child` is the pose at position 0. What a
//! reader passes over is listed in [`Model::notes`].

mod angles;
pub mod check;
mod contacts;
mod findings;
pub mod furniture;
pub mod glb;
mod gltf_extensions;
mod gltf_file;
mod gltf_keyframes;
mod joint_limits;
mod kinds;
mod links;
mod masses;
mod mesh_files;
pub mod mjcf;
mod mjcf_assets;
mod mjcf_builder;
mod mjcf_context;
mod mjcf_equality;
mod mjcf_geoms;
mod mjcf_refusals;
mod mjcf_schema;
mod mjcf_tree;
mod mjcf_values;
mod moving_joint;
mod part_sizes;
mod penetration;
mod places;
mod png_files;
mod rigid_bodies;
mod shapes;
mod sweep;
mod traps;
mod tree;
pub mod urdf;
mod urdf_geometry;
mod urdf_names;
mod weights;
mod xml;

pub use kinds::is_gltf;
pub use links::{JointType, Link, MassSource, Model, ModelFormat, ModelJoint, Shape, WORLD};
pub use penetration::penetration;
pub use tree::Tree;

use std::path::Path;

use crate::error::{Error, Result};

/// Reads a URDF or MJCF file, whichever it is.
///
/// # Errors
/// Where it cannot be read, is neither of the two, or holds what no model can.
pub fn read(path: &Path) -> Result<Model> {
    if let Some(found) = kinds::foreign(path, &kinds::head(path)) {
        return Err(Error::format(path, "file", format!("{found}; {}", kinds::WANTED)));
    }
    let text = xml::read_text(path)?;
    let root = xml::parse(path, &text)?;
    if root.name == "mujoco" {
        return mjcf::from_element(path, root);
    }
    if root.name == "robot" {
        return urdf::from_element(path, &text, &root);
    }
    let place = format!("line {}", root.line);
    Err(Error::format(path, place, format!("{}; {}", kinds::foreign_root(&root.name), kinds::WANTED)))
}

/// Whether a file is a model: by its ending, and of XML, which much else is too, by its first element.
#[must_use]
pub fn is_model(path: &Path) -> bool {
    let ending = path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase()).unwrap_or_default();
    match ending.as_str() {
        "urdf" | "glb" | "gltf" | "mjcf" => true,
        "xml" => root_name(path).is_ok_and(|name| name == "mujoco" || name == "robot"),
        _ => false,
    }
}

/// Name of an XML file's first element.
///
/// # Errors
/// Where the file cannot be read or has none.
pub fn root_name(path: &Path) -> Result<String> {
    xml::root_name(path, &xml::read_text(path)?)
}
