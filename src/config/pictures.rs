//! What a recording's pictures have to be for any of it to be used.

use serde::{Deserialize, Serialize};

use super::Row;

block! {
    /// A recording's pictures: how many may be damaged, and whether depth is in metres (ours). Judgements.
    Pictures, "pictures", {
        /// Pictures of one kind (images, depth, normals, masks, segments) that may be damaged: they are left out. More are an export
        /// gone wrong.
        damaged_share: f64 = 0.1, "share", "ours";
        /// So few may be damaged in any recording, however short.
        damaged: usize = 4, "frames", "ours";
        /// Frames with a hand that are asked whether depth and hands have one unit, and frames that are asked whether there is any
        /// depth.
        asked: usize = 8, "frames", "ours";
        /// Where hands are, depth is between these many times their distance: an estimate may be off by two or three, a wrong unit
        /// is off by ten or a thousand.
        depth_per_distance: [f64; 2] = [0.2, 8.0], "-", "ours";
    }
}
