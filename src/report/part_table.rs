//! Found parts for people.

use super::table::aligned;
use crate::evaluation::point_parts::{LEVELS, PartReport};

/// Shares and average precisions of found parts, one row a number and overlap.
#[must_use]
pub fn table(reports: &[PartReport]) -> String {
    let Some(first) = reports.first() else { return String::new() };
    let mut rows = vec![["parts", "IoU above"].iter().chain(&LEVELS).map(|s| (*s).to_owned()).collect::<Vec<String>>()];
    for report in reports {
        let lines = [
            ("of the true parts", Some(report.recall)),
            ("of the predictions", report.precision),
            ("AP (USDNet)", report.ap),
        ];
        for (what, numbers) in lines {
            let cells = numbers.map_or_else(|| LEVELS.map(|_| "-".to_owned()), |n| n.map(|x| format!("{x:.3}")));
            rows.push([what.to_owned(), format!("{:.2}", report.iou)].into_iter().chain(cells).collect());
        }
    }
    format!("\ntrue parts: {}   predicted: {}\n{}", first.parts, first.predicted, aligned(&rows))
}
