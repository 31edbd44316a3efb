//! A recording that has been joined and not yet written: tables, and images of one frame at a time.

use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;

use image::codecs::jpeg::JpegEncoder;
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder};
use serde_json::{Value, json};

use super::axes::Convention;
use super::blob::Blob;
use super::capture::{Along, At, Capture, Depth, DepthAt, ImageSource, Missing};
use super::choices::ImportOptions;
use super::frame_timeline::Item;
use super::joint_orders::TIPS;
use super::optics::Optics;
use super::output_view::OutputView;
use super::report::ImportReport;
use super::warp::DepthCamera;
use super::{decode, video, warp};
use crate::error::{Error, Result};
use crate::math::{Point, Pose};
use crate::recording::{Clip, Grid, Side};

/// JPEG quality of images that had to be drawn anew: lines are looked for in them.
const JPEG_QUALITY: u8 = 95;

/// A frame of the result.
#[derive(Debug, Clone, PartialEq)]
pub struct ImportedFrame {
    /// Where it is in the source.
    pub at: At,
    /// Seconds.
    pub time_secs: f64,
    /// Output camera to world, +Z up, metres.
    pub world_from_camera: Pose,
    /// The source's colour camera in the source's world.
    pub(super) source_pose: Pose,
    /// The source's colour camera.
    pub optics: Optics,
    pub(super) image: Option<Item>,
    pub(super) depth: Option<Item>,
    pub(super) mask: Option<Item>,
    pub(super) normals: Option<Item>,
    pub(super) segments: Option<Item>,
}

/// A hand of the result.
#[derive(Debug, Clone, PartialEq)]
pub struct Hand {
    /// Index of the frame.
    pub frame: usize,
    /// Which.
    pub side: Side,
    /// Joints in MANO's order, world, metres; `None` for those that the source has not.
    pub joints: [Option<Point>; 21],
    /// Contact; `None`: nobody says.
    pub contact: Option<bool>,
    /// The detector's confidence.
    pub score: Option<f64>,
}

/// Files of a frame, and what could not be read of it.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Written {
    /// Name in the recording's folder, and bytes.
    pub files: Vec<(String, Vec<u8>)>,
    /// One sentence each.
    pub faults: Vec<String>,
}

/// A joined recording.
#[derive(Debug, Clone)]
pub struct Imported {
    /// The output's camera.
    pub view: OutputView,
    /// Frames in time order.
    pub frames: Vec<ImportedFrame>,
    /// Narrations.
    pub clips: Vec<Clip>,
    /// Hands, by frame and side.
    pub hands: Vec<Hand>,
    /// Mask class to name.
    pub labels: BTreeMap<u8, String>,
    /// Points of a static reconstruction, world, metres.
    pub points: Vec<Point>,
    /// What was done.
    pub report: ImportReport,
    /// The sources.
    pub captures: Vec<Capture>,
    pub(super) depth_factor: f64,
    pub(super) pictures: Vec<(PathBuf, bool, usize)>,
    pub(super) extracted: BTreeMap<(PathBuf, usize), PathBuf>,
    pub(super) options: ImportOptions,
}

/// The camera of an image of depth: its rays, its own model, or the colour camera's at its size.
pub(super) fn depth_camera<'a>(depth: &'a Depth, at: &DepthAt, color: &Optics, grid: &Grid<f32>) -> DepthCamera<'a> {
    match &depth.rays {
        Some(rays) if rays.len() == grid.data.len() => DepthCamera::Rays(rays),
        _ => DepthCamera::Optics(at.optics.or(depth.optics).unwrap_or(*color).resized(grid.width, grid.height)),
    }
}

impl Imported {
    /// Video pictures that [`Imported::extract`] decodes.
    #[must_use]
    pub fn video_pictures(&self) -> usize {
        self.pictures.len()
    }

    /// Decodes the wanted pictures of all video files into folders below `folder`, which `folder_of` makes; each file once.
    /// Where ffmpeg is not there or fails, the recording goes on without these images and the report says so.
    ///
    /// # Errors
    /// Where a folder cannot be made.
    pub fn extract<E>(
        &mut self,
        folder_of: impl Fn(usize) -> std::result::Result<PathBuf, E>,
    ) -> std::result::Result<(), E> {
        let mut by_file: BTreeMap<(PathBuf, bool), BTreeSet<usize>> = BTreeMap::new();
        for (file, upright, index) in &self.pictures {
            by_file.entry((file.clone(), *upright)).or_default().insert(*index);
        }
        for (number, ((file, upright), indices)) in by_file.into_iter().enumerate() {
            let folder = folder_of(number)?;
            let indices: Vec<usize> = indices.into_iter().collect();
            match video::extract(self.options.ffmpeg.as_deref(), &file, upright, &indices, &folder) {
                Ok(paths) => {
                    if paths.len() < indices.len() {
                        let (got, wanted) = (paths.len(), indices.len());
                        self.report
                            .faults
                            .push(format!("{}: only {got} of {wanted} pictures are in it", file.display()));
                    }
                    self.extracted.extend(indices.into_iter().map(|i| (file.clone(), i)).zip(paths));
                }
                Err(error) => {
                    self.report.faults.push(error.to_string());
                    self.report.missing.push(Missing {
                        what: "images".to_owned(),
                        why: format!("{} could not be decoded", file.display()),
                        command: video::INSTALL.to_owned(),
                    });
                }
            }
        }
        Ok(())
    }

    /// The images of a frame. What cannot be read costs only itself.
    #[must_use]
    pub fn images(&self, frame: usize) -> Written {
        let mut out = Written::default();
        let Some(f) = self.frames.get(frame) else { return out };
        let (image, depth) = (self.image(frame, f), self.depth(frame, f));
        let (mask, normals) = (self.mask(frame, f), self.normals(frame, f));
        for file in [image, depth, mask, normals] {
            match file {
                Ok(Some(file)) => out.files.push(file),
                Ok(None) => {}
                Err(error) => out.faults.push(error.to_string()),
            }
        }
        out.files.extend(self.segments(frame, f));
        out
    }

    /// The tables: (file name, text). `images` are the names that were written by [`Imported::images`].
    ///
    /// # Errors
    /// Where a value cannot be written as JSON, which would be a bug.
    pub fn tables(&self, images: &BTreeSet<String>) -> Result<Vec<(String, String)>> {
        let mut tables = vec![
            ("cameras.json".to_owned(), crate::json::text(&self.cameras(images))?),
            ("clips.json".to_owned(), crate::json::text(&json!({"clips": self.clips}))?),
            ("import.json".to_owned(), crate::json::text(&self.report)?),
        ];
        if !self.hands.is_empty() {
            tables.push(self.hand_table()?);
        }
        if !self.labels.is_empty() {
            let labels: BTreeMap<String, &String> = self.labels.iter().map(|(k, v)| (k.to_string(), v)).collect();
            tables.push(("labels.json".to_owned(), crate::json::text(&labels)?));
        }
        if !self.points.is_empty() {
            tables.push(("reconstruction.ply".to_owned(), self.ply()));
        }
        Ok(tables)
    }

    fn cameras(&self, images: &BTreeSet<String>) -> Value {
        let frames: Vec<Value> = self
            .frames
            .iter()
            .enumerate()
            .map(|(i, f)| {
                let pose = &f.world_from_camera;
                let q = pose.rotation.quaternion();
                let mut entry = json!({"frame": i, "timestamp": f.time_secs,
                    "position": pose.translation.vector.as_slice(), "rotation_wxyz": [q.w, q.i, q.j, q.k]});
                let name = format!("frames/{i:06}.jpg");
                if images.contains(&name) {
                    entry["file"] = Value::String(name);
                }
                entry
            })
            .collect();
        let c = self.view.camera;
        json!({"convention": "OpenCV camera; world_from_camera; world +Z up; metres; seconds; quaternion w x y z",
            "width": c.width, "height": c.height, "fx": c.fx, "fy": c.fy, "cx": c.cx, "cy": c.cy,
            "distortion": "none", "frames": frames})
    }

    /// All joints where every hand has them, else the three tips of those hands that have these.
    fn hand_table(&self) -> Result<(String, String)> {
        if self.hands.iter().any(|h| h.joints.iter().any(Option::is_none)) {
            return Ok(("fingertips.csv".to_owned(), self.fingertips()));
        }
        let mut frames: BTreeMap<usize, Vec<Value>> = BTreeMap::new();
        for hand in &self.hands {
            let joints: Vec<[f64; 3]> = hand.joints.iter().flatten().map(|p| p.coords.into()).collect();
            let mut entry = json!({"side": hand.side, "joints_world": joints});
            if let Some(contact) = hand.contact {
                entry["contact"] = Value::Bool(contact);
            }
            if let Some(score) = hand.score {
                entry["score"] = json!(score);
            }
            frames.entry(hand.frame).or_default().push(entry);
        }
        let frames: Vec<Value> =
            frames.into_iter().map(|(frame, hands)| json!({"frame": frame, "hands": hands})).collect();
        let text = crate::json::text(&json!({"frame": "world (same as cameras.json), metres", "frames": frames}))?;
        Ok(("hands.json".to_owned(), text))
    }

    fn fingertips(&self) -> String {
        let mut text = "frame,timestamp,side,contact,score,thumb_x,thumb_y,thumb_z,index_x,index_y,index_z,\
                        middle_x,middle_y,middle_z\n"
            .to_owned();
        for hand in &self.hands {
            let tips: Vec<Point> = TIPS.iter().filter_map(|i| hand.joints.get(*i).copied().flatten()).collect();
            let (Some(frame), true) = (self.frames.get(hand.frame), tips.len() == TIPS.len()) else { continue };
            let side = if hand.side == Side::Left { "left" } else { "right" };
            // An empty cell: nobody says.
            let contact = hand.contact.map_or("", |c| if c { "1" } else { "0" });
            let score = hand.score.map_or_else(String::new, |s| s.to_string());
            text += &format!("{},{},{side},{contact},{score}", hand.frame, frame.time_secs);
            for p in tips {
                text += &format!(",{},{},{}", p.x, p.y, p.z);
            }
            text.push('\n');
        }
        text
    }

    fn ply(&self) -> String {
        let mut text = format!(
            "ply\nformat ascii 1.0\nelement vertex {}\nproperty double x\nproperty double y\nproperty double z\nend_header\n",
            self.points.len()
        );
        for p in &self.points {
            text += &format!("{} {} {}\n", p.x, p.y, p.z);
        }
        text
    }

    fn image(&self, frame: usize, f: &ImportedFrame) -> Result<Option<(String, Vec<u8>)>> {
        let Some(source) = f.image.and_then(|x| self.captures.get(x.capture)?.images.get(x.item)) else {
            return Ok(None);
        };
        let blob = match &source.picture {
            ImageSource::Still(blob) | ImageSource::Raw { blob, .. } => blob.clone(),
            ImageSource::Video { file, index, .. } => match self.extracted.get(&(file.clone(), *index)) {
                Some(path) => Blob::File(path.clone()),
                None => return Ok(None),
            },
        };
        // A picture of a video lies in a folder of no name: the video is what a user knows.
        let named = |error: Error| match &source.picture {
            ImageSource::Still(_) | ImageSource::Raw { .. } => error,
            ImageSource::Video { file, index, .. } => {
                Error::format(file, format!("picture {index}"), "what ffmpeg made of it cannot be read")
            }
        };
        let name = format!("frames/{frame:06}.jpg");
        let is_file = !matches!(source.picture, ImageSource::Raw { .. });
        if is_file && self.view.is_same(&f.optics) {
            let bytes = blob.read().map_err(named)?;
            let is_jpeg = bytes.starts_with(&[0xFF, 0xD8, 0xFF]);
            let size = image::ImageReader::new(std::io::Cursor::new(&bytes))
                .with_guessed_format()
                .ok()
                .and_then(|r| r.into_dimensions().ok());
            if is_jpeg && size == Some((f.optics.width as u32, f.optics.height as u32)) {
                return Ok(Some((name, bytes)));
            }
        }
        let image = match &source.picture {
            ImageSource::Raw { width, height, coding, .. } => decode::pixels(&blob, *width, *height, *coding)?,
            ImageSource::Still(_) | ImageSource::Video { .. } => decode::picture(&blob).map_err(named)?.into_rgb8(),
        };
        let (width, height) = (image.width() as usize, image.height() as usize);
        if !f.optics.has_shape(width, height) {
            let file = match &source.picture {
                ImageSource::Still(blob) | ImageSource::Raw { blob, .. } => blob.file(),
                ImageSource::Video { file, .. } => file.as_path(),
            };
            let message = format!(
                "is {width} x {height}, its camera {} x {}: another shape; a rotated or cropped image needs its own \
                 intrinsics (--camera)",
                f.optics.width, f.optics.height
            );
            return Err(Error::format(file, "size", message));
        }
        let data = warp::color(&image, &self.view, &f.optics);
        let camera = &self.view.camera;
        let mut bytes = Vec::new();
        JpegEncoder::new_with_quality(&mut bytes, JPEG_QUALITY)
            .write_image(&data, camera.width as u32, camera.height as u32, ExtendedColorType::Rgb8)
            .map_err(|e| decode::encoding(&e))?;
        Ok(Some((name, bytes)))
    }

    /// Depth of a frame as the output's camera sees it, metres.
    pub(super) fn depth_grid(&self, f: &ImportedFrame) -> Result<Option<Grid<f32>>> {
        let Some((capture, depth)) =
            f.depth.and_then(|x| self.captures.get(x.capture)).and_then(|c| Some((c, c.depth.as_ref()?)))
        else {
            return Ok(None);
        };
        let Some(at) = f.depth.and_then(|x| depth.items.get(x.item)) else { return Ok(None) };
        let grid = decode::depth(&at.blob, at.confidence.as_ref(), depth)?;
        let camera = depth_camera(depth, at, &f.optics, &grid);
        let pose = self.color_from_depth(capture, depth, at, f);
        let mut out = warp::depth(&grid, depth.along == Along::Ray, camera, pose.as_ref(), &self.view);
        if self.depth_factor != 1.0 {
            out.data.iter_mut().for_each(|z| *z = (f64::from(*z) * self.depth_factor) as f32);
        }
        Ok(Some(out))
    }

    fn depth(&self, frame: usize, f: &ImportedFrame) -> Result<Option<(String, Vec<u8>)>> {
        let Some(grid) = self.depth_grid(f)? else { return Ok(None) };
        // What 16 bits of millimetres cannot hold is no value.
        let counts = grid
            .data
            .iter()
            .map(|z| 1000.0 * f64::from(*z))
            .map(|mm| if mm < 65_535.5 { mm.round() as u16 } else { 0 });
        let bytes: Vec<u8> = counts.flat_map(u16::to_ne_bytes).collect();
        Ok(Some((format!("depth/{frame:06}.png"), self.png(&bytes, ExtendedColorType::L16)?)))
    }

    /// Colour camera from depth camera at a frame.
    fn color_from_depth(&self, capture: &Capture, depth: &Depth, at: &DepthAt, f: &ImportedFrame) -> Option<Pose> {
        let own = at.pose.as_ref().and_then(|raw| {
            let convention = Convention::of(capture, &self.options);
            Convention { body_from_camera: None, ..convention }.world_from_body(raw)
        });
        match own {
            Some(world_from_depth) => Some(f.source_pose.inverse() * world_from_depth),
            None => depth.color_from_depth,
        }
    }

    /// Mask of a frame as the output's camera sees it.
    pub(super) fn mask_grid(&self, f: &ImportedFrame) -> Result<Option<Grid<u8>>> {
        let Some(masks) = f.mask.and_then(|x| self.captures.get(x.capture)?.masks.as_ref()?.items.get(x.item)) else {
            return Ok(None);
        };
        warp::mask(&masks.layers, &self.view, &f.optics).map(Some)
    }

    fn mask(&self, frame: usize, f: &ImportedFrame) -> Result<Option<(String, Vec<u8>)>> {
        let Some(grid) = self.mask_grid(f)? else { return Ok(None) };
        Ok(Some((format!("masks/{frame:06}.png"), self.png(&grid.data, ExtendedColorType::L8)?)))
    }

    fn normals(&self, frame: usize, f: &ImportedFrame) -> Result<Option<(String, Vec<u8>)>> {
        let Some(normals) = f.normals.and_then(|x| self.captures.get(x.capture)?.normals.as_ref()) else {
            return Ok(None);
        };
        let Some(at) = f.normals.and_then(|x| normals.items.get(x.item)) else { return Ok(None) };
        let data = warp::normals(&at.blob, normals, &self.view, &f.optics)?;
        Ok(Some((format!("normals/{frame:06}.png"), self.png(&data, ExtendedColorType::Rgb8)?)))
    }

    fn segments(&self, frame: usize, f: &ImportedFrame) -> Option<(String, Vec<u8>)> {
        let at = f.segments.and_then(|x| self.captures.get(x.capture)?.segments.get(x.item))?;
        let lines = warp::segments(&at.segments, &self.view, &f.optics);
        let mut text = format!("{}\n", lines.len());
        for [a, b] in lines {
            text += &format!("{:.3} {:.3} {:.3} {:.3}\n", a[0], a[1], b[0], b[1]);
        }
        Some((format!("segments/{frame:06}.txt"), text.into_bytes()))
    }

    fn png(&self, data: &[u8], color: ExtendedColorType) -> Result<Vec<u8>> {
        let camera = &self.view.camera;
        let mut bytes = Vec::new();
        PngEncoder::new_with_quality(&mut bytes, CompressionType::Fast, FilterType::Adaptive)
            .write_image(data, camera.width as u32, camera.height as u32, color)
            .map_err(|e| decode::encoding(&e))?;
        Ok(bytes)
    }
}
