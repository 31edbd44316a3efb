//! The errors of estimated hands, poses and depth.

use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;

use super::Tier;
use super::person::Take;
use super::render::Picture;
use crate::math::{Point, Pose, Vector};

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
pub struct Seen {
    /// Camera poses.
    pub poses: Vec<Pose>,
    /// Hands.
    pub hands: Vec<SeenHand>,
    /// Depth scale of each frame.
    pub depth_scale: Vec<f64>,
    /// Seed of the pixel noise; none on clean recordings.
    pub pixel_seed: Option<u64>,
}

/// Sizes of all errors.
struct Sizes {
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
fn sizes(tier: Tier) -> Sizes {
    match tier {
        Tier::Clean => Sizes {
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
        Tier::Realistic => Sizes {
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
        Tier::Hard => Sizes {
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
    }
}

fn normal(rng: &mut Pcg64Mcg) -> f64 {
    StandardNormal.sample(rng)
}

fn normal3(rng: &mut Pcg64Mcg) -> Vector {
    Vector::new(normal(rng), normal(rng), normal(rng))
}

/// What the estimators make of a take.
#[must_use]
pub fn observe(take: &Take, tier: Tier, rng: &mut Pcg64Mcg) -> Seen {
    let s = sizes(tier);
    // Correlation time of hand and pose errors.
    const TAU_SECS: f64 = 0.3;
    let scale = 1.0 + s.depth_scale * normal(rng);
    let bias = s.ray_bias * normal(rng);
    let (mut drift, mut turn, mut hand_error) = (Vector::zeros(), Vector::zeros(), Vector::zeros());
    let mut seen = Seen {
        poses: Vec::new(),
        hands: Vec::new(),
        depth_scale: Vec::new(),
        pixel_seed: (tier != Tier::Clean).then(|| rng.random()),
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

/// Depth scale and pixel noise of a rendered frame.
pub fn degrade(picture: &mut Picture, seen: &Seen, frame: usize) {
    let scale = seen.depth_scale[frame] as f32;
    for z in &mut picture.depth {
        *z *= scale;
    }
    let Some(seed) = seen.pixel_seed else { return };
    let mut rng = Pcg64Mcg::seed_from_u64(seed ^ (frame as u64) << 32);
    for (z, rgb) in picture.depth.iter_mut().zip(&mut picture.rgb) {
        // 0.4 % of the distance, and a camera's grain.
        let [a, b] = [normal(&mut rng) as f32, normal(&mut rng) as f32];
        *z *= 1.0 + 0.004 * a;
        for c in rgb {
            *c = (f32::from(*c) + 3.0 * b).clamp(0.0, 255.0) as u8;
        }
    }
}
