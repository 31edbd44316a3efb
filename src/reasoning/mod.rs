//! The two questions of §3.3 and §A.6: how does the part move, and which of the lines could be its hinge?
//!
//! Whoever answers does so through [`Reasoner`]. [`heuristic::Geometric`] answers without any network (the paper's row
//! "w/o GPT-4o"); its absence of a language model is a normal mode of work.

pub mod heuristic;

use serde::{Deserialize, Serialize};

use crate::geometry::AxisCandidate;
use crate::math::Point;
use crate::recording::narration::Reading;

/// What is known when the questions are asked.
#[derive(Debug, Clone, Copy)]
pub struct Question<'a> {
    /// What the narration says.
    pub reading: &'a Reading,
    /// The hand's smoothed path, world.
    pub path: &'a [Point],
    /// The grip at the closed end.
    pub grip: Point,
    /// All axes that the part could have.
    pub candidates: &'a [AxisCandidate],
    /// For each candidate how well it explains the depth of the open state: the share of moved points seen in their place,
    /// and how many there were (see [`crate::geometry::moved::agreement`]).
    pub agreement: &'a [(f64, usize)],
    /// Width and height of the moving part and the grip's place in it (-0.5..0.5 to the right and up), where known.
    pub part: Option<PartShape>,
}

/// Shape of the moving part's front and where it is held.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct PartShape {
    /// Width and height, metres.
    pub size_m: [f64; 2],
    /// Place of the grip: right and up of the middle, as shares of width and height.
    pub grip: [f64; 2],
}

/// The motion type with its probability, and each candidate's weight as an explanation.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Answer {
    /// Probability that the part turns (1 - it slides).
    pub revolute_probability: f64,
    /// For each candidate: log weight, higher is more plausible; minus infinity rules it out.
    pub log_weights: Vec<f64>,
}

/// Whoever answers.
pub trait Reasoner: Sync {
    /// Answers both questions for one clip.
    fn answer(&self, question: &Question) -> Answer;

    /// Its name, for the evidence.
    fn name(&self) -> &'static str;
}
