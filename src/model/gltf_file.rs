//! A glTF file (`.glb`, `.gltf`) as JSON and buffers. Read here and not with a loader of meshes: such loaders refuse valid
//! files whose extensions they do not know, and all that is asked of a file is where its nodes are and how they move.
//!
//! Sizes are bounded before anything is allocated: a file can hold no more numbers than it has bytes.

use std::path::{Component, Path};

use base64::Engine;
use serde_json::Value;

use super::{kinds, xml};
use crate::error::{Error, Result};

/// Bytes of the file, and of all its buffers together: scenes of furniture are boxes, what is larger is none.
const MAX_BYTES: u64 = 256 << 20;
/// Values of the JSON, told from its commas; each takes some 30 times its bytes in memory.
const MAX_VALUES: usize = 4_000_000;

/// Keyframes of a channel: hours at sixty a second.
const MAX_ROWS: usize = 1_000_000;

/// A file that was read.
pub(super) struct GltfFile {
    /// The JSON part.
    pub json: Value,
    /// Each buffer's bytes, or why there are none.
    buffers: Vec<std::result::Result<Vec<u8>, Unavailable>>,
    /// Bytes behind the end that the header states.
    pub trailing: usize,
}

/// Why numbers are not there.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Unavailable {
    /// The file is wrong.
    Broken(String),
    /// The file may be right, but this is not read here.
    NotRead(String),
}

impl Unavailable {
    /// The same with what it is about before it.
    fn behind(&self, what: &str) -> Self {
        match self {
            Self::Broken(why) => Self::Broken(format!("{what} {why}")),
            Self::NotRead(why) => Self::NotRead(format!("{what} {why}")),
        }
    }
}

fn invalid(path: &Path, text: &str) -> Error {
    Error::format(path, "glTF", format!("is not valid ({text})"))
}

/// Reads a file, binary or text, whatever its name is.
///
/// # Errors
/// Where it cannot be read, is no glTF 2, or refers to what it does not have.
pub(super) fn open(path: &Path) -> Result<GltfFile> {
    let bytes = xml::read_bytes(path, MAX_BYTES)?;
    let (json, blob, trailing) = if bytes.starts_with(b"glTF") {
        chunks(path, &bytes)?
    } else if kinds::is_json(&bytes) {
        (bytes.as_slice(), None, 0)
    } else {
        let found = kinds::foreign(path, &bytes).unwrap_or_else(|| "begins neither as GLB nor as JSON".to_owned());
        return Err(Error::format(path, "glTF", format!("is not valid: it {found}; expected glTF 2 (.glb, .gltf)")));
    };
    if json.iter().filter(|b| **b == b',').count() > MAX_VALUES {
        return Err(invalid(path, "its JSON holds more values than a scene of furniture"));
    }
    let text = json.strip_prefix(b"\xef\xbb\xbf").unwrap_or(json);
    let json: Value = serde_json::from_slice(text).map_err(|e| invalid(path, &format!("its JSON: {e}")))?;
    match json["asset"]["version"].as_str() {
        Some(version) if version.starts_with("2.") => {}
        Some(version) => {
            let found = format!("its version is {}; version 2 is read, convert it", xml::brief(version));
            return Err(invalid(path, &found));
        }
        None => return Err(invalid(path, "it has no asset.version: this is no glTF")),
    }
    references(&json).map_err(|e| invalid(path, &e))?;
    let buffers = buffers(path, &json, blob);
    Ok(GltfFile { json, buffers, trailing })
}

fn word(bytes: &[u8], at: usize) -> Option<usize> {
    let four = bytes.get(at..at.checked_add(4)?)?.try_into().ok()?;
    usize::try_from(u32::from_le_bytes(four)).ok()
}

/// The JSON chunk, the binary one where there is one, and how many bytes follow the stated end.
type Chunks<'a> = (&'a [u8], Option<&'a [u8]>, usize);

/// The JSON chunk and the binary chunk of a GLB, and how many bytes follow its stated end.
fn chunks<'a>(path: &Path, bytes: &'a [u8]) -> Result<Chunks<'a>> {
    let cut = || invalid(path, "it is cut off");
    let (version, length) = (word(bytes, 4).ok_or_else(cut)?, word(bytes, 8).ok_or_else(cut)?);
    if version != 2 {
        return Err(invalid(path, &format!("its version is {version}; version 2 is read, convert it")));
    }
    if length < 20 {
        return Err(invalid(path, "its header states no length"));
    }
    let whole = bytes.get(..length).ok_or_else(|| {
        invalid(path, &format!("it is cut off: its header says {length} bytes, it has {}", bytes.len()))
    })?;
    let chunk = |at: usize| -> Option<(&'a [u8], &'a [u8])> {
        let begin = at.checked_add(8)?;
        Some((whole.get(at.checked_add(4)?..begin)?, whole.get(begin..begin.checked_add(word(whole, at)?)?)?))
    };
    let (kind, json) = chunk(12).ok_or_else(cut)?;
    if kind != b"JSON" {
        return Err(invalid(path, "its first chunk is not JSON"));
    }
    let next = 20 + json.len().next_multiple_of(4);
    let blob = if next + 8 <= whole.len() {
        let (kind, blob) = chunk(next).ok_or_else(cut)?;
        (kind == b"BIN\0").then_some(blob)
    } else {
        None
    };
    Ok((json, blob, bytes.len() - whole.len()))
}

/// The lists at the top of a file, and the keys whose numbers count in them.
const LISTS: [(&str, &[&str]); 13] = [
    ("nodes", &["nodes", "children", "node", "joints", "skeleton"]),
    ("scenes", &["scene"]),
    ("meshes", &["mesh"]),
    ("skins", &["skin"]),
    ("cameras", &["camera"]),
    ("accessors", &["indices", "input", "output", "attributes", "targets", "inverseBindMatrices"]),
    ("bufferViews", &["bufferView"]),
    ("buffers", &["buffer"]),
    ("materials", &["material"]),
    ("textures", &["index"]),
    ("images", &["source"]),
    ("samplers", &["sampler"]),
    ("animations", &[]),
];

/// Whether everything that is referred to is there; extensions have rules of their own.
fn references(json: &Value) -> std::result::Result<(), String> {
    for (list, _) in LISTS {
        if !(json[list].is_null() || json[list].is_array()) {
            return Err(format!("{list} is no list"));
        }
    }
    let Some(object) = json.as_object() else { return Err("it is no JSON object".to_owned()) };
    for (key, value) in object.iter().filter(|(k, _)| !["extensions", "extras", "asset"].contains(&k.as_str())) {
        if key == "scene" {
            refers(json, key, value, key, None)?;
            continue;
        }
        for (i, entry) in value.as_array().into_iter().flatten().enumerate() {
            // Samplers of an animation are its own.
            let own = (key == "animations").then(|| entry["samplers"].as_array().map_or(0, Vec::len));
            for (inner, value) in entry.as_object().into_iter().flatten() {
                refers(json, inner, value, &format!("{key} {i}"), own)?;
            }
        }
    }
    Ok(())
}

/// The same below one key; `own` is the number of samplers of the animation around it.
fn refers(json: &Value, key: &str, value: &Value, place: &str, own: Option<usize>) -> std::result::Result<(), String> {
    if ["extensions", "extras", "name", "weights"].contains(&key) {
        return Ok(());
    }
    match value {
        Value::Number(number) => {
            let Some((list, _)) = LISTS.iter().find(|(_, keys)| keys.contains(&key)) else { return Ok(()) };
            let there = match own.filter(|_| key == "sampler") {
                Some(own) => own,
                None => json[*list].as_array().map_or(0, Vec::len),
            };
            match number.as_u64().and_then(|n| usize::try_from(n).ok()) {
                Some(index) if index < there => Ok(()),
                _ => Err(format!("{place}: its {key} is {number}, there are {there} {list}")),
            }
        }
        Value::Array(values) => values.iter().try_for_each(|v| refers(json, key, v, place, own)),
        Value::Object(inner) => inner.iter().try_for_each(|(k, v)| {
            // What an attribute is called is free; its number is that of an accessor.
            let free = ["attributes", "targets"].contains(&key);
            refers(json, if free { key } else { k.as_str() }, v, place, own)
        }),
        _ => Ok(()),
    }
}

/// The bytes of all buffers, together never more than [`MAX_BYTES`]; `Err` says why a buffer has none.
fn buffers(path: &Path, json: &Value, blob: Option<&[u8]>) -> Vec<std::result::Result<Vec<u8>, Unavailable>> {
    let broken = |text: &str| Unavailable::Broken(text.to_owned());
    let mut left = MAX_BYTES;
    let mut out = Vec::new();
    for (i, buffer) in list(json, "buffers").iter().enumerate() {
        let stated = buffer["byteLength"].as_u64().unwrap_or(0);
        let bytes = match buffer["uri"].as_str() {
            Some(uri) => from_uri(path, uri, left),
            None if i == 0 => blob.map(<[u8]>::to_vec).ok_or_else(|| broken("has no uri, and the file no binary part")),
            None => Err(broken("has no uri")),
        };
        let bytes = bytes.and_then(|b| {
            let have = b.len() as u64;
            if have < stated { Err(broken(&format!("says {stated} bytes, there are {have}"))) } else { Ok(b) }
        });
        left = left.saturating_sub(bytes.as_ref().map_or(0, |b| b.len() as u64));
        out.push(bytes);
    }
    out
}

/// The bytes behind a data URI, or of a file in or below the model's folder.
fn from_uri(path: &Path, uri: &str, most: u64) -> std::result::Result<Vec<u8>, Unavailable> {
    let broken = Unavailable::Broken;
    if let Some(data) = uri.strip_prefix("data:") {
        let (kind, text) = data.split_once(',').ok_or_else(|| broken("has a data URI without data".to_owned()))?;
        if !kind.ends_with(";base64") {
            return Err(broken("has a data URI that is not base64".to_owned()));
        }
        // Four letters are three bytes.
        if text.len() as u64 / 4 * 3 > most {
            return Err(broken("is too large for a scene of furniture".to_owned()));
        }
        let decoded = base64::engine::general_purpose::STANDARD.decode(text.trim_end());
        return decoded.map_err(|e| broken(format!("has a data URI that is not base64 ({e})")));
    }
    let file = beside(path, uri)?;
    if !file.is_file() {
        return Err(broken(format!("is in {}, which is not there", xml::brief(uri))));
    }
    let bytes = xml::read_bytes(&file, most).map_err(|e| broken(e.to_string()))?;
    if kinds::is_pointer(&bytes) {
        return Err(broken(format!("is in {}, a Git LFS pointer; run `git lfs pull`", xml::brief(uri))));
    }
    Ok(bytes)
}

/// Where a URI of a file points: in or below the model's folder. What lies elsewhere is not looked at, though others may
/// load it.
fn beside(path: &Path, uri: &str) -> std::result::Result<std::path::PathBuf, Unavailable> {
    let relative = decoded(uri);
    if relative.is_empty() {
        return Err(Unavailable::Broken("has an empty uri".to_owned()));
    }
    let inside = Path::new(&relative).components().all(|c| matches!(c, Component::Normal(_) | Component::CurDir));
    if relative.contains("://") || !inside {
        let shown = xml::brief(uri);
        return Err(Unavailable::NotRead(format!(
            "is at {shown}; only files in and below the model's folder are looked at"
        )));
    }
    Ok(path.parent().unwrap_or(Path::new("")).join(relative))
}

/// A URI's `%20` and the like as characters.
fn decoded(uri: &str) -> String {
    let mut bytes = Vec::new();
    let mut rest = uri.as_bytes();
    while let Some((first, behind)) = rest.split_first() {
        let hex = behind.get(..2).and_then(|h| std::str::from_utf8(h).ok());
        match hex.and_then(|h| u8::from_str_radix(h, 16).ok()).filter(|_| *first == b'%') {
            Some(byte) => {
                bytes.push(byte);
                rest = behind.get(2..).unwrap_or_default();
            }
            None => {
                bytes.push(*first);
                rest = behind;
            }
        }
    }
    String::from_utf8_lossy(&bytes).into_owned()
}

/// A list below a key; empty where there is none.
pub(super) fn list<'a>(value: &'a Value, key: &str) -> &'a [Value] {
    value[key].as_array().map(Vec::as_slice).unwrap_or_default()
}

/// An index below a key.
pub(super) fn index(value: &Value, key: &str) -> Option<usize> {
    value[key].as_u64().and_then(|i| usize::try_from(i).ok())
}

/// `N` numbers below a key; `None` where there are not as many.
pub(super) fn row<const N: usize>(value: &Value, key: &str) -> Option<[f64; N]> {
    let numbers: Option<Vec<f64>> = list(value, key).iter().map(Value::as_f64).collect();
    numbers?.try_into().ok()
}

impl GltfFile {
    /// Why buffers and pictures have no bytes here: what is not there, or not looked at, each in words.
    pub fn missing(&self, path: &Path) -> Vec<Unavailable> {
        let buffers = self.buffers.iter().enumerate();
        let compressed = |i: usize| {
            // The bytes of such a buffer are those that an extension unpacks.
            list(&self.json, "buffers").get(i).is_some_and(|b| b["extensions"].is_object() && b["uri"].is_null())
        };
        let mut out: Vec<Unavailable> = buffers
            .filter(|(i, _)| !compressed(*i))
            .filter_map(|(i, b)| b.as_ref().err().map(|why| why.behind(&format!("buffer {i}"))))
            .collect();
        for (i, image) in list(&self.json, "images").iter().enumerate() {
            let Some(uri) = image["uri"].as_str().filter(|u| !u.starts_with("data:")) else { continue };
            match beside(path, uri) {
                Ok(file) if kinds::is_pointer(&kinds::head(&file)) => {
                    let shown = xml::brief(uri);
                    out.push(Unavailable::Broken(format!(
                        "image {i} is in {shown}, a Git LFS pointer; run `git lfs pull`"
                    )));
                }
                Ok(file) if file.is_file() => {}
                Ok(_) => {
                    out.push(Unavailable::Broken(format!("image {i} is in {}, which is not there", xml::brief(uri))))
                }
                Err(why) => out.push(why.behind(&format!("image {i}"))),
            }
        }
        out
    }

    /// Rows of `width` numbers of an accessor; integers must be normalised ones, and are shares then.
    pub fn rows(&self, accessor: usize, width: usize) -> std::result::Result<Vec<Vec<f64>>, Unavailable> {
        let broken = |text: &str| Unavailable::Broken(text.to_owned());
        let accessors = list(&self.json, "accessors");
        let accessor = accessors.get(accessor).ok_or_else(|| broken("its numbers are nowhere"))?;
        let fits = match accessor["type"].as_str() {
            Some("SCALAR") => 1,
            Some("VEC3") => 3,
            Some("VEC4") => 4,
            _ => 0,
        };
        let kind = accessor["componentType"].as_u64().unwrap_or(0);
        let size = match kind {
            FLOAT => 4,
            BYTE | UNSIGNED_BYTE => 1,
            SHORT | UNSIGNED_SHORT => 2,
            _ => 0,
        };
        let whole = kind != FLOAT && accessor["normalized"] != Value::Bool(true);
        if fits != width || size == 0 || whole {
            return Err(Unavailable::Broken(format!(
                "its numbers are neither floats nor normalised, {width} a keyframe"
            )));
        }
        if accessor["sparse"].is_object() {
            return Err(Unavailable::NotRead("its numbers are stored sparsely".to_owned()));
        }
        let count = index(accessor, "count").ok_or_else(|| broken("its numbers are not counted"))?;
        if count > MAX_ROWS && count <= self.size() {
            return Err(Unavailable::NotRead(format!("it has {count} keyframes, more than {MAX_ROWS}")));
        }
        let Some(view) = index(accessor, "bufferView").and_then(|v| list(&self.json, "bufferViews").get(v)) else {
            return Err(Unavailable::NotRead("its numbers are not stored in the file".to_owned()));
        };
        if let Some((extension, _)) = view["extensions"].as_object().and_then(|e| e.iter().next()) {
            return Err(Unavailable::NotRead(format!("its numbers are compressed with {}", xml::brief(extension))));
        }
        let bytes = self.view(view)?;
        let outside = || broken("its numbers lie outside the file");
        let row_bytes = size * width;
        let stride = index(view, "byteStride").unwrap_or(row_bytes);
        let first = index(accessor, "byteOffset").unwrap_or(0);
        // Rows that overlap would let a small file ask for a large memory.
        if stride < row_bytes {
            return Err(broken("its numbers overlap"));
        }
        let mut out = Vec::new();
        for i in 0..count {
            let start = i.checked_mul(stride).and_then(|s| s.checked_add(first)).ok_or_else(outside)?;
            let row = start.checked_add(row_bytes).and_then(|end| bytes.get(start..end)).ok_or_else(outside)?;
            let row: Vec<f64> = row.chunks_exact(size).map(|b| number(kind, b)).collect();
            if row.iter().any(|v| !v.is_finite()) {
                return Err(broken("a number is not finite"));
            }
            out.push(row);
        }
        Ok(out)
    }

    /// Bytes of all buffers.
    fn size(&self) -> usize {
        self.buffers.iter().map(|b| b.as_ref().map_or(0, Vec::len)).sum()
    }

    fn view(&self, view: &Value) -> std::result::Result<&[u8], Unavailable> {
        let outside = || Unavailable::Broken("its numbers lie outside the file".to_owned());
        let buffer = index(view, "buffer").and_then(|b| self.buffers.get(b)).ok_or_else(outside)?;
        let bytes = buffer.as_ref().map_err(|why| why.behind("the buffer of its numbers"))?;
        let start = index(view, "byteOffset").unwrap_or(0);
        let length = index(view, "byteLength").ok_or_else(outside)?;
        start.checked_add(length).and_then(|end| bytes.get(start..end)).ok_or_else(outside)
    }
}

const BYTE: u64 = 5120;
const UNSIGNED_BYTE: u64 = 5121;
const SHORT: u64 = 5122;
const UNSIGNED_SHORT: u64 = 5123;
const FLOAT: u64 = 5126;

/// One component; normalised integers as shares of their largest value.
fn number(kind: u64, bytes: &[u8]) -> f64 {
    match (kind, bytes) {
        (BYTE, [a]) => (f64::from(i8::from_le_bytes([*a])) / 127.0).max(-1.0),
        (UNSIGNED_BYTE, [a]) => f64::from(*a) / 255.0,
        (SHORT, [a, b]) => (f64::from(i16::from_le_bytes([*a, *b])) / 32767.0).max(-1.0),
        (UNSIGNED_SHORT, [a, b]) => f64::from(u16::from_le_bytes([*a, *b])) / 65535.0,
        (FLOAT, [a, b, c, d]) => f64::from(f32::from_le_bytes([*a, *b, *c, *d])),
        _ => f64::NAN,
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn what_is_referred_to_must_be_there() {
        let good = json!({"scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"children": [1]}, {"mesh": 0}],
            "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "_OWN": 0}, "material": 0}]}],
            "accessors": [{"min": [7.5], "sparse": {"count": 9, "indices": {"bufferView": 0}}}],
            "bufferViews": [{"buffer": 0, "byteOffset": 8}], "buffers": [{"byteLength": 64}],
            "materials": [{"extensions": {"X": {"index": 9}}}],
            "animations": [{"channels": [{"sampler": 0, "target": {"node": 1}}], "samplers": [{"input": 0, "output": 0}]}]});
        assert_eq!(references(&good), Ok(()));
        for (pointer, place) in [
            ("/nodes/0/children/0", "nodes 0: its children is 99, there are 2 nodes"),
            ("/meshes/0/primitives/0/attributes/_OWN", "there are 1 accessors"),
            ("/animations/0/channels/0/sampler", "there are 1 samplers"),
            ("/accessors/0/sparse/indices/bufferView", "there are 1 bufferViews"),
            ("/scene", "there are 1 scenes"),
        ] {
            let mut bad = good.clone();
            *bad.pointer_mut(pointer).unwrap() = json!(99);
            let error = references(&bad).unwrap_err();
            assert!(error.contains(place), "{pointer}: {error}");
        }
    }

    #[test]
    fn only_files_in_and_below_the_folder_are_read() {
        let at = |uri: &str| beside(Path::new("d/m.gltf"), uri);
        assert_eq!(at("a%20b/x.bin"), Ok(Path::new("d/a b/x.bin").to_owned()));
        for uri in ["../x.bin", "/etc/x", "https://a/x.bin", "a/%2e%2e/%2e%2e/x", ""] {
            assert!(at(uri).is_err(), "{uri}");
        }
    }

    #[test]
    fn normalised_integers_are_shares() {
        assert_eq!(number(SHORT, &32767i16.to_le_bytes()), 1.0);
        assert_eq!(number(BYTE, &[128]), -1.0);
        assert_eq!(number(UNSIGNED_SHORT, &[255, 255]), 1.0);
        assert_eq!(number(FLOAT, &0.5f32.to_le_bytes()), 0.5);
    }
}
