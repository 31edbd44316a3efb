//! How a person's hand went through a motion in time.

use serde::{Deserialize, Serialize};

use crate::articulation::Action;
use crate::config;
use crate::hands::Trajectory;
use crate::inference::{ENDS, openings};
use crate::math::stats;
use crate::twin::Part;

/// Numerics: steps from the first skew to the last.
const SKEW_STEPS: u32 = 32;
/// Arithmetic: share of the duration after which a minimum jerk has done a tenth of its way.
const TENTH: f64 = 0.246_636_5;

/// Where a timing comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum TimingSource {
    /// A clip that goes this way.
    Recorded,
    /// A clip that goes the other way, backwards.
    Reversed,
    /// Nobody: minimum jerk at a calm speed.
    MinimumJerk,
}

/// The timing of a motion over the whole range.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Timing {
    /// Where it comes from.
    pub source: TimingSource,
    /// The clip of median duration; `None` where there is none.
    pub clip: Option<String>,
    /// Seconds.
    pub duration_secs: f64,
    /// The way done at a share `u` of the duration is that of a minimum jerk at `u^skew`.
    pub skew: f64,
}

/// Share of the way that is done after a share of the duration.
#[must_use]
pub fn progress(share: f64, skew: f64) -> f64 {
    let u = share.clamp(0.0, 1.0).powf(skew);
    u * u * u * (10.0 + u * (6.0 * u - 15.0))
}

/// The timing of one way through a part's range, of the clip of median duration; `hands` are all clips of the part.
#[must_use]
pub fn timing(part: &Part, hands: &[(String, &Trajectory)], action: Action, config: &config::Primitives) -> Timing {
    let [shortest, longest] = config.secs;
    for (source, wanted) in [
        (TimingSource::Recorded, action),
        (TimingSource::Reversed, if action == Action::Open { Action::Close } else { Action::Open }),
    ] {
        let backwards = source == TimingSource::Reversed;
        let mut told: Vec<([f64; 2], &str)> = hands
            .iter()
            .filter(|(_, hand)| hand.action == wanted)
            .filter_map(|(clip, hand)| Some((measured(part, hand, backwards, config)?, clip.as_str())))
            .collect();
        told.sort_by(|a, b| a.0[0].total_cmp(&b.0[0]).then(a.1.cmp(b.1)));
        if let Some(([secs, skew], clip)) = told.get(told.len().saturating_sub(1) / 2) {
            let duration_secs = secs.clamp(shortest, longest);
            return Timing { source, clip: Some((*clip).to_owned()), duration_secs, skew: *skew };
        }
    }
    let way = part.joint.articulation.lever(&part.handle) * part.joint.upper;
    // Arithmetic: a minimum jerk is 15/8 as fast as its mean at its fastest.
    let duration_secs = (1.875 * way / config.calm_m_per_s).clamp(config.calm_secs, longest);
    Timing { source: TimingSource::MinimumJerk, clip: None, duration_secs, skew: 1.0 }
}

/// Seconds that a hand would need for the whole range at its speed, and its skew; `None` where it tells neither.
fn measured(part: &Part, hand: &Trajectory, backwards: bool, config: &config::Primitives) -> Option<[f64; 2]> {
    if hand.samples.is_empty() {
        return None;
    }
    let raw = openings(&part.joint.articulation, &hand.closed_grip(), &hand.positions());
    let (low, high) = (stats::quantile(&raw, ENDS)?, stats::quantile(&raw, 1.0 - ENDS)?);
    let way = high - low;
    if !way.is_finite() || way < config.told_share * part.joint.upper {
        return None;
    }
    // Time and share of the way in the order of the motion that is wanted, which goes from 0 to 1.
    let falls = (hand.action == Action::Close) != backwards;
    let mut steps: Vec<[f64; 2]> = hand
        .samples
        .iter()
        .zip(&raw)
        .map(|(s, opening)| {
            let share = (opening - low) / way;
            [if backwards { -s.time_secs } else { s.time_secs }, if falls { 1.0 - share } else { share }]
        })
        .collect();
    if backwards {
        steps.reverse();
    }
    let half = steps.iter().position(|s| s[1] >= 0.5)?;
    let tenth = steps[..half].iter().rposition(|s| s[1] <= 0.1)?;
    let most = half + steps[half..].iter().position(|s| s[1] >= 0.9)?;
    let begin = crossing(&steps, tenth + 1, 0.1)?;
    let (middle, end) = (crossing(&steps, half, 0.5)?, crossing(&steps, most, 0.9)?);
    if end - begin < 1e-3 {
        return None;
    }
    let skew = skew_of((middle - begin) / (end - begin), config.skews);
    let [u, _, v] = marks(skew);
    Some([(end - begin) / (v - u) * part.joint.upper / way, skew])
}

/// When a share is reached between the step before `at` and that step.
fn crossing(steps: &[[f64; 2]], at: usize, level: f64) -> Option<f64> {
    let after = steps.get(at)?;
    let Some(before) = at.checked_sub(1).and_then(|i| steps.get(i)) else { return Some(after[0]) };
    let rise = after[1] - before[1];
    let share = if rise > 1e-9 { ((level - before[1]) / rise).clamp(0.0, 1.0) } else { 1.0 };
    Some(before[0] + share * (after[0] - before[0]))
}

/// Shares of the duration at which a tenth, a half and nine tenths of the way are done.
fn marks(skew: f64) -> [f64; 3] {
    [TENTH, 0.5, 1.0 - TENTH].map(|u| u.powf(1.0 / skew))
}

/// The skew whose half of the way lies as given between its tenth and its nine tenths.
fn skew_of(middle: f64, [least, most]: [f64; 2]) -> f64 {
    let of = |step: u32| least + (most - least) * f64::from(step) / f64::from(SKEW_STEPS);
    let off = |skew: f64| {
        let [u, m, v] = marks(skew);
        ((m - u) / (v - u) - middle).abs()
    };
    (0..=SKEW_STEPS).map(of).min_by(|a, b| off(*a).total_cmp(&off(*b))).unwrap_or(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::primitives::tests::{door, hand};

    #[test]
    fn a_tenth_is_where_it_is_said_to_be() {
        assert!((progress(TENTH, 1.0) - 0.1).abs() < 1e-6);
        assert_eq!([progress(0.0, 0.7), progress(1.0, 1.3)], [0.0, 1.0]);
    }

    #[test]
    fn a_hand_tells_its_duration_and_its_skew() {
        let part = door();
        for skew in [0.8, 1.0, 1.3] {
            // Over two thirds of the range: the whole takes half as long again.
            let open = hand(&part, Action::Open, 2.0, skew, part.joint.upper / 1.5);
            let told = timing(&part, &[("a".to_owned(), &open)], Action::Open, &config::Primitives::default());
            assert_eq!((told.source, told.clip.as_deref()), (TimingSource::Recorded, Some("a")));
            assert!((told.duration_secs - 3.0).abs() < 0.3, "{skew}: {told:?}");
            assert!((told.skew - skew).abs() < 0.15, "{skew}: {told:?}");
        }
    }

    #[test]
    fn of_three_clips_the_median_one_counts_and_another_way_is_played_backwards() {
        let part = door();
        let hands: Vec<Trajectory> =
            [1.0, 5.0, 2.0].iter().map(|s| hand(&part, Action::Close, *s, 1.3, part.joint.upper)).collect();
        let named: Vec<(String, &Trajectory)> =
            ["a", "b", "c"].iter().zip(&hands).map(|(n, h)| ((*n).to_owned(), h)).collect();
        let close = timing(&part, &named, Action::Close, &config::Primitives::default());
        assert_eq!((close.source, close.clip.as_deref()), (TimingSource::Recorded, Some("c")));
        let open = timing(&part, &named, Action::Open, &config::Primitives::default());
        assert_eq!((open.source, open.clip.as_deref()), (TimingSource::Reversed, Some("c")));
        // What begins slowly ends slowly backwards, which is to begin fast.
        assert!(close.skew > 1.1 && open.skew < 0.95, "{close:?} {open:?}");
        assert!((open.duration_secs - 2.0).abs() < 0.3 && (close.duration_secs - 2.0).abs() < 0.3);
    }

    #[test]
    fn without_a_hand_it_is_calm() {
        let part = door();
        let told = timing(&part, &[], Action::Open, &config::Primitives::default());
        let way = part.joint.articulation.lever(&part.handle) * part.joint.upper;
        assert_eq!((told.source, told.skew, told.clip), (TimingSource::MinimumJerk, 1.0, None));
        assert!((told.duration_secs - 1.875 * way / config::Primitives::default().calm_m_per_s).abs() < 1e-9);
    }
}
