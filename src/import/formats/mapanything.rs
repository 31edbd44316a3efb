//! MapAnything: what its `demo_colmap.py` writes, a COLMAP model in metres. The files do not say so: the user does, by the name.

use std::path::Path;

use super::colmap;
use crate::error::Result;
use crate::import::ImportOptions;
use crate::import::capture::{Capture, SourceWorld};

/// Never by itself: the files are COLMAP's.
pub(super) fn detect(_path: &Path) -> bool {
    false
}

pub(super) fn read(path: &Path, options: &ImportOptions) -> Result<Capture> {
    let capture = colmap::read(path, options)?;
    Ok(Capture {
        kind: "mapanything".to_owned(),
        title: "MapAnything reconstruction".to_owned(),
        notes: vec!["lengths are metres as far as the network tells; --scale corrects them".to_owned()],
        world: SourceWorld { unit_m: Some(1.0), ..capture.world },
        ..capture
    })
}
