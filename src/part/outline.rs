//! Which part of the front face moved: what was there when closed and is empty, or elsewhere, when open (ours).
//!
//! Masks cover whole pieces of furniture; depth before and after the interaction tells the moving part from the rest
//! without knowing the joint.

use super::views::View;
use crate::articulation::Articulation;
use crate::config::{self, Config};
use crate::geometry::{Face, Rect};
use crate::math::Point;

/// A line on a face along one of its axes: (0 = upright or 1 = level, offset, from, to) in face coordinates, metres.
pub type Stop = (usize, f64, [f64; 2]);

/// Cells of a face, row by row from its lower left.
#[derive(Debug, Clone)]
pub(super) struct Grid {
    pub(super) cell_m: f64,
    /// Lower left corner in face coordinates, metres.
    pub(super) origin: [f64; 2],
    pub(super) columns: usize,
    pub(super) rows: usize,
}

/// What the views say about each cell of the face.
#[derive(Debug, Clone)]
pub struct CellVotes {
    grid: Grid,
    /// Surface points on the closed plane.
    closed: Vec<u16>,
    /// Seen on the closed plane while open.
    still: Vec<u16>,
    /// Seen through while open, or seen where the moved part would be.
    gone: Vec<u16>,
    rules: config::OutlineVotes,
    /// Less was seen to move by chance, square metres.
    least_moved_m2: f64,
}

/// What the smallest front has about its grip.
#[must_use]
pub fn smallest(config: &config::Part) -> Rect {
    Rect { bounds: [[-config.smallest_half_m, config.smallest_half_m]; 2] }
}

/// Votes of the closed surface and the open views over the face's visible extent (at most `part.outline.reach_m` from the grip). With
/// a `joint` and its opening in each view, cells also count as moved where the part is seen in its opened place.
#[must_use]
pub fn vote(
    face: &Face,
    surface: &[Point],
    open: &[View],
    joint: Option<(&Articulation, &[f64])>,
    config: &Config,
) -> CellVotes {
    let rules = &config.part.outline;
    let grid = Grid::of(face, config.fitting.cell_m, rules);
    let cells = grid.columns * grid.rows;
    let mut votes = CellVotes {
        closed: grid.surface(face, surface, rules),
        still: vec![0; cells],
        gone: vec![0; cells],
        grid,
        rules: rules.clone(),
        least_moved_m2: config.part.least_moved_m2,
    };
    for i in 0..cells {
        let [right, up] = votes.grid.center(i);
        let here = face.point(right, up, 0.0);
        for (v, view) in open.iter().enumerate() {
            if let Some((gap, z)) = view.gap(&here) {
                votes.still[i] += u16::from(gap.abs() <= view.noise.tolerance(z));
                votes.gone[i] += u16::from(gap > view.noise.tolerance(z) + rules.through_m);
            }
            let Some((joint, opening)) = joint.and_then(|(joint, openings)| Some((joint, *openings.get(v)?))) else {
                continue;
            };
            let motion = joint.motion(opening);
            let moved = motion * here;
            if view.grazes(&moved, &(motion.rotation * face.normal)) {
                continue;
            }
            // Only where the part has moved clear of its own noise.
            if let Some((gap, z)) = view.gap(&moved)
                && (moved - here).norm() > 2.0 * view.noise.tolerance(z)
            {
                votes.gone[i] += u16::from(gap.abs() <= view.noise.tolerance(z));
                votes.still[i] += u16::from(gap > view.noise.tolerance(z));
            }
        }
    }
    votes
}

impl Grid {
    /// Over the face's visible extent, as far as parts reach from the grip.
    pub(super) fn of(face: &Face, cell_m: f64, rules: &config::OutlineVotes) -> Self {
        let low = [0, 1].map(|i| (face.extent[i][0] - rules.margin_m).max(-rules.reach_m));
        let high = [0, 1].map(|i| (face.extent[i][1] + rules.margin_m).min(rules.reach_m));
        let [columns, rows] = [0, 1].map(|i| ((high[i] - low[i]) / cell_m).ceil().max(1.0) as usize);
        Self { cell_m, origin: low, columns, rows }
    }

    /// Surface points on the closed plane, cell by cell.
    pub(super) fn surface(&self, face: &Face, points: &[Point], rules: &config::OutlineVotes) -> Vec<u16> {
        let mut closed = vec![0u16; self.columns * self.rows];
        for p in points {
            let [right, up, out] = face.coordinates(p);
            if let Some(i) = self.index(right, up)
                && out.abs() <= rules.face_m
            {
                closed[i] = closed[i].saturating_add(1);
            }
        }
        closed
    }

    /// Cell of face coordinates; `None` outside.
    fn index(&self, right: f64, up: f64) -> Option<usize> {
        let column = ((right - self.origin[0]) / self.cell_m).floor();
        let row = ((up - self.origin[1]) / self.cell_m).floor();
        let inside = column >= 0.0 && row >= 0.0 && column < self.columns as f64 && row < self.rows as f64;
        inside.then(|| row as usize * self.columns + column as usize)
    }

    /// Centre of a cell in face coordinates.
    pub(super) fn center(&self, cell: usize) -> [f64; 2] {
        let at = |k: usize, i: usize| self.origin[k] + (i as f64 + 0.5) * self.cell_m;
        [at(0, cell % self.columns), at(1, cell / self.columns)]
    }
}

impl CellVotes {
    /// The rectangle of the connected piece of moved cells at the grip; `None` where nothing there is seen to move.
    ///
    /// Where no open view looked, the part goes on: over its closed face up to an edge (`stops`: lines on the face), up to what
    /// is seen to stay, or up to the face's end.
    #[must_use]
    pub fn moving_rect(&self, stops: &[Stop]) -> Option<Rect> {
        let seen = self.seen_rect()?;
        Some(self.on_lines(self.grown(seen, stops), stops))
    }

    /// Moves each side of a rectangle onto the line next to it: fronts end at gaps, which are lines, while cells are coarse and
    /// their votes blurred by the depth's noise. What lies between side and line must not speak against it.
    fn on_lines(&self, rect: Rect, stops: &[Stop]) -> Rect {
        let config::OutlineVotes { side_std_m, line_worth, least_side_m, .. } = self.rules;
        let mut bounds = rect.bounds;
        for axis in [0, 1] {
            let across = rect.bounds[1 - axis];
            let length = across[1] - across[0];
            for side in [0, 1] {
                let edge = rect.bounds[axis][side];
                let worth = |offset: f64, span: [f64; 2]| -> f64 {
                    let covered = ((span[1].min(across[1]) - span[0].max(across[0])) / length).clamp(0.0, 1.0);
                    let outward = (offset - edge) * if side == 0 { -1.0 } else { 1.0 };
                    let [from, to] = if offset < edge { [offset, edge] } else { [edge, offset] };
                    let against = self.against(axis, [from, to], across, outward > 0.0);
                    covered * (-0.5 * ((offset - edge) / side_std_m).powi(2)).exp() * (1.0 - against)
                };
                let best = stops
                    .iter()
                    .filter(|(a, ..)| *a == axis)
                    .map(|(_, offset, span)| (worth(*offset, *span), *offset))
                    .max_by(|a, b| a.0.total_cmp(&b.0));
                if let Some((worth, offset)) = best
                    && worth > line_worth
                {
                    bounds[axis][side] = offset;
                }
            }
        }
        // Two sides on one line are no rectangle.
        if bounds.iter().any(|b| b[1] - b[0] < least_side_m) { rect } else { Rect { bounds } }
    }

    /// How much of the front a leaf that slides within it has left free, metres: the width along `axis` (0 = right, 1 = up) of
    /// the strip at the grip that is seen through over the rows `across`. `None` where no view saw enough of it.
    #[must_use]
    pub fn vacated(&self, axis: usize, across: [f64; 2]) -> Option<f64> {
        let config::OutlineVotes { vacated_cells, vacated_still, vacated_m, .. } = self.rules;
        let count = [self.grid.columns, self.grid.rows][axis];
        let rows = ((across[1] - across[0]) / self.grid.cell_m).round().max(1.0) as usize;
        // Of each line of cells across the slide: seen through (1) or there as before (-1).
        let balance = |i: usize| -> f64 {
            let along = self.grid.origin[axis] + (i as f64 + 0.5) * self.grid.cell_m;
            let (mut gone, mut seen) = (0usize, 0usize);
            for k in 0..rows {
                let other = across[0] + (k as f64 + 0.5) * self.grid.cell_m;
                let cell = if axis == 0 { self.grid.index(along, other) } else { self.grid.index(other, along) };
                let Some(cell) = cell.filter(|&c| self.closed[c] > 0 && self.gone[c] != self.still[c]) else {
                    continue;
                };
                seen += 1;
                gone += usize::from(self.gone[cell] > self.still[cell]);
            }
            if seen < vacated_cells { 0.0 } else { 2.0 * gone as f64 / seen as f64 - 1.0 }
        };
        let line: Vec<f64> = (0..count).map(balance).collect();
        // Of all stretches the one whose lines add up to most. It begins and ends where a line is seen through: what nobody saw
        // is no part of it.
        let (mut best, mut strip) = (0.0, None);
        for from in (0..count).filter(|&i| line[i] > 0.0) {
            let (mut sum, mut still) = (0.0, 0);
            for (to, balance) in line.iter().enumerate().skip(from) {
                sum += balance;
                still = if *balance < 0.0 { still + 1 } else { 0 };
                // Beyond so much that stayed it is another place.
                if still > vacated_still {
                    break;
                }
                let [low, high] = [from, to + 1].map(|i| self.grid.origin[axis] + i as f64 * self.grid.cell_m);
                if sum > best && low < vacated_m && high > -vacated_m {
                    (best, strip) = (sum, Some(high - low));
                }
            }
        }
        strip
    }

    /// Of the cells of a strip that open views saw, the share that was seen to stay (for a strip to be added) or to move (for
    /// one to be taken away).
    fn against(&self, axis: usize, strip: [f64; 2], across: [f64; 2], added: bool) -> f64 {
        let steps = |b: [f64; 2]| ((b[1] - b[0]) / self.grid.cell_m).floor().max(0.0) as usize;
        let (mut seen, mut against) = (0usize, 0usize);
        for i in 0..steps(strip) {
            for k in 0..steps(across) {
                let (x, y) =
                    (strip[0] + (i as f64 + 0.5) * self.grid.cell_m, across[0] + (k as f64 + 0.5) * self.grid.cell_m);
                let Some(cell) = (if axis == 0 { self.grid.index(x, y) } else { self.grid.index(y, x) }) else {
                    continue;
                };
                let (still, gone) = (self.still[cell], self.gone[cell]);
                seen += usize::from(still != gone);
                against += usize::from(if added { still > gone } else { gone > still });
            }
        }
        against as f64 / seen.max(1) as f64
    }

    /// Extends a rectangle side by side over cells that no open view saw.
    fn grown(&self, rect: Rect, stops: &[Stop]) -> Rect {
        let mut bounds = rect.bounds;
        for axis in [0, 1] {
            let across = bounds[1 - axis];
            let count = ((across[1] - across[0]) / self.grid.cell_m).round().max(1.0) as usize;
            for (side, sign) in [(0, -1.0), (1, 1.0)] {
                loop {
                    let edge = bounds[axis][side];
                    let next = edge + sign * 0.5 * self.grid.cell_m;
                    let cells: Vec<usize> = (0..count)
                        .filter_map(|k| {
                            let along = across[0] + (k as f64 + 0.5) * self.grid.cell_m;
                            if axis == 0 { self.grid.index(next, along) } else { self.grid.index(along, next) }
                        })
                        .collect();
                    // Half of the edge's length must be face, and less than half of it seen to stay (beside a hinge a
                    // door hardly moves).
                    let face = cells.iter().filter(|&&i| self.closed[i] > 0).count();
                    let known = cells.iter().filter(|&&i| self.still[i] > 0).count();
                    let stopped = stops.iter().any(|(a, offset, span)| {
                        let covers = span[1].min(across[1]) - span[0].max(across[0]);
                        *a == axis
                            && (offset - edge).abs() <= self.grid.cell_m
                            && covers > self.rules.stop_share * (across[1] - across[0])
                    });
                    if stopped || 2 * face < count || 2 * known > count {
                        break;
                    }
                    bounds[axis][side] += sign * self.grid.cell_m;
                }
            }
        }
        Rect { bounds }
    }

    fn seen_rect(&self) -> Option<Rect> {
        let moving: Vec<bool> =
            (0..self.closed.len()).map(|i| self.gone[i] > self.still[i] && self.closed[i] > 0).collect();
        let piece = self.piece_at_grip(&moving)?;
        if piece.len() as f64 * self.grid.cell_m * self.grid.cell_m < self.least_moved_m2 {
            return None;
        }
        let (mut by_column, mut by_row) = (vec![0usize; self.grid.columns], vec![0usize; self.grid.rows]);
        for &i in &piece {
            by_column[i % self.grid.columns] += 1;
            by_row[i / self.grid.columns] += 1;
        }
        // A rectangle's rows are equally full: rows with under a third of the fullest are fringe.
        let span = |counts: &[usize], origin: f64| -> Option<[f64; 2]> {
            let limit = counts.iter().max()? / 3;
            let first = counts.iter().position(|&c| c > limit)?;
            let last = counts.iter().rposition(|&c| c > limit)?;
            Some([origin + first as f64 * self.grid.cell_m, origin + (last + 1) as f64 * self.grid.cell_m])
        };
        Some(Rect { bounds: [span(&by_column, self.grid.origin[0])?, span(&by_row, self.grid.origin[1])?] })
    }

    /// The 4-connected piece of marked cells at the grip (the face's origin), if any is near it.
    fn piece_at_grip(&self, marked: &[bool]) -> Option<Vec<usize>> {
        let distance = |i: usize| {
            let [r, u] = self.grid.center(i);
            r.hypot(u)
        };
        let mut taken = vec![false; marked.len()];
        let mut best: Option<Vec<usize>> = None;
        for start in 0..marked.len() {
            if !marked[start] || taken[start] || distance(start) > self.rules.piece_m {
                continue;
            }
            taken[start] = true;
            let mut piece = vec![start];
            let mut next = 0;
            while let Some(&i) = piece.get(next) {
                next += 1;
                let (c, r) = (i % self.grid.columns, i / self.grid.columns);
                let neighbours = [
                    (c > 0).then(|| i - 1),
                    (c + 1 < self.grid.columns).then(|| i + 1),
                    (r > 0).then(|| i - self.grid.columns),
                    (r + 1 < self.grid.rows).then(|| i + self.grid.columns),
                ];
                for n in neighbours.into_iter().flatten() {
                    if marked[n] && !taken[n] {
                        taken[n] = true;
                        piece.push(n);
                    }
                }
            }
            // Noise makes islands: of the pieces near the grip the largest is the part.
            if best.as_ref().is_none_or(|b| piece.len() > b.len()) {
                best = Some(piece);
            }
        }
        best
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A face of 2 cm cells, seen closed all over, with nothing known of the open state.
    fn votes(columns: usize, rows: usize) -> CellVotes {
        let cells = columns * rows;
        CellVotes {
            grid: Grid { cell_m: 0.02, origin: [-0.4, -0.3], columns, rows },
            closed: vec![1; cells],
            still: vec![0; cells],
            gone: vec![0; cells],
            rules: config::OutlineVotes::default(),
            least_moved_m2: 0.02,
        }
    }

    #[test]
    fn fringe_and_islands_do_not_widen_the_part() {
        let (columns, rows) = (40, 30);
        let mut votes = votes(columns, rows);
        votes.still.fill(1);
        for r in 5..25 {
            for c in 10..30 {
                votes.gone[r * columns + c] = 3;
            }
        }
        for c in 30..38 {
            votes.gone[15 * columns + c] = 3;
        }
        votes.gone[2 * columns + 2] = 9;
        let rect = votes.moving_rect(&[]).unwrap();
        for (found, expected) in rect.bounds.iter().flatten().zip([-0.2, 0.2, -0.2, 0.2]) {
            assert!((found - expected).abs() < 1e-9, "{rect:?}");
        }
        votes.gone.fill(0);
        assert!(votes.moving_rect(&[]).is_none());
    }

    #[test]
    fn a_part_goes_on_where_nobody_looked_until_an_edge() {
        let (columns, rows) = (40, 60);
        let mut votes = votes(columns, rows);
        for r in 0..60 {
            for c in 0..40 {
                let inside = (10..30).contains(&c) && (5..25).contains(&r);
                votes.gone[r * columns + c] = u16::from(inside) * 3;
                // Beside and below it the furniture is seen to stay; nobody looked up.
                votes.still[r * columns + c] = u16::from(!inside && r < 25) * 3;
            }
        }
        let line = [(1, 0.54, [-0.5, 0.5])];
        let rect = votes.moving_rect(&line).unwrap();
        for (found, expected) in rect.bounds.iter().flatten().zip([-0.2, 0.2, -0.2, 0.54]) {
            assert!((found - expected).abs() < 0.021, "{rect:?}");
        }
    }

    #[test]
    fn the_place_that_a_sliding_leaf_left_is_as_wide_as_it_went() {
        let (columns, rows) = (40, 30);
        let mut votes = votes(columns, rows);
        votes.still.fill(2);
        let mut free = |from: usize, to: usize| {
            for r in 3..27 {
                for c in from..to {
                    votes.gone[r * columns + c] = 3;
                }
            }
        };
        // Nine cells at the grip; a wider place far from it, which another leaf left.
        free(18, 27);
        free(33, 40);
        // Beside it there is no face.
        for r in 0..rows {
            for c in 0..18 {
                votes.closed[r * columns + c] = 0;
            }
        }
        let across = [-0.24, 0.24];
        assert!((votes.vacated(0, across).unwrap() - 0.18).abs() < 1e-9);
        // Of a few cells a line says nothing.
        assert_eq!(votes.vacated(0, [0.0, 0.04]), None);
        votes.gone.fill(0);
        assert_eq!(votes.vacated(0, across), None);
    }
}
