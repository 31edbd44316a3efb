//! Single-precision geometry relative to the first camera.

use nalgebra::{Matrix3, Vector3};

use crate::math::Pose;

/// A point or direction relative to the first camera, metres.
pub(super) type Local = Vector3<f32>;

/// A rigid motion in single precision.
#[derive(Debug, Clone, Copy)]
pub(super) struct RigidMotion {
    pub(super) rotation: Matrix3<f32>,
    pub(super) translation: Local,
}

impl RigidMotion {
    pub(super) fn of(pose: &Pose) -> Self {
        let rotation = pose.rotation.to_rotation_matrix().into_inner().map(|c| c as f32);
        Self { rotation, translation: pose.translation.vector.map(|c| c as f32) }
    }

    pub(super) fn apply(&self, p: &Local) -> Local {
        self.rotation * p + self.translation
    }
}
