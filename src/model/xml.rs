//! XML as a tree of elements with their places. Nothing is expanded that a file declares itself; size, depth and number
//! of elements are bounded, so that no file fills the memory or the stack.

use std::fs::File;
use std::io::Read;
use std::ops::RangeInclusive;
use std::path::Path;
use std::sync::Arc;

use quick_xml::events::{BytesStart, Event};
use quick_xml::{Reader, XmlVersion};

use crate::error::{Error, Result};

/// Models are text; what is larger than this holds data that belongs into other files.
pub(super) const MAX_BYTES: u64 = 64 << 20;
/// A chain of links nests once for each of them.
const MAX_DEPTH: usize = 200;
const MAX_ELEMENTS: usize = 1_000_000;
const MAX_ATTRIBUTES: usize = 256;
const MAX_NAME_BYTES: usize = 256;

/// An element with everything in it but text, which neither format uses.
#[derive(Debug, Clone)]
pub(super) struct Element {
    /// Tag.
    pub name: String,
    /// Names and values, in the file's order.
    pub attributes: Vec<(String, String)>,
    /// Elements in it.
    pub children: Vec<Element>,
    /// The file that it stands in.
    pub file: Arc<Path>,
    /// The line that it begins in, from 1.
    pub line: usize,
}

/// A text that came from outside, short enough for a message.
pub(super) fn brief(text: &str) -> String {
    const MOST: usize = 60;
    let line = text.replace(['\n', '\r', '\t'], " ");
    if line.chars().count() <= MOST { line } else { format!("{}...", line.chars().take(MOST).collect::<String>()) }
}

impl Element {
    /// An attribute.
    pub fn get(&self, attribute: &str) -> Option<&str> {
        self.attributes.iter().find(|(name, _)| name == attribute).map(|(_, value)| value.as_str())
    }

    /// The first child of a name.
    pub fn child(&self, name: &str) -> Option<&Element> {
        self.children.iter().find(|c| c.name == name)
    }

    /// All children of a name.
    pub fn all<'a>(&'a self, name: &'a str) -> impl Iterator<Item = &'a Element> {
        self.children.iter().filter(move |c| c.name == name)
    }

    /// The element as messages name it: `<joint name="door">`.
    pub fn label(&self) -> String {
        match self.get("name") {
            Some(name) => format!("<{} name=\"{}\">", brief(&self.name), brief(name)),
            None => format!("<{}>", brief(&self.name)),
        }
    }

    /// An error at this element.
    pub fn error(&self, message: impl Into<String>) -> Error {
        Error::format(&self.file, format!("line {}, {}", self.line, self.label()), message)
    }

    /// The element's name, which must be there and of a sensible length.
    pub fn own_name(&self) -> Result<String> {
        match self.get("name") {
            Some(name) if name.len() <= MAX_NAME_BYTES => Ok(name.to_owned()),
            Some(_) => Err(self.error(format!("its name is longer than {MAX_NAME_BYTES} bytes"))),
            None => Err(self.error("has no name; give it one")),
        }
    }

    /// Finite numbers, as many as `count` allows, from the text of one of its attributes.
    pub fn parse(&self, attribute: &str, text: &str, count: RangeInclusive<usize>) -> Result<Vec<f64>> {
        let mut values = Vec::new();
        for word in text.split_ascii_whitespace() {
            let value: f64 =
                word.parse().map_err(|_| self.error(format!("{attribute}: \"{}\" is no number", brief(word))))?;
            if !value.is_finite() {
                return Err(self.error(format!("{attribute}: {value} is not finite; write a number")));
            }
            values.push(value);
            if values.len() > *count.end() {
                break;
            }
        }
        if !count.contains(&values.len()) {
            let (from, to) = (count.start(), count.end());
            let wanted = if from == to { to.to_string() } else { format!("{from} to {to}") };
            return Err(self.error(format!("{attribute}=\"{}\": expected {wanted} numbers", brief(text))));
        }
        Ok(values)
    }

    /// An attribute of `N` numbers.
    pub fn numbers<const N: usize>(&self, attribute: &str) -> Result<Option<[f64; N]>> {
        let Some(text) = self.get(attribute) else { return Ok(None) };
        let values = self.parse(attribute, text, N..=N)?;
        Ok(values.try_into().ok())
    }

    /// An attribute of one number.
    pub fn number(&self, attribute: &str) -> Result<Option<f64>> {
        Ok(self.numbers::<1>(attribute)?.map(|[value]| value))
    }
}

/// A file's text, without a byte order mark.
pub(super) fn read_text(path: &Path) -> Result<String> {
    let bytes = read_bytes(path, MAX_BYTES)?;
    let text = String::from_utf8(bytes).map_err(|e| {
        let place = format!("byte {}", e.utf8_error().valid_up_to());
        Error::format(path, place, "is not UTF-8 text; save the file as UTF-8")
    })?;
    Ok(text.strip_prefix('\u{feff}').map(str::to_owned).unwrap_or(text))
}

/// A regular file's bytes, unless there are too many.
pub(super) fn read_bytes(path: &Path, most: u64) -> Result<Vec<u8>> {
    let meta = std::fs::metadata(path).map_err(|e| Error::io(path, &e))?;
    if !meta.is_file() {
        return Err(Error::format(path, "file", "is not a regular file"));
    }
    let file = File::open(path).map_err(|e| Error::io(path, &e))?;
    let mut bytes = Vec::new();
    file.take(most + 1).read_to_end(&mut bytes).map_err(|e| Error::io(path, &e))?;
    if bytes.len() as u64 > most {
        return Err(Error::format(path, "size", format!("is above {} MiB, too large for a model", most >> 20)));
    }
    Ok(bytes)
}

/// Parses a whole document.
pub(super) fn parse(path: &Path, text: &str) -> Result<Element> {
    let file: Arc<Path> = Arc::from(path);
    let mut reader = Reader::from_str(text);
    let mut open: Vec<Element> = Vec::new();
    let mut root: Option<Element> = None;
    let (mut counted, mut line, mut elements) = (0usize, 1usize, 0usize);
    loop {
        let here = usize::try_from(reader.buffer_position()).unwrap_or(usize::MAX).min(text.len());
        line += text.as_bytes().get(counted..here).unwrap_or_default().iter().filter(|b| **b == b'\n').count();
        counted = here;
        let at = |message: String| Error::format(path, format!("line {line}"), message);
        let event = reader.read_event().map_err(|e| {
            at(format!("is not well-formed XML ({}); the file is broken or cut off", brief(&e.to_string())))
        })?;
        let done = match event {
            Event::Start(start) => {
                if open.len() >= MAX_DEPTH {
                    return Err(at(format!("elements nest deeper than {MAX_DEPTH}")));
                }
                open.push(element(&file, &start, line)?);
                elements += 1;
                None
            }
            Event::Empty(start) => {
                elements += 1;
                Some(element(&file, &start, line)?)
            }
            Event::End(_) => open.pop(),
            Event::DocType(declared) => {
                if declared.into_inner().contains('[') {
                    return Err(at(
                        "declares entities or a document type of its own; write the model without".to_owned()
                    ));
                }
                None
            }
            Event::Eof => break,
            _ => None,
        };
        if elements > MAX_ELEMENTS {
            return Err(at(format!("more than {MAX_ELEMENTS} elements")));
        }
        let Some(done) = done else { continue };
        match (open.last_mut(), root.is_some()) {
            (Some(parent), _) => parent.children.push(done),
            (None, false) => root = Some(done),
            (None, true) => return Err(at("a second outermost element; XML has one".to_owned())),
        }
    }
    if let Some(unfinished) = open.last() {
        return Err(unfinished.error("does not end: the file is cut off"));
    }
    root.ok_or_else(|| Error::format(path, "line 1", "holds no XML element; expected <robot> or <mujoco>"))
}

/// The outermost element's name.
pub(super) fn root_name(path: &Path, text: &str) -> Result<String> {
    let mut reader = Reader::from_str(text);
    loop {
        match reader.read_event() {
            Ok(Event::Start(start) | Event::Empty(start)) => return Ok(start.name().into_inner().to_owned()),
            Ok(Event::Eof) => return Err(Error::format(path, "line 1", "holds no XML element")),
            Ok(_) => {}
            Err(e) => return Err(Error::format(path, "line 1", format!("is not XML ({})", brief(&e.to_string())))),
        }
    }
}

fn element(file: &Arc<Path>, start: &BytesStart, line: usize) -> Result<Element> {
    let mut made = Element {
        name: start.name().into_inner().to_owned(),
        attributes: Vec::new(),
        children: Vec::new(),
        file: Arc::clone(file),
        line,
    };
    // The parser's own check for repeated attributes takes time that grows with the square of their number.
    for attribute in start.attributes().with_checks(false) {
        let read = attribute.map_err(|e| e.to_string()).and_then(|a| {
            let value = a.normalized_value(XmlVersion::Implicit1_0).map_err(|e| e.to_string())?;
            Ok((a.key.into_inner().to_owned(), value.into_owned()))
        });
        let (key, value) = read.map_err(|e| made.error(format!("an attribute cannot be read ({})", brief(&e))))?;
        if made.get(&key).is_some() {
            return Err(made.error(format!("attribute {} is there twice", brief(&key))));
        }
        made.attributes.push((key, value));
        if made.attributes.len() > MAX_ATTRIBUTES {
            return Err(made.error(format!("more than {MAX_ATTRIBUTES} attributes")));
        }
    }
    Ok(made)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parsed(text: &str) -> std::result::Result<Element, String> {
        parse(Path::new("m.xml"), text).map_err(|e| e.to_string())
    }

    #[test]
    fn elements_know_their_lines_and_numbers() {
        let root = parsed("<?xml version=\"1.0\"?>\n<a>\n  <b x='1 2.5' n=\"&lt;\"/>\n  <b/>text\n</a>").unwrap();
        let b = root.child("b").unwrap();
        assert_eq!((b.line, root.all("b").count(), b.get("n")), (3, 2, Some("<")));
        assert_eq!(b.numbers::<2>("x").unwrap(), Some([1.0, 2.5]));
        let error = b.numbers::<3>("x").unwrap_err().to_string();
        assert!(error.contains("m.xml: line 3, <b>: x=\"1 2.5\": expected 3 numbers"), "{error}");
    }

    #[test]
    fn hostile_documents_are_refused() {
        let deep = "<a>".repeat(100_000);
        let wide = format!("<a {}/>", (0..300).map(|i| format!("k{i}='1' ")).collect::<String>());
        for (text, word) in [
            ("", "no XML element"),
            ("<a><b></a>", "line 1"),
            ("<a>\n<b>\n", "line 2, <b>: does not end"),
            ("<a/><b/>", "second outermost"),
            ("<!DOCTYPE a [<!ENTITY x \"xxxx\">]><a/>", "entities"),
            ("<a b=\"&x;\"/>", "attribute cannot be read"),
            ("<a b='1' b='2'/>", "twice"),
            (deep.as_str(), "deeper than 200"),
            (wide.as_str(), "more than 256 attributes"),
        ] {
            let error = parsed(text).unwrap_err();
            assert!(error.contains(word), "{}: {error}", brief(text));
        }
        let nan = parsed("<a x='1 NaN 2'/>").unwrap().numbers::<3>("x").unwrap_err().to_string();
        assert!(nan.contains("<a>: x: NaN is not finite"), "{nan}");
    }
}
