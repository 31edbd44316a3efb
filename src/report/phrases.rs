//! Joints in words for people.

use crate::articulation::{Articulation, JointKind, Outcome};
use crate::geometry::Face;
use crate::pipeline::{ClipResult, Scene, SceneJoint};
use crate::twin::Part;

/// An opening for people: degrees or centimetres.
#[must_use]
pub fn amount(kind: JointKind, opening: f64) -> String {
    match kind {
        JointKind::Revolute => format!("{:.0}°", opening.to_degrees()),
        JointKind::Prismatic => centimetres(opening),
    }
}

/// A length for people.
#[must_use]
pub fn centimetres(metres: f64) -> String {
    if metres.abs() < 0.1 { format!("{:.1} cm", 100.0 * metres) } else { format!("{:.0} cm", 100.0 * metres) }
}

/// How much more likely a joint is than its best rival, for people: "20:1"; "1:20" where the rival is.
#[must_use]
pub fn margin(nats: Option<f64>) -> String {
    // Beyond this the hand's noise is in doubt, not the rival.
    const MOST: f64 = 1e4;
    let Some(nats) = nats else { return "-".to_owned() };
    let odds = match nats.abs().exp() {
        odds if odds > MOST => format!("over {MOST:.0}"),
        odds if odds < 1.05 => "1".to_owned(),
        odds if odds < 9.95 => format!("{odds:.1}"),
        odds if odds < 100.0 => format!("{odds:.0}"),
        // More than two digits are the noise's.
        odds => {
            let unit = 10f64.powf(odds.log10().floor() - 1.0);
            format!("{:.0}", (odds / unit).round() * unit)
        }
    };
    if nats >= 0.0 { format!("{odds}:1") } else { format!("1:{odds}") }
}

/// A probability for people; nothing that was estimated is certain.
#[must_use]
pub fn sure(probability: f64) -> String {
    if probability > 0.99 { "over 99 %".to_owned() } else { format!("{:.0} %", 100.0 * probability) }
}

/// Where the axis is, seen by the person: "upright, left"; or where it leads: "straight out".
#[must_use]
pub fn axis(part: &Part, face: Option<&Face>) -> String {
    place(&part.joint.articulation, face)
}

/// What physics says against ways in which a part could move: "slide (straight out): its front runs into a wall".
#[must_use]
pub fn refuted(joint: &SceneJoint) -> Vec<String> {
    joint
        .hypotheses
        .iter()
        .filter_map(|h| {
            let why = h.refuted.as_ref()?;
            Some(format!("{} ({}): {why}", h.joint.kind.word(), place(&h.joint, joint.face.as_ref())))
        })
        .collect()
}

/// What a reader has to know of a scene whose recording has no depth.
#[must_use]
pub fn assumed(scene: &Scene) -> Option<&'static str> {
    let any = scene.joints.iter().any(|joint| scene.is_assumed(joint));
    any.then_some("no depth: fronts and boxes are assumed, and what rests on them is undetermined")
}

fn place(phi: &Articulation, face: Option<&Face>) -> String {
    let upright = phi.axis.z.abs() > 0.8;
    let level = phi.axis.z.abs() < 0.2;
    let tilt = if upright {
        "upright"
    } else if level {
        "level"
    } else {
        "tilted"
    };
    let Some(face) = face else { return tilt.to_owned() };
    match phi.kind {
        JointKind::Prismatic => {
            let [right, up, out] = [&face.right, &face.up, &face.normal].map(|axis| phi.axis.dot(axis));
            match (out > 0.8, right.abs() >= up.abs(), right > 0.0, up > 0.0) {
                (true, ..) => "straight out",
                (_, true, true, _) => "to the right",
                (_, true, false, _) => "to the left",
                (_, false, _, true) => "upwards",
                (_, false, _, false) => "downwards",
            }
            .to_owned()
        }
        JointKind::Revolute => {
            let [right, up, _] = face.coordinates(&phi.origin);
            let side = match (phi.axis.dot(&face.up).abs() > 0.7, right < 0.0, up < 0.0) {
                (true, true, _) => "left",
                (true, false, _) => "right",
                (false, _, true) => "below",
                (false, _, false) => "above",
            };
            format!("{tilt}, {side}")
        }
    }
}

/// What became of a clip, in words. `joint`: the one that it moves.
#[must_use]
pub fn clip_reason(clip: &ClipResult, joint: Option<&SceneJoint>) -> String {
    let told = joint.and_then(|j| j.told.iter().find(|t| t.clip == clip.clip.clip));
    match (&clip.joint, told) {
        (Outcome::Abstained(reason), Some(told)) => {
            format!("{reason}; it is told to move what {} moves", told.with)
        }
        (Outcome::Abstained(reason), None) => reason.clone(),
        (Outcome::Found(j), _) => format!(
            "{}{}, axis from {}, moved {}, hand within {} of its path",
            j.joint.kind.word(),
            j.type_probability.map_or(String::new(), |p| format!(" ({} sure)", sure(p))),
            source(j.source),
            amount(j.joint.kind, j.observed_range),
            centimetres(j.residual_m)
        ),
    }
}

/// Where an axis comes from.
fn source(source: crate::geometry::AxisSource) -> &'static str {
    use crate::geometry::AxisSource::{
        Assumed, FaceAxis, FaceEdge, FaceNormal, HandArc, HandPath, Line, Manhattan, PartEdge, PlaneEdge,
    };
    match source {
        Line => "a line seen in several views",
        PlaneEdge => "where two sides of the furniture meet",
        PartEdge => "an edge of the part that moved",
        FaceEdge => "an edge of the face",
        HandArc => "the arc of the hand",
        FaceNormal => "the front's normal",
        FaceAxis => "an axis of the front",
        Manhattan => "the room's frame",
        HandPath => "the path of the hand",
        Assumed => "the usual size of fronts",
    }
}
