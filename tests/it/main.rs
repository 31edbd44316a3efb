//! All integration tests in one binary.

#![allow(clippy::unwrap_used, clippy::panic, clippy::print_stderr, reason = "a test that fails should say so at once")]

mod accuracy;
mod bad_input;
mod bare_trajectories;
mod common;
mod floors;
mod foreign;
mod formats;
mod import;
mod known_truth;
mod physics;
mod real_recordings;
mod same_bytes;
mod simulators;
mod words;
