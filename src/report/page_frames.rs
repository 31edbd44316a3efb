//! Recorded frames for the page: small pictures, where each was taken, and how the parts stood then.

use image::codecs::jpeg::JpegEncoder;
use image::{ExtendedColorType, ImageEncoder, RgbImage, imageops};
use rayon::prelude::*;
use serde::Serialize;

use crate::config::{self, Config};
use crate::error::{Error, Result};
use crate::evaluation::shots::{self, Shot};
use crate::export::gltf;
use crate::hands::timeline::Timeline;
use crate::pipeline::Scene;
use crate::recording::Recording;
use crate::twin::Twin;

/// Of three recorded frames two show everything closed.
const CLOSED_SHARE: f64 = 2.0 / 3.0;
/// Qualities that are tried, of 100: the first with which all pictures together are small enough.
const QUALITIES: [u8; 4] = [75, 60, 45, 30];

/// A recorded frame.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PageFrame {
    /// Its number.
    pub frame: usize,
    /// Words for people.
    pub label: String,
    /// Where its camera stands in the scene of `scene.glb`; see [`gltf::camera`].
    pub pose: [f64; 16],
    /// Image width and height, pixels, of the recording.
    pub size: [usize; 2],
    /// Focal lengths and principal point, pixels: fx, fy, cx, cy.
    pub lens: [f64; 4],
    /// Opening of each part that stood open, by its joint's id, rad or m.
    pub openings: Vec<(String, f64)>,
    /// The picture.
    #[serde(skip)]
    pub jpeg: Vec<u8>,
}

/// The timelines of a twin's parts, in its order; a part of which the scene has no joint is closed.
#[must_use]
pub fn timelines(recording: &Recording, scene: &Scene, twin: &Twin, config: &config::Hands) -> Vec<Timeline> {
    let all = scene.timelines(recording, config);
    let of = |id: &str| scene.joints.iter().position(|j| j.id == id).and_then(|i| all.get(i)).cloned();
    twin.furniture.iter().map(|f| of(&f.part.id).unwrap_or_default()).collect()
}

/// Frames for the page, evenly over the recording, a few of them with open parts.
///
/// # Errors
/// Images that cannot be decoded.
pub fn frames(recording: &Recording, scene: &Scene, twin: &Twin, config: &Config) -> Result<Vec<PageFrame>> {
    let timelines = timelines(recording, scene, twin, &config.hands);
    let config = &config.comparison;
    let most = config.page_frames;
    let few = config::Comparison {
        frames: ((most as f64 * CLOSED_SHARE).ceil() as usize).max(1),
        open_frames: 1,
        ..config.clone()
    };
    let chosen = shots::choose(recording, twin, &timelines, &few).chosen;
    let (closed, open): (Vec<Shot>, Vec<Shot>) = chosen.into_iter().partition(|s| s.opened().is_empty());
    let room = most.saturating_sub(closed.len());
    let mut shown: Vec<Shot> = closed.into_iter().chain(open.into_iter().take(room)).collect();
    shown.sort_by_key(|s| s.frame);
    let pictures: Vec<RgbImage> =
        shown.par_iter().map(|shot| small(recording, shot.frame, config.page_width)).collect::<Result<_>>()?;
    let encoded = encoded(&pictures, config.page_mb * 1e6)?;
    let frames = shown.iter().zip(encoded).filter_map(|(shot, jpeg)| described(recording, twin, shot, jpeg));
    Ok(frames.collect())
}

/// A frame of a width, or smaller if it is.
fn small(recording: &Recording, frame: usize, width: usize) -> Result<RgbImage> {
    let Some(grid) = recording.rgb(frame)? else { return Ok(RgbImage::new(1, 1)) };
    let full = RgbImage::from_fn(grid.width as u32, grid.height as u32, |x, y| {
        image::Rgb(grid.get(x as usize, y as usize).unwrap_or_default())
    });
    if grid.width <= width {
        return Ok(full);
    }
    let height = (grid.height * width / grid.width).max(1);
    Ok(imageops::thumbnail(&full, width as u32, height as u32))
}

/// Pictures as JPEG, so that as text of a page they are no more than so many bytes; of the last quality as many as fit.
fn encoded(pictures: &[RgbImage], most_bytes: f64) -> Result<Vec<Vec<u8>>> {
    // Four letters stand for three bytes.
    let letters = |all: &[Vec<u8>]| all.iter().map(Vec::len).sum::<usize>() as f64 * 4.0 / 3.0;
    let mut all: Vec<Vec<u8>> = Vec::new();
    for quality in QUALITIES {
        all = pictures.par_iter().map(|picture| jpeg(picture, quality)).collect::<Result<_>>()?;
        if letters(&all) <= most_bytes {
            return Ok(all);
        }
    }
    while letters(&all) > most_bytes {
        all.pop();
    }
    Ok(all)
}

fn jpeg(picture: &RgbImage, quality: u8) -> Result<Vec<u8>> {
    let mut bytes = Vec::new();
    JpegEncoder::new_with_quality(&mut bytes, quality)
        .write_image(picture.as_raw(), picture.width(), picture.height(), ExtendedColorType::Rgb8)
        .map_err(|e| Error::Export(format!("index.html: a recorded frame: {e}")))?;
    Ok(bytes)
}

fn described(recording: &Recording, twin: &Twin, shot: &Shot, jpeg: Vec<u8>) -> Option<PageFrame> {
    let from = recording.frames.get(shot.frame)?;
    let camera = recording.camera_of(shot.frame);
    let opened: Vec<usize> = shot.opened();
    let parts = || opened.iter().filter_map(|i| Some((twin.furniture.get(*i)?, *shot.openings.get(*i)?)));
    let words: Vec<&str> = parts().map(|(f, _)| f.part.label.as_str()).collect();
    let state = if words.is_empty() { "all closed".to_owned() } else { format!("{} open", words.join(", ")) };
    Some(PageFrame {
        frame: shot.frame,
        label: format!("{:.1} s: {state}", from.timestamp_secs),
        pose: gltf::camera(&from.world_from_camera),
        size: [camera.width, camera.height],
        lens: [camera.fx, camera.fy, camera.cx, camera.cy],
        openings: parts().map(|(f, opening)| (f.part.id.clone(), opening)).collect(),
        jpeg,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{Point, Pose};

    #[test]
    fn a_camera_looks_in_the_scene_where_it_looked_in_the_world() {
        // Standing at (1, 2, 3), it looks along the world's +x, its right is -y.
        let turn = nalgebra::Matrix3::new(0.0, 0.0, 1.0, -1.0, 0.0, 0.0, 0.0, -1.0, 0.0);
        let turn = nalgebra::UnitQuaternion::from_rotation_matrix(&nalgebra::Rotation3::from_matrix_unchecked(turn));
        let matrix = nalgebra::Matrix4::from_column_slice(&gltf::camera(&Pose::from_parts(
            Point::new(1.0, 2.0, 3.0).coords.into(),
            turn,
        )));
        // +Z up becomes +Y up: (x, z, -y).
        for (of_camera, expected) in [
            ([0.0, 0.0, 0.0], [1.0, 3.0, -2.0]),
            ([0.0, 0.0, -1.0], [2.0, 3.0, -2.0]),
            ([1.0, 0.0, 0.0], [1.0, 3.0, -1.0]),
            ([0.0, 1.0, 0.0], [1.0, 4.0, -2.0]),
        ] {
            let found = matrix.transform_point(&Point::from(of_camera));
            assert!((found - Point::from(expected)).norm() < 1e-5, "{of_camera:?} {found}");
        }
    }

    #[test]
    fn pictures_are_as_good_as_their_bytes_allow_and_as_many() {
        // Noise does not pack well.
        let noisy = RgbImage::from_fn(64, 48, |x, y| {
            let n = (x * 7919 + y * 104_729 + x * y * 31) % 251;
            image::Rgb([n as u8, (n * 3 % 251) as u8, (n * 7 % 251) as u8])
        });
        let pictures = vec![noisy; 4];
        let all = encoded(&pictures, 1e6).unwrap();
        let bytes = |all: &[Vec<u8>]| all.iter().map(Vec::len).sum::<usize>() * 4 / 3;
        let worse = encoded(&pictures, bytes(&all) as f64 * 0.9).unwrap();
        assert!(worse.len() == 4 && bytes(&worse) < bytes(&all));
        let fewer = encoded(&pictures, bytes(&all) as f64 * 0.3).unwrap();
        assert!(fewer.len() < 4 && bytes(&fewer) <= bytes(&all) * 3 / 10 + 1);
    }
}
