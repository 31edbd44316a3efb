//! HOI4D: a sequence's folder (`ZY.../H*/C*/N*/S*/s*/T*`) with `align_rgb`, `align_depth` and `3Dseg/output.log`.
//!
//! The data set comes as several downloads with one tree each (`HOI4D_release`, `HOI4D_depth_video`, `HOI4D_annotations`): a
//! sequence in one of them is completed from the others where they lie side by side. Poses are Open3D's log, camera to world,
//! OpenCV axes, metres; up is not told. Images are `align_rgb/*.jpg` or its `image.mp4`; depth is `align_depth/*.png`, which the
//! data set's `decode.py` makes of `depth_video.avi`: 16 bits, millimetres, in the colour camera. Intrinsics are
//! `camera_params/ZY.../intrin.npy`. All are joined by the number of the frame.

use std::path::{Component, Path, PathBuf};

use crate::error::Result;
use crate::import::blob::{Blob, files};
use crate::import::capture::{
    At, Capture, Depth, DepthAt, DepthCoding, ImageAt, ImageSource, Missing, PoseAt, Poses, RawPose, SourceWorld,
};
use crate::import::names::{numbered, stem};
use crate::import::optics::Optics;
use crate::import::text::{Lines, Unread};
use crate::import::{ImportOptions, decode};

/// Folders of the downloads.
const DOWNLOADS: [&str; 3] = ["HOI4D_release", "HOI4D_depth_video", "HOI4D_annotations"];
/// Frames a second of the videos: 300 pictures of 20 seconds.
const FPS: f64 = 15.0;
/// Size of the videos, pixels.
const SIZE: [usize; 2] = [1920, 1080];
/// How far above the sequence the folder of the cameras may be: the seven folders of a sequence, the download's, and one more.
const ABOVE: usize = 9;

const LOG: &str = "3Dseg/output.log";

/// The sequence's folder in each of the downloads, the given one first.
fn places(path: &Path) -> Vec<PathBuf> {
    let path = path.canonicalize().unwrap_or_else(|_| path.to_owned());
    let mut out = vec![path.clone()];
    let is_download = |c: &Component<'_>| DOWNLOADS.iter().any(|d| c.as_os_str() == *d);
    if path.components().any(|c| is_download(&c)) {
        out.extend(DOWNLOADS.map(|other| {
            path.components()
                .map(|c| if is_download(&c) { Component::Normal(other.as_ref()) } else { c })
                .collect::<PathBuf>()
        }));
    }
    out
}

/// The first of the places that has a file or folder of this name.
fn found(places: &[PathBuf], name: &str) -> Option<PathBuf> {
    places.iter().map(|p| p.join(name)).find(|p| p.exists())
}

pub(super) fn detect(path: &Path) -> bool {
    if !path.is_dir() {
        return false;
    }
    let places = places(path);
    found(&places, LOG).is_some() && ["align_rgb", "align_depth"].iter().any(|n| found(&places, n).is_some())
}

pub(super) fn read(path: &Path, _options: &ImportOptions) -> Result<Capture> {
    let places = places(path);
    let log = found(&places, LOG).unwrap_or_else(|| path.join(LOG));
    let (items, dropped) = cameras(&log)?;
    let stills = of_frames(found(&places, "align_rgb"), &["jpg", "png"]);
    let video = found(&places, "align_rgb/image.mp4");
    let images: Vec<ImageAt> = match video {
        Some(file) if stills.is_empty() => items.iter().filter_map(|p| picture(&file, &p.at)).collect(),
        _ => stills
            .iter()
            .map(|(at, file)| ImageAt {
                at: at.clone(),
                picture: ImageSource::Still(Blob::File(file.clone())),
                optics: None,
            })
            .collect(),
    };
    let depth: Vec<DepthAt> = of_frames(found(&places, "align_depth"), &["png"])
        .into_iter()
        .map(|(at, file)| DepthAt { at, blob: Blob::File(file), confidence: None, optics: None, pose: None })
        .collect();
    let packed = found(&places, "align_depth/depth_video.avi").filter(|_| depth.is_empty());
    let missing = packed.map(|file| Missing {
        what: "depth".to_owned(),
        why: "it is in a video of 16 bits, which is not read".to_owned(),
        command: format!(
            "ffmpeg -i {0}/depth_video.avi -start_number 0 {0}/%05d.png",
            file.parent().unwrap_or_else(|| Path::new("align_depth")).display()
        ),
    });
    let sized = stills.first().map(|(_, f)| f).or_else(|| depth.iter().find_map(|d| as_file(&d.blob)));
    let size = sized.and_then(|f| image::image_dimensions(f).ok()).map_or(SIZE, |(w, h)| [w as usize, h as usize]);
    let optics = intrinsics(&places, size)?;
    let mut notes = vec![format!("times are counted at {FPS} frames a second; up is found, or --up says it")];
    if optics.is_none() {
        notes.push("no camera_params/ZY.../intrin.npy lies in a folder above: give --camera".to_owned());
    }
    Ok(Capture {
        kind: "hoi4d".to_owned(),
        source: path.to_owned(),
        title: "HOI4D sequence".to_owned(),
        licence: Some("CC BY-NC 4.0 (HOI4D)".to_owned()),
        notes,
        dropped: dropped.into_iter().collect(),
        world: SourceWorld::default(),
        optics,
        poses: Some(Poses { items, ..Poses::default() }),
        images,
        depth: (!depth.is_empty()).then(|| Depth::of(DepthCoding::Png16 { unit_m: 1e-3 }, depth)),
        missing: missing.into_iter().collect(),
        ..Capture::default()
    })
}

fn as_file(blob: &Blob) -> Option<&PathBuf> {
    match blob {
        Blob::File(file) => Some(file),
        _ => None,
    }
}

/// A frame of the data set.
fn at(index: usize) -> At {
    At::time(index as f64 / FPS).with_index(index)
}

/// Images of a folder that are named by the numbers of their frames, `00012.jpg`.
fn of_frames(folder: Option<PathBuf>, endings: &[&str]) -> Vec<(At, PathBuf)> {
    let named = |file: PathBuf| {
        let (_, number) = numbered(&stem(&file)).filter(|(head, _)| head.is_empty())?;
        let index = usize::try_from(number).ok()?;
        Some((at(index), file))
    };
    folder.map_or_else(Vec::new, |folder| files(&folder, endings).into_iter().filter_map(named).collect())
}

/// The picture of a video at a frame.
fn picture(file: &Path, at: &At) -> Option<ImageAt> {
    let picture = ImageSource::Video { file: file.to_owned(), index: at.index?, upright: true };
    Some(ImageAt { at: at.clone(), picture, optics: None })
}

/// Poses of Open3D's log, five lines each: numbers, of which the first one is the frame's, and four rows of camera to world; and
/// what of them cannot be read.
fn cameras(log: &Path) -> Result<(Vec<PoseAt>, Option<String>)> {
    let mut lines = Lines::open(log)?;
    let mut out = Vec::new();
    let mut unread = Unread::default();
    while let Some(head) = lines.content()? {
        let mut rows = Vec::new();
        while rows.len() < 4 {
            match lines.content()? {
                Some(row) => rows.push(row),
                None => break,
            }
        }
        out.extend(unread.keep(camera(&lines, &head, &rows)));
    }
    let dropped = unread.told("poses", out.len())?;
    if out.is_empty() {
        return Err(
            lines.fault("the file holds no pose; expected a line of numbers and four rows of a matrix for each")
        );
    }
    Ok((out, dropped))
}

fn camera(lines: &Lines, head: &str, rows: &[String]) -> Result<PoseAt> {
    let index = lines.whole("frame", head.split_whitespace().next().unwrap_or_default())?;
    let cells = rows.iter().flat_map(|row| row.split_whitespace());
    let numbers = cells.map(|cell| lines.number("matrix", cell)).collect::<Result<Vec<f64>>>()?;
    let pose = RawPose::from_rows(&numbers).filter(|_| numbers.len() == 16);
    let pose = pose.ok_or_else(|| lines.fault(format!("{} numbers, expected four rows of four", numbers.len())))?;
    Ok(PoseAt { at: at(index), pose, optics: None })
}

/// The camera of the sequence, by the number of it in the path; `None` where its file is not there.
fn intrinsics(places: &[PathBuf], [width, height]: [usize; 2]) -> Result<Option<Optics>> {
    let id = |path: &Path| -> Option<String> {
        path.components().rev().map(|c| c.as_os_str().to_string_lossy().into_owned()).find(|c| c.starts_with("ZY2"))
    };
    let of = |path: &Path| -> Option<PathBuf> {
        let camera = id(path)?;
        let names = ["camera_params/", "camera_params/camera_params/", ""].map(|f| format!("{f}{camera}/intrin.npy"));
        path.ancestors()
            .take(ABOVE + 1)
            .flat_map(|a| names.iter().map(|n| a.join(n)).collect::<Vec<_>>())
            .find(|f| f.is_file())
    };
    let own = places.iter().map(|p| p.join("intrin.npy")).find(|f| f.is_file());
    let Some(file) = own.or_else(|| places.iter().find_map(|p| of(p))) else { return Ok(None) };
    let blob = Blob::File(file);
    let matrix = decode::npy(&blob, 1.0)?;
    let [fx, _, cx, _, fy, cy, ..] = matrix.data[..] else {
        return Err(blob.fault(format!("has {} numbers, expected a matrix of 3 x 3", matrix.data.len())));
    };
    let optics = Optics::pinhole(width, height, [fx, fy, cx, cy].map(f64::from));
    optics.fault().map_or(Ok(Some(optics)), |fault| Err(blob.fault(fault)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sequence_is_found_in_the_other_downloads() {
        let dir = tempfile::tempdir().unwrap();
        let sequence = "ZY20210800001/H1/C4/N11/S259/s02/T1";
        let [release, depth, annotations] = DOWNLOADS.map(|d| dir.path().join(d).join(sequence));
        std::fs::create_dir_all(release.join("align_rgb")).unwrap();
        std::fs::create_dir_all(depth.join("align_depth")).unwrap();
        assert!(!detect(&release));
        std::fs::create_dir_all(annotations.join("3Dseg")).unwrap();
        std::fs::write(annotations.join(LOG), "0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n").unwrap();
        for path in [&release, &depth, &annotations] {
            assert!(detect(path));
        }
        let capture = read(&depth, &ImportOptions::default()).unwrap();
        assert_eq!(capture.poses.unwrap().items.len(), 1);
        assert!(capture.optics.is_none() && capture.notes.iter().any(|n| n.contains("--camera")));
    }

    #[test]
    fn a_bad_matrix_costs_only_its_frame() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("output.log");
        let pose = |i: usize, x: &str| format!("{i} {i} {}\n1 0 0 {x}\n0 1 0 0\n0 0 1 0\n0 0 0 1\n", i + 1);
        std::fs::write(&path, [pose(0, "0.5"), pose(1, "nan"), pose(2, "0.7"), "3 3 4\n1 0 0 0\n".to_owned()].concat())
            .unwrap();
        let (items, dropped) = cameras(&path).unwrap();
        let places: Vec<_> = items.iter().map(|p| (p.at.index, p.pose.position[0])).collect();
        assert_eq!(places, [(Some(0), 0.5), (Some(2), 0.7)]);
        assert!(dropped.is_some_and(|d| d.contains("2 poses that cannot be read") && d.contains("not finite")));
        std::fs::write(&path, "\n").unwrap();
        assert!(cameras(&path).unwrap_err().to_string().contains("no pose"));
    }
}
