//! The tables of a batch, as CSV: one row a twin, a joint, a clip. Metres, radians, newtons; the recording's world.

use super::journal::{JournalEntry, Status};
use crate::articulation::Articulation;
use crate::evaluation::{Prediction, Predictions};
use crate::report::accuracy::quoted;
use crate::twin::Twin;
use crate::validation::{Validation, Verdict};

/// Columns of `results.csv`.
pub const RESULTS: [&str; 12] = [
    "name",
    "recording",
    "status",
    "code",
    "clips",
    "answered",
    "joints",
    "pass",
    "fail",
    "undetermined",
    "version",
    "reason",
];
/// Columns of `joints.csv`.
pub const JOINTS: [&str; 19] = [
    "name",
    "joint",
    "furniture",
    "type",
    "axis_x",
    "axis_y",
    "axis_z",
    "origin_x",
    "origin_y",
    "origin_z",
    "range",
    "observed_range",
    "probability",
    "verdict",
    "margin_nats",
    "tracking_error_m",
    "peak_force_n",
    "reached_share",
    "reason",
];
/// Columns of `predictions.csv`.
pub const PREDICTIONS: [&str; 16] = [
    "name",
    "recording",
    "clip",
    "type",
    "axis_x",
    "axis_y",
    "axis_z",
    "origin_x",
    "origin_y",
    "origin_z",
    "range",
    "range_std",
    "confidence",
    "joint_confidence",
    "joint",
    "reason",
];
/// Columns of `timings.csv`: apart, so that the other tables are the same on every machine.
pub const TIMINGS: [&str; 2] = ["name", "secs"];

/// What a twin's folder holds for the tables.
#[derive(Debug, Clone, PartialEq)]
pub struct TwinFiles {
    /// `predictions.json`.
    pub predictions: Predictions,
    /// `twin.json`.
    pub twin: Twin,
    /// `validation.json`.
    pub validation: Validation,
}

/// A twin's row of `results.csv`; `given` are its recordings as the manifest has them.
#[must_use]
pub fn result(entry: &JournalEntry, given: &[String], made: Option<&TwinFiles>) -> Vec<String> {
    let count = |what: &dyn Fn(&TwinFiles) -> usize| made.map_or_else(String::new, |m| what(m).to_string());
    let verdicts =
        |wanted: Verdict| count(&|m: &TwinFiles| m.validation.joints.iter().filter(|j| j.verdict == wanted).count());
    vec![
        entry.name.clone(),
        given.join("; "),
        entry.status.word().to_owned(),
        entry.code.map_or_else(String::new, |code| code.to_string()),
        count(&|m: &TwinFiles| m.predictions.predictions.len()),
        count(&|m: &TwinFiles| m.predictions.predictions.iter().filter(|p| p.kind.is_some()).count()),
        count(&|m: &TwinFiles| m.twin.furniture.len()),
        verdicts(Verdict::Pass),
        verdicts(Verdict::Fail),
        verdicts(Verdict::Undetermined),
        entry.key.version.clone(),
        entry.reason.clone(),
    ]
}

/// What is not right with a twin that was made, in words; empty where all is.
#[must_use]
pub fn complaint(status: Status, said: &str, made: &TwinFiles) -> String {
    let joints = &made.validation.joints;
    let refuted = joints.iter().filter(|j| j.verdict == Verdict::Fail).count();
    match (status, said) {
        (Status::No, "") if joints.is_empty() => "no joint was found".to_owned(),
        (Status::No, "") if refuted > 0 => format!("{refuted} of {} joints are refuted", joints.len()),
        (Status::No, "") => match made.twin.left_out.first() {
            Some(left) => format!("{}: not built: {}", left.id, left.reason),
            None => "a part of it could not be done; its log says which".to_owned(),
        },
        (_, said) => said.to_owned(),
    }
}

/// The rows of `joints.csv` of a recording.
#[must_use]
pub fn joints(name: &str, made: &TwinFiles) -> Vec<Vec<String>> {
    made.twin
        .furniture
        .iter()
        .map(|furniture| {
            let (part, joint) = (&furniture.part, &furniture.part.joint);
            let check = made.validation.joints.iter().find(|check| check.id == part.id);
            let mut row = vec![name.to_owned(), part.id.clone(), part.label.clone()];
            row.extend(articulation(Some(&joint.articulation)));
            row.extend([number(Some(joint.upper)), number(Some(joint.observed)), number(joint.probability)]);
            row.push(check.map_or_else(String::new, |c| c.verdict.word().to_owned()));
            row.push(number(check.and_then(|c| c.margin_nats)));
            row.push(number(check.map(|c| c.rms_m)));
            row.push(number(check.map(|c| c.peak_force_n)));
            row.push(number(check.map(|c| c.reached_share)));
            row.push(check.map_or_else(String::new, |c| c.reason.clone()));
            row
        })
        .collect()
}

/// The rows of `predictions.csv` of a recording.
#[must_use]
pub fn predictions(name: &str, made: &TwinFiles) -> Vec<Vec<String>> {
    let row = |p: &Prediction| {
        let whole = p.kind.zip(p.axis).zip(p.origin);
        let phi = whole.map(|((kind, axis), origin)| Articulation { kind, axis, origin });
        let mut row = vec![name.to_owned(), p.recording.clone(), p.clip.clone()];
        row.extend(articulation(phi.as_ref()));
        row.extend([p.range, p.range_std, p.confidence, p.joint_confidence].map(number));
        row.extend([p.joint.clone().unwrap_or_default(), p.reason.clone().unwrap_or_default()]);
        row
    };
    made.predictions.predictions.iter().map(row).collect()
}

/// Type, axis and origin; empty cells where there is none.
fn articulation(phi: Option<&Articulation>) -> Vec<String> {
    let Some(phi) = phi else { return vec![String::new(); 7] };
    let numbers = phi.axis.iter().chain(phi.origin.coords.iter()).map(|v| number(Some(*v)));
    std::iter::once(phi.kind.name().to_owned()).chain(numbers).collect()
}

/// A number's cell; empty where there is none.
fn number(value: Option<f64>) -> String {
    value.filter(|v| v.is_finite()).map_or_else(String::new, |v| v.to_string())
}

/// A line of CSV.
#[must_use]
pub fn csv_line<S: AsRef<str>>(cells: &[S]) -> String {
    cells.iter().map(|cell| quoted(cell.as_ref())).collect::<Vec<String>>().join(",") + "\n"
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::articulation::JointKind;
    use crate::batch::journal::JournalKey;
    use crate::math::{Point, Vector};

    fn made() -> TwinFiles {
        let clip = |name: &str| Prediction { clip: name.to_owned(), ..Prediction::default() };
        let found = Prediction {
            kind: Some(JointKind::Prismatic),
            axis: Some(Vector::x()),
            origin: Some(Point::new(1.0, 2.0, 3.0)),
            range: Some(0.25),
            ..clip("a")
        };
        let lost = Prediction { reason: Some("no hand, none".to_owned()), ..clip("b") };
        let twin = Twin::of(Vec::new());
        let predictions = Predictions { predictions: vec![found, lost] };
        TwinFiles { predictions, twin, validation: Validation { joints: vec![] } }
    }

    #[test]
    fn rows_have_the_columns_of_their_headers() {
        let key = JournalKey { recordings: vec!["/r".to_owned()], config: String::new(), version: "1".to_owned() };
        let name = "k".to_owned();
        let entry = JournalEntry { name, key, status: Status::No, code: Some(1), reason: String::new(), secs: 1.0 };
        let given = ["r".to_owned(), "s".to_owned()];
        let row = result(&entry, &given, Some(&made()));
        assert_eq!(row[1], "r; s");
        assert_eq!(row.len(), RESULTS.len());
        assert_eq!(row[4..7], ["2", "1", "0"]);
        assert_eq!(result(&entry, &given, None).len(), RESULTS.len());
        let rows = predictions("k", &made());
        assert!(rows.iter().all(|r| r.len() == PREDICTIONS.len()));
        assert_eq!(rows[0][3..11], ["prismatic", "1", "0", "0", "1", "2", "3", "0.25"]);
        assert!(csv_line(&rows[1]).ends_with(",\"no hand, none\"\n"));
        assert_eq!(complaint(Status::No, "", &made()), "no joint was found");
        assert_eq!(complaint(Status::Done, "", &made()), "");
    }
}
