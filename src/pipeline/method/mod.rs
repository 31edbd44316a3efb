//! The two methods behind one interface. The chain of steps is common; where ours and the paper's go apart, it asks a [`Method`].

mod paper;
mod posterior;

use super::closed::{Grip, SeenFront};
use super::group::{Group, Judged};
use super::{ClipResult, Hypothesis};
use crate::articulation::{Articulation, Outcome};
use crate::config::{Config, InferenceMethod};
use crate::geometry::AxisCandidate;
use crate::geometry::candidates::Evidence;
use crate::hands::Trajectory;
use crate::inference::ClipJoint;
use crate::reasoning::{Answer, Reasoner};
use crate::recording::narration::Reading;

/// What the steps ask, in the order in which they do.
pub(super) trait Method: Sync {
    /// Whether a clip has an answer only where depth was recorded.
    fn needs_depth(&self) -> bool;

    /// The axes that the part of a clip could have.
    fn candidates(&self, evidence: &Evidence, config: &Config) -> Vec<AxisCandidate>;

    /// The joint of a clip of which all else is known. `hand`: the clip's; `answer`: what was said of its candidates.
    fn joint(
        &self,
        clip: &ClipResult,
        hand: &Trajectory,
        answer: &Answer,
        reading: &Reading,
        config: &Config,
    ) -> Outcome<ClipJoint>;

    /// How well a clip saw the closed part, to compare clips of one part, a logarithm. `grips`: the hands of all of them.
    fn trust(&self, front: &SeenFront, grips: &[Grip], config: &Config) -> f64;

    /// What the clips of one part say, and the part under each joint that is worth keeping, the answer first. `None` where no
    /// clip has an answer.
    fn part(&self, group: &Group, reasoner: &dyn Reasoner) -> Option<(Judged, Vec<Hypothesis>)>;

    /// The openings that the clips of a part went through by their hands alone, rad or m.
    fn moved(&self, shown: &[(&ClipResult, &Trajectory)], joint: &Articulation, config: &Config) -> Vec<f64>;
}

/// The method that the config names: the only place that asks which it is.
pub(super) fn of(config: &Config) -> &'static dyn Method {
    match config.inference.method {
        InferenceMethod::Paper => &paper::Paper,
        InferenceMethod::Posterior => &posterior::Posterior,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{AxisSource, Face};
    use crate::math::{Point, Vector};

    #[test]
    fn the_paper_knows_no_face_and_ours_asks_no_depth() {
        let face = Face {
            center: Point::origin(),
            right: Vector::x(),
            up: Vector::z(),
            normal: -Vector::y(),
            extent: [[-1.0, 1.0]; 2],
            support: 1.0,
        };
        let path = [0.0, 0.125, 0.25].map(|pulled| Point::new(0.0, -pulled, 0.0));
        let evidence = Evidence {
            face: Some(&face),
            rect: None,
            tracks: &[],
            surface: &[],
            named: &[],
            manhattan: None,
            grip: path[0],
            path: &path,
        };
        let sources = |config: &Config| -> Vec<AxisSource> {
            of(config).candidates(&evidence, config).iter().map(|c| c.source).collect()
        };
        let [ours, paper] = [Config::default(), Config::paper()];
        assert!(sources(&ours).contains(&AxisSource::FaceNormal) && !of(&ours).needs_depth());
        // Without a face and a room only the hand's own direction is left.
        assert_eq!(sources(&paper), [AxisSource::HandPath]);
        assert!(of(&paper).needs_depth());
    }
}
