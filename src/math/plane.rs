//! Planes in space.

use serde::{Deserialize, Serialize};

use super::{Point, Vector, principal_directions};

/// The plane `normal . x = offset`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Plane {
    /// Unit normal.
    pub normal: Vector,
    /// Signed distance of the plane from the world's origin along the normal, metres.
    pub offset: f64,
}

impl Plane {
    /// Plane through three points; `None` where they are nearly on one line.
    #[must_use]
    pub fn through(a: &Point, b: &Point, c: &Point) -> Option<Self> {
        let n = (b - a).cross(&(c - a));
        // The area of a thin triangle says nothing about a direction.
        if n.norm() < 1e-6 {
            return None;
        }
        let normal = n.normalize();
        Some(Self { normal, offset: normal.dot(&a.coords) })
    }

    /// Least-squares plane through three points or more.
    #[must_use]
    pub fn fit(points: &[Point]) -> Option<Self> {
        if points.len() < 3 {
            return None;
        }
        let (axes, _) = principal_directions(points)?;
        let normal: Vector = axes.column(2).into_owned();
        let mean = super::centroid(points)?;
        Some(Self { normal, offset: normal.dot(&mean.coords) })
    }

    /// Signed distance of `p`, positive on the normal's side.
    #[must_use]
    pub fn height(&self, p: &Point) -> f64 {
        self.normal.dot(&p.coords) - self.offset
    }

    /// Orthogonal projection of `p` onto the plane.
    #[must_use]
    pub fn project(&self, p: &Point) -> Point {
        p - self.normal * self.height(p)
    }

    /// The same plane with its normal on the side of `p`.
    #[must_use]
    pub fn facing(self, p: &Point) -> Self {
        if self.height(p) < 0.0 { Self { normal: -self.normal, offset: -self.offset } } else { self }
    }
}
