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

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use nalgebra::Matrix3;

use super::mjcf_context::{Context, Resolved};
use super::mjcf_tree::{Copies, Includes};
use super::xml::{self, Element};
use super::{
    Format, Kind, Link, MassSource, Model, ModelJoint, bounded, mjcf_assets, mjcf_equality, mjcf_refusals, mjcf_schema,
    named,
};
use crate::error::{Error, Result};
use crate::math::{Point, Pose, Vector};

/// The body that everything stands in.
pub const WORLD: &str = "world";

/// Elements of a body that make joints or shapes of their own.
const HIDING: [&str; 3] = ["attach", "composite", "flexcomp"];

/// Pairs that are excluded from contacts: copies by `<replicate>` multiply them, and no model of furniture has as many.
const MAX_EXCLUDES: usize = 1_000_000;

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
    let mut out = Builder::new(path, &root);
    out.model.unread = missing.to_vec();
    for section in &root.children {
        out.section(&context, section, &copies)?;
    }
    out.finish(&context);
    bounded(&out.model)?;
    let mut model = out.model;
    model.format = Format::Mjcf { radian: context.radian || !(out.angles || turned(&root)) };
    let (faults, notes) = mjcf_refusals::refusals(&context, &root, &copies, &model);
    refused.extend(faults);
    model.notes.extend(notes);
    refused.truncate(mjcf_schema::MAX_FAULTS);
    model.faults.extend(refused.into_iter().map(|f| (1, f)));
    model.faults.extend(strays(path, &root).into_iter().map(|f| (4, f)));
    mjcf_equality::read(&context, &root, &mut model);
    Ok(model)
}

/// Bodies that are lost, as they stand beside the world.
fn strays(path: &Path, root: &Element) -> Vec<String> {
    let outside = root.children.iter().filter(|c| mjcf_schema::STRAY.contains(&c.name.as_str()));
    let tell = |stray: &Element| {
        let at = mjcf_schema::place(path, stray);
        format!("{at}: stands outside <worldbody>, where MuJoCo passes over it without a word; move it in")
    };
    outside.take(mjcf_schema::MAX_FAULTS).map(tell).collect()
}

/// All names that elements have.
fn names(element: &Element, taken: &mut BTreeSet<String>) {
    taken.extend(element.get("name").map(str::to_owned));
    element.children.iter().for_each(|c| names(c, taken));
}

/// Whether an orientation is written as an angle that is not 0.
fn turned(element: &Element) -> bool {
    let is_angle = |text: &str| text.split_ascii_whitespace().any(|w| w.parse::<f64>().is_ok_and(|v| v != 0.0));
    ["euler", "axisangle"].into_iter().filter_map(|a| element.get(a)).any(is_angle)
        || element.children.iter().any(turned)
}

/// What one shape adds to its link's mass.
pub(super) struct Portion {
    /// kg; `None` for a mesh, whose volume is not known.
    pub(super) mass: Option<f64>,
    pub(super) center: Point,
    /// Link axes, kg m^2.
    pub(super) inertia: Matrix3<f64>,
    /// Neither mass nor density is written.
    pub(super) assumed: bool,
}

/// A model in the making.
pub(super) struct Builder {
    pub(super) model: Model,
    /// For each link what its shapes weigh.
    pub(super) portions: Vec<Vec<Portion>>,
    /// Names that must not be made up.
    taken: BTreeSet<String>,
    /// How many names were made up for each wish.
    made: BTreeMap<String, usize>,
    /// Elements that are not read, and how many.
    passed: BTreeMap<String, usize>,
    /// Bounds of meshes by name, or why there are none.
    pub(super) measured: BTreeMap<String, std::result::Result<[Point; 2], String>>,
    /// Whether a joint's range or reference is an angle.
    angles: bool,
    /// Geoms that a `<pair>` lets touch whatever their masks are.
    paired: BTreeSet<String>,
    /// The file switches all contacts off.
    untouching: bool,
}

impl Builder {
    fn new(path: &Path, root: &Element) -> Self {
        let mut taken = BTreeSet::new();
        names(root, &mut taken);
        let mut out = Self {
            model: Model {
                name: named(root.get("model"), path),
                source: path.to_owned(),
                format: Format::Mjcf { radian: false },
                links: Vec::new(),
                joints: Vec::new(),
                excludes: Vec::new(),
                notes: Vec::new(),
                unread: Vec::new(),
                faults: Vec::new(),
            },
            portions: Vec::new(),
            taken,
            made: BTreeMap::new(),
            passed: BTreeMap::new(),
            measured: BTreeMap::new(),
            angles: false,
            paired: BTreeSet::new(),
            untouching: false,
        };
        out.link(WORLD.to_owned());
        out
    }

    pub(super) fn pass_over(&mut self, name: &str) {
        *self.passed.entry(xml::brief(name)).or_default() += 1;
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

    /// One of the elements right in `<mujoco>`.
    fn section(&mut self, c: &Context, section: &Element, copies: &Copies) -> Result<()> {
        match section.name.as_str() {
            "worldbody" => self.contents(c, section, 0, &Pose::identity(), None)?,
            "contact" => section.children.iter().for_each(|child| self.contact(child, copies)),
            "option" => self.option(section)?,
            // Read elsewhere, or without a say in shapes and joints.
            "compiler" | "default" | "size" | "visual" | "statistic" | "keyframe" | "sensor" | "custom"
            | "equality" => {}
            "asset" => section.all("hfield").for_each(|_| self.pass_over("hfield")),
            other => self.pass_over(other),
        }
        Ok(())
    }

    fn contact(&mut self, element: &Element, copies: &Copies) {
        let both = |a: &str, b: &str| element.get(a).zip(element.get(b)).map(|(a, b)| (copies.of(a), copies.of(b)));
        match (element.name.as_str(), both("body1", "body2"), both("geom1", "geom2")) {
            ("exclude", Some((first, second)), _) => {
                let pairs = first.len().saturating_mul(second.len());
                if self.model.excludes.len().saturating_add(pairs) > MAX_EXCLUDES {
                    return self.pass_over("exclude");
                }
                for a in &first {
                    self.model.excludes.extend(second.iter().map(|b| [a.clone(), b.clone()]));
                }
            }
            // Without both the file is refused, which is said elsewhere.
            ("exclude", None, _) => {}
            (other, _, geoms) => {
                self.paired.extend(geoms.into_iter().flat_map(|(a, b)| a.into_iter().chain(b)));
                self.pass_over(other);
            }
        }
    }

    fn option(&mut self, element: &Element) -> Result<()> {
        let along_z = |g: &[f64; 3]| g[0] == 0.0 && g[1] == 0.0 && g[2] <= 0.0;
        if element.numbers::<3>("gravity")?.is_some_and(|g| !along_z(&g)) {
            self.model.notes.push("gravity does not point along -z; it is taken to".to_owned());
        }
        for flag in element.all("flag") {
            let off = |what: &str| flag.get(what) == Some("disable");
            self.untouching |= off("contact") || off("constraint");
            if off("filterparent") {
                let note =
                    "contacts between parents and children are switched on (filterparent); they are not looked at";
                self.model.notes.push(note.to_owned());
            }
        }
        Ok(())
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
                other => {
                    if HIDING.contains(&other) {
                        let at = mjcf_schema::place(&self.model.source, child);
                        self.model.unread.push(format!("{at}: its joints and shapes are not read"));
                    }
                    self.pass_over(other);
                }
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
            let shown = if i == 0 { pose } else { Pose::identity() };
            // The file shows the joint where it begins.
            joint.parent_from_child = if joint.start == 0.0 { shown } else { shown * joint.motion(-joint.start) };
            joint.parent = std::mem::replace(&mut above, below.clone());
            joint.child = below.clone();
            self.model.joints.push(joint);
            let link = self.link(below);
            self.model.links[link].between = i < last;
        }
        let link = self.model.links.len() - 1;
        self.contents(c, element, link, &Pose::identity(), class)?;
        match element.child("inertial").filter(|_| c.from_shapes != Some(true)) {
            Some(inertial) => self.inertial(c, inertial, link),
            None => Ok(()),
        }
    }

    fn inertial(&mut self, c: &Context, element: &Element, link: usize) -> Result<()> {
        let r = Resolved { element, class: None };
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
                    let r = c.resolved(child, class)?;
                    let made = joint(c, &r, name, place)?;
                    let turns = matches!(made.kind, Kind::Revolute | Kind::Other);
                    self.angles |= turns && ["range", "ref", "springref"].into_iter().any(|a| r.get(a).is_some());
                    if let Some(spring) = spring(&r)? {
                        let name = &made.name;
                        self.model.notes.push(format!("{name}: its spring ({spring}) is not read: none is simulated"));
                    }
                    out.push(made);
                }
                _ => {}
            }
        }
        Ok(())
    }

    /// Masses that no `<inertial>` states, contacts of the whole file, and the notes.
    fn finish(&mut self, c: &Context) {
        for (link, portions) in self.model.links.iter_mut().zip(&self.portions) {
            let stated = link.mass_source == MassSource::Stated || c.from_shapes == Some(false);
            if !stated && link.name != WORLD && !portions.is_empty() {
                weigh(link, portions);
            }
        }
        if let Some(total) = c.total {
            self.scale(total);
        }
        for link in &mut self.model.links {
            link.collides_as_mesh &= !self.untouching;
            for shape in &mut link.shapes {
                let paired = shape.name.as_ref().is_some_and(|n| self.paired.contains(n));
                shape.visual = self.untouching || (shape.visual && !paired);
            }
        }
        for (name, count) in &self.passed {
            self.model.notes.push(format!("not read: {count} x <{name}>"));
        }
    }

    /// Makes all bodies together weigh `total`, kg.
    fn scale(&mut self, total: f64) {
        let weighing = self.model.links.iter().filter(|l| l.mass_source != MassSource::Nothing);
        let sum = weighing.map(|l| l.mass).sum::<Option<f64>>().filter(|s| *s > 0.0);
        let Some(sum) = sum else {
            self.model.notes.push("settotalmass is not read, as not all masses are known".to_owned());
            return;
        };
        for link in &mut self.model.links {
            link.mass = link.mass.map(|m| m * total / sum);
            link.inertia *= total / sum;
        }
    }
}

/// A link's mass, centre and inertia from its shapes, where all of these are known.
fn weigh(link: &mut Link, portions: &[Portion]) {
    let assumed = portions.iter().any(|p| p.assumed);
    link.mass_source = if assumed { MassSource::Assumed } else { MassSource::Shapes };
    let Some(masses) = portions.iter().map(|p| p.mass).collect::<Option<Vec<f64>>>() else { return };
    let total: f64 = masses.iter().sum();
    if total <= 0.0 {
        return;
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

/// A joint's spring in words.
fn spring(r: &Resolved) -> Result<Option<String>> {
    let first = |attribute: &str| -> Result<f64> {
        Ok(r.numbers(attribute, 1..=8)?.and_then(|v| v.first().copied()).unwrap_or(0.0))
    };
    let (stiffness, rest) = (first("stiffness")?, first("springref")?);
    if stiffness != 0.0 {
        return Ok(Some(format!("stiffness {stiffness}, at rest at {rest}")));
    }
    let timed = r.numbers("springdamper", 2..=2)?.is_some_and(|v| v.iter().all(|x| *x > 0.0));
    Ok(timed.then(|| "springdamper".to_owned()))
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
        start: 0.0,
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
    // Balls and free joints begin where the file has them.
    let moves = matches!(kind, Kind::Revolute | Kind::Prismatic);
    let reference = r.number("ref")?.filter(|_| moves).unwrap_or(0.0);
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
        start: if kind == Kind::Revolute { c.angle(reference) } else { reference },
        ..blank(name, kind)
    })
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
