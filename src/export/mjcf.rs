//! MJCF through `quick-xml`, in the manner of MuJoCo Menagerie: defaults, sites, excludes, keyframes.

use std::io::Cursor;

use quick_xml::Writer;

use super::dress::{self, Dress, Piece};
use super::shared::{ROLES, ROOM, ROOT, color, local_pose, material};
use crate::articulation::JointKind;
use crate::error::{Error, Result};
use crate::look::Look;
use crate::math::Point;
use crate::twin::{Solid, Twin, mass_properties};

type Xml = Writer<Cursor<Vec<u8>>>;

fn list(values: &[f64]) -> String {
    values.iter().map(f64::to_string).collect::<Vec<_>>().join(" ")
}

/// Format: how far below the lowest point of what moves the floor's plane is at least, metres: no contact, and not to be seen.
const UNDER_M: f64 = 0.002;
/// What the names of the room's boxes begin with that people stand on.
const ROOM_FLOOR: &str = "room_floor";

/// The twin as a scene: the furniture with floor and light, and keyframes `closed` and `open`.
///
/// Of a look it names the files of [`dress::files`], which have to lie beside it. Its meshes are in group 2 and touch nothing;
/// boxes that they hide are in group 3 alone.
///
/// # Errors
/// Where the twin cannot be a simulator's model (see [`super::check`]), or what is wrong with the look.
pub fn write(twin: &Twin, look: Option<&Look>) -> Result<String> {
    text(twin, look, true)
}

/// The furniture alone, to be included in a scene that has a floor and light of its own. MuJoCo looks for the files of a look
/// beside that scene.
///
/// # Errors
/// As [`write`].
pub fn write_model(twin: &Twin, look: Option<&Look>) -> Result<String> {
    text(twin, look, false)
}

fn text(twin: &Twin, look: Option<&Look>, with_room: bool) -> Result<String> {
    let dress = Dress::of(twin, look)?;
    let mut xml = Writer::new_with_indent(Cursor::new(Vec::new()), b' ', 2);
    model(&mut xml, twin, &dress, with_room).map_err(|e| Error::Export(format!("MJCF: {e}")))?;
    let mut text = String::from_utf8(xml.into_inner().into_inner()).map_err(|e| Error::Export(format!("MJCF: {e}")))?;
    text.push('\n');
    Ok(text)
}

fn model(xml: &mut Xml, twin: &Twin, dress: &Dress, with_room: bool) -> std::io::Result<()> {
    let fixed = dress.room.is_empty();
    xml.create_element("mujoco").with_attribute(("model", twin.name.as_str())).write_inner_content(|xml| {
        xml.create_element("compiler").with_attributes([("angle", "radian"), ("autolimits", "true")]).write_empty()?;
        xml.create_element("option").with_attribute(("integrator", "implicitfast")).write_empty()?;
        if with_room {
            xml.create_element("visual").write_inner_content(|xml| {
                xml.create_element("headlight").with_attribute(("ambient", "0.4 0.4 0.4")).write_empty()?;
                Ok(())
            })?;
        }
        defaults(xml)?;
        xml.create_element("asset").write_inner_content(|xml| {
            for role in ROLES {
                xml.create_element("material")
                    .with_attributes([("name", material(role)), ("rgba", list(&color(role)).as_str())])
                    .write_empty()?;
            }
            assets(xml, dress)
        })?;
        xml.create_element("worldbody").write_inner_content(|xml| {
            if with_room {
                floor_and_light(xml, twin)?;
            }
            xml.create_element("body").with_attribute(("name", ROOT)).write_inner_content(|xml| {
                for f in &twin.furniture {
                    xml.create_element("body").with_attribute(("name", f.name.as_str())).write_inner_content(
                        |xml| {
                            inertial(xml, &f.carcass, &Point::origin(), twin.density_kg_per_m3)?;
                            geoms(xml, &f.carcass, &Point::origin(), fixed)?;
                            part(xml, twin, f, dress.part(&f.part.id))
                        },
                    )?;
                }
                if !(twin.room.is_empty() && fixed) {
                    xml.create_element("body").with_attribute(("name", ROOM)).write_inner_content(|xml| {
                        inertial(xml, &twin.room, &Point::origin(), twin.density_kg_per_m3)?;
                        meshes(xml, &dress.room)?;
                        geoms(xml, &twin.room, &Point::origin(), fixed)
                    })?;
                }
                Ok(())
            })?;
            Ok(())
        })?;
        xml.create_element("contact").write_inner_content(|xml| {
            // MuJoCo keeps contacts between a body and a parent welded to the world: exactly a fixed cabinet.
            for f in &twin.furniture {
                xml.create_element("exclude")
                    .with_attributes([("body1", f.name.as_str()), ("body2", body_name(&f.part.id).as_str())])
                    .write_empty()?;
            }
            Ok(())
        })?;
        keyframes(xml, twin)
    })?;
    Ok(())
}

fn body_name(id: &str) -> String {
    format!("{id}_link")
}

/// Numerics: how a limit stops a joint: time constant in s, damping ratio (MuJoCo, "Solver parameters").
///
/// Two steps of 2 ms, the shortest that MuJoCo keeps. A limit pushes one way only: critically damped it throws a part back
/// at exp(-2) = 14 % of its speed, and at 25 % where a step ends deep in it; twice as damped, at 6 % whatever the step.
const LIMIT_SOLREF: &str = "0.004 2";
/// Numerics: inertia that MuJoCo adds to a joint, kg m^2 or kg, for matrices that are well conditioned however light a part is; a
/// cupboard's door has some hundred times as much.
const ARMATURE: &str = "0.001";

fn defaults(xml: &mut Xml) -> std::io::Result<()> {
    xml.create_element("default").write_inner_content(|xml| {
        for (class, attributes) in [
            ("visual", [("group", "2"), ("contype", "0"), ("conaffinity", "0")].as_slice()),
            ("collision", [("group", "3")].as_slice()),
        ] {
            xml.create_element("default").with_attribute(("class", class)).write_inner_content(|xml| {
                xml.create_element("geom")
                    .with_attribute(("type", "box"))
                    .with_attributes(attributes.iter().copied())
                    .write_empty()?;
                Ok(())
            })?;
        }
        for (class, kind) in [("hinge", "hinge"), ("slide", "slide")] {
            xml.create_element("default").with_attribute(("class", class)).write_inner_content(|xml| {
                xml.create_element("joint")
                    .with_attributes([
                        ("type", kind),
                        ("limited", "true"),
                        ("armature", ARMATURE),
                        ("solreflimit", LIMIT_SOLREF),
                    ])
                    .write_empty()?;
                Ok(())
            })?;
        }
        Ok(())
    })?;
    Ok(())
}

fn floor_and_light(xml: &mut Xml, twin: &Twin) -> std::io::Result<()> {
    // Everywhere that anything can be: a dishwasher's door reaches below its furniture when it is open.
    let opened = |part: &crate::twin::Part| {
        let motions: Vec<_> =
            (0..=8).map(|i| part.joint.articulation.motion(part.joint.upper * f64::from(i) / 8.0)).collect();
        let moved = |s: &Solid| motions.iter().flat_map(|m| s.shape.moved(m).corners()).collect::<Vec<_>>();
        part.solids.iter().flat_map(moved).collect::<Vec<_>>()
    };
    let corners: Vec<Point> = twin
        .furniture
        .iter()
        .flat_map(|f| f.carcass.iter().flat_map(|s| s.shape.corners()).chain(opened(&f.part)))
        .collect();
    let low = corners.iter().map(|c| c.z).fold(f64::INFINITY, f64::min);
    let high = corners.iter().map(|c| c.z).fold(f64::NEG_INFINITY, f64::max);
    let middle = crate::math::centroid(&corners).unwrap_or(Point::origin());
    // On the room's floor; where the recording does not tell it, just under the lowest point. A plane has no end, the room's
    // floor has one: a part that goes below it elsewhere must not stick in the plane.
    let of_room = twin.room.iter().filter(|s| s.name.starts_with(ROOM_FLOOR)).flat_map(|s| s.shape.corners());
    let moving = twin.furniture.iter().flat_map(|f| opened(&f.part)).map(|c| c.z).fold(f64::INFINITY, f64::min);
    let floor = match of_room.map(|c| c.z).max_by(f64::total_cmp) {
        Some(top) => top.min(moving - UNDER_M),
        None if low.is_finite() => low - 0.01,
        None => 0.0,
    };
    let top = if high.is_finite() { high + 2.0 } else { 3.0 };
    xml.create_element("light")
        .with_attributes([("pos", list(&[middle.x, middle.y, top]).as_str()), ("dir", "0 0 -1")])
        .write_empty()?;
    xml.create_element("geom")
        .with_attributes([
            ("name", "floor"),
            ("type", "plane"),
            ("pos", list(&[middle.x, middle.y, floor]).as_str()),
            ("size", "5 5 0.1"),
            ("rgba", "0.55 0.55 0.55 1"),
        ])
        .write_empty()?;
    Ok(())
}

fn part(xml: &mut Xml, twin: &Twin, f: &crate::twin::Furniture, look: &[Piece]) -> std::io::Result<()> {
    let part = &f.part;
    let phi = part.joint.articulation;
    let mut body = xml.create_element("body").with_attributes([
        ("name", body_name(&part.id).as_str()),
        ("pos", list(phi.origin.coords.as_slice()).as_str()),
    ]);
    if part.joint.balanced {
        // A spring carries its weight over the whole range.
        body = body.with_attribute(("gravcomp", "1"));
    }
    // Out of the face is the site's z, up its y.
    let out = part.bounds.orientation();
    body.write_inner_content(|xml| {
        inertial(xml, &part.solids, &phi.origin, twin.density_kg_per_m3)?;
        xml.create_element("joint")
            .with_attributes([
                ("name", part.id.as_str()),
                ("class", if phi.kind == JointKind::Revolute { "hinge" } else { "slide" }),
                ("axis", list(phi.axis.as_slice()).as_str()),
                ("range", list(&[0.0, part.joint.upper]).as_str()),
                ("damping", part.joint.damping.to_string().as_str()),
                ("frictionloss", part.joint.friction.to_string().as_str()),
            ])
            .write_empty()?;
        meshes(xml, look)?;
        geoms(xml, &part.solids, &phi.origin, look.is_empty())?;
        xml.create_element("site")
            .with_attributes([
                ("name", format!("{}_handle", part.id).as_str()),
                ("pos", list((part.handle - phi.origin).as_slice()).as_str()),
                ("quat", list(&[out.w, out.i, out.j, out.k]).as_str()),
                ("size", "0.01"),
                ("group", "4"),
            ])
            .write_empty()?;
        Ok(())
    })?;
    Ok(())
}

fn inertial(xml: &mut Xml, solids: &[Solid], origin: &Point, density: f64) -> std::io::Result<()> {
    let Some(m) = mass_properties(solids, density) else { return Ok(()) };
    let i = m.inertia;
    let full = [i[(0, 0)], i[(1, 1)], i[(2, 2)], i[(0, 1)], i[(0, 2)], i[(1, 2)]];
    xml.create_element("inertial")
        .with_attributes([
            ("pos", list((m.center - origin).as_slice()).as_str()),
            ("mass", m.mass.to_string().as_str()),
            ("fullinertia", list(&full).as_str()),
        ])
        .write_empty()?;
    Ok(())
}

/// Pictures, their materials and the meshes of a look. Colours were seen in the room's light: nothing gleams.
fn assets(xml: &mut Xml, dress: &Dress) -> std::io::Result<()> {
    for texture in dress.textures {
        let name = dress::material(texture);
        xml.create_element("texture")
            .with_attributes([("name", name.as_str()), ("type", "2d"), ("file", dress::picture_file(texture).as_str())])
            .write_empty()?;
        xml.create_element("material")
            .with_attributes([
                ("name", name.as_str()),
                ("texture", name.as_str()),
                ("specular", "0"),
                ("shininess", "0"),
            ])
            .write_empty()?;
    }
    for piece in dress.all() {
        xml.create_element("mesh")
            .with_attributes([("name", piece.name.as_str()), ("file", dress::mesh_file(piece).as_str())])
            .write_empty()?;
    }
    Ok(())
}

/// Textured meshes of a body: seen, not touched, without a weight.
fn meshes(xml: &mut Xml, pieces: &[Piece]) -> std::io::Result<()> {
    for piece in pieces {
        xml.create_element("geom")
            .with_attributes([
                ("name", piece.name.as_str()),
                ("class", "visual"),
                ("type", "mesh"),
                ("mesh", piece.name.as_str()),
                ("material", dress::material(piece.texture).as_str()),
                ("mass", "0"),
            ])
            .write_empty()?;
    }
    Ok(())
}

/// Boxes that collide, each with one to look at where they are `shown`.
fn geoms(xml: &mut Xml, solids: &[Solid], origin: &Point, shown: bool) -> std::io::Result<()> {
    for s in solids {
        let pose = local_pose(&s.shape, origin);
        let q = pose.rotation.quaternion();
        let position = list(pose.translation.vector.as_slice());
        let rotation = list(&[q.w, q.i, q.j, q.k]);
        let size = list(s.shape.half.as_slice());
        let visual = format!("{}_visual", s.name);
        for (name, class) in [(visual.as_str(), "visual"), (s.name.as_str(), "collision")] {
            if class == "visual" && !shown {
                continue;
            }
            let mut geom = xml.create_element("geom").with_attributes([
                ("name", name),
                ("class", class),
                ("pos", position.as_str()),
                ("quat", rotation.as_str()),
                ("size", size.as_str()),
            ]);
            if class == "visual" {
                geom = geom.with_attribute(("material", material(s.role)));
            }
            geom.write_empty()?;
        }
    }
    Ok(())
}

fn keyframes(xml: &mut Xml, twin: &Twin) -> std::io::Result<()> {
    let closed = vec![0.0; twin.furniture.len()];
    let open: Vec<f64> = twin.furniture.iter().map(|f| f.part.joint.upper).collect();
    if closed.is_empty() {
        return Ok(());
    }
    xml.create_element("keyframe").write_inner_content(|xml| {
        for (name, qpos) in [("closed", &closed), ("open", &open)] {
            xml.create_element("key").with_attributes([("name", name), ("qpos", list(qpos).as_str())]).write_empty()?;
        }
        Ok(())
    })?;
    Ok(())
}
