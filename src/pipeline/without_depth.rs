//! A recording without depth: the hand's path, fronts that it suggests, lines of the images, sparse points (ours).
//!
//! Each lack is a lack of evidence. Where surfaces are is not seen, so that every clip has many fronts that it could be about
//! ([`fronts`]), with the axes on each; all of them are weighed at once by the hand's path and by how furniture is hung and named.
//! The path counts whole: `reasoning.evidence_temperature` is for hands and depth, which share errors.
//! Of the part nothing is seen: its box is assumed when it is built. Clips have no [`crate::localization::Region`], by which what
//! comes later knows.

use std::collections::BTreeMap;

use rayon::prelude::*;

use super::clip::{self, Followed};
use super::{ClipResult, Progress, Scene, scene};
use crate::articulation::{Action, JointKind, Outcome};
use crate::config::{Config, RoomFrame};
use crate::error::Result;
use crate::geometry::face::{self, Surroundings};
use crate::geometry::fronts::{self, Front};
use crate::geometry::segments::{self, LineDetector, SeenSegment};
use crate::geometry::{AxisCandidate, Face, LineTrack, ManhattanFrame, candidates, directed, manhattan};
use crate::hands::{Trajectory, contact};
use crate::inference;
use crate::localization::{Footage, views};
use crate::math::{Point, Vector, stats, unit};
use crate::reasoning::{self, Answer, Question, Reasoner};
use crate::recording::{AtWork, Clip, DepthFactors, Recording};

/// Hands, lines, fronts, inference and aggregation.
pub(super) fn infer(
    recording: &Recording,
    config: &Config,
    detector: &dyn LineDetector,
    reasoner: &dyn Reasoner,
    progress: Progress,
) -> Result<Scene> {
    let at_work = AtWork::of(recording);
    progress("following hands", 0, 1);
    let holds = contact::holds(recording, &at_work, &config.hands)?;
    let followed: Vec<Followed> = recording
        .clips
        .par_iter()
        .zip(&holds)
        .map(|(clip, hold)| clip::follow(recording, clip, hold.as_ref(), &at_work, config))
        .collect();
    progress("looking", 0, 1);
    let looked = look(recording, &followed, &at_work, detector, config)?;
    let seen_room = room(recording, &looked, config)?;
    progress("inferring", 0, 1);
    let all = |room: Option<&ManhattanFrame>| -> Vec<ClipResult> {
        let each = recording.clips.par_iter().zip(&followed).zip(&looked.views);
        each.map(|((clip, followed), views)| {
            let around = ClipViews { recording, looked: &looked, views, room };
            of_clip(clip, followed, &around, reasoner, config)
        })
        .collect()
    };
    let mut clips = all(seen_room.as_ref());
    let mut manhattan = seen_room;
    if manhattan.is_none() {
        manhattan = room_of_fronts(&clips, &recording.up(), &config.geometry.frame);
        if manhattan.is_some() {
            clips = all(manhattan.as_ref());
        }
    }
    let sketches = BTreeMap::new();
    let footage = Footage { recording, sketches: &sketches, at_work: &at_work, located: recording };
    let joints = scene::merge(&footage, &clips, reasoner, config);
    let name = recording.name.clone();
    let videos = recording.videos.clone();
    let depth_factors = DepthFactors::default();
    Ok(Scene { recording: name, manhattan, videos, depth_factors, clips, joints, surroundings: None })
}

/// What was looked at.
struct Looked {
    /// For each clip the frames whose lines are looked for around its grip.
    views: Vec<Vec<usize>>,
    /// Segments of each such frame.
    segments: BTreeMap<usize, Vec<SeenSegment>>,
}

fn look(
    recording: &Recording,
    followed: &[Followed],
    at_work: &AtWork,
    detector: &dyn LineDetector,
    config: &Config,
) -> Result<Looked> {
    let idle = views::idle(recording, at_work, &config.localization);
    let of_clip = |followed: &Followed| -> Vec<usize> {
        let grip = followed.hand.found().map(Trajectory::closed_grip);
        grip.map_or_else(Vec::new, |grip| {
            views::sighting(recording, &idle, &grip, config.geometry.sighting_frames, &config.localization)
        })
    };
    let views: Vec<Vec<usize>> = followed.par_iter().map(of_clip).collect();
    let mut frames: Vec<usize> = views.iter().flatten().copied().collect();
    super::sort_unique(&mut frames);
    let segments = frames
        .par_iter()
        .map(|&frame| Ok((frame, segments::seen(recording, frame, detector, &config.geometry)?)))
        .collect::<Result<BTreeMap<usize, Vec<SeenSegment>>>>()?;
    Ok(Looked { views, segments })
}

/// The room's frame: of normals where there are files of them, else of the level directions of what runs level in the images.
fn room(recording: &Recording, looked: &Looked, config: &Config) -> Result<Option<ManhattanFrame>> {
    let frames: Vec<usize> = (0..recording.frames.len()).collect();
    let with_normals: Vec<usize> = super::with_normals_first(recording, &frames, config)
        .into_iter()
        .filter(|&f| recording.frames[f].files.normals.is_some())
        .collect();
    if let Some(room) = manhattan::estimate(recording, &with_normals, &config.geometry)? {
        return Ok(Some(room));
    }
    let (up, rules) = (recording.up(), &config.geometry.frame);
    let [upright, flat] = rules.level_cos;
    // What runs level lies in its segment's plane; of anything else this direction is chance, and spreads evenly.
    let level = looked.segments.values().flatten().filter(|s| (upright..flat).contains(&s.plane.dot(&up).abs()));
    let directions: Vec<Vector> = level.filter_map(|s| unit(&s.plane.cross(&up))).collect();
    let axes = manhattan::of_normals(&directions, &up, rules).filter(|axes| stands_out(axes, &directions, rules));
    Ok(axes.map(|axes| ManhattanFrame { axes, frames: looked.segments.len() }))
}

/// Whether directions keep to a room's walls.
fn stands_out(axes: &[Vector; 3], directions: &[Vector], rules: &RoomFrame) -> bool {
    let near = |d: &&Vector| axes[..2].iter().any(|axis| crate::math::unsigned_angle(axis, d) < rules.segments_rad);
    directions.iter().filter(near).count() as f64 >= rules.segments_share * directions.len() as f64
}

/// The room's frame from the fronts of clips that were each judged alone: where several stand square or along each other.
fn room_of_fronts(clips: &[ClipResult], up: &Vector, rules: &RoomFrame) -> Option<ManhattanFrame> {
    let first = crate::math::any_orthogonal(up);
    let second = up.cross(&first);
    let upright = |n: &Vector| n.dot(up).abs() < 0.5;
    let normals = clips.iter().filter(|c| c.joint.found().is_some()).filter_map(|c| c.face.map(|f| f.normal));
    // A quarter turn is none.
    let headings: Vec<f64> = normals.filter(upright).map(|n| 4.0 * n.dot(&second).atan2(n.dot(&first))).collect();
    let off = |a: f64, b: f64| 0.25 * (a - b).sin().atan2((a - b).cos());
    let near = |of: f64| headings.iter().copied().filter(move |h| off(*h, of).abs() < rules.fronts_rad);
    let best = headings.iter().copied().max_by(|a, b| near(*a).count().cmp(&near(*b).count()).then(b.total_cmp(a)))?;
    let agreeing: Vec<f64> = near(best).map(|h| off(h, best)).collect();
    if agreeing.len() < rules.fronts_clips || (agreeing.len() as f64) < rules.fronts_share * headings.len() as f64 {
        return None;
    }
    let heading = 0.25 * best + stats::median(&agreeing)?;
    let along = first * heading.cos() + second * heading.sin();
    Some(ManhattanFrame { axes: [along, up.cross(&along), *up], frames: agreeing.len() })
}

/// What a clip is judged with.
struct ClipViews<'a> {
    recording: &'a Recording,
    looked: &'a Looked,
    views: &'a [usize],
    room: Option<&'a ManhattanFrame>,
}

impl ClipViews<'_> {
    /// Up, as in [`clip::upward`].
    fn up(&self, config: &Config) -> Vector {
        clip::upward(self.recording, self.room, config)
    }

    fn lines(&self, grip: &Point, config: &Config) -> Vec<LineTrack> {
        let segments: Vec<&SeenSegment> =
            self.views.iter().filter_map(|v| self.looked.segments.get(v)).flatten().collect();
        let mut directions = vec![self.up(config)];
        directions.extend(self.room.iter().flat_map(|room| room.axes[..2].iter().copied()));
        // A pixel of the first of its views stands for those of all.
        let camera = self.views.first().map_or(&self.recording.camera, |v| self.recording.camera_of(*v));
        directed::lines(camera, &segments, grip, &directions, &config.geometry)
    }

    /// The plane through sparse points off which the grip stands.
    fn face(&self, hand: &Trajectory, lines: &[LineTrack], level: f64, config: &Config) -> Option<Face> {
        let grip = hand.closed_grip();
        let near = |p: &&Point| (*p - grip).norm() <= config.localization.reach_m;
        let surface: Vec<Point> = self.recording.reconstruction.iter().filter(near).copied().collect();
        let around = Surroundings {
            surface: &surface,
            grips: [grip, hand.open_grip()],
            viewpoint: self.viewpoint(hand),
            manhattan: self.room,
            lines,
            up: self.up(config),
            level,
        };
        face::fit(&around, &config.geometry, &config.priors, config.seed)
    }

    /// Where the person's eyes are while the hand holds the part, in the mean.
    fn viewpoint(&self, hand: &Trajectory) -> Point {
        let eyes: Vec<Point> =
            hand.samples.iter().filter_map(|s| self.recording.frames.get(s.frame)).map(|f| f.center()).collect();
        crate::math::centroid(&eyes).unwrap_or_else(|| hand.closed_grip())
    }
}

/// All fronts of a clip with the axes on each, and which of them the hand is likeliest to have moved.
fn of_clip(
    clip: &Clip,
    followed: &Followed,
    sight: &ClipViews,
    reasoner: &dyn Reasoner,
    config: &Config,
) -> ClipResult {
    let hand = match &followed.hand {
        Outcome::Found(hand) => hand,
        Outcome::Abstained(reason) => return ClipResult::unanswered(clip.clone(), reason.clone()),
    };
    let reading = &followed.reading;
    let grip = hand.closed_grip();
    let path = from_closed(hand);
    let strength = reading.strength() * config.reasoning.name_accuracy;
    let level = config.priors.hung.level_share(reasoning::furniture(reading, None), strength);
    let lines = sight.lines(&grip, config);
    let around = fronts::Around {
        grip,
        path: &path,
        viewpoint: sight.viewpoint(hand),
        up: sight.up(config),
        manhattan: sight.room,
        lines: &lines,
        through_points: sight.face(hand, &lines, level, config),
        level,
    };
    let all = fronts::assumed(&around, &config.geometry, &config.reasoning, &config.priors);
    let ask = |face: &Face, candidates: &[AxisCandidate]| {
        reasoner.answer(&Question {
            reading,
            words: None,
            path: &path,
            grip,
            candidates,
            agreement: &vec![0.0; candidates.len()],
            part: None,
            face: Some(face),
            up: sight.recording.up(),
        })
    };
    let Weighed { candidates, answer, front } = weighed(&all, &around, &ask, config);
    let face = likeliest(&candidates, &answer).and_then(|i| all.get(*front.get(i)?)).map(|front| front.face);
    // Which way it opens the hand alone tells: the front is where the hand says.
    let joint = inference::infer(
        hand,
        &candidates,
        &answer,
        None,
        reading.names_furniture(),
        &config.reasoning,
        &config.inference,
    );
    ClipResult {
        trajectory: Some(hand.clone()),
        views: sight.views.to_vec(),
        lines,
        face,
        candidates,
        answer: Some(answer),
        joint,
        ..ClipResult::unanswered(clip.clone(), String::new())
    }
}

/// The hand's way from where the part is closed to where it is open.
fn from_closed(hand: &Trajectory) -> Vec<Point> {
    let mut path = hand.positions();
    if hand.action == Action::Close {
        path.reverse();
    }
    path
}

/// The candidates on all fronts, their weights, and for each of them its front.
struct Weighed {
    candidates: Vec<AxisCandidate>,
    answer: Answer,
    front: Vec<usize>,
}

fn weighed(
    all: &[Front],
    around: &fronts::Around,
    ask: &dyn Fn(&Face, &[AxisCandidate]) -> Answer,
    config: &Config,
) -> Weighed {
    let paths = [around.path.to_vec()];
    let answer = Answer { log_likelihoods: Vec::new(), log_priors: Vec::new(), words_log_odds: 0.0 };
    let mut out = Weighed { candidates: Vec::new(), answer, front: Vec::new() };
    for (i, front) in all.iter().enumerate() {
        let evidence = candidates::Evidence {
            face: Some(&front.face),
            rect: None,
            tracks: around.lines,
            surface: &[],
            named: &[],
            manhattan: around.manhattan,
            grip: around.grip,
            path: around.path,
        };
        let own: Vec<AxisCandidate> = candidates::on_assumed(&evidence, &config.inference, &config.priors.fronts)
            .iter()
            .map(|c| candidates::settled(c, &paths, &config.reasoning))
            .collect();
        let answer = ask(&front.face, &own);
        let whole = config.reasoning.evidence_temperature;
        out.answer.log_likelihoods.extend(answer.log_likelihoods.iter().map(|nats| nats * whole));
        out.answer.log_priors.extend(answer.log_priors.iter().map(|prior| prior + front.log_prior));
        out.answer.words_log_odds = answer.words_log_odds;
        out.front.extend(std::iter::repeat_n(i, own.len()));
        out.candidates.extend(own);
    }
    out
}

/// The likeliest candidate of the likelier type, as in [`inference::infer`].
fn likeliest(candidates: &[AxisCandidate], answer: &Answer) -> Option<usize> {
    let turns = answer.revolute_probability(candidates) >= 0.5;
    let weights = answer.log_weights();
    let of_type = |i: &usize| (candidates[*i].joint.kind == JointKind::Revolute) == turns && weights[*i].is_finite();
    // The first of equals, as a stable sort has it.
    (0..candidates.len()).filter(of_type).max_by(|&a, &b| weights[a].total_cmp(&weights[b]).then(b.cmp(&a)))
}

/// What the clips of a part say together: every clip's candidates (of those that are `offering`) as that clip believes in them,
/// under the paths of all hands. `None` where no clip has any.
pub(super) fn together(
    clips: &[ClipResult],
    members: &[usize],
    offering: &[usize],
    config: &Config,
) -> Option<(Vec<AxisCandidate>, Answer)> {
    let paths: Vec<Vec<Point>> =
        members.iter().filter_map(|&c| clips[c].trajectory.as_ref()).map(from_closed).collect();
    let believed_nats = config.inference.scene.believed_nats;
    let mut pooled = Vec::new();
    let mut answer = Answer { log_likelihoods: Vec::new(), log_priors: Vec::new(), words_log_odds: 0.0 };
    for (clip, own) in offering.iter().filter_map(|&c| Some((&clips[c], clips[c].answer.as_ref()?))) {
        let weights = own.log_weights();
        let top = weights.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let believed = clip.candidates.iter().zip(&own.log_priors).zip(&weights);
        for ((candidate, prior), _) in believed.filter(|(_, weight)| top - **weight <= believed_nats) {
            let settled = candidates::settled(candidate, &paths, &config.reasoning);
            let each = paths
                .iter()
                .map(|path| reasoning::path_log_likelihood(&settled.joint, path, &config.reasoning, &config.inference));
            answer.log_likelihoods.push(each.sum::<f64>());
            answer.log_priors.push(*prior);
            pooled.push(settled);
        }
    }
    let words: Vec<f64> = members.iter().filter_map(|&c| Some(clips[c].answer.as_ref()?.words_log_odds)).collect();
    answer.words_log_odds = stats::mean(&words)?;
    (!pooled.is_empty()).then_some((pooled, answer))
}

/// The front of a part under one of its joints: that of a clip, where it can be, else the one that the joint suggests.
pub(super) fn front<'a>(
    joint: &crate::articulation::Articulation,
    grip: &Point,
    faces: impl Iterator<Item = &'a Face>,
    up: &Vector,
    config: &Config,
) -> Face {
    let mut fitting = faces.filter(|face| fronts::may_be_front(face, joint, grip));
    fitting.next().copied().unwrap_or_else(|| fronts::of_joint(joint, grip, up, config.priors.handles.standoff_m))
}
