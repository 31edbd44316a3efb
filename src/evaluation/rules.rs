//! What is measured on a clip, and the rules that turn it into right or wrong.

use serde::Serialize;

use super::truth::{Prediction, TrueClip};
use crate::articulation::JointKind;
use crate::math::line::Line;
use crate::math::{signed_angle, unsigned_angle};

/// Distances and angles between one prediction and its truth.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Measured {
    /// The types agree.
    pub type_right: bool,
    /// True type.
    pub kind: JointKind,
    /// Angle between the axes regardless of sign, radians.
    pub axis_rad: f64,
    /// Angle between the axes with their sense, radians: above pi/2 the part opens inward.
    pub signed_axis_rad: f64,
    /// Distance between the origins, metres.
    pub point_to_point_m: Option<f64>,
    /// Distance between the paper's contact pivot and the true handle's projection, metres.
    pub pivot_to_pivot_m: Option<f64>,
    /// Distance of the predicted origin from the true line, metres.
    pub origin_to_line_m: Option<f64>,
    /// Distance of the true origin from the predicted line, metres.
    pub truth_to_line_m: Option<f64>,
    /// Difference between the ranges moved, rad or m.
    pub range_error: Option<f64>,
    /// Intersection over union of the part boxes with thin sides thickened to 5 cm.
    pub box_iou: Option<f64>,
}

/// Compares a prediction with the truth; `None` where there is no answer.
#[must_use]
pub fn measure(prediction: &Prediction, truth: &TrueClip) -> Option<Measured> {
    let (kind, axis) = prediction.kind.zip(prediction.axis)?;
    let true_line = Line { point: truth.origin, direction: truth.axis };
    let origin = prediction.origin;
    let predicted_line = origin.map(|point| Line { point, direction: axis });
    Some(Measured {
        type_right: kind == truth.kind,
        kind: truth.kind,
        axis_rad: unsigned_angle(&axis, &truth.axis),
        signed_axis_rad: signed_angle(&axis, &truth.axis),
        point_to_point_m: origin.map(|o| (o - truth.origin).norm()),
        pivot_to_pivot_m: prediction.contact_pivot.or(origin).map(|o| (o - truth.origin_handle).norm()),
        origin_to_line_m: origin.map(|o| true_line.distance(&o)),
        truth_to_line_m: predicted_line.map(|l| l.distance(&truth.origin)),
        range_error: prediction.range.filter(|_| kind == truth.kind).map(|r| (r - truth.moved).abs()),
        box_iou: prediction.part_box.as_ref().map(|b| {
            let thick = 0.05;
            crate::twin::box_iou(&b.thickened(thick), &truth.part_box.thickened(thick))
        }),
    })
}

/// A named rule for M, MA and MAO.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Rule {
    /// The paper: axis within 15 deg, origins within 0.25 m point to point, slides exempt from the origin.
    Paws,
    /// The paper's rule with the paper's origin: contact pivot against the true handle's projection.
    PawsPivot,
    /// USDNet's `MAO_ST`: axis below 15 deg, each origin below 0.25 m from the other line, slides exempt.
    UsdnetMaoSt,
    /// Ours, for simulation: axis within 5 deg with the right sense, true mid-edge within 5 cm of the predicted hinge,
    /// range within 10 deg or 5 cm.
    Sim,
}

impl Rule {
    /// All rules, in the order of the tables.
    pub const ALL: [Self; 4] = [Self::Paws, Self::PawsPivot, Self::UsdnetMaoSt, Self::Sim];

    /// Its name in tables.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Paws => "PAWS (point to point)",
            Self::PawsPivot => "PAWS (contact pivot)",
            Self::UsdnetMaoSt => "USDNet MAO_ST",
            Self::Sim => "SIM (5 deg, 5 cm, sense, range)",
        }
    }

    /// `[M, MA, MAO]` of one answered clip.
    #[must_use]
    pub fn judge(self, m: &Measured) -> [bool; 3] {
        let slide = m.kind == JointKind::Prismatic;
        let within = |d: Option<f64>, limit: f64| d.is_some_and(|d| d <= limit);
        let below = |d: Option<f64>, limit: f64| d.is_some_and(|d| d < limit);
        let (axis, origin) = match self {
            Self::Paws => (m.axis_rad <= 15f64.to_radians(), slide || within(m.point_to_point_m, 0.25)),
            Self::PawsPivot => (m.axis_rad <= 15f64.to_radians(), slide || within(m.pivot_to_pivot_m, 0.25)),
            Self::UsdnetMaoSt => (
                m.axis_rad < 15f64.to_radians(),
                slide || (below(m.origin_to_line_m, 0.25) && below(m.truth_to_line_m, 0.25)),
            ),
            Self::Sim => {
                let range = if slide { 0.05 } else { 10f64.to_radians() };
                (
                    m.axis_rad <= 5f64.to_radians() && m.signed_axis_rad <= 5f64.to_radians(),
                    (slide || within(m.truth_to_line_m, 0.05)) && within(m.range_error, range),
                )
            }
        };
        let ma = m.type_right && axis;
        [m.type_right, ma, ma && origin]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{Point, Vector};
    use crate::twin::OrientedBox;

    fn truth(kind: JointKind) -> TrueClip {
        TrueClip {
            joint: "j".to_owned(),
            kind,
            axis: Vector::z(),
            origin: Point::new(0.0, 0.0, 1.0),
            origin_handle: Point::new(0.0, 0.0, 0.5),
            moved: 1.0,
            part_box: OrientedBox {
                center: Point::origin(),
                half: Vector::new(0.2, 0.01, 0.3),
                rotation: nalgebra::Matrix3::identity(),
            },
        }
    }

    fn prediction(axis: Vector, origin: Point) -> Prediction {
        Prediction {
            recording: "r".to_owned(),
            clip: "c".to_owned(),
            kind: Some(JointKind::Revolute),
            axis: Some(axis),
            origin: Some(origin),
            contact_pivot: None,
            range: Some(1.0),
            part_box: None,
            confidence: None,
            joint: None,
            reason: None,
        }
    }

    #[test]
    fn the_rules_differ_where_they_should() {
        // 40 cm along the hinge: the line is right, the point is not.
        let along = measure(&prediction(Vector::z(), Point::new(0.0, 0.0, 0.6)), &truth(JointKind::Revolute)).unwrap();
        assert_eq!(Rule::Paws.judge(&along), [true, true, false]);
        assert_eq!(Rule::PawsPivot.judge(&along), [true; 3]);
        assert_eq!(Rule::UsdnetMaoSt.judge(&along), [true; 3]);
        assert_eq!(Rule::Sim.judge(&along), [true; 3]);
        // Opening inward is seen by ours alone.
        let inward =
            measure(&prediction(-Vector::z(), Point::new(0.0, 0.0, 1.0)), &truth(JointKind::Revolute)).unwrap();
        assert_eq!(Rule::Paws.judge(&inward), [true; 3]);
        assert_eq!(Rule::Sim.judge(&inward), [true, false, false]);
        // 20 cm beside the hinge passes the paper's rule and not ours.
        let beside = measure(&prediction(Vector::z(), Point::new(0.2, 0.0, 1.0)), &truth(JointKind::Revolute)).unwrap();
        assert_eq!(Rule::Paws.judge(&beside), [true; 3]);
        assert_eq!(Rule::Sim.judge(&beside), [true, true, false]);
        let wrong_type = measure(&prediction(Vector::z(), Point::origin()), &truth(JointKind::Prismatic)).unwrap();
        assert_eq!(Rule::Paws.judge(&wrong_type), [false; 3]);
    }
}
