//! What a recording was made of and by, and under which licences: told to people on the twin's page, asked by no step.

use std::path::Path;

use serde_json::Value;

/// A source, or a network, of a recording.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize)]
pub struct Origin {
    /// The stream that a network made, or "source".
    pub what: String,
    /// The source's title, or the network's name.
    pub by: String,
    /// Its licence, where one is known.
    pub licence: String,
}

/// More is no list for people.
const MOST: usize = 40;
/// Longer texts are cut, letters.
const LONGEST: usize = 200;

/// What `import.json` in a recording's folder says; empty where there is none, or it says nothing of the kind.
#[must_use]
pub fn read(dir: &Path) -> Vec<Origin> {
    let Ok(told) = crate::json::read::<Value>(&dir.join("import.json")) else { return Vec::new() };
    let list = |key: &str| told.get(key).and_then(Value::as_array).into_iter().flatten();
    let text = |entry: &Value, key: &str| -> String {
        entry.get(key).and_then(Value::as_str).unwrap_or_default().chars().take(LONGEST).collect()
    };
    let sources = list("sources").map(|entry| Origin {
        what: "source".to_owned(),
        by: [text(entry, "title"), text(entry, "kind")].into_iter().find(|t| !t.is_empty()).unwrap_or_default(),
        licence: text(entry, "licence"),
    });
    let made = list("perceived").map(|entry| {
        let (adapter, kind) = (text(entry, "adapter"), text(entry, "kind"));
        Origin {
            what: text(entry, "stream"),
            by: if kind.is_empty() { adapter } else { format!("{adapter} ({kind})") },
            licence: text(entry, "licence"),
        }
    });
    sources.chain(made).filter(|origin| !origin.by.is_empty()).take(MOST).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sources_and_networks_are_told_with_their_licences_and_rubbish_is_not() {
        let dir = tempfile::tempdir().unwrap();
        assert!(read(dir.path()).is_empty());
        let path = dir.path().join("import.json");
        std::fs::write(
            &path,
            r#"{"sources": [{"kind": "stray", "title": "Stray Scanner", "licence": null}, 7],
                "perceived": [{"stream": "depth", "adapter": "transformers-depth", "kind": "depth_pro", "licence": "apple-amlr"},
                              {"stream": "hands", "adapter": "wilor", "licence": "CC BY-NC-ND 4.0"}]}"#,
        )
        .unwrap();
        let told: Vec<[String; 3]> = read(dir.path()).into_iter().map(|o| [o.what, o.by, o.licence]).collect();
        assert_eq!(
            told,
            [
                ["source", "Stray Scanner", ""],
                ["depth", "transformers-depth (depth_pro)", "apple-amlr"],
                ["hands", "wilor", "CC BY-NC-ND 4.0"]
            ]
        );
        std::fs::write(&path, "{").unwrap();
        assert!(read(dir.path()).is_empty());
    }
}
