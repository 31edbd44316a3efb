//! A twin's joints in the forms of other data sets: Arti4D's list, EgoArti's list, and what USDNet is trained on.

use rayon::prelude::*;
use serde_json::{Map, Value};

use crate::articulation::JointKind;
use crate::error::{Error, Result};
use crate::import::ply::Cloud;
use crate::json;
use crate::math::Point;
use crate::twin::{Furniture, OrientedBox, Part, Solid, Twin};

/// Format: as far as a reconstruction's points lie beside the boxes that stand for their surfaces, metres: USDNet's own tolerance when
/// it looks for the points of a part's mesh.
const ON_PART_M: f64 = 0.02;

/// The file, in which each object has a key: a point of the hinge and the axis, as Arti4D has them; and the type, which Arti4D
/// keeps in its `metadata.yaml`.
///
/// # Errors
/// Where a number cannot be written.
pub fn arti4d(twin: &Twin) -> Result<String> {
    let all: Map<String, Value> = twin
        .furniture
        .iter()
        .map(|f| {
            let joint = f.part.joint.articulation;
            (f.part.id.clone(), serde_json::json!({"position": joint.origin, "axis": joint.axis, "type": joint.kind}))
        })
        .collect();
    json::text(&all)
}

/// A clip, and the id of the joint that it shows.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Shown {
    /// Name of the recording.
    pub recording: String,
    /// Name of the clip.
    pub clip: String,
    /// The joint's id in the twin.
    pub joint: String,
}

impl Shown {
    /// EgoArti's key: the video's name and the clip's number. Clips of HD-EPIC are named so already.
    fn key(&self) -> String {
        match self.clip.starts_with(&self.recording) {
            true => self.clip.clone(),
            false => format!("{}-{}", self.recording, self.clip),
        }
    }
}

/// EgoArti's list, clip to piece of furniture (`cupboard.009`: its noun, and which of that noun), and the annotations of the
/// clips beside it: object, type, axis, origin. Clips that show no joint of the twin are left out.
///
/// # Errors
/// Where a number cannot be written.
pub fn egoarti(twin: &Twin, clips: &[Shown]) -> Result<[String; 2]> {
    let mut list = Map::new();
    let mut annotations = Map::new();
    for shown in clips {
        let Some(index) = twin.furniture.iter().position(|f| f.part.id == shown.joint) else { continue };
        let Some(f) = twin.furniture.get(index) else { continue };
        let object = fixture(twin, index, &f.part);
        let joint = f.part.joint.articulation;
        annotations.insert(
            shown.key(),
            serde_json::json!({"object": object, "type": joint.kind, "axis": joint.axis, "origin": joint.origin}),
        );
        list.insert(shown.key(), Value::from(object));
    }
    Ok([json::text(&list)?, json::text(&annotations)?])
}

/// The name of a piece of furniture as HD-EPIC names it.
fn fixture(twin: &Twin, index: usize, part: &Part) -> String {
    let before = twin.furniture.iter().take(index).filter(|f| f.part.label == part.label).count();
    let noun: String = part.label.chars().map(|c| if c.is_whitespace() { '_' } else { c }).collect();
    format!("{}.{:03}", if noun.is_empty() { "furniture" } else { noun.as_str() }, before + 1)
}

/// The files of [`usdnet`].
#[derive(Debug, Clone, PartialEq)]
pub struct Parts {
    /// `SCENE_articulation.json` as Articulate3D has it, with the `indices` of each part's points.
    pub articulation: String,
    /// USDNet's processed points as numpy writes them, 13 columns of 32-bit floats: x y z, red green blue (0 to 255), normal,
    /// class (0 nothing, 1 turns, 2 slides), part, segment (0), handle (the part's number, else 0).
    pub points: Vec<u8>,
    /// `instance_gt`: a line for each point, class times 1000 and part plus 1.
    pub instances: String,
    /// Joints without a point of the reconstruction, which are left out.
    pub unseen: Vec<String>,
}

/// The scene as USDNet is trained on it. A point is its nearest solid's, if that is within 2 cm: parts stand where the
/// reconstruction, in the twin's frame and in metres, has them closed.
///
/// # Errors
/// Where a part cannot be told from a class (more than 998 parts), or no part has points.
pub fn usdnet(twin: &Twin, cloud: &Cloud) -> Result<Parts> {
    // The labels count parts below 1000.
    if twin.furniture.len() > 998 {
        return Err(Error::Export(format!("usdnet: {} parts, 998 are the most", twin.furniture.len())));
    }
    let places: Vec<Option<(usize, bool)>> = cloud.points.par_iter().map(|p| part_at(twin, p)).collect();
    let mut indices = vec![Vec::new(); twin.furniture.len()];
    for (i, place) in places.iter().enumerate() {
        if let Some(own) = place.and_then(|(part, _)| indices.get_mut(part)) {
            own.push(i);
        }
    }
    let mut unseen = Vec::new();
    let mut articulations = Vec::new();
    for (i, (f, own)) in twin.furniture.iter().zip(&indices).enumerate() {
        if own.is_empty() {
            unseen.push(f.part.id.clone());
        } else {
            articulations.push(articulation(i + 1, &f.part, own));
        }
    }
    if articulations.is_empty() {
        return Err(Error::Export(
            "usdnet: no point of the reconstruction lies on a part; it must be in the recording's world frame and in \
             metres, with the parts closed"
                .to_owned(),
        ));
    }
    let class = |part: usize| twin.furniture.get(part).map_or(0, |f| class(f.part.joint.articulation.kind));
    let instances = places.iter().map(|place| match place {
        Some((part, _)) => format!("{}\n", class(*part) * 1000 + part + 2),
        None => "1\n".to_owned(),
    });
    Ok(Parts {
        articulation: json::text(&serde_json::json!({"scan_id": twin.name, "data": {"articulations": articulations}}))?,
        instances: instances.collect(),
        points: rows(cloud, &places, &class),
        unseen,
    })
}

/// USDNet's number of a type.
fn class(kind: JointKind) -> usize {
    match kind {
        JointKind::Revolute => 1,
        JointKind::Prismatic => 2,
    }
}

fn articulation(pid: usize, part: &Part, indices: &[usize]) -> Value {
    let joint = part.joint.articulation;
    let kind = match joint.kind {
        JointKind::Revolute => "rotation",
        JointKind::Prismatic => "translation",
    };
    serde_json::json!({"pid": pid, "label": part.id, "type": kind, "axis": joint.axis, "origin": joint.origin, "rangeMin": 0.0,
        "rangeMax": part.joint.upper, "state": 0.0, "isClosed": true, "indices": indices})
}

/// The part that a point is on, and whether it is on its handle.
fn part_at(twin: &Twin, p: &Point) -> Option<(usize, bool)> {
    let mut best: Option<(f64, Option<(usize, bool)>)> = None;
    for (i, f) in twin.furniture.iter().enumerate() {
        for (solid, place) in solids(f, i) {
            let off = distance(&solid.shape, p);
            // A part's own box comes first where a board touches it.
            if off <= ON_PART_M && best.as_ref().is_none_or(|(least, _)| off < *least) {
                best = Some((off, place));
            }
        }
    }
    best.and_then(|(_, place)| place)
}

/// The solids of a piece with what a point on them is: parts first.
fn solids(f: &Furniture, index: usize) -> impl Iterator<Item = (&Solid, Option<(usize, bool)>)> {
    let moving = f.part.solids.iter().map(move |s| (s, Some((index, s.role == crate::twin::Role::Handle))));
    moving.chain(f.carcass.iter().map(|s| (s, None)))
}

/// Distance of a point from a box, metres; 0 inside.
fn distance(shape: &OrientedBox, p: &Point) -> f64 {
    let local = shape.rotation.transpose() * (p - shape.center);
    (local.abs() - shape.half).map(|x| x.max(0.0)).norm()
}

/// The processed points as an npy file.
fn rows(cloud: &Cloud, places: &[Option<(usize, bool)>], class: &dyn Fn(usize) -> usize) -> Vec<u8> {
    /// Format: columns of a row.
    const COLUMNS: usize = 13;
    let mut bytes = npy_header(cloud.points.len(), COLUMNS);
    for (i, (p, place)) in cloud.points.iter().zip(places).enumerate() {
        let color = cloud.colors.get(i).copied().unwrap_or([127; 3]).map(f32::from);
        let normal = cloud.normals.get(i).copied().unwrap_or_default();
        let (kind, part, handle) = match place {
            Some((part, on_handle)) => (class(*part), part + 1, if *on_handle { part + 1 } else { 0 }),
            None => (0, 0, 0),
        };
        let labels = [kind as f32, part as f32, 0.0, handle as f32];
        let place = [p.x as f32, p.y as f32, p.z as f32];
        for value in place.iter().chain(&color).chain(&normal).chain(&labels) {
            bytes.extend(value.to_le_bytes());
        }
    }
    bytes
}

/// Version 1.0 of numpy's header, padded so that the numbers begin at a multiple of 64.
fn npy_header(rows: usize, columns: usize) -> Vec<u8> {
    let mut text = format!("{{'descr': '<f4', 'fortran_order': False, 'shape': ({rows}, {columns}), }}");
    // Magic, version and length are 10 bytes, the line's end is one.
    let total = (10 + text.len() + 1).next_multiple_of(64);
    let padding = total - 11 - text.len();
    text += &" ".repeat(padding);
    text.push('\n');
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((text.len() as u16).to_le_bytes());
    bytes.extend(text.as_bytes());
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_npy_header_is_aligned_and_says_its_shape() {
        let header = npy_header(1234, 13);
        assert_eq!(header.len() % 64, 0);
        assert_eq!(header.last(), Some(&b'\n'));
        let array = npyz::NpyFile::new(header.as_slice()).unwrap();
        assert_eq!(array.shape(), [1234, 13]);
    }

    #[test]
    fn clips_of_one_video_have_its_name_once() {
        let shown = |recording: &str, clip: &str| {
            Shown { recording: recording.to_owned(), clip: clip.to_owned(), joint: String::new() }.key()
        };
        assert_eq!(shown("P01-20240202-110250", "P01-20240202-110250-1"), "P01-20240202-110250-1");
        assert_eq!(shown("kitchen", "clip_003"), "kitchen-clip_003");
    }
}
