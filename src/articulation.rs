//! What the paper infers: `phi = {c, a, o}`, a joint of one degree of freedom, and answers that may be absent.

use serde::{Deserialize, Serialize};

use crate::math::line::Line;
use crate::math::{Point, Vector, reject, rotation};

/// Motion type `c` (§3, problem formulation).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum JointKind {
    /// Rotation about a fixed line: doors, lids, oven doors.
    Revolute,
    /// Translation along a fixed direction: drawers, sliding doors.
    Prismatic,
}

impl JointKind {
    /// The word for people: "hinge" or "slide".
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Revolute => "hinge",
            Self::Prismatic => "slide",
        }
    }

    /// The word of files and formats: "revolute" or "prismatic".
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Revolute => "revolute",
            Self::Prismatic => "prismatic",
        }
    }
}

/// A joint: type, axis, origin. World frame, metres; positive motion opens.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Articulation {
    /// Motion type `c`.
    pub kind: JointKind,
    /// Axis `a`: unit; positive rotation about it (right-hand rule) or translation along it opens.
    pub axis: Vector,
    /// Origin `o`: a point on the hinge, or where the slide was held when closed.
    pub origin: Point,
}

impl Articulation {
    /// The axis as a line through the origin.
    #[must_use]
    pub fn line(&self) -> Line {
        Line { point: self.origin, direction: self.axis }
    }

    /// The pose `world_from_world` that opening by `opening` (rad or m) applies to the moving part.
    #[must_use]
    pub fn motion(&self, opening: f64) -> crate::math::Pose {
        match self.kind {
            JointKind::Prismatic => {
                crate::math::Pose::translation(self.axis.x * opening, self.axis.y * opening, self.axis.z * opening)
            }
            JointKind::Revolute => {
                let turn = rotation(&self.axis, opening);
                crate::math::Pose::from_parts((self.origin.coords - turn * self.origin.coords).into(), turn)
            }
        }
    }

    /// Opening (rad or m) that brings the part's point `closed` nearest to `p`; an angle within -pi..pi.
    #[must_use]
    pub fn opening_at(&self, closed: &Point, p: &Point) -> f64 {
        match self.kind {
            JointKind::Prismatic => (p - closed).dot(&self.axis),
            JointKind::Revolute => {
                let a = reject(&(closed - self.origin), &self.axis);
                let b = reject(&(p - self.origin), &self.axis);
                self.axis.dot(&a.cross(&b)).atan2(a.dot(&b))
            }
        }
    }

    /// Metres that a point at `p` goes for each unit of opening: its distance from a hinge; 1 for a slide.
    #[must_use]
    pub fn lever(&self, p: &Point) -> f64 {
        match self.kind {
            JointKind::Revolute => self.line().distance(p),
            JointKind::Prismatic => 1.0,
        }
    }

    /// What a force (N) at a point does along the joint: torque about a hinge, N m; force along a slide, N. Positive opens.
    #[must_use]
    pub fn effort(&self, at: &Point, force: &Vector) -> f64 {
        match self.kind {
            JointKind::Revolute => self.axis.dot(&(at - self.origin).cross(force)),
            JointKind::Prismatic => self.axis.dot(force),
        }
    }

    /// The same joint with the other sense of opening.
    #[must_use]
    pub fn reversed(self) -> Self {
        Self { axis: -self.axis, ..self }
    }
}

/// An answer, or the reason why there is none.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Outcome<T> {
    /// The answer.
    Found(T),
    /// No answer, because...
    Abstained(String),
}

impl<T> Outcome<T> {
    /// The answer, if there is one.
    pub fn found(&self) -> Option<&T> {
        match self {
            Self::Found(t) => Some(t),
            Self::Abstained(_) => None,
        }
    }

    /// The reason why there is no answer.
    pub fn reason(&self) -> Option<&str> {
        match self {
            Self::Found(_) => None,
            Self::Abstained(reason) => Some(reason),
        }
    }
}

/// Whether a clip opens or closes its joint.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Action {
    /// From closed to open.
    Open,
    /// From open to closed.
    Close,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn motion_and_opening_are_inverse() {
        let hinge = Articulation {
            kind: JointKind::Revolute,
            axis: Vector::new(0.1, -0.2, 1.0).normalize(),
            origin: Point::new(1.0, 2.0, 0.5),
        };
        let slide = Articulation { kind: JointKind::Prismatic, axis: Vector::x(), ..hinge };
        let handle = Point::new(1.6, 2.1, 0.9);
        for joint in [hinge, slide, hinge.reversed()] {
            for opening in [-0.4, 0.0, 0.3, 1.2] {
                let moved = joint.motion(opening) * handle;
                assert!((joint.opening_at(&handle, &moved) - opening).abs() < 1e-12);
            }
        }
        assert!((hinge.motion(1.0) * hinge.origin - hinge.origin).norm() < 1e-12);
    }
}
