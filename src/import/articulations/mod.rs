//! Joints of other data sets and programs: a truth to measure against, or joints to build and to replay.
//!
//! A reader turns one JSON file into a [`Scene`]: metres and radians in the file's own frame, unit axes. What is wrong with
//! one joint costs that joint, with place and reason ([`Scene::left_out`]); an error is what makes the file unusable.
//! Formats are told from what files hold.

mod arti4d;
mod artipoint;
mod mobility;
mod multiscan;
mod ours;
mod s2o;
mod scenefun3d;
pub mod shape;
mod stk;
mod yaml;

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use serde::de::DeserializeOwned;
use serde_json::Value;

use super::{blob, ply};
use crate::articulation::{Articulation, JointKind};
use crate::error::{Error, Result};
use crate::json;
use crate::math::{Point, Vector, unit};
use shape::PartBox;

/// A joint as another program tells it.
#[derive(Debug, Clone, PartialEq)]
pub struct Joint {
    /// Its name, unique in the scene: letters, digits and `_`.
    pub id: String,
    /// Its name in the file.
    pub label: String,
    /// Motion type.
    pub kind: JointKind,
    /// Unit axis; whether positive opens is as good as the file.
    pub axis: Vector,
    /// The file's origin: a point on the hinge, any point of a slide.
    pub origin: Point,
    /// Lower and upper limit along the axis, rad or m, 0 is closed; `None` where the file has none.
    pub range: Option<[f64; 2]>,
    /// Box around the moving part, closed.
    pub part: Option<PartBox>,
    /// Box around the furniture.
    pub base: Option<PartBox>,
    /// Where a hand holds it, closed.
    pub handle: Option<Point>,
    /// The part as points of the scene's reconstruction, by number, rising; `None` where the file has no such thing.
    pub points: Option<Vec<usize>>,
    /// How sure its program is, from 0 to 1.
    pub score: Option<f64>,
}

impl Joint {
    /// Type, axis and origin.
    #[must_use]
    pub fn articulation(&self) -> Articulation {
        Articulation { kind: self.kind, axis: self.axis, origin: self.origin }
    }

    /// The part's middle, else its handle, else the origin.
    #[must_use]
    pub fn place(&self) -> Point {
        self.part.map(|b| b.center).or(self.handle).unwrap_or(self.origin)
    }
}

/// A joint that cannot be used.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LeftOut {
    /// Where it stands in its file.
    pub place: String,
    /// Why.
    pub reason: String,
}

/// The joints of a file, or of a folder.
#[derive(Debug, Clone, PartialEq)]
pub struct Scene {
    /// The file's or folder's name.
    pub name: String,
    /// The format's name.
    pub format: &'static str,
    /// Up in the file's frame.
    pub up: Vector,
    /// The joints.
    pub joints: Vec<Joint>,
    /// What could not be used.
    pub left_out: Vec<LeftOut>,
    /// What was taken for granted.
    pub notes: Vec<String>,
}

/// What a user says beside the file.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Options {
    /// The reconstruction whose points the file counts (PLY), where it is not beside it.
    pub points: Option<PathBuf>,
    /// Arti4D's `metadata.yaml`, where it is in none of the folders above.
    pub types: Option<PathBuf>,
}

/// A file to be read.
#[derive(Debug)]
pub struct Source<'a> {
    /// Its path.
    pub path: &'a Path,
    /// What it holds.
    pub value: &'a Value,
    /// What the user says.
    pub options: &'a Options,
}

/// A format.
#[derive(Clone, Copy)]
pub struct Format {
    /// Its name on the command line.
    pub name: &'static str,
    /// What it is, for people.
    pub title: &'static str,
    /// Whether a file holds it.
    pub detect: fn(&Value) -> bool,
    /// Reads a file.
    pub read: fn(&Source<'_>) -> Result<Scene>,
}

/// All formats. Where several fit, the first one is taken.
pub const ALL: &[Format] = &[
    Format {
        name: "paws",
        title: "joints.json, articulations.json, twin.json",
        detect: ours::detect,
        read: ours::read,
    },
    Format {
        name: "artipoint",
        title: "ArtiPoint, axis_info.json or the folder of its segments",
        detect: artipoint::detect,
        read: artipoint::read,
    },
    Format {
        name: "multiscan",
        title: "MultiScan, SCAN.annotations.json (parts from SCAN.ply)",
        detect: multiscan::detect,
        read: multiscan::read,
    },
    Format {
        name: "scenefun3d",
        title: "SceneFun3D, VISIT_motions.json (with VISIT_laser_scan.ply)",
        detect: scenefun3d::detect,
        read: scenefun3d::read,
    },
    Format {
        name: "articulate3d",
        title: "Articulate3D, USDNet, S2O: SCENE_articulation.json, MODEL.art-stk.json",
        detect: stk::detect,
        read: stk::read,
    },
    Format {
        name: "mobility",
        title: "PartNet-Mobility, mobility_v2.json (parts from result.json and textured_objs)",
        detect: mobility::detect,
        read: mobility::read,
    },
    Format { name: "s2o", title: "S2O's and OPD's predicted motions", detect: s2o::detect, read: s2o::read },
    Format {
        name: "arti4d",
        title: "Arti4D, SEQUENCE.json (types from metadata.yaml)",
        detect: arti4d::detect,
        read: arti4d::read,
    },
];

/// The names of all formats, for people.
#[must_use]
pub fn names() -> String {
    ALL.iter().map(|f| f.name).collect::<Vec<_>>().join(", ")
}

/// The format of a name.
///
/// # Errors
/// Where there is none, with those that are.
pub fn named(name: &str) -> Result<&'static Format> {
    ALL.iter()
        .find(|f| f.name == name)
        .ok_or_else(|| Error::Config(format!("\"{name}\" is no format of joints; there are {}", names())))
}

/// The format that a file's content has.
#[must_use]
pub fn detect(value: &Value) -> Option<&'static Format> {
    ALL.iter().find(|f| (f.detect)(value))
}

/// Files of a folder that are looked at; more are no folder of joints.
const MAX_FILES: usize = 10_000;
/// Larger files of a folder are not looked at, bytes: those that list the points of parts are smaller.
const MAX_FILE_BYTES: u64 = 256 << 20;

/// The JSON files of a folder, and of the folders in it that ArtiPoint makes.
fn files(folder: &Path) -> Vec<PathBuf> {
    let mut out = blob::files(folder, &["json"]);
    let segments =
        std::fs::read_dir(folder).into_iter().flatten().filter_map(|e| Some(e.ok()?.path().join("axis_info.json")));
    let mut segments: Vec<PathBuf> = segments.filter(|p| p.is_file()).collect();
    // segment_10 stands behind segment_9.
    segments.sort_by_key(|p| (p.as_os_str().len(), p.clone()));
    out.extend(segments);
    out.truncate(MAX_FILES);
    out.retain(|p| std::fs::metadata(p).is_ok_and(|m| m.len() <= MAX_FILE_BYTES));
    out
}

/// Whether a path holds joints of one of the formats. What cannot be read is for its reader to tell.
#[must_use]
pub fn holds(path: &Path) -> bool {
    if path.is_dir() {
        return files(path).iter().any(|p| json::read::<Value>(p).is_ok_and(|v| detect(&v).is_some()));
    }
    path.is_file() && json::read::<Value>(path).is_ok_and(|v| detect(&v).is_some())
}

/// Reads the joints of a file; of a folder those of all its files of the first format that one of them has.
///
/// # Errors
/// Where nothing can be read, no format fits, or no joint can be used.
pub fn read(path: &Path, format: Option<&str>, options: &Options) -> Result<Scene> {
    let forced = format.map(named).transpose()?;
    let mut values = Vec::new();
    let mut broken = Vec::new();
    if path.is_dir() {
        for file in files(path) {
            match json::read::<Value>(&file) {
                Ok(value) => values.push((file, value)),
                Err(error) => broken.push(LeftOut { place: shown(&file), reason: error.to_string() }),
            }
        }
    } else {
        values.push((path.to_owned(), json::read(path)?));
    }
    let found = ALL.iter().find(|f| values.iter().any(|(_, v)| (f.detect)(v)));
    let Some(format) = forced.or(found) else {
        let message =
            format!("holds no joints of a format that is read ({}); docs/joints-format.md says more", names());
        return Err(Error::Io { path: path.to_owned(), message });
    };
    if path.is_dir() {
        values.retain(|(_, value)| (format.detect)(value));
    }
    let mut scene = Scene::empty(path, format.name);
    scene.left_out = broken;
    for (file, value) in &values {
        let one = (format.read)(&Source { path: file, value, options })?;
        scene.up = one.up;
        if path.is_file() {
            scene.name.clone_from(&one.name);
        }
        scene.joints.extend(one.joints);
        scene.left_out.extend(one.left_out);
        for note in one.notes {
            if !scene.notes.contains(&note) {
                scene.notes.push(note);
            }
        }
    }
    if scene.joints.is_empty() {
        let (place, reason) = match scene.left_out.first() {
            Some(left) => (left.place.clone(), left.reason.clone()),
            None => ("joints".to_owned(), "there are none".to_owned()),
        };
        return Err(Error::format(path, place, reason));
    }
    scene.name_joints();
    Ok(scene)
}

/// A file's name, for people.
fn shown(path: &Path) -> String {
    path.file_name().map_or_else(|| path.display().to_string(), |n| n.to_string_lossy().into_owned())
}

/// A file's name without its ending.
fn stem(path: &Path) -> String {
    path.file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default()
}

impl Scene {
    /// Without joints.
    fn empty(path: &Path, format: &'static str) -> Self {
        Self { name: stem(path), format, up: Vector::z(), joints: Vec::new(), left_out: Vec::new(), notes: Vec::new() }
    }

    /// Takes a joint, or why there is none.
    fn take(&mut self, place: String, joint: std::result::Result<Joint, String>) {
        match joint {
            Ok(joint) => self.joints.push(joint),
            Err(reason) => self.left_out.push(LeftOut { place, reason }),
        }
    }

    /// Gives each joint a name of its own that every format takes.
    fn name_joints(&mut self) {
        let mut taken = BTreeSet::new();
        for joint in &mut self.joints {
            let wanted = safe(if joint.id.is_empty() { &joint.label } else { &joint.id });
            let mut id = wanted.clone();
            let mut number = 2;
            while !taken.insert(id.clone()) {
                id = format!("{wanted}_{number}");
                number += 1;
            }
            joint.id = id;
        }
    }
}

/// A name of letters, digits and `_` that begins with no digit.
fn safe(name: &str) -> String {
    let clean: String =
        name.chars().take(64).map(|c| if c.is_ascii_alphanumeric() || c == '_' { c } else { '_' }).collect();
    match clean.chars().next() {
        Some(c) if !c.is_ascii_digit() => clean,
        _ => format!("joint_{clean}"),
    }
}

impl Source<'_> {
    /// Reads a value of the file into a type; the error is for [`Scene::left_out`].
    fn entry<T: DeserializeOwned>(value: &Value) -> std::result::Result<T, String> {
        json::of_value(value)
    }

    /// An error at a place of the file.
    fn fault(&self, place: &str, message: impl Into<String>) -> Error {
        Error::format(self.path, place, message)
    }

    /// The list below some keys.
    fn list(&self, keys: &[&str]) -> Result<&[Value]> {
        let mut value = self.value;
        for (i, key) in keys.iter().enumerate() {
            value = value.get(key).ok_or_else(|| {
                let place =
                    if i == 0 { "the whole file".to_owned() } else { keys.get(..i).unwrap_or_default().join(".") };
                self.fault(&place, format!("the key \"{key}\" is missing"))
            })?;
        }
        let place = if keys.is_empty() { "the whole file".to_owned() } else { keys.join(".") };
        value.as_array().map(Vec::as_slice).ok_or_else(|| self.fault(&place, "a list [...] is wanted"))
    }

    /// A file in the same folder.
    fn beside(&self, name: &str) -> Option<PathBuf> {
        let folder = self.path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
        blob::inside(folder, name).ok().flatten().filter(|p| p.is_file())
    }

    /// The reconstruction: the user's, else the first of some files beside this one.
    fn cloud(&self, names: &[String]) -> Result<Option<ply::Cloud>> {
        let file = self.options.points.clone().or_else(|| names.iter().find_map(|n| self.beside(n)));
        file.map(|f| ply::read(&f)).transpose()
    }
}

/// What every format says of a joint, as it stands in the file.
#[derive(Debug, Clone, Default)]
struct Said {
    /// Name.
    label: String,
    /// The word for the motion type.
    kind: String,
    axis: [f64; 3],
    origin: [f64; 3],
    /// Rad or m.
    range: Option<[f64; 2]>,
}

impl Said {
    /// The joint without its part.
    fn joint(self) -> std::result::Result<Joint, String> {
        let kind = kind_of(&self.kind)?;
        let axis = unit(&Vector::from(self.axis)).ok_or_else(|| "axis: is no direction".to_owned())?;
        let range = match self.range {
            Some([low, high]) if low > high => {
                return Err(format!("range: [{low}, {high}] is reversed: the lower limit comes first"));
            }
            Some([low, high]) if kind == JointKind::Revolute && high - low > std::f64::consts::TAU + 1e-6 => {
                return Err(format!("range: {:.1} rad are more than a whole turn: are these degrees?", high - low));
            }
            // Annotators leave both limits where nobody set them.
            Some([low, high]) if low == high => None,
            other => other,
        };
        Ok(Joint {
            id: String::new(),
            label: self.label,
            kind,
            axis,
            origin: Point::from(self.origin),
            range,
            part: None,
            base: None,
            handle: None,
            points: None,
            score: None,
        })
    }
}

/// The motion type of a word.
fn kind_of(word: &str) -> std::result::Result<JointKind, String> {
    const HINGES: [&str; 6] = ["revolute", "rotation", "rotational", "rot", "hinge", "continuous"];
    const SLIDES: [&str; 6] = ["prismatic", "translation", "translational", "trans", "slider", "slide"];
    let lower = word.trim().to_lowercase();
    if HINGES.contains(&lower.as_str()) {
        Ok(JointKind::Revolute)
    } else if SLIDES.contains(&lower.as_str()) {
        Ok(JointKind::Prismatic)
    } else {
        let word: String = word.chars().take(40).collect();
        Err(format!("type: \"{word}\" is neither a hinge (revolute, rotation) nor a slide (prismatic, translation)"))
    }
}

/// Points by their numbers; sorts the numbers.
fn picked(cloud: &ply::Cloud, numbers: &mut Vec<usize>) -> std::result::Result<Vec<Point>, String> {
    numbers.sort_unstable();
    numbers.dedup();
    let all = &cloud.points;
    match numbers.last() {
        None => Err("indices: there are none".to_owned()),
        Some(last) if *last >= all.len() => {
            Err(format!("indices: {last} is beyond the {} points of the reconstruction; is it another one?", all.len()))
        }
        Some(_) => Ok(numbers.iter().filter_map(|i| all.get(*i)).copied().collect()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_become_safe_and_stay_apart() {
        assert_eq!(
            ["3", "wall cabinet.1:door", "", "ok_1"].map(safe),
            ["joint_3", "wall_cabinet_1_door", "joint_", "ok_1"]
        );
        let joint = |label: &str| Said {
            label: label.to_owned(),
            kind: "rot".to_owned(),
            axis: [0.0, 0.0, 2.0],
            ..Said::default()
        };
        let mut scene = Scene::empty(Path::new("a/b.json"), "paws");
        for label in ["a b", "a.b", "c"] {
            scene.take(String::new(), joint(label).joint());
        }
        scene.name_joints();
        let ids: Vec<&str> = scene.joints.iter().map(|j| j.id.as_str()).collect();
        assert_eq!((ids, scene.name.as_str()), (vec!["a_b", "a_b_2", "c"], "b"));
        assert_eq!(scene.joints[0].axis, Vector::z());
    }

    #[test]
    fn what_no_joint_can_be_is_told() {
        let good =
            Said { kind: "rotation".to_owned(), axis: [0.0, 0.0, 1.0], range: Some([0.0, 1.5]), ..Said::default() };
        assert!(good.clone().joint().is_ok());
        for (said, words) in [
            (Said { kind: "screw".to_owned(), ..good.clone() }, "type: \"screw\" is neither"),
            (Said { axis: [0.0; 3], ..good.clone() }, "axis: is no direction"),
            (Said { range: Some([1.0, 0.0]), ..good.clone() }, "reversed"),
            (Said { range: Some([0.0, 90.0]), ..good.clone() }, "degrees"),
        ] {
            let reason = said.joint().unwrap_err();
            assert!(reason.contains(words), "{reason}");
        }
        assert_eq!(Said { range: Some([0.0, 0.0]), ..good }.joint().unwrap().range, None);
    }
}
