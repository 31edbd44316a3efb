//! What a user chooses about an import.

use std::collections::BTreeMap;
use std::path::PathBuf;

use super::optics::Optics;
use super::raw_poses::{CameraAxes, Direction, QuaternionOrder};
use crate::math::Vector;

/// What a user chooses, or says over what a source declares. The default changes nothing.
#[derive(Debug, Clone, PartialEq)]
pub struct ImportOptions {
    /// Frames a second that are kept; 0 keeps all. 10 is what the pipeline was measured at.
    pub fps: f64,
    /// Frames a second of sources without times; `None`: 30, which is said in the report.
    pub source_fps: Option<f64>,
    /// The largest distance in time of two streams' items, seconds; `None`: half of the frames' period.
    pub max_gap_secs: Option<f64>,
    /// The largest distance in time of two poses that are interpolated, seconds.
    pub pose_gap_secs: f64,
    /// Image width of the output at the most, pixels.
    pub width: usize,
    /// Field of view of the output along its width at the most, degrees; `None`: fisheyes 100, other lenses as they are.
    pub fov_deg: Option<f64>,
    /// Clockwise quarter turns of the images.
    pub rotate_quarters: u8,
    /// The colour camera, where no source has its intrinsics.
    pub camera: Option<Optics>,
    /// Up in the axes of the source with the poses.
    pub up: Option<Vector>,
    /// Metres per unit of the source with the poses.
    pub unit_m: Option<f64>,
    /// What poses map.
    pub poses: Option<Direction>,
    /// Axes of the posed camera.
    pub camera_axes: Option<CameraAxes>,
    /// Order of quaternions.
    pub quaternion: Option<QuaternionOrder>,
    /// What lengths of a source of arbitrary scale are multiplied by to be metres; `None`: found from depth or hands.
    pub scale: Option<f64>,
    /// What is added to the hands' times, seconds.
    pub hand_lag_secs: f64,
    /// Topics of a robot's recording by what they hold: `color`, `depth`, `poses`. Those that are not told are guessed.
    pub topics: BTreeMap<String, String>,
    /// The ffmpeg program, ffprobe beside it; `None`: those that are installed.
    pub ffmpeg: Option<PathBuf>,
}

impl Default for ImportOptions {
    fn default() -> Self {
        Self {
            fps: 10.0,
            source_fps: None,
            max_gap_secs: None,
            // A head turns by some 10 degrees in a fifth of a second; a longer gap is a lost track.
            pose_gap_secs: 0.2,
            // Twice the width that the pipeline was measured at.
            width: 640,
            fov_deg: None,
            rotate_quarters: 0,
            camera: None,
            up: None,
            unit_m: None,
            poses: None,
            camera_axes: None,
            quaternion: None,
            scale: None,
            hand_lag_secs: 0.0,
            topics: BTreeMap::new(),
            ffmpeg: None,
        }
    }
}
