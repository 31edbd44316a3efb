//! How well a score tells right joints from wrong ones: ROC, the area under it, and how sure that area is.

use serde::Serialize;

use super::bootstrap::{Interval, drawn};

/// A joint with a score that should be higher the more right it is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scored {
    /// Whether the joint is right.
    pub right: bool,
    /// The score; joints whose score is not a number do not count.
    pub score: f64,
    /// What the interval draws as one: the true joint. Scores under its hands share their errors.
    pub cluster: usize,
}

/// A point of a receiver operating characteristic.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Threshold {
    /// Share of the wrong joints whose score is at least `score`.
    pub wrong: f64,
    /// Share of the right joints whose score is at least `score`.
    pub right: f64,
    /// The score from which on a joint is taken to be right.
    pub score: f64,
}

/// By rising score.
fn ordered(scores: &[Scored]) -> Vec<Scored> {
    let mut ordered: Vec<Scored> = scores.iter().filter(|s| !s.score.is_nan()).copied().collect();
    ordered.sort_by(|a, b| a.score.total_cmp(&b.score));
    ordered
}

/// The probability that a right joint scores above a wrong one, ties counting half, where each joint counts `weight` times.
fn area(ordered: &[Scored], weight: impl Fn(usize) -> f64) -> Option<f64> {
    let (mut pairs, mut right, mut wrong) = (0.0, 0.0, 0.0);
    for tied in ordered.chunk_by(|a, b| a.score == b.score) {
        let sum = |is: bool| tied.iter().filter(|s| s.right == is).map(|s| weight(s.cluster)).sum::<f64>();
        let [right_here, wrong_here] = [true, false].map(sum);
        pairs += right_here * (wrong + 0.5 * wrong_here);
        right += right_here;
        wrong += wrong_here;
    }
    let all = right * wrong;
    (all > 0.0).then(|| pairs / all)
}

/// Area under the ROC: the probability that a right joint scores above a wrong one, ties counting half. `None` without both.
#[must_use]
pub fn auc(scores: &[Scored]) -> Option<f64> {
    area(&ordered(scores), |_| 1.0)
}

/// 95 % interval of [`auc`]: clusters are drawn with replacement, a thousand times. `None` for fewer than two clusters.
#[must_use]
pub fn auc_interval(scores: &[Scored]) -> Option<Interval> {
    let mut ordered = ordered(scores);
    let mut clusters: Vec<usize> = ordered.iter().map(|s| s.cluster).collect();
    clusters.sort_unstable();
    clusters.dedup();
    // From here on numbered without gaps.
    for s in &mut ordered {
        s.cluster = clusters.partition_point(|c| *c < s.cluster);
    }
    drawn(clusters.len(), |draw| {
        let mut weights = vec![0.0; clusters.len()];
        for &i in draw {
            weights[i] += 1.0;
        }
        area(&ordered, |cluster| weights[cluster])
    })
}

/// The ROC from the strictest threshold to the one that lets all pass; empty without both right and wrong joints.
#[must_use]
pub fn roc(scores: &[Scored]) -> Vec<Threshold> {
    let ordered = ordered(scores);
    let count = |is: bool| ordered.iter().filter(|s| s.right == is).count() as f64;
    let [rights, wrongs] = [true, false].map(count);
    if rights == 0.0 || wrongs == 0.0 {
        return Vec::new();
    }
    let (mut right, mut wrong) = (0.0, 0.0);
    ordered
        .chunk_by(|a, b| a.score == b.score)
        .rev()
        .map(|tied| {
            let here = tied.iter().filter(|s| s.right).count();
            right += here as f64;
            wrong += (tied.len() - here) as f64;
            Threshold { wrong: wrong / wrongs, right: right / rights, score: tied[0].score }
        })
        .collect()
}

/// The largest share of right joints that passes a threshold which lets no more than a share `wrong` of the wrong ones pass.
/// `None` for an empty ROC.
#[must_use]
pub fn right_at(roc: &[Threshold], wrong: f64) -> Option<f64> {
    // Above all scores is a threshold, too: it lets none pass.
    (!roc.is_empty()).then(|| roc.iter().take_while(|t| t.wrong <= wrong).last().map_or(0.0, |t| t.right))
}

/// Share of pairs (right, wrong) under one hand in which the right joint scores higher, ties counting half; pairs with a
/// score that is not a number do not count. `None` without pairs.
#[must_use]
pub fn paired(pairs: &[(f64, f64)]) -> Option<f64> {
    let compared: Vec<f64> = pairs
        .iter()
        .filter_map(|(right, wrong)| right.partial_cmp(wrong))
        .map(|order| match order {
            std::cmp::Ordering::Greater => 1.0,
            std::cmp::Ordering::Equal => 0.5,
            std::cmp::Ordering::Less => 0.0,
        })
        .collect();
    crate::math::stats::mean(&compared)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scored(right: &[f64], wrong: &[f64]) -> Vec<Scored> {
        let of = |scores: &[f64], right: bool| -> Vec<Scored> {
            scores.iter().enumerate().map(|(cluster, &score)| Scored { right, score, cluster }).collect()
        };
        [of(right, true), of(wrong, false)].concat()
    }

    #[test]
    fn the_area_counts_pairs_and_half_of_the_ties() {
        // Of 2 x 3 pairs: 3 above 1, 2, 3 (tie); 2 above 1, 2 (tie), not above 3.
        let scores = scored(&[3.0, 2.0], &[1.0, 2.0, 3.0]);
        assert_eq!(auc(&scores), Some(4.0 / 6.0));
        let turned: Vec<Scored> = scores.iter().map(|s| Scored { right: !s.right, ..*s }).collect();
        assert_eq!(auc(&turned), Some(2.0 / 6.0));
        let stretched: Vec<Scored> = scores.iter().map(|s| Scored { score: s.score.exp(), ..*s }).collect();
        assert_eq!(auc(&stretched), auc(&scores));
        assert_eq!(auc(&scored(&[1.0], &[])), None);
        // What is no number takes part in nothing.
        assert_eq!(auc(&scored(&[3.0, f64::NAN, 2.0], &[1.0, 2.0, 3.0, f64::NAN])), Some(4.0 / 6.0));
    }

    #[test]
    fn the_area_is_the_one_under_the_curve() {
        let scores = scored(&[0.9, 0.8, 0.8, 0.4, 0.3], &[0.7, 0.8, 0.2, 0.3, 0.1, 0.0]);
        let curve = roc(&scores);
        let (mut sum, mut last) = (0.0, (0.0, 0.0));
        for t in &curve {
            sum += (t.wrong - last.0) * 0.5 * (t.right + last.1);
            last = (t.wrong, t.right);
        }
        assert_eq!(last, (1.0, 1.0));
        assert!((sum - auc(&scores).unwrap()).abs() < 1e-12, "{sum}");
        assert_eq!((curve[0].score, curve[0].wrong, curve[0].right), (0.9, 0.0, 0.2));
        assert_eq!(right_at(&curve, 0.0), Some(0.2));
        // The tie at 0.8 lets one of six wrong ones pass.
        assert_eq!(right_at(&curve, 0.17), Some(0.6));
        assert_eq!(right_at(&roc(&scored(&[0.0], &[1.0])), 0.5), Some(0.0));
        assert_eq!(right_at(&[], 0.5), None);
    }

    #[test]
    fn the_interval_draws_joints_and_not_scores() {
        let scores = scored(&[0.9, 0.2, 0.7, 0.6, 0.3, 0.8], &[0.1, 0.4, 0.5, 0.3, 0.6, 0.2]);
        let area = auc(&scores).unwrap();
        let once = auc_interval(&scores).unwrap();
        assert!(once.low < area && area < once.high && once.high <= 1.0, "{once:?}");
        // The same joints seen twice are no more joints; as joints of their own they would be.
        let twice = [scores.clone(), scores.clone()].concat();
        assert_eq!(auc_interval(&twice), Some(once));
        let others: Vec<Scored> = scores.iter().map(|s| Scored { cluster: s.cluster + 100, ..*s }).collect();
        let apart = auc_interval(&[scores.clone(), others].concat()).unwrap();
        assert!(apart.half_width() < once.half_width());
        assert_eq!(auc_interval(&scored(&[1.0], &[0.0])), None);
    }

    #[test]
    fn pairs_compare_within_a_hand() {
        // Each right joint beats its own wrong one, although one right joint scores below the other hand's wrong one.
        let pairs = [(1.0, 0.5), (0.4, 0.1)];
        assert_eq!(paired(&pairs), Some(1.0));
        assert_eq!(paired(&[(1.0, 1.0), (0.0, 1.0), (f64::NAN, 0.0)]), Some(0.25));
        assert_eq!(paired(&[]), None);
    }
}
