//! URDF through `urdf-rs`.

use urdf_rs::{
    Axis, Collision, Color, Dynamics, Geometry, Inertia, Inertial, Joint, JointLimit, JointType, Link, LinkName, Mass,
    Material, Pose, Robot, Vec3, Vec4, Visual,
};

use super::{color, local_pose, material};
use crate::articulation::JointKind;
use crate::error::{Error, Result};
use crate::math::Point;
use crate::twin::{MassProperties, Role, Solid, Twin, mass_properties};

/// The twin as URDF text: a `world` link, every base fixed to it, one joint per part, one box per board.
///
/// # Errors
/// Where the twin cannot be a simulator's model (see [`super::check`]).
pub fn write(twin: &Twin) -> Result<String> {
    super::check(twin)?;
    let mut links = vec![link("world", &[], &Point::origin(), None)];
    let mut joints = Vec::new();
    for f in &twin.furniture {
        let origin = Point::origin();
        let density = twin.density_kg_per_m3;
        links.push(link(&f.name, &f.carcass, &origin, mass_properties(&f.carcass, density)));
        joints.push(Joint {
            name: format!("{}_fixed", f.name),
            joint_type: JointType::Fixed,
            origin: Pose::default(),
            parent: LinkName { link: "world".to_owned() },
            child: LinkName { link: f.name.clone() },
            axis: Axis::default(),
            limit: JointLimit::default(),
            calibration: None,
            dynamics: None,
            mimic: None,
            safety_controller: None,
        });
        let part = &f.part;
        let phi = part.joint.articulation;
        let link_name = format!("{}_link", part.id);
        links.push(link(&link_name, &part.solids, &phi.origin, mass_properties(&part.solids, density)));
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
                effort: part.joint.effort(),
                velocity: part.joint.velocity(),
            },
            calibration: None,
            dynamics: Some(Dynamics { damping: part.joint.damping, friction: part.joint.friction }),
            mimic: None,
            safety_controller: None,
        });
    }
    let materials = [Role::Front, Role::Handle, Role::Tray, Role::Carcass]
        .map(|r| Material { name: material(r).to_owned(), color: Some(Color { rgba: Vec4(color(r)) }), texture: None })
        .to_vec();
    let robot = Robot { name: robot_name(&twin.name), links, joints, materials };
    let text = urdf_rs::write_to_string(&robot).map_err(|e| Error::Export(format!("URDF: {e}")))?;
    Ok(finish(&text))
}

/// Robot names end up as identifiers in ROS.
fn robot_name(name: &str) -> String {
    let clean: String = name.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).collect();
    if clean.is_empty() { "twin".to_owned() } else { clean }
}

/// What the writer of `urdf-rs` cannot say: no inertial for `world` (it writes a zero mass), and the element that keeps
/// MuJoCo from fusing the fixed furniture into the world and dropping the visuals.
fn finish(text: &str) -> String {
    let mut out = String::with_capacity(text.len() + 256);
    let mut rest = text;
    if let (Some(start), Some(end)) = (text.find("<inertial>"), text.find("</inertial>"))
        && text.find("<link name=\"world\">").is_some_and(|w| w < start)
    {
        let from = text[..start].rfind('>').map_or(start, |i| i + 1);
        out.push_str(&text[..from]);
        rest = &text[end + "</inertial>".len()..];
    }
    out.push_str(rest);
    let mujoco = "<mujoco>\n    <compiler fusestatic=\"false\" discardvisual=\"false\"/>\n  </mujoco>";
    if let Some(at) = out.find("<robot").and_then(|r| out[r..].find('>').map(|i| r + i + 1)) {
        out.insert_str(at, &format!("\n  {mujoco}"));
    }
    if !out.ends_with('\n') {
        out.push('\n');
    }
    out
}

fn link(name: &str, solids: &[Solid], origin: &Point, mass: Option<MassProperties>) -> Link {
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
        visual: solids
            .iter()
            .map(|s| Visual {
                name: Some(format!("{}_visual", s.name)),
                origin: pose(s),
                geometry: geometry(s),
                material: Some(Material { name: material(s.role).to_owned(), color: None, texture: None }),
            })
            .collect(),
        collision: solids
            .iter()
            .map(|s| Collision { name: Some(s.name.clone()), origin: pose(s), geometry: geometry(s) })
            .collect(),
    }
}
