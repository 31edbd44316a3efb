//! A joint of the scene once more, from the depth of all its clips' open states: where its hinge is, how far each clip went.

use super::ClipResult;
use crate::articulation::{Action, Articulation};
use crate::config::{Config, Grips};
use crate::geometry::{AxisSource, Face, Rect, candidates};
use crate::hands::{self, GripStd, Trajectory};
use crate::inference;
use crate::inference::uncertainty::OpenStates;
use crate::localization::Footage;
use crate::math::{Point, stats};
use crate::part::openings::{self, OpenState, Opening};
use crate::part::outline::{self, Stop};
use crate::part::views::{self, Hold};
use crate::part::{ajar, front};
use crate::recording::Clip;

/// A joint after its open views were looked at.
pub(super) struct Refitted<'a> {
    pub(super) joint: Articulation,
    /// All clips' views of the open state, and the opening in each.
    pub(super) views: Vec<views::View<'a>>,
    pub(super) openings: Vec<f64>,
    /// Opening that each clip went through, rad or m.
    pub(super) ranges: Vec<f64>,
    /// Largest opening against the closed state, rad or m.
    pub(super) widest: f64,
    /// How sure hinge and ranges are.
    pub(super) depth: OpenStates,
}

/// The part when closed.
#[derive(Clone, Copy)]
pub(super) struct Closed<'a> {
    pub(super) face: Face,
    pub(super) rect: Rect,
    /// Points of the furniture, world.
    pub(super) surface: &'a [Point],
}

/// What each clip of a part shows of it, in the order of the clips.
pub(super) struct Views<'a> {
    /// Of its open state.
    open: Vec<Vec<views::View<'a>>>,
    /// Of its closed state, while nothing else was moved.
    closed: Vec<Vec<views::View<'a>>>,
}

impl<'a> Views<'a> {
    pub(super) fn of(footage: &Footage<'a>, shown: &[(&ClipResult, &Trajectory)], config: &'a Config) -> Self {
        let Footage { recording, sketches, .. } = *footage;
        let open = |clip: &ClipResult, t| views::open_views(recording, sketches, &clip.clip, t, &config.part);
        Self {
            open: shown.iter().map(|(clip, t)| open(clip, t)).collect(),
            closed: shown.iter().map(|(clip, t)| closed_views(footage, clip, t, config)).collect(),
        }
    }
}

/// A joint and how well its hinge is believed to be known along the front before the depth of the open states is looked at,
/// a standard deviation in metres.
#[derive(Debug, Clone, Copy)]
pub(super) struct Believed {
    pub(super) joint: Articulation,
    pub(super) hinge_m: f64,
}

impl Believed {
    /// What is believed once an outline was fitted to the same joint: a hinge is at the side of its part, and lines tell
    /// sides better than depth tells hinges. Lines that depth speaks against belong to something else.
    pub(super) fn at_side(self, fit: &Refitted, face: &Face, rect: &Rect, stops: &[Stop], config: &Config) -> Self {
        let agree = config.inference.states.agree_stds;
        let line_m = AxisSource::Line.position_std_m(&config.inference.sources);
        let Some(cov) = fit.depth.hinge_cov_m2 else { return self };
        let Some((along, off)) = front::to_lined_side(face, rect, &fit.joint, stops, &config.part.front) else {
            return self;
        };
        if off.abs() > agree * cov[1][1].sqrt().hypot(line_m) {
            return self;
        }
        let way = along * (off + along.dot(&(fit.joint.origin - self.joint.origin)));
        let [own, line] = [self.hinge_m, line_m].map(|std| std.powi(-2));
        let joint = Articulation { origin: self.joint.origin + way * (line / (own + line)), ..self.joint };
        Self { joint, hinge_m: (own + line).sqrt().recip() }
    }
}

/// The hinge and the openings that the depth of the open states tells. `None` where they were not seen.
pub(super) fn refitted<'a>(
    shown: &[(&ClipResult, &Trajectory)],
    shows: &Views<'a>,
    believed: &Believed,
    closed: &Closed,
    config: &'a Config,
) -> Option<Refitted<'a>> {
    let rules = &config.inference.states;
    let Closed { face, rect, .. } = closed;
    let joint = &believed.joint;
    let prior = openings::Prior { hinge_m: believed.hinge_m, board_m: config.priors.boards.thickness_m };
    let states: Vec<OpenState> = shown
        .iter()
        .zip(shows.open.iter().zip(&shows.closed))
        .map(|((_, t), (views, closed))| OpenState {
            grip: t.closed_grip(),
            grip_std: GripStd::of(t, &config.hands.grips),
            views,
            closed,
        })
        .collect();
    let mut fit = openings::refit(face, rect, joint, &states, &prior, &config.part)?;
    if let Some(axis) = within_front(joint, face) {
        // Along its front a leaf shows no depth of its own; the place that it left does.
        for (view, opening) in states.iter().flat_map(|s| s.views).zip(fit.openings.iter_mut().flatten()) {
            let votes = outline::vote(face, closed.surface, std::slice::from_ref(view), None, config);
            if let Some(value) = votes.vacated(axis, rect.bounds[1 - axis]) {
                *opening = Opening { value, std: rules.vacated_cells * config.fitting.cell_m, informed: true };
            }
        }
    }
    let ends: Vec<Opening> = shown
        .iter()
        .zip(&states)
        .zip(&fit.openings)
        .map(|(((_, t), state), seen)| open_end(&fit.joint, t, state, seen, config))
        .collect();
    let ends = left_where_found(shown, &ends, rules.at_odds_stds);
    let begins: Vec<Opening> = shown
        .iter()
        .zip(states.iter().zip(&ends))
        .map(|((_, t), (state, end))| closed_end(t, &fit.joint, closed, state, end, config))
        .collect();
    let ranges = ends.iter().zip(&begins).map(|(end, begin)| (end.value - begin.value).max(0.0)).collect();
    // The views share a hand, a depth estimate and an outline: covariances that take them for independent are too small.
    let (shared, spot) = (config.inference.shared_errors, rules.spot_std_m * rules.spot_std_m);
    let depth = OpenStates {
        across: fit.across,
        hinge_cov_m2: fit.hinge_cov_m2.map(|rows| {
            std::array::from_fn(|i| std::array::from_fn(|k| shared * rows[i][k] + if i == k { spot } else { 0.0 }))
        }),
        moved_std: ends.iter().zip(&begins).map(|(end, begin)| shared.sqrt() * end.std.hypot(begin.std)).collect(),
    };
    let openings = fit.openings.iter().flatten().map(|o| o.value).collect();
    let views = shows.open.iter().flatten().copied().collect();
    let widest = ends.iter().map(|end| end.value).fold(0.0, f64::max);
    Some(Refitted { joint: fit.joint, views, openings, ranges, widest, depth })
}

/// Along which of its front's axes (0 = right, 1 = up) a slide stays within the front; `None` for all other joints.
fn within_front(joint: &Articulation, face: &Face) -> Option<usize> {
    let along = [face.right, face.up].map(|a| joint.axis.dot(&a).abs());
    candidates::within_front(joint, &face.normal).then(|| usize::from(along[1] > along[0]))
}

/// Opening at the open end of a clip. After the hand let go the part stands there: what those views show counts, else what is
/// seen while the hand holds it, brought to the end of the hand's way.
fn open_end(
    joint: &Articulation,
    trajectory: &Trajectory,
    state: &OpenState,
    seen: &[Opening],
    config: &Config,
) -> Opening {
    let told = views::told(joint, &state.grip, state.views);
    let end = joint.opening_at(&state.grip, &trajectory.open_grip());
    // The median of what some views say, and the standard deviation of the surest of them: they share the hand's and the depth's
    // errors, so together they are no surer.
    let median = |of: &dyn Fn(usize) -> Option<f64>| -> Option<(f64, f64)> {
        let told: Vec<(f64, f64)> =
            seen.iter().enumerate().filter_map(|(i, opening)| Some((of(i)?, opening.std.powi(-2)))).collect();
        let surest =
            seen.iter().enumerate().filter(|(i, _)| of(*i).is_some()).map(|(_, o)| o.std).fold(f64::INFINITY, f64::min);
        Some((stats::weighted_median(&told)?, surest))
    };
    let of = |hold: Hold| median(&|i| (state.views[i].hold == hold && seen[i].informed).then_some(seen[i].value));
    let after = of(Hold::Left).or(of(Hold::Lost)).or(of(Hold::Free));
    // A hand is off by the same all along a clip: views that see the part on its way tell by how much.
    let on_way = |i: usize| state.views[i].hold == Hold::Sure && seen[i].informed;
    let during = median(&|i| on_way(i).then(|| seen[i].value - told[i]));
    let any = seen.iter().map(|o| o.std).fold(f64::INFINITY, f64::min);
    let (value, surest) = after.or(during.map(|(offset, std)| (end + offset, std))).unwrap_or((end, any));
    // A hand that was lost and a part that nobody saw afterwards leave the end open.
    let lever = joint.lever(&state.grip).max(config.part.least_lever_m);
    let unseen = after.is_none() && !trajectory.open_end_seen();
    let std = if unseen { surest.hypot(hands::grip_std_m(false, &config.hands.grips) / lever) } else { surest };
    Opening { value, std, informed: after.or(during).is_some() }
}

/// The views of the closed state between which and the hand nothing else was moved.
fn closed_views<'a>(
    footage: &Footage<'a>,
    shown: &ClipResult,
    trajectory: &Trajectory,
    config: &'a Config,
) -> Vec<views::View<'a>> {
    let grip = trajectory.closed_grip();
    let [first, last] = trajectory.contact_frames();
    if !config.localization.closed_state_frames {
        return Vec::new();
    }
    let Footage { recording, sketches, .. } = *footage;
    let between = |c: &Clip, frame: usize| c.start_frame < first && c.end_frame > frame && c.clip != shown.clip.clip;
    let frames: Vec<views::OpenFrame> = shown
        .closed_frames
        .iter()
        .copied()
        .filter(|&frame| match trajectory.action {
            Action::Open => frame <= last && !recording.clips.iter().any(|c| between(c, frame)),
            Action::Close => frame >= first,
        })
        .map(|frame| views::OpenFrame { frame, grip, hold: Hold::Sure })
        .collect();
    views::views(recording, sketches, &frames, &config.part)
}

/// Opening at the closed end of a clip: zero unless the part is seen to stand ajar.
fn closed_end(
    trajectory: &Trajectory,
    joint: &Articulation,
    closed: &Closed,
    state: &OpenState,
    end: &Opening,
    config: &Config,
) -> Opening {
    // Along its front a leaf shows no depth of its own. A hand alone tells the way, not the ends.
    if !end.informed || within_front(joint, &closed.face).is_some() {
        return Opening::SHUT;
    }
    let lever = joint.lever(&state.grip).max(config.part.least_lever_m);
    let known = ajar::Known {
        end: end.value,
        went: joint.opening_at(&state.grip, &trajectory.open_grip()),
        went_std: way_std_m(trajectory, &config.hands.grips) / lever,
        board_m: config.priors.boards.thickness_m,
        shut: config.priors.ranges.shut_share,
    };
    ajar::ajar(&closed.face, &closed.rect, joint, state.closed, &known, &config.part)
}

/// The openings that the hands alone tell, rad or m: each clip's, made one where a clip closes what the one before it opened.
pub(super) fn by_hand(shown: &[(&ClipResult, &Trajectory)], joint: &Articulation, config: &Config) -> Vec<f64> {
    let ends: Vec<Opening> = shown
        .iter()
        .map(|(_, t)| {
            let grip = t.closed_grip();
            let value = inference::observed_range(joint, &grip, &t.positions());
            let std = way_std_m(t, &config.hands.grips) / joint.lever(&grip).max(config.part.least_lever_m);
            Opening { value, std, informed: false }
        })
        .collect();
    left_where_found(shown, &ends, config.inference.states.at_odds_stds).iter().map(|end| end.value).collect()
}

/// Standard deviation of the way of a hand, metres: of both of its ends.
fn way_std_m(trajectory: &Trajectory, rules: &Grips) -> f64 {
    trajectory.ends_seen.map(|seen| hands::grip_std_m(seen, rules)).into_iter().fold(0.0, f64::hypot)
}

/// A part stays where it was left: the open end of a clip is where the next clip of the part finds it. Both clips' values
/// become their weighted mean, which is surer than either: each clip has a hand's and a depth's error of its own. Where they
/// are `at_odds` (standard deviations), one of the hands was followed on a part of its way only, and the farther one saw more of
/// it.
fn left_where_found(shown: &[(&ClipResult, &Trajectory)], ends: &[Opening], at_odds: f64) -> Vec<Opening> {
    let mut order: Vec<usize> = (0..shown.len()).collect();
    order.sort_by_key(|&i| (shown[i].0.clip.start_frame, i));
    let mut out = ends.to_vec();
    for pair in order.windows(2) {
        let (a, b) = (pair[0], pair[1]);
        if shown[a].1.action == Action::Open && shown[b].1.action == Action::Close {
            let [wa, wb] = [a, b].map(|i| ends[i].std.powi(-2));
            let apart = (ends[a].value - ends[b].value).abs() / ends[a].std.hypot(ends[b].std);
            if apart > at_odds && ends[a].informed && ends[b].informed {
                let farther = if ends[a].value > ends[b].value { ends[a] } else { ends[b] };
                for i in [a, b] {
                    out[i] = farther;
                }
            } else if (wa + wb).is_finite() && wa + wb > 0.0 {
                let value = (wa * ends[a].value + wb * ends[b].value) / (wa + wb);
                let std = (wa + wb).sqrt().recip();
                for i in [a, b] {
                    out[i] = Opening { value, std, ..ends[i] };
                }
            }
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::articulation::JointKind;
    use crate::hands::Sample;
    use crate::math::Vector;

    fn clip(start_frame: usize) -> ClipResult {
        let [clip, narration, verb, noun] = [(); 4].map(|()| String::new());
        let clip = Clip { clip, start_frame, end_frame: start_frame + 9, narration, verb, noun };
        ClipResult::unanswered(clip, String::new())
    }

    fn hand(action: Action) -> Trajectory {
        let at = Point::origin();
        let sample = Sample { frame: 0, time_secs: 0.0, observed: at, smoothed: at, accepted: true };
        Trajectory { side: None, samples: vec![sample], action, ends_seen: [true; 2] }
    }

    #[test]
    fn a_hinge_is_held_to_a_line_that_depth_does_not_speak_against() {
        let [x, y, z] = [Vector::x(), -Vector::y(), Vector::z()];
        let face = Face { center: Point::origin(), right: x, up: z, normal: y, extent: [[-1.0, 1.0]; 2], support: 1.0 };
        let rect = Rect { bounds: [[-0.4, 0.1], [-0.3, 0.3]] };
        let stops = [(0, -0.4, [-0.3, 0.3])];
        // Depth finds the hinge at `found` along the front, to 3 cm.
        let held = |found: f64, hinge_cov_m2: Option<[[f64; 2]; 2]>, stops: &[Stop]| {
            let hinge =
                |at: f64| Articulation { kind: JointKind::Revolute, axis: -z, origin: Point::new(at, 0.01, 0.0) };
            let depth = OpenStates { across: [y, x], hinge_cov_m2, moved_std: Vec::new() };
            let (openings, ranges) = (Vec::new(), Vec::new());
            let fit = Refitted { joint: hinge(found), views: Vec::new(), openings, ranges, widest: 0.0, depth };
            Believed { joint: hinge(-0.3), hinge_m: 0.02 }.at_side(&fit, &face, &rect, stops, &Config::default())
        };
        let three = Some([[1e-4, 0.0], [0.0, 9e-4]]);
        // As sure as a line tells hinges: half the way, and surer by the root of two. Nothing moves but along the front.
        let to = held(-0.35, three, &stops);
        assert!((to.joint.origin - Point::new(-0.35, 0.01, 0.0)).norm() < 1e-12, "{to:?}");
        assert!((to.hinge_m - 0.02 / 2f64.sqrt()).abs() < 1e-12, "{to:?}");
        // Nine centimetres are 2.5 standard deviations of 3 and 2 cm together.
        for (found, cov, stops) in [(-0.3, three, &stops[..]), (-0.35, None, &stops), (-0.35, three, &[])] {
            let as_before = held(found, cov, stops);
            assert!(as_before.hinge_m == 0.02 && as_before.joint.origin.x == -0.3, "{found} {as_before:?}");
        }
    }

    #[test]
    fn a_part_that_is_found_where_it_was_left_is_known_better_than_by_either_clip() {
        // In the order of time: opened, closed, closed once more.
        let (clips, hands) = ([20, 10, 30].map(clip), [Action::Close, Action::Open, Action::Close].map(hand));
        let shown: Vec<(&ClipResult, &Trajectory)> = clips.iter().zip(&hands).collect();
        let ends = [(1.1, 0.04), (1.0, 0.03), (0.5, 0.05)].map(|(value, std)| Opening { value, std, informed: true });
        let found = left_where_found(&shown, &ends, 4.0);
        // Variances of 16 and 9 to one of 144 / 25.
        assert!((found[0].std - 0.024).abs() < 1e-12 && (found[0].value - 1.036).abs() < 1e-12, "{found:?}");
        assert_eq!((found[0], found[2]), (found[1], ends[2]));
        // At odds: the hand that was followed on a part of its way saw less.
        let [farther, nearer] = [(1.8, 0.03), (0.4, 0.02)].map(|(value, std)| Opening { value, std, informed: true });
        let found = left_where_found(&shown, &[nearer, farther, ends[2]], 4.0);
        assert_eq!((found[0], found[1]), (farther, farther));
        // Where depth told one of them nothing both count as they are sure.
        let told = left_where_found(&shown, &[nearer, Opening { informed: false, ..farther }, ends[2]], 4.0);
        assert!(told[0].value > 0.4 && told[0].value < 1.8 && told[0].value == told[1].value, "{told:?}");
        // A clip without a view takes over what the other one saw.
        let unseen = [Opening { std: f64::INFINITY, ..ends[0] }, ends[1], ends[2]];
        let found = left_where_found(&shown, &unseen, 4.0);
        assert!((found[0].std - 0.03).abs() < 1e-12 && (found[0].value - 1.0).abs() < 1e-12, "{found:?}");
    }
}
