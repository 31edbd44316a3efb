//! Infinite lines and segments in space.

use serde::{Deserialize, Serialize};

use super::{Point, Vector};

/// A line through `point` along the unit `direction`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Line {
    /// A point on the line.
    pub point: Point,
    /// Unit direction.
    pub direction: Vector,
}

impl Line {
    /// Signed coordinate of the foot of `p` along the line, measured from `self.point`.
    #[must_use]
    pub fn coordinate(&self, p: &Point) -> f64 {
        (p - self.point).dot(&self.direction)
    }

    /// Orthogonal projection of `p` onto the line.
    #[must_use]
    pub fn project(&self, p: &Point) -> Point {
        self.point + self.direction * self.coordinate(p)
    }

    /// Orthogonal distance from `p` (§A.7: `d_t = |(p - q) x u|`).
    #[must_use]
    pub fn distance(&self, p: &Point) -> f64 {
        (p - self.point).cross(&self.direction).norm()
    }
}

/// A stretch of a line: `line.point + direction * [start, end]`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Segment {
    /// The carrying line.
    pub line: Line,
    /// Coordinates of the two ends along the line, metres, `start <= end`.
    pub span: [f64; 2],
}

impl Segment {
    /// From one point to another; `None` where they coincide.
    #[must_use]
    pub fn between(a: &Point, b: &Point) -> Option<Self> {
        let direction = super::unit(&(b - a))?;
        Some(Self { line: Line { point: *a, direction }, span: [0.0, (b - a).norm()] })
    }

    /// The two end points.
    #[must_use]
    pub fn ends(&self) -> [Point; 2] {
        self.span.map(|s| self.line.point + self.line.direction * s)
    }

    /// Length in metres.
    #[must_use]
    pub fn length(&self) -> f64 {
        self.span[1] - self.span[0]
    }

    /// Middle point.
    #[must_use]
    pub fn middle(&self) -> Point {
        self.line.point + self.line.direction * (0.5 * (self.span[0] + self.span[1]))
    }
}
