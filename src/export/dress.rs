//! A look made ready for the formats: meshes in the frames of their links, their names, and the files beside the models.
//!
//! All formats show the same numbers: they are rounded here, once, and so that rounding again changes nothing.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use image::codecs::jpeg::JpegEncoder;
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder};
use rayon::prelude::*;

use super::shared::{self, ROOM, is_name};
use crate::error::{Error, Result};
use crate::look::{Look, Texture, TexturedMesh};
use crate::math::{Point, Vector, unit};
use crate::twin::{FAR_M, Twin};

/// The folder beside the models with meshes and pictures. It is one for both: readers of URDF find an OBJ's pictures beside
/// it, and not all of them elsewhere.
pub const FOLDER: &str = "look";
/// Materials of all OBJ files.
const MATERIALS: &str = "look.mtl";
/// Format: steps of positions per metre, a tenth of a millimetre is below what any depth tells, and its numbers are short as text.
const STEPS_PER_M: f64 = 1e4;
/// Format: steps of normals' coordinates, a twentieth of a degree.
const STEPS_OF_NORMALS: f64 = 1e3;
/// Format: steps of a texture's coordinates as text.
const STEPS_OF_SHARES: f64 = 1e4;
/// Format: rounded normals that are this near to length 1 are left as they are. Rounding takes less, glTF's validator minds six times
/// as much.
const UNIT_NORMAL: f64 = 1e-3;
/// Format: a mesh is flat where no vertex is farther from its plane, metres: MuJoCo refuses what has no volume, whoever shows it.
const FLAT_M: f64 = 5e-4;
/// Format: edge of what gives a flat mesh a volume, metres: too small to be seen.
const PEBBLE_M: f64 = 1e-3;
/// Format: of 100; what JPEG takes away is then less than a texture's colours are off; a picture takes about a fifth of a byte a pixel.
const JPEG_QUALITY: u8 = 85;

/// One mesh of one link.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Piece<'a> {
    /// Name, unique in the twin.
    pub name: String,
    /// In the frame of the link, metres.
    pub positions: Vec<[f32; 3]>,
    /// In the frame of the link, which has the world's axes.
    pub normals: Vec<[f32; 3]>,
    /// Shares of 65535; (0, 0) is the picture's upper left corner.
    pub uv: Vec<[u16; 2]>,
    /// Vertex numbers, counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
    /// Its picture.
    pub texture: &'a Texture,
    /// Number of the picture.
    pub index: usize,
    /// Share of the surface whose colour was seen.
    pub seen: f64,
}

/// A look by links.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Dress<'a> {
    /// Pictures; none where nothing shows them.
    pub textures: &'a [Texture],
    /// What does not move, in the world's frame. Where there is any, no fixed box is shown.
    pub room: Vec<Piece<'a>>,
    parts: BTreeMap<&'a str, Vec<Piece<'a>>>,
}

impl<'a> Dress<'a> {
    /// Checks a twin and its look, and brings the look into the links' frames.
    ///
    /// # Errors
    /// Where the twin cannot be a simulator's model (see [`super::check`]), or what is wrong with the look.
    pub fn of(twin: &Twin, look: Option<&'a Look>) -> Result<Self> {
        let mut names = shared::names(twin)?;
        let Some(look) = look else { return Ok(Self::default()) };
        check_textures(&look.textures)?;
        let mut dress = Self { room: pieces(look, ROOM, &look.room, &Point::origin())?, ..Self::default() };
        for (id, meshes) in &look.parts {
            let Some(f) = twin.furniture.iter().find(|f| f.part.id == *id) else {
                return Err(Error::Export(format!("look: the twin has no part {id}")));
            };
            let own = pieces(look, id, meshes, &f.part.joint.articulation.origin)?;
            if !own.is_empty() {
                dress.parts.insert(id, own);
            }
        }
        for piece in dress.all() {
            if !names.insert(piece.name.clone()) {
                return Err(Error::Export(format!("name \"{}\" is used twice", piece.name)));
            }
        }
        if dress.all().next().is_some() {
            dress.textures = &look.textures;
        }
        Ok(dress)
    }

    /// The meshes of a part; where there are any, its boxes are not shown.
    pub fn part(&self, id: &str) -> &[Piece<'a>] {
        self.parts.get(id).map(Vec::as_slice).unwrap_or_default()
    }

    /// All meshes, the room's first.
    pub fn all(&self) -> impl Iterator<Item = &Piece<'a>> {
        self.room.iter().chain(self.parts.values().flatten())
    }
}

/// Path of a mesh from the models.
pub(crate) fn mesh_file(piece: &Piece) -> String {
    format!("{FOLDER}/{}.obj", piece.name)
}

/// Path of a picture from the models.
pub(crate) fn picture_file(texture: &Texture) -> String {
    format!("{FOLDER}/{}.png", texture.name)
}

/// Name of a picture's material; roles have materials without the first word.
pub(crate) fn material(texture: &Texture) -> String {
    format!("look_{}", texture.name)
}

/// Whether a look has any triangles.
///
/// # Errors
/// Where twin or look cannot be written, as in every format.
pub fn shows(twin: &Twin, look: &Look) -> Result<bool> {
    Ok(Dress::of(twin, Some(look))?.all().next().is_some())
}

/// The files beside the models, by their paths from there: meshes as OBJ, their materials, pictures as PNG. None for a look
/// without triangles.
///
/// # Errors
/// Where twin or look cannot be written, as in every format.
pub fn files(twin: &Twin, look: &Look) -> Result<Vec<(String, Vec<u8>)>> {
    let dress = Dress::of(twin, Some(look))?;
    if dress.textures.is_empty() {
        return Ok(Vec::new());
    }
    let mut files: Vec<(String, Vec<u8>)> = dress.all().map(|p| (mesh_file(p), obj(p).into_bytes())).collect();
    files.push((format!("{FOLDER}/{MATERIALS}"), mtl(dress.textures).into_bytes()));
    let pictures: Result<Vec<_>> = dress.textures.par_iter().map(|t| Ok((picture_file(t), png(t)?))).collect();
    files.extend(pictures?);
    Ok(files)
}

fn check_textures(textures: &[Texture]) -> Result<()> {
    let mut names = std::collections::BTreeSet::new();
    for texture in textures {
        let fault = |what: &str| Err(Error::Export(format!("look: texture \"{}\": {what}", texture.name)));
        if !is_name(&texture.name) {
            return fault("its name needs letters, digits and _, the first no digit");
        }
        // Some file systems know no capitals.
        if !names.insert(texture.name.to_ascii_lowercase()) {
            return fault("its name is used twice");
        }
        let bytes = 3 * u128::from(texture.width) * u128::from(texture.height);
        if bytes == 0 || bytes != texture.rgb.len() as u128 {
            return fault("it needs three bytes a pixel, and a pixel at least");
        }
    }
    Ok(())
}

/// The meshes of a link whose frame stands at `origin`; those without triangles are left out.
fn pieces<'a>(look: &'a Look, link: &str, meshes: &[TexturedMesh], origin: &Point) -> Result<Vec<Piece<'a>>> {
    let mut out = Vec::new();
    for (i, mesh) in meshes.iter().enumerate() {
        let fault = |what: &str| Error::Export(format!("look: mesh {i} of {link}: {what}"));
        let texture = look.textures.get(mesh.texture).ok_or_else(|| fault("it has a texture that is not there"))?;
        let piece = piece(format!("{link}_look_{}", out.len()), mesh, texture, origin).map_err(fault)?;
        if !piece.triangles.is_empty() {
            out.push(piece);
        }
    }
    Ok(out)
}

fn piece<'a>(
    name: String,
    mesh: &TexturedMesh,
    texture: &'a Texture,
    origin: &Point,
) -> std::result::Result<Piece<'a>, &'static str> {
    let count = mesh.positions.len();
    if mesh.normals.len() != count || mesh.uv.len() != count {
        return Err("each vertex needs one normal and one texture coordinate");
    }
    if u32::try_from(count).is_err() || mesh.triangles.iter().flatten().any(|v| *v as usize >= count) {
        return Err("a triangle has a vertex that is not there");
    }
    if !mesh.positions.iter().flat_map(|p| p.coords.iter()).all(|c| c.abs() < FAR_M) {
        return Err("a vertex is not finite, or farther away than a home is wide");
    }
    let positions: Vec<[f32; 3]> = mesh.positions.iter().map(|p| rounded(&(p - origin), STEPS_PER_M)).collect();
    // What has no area shows nothing, and some readers mind it.
    let has_area = |t: &&[u32; 3]| {
        let [a, b, c] = t.map(|v| positions.get(v as usize));
        a != b && b != c && c != a
    };
    let triangles = mesh.triangles.iter().filter(has_area).copied().collect();
    let share = |s: f32| (f64::from(s).clamp(0.0, 1.0) * 65535.0).round() as u16;
    Ok(Piece {
        name,
        triangles,
        normals: mesh.normals.iter().map(unit_normal).collect(),
        uv: mesh.uv.iter().map(|t| t.map(share)).collect(),
        positions,
        texture,
        index: mesh.texture,
        seen: if mesh.seen.is_finite() { mesh.seen.clamp(0.0, 1.0) } else { 0.0 },
    })
}

/// A rounded normal of length 1; straight up where there is none.
fn unit_normal(normal: &Vector) -> [f32; 3] {
    let as_is = rounded(normal, STEPS_OF_NORMALS);
    if (Vector::from(as_is.map(f64::from)).norm() - 1.0).abs() < UNIT_NORMAL {
        return as_is;
    }
    rounded(&unit(normal).unwrap_or_else(Vector::z), STEPS_OF_NORMALS)
}

/// Whole steps, no minus zero.
fn rounded(v: &Vector, steps: f64) -> [f32; 3] {
    [v.x, v.y, v.z].map(|c| ((c * steps).round() / steps) as f32 + 0.0)
}

/// A coordinate of a texture as text: half of its fourth digit is a fifth of a pixel of the largest pictures.
pub(crate) fn share_text(share: u16, flipped: bool) -> String {
    let share = f64::from(share) / 65535.0;
    let share = if flipped { 1.0 - share } else { share };
    ((share * STEPS_OF_SHARES).round() / STEPS_OF_SHARES).to_string()
}

/// A mesh as OBJ without normals, which readers make themselves: they would be a third of the file.
fn obj(piece: &Piece) -> String {
    let mut text = format!("mtllib {MATERIALS}\nusemtl {}\n", material(piece.texture));
    let pebble = pebble(piece);
    for [x, y, z] in piece.positions.iter().chain(pebble.iter().flat_map(|(corners, _)| corners)) {
        // Writing to a string cannot fail.
        let _ = writeln!(text, "v {x} {y} {z}");
    }
    for [u, v] in &piece.uv {
        let _ = writeln!(text, "vt {} {}", share_text(*u, false), share_text(*v, true));
    }
    for [a, b, c] in piece.triangles.iter().map(|t| t.map(|v| u64::from(v) + 1)) {
        let _ = writeln!(text, "f {a}/{a} {b}/{b} {c}/{c}");
    }
    if let Some((_, vertex)) = pebble {
        let (first, t) = (piece.positions.len() + 1, u64::from(vertex) + 1);
        for face in [[0, 1, 2], [0, 3, 1], [1, 3, 2], [2, 3, 0]] {
            let [a, b, c] = face.map(|i| first + i);
            let _ = writeln!(text, "f {a}/{t} {b}/{t} {c}/{t}");
        }
    }
    text
}

/// The corners of a tetrahedron just behind a flat mesh, at the vertex whose colour it has; `None` where the mesh has a
/// volume.
fn pebble(piece: &Piece) -> Option<([[f32; 3]; 4], u32)> {
    let at = |v: u32| piece.positions.get(v as usize).map(|p| Vector::from(p.map(f64::from)));
    let (mut best, mut plane) = (0.0, None);
    for [a, b, c] in &piece.triangles {
        let (pa, pb, pc) = (at(*a)?, at(*b)?, at(*c)?);
        let cross = (pb - pa).cross(&(pc - pa));
        if cross.norm() > best {
            best = cross.norm();
            plane = Some((*a, pa, unit(&(pb - pa))?, cross / best));
        }
    }
    // Triangles that are all lines have no volume either.
    let (vertex, corner, along, normal) = plane.unwrap_or_else(|| {
        let first = piece.triangles.first().map_or(0, |t| t[0]);
        (first, at(first).unwrap_or_default(), Vector::x(), Vector::z())
    });
    let is_off = |v: &u32| at(*v).is_some_and(|p| normal.dot(&(p - corner)).abs() > FLAT_M);
    if best > 0.0 && piece.triangles.iter().flatten().any(is_off) {
        return None;
    }
    let across = normal.cross(&along);
    let behind = corner - normal * (0.5 * PEBBLE_M);
    let corners = [Vector::zeros(), along, across, -normal].map(|d| {
        let p = behind + d * PEBBLE_M;
        [p.x as f32, p.y as f32, p.z as f32]
    });
    Some((corners, vertex))
}

fn mtl(textures: &[Texture]) -> String {
    textures
        .iter()
        .map(|t| format!("newmtl {}\nKa 1 1 1\nKd 1 1 1\nKs 0 0 0\nillum 1\nmap_Kd {}.png\n", material(t), t.name))
        .collect()
}

fn failed(texture: &Texture, error: &image::ImageError) -> Error {
    Error::Export(format!("look: texture \"{}\": {error}", texture.name))
}

/// A picture as PNG: MuJoCo and Drake read no other kind. Of photographs the slow ways save next to nothing.
fn png(texture: &Texture) -> Result<Vec<u8>> {
    let mut bytes = Vec::new();
    PngEncoder::new_with_quality(&mut bytes, CompressionType::Fast, FilterType::Adaptive)
        .write_image(&texture.rgb, texture.width, texture.height, ExtendedColorType::Rgb8)
        .map_err(|e| failed(texture, &e))?;
    Ok(bytes)
}

/// Pictures as JPEG, for files that hold their pictures: a fifth of the bytes.
pub(crate) fn jpegs(textures: &[Texture]) -> Result<Vec<Vec<u8>>> {
    let jpeg = |texture: &Texture| -> Result<Vec<u8>> {
        let mut bytes = Vec::new();
        JpegEncoder::new_with_quality(&mut bytes, JPEG_QUALITY)
            .write_image(&texture.rgb, texture.width, texture.height, ExtendedColorType::Rgb8)
            .map_err(|e| failed(texture, &e))?;
        Ok(bytes)
    };
    textures.par_iter().map(jpeg).collect()
}
