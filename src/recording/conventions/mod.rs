//! Whether a recording means what it says: camera poses, up, hands and clocks against each other.
//!
//! One idea carries the poses: depth of one frame, moved into another one by the poses, has to meet that frame's depth. The
//! right reading of the numbers (direction, axes, order of a quaternion, unit, clock, intrinsics) is the one under which it does; how much
//! more often it does than under the declared reading is the evidence. It needs no images, and depth that is off by a factor
//! in each frame does no harm. Up is told by heads, which hardly roll, and by level surfaces, which are seen from above; hands by
//! where they project to and what is seen there: a hand's own pixels, or depth, in which a hand hides what is behind it where
//! and while it is there. Which hand is the left one is told by frames that show both.

mod agreement;
mod gravity;
mod hands;
mod hiding;
mod lens;
mod looks;
mod poses;
mod reading;
mod repair;
mod sides;

use nalgebra::Matrix3;

use super::{Camera, Grid, Recording, Side};
use crate::math::{Point, Pose, Vector};
pub use reading::{Reading, readings_of};
pub use repair::repaired;

/// From here on a finding is told, nats: odds of 20 to 1.
pub const LIKELY_NATS: f64 = 3.0;
/// From here on it is taken for certain, nats: odds of 400 to 1.
pub const CERTAIN_NATS: f64 = 6.0;

/// Something that does not fit.
#[derive(Debug, Clone, PartialEq)]
pub struct Finding {
    /// What is wrong.
    pub what: String,
    /// The numbers that say so, in words.
    pub evidence: String,
    /// What sets it right.
    pub remedy: String,
    /// Log odds for it against what the recording declares.
    pub nats: f64,
    /// Whether joints are worth nothing until it is set right.
    pub ruinous: bool,
    /// The change that sets it right, where one is known.
    pub fix: Option<Fix>,
}

impl Finding {
    /// Whether it is beyond doubt.
    #[must_use]
    pub fn is_certain(&self) -> bool {
        self.nats >= CERTAIN_NATS
    }

    /// Whether it can be set right without asking: it is beyond doubt, and so is what sets it right.
    #[must_use]
    pub fn can_be_fixed(&self) -> bool {
        self.is_certain() && !matches!(self.fix, None | Some(Fix::Scale { is_unit: false, .. }))
    }

    /// One sentence for people, without the remedy.
    #[must_use]
    pub fn sentence(&self) -> String {
        let sure = if self.is_certain() { "" } else { "probably " };
        format!("{sure}{}: {}", self.what, self.evidence)
    }
}

/// A change that sets a recording right.
#[derive(Debug, Clone, PartialEq)]
pub enum Fix {
    /// Poses are read another way.
    Poses {
        /// How their numbers are read.
        reading: Reading,
        /// The right camera's axes (rows: right, down, forward) in the axes of the poses' camera.
        axes: Matrix3<f64>,
    },
    /// Camera positions are multiplied.
    Scale {
        /// By this.
        factor: f64,
        /// Whether it is exact, a unit's; else depth tells it to a tenth, which is no correction.
        is_unit: bool,
    },
    /// This direction of the world is up (unit length).
    Up(Vector),
    /// The pose of frame `i + n` belongs to frame `i`.
    PoseLag(i64),
    /// The hands of frame `i + n` belong to frame `i`.
    HandLag(i64),
    /// Hands are multiplied.
    HandUnit(f64),
}

/// What is judged: a recording, or an import that is not written yet.
pub struct Subject<'a> {
    /// Camera of images, depth and masks.
    pub camera: Camera,
    /// Camera to world, frame by frame, as declared.
    pub poses: Vec<Pose>,
    /// Seconds of each frame.
    pub secs: Vec<f64>,
    /// The same poses under other readings of their numbers.
    pub readings: Vec<(Reading, Vec<Pose>)>,
    /// Frame and place of each hand, world, and which it is said to be; by frame.
    pub hands: Vec<(usize, Point, Side)>,
    /// Frames with depth, rising.
    pub with_depth: Vec<usize>,
    /// Frames with a mask, rising.
    pub with_mask: Vec<usize>,
    /// Depth of a frame, metres; `None` where it cannot be read, which is told elsewhere.
    pub depth: Box<dyn Fn(usize) -> Option<Grid<f32>> + Sync + 'a>,
    /// Mask of a frame.
    pub mask: Box<dyn Fn(usize) -> Option<Grid<u8>> + Sync + 'a>,
}

impl<'a> Subject<'a> {
    /// Of a recording.
    #[must_use]
    pub fn of(recording: &'a Recording) -> Self {
        let poses: Vec<Pose> = recording.frames.iter().map(|f| f.world_from_camera).collect();
        let having = |has: &dyn Fn(&super::Frame) -> bool| -> Vec<usize> {
            recording.frames.iter().enumerate().filter(|(_, f)| has(f)).map(|(i, _)| i).collect()
        };
        Self {
            camera: recording.camera,
            readings: readings_of(&poses),
            poses,
            secs: recording.frames.iter().map(|f| f.timestamp_secs).collect(),
            hands: recording.hands.iter().map(|h| (h.frame, h.grasp(), h.side)).collect(),
            // A reconstruction is in the world already: seen from the poses it agrees with itself.
            with_depth: having(&|f| f.files.depth.is_some()),
            with_mask: having(&|f| f.files.mask.is_some()),
            depth: Box::new(move |frame| recording.depth_as_read(frame).ok().flatten()),
            mask: Box::new(move |frame| recording.mask(frame).ok().flatten()),
        }
    }
}

/// All findings, the gravest first. The same subject gives the same findings.
#[must_use]
pub fn findings(subject: &Subject) -> Vec<Finding> {
    let looks = looks::looks(subject);
    let judged = poses::judge(subject, &looks);
    let mut out = judged.findings;
    // What the wrong poses or a wrong lens do to up and hands is no finding of its own.
    if !judged.is_lens {
        out.extend(gravity::judge(&judged.poses, &looks));
    }
    if !judged.is_turned {
        out.extend(hands::judge(subject, &looks));
    }
    out.sort_by(|a, b| b.ruinous.cmp(&a.ruinous).then(b.nats.total_cmp(&a.nats)));
    out
}
