//! Hands23 (Cheng et al.): `result.json`, which hand touches what in each image; `masks/` beside it.
//!
//! Numbers are strings there. Only contact and the hands' pixels are taken: where joints are, other sources say.

use std::path::Path;

use serde::Deserialize;

use crate::error::{Error, Result};
use crate::import::ImportOptions;
use crate::import::blob::{Blob, inside};
use crate::import::capture::{At, Capture, ContactAt, Layer, MaskAt, Masks};
use crate::import::names::{ending, head, numbered, stem};
use crate::recording::{HAND_CLASS, Side};

/// States of a hand that holds or touches an object, itself or by a tool.
const TOUCHING: [&str; 2] = ["object_contact", "obj_to_obj_contact"];
const APART: [&str; 3] = ["no_contact", "self_contact", "other_person_contact"];

#[derive(Deserialize)]
struct Hands23File {
    images: Vec<Hands23Image>,
}

#[derive(Deserialize)]
struct Hands23Image {
    file_name: Name,
    #[serde(default)]
    predictions: Vec<Hands23Prediction>,
}

/// The image's name, or the number of a video's frame.
#[derive(Deserialize)]
#[serde(untagged)]
enum Name {
    Text(String),
    Number(usize),
}

#[derive(Deserialize)]
struct Hands23Prediction {
    hand_id: Option<serde_json::Value>,
    contact_state: String,
    hand_side: String,
}

fn file(path: &Path) -> std::path::PathBuf {
    if path.is_dir() { path.join("result.json") } else { path.to_owned() }
}

pub(super) fn detect(path: &Path) -> bool {
    let file = file(path);
    if !file.is_file() || ending(&file) != "json" {
        return false;
    }
    // The first hand may come late; an image without any has its key.
    let start = head(&file, 1 << 16);
    start.contains("\"contact_state\"") || (start.contains("\"images\"") && start.contains("\"predictions\""))
}

pub(super) fn read(path: &Path, _options: &ImportOptions) -> Result<Capture> {
    let file = file(path);
    let content: Hands23File = crate::json::read(&file)?;
    let root = file.parent().unwrap_or_else(|| Path::new("."));
    let mut capture = Capture {
        kind: "hands23".to_owned(),
        source: path.to_owned(),
        title: "Hands23 contact".to_owned(),
        ..Capture::default()
    };
    let mut masks = Vec::new();
    for image in &content.images {
        let (at, name) = place(&image.file_name);
        let mut layers = Vec::new();
        for hand in &image.predictions {
            let wrong = |key: &str, value: &str, expected: &str| {
                let value: String = value.chars().take(40).collect();
                Error::format(&file, format!("image {name}"), format!("{key} \"{value}\" is not known; {expected}"))
            };
            let side = match hand.hand_side.as_str() {
                "left_hand" | "left" => Side::Left,
                "right_hand" | "right" => Side::Right,
                other => return Err(wrong("hand_side", other, "left_hand or right_hand is")),
            };
            let state = hand.contact_state.as_str();
            let contact = TOUCHING.contains(&state);
            if !contact && !APART.contains(&state) {
                return Err(wrong("contact_state", state, "object_contact or no_contact is, for example"));
            }
            capture.contacts.push(ContactAt { at: at.clone(), side, contact });
            if let Some(blob) = mask(root, hand, &name)? {
                layers.push(Layer::Binary { class: HAND_CLASS, blob });
            }
        }
        if !layers.is_empty() {
            masks.push(MaskAt { at, layers });
        }
    }
    if capture.contacts.is_empty() {
        return Err(Error::format(&file, "images", "no hand is in any of them; nothing to import"));
    }
    if !masks.is_empty() {
        capture.masks = Some(Masks { items: masks, ..Masks::default() });
    }
    Ok(capture)
}

/// Where an image belongs, and its name without ending.
fn place(name: &Name) -> (At, String) {
    match name {
        Name::Number(index) => (At::index(*index), index.to_string()),
        Name::Text(text) => {
            let stem = stem(Path::new(text));
            let at = At::name(text);
            // A bare number is a frame of a video.
            match numbered(text) {
                Some(("", index)) => (at.with_index(index as usize), stem),
                _ => (at, stem),
            }
        }
    }
}

/// Pixels of a hand: `masks/2_{hand}_{image}.png`.
fn mask(root: &Path, hand: &Hands23Prediction, name: &str) -> Result<Option<Blob>> {
    let id = match &hand.hand_id {
        Some(serde_json::Value::Number(n)) => n.to_string(),
        Some(serde_json::Value::String(s)) => s.clone(),
        _ => return Ok(None),
    };
    Ok(inside(root, &format!("masks/2_{id}_{name}.png"))?.map(Blob::File))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read_text(text: &str) -> Result<Capture> {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("result.json");
        std::fs::write(&path, text).unwrap();
        assert!(detect(&path));
        read(&path, &ImportOptions::default())
    }

    #[test]
    fn states_become_contact_and_numbers_may_be_strings() {
        let capture = read_text(
            r#"{"save_dir": "x", "images": [
                {"file_name": "video/000004.jpg", "predictions": [
                    {"hand_id": 0, "hand_bbox": ["1.0", "2", "3", "4"], "contact_state": "object_contact",
                     "hand_side": "right_hand", "obj_bbox": null, "hand_pred_score": "1.0", "obj_pred_score": "None"},
                    {"hand_id": 1, "contact_state": "self_contact", "hand_side": "left_hand"}]},
                {"file_name": "7", "predictions": [{"contact_state": "no_contact", "hand_side": "right_hand"}]},
                {"file_name": "000008.jpg", "predictions": []}]}"#,
        )
        .unwrap();
        let told: Vec<(Option<&str>, Option<usize>, Side, bool)> =
            capture.contacts.iter().map(|c| (c.at.name.as_deref(), c.at.index, c.side, c.contact)).collect();
        assert_eq!(
            told,
            [
                (Some("000004"), None, Side::Right, true),
                (Some("000004"), None, Side::Left, false),
                (Some("7"), Some(7), Side::Right, false)
            ]
        );
    }

    #[test]
    fn what_is_not_known_is_named() {
        for (hand, word) in [
            (r#"{"contact_state": "portable", "hand_side": "left_hand"}"#, "contact_state \"portable\""),
            (r#"{"contact_state": "no_contact", "hand_side": "hand"}"#, "hand_side \"hand\""),
            (r#"{"hand_side": "left_hand", "contact_state": 3}"#, "contact_state"),
        ] {
            let text = format!(r#"{{"images": [{{"file_name": "a.jpg", "predictions": [{hand}]}}]}}"#);
            let error = read_text(&text).unwrap_err().to_string();
            assert!(error.contains(word) && error.contains("result.json"), "{error}");
        }
        let error = read_text(r#"{"images": [{"file_name": "a.jpg", "predictions": []}]}"#).unwrap_err().to_string();
        assert!(error.contains("no hand"), "{error}");
        assert!(read_text(r#"{"images": [{"file_name": "a", "predictions": [{"contact_state""#).is_err());
    }
}
