//! The two questions of §3.3 and §A.6: how does the part move, and which of the lines could be its hinge?
//!
//! Whoever answers does so through [`Reasoner`]. [`heuristic::Geometric`] answers without any network (the paper's row
//! "w/o GPT-4o"); its absence of a language model is a normal mode of work. [`asking::Asking`] asks one as well (feature `prompts`), and adds
//! what it says to the evidence.

pub mod answers;
#[cfg(feature = "prompts")]
pub mod asking;
pub mod heuristic;
pub mod marks;
#[cfg(feature = "prompts")]
pub mod naming;
#[cfg(feature = "prompts")]
pub mod prompts;
pub mod words;

use serde::{Deserialize, Serialize};

use crate::articulation::{Articulation, JointKind};
use crate::config;
use crate::error::Result;
use crate::geometry::{AxisCandidate, Face};
use crate::math::{Point, Vector, path, stats};
use crate::recording::narration::Reading;

/// What is known when the questions are asked.
#[derive(Debug, Clone, Copy)]
pub struct Question<'a> {
    /// What the narration says.
    pub reading: &'a Reading,
    /// What a language model says, where one was asked.
    pub words: Option<&'a words::Words>,
    /// The hand's smoothed path, world.
    pub path: &'a [Point],
    /// The grip at the closed end.
    pub grip: Point,
    /// All axes that the part could have.
    pub candidates: &'a [AxisCandidate],
    /// For each candidate how well it explains the depth of the open state, in nats (see [`crate::part::likelihood::log_likelihood`]).
    pub agreement: &'a [f64],
    /// Width and height of the moving part and the grip's place in it (-0.5..0.5 to the right and up), where known.
    pub part: Option<PartShape>,
    /// The touched face, where one was found.
    pub face: Option<&'a Face>,
    /// Against gravity, unit.
    pub up: Vector,
}

/// The furniture's name: the narration's; where people said "it", what a language model saw.
#[must_use]
pub fn furniture<'a>(reading: &'a Reading, words: Option<&'a words::Words>) -> Option<&'a str> {
    reading.furniture.as_deref().or_else(|| words?.furniture.as_deref())
}

/// Shape of the moving part's front and where it is held.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct PartShape {
    /// Width and height, metres.
    pub size_m: [f64; 2],
    /// Place of the grip: right and up of the middle, as shares of width and height.
    pub grip: [f64; 2],
}

/// What speaks for each candidate: the evidence of the clip, apart from what was believed before.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Answer {
    /// For each candidate the log likelihood of what was seen; minus infinity rules it out.
    pub log_likelihoods: Vec<f64>,
    /// For each candidate its log prior.
    pub log_priors: Vec<f64>,
    /// Log odds of a hinge over a slide from words alone (the furniture's name, a language model).
    pub words_log_odds: f64,
}

impl Answer {
    /// Log weight of each candidate: likelihood times prior.
    #[must_use]
    pub fn log_weights(&self) -> Vec<f64> {
        self.log_likelihoods.iter().zip(&self.log_priors).map(|(l, p)| l + p).collect()
    }

    /// Probability that the part turns: the mass of all hinges against that of all slides, and the words.
    #[must_use]
    pub fn revolute_probability(&self, candidates: &[AxisCandidate]) -> f64 {
        let weights = self.log_weights();
        let mass = |kind: JointKind| {
            let of_kind: Vec<f64> =
                candidates.iter().zip(&weights).filter(|(c, _)| c.joint.kind == kind).map(|(_, w)| *w).collect();
            stats::log_sum(&of_kind)
        };
        let odds = mass(JointKind::Revolute) - mass(JointKind::Prismatic) + self.words_log_odds;
        // Neither type has a candidate: nothing is known.
        if odds.is_nan() { 0.5 } else { 1.0 / (1.0 + (-odds).exp()) }
    }

    /// Answers about the same candidates from several clips of one part: the clips' evidence adds up, what was believed
    /// before counts once, and so do the words (one person names the same furniture each time).
    #[must_use]
    pub fn together(answers: &[Self]) -> Option<Self> {
        let first = answers.first()?;
        let count = answers.len() as f64;
        let sum = |pick: fn(&Self) -> &Vec<f64>| -> Vec<f64> {
            (0..pick(first).len()).map(|i| answers.iter().map(|a| pick(a)[i]).sum()).collect()
        };
        Some(Self {
            log_likelihoods: sum(|a| &a.log_likelihoods),
            log_priors: sum(|a| &a.log_priors).iter().map(|p| p / count).collect(),
            words_log_odds: answers.iter().map(|a| a.words_log_odds).sum::<f64>() / count,
        })
    }
}

/// Whoever answers.
pub trait Reasoner: Sync {
    /// What a language model says about a clip; `None` where none is asked.
    ///
    /// # Errors
    /// What must end the run: see [`crate::vlm::LanguageModel::ask`].
    fn words(&self, _sight: &words::AskedClip) -> Result<Option<words::Words>> {
        Ok(None)
    }

    /// Answers both questions for one clip.
    fn answer(&self, question: &Question) -> Answer;

    /// Its name, for the evidence.
    fn name(&self) -> &'static str;
}
/// How well a hand's path fits a joint, nats up to a constant: heavy-tailed, with as many independent samples as a correlated
/// hand track is worth. Minus infinity for a hinge that no hand of such a part is so near to, or so far from.
#[must_use]
pub fn path_log_likelihood(
    joint: &Articulation,
    path: &[Point],
    reasoning: &config::Reasoning,
    inference: &config::Inference,
) -> f64 {
    let variance = match joint.kind {
        JointKind::Prismatic => path::across(path, &joint.axis),
        JointKind::Revolute => path::about_line(path, &joint.line())
            .filter(|fit| (inference.min_radius_m..=inference.max_radius_m).contains(&fit.radius))
            .map(|fit| fit.variance()),
    };
    variance.map_or(f64::NEG_INFINITY, |variance| beside_log_likelihood(variance, path.len(), reasoning))
}

/// The same for a path of so many samples that lies beside a motion by this mean square, m^2.
#[must_use]
pub fn beside_log_likelihood(variance: f64, samples: usize, reasoning: &config::Reasoning) -> f64 {
    let samples = reasoning.effective_samples.min(samples as f64);
    -samples * (1.0 + variance / (2.0 * reasoning.hand_std_m.powi(2))).ln()
}
