//! Boxes around meshes: their vertices are all that is read.

use std::path::{Path, PathBuf};

use super::{kinds, xml};
use crate::math::{Point, Vector};

/// Where a mesh lies: beside the model, below one of `folders`, or, for `package://name/...`, below a folder above the
/// model that has or is that package. `None` where there is no such file.
pub(super) fn find(model: &Path, folders: &[PathBuf], file: &str) -> Option<PathBuf> {
    let dir = model.parent().unwrap_or(Path::new(""));
    let file = file.strip_prefix("file://").unwrap_or(file);
    let candidates: Vec<PathBuf> = match file.strip_prefix("package://").or_else(|| file.strip_prefix("model://")) {
        Some(inside) => {
            let (package, rest) = inside.split_once('/')?;
            let absolute = std::path::absolute(dir).ok()?;
            absolute
                .ancestors()
                .flat_map(|above| {
                    let is_it = above.file_name().is_some_and(|n| n.to_str() == Some(package));
                    is_it.then(|| above.join(rest)).into_iter().chain([above.join(inside)])
                })
                .collect()
        }
        None => folders.iter().map(|f| dir.join(f).join(file)).chain([dir.join(file)]).collect(),
    };
    candidates.into_iter().find(|c| c.is_file())
}

/// A file beside `path` whose name differs only in capitals, by name.
pub(super) fn other_case(path: &Path) -> Option<String> {
    let wanted = path.file_name()?.to_str()?;
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let entries = std::fs::read_dir(folder).ok()?;
    let names = entries.filter_map(|e| e.ok()?.file_name().into_string().ok());
    names.filter(|n| n.eq_ignore_ascii_case(wanted)).min()
}

/// What a mesh's file holds, as far as models need it.
#[derive(Debug, Clone)]
pub(super) struct MeshMeasures {
    /// Lowest and highest corner of its vertices; `Err` says why there are none.
    pub bounds: Result<[Point; 2], String>,
    /// Why MuJoCo refuses to read it, in words behind its name.
    pub refused: Option<String>,
    /// What its faces name that is not there, in words behind its name.
    pub faces: Option<String>,
    /// Why there is nothing between its vertices, in words behind its name.
    pub hollow: Option<String>,
    /// Its vertices lie in one plane.
    pub flat: bool,
}

impl MeshMeasures {
    /// Without a look at its vertices.
    fn unseen(why: String, refused: Option<String>) -> Self {
        Self { bounds: Err(why), refused, faces: None, hollow: None, flat: false }
    }
}

/// What is said of a flat mesh, behind its name.
pub(super) const FLAT: &str = "is flat; give it a thickness, or write a thin box";

/// Lowest and highest corner of an OBJ or STL file's vertices; `Err` says why there are none.
pub(super) fn bounds(path: &Path) -> Result<[Point; 2], String> {
    measured(path).bounds
}

/// Vertices as they come.
struct Vertices {
    low: Vector,
    high: Vector,
    /// The first few that differ.
    distinct: Vec<[f64; 3]>,
    span: VertexSpan,
}

/// What the vertices span so far. To simulators they are numbers of single precision, and are compared as such.
enum VertexSpan {
    Nothing,
    Point(Vector),
    /// A point, and the way to the next one.
    Line(Vector, Vector),
    /// A point, its distance to the next one, and the normal.
    Plane(Vector, f64, Vector),
    Space,
}

impl VertexSpan {
    /// Adds a vertex; what is nearer than numbers can tell lies on it.
    fn add(&mut self, p: Vector) {
        const NEAR: f64 = 1e-15;
        *self = match *self {
            VertexSpan::Nothing => VertexSpan::Point(p),
            VertexSpan::Point(a) if (p - a).norm() > NEAR => VertexSpan::Line(a, p - a),
            VertexSpan::Line(a, along) => {
                let across = along.cross(&(p - a));
                let area = across.norm();
                if area <= NEAR * along.norm() * (p - a).norm() {
                    return;
                }
                VertexSpan::Plane(a, along.norm(), across / area)
            }
            VertexSpan::Plane(a, length, normal) if (normal.dot(&p) - normal.dot(&a)).abs() > NEAR * length => {
                VertexSpan::Space
            }
            _ => return,
        };
    }
}

/// Fewer have no volume.
const MIN_VERTICES: usize = 4;

impl Vertices {
    fn new() -> Self {
        let (low, high) = (Vector::repeat(f64::INFINITY), Vector::repeat(f64::NEG_INFINITY));
        Self { low, high, distinct: Vec::new(), span: VertexSpan::Nothing }
    }

    fn add(&mut self, p: [f64; 3]) {
        // Comparisons would pass over what is no number.
        if p.iter().all(|x| x.is_finite()) {
            self.low = self.low.inf(&Vector::from(p));
            self.high = self.high.sup(&Vector::from(p));
            self.span.add(Vector::from(p.map(|x| f64::from(x as f32))));
        } else {
            (self.low, self.high) = (Vector::repeat(f64::NEG_INFINITY), Vector::repeat(f64::INFINITY));
        }
        if self.distinct.len() < MIN_VERTICES && !self.distinct.contains(&p) {
            self.distinct.push(p);
        }
    }

    fn bounds(&self) -> Result<[Point; 2], String> {
        if self.low.iter().chain(self.high.iter()).all(|x| x.is_finite()) {
            Ok([Point::from(self.low), Point::from(self.high)])
        } else {
            Err("it has no vertices, or some that are not finite".to_owned())
        }
    }

    /// Why there is nothing between them.
    fn hollow(&self) -> Option<String> {
        if self.distinct.len() < MIN_VERTICES {
            return Some(format!("has fewer than {MIN_VERTICES} vertices that differ"));
        }
        if self.bounds().is_err() {
            return Some("has vertices that are not finite".to_owned());
        }
        matches!(self.span, VertexSpan::Nothing | VertexSpan::Point(_) | VertexSpan::Line(..))
            .then(|| "has all its vertices on one line".to_owned())
    }

    fn is_flat(&self) -> bool {
        matches!(self.span, VertexSpan::Plane(..))
    }
}

/// Why there is nothing between vertices, three numbers each, and whether they lie in one plane.
pub(super) fn solid(vertices: &[f64]) -> (Option<String>, bool) {
    let mut all = Vertices::new();
    for vertex in vertices.chunks_exact(3) {
        all.add([vertex[0], vertex[1], vertex[2]]);
    }
    (all.hollow(), all.is_flat())
}

/// Measures an OBJ or STL file.
pub(super) fn measured(path: &Path) -> MeshMeasures {
    let bytes = match xml::read_bytes(path, xml::MAX_BYTES) {
        Ok(bytes) => bytes,
        Err(e) => return MeshMeasures::unseen(e.to_string(), None),
    };
    let pointer = "is a Git LFS pointer, not the mesh (run `git lfs pull`)";
    if kinds::is_pointer(&bytes) {
        return MeshMeasures::unseen(format!("it {pointer}"), Some(pointer.to_owned()));
    }
    let kind = path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase()).unwrap_or_default();
    let mut vertices = Vertices::new();
    let (mut refused, mut faces) = (None, None);
    match kind.as_str() {
        "obj" => {
            text_vertices(&bytes, "v", &mut |p: [f64; 3]| vertices.add(p));
            faces = broken_face(&bytes);
        }
        "stl" => match binary_triangles(&bytes) {
            Some(triangles) => {
                corners(triangles, &mut |p: [f64; 3]| vertices.add(p));
                let faces = triangles.len() / TRIANGLE;
                if faces > MAX_FACES {
                    refused = Some(format!("has {faces} faces, more than {MAX_FACES} in one STL"));
                }
            }
            None => {
                text_vertices(&bytes, "vertex", &mut |p: [f64; 3]| vertices.add(p));
                refused = Some("is no whole binary STL (text, cut off, or longer than it says)".to_owned());
            }
        },
        other => {
            let shown = if other.is_empty() { "no extension".to_owned() } else { format!(".{}", xml::brief(other)) };
            // MuJoCo's own format is read by nobody else.
            let refused = (other != "msh").then(|| format!("is not OBJ or binary STL ({shown})"));
            let why = format!("the format \"{}\" is not read (OBJ and STL are)", xml::brief(other));
            return MeshMeasures::unseen(why, refused);
        }
    }
    MeshMeasures { bounds: vertices.bounds(), refused, faces, hollow: vertices.hollow(), flat: vertices.is_flat() }
}

/// What MuJoCo's reader of STL takes at most.
const MAX_FACES: usize = 200_000;

/// The corners of a binary STL's triangles.
fn corners(triangles: &[u8], add: &mut impl FnMut([f64; 3])) {
    for corner in triangles.chunks_exact(TRIANGLE).flat_map(|t| t[12..48].chunks_exact(12)) {
        let coordinate = |k: usize| {
            let four = corner.get(4 * k..4 * k + 4).and_then(|b| b.try_into().ok()).unwrap_or([0; 4]);
            f64::from(f32::from_le_bytes(four))
        };
        add([coordinate(0), coordinate(1), coordinate(2)]);
    }
}

/// Bytes of a triangle of a binary STL: a normal, three corners, two bytes more.
const TRIANGLE: usize = 50;

/// The triangles of a binary STL, told from text by its length.
fn binary_triangles(bytes: &[u8]) -> Option<&[u8]> {
    let count = u32::from_le_bytes(bytes.get(80..84)?.try_into().ok()?) as usize;
    let rest = &bytes[84..];
    (rest.len() == count.checked_mul(TRIANGLE)?).then_some(rest)
}

/// Three numbers behind a word at the beginning of a line.
fn text_vertices(bytes: &[u8], word: &str, add: &mut impl FnMut([f64; 3])) {
    for line in bytes.split(|b| *b == b'\n') {
        let Ok(line) = std::str::from_utf8(line) else { continue };
        let mut words = line.split_ascii_whitespace();
        if words.next() != Some(word) {
            continue;
        }
        let mut coordinate = || words.next().and_then(|w| w.parse::<f64>().ok()).unwrap_or(f64::NAN);
        add([coordinate(), coordinate(), coordinate()]);
    }
}

/// The first face of an OBJ file that names a vertex which is not there, in words behind the file's name. Faces may come
/// before their vertices unless they count backwards.
fn broken_face(bytes: &[u8]) -> Option<String> {
    let begins = |line: &[u8], letter: u8| match line.trim_ascii_start() {
        [first, blank, ..] => *first == letter && blank.is_ascii_whitespace(),
        _ => false,
    };
    let lines = || bytes.split(|b| *b == b'\n').enumerate();
    let count = lines().filter(|(_, line)| begins(line, b'v')).count();
    let mut so_far = 0;
    for (number, line) in lines() {
        if begins(line, b'v') {
            so_far += 1;
        }
        if !begins(line, b'f') {
            continue;
        }
        let indices: Vec<i64> =
            line.split(u8::is_ascii_whitespace).filter(|w| !w.is_empty()).skip(1).map(index).collect();
        // Two corners are no face to anybody.
        let is_face = indices.len() >= 3;
        let wrong = indices.into_iter().find(|i| match usize::try_from(i.unsigned_abs()) {
            _ if *i == 0 => true,
            Ok(back) if *i < 0 => back > so_far,
            Ok(index) => is_face && index > count && index <= MOST_INDEX,
            Err(_) => false,
        });
        if let Some(index) = wrong {
            let there = if index == 0 { "they count from 1".to_owned() } else { format!("there are {count}") };
            return Some(format!("is broken: a face in line {} names vertex {index}, {there}", number + 1));
        }
    }
    None
}

/// Larger indices are no numbers of 32 bits, and MuJoCo passes over them.
const MOST_INDEX: usize = i32::MAX as usize;

/// The number that a word begins with, as C reads it: 0 where there is none.
fn index(word: &[u8]) -> i64 {
    let (sign, digits) = match word {
        [b'-', rest @ ..] => (-1, rest),
        [b'+', rest @ ..] => (1, rest),
        _ => (1, word),
    };
    let digits = digits.iter().take_while(|b| b.is_ascii_digit());
    sign * digits.fold(0i64, |sum, digit| sum.saturating_mul(10).saturating_add(i64::from(digit - b'0')))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_face_that_names_no_vertex_is_found() {
        const FOUR: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n";
        // As MuJoCo 3.17 has them.
        for (faces, word) in [
            ("f 1 2 3\n", ""),
            ("f 1/9 2//9 3/\n", ""),
            ("f -1 -2 -3\n", ""),
            ("f 1 2 99999999999999999999\n", ""),
            ("f 1 9\n", ""),
            ("# f 1 2 9\nfx 1 2 9\n", ""),
            ("f 1 2 9\n", "line 5 names vertex 9, there are 4"),
            ("f 1 2 3\n\tf 1 2 3 5", "line 6 names vertex 5"),
            ("f 0 1 2\n", "names vertex 0, they count from 1"),
            ("f 1 2 3 # c\n", "names vertex 0"),
            ("f -9 -2 -3\n", "names vertex -9"),
        ] {
            let said = broken_face(format!("{FOUR}{faces}").as_bytes()).unwrap_or_default();
            assert!(said.contains(word) && said.is_empty() == word.is_empty(), "{faces}: {said}");
        }
        assert_eq!(broken_face(format!("f 1 2 4\n{FOUR}").as_bytes()), None);
        assert!(broken_face(format!("f -1 -2 -3\n{FOUR}").as_bytes()).is_some());
    }

    #[test]
    fn a_mesh_has_the_same_bounds_in_every_format() {
        let dir = tempfile::tempdir().unwrap();
        let corners = [[0.0, 0.0, 1.0], [2.0, 0.0, 1.0], [0.0, -3.0, 1.5f32]];
        let obj: String = corners.iter().map(|c| format!("v {} {} {}\n", c[0], c[1], c[2])).collect();
        let ascii: String = corners.iter().map(|c| format!("  vertex {} {} {}\n", c[0], c[1], c[2])).collect();
        let mut binary = vec![0u8; 80];
        binary.extend(1u32.to_le_bytes());
        binary.extend([0u8; 12]);
        binary.extend(corners.iter().flatten().flat_map(|x| x.to_le_bytes()));
        binary.extend([0u8; 2]);
        for (name, bytes) in [("a.obj", obj.into_bytes()), ("a.stl", ascii.into_bytes()), ("b.STL", binary)] {
            let path = dir.path().join(name);
            std::fs::write(&path, bytes).unwrap();
            assert_eq!(bounds(&path).unwrap(), [Point::new(0.0, -3.0, 1.0), Point::new(2.0, 0.0, 1.5)], "{name}");
        }
        std::fs::write(dir.path().join("c.obj"), "v 1 2\n").unwrap();
        assert!(bounds(&dir.path().join("c.obj")).is_err());
        assert!(bounds(&dir.path().join("c.dae")).is_err());
        let model = dir.path().join("robots/kitchen/urdf/m.urdf");
        std::fs::create_dir_all(dir.path().join("robots/kitchen/urdf")).unwrap();
        std::fs::write(dir.path().join("robots/kitchen/a.obj"), "v 0 0 0\n").unwrap();
        assert!(find(&model, &[], "package://kitchen/a.obj").is_some());
        assert!(find(&model, &[], "package://kitchen/b.obj").is_none());
        assert!(find(&model, &[], "../a.obj").is_some());
    }
}
