//! A static reconstruction of its own: OBJ, PLY, glTF, or a table of points (`.csv` with x, y, z, or Aria's semi-dense points).
//!
//! It stands in the world of the source with the poses, in its unit and axes. Of faces, points are taken evenly, as a wall of two
//! triangles is more than its corners.

use std::collections::VecDeque;
use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};

use nalgebra::Matrix4;

use crate::error::{Error, Result};
use crate::import::ImportOptions;
use crate::import::blob::{Blob, inside};
use crate::import::capture::Capture;
use crate::import::names::{ending, head};
use crate::import::text::{Lines, TextTable};
use crate::math::Point;
use crate::recording::reconstruction;

/// Points that faces are made of at the most: a room at 2 cm.
const SAMPLES: f64 = 300_000.0;
/// Aria's own limits for a point that is known well, 1/m and metres.
const MAX_INV_DIST_STD: f64 = 0.005;
const MAX_DIST_STD: f64 = 0.01;
/// Names of a point's columns.
const COLUMNS: [[&str; 3]; 2] = [["px_world", "py_world", "pz_world"], ["x", "y", "z"]];
/// Nodes of a glTF below each other.
pub(super) const MAX_NODES: usize = 100_000;

type Triangle = [Point; 3];

pub(super) fn detect(path: &Path) -> bool {
    if !path.is_file() {
        return false;
    }
    match ending(path).as_str() {
        "obj" | "ply" | "glb" | "gltf" => true,
        "csv" => {
            let start = head(path, 4096).to_ascii_lowercase();
            let header = start.lines().next().unwrap_or_default().to_owned();
            let cells = crate::import::text::cells(&header);
            COLUMNS.iter().any(|names| names.iter().all(|n| cells.contains(n))) && !header.contains("time")
        }
        _ => false,
    }
}

pub(super) fn read(path: &Path, _options: &ImportOptions) -> Result<Capture> {
    Ok(Capture {
        kind: "cloud".to_owned(),
        source: path.to_owned(),
        title: "a static reconstruction".to_owned(),
        points: points(path)?,
        ..Capture::default()
    })
}

/// Points of a file, in its own axes and unit.
///
/// # Errors
/// Where the file cannot be read or holds no finite point.
pub(super) fn points(path: &Path) -> Result<Vec<Point>> {
    let mut points = match ending(path).as_str() {
        "obj" => obj(path)?,
        "ply" => reconstruction::ply_points(path)?,
        "glb" | "gltf" => gltf(path)?,
        _ => table(path)?,
    };
    points.retain(|p| p.iter().all(|x| x.is_finite()));
    if points.is_empty() {
        return Err(Error::format(path, "points", "none is finite, or there is none; export the reconstruction again"));
    }
    Ok(points)
}

fn table(path: &Path) -> Result<Vec<Point>> {
    let mut table = TextTable::open(path)?;
    let [aria, plain] = COLUMNS;
    let columns = if table.has(aria[0]) { aria } else { plain };
    table.need(&columns)?;
    let mut out = Vec::new();
    while let Some(row) = table.row()? {
        let is_vague = |column: &str, most: f64| -> Result<bool> {
            Ok(!row.text(column).is_empty() && row.number(column)? > most)
        };
        if is_vague("inv_dist_std", MAX_INV_DIST_STD)? || is_vague("dist_std", MAX_DIST_STD)? {
            continue;
        }
        out.push(Point::from(row.numbers(columns)?));
    }
    Ok(out)
}

fn obj(path: &Path) -> Result<Vec<Point>> {
    let options = tobj::LoadOptions { triangulate: true, ignore_lines: true, ..Default::default() };
    check_corners(path)?;
    let file = File::open(path).map_err(|e| Error::io(path, &e))?;
    // Materials are of no use here, and their files may lie anywhere.
    let none = |_: &Path| Ok(Default::default());
    let (models, _) = tobj::load_obj_buf(&mut BufReader::new(file), &options, none)
        .map_err(|e| Error::format(path, "obj", format!("cannot be read ({e}); export the mesh again")))?;
    let mut out = Vec::new();
    let mut triangles = Vec::new();
    for model in &models {
        let of = |p: &[f32]| match p {
            [x, y, z] => Point::new(f64::from(*x), f64::from(*y), f64::from(*z)),
            _ => Point::origin(),
        };
        let vertices: Vec<Point> = model.mesh.positions.chunks_exact(3).map(of).collect();
        let corners: Vec<usize> = model.mesh.indices.iter().map(|i| *i as usize).collect();
        add(&vertices, &corners, &mut triangles);
        out.extend(vertices);
    }
    out.extend(sampled(&triangles));
    Ok(out)
}

/// Corners of faces must name what is there, which tobj takes for granted.
pub(super) fn check_corners(path: &Path) -> Result<()> {
    let mut lines = Lines::open(path)?;
    // Vertices, texture coordinates, normals.
    let mut there = [0i64; 3];
    let mut highest: [(i64, usize); 3] = [(0, 0); 3];
    let wrong = |line: usize, name: i64| {
        let message = format!("a face names corner {name}, which is not there; export the mesh again");
        Err(Error::format(path, format!("line {line}"), message))
    };
    let mut number = 0;
    while let Some(line) = lines.line()? {
        number += 1;
        let mut words = line.split_ascii_whitespace();
        match words.next() {
            Some("v") => there[0] += 1,
            Some("vt") => there[1] += 1,
            Some("vn") => there[2] += 1,
            Some("f" | "l" | "p") => {
                for (k, name) in words.flat_map(|w| w.split('/').take(3).enumerate()).filter(|(_, n)| !n.is_empty()) {
                    let Ok(name) = name.parse::<i64>() else { return wrong(number, 0) };
                    if name == 0 || name < -there[k] {
                        return wrong(number, name);
                    }
                    if name > highest[k].0 {
                        highest[k] = (name, number);
                    }
                }
            }
            _ => {}
        }
    }
    match highest.iter().zip(there).find(|((name, _), there)| name > there) {
        Some(((name, line), _)) => wrong(*line, *name),
        None => Ok(()),
    }
}

/// Triangles of corners by three; those that name no vertex are left out.
fn add(vertices: &[Point], corners: &[usize], out: &mut Vec<Triangle>) {
    for corner in corners.chunks_exact(3) {
        if let [a, b, c] = corner
            && let (Some(a), Some(b), Some(c)) = (vertices.get(*a), vertices.get(*b), vertices.get(*c))
        {
            out.push([*a, *b, *c]);
        }
    }
}

/// Points on triangles, one on each piece of area that makes [`SAMPLES`] of all.
fn sampled(triangles: &[Triangle]) -> Vec<Point> {
    let area = |[a, b, c]: &Triangle| 0.5 * (b - a).cross(&(c - a)).norm();
    let total: f64 = triangles.iter().map(area).filter(|a| a.is_finite()).sum();
    let mut out = Vec::new();
    if total <= 0.0 {
        return out;
    }
    for triangle in triangles {
        let [a, b, c] = triangle;
        // Small triangles have their corners.
        let wanted = area(triangle) / total * SAMPLES;
        if !wanted.is_finite() || wanted < 1.0 {
            continue;
        }
        // n steps along each side make n (n + 1) / 2 points.
        let n = (2.0 * wanted).sqrt().ceil() as usize;
        for i in 0..n {
            for j in 0..n - i {
                let (u, v) = ((i as f64 + 1.0 / 3.0) / n as f64, (j as f64 + 1.0 / 3.0) / n as f64);
                out.push(a + (b - a) * u + (c - a) * v);
            }
        }
    }
    out
}

/// A glTF as it is in its file. Its reader takes for granted that the accessors which a mesh names are there; here they are looked
/// for first.
///
/// # Errors
/// What is no glTF, or names what it does not have.
pub(crate) fn document(path: &Path, bytes: &[u8]) -> Result<gltf::Gltf> {
    let broken = |e: gltf::Error| Error::format(path, "glTF", format!("cannot be read ({e}); export it again"));
    let unchecked = gltf::Gltf::from_slice_without_validation(bytes).map_err(broken)?;
    let json = unchecked.document.as_json();
    let named = json.meshes.iter().flat_map(|m| &m.primitives).flat_map(|p| p.attributes.values());
    if let Some(wrong) = named.map(|index| index.value()).find(|index| *index >= json.accessors.len()) {
        let message = format!("a mesh names accessor {wrong}, and there are {}; export it again", json.accessors.len());
        return Err(Error::format(path, "meshes", message));
    }
    gltf::Gltf::from_slice(bytes).map_err(broken)
}

fn gltf(path: &Path) -> Result<Vec<Point>> {
    let bytes = Blob::File(path.to_owned()).read()?;
    let file = document(path, &bytes)?;
    let buffers = buffers(path, &file)?;
    let mut out = Vec::new();
    let mut triangles = Vec::new();
    let scene = file.default_scene().or_else(|| file.scenes().next());
    let mut open: VecDeque<(gltf::Node<'_>, Matrix4<f64>)> =
        scene.into_iter().flat_map(|s| s.nodes()).map(|n| (n, Matrix4::identity())).collect();
    let mut count = 0;
    while let Some((node, parent)) = open.pop_front() {
        count += 1;
        if count > MAX_NODES {
            return Err(Error::format(path, "nodes", format!("more than {MAX_NODES}; a node that holds itself?")));
        }
        let world = parent * Matrix4::<f32>::from(node.transform().matrix()).map(f64::from);
        for primitive in node.mesh().into_iter().flat_map(|m| m.primitives()) {
            let (vertices, corners) = surface(&primitive, &buffers, &world);
            add(&vertices, &corners, &mut triangles);
            out.extend(vertices);
        }
        open.extend(node.children().map(|child| (child, world)));
    }
    out.extend(sampled(&triangles));
    Ok(out)
}

/// Vertices in the world, and corners of triangles; nothing of what reaches beyond its buffer.
pub(super) fn surface(
    primitive: &gltf::Primitive<'_>,
    buffers: &[Vec<u8>],
    world: &Matrix4<f64>,
) -> (Vec<Point>, Vec<usize>) {
    use gltf::accessor::{DataType, Dimensions};
    let none = (Vec::new(), Vec::new());
    let Some(positions) = primitive.get(&gltf::Semantic::Positions) else { return none };
    if (positions.data_type(), positions.dimensions()) != (DataType::F32, Dimensions::Vec3) {
        return none;
    }
    let Some(rows) = elements(&positions, buffers) else { return none };
    let point = |row: &&[u8]| {
        let mut numbers = row.chunks_exact(4).map(|c| f32::from_le_bytes([c[0], c[1], c[2], c[3]]));
        let mut next = || f64::from(numbers.next().unwrap_or(f32::NAN));
        let p = Point::new(next(), next(), next());
        world.transform_point(&p)
    };
    let vertices: Vec<Point> = rows.iter().map(point).collect();
    if primitive.mode() != gltf::mesh::Mode::Triangles {
        return (vertices, Vec::new());
    }
    let corners = match primitive.indices() {
        None => (0..vertices.len()).collect(),
        Some(indices) => {
            let little = |row: &[u8]| row.iter().rev().fold(0usize, |sum, b| (sum << 8) | usize::from(*b));
            elements(&indices, buffers).unwrap_or_default().into_iter().map(little).collect()
        }
    };
    (vertices, corners)
}

/// Bytes of each element of an accessor; `None` where they are not all there.
pub(super) fn elements<'a>(accessor: &gltf::Accessor<'_>, buffers: &'a [Vec<u8>]) -> Option<Vec<&'a [u8]>> {
    let view = accessor.view()?;
    let size = accessor.size();
    let step = view.stride().unwrap_or(size);
    let whole = view.offset()..view.offset().checked_add(view.length())?;
    let data = buffers.get(view.buffer().index())?.get(whole)?;
    let element = |i: usize| {
        let start = i.checked_mul(step)?.checked_add(accessor.offset())?;
        data.get(start..start.checked_add(size)?)
    };
    (0..accessor.count()).map(element).collect()
}

/// Bytes of the buffers: within the file, as text, or of files beside it.
pub(super) fn buffers(path: &Path, file: &gltf::Gltf) -> Result<Vec<Vec<u8>>> {
    use base64::Engine as _;
    let folder: PathBuf =
        path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or_else(|| Path::new(".")).to_owned();
    let mut out = Vec::new();
    for buffer in file.buffers() {
        let place = format!("buffer {}", buffer.index());
        let bytes = match buffer.source() {
            gltf::buffer::Source::Bin => file.blob.clone().unwrap_or_default(),
            gltf::buffer::Source::Uri(uri) => match uri.strip_prefix("data:").and_then(|d| d.split_once("base64,")) {
                Some((_, data)) => base64::engine::general_purpose::STANDARD
                    .decode(data)
                    .map_err(|e| Error::format(path, place.as_str(), format!("is no base64 ({e})")))?,
                None => match inside(&folder, uri).map_err(|e| Error::format(path, place.as_str(), e.to_string()))? {
                    Some(found) => Blob::File(found).read()?,
                    None => {
                        let name: String = uri.chars().take(80).collect();
                        return Err(Error::format(path, place.as_str(), format!("{name} is not there; copy it too")));
                    }
                },
            },
        };
        out.push(bytes);
    }
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wall_of_two_triangles_is_covered_evenly() {
        let corner = |x: f64, y: f64| Point::new(x, y, 1.0);
        let wall = [
            [corner(0.0, 0.0), corner(2.0, 0.0), corner(2.0, 1.0)],
            [corner(0.0, 0.0), corner(2.0, 1.0), corner(0.0, 1.0)],
        ];
        let points = sampled(&wall);
        assert!((points.len() as f64 / SAMPLES - 1.0).abs() < 0.1, "{}", points.len());
        let quarter = points.iter().filter(|p| p.x < 1.0 && p.y < 0.5).count();
        assert!((quarter as f64 / points.len() as f64 - 0.25).abs() < 0.01, "{quarter}");
        assert!(points.iter().all(|p| p.x >= 0.0 && p.x <= 2.0 && p.y >= 0.0 && p.y <= 1.0));
        assert!(sampled(&[[corner(0.0, 0.0); 3]]).is_empty());
    }

    #[test]
    fn meshes_and_tables_are_read_and_broken_ones_named() {
        let dir = tempfile::tempdir().unwrap();
        let path = |name: &str, text: &str| {
            let path = dir.path().join(name);
            std::fs::write(&path, text).unwrap();
            path
        };
        let obj = path("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
        assert!(points(&obj).unwrap().len() > 1000);
        let table = path(
            "a.csv",
            "uid,graph_uid,px_world,py_world,pz_world,inv_dist_std,dist_std\n1,g,1,2,3,0.001,0.005\n2,g,9,9,9,0.5,0.005\n",
        );
        assert!(detect(&table));
        assert_eq!(points(&table).unwrap(), [Point::new(1.0, 2.0, 3.0)]);
        let mut bytes = Vec::new();
        for v in [0f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0] {
            bytes.extend(v.to_le_bytes());
        }
        std::fs::write(dir.path().join("a.bin"), &bytes).unwrap();
        let text = |uri: &str, length: usize| {
            format!(
                r#"{{"asset": {{"version": "2.0"}}, "scene": 0, "scenes": [{{"nodes": [0]}}],
                    "nodes": [{{"mesh": 0, "translation": [0, 0, 5]}}],
                    "meshes": [{{"primitives": [{{"attributes": {{"POSITION": 0}}}}]}}],
                    "accessors": [{{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3",
                                    "min": [0, 0, 0], "max": [1, 1, 0]}}],
                    "bufferViews": [{{"buffer": 0, "byteLength": {length}}}],
                    "buffers": [{{"byteLength": {length}, "uri": "{uri}"}}]}}"#
            )
        };
        let found = points(&path("a.gltf", &text("a.bin", 36))).unwrap();
        assert!(found.len() > 1000 && found.iter().all(|p| (p.z - 5.0).abs() < 1e-9));
        for (name, content, word) in [
            ("b.gltf", text("../b.bin", 36), "outside"),
            ("c.gltf", text("c.bin", 36), "c.bin is not there"),
            ("d.gltf", text("a.bin", 400), "there is none"),
            ("e.csv", "x,y,z\n1,inf,2\n".to_owned(), "line 2: column y"),
            ("f.csv", "x,y,w\n1,2,3\n".to_owned(), "no column \"z\""),
            ("g.obj", String::new(), "there is none"),
            ("h.glb", "glTF".to_owned(), "cannot be read"),
        ] {
            let error = points(&path(name, &content)).unwrap_err().to_string();
            assert!(error.contains(word) && error.contains(name), "{name}: {error}");
        }
    }
}
