//! Answers from geometry and the furniture's name alone.
//!
//! Every candidate axis is an explanation of the hand's path and of the depth seen in the open state. Its weight is
//! likelihood times prior, the priors being how furniture is built: handles sit opposite hinges and in the middle of
//! drawers, doors are tall and drawers are wide, hinges lie on edges.

use crate::articulation::JointKind;
use crate::config::{self, Fronts, Hung, Priors};
use crate::geometry::{AxisCandidate, AxisSource, Face, HingeSide};
use crate::math::{Point, Vector};

use super::{Answer, PartShape, Question, Reasoner};

/// The geometric heuristic.
#[derive(Debug, Clone)]
pub struct Geometric {
    /// Weights of the evidence.
    pub reasoning: config::Reasoning,
    /// Tolerances of the rules.
    pub inference: config::Inference,
    /// What is believed of furniture.
    pub priors: Priors,
}

impl Geometric {
    /// Of the blocks of a whole configuration.
    #[must_use]
    pub fn of(config: &config::Config) -> Self {
        Self { reasoning: config.reasoning.clone(), inference: config.inference.clone(), priors: config.priors.clone() }
    }
}

impl Reasoner for Geometric {
    fn name(&self) -> &'static str {
        "geometric heuristic"
    }

    fn answer(&self, question: &Question) -> Answer {
        let log_likelihoods = question
            .candidates
            .iter()
            .zip(question.agreement)
            .map(|(candidate, agreement)| {
                let path =
                    super::path_log_likelihood(&candidate.joint, question.path, &self.reasoning, &self.inference);
                (path + agreement) / self.reasoning.evidence_temperature
            })
            .collect();
        let name = match question.reading.kind {
            Some(kind) => {
                let odds = question.reading.strength()
                    * (self.reasoning.name_accuracy / (1.0 - self.reasoning.name_accuracy)).ln();
                if kind == JointKind::Revolute { odds } else { -odds }
            }
            None => 0.0,
        };
        let model = question.words.map_or(0.0, |w| w.log_odds(&self.reasoning));
        let words_log_odds = of_both(name, model);
        let log_priors = log_priors(question, &self.reasoning, &self.priors);
        Answer { log_likelihoods, log_priors, words_log_odds }
    }
}

/// Log odds from the furniture's name and from a language model's answers. The model was told the narration: where both
/// say the same it is one voice, and the louder counts; where they differ, the model saw something else, and both count.
fn of_both(name: f64, model: f64) -> f64 {
    if name * model > 0.0 { name.signum() * name.abs().max(model.abs()) } else { name + model }
}

/// Prior of each candidate: that of its source, shared among the candidates of that source (thirty lines are not thirty
/// times as likely to hold the hinge as three), times that of its place on the part.
fn log_priors(question: &Question, config: &config::Reasoning, priors: &Priors) -> Vec<f64> {
    /// Arithmetic: candidates of a source are shared among the four edges of a face already; edges that are all alike change
    /// nothing.
    const EDGES: f64 = 4.0;
    let candidates = question.candidates;
    let habit = Habit::of(question, config.name_accuracy, priors);
    let is_lid = question.face.is_some_and(|face| face.is_horizontal(&question.up));
    // Lines that are long and seen often are edges of furniture rather than of its texture, and lines that a language model
    // takes for hinges rather than others.
    let raw = |c: &AxisCandidate| match c.source {
        AxisSource::Line => {
            let length_m = c.length_m + config.line_length_least_m;
            length_m.sqrt() * (c.views as f64).sqrt() * line_factor(c.named, config)
        }
        _ => 1.0,
    };
    candidates
        .iter()
        .map(|c| {
            let class = |o: &AxisCandidate| {
                question.face.and_then(|face| slide_class(o, face, &question.up, config.same_way_cos))
            };
            let own = class(c);
            let same = |o: &&AxisCandidate| {
                o.joint.kind == c.joint.kind && if own.is_some() { class(o) == own } else { o.source == c.source }
            };
            let total: f64 = candidates.iter().filter(same).map(raw).sum();
            let share = (raw(c) / total.max(1e-12)).ln();
            own.map_or_else(|| source_prior(c.source, &config.sources), |class| habit.slide(class)).ln() + share
                - 0.5 * c.shift * c.shift
                + c.side.map_or(0.0, |side| (EDGES * habit.hinge(side, is_lid)).ln())
                + radius_log_prior(c, &question.grip, &priors.fronts)
                + question.part.map_or(0.0, |part| shape_log_prior(c, &part, &priors.fronts))
        })
        .collect()
}

/// How much a line's share of the prior grows with the share of the views that a language model named it a hinge in: five-fold at
/// most, so that a model that is wrong about a line is outweighed by the hand and the depth.
fn line_factor(named: f64, config: &config::Reasoning) -> f64 {
    1.0 + config.vlm_line_gain * named.clamp(0.0, 1.0)
}

/// How a slide lies to the touched face.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum SlideClass {
    /// Straight out of a front.
    Out,
    /// Along a front, to the side.
    Aside,
    /// Along a front, up or down.
    Lift,
    /// In the plane of a lid or a worktop, or out of it.
    Level,
    /// Anything else.
    Askew,
}

/// The class of a slide, which runs along a direction from this cosine on; `None` for hinges.
fn slide_class(candidate: &AxisCandidate, face: &Face, up: &Vector, cosine: f64) -> Option<SlideClass> {
    let axis = candidate.joint.axis;
    let near = |d: &Vector| axis.dot(d).abs() > cosine;
    (candidate.joint.kind == JointKind::Prismatic).then(|| match () {
        () if face.is_horizontal(up) => SlideClass::Level,
        () if near(&face.normal) => SlideClass::Out,
        () if near(&face.right) => SlideClass::Aside,
        () if near(&face.up) => SlideClass::Lift,
        () => SlideClass::Askew,
    })
}

/// How furniture is hung: what is usual, and what is said of furniture of this name as far as names are trusted.
#[derive(Debug, Clone, Copy)]
struct Habit<'a> {
    usual: &'a config::Hanging,
    named: Option<Hung>,
    trust: f64,
}

impl<'a> Habit<'a> {
    fn of(question: &Question, trust: f64, priors: &'a Priors) -> Self {
        Self {
            usual: &priors.hung,
            named: super::furniture(question.reading, question.words).and_then(|name| priors.hung.named(name)),
            trust: question.reading.strength() * trust,
        }
    }

    /// A share of `of`, of the name's where it knows any such furniture.
    fn share(&self, usual: f64, part: impl Fn(&Hung) -> f64, of: impl Fn(&Hung) -> f64) -> f64 {
        match self.named.filter(|n| of(n) > 0.0) {
            Some(named) => self.trust * part(&named) / of(&named) + (1.0 - self.trust) * usual,
            None => usual,
        }
    }

    /// Prior of the edge of a hinge. A lid turns about its far edge; `up` on a level face points away from the person.
    fn hinge(&self, side: HingeSide, is_lid: bool) -> f64 {
        if is_lid {
            let far = self.share(self.usual.lid_far_edge, |h| h.lid, |h| h.lid);
            return if side == HingeSide::Top { far } else { (1.0 - far) / 3.0 };
        }
        let of = |h: &Hung| h.upright + h.bottom + h.top;
        let share = |part: fn(&Hung) -> f64| self.share(part(&self.usual.usual), part, of);
        match side {
            HingeSide::Left | HingeSide::Right => 0.5 * share(|h| h.upright),
            HingeSide::Bottom => share(|h| h.bottom),
            HingeSide::Top => share(|h| h.top),
        }
    }

    /// Prior of a slide: next to nothing slides where a lid is, or askew.
    fn slide(&self, class: SlideClass) -> f64 {
        let share = |part: fn(&Hung) -> f64| self.share(part(&self.usual.usual), part, |h| h.out + h.aside + h.lift);
        match class {
            SlideClass::Out => share(|h| h.out),
            SlideClass::Aside => share(|h| h.aside),
            // Names say nothing of faces that were found wrongly.
            SlideClass::Level => self.usual.slide_level,
            SlideClass::Askew => self.usual.slide_askew,
            SlideClass::Lift => share(|h| h.lift),
        }
    }
}

fn source_prior(source: AxisSource, sources: &config::Sources) -> f64 {
    match source {
        AxisSource::Line => sources.line,
        AxisSource::PlaneEdge => sources.plane_edge,
        AxisSource::PartEdge => sources.part_edge,
        AxisSource::FaceEdge => sources.face_edge,
        AxisSource::HandArc => sources.hand_arc,
        AxisSource::FaceNormal => sources.face_normal,
        AxisSource::FaceAxis => sources.face_axis,
        AxisSource::Manhattan => sources.manhattan,
        AxisSource::HandPath => sources.hand_path,
        AxisSource::Assumed => sources.assumed,
    }
}

/// How far hinges are from the grip. Log-normal, and so centred that hinges as a whole gain or lose nothing against slides.
fn radius_log_prior(candidate: &AxisCandidate, grip: &Point, fronts: &Fronts) -> f64 {
    if candidate.joint.kind == JointKind::Prismatic {
        return 0.0;
    }
    let lever = candidate.joint.lever(grip).max(fronts.lever_least_m);
    let x = (lever / fronts.lever_median_m).ln() / fronts.lever_spread;
    fronts.lever_counts * (0.5 * (1.0 - x * x))
}

/// Where the grip sits and how wide the front is, under each kind of joint.
fn shape_log_prior(candidate: &AxisCandidate, part: &PartShape, fronts: &Fronts) -> f64 {
    let gauss = |x: f64, mean: f64, std: f64| (-0.5 * ((x - mean) / std).powi(2)).exp();
    let (edge, std) = (fronts.grip_edge, fronts.grip_edge_std);
    let [right, up] = part.grip;
    let aspect = (part.size_m[0] / part.size_m[1]).ln() / fronts.aspect_spread;
    let wide = 1.0 / (1.0 + (-aspect).exp());
    let (grip, shape) = match (candidate.joint.kind, candidate.side) {
        (JointKind::Prismatic, _) => (gauss(right, 0.0, fronts.grip_middle_std), wide),
        (_, Some(HingeSide::Left)) => (gauss(right, edge, std), 1.0 - wide),
        (_, Some(HingeSide::Right)) => (gauss(right, -edge, std), 1.0 - wide),
        // Flaps and fronts that come down are as often wide as tall.
        (_, Some(HingeSide::Bottom)) => (gauss(up, edge, std), 0.5),
        (_, Some(HingeSide::Top)) => (gauss(up, -edge, std), 0.5),
        (_, None) => return 0.0,
    };
    let habit = |fit: f64| (fronts.no_habit + (1.0 - fronts.no_habit) * fit).ln();
    habit(grip) + habit(shape)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::articulation::Articulation;
    use crate::recording::Clip;
    use crate::recording::narration::{self, Reading};

    fn candidate(kind: JointKind, axis: Vector, origin: Point, source: AxisSource) -> AxisCandidate {
        AxisCandidate {
            joint: Articulation { kind, axis, origin },
            source,
            side: None,
            views: 0,
            length_m: 0.5,
            position_std_m: 0.03,
            shift: 0.0,
            named: 0.0,
        }
    }

    fn ask(path: &[Point], kind: Option<JointKind>, candidates: &[AxisCandidate], agreement: &[f64]) -> f64 {
        let reading = Reading { moves_joint: Some(true), action: None, furniture: None, kind, generic: false };
        Geometric::of(&config::Config::default())
            .answer(&Question {
                reading: &reading,
                words: None,
                path,
                grip: path[0],
                candidates,
                agreement,
                part: None,
                face: None,
                up: Vector::z(),
            })
            .revolute_probability(candidates)
    }

    #[test]
    fn a_wide_arc_is_a_hinge_whatever_it_is_called_and_depth_decides_a_short_one() {
        let arc = |degrees: f64| -> Vec<Point> {
            (0..40)
                .map(|i| {
                    let a = (f64::from(i) / 39.0 * degrees).to_radians();
                    Point::new(0.5 - 0.5 * a.cos(), -0.5 * a.sin(), 1.0)
                })
                .collect()
        };
        let candidates = [
            candidate(JointKind::Revolute, Vector::z(), Point::new(0.5, 0.0, 1.0), AxisSource::PartEdge),
            candidate(JointKind::Prismatic, -Vector::y(), Point::origin(), AxisSource::FaceNormal),
        ];
        let wide = ask(&arc(75.0), Some(JointKind::Prismatic), &candidates, &[0.0; 2]);
        assert!(wide > 0.9, "{wide:?}");
        let short = arc(15.0);
        let says_slide = ask(&short, None, &candidates, &[-4.0, 8.0]);
        let says_hinge = ask(&short, None, &candidates, &[8.0, -4.0]);
        assert!(says_slide < 0.1 && says_hinge > 0.8);
    }

    #[test]
    fn a_model_that_repeats_the_name_says_nothing_new_and_one_that_contradicts_it_does() {
        let (name, model) = (9f64.ln(), 1.4 * 9f64.ln());
        assert_eq!(of_both(name, model), model);
        assert_eq!(of_both(-model, -name), -model);
        assert_eq!(of_both(name, -model), name - model);
        assert_eq!((of_both(0.0, model), of_both(name, 0.0)), (model, name));
    }

    #[test]
    fn a_line_that_was_named_takes_from_the_other_lines_only() {
        let line = |named: f64| AxisCandidate {
            named,
            views: 4,
            ..candidate(JointKind::Revolute, Vector::z(), Point::origin(), AxisSource::Line)
        };
        let edge = candidate(JointKind::Revolute, Vector::z(), Point::origin(), AxisSource::PartEdge);
        let reading = Reading { moves_joint: Some(true), action: None, furniture: None, kind: None, generic: false };
        let priors = |named: f64| {
            let candidates = [line(named), line(0.0), edge.clone()];
            log_priors(
                &Question {
                    reading: &reading,
                    words: None,
                    path: &[],
                    grip: Point::origin(),
                    candidates: &candidates,
                    agreement: &[],
                    part: None,
                    face: None,
                    up: Vector::z(),
                },
                &config::Reasoning { name_accuracy: 0.9, ..Default::default() },
                &Priors::default(),
            )
        };
        let (before, after) = (priors(0.0), priors(1.0));
        assert!((after[0] - after[1] - 5f64.ln()).abs() < 1e-12 && before[0] == before[1]);
        assert!((after[0].exp() + after[1].exp() - before[0].exp() - before[1].exp()).abs() < 1e-12);
        assert_eq!(before[2], after[2]);
    }

    #[test]
    fn uninformed_no_edge_no_distance_and_no_shape_is_likelier() {
        let priors = Priors::uninformed();
        let habit = Habit { usual: &priors.hung, named: priors.hung.named("dishwasher"), trust: 0.9 };
        for side in [HingeSide::Left, HingeSide::Right, HingeSide::Top, HingeSide::Bottom] {
            assert!((habit.hinge(side, false) - 0.25).abs() < 1e-12 && (habit.hinge(side, true) - 0.25).abs() < 1e-12);
        }
        assert_eq!(habit.slide(SlideClass::Out), habit.slide(SlideClass::Lift));
        for r in [0.1, 0.45, 0.9] {
            let c = candidate(JointKind::Revolute, Vector::z(), Point::new(r, 0.0, 0.0), AxisSource::Line);
            let c = AxisCandidate { side: Some(HingeSide::Left), ..c };
            assert_eq!(radius_log_prior(&c, &Point::origin(), &priors.fronts), 0.0);
            let part = PartShape { size_m: [r, 0.5], grip: [r - 0.5, 0.1] };
            assert_eq!(shape_log_prior(&c, &part, &priors.fronts), 0.0);
        }
    }

    #[test]
    fn a_named_line_grows_five_fold_at_most() {
        let config = config::Reasoning::default();
        assert_eq!([0.0, 1.0, 9.0].map(|named| line_factor(named, &config)), [1.0, 5.0, 5.0]);
    }

    #[test]
    fn no_candidates_leave_the_type_open() {
        assert!((ask(&[Point::origin()], None, &[], &[]) - 0.5).abs() < 1e-12);
    }

    #[test]
    fn a_name_tells_the_edge_and_the_way_of_a_slide_as_far_as_it_is_trusted() {
        let hung = config::Hanging::default();
        let habit =
            |name: Option<&str>| Habit { usual: &hung, named: name.and_then(|name| hung.named(name)), trust: 0.9 };
        let [unnamed, dishwasher, drawer, chest] = [None, Some("dishwasher"), Some("drawer"), Some("chest")].map(habit);
        let edges = [HingeSide::Left, HingeSide::Right, HingeSide::Top, HingeSide::Bottom];
        for h in [unnamed, dishwasher, drawer, chest] {
            for lid in [false, true] {
                let total: f64 = edges.iter().map(|e| h.hinge(*e, lid)).sum();
                assert!((total - 1.0).abs() < 1e-9, "{h:?} {lid}");
            }
            let ways = [SlideClass::Out, SlideClass::Aside, SlideClass::Lift, SlideClass::Level, SlideClass::Askew];
            assert!(ways.iter().map(|w| h.slide(*w)).sum::<f64>() < 1.1);
        }
        assert!(unnamed.hinge(HingeSide::Left, false) > unnamed.hinge(HingeSide::Bottom, false));
        assert!(dishwasher.hinge(HingeSide::Bottom, false) > 0.9);
        // A drawer's name says nothing about the edges of hinges.
        assert_eq!(drawer.hinge(HingeSide::Bottom, false), unnamed.hinge(HingeSide::Bottom, false));
        assert!(drawer.slide(SlideClass::Aside) < 0.2 * unnamed.slide(SlideClass::Aside));
        // What of such furniture has a lid turns about its far edge, be it rare or not.
        for lid in [chest, habit(Some("freezer"))] {
            assert!(lid.hinge(HingeSide::Top, true) > unnamed.hinge(HingeSide::Top, true));
        }
    }

    #[test]
    fn every_name_has_one_habit_that_is_of_its_type() {
        let hung = config::Hanging::default();
        let names = || hung.by_name.iter().flat_map(|named| named.names.iter().map(move |name| (name, named.ways)));
        for name in narration::furniture_names() {
            assert_eq!(names().filter(|(n, _)| *n == name).count(), 1, "{name}");
            let clip = Clip {
                clip: String::new(),
                start_frame: 0,
                end_frame: 1,
                narration: format!("open the {name}"),
                verb: String::new(),
                noun: String::new(),
            };
            let ways = hung.named(name).unwrap();
            let turns = ways.upright + ways.bottom + ways.top + ways.lid;
            let slides = ways.out + ways.aside + ways.lift;
            let kind = if turns > slides { JointKind::Revolute } else { JointKind::Prismatic };
            assert!((turns + slides - 1.0).abs() < 1e-9, "{name}: {ways:?}");
            assert_eq!(narration::read(&clip).kind, Some(kind), "{name}");
        }
        assert_eq!(names().count(), narration::furniture_names().len());
    }

    #[test]
    fn hinges_as_far_as_fronts_are_wide_are_likelier_and_the_mean_gain_is_none() {
        let at = |r: f64| {
            let c = candidate(JointKind::Revolute, Vector::z(), Point::new(r, 0.0, 0.0), AxisSource::Line);
            radius_log_prior(&c, &Point::origin(), &Fronts::default())
        };
        assert!(at(0.45) > at(0.9) && at(0.45) > at(0.2) && at(0.6) > at(1.3));
        // One standard deviation to either side.
        assert!(at(0.45 * 0.5f64.exp()).abs() < 1e-9 && at(0.45 * (-0.5f64).exp()).abs() < 1e-9);
        let slide = candidate(JointKind::Prismatic, Vector::z(), Point::new(9.0, 0.0, 0.0), AxisSource::FaceNormal);
        assert_eq!(radius_log_prior(&slide, &Point::origin(), &Fronts::default()), 0.0);
    }
}
