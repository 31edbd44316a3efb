//! Reading a recording's folder and finding all that is wrong with it in one go.

use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};

use nalgebra::{Quaternion, UnitQuaternion};

use super::checks::{self, Faults};
use super::folder::Folder;
use super::tables::{self, CamerasFile, ClipsFile, FrameEntry, HandsFile, TIP_JOINTS};
use super::{Camera, Frame, FrameFiles, HandSample, LeftOut, Recording, Side, reconstruction};
use crate::error::{Error, Result};
use crate::json;
use crate::math::{Point, Pose, Vector};

/// The longest line of a CSV or log file.
pub(super) const MAX_LINE_BYTES: u64 = 64 << 10;

/// The tables of a recording; images are named by frame.
const TABLES: [&str; 7] = [
    "cameras.json",
    "clips.json",
    "hands.json",
    "fingertips.csv",
    "labels.json",
    "reconstruction.ply",
    "reconstruction.obj",
];

/// `judge`: hands out of the head's reach are a fault.
pub(super) fn open(dir: &Path, follow_links: bool, judge: bool) -> Result<Recording> {
    if !dir.is_dir() {
        let message = if dir.exists() {
            "is a file; a recording is a folder with cameras.json and hands.json"
        } else {
            "no such folder; a recording is a folder with cameras.json and hands.json"
        };
        return Err(Error::Io { path: dir.to_owned(), message: message.to_owned() });
    }
    let folder = Folder::new(dir, follow_links)?;
    let elsewhere: Vec<String> = TABLES.iter().filter_map(|name| folder.file(name).err()).collect();
    if !elsewhere.is_empty() {
        return Err(Error::Recording { path: dir.to_owned(), faults: elsewhere });
    }
    let mut faults = Faults::default();
    let cameras: CamerasFile = json::read(&dir.join("cameras.json"))?;
    // Nobody has to say when something is opened.
    let told = dir.join("clips.json");
    let clips = if told.exists() { json::read(&told)? } else { ClipsFile { clips: Vec::new() } };
    let camera = check_camera(&cameras, &mut faults);
    let frames = frames(&folder, &cameras, &mut faults);
    let mut left_out = LeftOut::default();
    let clips = checks::usable_clips(clips.clips, frames.len(), "clips.json", &mut left_out, &mut faults);
    let (name, hands) = hands(dir, &mut faults)?;
    let hands = checks::usable_hands(hands, frames.len(), name, &mut left_out, &mut faults);
    checks::hands(&hands, &frames, ["hands.json / fingertips.csv", if judge { REACH } else { "" }], &mut faults);
    let labels = tables::labels(dir)?;
    let reconstruction = reconstruction::read(dir)?;
    faults.finish(dir)?;

    let name = dir
        .canonicalize()
        .ok()
        .and_then(|d| d.file_name().map(|n| n.to_string_lossy().into_owned()))
        .unwrap_or_else(|| "recording".to_owned());
    let dir = dir.to_owned();
    Ok(Recording { name, dir, frames, clips, hands, labels, reconstruction, left_out, ..Recording::empty(camera) })
}

/// What to do about hands out of the head's reach.
const REACH: &str =
    "hands and camera poses must share one world frame and one unit (metres); paws import --check looks for the cause";

fn check_camera(file: &CamerasFile, faults: &mut Faults) -> Camera {
    let camera = Camera { width: file.width, height: file.height, fx: file.fx, fy: file.fy, cx: file.cx, cy: file.cy };
    checks::camera(&camera, "cameras.json", faults);
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
    camera
}

fn frames(folder: &Folder, file: &CamerasFile, faults: &mut Faults) -> Vec<Frame> {
    if file.frames.is_empty() {
        faults.add("frames", "cameras.json: no frames".to_owned());
    }
    let mut last = f64::NEG_INFINITY;
    let mut out = Vec::with_capacity(file.frames.len());
    for (index, entry) in file.frames.iter().enumerate() {
        let place = format!("cameras.json: frame {}", entry.frame);
        if entry.frame != index {
            faults.add("index", format!("{place}: is entry {index}; frames must be numbered 0, 1, 2, ... in order"));
        }
        checks::time(entry.timestamp, &mut last, &place, faults);
        checks::position(&entry.position, &place, faults);
        let [w, x, y, z] = entry.rotation_wxyz;
        let q = Quaternion::new(w, x, y, z);
        if !q.norm().is_finite() || (q.norm() - 1.0).abs() > 1e-2 {
            faults.add(
                "rotation",
                format!("{place}: rotation_wxyz has norm {:.4}, a rotation has norm 1 (order is w x y z)", q.norm()),
            );
        }
        out.push(Frame {
            timestamp_secs: entry.timestamp,
            world_from_camera: Pose::from_parts(
                Vector::from(entry.position).into(),
                UnitQuaternion::from_quaternion(if q.norm() > 0.0 { q } else { Quaternion::identity() }),
            ),
            files: files(folder, entry, index, &place, faults),
        });
    }
    checks::scale(&out, "cameras.json", faults);
    out
}

/// What a frame has on disk.
fn files(folder: &Folder, entry: &FrameEntry, index: usize, place: &str, faults: &mut Faults) -> FrameFiles {
    let mut found = |names: &[String]| -> Option<PathBuf> {
        for name in names {
            match folder.file(name) {
                Ok(Some(path)) => return Some(path),
                Ok(None) => {}
                Err(fault) => faults.add("elsewhere", format!("frame {index}: {fault}")),
            }
        }
        None
    };
    let numbered = |of: &str| [format!("{of}/{index:06}.png")];
    let [depth, normals, mask] = ["depth", "normals", "masks"].map(|of| found(&numbered(of)));
    let segments = [format!("{index:06}.npz"), format!("{index:06}.txt"), format!("segments_{index}.txt")]
        .map(|name| format!("segments/{name}"));
    let segments = found(&segments);
    let rgb = match &entry.file {
        // Listed or not, images that are there are seen.
        None => found(&["jpg", "jpeg", "png"].map(|ending| format!("frames/{index:06}.{ending}"))),
        Some(name) => match folder.file(name) {
            Ok(Some(path)) => Some(path),
            Ok(None) => {
                let way = "bring the image, or leave \"file\" out of cameras.json to go without";
                faults.add("image", format!("{place}: {name} is listed but not there; {way}"));
                None
            }
            Err(fault) => {
                faults.add("elsewhere", format!("{place}: {fault}"));
                None
            }
        },
    };
    FrameFiles { rgb, depth, normals, mask, segments }
}

/// The hands as they stand in a file, and its name.
fn hands(dir: &Path, faults: &mut Faults) -> Result<(&'static str, Vec<HandSample>)> {
    let full = dir.join("hands.json");
    let tips = dir.join("fingertips.csv");
    if full.is_file() {
        Ok(("hands.json", hands_json(&full, faults)?))
    } else if tips.is_file() {
        Ok(("fingertips.csv", fingertips_csv(&tips)?))
    } else {
        Err(Error::Io {
            path: full,
            message: "no such file, and no fingertips.csv either; a recording needs one of them: run a hand tracker and import \
                      its output too (paws import SOURCE HANDS --out DIR)"
                .to_owned(),
        })
    }
}

fn hands_json(path: &Path, faults: &mut Faults) -> Result<Vec<HandSample>> {
    let file: HandsFile = json::read(path)?;
    let mut samples = Vec::new();
    for frame in file.frames {
        for hand in frame.hands {
            let Some(tips) = TIP_JOINTS.iter().map(|&j| hand.joints_world.get(j)).collect::<Option<Vec<_>>>() else {
                let n = hand.joints_world.len();
                faults.add("joints", format!("hands.json: frame {}: {n} joints, expected 21", frame.frame));
                continue;
            };
            let tips = [0, 1, 2].map(|i| Point::from(*tips[i]));
            let mut joints = [[0f32; 3]; 21];
            for (joint, read) in joints.iter_mut().zip(&hand.joints_world) {
                *joint = read.map(|x| x as f32);
            }
            let all = hand.joints_world.len() == joints.len() && joints.iter().flatten().all(|x| x.is_finite());
            samples.push(HandSample {
                frame: frame.frame,
                side: hand.side,
                contact: hand.contact,
                tips,
                joints: all.then_some(joints),
            });
        }
    }
    Ok(samples)
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
    let text = String::from_utf8(bytes)
        .map_err(|_| Error::format(path, format!("line {number}"), "is not UTF-8 text; save it as UTF-8"))?;
    Ok(Some(text.trim_end_matches(['\n', '\r']).to_owned()))
}

fn fingertips_csv(path: &Path) -> Result<Vec<HandSample>> {
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
    let (frame, side) = (column("frame")?, column("side")?);
    let contact = columns.iter().position(|c| *c == "contact");
    let mut tip_columns = [[0; 3]; 3];
    for (tip, names) in tip_columns.iter_mut().zip(TIPS) {
        for (index, name) in tip.iter_mut().zip(names) {
            *index = column(name)?;
        }
    }
    let mut samples = Vec::new();
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
        let said = contact.map(|column| cells[column]).filter(|cell| !cell.is_empty());
        let contact = match said {
            Some("1" | "true" | "True") => Some(true),
            Some("0" | "false" | "False") => Some(false),
            None => None,
            Some(other) => {
                return Err(Error::format(path, place(), format!("column contact: \"{other}\" is not 0 or 1")));
            }
        };
        samples.push(HandSample { frame: index, side, contact, tips, joints: None });
    }
    Ok(samples)
}
