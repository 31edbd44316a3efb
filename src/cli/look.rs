//! The look beside a twin, as `paws twin` wrote it: meshes of `scene.glb`, pictures of `look/`. What is written of it again
//! is the same, byte for byte.

use std::path::Path;

use anyhow::{Context, bail};
use serde::Deserialize;

use super::shown;
use crate::export::dress::FOLDER;
use crate::look::{Look, Texture, TexturedMesh};
use crate::math::{Point, Vector};
use crate::twin::Twin;

/// The extras of a node with a textured mesh.
#[derive(Deserialize)]
struct Extras {
    look: Tag,
}

#[derive(Deserialize)]
struct Tag {
    link: String,
    seen: f64,
}

/// The look in a twin's folder, `None` where it has none. Meshes of parts that the twin has no more are left out.
pub fn read(dir: &Path, twin: &Twin) -> anyhow::Result<Option<Look>> {
    let path = dir.join("scene.glb");
    if !(dir.join(FOLDER).is_dir() && path.is_file()) {
        return Ok(None);
    }
    let bytes = std::fs::read(&path).with_context(|| shown(&path))?;
    let file = crate::import::formats::cloud::document(&path, &bytes)?;
    let blob = file.blob.as_deref().unwrap_or_default();
    let mut look = Look::default();
    for image in file.images() {
        look.textures.push(texture(dir, image.name().unwrap_or_default())?);
    }
    for node in file.nodes() {
        let Some(tag) = tag(&node) else { continue };
        let origin = if tag.link == crate::export::ROOM {
            Point::origin()
        } else {
            let Some(f) = twin.furniture.iter().find(|f| f.part.id == tag.link) else { continue };
            f.part.joint.articulation.origin
        };
        for primitive in node.mesh().iter().flat_map(gltf::Mesh::primitives) {
            let Some(mesh) = mesh(&primitive, blob, &origin, tag.seen) else {
                bail!("{}: a mesh of {} is not as paws writes it", shown(&path), tag.link);
            };
            if tag.link == crate::export::ROOM {
                look.room.push(mesh);
            } else {
                look.parts.entry(tag.link.clone()).or_default().push(mesh);
            }
        }
    }
    Ok(Some(look))
}

fn tag(node: &gltf::Node) -> Option<Tag> {
    let extras = node.extras().as_ref()?;
    serde_json::from_str::<Extras>(extras.get()).ok().map(|extras| extras.look)
}

fn texture(dir: &Path, name: &str) -> anyhow::Result<Texture> {
    // It becomes a path.
    if name.is_empty() || !name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_') {
        bail!("{}: its pictures do not have the names that paws gives them", shown(&dir.join("scene.glb")));
    }
    let path = dir.join(FOLDER).join(format!("{name}.png"));
    let picture = image::open(&path).with_context(|| shown(&path))?.into_rgb8();
    let (width, height) = picture.dimensions();
    Ok(Texture { name: name.to_owned(), width, height, rgb: picture.into_raw() })
}

fn mesh(primitive: &gltf::Primitive, blob: &[u8], origin: &Point, seen: f64) -> Option<TexturedMesh> {
    let reader = primitive.reader(|_| Some(blob));
    let vector = |v: [f32; 3]| Vector::from(v.map(f64::from));
    let corners: Vec<u32> = reader.read_indices()?.into_u32().collect();
    Some(TexturedMesh {
        positions: reader.read_positions()?.map(|p| origin + vector(p)).collect(),
        normals: reader.read_normals()?.map(vector).collect(),
        uv: reader.read_tex_coords(0)?.into_f32().collect(),
        triangles: corners.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect(),
        texture: primitive.material().pbr_metallic_roughness().base_color_texture()?.texture().source().index(),
        seen,
    })
}
