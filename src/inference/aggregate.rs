//! Clips of one joint found and merged into one scene-level joint (§3.4, §C.2).

use super::{mean_direction, paper};
use crate::articulation::{Action, Articulation, JointKind};
use crate::config::{self, GroupingMethod};
use crate::geometry::Face;
use crate::geometry::Rect;
use crate::math::{Point, Vector, signed_angle, unsigned_angle};

/// What tells whether two clips show one part.
#[derive(Debug, Clone, Copy)]
pub struct Held<'a> {
    /// Opening or closing.
    pub action: Action,
    /// The grip at the closed and the open end, as far as the hand was seen.
    pub closed: Point,
    /// The grip at the open end.
    pub open: Point,
    /// Outward normal of the touched face, where one was found.
    pub normal: Option<Vector>,
    /// The hand's way, world.
    pub path: &'a [Point],
    /// The furniture's name, where the narration has one.
    pub furniture: Option<&'a str>,
    /// What that name says about the type.
    pub kind: Option<JointKind>,
    /// The face and the part of it that moved, where it was seen.
    pub part: Option<(Face, Rect)>,
    /// The clip's own joint, where there is one.
    pub joint: Option<Articulation>,
    /// Confident voxels of the touched furniture, sorted; none where it was not found.
    pub voxels: &'a [[i32; 3]],
}

/// A clip that moves something, in which no hand was followed.
#[derive(Debug, Clone, Copy)]
pub struct Missed<'a> {
    /// How many of the clips with a hand come before it.
    pub after: usize,
    /// The furniture's name, where the narration has one.
    pub furniture: Option<&'a str>,
}

/// Groups clips that show one part, given in the order of time. Returns indices into `clips`.
///
/// Two clips belong together if the grip was at the same place of the same face when closed; or if one closes what the other
/// left open: people take hold of a part where they left it, and what is closed was open. The paper's grouping asks for their
/// voxels instead ([`paper::same_voxels`]).
#[must_use]
pub fn group(clips: &[Held], missed: &[Missed], config: &config::Inference) -> Vec<Vec<usize>> {
    if !config.merge_clips {
        return (0..clips.len()).map(|i| vec![i]).collect();
    }
    if config.grouping == GroupingMethod::Voxels {
        return paper::same_voxels(&clips.iter().map(|c| c.voxels).collect::<Vec<_>>(), config);
    }
    let mut groups: Vec<Vec<usize>> = Vec::new();
    for (i, clip) in clips.iter().enumerate() {
        let continues = |g: &Vec<usize>| g.last() == Some(&i.wrapping_sub(1)) && closes(&clips[i - 1], clip, config);
        let distance =
            |g: &Vec<usize>| g.iter().map(|&j| (clips[j].closed - clip.closed).norm()).fold(f64::INFINITY, f64::min);
        let same = |g: &usize| groups[*g].iter().any(|&j| same_place(&clips[j], clip, config));
        let nearest = |a: &usize, b: &usize| distance(&groups[*a]).total_cmp(&distance(&groups[*b]));
        let home = groups
            .iter()
            .position(continues)
            .or_else(|| only_one_open(&groups, clips, missed, i, config))
            .or_else(|| (0..groups.len()).filter(same).min_by(nearest))
            .or_else(|| opened_before(&groups, clips, missed, i, config));
        match home {
            Some(home) => groups[home].push(i),
            None => groups.push(vec![i]),
        }
    }
    groups
}

/// The part that clip `i` closes because no other of its name stands open within reach of the hand's way. Hands that were seen
/// badly or in part only are far apart even on one part; what was left open decides then. Where the furniture has no name,
/// only the clip before counts.
fn only_one_open(
    groups: &[Vec<usize>],
    clips: &[Held],
    missed: &[Missed],
    i: usize,
    config: &config::Inference,
) -> Option<usize> {
    let clip = &clips[i];
    if clip.action != Action::Close {
        return None;
    }
    let mut open = (0..groups.len()).filter(|&g| {
        groups[g].last().is_some_and(|&j| {
            let before = &clips[j];
            let named = match (before.furniture, clip.furniture) {
                (Some(a), Some(b)) => a == b,
                _ => j + 1 == i && names_agree(before, clip),
            };
            // What nobody saw may have closed that one, or opened another.
            let unseen = missed
                .iter()
                .any(|m| (j + 1..=i).contains(&m.after) && m.furniture.zip(clip.furniture).is_none_or(|(a, b)| a == b));
            before.action == Action::Open
                && named
                && !unseen
                && (j + 1 == i || faces_agree(before, clip, config))
                && apart(before.path, clip.path) <= config.merge_open_m
        })
    });
    open.next().filter(|_| open.next().is_none())
}

/// The part that was opened right before clip `i` closes something within reach of it, if nothing that is called as in `i` was
/// left open: people call one thing by two names sooner than they close what is shut.
fn opened_before(
    groups: &[Vec<usize>],
    clips: &[Held],
    missed: &[Missed],
    i: usize,
    config: &config::Inference,
) -> Option<usize> {
    let (clip, before) = (&clips[i], &clips[i.checked_sub(1)?]);
    let left_open = |g: &Vec<usize>| {
        let last = g.last().map(|&j| &clips[j]).filter(|c| c.action == Action::Open);
        last.is_some_and(|c| c.furniture.zip(clip.furniture).is_some_and(|(a, b)| a == b))
    };
    let closes = (before.action, clip.action) == (Action::Open, Action::Close)
        && apart(before.path, clip.path) <= config.merge_open_m
        && !missed.iter().any(|m| m.after == i)
        && !groups.iter().any(left_open);
    groups.iter().position(|g| closes && g.last() == Some(&(i - 1)))
}

/// Shortest distance between the points of two paths; infinite where one has none.
fn apart(a: &[Point], b: &[Point]) -> f64 {
    a.iter().flat_map(|p| b.iter().map(move |q| (p - q).norm())).fold(f64::INFINITY, f64::min)
}

fn names_agree(a: &Held, b: &Held) -> bool {
    a.kind.zip(b.kind).is_none_or(|(a, b)| a == b)
}

/// Whether `b` closes what `a` opened.
fn closes(a: &Held, b: &Held, config: &config::Inference) -> bool {
    a.action == Action::Open
        && b.action == Action::Close
        && names_agree(a, b)
        && (a.open - b.open).norm() <= config.merge_grip_m
}

fn faces_agree(a: &Held, b: &Held, config: &config::Inference) -> bool {
    a.normal.zip(b.normal).is_none_or(|(a, b)| signed_angle(&a, &b) <= config.merge_angle_deg.to_radians())
}

/// Whether the grips coincide when closed.
fn same_place(a: &Held, b: &Held, config: &config::Inference) -> bool {
    // A part is opened and closed in turn: two openings in a row are two parts unless their grips nearly coincide.
    let limit = if a.action == b.action { config.merge_same_action * config.merge_grip_m } else { config.merge_grip_m };
    faces_agree(a, b, config)
        && (a.closed - b.closed).norm() <= limit
        && outlines_agree(a, b, config)
        && hinges_agree(a.joint, b.joint, config)
}

/// Handles of neighbours can be a hand's width apart; the parts behind them do not overlap. An outline that was seen badly
/// is too large rather than elsewhere, so the overlap is measured against the smaller one.
fn outlines_agree(a: &Held, b: &Held, config: &config::Inference) -> bool {
    let (Some((face, mine)), Some((other_face, theirs))) = (&a.part, &b.part) else { return true };
    let shared = shared((face, mine), (other_face, theirs));
    shared.of_smaller >= config.merge_shared
}

/// How far two outlines overlap.
struct Shared {
    /// Share of the smaller one that lies on the larger one.
    of_smaller: f64,
    /// Intersection over union.
    iou: f64,
}

fn shared((face, mine): (&Face, &Rect), (other_face, theirs): (&Face, &Rect)) -> Shared {
    // A lid's axes lie as the person stood: the other outline is turned onto this face.
    let corners = [0, 1, 2, 3].map(|i| {
        let at = face.coordinates(&other_face.point(theirs.bounds[0][i % 2], theirs.bounds[1][i / 2], 0.0));
        [at[0], at[1]]
    });
    let along = |k: usize| {
        let at = corners.map(|c| c[k]);
        [at.into_iter().fold(f64::INFINITY, f64::min), at.into_iter().fold(f64::NEG_INFINITY, f64::max)]
    };
    let theirs = [along(0), along(1)];
    let both: f64 =
        (0..2).map(|k| (mine.bounds[k][1].min(theirs[k][1]) - mine.bounds[k][0].max(theirs[k][0])).max(0.0)).product();
    let [a, b] = [mine.bounds, theirs].map(|b| (b[0][1] - b[0][0]) * (b[1][1] - b[1][0]));
    Shared { of_smaller: both / a.min(b), iou: both / (a + b - both) }
}

/// What the clips of one group say of the closed part.
#[derive(Debug, Clone, Copy)]
pub struct Front {
    /// Its face.
    pub face: Face,
    /// Its outline on the face.
    pub rect: Rect,
    /// Where it was held, world.
    pub grip: Point,
    /// The joint, where its type is sure.
    pub joint: Option<Articulation>,
}

/// Which of the groups are one part after all: no two parts cover the same piece of a face. Indices into `fronts`, each group
/// with those that join it, in order.
#[must_use]
pub fn same_fronts(fronts: &[Option<Front>], config: &config::Inference) -> Vec<Vec<usize>> {
    // The paper's grouping knows no fronts.
    let asked = config.merge_clips && config.grouping == GroupingMethod::Places;
    let mut sets: Vec<Vec<usize>> = Vec::new();
    for (i, front) in fronts.iter().enumerate() {
        let meets = |&j: &usize| front.zip(fronts[j]).is_some_and(|(a, b)| asked && cover_one_place(&a, &b, config));
        let (mut joined, apart): (Vec<Vec<usize>>, _) = sets.into_iter().partition(|set| set.iter().any(meets));
        joined.push(vec![i]);
        let mut set = joined.concat();
        set.sort_unstable();
        sets = apart;
        sets.push(set);
    }
    sets.sort();
    sets
}

/// Both outlines are nearly one; or they overlap and each contains the other's grip: one that was seen badly may reach over a
/// neighbour, which then is held outside of it. What lies deeper is another part, as a drawer behind a door.
fn cover_one_place(a: &Front, b: &Front, config: &config::Inference) -> bool {
    let holds = |on: &Front, grip: &Point| {
        let at = on.face.coordinates(grip);
        (0..2).all(|k| {
            at[k] >= on.rect.bounds[k][0] - config.merge_beside_m
                && at[k] <= on.rect.bounds[k][1] + config.merge_beside_m
        })
    };
    let shared = shared((&a.face, &a.rect), (&b.face, &b.rect));
    hinges_agree(a.joint, b.joint, config)
        && signed_angle(&a.face.normal, &b.face.normal) <= config.merge_angle_deg.to_radians()
        && a.face.coordinates(&b.face.center)[2].abs() <= config.merge_deeper_m
        && (shared.iou >= config.merge_nearly_one
            || (shared.of_smaller >= config.merge_shared && holds(a, &b.grip) && holds(b, &a.grip)))
}

/// Two doors side by side are hinged at their outer edges: both hinges are sure and far apart.
fn hinges_agree(a: Option<Articulation>, b: Option<Articulation>, config: &config::Inference) -> bool {
    let (Some(a), Some(b)) = (a, b) else { return true };
    if a.kind != JointKind::Revolute || b.kind != JointKind::Revolute {
        return true;
    }
    unsigned_angle(&a.axis, &b.axis) > config.merge_hinge_deg.to_radians()
        || a.line().distance(&b.origin) < config.merge_hinge_m
}

/// Consensus about `seed`: of the joints of its type those that agree with it (10 degrees, 12 cm) are averaged, directions
/// by PCA, origins where they pass the seed's.
#[must_use]
pub fn consensus(seed: &Articulation, joints: &[(Articulation, f64)]) -> Articulation {
    /// Definition: what agrees, degrees and metres.
    const ANGLE_DEG: f64 = 10.0;
    /// Definition: the same of hinges, metres.
    const HINGE_M: f64 = 0.12;
    let agreeing: Vec<(Articulation, f64)> = joints
        .iter()
        .filter(|(j, w)| {
            *w > 0.0
                && j.kind == seed.kind
                && unsigned_angle(&j.axis, &seed.axis) < ANGLE_DEG.to_radians()
                && (j.kind == JointKind::Prismatic || seed.line().distance(&j.origin) < HINGE_M)
        })
        .copied()
        .collect();
    let total: f64 = agreeing.iter().map(|(_, w)| w).sum();
    let directions: Vec<(Vector, f64)> =
        std::iter::once((seed.axis, 1e-9)).chain(agreeing.iter().map(|(j, w)| (j.axis, *w))).collect();
    let (Some(axis), true) = (mean_direction(&directions), total > 0.0) else { return *seed };
    let origin = agreeing.iter().fold(Vector::zeros(), |sum, (j, w)| {
        // Along a hinge an origin is free.
        let here = if seed.kind == JointKind::Revolute { j.line().project(&seed.origin) } else { j.origin };
        sum + here.coords * (w / total)
    });
    Articulation { kind: seed.kind, axis, origin: Point::from(origin) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::rotation;

    fn hinge(tilt: f64, x: f64) -> Articulation {
        Articulation {
            kind: JointKind::Revolute,
            axis: rotation(&Vector::x(), tilt) * Vector::z(),
            origin: Point::new(x, 0.0, 3.0 * x),
        }
    }

    #[test]
    fn an_outlier_does_not_move_the_consensus() {
        let joints = [
            (hinge(0.02, 0.01), 1.0),
            (hinge(-0.02, -0.01), 1.0),
            (hinge(0.0, 0.6), 1.0),
            (Articulation { kind: JointKind::Prismatic, ..hinge(0.0, 0.0) }, 5.0),
        ];
        let merged = consensus(&joints[0].0, &joints);
        assert!(unsigned_angle(&merged.axis, &Vector::z()) < 1e-3);
        assert!(merged.line().distance(&Point::origin()) < 2e-3, "{merged:?}");
    }

    fn held(action: Action, closed: [f64; 3], open: [f64; 3]) -> Held<'static> {
        let (closed, open) = (Point::from(closed), Point::from(open));
        let normal = Some(Vector::y());
        Held {
            action,
            closed,
            open,
            normal,
            path: &[],
            furniture: None,
            kind: None,
            part: None,
            joint: None,
            voxels: &[],
        }
    }

    #[test]
    fn drawers_of_a_stack_stay_apart() {
        let clips = [
            held(Action::Open, [0.0, 0.0, 0.7], [0.0, 0.4, 0.7]),
            held(Action::Open, [0.0, 0.0, 0.5], [0.0, 0.4, 0.5]),
            held(Action::Close, [0.0, 0.02, 0.52], [0.0, 0.38, 0.5]),
            held(Action::Close, [0.0, 0.02, 0.69], [0.0, 0.4, 0.7]),
        ];
        assert_eq!(group(&clips, &[], &config::Inference::default()), [vec![0, 3], vec![1, 2]]);
    }

    #[test]
    fn the_papers_grouping_asks_for_voxels_and_for_nothing_else() {
        let rows: [Vec<[i32; 3]>; 3] = [0..9, 20..29, 1..9].map(|xs| xs.map(|x| [x, 0, 0]).collect());
        let [here, far, again] = &rows;
        // One grip when closed, which tells them to be one part.
        let clip = |voxels| Held { voxels, ..held(Action::Open, [0.0, 0.0, 0.7], [0.0, 0.4, 0.7]) };
        let clips = [here, far, again].map(|row| clip(row.as_slice()));
        let with = |grouping| config::Inference { grouping, ..Default::default() };
        assert_eq!(group(&clips, &[], &with(GroupingMethod::Places)), [vec![0, 1, 2]]);
        assert_eq!(group(&clips, &[], &with(GroupingMethod::Voxels)), [vec![0, 2], vec![1]]);
        let apart = config::Inference { merge_clips: false, ..with(GroupingMethod::Voxels) };
        assert_eq!(group(&clips, &[], &apart).len(), 3);
    }

    #[test]
    fn a_closing_whose_end_was_not_seen_belongs_to_the_opening_before_it() {
        let clips = [
            held(Action::Open, [0.0, 0.0, 0.7], [0.3, 0.4, 0.7]),
            held(Action::Close, [0.25, 0.3, 0.7], [0.31, 0.42, 0.72]),
        ];
        assert_eq!(group(&clips, &[], &config::Inference::default()), [vec![0, 1]]);
    }

    #[test]
    fn what_is_closed_is_what_stands_open() {
        let at = |x: f64| vec![Point::new(x, 0.0, 0.7), Point::new(x, 0.3, 0.7)];
        let (here, near, far) = (at(0.0), at(0.25), at(3.0));
        let drawer = |action, path: &'static [Point]| {
            let [closed, open] = [path[0], path[1]].map(|p| p.coords.into());
            Held { path, furniture: Some("drawer"), ..held(action, closed, open) }
        };
        let [here, near, far] = [here, near, far].map(|p| &*p.leak());
        let config = config::Inference::default();
        // Seen 25 cm apart, with another drawer opened in between.
        let clips = [drawer(Action::Open, here), drawer(Action::Open, far), drawer(Action::Close, near)];
        assert_eq!(group(&clips, &[], &config), [vec![0, 2], vec![1]]);
        // Two stand open: the distance alone does not tell.
        let clips = [drawer(Action::Open, here), drawer(Action::Open, at(0.5).leak()), drawer(Action::Close, near)];
        assert_eq!(group(&clips, &[], &config).len(), 3);
        // Closed already, and called by another name right after it was opened.
        let closed = drawer(Action::Close, here);
        assert_eq!(group(&[drawer(Action::Open, here), closed, drawer(Action::Close, near)], &[], &config).len(), 2);
        let oven = Held { furniture: Some("oven"), ..drawer(Action::Close, near) };
        assert_eq!(group(&[drawer(Action::Open, here), oven], &[], &config).len(), 1);
        // Unless that is elsewhere, something was opened since, or nobody knows.
        assert_eq!(group(&[drawer(Action::Open, far), oven], &[], &config).len(), 2);
        assert_eq!(group(&[drawer(Action::Open, here), drawer(Action::Open, far), oven], &[], &config).len(), 3);
        let [bin, far_oven] = [("bin", here), ("oven", far)]
            .map(|(name, path)| Held { furniture: Some(name), ..drawer(Action::Open, path) });
        assert_eq!(group(&[far_oven, bin, oven], &[], &config).len(), 3);
        let unseen = [Missed { after: 1, furniture: Some("drawer") }];
        assert_eq!(group(&[drawer(Action::Open, here), oven], &unseen, &config).len(), 2);
        // A clip that nobody saw in between, unless it is of another name.
        let unseen = |furniture| [Missed { after: 1, furniture }];
        let clips = [drawer(Action::Open, here), drawer(Action::Close, near)];
        assert_eq!(group(&clips, &unseen(Some("drawer")), &config).len(), 2);
        assert_eq!(group(&clips, &unseen(None), &config).len(), 2);
        assert_eq!(group(&clips, &unseen(Some("oven")), &config).len(), 1);
        // Without a name, right after it only.
        let it = Held { furniture: None, ..drawer(Action::Close, near) };
        assert_eq!(group(&[drawer(Action::Open, here), it], &[], &config).len(), 1);
        assert_eq!(group(&[drawer(Action::Open, here), drawer(Action::Open, far), it], &[], &config).len(), 3);
    }

    #[test]
    fn no_two_parts_cover_one_piece_of_a_face() {
        let face = |depth: f64| Face {
            center: Point::new(0.0, depth, 0.5),
            normal: Vector::y(),
            up: Vector::z(),
            right: -Vector::x(),
            extent: [[-1.0, 1.0]; 2],
            support: 1.0,
        };
        let front = |depth: f64, [left, right]: [f64; 2], [low, high]: [f64; 2], grip: [f64; 2]| {
            let face = face(depth);
            let grip = face.center + face.right * grip[0] + face.up * grip[1];
            Some(Front { face, rect: Rect { bounds: [[left, right], [low, high]] }, grip, joint: None })
        };
        let config = config::Inference::default();
        let drawer = front(0.0, [-0.3, 0.3], [-0.1, 0.1], [0.0, 0.05]);
        let again = front(0.02, [-0.25, 0.3], [-0.1, 0.1], [0.05, 0.0]);
        let below = front(0.0, [-0.3, 0.3], [-0.3, -0.1], [0.0, -0.2]);
        // Seen to reach over the one below.
        let tall = front(0.0, [-0.3, 0.3], [-0.3, 0.1], [0.0, 0.05]);
        // Behind a door.
        let inner = front(-0.15, [-0.3, 0.3], [-0.1, 0.1], [0.0, 0.0]);
        assert_eq!(same_fronts(&[drawer, below, None, again], &config), [vec![0, 3], vec![1], vec![2]]);
        assert_eq!(same_fronts(&[tall, below, inner], &config), [vec![0], vec![1], vec![2]]);
        // Hinges at both outer edges, under outlines that reach over both leaves.
        let hinge =
            |x: f64| Articulation { kind: JointKind::Revolute, axis: Vector::z(), origin: Point::new(x, 0.0, 0.5) };
        let hung = |front: Option<Front>, x: f64| front.map(|f| Front { joint: Some(hinge(x)), ..f });
        assert_eq!(same_fronts(&[hung(drawer, -0.3), hung(again, 0.3)], &config).len(), 2);
        // A lid seen from its other side.
        let turned = again.map(|f| {
            let Rect { bounds: [[left, right], [low, high]] } = f.rect;
            let rect = Rect { bounds: [[-right, -left], [-high, -low]] };
            Front { face: Face { right: -f.face.right, up: -f.face.up, ..f.face }, rect, ..f }
        });
        assert_eq!(same_fronts(&[drawer, turned], &config).len(), 1);
        let apart = config::Inference { merge_clips: false, ..config };
        assert_eq!(same_fronts(&[drawer, again], &apart).len(), 2);
    }
}
