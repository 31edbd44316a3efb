//! Where the edges of moving parts are, against the truth.

use std::collections::BTreeMap;

use serde::Serialize;

use super::truth::{Predictions, TrueClip, Truth};
use crate::articulation::JointKind;
use crate::math::{Vector, stats};
use crate::twin::{OrientedBox, box_iou};

/// Half of the thickness, handle included, below which a box is a leaf, metres.
const THIN_M: f64 = 0.05;

/// The front of one true part beside its prediction.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FrontError {
    /// The true joint.
    pub joint: String,
    /// The predicted one.
    pub predicted: Option<String>,
    /// How far the predicted box ends beyond the true one at the four edges of the front, metres: low and high along the front's
    /// flatter direction, low and high along its steeper one. Negative: it ends before.
    pub edges_m: [f64; 4],
    /// Intersection over union of both boxes.
    pub iou: f64,
}

impl FrontError {
    /// The edge that is off most, metres.
    #[must_use]
    pub fn worst_m(&self) -> f64 {
        self.edges_m.iter().map(|e| e.abs()).fold(0.0, f64::max)
    }
}

/// All fronts of a recording.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FrontErrors {
    /// True parts that clips move and whose boxes are known.
    pub parts: usize,
    /// Those that have a predicted box.
    pub fronts: Vec<FrontError>,
    /// Median over all their edges, metres.
    pub median_edge_m: Option<f64>,
    /// Worst of all edges, metres.
    pub worst_edge_m: Option<f64>,
    /// Median intersection over union of the boxes.
    pub median_iou: Option<f64>,
}

/// Compares the boxes of parts; of several clips of a part the first that has a box counts.
#[must_use]
pub fn compare(predictions: &Predictions, truth: &Truth) -> FrontErrors {
    let mut fronts: BTreeMap<&str, Option<FrontError>> = BTreeMap::new();
    for (name, clip) in &truth.clips {
        let Some((clip, part)) = clip.as_ref().and_then(|clip| Some((clip, clip.part_box?))) else { continue };
        let entry = fronts.entry(clip.joint.as_str()).or_default();
        let mut rows = predictions.predictions.iter().filter(|p| p.recording == truth.recording && p.clip == *name);
        if entry.is_none()
            && let Some((row, own)) = rows.find_map(|row| Some((row, row.part_box?)))
        {
            *entry = Some(FrontError {
                joint: clip.joint.clone(),
                predicted: row.joint.clone(),
                edges_m: edges(clip, &part, &own),
                iou: box_iou(&part, &own),
            });
        }
    }
    let parts = fronts.len();
    let fronts: Vec<FrontError> = fronts.into_values().flatten().collect();
    let edges: Vec<f64> = fronts.iter().flat_map(|f| f.edges_m).map(f64::abs).collect();
    let ious: Vec<f64> = fronts.iter().map(|f| f.iou).collect();
    FrontErrors {
        parts,
        median_edge_m: stats::median(&edges),
        worst_edge_m: edges.iter().copied().reduce(f64::max),
        median_iou: stats::median(&ious),
        fronts,
    }
}

/// See [`FrontError::edges_m`].
fn edges(clip: &TrueClip, part: &OrientedBox, own: &OrientedBox) -> [f64; 4] {
    let corners = own.corners().map(|c| part.rotation.transpose() * (c - part.center));
    let mut low = Vector::repeat(f64::INFINITY);
    let mut high = Vector::repeat(f64::NEG_INFINITY);
    for corner in &corners {
        low = low.inf(corner);
        high = high.sup(corner);
    }
    let out = out_of_front(clip, part);
    let (a, b) = ((out + 1) % 3, (out + 2) % 3);
    let steep = |k: usize| part.rotation[(2, k)].abs();
    let (flat, steep) = if steep(a) > steep(b) { (b, a) } else { (a, b) };
    // Low and high along the world's directions, not the box's own, which may point either way.
    let sides = |k: usize, forward: bool| {
        let [below, above] = [-part.half[k] - low[k], high[k] - part.half[k]];
        if forward { [below, above] } else { [above, below] }
    };
    let direction: Vector = part.rotation.column(flat).into_owned();
    let [left, right] = sides(flat, direction[direction.iamax()] > 0.0);
    let [bottom, top] = sides(steep, part.rotation[(2, steep)] >= 0.0);
    [left, right, bottom, top]
}

/// The axis of a part's box that points out of its front: along the way on which it begins to open.
fn out_of_front(clip: &TrueClip, part: &OrientedBox) -> usize {
    let motion = match clip.kind {
        JointKind::Prismatic => clip.axis,
        JointKind::Revolute => clip.axis.cross(&(clip.handle.unwrap_or(part.center) - clip.origin)),
    };
    let along = part.rotation.transpose() * motion;
    let thin = part.half.imin();
    // A sliding door opens along its face, and is thin across it; what is thin of a drawer is its height.
    let within_face =
        clip.kind == JointKind::Prismatic && part.half[thin] < THIN_M && part.rotation[(2, thin)].abs() < 0.5;
    if within_face || along.norm() == 0.0 { thin } else { along.iamax() }
}

#[cfg(test)]
mod tests {
    use super::super::truth::Prediction;
    use super::*;
    use crate::math::Point;

    /// A door of 60 x 80 cm in the plane y = 0, hinged at its left side.
    fn truth() -> Truth {
        let part = OrientedBox {
            center: Point::new(0.3, 0.0, 1.0),
            half: Vector::new(0.3, 0.03, 0.4),
            rotation: nalgebra::Matrix3::identity(),
        };
        let clip = TrueClip {
            joint: "door".to_owned(),
            kind: JointKind::Revolute,
            axis: Vector::z(),
            origin: Point::new(0.0, 0.0, 1.0),
            origin_handle: Point::new(0.0, 0.0, 1.0),
            moved: 1.0,
            part_box: Some(part),
            base_box: None,
            handle: Some(Point::new(0.55, 0.0, 1.0)),
            noun: None,
            action: None,
            orientation: None,
        };
        let clips = [("a", Some(clip.clone())), ("b", Some(clip)), ("c", None)];
        Truth {
            recording: "r".to_owned(),
            place: None,
            tier: None,
            clips: clips.into_iter().map(|(name, clip)| (name.to_owned(), clip)).collect(),
        }
    }

    fn row(clip: &str, part_box: Option<OrientedBox>) -> Prediction {
        Prediction { recording: "r".to_owned(), clip: clip.to_owned(), part_box, ..Prediction::default() }
    }

    #[test]
    fn edges_are_told_by_where_they_are_and_which_way_they_are_off() {
        let part = truth().clips["a"].as_ref().unwrap().part_box.unwrap();
        // Shifted by 3 cm to +x, and 4 cm higher at the top; the box's own axes point elsewhere.
        let own = OrientedBox {
            center: Point::new(0.33, 0.0, 1.02),
            half: Vector::new(0.42, 0.3, 0.03),
            rotation: nalgebra::Matrix3::new(0.0, -1.0, 0.0, 0.0, 0.0, -1.0, 1.0, 0.0, 0.0),
        };
        let fronts = compare(&Predictions { predictions: vec![row("a", None), row("b", Some(own))] }, &truth());
        assert_eq!((fronts.parts, fronts.fronts.len()), (1, 1));
        for (found, expected) in fronts.fronts[0].edges_m.iter().zip([-0.03, 0.03, 0.0, 0.04]) {
            assert!((found - expected).abs() < 1e-9, "{:?}", fronts.fronts[0].edges_m);
        }
        assert!(
            (fronts.worst_edge_m.unwrap() - 0.04).abs() < 1e-9 && (fronts.median_edge_m.unwrap() - 0.03).abs() < 1e-9
        );
        let same = compare(&Predictions { predictions: vec![row("a", Some(part))] }, &truth());
        assert!(same.worst_edge_m.unwrap() < 1e-12 && same.median_iou.unwrap() > 0.98);
        let none = compare(&Predictions::default(), &truth());
        assert_eq!((none.parts, none.worst_edge_m), (1, None));
    }
}
