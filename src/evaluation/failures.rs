//! Why a clip is not right: the first of the reasons that applies.

use std::f64::consts::FRAC_PI_2;

use serde::Serialize;

use super::rules::{AnswerErrors, Rule, range_serves};
use super::truth::{Prediction, Stage};
use crate::articulation::JointKind;

/// What became of a clip under the paper's limits with our reading of the origin ([`Rule::PawsLine`]). The last three are
/// right under that rule; a simulation wants more of them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Failure {
    /// No hand, or too little of it.
    NoHand,
    /// The hand is known, the furniture is not.
    NotLocalised,
    /// No joint explains the hand, or nobody says where the answer was lost.
    Abstained,
    /// A hinge taken for a slide, or the other way round.
    WrongType,
    /// A slide whose direction is off by more than 15 degrees.
    SlideDirection,
    /// A hinge whose direction is off by more than 15 degrees.
    HingeDirection,
    /// A hinge of the right direction, more than 25 cm beside the true one.
    HingeBeside,
    /// A right axis with the wrong sense.
    OpensWrongWay,
    /// A range that is off by more than 10 degrees or 5 cm, or was not given.
    Range,
    /// Nothing is wrong.
    Right,
}

impl Failure {
    /// All of them, in the order in which they are looked for.
    pub const ALL: [Self; 10] = [
        Self::NoHand,
        Self::NotLocalised,
        Self::Abstained,
        Self::WrongType,
        Self::SlideDirection,
        Self::HingeDirection,
        Self::HingeBeside,
        Self::OpensWrongWay,
        Self::Range,
        Self::Right,
    ];

    /// The words for people.
    #[must_use]
    pub fn words(self) -> &'static str {
        match self {
            Self::NoHand => "no hand",
            Self::NotLocalised => "not localised",
            Self::Abstained => "no candidates / abstained",
            Self::WrongType => "wrong type",
            Self::SlideDirection => "slide along a wrong axis",
            Self::HingeDirection => "hinge along a wrong direction",
            Self::HingeBeside => "hinge beside its place",
            Self::OpensWrongWay => "opens the wrong way",
            Self::Range => "range",
            Self::Right => "ok",
        }
    }

    /// Why a clip is not right, or that it is; a clip without a row has abstained.
    #[must_use]
    pub fn of(prediction: Option<&Prediction>, measured: Option<&AnswerErrors>) -> Self {
        let Some(m) = measured else {
            return match prediction.and_then(|p| p.stage) {
                Some(Stage::Hands) => Self::NoHand,
                Some(Stage::Localization) => Self::NotLocalised,
                Some(Stage::Inference) | None => Self::Abstained,
            };
        };
        let [type_right, axis_right, all_right] = Rule::PawsLine.judge(m);
        match m.kind {
            _ if !type_right => Self::WrongType,
            JointKind::Prismatic if !axis_right => Self::SlideDirection,
            JointKind::Revolute if !axis_right => Self::HingeDirection,
            _ if !all_right => Self::HingeBeside,
            _ if m.signed_axis_rad > FRAC_PI_2 => Self::OpensWrongWay,
            _ if !range_serves(m) => Self::Range,
            _ => Self::Right,
        }
    }
}

/// How many clips came to one end.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct FailureCount {
    /// The end.
    pub failure: Failure,
    /// Clips.
    pub clips: usize,
    /// Share of all clips that move a joint.
    pub share: f64,
    /// Median distance of those hinges from the true one at the part, metres; for [`Failure::HingeBeside`] only.
    pub beside_m: Option<f64>,
}
