//! Trajectories, hands and points as Project Aria's machine perception services write them.
//!
//! Poses are the glasses' (`device`) in the world, hands are in the glasses' frame; metres, microseconds of the glasses' clock.

use std::path::Path;

use crate::error::{Error, Result};
use crate::import::capture::{At, HandAt, HandStream, JointFrame, PoseAt, RawPose, RawRotation};
use crate::import::joint_orders::JointOrder;
use crate::import::text::{TextTable, Unread};
use crate::math::{Point, Vector, unit};
use crate::recording::Side;

use super::colmap_model::Thinned;

/// Rows nearer in time than this are passed over, seconds: a head turns by half a degree meanwhile, evenly, and a
/// trajectory of a thousand poses a second fills no memory.
const STEP_SECS: f64 = 0.0095;
/// Points that are less sure than this are left out: the writer's own limits, of the inverse distance (1/m) and the
/// distance (m).
const MAX_INVERSE_DISTANCE_STD: f64 = 0.005;
const MAX_DISTANCE_STD: f64 = 0.01;
/// What stands for the graph in rows without a pose.
const UNDEFINED: &str = "UNDEFINED_ROW";

/// A trajectory.
#[derive(Debug, Clone, Default)]
pub(super) struct AriaWalk {
    /// Poses of the glasses; those of one frame of the world.
    pub items: Vec<PoseAt>,
    /// Up in it, from the gravity column.
    pub up: Option<Vector>,
    /// The frame's name.
    pub graph: String,
    /// Poses that were left out because they are in another frame.
    pub elsewhere: usize,
    /// What of the rows cannot be read, in words.
    pub dropped: Option<String>,
}

impl AriaWalk {
    /// First and last time, seconds.
    pub fn span(&self) -> Option<[f64; 2]> {
        let times = || self.items.iter().filter_map(|i| i.at.time_secs);
        let first = times().min_by(f64::total_cmp)?;
        Some([first, times().max_by(f64::total_cmp)?])
    }
}

/// Which rows of a trajectory count.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum RowsKept {
    /// About a hundred a second.
    Thinned,
    /// All; a row's number is that of a picture.
    Pictures,
}

/// Reads a closed loop or open loop trajectory.
///
/// # Errors
/// With line and column of what cannot be read, or where there is no pose.
pub(super) fn trajectory(path: &Path, rows: RowsKept) -> Result<AriaWalk> {
    let mut table = TextTable::open(path)?;
    let frame = if table.has("tx_odometry_device") { "odometry" } else { "world" };
    let columns = ["tx", "ty", "tz", "qx", "qy", "qz", "qw"].map(|c| format!("{c}_{frame}_device"));
    let columns = columns.each_ref().map(String::as_str);
    table.need(&columns)?;
    table.need(&["tracking_timestamp_us"])?;
    let gravity = ["x", "y", "z"].map(|c| format!("gravity_{c}_{frame}"));
    let gravity = gravity.each_ref().map(String::as_str);
    let has_gravity = gravity.iter().all(|c| table.has(c));
    let graph = if table.has("graph_uid") { "graph_uid" } else { "session_uid" };
    let mut up = None;
    let mut graphs: Vec<(String, usize)> = Vec::new();
    let mut poses: Vec<(usize, PoseAt)> = Vec::new();
    let mut last: Option<(usize, f64)> = None;
    let mut number = 0;
    let mut unread = Unread::default();
    while let Some(row) = table.row()? {
        let index = number;
        number += 1;
        let name = row.text(graph);
        if name == UNDEFINED {
            continue;
        }
        let of = graphs.iter().position(|(g, _)| g == name).unwrap_or(graphs.len());
        let Some(time) = unread.keep(row.number("tracking_timestamp_us")).map(|us| us * 1e-6) else { continue };
        let is_near = last.is_some_and(|(g, t)| g == of && (0.0..STEP_SECS).contains(&(time - t)));
        if rows == RowsKept::Thinned && is_near {
            continue;
        }
        let Some([x, y, z, a, b, c, d]) = unread.keep(row.numbers(columns)) else { continue };
        last = Some((of, time));
        match graphs.get_mut(of) {
            Some((_, count)) => *count += 1,
            None => graphs.push((name.to_owned(), 1)),
        }
        if up.is_none() && has_gravity {
            up = row.numbers(gravity).ok().and_then(|g| unit(&-Vector::from(g)));
        }
        let at = At::time(time);
        let at = if rows == RowsKept::Pictures { at.with_index(index) } else { at };
        let pose = RawPose { position: [x, y, z], turn: RawRotation::Quaternion([a, b, c, d]) };
        poses.push((of, PoseAt { at, pose, optics: None }));
    }
    let dropped = unread.told("poses", poses.len())?;
    // The frame that most poses are in, the first one of several.
    let most = graphs.iter().enumerate().rev().max_by_key(|(_, (_, count))| *count);
    let Some((main, graph)) = most.map(|(i, (name, _))| (i, name.clone())) else {
        return Err(Error::format(path, "rows", "there is no pose; did the tracking fail?"));
    };
    let total = poses.len();
    let items: Vec<PoseAt> = poses.into_iter().filter(|(of, _)| *of == main).map(|(_, pose)| pose).collect();
    Ok(AriaWalk { elsewhere: total - items.len(), items, up, graph, dropped })
}

/// Reads `hand_tracking_results.csv`, with or without normals.
///
/// # Errors
/// With line and column of what cannot be read.
pub(super) fn hands(path: &Path) -> Result<HandStream> {
    /// Names of a hand's columns.
    struct Columns {
        side: Side,
        confidence: String,
        landmarks: Vec<[String; 3]>,
    }
    let mut table = TextTable::open(path)?;
    table.need(&["tracking_timestamp_us"])?;
    let columns = [(Side::Left, "left"), (Side::Right, "right")].map(|(side, name)| Columns {
        side,
        confidence: format!("{name}_tracking_confidence"),
        landmarks: (0..21).map(|i| ["tx", "ty", "tz"].map(|c| format!("{c}_{name}_landmark_{i}_device"))).collect(),
    });
    for hand in &columns {
        let landmarks = hand.landmarks.iter().flatten().map(String::as_str);
        let names: Vec<&str> = std::iter::once(hand.confidence.as_str()).chain(landmarks).collect();
        table.need(&names)?;
    }
    let mut items = Vec::new();
    let mut last: Option<f64> = None;
    while let Some(row) = table.row()? {
        let time = row.number("tracking_timestamp_us")? * 1e-6;
        if last.is_some_and(|t| (0.0..STEP_SECS).contains(&(time - t))) {
            continue;
        }
        last = Some(time);
        for hand in &columns {
            let told = row.text(&hand.confidence);
            if told.is_empty() || told.eq_ignore_ascii_case("nan") {
                continue;
            }
            // -1: not tracked.
            let confidence = row.number(&hand.confidence)?;
            if confidence <= 0.0 {
                continue;
            }
            let mut joints = Vec::with_capacity(hand.landmarks.len());
            for landmark in &hand.landmarks {
                joints.push(Some(row.numbers(landmark.each_ref().map(String::as_str))?));
            }
            let score = Some(confidence.min(1.0));
            items.push(HandAt { at: At::time(time), side: hand.side, joints, contact: None, score });
        }
    }
    Ok(HandStream { frame: JointFrame::Body, order: JointOrder::Aria, unit_m: 1.0, items })
}

/// Reads the sure ones of `semidense_points.csv.gz`; those of another frame than `graph` are left out where the file names
/// that one.
///
/// # Errors
/// With line and column of what cannot be read.
pub(super) fn points(path: &Path, graph: &str) -> Result<Vec<Point>> {
    let mut table = TextTable::open(path)?;
    table.need(&["px_world", "py_world", "pz_world", "inv_dist_std", "dist_std"])?;
    let (mut here, mut elsewhere) = (Thinned::default(), Thinned::default());
    while let Some(row) = table.row()? {
        let [inverse, distance] = row.numbers(["inv_dist_std", "dist_std"])?;
        if inverse >= MAX_INVERSE_DISTANCE_STD || distance >= MAX_DISTANCE_STD {
            continue;
        }
        let p = Point::from(row.numbers(["px_world", "py_world", "pz_world"])?);
        if graph.is_empty() || row.text("graph_uid") == graph {
            here.push(p);
        } else {
            elsewhere.push(p);
        }
    }
    let here = here.into_kept();
    // A file whose names are others than the trajectory's tells nothing about frames.
    Ok(if here.is_empty() { elsewhere.into_kept() } else { here })
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEADER: &str = "graph_uid,tracking_timestamp_us,utc_timestamp_ns,tx_world_device,ty_world_device,\
                          tz_world_device,qx_world_device,qy_world_device,qz_world_device,qw_world_device,\
                          gravity_x_world,gravity_y_world,gravity_z_world,quality_score\n";

    fn read(text: &str, rows: RowsKept) -> Result<AriaWalk> {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("closed_loop_trajectory.csv");
        std::fs::write(&path, text).unwrap();
        trajectory(&path, rows)
    }

    #[test]
    fn a_thousand_poses_a_second_become_a_hundred() {
        let mut text = HEADER.to_owned();
        for i in 0..1000 {
            text += &format!("g,{},0,{i},0,0,0,0,0,1,0,0,-9.81,1\n", 5_000_000 + 1000 * i);
        }
        let walk = read(&text, RowsKept::Thinned).unwrap();
        assert_eq!((walk.items.len(), walk.up), (100, Some(Vector::z())));
        assert_eq!(read(&text, RowsKept::Pictures).unwrap().items.len(), 1000);
    }

    #[test]
    fn poses_of_another_frame_are_counted_and_rows_without_a_pose_keep_their_numbers() {
        let row = |graph: &str, i: usize| format!("{graph},{},0,{i},0,0,0,0,0,1,0,0,-9.81,1\n", 100_000 * i);
        let text = [HEADER.to_owned(), row("b", 1), row("UNDEFINED_ROW", 2), row("a", 3), row("a", 4)].concat();
        let walk = read(&text, RowsKept::Pictures).unwrap();
        assert_eq!((walk.graph.as_str(), walk.elsewhere), ("a", 1));
        let indices: Vec<_> = walk.items.iter().map(|i| i.at.index).collect();
        assert_eq!(indices, [Some(2), Some(3)]);
        assert!(read(HEADER, RowsKept::Thinned).unwrap_err().to_string().contains("no pose"));
    }
}
