//! Counts over clips and recordings: conditional and unconditional, micro and macro, in groups.

use std::collections::BTreeMap;

use serde::Serialize;

use super::bootstrap::{Interval, interval};
use super::calibration::{Answered, CalibrationReport, calibration, precision_at};
use super::clip_report::{ClipReport, clusters};
use super::coverage::{Coverage, coverage};
use super::deviations::{Deviations, MeanErrors, Pairs, deviations, mean_errors, pairs};
use super::failures::{Failure, FailureCount};
use super::rules::{Rule, usdnet_mo};
use super::truth::{Prediction, Predictions, Truth};
use crate::articulation::Action;
use crate::math::stats;

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

/// 95 % intervals of shares.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct SharesInterval {
    /// Of M.
    pub m: Interval,
    /// Of MA.
    pub ma: Interval,
    /// Of MAO.
    pub mao: Interval,
}

impl SharesInterval {
    /// From `[M, MA, MAO]`, where all of them are known.
    #[must_use]
    pub fn of([m, ma, mao]: [Option<Interval>; 3]) -> Option<Self> {
        Some(Self { m: m?, ma: ma?, mao: mao? })
    }
}

/// One rule's numbers.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RuleReport {
    /// The rule.
    pub rule: Rule,
    /// Of all clips that move a joint; a missing answer is wrong. Pooled over recordings.
    pub micro: Shares,
    /// 95 % interval of `micro`; the clips of a joint are drawn together. None for fewer than two joints.
    pub micro_interval: Option<SharesInterval>,
    /// Of the answered clips only (the paper's dagger). Pooled.
    pub micro_conditional: Option<Shares>,
    /// Mean over recordings of the unconditional shares.
    pub macro_: Shares,
    /// Mean over recordings of the conditional shares.
    pub macro_conditional: Option<Shares>,
}

/// Shares of a group of clips.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ClipGroup {
    /// What the clips are grouped by: "type", "hinge", "action", "tier" or "noun".
    pub by: &'static str,
    /// Which group.
    pub name: String,
    /// Clips.
    pub clips: usize,
    /// Of them, answered.
    pub answered: usize,
    /// Shares of all its clips, one entry a rule.
    pub rules: Vec<RuleShares>,
}

/// A rule with its shares.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct RuleShares {
    /// The rule.
    pub rule: Rule,
    /// Of all clips, pooled.
    pub shares: Shares,
}

/// What the confidences are worth. An answer's joint is right where [`Rule::PawsLine`] says so.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Confidences {
    /// Confidence in the type.
    pub kind: Option<CalibrationReport>,
    /// Confidence in the joint.
    pub joint: Option<CalibrationReport>,
    /// Share right among the surest answers, by joint confidence.
    pub precision: Vec<Precision>,
}

/// Share right among the surest answers.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Precision {
    /// The surest answers that make up this share of all clips that move a joint.
    pub coverage: f64,
    /// What counts as right.
    pub rule: Rule,
    /// Share right; none where fewer clips were answered with a joint confidence.
    pub right: Option<f64>,
}

/// The whole evaluation.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct EvaluationReport {
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
    /// USDNet's MO of all clips, pooled: type and origin right.
    pub usdnet_mo: f64,
    /// Axis and line errors as other benchmarks average them.
    pub errors: Vec<MeanErrors>,
    /// Errors of the answers whose type is right, hinges first.
    pub deviations: Vec<Deviations>,
    /// Shares of groups of clips.
    pub groups: Vec<ClipGroup>,
    /// What the confidences are worth.
    pub confidences: Confidences,
    /// What the covariances are worth; one entry for each kind of error that some prediction speaks of.
    pub coverage: Vec<Coverage>,
    /// Whether clips of one joint were recognised as such.
    pub pairs: Option<Pairs>,
    /// What became of the clips; ends that no clip came to are left out.
    pub failures: Vec<FailureCount>,
    /// One entry a clip.
    pub per_clip: Vec<ClipReport>,
}

/// Compares predictions with the truths of their recordings.
#[must_use]
pub fn evaluate(predictions: &Predictions, truths: &[Truth]) -> EvaluationReport {
    let own: Vec<Prediction> = predictions.predictions.iter().map(Prediction::in_own_world).collect();
    let by_name: BTreeMap<(&str, &str), &Prediction> =
        own.iter().map(|p| ((p.recording.as_str(), p.clip.as_str()), p)).collect();
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
            per_clip.push(ClipReport::new(truth, name, clip, prediction));
        }
    }
    let known = |p: &&Prediction| truths.iter().any(|t| t.recording == p.recording && t.clips.contains_key(&p.clip));
    let unknown =
        predictions.predictions.iter().filter(|p| !known(p)).map(|p| format!("{}/{}", p.recording, p.clip)).collect();
    let answered = per_clip.iter().filter(|c| c.measured.is_some()).count();
    let recordings: Vec<Vec<&ClipReport>> = truths
        .iter()
        .map(|t| per_clip.iter().filter(|c| c.recording == t.recording).collect::<Vec<_>>())
        .filter(|g| !g.is_empty())
        .collect();
    let match_of = |g: &[&ClipReport]| g.iter().filter(|c| c.measured.is_some()).count() as f64 / g.len().max(1) as f64;
    let match_macro = recordings.iter().map(|g| match_of(g)).sum::<f64>() / recordings.len().max(1) as f64;
    let moved_right = per_clip.iter().filter(|c| c.measured.as_ref().is_some_and(usdnet_mo)).count();
    EvaluationReport {
        clips: per_clip.len(),
        answered,
        match_share: answered as f64 / per_clip.len().max(1) as f64,
        match_macro,
        distractors,
        false_positives,
        unknown,
        rules: Rule::ALL.into_iter().map(|rule| rule_report(rule, &per_clip, &recordings)).collect(),
        usdnet_mo: moved_right as f64 / per_clip.len().max(1) as f64,
        errors: mean_errors(&per_clip),
        deviations: deviations(&per_clip),
        groups: groups(&per_clip),
        confidences: confidences(&per_clip),
        coverage: coverage(&per_clip),
        pairs: pairs(&per_clip),
        failures: failures(&per_clip),
        per_clip,
    }
}

const NOTHING: Shares = Shares { m: 0.0, ma: 0.0, mao: 0.0 };

fn rule_report(rule: Rule, clips: &[ClipReport], recordings: &[Vec<&ClipReport>]) -> RuleReport {
    let all: Vec<&ClipReport> = clips.iter().collect();
    let verdicts: Vec<[bool; 3]> = clips.iter().map(|c| c.judge(rule)).collect();
    let drawn = |level: usize| interval(&clusters(clips, |i| f64::from(u8::from(verdicts[i][level]))));
    let over_recordings =
        |conditional: bool| mean(&recordings.iter().filter_map(|g| shares(g, rule, conditional)).collect::<Vec<_>>());
    RuleReport {
        rule,
        micro: shares(&all, rule, false).unwrap_or(NOTHING),
        micro_interval: SharesInterval::of([drawn(0), drawn(1), drawn(2)]),
        micro_conditional: shares(&all, rule, true),
        macro_: over_recordings(false).unwrap_or(NOTHING),
        macro_conditional: over_recordings(true),
    }
}

fn shares(clips: &[&ClipReport], rule: Rule, conditional: bool) -> Option<Shares> {
    let judged: Vec<[bool; 3]> =
        clips.iter().filter(|c| !conditional || c.measured.is_some()).map(|c| c.judge(rule)).collect();
    let share = |i: usize| judged.iter().filter(|j| j[i]).count() as f64 / judged.len() as f64;
    (!judged.is_empty()).then(|| Shares { m: share(0), ma: share(1), mao: share(2) })
}

fn mean(all: &[Shares]) -> Option<Shares> {
    let n = all.len() as f64;
    let sum = |f: fn(&Shares) -> f64| all.iter().map(f).sum::<f64>() / n;
    (!all.is_empty()).then(|| Shares { m: sum(|s| s.m), ma: sum(|s| s.ma), mao: sum(|s| s.mao) })
}

fn groups(clips: &[ClipReport]) -> Vec<ClipGroup> {
    type Name = fn(&ClipReport) -> Option<String>;
    let action = |c: &ClipReport| c.action.map(|a| if a == Action::Open { "open" } else { "close" }.to_owned());
    let names: [(&'static str, Name); 5] = [
        ("type", |c| Some(c.kind.word().to_owned())),
        ("hinge", |c| c.orientation.map(|o| o.word().to_owned())),
        ("action", action),
        ("tier", |c| c.tier.clone()),
        ("noun", |c| c.noun.clone()),
    ];
    let mut out = Vec::new();
    for (by, name) in names {
        let mut members: BTreeMap<String, Vec<&ClipReport>> = BTreeMap::new();
        for c in clips {
            if let Some(name) = name(c) {
                members.entry(name).or_default().push(c);
            }
        }
        out.extend(members.into_iter().map(|(name, members)| {
            ClipGroup {
                by,
                name,
                clips: members.len(),
                answered: members.iter().filter(|c| c.measured.is_some()).count(),
                rules: Rule::ALL
                    .into_iter()
                    .map(|rule| RuleShares { rule, shares: shares(&members, rule, false).unwrap_or(NOTHING) })
                    .collect(),
            }
        }));
    }
    out
}

fn confidences(clips: &[ClipReport]) -> Confidences {
    let kinds: Vec<Answered> =
        clips.iter().filter_map(|c| Some((c.confidence?, c.measured.as_ref()?.type_right))).collect();
    let joints = |rule: Rule| -> Vec<Answered> {
        clips.iter().filter_map(|c| Some((c.joint_confidence?, rule.judge(c.measured.as_ref()?)[2]))).collect()
    };
    let joint = calibration(&joints(Rule::PawsLine));
    let mut precision = Vec::new();
    if joint.is_some() {
        for coverage in [0.8, 0.5] {
            for rule in [Rule::PawsLine, Rule::Sim] {
                let right = precision_at(&joints(rule), clips.len(), coverage);
                precision.push(Precision { coverage, rule, right });
            }
        }
    }
    Confidences { kind: calibration(&kinds), joint, precision }
}

fn failures(clips: &[ClipReport]) -> Vec<FailureCount> {
    let count = |failure: Failure| {
        let ended: Vec<&ClipReport> = clips.iter().filter(|c| c.failure == failure).collect();
        let beside: Vec<f64> = match failure {
            Failure::HingeBeside => ended.iter().filter_map(|c| c.measured.as_ref()?.truth_to_line_m).collect(),
            _ => Vec::new(),
        };
        let share = ended.len() as f64 / clips.len().max(1) as f64;
        FailureCount { failure, clips: ended.len(), share, beside_m: stats::median(&beside) }
    };
    Failure::ALL.into_iter().map(count).filter(|f| f.clips > 0).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::articulation::JointKind;
    use crate::evaluation::compare;
    use crate::evaluation::truth::{InScene, Orientation, Stage, TrueClip};
    use crate::math::{Point, Vector};
    use crate::twin::OrientedBox;

    /// A recording of upright hinges at the origin, half a metre apart: clips `a0`, `a1` show the first, `b0`, `b1` the
    /// second; `cup` shows none.
    fn truth() -> Truth {
        let clip = |joint: &str, x: f64, action: Action| TrueClip {
            joint: joint.to_owned(),
            kind: JointKind::Revolute,
            axis: Vector::z(),
            origin: Point::new(x, 0.0, 0.0),
            origin_handle: Point::new(x, 0.0, 0.0),
            moved: 1.0,
            part_box: Some(OrientedBox {
                center: Point::new(x + 0.2, 0.0, 0.0),
                half: Vector::new(0.2, 0.01, 0.3),
                rotation: nalgebra::Matrix3::identity(),
            }),
            base_box: None,
            handle: None,
            noun: Some("cupboard".to_owned()),
            action: Some(action),
            orientation: Some(Orientation::Upright),
        };
        let clips = [
            ("a0", Some(clip("a", 0.0, Action::Open))),
            ("a1", Some(clip("a", 0.0, Action::Close))),
            ("b0", Some(clip("b", 0.5, Action::Open))),
            ("b1", Some(clip("b", 0.5, Action::Close))),
            ("cup", None),
        ];
        Truth {
            recording: "r".to_owned(),
            tier: Some("hard".to_owned()),
            place: None,
            clips: clips.into_iter().map(|(name, clip)| (name.to_owned(), clip)).collect(),
        }
    }

    fn row(clip: &str, x: f64, joint: &str) -> Prediction {
        Prediction {
            recording: "r".to_owned(),
            clip: clip.to_owned(),
            kind: Some(JointKind::Revolute),
            axis: Some(Vector::z()),
            origin: Some(Point::new(x, 0.0, 0.0)),
            range: Some(1.0),
            confidence: Some(0.9),
            joint_confidence: Some(0.8),
            joint: Some(joint.to_owned()),
            ..Prediction::default()
        }
    }

    /// Three of one joint, of which one truly hangs half a metre further; one lost with its hand.
    fn predictions() -> Predictions {
        let lost = Prediction { kind: None, stage: Some(Stage::Hands), ..row("b1", 0.5, "1") };
        Predictions { predictions: vec![row("a0", 0.0, "0"), row("a1", 0.0, "0"), row("b0", 0.0, "0"), lost] }
    }

    #[test]
    fn missing_answers_are_wrong_and_named() {
        let report = evaluate(&predictions(), &[truth()]);
        assert_eq!((report.clips, report.answered, report.distractors), (4, 3, 1));
        let line = report.rules.iter().find(|r| r.rule == Rule::PawsLine).unwrap();
        assert_eq!((line.micro.m, line.micro.mao), (0.75, 0.5));
        assert_eq!(line.micro_conditional.unwrap().m, 1.0);
        assert_eq!(report.usdnet_mo, 0.5);
        let ends: Vec<(Failure, usize)> = report.failures.iter().map(|f| (f.failure, f.clips)).collect();
        assert_eq!(ends, [(Failure::NoHand, 1), (Failure::HingeBeside, 1), (Failure::Right, 2)]);
        assert!((report.failures[1].beside_m.unwrap() - 0.5).abs() < 1e-12);
        let close = report.groups.iter().find(|g| g.name == "close").unwrap();
        assert_eq!((close.by, close.clips, close.answered), ("action", 2, 1));
        assert!(report.groups.iter().any(|g| (g.by, g.name.as_str()) == ("tier", "hard")));
    }

    #[test]
    fn clips_of_one_joint_are_one_draw() {
        let report = evaluate(&predictions(), &[truth()]);
        let line = report.rules.iter().find(|r| r.rule == Rule::PawsLine).unwrap();
        // Of two joints one is right: a draw has none, one or both of them.
        let mao = line.micro_interval.unwrap().mao;
        assert_eq!((mao.low, mao.high), (0.0, 1.0));
    }

    #[test]
    fn pairs_count_within_a_recording() {
        let pairs = evaluate(&predictions(), &[truth()]).pairs.unwrap();
        // Predicted: a0 a1, a0 b0, a1 b0; true: a0 a1, b0 b1.
        assert_eq!((pairs.predicted_pairs, pairs.true_pairs, pairs.both), (3, 2, 1));
        assert_eq!((pairs.precision, pairs.recall), (Some(1.0 / 3.0), Some(0.5)));
    }

    #[test]
    fn pairs_of_two_recordings_count_where_they_are_of_one_place_and_in_one_scene() {
        let truths =
            ["r", "s"].map(|name| Truth { recording: name.to_owned(), place: Some("k".to_owned()), ..truth() });
        let rows = |in_scene: Option<&InScene>| {
            let of = |recording: &str| {
                let row = row("a0", 0.0, "0");
                Prediction { recording: recording.to_owned(), in_scene: in_scene.cloned(), ..row }
            };
            Predictions { predictions: ["r", "s"].map(of).to_vec() }
        };
        // Four clips a recording: six pairs of each of two joints.
        let apart = evaluate(&rows(None), &truths).pairs.unwrap();
        assert_eq!((apart.predicted_pairs, apart.true_pairs, apart.both), (0, 12, 0));
        let scene = InScene { scene: "both".to_owned(), own_from_scene: crate::math::Pose::identity() };
        let together = evaluate(&rows(Some(&scene)), &truths).pairs.unwrap();
        assert_eq!((together.predicted_pairs, together.true_pairs, together.both), (1, 12, 1));
    }

    #[test]
    fn confidence_is_held_against_the_answers() {
        let confidences = evaluate(&predictions(), &[truth()]).confidences;
        assert!((confidences.kind.unwrap().ece - 0.1).abs() < 1e-12);
        assert!((confidences.joint.unwrap().ece - (0.8 - 2.0 / 3.0)).abs() < 1e-12);
        let half = confidences.precision.iter().find(|p| p.coverage == 0.5 && p.rule == Rule::PawsLine).unwrap();
        assert_eq!(half.right, Some(1.0));
        // Three answers are no four fifths of four clips.
        assert!(confidences.precision.iter().filter(|p| p.coverage == 0.8).all(|p| p.right.is_none()));
    }

    #[test]
    fn two_sets_of_predictions_differ_by_their_clips() {
        let truths = [truth()];
        let worse = evaluate(&predictions(), &truths);
        let mut all = predictions();
        all.predictions[2] = row("b0", 0.5, "1");
        all.predictions[3] = row("b1", 0.5, "1");
        let better = evaluate(&all, &truths);
        let line = compare(&better, &worse).unwrap().into_iter().find(|p| p.rule == Rule::PawsLine).unwrap();
        assert_eq!((line.better, line.worse), (2, 0));
        assert_eq!((line.difference.m, line.difference.mao), (0.25, 0.5));
        let back = compare(&worse, &better).unwrap();
        assert!(back.iter().all(|p| p.better == 0 && p.difference.mao <= 0.0));
        assert!(compare(&better, &evaluate(&all, &[])).is_none());
    }
}
