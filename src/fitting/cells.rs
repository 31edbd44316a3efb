//! Cells of a room: those in which something was seen, those that are known to be empty, and those that furniture takes.

use std::collections::{BTreeMap, HashSet};

use crate::localization::voxels::take_piece;
use crate::pipeline::FreeRun;

/// A cell, counted along the grid's axes.
pub(super) type Index = [i32; 3];
/// `[low, high]` along each axis of the grid, metres.
pub(super) type Extent = [[f64; 2]; 3];
/// A block of cells: the lowest index of each axis, and the first one beyond the highest.
pub(super) type Block = [Index; 2];

/// What is known of the cells around furniture. A cell that is none of these is unknown.
pub(super) struct Known<'a> {
    /// With a surface, and where it lies.
    pub(super) occupied: BTreeMap<Index, Extent>,
    /// Seen through, by column and span.
    pub(super) free: &'a [FreeRun],
    /// On the way of a part, or of furniture that is there already.
    pub(super) taken: HashSet<Index>,
}

impl Known<'_> {
    /// Whether a cell was seen through.
    pub(super) fn is_free(&self, index: &Index) -> bool {
        let [x, y, z] = *index;
        let after = self.free.partition_point(|run| (run.column, run.span[0]) <= ([x, y], z));
        let run = after.checked_sub(1).and_then(|i| self.free.get(i));
        run.is_some_and(|run| run.column == [x, y] && z <= run.span[1])
    }

    /// Share of a layer's cells for which something holds.
    pub(super) fn share(&self, block: &Block, axis: usize, at: i32, holds: impl Fn(&Index) -> bool) -> f64 {
        let (mut all, mut held) = (0u32, 0u32);
        for index in layer(block, axis, at) {
            all += 1;
            held += u32::from(holds(&index));
        }
        f64::from(held) / f64::from(all.max(1))
    }
}

/// All cells of a block.
pub(super) fn within([low, high]: Block) -> impl Iterator<Item = Index> {
    (low[0]..high[0]).flat_map(move |x| (low[1]..high[1]).flat_map(move |y| (low[2]..high[2]).map(move |z| [x, y, z])))
}

/// The cells of a block's cross-section at an index along an axis, which may lie beside the block.
pub(super) fn layer(block: &Block, axis: usize, at: i32) -> impl Iterator<Item = Index> + use<> {
    let [mut low, mut high] = *block;
    low[axis] = at;
    high[axis] = at + 1;
    within([low, high])
}

/// Drops pieces of less cells that hang together with nothing.
pub(super) fn drop_specks(occupied: &mut BTreeMap<Index, Extent>, least: usize) {
    let mut left: HashSet<Index> = occupied.keys().copied().collect();
    let starts: Vec<Index> = occupied.keys().copied().collect();
    for start in starts {
        if !left.contains(&start) {
            continue;
        }
        let piece = take_piece(&mut left, start);
        if piece.len() < least {
            for index in piece {
                occupied.remove(&index);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn free_cells_are_those_of_the_runs() {
        let runs = [
            FreeRun { column: [0, 0], span: [2, 4] },
            FreeRun { column: [0, 0], span: [7, 7] },
            FreeRun { column: [0, 1], span: [-3, -1] },
        ];
        let known = Known { occupied: BTreeMap::new(), free: &runs, taken: HashSet::new() };
        let found: Vec<i32> = (-5..9).filter(|&z| known.is_free(&[0, 0, z])).collect();
        assert_eq!(found, [2, 3, 4, 7]);
        let found: Vec<i32> = (-5..9).filter(|&z| known.is_free(&[0, 1, z])).collect();
        assert_eq!(found, [-3, -2, -1]);
        assert!(!known.is_free(&[-1, 9, 0]) && !known.is_free(&[1, 0, 0]));
        assert_eq!(known.share(&[[0, 0, 0], [1, 2, 8]], 0, 0, |i| known.is_free(i)), 4.0 / 16.0);
    }
}
