//! Whether confidences mean what they say: of answers that are 80 % sure, 80 % should be right.

use serde::Serialize;

/// Bins of equal width between 0 and 1.
const BINS: usize = 10;

/// An answer's confidence, and whether the answer is right.
pub type Answered = (f64, bool);

/// Answers whose confidences lie in one bin.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ConfidenceBin {
    /// Lower end, included.
    pub low: f64,
    /// Upper end, excluded except for 1.
    pub high: f64,
    /// Answers.
    pub count: usize,
    /// Their mean confidence.
    pub mean_confidence: f64,
    /// Share of them that is right.
    pub share_right: f64,
}

/// Confidences against what was right.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CalibrationReport {
    /// Answers with a confidence.
    pub answers: usize,
    /// Expected calibration error: mean gap between confidence and share right over the bins, weighed by their counts.
    pub ece: f64,
    /// Brier score: mean square of confidence minus right (1) or wrong (0).
    pub brier: f64,
    /// The bins that hold an answer, by rising confidence.
    pub bins: Vec<ConfidenceBin>,
}

/// Calibration of answers; `None` without any.
#[must_use]
pub fn calibration(answers: &[Answered]) -> Option<CalibrationReport> {
    if answers.is_empty() {
        return None;
    }
    let total = answers.len() as f64;
    let hit = |right: bool| f64::from(u8::from(right));
    let mut bins = Vec::new();
    for i in 0..BINS {
        let inside: Vec<&Answered> = answers.iter().filter(|(c, _)| bin_of(*c) == i).collect();
        if inside.is_empty() {
            continue;
        }
        let count = inside.len() as f64;
        bins.push(ConfidenceBin {
            low: i as f64 / BINS as f64,
            high: (i + 1) as f64 / BINS as f64,
            count: inside.len(),
            mean_confidence: inside.iter().map(|(c, _)| c).sum::<f64>() / count,
            share_right: inside.iter().map(|(_, right)| hit(*right)).sum::<f64>() / count,
        });
    }
    let ece = bins.iter().map(|b| b.count as f64 * (b.mean_confidence - b.share_right).abs()).sum::<f64>() / total;
    let brier = answers.iter().map(|(c, right)| (c - hit(*right)).powi(2)).sum::<f64>() / total;
    Some(CalibrationReport { answers: answers.len(), ece, brier, bins })
}

fn bin_of(confidence: f64) -> usize {
    // A negative or NaN product becomes 0.
    ((confidence * BINS as f64) as usize).min(BINS - 1)
}

/// Share right among the surest answers that make up `coverage` of all `clips`; `None` where fewer were answered. Answers of
/// one confidence keep their order.
#[must_use]
pub fn precision_at(answers: &[Answered], clips: usize, coverage: f64) -> Option<f64> {
    let wanted = (coverage * clips as f64).ceil() as usize;
    if wanted == 0 || answers.len() < wanted {
        return None;
    }
    let mut sorted = answers.to_vec();
    sorted.sort_by(|a, b| b.0.total_cmp(&a.0));
    Some(sorted[..wanted].iter().filter(|(_, right)| *right).count() as f64 / wanted as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn five_answers_by_hand() {
        let answers = [(0.95, true), (0.91, false), (0.62, true), (0.68, true), (0.1, false)];
        let c = calibration(&answers).unwrap();
        let bins: Vec<(usize, f64)> = c.bins.iter().map(|b| (b.count, b.share_right)).collect();
        assert_eq!(bins, [(1, 0.0), (2, 1.0), (2, 0.5)]);
        // (1 * |0.1 - 0| + 2 * |0.65 - 1| + 2 * |0.93 - 0.5|) / 5
        assert!((c.ece - 0.332).abs() < 1e-12, "{}", c.ece);
        // (0.05^2 + 0.91^2 + 0.38^2 + 0.32^2 + 0.1^2) / 5
        assert!((c.brier - 0.217_48).abs() < 1e-12, "{}", c.brier);
        assert_eq!(calibration(&[]), None);
        assert_eq!(calibration(&[(1.0, true)]).unwrap().bins[0].high, 1.0);
    }

    #[test]
    fn the_surest_answers_are_a_share_of_all_clips() {
        let answers = [(0.5, false), (0.9, true), (0.8, true), (0.7, false)];
        assert_eq!(precision_at(&answers, 4, 0.5), Some(1.0));
        assert_eq!(precision_at(&answers, 5, 0.8), Some(0.5));
        assert_eq!(precision_at(&answers, 6, 0.8), None);
        assert_eq!(precision_at(&[], 0, 0.8), None);
    }
}
