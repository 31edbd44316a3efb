//! What holds for a whole MJCF: its compiler's settings, default classes, meshes.

use std::cell::OnceCell;
use std::collections::BTreeMap;
use std::path::Path;

use nalgebra::{Matrix3, Quaternion, Rotation3, UnitQuaternion};

use super::mjcf_assets::{Folders, MeshAsset, VertexSource};
use super::weights::Mended;
use super::xml::{self, Element};
use crate::error::Result;
use crate::math::{Point, Pose, Vector, rotation, unit};

const MAX_CLASSES: usize = 10_000;

/// Of all classes together: each holds what it inherits, so that a few would fill the memory.
const MAX_CLASS_BYTES: usize = 64 << 20;

/// Attributes that a class gives to elements: tag, then attribute, then value.
pub(super) type Class = BTreeMap<String, BTreeMap<String, String>>;

/// What a class takes in memory, about: its texts, and as much again as two of them take for themselves.
fn bytes(class: &Class) -> usize {
    let attributes = class.values().flatten();
    attributes.map(|(key, value)| key.len() + value.len() + 2 * size_of::<String>()).sum()
}

/// What holds for the whole file.
pub(super) struct Context {
    pub(super) radian: bool,
    pub(super) autolimits: bool,
    /// Axes of Euler angles in their order; none where one of the letters is no axis, which only matters to who uses them.
    pub(super) euler: Option<[char; 3]>,
    /// A `<flag>` switches all limits off.
    pub(super) limitless: bool,
    pub(super) folders: Folders,
    /// `Some` where `inertiafromgeom` is not "auto".
    pub(super) from_shapes: Option<bool>,
    /// Groups of geoms that weigh something, from and to.
    pub(super) weighing: [f64; 2],
    /// What is mended of masses and inertias.
    pub(super) mended: Mended,
    /// What all bodies are scaled to weigh together, kg.
    pub(super) total: Option<f64>,
    pub(super) classes: BTreeMap<String, Class>,
    /// Bytes of all classes, about.
    class_bytes: usize,
    /// By name.
    pub(super) meshes: BTreeMap<String, MeshAsset>,
}

impl Context {
    pub(super) fn read(model: &Path, root: &Element) -> Result<Self> {
        let mut context = Self {
            radian: false,
            autolimits: true,
            euler: Some(['x', 'y', 'z']),
            limitless: switched_off(root, &["limit", "constraint"]),
            folders: Folders::default(),
            from_shapes: None,
            weighing: [0.0, 5.0],
            mended: Mended::default(),
            total: None,
            classes: BTreeMap::from([(MAIN.to_owned(), Class::new())]),
            class_bytes: 0,
            meshes: BTreeMap::new(),
        };
        for compiler in root.all("compiler") {
            context.compiler(compiler)?;
        }
        context.defaults(root)?;
        for asset in root.all("asset").flat_map(|a| a.all("mesh")) {
            context.mesh(model, asset)?;
        }
        Ok(context)
    }

    /// Takes what a `<compiler>` says; the last one counts.
    fn compiler(&mut self, compiler: &Element) -> Result<()> {
        if let Some(angle) = compiler.get("angle") {
            self.radian = angle == "radian";
        }
        if let Some(value) = compiler.get("autolimits") {
            self.autolimits = value == "true";
        }
        if let Some(sequence) = compiler.get("eulerseq") {
            let axes: Vec<char> = sequence.chars().take(4).collect();
            let axes =
                <[char; 3]>::try_from(axes).map_err(|_| compiler.error("eulerseq must be three of x y z X Y Z"))?;
            self.euler = Some(axes).filter(|s| s.iter().all(|c| "xyzXYZ".contains(*c)));
        }
        self.folders.take(compiler);
        self.weighing = compiler.numbers::<2>("inertiagrouprange")?.unwrap_or(self.weighing);
        self.total = compiler.number("settotalmass")?.filter(|m| *m > 0.0).or(self.total);
        for bound in ["boundmass", "boundinertia"] {
            self.mended.bounded |= compiler.number(bound)?.is_some_and(|b| b > 0.0);
        }
        if let Some(value) = compiler.get("balanceinertia") {
            self.mended.balanced = value == "true";
        }
        match compiler.get("inertiafromgeom") {
            Some("true") => self.from_shapes = Some(true),
            Some("false") => self.from_shapes = Some(false),
            _ => {}
        }
        if compiler.get("coordinate") == Some("global") {
            return Err(compiler.error("global coordinates are not part of MJCF any more; save it with local ones"));
        }
        Ok(())
    }

    /// Reads all default classes. The outermost one is the main class, whatever its name is.
    fn defaults(&mut self, root: &Element) -> Result<()> {
        let mut first = true;
        for element in root.all("default") {
            match element.get("class").filter(|c| *c != MAIN) {
                Some(name) if !first => self.class(element, name, MAIN)?,
                alias => {
                    self.class(element, MAIN, MAIN)?;
                    if let (Some(alias), Some(main)) = (alias, self.classes.get(MAIN).cloned()) {
                        self.classes.insert(alias.to_owned(), main);
                    }
                }
            }
            first = false;
        }
        Ok(())
    }

    fn mesh(&mut self, model: &Path, asset: &Element) -> Result<()> {
        let r = self.resolved(asset, None)?;
        let file = asset.get("file").filter(|f| !f.is_empty());
        let vector = |attribute: &str, default: Vector| -> Result<Vector> {
            Ok(r.numbers(attribute, 3..=3)?.map_or(default, |v| Vector::from_row_slice(&v)))
        };
        let (scale, origin) = (vector("scale", Vector::repeat(1.0))?, vector("refpos", Vector::zeros())?);
        let turn = asset.numbers::<4>("refquat")?.and_then(|[w, x, y, z]| turn_of(w, x, y, z));
        let turn = turn.unwrap_or_else(UnitQuaternion::identity);
        let source = match (file, corners(asset)?) {
            (Some(file), _) => VertexSource::File(self.folders.mesh(model, file)),
            (None, Some(corners)) => VertexSource::Written(corners),
            (None, None) => VertexSource::Made(asset.get("builtin") == Some("plate")),
        };
        let stem = file.and_then(|f| f.rsplit(['/', '\\']).next()).map(Path::new).and_then(Path::file_stem);
        let Some(name) = asset.get("name").map(str::to_owned).or(stem.map(|s| s.to_string_lossy().into_owned())) else {
            return Ok(());
        };
        let shell = r.get("inertia") == Some("shell");
        self.meshes.insert(name, MeshAsset { source, scale, origin, turn, shell, thin: OnceCell::new() });
        Ok(())
    }

    /// Adds a class on top of its parent; its own settings come before the classes in it, wherever they stand.
    pub(super) fn class(&mut self, element: &Element, name: &str, parent: &str) -> Result<()> {
        if self.classes.len() > MAX_CLASSES {
            return Err(element.error(format!("more than {MAX_CLASSES} default classes")));
        }
        let mut class = self.classes.get(parent).cloned().unwrap_or_default();
        for setting in element.children.iter().filter(|c| c.name != "default") {
            class.entry(setting.name.clone()).or_default().extend(setting.attributes.iter().cloned());
        }
        self.class_bytes = self.class_bytes.saturating_add(bytes(&class));
        if self.class_bytes > MAX_CLASS_BYTES {
            return Err(element.error(format!("the default classes take more than {} MiB", MAX_CLASS_BYTES >> 20)));
        }
        self.classes.insert(name.to_owned(), class);
        for nested in element.all("default") {
            let Some(inner) = nested.get("class") else { return Err(nested.error("a nested default needs a class")) };
            self.class(nested, inner, name)?;
        }
        Ok(())
    }

    /// An element with the class that holds for it.
    pub(super) fn resolved<'a>(&'a self, element: &'a Element, childclass: Option<&str>) -> Result<Resolved<'a>> {
        let name = element.get("class").or(childclass).unwrap_or(MAIN);
        let class = self
            .classes
            .get(name)
            .ok_or_else(|| element.error(format!("there is no default class \"{}\"", xml::brief(name))))?;
        Ok(Resolved { element, class: class.get(&element.name) })
    }

    /// An angle as the file writes it, rad.
    pub(super) fn angle(&self, value: f64) -> f64 {
        if self.radian { value } else { value.to_radians() }
    }

    /// Position and orientation of an element in its parent's frame.
    pub(super) fn pose(&self, r: &Resolved) -> Result<Pose> {
        let position = r.numbers("pos", 3..=3)?.map_or(Vector::zeros(), |p| Vector::from_row_slice(&p));
        Ok(Pose::from_parts(position.into(), self.orientation(r)?))
    }

    pub(super) fn orientation(&self, r: &Resolved) -> Result<UnitQuaternion<f64>> {
        const WAYS: [&str; 5] = ["quat", "axisangle", "euler", "xyaxes", "zaxis"];
        // What the element itself says goes before what its class says in another way.
        let own = WAYS.into_iter().find(|w| r.element.get(w).is_some());
        let Some(way) = own.or_else(|| WAYS.into_iter().find(|w| r.get(w).is_some())) else {
            return Ok(UnitQuaternion::identity());
        };
        let count = [4, 4, 3, 6, 3][WAYS.iter().position(|w| *w == way).unwrap_or(0)];
        let v = r.numbers(way, count..=count)?.unwrap_or_default();
        let vector = |from: usize| Vector::new(v[from], v[from + 1], v[from + 2]);
        let none = || r.element.error(format!("{way} gives no direction: its vectors must not be 0 or parallel"));
        match way {
            "quat" => turn_of(v[0], v[1], v[2], v[3]).ok_or_else(none),
            "axisangle" => Ok(rotation(&unit(&vector(0)).ok_or_else(none)?, self.angle(v[3]))),
            "xyaxes" => {
                let x = unit(&vector(0)).ok_or_else(none)?;
                let y = unit(&crate::math::reject(&vector(3), &x)).ok_or_else(none)?;
                let axes = Matrix3::from_columns(&[x, y, x.cross(&y)]);
                Ok(UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(axes)))
            }
            "zaxis" => Ok(from_z(&unit(&vector(0)).ok_or_else(none)?)),
            _ if self.euler.is_none() => {
                let message =
                    "euler: the compiler's eulerseq has a letter that is none of x y z X Y Z; write the order of axes";
                Err(r.element.error(message))
            }
            _ => Ok(self.turn(&v)),
        }
    }

    /// The turn of Euler angles, which are as the file writes them; none where their axes are not known, as MuJoCo has it in
    /// a `<replicate>`.
    pub(super) fn turn(&self, angles: &[f64]) -> UnitQuaternion<f64> {
        let mut turn = UnitQuaternion::identity();
        for (axis, value) in self.euler.iter().flatten().zip(angles) {
            let about = match axis.to_ascii_lowercase() {
                'x' => Vector::x(),
                'y' => Vector::y(),
                _ => Vector::z(),
            };
            let step = rotation(&about, self.angle(*value));
            // Small letters turn about axes that have turned along, capitals about the parent's.
            turn = if axis.is_ascii_lowercase() { turn * step } else { step * turn };
        }
        turn
    }
}

/// None where the four numbers are 0.
fn turn_of(w: f64, x: f64, y: f64, z: f64) -> Option<UnitQuaternion<f64>> {
    UnitQuaternion::try_new(Quaternion::new(w, x, y, z), 1e-9)
}

/// Lowest and highest corner of the vertices that are written with a mesh.
fn corners(asset: &Element) -> Result<Option<[Point; 2]>> {
    let Some(text) = asset.get("vertex").filter(|t| !t.trim().is_empty()) else { return Ok(None) };
    let values = asset.parse("vertex", text, 3..=usize::MAX)?;
    let mut ends = [Vector::repeat(f64::INFINITY), Vector::repeat(f64::NEG_INFINITY)];
    for p in values.chunks_exact(3).map(Vector::from_row_slice) {
        ends = [ends[0].inf(&p), ends[1].sup(&p)];
    }
    Ok(Some(ends.map(Point::from)))
}

pub(super) const MAIN: &str = "main";

/// Whether the last `<flag>` that says something of one of these disables it.
pub(super) fn switched_off(root: &Element, names: &[&str]) -> bool {
    let flags = || root.all("option").flat_map(|o| o.all("flag"));
    names.iter().any(|name| flags().filter_map(|f| f.get(name)).last() == Some("disable"))
}

/// The shortest turn that brings z to a unit direction.
pub(super) fn from_z(direction: &Vector) -> UnitQuaternion<f64> {
    UnitQuaternion::rotation_between(&Vector::z(), direction)
        .unwrap_or_else(|| rotation(&Vector::x(), std::f64::consts::PI))
}

/// An element over its class.
pub(super) struct Resolved<'a> {
    pub(super) element: &'a Element,
    pub(super) class: Option<&'a BTreeMap<String, String>>,
}

impl<'a> Resolved<'a> {
    pub(super) fn get(&self, attribute: &str) -> Option<&'a str> {
        self.element.get(attribute).or_else(|| self.class.and_then(|c| c.get(attribute)).map(String::as_str))
    }

    pub(super) fn numbers(&self, attribute: &str, count: std::ops::RangeInclusive<usize>) -> Result<Option<Vec<f64>>> {
        self.get(attribute).map(|text| self.element.parse(attribute, text, count)).transpose()
    }

    pub(super) fn number(&self, attribute: &str) -> Result<Option<f64>> {
        Ok(self.numbers(attribute, 1..=1)?.and_then(|v| v.first().copied()))
    }
}
