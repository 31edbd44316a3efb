//! What a twin looks like: textured triangles beside its boxes. They are for eyes alone; boxes carry contacts and masses.

use std::collections::BTreeMap;

use crate::math::{Point, Vector};

/// A picture that meshes refer to.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Texture {
    /// Name, unique in the look; letters, digits and underscores, so that it can name a file.
    pub name: String,
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// sRGB, 8 bits a channel, three channels, rows from the top: `3 * width * height` bytes.
    pub rgb: Vec<u8>,
}

/// Triangles with one texture.
#[derive(Debug, Clone, PartialEq)]
pub struct TexturedMesh {
    /// Vertices in the world with every part closed, metres.
    pub positions: Vec<Point>,
    /// A unit normal a vertex, world.
    pub normals: Vec<Vector>,
    /// A texture coordinate a vertex, 0 to 1; (0, 0) is the picture's upper left corner.
    pub uv: Vec<[f32; 2]>,
    /// Vertex numbers, counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
    /// Index in [`Look::textures`].
    pub texture: usize,
    /// Share of the surface whose colour was seen; the rest has a colour taken from what was seen.
    pub seen: f64,
}

/// The looks of a whole twin.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Look {
    /// Pictures.
    pub textures: Vec<Texture>,
    /// What does not move.
    pub room: Vec<TexturedMesh>,
    /// Moving parts by the joint's id, closed.
    pub parts: BTreeMap<String, Vec<TexturedMesh>>,
}
