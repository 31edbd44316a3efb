//! Project Aria with its machine perception services (MPS): `slam/`, `hand_tracking/`, images exported from the VRS file, and
//! the depth folder of the Gen 2 pilot data.
//!
//! Poses and hands are of the glasses (`device`); the calibration tells where the colour camera sits on them. The world's up is
//! against gravity. All times are of the glasses' own clock. VRS files themselves are not read.

use std::path::{Path, PathBuf};

use super::aria_camera::{self, Mounted};
use super::aria_depth::{self, StereoImage};
use super::aria_walk::{self, AriaWalk, RowsKept};
use crate::error::{Error, Result};
use crate::import::blob::{Blob, files};
use crate::import::capture::{
    At, Capture, ImageAt, ImageSource, Missing, PoseAt, Poses, QuaternionOrder, RawRotation, SourceWorld,
};
use crate::import::join::PoseTrack;
use crate::import::text::TextTable;
use crate::import::{ImportOptions, axes, video};
use crate::math::{Pose, Vector};

/// Folders that exporters put the colour images in.
const IMAGES: [&str; 5] = ["rgb", "images", "frames", "camera-rgb", "214-1"];
/// The clock of all streams.
const CLOCK: &str = "aria device";
/// Calibration files of our exporter and of HD-EPIC's tools.
const EXPORTED: &str = "rgb_camera_calibration.json";
/// Units that the numbers in images' names may be in, seconds.
const UNITS: [f64; 4] = [1e-9, 1e-6, 1e-3, 1.0];

/// The trajectory of a folder: closed loop before open loop.
fn trajectory(folder: &Path) -> Option<PathBuf> {
    ["closed_loop_trajectory.csv", "open_loop_trajectory.csv"].into_iter().map(|n| folder.join(n)).find(|p| p.is_file())
}

/// The folder with the trajectory: the path itself, a folder of MPS in it, or one of an MPS result beside a recording.
fn slam(path: &Path) -> Option<PathBuf> {
    let mut results = vec![path.to_owned(), path.join("mps")];
    let mut beside: Vec<PathBuf> = std::fs::read_dir(path)
        .into_iter()
        .flatten()
        .filter_map(|e| e.ok().map(|e| e.path()))
        .filter(|p| p.file_name().is_some_and(|n| n.to_string_lossy().starts_with("mps_")) && p.is_dir())
        .collect();
    beside.sort();
    results.extend(beside);
    let folders = results.into_iter().flat_map(|r| [r.join("slam"), r.join("trajectory"), r]);
    folders.into_iter().find(|f| trajectory(f).is_some())
}

pub(super) fn detect(path: &Path) -> bool {
    path.is_dir() && slam(path).is_some()
}

pub(super) fn read(path: &Path, options: &ImportOptions) -> Result<Capture> {
    let Some((slam, file)) = slam(path).and_then(|s| Some((s.clone(), trajectory(&s)?))) else {
        let message =
            "holds no slam/closed_loop_trajectory.csv nor open_loop_trajectory.csv; point at the folder that MPS wrote";
        return Err(Error::Io { path: path.to_owned(), message: message.to_owned() });
    };
    let walk = aria_walk::trajectory(&file, RowsKept::Thinned)?;
    let mut notes = vec![format!(
        "{} of the glasses, poses about a hundredth of a second apart",
        file.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default()
    )];
    if walk.elsewhere > 0 {
        notes.push(format!("{} poses are in another frame of the world and were left out", walk.elsewhere));
    }
    let points = match ["semidense_points.csv.gz", "semidense_points.csv"].into_iter().find(|n| slam.join(n).is_file())
    {
        Some(name) => aria_walk::points(&slam.join(name), &walk.graph)?,
        None => Vec::new(),
    };
    let stereo = match [path.join("depth"), path.to_owned()].into_iter().find(|f| f.join(aria_depth::LIST).is_file()) {
        Some(folder) => aria_depth::read(&folder)?,
        None => Vec::new(),
    };
    let mounted = calibration(path, &slam)?;
    let (images, camera) = cameras(path, &walk, mounted, &stereo, options, &mut notes)?;
    let depth = aria_depth::stream(&stereo, &points).map(|(depth, told)| {
        notes.push(told);
        depth
    });
    let hands = hand_file(path, &slam).map(|f| aria_walk::hands(&f)).transpose()?;
    let missing = images.is_empty().then(|| Missing {
        what: "images".to_owned(),
        why: "VRS files are not read; no images with times of the glasses' clock are in the folder".to_owned(),
        command: "pip install projectaria-tools pillow; python examples/import/aria_vrs.py recording.vrs FOLDER/rgb"
            .to_owned(),
    });
    let title = if stereo.is_empty() { "Project Aria with MPS" } else { "Aria Gen 2 pilot recording" };
    Ok(Capture {
        kind: "aria".to_owned(),
        source: path.to_owned(),
        title: title.to_owned(),
        licence: (!stereo.is_empty()).then(|| "the pilot data set's is CC BY-NC 4.0".to_owned()),
        notes,
        dropped: walk.dropped.into_iter().collect(),
        clock: Some(CLOCK.to_owned()),
        world: SourceWorld { up: walk.up, ..SourceWorld::default() },
        optics: Some(camera.optics),
        poses: Some(Poses { body_from_camera: Some(camera.device_from_camera), items: walk.items, ..Poses::default() }),
        images,
        depth,
        hands: hands.filter(|h| !h.items.is_empty()),
        points,
        missing: missing.into_iter().collect(),
        ..Capture::default()
    })
}

/// The colour camera of the calibration files; `None` where there is none.
fn calibration(path: &Path, slam: &Path) -> Result<Option<Mounted>> {
    let online = slam.join("online_calibration.jsonl");
    if online.is_file() {
        return aria_camera::online(&online).map(Some);
    }
    let folders = IMAGES.iter().map(|n| path.join(n)).chain([path.to_owned(), slam.to_owned()]);
    match folders.map(|f| f.join(EXPORTED)).find(|f| f.is_file()) {
        Some(file) => aria_camera::exported(&file).map(Some),
        None => Ok(None),
    }
}

fn hand_file(path: &Path, slam: &Path) -> Option<PathBuf> {
    const FILE: &str = "hand_tracking_results.csv";
    let result = slam.parent().unwrap_or(slam);
    [result.join("hand_tracking"), path.join("hand_tracking"), slam.to_owned(), path.to_owned()]
        .into_iter()
        .map(|f| f.join(FILE))
        .find(|f| f.is_file())
}

/// The images of the frames and their camera on the glasses: exported colour images, a video, else what depth was made from.
fn cameras(
    path: &Path,
    walk: &AriaWalk,
    mounted: Option<Mounted>,
    stereo: &[StereoImage],
    options: &ImportOptions,
    notes: &mut Vec<String>,
) -> Result<(Vec<ImageAt>, Mounted)> {
    if let Some(mounted) = mounted {
        if let Some((images, [width, height])) = stills(path, walk, notes) {
            notes.push(
                "images of a folder are taken as the sensor wrote them, lying on their side; --rotate 90 stands them up"
                    .to_owned(),
            );
            return Ok((images, mounted.of_size(width, height)));
        }
        if let Some((file, times)) = film(path)? {
            notes.push("vrs_to_mp4 stood the video's pictures upright; its table has their times".to_owned());
            let [w, h] =
                video::size(options.ffmpeg.as_deref(), &file).unwrap_or([mounted.optics.width, mounted.optics.height]);
            return Ok((pictures(&file, &times), mounted.of_size(w, h).upright()));
        }
        if !stereo.iter().any(|s| s.has_image()) {
            return Ok((Vec::new(), mounted));
        }
    }
    let grey = stereo_camera(walk, stereo);
    match (grey, mounted) {
        (Some(camera), _) => {
            notes.push("the images are the rectified grey ones that depth was made from".to_owned());
            Ok((aria_depth::images(stereo), camera))
        }
        (None, Some(mounted)) => Ok((Vec::new(), mounted)),
        (None, None) => Err(Error::Io {
            path: path.to_owned(),
            message: format!(
                "no slam/online_calibration.jsonl tells where the colour camera sits on the glasses; examples/import/aria_vrs.py \
                 writes {EXPORTED} from the VRS file"
            ),
        }),
    }
}

/// The stereo camera on the glasses, from the first image at whose time the trajectory is known.
fn stereo_camera(walk: &AriaWalk, stereo: &[StereoImage]) -> Option<Mounted> {
    let pose = |item: &PoseAt| {
        let RawRotation::Quaternion(q) = item.pose.turn else { return None };
        let turn = axes::quaternion(q, QuaternionOrder::Xyzw)?;
        Some((item.at.time_secs?, Pose::from_parts(Vector::from(item.pose.position).into(), turn)))
    };
    let track = PoseTrack::of(walk.items.iter().filter_map(pose).collect());
    stereo.iter().find_map(|s| {
        let world_from_device = track.at(s.time_secs, 0.2)?;
        Some(Mounted { optics: s.optics, device_from_camera: world_from_device.inverse() * s.world_from_camera })
    })
}

/// Colour images with times in their names, and their size; `None` where no folder has such.
fn stills(path: &Path, walk: &AriaWalk, notes: &mut Vec<String>) -> Option<(Vec<ImageAt>, [usize; 2])> {
    let found = IMAGES.iter().map(|n| files(&path.join(n), &["jpg", "jpeg", "png"])).find(|f| !f.is_empty())?;
    let numbers: Vec<Option<f64>> = found.iter().map(|f| last_number(f)).collect();
    let [first, last] = walk.span()?;
    // The unit that puts most images within the trajectory.
    let within = |unit: f64| {
        let times = numbers.iter().flatten().map(|n| n * unit);
        times.filter(|t| (first - 1.0..=last + 1.0).contains(t)).count()
    };
    let unit = UNITS.into_iter().max_by_key(|u| within(*u))?;
    if within(unit) == 0 {
        notes.push(format!(
            "{} images were left out: their names hold no time of the glasses' clock ({first:.3} to {last:.3} s)",
            found.len()
        ));
        return None;
    }
    let size = found.iter().find_map(|f| image::image_dimensions(f).ok()).map(|(w, h)| [w as usize, h as usize])?;
    let image = |(file, number): (PathBuf, Option<f64>)| {
        let name = file.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
        let at = At::time(number? * unit).with_name(&name);
        Some(ImageAt { at, picture: ImageSource::Still(Blob::File(file)), optics: None })
    };
    Some((found.into_iter().zip(numbers).filter_map(image).collect(), size))
}

/// The number that a file's name ends with, before its ending: `214-1-00005-1392.137.jpg`, `1392137000000.jpg`.
fn last_number(file: &Path) -> Option<f64> {
    let stem = file.file_stem()?.to_str()?;
    let start = stem.rfind(|c: char| !(c.is_ascii_digit() || c == '.')).map_or(0, |i| i + 1);
    stem.get(start..)?.parse::<f64>().ok().filter(|n| n.is_finite())
}

/// A video with the table of its pictures' times, seconds of the glasses' clock.
fn film(path: &Path) -> Result<Option<(PathBuf, Vec<f64>)>> {
    let tables = files(path, &["csv"]);
    let table = tables.iter().find(|f| f.to_string_lossy().ends_with("mp4_to_vrs_time_ns.csv"));
    let (Some(table), Some(video)) = (table, files(path, &video::ENDINGS).into_iter().next()) else { return Ok(None) };
    let times = device_times(table)?.into_iter().map(|[_, device]| device).collect();
    Ok(Some((video, times)))
}

/// A table of `vrs_to_mp4`: seconds of the video and of the glasses, picture by picture.
pub(super) fn device_times(path: &Path) -> Result<Vec<[f64; 2]>> {
    let mut table = TextTable::open(path)?;
    table.need(&["mp4_time_ns", "vrs_device_time_ns"])?;
    let mut out = Vec::new();
    while let Some(row) = table.row()? {
        out.push(row.numbers(["mp4_time_ns", "vrs_device_time_ns"])?.map(|ns| ns * 1e-9));
    }
    Ok(out)
}

/// The pictures of a video that was stood upright, at their times.
pub(super) fn pictures(file: &Path, times: &[f64]) -> Vec<ImageAt> {
    let image = |(index, time): (usize, &f64)| ImageAt {
        at: At::time(*time).with_index(index),
        picture: ImageSource::Video { file: file.to_owned(), index, upright: true },
        optics: None,
    };
    times.iter().enumerate().map(image).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_the_last_number_of_a_name() {
        for (name, number) in [
            ("214-1-00005-1392.137.jpg", Some(1392.137)),
            ("1392137000000.png", Some(1_392_137_000_000.0)),
            ("frame_000012.jpg", Some(12.0)),
            ("cover.jpg", None),
        ] {
            assert_eq!(last_number(Path::new(name)), number, "{name}");
        }
    }
}
