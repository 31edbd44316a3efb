//! `paws evaluate` where the truth is joints of a data set instead of recordings.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use anyhow::bail;
use serde_json::Value;

use super::joints::{self, JointArgs};
use super::shown;
use crate::evaluation::point_parts::{PartReport, compare_parts};
use crate::evaluation::{EvaluationReport, Predictions, Truth, evaluate, scenes};
use crate::import::articulations::shape::PartBox;
use crate::import::articulations::{self, FoundJoint, JointScene};
use crate::json;
use crate::math::Vector;

/// The overlaps that USDNet's tables have.
const OVERLAPS: [f64; 2] = [0.5, 0.25];

/// Whether a truth is joints of a data set, and no recording.
pub fn is_scene(path: &Path) -> bool {
    joints::is_model(path) || (!path.join("ground_truth.json").exists() && articulations::holds(path))
}

/// What came of comparing joints.
pub struct Compared {
    /// By the rules, one "clip" a joint.
    pub report: EvaluationReport,
    /// By the points of parts, where both sides have them.
    pub parts: Vec<PartReport>,
}

/// Compares files of joints with files of true joints, in their order.
pub fn run(predictions: &[PathBuf], truths: &[PathBuf], args: &JointArgs) -> anyhow::Result<Compared> {
    if predictions.len() != truths.len() {
        bail!(
            "{} predictions for {} truths: joints of data sets are compared file by file, in order; name as many of both \
             (--truth FILE...)",
            predictions.len(),
            truths.len()
        );
    }
    let mut rows = Predictions::default();
    let mut all: Vec<Truth> = Vec::new();
    let mut pairs: Vec<(JointScene, JointScene)> = Vec::new();
    let mut names = BTreeSet::new();
    for (prediction, truth_file) in predictions.iter().zip(truths) {
        let mut truth = args.read(truth_file)?;
        for left in &truth.left_out {
            eprintln!("{}: {}: is left out of the truth: {}", shown(truth_file), left.place, left.reason);
        }
        if !names.insert(truth.name.clone()) {
            truth.name = format!("{} ({})", truth.name, names.len() + 1);
            names.insert(truth.name.clone());
        }
        let predicted = predicted(prediction, &truth, args)?;
        for left in &predicted.left_out {
            eprintln!("{}: {}: is no answer: {}", shown(prediction), left.place, left.reason);
        }
        let (answers, clips, pairing) = scenes::rows(&predicted, &truth);
        tell(prediction, truth_file, &predicted, &truth, &pairing.extra);
        rows.predictions.extend(answers);
        all.push(clips);
        pairs.push((predicted, truth));
    }
    let report = evaluate(&rows, &all);
    let both: Vec<(&JointScene, &JointScene)> = pairs.iter().map(|(p, t)| (p, t)).collect();
    let counted = pairs.iter().any(|(p, _)| p.joints.iter().any(|j| j.points.is_some()));
    let parts = OVERLAPS.into_iter().filter(|_| counted).filter_map(|iou| compare_parts(&both, iou)).collect();
    Ok(Compared { report, parts })
}

/// Tells how joints were paired, and which rules the truth cannot serve.
fn tell(prediction: &Path, truth_file: &Path, predicted: &JointScene, truth: &JointScene, extra: &[usize]) {
    let lists = |scene: &JointScene| scene.joints.iter().all(|j| j.points.is_some());
    let by = if lists(predicted) && lists(truth) {
        "by the points that parts share"
    } else {
        "by the nearest part, handle or line within a metre"
    };
    let ids: Vec<&str> = extra.iter().filter_map(|i| predicted.joints.get(*i)).map(|j| j.id.as_str()).collect();
    eprintln!(
        "{}: {} of {} joints are paired with {} true ones, {by}{}{}",
        shown(prediction),
        predicted.joints.len() - ids.len(),
        predicted.joints.len(),
        truth.joints.len(),
        if ids.is_empty() { "" } else { "; with none: " },
        ids.join(", ")
    );
    let without = |has: fn(&FoundJoint) -> bool| truth.joints.iter().filter(|j| !has(j)).count();
    for (count, what, rules) in [
        (without(|j| j.part.is_some()), "box of the part", "OPDMulti and S2O"),
        (without(|j| j.range.is_some()), "range", "SIM"),
    ] {
        if count > 0 {
            eprintln!(
                "{}: {count} joints have no {what}, which {rules} ask for and count as wrong (slides need no box)",
                shown(truth_file)
            );
        }
    }
}

/// The predicted joints of a file: of any format of joints, or of our `predictions.json`.
fn predicted(path: &Path, truth: &JointScene, args: &JointArgs) -> anyhow::Result<JointScene> {
    let file = match path.join("twin.json") {
        twin if path.is_dir() && twin.exists() => twin,
        _ => path.to_owned(),
    };
    let is_rows =
        file.is_file() && !joints::is_model(&file) && json::read::<Value>(&file)?.get("predictions").is_some();
    if is_rows { from_rows(&file, truth) } else { args.of_prediction().read(&file) }
}

/// Rows about clips as joints: of each joint the first row.
fn from_rows(file: &Path, truth: &JointScene) -> anyhow::Result<JointScene> {
    let rows = Predictions::read(file)?.predictions;
    let recordings: BTreeSet<&str> = rows.iter().map(|r| r.recording.as_str()).collect();
    if recordings.len() > 1 && !recordings.contains(truth.name.as_str()) {
        bail!("{}: has rows of several recordings, of which none is named {}", shown(file), truth.name);
    }
    let mut seen = BTreeSet::new();
    let mut joints = Vec::new();
    for row in rows.iter().filter(|r| recordings.len() == 1 || r.recording == truth.name) {
        let id = row.joint.clone().unwrap_or_else(|| row.clip.clone());
        let part = row.part_box.map(|b| PartBox { center: b.center, half: b.half, rotation: b.rotation });
        let place = row.origin.or(part.map(|b| b.center));
        let (Some(kind), Some(axis), Some(origin)) = (row.kind, row.axis, place) else { continue };
        if seen.insert(id.clone()) {
            joints.push(FoundJoint {
                label: id.clone(),
                id,
                kind,
                axis,
                origin,
                range: row.range.map(|upper| [0.0, upper]),
                part,
                base: None,
                handle: None,
                points: None,
                score: row.joint_confidence,
            });
        }
    }
    Ok(JointScene {
        name: truth.name.clone(),
        format: "paws",
        up: Vector::z(),
        joints,
        left_out: Vec::new(),
        notes: Vec::new(),
    })
}
