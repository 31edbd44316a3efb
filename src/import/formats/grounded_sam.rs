//! Grounded-SAM-2: `..._results.json`, one file an image, masks as COCO's compressed runs; a file or a folder of them.
//!
//! Classes are numbered from 1 by the order of their names; hands have the class of a recording's hands.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use serde::Deserialize;

use crate::error::{Error, Result};
use crate::import::ImportOptions;
use crate::import::blob::files;
use crate::import::capture::{At, Capture, Layer, MaskAt, Masks};
use crate::import::names::{ending, head, stem};
use crate::recording::HAND_CLASS;

#[derive(Deserialize)]
struct GroundedSamFile {
    image_path: Option<String>,
    annotations: Vec<MaskAnnotation>,
}

#[derive(Deserialize)]
struct MaskAnnotation {
    class_name: String,
    segmentation: Segmentation,
    score: Option<Score>,
}

#[derive(Deserialize)]
struct Segmentation {
    /// Rows, columns.
    size: [usize; 2],
    counts: Counts,
}

/// Runs as text, or as numbers.
#[derive(Deserialize)]
#[serde(untagged)]
enum Counts {
    Text(String),
    Numbers(Vec<u32>),
}

/// A number, or a list of one.
#[derive(Deserialize)]
#[serde(untagged)]
enum Score {
    One(f64),
    List(Vec<f64>),
}

impl MaskAnnotation {
    fn score(&self) -> f64 {
        match &self.score {
            Some(Score::One(score)) => *score,
            Some(Score::List(list)) => list.first().copied().unwrap_or(0.0),
            None => 0.0,
        }
    }

    /// What was asked for, as people write it.
    fn class(&self) -> String {
        self.class_name.trim().trim_end_matches('.').trim().to_lowercase()
    }
}

fn is_one(path: &Path) -> bool {
    let start = head(path, 1 << 16);
    let has = |key: &str| start.contains(key);
    ending(path) == "json" && (has("\"box_format\"") || (has("\"annotations\"") && has("\"segmentation\"")))
}

pub(super) fn detect(path: &Path) -> bool {
    if path.is_file() {
        return is_one(path);
    }
    files(path, &["json"]).first().is_some_and(|f| is_one(f))
}

pub(super) fn read(path: &Path, _options: &ImportOptions) -> Result<Capture> {
    let found: Vec<PathBuf> = if path.is_file() {
        vec![path.to_owned()]
    } else {
        files(path, &["json"]).into_iter().filter(|f| is_one(f)).collect()
    };
    let (mut contents, mut notes, mut first) = (Vec::new(), Vec::new(), None);
    for file in &found {
        match crate::json::read::<GroundedSamFile>(file) {
            Ok(content) => contents.push((file, content)),
            // One bad file costs its image.
            Err(error) => {
                notes.push(format!("left out: {error}"));
                first.get_or_insert(error);
            }
        }
    }
    if contents.is_empty() {
        return Err(first.unwrap_or_else(|| Error::Io {
            path: path.to_owned(),
            message: "holds no ..._results.json of Grounded-SAM-2".to_owned(),
        }));
    }
    let classes = classes(contents.iter().flat_map(|(_, c)| &c.annotations));
    let mut items = Vec::with_capacity(contents.len());
    for (file, content) in &contents {
        items.push(MaskAt { at: place(file, content), layers: layers(file, content, &classes, &mut notes) });
    }
    let labels = classes.into_iter().map(|(name, class)| (class, name)).collect();
    Ok(Capture {
        kind: "grounded-sam".to_owned(),
        source: path.to_owned(),
        title: "Grounded-SAM-2 masks".to_owned(),
        notes,
        masks: Some(Masks { labels, items }),
        ..Capture::default()
    })
}

/// Numbers of the classes; of more than fit in a mask the first ones by name.
fn classes<'a>(annotations: impl Iterator<Item = &'a MaskAnnotation>) -> BTreeMap<String, u8> {
    let names: BTreeSet<String> = annotations.map(MaskAnnotation::class).filter(|n| !n.is_empty()).collect();
    let (hands, others): (Vec<String>, Vec<String>) = names.into_iter().partition(|n| is_hand(n));
    let mut out: BTreeMap<String, u8> = others.into_iter().zip(1..HAND_CLASS).collect();
    // A class has one name in a recording: the last of several is told.
    out.extend(hands.into_iter().map(|n| (n, HAND_CLASS)));
    out
}

fn is_hand(name: &str) -> bool {
    name.split_whitespace().any(|word| ["hand", "hands", "arm", "arms"].contains(&word))
}

/// The image: by its path in the file, else by the file's name.
fn place(file: &Path, content: &GroundedSamFile) -> At {
    match &content.image_path {
        Some(image) => At::name(image),
        None => {
            let stem = stem(file);
            At { name: Some(stem.strip_suffix("_results").unwrap_or(&stem).to_owned()), ..At::default() }
        }
    }
}

/// The masks of an image, the surest on top, hands over all.
fn layers(
    file: &Path,
    content: &GroundedSamFile,
    classes: &BTreeMap<String, u8>,
    notes: &mut Vec<String>,
) -> Vec<Layer> {
    let mut order: Vec<&MaskAnnotation> = content.annotations.iter().collect();
    order.sort_by(|a, b| a.score().total_cmp(&b.score()));
    order.sort_by_key(|a| is_hand(&a.class()));
    let mut out = Vec::new();
    for annotation in order {
        let Some(class) = classes.get(&annotation.class()).copied() else { continue };
        let [height, width] = annotation.segmentation.size;
        let runs = match &annotation.segmentation.counts {
            Counts::Numbers(runs) => Some(runs.clone()),
            Counts::Text(text) => runs(text),
        };
        let total = runs.as_ref().map(|r| r.iter().map(|n| u64::from(*n)).sum::<u64>());
        match runs {
            Some(runs) if total == Some((width as u64).saturating_mul(height as u64)) => {
                out.push(Layer::Runs { class, width, height, runs: runs.into() });
            }
            _ => notes.push(format!(
                "{}: a mask of \"{}\" is left out: its runs do not fill {width} x {height} pixels",
                file.display(),
                annotation.class().chars().take(40).collect::<String>()
            )),
        }
    }
    out
}

/// Lengths of runs from COCO's text: five bits a letter from "0" on, the sixth says that more follow, the last letter's fifth is
/// the sign; from the third run on each is written as the difference to the one before the last. `None` for other text.
fn runs(text: &str) -> Option<Vec<u32>> {
    let mut out: Vec<i64> = Vec::new();
    let mut bytes = text.bytes();
    while let Some(mut byte) = bytes.next() {
        let (mut value, mut shift) = (0i64, 0u32);
        loop {
            let bits = i64::from(byte.checked_sub(48).filter(|b| *b < 64)?);
            // A length of an image never needs more.
            if shift > 40 {
                return None;
            }
            value |= (bits & 0x1f) << shift;
            shift += 5;
            if bits & 0x20 == 0 {
                if bits & 0x10 != 0 {
                    value |= -1i64 << shift;
                }
                break;
            }
            byte = bytes.next()?;
        }
        // The first difference is of the fourth run to the second.
        if out.len() > 2 {
            value += out.get(out.len() - 2).copied().unwrap_or(0);
        }
        if !(0..=i64::from(u32::MAX)).contains(&value) {
            return None;
        }
        out.push(value);
    }
    out.into_iter().map(|v| u32::try_from(v).ok()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Text as pycocotools 2.0 writes it of a mask of 6 rows and 5 columns.
    #[test]
    fn runs_are_read_as_coco_writes_them() {
        assert_eq!(runs("7383JK1"), Some(vec![7, 3, 8, 6, 2, 1, 3]));
        assert_eq!(runs(""), Some(Vec::new()));
        for broken in ["o", " ", "\u{e9}", "oooooooooooo0"] {
            assert_eq!(runs(broken), None, "{broken}");
        }
    }

    #[test]
    fn classes_have_numbers_by_name_and_hands_their_own() {
        let of = |name: &str| MaskAnnotation {
            class_name: name.to_owned(),
            segmentation: Segmentation { size: [1, 1], counts: Counts::Numbers(vec![1]) },
            score: None,
        };
        let all = [of("Drawer."), of("cupboard door"), of("left hand"), of("drawer")];
        let classes = classes(all.iter());
        let told: Vec<(&str, u8)> = classes.iter().map(|(n, c)| (n.as_str(), *c)).collect();
        assert_eq!(told, [("cupboard door", 1), ("drawer", 2), ("left hand", 255)]);
    }
}
