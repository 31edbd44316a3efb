//! Values that MuJoCo refuses though their attributes take any number: ranges that are none, sizes that leave nothing,
//! joints of the wrong kind.

use std::collections::BTreeMap;

use super::links::{JointType, ModelJoint};
use super::mjcf_context::{Class, Resolved};
use super::mjcf_schema::{ElementRule, memory};
use super::xml::{Element, brief};
use crate::math::{Vector, plain};

/// MuJoCo takes an axis that is not longer for none.
pub(super) const MIN_AXIS: f64 = 1e-7;

/// The plugins that come with MuJoCo 3.17; others have to be loaded by whoever opens the file.
const PLUGINS: [&str; 8] = [
    "mujoco.elasticity.cable",
    "mujoco.pid",
    "mujoco.sdf.bolt",
    "mujoco.sdf.bowl",
    "mujoco.sdf.gear",
    "mujoco.sdf.nut",
    "mujoco.sdf.torus",
    "mujoco.sensor.touch_grid",
];

/// What `<custom>` holds of one number list at most.
const MAX_NUMERIC: f64 = 500.0;

/// A model's joints by name.
pub(super) type Joints<'a> = BTreeMap<&'a str, &'a ModelJoint>;

/// What is wrong with an element's values, in words. The same tags stand for other things in other places: its row tells.
pub(super) fn wrong(r: &Resolved, row: &ElementRule, joints: &Joints) -> Option<String> {
    let has = |attribute: &str| row.attributes.contains_key(attribute);
    let e = r.element;
    match e.name.as_str() {
        "geom" if has("fromto") => geom(r),
        "site" if has("fromto") => site(r),
        "joint" if has("springref") => joint(r),
        "joint" if has("joint1") => coupled(e, joints),
        "joint" if has("coef") => slides_or_turns(e.get("joint"), joints),
        "weld" | "connect" => tied(e),
        "fixed" | "spatial" => path(e),
        "inertial" if has("fullinertia") => tensors(e),
        "size" if has("memory") => memory(e),
        "numeric" if has("data") => numeric(e),
        "text" if has("data") => {
            e.get("data").is_some_and(str::is_empty).then(|| "its text is empty; write one, or leave it out".to_owned())
        }
        "tuple" => tuple(e),
        "texture" => texture(e),
        "material" if has("texture") => unnamed(e),
        "hfield" => height_field(e),
        "camera" => {
            number(r, "fovy").is_some_and(|angle| angle >= 180.0).then(|| "fovy must be below 180 degrees".to_owned())
        }
        "statistic" => {
            number(r, "extent").is_some_and(|extent| extent <= 0.0).then(|| "extent must be positive".to_owned())
        }
        _ if has("cutoff") && has("noise") => sensor(r, joints),
        _ => None,
    }
}

/// The numbers of an attribute; none where they are no numbers, which is told elsewhere.
fn numbers(r: &Resolved, attribute: &str) -> Vec<f64> {
    r.numbers(attribute, 0..=usize::MAX).ok().flatten().unwrap_or_default()
}

fn number(r: &Resolved, attribute: &str) -> Option<f64> {
    numbers(r, attribute).first().copied()
}

/// Whether two numbers are a range; what is missing is 0.
fn goes_up(range: &[f64]) -> bool {
    let end = |i: usize| range.get(i).copied().unwrap_or(0.0);
    end(0) < end(1)
}

fn geom(r: &Resolved) -> Option<String> {
    if let Some(condim) = number(r, "condim").filter(|c| ![1.0, 3.0, 4.0, 6.0].contains(c)) {
        return Some(format!("condim is {}; it is 1, 3, 4 or 6", plain(condim)));
    }
    let spacing = numbers(r, "size").get(2).copied().unwrap_or(0.0);
    (r.get("type") == Some("plane") && spacing <= 0.0).then(|| {
        "the third size of a plane, the spacing of its grid, must be positive: write size=\"0 0 0.1\"".to_owned()
    })
}

fn site(r: &Resolved) -> Option<String> {
    let kind = r.get("type").unwrap_or("sphere");
    if ["plane", "hfield"].contains(&kind) {
        return Some(format!("type {kind} is not for sites"));
    }
    let between = r.get("fromto").is_some();
    if between && !["capsule", "cylinder", "box", "ellipsoid"].contains(&kind) {
        return Some(format!("fromto is not for a {}", brief(kind)));
    }
    let used = match kind {
        "mesh" | "sdf" => 0,
        _ if kind == "sphere" || between => 1,
        "capsule" | "cylinder" => 2,
        _ => 3,
    };
    let size = numbers(r, "size");
    size.iter().take(used).any(|s| *s <= 0.0).then(|| "its size must be positive".to_owned())
}

fn joint(r: &Resolved) -> Option<String> {
    let kind = r.get("type").unwrap_or("hinge");
    let axis = numbers(r, "axis");
    let short = axis.len() == 3 && Vector::from_row_slice(&axis).norm() <= MIN_AXIS;
    if short && ["hinge", "slide"].contains(&kind) {
        return Some("its axis is 0; give it a direction".to_owned());
    }
    let low = number(r, "range").unwrap_or(0.0);
    if kind == "ball" && r.get("limited") != Some("false") && low != 0.0 {
        return Some("the range of a ball begins at 0".to_owned());
    }
    let spring = numbers(r, "springdamper");
    if spring.iter().any(|s| *s != 0.0) && spring.iter().any(|s| *s <= 0.0) {
        return Some("both numbers of springdamper must be positive, or both 0".to_owned());
    }
    let limited = r.get("actuatorfrclimited") == Some("true");
    (limited && !goes_up(&numbers(r, "actuatorfrcrange")))
        .then(|| "actuatorfrclimited needs an actuatorfrcrange that goes up".to_owned())
}

/// A joint that should be a hinge or a slide; that there is none of its name is told elsewhere.
fn slides_or_turns(name: Option<&str>, joints: &Joints) -> Option<String> {
    let joint = joints.get(name?).filter(|j| j.moves().is_none())?;
    Some(format!("\"{}\" is neither a hinge nor a slide", brief(&joint.name)))
}

/// An equality of two joints.
fn coupled(e: &Element, joints: &Joints) -> Option<String> {
    let (first, second) = (e.get("joint1"), e.get("joint2"));
    if second.is_some() && first == second {
        return Some("ties a joint to itself".to_owned());
    }
    slides_or_turns(first, joints).or_else(|| slides_or_turns(second, joints))
}

/// An equality of two bodies.
fn tied(e: &Element) -> Option<String> {
    let given = |attribute: &str| e.get(attribute).is_some_and(|v| !v.trim().is_empty());
    let bodies = given("body1") && (e.name == "weld" || given("anchor"));
    if !(bodies || given("site1") && given("site2")) {
        let anchored = if e.name == "weld" { "" } else { " and anchor" };
        return Some(format!("ties nothing: write body1{anchored}, or site1 and site2"));
    }
    (given("body1") && e.get("body1") == e.get("body2")).then(|| "ties a body to itself".to_owned())
}

/// What a tendon goes along.
fn path(e: &Element) -> Option<String> {
    let count = e.children.iter().filter(|c| ["joint", "site", "geom"].contains(&c.name.as_str())).count();
    match e.name.as_str() {
        "fixed" if count == 0 => Some("its path is empty: add joints".to_owned()),
        "spatial" if count < 2 => Some("its path needs two sites or geoms".to_owned()),
        _ => None,
    }
}

/// Limits of a tendon; `r` is over the tendons of its class.
pub(super) fn tendon(r: &Resolved, autolimits: bool) -> Option<String> {
    for (limited, range) in [("limited", "range"), ("actuatorfrclimited", "actuatorfrcrange")] {
        let ends = numbers(r, range);
        let says = r.get(limited).unwrap_or("auto");
        if says == "true" && !goes_up(&ends) {
            return Some(format!("is limited ({limited}), and has no {range} that goes up"));
        }
        if says == "auto" && !autolimits && ends.iter().any(|x| *x != 0.0) {
            return Some(format!("has {range} but not {limited}, and autolimits is off: write {limited}=\"true\""));
        }
    }
    if let [low, high] = numbers(r, "springlength")[..]
        && low > high
    {
        return Some("the first number of springlength must not exceed the second".to_owned());
    }
    let width = number(r, "width").filter(|_| r.element.name == "spatial");
    width.is_some_and(|w| w <= 0.0).then(|| "its width must be positive".to_owned())
}

/// A body's inertia, which is written in one of two ways.
fn tensors(e: &Element) -> Option<String> {
    let given = |attribute: &str| e.get(attribute).is_some_and(|v| !v.trim().is_empty());
    let moments = e.numbers::<3>("diaginertia").ok().flatten().is_some_and(|m| m.iter().any(|x| *x != 0.0));
    (given("fullinertia") && moments).then(|| "both fullinertia and diaginertia say its inertia: take one".to_owned())
}

fn numeric(e: &Element) -> Option<String> {
    let data = e.get("data").map_or(0, |text| text.split_ascii_whitespace().count());
    let size = e.number("size").ok().flatten();
    if size.is_some_and(|size| (data as f64) > size) {
        return Some("data has more numbers than size says".to_owned());
    }
    (!(1.0..=MAX_NUMERIC).contains(&size.unwrap_or(data as f64)))
        .then(|| format!("holds {} numbers; it is 1 to {MAX_NUMERIC}", plain(size.unwrap_or(data as f64))))
}

fn tuple(e: &Element) -> Option<String> {
    let mut elements = e.all("element").peekable();
    if elements.peek().is_none() {
        return Some("is empty: add elements".to_owned());
    }
    elements
        .any(|part| part.get("objname").is_some_and(str::is_empty))
        .then(|| "one of its elements names nothing (objname)".to_owned())
}

/// What is wrong with the name of a `<plugin>`: that none of `declared` in `<extension>` has it.
pub(super) fn plugin(r: &Resolved, row: &ElementRule, declared: &[&str]) -> Option<String> {
    let name = r.get("plugin").unwrap_or_default();
    if !row.attributes.contains_key("instance") {
        return (!PLUGINS.contains(&name)).then(|| {
            format!("plugin \"{}\" does not come with MuJoCo: who opens the file has to load it first", brief(name))
        });
    }
    if name.is_empty() {
        let instance = r.get("instance").is_some_and(|i| !i.is_empty());
        return (!instance).then(|| "names neither plugin nor instance".to_owned());
    }
    (!declared.contains(&name)).then(|| format!("no plugin \"{}\" is declared in <extension>", brief(name)))
}

/// What needs a name, as nothing else gives it one.
fn unnamed(e: &Element) -> Option<String> {
    e.get("name").is_none_or(str::is_empty).then(|| "has no name; give it one".to_owned())
}

fn texture(e: &Element) -> Option<String> {
    let filled = |attribute: &&str| e.get(attribute).is_some_and(|f| !f.is_empty());
    let from_file = super::mjcf_assets::PICTURES.iter().any(filled);
    let kind = e.get("type").unwrap_or("cube");
    if !from_file && kind != "skybox" && unnamed(e).is_some() {
        return unnamed(e);
    }
    let builtin = e.get("builtin").is_some_and(|b| b != "none");
    if !builtin {
        return (!from_file).then(|| "has neither file nor builtin".to_owned());
    }
    let side = |attribute: &str| e.number(attribute).ok().flatten().unwrap_or(0.0);
    let small = side("width") < 1.0 || (kind == "2d" && side("height") < 1.0);
    small.then(|| "a builtin texture needs width and height, in pixels".to_owned())
}

fn height_field(e: &Element) -> Option<String> {
    let size = e.numbers::<4>("size").ok().flatten();
    if size.is_some_and(|s| s.iter().any(|x| *x <= 0.0)) {
        return Some("all four sizes must be positive".to_owned());
    }
    let count = |attribute: &str| e.number(attribute).ok().flatten().unwrap_or(0.0);
    let written = e.get("file").is_none_or(str::is_empty);
    (written && count("nrow").min(count("ncol")) < 2.0)
        .then(|| "has no file, and nrow and ncol are not both 2 or more".to_owned())
}

fn sensor(r: &Resolved, joints: &Joints) -> Option<String> {
    if let Some(what) = ["cutoff", "noise"].into_iter().find(|a| number(r, a).is_some_and(|v| v < 0.0)) {
        return Some(format!("{what} must not be negative"));
    }
    let e = r.element;
    let joint = || joints.get(e.get("joint")?).copied();
    match e.name.as_str() {
        "jointpos" | "jointvel" | "jointactuatorfrc" => slides_or_turns(e.get("joint"), joints),
        "ballquat" | "ballangvel" => {
            joint().filter(|j| j.kind != JointType::Other).map(|j| format!("\"{}\" is no ball", brief(&j.name)))
        }
        "jointlimitpos" | "jointlimitvel" | "jointlimitfrc" => joint()
            .filter(|j| j.moves().is_some() && j.limits().is_none())
            .map(|j| format!("\"{}\" has no limits", brief(&j.name))),
        _ => None,
    }
}

/// All actuators share their defaults, whatever they are called.
const ACTUATORS: [&str; 11] = [
    "general",
    "motor",
    "position",
    "velocity",
    "intvelocity",
    "damper",
    "cylinder",
    "muscle",
    "adhesion",
    "dcmotor",
    "plugin",
];

/// What an actuator says, else what its defaults do; of several the last in the file counts, and that order is not kept.
fn written<'a>(e: &'a Element, class: Option<&'a Class>, attribute: &str) -> Vec<&'a str> {
    if let Some(own) = e.get(attribute) {
        return vec![own];
    }
    let mut values = Vec::new();
    for tag in ACTUATORS {
        let value = class.and_then(|c| c.get(tag)).and_then(|settings| settings.get(attribute));
        if let Some(value) = value.map(String::as_str).filter(|v| !values.contains(v)) {
            values.push(value);
        }
    }
    values
}

/// What is wrong with an actuator's ranges and slider; `class` is the one that holds for it.
pub(super) fn actuator(e: &Element, class: Option<&Class>, autolimits: bool) -> Option<String> {
    let inherits = !written(e, class, "inheritrange").is_empty();
    for (limited, range) in [("ctrllimited", "ctrlrange"), ("forcelimited", "forcerange"), ("actlimited", "actrange")] {
        let (says, texts) = (written(e, class, limited), written(e, class, range));
        if says.len() > 1 || texts.len() > 1 {
            continue;
        }
        let says = says.first().copied().unwrap_or("auto");
        let ends = e.parse(range, texts.first().copied().unwrap_or_default(), 0..=2).unwrap_or_default();
        let implied = limited == "ctrllimited" && ["damper", "adhesion"].contains(&e.name.as_str());
        if (says == "true" || implied) && !inherits && !goes_up(&ends) {
            return Some(format!("is limited, and has no {range} that goes up"));
        }
        if !autolimits && says == "auto" && !implied && ends.iter().any(|x| *x != 0.0) {
            return Some(format!("has {range} but not {limited}, and autolimits is off: write {limited}=\"true\""));
        }
    }
    let length = written(e, class, "cranklength").first().and_then(|l| l.parse::<f64>().ok()).unwrap_or(0.0);
    match (e.get("cranksite"), e.get("slidersite")) {
        (Some(_), None) => Some("a crank needs its slidersite".to_owned()),
        (Some(_), Some(_)) if length <= 0.0 => Some("cranklength must be positive".to_owned()),
        _ => None,
    }
}

/// What is wrong with the joints of one body, from their types in order: a ball turns about everything.
pub(super) fn together(kinds: &[&str]) -> Option<&'static str> {
    let free = kinds.contains(&"free");
    if free {
        return (kinds.len() > 1).then_some("a free joint must be the only one of its body");
    }
    let ball = kinds.iter().position(|k| *k == "ball");
    if ball.is_some_and(|ball| kinds.iter().skip(ball + 1).any(|k| *k != "slide")) {
        return Some("its joints still turn behind a ball, which turns about everything");
    }
    let freedoms: usize = kinds.iter().map(|k| if *k == "ball" { 3 } else { 1 }).sum();
    (freedoms > 6).then_some("has more than 6 degrees of freedom")
}
