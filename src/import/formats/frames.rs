//! A folder of images by the order of their names, or a video file.
//!
//! Images of a folder have a name and a number and no time; a video's pictures have all three. What a `timestamps.txt` or
//! `timestamps.csv` beside the images holds (a number of seconds a line, as many as images) is their time.

use std::path::Path;

use crate::error::{Error, Result};
use crate::import::ImportOptions;
use crate::import::blob::{Blob, files};
use crate::import::capture::{At, Capture, ImageAt, ImageSource};
use crate::import::text::{Lines, cells};
use crate::import::video;

const IMAGES: [&str; 3] = ["jpg", "jpeg", "png"];

pub(super) fn detect(path: &Path) -> bool {
    if path.is_dir() { !files(path, &IMAGES).is_empty() } else { video::is_video(path) }
}

pub(super) fn read(path: &Path, options: &ImportOptions) -> Result<Capture> {
    let images = if path.is_dir() { folder(path)? } else { pictures(path, options)? };
    let title = if path.is_dir() { "a folder of images" } else { "a video file" };
    Ok(Capture {
        kind: "frames".to_owned(),
        source: path.to_owned(),
        title: title.to_owned(),
        images,
        ..Capture::default()
    })
}

fn folder(path: &Path) -> Result<Vec<ImageAt>> {
    let files = files(path, &IMAGES);
    if files.is_empty() {
        return Err(Error::Io { path: path.to_owned(), message: "holds no JPEG or PNG images".to_owned() });
    }
    let times = ["timestamps.txt", "timestamps.csv"].map(|n| path.join(n)).into_iter().find(|p| p.is_file());
    let times = times.map(|t| seconds(&t, files.len())).transpose()?;
    let image = |(index, file): (usize, std::path::PathBuf)| {
        let name = file.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
        let time_secs = times.as_ref().and_then(|t| t.get(index).copied());
        let at = At { time_secs, ..At::name(&name).with_index(index) };
        ImageAt { at, picture: ImageSource::Still(Blob::File(file)), optics: None }
    };
    Ok(files.into_iter().enumerate().map(image).collect())
}

/// The first number of each line; a header is passed over.
fn seconds(path: &Path, expected: usize) -> Result<Vec<f64>> {
    let mut lines = Lines::open(path)?;
    let mut out = Vec::new();
    while let Some(line) = lines.content()? {
        let first = cells(&line).first().copied().unwrap_or_default().to_owned();
        if out.is_empty() && first.starts_with(|c: char| c.is_ascii_alphabetic()) {
            continue;
        }
        out.push(lines.number("time", &first)?);
    }
    if out.len() != expected {
        return Err(Error::format(path, "lines", format!("{} times for {expected} images", out.len())));
    }
    Ok(out)
}

fn pictures(path: &Path, options: &ImportOptions) -> Result<Vec<ImageAt>> {
    let times = video::times(options.ffmpeg.as_deref(), path)?;
    let image = |(index, time): (usize, f64)| ImageAt {
        at: At::time(time).with_index(index),
        picture: ImageSource::Video { file: path.to_owned(), index, upright: true },
        optics: None,
    };
    Ok(times.into_iter().enumerate().map(image).collect())
}
