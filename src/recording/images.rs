//! Decoding of the images of a recording. Every error names the file and what to do.

use std::path::Path;

use image::{DynamicImage, ImageDecoder, ImageReader};

use super::{Camera, Grid, sniff};
use crate::error::{Error, Result};
use crate::json::POINTER;
use crate::math::{Point, Pose};

/// Half-width of the square that a point of a reconstruction covers in an image, metres: half of the paper's voxel.
const SPLAT_RADIUS_M: f64 = 0.025;

/// A decoder may claim any size; a 1408 x 1408 RGB frame needs 6 MB.
const MAX_IMAGE_BYTES: u64 = 1 << 30;

/// More pixels than any camera here has.
const MAX_PIXELS: u64 = 64 << 20;

/// Decoded bytes that one byte of a file can stand for: deflate makes at most 1032 of one, pixels of one bit that become
/// three bytes 24 times as many, and JPEG less.
const MOST_OF_A_BYTE: u64 = 32 << 10;

/// Whether a file of so many bytes can hold what its header claims; `Err` says in words why not. To be asked before anything
/// of that size is made.
///
/// # Errors
/// Where the image is larger than any camera's, or the file is too short for it.
pub fn believable(decoder: &impl ImageDecoder, file_bytes: u64) -> std::result::Result<(), String> {
    let (width, height) = decoder.dimensions();
    if u64::from(width) * u64::from(height) > MAX_PIXELS {
        return Err(format!("claims {width} x {height} pixels, more than any camera has"));
    }
    if decoder.total_bytes() > file_bytes.saturating_mul(MOST_OF_A_BYTE) {
        return Err(format!("claims {width} x {height} pixels, too many for its {file_bytes} bytes; is it cut off?"));
    }
    Ok(())
}

fn decode(path: &Path, camera: &Camera) -> Result<DynamicImage> {
    let mut reader =
        ImageReader::open(path).and_then(ImageReader::with_guessed_format).map_err(|e| Error::io(path, &e))?;
    let mut limits = image::Limits::default();
    limits.max_alloc = Some(MAX_IMAGE_BYTES);
    reader.limits(limits);
    let wrong = |e: image::ImageError| match sniff::is_pointer(path) {
        true => Error::format(path, "image", POINTER.1),
        false => {
            Error::format(path, "image", format!("cannot be decoded ({e}); export this frame again or delete the file"))
        }
    };
    let decoder = reader.into_decoder().map_err(wrong)?;
    // Before anything of the size that a header claims is decoded.
    let (width, height) = decoder.dimensions();
    if (width as usize, height as usize) != (camera.width, camera.height) {
        return Err(Error::format(
            path,
            "image",
            format!(
                "is {width} x {height} but cameras.json says {} x {}; resize one of them (and scale fx, fy, cx, cy)",
                camera.width, camera.height
            ),
        ));
    }
    let file_bytes = std::fs::metadata(path).map_err(|e| Error::io(path, &e))?.len();
    believable(&decoder, file_bytes).map_err(|e| Error::format(path, "image", e))?;
    DynamicImage::from_decoder(decoder).map_err(wrong)
}

fn grid<T>(camera: &Camera, data: Vec<T>) -> Grid<T> {
    Grid { width: camera.width, height: camera.height, data }
}

/// 16-bit millimetres along the optical axis to metres; 0 stays 0 = no value.
pub fn depth(path: &Path, camera: &Camera) -> Result<Grid<f32>> {
    match decode(path, camera)? {
        DynamicImage::ImageLuma16(image) => {
            Ok(grid(camera, image.into_raw().into_iter().map(|mm| f32::from(mm) * 1e-3).collect()))
        }
        other => Err(Error::format(
            path,
            "image",
            format!("depth must be 16-bit grey in millimetres, this is {:?}", other.color()),
        )),
    }
}

/// 8-bit class numbers.
pub fn classes(path: &Path, camera: &Camera) -> Result<Grid<u8>> {
    match decode(path, camera)? {
        DynamicImage::ImageLuma8(image) => Ok(grid(camera, image.into_raw())),
        other => {
            Err(Error::format(path, "image", format!("a mask must be 8-bit grey classes, this is {:?}", other.color())))
        }
    }
}

/// Luma of any colour image.
pub fn grey(path: &Path, camera: &Camera) -> Result<Grid<u8>> {
    Ok(grid(camera, decode(path, camera)?.into_luma8().into_raw()))
}

/// Luma of colours, as of an image that is read.
#[must_use]
pub fn luma(rgb: &Grid<[u8; 3]>) -> Grid<u8> {
    let image = image::RgbImage::from_fn(rgb.width as u32, rgb.height as u32, |x, y| {
        image::Rgb(rgb.get(x as usize, y as usize).unwrap_or_default())
    });
    Grid { width: rgb.width, height: rgb.height, data: DynamicImage::ImageRgb8(image).into_luma8().into_raw() }
}

/// Any colour image as RGB.
pub fn rgb(path: &Path, camera: &Camera) -> Result<Grid<[u8; 3]>> {
    Ok(grid(camera, decode(path, camera)?.into_rgb8().pixels().map(|p| p.0).collect()))
}

/// `n = (value - 128) / 127`, normalised; (0, 0, 0) and vectors far from unit length become zero = no value.
pub fn normals(path: &Path, camera: &Camera) -> Result<Grid<[f32; 3]>> {
    match decode(path, camera)? {
        DynamicImage::ImageRgb8(image) => Ok(grid(
            camera,
            image
                .pixels()
                .map(|p| {
                    let n = p.0.map(|c| (f32::from(c) - 128.0) / 127.0);
                    let norm = n.iter().map(|c| c * c).sum::<f32>().sqrt();
                    if p.0 == [0, 0, 0] || !(0.8..1.2).contains(&norm) { [0.0; 3] } else { n.map(|c| c / norm) }
                })
                .collect(),
        )),
        other => Err(Error::format(path, "image", format!("normals must be 8-bit RGB, this is {:?}", other.color()))),
    }
}

/// Depth of a point cloud seen from a pose: each point a small square, the nearest one wins.
#[must_use]
pub fn splat(points: &[Point], world_from_camera: &Pose, camera: &Camera) -> Grid<f32> {
    let mut depth = Grid::filled(camera.width, camera.height, 0.0f32);
    let camera_from_world = world_from_camera.inverse();
    for p in points {
        let p = camera_from_world * p;
        let Some((u, v)) = camera.project(&p).filter(|&(u, v)| p.z > 0.1 && camera.contains(u, v)) else { continue };
        let reach = (SPLAT_RADIUS_M / p.z * camera.fx).min(12.0);
        let range = |c: f64, size: usize| {
            let low = (c - reach).round().max(0.0) as usize;
            low..=((c + reach).round().max(0.0) as usize).min(size - 1)
        };
        for y in range(v, camera.height) {
            for x in range(u, camera.width) {
                let d = &mut depth.data[y * camera.width + x];
                if *d == 0.0 || p.z < f64::from(*d) {
                    *d = p.z as f32;
                }
            }
        }
    }
    depth
}
