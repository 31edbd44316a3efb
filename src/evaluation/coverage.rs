//! Whether covariances mean what they say: of truths about two fifths lie within one standard deviation of an answer in the
//! plane, about two thirds on a line.

use serde::Serialize;

use super::clip_report::ClipReport;
use super::rules::AnswerErrors;

/// How often the truth lies as near to an answer as it says, of the answers whose type is right.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Coverage {
    /// Whose error: "axis", "hinge" or "range".
    pub of: &'static str,
    /// Answers that speak of it.
    pub answers: usize,
    /// Share of them with the truth within one standard deviation.
    pub within_one: f64,
    /// Within two.
    pub within_two: f64,
    /// Both shares under normal errors of the size given.
    pub expected: [f64; 2],
}

/// Share of a normal distribution within one and two standard deviations: in the plane `1 - exp(-k^2 / 2)`, on a line.
const PLANE: [f64; 2] = [0.393_469, 0.864_665];
const LINE: [f64; 2] = [0.682_689, 0.954_500];

/// What is counted: its name, its size in standard deviations, and what is expected.
type Counted = (&'static str, fn(&AnswerErrors) -> Option<f64>, [f64; 2]);

/// Coverage of axis, hinge and range; what no answer speaks of is left out.
#[must_use]
pub fn coverage(clips: &[ClipReport]) -> Vec<Coverage> {
    let errors: [Counted; 3] = [
        ("axis", |m| m.axis_sigmas, PLANE),
        ("hinge", |m| m.origin_sigmas, PLANE),
        ("range", |m| m.range_sigmas, LINE),
    ];
    errors
        .into_iter()
        .filter_map(|(of, size, expected)| {
            let sizes: Vec<f64> = clips.iter().filter_map(|c| size(c.measured.as_ref()?)).collect();
            let share = |limit: f64| sizes.iter().filter(|s| **s <= limit).count() as f64 / sizes.len() as f64;
            (!sizes.is_empty()).then(|| Coverage {
                of,
                answers: sizes.len(),
                within_one: share(1.0),
                within_two: share(2.0),
                expected,
            })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::articulation::JointKind;
    use crate::evaluation::truth::TrueClip;
    use crate::evaluation::{Prediction, Predictions, Truth, evaluate};
    use crate::inference::Uncertainty;
    use crate::math::{Point, Vector, rotation};
    use crate::twin::OrientedBox;

    /// Clips of upright hinges at the origin that open by 1 rad, one for each prediction.
    fn truth(predictions: &[Prediction]) -> Truth {
        let clip = TrueClip {
            joint: "j".to_owned(),
            kind: JointKind::Revolute,
            axis: Vector::z(),
            origin: Point::origin(),
            origin_handle: Point::origin(),
            moved: 1.0,
            part_box: Some(OrientedBox {
                center: Point::new(0.2, 0.0, 0.0),
                half: Vector::new(0.2, 0.01, 0.3),
                rotation: nalgebra::Matrix3::identity(),
            }),
            base_box: None,
            handle: None,
            noun: None,
            action: None,
            orientation: None,
        };
        let clips = predictions.iter().map(|p| (p.clip.clone(), Some(clip.clone()))).collect();
        Truth { recording: "r".to_owned(), tier: None, place: None, clips }
    }

    /// The truth, with an error that is smaller across x than across y: 1 and 3 cm, 0.01 and 0.03 rad; 0.1 rad of range.
    fn right(clip: &str) -> Prediction {
        Prediction {
            recording: "r".to_owned(),
            clip: clip.to_owned(),
            kind: Some(JointKind::Revolute),
            axis: Some(Vector::z()),
            origin: Some(Point::origin()),
            range: Some(1.0),
            range_std: Some(0.1),
            uncertainty: Some(Uncertainty {
                across: [Vector::x(), Vector::y()],
                axis_cov_rad2: [[1e-4, 0.0], [0.0, 9e-4]],
                origin_cov_m2: Some([[1e-4, 0.0], [0.0, 9e-4]]),
                observed_range_std: 0.1,
                moved_std: Vec::new(),
            }),
            ..Prediction::default()
        }
    }

    #[test]
    fn truths_are_counted_within_the_ellipses_of_answers_of_the_right_type() {
        let turned = |about: Vector, angle: f64| Some(rotation(&about, angle) * -Vector::z());
        let rows = vec![
            right("exact"),
            // 4.5 cm, 0.15 rad: one and a half standard deviations. The axis' sense is another question.
            Prediction {
                axis: turned(Vector::y(), 0.045),
                origin: Some(Point::new(0.0, 0.045, 0.7)),
                range: Some(1.15),
                ..right("beside")
            },
            // The same the other way is four and a half.
            Prediction {
                axis: turned(Vector::x(), 0.045),
                origin: Some(Point::new(-0.045, 0.0, 0.0)),
                range: Some(0.55),
                ..right("far")
            },
            Prediction { kind: Some(JointKind::Prismatic), ..right("wrong") },
            Prediction { uncertainty: None, range_std: None, ..right("silent") },
        ];
        let truth = truth(&rows);
        let found = evaluate(&Predictions { predictions: rows }, &[truth]).coverage;
        let counted: Vec<(&str, usize)> = found.iter().map(|c| (c.of, c.answers)).collect();
        assert_eq!(counted, [("axis", 3), ("hinge", 3), ("range", 3)]);
        for c in &found {
            assert!((c.within_one - 1.0 / 3.0).abs() < 1e-12 && (c.within_two - 2.0 / 3.0).abs() < 1e-12, "{c:?}");
        }
        assert!((PLANE[0] - (1.0 - (-0.5f64).exp())).abs() < 1e-6 && (PLANE[1] - (1.0 - (-2f64).exp())).abs() < 1e-6);
        assert!(coverage(&[]).is_empty());
    }
}
