//! Predictions against truth under named rules, because "MAO" alone is not one number.

pub mod rules;
pub mod stages;
pub mod summary;
pub mod truth;

pub use rules::{Measured, Rule};
pub use summary::{Report, evaluate};
pub use truth::{Prediction, Predictions, Truth};
