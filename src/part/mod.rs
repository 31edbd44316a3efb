//! What depth says of a part that moves: how well a joint explains it, how far the part stands open, where it ends (ours).

pub mod ajar;
pub mod front;
mod leaf;
pub mod likelihood;
pub mod openings;
pub mod outline;
pub mod pixel;
mod points;
mod rays;
pub mod views;
