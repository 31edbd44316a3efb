//! Accuracy for people (tables) and for spreadsheets (CSV).

use super::phrases;
use super::table::aligned;
use crate::articulation::{Action, JointKind};
use crate::evaluation::bootstrap::Interval;
use crate::evaluation::calibration::CalibrationReport;
use crate::evaluation::clip_report::ClipReport;
use crate::evaluation::deviations::{Deviations, Spread};
use crate::evaluation::rules::usdnet_mo;
use crate::evaluation::summary::{RuleShares, Shares, SharesInterval};
use crate::evaluation::{AnswerErrors, EvaluationReport, Paired, Rule};

type TextRows = Vec<Vec<String>>;

fn header<const N: usize>(names: [&str; N]) -> TextRows {
    vec![names.map(str::to_owned).to_vec()]
}

fn or_dash<T>(value: Option<T>, text: impl Fn(T) -> String) -> String {
    value.map_or_else(|| "-".to_owned(), text)
}

fn share(value: f64) -> String {
    format!("{value:.3}")
}

/// A share with half the width of its interval.
fn with_interval(value: f64, interval: Option<Interval>) -> String {
    interval.map_or_else(|| share(value), |i| format!("{value:.3} ±{:.3}", i.half_width()))
}

/// `[M, MA, MAO]` as cells.
fn cells(shares: Shares, interval: Option<SharesInterval>) -> [String; 3] {
    [
        with_interval(shares.m, interval.map(|i| i.m)),
        with_interval(shares.ma, interval.map(|i| i.ma)),
        with_interval(shares.mao, interval.map(|i| i.mao)),
    ]
}

/// Counts, and every rule's shares of all clips.
#[must_use]
pub fn headline(report: &EvaluationReport) -> String {
    let mut text = format!(
        "clips that move a joint: {}   answered (Match): {} = {:.3} micro, {:.3} macro\n\
         clips that move none: {}   answered all the same (false positives): {}\n\n",
        report.clips,
        report.answered,
        report.match_share,
        report.match_macro,
        report.distractors,
        report.false_positives
    );
    let mut rows = header(["rule", "M", "MA", "MAO"]);
    for r in &report.rules {
        let [m, ma, mao] = cells(r.micro, r.micro_interval);
        rows.push(vec![r.rule.name().to_owned(), m, ma, mao]);
    }
    text += &aligned(&rows);
    text += &format!(
        "\nOf all clips, no answer is wrong; ± half of the 95 % interval over joints, 0 where all clips agree.\n\
         USDNet MO (type, point to line): {:.3}\n",
        report.usdnet_mo
    );
    if !report.unknown.is_empty() {
        text += &format!("\npredictions that no truth knows: {}\n", report.unknown.join(", "));
    }
    text
}

/// Denominators, groups, errors, calibration, grouping and failures.
#[must_use]
pub fn details(report: &EvaluationReport) -> String {
    let mut text = format!("\nwhat became of the clips (axis 15°, hinge 25 cm at the part)\n{}", failures(report));
    text += &format!("\nby denominator\n{}", denominators(report));
    text += &format!("\nby group, all clips\n{}", groups(report));
    text += &format!("\nerrors where the type is right: median / nine of ten\n{}", deviations(report));
    text += &format!("\nerrors as other benchmarks average them\n{}", mean_errors(report));
    if let Some(p) = &report.pairs {
        text += &format!(
            "\npairs of clips on one joint: {} said, {} true, {} both: precision {}, recall {}\n",
            p.predicted_pairs,
            p.true_pairs,
            p.both,
            or_dash(p.precision, share),
            or_dash(p.recall, share)
        );
    }
    text + &confidences(report) + &coverage(report)
}

fn failures(report: &EvaluationReport) -> String {
    let mut rows = header(["end", "clips", "share", "median"]);
    for f in &report.failures {
        let beside = or_dash(f.beside_m, phrases::centimetres);
        rows.push(vec![f.failure.words().to_owned(), f.clips.to_string(), share(f.share), beside]);
    }
    aligned(&rows)
}

fn denominators(report: &EvaluationReport) -> String {
    let mut rows = header(["rule", "of", "average", "M", "MA", "MAO"]);
    for r in &report.rules {
        let of = [
            ("all clips", "macro", Some(r.macro_)),
            ("answered", "micro", r.micro_conditional),
            ("answered", "macro", r.macro_conditional),
        ];
        for (of, average, shares) in of {
            let [m, ma, mao] = shares.map_or_else(|| ["-", "-", "-"].map(str::to_owned), |s| cells(s, None));
            rows.push(vec![r.rule.name().to_owned(), of.to_owned(), average.to_owned(), m, ma, mao]);
        }
    }
    aligned(&rows)
}

fn groups(report: &EvaluationReport) -> String {
    let mut rows = header(["by", "group", "clips", "answered", "M", "MA", "MAO point", "MAO line", "STRICT", "SIM"]);
    for g in &report.groups {
        let of = |rule: Rule| g.rules.iter().find(|r: &&RuleShares| r.rule == rule).map(|r| r.shares);
        let mao = |rule: Rule| or_dash(of(rule), |s| share(s.mao));
        rows.push(vec![
            g.by.to_owned(),
            g.name.clone(),
            g.clips.to_string(),
            g.answered.to_string(),
            or_dash(of(Rule::Paws), |s| share(s.m)),
            or_dash(of(Rule::Paws), |s| share(s.ma)),
            mao(Rule::Paws),
            mao(Rule::PawsLine),
            mao(Rule::Strict),
            mao(Rule::Sim),
        ]);
    }
    aligned(&rows)
}

fn deviations(report: &EvaluationReport) -> String {
    let mut rows = header([
        "type",
        "answers",
        "axis",
        "sense right",
        "hinge off by",
        "range off by",
        "radius off by",
        "box IoU",
        "box face",
    ]);
    let degrees = |v: f64| format!("{:.1}°", v.to_degrees());
    for d in &report.deviations {
        let Deviations { kind, answers, .. } = *d;
        let both = |s: Option<Spread>, text: &dyn Fn(f64) -> String| {
            or_dash(s, |s| format!("{} / {}", text(s.median), text(s.p90)))
        };
        rows.push(vec![
            kind.word().to_owned(),
            answers.to_string(),
            both(d.axis_rad, &degrees),
            or_dash(d.sense_right, share),
            both(d.line_m, &phrases::centimetres),
            both(d.range, &|v| if kind == JointKind::Revolute { degrees(v) } else { phrases::centimetres(v) }),
            both(d.radius_m, &phrases::centimetres),
            or_dash(d.box_iou, |s| format!("{:.2}", s.median)),
            both(d.box_edge_m, &phrases::centimetres),
        ]);
    }
    aligned(&rows)
}

fn mean_errors(report: &EvaluationReport) -> String {
    let mut rows = header(["measure", "clips", "axis mean", "axis median", "line mean", "line median"]);
    let degrees = |v: f64| format!("{:.2}°", v.to_degrees());
    let metres = |v: f64| format!("{v:.3} m");
    for e in &report.errors {
        rows.push(vec![
            e.rule.name().to_owned(),
            e.clips.to_string(),
            or_dash(e.axis_mean_rad, degrees),
            or_dash(e.axis_median_rad, degrees),
            or_dash(e.line_mean_m, metres),
            or_dash(e.line_median_m, metres),
        ]);
    }
    aligned(&rows)
}

fn confidences(report: &EvaluationReport) -> String {
    let table = |what: &str, c: &CalibrationReport| {
        let mut rows = header(["confidence", "answers", "mean", "right"]);
        for b in &c.bins {
            rows.push(vec![
                format!("{:.1} to {:.1}", b.low, b.high),
                b.count.to_string(),
                share(b.mean_confidence),
                share(b.share_right),
            ]);
        }
        format!("\nconfidence in the {what}: ECE {:.3}, Brier {:.3}\n{}", c.ece, c.brier, aligned(&rows))
    };
    let mut text = String::new();
    if let Some(c) = &report.confidences.kind {
        text += &table("type", c);
    }
    if let Some(c) = &report.confidences.joint {
        text += &table("joint (axis 15°, hinge 25 cm at the part)", c);
    }
    for p in &report.confidences.precision {
        text += &format!(
            "right of the surest {:.0} % of all clips, {}: {}\n",
            100.0 * p.coverage,
            p.rule.name(),
            or_dash(p.right, share)
        );
    }
    text
}

/// Empty where no prediction speaks of its errors.
fn coverage(report: &EvaluationReport) -> String {
    if report.coverage.is_empty() {
        return String::new();
    }
    let mut rows = header(["truth within", "answers", "1 std", "expected", "2 std", "expected"]);
    for c in &report.coverage {
        let [one, two] = c.expected;
        let mut row = vec![c.of.to_owned(), c.answers.to_string()];
        row.extend([c.within_one, one, c.within_two, two].map(share));
        rows.push(row);
    }
    format!("\nerrors in the standard deviations given for them, where the type is right\n{}", aligned(&rows))
}

/// One set of predictions against another on the same clips.
#[must_use]
pub fn paired(rows: &[Paired]) -> String {
    let mut table = header(["rule", "M", "MA", "MAO", "95 % of MAO", "better", "worse"]);
    for p in rows {
        let signed = |v: f64| format!("{v:+.3}");
        table.push(vec![
            p.rule.name().to_owned(),
            signed(p.difference.m),
            signed(p.difference.ma),
            signed(p.difference.mao),
            or_dash(p.interval, |i| signed_interval(i.mao)),
            p.better.to_string(),
            p.worse.to_string(),
        ]);
    }
    aligned(&table)
}

/// An interval of a difference.
#[must_use]
pub fn signed_interval(i: Interval) -> String {
    format!("{:+.3} to {:+.3}", i.low, i.high)
}

/// One line a clip.
#[must_use]
pub fn per_clip(report: &EvaluationReport) -> String {
    let mut rows = header([
        "recording",
        "clip",
        "joint",
        "type",
        "axis",
        "point to point",
        "hinge off by",
        "range off by",
        "box IoU",
        "end",
    ]);
    for c in &report.per_clip {
        let mut row = vec![c.recording.clone(), c.clip.clone(), c.joint.clone()];
        match &c.measured {
            None => row.push(format!("no answer: {}", c.reason.as_deref().unwrap_or("not in the predictions"))),
            Some(m) => {
                let inward = if m.signed_axis_rad > std::f64::consts::FRAC_PI_2 { ", inward" } else { "" };
                row.extend([
                    if m.type_right { "right" } else { "wrong" }.to_owned(),
                    format!("{:.1}°{inward}", m.axis_rad.to_degrees()),
                    or_dash(m.point_to_point_m, phrases::centimetres),
                    or_dash(m.truth_to_line_m, phrases::centimetres),
                    or_dash(m.range_error, |r| phrases::amount(m.kind, r)),
                    or_dash(m.box_iou, |v| format!("{v:.2}")),
                    c.failure.words().to_owned(),
                ]);
            }
        }
        rows.push(row);
    }
    format!("{}\n", aligned(&rows))
}

/// A name of a column and what stands in it.
type CsvColumn = (&'static str, fn(&AnswerErrors) -> Option<f64>);

/// Every measure, in units that spreadsheets take: radians and metres.
const MEASURES: [CsvColumn; 19] = [
    ("axis_rad", |m| Some(m.axis_rad)),
    ("signed_axis_rad", |m| Some(m.signed_axis_rad)),
    ("point_to_point_m", |m| m.point_to_point_m),
    ("pivot_to_pivot_m", |m| m.pivot_to_pivot_m),
    ("origin_to_line_m", |m| m.origin_to_line_m),
    ("truth_to_line_m", |m| m.truth_to_line_m),
    ("line_to_line_m", |m| m.line_to_line_m),
    ("line_to_line_coarse_m", |m| m.line_to_line_coarse_m),
    ("line_to_line_unguarded_m", |m| m.line_to_line_unguarded_m),
    ("object_diagonal_m", |m| m.object_diagonal_m),
    ("part_diagonal_m", |m| m.part_diagonal_m),
    ("range_error", |m| m.range_error),
    ("motion_difference", |m| m.motion_difference),
    ("radius_error_m", |m| m.radius_error_m),
    ("box_iou", |m| m.box_iou),
    ("box_edge_m", |m| m.box_edge_m),
    ("axis_sigmas", |m| m.axis_sigmas),
    ("origin_sigmas", |m| m.origin_sigmas),
    ("range_sigmas", |m| m.range_sigmas),
];

/// What stands before the measures.
const ABOUT: [&str; 12] = [
    "recording",
    "clip",
    "joint",
    "type",
    "hinge",
    "action",
    "tier",
    "noun",
    "predicted_type",
    "predicted_joint",
    "confidence",
    "joint_confidence",
];

/// One row a clip: what it is, every measure, the highest of M, MA and MAO that it reaches under every rule, and its end.
#[must_use]
pub fn csv(report: &EvaluationReport) -> String {
    let mut names: Vec<&str> = ABOUT.to_vec();
    names.extend(MEASURES.iter().map(|(name, _)| *name));
    names.extend(Rule::ALL.iter().map(|r| r.key()));
    names.extend(["usdnet_mo", "end", "reason"]);
    let mut text = names.join(",");
    text.push('\n');
    for c in &report.per_clip {
        text += &csv_row(c).iter().map(|v| quoted(v)).collect::<Vec<String>>().join(",");
        text.push('\n');
    }
    text
}

fn csv_row(c: &ClipReport) -> Vec<String> {
    let number = |v: Option<f64>| v.map_or_else(String::new, |v| v.to_string());
    let word = |v: Option<&String>| v.cloned().unwrap_or_default();
    let kind = |k: JointKind| k.name().to_owned();
    let action = c.action.map_or("", |a| if a == Action::Open { "open" } else { "close" });
    let mut row = vec![
        c.recording.clone(),
        c.clip.clone(),
        c.joint.clone(),
        kind(c.kind),
        c.orientation.map_or("", |o| o.word()).to_owned(),
        action.to_owned(),
        word(c.tier.as_ref()),
        word(c.noun.as_ref()),
        c.measured.as_ref().map_or_else(String::new, |m| kind(m.predicted_kind)),
        word(c.predicted_joint.as_ref()),
        number(c.confidence),
        number(c.joint_confidence),
    ];
    row.extend(MEASURES.iter().map(|(_, value)| number(c.measured.as_ref().and_then(value))));
    row.extend(Rule::ALL.iter().map(|r| verdict(c.judge(*r)).to_owned()));
    row.push(if c.measured.as_ref().is_some_and(usdnet_mo) { "MO" } else { "" }.to_owned());
    row.push(c.failure.words().to_owned());
    row.push(word(c.reason.as_ref()));
    row
}

fn verdict(verdict: [bool; 3]) -> &'static str {
    match verdict {
        [_, _, true] => "MAO",
        [_, true, _] => "MA",
        [true, _, _] => "M",
        _ => "",
    }
}

/// A field of a CSV file.
pub(crate) fn quoted(field: &str) -> String {
    if field.contains([',', '"', '\n', '\r']) {
        format!("\"{}\"", field.replace('"', "\"\""))
    } else {
        field.to_owned()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evaluation::failures::Failure;
    use crate::evaluation::{Predictions, evaluate};

    #[test]
    fn fields_with_commas_and_quotes_stay_one_field() {
        assert_eq!(quoted("a, \"b\""), "\"a, \"\"b\"\"\"");
        assert_eq!(quoted("plain"), "plain");
    }

    #[test]
    fn a_row_has_a_field_for_every_column() {
        let mut report = evaluate(&Predictions::default(), &[]);
        let columns = csv(&report).lines().next().unwrap().split(',').count();
        report.per_clip.push(ClipReport {
            recording: "r".to_owned(),
            clip: "c".to_owned(),
            joint: "j".to_owned(),
            kind: JointKind::Revolute,
            orientation: None,
            action: None,
            tier: None,
            noun: None,
            place: None,
            predicted_joint: None,
            predicted_scene: None,
            confidence: None,
            joint_confidence: None,
            measured: None,
            failure: Failure::NoHand,
            reason: None,
        });
        assert_eq!(csv_row(&report.per_clip[0]).len(), columns);
        assert!(csv(&report).ends_with(",no hand,\n"), "{}", csv(&report));
    }

    #[test]
    fn nothing_to_evaluate_is_still_a_table() {
        let report = evaluate(&Predictions::default(), &[]);
        assert!(headline(&report).contains("clips that move a joint: 0"));
        assert!(details(&report).contains("by denominator"));
    }
}
