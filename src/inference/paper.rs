//! The paper's rules (§3.4, §A.7, §C.2): the type from words, the slide along a direction of the room, the hinge at the line of
//! least variance of the radius; clips of one part found by their voxels, and made one joint by RANSAC over their answers.
//!
//! It computes no probabilities, so none are given. Where the paper is silent or says two things, the items say what is done.

use std::cmp::Ordering;

use super::{ClipJoint, aggregate, observed_range, opening_sense, torus_tolerance};
use crate::articulation::{Articulation, JointKind, Outcome};
use crate::config;
use crate::geometry::{AxisCandidate, AxisSource, Face};
use crate::hands::Trajectory;
use crate::math::line::{Line, Segment};
use crate::math::ransac::{Search, lo_ransac};
use crate::math::{Point, Vector, centroid, path, principal_directions};
use crate::reasoning::words::Words;
use crate::recording::narration::Reading;

/// The type that words tell: a language model's summary of the frames (§A.6), else what most frames say. Where neither says a
/// type, or no model was asked, the furniture's name tells it.
#[must_use]
pub fn told(words: Option<&Words>, reading: &Reading) -> Option<JointKind> {
    let most = |w: &Words| match w.revolute.cmp(&w.prismatic) {
        Ordering::Greater => Some(JointKind::Revolute),
        Ordering::Less => Some(JointKind::Prismatic),
        Ordering::Equal => None,
    };
    words.and_then(|w| w.summary.or_else(|| most(w))).or(reading.kind)
}

/// Infers the joint of one clip. `told`: the type, see [`told`]; `seed`: of the draws.
///
/// The paper leaves open what happens without a word: the rule whose axis leaves the smaller variance then decides. Its torus
/// (§B.1) has a thickness and no rule that it decides by; here it counts the inliers of a hinge, which [`together`] goes by.
#[must_use]
pub fn infer(
    trajectory: &Trajectory,
    candidates: &[AxisCandidate],
    told: Option<JointKind>,
    face: Option<&Face>,
    config: &config::Inference,
    seed: u64,
) -> Outcome<ClipJoint> {
    let path = trajectory.positions();
    // What words rule out is not looked for.
    let turns = || hinge(&path, candidates, config);
    let slides = || slide(&path, candidates, config, seed);
    let found = match told {
        Some(JointKind::Revolute) => turns(),
        Some(JointKind::Prismatic) => slides(),
        None => match (turns(), slides()) {
            (Ok(turn), Ok(pull)) => Ok(if turn.variance_m2 < pull.variance_m2 { turn } else { pull }),
            (turn, pull) => turn.or(pull),
        },
    };
    let (fit, first) = match (found, path.first()) {
        (Ok(fit), Some(first)) => (fit, *first),
        (Ok(_), None) => return Outcome::Abstained("no hand samples".to_owned()),
        (Err(reason), _) => return Outcome::Abstained(reason),
    };
    let line = fit.candidate.joint.line();
    let contact_pivot = match fit.candidate.joint.kind {
        JointKind::Revolute => centroid(&path).map_or(line.point, |c| line.project(&c)),
        JointKind::Prismatic => first,
    };
    let grip = trajectory.closed_grip();
    let joint = Articulation { origin: contact_pivot, ..fit.candidate.joint };
    let joint = opening_sense(joint, face, &grip, std::iter::once(trajectory));
    Outcome::Found(ClipJoint {
        joint,
        contact_pivot,
        source: fit.candidate.source,
        type_probability: None,
        joint_probability: None,
        residual_m: fit.variance_m2.sqrt(),
        // Whatever has a variance has samples.
        inliers: inliers(&joint, &path, config).unwrap_or(0.0),
        radius_m: fit.radius_m,
        observed_range: observed_range(&joint, &grip, &path),
        grip,
        action: trajectory.action,
    })
}

/// A candidate as far as the hand speaks for it.
struct Fit<'a> {
    candidate: &'a AxisCandidate,
    /// Of the distance from a hinge, or across a slide.
    variance_m2: f64,
    /// Mean distance from a hinge.
    radius_m: Option<f64>,
}

/// The line of least variance of the hand's distance: of those that a language model named, or of all.
fn hinge<'a>(path: &[Point], candidates: &'a [AxisCandidate], config: &config::Inference) -> Result<Fit<'a>, String> {
    let lines = || candidates.iter().filter(|c| c.source == AxisSource::Line);
    let named = lines().any(|c| c.named > 0.0);
    let asked: Vec<&AxisCandidate> = lines().filter(|c| !named || c.named > 0.0).collect();
    let fits = path::about_lines(path, &asked.iter().map(|c| c.joint.line()).collect::<Vec<_>>());
    let within = asked.into_iter().zip(fits).filter(|(_, fit)| fit.radius <= config.max_radius_m);
    let best = within.min_by(|a, b| a.1.radial_variance.total_cmp(&b.1.radial_variance));
    let (candidate, fit) = best.ok_or_else(|| "no 3D line could be the hinge".to_owned())?;
    Ok(Fit { candidate, variance_m2: fit.radial_variance, radius_m: Some(fit.radius) })
}

/// The direction of the room that the hand's path runs along best.
fn slide<'a>(
    path: &[Point],
    candidates: &'a [AxisCandidate],
    config: &config::Inference,
    seed: u64,
) -> Result<Fit<'a>, String> {
    let (pull, share) =
        pull(path, config, seed).ok_or_else(|| "the hand in contact has no direction of motion".to_owned())?;
    if share < config.prismatic_min_inliers {
        return Err(format!(
            "only {:.0} % of the hand samples lie on any line ({:.0} % are needed)",
            100.0 * share,
            100.0 * config.prismatic_min_inliers
        ));
    }
    let along = |c: &AxisCandidate| pull.dot(&c.joint.axis).abs();
    let best = candidates
        .iter()
        .filter(|c| c.source == AxisSource::Manhattan)
        .max_by(|a, b| along(a).total_cmp(&along(b)))
        .and_then(|c| Some((c, path::across(path, &c.joint.axis)?)));
    let (candidate, variance_m2) = best.ok_or_else(|| "no direction of the room for a slide".to_owned())?;
    Ok(Fit { candidate, variance_m2, radius_m: None })
}

/// The direction of the hand's motion `v_h`, unit, either sense, and the share of the samples that lie on its line: by RANSAC
/// within the slide's tolerance, and PCA of what lies there (§3.4, §B.1).
fn pull(path: &[Point], config: &config::Inference, seed: u64) -> Option<(Vector, f64)> {
    let along = |points: &[Point]| -> Option<Line> {
        let (axes, _) = principal_directions(points)?;
        Some(Line { point: centroid(points)?, direction: axes.column(0).into_owned() })
    };
    let found = lo_ransac::<Line, 2>(
        path.len(),
        Search { draws: config.prismatic_draws, tolerance: config.prismatic_tolerance_m, seed },
        |pair| Segment::between(&path[pair[0]], &path[pair[1]]).map(|s| s.line),
        |ids| along(&ids.iter().map(|&i| path[i]).collect::<Vec<_>>()),
        |line, i| line.distance(&path[i]),
    )?;
    Some((found.model.direction, found.inliers.len() as f64 / path.len() as f64))
}

/// Share of a hand's way within the torus of a hinge, or on the line of a slide (§B.1). `None` without samples.
fn inliers(joint: &Articulation, path: &[Point], config: &config::Inference) -> Option<f64> {
    match joint.kind {
        JointKind::Revolute => path::torus_inliers(path, &joint.line(), |r| torus_tolerance(r, config)),
        JointKind::Prismatic => path::line_inliers(path, &joint.axis, config.prismatic_tolerance_m),
    }
}

/// Groups clips whose confident voxels overlap (§C.2, as it is done for Epic-Fields): each joins the group of the earlier clip
/// that it overlaps most. `regions`: the voxels of each clip, sorted, in the order of time. Returns indices into `regions`.
#[must_use]
pub fn same_voxels(regions: &[&[[i32; 3]]], config: &config::Inference) -> Vec<Vec<usize>> {
    let mut groups: Vec<Vec<usize>> = Vec::new();
    for (i, region) in regions.iter().enumerate() {
        let overlap = |g: &[usize]| g.iter().map(|&j| iou(regions[j], region)).fold(0.0, f64::max);
        let home = groups
            .iter()
            .enumerate()
            .map(|(at, group)| (at, overlap(group)))
            .filter(|(_, iou)| *iou >= config.merge_voxel_iou)
            .reduce(|best, next| if next.1 > best.1 { next } else { best });
        match home {
            Some((home, _)) => groups[home].push(i),
            None => groups.push(vec![i]),
        }
    }
    groups
}

/// Intersection over union of two sorted sets; none of two empty ones.
fn iou(a: &[[i32; 3]], b: &[[i32; 3]]) -> f64 {
    let both = a.iter().filter(|v| b.binary_search(v).is_ok()).count();
    let either = a.len() + b.len() - both;
    if either == 0 { 0.0 } else { both as f64 / either as f64 }
}

/// The joint of several clips of one part (§3.4, §C.2), and whose answer in `own` it is built on. `own`: the clips' answers;
/// `paths`: the hands' ways of all of these clips, of those without an answer, too.
///
/// The type is that of most answers. RANSAC, each answer being a sample: that on which most of all hands' samples lie wins,
/// and those that agree with it are averaged by PCA. The origin of a hinge is the projection of all hands' centroid. `None`
/// without an answer.
#[must_use]
pub fn together(own: &[&ClipJoint], paths: &[Vec<Point>], config: &config::Inference) -> Option<(usize, Articulation)> {
    let turning = own.iter().filter(|j| j.joint.kind == JointKind::Revolute).count();
    let most = match (2 * turning).cmp(&own.len()) {
        Ordering::Greater => Some(JointKind::Revolute),
        Ordering::Less => Some(JointKind::Prismatic),
        Ordering::Equal => None,
    };
    let explained = |joint: &Articulation| -> f64 {
        paths.iter().filter_map(|path| Some(inliers(joint, path, config)? * path.len() as f64)).sum()
    };
    let (winner, _) = own
        .iter()
        .enumerate()
        .filter(|(_, j)| most.is_none_or(|kind| j.joint.kind == kind))
        .map(|(i, j)| (i, explained(&j.joint)))
        .reduce(|best, next| if next.1 > best.1 { next } else { best })?;
    let all: Vec<(Articulation, f64)> = own.iter().map(|j| (j.joint, 1.0)).collect();
    let joint = aggregate::consensus(&own.get(winner)?.joint, &all, &config.scene);
    let origin = match joint.kind {
        JointKind::Revolute => centroid(&paths.concat()).map_or(joint.origin, |c| joint.line().project(&c)),
        JointKind::Prismatic => joint.origin,
    };
    Some((winner, Articulation { origin, ..joint }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::articulation::Action;
    use crate::hands::Sample;

    fn trajectory(points: impl Iterator<Item = Point>) -> Trajectory {
        let samples = points
            .enumerate()
            .map(|(i, p)| Sample { frame: i, time_secs: i as f64, observed: p, smoothed: p, accepted: true })
            .collect();
        Trajectory { side: None, samples, action: Action::Open, ends_seen: [true; 2] }
    }

    fn candidate(kind: JointKind, axis: Vector, origin: Point, source: AxisSource) -> AxisCandidate {
        AxisCandidate::new(Articulation { kind, axis, origin }, source, &config::AxisSources::default())
    }

    /// A hand on a door of 50 cm about the z axis.
    fn arc(i: i32) -> Point {
        let a = 0.04 * f64::from(i);
        Point::new(0.5 * a.cos(), 0.5 * a.sin(), 1.0)
    }

    #[test]
    fn a_door_turns_about_the_line_of_least_variance_if_words_say_so() {
        let door = trajectory((0..30).map(arc));
        let candidates = [
            candidate(JointKind::Revolute, Vector::z(), Point::new(0.3, 0.1, 0.0), AxisSource::Line),
            candidate(JointKind::Revolute, Vector::z(), Point::new(0.0, 0.0, 0.4), AxisSource::Line),
            candidate(JointKind::Prismatic, Vector::y(), Point::origin(), AxisSource::Manhattan),
        ];
        let config = config::Inference::default();
        let infer = |candidates: &[AxisCandidate], told| infer(&door, candidates, told, None, &config, 0);
        let found = infer(&candidates, Some(JointKind::Revolute));
        let joint = found.found().unwrap();
        assert!(joint.joint.kind == JointKind::Revolute && joint.contact_pivot.coords.xy().norm() < 1e-9);
        assert!((joint.contact_pivot.z - 1.0).abs() < 1e-9 && joint.joint.axis.z > 0.99);
        // All of the hand is on the torus; how likely that makes the joint nobody computed.
        assert_eq!((joint.inliers, joint.type_probability, joint.joint_probability), (1.0, None, None));
        let slide = infer(&candidates, Some(JointKind::Prismatic));
        assert_eq!(slide.found().unwrap().joint.kind, JointKind::Prismatic);
        assert_eq!(infer(&candidates, None).found().unwrap().joint.kind, JointKind::Revolute);
        assert!(infer(&candidates[2..], Some(JointKind::Revolute)).reason().unwrap().contains("line"));
    }

    #[test]
    fn a_slide_runs_as_most_of_the_hand_does_and_needs_some_of_it_on_a_line() {
        let room = [Vector::x(), Vector::y(), Vector::z()]
            .map(|axis| candidate(JointKind::Prismatic, axis, Point::origin(), AxisSource::Manhattan));
        let config = config::Inference::default();
        let infer = |hand: &Trajectory| infer(hand, &room, Some(JointKind::Prismatic), None, &config, 0);
        // Pulled along y by 29 cm; then the hand goes away upwards, further than it pulled.
        let pulled = (0..30).map(|i| Point::new(0.0, 0.01 * f64::from(i), 0.8));
        let left = (1..12).map(|i| Point::new(0.0, 0.3, 0.8 + 0.1 * f64::from(i)));
        let found = infer(&trajectory(pulled.chain(left)));
        assert_eq!(found.found().unwrap().joint.axis.y.abs(), 1.0);
        // Everywhere: a helix of 20 cm.
        let lost = trajectory((0..40).map(|i| {
            let a = 0.7 * f64::from(i);
            Point::new(0.2 * a.cos(), 0.2 * a.sin(), 0.02 * f64::from(i))
        }));
        assert!(infer(&lost).reason().unwrap().contains("% are needed"), "{:?}", infer(&lost));
    }

    #[test]
    fn a_models_summary_comes_before_its_frames_and_these_before_the_name() {
        use JointKind::{Prismatic, Revolute};
        let words = |revolute, prismatic, summary| Words { revolute, prismatic, summary, ..Words::default() };
        let named = |kind| Reading { moves_joint: Some(true), action: None, furniture: None, kind, generic: false };
        assert_eq!(told(Some(&words(9, 1, Some(Prismatic))), &named(Some(Revolute))), Some(Prismatic));
        assert_eq!(told(Some(&words(1, 2, None)), &named(Some(Revolute))), Some(Prismatic));
        assert_eq!(told(Some(&words(2, 2, None)), &named(Some(Revolute))), Some(Revolute));
        assert_eq!((told(None, &named(Some(Prismatic))), told(None, &named(None))), (Some(Prismatic), None));
    }

    #[test]
    fn clips_are_one_part_where_their_voxels_overlap() {
        let row = |from: i32, to: i32| -> Vec<[i32; 3]> { (from..to).map(|x| [x, 0, 0]).collect() };
        // Two voxels of 18 shared; none; and one that was not localised.
        let rows = [row(0, 10), row(20, 30), row(8, 18), row(0, 0), row(0, 0)];
        let regions: Vec<&[[i32; 3]]> = rows.iter().map(Vec::as_slice).collect();
        let config = config::Inference { merge_voxel_iou: 0.1, ..Default::default() };
        assert_eq!(same_voxels(&regions, &config), [vec![0, 2], vec![1], vec![3], vec![4]]);
        let config = config::Inference { merge_voxel_iou: 0.2, ..Default::default() };
        assert_eq!(same_voxels(&regions, &config).len(), 5);
        assert!((iou(&rows[0], &rows[2]) - 2.0 / 18.0).abs() < 1e-12);
    }

    #[test]
    fn the_answer_that_explains_all_hands_speaks_for_a_part() {
        let config = config::Inference::default();
        let turn = |x: f64| {
            let line = [candidate(JointKind::Revolute, Vector::z(), Point::new(x, 0.0, 0.0), AxisSource::Line)];
            let hand = trajectory((0..30).map(arc));
            infer(&hand, &line, Some(JointKind::Revolute), None, &config, 0).found().unwrap().clone()
        };
        let pulled = {
            let room = [candidate(JointKind::Prismatic, Vector::y(), Point::origin(), AxisSource::Manhattan)];
            let hand = trajectory((0..6).map(arc));
            infer(&hand, &room, Some(JointKind::Prismatic), None, &config, 0).found().unwrap().clone()
        };
        // Three answers, one of another type and one 25 cm off; and a hand that has none, held 40 cm higher.
        let (off, right) = (turn(-0.25), turn(0.0));
        let higher: Vec<Point> = (0..30).map(|i| arc(i) + Vector::new(0.0, 0.0, 0.4)).collect();
        let paths: [Vec<Point>; 4] =
            [(0..30).map(arc).collect(), (0..30).map(arc).collect(), (0..6).map(arc).collect(), higher];
        let (winner, joint) = together(&[&off, &right, &pulled], &paths, &config).unwrap();
        assert_eq!((winner, joint.kind), (1, JointKind::Revolute));
        assert!(joint.origin.coords.xy().norm() < 1e-9, "{joint:?}");
        // The origin is level with the centroid of all hands: 30 of 96 samples are 40 cm higher.
        assert!((joint.origin.z - (1.0 + 0.4 * 30.0 / 96.0)).abs() < 1e-9, "{joint:?}");
        assert!(together(&[], &paths, &config).is_none());
    }
}
