//! Order statistics and small helpers. NaN sorts last; an empty slice gives `None`.

/// Standard deviation of a normal variable over the median of its absolute value.
pub const NORMAL_PER_MEDIAN: f64 = 1.4826;

/// The `q`-quantile (0..=1) with linear interpolation.
#[must_use]
pub fn quantile(values: &[f64], q: f64) -> Option<f64> {
    if values.is_empty() {
        return None;
    }
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let position = q.clamp(0.0, 1.0) * (sorted.len() - 1) as f64;
    let low = position.floor() as usize;
    let high = position.ceil() as usize;
    Some(sorted[low] + (sorted[high] - sorted[low]) * (position - low as f64))
}

/// The median.
#[must_use]
pub fn median(values: &[f64]) -> Option<f64> {
    quantile(values, 0.5)
}

/// The value on either side of which half of the weight lies, of (value, weight >= 0): between two values that share it evenly
/// their middle. `None` without weight.
#[must_use]
pub fn weighted_median(values: &[(f64, f64)]) -> Option<f64> {
    let mut sorted: Vec<(f64, f64)> = values.iter().copied().filter(|(_, w)| *w > 0.0).collect();
    sorted.sort_by(|a, b| a.0.total_cmp(&b.0));
    let half = 0.5 * sorted.iter().map(|(_, w)| w).sum::<f64>();
    let mut below = 0.0;
    for (i, (value, weight)) in sorted.iter().enumerate() {
        below += weight;
        if below > half * (1.0 + 1e-9) {
            return Some(*value);
        }
        if below >= half * (1.0 - 1e-9) {
            return Some(0.5 * (value + sorted.get(i + 1).map_or(*value, |next| next.0)));
        }
    }
    None
}

/// The members of a sorted list within the window that holds most of them, the first of equals; `None` for an empty one.
#[must_use]
pub fn densest(sorted: &[f64], window: f64) -> Option<std::ops::Range<usize>> {
    let mut best: Option<std::ops::Range<usize>> = None;
    let mut start = 0;
    for (end, &last) in sorted.iter().enumerate() {
        while last - sorted[start] > window {
            start += 1;
        }
        if best.as_ref().is_none_or(|b| end + 1 - start > b.len()) {
            best = Some(start..end + 1);
        }
    }
    best
}

/// Mean; `None` for an empty slice.
#[must_use]
pub fn mean(values: &[f64]) -> Option<f64> {
    (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
}

/// `ln sum exp`, minus infinity for nothing; what is not a number makes the whole so.
#[must_use]
pub fn log_sum(values: &[f64]) -> f64 {
    if values.iter().all(|v| *v == f64::NEG_INFINITY) {
        return f64::NEG_INFINITY;
    }
    let top = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    top + values.iter().map(|v| (v - top).exp()).sum::<f64>().ln()
}

/// Angles made continuous: each one moved by full turns to lie within half a turn of the one before.
#[must_use]
pub fn unwrap_angles(angles: &[f64]) -> Vec<f64> {
    let turn = std::f64::consts::TAU;
    let mut out: Vec<f64> = Vec::with_capacity(angles.len());
    for &a in angles {
        let next = out.last().map_or(a, |&last| a - ((a - last) / turn).round() * turn);
        out.push(next);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_interpolate() {
        assert_eq!(quantile(&[3.0, 1.0, 2.0], 0.5), Some(2.0));
        assert_eq!(quantile(&[1.0, 2.0], 0.25), Some(1.25));
        assert_eq!(median(&[]), None);
    }

    #[test]
    fn sums_of_logarithms_hold_where_their_exponentials_do_not() {
        const NOTHING: f64 = f64::NEG_INFINITY;
        assert_eq!([log_sum(&[]), log_sum(&[NOTHING, NOTHING])], [NOTHING, NOTHING]);
        assert_eq!(log_sum(&[-2000.0, NOTHING]), -2000.0);
        assert!((log_sum(&[1000.0, 1000.0]) - 1000.0 - 2.0f64.ln()).abs() < 1e-12);
        assert!(log_sum(&[1.0, f64::NAN]).is_nan() && log_sum(&[f64::NAN]).is_nan());
    }

    #[test]
    fn the_densest_window_is_the_first_that_holds_most() {
        assert_eq!(densest(&[0.0, 1.0, 1.1, 1.2, 5.0, 5.1, 5.2], 0.3), Some(1..4));
        assert_eq!((densest(&[], 1.0), densest(&[7.0], 1.0)), (None, Some(0..1)));
    }

    #[test]
    fn unwrapping_follows_a_door_past_half_a_turn() {
        let wrapped = [3.0, 3.1, -3.1, -3.0];
        let u = unwrap_angles(&wrapped);
        assert!(u.windows(2).all(|w| (w[1] - w[0]).abs() < 0.2), "{u:?}");
    }

    #[test]
    fn a_weighted_median_is_the_median_of_copies() {
        assert_eq!(weighted_median(&[(3.0, 1.0), (1.0, 1.0), (2.0, 1.0)]), Some(2.0));
        assert_eq!(weighted_median(&[(1.0, 2.0), (9.0, 1.0), (2.0, 1.0)]), Some(1.5));
        assert_eq!(weighted_median(&[(1.0, 1.0), (9.0, 5.0)]), Some(9.0));
        assert_eq!(weighted_median(&[(1.0, 0.0)]), None);
    }
}
