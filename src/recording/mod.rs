//! What was seen: the only input of every step. Reading is here and in `import`; images are decoded when asked for.
//!
//! A recording is a folder ([`Recording::open`]; `docs/recording-format.md` has its layout), or what a program holds
//! ([`Recording::from_memory`]); its pictures come from whatever implements [`Frames`].

pub mod at_work;
mod checks;
mod columns;
pub mod conventions;
mod folder;
pub mod frames;
pub mod grid;
pub mod images;
mod memory;
pub mod narration;
pub mod npy;
pub mod origin;
pub mod people;
pub(crate) mod pictures;
mod read;
pub(crate) mod reconstruction;
pub mod segments;
pub mod sketch;
mod sniff;
pub(crate) mod tables;
pub mod trajectory;
pub mod videos;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::error::Result;
use crate::math::{Point, Pose, Vector};
pub use at_work::AtWork;
pub use frames::{FolderFrames, Frames, MemoryFrames, Source};
pub use grid::Grid;
pub use memory::{MemoryFrame, MemoryRecording};
pub use videos::{Video, Videos};

/// Class of a hand's pixel in a mask.
pub const HAND_CLASS: u8 = 255;

/// A pinhole camera in OpenCV axes (x right, y down, z forward); integer pixels are pixel centres.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Camera {
    /// Image width, pixels.
    pub width: usize,
    /// Image height, pixels.
    pub height: usize,
    /// Focal length in x, pixels.
    pub fx: f64,
    /// Focal length in y, pixels.
    pub fy: f64,
    /// Principal point, x.
    pub cx: f64,
    /// Principal point, y.
    pub cy: f64,
}

impl Camera {
    /// Point in the camera frame at pixel (u, v) and depth `z` along the optical axis.
    #[must_use]
    pub fn unproject(&self, u: f64, v: f64, z: f64) -> Point {
        Point::new((u - self.cx) / self.fx * z, (v - self.cy) / self.fy * z, z)
    }

    /// Pixel of a point in the camera frame; `None` at or behind the camera.
    #[must_use]
    pub fn project(&self, p: &Point) -> Option<(f64, f64)> {
        (p.z > 1e-6).then(|| (self.fx * p.x / p.z + self.cx, self.fy * p.y / p.z + self.cy))
    }

    /// Whether pixel (u, v) lies on the image.
    #[must_use]
    pub fn contains(&self, u: f64, v: f64) -> bool {
        u >= -0.5 && v >= -0.5 && u < self.width as f64 - 0.5 && v < self.height as f64 - 0.5
    }
}

/// Names of one frame's pictures; each is optional. Of a folder they are paths, else what its [`Frames`] calls them.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct FrameFiles {
    /// RGB image.
    pub rgb: Option<PathBuf>,
    /// Depth along z, 0 = none; in files 16-bit millimetres.
    pub depth: Option<PathBuf>,
    /// Normals in the camera frame, facing the camera.
    pub normals: Option<PathBuf>,
    /// Class per pixel.
    pub mask: Option<PathBuf>,
    /// A line detector's own segments.
    pub segments: Option<PathBuf>,
}

/// One frame of the video.
#[derive(Debug, Clone, PartialEq)]
pub struct Frame {
    /// Seconds.
    pub timestamp_secs: f64,
    /// Camera to world.
    pub world_from_camera: Pose,
    /// Which pictures there are.
    pub files: FrameFiles,
}

impl Frame {
    /// Camera centre in the world.
    #[must_use]
    pub fn center(&self) -> Point {
        Point::from(self.world_from_camera.translation.vector)
    }
}

/// A narrated segment of the video (§3.1).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Clip {
    /// Name, unique in the recording.
    pub clip: String,
    /// First frame.
    pub start_frame: usize,
    /// Last frame, included.
    pub end_frame: usize,
    /// What the person says or an annotator wrote.
    #[serde(default)]
    pub narration: String,
    /// Its verb.
    #[serde(default)]
    pub verb: String,
    /// Its noun.
    #[serde(default)]
    pub noun: String,
}

/// Left or right.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Side {
    /// The left hand.
    Left,
    /// The right hand.
    Right,
}

/// One detected hand in one frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HandSample {
    /// Frame index.
    pub frame: usize,
    /// Which hand.
    pub side: Side,
    /// A contact detector's opinion; `None` where nobody was asked.
    pub contact: Option<bool>,
    /// Thumb, index and middle fingertips in the world.
    pub tips: [Point; 3],
    /// All 21 joints in the world, metres, where the tracker gives them: the wrist, then from the thumb on four of each
    /// finger from its root to its tip. Single precision: they only tell which pixels are hand.
    pub joints: Option<[[f32; 3]; 21]>,
}

impl HandSample {
    /// `z_t`: the mean of the three tips (§A.2).
    #[must_use]
    pub fn grasp(&self) -> Point {
        Point::from((self.tips[0].coords + self.tips[1].coords + self.tips[2].coords) / 3.0)
    }

    /// The joints that are known: all, or the three tips.
    #[must_use]
    pub fn skeleton(&self) -> Vec<Point> {
        match &self.joints {
            Some(joints) => joints.iter().map(|p| Point::from(p.map(f64::from))).collect(),
            None => self.tips.to_vec(),
        }
    }

    /// Pairs of joints with a bone between them; of three tips alone, each tip twice.
    #[must_use]
    pub fn bones(&self) -> Vec<[Point; 2]> {
        let at = self.skeleton();
        if self.joints.is_none() {
            return at.iter().map(|p| [*p, *p]).collect();
        }
        // The first joint of a finger hangs on the wrist.
        (1..at.len()).map(|i| [at[if i % 4 == 1 { 0 } else { i - 1 }], at[i]]).collect()
    }
}

/// A recording: poses, narrations and hands in memory, pictures where its [`Source`] has them. It may be joined of several
/// videos ([`videos`]).
#[derive(Debug, Clone, PartialEq)]
pub struct Recording {
    /// The folder's name.
    pub name: String,
    /// The folder; of a recording without one `memory:NAME`, or nothing.
    pub dir: PathBuf,
    /// Intrinsics; of a recording that was joined those of its first video ([`Recording::camera_of`]).
    pub camera: Camera,
    /// Frames in time order.
    pub frames: Vec<Frame>,
    /// Narrated segments.
    pub clips: Vec<Clip>,
    /// Hands, by frame.
    pub hands: Vec<HandSample>,
    /// Mask class to name.
    pub labels: BTreeMap<u8, String>,
    /// Points of a static reconstruction (`reconstruction.ply` or `.obj`), world frame; empty where there is none.
    pub reconstruction: Vec<Point>,
    /// What depth files are multiplied by when they are read.
    pub depth_factors: DepthFactors,
    /// What it was joined of.
    pub videos: Videos,
    /// What cannot be worked with and costs only itself.
    pub left_out: LeftOut,
    /// Who has the pictures; of a recording that was joined each video has its own ([`Recording::source_of`]).
    pub source: Source,
}

/// What of a recording's folder cannot be worked with, while the rest can.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct LeftOut {
    /// Clips, each with what is wrong with it. Their names are unique in the recording, their frames are in the video.
    pub clips: Vec<(Clip, String)>,
    /// All else, one sentence each, for people.
    pub notes: Vec<String>,
}

/// What each frame's depth has to be multiplied by to be metric, and how noisy it is then.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct DepthFactors {
    /// Frames whose factor is known.
    pub by_frame: BTreeMap<usize, f64>,
    /// The factor of all other frames.
    pub other: f64,
    /// How far depth is off after that; `None` where too little is seen twice to tell it.
    #[serde(default)]
    pub noise: Option<DepthNoise>,
}

impl Default for DepthFactors {
    fn default() -> Self {
        Self { by_frame: BTreeMap::new(), other: 1.0, noise: None }
    }
}

/// The noise law of a recording's depth: the standard deviation of a surface's place across itself, as a frame's depth has it,
/// grows evenly with the distance from the camera. All of `part` takes it from [`DepthFactors::noise`], which
/// `geometry::depth_scale` measures on each recording; where it cannot, `part.assumed_floor_m` and `part.assumed_per_m` of the config
/// stand in. The scale of depth, 3D lines and alignments of two recordings have limits of their own in the config
/// (`geometry.scales`, `geometry.tracks`, `alignment.judging`).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct DepthNoise {
    /// At the camera, metres.
    pub floor_m: f64,
    /// So much more for every metre of distance, metres.
    pub per_m: f64,
}

impl DepthNoise {
    /// Standard deviation of what is seen at a distance `z`, metres.
    #[must_use]
    pub fn std_m(&self, z: f64) -> f64 {
        self.floor_m + self.per_m * z
    }
}

impl DepthFactors {
    /// The factor of a frame.
    #[must_use]
    pub fn of(&self, frame: usize) -> f64 {
        self.by_frame.get(&frame).copied().unwrap_or(self.other)
    }
}

/// What shows where surfaces are.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Surfaces {
    /// Nothing: there are poses and hands alone.
    Nothing,
    /// Images or a detector's segments, of which lines in space can be told.
    Images,
    /// Points with holes between them: of structure from motion, or a semi-dense map. What lies behind a surface shows
    /// through it, so that they do not stand in for depth.
    Points,
    /// Depth, or a reconstruction without holes, which stands in for it.
    Depth,
}

impl Recording {
    /// The best that the recording has of [`Surfaces`]. Looks at every point of a reconstruction: ask once.
    #[must_use]
    pub fn surfaces(&self) -> Surfaces {
        let any = |has: fn(&FrameFiles) -> bool| self.frames.iter().any(|f| has(&f.files));
        if any(|f| f.depth.is_some()) || reconstruction::is_dense(&self.reconstruction) {
            Surfaces::Depth
        } else if !self.reconstruction.is_empty() {
            Surfaces::Points
        } else if any(|f| f.rgb.is_some() || f.segments.is_some()) {
            Surfaces::Images
        } else {
            Surfaces::Nothing
        }
    }

    /// Reads and checks a folder. All faults are reported at once; a file that lies elsewhere, by a link or by the path that
    /// `cameras.json` gives, is one.
    ///
    /// # Errors
    /// Where the folder is no recording that can be used.
    pub fn open(dir: &Path) -> Result<Self> {
        read::open(dir, false, true)
    }

    /// The same without the judgement whether hands are within reach of the head, which says that poses or hands mean something
    /// else: for [`conventions::findings`], which says what.
    ///
    /// # Errors
    /// As [`Self::open`], but for hands out of reach.
    pub fn open_unjudged(dir: &Path, follow_links: bool) -> Result<Self> {
        read::open(dir, follow_links, false)
    }

    /// The same, but links and paths may lead out of the folder.
    ///
    /// # Errors
    /// As [`Self::open`].
    pub fn open_following_links(dir: &Path) -> Result<Self> {
        read::open(dir, true, true)
    }

    /// Whether a detector said of any hand whether it is in contact.
    #[must_use]
    pub fn contact_known(&self) -> bool {
        self.hands.iter().any(|h| h.contact.is_some())
    }

    /// The world's up direction (+Z by convention; good to about a degree).
    #[must_use]
    pub fn up(&self) -> Vector {
        Vector::z()
    }

    /// Depth in metres along the optical axis, times the frame's factor; 0 = none. A frame without a depth file gets the
    /// static reconstruction as seen from it; `None` where there is neither.
    pub fn depth(&self, frame: usize) -> Result<Option<Grid<f32>>> {
        let mut depth = self.depth_as_read(frame)?;
        let factor = self.depth_factor(frame) as f32;
        if let Some(depth) = &mut depth
            && factor != 1.0
        {
            depth.data.iter_mut().for_each(|z| *z *= factor);
        }
        Ok(depth)
    }

    /// The same without the frame's factor.
    pub fn depth_as_read(&self, frame: usize) -> Result<Option<Grid<f32>>> {
        let depth = self.read(frame, |f| f.depth.as_ref(), |from, name, camera| from.depth(name, camera))?;
        if depth.is_some() || self.reconstruction_of(frame).is_empty() {
            return Ok(depth);
        }
        let (points, camera) = (self.reconstruction_of(frame), self.camera_of(frame));
        Ok(self.frames.get(frame).map(|f| images::splat(points, &f.world_from_camera, camera)))
    }

    /// What a frame's depth is multiplied by. A reconstruction is in the world already: its factor is 1.
    #[must_use]
    pub fn depth_factor(&self, frame: usize) -> f64 {
        let has_file = self.frames.get(frame).is_some_and(|f| f.files.depth.is_some());
        if has_file { self.depth_factors.of(frame) } else { 1.0 }
    }

    /// Whether a frame has depth: its own, or the reconstruction's.
    #[must_use]
    pub fn has_depth(&self, frame: usize) -> bool {
        self.frames.get(frame).is_some_and(|f| f.files.depth.is_some()) || !self.reconstruction_of(frame).is_empty()
    }

    /// Mask classes. `None` where the frame has no mask file.
    pub fn mask(&self, frame: usize) -> Result<Option<Grid<u8>>> {
        let mut mask = self.read(frame, |f| f.mask.as_ref(), |from, name, camera| from.mask(name, camera))?;
        let classes = self.classes_of(frame);
        if let Some(mask) = mask.as_mut().filter(|_| !classes.is_empty()) {
            for class in &mut mask.data {
                *class = classes.get(usize::from(*class)).copied().unwrap_or(*class);
            }
        }
        Ok(mask)
    }

    /// Grey image. `None` where the frame has no image file.
    pub fn grey(&self, frame: usize) -> Result<Option<Grid<u8>>> {
        self.read(frame, |f| f.rgb.as_ref(), |from, name, camera| from.grey(name, camera))
    }

    /// Colour image. `None` where the frame has no image file.
    pub fn rgb(&self, frame: usize) -> Result<Option<Grid<[u8; 3]>>> {
        self.read(frame, |f| f.rgb.as_ref(), |from, name, camera| from.rgb(name, camera))
    }

    /// Unit normals in the camera frame; zero = none. `None` where the frame has no normals file.
    pub fn normals(&self, frame: usize) -> Result<Option<Grid<[f32; 3]>>> {
        self.read(frame, |f| f.normals.as_ref(), |from, name, camera| from.normals(name, camera))
    }

    /// A line detector's own segments. `None` where the frame has no such file.
    pub fn segments(&self, frame: usize) -> Result<Option<Vec<segments::Ends>>> {
        let name = self.frames.get(frame).and_then(|f| f.files.segments.as_deref());
        name.map(|name| self.source_of(frame).frames().segments(name)).transpose()
    }

    /// Frames that have the time of the frame before: a speed between the two is not to be had.
    #[must_use]
    pub fn repeated_times(&self) -> Vec<usize> {
        let times: Vec<f64> = self.frames.iter().map(|f| f.timestamp_secs).collect();
        (1..times.len()).filter(|&f| times[f] <= times[f - 1]).collect()
    }

    /// The hands of frames `from..=to`; [`Recording::hands`] are in the order of frames.
    #[must_use]
    pub fn hands_in(&self, from: usize, to: usize) -> &[HandSample] {
        let first = self.hands.partition_point(|h| h.frame < from);
        let end = self.hands.partition_point(|h| h.frame <= to);
        self.hands.get(first..end).unwrap_or_default()
    }

    /// A picture of a frame; `None` where it has none of that kind.
    fn read<T>(
        &self,
        frame: usize,
        named: impl Fn(&FrameFiles) -> Option<&PathBuf>,
        give: impl Fn(&dyn Frames, &Path, &Camera) -> Result<Grid<T>>,
    ) -> Result<Option<Grid<T>>> {
        let Some(name) = self.frames.get(frame).and_then(|f| named(&f.files)) else { return Ok(None) };
        let camera = self.camera_of(frame);
        let picture = give(self.source_of(frame).frames(), name, camera)?;
        frames::sized(picture, name, camera).map(Some)
    }
}
