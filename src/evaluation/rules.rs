//! What is measured on a clip, and the rules that turn it into right or wrong.

use std::f64::consts::FRAC_PI_2;

use serde::Serialize;

use super::truth::{Prediction, TrueClip};
use crate::articulation::JointKind;
use crate::inference::uncertainty::sigmas;
use crate::math::line::Line;
use crate::math::{Vector, signed_angle, unsigned_angle};
use crate::twin::OrientedBox;

/// Distances and angles between one prediction and its truth.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct AnswerErrors {
    /// The types agree.
    pub type_right: bool,
    /// True type.
    pub kind: JointKind,
    /// Predicted type.
    pub predicted_kind: JointKind,
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
    /// Distance of the true origin from the predicted line, metres: how far the hinge is off at the part, wherever along
    /// the hinge the prediction puts its origin.
    pub truth_to_line_m: Option<f64>,
    /// Distance between the two infinite lines, metres; between origin and true line where the sine of their angle is at
    /// most 1e-6. Blind to an offset within the plane of two tilted lines, however large.
    pub line_to_line_m: Option<f64>,
    /// The same, parallel up to a sine of 1e-3.
    pub line_to_line_coarse_m: Option<f64>,
    /// The same, parallel only where the sine is zero.
    pub line_to_line_unguarded_m: Option<f64>,
    /// Diagonal of the box around furniture and part in the furniture's axes, metres; the part's own without furniture; none
    /// where the truth has no box of the part.
    pub object_diagonal_m: Option<f64>,
    /// Diagonal of the true part's box, metres.
    pub part_diagonal_m: Option<f64>,
    /// Difference between the ranges moved, rad or m; none where the types differ.
    pub range_error: Option<f64>,
    /// Length of the difference between axis times range of both, rad or m; none where the types differ.
    pub motion_difference: Option<f64>,
    /// Difference between the true handle's distances from the predicted and from the true hinge, metres; none for slides
    /// and where the types differ.
    pub radius_error_m: Option<f64>,
    /// Intersection over union of the part boxes with thin sides thickened to 5 cm.
    pub box_iou: Option<f64>,
    /// Largest offset of the six faces of the predicted part's box, closed, along the true box's axes, metres.
    pub box_edge_m: Option<f64>,
    /// Angle between the axes regardless of sign, in the standard deviations that the prediction gives along it; none where
    /// it gives none and where the types differ, here and in the next two.
    pub axis_sigmas: Option<f64>,
    /// Distance of the true origin from the predicted hinge in the same way; none for slides.
    pub origin_sigmas: Option<f64>,
    /// Difference between the ranges moved in the same way.
    pub range_sigmas: Option<f64>,
}

/// Compares a prediction with the truth; `None` where there is no answer.
#[must_use]
pub fn measure(prediction: &Prediction, truth: &TrueClip) -> Option<AnswerErrors> {
    let (kind, axis) = prediction.kind.zip(prediction.axis)?;
    let true_line = Line { point: truth.origin, direction: truth.axis };
    let origin = prediction.origin;
    let predicted_line = origin.map(|point| Line { point, direction: axis });
    let line_to_line = |guard: f64| predicted_line.map(|l| line_distance(&true_line, &l, guard));
    let type_right = kind == truth.kind;
    let range = prediction.range.filter(|_| type_right);
    let turns = type_right && kind == JointKind::Revolute;
    let said = prediction.uncertainty.as_ref().filter(|_| type_right);
    let boxes = prediction.part_box.as_ref().zip(truth.part_box.as_ref());
    Some(AnswerErrors {
        type_right,
        kind: truth.kind,
        predicted_kind: kind,
        axis_rad: unsigned_angle(&axis, &truth.axis),
        signed_axis_rad: signed_angle(&axis, &truth.axis),
        point_to_point_m: origin.map(|o| (o - truth.origin).norm()),
        pivot_to_pivot_m: prediction.contact_pivot.or(origin).map(|o| (o - truth.origin_handle).norm()),
        origin_to_line_m: origin.map(|o| true_line.distance(&o)),
        truth_to_line_m: predicted_line.map(|l| l.distance(&truth.origin)),
        line_to_line_m: line_to_line(1e-6),
        line_to_line_coarse_m: line_to_line(1e-3),
        line_to_line_unguarded_m: line_to_line(0.0),
        object_diagonal_m: truth
            .part_box
            .as_ref()
            .map(|part| truth.base_box.as_ref().map_or_else(|| diagonal(part), |base| common_diagonal(base, part))),
        part_diagonal_m: truth.part_box.as_ref().map(diagonal),
        range_error: range.map(|r| (r - truth.moved).abs()),
        motion_difference: range.map(|r| (axis * r - truth.axis * truth.moved).norm()),
        radius_error_m: truth
            .handle
            .zip(predicted_line)
            .filter(|_| turns)
            .map(|(handle, line)| (line.distance(&handle) - true_line.distance(&handle)).abs()),
        box_iou: boxes.map(|(b, part)| {
            let thick = 0.05;
            crate::twin::box_iou(&b.thickened(thick), &part.thickened(thick))
        }),
        box_edge_m: boxes.map(|(b, part)| {
            let [low, high] = extent(part, b);
            (low + part.half).amax().max((high - part.half).amax())
        }),
        axis_sigmas: said.and_then(|u| {
            let turn = turn_onto(&axis, &truth.axis);
            sigmas(&u.axis_cov_rad2, u.across.map(|direction| direction.dot(&turn)))
        }),
        origin_sigmas: said.filter(|_| turns).and_then(|u| {
            let offset = truth.origin - origin?;
            sigmas(u.origin_cov_m2.as_ref()?, u.across.map(|direction| direction.dot(&offset)))
        }),
        range_sigmas: range.zip(prediction.range_std).map(|(r, std)| (r - truth.moved).abs() / std),
    })
}

/// The turn that brings one unit axis onto the line of another: a rotation vector, radians.
fn turn_onto(from: &Vector, to: &Vector) -> Vector {
    let to = if from.dot(to) < 0.0 { -to } else { *to };
    let about = from.cross(&to);
    let sine = about.norm();
    if sine > 0.0 { about * (sine.atan2(from.dot(&to)) / sine) } else { about }
}

/// Distance between two infinite lines, metres; of `b`'s point from `a` where they are parallel: where the sine of their
/// angle is at most `guard`.
fn line_distance(a: &Line, b: &Line, guard: f64) -> f64 {
    let across = a.direction.cross(&b.direction);
    let sine = across.norm();
    if sine <= guard { a.distance(&b.point) } else { (b.point - a.point).dot(&across).abs() / sine }
}

/// Lowest and highest coordinates of a box's corners along the axes of another one, from that one's centre, metres.
fn extent(frame: &OrientedBox, of: &OrientedBox) -> [Vector; 2] {
    let corners: [Vector; 8] = of.corners().map(|c| frame.rotation.transpose() * (c - frame.center));
    corners.iter().fold([corners[0], corners[0]], |[low, high], c| [low.inf(c), high.sup(c)])
}

fn diagonal(b: &OrientedBox) -> f64 {
    2.0 * b.half.norm()
}

/// Diagonal of the box around two boxes in the axes of the first, metres.
fn common_diagonal(base: &OrientedBox, part: &OrientedBox) -> f64 {
    let [low, high] = extent(base, part);
    let lowest: Vector = -base.half;
    (high.sup(&base.half) - low.inf(&lowest)).norm()
}

/// A named rule for M, MA and MAO. Types must agree in all of them; angles are regardless of sign unless said otherwise.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Rule {
    /// The paper: axis within 15 deg, origins within 0.25 m point to point, slides exempt from the origin.
    Paws,
    /// The paper's rule with the paper's origin: contact pivot against the true handle's projection.
    PawsPivot,
    /// The paper's limits, our reading of the origin: the true mid-edge within 0.25 m of the predicted hinge, so that the
    /// arbitrary place along the hinge does not count.
    PawsLine,
    /// USDNet's MA and MAO: axis below 15 deg, origins below 0.25 m point to point, slides not exempt. Its MO is
    /// [`usdnet_mo`].
    Usdnet,
    /// USDNet's `MAO_ST`: axis below 15 deg, each origin below 0.25 m from the other line, slides exempt.
    UsdnetMaoSt,
    /// OPDMulti: axis within 10 deg, origin from the true line within a quarter of the object's diagonal, predicted slides
    /// exempt.
    OpdMulti,
    /// S2O: axis below 5 deg, origin from the true line below a tenth of the part's diagonal, slides exempt.
    S2o,
    /// Articulate-Anything's score of one joint: axis within 0.25 rad; mean of origin error (metres) and orientation error
    /// (radians) within 0.05; and the limits. The origin error is the distance between the lines of a hinge, between the
    /// origins of a slide. A prediction has no joint frame: its orientation error is read as the smallest turn between the
    /// axes. Limits: 1 - cosine of the angle between the opening directions within 1, here with their sense (the owners'
    /// code takes the better of a motion and its reverse, which always passes); difference between axis times range
    /// within 1.6057 rad or m, where a range was predicted.
    ArticulateAnything,
    /// A twin that looks right: axis below 5 deg, true mid-edge below 5 cm from the predicted hinge, slides exempt.
    Strict,
    /// Ours, for simulation: axis within 5 deg with the right sense, true mid-edge within 5 cm of the predicted hinge,
    /// range within 10 deg or 5 cm.
    Sim,
}

/// Range errors up to these serve a simulation: rad, m.
const SIM_RANGE: [f64; 2] = [10.0 * std::f64::consts::PI / 180.0, 0.05];

impl Rule {
    /// All rules, in the order of the tables.
    pub const ALL: [Self; 10] = [
        Self::Paws,
        Self::PawsPivot,
        Self::PawsLine,
        Self::Usdnet,
        Self::UsdnetMaoSt,
        Self::OpdMulti,
        Self::S2o,
        Self::ArticulateAnything,
        Self::Strict,
        Self::Sim,
    ];

    /// Its name in tables.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Paws => "PAWS (point to point)",
            Self::PawsPivot => "PAWS (contact pivot)",
            Self::PawsLine => "PAWS (point to line, our reading)",
            Self::Usdnet => "USDNet (point to point, slides too)",
            Self::UsdnetMaoSt => "USDNet MAO_ST",
            Self::OpdMulti => "OPDMulti (10 deg, 0.25 object)",
            Self::S2o => "S2O (5 deg, 0.1 part)",
            Self::ArticulateAnything => "Articulate-Anything",
            Self::Strict => "STRICT (5 deg, 5 cm)",
            Self::Sim => "SIM (5 deg, 5 cm, sense, range)",
        }
    }

    /// Its name in files.
    #[must_use]
    pub fn key(self) -> &'static str {
        match self {
            Self::Paws => "paws",
            Self::PawsPivot => "paws_pivot",
            Self::PawsLine => "paws_line",
            Self::Usdnet => "usdnet",
            Self::UsdnetMaoSt => "usdnet_mao_st",
            Self::OpdMulti => "opd_multi",
            Self::S2o => "s2o",
            Self::ArticulateAnything => "articulate_anything",
            Self::Strict => "strict",
            Self::Sim => "sim",
        }
    }

    /// `[M, MA, MAO]` of one answered clip.
    #[must_use]
    pub fn judge(self, m: &AnswerErrors) -> [bool; 3] {
        let slide = m.kind == JointKind::Prismatic;
        let (axis, origin) = match self {
            Self::Paws => (m.axis_rad <= 15f64.to_radians(), slide || within(m.point_to_point_m, 0.25)),
            Self::PawsPivot => (m.axis_rad <= 15f64.to_radians(), slide || within(m.pivot_to_pivot_m, 0.25)),
            Self::PawsLine => (m.axis_rad <= 15f64.to_radians(), slide || within(m.truth_to_line_m, 0.25)),
            Self::Usdnet => (m.axis_rad < 15f64.to_radians(), below(m.point_to_point_m, 0.25)),
            Self::UsdnetMaoSt => (
                m.axis_rad < 15f64.to_radians(),
                slide || (below(m.origin_to_line_m, 0.25) && below(m.truth_to_line_m, 0.25)),
            ),
            Self::OpdMulti => (
                m.axis_rad <= 10f64.to_radians(),
                m.predicted_kind == JointKind::Prismatic
                    || m.object_diagonal_m.is_some_and(|d| within(m.origin_to_line_m, 0.25 * d)),
            ),
            Self::S2o => (
                m.axis_rad < 5f64.to_radians(),
                slide || m.part_diagonal_m.is_some_and(|d| below(m.origin_to_line_m, 0.1 * d)),
            ),
            Self::ArticulateAnything => {
                let origin = if slide { m.point_to_point_m } else { m.line_to_line_m };
                let placed = within(origin.map(|d| 0.5 * (d + m.axis_rad)), 0.05);
                let limits = 1.0 - m.signed_axis_rad.cos() <= 1.0 && m.motion_difference.is_none_or(|d| d <= 1.6057);
                (m.axis_rad <= 0.25, placed && limits)
            }
            Self::Strict => (m.axis_rad < 5f64.to_radians(), slide || below(m.truth_to_line_m, 0.05)),
            Self::Sim => (
                m.axis_rad <= 5f64.to_radians() && m.signed_axis_rad <= 5f64.to_radians(),
                (slide || within(m.truth_to_line_m, 0.05)) && range_serves(m),
            ),
        };
        let ma = m.type_right && axis;
        [m.type_right, ma, ma && origin]
    }
}

fn within(value: Option<f64>, limit: f64) -> bool {
    value.is_some_and(|v| v <= limit)
}

fn below(value: Option<f64>, limit: f64) -> bool {
    value.is_some_and(|v| v < limit)
}

/// Whether the range is near enough for a simulation: within 10 degrees or 5 cm.
#[must_use]
pub fn range_serves(m: &AnswerErrors) -> bool {
    let [turn, travel] = SIM_RANGE;
    within(m.range_error, if m.kind == JointKind::Prismatic { travel } else { turn })
}

/// USDNet's MO: type right, origin below 0.25 m from the true line whatever the axis; slides exempt.
#[must_use]
pub fn usdnet_mo(m: &AnswerErrors) -> bool {
    m.type_right && (m.kind == JointKind::Prismatic || below(m.origin_to_line_m, 0.25))
}

/// A measure that knows no right or wrong: mean axis and line errors.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum ErrorRule {
    /// DTA, PARIS, `ArtGS`: answers of the right type; distance between the lines (parallel up to a sine of 1e-6), slides
    /// count 0. `ArtGS` prints ten times the distance.
    Dta,
    /// Ditto: all answers, whatever the type; distance between the lines (parallel up to 1e-3), slides left out.
    Ditto,
    /// iTACO: all clips; distance between the lines without a guard, slides count 0; a missing answer or a wrong type counts
    /// pi/2 and 1 m.
    Itaco,
}

impl ErrorRule {
    /// All of them, in the order of the tables.
    pub const ALL: [Self; 3] = [Self::Dta, Self::Ditto, Self::Itaco];

    /// Its name in tables.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Dta => "DTA, PARIS, ArtGS",
            Self::Ditto => "Ditto",
            Self::Itaco => "iTACO",
        }
    }

    /// Axis error (radians, regardless of sign) and line error (metres) of one clip, `None` where the clip does not count.
    #[must_use]
    pub fn errors(self, measured: Option<&AnswerErrors>) -> [Option<f64>; 2] {
        let slide = |m: &AnswerErrors| m.kind == JointKind::Prismatic;
        match (self, measured) {
            (Self::Dta, Some(m)) if m.type_right => {
                [Some(m.axis_rad), if slide(m) { Some(0.0) } else { m.line_to_line_m }]
            }
            (Self::Ditto, Some(m)) => [Some(m.axis_rad), if slide(m) { None } else { m.line_to_line_coarse_m }],
            (Self::Itaco, Some(m)) if m.type_right => {
                [Some(m.axis_rad), Some(if slide(m) { 0.0 } else { m.line_to_line_unguarded_m.unwrap_or(1.0) })]
            }
            (Self::Itaco, _) => [Some(FRAC_PI_2), Some(1.0)],
            (Self::Dta | Self::Ditto, _) => [None; 2],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{Point, rotation};

    fn truth(kind: JointKind) -> TrueClip {
        TrueClip {
            joint: "j".to_owned(),
            kind,
            axis: Vector::z(),
            origin: Point::new(0.0, 0.0, 1.0),
            origin_handle: Point::new(0.0, 0.0, 0.5),
            moved: 1.0,
            // 0.72 m from corner to corner.
            part_box: Some(OrientedBox {
                center: Point::new(0.2, 0.0, 1.0),
                half: Vector::new(0.2, 0.01, 0.3),
                rotation: nalgebra::Matrix3::identity(),
            }),
            // Behind the part; 0.95 m from corner to corner together with it.
            base_box: Some(OrientedBox {
                center: Point::new(0.2, 0.31, 1.0),
                half: Vector::new(0.2, 0.3, 0.3),
                rotation: nalgebra::Matrix3::identity(),
            }),
            handle: Some(Point::new(0.35, 0.0, 0.5)),
            noun: None,
            action: None,
            orientation: None,
        }
    }

    fn prediction(kind: JointKind, axis: Vector, origin: Point) -> Prediction {
        Prediction {
            recording: "r".to_owned(),
            clip: "c".to_owned(),
            kind: Some(kind),
            axis: Some(axis),
            origin: Some(origin),
            contact_pivot: Some(Line { point: origin, direction: axis }.project(&Point::new(0.35, 0.0, 0.5))),
            range: Some(1.0),
            ..Prediction::default()
        }
    }

    /// A hinge measured against the true one through (0, 0, 1).
    fn hinge(axis: Vector, origin: Point) -> AnswerErrors {
        measure(&prediction(JointKind::Revolute, axis, origin), &truth(JointKind::Revolute)).unwrap()
    }

    fn slide(axis: Vector, origin: Point) -> AnswerErrors {
        measure(&prediction(JointKind::Prismatic, axis, origin), &truth(JointKind::Prismatic)).unwrap()
    }

    fn mao(m: &AnswerErrors) -> Vec<Rule> {
        Rule::ALL.into_iter().filter(|r| r.judge(m)[2]).collect()
    }

    /// The true axis tilted by some degrees about x.
    fn tilted(degrees: f64) -> Vector {
        rotation(&Vector::x(), degrees.to_radians()) * Vector::z()
    }

    #[test]
    fn a_right_joint_is_right_under_every_rule() {
        assert_eq!(mao(&hinge(Vector::z(), Point::new(0.0, 0.0, 1.0))), Rule::ALL);
        assert_eq!(mao(&slide(Vector::z(), Point::new(0.0, 0.0, 1.0))), Rule::ALL);
    }

    #[test]
    fn the_place_along_the_hinge_counts_point_to_point_only() {
        let along = hinge(Vector::z(), Point::new(0.0, 0.0, 0.6));
        let wrong: Vec<Rule> = Rule::ALL.into_iter().filter(|r| !r.judge(&along)[2]).collect();
        assert_eq!(wrong, [Rule::Paws, Rule::Usdnet]);
        assert_eq!(Rule::Paws.judge(&along), [true, true, false]);
    }

    #[test]
    fn opening_inward_is_seen_by_the_two_rules_with_a_sense() {
        let inward = hinge(-Vector::z(), Point::new(0.0, 0.0, 1.0));
        assert_eq!(Rule::Paws.judge(&inward), [true; 3]);
        assert_eq!(Rule::Sim.judge(&inward), [true, false, false]);
        assert_eq!(Rule::ArticulateAnything.judge(&inward), [true, true, false]);
        assert_eq!(Rule::ALL.len() - mao(&inward).len(), 2);
    }

    #[test]
    fn a_hinge_beside_its_place_meets_one_limit_after_the_other() {
        let beside = |d: f64| mao(&hinge(Vector::z(), Point::new(d, 0.0, 1.0)));
        // 6 cm: below a tenth of the part (7.2 cm) and of twice AA's 5 cm.
        assert!(!beside(0.06).contains(&Rule::Strict) && !beside(0.06).contains(&Rule::Sim));
        assert!(beside(0.06).contains(&Rule::S2o) && beside(0.06).contains(&Rule::ArticulateAnything));
        assert!(!beside(0.08).contains(&Rule::S2o) && beside(0.08).contains(&Rule::ArticulateAnything));
        assert!(!beside(0.11).contains(&Rule::ArticulateAnything));
        // 24.5 cm: above a quarter of the object (23.8 cm), below 25 cm.
        assert_eq!(beside(0.245), [Rule::Paws, Rule::PawsPivot, Rule::PawsLine, Rule::Usdnet, Rule::UsdnetMaoSt]);
        assert!(beside(0.26).is_empty());
    }

    #[test]
    fn angles_have_limits_of_5_10_and_15_degrees_and_a_quarter_radian() {
        let ma = |degrees: f64| {
            let m = hinge(tilted(degrees), Point::new(0.0, 0.0, 1.0));
            Rule::ALL.into_iter().filter(|r| r.judge(&m)[1]).collect::<Vec<_>>()
        };
        let strict = [Rule::S2o, Rule::Strict, Rule::Sim];
        assert!(strict.iter().all(|r| ma(4.9).contains(r) && !ma(5.1).contains(r)));
        assert!(ma(9.9).contains(&Rule::OpdMulti) && !ma(10.1).contains(&Rule::OpdMulti));
        assert!(ma(14.2).contains(&Rule::ArticulateAnything) && !ma(14.5).contains(&Rule::ArticulateAnything));
        assert_eq!(ma(14.9), [Rule::Paws, Rule::PawsPivot, Rule::PawsLine, Rule::Usdnet, Rule::UsdnetMaoSt]);
    }

    #[test]
    fn a_slide_needs_an_origin_where_it_is_not_exempt() {
        let off = slide(Vector::z(), Point::new(1.0, 0.0, 1.0));
        let wrong: Vec<Rule> = Rule::ALL.into_iter().filter(|r| !r.judge(&off)[2]).collect();
        assert_eq!(wrong, [Rule::Usdnet, Rule::ArticulateAnything]);
        assert!(usdnet_mo(&off));
    }

    #[test]
    fn usdnets_mo_does_not_look_at_the_axis() {
        let lying = hinge(Vector::x(), Point::new(0.0, 0.0, 0.6));
        assert!(usdnet_mo(&lying) && !Rule::Usdnet.judge(&lying)[1]);
        assert!(!usdnet_mo(&hinge(Vector::z(), Point::new(0.3, 0.0, 1.0))));
    }

    #[test]
    fn a_tilted_line_with_a_far_origin_is_told_from_both_sides() {
        // The origin lies on the true line, 2 m above the part; at the part the line is 31 cm off.
        let far = hinge(tilted(9.0), Point::new(0.0, 0.0, 3.0));
        assert!(far.origin_to_line_m.unwrap() < 1e-9 && far.truth_to_line_m.unwrap() > 0.3);
        assert!(Rule::OpdMulti.judge(&far)[1]);
        assert!(!Rule::UsdnetMaoSt.judge(&far)[2] && !Rule::PawsLine.judge(&far)[2]);
    }

    #[test]
    fn the_distance_between_lines_is_blind_within_their_plane() {
        // 40 cm off in the plane of the tilt: the lines meet somewhere far away, the door hangs beside its cabinet.
        let off = hinge(tilted(0.01), Point::new(0.0, 0.4, 1.0));
        assert!(off.line_to_line_m.unwrap() < 1e-9, "{off:?}");
        assert!((off.truth_to_line_m.unwrap() - 0.4).abs() < 1e-6);
        assert_eq!(ErrorRule::Dta.errors(Some(&off))[1], off.line_to_line_m);
        // Ditto's guard calls so small a tilt parallel.
        assert!((off.line_to_line_coarse_m.unwrap() - 0.4).abs() < 1e-6);
        let parallel = hinge(Vector::z(), Point::new(0.0, 0.4, 1.0));
        assert!((parallel.line_to_line_m.unwrap() - 0.4).abs() < 1e-12);
        assert!((parallel.line_to_line_unguarded_m.unwrap() - 0.4).abs() < 1e-12);
    }

    #[test]
    fn failures_count_under_itaco_alone() {
        let wrong = measure(
            &prediction(JointKind::Prismatic, Vector::z(), Point::new(0.0, 0.0, 1.0)),
            &truth(JointKind::Revolute),
        );
        assert_eq!(ErrorRule::Itaco.errors(None), [Some(FRAC_PI_2), Some(1.0)]);
        assert_eq!(ErrorRule::Itaco.errors(wrong.as_ref()), [Some(FRAC_PI_2), Some(1.0)]);
        assert_eq!(ErrorRule::Dta.errors(wrong.as_ref()), [None; 2]);
        assert_eq!(ErrorRule::Ditto.errors(None), [None; 2]);
        assert_eq!(ErrorRule::Ditto.errors(wrong.as_ref())[0], Some(0.0));
        let wrong = wrong.unwrap();
        assert!(Rule::ALL.iter().all(|r| r.judge(&wrong) == [false; 3]));
        assert!(wrong.range_error.is_none() && wrong.motion_difference.is_none());
    }

    #[test]
    fn radius_box_and_range_are_measured_on_the_true_part() {
        let mut answer = prediction(JointKind::Revolute, Vector::z(), Point::new(0.05, 0.0, 1.0));
        answer.range = Some(1.3);
        let mut part = truth(JointKind::Revolute).part_box.unwrap();
        part.half.x += 0.02;
        part.center.x += 0.05;
        answer.part_box = Some(part);
        let m = measure(&answer, &truth(JointKind::Revolute)).unwrap();
        assert!((m.radius_error_m.unwrap() - 0.05).abs() < 1e-12);
        assert!((m.box_edge_m.unwrap() - 0.07).abs() < 1e-12, "{m:?}");
        assert!((m.range_error.unwrap() - 0.3).abs() < 1e-12 && !range_serves(&m));
        let [part, object] = [m.part_diagonal_m, m.object_diagonal_m].map(Option::unwrap);
        assert!((part - 0.7213).abs() < 1e-3 && (object - 0.9510).abs() < 1e-3, "{m:?}");
    }

    #[test]
    fn without_the_parts_box_only_the_rules_that_need_it_say_no() {
        let truth = TrueClip { part_box: None, ..truth(JointKind::Revolute) };
        let m = measure(&prediction(JointKind::Revolute, Vector::z(), Point::new(0.0, 0.0, 1.0)), &truth).unwrap();
        let wrong: Vec<Rule> = Rule::ALL.into_iter().filter(|r| !r.judge(&m)[2]).collect();
        assert_eq!(wrong, [Rule::OpdMulti, Rule::S2o]);
        assert!(m.part_diagonal_m.is_none() && m.box_iou.is_none());
    }
}
