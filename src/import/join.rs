//! Joins of timed streams: by time on one clock, else by the image's name, else by the frame's number.

use serde::Serialize;

use super::capture::At;
use crate::math::{Pose, stats};

/// What two streams were joined by.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum By {
    /// Time, on one clock.
    Time,
    /// Time, on clocks that nothing says are one.
    Overlap,
    /// The image's name.
    Name,
    /// The frame's number.
    Index,
    /// Nothing: no item has a frame.
    Nothing,
}

impl By {
    /// In words.
    #[must_use]
    pub fn words(self) -> &'static str {
        match self {
            Self::Time => "time",
            Self::Overlap => "time (clocks taken to be one)",
            Self::Name => "name",
            Self::Index => "frame number",
            Self::Nothing => "nothing",
        }
    }
}

/// The frame of each item.
#[derive(Debug, Clone, PartialEq)]
pub struct Joined {
    /// What they were joined by.
    pub by: By,
    /// Index of each item's frame; `None` where there is none near enough.
    pub frame_of: Vec<Option<usize>>,
    /// How far in time the furthest joined item is from its frame, seconds; 0 where they were not joined by time.
    pub furthest_secs: f64,
}

/// Half of the median step between times, seconds: the largest gap at which a frame is still the nearest one. `None` for
/// fewer than two times.
#[must_use]
pub fn half_period(times: impl Iterator<Item = f64>) -> Option<f64> {
    let mut times: Vec<f64> = times.collect();
    times.sort_by(f64::total_cmp);
    let steps: Vec<f64> = times.windows(2).map(|w| w[1] - w[0]).filter(|s| *s > 0.0).collect();
    stats::median(&steps).map(|step| 0.5 * step)
}

/// Joins items to frames. `is_one_clock`: whether both streams' times are on one clock; `gap_secs`: the largest distance in
/// time. Of the ways that both sides allow, the first one that joins half of the items (time on one clock: any), else the one that
/// joins most.
pub fn join<'a>(
    frames: &[At],
    items: impl Iterator<Item = &'a At> + Clone,
    is_one_clock: bool,
    gap_secs: f64,
) -> Joined {
    let total = items.clone().count();
    let order = if is_one_clock { vec![By::Time, By::Name, By::Index] } else { vec![By::Name, By::Index, By::Overlap] };
    let mut best = Joined { by: By::Nothing, frame_of: vec![None; total], furthest_secs: 0.0 };
    let mut most = 0;
    for by in order {
        let joined = match by {
            By::Time | By::Overlap => by_time(frames, items.clone(), by, gap_secs),
            By::Name => by_name(frames, items.clone()),
            By::Index | By::Nothing => by_index(frames, items.clone()),
        };
        let count = joined.frame_of.iter().flatten().count();
        if count > most {
            (most, best) = (count, joined);
        }
        // What a clock joins is right; names and numbers may agree by chance for a few.
        if most > 0 && (by == By::Time || 2 * most >= total.min(frames.len())) {
            break;
        }
    }
    best
}

/// [`join`]; where nothing meets on clocks that nothing says are one, with the items' times counted from the first frame. Also
/// what was added to their times, seconds.
pub fn join_or_count(frames: &[At], items: &[At], is_one_clock: bool, gap_secs: f64) -> (Joined, f64) {
    let joined = join(frames, items.iter(), is_one_clock, gap_secs);
    let first = frames.iter().filter_map(|f| f.time_secs).min_by(f64::total_cmp);
    let (By::Nothing, false, Some(first)) = (joined.by, is_one_clock, first) else { return (joined, 0.0) };
    let counted: Vec<At> = items.iter().map(|i| i.later(first)).collect();
    let counted = join(frames, counted.iter(), false, gap_secs);
    if counted.by == By::Nothing { (joined, 0.0) } else { (counted, first) }
}

fn by_time<'a>(frames: &[At], items: impl Iterator<Item = &'a At>, by: By, gap_secs: f64) -> Joined {
    let mut times: Vec<(f64, usize)> =
        frames.iter().enumerate().filter_map(|(i, f)| f.time_secs.map(|t| (t, i))).collect();
    times.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut furthest_secs = 0.0f64;
    let frame_of = items
        .map(|item| {
            let (index, distance) = nearest(&times, item.time_secs?)?;
            // A time that was rounded in a file is still at half a period.
            (distance <= gap_secs * 1.001 + 1e-6).then(|| {
                furthest_secs = furthest_secs.max(distance);
                index
            })
        })
        .collect();
    Joined { by, frame_of, furthest_secs }
}

/// The entry nearest in time: its value and the distance, seconds. `times` is sorted.
fn nearest(times: &[(f64, usize)], at: f64) -> Option<(usize, f64)> {
    let after = times.partition_point(|(t, _)| *t < at);
    let before = after.checked_sub(1);
    [before, Some(after)]
        .into_iter()
        .flatten()
        .filter_map(|i| times.get(i))
        .map(|(t, index)| (*index, (t - at).abs()))
        .min_by(|a, b| a.1.total_cmp(&b.1))
}

fn by_name<'a>(frames: &[At], items: impl Iterator<Item = &'a At>) -> Joined {
    let names: std::collections::BTreeMap<&str, usize> =
        frames.iter().enumerate().filter_map(|(i, f)| f.name.as_deref().map(|n| (n, i))).collect();
    let frame_of = items.map(|item| names.get(item.name.as_deref()?).copied()).collect();
    Joined { by: By::Name, frame_of, furthest_secs: 0.0 }
}

fn by_index<'a>(frames: &[At], items: impl Iterator<Item = &'a At>) -> Joined {
    let indices: std::collections::BTreeMap<usize, usize> =
        frames.iter().enumerate().filter_map(|(i, f)| f.index.map(|n| (n, i))).collect();
    let frame_of = items.map(|item| indices.get(&item.index?).copied()).collect();
    Joined { by: By::Index, frame_of, furthest_secs: 0.0 }
}

/// Poses in the order of their times.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct PoseTrack {
    times: Vec<f64>,
    poses: Vec<Pose>,
}

impl PoseTrack {
    /// From poses with times, in any order; of several at one time the first one stays.
    #[must_use]
    pub fn of(mut items: Vec<(f64, Pose)>) -> Self {
        items.retain(|(t, _)| t.is_finite());
        items.sort_by(|a, b| a.0.total_cmp(&b.0));
        items.dedup_by(|b, a| a.0 == b.0);
        let (times, poses) = items.into_iter().unzip();
        Self { times, poses }
    }

    /// The pose at a time: between two that are at most `gap_secs` apart, else the nearest one within half of that.
    #[must_use]
    pub fn at(&self, time_secs: f64, gap_secs: f64) -> Option<Pose> {
        let after = self.times.partition_point(|t| *t < time_secs);
        let get = |i: usize| Some((*self.times.get(i)?, self.poses.get(i)?));
        let next = get(after);
        let last = after.checked_sub(1).and_then(get);
        if let (Some((t0, a)), Some((t1, b))) = (last, next)
            && t1 - t0 <= gap_secs
        {
            let share = (time_secs - t0) / (t1 - t0);
            // Opposite rotations have no way between them; a camera does not turn so within a gap.
            return a.try_lerp_slerp(b, share, 1e-9).or(Some(if share < 0.5 { *a } else { *b }));
        }
        [last, next]
            .into_iter()
            .flatten()
            .map(|(t, pose)| ((t - time_secs).abs(), pose))
            .filter(|(distance, _)| *distance <= 0.5 * gap_secs)
            .min_by(|a, b| a.0.total_cmp(&b.0))
            .map(|(_, pose)| *pose)
    }

    /// First and last time, seconds; `None` for no pose.
    #[must_use]
    pub fn span(&self) -> Option<[f64; 2]> {
        Some([*self.times.first()?, *self.times.last()?])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Vector;

    fn frames() -> Vec<At> {
        (0..10)
            .map(|i| At::time(100.0 + 0.1 * f64::from(i)).with_name(&format!("a/f{i}.png")).with_index(i as usize))
            .collect()
    }

    #[test]
    fn times_join_on_one_clock_to_the_nearest_within_the_gap() {
        let items = [At::time(100.04), At::time(100.26), At::time(105.0)];
        let joined = join(&frames(), items.iter(), true, 0.05);
        assert_eq!((joined.by, joined.frame_of), (By::Time, vec![Some(0), Some(3), None]));
        assert!((joined.furthest_secs - 0.04).abs() < 1e-6);
    }

    #[test]
    fn names_come_before_times_of_another_clock() {
        let items = [At { name: Some("f4".into()), time_secs: Some(100.0), index: Some(1) }];
        assert_eq!(join(&frames(), items.iter(), false, 0.05).frame_of, [Some(4)]);
        assert_eq!(join(&frames(), items.iter(), true, 0.05).frame_of, [Some(0)]);
        let items = [At { name: Some("other".into()), ..At::index(7) }];
        let joined = join(&frames(), items.iter(), false, 0.05);
        assert_eq!((joined.by, joined.frame_of), (By::Index, vec![Some(7)]));
        let none = join(&frames(), [At::default()].iter(), true, 0.05);
        assert_eq!(none.by, By::Nothing);
    }

    #[test]
    fn times_that_meet_no_frame_count_from_the_first_one_unless_the_clock_is_known() {
        let items = [At::time(0.0), At::time(0.31), At::time(7.0)];
        let (joined, later) = join_or_count(&frames(), &items, false, 0.05);
        assert_eq!((joined.by, later, joined.frame_of), (By::Overlap, 100.0, vec![Some(0), Some(3), None]));
        assert_eq!(join_or_count(&frames(), &items, true, 0.05).0.by, By::Nothing);
        let (joined, later) = join_or_count(&frames(), &[At::time(100.5)], false, 0.05);
        assert_eq!((joined.frame_of, later), (vec![Some(5)], 0.0));
    }

    #[test]
    fn poses_are_interpolated_only_within_the_gap() {
        let at = |x: f64| Pose::from_parts(Vector::new(x, 0.0, 0.0).into(), crate::math::rotation(&Vector::z(), x));
        let track = PoseTrack::of(vec![(1.0, at(1.0)), (0.0, at(0.0)), (9.0, at(2.0))]);
        let half = track.at(0.5, 1.0).unwrap();
        assert!((half.translation.vector.x - 0.5).abs() < 1e-12 && (half.rotation.angle() - 0.5).abs() < 1e-9);
        assert!(track.at(5.0, 1.0).is_none());
        assert_eq!(track.at(9.4, 1.0).unwrap(), at(2.0));
        assert_eq!(track.at(0.0, 1.0).unwrap(), at(0.0));
    }
}
