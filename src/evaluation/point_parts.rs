//! Parts as points of a reconstruction: who segments the part and tells its joint.
//!
//! A part is found (MS) where a prediction of its type has more than a share of points in common with it; MSA and MSAO ask
//! for the axis and the origin as well. Average precisions are USDNet's: by class, predictions in the order of their scores,
//! and what lies mostly on points of no true part is passed over.

use serde::Serialize;

use super::rules::{AnswerErrors, Rule, measure};
use super::scenes::{answer, common, iou, true_clip};
use crate::articulation::JointKind;
use crate::import::articulations::{FoundJoint, JointScene};

/// What is asked of a found part, in the order of the numbers.
pub const LEVELS: [&str; 5] = ["MS", "MSA", "MSAO (PAWS)", "MSAO (USDNet)", "MSAO_ST (USDNet)"];

/// How many parts are found, at one intersection over union.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PartReport {
    /// More than this intersection over union makes a match.
    pub iou: f64,
    /// Parts of the truth.
    pub parts: usize,
    /// Predicted parts.
    pub predicted: usize,
    /// Share of the true parts that are found, one number for each of [`LEVELS`].
    pub recall: [f64; 5],
    /// Share of the predictions that find one; none without predictions.
    pub precision: Option<[f64; 5]>,
    /// USDNet's average precision, the mean over hinges and slides; none where no class has parts.
    pub ap: Option<[f64; 5]>,
}

/// A part with its points.
type PointPart<'a> = (&'a FoundJoint, &'a [usize]);

fn parts(scene: &JointScene) -> Vec<PointPart<'_>> {
    scene.joints.iter().filter_map(|j| Some((j, j.points.as_deref().filter(|p| !p.is_empty())?))).collect()
}

/// One scene: its true and predicted parts, and the points of true parts.
struct ScenePair<'a> {
    truth: Vec<PointPart<'a>>,
    predicted: Vec<PointPart<'a>>,
    labelled: Vec<usize>,
    scene: &'a JointScene,
}

impl ScenePair<'_> {
    /// Whether a prediction finds a part, at each level; all false below the overlap.
    fn judge(&self, prediction: &PointPart<'_>, truth: &PointPart<'_>, least: f64) -> [bool; 5] {
        let overlap = iou(common(prediction.1, truth.1), prediction.1.len(), truth.1.len());
        if prediction.0.kind != truth.0.kind || overlap <= least {
            return [false; 5];
        }
        let clip = true_clip(truth.0, &self.scene.up);
        measure(&answer(prediction.0, truth.0, ""), &clip).as_ref().map_or([false; 5], levels)
    }
}

fn levels(m: &AnswerErrors) -> [bool; 5] {
    let of = |rule: Rule| rule.judge(m);
    let usdnet = of(Rule::Usdnet);
    [usdnet[0], usdnet[1], of(Rule::Paws)[2], usdnet[2], of(Rule::UsdnetMaoSt)[2]]
}

/// Compares the parts of scenes, pairs of predictions and truth; `None` where no true part has points.
#[must_use]
pub fn compare_parts(scenes: &[(&JointScene, &JointScene)], least: f64) -> Option<PartReport> {
    let both: Vec<ScenePair<'_>> = scenes
        .iter()
        .map(|&(predicted, truth)| {
            let true_parts = parts(truth);
            let mut labelled: Vec<usize> = true_parts.iter().flat_map(|(_, points)| points.iter().copied()).collect();
            labelled.sort_unstable();
            labelled.dedup();
            ScenePair { truth: true_parts, predicted: parts(predicted), labelled, scene: truth }
        })
        .collect();
    let count: usize = both.iter().map(|b| b.truth.len()).sum();
    let predicted: usize = both.iter().map(|b| b.predicted.len()).sum();
    if count == 0 {
        return None;
    }
    let found = both.iter().map(|b| found(b, least)).fold([0usize; 5], |sum, f| std::array::from_fn(|i| sum[i] + f[i]));
    let share = |of: usize| found.map(|f| f as f64 / of as f64);
    let ap = |level: usize| {
        let classes = [JointKind::Revolute, JointKind::Prismatic];
        let all: Vec<f64> = classes.iter().filter_map(|kind| average_precision(&both, *kind, level, least)).collect();
        (!all.is_empty()).then(|| all.iter().sum::<f64>() / all.len() as f64)
    };
    let aps = [0, 1, 2, 3, 4].map(ap);
    Some(PartReport {
        iou: least,
        parts: count,
        predicted,
        recall: share(count),
        precision: (predicted > 0).then(|| share(predicted)),
        ap: aps.iter().all(Option::is_some).then(|| aps.map(Option::unwrap_or_default)),
    })
}

/// How many parts of a scene are found at each level: the best overlaps first, each prediction once.
fn found(both: &ScenePair<'_>, least: f64) -> [usize; 5] {
    let mut all = Vec::new();
    for (t, truth) in both.truth.iter().enumerate() {
        for (p, prediction) in both.predicted.iter().enumerate() {
            let levels = both.judge(prediction, truth, least);
            if levels[0] {
                all.push((iou(common(prediction.1, truth.1), prediction.1.len(), truth.1.len()), t, p, levels));
            }
        }
    }
    all.sort_by(|a, b| b.0.total_cmp(&a.0).then((a.1, a.2).cmp(&(b.1, b.2))));
    let mut taken = (vec![false; both.truth.len()], vec![false; both.predicted.len()]);
    let mut count = [0usize; 5];
    for (_, t, p, levels) in all {
        if !taken.0[t] && !taken.1[p] {
            (taken.0[t], taken.1[p]) = (true, true);
            count = std::array::from_fn(|i| count[i] + usize::from(levels[i]));
        }
    }
    count
}

fn score(part: &PointPart<'_>) -> f64 {
    part.0.score.unwrap_or(1.0)
}

/// USDNet's average precision of a class; `None` where it has neither parts nor predictions.
fn average_precision(scenes: &[ScenePair<'_>], kind: JointKind, level: usize, least: f64) -> Option<f64> {
    let mut answers: Vec<(f64, bool)> = Vec::new();
    let (mut missed, mut parts, mut predictions) = (0, 0, 0);
    for both in scenes {
        let of_kind =
            |all: &[PointPart<'_>]| -> Vec<usize> { (0..all.len()).filter(|i| all[*i].0.kind == kind).collect() };
        let (truth, predicted) = (of_kind(&both.truth), of_kind(&both.predicted));
        (parts, predictions) = (parts + truth.len(), predictions + predicted.len());
        let fits = |p: usize, t: usize| both.judge(&both.predicted[p], &both.truth[t], least)[level];
        let mut used = vec![false; both.predicted.len()];
        for &t in &truth {
            let mut best: Option<f64> = None;
            for &p in predicted.iter().filter(|p| fits(**p, t)) {
                if used[p] {
                    continue;
                }
                let own = score(&both.predicted[p]);
                match best {
                    // Of two predictions of one part the surer counts.
                    Some(other) => {
                        answers.push((other.min(own), false));
                        best = Some(other.max(own));
                    }
                    None => {
                        used[p] = true;
                        best = Some(own);
                    }
                }
            }
            match best {
                Some(score) => answers.push((score, true)),
                None => missed += 1,
            }
        }
        for &p in predicted.iter().filter(|p| !truth.iter().any(|t| fits(**p, *t))) {
            let points = both.predicted[p].1;
            let beside = points.len() - common(points, &both.labelled);
            if beside as f64 / points.len() as f64 <= least {
                answers.push((score(&both.predicted[p]), false));
            }
        }
    }
    match (parts, predictions) {
        (0, _) => None,
        (_, 0) => Some(0.0),
        _ => Some(area(&mut answers, missed)),
    }
}

/// The area below precision over recall, as ScanNet's benchmark integrates it: a step for each distinct score.
fn area(answers: &mut [(f64, bool)], missed: usize) -> f64 {
    answers.sort_by(|a, b| a.0.total_cmp(&b.0));
    let right = answers.iter().filter(|a| a.1).count();
    let mut curve: Vec<[f64; 2]> = Vec::new();
    let mut before = 0;
    for (i, (score, is_right)) in answers.iter().enumerate() {
        if i == 0 || answers[i - 1].0 != *score {
            // All answers from here on are kept.
            let (kept, of_right) = (answers.len() - i, right - before);
            curve.push([of_right as f64 / kept as f64, of_right as f64 / (right + missed).max(1) as f64]);
        }
        before += usize::from(*is_right);
    }
    curve.push([1.0, 0.0]);
    let recall = |i: usize| curve.get(i).map_or(0.0, |c| c[1]);
    (0..curve.len()).map(|i| curve[i][0] * 0.5 * (recall(i.saturating_sub(1)) - recall(i + 1))).sum()
}

#[cfg(test)]
mod tests {
    use super::super::scenes::tests::{joint, scene};
    use super::*;

    const TURNS: JointKind = JointKind::Revolute;

    fn truth() -> JointScene {
        let drawer = joint("d", JointKind::Prismatic, 2.0, Some((20..30).collect()));
        scene(
            "s",
            vec![
                joint("a", TURNS, 0.0, Some((0..10).collect())),
                joint("b", TURNS, 1.0, Some((10..20).collect())),
                drawer,
            ],
        )
    }

    fn compare(predicted: JointScene) -> PartReport {
        compare_parts(&[(&predicted, &truth())], 0.5).unwrap()
    }

    #[test]
    fn the_truth_finds_all_of_itself() {
        let report = compare(truth());
        assert_eq!((report.parts, report.predicted), (3, 3));
        assert_eq!((report.recall, report.precision, report.ap), ([1.0; 5], Some([1.0; 5]), Some([1.0; 5])));
        assert!(compare_parts(&[(&truth(), &scene("s", Vec::new()))], 0.5).is_none());
    }

    #[test]
    fn each_level_asks_for_more() {
        let mut given = truth();
        // Hinges: half a metre off to the side; 20 degrees off. A slide: its origin elsewhere.
        given.joints[0].origin.x = 0.5;
        given.joints[1].axis =
            crate::math::rotation(&nalgebra::Vector3::x(), 20f64.to_radians()) * given.joints[1].axis;
        given.joints[2].origin.x = 9.0;
        let report = compare(given);
        let third = 1.0 / 3.0;
        assert_eq!(report.recall, [1.0, 2.0 * third, third, 0.0, third]);
    }

    #[test]
    fn half_of_a_part_or_the_wrong_type_is_no_match() {
        let mut given = truth();
        given.joints[0].points = Some((0..5).collect());
        given.joints[1].kind = JointKind::Prismatic;
        let report = compare(given);
        assert_eq!(report.recall[0], 1.0 / 3.0);
        // Hinges: one prediction, wrong. Slides: one right, one wrong, both equally sure.
        assert_eq!(report.ap.unwrap()[0], 0.5 * 0.75);
    }

    #[test]
    fn surer_answers_count_first_and_what_nobody_labelled_is_passed_over() {
        let mut given = truth();
        for (i, joint) in given.joints.iter_mut().enumerate() {
            joint.score = Some(0.9 - 0.1 * i as f64);
        }
        let sure = compare(given.clone()).ap.unwrap()[0];
        // Nowhere near a labelled part: no fault of precision in the average.
        given.joints.push(joint("e", TURNS, 5.0, Some((90..99).collect())));
        let report = compare(given);
        assert_eq!((report.ap.unwrap()[0], sure), (1.0, 1.0));
        assert_eq!(report.precision.unwrap()[0], 0.75);
    }
}
