//! Arti4D (ArtiPoint): a sequence's `rgb/`, `depth/`, `odom/SEQUENCE.csv`, `matched_cues.csv`.
//!
//! Poses are those of a tracker on the camera, metres; `azure_tf.json` (in the set's `meta/calibration`) leads from it to the
//! cameras. Names of images end with their time, nanoseconds. Depth is millimetres. Cues are numbers of images. Whether a
//! sequence's images were turned by 180 degrees stands in no file; the cameras' up tells it, as people hold cameras upright.

use std::path::{Path, PathBuf};

use nalgebra::UnitQuaternion;
use serde::Deserialize;

use crate::error::{Error, Result};
use crate::import::ImportOptions;
use crate::import::axes::quaternion;
use crate::import::blob::{Blob, files};
use crate::import::capture::{
    At, Capture, ClipAt, Depth, DepthAt, DepthCoding, ImageAt, ImageSource, PoseAt, Poses, QuaternionOrder, RawPose,
    RawRotation, SourceWorld,
};
use crate::import::names::{last, stem};
use crate::import::optics::{LensModel, Optics};
use crate::import::text::Unread;
use crate::import::text::{Lines, TextTable};
use crate::math::{Pose, Vector};

/// Where the calibration lies, seen from the sequence or a folder above it.
const CALIBRATION: [&str; 3] = ["azure_tf.json", "calibration/azure_tf.json", "meta/calibration/azure_tf.json"];
/// Folders above a sequence where it is looked for: SCENE, raw, the set.
const ABOVE: usize = 4;
/// Cosine between +Z and the cameras' mean up from which on +Z is taken to be up or, with images turned, down: cameras that
/// look down to a drawer lean by some 45 degrees.
const UPRIGHT: f64 = 0.5;

#[derive(Deserialize)]
struct Arti4dCalibration {
    #[serde(rename = "base_T_depth")]
    base_from_depth: Transform,
    #[serde(rename = "depth_T_rgb")]
    depth_from_rgb: Transform,
}

#[derive(Deserialize)]
struct Transform {
    rotation: Rotation,
    translation: Translation,
}

#[derive(Deserialize)]
struct Rotation {
    x: f64,
    y: f64,
    z: f64,
    w: f64,
}

#[derive(Deserialize)]
struct Translation {
    x: f64,
    y: f64,
    z: f64,
}

impl Transform {
    fn pose(&self) -> Option<Pose> {
        let (r, t) = (&self.rotation, &self.translation);
        let turn = quaternion([r.x, r.y, r.z, r.w], QuaternionOrder::Xyzw)?;
        let t = Vector::new(t.x, t.y, t.z);
        t.iter().all(|x| x.is_finite()).then(|| Pose::from_parts(t.into(), turn))
    }
}

pub(super) fn detect(path: &Path) -> bool {
    path.join("rgb/camera_info.txt").is_file() && path.join("odom").is_dir()
}

pub(super) fn read(path: &Path, _options: &ImportOptions) -> Result<Capture> {
    let (base_from_depth, depth_from_rgb) = calibration(path)?;
    let (poses, dropped) = trajectory(&odometry(path)?)?;
    let color = camera_info(&path.join("rgb/camera_info.txt"))?;
    let mut notes = Vec::new();
    let base_from_rgb = base_from_depth * depth_from_rgb;
    let (half_turn, up) = held(&poses, &base_from_rgb);
    notes.push(match (up, half_turn) {
        (Some(_), true) => "cameras are upside down, so the images are taken to be turned by 180 degrees".to_owned(),
        (Some(_), false) => "cameras are upright, so the images are taken as they are".to_owned(),
        (None, _) => "up is not told: cameras look neither along nor against +Z; --up AXIS says it".to_owned(),
    });
    let turn =
        Pose::from_parts(Vector::zeros().into(), if half_turn { about_axis() } else { UnitQuaternion::identity() });
    let images: Vec<ImageAt> = timed(&path.join("rgb"), "jpg")
        .into_iter()
        .map(|(at, file)| ImageAt { at, picture: ImageSource::Still(Blob::File(file)), optics: None })
        .collect();
    let depth: Vec<DepthAt> = timed(&path.join("depth"), "png")
        .into_iter()
        .map(|(at, file)| DepthAt { at, blob: Blob::File(file), confidence: None, optics: None, pose: None })
        .collect();
    let depth_file = path.join("depth/camera_info.txt");
    let own = if depth_file.is_file() { Some(camera_info(&depth_file)?) } else { None };
    // Depth that was brought to the colour image has its camera.
    let own = own.filter(|o| !is_same(o, &color));
    let color_from_depth = own.map(|_| turn.inverse() * depth_from_rgb.inverse() * turn);
    Ok(Capture {
        kind: "arti4d".to_owned(),
        source: path.to_owned(),
        title: "Arti4D sequence".to_owned(),
        clips: cues(path, &mut notes)?,
        notes,
        dropped: dropped.into_iter().collect(),
        world: SourceWorld { up, ..SourceWorld::default() },
        optics: Some(color),
        poses: Some(Poses { body_from_camera: Some(base_from_rgb * turn), items: poses, ..Poses::default() }),
        images,
        depth: (!depth.is_empty()).then_some(Depth {
            optics: own,
            color_from_depth,
            ..Depth::of(DepthCoding::Png16 { unit_m: 1e-3 }, depth)
        }),
        ..Capture::default()
    })
}

/// A half turn about the optical axis.
fn about_axis() -> UnitQuaternion<f64> {
    UnitQuaternion::from_scaled_axis(Vector::z() * std::f64::consts::PI)
}

/// Whether the images were turned, and up where +Z is it.
fn held(poses: &[PoseAt], base_from_rgb: &Pose) -> (bool, Option<Vector>) {
    let ups = poses.iter().filter_map(|p| match p.pose.turn {
        RawRotation::Quaternion(q) => {
            Some(quaternion(q, QuaternionOrder::Xyzw)? * base_from_rgb.rotation * -Vector::y())
        }
        _ => None,
    });
    let (sum, count) = ups.fold((Vector::zeros(), 0usize), |(sum, n), up| (sum + up, n + 1));
    let cosine = sum.z / count.max(1) as f64;
    (cosine < -UPRIGHT, (cosine.abs() >= UPRIGHT).then(Vector::z))
}

fn is_same(a: &Optics, b: &Optics) -> bool {
    let near = |x: f64, y: f64| (x - y).abs() < 1.0;
    (a.width, a.height) == (b.width, b.height)
        && near(a.fx, b.fx)
        && near(a.fy, b.fy)
        && near(a.cx, b.cx)
        && near(a.cy, b.cy)
}

/// Tracker from depth camera, and depth camera from colour camera.
fn calibration(path: &Path) -> Result<(Pose, Pose)> {
    let real = path.canonicalize().map_err(|e| Error::io(path, &e))?;
    let file = real
        .ancestors()
        .take(ABOVE + 1)
        .find_map(|folder| CALIBRATION.iter().map(|name| folder.join(name)).find(|f| f.is_file()));
    let Some(file) = file else {
        let message = "azure_tf.json is neither in it nor in calibration/ or meta/calibration/ of a folder above; it leads from \
                       the tracker to the camera: unpack arti4d-meta.zip, or put it into the sequence's folder";
        return Err(Error::format(path, "calibration", message));
    };
    let content: Arti4dCalibration = crate::json::read(&file)?;
    match (content.base_from_depth.pose(), content.depth_from_rgb.pose()) {
        (Some(a), Some(b)) => Ok((a, b)),
        (None, _) => Err(Error::format(&file, "base_T_depth", "the rotation is no unit quaternion x y z w")),
        (_, None) => Err(Error::format(&file, "depth_T_rgb", "the rotation is no unit quaternion x y z w")),
    }
}

/// The sequence's trajectory: named after it, else the only one.
fn odometry(path: &Path) -> Result<PathBuf> {
    let folder = path.join("odom");
    let found = files(&folder, &["csv"]);
    let name = path.canonicalize().map(|p| last(&p)).unwrap_or_default();
    match (found.iter().find(|f| stem(f) == name), found.as_slice()) {
        (Some(file), _) => Ok(file.clone()),
        (None, [file]) => Ok(file.clone()),
        (None, files) => {
            let message = format!("holds {} CSV files and none is {name}.csv; keep the sequence's own", files.len());
            Err(Error::Io { path: folder, message })
        }
    }
}

/// The poses, and what of them cannot be read.
fn trajectory(path: &Path) -> Result<(Vec<PoseAt>, Option<String>)> {
    let mut table = TextTable::open(path)?;
    table.need(&["timestamp", "x", "y", "z", "qx", "qy", "qz", "qw"])?;
    let mut out = Vec::new();
    let mut unread = Unread::default();
    while let Some(row) = table.row()? {
        let values = unread.keep(row.numbers(["timestamp", "x", "y", "z", "qx", "qy", "qz", "qw"]));
        let Some([t, x, y, z, a, b, c, d]) = values else { continue };
        let pose = RawPose { position: [x, y, z], turn: RawRotation::Quaternion([a, b, c, d]) };
        out.push(PoseAt { at: At::time(t), pose, optics: None });
    }
    let dropped = unread.told("poses", out.len())?;
    if out.is_empty() {
        return Err(Error::format(path, "rows", "there is none; was the sequence unpacked as a whole?"));
    }
    Ok((out, dropped))
}

/// Images by the time at the end of their names.
fn timed(folder: &Path, ending: &str) -> Vec<(At, PathBuf)> {
    let mut out: Vec<(f64, PathBuf)> =
        files(folder, &[ending]).into_iter().filter_map(|f| Some((seconds(&stem(&f))?, f))).collect();
    out.sort_by(|a, b| a.0.total_cmp(&b.0));
    out.into_iter().enumerate().map(|(i, (t, f))| (At::time(t).with_index(i).with_name(&last(&f)), f)).collect()
}

/// Seconds of a name that ends with nanoseconds: ten digits are whole seconds, the rest their fraction.
fn seconds(stem: &str) -> Option<f64> {
    let digits = stem.rsplit('_').next()?;
    if digits.len() < 10 || !digits.bytes().all(|b| b.is_ascii_digit()) {
        return None;
    }
    let (whole, fraction) = digits.split_at(10);
    format!("{whole}.{fraction}0").parse().ok()
}

/// A camera of ROS's text: `width: 1280`, `K: (fx, 0, cx, 0, fy, cy, 0, 0, 1)`, `D: (k1, k2, p1, p2, k3, ...)`.
fn camera_info(path: &Path) -> Result<Optics> {
    let mut lines = Lines::open(path)?;
    let (mut size, mut k, mut d) = ([None; 2], None, None);
    while let Some(line) = lines.content()? {
        let Some((key, value)) = line.split_once(':') else { continue };
        let slot = match key.trim() {
            "width" => {
                size[0] = size[0].or(Some(lines.whole("width", value)?));
                continue;
            }
            "height" => {
                size[1] = size[1].or(Some(lines.whole("height", value)?));
                continue;
            }
            "K" => &mut k,
            "D" => &mut d,
            _ => continue,
        };
        let cells = value.trim().trim_matches(['(', ')', '[', ']']).split(',').filter(|c| !c.trim().is_empty());
        *slot = Some(cells.map(|c| lines.number(key.trim(), c)).collect::<Result<Vec<f64>>>()?);
    }
    let ([Some(width), Some(height)], Some([fx, _, cx, _, fy, cy, ..])) = (size, k.as_deref()) else {
        return Err(Error::format(path, "camera", "width, height and K: (9 numbers) are needed"));
    };
    let lens = match d.as_deref() {
        Some([k1, k2, p1, p2, k3, rest @ ..]) if d.iter().flatten().any(|c| *c != 0.0) => {
            let more = |i: usize| rest.get(i).copied().unwrap_or(0.0);
            LensModel::OpenCv { k: [*k1, *k2, *k3, more(0), more(1), more(2)], p: [*p1, *p2] }
        }
        _ => LensModel::Pinhole,
    };
    let optics = Optics { width, height, fx: *fx, fy: *fy, cx: *cx, cy: *cy, lens };
    optics.fault().map_or(Ok(optics), |fault| Err(Error::format(path, "K, D", fault)))
}

/// Interactions that somebody has verified. What they move is not told.
fn cues(path: &Path, notes: &mut Vec<String>) -> Result<Vec<ClipAt>> {
    let file = path.join("matched_cues.csv");
    if !file.is_file() {
        return Ok(Vec::new());
    }
    let mut table = TextTable::open(&file)?;
    table.need(&["cue_start", "cue_end"])?;
    let has_opinion = table.has("verification");
    let (mut out, mut left_out) = (Vec::new(), 0);
    while let Some(row) = table.row()? {
        if has_opinion && !row.text("verification").trim().eq_ignore_ascii_case("verified") {
            left_out += 1;
            continue;
        }
        out.push(ClipAt {
            name: format!("cue_{:03}", out.len()),
            start: At::index(row.whole("cue_start")?),
            end: At::index(row.whole("cue_end")?),
            narration: String::new(),
            verb: String::new(),
            noun: String::new(),
        });
    }
    if left_out > 0 {
        notes.push(format!("{left_out} cues that nobody verified are left out"));
    }
    if !out.is_empty() {
        notes.push(
            "cues say when, not what: edit narrations in clips.json (\"open the drawer\") for the names".to_owned(),
        );
    }
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_end_with_nanoseconds() {
        assert_eq!(seconds("rgb_1729084123500000000"), Some(1_729_084_123.5));
        assert_eq!(seconds("1729084123"), Some(1_729_084_123.0));
        assert_eq!(seconds("rgb_12"), None);
        assert_eq!(seconds("rgb_172908412a500000000"), None);
    }

    #[test]
    fn cameras_that_hang_upside_down_were_turned() {
        let pose = |turn: UnitQuaternion<f64>| PoseAt {
            at: At::time(0.0),
            pose: RawPose::from_pose(&Pose::from_parts(Vector::zeros().into(), turn)),
            optics: None,
        };
        // A level camera that looks along +Y of a world whose up is +Z.
        let level = UnitQuaternion::from_axis_angle(&Vector::x_axis(), -std::f64::consts::FRAC_PI_2);
        assert_eq!(held(&[pose(level)], &Pose::identity()), (false, Some(Vector::z())));
        assert_eq!(held(&[pose(level * about_axis())], &Pose::identity()), (true, Some(Vector::z())));
        assert_eq!(held(&[pose(UnitQuaternion::identity())], &Pose::identity()), (false, None));
        assert_eq!(held(&[], &Pose::identity()), (false, None));
    }
}
