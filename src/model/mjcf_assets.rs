//! The files that an MJCF needs beside itself: meshes, pictures, height fields. They are looked for where MuJoCo does.

use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

use nalgebra::UnitQuaternion;

use super::mesh;
use super::mjcf_schema::place;
use super::xml::{Element, brief};
use crate::math::{Point, Vector};

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
pub(super) enum Source {
    /// A file.
    File(PathBuf),
    /// They are written in the model: lowest and highest corner.
    Written([Point; 2]),
    /// The simulator makes it.
    Made,
}

/// A mesh of `<asset>`.
#[derive(Debug, Clone)]
pub(super) struct Mesh {
    pub(super) source: Source,
    pub(super) scale: Vector,
    /// `refpos`: what of the file becomes the origin, file units.
    pub(super) origin: Vector,
    /// `refquat`: what of the file becomes the axes.
    pub(super) turn: UnitQuaternion<f64>,
}

impl Mesh {
    /// Lowest and highest corner as the simulator has it, metres; `Err` says why there are none.
    pub(super) fn bounds(&self) -> Result<[Point; 2], String> {
        let [low, high] = match &self.source {
            Source::File(path) if !path.is_file() => return Err("there is no such file".to_owned()),
            Source::File(path) => mesh::bounds(path)?,
            Source::Written(corners) => *corners,
            Source::Made => return Err("the simulator makes it itself".to_owned()),
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
const PICTURES: [&str; 7] = ["file", "fileright", "fileleft", "fileup", "filedown", "filefront", "fileback"];

/// Files of `<asset>` that are not there, or that MuJoCo does not read.
pub(super) fn missing(model: &Path, root: &Element, folders: &Folders) -> Vec<String> {
    let mut faults = Vec::new();
    for asset in root.children.iter().filter(|c| ["asset", "deformable"].contains(&c.name.as_str())) {
        for element in &asset.children {
            let mut needs = |attribute: &str, folder: &Path, endings: &[&str]| {
                let Some(file) = element.get(attribute).filter(|f| !f.is_empty()) else { return };
                // What says its own type need not say it by its ending.
                let endings: &[&str] = if element.get("content_type").is_some() { &[] } else { endings };
                if let Some(why) = refused(&folders.path(model, folder, file), endings) {
                    faults.push(format!("{}: {}: {why}", place(model, element), brief(file)));
                }
            };
            match element.name.as_str() {
                "mesh" => needs("file", &folders.mesh, &["obj", "stl", "msh"]),
                "texture" if element.get("builtin").is_none_or(|b| b == "none") => {
                    PICTURES.iter().for_each(|attribute| needs(attribute, &folders.texture, &["png", "ktx"]));
                }
                "hfield" | "skin" => needs("file", &folders.mesh, &[]),
                _ => {}
            }
            let from_nothing = |what: &str| element.get(what).is_none() && element.child("plugin").is_none();
            if element.name == "mesh" && ["file", "vertex", "builtin"].into_iter().all(from_nothing) {
                faults.push(format!("{}: has neither file nor vertices; MuJoCo refuses it", place(model, element)));
            }
        }
    }
    faults
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

    #[test]
    fn a_file_that_mujoco_refuses_is_told_from_one_that_it_reads() {
        let dir = tempfile::tempdir().unwrap();
        let write = |name: &str, bytes: &[u8]| std::fs::write(dir.path().join(name), bytes).unwrap();
        let mut stl = vec![0u8; 80];
        stl.extend(1u32.to_le_bytes());
        stl.extend([0u8; 50]);
        write("good.stl", &stl);
        write("text.stl", b"solid x\nfacet\nendsolid\n");
        write("pointer.obj", b"version https://git-lfs.github.com/spec/v1\noid sha256:0\n");
        write("picture.jpg", b"x");
        write("good.obj", b"v 0 0 0\n");
        for (body, word) in [
            ("<mesh file=\"good.stl\"/>", ""),
            ("<mesh file=\"good.obj\"/>", ""),
            ("<mesh name=\"w\" vertex=\"0 0 0\"/>", ""),
            ("<texture builtin=\"flat\" file=\"gone.png\"/>", ""),
            ("<mesh name=\"n\"/>", "neither file nor vertices"),
            ("<mesh file=\"gone.obj\"/>", "gone.obj: there is no such file"),
            ("<mesh file=\"pointer.obj\"/>", "Git LFS pointer"),
            ("<mesh file=\"text.stl\"/>", "binary STL"),
            ("<texture fileup=\"gone.png\"/>", "gone.png: there is no such file"),
            ("<texture file=\"picture.jpg\"/>", "MuJoCo reads PNG, KTX"),
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
