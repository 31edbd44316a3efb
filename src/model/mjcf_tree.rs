//! The whole tree of an MJCF: with the files that it includes, and the copies that it asks for.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::mjcf_context::Context;
use super::mjcf_schema::place;
use super::xml::{self, Element, brief};
use crate::error::{Error, Result};
use crate::math::Vector;

/// Nobody nests deeper; loops end sooner, as no file is included twice.
const MAX_INCLUDES: usize = 32;
/// Elements and attributes; of elements alone, as many as a file may have itself.
const MAX_COPIES: usize = 1_000_000;

/// Files that other files include. They are read wherever MuJoCo reads them, folders above the model's included.
pub(super) struct Includes<'a> {
    /// The model's own file.
    pub(super) model: &'a Path,
    /// Each file once, as MuJoCo has it.
    pub(super) read: BTreeSet<PathBuf>,
    /// What is included and is not there, in words.
    pub(super) missing: Vec<String>,
}

impl Includes<'_> {
    /// Puts the contents of included files in the place of their `<include>`.
    pub(super) fn expand(&mut self, element: &mut Element, depth: usize) -> Result<()> {
        if !element.children.iter().any(|c| c.name == "include") {
            return element.children.iter_mut().try_for_each(|c| self.expand(c, depth));
        }
        for mut child in std::mem::take(&mut element.children) {
            if child.name != "include" {
                self.expand(&mut child, depth)?;
                element.children.push(child);
                continue;
            }
            let file = child.get("file").ok_or_else(|| child.error("has no file"))?;
            if depth >= MAX_INCLUDES {
                return Err(child.error(format!("files include each other deeper than {MAX_INCLUDES}")));
            }
            let Some(found) = self.find(&child, file) else {
                let at = place(self.model, &child);
                self.missing.push(format!("{at}: includes {}, which is not there", brief(file)));
                continue;
            };
            let real = found.canonicalize().map_err(|e| Error::io(&found, &e))?;
            if !self.read.insert(real) {
                return Err(child.error(format!("includes {} a second time", brief(file))));
            }
            let mut root = xml::parse(&found, &xml::read_text(&found)?)?;
            self.expand(&mut root, depth + 1)?;
            element.children.append(&mut root.children);
        }
        Ok(())
    }

    /// MuJoCo looks beside the model first, then beside the file that includes.
    fn find(&self, include: &Element, file: &str) -> Option<PathBuf> {
        let file = file.replace('\\', "/");
        let beside = |p: &Path| p.parent().unwrap_or(Path::new("")).join(&file);
        [beside(self.model), beside(&include.file)].into_iter().find(|p| p.is_file())
    }
}

/// The copies that `<replicate>` made: from a name to those of its copies.
#[derive(Default)]
pub(super) struct Copies {
    names: BTreeMap<String, Vec<String>>,
    elements: usize,
}

impl Copies {
    /// Puts frames with copies in the place of every `<replicate>`.
    pub(super) fn expand(&mut self, c: &Context, element: &mut Element) -> Result<()> {
        for mut child in std::mem::take(&mut element.children) {
            self.expand(c, &mut child)?;
            if child.name == "replicate" {
                self.copy(c, &child, &mut element.children)?;
            } else {
                element.children.push(child);
            }
        }
        Ok(())
    }

    /// What a name has become: the names of its copies, else itself. Each once, however often a file gives one name.
    pub(super) fn of(&self, name: &str) -> Vec<String> {
        let (mut out, mut seen, mut open) = (Vec::new(), BTreeSet::new(), vec![name]);
        while let Some(name) = open.pop() {
            if !seen.insert(name) {
                continue;
            }
            match self.names.get(name) {
                Some(copies) => open.extend(copies.iter().rev().map(String::as_str)),
                None => out.push(name.to_owned()),
            }
        }
        out
    }

    /// Whether something of this name was copied.
    pub(super) fn has(&self, name: &str) -> bool {
        self.names.contains_key(name)
    }

    fn copy(&mut self, c: &Context, replicate: &Element, out: &mut Vec<Element>) -> Result<()> {
        let count = replicate.number("count")?.unwrap_or(0.0);
        let offset = replicate.numbers::<3>("offset")?.map_or(Vector::zeros(), Vector::from);
        let euler = replicate.numbers::<3>("euler")?.unwrap_or_default();
        // A count is a whole number; what is too large is refused before anything is copied.
        let count = if count >= 1.0 { count.min(MAX_COPIES as f64) as usize } else { 0 };
        self.elements = self.elements.saturating_add(count.saturating_mul(size(replicate)));
        if self.elements > MAX_COPIES {
            return Err(replicate.error(format!("makes more than {MAX_COPIES} elements and attributes")));
        }
        let separator = replicate.get("sep").unwrap_or_default();
        let digits = count.to_string().len();
        let mut names = BTreeSet::new();
        replicate.children.iter().for_each(|e| names_in(e, &mut names));
        let mut at = Vector::zeros();
        for i in 0..count {
            let turn = c.turn(&euler.map(|e| e * i as f64));
            let suffix = format!("{separator}{i:0digits$}");
            let mut children = replicate.children.clone();
            children.iter_mut().for_each(|e| rename(e, &names, &suffix));
            for name in &names {
                self.names.entry(name.clone()).or_default().push(format!("{name}{suffix}"));
            }
            let q = turn.quaternion();
            let mut attributes = vec![
                ("pos".to_owned(), format!("{} {} {}", at.x, at.y, at.z)),
                ("quat".to_owned(), format!("{} {} {} {}", q.w, q.i, q.j, q.k)),
            ];
            attributes.extend(replicate.get("childclass").map(|c| ("childclass".to_owned(), c.to_owned())));
            let (file, line) = (Arc::clone(&replicate.file), replicate.line);
            out.push(Element { name: "frame".to_owned(), attributes, children, file, line });
            at += turn * offset;
        }
        Ok(())
    }
}

/// What a copy of an element costs, itself included: its elements and attributes, long ones (64 bytes each) counting more.
fn size(element: &Element) -> usize {
    let own: usize = element.attributes.iter().map(|(key, value)| 1 + (key.len() + value.len()) / 64).sum();
    element.children.iter().map(size).fold(1 + own, usize::saturating_add)
}

fn names_in(element: &Element, names: &mut BTreeSet<String>) {
    names.extend(element.get("name").map(str::to_owned));
    element.children.iter().for_each(|c| names_in(c, names));
}

/// Gives an element and all in it, and what they look at, the suffix of their copy.
fn rename(element: &mut Element, names: &BTreeSet<String>, suffix: &str) {
    for (key, value) in &mut element.attributes {
        if key == "name" || (key == "target" && names.contains(value.as_str())) {
            value.push_str(suffix);
        }
    }
    element.children.iter_mut().for_each(|c| rename(c, names, suffix));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_that_many_copies_share_are_followed_once() {
        let name = |depth: usize| format!("a{}", "0".repeat(depth));
        let names = (0..40).map(|depth| (name(depth), vec![name(depth + 1); 9])).collect();
        let copies = Copies { names, elements: 0 };
        assert_eq!(copies.of("a"), [name(40)]);
        assert_eq!(copies.of("b"), ["b"]);
    }

    #[test]
    fn attributes_and_long_values_count_where_copies_are_made() {
        let text = format!("<mujoco><geom a='1' b='{}'/></mujoco>", "x".repeat(6400));
        let root = xml::parse(Path::new("m.xml"), &text).unwrap();
        assert_eq!(size(&root), 1 + 1 + 1 + 101);
    }
}
