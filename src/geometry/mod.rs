//! Static geometry: 3D lines for hinges, directions for slides, and the touched front face (§3.2, algorithm 1, §A.4, §A.5).

pub mod ajar;
pub mod candidates;
pub mod depth_scale;
pub mod detector;
pub mod face;
pub mod front;
mod leaf;
pub mod manhattan;
pub mod moved;
pub mod openings;
pub mod outline;
mod rays;
pub mod segments;
pub mod sights;
pub mod tracks;
mod triangulation;

pub use candidates::{AxisCandidate, AxisSource, HingeSide};
pub use face::{Face, Rect};
pub use manhattan::ManhattanFrame;
pub use tracks::LineTrack;
