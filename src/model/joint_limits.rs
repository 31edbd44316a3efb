//! Limits of joints: where they begin, in which unit they are, how far a part may go.

use super::findings::Findings;
use super::links::{Model, ModelFormat, ModelJoint};
use super::mjcf_values::MIN_AXIS;
use super::traps;
use super::tree::Tree;
use crate::articulation::JointKind;
use crate::math::{plain, unit};

/// A hinge that opens by less has, as a rule, radians that were read as degrees: half a turn, taken so.
const MIN_HINGE_RAD: f64 = 0.056;
/// Longer slides are millimetres that were taken for metres.
pub(super) const MAX_SLIDE_M: f64 = 3.0;
const MIN_SLIDE_M: f64 = 1e-3;

/// An opening for people.
fn amount(kind: JointKind, value: f64) -> String {
    match kind {
        JointKind::Revolute if value >= 1e7 => format!("{value:e} rad"),
        JointKind::Prismatic if value >= 1e7 => format!("{value:e} m"),
        JointKind::Revolute => format!("{value:.4} rad ({:.1}°)", value.to_degrees()),
        JointKind::Prismatic => format!("{value:.4} m"),
    }
}

/// The length of an axis for people, to four digits where it is not far from 1.
fn axis_length(length: f64) -> String {
    if (1e-3..1e3).contains(&length) { format!("{length:.4}") } else { plain(length) }
}

/// Point 2: ranges that are closed at 0, in the right unit, and no longer than the furniture is deep.
pub(super) fn limits(model: &Model, tree: Option<&Tree>) -> Findings {
    let mut said = Findings::about(model.moving().next().is_some());
    let urdf = matches!(model.format, ModelFormat::Urdf { .. });
    traps::others(&mut said, model);
    for (index, joint) in model.moving() {
        let (name, Some(kind)) = (&joint.name, joint.moves()) else { continue };
        match (joint.lower, joint.upper) {
            (Some(lower), Some(upper)) => {
                range(&mut said, model, joint, kind, [lower, upper]);
                let slides = kind == JointKind::Prismatic && (0.0..=MAX_SLIDE_M).contains(&(upper - lower));
                if let Some(tree) = tree.filter(|_| slides) {
                    falls_out(&mut said, model, tree, index, upper - lower);
                }
            }
            _ if urdf => said.fault(format!(
                "{name}: no limits; write <limit lower=\"0\" upper=\"...\" effort=\"...\" velocity=\"...\"/>, and not continuous"
            )),
            _ if matches!(model.format, ModelFormat::Mjcf { limitless: true, .. }) => said.fault(format!(
                "{name}: no limits: a <flag> of the file switches all limits off (limit or constraint); take it away"
            )),
            _ => said.fault(format!("{name}: no limits; write limited=\"true\" range=\"0 ...\"")),
        }
        let length = joint.axis.norm();
        if length <= MIN_AXIS {
            said.fault(format!("{name}: its axis is 0; give it a direction"));
        } else if urdf && (length - 1.0).abs() > 1e-3 {
            // MuJoCo makes axes unit vectors itself.
            said.fault(format!("{name}: its axis has length {}; some readers do not make it 1", axis_length(length)));
        }
        let values = [
            ("effort", joint.effort, urdf),
            ("velocity", joint.velocity, urdf),
            ("damping", joint.damping, true),
            (if urdf { "friction" } else { "frictionloss" }, joint.friction, true),
        ];
        for (what, value, wanted) in values {
            match value {
                None if wanted => said.fault(format!("{name}: no {what}; write a positive one")),
                Some(v) if v <= 0.0 => said.fault(format!("{name}: {what} is {}; write a positive one", plain(v))),
                _ => {}
            }
        }
    }
    said
}

fn range(said: &mut Findings, model: &Model, joint: &ModelJoint, kind: JointKind, [lower, upper]: [f64; 2]) {
    let name = &joint.name;
    if traps::unlimited(said, model, joint, [lower, upper]) {
        return;
    }
    let [low, high] = [lower, upper].map(plain);
    if lower > upper {
        said.fault(format!(
            "{name}: lower limit {low} is above upper limit {high}, which MuJoCo takes for no limits; swap them"
        ));
        return;
    }
    if lower == upper {
        said.fault(format!(
            "{name}: limits {low} to {high} lock it, and MuJoCo takes them for no limits; widen them, or make it fixed"
        ));
        return;
    }
    traps::begins(said, joint);
    if !(lower..=upper).contains(&joint.start) {
        said.fault(format!(
            "{name}: {}, where every simulator begins, is outside its limits {low} to {high}; move the joint's frame \
             so that closed is 0",
            plain(joint.start)
        ));
    } else if lower != joint.start {
        said.tell(format!(
            "{name}: lower limit {low}: {} is not its lower end; closed is taken to be the end nearest to 0",
            plain(joint.start)
        ));
    }
    let opens = upper - lower;
    let text = amount(kind, opens);
    match kind {
        JointKind::Revolute if opens > std::f64::consts::TAU => {
            said.fault(format!("{name}: turns by {text}, more than once around; limits must be radians here"));
        }
        JointKind::Revolute if opens > std::f64::consts::PI + 1e-6 => {
            said.tell(format!("{name}: turns by {text}, farther than doors do"));
        }
        JointKind::Revolute if opens < MIN_HINGE_RAD => {
            let way_out = match model.format {
                ModelFormat::Mjcf { radian: false, .. } => {
                    "this file's angles are degrees; if radians are meant write <compiler angle=\"radian\"/>"
                }
                _ => "limits are radians here",
            };
            said.fault(format!("{name}: turns by only {text}; {way_out}"));
        }
        JointKind::Prismatic if opens > MAX_SLIDE_M => {
            said.fault(format!("{name}: slides by {text}; limits are metres here"));
        }
        JointKind::Prismatic if opens < MIN_SLIDE_M => {
            said.fault(format!("{name}: slides by only {text}; limits are metres here"));
        }
        _ => {}
    }
}

/// Tells of a slide that goes farther than its part and its furniture are deep.
fn falls_out(said: &mut Findings, model: &Model, tree: &Tree, joint: usize, travel: f64) {
    let poses = model.poses(tree, &model.closed());
    let child = tree.carrier.iter().position(|c| *c == Some(joint));
    let Some((child, parent)) = child.and_then(|c| tree.parent[c].map(|p| (c, p))) else { return };
    let Some(axis) = unit(&model.joints[joint].axis).map(|a| poses[child].rotation * a) else { return };
    let depth = |link: usize| {
        let ends = model
            .links
            .iter()
            .enumerate()
            .filter(|(i, _)| tree.body[*i] == tree.body[link])
            .flat_map(|(i, l)| {
                l.shapes
                    .iter()
                    .flat_map(|s| s.bounds.corners())
                    .map(|p| (poses[i] * p).coords.dot(&axis))
                    .collect::<Vec<_>>()
            })
            .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| [low.min(x), high.max(x)]);
        ends[1] - ends[0]
    };
    let deepest = depth(child).max(depth(parent));
    if deepest.is_finite() && travel > deepest + 1e-6 {
        said.tell(format!(
            "{}: slides by {travel:.3} m, its part and its furniture are {deepest:.3} m deep",
            model.joints[joint].name
        ));
    }
}
