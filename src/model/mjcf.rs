//! MJCF, as far as furniture needs it.
//!
//! Read: `compiler` (angle, autolimits, eulerseq, meshdir, assetdir, inertiafromgeom), nested `default` classes of joints,
//! geoms, sites and meshes, `include`, `body` and `frame` with every orientation (quat, axisangle, euler, xyaxes, zaxis),
//! hinges and slides (axis, pos, range, limited, damping, frictionloss, armature, actuatorfrcrange), free joints, geoms
//! (box, sphere, ellipsoid, cylinder, capsule, fromto, OBJ and STL meshes), inertial, sites, `contact/exclude`. Planes are
//! passed over: nothing of a piece of furniture is endless. A body with several joints becomes a chain of links.
//!
//! Listed in the notes as not read: actuators, tendons, equalities, contact pairs, composites, flexes, attachments, height
//! fields, plugins, and files outside the model's folder.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use nalgebra::Matrix3;

use super::mjcf_context::{Context, Includes, Resolved, from_z};
use super::shapes::Primitive;
use super::xml::{self, Element};
use super::{Format, Kind, Link, MassSource, Model, ModelJoint, Shape, bounded, mesh, named};
use crate::error::Result;
use crate::math::{Point, Pose, Vector, unit};

/// The body that everything stands in.
pub const WORLD: &str = "world";
/// MuJoCo's default density: that of water, kg/m^3.
const WATER: f64 = 1000.0;

/// Reads a file with everything that it includes from its own folder.
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
    let mut out = Builder {
        model: Model {
            name: named(root.get("model"), path),
            source: path.to_owned(),
            format: Format::Mjcf { radian: false },
            links: Vec::new(),
            joints: Vec::new(),
            excludes: Vec::new(),
            notes: Vec::new(),
        },
        portions: Vec::new(),
        taken: BTreeSet::new(),
        made: BTreeMap::new(),
        unread: BTreeMap::new(),
        measured: BTreeMap::new(),
    };
    let mut included = Includes { dir: path.parent().unwrap_or(Path::new("")).to_owned(), read: BTreeSet::new() };
    included.read.extend(path.canonicalize().ok());
    included.expand(&mut root, 0, &mut out.model.notes)?;
    let context = Context::read(&root)?;
    out.model.format = Format::Mjcf { radian: context.radian };
    names(&root, &mut out.taken);
    out.link(WORLD.to_owned());
    for section in &root.children {
        match section.name.as_str() {
            "worldbody" => out.contents(&context, section, 0, &Pose::identity(), None)?,
            "contact" => {
                for child in &section.children {
                    match (child.name.as_str(), child.get("body1"), child.get("body2")) {
                        ("exclude", Some(a), Some(b)) => out.model.excludes.push([a.to_owned(), b.to_owned()]),
                        ("exclude", ..) => return Err(child.error("needs body1 and body2")),
                        (other, ..) => out.pass_over(other),
                    }
                }
            }
            "option" => {
                let along_z = |g: &[f64; 3]| g[0] == 0.0 && g[1] == 0.0 && g[2] <= 0.0;
                if section.numbers::<3>("gravity")?.is_some_and(|g| !along_z(&g)) {
                    out.model.notes.push("gravity does not point along -z; it is taken to".to_owned());
                }
            }
            // Read before, or without a say in shapes and joints.
            "compiler" | "default" | "size" | "visual" | "statistic" | "keyframe" | "sensor" | "custom" => {}
            "asset" => section.all("hfield").for_each(|_| out.pass_over("hfield")),
            other => out.pass_over(other),
        }
    }
    out.finish(&context);
    bounded(&out.model)?;
    Ok(out.model)
}

/// All names that elements have.
fn names(element: &Element, taken: &mut BTreeSet<String>) {
    taken.extend(element.get("name").map(str::to_owned));
    element.children.iter().for_each(|c| names(c, taken));
}

/// What one shape adds to its link's mass.
struct Portion {
    /// kg; `None` for a mesh, whose volume is not known.
    mass: Option<f64>,
    center: Point,
    /// Link axes, kg m^2.
    inertia: Matrix3<f64>,
    /// Neither mass nor density is written.
    assumed: bool,
}

struct Builder {
    model: Model,
    /// For each link what its shapes weigh.
    portions: Vec<Vec<Portion>>,
    /// Names that must not be made up.
    taken: BTreeSet<String>,
    /// How many names were made up for each wish.
    made: BTreeMap<String, usize>,
    /// Elements that are not read, and how many.
    unread: BTreeMap<String, usize>,
    /// Bounds of meshes by name, or why there are none.
    measured: BTreeMap<String, std::result::Result<[Point; 2], String>>,
}

impl Builder {
    fn pass_over(&mut self, name: &str) {
        *self.unread.entry(xml::brief(name)).or_default() += 1;
    }

    /// A name that nothing has yet.
    fn free_name(&mut self, wanted: &str) -> String {
        let number = self.made.entry(wanted.to_owned()).or_default();
        let mut name = wanted.to_owned();
        while !self.taken.insert(name.clone()) {
            *number += 1;
            name = format!("{wanted}_{}", *number + 1);
        }
        name
    }

    fn name_of(&mut self, element: &Element, fallback: &str) -> Result<String> {
        if element.get("name").is_some() { element.own_name() } else { Ok(self.free_name(fallback)) }
    }

    fn link(&mut self, name: String) -> usize {
        self.model.links.push(Link::named(name));
        self.portions.push(Vec::new());
        self.model.links.len() - 1
    }

    /// Everything in a body, or in a frame of it at `place`.
    fn contents(
        &mut self,
        c: &Context,
        element: &Element,
        link: usize,
        place: &Pose,
        class: Option<&str>,
    ) -> Result<()> {
        for child in &element.children {
            match child.name.as_str() {
                "body" => self.body(c, child, link, place, class)?,
                "frame" => {
                    let inside = place * c.pose(&Resolved { element: child, class: None })?;
                    self.contents(c, child, link, &inside, child.get("childclass").or(class))?;
                }
                "geom" => self.geom(c, &c.resolved(child, class)?, link, place)?,
                "site" => {
                    let at = place * c.pose(&c.resolved(child, class)?)?;
                    let name = child.get("name").unwrap_or_default().to_owned();
                    self.model.links[link].sites.push((name, at * Point::origin()));
                }
                // Read with the body.
                "joint" | "freejoint" | "inertial" | "camera" | "light" => {}
                other => self.pass_over(other),
            }
        }
        Ok(())
    }

    fn body(&mut self, c: &Context, element: &Element, parent: usize, place: &Pose, class: Option<&str>) -> Result<()> {
        let name = self.name_of(element, "body")?;
        let class = element.get("childclass").or(class);
        let pose = place * c.pose(&Resolved { element, class: None })?;
        if element.get("mocap") == Some("true") {
            self.model.notes.push(format!("{name}: is moved from outside (mocap); it is taken to stand still"));
        }
        let mut joints = Vec::new();
        self.joints(c, element, &Pose::identity(), class, &mut joints)?;
        if joints.is_empty() {
            joints.push(blank(self.free_name(&format!("{name}_fixed")), Kind::Fixed));
        }
        let last = joints.len() - 1;
        let mut above = self.model.links[parent].name.clone();
        for (i, mut joint) in joints.into_iter().enumerate() {
            let below = if i == last { name.clone() } else { self.free_name(&format!("{name}_between_{}", i + 1)) };
            joint.parent_from_child = if i == 0 { pose } else { Pose::identity() };
            joint.parent = std::mem::replace(&mut above, below.clone());
            joint.child = below.clone();
            self.model.joints.push(joint);
            let link = self.link(below);
            self.model.links[link].between = i < last;
        }
        let link = self.model.links.len() - 1;
        self.contents(c, element, link, &Pose::identity(), class)?;
        let Some(inertial) = element.child("inertial").filter(|_| c.from_shapes != Some(true)) else { return Ok(()) };
        let r = Resolved { element: inertial, class: None };
        let at = c.pose(&r)?;
        let turn = at.rotation.to_rotation_matrix();
        let own = match (r.numbers("fullinertia", 6..=6)?, r.numbers("diaginertia", 3..=3)?) {
            (Some(f), _) => Matrix3::new(f[0], f[3], f[4], f[3], f[1], f[5], f[4], f[5], f[2]),
            (None, Some(d)) => Matrix3::from_diagonal(&Vector::from_row_slice(&d)),
            (None, None) => Matrix3::zeros(),
        };
        let link = &mut self.model.links[link];
        link.mass = r.number("mass")?;
        link.mass_source = MassSource::Stated;
        link.center = at * Point::origin();
        link.inertia = turn.matrix() * own * turn.matrix().transpose();
        Ok(())
    }

    /// The joints of a body, through its frames.
    fn joints(
        &mut self,
        c: &Context,
        element: &Element,
        place: &Pose,
        class: Option<&str>,
        out: &mut Vec<ModelJoint>,
    ) -> Result<()> {
        for child in &element.children {
            match child.name.as_str() {
                "frame" => {
                    let inside = place * c.pose(&Resolved { element: child, class: None })?;
                    self.joints(c, child, &inside, child.get("childclass").or(class), out)?;
                }
                "freejoint" => out.push(blank(self.name_of(child, "free")?, Kind::Free)),
                "joint" => {
                    let name = self.name_of(child, "joint")?;
                    out.push(joint(c, &c.resolved(child, class)?, name, place)?);
                }
                _ => {}
            }
        }
        Ok(())
    }

    fn geom(&mut self, c: &Context, r: &Resolved, link: usize, place: &Pose) -> Result<()> {
        let kind = r.get("type").unwrap_or("sphere");
        let name = r.element.get("name").map(|_| r.element.own_name()).transpose()?;
        if kind == "plane" {
            return Ok(());
        }
        let mut pose = c.pose(r)?;
        let primitive = if let Some(mesh) = r.get("mesh") {
            let owner = self.model.links[link].name.clone();
            let Some((file, scale)) = c.meshes.get(mesh) else {
                return Err(r.element.error(format!("there is no mesh \"{}\" in <asset>", xml::brief(mesh))));
            };
            let (source, folders) = (&self.model.source, &c.folders);
            let bounds = self.measured.entry(mesh.to_owned()).or_insert_with(|| {
                let found = mesh::find(source, folders, file);
                mesh::bounds(&found.ok_or_else(|| "there is no such file beside the model".to_owned())?)
            });
            let at = &mut self.model.links[link];
            at.meshes.push(mesh.to_owned());
            at.collides_as_mesh |= kind == "mesh" && masks(r)? != [0, 0];
            match bounds {
                Ok([low, high]) => {
                    let ends = [low.coords.component_mul(scale), high.coords.component_mul(scale)];
                    Primitive::Mesh([ends[0].inf(&ends[1]).into(), ends[0].sup(&ends[1]).into()])
                }
                Err(why) => {
                    at.incomplete = true;
                    self.model.notes.push(format!("{owner}: mesh {} is not read: {why}", xml::brief(mesh)));
                    self.portions[link].push(Portion {
                        mass: None,
                        center: Point::origin(),
                        inertia: Matrix3::zeros(),
                        assumed: r.get("mass").or(r.get("density")).is_none(),
                    });
                    return Ok(());
                }
            }
        } else {
            match sized(r, kind, &mut pose)? {
                Some(primitive) => primitive,
                None => {
                    self.pass_over(&format!("geom of type {kind}"));
                    return Ok(());
                }
            }
        };
        let pose = place * pose;
        let bounds = primitive.bounds(&pose);
        let masks = masks(r)?;
        let (mass, density) = (r.number("mass")?, r.number("density")?);
        let mass_of = |volume: f64| density.unwrap_or(WATER) * volume;
        let weighs = mass.or_else(|| primitive.volume().map(mass_of)).or((density == Some(0.0)).then_some(0.0));
        let turn = pose.rotation.to_rotation_matrix();
        let moments = weighs.and_then(|m| primitive.moments(m));
        let own = moments.map_or(Matrix3::zeros(), |m| Matrix3::from_diagonal(&m));
        if weighs != Some(0.0) {
            self.portions[link].push(Portion {
                mass: weighs.filter(|_| moments.is_some()),
                center: bounds.center,
                inertia: turn.matrix() * own * turn.matrix().transpose(),
                assumed: mass.or(density).is_none(),
            });
        }
        let visual = masks == [0, 0];
        self.model.links[link].shapes.push(Shape { name, bounds, exact: primitive.is_box(), visual, masks });
        Ok(())
    }

    /// Masses that no `<inertial>` states, and the notes.
    fn finish(&mut self, c: &Context) {
        for (link, portions) in self.model.links.iter_mut().zip(&self.portions) {
            if link.mass_source == MassSource::Stated
                || link.name == WORLD
                || portions.is_empty()
                || c.from_shapes == Some(false)
            {
                continue;
            }
            let assumed = portions.iter().any(|p| p.assumed);
            link.mass_source = if assumed { MassSource::Assumed } else { MassSource::Shapes };
            let Some(masses) = portions.iter().map(|p| p.mass).collect::<Option<Vec<f64>>>() else { continue };
            let total: f64 = masses.iter().sum();
            if total <= 0.0 {
                continue;
            }
            let moment = portions.iter().zip(&masses).fold(Vector::zeros(), |s, (p, m)| s + p.center.coords * *m);
            let center = Point::from(moment / total);
            let mut inertia = Matrix3::zeros();
            for (p, m) in portions.iter().zip(&masses) {
                let d = p.center - center;
                inertia += p.inertia + (Matrix3::identity() * d.norm_squared() - d * d.transpose()) * *m;
            }
            (link.mass, link.center, link.inertia) = (Some(total), center, inertia);
        }
        for (name, count) in &self.unread {
            self.model.notes.push(format!("not read: {count} x <{name}>"));
        }
    }
}

fn blank(name: String, kind: Kind) -> ModelJoint {
    ModelJoint {
        name,
        kind,
        parent: String::new(),
        child: String::new(),
        parent_from_child: Pose::identity(),
        axis: Vector::z(),
        anchor: Point::origin(),
        lower: None,
        upper: None,
        effort: None,
        velocity: None,
        damping: None,
        friction: None,
        armature: None,
        limited: None,
    }
}

fn joint(c: &Context, r: &Resolved, name: String, place: &Pose) -> Result<ModelJoint> {
    let kind = match r.get("type").unwrap_or("hinge") {
        "hinge" => Kind::Revolute,
        "slide" => Kind::Prismatic,
        "free" => Kind::Free,
        "ball" => Kind::Other,
        other => return Err(r.element.error(format!("\"{}\" is no joint type of MJCF", xml::brief(other)))),
    };
    let limited = match r.get("limited") {
        Some("true") => Some(true),
        Some("false") => Some(false),
        Some("auto") | None => None,
        Some(other) => {
            return Err(r.element.error(format!("limited=\"{}\": expected true, false or auto", xml::brief(other))));
        }
    };
    let vector = |attribute: &str, default: Vector| -> Result<Vector> {
        Ok(r.numbers(attribute, 3..=3)?.map_or(default, |v| Vector::from_row_slice(&v)))
    };
    let range = r.numbers("range", 2..=2)?.filter(|_| limited.unwrap_or(c.autolimits));
    let limit = |i: usize| {
        let value = range.as_ref().and_then(|v| v.get(i)).copied();
        if kind == Kind::Revolute { value.map(|v| c.angle(v)) } else { value }
    };
    // Later versions of the format take polynomials; the first number is the linear term.
    let linear =
        |attribute: &str| -> Result<Option<f64>> { Ok(r.numbers(attribute, 1..=8)?.and_then(|v| v.first().copied())) };
    Ok(ModelJoint {
        axis: place.rotation * vector("axis", Vector::z())?,
        anchor: place * Point::from(vector("pos", Vector::zeros())?),
        lower: limit(0),
        upper: limit(1),
        effort: r.numbers("actuatorfrcrange", 2..=2)?.and_then(|v| v.get(1).copied()),
        damping: linear("damping")?,
        friction: r.number("frictionloss")?,
        armature: r.number("armature")?,
        limited,
        ..blank(name, kind)
    })
}

/// `contype` and `conaffinity`; both are 1 unless the file says otherwise.
fn masks(r: &Resolved) -> Result<[u32; 2]> {
    let mask = |attribute: &str| -> Result<u32> {
        // Masks are whole numbers of 32 bits; what is outside meets everything.
        Ok(r.number(attribute)?
            .map_or(1, |v| if (0.0..=f64::from(u32::MAX)).contains(&v) { v as u32 } else { u32::MAX }))
    };
    Ok([mask("contype")?, mask("conaffinity")?])
}

/// A geom's solid from `type`, `size` and `fromto`; `None` for types that are not read. `fromto` replaces the pose.
fn sized(r: &Resolved, kind: &str, pose: &mut Pose) -> Result<Option<Primitive>> {
    if !["box", "sphere", "ellipsoid", "cylinder", "capsule"].contains(&kind) {
        return Ok(None);
    }
    let mut size = r.numbers("size", 1..=3)?.unwrap_or_default();
    if let Some(ends) = r.numbers("fromto", 6..=6)?.filter(|_| kind != "sphere") {
        let (a, b) = (Vector::from_row_slice(&ends[..3]), Vector::from_row_slice(&ends[3..]));
        let along = unit(&(b - a)).ok_or_else(|| r.element.error("fromto: both ends are the same point"))?;
        *pose = Pose::from_parts(((a + b) * 0.5).into(), from_z(&along));
        let half = 0.5 * (b - a).norm();
        let radius = size.first().copied().unwrap_or(0.0);
        size = if ["cylinder", "capsule"].contains(&kind) { vec![radius, half] } else { vec![radius, radius, half] };
    }
    let wanted = match kind {
        "sphere" => 1,
        "cylinder" | "capsule" => 2,
        _ => 3,
    };
    if size.len() < wanted || size.iter().take(wanted).any(|s| *s <= 0.0) {
        return Err(r.element.error(format!("a {kind} needs {wanted} positive numbers as size")));
    }
    let whole = |size: &[f64]| Vector::new(size[0], size[1], size[2]);
    Ok(Some(match kind {
        "box" => Primitive::Cuboid(whole(&size)),
        "ellipsoid" => Primitive::Ellipsoid(whole(&size)),
        "sphere" => Primitive::Sphere(size[0]),
        "cylinder" => Primitive::Cylinder(size[0], size[1]),
        _ => Primitive::Capsule(size[0], size[1]),
    }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::rotation;

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
        assert_eq!((j.kind, j.damping, j.friction, j.axis), (Kind::Revolute, Some(5.0), Some(1.0), Vector::z() * 2.0));
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
        assert_eq!(m.notes, ["not read: 1 x <equality>"]);
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
            (r#"<geom type="mesh" mesh="m"/>"#, "no mesh \"m\""),
            (r#"<body name="a"><joint range="0 inf"/></body>"#, "<joint>: range: inf is not finite"),
            (r#"<body name="a"><joint type="screw"/></body>"#, "\"screw\" is no joint type"),
            (r#"<include file="nowhere.xml"/>"#, "nowhere.xml, which is not there"),
        ] {
            let error = model(&format!("<mujoco><worldbody>{body}</worldbody></mujoco>")).unwrap_err();
            assert!(error.contains("m.xml") && error.contains(word), "{error}");
        }
    }
}
