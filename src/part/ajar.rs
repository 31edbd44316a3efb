//! How far a part stands open where a clip begins to open it or ends closing it: people leave doors ajar (ours).

use super::leaf::{self, Leaf};
use super::openings::{self, Opening};
use super::views::View;
use crate::articulation::Articulation;
use crate::config;
use crate::geometry::{Face, Rect};

/// What is known of a clip before its closed end is looked at.
#[derive(Debug, Clone, Copy)]
pub struct Known {
    /// Opening at the clip's open end, rad or m.
    pub end: f64,
    /// Opening that the hand went through, rad or m.
    pub went: f64,
    /// Standard deviation of `went`.
    pub went_std: f64,
    /// Thickness of the leaf, metres.
    pub board_m: f64,
    /// Share of all closings that shut the part, and of openings that begin with it shut (`priors.ranges.shut_share`).
    pub shut: f64,
}

/// The opening at the closed end of a clip, from the depth of `views` there and from how far the hand went. Zero where being
/// shut is at least as likely, or where no view tells.
#[must_use]
pub fn ajar(
    face: &Face,
    rect: &Rect,
    joint: &Articulation,
    views: &[View],
    known: &Known,
    config: &config::Part,
) -> Opening {
    /// Numerics: openings that are tried, at most.
    const MOST_STEPS: usize = 100;
    let leaf = Leaf::of(face, rect, known.board_m, &config.leaf);
    let reach = leaf.points().iter().map(|p| joint.lever(p)).fold(0.0, f64::max);
    let step = (config.openings.step_m / reach.max(config.least_lever_m)).max(known.end / MOST_STEPS as f64);
    let at: Vec<f64> = (1..).map(|k| f64::from(k) * step).take_while(|x| *x < known.end).collect();
    let before: Vec<&View> = views.iter().filter(|view| leaf::shows(&leaf, view)).collect();
    if at.is_empty() || before.is_empty() {
        return Opening::SHUT;
    }
    let by_hand = |x: f64| openings::hand_log((known.end - x - known.went) / known.went_std, config.openings.tail);
    let seen: Vec<Vec<f64>> = before
        .iter()
        .map(|view| {
            let bias_m = leaf::front_bias_m(face, rect, view);
            at.iter().map(|&x| leaf::odds(&leaf, joint, x, view, bias_m, None)).collect()
        })
        .collect();
    let best: Vec<f64> = seen.iter().map(|odds| odds.iter().copied().fold(0.0, f64::max)).collect();
    let weights: Vec<f64> = at
        .iter()
        .enumerate()
        .map(|(k, &x)| {
            // A part that stands ajar does so in every view; one that is still on its way is elsewhere in each. A view that tells
            // nothing of a place does not vouch for it.
            if seen.iter().zip(&best).any(|(odds, best)| odds[k] <= 0.0 || odds[k] < best - config.by_far_nats) {
                return 0.0;
            }
            // A hand alone does not tell, as it may have been lost on its way: views first.
            let least = seen.iter().map(|odds| odds[k]).fold(f64::INFINITY, f64::min);
            (least + by_hand(x) - by_hand(0.0)).exp() * (1.0 - known.shut) / at.len() as f64
        })
        .collect();
    let total: f64 = weights.iter().sum();
    if !total.is_finite() || total <= known.shut {
        return Opening::SHUT;
    }
    let mean = at.iter().zip(&weights).map(|(x, w)| x * w / total).sum::<f64>();
    let variance = at.iter().zip(&weights).map(|(x, w)| (x - mean).powi(2) * w / total).sum::<f64>();
    Opening { value: mean, std: variance.sqrt(), informed: true }
}

#[cfg(test)]
mod tests {
    use super::super::views::drawn;
    use super::*;
    use crate::articulation::JointKind;
    use crate::math::{Point, Vector};

    fn door() -> Articulation {
        Articulation { kind: JointKind::Revolute, axis: -Vector::z(), origin: Point::new(-0.25, 0.0, 0.0) }
    }

    /// What is said of a door that stands at `openings` in as many views, after a hand that went `went` of 1.2 rad.
    fn found(openings: &[f64], went: f64) -> Opening {
        let pose = drawn::pose(Point::new(0.5, -1.0, 0.4));
        let sketches: Vec<_> = openings.iter().map(|x| drawn::sketch(&pose, &door(), *x)).collect();
        let grip = drawn::face().center;
        let views: Vec<View> = sketches.iter().map(|s| drawn::view(s, &pose, grip)).collect();
        let known = Known { end: 1.2, went, went_std: 0.1, board_m: 0.018, shut: 0.8 };
        ajar(&drawn::face(), &drawn::rect(), &door(), &views, &known, &drawn::CONFIG)
    }

    #[test]
    fn a_door_left_ajar_is_seen_to_be() {
        let left = found(&[0.3, 0.3], 0.95);
        assert!(left.informed && (left.value - 0.3).abs() < 0.03 && left.std < 0.03, "{left:?}");
        // Whatever the hand says.
        assert!((found(&[0.3], 1.2).value - 0.3).abs() < 0.03);
    }

    #[test]
    fn a_door_that_was_shut_stays_shut() {
        for shut in [found(&[0.0, 0.0], 1.2), found(&[0.0], 0.8), found(&[], 0.8), found(&[0.4, 0.2, 0.0], 1.2)] {
            assert_eq!(shut, Opening::SHUT);
        }
    }
}
