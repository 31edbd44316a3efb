//! MJCF, as far as furniture needs it.
//!
//! Read: `compiler` (angle, autolimits, eulerseq, meshdir, assetdir, strippath, inertiafromgeom, inertiagrouprange,
//! settotalmass), nested `default` classes, `include`, `body`, `frame` and `replicate` with every orientation (quat,
//! axisangle, euler, xyaxes, zaxis), hinges and slides (axis, pos, range, limited, ref, damping, frictionloss, armature,
//! actuatorfrcrange), free joints, geoms (box, sphere, ellipsoid, cylinder, capsule, fromto, OBJ and STL meshes with scale,
//! refpos and refquat), inertial, sites, `contact/exclude`, and equalities that hold a joint fast. Planes are passed over:
//! nothing of a piece of furniture is endless. A body with several joints becomes a chain of links.
//!
//! What MuJoCo refuses is in [`Model::faults`]. Attachments, composites and flexes may hide joints: [`Model::unread`].
//! Listed in the notes as not read: springs, actuators, tendons, other equalities, contact pairs, height fields, plugins.

use std::path::Path;

use super::links::{Model, ModelFormat, bounded};
use super::mjcf_builder::MjcfBuilder;
use super::mjcf_context::Context;
use super::mjcf_tree::{Copies, Includes};
use super::xml::{self, Element};
use super::{angles, mjcf_assets, mjcf_equality, mjcf_refusals, mjcf_schema};
use crate::error::{Error, Result};

/// Reads a file with everything that it includes, wherever that lies.
///
/// # Errors
/// Where a file cannot be read, is no MJCF, or holds what no model can.
pub fn read(path: &Path) -> Result<Model> {
    let text = xml::read_text(path)?;
    let root = xml::parse(path, &text)?;
    from_element(path, root)
}

pub(super) fn from_element(path: &Path, mut root: Element) -> Result<Model> {
    if root.name != "mujoco" {
        return Err(root.error("expected <mujoco>, the outermost element of an MJCF"));
    }
    let mut included = Includes { model: path, read: path.canonicalize().into_iter().collect(), missing: Vec::new() };
    included.expand(&mut root, 0)?;
    let missing = included.missing;
    // What is missing may hold what the rest names.
    whole(path, root, &missing).map_err(|e| match missing.first() {
        Some(first) => Error::format(path, "include", format!("{first}: bring the file; without it: {e}")),
        None => e,
    })
}

/// A model from all of its files; `missing` are those that are not there, in words.
fn whole(path: &Path, mut root: Element, missing: &[String]) -> Result<Model> {
    let context = Context::read(path, &root)?;
    let mut refused: Vec<String> = missing.iter().map(|m| format!("{m}; MuJoCo refuses the model")).collect();
    refused.extend(mjcf_schema::violations(path, &root));
    refused.extend(mjcf_assets::missing(path, &root, &context.folders));
    let mut copies = Copies::default();
    copies.expand(&context, &mut root)?;
    let mut out = MjcfBuilder::new(path, &root);
    out.model.unread = missing.to_vec();
    for section in &root.children {
        out.section(&context, section, &copies)?;
    }
    out.finish(&context);
    bounded(&out.model)?;
    let mut model = out.model;
    let radian = context.radian || !(out.angles || turned(&root));
    model.format = ModelFormat::Mjcf { radian, limitless: context.limitless };
    let (faults, notes) = mjcf_refusals::refusals(&context, &root, &copies, &model);
    refused.extend(faults);
    model.notes.extend(notes);
    refused.truncate(mjcf_schema::MAX_FAULTS);
    model.faults.extend(refused.into_iter().map(|f| (1, f)));
    model.faults.extend(mjcf_schema::strays(path, &root).into_iter().map(|f| (4, f)));
    if context.radian {
        model.faults.extend(angles::of_mjcf(path, &root).into_iter().map(|f| (5, f)));
    }
    mjcf_equality::read(&context, &root, &mut model);
    // What is refused is so with limits that are switched off, too.
    if context.limitless {
        for joint in &mut model.joints {
            (joint.lower, joint.upper) = (None, None);
        }
    }
    Ok(model)
}

/// Whether an orientation is written as an angle that is not 0.
fn turned(element: &Element) -> bool {
    let is_angle = |text: &str| text.split_ascii_whitespace().any(|w| w.parse::<f64>().is_ok_and(|v| v != 0.0));
    ["euler", "axisangle"].into_iter().filter_map(|a| element.get(a)).any(is_angle)
        || element.children.iter().any(turned)
}

#[cfg(test)]
mod tests {
    use super::super::links::{JointType, MassSource};
    use super::*;
    use crate::math::{Point, Vector, rotation};

    fn model(text: &str) -> std::result::Result<Model, String> {
        let path = Path::new("m.xml");
        xml::parse(path, text).and_then(|root| from_element(path, root)).map_err(|e| e.to_string())
    }

    #[test]
    fn classes_angles_and_frames_add_up() {
        let m = model(
            r#"<mujoco><compiler eulerseq="xyz"/>
            <default><geom density="700"/><default class="door"><joint range="0 90" damping="2"/>
              <default class="stiff"><joint damping="5" axis="0 0 2"/></default></default></default>
            <worldbody><body name="b" pos="1 0 0" euler="0 0 90" childclass="door">
              <joint name="j" class="stiff" pos="0 0.5 0" frictionloss="1"/>
              <geom name="panel" type="box" size="0.1 0.2 0.3" pos="0 0 1"/>
              <frame pos="0 0 1"><geom name="handle" type="capsule" fromto="0 0 0 0 1 0" size="0.05" mass="0.2"/></frame>
              <geom type="box" size="1 1 1" contype="0" conaffinity="0" density="0"/>
            </body></worldbody><equality/></mujoco>"#,
        )
        .unwrap();
        let j = &m.joints[0];
        assert_eq!(
            (j.kind, j.damping, j.friction, j.axis),
            (JointType::Revolute, Some(5.0), Some(1.0), Vector::z() * 2.0)
        );
        assert!((j.upper.unwrap() - std::f64::consts::FRAC_PI_2).abs() < 1e-12);
        let tree = m.tree().unwrap();
        let closed = m.poses(&tree, &[0.0])[1];
        assert!((closed * Point::new(0.0, 0.5, 0.0) - Point::new(0.5, 0.0, 0.0)).norm() < 1e-12);
        // Turning about the anchor leaves the anchor where it is.
        let open = m.poses(&tree, &[1.0])[1];
        assert!((open * j.anchor - closed * j.anchor).norm() < 1e-12);
        let link = &m.links[1];
        let bar = link.shapes.iter().find(|s| s.name.as_deref() == Some("handle")).unwrap();
        assert!((bar.bounds.center - Point::new(0.0, 0.5, 1.0)).norm() < 1e-12 && !bar.exact);
        assert_eq!(link.shapes.iter().filter(|s| s.visual).count(), 1);
        assert_eq!(link.mass_source, MassSource::Shapes);
        assert!((link.mass.unwrap() - (700.0 * 0.048 + 0.2)).abs() < 1e-9);
        assert!(m.notes.is_empty() && m.faults.is_empty(), "{:?} {:?}", m.notes, m.faults);
    }

    #[test]
    fn several_joints_of_a_body_are_a_chain() {
        let m = model(
            r#"<mujoco><worldbody><body name="b"><joint name="x" type="slide" axis="1 0 0"/><joint name="z"/>
            <geom size="0.1"/></body></worldbody></mujoco>"#,
        )
        .unwrap();
        let tree = m.tree().unwrap();
        assert_eq!((m.links.len(), m.links[1].between, m.links[2].name.as_str()), (3, true, "b"));
        let at = m.poses(&tree, &[2.0, 0.3])[2];
        assert!(
            (at.translation.vector - Vector::x() * 2.0).norm() < 1e-12 && (at.rotation.angle() - 0.3).abs() < 1e-12
        );
        assert_eq!(m.links[2].mass_source, MassSource::Assumed);
    }

    #[test]
    fn every_orientation_means_what_the_format_says() {
        let turned = |attribute: &str| {
            let text = format!("<mujoco><worldbody><body name=\"b\" {attribute}/></worldbody></mujoco>");
            model(&text).map(|m| m.joints[0].parent_from_child.rotation)
        };
        let quarter = rotation(&Vector::z(), std::f64::consts::FRAC_PI_2);
        for attribute in ["quat=\"1 0 0 1\"", "axisangle=\"0 0 3 90\"", "euler=\"0 0 90\"", "xyaxes=\"0 1 0 -1 0.5 0\""]
        {
            assert!(turned(attribute).unwrap().angle_to(&quarter) < 1e-9, "{attribute}");
        }
        let down = turned("zaxis=\"0 0 -2\"").unwrap() * Vector::z();
        assert!((down + Vector::z()).norm() < 1e-9);
        // Intrinsic x then y: y is turned along.
        let both = turned("euler=\"90 90 0\"").unwrap() * Vector::x();
        assert!((both - Vector::y()).norm() < 1e-9, "{both}");
        assert!(turned("quat=\"0 0 0 0\"").unwrap_err().contains("gives no direction"));
    }

    #[test]
    fn broken_files_say_where_and_what() {
        for (body, word) in [
            (r#"<geom class="nope" size="1"/>"#, "no default class \"nope\""),
            (r#"<geom type="box" size="1 1"/>"#, "line 1, <geom>: a box needs 3 positive numbers"),
            (r#"<body name="a"><joint range="0 inf"/></body>"#, "<joint>: range: inf is not finite"),
            (r#"<body name="a"><joint type="screw"/></body>"#, "\"screw\" is no joint type"),
        ] {
            let error = model(&format!("<mujoco><worldbody>{body}</worldbody></mujoco>")).unwrap_err();
            assert!(error.contains("m.xml") && error.contains(word), "{error}");
        }
    }
}
