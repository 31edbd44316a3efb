//! Cells of a room in which something was seen: pieces of dust go, the rest is joined into full boxes.

use std::collections::{BTreeMap, HashSet};

use crate::math::stats;

/// A cell, counted along the grid's axes.
pub(super) type Index = [i32; 3];
/// `[low, high]` along each axis of the grid, metres.
pub(super) type Extent = [[f64; 2]; 3];

/// Least thickness of a box, metres.
const THIN_M: f64 = 0.01;
/// Fewer connected cells than this are specks of noise.
const SPECK: usize = 8;

/// Drops small pieces that hang together with nothing.
pub(super) fn drop_specks(occupied: &mut BTreeMap<Index, Extent>) {
    let mut left: HashSet<Index> = occupied.keys().copied().collect();
    let starts: Vec<Index> = occupied.keys().copied().collect();
    for start in starts {
        if !left.remove(&start) {
            continue;
        }
        let mut piece = vec![start];
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
        if piece.len() < SPECK {
            for index in piece {
                occupied.remove(&index);
            }
        }
    }
}

/// Joins cells into boxes that are full: from each cell that is still free, in order, the largest box that grows axis by
/// axis. Returns the number of cells and the extent of each.
pub(super) fn joined(occupied: &BTreeMap<Index, Extent>) -> Vec<(usize, Extent)> {
    const ORDERS: [[usize; 3]; 6] = [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]];
    let mut free: HashSet<Index> = occupied.keys().copied().collect();
    let mut out = Vec::new();
    for seed in occupied.keys() {
        if !free.contains(seed) {
            continue;
        }
        let mut best = [*seed, *seed];
        for order in ORDERS {
            let block = grow(&free, *seed, order);
            if within(block).count() > within(best).count() {
                best = block;
            }
        }
        let mut count = 0;
        for index in within(best) {
            count += usize::from(free.remove(&index));
        }
        out.push((count, surface(occupied, best)));
    }
    out
}

/// All indices of a block `[low, high]`, both included.
fn within([low, high]: [Index; 2]) -> impl Iterator<Item = Index> {
    (low[0]..=high[0])
        .flat_map(move |x| (low[1]..=high[1]).flat_map(move |y| (low[2]..=high[2]).map(move |z| [x, y, z])))
}

fn grow(free: &HashSet<Index>, seed: Index, order: [usize; 3]) -> [Index; 2] {
    let mut block = [seed, seed];
    for axis in order {
        for (end, step) in [(1, 1), (0, -1)] {
            loop {
                let mut layer = block;
                let at = block[end][axis] + step;
                layer[0][axis] = at;
                layer[1][axis] = at;
                if !within(layer).all(|index| free.contains(&index)) {
                    break;
                }
                block[end][axis] = at;
            }
        }
    }
    block
}

/// Where the surface in a block of cells is: along each axis from the mean low end of the lowest layer to the mean high end
/// of the highest.
fn surface(occupied: &BTreeMap<Index, Extent>, block: [Index; 2]) -> Extent {
    std::array::from_fn(|k| {
        let mean = |end: usize| {
            let mut layer = block;
            layer[0][k] = block[end][k];
            layer[1][k] = block[end][k];
            let ends: Vec<f64> = within(layer).filter_map(|i| occupied.get(&i)).map(|e| e[k][end]).collect();
            stats::mean(&ends).unwrap_or(0.0)
        };
        let (low, high) = (mean(0), mean(1));
        let (middle, half) = (0.5 * (low + high), (0.5 * (high - low)).max(0.5 * THIN_M));
        [middle - half, middle + half]
    })
}
