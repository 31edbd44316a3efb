//! The errors of estimated hands, poses and depth on the benchmark's tiers, whose sizes are in `tiers`.

use rand::RngExt;
use rand_pcg::Pcg64Mcg;

use super::noise::{MaskError, Observed, PixelSizes, SeenHand, chance, normal, normal3};
use super::person::Take;
use super::tiers;
use crate::math::{Point, Pose, Vector, unit};
use crate::recording::Camera;

/// Correlation time of the slowly varying errors of hands, and of poses.
const HAND_TAU_SECS: f64 = 0.2;
const POSE_TAU_SECS: f64 = 0.3;
/// Mean duration of a burst of frames without a hand.
pub(super) const BURST_SECS: f64 = 0.4;
/// How far off outliers are.
const OUTLIER_M: [f64; 2] = [0.1, 0.3];
/// The width for which blurs are given.
const BLUR_WIDTH_PX: f64 = 320.0;

/// Errors that stay the same for a clip.
struct PerClip {
    depth_scale: f64,
    depth_tilt: [f64; 2],
    ray_bias: f64,
    /// When contact is seen to begin and to end.
    contact_secs: [f64; 2],
    /// No hand is seen at the moment.
    is_dropped: bool,
}

/// What the estimators make of a take on a tier of the benchmark. The number of draws does not depend on the sizes.
#[must_use]
pub fn observe(take: &Take, camera: &Camera, s: &tiers::TierSizes, rng: &mut Pcg64Mcg) -> Observed {
    let mut seen = nothing_seen(take, camera, s, rng.random());
    let segments = take.segments();
    let mut clip = per_clip(take, segments.first().copied().flatten(), s, rng);
    let (mut place, mut turn, mut slow) = (normal3(rng), normal3(rng), normal3(rng));
    let mut last: Option<(f64, Option<usize>)> = None;
    for (frame, (truth, segment)) in take.frames.iter().zip(&segments).enumerate() {
        if last.is_some_and(|(_, before)| before != *segment) {
            clip = per_clip(take, *segment, s, rng);
        }
        let gap = last.map_or(0.0, |(time, _)| truth.time_secs - time);
        last = Some((truth.time_secs, *segment));
        place = carried(&place, gap / POSE_TAU_SECS, rng);
        turn = carried(&turn, gap / POSE_TAU_SECS, rng);
        slow = carried(&slow, gap / HAND_TAU_SECS, rng);
        let pose = truth.world_from_camera;
        let seen_pose = Pose::from_parts(
            (pose.translation.vector + place * s.pose_m).into(),
            nalgebra::UnitQuaternion::from_scaled_axis(turn * s.pose_rad) * pose.rotation,
        );
        seen.poses.push(seen_pose);
        seen.depth_scale.push(clip.depth_scale * (1.0 + s.depth_frame * normal(rng)));
        seen.depth_tilt.push(clip.depth_tilt);
        let Some((grasp, wrist)) = truth.grasp else { continue };
        let draws = HandDraws::of(&mut clip, gap, s, rng);
        let in_view = camera.project(&(pose.inverse() * grasp)).is_some_and(|(u, v)| camera.contains(u, v));
        if clip.is_dropped || !in_view {
            continue;
        }
        let error = draws.error(&(grasp - pose.translation.vector), &slow, clip.ray_bias, s);
        // Hands are found in the camera's frame: they inherit the error of its pose.
        let moved = seen_pose * pose.inverse();
        let [begin, end] = clip.contact_secs;
        let in_contact = (begin..=end).contains(&truth.time_secs);
        seen.hands.push(SeenHand {
            frame,
            grasp: moved * (grasp + error),
            wrist: moved * (wrist + error),
            contact: in_contact != draws.is_flipped,
        });
    }
    seen
}

/// Before the first frame is looked at.
fn nothing_seen(take: &Take, camera: &Camera, s: &tiers::TierSizes, pixel_seed: u64) -> Observed {
    Observed {
        poses: Vec::new(),
        hands: Vec::new(),
        depth_scale: Vec::new(),
        depth_tilt: Vec::new(),
        masks: vec![MaskError::NONE; take.frames.len()],
        pixel_seed: Some(pixel_seed),
        pixels: PixelSizes {
            depth: s.depth_pixel as f32,
            grain: s.grain as f32,
            contrast: s.contrast,
            blur_px: s.blur_px * camera.width as f64 / BLUR_WIDTH_PX,
            normal_rad: s.normal_pixel_rad,
            normal_frame_rad: s.normal_frame_rad,
        },
    }
}

/// What is drawn for the hand of one frame, whether it is seen or not.
struct HandDraws {
    is_flipped: bool,
    is_outlier: bool,
    /// How far off an outlier is, 0 to 1.
    size: f64,
    /// Normal draws a coordinate: where an outlier lies, and the noise of this frame alone.
    far: Vector,
    white: Vector,
}

impl HandDraws {
    /// Draws for a frame, `gap` seconds after the one before; whether the hand is dropped goes to `clip`.
    fn of(clip: &mut PerClip, gap: f64, s: &tiers::TierSizes, rng: &mut Pcg64Mcg) -> Self {
        // A chain of two states with the wanted mean duration of a burst and share of frames.
        let ends = (gap / BURST_SECS).min(0.5);
        let begins = if s.dropout < 1.0 { (ends * s.dropout / (1.0 - s.dropout)).min(1.0) } else { 1.0 };
        let draw: f64 = rng.random();
        clip.is_dropped = if clip.is_dropped { draw >= ends } else { draw < begins };
        let (is_flipped, is_outlier) = (chance(rng, s.contact_flips), chance(rng, s.outliers));
        let size: f64 = rng.random();
        let (far, white) = (normal3(rng), normal3(rng));
        Self { is_flipped, is_outlier, size, far, white }
    }

    /// By how much the hand is off, world, metres; `to_hand` leads from the camera to the hand, `slow` is the error that
    /// changes slowly, in standard deviations.
    fn error(&self, to_hand: &Point, slow: &Vector, ray_bias: f64, s: &tiers::TierSizes) -> Vector {
        let ray = unit(&to_hand.coords).unwrap_or_else(Vector::x);
        let along = ray.dot(slow);
        let mut error = ray * (along * s.hand_ray_m) + (slow - ray * along) * s.hand_lateral_m;
        error += ray * (ray_bias * to_hand.coords.norm()) + self.white * s.hand_white_m;
        if self.is_outlier {
            let distance = OUTLIER_M[0] + (OUTLIER_M[1] - OUTLIER_M[0]) * self.size;
            error += unit(&self.far).unwrap_or_else(Vector::x) * distance;
        }
        error
    }
}

fn per_clip(take: &Take, clip: Option<usize>, s: &tiers::TierSizes, rng: &mut Pcg64Mcg) -> PerClip {
    // Half a frame to each side belongs to a frame.
    const HALF_FRAME: f64 = 0.5 / super::person::FPS;
    let frames = clip.and_then(|i| take.clips.get(i)).and_then(|c| take.frames.get(c.true_span[0]..=c.true_span[1]));
    let held = || frames.unwrap_or_default().iter().filter(|f| f.contact).map(|f| f.time_secs);
    let (first, last) = (held().next().unwrap_or(f64::INFINITY), held().next_back().unwrap_or(f64::NEG_INFINITY));
    PerClip {
        depth_scale: 1.0 + s.depth_scale * normal(rng),
        depth_tilt: [s.depth_tilt * normal(rng), s.depth_tilt * normal(rng)],
        ray_bias: s.ray_bias * normal(rng),
        contact_secs: [
            first - HALF_FRAME + s.boundary_secs * normal(rng),
            last + HALF_FRAME + s.boundary_secs * normal(rng),
        ],
        is_dropped: chance(rng, s.dropout),
    }
}

/// A stationary unit error after some correlation times.
fn carried(error: &Vector, times: f64, rng: &mut Pcg64Mcg) -> Vector {
    let keep = (-times).exp();
    error * keep + normal3(rng) * (1.0 - keep * keep).sqrt()
}
