//! How long the rest of a batch takes.

/// Recordings that have to be finished before anything is said: of fewer the spread is not to be had.
const MIN_FINISHED: usize = 3;

/// From and to, seconds: the rest of a batch of which `left` recordings remain on `jobs` workers, from what the finished ones
/// took. Recordings differ: the range is two standard errors to either side, those of the mean of the finished ones among
/// them. `None` where too few are finished.
#[must_use]
pub fn rest(finished_secs: &[f64], left: usize, jobs: usize) -> Option<[f64; 2]> {
    let n = finished_secs.len();
    if n < MIN_FINISHED || jobs == 0 {
        return None;
    }
    let count = n as f64;
    let mean = finished_secs.iter().sum::<f64>() / count;
    let variance = finished_secs.iter().map(|s| (s - mean).powi(2)).sum::<f64>() / (count - 1.0);
    let left_count = left as f64;
    let spread = 2.0 * (variance * left_count * (1.0 + left_count / count)).sqrt();
    // No worker has less than one recording to do while any is left.
    let workers = jobs.min(left.max(1)) as f64;
    let total = left_count * mean;
    Some([(total - spread).max(0.0) / workers, (total + spread) / workers])
}

/// An estimate for people.
#[must_use]
pub fn words(rest: [f64; 2]) -> String {
    let [from, to] = rest.map(|secs| {
        if secs < 100.0 {
            format!("{secs:.0} s")
        } else if secs < 6000.0 {
            format!("{:.0} min", secs / 60.0)
        } else {
            format!("{:.1} h", secs / 3600.0)
        }
    });
    if from == to { format!("{to} left") } else { format!("{from} to {to} left") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_recordings_leave_no_doubt_and_different_ones_do() {
        assert_eq!(rest(&[2.0, 2.0], 10, 2), None);
        assert_eq!(rest(&[2.0; 4], 10, 2), Some([10.0, 10.0]));
        let [from, to] = rest(&[1.0, 3.0, 1.0, 3.0], 10, 2).unwrap();
        assert!(from < 10.0 && to > 10.0 && from > 0.0, "{from} {to}");
        assert_eq!(rest(&[2.0; 4], 0, 2), Some([0.0, 0.0]));
        // One recording is done by one worker.
        assert_eq!(rest(&[2.0; 4], 1, 8), Some([2.0, 2.0]));
    }

    #[test]
    fn an_estimate_is_told_in_units_that_fit() {
        assert_eq!(words([10.0, 10.2]), "10 s left");
        assert_eq!(words([90.0, 160.0]), "90 s to 3 min left");
        assert_eq!(words([5000.0, 9000.0]), "83 min to 2.5 h left");
    }
}
