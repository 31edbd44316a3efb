//! What one source gives: timed streams as plain data, in the source's own words.
//!
//! A reader fills a [`Capture`] and converts nothing that is declared here: axes, units, directions and joint orders are told,
//! and `axes`, `joints`, `decode` and `warp` act on what is told. So an option can overrule a declaration.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;

pub use super::at::At;
use super::blob::Blob;
use super::optics::Optics;
pub use super::raw_poses::{CameraAxes, Direction, PoseAt, Poses, QuaternionOrder, RawPose, RawRotation, SourceWorld};
use crate::math::{Point, Pose};
use crate::recording::Side;
use crate::recording::segments::Ends;

/// How the bytes of an image without a header stand.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PixelCoding {
    /// Red, green, blue, one that says nothing; a byte each.
    Rgba {
        /// Whether the first row is the lowest one.
        is_bottom_up: bool,
    },
    /// Blue, green, red, one that says nothing; a byte each, the top row first.
    Bgra,
    /// Red, green, blue; a byte each, the top row first.
    Rgb,
    /// Blue, green, red; a byte each, the top row first.
    Bgr,
    /// Grey, the top row first.
    Grey,
    /// Brightness, then blue and red differences at half the size (Android's YUV_420_888, full range), the top row first.
    Yuv420 {
        /// First byte of each plane.
        offsets: [usize; 3],
        /// Bytes from one row to the next, of each plane.
        rows: [usize; 3],
        /// Bytes from one pixel to the next, of each plane.
        steps: [usize; 3],
    },
}

/// Where a picture's pixels are.
#[derive(Debug, Clone, PartialEq)]
pub enum ImageSource {
    /// A JPEG or PNG, told by its content.
    Still(Blob),
    /// Pixels without a header.
    Raw {
        /// Their bytes.
        blob: Blob,
        /// Columns.
        width: usize,
        /// Rows.
        height: usize,
        /// How they stand.
        coding: PixelCoding,
    },
    /// A frame of a video file.
    Video {
        /// The file.
        file: PathBuf,
        /// Which of its pictures in the order of display, from 0.
        index: usize,
        /// Whether the rotation in the file's metadata is applied. No where intrinsics and poses are the sensor's.
        upright: bool,
    },
}

/// A colour image at a time.
#[derive(Debug, Clone, PartialEq)]
pub struct ImageAt {
    /// When.
    pub at: At,
    /// What.
    pub picture: ImageSource,
    /// Its camera where it differs from image to image.
    pub optics: Option<Optics>,
}

/// What a depth value measures.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Along {
    /// The distance along the optical axis.
    #[default]
    Z,
    /// The distance from the camera's centre.
    Ray,
}

/// Byte order of raw numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ByteOrder {
    /// Least significant byte first.
    Little,
    /// Most significant byte first.
    Big,
}

/// How depth is stored. Values that are not finite or not positive mean "no value" in all of them.
#[derive(Debug, Clone, PartialEq)]
pub enum DepthCoding {
    /// A grey image of 16 bits, or 8.
    Png16 {
        /// Metres per count.
        unit_m: f64,
    },
    /// A portable grey map of 16 bits (big-endian, as the format has it).
    Pgm16 {
        /// Metres per count.
        unit_m: f64,
    },
    /// OpenEXR, metres: the channel whose name says depth, else the only one.
    Exr,
    /// A numpy array of shape (rows, columns), with any more dimensions of size 1; float or unsigned.
    Npy {
        /// Metres per unit.
        unit_m: f64,
    },
    /// Rows of float32, metres.
    RawF32 {
        /// Columns.
        width: usize,
        /// Rows.
        height: usize,
        /// Byte order.
        order: ByteOrder,
    },
    /// Rows of float32, least significant byte first, as a renderer's depth buffer has them: 0 at the near plane, 1 at the
    /// far one.
    BufferF32 {
        /// Columns.
        width: usize,
        /// Rows.
        height: usize,
        /// Distance of the near plane, metres.
        near_m: f64,
        /// Distance of the far plane, metres; may be infinite.
        far_m: f64,
    },
    /// Rows of unsigned 16-bit numbers.
    RawU16 {
        /// Columns.
        width: usize,
        /// Rows.
        height: usize,
        /// Byte order.
        order: ByteOrder,
        /// Metres per count.
        unit_m: f64,
    },
}

/// A depth image at a time.
#[derive(Debug, Clone, PartialEq)]
pub struct DepthAt {
    /// When.
    pub at: At,
    /// Its bytes.
    pub blob: Blob,
    /// Confidence of each pixel: an 8-bit grey image, or one byte a pixel, of the depth's size.
    pub confidence: Option<Blob>,
    /// Its camera where it differs from image to image.
    pub optics: Option<Optics>,
    /// The depth camera's own pose in the capture's world, told as [`Capture::poses`] are.
    pub pose: Option<RawPose>,
}

/// Depth images.
#[derive(Debug, Clone, PartialEq)]
pub struct Depth {
    /// How they are stored.
    pub coding: DepthCoding,
    /// What a value measures.
    pub along: Along,
    /// Whether the unit is metres. No for depth up to one factor, which the points of the capture with the poses then tell.
    pub is_metric: bool,
    /// The depth camera; `None`: the colour camera, its intrinsics scaled to the depth's size.
    pub optics: Option<Optics>,
    /// Colour camera from depth camera (both OpenCV axes, metres); `None`: one and the same place.
    pub color_from_depth: Option<Pose>,
    /// Directions of the pixels (row by row, OpenCV axes, any length), where a file holds them instead of a camera model.
    pub rays: Option<Arc<[[f32; 3]]>>,
    /// Pixels of a lower confidence have no value.
    pub least_confidence: u8,
    /// In any order.
    pub items: Vec<DepthAt>,
}

impl Depth {
    /// Metric depth along the optical axis, of the colour camera, all pixels of it: what most sources have.
    #[must_use]
    pub fn of(coding: DepthCoding, items: Vec<DepthAt>) -> Self {
        Self {
            coding,
            along: Along::Z,
            is_metric: true,
            optics: None,
            color_from_depth: None,
            rays: None,
            least_confidence: 0,
            items,
        }
    }
}

/// The frame that joints of hands are in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum JointFrame {
    /// The capture's world.
    World,
    /// The colour camera at the time of the hand.
    Camera(CameraAxes),
    /// The posed body of [`Poses::body_from_camera`] at the time of the hand.
    Body,
}

/// A hand at a time.
#[derive(Debug, Clone, PartialEq)]
pub struct HandAt {
    /// When.
    pub at: At,
    /// Which.
    pub side: Side,
    /// Joints in the order of [`HandStream::order`]; one that is not there is `None`.
    pub joints: Vec<Option<[f64; 3]>>,
    /// Whether it holds or touches something; `None`: the source does not say.
    pub contact: Option<bool>,
    /// The detector's confidence, 0 to 1.
    pub score: Option<f64>,
}

/// Hands.
#[derive(Debug, Clone, PartialEq)]
pub struct HandStream {
    /// The joints' frame.
    pub frame: JointFrame,
    /// The joints' order.
    pub order: super::joint_orders::JointOrder,
    /// Metres per unit of the joints, in the camera's and the body's frame. In the world's frame [`SourceWorld::unit_m`] holds.
    pub unit_m: f64,
    /// In any order.
    pub items: Vec<HandAt>,
}

/// A contact detector's opinion of one hand.
#[derive(Debug, Clone, PartialEq)]
pub struct ContactAt {
    /// When.
    pub at: At,
    /// Which hand.
    pub side: Side,
    /// Whether it holds or touches an object.
    pub contact: bool,
}

/// Pixels of one thing, or of all things, in the size of the colour image (another size of the same shape is scaled).
#[derive(Debug, Clone, PartialEq)]
pub enum Layer {
    /// An 8-bit grey image whose values are the classes.
    Classes(Blob),
    /// A grey image; what is not 0 has the class.
    Binary {
        /// The class, 1 to 255 (255: a hand).
        class: u8,
        /// The image.
        blob: Blob,
    },
    /// Lengths of runs, column by column, of pixels that are not of the thing and that are, in turn (COCO).
    Runs {
        /// The class, 1 to 255 (255: a hand).
        class: u8,
        /// Columns.
        width: usize,
        /// Rows.
        height: usize,
        /// The lengths; the first run is of pixels that are not of it.
        runs: Arc<[u32]>,
    },
}

/// Masks of one image; later layers lie over earlier ones.
#[derive(Debug, Clone, PartialEq)]
pub struct MaskAt {
    /// When.
    pub at: At,
    /// The layers.
    pub layers: Vec<Layer>,
}

/// Masks.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Masks {
    /// Names of the classes.
    pub labels: BTreeMap<u8, String>,
    /// In any order.
    pub items: Vec<MaskAt>,
}

/// Normals of one image: 8-bit RGB of its camera, in the size of the colour image or of its shape.
#[derive(Debug, Clone, PartialEq)]
pub struct NormalsAt {
    /// When.
    pub at: At,
    /// The image.
    pub blob: Blob,
}

/// Normals in the camera's frame: `n = (value - zero) * factor`, then turned to OpenCV axes.
#[derive(Debug, Clone, PartialEq)]
pub struct Normals {
    /// The value of a component of 0.
    pub zero: f64,
    /// What the components x, y, z are multiplied by; their signs turn the axes to OpenCV's.
    pub factor: [f64; 3],
    /// In any order.
    pub items: Vec<NormalsAt>,
}

/// Line segments of one image, pixels of the colour image.
#[derive(Debug, Clone, PartialEq)]
pub struct SegmentsAt {
    /// When.
    pub at: At,
    /// End points.
    pub segments: Vec<Ends>,
}

/// A narrated piece of the video.
#[derive(Debug, Clone, PartialEq)]
pub struct ClipAt {
    /// Its name; made unique where names repeat.
    pub name: String,
    /// Where it begins.
    pub start: At,
    /// Where it ends.
    pub end: At,
    /// What was said or written.
    pub narration: String,
    /// Its verb, where the source has one.
    pub verb: String,
    /// Its noun, where the source has one.
    pub noun: String,
}

/// Something that a source does not hold and a recording needs.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize)]
pub struct Missing {
    /// The stream.
    pub what: String,
    /// Why it is not there, or what it costs.
    pub why: String,
    /// The command or the step that fills it.
    pub command: String,
}

/// What one source gives.
#[derive(Debug, Clone, Default)]
pub struct Capture {
    /// The format's name.
    pub kind: String,
    /// The file or folder.
    pub source: PathBuf,
    /// What it is, for people.
    pub title: String,
    /// The licence of its data, where the format has one.
    pub licence: Option<String>,
    /// What a user should know: what the reader took for granted, what it left out.
    pub notes: Vec<String>,
    /// What of the files could not be read and was left out while most could, with the reason: it is told.
    pub dropped: Vec<String>,
    /// Name of the clock of all times; captures whose clocks have one name share it. `None`: a clock of its own.
    pub clock: Option<String>,
    /// The world's frame.
    pub world: SourceWorld,
    /// The colour camera.
    pub optics: Option<Optics>,
    /// Whether [`Capture::optics`] were guessed from images, so that any other source's come first.
    pub optics_estimated: bool,
    /// Poses.
    pub poses: Option<Poses>,
    /// Colour images, in any order.
    pub images: Vec<ImageAt>,
    /// Depth.
    pub depth: Option<Depth>,
    /// Hands.
    pub hands: Option<HandStream>,
    /// Focal length that the hands (in the camera's frame) were placed with, as a share of the image's width, its principal
    /// point the image's middle; `None`: the camera's own. Hands are moved to where the camera's own focal length has them.
    pub hands_focal_per_width: Option<f64>,
    /// Opinions about contact that come without joints.
    pub contacts: Vec<ContactAt>,
    /// Masks.
    pub masks: Option<Masks>,
    /// Normals.
    pub normals: Option<Normals>,
    /// Line segments.
    pub segments: Vec<SegmentsAt>,
    /// Narrations.
    pub clips: Vec<ClipAt>,
    /// Name of each narration's video, where one file holds narrations of several; else empty.
    pub clip_videos: Vec<String>,
    /// Points of a static reconstruction, the capture's world and unit; of a capture without poses: the world and unit of the
    /// capture with the poses.
    pub points: Vec<Point>,
    /// What is missing.
    pub missing: Vec<Missing>,
}
