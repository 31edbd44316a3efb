//! Doors in: recordings of devices, data sets and networks, as a recording of ours.
//!
//! A [`formats::ImportFormat`] reads one source into a [`Capture`]: timed streams as plain data, in the source's own words.
//! [`assemble`] joins captures, brings them to one world (+Z up, metres) and one pinhole camera, and gives an [`Imported`],
//! whose tables and images are a recording's files. Images and depth are decoded when they are asked for.
//!
//! ```text
//! files ── formats ──> Capture ─┐                ┌ frame_timeline: frames, joins
//! files ── formats ──> Capture ─┴─ assemble ─────┼ world_placement: scale, gravity ──> Imported ──> tables, images, import.json
//!                                                └ hands_and_clips: hands, contact, clips
//! ```
//!
//! Axes change in [`axes`], joint orders in [`joint_orders`], pixels in [`warp`], lenses in [`optics`], and nowhere else.

pub mod articulations;
mod at;
pub mod axes;
mod believable;
pub mod blob;
pub mod capture;
pub mod checks;
pub mod decode;
pub mod formats;
pub mod h5;
pub mod join;
pub mod joint_orders;
pub mod mcap_file;
pub mod names;
pub mod optics;
pub mod output_view;
pub mod pack;
pub mod ply;
pub mod raw_poses;
pub mod report;
pub mod ros;
pub mod tar;
pub mod text;
pub mod tf;
pub mod video;
pub mod warp;

mod assembly;
mod choices;
mod depth_exr;
pub mod finding;
mod frame_timeline;
mod hands_and_clips;
mod imported;
mod world_placement;

pub use assembly::assemble;
pub use capture::Capture;
pub use choices::ImportOptions;
pub use imported::{Hand, Imported, ImportedFrame, Written};
