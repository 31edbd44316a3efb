//! Wrong joints at graded distances from a right one: what a proof has to refute.

use serde::Serialize;

use crate::articulation::{Articulation, JointKind};
use crate::math::{Point, Vector, reject, rotation, unit};
use crate::twin::{OrientedBox, Part, Role};

/// Where a hinge's pivot is off to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum PivotShift {
    /// Along the face, to the hand.
    Toward,
    /// Along the face, from the hand.
    Away,
    /// Against the way that the hand goes first: into the furniture.
    Into,
}

/// How an axis leans.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Lean {
    /// Within the part's face; for what comes straight out: to the side.
    Within,
    /// Out of the part's face; for what comes straight out: up or down.
    Out,
}

/// What is wrong about a joint, from the grossest to the smallest.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum JointFault {
    /// A slide instead of a hinge, a hinge instead of a slide.
    Type,
    /// Hinged on the opposite side.
    Side,
    /// Hinged at an edge square to the right one; of a slide, a direction square to the right one.
    Edge,
    /// Opens the other way.
    Inward,
    /// The pivot is off by so many centimetres.
    Shift(u32, PivotShift),
    /// The axis leans by so many degrees.
    Tilt(u32, Lean),
}

/// Sizes of the shifts, centimetres.
pub const SHIFTS_CM: [u32; 3] = [5, 10, 25];
/// Sizes of the tilts, degrees.
pub const TILTS_DEG: [u32; 3] = [5, 10, 20];

impl JointFault {
    /// In words.
    #[must_use]
    pub fn name(self) -> String {
        match self {
            Self::Type => "wrong type".to_owned(),
            Self::Side => "hinged on the other side".to_owned(),
            Self::Edge => "axis turned by 90 deg".to_owned(),
            Self::Inward => "opens the other way".to_owned(),
            Self::Shift(cm, PivotShift::Toward) => format!("pivot {cm} cm nearer to the hand"),
            Self::Shift(cm, PivotShift::Away) => format!("pivot {cm} cm farther from the hand"),
            Self::Shift(cm, PivotShift::Into) => format!("pivot {cm} cm into the furniture"),
            Self::Tilt(deg, Lean::Within) => format!("axis tilted by {deg} deg in the face"),
            Self::Tilt(deg, Lean::Out) => format!("axis tilted by {deg} deg out of the face"),
        }
    }
}

/// A wrong joint.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Sibling {
    /// What is wrong about it.
    pub fault: JointFault,
    /// The joint.
    pub articulation: Articulation,
}

/// A part's front: its directions, its middle and its half sizes.
struct PartFront {
    right: Vector,
    up: Vector,
    out: Vector,
    middle: Point,
    half: Vector,
    grip: Point,
}

impl PartFront {
    fn of(part: &Part) -> Self {
        let bounds: OrientedBox = part.bounds;
        let [right, up, out] = [0, 1, 2].map(|i| bounds.rotation.column(i).into_owned());
        // A drawer's bounds reach far behind its front, where no hinge is.
        let front = part.solids.iter().find(|s| s.role == Role::Front).map_or(bounds.center, |s| s.shape.center);
        let middle = bounds.center + out * out.dot(&(front - bounds.center));
        Self { right, up, out, middle, half: bounds.half, grip: part.handle }
    }

    /// A hinge along `axis` in the sense in which the hand goes out.
    fn hinge(&self, axis: Vector, origin: Point) -> Articulation {
        let hinge = Articulation { kind: JointKind::Revolute, axis, origin };
        if axis.cross(&(self.grip - origin)).dot(&self.out) >= 0.0 { hinge } else { hinge.reversed() }
    }

    fn slide(&self, axis: Vector) -> Articulation {
        Articulation { kind: JointKind::Prismatic, axis, origin: self.grip }
    }

    /// Hinged at the edge along `up` (else along `right`) that is farther from the hand; at the left or lower one where the
    /// hand is in the middle.
    fn edge(&self, upright: bool) -> Articulation {
        const MIDDLE_M: f64 = 1e-3;
        let (axis, across, half) =
            if upright { (self.up, self.right, self.half.x) } else { (self.right, self.up, self.half.y) };
        let hand = (self.grip - self.middle).dot(&across);
        let side = if hand > -MIDDLE_M { -1.0 } else { 1.0 };
        self.hinge(axis, self.middle + across * (half * side))
    }
}

/// The wrong siblings of a part's joint, which is taken to be right, in the order of [`JointFault`].
///
/// Hinges have all of them, slides no shifts and no other side. All open outward but for [`JointFault::Inward`], a hinge moved
/// beyond the hand among them: its sense is the one in which the hand goes out.
#[must_use]
pub fn siblings(part: &Part) -> Vec<Sibling> {
    let own = part.joint.articulation;
    let front = PartFront::of(part);
    let mut all = match own.kind {
        JointKind::Revolute => of_hinge(&own, &front),
        JointKind::Prismatic => of_slide(&own, &front),
    };
    all.push((JointFault::Inward, own.reversed()));
    for deg in TILTS_DEG {
        for (lean, about) in leans(&own, &front) {
            let axis = rotation(&about, f64::from(deg).to_radians()) * own.axis;
            // About the part's middle: elsewhere a tilt would be a shift, too.
            let origin = match own.kind {
                JointKind::Revolute => own.line().project(&part.bounds.center),
                JointKind::Prismatic => own.origin,
            };
            all.push((JointFault::Tilt(deg, lean), Articulation { axis, origin, ..own }));
        }
    }
    all.sort_by_key(|(fault, _)| *fault);
    all.into_iter().map(|(fault, articulation)| Sibling { fault, articulation }).collect()
}

fn of_hinge(own: &Articulation, front: &PartFront) -> Vec<(JointFault, Articulation)> {
    let upright = own.axis.dot(&front.up).abs() >= own.axis.dot(&front.right).abs();
    // From the hinge to the middle, in the face.
    let across = reject(&reject(&(front.middle - own.origin), &own.axis), &front.out);
    let mut all = vec![
        (JointFault::Type, front.slide(front.out)),
        (JointFault::Side, front.hinge(own.axis, own.origin + across * 2.0)),
        (JointFault::Edge, front.edge(!upright)),
    ];
    let Some(toward) = unit(&across) else { return all };
    let opening = unit(&own.axis.cross(&toward)).unwrap_or(front.out);
    for cm in SHIFTS_CM {
        for (way, direction) in
            [(PivotShift::Toward, toward), (PivotShift::Away, -toward), (PivotShift::Into, -opening)]
        {
            let origin = own.origin + direction * (0.01 * f64::from(cm));
            all.push((JointFault::Shift(cm, way), front.hinge(own.axis, origin)));
        }
    }
    all
}

fn of_slide(own: &Articulation, front: &PartFront) -> Vec<(JointFault, Articulation)> {
    let comes_out = own.axis.dot(&front.out).abs() > 0.5;
    let square = if comes_out { front.right } else { front.out };
    vec![(JointFault::Type, front.edge(true)), (JointFault::Edge, front.slide(square))]
}

/// The directions about which an axis leans: two that are square to it.
fn leans(own: &Articulation, front: &PartFront) -> [(Lean, Vector); 2] {
    if own.axis.dot(&front.out).abs() > 0.5 {
        return [(Lean::Within, front.up), (Lean::Out, front.right)];
    }
    let upright = own.axis.dot(&front.up).abs() >= own.axis.dot(&front.right).abs();
    [(Lean::Within, front.out), (Lean::Out, if upright { front.right } else { front.up })]
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use nalgebra::Matrix3;

    use super::*;
    use crate::math::unsigned_angle;
    use crate::twin::{Joint, Solid};

    /// A part 0.5 m wide and 0.7 m tall before y = 0, looking to -y, its left lower corner at the origin; held at the right.
    fn part(articulation: Articulation) -> Part {
        let bounds = OrientedBox {
            center: Point::new(0.25, 0.009, 0.35),
            half: Vector::new(0.25, 0.35, 0.009),
            rotation: Matrix3::from_columns(&[Vector::x(), Vector::z(), -Vector::y()]),
        };
        Part {
            id: "p".to_owned(),
            label: String::new(),
            joint: Joint {
                articulation,
                upper: 1.6,
                observed: 1.0,
                damping: 0.5,
                friction: 0.2,
                expected: 1.6,
                resistance_seen: false,
                balanced: false,
                probability: None,
            },
            solids: vec![Solid { name: "front".to_owned(), role: Role::Front, shape: bounds, seen: true }],
            handle: Point::new(0.45, -0.03, 0.5),
            bounds,
        }
    }

    fn door() -> Part {
        part(Articulation { kind: JointKind::Revolute, axis: -Vector::z(), origin: Point::new(0.0, 0.0, 0.35) })
    }

    fn by_fault(part: &Part) -> BTreeMap<JointFault, Articulation> {
        siblings(part).into_iter().map(|s| (s.fault, s.articulation)).collect()
    }

    #[test]
    fn a_hinges_siblings_are_where_their_names_say_and_open_outward() {
        let door = door();
        let all = by_fault(&door);
        assert_eq!(all.len(), siblings(&door).len());
        assert_eq!(all.len(), 4 + 9 + 6);
        let at = |fault: JointFault| all[&fault];
        assert_eq!((at(JointFault::Type).kind, at(JointFault::Type).axis), (JointKind::Prismatic, -Vector::y()));
        let other = at(JointFault::Side);
        assert!((other.origin - Point::new(0.5, 0.0, 0.35)).norm() < 1e-9 && other.axis.z > 0.99, "{other:?}");
        // The hand is above the middle: the edge farther from it is the lower one.
        let edge = at(JointFault::Edge);
        assert!(edge.axis.x.abs() > 0.99 && edge.origin.z.abs() < 1e-9, "{edge:?}");
        assert!((at(JointFault::Shift(10, PivotShift::Toward)).origin.x - 0.1).abs() < 1e-9);
        assert!((at(JointFault::Shift(25, PivotShift::Away)).origin.x + 0.25).abs() < 1e-9);
        assert!((at(JointFault::Shift(5, PivotShift::Into)).origin.y - 0.05).abs() < 1e-9);
        for (fault, joint) in &all {
            let outward = (joint.motion(0.01) * door.handle - door.handle).dot(&-Vector::y());
            assert_eq!(outward > 0.0, *fault != JointFault::Inward, "{}: {outward}", fault.name());
        }
    }

    #[test]
    fn a_slide_has_no_other_side_and_no_pivot() {
        let drawer = part(Articulation { kind: JointKind::Prismatic, axis: -Vector::y(), origin: Point::origin() });
        let all = by_fault(&drawer);
        assert_eq!(all.len(), 3 + 6);
        // Held at the right, it would be hinged on the left.
        let hinge = all[&JointFault::Type];
        assert!(hinge.kind == JointKind::Revolute && hinge.origin.x.abs() < 1e-9, "{hinge:?}");
        assert!(all[&JointFault::Edge].axis.dot(&Vector::y()).abs() < 1e-9);
        assert_eq!(all[&JointFault::Inward].axis, Vector::y());
        assert!(all[&JointFault::Tilt(20, Lean::Within)].axis.z.abs() < 1e-9);
        assert!(all[&JointFault::Tilt(20, Lean::Out)].axis.x.abs() < 1e-9);
    }

    #[test]
    fn tilts_have_their_angle_and_leave_the_middle_of_the_hinge_where_it_is() {
        let slide = Articulation { kind: JointKind::Prismatic, axis: Vector::x(), origin: Point::origin() };
        for part in [door(), part(slide)] {
            let own = part.joint.articulation;
            for (fault, joint) in by_fault(&part) {
                let JointFault::Tilt(deg, _) = fault else { continue };
                assert!((unsigned_angle(&joint.axis, &own.axis).to_degrees() - f64::from(deg)).abs() < 1e-6);
                assert!(
                    joint.line().distance(&own.line().project(&part.bounds.center)) < 1e-9 || own.kind == slide.kind
                );
            }
        }
    }
}
