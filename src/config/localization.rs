//! Where the touched furniture is.

use serde::{Deserialize, Serialize};

use super::Row;

block! {
    /// Where the touched furniture is (§3.1, §A.3).
    Localization, "localization", {
        /// Edge of a voxel.
        voxel_m: f64 = 0.05, "m", "B.1";
        /// A voxel seen in at least this many local frames is confident.
        min_views: usize = 4, "views", "B.1";
        /// Local frames per clip.
        local_frames: usize = 5, "frames", "B.1";
        /// Local frames from the closed state around the interaction (true), or from the interaction itself as the paper
        /// has it (false): a part that moves leaves the voxels that would count it.
        closed_state_frames: bool = true, "-", "ours";
        /// Global views for the geometry.
        global_views: usize = 50, "views", "B.1";
        /// Share of the confident voxels that a global view must have inside its frustum.
        min_visible_share: f64 = 0.3, "share", "ours";
        /// Global views count a voxel only where nothing stands before it.
        occlusion: bool = true, "-", "ours";
        /// Only what lies within this distance of the hand can be the touched furniture.
        reach_m: f64 = 1.5, "m", "ours";
        /// Frames of the whole room, outside the interactions, that help to find the scale of depth.
        survey_frames: usize = 60, "frames", "ours";
        /// The region is within this of the grip: a grip stands off its face by a handle, and hands are estimated to a few centimetres.
        /// Judgement.
        near_m: f64 = 0.2, "m", "ours";
        /// Fewer connected voxels are no furniture: a third of the 36 that a face of 30 x 30 cm fills at 5 cm. Judgement.
        least_voxels: usize = 12, "-", "ours";
        /// Surface points of a region at the most: about ten on every square centimetre of a door.
        most_points: usize = 60_000, "points", "ours";
        /// Frames of the whole recording, other than the local ones, that add to a region.
        other_frames: usize = 40, "frames", "ours";
        /// Depth that counts where a frame sees a place: nearer are hands and hair, beyond three metres a metre-scale estimate is worth
        /// less than a voxel. Judgement.
        seen_m: [f64; 2] = [0.2, 3.0], "m", "ours";
        /// Around the grip masks are asked within a fist's size, and within the depth of a handle with its face behind it. Judgement.
        grip_m: [f64; 2] = [0.06, 0.12], "m", "ours";
        /// The size around the grip in which masks are asked is no less and no more than this in the image.
        grip_px: [f64; 2] = [3.0, 160.0], "px", "ours";
        /// Frames in which nobody is at work that are asked of every clip, at the most: ten minutes at 7 frames a second.
        idle_frames: usize = 4000, "frames", "ours";
        /// Half of what most fronts measure: of the cube around a grip that stands for furniture before it is seen. Judgement.
        unseen_half_m: f64 = 0.3, "m", "ours";
        /// So many of the region's voxels tell the share that a view sees to a few per cent.
        probes: usize = 60, "-", "ours";
    } parts {
        /// What may stand between a camera and a place.
        occupied: Occupied;
    }
}

block! {
    /// Where surfaces are, on a coarse grid of the whole scene (ours). Judgements.
    Occupied, "localization.occupied", {
        /// Edge of a cell: what hides a front is larger, a handle and the noise of depth are smaller.
        cell_m: f64 = 0.1, "m", "ours";
        /// Views that must agree on a surface; one may show somebody's arm.
        views: usize = 3, "views", "ours";
        /// A sight's own surroundings at both ends do not hide it: the target's, and the person's hands and hair.
        clear_m: f64 = 0.25, "m", "ours";
        /// Cells left out at each end of the scene, as a share of all that were seen.
        rim_share: f64 = 0.002, "share", "ours";
        /// One in so many samples of depth is looked at.
        every: usize = 3, "-", "ours";
    }
}
