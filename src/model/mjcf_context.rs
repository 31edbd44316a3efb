//! What holds for a whole MJCF: the files that it includes, its compiler's settings, default classes, meshes.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use nalgebra::{Matrix3, Quaternion, Rotation3, UnitQuaternion};

use super::xml::{self, Element};
use crate::error::{Error, Result};
use crate::math::{Pose, Vector, rotation, unit};

const MAX_INCLUDES: usize = 8;
const MAX_CLASSES: usize = 10_000;

/// Files that other files include.
pub(super) struct Includes {
    pub(super) dir: PathBuf,
    /// Each file once, as MuJoCo has it: loops end here.
    pub(super) read: BTreeSet<PathBuf>,
}

impl Includes {
    /// Puts the contents of included files in the place of their `<include>`.
    pub(super) fn expand(&mut self, element: &mut Element, depth: usize, notes: &mut Vec<String>) -> Result<()> {
        if !element.children.iter().any(|c| c.name == "include") {
            return element.children.iter_mut().try_for_each(|c| self.expand(c, depth, notes));
        }
        for mut child in std::mem::take(&mut element.children) {
            if child.name != "include" {
                self.expand(&mut child, depth, notes)?;
                element.children.push(child);
                continue;
            }
            let file = child.get("file").ok_or_else(|| child.error("has no file"))?;
            if depth >= MAX_INCLUDES {
                return Err(child.error(format!("files include each other deeper than {MAX_INCLUDES}")));
            }
            let beside = child.file.parent().unwrap_or(Path::new("")).join(file);
            let found = [self.dir.join(file), beside].into_iter().find(|p| p.is_file());
            let Some(found) = found else {
                return Err(child.error(format!("includes {}, which is not there", xml::brief(file))));
            };
            let real = found.canonicalize().map_err(|e| Error::io(&found, &e))?;
            let home: &Path = if self.dir.as_os_str().is_empty() { Path::new(".") } else { &self.dir };
            if !home.canonicalize().is_ok_and(|home| real.starts_with(home)) {
                notes.push(format!("{} lies outside the model's folder and is not read", xml::brief(file)));
                continue;
            }
            if !self.read.insert(real) {
                return Err(child.error(format!("includes {} a second time", xml::brief(file))));
            }
            let mut root = xml::parse(&found, &xml::read_text(&found)?)?;
            self.expand(&mut root, depth + 1, notes)?;
            element.children.append(&mut root.children);
        }
        Ok(())
    }
}

/// Attributes that a class gives to elements: tag, then attribute, then value.
pub(super) type Class = BTreeMap<String, BTreeMap<String, String>>;

/// What holds for the whole file.
pub(super) struct Context {
    pub(super) radian: bool,
    pub(super) autolimits: bool,
    pub(super) euler: [char; 3],
    pub(super) folders: Vec<PathBuf>,
    /// `Some` where `inertiafromgeom` is not "auto".
    pub(super) from_shapes: Option<bool>,
    pub(super) classes: BTreeMap<String, Class>,
    /// Name, then file and scale.
    pub(super) meshes: BTreeMap<String, (String, Vector)>,
}

impl Context {
    pub(super) fn read(root: &Element) -> Result<Self> {
        let mut context = Self {
            radian: false,
            autolimits: true,
            euler: ['x', 'y', 'z'],
            folders: Vec::new(),
            from_shapes: None,
            classes: BTreeMap::from([(MAIN.to_owned(), Class::new())]),
            meshes: BTreeMap::new(),
        };
        for compiler in root.all("compiler") {
            if let Some(angle) = compiler.get("angle") {
                context.radian = angle == "radian";
            }
            if let Some(value) = compiler.get("autolimits") {
                context.autolimits = value == "true";
            }
            if let Some(sequence) = compiler.get("eulerseq") {
                let axes: Vec<char> = sequence.chars().take(4).collect();
                context.euler = <[char; 3]>::try_from(axes)
                    .ok()
                    .filter(|s| s.iter().all(|c| "xyzXYZ".contains(*c)))
                    .ok_or_else(|| compiler.error("eulerseq must be three of x y z X Y Z"))?;
            }
            // A folder of meshes goes before one of all assets.
            let own = ["meshdir", "assetdir"].into_iter().filter_map(|a| compiler.get(a)).map(PathBuf::from);
            context.folders = own.chain(std::mem::take(&mut context.folders)).collect();
            match compiler.get("inertiafromgeom") {
                Some("true") => context.from_shapes = Some(true),
                Some("false") => context.from_shapes = Some(false),
                _ => {}
            }
            if compiler.get("coordinate") == Some("global") {
                return Err(compiler.error("global coordinates are not part of MJCF any more; save it with local ones"));
            }
        }
        let mut first = true;
        for element in root.all("default") {
            match element.get("class").filter(|c| *c != MAIN) {
                Some(name) if !first => context.class(element, name, MAIN)?,
                alias => {
                    context.class(element, MAIN, MAIN)?;
                    if let (Some(alias), Some(main)) = (alias, context.classes.get(MAIN).cloned()) {
                        context.classes.insert(alias.to_owned(), main);
                    }
                }
            }
            first = false;
        }
        for asset in root.all("asset").flat_map(|a| a.all("mesh")) {
            let r = context.resolved(asset, None)?;
            let file = r.get("file").unwrap_or_default().to_owned();
            let scale = r.numbers("scale", 3..=3)?.map_or(Vector::repeat(1.0), |s| Vector::from_row_slice(&s));
            let stem = Path::new(&file).file_stem().map(|s| s.to_string_lossy().into_owned());
            let Some(name) = asset.get("name").map(str::to_owned).or(stem) else { continue };
            context.meshes.insert(name, (file, scale));
        }
        Ok(context)
    }

    /// Adds a class on top of its parent; its own settings come before the classes in it, wherever they stand.
    pub(super) fn class(&mut self, element: &Element, name: &str, parent: &str) -> Result<()> {
        if self.classes.len() > MAX_CLASSES {
            return Err(element.error(format!("more than {MAX_CLASSES} default classes")));
        }
        let mut class = self.classes.get(parent).cloned().unwrap_or_default();
        for setting in element.children.iter().filter(|c| ["joint", "geom", "site", "mesh"].contains(&c.name.as_str()))
        {
            class.entry(setting.name.clone()).or_default().extend(setting.attributes.iter().cloned());
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
            "quat" => UnitQuaternion::try_new(Quaternion::new(v[0], v[1], v[2], v[3]), 1e-9).ok_or_else(none),
            "axisangle" => Ok(rotation(&unit(&vector(0)).ok_or_else(none)?, self.angle(v[3]))),
            "xyaxes" => {
                let x = unit(&vector(0)).ok_or_else(none)?;
                let y = unit(&crate::math::reject(&vector(3), &x)).ok_or_else(none)?;
                let axes = Matrix3::from_columns(&[x, y, x.cross(&y)]);
                Ok(UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(axes)))
            }
            "zaxis" => Ok(from_z(&unit(&vector(0)).ok_or_else(none)?)),
            _ => {
                let mut turn = UnitQuaternion::identity();
                for (axis, value) in self.euler.iter().zip(&v) {
                    let about = match axis.to_ascii_lowercase() {
                        'x' => Vector::x(),
                        'y' => Vector::y(),
                        _ => Vector::z(),
                    };
                    let step = rotation(&about, self.angle(*value));
                    // Small letters turn about axes that have turned along, capitals about the parent's.
                    turn = if axis.is_ascii_lowercase() { turn * step } else { step * turn };
                }
                Ok(turn)
            }
        }
    }
}

pub(super) const MAIN: &str = "main";

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
