//! A line in space as several views show it.

use nalgebra::Matrix3;
use serde::{Deserialize, Serialize};

use crate::math::line::Segment;

/// A 3D line seen in several views: a candidate hinge.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LineTrack {
    /// The line with its ends.
    pub segment: Segment,
    /// Frames that see it, ascending.
    pub views: Vec<usize>,
    /// Root mean square distance of what supports it, metres.
    pub rms_m: f64,
    /// Covariance of its middle, across the line (rank 2), world, m^2.
    pub position_covariance: Matrix3<f64>,
    /// Covariance of its unit direction (rank 2), world.
    pub direction_covariance: Matrix3<f64>,
}

impl LineTrack {
    /// Largest standard deviation of its middle across the line, metres.
    #[must_use]
    pub fn position_std_m(&self) -> f64 {
        self.position_covariance.trace().max(0.0).sqrt()
    }
}

/// Sorts lines by how many views see how much of them, best first.
pub(super) fn best_first(tracks: &mut [LineTrack]) {
    let support = |t: &LineTrack| t.views.len() as f64 * t.segment.length();
    tracks.sort_by(|a, b| support(b).total_cmp(&support(a)).then(a.views.cmp(&b.views)));
}
