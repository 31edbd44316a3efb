//! What a URDF's links are made of, and which simulators refuse it: shapes, meshes, the files behind them.
//!
//! One bad shape costs only itself: it is a fault, and the rest of the file is judged.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use nalgebra::{Quaternion, UnitQuaternion};

use super::links::{Link, Shape};
use super::mesh_files::{self, MeshMeasures};
use super::shapes::Primitive;
use super::weights::Mended;
use super::xml::{self, Element};
use super::{kinds, png_files};
use crate::error::Result;
use crate::math::{Pose, Vector};

/// Nothing that is built is larger, metres; beyond, products of sizes leave what numbers hold.
const MAX_SIZE_M: f64 = 1e6;

/// How a URDF tells MuJoCo to read it (`<mujoco><compiler .../></mujoco>`).
#[derive(Debug, Clone, Default)]
pub(super) struct Compiler {
    /// Folder of meshes, from the model's.
    mesh_dir: String,
    /// Whether only the last part of a mesh's path counts.
    strips_paths: bool,
    /// Whether visual shapes are kept.
    pub keeps_visuals: bool,
    /// Whether links that a fixed joint carries stay bodies of their own.
    pub keeps_links: bool,
    /// What is mended of masses and inertias.
    pub mended: Mended,
}

impl Compiler {
    /// What a file's `<compiler>` elements say.
    pub fn of(root: &Element) -> Self {
        let mut out = Self::default();
        for compiler in root.all("mujoco").flat_map(|m| m.all("compiler")) {
            let is = |name: &str, value: &str| compiler.get(name) == Some(value);
            if let Some(dir) = compiler.get("meshdir").or(compiler.get("assetdir")) {
                out.mesh_dir = dir.to_owned();
            }
            out.strips_paths |= is("strippath", "true");
            out.keeps_visuals |= is("discardvisual", "false");
            out.keeps_links |= is("fusestatic", "false");
            out.mended.balanced |= is("balanceinertia", "true");
            let bounds = |name: &str| compiler.number(name).ok().flatten().is_some_and(|b| b > 0.0);
            out.mended.bounded |= bounds("boundmass") || bounds("boundinertia");
        }
        out
    }
}

/// `parent_from_element`, from its `<origin>`.
pub(super) fn pose(parent: &Element) -> Result<Pose> {
    let Some(origin) = parent.child("origin") else { return Ok(Pose::identity()) };
    let xyz = origin.numbers::<3>("xyz")?.unwrap_or_default();
    let turn = match (origin.numbers::<3>("rpy")?, origin.numbers::<4>("quat_xyzw")?) {
        (None, Some([x, y, z, w])) => {
            UnitQuaternion::try_new(Quaternion::new(w, x, y, z), 1e-6).ok_or_else(|| origin.error("quat_xyzw is 0"))?
        }
        (rpy, _) => {
            let [roll, pitch, yaw] = rpy.unwrap_or_default();
            UnitQuaternion::from_euler_angles(roll, pitch, yaw)
        }
    };
    Ok(Pose::from_parts(Vector::from(xyz).into(), turn))
}

/// Reads shapes, and keeps what is wrong with them.
pub(super) struct Geometry<'a> {
    path: &'a Path,
    compiler: Compiler,
    /// A file that many shapes show is read once.
    measured: BTreeMap<PathBuf, MeshMeasures>,
    /// Meshes that are there, and that MuJoCo does not find by how they are written.
    unfound: Vec<String>,
    /// What simulators refuse, and which.
    pub faults: Vec<String>,
    /// What was not read.
    pub notes: Vec<String>,
}

impl<'a> Geometry<'a> {
    /// For a model's file.
    pub fn new(path: &'a Path, compiler: Compiler) -> Self {
        Self { path, compiler, measured: BTreeMap::new(), unfound: Vec::new(), faults: Vec::new(), notes: Vec::new() }
    }

    /// Adds a `<visual>` or `<collision>` to its link.
    ///
    /// # Errors
    /// Where a number of it is none, or its place is not finite.
    pub fn add(&mut self, link: &mut Link, element: &Element, visual: bool) -> Result<()> {
        if let Some(file) = element.child("material").and_then(|m| m.child("texture")).and_then(|t| t.get("filename")) {
            self.texture(&link.name, file);
        }
        let pose = pose(element)?;
        let primitive = match element.child("geometry").and_then(|g| g.children.first()) {
            Some(solid) if solid.name == "mesh" => self.mesh(link, solid, visual)?,
            Some(solid) => self.primitive(&link.name, solid, visual)?,
            None => {
                self.fault(&link.name, element, "has no geometry: MuJoCo refuses the file");
                None
            }
        };
        let Some(primitive) = primitive else {
            link.incomplete = true;
            return Ok(());
        };
        link.shapes.push(Shape {
            name: element.get("name").map(str::to_owned),
            bounds: primitive.bounds(&pose),
            exact: primitive.is_box(),
            is_mesh: matches!(primitive, Primitive::Mesh(_)),
            visual,
            masks: [1, 1],
        });
        Ok(())
    }

    /// Whether MuJoCo looks at a shape: it leaves visual ones out unless it is told to keep them.
    fn mujoco_reads(&self, visual: bool) -> bool {
        !visual || self.compiler.keeps_visuals
    }

    /// What follows from a shape without volume.
    fn consequence(&self, visual: bool) -> &'static str {
        if self.mujoco_reads(visual) { "MuJoCo refuses the file" } else { "viewers show nothing of it" }
    }

    /// A fault of one element of a link.
    fn fault(&mut self, link: &str, element: &Element, what: &str) {
        self.faults.push(format!("{link}: {} in line {} {what}", element.label(), element.line));
    }

    fn primitive(&mut self, link: &str, solid: &Element, visual: bool) -> Result<Option<Primitive>> {
        let sizes: Option<Vec<f64>> = match solid.name.as_str() {
            "box" => solid.numbers::<3>("size")?.map(Vec::from),
            "cylinder" | "capsule" => match (solid.number("radius")?, solid.number("length")?) {
                (Some(radius), Some(length)) => Some(vec![radius, length]),
                _ => None,
            },
            "sphere" => solid.number("radius")?.map(|radius| vec![radius]),
            _ => {
                let what = "is no geometry of URDF (box, cylinder, sphere, capsule, mesh): MuJoCo refuses the file";
                self.fault(link, solid, what);
                return Ok(None);
            }
        };
        let Some(sizes) = sizes else {
            self.fault(link, solid, "has not all of its sizes: MuJoCo refuses the file");
            return Ok(None);
        };
        if sizes.iter().any(|s| s.abs() > MAX_SIZE_M) {
            self.fault(link, solid, "has a size of thousands of kilometres; sizes are metres");
            return Ok(None);
        }
        if sizes.iter().any(|s| *s <= 0.0) {
            let what = format!("has a size that is not positive: {}", self.consequence(visual));
            self.fault(link, solid, &what);
        }
        let size = |i: usize| sizes.get(i).copied().unwrap_or(0.0).abs();
        Ok(Some(match solid.name.as_str() {
            "box" => Primitive::Cuboid(Vector::new(size(0), size(1), size(2)) * 0.5),
            "cylinder" => Primitive::Cylinder(size(0), 0.5 * size(1)),
            "capsule" => Primitive::Capsule(size(0), 0.5 * size(1)),
            _ => Primitive::Sphere(size(0)),
        }))
    }

    /// The scale of a mesh; one number counts for all three, as most readers have it.
    fn scale(&mut self, link: &str, solid: &Element, visual: bool) -> Result<Vector> {
        let Some(text) = solid.get("scale") else { return Ok(Vector::repeat(1.0)) };
        let values = solid.parse("scale", text, 1..=3)?;
        let scale = match values.as_slice() {
            [x, y, z] => Vector::new(*x, *y, *z),
            [all] => {
                let what =
                    format!("has one number as scale: MuJoCo refuses the file; write scale=\"{all} {all} {all}\"");
                self.fault(link, solid, &what);
                Vector::repeat(*all)
            }
            _ => return Err(solid.error("scale: expected 3 numbers")),
        };
        if scale.iter().any(|s| *s == 0.0) {
            let what = format!("has a scale of 0, which leaves no volume: {}", self.consequence(visual));
            self.fault(link, solid, &what);
        }
        Ok(scale)
    }

    fn mesh(&mut self, link: &mut Link, solid: &Element, visual: bool) -> Result<Option<Primitive>> {
        let Some(file) = solid.get("filename").filter(|f| !f.trim().is_empty()) else {
            self.fault(&link.name, solid, "has no filename: MuJoCo and PyBullet refuse the file");
            return Ok(None);
        };
        link.meshes.push(file.to_owned());
        link.collides_as_mesh |= !visual;
        let scale = self.scale(&link.name, solid, visual)?;
        let Some(measured) = self.of_file(&link.name, file, visual) else { return Ok(None) };
        let [low, high] = match measured.bounds {
            Ok(bounds) => bounds,
            Err(why) => {
                self.notes.push(format!("{}: mesh {} is not read: {why}", link.name, xml::brief(file)));
                return Ok(None);
            }
        };
        let ends = [low.coords.component_mul(&scale), high.coords.component_mul(&scale)];
        if ends.iter().any(|e| e.amax() > MAX_SIZE_M) {
            self.fault(&link.name, solid, "reaches thousands of kilometres; sizes are metres, look at its scale");
            return Ok(None);
        }
        Ok(Some(Primitive::Mesh([ends[0].inf(&ends[1]).into(), ends[0].sup(&ends[1]).into()])))
    }

    /// A mesh's file, measured; `None`, and a fault, where there is none.
    fn of_file(&mut self, link: &str, file: &str, visual: bool) -> Option<MeshMeasures> {
        let shown = xml::brief(file);
        let mujoco = self.mujoco_reads(visual);
        let slashes = file.replace('\\', "/");
        let last = slashes.rsplit('/').next().unwrap_or(&slashes);
        let written = if self.compiler.strips_paths { last } else { slashes.as_str() };
        let folder = self.path.parent().unwrap_or(Path::new("")).join(&self.compiler.mesh_dir);
        let own = folder.join(written);
        let found = if own.is_file() {
            own
        } else if let Some(found) = mesh_files::find(self.path, &[PathBuf::from(&self.compiler.mesh_dir)], &slashes) {
            if mujoco {
                self.unfound.push(shown.clone());
            }
            found
        } else {
            let who = if mujoco { "MuJoCo and PyBullet refuse" } else { "PyBullet refuses" };
            let near = mesh_files::other_case(&own)
                .map_or_else(String::new, |n| format!("; there is {}, and capitals count", xml::brief(&n)));
            self.faults.push(format!("{link}: mesh {shown} is not there: {who} the file{near}"));
            return None;
        };
        if file.contains('\\') {
            self.faults.push(format!("{link}: mesh {shown} has a backslash: PyBullet and others find it only with /"));
        }
        let measured = self.measured.entry(found).or_insert_with_key(|found| mesh_files::measured(found)).clone();
        let flat = measured.flat.then(|| mesh_files::FLAT.to_owned());
        let broken = measured.faces.as_ref().or(measured.hollow.as_ref());
        match measured.refused.as_ref().or(broken).or(flat.as_ref()) {
            Some(why) if mujoco => self.faults.push(format!("{link}: mesh {shown} {why}: MuJoCo refuses the file")),
            _ => {}
        }
        Some(measured)
    }

    /// Looks for a picture.
    pub fn texture(&mut self, owner: &str, file: &str) {
        let what = match mesh_files::find(self.path, &[], &file.replace('\\', "/")) {
            None => "is not there",
            Some(found) if kinds::is_pointer(&kinds::head(&found)) => "is a Git LFS pointer (run `git lfs pull`)",
            Some(found) if found.extension().is_some_and(|e| e.eq_ignore_ascii_case("png")) => {
                let Some(why) = png_files::broken_png(&found) else { return };
                why
            }
            Some(_) => return,
        };
        let shown = xml::brief(file);
        self.faults.push(format!("{owner}: texture {shown} {what}: viewers complain and show the part without"));
    }

    /// Tells at the end what concerns many meshes at once.
    pub fn finish(&mut self) {
        let Some(first) = self.unfound.first() else { return };
        let count = self.unfound.len();
        let others = if count > 1 { format!(" and {} more", count - 1) } else { String::new() };
        self.faults.push(format!(
            "mesh {first}{others}: MuJoCo does not look for packages (nor for file://, nor outside meshdir) and refuses the file; \
             write paths from the model's folder, or add <mujoco><compiler strippath=\"true\" meshdir=\"...\"/></mujoco>"
        ));
    }
}
