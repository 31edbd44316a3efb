//! A model in the making: the bodies, frames, joints and contacts of an MJCF, in the order of its file. Geoms are in
//! `mjcf_geoms`.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use nalgebra::Matrix3;

use super::links::{JointType, Link, MassSource, Model, ModelFormat, ModelJoint, WORLD, named};
use super::mjcf_context::{Context, Resolved};
use super::mjcf_schema;
use super::mjcf_tree::Copies;
use super::xml::{self, Element};
use crate::error::Result;
use crate::math::{Point, Pose, Vector, plain};

/// Elements of a body that make joints or shapes of their own.
const HIDING: [&str; 3] = ["attach", "composite", "flexcomp"];

/// Pairs that are excluded from contacts: copies by `<replicate>` multiply them, and no model of furniture has as many.
const MAX_EXCLUDES: usize = 1_000_000;

/// All names that elements have.
fn names(element: &Element, taken: &mut BTreeSet<String>) {
    taken.extend(element.get("name").map(str::to_owned));
    element.children.iter().for_each(|c| names(c, taken));
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
pub(super) struct MjcfBuilder {
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
    pub(super) angles: bool,
    /// Geoms that a `<pair>` lets touch whatever their masks are.
    paired: BTreeSet<String>,
    /// The file switches all contacts off.
    untouching: bool,
}

impl MjcfBuilder {
    pub(super) fn new(path: &Path, root: &Element) -> Self {
        let mut taken = BTreeSet::new();
        names(root, &mut taken);
        let mut out = Self {
            model: Model {
                name: named(root.get("model"), path),
                source: path.to_owned(),
                format: ModelFormat::Mjcf { radian: false, limitless: false },
                links: Vec::new(),
                joints: Vec::new(),
                excludes: Vec::new(),
                notes: Vec::new(),
                unread: Vec::new(),
                held: Vec::new(),
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
    pub(super) fn section(&mut self, c: &Context, section: &Element, copies: &Copies) -> Result<()> {
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
            joints.push(blank(self.free_name(&format!("{name}_fixed")), JointType::Fixed));
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
                "freejoint" => out.push(blank(self.name_of(child, "free")?, JointType::Free)),
                "joint" => {
                    let name = self.name_of(child, "joint")?;
                    let r = c.resolved(child, class)?;
                    let made = joint(c, &r, name, place)?;
                    let turns = matches!(made.kind, JointType::Revolute | JointType::Other);
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
    pub(super) fn finish(&mut self, c: &Context) {
        for (link, portions) in self.model.links.iter_mut().zip(&self.portions) {
            let stated = link.mass_source == MassSource::Stated || c.from_shapes == Some(false);
            if !stated && link.name != WORLD && !portions.is_empty() {
                set_mass(link, portions);
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
fn set_mass(link: &mut Link, portions: &[Portion]) {
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
        return Ok(Some(format!("stiffness {}, at rest at {}", plain(stiffness), plain(rest))));
    }
    let timed = r.numbers("springdamper", 2..=2)?.is_some_and(|v| v.iter().all(|x| *x > 0.0));
    Ok(timed.then(|| "springdamper".to_owned()))
}

fn blank(name: String, kind: JointType) -> ModelJoint {
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
        "hinge" => JointType::Revolute,
        "slide" => JointType::Prismatic,
        "free" => JointType::Free,
        "ball" => JointType::Other,
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
        if kind == JointType::Revolute { value.map(|v| c.angle(v)) } else { value }
    };
    // Balls and free joints begin where the file has them.
    let moves = matches!(kind, JointType::Revolute | JointType::Prismatic);
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
        start: if kind == JointType::Revolute { c.angle(reference) } else { reference },
        ..blank(name, kind)
    })
}
