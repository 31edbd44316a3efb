//! Where the part stands in each view of the open state, and with that where its hinge is (ours).
//!
//! A hand tells how far a door is open to its own error, centimetres for a whole clip. The depth of the leaf tells it as
//! well as the leaf is seen: leaf and front meet at the hinge, so a leaf that is seen at two angles gives the hinge and both
//! angles. Starting from a joint and the hand's openings, this is a least-squares fit of the leaf to the views' depth.

use nalgebra::{Matrix2, Vector2};

use super::leaf::{self, Behind, Leaf};
use super::points::{self, Points};
use super::views::{Hold, View};
use crate::articulation::{Articulation, JointKind};
use crate::config;
use crate::geometry::Face;
use crate::geometry::Rect;
use crate::geometry::candidates::within_front;
use crate::hands::GripStd;
use crate::math::{Point, Pose, Vector, any_orthogonal, reject, stats, unit};

/// The views of one clip's open state, with the grip when closed as that clip's hand has it.
#[derive(Debug, Clone, Copy)]
pub struct OpenState<'a> {
    /// World.
    pub grip: Point,
    /// How well the hand tells the grip.
    pub grip_std: GripStd,
    /// See [`super::views::open_views`].
    pub views: &'a [View<'a>],
    /// Views of the closed state.
    pub closed: &'a [View<'a>],
}

/// An opening and how well the views tell it, both rad or m.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Opening {
    /// Opening against the closed state.
    pub value: f64,
    /// Standard deviation.
    pub std: f64,
    /// The depth tells it; else the hand does.
    pub informed: bool,
}

impl Opening {
    /// Closed, as nothing is seen to the contrary.
    pub const SHUT: Self = Self { value: 0.0, std: 0.0, informed: false };
}

/// What the depth of the open state says.
#[derive(Debug, Clone, PartialEq)]
pub struct Refit {
    /// The joint with its hinge moved across its axis; a slide stays as it is.
    pub joint: Articulation,
    /// One entry a view of each clip, in the order given.
    pub openings: Vec<Vec<Opening>>,
    /// Two directions across the axis, world, unit: out of the front, and along it.
    pub across: [Vector; 2],
    /// Covariance of the hinge along `across`, m^2, by rows; none for slides.
    pub hinge_cov_m2: Option<[[f64; 2]; 2]>,
}

/// What is believed before the depth is looked at.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Prior {
    /// Standard deviation of the hinge given, across its axis, metres.
    pub hinge_m: f64,
    /// Thickness of the leaf: a view of its back sees it that much behind its front, metres.
    pub board_m: f64,
}

/// One view of one clip with the opening that the hand gives.
struct Seen<'a> {
    view: &'a View<'a>,
    hand: f64,
    /// Radian or metre that the hand's error is worth.
    std: f64,
    /// The closed state of its clip.
    closed: &'a [View<'a>],
}

/// Fits the hinge and the opening in every view. `None` where no view sees enough of the leaf in motion.
#[must_use]
pub fn refit(
    face: &Face,
    rect: &Rect,
    joint: &Articulation,
    clips: &[OpenState],
    prior: &Prior,
    config: &config::Part,
) -> Option<Refit> {
    let rules = &config.openings;
    let leaf = Leaf::of(face, rect, prior.board_m, &config.leaf);
    let seen = seen(face, joint, clips, config);
    // One offset a clip first (a hand is off by as much all along a clip; after it was lost, another), then each view by
    // itself.
    let offsets: Vec<f64> = seen
        .iter()
        .zip(clips)
        .flat_map(|(views, clip)| {
            let points = Points::of(face, Some(rect), clip.views, config);
            let of = Hold::ALL.map(|hold| {
                let sort = Sort { joint, clip, views, hold, config };
                let offset = sort.coarse(&points);
                // A part that was let go stands; one whose hand was lost may be on its way.
                match hold {
                    Hold::Free | Hold::Left => sort.standing(&leaf, offset),
                    Hold::Sure | Hold::Lost => offset,
                }
            });
            views.iter().map(|s| of[s.view.hold as usize]).collect::<Vec<f64>>()
        })
        .collect();
    let mut fit = Fit {
        leaf: &leaf,
        start: joint,
        across: hinge_directions(joint, face),
        hinge_m: prior.hinge_m,
        seen: seen.iter().flatten().collect(),
        shift: [0.0; 2],
        biases: vec![0.0; offsets.len()],
        offsets,
        loose: rules.loose,
        config,
    };
    let Solved { hinge_cov, opening_vars, points, .. } = fit.settled()?;
    if points < rules.least_points {
        return None;
    }
    let rows: [[f64; 2]; 2] = std::array::from_fn(|row| std::array::from_fn(|column| hinge_cov[(row, column)]));
    let hinge_cov_m2 = (joint.kind == JointKind::Revolute).then_some(rows);
    let mut found = opening_vars.into_iter().zip(fit.offsets.iter().copied());
    let mut opening = |s: &Seen| {
        let (variance, offset) = found.next().unwrap_or((0.0, 0.0));
        let std = variance.max(0.0).sqrt();
        // Depth at least halves the variance, or it told nothing. What is left then is the robust prior, which is narrower at its
        // top than the hand is sure.
        let informed = std < rules.informed_share * s.std;
        Opening { value: s.hand + offset, std: if informed { std } else { std.max(s.std) }, informed }
    };
    let openings = seen.iter().map(|views| views.iter().map(&mut opening).collect()).collect();
    Some(Refit { joint: fit.joint(), openings, across: fit.across, hinge_cov_m2 })
}

/// What the hand gives for each view of each clip.
fn seen<'a>(face: &Face, joint: &Articulation, clips: &[OpenState<'a>], config: &config::Part) -> Vec<Vec<Seen<'a>>> {
    let of_view = |clip: &OpenState<'a>, view: &'a View<'a>| Seen {
        view,
        hand: joint.opening_at(&clip.grip, &view.grip),
        std: view.hold.std_m(clip.grip_std, &config.views) / lever(joint, clip, config),
        closed: if within_front(joint, &face.normal) { &[] } else { clip.closed },
    };
    clips.iter().map(|clip| clip.views.iter().map(|view| of_view(clip, view)).collect()).collect()
}

/// Of a clip's grip, metres.
fn lever(joint: &Articulation, clip: &OpenState, config: &config::Part) -> f64 {
    joint.lever(&clip.grip).max(config.least_lever_m)
}

/// The two directions in which a fit moves a hinge: out of the front, and along it.
fn hinge_directions(joint: &Articulation, face: &Face) -> [Vector; 2] {
    let e1 = unit(&reject(&face.normal, &joint.axis)).unwrap_or_else(|| any_orthogonal(&joint.axis));
    [e1, joint.axis.cross(&e1)]
}

/// As [`Leaf::behind`], but for points that have left their closed place: near it a leaf cannot be told from what is behind it.
fn displacement(leaf: &Leaf, point: &Point, motion: &Pose, view: &View) -> Option<Behind> {
    leaf.behind(point, motion, view).filter(|b| b.way >= 2.0 * view.noise.tolerance(b.depth))
}

/// Whether one of the views of the closed state sees a surface at a point (world).
fn was_there(closed: &[View], at: &Point) -> bool {
    closed.iter().any(|view| view.gap(at).is_some_and(|(gap, z)| gap.abs() < view.noise.tight(z)))
}

fn weight(residual: f64, scale: f64) -> f64 {
    let x = residual / scale;
    1.0 / ((1.0 + x * x) * (1.0 + x * x))
}

/// Log density of a hand's error of `x` standard deviations, but for a constant. `tail`: its degrees of freedom.
pub(super) fn hand_log(x: f64, tail: f64) -> f64 {
    -0.5 * (tail + 1.0) * (x * x / tail).ln_1p()
}

/// The views of one sort of one clip, which share an offset of the hand's openings.
struct Sort<'a> {
    joint: &'a Articulation,
    clip: &'a OpenState<'a>,
    /// All views of the clip.
    views: &'a [Seen<'a>],
    hold: Hold,
    config: &'a config::Part,
}

impl Sort<'_> {
    /// The common offset of a clip's openings under which the views explain most, less what so large an offset is believed in.
    fn coarse(&self, points: &Points) -> f64 {
        let Self { joint, clip, hold, config, .. } = *self;
        let rules = &config.openings;
        let of_sort = || self.views.iter().filter(|s| s.view.hold == hold);
        let Some(std) = of_sort().map(|s| s.std).next() else { return 0.0 };
        let step = rules.offset_step_m / lever(joint, clip, config);
        let reach = match hold {
            Hold::Sure => rules.held_reach_stds,
            Hold::Free | Hold::Lost | Hold::Left => rules.lost_reach_stds,
        };
        let steps = (reach * std / step).round() as i32;
        let widest = of_sort().map(|s| s.hand).fold(0.0, f64::max);
        (-steps..=steps)
            .map(|k| f64::from(k) * step)
            // A part is not shut further than shut.
            .filter(|offset| widest + offset > 0.0)
            .map(|offset| {
                let x = offset / std;
                let seen = points.log_likelihood(points::seen_share(points, joint, &clip.grip, &[hold], offset));
                (seen + hand_log(x, rules.tail), offset)
            })
            .max_by(|a, b| a.0.total_cmp(&b.0).then(b.1.abs().total_cmp(&a.1.abs())))
            .map_or(0.0, |(_, offset)| offset)
    }

    /// The same for views in which the part stands: the offset given, unless the leaf at another opening explains their depth
    /// better by far. A leaf that was left near its closed place, or far from where the hand was lost, is found so only.
    fn standing(&self, leaf: &Leaf, offset: f64) -> f64 {
        let Self { joint, clip, config, .. } = *self;
        let (rules, by_far) = (&config.openings, config.by_far_nats);
        let of_sort: Vec<&Seen> = self.views.iter().filter(|s| s.view.hold == self.hold).collect();
        let Some(first) = of_sort.first() else { return offset };
        if within_front(joint, &leaf.normal()) {
            return offset;
        }
        let reach = leaf.points().iter().map(|p| joint.lever(p)).fold(config.least_lever_m, f64::max);
        let (step, widest) = match joint.kind {
            JointKind::Revolute => (rules.step_m / reach, rules.widest[0]),
            JointKind::Prismatic => (rules.step_m, rules.widest[1]),
        };
        let odds = |x: f64| {
            // What was there while the part was closed, a wall behind a lid, is not the part: its place was seen empty.
            let motion = joint.motion(x);
            let was_free = |p: &Point| {
                let at = motion * p;
                // Laid on its neighbours a door shows what they show; near its closed place every leaf is.
                let out = (at - p).dot(&leaf.normal()).abs();
                clip.closed.iter().any(|v| v.gap(&at).is_some_and(|(gap, z)| gap.min(out) >= v.noise.tight(z)))
                    && !was_there(clip.closed, &at)
            };
            let free: Vec<bool> = leaf.points().iter().map(was_free).collect();
            let seen: Vec<f64> = of_sort.iter().map(|s| leaf::odds(leaf, joint, x, s.view, 0.0, Some(&free))).collect();
            stats::median(&seen).unwrap_or(0.0)
        };
        let weighed = |x: f64, seen: f64| seen + hand_log((x - first.hand) / first.std, rules.tail);
        let given = first.hand + offset;
        let best = (1..)
            .map(|k| f64::from(k) * step)
            .take_while(|x| *x <= widest)
            .map(|x| (x, odds(x)))
            // What was opened is not shut.
            .filter(|(_, seen)| *seen > by_far)
            .map(|(x, seen)| (x, weighed(x, seen)))
            .max_by(|a, b| a.1.total_cmp(&b.1).then(b.0.total_cmp(&a.0)));
        match best {
            Some((x, nats)) if nats > weighed(given, odds(given)) + by_far => x - first.hand,
            _ => offset,
        }
    }
}

/// The state of a fit: where the hinge is, and in each view how far its opening is from what the hand tells.
struct Fit<'a> {
    leaf: &'a Leaf,
    start: &'a Articulation,
    /// The two directions in which the hinge moves, world.
    across: [Vector; 2],
    /// As [`Prior::hinge_m`].
    hinge_m: f64,
    seen: Vec<&'a Seen<'a>>,
    /// Of the hinge, along `across`, metres.
    shift: [f64; 2],
    /// Of each view's opening, rad or m.
    offsets: Vec<f64>,
    /// Of each view's depth, what all points of the leaf share, metres.
    biases: Vec<f64>,
    /// What is seen counts up to so many times as far from the leaf as it does in the end.
    loose: f64,
    config: &'a config::Part,
}

/// A row of the least squares: how the leaf moves along its normal with the hinge's two shifts, the opening and the bias; how far
/// it is from what is seen there; how far that is believed; and its information.
struct Row {
    by: [f64; 4],
    residual: f64,
    belief: f64,
    information: f64,
}

impl Fit<'_> {
    /// The joint where the hinge is now.
    fn joint(&self) -> Articulation {
        let [e1, e2] = self.across;
        Articulation { origin: self.start.origin + e1 * self.shift[0] + e2 * self.shift[1], ..*self.start }
    }

    /// Goes to the best fit, and tells the last step. `None` where nothing determines it.
    fn settled(&mut self) -> Option<Solved> {
        /// Numerics: of Gauss and Newton.
        const STEPS: usize = 10;
        let mut last = None;
        for _ in 0..STEPS {
            let solved = self.equations().solved()?;
            self.shift.iter_mut().zip(solved.hinge.iter()).for_each(|(shift, change)| *shift += change);
            for ((offset, bias), change) in self.offsets.iter_mut().zip(&mut self.biases).zip(&solved.views) {
                *offset += change[0];
                *bias += change[1];
            }
            self.loose = (self.loose * self.config.openings.tightens).max(1.0);
            last = Some(solved);
        }
        last
    }

    /// Gauss-Newton about the present state.
    fn equations(&self) -> Equations {
        let plane_m = self.seen.first().map_or(self.hinge_m, |s| s.view.noise.surface_std());
        let information = match self.start.kind {
            JointKind::Revolute => [plane_m.powi(-2), self.hinge_m.powi(-2)],
            // A slide has no place: the shift is held at zero.
            JointKind::Prismatic => [1e12; 2],
        };
        let mut out = Equations {
            hinge: Matrix2::from_diagonal(&Vector2::from(information)),
            hinge_rhs: Vector2::new(-information[0] * self.shift[0], -information[1] * self.shift[1]),
            views: Vec::with_capacity(self.seen.len()),
            points: 0,
        };
        let joint = self.joint();
        for i in 0..self.seen.len() {
            self.add_view(&mut out, &joint, i);
        }
        out
    }

    /// What one view says of hinge, opening and bias.
    fn add_view(&self, out: &mut Equations, joint: &Articulation, i: usize) {
        let (s, offset, bias) = (self.seen[i], self.offsets[i], self.biases[i]);
        let (rows, rules) = (self.rows(s, joint, offset, bias), &self.config.openings);
        let told = (rules.tail + 1.0) / (rules.tail + (offset / s.std).powi(2)) / (s.std * s.std);
        let distance = (s.view.grip - s.view.eye).norm();
        let bias_info = s.view.noise.own_std(distance).powi(-2);
        let mut of_view = OfView {
            own: Matrix2::from_diagonal(&Vector2::new(told, bias_info)),
            with_hinge: Matrix2::zeros(),
            rhs: Vector2::new(-told * offset, -bias_info * bias),
        };
        let total: f64 = rows.iter().map(|r| r.belief).sum();
        // Of a leaf of which too little is in its place nothing is known.
        if total >= rules.least_in_place * rows.len() as f64 && total >= rules.least_in_place_points {
            out.points += total as usize;
            let worth = (self.config.leaf.independent / total).min(1.0);
            for Row { by: [a, b, c, d], residual, belief, information } in rows {
                let w = belief * information * worth;
                let (hinge, own) = (Vector2::new(a, b), Vector2::new(c, d));
                out.hinge += hinge * hinge.transpose() * w;
                out.hinge_rhs += hinge * (w * residual);
                of_view.own += own * own.transpose() * w;
                of_view.with_hinge += hinge * own.transpose() * w;
                of_view.rhs += own * (w * residual);
            }
        }
        out.views.push(of_view);
    }

    /// The points of the leaf that a view sees in motion.
    fn rows(&self, s: &Seen, joint: &Articulation, offset: f64, bias: f64) -> Vec<Row> {
        let motion = joint.motion(s.hand + offset);
        let turn = motion.rotation;
        let law = &s.view.noise;
        let row = |p: &Point| {
            let Behind { along_normal, at, normal, depth, .. } = displacement(self.leaf, p, &motion, s.view)?;
            if was_there(s.closed, &at) {
                return None;
            }
            let by_opening = match joint.kind {
                JointKind::Revolute => joint.axis.cross(&(at - joint.origin)),
                JointKind::Prismatic => joint.axis,
            };
            let [by_e1, by_e2] = self.across.map(|e| match joint.kind {
                JointKind::Revolute => normal.dot(&(e - turn * e)),
                JointKind::Prismatic => 0.0,
            });
            let residual = along_normal - bias;
            Some(Row {
                by: [by_e1, by_e2, normal.dot(&by_opening), 1.0],
                residual,
                belief: weight(residual, self.loose * law.tight(depth)),
                information: law.own_std(depth).powi(-2),
            })
        };
        self.leaf.points().iter().filter_map(row).collect()
    }
}

/// Normal equations in which every view meets the hinge, and no other view.
struct Equations {
    hinge: Matrix2<f64>,
    hinge_rhs: Vector2<f64>,
    views: Vec<OfView>,
    points: usize,
}

/// What concerns one view: the offset of its opening and the error that its depth shares.
#[derive(Clone, Copy)]
struct OfView {
    own: Matrix2<f64>,
    /// Rows: the hinge's two shifts.
    with_hinge: Matrix2<f64>,
    rhs: Vector2<f64>,
}

/// The step of one iteration, with the covariances about it.
struct Solved {
    hinge: Vector2<f64>,
    views: Vec<Vector2<f64>>,
    hinge_cov: Matrix2<f64>,
    /// Variance of each view's opening.
    opening_vars: Vec<f64>,
    /// Points of the leaf that were seen in their place.
    points: usize,
}

impl Equations {
    /// The views are eliminated one by one: time grows with their number. `None` where there is no solution.
    fn solved(&self) -> Option<Solved> {
        let inverses: Vec<Matrix2<f64>> = self.views.iter().map(|v| v.own.try_inverse()).collect::<Option<_>>()?;
        let (mut hinge, mut rhs) = (self.hinge, self.hinge_rhs);
        for (view, inverse) in self.views.iter().zip(&inverses) {
            let by = view.with_hinge * inverse;
            hinge -= by * view.with_hinge.transpose();
            rhs -= by * view.rhs;
        }
        let hinge_cov = hinge.cholesky()?.inverse();
        let shift = hinge_cov * rhs;
        let views: Vec<Vector2<f64>> = self
            .views
            .iter()
            .zip(&inverses)
            .map(|(view, inverse)| inverse * (view.rhs - view.with_hinge.transpose() * shift))
            .collect();
        let opening_vars = self
            .views
            .iter()
            .zip(&inverses)
            .map(|(view, inverse)| {
                let by = inverse * view.with_hinge.transpose();
                (inverse + by * hinge_cov * by.transpose())[(0, 0)]
            })
            .collect();
        let finite = shift.iter().chain(views.iter().flatten()).all(|x| x.is_finite());
        finite.then_some(Solved { hinge: shift, views, hinge_cov, opening_vars, points: self.points })
    }
}

#[cfg(test)]
mod tests {
    use super::super::views::drawn;
    use super::*;

    const GRIP_STD: GripStd = GripStd { closed_m: 0.03, lost_m: 0.12 };
    const PRIOR: Prior = Prior { hinge_m: 0.03, board_m: 0.018 };

    fn door() -> Articulation {
        Articulation { kind: JointKind::Revolute, axis: -Vector::z(), origin: Point::new(-0.25, 0.0, 0.0) }
    }

    #[test]
    fn views_eliminated_one_by_one_give_what_the_whole_system_gives() {
        let views: Vec<OfView> = (0..5)
            .map(|i| {
                let x = f64::from(i);
                OfView {
                    own: Matrix2::new(9.0 + x, 0.5, 0.5, 7.0),
                    with_hinge: Matrix2::new(x.sin(), 0.3, x.cos(), -0.2 * x),
                    rhs: Vector2::new(0.4 - x, 0.1 * x),
                }
            })
            .collect();
        let equations = Equations {
            hinge: Matrix2::new(20.0, 1.0, 1.0, 30.0),
            hinge_rhs: Vector2::new(1.0, -2.0),
            views,
            points: 0,
        };
        let size = 2 + 2 * equations.views.len();
        let (mut matrix, mut vector) = (nalgebra::DMatrix::zeros(size, size), nalgebra::DVector::zeros(size));
        matrix.view_mut((0, 0), (2, 2)).copy_from(&equations.hinge);
        vector.rows_mut(0, 2).copy_from(&equations.hinge_rhs);
        for (i, view) in equations.views.iter().enumerate() {
            let at = 2 + 2 * i;
            matrix.view_mut((at, at), (2, 2)).copy_from(&view.own);
            matrix.view_mut((0, at), (2, 2)).copy_from(&view.with_hinge);
            matrix.view_mut((at, 0), (2, 2)).copy_from(&view.with_hinge.transpose());
            vector.rows_mut(at, 2).copy_from(&view.rhs);
        }
        let whole = matrix.cholesky().unwrap();
        let (solution, covariance) = (whole.solve(&vector), whole.inverse());
        let solved = equations.solved().unwrap();
        assert!((solved.hinge - solution.rows(0, 2)).norm() < 1e-12);
        assert!((solved.hinge_cov - covariance.view((0, 0), (2, 2))).norm() < 1e-12);
        for (i, (step, variance)) in solved.views.iter().zip(&solved.opening_vars).enumerate() {
            let at = 2 + 2 * i;
            assert!((step - solution.rows(at, 2)).norm() < 1e-12);
            assert!((variance - covariance[(at, at)]).abs() < 1e-12);
        }
    }

    /// The fit of `believed` to one view of `joint` at `opening`, of which the hand tells `told`.
    fn fitted(joint: &Articulation, opening: f64, believed: &Articulation, told: f64, eye: Point) -> Option<Refit> {
        let pose = drawn::pose(eye);
        let sketch = drawn::sketch(&pose, joint, opening);
        let grip = drawn::face().center;
        // Drawn depth is exact, and a recording of it would say so.
        let mut view = drawn::view(&sketch, &pose, believed.motion(told) * grip);
        view.noise = drawn::exact_noise();
        let views = [view];
        let clips = [OpenState { grip, grip_std: GRIP_STD, views: &views, closed: &[] }];
        refit(&drawn::face(), &drawn::rect(), believed, &clips, &PRIOR, &drawn::CONFIG)
    }

    #[test]
    fn an_open_leaf_corrects_the_hand_and_the_hinge() {
        let believed = Articulation { origin: Point::new(-0.23, 0.0, 0.0), ..door() };
        let fit = fitted(&door(), 0.7, &believed, 0.8, Point::new(0.5, -1.0, 0.4)).unwrap();
        let found = fit.openings[0][0];
        assert!((found.value - 0.7).abs() < 0.03 && found.informed, "{found:?}");
        let off = door().line().distance(&fit.joint.origin);
        assert!(off < 0.012, "{off}");
        // Depth narrows both directions.
        let [[out, mixed], [_, along]] = fit.hinge_cov_m2.unwrap();
        let largest = 0.5 * (out + along) + (0.25 * (out - along).powi(2) + mixed * mixed).sqrt();
        assert!(largest < PRIOR.hinge_m.powi(2) && out < drawn::exact_noise().surface_std().powi(2), "{fit:?}");
        assert!((fit.across[0] + Vector::y()).norm() < 1e-9 && fit.across[1].z.abs() < 1e-9, "{fit:?}");
    }

    #[test]
    fn a_door_that_stands_is_found_far_from_where_its_hand_was_lost() {
        let pose = drawn::pose(Point::new(0.5, -1.0, 0.4));
        let [open, shut] = [1.1, 0.0].map(|x| drawn::sketch(&pose, &door(), x));
        let grip = drawn::face().center;
        let stands = |closed: &[View]| {
            // Further off than an offset of the hand is looked for.
            let mut view = drawn::view(&open, &pose, door().motion(0.05) * grip);
            view.hold = Hold::Free;
            let clips = [OpenState { grip, grip_std: GRIP_STD, views: &[view], closed }];
            refit(&drawn::face(), &drawn::rect(), &door(), &clips, &PRIOR, &drawn::CONFIG).map(|fit| fit.openings[0][0])
        };
        let found = stands(&[drawn::view(&shut, &pose, grip)]).unwrap();
        assert!((found.value - 1.1).abs() < 0.03 && found.informed, "{found:?}");
        // What was there already while the part was closed is not the part.
        assert!(stands(&[drawn::view(&open, &pose, grip)]).is_none_or(|o| !o.informed));
    }

    #[test]
    fn a_drawer_is_as_far_out_as_it_is_seen() {
        let drawer = Articulation { kind: JointKind::Prismatic, axis: -Vector::y(), origin: Point::origin() };
        let fit = fitted(&drawer, 0.3, &drawer, 0.36, Point::new(0.2, -1.3, 0.5)).unwrap();
        let found = fit.openings[0][0];
        assert!((found.value - 0.3).abs() < 0.01 && found.informed, "{found:?}");
        assert_eq!((fit.joint, fit.hinge_cov_m2), (drawer, None));
    }

    #[test]
    fn a_leaf_that_is_seen_edge_on_or_not_at_all_leaves_the_hands_word() {
        // The eye in the plane of the leaf.
        let along = door().motion(0.7).rotation * Vector::x();
        let eye = door().origin + along * 1.5 + Vector::z() * 0.2;
        assert!(fitted(&door(), 0.7, &door(), 0.75, eye).is_none());
        assert!(refit(&drawn::face(), &drawn::rect(), &door(), &[], &PRIOR, &drawn::CONFIG).is_none());
    }
}
