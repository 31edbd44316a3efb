//! URDF through `urdf-rs`.

use std::io::Cursor;

use quick_xml::events::Event;
use quick_xml::{Reader, Writer};
use urdf_rs::{
    Axis, Collision, Color, Dynamics, Geometry, Inertia, Inertial, Joint, JointLimit, JointType, Link, LinkName, Mass,
    Material, Pose, Robot, Vec3, Vec4, Visual,
};

use super::dress::{self, Dress, Piece};
use super::shared::{ROLES, ROOM, color, local_pose, material};
use crate::articulation::JointKind;
use crate::error::{Error, Result};
use crate::look::Look;
use crate::math::Point;
use crate::twin::{MassProperties, Solid, Twin, mass_properties};

/// The twin as URDF text: a `world` link, every base and the room fixed to it, one joint per part, one box per board.
///
/// URDF cannot say that a spring carries a part: where one does, gravity pulls at it here all the same. Of a look it names the
/// files of [`dress::files`], which have to lie beside it; their materials name the pictures.
///
/// # Errors
/// Where the twin cannot be a simulator's model (see [`super::check`]), or what is wrong with the look.
pub fn write(twin: &Twin, look: Option<&Look>) -> Result<String> {
    let dress = Dress::of(twin, look)?;
    let fixed_look = (!dress.room.is_empty()).then_some(&[] as &[Piece]);
    let mut links = vec![link("world", &[], &Point::origin(), None, None)];
    let mut joints = Vec::new();
    for f in &twin.furniture {
        let origin = Point::origin();
        let density = twin.density_kg_per_m3;
        links.push(link(&f.name, &f.carcass, &origin, mass_properties(&f.carcass, density), fixed_look));
        joints.push(fixed(&f.name));
        let part = &f.part;
        let phi = part.joint.articulation;
        let link_name = format!("{}_link", part.id);
        let own = Some(dress.part(&part.id)).filter(|pieces| !pieces.is_empty());
        links.push(link(&link_name, &part.solids, &phi.origin, mass_properties(&part.solids, density), own));
        joints.push(Joint {
            name: part.id.clone(),
            joint_type: match phi.kind {
                JointKind::Revolute => JointType::Revolute,
                JointKind::Prismatic => JointType::Prismatic,
            },
            origin: Pose { xyz: Vec3(phi.origin.coords.into()), rpy: Vec3::default() },
            parent: LinkName { link: f.name.clone() },
            child: LinkName { link: link_name },
            axis: Axis { xyz: Vec3(phi.axis.into()) },
            limit: JointLimit {
                lower: 0.0,
                upper: part.joint.upper,
                effort: part.joint.effort(&twin.drives),
                velocity: part.joint.velocity(&twin.drives),
            },
            calibration: None,
            dynamics: Some(Dynamics { damping: part.joint.damping, friction: part.joint.friction }),
            mimic: None,
            safety_controller: None,
        });
    }
    if !(twin.room.is_empty() && dress.room.is_empty()) {
        let mass = mass_properties(&twin.room, twin.density_kg_per_m3);
        links.push(link(ROOM, &twin.room, &Point::origin(), mass, fixed_look.map(|_| dress.room.as_slice())));
        joints.push(fixed(ROOM));
    }
    let materials = ROLES
        .map(|r| Material { name: material(r).to_owned(), color: Some(Color { rgba: Vec4(color(r)) }), texture: None })
        .to_vec();
    let robot = Robot { name: robot_name(&twin.name), links, joints, materials };
    let text = urdf_rs::write_to_string(&robot).map_err(|e| Error::Export(format!("URDF: {e}")))?;
    // A room without boxes weighs nothing that could be told.
    let massless = if twin.room.is_empty() { ["world", ROOM].as_slice() } else { &["world"] };
    finish(&text, !dress.textures.is_empty(), massless).map_err(|e| Error::Export(format!("URDF: {e}")))
}

/// The joint that holds a link to the world.
fn fixed(name: &str) -> Joint {
    Joint {
        name: format!("{name}_fixed"),
        joint_type: JointType::Fixed,
        origin: Pose::default(),
        parent: LinkName { link: "world".to_owned() },
        child: LinkName { link: name.to_owned() },
        axis: Axis::default(),
        limit: JointLimit::default(),
        calibration: None,
        dynamics: None,
        mimic: None,
        safety_controller: None,
    }
}

/// Robot names end up as identifiers in ROS.
fn robot_name(name: &str) -> String {
    let clean: String = name.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).collect();
    if clean.is_empty() { "twin".to_owned() } else { clean }
}

/// What the writer of `urdf-rs` cannot say: no inertial for `massless` links (it writes a zero mass), no limits for fixed joints
/// (it writes zeros), and the element that keeps MuJoCo from fusing the fixed furniture into the world, dropping the
/// visuals, and looking for `meshes` elsewhere than where the file says.
fn finish(text: &str, meshes: bool, massless: &[&str]) -> std::result::Result<String, Box<dyn std::error::Error>> {
    let mut reader = Reader::from_str(text);
    reader.config_mut().trim_text(true);
    let mut writer = Writer::new_with_indent(Cursor::new(Vec::new()), b' ', 2);
    // In a massless link; in a fixed joint; how deep in an element that is left out.
    let (mut weightless, mut fixed, mut skipped) = (false, false, 0usize);
    loop {
        let event = reader.read_event()?;
        match &event {
            Event::Eof => break,
            Event::Start(e) | Event::Empty(e) => {
                let name = e.name();
                let value = |key: &str| -> std::result::Result<Option<String>, Box<dyn std::error::Error>> {
                    Ok(e.try_get_attribute(key)?.map(|a| a.value.to_string()))
                };
                match name.as_ref() {
                    "link" => weightless = value("name")?.is_some_and(|name| massless.contains(&name.as_str())),
                    "joint" => fixed = value("type")?.as_deref() == Some("fixed"),
                    _ => {}
                }
                let left_out = (weightless && name.as_ref() == "inertial") || (fixed && name.as_ref() == "limit");
                if skipped > 0 || left_out {
                    skipped += usize::from(matches!(event, Event::Start(_)));
                    continue;
                }
            }
            Event::End(e) => {
                match e.name().as_ref() {
                    "link" => weightless = false,
                    "joint" => fixed = false,
                    _ => {}
                }
                if skipped > 0 {
                    skipped -= 1;
                    continue;
                }
            }
            _ => {}
        }
        let root = matches!(&event, Event::Start(e) if e.name().as_ref() == "robot");
        writer.write_event(event)?;
        if root {
            writer.create_element("mujoco").write_inner_content(|xml| {
                let strip = meshes.then_some(("strippath", "false"));
                xml.create_element("compiler")
                    .with_attributes([("fusestatic", "false"), ("discardvisual", "false")].into_iter().chain(strip))
                    .write_empty()?;
                Ok(())
            })?;
        }
    }
    let mut out = String::from_utf8(writer.into_inner().into_inner())?;
    out.push('\n');
    Ok(out)
}

/// A link of boxes; `look` is shown in their place.
fn link(name: &str, solids: &[Solid], origin: &Point, mass: Option<MassProperties>, look: Option<&[Piece]>) -> Link {
    let pose = |s: &Solid| {
        let p = local_pose(&s.shape, origin);
        let (roll, pitch, yaw) = p.rotation.euler_angles();
        Pose { xyz: Vec3(p.translation.vector.into()), rpy: Vec3([roll, pitch, yaw]) }
    };
    let geometry = |s: &Solid| Geometry::Box { size: Vec3((s.shape.half * 2.0).into()) };
    Link {
        name: name.to_owned(),
        inertial: mass.map_or_else(Inertial::default, |m| Inertial {
            origin: Pose { xyz: Vec3((m.center - origin).into()), rpy: Vec3::default() },
            mass: Mass { value: m.mass },
            inertia: Inertia {
                ixx: m.inertia[(0, 0)],
                ixy: m.inertia[(0, 1)],
                ixz: m.inertia[(0, 2)],
                iyy: m.inertia[(1, 1)],
                iyz: m.inertia[(1, 2)],
                izz: m.inertia[(2, 2)],
            },
        }),
        visual: match look {
            Some(pieces) => pieces.iter().map(textured).collect(),
            None => solids
                .iter()
                .map(|s| Visual {
                    name: Some(format!("{}_visual", s.name)),
                    origin: pose(s),
                    geometry: geometry(s),
                    material: Some(Material { name: material(s.role).to_owned(), color: None, texture: None }),
                })
                .collect(),
        },
        collision: solids
            .iter()
            .map(|s| Collision { name: Some(s.name.clone()), origin: pose(s), geometry: geometry(s) })
            .collect(),
    }
}

/// A textured mesh. A material here would hide that of the mesh's file.
fn textured(piece: &Piece) -> Visual {
    Visual {
        name: Some(piece.name.clone()),
        origin: Pose::default(),
        geometry: Geometry::Mesh { filename: dress::mesh_file(piece), scale: None },
        material: None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_worlds_inertial_and_the_limits_of_fixed_joints_go() {
        let text = r#"<robot name="a"><link name="world"><inertial><mass value="0"/></inertial></link>
            <link name="b"><inertial><mass value="2"/></inertial></link>
            <joint name="c" type="fixed"><limit lower="0"/><axis xyz="1 0 0"/></joint>
            <joint name="d" type="revolute"><limit lower="0"/></joint></robot>"#;
        let done = finish(text, false, &["world"]).unwrap();
        assert!(!done.contains("<mass value=\"0\"/>") && done.contains("<mass value=\"2\"/>"), "{done}");
        assert_eq!((done.matches("<limit").count(), done.matches("<axis").count()), (1, 1), "{done}");
        assert!(done.contains("<compiler fusestatic=\"false\" discardvisual=\"false\"/>"), "{done}");
    }
}
