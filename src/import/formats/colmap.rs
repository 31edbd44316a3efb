//! COLMAP: `cameras`, `images` and `points3D`, `.bin` or `.txt`; the folder itself, or one with `sparse/0` or `sparse` in it.
//!
//! Poses are world to camera, OpenCV axes, quaternions w x y z; the scale is arbitrary and gravity unknown. Principal points
//! count from the corner of the first pixel. Observations of points are passed over, so memory is that of poses and points.

use std::path::{Path, PathBuf};

use super::colmap_binary;
use super::colmap_model::{Cameras, RegisteredImage, Thinned, optics, pose};
use crate::error::{Error, Result};
use crate::import::ImportOptions;
use crate::import::blob::{Blob, inside};
use crate::import::capture::{
    At, Capture, Direction, ImageAt, ImageSource, Missing, PoseAt, Poses, QuaternionOrder, SourceWorld,
};
use crate::import::text::{Lines, Unread, cells};
use crate::math::Point;

/// The folder with the model, and its ending.
fn model(path: &Path) -> Option<(PathBuf, &'static str)> {
    // COLMAP itself prefers binary files where both are there.
    let of = |folder: PathBuf| {
        let has = |ending: &str| ["cameras", "images"].iter().all(|n| folder.join(format!("{n}.{ending}")).is_file());
        let ending = ["bin", "txt"].into_iter().find(|e| has(e))?;
        Some((folder, ending))
    };
    [path.to_owned(), path.join("sparse/0"), path.join("sparse")].into_iter().find_map(of)
}

pub(super) fn detect(path: &Path) -> bool {
    model(path).is_some()
}

/// The files of a model.
#[derive(Default)]
struct ModelFiles {
    cameras: Cameras,
    images: Vec<RegisteredImage>,
    points: Vec<Point>,
    /// What of the images could not be read.
    dropped: Option<String>,
}

impl ModelFiles {
    /// Reads all files of an ending; points need not be there.
    fn read(file: &dyn Fn(&str) -> PathBuf, ending: &str) -> Result<Self> {
        let points_file = file("points3D");
        let mut points = Thinned::default();
        let mut out = Self::default();
        if ending == "bin" {
            out.cameras = colmap_binary::cameras(&file("cameras"))?;
            out.images = colmap_binary::images(&file("images"))?;
            if points_file.is_file() {
                colmap_binary::points(&points_file, &mut points)?;
            }
        } else {
            out.cameras = text_cameras(&file("cameras"))?;
            (out.images, out.dropped) = text_images(&file("images"))?;
            if points_file.is_file() {
                text_points(&points_file, &mut points)?;
            }
        }
        out.points = points.into_kept();
        Ok(out)
    }
}

pub(super) fn read(path: &Path, _options: &ImportOptions) -> Result<Capture> {
    let Some((folder, ending)) = model(path) else {
        let message =
            "holds no cameras and images (.bin or .txt), nor does its sparse/0; point at the folder of one model";
        return Err(Error::Io { path: path.to_owned(), message: message.to_owned() });
    };
    let file = |name: &str| folder.join(format!("{name}.{ending}"));
    let ModelFiles { cameras, images: registered, points, dropped } = ModelFiles::read(&file, ending)?;
    if registered.is_empty() {
        return Err(Error::format(
            &file("images"),
            "images",
            "none is registered; is this the folder of the largest model?",
        ));
    }
    let mut items = Vec::with_capacity(registered.len());
    let mut images = Vec::new();
    for image in registered {
        let Some(optics) = cameras.get(&image.camera).copied() else {
            let message = format!("its camera {} is not among the cameras", image.camera);
            return Err(Error::format(&file("images"), format!("image {}", image.name), message));
        };
        let at = At::name(&image.name);
        if let Some(found) = inside(path, &format!("images/{}", image.name))? {
            let picture = ImageSource::Still(Blob::File(found));
            images.push(ImageAt { at: at.clone(), picture, optics: Some(optics) });
        }
        items.push(PoseAt { at, pose: image.pose, optics: Some(optics) });
    }
    // Videos' frames are numbered by their names, which is the order that they were taken in.
    images.sort_by(|a, b| a.at.name.cmp(&b.at.name));
    let optics = items.first().and_then(|i| i.optics);
    let (direction, quaternion) = (Direction::CameraFromWorld, QuaternionOrder::Wxyz);
    Ok(Capture {
        kind: "colmap".to_owned(),
        source: path.to_owned(),
        title: "COLMAP reconstruction".to_owned(),
        dropped: dropped.into_iter().collect(),
        world: SourceWorld { up: None, unit_m: None, left_handed: false },
        optics,
        poses: Some(Poses { direction, quaternion, items, ..Poses::default() }),
        missing: if images.is_empty() { vec![without_images()] } else { Vec::new() },
        images,
        points,
        ..Capture::default()
    })
}

/// What is said where the pictures do not lie beside the model.
fn without_images() -> Missing {
    Missing {
        what: "images".to_owned(),
        why: "the model's folder has no images/ with the pictures that it names".to_owned(),
        command: "paws import IMAGES MODEL --out DIR, IMAGES being the folder or video that COLMAP was run on"
            .to_owned(),
    }
}

/// `ID MODEL WIDTH HEIGHT PARAMS...` a line.
fn text_cameras(path: &Path) -> Result<Cameras> {
    let mut lines = Lines::open(path)?;
    let mut out = Cameras::new();
    while let Some(line) = lines.content()? {
        let cells = cells(&line);
        let [id, model, width, height, params @ ..] = cells.as_slice() else {
            return Err(lines.fault(format!("{} cells, expected ID MODEL WIDTH HEIGHT PARAMS", cells.len())));
        };
        let id = lines.whole("camera number", id)? as u64;
        let (width, height) = (lines.whole("width", width)?, lines.whole("height", height)?);
        let params = params.iter().map(|p| lines.number("parameter", p)).collect::<Result<Vec<f64>>>()?;
        out.insert(id, optics(model, width, height, &params).map_err(|e| lines.fault(e))?);
    }
    Ok(out)
}

/// Two lines an image, of which the second one, its observations, may be empty; and what of them cannot be read.
fn text_images(path: &Path) -> Result<(Vec<RegisteredImage>, Option<String>)> {
    let mut lines = Lines::open(path)?;
    let mut out = Vec::new();
    let mut unread = Unread::default();
    while let Some(line) = lines.content()? {
        out.extend(unread.keep(text_image(&lines, &line)));
        lines.skip()?;
    }
    let dropped = unread.told("images", out.len())?;
    Ok((out, dropped))
}

/// `ID QW QX QY QZ TX TY TZ CAMERA NAME`.
fn text_image(lines: &Lines, line: &str) -> Result<RegisteredImage> {
    let mut rest = line;
    let mut word = || {
        rest = rest.trim_start();
        let end = rest.find(char::is_whitespace).unwrap_or(rest.len());
        let (first, after) = rest.split_at(end);
        rest = after;
        first
    };
    let head: [&str; 9] = std::array::from_fn(|_| word());
    // A name may hold spaces.
    let name = rest.trim();
    if name.is_empty() {
        return Err(lines.fault("expected ID QW QX QY QZ TX TY TZ CAMERA NAME"));
    }
    let [_, numbers @ .., camera] = head;
    let mut values = [0.0; 7];
    for (value, cell) in values.iter_mut().zip(numbers) {
        *value = lines.number("pose", cell)?;
    }
    let camera = lines.whole("camera number", camera)? as u64;
    Ok(RegisteredImage { pose: pose(values), camera, name: name.to_owned() })
}

/// `ID X Y Z R G B ERROR TRACK...` a line.
fn text_points(path: &Path, out: &mut Thinned) -> Result<()> {
    let mut lines = Lines::open(path)?;
    while let Some(line) = lines.content()? {
        let mut cells = line.split_whitespace().skip(1);
        let mut p = [0.0; 3];
        for value in &mut p {
            *value = lines.number("point", cells.next().unwrap_or_default())?;
        }
        out.push(Point::from(p));
    }
    Ok(())
}
