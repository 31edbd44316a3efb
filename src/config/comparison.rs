//! The twin beside the recorded frames.

use serde::{Deserialize, Serialize};

use super::Row;

block! {
    /// The twin beside the recorded frames: how it looks, and its shape (ours).
    Comparison, "comparison", {
        /// Frames in which all is closed that the twin is compared with, evenly over the recording.
        frames: usize = 40, "frames", "ours";
        /// Frames in which a part stands open that the twin is compared with, for each part.
        open_frames: usize = 4, "frames", "ours";
        /// What is nearer than this to the joints of a hand or to its forearm is not compared.
        hand_m: f64 = 0.06, "m", "ours";
        /// Rays a pixel along each side: a camera's pixel sees an area.
        rays: usize = 2, "rays", "ours";
        /// Frames of which less than this can be compared tell no number of their own.
        least_share: f64 = 0.02, "share", "ours";
        /// A point of the room is right within this distance of the true surface.
        shape_m: f64 = 0.02, "m", "ours";
        /// Edge of the cells that count as one point of a surface.
        shape_cell_m: f64 = 0.01, "m", "ours";
        /// Width of the views that points of surfaces are taken from.
        shape_width: usize = 240, "px", "ours";
        /// Recorded frames on the page, at most.
        page_frames: usize = 12, "frames", "ours";
        /// Width of the recorded frames on the page.
        page_width: usize = 480, "px", "ours";
        /// Size of all recorded frames on the page together.
        page_mb: f64 = 0.9, "MB", "ours";
    }
}
