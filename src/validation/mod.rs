//! Joints proved by physics: the recorded hand opens and closes them in rapier, and so it does their rivals (ours).

pub mod replay;
pub mod rivals;
pub mod verdict;
pub mod world;

pub use replay::{Drive, Replay, simulate};
pub use rivals::Resolution;
pub use verdict::{ClipCheck, JointCheck, RivalCheck, Validation, Verdict, log_odds, validate, validate_ruled};
pub use world::{Contact, Surroundings};
