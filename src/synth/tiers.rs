//! Sizes of the benchmark's errors and motions, tier by tier.
//!
//! None of them is measured on a real recording: all are assumed, each for the reason that its field names, so that the
//! tiers run from nearly exact to harder than current estimators on head-worn video.

use super::variants::{Changes, Tier};

/// All in which the benchmark's tiers differ.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TierSizes {
    /// Standard deviation of a fingertip's slowly varying error across the viewing ray, metres a direction. Assumed: a
    /// hand's place in the image is good to a few pixels.
    pub hand_lateral_m: f64,
    /// The same along the ray. Assumed: twice as large, as distance comes from the hand's apparent size.
    pub hand_ray_m: f64,
    /// Error of each frame for itself, metres a direction. Assumed: the jitter that remains in an estimator's output.
    pub hand_white_m: f64,
    /// Relative error of the hand's distance, one draw a clip. Assumed: hands differ in size by about 5 %.
    pub ray_bias: f64,
    /// Share of hand samples that are 10 to 30 cm off. Assumed: the other hand, or a hand-like thing.
    pub outliers: f64,
    /// Share of frames without a detected hand, in bursts. Assumed: doors and bodies hide hands.
    pub dropout: f64,
    /// How far the grip has moved over the front when the part is fully open, metres a direction. Assumed: a hand
    /// re-grips and rolls within its own width.
    pub grip_drift_m: f64,
    /// Standard deviation of the grip's sliding along the handle, metres. Assumed: as the drift.
    pub grip_slide_m: f64,
    /// Share of frames whose contact flag is wrong either way. Assumed: of contact detectors on single frames.
    pub contact_flips: f64,
    /// Standard deviation by which contact begins and ends early or late, seconds. Assumed: 2, 4, 5 and 7 frames of 30 a
    /// second.
    pub boundary_secs: f64,
    /// How far doors are opened, radians. Assumed: as far as a hand needs to get in.
    pub door_rad: [f64; 2],
    /// How far what slides is opened, metres. Assumed: the same.
    pub drawer_m: [f64; 2],
    /// Share of motions that are shorter still. Assumed: people look in, or take from the front.
    pub short_share: f64,
    /// How far doors are opened then, radians.
    pub short_door_rad: [f64; 2],
    /// How far what slides is opened then, metres.
    pub short_drawer_m: [f64; 2],
    /// Relative error of the depth, one draw a clip. Assumed: of monocular metric depth.
    pub depth_scale: f64,
    /// Relative error of the depth, one draw a frame. Assumed: flicker of such depth.
    pub depth_frame: f64,
    /// Relative error of the depth at the image's edges, growing linearly from its middle, one draw a clip and direction.
    /// Assumed: such depth bends planes.
    pub depth_tilt: f64,
    /// Relative error of the depth, one draw a pixel. Assumed: small, as networks smooth.
    pub depth_pixel: f64,
    /// Angle of a pixel's normal's error, radians about each of two directions. Assumed: of monocular normals.
    pub normal_pixel_rad: f64,
    /// Angle by which all normals of a frame are off, radians about each axis. Assumed: the same.
    pub normal_frame_rad: f64,
    /// Error of the camera's place, metres a direction. Assumed: drift of structure from motion.
    pub pose_m: f64,
    /// Error of the camera's direction, radians about each axis. Assumed: the same.
    pub pose_rad: f64,
    /// Relative error of a mask's size, one draw a clip. Assumed: edges a few pixels off.
    pub mask_scale: f64,
    /// Share of clips in whose frames the mask covers a neighbour, too. Assumed: open-vocabulary segmenters run over.
    pub mask_wrong: f64,
    /// What remains of the image's contrast. Assumed: dim kitchens, fronts of one colour.
    pub contrast: f64,
    /// Standard deviation of the image's blur, pixels of an image 320 wide. Assumed: moving heads.
    pub blur_px: f64,
    /// Standard deviation of the image's grain, grey levels. Assumed: indoor video.
    pub grain: f64,
    /// Share of clips whose noun is of the other joint type. Assumed: half of a language model's errors of type.
    pub word_wrong: f64,
    /// Share of clips whose noun is "it". Assumed: the other half.
    pub word_vague: f64,
    /// Standard deviation of the world's up direction about each level axis, radians. Assumed: gravity is known to about
    /// a degree.
    pub gravity_rad: f64,
    /// By how much all furniture is turned against the room, radians; `None` stands along the walls. Assumed: far from the
    /// room's directions either way.
    pub turned_rad: Option<[f64; 2]>,
}

/// Degrees in radians, where constants are made.
const fn deg(degrees: f64) -> f64 {
    degrees * (std::f64::consts::PI / 180.0)
}

const T0: TierSizes = TierSizes {
    hand_lateral_m: 0.001,
    hand_ray_m: 0.001,
    hand_white_m: 0.001,
    ray_bias: 0.0,
    outliers: 0.0,
    dropout: 0.0,
    grip_drift_m: 0.0,
    grip_slide_m: 0.0,
    contact_flips: 0.0,
    boundary_secs: 0.0,
    door_rad: [deg(50.0), deg(105.0)],
    drawer_m: [0.2, 0.45],
    short_share: 0.0,
    short_door_rad: [deg(12.0), deg(30.0)],
    short_drawer_m: [0.05, 0.11],
    depth_scale: 0.0,
    depth_frame: 0.0,
    depth_tilt: 0.0,
    depth_pixel: 0.0,
    normal_pixel_rad: 0.0,
    normal_frame_rad: 0.0,
    pose_m: 0.0,
    pose_rad: 0.0,
    mask_scale: 0.0,
    mask_wrong: 0.0,
    contrast: 1.0,
    blur_px: 0.0,
    grain: 1.0,
    word_wrong: 0.0,
    word_vague: 0.0,
    gravity_rad: 0.0,
    turned_rad: None,
};

const T1: TierSizes = TierSizes {
    hand_lateral_m: 0.008,
    hand_ray_m: 0.015,
    hand_white_m: 0.003,
    ray_bias: 0.03,
    outliers: 0.02,
    dropout: 0.25,
    grip_drift_m: 0.01,
    grip_slide_m: 0.01,
    contact_flips: 0.03,
    boundary_secs: 2.0 / 30.0,
    depth_scale: 0.03,
    depth_frame: 0.01,
    depth_tilt: 0.015,
    depth_pixel: 0.004,
    normal_pixel_rad: deg(5.0),
    normal_frame_rad: deg(1.5),
    mask_scale: 0.06,
    mask_wrong: 0.05,
    grain: 3.0,
    word_wrong: 0.025,
    word_vague: 0.025,
    gravity_rad: deg(0.7),
    ..T0
};

const T2: TierSizes = TierSizes {
    hand_lateral_m: 0.015,
    hand_ray_m: 0.03,
    hand_white_m: 0.005,
    ray_bias: 0.045,
    outliers: 0.04,
    dropout: 0.4,
    grip_drift_m: 0.02,
    grip_slide_m: 0.02,
    contact_flips: 0.08,
    boundary_secs: 4.0 / 30.0,
    door_rad: [deg(35.0), deg(105.0)],
    drawer_m: [0.12, 0.42],
    short_share: 0.15,
    depth_scale: 0.05,
    depth_frame: 0.02,
    depth_pixel: 0.006,
    normal_pixel_rad: deg(10.0),
    normal_frame_rad: deg(3.0),
    mask_scale: 0.12,
    mask_wrong: 0.12,
    contrast: 0.85,
    blur_px: 0.5,
    grain: 4.0,
    word_wrong: 0.06,
    word_vague: 0.06,
    ..T1
};

const HD: TierSizes = TierSizes {
    hand_lateral_m: 0.02,
    hand_ray_m: 0.04,
    hand_white_m: 0.006,
    ray_bias: 0.055,
    outliers: 0.06,
    dropout: 0.6,
    grip_drift_m: 0.025,
    grip_slide_m: 0.025,
    contact_flips: 0.12,
    boundary_secs: 5.0 / 30.0,
    door_rad: [deg(25.0), deg(100.0)],
    drawer_m: [0.1, 0.4],
    short_share: 0.25,
    depth_scale: 0.06,
    depth_frame: 0.025,
    depth_pixel: 0.008,
    normal_pixel_rad: deg(12.0),
    normal_frame_rad: deg(4.0),
    pose_m: 0.01,
    pose_rad: deg(0.3),
    mask_scale: 0.18,
    mask_wrong: 0.25,
    contrast: 0.75,
    blur_px: 0.7,
    grain: 5.0,
    word_wrong: 0.025,
    word_vague: 0.025,
    ..T2
};

const T3: TierSizes = TierSizes {
    hand_lateral_m: 0.025,
    hand_ray_m: 0.05,
    hand_white_m: 0.008,
    ray_bias: 0.07,
    outliers: 0.08,
    dropout: 0.65,
    grip_drift_m: 0.03,
    grip_slide_m: 0.03,
    contact_flips: 0.15,
    boundary_secs: 7.0 / 30.0,
    door_rad: [deg(20.0), deg(90.0)],
    drawer_m: [0.08, 0.35],
    short_share: 0.3,
    depth_scale: 0.08,
    depth_frame: 0.03,
    depth_pixel: 0.01,
    normal_pixel_rad: deg(15.0),
    normal_frame_rad: deg(5.0),
    mask_scale: 0.2,
    mask_wrong: 0.25,
    contrast: 0.65,
    blur_px: 0.9,
    grain: 6.0,
    word_wrong: 0.125,
    word_vague: 0.125,
    ..T2
};

const SHORT: TierSizes = TierSizes { door_rad: [deg(10.0), deg(22.0)], drawer_m: [0.05, 0.09], short_share: 0.0, ..T2 };

const NONM: TierSizes = TierSizes { turned_rad: Some([deg(12.0), deg(33.0)]), ..T2 };

/// The sizes of a tier of the benchmark with what a study changes; `None` for the tiers of the other kitchens.
#[must_use]
pub fn sizes(tier: Tier, changes: &Changes) -> Option<TierSizes> {
    let mut s = match tier {
        Tier::Clean | Tier::Realistic | Tier::Hard => return None,
        Tier::T0 => T0,
        Tier::T1 => T1,
        Tier::T2 => T2,
        Tier::Hd => HD,
        Tier::T3 => T3,
        Tier::Short => SHORT,
        Tier::Nonm => NONM,
    };
    let factor = changes.hand_factor(s.hand_lateral_m, s.hand_ray_m, s.hand_white_m);
    s.hand_lateral_m *= factor;
    s.hand_ray_m *= factor;
    s.hand_white_m *= factor;
    s.ray_bias = changes.depth_bias.unwrap_or(s.ray_bias);
    s.word_wrong = changes.word_error.unwrap_or(s.word_wrong);
    s.mask_wrong = changes.mask_error.unwrap_or(s.mask_wrong);
    Some(s)
}
