//! How far answers are off, where a share of right ones says too little.

use std::collections::BTreeMap;
use std::f64::consts::FRAC_PI_2;

use serde::Serialize;

use super::clip_report::ClipReport;
use super::rules::{AnswerErrors, ErrorRule};
use crate::articulation::JointKind;
use crate::math::stats;

/// Middle and tail of an error.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Spread {
    /// Values.
    pub count: usize,
    /// Median.
    pub median: f64,
    /// Nine of ten are at most this.
    pub p90: f64,
}

impl Spread {
    /// Of values; `None` without any.
    #[must_use]
    pub fn of(values: &[f64]) -> Option<Self> {
        Some(Self { count: values.len(), median: stats::median(values)?, p90: stats::quantile(values, 0.9)? })
    }
}

/// Errors of the answers whose type is right, for one type.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Deviations {
    /// The type.
    pub kind: JointKind,
    /// Answers of that type that are right in it.
    pub answers: usize,
    /// Angle between the axes regardless of sign, radians.
    pub axis_rad: Option<Spread>,
    /// Share whose axis points to the right side: less than 90 degrees with its sense.
    pub sense_right: Option<f64>,
    /// Distance of the true origin from the predicted hinge, metres; hinges only.
    pub line_m: Option<Spread>,
    /// Difference between the ranges moved, rad or m.
    pub range: Option<Spread>,
    /// Difference between the true handle's distances from the two hinges, metres; hinges only.
    pub radius_m: Option<Spread>,
    /// Intersection over union of the part boxes; `p90` is of the overlap, not of an error.
    pub box_iou: Option<Spread>,
    /// Largest offset of the part box's faces, metres.
    pub box_edge_m: Option<Spread>,
}

/// Errors by type, hinges first.
#[must_use]
pub fn deviations(clips: &[ClipReport]) -> Vec<Deviations> {
    [JointKind::Revolute, JointKind::Prismatic].into_iter().map(|kind| of_kind(clips, kind)).collect()
}

fn of_kind(clips: &[ClipReport], kind: JointKind) -> Deviations {
    let right: Vec<&AnswerErrors> =
        clips.iter().filter_map(|c| c.measured.as_ref()).filter(|m| m.type_right && m.kind == kind).collect();
    let spread = |value: fn(&AnswerErrors) -> Option<f64>| {
        Spread::of(&right.iter().filter_map(|m| value(m)).collect::<Vec<f64>>())
    };
    let turns = kind == JointKind::Revolute;
    let outward = right.iter().filter(|m| m.signed_axis_rad < FRAC_PI_2).count();
    Deviations {
        kind,
        answers: right.len(),
        axis_rad: spread(|m| Some(m.axis_rad)),
        sense_right: (!right.is_empty()).then(|| outward as f64 / right.len() as f64),
        line_m: if turns { spread(|m| m.truth_to_line_m) } else { None },
        range: spread(|m| m.range_error),
        radius_m: spread(|m| m.radius_error_m),
        box_iou: spread(|m| m.box_iou),
        box_edge_m: spread(|m| m.box_edge_m),
    }
}

/// Axis and line errors as another benchmark averages them.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct MeanErrors {
    /// Whose measure.
    pub rule: ErrorRule,
    /// Clips that count.
    pub clips: usize,
    /// Mean angle between the axes, radians.
    pub axis_mean_rad: Option<f64>,
    /// Median angle, radians.
    pub axis_median_rad: Option<f64>,
    /// Mean distance, metres.
    pub line_mean_m: Option<f64>,
    /// Median distance, metres.
    pub line_median_m: Option<f64>,
}

/// The errors under every rule that averages them.
#[must_use]
pub fn mean_errors(clips: &[ClipReport]) -> Vec<MeanErrors> {
    ErrorRule::ALL
        .into_iter()
        .map(|rule| {
            let errors: Vec<[Option<f64>; 2]> = clips.iter().map(|c| rule.errors(c.measured.as_ref())).collect();
            let axis: Vec<f64> = errors.iter().filter_map(|e| e[0]).collect();
            let line: Vec<f64> = errors.iter().filter_map(|e| e[1]).collect();
            MeanErrors {
                rule,
                clips: axis.len(),
                axis_mean_rad: stats::mean(&axis),
                axis_median_rad: stats::median(&axis),
                line_mean_m: stats::mean(&line),
                line_median_m: stats::median(&line),
            }
        })
        .collect()
}

/// Pairs of clips of one place that show one joint, by the truth and by the predictions. Clips that move no joint are
/// left out.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Pairs {
    /// Pairs that truly show one joint.
    pub true_pairs: usize,
    /// Pairs that were said to.
    pub predicted_pairs: usize,
    /// Pairs that are both.
    pub both: usize,
    /// Both of predicted.
    pub precision: Option<f64>,
    /// Both of true.
    pub recall: Option<f64>,
}

/// Whether clips of one joint were recognised as such; `None` where no prediction names a joint.
#[must_use]
pub fn pairs(clips: &[ClipReport]) -> Option<Pairs> {
    if clips.iter().all(|c| c.predicted_joint.is_none()) {
        return None;
    }
    let mut by_place: BTreeMap<&str, Vec<&ClipReport>> = BTreeMap::new();
    for c in clips {
        by_place.entry(c.home()).or_default().push(c);
    }
    // Joints of two recordings that were judged apart are two, whatever they are called.
    let one_scene = |a: &ClipReport, b: &ClipReport| {
        a.predicted_scene == b.predicted_scene && (a.predicted_scene.is_some() || a.recording == b.recording)
    };
    let (mut true_pairs, mut predicted_pairs, mut both) = (0, 0, 0);
    for clips in by_place.values() {
        for (i, a) in clips.iter().enumerate() {
            for b in &clips[i + 1..] {
                let truly = a.joint == b.joint;
                let said = a.predicted_joint.is_some() && a.predicted_joint == b.predicted_joint && one_scene(a, b);
                true_pairs += usize::from(truly);
                predicted_pairs += usize::from(said);
                both += usize::from(truly && said);
            }
        }
    }
    let share = |of: usize| (of > 0).then(|| both as f64 / of as f64);
    Some(Pairs { true_pairs, predicted_pairs, both, precision: share(predicted_pairs), recall: share(true_pairs) })
}
