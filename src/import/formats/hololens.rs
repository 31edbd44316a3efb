//! HoloLens 2, the recordings of HoloLens2ForCV's StreamRecorder: `*_pv.txt`, `PV` and `Depth Long Throw` (folders or tar
//! archives), `*_eye.csv`.
//!
//! The colour camera has OpenGL axes, the depth camera OpenCV's; the world's up is +Y; metres; ticks of 100 ns since 1601. Depth is
//! the distance along rays that a table lists pixel by pixel. Pixels count from the corner of the first one.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use nalgebra::{Matrix4, Vector4};

use crate::error::{Error, Result};
use crate::import::blob::{Blob, files};
use crate::import::capture::{
    Along, At, CameraAxes, Capture, Depth, DepthAt, DepthCoding, HandAt, HandStream, ImageAt, ImageSource, JointFrame,
    Missing, PixelCoding, PoseAt, Poses, RawPose, SourceWorld,
};
use crate::import::joint_orders::JointOrder;
use crate::import::optics::{Optics, from_corner};
use crate::import::text::{Lines, Unread, cells};
use crate::import::{ImportOptions, tar};
use crate::math::Vector;
use crate::recording::Side;

/// The depth camera for what is further than a hand; files are named by it.
const DEPTH: &str = "Depth Long Throw";
/// Seconds from 1601, which ticks count from, to 1970.
const UNIX_SECS: f64 = 11_644_473_600.0;
/// Joints of a hand.
const JOINTS: usize = 26;
/// Numbers of a matrix.
const MATRIX: usize = 16;
/// Cells of a row of hands that are read: time, head, and for each hand a flag and its joints.
const HAND_CELLS: usize = 1 + MATRIX + 2 * (1 + JOINTS * MATRIX);

/// The first file of a folder whose name has an ending, of which its own ending is a part.
fn ending(path: &Path, end: &str) -> Option<PathBuf> {
    let kind = end.rsplit('.').next().unwrap_or_default();
    files(path, &[kind]).into_iter().find(|f| f.to_string_lossy().ends_with(end))
}

pub(super) fn detect(path: &Path) -> bool {
    path.is_dir() && ending(path, "pv.txt").is_some()
}

fn secs(ticks: u64) -> f64 {
    // Whole seconds first: all digits of a tick do not fit in one number.
    (ticks / 10_000_000) as f64 - UNIX_SECS + (ticks % 10_000_000) as f64 * 1e-7
}

pub(super) fn read(path: &Path, _options: &ImportOptions) -> Result<Capture> {
    let Some(list) = ending(path, "pv.txt") else {
        let message = "holds no *_pv.txt; point at the folder of one recording";
        return Err(Error::Io { path: path.to_owned(), message: message.to_owned() });
    };
    let mut notes = Vec::new();
    let images = by_ticks(path, &["PV", "rgb"], &["png", "jpg", "bytes"])?;
    let mut dropped = Vec::new();
    let (poses, images) = posed(&list, &images, &mut dropped)?;
    let optics = poses.iter().find_map(|p| p.optics);
    let hands = match ending(path, "_eye.csv") {
        Some(file) => hands(&file)?,
        None => Vec::new(),
    };
    let depth = depth(path, &mut notes)?;
    let missing = images.is_empty().then(|| Missing {
        what: "images".to_owned(),
        why: "neither PV.tar nor a folder PV with the camera's images is there".to_owned(),
        command: "download all files of the recording (recorder_console.py of StreamRecorder)".to_owned(),
    });
    Ok(Capture {
        kind: "hololens".to_owned(),
        source: path.to_owned(),
        title: "HoloLens 2 recording (StreamRecorder)".to_owned(),
        notes,
        dropped,
        clock: Some("unix".to_owned()),
        world: SourceWorld { up: Some(Vector::y()), ..SourceWorld::default() },
        optics,
        poses: Some(Poses { axes: CameraAxes::Opengl, items: poses, ..Poses::default() }),
        images,
        depth,
        hands: (!hands.is_empty()).then_some(HandStream {
            frame: JointFrame::World,
            order: JointOrder::Openxr,
            unit_m: 1.0,
            items: hands,
        }),
        missing: missing.into_iter().collect(),
        ..Capture::default()
    })
}

/// Files that are named by their ticks, of the first folder or archive of these names that has some.
fn by_ticks(path: &Path, names: &[&str], endings: &[&str]) -> Result<BTreeMap<u64, (String, Blob)>> {
    let mut out = BTreeMap::new();
    for name in names {
        let mut found: Vec<(String, Blob)> = files(&path.join(name), endings)
            .into_iter()
            .filter_map(|f| Some((f.file_name()?.to_string_lossy().into_owned(), Blob::File(f))))
            .collect();
        let archive = path.join(format!("{name}.tar"));
        if found.is_empty() && archive.is_file() {
            found = tar::entries(&archive)?;
        }
        for (name, blob) in found {
            let Some((stem, kind)) = name.rsplit_once('.') else { continue };
            let stem = stem.rsplit(['/', '\\']).next().unwrap_or(stem);
            if let (Ok(ticks), true) = (stem.parse::<u64>(), endings.contains(&kind)) {
                // An image that was converted lies beside its raw bytes: the converted one counts, it is listed last.
                out.insert(ticks, (kind.to_owned(), blob));
            }
        }
        if !out.is_empty() {
            break;
        }
    }
    Ok(out)
}

/// A whole number that is a count of ticks.
fn ticks(lines: &Lines, cell: Option<&&str>) -> Result<u64> {
    let cell = cell.copied().unwrap_or_default().trim();
    cell.parse().map_err(|_| {
        let start: String = cell.chars().take(40).collect();
        lines.fault(format!("time: \"{start}\" is not a count of 100 ns"))
    })
}

/// Numbers of some cells.
fn numbers<const N: usize>(lines: &Lines, cells: &[&str], first: usize) -> Result<[f64; N]> {
    let mut out = [0.0; N];
    for (i, value) in out.iter_mut().enumerate() {
        let Some(cell) = cells.get(first + i) else {
            return Err(lines.fault(format!("{} cells, expected {} or more", cells.len(), first + N)));
        };
        *value = lines.number(&format!("cell {}", first + i + 1), cell)?;
    }
    Ok(out)
}

/// The colour camera's poses, and its images where they are there.
fn posed(
    list: &Path,
    found: &BTreeMap<u64, (String, Blob)>,
    dropped: &mut Vec<String>,
) -> Result<(Vec<PoseAt>, Vec<ImageAt>)> {
    let mut lines = Lines::open(list)?;
    let Some(first) = lines.content()? else {
        return Err(lines.fault("the file is empty; expected the principal point and the size first"));
    };
    let [ox, oy, w, h]: [f64; 4] = numbers(&lines, &cells(&first), 0)?;
    if !(1.0..=65_536.0).contains(&w) || !(1.0..=65_536.0).contains(&h) {
        return Err(lines.fault(format!("{w} x {h} is no size of an image")));
    }
    let (width, height) = (w as usize, h as usize);
    let (mut poses, mut images) = (Vec::new(), Vec::new());
    let mut unread = Unread::default();
    while let Some(line) = lines.content()? {
        let Some((ticks, [fx, fy], matrix)) = unread.keep(picture_row(&lines, &line)) else { continue };
        let optics = Optics::pinhole(width, height, [fx, fy, from_corner(ox), from_corner(oy)]);
        let at = At::time(secs(ticks));
        // A camera that lost its place has a matrix of zeros, which is told as no rigid transform.
        let Some(pose) = RawPose::from_rows(&matrix) else { continue };
        poses.push(PoseAt { at: at.clone(), pose, optics: Some(optics) });
        if let Some((kind, blob)) = found.get(&ticks) {
            let picture = match kind.as_str() {
                "bytes" => ImageSource::Raw { blob: blob.clone(), width, height, coding: PixelCoding::Bgra },
                _ => ImageSource::Still(blob.clone()),
            };
            images.push(ImageAt { at, picture, optics: Some(optics) });
        }
    }
    dropped.extend(unread.told("poses", poses.len())?);
    if poses.is_empty() {
        return Err(lines.fault("there is no pose of the camera; was the recording stopped at once?"));
    }
    Ok((poses, images))
}

/// Ticks, focal lengths and the matrix of a row of the colour camera.
fn picture_row(lines: &Lines, line: &str) -> Result<(u64, [f64; 2], [f64; MATRIX])> {
    let cells = cells(line);
    Ok((ticks(lines, cells.first())?, numbers(lines, &cells, 1)?, numbers(lines, &cells, 3)?))
}

/// Joints of tracked hands, world.
fn hands(file: &Path) -> Result<Vec<HandAt>> {
    let mut lines = Lines::open(file)?;
    let mut out = Vec::new();
    while let Some(line) = lines.content()? {
        let cells = cells(&line);
        if cells.len() < HAND_CELLS {
            return Err(lines.fault(format!(
                "{} cells, expected {HAND_CELLS} or more; a file that ends early is a copy that was not finished",
                cells.len()
            )));
        }
        let at = At::time(secs(ticks(&lines, cells.first())?));
        for (side, flag) in [(Side::Left, 1 + MATRIX), (Side::Right, 2 + MATRIX + JOINTS * MATRIX)] {
            let [is_there]: [f64; 1] = numbers(&lines, &cells, flag)?;
            if is_there != 1.0 {
                continue;
            }
            let mut joints = Vec::with_capacity(JOINTS);
            for joint in 0..JOINTS {
                let m: [f64; MATRIX] = numbers(&lines, &cells, flag + 1 + joint * MATRIX)?;
                let [_, _, _, x, _, _, _, y, _, _, _, z, ..] = m;
                joints.push(Some([x, y, z]));
            }
            out.push(HandAt { at: at.clone(), side, joints, contact: None, score: None });
        }
    }
    Ok(out)
}

/// Rows of a 4 x 4 matrix as one.
fn matrix(rows: &[f64; MATRIX]) -> Matrix4<f64> {
    Matrix4::from_row_slice(rows)
}

/// The long-throw camera's images, each with its own pose; `None` where files of it are not there.
fn depth(path: &Path, notes: &mut Vec<String>) -> Result<Option<Depth>> {
    let images = by_ticks(path, &[DEPTH], &["pgm"])?;
    let table = path.join(format!("{DEPTH}_lut.bin"));
    let placed = ["extrinsics", "rig2world"].map(|n| path.join(format!("{DEPTH}_{n}.txt")));
    let lacks = std::iter::once(&table).chain(&placed).find(|f| !f.is_file());
    if images.is_empty() || lacks.is_some() {
        let lacks = lacks.map(|f| f.file_name().unwrap_or_default().to_string_lossy().into_owned());
        notes.push(format!("no depth: {} is not there", lacks.unwrap_or_else(|| format!("{DEPTH}.tar"))));
        return Ok(None);
    }
    let [extrinsics, rig2world] = placed;
    let camera_from_rig = single(&extrinsics)?;
    let Some(rig_from_camera) = camera_from_rig.try_inverse() else {
        return Err(Error::format(&extrinsics, "matrix", "is not that of a rigid transform"));
    };
    // The poses' cameras have OpenGL axes, this one OpenCV's.
    let axes = Matrix4::from_diagonal(&Vector4::new(1.0, -1.0, -1.0, 1.0));
    let mut lines = Lines::open(&rig2world)?;
    let mut items = Vec::new();
    while let Some(line) = lines.content()? {
        let cells = cells(&line);
        let ticks = ticks(&lines, cells.first())?;
        let world_from_rig = matrix(&numbers(&lines, &cells, 1)?);
        let Some((_, blob)) = images.get(&ticks) else { continue };
        let rows: Vec<f64> = (world_from_rig * rig_from_camera * axes).transpose().iter().copied().collect();
        let pose = RawPose::from_rows(&rows);
        items.push(DepthAt { at: At::time(secs(ticks)), blob: blob.clone(), confidence: None, optics: None, pose });
    }
    if items.len() < images.len() {
        notes.push(format!("{} depth images have no pose and were left out", images.len() - items.len()));
    }
    let depth =
        Depth { along: Along::Ray, rays: Some(rays(&table)?), ..Depth::of(DepthCoding::Pgm16 { unit_m: 1e-3 }, items) };
    Ok((!depth.items.is_empty()).then_some(depth))
}

/// The one matrix of a file.
fn single(path: &Path) -> Result<Matrix4<f64>> {
    let mut lines = Lines::open(path)?;
    let Some(line) = lines.content()? else { return Err(lines.fault("the file is empty; expected 16 numbers")) };
    Ok(matrix(&numbers(&lines, &cells(&line), 0)?))
}

/// Directions of the pixels; zeros where the camera sees nothing.
fn rays(path: &Path) -> Result<Arc<[[f32; 3]]>> {
    let bytes = Blob::File(path.to_owned()).read()?;
    let number = |b: &[u8]| <[u8; 4]>::try_from(b).map_or(f32::NAN, f32::from_le_bytes);
    let ray = |b: &[u8]| std::array::from_fn(|i| number(b.get(4 * i..4 * i + 4).unwrap_or_default()));
    if bytes.is_empty() || !bytes.len().is_multiple_of(12) {
        let message = format!("{} bytes are no table of directions of three float32 each", bytes.len());
        return Err(Error::format(path, "size", message));
    }
    Ok(bytes.chunks_exact(12).map(ray).collect())
}
