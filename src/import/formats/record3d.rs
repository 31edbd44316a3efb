//! Record3D (iPhone, iPad with LiDAR or TrueDepth): an `.r3d` archive, or the folder that the app exports as EXR and JPG.
//!
//! `metadata` holds K by columns, poses `qx qy qz qw tx ty tz` of cameras with OpenGL axes in the world, times or a frame rate.
//! Depth is float32 in metres, packed with LZFSE; confidence is 0, 1 or 2.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::Deserialize;

use crate::error::{Error, Result};
use crate::import::ImportOptions;
use crate::import::axes::quaternion;
use crate::import::blob::{Blob, Packing, entries, inside};
use crate::import::capture::{
    At, ByteOrder, CameraAxes, Capture, Depth, DepthAt, DepthCoding, ImageAt, ImageSource, PoseAt, Poses,
    QuaternionOrder, RawPose, RawRotation, SourceWorld,
};
use crate::import::optics::Optics;
use crate::math::Vector;

/// Confidence 0 is noise at edges and on dark surfaces.
const LEAST_CONFIDENCE: u8 = 1;
/// A first camera that is turned less than this against the world is where the world's axes come from, radians.
const SAME_TURN: f64 = 1e-3;

pub(super) fn detect(path: &Path) -> bool {
    if path.is_dir() {
        return path.join("metadata.json").is_file() && path.join("rgb").is_dir() && path.join("depth").is_dir();
    }
    path.is_file() && path.extension().is_some_and(|e| e.eq_ignore_ascii_case("r3d"))
}

/// What is read of the metadata; older versions of the app write less.
#[derive(Deserialize)]
struct Metadata {
    w: usize,
    h: usize,
    dw: Option<usize>,
    dh: Option<usize>,
    fps: Option<f64>,
    #[serde(rename = "K")]
    k: [f64; 9],
    poses: Vec<[f64; 7]>,
    #[serde(rename = "initPose")]
    first_pose: Option<[f64; 7]>,
    #[serde(rename = "frameTimestamps")]
    times: Option<Vec<f64>>,
    #[serde(rename = "perFrameIntrinsicCoeffs")]
    cameras: Option<Vec<[f64; 4]>>,
}

/// Where the pieces of a frame are.
enum Files {
    Archive(BTreeMap<String, Blob>),
    Folder(PathBuf),
}

impl Files {
    fn of(path: &Path) -> Result<Self> {
        if path.is_dir() {
            Ok(Self::Folder(path.to_owned()))
        } else {
            Ok(Self::Archive(entries(path)?.into_iter().collect()))
        }
    }

    fn get(&self, in_archive: &str, in_folder: &str) -> Result<Option<Blob>> {
        match self {
            Self::Archive(entries) => Ok(entries.get(in_archive).cloned()),
            Self::Folder(root) => Ok(inside(root, in_folder)?.map(Blob::File)),
        }
    }
}

pub(super) fn read(path: &Path, _options: &ImportOptions) -> Result<Capture> {
    let files = Files::of(path)?;
    let Some(metadata) = files.get("metadata", "metadata.json")? else {
        return Err(Error::format(path, "metadata", "is not in the archive; was it copied as a whole?"));
    };
    let text = String::from_utf8(metadata.read()?).map_err(|_| metadata.fault("is not UTF-8 text"))?;
    let metadata: Metadata = crate::json::parse(&text, metadata.file())?;
    if metadata.poses.is_empty() {
        return Err(Error::format(path, "metadata: poses", "there is none; was the recording stopped at once?"));
    }
    let mut notes = vec![format!("LiDAR depth of confidence {LEAST_CONFIDENCE} and more; the app records no hands")];
    let up = up(&metadata, &mut notes);
    let mut poses = Vec::new();
    let mut images = Vec::new();
    let mut depth = Vec::new();
    for (index, pose) in metadata.poses.iter().enumerate() {
        let at = metadata.at(index);
        let optics = metadata.cameras.as_ref().and_then(|c| c.get(index)).map(|f| metadata.optics(*f));
        let [a, b, c, d, x, y, z] = *pose;
        let pose = RawPose { position: [x, y, z], turn: RawRotation::Quaternion([a, b, c, d]) };
        poses.push(PoseAt { at: at.clone(), pose, optics });
        if let Some(blob) = files.get(&format!("rgbd/{index}.jpg"), &format!("rgb/{index}.jpg"))? {
            images.push(ImageAt { at: at.clone(), picture: ImageSource::Still(blob), optics });
        }
        if let Some(blob) = files.get(&format!("rgbd/{index}.depth"), &format!("depth/{index}.exr"))? {
            let confidence = files.get(&format!("rgbd/{index}.conf"), &format!("conf/{index}.png"))?;
            depth.push(DepthAt { at, blob, confidence, optics, pose: None });
        }
    }
    if images.len() < poses.len() {
        notes.push(format!("{} of {} poses have no image", poses.len() - images.len(), poses.len()));
    }
    Ok(Capture {
        kind: "record3d".to_owned(),
        source: path.to_owned(),
        title: "Record3D recording".to_owned(),
        notes,
        world: SourceWorld { up, ..SourceWorld::default() },
        optics: Some(metadata.optics(metadata.common())),
        poses: Some(Poses { axes: CameraAxes::Opengl, items: poses, ..Poses::default() }),
        images,
        depth: coded(&files, &metadata, depth)?,
        ..Capture::default()
    })
}

impl Metadata {
    fn optics(&self, f: [f64; 4]) -> Optics {
        Optics::pinhole(self.w, self.h, f)
    }

    /// fx, fy, cx, cy. K stands by columns; in one that stands by rows these places are 0.
    fn common(&self) -> [f64; 4] {
        let [fx, _, cx_by_rows, _, fy, cy_by_rows, cx, cy, _] = self.k;
        if cx == 0.0 && cy == 0.0 { [fx, fy, cx_by_rows, cy_by_rows] } else { [fx, fy, cx, cy] }
    }

    fn at(&self, index: usize) -> At {
        let told = self.times.as_ref().filter(|t| t.len() == self.poses.len()).and_then(|t| t.get(index)).copied();
        let counted = self.fps.filter(|f| f.is_finite() && *f > 0.0).map(|f| index as f64 / f);
        At { time_secs: told.or(counted), name: None, index: Some(index) }
    }
}

/// ARKit's world has y up. Poses that begin at no turn are told against the first camera, however it was held.
fn up(metadata: &Metadata, notes: &mut Vec<String>) -> Option<Vector> {
    let turn = |p: &[f64; 7]| {
        let [a, b, c, d, ..] = *p;
        quaternion([a, b, c, d], QuaternionOrder::Xyzw)
    };
    let first = metadata.poses.first().and_then(turn)?;
    let is_other = metadata.first_pose.as_ref().and_then(turn).is_some_and(|q| q.angle_to(&first) > SAME_TURN);
    if first.angle() <= SAME_TURN || is_other {
        notes.push("poses are told against the first camera: up is found from the recording".to_owned());
        return None;
    }
    Some(Vector::y())
}

/// Depth with its coding. Whether depth is packed is seen at its first bytes.
fn coded(files: &Files, metadata: &Metadata, mut items: Vec<DepthAt>) -> Result<Option<Depth>> {
    let Some(first) = items.first() else { return Ok(None) };
    let coding = match files {
        Files::Folder(_) => DepthCoding::Exr,
        Files::Archive(_) => {
            if is_packed(&first.blob) {
                items.iter_mut().for_each(|item| unpack(&mut item.blob));
            }
            if items.iter().find_map(|i| i.confidence.as_ref()).is_some_and(is_packed) {
                items.iter_mut().filter_map(|item| item.confidence.as_mut()).for_each(unpack);
            }
            let (width, height) = size(metadata, &items)?;
            DepthCoding::RawF32 { width, height, order: ByteOrder::Little }
        }
    };
    Ok(Some(Depth { least_confidence: LEAST_CONFIDENCE, ..Depth::of(coding, items) }))
}

/// LZFSE's blocks begin so.
fn is_packed(blob: &Blob) -> bool {
    blob.read().is_ok_and(|bytes| bytes.starts_with(b"bvx"))
}

fn unpack(blob: &mut Blob) {
    let outer = Box::new(blob.clone());
    *blob = Blob::Packed { outer, packing: Packing::Lzfse, start: 0, length: None };
}

/// Columns and rows of depth: as told, else of the image's shape with as many pixels as the first image of depth has.
fn size(metadata: &Metadata, items: &[DepthAt]) -> Result<(usize, usize)> {
    if let (Some(width), Some(height)) = (metadata.dw, metadata.dh) {
        return Ok((width, height));
    }
    let read = items.iter().find_map(|i| i.blob.read().ok());
    let pixels = read.map_or(0, |bytes| bytes.len() / 4);
    let width = (pixels as f64 * metadata.w as f64 / (metadata.h as f64).max(1.0)).sqrt().round() as usize;
    let height = pixels.checked_div(width).unwrap_or(0);
    if width * height == pixels && pixels > 0 {
        return Ok((width, height));
    }
    let path = items.first().map_or(Path::new("metadata"), |i| i.blob.file());
    let message = format!("dw and dh are not there, and {pixels} pixels have not the shape of the images");
    Err(Error::format(path, "metadata", message))
}
