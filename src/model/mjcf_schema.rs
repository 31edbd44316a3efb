//! What MJCF allows: elements, their attributes, and what these hold. The table is `assets/mjcf-schema.txt`.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::LazyLock;

use super::xml::{Element, brief};

const TABLE: &str = include_str!("../../assets/mjcf-schema.txt");

/// More faults than these tell nothing new.
pub(super) const MAX_FAULTS: usize = 1000;

/// What an attribute holds.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Value {
    /// Anything, or the path of a file.
    Text,
    /// Numbers: at least, at most.
    Numbers(usize, usize),
    /// One of these words.
    Words(Vec<&'static str>),
    /// The element's own name, and of which kind it is.
    Own(&'static str),
    /// The name of something else, and of which kind that is.
    Other(&'static str),
}

/// An attribute of an element.
#[derive(Debug, Clone)]
pub(super) struct Attribute {
    pub(super) value: Value,
    required: bool,
}

/// An element that may stand in another.
#[derive(Debug, Clone)]
struct Child {
    /// Its row.
    row: &'static str,
    /// At most one of it.
    once: bool,
    /// MuJoCo 4 has it no more.
    gone: bool,
}

/// What the table says of an element.
#[derive(Debug, Clone)]
pub(super) struct ElementRule {
    tag: &'static str,
    pub(super) attributes: BTreeMap<&'static str, Attribute>,
    /// Attributes of other names pass.
    open: bool,
    children: Vec<Child>,
}

static ROWS: LazyLock<BTreeMap<&'static str, ElementRule>> = LazyLock::new(|| {
    let lines = TABLE.lines().filter(|l| !l.starts_with('#'));
    lines.filter_map(row).collect()
});

fn row(line: &'static str) -> Option<(&'static str, ElementRule)> {
    let mut fields = line.split('|').map(str::trim);
    let (names, attributes, children) = (fields.next()?, fields.next()?, fields.next().unwrap_or_default());
    let (name, tag) = names.split_once('=').unwrap_or((names, names));
    let words = || attributes.split_ascii_whitespace();
    let child = |word: &'static str| {
        let once = word.ends_with('?');
        let bare = word.trim_end_matches(['*', '?']);
        Child { row: bare.trim_end_matches('~'), once, gone: bare.ends_with('~') }
    };
    Some((
        name,
        ElementRule {
            tag,
            attributes: words().filter(|w| *w != "*").map(attribute).collect(),
            open: words().any(|w| w == "*"),
            children: children.split_ascii_whitespace().map(child).collect(),
        },
    ))
}

fn attribute(word: &'static str) -> (&'static str, Attribute) {
    let (name, kind) = word.split_once(':').unwrap_or((word, ""));
    let value = if let Some(count) = kind.strip_prefix('#') {
        let (from, to) = count.split_once('-').unwrap_or((count, count));
        Value::Numbers(from.parse().unwrap_or(0), to.parse().unwrap_or(usize::MAX))
    } else if let Some(own) = kind.strip_prefix('^') {
        Value::Own(own)
    } else if let Some(other) = kind.strip_prefix('@') {
        Value::Other(other)
    } else if kind.contains(',') || kind == "main" {
        Value::Words(kind.split(',').collect())
    } else {
        Value::Text
    };
    (name.trim_end_matches('!'), Attribute { value, required: name.ends_with('!') })
}

impl ElementRule {
    /// The outermost element's.
    pub(super) fn root() -> Option<&'static ElementRule> {
        ROWS.get("mujoco")
    }

    fn child(&self, tag: &str) -> Option<(&Child, &'static ElementRule)> {
        self.children.iter().find_map(|c| ROWS.get(c.row).filter(|r| r.tag == tag).map(|r| (c, r)))
    }

    /// The row of an element in this one.
    pub(super) fn of_child(&self, tag: &str) -> Option<&'static ElementRule> {
        self.child(tag).map(|(_, row)| row)
    }
}

/// Where an element stands, for a message: its line, and its file where that is not the model's own.
pub(super) fn place(model: &Path, element: &Element) -> String {
    let line = format!("line {}, {}", element.line, element.label());
    if &*element.file == model { line } else { format!("{}, {line}", element.file.display()) }
}

/// Everything in a file (with what it includes) that the format has not; at most [`MAX_FAULTS`].
pub(super) fn violations(model: &Path, root: &Element) -> Vec<String> {
    let mut faults = Vec::new();
    if let Some(row) = ElementRule::root() {
        element(model, root, row, &mut faults);
    }
    faults.truncate(MAX_FAULTS);
    faults
}

/// Values in a URDF's `<mujoco>` that MuJoCo refuses. Attributes and elements that it does not know there it passes over.
pub(super) fn of_urdf(model: &Path, root: &Element) -> Vec<String> {
    let mut faults = Vec::new();
    let Some(row) = ElementRule::root() else { return faults };
    for mujoco in root.all("mujoco") {
        for section in mujoco.children.iter().filter(|c| URDF_SECTIONS.contains(&c.name.as_str())) {
            if let Some(known) = row.of_child(&section.name) {
                values(model, section, known, &mut faults);
            }
        }
    }
    faults.truncate(MAX_FAULTS);
    faults
}

/// What MuJoCo reads in a URDF's `<mujoco>`.
pub(super) const URDF_SECTIONS: [&str; 3] = ["compiler", "option", "size"];

/// Values of known attributes of an element and those in it.
fn values(model: &Path, e: &Element, row: &ElementRule, faults: &mut Vec<String>) {
    for (name, text) in &e.attributes {
        let wrong = row.attributes.get(name.as_str()).and_then(|known| wrong_value(name, &known.value, text));
        let wrong = wrong.or_else(|| {
            (name == "eulerseq" && text.chars().count() != 3).then(|| "expected three of x y z X Y Z".to_owned())
        });
        if let Some(wrong) = wrong {
            let at = place(model, e);
            faults.push(format!("{at}: {name}=\"{}\": {wrong}: MuJoCo refuses the file", brief(text)));
        }
    }
    if let Some(wrong) = (e.name == "size").then(|| memory(e)).flatten() {
        faults.push(format!("{}: {wrong}: MuJoCo refuses the file", place(model, e)));
    }
    for child in &e.children {
        if let Some(below) = row.of_child(&child.name) {
            values(model, child, below, faults);
        }
    }
}

fn element(model: &Path, e: &Element, row: &ElementRule, faults: &mut Vec<String>) {
    if faults.len() >= MAX_FAULTS {
        return;
    }
    let mut fault = |message: String| faults.push(format!("{}: {message}; MuJoCo refuses it", place(model, e)));
    for (name, text) in &e.attributes {
        match row.attributes.get(name.as_str()) {
            None if row.open => {}
            None => fault(format!("<{}> has no attribute \"{}\" in MJCF", brief(&e.name), brief(name))),
            Some(known) => {
                if let Some(wrong) = wrong_value(name, &known.value, text) {
                    fault(format!("{name}=\"{}\": {wrong}", brief(text)));
                }
            }
        }
    }
    for name in row.attributes.iter().filter(|(n, a)| a.required && e.get(n).is_none()).map(|(n, _)| n) {
        fault(format!("<{}> needs the attribute \"{name}\"", brief(&e.name)));
    }
    let given = |way: &&str| row.attributes.contains_key(*way) && e.get(way).is_some_and(|v| !v.trim().is_empty());
    if WAYS.iter().copied().filter(given).count() > 1 {
        fault(format!("more than one of {} says how it is turned", WAYS.join(", ")));
    }
    let mut seen: Vec<&str> = Vec::new();
    for child in &e.children {
        let Some((rule, below)) = row.child(&child.name) else {
            if let Some(below) = stray(e, child) {
                element(model, child, below, faults);
                continue;
            }
            let inside = brief(&e.name);
            faults.push(format!("{}: MJCF has no such element in <{inside}>; MuJoCo refuses it", place(model, child)));
            continue;
        };
        if rule.gone {
            faults.push(format!("{}: MuJoCo 4 has this element no more and refuses it", place(model, child)));
        }
        if rule.once && seen.contains(&rule.row) {
            faults.push(format!(
                "{}: the second one in its <{}>; MuJoCo refuses it",
                place(model, child),
                brief(&e.name)
            ));
        }
        if rule.once {
            seen.push(rule.row);
        }
        element(model, child, below, faults);
    }
}

/// Elements that MuJoCo passes over right in `<mujoco>`, though it looks at their spelling.
pub(super) const STRAY: [&str; 2] = ["body", "frame"];

/// The row of an element that is passed over.
fn stray(parent: &Element, child: &Element) -> Option<&'static ElementRule> {
    (parent.name == "mujoco" && STRAY.contains(&child.name.as_str())).then(|| ROWS.get(child.name.as_str())).flatten()
}

/// Bodies that are lost, as they stand beside the world.
pub(super) fn strays(path: &Path, root: &Element) -> Vec<String> {
    let outside = root.children.iter().filter(|c| STRAY.contains(&c.name.as_str()));
    let tell = |stray: &Element| {
        let at = place(path, stray);
        format!("{at}: stands outside <worldbody>, where MuJoCo passes over it without a word; move it in")
    };
    outside.take(MAX_FAULTS).map(tell).collect()
}

/// Ways to say how something is turned; a whole tensor turns an inertia, too.
const WAYS: [&str; 6] = ["quat", "axisangle", "xyaxes", "zaxis", "euler", "fullinertia"];

/// Attributes of whole numbers.
const WHOLE: [&str; 10] = [
    "group",
    "contype",
    "conaffinity",
    "condim",
    "priority",
    "iterations",
    "ls_iterations",
    "noslip_iterations",
    "nrow",
    "ncol",
];

/// What is wrong with a `<size>`: how large the simulation may get.
pub(super) fn memory(e: &Element) -> Option<String> {
    for count in ["njmax", "nconmax", "nstack"] {
        if e.number(count).ok().flatten().is_some_and(|n| n < -1.0) {
            return Some(format!("{count} must not be below -1"));
        }
    }
    let text = e.get("memory")?;
    if let Some(old) = ["njmax", "nstack"].into_iter().find(|a| e.get(a).is_some()) {
        return Some(format!("has both memory and {old}, which is older: take memory alone"));
    }
    let trimmed = text.trim();
    let digits = trimmed.trim_end_matches(|c: char| "KMGTPEkmgtpe".contains(c));
    let known = trimmed == "-1" || (trimmed.len() - digits.len() <= 1 && digits.parse::<u64>().is_ok_and(|n| n > 0));
    (!known).then(|| {
        format!("memory=\"{}\" is no size: write a whole number of bytes, with K, M or G behind it", brief(text))
    })
}

/// What is wrong with an attribute's text. No numbers at all count as not written.
fn wrong_value(name: &str, value: &Value, text: &str) -> Option<String> {
    let words: Vec<&str> = text.split_ascii_whitespace().collect();
    match value {
        Value::Numbers(from, to) if !words.is_empty() => {
            if let Some(word) = words.iter().find(|w| w.parse::<f64>().is_err()) {
                return Some(format!("\"{}\" is no number", brief(word)));
            }
            if let Some(word) = words.iter().find(|w| WHOLE.contains(&name) && w.parse::<i32>().is_err()) {
                return Some(format!("\"{}\" is no whole number of 32 bits", brief(word)));
            }
            let range = if from == to { from.to_string() } else { format!("{from} to {to}") };
            (!(*from..=*to).contains(&words.len())).then(|| format!("expected {range} numbers"))
        }
        Value::Words(known) if !known.contains(&text) => Some(format!("expected one of {}", known.join(", "))),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::super::xml;
    use super::*;

    #[test]
    fn every_row_of_the_table_is_reached_and_understood() {
        let root = ElementRule::root().unwrap();
        assert_eq!(root.children.len(), 17);
        for row in ROWS.values() {
            for child in &row.children {
                assert!(ROWS.contains_key(child.row), "{} in {}", child.row, row.tag);
            }
        }
        let geom = ROWS.get("geom").unwrap();
        assert_eq!(geom.attributes.get("size").unwrap().value, Value::Numbers(1, 3));
        assert_eq!(geom.attributes.get("mesh").unwrap().value, Value::Other("mesh"));
        assert!(ROWS.get("inertial").unwrap().attributes.get("pos").unwrap().required);
        // The same tag is another element in another place.
        assert!(!ROWS.get("default_geom").unwrap().attributes.contains_key("name"));
    }

    #[test]
    fn what_the_format_has_not_is_told_with_its_place() {
        let faults = |body: &str| {
            let text = format!("<mujoco>\n<worldbody>{body}</worldbody></mujoco>");
            let root = xml::parse(Path::new("m.xml"), &text).unwrap();
            violations(Path::new("m.xml"), &root)
        };
        for (body, word) in [
            ("<goem/>", "line 2, <goem>: MJCF has no such element in <worldbody>"),
            ("<geom sice=\"1\"/>", "<geom> has no attribute \"sice\""),
            ("<geom size=\"1 2 3 4\"/>", "expected 1 to 3 numbers"),
            ("<geom size=\"a\"/>", "\"a\" is no number"),
            ("<geom type=\"cube\"/>", "expected one of plane"),
            ("<body><inertial mass=\"1\"/></body>", "needs the attribute \"pos\""),
            ("<body><inertial pos=\"0 0 0\" mass=\"1\"/><inertial pos=\"0 0 0\" mass=\"1\"/></body>", "the second one"),
            ("<composite type=\"cable\"/>", "MuJoCo 4 has this element no more"),
            ("<joint/>", "no such element in <worldbody>"),
        ] {
            let found = faults(body);
            assert!(found.len() == 1 && found[0].contains(word), "{body}: {found:?}");
        }
        for body in [
            "<body pos=\"\"><frame foo=\"1\"><body/></frame><replicate count=\"2\"><body/></replicate></body>",
            "<light type=\"directional\"/>",
        ] {
            assert!(faults(body).is_empty(), "{body}: {:?}", faults(body));
        }
    }
}
