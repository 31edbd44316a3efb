//! The files that an MJCF needs beside itself: meshes, pictures, height fields. They are looked for where MuJoCo does.

use std::cell::OnceCell;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

use nalgebra::UnitQuaternion;

use super::mesh_files::{self, MeshMeasures};
use super::mjcf_schema::place;
use super::png_files;
use super::xml::{Element, brief};
use crate::math::{Point, Vector, plain};

/// Where `<compiler>` says that files lie, below the model's folder.
#[derive(Debug, Clone, Default)]
pub(super) struct Folders {
    mesh: PathBuf,
    texture: PathBuf,
    /// Of a file's path only its last name counts.
    strip: bool,
}

impl Folders {
    /// Takes what a `<compiler>` says; the last one counts.
    pub(super) fn take(&mut self, compiler: &Element) {
        let folder = |attribute: &str| compiler.get(attribute).map(|f| PathBuf::from(f.replace('\\', "/")));
        if let Some(both) = folder("assetdir") {
            (self.mesh, self.texture) = (both.clone(), both);
        }
        if let Some(own) = folder("meshdir") {
            self.mesh = own;
        }
        if let Some(own) = folder("texturedir") {
            self.texture = own;
        }
        if let Some(strip) = compiler.get("strippath") {
            self.strip = strip == "true";
        }
    }

    /// Where a mesh, or a height field, lies.
    pub(super) fn mesh(&self, model: &Path, file: &str) -> PathBuf {
        self.path(model, &self.mesh, file)
    }

    fn path(&self, model: &Path, folder: &Path, file: &str) -> PathBuf {
        let file = file.replace('\\', "/");
        let name = if self.strip { file.rsplit('/').next().unwrap_or(&file) } else { &file };
        model.parent().unwrap_or(Path::new("")).join(folder).join(name)
    }
}

/// Where a mesh's vertices come from.
#[derive(Debug, Clone)]
pub(super) enum VertexSource {
    /// A file.
    File(PathBuf),
    /// They are written in the model: lowest and highest corner.
    Written([Point; 2]),
    /// The simulator makes it; whether it is a flat plate.
    Made(bool),
}

/// A mesh of `<asset>`.
#[derive(Debug, Clone)]
pub(super) struct MeshAsset {
    pub(super) source: VertexSource,
    pub(super) scale: Vector,
    /// `refpos`: what of the file becomes the origin, file units.
    pub(super) origin: Vector,
    /// `refquat`: what of the file becomes the axes.
    pub(super) turn: UnitQuaternion<f64>,
    /// Its mass lies in its surface (`inertia="shell"`), which may be flat.
    pub(super) shell: bool,
    /// Whether it has no volume, once asked for.
    pub(super) thin: OnceCell<bool>,
}

impl MeshAsset {
    /// Whether it is there, and has no volume that others could run into. A flat file that is no shell is refused whoever
    /// shows it.
    pub(super) fn is_thin(&self) -> bool {
        *self.thin.get_or_init(|| match &self.source {
            VertexSource::File(path) => self.shell && mesh_files::measured(path).flat,
            VertexSource::Written(_) => false,
            VertexSource::Made(plate) => *plate,
        })
    }

    /// Lowest and highest corner as the simulator has it, metres; `Err` says why there are none.
    pub(super) fn bounds(&self) -> Result<[Point; 2], String> {
        let [low, high] = match &self.source {
            VertexSource::File(path) if !path.is_file() => return Err("there is no such file".to_owned()),
            VertexSource::File(path) => mesh_files::bounds(path)?,
            VertexSource::Written(corners) => *corners,
            VertexSource::Made(_) => return Err("the simulator makes it itself".to_owned()),
        };
        let mut ends = [Vector::repeat(f64::INFINITY), Vector::repeat(f64::NEG_INFINITY)];
        for corner in 0..8 {
            let of = |axis: usize| if (corner >> axis) & 1 == 0 { low[axis] } else { high[axis] };
            let there = self.turn.inverse() * (Vector::new(of(0), of(1), of(2)) - self.origin);
            let scaled = there.component_mul(&self.scale);
            ends = [ends[0].inf(&scaled), ends[1].sup(&scaled)];
        }
        Ok(ends.map(Point::from))
    }
}

/// The six sides of a cube's picture, and the picture of everything else.
pub(super) const PICTURES: [&str; 7] = ["file", "fileright", "fileleft", "fileup", "filedown", "filefront", "fileback"];

/// Files of `<asset>` that are not there, or that MuJoCo does not read.
pub(super) fn missing(model: &Path, root: &Element, folders: &Folders) -> Vec<String> {
    let mut faults = Vec::new();
    let shells = root.all("default").any(shell_by_default);
    // A file that many meshes show is read once.
    let mut measured: BTreeMap<PathBuf, MeshMeasures> = BTreeMap::new();
    for asset in root.children.iter().filter(|c| ["asset", "deformable"].contains(&c.name.as_str())) {
        for element in &asset.children {
            let before = faults.len();
            let mut needs = |attribute: &str, folder: &Path, endings: &[&str]| {
                let Some(file) = element.get(attribute).filter(|f| !f.is_empty()) else { return };
                // What says its own type need not say it by its ending.
                let endings: &[&str] = if element.get("content_type").is_some() { &[] } else { endings };
                let path = folders.path(model, folder, file);
                let content = element.get("content_type");
                if let Some(why) = refused(&path, endings) {
                    faults.push(format!("{}: {}: {why}", place(model, element), brief(file)));
                } else if let Some(why) = no_picture(&path, element, content) {
                    faults.push(format!("{}: {}: {why}; MuJoCo refuses the model", place(model, element), brief(file)));
                }
            };
            match element.name.as_str() {
                "mesh" => needs("file", &folders.mesh, &["obj", "stl", "msh"]),
                "texture" if element.get("builtin").is_none_or(|b| b == "none") => {
                    PICTURES.iter().for_each(|attribute| needs(attribute, &folders.texture, &["png", "ktx"]));
                }
                "hfield" | "skin" => needs("file", &folders.mesh, &[]),
                "model" => needs("file", Path::new(""), &[]),
                _ => {}
            }
            let from_nothing = |what: &str| element.get(what).is_none() && element.child("plugin").is_none();
            if element.name == "mesh" && ["file", "vertex", "builtin"].into_iter().all(from_nothing) {
                faults.push(format!("{}: has neither file nor vertices; MuJoCo refuses it", place(model, element)));
            }
            if element.name == "mesh" && faults.len() == before {
                let shell = element.get("inertia").map_or(shells, |i| i == "shell");
                let file = element.get("file").filter(|f| !f.is_empty()).map(|f| folders.mesh(model, f));
                let found = file
                    .filter(|f| f.is_file())
                    .map(|f| measured.entry(f).or_insert_with_key(|f| mesh_files::measured(f)).clone());
                if let Some(why) = no_solid(element, found.as_ref(), shell) {
                    faults.push(format!("{}: {why}; MuJoCo refuses it", place(model, element)));
                }
            }
        }
    }
    faults
}

/// Why a picture, or a height field from one, cannot be read.
fn no_picture(path: &Path, element: &Element, content_type: Option<&str>) -> Option<&'static str> {
    if !["texture", "hfield"].contains(&element.name.as_str()) {
        return None;
    }
    let named = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("png"));
    if content_type.map_or(named, |kind| kind == "image/png") {
        return png_files::broken_png(path);
    }
    std::fs::metadata(path).is_ok_and(|m| m.len() == 0).then_some("is empty")
}

/// Whether a default says that meshes are shells.
fn shell_by_default(default: &Element) -> bool {
    default.all("mesh").any(|m| m.get("inertia") == Some("shell")) || default.all("default").any(shell_by_default)
}

/// Why a mesh is no solid: from its file where it has one, else from the vertices that are written; `shell` says that it
/// need not be one.
fn no_solid(element: &Element, file: Option<&MeshMeasures>, shell: bool) -> Option<String> {
    let scaled_away = element.numbers::<3>("scale").ok().flatten().is_some_and(|s| s.contains(&0.0));
    if scaled_away && !shell {
        return Some("its scale leaves no volume".to_owned());
    }
    let numbers = |attribute: &str| {
        let text = element.get(attribute).filter(|t| !t.trim().is_empty())?;
        element.parse(attribute, text, 0..=usize::MAX).ok()
    };
    let flat = |flat: bool| (flat && !shell).then(|| mesh_files::FLAT.to_owned());
    if let Some(found) = file {
        return found.faces.clone().or_else(|| found.hollow.clone()).or_else(|| flat(found.flat));
    }
    let vertices = numbers("vertex")?;
    if vertices.len() % 3 != 0 {
        return Some(format!("vertex has {} numbers, and each vertex three", vertices.len()));
    }
    let faces = numbers("face").unwrap_or_default();
    if faces.len() % 3 != 0 {
        return Some(format!("face has {} numbers, and each triangle three", faces.len()));
    }
    let count = vertices.len() / 3;
    if let Some(index) = faces.iter().find(|i| !(0.0..count as f64).contains(*i)) {
        return Some(format!("a face names vertex {}, there are {count}", plain(*index)));
    }
    let (hollow, is_flat) = mesh_files::solid(&vertices);
    hollow.or_else(|| flat(is_flat))
}

/// MuJoCo's limit.
const MAX_TRIANGLES: u64 = 200_000;

/// Why MuJoCo does not read a file; `endings` are those that it knows, none for any.
fn refused(path: &Path, endings: &[&str]) -> Option<String> {
    let Some(meta) = std::fs::metadata(path).ok().filter(std::fs::Metadata::is_file) else {
        return Some("there is no such file; MuJoCo refuses the model: bring the file, or mend the path".to_owned());
    };
    let mut head = Vec::new();
    // As much as the header of a binary STL.
    if File::open(path).and_then(|f| f.take(84).read_to_end(&mut head)).is_err() {
        return Some("cannot be read".to_owned());
    }
    if head.starts_with(b"version https://git-lfs") {
        return Some("is a Git LFS pointer, not the file itself: run git lfs pull".to_owned());
    }
    let ending = path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase()).unwrap_or_default();
    if !endings.is_empty() && !endings.contains(&ending.as_str()) {
        let known = endings.join(", ").to_ascii_uppercase();
        return Some(format!("MuJoCo reads {known} here and refuses other files; convert it"));
    }
    if ending != "stl" {
        return None;
    }
    let triangles = u64::from(head.get(80..84).and_then(|b| b.try_into().ok()).map_or(0, u32::from_le_bytes));
    let whole = 84 + 50 * triangles == meta.len();
    (!whole || !(1..=MAX_TRIANGLES).contains(&triangles)).then(|| {
        format!("MuJoCo reads binary STL of up to {MAX_TRIANGLES} triangles and refuses others; save it as such")
    })
}

#[cfg(test)]
mod tests {
    use super::super::xml;
    use super::*;

    #[test]
    fn files_are_looked_for_where_mujoco_does() {
        let compiler = |text: &str| xml::parse(Path::new("m.xml"), text).unwrap();
        let mut folders = Folders::default();
        folders.take(&compiler("<compiler assetdir=\"a\" meshdir=\"m\"/>"));
        assert_eq!(folders.mesh(Path::new("d/m.xml"), "x\\y.obj"), Path::new("d/m/x/y.obj"));
        assert_eq!(folders.texture, Path::new("a"));
        folders.take(&compiler("<compiler assetdir=\"b\" strippath=\"true\"/>"));
        assert_eq!(folders.mesh(Path::new("d/m.xml"), "x/y.obj"), Path::new("d/b/y.obj"));
    }

    /// Writes files that the simulator reads, and some that it refuses.
    fn write_files(dir: &Path) {
        let write = |name: &str, bytes: &[u8]| std::fs::write(dir.join(name), bytes).unwrap();
        let corners = [[0f32, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let mut stl = vec![0u8; 80];
        stl.extend(4u32.to_le_bytes());
        for triangle in [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]] {
            stl.extend([0u8; 12]);
            stl.extend(triangle.into_iter().flat_map(|i: usize| corners[i]).flat_map(f32::to_le_bytes));
            stl.extend([0u8; 2]);
        }
        write("good.stl", &stl);
        write("text.stl", b"solid x\nfacet\nendsolid\n");
        write("pointer.obj", b"version https://git-lfs.github.com/spec/v1\noid sha256:0\n");
        write("picture.jpg", b"x");
        write("text.png", b"not a picture");
        write("empty.ktx", b"");
        write("beyond.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 9\n");
        write("good.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n");
        write("three.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
        write("line.obj", b"v 0 0 0\nv 1 1 1\nv 2 2 2\nv 3 3 3\nf 1 2 3\nf 2 4 3\n");
        write("tilted.obj", b"v 0 0 0\nv 1 0 1\nv 0 1 0\nv 1 1 1\nf 1 2 3\nf 2 4 3\n");
        write("small.obj", b"v 0 0 0\nv 1e-7 0 0\nv 0 1e-7 0\nv 0 0 1e-7\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n");
    }

    #[test]
    fn a_file_that_mujoco_refuses_is_told_from_one_that_it_reads() {
        let dir = tempfile::tempdir().unwrap();
        write_files(dir.path());
        for (body, word) in [
            ("<mesh file=\"good.stl\"/>", ""),
            ("<mesh file=\"good.obj\"/>", ""),
            ("<mesh file=\"small.obj\" scale=\"1e6 1e6 1e6\"/>", ""),
            ("<mesh file=\"three.obj\"/>", "fewer than 4 vertices"),
            ("<mesh file=\"line.obj\" inertia=\"shell\"/>", "on one line"),
            ("<mesh file=\"tilted.obj\"/>", "is flat"),
            ("<mesh file=\"tilted.obj\" inertia=\"shell\"/>", ""),
            ("<mesh file=\"good.obj\" scale=\"0 1 1\"/>", "leaves no volume"),
            ("<mesh name=\"w\" vertex=\"0 0 0 1 0 0 0 1 0 0 0 1\"/>", ""),
            ("<mesh name=\"w\" vertex=\"0 0 0 1 0 0 0 1 0\"/>", "fewer than 4 vertices"),
            ("<mesh name=\"w\" vertex=\"0 0 0 1 0 0 0 1 0 1 1 0\"/>", "is flat"),
            ("<mesh name=\"w\" vertex=\"0 0 0 1 0 0 0 1 0 0 0\"/>", "each vertex three"),
            ("<mesh name=\"w\" vertex=\"0 0 0 1 0 0 0 1 0 0 0 1\" face=\"0 1 5\"/>", "a face names vertex 5"),
            ("<model name=\"m\" file=\"gone.xml\"/>", "gone.xml: there is no such file"),
            ("<texture builtin=\"flat\" file=\"gone.png\"/>", ""),
            ("<mesh name=\"n\"/>", "neither file nor vertices"),
            ("<mesh file=\"gone.obj\"/>", "gone.obj: there is no such file"),
            ("<mesh file=\"pointer.obj\"/>", "Git LFS pointer"),
            ("<mesh file=\"text.stl\"/>", "binary STL"),
            ("<texture fileup=\"gone.png\"/>", "gone.png: there is no such file"),
            ("<texture file=\"picture.jpg\"/>", "MuJoCo reads PNG, KTX"),
            ("<texture file=\"text.png\"/>", "text.png: is no PNG"),
            ("<texture fileup=\"text.png\"/>", "text.png: is no PNG"),
            ("<texture file=\"picture.jpg\" content_type=\"image/png\"/>", "picture.jpg: is no PNG"),
            ("<texture file=\"text.png\" content_type=\"image/ktx\"/>", ""),
            ("<hfield file=\"text.png\"/>", "text.png: is no PNG"),
            ("<texture file=\"empty.ktx\"/>", "is empty"),
            ("<mesh file=\"beyond.obj\"/>", "a face in line 6 names vertex 9, there are 4"),
            ("<mesh file=\"beyond.obj\" inertia=\"shell\"/>", "names vertex 9"),
        ] {
            let model = dir.path().join("m.xml");
            let root = xml::parse(&model, &format!("<mujoco><asset>{body}</asset></mujoco>")).unwrap();
            let found = missing(&model, &root, &Folders::default());
            if word.is_empty() {
                assert!(found.is_empty(), "{body}: {found:?}");
            } else {
                assert!(found.len() == 1 && found[0].contains(word), "{body}: {found:?}");
            }
        }
    }
}
