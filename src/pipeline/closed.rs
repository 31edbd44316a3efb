//! Which of a part's clips saw it closed best: the one that gives its front (ours).

use super::{ClipResult, method};
use crate::config::{ClosedFronts, Config, Grips};
use crate::geometry::Face;
use crate::hands;
use crate::math::{Point, signed_angle};

/// A hand at the closed end of its motion.
#[derive(Clone, Copy)]
pub(super) struct Grip {
    /// Index of its clip.
    clip: usize,
    /// World.
    at: Point,
    /// Whether it was seen to take hold or let go there.
    seen: bool,
}

impl Grip {
    pub(super) fn of(clips: &[ClipResult], clip: usize) -> Option<Self> {
        let hand = clips[clip].trajectory.as_ref()?;
        Some(Self { clip, at: hand.closed_grip(), seen: hand.closed_end_seen() })
    }

    /// Standard deviation along the motion, metres.
    pub(super) fn std_m(&self, rules: &Grips) -> f64 {
        hands::grip_std_m(self.seen, rules)
    }
}

/// The front that a clip saw, for comparison with those of the part's other clips.
pub(super) struct SeenFront<'a> {
    pub(super) face: &'a Face,
    /// The clip's own hand.
    pub(super) own: Grip,
    /// It counts so many times as much: more than once where the part was seen to move.
    pub(super) moved: f64,
    handle: AtHandle<'a>,
    /// How far handles stand off their fronts, metres.
    standoff_m: f64,
}

impl<'a> SeenFront<'a> {
    fn of(clips: &'a [ClipResult], clip: usize, config: &'a Config) -> Option<Self> {
        let (rules, handles) = (&config.inference.closed, &config.priors.handles);
        Some(Self {
            face: clips[clip].face.as_ref()?,
            own: Grip::of(clips, clip)?,
            moved: if clips[clip].part.is_some() { rules.moved } else { 1.0 },
            handle: AtHandle { std_m: handles.standoff_std_m, rules },
            standoff_m: handles.standoff_m,
        })
    }

    /// How far a hand is off where handles usually are, metres; positive before the front.
    fn off(&self, grip: &Grip) -> f64 {
        self.face.coordinates(&grip.at)[2] - self.standoff_m
    }

    /// How likely the place of its own hand is.
    pub(super) fn near_own(&self) -> f64 {
        self.handle.near(self.off(&self.own))
    }

    /// How well it bears out where the hands of all of the part's clips were when it was closed, a logarithm.
    pub(super) fn bears_out(&self, grips: &[Grip], rules: &Grips) -> f64 {
        // The face was looked for near its own hand.
        let lost_m = |grip: &Grip| {
            if grip.clip == self.own.clip { hands::grip_std_m(false, rules) } else { self.handle.rules.travel_m }
        };
        grips.iter().map(|g| self.handle.at_front(self.off(g), g.seen, lost_m(g)).ln()).sum()
    }
}

/// How well a clip saw the closed part, to compare clips of one part. A logarithm: of hundreds of clips the product is no number.
fn trust(clips: &[ClipResult], clip: usize, grips: &[Grip], config: &Config) -> f64 {
    let front = SeenFront::of(clips, clip, config);
    front.map_or(f64::NEG_INFINITY, |front| method::of(config).trust(&front, grips, config))
}

/// Where hands that hold closed parts are.
struct AtHandle<'a> {
    /// Standard deviation of how far they are from where handles usually stand off their fronts, metres: of handles, and of hands.
    std_m: f64,
    rules: &'a ClosedFronts,
}

impl AtHandle<'_> {
    /// How likely such a distance is against none.
    fn near(&self, off: f64) -> f64 {
        (-0.5 * (off / self.std_m).powi(2)).exp()
    }

    /// The same of any hand at the closed end of its motion, where it was or was not `seen` to take hold or let go. Behind its
    /// front there is no hand. A lost one may be before it by a standard deviation of `lost_m`, metres, and so may some that
    /// seemed to be seen, as flags of contacts are wrong, too.
    fn at_front(&self, off: f64, seen: bool, lost_m: f64) -> f64 {
        let (near, wrong) = (self.std_m, self.rules.wrong_flags);
        let bell = if off > 0.0 { (-0.5 * (off / lost_m).powi(2)).exp() } else { self.near(off) };
        let lost = 2.0 * near / (near + lost_m) * bell;
        self.rules.odd * near + if seen { (1.0 - wrong) * self.near(off) + wrong * lost } else { lost }
    }
}

/// A part's clips with an answer, the one that saw it closed best first.
pub(super) fn by_trust(clips: &[ClipResult], members: &[usize], config: &Config) -> Vec<usize> {
    let grips: Vec<Grip> = members.iter().filter_map(|&c| Grip::of(clips, c)).collect();
    let answered = members.iter().filter(|&&c| clips[c].joint.found().is_some());
    let mut trusted: Vec<(usize, f64)> = answered.map(|&c| (c, trust(clips, c, &grips, config))).collect();
    trusted.sort_by(|a, b| b.1.total_cmp(&a.1));
    trusted.into_iter().map(|(clip, _)| clip).collect()
}

/// Whether two faces look the same way, as those of two clips of one front do.
pub(super) fn face_alike(a: &Face, b: &Face, config: &Config) -> bool {
    signed_angle(&a.normal, &b.normal) <= config.inference.closed.one_front_deg.to_radians()
}

/// Of the clips after the first one of `trusted` those that have a front of their own: each front once, the most trusted first.
pub(super) fn other_fronts(clips: &[ClipResult], trusted: &[usize], config: &Config) -> Vec<usize> {
    let deeper_m = config.inference.closed.one_front_m;
    let one = |a: &Face, b: &Face| face_alike(a, b, config) && a.coordinates(&b.center)[2].abs() <= deeper_m;
    let mut fronts: Vec<(usize, Face)> = Vec::new();
    for (clip, face) in trusted.iter().filter_map(|&c| Some((c, clips[c].face?))) {
        if !fronts.iter().any(|(_, other)| one(other, &face)) {
            fronts.push((clip, face));
        }
    }
    fronts.into_iter().map(|(clip, _)| clip).filter(|clip| trusted.first() != Some(clip)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::articulation::{Action, Articulation, JointKind, Outcome};
    use crate::geometry::{AxisSource, Face};
    use crate::inference;
    use crate::math::Vector;
    use crate::pipeline::told::tests::clips;

    /// A clip with a front of such support, so far before the others', from which its grip stands `off`.
    fn clip(front: f64, off: f64, support: f64, seen: bool) -> ClipResult {
        let mut clip = clips(&[("open the oven", true)]).remove(0);
        let face = Face {
            center: Point::origin(),
            right: Vector::x(),
            up: Vector::z(),
            normal: -Vector::y(),
            extent: [[-1.0, 1.0]; 2],
            support,
        };
        let grip = face.point(0.0, 0.0, front + Config::default().priors.handles.standoff_m + off);
        clip.face = Some(Face { center: face.point(0.0, 0.0, front), ..face });
        if let Some(hand) = &mut clip.trajectory {
            hand.ends_seen = [seen; 2];
            hand.samples[0].smoothed = grip;
        }
        clip.joint = Outcome::Found(inference::ClipJoint {
            joint: Articulation { kind: JointKind::Prismatic, axis: face.normal, origin: grip },
            contact_pivot: grip,
            source: AxisSource::Line,
            type_probability: None,
            joint_probability: None,
            residual_m: 0.0,
            inliers: 1.0,
            radius_m: None,
            observed_range: 0.2,
            grip,
            action: Action::Open,
        });
        clip
    }

    fn trusts(clips: &[ClipResult]) -> Vec<f64> {
        let grips: Vec<Grip> = (0..clips.len()).filter_map(|c| Grip::of(clips, c)).collect();
        (0..clips.len()).map(|c| trust(clips, c, &grips, &Config::default()).exp()).collect()
    }

    #[test]
    fn the_front_of_a_part_is_that_of_the_clip_that_saw_it_closed_best() {
        let alone = |off: f64, support: f64, seen: bool| trusts(&[clip(0.0, off, support, seen)])[0];
        // Half the support counts a quarter; a hand that was seen, four times one that was lost at the same place, but for the
        // fifth of all that only seemed to be seen.
        assert!((alone(0.0, 0.4, true) / alone(0.0, 0.2, true) - 4.0).abs() < 1e-9);
        assert!((3.0..10.0).contains(&(alone(0.0, 0.4, true) / alone(0.0, 0.4, false))));
        // Lost before a large front, or at a small thing: also where the hand only seemed to be seen.
        assert!(alone(0.15, 0.4, false) > 2.0 * alone(0.0, 0.08, false));
        assert!(alone(0.15, 0.4, true) > alone(0.0, 0.08, true));
        // Of fronts as large the one that the hand is at; behind its front no hand is lost.
        assert!(alone(0.0, 0.4, true) > 4.0 * alone(0.15, 0.4, true));
        assert!(alone(0.0, 0.08, false) > 2.0 * alone(-0.15, 0.4, false));
        // Two clips of a part: a hand that is lost before the other's front says little against it, one behind it much, and the
        // more where it was seen.
        let two = |seen: bool| trusts(&[clip(0.0, 0.0, 0.2, seen), clip(0.3, 0.0, 0.4, false)]);
        let [lost, seen] = [two(false), two(true)].map(|t| t[0] / t[1]);
        assert!(lost > 2.0 && seen > 2.0 * lost, "{lost} {seen}");
        // The paper asks no other clip's hand, and a thin front may do.
        let paper = |grips: &[Grip]| trust(&[clip(0.0, 0.0, 0.2, true)], 0, grips, &Config::paper()).exp();
        let behind = Grip { clip: 1, at: Point::new(0.0, 0.3, 0.0), seen: true };
        assert!((paper(&[]) - 0.4).abs() < 1e-9 && (paper(&[behind]) - 0.4).abs() < 1e-9, "{}", paper(&[]));
    }

    #[test]
    fn of_a_thousand_clips_the_best_is_found_too() {
        // Hands of one front, seen at it; among them a front that stands before nobody's hand, and a larger one.
        let mut clips: Vec<ClipResult> = (0..1000).map(|_| clip(0.0, 0.0, 0.2, true)).collect();
        clips[0] = clip(0.3, -0.3, 0.9, true);
        clips[700] = clip(0.0, 0.0, 0.4, true);
        let members: Vec<usize> = (0..1000).collect();
        assert_eq!(by_trust(&clips, &members, &Config::default())[0], 700);
        assert!(trusts(&clips)[0] == 0.0, "as a product it is no number");
    }

    #[test]
    fn each_front_is_tried_once_and_that_of_the_most_trusted_clip_first() {
        let clips = [0.0, 0.02, 0.3, 0.31].map(|front| clip(front, 0.0, 0.2, true));
        let others = |trusted: &[usize]| other_fronts(&clips, trusted, &Config::default());
        assert_eq!(others(&[0, 1, 2, 3]), [2]);
        assert_eq!(others(&[3, 1, 2, 0]), [1]);
        assert!(others(&[0, 1]).is_empty() && others(&[]).is_empty());
    }

    #[test]
    fn a_clip_that_is_trusted_most_but_has_no_answer_gives_no_front() {
        let mut clips = [clip(0.0, 0.0, 0.4, true), clip(0.0, 0.0, 0.2, true)];
        let best = |clips: &[ClipResult]| by_trust(clips, &[0, 1], &Config::default()).first().copied();
        assert_eq!(best(&clips), Some(0));
        clips[0].joint = Outcome::Abstained("no direction for a slide".to_owned());
        assert_eq!(best(&clips), Some(1));
        clips[1].joint = clips[0].joint.clone();
        assert_eq!(best(&clips), None);
    }
}
