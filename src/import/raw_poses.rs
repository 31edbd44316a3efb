//! Worlds and camera poses as they stand in files, with what they mean.

use nalgebra::UnitQuaternion;

use super::at::At;
use super::optics::Optics;
use crate::math::{Pose, Vector};

/// The frame that poses, points and hands of a capture are in.
#[derive(Debug, Clone, PartialEq)]
pub struct SourceWorld {
    /// Where up is, in the source's own axes (unit length); `None`: the source does not know gravity.
    pub up: Option<Vector>,
    /// Metres per unit of length; `None`: the source's scale is arbitrary.
    pub unit_m: Option<f64>,
    /// Whether the axes are left-handed (Unity). z is then mirrored before anything else.
    pub left_handed: bool,
}

impl Default for SourceWorld {
    fn default() -> Self {
        Self { up: None, unit_m: Some(1.0), left_handed: false }
    }
}

/// Axes of a camera.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
pub enum CameraAxes {
    /// x right, y down, z forward
    #[default]
    Opencv,
    /// x right, y up, z back (OpenGL, ARKit, Blender, nerfstudio)
    Opengl,
    /// x right, y up, z forward, left-handed (Unity)
    Unity,
}

/// What a pose maps.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
pub enum Direction {
    /// Points of the camera into the world
    #[default]
    WorldFromCamera,
    /// Points of the world into the camera
    CameraFromWorld,
}

/// Order of a quaternion's numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
pub enum QuaternionOrder {
    /// x y z w
    #[default]
    Xyzw,
    /// w x y z
    Wxyz,
}

/// A rotation as it stands in a file.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum RawRotation {
    /// Four numbers in the order of [`Poses::quaternion`].
    Quaternion([f64; 4]),
    /// Rows of a 3 x 3 matrix.
    Matrix([[f64; 3]; 3]),
    /// Axis times angle, radians.
    AxisAngle([f64; 3]),
}

/// A pose as it stands in a file.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RawPose {
    /// The translation of the transform, source units.
    pub position: [f64; 3],
    /// Its rotation.
    pub turn: RawRotation,
}

/// A pose at a time.
#[derive(Debug, Clone, PartialEq)]
pub struct PoseAt {
    /// When.
    pub at: At,
    /// The pose.
    pub pose: RawPose,
    /// The camera that was posed, where the file tells it pose by pose.
    pub optics: Option<Optics>,
}

/// Poses of the colour camera, or of the body that carries it.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Poses {
    /// What the transforms map.
    pub direction: Direction,
    /// Axes of the posed camera (or body).
    pub axes: CameraAxes,
    /// Order of quaternions.
    pub quaternion: QuaternionOrder,
    /// Where the poses are a body's: the colour camera (OpenCV axes, metres) in it.
    pub body_from_camera: Option<Pose>,
    /// In any order.
    pub items: Vec<PoseAt>,
}

impl RawPose {
    /// From the rows of a 3 x 4 or 4 x 4 matrix; `None` for fewer than 12 numbers.
    #[must_use]
    pub fn from_rows(rows: &[f64]) -> Option<Self> {
        let [a, b, c, x, d, e, f, y, g, h, i, z, ..] = *rows else { return None };
        Some(Self { position: [x, y, z], turn: RawRotation::Matrix([[a, b, c], [d, e, f], [g, h, i]]) })
    }

    /// From a rigid transform; quaternions in the order x y z w.
    #[must_use]
    pub fn from_pose(pose: &Pose) -> Self {
        let rotation: &UnitQuaternion<f64> = &pose.rotation;
        Self { position: pose.translation.vector.into(), turn: RawRotation::Quaternion(rotation.coords.into()) }
    }
}
