//! `paws-twin`: from an egocentric recording of opened doors and drawers to a kitchen that simulates.
//!
//! An implementation of PAWS, "Perception of Articulation in the Wild at Scale from Egocentric Videos", and of what it
//! takes to put the result into a simulator. Sections (§) are the paper's.
//!
//! ```text
//! recording ─ hands ─ localization ─ geometry ─ reasoning ─ inference ─ fitting ─ export
//!             §3.1     §3.1, A.3     §3.2, A.4   §3.3, A.6   §3.4, A.7     │        └ URDF, MJCF, glTF, USD
//!             A.2                    A.5                     C.2           ├ validation (rapier against the hand)
//!                                                              └─ feedback ─┘
//! ```
//!
//! [`pipeline::infer`] runs the paper and keeps every intermediate result; [`feedback::weighed`] asks physics about joints
//! in doubt; [`fitting::fit`] builds the twin, [`appearance::look`] its surfaces; [`validation::validate`] replays the recorded
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

pub mod articulation;
pub mod config;
pub mod error;
pub mod json;
pub mod math;
pub mod recording;

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

pub mod pipeline;

pub mod fitting;

pub mod appearance;
pub mod evaluation;
pub mod export;
pub mod validation;

pub mod feedback;
pub mod primitives;

pub mod report;

pub mod batch;

pub mod cli;
