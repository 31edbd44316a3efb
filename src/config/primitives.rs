//! What a robot needs to open and close joints.

use serde::{Deserialize, Serialize};

use super::Row;

block! {
    /// A common parallel gripper and how it goes about a joint (ours). Lengths in the gripper's axes: z approaches, x is the way that
    /// fingers close, the origin is between the fingertips. Judgements where nothing else is said.
    Primitives, "primitives", {
        /// How far before the grasp a gripper waits with open fingers, and how far it goes back after it let go: open fingers and what
        /// they can miss by are then clear of a handle. Judgement.
        standoff_m: f64 = 0.10, "m", "ours";
        /// As wide as common parallel grippers open. Source: Franka Hand.
        widest_m: f64 = 0.08, "m", "ours";
        /// Free space on each side of a handle: a recorded hand tells its place to three centimetres or so. Judgement.
        beside_handle_m: f64 = 0.035, "m", "ours";
        /// Centre and half sizes of the palm. Judgement.
        palm_m: [[f64; 3]; 2] = [[0.0, 0.0, -0.065], [0.05, 0.02, 0.02]], "m", "ours";
        /// Half sizes of a finger. Judgement.
        finger_m: [f64; 3] = [0.005, 0.010, 0.030], "m", "ours";
        /// How far a finger's middle is behind the fingertips' middle.
        finger_back_m: f64 = 0.015, "m", "ours";
        /// Everything of the gripper is within this of the fingertips' middle.
        reach_m: f64 = 0.13, "m", "ours";
        /// Kept free around what is not the part: half of how far the samples of a palm are apart, and of what furniture's place is
        /// known to.
        around_m: f64 = 0.015, "m", "ours";
        /// Kept free between the gripper and the part that it holds, whose place it knows.
        around_part_m: f64 = 0.002, "m", "ours";
        /// Without a handle's size: fingers that hold something thin.
        thin_m: f64 = 0.02, "m", "ours";
        /// Turns about the bar that are tried, beside none and to both sides: of the closed part with open fingers, of which one is
        /// between bar and front.
        turns_closed_deg: [f64; 2] = [15.0, 30.0], "deg", "ours";
        /// Turns about the bar of the open part that are tried. Farther, a palm would be in the front.
        turns_open_deg: [f64; 3] = [30.0, 60.0, 75.0], "deg", "ours";
        /// Fastest that a grip goes where no hand was recorded: half of what people do. Judgement.
        calm_m_per_s: f64 = 0.4, "m/s", "ours";
        /// A motion is no shorter and no longer than this: a hand that was seen for a moment tells no speed. Judgement.
        secs: [f64; 2] = [0.5, 20.0], "s", "ours";
        /// A motion that nobody showed is no shorter than this. Judgement.
        calm_secs: f64 = 1.0, "s", "ours";
        /// A clip tells its timing where it goes through this share of the part's range, at least. Judgement.
        told_share: f64 = 0.15, "share", "ours";
        /// Skews that are tried; 1 is a minimum jerk, below it begins fast, above it begins slowly. Judgement.
        skews: [f64; 2] = [0.7, 1.5], "-", "ours";
    }
}
