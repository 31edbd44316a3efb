//! Texels, what frames say of them, and when a frame says anything.

use super::frame_sights::FrameSight;
use super::local::{Local, RigidMotion};

/// Frames that a texel keeps.
pub(super) const BEST: usize = 4;
/// A surface seen at less than this slant (cosine) is smeared.
pub(super) const LEAST_COSINE: f32 = 0.15;
/// How far a surface may be from what a frame's depth shows, to be what is seen there: metres, and a share of the depth. Parts
/// are boxes, and further from what was seen than the room's own mesh.
const ROOM_OFF: [f32; 2] = [0.02, 0.02];
const PART_OFF: [f32; 2] = [0.045, 0.02];
/// What stands before a surface of the room by no more than this may be painted onto it: handles stand off so far, metres.
pub(super) const BEFORE_M: f32 = 0.07;

/// What a frame says of a texel.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct TexelSample {
    /// How good the frame is for the texel, on a scale of its own; 0 = no sample.
    pub(super) score: u16,
    /// Position of the frame among the sights.
    pub(super) sight: u16,
    pub(super) rgb: [u8; 3],
    /// Of what may hide the texel: what stands a little before it, or around a closed front. Counts where no frame shows the texel
    /// itself.
    pub(super) makeshift: bool,
}

impl TexelSample {
    /// Samples of the texel itself come after all others, by their scores.
    pub(super) fn rank(&self) -> (bool, u16) {
        (self.score > 0 && !self.makeshift, self.score)
    }
}

/// A texel that a triangle covers.
#[derive(Debug, Clone, Copy)]
pub(super) struct Texel {
    /// On the chart.
    pub(super) at: [u16; 2],
    /// Out of the chart's plane, metres from the local origin.
    pub(super) height: f32,
    /// Unit normal by 127ths.
    pub(super) normal: [i8; 3],
    pub(super) samples: [TexelSample; BEST],
}

/// Texels of a square of a chart.
#[derive(Debug, Clone)]
pub(super) struct TexelTile {
    pub(super) chart: usize,
    pub(super) middle: Local,
    pub(super) radius: f32,
    /// Mean normal, and the angle within which all of them are, radians.
    pub(super) normal: Local,
    pub(super) spread: f32,
    /// The least score that any of its texels has kept.
    pub(super) least: u16,
    pub(super) texels: Vec<Texel>,
}

/// Camera from local of what a part owns, or the room; `None` where it is not known.
pub(super) fn pose_of(
    owner: Option<usize>,
    sight: &FrameSight,
    motions: &[Option<RigidMotion>],
) -> Option<RigidMotion> {
    owner.map_or(Some(sight.pose), |part| motions.get(part).copied().flatten())
}

/// How far a surface at a depth may be from what is seen there, metres.
pub(super) fn tolerance(owner: Option<usize>, z: f32) -> f32 {
    let [least, share] = if owner.is_some() { PART_OFF } else { ROOM_OFF };
    least + share * z
}

/// Name of a page.
pub(super) fn name(page: usize) -> String {
    format!("look_{page}")
}
