//! URDF. Read from the XML itself, because what is missing must stay missing: `urdf-rs` turns an absent limit into one of
//! 0 and an absent inertia into no mass. Whether `urdf-rs` reads the file too is kept as [`ModelFormat::Urdf`]'s `complaint`.
//!
//! Read: links with inertia, boxes, cylinders, spheres, capsules and OBJ or STL meshes; joints with origin, axis, limit,
//! dynamics. A `<limit>` with one of `lower` and `upper` has 0 for the other, as the format says. What MuJoCo, PyBullet or
//! others refuse though it can be read is kept as [`ModelFormat::Urdf`]'s `faults`. Listed as not read: `mimic`, `safety_controller`, `transmission`, `gazebo` and other additions.

use std::path::Path;

use nalgebra::Matrix3;

use super::links::{JointType, Link, MassSource, Model, ModelFormat, ModelJoint, WORLD, bounded, named};
use super::urdf_geometry::{Compiler, Geometry, pose};
use super::xml::{self, Element};
use super::{angles, mjcf_schema, mjcf_values, urdf_names, weights};
use crate::error::{Error, Result};
use crate::math::{Point, Vector};

/// Reads a file.
///
/// # Errors
/// Where it cannot be read, is no URDF, or holds what no model can; a file that still has xacro in it says so.
pub fn read(path: &Path) -> Result<Model> {
    let text = xml::read_text(path)?;
    let root = xml::parse(path, &text)?;
    from_element(path, &text, &root)
}

pub(super) fn from_element(path: &Path, text: &str, root: &Element) -> Result<Model> {
    expanded(path, root)?;
    let compiler = Compiler::of(root);
    let keeps_links = compiler.keeps_links && compiler.keeps_visuals;
    let fuses = !compiler.keeps_links;
    let mended = compiler.mended;
    let complaint = urdf_rs::read_from_string(text).err().map(|e| one_line(&e.to_string()));
    let mut geometry = Geometry::new(path, compiler);
    let mut model = Model {
        name: named(root.get("name"), path),
        source: path.to_owned(),
        format: ModelFormat::Urdf { keeps_links, complaint, faults: Vec::new() },
        links: Vec::new(),
        joints: Vec::new(),
        excludes: Vec::new(),
        notes: Vec::new(),
        unread: Vec::new(),
        held: Vec::new(),
        faults: Vec::new(),
    };
    let mimics = contents(root, &mut model, &mut geometry)?;
    if model.links.is_empty() {
        return Err(Error::format(path, root.label(), "holds no <link>"));
    }
    bounded(&model)?;
    geometry.finish();
    let Geometry { faults: mut found, notes, .. } = geometry;
    model.notes.extend(notes);
    once(root, &["mujoco"], &mut found);
    root.all("mujoco").for_each(|m| once(m, &mjcf_schema::URDF_SECTIONS, &mut found));
    found.extend(mjcf_schema::of_urdf(path, root));
    found.extend(urdf_names::undefined(root));
    found.extend(mimicked(&model, &mimics));
    found.extend(floating(&model, fuses));
    found.extend(without_axis(&model));
    found.extend(weights::refused(&model, mended));
    model.faults.extend(angles::of_urdf(root).into_iter().map(|fault| (5, fault)));
    if let ModelFormat::Urdf { faults, .. } = &mut model.format {
        *faults = found;
    }
    Ok(model)
}

/// Refuses what is no URDF, or only becomes one.
fn expanded(path: &Path, root: &Element) -> Result<()> {
    if root.name != "robot" {
        return Err(root.error("expected <robot>, the outermost element of a URDF"));
    }
    if let Some(found) = xacro(root) {
        return Err(found.error(format!(
            "is xacro, not URDF; expand it first: xacro {} > model.urdf",
            path.file_name().map_or_else(|| "FILE".to_owned(), |n| n.to_string_lossy().into_owned())
        )));
    }
    Ok(())
}

/// Reads the elements right in `<robot>`. Gives the joints that follow others, by name: the follower first.
fn contents(root: &Element, model: &mut Model, geometry: &mut Geometry) -> Result<Vec<(String, String)>> {
    let mut mimics = Vec::new();
    for child in &root.children {
        match child.name.as_str() {
            "link" => model.links.push(link(child, geometry)?),
            "joint" => {
                once(child, &JOINT_HAS_ONE, &mut geometry.faults);
                let joint = joint(child, &mut model.notes)?;
                if let Some(mimic) = child.child("mimic") {
                    mimics.push((joint.name.clone(), mimic.get("joint").unwrap_or_default().to_owned()));
                }
                model.joints.push(joint);
            }
            "material" => {
                if let Some(file) = child.child("texture").and_then(|t| t.get("filename")) {
                    geometry.texture(&child.label(), file);
                }
            }
            "mujoco" => {}
            other => model.notes.push(format!("<{}> (line {}) is not read", xml::brief(other), child.line)),
        }
    }
    Ok(mimics)
}

/// A message as one line, whole unless it quotes half a file.
fn one_line(text: &str) -> String {
    const MOST: usize = 500;
    let words: Vec<&str> = text.split_whitespace().collect();
    let line = words.join(" ");
    if line.chars().count() <= MOST { line } else { format!("{}...", line.chars().take(MOST).collect::<String>()) }
}

/// What a joint has once.
const JOINT_HAS_ONE: [&str; 7] = ["origin", "parent", "child", "axis", "limit", "dynamics", "mimic"];

/// Tells of elements that are there more than once.
fn once(element: &Element, names: &[&str], faults: &mut Vec<String>) {
    for name in names {
        if let Some(second) = element.all(name).nth(1) {
            let (label, line) = (element.label(), second.line);
            faults.push(format!(
                "{label}: <{name}> is there twice (line {line}): MuJoCo refuses the file, others take the first or the last"
            ));
        }
    }
}

/// Joints that follow themselves or nothing; pairs of names, the follower first.
fn mimicked(model: &Model, mimics: &[(String, String)]) -> Vec<String> {
    let moves = |name: &str| model.joints.iter().find(|j| j.name == name).map(|j| j.moves().is_some());
    let tell = |(joint, of): &(String, String)| {
        let shown = xml::brief(of);
        if joint == of {
            return Some(format!("{joint}: mimics itself: MuJoCo refuses the file"));
        }
        match moves(of) {
            Some(true) => None,
            Some(false) => {
                Some(format!("{joint}: mimics {shown}, which does not move: MuJoCo ignores it with a warning"))
            }
            None => Some(format!("{joint}: mimics {shown}, which does not exist: MuJoCo ignores it with a warning")),
        }
    };
    mimics.iter().filter_map(tell).collect()
}

/// Floating joints that hang on what is a body of its own to MuJoCo; `fuses` says that fixed links are none.
fn floating(model: &Model, fuses: bool) -> Vec<String> {
    let Ok(tree) = model.tree() else { return Vec::new() };
    let Some(root) = tree.order.first().copied() else { return Vec::new() };
    let in_world = |link: usize| {
        let is_world = link == root && model.links[root].name == WORLD;
        is_world || (fuses && tree.body[link] == tree.body[root])
    };
    let hangs = |link: usize| {
        let joint = &model.joints[tree.carrier[link]?];
        let parent = tree.parent[link]?;
        (joint.kind == JointType::Free && !in_world(parent)).then(|| {
            format!(
                "{}: floats on {}, which is not the world: MuJoCo refuses the file, PyBullet fixes it",
                joint.name, joint.parent
            )
        })
    };
    (0..model.links.len()).filter_map(hangs).collect()
}

/// Hinges and slides whose axis has no direction.
fn without_axis(model: &Model) -> Vec<String> {
    let short = model.moving().filter(|(_, j)| j.axis.norm() <= mjcf_values::MIN_AXIS);
    short.map(|(_, j)| format!("{}: its axis is 0: MuJoCo refuses the file", j.name)).collect()
}

/// The first element that xacro has not replaced.
fn xacro(element: &Element) -> Option<&Element> {
    let unexpanded = element.attributes.iter().any(|(_, value)| value.contains("${") || value.contains("$("));
    if element.name.starts_with("xacro:") || unexpanded {
        return Some(element);
    }
    element.children.iter().find_map(xacro)
}

fn link(element: &Element, geometry: &mut Geometry) -> Result<Link> {
    let mut link = Link::named(element.own_name()?);
    once(element, &["inertial"], &mut geometry.faults);
    if let Some(inertial) = element.child("inertial") {
        once(inertial, &["origin", "mass", "inertia"], &mut geometry.faults);
        let place = pose(inertial)?;
        link.mass = inertial.child("mass").map(|m| m.number("value")).transpose()?.flatten();
        link.mass_source = MassSource::Stated;
        link.center = place * Point::origin();
        if let Some(i) = inertial.child("inertia") {
            let value = |name: &str| -> Result<f64> { Ok(i.number(name)?.unwrap_or(0.0)) };
            let (xy, xz, yz) = (value("ixy")?, value("ixz")?, value("iyz")?);
            let own = Matrix3::new(value("ixx")?, xy, xz, xy, value("iyy")?, yz, xz, yz, value("izz")?);
            let turn = place.rotation.to_rotation_matrix();
            link.inertia = turn.matrix() * own * turn.matrix().transpose();
        }
    }
    for child in &element.children {
        let visual = match child.name.as_str() {
            "visual" => true,
            "collision" => false,
            _ => continue,
        };
        once(child, &["origin", "geometry", "material"], &mut geometry.faults);
        geometry.add(&mut link, child, visual)?;
    }
    Ok(link)
}

fn joint(element: &Element, notes: &mut Vec<String>) -> Result<ModelJoint> {
    let name = element.own_name()?;
    let kind = match element.get("type") {
        Some("fixed") => JointType::Fixed,
        Some("revolute") => JointType::Revolute,
        Some("continuous") => JointType::Continuous,
        Some("prismatic") => JointType::Prismatic,
        Some("floating") => JointType::Free,
        Some("planar" | "spherical" | "ball") => JointType::Other,
        Some(other) => return Err(element.error(format!("\"{}\" is no joint type of URDF", xml::brief(other)))),
        None => return Err(element.error("has no type")),
    };
    let end = |which: &str| {
        let found = element.child(which).and_then(|e| e.get("link"));
        found.map(str::to_owned).ok_or_else(|| element.error(format!("has no <{which} link=\"...\"/>")))
    };
    let of = |child: &str, attribute: &str| match element.child(child) {
        Some(e) => e.number(attribute),
        None => Ok(None),
    };
    let axis = element.child("axis").map(|a| a.numbers::<3>("xyz")).transpose()?.flatten().unwrap_or([1.0, 0.0, 0.0]);
    let (mut lower, mut upper) = (of("limit", "lower")?, of("limit", "upper")?);
    if kind == JointType::Continuous {
        (lower, upper) = (None, None);
    } else if lower.is_some() || upper.is_some() {
        (lower, upper) = (lower.or(Some(0.0)), upper.or(Some(0.0)));
    }
    if kind == JointType::Other {
        let what = element.get("type").unwrap_or_default();
        notes.push(format!("{name}: {what} joints are not judged: only hinges and slides are"));
    }
    for extra in ["mimic", "safety_controller"] {
        if element.child(extra).is_some() {
            notes.push(format!("{name}: <{extra}> is not read; the joint is taken to move by itself"));
        }
    }
    Ok(ModelJoint {
        kind,
        parent: end("parent")?,
        child: end("child")?,
        parent_from_child: pose(element)?,
        axis: Vector::from(axis),
        anchor: Point::origin(),
        lower,
        upper,
        effort: of("limit", "effort")?,
        velocity: of("limit", "velocity")?,
        damping: of("dynamics", "damping")?,
        friction: of("dynamics", "friction")?,
        armature: None,
        limited: None,
        start: 0.0,
        name,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn model(text: &str) -> std::result::Result<Model, String> {
        let path = Path::new("m.urdf");
        let root = xml::parse(path, text).map_err(|e| e.to_string())?;
        from_element(path, text, &root).map_err(|e| e.to_string())
    }

    #[test]
    fn what_is_missing_stays_missing() {
        let text = r#"<robot name="r"><link name="a"/><link name="b"><collision><geometry><box size="2 4 6"/></geometry>
            </collision></link><joint name="j" type="revolute"><parent link="a"/><child link="b"/>
            <limit upper="1" effort="3"/></joint></robot>"#;
        let m = model(text).unwrap();
        let j = &m.joints[0];
        assert_eq!((j.lower, j.upper, j.effort, j.velocity, j.damping), (Some(0.0), Some(1.0), Some(3.0), None, None));
        assert_eq!((m.links[1].mass, m.links[1].shapes[0].bounds.half), (None, Vector::new(1.0, 2.0, 3.0)));
        assert!(matches!(&m.format, ModelFormat::Urdf { keeps_links: false, complaint: Some(_), .. }));
    }

    #[test]
    fn inertia_is_turned_into_the_links_axes() {
        let text = r#"<robot name="r"><link name="a"><inertial><origin xyz="1 0 0" rpy="0 0 1.5707963267948966"/>
            <mass value="2"/><inertia ixx="1" iyy="2" izz="3" ixy="0" ixz="0" iyz="0"/></inertial></link></robot>"#;
        let m = model(text).unwrap();
        let i = m.links[0].inertia;
        assert!((i - Matrix3::from_diagonal(&Vector::new(2.0, 1.0, 3.0))).norm() < 1e-12);
        assert_eq!(m.links[0].center, Point::new(1.0, 0.0, 0.0));
    }

    #[test]
    fn broken_files_say_where_and_what() {
        for (text, word) in [
            (r#"<robot xmlns:xacro="x"><xacro:macro name="m"/></robot>"#, "xacro m.urdf"),
            (r#"<robot><link name="${prefix}a"/></robot>"#, "xacro m.urdf"),
            (r#"<robot><joint name="j" type="hinge"/></robot>"#, "\"hinge\" is no joint type"),
            (r#"<robot><joint name="j" type="fixed"/></robot>"#, "has no <parent"),
            (r#"<robot><link/></robot>"#, "has no name"),
            (r#"<robot></robot>"#, "holds no <link>"),
            (
                r#"<robot><link name="a"><visual><origin xyz="0 nan 0"/><geometry><sphere radius="1"/></geometry></visual>
                </link></robot>"#,
                "line 1, <origin>: xyz: NaN is not finite",
            ),
        ] {
            let error = model(text).unwrap_err();
            assert!(error.contains("m.urdf") && error.contains(word), "{error}");
        }
    }
}
