//! Reading a recording's folder and finding all that is wrong with it in one go.

use std::collections::{BTreeMap, BTreeSet};
use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};

use nalgebra::{Quaternion, UnitQuaternion};
use serde::Deserialize;

use super::{Camera, Clip, Frame, FrameFiles, HandSample, Recording, Side};
use crate::error::{Error, Result};
use crate::json;
use crate::math::{Point, Pose, Vector, stats};

/// The longest line of a CSV or log file.
pub(super) const MAX_LINE_BYTES: u64 = 64 << 10;
/// Faults of one kind that are listed before "and n more".
const MAX_LISTED: usize = 5;

#[derive(Deserialize)]
struct CamerasFile {
    width: usize,
    height: usize,
    fx: f64,
    fy: f64,
    cx: f64,
    cy: f64,
    frames: Vec<FrameEntry>,
    #[serde(default)]
    units: Option<String>,
    #[serde(default)]
    distortion: Option<serde_json::Value>,
}

#[derive(Deserialize)]
struct FrameEntry {
    frame: usize,
    #[serde(default)]
    file: Option<String>,
    timestamp: f64,
    position: [f64; 3],
    rotation_wxyz: [f64; 4],
}

#[derive(Deserialize)]
struct ClipsFile {
    clips: Vec<Clip>,
}

#[derive(Deserialize)]
struct HandsFile {
    frames: Vec<HandsFrame>,
}

#[derive(Deserialize)]
struct HandsFrame {
    frame: usize,
    hands: Vec<HandEntry>,
}

#[derive(Deserialize)]
struct HandEntry {
    side: Side,
    #[serde(default)]
    contact: Option<bool>,
    joints_world: Vec<[f64; 3]>,
}

/// Thumb, index and middle tips in MANO/OpenPose order.
const TIP_JOINTS: [usize; 3] = [4, 8, 12];

/// Faults, with a bound on how many of one kind are spelled out.
#[derive(Default)]
struct Faults {
    list: Vec<String>,
    counts: BTreeMap<&'static str, usize>,
}

impl Faults {
    fn add(&mut self, kind: &'static str, text: String) {
        let count = self.counts.entry(kind).or_default();
        *count += 1;
        if *count <= MAX_LISTED {
            self.list.push(text);
        }
    }

    fn finish(mut self, dir: &Path) -> Result<()> {
        for (kind, count) in &self.counts {
            if *count > MAX_LISTED {
                self.list.push(format!("{kind}: {} more like these", count - MAX_LISTED));
            }
        }
        if self.list.is_empty() { Ok(()) } else { Err(Error::Recording { path: dir.to_owned(), faults: self.list }) }
    }
}

pub(super) fn open(dir: &Path) -> Result<Recording> {
    if !dir.is_dir() {
        let message = if dir.exists() {
            "is a file; a recording is a folder with cameras.json, clips.json and hands.json"
        } else {
            "no such folder; a recording is a folder with cameras.json, clips.json and hands.json"
        };
        return Err(Error::Io { path: dir.to_owned(), message: message.to_owned() });
    }
    let mut faults = Faults::default();
    let cameras: CamerasFile = json::read(&dir.join("cameras.json"))?;
    let clips: ClipsFile = json::read(&dir.join("clips.json"))?;
    let camera = check_camera(&cameras, &mut faults);
    let frames = frames(dir, &cameras, &mut faults);
    check_clips(&clips.clips, frames.len(), &mut faults);
    let hands = hands(dir, frames.len(), &mut faults)?;
    check_hands(&hands, &frames, &mut faults);
    let labels = labels(dir)?;
    let reconstruction = reconstruction(dir)?;
    faults.finish(dir)?;

    let name = dir
        .canonicalize()
        .ok()
        .and_then(|d| d.file_name().map(|n| n.to_string_lossy().into_owned()))
        .unwrap_or_else(|| "recording".to_owned());
    Ok(Recording {
        name,
        dir: dir.to_owned(),
        camera,
        frames,
        clips: clips.clips,
        hands,
        labels,
        reconstruction,
        depth_factors: super::DepthFactors::default(),
    })
}

fn check_camera(file: &CamerasFile, faults: &mut Faults) -> Camera {
    let Camera { width, height, fx, fy, cx, cy } =
        Camera { width: file.width, height: file.height, fx: file.fx, fy: file.fy, cx: file.cx, cy: file.cy };
    // 64 megapixels: twice the largest camera that anyone wears, and an image that fits in memory many times.
    if width == 0 || height == 0 || width.saturating_mul(height) > 64 << 20 {
        faults.add("size", format!("cameras.json: image size {width} x {height} is not a camera's"));
    }
    if !(fx.is_finite() && fy.is_finite() && fx > 1.0 && fy > 1.0) {
        faults.add("focal", format!("cameras.json: fx {fx}, fy {fy} must be focal lengths in pixels"));
    }
    if !(cx.is_finite() && cy.is_finite()) {
        faults.add("centre", format!("cameras.json: cx {cx}, cy {cy} must be finite pixels"));
    }
    if let Some(units) = &file.units
        && !["m", "metre", "metres", "meter", "meters"].contains(&units.as_str())
    {
        faults.add("units", format!("cameras.json: units are \"{units}\"; convert poses, hands and depth to metres"));
    }
    if let Some(d) = &file.distortion {
        let none = match d {
            serde_json::Value::Null => true,
            serde_json::Value::String(s) => s == "none" || s.is_empty(),
            serde_json::Value::Array(a) => a.iter().all(|v| v.as_f64() == Some(0.0)),
            _ => false,
        };
        if !none {
            faults
                .add("distortion", "cameras.json: distorted images are not supported; undistort them first".to_owned());
        }
    }
    Camera { width, height, fx, fy, cx, cy }
}

fn frames(dir: &Path, file: &CamerasFile, faults: &mut Faults) -> Vec<Frame> {
    if file.frames.is_empty() {
        faults.add("frames", "cameras.json: no frames".to_owned());
    }
    let has_images = dir.join("frames").is_dir();
    let optional = |folder: &str, index: usize| -> Option<PathBuf> {
        let path = dir.join(folder).join(format!("{index:06}.png"));
        path.is_file().then_some(path)
    };
    let mut last = f64::NEG_INFINITY;
    let mut out = Vec::with_capacity(file.frames.len());
    for (index, entry) in file.frames.iter().enumerate() {
        let place = format!("cameras.json: frame {}", entry.frame);
        if entry.frame != index {
            faults.add("index", format!("{place}: is entry {index}; frames must be numbered 0, 1, 2, ... in order"));
        }
        if !entry.timestamp.is_finite() || entry.timestamp < last {
            faults.add("time", format!("{place}: timestamp {} s does not follow {last} s", entry.timestamp));
        } else {
            last = entry.timestamp;
        }
        if entry.position.iter().any(|x| !x.is_finite()) {
            faults.add("position", format!("{place}: position is not finite; drop the frame or interpolate its pose"));
        }
        let [w, x, y, z] = entry.rotation_wxyz;
        let q = Quaternion::new(w, x, y, z);
        if !q.norm().is_finite() || (q.norm() - 1.0).abs() > 1e-2 {
            faults.add(
                "rotation",
                format!("{place}: rotation_wxyz has norm {:.4}, a rotation has norm 1 (order is w x y z)", q.norm()),
            );
        }
        let rgb = match &entry.file {
            Some(name) if has_images => {
                let path = dir.join(name);
                if !path.is_file() {
                    faults.add("image", format!("{place}: {name} is listed but not there"));
                }
                Some(path)
            }
            _ => None,
        };
        out.push(Frame {
            timestamp_secs: entry.timestamp,
            world_from_camera: Pose::from_parts(
                Vector::from(entry.position).into(),
                UnitQuaternion::from_quaternion(if q.norm() > 0.0 { q } else { Quaternion::identity() }),
            ),
            files: FrameFiles {
                rgb,
                depth: optional("depth", index),
                normals: optional("normals", index),
                mask: optional("masks", index),
                segments: [format!("{index:06}.npz"), format!("{index:06}.txt"), format!("segments_{index}.txt")]
                    .map(|name| dir.join("segments").join(name))
                    .into_iter()
                    .find(|path| path.is_file()),
            },
        });
    }
    let steps: Vec<f64> = out.windows(2).map(|w| w[1].timestamp_secs - w[0].timestamp_secs).collect();
    if let Some(step) = stats::median(&steps).filter(|s| s.is_finite() && !(1e-3..=10.0).contains(s)) {
        faults.add(
            "time unit",
            format!("cameras.json: frames are {step:.3e} s apart (median), a video's are 0.005 to 1 s; write seconds"),
        );
    }
    let furthest = out.iter().map(|f| f.center().coords.norm()).fold(0.0, f64::max);
    // Head-worn recordings stay in a home; a home measured in millimetres is a city.
    if furthest.is_finite() && furthest > 1000.0 {
        faults.add(
            "units",
            format!("cameras.json: a camera is {furthest:.0} from the origin; positions must be metres (are these millimetres?)"),
        );
    }
    out
}

fn check_clips(clips: &[Clip], frames: usize, faults: &mut Faults) {
    if clips.is_empty() {
        faults
            .add("clips", "clips.json: the list of clips is empty; narrate at least one opening or closing".to_owned());
    }
    let mut names = BTreeSet::new();
    for clip in clips {
        if !names.insert(&clip.clip) {
            faults.add("name", format!("clips.json: clip {}: the name is used twice", clip.clip));
        }
        if clip.start_frame > clip.end_frame {
            let (a, b) = (clip.start_frame, clip.end_frame);
            faults.add("order", format!("clips.json: clip {}: start_frame {a} is after end_frame {b}", clip.clip));
        } else if clip.end_frame >= frames {
            faults.add(
                "outside",
                format!(
                    "clips.json: clip {}: frames {}..={} lie outside the video of {frames} frames",
                    clip.clip, clip.start_frame, clip.end_frame
                ),
            );
        }
    }
}

fn hands(dir: &Path, frames: usize, faults: &mut Faults) -> Result<Vec<HandSample>> {
    let full = dir.join("hands.json");
    let tips = dir.join("fingertips.csv");
    let (mut samples, unsaid) = if full.is_file() {
        hands_json(&full, faults)?
    } else if tips.is_file() {
        fingertips_csv(&tips)?
    } else {
        return Err(Error::Io {
            path: full,
            message: "no such file, and no fingertips.csv either; a recording needs one of them".to_owned(),
        });
    };
    let name = if full.is_file() { "hands.json" } else { "fingertips.csv" };
    samples.retain(|s| {
        let inside = s.frame < frames;
        if !inside {
            faults.add("hand frame", format!("{name}: frame {}: the video has {frames} frames", s.frame));
        }
        let finite = s.tips.iter().all(|p| p.coords.iter().all(|x| x.is_finite()));
        if !finite {
            faults.add("hand", format!("{name}: frame {}: a fingertip is not finite; leave the hand out", s.frame));
        }
        inside && finite
    });
    samples.sort_by_key(|s| (s.frame, s.side));
    check_contact(&samples, unsaid, faults);
    Ok(samples)
}

/// Hands of which none is in contact leave nothing to infer from; a file that says of none has another way out than a detector
/// that says no.
fn check_contact(samples: &[HandSample], unsaid: usize, faults: &mut Faults) {
    if samples.is_empty() || samples.iter().any(|s| s.contact) {
        return;
    }
    let told = if unsaid > 0 { format!(" (of {unsaid} the file does not say)") } else { String::new() };
    faults.add(
        "contact",
        format!(
            "hands: no sample is in contact{told}; run a contact detector and fill \"contact\"; true in every sample means \
             that nobody knows, and goes with hands.use_contact = false in the config"
        ),
    );
}

/// The samples, and of how many of them the file does not say whether they are in contact.
fn hands_json(path: &Path, faults: &mut Faults) -> Result<(Vec<HandSample>, usize)> {
    let file: HandsFile = json::read(path)?;
    let mut samples = Vec::new();
    let mut unsaid = 0;
    for frame in file.frames {
        for hand in frame.hands {
            let Some(tips) = TIP_JOINTS.iter().map(|&j| hand.joints_world.get(j)).collect::<Option<Vec<_>>>() else {
                let n = hand.joints_world.len();
                faults.add("joints", format!("hands.json: frame {}: {n} joints, expected 21", frame.frame));
                continue;
            };
            let tips = [0, 1, 2].map(|i| Point::from(*tips[i]));
            unsaid += usize::from(hand.contact.is_none());
            let contact = hand.contact.unwrap_or(false);
            samples.push(HandSample { frame: frame.frame, side: hand.side, contact, tips });
        }
    }
    Ok((samples, unsaid))
}

/// Reads a line of at most [`MAX_LINE_BYTES`]; `None` at the end of the file.
pub(super) fn bounded_line(reader: &mut impl BufRead, path: &Path, number: usize) -> Result<Option<String>> {
    let mut bytes = Vec::new();
    let read = reader.take(MAX_LINE_BYTES + 1).read_until(b'\n', &mut bytes).map_err(|e| Error::io(path, &e))?;
    if read == 0 {
        return Ok(None);
    }
    if read as u64 > MAX_LINE_BYTES {
        return Err(Error::format(path, format!("line {number}"), "is longer than 64 KiB; is this a text table?"));
    }
    let text =
        String::from_utf8(bytes).map_err(|_| Error::format(path, format!("line {number}"), "is not UTF-8 text"))?;
    Ok(Some(text.trim_end_matches(['\n', '\r']).to_owned()))
}

/// The samples, and of how many of them the file does not say whether they are in contact: their cell is empty.
fn fingertips_csv(path: &Path) -> Result<(Vec<HandSample>, usize)> {
    const TIPS: [[&str; 3]; 3] =
        [["thumb_x", "thumb_y", "thumb_z"], ["index_x", "index_y", "index_z"], ["middle_x", "middle_y", "middle_z"]];
    let file = File::open(path).map_err(|e| Error::io(path, &e))?;
    let mut reader = BufReader::new(file);
    let header = bounded_line(&mut reader, path, 1)?
        .ok_or_else(|| Error::format(path, "line 1", "the file is empty; expected a header line"))?;
    let columns: Vec<&str> = header.split(',').map(str::trim).collect();
    let column = |name: &str| {
        columns.iter().position(|c| *c == name).ok_or_else(|| {
            Error::format(path, "line 1", format!("no column \"{name}\"; found: {}", columns.join(", ")))
        })
    };
    let (frame, side, contact) = (column("frame")?, column("side")?, column("contact")?);
    let mut tip_columns = [[0; 3]; 3];
    for (tip, names) in tip_columns.iter_mut().zip(TIPS) {
        for (index, name) in tip.iter_mut().zip(names) {
            *index = column(name)?;
        }
    }
    let mut samples = Vec::new();
    let mut unsaid = 0;
    let mut number = 1;
    loop {
        number += 1;
        let Some(line) = bounded_line(&mut reader, path, number)? else { break };
        if line.trim().is_empty() {
            continue;
        }
        let cells: Vec<&str> = line.split(',').map(str::trim).collect();
        let place = || format!("line {number}");
        if cells.len() != columns.len() {
            let message = format!("{} cells, the header has {}", cells.len(), columns.len());
            return Err(Error::format(path, place(), message));
        }
        let number_at = |i: usize| -> Result<f64> {
            cells[i].parse::<f64>().map_err(|_| {
                Error::format(path, place(), format!("column {}: \"{}\" is not a number", columns[i], cells[i]))
            })
        };
        let index = cells[frame].parse::<usize>().map_err(|_| {
            Error::format(path, place(), format!("column frame: \"{}\" is not a frame number", cells[frame]))
        })?;
        let side = match cells[side] {
            "left" => Side::Left,
            "right" => Side::Right,
            other => {
                return Err(Error::format(path, place(), format!("column side: \"{other}\" is not left or right")));
            }
        };
        let mut tips = [Point::origin(); 3];
        for (tip, columns) in tips.iter_mut().zip(tip_columns) {
            *tip = Point::new(number_at(columns[0])?, number_at(columns[1])?, number_at(columns[2])?);
        }
        unsaid += usize::from(cells[contact].is_empty());
        let contact = matches!(cells[contact], "1" | "true" | "True");
        samples.push(HandSample { frame: index, side, contact, tips });
    }
    Ok((samples, unsaid))
}

/// A hand's own size tells the unit of the file, whatever the scene is like.
fn check_hands(hands: &[HandSample], frames: &[Frame], faults: &mut Faults) {
    if hands.is_empty() {
        faults.add("hands", "hands.json / fingertips.csv: no hand in any frame".to_owned());
        return;
    }
    let spreads: Vec<f64> = hands.iter().map(|s| (s.tips[0] - s.tips[1]).norm()).collect();
    let distances: Vec<f64> =
        hands.iter().filter_map(|s| frames.get(s.frame).map(|f| (s.grasp() - f.center()).norm())).collect();
    if let Some(spread) = stats::median(&spreads)
        && !(0.002..0.3).contains(&spread)
    {
        faults.add(
            "units",
            format!(
                "hands: thumb and index tips are {spread:.3} apart (median), a hand's are 0.01 to 0.2 m; \
                 convert the hands to metres"
            ),
        );
    } else if let Some(distance) = stats::median(&distances)
        && !(0.05..3.0).contains(&distance)
    {
        faults.add(
            "units",
            format!(
                "hands are {distance:.2} from the camera (median), an arm reaches 0.2 to 1.2 m; hands and camera poses \
                 must share one world frame and one unit (metres)"
            ),
        );
    }
}

fn labels(dir: &Path) -> Result<BTreeMap<u8, String>> {
    let path = dir.join("labels.json");
    if !path.is_file() {
        return Ok(BTreeMap::new());
    }
    let raw: BTreeMap<String, String> = json::read(&path)?;
    raw.into_iter()
        .map(|(class, name)| match class.parse::<u8>() {
            Ok(class) => Ok((class, name)),
            Err(_) => Err(Error::format(&path, format!("key \"{class}\""), "classes are numbers 1 to 255")),
        })
        .collect()
}

fn reconstruction(dir: &Path) -> Result<Vec<Point>> {
    let (ply, obj) = (dir.join("reconstruction.ply"), dir.join("reconstruction.obj"));
    let points = if ply.is_file() {
        ply_points(&ply)?
    } else if obj.is_file() {
        obj_points(&obj)?
    } else {
        return Ok(Vec::new());
    };
    let finite: Vec<Point> = points.into_iter().filter(|p| p.coords.iter().all(|x| x.is_finite())).collect();
    if finite.is_empty() {
        let file = if ply.is_file() { ply } else { obj };
        return Err(Error::format(
            &file,
            "vertices",
            "no finite points (of an OBJ only vertices in faces count); use PLY",
        ));
    }
    Ok(finite)
}

#[derive(Default)]
struct PlyVertex([f64; 3]);

impl ply_rs_bw::ply::PropertyAccess for PlyVertex {
    fn new() -> Self {
        Self::default()
    }

    fn set_float(&mut self, name: &str, value: f32) -> ply_rs_bw::ply::PropertyAccessResult {
        self.set_double(name, f64::from(value))
    }

    fn set_double(&mut self, name: &str, value: f64) -> ply_rs_bw::ply::PropertyAccessResult {
        let index = match name {
            "x" => 0,
            "y" => 1,
            "z" => 2,
            _ => return ply_rs_bw::ply::PropertyAccessResult::Ignored,
        };
        self.0[index] = value;
        ply_rs_bw::ply::PropertyAccessResult::Set
    }
}

fn ply_points(path: &Path) -> Result<Vec<Point>> {
    let file = File::open(path).map_err(|e| Error::io(path, &e))?;
    let mut reader = BufReader::new(file);
    let ply = ply_rs_bw::parser::Parser::<PlyVertex>::new().read_ply(&mut reader).map_err(|e| {
        Error::format(path, "ply", format!("cannot be read ({e}); write it again as binary or ASCII PLY"))
    })?;
    let vertices = ply.payload.get("vertex").ok_or_else(|| Error::format(path, "header", "no element \"vertex\""))?;
    Ok(vertices.iter().map(|v| Point::from(v.0)).collect())
}

fn obj_points(path: &Path) -> Result<Vec<Point>> {
    let options = tobj::LoadOptions { ignore_points: false, ..Default::default() };
    let (models, _) = tobj::load_obj(path, &options)
        .map_err(|e| Error::format(path, "obj", format!("cannot be read ({e}); export the mesh again")))?;
    Ok(models
        .iter()
        .flat_map(|m| m.mesh.positions.chunks_exact(3))
        .map(|c| Point::new(f64::from(c[0]), f64::from(c[1]), f64::from(c[2])))
        .collect())
}
