//! What the readers of joints share: the joints of a file as plain data, and the way to them from what files state.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use serde::de::DeserializeOwned;
use serde_json::Value;

use super::shape::PartBox;
use crate::articulation::{Articulation, JointKind};
use crate::error::{Error, Result};
use crate::import::{blob, ply};
use crate::json;
use crate::math::{Point, Vector, length, plain, rounded, unit};

/// A joint as another program tells it.
#[derive(Debug, Clone, PartialEq)]
pub struct FoundJoint {
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

impl FoundJoint {
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
pub struct UnusableJoint {
    /// Where it stands in its file.
    pub place: String,
    /// Why.
    pub reason: String,
}

/// The joints of a file, or of a folder.
#[derive(Debug, Clone, PartialEq)]
pub struct JointScene {
    /// The file's or folder's name.
    pub name: String,
    /// The format's name.
    pub format: &'static str,
    /// Up in the file's frame.
    pub up: Vector,
    /// The joints.
    pub joints: Vec<FoundJoint>,
    /// What could not be used.
    pub left_out: Vec<UnusableJoint>,
    /// What was taken for granted.
    pub notes: Vec<String>,
}

/// What a user says beside the file.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct JointOptions {
    /// The reconstruction whose points the file counts (PLY), where it is not beside it.
    pub points: Option<PathBuf>,
    /// Arti4D's `metadata.yaml`, where it is in none of the folders above.
    pub types: Option<PathBuf>,
}

/// A file to be read.
#[derive(Debug)]
pub struct JointSource<'a> {
    /// Its path.
    pub path: &'a Path,
    /// What it holds.
    pub value: &'a Value,
    /// What the user says.
    pub options: &'a JointOptions,
}

/// A file's name without its ending.
pub(super) fn stem(path: &Path) -> String {
    path.file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default()
}

impl JointScene {
    /// Without joints.
    pub(super) fn empty(path: &Path, format: &'static str) -> Self {
        Self { name: stem(path), format, up: Vector::z(), joints: Vec::new(), left_out: Vec::new(), notes: Vec::new() }
    }

    /// Takes a joint, or why there is none.
    pub(super) fn take(&mut self, place: String, joint: std::result::Result<FoundJoint, String>) {
        match joint {
            Ok(joint) => self.joints.push(joint),
            Err(reason) => self.left_out.push(UnusableJoint { place, reason }),
        }
    }

    /// Gives each joint a name of its own that every format takes.
    pub(super) fn name_joints(&mut self) {
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

impl JointSource<'_> {
    /// Reads a value of the file into a type; the error is for [`JointScene::left_out`].
    pub(super) fn entry<T: DeserializeOwned>(value: &Value) -> std::result::Result<T, String> {
        json::of_value(value)
    }

    /// An error at a place of the file.
    pub(super) fn fault(&self, place: &str, message: impl Into<String>) -> Error {
        Error::format(self.path, place, message)
    }

    /// The list below some keys.
    pub(super) fn list(&self, keys: &[&str]) -> Result<&[Value]> {
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
    pub(super) fn beside(&self, name: &str) -> Option<PathBuf> {
        let folder = self.path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
        blob::inside(folder, name).ok().flatten().filter(|p| p.is_file())
    }

    /// The reconstruction: the user's, else the first of some files beside this one.
    pub(super) fn cloud(&self, names: &[String]) -> Result<Option<ply::Cloud>> {
        let file = self.options.points.clone().or_else(|| names.iter().find_map(|n| self.beside(n)));
        file.map(|f| ply::read(&f)).transpose()
    }
}

/// Coordinates of maps are as large, metres.
const FARTHEST_M: f64 = 1e8;

/// What every format says of a joint, as it stands in the file.
#[derive(Debug, Clone, Default)]
pub(super) struct StatedJoint {
    /// Name.
    pub(super) label: String,
    /// The word for the motion type.
    pub(super) kind: String,
    pub(super) axis: [f64; 3],
    pub(super) origin: [f64; 3],
    /// Rad or m.
    pub(super) range: Option<[f64; 2]>,
}

impl StatedJoint {
    /// The joint without its part.
    pub(super) fn joint(self) -> std::result::Result<FoundJoint, String> {
        let kind = kind_of(&self.kind)?;
        let axis = unit(&Vector::from(self.axis)).ok_or_else(|| "axis: is no direction".to_owned())?;
        let origin = Point::from(self.origin);
        let far = length(&origin.coords);
        if far.is_nan() || far > FARTHEST_M {
            let far = rounded(far, 0);
            return Err(format!("origin: lies {far} m from the frame's origin, farther than anything on Earth"));
        }
        let range = match self.range {
            Some([low, high]) if low > high => {
                let [low, high] = [low, high].map(plain);
                return Err(format!("range: [{low}, {high}] is reversed: the lower limit comes first"));
            }
            Some([low, high]) if kind == JointKind::Revolute && high - low > std::f64::consts::TAU + 1e-6 => {
                let turns = rounded(high - low, 1);
                return Err(format!("range: {turns} rad are more than a whole turn: are these degrees?"));
            }
            // Annotators leave both limits where nobody set them.
            Some([low, high]) if low == high => None,
            other => other,
        };
        Ok(FoundJoint {
            id: String::new(),
            label: self.label,
            kind,
            axis,
            origin,
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
pub(super) fn kind_of(word: &str) -> std::result::Result<JointKind, String> {
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
pub(super) fn picked(cloud: &ply::Cloud, numbers: &mut Vec<usize>) -> std::result::Result<Vec<Point>, String> {
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
        let joint = |label: &str| StatedJoint {
            label: label.to_owned(),
            kind: "rot".to_owned(),
            axis: [0.0, 0.0, 2.0],
            ..StatedJoint::default()
        };
        let mut scene = JointScene::empty(Path::new("a/b.json"), "paws");
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
        let good = StatedJoint {
            kind: "rotation".to_owned(),
            axis: [0.0, 0.0, 1.0],
            range: Some([0.0, 1.5]),
            ..StatedJoint::default()
        };
        assert!(good.clone().joint().is_ok());
        for (said, words) in [
            (StatedJoint { kind: "screw".to_owned(), ..good.clone() }, "type: \"screw\" is neither"),
            (StatedJoint { axis: [0.0; 3], ..good.clone() }, "axis: is no direction"),
            (StatedJoint { range: Some([1.0, 0.0]), ..good.clone() }, "reversed"),
            (StatedJoint { range: Some([0.0, 90.0]), ..good.clone() }, "degrees"),
        ] {
            let reason = said.joint().unwrap_err();
            assert!(reason.contains(words), "{reason}");
        }
        assert_eq!(StatedJoint { range: Some([0.0, 0.0]), ..good }.joint().unwrap().range, None);
    }
}
