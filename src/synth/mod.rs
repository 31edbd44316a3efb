//! Recordings of synthetic kitchens with a known answer, in the layout of real ones.
//!
//! A kitchen of boxes ([`kitchen`]), a person who opens and closes its parts ([`person`]), a ray caster ([`render`]), and
//! the errors of estimated hands, poses and depth ([`noise`]). The same options give the same bytes. Boxes have flat colours, or,
//! where asked for, the look of wood, stone, steel and tiles (`materials`).
//!
//! The benchmark has tiers of its own ([`tiers`]), from nearly exact to harder than real recordings: fitted kitchens with
//! every kind of part ([`fitted`]) and a person who is less tidy ([`session`]). Kitchen, motion and each kind of error draw
//! their numbers apart, so that a seed means the same kitchen and the same motions on every tier, and a change of one
//! error leaves all others as they are.
//!
//! Seeds below [`FIRST_REPORT_SEED`] are for development. Those from it on are for reports only: no value may be chosen by
//! what comes out on them.

mod benchmark;
pub mod fitted;
pub mod kitchen;
mod materials;
mod memory;
pub mod noise;
pub mod person;
mod recording_files;
pub mod render;
pub mod session;
mod solid;
pub mod tiers;
mod variants;

pub use variants::{Changes, SynthOptions, Tier};

use nalgebra::UnitQuaternion;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

use crate::error::{Error, Result};
use crate::math::{Pose, Vector, rotation};
use crate::recording::Camera;

/// The first seed that is for reports only.
pub const FIRST_REPORT_SEED: u64 = 1000;

/// A recording that has been played but not yet rendered.
#[derive(Debug)]
pub struct Recorded {
    options: SynthOptions,
    kitchen: kitchen::Kitchen,
    take: person::Take,
    seen: noise::Observed,
    camera: Camera,
    up: Vector,
    has_masks: bool,
    own_from_kitchen: Pose,
    /// Materials of the boxes; empty where they are flat.
    coats: Vec<materials::Coat>,
}

/// What random numbers are for: each use has its own.
#[derive(Debug, Clone, Copy)]
enum RandomUse {
    Kitchen,
    Motion,
    Gravity,
    Errors,
    Words,
    Masks,
    FewHands,
    World,
}

impl RandomUse {
    fn rng(self, seed: u64) -> Pcg64Mcg {
        // An odd number without pattern (2^64 over the golden ratio) keeps the streams of neighbouring seeds apart.
        const SPREAD: u64 = 0x9e37_79b9_7f4a_7c15;
        Pcg64Mcg::seed_from_u64(seed.wrapping_mul(SPREAD) ^ (1 + self as u64))
    }
}

/// The seed of all but the kitchen in one of its takes.
fn seed_of(seed: u64, take: u64) -> u64 {
    // An odd number without pattern keeps the takes of neighbouring seeds apart; take 0 has the seed itself.
    const SPREAD: u64 = 0xd1b5_4a32_d192_ed03;
    seed.wrapping_add(take.wrapping_mul(SPREAD))
}

/// Where a headset may have begun: anywhere within some metres, heading anywhere; what is up it knows.
fn some_world(rng: &mut Pcg64Mcg) -> Pose {
    const SPREAD_M: f64 = 4.0;
    let yaw = rng.random_range(-std::f64::consts::PI..std::f64::consts::PI);
    let at = Vector::new(rng.random(), rng.random(), rng.random()).map(|share: f64| (2.0 * share - 1.0) * SPREAD_M);
    Pose::from_parts(at.into(), rotation(&Vector::z(), yaw))
}

/// A kitchen, what happened in it, and what estimators make of it.
struct Played {
    kitchen: kitchen::Kitchen,
    take: person::Take,
    seen: noise::Observed,
    up: Vector,
}

/// A camera for images of a width; a benchmark's sees 90 degrees to the sides, the other one 80.
fn camera(width: usize, is_benchmark: bool) -> Camera {
    let height = width * 3 / 4;
    let share = if is_benchmark { 0.5 } else { 0.6 };
    let focal = share * width as f64;
    Camera { width, height, fx: focal, fy: focal, cx: 0.5 * (width as f64 - 1.0), cy: 0.5 * (height as f64 - 1.0) }
}

/// Makes times increase strictly: a still that was taken in the very moment in which a motion begins is half-way between
/// the frames around it. Errors and pictures were drawn before and stay as they are.
fn part_times(frames: &mut [person::TrueFrame]) {
    let mut before = None;
    for i in 0..frames.len().saturating_sub(1) {
        let (time, next) = (frames[i].time_secs, frames[i + 1].time_secs);
        if time >= next {
            frames[i].time_secs = before.map_or(next - 1.0 / person::FPS, |before: f64| 0.5 * (before + next));
        }
        before = Some(frames[i].time_secs);
    }
}

fn enough_parts(options: &SynthOptions, kitchen: &kitchen::Kitchen) -> Result<()> {
    if options.parts > kitchen.parts.len() {
        let (asked, has) = (options.parts, kitchen.parts.len());
        return Err(Error::Config(format!("synth: {asked} parts were asked for, this kitchen has {has}")));
    }
    Ok(())
}

fn play(options: &SynthOptions, changes: &Changes) -> Result<Played> {
    let mut rng = Pcg64Mcg::seed_from_u64(options.seed);
    let kitchen = kitchen::build(&mut rng);
    enough_parts(options, &kitchen)?;
    let chosen = person::choose(&kitchen, options.parts, &mut rng);
    if changes.take > 0 {
        rng = Pcg64Mcg::seed_from_u64(seed_of(options.seed, changes.take));
    }
    let take = person::play(&kitchen, &chosen, options.tier == Tier::Hard, &mut rng);
    let seen = noise::observe(&take, options.tier, changes, &mut rng);
    Ok(Played { kitchen, take, seen, up: Vector::z() })
}

fn play_benchmark(options: &SynthOptions, changes: &Changes, s: &tiers::TierSizes, camera: &Camera) -> Result<Played> {
    let upright = fitted::build(&mut RandomUse::Kitchen.rng(options.seed), s.turned_rad);
    enough_parts(options, &upright)?;
    let clips = changes.clips_per_part.unwrap_or(2);
    let seed = seed_of(options.seed, changes.take);
    let mut motion = RandomUse::Motion.rng(options.seed);
    let chosen = session::choose(&upright, options.parts, &mut motion);
    if changes.take > 0 {
        motion = RandomUse::Motion.rng(seed);
    }
    let played = session::play(&upright, &chosen, clips, s, &mut motion);
    // All of it stands askew by a little: the world's up is not quite +Z.
    let mut rng = RandomUse::Gravity.rng(options.seed);
    let angle = Vector::new(noise::normal(&mut rng), noise::normal(&mut rng), 0.0) * s.gravity_rad;
    let tilt = Pose::from_parts(Vector::zeros().into(), UnitQuaternion::from_scaled_axis(angle));
    let (kitchen, take) = (upright.moved(&tilt), played.moved(&tilt));
    let seen = benchmark::observe(&take, camera, s, &mut RandomUse::Errors.rng(seed));
    Ok(Played { kitchen, take, seen, up: tilt * Vector::z() })
}

impl Recorded {
    /// Builds the kitchen and plays the person.
    ///
    /// # Errors
    /// Where the options ask for more parts than a kitchen has.
    pub fn new(options: &SynthOptions) -> Result<Self> {
        Self::varied(options, &Changes::default())
    }

    /// The same with what a study changes.
    ///
    /// # Errors
    /// Where the options ask for more parts than a kitchen has, and where a change is impossible.
    pub fn varied(options: &SynthOptions, changes: &Changes) -> Result<Self> {
        changes.check(options.tier)?;
        let sizes = tiers::sizes(options.tier, changes);
        let camera = camera(options.width, sizes.is_some());
        let stream = |stream: RandomUse| stream.rng(seed_of(options.seed, changes.take));
        let Played { kitchen, mut take, mut seen, up } = match &sizes {
            Some(s) => play_benchmark(options, changes, s, &camera)?,
            None => play(options, changes)?,
        };
        let [wrong, vague] = sizes.map_or([changes.word_error.unwrap_or(0.0), 0.0], |s| [s.word_wrong, s.word_vague]);
        take.misname(&kitchen, wrong, vague, &mut stream(RandomUse::Words));
        let [wrong, scale] = sizes.map_or([changes.mask_error.unwrap_or(0.0), 0.0], |s| [s.mask_wrong, s.mask_scale]);
        seen.masks = noise::mask_errors(&kitchen, &take, wrong, scale, &mut stream(RandomUse::Masks));
        if let Some(count) = changes.few_hands {
            noise::keep_few(&mut seen, &take, count, &mut stream(RandomUse::FewHands));
        }
        part_times(&mut take.frames);
        let own_from_kitchen =
            if changes.own_world { some_world(&mut stream(RandomUse::World)) } else { Pose::identity() };
        let coats = if changes.materials { materials::coats(&kitchen, options.seed) } else { Vec::new() };
        let has_masks = !changes.no_masks;
        let mut all = Self { options: *options, kitchen, take, seen, camera, up, has_masks, own_from_kitchen, coats };
        if changes.own_world {
            all.move_by(&own_from_kitchen);
        }
        Ok(all)
    }

    /// The whole recording in another world.
    fn move_by(&mut self, motion: &Pose) {
        self.kitchen = self.kitchen.moved(motion);
        self.take = std::mem::take(&mut self.take).moved(motion);
        for pose in &mut self.seen.poses {
            *pose = motion * *pose;
        }
        for hand in &mut self.seen.hands {
            (hand.grasp, hand.wrist) = (motion * hand.grasp, motion * hand.wrist);
        }
        self.up = motion * self.up;
    }

    /// The world that takes of this kitchen have in common to the recording's own; the identity where that is the one. Never an
    /// input of the pipeline.
    #[must_use]
    pub fn own_from_kitchen(&self) -> Pose {
        self.own_from_kitchen
    }

    /// The kitchen as it really is, everything closed. Never an input of the pipeline.
    #[must_use]
    pub fn kitchen(&self) -> &kitchen::Kitchen {
        &self.kitchen
    }

    /// The same as a twin that simulates. Never an input of the pipeline.
    #[must_use]
    pub fn twin(&self) -> crate::twin::Twin {
        let name = format!("kitchen_{}", self.options.seed);
        solid::twin(&self.kitchen, name, &self.up, &crate::config::Priors::default())
    }

    /// Number of frames.
    #[must_use]
    pub fn frames(&self) -> usize {
        self.take.frames.len()
    }

    /// The images of one frame: (file name, bytes).
    ///
    /// # Errors
    /// Where an image cannot be encoded, which would be a bug.
    pub fn images(&self, frame: usize) -> Result<Vec<(String, Vec<u8>)>> {
        let (picture, is_still) = (self.picture(frame), self.take.frames[frame].is_still);
        let mut files = render::encode(&picture, &self.camera, frame, is_still)?;
        if !self.has_masks {
            files.retain(|(name, _)| !name.starts_with("masks/"));
        }
        Ok(files)
    }
}

#[cfg(test)]
mod tests;
