//! How far a part opens: what was observed, what a person would expect, and what stands in the way (ours).
//!
//! A recording shows an excursion, not a stop. The rule, by the geometry of the furniture and never by its name:
//!
//! | opens as | expected |
//! |---|---|
//! | leaf on an upright hinge | `priors.ranges.door_deg` |
//! | leaf hinged below (oven, dishwasher) | `priors.ranges.front_deg` |
//! | leaf hinged above (flap) | `priors.ranges.front_deg` |
//! | lid on a level face | `priors.ranges.lid_deg` |
//! | drawer | `priors.ranges.drawer_share` of its carcass's depth |
//! | leaf that slides along its face | its width less `priors.ranges.slider_overlap_m` |
//!
//! and never less than what was observed, nor further than the tray is long or the leaf wide. The limit is the largest
//! opening up to there at which the part touches nothing while all else is closed: not its neighbours, nor its own carcass,
//! nor the room. Where the recorded hand went the recording is believed: boards of less sure furniture that were assumed to
//! stand there go, the room is built around it (`room.rs`), and the limit falls below what was observed only where seen or
//! surer furniture stands in the way. [`crate::twin::Joint`] keeps observed, expected and limit, so that all of this can be
//! read off.

use crate::articulation::{Articulation, JointKind};
use crate::config;
use crate::geometry::Face;
use crate::math::{Point, Pose, Vector};
use crate::twin::{Furniture, OrientedBox, Part, Role, Solid};

use super::overlap;

/// Format: least limit, rad or m; a joint has a range; a hinge of less looks like half a turn whose degrees were read as radians.
const LEAST: [f64; 2] = [0.06, 0.01];
/// Numerics: openings between two looks at what is in the way, rad or m.
const STEP: [f64; 2] = [1.0 / 180.0 * std::f64::consts::PI, 0.005];

/// The one of two numbers that belongs to a kind of joint.
fn of(kind: JointKind, hinge_slide: [f64; 2]) -> f64 {
    match kind {
        JointKind::Revolute => hinge_slide[0],
        JointKind::Prismatic => hinge_slide[1],
    }
}

/// Least limit of a joint, rad or m.
pub(super) fn least(kind: JointKind) -> f64 {
    of(kind, LEAST)
}

/// How well the end of an observed motion is known, rad or m.
pub(super) fn noise(kind: JointKind, config: &config::Fitting) -> f64 {
    of(kind, config.observed_noise)
}

/// Whether a slide comes out of its face: a drawer, with a tray behind its front.
pub(super) fn comes_out(articulation: &Articulation, face: &Face) -> bool {
    articulation.kind == JointKind::Prismatic && articulation.axis.dot(&face.normal) > 0.9
}

/// What bounds how far a part opens.
pub(super) struct Travel {
    /// Largest opening that was observed, rad or m.
    pub(super) observed: f64,
    /// Of the carcass, metres.
    pub(super) depth: f64,
    /// How far the part can go at all, rad or m.
    pub(super) most: f64,
}

/// The opening that a person would expect, rad or m: at least the observed one.
pub(super) fn expected(
    articulation: &Articulation,
    face: &Face,
    up: &Vector,
    travel: &Travel,
    ranges: &config::Ranges,
) -> f64 {
    let Travel { observed, depth, most } = *travel;
    let usual = match articulation.kind {
        JointKind::Prismatic if comes_out(articulation, face) => ranges.drawer_share * depth,
        JointKind::Prismatic => most - ranges.slider_overlap_m,
        JointKind::Revolute if articulation.axis.dot(up).abs() > 0.5 => ranges.door_deg.to_radians(),
        JointKind::Revolute if face.is_horizontal(up) => ranges.lid_deg.to_radians(),
        JointKind::Revolute => ranges.front_deg.to_radians(),
    };
    usual.max(observed).min(most).max(least(articulation.kind))
}

/// Openings from `from` to `to` (rad or m) that are at most `step` apart, both ends among them, with the part's motions.
pub(super) fn motions(part: &Part, from: f64, to: f64, step: f64) -> Vec<(f64, Pose)> {
    /// Numerics: more poses tell nothing more.
    const MOST: f64 = 2000.0;
    let count = ((to - from).max(0.0) / step).ceil().clamp(1.0, MOST) as usize;
    (0..=count)
        .map(|i| from + (to - from) * i as f64 / count as f64)
        .map(|q| (q, part.joint.articulation.motion(q)))
        .collect()
}

/// A part on its way from one opening to another.
struct Way<'a> {
    part: &'a Part,
    /// rad or m.
    from: f64,
    to: f64,
    poses: Vec<(f64, Pose)>,
    bounds: Bounds,
}

impl<'a> Way<'a> {
    fn of(part: &'a Part, from: f64, to: f64) -> Self {
        let poses = motions(part, from, to, of(part.joint.articulation.kind, STEP));
        let corners = poses.iter().flat_map(|(_, m)| part.solids.iter().flat_map(move |s| s.shape.moved(m).corners()));
        let bounds = Bounds::of(corners);
        Self { part, from, to, poses, bounds }
    }

    /// The largest opening before the part touches one of the obstacles, one step short of it; the end of the way where it
    /// touches none. Nothing is said about the start.
    fn free(&self, obstacles: &[OrientedBox]) -> f64 {
        let step = of(self.part.joint.articulation.kind, STEP);
        // What the part never comes near is not asked about at every step.
        let near: Vec<&OrientedBox> =
            obstacles.iter().filter(|o| self.bounds.meets(&Bounds::of(o.corners()))).collect();
        if near.is_empty() {
            return self.to;
        }
        let touches = |motion: &Pose| {
            self.part.solids.iter().any(|s| {
                let moved = s.shape.moved(motion);
                near.iter().any(|o| overlap::boxes(&moved, o))
            })
        };
        let contact = self.poses.iter().skip(1).find(|(_, motion)| touches(motion));
        contact.map_or(self.to, |(q, _)| (q - 2.0 * step).max(self.from))
    }
}

/// Bounds along the world's axes.
#[derive(Debug, Clone, Copy)]
struct Bounds {
    low: Vector,
    high: Vector,
}

impl Bounds {
    fn of(points: impl IntoIterator<Item = Point>) -> Self {
        let empty = Self { low: Vector::repeat(f64::INFINITY), high: Vector::repeat(f64::NEG_INFINITY) };
        points.into_iter().fold(empty, |b, p| Self { low: b.low.inf(&p.coords), high: b.high.sup(&p.coords) })
    }

    fn meets(&self, other: &Self) -> bool {
        /// Geometry: between two poses a corner leaves the bounds of both by less.
        const SLACK_M: f64 = 0.01;
        (0..3).all(|k| self.low[k] - SLACK_M <= other.high[k] && other.low[k] - SLACK_M <= self.high[k])
    }
}

/// Everything of a piece of furniture, closed.
fn closed(piece: &Furniture) -> impl Iterator<Item = OrientedBox> {
    piece.carcass.iter().chain(&piece.part.solids).map(|s| s.shape)
}

/// A leaf that slides along its face and would run into its neighbours' fronts runs before them, as sliding doors do.
pub(super) fn before_neighbours(furniture: &mut [Furniture], boards: &config::Boards) {
    for i in 0..furniture.len() {
        let part = furniture[i].part.clone();
        let out: Vector = part.bounds.rotation.column(2).into_owned();
        let phi = part.joint.articulation;
        if phi.kind != JointKind::Prismatic || phi.axis.dot(&out).abs() > 0.3 {
            continue;
        }
        let others: Vec<OrientedBox> =
            furniture.iter().enumerate().filter(|(j, _)| *j != i).flat_map(|(_, f)| closed(f)).collect();
        let free = |part: &Part| Way::of(part, 0.0, part.joint.observed).free(&others);
        let moved = ahead(&part, &(out * (boards.thickness_m + 2.0 * boards.gap_m)));
        let clear = moved.solids.iter().all(|s| others.iter().all(|o| !overlap::boxes(&s.shape, o)));
        if clear && free(&moved) > free(&part) {
            furniture[i].part = moved;
        }
    }
}

/// A part elsewhere, with its joint.
fn ahead(part: &Part, by: &Vector) -> Part {
    let mut part = part.clone();
    for shape in part.solids.iter_mut().map(|s| &mut s.shape).chain([&mut part.bounds]) {
        shape.center += by;
    }
    part.handle += by;
    part.joint.articulation.origin += by;
    part
}

/// Sets each limit within what was observed: up to what stands in the way. `ranks[i]` is the place of piece `i` in the
/// order of sureness, 0 first; assumed boards of less sure pieces give way. Returns the pieces whose part cannot move at all.
pub(super) fn within_observed(furniture: &mut [Furniture], ranks: &[usize], config: &config::Fitting) -> Vec<usize> {
    let mut stuck = Vec::new();
    let mut order: Vec<usize> = (0..furniture.len().min(ranks.len())).collect();
    order.sort_by_key(|&i| ranks[i]);
    for &i in &order {
        let part = furniture[i].part.clone();
        let kind = part.joint.articulation.kind;
        let seen = part.joint.upper;
        // At the very end of the motion it is the observation that may be wrong.
        let sure = (seen - noise(kind, config)).max(0.0);
        let way = Way::of(&part, 0.0, sure);
        let in_the_way = |s: &Solid| s.role == Role::Carcass && !s.seen && way.free(&[s.shape]) < sure;
        for &j in order.iter().filter(|&&j| ranks[j] > ranks[i]) {
            let carcass = &mut furniture[j].carcass;
            let (gone, mut left): (Vec<Solid>, Vec<Solid>) = carcass.drain(..).partition(in_the_way);
            // A piece keeps one board to hang its part on.
            if left.is_empty() {
                left.extend(gone.into_iter().take(1));
            }
            *carcass = left;
        }
        let others: Vec<OrientedBox> = order.iter().filter(|&&j| j != i).flat_map(|&j| closed(&furniture[j])).collect();
        // Its own boards are assumed, too; where none would be left they limit it.
        let whole = Way::of(&part, 0.0, seen);
        let own = &mut furniture[i].carcass;
        if own.iter().any(|s| whole.free(&[s.shape]) >= seen) {
            own.retain(|s| whole.free(&[s.shape]) >= seen);
        }
        let others: Vec<OrientedBox> = others.into_iter().chain(own.iter().map(|s| s.shape)).collect();
        let upper = whole.free(&others);
        if upper < least(kind) && seen >= least(kind) {
            stuck.push(i);
        }
        furniture[i].part.joint.upper = upper.max(least(kind));
    }
    stuck
}

/// Lets each limit grow up to what is expected, as far as neighbours, the own carcass and the room leave it free.
pub(super) fn beyond_observed(furniture: &mut [Furniture], room: &[Solid]) {
    for i in 0..furniture.len() {
        let part = furniture[i].part.clone();
        let (from, to) = (part.joint.upper, part.joint.expected);
        if to <= from {
            continue;
        }
        let others = furniture.iter().enumerate().filter(|(j, _)| *j != i).flat_map(|(_, f)| closed(f));
        let fixed = furniture[i].carcass.iter().chain(room).map(|s| s.shape);
        let obstacles: Vec<OrientedBox> = others.chain(fixed).collect();
        furniture[i].part.joint.upper = Way::of(&part, from, to).free(&obstacles);
    }
}

/// Whether a part's weight has to be carried by a spring: hinges that are not upright only.
///
/// A leaf that its weight opens when it is shut or a crack open (hinged below: ovens, dishwashers; hung from a line before
/// its middle) would never stay shut without one. A
/// leaf that its weight shuts (flaps, lids) has one where a hand let go of it open and it stayed: `left_open` lists the
/// openings, rad, at which that was seen.
pub(super) fn balanced(part: &Part, up: &Vector, density: f64, left_open: &[f64], config: &config::Fitting) -> bool {
    let (ajar, least) = (config.ajar_rad, config.gravity_lever_m);
    let phi = part.joint.articulation;
    if phi.kind != JointKind::Revolute || phi.axis.dot(up).abs() > 0.5 {
        return false;
    }
    let Some(mass) = crate::twin::mass_properties(&part.solids, density) else { return false };
    // Torque for each newton of weight; positive opens.
    let lever = |q: f64| phi.axis.dot(&(phi.motion(q) * mass.center - phi.origin).cross(&-up));
    part.opens_by_itself(up, density)
        || lever(ajar) > least
        || left_open.iter().any(|&q| q > 4.0 * ajar && lever(q) < -least)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::twin::Joint;
    use nalgebra::Matrix3;

    const DOOR: f64 = 110.0;

    fn solid(role: Role, seen: bool, center: [f64; 3], half: [f64; 3]) -> Solid {
        let shape =
            OrientedBox { center: Point::from(center), half: Vector::from(half), rotation: Matrix3::identity() };
        Solid { name: String::new(), role, shape, seen }
    }

    /// A piece whose front is 0.5 m wide and 0.7 m tall at y = 0, looking towards -y, its left edge at x = 0; the carcass is
    /// its back alone.
    fn piece(kind: JointKind, observed: f64, expected: f64) -> Furniture {
        let front = solid(Role::Front, true, [0.25, 0.009, 0.35], [0.248, 0.009, 0.348]);
        let back = solid(Role::Carcass, false, [0.25, 0.5, 0.35], [0.25, 0.009, 0.35]);
        let axis = if kind == JointKind::Revolute { -Vector::z() } else { -Vector::y() };
        Furniture {
            name: String::new(),
            carcass: vec![back],
            part: Part {
                id: String::new(),
                label: String::new(),
                joint: Joint {
                    articulation: Articulation { kind, axis, origin: Point::new(0.0, 0.0, 0.35) },
                    upper: observed,
                    observed,
                    expected,
                    damping: 1.0,
                    friction: 1.0,
                    resistance_seen: false,
                    balanced: false,
                    probability: None,
                },
                handle: Point::new(0.45, -0.03, 0.4),
                bounds: front.shape,
                solids: vec![front],
            },
        }
    }

    fn limit(pieces: &mut [Furniture], room: &[Solid]) -> f64 {
        let ranks: Vec<usize> = (0..pieces.len()).collect();
        within_observed(pieces, &ranks, &config::Fitting::default());
        beyond_observed(pieces, room);
        pieces[0].part.joint.upper
    }

    #[test]
    fn a_door_seen_to_forty_degrees_opens_further_and_stops_before_the_wall() {
        let door = piece(JointKind::Revolute, 0.7, DOOR.to_radians());
        assert_eq!(limit(&mut [door.clone()], &[]), DOOR.to_radians());
        // A wall across, 0.4 m before the front: the free edge meets it where 0.498 sin(q) is 0.4.
        let wall = solid(Role::Room, true, [0.0, -0.5, 0.5], [3.0, 0.1, 1.0]);
        let stop = limit(&mut [door.clone()], &[wall]);
        let meets = (0.4f64 / 0.498).asin();
        assert!(stop < meets && stop > meets - 4f64.to_radians(), "{stop} {meets}");
        // Where the recorded hand went the room does not stop it: there the room is carved.
        let mut further = [piece(JointKind::Revolute, 1.4, DOOR.to_radians())];
        assert!(limit(&mut further, &[solid(Role::Room, true, [0.0, -0.5, 0.5], [3.0, 0.1, 1.0])]) >= 1.4);
    }

    #[test]
    fn a_drawer_in_a_corner_stops_before_the_other_row_and_keeps_what_was_observed() {
        // The other row faces this one, 0.3 m away: its front was seen, its side board is assumed.
        let mut other = piece(JointKind::Prismatic, 0.1, 0.1);
        other.part.solids = vec![solid(Role::Front, true, [0.25, -0.31, 0.35], [0.25, 0.009, 0.35])];
        other.part.joint.articulation.axis = Vector::z();
        other.carcass = vec![solid(Role::Carcass, false, [0.25, -0.7, 0.35], [0.25, 0.3, 0.35])];
        let stop = limit(&mut [piece(JointKind::Prismatic, 0.2, 0.44), other.clone()], &[]);
        assert!(stop < 0.301 && stop > 0.28, "{stop}");
        // An assumed board in the observed way goes, the front does not.
        let board = solid(Role::Carcass, false, [0.25, -0.1, 0.35], [0.25, 0.01, 0.35]);
        other.carcass.push(board);
        let mut pieces = [piece(JointKind::Prismatic, 0.2, 0.44), other];
        let stop = limit(&mut pieces, &[]);
        assert!(stop < 0.301 && stop > 0.28 && pieces[1].carcass.len() == 1, "{stop}");
        let mut blocked = pieces.clone();
        blocked[1].part.solids[0].shape.center.y = -0.1;
        blocked[0].part.joint.upper = 0.2;
        let stop = limit(&mut blocked, &[]);
        assert!(stop < blocked[0].part.joint.observed && stop > 0.07, "{stop}");
    }

    #[test]
    fn what_is_expected_follows_from_the_shape_and_never_falls_below_what_was_observed() {
        let face = |normal: Vector, up: Vector| Face {
            center: Point::origin(),
            right: up.cross(&normal),
            up,
            normal,
            extent: [[-0.3, 0.3]; 2],
            support: 1.0,
        };
        let front = face(-Vector::y(), Vector::z());
        let lid = face(Vector::z(), Vector::y());
        let hinge = |axis: Vector| Articulation { kind: JointKind::Revolute, axis, origin: Point::new(0.0, 0.0, 0.4) };
        let slide = |axis: Vector| Articulation { kind: JointKind::Prismatic, axis, origin: Point::origin() };
        let turn = std::f64::consts::PI;
        let ranges = config::Ranges::default();
        let degrees = |phi: Articulation, face: &Face, observed: f64| {
            expected(&phi, face, &Vector::z(), &Travel { observed, depth: 0.5, most: turn }, &ranges).to_degrees()
        };
        assert!((degrees(hinge(Vector::z()), &front, 0.7) - DOOR).abs() < 1e-9);
        assert!((degrees(hinge(Vector::z()), &front, 2.2) - 2.2f64.to_degrees()).abs() < 1e-9);
        assert!((degrees(hinge(Vector::x()), &front, 0.7) - ranges.front_deg).abs() < 1e-9);
        assert!((degrees(hinge(Vector::x()), &lid, 0.7) - ranges.lid_deg).abs() < 1e-9);
        let metres = |phi: Articulation, observed: f64, most: f64| {
            expected(&phi, &front, &Vector::z(), &Travel { observed, depth: 0.5, most }, &ranges)
        };
        assert!((metres(slide(-Vector::y()), 0.2, 0.476) - 0.4).abs() < 1e-12);
        assert!((metres(slide(-Vector::y()), 0.6, 0.476) - 0.476).abs() < 1e-12);
        assert!((metres(slide(Vector::x()), 0.2, 0.6) - 0.57).abs() < 1e-12);
    }

    #[test]
    fn what_its_weight_opens_is_balanced_and_a_flap_only_where_it_stayed() {
        let up = Vector::z();
        let balanced = |part: &Part, up: &Vector, density: f64, left_open: &[f64]| {
            balanced(part, up, density, left_open, &config::Fitting::default())
        };
        let mut oven = piece(JointKind::Revolute, 1.0, 1.6).part;
        oven.joint.articulation =
            Articulation { kind: JointKind::Revolute, axis: Vector::x(), origin: Point::new(0.25, 0.0, 0.0) };
        let mut flap = oven.clone();
        flap.joint.articulation.origin.z = 0.7;
        flap.joint.articulation.axis = -Vector::x();
        // Both open towards -y.
        for part in [&oven, &flap] {
            let middle = part.joint.articulation.motion(0.5) * part.bounds.center;
            assert!(middle.y < -0.05, "{middle:?}");
        }
        assert!(balanced(&oven, &up, 700.0, &[]));
        assert!(!balanced(&flap, &up, 700.0, &[]) && balanced(&flap, &up, 700.0, &[1.2]));
        assert!(!balanced(&piece(JointKind::Revolute, 1.0, 1.6).part, &up, 700.0, &[1.2]));
        // Hung from its front edge its middle is behind the hinge: friction holds it, or it stands ajar.
        flap.joint.friction = 0.2;
        assert!(balanced(&flap, &up, 700.0, &[]));
    }
}
