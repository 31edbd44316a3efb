//! The whole paper on one screen: every step in order, every intermediate kept.

mod clip;
mod closed;
pub mod frames;
mod group;
mod looks;
mod method;
mod refit;
mod room;
mod scene;
mod through;
mod timelines;
mod told;
mod videos;
mod weigh;
mod without_depth;

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicUsize, Ordering};

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::articulation::{Action, Articulation, Outcome};
use crate::config::{Config, LineMethod, RoomFrame};
use crate::error::Result;
use crate::geometry::Rect;
use crate::geometry::segments::{LiftedSegment, LineDetector, lift};
use crate::geometry::{AxisCandidate, Face, LineTrack, ManhattanFrame, depth_scale, manhattan, tracks};
use crate::hands::{Trajectory, contact};
use crate::inference::{ClipJoint, Uncertainty};
use crate::localization::{Footage, Region, views};
use crate::math::Point;
use crate::reasoning::words::Words;
use crate::reasoning::{Answer, Reasoner};
use crate::recording::narration;
use crate::recording::pictures::check_depth;
use crate::recording::sketch::Sketch;
use crate::recording::{AtWork, Clip, DepthFactors, Recording, Surfaces, Videos};
pub use looks::{Forgetful, LookStore};
pub use room::{FreeRun, Gathering, RoomCell, RoomCells, gather};
pub use videos::together;

/// Everything that was found out about one clip, step by step.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct ClipResult {
    /// The clip.
    pub clip: Clip,
    /// Hands (§3.1).
    pub trajectory: Option<Trajectory>,
    /// Frames in which the furniture is closed and the grip is seen (§3.1).
    #[serde(skip)]
    pub closed_frames: Vec<usize>,
    /// Localisation (§3.1).
    pub region: Option<Region>,
    /// Global views (§3.2).
    pub views: Vec<usize>,
    /// 3D lines (§3.2).
    pub lines: Vec<LineTrack>,
    /// The touched face.
    pub face: Option<Face>,
    /// The part of the face that was seen to move.
    pub part: Option<Rect>,
    /// What a language model said, where one was asked (§3.3).
    #[serde(default)]
    pub words: Option<Words>,
    /// Candidate axes (§3.2).
    pub candidates: Vec<AxisCandidate>,
    /// The answers to the two questions (§3.3).
    pub answer: Option<Answer>,
    /// The joint (§3.4), or the reason why there is none.
    pub joint: Outcome<ClipJoint>,
}

impl ClipResult {
    /// A clip of which nothing is known, and why.
    pub(crate) fn unanswered(clip: Clip, reason: String) -> Self {
        Self {
            clip,
            trajectory: None,
            closed_frames: Vec::new(),
            region: None,
            views: Vec::new(),
            lines: Vec::new(),
            face: None,
            part: None,
            words: None,
            candidates: Vec::new(),
            answer: None,
            joint: Outcome::Abstained(reason),
        }
    }
}

/// One joint of the scene with all that the later steps need to know about it.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct SceneJoint {
    /// Name, unique in the scene.
    pub id: String,
    /// The merged joint; positive opens.
    pub joint: Articulation,
    /// Names of the clips that show it.
    pub clips: Vec<String>,
    /// Clips without a hand of which the narrations tell that they move it, too.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub told: Vec<Told>,
    /// The word that people used for the furniture.
    pub furniture: Option<String>,
    /// Probability of the type; `None` where nobody computed one.
    #[serde(default)]
    pub type_probability: Option<f64>,
    /// Probability that type, axis (15 degrees) and hinge (25 cm) are right, see [`crate::inference::is_right`]. How likely just
    /// this joint is, is the share of the first of `hypotheses`. `None` where nobody computed one.
    #[serde(default)]
    pub joint_probability: Option<f64>,
    /// How sure axis, hinge and openings are; `None` for joints that nobody was seen to move.
    #[serde(default)]
    pub uncertainty: Option<Uncertainty>,
    /// The grip when closed, world.
    pub grip: Point,
    /// The touched face.
    pub face: Option<Face>,
    /// The moving part of the face.
    pub part: Option<Rect>,
    /// Largest opening that was observed, against the closed state, rad or m.
    pub observed_range: f64,
    /// Opening that each of `clips` went through, rad or m.
    pub moved: Vec<f64>,
    /// How the part could move, its own joint first; one alone where nothing else had a hundredth of all weight before
    /// physics was asked, or where it is not to be asked (`validation.feedback`); none where nobody computed shares.
    #[serde(default)]
    pub hypotheses: Vec<Hypothesis>,
}

/// A clip that moves a part without being evidence about it: no hand was followed in it, and by its narration and what stood open
/// it closes what a clip opened, or opens what a clip closes; or its hand is misread, as those of more clips show.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Told {
    /// Its name.
    pub clip: String,
    /// The name of a clip that shows the part; it moved as far in either.
    pub with: String,
    /// What this clip does.
    pub action: Action,
}

/// One way in which a part could move, with what depends on it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Hypothesis {
    /// The joint; positive opens.
    pub joint: Articulation,
    /// Probability of just this joint: of the weight of all explanations the share within 8 degrees and 8 cm. The hypotheses of a
    /// part share at most 1.
    pub share: f64,
    /// Probability of its type.
    pub type_share: f64,
    /// As [`SceneJoint::uncertainty`].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub uncertainty: Option<Uncertainty>,
    /// As [`SceneJoint::part`].
    pub part: Option<Rect>,
    /// As [`SceneJoint::observed_range`].
    pub observed_range: f64,
    /// As [`SceneJoint::moved`].
    pub moved: Vec<f64>,
    /// What physics says against it, where it was asked.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub refuted: Option<String>,
}

impl SceneJoint {
    /// Which of `clips` shows what a clip does: itself, or the one that a narration ties it to.
    #[must_use]
    pub fn shown_by(&self, clip: &str) -> Option<usize> {
        let with = self.told.iter().find(|t| t.clip == clip).map_or(clip, |t| t.with.as_str());
        self.clips.iter().position(|c| c == with)
    }

    /// The same part under one of its hypotheses; its probabilities stay as they are.
    #[must_use]
    pub fn under(&self, hypothesis: &Hypothesis) -> Self {
        Self {
            joint: hypothesis.joint,
            uncertainty: hypothesis.uncertainty.clone(),
            part: hypothesis.part,
            observed_range: hypothesis.observed_range,
            moved: hypothesis.moved.clone(),
            ..self.clone()
        }
    }
}

/// The scene.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Scene {
    /// The recording's name.
    pub recording: String,
    /// The room's frame (§A.5).
    pub manhattan: Option<ManhattanFrame>,
    /// The videos that the recording was joined of.
    #[serde(default, skip_serializing_if = "Videos::is_empty")]
    pub videos: Videos,
    /// What the frames' depth was multiplied by.
    pub depth_factors: DepthFactors,
    /// Clips in the recording's order.
    pub clips: Vec<ClipResult>,
    /// Joints in the order of their first clip.
    pub joints: Vec<SceneJoint>,
    /// What stands around; `None` where it was not asked for or not seen.
    #[serde(default)]
    pub surroundings: Option<RoomCells>,
}

impl Scene {
    /// Whether nothing of a joint's furniture was seen in any of its clips, as in recordings without depth: its front and its boxes
    /// are where the hand says that they could be.
    #[must_use]
    pub fn is_assumed(&self, joint: &SceneJoint) -> bool {
        let of = |name: &String| self.clips.iter().find(|c| c.clip.clip == *name);
        let mut clips = joint.clips.iter().filter_map(of).peekable();
        joint.part.is_none() && clips.peek().is_some() && clips.all(|c| c.region.is_none())
    }

    /// The joint that a clip moves, seen or told.
    #[must_use]
    pub fn joint_of(&self, clip: &str) -> Option<&SceneJoint> {
        self.joints.iter().find(|j| j.shown_by(clip).is_some())
    }
}

/// Told how far the work is: (step, done, total).
pub type Progress<'a> = &'a (dyn Fn(&str, usize, usize) + Sync);

/// Runs hands, localisation, geometry, reasoning, inference and aggregation.
///
/// # Errors
/// Only what makes the whole recording unusable, images that cannot be decoded, and a language model that refuses to be
/// asked. A clip without an answer is an answer: its reason stands in [`ClipResult::joint`].
pub fn infer(
    recording: &Recording,
    config: &Config,
    detector: &dyn LineDetector,
    reasoner: &dyn Reasoner,
    progress: Progress,
) -> Result<Scene> {
    infer_keeping(recording, config, detector, reasoner, progress, &Forgetful)
}

/// The same; what frames show is kept in a store, or taken from it, which changes no byte of the result.
///
/// # Errors
/// As [`infer`].
pub fn infer_keeping(
    recording: &Recording,
    config: &Config,
    detector: &dyn LineDetector,
    reasoner: &dyn Reasoner,
    progress: Progress,
    store: &dyn LookStore,
) -> Result<Scene> {
    check_depth(recording, &config.pictures)?;
    // The one place where names are taken away: whatever reads them later reads these clips.
    let unnamed = (!config.reasoning.use_names).then(|| narration::without_names(recording));
    let recording = unnamed.as_ref().unwrap_or(recording);
    // Where a method needs depth that is not there, the clips themselves say what they lack.
    let by_depth = recording.surfaces() == Surfaces::Depth || method::of(config).needs_depth();
    let mut scene = match by_depth {
        true => with_depth(recording, config, detector, reasoner, progress, store)?,
        false => without_depth::infer(recording, config, detector, reasoner, progress)?,
    };
    let left_out = recording.left_out.clips.iter();
    scene.clips.extend(left_out.map(|(clip, why)| ClipResult::unanswered(clip.clone(), why.clone())));
    Ok(scene)
}

/// The same where surfaces are seen.
fn with_depth(
    recording: &Recording,
    config: &Config,
    detector: &dyn LineDetector,
    reasoner: &dyn Reasoner,
    progress: Progress,
    store: &dyn LookStore,
) -> Result<Scene> {
    let steps = Steps::of(progress);
    // Hands, clip by clip; they tell which frames are needed.
    let at_work = AtWork::of(recording);
    steps.start("following hands", 1);
    let holds = contact::holds(recording, &at_work, &config.hands)?;
    let followed: Vec<clip::Followed> = recording
        .clips
        .par_iter()
        .zip(&holds)
        .map(|(clip, hold)| clip::follow(recording, clip, hold.as_ref(), &at_work, config))
        .collect();

    let looking = Looking { recording, detector, config, store, steps: &steps };
    let mut looks = Looks::default();
    let metric = |recording: &Recording, looks: &Looks| Recording {
        depth_factors: match config.geometry.depth_scale {
            true => depth_scale::solve(recording, &looks.sketches, &config.geometry.scales),
            false => DepthFactors::default(),
        },
        ..recording.clone()
    };

    let mut still: Vec<usize> = followed.iter().flat_map(|f| f.closed.iter().copied()).collect();
    if config.localization.closed_state_frames || config.geometry.depth_scale {
        still.extend(views::survey(recording, &at_work, config.localization.survey_frames));
    }
    looks.take(still, true, &looking)?;
    looks.take(followed.iter().flat_map(|f| f.open.iter().copied()).collect(), false, &looking)?;
    let located_in = metric(recording, &looks);
    let total = recording.clips.len();
    steps.start("localising", total);
    let occupancy =
        config.localization.occlusion.then(|| views::Occupancy::of(&located_in, &looks.sketches, &config.localization));
    let idle = views::idle(recording, &at_work, &config.localization);
    let footage =
        Footage { recording: &located_in, sketches: &looks.sketches, at_work: &at_work, located: &located_in };
    let located: Vec<clip::Located> = recording
        .clips
        .par_iter()
        .zip(followed)
        .map(|(clip, followed)| {
            let located = clip::locate(&footage, clip, followed, &idle, occupancy.as_ref(), config);
            steps.tick("localising", total);
            located
        })
        .collect();

    let mut wanted: Vec<usize> = located.iter().flat_map(|l| l.views.iter().copied()).collect();
    sort_unique(&mut wanted);
    looks.take(wanted.clone(), true, &looking)?;
    // What more was looked at meanwhile tells the factors better, from where they are.
    let rectified = metric(&located_in, &looks);
    steps.start("finding lines", 1);
    for (frame, segments) in &mut looks.segments {
        let factor = rectified.depth_factor(*frame);
        segments.iter_mut().for_each(|s| *s = s.scaled(factor));
    }
    let lines = match config.geometry.lines {
        LineMethod::Triangulated => {
            let segments: Vec<&LiftedSegment> = looks.segments.values().flatten().collect();
            tracks::triangulated(&rectified, &segments, &config.geometry, config.seed)
        }
        LineMethod::Unprojected => Vec::new(),
    };
    let room = manhattan::estimate(&rectified, &with_normals_first(recording, &wanted, config), &config.geometry)?;

    steps.start("inferring", total);
    let footage = Footage { recording: &rectified, sketches: &looks.sketches, at_work: &at_work, located: &located_in };
    let seen = clip::Seen { footage, segments: &looks.segments, lines: &lines, room: room.as_ref() };
    let clips: Vec<ClipResult> = recording
        .clips
        .par_iter()
        .zip(located)
        .map(|(clip, located)| {
            let result = clip::infer(clip, located, &seen, reasoner, config);
            steps.tick("inferring", total);
            result
        })
        .collect::<Result<_>>()?;
    let joints = scene::merge(&footage, &clips, reasoner, config);
    let up = clip::upward(&rectified, room.as_ref(), config);
    let surroundings = room::cells(&footage, room.as_ref(), &up, &config.fitting);
    let Recording { name: recording, depth_factors, videos, .. } = rectified;
    Ok(Scene { recording, manhattan: room, videos, depth_factors, clips, joints, surroundings })
}

/// Tells how far a step is that several threads work at.
struct Steps<'a> {
    progress: Progress<'a>,
    done: AtomicUsize,
}

impl<'a> Steps<'a> {
    fn of(progress: Progress<'a>) -> Self {
        Self { progress, done: AtomicUsize::new(0) }
    }

    fn start(&self, step: &str, total: usize) {
        self.done.store(0, Ordering::Relaxed);
        (self.progress)(step, 0, total);
    }

    fn tick(&self, step: &str, total: usize) {
        (self.progress)(step, self.done.fetch_add(1, Ordering::Relaxed) + 1, total);
    }
}

/// With what frames are looked at.
struct Looking<'a> {
    recording: &'a Recording,
    detector: &'a dyn LineDetector,
    config: &'a Config,
    store: &'a dyn LookStore,
    steps: &'a Steps<'a>,
}

/// What was kept of the frames that were looked at.
#[derive(Debug, Default)]
struct Looks {
    /// Depth and mask, coarsely.
    sketches: BTreeMap<usize, Sketch>,
    /// Line segments of the frames in which nothing moves.
    segments: BTreeMap<usize, Vec<LiftedSegment>>,
}

impl Looks {
    /// Looks at those of the frames that nobody has looked at; for line segments, too, where asked.
    fn take(&mut self, mut frames: Vec<usize>, lines: bool, with: &Looking) -> Result<()> {
        let Looking { recording, detector, config, store, steps } = *with;
        frames.retain(|frame| !self.sketches.contains_key(frame));
        sort_unique(&mut frames);
        steps.start("looking", frames.len());
        let seen: Vec<Option<(Sketch, Vec<LiftedSegment>)>> = frames
            .par_iter()
            .map(|&frame| {
                let seen = look_once(recording, frame, lines.then_some(detector), config, store);
                steps.tick("looking", frames.len());
                seen
            })
            .collect::<Result<_>>()?;
        for (sketch, segments) in seen.into_iter().flatten() {
            self.segments.insert(sketch.frame, segments);
            self.sketches.insert(sketch.frame, sketch);
        }
        Ok(())
    }
}

/// What a store has of a frame, else a look at it, which is kept.
fn look_once(
    recording: &Recording,
    frame: usize,
    detector: Option<&dyn LineDetector>,
    config: &Config,
    store: &dyn LookStore,
) -> Result<Option<(Sketch, Vec<LiftedSegment>)>> {
    let with_lines = detector.is_some();
    let known = store.find(recording, frame, with_lines).and_then(|bytes| looks::decoded(&bytes, frame));
    if known.is_some() {
        return Ok(known);
    }
    let look = look_at(recording, frame, detector, config)?;
    if let Some((sketch, segments)) = &look {
        store.keep(recording, frame, with_lines, &looks::encoded(sketch, segments));
    }
    Ok(look)
}

/// Decodes what a frame has, once; `None` where it has no depth. Without a detector its lines are not looked for.
fn look_at(
    recording: &Recording,
    frame: usize,
    detector: Option<&dyn LineDetector>,
    config: &Config,
) -> Result<Option<(Sketch, Vec<LiftedSegment>)>> {
    let Some(depth) = recording.depth_as_read(frame)? else { return Ok(None) };
    let mask = recording.mask(frame)?;
    let segments = match detector {
        Some(detector) => lift(recording, frame, &depth, mask.as_ref(), detector, &config.geometry, config.seed)?,
        None => Vec::new(),
    };
    Ok(Some((Sketch::of(frame, &depth, mask.as_ref()), segments)))
}

fn sort_unique(frames: &mut Vec<usize>) {
    frames.sort_unstable();
    frames.dedup();
}

/// Views for the room's frame: those with a normals file first, at most so many as are enough for it.
fn with_normals_first(recording: &Recording, views: &[usize], config: &Config) -> Vec<usize> {
    let RoomFrame { views: enough, views_alone, .. } = config.geometry.frame;
    let (with, without): (Vec<usize>, Vec<usize>) =
        views.iter().partition(|&&v| recording.frames[v].files.normals.is_some());
    let all: Vec<usize> = if with.len() >= views_alone { with } else { with.into_iter().chain(without).collect() };
    (0..all.len().min(enough)).map(|i| all[i * all.len() / all.len().min(enough)]).collect()
}
