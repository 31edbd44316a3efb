//! Points of a static reconstruction, which stands in for depth.

use std::fs::File;
use std::io::BufReader;
use std::path::Path;

use super::folder::MAX_COORDINATE;
use super::read::bounded_line;
use crate::error::{Error, Result};
use crate::math::Point;

/// The points of `reconstruction.ply` or `.obj`; none where there is neither.
pub(super) fn read(dir: &Path) -> Result<Vec<Point>> {
    let (ply, obj) = (dir.join("reconstruction.ply"), dir.join("reconstruction.obj"));
    let points = if ply.is_file() {
        ply_points(&ply)?
    } else if obj.is_file() {
        obj_points(&obj)?
    } else {
        return Ok(Vec::new());
    };
    let finite: Vec<Point> = points.into_iter().filter(|p| p.coords.iter().all(|x| x.abs() < MAX_COORDINATE)).collect();
    if finite.is_empty() {
        let file = if ply.is_file() { ply } else { obj };
        return Err(Error::format(&file, "vertices", "no finite points; export the mesh again"));
    }
    Ok(finite)
}

/// Whether points show surfaces without holes, as depth does, so that what lies behind a surface does not show through it.
///
/// Of the 26 cells around one that a plane runs through the plane fills eight, an edge or a row of corners two; noise fills others,
/// too, but each with a point or two. Cells are what a point covers when it is seen (`images::splat`); a scan or a mesh has a
/// point every two to three centimetres.
pub(crate) fn is_dense(points: &[Point]) -> bool {
    const CELL_M: f64 = 0.05;
    const NEIGHBOURS: usize = 6;
    const POINTS: usize = 3;
    /// Cells that are asked; a median of so many is known well.
    const ASKED: usize = 4000;
    let mut cells: Vec<[i64; 3]> =
        points.iter().map(|p| [p.x, p.y, p.z].map(|c| (c / CELL_M).floor() as i64)).collect();
    cells.sort_unstable();
    cells.dedup();
    if points.len() < POINTS * cells.len() {
        return false;
    }
    let around = |[x, y, z]: &[i64; 3]| {
        let beside = (0..27).filter(|i| *i != 13).map(|i: i64| [x + i % 3 - 1, y + i / 3 % 3 - 1, z + i / 9 - 1]);
        beside.filter(|cell| cells.binary_search(cell).is_ok()).count()
    };
    let mut counts: Vec<usize> = cells.iter().step_by(cells.len().div_ceil(ASKED).max(1)).map(around).collect();
    counts.sort_unstable();
    counts.get(counts.len() / 2).is_some_and(|count| *count >= NEIGHBOURS)
}

#[derive(Default)]
struct PlyVertex([f64; 3]);

impl ply_rs_bw::ply::PropertyAccess for PlyVertex {
    fn new() -> Self {
        Self::default()
    }

    fn set_float(&mut self, name: &str, value: f32) -> ply_rs_bw::ply::PropertyAccessResult {
        self.set_double(name, f64::from(value))
    }

    fn set_double(&mut self, name: &str, value: f64) -> ply_rs_bw::ply::PropertyAccessResult {
        let index = match name {
            "x" => 0,
            "y" => 1,
            "z" => 2,
            _ => return ply_rs_bw::ply::PropertyAccessResult::Ignored,
        };
        self.0[index] = value;
        ply_rs_bw::ply::PropertyAccessResult::Set
    }
}

/// A header may announce any number of elements: each takes at least a byte of the file.
fn check_counts(path: &Path) -> Result<()> {
    let file = File::open(path).map_err(|e| Error::io(path, &e))?;
    let bytes = file.metadata().map_err(|e| Error::io(path, &e))?.len();
    let mut reader = BufReader::new(file);
    let header = ply_rs_bw::parser::Parser::<PlyVertex>::new().read_ply_header(&mut reader).map_err(|e| {
        Error::format(path, "header", format!("cannot be read ({e}); write it again as binary or ASCII PLY"))
    })?;
    for element in header.elements.values() {
        let (name, count) = (&element.name, element.count);
        if count as u64 > bytes || (count > 0 && element.properties.is_empty()) {
            let message = format!("announces {count} of \"{name}\", more than the file can hold");
            return Err(Error::format(path, "header", message));
        }
    }
    Ok(())
}

/// Vertices of a PLY file.
pub(crate) fn ply_points(path: &Path) -> Result<Vec<Point>> {
    check_counts(path)?;
    let file = File::open(path).map_err(|e| Error::io(path, &e))?;
    let mut reader = BufReader::new(file);
    let ply = ply_rs_bw::parser::Parser::<PlyVertex>::new().read_ply(&mut reader).map_err(|e| {
        Error::format(path, "ply", format!("cannot be read ({e}); write it again as binary or ASCII PLY"))
    })?;
    let vertices = ply.payload.get("vertex").ok_or_else(|| Error::format(path, "header", "no element \"vertex\""))?;
    Ok(vertices.iter().map(|v| Point::from(v.0)).collect())
}

/// All vertices. Faces, materials and the files that they name are of no use here and are not looked at.
fn obj_points(path: &Path) -> Result<Vec<Point>> {
    let file = File::open(path).map_err(|e| Error::io(path, &e))?;
    let mut reader = BufReader::new(file);
    let mut out = Vec::new();
    let mut number = 0;
    loop {
        number += 1;
        let Some(line) = bounded_line(&mut reader, path, number)? else { return Ok(out) };
        let mut words = line.split_ascii_whitespace();
        if words.next() != Some("v") {
            continue;
        }
        let mut p = [0.0; 3];
        for value in &mut p {
            *value = words.next().and_then(|w| w.parse::<f64>().ok()).ok_or_else(|| {
                Error::format(path, format!("line {number}"), "expected v and three numbers; export the mesh again")
            })?;
        }
        out.push(Point::from(p));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_scanned_wall_is_dense_and_points_of_its_edges_are_not() {
        let wall: Vec<Point> =
            (0..10_000).map(|i| Point::new(0.02 * f64::from(i % 100), 0.0, 0.02 * f64::from(i / 100))).collect();
        assert!(is_dense(&wall));
        let edges: Vec<Point> = (0..400)
            .map(|i| Point::new(0.5 * f64::from(i % 4), 0.0, 0.02 * f64::from(i / 4)))
            .chain((0..200).map(|i| Point::new(0.31 * f64::from(i % 20), 0.4, 0.27 * f64::from(i / 20))))
            .collect();
        assert!(!is_dense(&edges) && !is_dense(&[Point::origin()]) && !is_dense(&[]));
    }

    #[test]
    fn an_obj_is_its_vertices_whatever_its_faces_and_materials_say() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("reconstruction.obj");
        let faces = "mtllib /dev/zero\nv 1 2 3 0.5 0.5 0.5\r\nvn 0 0 1\nvt 0 0\nv -1 0 2.5\nf 1/-9/9223372036854775807 -9 2//0\n";
        std::fs::write(&path, faces).unwrap();
        assert_eq!(read(dir.path()).unwrap(), [Point::new(1.0, 2.0, 3.0), Point::new(-1.0, 0.0, 2.5)]);
        for (text, word) in
            [("v 1 2\n", "line 1: expected v"), ("# a\nv 1 x 2\n", "line 2"), ("f 1 2 3\n", "no finite points")]
        {
            std::fs::write(&path, text).unwrap();
            let error = read(dir.path()).unwrap_err().to_string();
            assert!(error.contains(word) && error.contains("reconstruction.obj"), "{error}");
        }
    }
}
