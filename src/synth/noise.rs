//! The errors of estimated hands, poses and depth.

use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;

use super::kitchen::Kitchen;
use super::person::Take;
use super::render::{Rendering, blur};
use super::variants::{Changes, Tier};
use crate::math::{Point, Pose, Vector};
use crate::recording::{Camera, HAND_CLASS};

/// A hand as an estimator sees it.
#[derive(Debug, Clone, Copy)]
pub struct SeenHand {
    /// Frame.
    pub frame: usize,
    /// Fingertip mean.
    pub grasp: Point,
    /// Wrist.
    pub wrist: Point,
    /// Contact flag.
    pub contact: bool,
}

/// What the estimators report.
#[derive(Debug, Clone)]
pub struct Observed {
    /// Camera poses.
    pub poses: Vec<Pose>,
    /// Hands.
    pub hands: Vec<SeenHand>,
    /// Depth scale of each frame, in the middle of the image.
    pub depth_scale: Vec<f64>,
    /// By how much the scale differs from that at the right and lower edge of each frame.
    pub depth_tilt: Vec<[f64; 2]>,
    /// Mask error of each frame.
    pub masks: Vec<MaskError>,
    /// Seed of the pixel noise; none on clean recordings.
    pub pixel_seed: Option<u64>,
    /// Sizes of the pixel noise.
    pub pixels: PixelSizes,
}

/// How the masks of a frame are wrong.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MaskError {
    /// A part whose furniture shows the class of the touched one.
    pub swallowed: Option<(usize, u8)>,
    /// The touched part, about which the masks are scaled.
    pub part: usize,
    /// The scale.
    pub scale: f64,
}

impl MaskError {
    /// Masks as they are.
    pub const NONE: Self = Self { swallowed: None, part: 0, scale: 1.0 };
}

/// Sizes of the noise of single pixels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PixelSizes {
    /// Relative error of the depth.
    pub depth: f32,
    /// Grain of the image, grey levels.
    pub grain: f32,
    /// What remains of the image's contrast.
    pub contrast: f64,
    /// Blur of the image, pixels.
    pub blur_px: f64,
    /// Error of a pixel's normal, radians about each of two directions.
    pub normal_rad: f64,
    /// Error of all normals of a frame, radians about each axis.
    pub normal_frame_rad: f64,
}

/// 0.4 % of the distance, and a camera's grain.
const PIXELS: PixelSizes =
    PixelSizes { depth: 0.004, grain: 3.0, contrast: 1.0, blur_px: 0.0, normal_rad: 0.0, normal_frame_rad: 0.0 };

/// Sizes of all errors but the pixels'.
struct HandErrors {
    pose_m: f64,
    pose_rad: f64,
    hand_white_m: f64,
    hand_lateral_m: f64,
    hand_ray_m: f64,
    ray_bias: f64,
    outliers: f64,
    dropout: f64,
    flips: f64,
    depth_scale: f64,
    depth_frame: f64,
}

/// Realistic errors: about those of current hand, pose and metric-depth estimators on head-worn video.
fn sizes(tier: Tier, changes: &Changes) -> HandErrors {
    let mut s = match tier {
        Tier::Clean => HandErrors {
            pose_m: 0.0,
            pose_rad: 0.0,
            hand_white_m: 0.002,
            hand_lateral_m: 0.002,
            hand_ray_m: 0.003,
            ray_bias: 0.0,
            outliers: 0.0,
            dropout: 0.0,
            flips: 0.0,
            depth_scale: 0.0,
            depth_frame: 0.0,
        },
        Tier::Realistic => HandErrors {
            pose_m: 0.004,
            pose_rad: 0.004,
            hand_white_m: 0.004,
            hand_lateral_m: 0.008,
            hand_ray_m: 0.015,
            ray_bias: 0.02,
            outliers: 0.04,
            dropout: 0.12,
            flips: 0.06,
            depth_scale: 0.02,
            depth_frame: 0.01,
        },
        // The benchmark's tiers have their own table and are not observed here.
        _ => HandErrors {
            pose_m: 0.006,
            pose_rad: 0.006,
            hand_white_m: 0.006,
            hand_lateral_m: 0.015,
            hand_ray_m: 0.03,
            ray_bias: 0.03,
            outliers: 0.1,
            dropout: 0.28,
            flips: 0.1,
            depth_scale: 0.05,
            depth_frame: 0.02,
        },
    };
    let factor = changes.hand_factor(s.hand_lateral_m, s.hand_ray_m, s.hand_white_m);
    s.hand_lateral_m *= factor;
    s.hand_ray_m *= factor;
    s.hand_white_m *= factor;
    s.ray_bias = changes.depth_bias.unwrap_or(s.ray_bias);
    s
}

pub(super) fn normal(rng: &mut Pcg64Mcg) -> f64 {
    StandardNormal.sample(rng)
}

/// Whether something of this probability happens: one draw whatever the probability.
pub(super) fn chance(rng: &mut Pcg64Mcg, share: f64) -> bool {
    rng.random::<f64>() < share
}

pub(super) fn normal3(rng: &mut Pcg64Mcg) -> Vector {
    Vector::new(normal(rng), normal(rng), normal(rng))
}

/// What the estimators make of a take.
#[must_use]
pub fn observe(take: &Take, tier: Tier, changes: &Changes, rng: &mut Pcg64Mcg) -> Observed {
    let s = sizes(tier, changes);
    // Correlation time of hand and pose errors.
    const TAU_SECS: f64 = 0.3;
    let scale = 1.0 + s.depth_scale * normal(rng);
    let bias = s.ray_bias * normal(rng);
    let (mut drift, mut turn, mut hand_error) = (Vector::zeros(), Vector::zeros(), Vector::zeros());
    let mut seen = Observed {
        poses: Vec::new(),
        hands: Vec::new(),
        depth_scale: Vec::new(),
        depth_tilt: vec![[0.0; 2]; take.frames.len()],
        masks: vec![MaskError::NONE; take.frames.len()],
        pixel_seed: (tier != Tier::Clean).then(|| rng.random()),
        pixels: PIXELS,
    };
    let mut last = f64::NEG_INFINITY;
    for (frame, truth) in take.frames.iter().enumerate() {
        let keep = (-(truth.time_secs - last).clamp(0.0, 1e3) / TAU_SECS).exp();
        last = truth.time_secs;
        let fresh = (1.0 - keep * keep).sqrt();
        drift = drift * keep + normal3(rng) * (fresh * s.pose_m);
        turn = turn * keep + normal3(rng) * (fresh * s.pose_rad);
        hand_error = hand_error * keep + normal3(rng) * fresh;
        let pose = truth.world_from_camera;
        seen.poses.push(Pose::from_parts(
            (pose.translation.vector + drift).into(),
            nalgebra::UnitQuaternion::from_scaled_axis(turn) * pose.rotation,
        ));
        seen.depth_scale.push(scale * (1.0 + s.depth_frame * normal(rng)));
        let Some((grasp, wrist)) = truth.grasp else { continue };
        let (dropped, flipped, outlier) =
            (rng.random_bool(s.dropout), rng.random_bool(s.flips), rng.random_bool(s.outliers));
        let far = normal3(rng);
        let white = normal3(rng);
        if dropped {
            continue;
        }
        let eye = Point::from(pose.translation.vector);
        let ray = crate::math::unit(&(grasp - eye)).unwrap_or_else(Vector::x);
        let along = ray.dot(&hand_error);
        let mut error = ray * (along * s.hand_ray_m) + (hand_error - ray * along) * s.hand_lateral_m;
        error += ray * (bias * (grasp - eye).norm()) + white * s.hand_white_m;
        if outlier {
            error += crate::math::unit(&far).unwrap_or_else(Vector::x) * 0.15;
        }
        seen.hands.push(SeenHand {
            frame,
            grasp: grasp + error,
            wrist: wrist + error,
            contact: truth.contact != flipped,
        });
    }
    seen
}

/// In a share `wrong` of clips the masks give the touched part's class to the nearest part of another class; all masks of
/// a clip are scaled about the touched part.
#[must_use]
pub fn mask_errors(kitchen: &Kitchen, take: &Take, wrong: f64, scale: f64, rng: &mut Pcg64Mcg) -> Vec<MaskError> {
    // Centres of neighbours lie nearer than this.
    const NEAR_M: f64 = 1.0;
    let class = |part: usize| kitchen.parts[part].blocks.first().map_or(0, |b| b.class);
    let of_clip: Vec<MaskError> = take
        .clips
        .iter()
        .map(|clip| {
            let (is_wrong, draw) = (chance(rng, wrong), normal(rng));
            let Some(part) = kitchen.parts.iter().position(|p| clip.part.as_ref() == Some(&p.id)) else {
                return MaskError::NONE;
            };
            let distance =
                |other: usize| (kitchen.parts[other].bounds.center - kitchen.parts[part].bounds.center).norm();
            let neighbour = (0..kitchen.parts.len())
                .filter(|&other| class(other) != class(part) && distance(other) < NEAR_M)
                .min_by(|&a, &b| distance(a).total_cmp(&distance(b)));
            MaskError {
                swallowed: neighbour.filter(|_| is_wrong).map(|other| (other, class(part))),
                part,
                scale: (1.0 + scale * draw).max(0.5),
            }
        })
        .collect();
    take.segments().iter().map(|s| s.and_then(|i| of_clip.get(i).copied()).unwrap_or(MaskError::NONE)).collect()
}

/// Keeps `count` hand samples with contact of each clip, chosen at random, and no others.
pub fn keep_few(seen: &mut Observed, take: &Take, count: usize, rng: &mut Pcg64Mcg) {
    let mut kept: Vec<SeenHand> = Vec::new();
    for clip in take.clips.iter().filter(|c| c.part.is_some()) {
        let span = clip.true_span[0]..=clip.true_span[1];
        let mut held: Vec<SeenHand> =
            seen.hands.iter().filter(|h| h.contact && span.contains(&h.frame)).copied().collect();
        while held.len() > count {
            held.remove(rng.random_range(0..held.len()));
        }
        kept.extend(held);
    }
    seen.hands = kept;
}

/// Masks scaled about the pixel (u, v); hands stay where they are.
#[must_use]
pub fn scaled(classes: &[u8], camera: &Camera, about: (f64, f64), scale: f64) -> Vec<u8> {
    let source = |at: usize, about: f64, size: usize| {
        (about + (at as f64 - about) / scale).round().clamp(0.0, size as f64 - 1.0) as usize
    };
    let at = |x: usize, y: usize| classes[y * camera.width + x];
    (0..camera.width * camera.height)
        .map(|i| {
            let (x, y) = (i % camera.width, i / camera.width);
            let from = at(source(x, about.0, camera.width), source(y, about.1, camera.height));
            if at(x, y) == HAND_CLASS || from == HAND_CLASS { at(x, y) } else { from }
        })
        .collect()
}

/// Errors of depth, image and normals of a rendered frame.
pub fn degrade(picture: &mut Rendering, seen: &Observed, frame: usize, camera: &Camera, with_normals: bool) {
    let scale = seen.depth_scale[frame] as f32;
    for z in &mut picture.depth {
        *z *= scale;
    }
    let [right, down] = seen.depth_tilt[frame];
    if right != 0.0 || down != 0.0 {
        let from_middle = |at: usize, size: usize| 2.0 * at as f64 / size as f64 - 1.0;
        for (i, z) in picture.depth.iter_mut().enumerate() {
            let (x, y) = (i % camera.width, i / camera.width);
            *z *= (1.0 + right * from_middle(x, camera.width) + down * from_middle(y, camera.height)) as f32;
        }
    }
    let Some(seed) = seen.pixel_seed else { return };
    let pixels = &seen.pixels;
    blur(&mut picture.rgb, camera.width, pixels.blur_px);
    if pixels.contrast != 1.0 {
        const GREY: f64 = 128.0;
        for c in picture.rgb.iter_mut().flatten() {
            *c = (GREY + pixels.contrast * (f64::from(*c) - GREY)).round() as u8;
        }
    }
    let mut rng = Pcg64Mcg::seed_from_u64(seed ^ (frame as u64) << 32);
    for (z, rgb) in picture.depth.iter_mut().zip(&mut picture.rgb) {
        let [a, b] = [normal(&mut rng) as f32, normal(&mut rng) as f32];
        *z *= 1.0 + pixels.depth * a;
        for c in rgb {
            *c = (f32::from(*c) + pixels.grain * b).clamp(0.0, 255.0) as u8;
        }
    }
    if with_normals && (pixels.normal_rad > 0.0 || pixels.normal_frame_rad > 0.0) {
        turn_normals(picture, camera, pixels, &mut rng);
    }
}

/// Normals stay as they are where an error would turn them away from the camera.
fn turn_normals(picture: &mut Rendering, camera: &Camera, sizes: &PixelSizes, rng: &mut Pcg64Mcg) {
    let bias = nalgebra::UnitQuaternion::from_scaled_axis(normal3(rng) * sizes.normal_frame_rad);
    for (i, n) in picture.normals.iter_mut().enumerate() {
        if *n == [0.0; 3] {
            continue;
        }
        let exact = Vector::from(n.map(f64::from));
        let error = normal3(rng) * sizes.normal_rad;
        let turned = bias * (exact + crate::math::reject(&error, &exact)).normalize();
        let ray = camera.unproject((i % camera.width) as f64, (i / camera.width) as f64, 1.0).coords;
        if turned.dot(&ray) < 0.0 {
            *n = [turned.x as f32, turned.y as f32, turned.z as f32];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::articulation::Action;
    use crate::math::stats;
    use crate::synth::benchmark::{self, BURST_SECS};
    use crate::synth::person::{TakeClip, TrueFrame};
    use crate::synth::tiers;

    const CAMERA: Camera = Camera { width: 64, height: 48, fx: 32.0, fy: 32.0, cx: 31.5, cy: 23.5 };
    const CLIPS: usize = 800;
    const LENGTH: usize = 40;

    /// Clips of a hand that rests a metre before a camera that does not move, in contact for the second half.
    fn resting() -> Take {
        let mut take = Take::default();
        for clip in 0..CLIPS {
            for i in 0..LENGTH {
                take.frames.push(TrueFrame {
                    time_secs: 20.0 * clip as f64 + i as f64 / super::super::person::FPS,
                    world_from_camera: Pose::identity(),
                    openings: Vec::new(),
                    hand: Vec::new(),
                    grasp: Some((Point::new(0.0, 0.0, 1.0), Point::new(0.0, 0.1, 0.9))),
                    contact: i >= LENGTH / 2,
                    is_still: false,
                });
            }
            let span = [clip * LENGTH, (clip + 1) * LENGTH - 1];
            take.clips.push(TakeClip {
                span,
                true_span: span,
                part: Some("part".to_owned()),
                action: Some(Action::Open),
                narration: String::new(),
                verb: String::new(),
                noun: String::new(),
            });
        }
        take
    }

    fn rms(values: impl Iterator<Item = f64>) -> f64 {
        let squares: Vec<f64> = values.map(|v| v * v).collect();
        (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
    }

    fn near(measured: f64, intended: f64, tolerance: f64, what: &str) {
        assert!((measured - intended).abs() <= tolerance * intended + 1e-9, "{what}: {measured} instead of {intended}");
    }

    #[test]
    fn every_tier_errs_as_much_as_its_table_says() {
        let take = resting();
        for tier in [Tier::T0, Tier::T1, Tier::T2, Tier::Hd, Tier::T3, Tier::Short, Tier::Nonm] {
            let s = tiers::sizes(tier, &Changes::default()).unwrap();
            let mut seen = benchmark::observe(&take, &CAMERA, &s, &mut Pcg64Mcg::seed_from_u64(1));
            let say = |what: &str| format!("{tier:?}, {what}");
            let count = (CLIPS * LENGTH) as f64;
            near(1.0 - seen.hands.len() as f64 / count, s.dropout, 0.1, &say("dropout"));
            let camera_moved = seen.poses.iter().flat_map(|p| p.translation.vector.iter().copied().collect::<Vec<_>>());
            near(rms(camera_moved), s.pose_m, 0.06, &say("camera"));
            let turned = seen.poses.iter().flat_map(|p| p.rotation.scaled_axis().iter().copied().collect::<Vec<_>>());
            near(rms(turned), s.pose_rad, 0.06, &say("camera's direction"));

            // In the camera's frame, whose error hands inherit.
            let error = |h: &SeenHand| seen.poses[h.frame].inverse() * h.grasp - Point::new(0.0, 0.0, 1.0);
            let errors: Vec<Vector> = seen.hands.iter().map(error).collect();
            // Medians do not see outliers; 0.6745 of a normal's standard deviation is the median of its size.
            let spread = |v: Vec<f64>| stats::median(&v).unwrap() / 0.6745;
            let lateral = spread(errors.iter().flat_map(|e| [e.x.abs(), e.y.abs()]).collect());
            let expected = s.hand_lateral_m.hypot(s.hand_white_m);
            near(lateral, expected, 0.15, &say("hand across the ray"));
            let along = spread(errors.iter().map(|e| e.z.abs()).collect());
            let expected = s.hand_ray_m.hypot(s.hand_white_m).hypot(s.ray_bias);
            near(along, expected, 0.2, &say("hand along the ray"));
            let far = errors.iter().filter(|e| e.xy().norm() > 6.0 * s.hand_lateral_m.hypot(s.hand_white_m)).count();
            assert!(far as f64 <= 1.2 * s.outliers * errors.len() as f64 + 1.0, "{}", say("outliers"));
            assert!(far as f64 >= 0.3 * s.outliers * errors.len() as f64, "{}", say("outliers"));

            // A quarter of a clip away from where contact begins and from where it ends.
            let sure = |h: &&SeenHand| {
                let i = h.frame % LENGTH;
                i < LENGTH / 4 || (3 * LENGTH / 4..LENGTH - LENGTH / 8).contains(&i)
            };
            let flipped = seen.hands.iter().filter(sure).filter(|h| h.contact != take.frames[h.frame].contact).count();
            let share = flipped as f64 / seen.hands.iter().filter(sure).count() as f64;
            near(share, s.contact_flips, 0.25, &say("contact"));

            let of_clips = |of: &dyn Fn(usize) -> f64| rms((0..CLIPS).map(of));
            let mean =
                |clip: usize| seen.depth_scale[clip * LENGTH..(clip + 1) * LENGTH].iter().sum::<f64>() / LENGTH as f64;
            near(of_clips(&|clip| mean(clip) - 1.0), s.depth_scale, 0.15, &say("depth scale"));
            near(of_clips(&|clip| seen.depth_tilt[clip * LENGTH][0]), s.depth_tilt, 0.15, &say("depth tilt"));
            let jitter = (0..take.frames.len()).map(|f| seen.depth_scale[f] / mean(f / LENGTH) - 1.0);
            near(rms(jitter), s.depth_frame, 0.06, &say("depth of single frames"));

            keep_few(&mut seen, &take, 3, &mut Pcg64Mcg::seed_from_u64(2));
            assert!(seen.hands.len() <= 3 * CLIPS && seen.hands.iter().all(|h| h.contact));
        }
    }

    #[test]
    fn hands_are_lost_in_bursts() {
        let s = tiers::sizes(Tier::T2, &Changes::default()).unwrap();
        let seen = benchmark::observe(&resting(), &CAMERA, &s, &mut Pcg64Mcg::seed_from_u64(3));
        let mut is_seen = vec![false; CLIPS * LENGTH];
        seen.hands.iter().for_each(|h| is_seen[h.frame] = true);
        // Whether the frame after a lost one is lost, too: by chance alone it would be so in 40 %.
        let lost: Vec<usize> = (0..is_seen.len() - 1).filter(|f| !is_seen[*f] && (f + 1) % LENGTH != 0).collect();
        let again = lost.iter().filter(|f| !is_seen[**f + 1]).count();
        near(again as f64 / lost.len() as f64, 1.0 - 1.0 / (BURST_SECS * super::super::person::FPS), 0.05, "bursts");
    }

    #[test]
    fn a_wanted_hand_noise_is_what_comes_out_on_any_tier() {
        for tier in [Tier::Realistic, Tier::T1, Tier::T3] {
            let changes = Changes { hand_noise_m: Some(0.05), depth_bias: Some(0.0), ..Changes::default() };
            let rng = &mut Pcg64Mcg::seed_from_u64(4);
            let seen = match tiers::sizes(tier, &changes) {
                Some(s) => benchmark::observe(&resting(), &CAMERA, &s, rng),
                None => observe(&resting(), tier, &changes, rng),
            };
            let sizes = seen.hands.iter().map(|h| (h.grasp - Point::new(0.0, 0.0, 1.0)).norm_squared());
            // Without the outliers.
            let kept: Vec<f64> = sizes.filter(|s| s.sqrt() < 0.2).collect();
            let per_axis = (kept.iter().sum::<f64>() / (3.0 * kept.len() as f64)).sqrt();
            near(per_axis, 0.05, 0.15, &format!("{tier:?}"));
        }
    }

    #[test]
    fn scaled_masks_grow_about_their_middle_and_leave_hands_alone() {
        let mut classes = vec![0u8; 64 * 48];
        for y in 16..32 {
            classes[y * 64 + 24..y * 64 + 40].fill(2);
        }
        classes[5] = HAND_CLASS;
        let grown = scaled(&classes, &CAMERA, (31.5, 23.5), 1.5);
        let area = |c: &[u8]| c.iter().filter(|v| **v == 2).count() as f64;
        near(area(&grown) / area(&classes), 2.25, 0.15, "area");
        assert_eq!(grown.iter().filter(|v| **v == HAND_CLASS).count(), 1);
        assert_eq!(grown[5], HAND_CLASS);
    }
}
