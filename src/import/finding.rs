//! What does not fit in an assembled recording, and the options that set it right.

use serde::Serialize;

use super::choices::ImportOptions;
use super::raw_poses::{CameraAxes, Direction, QuaternionOrder};
use crate::math::Vector;

/// Something that does not fit.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ImportFinding {
    /// What is probably wrong.
    pub what: String,
    /// The numbers that say so.
    pub evidence: String,
    /// The option that sets it right.
    pub option: String,
    /// Whether it is beyond doubt.
    pub certain: bool,
    /// Whether the option is beyond doubt, too.
    #[serde(skip)]
    pub can_be_fixed: bool,
    /// The same options as changes; none where no option sets it right.
    #[serde(skip)]
    pub changes: Vec<Change>,
}

/// A change of one option.
#[derive(Debug, Clone, PartialEq)]
pub enum Change {
    /// `--poses`.
    Poses(Direction),
    /// `--quaternion`.
    Quaternion(QuaternionOrder),
    /// `--camera-axes`.
    CameraAxes(CameraAxes),
    /// `--unit`, metres.
    Unit(f64),
    /// `--scale`, metres a unit.
    Scale(f64),
    /// `--up`, an axis of the source.
    Up(Vector),
    /// `--hand-lag`, seconds.
    HandLag(f64),
}

impl Change {
    /// Changes the option.
    pub fn apply(&self, options: &mut ImportOptions) {
        match self {
            Self::Poses(direction) => options.poses = Some(*direction),
            Self::Quaternion(order) => options.quaternion = Some(*order),
            Self::CameraAxes(axes) => options.camera_axes = Some(*axes),
            Self::Unit(unit) => options.unit_m = Some(*unit),
            Self::Scale(scale) => options.scale = Some(*scale),
            Self::Up(up) => options.up = Some(*up),
            Self::HandLag(secs) => options.hand_lag_secs = *secs,
        }
    }

    /// As it is written on the command line.
    #[must_use]
    pub fn words(&self) -> String {
        match self {
            Self::Poses(Direction::WorldFromCamera) => "--poses world-from-camera".to_owned(),
            Self::Poses(Direction::CameraFromWorld) => "--poses camera-from-world".to_owned(),
            Self::Quaternion(QuaternionOrder::Xyzw) => "--quaternion xyzw".to_owned(),
            Self::Quaternion(QuaternionOrder::Wxyz) => "--quaternion wxyz".to_owned(),
            Self::CameraAxes(CameraAxes::Opencv) => "--camera-axes opencv".to_owned(),
            Self::CameraAxes(CameraAxes::Opengl) => "--camera-axes opengl".to_owned(),
            Self::CameraAxes(CameraAxes::Unity) => "--camera-axes unity".to_owned(),
            Self::Unit(unit) => format!("--unit {unit:.4}"),
            Self::Scale(scale) => format!("--scale {scale:.5}"),
            Self::Up(up) => {
                let at = up.iamax();
                let sign = if up[at] < 0.0 { "-" } else { "" };
                format!("--up {sign}{}", ["x", "y", "z"].get(at).copied().unwrap_or("z"))
            }
            Self::HandLag(secs) => format!("--hand-lag {secs:.2}"),
        }
    }
}
