//! Few boxes for many cells: each one as large as what was seen through lets it be (ours).
//!
//! A block of cells is worth the surface in it, less the cells in it that were seen through. What is unknown, the inside of
//! furniture and what lies behind walls, costs next to nothing, so that a row of fronts and the worktop above become one box.
//! From seeds all over the surface blocks grow and shrink side by side while that raises their worth; the best one stays, its
//! surface hardly counts any more, and so on until none has enough that is new. Each is then grown once more among the others.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BinaryHeap};

use rayon::prelude::*;

use super::cells::{Block, Extent, Index, Known, layer, within};
use crate::config;
use crate::math::stats;

/// Arithmetic: worth of a cell with a surface, the unit of all others.
const SURFACE: i32 = 1000;
/// Arithmetic: of one that furniture or the way of a part takes, more against it than any block has.
const TAKEN: i32 = -100_000_000;
/// Numerics: cells of which a tile is made at the most; each costs 13 bytes.
const TILE_CELLS: i64 = 2_000_000;
/// Numerics: by how many cells a side moves.
const STEPS: [i32; 10] = [1, 2, 4, 8, 16, 32, -1, -2, -4, -8];

/// What a block must be.
#[derive(Debug, Clone, Copy)]
pub(super) struct Limits {
    /// Cells of surface that no other block has, at least.
    pub(super) surface: usize,
    /// Cells along its shortest side, at most.
    pub(super) solid: i32,
}

/// Blocks that together cover the surface, with the number of cells of surface in each: by falling number.
pub(super) fn blocks(known: &Known, limits: &Limits, rules: &config::Cover) -> Vec<(usize, Block)> {
    let mut tiles = Vec::new();
    split(known.occupied.keys().copied().collect(), &mut tiles);
    let mut out: Vec<(usize, Block)> = Vec::new();
    for bounds in tiles {
        let chosen = Tile::of(bounds, known, rules).cover(limits);
        let surface = |block: &Block| within(*block).filter(|index| known.occupied.contains_key(index)).count();
        out.extend(chosen.iter().map(|block| (surface(block), *block)));
    }
    out.sort_by_key(|(count, block)| (Reverse(*count), *block));
    out
}

/// Bounds of cells, split until a tile holds them. Cells are sorted, and so are both halves.
fn split(cells: Vec<Index>, tiles: &mut Vec<Block>) {
    let Some(&first) = cells.first() else { return };
    let mut bounds = [first, first.map(|i| i + 1)];
    for index in &cells {
        for (k, i) in index.iter().enumerate() {
            bounds[0][k] = bounds[0][k].min(*i);
            bounds[1][k] = bounds[1][k].max(*i + 1);
        }
    }
    let sides: [i64; 3] = std::array::from_fn(|k| i64::from(bounds[1][k]) - i64::from(bounds[0][k]));
    let count = sides.iter().fold(1i64, |product, side| product.saturating_mul(*side));
    if count <= TILE_CELLS {
        tiles.push(bounds);
        return;
    }
    let longest = (0..3).max_by_key(|&k| sides[k]).unwrap_or(0);
    let middle = bounds[0][longest] + (sides[longest] / 2) as i32;
    let (low, high): (Vec<Index>, Vec<Index>) = cells.into_iter().partition(|index| index[longest] < middle);
    split(low, tiles);
    split(high, tiles);
}

/// Cells in the bounds of a part of the room.
struct Tile<'a> {
    rules: &'a config::Cover,
    low: Index,
    size: [usize; 3],
    /// Worth of each cell as it was seen, the third index runs fastest.
    worth: Vec<i32>,
    /// How many of the chosen blocks hold it.
    covers: Vec<u8>,
    /// Worth of all cells below, before and beside each corner of a cell.
    sums: Vec<i64>,
}

impl<'a> Tile<'a> {
    fn of([low, high]: Block, known: &Known, rules: &'a config::Cover) -> Self {
        let size: [usize; 3] = std::array::from_fn(|k| usize::try_from(high[k] - low[k]).unwrap_or(0));
        let mut tile = Self { rules, low, size, worth: Vec::new(), covers: Vec::new(), sums: Vec::new() };
        let count: usize = size.iter().product();
        let corners: usize = size.iter().map(|n| n + 1).product();
        tile.worth = vec![-rules.unknown; count];
        for run in known.free {
            for z in run.span[0].max(low[2])..=run.span[1].min(high[2] - 1) {
                tile.set(&[run.column[0], run.column[1], z], -rules.seen_through);
            }
        }
        known.occupied.keys().for_each(|index| tile.set(index, SURFACE));
        known.taken.iter().for_each(|index| tile.set(index, TAKEN));
        tile.covers = vec![0; count];
        tile.sums = vec![0; corners];
        tile.sum();
        tile
    }

    /// Sums the worth of all cells, covered or not.
    fn sum(&mut self) {
        let [nx, ny, nz] = self.size;
        let (row, slice) = (nz + 1, (ny + 1) * (nz + 1));
        for x in 0..nx {
            for y in 0..ny {
                let mut line = 0i64;
                for z in 0..nz {
                    let cell = (x * ny + y) * nz + z;
                    let covered = self.worth[cell] == SURFACE && self.covers[cell] > 0;
                    line += i64::from(if covered { self.rules.covered } else { self.worth[cell] });
                    let at = (x + 1) * slice + (y + 1) * row + z + 1;
                    self.sums[at] = line + self.sums[at - row] + self.sums[at - slice] - self.sums[at - slice - row];
                }
            }
        }
    }

    /// Worth of a block inside of the tile.
    fn value(&self, [low, high]: &Block) -> i64 {
        let [_, ny, nz] = self.size;
        let from = |k: usize, corner: &Index| (corner[k] - self.low[k]) as usize;
        let sum = |x: usize, y: usize, z: usize| self.sums[(x * (ny + 1) + y) * (nz + 1) + z];
        let [x, y, z] = [0, 1, 2].map(|k| [from(k, low), from(k, high)]);
        sum(x[1], y[1], z[1]) - sum(x[0], y[1], z[1]) - sum(x[1], y[0], z[1]) - sum(x[1], y[1], z[0])
            + sum(x[0], y[0], z[1])
            + sum(x[0], y[1], z[0])
            + sum(x[1], y[0], z[0])
            - sum(x[0], y[0], z[0])
    }

    /// A block with its sides moved, one after the other the one that helps most, until none helps.
    fn grown(&self, mut block: Block, limits: &Limits) -> (i64, Block) {
        let mut worth = self.value(&block);
        loop {
            let mut best: Option<(i64, Block)> = None;
            for (axis, end, step) in moves() {
                let Some(moved) = self.moved(&block, axis, end, step, limits) else { continue };
                let value = self.value(&moved);
                if value > best.map_or(worth, |(value, _)| value) {
                    best = Some((value, moved));
                }
            }
            let Some((value, moved)) = best else { return (worth, block) };
            (worth, block) = (value, moved);
        }
    }

    /// A block with one side further out by so many cells, within the tile; `None` where that is no block, or no other one.
    fn moved(&self, block: &Block, axis: usize, end: usize, step: i32, limits: &Limits) -> Option<Block> {
        let mut moved = *block;
        let out = if end == 0 { -step } else { step };
        moved[end][axis] = (moved[end][axis] + out).clamp(self.low[axis], self.low[axis] + self.size[axis] as i32);
        let shortest = (0..3).map(|k| moved[1][k] - moved[0][k]).min()?;
        (moved != *block && (1..=limits.solid).contains(&shortest)).then_some(moved)
    }

    /// The place of a cell in the lists; `None` outside of the tile.
    fn place(&self, index: &Index) -> Option<usize> {
        (0..3).try_fold(0, |at, k| {
            let along = usize::try_from(i64::from(index[k]) - i64::from(self.low[k])).ok()?;
            (along < self.size[k]).then_some(at * self.size[k] + along)
        })
    }

    fn set(&mut self, index: &Index, worth: i32) {
        if let Some(cell) = self.place(index).and_then(|at| self.worth.get_mut(at)) {
            *cell = worth;
        }
    }

    /// Cells of surface in a block that no chosen block has.
    fn fresh(&self, block: &Block) -> usize {
        let is_new = |at: usize| self.worth.get(at) == Some(&SURFACE) && self.covers.get(at) == Some(&0);
        within(*block).filter(|index| self.place(index).is_some_and(is_new)).count()
    }

    /// Counts the cells of a block as covered once more, or once less.
    fn mark(&mut self, block: &Block, covered: bool) {
        for index in within(*block) {
            if let Some(count) = self.place(&index).and_then(|at| self.covers.get_mut(at)) {
                *count = if covered { count.saturating_add(1) } else { count.saturating_sub(1) };
            }
        }
        self.sum();
    }

    /// The middle one of the surface's cells in each cube of some cells.
    fn seeds(&self) -> Vec<Index> {
        let high: Index = std::array::from_fn(|k| self.low[k] + self.size[k] as i32);
        let mut cubes: BTreeMap<Index, Vec<Index>> = BTreeMap::new();
        for (index, _) in within([self.low, high]).zip(&self.worth).filter(|(_, worth)| **worth == SURFACE) {
            cubes.entry(index.map(|i| i.div_euclid(self.rules.seed_cells))).or_default().push(index);
        }
        cubes.values().filter_map(|cells| cells.get(cells.len() / 2)).copied().collect()
    }

    fn cover(mut self, limits: &Limits) -> Vec<Block> {
        let seeds = self.seeds();
        let mut grown: Vec<(i64, Block)> =
            seeds.par_iter().map(|seed| self.grown([*seed, seed.map(|i| i + 1)], limits)).collect();
        let mut chosen: Vec<Block> = Vec::new();
        // What a block is worth falls with every other one that is chosen: it is looked at again only where it may be the best.
        let mut queue: BinaryHeap<(i64, Reverse<usize>, usize)> =
            grown.iter().enumerate().map(|(seed, (worth, _))| (*worth, Reverse(seed), 0)).collect();
        while let Some((worth, Reverse(seed), judged)) = queue.pop() {
            if worth < limits.surface as i64 * i64::from(SURFACE) {
                break;
            }
            let Some(at) = grown.get_mut(seed) else { continue };
            if judged < chosen.len() {
                *at = self.grown(at.1, limits);
                queue.push((at.0, Reverse(seed), chosen.len()));
                continue;
            }
            let block = at.1;
            if self.fresh(&block) >= limits.surface {
                chosen.push(block);
                self.mark(&block, true);
            }
        }
        self.settled(&chosen, limits)
    }

    /// Each block grown once more among the others, the last one first; those that have nothing new there go.
    fn settled(mut self, chosen: &[Block], limits: &Limits) -> Vec<Block> {
        let mut kept = Vec::new();
        for block in chosen.iter().rev() {
            self.mark(block, false);
            let (_, block) = self.grown(*block, limits);
            if self.fresh(&block) >= limits.surface {
                self.mark(&block, true);
                kept.push(block);
            }
        }
        kept
    }
}

/// All moves of a block's sides: axis, end, cells outwards.
fn moves() -> impl Iterator<Item = (usize, usize, i32)> {
    (0..3).flat_map(|axis| [0, 1].into_iter().flat_map(move |end| STEPS.into_iter().map(move |step| (axis, end, step))))
}

/// Where the faces of a block lie along the grid's axes, metres: at the surfaces in its outermost layers, else at the cells'
/// borders.
pub(super) fn extent(block: &Block, known: &Known, edge: f64, face_share: f64) -> Extent {
    std::array::from_fn(|axis| {
        let [low, high] = [0, 1].map(|end| face(block, (axis, end), known, edge, face_share));
        [low.min(high), low.max(high)]
    })
}

fn face(block: &Block, (axis, end): (usize, usize), known: &Known, edge: f64, face_share: f64) -> f64 {
    let [low, high] = [block[0][axis], block[1][axis]];
    let (outermost, inward, border) = if end == 0 { (low, 1, low) } else { (high - 1, -1, high) };
    // A layer that holds only the rim of a worktop, or the end of a handle, lies before the face.
    for step in 0..(high - low).min(2) {
        let at = outermost + inward * step;
        let seen: Vec<[f64; 2]> =
            layer(block, axis, at).filter_map(|index| known.occupied.get(&index)).map(|extent| extent[axis]).collect();
        if (seen.len() as f64) < face_share * layer(block, axis, at).count() as f64 {
            continue;
        }
        // Noise spreads a surface to both sides; where sight ends at it, it is in the middle.
        let open = is_open(block, axis, at - inward, -inward, known);
        let place = |ends: &[f64; 2]| {
            if open && ends[1] - ends[0] < 0.5 * edge { 0.5 * (ends[0] + ends[1]) } else { ends[end] }
        };
        let places: Vec<f64> = seen.iter().map(place).collect();
        // Between two fronts that are a few centimetres apart, else at the one that is most of the face.
        let quartiles = [0.25, 0.75].map(|q| stats::quantile(&places, q).unwrap_or(f64::from(border) * edge));
        return 0.5 * (quartiles[0] + quartiles[1]);
    }
    f64::from(border) * edge
}

/// Whether half of a layer, or of the next one outwards, was seen through: at a surface the first one is too near to it.
pub(super) fn is_open(block: &Block, axis: usize, at: i32, outward: i32, known: &Known) -> bool {
    [at, at + outward].iter().any(|at| known.share(block, axis, *at, |index| known.is_free(index)) >= 0.5)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pipeline::FreeRun;
    use std::collections::HashSet;

    const EDGE: f64 = 0.05;
    const LIMITS: Limits = Limits { surface: 40, solid: 20 };

    fn filled(index: Index) -> Extent {
        index.map(|i| [f64::from(i) * EDGE, f64::from(i + 1) * EDGE])
    }

    /// A cupboard of 40 x 12 x 18 cells from the origin on, of which front (towards -y), top and one side were seen, and the air
    /// before and above it, two cells away.
    fn cupboard() -> (BTreeMap<Index, Extent>, Vec<FreeRun>) {
        let all = within([[0, 0, 0], [40, 12, 18]]).filter(|[x, y, z]| *y == 0 || *z == 17 || *x == 39);
        let occupied = all.map(|index| (index, filled(index))).collect();
        let mut free = Vec::new();
        for x in -10..50 {
            for y in -15..12 {
                let low = if y < -1 || x > 40 { 0 } else { 19 };
                free.push(FreeRun { column: [x, y], span: [low, 30] });
            }
        }
        (occupied, free)
    }

    #[test]
    fn three_sides_of_a_cupboard_become_one_box_through_its_unseen_inside() {
        let (occupied, free) = cupboard();
        let seen = occupied.len();
        let known = Known { occupied, free: &free, taken: HashSet::new() };
        assert_eq!(blocks(&known, &LIMITS, &config::Cover::default()), [(seen, [[0, 0, 0], [40, 12, 18]])]);
    }

    #[test]
    fn what_was_seen_through_is_not_filled() {
        // The same with a niche in its front, half a metre wide, 0.4 m tall and deep: its back and floor were seen.
        let (mut occupied, mut free) = cupboard();
        occupied.retain(|[x, y, z], _| !((10..20).contains(x) && *y == 0 && (5..13).contains(z)));
        for index in within([[10, 8, 4], [20, 9, 13]]).chain(within([[10, 0, 4], [20, 8, 5]])) {
            occupied.insert(index, filled(index));
        }
        for x in 10..20 {
            for y in 0..8 {
                free.push(FreeRun { column: [x, y], span: [5, 12] });
            }
        }
        free.sort_by_key(|run| (run.column, run.span));
        let known = Known { occupied, free: &free, taken: HashSet::new() };
        let found = blocks(&known, &LIMITS, &config::Cover::default());
        assert!((2..8).contains(&found.len()), "{found:?}");
        let inside =
            |index: &Index| found.iter().any(|(_, [low, high])| (0..3).all(|k| (low[k]..high[k]).contains(&index[k])));
        let filled = within([[10, 0, 5], [20, 8, 13]]).filter(inside).count();
        let covered = known.occupied.keys().filter(|i| inside(i)).count();
        assert!(filled < 40 && covered + 120 > known.occupied.len(), "{filled} {covered} {found:?}");
    }

    #[test]
    fn nothing_grows_into_what_is_taken_and_small_things_get_no_box() {
        let (mut occupied, free) = cupboard();
        let taken: HashSet<Index> = within([[15, -5, 0], [25, 12, 17]]).collect();
        occupied.retain(|index, _| !taken.contains(index));
        // 30 cells that stand alone.
        occupied.extend(within([[60, 0, 0], [65, 6, 1]]).map(|index| (index, filled(index))));
        let known = Known { occupied, free: &free, taken };
        let found = blocks(&known, &LIMITS, &config::Cover::default());
        assert_eq!(found.len(), 3, "{found:?}");
        for (_, block) in &found {
            assert!(within(*block).all(|index| !known.taken.contains(&index)), "{block:?}");
            assert!(block[1][0] <= 40 && block[1][2] == 18, "{block:?}");
        }
    }

    #[test]
    fn a_room_that_no_tile_holds_is_covered_in_parts() {
        // A floor 15 m wide and one 10 m above it.
        let level = |z: i32| (0..300).flat_map(move |x| (0..300).map(move |y| [x, y, z]));
        let mut tiles = Vec::new();
        split(
            level(0).chain(level(200)).collect::<std::collections::BTreeSet<Index>>().into_iter().collect(),
            &mut tiles,
        );
        assert!(tiles.len() > 1, "{tiles:?}");
        for [low, high] in &tiles {
            assert!((0..3).map(|k| i64::from(high[k] - low[k])).product::<i64>() <= TILE_CELLS);
        }
        let held: usize = tiles.iter().map(|b| within(*b).filter(|[_, _, z]| *z == 0 || *z == 200).count()).sum();
        assert_eq!(held, 2 * 300 * 300);
    }

    #[test]
    fn faces_lie_at_surfaces_and_a_rim_does_not_move_them() {
        // A worktop whose rim is a cell before the front; the surface of the front at y = 0.02, that of the top at z = 0.88.
        let (occupied, free) = cupboard();
        let mut occupied: BTreeMap<Index, Extent> = occupied;
        occupied.extend((0..40).map(|x| ([x, -1, 17], filled([x, -1, 17]))));
        for (index, extent) in &mut occupied {
            if index[1] == 0 {
                extent[1] = [0.01, 0.03];
            }
            if index[2] == 17 {
                extent[2] = [0.87, 0.89];
            }
        }
        let known = Known { occupied, free: &free, taken: HashSet::new() };
        let [x, y, z] = extent(&[[0, -1, 0], [40, 12, 18]], &known, EDGE, 0.25);
        assert!((y[0] - 0.02).abs() < 1e-9 && (z[1] - 0.88).abs() < 1e-9, "{y:?} {z:?}");
        assert!(
            (x[1] - 2.0).abs() < 1e-9 && x[0].abs() < 1e-9 && (y[1] - 0.6).abs() < 1e-9 && z[0].abs() < 1e-9,
            "{x:?}"
        );
    }
}
