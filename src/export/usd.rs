//! USD as text (`.usda`) with UsdPhysics, and as a package with its pictures (`.usdz`): for Isaac and whatever else reads
//! OpenUSD.

use std::fmt::Write as _;
use std::io::{Cursor, Write as _};

use nalgebra::UnitQuaternion;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, DateTime, ZipWriter};

use super::dress::{self, Dress, Piece};
use super::shared::{MATERIALS, ROLES, ROOM, ROOT, color, from_x, local_pose, material, principal};
use crate::articulation::JointKind;
use crate::config::Drives;
use crate::error::{Error, Result};
use crate::look::{Look, Texture};
use crate::math::{Point, Vector};
use crate::twin::{Furniture, GRAVITY, Solid, Twin, mass_properties};

/// Format: steps of normals' coordinates; half a degree is not seen, and its numbers are short.
const STEPS_OF_NORMALS: f64 = 100.0;

/// What a reader of the file must know that its attributes do not say.
const DOC: &str = "Metres, kilograms, +Z up. Limits and damping of hinges are per degree, as UsdPhysics has them; \
                   customData is in metres, radians, newtons. UsdPhysics has no dry friction of joints: customData \
                   says how much there is. A drive without stiffness is a joint's damper.";

/// Lines of text, indented.
struct Usda {
    text: String,
    depth: usize,
}

impl Usda {
    fn line(&mut self, line: &str) {
        self.text.extend(std::iter::repeat_n("    ", self.depth));
        self.text.push_str(line);
        self.text.push('\n');
    }

    /// Opens a prim: `head` is its type and name, `metadata` the lines between its parentheses.
    fn open(&mut self, head: &str, metadata: &[String]) {
        if metadata.is_empty() {
            self.line(&format!("def {head}"));
        } else {
            self.line(&format!("def {head} ("));
            self.depth += 1;
            for line in metadata {
                self.line(line);
            }
            self.depth -= 1;
            self.line(")");
        }
        self.line("{");
        self.depth += 1;
    }

    fn close(&mut self) {
        self.depth -= 1;
        self.line("}");
    }
}

/// The twin as USD: a prim a piece of furniture with the bodies of its base and its part, and the joints between them.
///
/// The base is a body that a fixed joint holds to the world; both are below the prim with the articulation root, as
/// UsdPhysics asks of articulations that do not float. The room collides without being a body. Gravity is outside the
/// default prim: a stage that references the twin has its own.
///
/// Of a look it holds the meshes; its pictures are the files of [`dress::files`], which have to lie beside it. Boxes that
/// meshes hide are guides: they collide, and are shown when asked for.
///
/// # Errors
/// Where the twin cannot be a simulator's model (see [`super::check`]), or what is wrong with the look.
pub fn write(twin: &Twin, look: Option<&Look>) -> Result<String> {
    Ok(text(twin, &Dress::of(twin, look)?, &dress::picture_file))
}

/// The same with its pictures in one file, as `usdz` wants it: nothing compressed, every file at a multiple of 64 bytes.
///
/// # Errors
/// As [`write`].
pub fn write_package(twin: &Twin, look: Option<&Look>) -> Result<Vec<u8>> {
    let dress = Dress::of(twin, look)?;
    let name = |texture: &Texture| format!("{}/{}.jpg", dress::FOLDER, texture.name);
    let mut files = vec![("scene.usda".to_owned(), text(twin, &dress, &name).into_bytes())];
    files.extend(dress.textures.iter().map(name).zip(dress::jpegs(dress.textures)?));
    package(&files).map_err(|e| Error::Export(format!("USD: {e}")))
}

fn package(files: &[(String, Vec<u8>)]) -> zip::result::ZipResult<Vec<u8>> {
    let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
    let options = SimpleFileOptions::default()
        .compression_method(CompressionMethod::Stored)
        // The same bytes at any time.
        .last_modified_time(DateTime::default())
        .with_alignment(64);
    for (name, bytes) in files {
        zip.start_file(name.as_str(), options)?;
        zip.write_all(bytes)?;
    }
    Ok(zip.finish()?.into_inner())
}

/// The text; `picture` tells where a texture's file is.
fn text(twin: &Twin, dress: &Dress, picture: &dyn Fn(&Texture) -> String) -> String {
    let mut out = Usda { text: "#usda 1.0\n".to_owned(), depth: 0 };
    out.line("(");
    out.depth += 1;
    out.line("customLayerData = {");
    out.line(&format!("    string creator = {}", quoted(concat!("paws ", env!("CARGO_PKG_VERSION")))));
    out.line("}");
    out.line(&format!("defaultPrim = {}", quoted(ROOT)));
    out.line(&format!("doc = {}", quoted(DOC)));
    for (key, value) in [("kilogramsPerUnit", "1"), ("metersPerUnit", "1"), ("upAxis", "\"Z\"")] {
        out.line(&format!("{key} = {value}"));
    }
    out.depth -= 1;
    out.line(")");
    out.line("");
    let scene = custom(&[format!("string scene = {}", quoted(&twin.name))]);
    out.open(&format!("Xform \"{ROOT}\""), &[scene, vec!["kind = \"component\"".to_owned()]].concat());
    materials(&mut out, dress.textures, picture);
    for f in &twin.furniture {
        furniture(&mut out, f, twin, dress);
    }
    let shown = dress.room.is_empty();
    if !(twin.room.is_empty() && shown) {
        out.open(&format!("Xform \"{ROOM}\""), &[]);
        meshes(&mut out, &dress.room);
        boxes(&mut out, &twin.room, &Point::origin(), shown);
        out.close();
    }
    out.close();
    out.line("");
    out.open("PhysicsScene \"physics_scene\"", &[]);
    out.line("vector3f physics:gravityDirection = (0, 0, -1)");
    out.line(&format!("float physics:gravityMagnitude = {}", single(GRAVITY)));
    out.close();
    out.text
}

/// The nearest number of single precision, in as few digits as read back as it; no minus zero.
fn single(value: f64) -> String {
    (value as f32 + 0.0).to_string()
}

fn singles(values: &[f64]) -> String {
    format!("({})", values.iter().map(|v| single(*v)).collect::<Vec<_>>().join(", "))
}

fn doubles(values: &[f64]) -> String {
    format!("({})", values.iter().map(|v| (v + 0.0).to_string()).collect::<Vec<_>>().join(", "))
}

/// Real part first.
fn quaternion(q: &UnitQuaternion<f64>) -> [f64; 4] {
    [q.w, q.i, q.j, q.k]
}

/// A string literal; it has to stay in one line.
fn quoted(text: &str) -> String {
    let mut out = String::from("\"");
    for c in text.chars() {
        match c {
            '"' | '\\' => out.extend(['\\', c]),
            _ if c.is_control() => out.push(' '),
            _ => out.push(c),
        }
    }
    out.push('"');
    out
}

/// `customData` with some entries, as lines of metadata.
fn custom(entries: &[String]) -> Vec<String> {
    let inside = entries.iter().map(|e| format!("    {e}"));
    std::iter::once("customData = {".to_owned()).chain(inside).chain(std::iter::once("}".to_owned())).collect()
}

fn apis(names: &[&str]) -> String {
    let names: Vec<String> = names.iter().map(|n| quoted(n)).collect();
    format!("prepend apiSchemas = [{}]", names.join(", "))
}

fn materials(out: &mut Usda, textures: &[Texture], picture: &dyn Fn(&Texture) -> String) {
    out.open(&format!("Scope \"{MATERIALS}\""), &[]);
    for role in ROLES {
        let name = material(role);
        out.open(&format!("Material \"{name}\""), &[]);
        out.line(&format!("token outputs:surface.connect = </{ROOT}/{MATERIALS}/{name}/shader.outputs:surface>"));
        out.open("Shader \"shader\"", &[]);
        out.line("uniform token info:id = \"UsdPreviewSurface\"");
        out.line(&format!("color3f inputs:diffuseColor = {}", singles(&color(role)[..3])));
        out.line("float inputs:metallic = 0");
        out.line("float inputs:roughness = 0.7");
        out.line("token outputs:surface");
        out.close();
        out.close();
    }
    for texture in textures {
        textured(out, &dress::material(texture), &picture(texture));
    }
    out.close();
}

/// A material whose colour is a picture's, by the texture coordinates `st`.
fn textured(out: &mut Usda, name: &str, file: &str) {
    let path = format!("/{ROOT}/{MATERIALS}/{name}");
    out.open(&format!("Material \"{name}\""), &[]);
    out.line(&format!("token outputs:surface.connect = <{path}/shader.outputs:surface>"));
    out.open("Shader \"shader\"", &[]);
    out.line("uniform token info:id = \"UsdPreviewSurface\"");
    out.line(&format!("color3f inputs:diffuseColor.connect = <{path}/picture.outputs:rgb>"));
    out.line("float inputs:metallic = 0");
    out.line("float inputs:roughness = 1");
    out.line("token outputs:surface");
    out.close();
    out.open("Shader \"picture\"", &[]);
    out.line("uniform token info:id = \"UsdUVTexture\"");
    out.line(&format!("asset inputs:file = @./{file}@"));
    out.line("token inputs:sourceColorSpace = \"sRGB\"");
    out.line(&format!("float2 inputs:st.connect = <{path}/st.outputs:result>"));
    out.line("token inputs:wrapS = \"clamp\"");
    out.line("token inputs:wrapT = \"clamp\"");
    out.line("float3 outputs:rgb");
    out.close();
    out.open("Shader \"st\"", &[]);
    out.line("uniform token info:id = \"UsdPrimvarReader_float2\"");
    out.line("string inputs:varname = \"st\"");
    out.line("float2 outputs:result");
    out.close();
    out.close();
}

fn furniture(out: &mut Usda, f: &Furniture, twin: &Twin, dress: &Dress) {
    let density = twin.density_kg_per_m3;
    let part = &f.part;
    let phi = part.joint.articulation;
    let group = format!("{}_furniture", part.id);
    let path = format!("/{ROOT}/{group}");
    let link = format!("{}_link", part.id);
    out.open(&format!("Xform \"{group}\""), &[apis(&["PhysicsArticulationRootAPI"])]);

    open_body(out, &f.name, &f.carcass, &Point::origin(), density, false);
    boxes(out, &f.carcass, &Point::origin(), dress.room.is_empty());
    out.close();
    open_body(out, &link, &part.solids, &phi.origin, density, part.joint.balanced);
    let look = dress.part(&part.id);
    meshes(out, look);
    boxes(out, &part.solids, &phi.origin, look.is_empty());
    out.open(&format!("Xform \"{}_handle\"", part.id), &[]);
    place(out, &(part.handle - phi.origin), &part.bounds.orientation(), None);
    out.close();
    out.close();

    out.open(&format!("PhysicsFixedJoint \"{}_fixed\"", f.name), &[]);
    out.line(&format!("rel physics:body1 = <{path}/{}>", f.name));
    frames(out, &Vector::zeros(), &UnitQuaternion::identity());
    out.close();

    joint(out, f, &path, &link, &twin.drives);
    out.close();
}

/// The joint of a part; `path` is its furniture's, `link` its body.
fn joint(out: &mut Usda, f: &Furniture, path: &str, link: &str, drives: &Drives) {
    let part = &f.part;
    let phi = part.joint.articulation;
    let (kind, drive) = match phi.kind {
        JointKind::Revolute => ("PhysicsRevoluteJoint", "angular"),
        JointKind::Prismatic => ("PhysicsPrismaticJoint", "linear"),
    };
    // UsdPhysics counts angles in degrees, also where something is per angle.
    let (upper, damping) = match phi.kind {
        JointKind::Revolute => (part.joint.upper.to_degrees(), part.joint.damping.to_radians()),
        JointKind::Prismatic => (part.joint.upper, part.joint.damping),
    };
    let data = custom(&[
        format!("bool balanced = {}", u8::from(part.joint.balanced)),
        format!("double dryFriction = {}", part.joint.friction),
        format!("double expected = {}", part.joint.expected),
        format!("string id = {}", quoted(&part.id)),
        format!("string label = {}", quoted(&part.label)),
        format!("double observed = {}", part.joint.observed),
        format!("bool resistanceSeen = {}", u8::from(part.joint.resistance_seen)),
        format!("double velocityLimit = {}", part.joint.velocity(drives)),
    ]);
    let schemas = vec![apis(&[&format!("PhysicsDriveAPI:{drive}")])];
    out.open(&format!("{kind} \"{}\"", part.id), &[schemas, data].concat());
    out.line("uniform token physics:axis = \"X\"");
    out.line(&format!("rel physics:body0 = <{path}/{}>", f.name));
    out.line(&format!("rel physics:body1 = <{path}/{link}>"));
    out.line("bool physics:collisionEnabled = 0");
    // Axes are X, Y or Z of the joint's frames: the frames are turned, the axis' sign with them.
    frames(out, &phi.origin.coords, &from_x(&phi.axis));
    out.line("float physics:lowerLimit = 0");
    out.line(&format!("float physics:upperLimit = {}", single(upper)));
    for (key, value) in
        [("damping", damping), ("maxForce", part.joint.effort(drives)), ("stiffness", 0.0), ("targetVelocity", 0.0)]
    {
        out.line(&format!("float drive:{drive}:physics:{key} = {}", single(value)));
    }
    out.line(&format!("uniform token drive:{drive}:physics:type = \"force\""));
    out.close();
}

/// A joint's frame in the base, which stands at the world's origin, and in the part, which stands at `origin`.
fn frames(out: &mut Usda, origin: &Vector, turn: &UnitQuaternion<f64>) {
    out.line(&format!("point3f physics:localPos0 = {}", singles(origin.as_slice())));
    out.line("point3f physics:localPos1 = (0, 0, 0)");
    for body in 0..2 {
        out.line(&format!("quatf physics:localRot{body} = {}", singles(&quaternion(turn))));
    }
}

/// Opens a body of boxes; the caller puts them into it and closes it.
fn open_body(out: &mut Usda, name: &str, solids: &[Solid], origin: &Point, density: f64, balanced: bool) {
    let mut schemas = vec!["PhysicsRigidBodyAPI", "PhysicsMassAPI"];
    if balanced {
        // UsdPhysics cannot take gravity from a body; Isaac's engine can, others pass over it.
        schemas.push("PhysxRigidBodyAPI");
    }
    out.open(&format!("Xform \"{name}\""), &[apis(&schemas)]);
    if let Some(m) = mass_properties(solids, density) {
        let (moments, axes) = principal(&m.inertia);
        out.line(&format!("point3f physics:centerOfMass = {}", singles((m.center - origin).as_slice())));
        out.line(&format!("float3 physics:diagonalInertia = {}", singles(moments.as_slice())));
        out.line(&format!("float physics:mass = {}", single(m.mass)));
        out.line(&format!("quatf physics:principalAxes = {}", singles(&quaternion(&axes))));
    }
    if balanced {
        out.line("bool physxRigidBody:disableGravity = 1");
    }
    out.line(&format!("double3 xformOp:translate = {}", doubles(origin.coords.as_slice())));
    out.line("uniform token[] xformOpOrder = [\"xformOp:translate\"]");
}

/// Numbers in parentheses, separated by commas.
fn tuples<const N: usize>(rows: impl Iterator<Item = [String; N]>) -> String {
    let mut text = String::from("[");
    for (i, row) in rows.enumerate() {
        // Writing to a string cannot fail.
        let _ = write!(text, "{}({})", if i > 0 { "," } else { "" }, row.join(","));
    }
    text.push(']');
    text
}

/// Textured meshes; they are shown, and touch nothing.
fn meshes(out: &mut Usda, pieces: &[Piece]) {
    for piece in pieces {
        out.open(
            &format!("Mesh \"{}\"", piece.name),
            &[vec![apis(&["MaterialBindingAPI"])], custom(&[format!("double seenShare = {}", piece.seen)])].concat(),
        );
        let extent = |pick: fn(f32, f32) -> f32, start: f32| {
            piece.positions.iter().fold([start; 3], |b, p| std::array::from_fn(|c| pick(b[c], p[c])))
        };
        let ends = [extent(f32::min, f32::INFINITY), extent(f32::max, f32::NEG_INFINITY)];
        let three = |p: &[f32; 3]| p.map(|c| c.to_string());
        out.line(&format!("float3[] extent = {}", tuples(ends.iter().map(three))));
        out.line(&format!("int[] faceVertexCounts = [{}]", vec!["3"; piece.triangles.len()].join(",")));
        let numbers: Vec<String> = piece.triangles.iter().flatten().map(u32::to_string).collect();
        out.line(&format!("int[] faceVertexIndices = [{}]", numbers.join(",")));
        let material = dress::material(piece.texture);
        out.line(&format!("rel material:binding = </{ROOT}/{MATERIALS}/{material}>"));
        let each = "(interpolation = \"vertex\")";
        let short = |c: f32| ((f64::from(c) * STEPS_OF_NORMALS).round() / STEPS_OF_NORMALS + 0.0).to_string();
        out.line(&format!("normal3f[] normals = {} {each}", tuples(piece.normals.iter().map(|n| n.map(short)))));
        out.line(&format!("point3f[] points = {}", tuples(piece.positions.iter().map(three))));
        let st = piece.uv.iter().map(|[u, v]| [dress::share_text(*u, false), dress::share_text(*v, true)]);
        out.line(&format!("texCoord2f[] primvars:st = {} {each}", tuples(st)));
        out.line("uniform token subdivisionScheme = \"none\"");
        out.close();
    }
}

/// Cubes of side 2, scaled: some readers take one of side 1 for one of side 2. Those that are not `shown` are guides.
fn boxes(out: &mut Usda, solids: &[Solid], origin: &Point, shown: bool) {
    for s in solids {
        out.open(
            &format!("Cube \"{}\"", s.name),
            &[
                vec![apis(&["PhysicsCollisionAPI", "MaterialBindingAPI"])],
                custom(&[format!("bool seen = {}", u8::from(s.seen))]),
            ]
            .concat(),
        );
        out.line("float3[] extent = [(-1, -1, -1), (1, 1, 1)]");
        out.line(&format!("rel material:binding = </{ROOT}/{MATERIALS}/{}>", material(s.role)));
        out.line(&format!("color3f[] primvars:displayColor = [{}]", singles(&color(s.role)[..3])));
        if !shown {
            out.line("uniform token purpose = \"guide\"");
        }
        out.line("double size = 2");
        let pose = local_pose(&s.shape, origin);
        place(out, &pose.translation.vector, &pose.rotation, Some(&s.shape.half));
        out.close();
    }
}

/// Where a prim is in its parent.
fn place(out: &mut Usda, position: &Vector, turn: &UnitQuaternion<f64>, scale: Option<&Vector>) {
    out.line(&format!("quatd xformOp:orient = {}", doubles(&quaternion(turn))));
    if let Some(scale) = scale {
        out.line(&format!("double3 xformOp:scale = {}", doubles(scale.as_slice())));
    }
    out.line(&format!("double3 xformOp:translate = {}", doubles(position.as_slice())));
    let order = if scale.is_some() {
        "[\"xformOp:translate\", \"xformOp:orient\", \"xformOp:scale\"]"
    } else {
        "[\"xformOp:translate\", \"xformOp:orient\"]"
    };
    out.line(&format!("uniform token[] xformOpOrder = {order}"));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_stays_in_its_line_and_numbers_read_back() {
        assert_eq!(quoted("a \"b\"\\\n"), "\"a \\\"b\\\"\\\\ \"");
        assert_eq!(single(-0.0), "0");
        for v in [0.1, 1.0 / 3.0, -2.5e-9, 110.000_01] {
            assert_eq!(single(v).parse::<f32>().unwrap().to_bits(), (v as f32).to_bits());
            assert_eq!(doubles(&[v]).trim_matches(['(', ')']).parse::<f64>().unwrap().to_bits(), v.to_bits());
        }
    }
}
