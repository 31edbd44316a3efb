//! Joints proved by physics: the recorded hand opens and closes them in rapier, and so it does their rivals (ours).

pub mod replay;
pub mod verdict;

pub use replay::{Drive, Replay, simulate};
pub use verdict::{ClipCheck, JointCheck, RivalCheck, Validation, Verdict, validate};
