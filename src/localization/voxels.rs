//! A sparse voxel grid that counts distinct views (§3.1).

use std::collections::{BTreeMap, HashMap, HashSet};

use crate::math::Point;

/// Voxel of a point.
#[must_use]
pub fn index(p: &Point, voxel_m: f64) -> [i32; 3] {
    [p.x, p.y, p.z].map(|c| (c / voxel_m).floor() as i32)
}

/// Centre of a voxel.
#[must_use]
pub fn center(voxel: &[i32; 3], voxel_m: f64) -> Point {
    Point::from(voxel.map(|i| (f64::from(i) + 0.5) * voxel_m))
}

/// Number of distinct views per voxel, `n_v`. `seen` lists (view, point), the points of one view together.
#[must_use]
pub fn count_views(seen: &[(u32, Point)], voxel_m: f64) -> BTreeMap<[i32; 3], u32> {
    let mut counts: HashMap<[i32; 3], (u32, u32)> = HashMap::new();
    for (view, p) in seen {
        counts
            .entry(index(p, voxel_m))
            .and_modify(|(last, n)| {
                if *last != *view {
                    (*last, *n) = (*view, *n + 1);
                }
            })
            .or_insert((*view, 1));
    }
    counts.into_iter().map(|(v, (_, n))| (v, n)).collect()
}

/// The voxels of the connected piece (26 neighbours) nearest to the grip, sorted; empty where none is within 20 cm of it.
#[must_use]
pub fn connected_with(voxels: &[[i32; 3]], grip: &Point, voxel_m: f64) -> Vec<[i32; 3]> {
    // A grip stands off its face by a handle, and hands are estimated to a few centimetres.
    const NEAR_M: f64 = 0.2;
    let mut left: HashSet<[i32; 3]> = voxels.iter().copied().collect();
    let seeds: Vec<[i32; 3]> = {
        let mut near: Vec<(f64, [i32; 3])> =
            voxels.iter().map(|v| ((center(v, voxel_m) - grip).norm(), *v)).filter(|(d, _)| *d <= NEAR_M).collect();
        near.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        near.into_iter().map(|(_, v)| v).collect()
    };
    let Some(&seed) = seeds.first() else { return Vec::new() };
    left.remove(&seed);
    let mut piece = vec![seed];
    let mut next = 0;
    while let Some(&[x, y, z]) = piece.get(next) {
        next += 1;
        for dx in -1..=1 {
            for dy in -1..=1 {
                for dz in -1..=1 {
                    let neighbour = [x + dx, y + dy, z + dz];
                    if left.remove(&neighbour) {
                        piece.push(neighbour);
                    }
                }
            }
        }
    }
    piece.sort_unstable();
    piece
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_view_counts_once_per_voxel() {
        let p = Point::new(0.01, 0.01, 0.01);
        let q = Point::new(-0.01, 0.01, 0.01);
        let counts = count_views(&[(0, p), (0, p), (1, p), (1, q), (3, p)], 0.05);
        assert_eq!(counts[&[0, 0, 0]], 3);
        assert_eq!(counts[&[-1, 0, 0]], 1);
    }

    #[test]
    fn only_the_piece_at_the_hand_is_kept() {
        let near: Vec<[i32; 3]> = (0..5).map(|i| [i, 0, 0]).collect();
        let far: Vec<[i32; 3]> = (10..15).map(|i| [i, 0, 0]).collect();
        let all: Vec<[i32; 3]> = near.iter().chain(&far).copied().collect();
        assert_eq!(connected_with(&all, &Point::new(0.0, 0.05, 0.0), 0.05), near);
        assert!(connected_with(&all, &Point::new(0.0, 9.0, 0.0), 0.05).is_empty());
    }
}
