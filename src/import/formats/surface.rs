//! A mesh with its colours, to be looked at: PLY and OBJ in the recording's world frame, glTF with +Y up as that format has it.
//!
//! Colours are taken as they are written, one a vertex or a picture; reconstructions write them so in all three formats.

use std::collections::{BTreeMap, VecDeque};
use std::fs::File;
use std::io::{BufReader, Cursor};
use std::path::Path;
use std::sync::Arc;

use image::{DynamicImage, ImageReader};
use nalgebra::Matrix4;

use super::cloud;
use crate::error::{Error, Result};
use crate::import::blob::{Blob, beside};
use crate::import::names::ending;
use crate::import::ply;
use crate::math::Point;
use crate::raster::{Bitmap, Mesh, MeshPaint};
use crate::recording::images;

/// A surface without colours.
const GREY: [u8; 3] = [128; 3];
/// A decoder may claim any size.
const MAX_PICTURE_BYTES: u64 = 1 << 30;

/// Reads a mesh: world, +Z up, metres.
///
/// # Errors
/// Where the file cannot be read, or has no triangles.
pub fn read(path: &Path) -> Result<Vec<Mesh>> {
    let meshes = match ending(path).as_str() {
        "ply" => vec![of_ply(path)?],
        "obj" => of_obj(path)?,
        "glb" | "gltf" => of_gltf(path)?,
        _ => return Err(Error::format(path, "name", "is no mesh that is read here; give a .ply, .obj, .glb or .gltf")),
    };
    if meshes.iter().all(|m| m.triangles.is_empty()) {
        let message = "has no triangles: points alone have no surface; export the mesh";
        return Err(Error::format(path, "faces", message));
    }
    Ok(meshes)
}

/// A polygon as a fan; corners beyond all vertices are passed over when it is drawn.
fn fan(corners: &[usize]) -> Vec<[u32; 3]> {
    let number = |corner: &usize| u32::try_from(*corner).unwrap_or(u32::MAX);
    match corners {
        [first, rest @ ..] => rest.windows(2).map(|pair| [number(first), number(&pair[0]), number(&pair[1])]).collect(),
        [] => Vec::new(),
    }
}

fn of_ply(path: &Path) -> Result<Mesh> {
    let cloud = ply::read(path)?;
    let triangles = cloud.faces.iter().flat_map(|face| fan(&face.corners)).collect();
    let paint = if cloud.colors.is_empty() { MeshPaint::Plain(GREY) } else { MeshPaint::Vertices(cloud.colors) };
    Ok(Mesh { positions: cloud.points, triangles, paint, two_sided: true })
}

fn of_obj(path: &Path) -> Result<Vec<Mesh>> {
    cloud::check_corners(path)?;
    let options = tobj::LoadOptions { single_index: true, triangulate: true, ignore_lines: true, ..Default::default() };
    let file = File::open(path).map_err(|e| Error::io(path, &e))?;
    // Materials that are not there, or lie elsewhere, leave the surface grey.
    let library = |name: &Path| match beside(path, &name.to_string_lossy()) {
        Ok(Some(found)) => match File::open(found) {
            Ok(file) => tobj::load_mtl_buf(&mut BufReader::new(file)),
            Err(_) => Ok(Default::default()),
        },
        _ => Ok(Default::default()),
    };
    let (models, materials) = tobj::load_obj_buf(&mut BufReader::new(file), &options, library)
        .map_err(|e| Error::format(path, "obj", format!("cannot be read ({e}); export the mesh again")))?;
    let materials = materials.unwrap_or_default();
    let mut pictures: BTreeMap<String, Arc<Bitmap>> = BTreeMap::new();
    let mut out = Vec::new();
    for mesh in models.iter().map(|m| &m.mesh) {
        let material = mesh.material_id.and_then(|id| materials.get(id));
        let map = material.and_then(|m| m.diffuse_texture.as_deref()).filter(|_| !mesh.texcoords.is_empty());
        let paint = if let Some(name) = map
            && let Some(map) = beside_picture(path, name, &mut pictures)?
        {
            // Coordinates go up from the picture's lower edge.
            MeshPaint::Picture(mesh.texcoords.chunks_exact(2).map(|t| [t[0], 1.0 - t[1]]).collect(), map)
        } else if !mesh.vertex_color.is_empty() {
            MeshPaint::Vertices(
                mesh.vertex_color.chunks_exact(3).map(|c| [byte(c[0]), byte(c[1]), byte(c[2])]).collect(),
            )
        } else {
            MeshPaint::Plain(material.and_then(|m| m.diffuse).map_or(GREY, |c| c.map(byte)))
        };
        let point = |p: &[f32]| Point::new(f64::from(p[0]), f64::from(p[1]), f64::from(p[2]));
        out.push(Mesh {
            positions: mesh.positions.chunks_exact(3).map(point).collect(),
            triangles: mesh.indices.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect(),
            paint,
            two_sided: true,
        });
    }
    Ok(out)
}

/// A share as a byte.
fn byte(share: f32) -> u8 {
    (share.clamp(0.0, 1.0) * 255.0).round() as u8
}

/// A picture that a mesh names, from its folder; `None` where it is not there.
fn beside_picture(path: &Path, name: &str, known: &mut BTreeMap<String, Arc<Bitmap>>) -> Result<Option<Arc<Bitmap>>> {
    if let Some(map) = known.get(name) {
        return Ok(Some(Arc::clone(map)));
    }
    let Some(file) = beside(path, name)? else { return Ok(None) };
    let map = Arc::new(decoded(&file, "picture", &Blob::File(file.clone()).read()?)?);
    known.insert(name.to_owned(), Arc::clone(&map));
    Ok(Some(map))
}

/// A PNG or JPEG picture.
fn decoded(path: &Path, place: &str, bytes: &[u8]) -> Result<Bitmap> {
    let wrong = |e: String| Error::format(path, place, format!("cannot be decoded ({e}); PNG and JPEG are read"));
    let mut reader = ImageReader::new(Cursor::new(bytes)).with_guessed_format().map_err(|e| wrong(e.to_string()))?;
    let mut limits = image::Limits::default();
    limits.max_alloc = Some(MAX_PICTURE_BYTES);
    reader.limits(limits);
    let decoder = reader.into_decoder().map_err(|e| wrong(e.to_string()))?;
    images::believable(&decoder, bytes.len() as u64).map_err(wrong)?;
    let picture = DynamicImage::from_decoder(decoder).map_err(|e| wrong(e.to_string()))?.into_rgb8();
    let (width, height) = picture.dimensions();
    Ok(Bitmap { width: width as usize, height: height as usize, rgb: picture.into_raw() })
}

fn of_gltf(path: &Path) -> Result<Vec<Mesh>> {
    let bytes = Blob::File(path.to_owned()).read()?;
    let file = cloud::document(path, &bytes)?;
    let buffers = cloud::buffers(path, &file)?;
    // +Y up becomes +Z up.
    let up = Matrix4::new(1.0, 0.0, 0.0, 0.0, 0.0, 0.0, -1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0);
    let scene = file.default_scene().or_else(|| file.scenes().next());
    let mut open: VecDeque<(gltf::Node<'_>, Matrix4<f64>)> =
        scene.into_iter().flat_map(|s| s.nodes()).map(|n| (n, up)).collect();
    let mut pictures = BTreeMap::new();
    let mut out = Vec::new();
    let mut count = 0;
    while let Some((node, parent)) = open.pop_front() {
        count += 1;
        if count > cloud::MAX_NODES {
            let message = format!("more than {}; a node that holds itself?", cloud::MAX_NODES);
            return Err(Error::format(path, "nodes", message));
        }
        let world = parent * Matrix4::<f32>::from(node.transform().matrix()).map(f64::from);
        for primitive in node.mesh().into_iter().flat_map(|m| m.primitives()) {
            let (positions, corners) = cloud::surface(&primitive, &buffers, &world);
            let triangles = corners.chunks_exact(3).flat_map(fan).collect();
            let paint = paint(path, &primitive, &buffers, &mut pictures)?;
            let two_sided = primitive.material().double_sided();
            out.push(Mesh { positions, triangles, paint, two_sided });
        }
        open.extend(node.children().map(|child| (child, world)));
    }
    Ok(out)
}

fn paint(
    path: &Path,
    primitive: &gltf::Primitive<'_>,
    buffers: &[Vec<u8>],
    known: &mut BTreeMap<usize, Arc<Bitmap>>,
) -> Result<MeshPaint> {
    let material = primitive.material();
    let surface = material.pbr_metallic_roughness();
    if let Some(uv) = numbers::<2>(primitive, &gltf::Semantic::TexCoords(0), buffers)
        && let Some(texture) = surface.base_color_texture()
    {
        let image = texture.texture().source();
        let map = match known.get(&image.index()) {
            Some(map) => Some(Arc::clone(map)),
            None => embedded(path, &image, buffers)?.map(Arc::new),
        };
        if let Some(map) = map {
            known.insert(image.index(), Arc::clone(&map));
            return Ok(MeshPaint::Picture(uv, map));
        }
    }
    if let Some(colors) = numbers::<3>(primitive, &gltf::Semantic::Colors(0), buffers) {
        return Ok(MeshPaint::Vertices(colors.iter().map(|c| c.map(byte)).collect()));
    }
    let [r, g, b, _] = surface.base_color_factor();
    Ok(MeshPaint::Plain([r, g, b].map(|c| byte(encoded(c)))))
}

/// A share of light as the share of a byte that sRGB has for it (IEC 61966-2-1).
fn encoded(linear: f32) -> f32 {
    if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 }
}

/// The first numbers of each row of an attribute; whole numbers are shares of their largest value. `None` where it has none,
/// or not as many.
fn numbers<const N: usize>(
    primitive: &gltf::Primitive<'_>,
    semantic: &gltf::Semantic,
    buffers: &[Vec<u8>],
) -> Option<Vec<[f32; N]>> {
    use gltf::accessor::DataType;
    let accessor = primitive.get(semantic)?;
    let of = |b: &[u8]| match (accessor.data_type(), b) {
        (DataType::F32, [a, b, c, d]) => Some(f32::from_le_bytes([*a, *b, *c, *d])),
        (DataType::U16, [a, b]) => Some(f32::from(u16::from_le_bytes([*a, *b])) / 65535.0),
        (DataType::U8, [a]) => Some(f32::from(*a) / 255.0),
        _ => None,
    };
    let width = accessor.data_type().size();
    let row = |row: &&[u8]| -> Option<[f32; N]> {
        let all: Option<Vec<f32>> = row.chunks_exact(width).take(N).map(of).collect();
        all?.try_into().ok()
    };
    cloud::elements(&accessor, buffers)?.iter().map(row).collect()
}

/// A picture in the file or in its folder; `None` where it is not there.
fn embedded(path: &Path, image: &gltf::Image<'_>, buffers: &[Vec<u8>]) -> Result<Option<Bitmap>> {
    let place = format!("image {}", image.index());
    match image.source() {
        gltf::image::Source::View { view, .. } => {
            let end = view.offset().checked_add(view.length());
            let buffer = buffers.get(view.buffer().index());
            match buffer.zip(end).and_then(|(buffer, end)| buffer.get(view.offset()..end)) {
                Some(bytes) => decoded(path, &place, bytes).map(Some),
                None => Err(Error::format(path, place, "lies outside of its buffer; export the file again")),
            }
        }
        gltf::image::Source::Uri { uri, .. } => match beside(path, uri)? {
            Some(file) => decoded(&file, &place, &Blob::File(file.clone()).read()?).map(Some),
            None => Ok(None),
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn written(dir: &Path, name: &str, text: &str) -> std::path::PathBuf {
        let path = dir.join(name);
        std::fs::write(&path, text).unwrap();
        path
    }

    #[test]
    fn a_ply_has_its_colours_and_its_polygons_as_triangles() {
        let dir = tempfile::tempdir().unwrap();
        let text = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
            property uchar red\nproperty uchar green\nproperty uchar blue\nelement face 1\n\
            property list uchar int vertex_indices\nend_header\n\
            0 0 0 1 2 3\n1 0 0 4 5 6\n1 1 0 7 8 9\n0 1 0 10 11 12\n4 0 1 2 3\n";
        let meshes = read(&written(dir.path(), "a.ply", text)).unwrap();
        assert_eq!(meshes[0].triangles, [[0, 1, 2], [0, 2, 3]]);
        assert_eq!(meshes[0].paint, MeshPaint::Vertices(vec![[1, 2, 3], [4, 5, 6], [7, 8, 9], [10, 11, 12]]));
    }

    #[test]
    fn an_obj_has_the_picture_of_its_material_upright() {
        let dir = tempfile::tempdir().unwrap();
        image::RgbImage::from_fn(2, 2, |x, y| image::Rgb([x as u8, y as u8, 9]))
            .save(dir.path().join("p.png"))
            .unwrap();
        written(dir.path(), "m.mtl", "newmtl a\nmap_Kd p.png\n");
        let text = "mtllib m.mtl\nusemtl a\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\n";
        let meshes = read(&written(dir.path(), "a.obj", text)).unwrap();
        let MeshPaint::Picture(uv, map) = &meshes[0].paint else { panic!("{:?}", meshes[0].paint) };
        assert_eq!(uv[..], [[0.0, 1.0], [1.0, 1.0], [0.0, 0.0]]);
        assert_eq!(map.rgb, [0, 0, 9, 1, 0, 9, 0, 1, 9, 1, 1, 9]);
        // Without the library it is grey; with colours behind its vertices it has those.
        let bare = read(&written(dir.path(), "b.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")).unwrap();
        assert_eq!(bare[0].paint, MeshPaint::Plain(GREY));
        let text = "v 0 0 0 1 0 0\nv 1 0 0 0 1 0\nv 0 1 0 0 0 1\nf 1 2 3\n";
        let colored = read(&written(dir.path(), "c.obj", text)).unwrap();
        assert_eq!(colored[0].paint, MeshPaint::Vertices(vec![[255, 0, 0], [0, 255, 0], [0, 0, 255]]));
    }

    #[test]
    fn a_gltf_has_its_colours_and_stands_upright() {
        use base64::Engine;
        let mut bytes: Vec<u8> =
            [0f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0].iter().flat_map(|c| c.to_le_bytes()).collect();
        bytes.extend([255, 0, 0, 0, 255, 0, 0, 0, 255]);
        let data = base64::engine::general_purpose::STANDARD.encode(&bytes);
        let text = format!(
            r#"{{"asset": {{"version": "2.0"}}, "scene": 0, "scenes": [{{"nodes": [0]}}],
                "nodes": [{{"mesh": 0, "translation": [0, 5, 0]}}],
                "meshes": [{{"primitives": [{{"attributes": {{"POSITION": 0, "COLOR_0": 1}}}}]}}],
                "accessors": [
                    {{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0]}},
                    {{"bufferView": 1, "componentType": 5121, "normalized": true, "count": 3, "type": "VEC3"}}],
                "bufferViews": [{{"buffer": 0, "byteLength": 36}}, {{"buffer": 0, "byteOffset": 36, "byteLength": 9}}],
                "buffers": [{{"byteLength": 45, "uri": "data:application/octet-stream;base64,{data}"}}]}}"#
        );
        let dir = tempfile::tempdir().unwrap();
        let meshes = read(&written(dir.path(), "a.gltf", &text)).unwrap();
        assert_eq!(meshes[0].paint, MeshPaint::Vertices(vec![[255, 0, 0], [0, 255, 0], [0, 0, 255]]));
        let expected = [[0.0, 0.0, 5.0], [1.0, 0.0, 5.0], [0.0, 0.0, 6.0]].map(Point::from);
        assert_eq!(meshes[0].positions, expected);
    }

    #[test]
    fn what_has_no_surface_is_named() {
        let dir = tempfile::tempdir().unwrap();
        for (name, text, word) in [
            ("a.xyz", "", ".ply"),
            ("a.obj", "v 0 0 0\n", "no triangles"),
            ("a.glb", "glTF", "cannot be read"),
            ("b.obj", "v 0 0 0\nf 1 2 3\n", "corner"),
        ] {
            let error = read(&written(dir.path(), name, text)).unwrap_err().to_string();
            assert!(error.contains(word) && error.contains(name), "{name}: {error}");
        }
    }
}
