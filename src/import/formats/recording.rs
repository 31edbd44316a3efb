//! A recording of ours (`docs/recording-format.md`): what networks make of its `frames/`, which are fewer than the source's and
//! numbered anew, meets them again by name and number.
//!
//! All of it is there to be joined: a source that is given before it replaces a stream. Hands and clips may be missing, as
//! they are where a network is still to find them.

use std::collections::BTreeMap;
use std::path::Path;

use crate::error::{Error, Result};
use crate::import::ImportOptions;
use crate::import::blob::{Blob, inside};
use crate::import::capture::{
    At, Capture, ClipAt, Depth, DepthAt, DepthCoding, HandAt, HandStream, ImageAt, ImageSource, JointFrame, Layer,
    MaskAt, Masks, Normals, NormalsAt, PoseAt, Poses, RawPose, RawRotation, SegmentsAt, SourceWorld,
};
use crate::import::joint_orders::{JointOrder, TIPS};
use crate::import::optics::Optics;
use crate::import::text::TextTable;
use crate::math::Vector;
use crate::recording::tables::{self, CamerasFile, ClipsFile, FrameEntry, HandsFile, HandsFrame};
use crate::recording::{Side, reconstruction, segments};

/// Joints of a hand.
const JOINTS: usize = 21;
/// Normals are `(value - 128) / 127`.
const NORMALS_ZERO: f64 = 128.0;
const NORMALS_FACTOR: f64 = 1.0 / 127.0;

pub(super) fn detect(path: &Path) -> bool {
    let has = |name: &str| path.join(name).is_file();
    has("cameras.json") && ["import.json", "clips.json", "hands.json", "fingertips.csv"].iter().any(|name| has(name))
}

pub(super) fn read(path: &Path, _options: &ImportOptions) -> Result<Capture> {
    let file = path.join("cameras.json");
    let cameras: CamerasFile = crate::json::read(&file)?;
    let optics = Optics::pinhole(cameras.width, cameras.height, [cameras.fx, cameras.fy, cameras.cx, cameras.cy]);
    if let Some(fault) = optics.fault() {
        return Err(Error::format(&file, "intrinsics", fault));
    }
    let mut out = Capture {
        kind: "recording".to_owned(),
        source: path.to_owned(),
        title: "a recording of ours".to_owned(),
        world: SourceWorld { up: Some(Vector::z()), ..SourceWorld::default() },
        optics: Some(optics),
        ..Capture::default()
    };
    let times: Vec<f64> = cameras.frames.iter().map(|f| f.timestamp).collect();
    frames(path, &cameras.frames, &mut out)?;
    out.hands = hands(path)?;
    out.clips = clips(path, &times)?;
    if let Some(points) = inside(path, "reconstruction.ply")? {
        out.points = reconstruction::ply_points(&points)?;
    }
    Ok(out)
}

/// Where an item of a frame belongs. Without its time: two frames may have one.
fn numbered(index: usize) -> At {
    At::name(&format!("{index:06}.png")).with_index(index)
}

/// Poses and everything that is an image.
fn frames(path: &Path, rows: &[FrameEntry], out: &mut Capture) -> Result<()> {
    let (mut poses, mut depth, mut normals) = (Vec::new(), Vec::new(), Vec::new());
    let mut masks = Masks { labels: labels(path)?, items: Vec::new() };
    for (index, row) in rows.iter().enumerate() {
        let of = |folder: &str| inside(path, &format!("{folder}/{index:06}.png"));
        let image = match &row.file {
            Some(name) => inside(path, name)?,
            None => first(path, &["jpg", "jpeg", "png"].map(|ending| format!("frames/{index:06}.{ending}")))?,
        };
        // A network names its results after the image that it read.
        let named = numbered(index);
        let at = match &row.file {
            Some(name) => named.with_name(name),
            None => named,
        };
        let timed = At { time_secs: Some(row.timestamp).filter(|t| t.is_finite()), ..at.clone() };
        let [w, x, y, z] = row.rotation_wxyz;
        let pose = RawPose { position: row.position, turn: RawRotation::Quaternion([x, y, z, w]) };
        poses.push(PoseAt { at: timed.clone(), pose, optics: None });
        if let Some(image) = image {
            out.images.push(ImageAt { at: timed, picture: ImageSource::Still(Blob::File(image)), optics: None });
        }
        if let Some(file) = of("depth")? {
            let blob = Blob::File(file);
            depth.push(DepthAt { at: at.clone(), blob, confidence: None, optics: None, pose: None });
        }
        if let Some(file) = of("masks")? {
            masks.items.push(MaskAt { at: at.clone(), layers: vec![Layer::Classes(Blob::File(file))] });
        }
        if let Some(file) = of("normals")? {
            normals.push(NormalsAt { at: at.clone(), blob: Blob::File(file) });
        }
        let lines = [format!("{index:06}.npz"), format!("{index:06}.txt"), format!("segments_{index}.txt")];
        if let Some(file) = first(path, &lines.map(|name| format!("segments/{name}")))? {
            out.segments.push(SegmentsAt { at, segments: segments::read(&file)? });
        }
    }
    out.poses = Some(Poses { items: poses, ..Poses::default() });
    out.depth = (!depth.is_empty()).then(|| Depth::of(DepthCoding::Png16 { unit_m: 1e-3 }, depth));
    out.masks = (!masks.items.is_empty()).then_some(masks);
    out.normals =
        (!normals.is_empty()).then_some(Normals { zero: NORMALS_ZERO, factor: [NORMALS_FACTOR; 3], items: normals });
    Ok(())
}

/// The first of some files that is there.
fn first(path: &Path, names: &[String]) -> Result<Option<std::path::PathBuf>> {
    for name in names {
        if let Some(file) = inside(path, name)? {
            return Ok(Some(file));
        }
    }
    Ok(None)
}

fn labels(path: &Path) -> Result<BTreeMap<u8, String>> {
    // Where it leads elsewhere it is an error.
    inside(path, "labels.json")?.map_or_else(|| Ok(BTreeMap::new()), |_| tables::labels(path))
}

fn clips(path: &Path, times: &[f64]) -> Result<Vec<ClipAt>> {
    let Some(file) = inside(path, "clips.json")? else { return Ok(Vec::new()) };
    let clips: ClipsFile = crate::json::read(&file)?;
    let at = |frame: usize| At { time_secs: times.get(frame).copied(), ..numbered(frame) };
    Ok(clips
        .clips
        .into_iter()
        .map(|c| ClipAt {
            name: c.clip,
            start: at(c.start_frame),
            end: at(c.end_frame),
            narration: c.narration,
            verb: c.verb,
            noun: c.noun,
        })
        .collect())
}

fn hands(path: &Path) -> Result<Option<HandStream>> {
    let items = match (inside(path, "hands.json")?, inside(path, "fingertips.csv")?) {
        (Some(file), _) => joints(&file)?,
        (None, Some(file)) => fingertips(&file)?,
        (None, None) => return Ok(None),
    };
    Ok(Some(HandStream { frame: JointFrame::World, order: JointOrder::Mano, unit_m: 1.0, items }))
}

/// `hands.json`: all joints.
fn joints(file: &Path) -> Result<Vec<HandAt>> {
    let hands: HandsFile = crate::json::read(file)?;
    let of_row = |row: HandsFrame| {
        row.hands.into_iter().map(move |hand| HandAt {
            at: numbered(row.frame),
            side: hand.side,
            joints: hand.joints_world.into_iter().map(Some).collect(),
            contact: hand.contact,
            score: hand.score.as_ref().and_then(serde_json::Value::as_f64),
        })
    };
    Ok(hands.frames.into_iter().flat_map(of_row).collect())
}

/// `fingertips.csv`: three tips of each hand.
fn fingertips(file: &Path) -> Result<Vec<HandAt>> {
    const COLUMNS: [[&str; 3]; 3] =
        [["thumb_x", "thumb_y", "thumb_z"], ["index_x", "index_y", "index_z"], ["middle_x", "middle_y", "middle_z"]];
    let mut table = TextTable::open(file)?;
    table.need(&["frame", "side"])?;
    table.need(COLUMNS.as_flattened())?;
    let mut out = Vec::new();
    while let Some(row) = table.row()? {
        let side = match row.text("side") {
            "left" => Side::Left,
            "right" => Side::Right,
            other => return Err(row.fault(&format!("column side: \"{other}\" is not left or right"))),
        };
        let contact = match row.text("contact") {
            "" => None,
            "1" | "true" | "True" => Some(true),
            "0" | "false" | "False" => Some(false),
            other => return Err(row.fault(&format!("column contact: \"{other}\" is not 0 or 1"))),
        };
        let mut joints = vec![None; JOINTS];
        for (at, columns) in TIPS.into_iter().zip(COLUMNS) {
            if let Some(joint) = joints.get_mut(at) {
                *joint = Some(row.numbers(columns)?);
            }
        }
        let score = row.text("score").parse::<f64>().ok().filter(|s| s.is_finite());
        out.push(HandAt { at: numbered(row.whole("frame")?), side, joints, contact, score });
    }
    Ok(out)
}
