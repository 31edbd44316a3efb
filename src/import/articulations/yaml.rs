//! As much YAML as lists of names and words need: maps and lists by indentation, `[a, b]`, `{a: b}`, comments, quotes.

use std::path::Path;

use crate::error::{Error, Result};
use crate::import::blob::Blob;

/// Deeper files are none of ours.
const MAX_DEPTH: usize = 32;

/// A value.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Yaml {
    Text(String),
    List(Vec<Yaml>),
    Map(Vec<(String, Yaml)>),
}

impl Yaml {
    /// The text of a value that is one.
    pub(super) fn text(&self) -> Option<&str> {
        match self {
            Self::Text(text) => Some(text),
            _ => None,
        }
    }

    /// The first value with a key, at any depth.
    pub(super) fn find(&self, key: &str) -> Option<&Self> {
        self.first(&|k| k == key)
    }

    /// The first value whose key contains a word.
    pub(super) fn find_like(&self, word: &str) -> Option<&Self> {
        self.first(&|k| k.to_lowercase().contains(word))
    }

    fn first(&self, fits: &dyn Fn(&str) -> bool) -> Option<&Self> {
        match self {
            Self::Text(_) => None,
            Self::List(all) => all.iter().find_map(|v| v.first(fits)),
            Self::Map(all) => all
                .iter()
                .find(|(k, _)| fits(k))
                .map(|(_, v)| v)
                .or_else(|| all.iter().find_map(|(_, v)| v.first(fits))),
        }
    }
}

/// A line: its depth in spaces, what follows.
struct YamlLine {
    depth: usize,
    text: String,
}

/// Reads a file.
///
/// # Errors
/// Where it cannot be read, is deeper than lists of names are, or a line is neither an entry of a map nor of a list.
pub(super) fn read(path: &Path) -> Result<Yaml> {
    let blob = Blob::File(path.to_owned());
    let text = String::from_utf8(blob.read()?).map_err(|_| blob.fault("is not UTF-8 text"))?;
    let lines: Vec<YamlLine> = text.lines().filter_map(line).collect();
    let mut next = 0;
    let value = block(&lines, &mut next, 0, 0);
    match lines.get(next) {
        None => Ok(value),
        Some(left) => {
            let place = format!("\"{}\"", left.text.chars().take(40).collect::<String>());
            Err(Error::format(path, place, "is neither \"key: value\" nor \"- value\" in its place"))
        }
    }
}

/// A line without its comment; `None` where nothing is left.
fn line(raw: &str) -> Option<YamlLine> {
    let text = raw.trim_end();
    let content = text.trim_start_matches(' ');
    let depth = text.len() - content.len();
    let content = if content.starts_with('#') { "" } else { content.split(" #").next().unwrap_or_default().trim_end() };
    (!content.is_empty() && content != "---").then(|| YamlLine { depth, text: content.to_owned() })
}

/// The lines from `next` on that stand at least at `depth`.
fn block(lines: &[YamlLine], next: &mut usize, depth: usize, level: usize) -> Yaml {
    let Some(first) = lines.get(*next).filter(|l| l.depth >= depth && level < MAX_DEPTH) else {
        return Yaml::Text(String::new());
    };
    let own = first.depth;
    let mut items = Vec::new();
    let mut entries = Vec::new();
    while let Some(line) = lines.get(*next).filter(|l| l.depth == own) {
        if line.text == "-" || line.text.starts_with("- ") {
            if !entries.is_empty() {
                break;
            }
            *next += 1;
            items.push(item(lines, next, own, line.text.trim_start_matches('-').trim_start(), level));
        } else if let Some((key, rest)) = entry(&line.text).filter(|_| items.is_empty()) {
            *next += 1;
            let value = if rest.is_empty() { below(lines, next, own, level) } else { flow(rest) };
            entries.push((key, value));
        } else {
            break;
        }
    }
    if items.is_empty() { Yaml::Map(entries) } else { Yaml::List(items) }
}

/// What stands deeper than a key; a list may stand as deep as its key.
fn below(lines: &[YamlLine], next: &mut usize, own: usize, level: usize) -> Yaml {
    let depth = match lines.get(*next) {
        Some(line) if line.depth == own && line.text.starts_with('-') => own,
        _ => own + 1,
    };
    block(lines, next, depth, level + 1)
}

/// An item of a list: a value, or the first entry of a map whose others follow deeper.
fn item(lines: &[YamlLine], next: &mut usize, own: usize, text: &str, level: usize) -> Yaml {
    let Some((key, rest)) = entry(text) else {
        return if text.is_empty() { block(lines, next, own + 1, level + 1) } else { flow(text) };
    };
    let value = if rest.is_empty() { Yaml::Text(String::new()) } else { flow(rest) };
    let mut all = vec![(key, value)];
    if let Yaml::Map(others) = block(lines, next, own + 1, level + 1) {
        all.extend(others);
    }
    Yaml::Map(all)
}

/// `key: value`, with or without the value.
fn entry(text: &str) -> Option<(String, &str)> {
    if text.starts_with(['{', '[']) {
        return None;
    }
    let (key, rest) = text.split_once(": ").or_else(|| text.strip_suffix(':').map(|key| (key, "")))?;
    Some((unquoted(key), rest.trim()))
}

/// `[a, b]`, `{a: b, c: d}` (one level), or a word.
fn flow(text: &str) -> Yaml {
    let inside = |open: char, close: char| text.strip_prefix(open).and_then(|t| t.strip_suffix(close));
    let words = |inner: &str| -> Vec<String> {
        inner.split(',').map(|w| w.trim().to_owned()).filter(|w| !w.is_empty()).collect()
    };
    if let Some(inner) = inside('[', ']') {
        return Yaml::List(words(inner).iter().map(|w| Yaml::Text(unquoted(w))).collect());
    }
    if let Some(inner) = inside('{', '}') {
        let all = words(inner);
        return Yaml::Map(all.iter().filter_map(|w| entry(w)).map(|(k, v)| (k, Yaml::Text(unquoted(v)))).collect());
    }
    Yaml::Text(unquoted(text))
}

fn unquoted(text: &str) -> String {
    let text = text.trim();
    let inner = |quote: char| text.strip_prefix(quote).and_then(|t| t.strip_suffix(quote));
    inner('"').or_else(|| inner('\'')).unwrap_or(text).to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parsed(text: &str) -> Yaml {
        let lines: Vec<YamlLine> = text.lines().filter_map(line).collect();
        block(&lines, &mut 0, 0, 0)
    }

    #[test]
    fn maps_lists_and_flow_are_read() {
        let yaml = parsed(
            "# types\ndin080:\n  seq_1:\n    difficulty: easy # of three\n    axis_types: [revolute, 'prismatic']\n  seq_2:\n    objects:\n    - name: door\n      type: revolute\n    - drawer\nrh078: {a: b}\n",
        );
        let types = yaml.find("seq_1").and_then(|s| s.find_like("type"));
        assert_eq!(types, Some(&Yaml::List(vec![Yaml::Text("revolute".into()), Yaml::Text("prismatic".into())])));
        let Some(Yaml::List(objects)) = yaml.find("objects") else { unreachable!("{yaml:?}") };
        assert_eq!(objects[0].find("type").and_then(Yaml::text), Some("revolute"));
        assert_eq!(objects[1].text(), Some("drawer"));
        assert_eq!(yaml.find("rh078").and_then(|r| r.find("a")).and_then(Yaml::text), Some("b"));
    }
}
