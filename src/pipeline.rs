//! The whole paper on one screen: every step in order, every intermediate kept.

use std::collections::BTreeMap;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::articulation::{Articulation, Outcome};
use crate::config::Config;
use crate::error::{Error, Result};
use crate::geometry::moved::{self, Rect};
use crate::geometry::segments::{LiftedSegment, LineDetector, ViewGeometry, lift_view};
use crate::geometry::{AxisCandidate, Face, LineTrack, ManhattanFrame, candidates, face, manhattan, tracks};
use crate::hands::{self, Trajectory};
use crate::inference::{self, ClipJoint, aggregate};
use crate::localization::{self, Region, views};
use crate::math::Point;
use crate::reasoning::{Answer, PartShape, Question, Reasoner};
use crate::recording::narration::{self, Reading};
use crate::recording::{Clip, Recording};

/// Everything that was found out about one clip, step by step.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct ClipResult {
    /// The clip.
    pub clip: Clip,
    /// Hands (§3.1).
    pub trajectory: Option<Trajectory>,
    /// Localisation (§3.1).
    pub region: Option<Region>,
    /// Global views (§3.2).
    pub views: Vec<usize>,
    /// 3D lines (§3.2).
    pub lines: Vec<LineTrack>,
    /// The touched face.
    pub face: Option<Face>,
    /// The part of the face that was seen to move.
    pub part: Option<Rect>,
    /// Candidate axes (§3.2).
    pub candidates: Vec<AxisCandidate>,
    /// The answers to the two questions (§3.3).
    pub answer: Option<Answer>,
    /// The joint (§3.4), or the reason why there is none.
    pub joint: Outcome<ClipJoint>,
}

/// One joint of the scene with all that the later steps need to know about it.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct SceneJoint {
    /// Name, unique in the scene.
    pub id: String,
    /// The merged joint; positive opens.
    pub joint: Articulation,
    /// Names of the clips that show it.
    pub clips: Vec<String>,
    /// The word that people used for the furniture.
    pub furniture: Option<String>,
    /// Probability of the type.
    pub type_probability: f64,
    /// The grip when closed, world.
    pub grip: Point,
    /// The touched face.
    pub face: Option<Face>,
    /// The moving part of the face.
    pub part: Option<Rect>,
    /// Largest opening that was observed, rad or m.
    pub observed_range: f64,
}

/// The scene.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Scene {
    /// The recording's name.
    pub recording: String,
    /// The room's frame (§A.5).
    pub manhattan: Option<ManhattanFrame>,
    /// Clips in the recording's order.
    pub clips: Vec<ClipResult>,
    /// Joints in the order of their first clip.
    pub joints: Vec<SceneJoint>,
}

/// Told how far the work is: (step, done, total).
pub type Progress<'a> = &'a (dyn Fn(&str, usize, usize) + Sync);

/// Runs hands, localisation, geometry, reasoning, inference and aggregation.
///
/// # Errors
/// Only what makes the whole recording unusable, and images that cannot be decoded. A clip without an answer is an
/// answer: its reason stands in [`ClipResult::joint`].
pub fn infer(
    recording: &Recording,
    config: &Config,
    detector: &dyn LineDetector,
    reasoner: &dyn Reasoner,
    progress: Progress,
) -> Result<Scene> {
    check_depth(recording)?;
    // Hands and localisation, clip by clip.
    let total = recording.clips.len();
    let counter = std::sync::atomic::AtomicUsize::new(0);
    let tick = |step: &str, total: usize| {
        let done = counter.fetch_add(1, std::sync::atomic::Ordering::Relaxed) + 1;
        progress(step, done, total);
    };
    let located: Vec<Located> = recording
        .clips
        .par_iter()
        .map(|clip| {
            let located = locate(recording, clip, config);
            tick("localising", total);
            located
        })
        .collect::<Result<_>>()?;

    // Every global view is decoded once, however many clips look through it.
    let mut wanted: Vec<usize> = located.iter().flat_map(|l| l.views.iter().copied()).collect();
    wanted.sort_unstable();
    wanted.dedup();
    counter.store(0, std::sync::atomic::Ordering::Relaxed);
    let lifted: BTreeMap<usize, ViewGeometry> = wanted
        .par_iter()
        .map(|&view| {
            let geometry = lift_view(recording, view, detector, &config.geometry, config.seed)?;
            tick("finding lines", wanted.len());
            Ok((view, geometry))
        })
        .collect::<Result<_>>()?;
    let room = manhattan::estimate(recording, &with_normals_first(recording, &wanted), &config.geometry)?;

    counter.store(0, std::sync::atomic::Ordering::Relaxed);
    let clips: Vec<ClipResult> = recording
        .clips
        .par_iter()
        .zip(located)
        .map(|(clip, located)| {
            let result = infer_clip(recording, clip, located, &lifted, room.as_ref(), reasoner, config);
            tick("inferring", total);
            result
        })
        .collect::<Result<_>>()?;
    let joints = merge(recording, &clips, reasoner, config)?;
    Ok(Scene { recording: recording.name.clone(), manhattan: room, clips, joints })
}

/// Zero depth everywhere, or depth in another unit than the hands, is an export gone wrong, not a scene; a few frames tell.
fn check_depth(recording: &Recording) -> Result<()> {
    let with_depth: Vec<usize> =
        (0..recording.frames.len()).filter(|&f| recording.frames[f].files.depth.is_some()).collect();
    if with_depth.is_empty() {
        if recording.reconstruction.is_empty() {
            return Err(Error::Recording {
                path: recording.dir.clone(),
                faults: vec![
                    "no depth: there is neither depth/000000.png ... nor reconstruction.ply or .obj; run a metric depth \
                     estimator (MoGe-2) or add a static reconstruction"
                        .to_owned(),
                ],
            });
        }
        return Ok(());
    }
    // Hands tell what depth should be where they are: a ratio far from 1 is a unit, not an error of estimation.
    let mut ratios = Vec::new();
    let mut any = false;
    let with_hand: Vec<&crate::recording::HandSample> =
        recording.hands.iter().filter(|h| recording.frames[h.frame].files.depth.is_some()).collect();
    for i in 0..with_hand.len().min(8) {
        let hand = with_hand[i * with_hand.len() / with_hand.len().min(8)];
        let Some(depth) = recording.depth(hand.frame)? else { continue };
        any |= depth.data.iter().any(|z| *z > 0.0);
        let local = recording.frames[hand.frame].world_from_camera.inverse() * hand.grasp();
        let seen = recording.camera.project(&local).and_then(|(u, v)| depth.nearest(u, v));
        ratios.extend(seen.filter(|z| *z > 0.0).map(|z| f64::from(z) / local.z));
    }
    if let Some(ratio) = crate::math::stats::median(&ratios).filter(|r| !(0.2..8.0).contains(r)) {
        return Err(Error::Recording {
            path: recording.dir.clone(),
            faults: vec![format!(
                "depth: where hands are, depth is {ratio:.3} times their distance: hands and depth disagree on the unit; depth \
                 must be 16-bit millimetres, hands metres"
            )],
        });
    }
    if any {
        return Ok(());
    }
    for i in 0..with_depth.len().min(8) {
        let frame = with_depth[i * with_depth.len() / with_depth.len().min(8)];
        if recording.depth(frame)?.is_some_and(|d| d.data.iter().any(|z| *z > 0.0)) {
            return Ok(());
        }
    }
    Err(Error::Recording {
        path: recording.dir.clone(),
        faults: vec![
            "depth: every value is 0 = no value; depth must be 16-bit PNG in millimetres (were metres written as integers?)"
                .to_owned(),
        ],
    })
}

/// A clip after hands and localisation.
struct Located {
    reading: Reading,
    trajectory: Option<Trajectory>,
    region: Option<Region>,
    views: Vec<usize>,
    reason: Option<String>,
}

fn locate(recording: &Recording, clip: &Clip, config: &Config) -> Result<Located> {
    let reading = narration::read(clip);
    let mut located = Located { reading, trajectory: None, region: None, views: Vec::new(), reason: None };
    if located.reading.moves_joint == Some(false) {
        located.reason = Some(format!("the narration \"{}\" moves no door or drawer", clip.narration));
        return Ok(located);
    }
    let trajectory = match hands::trajectory(recording, clip, &located.reading, &config.hands) {
        Outcome::Found(t) => t,
        Outcome::Abstained(reason) => {
            located.reason = Some(reason);
            return Ok(located);
        }
    };
    match localization::localize(recording, clip, &trajectory, &config.localization)? {
        Outcome::Found(region) => {
            located.views = views::reselect(recording, &region, &config.localization);
            located.region = Some(region);
        }
        Outcome::Abstained(reason) => located.reason = Some(reason),
    }
    located.trajectory = Some(trajectory);
    Ok(located)
}

/// Views for the room's frame: those with a normals file first, at most thirty.
fn with_normals_first(recording: &Recording, views: &[usize]) -> Vec<usize> {
    // The frame of a room is known to a fraction of a degree from far fewer.
    const ENOUGH: usize = 30;
    let (with, without): (Vec<usize>, Vec<usize>) =
        views.iter().partition(|&&v| recording.frames[v].files.normals.is_some());
    let all: Vec<usize> = if with.len() >= 5 { with } else { with.into_iter().chain(without).collect() };
    (0..all.len().min(ENOUGH)).map(|i| all[i * all.len() / all.len().min(ENOUGH)]).collect()
}

fn infer_clip(
    recording: &Recording,
    clip: &Clip,
    located: Located,
    lifted: &BTreeMap<usize, ViewGeometry>,
    room: Option<&ManhattanFrame>,
    reasoner: &dyn Reasoner,
    config: &Config,
) -> Result<ClipResult> {
    let mut result = ClipResult {
        clip: clip.clone(),
        trajectory: located.trajectory,
        region: located.region,
        views: located.views,
        lines: Vec::new(),
        face: None,
        part: None,
        candidates: Vec::new(),
        answer: None,
        joint: Outcome::Abstained(located.reason.unwrap_or_default()),
    };
    let (Some(trajectory), Some(region)) = (&result.trajectory, &result.region) else { return Ok(result) };

    let in_views: Vec<&LiftedSegment> =
        result.views.iter().filter_map(|v| lifted.get(v)).flat_map(|g| &g.segments).collect();
    result.lines = tracks::build(&in_views, region, &config.geometry, config.seed);
    let surface = surface(region, &result.views, lifted, config.localization.reach_m);
    let around = face::Surroundings {
        surface: &surface,
        grips: [region.grip, trajectory.open_grip()],
        viewpoint: region.viewpoint,
        manhattan: room,
        up: upward(recording, room),
    };
    result.face = face::fit(&around, &config.geometry, config.seed);

    let path = trajectory.positions();
    let open = moved::open_views(recording, clip, trajectory)?;
    let stops = result.face.as_ref().map_or_else(Vec::new, |f| edges_on(f, &result.lines));
    if let Some(face) = &result.face {
        result.part = moved::vote(face, &surface, &open, None, &config.fitting).moving_rect(&stops);
    }
    result.candidates = candidates::collect(
        &candidates::Evidence {
            face: result.face.as_ref(),
            rect: result.part.as_ref(),
            tracks: &result.lines,
            manhattan: room,
            grip: region.grip,
            path: &path,
        },
        &config.inference,
    );
    let paths = [path.clone()];
    result.candidates = result.candidates.iter().map(|c| candidates::settled(c, &paths, &config.reasoning)).collect();
    let agreement: Vec<(f64, usize)> = result
        .candidates
        .iter()
        .map(|c| {
            result
                .face
                .as_ref()
                .map_or((0.0, 0), |f| moved::agreement(f, result.part.as_ref(), &c.joint, &region.grip, &open))
        })
        .collect();
    let answer = reasoner.answer(&Question {
        reading: &located.reading,
        path: &path,
        grip: region.grip,
        candidates: &result.candidates,
        agreement: &agreement,
        part: result.part.as_ref().map(part_shape),
    });
    result.joint = inference::infer(
        trajectory,
        &result.candidates,
        &answer,
        result.face.as_ref(),
        &config.reasoning,
        &config.inference,
    );
    // With the joint known, the part is also seen where the joint puts it: the rectangle again, from all evidence.
    if let (Some(face), Outcome::Found(joint)) = (&result.face, &result.joint) {
        let votes = moved::vote(face, &surface, &open, Some((&joint.joint, &region.grip)), &config.fitting);
        result.part = votes.moving_rect(&stops).or(result.part);
    }
    result.answer = Some(answer);
    Ok(result)
}

/// Up, as the room's own upright edges have it where they are near the world's (which may be off by a degree).
fn upward(recording: &Recording, room: Option<&ManhattanFrame>) -> crate::math::Vector {
    let up = recording.up();
    room.map(|r| r.axes[2]).filter(|axis| crate::math::signed_angle(axis, &up) < 5f64.to_radians()).unwrap_or(up)
}

/// Points of the touched furniture: of the local frames, and of the global views where masks tell what belongs to it.
fn surface(region: &Region, views: &[usize], lifted: &BTreeMap<usize, ViewGeometry>, reach_m: f64) -> Vec<Point> {
    let mut points = region.points.clone();
    let of_class = |class: u8| region.class.is_none_or(|c| c == class);
    for geometry in views.iter().filter_map(|v| lifted.get(v)) {
        let here = geometry.points.iter().filter(|(p, c)| of_class(*c) && (p - region.grip).norm() <= reach_m);
        points.extend(here.map(|(p, _)| *p));
    }
    points
}

/// Lines on a face that run along one of its axes, as [`moved::CellVotes::moving_rect`] takes them.
fn edges_on(face: &Face, lines: &[LineTrack]) -> Vec<(usize, f64, [f64; 2])> {
    lines
        .iter()
        .filter_map(|line| {
            let [a, b] = line.segment.ends().map(|p| face.coordinates(&p));
            let near = a[2].abs() < 0.05 && b[2].abs() < 0.05;
            let along = line.segment.line.direction;
            let upright = along.dot(&face.up).abs() > 0.98;
            let level = along.dot(&face.right).abs() > 0.98;
            if !near || !(upright || level) {
                return None;
            }
            // An upright line bounds the part to the right or left, a level one above or below.
            let (axis, other) = if upright { (0, 1) } else { (1, 0) };
            let span = [a[other].min(b[other]), a[other].max(b[other])];
            Some((axis, 0.5 * (a[axis] + b[axis]), span))
        })
        .collect()
}

/// The grip is the origin of the face's coordinates.
fn part_shape(rect: &Rect) -> PartShape {
    let size_m = rect.size();
    let grip = [0, 1].map(|i| -0.5 * (rect.bounds[i][0] + rect.bounds[i][1]) / size_m[i].max(1e-6));
    PartShape { size_m, grip }
}

/// Clips to scene-level joints (§C.2).
fn merge(
    recording: &Recording,
    clips: &[ClipResult],
    reasoner: &dyn Reasoner,
    config: &Config,
) -> Result<Vec<SceneJoint>> {
    // Clips with a hand take part even where they have no answer of their own: what they show counts.
    let mut seen: Vec<(usize, &ClipResult, &Trajectory)> =
        clips.iter().enumerate().filter_map(|(i, c)| c.trajectory.as_ref().map(|t| (i, c, t))).collect();
    // Clips may be listed in any order; people open before they close.
    seen.sort_by_key(|(i, c, _)| (c.clip.start_frame, *i));
    let held: Vec<aggregate::Held> = seen
        .iter()
        .map(|(_, clip, trajectory)| aggregate::Held {
            action: trajectory.action,
            closed: trajectory.closed_grip(),
            open: trajectory.open_grip(),
            normal: clip.face.map(|f| f.normal),
            kind: narration::read(&clip.clip).kind.filter(|_| !narration::read(&clip.clip).generic),
            part: clip.face.zip(clip.part),
            joint: clip.joint.found().filter(|j| j.type_probability > 0.9).map(|j| j.joint),
        })
        .collect();
    let groups: Vec<Vec<usize>> = aggregate::group(&held, &config.inference)
        .into_iter()
        .map(|g| g.into_iter().map(|i| seen[i].0).collect::<Vec<usize>>())
        .filter(|g| g.iter().any(|&c| clips[c].joint.found().is_some()))
        .collect();
    let merged: Vec<Option<SceneJoint>> =
        groups.par_iter().map(|g| merge_group(recording, clips, g, reasoner, config)).collect::<Result<_>>()?;
    let mut joints: Vec<SceneJoint> = merged.into_iter().flatten().collect();
    for (i, joint) in joints.iter_mut().enumerate() {
        joint.id = format!("joint_{i}");
    }
    Ok(joints)
}

/// The candidates of all clips of a part as far as they fit the face of the clip that saw it best.
fn pooled(
    clips: &[ClipResult],
    group: &[usize],
    best: usize,
    grip: &Point,
    config: &crate::config::Inference,
) -> Vec<AxisCandidate> {
    let mut all = clips[best].candidates.clone();
    let Some(face) = &clips[best].face else { return all };
    let snap = config.snap_deg.to_radians();
    for &c in group.iter().filter(|&&c| c != best) {
        for candidate in &clips[c].candidates {
            // The other clips' slides are this face's or the room's, which are there already.
            if candidate.joint.kind == crate::articulation::JointKind::Prismatic {
                continue;
            }
            let axis = candidate.joint.axis;
            let Some(along) = [face.up, face.right].into_iter().find(|a| crate::math::unsigned_angle(a, &axis) <= snap)
            else {
                continue;
            };
            let side = candidates::side_at(face, &along, &candidate.joint.origin);
            let joint = candidates::outward(Articulation { axis: along, ..candidate.joint }, face, grip);
            all.push(AxisCandidate { joint, side: Some(side), ..candidate.clone() });
        }
    }
    all
}

/// All candidates of all clips of one part, judged on every clip: the best explains all of them.
fn merge_group(
    recording: &Recording,
    clips: &[ClipResult],
    group: &[usize],
    reasoner: &dyn Reasoner,
    config: &Config,
) -> Result<Option<SceneJoint>> {
    // The clip that saw the closed part best gives the face, the grip and the part's outline.
    let trust = |c: usize| -> f64 {
        let clip = &clips[c];
        let (Some(face), Some(region)) = (&clip.face, &clip.region) else { return 0.0 };
        let standoff = face.coordinates(&region.grip)[2];
        let held = (-0.5 * ((standoff - config.geometry.grip_standoff_m) / 0.05).powi(2)).exp();
        held * (0.2 + face.support) * if clip.part.is_some() { 2.0 } else { 1.0 }
    };
    let Some(&best) = group
        .iter()
        .filter(|&&c| clips[c].joint.found().is_some())
        .max_by(|&&a, &&b| trust(a).total_cmp(&trust(b)).then(b.cmp(&a)))
    else {
        return Ok(None);
    };
    let Some(best_joint) = clips[best].joint.found() else { return Ok(None) };
    let grip = best_joint.grip;
    let face = clips[best].face;
    let (mut joint, mut type_probability) = (best_joint.joint, best_joint.type_probability);
    if group.len() > 1 {
        let paths: Vec<Vec<Point>> =
            group.iter().filter_map(|&c| clips[c].trajectory.as_ref()).map(Trajectory::positions).collect();
        let pooled: Vec<AxisCandidate> = pooled(clips, group, best, &grip, &config.inference)
            .iter()
            .map(|c| candidates::settled(c, &paths, &config.reasoning))
            .collect();
        let mut answers = Vec::new();
        for &c in group {
            let Some(trajectory) = &clips[c].trajectory else { continue };
            let open = moved::open_views(recording, &clips[c].clip, trajectory)?;
            let path = trajectory.positions();
            let agreement: Vec<(f64, usize)> = pooled
                .iter()
                .map(|k| {
                    face.as_ref()
                        .map_or((0.0, 0), |f| moved::agreement(f, clips[best].part.as_ref(), &k.joint, &grip, &open))
                })
                .collect();
            answers.push(reasoner.answer(&Question {
                reading: &narration::read(&clips[c].clip),
                path: &path,
                grip,
                candidates: &pooled,
                agreement: &agreement,
                part: clips[best].part.as_ref().map(part_shape),
            }));
        }
        let Some(answer) = Answer::together(&answers) else { return Ok(None) };
        let weights = answer.log_weights();
        let revolute_probability = answer.revolute_probability(&pooled);
        let revolute = revolute_probability >= 0.5;
        let of_kind = |k: &AxisCandidate| (k.joint.kind == crate::articulation::JointKind::Revolute) == revolute;
        let top = (0..pooled.len())
            .filter(|&i| of_kind(&pooled[i]) && weights[i].is_finite())
            .max_by(|&a, &b| weights[a].total_cmp(&weights[b]).then(b.cmp(&a)));
        if let Some(top) = top {
            let all: Vec<(Articulation, f64)> =
                pooled.iter().zip(&weights).map(|(k, w)| (k.joint, (w - weights[top]).exp())).collect();
            joint = aggregate::consensus(&pooled[top].joint, &all);
            type_probability = revolute_probability.max(1.0 - revolute_probability);
        }
    }
    let trajectories = || group.iter().filter_map(|&c| clips[c].trajectory.as_ref());
    let sense: f64 = trajectories().map(|t| joint.opening_at(&t.closed_grip(), &t.open_grip())).sum();
    let leaves_face = face.is_some_and(|f| {
        let out = match joint.kind {
            crate::articulation::JointKind::Revolute => joint.axis.cross(&(grip - joint.origin)).normalize(),
            crate::articulation::JointKind::Prismatic => joint.axis,
        };
        out.dot(&f.normal).abs() > 0.3
    });
    if sense < 0.0 && !leaves_face {
        joint = joint.reversed();
    }
    let observed_range =
        trajectories().map(|t| inference::observed_range(&joint, &t.closed_grip(), &t.positions())).fold(0.0, f64::max);
    Ok(Some(SceneJoint {
        id: String::new(),
        joint,
        clips: group.iter().map(|&c| clips[c].clip.clip.clone()).collect(),
        furniture: group.iter().find_map(|&c| narration::read(&clips[c].clip).furniture),
        type_probability,
        grip,
        face,
        part: clips[best].part,
        observed_range,
    }))
}
