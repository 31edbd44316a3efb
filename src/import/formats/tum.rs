//! TUM RGB-D: a folder with `rgb.txt`, `depth.txt`, `groundtruth.txt`; or a trajectory file alone.
//!
//! Lists are `timestamp file`, trajectories `timestamp x y z qx qy qz qw` of the camera in the world, OpenCV axes, metres;
//! seconds on one clock. Depth is 16-bit, 5000 a metre. `calibration.txt` (`fx fy cx cy`) is taken where it is there.

use std::path::{Path, PathBuf};

use crate::error::{Error, Result};
use crate::import::ImportOptions;
use crate::import::blob::{Blob, inside};
use crate::import::capture::{
    At, Capture, Depth, DepthAt, DepthCoding, ImageAt, ImageSource, PoseAt, Poses, RawPose, RawRotation, SourceWorld,
};
use crate::import::optics::Optics;
use crate::import::text::{Lines, Unread, cells};

/// Depth counts a metre.
const DEPTH_PER_M: f64 = 5000.0;

pub(super) fn detect(path: &Path) -> bool {
    if path.is_dir() {
        return path.join("rgb.txt").is_file()
            && (path.join("groundtruth.txt").is_file() || path.join("depth.txt").is_file());
    }
    let ending = path.extension().and_then(|e| e.to_str()).unwrap_or_default();
    ["txt", "tum"].contains(&ending) && is_trajectory(path)
}

/// Whether the first line with content is eight numbers.
fn is_trajectory(path: &Path) -> bool {
    let first = Lines::open(path).and_then(|mut lines| lines.content());
    first.ok().flatten().is_some_and(|line| {
        let cells = cells(&line);
        cells.len() == 8 && cells.iter().all(|c| c.parse::<f64>().is_ok())
    })
}

pub(super) fn read(path: &Path, _options: &ImportOptions) -> Result<Capture> {
    let mut capture = Capture {
        kind: "tum".to_owned(),
        source: path.to_owned(),
        title: "TUM trajectory".to_owned(),
        world: SourceWorld::default(),
        ..Capture::default()
    };
    if !path.is_dir() {
        capture.poses = Some(trajectory(path, &mut capture.dropped)?);
        return Ok(capture);
    }
    capture.title = "TUM RGB-D sequence".to_owned();
    let truth = path.join("groundtruth.txt");
    if truth.is_file() {
        capture.poses = Some(trajectory(&truth, &mut capture.dropped)?);
    }
    capture.images = list(path, "rgb.txt")?
        .into_iter()
        .map(|(at, file)| ImageAt { at, picture: ImageSource::Still(Blob::File(file)), optics: None })
        .collect();
    if path.join("depth.txt").is_file() {
        let items: Vec<DepthAt> = list(path, "depth.txt")?
            .into_iter()
            .map(|(at, file)| DepthAt { at, blob: Blob::File(file), confidence: None, optics: None, pose: None })
            .collect();
        capture.depth = Some(Depth::of(DepthCoding::Png16 { unit_m: 1.0 / DEPTH_PER_M }, items));
    }
    capture.optics = calibration(path, &capture)?;
    if capture.optics.is_none() {
        capture.notes.push("the folder has no calibration.txt (fx fy cx cy): give --camera".to_owned());
    }
    Ok(capture)
}

/// `t x y z qx qy qz qw` a line.
fn trajectory(path: &Path, dropped: &mut Vec<String>) -> Result<Poses> {
    let mut lines = Lines::open(path)?;
    let mut items = Vec::new();
    let mut unread = Unread::default();
    while let Some(line) = lines.content()? {
        items.extend(unread.keep(posed(&lines, &line)));
    }
    dropped.extend(unread.told("poses", items.len())?);
    if items.is_empty() {
        return Err(Error::format(path, "end of file", "no poses; expected lines of timestamp x y z qx qy qz qw"));
    }
    Ok(Poses { items, ..Poses::default() })
}

/// The pose of a line.
fn posed(lines: &Lines, line: &str) -> Result<PoseAt> {
    let cells = cells(line);
    if cells.len() != 8 {
        return Err(lines.fault(format!("{} numbers, expected timestamp x y z qx qy qz qw", cells.len())));
    }
    let mut v = [0.0; 8];
    for (value, cell) in v.iter_mut().zip(&cells) {
        *value = lines.number("trajectory", cell)?;
    }
    let [t, x, y, z, a, b, c, d] = v;
    let pose = RawPose { position: [x, y, z], turn: RawRotation::Quaternion([a, b, c, d]) };
    Ok(PoseAt { at: At::time(t), pose, optics: None })
}

/// `timestamp file` a line. Files that are not there are left out.
fn list(root: &Path, name: &str) -> Result<Vec<(At, PathBuf)>> {
    let mut lines = Lines::open(&root.join(name))?;
    let mut out = Vec::new();
    let mut listed = 0;
    while let Some(line) = lines.content()? {
        let Some((time, file)) = line.split_once(char::is_whitespace) else {
            return Err(lines.fault("expected a time stamp and a file name"));
        };
        let time = lines.number("time stamp", time)?;
        let file = file.trim();
        listed += 1;
        if let Some(path) = inside(root, file)? {
            out.push((At::time(time).with_name(file), path));
        }
    }
    if out.is_empty() {
        let message =
            format!("none of the {listed} files that it lists is there; is the sequence unpacked as a whole?");
        return Err(Error::format(&root.join(name), "files", message));
    }
    Ok(out)
}

/// Intrinsics beside the lists, of the images' size.
fn calibration(root: &Path, capture: &Capture) -> Result<Option<Optics>> {
    let path = root.join("calibration.txt");
    if !path.is_file() {
        return Ok(None);
    }
    let mut lines = Lines::open(&path)?;
    let Some(line) = lines.content()? else { return Err(lines.fault("is empty; expected fx fy cx cy")) };
    let cells = cells(&line);
    let mut v = [0.0; 4];
    if cells.len() < v.len() {
        return Err(lines.fault(format!("{} numbers, expected fx fy cx cy", cells.len())));
    }
    for (value, cell) in v.iter_mut().zip(&cells) {
        *value = lines.number("calibration", cell)?;
    }
    let size = capture.images.iter().find_map(|i| match &i.picture {
        ImageSource::Still(Blob::File(file)) => image::image_dimensions(file).ok(),
        _ => None,
    });
    let Some((width, height)) = size else { return Ok(None) };
    Ok(Some(Optics::pinhole(width as usize, height as usize, v)))
}
