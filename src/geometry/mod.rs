//! Static geometry: 3D lines for hinges, directions for slides, and the touched front face (§3.2, algorithm 1, §A.4, §A.5).

pub mod alignment;
pub mod candidates;
pub mod depth_scale;
pub mod detector;
pub mod directed;
pub mod face;
pub mod fronts;
mod line_track;
pub mod manhattan;
mod segment2;
pub mod segments;
pub mod tracks;
mod triangulation;

pub use candidates::{AxisCandidate, AxisSource, HingeSide};
pub use face::{Face, Rect};
pub use manhattan::ManhattanFrame;
pub use tracks::LineTrack;
