//! Clustering of directions: k-means on the sphere and mean shift of axes (§A.5).

use super::{Vector, unit};

/// A cluster of unit vectors.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DirectionCluster {
    /// Unit mean direction.
    pub center: Vector,
    /// Members.
    pub count: usize,
}

/// k-means of unit vectors under the cosine distance, largest cluster first.
///
/// The start is the farthest-point rule from the first vector, so that the result does not depend on chance.
#[must_use]
pub fn kmeans(normals: &[Vector], k: usize, rounds: usize) -> Vec<DirectionCluster> {
    let Some(first) = normals.first() else { return Vec::new() };
    let mut centers = vec![*first];
    let mut nearest: Vec<f64> = normals.iter().map(|n| n.dot(first)).collect();
    while centers.len() < k.min(normals.len()) {
        let Some((far, _)) = nearest.iter().enumerate().min_by(|a, b| a.1.total_cmp(b.1)) else { break };
        let next = normals[far];
        centers.push(next);
        for (best, n) in nearest.iter_mut().zip(normals) {
            *best = best.max(n.dot(&next));
        }
    }
    let mut counts = vec![0usize; centers.len()];
    for _ in 0..rounds {
        let mut sums = vec![Vector::zeros(); centers.len()];
        counts.fill(0);
        for n in normals {
            let mut best = (0, f64::NEG_INFINITY);
            for (i, c) in centers.iter().enumerate() {
                let d = n.dot(c);
                if d > best.1 {
                    best = (i, d);
                }
            }
            sums[best.0] += n;
            counts[best.0] += 1;
        }
        let mut moved = 0.0f64;
        for (center, sum) in centers.iter_mut().zip(&sums) {
            if let Some(next) = unit(sum) {
                moved = moved.max((next - *center).norm());
                *center = next;
            }
        }
        if moved < 1e-6 {
            break;
        }
    }
    let mut clusters: Vec<DirectionCluster> =
        centers.into_iter().zip(counts).map(|(center, count)| DirectionCluster { center, count }).collect();
    clusters.sort_by_key(|c| std::cmp::Reverse(c.count));
    clusters
}

/// A mode of a set of axes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DensityMode {
    /// Unit direction; its sign carries no meaning.
    pub axis: Vector,
    /// Sum of the weights within the bandwidth.
    pub weight: f64,
}

/// Mean shift of weighted axes (directions without sign) with a flat kernel of `bandwidth` radians, heaviest mode first.
#[must_use]
pub fn mean_shift(axes: &[(Vector, f64)], bandwidth: f64) -> Vec<DensityMode> {
    let cosine = bandwidth.cos();
    let climb = |start: &Vector| {
        let mut at = *start;
        let mut weight = 0.0;
        for _ in 0..50 {
            let mut sum = Vector::zeros();
            weight = 0.0;
            for (a, w) in axes {
                let d = a.dot(&at);
                if d.abs() >= cosine {
                    sum += a * (w * d.signum());
                    weight += w;
                }
            }
            let Some(next) = unit(&sum) else { break };
            let moved = (next - at).norm();
            at = next;
            if moved < 1e-9 {
                break;
            }
        }
        DensityMode { axis: at, weight }
    };
    let mut modes: Vec<DensityMode> = Vec::new();
    for (axis, _) in axes {
        let mode = climb(axis);
        if !modes.iter().any(|m| m.axis.dot(&mode.axis).abs() >= cosine) {
            modes.push(mode);
        }
    }
    modes.sort_by(|a, b| b.weight.total_cmp(&a.weight));
    modes
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::unsigned_angle;

    #[test]
    fn kmeans_finds_three_walls() {
        let mut normals = Vec::new();
        for (axis, copies) in [(Vector::x(), 50), (Vector::y(), 30), (Vector::z(), 20)] {
            for i in 0..copies {
                let tilt = Vector::new(0.02 * f64::from(i % 5), 0.01 * f64::from(i % 3), -0.015 * f64::from(i % 4));
                normals.push((axis + tilt).normalize());
            }
        }
        let clusters = kmeans(&normals, 3, 20);
        assert_eq!(clusters.iter().map(|c| c.count).collect::<Vec<_>>(), [50, 30, 20]);
        assert!(unsigned_angle(&clusters[0].center, &Vector::x()) < 0.1);
    }

    #[test]
    fn mean_shift_ignores_the_sign() {
        let axes: Vec<(Vector, f64)> = (0..10)
            .map(|i| {
                let v = (Vector::z() + Vector::new(0.01 * f64::from(i), 0.0, 0.0)).normalize();
                (if i % 2 == 0 { v } else { -v }, 1.0)
            })
            .chain([(Vector::x(), 1.0)])
            .collect();
        let modes = mean_shift(&axes, 0.2);
        assert_eq!(modes.len(), 2);
        assert!(unsigned_angle(&modes[0].axis, &Vector::z()) < 0.1);
        assert!((modes[0].weight - 10.0).abs() < 1e-12);
    }

    #[test]
    fn nothing_in_nothing_out() {
        assert!(kmeans(&[], 3, 5).is_empty());
        assert!(mean_shift(&[], 0.1).is_empty());
    }
}
