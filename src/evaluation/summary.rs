//! Counts over clips and recordings: conditional and unconditional, micro and macro.

use std::collections::BTreeMap;

use serde::Serialize;

use super::rules::{Measured, Rule, measure};
use super::truth::{Prediction, Predictions, Truth};

/// Shares under one rule.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Shares {
    /// Type right.
    pub m: f64,
    /// Type and axis right.
    pub ma: f64,
    /// Type, axis and origin right.
    pub mao: f64,
}

/// One rule's numbers.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RuleReport {
    /// The rule.
    pub rule: Rule,
    /// Of all clips that move a joint; a missing answer is wrong. Pooled over recordings.
    pub micro: Shares,
    /// Of the answered clips only (the paper's dagger). Pooled.
    pub micro_conditional: Option<Shares>,
    /// Mean over recordings of the unconditional shares.
    pub macro_: Shares,
    /// Mean over recordings of the conditional shares.
    pub macro_conditional: Option<Shares>,
}

/// One clip's line in the report.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ClipReport {
    /// Recording.
    pub recording: String,
    /// Clip.
    pub clip: String,
    /// True joint.
    pub joint: String,
    /// Distances and angles; null where there was no answer.
    pub measured: Option<Measured>,
    /// Why there was no answer.
    pub reason: Option<String>,
}

/// The whole evaluation.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Report {
    /// Clips that move a joint.
    pub clips: usize,
    /// Of them, answered.
    pub answered: usize,
    /// The paper's Match: answered / clips, micro.
    pub match_share: f64,
    /// Mean over recordings of the match share.
    pub match_macro: f64,
    /// Clips that move no joint.
    pub distractors: usize,
    /// Of them, answered with a joint: false positives.
    pub false_positives: usize,
    /// Predictions for clips or recordings that the truth does not know.
    pub unknown: Vec<String>,
    /// One entry a rule.
    pub rules: Vec<RuleReport>,
    /// One entry a clip.
    pub per_clip: Vec<ClipReport>,
}

/// Compares predictions with the truths of their recordings.
#[must_use]
pub fn evaluate(predictions: &Predictions, truths: &[Truth]) -> Report {
    let by_name: BTreeMap<(&str, &str), &Prediction> =
        predictions.predictions.iter().map(|p| ((p.recording.as_str(), p.clip.as_str()), p)).collect();
    let mut per_clip = Vec::new();
    let (mut distractors, mut false_positives) = (0, 0);
    for truth in truths {
        for (name, clip) in &truth.clips {
            let prediction = by_name.get(&(truth.recording.as_str(), name.as_str())).copied();
            let Some(clip) = clip else {
                distractors += 1;
                false_positives += usize::from(prediction.is_some_and(|p| p.kind.is_some()));
                continue;
            };
            per_clip.push(ClipReport {
                recording: truth.recording.clone(),
                clip: name.clone(),
                joint: clip.joint.clone(),
                measured: prediction.and_then(|p| measure(p, clip)),
                reason: prediction.and_then(|p| p.reason.clone()),
            });
        }
    }
    let known = |p: &&Prediction| truths.iter().any(|t| t.recording == p.recording && t.clips.contains_key(&p.clip));
    let unknown =
        predictions.predictions.iter().filter(|p| !known(p)).map(|p| format!("{}/{}", p.recording, p.clip)).collect();
    let answered = per_clip.iter().filter(|c| c.measured.is_some()).count();
    let groups: Vec<Vec<&ClipReport>> = truths
        .iter()
        .map(|t| per_clip.iter().filter(|c| c.recording == t.recording).collect::<Vec<_>>())
        .filter(|g| !g.is_empty())
        .collect();
    let all: Vec<&ClipReport> = per_clip.iter().collect();
    let rules =
        Rule::ALL
            .into_iter()
            .map(|rule| RuleReport {
                rule,
                micro: shares(&all, rule, false).unwrap_or(Shares { m: 0.0, ma: 0.0, mao: 0.0 }),
                micro_conditional: shares(&all, rule, true),
                macro_: mean(&groups.iter().filter_map(|g| shares(g, rule, false)).collect::<Vec<_>>())
                    .unwrap_or(Shares { m: 0.0, ma: 0.0, mao: 0.0 }),
                macro_conditional: mean(&groups.iter().filter_map(|g| shares(g, rule, true)).collect::<Vec<_>>()),
            })
            .collect();
    let match_of = |g: &[&ClipReport]| g.iter().filter(|c| c.measured.is_some()).count() as f64 / g.len().max(1) as f64;
    let match_macro = groups.iter().map(|g| match_of(g)).sum::<f64>() / groups.len().max(1) as f64;
    Report {
        clips: per_clip.len(),
        answered,
        match_share: match_of(&all),
        match_macro,
        distractors,
        false_positives,
        unknown,
        rules,
        per_clip,
    }
}

fn shares(clips: &[&ClipReport], rule: Rule, conditional: bool) -> Option<Shares> {
    let judged: Vec<[bool; 3]> = clips
        .iter()
        .filter(|c| !conditional || c.measured.is_some())
        .map(|c| c.measured.as_ref().map_or([false; 3], |m| rule.judge(m)))
        .collect();
    let share = |i: usize| judged.iter().filter(|j| j[i]).count() as f64 / judged.len() as f64;
    (!judged.is_empty()).then(|| Shares { m: share(0), ma: share(1), mao: share(2) })
}

fn mean(all: &[Shares]) -> Option<Shares> {
    let n = all.len() as f64;
    let sum = |f: fn(&Shares) -> f64| all.iter().map(f).sum::<f64>() / n;
    (!all.is_empty()).then(|| Shares { m: sum(|s| s.m), ma: sum(|s| s.ma), mao: sum(|s| s.mao) })
}
