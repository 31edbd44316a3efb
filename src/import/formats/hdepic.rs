//! HD-EPIC without VRS files: a storage folder of its tools, or one trajectory in it (`intermediate_data/mp4_trajectory/VIDEO.csv`).
//!
//! One pose of the glasses a picture of the video, which was stood upright; the calibration is the sensor's. Narrations come as
//! `HD_EPIC_Narrations.jsonl` or `.csv`, which `examples/import/hdepic_narrations.py` writes from the data set's pickle.

use std::path::{Path, PathBuf};

use serde_json::Value;

use super::aria::{device_times, pictures};
use super::aria_camera;
use super::aria_walk::{self, RowsKept};
use crate::error::{Error, Result};
use crate::import::ImportOptions;
use crate::import::blob::{files, inside};
use crate::import::capture::{At, Capture, ClipAt, Missing, PoseAt, Poses, SourceWorld};
use crate::import::text::{Lines, TextTable};

/// The clock of one video: other recordings of the same glasses are not meant.
const CLOCK: &str = "aria device";
/// Pictures a second of the data set's videos.
const FPS: f64 = 30.0;
/// Where narrations are looked for, in the storage folder.
const NARRATIONS: [&str; 4] = [
    "HD_EPIC_Narrations.jsonl",
    "HD_EPIC_Narrations.csv",
    "narrations-and-action-segments/HD_EPIC_Narrations.jsonl",
    "narrations-and-action-segments/HD_EPIC_Narrations.csv",
];

/// Files of one video.
struct VideoFiles {
    /// The storage folder.
    root: PathBuf,
    /// The video's name.
    name: String,
    trajectory: PathBuf,
    calibration: PathBuf,
}

impl VideoFiles {
    fn of(trajectory: &Path) -> Option<Self> {
        let name = trajectory.file_stem()?.to_str()?.to_owned();
        let folder = trajectory.parent()?;
        let data = folder.parent()?;
        let calibration = data.join("rgb_camera_calibration").join(format!("{name}.json"));
        let is_one =
            folder.file_name()? == "mp4_trajectory" && trajectory.extension()? == "csv" && trajectory.is_file();
        // The folder above one that is named alone is the current one.
        let root = match data.parent() {
            Some(root) if !root.as_os_str().is_empty() => root.to_owned(),
            Some(_) => PathBuf::from("."),
            None => data.to_owned(),
        };
        is_one.then_some(Self { root, name, trajectory: trajectory.to_owned(), calibration })
    }

    /// Who wrote it: the part of the name before the first dash.
    fn person(&self) -> &str {
        self.name.split('-').next().unwrap_or_default()
    }
}

/// All trajectories of a storage folder, or the one that the path is.
fn trajectories(path: &Path) -> Vec<PathBuf> {
    if path.is_file() {
        return vec![path.to_owned()];
    }
    let folder = path.join("intermediate_data/mp4_trajectory");
    files(&folder, &["csv"])
}

pub(super) fn detect(path: &Path) -> bool {
    trajectories(path).first().is_some_and(|t| VideoFiles::of(t).is_some_and(|s| s.calibration.is_file()))
}

pub(super) fn read(path: &Path, _options: &ImportOptions) -> Result<Capture> {
    let source = one_video(path)?;
    let walk = aria_walk::trajectory(&source.trajectory, RowsKept::Pictures)?;
    let camera = aria_camera::exported(&source.calibration)?.upright();
    let (person, name) = (source.person(), &source.name);
    let mut notes =
        vec!["the video's pictures stand upright, rows of the trajectory are its pictures from 0".to_owned()];
    let times = picture_times(&source, &walk.items, &mut notes)?;
    let video = inside(&source.root, &format!("Videos/{person}/{name}.mp4"))?;
    let images = match &video {
        Some(file) => pictures(file, &times.iter().map(|[_, device]| *device).collect::<Vec<f64>>()),
        None => Vec::new(),
    };
    let points = match points_file(&source)? {
        Some(file) => aria_walk::points(&file, &walk.graph)?,
        None => Vec::new(),
    };
    let mut clips = Vec::new();
    for file in NARRATIONS {
        if let Some(file) = inside(&source.root, file)? {
            clips = narrations(&file, name, &times)?;
            break;
        }
    }
    Ok(Capture {
        kind: "hdepic".to_owned(),
        source: path.to_owned(),
        title: format!("HD-EPIC video {name}"),
        licence: Some("HD-EPIC is CC BY-NC 4.0".to_owned()),
        notes,
        dropped: walk.dropped.into_iter().collect(),
        clock: Some(CLOCK.to_owned()),
        world: SourceWorld { up: walk.up, ..SourceWorld::default() },
        optics: Some(camera.optics),
        poses: Some(Poses { body_from_camera: Some(camera.device_from_camera), items: walk.items, ..Poses::default() }),
        images,
        points,
        missing: missing(clips.is_empty(), video.is_none()),
        clips,
        ..Capture::default()
    })
}

/// The files of the one video that a path names.
fn one_video(path: &Path) -> Result<VideoFiles> {
    let found = trajectories(path);
    let source = match found.as_slice() {
        [one] => VideoFiles::of(one),
        [] => None,
        [first, ..] => {
            let message =
                format!("holds {} videos; name one of them, for example hdepic={}", found.len(), first.display());
            return Err(Error::format(path, "videos", message));
        }
    };
    let Some(source) = source else {
        let message = "holds no intermediate_data/mp4_trajectory/VIDEO.csv (the data that HD-EPIC's tools name)";
        return Err(Error::Io { path: path.to_owned(), message: message.to_owned() });
    };
    Ok(source)
}

/// Seconds of the video and of the glasses, picture by picture.
fn picture_times(source: &VideoFiles, items: &[PoseAt], notes: &mut Vec<String>) -> Result<Vec<[f64; 2]>> {
    let (person, name) = (source.person(), &source.name);
    if let Some(table) = inside(&source.root, &format!("Videos/{person}/{name}_mp4_to_vrs_time_ns.csv"))? {
        return device_times(&table);
    }
    notes.push(format!(
        "no Videos/{person}/{name}_mp4_to_vrs_time_ns.csv: {FPS} pictures a second are taken for granted"
    ));
    let of = |p: &PoseAt| Some([p.at.index? as f64 / FPS, p.at.time_secs?]);
    Ok(items.iter().filter_map(of).collect())
}

fn missing(no_clips: bool, no_video: bool) -> Vec<Missing> {
    let of = |what: &str, why: &str, command: &str| Missing {
        what: what.to_owned(),
        why: why.to_owned(),
        command: command.to_owned(),
    };
    let mut out = Vec::new();
    if no_clips {
        let command =
            "python examples/import/hdepic_narrations.py HD_EPIC_Narrations.pkl STORAGE/HD_EPIC_Narrations.jsonl";
        out.push(of("clips", "the data set's narrations are a Python pickle, which is not read", command));
    }
    if no_video {
        out.push(of("images", "the video is not there", "put it into STORAGE/Videos/PERSON/VIDEO.mp4"));
    }
    out
}

/// The points of the person's map that the video belongs to.
fn points_file(source: &VideoFiles) -> Result<Option<PathBuf>> {
    let person = source.person();
    let maps = format!("SLAM-and-Gaze/{person}/SLAM/multi");
    let Some(table) = inside(&source.root, &format!("{maps}/vrs_to_multi_slam.json"))? else { return Ok(None) };
    let json: Value = crate::json::read(&table)?;
    let key = format!("{person}/{}.vrs", source.name);
    let map = match &json[&key] {
        Value::String(text) => text.clone(),
        Value::Number(number) => number.to_string(),
        _ => return Ok(None),
    };
    inside(&source.root, &format!("{maps}/{map}/slam/semidense_points.csv.gz"))
}

/// A narration as it stands in the file.
#[derive(Default)]
struct NarrationEntry {
    name: String,
    narration: String,
    verb: String,
    noun: String,
    start_secs: f64,
    end_secs: f64,
}

/// Narrations of a video, at times of the glasses.
fn narrations(file: &Path, video: &str, times: &[[f64; 2]]) -> Result<Vec<ClipAt>> {
    let is_lines = file.extension().is_some_and(|e| e.eq_ignore_ascii_case("jsonl"));
    let told = if is_lines { of_lines(file, video)? } else { of_table(file, video)? };
    let clip = |t: NarrationEntry| {
        let [start, end] = [device_time(times, t.start_secs)?, device_time(times, t.end_secs)?];
        Some(ClipAt {
            name: t.name,
            start: At::time(start),
            end: At::time(end),
            narration: t.narration,
            verb: t.verb,
            noun: t.noun,
        })
    };
    Ok(told.into_iter().filter_map(clip).collect())
}

fn of_table(file: &Path, video: &str) -> Result<Vec<NarrationEntry>> {
    let mut table = TextTable::open(file)?;
    table.need(&["video_id", "narration", "start_timestamp", "end_timestamp"])?;
    let mut out = Vec::new();
    while let Some(row) = table.row()? {
        if row.text("video_id") != video {
            continue;
        }
        let [start_secs, end_secs] = row.numbers(["start_timestamp", "end_timestamp"])?;
        let first = |column: &str| first_word(row.text(column));
        out.push(NarrationEntry {
            name: row.text("unique_narration_id").to_owned(),
            narration: row.text("narration").to_owned(),
            verb: first("verbs"),
            noun: first("nouns"),
            start_secs,
            end_secs,
        });
    }
    Ok(out)
}

fn of_lines(file: &Path, video: &str) -> Result<Vec<NarrationEntry>> {
    let mut lines = Lines::open(file)?;
    let mut out = Vec::new();
    while let Some(line) = lines.content()? {
        let json: Value = serde_json::from_str(&line).map_err(|e| lines.fault(format!("is no JSON ({e})")))?;
        if json["video_id"] != video {
            continue;
        }
        let number = |key: &str| {
            json[key].as_f64().ok_or_else(|| lines.fault(format!("{key}: expected seconds, a number without quotes")))
        };
        let text = |key: &str| json[key].as_str().unwrap_or_default().to_owned();
        let first = |key: &str| json[key][0].as_str().unwrap_or_default().to_owned();
        out.push(NarrationEntry {
            name: text("unique_narration_id"),
            narration: text("narration"),
            verb: first("verbs"),
            noun: first("nouns"),
            start_secs: number("start_timestamp")?,
            end_secs: number("end_timestamp")?,
        });
    }
    Ok(out)
}

/// The first word of a list as Python writes it: `['open', 'pull']`.
fn first_word(list: &str) -> String {
    let first = list.trim_matches(['[', ']', '(', ')', ' ']).split(',').next().unwrap_or_default();
    first.trim().trim_matches(['\'', '"']).to_owned()
}

/// The glasses' time of a time of the video: between two pictures, before the first and behind the last one at the same pace.
fn device_time(times: &[[f64; 2]], secs: f64) -> Option<f64> {
    let after = times.partition_point(|[mp4, _]| *mp4 < secs);
    match (after.checked_sub(1).and_then(|i| times.get(i)), times.get(after)) {
        (Some([a, from]), Some([b, to])) if b > a => Some(from + (to - from) * (secs - a) / (b - a)),
        (Some([mp4, device]), _) | (None, Some([mp4, device])) => Some(device + (secs - mp4)),
        (None, None) => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_of_the_video_become_the_glasses() {
        let times = [[0.0, 100.0], [1.0, 102.0], [2.0, 103.0]];
        for (secs, device) in [(-1.0, 99.0), (0.0, 100.0), (0.5, 101.0), (1.5, 102.5), (9.0, 110.0)] {
            assert_eq!(device_time(&times, secs), Some(device), "{secs}");
        }
        assert_eq!(device_time(&[], 1.0), None);
    }

    #[test]
    fn the_first_word_of_a_list_is_its_verb() {
        for (list, word) in [("['open', 'pull']", "open"), ("(\"drawer\",)", "drawer"), ("[]", ""), ("close", "close")]
        {
            assert_eq!(first_word(list), word, "{list}");
        }
    }
}
