//! A language model that knows the truth and errs as often as it is told to: for tests and tables of accuracy. It is no part of
//! the library, whose inference knows no truth.

use std::collections::BTreeMap;

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

use paws_twin::articulation::{Articulation, JointKind};
use paws_twin::error::Result;
use paws_twin::geometry::LineTrack;
use paws_twin::math::unsigned_angle;
use paws_twin::reasoning::heuristic::Geometric;
use paws_twin::reasoning::words::{AskedClip, LineVote, Words};
use paws_twin::reasoning::{Answer, Question, Reasoner};

/// How a simulated model errs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Errors {
    /// In this share of clips it is wrong about the type, and about the hinge, each by chance. Within a clip it errs as
    /// models do: most frames say the same.
    Random {
        /// Share of clips of which it gets the type wrong.
        kind: f64,
        /// Share of clips in which it names a line at random.
        line: f64,
    },
    /// It always says this type and always names the line that was offered first.
    Always(JointKind),
}

/// Frames that it is shown of each clip, and views of each line.
const FRAMES: usize = 10;
const VIEWS: usize = 10;

/// What such a model says of a clip whose joint is of the type `truth`, its hinge being `hinge` of `lines` lines (`None`
/// where no line is the hinge).
#[must_use]
pub fn words(truth: JointKind, hinge: Option<usize>, lines: usize, errors: Errors, seed: u64) -> Words {
    // Of the frames three in ten show too little, and one in ten of the others disagrees.
    const UNKNOWN: f64 = 0.3;
    const STRAY: f64 = 0.1;
    // Lines beside the hinge that a model takes for one, too.
    const PARALLEL: f64 = 0.3;
    let mut rng = Pcg64Mcg::seed_from_u64(seed);
    let other = |kind: JointKind| match kind {
        JointKind::Revolute => JointKind::Prismatic,
        JointKind::Prismatic => JointKind::Revolute,
    };
    let (opinion, named) = match errors {
        Errors::Always(kind) => (kind, (lines > 0).then_some(0)),
        Errors::Random { kind, line } => {
            let opinion = if rng.random_bool(kind) { other(truth) } else { truth };
            let wrong = rng.random_bool(line);
            let named = if wrong && lines > 0 { Some(rng.random_range(0..lines)) } else { hinge };
            (opinion, named)
        }
    };
    let mut words = Words { summary: Some(opinion), ..Words::default() };
    for _ in 0..FRAMES {
        let said =
            if matches!(errors, Errors::Random { .. }) && rng.random_bool(STRAY) { other(opinion) } else { opinion };
        if rng.random_bool(UNKNOWN) {
            words.unknown += 1;
        } else if said == JointKind::Revolute {
            words.revolute += 1;
        } else {
            words.prismatic += 1;
        }
    }
    // What is called a slide is not asked for its hinge.
    if opinion == JointKind::Prismatic {
        return words;
    }
    for line in 0..lines {
        let chosen = if named == Some(line) {
            rng.random_range(VIEWS / 2..=VIEWS)
        } else if rng.random_bool(PARALLEL) {
            rng.random_range(0..=VIEWS / 2)
        } else {
            0
        };
        words.lines.push(LineVote { line, offered: VIEWS, chosen });
    }
    words
}

/// The geometric heuristic with a simulated model's words as further evidence.
#[derive(Debug, Clone)]
pub struct Simulated<'a> {
    /// Weighs everything.
    pub geometric: &'a Geometric,
    /// The true joint of each clip, by name; the model is silent about others.
    pub truth: BTreeMap<String, Articulation>,
    /// How the model errs.
    pub errors: Errors,
    /// Seed of its errors.
    pub seed: u64,
}

impl Reasoner for Simulated<'_> {
    fn words(&self, sight: &AskedClip) -> Result<Option<Words>> {
        let Some(joint) = self.truth.get(&sight.clip.clip) else { return Ok(None) };
        // Every clip its own errors, the same on every run.
        let seed = sight.clip.clip.bytes().fold(self.seed, |seed, b| seed.wrapping_mul(31).wrapping_add(u64::from(b)));
        Ok(Some(words(joint.kind, hinge(joint, sight.lines), sight.lines.len(), self.errors, seed)))
    }

    fn answer(&self, question: &Question) -> Answer {
        self.geometric.answer(question)
    }

    fn name(&self) -> &'static str {
        "geometric heuristic with a simulated language model"
    }
}

/// The line that is the hinge: along it and within a few centimetres.
fn hinge(joint: &Articulation, lines: &[LineTrack]) -> Option<usize> {
    const ANGLE_RAD: f64 = 0.17;
    const DISTANCE_M: f64 = 0.06;
    if joint.kind == JointKind::Prismatic {
        return None;
    }
    let distance = |line: &LineTrack| joint.line().distance(&line.segment.middle());
    (0..lines.len())
        .filter(|&i| unsigned_angle(&lines[i].segment.line.direction, &joint.axis) < ANGLE_RAD)
        .filter(|&i| distance(&lines[i]) < DISTANCE_M)
        .min_by(|&a, &b| distance(&lines[a]).total_cmp(&distance(&lines[b])))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_errs_as_often_as_it_is_told_to() {
        let reasoning = paws_twin::config::Reasoning::default();
        let share = |errors: Errors| {
            let wrong = (0..400)
                .filter(|&seed| words(JointKind::Revolute, Some(2), 5, errors, seed).log_odds(&reasoning) < 0.0);
            wrong.count() as f64 / 400.0
        };
        assert!(share(Errors::Random { kind: 0.0, line: 0.0 }) < 0.01);
        assert!((share(Errors::Random { kind: 0.3, line: 0.0 }) - 0.3).abs() < 0.08);
        assert_eq!(share(Errors::Always(JointKind::Prismatic)), 1.0);
        assert_eq!(share(Errors::Always(JointKind::Revolute)), 0.0);
        let named = words(JointKind::Revolute, Some(2), 5, Errors::Random { kind: 0.0, line: 0.0 }, 1).named(5);
        assert!(named[2] >= 0.5 && (0..5).all(|i| named[i] <= named[2]), "{named:?}");
    }

    #[test]
    fn the_same_seed_says_the_same() {
        let say = |seed: u64| words(JointKind::Prismatic, None, 3, Errors::Random { kind: 0.5, line: 0.5 }, seed);
        assert_eq!(say(7), say(7));
        assert!((0..50).any(|seed| say(seed) != say(7)));
    }
}
