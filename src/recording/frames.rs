//! Where a recording's pictures come from: files, memory, or whatever implements [`Frames`].

use std::collections::BTreeMap;
use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::segments::{self, Ends};
use super::{Camera, Grid, images};
use crate::error::{Error, Result};

/// Gives a recording's pictures when they are asked for, each by the name that its frame has for it
/// ([`super::FrameFiles`]). Asked from many threads at once; the same name always gives the same picture.
///
/// Errors name the picture: messages, and who leaves a damaged picture out, know it by that name.
pub trait Frames: fmt::Debug + Send + Sync {
    /// Depth along the optical axis, metres; 0 = none. As large as `camera` says, as all pictures are.
    ///
    /// # Errors
    /// A picture that is not there, or cannot be decoded.
    fn depth(&self, name: &Path, camera: &Camera) -> Result<Grid<f32>>;

    /// Colours, sRGB.
    ///
    /// # Errors
    /// As [`Self::depth`].
    fn rgb(&self, name: &Path, camera: &Camera) -> Result<Grid<[u8; 3]>>;

    /// Luma of the same picture.
    ///
    /// # Errors
    /// As [`Self::depth`].
    fn grey(&self, name: &Path, camera: &Camera) -> Result<Grid<u8>> {
        Ok(images::luma(&self.rgb(name, camera)?))
    }

    /// Class of each pixel; 0 = nothing in particular, 255 = a hand.
    ///
    /// # Errors
    /// As [`Self::depth`].
    fn mask(&self, name: &Path, camera: &Camera) -> Result<Grid<u8>>;

    /// Unit normals in the camera frame, facing the camera; zero = none.
    ///
    /// # Errors
    /// As [`Self::depth`].
    fn normals(&self, name: &Path, camera: &Camera) -> Result<Grid<[f32; 3]>>;

    /// A line detector's own segments, pixels.
    ///
    /// # Errors
    /// As [`Self::depth`].
    fn segments(&self, name: &Path) -> Result<Vec<Ends>>;
}

/// Pictures in files, decoded each time; their names are their paths (`docs/recording-format.md`).
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct FolderFrames;

impl Frames for FolderFrames {
    fn depth(&self, name: &Path, camera: &Camera) -> Result<Grid<f32>> {
        images::depth(name, camera)
    }

    fn rgb(&self, name: &Path, camera: &Camera) -> Result<Grid<[u8; 3]>> {
        images::rgb(name, camera)
    }

    fn grey(&self, name: &Path, camera: &Camera) -> Result<Grid<u8>> {
        images::grey(name, camera)
    }

    fn mask(&self, name: &Path, camera: &Camera) -> Result<Grid<u8>> {
        images::classes(name, camera)
    }

    fn normals(&self, name: &Path, camera: &Camera) -> Result<Grid<[f32; 3]>> {
        images::normals(name, camera)
    }

    fn segments(&self, name: &Path) -> Result<Vec<Ends>> {
        segments::read(name)
    }
}

/// Pictures in memory, each by its name; units and axes are those of [`Frames`].
#[derive(Debug, Clone, Default, PartialEq)]
pub struct MemoryFrames {
    /// Metres along the optical axis; 0 = none.
    pub depth: BTreeMap<PathBuf, Grid<f32>>,
    /// Colours, sRGB.
    pub rgb: BTreeMap<PathBuf, Grid<[u8; 3]>>,
    /// Class of each pixel.
    pub masks: BTreeMap<PathBuf, Grid<u8>>,
    /// Unit normals, camera frame.
    pub normals: BTreeMap<PathBuf, Grid<[f32; 3]>>,
    /// Segments, pixels.
    pub segments: BTreeMap<PathBuf, Vec<Ends>>,
}

impl Frames for MemoryFrames {
    fn depth(&self, name: &Path, _camera: &Camera) -> Result<Grid<f32>> {
        held(&self.depth, name)
    }

    fn rgb(&self, name: &Path, _camera: &Camera) -> Result<Grid<[u8; 3]>> {
        held(&self.rgb, name)
    }

    fn mask(&self, name: &Path, _camera: &Camera) -> Result<Grid<u8>> {
        held(&self.masks, name)
    }

    fn normals(&self, name: &Path, _camera: &Camera) -> Result<Grid<[f32; 3]>> {
        held(&self.normals, name)
    }

    fn segments(&self, name: &Path) -> Result<Vec<Ends>> {
        held(&self.segments, name)
    }
}

fn held<T: Clone>(all: &BTreeMap<PathBuf, T>, name: &Path) -> Result<T> {
    all.get(name)
        .cloned()
        .ok_or_else(|| Error::format(name, "memory", "no picture of that name and kind is held; put it there first"))
}

/// Who has a recording's pictures; clones of a recording share it.
#[derive(Debug, Clone, Default)]
pub enum Source {
    /// Files: [`FolderFrames`].
    #[default]
    Files,
    /// Memory, a database, a decoder of videos.
    Given(Arc<dyn Frames>),
}

impl Source {
    /// Who to ask.
    #[must_use]
    pub fn frames(&self) -> &dyn Frames {
        match self {
            Self::Files => &FolderFrames,
            Self::Given(frames) => frames.as_ref(),
        }
    }
}

impl PartialEq for Source {
    /// Files are files; anything else is the same where it is one and the same object.
    fn eq(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Files, Self::Files) => true,
            (Self::Given(one), Self::Given(other)) => Arc::ptr_eq(one, other),
            _ => false,
        }
    }
}

/// A picture as large as its camera says: what indexes its pixels later must not fail.
pub(super) fn sized<T>(picture: Grid<T>, name: &Path, camera: &Camera) -> Result<Grid<T>> {
    match unfit(&picture, camera) {
        None => Ok(picture),
        Some(why) => Err(Error::format(name, "image", why)),
    }
}

/// Why a picture is not one of a camera, in words.
pub(super) fn unfit<T>(picture: &Grid<T>, camera: &Camera) -> Option<String> {
    let (width, height) = (picture.width, picture.height);
    if (width, height) != (camera.width, camera.height) {
        let own = format!("{} x {}", camera.width, camera.height);
        return Some(format!(
            "is {width} x {height}, its camera's images are {own}; resize one of them (and scale fx, fy, cx, cy)"
        ));
    }
    let (values, pixels) = (picture.data.len(), width.saturating_mul(height));
    (values != pixels).then(|| format!("has {values} values for {width} x {height} pixels; give {pixels}, row by row"))
}

#[cfg(test)]
mod tests {
    use super::*;

    const CAMERA: Camera = Camera { width: 4, height: 3, fx: 3.0, fy: 3.0, cx: 1.5, cy: 1.0 };

    #[test]
    fn memory_gives_what_it_holds_and_names_what_it_lacks() {
        let mut frames = MemoryFrames::default();
        frames.depth.insert("a".into(), Grid::filled(4, 3, 1.5f32));
        frames.rgb.insert("a".into(), Grid::filled(4, 3, [10u8, 200, 30]));
        assert_eq!(frames.depth(Path::new("a"), &CAMERA).unwrap().data[5], 1.5);
        let grey = frames.grey(Path::new("a"), &CAMERA).unwrap();
        assert!(grey.data.iter().all(|g| (130..170).contains(g)), "{:?}", grey.data);
        let error = frames.mask(Path::new("a"), &CAMERA).unwrap_err().to_string();
        assert!(error.starts_with("a: memory: "), "{error}");
    }

    #[test]
    fn a_picture_of_another_size_is_refused() {
        let named = |grid: Grid<u8>| sized(grid, Path::new("x/3"), &CAMERA).map_err(|e| e.to_string());
        assert!(named(Grid::filled(4, 3, 0)).is_ok());
        assert!(named(Grid::filled(3, 4, 0)).is_err_and(|e| e.contains("x/3") && e.contains("3 x 4")));
        let short = Grid { width: 4, height: 3, data: vec![0u8; 7] };
        assert!(named(short).is_err_and(|e| e.contains("7 values")));
    }

    #[test]
    fn sources_are_the_same_where_they_are_one() {
        let one = Source::Given(Arc::new(MemoryFrames::default()));
        assert_eq!(Source::Files, Source::default());
        assert_eq!(one, one.clone());
        assert_ne!(one, Source::Given(Arc::new(MemoryFrames::default())));
        assert_ne!(one, Source::Files);
    }
}
