//! Orientations in degrees where their format takes radians: nobody turns a part by more than once around.

use std::f64::consts::TAU;
use std::path::Path;

use super::mjcf_schema::{MAX_FAULTS, place};
use super::xml::{Element, brief};

/// A whole turn and what rounding adds, radians.
const MOST_RAD: f64 = TAU + 0.01;

/// The `<origin>`s of a URDF.
pub(super) fn of_urdf(root: &Element) -> Vec<String> {
    let mut faults = Vec::new();
    for owner in root.children.iter().filter(|c| ["link", "joint"].contains(&c.name.as_str())) {
        let name = owner.get("name").map_or_else(|| owner.label(), brief);
        for origin in [owner].into_iter().chain(&owner.children).flat_map(|e| e.all("origin")) {
            if let Some(fault) = too_far(origin, "rpy", |_| true) {
                faults.push(format!("{name}: line {}, {}: {fault}", origin.line, origin.label()));
            }
        }
    }
    faults.truncate(MAX_FAULTS);
    faults
}

/// Everything that is turned in an MJCF whose angles are radians.
pub(super) fn of_mjcf(model: &Path, root: &Element) -> Vec<String> {
    let mut faults = Vec::new();
    let mut open = vec![root];
    while let Some(element) = open.pop() {
        // Of an axis and an angle the last number is the angle.
        let found = too_far(element, "euler", |_| true).or_else(|| too_far(element, "axisangle", |i| i == 3));
        if let Some(fault) = found {
            faults.push(format!("{}: {fault}", place(model, element)));
        }
        open.extend(element.children.iter().rev());
    }
    faults.truncate(MAX_FAULTS);
    faults
}

/// An angle of an attribute that is more than a whole turn; `is_angle` tells by its index which number is one.
fn too_far(element: &Element, attribute: &str, is_angle: impl Fn(usize) -> bool) -> Option<String> {
    let text = element.get(attribute)?;
    let numbers = text.split_ascii_whitespace().map(str::parse::<f64>).enumerate();
    let mut angles = numbers.filter(|(i, _)| is_angle(*i)).filter_map(|(_, number)| number.ok());
    let angle = angles.find(|angle| angle.abs() > MOST_RAD)?;
    // What is no angle in degrees either is told as it is.
    let way_out =
        if angle.abs() <= 720.0 { format!("; {angle} degrees are {:.4}", angle.to_radians()) } else { String::new() };
    Some(format!("{attribute}=\"{}\" turns more than once around: these are radians{way_out}", brief(text)))
}

#[cfg(test)]
mod tests {
    use super::super::xml;
    use super::*;

    #[test]
    fn degrees_are_told_from_radians() {
        for (rpy, word) in [
            ("0 0 1.57", ""),
            ("6.2832 -6.2832 0", ""),
            ("0 0 90", "hinge: line 1, <origin>: rpy=\"0 0 90\" turns more than once around"),
            ("0 -45 0", "-45 degrees are -0.7854"),
        ] {
            let text = format!("<robot><joint name=\"hinge\"><origin rpy=\"{rpy}\"/></joint></robot>");
            let found = of_urdf(&xml::parse(Path::new("m.urdf"), &text).unwrap());
            assert_eq!(found.is_empty(), word.is_empty(), "{rpy}: {found:?}");
            assert!(found.iter().all(|f| f.contains(word)), "{rpy}: {found:?}");
        }
        for (turn, wrong) in
            [("euler=\"0 0 90\"", true), ("axisangle=\"9 0 0 1\"", false), ("axisangle=\"0 0 1 90\"", true)]
        {
            let text = format!("<mujoco><worldbody><body {turn}/></worldbody></mujoco>");
            let found = of_mjcf(Path::new("m.xml"), &xml::parse(Path::new("m.xml"), &text).unwrap());
            assert_eq!(found.len(), usize::from(wrong), "{turn}: {found:?}");
        }
    }
}
