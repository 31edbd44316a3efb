//! Whether a bare path is a line or a circle, how noisy it is, and how far it goes.

use nalgebra::Vector2;

use crate::articulation::{Articulation, JointKind};
use crate::config;
use crate::math::{Point, Vector, centroid, principal_directions, stats};

/// What lies beside a path's model at each point, along the two directions that the model leaves free of motion, metres.
type Beside = Vec<Vector2<f64>>;

/// A path along its principal direction and the two others, about its mean, metres.
struct Straightened {
    along: Vec<f64>,
    beside: Beside,
}

impl Straightened {
    fn of(points: &[Point]) -> Option<Self> {
        let (axes, _) = principal_directions(points)?;
        let mean = centroid(points)?;
        let [u, v, w] = [0, 1, 2].map(|k| axes.column(k).into_owned());
        let along = points.iter().map(|p| (p - mean).dot(&u)).collect();
        let beside = points.iter().map(|p| Vector2::new((p - mean).dot(&v), (p - mean).dot(&w))).collect();
        Some(Self { along, beside })
    }

    /// What is left beside the best shallow arc that bends at least as much as a circle of `radius`, metres; `None` where
    /// the points are not spread along a direction.
    fn beside_arc(&self, radius: f64) -> Option<Beside> {
        let n = self.along.len() as f64;
        let power = |k: i32| self.along.iter().map(|u| u.powi(k)).sum::<f64>();
        let squares = power(2);
        if squares <= 0.0 {
            return None;
        }
        let (level, tilt) = (squares / n, power(3) / squares);
        // What a bend adds to a line, and what of it the points show.
        let bend: Vec<f64> = self.along.iter().map(|u| u * u - level - tilt * u).collect();
        let weight: f64 = bend.iter().map(|b| b * b).sum();
        if weight <= 0.0 {
            return None;
        }
        let seen = bend.iter().zip(&self.beside).fold(Vector2::<f64>::zeros(), |sum, (b, v)| sum + v * *b) / weight;
        let least = 0.5 / radius;
        let size = seen.norm();
        let taken = if size >= least {
            seen
        } else if size > 0.0 {
            seen * (least / size)
        } else {
            Vector2::new(least, 0.0)
        };
        Some(bend.iter().zip(&self.beside).map(|(b, v)| v - taken * *b).collect())
    }
}

/// What lies beside a hinge's circle through the points, metres.
fn beside_circle(points: &[Point], hinge: &Articulation) -> Beside {
    let line = hinge.line();
    let places: Vec<Vector2<f64>> = points.iter().map(|p| Vector2::new(line.distance(p), line.coordinate(p))).collect();
    let mean = places.iter().fold(Vector2::<f64>::zeros(), |sum, p| sum + p) / places.len().max(1) as f64;
    places.iter().map(|p| p - mean).collect()
}

fn mean_square(beside: &[Vector2<f64>]) -> f64 {
    beside.iter().map(|v| v.norm_squared()).sum::<f64>() / beside.len().max(1) as f64
}

/// How many independent samples a path is worth whose errors are these: neighbours that err alike are one.
fn effective_samples(beside: &[Vector2<f64>], rules: &config::Bare) -> f64 {
    let n = beside.len() as f64;
    let together: f64 = beside.iter().zip(beside.iter().skip(1)).map(|(a, b)| a.dot(b)).sum();
    let alone = n * (mean_square(beside) + rules.play_m * rules.play_m);
    let correlation = (together / alone).clamp(0.0, 0.99);
    (n * (1.0 - correlation) / (1.0 + correlation)).min(n).clamp(1.0, rules.effective_samples)
}

/// How much more likely a hinge makes a path than a slide does, nats; negative where the slide does better. Both have their
/// best place; the hinge is no wider than `max_radius_m` (else every slide is one), and pays for its two further numbers as
/// the Bayesian information criterion has it. The noise is that of the better of the two, never below the play of a
/// mechanism. `None` for points without a direction.
pub(super) fn hinge_over_slide(
    points: &[Point],
    hinge: Option<&Articulation>,
    config: &config::Inference,
) -> Option<f64> {
    let (max_radius_m, rules) = (config.max_radius_m, &config.bare);
    let path = Straightened::of(points)?;
    let mut round = path.beside_arc(max_radius_m)?;
    if let Some(hinge) = hinge {
        let distances: Vec<f64> = points.iter().map(|p| hinge.line().distance(p)).collect();
        let circle = beside_circle(points, hinge);
        if stats::mean(&distances).is_some_and(|r| r <= max_radius_m) && mean_square(&circle) <= mean_square(&round) {
            round = circle;
        }
    }
    let (straight_m2, round_m2) = (mean_square(&path.beside), mean_square(&round));
    let samples = effective_samples(if straight_m2 < round_m2 { &path.beside } else { &round }, rules);
    let play = rules.play_m * rules.play_m;
    Some(samples * ((straight_m2 + play) / (round_m2 + play)).ln() - samples.ln())
}

/// Whether a path gets anywhere: along its longest direction neighbours are nearer to each other than any two of its points
/// are. The mean squared step of a still hand's noise is twice its variance, that of a motion is far below it.
pub(super) fn progresses(points: &[Point]) -> bool {
    let Some(path) = Straightened::of(points) else { return false };
    let n = path.along.len() as f64;
    let variance = path.along.iter().map(|u| u * u).sum::<f64>() / n;
    let steps: Vec<f64> = path.along.windows(2).map(|w| (w[1] - w[0]).powi(2)).collect();
    stats::mean(&steps).is_some_and(|step| step < variance)
}

/// Whether a path goes somewhere rather than about: three times as far along a line as beside it, as variances go, or, where it
/// is round, ten times as far as beside its circle (`round_m2`, square metres), which fits any cloud better than a line does. A
/// still hand that drifts as its camera does stays below both.
pub(super) fn stands_out(points: &[Point], round_m2: Option<f64>, rules: &config::Bare) -> bool {
    let Some(path) = Straightened::of(points) else { return false };
    let along = path.along.iter().map(|u| u * u).sum::<f64>() / path.along.len() as f64;
    along > rules.along_line * mean_square(&path.beside)
        || round_m2.is_some_and(|beside| along > rules.along_circle * beside)
}

/// The opening that a path goes through, rad or m. `beside_m` is what lies beside the joint's path (root mean square).
///
/// All of the path counts. Of a hundred samples one is given up at an end where it stands apart from the others, or where the
/// samples jump about by more than the motion goes from one to the next. Noise makes the extreme of many samples go too far:
/// each end is the mean of the samples that are within two of its standard deviations.
pub(super) fn range(joint: &Articulation, openings: &[f64], lever_m: f64, beside_m: f64, rules: &config::Bare) -> f64 {
    let lever = if joint.kind == JointKind::Revolute { lever_m.max(rules.play_m) } else { 1.0 };
    let noise = own_noise(openings).min(beside_m / std::f64::consts::SQRT_2 / lever);
    let mut sorted = openings.to_vec();
    sorted.sort_by(f64::total_cmp);
    let ends = (0, sorted.len().saturating_sub(1));
    let wrong = sorted.len() / 100;
    let steps: Vec<f64> = openings.windows(2).map(|w| (w[1] - w[0]).abs()).filter(|s| *s > 0.0).collect();
    let usual = stats::median(&steps).unwrap_or(0.0);
    let at = |i: usize| sorted.get(i).copied().unwrap_or(0.0);
    // The last of a smooth motion are about as far apart as all the others.
    let given_up = |gap: f64| if 1.5 * noise > usual || gap > (wrong as f64 + 3.0) * usual { wrong } else { 0 };
    let from = given_up(at(wrong) - at(ends.0));
    let to = ends.1 - given_up(at(ends.1) - at(ends.1 - wrong));
    let kept = sorted.get(from..=to).unwrap_or_default();
    let (low, high) = (at(from), at(to));
    let mean = |inside: &dyn Fn(f64) -> bool| {
        stats::mean(&kept.iter().copied().filter(|x| inside(*x)).collect::<Vec<_>>()).unwrap_or(0.0)
    };
    (mean(&|x| x >= high - 2.0 * noise) - mean(&|x| x <= low + 2.0 * noise)).max(0.0)
}

/// Standard deviation of the noise of a series by its second differences: a motion has next to none of them.
fn own_noise(values: &[f64]) -> f64 {
    /// Arithmetic: median of the absolute value of a normal variable. Its second difference varies by 6.
    const MEDIAN: f64 = 0.6745;
    let bends: Vec<f64> = values.windows(3).map(|w| (w[0] - 2.0 * w[1] + w[2]).abs()).collect();
    stats::median(&bends).unwrap_or(0.0) / MEDIAN / 6f64.sqrt()
}

/// The points without single jumps: one that is several steps away from the median of its neighbourhood is put there.
/// All others stay as they are: the ends of few samples are the ends of the motion.
pub(crate) fn robust(points: &[Point], rules: &config::Bare) -> Vec<Point> {
    /// Arithmetic: of two neighbours on each side the median is not moved by one.
    const REACH: usize = 2;
    let steps: Vec<f64> = points.windows(2).map(|w| (w[1] - w[0]).norm()).collect();
    let usual = stats::median(&steps).unwrap_or(0.0);
    let around = |i: usize, reach: usize, end: usize| i.saturating_sub(reach)..(i + reach + 1).min(end);
    (0..points.len())
        .map(|i| {
            let window = &points[around(i, REACH, points.len())];
            let coordinate =
                |k: usize| stats::median(&window.iter().map(|p| p[k]).collect::<Vec<_>>()).unwrap_or(points[i][k]);
            let middle = Point::new(coordinate(0), coordinate(1), coordinate(2));
            let near = steps.get(i.saturating_sub(REACH + 1)..(i + REACH + 1).min(steps.len())).unwrap_or_default();
            let step = stats::median(near).unwrap_or(0.0).max(usual);
            if (points[i] - middle).norm() > rules.jump_steps * step { middle } else { points[i] }
        })
        .collect()
}

/// The direction in which a path's orientations turn is another than that in which the path itself bends, by more than
/// markers are wrong: about 30 degrees.
pub(super) fn contradicts(turn: &Vector, normal: &Vector, rules: &config::Bare) -> bool {
    crate::math::unsigned_angle(turn, normal) > rules.contradicts_rad
}
