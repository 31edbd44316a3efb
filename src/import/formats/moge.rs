//! MoGe-2: the folder that `moge infer --maps` writes, one folder an image with `depth.exr` in it.
//!
//! Depth is metres along the optical axis, nothing where masked. `normal.png` holds normals of the camera (OpenCV axes), y and z
//! with their signs changed; what is grey has none. `fov.json` tells a guessed focal length, which counts where no other source
//! has the camera's. Folders are named after the images; they may lie below others.

use std::path::{Path, PathBuf};

use serde::Deserialize;

use crate::error::{Error, Result};
use crate::import::ImportOptions;
use crate::import::blob::{Blob, files, inside};
use crate::import::capture::{At, Capture, Depth, DepthAt, DepthCoding, ImageAt, ImageSource, Normals, NormalsAt};
use crate::import::names::{last, numbered};
use crate::import::optics::{Optics, from_corner};

/// Folders of images below the one that is given: the images' own, and one for each video.
const MAX_DEPTH: usize = 2;
/// The components of a normal are `trunc(255 (n / 2 + 1 / 2))`: in the middle of what is cut off, 127 is 0.
const ZERO: f64 = 127.0;
const FACTOR: f64 = 2.0 / 255.0;

#[derive(Deserialize)]
struct Fov {
    fov_x: f64,
    fov_y: f64,
}

pub(super) fn detect(path: &Path) -> bool {
    // Images beside the folders would be another source's.
    path.is_dir()
        && (path.join("depth.exr").is_file() || files(path, &["jpg", "jpeg", "png"]).is_empty())
        && first(path, 0).is_some()
}

/// The first folder of an image.
fn first(path: &Path, depth: usize) -> Option<PathBuf> {
    if path.join("depth.exr").is_file() {
        return Some(path.to_owned());
    }
    if depth >= MAX_DEPTH {
        return None;
    }
    folders(path).iter().find_map(|folder| first(folder, depth + 1))
}

/// Folders in a folder, by name. Links are left out, so that nothing is met twice.
fn folders(path: &Path) -> Vec<PathBuf> {
    let Ok(entries) = std::fs::read_dir(path) else { return Vec::new() };
    let mut out: Vec<PathBuf> = entries
        .filter_map(std::result::Result::ok)
        .filter(|e| e.file_type().is_ok_and(|t| t.is_dir()))
        .map(|e| e.path())
        .collect();
    out.sort();
    out
}

fn collect(path: &Path, depth: usize, out: &mut Vec<PathBuf>) {
    if path.join("depth.exr").is_file() {
        out.push(path.to_owned());
    } else if depth < MAX_DEPTH {
        for folder in folders(path) {
            collect(&folder, depth + 1, out);
        }
    }
}

pub(super) fn read(path: &Path, _options: &ImportOptions) -> Result<Capture> {
    let mut found = Vec::new();
    collect(path, 0, &mut found);
    if found.is_empty() {
        let message = "holds no folder with depth.exr in it; run moge infer with --maps".to_owned();
        return Err(Error::Io { path: path.to_owned(), message });
    }
    let (mut depth, mut images, mut normals) = (Vec::new(), Vec::new(), Vec::new());
    let mut optics = None;
    for folder in &found {
        let name = last(folder);
        let mut at = At { name: Some(name.clone()), ..At::default() };
        // A bare number is a frame of a video.
        if let Some(("", number)) = numbered(&name) {
            at = at.with_index(number as usize);
        }
        if let Some(file) = inside(folder, "normal.png")? {
            normals.push(NormalsAt { at: at.clone(), blob: Blob::File(file) });
        }
        if let Some(file) = inside(folder, "image.jpg")? {
            if optics.is_none() {
                optics = guessed(folder, &file)?;
            }
            images.push(ImageAt { at: at.clone(), picture: ImageSource::Still(Blob::File(file)), optics: None });
        }
        let blob = Blob::File(folder.join("depth.exr"));
        depth.push(DepthAt { at, blob, confidence: None, optics: None, pose: None });
    }
    Ok(Capture {
        kind: "moge".to_owned(),
        source: path.to_owned(),
        title: "MoGe-2 depth".to_owned(),
        notes: vec!["depth belongs to the image's pixels; the focal length in fov.json is a guess".to_owned()],
        optics,
        optics_estimated: true,
        images,
        depth: Some(Depth::of(DepthCoding::Exr, depth)),
        normals: (!normals.is_empty()).then(|| Normals {
            zero: ZERO,
            factor: [FACTOR, -FACTOR, -FACTOR],
            items: normals,
        }),
        ..Capture::default()
    })
}

/// The camera that the network guessed, the principal point in the image's middle.
fn guessed(folder: &Path, image: &Path) -> Result<Option<Optics>> {
    let file = folder.join("fov.json");
    if !file.is_file() {
        return Ok(None);
    }
    let fov: Fov = crate::json::read(&file)?;
    let Ok((width, height)) = image::image_dimensions(image) else { return Ok(None) };
    let focal = |size: u32, degrees: f64| 0.5 * f64::from(size) / (0.5 * degrees).to_radians().tan();
    let center = |size: u32| from_corner(0.5 * f64::from(size));
    let numbers = [focal(width, fov.fov_x), focal(height, fov.fov_y), center(width), center(height)];
    let optics = Optics::pinhole(width as usize, height as usize, numbers);
    match optics.fault() {
        None => Ok(Some(optics)),
        Some(fault) => Err(Error::format(&file, "fov_x, fov_y", fault)),
    }
}
