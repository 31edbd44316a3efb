//! What makes a recording unusable, whoever made it: all faults at once, each with its place.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use super::folder::MAX_COORDINATE;
use super::{Camera, Clip, Frame, HandSample, LeftOut, Recording};
use crate::error::{Error, Result};
use crate::math::{Pose, stats};

/// Faults of one kind that are listed before "and n more".
const MAX_LISTED: usize = 5;

/// Faults, with a bound on how many of one kind are spelled out.
#[derive(Default)]
pub(super) struct Faults {
    list: Vec<String>,
    counts: BTreeMap<&'static str, usize>,
}

impl Faults {
    pub(super) fn add(&mut self, kind: &'static str, text: String) {
        let count = self.counts.entry(kind).or_default();
        *count += 1;
        if *count <= MAX_LISTED {
            self.list.push(text);
        }
    }

    pub(super) fn finish(mut self, dir: &Path) -> Result<()> {
        for (kind, count) in &self.counts {
            if *count > MAX_LISTED {
                self.list.push(format!("{kind}: {} more like these", count - MAX_LISTED));
            }
        }
        if self.list.is_empty() { Ok(()) } else { Err(Error::Recording { path: dir.to_owned(), faults: self.list }) }
    }
}

/// The checks of [`Recording::checked`], on what is assembled already.
pub(super) fn all(recording: &mut Recording, faults: &mut Faults) {
    camera(&recording.camera, "camera", faults);
    if recording.frames.is_empty() {
        faults.add("frames", "frames: there are none".to_owned());
    }
    let mut last = f64::NEG_INFINITY;
    for (index, frame) in recording.frames.iter().enumerate() {
        let place = format!("frame {index}");
        time(frame.timestamp_secs, &mut last, &place, faults);
        pose(&frame.world_from_camera, &place, faults);
    }
    scale(&recording.frames, "frames", faults);
    let count = recording.frames.len();
    let clips = std::mem::take(&mut recording.clips);
    recording.clips = usable_clips(clips, count, "clips", &mut recording.left_out, faults);
    let given = std::mem::take(&mut recording.hands);
    recording.hands = usable_hands(given, count, "hands", &mut recording.left_out, faults);
    hands(&recording.hands, &recording.frames, ["hands", REACH], faults);
}

/// What hands out of the head's reach mean to who made a recording in memory.
const REACH: &str =
    "hands and camera poses must share one world frame and one unit (metres), and poses are world_from_camera";

/// `place`: the file, or what stands in its place.
pub(super) fn camera(camera: &Camera, place: &str, faults: &mut Faults) {
    let Camera { width, height, fx, fy, cx, cy } = *camera;
    // 64 megapixels: twice the largest camera that anyone wears, and an image that fits in memory many times.
    if width == 0 || height == 0 || width.saturating_mul(height) > 64 << 20 {
        faults.add("size", format!("{place}: image size {width} x {height} is not a camera's"));
    }
    // A thousand image widths see a thousandth of a radian: no lens of a head-worn camera, and far from an overflow.
    let widest = 1e3 * width.max(height) as f64;
    if ![fx, fy].iter().all(|f| *f > 1.0 && *f < widest) {
        faults.add("focal", format!("{place}: fx {fx}, fy {fy} must be focal lengths in pixels"));
    }
    if ![cx, cy].iter().all(|c| c.abs() < widest) {
        faults.add("centre", format!("{place}: cx {cx}, cy {cy} must be pixels on the image or near it"));
    }
}

/// Times do not go back. Two frames of one time are told by whoever opens the recording ([`Recording::repeated_times`]).
pub(super) fn time(time: f64, last: &mut f64, place: &str, faults: &mut Faults) {
    // Between two frames of one recording; what is further apart was taken by two clocks.
    const DAY_SECS: f64 = 86_400.0;
    if !time.is_finite() || time < *last {
        faults.add("time", format!("{place}: timestamp {time} s does not follow {last} s"));
        return;
    }
    if last.is_finite() && time - *last > DAY_SECS {
        let fault = format!("timestamp {time} s is more than a day after {last} s; write seconds of one clock");
        faults.add("time", format!("{place}: {fault}"));
    }
    *last = time;
}

pub(super) fn position(position: &[f64; 3], place: &str, faults: &mut Faults) {
    if !position.iter().all(|x| x.abs() < MAX_COORDINATE) {
        let fault = "position is not finite or overflows; drop the frame or interpolate its pose";
        faults.add("position", format!("{place}: {fault}"));
    }
}

/// A pose that is one already: of its rotation only numbers can be wrong.
fn pose(pose: &Pose, place: &str, faults: &mut Faults) {
    position(&pose.translation.vector.into(), place, faults);
    let norm = pose.rotation.quaternion().norm();
    if !norm.is_finite() || (norm - 1.0).abs() > 1e-2 {
        faults.add("rotation", format!("{place}: the rotation's quaternion has norm {norm:.4}, a rotation's has 1"));
    }
}

/// Seconds and metres, as far as all frames together tell.
pub(super) fn scale(frames: &[Frame], place: &str, faults: &mut Faults) {
    let steps: Vec<f64> = frames.windows(2).map(|w| w[1].timestamp_secs - w[0].timestamp_secs).collect();
    if let Some(step) = stats::median(&steps).filter(|s| s.is_finite() && !(1e-3..=10.0).contains(s)) {
        faults.add(
            "time unit",
            format!("{place}: frames are {step:.3e} s apart (median), a video's are 0.005 to 1 s; write seconds"),
        );
    }
    let near = |f: &&Frame| f.center().coords.iter().all(|c| c.abs() < MAX_COORDINATE);
    let furthest = frames.iter().filter(near).map(|f| f.center().coords.norm()).fold(0.0, f64::max);
    // Head-worn recordings stay in a home; a home measured in millimetres is a city.
    if furthest > 1000.0 {
        faults.add(
            "units",
            format!(
                "{place}: a camera is {furthest:.0} from the origin; positions must be metres (are these millimetres?)"
            ),
        );
    }
}

/// The clips that fit the video. One that does not costs only itself; a fault where none does.
pub(super) fn usable_clips(
    clips: Vec<Clip>,
    frames: usize,
    place: &str,
    left_out: &mut LeftOut,
    faults: &mut Faults,
) -> Vec<Clip> {
    let mut names: BTreeSet<String> = clips.iter().map(|c| c.clip.clone()).collect();
    let mut seen = BTreeSet::new();
    let mut kept = Vec::with_capacity(clips.len());
    let mut wrong = Vec::new();
    for mut clip in clips {
        let is_new = seen.insert(clip.clip.clone());
        let (first, last) = (clip.start_frame, clip.end_frame);
        let (kind, why) = if first > last {
            ("order", format!("start_frame {first} is after end_frame {last}"))
        } else if last >= frames {
            ("outside", format!("frames {first}..={last} lie outside the video of {frames} frames"))
        } else if !is_new {
            ("name", "the name is used twice".to_owned())
        } else {
            kept.push(clip);
            continue;
        };
        wrong.push((kind, format!("{place}: clip {}: {why}", clip.clip)));
        if !is_new {
            clip.clip = another_name(&clip.clip, &mut names);
        }
        let end = frames.saturating_sub(1);
        (clip.start_frame, clip.end_frame) = (first.min(last).min(end), first.max(last).min(end));
        left_out.clips.push((clip, why));
    }
    if kept.is_empty() {
        wrong.into_iter().for_each(|(kind, text)| faults.add(kind, text));
    }
    kept
}

/// A name with a number behind it, which is no clip's yet.
fn another_name(name: &str, names: &mut BTreeSet<String>) -> String {
    let mut number = 2usize;
    loop {
        let other = format!("{name} ({number})");
        if names.insert(other.clone()) {
            return other;
        }
        number += 1;
    }
}

/// The hands that fit the video, by frame and side. A few that are not finite cost only themselves.
pub(super) fn usable_hands(
    mut hands: Vec<HandSample>,
    frames: usize,
    place: &str,
    left_out: &mut LeftOut,
    faults: &mut Faults,
) -> Vec<HandSample> {
    let all = hands.len();
    let mut wild = Vec::new();
    hands.retain(|s| {
        let inside = s.frame < frames;
        if !inside {
            faults.add("hand frame", format!("{place}: frame {}: the video has {frames} frames", s.frame));
        }
        let finite = s.tips.iter().all(|p| p.coords.iter().all(|x| x.abs() < MAX_COORDINATE));
        if !finite {
            wild.push(s.frame);
        }
        inside && finite
    });
    // A few of them cost only themselves; most of them are an export gone wrong.
    if 2 * wild.len() > all {
        for frame in wild {
            let fault = "a fingertip is not finite or overflows; leave the hand out";
            faults.add("hand", format!("{place}: frame {frame}: {fault}"));
        }
    } else if let Some(first) = wild.first() {
        let (count, fault) = (wild.len(), "a fingertip is not finite or overflows");
        left_out
            .notes
            .push(format!("{place}: {count} of {all} hands are left out: {fault} (frame {first} is the first)"));
    }
    hands.sort_by_key(|s| (s.frame, s.side));
    hands
}

/// A hand's own size tells the unit, whatever the scene is like. `place`: where hands come from; `way`: what to do where they are
/// out of the head's reach, empty where that is not judged.
pub(super) fn hands(hands: &[HandSample], frames: &[Frame], [place, way]: [&str; 2], faults: &mut Faults) {
    if hands.is_empty() {
        faults.add("hands", format!("{place}: no hand in any frame"));
        return;
    }
    let spreads: Vec<f64> = hands.iter().map(|s| (s.tips[0] - s.tips[1]).norm()).collect();
    let distances: Vec<f64> =
        hands.iter().filter_map(|s| frames.get(s.frame).map(|f| (s.grasp() - f.center()).norm())).collect();
    if let Some(spread) = stats::median(&spreads)
        && !(0.002..0.3).contains(&spread)
    {
        faults.add(
            "units",
            format!(
                "hands: thumb and index tips are {spread:.3} apart (median), a hand's are 0.01 to 0.2 m; \
                 convert the hands to metres"
            ),
        );
    } else if let Some(distance) = stats::median(&distances)
        && !way.is_empty()
        && !(0.05..3.0).contains(&distance)
    {
        faults.add(
            "units",
            format!("hands are {distance:.2} from the camera (median), an arm reaches 0.2 to 1.2 m; {way}"),
        );
    }
}
