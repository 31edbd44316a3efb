//! All integration tests in one binary.

#![allow(clippy::unwrap_used, clippy::panic, clippy::print_stderr, reason = "a test that fails should say so at once")]

mod accuracy;
mod appearance;
mod articulations;
mod bad_input;
mod bare_trajectories;
mod batch;
mod common;
mod conventions;
mod floors;
mod foreign;
mod formats;
mod honesty;
mod hostile;
mod import;
mod import_devices;
mod import_glasses;
mod import_headsets;
mod import_ros;
mod import_tools;
mod known_truth;
mod looks;
mod mjcf;
mod models;
mod perceive;
mod physics;
mod primitives;
mod python_module;
mod real_recordings;
mod robust;
mod same_bytes;
mod simulated;
mod simulators;
mod skips;
mod trajectories;
mod words;
