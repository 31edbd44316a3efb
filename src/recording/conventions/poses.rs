//! Camera poses against depth.

use nalgebra::Matrix3;
use rayon::prelude::*;

use super::agreement::{Candidate, Pair, mean, nats, pairs};
use super::looks::FrameLook;
use super::reading::{axes, axes_words, is_opengl, with_axes};
use super::{Finding, Fix, LIKELY_NATS, Reading, Subject, lens};
use crate::math::{Pose, stats};

/// What positions could have to be multiplied by: units (millimetres, centimetres, inches, feet), and a ladder between.
const SCALES: [f64; 26] = [
    0.001, 0.01, 0.0254, 0.05, 0.1, 0.15, 0.2, 0.25, 0.3048, 0.4, 0.5, 0.6, 0.72, 0.85, 1.18, 1.4, 1.7, 2.0, 2.5, 3.28,
    5.0, 7.0, 10.0, 39.37, 100.0, 1000.0,
];
/// Factors between units that people use, and those that are left when one is halved or counted in fives.
const UNITS: [f64; 14] = [0.001, 0.01, 0.0254, 0.1, 0.2, 0.3048, 0.5, 2.0, 3.2808, 5.0, 10.0, 39.37, 100.0, 1000.0];
/// Scales that are told. Within, it is the depth that is off as estimated depth is, which is corrected later.
const RIGHT_SCALE: std::ops::Range<f64> = 0.67..1.5;
/// Frames by which poses could be late or early. Two do no harm.
const LAGS: [i64; 12] = [-15, -12, -9, -7, -5, -3, 3, 5, 7, 9, 12, 15];
/// Log of the number of readings (7) times axes (48): what the best of so many gains by chance.
const CHANCE_NATS: f64 = 5.8;
/// The same of scales and of lags, of which neighbours say the same.
const LADDER_NATS: f64 = 1.0;
/// A reading is another one only if it explains this many times as many places.
const CLEARLY: f64 = 1.2;
/// Poses in the right unit explain this many times as many places as half of all readings.
const WELL: f64 = 2.0;
/// Looks and pairs that are needed to judge.
const LEAST: usize = 6;
/// Where the looks are turned against each other by less, nothing is told, radians: 2 degrees.
const LEAST_TURN: f64 = 0.035;

/// The verdict.
pub(super) struct Judged {
    /// What was found.
    pub findings: Vec<Finding>,
    /// The poses as they are most likely meant, +Z where it is declared.
    pub poses: Vec<Pose>,
    /// Whether they differ from the declared ones, or are not seen rightly, so that what is in their world may not fit them any
    /// more.
    pub is_turned: bool,
    /// Whether the camera's intrinsics are others, so that no direction in the images is right.
    pub is_lens: bool,
}

/// One reading with how well it explains depth.
struct Rated<'a> {
    reading: Reading,
    candidate: Candidate<'a>,
    shares: Vec<f64>,
    mean: f64,
}

/// All that is compared.
struct Board<'a> {
    looks: &'a [FrameLook],
    pairs: Vec<Pair>,
}

impl Board<'_> {
    fn rate<'c>(&self, reading: Reading, candidate: Candidate<'c>) -> Rated<'c> {
        let shares = candidate.shares(self.looks, &self.pairs);
        Rated { reading, mean: mean(&shares), shares, candidate }
    }

    fn gain(&self, better: &Rated, worse: &Rated) -> f64 {
        nats(&better.shares, &worse.shares, &self.pairs, self.looks.len())
    }
}

/// Compares all readings.
pub(super) fn judge(subject: &Subject, looks: &[FrameLook]) -> Judged {
    let as_is = Judged { findings: Vec::new(), poses: subject.poses.clone(), is_turned: false, is_lens: false };
    let board = Board { looks, pairs: pairs(subject, looks) };
    if looks.len() < LEAST || board.pairs.len() < LEAST {
        return as_is;
    }
    let plain = Candidate { poses: &subject.poses, axes: Matrix3::identity(), scale: 1.0, lag: 0 };
    let declared = board.rate(Reading::Declared, plain);
    let at_rest = at_scale(&board, subject, 1.0);
    let others = stats::median(&at_rest.iter().map(|r| r.mean).collect::<Vec<_>>()).unwrap_or(0.0);
    let best = turned(&board, subject, &declared, at_rest, others);
    let best = scaled(&board, best);
    let best = late(&board, best);
    // A wrong lens may look like wrong positions, and is told where it explains more than any of them.
    if let Some(finding) = lens::judge(subject, looks, &board.pairs, &declared.shares, &best.shares) {
        return Judged { findings: vec![finding], is_turned: true, is_lens: true, ..as_is };
    }
    let mut findings = Vec::new();
    findings.extend(told_turn(&board, &declared, &best));
    findings.extend(told_scale(&board, subject, &best));
    findings.extend(told_lag(&board, subject, &best));
    if findings.is_empty() {
        findings.extend(nothing_fits(&board, &declared, others));
        return Judged { findings, ..as_is };
    }
    let c = best.candidate;
    let poses = c.poses.iter().map(|p| with_axes(p, &c.axes)).collect();
    let is_turned = best.reading != Reading::Declared || c.axes != Matrix3::identity() || c.scale != 1.0 || c.lag != 0;
    Judged { findings, poses, is_turned, is_lens: false }
}

/// All readings with all axes at one scale; the declared one is the first.
fn at_scale<'a>(board: &Board, subject: &'a Subject, scale: f64) -> Vec<Rated<'a>> {
    let declared = std::iter::once((Reading::Declared, subject.poses.as_slice()));
    let all: Vec<(Reading, &[Pose])> =
        declared.chain(subject.readings.iter().map(|(kind, poses)| (*kind, poses.as_slice()))).collect();
    let ways: Vec<(Reading, Candidate)> = all
        .into_iter()
        .flat_map(|(kind, poses)| axes().into_iter().map(move |axes| (kind, Candidate { poses, axes, scale, lag: 0 })))
        .collect();
    ways.into_par_iter().map(|(kind, candidate)| board.rate(kind, candidate)).collect()
}

/// The best of some: of those that are nearly as good the first, as the simplest ones come first.
fn best_of<'a>(board: &Board, all: Vec<Rated<'a>>) -> Option<Rated<'a>> {
    let top = all.iter().enumerate().max_by(|a, b| a.1.mean.total_cmp(&b.1.mean).then(b.0.cmp(&a.0)))?.0;
    let first = {
        let top = all.get(top)?;
        all.iter().position(|r| board.gain(top, r) < 0.5 && r.mean > 0.98 * top.mean).unwrap_or(0)
    };
    all.into_iter().nth(first)
}

/// The best reading and axes. Where the unit is so wrong that none fits, rotations alone are compared, then units.
/// `others`: the median share of all readings.
fn turned<'a>(
    board: &Board,
    subject: &'a Subject,
    declared: &Rated<'a>,
    at_one: Vec<Rated<'a>>,
    others: f64,
) -> Rated<'a> {
    let again = |r: &Rated<'a>| board.rate(r.reading, r.candidate);
    let clearly = |better: &Rated, worse: &Rated| {
        better.mean > CLEARLY * worse.mean && board.gain(better, worse) > CHANCE_NATS + LIKELY_NATS
    };
    let Some(best) = best_of(board, at_one) else { return again(declared) };
    // A wrong unit alone must not look like wrong axes.
    let rival = best_scale(board, again(declared));
    let best = if clearly(&best, declared) && clearly(&best, &rival) { best } else { again(declared) };
    if best.mean > WELL * others {
        return best;
    }
    let Some(still) = best_of(board, at_scale(board, subject, 0.0)) else { return best };
    if still.mean <= best.mean {
        return best;
    }
    // A mirror image of all three axes turns the same way: both are tried at each scale.
    let (kind, base) = (still.reading, still.candidate);
    let mut rated = Vec::new();
    for axes in [base.axes, -base.axes] {
        rated.extend(SCALES.iter().map(|scale| board.rate(kind, Candidate { axes, scale: *scale, ..base })));
    }
    match best_of(board, rated) {
        // Wrong units alone are told as such.
        Some(moved) if is_plain(&moved) => again(declared),
        Some(moved) if clearly(&moved, &best) && clearly(&moved, &rival) => moved,
        _ => best,
    }
}

fn is_plain(r: &Rated) -> bool {
    r.reading == Reading::Declared && r.candidate.axes == Matrix3::identity()
}

/// The same at the scale under which it explains most.
fn best_scale<'a>(board: &Board, of: Rated<'a>) -> Rated<'a> {
    let at = |scale: f64| board.rate(of.reading, Candidate { scale, ..of.candidate });
    let mut best = at(of.candidate.scale);
    for scale in SCALES {
        let other = at(scale);
        if other.mean > best.mean {
            best = other;
        }
    }
    // Between the rungs of the ladder.
    let rung = best.candidate.scale;
    for factor in [0.88, 0.94, 1.06, 1.12] {
        let other = at(rung * factor);
        if other.mean > best.mean {
            best = other;
        }
    }
    best
}

/// With the scale of positions that fits, where theirs does not.
fn scaled<'a>(board: &Board, of: Rated<'a>) -> Rated<'a> {
    let best = best_scale(board, board.rate(of.reading, of.candidate));
    let is_off = !RIGHT_SCALE.contains(&best.candidate.scale);
    let plain = board.rate(of.reading, Candidate { scale: 1.0, ..of.candidate });
    if !is_off || board.gain(&best, &plain) <= LADDER_NATS + LIKELY_NATS {
        return of;
    }
    // Depth tells a scale to a tenth or two; people mix up units by whole factors.
    let near = best.candidate.scale;
    let by_distance = |a: &f64, b: &f64| (a / near).ln().abs().total_cmp(&(b / near).ln().abs());
    let Some(unit) = UNITS.into_iter().min_by(by_distance).filter(|unit| (unit / near).ln().abs() < 0.2) else {
        return best;
    };
    let snapped = board.rate(of.reading, Candidate { scale: unit, ..of.candidate });
    if board.gain(&best, &snapped) < LIKELY_NATS { snapped } else { best }
}

/// With the lag that fits, where there is one.
fn late<'a>(board: &Board, of: Rated<'a>) -> Rated<'a> {
    let tried = LAGS.iter().map(|lag| board.rate(of.reading, Candidate { lag: *lag, ..of.candidate }));
    let Some(rough) = tried.max_by(|a, b| a.mean.total_cmp(&b.mean)).filter(|r| r.mean > of.mean) else { return of };
    let near = rough.candidate.lag;
    let fine = (near - 2..=near + 2).map(|lag| board.rate(of.reading, Candidate { lag, ..of.candidate }));
    match fine.max_by(|a, b| a.mean.total_cmp(&b.mean)) {
        Some(best) if best.candidate.lag.abs() > 2 && board.gain(&best, &of) > LADDER_NATS + LIKELY_NATS => best,
        _ => of,
    }
}

/// Two shares in words.
fn against(board: &Board, best: &Rated, worse: &Rated, how: &str) -> String {
    format!(
        "depth of one frame, moved by the poses, meets another frame's at {:.0} % of the places as declared, at {:.0} % {how} \
         ({} frames, {} pairs)",
        100.0 * worse.mean,
        100.0 * best.mean,
        board.looks.len(),
        board.pairs.len()
    )
}

fn told_turn(board: &Board, declared: &Rated, best: &Rated) -> Option<Finding> {
    if is_plain(best) {
        return None;
    }
    let axes = best.candidate.axes;
    let is_read = best.reading != Reading::Declared;
    let is_named = axes != Matrix3::identity();
    let what: Vec<String> = [is_read.then(|| best.reading.words().to_owned()), is_named.then(|| axes_words(&axes))]
        .into_iter()
        .flatten()
        .collect();
    let mut remedy: Vec<String> = Vec::new();
    if is_read {
        remedy.push(best.reading.edit().to_owned());
    }
    if is_opengl(&axes) {
        remedy.push("turn the camera's y and z round: negate columns 2 and 3 of every rotation".to_owned());
    } else if axes.determinant() < 0.0 {
        remedy.push(
            "mirror the axes back: negate that axis in the camera and one axis of the world, in hands too".to_owned(),
        );
    } else if is_named {
        remedy.push("order and negate the columns of every rotation so that they are right, down, forward".to_owned());
    }
    Some(Finding {
        what: what.join("; "),
        evidence: against(board, best, declared, "so read"),
        remedy: remedy.join("; "),
        nats: board.gain(best, declared) - CHANCE_NATS,
        ruinous: true,
        // What lies in a mirrored world is mirrored, too, or not: nobody can tell.
        fix: (axes.determinant() > 0.0).then_some(Fix::Poses { reading: best.reading, axes }),
    })
}

fn told_scale(board: &Board, subject: &Subject, best: &Rated) -> Option<Finding> {
    let scale = best.candidate.scale;
    if scale == 1.0 {
        return None;
    }
    let plain = board.rate(best.reading, Candidate { scale: 1.0, ..best.candidate });
    let depth: Vec<f64> = board.looks.iter().filter_map(FrameLook::median_depth).collect();
    let depth = stats::median(&depth).unwrap_or(0.0);
    // Hands are in the poses' world: where they lie near the surfaces that are seen beside them the unit of both is right.
    let ratio = super::hands::depth_ratio(subject, board.looks);
    let is_depth = match ratio {
        Some(ratio) => (ratio / scale).ln().abs() < 0.25,
        // A kitchen is seen from decimetres to a few metres.
        None => !(0.25..8.0).contains(&depth),
    };
    let what = if is_depth {
        format!("depth is {scale:.3} times as large as the camera positions say")
    } else {
        format!("the camera positions are {:.3} of the scale of the depth", 1.0 / scale)
    };
    let hands =
        ratio.map_or(String::new(), |r| format!("; what is seen at the hands is {r:.2} times as far as they are"));
    let remedy = if is_depth {
        format!("divide depth by {scale:.4}; its files are in millimetres (16 bits)")
    } else {
        format!("multiply the positions by {scale:.4}")
    };
    Some(Finding {
        what,
        evidence: format!(
            "{}; the median depth is {depth:.2} m{hands}",
            against(board, best, &plain, &format!("with positions multiplied by {scale:.3}"))
        ),
        remedy,
        nats: board.gain(best, &plain) - LADDER_NATS,
        ruinous: true,
        fix: (!is_depth).then(|| Fix::Scale { factor: scale, is_unit: UNITS.contains(&scale) }),
    })
}

fn told_lag(board: &Board, subject: &Subject, best: &Rated) -> Option<Finding> {
    let lag = best.candidate.lag;
    if lag == 0 {
        return None;
    }
    let plain = board.rate(best.reading, Candidate { lag: 0, ..best.candidate });
    let secs = lag as f64 * super::hands::period(&subject.secs);
    if secs.abs() < super::hands::HARMLESS_SECS {
        return None;
    }
    let word = if lag > 0 { "late" } else { "early" };
    Some(Finding {
        what: format!("the poses come {:.2} s ({} frames) too {word} for the depth", secs.abs(), lag.abs()),
        evidence: against(board, best, &plain, "with poses shifted"),
        remedy: format!("subtract {secs:.2} s from the times of the poses"),
        nats: board.gain(best, &plain) - LADDER_NATS,
        ruinous: true,
        fix: Some(Fix::PoseLag(lag)),
    })
}

/// Poses that explain depth no better than any wrong reading does.
fn nothing_fits(board: &Board, declared: &Rated, others: f64) -> Option<Finding> {
    /// Right poses explain twice as many places as half of all readings, and more.
    const CHANCE: f64 = 1.25;
    let angles: Vec<f64> = board.pairs.iter().map(|p| p.angle).collect();
    let moves = stats::median(&angles).is_some_and(|a| a > LEAST_TURN);
    (moves && declared.mean < CHANCE * others).then(|| Finding {
        what: "poses and depth do not belong together".to_owned(),
        evidence: format!(
            "depth of one frame, moved by the poses, meets another frame's at {:.0} % of the places, under wrong readings of the \
             poses at {:.0} % (median of {} frames, {} pairs); no direction, axes, quaternion order, unit or lag sets it right",
            100.0 * declared.mean,
            100.0 * others,
            board.looks.len(),
            board.pairs.len()
        ),
        remedy: "check that poses and depth are of one video and in one order, that angles are radians, and the intrinsics"
            .to_owned(),
        nats: LIKELY_NATS,
        ruinous: true,
        fix: None,
    })
}
