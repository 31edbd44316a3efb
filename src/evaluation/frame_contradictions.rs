//! Whether predictions and truth are in one unit and one world frame: where they are not, every score is of the frames.

use std::collections::BTreeSet;

use nalgebra::Matrix3;

use super::truth::{Prediction, TrueClip, Truth};
use crate::articulation::JointKind;
use crate::math::stats::median;
use crate::math::{Point, Vector, length, reject, rounded, unit, unsigned_angle};

/// Offsets below this are errors of answers whatever the truth's extent is, metres: as wide as a room.
const LEAST_EXTENT_M: f64 = 5.0;
/// Answers tell one frame from another from this many on.
const LEAST_ANSWERS: usize = 3;
/// A median angle between axes below this is that of answers in the right frame, radians: random ones have 60 degrees.
const TURNED_RAD: f64 = 45.0 * std::f64::consts::PI / 180.0;
/// What is left of it in the right frame, radians.
const RIGHT_RAD: f64 = 20.0 * std::f64::consts::PI / 180.0;
/// What may be left of the median offset in the right frame, as a share of what it was.
const RIGHT_SHARE: f64 = 0.25;
/// Smaller common shifts may be an error that all answers share, metres.
const LEAST_SHIFT_M: f64 = 1.0;

/// An answer and what is true of its clip; world, metres.
struct AnsweredClip<'a> {
    axis: Vector,
    origin: Point,
    truth: &'a TrueClip,
}

impl AnsweredClip<'_> {
    /// How far the origin is off in another frame: along a hinge any point is as good.
    fn offset(&self, origin: &Point) -> f64 {
        let offset = origin - self.truth.origin;
        match self.truth.kind {
            JointKind::Revolute => length(&reject(&offset, &self.truth.axis)),
            JointKind::Prismatic => length(&offset),
        }
    }
}

/// Why the predictions of a recording are in another unit or frame than its truth, in words with the evidence; `None` where
/// nothing says that they are.
///
/// Told are offsets beyond the truth's own extent, axes of the world that are swapped or reversed (another axis up), and shifts
/// that all answers have in common. Answers that are merely wrong agree on none of these.
#[must_use]
pub fn contradiction<'a>(predictions: impl IntoIterator<Item = &'a Prediction>, truth: &Truth) -> Option<String> {
    let pairs: Vec<AnsweredClip> = predictions
        .into_iter()
        .filter(|p| p.recording == truth.recording && p.kind.is_some())
        .filter_map(|p| {
            let truth = truth.clips.get(&p.clip)?.as_ref()?;
            let own = p.in_own_world();
            Some(AnsweredClip { axis: unit(&own.axis?)?, origin: own.origin?, truth })
        })
        .collect();
    let off = median_offset(&pairs, |p| p)?;
    let extent = extent(truth);
    if off > extent.max(LEAST_EXTENT_M) {
        return Some(format!(
            "origins lie {} from the truth (median), which spans {} m: predictions and truth disagree on the unit (metres) or \
             the world frame",
            rounded(off, 0),
            rounded(extent, 0)
        ));
    }
    let joints = pairs.iter().map(|p| p.truth.joint.as_str()).collect::<BTreeSet<_>>().len();
    if pairs.len() < LEAST_ANSWERS || joints < 2 {
        return None;
    }
    turned(&pairs, off).or_else(|| shifted(&pairs, off))
}

/// Median distance between answers, moved into another frame, and the truth.
fn median_offset(pairs: &[AnsweredClip], to: impl Fn(Point) -> Point) -> Option<f64> {
    median(&pairs.iter().map(|p| p.offset(&to(p.origin))).collect::<Vec<_>>())
}

/// The diagonal of the box around all true joints and parts, metres.
fn extent(truth: &Truth) -> f64 {
    let (mut low, mut high) = (Vector::repeat(f64::INFINITY), Vector::repeat(f64::NEG_INFINITY));
    for clip in truth.clips.values().flatten() {
        let corners = clip.part_box.iter().flat_map(|b| b.corners());
        for p in corners.chain([clip.origin]) {
            (low, high) = (low.inf(&p.coords), high.sup(&p.coords));
        }
    }
    let diagonal = length(&(high - low));
    if diagonal.is_finite() { diagonal } else { 0.0 }
}

/// Whether the answers are right once the world's axes are swapped or reversed.
fn turned(pairs: &[AnsweredClip], off: f64) -> Option<String> {
    let angle_in = |m: &Matrix3<f64>| {
        median(&pairs.iter().map(|p| unsigned_angle(&(m * p.axis), &p.truth.axis)).collect::<Vec<_>>())
    };
    let angle = angle_in(&Matrix3::identity())?;
    let others = signed_permutations().into_iter().filter_map(|m| {
        let offset = median_offset(pairs, |p| m * p)?;
        Some((m, offset, angle_in(&m)?))
    });
    let fits = others.filter(|(_, offset, angle)| *angle < RIGHT_RAD && *offset < RIGHT_SHARE * off);
    let (m, offset, right) = fits.min_by(|a, b| a.1.total_cmp(&b.1))?;
    // Drawers along an axis that stays do not turn: then the offsets alone have to tell.
    if angle < TURNED_RAD && off < LEAST_SHIFT_M {
        return None;
    }
    let [x, y, z] = [0, 1, 2].map(|row| told(&m, row));
    Some(format!(
        "axes are {:.0}° from the truth and origins {off:.2} m (medians), and {:.0}° and {offset:.2} m where (x, y, z) is taken \
         for ({x}, {y}, {z}): predictions and truth disagree on the world's axes (which one is up?)",
        angle.to_degrees(),
        right.to_degrees()
    ))
}

/// A row of a signed permutation: which coordinate it takes.
fn told(m: &Matrix3<f64>, row: usize) -> String {
    let column = (0..3).find(|c| m[(row, *c)] != 0.0).unwrap_or(row);
    let name = ["x", "y", "z"].get(column).copied().unwrap_or_default();
    if m[(row, column)] < 0.0 { format!("-{name}") } else { name.to_owned() }
}

/// All ways to swap and to reverse the three axes but the one that leaves them.
fn signed_permutations() -> Vec<Matrix3<f64>> {
    const ORDERS: [[usize; 3]; 6] = [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]];
    let mut all = Vec::new();
    for order in ORDERS {
        for signs in 0..8 {
            let mut m = Matrix3::zeros();
            for (row, column) in order.into_iter().enumerate() {
                m[(row, column)] = if (signs >> row) & 1 == 0 { 1.0 } else { -1.0 };
            }
            all.push(m);
        }
    }
    all.retain(|m| *m != Matrix3::identity());
    all
}

/// Whether the answers are right once all are shifted by one way.
fn shifted(pairs: &[AnsweredClip], off: f64) -> Option<String> {
    let axis = |k: usize| median(&pairs.iter().map(|p| p.truth.origin[k] - p.origin[k]).collect::<Vec<_>>());
    let shift = Vector::new(axis(0)?, axis(1)?, axis(2)?);
    let left = median_offset(pairs, |p| p + shift)?;
    (off > LEAST_SHIFT_M && left < RIGHT_SHARE * off).then(|| {
        format!(
            "origins lie {off:.2} m from the truth (median), and {left:.2} m once all are shifted by ({:.2}, {:.2}, {:.2}) m: \
             predictions and truth disagree on the world frame",
            shift.x, shift.y, shift.z
        )
    })
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;

    fn clip(joint: &str, kind: JointKind, axis: [f64; 3], origin: [f64; 3]) -> TrueClip {
        TrueClip {
            joint: joint.to_owned(),
            kind,
            axis: Vector::from(axis),
            origin: Point::from(origin),
            origin_handle: Point::from(origin),
            moved: 1.0,
            part_box: None,
            base_box: None,
            handle: None,
            noun: None,
            action: None,
            orientation: None,
        }
    }

    fn truth() -> Truth {
        let clips = [
            ("a", clip("left", JointKind::Revolute, [0.0, 0.0, 1.0], [1.0, 2.0, 0.7])),
            ("b", clip("right", JointKind::Revolute, [0.0, 0.0, 1.0], [2.5, 2.0, 1.6])),
            ("c", clip("drawer", JointKind::Prismatic, [0.0, -1.0, 0.0], [1.8, 2.1, 0.4])),
            ("d", clip("oven", JointKind::Revolute, [1.0, 0.0, 0.0], [0.2, 2.0, 0.3])),
        ];
        let clips: BTreeMap<_, _> = clips.into_iter().map(|(name, clip)| (name.to_owned(), Some(clip))).collect();
        Truth { recording: "k".to_owned(), place: None, tier: None, clips }
    }

    /// Answers that are the truth, moved and turned.
    fn answers(axis: impl Fn(Vector) -> Vector, origin: impl Fn(Point) -> Point) -> Vec<Prediction> {
        let truth = truth();
        let row = |(name, clip): (&String, &Option<TrueClip>)| {
            let clip = clip.as_ref()?;
            Some(Prediction {
                recording: "k".to_owned(),
                clip: name.clone(),
                kind: Some(clip.kind),
                axis: Some(axis(clip.axis)),
                origin: Some(origin(clip.origin)),
                ..Prediction::default()
            })
        };
        truth.clips.iter().filter_map(row).collect()
    }

    #[test]
    fn another_frame_is_told_from_wrong_answers() {
        let said = |rows: &[Prediction]| contradiction(rows, &truth()).unwrap_or_default();
        let up = |v: Vector| Vector::new(v.x, v.z, -v.y);
        let by = Vector::new(20.0, -1.0, 0.0);
        let near = Vector::new(1.5, -0.5, 0.2);
        let middle = Point::new(1.4, 2.0, 0.8);
        for (rows, word) in [
            (answers(|a| a, |p| p), ""),
            (answers(|a| -a, |p| p + Vector::z() * 0.1), ""),
            (answers(|_| Vector::x(), |p| p), ""),
            // One place and one axis for everything is a bad answer in the right frame.
            (answers(|_| Vector::y(), |_| middle), ""),
            (answers(|a| a, |p| p + by), "origins lie 20 from the truth (median), which spans 3 m"),
            (answers(|a| a, |p| Point::from(p.coords * 1000.0)), "disagree on the unit (metres)"),
            (answers(up, |p| Point::from(up(p.coords))), "where (x, y, z) is taken for (x, -z, y)"),
            (answers(|a| a, |p| p + near), "once all are shifted by (-1.50, 0.50, -0.20) m"),
        ] {
            let said = said(&rows);
            assert!(said.contains(word) && said.is_empty() == word.is_empty(), "{word}: {said}");
        }
        // Two answers may be wrong in the same way.
        assert_eq!(said(&answers(|a| a, |p| p + near)[..2]), "");
    }
}
