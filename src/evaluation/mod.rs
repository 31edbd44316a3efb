//! Predictions against truth under named rules, because "MAO" alone is not one number.

pub mod bootstrap;
pub mod calibration;
pub mod coverage;
pub mod deviations;
pub mod discrimination;
pub mod failures;
pub mod paired;
pub mod parts;
pub mod rules;
pub mod scenes;
pub mod siblings;
pub mod stages;
pub mod summary;
pub mod truth;

pub use paired::{Paired, compare};
pub use rules::{ErrorRule, Measured, Rule};
pub use summary::{Report, evaluate};
pub use truth::{Prediction, Predictions, Stage, Truth};
