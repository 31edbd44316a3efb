//! What is kept of the messages of a ROS 2 recording: images, cameras, poses and transforms by topic.

use std::collections::{BTreeMap, BTreeSet};

use crate::import::blob::Blob;
use crate::import::capture::{ByteOrder, DepthCoding, ImageSource, PixelCoding};
use crate::import::mcap_file::{Channel, McapMessage, Visitor, Want};
use crate::import::ros::{self, CameraInfo, RosHeader, RosPose};
use crate::import::tf::TransformTree;

/// Bytes before the PNG in a compressed image of depth: how it was quantised.
const DEPTH_HEADER_BYTES: usize = 12;

/// What a topic's images are.
pub(super) enum ImageContent {
    /// A colour image.
    Color(ImageSource),
    /// Depth.
    Depth(DepthCoding, Blob),
    /// Something that is not read, in words.
    Unread(String),
}

/// An image of a topic.
pub(super) struct TopicImage {
    pub(super) time_secs: f64,
    pub(super) frame: String,
    pub(super) content: ImageContent,
}

/// What is kept of a recording's messages.
#[derive(Default)]
pub(super) struct Bag {
    pub(super) images: BTreeMap<String, Vec<TopicImage>>,
    pub(super) cameras: BTreeMap<String, CameraInfo>,
    pub(super) poses: BTreeMap<String, Vec<RosPose>>,
    pub(super) tree: TransformTree,
    /// Messages that could not be read, by topic.
    pub(super) broken: BTreeMap<String, usize>,
    /// All topics with their types.
    pub(super) topics: BTreeSet<String>,
    /// Encodings other than ROS 2's of topics that would be read.
    pub(super) encodings: BTreeSet<String>,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum MessageKind {
    Image,
    Compressed,
    Camera,
    Pose,
    Odometry,
    Transforms,
}

/// By the type's name with or without the folder in its middle.
fn kind(schema: &str) -> Option<MessageKind> {
    let (package, name) = (schema.split('/').next()?, schema.rsplit('/').next()?);
    match (package, name) {
        ("sensor_msgs", "Image") => Some(MessageKind::Image),
        ("sensor_msgs", "CompressedImage") => Some(MessageKind::Compressed),
        ("sensor_msgs", "CameraInfo") => Some(MessageKind::Camera),
        ("geometry_msgs", "PoseStamped" | "PoseWithCovarianceStamped") => Some(MessageKind::Pose),
        ("nav_msgs", "Odometry") => Some(MessageKind::Odometry),
        ("tf2_msgs" | "tf", "TFMessage" | "tfMessage") => Some(MessageKind::Transforms),
        _ => None,
    }
}

impl Visitor for Bag {
    fn want(&mut self, channel: &Channel) -> Want {
        self.topics.insert(format!("{} ({})", channel.topic, channel.schema));
        match kind(&channel.schema) {
            None => Want::Nothing,
            Some(_) if channel.encoding != "cdr" => {
                self.encodings.insert(channel.encoding.clone());
                Want::Nothing
            }
            Some(MessageKind::Image | MessageKind::Compressed) => Want::Head,
            Some(_) => Want::Whole,
        }
    }

    fn take(&mut self, message: &McapMessage<'_>) {
        if self.add(message).is_none() {
            *self.broken.entry(message.channel.topic.clone()).or_default() += 1;
        }
    }
}

impl Bag {
    /// Keeps what a message says; `None` where it cannot be read.
    fn add(&mut self, message: &McapMessage<'_>) -> Option<()> {
        let topic = message.channel.topic.clone();
        let time_secs = |header: &RosHeader| {
            if header.time_secs > 0.0 { header.time_secs } else { 1e-9 * message.log_time_ns as f64 }
        };
        match kind(&message.channel.schema)? {
            MessageKind::Image => {
                let image = ros::image(message.bytes)?;
                let content = raw(&image, message.piece(image.start, image.length)?);
                let seen = TopicImage { time_secs: time_secs(&image.header), frame: image.header.frame, content };
                self.images.entry(topic).or_default().push(seen);
            }
            MessageKind::Compressed => {
                let image = ros::compressed(message.bytes)?;
                let content = compressed(&image, message)?;
                let seen = TopicImage { time_secs: time_secs(&image.header), frame: image.header.frame, content };
                self.images.entry(topic).or_default().push(seen);
            }
            MessageKind::Camera => {
                let camera = ros::camera_info(message.bytes)?;
                self.cameras.entry(topic).or_insert(camera);
            }
            MessageKind::Pose | MessageKind::Odometry => {
                let is_odometry = kind(&message.channel.schema) == Some(MessageKind::Odometry);
                let mut posed =
                    if is_odometry { ros::odometry(message.bytes)? } else { ros::pose_stamped(message.bytes)? };
                posed.header.time_secs = time_secs(&posed.header);
                self.poses.entry(topic).or_default().push(posed);
            }
            MessageKind::Transforms => {
                for posed in ros::transforms(message.bytes)? {
                    if let (Some(body), Some(pose)) = (&posed.body, ros::rigid(&posed.pose)) {
                        self.tree.add(&posed.header.frame, body, time_secs(&posed.header), pose);
                    }
                }
            }
        }
        Some(())
    }
}

/// An image that is not compressed.
fn raw(image: &ros::RosImage, blob: Blob) -> ImageContent {
    let (width, height) = (image.width, image.height);
    let order = if image.is_bigendian { ByteOrder::Big } else { ByteOrder::Little };
    let (bytes, content) = match image.encoding.as_str() {
        "16UC1" | "mono16" => {
            (2, ImageContent::Depth(DepthCoding::RawU16 { width, height, order, unit_m: 1e-3 }, blob))
        }
        "32FC1" => (4, ImageContent::Depth(DepthCoding::RawF32 { width, height, order }, blob)),
        other => {
            let (bytes, coding) = match other {
                "mono8" | "8UC1" => (1, PixelCoding::Grey),
                "rgb8" => (3, PixelCoding::Rgb),
                "bgr8" | "8UC3" => (3, PixelCoding::Bgr),
                "rgba8" => (4, PixelCoding::Rgba { is_bottom_up: false }),
                "bgra8" | "8UC4" => (4, PixelCoding::Bgra),
                _ => return ImageContent::Unread(format!("pixels of {other}")),
            };
            (bytes, ImageContent::Color(ImageSource::Raw { blob, width, height, coding }))
        }
    };
    if width.checked_mul(bytes) == Some(image.step) {
        content
    } else {
        ImageContent::Unread(format!("rows of {} bytes for {width} pixels of {}", image.step, image.encoding))
    }
}

/// A compressed image; `None` where the message ends before.
fn compressed(image: &ros::Compressed, message: &McapMessage<'_>) -> Option<ImageContent> {
    if !image.format.contains("compressedDepth") {
        return Some(ImageContent::Color(ImageSource::Still(message.piece(image.start, image.length)?)));
    }
    // Quantised metres are another formula, and RVL is another packing.
    if !image.format.starts_with("16UC1") || image.format.contains("rvl") {
        return Some(ImageContent::Unread(format!("depth compressed as {}", image.format)));
    }
    let length = image.length.checked_sub(DEPTH_HEADER_BYTES)?;
    let blob = message.piece(image.start.checked_add(DEPTH_HEADER_BYTES)?, length)?;
    Some(ImageContent::Depth(DepthCoding::Png16 { unit_m: 1e-3 }, blob))
}
