//! Captures to one recording.

use std::collections::BTreeMap;

use super::axes::Convention;
use super::capture::Capture;
use super::choices::ImportOptions;
use super::frame_timeline::{self, FrameTimeline};
use super::imported::{Imported, ImportedFrame};
use super::output_view::OutputView;
use super::report::{ImportReport, NEEDED, SPARSE, SourceReport, UNMET, source_name};
use super::{hands_and_clips, world_placement};
use crate::error::{Error, Result};
use crate::math::{Point, Pose, Vector};
use crate::recording::{HAND_CLASS, reconstruction};

/// Points of a reconstruction that are kept: those of a large house at 2 cm.
const MAX_POINTS: usize = 2_000_000;

/// Joins captures to one recording: frames of the first capture with images (else depth, else poses), poses of the first one
/// with poses, and so on for every stream.
///
/// # Errors
/// Where nothing can be placed: no poses, no intrinsics, no frame with a pose, a scale that nothing tells.
pub fn assemble(captures: Vec<Capture>, options: &ImportOptions) -> Result<Imported> {
    let mut report = ImportReport {
        sources: captures.iter().map(SourceReport::of).collect(),
        dropped: captures.iter().flat_map(|c| c.dropped.iter().cloned()).collect(),
        ..ImportReport::default()
    };
    let timeline = frame_timeline::build(&captures, options, &mut report)?;
    let place = world_placement::place(&captures, &timeline, options, &mut report)?;
    let Some(first) = timeline.frames.first() else {
        return Err(Error::Config("import: no frame is left".to_owned()));
    };
    let view = OutputView::of(&first.optics, options);
    let mut hands = hands_and_clips::hands(&captures, &timeline, &place, options, &mut report);
    hands_and_clips::contacts(&captures, &timeline, &mut hands, &mut report);
    let clips = hands_and_clips::clips(&captures, &timeline, &mut report);
    let points = points(&captures, &timeline, &place, options, &mut report);
    let depth_factor = world_placement::depth_factor(&captures, &timeline, &place, options);
    told_factor(depth_factor, &mut report);
    told_changes(&timeline, &view, options, &mut report);
    let frames = frames(&timeline, &place, &view, depth_factor.is_some());
    let labels = labels(&captures);
    let pictures = frame_timeline::video_pictures(&captures, &timeline.frames);
    let mut imported = Imported {
        view,
        frames,
        clips,
        hands,
        labels,
        points,
        report,
        captures,
        depth_factor: depth_factor.unwrap_or(1.0),
        pictures,
        extracted: BTreeMap::new(),
        options: options.clone(),
    };
    imported.report.missing = missing(&imported);
    imported.report.findings = super::checks::findings(&imported);
    Ok(imported)
}

/// Tells what depth is multiplied by, or that it cannot be used.
fn told_factor(factor: Option<f64>, report: &mut ImportReport) {
    match factor {
        None => report
            .dropped
            .push("depth, whose unit is not metres and that no points of a reconstruction scale".to_owned()),
        Some(factor) if factor != 1.0 => {
            report.changes.push(format!("depth is multiplied by {factor:.5} to be metres"));
        }
        Some(_) => {}
    }
}

/// The frames of the result: the output's camera in the recording's world.
fn frames(
    timeline: &FrameTimeline,
    place: &world_placement::WorldPlacement,
    view: &OutputView,
    has_depth: bool,
) -> Vec<ImportedFrame> {
    let turned = Pose::from_parts(Vector::zeros().into(), view.source_from_output);
    let frames = timeline.frames.iter();
    frames
        .map(|f| ImportedFrame {
            at: f.at.clone(),
            time_secs: f.time_secs,
            world_from_camera: place.pose(&f.world_from_camera) * turned,
            source_pose: f.world_from_camera,
            optics: f.optics,
            image: f.image,
            depth: f.depth.filter(|_| has_depth),
            mask: f.mask,
            normals: f.normals,
            segments: f.segments,
        })
        .collect()
}

/// Names of the classes of the first source with masks, the hand's among them; empty without masks.
fn labels(captures: &[Capture]) -> BTreeMap<u8, String> {
    let masks = captures.iter().filter_map(|c| c.masks.as_ref()).find(|m| !m.items.is_empty());
    let Some(masks) = masks else { return BTreeMap::new() };
    let mut labels = masks.labels.clone();
    labels.entry(HAND_CLASS).or_insert_with(|| "hand".to_owned());
    labels
}

/// Points of the capture with the poses, else of the first one that has any, evenly thinned.
fn points(
    captures: &[Capture],
    timeline: &FrameTimeline,
    place: &world_placement::WorldPlacement,
    options: &ImportOptions,
    report: &mut ImportReport,
) -> Vec<Point> {
    let Some(posed) = captures.get(timeline.posed) else { return Vec::new() };
    let Some(capture) = world_placement::with_points(captures, timeline.posed) else { return Vec::new() };
    if capture.poses.is_none() {
        report.changes.push(format!(
            "points of {} are taken to be in the world of {}, in its unit",
            source_name(capture),
            source_name(posed)
        ));
    }
    let convention = Convention::of(posed, options);
    let step = capture.points.len().div_ceil(MAX_POINTS).max(1);
    capture
        .points
        .iter()
        .step_by(step)
        .map(|p| place.point(&convention.point(p)))
        .filter(|p| p.iter().all(|x| x.is_finite()))
        .collect()
}

/// What was done to every image.
fn told_changes(timeline: &FrameTimeline, view: &OutputView, options: &ImportOptions, report: &mut ImportReport) {
    let Some(first) = timeline.frames.first() else { return };
    let c = &view.camera;
    if !view.is_same(&first.optics) {
        report.changes.push(format!(
            "images of {} x {} (lens {}) become pinhole images of {} x {}",
            first.optics.width,
            first.optics.height,
            match first.optics.lens {
                super::optics::LensModel::Pinhole => "pinhole",
                super::optics::LensModel::OpenCv { .. } => "OpenCV",
                super::optics::LensModel::Fisheye { .. } => "fisheye",
                super::optics::LensModel::FisheyeRadTanThinPrism { .. } => "FisheyeRadTanThinPrism",
            },
            c.width,
            c.height
        ));
    }
    if !options.rotate_quarters.is_multiple_of(4) {
        report
            .changes
            .push(format!("images are turned clockwise by {} degrees", 90 * u32::from(options.rotate_quarters % 4)));
    }
    if options.hand_lag_secs != 0.0 {
        report.changes.push(format!("{} s are added to the hands' times", options.hand_lag_secs));
    }
}

/// Streams that the result lacks, with the way to fill them: how what a source has can meet the frames, else the source's own
/// word, else ours.
fn missing(imported: &Imported) -> Vec<super::capture::Missing> {
    let lacks = |what: &str| match what {
        "images" => imported.frames.iter().all(|f| f.image.is_none()),
        "depth" => imported.frames.iter().all(|f| f.depth.is_none()) && !reconstruction::is_dense(&imported.points),
        "hands" => imported.hands.is_empty(),
        "contact" => !imported.hands.is_empty() && imported.hands.iter().all(|h| h.contact.is_none()),
        "clips" => imported.clips.is_empty(),
        _ => false,
    };
    let mut out: Vec<super::capture::Missing> = Vec::new();
    for (what, why, command) in NEEDED.iter().filter(|(what, _, _)| lacks(what)) {
        let unmet = imported.report.streams.iter().find(|s| s.stream == *what && s.count == 0 && s.of > 0);
        if let Some(stream) = unmet {
            out.push(super::capture::Missing {
                what: (*what).to_owned(),
                why: format!("none of the {} of {} meets a frame", stream.of, stream.source),
                command: UNMET.to_owned(),
            });
            continue;
        }
        let own = imported.captures.iter().flat_map(|c| &c.missing).find(|m| m.what == *what);
        let has_points = *what == "depth" && !imported.points.is_empty();
        out.push(own.cloned().unwrap_or_else(|| super::capture::Missing {
            what: (*what).to_owned(),
            why: if has_points { SPARSE } else { *why }.to_owned(),
            command: (*command).to_owned(),
        }));
    }
    out
}
