//! Do two sights of closed parts show one part? One number tells: the log likelihood of what was seen under one part, less that
//! under two parts beside each other (ours).
//!
//! It is a sum of terms, one for each kind of evidence, each taken as independent of the others. Every likelihood has a share of
//! things that were seen badly, so that no term can decide against all others. Where a hand was seen badly, so were the face, the
//! outline and the hinge that were looked for near it: they have one such share together. The numbers are `inference.same_part`;
//! what usual cases add up to is in `docs/evidence.md`.

use std::f64::consts::{FRAC_PI_4, PI, TAU};

use crate::articulation::{Articulation, JointKind};
use crate::config::{Config, SamePart};
use crate::geometry::{Face, Rect};
use crate::math::{Point, signed_angle, unsigned_angle};
use crate::recording::narration::Reading;

/// What a part was called.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Name<'a> {
    /// The furniture's name; none where people said "it".
    pub furniture: Option<&'a str>,
    /// What that name says about the type.
    pub kind: Option<JointKind>,
}

impl<'a> Name<'a> {
    /// The name in a narration, where it has one.
    #[must_use]
    pub fn of(reading: Option<&'a Reading>) -> Self {
        reading.map_or_else(Self::default, |r| Self { furniture: r.furniture.as_deref(), kind: r.kind })
    }
}

/// What one clip, or all clips of a part together, show of a closed part.
#[derive(Debug, Clone, Copy)]
pub struct Sight<'a> {
    /// Where it was held, world.
    pub grip: Point,
    /// Standard deviation of `grip` along the motion, metres.
    pub grip_std_m: f64,
    /// The touched face, where one was seen.
    pub face: Option<Face>,
    /// The part of the face that moved, where it was seen to move.
    pub outline: Option<Rect>,
    /// The joint, where its type is sure.
    pub joint: Option<Articulation>,
    /// What it was called.
    pub name: Name<'a>,
}

/// Definition: kinds of evidence beside the hands: faces, outlines, hinges.
const KINDS: usize = 3;

/// Evidence for one part.
#[derive(Debug, Clone, Copy)]
pub(super) struct Terms {
    pub(super) hands: HandOdds,
    /// Nats of each kind if the hands were seen well, none where it was not seen.
    pub(super) seen: [Option<f64>; KINDS],
    /// Nats of the names.
    pub(super) names: Option<f64>,
}

/// Odds of one part by the hands.
#[derive(Debug, Clone, Copy)]
pub(super) struct HandOdds {
    /// If they were seen as well as their standard deviations say.
    pub(super) well: f64,
    /// If one of them was seen badly.
    pub(super) badly: f64,
}

/// Log odds of one part against two parts beside each other, nats.
#[must_use]
pub fn log_odds(a: &Sight, b: &Sight, config: &Config) -> f64 {
    let model = Model::of(config);
    together(&[(1.0, model.terms(a, b, model.grips(a, b)))], model.rules.badly_seen)
}

/// The natural logarithm of an odds ratio, finite where it is too small for a number.
pub(super) fn nats(odds: f64) -> f64 {
    odds.max(f64::MIN_POSITIVE).ln()
}

/// The numbers behind the odds.
#[derive(Debug, Clone, Copy)]
pub(super) struct Model<'a> {
    pub(super) rules: &'a SamePart,
    /// How far apart two hands on one handle are found, apart from how well each of them is seen: a variance in each direction,
    /// m^2.
    apart_m2: f64,
    name_accuracy: f64,
}

impl<'a> Model<'a> {
    pub(super) fn of(config: &'a Config) -> Self {
        let rules = &config.inference.same_part;
        // Each hand is anywhere along the handle: the variance of an even distribution is a third of its half length squared.
        let along = config.priors.handles.bar_half_length_m.powi(2) / 3.0;
        let apart_m2 = 2.0 * (rules.hand_bias_m.powi(2) + along);
        Self { rules, apart_m2, name_accuracy: config.reasoning.name_accuracy }
    }

    /// What a sight is worth among others of its part: the better its grip was seen, the more.
    pub(super) fn worth(&self, sight: &Sight) -> f64 {
        (sight.grip_std_m.powi(2) + self.rules.hand_bias_m.powi(2)).recip()
    }

    /// How far hands of such standard deviations are found apart on one handle: a variance in each direction, m^2.
    pub(super) fn variance(&self, a_std_m: f64, b_std_m: f64) -> f64 {
        a_std_m.powi(2) + b_std_m.powi(2) + self.apart_m2
    }

    /// Odds of one part where two hands are such a distance apart: their density about one handle, against that of other parts'
    /// handles on the furniture around.
    pub(super) fn near(&self, distance_m: f64, variance: f64) -> HandOdds {
        let SamePart { elsewhere_m, parts_per_m2, .. } = *self.rules;
        let odds = |v: f64| (-0.5 * distance_m.powi(2) / v).exp() / (TAU * v * parts_per_m2);
        HandOdds { well: odds(variance), badly: odds(variance.max(elsewhere_m.powi(2))) }
    }

    /// Odds by the closed grips.
    pub(super) fn grips(&self, a: &Sight, b: &Sight) -> HandOdds {
        self.near((a.grip - b.grip).norm(), self.variance(a.grip_std_m, b.grip_std_m))
    }

    /// All kinds of evidence, that of the hands given.
    pub(super) fn terms(&self, a: &Sight, b: &Sight, hands: HandOdds) -> Terms {
        let faces = a.face.zip(b.face);
        let outlines = faces.zip(a.outline.zip(b.outline)).and_then(|(faces, rects)| {
            let depth_m = coplanar(faces)?;
            let shared = shared((&faces.0, &rects.0), (&faces.1, &rects.1));
            let seen = nats(self.planes(depth_m, Some(shared))) - nats(self.planes(depth_m, None));
            Some(seen + self.holds((&faces.0, &rects.0), b) + self.holds((&faces.1, &rects.1), a))
        });
        let hinges = a.joint.zip(b.joint).and_then(|(a, b)| self.hinges(&a, &b));
        let seen = [faces.map(|faces| self.faces(faces)), outlines, hinges];
        Terms { hands, seen, names: self.names(a.name, b.name) }
    }

    /// Faces of one part look one way and lie in one plane. So do most faces beside each other: this speaks against one part
    /// rather than for it.
    fn faces(&self, faces: (Face, Face)) -> f64 {
        let SamePart { face_deg, odd, one_plane, .. } = *self.rules;
        let sharpness = face_deg.to_radians().powi(-2);
        let angle = signed_angle(&faces.0.normal, &faces.1.normal);
        // Directions, a steradian: about the other one's, or anywhere.
        let about = sharpness / TAU * (-sharpness * (1.0 - angle.cos())).exp();
        let anywhere = 1.0 / (4.0 * PI);
        let one = (1.0 - odd) * about + odd * anywhere;
        let ways = nats(one / (one_plane * one + (1.0 - one_plane) * anywhere));
        ways + coplanar(faces).map_or(0.0, |depth_m| nats(self.planes(depth_m, None)))
    }

    /// Odds by how much deeper one plane lies, with the share of the smaller outline on the larger one where both are known.
    /// Two parts in one plane do not overlap; a drawer behind a door does.
    fn planes(&self, depth_m: f64, shared: Option<f64>) -> f64 {
        let SamePart { plane_m, elsewhere_m, odd, one_plane, .. } = *self.rules;
        let here = (-0.5 * (depth_m / plane_m).powi(2)).exp() / (plane_m * TAU.sqrt());
        let anywhere = 1.0 / (2.0 * elsewhere_m);
        let [whole, nothing] = [true, false].map(|covers| shared.map_or(1.0, |s| self.overlap(s, covers)));
        let one = ((1.0 - odd) * here + odd * anywhere) * whole;
        one / (one_plane * here * nothing + (1.0 - one_plane) * anywhere * whole)
    }

    /// Density of a share of overlap that is the whole outline, or nothing, but for what outlines are off by.
    fn overlap(&self, share: f64, whole: bool) -> f64 {
        let SamePart { outline_off: scale, badly_seen, .. } = *self.rules;
        let off = if whole { 1.0 - share } else { share }.clamp(0.0, 1.0);
        let well = (-off / scale).exp() / (scale * (1.0 - (-1.0 / scale).exp()));
        (1.0 - badly_seen) * well + badly_seen
    }

    /// A part is held on its own outline. An outline that was seen badly may reach over a neighbour, which then is held outside
    /// of it.
    fn holds(&self, (face, rect): (&Face, &Rect), other: &Sight) -> f64 {
        let at = face.coordinates(&other.grip);
        let off = [0, 1].map(|k| (rect.bounds[k][0] - at[k]).max(at[k] - rect.bounds[k][1]).max(0.0));
        let badly_seen = self.rules.badly_seen;
        nats((1.0 - badly_seen) * (-0.5 * off[0].hypot(off[1]).powi(2) * self.worth(other)).exp() + badly_seen)
    }

    /// Two doors side by side are hinged at their outer edges. Slides tell no place.
    fn hinges(&self, a: &Articulation, b: &Articulation) -> Option<f64> {
        if [a.kind, b.kind] != [JointKind::Revolute; 2] {
            return None;
        }
        let SamePart { hinge_m, hinges_apart_m, odd, one_plane, .. } = *self.rules;
        // Hinges that run across each other say nothing by their distance; either may be wrong.
        if unsigned_angle(&a.axis, &b.axis) > FRAC_PI_4 {
            return Some(nats(2.0 * odd / (1.0 - one_plane)).min(0.0));
        }
        let apart_m = a.line().distance(&b.origin).min(b.line().distance(&a.origin));
        let density = |scale: f64| (-0.5 * (apart_m / scale).powi(2)).exp() / scale;
        let two = density(hinges_apart_m).max(f64::MIN_POSITIVE);
        Some(nats((1.0 - odd) * density(hinge_m) / two + odd))
    }

    /// Names of one part agree in type as far as names are trusted, and mostly in their word.
    pub(super) fn names(&self, a: Name, b: Name) -> Option<f64> {
        let one_name = a.furniture? == b.furniture?;
        let SamePart { alike, one_name: [of_one, of_two], .. } = *self.rules;
        let word = if one_name { nats(of_one / of_two) } else { nats((1.0 - of_one) / (1.0 - of_two)) };
        Some(match a.kind.zip(b.kind) {
            Some((a, b)) if a != b => nats((1.0 - self.name_accuracy) / (1.0 - alike)),
            Some(_) => nats(self.name_accuracy / alike) + word,
            None => word,
        })
    }
}

/// How much deeper one plane lies than another one that looks the same way, metres.
fn coplanar((a, b): (Face, Face)) -> Option<f64> {
    let between = a.normal + b.normal;
    (signed_angle(&a.normal, &b.normal) <= FRAC_PI_4).then(|| (b.center - a.center).dot(&between) / between.norm())
}

/// Share of the smaller outline that lies on the larger one. An outline that was seen badly is too large rather than elsewhere.
fn shared((face, mine): (&Face, &Rect), (other_face, theirs): (&Face, &Rect)) -> f64 {
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
    both / a.min(b).max(f64::MIN_POSITIVE)
}

/// What several sights of one part say of another sight, nats: each kind of evidence is asked of those that saw it, and their
/// odds are averaged by what each sight is worth. A part is known no better than its best sights know it, so that their nats do
/// not add up, and one that was seen badly does not outvote the others.
pub(super) fn together(sights: &[(f64, Terms)], badly_seen: f64) -> f64 {
    let of = |kind: &dyn Fn(&Terms) -> Option<f64>| {
        averaged(sights.iter().filter_map(|(worth, terms)| Some((*worth, kind(terms)?))))
    };
    let beside: f64 = (0..KINDS).map(|kind| of(&|terms| terms.seen[kind].map(f64::exp))).product();
    let [well, badly] = [of(&|terms| Some(terms.hands.well)), of(&|terms| Some(terms.hands.badly))];
    nats((1.0 - badly_seen) * well * beside + badly_seen * badly) + nats(of(&|terms| terms.names.map(f64::exp)))
}

/// Odds, each with what it is worth, as one; 1, which says nothing, of none.
pub(super) fn averaged(odds: impl Iterator<Item = (f64, f64)>) -> f64 {
    let (worth, sum) = odds.fold((0.0, 0.0), |(all, sum), (worth, odds)| (all + worth, sum + worth * odds));
    if worth > 0.0 { sum / worth } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Vector;

    fn face(center: Point) -> Face {
        let (right, up, normal) = (-Vector::x(), Vector::z(), Vector::y());
        Face { center, normal, up, right, extent: [[-1.0, 1.0]; 2], support: 1.0 }
    }

    /// A drawer's handle at such a place, both ends seen.
    fn sight(grip: [f64; 3]) -> Sight<'static> {
        let name = Name { furniture: Some("drawer"), kind: Some(JointKind::Prismatic) };
        let grip = Point::from(grip);
        Sight { grip, grip_std_m: 0.03, face: Some(face(grip)), outline: None, joint: None, name }
    }

    fn odds(a: &Sight, b: &Sight) -> f64 {
        let config = Config::default();
        let there = log_odds(a, b, &config);
        assert!((there - log_odds(b, a, &config)).abs() < 1e-9, "the order of two sights says nothing");
        there
    }

    fn outlined(sight: Sight<'static>, width: f64, height: f64) -> Sight<'static> {
        Sight { outline: Some(Rect { bounds: [[-width / 2.0, width / 2.0], [-height / 2.0, height / 2.0]] }), ..sight }
    }

    #[test]
    fn a_hand_that_was_seen_badly_says_less() {
        let here = sight([0.0; 3]);
        let seen = |d: f64| odds(&here, &sight([d, 0.0, 0.0]));
        let lost = |d: f64| odds(&here, &Sight { grip_std_m: 0.12, ..sight([d, 0.0, 0.0]) });
        assert!(seen(0.0) > lost(0.0) && lost(0.0) > 0.0);
        assert!(seen(0.3) < lost(0.3) && lost(0.3) < 0.0);
        // Even a metre is no number beyond all others.
        assert!(seen(0.5) > -8.0, "{}", seen(0.5));
        assert!(log_odds(&here, &sight([1e6, 0.0, 0.0]), &Config::default()).is_finite());
    }

    #[test]
    fn outlines_tell_parts_beside_each_other_whose_handles_are_close() {
        let (here, beside) = (sight([0.0; 3]), sight([0.08, 0.0, 0.0]));
        assert!(odds(&here, &beside) > 0.0);
        let door = |sight: Sight<'static>, shift: f64| {
            let face = sight.face.map(|f| Face { center: Point::new(shift, 0.0, 0.0), ..f });
            outlined(Sight { face, ..sight }, 0.4, 0.7)
        };
        assert!(odds(&door(here, -0.2), &door(beside, 0.22)) < -1.0);
        assert!(odds(&door(here, 0.0), &door(beside, 0.03)) > 3.0);
        // Of one that was not seen to move the other's outline says nothing.
        assert!(odds(&door(here, -0.2), &beside) > 0.0);
    }

    #[test]
    fn a_drawer_behind_a_door_is_another_part() {
        let inner = |depth: f64| outlined(sight([0.0, -depth, 0.0]), 0.5, 0.2);
        let door = outlined(sight([0.0; 3]), 0.5, 0.6);
        assert!(odds(&door, &inner(0.15)) < 0.0 && odds(&door, &inner(0.02)) > 2.0);
    }

    #[test]
    fn hinges_tell_two_doors_and_names_two_kinds_of_furniture() {
        let (model, config) = (sight([0.0; 3]), Config::default());
        let hung = |x: f64, axis: Vector| {
            let joint = Articulation { kind: JointKind::Revolute, axis, origin: Point::new(x, 0.0, 0.3 * x) };
            Sight { joint: Some(joint), ..model }
        };
        let plain = odds(&model, &model);
        let at = |x: f64, axis: Vector| odds(&hung(0.0, Vector::z()), &hung(x, axis)) - plain;
        assert!(at(0.05, Vector::z()) > 1.0 && at(0.6, -Vector::z()) < -2.5);
        assert!((-1.0..0.0).contains(&at(0.6, Vector::x())));
        let called = |furniture, kind| Sight { name: Name { furniture, kind }, ..model };
        let by = |other: Sight| log_odds(&model, &other, &config);
        let [slide, turn] = [JointKind::Prismatic, JointKind::Revolute].map(Some);
        let (rack, oven, it) = (called(Some("rack"), slide), called(Some("oven"), turn), called(None, None));
        assert!(plain > by(it) && by(it) > by(rack) && by(rack) > by(oven));
    }

    #[test]
    fn sights_of_one_part_are_averaged_kind_by_kind() {
        let terms = |hands: f64, outline: Option<f64>| Terms {
            hands: HandOdds { well: hands.exp(), badly: 0.0 },
            seen: [None, outline, None],
            names: None,
        };
        let (good, badly) = (terms(1.0, Some(-3.0)), terms(-4.0, None));
        let all = |sights: &[(f64, Terms)]| together(sights, 0.0);
        let one = all(&[(1.0, good)]);
        assert!((one + 2.0).abs() < 1e-9);
        // Twice the same is no more than once; who saw no outline does not blur what the other one's says.
        assert!((all(&[(1.0, good), (1.0, good)]) - one).abs() < 1e-9);
        let mixed = all(&[(1.0, good), (0.1, badly)]);
        assert!(mixed < one && mixed > one - 0.5, "{mixed}");
        assert!(all(&[]).abs() < 1e-12);
    }

    /// Nats of usual cases, as `docs/evidence.md` has them, to its last digit.
    #[test]
    fn usual_cases_are_as_the_documentation_says() {
        let config = Config::default();
        let model = Model::of(&config);
        let is = |found: f64, said: f64| assert!((found - said).abs() <= 0.051, "{found} is not {said}");
        // Hands alone.
        let bare =
            |x: f64, grip_std_m: f64| Sight { grip_std_m, face: None, name: Name::default(), ..sight([x, 0.0, 0.0]) };
        let seen = [(0.0, 0.8), (0.05, 0.6), (0.1, 0.1), (0.15, -0.6), (0.2, -1.7), (0.25, -2.7), (0.4, -4.0)];
        for (x, said) in seen {
            is(odds(&bare(0.0, 0.03), &bare(x, 0.03)), said);
        }
        for (x, said) in [(0.0, -0.2), (0.2, -1.1), (0.4, -3.4)] {
            is(odds(&bare(0.0, 0.03), &bare(x, 0.12)), said);
        }
        // Faces.
        let here = face(Point::origin());
        let beside = Face { right: Vector::y(), normal: Vector::x(), ..here };
        let deeper = face(Point::new(0.0, -0.15, 0.0));
        for (other, said) in [(here, 0.4), (beside, -1.6), (deeper, -1.1)] {
            is(model.faces((here, other)), said);
        }
        // Outlines: the smaller one lies on the larger one, or beside it; and a grip 10 cm beside one.
        let covered = |share: f64| nats(model.planes(0.0, Some(share))) - nats(model.planes(0.0, None));
        is(covered(1.0), 2.3);
        is(covered(0.0), -2.9);
        is(model.holds((&here, &Rect { bounds: [[-0.2, 0.2]; 2] }), &bare(0.3, 0.03)), -1.2);
        // Hinges and names.
        let hinge =
            |x: f64| Articulation { kind: JointKind::Revolute, axis: Vector::z(), origin: Point::new(x, 0.0, 0.0) };
        for (x, said) in [(0.1, 1.2), (0.3, -1.3), (0.6, -3.0)] {
            is(model.hinges(&hinge(0.0), &hinge(x)).unwrap(), said);
        }
        let name = |word, kind| Name { furniture: Some(word), kind: Some(kind) };
        let drawer = name("drawer", JointKind::Prismatic);
        for (other, said) in
            [(drawer, 0.7), (name("rack", JointKind::Prismatic), -0.2), (name("oven", JointKind::Revolute), -2.1)]
        {
            is(model.names(drawer, other).unwrap(), said);
        }
    }

    #[test]
    fn what_was_looked_for_near_a_hand_that_was_seen_badly_says_little() {
        let hands = HandOdds { well: 1e-9, badly: 0.5 };
        let terms = Terms { hands, seen: [Some(-2.0), Some(-6.0), Some(-3.0)], names: None };
        let there = together(&[(1.0, terms)], 0.2);
        assert!((there - 0.1_f64.ln()).abs() < 1e-6, "{there}");
    }
}
