//! One RANSAC driver with local optimisation (LO-RANSAC) for every model of the crate.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

/// A model and the indices of the data that agree with it.
#[derive(Debug, Clone, PartialEq)]
pub struct Consensus<M> {
    /// The locally optimised model.
    pub model: M,
    /// Indices of the inliers, ascending.
    pub inliers: Vec<usize>,
}

/// How a search is run.
#[derive(Debug, Clone, Copy)]
pub struct Search {
    /// Random minimal samples drawn at the most.
    pub draws: usize,
    /// A datum within this distance is an inlier (the unit is the distance function's).
    pub tolerance: f64,
    /// Seed of the draws: the same data and seed give the same answer.
    pub seed: u64,
}

/// Probability of having drawn a sample without outliers at which a search ends early.
const CONFIDENCE: f64 = 0.9999;

/// Draws minimal samples of `K` data, keeps the model of the lowest truncated squared distance, and refits each new best
/// on its inliers until that no longer helps.
///
/// `minimal` builds a model from `K` indices, `refit` from any number, `distance` measures datum `i` against a model.
/// Returns `None` where there are fewer than `K` data or no sample gave a model.
pub fn lo_ransac<M: Clone, const K: usize>(
    count: usize,
    search: Search,
    minimal: impl Fn(&[usize; K]) -> Option<M>,
    refit: impl Fn(&[usize]) -> Option<M>,
    distance: impl Fn(&M, usize) -> f64,
) -> Option<Consensus<M>> {
    if count < K || K == 0 {
        return None;
    }
    let limit = search.tolerance * search.tolerance;
    // Truncated squares (MSAC): among models with equal inliers the closer one wins.
    let cost = |model: &M| (0..count).map(|i| distance(model, i).powi(2).min(limit)).sum::<f64>();
    let inliers = |model: &M| (0..count).filter(|&i| distance(model, i) <= search.tolerance).collect::<Vec<_>>();

    let mut rng = Pcg64Mcg::seed_from_u64(search.seed);
    let mut best: Option<(f64, M)> = None;
    let mut needed = search.draws;
    let mut draw = 0;
    while draw < needed {
        draw += 1;
        let mut sample = [0usize; K];
        for k in 0..K {
            loop {
                let i = rng.random_range(0..count);
                if !sample[..k].contains(&i) {
                    sample[k] = i;
                    break;
                }
            }
        }
        let Some(model) = minimal(&sample) else { continue };
        let score = cost(&model);
        if best.as_ref().is_some_and(|(b, _)| score >= *b) {
            continue;
        }
        let (mut score, mut model) = (score, model);
        for _ in 0..4 {
            let Some(refined) = refit(&inliers(&model)) else { break };
            let refined_score = cost(&refined);
            if refined_score >= score {
                break;
            }
            (score, model) = (refined_score, refined);
        }
        let share = inliers(&model).len() as f64 / count as f64;
        // So many draws hold a sample without an outlier with the wanted probability: more would find the same model.
        let clean = share.powi(K as i32).min(1.0 - 1e-12);
        needed = needed.min(((1.0 - CONFIDENCE).ln() / (1.0 - clean).ln()).ceil().max(1.0) as usize);
        best = Some((score, model));
    }
    best.map(|(_, model)| {
        let inliers = inliers(&model);
        Consensus { model, inliers }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A line y = 2x + 1 with a third of the points thrown far away.
    #[test]
    fn finds_a_line_among_outliers_and_refines_it() {
        let data: Vec<(f64, f64)> = (0..60)
            .map(|i| {
                let x = f64::from(i) * 0.1;
                let wobble = if i % 2 == 0 { 0.01 } else { -0.01 };
                (x, if i % 3 == 0 { 30.0 - f64::from(i) } else { 2.0 * x + 1.0 + wobble })
            })
            .collect();
        let least_squares = |ids: &[usize]| -> Option<(f64, f64)> {
            let n = ids.len() as f64;
            let (sx, sy) = ids.iter().fold((0.0, 0.0), |a, &i| (a.0 + data[i].0, a.1 + data[i].1));
            let (mx, my) = (sx / n, sy / n);
            let (num, den) = ids
                .iter()
                .fold((0.0, 0.0), |a, &i| (a.0 + (data[i].0 - mx) * (data[i].1 - my), a.1 + (data[i].0 - mx).powi(2)));
            (den > 1e-9).then(|| (num / den, my - num / den * mx))
        };
        let found = lo_ransac::<_, 2>(
            data.len(),
            Search { draws: 100, tolerance: 0.05, seed: 7 },
            |s| least_squares(s),
            least_squares,
            |m, i| (data[i].1 - m.0 * data[i].0 - m.1).abs(),
        )
        .unwrap();
        assert_eq!(found.inliers.len(), 40);
        assert!((found.model.0 - 2.0).abs() < 0.01 && (found.model.1 - 1.0).abs() < 0.02, "{:?}", found.model);
    }

    #[test]
    fn too_few_data_give_no_model() {
        let none = lo_ransac::<(), 3>(
            2,
            Search { draws: 10, tolerance: 1.0, seed: 0 },
            |_| Some(()),
            |_| Some(()),
            |(), _| 0.0,
        );
        assert!(none.is_none());
    }
}
