//! The whole way in one call, [`Made::of`], and its steps for those who want them: from a recording to a twin that physics has
//! looked at, and to its files as bytes. Nothing is written here.
//!
//! | step | gives |
//! |---|---|
//! | [`scene`] | joints, or why there are none |
//! | [`weigh`] | the same after physics spoke about joints in doubt |
//! | [`crate::fitting::fit`] | boxes, limits and masses: the twin |
//! | [`joint_hands`], [`replay`] | a verdict on every joint |
//! | [`look`] | textured surfaces, for eyes alone |
//! | [`files`] | URDF, MJCF, glTF and USD |

use std::borrow::Cow;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::config::{self, Config};
use crate::error::Result;
use crate::export::{ExportContext, ExportFormat, ExportedFiles, FORMATS, Purpose};
use crate::geometry::segments::Lsd;
use crate::hands::{Trajectory, find};
use crate::look::Look;
use crate::math::Vector;
use crate::pipeline::{self, Forgetful, LookStore, Progress, Scene};
use crate::reasoning::Reasoner;
use crate::reasoning::heuristic::Geometric;
use crate::recording::Recording;
use crate::recording::pictures::Picture;
use crate::twin::Twin;
use crate::validation::verdict::Hands;
use crate::validation::{self, Validation};
use crate::{appearance, export, feedback, fitting};

/// All that is made of a recording.
#[derive(Debug, Clone)]
pub struct Made {
    /// Joints and clips with their evidence.
    pub scene: Scene,
    /// What gets built: boxes, joints, masses.
    pub twin: Twin,
    /// The recorded hands of each part, in the twin's order.
    pub hands: Vec<JointHands>,
    /// A verdict on every joint, in the twin's order.
    pub validation: Validation,
    /// What had to be left out, a sentence each: pictures that cannot be decoded, hands that cannot be replayed.
    pub lost: Vec<String>,
}

/// A joint's recorded hands.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct JointHands {
    /// The joint.
    pub joint: String,
    /// Clip name and trajectory.
    pub clips: Vec<(String, Trajectory)>,
}

impl Made {
    /// The joints of a recording, its twin, and a verdict on every joint. Where nobody told when something is opened, interactions
    /// are found by the hands; no language model is asked.
    ///
    /// # Errors
    /// What makes the whole recording unusable, and a configuration that no step could work with. A clip without an answer is
    /// data: its reason stands in [`pipeline::ClipResult::joint`].
    pub fn of(recording: &Recording, config: &Config) -> Result<Self> {
        config.check()?;
        let recording = recording.clone().checked()?;
        let recording = with_clips(&recording, &config.hands);
        let reasoner = Geometric::of(config);
        let (mut scene, mut lost) = scene(&recording, config, &reasoner, &|_, _, _| {}, &Forgetful)?;
        let up = recording.up();
        weigh(&mut scene, &up, config);
        let twin = fitting::fit(&scene, &up, &config.fitting, &config.priors);
        let hands = joint_hands(&scene, &twin);
        let (validation, not_replayed) = replay(&twin, &hands, &up, &config.validation)?;
        lost.extend(not_replayed);
        Ok(Self { scene, twin, hands, validation, lost })
    }

    /// The twin in all formats, see [`files`].
    ///
    /// # Errors
    /// Those of [`files`].
    pub fn files(&self, look: Option<&Look>) -> Result<Vec<(String, Vec<u8>)>> {
        files(&self.twin, look, &self.validation.words())
    }
}

/// The recording; where it has no clips, with the interactions that its hands show.
#[must_use]
pub fn with_clips<'a>(recording: &'a Recording, config: &config::Hands) -> Cow<'a, Recording> {
    if !recording.clips.is_empty() {
        return Cow::Borrowed(recording);
    }
    Cow::Owned(Recording { clips: find::interactions(recording, config), ..recording.clone() })
}

/// The joints of a recording, and what was left out on the way, as [`forgiving`] does.
///
/// # Errors
/// Those of [`pipeline::infer`] and of [`forgiving`], and a configuration that no step could work with.
pub fn scene(
    recording: &Recording,
    config: &Config,
    reasoner: &dyn Reasoner,
    progress: Progress,
    store: &dyn LookStore,
) -> Result<(Scene, Vec<String>)> {
    config.check()?;
    forgiving(recording, &config.pictures, |recording| {
        pipeline::infer_keeping(recording, config, &Lsd, reasoner, progress, store)
    })
}

/// What a step makes of a recording, and the damaged pictures that were left out, each with the reason: where it meets one, all
/// pictures of that kind are decoded, and the step runs again without those that cannot be.
///
/// # Errors
/// Those of the step, and more damaged pictures of one kind than the configuration allows.
pub fn forgiving<T>(
    recording: &Recording,
    rules: &config::Pictures,
    step: impl Fn(&Recording) -> Result<T>,
) -> Result<(T, Vec<String>)> {
    let mut recording = Cow::Borrowed(recording);
    let mut lost = Vec::new();
    loop {
        let error = match step(&recording) {
            Ok(made) => return Ok((made, lost)),
            Err(error) => error,
        };
        let Some(kind) = Picture::ALL.into_iter().find(|kind| kind.is_meant(&recording, &error)) else {
            return Err(error);
        };
        let damaged = kind.damaged(&recording, rules)?;
        if damaged.is_empty() {
            return Err(error);
        }
        for (frame, why) in damaged {
            *kind.file_mut(&mut recording.to_mut().frames[frame].files) = None;
            lost.push(why);
        }
    }
}

/// Lets physics speak about a scene's joints that are in doubt. Nothing changes where `validation.feedback` is off.
///
/// `up`: against gravity, world, unit.
pub fn weigh(scene: &mut Scene, up: &Vector, config: &Config) {
    if config.validation.feedback {
        scene.joints = feedback::weighed(scene, up, config);
        feedback::prove(scene, up, config);
    }
}

/// The recorded hands of each part of a twin, in its order.
#[must_use]
pub fn joint_hands(scene: &Scene, twin: &Twin) -> Vec<JointHands> {
    twin.furniture
        .iter()
        .map(|f| JointHands {
            joint: f.part.id.clone(),
            clips: scene
                .joints
                .iter()
                .filter(|j| j.id == f.part.id)
                .flat_map(|j| &j.clips)
                .filter_map(|name| scene.clips.iter().find(|c| c.clip.clip == *name))
                .filter_map(|c| c.trajectory.clone().map(|t| (c.clip.clip.clone(), t)))
                .collect(),
        })
        .collect()
}

/// Borrowed in the form that [`validation::validate`] takes.
#[must_use]
pub fn as_hands(joints: &[JointHands]) -> Vec<Hands<'_>> {
    joints.iter().map(|j| j.clips.iter().map(|(name, t)| (name.clone(), t)).collect()).collect()
}

/// The replay of all joints, and what had to be left out of it, a sentence each: a hand that cannot be replayed costs its clip, a
/// joint that cannot be simulated its hands. `hands[i]` belongs to `twin.furniture[i]`; `up`: against gravity, world, unit.
///
/// # Errors
/// Where rapier refuses the twin even so.
pub fn replay(
    twin: &Twin,
    hands: &[JointHands],
    up: &Vector,
    config: &config::Validation,
) -> Result<(Validation, Vec<String>)> {
    let mut kept = as_hands(hands);
    if let Ok(validation) = validation::validate(twin, &kept, up, config) {
        return Ok((validation, Vec::new()));
    }
    let alone = |joint: usize, clips: Hands| -> Result<()> {
        let mut all: Vec<Hands> = vec![Vec::new(); hands.len()];
        if let Some(own) = all.get_mut(joint) {
            *own = clips;
        }
        validation::validate(twin, &all, up, config).map(|_| ())
    };
    let mut lost = Vec::new();
    for (i, (clips, joint)) in kept.iter_mut().zip(hands).enumerate() {
        clips.retain(|(name, trajectory)| match alone(i, vec![(name.clone(), *trajectory)]) {
            Ok(()) => true,
            Err(error) => {
                lost.push(format!("replay of clip {name}: {error}"));
                false
            }
        });
        if let Err(error) = alone(i, clips.clone()) {
            lost.push(format!("replay of {}: {error}", joint.joint));
            clips.clear();
        }
    }
    Ok((validation::validate(twin, &kept, up, config)?, lost))
}

/// What a twin looks like, `None` where there is nothing to see ([`appearance::lacking`] says why), and what was left out, as
/// [`forgiving`] does.
///
/// # Errors
/// Those of [`forgiving`].
pub fn look(recording: &Recording, scene: &Scene, twin: &Twin, config: &Config) -> Result<(Option<Look>, Vec<String>)> {
    let (look, lost) = forgiving(recording, &config.pictures, |recording| {
        appearance::look(recording, scene, twin, &config.hands, &config.appearance)
    })?;
    Ok((export::dress::shows(twin, &look)?.then_some(look), lost))
}

/// A twin in all formats: names and bytes, those of its look (`look/`) last. `verdicts`: [`Validation::words`], or none.
///
/// # Errors
/// A twin, or a look, that cannot be written; see [`export::check`].
pub fn files(twin: &Twin, look: Option<&Look>, verdicts: &[(String, String)]) -> Result<Vec<(String, Vec<u8>)>> {
    let context = ExportContext { look, verdicts, ..ExportContext::default() };
    let formats: Vec<&ExportFormat> = FORMATS.iter().filter(|format| format.purpose == Purpose::Model).collect();
    let beside = || look.map_or_else(|| Ok(Vec::new()), |look| export::dress::files(twin, look));
    let (made, beside): (Vec<Result<ExportedFiles>>, _) =
        rayon::join(|| formats.par_iter().map(|format| (format.write)(twin, &context)).collect(), beside);
    let mut all = Vec::new();
    for (format, made) in formats.iter().zip(made) {
        all.extend(format.files.iter().map(|file| file.name.to_owned()).zip(made?.files));
    }
    all.extend(beside?);
    Ok(all)
}
