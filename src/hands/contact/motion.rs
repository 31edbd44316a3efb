//! What the way of a hand says about contact: it rests where it takes hold and where it lets go, and what it holds moves along
//! a line or an arc, which its reaching and withdrawing do not continue.

use nalgebra::Point2;

use crate::config;
use crate::math::circle;
use crate::math::line::Line;
use crate::math::plane::Plane;
use crate::math::{Point, centroid, stats};

/// Standard deviation of a hand's position from sample to sample, metres, over all tracks; each as times and places.
pub(crate) fn tremble_m<'a>(tracks: impl Iterator<Item = (&'a [f64], &'a [Point])>, config: &config::Hands) -> f64 {
    let mut steps = Vec::new();
    for (times, places) in tracks {
        for i in 1..places.len().saturating_sub(1) {
            if times[i + 1] - times[i - 1] < config.motion.neighbours_secs {
                steps.push((places[i].coords - 0.5 * (places[i - 1].coords + places[i + 1].coords)).norm());
            }
        }
    }
    // Arithmetic: a sample against the mean of its neighbours varies by 3/2; the median of a length in space is 1.54 deviations.
    stats::median(&steps).unwrap_or(0.0) / 1.5f64.sqrt() / 1.54
}

/// Log odds of each sample for being the first of a hold (rests after it) and the last (rested before it).
pub(crate) fn rests(times: &[f64], places: &[Point], tremble_m: f64, config: &config::Hands) -> Vec<[f64; 2]> {
    let rules = &config.motion;
    // The rest itself is short, and a hand gives way a little.
    let std = rules.rest_widens * tremble_m + rules.gives_way_m;
    let rest_secs = rules.rest_secs + rules.rest_slack_secs;
    let nats = |i: usize, near: &dyn Fn(f64) -> bool| {
        let others: Vec<Point> =
            times.iter().zip(places).filter(|(t, _)| near(**t - times[i])).map(|(_, p)| *p).collect();
        let middle = middle(&others)?;
        let moved = ((middle - places[i]).norm() - std).max(0.0);
        Some(log_odds(moved, std, rules.reached_m, config))
    };
    (0..times.len())
        .map(|i| {
            let after = nats(i, &|dt| dt > 0.0 && dt <= rest_secs);
            let before = nats(i, &|dt| (-rest_secs..0.0).contains(&dt));
            [after.unwrap_or(0.0), before.unwrap_or(0.0)]
        })
        .collect()
}

/// Log odds of contact for each sample by its distance to the line or arc that the samples `first..=last` show; `None` where
/// they show none.
pub(crate) fn on_path(
    places: &[Point],
    [first, last]: [usize; 2],
    tremble_m: f64,
    config: &config::Hands,
) -> Option<Vec<f64>> {
    let rules = &config.motion;
    let count = last + 1 - first;
    if count < rules.least_samples {
        return None;
    }
    let (shape, typical) = shape(&places[first..=last], config)?;
    let std = (stats::NORMAL_PER_MEDIAN * typical).max(tremble_m + rules.gives_way_m);
    Some(places.iter().map(|p| log_odds(shape.distance(p), std, rules.beside_m, config)).collect())
}

/// The line or arc of a hold, and how far its samples are typically from it, metres.
fn shape(places: &[Point], config: &config::Hands) -> Option<(Shape, f64)> {
    let rules = &config.motion;
    // Ends may be part of reaching or withdrawing.
    let core = &places[places.len() / 6..places.len() - places.len() / 6];
    // An arc has one more freedom than a line, and has to be better by as much.
    let fits = [(Shape::line(core), 1.0), (Shape::arc(core, rules.radii_m), rules.arc_handicap)];
    fits.into_iter()
        .filter_map(|(shape, handicap)| {
            let shape = shape?;
            let typical = stats::median(&core.iter().map(|p| shape.distance(p)).collect::<Vec<_>>())?;
            Some((shape, typical, handicap * typical))
        })
        .min_by(|a, b| a.2.total_cmp(&b.2))
        .map(|(shape, typical, _)| (shape, typical))
}

/// What all samples of a hold say by how near they are to one line or arc. The width is what hands tremble, not what the samples
/// show: a hand that wanders would widen it.
pub(crate) fn path_nats(places: &[Point], tremble_m: f64, config: &config::Hands) -> f64 {
    let rules = &config.motion;
    if places.len() < rules.least_samples {
        return 0.0;
    }
    let Some((shape, _)) = shape(places, config) else { return 0.0 };
    let std = tremble_m + rules.wanders_m;
    let least = -config.contact.says_at_most_nats;
    places.iter().map(|p| log_odds(shape.distance(p), std, rules.beside_m, config).max(least)).sum()
}

/// Places with what is around them in time: the median over a third of a second.
pub(crate) fn calmed(times: &[f64], places: &[Point], config: &config::Hands) -> Vec<Point> {
    let half_secs = config.motion.calmed_half_secs;
    (0..places.len())
        .map(|i| {
            let from = times.partition_point(|t| *t < times[i] - half_secs);
            let to = times.partition_point(|t| *t <= times[i] + half_secs);
            middle(&places[from..to]).unwrap_or(places[i])
        })
        .collect()
}

/// For each sample the number of its stretch: between two stretches the hand would have been faster than hands are.
pub(crate) fn stretches(times: &[f64], places: &[Point], config: &config::Hands) -> Vec<usize> {
    let rules = &config.motion;
    let mut number = 0;
    (0..places.len())
        .map(|i| {
            if i > 0 {
                // Three samples on each side: a single one that is astray is no jump.
                let before = middle(&places[i.saturating_sub(3)..i]);
                let after = middle(&places[i..places.len().min(i + 3)]);
                let jump = before.zip(after).map_or(0.0, |(a, b)| (a - b).norm());
                let limit = rules.jump_m + rules.fastest_m_per_s * (times[i] - times[i - 1]);
                // Just between these two, not next to it.
                let here = (places[i] - places[i - 1]).norm() > limit;
                number += usize::from(here && jump > limit);
            }
            number
        })
        .collect()
}

/// A bell of samples that belong, with a share astray, against an exponential of those that do not.
fn log_odds(distance: f64, std: f64, free_m: f64, config: &config::Hands) -> f64 {
    let astray = config.contact.astray_share;
    let free = (-distance / free_m).exp() / free_m;
    let bell = 2.0 * (-0.5 * (distance / std).powi(2)).exp() / (std * std::f64::consts::TAU.sqrt());
    (((1.0 - astray) * bell + astray * free) / free).ln()
}

/// Coordinate-wise median.
fn middle(places: &[Point]) -> Option<Point> {
    let along = |k: usize| stats::median(&places.iter().map(|p| p[k]).collect::<Vec<_>>());
    Some(Point::new(along(0)?, along(1)?, along(2)?))
}

enum Shape {
    Line(Line),
    Arc { plane: Plane, axes: [crate::math::Vector; 2], origin: Point, circle: circle::Circle },
}

impl Shape {
    /// The line that most samples lie on.
    fn line(places: &[Point]) -> Option<Self> {
        trimmed(places, |kept| {
            let point = centroid(kept)?;
            let spread = kept.iter().fold(nalgebra::Matrix3::zeros(), |sum, p| {
                let d = p - point;
                sum + d * d.transpose()
            });
            let eigen = spread.symmetric_eigen();
            let direction = eigen.eigenvectors.column(eigen.eigenvalues.imax()).into_owned();
            Some(Self::Line(Line { point, direction }))
        })
    }

    /// The arc that most samples lie on.
    fn arc(places: &[Point], radii_m: [f64; 2]) -> Option<Self> {
        trimmed(places, |kept| {
            let plane = Plane::fit(kept)?;
            let origin = centroid(kept)?;
            // Geometry: an axis of the world that the normal does not lie along.
            let across = if plane.normal.x.abs() < 0.8 { crate::math::Vector::x() } else { crate::math::Vector::y() };
            let first = crate::math::unit(&plane.normal.cross(&across))?;
            let axes = [first, plane.normal.cross(&first)];
            let flat: Vec<Point2<f64>> = kept.iter().map(|p| on(&axes, &origin, p)).collect();
            let circle = circle::fit(&flat).filter(|c| (radii_m[0]..radii_m[1]).contains(&c.radius))?;
            Some(Self::Arc { plane, axes, origin, circle })
        })
    }

    fn distance(&self, p: &Point) -> f64 {
        match self {
            Self::Line(line) => line.distance(p),
            Self::Arc { plane, axes, origin, circle } => {
                let radial = (on(axes, origin, p) - circle.center).norm() - circle.radius;
                radial.hypot(plane.height(p))
            }
        }
    }
}

fn on(axes: &[crate::math::Vector; 2], origin: &Point, p: &Point) -> Point2<f64> {
    let d = p - origin;
    Point2::new(axes[0].dot(&d), axes[1].dot(&d))
}

/// Fits three times, each time without the worst fifth.
fn trimmed(places: &[Point], fit: impl Fn(&[Point]) -> Option<Shape>) -> Option<Shape> {
    let mut kept = places.to_vec();
    let mut shape = fit(&kept)?;
    for _ in 0..2 {
        let distances: Vec<f64> = places.iter().map(|p| shape.distance(p)).collect();
        let limit = stats::quantile(&distances, 0.8)?.max(1e-6);
        kept = places.iter().zip(&distances).filter(|(_, d)| **d <= limit).map(|(p, _)| *p).collect();
        shape = fit(&kept)?;
    }
    Some(shape)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Reaches for 0.7 s, rests for 0.2 s, moves along an arc of 70 cm for 1.5 s, rests, withdraws; with a tremble of 8 mm.
    fn way() -> (Vec<f64>, Vec<Point>) {
        let tremble = |i: usize, k: usize| 0.008 * (((i * 37 + k * 11) % 17) as f64 / 8.0 - 1.0);
        let on_arc = |a: f64| Point::new(0.7 * a.cos(), 0.7 * a.sin(), 1.0);
        let at = |i: usize| match i {
            0..8 => on_arc(0.0) + crate::math::Vector::new(0.05, 0.3, 0.25) * ((8 - i) as f64 / 8.0),
            8..11 => on_arc(0.0),
            11..29 => on_arc(1.2 * (i - 10) as f64 / 18.0),
            29..32 => on_arc(1.2),
            _ => on_arc(1.2) + crate::math::Vector::new(0.3, -0.1, -0.2) * ((i - 31) as f64 / 8.0),
        };
        let places = (0..40).map(|i| {
            let p = at(i);
            Point::new(p.x + tremble(i, 0), p.y + tremble(i, 1), p.z + tremble(i, 2))
        });
        ((0..40).map(|i| i as f64 / 12.0).collect(), places.collect())
    }

    #[test]
    fn the_samples_of_a_hold_lie_on_its_arc_and_reaching_does_not() {
        let (_, places) = way();
        let nats = on_path(&places, [6, 33], 0.005, &config::Hands::default()).unwrap();
        assert!(nats[9..31].iter().all(|n| *n > 0.0), "{nats:?}");
        assert!(nats[0..5].iter().chain(&nats[36..]).all(|n| *n < 0.0), "{nats:?}");
    }

    #[test]
    fn a_hand_rests_where_it_takes_hold_and_where_it_lets_go() {
        let (times, places) = way();
        let tremble = tremble_m([(times.as_slice(), places.as_slice())].into_iter(), &config::Hands::default());
        assert!((0.002..0.02).contains(&tremble), "{tremble}");
        let nats = rests(&times, &places, tremble, &config::Hands::default());
        assert!(nats[8][0] > 0.5 && nats[4][0] < 0.0, "{nats:?}");
        assert!(nats[31][1] > 0.5 && nats[35][1] < 0.0, "{nats:?}");
    }

    #[test]
    fn a_jump_parts_two_stretches_and_an_outlier_does_not() {
        let times: Vec<f64> = (0..12).map(|i| i as f64 / 12.0).collect();
        let mut places = vec![Point::origin(); 12];
        places[3].x = 2.0;
        assert_eq!(stretches(&times, &places, &config::Hands::default()), [0; 12]);
        places[6..].iter_mut().for_each(|p| p.y = 1.7);
        assert_eq!(stretches(&times, &places, &config::Hands::default()), [0, 0, 0, 0, 0, 0, 1, 1, 1, 1, 1, 1]);
    }
}
