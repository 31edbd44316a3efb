//! Points of a static reconstruction, which stands in for depth.

use std::fs::File;
use std::io::BufReader;
use std::path::Path;

use super::folder::MAX_COORDINATE;
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
        return Err(Error::format(
            &file,
            "vertices",
            "no finite points (of an OBJ only vertices in faces count); use PLY",
        ));
    }
    Ok(finite)
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

fn obj_points(path: &Path) -> Result<Vec<Point>> {
    let options = tobj::LoadOptions { ignore_points: false, ..Default::default() };
    let (models, _) = tobj::load_obj(path, &options)
        .map_err(|e| Error::format(path, "obj", format!("cannot be read ({e}); export the mesh again")))?;
    Ok(models
        .iter()
        .flat_map(|m| m.mesh.positions.chunks_exact(3))
        .map(|c| Point::new(f64::from(c[0]), f64::from(c[1]), f64::from(c[2])))
        .collect())
}
