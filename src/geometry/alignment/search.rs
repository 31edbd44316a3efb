//! Alignments worth a closer look: turns by the headings of upright surfaces, lifts by the heights of level ones, shifts by a
//! vote of all pairs of surface points that can be one.

use rayon::prelude::*;

use super::map::Surfel;
use super::turned;
use crate::config;
use crate::math::{Pose, Vector, sampling, stats};

/// Geometry: bins of headings, a degree each.
const HEADINGS: usize = 360;
/// Geometry: a surface is level from this cosine with the vertical on.
const LEVEL: f64 = 0.8;
/// Geometry: it is upright below this one.
const UPRIGHT: f64 = 0.35;
/// Numerics: no place is larger, metres.
const SPAN_M: f64 = 30.0;
/// Geometry: classes of normals, twelve headings, up and down.
const CLASSES: usize = 14;

/// Alignments of other surfaces with those of a scene, the likeliest first.
pub(super) fn candidates(scene: &[Surfel], other: &[Surfel], rules: &config::AlignmentSearch) -> Vec<Pose> {
    let lifts = lifts(scene, other, rules);
    let pairs: Vec<(f64, f64)> =
        turns(scene, other, rules).into_iter().flat_map(|turn| lifts.iter().map(move |lift| (turn, *lift))).collect();
    let targets = Targets::of(scene, rules.layer_m);
    let mut all: Vec<(f64, Pose)> =
        pairs.par_iter().flat_map_iter(|(turn, lift)| shifts(&targets, other, [*turn, *lift], rules)).collect();
    all.sort_by(|a, b| b.0.total_cmp(&a.0));
    all.truncate(rules.refined);
    all.into_iter().map(|(_, pose)| pose).collect()
}

/// Angles by which the other's headings fit the scene's, radians.
fn turns(scene: &[Surfel], other: &[Surfel], rules: &config::AlignmentSearch) -> Vec<f64> {
    let [ours, theirs] = [scene, other].map(|surfels| headings(surfels, rules.smoothed_deg));
    let at = |i: i64| i.rem_euclid(HEADINGS as i64) as usize;
    let fits: Vec<f64> = (0..HEADINGS as i64)
        .map(|turn| (0..HEADINGS as i64).map(|i| ours[at(i + turn)] * theirs[at(i)]).sum())
        .collect();
    peaks(&fits, rules.turns_apart_deg, true, (rules.turns, rules.worth))
        .into_iter()
        .map(|turn| (turn as f64).to_radians())
        .collect()
}

/// How much upright surface faces each degree; of large walls the root, so that they do not drown the rest.
fn headings(surfels: &[Surfel], reach: i64) -> Vec<f64> {
    let mut counts = vec![0.0f64; HEADINGS];
    for s in surfels.iter().filter(|s| s.normal.z.abs() < UPRIGHT) {
        let degrees = s.normal.y.atan2(s.normal.x).to_degrees().rem_euclid(HEADINGS as f64);
        counts[(degrees as usize).min(HEADINGS - 1)] += 1.0;
    }
    let at = |i: i64| counts[i.rem_euclid(HEADINGS as i64) as usize];
    (0..HEADINGS as i64).map(|i| (-reach..=reach).map(|d| at(i + d)).sum::<f64>().sqrt()).collect()
}

/// Heights by which the other's level surfaces fit the scene's, metres.
fn lifts(scene: &[Surfel], other: &[Surfel], rules: &config::AlignmentSearch) -> Vec<f64> {
    let [ours, theirs] = [scene, other].map(|surfels| levels(surfels, rules));
    let (Some(ours), Some(theirs)) = (ours, theirs) else {
        // Nothing level: the middles of all that is seen.
        let middle = |all: &[Surfel]| stats::median(&all.iter().map(|s| s.at.z).collect::<Vec<f64>>()).unwrap_or(0.0);
        return vec![middle(scene) - middle(other)];
    };
    let reach = theirs.bins.len() as i64 - 1;
    let fits: Vec<f64> = (-reach..ours.bins.len() as i64)
        .map(|lift| {
            let pairs = theirs.bins.iter().enumerate().filter_map(|(i, b)| {
                let a = ours.bins.get(usize::try_from(i as i64 + lift).ok()?)?;
                Some(a[0] * b[0] + a[1] * b[1])
            });
            pairs.sum()
        })
        .collect();
    peaks(&fits, rules.lifts_apart, false, (rules.lifts, rules.worth))
        .into_iter()
        .map(|i| ours.low - theirs.low + (i as i64 - reach) as f64 * rules.lift_m)
        .collect()
}

/// How much level surface there is at each height from `low` on: facing up, facing down; the root of it.
struct Levels {
    low: f64,
    bins: Vec<[f64; 2]>,
}

fn levels(surfels: &[Surfel], rules: &config::AlignmentSearch) -> Option<Levels> {
    let level: Vec<&Surfel> = surfels.iter().filter(|s| s.normal.z.abs() > LEVEL).collect();
    if level.len() < rules.least_level {
        return None;
    }
    let heights: Vec<f64> = level.iter().map(|s| s.at.z).collect();
    let (low, high) = (stats::quantile(&heights, 0.01)?, stats::quantile(&heights, 0.99)?);
    let count = ((high - low).min(SPAN_M) / rules.lift_m) as usize + 1;
    let mut bins = vec![[0.0f64; 2]; count];
    for s in level {
        let bin = ((s.at.z - low) / rules.lift_m).round();
        if bin >= 0.0
            && let Some(bin) = bins.get_mut(bin as usize)
        {
            bin[usize::from(s.normal.z < 0.0)] += 1.0;
        }
    }
    let smoothed = (0..count)
        .map(|i| {
            let around = &bins[i.saturating_sub(1)..(i + 2).min(count)];
            [0, 1].map(|k| around.iter().map(|b| b[k]).sum::<f64>().sqrt())
        })
        .collect();
    Some(Levels { low, bins: smoothed })
}

/// Places of the highest values that are the highest within `apart`, the highest first; those of less than a share of the highest
/// are left out.
fn peaks(values: &[f64], apart: usize, cyclic: bool, (most, worth): (usize, f64)) -> Vec<usize> {
    let n = values.len();
    let near = |a: usize, b: usize| {
        let d = a.abs_diff(b);
        (if cyclic { d.min(n - d) } else { d }) <= apart
    };
    let mut order: Vec<usize> = (0..n).filter(|&i| values[i] > 0.0).collect();
    order.sort_by(|&a, &b| values[b].total_cmp(&values[a]).then(a.cmp(&b)));
    let highest = order.first().map_or(0.0, |&i| values[i]);
    let mut chosen: Vec<usize> = Vec::new();
    // The shoulder of a peak is none.
    let at = |i: usize, beside: i64| {
        let j = i as i64 + beside;
        let j = if cyclic { j.rem_euclid(n as i64) } else { j };
        usize::try_from(j).ok().and_then(|j| values.get(j)).copied().unwrap_or(0.0)
    };
    for i in order {
        if chosen.len() >= most || values[i] < worth * highest {
            break;
        }
        if values[i] < at(i, -1) || values[i] < at(i, 1) {
            continue;
        }
        if !chosen.iter().any(|&c| near(c, i)) {
            chosen.push(i);
        }
    }
    chosen
}

/// Which way a piece of surface faces; `None` where it is neither level nor upright.
fn class(normal: &Vector) -> Option<usize> {
    if normal.z.abs() > LEVEL {
        return Some(12 + usize::from(normal.z < 0.0));
    }
    (normal.z.abs() < UPRIGHT).then(|| {
        let degrees = normal.y.atan2(normal.x).to_degrees().rem_euclid(360.0);
        ((degrees / 30.0) as usize).min(11)
    })
}

/// The scene's surfaces by the way that they face and their height.
struct Targets {
    low: f64,
    /// For each class the points (x, y) in each layer.
    layers: Vec<Vec<Vec<[f64; 2]>>>,
    /// Height of a layer, metres.
    layer_m: f64,
    /// Least x and y.
    corner: [f64; 2],
    size_m: [f64; 2],
}

impl Targets {
    fn of(scene: &[Surfel], layer_m: f64) -> Self {
        let bounds = |k: usize| {
            let along: Vec<f64> = scene.iter().map(|s| s.at[k]).collect();
            [0.005, 0.995].map(|q| stats::quantile(&along, q).unwrap_or(0.0))
        };
        let [x, y, z] = [0, 1, 2].map(bounds);
        // A layer below the floor, which is not quite even.
        let low = z[0] - layer_m;
        let count = ((z[1] - low).min(SPAN_M) / layer_m) as usize + 2;
        let mut layers = vec![vec![Vec::new(); count]; CLASSES];
        for s in scene {
            let layer = ((s.at.z - low) / layer_m).floor();
            let Some(class) = class(&s.normal).filter(|_| layer >= 0.0) else { continue };
            if let Some(layer) = layers.get_mut(class).and_then(|l| l.get_mut(layer as usize)) {
                layer.push([s.at.x, s.at.y]);
            }
        }
        let size_m = [x, y].map(|b| (b[1] - b[0]).min(SPAN_M));
        Self { low, layers, layer_m, corner: [x[0], y[0]], size_m }
    }

    /// Points that a piece of surface could be: of its class or one beside it, at its height.
    fn like<'a>(&'a self, normal: &Vector, height: f64) -> impl Iterator<Item = &'a [f64; 2]> {
        let own = class(normal);
        let classes = own.map_or([usize::MAX; 3], |c| {
            if c < 12 { [(c + 11) % 12, c, (c + 1) % 12] } else { [c, usize::MAX, usize::MAX] }
        });
        let layer = ((height - self.low) / self.layer_m).floor() as i64;
        let all = &self.layers;
        let of_height = move |layers: &'a Vec<Vec<[f64; 2]>>| {
            (layer - 1..=layer + 1).filter_map(move |l| layers.get(usize::try_from(l).ok()?)).flatten()
        };
        classes.into_iter().filter_map(move |c| all.get(c)).flat_map(of_height)
    }
}

/// Shifts for which most of the other's surface, turned and lifted, lies on the scene's, with how much that is.
fn shifts(
    targets: &Targets,
    other: &[Surfel],
    [turn, lift]: [f64; 2],
    rules: &config::AlignmentSearch,
) -> Vec<(f64, Pose)> {
    let cell_m = rules.cell_m;
    let spun = turned(&Vector::zeros(), turn, &Vector::new(0.0, 0.0, lift));
    let moved: Vec<Surfel> =
        other.iter().step_by(sampling::stride(other.len(), rules.voters)).map(|s| s.moved(&spun)).collect();
    let bounds = |k: usize| {
        let along: Vec<f64> = moved.iter().map(|s| s.at[k]).collect();
        [0.005, 0.995].map(|q| stats::quantile(&along, q).unwrap_or(0.0))
    };
    let [x, y] = [0, 1].map(bounds);
    // The least shift brings the other's far end onto the scene's near one.
    let low = [targets.corner[0] - x[1], targets.corner[1] - y[1]];
    let size = [0, 1].map(|k| {
        let own = if k == 0 { x[1] - x[0] } else { y[1] - y[0] };
        ((targets.size_m[k] + own.min(SPAN_M)) / cell_m) as usize + 1
    });
    let votes = smoothed(&vote(targets, &moved, low, size, cell_m), size);
    best_cells(&votes, size, rules)
        .into_iter()
        .map(|[i, j]| {
            let shift = Vector::new(low[0] + (i as f64 + 0.5) * cell_m, low[1] + (j as f64 + 0.5) * cell_m, lift);
            (votes[j * size[0] + i], turned(&Vector::zeros(), turn, &shift))
        })
        .collect()
}

/// For each shift (cell) the pairs of points that it brings together, rows of `size[0]` cells. Each class of normals counts by the
/// root of its size: a floor tells no more about where it is than a narrow side.
fn vote(targets: &Targets, moved: &[Surfel], low: [f64; 2], size: [usize; 2], cell_m: f64) -> Vec<f64> {
    let mut of_class = [0.0f64; CLASSES];
    for class in moved.iter().filter_map(|s| class(&s.normal)) {
        of_class[class] += 1.0;
    }
    let mut votes = vec![0.0f64; size[0] * size[1]];
    for s in moved {
        let Some(class) = class(&s.normal) else { continue };
        let weight = 1.0 / of_class[class].sqrt();
        for target in targets.like(&s.normal, s.at.z) {
            let i = ((target[0] - s.at.x - low[0]) / cell_m).floor();
            let j = ((target[1] - s.at.y - low[1]) / cell_m).floor();
            if i >= 0.0 && j >= 0.0 && (i as usize) < size[0] && (j as usize) < size[1] {
                votes[j as usize * size[0] + i as usize] += weight;
            }
        }
    }
    votes
}

/// Sums over each cell and the eight around it.
fn smoothed(votes: &[f64], [width, height]: [usize; 2]) -> Vec<f64> {
    let sum = |i: usize, j: usize| {
        let rows = j.saturating_sub(1)..(j + 2).min(height);
        rows.map(|r| votes[r * width + i.saturating_sub(1)..r * width + (i + 2).min(width)].iter().sum::<f64>())
            .sum::<f64>()
    };
    (0..width * height).map(|c| sum(c % width, c / width)).collect()
}

/// The cells of most votes, some cells apart.
fn best_cells(votes: &[f64], [width, _]: [usize; 2], rules: &config::AlignmentSearch) -> Vec<[usize; 2]> {
    let mut order: Vec<usize> = (0..votes.len()).filter(|&c| votes[c] > 0.0).collect();
    order.sort_by(|&a, &b| votes[b].total_cmp(&votes[a]).then(a.cmp(&b)));
    let mut chosen: Vec<[usize; 2]> = Vec::new();
    for c in order {
        if chosen.len() >= rules.shifts {
            break;
        }
        let at = [c % width, c / width];
        let near = |other: &[usize; 2]| (0..2).all(|k| (other[k] as i64 - at[k] as i64).abs() <= rules.shifts_apart);
        if !chosen.iter().any(near) {
            chosen.push(at);
        }
    }
    chosen
}
