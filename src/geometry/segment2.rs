//! A segment in an image.

use serde::{Deserialize, Serialize};

use crate::math::segment_distance;

/// A segment in an image, pixels.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Segment2 {
    /// One end (u, v).
    pub a: [f64; 2],
    /// The other end.
    pub b: [f64; 2],
}

impl Segment2 {
    /// Length in pixels.
    #[must_use]
    pub fn length(&self) -> f64 {
        (self.b[0] - self.a[0]).hypot(self.b[1] - self.a[1])
    }

    /// The point at share `t` of the way from `a` to `b`.
    #[must_use]
    pub fn at(&self, t: f64) -> [f64; 2] {
        [0, 1].map(|k| self.a[k] + (self.b[k] - self.a[k]) * t)
    }

    /// Distance of a point, pixels; beyond the ends it is that of the end.
    #[must_use]
    pub fn distance(&self, p: [f64; 2]) -> f64 {
        segment_distance(p, self.a, self.b)
    }

    /// Unit vector across the segment.
    #[must_use]
    pub fn across(&self) -> [f64; 2] {
        let length = self.length().max(1e-9);
        [-(self.b[1] - self.a[1]) / length, (self.b[0] - self.a[0]) / length]
    }
}
