//! paws-twin: from an egocentric recording of opened doors and drawers to a kitchen that simulates.
#![forbid(unsafe_code)]
pub mod articulation;
pub mod cli;
pub mod config;
pub mod error;
pub mod evaluation;
pub mod export;
pub mod fitting;
pub mod geometry;
pub mod hands;
pub mod inference;
pub mod localization;
pub mod math;
pub mod pipeline;
pub mod reasoning;
pub mod recording;
pub mod report;
pub mod synth;
pub mod twin;
pub mod validation;
