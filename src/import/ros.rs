//! Messages of ROS 2 as they are serialised (CDR): those that hold images, cameras, poses and transforms.

use nalgebra::{Quaternion, UnitQuaternion};

use super::capture::{RawPose, RawRotation};
use super::optics::{LensModel, Optics};
use crate::math::{Pose, Vector};

/// Bytes before the first field; alignment counts from behind them.
const ENCAPSULATION_BYTES: usize = 4;

/// When and in which frame.
#[derive(Debug, Clone, PartialEq)]
pub struct RosHeader {
    /// Seconds; 0 where nobody set it.
    pub time_secs: f64,
    /// Name of the frame, without a slash in front.
    pub frame: String,
}

/// What stands before an image's pixels.
#[derive(Debug, Clone, PartialEq)]
pub struct RosImage {
    /// When and in which frame.
    pub header: RosHeader,
    /// Rows.
    pub height: usize,
    /// Columns.
    pub width: usize,
    /// What a pixel is, in ROS' words: `rgb8`, `16UC1`.
    pub encoding: String,
    /// Whether numbers have their most significant byte first.
    pub is_bigendian: bool,
    /// Bytes of a row.
    pub step: usize,
    /// First byte of the pixels in the message.
    pub start: usize,
    /// How many bytes.
    pub length: usize,
}

/// What stands before the bytes of a compressed image.
#[derive(Debug, Clone, PartialEq)]
pub struct Compressed {
    /// When and in which frame.
    pub header: RosHeader,
    /// How it is compressed: `jpeg`, `16UC1; compressedDepth png`.
    pub format: String,
    /// First byte in the message.
    pub start: usize,
    /// How many bytes.
    pub length: usize,
}

/// A camera.
#[derive(Debug, Clone, PartialEq)]
pub struct CameraInfo {
    /// When and in which frame.
    pub header: RosHeader,
    /// Columns and rows.
    pub size: [usize; 2],
    /// Name of the lens' model.
    pub model: String,
    /// Its coefficients.
    pub d: Vec<f64>,
    /// Intrinsics of the image as it is, rows of a 3 x 3 matrix.
    pub k: [f64; 9],
    /// Intrinsics of the rectified image, rows of a 3 x 4 matrix.
    pub p: [f64; 12],
}

/// A pose of a body.
#[derive(Debug, Clone, PartialEq)]
pub struct RosPose {
    /// When, and in which frame it is told.
    pub header: RosHeader,
    /// The body's frame, where the message names it.
    pub body: Option<String>,
    /// The body in that frame.
    pub pose: RawPose,
}

/// Fields of a message, from the front; `None` where it ends before.
struct Cdr<'a> {
    message: &'a [u8],
    at: usize,
    is_little: bool,
}

impl<'a> Cdr<'a> {
    fn of(message: &'a [u8]) -> Option<Self> {
        let is_little = match message {
            [0, 0, _, _, ..] => false,
            [0, 1, _, _, ..] => true,
            _ => return None,
        };
        Some(Self { message, at: ENCAPSULATION_BYTES, is_little })
    }

    fn bytes(&mut self, count: usize) -> Option<&'a [u8]> {
        let end = self.at.checked_add(count)?;
        let bytes = self.message.get(self.at..end)?;
        self.at = end;
        Some(bytes)
    }

    /// The bytes of a number, least significant first. Numbers lie at multiples of their size.
    fn number<const N: usize>(&mut self) -> Option<[u8; N]> {
        self.at = (self.at - ENCAPSULATION_BYTES).next_multiple_of(N) + ENCAPSULATION_BYTES;
        let mut bytes: [u8; N] = self.bytes(N)?.try_into().ok()?;
        if !self.is_little {
            bytes.reverse();
        }
        Some(bytes)
    }

    fn u8(&mut self) -> Option<u8> {
        self.number().map(u8::from_le_bytes)
    }

    fn u32(&mut self) -> Option<u32> {
        self.number().map(u32::from_le_bytes)
    }

    fn length(&mut self) -> Option<usize> {
        self.u32().map(|n| n as usize)
    }

    fn f64(&mut self) -> Option<f64> {
        self.number().map(f64::from_le_bytes)
    }

    fn f64s<const N: usize>(&mut self) -> Option<[f64; N]> {
        let mut out = [0.0; N];
        for value in &mut out {
            *value = self.f64()?;
        }
        Some(out)
    }

    fn text(&mut self) -> Option<String> {
        let count = self.length()?;
        let text = String::from_utf8_lossy(self.bytes(count)?);
        Some(text.trim_end_matches('\0').to_owned())
    }

    fn frame(&mut self) -> Option<String> {
        Some(self.text()?.trim_start_matches('/').to_owned())
    }

    fn header(&mut self) -> Option<RosHeader> {
        let secs = self.number().map(i32::from_le_bytes)?;
        let nanos = self.u32()?;
        Some(RosHeader { time_secs: f64::from(secs) + 1e-9 * f64::from(nanos), frame: self.frame()? })
    }

    /// Position and quaternion x y z w.
    fn pose(&mut self) -> Option<RawPose> {
        Some(RawPose { position: self.f64s()?, turn: RawRotation::Quaternion(self.f64s()?) })
    }
}

/// An image that is not compressed (`sensor_msgs/Image`).
#[must_use]
pub fn image(message: &[u8]) -> Option<RosImage> {
    let mut cdr = Cdr::of(message)?;
    let header = cdr.header()?;
    let (height, width) = (cdr.length()?, cdr.length()?);
    let encoding = cdr.text()?;
    let is_bigendian = cdr.u8()? != 0;
    let step = cdr.length()?;
    let length = cdr.length()?;
    Some(RosImage { header, height, width, encoding, is_bigendian, step, start: cdr.at, length })
}

/// A compressed image (`sensor_msgs/CompressedImage`).
#[must_use]
pub fn compressed(message: &[u8]) -> Option<Compressed> {
    let mut cdr = Cdr::of(message)?;
    let header = cdr.header()?;
    let format = cdr.text()?;
    let length = cdr.length()?;
    Some(Compressed { header, format, start: cdr.at, length })
}

/// A camera (`sensor_msgs/CameraInfo`).
#[must_use]
pub fn camera_info(message: &[u8]) -> Option<CameraInfo> {
    let mut cdr = Cdr::of(message)?;
    let header = cdr.header()?;
    let (height, width) = (cdr.length()?, cdr.length()?);
    let model = cdr.text()?;
    let count = cdr.length()?;
    // Lenses have at most 14 coefficients.
    let d = (0..count.min(16)).map(|_| cdr.f64()).collect::<Option<Vec<f64>>>()?;
    if count > d.len() {
        return None;
    }
    let k = cdr.f64s()?;
    let _rectification: [f64; 9] = cdr.f64s()?;
    Some(CameraInfo { header, size: [width, height], model, d, k, p: cdr.f64s()? })
}

/// A pose (`geometry_msgs/PoseStamped`, `PoseWithCovarianceStamped`).
#[must_use]
pub fn pose_stamped(message: &[u8]) -> Option<RosPose> {
    let mut cdr = Cdr::of(message)?;
    Some(RosPose { header: cdr.header()?, body: None, pose: cdr.pose()? })
}

/// A pose with the body that it is of (`nav_msgs/Odometry`).
#[must_use]
pub fn odometry(message: &[u8]) -> Option<RosPose> {
    let mut cdr = Cdr::of(message)?;
    let header = cdr.header()?;
    let body = Some(cdr.frame()?).filter(|b| !b.is_empty());
    Some(RosPose { header, body, pose: cdr.pose()? })
}

/// Transforms (`tf2_msgs/TFMessage`); the body is the child.
#[must_use]
pub fn transforms(message: &[u8]) -> Option<Vec<RosPose>> {
    let mut cdr = Cdr::of(message)?;
    let count = cdr.length()?;
    let mut out = Vec::new();
    for _ in 0..count {
        let header = cdr.header()?;
        let body = Some(cdr.frame()?);
        out.push(RosPose { header, body, pose: cdr.pose()? });
    }
    Some(out)
}

/// A pose of a message as a rigid transform; `None` where its numbers are none.
#[must_use]
pub fn rigid(raw: &RawPose) -> Option<Pose> {
    let RawRotation::Quaternion([x, y, z, w]) = raw.turn else { return None };
    let q = Quaternion::new(w, x, y, z);
    // An empty message has zeros.
    let is_turn = (q.norm() - 1.0).abs() < 0.02 && raw.position.iter().all(|x| x.is_finite());
    is_turn.then(|| Pose::from_parts(Vector::from(raw.position).into(), UnitQuaternion::from_quaternion(q)))
}

impl CameraInfo {
    /// The camera of its images, or of rectified ones; `None` for a model of lens that is not known and for a camera without
    /// a focal length (drivers send zeros for "not calibrated").
    #[must_use]
    pub fn optics(&self, is_rectified: bool) -> Option<Optics> {
        let [width, height] = self.size;
        let (k, p) = (&self.k, &self.p);
        let f = if is_rectified && p[0] > 0.0 { [p[0], p[5], p[2], p[6]] } else { [k[0], k[4], k[2], k[5]] };
        let lens = if is_rectified || self.d.iter().all(|d| *d == 0.0) { LensModel::Pinhole } else { self.lens()? };
        let optics = Optics { lens, ..Optics::pinhole(width, height, f) };
        optics.fault().is_none().then_some(optics)
    }

    fn lens(&self) -> Option<LensModel> {
        let d = |i: usize| self.d.get(i).copied().unwrap_or(0.0);
        match self.model.as_str() {
            "plumb_bob" | "rational_polynomial" | "" => {
                Some(LensModel::OpenCv { k: [d(0), d(1), d(4), d(5), d(6), d(7)], p: [d(2), d(3)] })
            }
            "equidistant" | "fisheye" => Some(LensModel::Fisheye { k: [d(0), d(1), d(2), d(3)] }),
            _ => None,
        }
    }
}
