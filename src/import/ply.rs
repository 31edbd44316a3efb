//! A PLY file with its points in their order, and what stands beside them.

use std::fs::File;
use std::io::BufReader;
use std::path::Path;

use ply_rs_bw::parser::{Parser, Reader};
use ply_rs_bw::ply::{Property, PropertyAccess, PropertyAccessResult};

use crate::error::{Error, Result};
use crate::math::Point;

/// Points of a reconstruction. Nothing is left out or put in another order: other files count them.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Cloud {
    /// The vertices, in the file's unit and axes; some may not be finite.
    pub points: Vec<Point>,
    /// A normal for each vertex; empty where the file has none.
    pub normals: Vec<[f32; 3]>,
    /// A colour for each vertex; empty where the file has none.
    pub colors: Vec<[u8; 3]>,
    /// The faces.
    pub faces: Vec<PlyFace>,
}

/// A face of a mesh.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct PlyFace {
    /// Numbers of its vertices; some may be beyond the last one.
    pub corners: Vec<usize>,
    /// `partId`, as MultiScan writes it.
    pub part: Option<i64>,
}

#[derive(Default)]
struct Vertex {
    point: [f64; 3],
    normal: [f32; 3],
    color: [u8; 3],
}

/// The number of a property that is one.
fn number(value: &Property) -> Option<f64> {
    Some(match value {
        Property::Char(v) => f64::from(*v),
        Property::UChar(v) => f64::from(*v),
        Property::Short(v) => f64::from(*v),
        Property::UShort(v) => f64::from(*v),
        Property::Int(v) => f64::from(*v),
        Property::UInt(v) => f64::from(*v),
        Property::Float(v) => f64::from(*v),
        Property::Double(v) => *v,
        _ => return None,
    })
}

impl PropertyAccess for Vertex {
    fn new() -> Self {
        Self::default()
    }

    fn set_property(&mut self, name: &str, value: Property) -> PropertyAccessResult {
        let Some(number) = number(&value) else { return PropertyAccessResult::Ignored };
        // Colours as fractions go from 0 to 1.
        let scale = if matches!(value, Property::Float(_) | Property::Double(_)) { 255.0 } else { 1.0 };
        let color = (number * scale).clamp(0.0, 255.0) as u8;
        match name {
            "x" => self.point[0] = number,
            "y" => self.point[1] = number,
            "z" => self.point[2] = number,
            "nx" => self.normal[0] = number as f32,
            "ny" => self.normal[1] = number as f32,
            "nz" => self.normal[2] = number as f32,
            "red" => self.color[0] = color,
            "green" => self.color[1] = color,
            "blue" => self.color[2] = color,
            _ => return PropertyAccessResult::Ignored,
        }
        PropertyAccessResult::Set
    }
}

impl PropertyAccess for PlyFace {
    fn new() -> Self {
        Self::default()
    }

    fn set_property(&mut self, name: &str, value: Property) -> PropertyAccessResult {
        match (name, value) {
            ("vertex_indices" | "vertex_index", Property::ListInt(all)) => {
                self.corners = all.into_iter().filter_map(|i| usize::try_from(i).ok()).collect();
            }
            ("vertex_indices" | "vertex_index", Property::ListUInt(all)) => {
                self.corners = all.into_iter().filter_map(|i| usize::try_from(i).ok()).collect();
            }
            ("vertex_indices" | "vertex_index", Property::ListUShort(all)) => {
                self.corners = all.into_iter().map(usize::from).collect();
            }
            ("partId", value) => self.part = number(&value).map(|v| v as i64),
            _ => return PropertyAccessResult::Ignored,
        }
        PropertyAccessResult::Set
    }
}

/// Whatever else a file holds, which is passed over.
struct Other;

impl PropertyAccess for Other {
    fn new() -> Self {
        Self
    }
}

/// Reads an ASCII or binary PLY file.
///
/// # Errors
/// Where it cannot be read, is no PLY, announces more than it can hold, or has no points.
pub fn read(path: &Path) -> Result<Cloud> {
    let file = File::open(path).map_err(|e| Error::io(path, &e))?;
    let bytes = file.metadata().map_err(|e| Error::io(path, &e))?.len();
    let mut reader = Reader::new(BufReader::new(file));
    let broken = |place: &str, why: String| {
        Error::format(path, place.to_owned(), format!("cannot be read ({why}); write it again as binary or ASCII PLY"))
    };
    let header = Parser::<Vertex>::new().read_header(&mut reader).map_err(|e| broken("header", e.to_string()))?;
    let mut cloud = Cloud::default();
    for element in header.elements.values() {
        // Each element takes at least a byte.
        if element.count as u64 > bytes || (element.count > 0 && element.properties.is_empty()) {
            let message = format!("announces {} of \"{}\", more than the file can hold", element.count, element.name);
            return Err(Error::format(path, "header", message));
        }
        let has = |name: &str| element.properties.contains_key(name);
        match element.name.as_str() {
            "vertex" => {
                let all = Parser::<Vertex>::new()
                    .read_payload_for_element(&mut reader, element, &header)
                    .map_err(|e| broken("vertices", e.to_string()))?;
                cloud.points = all.iter().map(|v| Point::from(v.point)).collect();
                if has("nx") && has("ny") && has("nz") {
                    cloud.normals = all.iter().map(|v| v.normal).collect();
                }
                if has("red") && has("green") && has("blue") {
                    cloud.colors = all.iter().map(|v| v.color).collect();
                }
            }
            "face" => {
                cloud.faces = Parser::<PlyFace>::new()
                    .read_payload_for_element(&mut reader, element, &header)
                    .map_err(|e| broken("faces", e.to_string()))?;
            }
            name => {
                Parser::<Other>::new()
                    .read_payload_for_element(&mut reader, element, &header)
                    .map_err(|e| broken(name, e.to_string()))?;
            }
        }
    }
    if cloud.points.is_empty() {
        return Err(Error::format(path, "header", "no points (an element \"vertex\" with x, y, z is needed)"));
    }
    Ok(cloud)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn written(text: &str) -> (tempfile::TempDir, std::path::PathBuf) {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("scan.ply");
        std::fs::write(&path, text).unwrap();
        (dir, path)
    }

    #[test]
    fn points_colours_and_parts_are_read_in_their_order() {
        let (_dir, path) = written(
            "ply\nformat ascii 1.0\nelement vertex 3\nproperty double x\nproperty double y\nproperty double z\n\
             property uchar red\nproperty uchar green\nproperty uchar blue\nelement face 1\n\
             property list uchar int vertex_indices\nproperty ushort objectId\nproperty ushort partId\nend_header\n\
             0 0 0 255 0 0\n1 0 0 0 255 0\n0 2 0 0 0 255\n3 0 1 2 4 7\n",
        );
        let cloud = read(&path).unwrap();
        assert_eq!(cloud.points[2], Point::new(0.0, 2.0, 0.0));
        assert_eq!(cloud.colors[1], [0, 255, 0]);
        assert!(cloud.normals.is_empty());
        assert_eq!(cloud.faces, [PlyFace { corners: vec![0, 1, 2], part: Some(7) }]);
    }

    #[test]
    fn a_broken_file_is_told_by_name_and_place() {
        for (text, words) in [
            ("not a ply", "header"),
            ("ply\nformat ascii 1.0\nelement vertex 9999999\nproperty float x\nend_header\n", "more than the file"),
            ("ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nend_header\n1\n", "vertices"),
            ("ply\nformat ascii 1.0\nelement vertex 0\nproperty float x\nend_header\n", "no points"),
        ] {
            let (_dir, path) = written(text);
            let error = read(&path).unwrap_err().to_string();
            assert!(error.contains(words) && error.contains("scan.ply"), "{words}: {error}");
        }
    }
}
