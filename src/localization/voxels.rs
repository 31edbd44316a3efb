//! A sparse voxel grid that counts distinct views (§3.1).

use std::collections::HashSet;

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

/// Number of distinct views per voxel, `n_v`, by voxel. `seen` lists (view, point), the points of one view together.
#[must_use]
pub fn count_views(seen: &[(u32, Point)], voxel_m: f64) -> Vec<([i32; 3], u32)> {
    let mut table = Table::new();
    let scale = 1.0 / voxel_m;
    // Neighbours in an image fall into one voxel more often than not.
    let (mut last_key, mut last_view) = (Table::EMPTY, u32::MAX);
    for (view, p) in seen {
        let key = pack(p, scale);
        if key == last_key && *view == last_view {
            continue;
        }
        (last_key, last_view) = (key, *view);
        table.count(key, *view);
    }
    let mut counts: Vec<([i32; 3], u32)> =
        table.slots.iter().filter(|s| s.key != Table::EMPTY).map(|s| (unpack(s.key), s.count)).collect();
    counts.sort_unstable_by_key(|(voxel, _)| *voxel);
    counts
}

/// Format: bits of a voxel's index along one axis: 50 km to each side at 5 cm.
const BITS: u32 = 21;
/// Format: index of the origin.
const OFFSET: i64 = 1 << (BITS - 1);

fn pack(p: &Point, scale: f64) -> u64 {
    // Above zero truncation is the floor, without a call.
    let axis = |c: f64| u64::from(((c * scale + OFFSET as f64) as u32).min((1 << BITS) - 1));
    axis(p.x) << (2 * BITS) | axis(p.y) << BITS | axis(p.z)
}

fn unpack(key: u64) -> [i32; 3] {
    [2 * BITS, BITS, 0].map(|shift| ((key >> shift & ((1 << BITS) - 1)) as i64 - OFFSET) as i32)
}

#[derive(Clone, Copy)]
struct Slot {
    key: u64,
    last_view: u32,
    count: u32,
}

/// Open addressing with linear probing: one line of cache a point.
struct Table {
    slots: Vec<Slot>,
    used: usize,
}

impl Table {
    /// Format: no voxel.
    const EMPTY: u64 = u64::MAX;

    fn new() -> Self {
        Self { slots: vec![Slot { key: Self::EMPTY, last_view: 0, count: 0 }; 1 << 14], used: 0 }
    }

    fn home(&self, key: u64) -> usize {
        // Fibonacci hashing: the high bits of the product are mixed best.
        (key.wrapping_mul(0x9E37_79B9_7F4A_7C15) >> (64 - self.slots.len().trailing_zeros())) as usize
    }

    fn slot(&mut self, key: u64) -> &mut Slot {
        let mask = self.slots.len() - 1;
        let mut at = self.home(key) & mask;
        while self.slots[at].key != key && self.slots[at].key != Self::EMPTY {
            at = (at + 1) & mask;
        }
        &mut self.slots[at]
    }

    fn count(&mut self, key: u64, view: u32) {
        let slot = self.slot(key);
        if slot.key == key {
            if slot.last_view != view {
                slot.last_view = view;
                slot.count += 1;
            }
            return;
        }
        *slot = Slot { key, last_view: view, count: 1 };
        self.used += 1;
        if 2 * self.used > self.slots.len() {
            let bigger = vec![Slot { key: Self::EMPTY, last_view: 0, count: 0 }; 2 * self.slots.len()];
            for old in std::mem::replace(&mut self.slots, bigger).into_iter().filter(|s| s.key != Self::EMPTY) {
                *self.slot(old.key) = old;
            }
        }
    }
}

/// Takes out of a set the voxels that hang together with a seed over faces, edges or corners (26 neighbours); the seed comes
/// first, be it in the set or not.
#[must_use]
pub fn take_piece(left: &mut HashSet<[i32; 3]>, seed: [i32; 3]) -> Vec<[i32; 3]> {
    left.remove(&seed);
    let mut piece = vec![seed];
    let mut next = 0;
    while let Some(&[x, y, z]) = piece.get(next) {
        next += 1;
        for i in 0..27 {
            let neighbour = [x + i % 3 - 1, y + i / 3 % 3 - 1, z + i / 9 - 1];
            if left.remove(&neighbour) {
                piece.push(neighbour);
            }
        }
    }
    piece
}

/// The voxels of the connected piece (26 neighbours) nearest to the grip, sorted; empty where none is within `near_m` of it.
#[must_use]
pub fn connected_with(voxels: &[[i32; 3]], grip: &Point, voxel_m: f64, near_m: f64) -> Vec<[i32; 3]> {
    let mut left: HashSet<[i32; 3]> = voxels.iter().copied().collect();
    let seeds: Vec<[i32; 3]> = {
        let mut near: Vec<(f64, [i32; 3])> =
            voxels.iter().map(|v| ((center(v, voxel_m) - grip).norm(), *v)).filter(|(d, _)| *d <= near_m).collect();
        near.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        near.into_iter().map(|(_, v)| v).collect()
    };
    let Some(&seed) = seeds.first() else { return Vec::new() };
    let mut piece = take_piece(&mut left, seed);
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
        assert_eq!(counts, [([-1, 0, 0], 1), ([0, 0, 0], 3)]);
    }

    #[test]
    fn a_hundred_thousand_voxels_far_from_the_origin_are_told_apart() {
        let seen: Vec<(u32, Point)> = (0..100_000u32)
            .map(|i| (i % 2, Point::new(-900.0 + 0.05 * f64::from(i % 300), 700.0, 0.05 * f64::from(i / 300) - 3.0)))
            .map(|(v, p)| (v, p + crate::math::Vector::repeat(0.02)))
            .collect();
        let counts = count_views(&seen, 0.05);
        assert_eq!(counts.len(), 100_000);
        assert!(counts.iter().all(|(_, n)| *n == 1) && counts.is_sorted());
    }

    #[test]
    fn only_the_piece_at_the_hand_is_kept() {
        let near: Vec<[i32; 3]> = (0..5).map(|i| [i, 0, 0]).collect();
        let far: Vec<[i32; 3]> = (10..15).map(|i| [i, 0, 0]).collect();
        let all: Vec<[i32; 3]> = near.iter().chain(&far).copied().collect();
        assert_eq!(connected_with(&all, &Point::new(0.0, 0.05, 0.0), 0.05, 0.2), near);
        assert!(connected_with(&all, &Point::new(0.0, 9.0, 0.0), 0.05, 0.2).is_empty());
    }
}
