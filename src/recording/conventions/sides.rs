//! Which hand is the left one: where both are seen, the right one is right of the left one, unless arms are crossed.
//!
//! One hand alone tells nothing: both reach for what is looked at, and three fingertips have no chirality.

use std::collections::BTreeMap;

use super::{Finding, LIKELY_NATS, Subject};
use crate::math::{Point, Vector};
use crate::recording::Side;

/// Arms stay crossed, or not, for about this long, seconds: one glimpse.
const GLIMPSE_SECS: f64 = 2.0;
/// Glimpses that are needed to judge.
const LEAST: usize = 4;
/// Log odds that arms are not crossed: nine of ten glimpses.
const GLIMPSE_NATS: f64 = 2.2;
/// Log odds against trackers that swap sides: one in twenty.
const PRIOR_NATS: f64 = 3.0;

/// Left and right hands that are called by each other's name.
pub(super) fn judge(subject: &Subject) -> Option<Finding> {
    let (glimpses, crossed) = glimpses(subject);
    let nats = GLIMPSE_NATS * (2.0 * crossed - glimpses as f64) - PRIOR_NATS;
    (glimpses >= LEAST && nats >= LIKELY_NATS).then(|| Finding {
        what: "left and right hands are swapped".to_owned(),
        evidence: format!(
            "where both are seen, the right one is left of the left one {:.0} % of the time ({glimpses} glimpses of \
             {GLIMPSE_SECS} s)",
            100.0 * crossed / glimpses as f64
        ),
        remedy: "call left hands right and right hands left; the joints are the same, only who opens them is not"
            .to_owned(),
        nats,
        ruinous: false,
        fix: None,
    })
}

/// Glimpses of both hands, and how many show them crossed; a glimpse of several frames counts by its share.
fn glimpses(subject: &Subject) -> (usize, f64) {
    let mut frames: BTreeMap<usize, [Option<&Point>; 2]> = BTreeMap::new();
    for (frame, place, side) in &subject.hands {
        let slot = usize::from(*side == Side::Right);
        if let Some(hand) = frames.entry(*frame).or_default().get_mut(slot) {
            *hand = Some(place);
        }
    }
    let mut shares: BTreeMap<i64, (f64, f64)> = BTreeMap::new();
    for (frame, hands) in frames {
        let ([Some(left), Some(right)], Some(pose), Some(secs)) =
            (hands, subject.poses.get(frame), subject.secs.get(frame))
        else {
            continue;
        };
        let across: Vector = pose.rotation * Vector::x();
        let is_crossed = (right - left).dot(&across) < 0.0;
        // Saturates at times that no clock has.
        let (crossed, count) = shares.entry((secs / GLIMPSE_SECS).floor() as i64).or_default();
        *crossed += f64::from(u8::from(is_crossed));
        *count += 1.0;
    }
    (shares.len(), shares.values().map(|(crossed, count)| crossed / count).sum())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Pose;
    use crate::recording::Camera;

    /// Both hands, ten frames a second, of `frames` frames; the right one is `offset` metres right of the left one.
    fn both<'a>(frames: usize, offset: impl Fn(usize) -> f64) -> Subject<'a> {
        let hands = (0..frames).flat_map(|i| {
            let at = |x: f64| Point::new(x, 0.1, 0.6);
            [(i, at(0.0), Side::Left), (i, at(offset(i)), Side::Right)]
        });
        Subject {
            camera: Camera { width: 64, height: 48, fx: 50.0, fy: 50.0, cx: 31.5, cy: 23.5 },
            poses: vec![Pose::identity(); frames],
            secs: (0..frames).map(|i| 0.1 * i as f64).collect(),
            readings: Vec::new(),
            hands: hands.collect(),
            with_depth: Vec::new(),
            with_mask: Vec::new(),
            depth: Box::new(|_| None),
            mask: Box::new(|_| None),
        }
    }

    #[test]
    fn hands_that_are_crossed_all_the_time_are_swapped_and_those_that_cross_at_times_are_not() {
        assert_eq!(judge(&both(400, |_| 0.2)), None);
        let found = judge(&both(400, |_| -0.2)).unwrap();
        assert!(found.is_certain() && found.evidence.contains("100 % of the time (20 glimpses"), "{found:?}");
        // One long reach across, and a recording that is too short to tell.
        assert_eq!(judge(&both(400, |i| if i < 150 { -0.2 } else { 0.2 })), None);
        assert_eq!(judge(&both(40, |_| -0.2)), None);
    }
}
