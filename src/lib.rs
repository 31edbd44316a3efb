//! `paws-twin`: from an egocentric recording of opened doors and drawers to a kitchen that simulates.
//!
//! An implementation of PAWS, "Perception of Articulation in the Wild at Scale from Egocentric Videos", and of what it
//! takes to put the result into a simulator. Sections (§) are the paper's.
//!
//! In one call, from a recording to a twin with a verdict on each of its joints:
//!
//! ```
//! use paws_twin::synth::{Recorded, SynthOptions, Tier};
//! use paws_twin::{Config, JointKind, Made, Verdict, export};
//!
//! # fn main() -> paws_twin::Result<()> {
//! // A small kitchen that is played; Recording::open reads a folder, Recording::from_memory takes what a program holds.
//! let recording = Recorded::new(&SynthOptions { seed: 3, tier: Tier::Clean, width: 160, parts: 1 })?.recording()?;
//! let made = Made::of(&recording, &Config::default())?;
//! assert_eq!(made.scene.joints[0].joint.kind, JointKind::Revolute);
//! assert_eq!(made.validation.joints[0].verdict, Verdict::Pass);
//! let mjcf = export::mjcf::write(&made.twin, None)?;
//! assert!(mjcf.contains("<joint name=\"joint_0\" class=\"hinge\""));
//! # Ok(())
//! # }
//! ```
//!
//! A step alone, here the joint of a path that something moved along ([`make`] has the others in their order):
//!
//! ```
//! use paws_twin::inference::bare;
//! use paws_twin::math::Point;
//! use paws_twin::recording::trajectory::BareTrajectory;
//! use paws_twin::{Config, JointKind};
//!
//! // A handle goes a quarter turn about the vertical, half a metre from its hinge.
//! let angles = (0..=45).map(|i| f64::from(2 * i).to_radians());
//! let positions = angles.map(|a| Point::new(0.5 * a.cos(), 0.5 * a.sin(), 1.0)).collect();
//! let path = BareTrajectory { positions, ..BareTrajectory::default() };
//! let outcome = bare::infer(&path, &Config::default().inference);
//! let found = outcome.found().expect("a joint");
//! assert_eq!(found.joint.kind, JointKind::Revolute);
//! assert!(found.joint.axis.z.abs() > 0.99);
//! ```
//!
//! # The way
//!
//! ```text
//! recording ─ hands ─ localization ─ geometry ─ reasoning ─ inference ─ fitting ─ export
//!             §3.1     §3.1, A.3     §3.2, A.4   §3.3, A.6   §3.4, A.7     │        └ URDF, MJCF, glTF, USD
//!             A.2                    A.5                     C.2           ├ validation (rapier against the hand)
//!                                                              └─ feedback ─┘
//! ```
//!
//! [`Made::of`] goes all of it. [`pipeline::infer`] runs the paper and keeps every intermediate result; [`feedback::weighed`]
//! asks physics about joints in doubt; [`fitting::fit`] builds the twin, [`appearance::look`] its surfaces; [`validation::validate`] replays the recorded
//! hands; [`primitives::of`] makes of each joint what a robot needs to open it; [`export`] writes it.
//!
//! | paper | here |
//! |---|---|
//! | `z_t`, fingertip mean | [`recording::HandSample::grasp`] |
//! | `x_t`, `F`, `Q` | [`math::kalman`], [`math::ou::IntegratedOu::discretise`] |
//! | `p_t`, smoothed | [`hands::Sample::smoothed`] |
//! | `V_conf`, `n_v` | [`localization::Region`], [`localization::voxels::count_views`] |
//! | `I_s`, global views | [`localization::views::reselect`] |
//! | `P_n`, camera to world | [`recording::Frame::world_from_camera`] |
//! | `L_2D`, `L_3D` | [`geometry::segments`], [`geometry::LineTrack`] |
//! | `m_1, m_2, m_3` | [`geometry::ManhattanFrame`] |
//! | `c_i`, `L*` | [`reasoning::Answer`], [`reasoning::words::Words`] |
//! | `phi = {c, a, o}` | [`articulation::Articulation`] |
//!
//! Every pose is `target_from_source`; everything is metric, right-handed, in radians and seconds, `f64`.
//! A clip without an answer is data ([`articulation::Outcome::Abstained`]), not an error.
//!
//! # Features
//!
//! `cli` (default) is the command `paws` and its page, with `prompts`, the questions about pictures that a [`vlm::Model`] answers,
//! and `vlm-http`, a client of servers that do (`vlm-https`: with TLS). With `default-features = false` the library comes without.

pub mod articulation;
pub mod config;
pub mod error;
#[doc(hidden)]
pub mod json;
pub mod math;
pub mod recording;

#[doc(hidden)]
pub mod raster;

pub mod import;

pub mod look;
pub mod twin;
pub mod vlm;

pub mod model;

pub mod synth;

pub mod geometry;
pub mod hands;
pub mod inference;
pub mod localization;
pub mod reasoning;

pub mod part;
pub mod pipeline;

pub mod fitting;

pub mod appearance;
pub mod evaluation;
pub mod export;
pub mod validation;

pub mod feedback;
pub mod primitives;

pub mod make;

#[doc(hidden)]
pub mod report;

#[doc(hidden)]
pub mod batch;

#[cfg(feature = "cli")]
#[doc(hidden)]
pub mod cli;

pub use articulation::{Articulation, JointKind, Outcome};
pub use config::Config;
pub use error::{Error, Result};
pub use look::Look;
pub use make::{JointHands, Made};
pub use pipeline::Scene;
pub use recording::{Camera, Clip, Frames, Grid, HandSample, MemoryFrame, MemoryRecording, Recording, Side};
pub use twin::Twin;
pub use validation::{Validation, Verdict};
