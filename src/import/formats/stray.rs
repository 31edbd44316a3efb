//! Stray Scanner: a folder with `odometry.csv`, `camera_matrix.csv`, `depth/`, `confidence/` and `rgb.mp4`.
//!
//! Poses are the camera's in the world, camera axes OpenCV's, the world's up is +Y (ARKit). Intrinsics are of the video's size.
//! The video's own clock is not kept by players: odometry's times are the frames' times, its row numbers the video's pictures.

use std::path::Path;

use crate::error::{Error, Result};
use crate::import::ImportOptions;
use crate::import::blob::{Blob, files, inside};
use crate::import::capture::{
    At, Capture, Depth, DepthAt, DepthCoding, ImageAt, ImageSource, PoseAt, Poses, RawPose, RawRotation, SourceWorld,
};
use crate::import::optics::Optics;
use crate::import::text::{Lines, TableRow, TextTable, Unread, cells};
use crate::math::Vector;

/// LiDAR confidence is 0, 1 or 2; 0 is noise at edges and on dark surfaces.
const LEAST_CONFIDENCE: u8 = 1;

pub(super) fn detect(path: &Path) -> bool {
    path.join("odometry.csv").is_file() && path.join("camera_matrix.csv").is_file()
}

pub(super) fn read(path: &Path, options: &ImportOptions) -> Result<Capture> {
    let video = inside(path, "rgb.mp4")?;
    let optics = camera(path, options)?;
    let mut poses = Vec::new();
    let mut images = Vec::new();
    let mut depth = Vec::new();
    let mut table = TextTable::open(&path.join("odometry.csv"))?;
    table.need(&["timestamp", "frame", "x", "y", "z", "qx", "qy", "qz", "qw"])?;
    let mut lost = 0;
    let mut unread = Unread::default();
    while let Some(row) = table.row()? {
        let Some((index, posed)) = unread.keep(posed(&row)) else { continue };
        let at = posed.at.clone();
        poses.push(posed);
        if let Some(file) = &video {
            let picture = ImageSource::Video { file: file.clone(), index, upright: false };
            images.push(ImageAt { at: at.clone(), picture, optics: None });
        }
        let name = format!("{index:06}.png");
        match inside(path, &format!("depth/{name}"))? {
            Some(file) => {
                let confidence = inside(path, &format!("confidence/{name}"))?.map(Blob::File);
                depth.push(DepthAt { at, blob: Blob::File(file), confidence, optics: None, pose: None });
            }
            None => lost += 1,
        }
    }
    let dropped = unread.told("poses", poses.len())?;
    if poses.is_empty() {
        return Err(Error::format(
            &path.join("odometry.csv"),
            "rows",
            "there is none; was the recording stopped at once?",
        ));
    }
    let notes = notes(video.is_some(), lost);
    Ok(Capture {
        kind: "stray".to_owned(),
        source: path.to_owned(),
        title: "Stray Scanner recording".to_owned(),
        notes,
        dropped: dropped.into_iter().collect(),
        world: SourceWorld { up: Some(Vector::y()), ..SourceWorld::default() },
        optics: Some(optics),
        poses: Some(Poses { items: poses, ..Poses::default() }),
        images,
        depth: (!depth.is_empty()).then_some(Depth {
            least_confidence: LEAST_CONFIDENCE,
            ..Depth::of(DepthCoding::Png16 { unit_m: 1e-3 }, depth)
        }),
        ..Capture::default()
    })
}

/// The camera: the user's, else the file's. The file does not say its size; principal points lie near the middle, and all of
/// the device's images are 4 : 3.
fn camera(path: &Path, options: &ImportOptions) -> Result<Optics> {
    let file = path.join("camera_matrix.csv");
    let [fx, fy, cx, cy] = camera_matrix(&file)?;
    match (options.camera, size_beside(path, cx, cy)) {
        (Some(camera), _) => Ok(camera),
        (None, Some([width, height])) => Ok(Optics::pinhole(width, height, [fx, fy, cx, cy])),
        (None, None) => Err(Error::format(
            &file,
            "principal point",
            format!("({cx}, {cy}) is the middle of no 4 : 3 image; give --camera WIDTH,HEIGHT,FX,FY,CX,CY"),
        )),
    }
}

/// What a user should know; `lost` rows have no depth.
fn notes(has_video: bool, lost: usize) -> Vec<String> {
    let mut notes = vec![format!("LiDAR depth of confidence {LEAST_CONFIDENCE} and more; the app records no hands")];
    if has_video {
        notes.push("rows of odometry.csv are taken for the video's pictures one by one, from 0".to_owned());
    }
    if lost > 0 {
        notes.push(format!("{lost} rows of odometry.csv have no depth image"));
    }
    notes
}

/// The frame of a row of the odometry, and its pose.
fn posed(row: &TableRow<'_>) -> Result<(usize, PoseAt)> {
    let index = row.whole("frame")?;
    let at = At::time(row.number("timestamp")?).with_index(index);
    let position = row.numbers(["x", "y", "z"])?;
    let turn = RawRotation::Quaternion(row.numbers(["qx", "qy", "qz", "qw"])?);
    Ok((index, PoseAt { at, pose: RawPose { position, turn }, optics: None }))
}

/// fx, fy, cx, cy of three rows of three numbers.
fn camera_matrix(path: &Path) -> Result<[f64; 4]> {
    let mut lines = Lines::open(path)?;
    let mut rows = [[0.0; 3]; 3];
    for row in &mut rows {
        let Some(line) = lines.content()? else {
            return Err(lines.fault("the file ends; expected three rows of three numbers"));
        };
        let cells = cells(&line);
        if cells.len() != 3 {
            return Err(lines.fault(format!("{} cells, expected 3", cells.len())));
        }
        for (value, cell) in row.iter_mut().zip(cells) {
            *value = lines.number("camera matrix", cell)?;
        }
    }
    let [[fx, _, cx], [_, fy, cy], _] = rows;
    Ok([fx, fy, cx, cy])
}

/// Width and height that the principal point is the middle of: of the depth images' shape, else 4 : 3 either way.
fn size_beside(path: &Path, cx: f64, cy: f64) -> Option<[usize; 2]> {
    let shape = files(&path.join("depth"), &["png"]).first().and_then(|f| image::image_dimensions(f).ok());
    let (w, h) = shape.map_or((4.0, 3.0), |(w, h)| (f64::from(w), f64::from(h)));
    [(w, h), (h, w)].into_iter().find_map(|(w, h)| {
        // Phones' videos have widths in steps of 16; the principal point is within 3 % of the middle.
        let unit = ((2.0 * cx / w + 2.0 * cy / h) / 2.0).max(0.0);
        let width = (unit * w / 16.0).round() * 16.0;
        let height = (width * h / w).round();
        let is_middle = (2.0 * cx / width - 1.0).abs() < 0.06 && (2.0 * cy / height - 1.0).abs() < 0.06;
        (width >= 16.0 && is_middle).then_some([width as usize, height as usize])
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_video_has_the_size_whose_middle_the_principal_point_is() {
        let nowhere = Path::new("/nowhere");
        assert_eq!(size_beside(nowhere, 952.3, 721.9), Some([1920, 1440]));
        assert_eq!(size_beside(nowhere, 722.0, 958.0), Some([1440, 1920]));
        assert_eq!(size_beside(nowhere, 319.5, 239.5), Some([640, 480]));
        assert_eq!(size_beside(nowhere, 100.0, 500.0), None);
    }
}
