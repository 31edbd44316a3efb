//! A twin as URDF, MJCF, glTF and USD: `&Twin -> bytes`, no IO, no recording.
//!
//! With a look beside it, textured meshes are shown in the place of boxes: a part's where it has meshes of its own, all
//! fixed boxes where the room has. Boxes go on to carry contacts and masses.
//!
//! All formats share one set of frames: a part's link sits at its joint's origin with the world's axes, a base and the
//! room at the world's origin. Boxes keep their own orientation.

pub mod annotations;
pub mod dress;
mod format_table;
pub mod gltf;
pub mod mjcf;
mod shared;
pub mod urdf;
pub mod usd;

pub use format_table::{
    ExportContext, ExportFile, ExportFormat, ExportedFiles, FORMATS, Need, Purpose, VIEWED, named, names_of,
};
#[cfg(feature = "cli")]
pub(crate) use shared::ROOM;
pub use shared::check;
