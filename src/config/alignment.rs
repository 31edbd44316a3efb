//! Several videos of one place.

use serde::{Deserialize, Serialize};

use super::Row;

block! {
    /// Several videos of one place (ours).
    Alignment, "alignment", {
        /// Frames of a video, without an interaction, whose depth is compared with that of the others.
        frames: usize = 40, "frames", "ours";
        /// Views of the joined scene that are kept to compare the next video with.
        most_views: usize = 120, "views", "ours";
        /// Pieces of surface that are compared: one in a cube of this edge.
        voxel_m: f64 = 0.06, "m", "ours";
        /// Of what two videos look at, this share has to be seen by both: things are moved between videos, and parts stand open.
        least_agreement: f64 = 0.8, "share", "ours";
        /// Of what either video sees, the other one has to look at this share.
        least_overlap: f64 = 0.1, "share", "ours";
        /// Brightness of what two videos both see has to go together by this correlation, where there are images: the same
        /// synthetic kitchen has 0.98, others of its catalogue up to 0.93. Another light lowers it.
        least_likeness: f64 = 0.9, "-", "ours";
        /// By so much an alignment has to be better than every other one: the share that is seen, less three times the share
        /// that is seen through, less what brightness takes. The right one leads by 0.25 or more.
        least_lead: f64 = 0.1, "share", "ours";
        /// Worlds that are less apart are one: what depth tells an alignment to.
        same_world_m: f64 = 0.04, "m", "ours";
        /// Worlds that are turned by less are one.
        same_world_deg: f64 = 1.0, "deg", "ours";
        /// Alignments that are farther apart are two answers.
        rival_m: f64 = 0.25, "m", "ours";
        /// Alignments that are turned by more are two answers.
        rival_deg: f64 = 10.0, "deg", "ours";
        /// Pause between two videos on the joined clock: longer than any time within which frames are taken for neighbours.
        gap_secs: f64 = 60.0, "s", "ours";
    } parts {
        /// Alignments worth a closer look.
        search: AlignmentSearch;
        /// Their refinement.
        icp: Icp;
        /// How two maps meet under an alignment.
        judging: AlignmentJudging;
    }
}

block! {
    /// Turns by headings, lifts by heights, shifts by a vote of pairs of surface points (ours). Judgements.
    AlignmentSearch, "alignment.search", {
        /// Headings are smoothed over so many degrees to each side: the noise of normals.
        smoothed_deg: i64 = 4, "deg", "ours";
        /// Turns that are looked at, at the most.
        turns: usize = 8, "-", "ours";
        /// Turns that are looked at are so far apart.
        turns_apart_deg: usize = 10, "deg", "ours";
        /// Lifts that are looked at, at the most.
        lifts: usize = 4, "-", "ours";
        /// Lifts that are looked at are so many bins apart.
        lifts_apart: usize = 3, "-", "ours";
        /// Height of a bin of level surfaces.
        lift_m: f64 = 0.02, "m", "ours";
        /// Fewer pieces of level surface are no floor.
        least_level: usize = 30, "-", "ours";
        /// How much of the best one's correlation each turn and lift needs.
        worth: f64 = 0.25, "share", "ours";
        /// Edge of a cell of the vote.
        cell_m: f64 = 0.08, "m", "ours";
        /// Height of the layers in which surfaces are looked for.
        layer_m: f64 = 0.1, "m", "ours";
        /// Surface points that vote.
        voters: usize = 1500, "-", "ours";
        /// Shifts that are looked at of each turn and lift.
        shifts: usize = 4, "-", "ours";
        /// So many cells apart two shifts are two.
        shifts_apart: i64 = 4, "-", "ours";
        /// Alignments that are refined.
        refined: usize = 40, "-", "ours";
    }
}

block! {
    /// Point-to-plane ICP with a turn about the vertical and a shift (ours). Judgements.
    Icp, "alignment.icp", {
        /// Surfaces this near to each other are compared: wide at first, to arrive, then about what estimated depth is off by.
        gates_m: [f64; 3] = [0.3, 0.15, 0.07], "m", "ours";
        /// A pair's weight falls beyond this share of the gate.
        gate_scale: f64 = 0.3, "share", "ours";
        /// Cosine of the angle up to which two pieces of surface face the same way.
        same_way_cos: f64 = 0.8, "-", "ours";
        /// Pieces of surface that are compared.
        compared: usize = 1500, "-", "ours";
        /// Fewer pairs tell no alignment.
        least_pairs: usize = 20, "-", "ours";
    }
}

block! {
    /// How the surfaces of two maps meet under an alignment (ours). Judgements.
    AlignmentJudging, "alignment.judging", {
        /// Depth that counts: nearer are hands and hair, farther it is noise.
        range_m: [f64; 2] = [0.3, 4.0], "m", "ours";
        /// Surfaces seen at a smaller slant (cosine) have no usable place.
        least_slant_cos: f64 = 0.25, "-", "ours";
        /// Normals follow from depth over the image's width over this, to each side: as `geometry.scales.normal_reach`.
        normal_reach: usize = 40, "-", "ours";
        /// Samples of a view that become surface.
        samples: usize = 1500, "-", "ours";
        /// Pieces of surface of either side whose meeting is judged.
        judged: usize = 1500, "-", "ours";
        /// Fewer pieces of surface are no place.
        least_surfels: usize = 200, "-", "ours";
        /// Fewer pairs of brightnesses tell nothing.
        least_pairs: f64 = 200.0, "-", "ours";
        /// Fewer pairs of brightnesses in one view tell no mean of it.
        least_in_view: f64 = 5.0, "-", "ours";
        /// Depth of two videos differs by no more than this where they see one surface, at the camera: four standard deviations of
        /// estimated depth, as each video has a noise of its own, and the alignment one more.
        depth_floor_m: f64 = 0.02, "m", "ours";
        /// So much more difference of their depth for every metre of distance.
        depth_per_m: f64 = 0.032, "m/m", "ours";
        /// What is seen through takes back so many times what is seen: surfaces meet by chance, empty places do not hold any.
        against: f64 = 3.0, "-", "ours";
        /// Of what both look at, brightness that does not go together at all takes so much.
        unlike: f64 = 2.0, "-", "ours";
    }
}
