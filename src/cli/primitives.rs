//! What lies beside a twin and tells its primitives their timing and how sure they are.

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::bail;

use super::shown;
use crate::evaluation::Predictions;
use crate::json;
use crate::make::JointHands;
use crate::primitives::Seen;

/// The recorded hands of a twin's folder; none where it has no recording.
pub fn hands_beside(dir: &Path) -> anyhow::Result<Vec<JointHands>> {
    let path = dir.join("trajectories.json");
    if !path.is_file() {
        return Ok(Vec::new());
    }
    let hands: Vec<JointHands> = json::read(&path)?;
    for (name, trajectory) in hands.iter().flat_map(|h| &h.clips) {
        if let Err(fault) = trajectory.check() {
            bail!("{}: clip {name}: {fault}", shown(&path));
        }
    }
    Ok(hands)
}

/// The predictions of a twin's folder; none where it has no recording.
pub fn rows_beside(dir: &Path) -> anyhow::Result<Predictions> {
    let path = dir.join("predictions.json");
    if !path.is_file() {
        return Ok(Predictions { predictions: Vec::new() });
    }
    Ok(Predictions::read(&path)?)
}

/// By joint: its hands, its verdict, and how sure its first clip's row says that it is.
pub fn seen<'a>(
    hands: &'a [JointHands],
    verdicts: &'a [(String, String)],
    rows: &'a Predictions,
) -> BTreeMap<&'a str, Seen<'a>> {
    let mut all: BTreeMap<&str, Seen> = BTreeMap::new();
    for joint in hands {
        let own = all.entry(joint.joint.as_str()).or_default();
        own.hands.extend(joint.clips.iter().map(|(name, trajectory)| (name.clone(), trajectory)));
    }
    for (joint, verdict) in verdicts {
        all.entry(joint.as_str()).or_default().verdict = Some(verdict.as_str());
    }
    for row in &rows.predictions {
        let (Some(joint), Some(uncertainty)) = (row.joint.as_deref(), row.uncertainty.as_ref()) else { continue };
        all.entry(joint).or_default().uncertainty.get_or_insert(uncertainty);
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_without_a_recording_tells_nothing_and_a_broken_hand_is_named() {
        let dir = tempfile::tempdir().unwrap();
        assert!(hands_beside(dir.path()).unwrap().is_empty());
        assert!(rows_beside(dir.path()).unwrap().predictions.is_empty());
        let text = r#"[{"joint": "door", "clips": [["a", {"side": null, "samples": [], "action": "open"}]]}]"#;
        std::fs::write(dir.path().join("trajectories.json"), text).unwrap();
        let error = hands_beside(dir.path()).unwrap_err().to_string();
        assert!(error.contains("trajectories.json: clip a: no samples"), "{error}");
    }

    #[test]
    fn a_verdict_alone_makes_an_entry() {
        let verdicts = [("door".to_owned(), "pass".to_owned())];
        let rows = Predictions { predictions: Vec::new() };
        let all = seen(&[], &verdicts, &rows);
        assert_eq!(all["door"].verdict, Some("pass"));
        assert!(all["door"].hands.is_empty() && all["door"].uncertainty.is_none());
    }
}
