//! The plain data of a model: links, joints, shapes, and the format that they were read from.

use std::path::{Path, PathBuf};

use nalgebra::Matrix3;

use crate::articulation::{Articulation, JointKind};
use crate::error::{Error, Result};
use crate::math::{Point, Pose, Vector, unit};
use crate::twin::OrientedBox;

/// The link that an MJCF model's bodies stand in, and by convention the root of a URDF that is fixed.
pub const WORLD: &str = "world";

/// The file that a model comes from, with what only its format has.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum ModelFormat {
    /// URDF.
    Urdf {
        /// Whether the file tells MuJoCo to keep fixed links and visuals.
        keeps_links: bool,
        /// Why `urdf-rs` does not read the file, where it does not.
        complaint: Option<String>,
        /// What else simulators refuse or complain about, with their names.
        faults: Vec<String>,
    },
    /// MJCF.
    Mjcf {
        /// Whether `<compiler angle="radian">` is written, or no angle is; the format's default are degrees.
        radian: bool,
        /// Whether a `<flag>` switches all limits off.
        limitless: bool,
    },
}

/// A model: a tree of links, as far as its file is sound ([`Model::tree`] tells).
#[derive(Debug, Clone, PartialEq)]
pub struct Model {
    /// Name in the file, or the file's own.
    pub name: String,
    /// The file.
    pub source: PathBuf,
    /// Its format.
    pub format: ModelFormat,
    /// Links in the file's order; an MJCF model begins with `world`.
    pub links: Vec<Link>,
    /// Joints in the file's order, fixed ones included.
    pub joints: Vec<ModelJoint>,
    /// Pairs of links that may touch without a contact (MJCF).
    pub excludes: Vec<[String; 2]>,
    /// What was not read, or read as something simpler.
    pub notes: Vec<String>,
    /// What may hide joints or shapes and was not read: verdicts about the whole are not to be had.
    pub unread: Vec<String>,
    /// Joints that something besides their limits keeps where they begin (MJCF): index of the joint, and what holds it.
    pub held: Vec<(usize, String)>,
    /// What the file's reader found wrong: the number of a point of [`super::check::POINTS`], and words.
    pub faults: Vec<(u8, String)>,
}

/// Where a link's mass comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MassSource {
    /// It is written with the link.
    Stated,
    /// From masses or densities that are written with its shapes.
    Shapes,
    /// At least one shape has neither: MuJoCo takes 1000 kg/m^3.
    Assumed,
    /// There is none.
    Nothing,
}

/// A rigid body.
#[derive(Debug, Clone, PartialEq)]
pub struct Link {
    /// Name.
    pub name: String,
    /// kg; `None` where nothing tells, or only a mesh would.
    pub mass: Option<f64>,
    /// Where the mass comes from.
    pub mass_source: MassSource,
    /// Centre of mass, link frame, metres.
    pub center: Point,
    /// About the centre, in the link's axes, kg m^2.
    pub inertia: Matrix3<f64>,
    /// Boxes, and boxes around whatever is no box.
    pub shapes: Vec<Shape>,
    /// Files of meshes that the link is made of.
    pub meshes: Vec<String>,
    /// Whether one of the meshes takes part in contacts.
    pub collides_as_mesh: bool,
    /// Whether one of the meshes could not be measured: the boxes are not the whole link then.
    pub incomplete: bool,
    /// Named points, link frame, metres (MJCF).
    pub sites: Vec<(String, Point)>,
    /// Stands between two joints of one MJCF body and has no mass of its own.
    pub between: bool,
}

impl Link {
    /// A link of which no more is known than its name.
    #[must_use]
    pub fn named(name: String) -> Self {
        Self {
            name,
            mass: None,
            mass_source: MassSource::Nothing,
            center: Point::origin(),
            inertia: Matrix3::zeros(),
            shapes: Vec::new(),
            meshes: Vec::new(),
            collides_as_mesh: false,
            incomplete: false,
            sites: Vec::new(),
            between: false,
        }
    }
}

/// A box of a link.
#[derive(Debug, Clone, PartialEq)]
pub struct Shape {
    /// Name; many files have none.
    pub name: Option<String>,
    /// Link frame.
    pub bounds: OrientedBox,
    /// Whether the shape is this box (true) or only lies in it.
    pub exact: bool,
    /// Whether the shape is a mesh, of which this box is around.
    pub is_mesh: bool,
    /// Only seen: it touches nothing.
    pub visual: bool,
    /// MuJoCo's `contype` and `conaffinity`; `[1, 1]` in URDF.
    pub masks: [u32; 2],
}

impl Shape {
    /// Whether two shapes can touch at all.
    #[must_use]
    pub fn meets(&self, other: &Self) -> bool {
        let [a, b] = [self.masks, other.masks];
        !self.visual && !other.visual && (a[0] & b[1] != 0 || b[0] & a[1] != 0)
    }
}

/// The types of joints that URDF and MJCF have. [`JointKind`] has the two that furniture has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum JointType {
    /// Nothing.
    Fixed,
    /// Rotation about its axis.
    Revolute,
    /// The same without limits.
    Continuous,
    /// Translation along its axis.
    Prismatic,
    /// Everything.
    Free,
    /// Something else: a ball, a plane.
    Other,
}

/// A joint. Values that its file does not have are `None`.
#[derive(Debug, Clone, PartialEq)]
pub struct ModelJoint {
    /// Name.
    pub name: String,
    /// What it allows.
    pub kind: JointType,
    /// Name of the link that carries it.
    pub parent: String,
    /// Name of the link that it moves.
    pub child: String,
    /// Pose of the child's frame at position 0.
    pub parent_from_child: Pose,
    /// Axis in the child's frame as written, of any length.
    pub axis: Vector,
    /// A point on the axis, child's frame, metres.
    pub anchor: Point,
    /// Lower limit, rad or m.
    pub lower: Option<f64>,
    /// Upper limit, rad or m.
    pub upper: Option<f64>,
    /// Largest force or torque, N or N m.
    pub effort: Option<f64>,
    /// Largest velocity, m/s or rad/s.
    pub velocity: Option<f64>,
    /// Viscous damping, N s/m or N m s/rad.
    pub damping: Option<f64>,
    /// Dry friction, N or N m.
    pub friction: Option<f64>,
    /// Inertia that the joint adds, kg or kg m^2 (MJCF).
    pub armature: Option<f64>,
    /// What `limited` says where it is written (MJCF).
    pub limited: Option<bool>,
    /// The position that simulators begin at and the file shows, rad or m: MJCF's `ref`, else 0.
    pub start: f64,
}

/// How far a joint without limits is taken to open: half a turn, rad, or a long drawer, m.
const UNLIMITED: [f64; 2] = [std::f64::consts::PI, 1.0];

impl ModelJoint {
    /// Its type where it has one degree of freedom.
    #[must_use]
    pub fn moves(&self) -> Option<JointKind> {
        match self.kind {
            JointType::Revolute | JointType::Continuous => Some(JointKind::Revolute),
            JointType::Prismatic => Some(JointKind::Prismatic),
            JointType::Fixed | JointType::Free | JointType::Other => None,
        }
    }

    /// Both limits, where there are both and they are in order.
    #[must_use]
    pub fn limits(&self) -> Option<[f64; 2]> {
        let (lower, upper) = (self.lower?, self.upper?);
        (lower < upper).then_some([lower, upper])
    }

    /// Closed and open position, rad or m: the limit nearest to 0 and the other one; where there are no limits, where
    /// the file shows the joint, and half a turn or a metre from there.
    #[must_use]
    pub fn closed_and_open(&self) -> [f64; 2] {
        match self.limits() {
            Some([lower, upper]) if lower.abs() <= upper.abs() => [lower, upper],
            Some([lower, upper]) => [upper, lower],
            None => [self.start, self.start + UNLIMITED[usize::from(self.kind == JointType::Prismatic)]],
        }
    }

    /// The pose `child_at_0_from_child` at a position (rad or m); none where the axis has no direction.
    #[must_use]
    pub fn motion(&self, position: f64) -> Pose {
        match (self.moves(), unit(&self.axis)) {
            (Some(kind), Some(axis)) => Articulation { kind, axis, origin: self.anchor }.motion(position),
            _ => Pose::identity(),
        }
    }
}

impl Model {
    /// The joints' closed positions, rad or m; 0 for those that do not move.
    #[must_use]
    pub fn closed(&self) -> Vec<f64> {
        self.joints.iter().map(|j| if j.moves().is_some() { j.closed_and_open()[0] } else { 0.0 }).collect()
    }

    /// Joints of one degree of freedom, by index.
    pub fn moving(&self) -> impl Iterator<Item = (usize, &ModelJoint)> {
        self.joints.iter().enumerate().filter(|(_, j)| j.moves().is_some())
    }
}

/// Whole kitchens have hundreds of links.
const MAX_LINKS: usize = 10_000;

/// Refuses more links than any furniture has.
pub(super) fn bounded(model: &Model) -> Result<()> {
    if model.links.len() > MAX_LINKS {
        let message = format!("{} links, more than {MAX_LINKS}; split the scene", model.links.len());
        return Err(Error::format(&model.source, "whole file", message));
    }
    Ok(())
}

/// The model's name, else the file's.
pub(super) fn named(name: Option<&str>, path: &Path) -> String {
    match name.filter(|n| !n.trim().is_empty()) {
        Some(name) => name.to_owned(),
        None => path.file_stem().map_or_else(|| "model".to_owned(), |s| s.to_string_lossy().into_owned()),
    }
}
