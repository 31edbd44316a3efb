//! The scale of each frame's depth, from surfaces that several frames see (ours).
//!
//! Metric depth estimates are off by a factor that changes from frame to frame. Where two frames look at one surface from
//! different places, the distance between their camera centres, which is known, tells both factors: with the surface's
//! normal n, the depth points x_a and x_b (world axes, about their own camera centres c_a and c_b) of one place satisfy
//! `n . (c_a + s_a x_a - c_b - s_b x_b) = 0`. All frames are solved together, robustly.
//!
//! Depth is noisy and camera centres are not, so the equations are divided by the common factor s: with `s_i = s (1 + d_i)`
//! and `t = 1 / s` they read `n . ((1 + d_a) x_a - (1 + d_b) x_b + t (c_a - c_b)) = 0`, where the noise stands on the side
//! that least squares expects it on. Solved for s itself, noise would shrink it (by 10 % where cameras move little).

use std::collections::BTreeMap;

use rayon::prelude::*;

use crate::config;
use crate::math::{Point, Vector, stats};
use crate::recording::sketch::Sketch;
use crate::recording::{Camera, DepthFactors, DepthNoise, Recording};

/// A surface sample of a frame, world axes.
struct Sample {
    /// From the camera centre, depth as read.
    offset: Vector,
    normal: Vector,
    /// `normal . offset`.
    along: f64,
}

struct View<'a> {
    sketch: &'a Sketch,
    center: Point,
    samples: Vec<Sample>,
}

/// One comparison of two frames at one place: `n . x_a`, `n . x_b`, `n . (c_a - c_b)`.
type Link = [f64; 3];

/// How far the two surfaces of a comparison are apart under the frames' factors, metres.
fn residual([xa, xb, base]: Link, [a, b]: [f64; 2]) -> f64 {
    base + a * xa - b * xb
}

/// What one frame's comparisons with another say: their share of the normal equations. Unknowns are `d_a`, `d_b` and `t`.
#[derive(Debug, Clone, Copy)]
struct Pair {
    b: usize,
    /// Upper triangle by rows: `aa`, `ab`, `at`, `bb`, `bt`, `tt`.
    matrix: [f64; 6],
    rhs: [f64; 3],
}

/// Solves the factors that each frame's depth has to be multiplied by: 1 where nothing tells, the common one for frames
/// that are not among the sketches. The search starts at the recording's own factors.
#[must_use]
pub fn solve(recording: &Recording, sketches: &BTreeMap<usize, Sketch>, rules: &config::DepthScales) -> DepthFactors {
    /// Numerics: comparisons a gate at the most; each brings the places that are compared nearer to each other.
    const ROUNDS: usize = 25;
    let views: Vec<View> = sketches
        .par_iter()
        .filter(|(f, _)| recording.frames[**f].files.depth.is_some())
        .map(|(_, s)| view(recording, s, rules))
        .collect();
    if views.len() < 2 {
        return DepthFactors::default();
    }
    let partners: Vec<Vec<usize>> =
        (0..views.len()).into_par_iter().map(|a| partners(recording, &views, a, rules)).collect();
    let mut factors: Vec<f64> = views.iter().map(|v| recording.depth_factor(v.sketch.frame)).collect();
    'gates: for (gate_m, stride) in rules.gates_m.into_iter().zip(rules.strides) {
        for _ in 0..ROUNDS {
            let pairs: Vec<Vec<Pair>> = partners
                .par_iter()
                .enumerate()
                .map(|(a, others)| {
                    let pair = |&b: &usize| {
                        let links =
                            compare(recording, (views.as_slice(), factors.as_slice()), [a, b], gate_m, stride, rules);
                        (links.len() >= rules.least_links.div_ceil(stride))
                            .then(|| weighed(&links, b, [factors[a], factors[b]], gate_m, rules))
                    };
                    others.iter().filter_map(pair).collect()
                })
                .collect();
            let Some(next) = adjust(&pairs, rules) else { break 'gates };
            let moved: f64 = next.iter().zip(&factors).map(|(a, b)| (a - b).powi(2)).sum();
            factors = next;
            if moved < views.len() as f64 * rules.settled * rules.settled {
                break;
            }
        }
    }
    let other = stats::median(&factors).unwrap_or(1.0);
    let noise = noise(recording, (views.as_slice(), factors.as_slice()), &partners, rules);
    DepthFactors { by_frame: views.iter().map(|v| v.sketch.frame).zip(factors).collect(), other, noise }
}

/// The noise law of the frames' depth once their factors are known, from how far apart two frames see one surface. Every
/// `rules.noise_every`-th place is looked at. Errors that all frames share do not show in it.
fn noise(
    recording: &Recording,
    (views, factors): (&[View], &[f64]),
    partners: &[Vec<usize>],
    rules: &config::DepthScales,
) -> Option<DepthNoise> {
    let apart: Vec<Vec<[f64; 2]>> = partners
        .par_iter()
        .enumerate()
        .map(|(a, others)| {
            let of = |&b: &usize| {
                let links = compare(recording, (views, factors), [a, b], rules.gates_m[0], rules.noise_every, rules);
                links.into_iter().map(move |l| (l, [factors[a], factors[b]]))
            };
            let links = others.iter().flat_map(of);
            links.map(|(link, f)| [distance(link, f), residual(link, f).abs()]).collect()
        })
        .collect();
    let mut apart: Vec<[f64; 2]> = apart.into_iter().flatten().collect();
    if apart.len() < rules.noise_places {
        return None;
    }
    apart.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
    // Of the difference of two: a frame's own is smaller by the root of two. The median of an absolute value is robust.
    let of_one = stats::NORMAL_PER_MEDIAN / std::f64::consts::SQRT_2;
    let bins: Vec<[f64; 2]> = apart
        .chunks(apart.len().div_ceil(rules.noise_bins))
        .filter_map(|bin| {
            let of = |k: usize| stats::median(&bin.iter().map(|b| b[k]).collect::<Vec<f64>>());
            Some([of(0)?, of_one * of(1)?])
        })
        .collect();
    Some(straight(&bins))
}

/// The line through standard deviations over distances, neither below zero at the camera nor falling.
fn straight(bins: &[[f64; 2]]) -> DepthNoise {
    let count = bins.len().max(1) as f64;
    let mean = |k: usize| bins.iter().map(|b| b[k]).sum::<f64>() / count;
    let [at, std] = [mean(0), mean(1)];
    let spread: f64 = bins.iter().map(|b| (b[0] - at).powi(2)).sum();
    let rise: f64 = bins.iter().map(|b| (b[0] - at) * (b[1] - std)).sum();
    let steepest = std / at.max(f64::EPSILON);
    let per_m = if spread > 0.0 { (rise / spread).clamp(0.0, steepest) } else { 0.0 };
    DepthNoise { floor_m: std - per_m * at, per_m }
}

/// How far away the place of a comparison is, across its surface, metres.
fn distance([xa, xb, _]: Link, [a, b]: [f64; 2]) -> f64 {
    0.5 * (a * xa.abs() + b * xb.abs())
}

fn view<'a>(recording: &Recording, sketch: &'a Sketch, rules: &config::DepthScales) -> View<'a> {
    // Wide enough to average pixel noise, narrow enough for a drawer's front.
    let reach = (sketch.depth_mm.width / rules.normal_reach).max(2);
    let pose = &recording.frames[sketch.frame].world_from_camera;
    let area = sketch.depth_mm.data.len();
    let stride = ((area as f64 / rules.samples as f64).sqrt().round() as usize).max(1);
    let camera = recording.camera_of(sketch.frame);
    let mut samples = Vec::new();
    for y in (stride / 2..sketch.depth_mm.height).step_by(stride) {
        for x in (stride / 2..sketch.depth_mm.width).step_by(stride) {
            let Some(p) = sketch.point(camera, x, y) else { continue };
            let Some(n) = sketch.normal(camera, x, y, reach) else { continue };
            // Surfaces seen at a grazing angle have no usable normal.
            if -n.dot(&p.coords.normalize()) > rules.least_slant_cos {
                let (offset, normal) = (pose.rotation * p.coords, pose.rotation * n);
                samples.push(Sample { offset, normal, along: normal.dot(&offset) });
            }
        }
    }
    View { sketch, center: recording.frames[sketch.frame].center(), samples }
}

/// Frames that see what frame `a` sees from another distance: those that tell its factor best.
fn partners(recording: &Recording, views: &[View], a: usize, rules: &config::DepthScales) -> Vec<usize> {
    let from = &views[a];
    let probes: Vec<&Sample> = from.samples.iter().step_by((from.samples.len() / rules.probes).max(1)).collect();
    // In a long recording every n-th frame is candidate enough.
    let stride = (views.len() / rules.candidates).max(1);
    let mut scored: Vec<(f64, usize)> = (0..views.len())
        .filter(|&b| b != a && (a + b).is_multiple_of(stride))
        .map(|b| {
            let baseline = from.center - views[b].center;
            let camera = recording.camera_of(views[b].sketch.frame);
            let camera_from_world = recording.frames[views[b].sketch.frame].world_from_camera.inverse();
            let told: f64 = probes
                .iter()
                .filter(|s| {
                    let local = camera_from_world * (from.center + s.offset);
                    local.z > rules.nearest_m && camera.project(&local).is_some_and(|(u, v)| camera.contains(u, v))
                })
                .map(|s| s.normal.dot(&baseline).abs().min(rules.most_baseline_m))
                .sum();
            (told, b)
        })
        .filter(|(told, _)| *told > 0.0)
        .collect();
    scored.sort_by(|x, y| y.0.total_cmp(&x.0).then(x.1.cmp(&y.1)));
    // Half of the best, half spread over the rest: ratios between like views are worth something too.
    let best = rules.partners / 2;
    let rest = scored.get(best..).unwrap_or_default();
    let mut chosen: Vec<usize> = scored.iter().take(best).map(|s| s.1).collect();
    chosen.extend(
        rest.iter().step_by((rest.len() / (rules.partners - best)).max(1)).take(rules.partners - best).map(|s| s.1),
    );
    chosen
}

/// Places of frame a that frame b sees too, under the present factors, of every `stride`-th sample.
fn compare(
    recording: &Recording,
    (views, factors): (&[View], &[f64]),
    [a, b]: [usize; 2],
    gate_m: f64,
    stride: usize,
    rules: &config::DepthScales,
) -> Vec<Link> {
    let (from, to) = (&views[a], &views[b]);
    let camera: &Camera = recording.camera_of(to.sketch.frame);
    let world_from_camera =
        recording.frames[to.sketch.frame].world_from_camera.rotation.to_rotation_matrix().into_inner();
    let camera_from_world = world_from_camera.transpose();
    let baseline = from.center - to.center;
    let center = camera_from_world * baseline;
    let turned = camera_from_world * factors[a];
    from.samples
        .iter()
        .step_by(stride)
        .filter_map(|s| {
            let local = Point::from(center + turned * s.offset);
            let (u, v) = camera.project(&local).filter(|_| local.z > rules.nearest_m)?;
            let (x, y) = to.sketch.sample(u, v)?;
            let z = f64::from(to.sketch.depth_m(y * to.sketch.depth_mm.width + x));
            if z <= 0.0 {
                return None;
            }
            // Along the ray of the very pixel: the nearest sample's depth stands for it only on the surface's plane,
            // which is what the gate then checks.
            let (us, vs) = to.sketch.pixel(x, y);
            let other = world_from_camera * camera.unproject(us, vs, z).coords;
            let link = [s.along, s.normal.dot(&other), s.normal.dot(&baseline)];
            if residual(link, [factors[a], factors[b]]).abs() > gate_m {
                return None;
            }
            // A side of a board can lie in the plane's slab far from the place that was looked for.
            let place = baseline + s.offset * factors[a] - other * factors[b];
            (place.norm() <= gate_m + rules.same_place_m).then_some(link)
        })
        .collect()
}

/// The links of a pair, robustly weighted.
fn weighed(links: &[Link], b: usize, factors: [f64; 2], gate_m: f64, rules: &config::DepthScales) -> Pair {
    let weight = (rules.independent / links.len() as f64).min(1.0) / rules.sample_std_m.powi(2);
    let scale = (rules.gate_scale * gate_m).max(rules.sample_std_m);
    let mut pair = Pair { b, matrix: [0.0; 6], rhs: [0.0; 3] };
    for &link in links {
        let w = weight / (1.0 + (residual(link, factors) / scale).powi(2)).powi(2);
        let [xa, xb, base] = link;
        let row = [xa, -xb, base];
        let products = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)].map(|(i, k)| w * row[i] * row[k]);
        pair.matrix.iter_mut().zip(products).for_each(|(sum, x)| *sum += x);
        pair.rhs.iter_mut().zip(row).for_each(|(sum, x)| *sum -= w * x * (xa - xb));
    }
    pair
}

/// One least-squares step for all factors; `None` where the system cannot be solved.
///
/// Each frame meets a few others and the common factor: all but one row of the system are sparse. The common factor is
/// eliminated, and what is left is solved by conjugate gradients, in time that grows with the number of frames.
fn adjust(pairs: &[Vec<Pair>], rules: &config::DepthScales) -> Option<Vec<f64>> {
    let n = pairs.len();
    let mut frames = Sparse { diagonal: vec![rules.frame_std.powi(-2); n], rows: vec![Vec::new(); n] };
    let (mut rhs, mut border) = (vec![0.0; n], vec![0.0; n]);
    let (mut corner, mut corner_rhs) = (rules.common_std.powi(-2), rules.common_std.powi(-2));
    for (a, pair) in pairs.iter().enumerate().flat_map(|(a, of)| of.iter().map(move |p| (a, p))) {
        let [aa, ab, at, bb, bt, tt] = pair.matrix;
        frames.diagonal[a] += aa;
        frames.diagonal[pair.b] += bb;
        frames.rows[a].push((pair.b, ab));
        frames.rows[pair.b].push((a, ab));
        border[a] += at;
        border[pair.b] += bt;
        corner += tt;
        rhs[a] += pair.rhs[0];
        rhs[pair.b] += pair.rhs[1];
        corner_rhs += pair.rhs[2];
    }
    let (own, common) = (frames.solve(&rhs)?, frames.solve(&border)?);
    let t = (corner_rhs - dot(&border, &own)) / (corner - dot(&border, &common));
    let next: Vec<f64> = own.iter().zip(&common).map(|(own, common)| (1.0 + own - t * common) / t).collect();
    // Half or twice the depth is a broken export, which is told elsewhere.
    let [least, most] = rules.factors;
    next.iter().all(|s| (least..most).contains(s)).then_some(next)
}

/// A symmetric positive definite matrix of which most is zero.
struct Sparse {
    diagonal: Vec<f64>,
    /// Beside the diagonal, by rows: column and value; a column may stand in a row more than once.
    rows: Vec<Vec<(usize, f64)>>,
}

impl Sparse {
    fn times(&self, x: &[f64]) -> Vec<f64> {
        let row = |(i, row): (usize, &Vec<(usize, f64)>)| {
            row.iter().fold(self.diagonal[i] * x[i], |sum, (k, value)| sum + value * x[*k])
        };
        // Each row is summed in its own order: the same on any number of threads.
        self.rows.par_iter().with_min_len(256).enumerate().map(row).collect()
    }

    /// Conjugate gradients with the diagonal as preconditioner (Hestenes and Stiefel 1952); `None` where they do not settle.
    fn solve(&self, rhs: &[f64]) -> Option<Vec<f64>> {
        /// Numerics: of the right-hand side, far below what any factor is known to.
        const EXACT: f64 = 1e-12;
        /// Numerics: the prior on the diagonal bounds the condition: some hundred steps are usual.
        const STEPS: usize = 10_000;
        let scaled = |r: &[f64]| -> Vec<f64> { r.iter().zip(&self.diagonal).map(|(r, d)| r / d).collect() };
        let mut x = vec![0.0; rhs.len()];
        let mut left = rhs.to_vec();
        let mut z = scaled(&left);
        let mut way = z.clone();
        let mut energy = dot(&left, &z);
        let enough = EXACT * EXACT * energy;
        for _ in 0..STEPS {
            if energy <= enough {
                return Some(x);
            }
            let along = self.times(&way);
            let step = energy / dot(&way, &along);
            if !step.is_finite() {
                return None;
            }
            x.iter_mut().zip(&way).for_each(|(x, w)| *x += step * w);
            left.iter_mut().zip(&along).for_each(|(r, a)| *r -= step * a);
            z = scaled(&left);
            let next = dot(&left, &z);
            let turn = next / energy;
            way.iter_mut().zip(&z).for_each(|(w, z)| *w = z + turn * *w);
            energy = next;
        }
        None
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Pose;
    use crate::recording::{Frame, FrameFiles, Grid};

    /// A corner of two walls and a worktop, seen from ten places by depth that is off by a factor of each frame's own.
    fn corner(factors: &[f64]) -> (Recording, BTreeMap<usize, Sketch>) {
        let camera = Camera { width: 160, height: 120, fx: 100.0, fy: 100.0, cx: 79.5, cy: 59.5 };
        let planes = [(Vector::y(), 2.0), (Vector::x(), 1.2), (-Vector::z(), 0.5)]
            .map(|(n, d): (Vector, f64)| (n.normalize(), d));
        let mut frames = Vec::new();
        let mut sketches = BTreeMap::new();
        for (i, factor) in factors.iter().enumerate() {
            let t = i as f64;
            let eye = Vector::new(-0.8 + 0.13 * t, 0.12 * (t % 4.0) - 0.3, 0.5 + 0.07 * (t % 3.0));
            let turn = nalgebra::UnitQuaternion::from_euler_angles(-1.85, 0.0, 0.1 * (t % 3.0) - 0.35);
            let pose = Pose::from_parts(eye.into(), turn);
            let mut depth = Grid::filled(camera.width, camera.height, 0.0f32);
            for y in 0..camera.height {
                for x in 0..camera.width {
                    let ray = pose.rotation * camera.unproject(x as f64, y as f64, 1.0).coords;
                    let z = planes
                        .iter()
                        .map(|(n, d)| (d - n.dot(&eye)) / n.dot(&ray))
                        .filter(|z| *z > 0.0)
                        .fold(f64::INFINITY, f64::min);
                    depth.data[y * camera.width + x] = if z < 6.0 { (z / factor) as f32 } else { 0.0 };
                }
            }
            frames.push(Frame {
                timestamp_secs: t,
                world_from_camera: pose,
                files: FrameFiles { depth: Some(std::path::PathBuf::from("there")), ..Default::default() },
            });
            sketches.insert(i, Sketch::of(i, &depth, None));
        }
        let recording = Recording { frames, ..Recording::empty(camera) };
        (recording, sketches)
    }

    #[test]
    fn factors_of_twelve_per_cent_with_jitter_are_found_to_half_a_per_cent() {
        for common in [0.88, 1.0, 1.12] {
            let truth: Vec<f64> = (0..10).map(|i| common * (1.0 + 0.015 * f64::from(i % 3 - 1))).collect();
            let (recording, sketches) = corner(&truth);
            let found = solve(&recording, &sketches, &config::DepthScales::default());
            for (i, factor) in truth.iter().enumerate() {
                assert!((found.of(i) / factor - 1.0).abs() < 5e-3, "{common}: frame {i}: {} of {factor}", found.of(i));
            }
        }
    }

    #[test]
    fn conjugate_gradients_solve_what_a_dense_factorisation_solves() {
        let n = 40;
        let mut sparse = Sparse { diagonal: vec![3.0; n], rows: vec![Vec::new(); n] };
        let mut dense = nalgebra::DMatrix::<f64>::identity(n, n) * 3.0;
        for i in 0..n {
            // The same pair may be met twice.
            for k in [(7 * i + 1) % n, (i + 1) % n] {
                let value = 0.3 * ((i * k) as f64).sin();
                if i != k {
                    sparse.rows[i].push((k, value));
                    sparse.rows[k].push((i, value));
                    dense[(i, k)] += value;
                    dense[(k, i)] += value;
                }
            }
        }
        let rhs: Vec<f64> = (0..n).map(|i| (i as f64).cos()).collect();
        let found = sparse.solve(&rhs).unwrap();
        let exact = dense.cholesky().unwrap().solve(&nalgebra::DVector::from_vec(rhs));
        assert!(found.iter().zip(&exact).all(|(a, b)| (a - b).abs() < 1e-10));
        assert_eq!(sparse.solve(&vec![0.0; n]), Some(vec![0.0; n]));
    }

    #[test]
    fn where_the_search_starts_does_not_decide_where_it_ends() {
        let truth: Vec<f64> = (0..10).map(|i| 1.06 * (1.0 + 0.015 * f64::from(i % 3 - 1))).collect();
        let (mut recording, sketches) = corner(&truth);
        for start in [0.97, 1.06, 1.15] {
            recording.depth_factors =
                DepthFactors { by_frame: BTreeMap::from([(0, 1.0)]), other: start, ..Default::default() };
            let found = solve(&recording, &sketches, &config::DepthScales::default());
            for (i, factor) in truth.iter().enumerate() {
                assert!((found.of(i) / factor - 1.0).abs() < 5e-3, "{start}: frame {i}: {} of {factor}", found.of(i));
            }
        }
    }

    #[test]
    fn a_camera_that_stays_in_place_tells_no_scale() {
        let (mut recording, sketches) = corner(&[1.1; 4]);
        let pose = recording.frames[0].world_from_camera;
        recording.frames.iter_mut().for_each(|f| f.world_from_camera = pose);
        let found = solve(&recording, &sketches, &config::DepthScales::default());
        assert!((found.other - 1.0).abs() < 0.02, "{}", found.other);
    }
}
