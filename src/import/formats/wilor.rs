//! WiLoR (and HaMeR): the OBJ meshes of its demo, `{image}_{number}.obj`, beside `{image}.jpg`.
//!
//! A mesh is MANO's 778 vertices in their order, turned half about x (OpenGL axes). Tips are single vertices of it; other joints
//! need MANO's own numbers and are left out. Left and right differ by the order of a face's corners alone. The demo takes the
//! focal length 5000 / 256 of the image's longer side, so distances are those of the camera only once they are corrected.

use std::path::Path;

use crate::error::{Error, Result};
use crate::import::ImportOptions;
use crate::import::blob::files;
use crate::import::capture::{At, CameraAxes, Capture, HandAt, HandStream, JointFrame};
use crate::import::joint_orders::JointOrder;
use crate::import::names::{numbered, stem};
use crate::import::text::Lines;
use crate::recording::Side;

/// Vertices of MANO's mesh.
const VERTICES: usize = 778;
/// Vertices at the tips, thumb to little finger, and their places among MANO's joints.
const TIPS: [(usize, usize); 5] = [(744, 4), (320, 8), (443, 12), (554, 16), (671, 20)];
/// A face of MANO's right hand; the left one's has its corners the other way round.
const FACE: [usize; 3] = [92, 38, 234];
/// The demo's focal length, pixels, for crops of this width.
const FOCAL: f64 = 5000.0;
const CROP: f64 = 256.0;

/// Image and number of a mesh's file.
fn image_of(path: &Path) -> Option<String> {
    let stem = stem(path);
    let (head, _) = numbered(&stem)?;
    Some(head.strip_suffix('_')?.to_owned())
}

pub(super) fn detect(path: &Path) -> bool {
    path.is_dir()
        && files(path, &["obj"]).first().is_some_and(|file| {
            image_of(file).is_some_and(|image| path.join(format!("{image}.jpg")).is_file()) && mesh(file).is_ok()
        })
}

pub(super) fn read(path: &Path, _options: &ImportOptions) -> Result<Capture> {
    let (mut items, mut notes) = (Vec::new(), Vec::new());
    let mut first_fault = None;
    let mut faults = 0;
    let meshes = files(path, &["obj"]);
    for file in &meshes {
        let Some(image) = image_of(file) else { continue };
        match mesh(file) {
            Ok((side, joints)) => items.push(HandAt {
                at: At { name: Some(image), ..At::default() },
                side,
                joints,
                contact: None,
                score: None,
            }),
            Err(error) => {
                faults += 1;
                first_fault.get_or_insert(error);
            }
        }
    }
    match first_fault {
        Some(error) if items.is_empty() => return Err(error),
        Some(error) => notes.push(format!("{faults} of {} meshes are left out, the first one: {error}", meshes.len())),
        None => {}
    }
    let Some(first) = items.first() else {
        let message = "holds no meshes IMAGE_NUMBER.obj; run the demo with --save_mesh".to_owned();
        return Err(Error::Io { path: path.to_owned(), message });
    };
    let name = first.at.name.clone().unwrap_or_default();
    let size = image::image_dimensions(path.join(format!("{name}.jpg"))).ok();
    let (width, height) = size.map_or((4.0, 3.0), |(w, h)| (f64::from(w), f64::from(h)));
    if size.is_none() {
        notes.push("no image lies beside the meshes: images are taken to be wider than high".to_owned());
    }
    notes.push("fingertips only; distances are corrected by the camera's own focal length".to_owned());
    Ok(Capture {
        kind: "wilor".to_owned(),
        source: path.to_owned(),
        title: "WiLoR meshes".to_owned(),
        licence: Some("CC BY-NC-ND 4.0 (WiLoR), MANO's licence".to_owned()),
        notes,
        hands: Some(HandStream {
            frame: JointFrame::Camera(CameraAxes::Opengl),
            order: JointOrder::Mano,
            unit_m: 1.0,
            items,
        }),
        hands_focal_per_width: Some(FOCAL / CROP * f64::max(width, height) / width),
        ..Capture::default()
    })
}

/// Side and joints of a mesh.
fn mesh(path: &Path) -> Result<(Side, Vec<Option<[f64; 3]>>)> {
    let mut lines = Lines::open(path)?;
    let mut vertices: Vec<[f64; 3]> = Vec::new();
    let mut side = None;
    while let Some(line) = lines.content()? {
        let mut cells = line.split_whitespace();
        match cells.next() {
            Some("v") => {
                let mut p = [0.0; 3];
                for value in &mut p {
                    *value = lines.number("vertex", cells.next().unwrap_or_default())?;
                }
                vertices.push(p);
                if vertices.len() > VERTICES {
                    break;
                }
            }
            Some("f") if side.is_none() => side = face_side(cells),
            _ => {}
        }
    }
    if vertices.len() != VERTICES {
        let message = format!("has {} vertices, MANO's hand {VERTICES}", vertices.len());
        return Err(Error::format(path, "vertices", message));
    }
    let Some(side) = side else {
        let message = "its faces are not MANO's in their order, so neither side nor fingertips are known; export joints with \
                       examples/import/wilor.py";
        return Err(Error::format(path, "faces", message));
    };
    let mut joints = vec![None; 21];
    for (vertex, joint) in TIPS {
        if let (Some(slot), Some(p)) = (joints.get_mut(joint), vertices.get(vertex)) {
            *slot = Some(*p);
        }
    }
    Ok((side, joints))
}

/// The side that a face tells: the known one, in either order of its corners.
fn face_side<'a>(cells: impl Iterator<Item = &'a str>) -> Option<Side> {
    let corners: Vec<usize> =
        cells.filter_map(|c| c.split('/').next()?.parse::<usize>().ok()?.checked_sub(1)).collect();
    let [a, b, c] = corners.as_slice() else { return None };
    let turns = [[*a, *b, *c], [*b, *c, *a], [*c, *a, *b]];
    if turns.contains(&FACE) {
        return Some(Side::Right);
    }
    let [x, y, z] = FACE;
    turns.contains(&[x, z, y]).then_some(Side::Left)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_face_tells_the_side_whichever_corner_comes_first() {
        let side = |text: &str| face_side(text.split_whitespace());
        assert_eq!(side("93 39 235"), Some(Side::Right));
        assert_eq!(side("39/1/1 235/2/2 93/3/3"), Some(Side::Right));
        assert_eq!(side("93 235 39"), Some(Side::Left));
        assert_eq!(side("1 2 3"), None);
        assert_eq!(side("0 39 235"), None);
    }
}
