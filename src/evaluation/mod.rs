//! Predictions against truth under named rules, because "MAO" alone is not one number.

pub mod bootstrap;
pub mod calibration;
pub mod clip_report;
pub mod coverage;
pub mod deviations;
pub mod discrimination;
pub mod failures;
pub mod frame_contradictions;
pub mod front_errors;
pub mod likeness;
pub mod paired;
pub mod pixels;
pub mod point_parts;
pub mod room_fit;
pub mod rules;
pub mod scenes;
pub mod shots;
pub mod siblings;
pub mod stages;
pub mod summary;
pub mod surface_scores;
pub mod truth;

pub use paired::{Paired, compare};
pub use rules::{AnswerErrors, ErrorRule, Rule};
pub use summary::{EvaluationReport, evaluate};
pub use truth::{Prediction, Predictions, Stage, Truth};
