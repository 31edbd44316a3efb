//! Episodes of the Stera SDK (iPhone Pro): a folder with `annotation.hdf5`, `rgb.mp4` and `calibrations/`.
//!
//! Poses are those of a body (x forward, y up, z to the right) in a world whose y is up; `R_optical_to_link.npy` turns the
//! camera into it. Depth is in millimetres. Hands are in the camera's frame where a tracker with depth found them.

use std::path::{Path, PathBuf};

use nalgebra::{Matrix3, Rotation3, UnitQuaternion};
use serde::Deserialize;

use crate::error::{Error, Result};
use crate::import::ImportOptions;
use crate::import::blob::{Blob, beside};
use crate::import::capture::{
    At, ByteOrder, CameraAxes, Capture, Depth, DepthAt, DepthCoding, HandAt, HandStream, ImageAt, ImageSource,
    JointFrame, PoseAt, Poses, RawPose, RawRotation, SourceWorld,
};
use crate::import::h5::{Hdf5, is_hdf5};
use crate::import::joint_orders::JointOrder;
use crate::import::optics::Optics;
use crate::math::{Pose, Vector};
use crate::recording::Side;

const ANNOTATION: &str = "annotation.hdf5";
/// The camera in its body where no file tells it: x right to z, y down to -y, z forward to x.
const OPTICAL_TO_LINK: [f64; 9] = [0.0, 0.0, 1.0, 0.0, -1.0, 0.0, 1.0, 0.0, 0.0];

fn annotation(path: &Path) -> PathBuf {
    if path.is_dir() { path.join(ANNOTATION) } else { path.to_owned() }
}

pub(super) fn detect(path: &Path) -> bool {
    let file = annotation(path);
    let is_named = file.file_name().is_some_and(|n| n == ANNOTATION);
    is_named && is_hdf5(&file) && Hdf5::open(&file).is_ok_and(|h5| h5.has("cam-pose/translations"))
}

pub(super) fn read(path: &Path, options: &ImportOptions) -> Result<Capture> {
    if path.extension().is_some_and(|e| e == "mcap") {
        return super::mcap::read(path, options);
    }
    let file = annotation(path);
    let h5 = Hdf5::open(&file)?;
    let mut notes = Vec::new();
    let calibration = SteraCalibration::of(&file)?;
    let times = times(&h5)?;
    let images = match beside(&file, "rgb.mp4")? {
        Some(video) => pictures(&video, &times),
        None => Vec::new(),
    };
    if images.len() < times.len() && !images.is_empty() {
        notes.push(format!("{} pictures of rgb.mp4 have no time", times.len() - images.len()));
    }
    if calibration.is_none() {
        notes.push(
            "calibrations/ is not there: give --camera; the camera's place in its body is the SDK's usual one"
                .to_owned(),
        );
    }
    let body = calibration.as_ref().and_then(|c| c.body_from_camera).unwrap_or_else(|| turned(&OPTICAL_TO_LINK));
    Ok(Capture {
        kind: "stera".to_owned(),
        source: path.to_owned(),
        title: "episode of the Stera SDK".to_owned(),
        world: SourceWorld { up: Some(Vector::y()), ..SourceWorld::default() },
        optics: calibration.as_ref().and_then(|c| c.color),
        poses: Some(Poses { items: poses(&h5)?, body_from_camera: Some(body), ..Poses::default() }),
        images,
        depth: depth(&h5, &file, calibration.as_ref().and_then(|c| c.depth))?,
        hands: hands(&h5, &times, &mut notes)?,
        notes,
        ..Capture::default()
    })
}

/// A rotation of nine numbers, row by row, as a pose.
fn turned(rows: &[f64; 9]) -> Pose {
    let turn = Rotation3::from_matrix_unchecked(Matrix3::from_row_slice(rows));
    Pose::from_parts(Vector::zeros().into(), UnitQuaternion::from_rotation_matrix(&turn))
}

/// The video's pictures in time, seconds; `None` where a picture has none.
fn times(h5: &Hdf5) -> Result<Vec<Option<f64>>> {
    if h5.has("hand-pose/timestamps") {
        return Ok(h5.numbers("hand-pose/timestamps", &[None])?.into_iter().map(Some).collect());
    }
    if !h5.has("depth/timestamps") {
        return Ok(Vec::new());
    }
    let times = h5.numbers("depth/timestamps", &[None])?;
    let valid = h5.flags("depth/valid")?;
    Ok(times.into_iter().zip(valid).map(|(t, is_valid)| is_valid.then_some(t)).collect())
}

fn pictures(video: &Path, times: &[Option<f64>]) -> Vec<ImageAt> {
    let pictures = times.iter().enumerate().filter_map(|(index, t)| {
        let picture = ImageSource::Video { file: video.to_owned(), index, upright: false };
        Some(ImageAt { at: At::time((*t)?).with_index(index), picture, optics: None })
    });
    pictures.collect()
}

fn poses(h5: &Hdf5) -> Result<Vec<PoseAt>> {
    let times = h5.numbers("cam-pose/timestamps", &[None])?;
    let count = Some(times.len() as u64);
    let positions = h5.numbers("cam-pose/translations", &[count, Some(3)])?;
    let turns = h5.numbers("cam-pose/rotations", &[count, Some(3), Some(3)])?;
    if times.is_empty() {
        return Err(h5.fault("cam-pose", "holds no poses; did the app lose track from the start on?"));
    }
    let poses = times.iter().zip(positions.chunks_exact(3)).zip(turns.chunks_exact(9)).filter_map(|((t, p), r)| {
        let (&[x, y, z], &[a, b, c, d, e, f, g, h, i]) = (p, r) else { return None };
        let pose = RawPose { position: [x, y, z], turn: RawRotation::Matrix([[a, b, c], [d, e, f], [g, h, i]]) };
        Some(PoseAt { at: At::time(*t), pose, optics: None })
    });
    Ok(poses.collect())
}

fn depth(h5: &Hdf5, file: &Path, optics: Option<Optics>) -> Result<Option<Depth>> {
    if !h5.has("depth/frames") {
        return Ok(None);
    }
    let shape = h5.shape("depth/frames")?;
    let &[rows, height, width] = shape.as_slice() else {
        return Err(h5.fault("depth/frames", format!("has shape {shape:?}, expected [frames, rows, columns]")));
    };
    let times = h5.numbers("depth/timestamps", &[Some(rows)])?;
    let valid = h5.flags("depth/valid")?;
    let items = (0..rows).zip(times.iter().zip(&valid)).filter(|(_, (_, is_valid))| **is_valid).map(|(row, (t, _))| {
        let blob = Blob::Counts { file: file.to_owned(), dataset: "depth/frames".to_owned(), row };
        DepthAt { at: At::time(*t), blob, confidence: None, optics: None, pose: None }
    });
    let (width, height) = (width as usize, height as usize);
    Ok(Some(Depth {
        optics,
        ..Depth::of(DepthCoding::RawU16 { width, height, order: ByteOrder::Little, unit_m: 1e-3 }, items.collect())
    }))
}

/// Hands of a tracker that knows depth; those of the image alone are no places.
fn hands(h5: &Hdf5, times: &[Option<f64>], notes: &mut Vec<String>) -> Result<Option<HandStream>> {
    if !h5.has("hand-pose/left_joints") {
        return Ok(None);
    }
    let frame = h5.text("hand-pose", "coord_frame").unwrap_or_default();
    if frame != "camera_3d" {
        notes.push(format!("hands are in \"{frame}\", not in camera_3d, and left out: they have no distance"));
        return Ok(None);
    }
    let count = times.len() as u64;
    let mut items = Vec::new();
    for (side, name) in [(Side::Left, "left"), (Side::Right, "right")] {
        let joints = h5.numbers(&format!("hand-pose/{name}_joints"), &[Some(count), Some(21), Some(3)])?;
        let valid = h5.flags(&format!("hand-pose/{name}_valid"))?;
        let scores = h5.numbers(&format!("hand-pose/{name}_confidence"), &[Some(count)])?;
        let rows = joints.chunks_exact(63).zip(valid).zip(scores).zip(times).enumerate();
        for (index, (((row, is_valid), score), time)) in rows {
            let (true, Some(time)) = (is_valid, time) else { continue };
            let joints = row.chunks_exact(3).map(|p| p.try_into().ok()).collect();
            let score = Some(score).filter(|s| s.is_finite());
            items.push(HandAt { at: At::time(*time).with_index(index), side, joints, contact: None, score });
        }
    }
    let frame = JointFrame::Camera(CameraAxes::Opencv);
    Ok(Some(HandStream { frame, order: JointOrder::Mano, unit_m: 1.0, items }))
}

/// What `calibrations/` tells.
struct SteraCalibration {
    color: Option<Optics>,
    depth: Option<Optics>,
    body_from_camera: Option<Pose>,
}

#[derive(Deserialize)]
struct Meta {
    rgb: Option<Size>,
    depth: Option<Size>,
}

#[derive(Deserialize)]
struct Size {
    width: usize,
    height: usize,
}

impl SteraCalibration {
    fn of(file: &Path) -> Result<Option<Self>> {
        let Some(meta) = beside(file, "calibrations/meta.json")? else { return Ok(None) };
        let meta: Meta = crate::json::read(&meta)?;
        let camera = |size: Option<Size>, name: &str| -> Result<Option<Optics>> {
            let (Some(size), Some(k)) = (size, matrix(file, name)?) else { return Ok(None) };
            Ok(Some(Optics::pinhole(size.width, size.height, [k[0], k[4], k[2], k[5]])))
        };
        Ok(Some(Self {
            color: camera(meta.rgb, "calibrations/rgb_K.npy")?,
            depth: camera(meta.depth, "calibrations/depth_K.npy")?,
            body_from_camera: matrix(file, "calibrations/R_optical_to_link.npy")?.map(|rows| turned(&rows)),
        }))
    }
}

/// Nine numbers of a numpy file beside another file; `None` where it is not there.
fn matrix(file: &Path, name: &str) -> Result<Option<[f64; 9]>> {
    let Some(path) = beside(file, name)? else { return Ok(None) };
    let bytes = Blob::File(path.clone()).read()?;
    let wrong =
        |what: String| Error::format(&path, "matrix", format!("{what}; expected 3 x 3 numbers of type float64"));
    let array = npyz::NpyFile::new(bytes.as_slice()).map_err(|e| wrong(e.to_string()))?;
    let is_c = array.order() == npyz::Order::C;
    let numbers: Vec<f64> = array.into_vec().map_err(|e| wrong(e.to_string()))?;
    match <[f64; 9]>::try_from(numbers) {
        Ok(rows) if is_c && rows.iter().all(|x| x.is_finite()) => Ok(Some(rows)),
        Ok(_) => Err(wrong("holds numbers that are not finite, or in Fortran's order".to_owned())),
        Err(numbers) => Err(wrong(format!("holds {} numbers", numbers.len()))),
    }
}
