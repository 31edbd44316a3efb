//! What MuJoCo refuses though each element by itself is allowed: names that name nothing, names twice, bodies that cannot
//! move, keyframes of another model. The values of single elements are in `mjcf_values`.

use std::collections::{BTreeMap, BTreeSet};

use super::links::{JointType, Model, WORLD};
use super::mjcf_assets::MeshAsset;
use super::mjcf_context::{Context, MAIN, Resolved};
use super::mjcf_schema::{ElementRule, Value, place};
use super::mjcf_tree::Copies;
use super::xml::{Element, brief};
use super::{mjcf_geoms, mjcf_values, weights};
use crate::math::plain;

/// Everything of this kind, and what is only worth a note; `root` is the whole tree, with copies made.
pub(super) fn refusals(c: &Context, root: &Element, copies: &Copies, model: &Model) -> (Vec<String>, Vec<String>) {
    let joints = model.joints.iter().map(|j| (j.name.as_str(), j)).collect();
    let mut out = Refusals {
        c,
        copies,
        model,
        joints,
        names: BTreeMap::new(),
        attaches: false,
        faults: Vec::new(),
        notes: Vec::new(),
        mocaps: 0,
        actuators: root.all("actuator").map(|a| a.children.len()).sum(),
        plugins: root.all("extension").flat_map(|e| e.all("plugin")).filter_map(|p| p.get("plugin")).collect(),
    };
    if let Some(row) = ElementRule::root() {
        out.names.entry("body").or_default().insert(WORLD.to_owned());
        out.names.entry("default").or_default().insert(MAIN.to_owned());
        out.collect(root, row);
        let at = ElementPlace { class: None, moving: false, below_world: true, weighs: false, default: false };
        out.element(root, row, at);
    }
    for default in root.all("default") {
        if let Some(class) = default.get("class").filter(|c| !c.is_empty() && *c != MAIN) {
            out.fault(default, format!("the outermost class is \"{MAIN}\", not \"{}\"", brief(class)));
        }
    }
    out.faults.extend(weights::refused(model, c.mended));
    // What was not read may have joints that a keyframe counts.
    if model.unread.is_empty() {
        root.all("keyframe").flat_map(|k| k.all("key")).for_each(|key| out.keyframe(key));
    }
    (out.faults, out.notes)
}

/// Where an element stands.
#[derive(Clone, Copy)]
struct ElementPlace<'a> {
    /// The class that holds for what names none.
    class: Option<&'a str>,
    /// In a body that joints move.
    moving: bool,
    /// Right in the world, or in frames of it.
    below_world: bool,
    /// In a body that weighs what its geoms weigh.
    weighs: bool,
    /// In a default class.
    default: bool,
}

struct Refusals<'a> {
    c: &'a Context,
    copies: &'a Copies,
    model: &'a Model,
    joints: mjcf_values::Joints<'a>,
    /// Names by kind.
    names: BTreeMap<&'static str, BTreeSet<String>>,
    /// Whether other models are attached.
    attaches: bool,
    faults: Vec<String>,
    notes: Vec<String>,
    mocaps: usize,
    actuators: usize,
    /// Plugins that the file says it has.
    plugins: Vec<&'a str>,
}

/// Kinds that the file itself must have, unless other models, which bring their own, are attached.
const ALWAYS_READ: [&str; 4] = ["default", "material", "texture", "hfield"];

impl Refusals<'_> {
    fn fault(&mut self, element: &Element, message: impl std::fmt::Display) {
        let at = place(&self.model.source, element);
        self.faults.push(format!("{at}: {message}; MuJoCo refuses it"));
    }

    /// All names, and a fault for each that is there twice.
    fn collect(&mut self, element: &Element, row: &'static ElementRule) {
        self.attaches |= element.name == "attach";
        for (attribute, known) in &row.attributes {
            let Value::Own(kind) = known.value else { continue };
            let Some(name) = own_name(element, attribute, kind) else { continue };
            if kind == "default" && name == MAIN {
                continue;
            }
            if !self.names.entry(kind).or_default().insert(name.clone()) {
                self.fault(element, format!("\"{}\" is the name of a second {kind}", brief(&name)));
            }
        }
        for child in &element.children {
            if let Some(below) = row.of_child(&child.name) {
                self.collect(child, below);
            }
        }
    }

    fn element(&mut self, element: &Element, row: &'static ElementRule, at: ElementPlace) {
        // An unknown class is told as any other name that names nothing.
        let c = self.c;
        let resolved = c.resolved(element, at.class).unwrap_or(Resolved { element, class: None });
        for (attribute, known) in &row.attributes {
            let Value::Other(kind) = known.value else { continue };
            let written =
                if at.default { element.get(attribute).filter(|_| kind == "default") } else { resolved.get(attribute) };
            if let Some(name) = written {
                self.look_up(element, kind, name);
            }
        }
        for (kind, name) in [("objtype", "objname"), ("reftype", "refname")] {
            if let (Some(kind), Some(name)) = (element.get(kind), element.get(name)) {
                self.look_up(element, if kind == "xbody" { "body" } else { kind }, name);
            }
        }
        if !at.default
            && let Some(wrong) = mjcf_values::wrong(&resolved, row, &self.joints)
        {
            self.fault(element, wrong);
        }
        let mut inside = ElementPlace { class: element.get("childclass").or(at.class), ..at };
        match element.name.as_str() {
            "default" => inside.default = true,
            "body" if !at.default => {
                self.body(element, inside.class, at);
                let is_mocap = element.get("mocap") == Some("true");
                inside.moving = !is_mocap && (at.moving || !joints(element).is_empty());
                inside.below_world = false;
                inside.weighs = element.child("inertial").is_none() || c.from_shapes == Some(true);
            }
            // Other elements have the same tags: parts of tendons, of equalities.
            "geom" if !at.default && row.attributes.contains_key("fromto") => self.geom(element, &resolved, at),
            "freejoint" if at.below_world => self.fault(element, "the world has no joints"),
            "joint" if !at.default && row.attributes.contains_key("springref") => {
                if at.below_world {
                    self.fault(element, "the world has no joints");
                }
                self.joint(element, &resolved);
            }
            "actuator" => element.children.iter().for_each(|a| self.actuator(a)),
            "fixed" | "spatial" if !at.default && row.attributes.contains_key("springlength") => {
                self.tendon(element, at)
            }
            // Models that are attached bring their plugins.
            "plugin" if !at.default && !self.attaches && self.model.unread.is_empty() => {
                if let Some(wrong) = mjcf_values::plugin(&resolved, row, &self.plugins) {
                    self.fault(element, wrong);
                }
            }
            _ => {}
        }
        for child in &element.children {
            if let Some(below) = row.of_child(&child.name) {
                self.element(child, below, inside);
            }
        }
    }

    fn look_up(&mut self, element: &Element, kind: &str, name: &str) {
        // What was not read may have the name.
        let judged = self.model.unread.is_empty() || (ALWAYS_READ.contains(&kind) && !self.attaches);
        let known = self.names.get(kind).is_some_and(|names| names.contains(name)) || self.copies.has(name);
        if judged && !known && !name.is_empty() {
            self.fault(element, format!("there is no {} \"{}\"", brief(kind), brief(name)));
        }
    }

    /// `class` is the one that holds for what is in the body.
    fn body(&mut self, element: &Element, class: Option<&str>, at: ElementPlace) {
        let joints = joints(element);
        if element.get("mocap") == Some("true") {
            self.mocaps += 1;
            if !joints.is_empty() || !at.below_world {
                self.fault(element, "what is moved from outside (mocap) stands right in the world and has no joints");
            }
        }
        let c = self.c;
        let kind = |joint: &Element| match joint.name.as_str() {
            "freejoint" => "free".to_owned(),
            _ => c.resolved(joint, class).ok().and_then(|r| r.get("type")).unwrap_or("hinge").to_owned(),
        };
        let kinds: Vec<String> = joints.into_iter().map(kind).collect();
        let kinds: Vec<&str> = kinds.iter().map(String::as_str).collect();
        if let Some(wrong) = mjcf_values::together(&kinds) {
            self.fault(element, wrong);
        }
    }

    fn geom(&mut self, element: &Element, r: &Resolved, at: ElementPlace) {
        let kind = r.get("type").unwrap_or("sphere");
        match kind {
            "plane" if at.moving => {
                self.fault(element, "a plane may only stand still, and this body moves: take a box");
            }
            "mesh" | "sdf" if r.get("mesh").is_none_or(str::is_empty) => {
                self.fault(element, format!("a geom of type {kind} needs a mesh"));
            }
            "hfield" if r.get("hfield").is_none_or(str::is_empty) => {
                self.fault(element, "a height field needs its hfield")
            }
            "mesh"
                if r.get("mesh").and_then(|m| self.c.meshes.get(m)).is_some_and(MeshAsset::is_thin) && collides(r) =>
            {
                self.fault(
                    element,
                    "its mesh is flat and cannot collide: take a thin box, or contype=\"0\" conaffinity=\"0\"",
                );
            }
            _ => {}
        }
        let first = |attribute: &str| r.number(attribute).ok().flatten();
        if at.weighs && first("mass").or_else(|| first("density")).is_some_and(|m| m < 0.0) {
            self.fault(element, "its mass or density is negative");
        }
        if r.get("fromto").is_some() {
            if !["capsule", "cylinder", "box", "ellipsoid"].contains(&kind) {
                self.fault(element, format!("fromto is not for a {}", brief(kind)));
            } else if r.numbers("pos", 3..=3).ok().flatten().is_some_and(|p| p.iter().any(|x| *x != 0.0)) {
                self.fault(element, "both pos and fromto say where it is: take one");
            }
        }
    }

    fn joint(&mut self, element: &Element, r: &Resolved) {
        let range = r.numbers("range", 2..=2).ok().flatten().unwrap_or_default();
        let (low, high) = (range.first().copied().unwrap_or(0.0), range.get(1).copied().unwrap_or(0.0));
        let kind = r.get("type").unwrap_or("hinge");
        match r.get("limited").unwrap_or("auto") {
            _ if kind == "free" => {}
            "auto" if !self.c.autolimits && (low != 0.0 || high != 0.0) => {
                self.fault(element, "has a range but not limited, and autolimits is off: write limited=\"true\"");
            }
            "true" if kind != "ball" && low >= high => {
                let [low, high] = [low, high].map(plain);
                self.fault(element, format!("is limited to {low} to {high}, which is no range: write range=\"0 ...\""));
            }
            _ => {}
        }
        let force = r.numbers("actuatorfrcrange", 2..=2).ok().flatten().unwrap_or_default();
        let says = r.get("actuatorfrclimited").unwrap_or("auto");
        if says == "auto" && !self.c.autolimits && force.iter().any(|x| *x != 0.0) {
            let wrong = "has actuatorfrcrange but not actuatorfrclimited, and autolimits is off: write one of the two";
            self.fault(element, wrong);
        }
    }

    fn tendon(&mut self, element: &Element, at: ElementPlace) {
        let c = self.c;
        let class = c.classes.get(element.get("class").or(at.class).unwrap_or(MAIN));
        let r = Resolved { element, class: class.and_then(|class| class.get("tendon")) };
        if let Some(wrong) = mjcf_values::tendon(&r, c.autolimits) {
            self.fault(element, wrong);
        }
    }

    fn actuator(&mut self, element: &Element) {
        const TARGETS: [&str; 7] = ["joint", "jointinparent", "tendon", "site", "slidersite", "cranksite", "body"];
        if TARGETS.into_iter().all(|t| element.get(t).is_none_or(str::is_empty)) {
            self.fault(element, "moves nothing: name a joint, tendon, site or body");
        }
        let class = self.c.classes.get(element.get("class").unwrap_or(MAIN));
        if let Some(wrong) = mjcf_values::actuator(element, class, self.c.autolimits) {
            self.fault(element, wrong);
        }
    }

    /// How many numbers a keyframe must have.
    fn keyframe(&mut self, key: &Element) {
        let count = |free: usize, ball: usize| -> usize {
            let of = |kind: JointType| match kind {
                JointType::Fixed => 0,
                JointType::Free => free,
                JointType::Other => ball,
                JointType::Revolute | JointType::Continuous | JointType::Prismatic => 1,
            };
            self.model.joints.iter().map(|j| of(j.kind)).sum()
        };
        let wanted = [
            ("qpos", count(7, 4)),
            ("qvel", count(6, 3)),
            ("mpos", 3 * self.mocaps),
            ("mquat", 4 * self.mocaps),
            ("ctrl", self.actuators),
        ];
        for (attribute, wanted) in wanted {
            let have = key.get(attribute).map_or(0, |text| text.split_ascii_whitespace().count());
            if have > wanted {
                self.fault(key, format!("{attribute} has {have} numbers, the model {wanted}"));
            } else if have != 0 && have < wanted {
                let at = place(&self.model.source, key);
                self.notes.push(format!(
                    "{at}: {attribute} has {have} numbers, the model {wanted}; MuJoCo takes the rest from the model, and \
                     before 3.17 it may refuse the file"
                ));
            }
        }
    }
}

/// Whether a geom takes part in contacts by its own masks.
fn collides(r: &Resolved) -> bool {
    mjcf_geoms::masks(r).is_ok_and(|masks| masks != [0, 0])
}

/// The joints of a body, through its frames.
fn joints(element: &Element) -> Vec<&Element> {
    let mut out = Vec::new();
    for child in &element.children {
        match child.name.as_str() {
            "joint" | "freejoint" => out.push(child),
            "frame" => out.extend(joints(child)),
            _ => {}
        }
    }
    out
}

/// An element's name, which for files is that of the file where none is written.
fn own_name(element: &Element, attribute: &str, kind: &str) -> Option<String> {
    let name = element.get(attribute).filter(|n| !n.is_empty()).map(str::to_owned);
    if name.is_some() || !["mesh", "texture", "hfield", "skin", "model"].contains(&kind) {
        return name;
    }
    let file = element.get("file")?.rsplit(['/', '\\']).next()?;
    Some(file.rsplit_once('.').map_or(file, |(stem, _)| stem).to_owned()).filter(|n| !n.is_empty())
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::super::{mjcf, xml};

    /// The faults of point 1.
    fn faults(text: &str) -> Vec<String> {
        let root = xml::parse(Path::new("m.xml"), text).unwrap();
        let model = mjcf::from_element(Path::new("m.xml"), root).unwrap();
        model.faults.into_iter().filter(|(point, _)| *point == 1).map(|(_, f)| f).collect()
    }

    const DOOR: &str = r#"<body name="door"><joint name="hinge"/><geom name="panel" size="0.1"/></body>"#;

    #[test]
    fn names_that_name_nothing_are_told() {
        for (body, rest, word) in [
            ("<geom material=\"oak\" size=\"1\"/>", "", "there is no material \"oak\""),
            ("<geom type=\"mesh\" mesh=\"m\"/>", "", "there is no mesh \"m\""),
            ("", "<actuator><motor joint=\"no\"/></actuator>", "<motor>: there is no joint \"no\""),
            ("", "<actuator><motor/></actuator>", "moves nothing"),
            ("", "<contact><exclude body1=\"door\" body2=\"no\"/></contact>", "there is no body \"no\""),
            ("", "<sensor><framepos objtype=\"site\" objname=\"no\"/></sensor>", "there is no site \"no\""),
            ("", "<equality><weld body1=\"no\"/></equality>", "there is no body \"no\""),
            ("", "<keyframe><key qpos=\"0 0 0\"/></keyframe>", "qpos has 3 numbers, the model 1"),
            ("<geom name=\"panel\" size=\"1\"/>", "", "\"panel\" is the name of a second geom"),
            ("", "<default class=\"house\"/>", "the outermost class is \"main\""),
            ("<geom size=\"1\"/>", "<default><geom material=\"no\"/></default>", "there is no material \"no\""),
        ] {
            let found = faults(&format!("<mujoco><worldbody>{DOOR}{body}</worldbody>{rest}</mujoco>"));
            assert!(!found.is_empty() && found.iter().all(|f| f.contains(word)), "{body}{rest}: {found:?}");
        }
    }

    #[test]
    fn what_names_something_passes() {
        for (body, rest) in [
            ("", "<contact><exclude body1=\"door\" body2=\"world\"/></contact>"),
            ("", "<sensor><framepos objtype=\"xbody\" objname=\"door\"/></sensor>"),
            ("", "<actuator><position joint=\"hinge\" kp=\"1\"/></actuator>"),
            ("", "<default><default class=\"unused\"><geom material=\"no\"/></default></default>"),
            ("<geom material=\"\" size=\"1\"/>", "<keyframe><key qpos=\"0\"/></keyframe>"),
            (
                "<replicate count=\"2\"><body name=\"b\"><joint name=\"j\"/><geom size=\"1\"/></body></replicate>",
                "<actuator><motor joint=\"j\"/></actuator><keyframe><key qpos=\"0 0 0\"/></keyframe>",
            ),
            ("<attach model=\"m\" prefix=\"p_\"/>", "<actuator><motor joint=\"p_j\"/></actuator>"),
        ] {
            // Any file that is there: what is attached is not read.
            let asset = "<asset><model name=\"m\" file=\"Cargo.toml\"/></asset>";
            let found = faults(&format!("<mujoco>{asset}<worldbody>{DOOR}{body}</worldbody>{rest}</mujoco>"));
            assert!(found.is_empty(), "{body}{rest}: {found:?}");
        }
    }

    #[test]
    fn bodies_that_cannot_be_are_told() {
        for (joint, geom, word) in [
            ("<joint/>", "<geom type=\"plane\" size=\"1 1 1\"/><geom size=\"1\"/>", "may only stand still"),
            ("<joint/>", "<geom type=\"sdf\"/><geom size=\"1\"/>", "type sdf needs a mesh"),
            ("<joint/>", "", "b: moves, and neither it"),
            ("<joint/>", "<geom size=\"1\" mass=\"0\"/>", "b: moves, and neither it"),
            ("<joint/>", "<inertial pos=\"0 0 0\" mass=\"4\"/>", "b: moves, and neither it"),
            ("<joint limited=\"true\"/>", "<geom size=\"1\"/>", "which is no range"),
            ("<joint/><freejoint/>", "<geom size=\"1\"/>", "must be the only one"),
            ("", "<geom type=\"box\" size=\"1\" fromto=\"0 0 0 1 0 0\" pos=\"1 0 0\"/>", "both pos and fromto"),
            ("", "<geom size=\"1\" fromto=\"0 0 0 1 0 0\"/>", "fromto is not for a sphere"),
            ("<joint/>", "<body><geom size=\"1\"/></body>", ""),
            ("", "<geom type=\"plane\" size=\"1 1 1\"/>", ""),
            ("<joint range=\"3 1\"/>", "<geom size=\"1\"/>", ""),
        ] {
            let found =
                faults(&format!("<mujoco><worldbody><body name=\"b\">{joint}{geom}</body></worldbody></mujoco>"));
            if word.is_empty() {
                assert!(found.is_empty(), "{joint}{geom}: {found:?}");
            } else {
                assert!(found.len() == 1 && found[0].contains(word), "{joint}{geom}: {found:?}");
            }
        }
    }
}
