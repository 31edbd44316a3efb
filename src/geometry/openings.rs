//! Where the part stands in each view of the open state, and with that where its hinge is (ours).
//!
//! A hand tells how far a door is open to its own error, centimetres for a whole clip. The depth of the leaf tells it as
//! well as the leaf is seen: leaf and front meet at the hinge, so a leaf that is seen at two angles gives the hinge and both
//! angles. Starting from a joint and the hand's openings, this is a least-squares fit of the leaf to the views' depth.

use nalgebra::{Matrix2, Vector2};

use super::Face;
use super::candidates::within_front;
use super::face::Rect;
use super::leaf::{self, Behind, INDEPENDENT, Leaf, OWN_STD_M, TIGHT_M};
use super::moved::{Hold, View};
use super::sights::{self, Sights};
use crate::articulation::{Articulation, JointKind};
use crate::math::{Point, Pose, Vector, any_orthogonal, reject, stats, unit};

/// The views of one clip's open state, with the grip when closed as that clip's hand has it.
#[derive(Debug, Clone, Copy)]
pub struct OpenState<'a> {
    /// World.
    pub grip: Point,
    /// Standard deviation of the grip along the motion, metres.
    pub grip_std_m: f64,
    /// See [`super::moved::open_views`].
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

/// What is believed before the depth is looked at, and how well depth is measured.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Noise {
    /// Standard deviation of the hinge given, across its axis, metres.
    pub hinge_m: f64,
    /// Thickness of the leaf: a view of its back sees it that much behind its front, metres.
    pub board_m: f64,
}

/// Error of a frame's depth of one surface that all its points share, metres.
const SHARED_STD_M: f64 = 0.01;
/// How well the plane of the front is known, and with it a hinge across it, metres.
const PLANE_STD_M: f64 = 0.015;
/// Log odds, nats, beyond the errors of depth and outline that views share: those are worth a few.
pub(super) const BY_FAR: f64 = 6.0;
/// Fewer points of the leaf in all views together are noise.
const LEAST_POINTS: usize = 100;
/// Degrees of freedom of the hand's error: few, as some hands are lost before a part is closed.
const TAIL: f64 = 2.0;
/// Hands hold doors no nearer to their hinge than this, metres.
pub const LEAST_LEVER_M: f64 = 0.1;
/// As [`TIGHT_M`], while the opening is unsure.
const LOOSE_M: f64 = 0.08;

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
pub fn refit(face: &Face, rect: &Rect, joint: &Articulation, clips: &[OpenState], noise: &Noise) -> Option<Refit> {
    let lever = |clip: &OpenState| joint.lever(&clip.grip).max(LEAST_LEVER_M);
    let leaf = Leaf::of(face, rect, noise.board_m);
    let seen: Vec<Vec<Seen>> = clips
        .iter()
        .map(|clip| {
            clip.views
                .iter()
                .map(|view| {
                    let std = view.hold.std_m(clip.grip_std_m) / lever(clip);
                    Seen {
                        view,
                        hand: joint.opening_at(&clip.grip, &view.grip),
                        std,
                        closed: if within_front(joint, &face.normal) { &[] } else { clip.closed },
                    }
                })
                .collect()
        })
        .collect();
    // One offset a clip first (a hand is off by as much all along a clip; after it was lost, another), then each view by
    // itself.
    let mut offsets: Vec<Vec<f64>> = seen
        .iter()
        .zip(clips)
        .map(|(views, clip)| {
            let sights = Sights::of(face, Some(rect), clip.views);
            let of = Hold::ALL.map(|hold| {
                let offset = coarse(&sights, joint, clip, views, hold, lever(clip));
                // A part that was let go stands; one whose hand was lost may be on its way.
                match hold {
                    Hold::Free | Hold::Left => standing(&leaf, joint, clip, views, hold, offset),
                    Hold::Sure | Hold::Lost => offset,
                }
            });
            views.iter().map(|s| of[s.view.hold as usize]).collect()
        })
        .collect();
    let mut shift = [0.0; 2];
    let mut shared = vec![0.0; offsets.iter().map(Vec::len).sum()];
    let (e1, e2) = hinge_directions(joint, face);
    let flat: Vec<&Seen> = seen.iter().flatten().collect();
    let mut scale = LOOSE_M;
    let mut fit = None;
    for _ in 0..10 {
        let moved = shifted(joint, &e1, &e2, shift);
        let flat_offsets: Vec<f64> = offsets.iter().flatten().copied().collect();
        let step =
            normal_equations(&leaf, joint, &moved, [&e1, &e2], shift, &flat, &flat_offsets, &shared, scale, noise);
        let solved = step.solved()?;
        shift.iter_mut().zip(solved.hinge.iter()).for_each(|(shift, change)| *shift += change);
        for (offset, change) in offsets.iter_mut().flatten().zip(&solved.views) {
            *offset += change[0];
        }
        for (bias, change) in shared.iter_mut().zip(&solved.views) {
            *bias += change[1];
        }
        scale = (scale * 0.75).max(TIGHT_M);
        fit = Some((solved, step.points));
    }
    let (Solved { hinge_cov, opening_vars, .. }, points) = fit?;
    if points < LEAST_POINTS {
        return None;
    }
    let rows: [[f64; 2]; 2] = std::array::from_fn(|row| std::array::from_fn(|column| hinge_cov[(row, column)]));
    let hinge_cov_m2 = (joint.kind == JointKind::Revolute).then_some(rows);
    let mut variances = opening_vars.into_iter();
    let openings = seen
        .iter()
        .zip(&offsets)
        .map(|(views, offsets)| {
            views
                .iter()
                .zip(offsets)
                .map(|(s, offset)| {
                    let std = variances.next().unwrap_or(0.0).max(0.0).sqrt();
                    // Depth at least halves the variance (0.7^2), or it told nothing. What is left then is the robust prior,
                    // which is narrower at its top than the hand is sure.
                    let informed = std < 0.7 * s.std;
                    Opening { value: s.hand + offset, std: if informed { std } else { std.max(s.std) }, informed }
                })
                .collect()
        })
        .collect();
    let joint = shifted(joint, &e1, &e2, shift);
    Some(Refit { joint, openings, across: [e1, e2], hinge_cov_m2 })
}

/// The two directions in which a fit moves a hinge: out of the front, and along it.
fn hinge_directions(joint: &Articulation, face: &Face) -> (Vector, Vector) {
    let e1 = unit(&reject(&face.normal, &joint.axis)).unwrap_or_else(|| any_orthogonal(&joint.axis));
    (e1, joint.axis.cross(&e1))
}

fn shifted(joint: &Articulation, e1: &Vector, e2: &Vector, shift: [f64; 2]) -> Articulation {
    Articulation { origin: joint.origin + e1 * shift[0] + e2 * shift[1], ..*joint }
}

/// As [`Leaf::behind`], but for points that have left their closed place: near it a leaf cannot be told from what is behind it.
fn displacement(leaf: &Leaf, point: &Point, motion: &Pose, view: &View) -> Option<Behind> {
    leaf.behind(point, motion, view).filter(|b| b.way >= 2.0 * super::moved::tolerance(b.depth))
}

/// Whether one of the views of the closed state sees a surface at a point (world).
fn was_there(closed: &[View], at: &Point) -> bool {
    closed.iter().any(|view| view.gap(at).is_some_and(|(gap, _)| gap.abs() < TIGHT_M))
}

fn weight(residual: f64, scale: f64) -> f64 {
    let x = residual / scale;
    1.0 / ((1.0 + x * x) * (1.0 + x * x))
}

/// The common offset of a clip's openings under which the views explain most, less what so large an offset is believed in.
fn coarse(sights: &Sights, joint: &Articulation, clip: &OpenState, views: &[Seen], hold: Hold, lever: f64) -> f64 {
    // Two centimetres at the grip, which the depth's tolerance bridges.
    const STEP_M: f64 = 0.02;
    let of_sort = || views.iter().filter(|s| s.view.hold == hold);
    let Some(std) = of_sort().map(|s| s.std).next() else { return 0.0 };
    let step = STEP_M / lever;
    let steps = (reach(hold) * std / step).round() as i32;
    let widest = of_sort().map(|s| s.hand).fold(0.0, f64::max);
    (-steps..=steps)
        .map(|k| f64::from(k) * step)
        // A part is not shut further than shut.
        .filter(|offset| widest + offset > 0.0)
        .map(|offset| {
            let x = offset / std;
            let seen = sights::log_likelihood(sights::seen_share(sights, joint, &clip.grip, &[hold], offset));
            (seen + hand_log(x), offset)
        })
        .max_by(|a, b| a.0.total_cmp(&b.0).then(b.1.abs().total_cmp(&a.1.abs())))
        .map_or(0.0, |(_, offset)| offset)
}

/// Log density of a hand's error of `x` standard deviations, but for a constant.
pub(super) fn hand_log(x: f64) -> f64 {
    -0.5 * (TAIL + 1.0) * (x * x / TAIL).ln_1p()
}

/// The same for views in which the part stands: the offset given, unless the leaf at another opening explains their depth
/// better by far. A leaf that was left near its closed place, or far from where the hand was lost, is found so only.
fn standing(leaf: &Leaf, joint: &Articulation, clip: &OpenState, views: &[Seen], hold: Hold, offset: f64) -> f64 {
    const STEP_M: f64 = 0.01;
    /// No part opens further, rad and m: half a turn, and the longest pull-out.
    const WIDEST: [f64; 2] = [std::f64::consts::PI, 1.0];
    let of_sort: Vec<&Seen> = views.iter().filter(|s| s.view.hold == hold).collect();
    let Some(first) = of_sort.first() else { return offset };
    if within_front(joint, &leaf.normal()) {
        return offset;
    }
    let reach = leaf.points().iter().map(|p| joint.lever(p)).fold(LEAST_LEVER_M, f64::max);
    let (step, widest) = match joint.kind {
        JointKind::Revolute => (STEP_M / reach, WIDEST[0]),
        JointKind::Prismatic => (STEP_M, WIDEST[1]),
    };
    let odds = |x: f64| {
        // What was there while the part was closed, a wall behind a lid, is not the part: its place was seen empty.
        let motion = joint.motion(x);
        let was_free = |p: &Point| {
            let at = motion * p;
            // Laid on its neighbours a door shows what they show; near its closed place every leaf is.
            (at - p).dot(&leaf.normal()).abs() > TIGHT_M
                && clip.closed.iter().any(|v| v.gap(&at).is_some_and(|(gap, _)| gap >= TIGHT_M))
                && !was_there(clip.closed, &at)
        };
        let free: Vec<bool> = leaf.points().iter().map(was_free).collect();
        let seen: Vec<f64> = of_sort.iter().map(|s| leaf::odds(leaf, joint, x, s.view, 0.0, Some(&free))).collect();
        stats::median(&seen).unwrap_or(0.0)
    };
    let weighed = |x: f64, seen: f64| seen + hand_log((x - first.hand) / first.std);
    let given = first.hand + offset;
    let best = (1..)
        .map(|k| f64::from(k) * step)
        .take_while(|x| *x <= widest)
        .map(|x| (x, odds(x)))
        // What was opened is not shut.
        .filter(|(_, seen)| *seen > BY_FAR)
        .map(|(x, seen)| (x, weighed(x, seen)))
        .max_by(|a, b| a.1.total_cmp(&b.1).then(b.0.total_cmp(&a.0)));
    match best {
        Some((x, nats)) if nats > weighed(given, odds(given)) + BY_FAR => x - first.hand,
        _ => offset,
    }
}

/// Standard deviations to each side in which an offset is looked for: a hand that was lost, or seen to let go by a flag that
/// erred, may have been at the start of its way.
fn reach(hold: Hold) -> f64 {
    match hold {
        Hold::Sure => 3.0,
        Hold::Free | Hold::Lost | Hold::Left => 6.0,
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
        finite.then_some(Solved { hinge: shift, views, hinge_cov, opening_vars })
    }
}

/// Gauss-Newton about the present state: two shifts of the hinge, then for each view an offset of its opening and the error
/// that its depth shares.
#[allow(clippy::too_many_arguments, reason = "the state of one fit")]
fn normal_equations(
    leaf: &Leaf,
    start: &Articulation,
    joint: &Articulation,
    [e1, e2]: [&Vector; 2],
    shift: [f64; 2],
    seen: &[&Seen],
    offsets: &[f64],
    shared: &[f64],
    scale: f64,
    noise: &Noise,
) -> Equations {
    let information = match start.kind {
        JointKind::Revolute => [PLANE_STD_M.powi(-2), noise.hinge_m.powi(-2)],
        // A slide has no place: the shift is held at zero.
        JointKind::Prismatic => [1e12; 2],
    };
    let mut out = Equations {
        hinge: Matrix2::from_diagonal(&Vector2::from(information)),
        hinge_rhs: Vector2::new(-information[0] * shift[0], -information[1] * shift[1]),
        views: Vec::with_capacity(seen.len()),
        points: 0,
    };
    for ((s, offset), bias) in seen.iter().zip(offsets).zip(shared) {
        let told = (TAIL + 1.0) / (TAIL + (offset / s.std).powi(2)) / (s.std * s.std);
        let bias_info = SHARED_STD_M.powi(-2);
        let mut of_view = OfView {
            own: Matrix2::from_diagonal(&Vector2::new(told, bias_info)),
            with_hinge: Matrix2::zeros(),
            rhs: Vector2::new(-told * offset, -bias_info * bias),
        };
        let opening = s.hand + offset;
        let motion = joint.motion(opening);
        let turn = motion.rotation;
        let rows: Vec<([f64; 4], f64, f64)> = leaf
            .points()
            .iter()
            .filter_map(|p| {
                let Behind { along_normal, at, normal, .. } = displacement(leaf, p, &motion, s.view)?;
                if was_there(s.closed, &at) {
                    return None;
                }
                // How the leaf moves along its normal with each parameter.
                let by_opening = match joint.kind {
                    JointKind::Revolute => joint.axis.cross(&(at - joint.origin)),
                    JointKind::Prismatic => joint.axis,
                };
                let by = |e: &Vector| match joint.kind {
                    JointKind::Revolute => normal.dot(&(e - turn * e)),
                    JointKind::Prismatic => 0.0,
                };
                let r = along_normal - bias;
                Some(([by(e1), by(e2), normal.dot(&by_opening), 1.0], r, weight(r, scale)))
            })
            .collect();
        let total: f64 = rows.iter().map(|(_, _, w)| w).sum();
        // Of a leaf of which less than a tenth is in its place nothing is known.
        if total >= 0.1 * rows.len() as f64 && total >= 4.0 {
            out.points += total as usize;
            let worth = (INDEPENDENT / total).min(1.0) / (OWN_STD_M * OWN_STD_M);
            for ([a, b, c, d], r, w) in rows {
                let w = w * worth;
                let (hinge, own) = (Vector2::new(a, b), Vector2::new(c, d));
                out.hinge += hinge * hinge.transpose() * w;
                out.hinge_rhs += hinge * (w * r);
                of_view.own += own * own.transpose() * w;
                of_view.with_hinge += hinge * own.transpose() * w;
                of_view.rhs += own * (w * r);
            }
        }
        out.views.push(of_view);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::super::moved::drawn;
    use super::*;

    const NOISE: Noise = Noise { hinge_m: 0.03, board_m: 0.018 };

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
        let views = [drawn::view(&sketch, &pose, believed.motion(told) * grip)];
        let clips = [OpenState { grip, grip_std_m: 0.03, views: &views, closed: &[] }];
        refit(&drawn::face(), &drawn::rect(), believed, &clips, &NOISE)
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
        assert!(largest < NOISE.hinge_m.powi(2) && out < PLANE_STD_M.powi(2), "{fit:?}");
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
            let clips = [OpenState { grip, grip_std_m: 0.03, views: &[view], closed }];
            refit(&drawn::face(), &drawn::rect(), &door(), &clips, &NOISE).map(|fit| fit.openings[0][0])
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
        assert!(refit(&drawn::face(), &drawn::rect(), &door(), &[], &NOISE).is_none());
    }
}
