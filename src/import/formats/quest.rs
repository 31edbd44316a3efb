//! Quest 3 and 3S, recordings of QuestRealityCapture: `hmd_poses.csv`, the left camera of either backend, `left_depth`.
//!
//! World and cameras are Unity's (left-handed, +Y up, metres). The MRUK backend poses its images one by one; with the other one
//! the headset is posed and the camera's characteristics tell where it sits on it. Depth is a renderer's buffer with a pose and a
//! field of view of its own. All times become the headset's running clock, which its files have beside the date.

use std::path::{Path, PathBuf};

use nalgebra::{Matrix3, Quaternion, Rotation3, UnitQuaternion};
use serde_json::Value;

use crate::error::{Error, Result};
use crate::import::blob::{Blob, files, inside};
use crate::import::capture::{
    At, CameraAxes, Capture, Depth, DepthAt, DepthCoding, ImageAt, ImageSource, Missing, PixelCoding, PoseAt, Poses,
    QuaternionOrder, RawPose, RawRotation, SourceWorld,
};
use crate::import::optics::{Optics, from_corner};
use crate::import::text::{TableRow, TextTable, Unread};
use crate::import::{ImportOptions, axes};
use crate::math::{Pose, Vector, stats};

/// The clock of the headset since it was switched on, which streamed hands have too.
pub(super) const CLOCK: &str = "quest running clock";
const HEAD: &str = "hmd_poses.csv";
const DEPTH: &str = "left_depth_descriptors.csv";
const MRUK: &str = "left_camera_mruk_frame_metadata.csv";

pub(super) fn detect(path: &Path) -> bool {
    path.join(HEAD).is_file()
        && [MRUK, DEPTH, "left_camera_characteristics.json"].iter().any(|n| path.join(n).is_file())
}

/// What is posed, and the images.
struct QuestStreams {
    poses: Poses,
    optics: Optics,
    images: Vec<ImageAt>,
}

pub(super) fn read(path: &Path, _options: &ImportOptions) -> Result<Capture> {
    let mut notes = Vec::new();
    let mut dropped = Vec::new();
    let (head, offset) = head(&path.join(HEAD), &mut dropped)?;
    let seen = if path.join(MRUK).is_file() {
        mruk(path, offset, &mut notes, &mut dropped)?
    } else {
        characterised(path, head, offset, &mut notes)?
    };
    let depth = if path.join(DEPTH).is_file() { depth(path, offset, &mut notes)? } else { None };
    let missing = |what: &str, why: &str, command: &str| Missing {
        what: what.to_owned(),
        why: why.to_owned(),
        command: command.to_owned(),
    };
    let mut lacks = vec![missing(
        "hands",
        "the app records no hands",
        "run a hand tracker on DIR/frames and import its hands as JSON lines too, with the timestamps of DIR/cameras.json as time",
    )];
    if seen.images.is_empty() {
        lacks.push(missing(
            "images",
            "no images of the left camera are there",
            "switch the camera on in recording_config.json",
        ));
    }
    Ok(Capture {
        kind: "quest".to_owned(),
        source: path.to_owned(),
        title: "Quest recording (QuestRealityCapture), left camera".to_owned(),
        notes,
        dropped,
        clock: Some(CLOCK.to_owned()),
        world: SourceWorld { up: Some(Vector::y()), unit_m: Some(1.0), left_handed: true },
        optics: Some(seen.optics),
        poses: Some(seen.poses),
        images: seen.images,
        depth,
        missing: lacks,
        ..Capture::default()
    })
}

fn unity(items: Vec<PoseAt>, body_from_camera: Option<Pose>) -> Poses {
    Poses { axes: CameraAxes::Unity, body_from_camera, items, ..Poses::default() }
}

/// Poses of the headset, and what is added to seconds since 1970 to be the running clock's.
fn head(path: &Path, dropped: &mut Vec<String>) -> Result<(Vec<PoseAt>, f64)> {
    let mut table = TextTable::open(path)?;
    table.need(&["unix_time", "ovr_timestamp", "pos_x", "pos_y", "pos_z", "rot_x", "rot_y", "rot_z", "rot_w"])?;
    let (mut items, mut offsets) = (Vec::new(), Vec::new());
    let mut unread = Unread::default();
    while let Some(row) = table.row()? {
        let times = row.numbers(["unix_time", "ovr_timestamp"]);
        let pose = row.numbers(["pos_x", "pos_y", "pos_z", "rot_x", "rot_y", "rot_z", "rot_w"]);
        let both = unread.keep(times.and_then(|times| Ok((times, pose?))));
        let Some(([unix_ms, running], [x, y, z, a, b, c, d])) = both else { continue };
        offsets.push(running - unix_ms * 1e-3);
        let (position, turn) = ([x, y, z], RawRotation::Quaternion([a, b, c, d]));
        items.push(PoseAt { at: At::time(running), pose: RawPose { position, turn }, optics: None });
    }
    dropped.extend(unread.told("poses of the headset", items.len())?);
    // Milliseconds are cut, not rounded, here as in the names of images: the median holds for both.
    let Some(offset) = stats::median(&offsets) else {
        return Err(Error::format(path, "rows", "there is no pose; was the recording stopped at once?"));
    };
    Ok((items, offset))
}

/// A number of a JSON file by its way.
fn number(json: &Value, path: &Path, way: &[&str]) -> Result<f64> {
    let value = way.iter().fold(json, |value, key| &value[*key]);
    let said = || Error::format(path, way.join("."), "expected a number");
    value.as_f64().filter(|n| n.is_finite()).ok_or_else(said)
}

/// Whether a cell says yes.
fn is_true(cell: &str) -> bool {
    cell.eq_ignore_ascii_case("true") || cell == "1"
}

/// Images of the MRUK backend, each with its camera's pose; the first row of a file is the lowest one.
fn mruk(path: &Path, offset: f64, notes: &mut Vec<String>, dropped: &mut Vec<String>) -> Result<QuestStreams> {
    let file = path.join("left_camera_mruk_intrinsics.json");
    let json: Value = crate::json::read(&file)?;
    let of = |a: &str, b: &str| number(&json, &file, &[a, b]);
    let (w, h) = (of("resolution", "width")?.max(0.0) as usize, of("resolution", "height")?.max(0.0) as usize);
    let center = [of("principalPoint", "x")?, of("principalPoint", "y")?].map(from_corner);
    let optics = Optics::pinhole(w, h, [of("focalLength", "x")?, of("focalLength", "y")?, center[0], center[1]]);
    if let Some(fault) = optics.fault() {
        return Err(Error::format(&file, "intrinsics", fault));
    }
    let mut table = TextTable::open(&path.join(MRUK))?;
    table.need(&["file_name", "timestamp_us_realtime", "width", "height", "pose_ok"])?;
    let (position, rotation) =
        (["pose_pos_x", "pose_pos_y", "pose_pos_z"], ["pose_rot_x", "pose_rot_y", "pose_rot_z", "pose_rot_w"]);
    table.need(&position)?;
    table.need(&rotation)?;
    let (mut items, mut images) = (Vec::new(), Vec::new());
    let mut lost = 0;
    let mut unread = Unread::default();
    while let Some(row) = table.row()? {
        if !is_true(row.text("pose_ok")) {
            lost += 1;
            continue;
        }
        let posed = || {
            let at = At::time(row.number("timestamp_us_realtime")? * 1e-6 + offset);
            let turn = RawRotation::Quaternion(row.numbers(rotation)?);
            Ok::<_, Error>((at, RawPose { position: row.numbers(position)?, turn }))
        };
        let Some((at, pose)) = unread.keep(posed()) else { continue };
        items.push(PoseAt { at: at.clone(), pose, optics: None });
        let (width, height) = (row.whole("width")?, row.whole("height")?);
        let name = row.text("file_name");
        if name.is_empty() {
            continue;
        }
        if let Some(file) = inside(path, &format!("left_camera_mruk_rgba/{name}"))? {
            let coding = PixelCoding::Rgba { is_bottom_up: true };
            let picture = ImageSource::Raw { blob: Blob::File(file), width, height, coding };
            images.push(ImageAt { at, picture, optics: None });
        }
    }
    if lost > 0 {
        notes.push(format!("{lost} images have no pose and were left out"));
    }
    dropped.extend(unread.told("poses of images", items.len())?);
    Ok(QuestStreams { poses: unity(items, None), optics, images })
}

/// The headset's poses and the camera on it, of Android's characteristics.
fn characterised(path: &Path, head: Vec<PoseAt>, offset: f64, notes: &mut Vec<String>) -> Result<QuestStreams> {
    let file = path.join("left_camera_characteristics.json");
    if !file.is_file() {
        return depth_alone(path, head, notes);
    }
    let json: Value = crate::json::read(&file)?;
    let of = |way: &[&str]| number(&json, &file, way);
    let side = |a: &str, b: &str| {
        let length = of(&["sensor", "activeArraySize", b])? - of(&["sensor", "activeArraySize", a])?;
        Ok::<usize, Error>(length.max(0.0) as usize)
    };
    let (width, height) = (side("left", "right")?, side("top", "bottom")?);
    let [fx, fy, cx, cy] = ["fx", "fy", "cx", "cy"].map(|k| of(&["intrinsics", k]));
    let optics = Optics::pinhole(width, height, [fx?, fy?, from_corner(cx?), from_corner(cy?)]);
    if let Some(fault) = optics.fault() {
        return Err(Error::format(&file, "intrinsics", fault));
    }
    let list = |key: &str| -> Vec<f64> {
        json["pose"][key].as_array().into_iter().flatten().filter_map(Value::as_f64).collect()
    };
    let (translation, rotation) = (list("translation"), list("rotation"));
    let ([x, y, z], [qx, qy, qz, qw]) = (translation.as_slice(), rotation.as_slice()) else {
        return Err(Error::format(&file, "pose", "expected a translation of three numbers and a rotation of four"));
    };
    let Some(body_from_camera) = lens([*x, *y, *z], [*qx, *qy, *qz, *qw]) else {
        return Err(Error::format(&file, "pose.rotation", "has not the length 1"));
    };
    let mut images = Vec::new();
    for (ms, picture) in android_images(path, notes)? {
        images.push(ImageAt { at: At::time(ms * 1e-3 + offset), picture, optics: None });
    }
    Ok(QuestStreams { poses: unity(head, Some(body_from_camera)), optics, images })
}

/// The camera (OpenCV axes) on the headset (OpenCV axes) from Android's lens pose: right-handed with +Y up and -Z ahead, the
/// rotation being into the camera, whose own axes are turned by half a turn about X.
fn lens([x, y, z]: [f64; 3], [qx, qy, qz, qw]: [f64; 4]) -> Option<Pose> {
    axes::quaternion([qx, qy, qz, qw], QuaternionOrder::Xyzw)?;
    // In Unity's axes, where z is mirrored.
    let into_camera = UnitQuaternion::from_quaternion(Quaternion::new(qw, -qx, -qy, qz));
    let half_turn = UnitQuaternion::from_scaled_axis(Vector::x() * std::f64::consts::PI);
    let turn = (into_camera.inverse() * half_turn).to_rotation_matrix().into_inner();
    // Unity's y is up, OpenCV's down, of the headset and of the camera.
    let flip: Matrix3<f64> = axes::camera_matrix(CameraAxes::Unity);
    let turn = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(flip * turn * flip));
    Some(Pose::from_parts((flip * Vector::new(x, y, -z)).into(), turn))
}

/// Images of the other backend with their times, milliseconds since 1970: converted ones, else the raw planes.
fn android_images(path: &Path, notes: &mut Vec<String>) -> Result<Vec<(f64, ImageSource)>> {
    let time = |file: &PathBuf| file.file_stem()?.to_str()?.parse::<f64>().ok().filter(|t| t.is_finite());
    let stills = files(&path.join("left_camera_rgb"), &["png", "jpg"]);
    if !stills.is_empty() {
        return Ok(stills.into_iter().filter_map(|f| Some((time(&f)?, ImageSource::Still(Blob::File(f))))).collect());
    }
    let raw = files(&path.join("left_camera_raw"), &["yuv"]);
    let file = path.join("left_camera_image_format.json");
    if raw.is_empty() || !file.is_file() {
        return Ok(Vec::new());
    }
    let json: Value = crate::json::read(&file)?;
    let whole = |value: &Value, place: &str| match value.as_u64() {
        Some(n) if n <= 1 << 30 => Ok(n as usize),
        _ => Err(Error::format(&file, place, "expected a whole number")),
    };
    let (width, height) = (whole(&json["width"], "width")?, whole(&json["height"], "height")?);
    let mut planes = [[0; 3]; 3];
    for (i, plane) in planes.iter_mut().enumerate() {
        let of = |key: &str| whole(&json["planes"][i][key], &format!("planes[{i}].{key}"));
        *plane = [of("bufferSize")?, of("rowStride")?, of("pixelStride")?];
    }
    let [y, u, v] = planes;
    // Differences that stand in turn are in one plane, its second half a copy or left out.
    let last = if u[2] == 2 { y[0] + 1 } else { y[0] + u[0] };
    let coding = PixelCoding::Yuv420 { offsets: [0, y[0], last], rows: [y[1], u[1], v[1]], steps: [y[2], u[2], v[2]] };
    notes.push("images are raw planes, whose second one is taken for blue".to_owned());
    let picture =
        |file: PathBuf| Some((time(&file)?, ImageSource::Raw { blob: Blob::File(file), width, height, coding }));
    Ok(raw.into_iter().filter_map(picture).collect())
}

/// Without a camera the headset looks with the depth camera's field of view; depth itself has its own poses.
fn depth_alone(path: &Path, head: Vec<PoseAt>, notes: &mut Vec<String>) -> Result<QuestStreams> {
    let mut table = TextTable::open(&path.join(DEPTH))?;
    let optics = match table.row()? {
        Some(row) => described(&row)?,
        None => return Err(Error::format(&path.join(DEPTH), "rows", "there is none, and no camera either")),
    };
    notes.push("no camera was recorded: the depth camera's view from the headset stands for it".to_owned());
    Ok(QuestStreams { poses: unity(head, None), optics, images: Vec::new() })
}

/// The depth camera of a row, from the tangents of its field of view.
fn described(row: &TableRow<'_>) -> Result<Optics> {
    let [left, right, top, down] = row.numbers([
        "fov_left_angle_tangent",
        "fov_right_angle_tangent",
        "fov_top_angle_tangent",
        "fov_down_angle_tangent",
    ])?;
    let (width, height) = (row.whole("width")?, row.whole("height")?);
    let (w, h) = (width as f64, height as f64);
    let optics = Optics::pinhole(
        width,
        height,
        [
            w / (left + right),
            h / (top + down),
            from_corner(w * left / (left + right)),
            from_corner(h * top / (top + down)),
        ],
    );
    optics.fault().map_or(Ok(optics), |fault| Err(row.fault(&fault)))
}

/// The left depth camera's images, each with its own pose; the top row first.
fn depth(path: &Path, offset: f64, notes: &mut Vec<String>) -> Result<Option<Depth>> {
    let mut table = TextTable::open(&path.join(DEPTH))?;
    table.need(&["timestamp_ms", "near_z", "far_z", "width", "height"])?;
    let position = ["x", "y", "z"].map(|c| format!("create_pose_location_{c}"));
    let rotation = ["x", "y", "z", "w"].map(|c| format!("create_pose_rotation_{c}"));
    let (position, rotation) = (position.each_ref().map(String::as_str), rotation.each_ref().map(String::as_str));
    table.need(&position)?;
    table.need(&rotation)?;
    let mut coding: Option<DepthCoding> = None;
    let mut items = Vec::new();
    let (mut others, mut lost) = (0, 0);
    while let Some(row) = table.row()? {
        let ms = row.whole("timestamp_ms")?;
        let optics = described(&row)?;
        let near_m = row.number("near_z")?;
        // A far plane without end is written as a word or as less than the near one.
        let far = row.text("far_z").parse::<f64>().ok().filter(|f| f.is_finite() && *f > near_m);
        let (width, height) = (optics.width, optics.height);
        let of = DepthCoding::BufferF32 { width, height, near_m, far_m: far.unwrap_or(f64::INFINITY) };
        if *coding.get_or_insert_with(|| of.clone()) != of {
            others += 1;
            continue;
        }
        let Some(file) = inside(path, &format!("left_depth/{ms}.raw"))? else {
            lost += 1;
            continue;
        };
        let pose = RawPose { position: row.numbers(position)?, turn: RawRotation::Quaternion(row.numbers(rotation)?) };
        items.push(DepthAt {
            at: At::time(ms as f64 * 1e-3 + offset),
            blob: Blob::File(file),
            confidence: None,
            optics: Some(optics),
            pose: Some(pose),
        });
    }
    for (count, why) in [(others, "have another size or range than the first one"), (lost, "are not in left_depth/")] {
        if count > 0 {
            notes.push(format!("{count} depth images {why} and were left out"));
        }
    }
    let Some(coding) = coding.filter(|_| !items.is_empty()) else { return Ok(None) };
    Ok(Some(Depth::of(coding, items)))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Android's rotation of a camera that looks where the headset looks is half a turn about X.
    #[test]
    fn a_lens_that_looks_ahead_is_turned_by_nothing() {
        let pose = lens([-0.03, -0.02, -0.07], [1.0, 0.0, 0.0, 0.0]).unwrap();
        assert!(pose.rotation.angle() < 1e-9, "{pose}");
        // Left, below, ahead.
        assert!((pose.translation.vector - Vector::new(-0.03, 0.02, 0.07)).norm() < 1e-12, "{pose}");
        assert!(lens([0.0; 3], [0.0; 4]).is_none());
    }
}
