//! Two sets of predictions for the same clips.

use serde::Serialize;

use super::bootstrap::interval;
use super::clip_report::clusters;
use super::rules::Rule;
use super::summary::{EvaluationReport, Shares, SharesInterval};

/// The first predictions against the second under one rule.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Paired {
    /// The rule.
    pub rule: Rule,
    /// Shares of all clips of the first minus those of the second.
    pub difference: Shares,
    /// 95 % interval of the difference; the clips of a joint are drawn together.
    pub interval: Option<SharesInterval>,
    /// Clips whose MAO is right in the first only.
    pub better: usize,
    /// Clips whose MAO is right in the second only.
    pub worse: usize,
}

/// Compares two reports clip by clip; `None` where they are not about the same clips, or about none.
#[must_use]
pub fn compare(first: &EvaluationReport, second: &EvaluationReport) -> Option<Vec<Paired>> {
    let clips = &first.per_clip;
    let same = clips.len() == second.per_clip.len()
        && clips.iter().zip(&second.per_clip).all(|(a, b)| (&a.recording, &a.clip) == (&b.recording, &b.clip));
    if !same || clips.is_empty() {
        return None;
    }
    let paired = |rule: Rule| {
        let verdicts: Vec<[[bool; 3]; 2]> =
            clips.iter().zip(&second.per_clip).map(|(a, b)| [a.judge(rule), b.judge(rule)]).collect();
        let step = |level: usize, i: usize| {
            let [a, b] = verdicts[i];
            f64::from(i8::from(a[level]) - i8::from(b[level]))
        };
        let mean = |level: usize| (0..clips.len()).map(|i| step(level, i)).sum::<f64>() / clips.len() as f64;
        let drawn = |level: usize| interval(&clusters(clips, |i| step(level, i)));
        Paired {
            rule,
            difference: Shares { m: mean(0), ma: mean(1), mao: mean(2) },
            interval: SharesInterval::of([drawn(0), drawn(1), drawn(2)]),
            better: verdicts.iter().filter(|[a, b]| a[2] && !b[2]).count(),
            worse: verdicts.iter().filter(|[a, b]| b[2] && !a[2]).count(),
        }
    };
    Some(Rule::ALL.into_iter().map(paired).collect())
}
