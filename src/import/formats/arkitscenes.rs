//! ARKitScenes, raw: `lowres_wide/`, `lowres_depth/`, `confidence/`, `lowres_wide_intrinsics/`, `lowres_wide.traj`.
//!
//! Lines of the trajectory are `t`, a rotation (axis times angle, radians) and a translation: world to camera, OpenCV axes,
//! metres; the world's up is +Z. Names of files end with their time, seconds: `41069021_305.377.png`. Depth is millimetres.

use std::path::{Path, PathBuf};

use crate::error::{Error, Result};
use crate::import::ImportOptions;
use crate::import::blob::{Blob, files, inside};
use crate::import::capture::{
    At, Capture, Depth, DepthAt, DepthCoding, Direction, ImageAt, ImageSource, PoseAt, Poses, RawPose, RawRotation,
    SourceWorld,
};
use crate::import::names::{last, stem};
use crate::import::optics::Optics;
use crate::import::text::{Lines, Unread, cells};
use crate::math::Vector;

/// Confidence is 0, 1 or 2; 0 is noise at edges and on dark surfaces.
const LEAST_CONFIDENCE: u8 = 1;
/// Names are rounded to milliseconds, and not everywhere the same way.
const SAME_SECS: f64 = 0.0021;

/// The folder with the streams: the path itself, or `{scan}_frames` in it.
fn root(path: &Path) -> PathBuf {
    let inner = path.join(format!("{}_frames", last(path)));
    if inner.join("lowres_wide.traj").is_file() { inner } else { path.to_owned() }
}

pub(super) fn detect(path: &Path) -> bool {
    let root = root(path);
    root.join("lowres_wide.traj").is_file() && ["lowres_wide", "lowres_depth"].iter().any(|f| root.join(f).is_dir())
}

pub(super) fn read(source: &Path, _options: &ImportOptions) -> Result<Capture> {
    let path = &root(source);
    let (poses, dropped) = trajectory(&path.join("lowres_wide.traj"))?;
    let intrinsics = timed(&path.join("lowres_wide_intrinsics"), "pincam");
    let mut images = Vec::new();
    let mut optics = None;
    for (time, file) in timed(&path.join("lowres_wide"), "png") {
        let own = nearest(&intrinsics, time).map(pincam).transpose()?;
        optics = optics.or(own);
        let at = At::time(time).with_name(&last(&file));
        images.push(ImageAt { at, picture: ImageSource::Still(Blob::File(file)), optics: own });
    }
    // Depth has the size of these images, so that their camera is known without them.
    if let (None, Some((_, file))) = (optics, intrinsics.first()) {
        optics = Some(pincam(file)?);
    }
    let mut depth = Vec::new();
    for (time, file) in timed(&path.join("lowres_depth"), "png") {
        let name = last(&file);
        let confidence = inside(path, &format!("confidence/{name}"))?.map(Blob::File);
        let at = At::time(time).with_name(&name);
        depth.push(DepthAt { at, blob: Blob::File(file), confidence, optics: None, pose: None });
    }
    let mut notes =
        vec!["images are as the sensor has them; --rotate turns them where the tablet was upright".to_owned()];
    if optics.is_none() {
        notes.push("lowres_wide_intrinsics holds no .pincam file: give --camera".to_owned());
    }
    Ok(Capture {
        kind: "arkitscenes".to_owned(),
        source: source.to_owned(),
        title: "ARKitScenes scan".to_owned(),
        licence: Some("CC BY-NC-SA 4.0 (Apple)".to_owned()),
        notes,
        dropped: dropped.into_iter().collect(),
        world: SourceWorld { up: Some(Vector::z()), ..SourceWorld::default() },
        optics,
        poses: Some(Poses { direction: Direction::CameraFromWorld, items: poses, ..Poses::default() }),
        images,
        depth: (!depth.is_empty()).then_some(Depth {
            least_confidence: LEAST_CONFIDENCE,
            ..Depth::of(DepthCoding::Png16 { unit_m: 1e-3 }, depth)
        }),
        ..Capture::default()
    })
}

/// Files of a folder whose names end with a time, by it.
fn timed(folder: &Path, ending: &str) -> Vec<(f64, PathBuf)> {
    let mut out: Vec<(f64, PathBuf)> = files(folder, &[ending])
        .into_iter()
        .filter_map(|file| {
            let stem = stem(&file);
            let time = stem.rsplit('_').next()?.parse::<f64>().ok().filter(|t| t.is_finite())?;
            Some((time, file))
        })
        .collect();
    out.sort_by(|a, b| a.0.total_cmp(&b.0));
    out
}

/// The file of a time, by names that may differ in the last digit.
fn nearest(files: &[(f64, PathBuf)], time: f64) -> Option<&Path> {
    let after = files.partition_point(|(t, _)| *t < time);
    [after.checked_sub(1), Some(after)]
        .into_iter()
        .flatten()
        .filter_map(|i| files.get(i))
        .map(|(t, file)| ((t - time).abs(), file.as_path()))
        .filter(|(distance, _)| *distance <= SAME_SECS)
        .min_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, file)| file)
}

/// `width height fx fy cx cy`.
fn pincam(path: &Path) -> Result<Optics> {
    let mut lines = Lines::open(path)?;
    let Some(line) = lines.content()? else {
        return Err(lines.fault("is empty; expected width height fx fy cx cy"));
    };
    let [width, height, fx, fy, cx, cy] = numbers::<6>(&lines, &line, "width height fx fy cx cy")?;
    let optics = Optics::pinhole(width.max(0.0) as usize, height.max(0.0) as usize, [fx, fy, cx, cy]);
    optics.fault().map_or(Ok(optics), |fault| Err(lines.fault(fault)))
}

/// The poses, and what of them cannot be read.
fn trajectory(path: &Path) -> Result<(Vec<PoseAt>, Option<String>)> {
    let mut lines = Lines::open(path)?;
    let mut out = Vec::new();
    let mut unread = Unread::default();
    while let Some(line) = lines.content()? {
        let row = numbers::<7>(&lines, &line, "t, an axis times an angle, x y z");
        let Some([t, a, b, c, x, y, z]) = unread.keep(row) else { continue };
        let pose = RawPose { position: [x, y, z], turn: RawRotation::AxisAngle([a, b, c]) };
        out.push(PoseAt { at: At::time(t), pose, optics: None });
    }
    let dropped = unread.told("poses", out.len())?;
    if out.is_empty() {
        return Err(Error::format(path, "lines", "there is none; was the scan downloaded as a whole?"));
    }
    Ok((out, dropped))
}

/// The numbers of a line, as many as expected.
fn numbers<const N: usize>(lines: &Lines, line: &str, expected: &str) -> Result<[f64; N]> {
    let cells = cells(line);
    if cells.len() != N {
        return Err(lines.fault(format!("{} numbers, expected {expected}", cells.len())));
    }
    let mut out = [0.0; N];
    for (value, cell) in out.iter_mut().zip(cells) {
        *value = lines.number("value", cell)?;
    }
    Ok(out)
}
