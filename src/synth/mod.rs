//! Recordings of synthetic kitchens with a known answer, in the layout of real ones.
//!
//! A kitchen of boxes ([`kitchen`]), a person who opens and closes its parts ([`person`]), a ray caster ([`render`]), and
//! the errors of estimated hands, poses and depth ([`noise`]). The same options give the same bytes.
//!
//! The benchmark has tiers of its own ([`tiers`]), from nearly exact to harder than real recordings: fitted kitchens with
//! every kind of part ([`fitted`]) and a person who is less tidy ([`session`]). Kitchen, motion and each kind of error draw
//! their numbers apart, so that a seed means the same kitchen and the same motions on every tier, and a change of one
//! error leaves all others as they are.
//!
//! Seeds below [`FIRST_REPORT_SEED`] are for development. Those from it on are for reports only: no value may be chosen by
//! what comes out on them.

pub mod fitted;
pub mod kitchen;
pub mod noise;
pub mod person;
pub mod render;
pub mod session;
mod solid;
mod tables;
pub mod tiers;

use clap::ValueEnum;
use nalgebra::UnitQuaternion;
use rand::SeedableRng;
use rand_pcg::Pcg64Mcg;

use crate::error::{Error, Result};
use crate::math::{Pose, Vector};
use crate::recording::Camera;

/// The first seed that is for reports only.
pub const FIRST_REPORT_SEED: u64 = 1000;

/// How noisy a recording is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Tier {
    /// Exact depth, poses and masks; hands to 3 mm
    Clean,
    /// Errors of estimated hands, poses, depth and contact as they are on real recordings
    Realistic,
    /// Twice as large ones, short motions, shifted narrations of which a third say only "open it"
    Hard,
    /// Benchmark: nearly exact
    T0,
    /// Benchmark: good estimators
    T1,
    /// Benchmark: estimators as they are
    T2,
    /// Benchmark: between T2 and T3, words mostly right, camera poses with errors
    Hd,
    /// Benchmark: bad estimators
    T3,
    /// Benchmark: T2 with motions of 10 to 22 degrees, 5 to 9 cm
    Short,
    /// Benchmark: T2 with all furniture turned 12 to 33 degrees against the room
    Nonm,
}

impl Tier {
    /// Its name on the command line and in files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Clean => "clean",
            Self::Realistic => "realistic",
            Self::Hard => "hard",
            Self::T0 => "t0",
            Self::T1 => "t1",
            Self::T2 => "t2",
            Self::Hd => "hd",
            Self::T3 => "t3",
            Self::Short => "short",
            Self::Nonm => "nonm",
        }
    }
}

/// What a study changes about a tier; the default changes nothing.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Changes {
    /// Clips of each part (tiers of the benchmark only); two where nothing is said.
    pub clips_per_part: Option<usize>,
    /// Standard deviation of hand positions, metres a direction: slow and fast errors together, without outliers and
    /// without the clip's error of distance.
    pub hand_noise_m: Option<f64>,
    /// Relative standard deviation of the hand's distance: of one draw a clip (tiers of the benchmark) or a recording.
    pub depth_bias: Option<f64>,
    /// Hand samples that remain of each clip, all with contact.
    pub few_hands: Option<usize>,
    /// Share of clips whose noun is of the wrong joint type.
    pub word_error: Option<f64>,
    /// Share of clips in whose frames the masks give the touched part's class to a neighbour of another class.
    pub mask_error: Option<f64>,
    /// No masks at all.
    pub no_masks: bool,
}

impl Changes {
    /// What the sizes of hand errors (metres a direction) are multiplied by.
    fn hand_factor(&self, lateral: f64, ray: f64, white: f64) -> f64 {
        let per_axis = ((2.0 * lateral * lateral + ray * ray) / 3.0 + white * white).sqrt();
        self.hand_noise_m.map_or(1.0, |wanted| wanted / per_axis)
    }

    fn check(&self, tier: Tier) -> Result<()> {
        let wrong = |text: String| Err(Error::Config(format!("synth: {text}")));
        for (name, share) in [("word error", self.word_error), ("mask error", self.mask_error)] {
            if let Some(share) = share.filter(|s| !(0.0..=1.0).contains(s)) {
                return wrong(format!("a {name} of {share} is not a share between 0 and 1"));
            }
        }
        for (name, size) in [("hand noise", self.hand_noise_m), ("depth bias", self.depth_bias)] {
            if let Some(size) = size.filter(|s| !s.is_finite() || *s < 0.0) {
                return wrong(format!("a {name} of {size} is not a size; give a number from 0 on"));
            }
        }
        if self.few_hands == Some(0) || self.clips_per_part == Some(0) {
            return wrong("0 hands or clips per part leave nothing to infer from; give 1 or more".to_owned());
        }
        if self.clips_per_part.is_some() && tiers::sizes(tier, self).is_none() {
            let tier = tier.name();
            return wrong(format!(
                "a number of clips per part can be asked for on the tiers t0 to nonm, not on {tier}"
            ));
        }
        Ok(())
    }
}

/// What to record.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Options {
    /// Which kitchen and which person.
    pub seed: u64,
    /// How noisy.
    pub tier: Tier,
    /// Image width, pixels; the height is three quarters of it.
    pub width: usize,
    /// Parts that are opened and closed.
    pub parts: usize,
}

impl Default for Options {
    fn default() -> Self {
        Self { seed: 0, tier: Tier::Realistic, width: 320, parts: 4 }
    }
}

/// A recording that has been played but not yet rendered.
#[derive(Debug)]
pub struct Recorded {
    options: Options,
    kitchen: kitchen::Kitchen,
    take: person::Take,
    seen: noise::Seen,
    camera: Camera,
    up: Vector,
    has_masks: bool,
}

/// What random numbers are for: each use has its own.
#[derive(Debug, Clone, Copy)]
enum Stream {
    Kitchen,
    Motion,
    Gravity,
    Errors,
    Words,
    Masks,
    FewHands,
}

impl Stream {
    fn rng(self, seed: u64) -> Pcg64Mcg {
        // An odd number without pattern (2^64 over the golden ratio) keeps the streams of neighbouring seeds apart.
        const SPREAD: u64 = 0x9e37_79b9_7f4a_7c15;
        Pcg64Mcg::seed_from_u64(seed.wrapping_mul(SPREAD) ^ (1 + self as u64))
    }
}

/// A kitchen, what happened in it, and what estimators make of it.
struct Played {
    kitchen: kitchen::Kitchen,
    take: person::Take,
    seen: noise::Seen,
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

fn enough_parts(options: &Options, kitchen: &kitchen::Kitchen) -> Result<()> {
    if options.parts > kitchen.parts.len() {
        let (asked, has) = (options.parts, kitchen.parts.len());
        return Err(Error::Config(format!("synth: {asked} parts were asked for, this kitchen has {has}")));
    }
    Ok(())
}

fn play(options: &Options, changes: &Changes) -> Result<Played> {
    let mut rng = Pcg64Mcg::seed_from_u64(options.seed);
    let kitchen = kitchen::build(&mut rng);
    enough_parts(options, &kitchen)?;
    let take = person::play(&kitchen, options.parts, options.tier == Tier::Hard, &mut rng);
    let seen = noise::observe(&take, options.tier, changes, &mut rng);
    Ok(Played { kitchen, take, seen, up: Vector::z() })
}

fn play_benchmark(options: &Options, changes: &Changes, s: &tiers::Sizes, camera: &Camera) -> Result<Played> {
    let upright = fitted::build(&mut Stream::Kitchen.rng(options.seed), s.turned_rad);
    enough_parts(options, &upright)?;
    let clips = changes.clips_per_part.unwrap_or(2);
    let played = session::play(&upright, options.parts, clips, s, &mut Stream::Motion.rng(options.seed));
    // All of it stands askew by a little: the world's up is not quite +Z.
    let mut rng = Stream::Gravity.rng(options.seed);
    let angle = Vector::new(noise::normal(&mut rng), noise::normal(&mut rng), 0.0) * s.gravity_rad;
    let tilt = Pose::from_parts(Vector::zeros().into(), UnitQuaternion::from_scaled_axis(angle));
    let (kitchen, take) = (upright.moved(&tilt), played.moved(&tilt));
    let seen = noise::observe_benchmark(&take, camera, s, &mut Stream::Errors.rng(options.seed));
    Ok(Played { kitchen, take, seen, up: tilt * Vector::z() })
}

impl Recorded {
    /// Builds the kitchen and plays the person.
    ///
    /// # Errors
    /// Where the options ask for more parts than a kitchen has.
    pub fn new(options: &Options) -> Result<Self> {
        Self::varied(options, &Changes::default())
    }

    /// The same with what a study changes.
    ///
    /// # Errors
    /// Where the options ask for more parts than a kitchen has, and where a change is impossible.
    pub fn varied(options: &Options, changes: &Changes) -> Result<Self> {
        changes.check(options.tier)?;
        let sizes = tiers::sizes(options.tier, changes);
        let camera = camera(options.width, sizes.is_some());
        let stream = |stream: Stream| stream.rng(options.seed);
        let Played { kitchen, mut take, mut seen, up } = match &sizes {
            Some(s) => play_benchmark(options, changes, s, &camera)?,
            None => play(options, changes)?,
        };
        let [wrong, vague] = sizes.map_or([changes.word_error.unwrap_or(0.0), 0.0], |s| [s.word_wrong, s.word_vague]);
        take.misname(&kitchen, wrong, vague, &mut stream(Stream::Words));
        let [wrong, scale] = sizes.map_or([changes.mask_error.unwrap_or(0.0), 0.0], |s| [s.mask_wrong, s.mask_scale]);
        seen.masks = noise::mask_errors(&kitchen, &take, wrong, scale, &mut stream(Stream::Masks));
        if let Some(count) = changes.few_hands {
            noise::keep_few(&mut seen, &take, count, &mut stream(Stream::FewHands));
        }
        part_times(&mut take.frames);
        Ok(Self { options: *options, kitchen, take, seen, camera, up, has_masks: !changes.no_masks })
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
        solid::twin(&self.kitchen, name, &self.up, &crate::config::Config::default().fitting)
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
        let truth = &self.take.frames[frame];
        let masks = self.seen.masks[frame];
        let boxes = self.kitchen.posed(&truth.openings, &truth.hand, masks.swallowed);
        let mut picture = render::cast(&boxes, &truth.world_from_camera, &self.camera);
        if masks.scale != 1.0 {
            let part = &self.kitchen.parts[masks.part];
            let center = part.articulation.motion(truth.openings[masks.part]) * part.bounds.center;
            if let Some(about) = self.camera.project(&(truth.world_from_camera.inverse() * center)) {
                picture.classes = noise::scaled(&picture.classes, &self.camera, about, masks.scale);
            }
        }
        noise::degrade(&mut picture, &self.seen, frame, &self.camera, truth.is_still);
        let mut files = render::encode(&picture, &self.camera, frame, truth.is_still)?;
        if !self.has_masks {
            files.retain(|(name, _)| !name.starts_with("masks/"));
        }
        Ok(files)
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;
    use crate::articulation::{Action, Articulation, JointKind};
    use crate::math::Point;
    use crate::twin::OrientedBox;

    const BENCHMARK: [Tier; 7] = [Tier::T0, Tier::T1, Tier::T2, Tier::Hd, Tier::T3, Tier::Short, Tier::Nonm];

    fn recorded(seed: u64, tier: Tier, parts: usize, changes: &Changes) -> Recorded {
        Recorded::varied(&Options { seed, tier, width: 64, parts }, changes).unwrap()
    }

    fn plain(seed: u64, tier: Tier) -> Recorded {
        recorded(seed, tier, 6, &Changes::default())
    }

    #[test]
    fn tiers_have_one_name() {
        for tier in Tier::value_variants() {
            assert_eq!(tier.to_possible_value().unwrap().get_name(), tier.name());
        }
    }

    #[test]
    fn the_same_seed_gives_the_same_bytes_and_another_seed_others() {
        for tier in BENCHMARK {
            let [a, b, other] = [41, 41, 42].map(|seed| plain(seed, tier));
            assert_eq!(a.tables().unwrap(), b.tables().unwrap());
            assert_ne!(a.tables().unwrap(), other.tables().unwrap());
            for frame in [0, 40, a.frames() - 1] {
                assert_eq!(a.images(frame).unwrap(), b.images(frame).unwrap());
            }
        }
    }

    /// Recordings of these tiers are what earlier measurements were made on: their draws stay in their order.
    #[test]
    fn the_other_kitchens_stay_as_they_are() {
        for (tier, frames, hands, eye, wrist) in [
            (
                Tier::Clean,
                249,
                219,
                [-1.095738133104573, -3.539430672677363, 1.2542663298351522],
                [-1.0333137130316268, -3.3766696049446483, 0.8577592000585434],
            ),
            (
                Tier::Realistic,
                249,
                185,
                [-1.09586864130664, -3.5379575783677653, 1.2482309368243838],
                [-1.0416253654480352, -3.3762380424648426, 0.8722174702212279],
            ),
            (
                Tier::Hard,
                252,
                156,
                [-1.0618110913696521, -3.5006196545359947, 1.2513616137517867],
                [-0.9891836276524365, -3.2965788813079753, 0.8016514107600368],
            ),
        ] {
            let r = recorded(5, tier, 3, &Changes::default());
            assert_eq!((r.frames(), r.seen.hands.len(), r.take.clips.len()), (frames, hands, 7));
            let (pose, hand) = (r.seen.poses.last().unwrap(), r.seen.hands.last().unwrap());
            assert!(
                (pose.translation.vector - Vector::from(eye)).norm() < 1e-9,
                "{tier:?} {:?}",
                pose.translation.vector
            );
            assert!((hand.wrist - Point::from(wrist)).norm() < 1e-9, "{tier:?} {:?}", hand.wrist);
        }
    }

    #[test]
    fn tiers_share_kitchens_and_motions_and_changes_leave_the_rest_alone() {
        let (easy, hard) = (plain(7, Tier::T1), plain(7, Tier::T3));
        let used = |r: &Recorded| r.take.clips.iter().map(|c| (c.part.clone(), c.true_span)).collect::<Vec<_>>();
        assert_eq!(used(&easy), used(&hard));
        let close = |a: &OrientedBox, b: &OrientedBox| (a.center - b.center).norm() < 1e-9;
        assert!(easy.kitchen.parts.iter().zip(&hard.kitchen.parts).all(|(a, b)| close(&a.bounds, &b.bounds)));

        let changes =
            Changes { word_error: Some(1.0), mask_error: Some(1.0), few_hands: Some(2), ..Changes::default() };
        let changed = recorded(7, Tier::T1, 6, &changes);
        assert_eq!(easy.seen.poses, changed.seen.poses);
        let kept = |h: &noise::SeenHand| easy.seen.hands.iter().any(|e| e.frame == h.frame && e.grasp == h.grasp);
        assert!(!changed.seen.hands.is_empty() && changed.seen.hands.iter().all(kept));
        assert!(changed.seen.masks.iter().any(|m| m.swallowed.is_some()));
        for clip in changed.take.clips.iter().filter(|c| c.part.is_some()) {
            let part = changed.kitchen.parts.iter().find(|p| Some(&p.id) == clip.part.as_ref()).unwrap();
            let wrong = if part.articulation.kind == JointKind::Revolute { "drawer" } else { "cupboard" };
            assert_eq!(clip.noun, wrong);
        }
        let blind = recorded(7, Tier::T1, 1, &Changes { no_masks: true, ..Changes::default() });
        assert!(blind.images(0).unwrap().iter().all(|(name, _)| !name.starts_with("masks")));
        assert!(blind.tables().unwrap().iter().all(|(name, _)| name != "labels.json"));
    }

    #[test]
    fn no_two_frames_have_one_time() {
        for tier in Tier::value_variants() {
            for seed in [5, 6] {
                let options = Options { seed, tier: *tier, width: 64, parts: 3 };
                let r = Recorded::new(&options).unwrap();
                let times: Vec<f64> = r.take.frames.iter().map(|f| f.time_secs).collect();
                assert!(times.windows(2).all(|w| w[1] > w[0]), "{tier:?} {seed}");
            }
        }
    }

    #[test]
    fn impossible_changes_are_refused() {
        let options = Options { tier: Tier::Hard, ..Options::default() };
        for (changes, word) in [
            (Changes { clips_per_part: Some(5), ..Changes::default() }, "hard"),
            (Changes { word_error: Some(1.5), ..Changes::default() }, "word error"),
            (Changes { hand_noise_m: Some(f64::NAN), ..Changes::default() }, "hand noise"),
            (Changes { few_hands: Some(0), ..Changes::default() }, "0 hands"),
        ] {
            let error = Recorded::varied(&options, &changes).unwrap_err().to_string();
            assert!(error.contains(word), "{error}");
        }
    }

    #[test]
    fn the_hand_is_where_the_truth_puts_the_handle() {
        for (tier, reach) in [(Tier::T0, 0.02), (Tier::Nonm, 0.2)] {
            let r = plain(3, tier);
            let truth = r.truth();
            let read = |v: &serde_json::Value| -> [f64; 3] { serde_json::from_value(v.clone()).unwrap() };
            for clip in truth["clips"].as_array().unwrap() {
                let joint = truth["joints"].as_array().unwrap().iter().find(|j| j["id"] == clip["joint"]).unwrap();
                let phi = Articulation {
                    kind: serde_json::from_value(joint["type"].clone()).unwrap(),
                    axis: Vector::from(read(&joint["axis"])),
                    origin: Point::from(read(&joint["origin"])),
                };
                let handle = Point::from(read(&joint["handle_closed"]));
                let start = clip["true_start_frame"].as_u64().unwrap() as usize;
                let mut held = 0;
                for (i, x) in clip["x"].as_array().unwrap().iter().enumerate() {
                    let frame = &r.take.frames[start + i];
                    if frame.contact {
                        let expected = phi.motion(x.as_f64().unwrap()) * handle;
                        assert!((frame.grasp.unwrap().0 - expected).norm() < reach, "{tier:?}, {clip}");
                        held += 1;
                    }
                }
                assert!(held > 5);
                let upper = joint["range"][1].as_f64().unwrap();
                assert!(
                    clip["x"].as_array().unwrap().iter().all(|x| (0.0..=upper + 1e-9).contains(&x.as_f64().unwrap()))
                );
            }
            assert_eq!(truth["tier"], tier.name());
            let up = Vector::from(read(&truth["up"]));
            assert!((up.norm() - 1.0).abs() < 1e-9 && up.z > 0.999);
        }
    }

    /// Points inside a box, its surface left out.
    fn inside(shape: &OrientedBox) -> Vec<Point> {
        const STEPS: i32 = 4;
        let half = shape.half.map(|h| (h - 0.0015).max(0.0));
        let at = |i: i32| f64::from(2 * i) / f64::from(STEPS) - 1.0;
        let mut points = Vec::new();
        for (i, j, k) in (0..=STEPS).flat_map(|i| (0..=STEPS).flat_map(move |j| (0..=STEPS).map(move |k| (i, j, k)))) {
            let local = Vector::new(at(i) * half.x, at(j) * half.y, at(k) * half.z);
            points.push(shape.center + shape.rotation * local);
        }
        points
    }

    #[test]
    fn no_part_passes_through_another_on_its_way() {
        for seed in 0..3 {
            for turned in [None, Some([0.3, 0.5])] {
                let kitchen = fitted::build(&mut Stream::Kitchen.rng(seed), turned);
                for (index, part) in kitchen.parts.iter().enumerate() {
                    for step in 0..=10 {
                        let motion = part.articulation.motion(part.upper * f64::from(step) / 10.0);
                        for block in &part.blocks {
                            let shape = block.shape.moved(&motion);
                            let radius = shape.half.norm();
                            let others = kitchen.parts.iter().enumerate().filter(|(i, _)| *i != index);
                            let near: Vec<_> = others
                                .flat_map(|(_, other)| other.blocks.iter().map(move |b| (other, b)))
                                .filter(|(_, b)| (b.shape.center - shape.center).norm() < radius + b.shape.half.norm())
                                .collect();
                            if near.is_empty() {
                                continue;
                            }
                            for p in inside(&shape) {
                                for (other, b) in &near {
                                    let (a, o) = (part.kind, other.kind);
                                    assert!(!b.shape.contains(&p), "seed {seed}: {a} {} in {o} {}", part.id, other.id);
                                }
                            }
                        }
                    }
                }
            }
        }
    }

    #[test]
    fn sliding_leaves_pass_each_other_in_their_unit() {
        let kitchen = fitted::build(&mut Stream::Kitchen.rng(1), None);
        let leaves: Vec<_> = kitchen.parts.iter().filter(|p| p.kind == "sliding door").collect();
        assert_eq!(leaves.len(), 2);
        for leaf in &leaves {
            let across = leaf.articulation.axis;
            assert!(across.dot(&leaf.out).abs() < 1e-9 && across.z.abs() < 1e-9);
            // Open, the leaf does not stand over the end of its unit.
            let moved = leaf.blocks[0].shape.moved(&leaf.articulation.motion(leaf.upper));
            let end = (leaf.base.center - moved.center).dot(&across).abs() + moved.half.x;
            assert!(end <= leaf.base.half.x + 1e-9, "{end}");
        }
        let air = (leaves[0].blocks[0].shape.center - leaves[1].blocks[0].shape.center).dot(&leaves[0].out).abs();
        assert!((air - kitchen::BOARD - 0.02).abs() < 1e-9, "{air}");
    }

    #[test]
    fn turned_furniture_keeps_off_the_rooms_directions_and_the_room_does_not_turn() {
        for seed in 0..5 {
            let (straight, turned) = (plain(seed, Tier::T2), plain(seed, Tier::Nonm));
            // The floor is the last but the boards on it; all share the room's axes.
            let room = turned.kitchen.fixed.last().unwrap().shape.rotation;
            assert!((straight.kitchen.fixed.last().unwrap().shape.rotation - room).norm() < 1e-9);
            for part in &turned.kitchen.parts {
                let along = (room.transpose() * part.out).normalize();
                let angle = along.y.atan2(along.x).to_degrees().rem_euclid(90.0);
                assert!((11.0..=34.0).contains(&angle.min(90.0 - angle)), "{angle}");
            }
        }
    }

    #[test]
    fn kitchens_and_takes_are_as_varied_as_they_should_be() {
        let takes: Vec<Recorded> = (0..30).map(|seed| plain(seed, Tier::T3)).collect();
        let (mut clips, mut opening, mut sliding, mut misnamed, mut distractors) = (0.0, 0.0, 0.0, 0.0, 0);
        let mut kinds = BTreeSet::new();
        for r in &takes {
            let boxes = r.kitchen.fixed.len() + r.kitchen.parts.iter().map(|p| p.blocks.len()).sum::<usize>();
            assert!(boxes < 450, "{boxes} boxes");
            assert!(r.kitchen.parts.len() >= 20, "{} parts", r.kitchen.parts.len());
            for clip in &r.take.clips {
                let Some(part) = r.kitchen.parts.iter().find(|p| Some(&p.id) == clip.part.as_ref()) else {
                    distractors += 1;
                    continue;
                };
                kinds.insert(part.kind);
                clips += 1.0;
                opening += f64::from(u8::from(clip.action == Some(Action::Open)));
                sliding += f64::from(u8::from(part.articulation.kind == JointKind::Prismatic));
                misnamed += f64::from(u8::from(clip.noun != part.noun));
            }
        }
        assert_eq!((clips, distractors), (360.0, 30));
        assert!((0.52..0.68).contains(&(opening / clips)), "{opening} of {clips} open");
        assert!((0.2..0.5).contains(&(sliding / clips)), "{sliding} of {clips} slide");
        assert!((0.17..0.33).contains(&(misnamed / clips)), "{misnamed} of {clips} have a wrong or vague noun");
        for kind in
            ["drawer", "door", "sliding door", "flap", "lid", "oven", "dishwasher", "microwave", "fridge", "pantry"]
        {
            assert!(kinds.contains(kind), "no {kind} is ever opened");
        }
    }

    #[test]
    fn a_part_is_shown_as_often_as_asked_with_others_in_between() {
        let r = recorded(2, Tier::Hd, 2, &Changes { clips_per_part: Some(5), ..Changes::default() });
        let order: Vec<(String, Action)> =
            r.take.clips.iter().filter_map(|c| Some((c.part.clone()?, c.action?))).collect();
        let names: BTreeSet<&String> = order.iter().map(|(part, _)| part).collect();
        assert_eq!((order.len(), names.len()), (10, 2));
        for name in names {
            assert_eq!(order.iter().filter(|(part, _)| part == name).count(), 5);
        }
        // Nothing is closed that was not just opened.
        for pair in order.windows(2).filter(|pair| pair[1].1 == Action::Close) {
            assert!(pair[0].0 == pair[1].0 && pair[0].1 == Action::Open);
        }
    }
}
