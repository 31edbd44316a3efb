//! Hands, contact and narrations of the result.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::Matrix3;

use super::axes::{Convention, camera_matrix};
use super::capture::{At, Capture, ClipAt, HandStream, JointFrame};
use super::choices::ImportOptions;
use super::frame_timeline::{Draft, FrameTimeline};
use super::imported::Hand;
use super::join::{By, PoseTrack, join, join_or_count};
use super::names;
use super::report::{ImportReport, StreamReport, source_name};
use super::world_placement::WorldPlacement;
use crate::math::{Point, Pose, Vector, centroid};
use crate::recording::{Clip, Side};

/// From joints of a file to the result's world.
struct Bridge<'a> {
    frame: JointFrame,
    unit_m: f64,
    /// Of the capture with the hands.
    own: Convention,
    /// Poses of the capture with the hands, where its world is not that of the poses.
    own_track: Option<PoseTrack>,
    body_from_camera: Option<Pose>,
    track: &'a PoseTrack,
    place: &'a WorldPlacement,
    pose_gap_secs: f64,
    is_one_clock: bool,
    /// What was added to the hands' times so that they meet the frames, seconds.
    later_secs: f64,
    focal_per_width: Option<f64>,
}

impl Bridge<'_> {
    /// A hand's joints in the result's world; `None` where it cannot be placed.
    fn joints(
        &self,
        joints: &[Option<[f64; 3]>; 21],
        time_secs: Option<f64>,
        frame: &Draft,
    ) -> Option<[Option<Point>; 21]> {
        // The camera when the hand was seen, which may be a little before or after the frame.
        let time = time_secs.filter(|_| self.is_one_clock);
        let world_from_camera =
            time.and_then(|t| self.track.at(t, self.pose_gap_secs)).unwrap_or(frame.world_from_camera);
        let shift = self.shift(joints, frame);
        let camera_from_joints = match self.frame {
            JointFrame::World => None,
            JointFrame::Camera(axes) => Some((camera_matrix(axes), Pose::identity())),
            JointFrame::Body => {
                Some((Matrix3::identity(), self.body_from_camera.map_or_else(Pose::identity, |b| b.inverse())))
            }
        };
        // Joints of another world go through the camera that both worlds know.
        let other = match &self.own_track {
            None => None,
            Some(track) => Some(track.at(time_secs? - self.later_secs, self.pose_gap_secs)?.inverse()),
        };
        Some(joints.map(|p| {
            let p = Point::from(p?);
            let in_world = match (&camera_from_joints, &other) {
                (Some((turn, pose)), _) => {
                    world_from_camera * (pose * Point::from(turn * p.coords * self.unit_m + shift))
                }
                (None, None) => self.own.point(&p),
                (None, Some(camera_from_own)) => world_from_camera * (camera_from_own * self.own.point(&p)),
            };
            let placed = match (&camera_from_joints, &other) {
                (None, None) => self.place.point(&in_world),
                // Metric offsets from a camera of arbitrary scale: only the camera's place is scaled.
                _ => {
                    let placed = self.place.pose(&world_from_camera);
                    placed * (world_from_camera.inverse() * in_world)
                }
            };
            Some(placed)
        }))
    }
}

impl Bridge<'_> {
    /// What is added to joints in the camera that were placed with another focal length: the hand as a whole goes to where the
    /// same pixels and the same size have it.
    fn shift(&self, joints: &[Option<[f64; 3]>; 21], frame: &Draft) -> Vector {
        let (Some(assumed), JointFrame::Camera(axes)) = (self.focal_per_width, self.frame) else {
            return Vector::zeros();
        };
        let points: Vec<Point> = joints
            .iter()
            .flatten()
            .map(|p| Point::from(camera_matrix(axes) * Vector::from(*p) * self.unit_m))
            .collect();
        let Some(middle) = centroid(&points) else { return Vector::zeros() };
        let o = &frame.optics;
        let factor = o.fx / (assumed * o.width as f64);
        let z = middle.z * factor;
        // Pixels beside the principal point that the assumed camera had in the image's middle.
        let aside = |size: usize, c: f64, f: f64| (0.5 * (size as f64 - 1.0) - c) / f * z;
        Vector::new(aside(o.width, o.cx, o.fx), aside(o.height, o.cy, o.fy), z - middle.z)
    }
}

/// Hands at the frames, at most one a side and frame.
pub(super) fn hands(
    captures: &[Capture],
    timeline: &FrameTimeline,
    place: &WorldPlacement,
    options: &ImportOptions,
    report: &mut ImportReport,
) -> Vec<Hand> {
    let has = |c: &Capture| c.hands.as_ref().is_some_and(|h| !h.items.is_empty());
    let Some(index) = captures.iter().position(has) else { return Vec::new() };
    let Some(source) = captures.get(index).and_then(|c| c.hands.as_ref()) else { return Vec::new() };
    let ats: Vec<At> = source.items.iter().map(|h| h.at.later(options.hand_lag_secs)).collect();
    let frames: Vec<At> = timeline.frames.iter().map(|f| f.at.clone()).collect();
    let is_one_clock = timeline.is_one_clock(captures, index);
    let (joined, later_secs) = join_or_count(&frames, &ats, is_one_clock, timeline.gap_secs);
    let ats: Vec<At> = ats.iter().map(|at| at.later(later_secs)).collect();
    if later_secs != 0.0 {
        report.changes.push("hands' times are taken to count from the first frame".to_owned());
    }
    let bridge = Bridge { later_secs, ..bridge(captures, index, source, timeline, place, options) };
    if index != timeline.posed && bridge.frame == JointFrame::World && bridge.own_track.is_none() {
        report.changes.push(format!(
            "hands of {} are taken to be in the world of {}",
            source_name(&captures[index]),
            source_name(&captures[timeline.posed])
        ));
    }
    let mut best: BTreeMap<(usize, Side), (f64, Hand)> = BTreeMap::new();
    let mut lost = 0;
    for ((item, at), frame) in source.items.iter().zip(&ats).zip(&joined.frame_of) {
        let Some((number, frame)) = frame.and_then(|f| Some((f, timeline.frames.get(f)?))) else { continue };
        let Some(joints) = bridge.joints(&source.order.to_mano(&item.joints), at.time_secs, frame) else {
            lost += 1;
            continue;
        };
        let distance = match (joined.by, at.time_secs) {
            (By::Time | By::Overlap, Some(t)) => (t - frame.time_secs).abs(),
            // Of several hands of one side the one that the detector is surest of.
            _ => 1.0 - item.score.unwrap_or(0.0),
        };
        let hand = Hand { frame: number, side: item.side, joints, contact: item.contact, score: item.score };
        let key = (number, item.side);
        if best.get(&key).is_none_or(|(old, _)| distance < *old) {
            best.insert(key, (distance, hand));
        }
    }
    let out: Vec<Hand> = best.into_values().map(|(_, hand)| hand).collect();
    if lost > 0 {
        report.dropped.push(format!("{lost} hands at times without a camera pose"));
    }
    report.streams.push(StreamReport {
        stream: "hands".to_owned(),
        count: out.len(),
        of: source.items.len(),
        source: source_name(&captures[index]),
        joined_by: joined.by.words().to_owned(),
    });
    out
}

/// From the joints of a capture's hands, which is `captures[index]`, to the result's world.
fn bridge<'a>(
    captures: &[Capture],
    index: usize,
    hands: &HandStream,
    timeline: &'a FrameTimeline,
    place: &'a WorldPlacement,
    options: &ImportOptions,
) -> Bridge<'a> {
    let capture = &captures[index];
    let is_same = index == timeline.posed;
    // Options are about the source with the poses.
    let plain = ImportOptions::default();
    let own = Convention::of(capture, if is_same { options } else { &plain });
    let own_track =
        capture.poses.as_ref().filter(|p| !is_same && hands.frame == JointFrame::World && !p.items.is_empty());
    let own_track = own_track.map(|poses| {
        PoseTrack::of(
            poses.items.iter().filter_map(|p| Some((p.at.time_secs?, own.world_from_camera(&p.pose)?))).collect(),
        )
    });
    let body = captures[timeline.posed].poses.as_ref().and_then(|p| p.body_from_camera);
    Bridge {
        frame: hands.frame,
        unit_m: hands.unit_m,
        own,
        own_track,
        body_from_camera: capture.poses.as_ref().and_then(|p| p.body_from_camera).or(body),
        track: &timeline.track,
        place,
        pose_gap_secs: options.pose_gap_secs,
        is_one_clock: timeline.is_one_clock(captures, index) && timeline.is_one_clock(captures, timeline.posed),
        later_secs: 0.0,
        focal_per_width: capture.hands_focal_per_width.filter(|f| f.is_finite() && *f > 0.0),
    }
}

/// Opinions about contact that come without joints, written onto the hands of the same frame and side.
pub(super) fn contacts(captures: &[Capture], timeline: &FrameTimeline, hands: &mut [Hand], report: &mut ImportReport) {
    let Some(index) = captures.iter().position(|c| !c.contacts.is_empty()) else { return };
    let capture = &captures[index];
    let frames: Vec<At> = timeline.frames.iter().map(|f| f.at.clone()).collect();
    let one_clock = timeline.is_one_clock(captures, index);
    let joined = join(&frames, capture.contacts.iter().map(|c| &c.at), one_clock, timeline.gap_secs);
    let mut said: BTreeMap<(usize, Side), bool> = BTreeMap::new();
    for (contact, frame) in capture.contacts.iter().zip(&joined.frame_of) {
        if let Some(frame) = frame {
            *said.entry((*frame, contact.side)).or_default() |= contact.contact;
        }
    }
    let mut count = 0;
    // A frame that the detector saw without this hand says nothing.
    for hand in hands.iter_mut() {
        if let Some(contact) = said.get(&(hand.frame, hand.side)) {
            hand.contact = Some(*contact);
            count += 1;
        }
    }
    report.streams.push(StreamReport {
        stream: "contact".to_owned(),
        count,
        of: capture.contacts.len(),
        source: source_name(capture),
        joined_by: joined.by.words().to_owned(),
    });
}

/// Narrations by frame numbers of the result. Names are made unique; a clip that holds no frame is left out.
pub(super) fn clips(captures: &[Capture], timeline: &FrameTimeline, report: &mut ImportReport) -> Vec<Clip> {
    let Some(index) = captures.iter().position(|c| !c.clips.is_empty()) else { return Vec::new() };
    let source = &captures[index];
    let chosen = of_this_video(captures, source, report);
    let later = begins_at(captures, timeline, index, &chosen, report);
    let mut out: Vec<Clip> = Vec::new();
    let mut taken = BTreeSet::new();
    let mut by = By::Nothing;
    for (i, clip) in chosen.iter().enumerate() {
        let Some((start, end, how)) = span(timeline, &clip.start.later(later), &clip.end.later(later)) else {
            continue;
        };
        by = how;
        let wanted = if clip.name.is_empty() { format!("clip_{i:03}") } else { clip.name.clone() };
        let (mut name, mut number) = (wanted.clone(), i);
        while !taken.insert(name.clone()) {
            name = format!("{wanted}_{number}");
            number += 1;
        }
        out.push(Clip {
            clip: name,
            start_frame: start,
            end_frame: end,
            narration: clip.narration.clone(),
            verb: clip.verb.clone(),
            noun: clip.noun.clone(),
        });
    }
    if out.len() < chosen.len() {
        report.dropped.push(format!("{} narrations that lie outside the frames", chosen.len() - out.len()));
    }
    report.streams.push(StreamReport {
        stream: "clips".to_owned(),
        count: out.len(),
        of: source.clips.len(),
        source: source_name(source),
        joined_by: by.words().to_owned(),
    });
    out
}

/// Of narrations of several videos those whose video the name of another source holds.
fn of_this_video<'a>(captures: &[Capture], source: &'a Capture, report: &mut ImportReport) -> Vec<&'a ClipAt> {
    let mut videos: Vec<&str> = source.clip_videos.iter().map(String::as_str).collect();
    videos.sort_unstable();
    videos.dedup();
    if videos.len() < 2 {
        return source.clips.iter().collect();
    }
    let is_other = |c: &&Capture| c.source != source.source;
    let is_meant = |video: &str| captures.iter().filter(is_other).any(|c| mentions(&c.source.to_string_lossy(), video));
    let chosen: Vec<&str> = videos.iter().copied().filter(|v| is_meant(v)).collect();
    if chosen.is_empty() {
        report.dropped.push(format!(
            "narrations of {} videos, none of which another source is named after; keep {}'s name in a source's path, or the \
             video's rows in a file of their own",
            videos.len(),
            videos.first().copied().unwrap_or_default()
        ));
    }
    let of = source.clips.iter().zip(&source.clip_videos);
    of.filter(|(_, video)| chosen.contains(&video.as_str())).map(|(clip, _)| clip).collect()
}

/// Whether a path holds a name as a whole: `P01_10` is not in `P01_101.json`.
fn mentions(path: &str, name: &str) -> bool {
    let is_word = |c: Option<char>| c.is_some_and(char::is_alphanumeric);
    !name.is_empty()
        && path.match_indices(name).any(|(at, _)| {
            let (before, after) = (path.get(..at).unwrap_or_default(), path.get(at + name.len()..).unwrap_or_default());
            !is_word(before.chars().next_back()) && !is_word(after.chars().next())
        })
}

/// What is added to the narrations' times, seconds: those on no common clock that meet no frame, and would as times from the
/// first frame on, are such.
fn begins_at(
    captures: &[Capture],
    timeline: &FrameTimeline,
    index: usize,
    clips: &[&ClipAt],
    report: &mut ImportReport,
) -> f64 {
    let (Some(first), Some(last)) = (timeline.frames.first(), timeline.frames.last()) else { return 0.0 };
    let (first, last) = (first.time_secs, last.time_secs);
    if timeline.is_one_clock(captures, index) {
        return 0.0;
    }
    let meets = |later: f64| {
        let spans = clips.iter().filter_map(|c| Some((c.start.time_secs? + later, c.end.time_secs? + later)));
        spans.filter(|(a, b)| *a <= last && *b >= first).count()
    };
    if meets(0.0) > 0 || meets(first) == 0 {
        return 0.0;
    }
    report.changes.push("narrations' times are taken to count from the first frame".to_owned());
    first
}

/// First and last frame between two places: by time where the frames have times of their own and both places one, else by
/// numbered names, by the video's frames, by counted times.
fn span(timeline: &FrameTimeline, start: &At, end: &At) -> Option<(usize, usize, By)> {
    let frames = &timeline.frames;
    let within = |by: By, first: Option<usize>, last: Option<usize>| match (first, last) {
        (Some(a), Some(b)) if a <= b => Some((a, b, by)),
        _ => None,
    };
    let by_time = || {
        let (a, b) = (start.time_secs?, end.time_secs?);
        let first = frames.iter().position(|f| f.time_secs >= a);
        within(By::Time, first, frames.iter().rposition(|f| f.time_secs <= b))
    };
    let by_index = || {
        let (a, b) = (start.index?, end.index?);
        // A name that ends with a number tells the frame as well.
        let number = |f: &Draft| {
            let named = || names::numbered(f.at.name.as_ref()?).and_then(|(_, n)| usize::try_from(n).ok());
            f.at.index.or_else(named)
        };
        let first = frames.iter().position(|f| number(f).is_some_and(|i| i >= a));
        within(By::Index, first, frames.iter().rposition(|f| number(f).is_some_and(|i| i <= b)))
    };
    let by_name = || {
        let (a, b) = (names::numbered(start.name.as_ref()?)?, names::numbered(end.name.as_ref()?)?);
        let number = |f: &Draft| {
            let (head, number) = names::numbered(f.at.name.as_ref()?)?;
            (head == a.0 && head == b.0).then_some(number)
        };
        let first = frames.iter().position(|f| number(f).is_some_and(|n| n >= a.1));
        within(By::Name, first, frames.iter().rposition(|f| number(f).is_some_and(|n| n <= b.1)))
    };
    if timeline.has_times && start.time_secs.is_some() && end.time_secs.is_some() {
        return by_time();
    }
    by_name().or_else(by_index).or_else(by_time)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_video_is_named_by_a_path_that_holds_its_whole_name() {
        assert!(mentions("data/P01_10.json", "P01_10") && mentions("P01_10/frames", "P01_10"));
        assert!(!mentions("data/P01_101.json", "P01_10") && !mentions("xP01_10", "P01_10") && !mentions("a", ""));
    }
}
