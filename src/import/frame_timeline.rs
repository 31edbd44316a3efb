//! Frames of the result: which, when, from where, and which items of other streams belong to them.

use super::axes::Convention;
use super::capture::{At, Capture, ImageSource, Poses};
use super::choices::ImportOptions;
use super::join::{By, PoseTrack, half_period, join, join_or_count};
use super::optics::Optics;
use super::report::{ImportReport, StreamReport, source_name};
use crate::error::{Error, Result};
use crate::math::Pose;

/// Frames a second of a source that holds no times: most videos'.
const USUAL_FPS: f64 = 30.0;

/// An item of a capture's stream.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Item {
    /// Index of the capture.
    pub capture: usize,
    /// Index in its stream.
    pub item: usize,
}

/// A frame before worlds are joined.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Draft {
    /// Where it is in the source; its time is always there.
    pub at: At,
    /// Seconds.
    pub time_secs: f64,
    /// In the world of the capture with the poses, right-handed, its scale.
    pub world_from_camera: Pose,
    /// The colour camera.
    pub optics: Optics,
    /// Colour image.
    pub image: Option<Item>,
    /// Depth.
    pub depth: Option<Item>,
    /// Mask.
    pub mask: Option<Item>,
    /// Normals.
    pub normals: Option<Item>,
    /// Segments.
    pub segments: Option<Item>,
    /// Whether a hand belongs to it.
    pub has_hand: bool,
}

/// The frames, and what they were joined with.
pub(super) struct FrameTimeline {
    /// In time order.
    pub frames: Vec<Draft>,
    /// The capture that the frames are of.
    pub base: usize,
    /// The capture with the poses.
    pub posed: usize,
    /// Its poses, by their own times.
    pub track: PoseTrack,
    /// Half of the period of all frames of the base, or the user's gap, seconds.
    pub gap_secs: f64,
    /// Whether the times are the base's own, not counted from a frame rate.
    pub has_times: bool,
}

impl FrameTimeline {
    /// Whether a capture's times are on the clock of the frames' times.
    pub fn is_one_clock(&self, captures: &[Capture], other: usize) -> bool {
        self.has_times && one_clock(captures, self.base, other)
    }
}

fn one_clock(captures: &[Capture], a: usize, b: usize) -> bool {
    let clock = |i: usize| captures.get(i).and_then(|c| c.clock.as_deref());
    a == b || (clock(a).is_some() && clock(a) == clock(b))
}

/// The first capture that has something.
fn first(captures: &[Capture], has: impl Fn(&Capture) -> bool) -> Option<usize> {
    captures.iter().position(has)
}

fn stream(report: &mut ImportReport, name: &str, count: usize, of: usize, capture: &Capture, by: &str) {
    report.streams.push(StreamReport {
        stream: name.to_owned(),
        count,
        of,
        source: source_name(capture),
        joined_by: by.to_owned(),
    });
}

/// The frames of the stream that shows most: images, else depth, else poses.
fn base_frames(captures: &[Capture]) -> Option<(usize, Vec<At>)> {
    if let Some(i) = first(captures, |c| !c.images.is_empty()) {
        return Some((i, captures[i].images.iter().map(|x| x.at.clone()).collect()));
    }
    let depth = |c: &Capture| c.depth.as_ref().map(|d| d.items.iter().map(|x| x.at.clone()).collect::<Vec<_>>());
    if let Some(i) = first(captures, |c| depth(c).is_some_and(|d| !d.is_empty())) {
        return Some((i, depth(&captures[i])?));
    }
    let poses = |c: &Capture| c.poses.as_ref().map(|p| p.items.iter().map(|x| x.at.clone()).collect::<Vec<_>>());
    let i = first(captures, |c| poses(c).is_some_and(|p| !p.is_empty()))?;
    Some((i, poses(&captures[i])?))
}

/// Chooses the frames and joins all streams of images to them. What was joined and dropped goes into the report.
///
/// # Errors
/// Where there are no poses, no intrinsics, or no frame has a pose.
pub(super) fn build(captures: &[Capture], options: &ImportOptions, report: &mut ImportReport) -> Result<FrameTimeline> {
    let Some((base, mut ats)) = base_frames(captures) else {
        let path = captures.first().map(|c| c.source.clone()).unwrap_or_default();
        let message = "no source has images, depth or poses; nothing can be placed in time".to_owned();
        return Err(Error::Format { path, place: "streams".to_owned(), message });
    };
    let Some(posed) = first(captures, |c| c.poses.as_ref().is_some_and(|p| !p.items.is_empty())) else {
        let [_, (_, _, command), ..] = super::report::NEEDED;
        return Err(Error::format(
            &captures[base].source,
            "poses",
            format!("no source has camera poses; find them, for example: {command}"),
        ));
    };
    let has_times = times(&mut ats, options, report);
    let gap_secs =
        options.max_gap_secs.or_else(|| half_period(ats.iter().filter_map(|a| a.time_secs))).unwrap_or(0.5 / USUAL_FPS);

    let joiner = Joiner { captures, base, ats: &ats, has_times, gap_secs, options };
    let (poses, track) = joiner.poses(posed, report)?;
    let items = FrameItems {
        image: (0..ats.len())
            .map(|item| (!captures[base].images.is_empty()).then_some(Item { capture: base, item }))
            .collect(),
        depth: joiner
            .stream("depth", report, &|c| c.depth.iter().flat_map(|d| &d.items).map(|x| x.at.clone()).collect()),
        mask: joiner
            .stream("masks", report, &|c| c.masks.iter().flat_map(|d| &d.items).map(|x| x.at.clone()).collect()),
        normals: joiner
            .stream("normals", report, &|c| c.normals.iter().flat_map(|d| &d.items).map(|x| x.at.clone()).collect()),
        segments: joiner.stream("segments", report, &|c| c.segments.iter().map(|x| x.at.clone()).collect()),
        has_hand: joiner.with_hands(),
    };

    let frames = drafts(captures, base, ats, poses, &items, options)?;
    let total = frames.len();
    let frames = thinned(frames, options.fps);
    if frames.len() < total {
        report.dropped.push(format!("{} frames for --fps {}", total - frames.len(), options.fps));
    }
    if !captures[base].images.is_empty() {
        stream(report, "images", frames.len(), captures[base].images.len(), &captures[base], "these are the frames");
    }
    Ok(FrameTimeline { frames, base, posed, track, gap_secs, has_times })
}

/// Whether items that are joined by their numbers look like those of fewer frames, numbered anew.
fn is_numbered_anew(by: By, items: &[At], frames: usize) -> bool {
    let mut numbers: Vec<usize> = items.iter().filter_map(|a| a.index).collect();
    numbers.sort_unstable();
    numbers.dedup();
    by == By::Index && numbers.len() > 1 && numbers.len() < frames && numbers.iter().copied().eq(0..items.len())
}

/// Joins streams to the frames.
struct Joiner<'a> {
    captures: &'a [Capture],
    /// The capture that the frames are of, and where they are.
    base: usize,
    ats: &'a [At],
    /// Whether the frames' times are the base's own.
    has_times: bool,
    gap_secs: f64,
    options: &'a ImportOptions,
}

impl Joiner<'_> {
    /// Whether a capture's times are on the clock of the frames.
    fn is_one_clock(&self, capture: usize) -> bool {
        self.has_times && one_clock(self.captures, self.base, capture)
    }

    /// The item of a stream that belongs to each frame: of the first capture that has any, the nearest in time.
    fn stream(&self, name: &str, report: &mut ImportReport, at_of: &dyn Fn(&Capture) -> Vec<At>) -> Vec<Option<Item>> {
        let ats = self.ats;
        let Some(i) = first(self.captures, |c| !at_of(c).is_empty()) else { return vec![None; ats.len()] };
        let of = at_of(&self.captures[i]);
        let joined = join(ats, of.iter(), self.is_one_clock(i), self.gap_secs);
        let mut out: Vec<Option<Item>> = vec![None; ats.len()];
        for (item, frame) in joined.frame_of.iter().enumerate() {
            let Some(frame) = *frame else { continue };
            let distance = |item: usize| match (ats[frame].time_secs, of[item].time_secs) {
                (Some(a), Some(b)) => (a - b).abs(),
                _ => 0.0,
            };
            let is_nearer = out[frame].is_none_or(|old| distance(item) < distance(old.item));
            if is_nearer {
                out[frame] = Some(Item { capture: i, item });
            }
        }
        stream(report, name, out.iter().flatten().count(), of.len(), &self.captures[i], joined.by.words());
        if i != self.base && is_numbered_anew(joined.by, &of, ats.len()) {
            report.changes.push(format!(
                "{name} of {} have the numbers 0 to {} without a gap and are joined to the first frames of {}: where a network \
                 ran on frames/ of a recording, that recording is the source to give",
                source_name(&self.captures[i]),
                of.len() - 1,
                ats.len()
            ));
        }
        out
    }

    /// Whether each frame has a hand. What they are is found once the frames are chosen.
    fn with_hands(&self) -> Vec<bool> {
        let mut out = vec![false; self.ats.len()];
        let hands = |c: &Capture| -> Vec<At> {
            c.hands.iter().flat_map(|h| &h.items).map(|h| h.at.later(self.options.hand_lag_secs)).collect()
        };
        let Some(i) = first(self.captures, |c| !hands(c).is_empty()) else { return out };
        let of = hands(&self.captures[i]);
        let (joined, _) = join_or_count(self.ats, &of, self.is_one_clock(i), self.gap_secs);
        for frame in joined.frame_of.into_iter().flatten() {
            if let Some(has) = out.get_mut(frame) {
                *has = true;
            }
        }
        out
    }

    /// A pose for each frame, in the world of the capture with the poses.
    fn poses(&self, posed: usize, report: &mut ImportReport) -> Result<(Vec<FramePose>, PoseTrack)> {
        let (ats, options) = (self.ats, self.options);
        let capture = &self.captures[posed];
        let Some(poses) = &capture.poses else { return Ok((vec![None; ats.len()], PoseTrack::default())) };
        let converted = rigid(capture, poses, options, report)?;
        let track = PoseTrack::of(
            poses.items.iter().zip(&converted).filter_map(|(p, pose)| Some((p.at.time_secs?, (*pose)?))).collect(),
        );
        let gap_secs = self.gap_secs.max(0.5 * options.pose_gap_secs);
        let joined = join(ats, poses.items.iter().map(|p| &p.at), self.is_one_clock(posed), gap_secs);
        let optics = poses.items.iter().find_map(|p| p.optics);
        let out: Vec<FramePose> = match joined.by {
            By::Time | By::Overlap => {
                ats.iter().map(|a| Some((track.at(a.time_secs?, options.pose_gap_secs)?, optics))).collect()
            }
            By::Name | By::Index | By::Nothing => {
                let mut out = vec![None; ats.len()];
                for (item, frame) in joined.frame_of.iter().enumerate() {
                    let pose = converted.get(item).copied().flatten();
                    if let (Some(slot), Some(pose)) = (frame.and_then(|f| out.get_mut(f)), pose) {
                        *slot = Some((pose, poses.items.get(item).and_then(|p| p.optics).or(optics)));
                    }
                }
                out
            }
        };
        let with = out.iter().flatten().count();
        stream(report, "poses", with, poses.items.len(), capture, joined.by.words());
        if with == 0 {
            return Err(Error::format(
                &capture.source,
                "poses",
                format!(
                    "no frame has a pose: {} frames and {} poses share neither times, names nor frame numbers \
                     (--max-gap and --pose-gap allow more)",
                    ats.len(),
                    poses.items.len()
                ),
            ));
        }
        if with < ats.len() {
            report.dropped.push(format!("{} of {} frames without a pose", ats.len() - with, ats.len()));
        }
        Ok((out, track))
    }
}

/// The poses of a capture as rigid transforms of a camera into its world; `None` for those that are none.
fn rigid(
    capture: &Capture,
    poses: &Poses,
    options: &ImportOptions,
    report: &mut ImportReport,
) -> Result<Vec<Option<Pose>>> {
    let convention = Convention::of(capture, options);
    let converted: Vec<Option<Pose>> = poses.items.iter().map(|p| convention.world_from_camera(&p.pose)).collect();
    let broken = converted.iter().filter(|p| p.is_none()).count();
    if broken == converted.len() {
        return Err(Error::format(
            &capture.source,
            "poses",
            "none is a rigid transform; a quaternion in another order? (--quaternion xyzw or wxyz; --camera-axes)",
        ));
    }
    if broken > 0 {
        report.dropped.push(format!("{broken} poses that are no rigid transforms"));
    }
    Ok(converted)
}

/// Items of each frame, one list a stream.
struct FrameItems {
    image: Vec<Option<Item>>,
    depth: Vec<Option<Item>>,
    mask: Vec<Option<Item>>,
    normals: Vec<Option<Item>>,
    segments: Vec<Option<Item>>,
    has_hand: Vec<bool>,
}

/// Gives every frame a time. Whether they are the source's own.
fn times(ats: &mut [At], options: &ImportOptions, report: &mut ImportReport) -> bool {
    if options.source_fps.is_none() && ats.iter().all(|a| a.time_secs.is_some_and(f64::is_finite)) {
        return true;
    }
    let fps = options.source_fps.filter(|f| f.is_finite() && *f > 0.0).unwrap_or(USUAL_FPS);
    let told = if options.source_fps.is_some() { "as asked" } else { "taken for granted, --source-fps sets another" };
    report.changes.push(format!("times are counted at {fps} frames a second ({told})"));
    for (i, at) in ats.iter_mut().enumerate() {
        at.time_secs = Some(at.index.unwrap_or(i) as f64 / fps);
    }
    false
}

/// A frame's camera to the world of the poses, and the camera that was posed where its file tells it.
type FramePose = Option<(Pose, Option<Optics>)>;

/// Frames with a pose, in time order.
fn drafts(
    captures: &[Capture],
    base: usize,
    ats: Vec<At>,
    poses: Vec<FramePose>,
    items: &FrameItems,
    options: &ImportOptions,
) -> Result<Vec<Draft>> {
    let sure = |c: &Capture| c.optics.filter(|_| !c.optics_estimated);
    let own = sure(&captures[base]);
    let common = captures.iter().find_map(sure).or_else(|| captures.iter().find_map(|c| c.optics));
    let mut frames = Vec::new();
    for (i, (at, posed)) in ats.into_iter().zip(poses).enumerate() {
        let (Some((world_from_camera, of_pose)), Some(time_secs)) = (posed, at.time_secs) else { continue };
        let of_image = captures[base].images.get(i).and_then(|x| x.optics);
        let Some(optics) = options.camera.or(of_image).or(own).or(of_pose).or(common) else {
            return Err(Error::format(
                &captures[base].source,
                "intrinsics",
                "no source has the camera's focal length; give it with --camera WIDTH,HEIGHT,FX,FY,CX,CY in pixels",
            ));
        };
        if let Some(fault) = optics.fault() {
            return Err(Error::format(&captures[base].source, "intrinsics", fault));
        }
        let get = |list: &[Option<Item>]| list.get(i).copied().flatten();
        frames.push(Draft {
            at,
            time_secs,
            world_from_camera,
            optics,
            image: get(&items.image),
            depth: get(&items.depth),
            mask: get(&items.mask),
            normals: get(&items.normals),
            segments: get(&items.segments),
            has_hand: items.has_hand.get(i).copied().unwrap_or(false),
        });
    }
    frames.sort_by(|a, b| a.time_secs.total_cmp(&b.time_secs));
    Ok(frames)
}

/// Of each slot of `1 / fps` seconds the frame with most to show, then the one nearest to the slot's middle. 0 keeps all.
fn thinned(frames: Vec<Draft>, fps: f64) -> Vec<Draft> {
    let Some(first) = frames.first().map(|f| f.time_secs) else { return frames };
    if !(fps.is_finite() && fps > 0.0) {
        return frames;
    }
    let slot = |f: &Draft| ((f.time_secs - first) * fps).round();
    let shows = |f: &Draft| {
        let seen = [&f.image, &f.depth, &f.mask, &f.normals].iter().filter(|s| s.is_some()).count();
        seen + usize::from(f.has_hand)
    };
    let off = |f: &Draft| ((f.time_secs - first) * fps - slot(f)).abs();
    let mut out: Vec<Draft> = Vec::new();
    for frame in frames {
        match out.last_mut() {
            Some(last) if slot(last) == slot(&frame) => {
                if shows(&frame) > shows(last) || (shows(&frame) == shows(last) && off(&frame) < off(last)) {
                    *last = frame;
                }
            }
            _ => out.push(frame),
        }
    }
    out
}

/// The video pictures that the frames need: (file, whether upright, number).
pub(super) fn video_pictures(captures: &[Capture], frames: &[Draft]) -> Vec<(std::path::PathBuf, bool, usize)> {
    frames
        .iter()
        .filter_map(|f| {
            let image = f.image?;
            match &captures.get(image.capture)?.images.get(image.item)?.picture {
                ImageSource::Video { file, index, upright } => Some((file.clone(), *upright, *index)),
                ImageSource::Still(_) | ImageSource::Raw { .. } => None,
            }
        })
        .collect()
}
