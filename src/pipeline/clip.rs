//! One clip: hands and localisation, then geometry, reasoning and inference (§3.1 to §3.4).

use std::collections::BTreeMap;

use super::{ClipResult, method, weigh};
use crate::articulation::Outcome;
use crate::config::{Config, LineMethod};
use crate::error::Result;
use crate::geometry::Rect;
use crate::geometry::segments::LiftedSegment;
use crate::geometry::{Face, LineTrack, ManhattanFrame, candidates, face, tracks};
use crate::hands::contact::Hold;
use crate::hands::{self, Trajectory};
use crate::localization::{self, Footage, Region, views};
use crate::math::{Point, Vector, signed_angle};
use crate::part::outline;
use crate::part::outline::Stop;
use crate::part::views::{self as open_state, View};
use crate::reasoning::words::{AskedClip, Words};
use crate::reasoning::{self, Answer, PartShape, Reasoner};
use crate::recording::narration::{self, Reading};
use crate::recording::{AtWork, Clip, Recording};

/// A clip after its hand was followed.
pub(super) struct Followed {
    pub(super) reading: Reading,
    /// The hand, or the reason why there is none.
    pub(super) hand: Outcome<Trajectory>,
    /// Frames in which the furniture is closed.
    pub(super) closed: Vec<usize>,
    /// Frames in which it is open.
    pub(super) open: Vec<usize>,
}

pub(super) fn follow(
    recording: &Recording,
    clip: &Clip,
    hold: Option<&Hold>,
    at_work: &AtWork,
    config: &Config,
) -> Followed {
    let reading = narration::read(clip);
    let hand = if reading.moves_joint == Some(false) {
        Outcome::Abstained(format!("the narration \"{}\" moves no door or drawer", clip.narration))
    } else {
        hands::trajectory(recording, clip, &reading, hold, &config.hands)
    };
    let (closed, open) = hand.found().map_or_else(Default::default, |t| {
        let open = open_state::open_frames(recording, clip, t, &config.part).into_iter().map(|f| f.frame).collect();
        (localization::local_frames(recording, clip, t, at_work, &config.localization), open)
    });
    Followed { reading, hand, closed, open }
}

/// A clip after hands and localisation.
pub(super) struct Located {
    reading: Reading,
    trajectory: Option<Trajectory>,
    /// See [`ClipResult::closed_frames`].
    closed: Vec<usize>,
    region: Option<Region>,
    pub(super) views: Vec<usize>,
    reason: Option<String>,
}

/// Localises a clip; its global views are among the `idle` frames.
pub(super) fn locate(
    footage: &Footage,
    clip: &Clip,
    followed: Followed,
    idle: &[usize],
    occupancy: Option<&views::Occupancy>,
    config: &Config,
) -> Located {
    let mut located = Located {
        reading: followed.reading,
        trajectory: None,
        closed: followed.closed,
        region: None,
        views: Vec::new(),
        reason: None,
    };
    let trajectory = match followed.hand {
        Outcome::Found(t) => t,
        Outcome::Abstained(reason) => {
            located.reason = Some(reason);
            return located;
        }
    };
    match localization::localize(footage, clip, &trajectory, &located.closed, &config.localization, &config.hands.grips)
    {
        Outcome::Found(region) => {
            located.views = views::reselect(footage.recording, idle, &region, occupancy, &config.localization);
            located.region = Some(region);
        }
        Outcome::Abstained(reason) => located.reason = Some(reason),
    }
    located.trajectory = Some(trajectory);
    located
}

/// What the whole scene's views show.
#[derive(Clone, Copy)]
pub(super) struct Seen<'a> {
    pub(super) footage: Footage<'a>,
    pub(super) segments: &'a BTreeMap<usize, Vec<LiftedSegment>>,
    /// Triangulated lines.
    pub(super) lines: &'a [LineTrack],
    pub(super) room: Option<&'a ManhattanFrame>,
}

/// Everything from the clip's lines to its joint.
pub(super) fn infer(
    clip: &Clip,
    located: Located,
    seen: &Seen,
    reasoner: &dyn Reasoner,
    config: &Config,
) -> Result<ClipResult> {
    let Footage { recording, sketches, .. } = seen.footage;
    let Located { reading, trajectory, closed, region, views, reason } = located;
    let mut result = ClipResult {
        trajectory,
        closed_frames: closed,
        region,
        views,
        ..ClipResult::unanswered(clip.clone(), reason.unwrap_or_default())
    };
    let (Some(trajectory), Some(region)) = (&result.trajectory, &result.region) else { return Ok(result) };

    result.lines = lines_at(region, &result.views, seen, config);
    result.words =
        reasoner.words(&AskedClip { recording, clip, region, views: &result.views, lines: &result.lines })?;
    let surface = surface(&seen.footage, region, &result.views, config);
    result.face = touched(&result, &reading, &surface, seen, config);

    let open = open_state::open_views(recording, sketches, clip, trajectory, &config.part);
    let stops = result.face.as_ref().map_or_else(Vec::new, |f| edges_on(f, &result.lines, config));
    if let Some(face) = &result.face {
        result.part = outline::vote(face, &surface, &open, None, config).moving_rect(&stops);
    }
    let path = trajectory.positions();
    let named = result.words.as_ref().map_or_else(Vec::new, |w: &Words| w.named(result.lines.len()));
    let evidence = candidates::Evidence {
        face: result.face.as_ref(),
        rect: result.part.as_ref(),
        tracks: &result.lines,
        surface: &surface,
        named: &named,
        manhattan: seen.room,
        grip: region.grip,
        path: &path,
    };
    let method = method::of(config);
    result.candidates = method.candidates(&evidence, config);
    let Some(answer) = answered(&result, &reading, &open, seen, reasoner, config) else { return Ok(result) };
    result.joint = method.joint(&result, trajectory, &answer, &reading, config);
    // With the joint known, the part is also seen where the joint puts it: the rectangle again, from all evidence.
    if let (Some(face), Outcome::Found(joint)) = (&result.face, &result.joint) {
        let told = open_state::told(&joint.joint, &region.grip, &open);
        let votes = outline::vote(face, &surface, &open, Some((&joint.joint, &told)), config);
        result.part = votes.moving_rect(&stops).or(result.part);
    }
    result.answer = Some(answer);
    Ok(result)
}

/// The 3D lines at a clip's region.
fn lines_at(region: &Region, views: &[usize], seen: &Seen, config: &Config) -> Vec<LineTrack> {
    match config.geometry.lines {
        LineMethod::Triangulated => tracks::at_region(seen.lines, region),
        LineMethod::Unprojected => {
            let in_views: Vec<&LiftedSegment> = views.iter().filter_map(|v| seen.segments.get(v)).flatten().collect();
            tracks::unprojected(&in_views, region, &config.geometry, config.seed)
        }
    }
}

/// The face that the hand touched, of a clip whose lines and words are known.
fn touched(result: &ClipResult, reading: &Reading, surface: &[Point], seen: &Seen, config: &Config) -> Option<Face> {
    let (trajectory, region) = (result.trajectory.as_ref()?, result.region.as_ref()?);
    let furniture = reasoning::furniture(reading, result.words.as_ref());
    let around = face::Surroundings {
        surface,
        grips: [region.grip, trajectory.open_grip()],
        viewpoint: region.viewpoint,
        manhattan: seen.room,
        lines: &result.lines,
        up: upward(seen.footage.recording, seen.room, config),
        level: config.priors.hung.level_share(furniture, reading.strength() * config.reasoning.name_accuracy),
    };
    face::fit(&around, &config.geometry, &config.priors, config.seed)
}

/// What a clip answers about its candidates.
fn answered(
    result: &ClipResult,
    reading: &Reading,
    open: &[View],
    seen: &Seen,
    reasoner: &dyn Reasoner,
    config: &Config,
) -> Option<Answer> {
    let (trajectory, region) = (result.trajectory.as_ref()?, result.region.as_ref()?);
    let grip_std_m = hands::grip_std_m(trajectory.closed_end_seen(), &config.hands.grips);
    let closed = result.face.map(|face| weigh::ClosedFront { face, rect: result.part, grip: region.grip, grip_std_m });
    let shown = weigh::ClipEvidence {
        reading: reading.clone(),
        words: result.words.as_ref(),
        path: trajectory.positions(),
        open: open.to_vec(),
        closed: closed.into_iter().collect(),
    };
    let part =
        weigh::AskedPart { grip: region.grip, face: result.face.as_ref(), shape: result.part.as_ref().map(part_shape) };
    weigh::answers(&[shown], &part, &result.candidates, seen.footage.recording, reasoner, config).pop()
}

/// Up, as the room's own upright edges have it where they are near the world's (which may be off by a degree).
pub(super) fn upward(recording: &Recording, room: Option<&ManhattanFrame>, config: &Config) -> Vector {
    let (up, near) = (recording.up(), config.geometry.frame.up_deg.to_radians());
    room.map(|r| r.axes[2]).filter(|axis| signed_angle(axis, &up) < near).unwrap_or(up)
}

/// Points of the touched furniture: of the local frames, and of the global views where masks tell what belongs to it.
pub(super) fn surface(footage: &Footage, region: &Region, views: &[usize], config: &Config) -> Vec<Point> {
    let mut points = localization::inside(footage, region, &config.localization);
    for sketch in views.iter().filter_map(|v| footage.sketches.get(v)) {
        let near = |p: &Point| (p - region.grip).norm() <= config.localization.reach_m;
        points.extend(localization::points(footage.recording, sketch, region.class).into_iter().filter(near));
    }
    points
}

/// Lines on a face that run along one of its axes.
pub(super) fn edges_on(face: &Face, lines: &[LineTrack], config: &Config) -> Vec<Stop> {
    let rules = &config.geometry.face;
    lines
        .iter()
        .filter_map(|line| {
            let [a, b] = line.segment.ends().map(|p| face.coordinates(&p));
            let near = [a, b].iter().all(|end| end[2].abs() < rules.edges_within_m);
            let along = line.segment.line.direction;
            let upright = along.dot(&face.up).abs() > rules.edges_along_cos;
            let level = along.dot(&face.right).abs() > rules.edges_along_cos;
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
pub(super) fn part_shape(rect: &Rect) -> PartShape {
    let size_m = rect.size();
    let grip = [0, 1].map(|i| -0.5 * (rect.bounds[i][0] + rect.bounds[i][1]) / size_m[i].max(1e-6));
    PartShape { size_m, grip }
}
