//! Textured surfaces.

use serde::{Deserialize, Serialize};

use super::Row;

block! {
    /// Textured surfaces, for eyes alone (ours).
    Appearance, "appearance", {
        /// Frames that the room is fused from and textured with, spread over viewpoints; frames in which all is closed first. More
        /// of them see next to nothing new in one kitchen.
        frames: usize = 150, "frames", "ours";
        /// Frames for each part that show it standing open: its back, and what is behind it.
        open_frames: usize = 8, "frames", "ours";
        /// Depth beyond this is left out: estimates are worth less there than the fused surface is thick.
        depth_max_m: f64 = 5.0, "m", "ours";
        /// Edge of a voxel. It grows where the scene would not fit into `fuse_mb`.
        voxel_m: f64 = 0.01, "m", "ours";
        /// Depth counts within this distance of the surface that it shows: twice the noise of estimated depth. At least three
        /// voxels.
        truncation_m: f64 = 0.04, "m", "ours";
        /// Memory for voxels; 60 m^2 of surface at a centimetre take about half of it.
        fuse_mb: f64 = 500.0, "MB", "ours";
        /// What is nearer than this to fingertips, or to the forearm that they belong to, is a person.
        hand_m: f64 = 0.12, "m", "ours";
        /// What is seen nearer than this to a part's boards is the part and not the room: what fronts and depth are off by.
        slab_m: f64 = 0.05, "m", "ours";
        /// Pieces of surface that hang together with nothing and are smaller are noise: a hand's breadth by two.
        shard_m2: f64 = 0.02, "m^2", "ours";
        /// Pieces of surface that hang together with nothing and are shorter are noise, whatever their area; on furniture, where small
        /// things stand, what is a fifth as long stays.
        shard_m: f64 = 0.1, "m", "ours";
        /// A rim of the surface frays where the views' weights (squared slant over squared distance) sum up to less than this: one
        /// view from two metres that sees it at 50 degrees.
        rim_weight: f64 = 0.1, "1/m^2", "ours";
        /// So much is taken off a frayed rim at the most: truncation and a little more.
        rim_m: f64 = 0.05, "m", "ours";
        /// Holes in flat surface that no view looked through are closed up to this length: what handles hide.
        hole_m: f64 = 0.25, "m", "ours";
        /// Triangles of the room.
        triangles: usize = 80_000, "triangles", "ours";
        /// Edge of a texel: a pixel of a VGA camera at a metre and a half. It grows where `texels` would not suffice.
        texel_m: f64 = 0.004, "m", "ours";
        /// Texels along an edge for each pixel of the frames that show a surface best: at 1 their grids would blur each other, more
        /// shows nothing new. Surfaces seen from afar get larger texels than `texel_m`.
        texels_per_pixel: f64 = 1.25, "-", "ours";
        /// Pieces of surface that look another way than what is around them and are smaller are textured with that: a square of
        /// 5 cm. Each piece of its own costs the vertices of its rim twice.
        chart_m2: f64 = 0.0025, "m^2", "ours";
        /// Texels of all surfaces together: half of a page of 4096 x 4096.
        texels: usize = 8_000_000, "texels", "ours";
    }
}
