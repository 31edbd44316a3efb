//! The Manhattan frame of a scene from surface normals (§A.5).

use nalgebra::{Matrix3, Rotation3};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::config::{self, ManhattanMethod};
use crate::error::Result;
use crate::math::directions::{kmeans, mean_shift};
use crate::math::{Point, Vector, any_orthogonal, unit};
use crate::recording::{Camera, Grid, HAND_CLASS, Recording};

/// Three orthogonal directions of the room.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ManhattanFrame {
    /// `m_1, m_2, m_3`, world, orthonormal and right-handed, the most upward one last.
    pub axes: [Vector; 3],
    /// Frames whose normals agreed on it.
    pub frames: usize,
}

/// Estimates the frame from the normals of the given views; `None` where they show no three directions.
pub fn estimate(recording: &Recording, views: &[usize], config: &config::Geometry) -> Result<Option<ManhattanFrame>> {
    let by_view: Vec<(usize, Vec<Vector>)> =
        views.par_iter().map(|&view| Ok((view, view_normals(recording, view, config)?))).collect::<Result<_>>()?;
    let rotated = |view: usize, n: &Vector| recording.frames[view].world_from_camera.rotation * n;
    match config.manhattan {
        ManhattanMethod::Clustered => {
            let mut axes: Vec<(Vector, f64)> = Vec::new();
            let mut frames = 0;
            for (view, normals) in &by_view {
                let Some(triple) = frame_triple(normals, config.normal_clusters, config.frame.orthogonal_cost) else {
                    continue;
                };
                axes.extend(triple.map(|(axis, weight)| (rotated(*view, &axis), weight)));
                frames += 1;
            }
            let axes = combine(&axes, &recording.up(), config.mean_shift_deg.to_radians(), config.frame.orthogonal_deg);
            Ok(axes.map(|axes| ManhattanFrame { axes, frames }))
        }
        ManhattanMethod::Gravity => {
            let all: Vec<Vector> =
                by_view.iter().flat_map(|(view, normals)| normals.iter().map(|n| rotated(*view, n))).collect();
            let frames = by_view.iter().filter(|(_, normals)| !normals.is_empty()).count();
            Ok(of_normals(&all, &recording.up(), &config.frame).map(|axes| ManhattanFrame { axes, frames }))
        }
    }
}

/// The room's axes from unit normals in the world and its up direction (good to a few degrees), the upright axis last; `None`
/// where there are next to no upright surfaces.
#[must_use]
pub fn of_normals(normals: &[Vector], up: &Vector, rules: &config::RoomFrame) -> Option<[Vector; 3]> {
    heading(normals, up, rules).map(|start| refine(start, normals, up, rules))
}

/// The frame about the vertical that most upright surfaces agree on; `None` where there are next to none.
fn heading(normals: &[Vector], up: &Vector, rules: &config::RoomFrame) -> Option<[Vector; 3]> {
    /// Geometry: walls are a quarter of a turn apart; a bin a degree.
    const BINS: usize = 90;
    let reach = rules.smoothed_deg;
    let e1 = any_orthogonal(up);
    let e2 = up.cross(&e1);
    let mut histogram = [0u32; BINS];
    for n in normals.iter().filter(|n| n.dot(up).abs() < rules.upright_sin) {
        let degrees = n.dot(&e2).atan2(n.dot(&e1)).to_degrees().rem_euclid(BINS as f64);
        histogram[(degrees as usize).min(BINS - 1)] += 1;
    }
    if histogram.iter().sum::<u32>() < rules.least_normals {
        return None;
    }
    let smoothed = |i: i64| (-reach..=reach).map(|d| histogram[(i + d).rem_euclid(BINS as i64) as usize]).sum::<u32>();
    let best = (0..BINS as i64).max_by_key(|&i| (smoothed(i), -i))?;
    let yaw = (best as f64 + 0.5).to_radians();
    let first = e1 * yaw.cos() + e2 * yaw.sin();
    Some([first, up.cross(&first), *up])
}

/// Robust rotation of the frame onto all normals: each normal pulls its nearest axis, the less the farther it is. Gravity
/// pulls the upright axis with the weight of a small share of the normals: it is known to a degree, and some rooms show neither
/// floor nor worktop.
fn refine(start: [Vector; 3], normals: &[Vector], up: &Vector, rules: &config::RoomFrame) -> [Vector; 3] {
    /// Numerics.
    const ROUNDS: usize = 12;
    // Beyond the cut a normal belongs to another structure.
    let cut = rules.cut_deg.to_radians();
    let [narrow, wide] = rules.noise_deg.map(f64::to_radians);
    let mut axes = start;
    for round in 0..ROUNDS {
        // Wide weights first, to arrive; then about the normals' own noise, to be robust and waste none of them.
        let scale = if round < ROUNDS / 2 { wide } else { spread(&axes, normals, cut, [narrow, wide]) };
        let mut pull = up * axes[2].transpose() * (rules.gravity_share * normals.len() as f64);
        for n in normals {
            let mut best = (0, 0.0);
            for (i, axis) in axes.iter().enumerate() {
                let d = n.dot(axis);
                if d.abs() > best.1 {
                    best = (i, d.abs());
                }
            }
            let angle = best.1.min(1.0).acos();
            if angle > cut {
                continue;
            }
            let weight = (1.0 + (angle / scale).powi(2)).powi(-2);
            let axis = axes[best.0];
            let signed = if n.dot(&axis) < 0.0 { -*n } else { *n };
            // Columns of the frame on the right: the rotation that best turns the old axes into the pulled ones.
            pull += signed * axis.transpose() * weight;
        }
        let svd = pull.svd(true, true);
        let (Some(u), Some(v_t)) = (svd.u, svd.v_t) else { break };
        let mut turn = u * v_t;
        if turn.determinant() < 0.0 {
            // Two walls only: the third direction follows from the first two.
            let mut flipped = u;
            flipped.column_mut(2).neg_mut();
            turn = flipped * v_t;
        }
        axes = axes.map(|a| (turn * a).normalize());
    }
    axes
}

/// Median angle of the normals to their axes (those within the cut), between two bounds, radians.
fn spread(axes: &[Vector; 3], normals: &[Vector], cut: f64, [narrow, wide]: [f64; 2]) -> f64 {
    let angle = |n: &Vector| axes.iter().map(|a| n.dot(a).abs()).fold(0.0, f64::max).min(1.0).acos();
    // A sample tells it well enough.
    let angles: Vec<f64> =
        normals.iter().step_by((normals.len() / 4000).max(1)).map(angle).filter(|a| *a <= cut).collect();
    crate::math::stats::median(&angles).unwrap_or(cut).clamp(narrow, wide)
}

/// Camera-frame normals of a view: from its normals file, else from the slope of its depth.
pub fn view_normals(recording: &Recording, view: usize, config: &config::Geometry) -> Result<Vec<Vector>> {
    let camera = recording.camera_of(view);
    let mask = recording.mask(view)?;
    let total = camera.width * camera.height;
    let step = ((total as f64 / config.normals_per_frame as f64).sqrt().floor() as usize).max(1);
    let is_hand = |x: usize, y: usize| mask.as_ref().is_some_and(|m| m.get(x, y) == Some(HAND_CLASS));
    let pixels = (step / 2..camera.height)
        .step_by(step)
        .flat_map(|y| (step / 2..camera.width).step_by(step).map(move |x| (x, y)))
        .filter(|&(x, y)| !is_hand(x, y));
    if let Some(normals) = recording.normals(view)? {
        return Ok(pixels
            .filter_map(|(x, y)| normals.get(x, y))
            .map(|n| Vector::new(f64::from(n[0]), f64::from(n[1]), f64::from(n[2])))
            .filter(|n| n.norm() > 0.5)
            .collect());
    }
    let Some(depth) = recording.depth(view)? else { return Ok(Vec::new()) };
    Ok(pixels.filter_map(|(x, y)| slope_normal(&depth, camera, [x, y], &config.frame)).collect())
}

/// Normal from the depths a few pixels to each side; `None` at depth edges and holes.
fn slope_normal(depth: &Grid<f32>, camera: &Camera, [x, y]: [usize; 2], rules: &config::RoomFrame) -> Option<Vector> {
    let reach = rules.slope_px;
    let at = |x: usize, y: usize| -> Option<Point> {
        let z = f64::from(depth.get(x, y)?);
        (z > 0.0).then(|| camera.unproject(x as f64, y as f64, z))
    };
    let centre = at(x, y)?;
    let (left, right) = (at(x.checked_sub(reach)?, y)?, at(x + reach, y)?);
    let (above, below) = (at(x, y.checked_sub(reach)?)?, at(x, y + reach)?);
    // Both sides of a pixel lie on one plane; at an edge the middle does not lie between them.
    let bend = (left.z + right.z - 2.0 * centre.z).abs() + (above.z + below.z - 2.0 * centre.z).abs();
    if bend > rules.bend_share * centre.z {
        return None;
    }
    let normal = unit(&(right - left).cross(&(below - above)))?;
    Some(if normal.dot(&centre.coords) > 0.0 { -normal } else { normal })
}

/// Dominant orthogonal triple of one frame: the largest k-means cluster, and the two that are most orthogonal (§A.5).
fn frame_triple(normals: &[Vector], k: usize, most_cost: f64) -> Option<[(Vector, f64); 3]> {
    // Fewer normals than this per cluster are noise.
    if normals.len() < 10 * k {
        return None;
    }
    let clusters = kmeans(normals, k, 20);
    let first = clusters.first()?;
    let mut best: Option<(f64, usize, usize)> = None;
    for s in 1..clusters.len() {
        for t in s + 1..clusters.len() {
            let (cs, ct) = (&clusters[s].center, &clusters[t].center);
            let cost = cs.dot(&first.center).abs() + first.center.dot(ct).abs() + cs.dot(ct).abs();
            if best.is_none_or(|b| cost < b.0) {
                best = Some((cost, s, t));
            }
        }
    }
    // Three exactly orthogonal directions cost 0; a frame that sees one wall and its noise costs more than this.
    let (_, s, t) = best.filter(|b| b.0 < most_cost)?;
    Some([0, s, t].map(|i| (clusters[i].center, clusters[i].count as f64 / normals.len() as f64)))
}

/// Mean shift over all frames' axes, then the nearest rotation to the three heaviest orthogonal modes.
fn combine(axes: &[(Vector, f64)], up: &Vector, bandwidth: f64, orthogonal_deg: f64) -> Option<[Vector; 3]> {
    let modes = mean_shift(axes, bandwidth);
    let first = modes.first()?.axis;
    // The rest is another structure.
    let orthogonal = |a: &Vector, b: &Vector| a.dot(b).abs() < orthogonal_deg.to_radians().sin();
    let second = modes.iter().find(|m| orthogonal(&m.axis, &first))?.axis;
    let third = modes
        .iter()
        .find(|m| orthogonal(&m.axis, &first) && orthogonal(&m.axis, &second))
        .map_or_else(|| first.cross(&second), |m| m.axis);
    let third = if first.cross(&second).dot(&third) < 0.0 { -third } else { third };
    let svd = Matrix3::from_columns(&[first, second, third]).svd(true, true);
    let rotation = Rotation3::from_matrix_unchecked(svd.u? * svd.v_t?);
    let mut axes: Vec<Vector> = (0..3).map(|i| rotation.matrix().column(i).into_owned()).collect();
    axes.sort_by(|a, b| a.dot(up).abs().total_cmp(&b.dot(up).abs()));
    let vertical = if axes[2].dot(up) < 0.0 { -axes[2] } else { axes[2] };
    Some([axes[0], vertical.cross(&axes[0]), vertical])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{rotation, unsigned_angle};
    use rand::SeedableRng;
    use rand_distr::{Distribution, Normal};

    /// Normals of two walls and a floor with noise, in the world, turned by `yaw`.
    fn room(yaw: f64, noise_rad: f64) -> Vec<Vector> {
        let turn = rotation(&Vector::z(), yaw);
        let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(5);
        let noise = Normal::new(0.0, noise_rad).unwrap();
        [(Vector::y(), 2400), (Vector::x(), 800), (Vector::z(), 1600)]
            .iter()
            .flat_map(|(axis, copies)| vec![turn * axis; *copies])
            .map(|n| (n + Vector::from_fn(|_, _| noise.sample(&mut rng))).normalize())
            .collect()
    }

    fn worst(found: &[Vector; 3], yaw: f64) -> f64 {
        let turn = rotation(&Vector::z(), yaw);
        [Vector::x(), Vector::y(), Vector::z()]
            .iter()
            .map(|a| found.iter().map(|f| unsigned_angle(f, &(turn * a))).fold(f64::INFINITY, f64::min))
            .fold(0.0, f64::max)
    }

    #[test]
    fn fifteen_degrees_of_noise_leave_the_frame_to_a_degree_at_any_heading_and_under_a_tilted_up() {
        let up = rotation(&Vector::x(), 0.02) * Vector::z();
        for yaw in [0.0, 0.4, 0.78, 1.3] {
            let normals = room(yaw, 0.26);
            let found = refine(
                heading(&normals, &up, &config::RoomFrame::default()).unwrap(),
                &normals,
                &up,
                &config::RoomFrame::default(),
            );
            assert!(worst(&found, yaw).to_degrees() < 1.0, "{}", worst(&found, yaw).to_degrees());
            assert!(found[2].z > 0.99 && (found[0].cross(&found[1]) - found[2]).norm() < 1e-9);
        }
        let exact = room(0.4, 1e-4);
        assert!(
            worst(
                &refine(
                    heading(&exact, &up, &config::RoomFrame::default()).unwrap(),
                    &exact,
                    &up,
                    &config::RoomFrame::default()
                ),
                0.4
            )
            .to_degrees()
                < 0.1
        );
        assert!(heading(&vec![Vector::z(); 500], &up, &config::RoomFrame::default()).is_none());
    }

    #[test]
    fn the_papers_clusters_find_a_room_in_little_noise() {
        let normals = room(0.4, 0.05);
        let triple = frame_triple(&normals, 6, 0.6).unwrap();
        let found = combine(&triple, &Vector::z(), 12f64.to_radians(), 15.0).unwrap();
        assert!(worst(&found, 0.4).to_degrees() < 3.0, "{}", worst(&found, 0.4).to_degrees());
    }

    #[test]
    fn one_wall_gives_no_frame() {
        assert!(frame_triple(&vec![Vector::z(); 500], 6, 0.6).is_none());
    }
}
