//! The outline of a part whose joint and openings are known: of all rectangles on its face the one that explains best what is
//! seen of it closed and open (ours).
//!
//! Before the joint is known [`super::outline`] says roughly what moved. With it, every cell of the face is asked the same
//! in every view: is there a surface where the joint would have taken it, and is its closed place seen through? A cell beside
//! the hinge has no answer, so a door goes on to its hinge; below an open drawer its place would be in the air, which is seen
//! through. Gaps between fronts are lines, the grip is on the part, and parts are as large as fronts are.

use super::leaf::{self, Leaf};
use super::outline::{Grid, Stop, smallest};
use super::views::View;
use crate::articulation::{Articulation, JointKind};
use crate::config::{self, Config};
use crate::geometry::{Face, Rect};
use crate::math::{Point, Pose, Vector};

/// A part as it was seen.
#[derive(Debug, Clone, Copy)]
pub struct Seen<'a> {
    /// Of the part.
    pub face: &'a Face,
    /// What is known of the outline so far.
    pub rect: &'a Rect,
    /// Points of the furniture, world.
    pub surface: &'a [Point],
    /// Of the open state.
    pub views: &'a [View<'a>],
    /// Of the part.
    pub joint: &'a Articulation,
    /// In each view, rad or m.
    pub openings: &'a [f64],
    /// Lines on the face.
    pub stops: &'a [Stop],
}

/// The part's outline, of a part as thick as a board. `None` where next to nothing of it is seen to move.
#[must_use]
pub fn fit(seen: &Seen, config: &Config) -> Option<Rect> {
    // What is beside the part tells each view's own depth error, and is known better once the part is.
    let first = fitted(seen, config)?;
    fitted(&Seen { rect: &first, ..*seen }, config).or(Some(first))
}

fn fitted(seen: &Seen, config: &Config) -> Option<Rect> {
    let rules = &config.part.front;
    let evidence = Evidence::of(seen, config);
    let marks = [0, 1].map(|axis| Marks::of(axis, &evidence.grid, seen.stops));
    let hinge = hinge_side(seen.face, seen.joint, rules);
    let rect_at = |at: &[[usize; 2]; 2]| Rect { bounds: [0, 1].map(|k| at[k].map(|i| marks[k].offsets[i])) };
    let worth = |at: &[[usize; 2]; 2]| {
        let rect = rect_at(at);
        let sides = [0, 1].map(|k| {
            let across = rect.bounds[1 - k];
            let told = |end: usize| marks[k].covered(at[k][end], across).max(evidence.ended(k, end, &rect));
            told(0) + told(1)
        });
        evidence.nats(&rect) + prior(&rect, hinge, config) + rules.on_line_nats * sides.iter().sum::<f64>()
    };
    // From what is known, from the grip alone, and from all that can be seen.
    let smallest = smallest(&config.part);
    let starts = [
        [0, 1].map(|k| seen.rect.bounds[k].map(|x| marks[k].nearest(x))),
        [0, 1].map(|k| smallest.bounds[k].map(|x| marks[k].nearest(x))),
        [0, 1].map(|k| [0, marks[k].offsets.len() - 1]),
    ];
    let climbed = starts.map(|start| climbed(start, &marks, rules.least_m, worth));
    let (_, at) = climbed.into_iter().reduce(|best, next| if next.0 > best.0 { next } else { best })?;
    let rect = rect_at(&at);
    (evidence.moved_m2(&rect) >= config.part.least_moved_m2).then_some(rect)
}

/// The best rectangle that is reached by choosing both sides along one axis, then along the other, until neither changes; and
/// its worth. `least_m`: no side is shorter, metres.
fn climbed(
    start: [[usize; 2]; 2],
    marks: &[Marks; 2],
    least_m: f64,
    worth: impl Fn(&[[usize; 2]; 2]) -> f64,
) -> (f64, [[usize; 2]; 2]) {
    /// Numerics: rises end after two or three.
    const ROUNDS: usize = 6;
    let (mut at, mut best) = (start, worth(&start));
    for _ in 0..ROUNDS {
        let before = at;
        for k in [0, 1] {
            let offsets = &marks[k].offsets;
            for low in 0..offsets.len() {
                let wide = offsets.partition_point(|x| *x < offsets[low] + least_m);
                for high in wide..offsets.len() {
                    let mut next = at;
                    next[k] = [low, high];
                    let value = worth(&next);
                    if value > best {
                        (best, at) = (value, next);
                    }
                }
            }
        }
        if at == before {
            break;
        }
    }
    (best, at)
}

/// What is known of a part's outline before it is seen to move, nats.
fn prior(rect: &Rect, hinge: Option<(usize, f64)>, config: &Config) -> f64 {
    let (rules, fronts) = (&config.part.front, &config.priors.fronts);
    let size = rect.size();
    if size.iter().any(|s| *s < rules.least_m) {
        return f64::NEG_INFINITY;
    }
    let usual = size.map(|s| ((s / fronts.size_median_m).ln() / fronts.size_spread).powi(2));
    let off = rect.bounds.map(|b| (b[0].max(-b[1]).max(0.0) / rules.grip_std_m).powi(2));
    let hung = hinge.map_or(0.0, |(axis, offset)| {
        let side = rect.bounds[axis][usize::from(offset > 0.0)];
        let x = 0.5 * ((side - offset) / rules.hinge_std_m).powi(2);
        x * rules.hinge_most_nats / (x + rules.hinge_most_nats)
    });
    -0.5 * usual.iter().chain(&off).sum::<f64>() - hung
}

/// Where a hinge bounds its part: (0 = upright or 1 = level, offset) in face coordinates. `None` for slides, and for hinges that
/// run along no side.
fn hinge_side(face: &Face, joint: &Articulation, rules: &config::FrontFit) -> Option<(usize, f64)> {
    let at = face.coordinates(&joint.origin);
    let along = [face.up, face.right].map(|a| joint.axis.dot(&a).abs());
    let axis = (0..2).find(|&k| along[k] > rules.along_cos)?;
    (joint.kind == JointKind::Revolute).then_some((axis, at[axis]))
}

/// From a hinge to the side of its part, on its side of the grip, where a line runs along it: fronts are hung at their sides. A
/// direction along the face (world, unit), and how far along it, metres. `None` without such a line, and for joints without
/// such a side.
#[must_use]
pub fn to_lined_side(
    face: &Face,
    rect: &Rect,
    joint: &Articulation,
    stops: &[Stop],
    rules: &config::FrontFit,
) -> Option<(Vector, f64)> {
    let (axis, offset) = hinge_side(face, joint, rules)?;
    let side = rect.bounds[axis][usize::from(offset > 0.0)];
    let on = stops.iter().filter(|(a, at, _)| *a == axis && (at - side).abs() < rules.on_line_m);
    let lined = on.map(|(.., span)| share_of(rect.bounds[1 - axis], span)).fold(0.0, f64::max);
    (lined >= rules.lined_share).then_some(([face.right, face.up][axis], side - offset))
}

/// Share of a side that a line's span covers; negative where they are apart.
fn share_of(side: [f64; 2], span: &[f64; 2]) -> f64 {
    (span[1].min(side[1]) - span[0].max(side[0])) / (side[1] - side[0])
}

/// Where sides can be along an axis: between cells, and on lines.
struct Marks {
    offsets: Vec<f64>,
    /// Of the lines at each.
    spans: Vec<Vec<[f64; 2]>>,
}

impl Marks {
    fn of(axis: usize, grid: &Grid, stops: &[Stop]) -> Self {
        /// Numerics: nearer lines are one.
        const ONE_M: f64 = 1e-3;
        let count = [grid.columns, grid.rows][axis];
        let [low, high] = [0, count].map(|i| grid.origin[axis] + i as f64 * grid.cell_m);
        let lines = || stops.iter().filter(|(a, offset, _)| *a == axis && (low..=high).contains(offset));
        let mut offsets: Vec<f64> = (0..=count).map(|i| low + i as f64 * grid.cell_m).collect();
        offsets.extend(lines().map(|(_, offset, _)| *offset));
        offsets.sort_by(f64::total_cmp);
        offsets.dedup_by(|a, b| (*a - *b).abs() < ONE_M);
        let spans = offsets
            .iter()
            .map(|x| lines().filter(|(_, offset, _)| (offset - x).abs() < ONE_M).map(|(.., span)| *span).collect())
            .collect();
        Self { offsets, spans }
    }

    fn nearest(&self, x: f64) -> usize {
        let off = |i: usize| (self.offsets[i] - x).abs();
        (0..self.offsets.len()).min_by(|&a, &b| off(a).total_cmp(&off(b))).unwrap_or(0)
    }

    /// Share of a side at a mark that lies on a line.
    fn covered(&self, mark: usize, across: [f64; 2]) -> f64 {
        self.spans[mark].iter().map(|span| share_of(across, span)).fold(0.0, f64::max)
    }
}

/// What the views say of each cell, summed over all cells to the lower left of each corner of cells.
struct Evidence {
    grid: Grid,
    /// From -1, stayed, to 1, moved; below 0 where no surface was (`part.front.bare`).
    weights: Vec<f64>,
    /// Cells that moved at all.
    moved: Vec<f64>,
    /// For either axis and end, corner by corner: cells before it along the other axis at which the surface ends there.
    ends: [[Vec<f64>; 2]; 2],
    /// A spot of that size that moved in all of many views is worth a nat, metres.
    spot_m: f64,
}

impl Evidence {
    fn of(seen: &Seen, config: &Config) -> Self {
        let config::Part { front: rules, outline, .. } = &config.part;
        let Seen { face, rect, surface, views, joint, openings, .. } = *seen;
        let grid = Grid::of(face, config.fitting.cell_m.max(rules.least_cell_m), outline);
        let cells = (0..grid.columns * grid.rows).map(|i| {
            let [right, up] = grid.center(i);
            face.point(right, up, 0.0)
        });
        let front = Leaf::through(cells.collect(), face.normal, config.priors.boards.thickness_m);
        let shut = Pose::identity();
        let mut told = vec![(0.0, 0.0); front.points().len()];
        for (view, opening) in views.iter().zip(openings) {
            let bias_m = leaf::front_bias_m(face, rect, view);
            let motion = joint.motion(*opening);
            for (here, (sum, count)) in front.points().iter().zip(&mut told) {
                let at = |motion: &Pose| {
                    let seen = front.behind(here, motion, view)?;
                    Some(view.noise.there(seen.behind_m() + bias_m, seen.depth))
                };
                // A leaf that is edge-on or out of the picture is not where it was, for all that.
                if let Some(closed) = at(&shut) {
                    let open = at(&motion).unwrap_or(0.0);
                    *sum += 0.5 * (open - closed);
                    *count += open.abs().max(closed.abs());
                }
            }
        }
        let closed = grid.surface(face, surface, outline);
        let reach = (rules.sample_gap_m / grid.cell_m).ceil() as usize;
        let bare = |i: usize| {
            let (c, r) = (i % grid.columns, i / grid.columns);
            let mut near = (r.saturating_sub(reach)..(r + reach + 1).min(grid.rows))
                .flat_map(|r| (c.saturating_sub(reach)..(c + reach + 1).min(grid.columns)).map(move |c| (r, c)));
            near.all(|(r, c)| closed[r * grid.columns + c] == 0)
        };
        // One view is worth half of many: they share the depth's errors.
        let weights: Vec<f64> = told
            .iter()
            .enumerate()
            .map(|(i, (sum, count))| if bare(i) { -rules.bare } else { sum / (count + 1.0) })
            .collect();
        let moved: Vec<f64> = weights.iter().map(|w| f64::from(u8::from(*w > rules.moved))).collect();
        let moved = summed(&grid, &moved);
        let bare: Vec<bool> = (0..closed.len()).map(bare).collect();
        let ends = [0, 1].map(|axis| [0, 1].map(|end| ends(&grid, &bare, axis, end, rules)));
        Self { weights: summed(&grid, &weights), moved, ends, grid, spot_m: rules.spot_m }
    }

    /// Share of a side (the lower or the upper end along an axis) at which the surface ends.
    fn ended(&self, axis: usize, end: usize, rect: &Rect) -> f64 {
        let other = 1 - axis;
        let side = self.corner(axis, rect.bounds[axis][end]);
        let [low, high] = rect.bounds[other].map(|x| self.corner(other, x));
        let count = self.size(other) + 1;
        let at = |i: usize| self.ends[axis][end].get(side * count + i).copied().unwrap_or(0.0);
        if high > low { (at(high) - at(low)) / (high - low) as f64 } else { 0.0 }
    }

    /// Cells along an axis: columns, rows.
    fn size(&self, axis: usize) -> usize {
        [self.grid.columns, self.grid.rows][axis]
    }

    /// The corner of cells nearest to an offset along an axis.
    fn corner(&self, axis: usize, offset: f64) -> usize {
        let cells = ((offset - self.grid.origin[axis]) / self.grid.cell_m).round().max(0.0) as usize;
        cells.min(self.size(axis))
    }

    /// How much better a rectangle explains what is seen than that nothing moved.
    fn nats(&self, rect: &Rect) -> f64 {
        self.over(&self.weights, rect) * (self.grid.cell_m / self.spot_m).powi(2)
    }

    fn moved_m2(&self, rect: &Rect) -> f64 {
        self.over(&self.moved, rect) * self.grid.cell_m.powi(2)
    }

    fn over(&self, sums: &[f64], rect: &Rect) -> f64 {
        let [c, r] = [0, 1].map(|k| rect.bounds[k].map(|x| self.corner(k, x)));
        let at = |r: usize, c: usize| sums[r * (self.grid.columns + 1) + c];
        at(r[1], c[1]) + at(r[0], c[0]) - at(r[0], c[1]) - at(r[1], c[0])
    }
}

/// For each corner along an axis, and each corner along the other one, the number of cells before the latter at which the surface
/// ends at the former: seen inside, and bare for some way outside. `end`: 0, the inside is above; 1, below.
fn ends(grid: &Grid, bare: &[bool], axis: usize, end: usize, rules: &config::FrontFit) -> Vec<f64> {
    let frayed = rules.frayed_cells;
    let [count, across] = [[grid.columns, grid.rows][axis], [grid.columns, grid.rows][1 - axis]];
    let is_bare = |along: usize, other: usize| {
        let (column, row) = if axis == 0 { (along, other) } else { (other, along) };
        bare.get(row * grid.columns + column).copied().unwrap_or(true)
    };
    let far = (rules.gap_m / grid.cell_m).ceil() as usize;
    let mut sums = vec![0.0; (count + 1) * (across + 1)];
    for corner in 0..=count {
        let (inside, outside) = match end {
            0 => (Some(corner), corner.saturating_sub(frayed + far)..corner.saturating_sub(frayed)),
            _ => (corner.checked_sub(1), (corner + frayed).min(count)..(corner + frayed + far).min(count)),
        };
        for other in 0..across {
            let seen = inside.is_some_and(|i| i < count && !is_bare(i, other));
            let is_end = seen && !outside.is_empty() && outside.clone().all(|i| is_bare(i, other));
            let at = corner * (across + 1) + other;
            sums[at + 1] = sums[at] + f64::from(u8::from(is_end));
        }
    }
    sums
}

/// For each corner of cells the sum of all cells to its lower left.
fn summed(grid: &Grid, of: &[f64]) -> Vec<f64> {
    let width = grid.columns + 1;
    let mut sums = vec![0.0; width * (grid.rows + 1)];
    for (i, value) in of.iter().enumerate() {
        let corner = (i / grid.columns + 1) * width + i % grid.columns + 1;
        sums[corner] = value + sums[corner - 1] + sums[corner - width] - sums[corner - width - 1];
    }
    sums
}

#[cfg(test)]
mod tests {
    use super::super::views::drawn;
    use super::*;

    /// What is found of the drawn leaf after it moved by `opening`, of which `told` is known, and its true outline.
    fn found(joint: &Articulation, opening: f64, told: f64, stops: &[Stop]) -> (Option<Rect>, Rect) {
        let face = drawn::face();
        let poses = [drawn::pose(Point::new(0.3, -1.0, 0.5)), drawn::pose(Point::new(-0.2, -1.1, 0.4))];
        let sketches = poses.map(|pose| drawn::sketch(&pose, joint, opening));
        let views: Vec<View> = sketches.iter().zip(&poses).map(|(s, pose)| drawn::view(s, pose, face.center)).collect();
        // Surface there is beyond the part, too, as far as its cells go.
        let [right, up] = [0, 1].map(|k| [face.extent[k][0] - 0.1, face.extent[k][1] + 0.1]);
        let surface: Vec<Point> = (0..200 * 200)
            .map(|i| {
                let at = |b: [f64; 2], k: usize| b[0] + (b[1] - b[0]) * k as f64 / 199.0;
                face.point(at(right, i % 200), at(up, i / 200), 0.0)
            })
            .collect();
        // What is known before is wrong on all sides.
        let wider = Rect { bounds: drawn::rect().bounds.map(|b| [b[0] - 0.1, b[1] + 0.1]) };
        let seen =
            Seen { face: &face, rect: &wider, surface: &surface, views: &views, joint, openings: &[told; 2], stops };
        (fit(&seen, &Config::default()), drawn::rect())
    }

    fn worst(found: &Rect, truth: &Rect) -> f64 {
        let sides = found.bounds.iter().flatten().zip(truth.bounds.iter().flatten());
        sides.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    }

    fn door() -> Articulation {
        let origin = Point::new(-0.25, 0.0, 0.0);
        Articulation { kind: JointKind::Revolute, axis: -Vector::z(), origin }
    }

    #[test]
    fn a_door_goes_on_to_its_hinge_and_a_drawer_ends_where_it_hides_what_is_below() {
        // A door that is hardly open does not move beside its hinge, where its side is the hinge itself.
        for (joint, opening) in [
            (door(), 0.25),
            (door(), 1.0),
            (Articulation { kind: JointKind::Prismatic, axis: -Vector::y(), origin: Point::origin() }, 0.25),
        ] {
            let (rect, truth) = found(&joint, opening, opening, &[]);
            assert!(worst(&rect.unwrap(), &truth) < 0.05, "{joint:?} {rect:?} {truth:?}");
        }
    }

    #[test]
    fn a_side_lies_on_a_line_next_to_it() {
        let [[left, right], [bottom, top]] = drawn::rect().bounds;
        // Between two cells, where no side is without it.
        let next_to = right + 0.013;
        let lines = [(0, next_to, [bottom, top]), (0, 0.3 * left + 0.7 * right, [bottom, top])];
        for (stops, on) in [(&lines[..], true), (&[], false)] {
            let (rect, _) = found(&door(), 0.8, 0.8, stops);
            assert_eq!((rect.unwrap().bounds[0][1] - next_to).abs() < 1e-3, on, "{rect:?}");
        }
    }

    #[test]
    fn a_hinge_is_at_the_side_of_its_part_where_a_line_tells_that_side() {
        let (face, rect) = (drawn::face(), drawn::rect());
        let [[left, right], [bottom, top]] = rect.bounds;
        let door = |offset: f64| Articulation { origin: face.point(offset, 0.0, 0.0), ..door() };
        let line = |axis: usize, at: f64, share: f64| [(axis, at, [bottom, bottom + share * (top - bottom)])];
        let way =
            |joint: &Articulation, stops: &[Stop]| to_lined_side(&face, &rect, joint, stops, &drawn::CONFIG.front);
        let near = |found: Option<(Vector, f64)>, by: f64| {
            found.is_some_and(|(along, way)| along == face.right && (way - by).abs() < 1e-12)
        };
        // The side on the hinge's side of the grip, be the other one nearer, and the hinge on either side of it.
        assert!(near(way(&door(0.02), &line(0, right, 0.9)), right - 0.02));
        assert!(near(way(&door(left + 0.04), &line(0, left, 0.9)), -0.04));
        assert!(near(way(&door(right + 0.03), &line(0, right, 0.9)), -0.03));
        // Lines along less than half of it, beside it, along another side, and none; joints without a side.
        for stops in
            [&line(0, left, 0.4)[..], &line(0, left + 0.02, 0.9), &line(1, bottom, 0.9), &line(0, right, 0.9), &[]]
        {
            assert!(way(&door(left + 0.04), stops).is_none(), "{stops:?}");
        }
        let drawer = Articulation { kind: JointKind::Prismatic, axis: -Vector::y(), origin: Point::origin() };
        assert!(way(&drawer, &line(0, left, 0.9)).is_none());
    }

    #[test]
    fn a_leaf_that_swung_past_the_eye_is_known_by_its_back() {
        // Of a door of 1.9 radians both eyes see the inside.
        let (rect, truth) = found(&door(), 1.9, 1.9, &[]);
        assert!(worst(&rect.unwrap(), &truth) < 0.05, "{rect:?}");
    }

    #[test]
    fn what_did_not_move_has_no_outline() {
        let (rect, _) = found(&door(), 0.0, 0.8, &[]);
        assert!(rect.is_none(), "{rect:?}");
    }
}
