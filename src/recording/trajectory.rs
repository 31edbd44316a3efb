//! A bare trajectory: white-space or CSV, 3 or 7 columns, with or without time stamps.

use std::fs::File;
use std::io::BufReader;
use std::path::Path;

use nalgebra::{Quaternion, UnitQuaternion};

use super::read::bounded_line;
use crate::error::{Error, Result};
use crate::math::Point;

/// A point that moved with the part, and the part's orientation where it was recorded.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct BareTrajectory {
    /// Seconds; empty where the file has no time stamps.
    pub times_secs: Vec<f64>,
    /// Positions, metres.
    pub positions: Vec<Point>,
    /// Orientations (file order `x y z w`); empty where the file has none.
    pub orientations: Vec<UnitQuaternion<f64>>,
}

/// Reads `x y z`, `x y z qx qy qz qw`, or either with a time stamp in front (the TUM form). `#` starts a comment; one
/// header line is passed over.
pub fn read(path: &Path) -> Result<BareTrajectory> {
    let file = File::open(path).map_err(|e| Error::io(path, &e))?;
    let mut reader = BufReader::new(file);
    let mut out = BareTrajectory::default();
    let mut columns: Option<usize> = None;
    let mut number = 0;
    loop {
        number += 1;
        let Some(line) = bounded_line(&mut reader, path, number)? else { break };
        let text = line.split('#').next().unwrap_or_default().trim();
        if text.is_empty() {
            continue;
        }
        let place = || format!("line {number}");
        let cells: Vec<&str> =
            text.split(|c: char| c == ',' || c == ';' || c.is_whitespace()).filter(|c| !c.is_empty()).collect();
        let values: std::result::Result<Vec<f64>, _> = cells.iter().map(|c| c.parse::<f64>()).collect();
        let values = match values {
            Ok(values) => values,
            // A header stands before the first row of numbers.
            Err(_) if columns.is_none() && out.positions.is_empty() && number == 1 => continue,
            Err(_) => {
                let start: String = text.chars().take(40).collect();
                let message = format!("\"{start}\" is not all numbers; expected x y z [qx qy qz qw]");
                return Err(Error::format(path, place(), message));
            }
        };
        if ![3, 4, 7, 8].contains(&values.len()) {
            let message = format!(
                "{} columns; expected x y z [qx qy qz qw], with or without a time stamp in front",
                values.len()
            );
            return Err(Error::format(path, place(), message));
        }
        if *columns.get_or_insert(values.len()) != values.len() {
            let message = format!("{} columns, the lines before have {}", values.len(), columns.unwrap_or_default());
            return Err(Error::format(path, place(), message));
        }
        if values.iter().any(|v| !v.is_finite()) {
            return Err(Error::format(path, place(), "a value is not finite; leave the line out"));
        }
        let (time, rest) = if values.len() % 4 == 0 { (Some(values[0]), &values[1..]) } else { (None, &values[..]) };
        if let Some(time) = time {
            if out.times_secs.last().is_some_and(|&last| time < last) {
                return Err(Error::format(path, place(), "the time stamp goes back; sort the lines"));
            }
            out.times_secs.push(time);
        }
        out.positions.push(Point::new(rest[0], rest[1], rest[2]));
        if rest.len() == 7 {
            let q = Quaternion::new(rest[6], rest[3], rest[4], rest[5]);
            if (q.norm() - 1.0).abs() > 1e-2 {
                let message = format!("the quaternion (x y z w) has norm {:.4}, expected 1", q.norm());
                return Err(Error::format(path, place(), message));
            }
            out.orientations.push(UnitQuaternion::from_quaternion(q));
        }
    }
    if out.positions.is_empty() {
        return Err(Error::format(path, "end of file", "no positions; expected lines of x y z"));
    }
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(text: &str) -> std::result::Result<BareTrajectory, String> {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("t.log");
        std::fs::write(&path, text).unwrap();
        read(&path).map_err(|e| e.to_string())
    }

    #[test]
    fn reads_every_form() {
        let plain = check("1 2 3\n4 5 6\n").unwrap();
        assert_eq!((plain.positions.len(), plain.times_secs.len()), (2, 0));
        let timed = check("t,x,y,z\n0.0,1,2,3\n0.5,4,5,6\n").unwrap();
        assert_eq!(timed.times_secs, [0.0, 0.5]);
        let tum = check("# a comment\n0 1 2 3 0 0 0 1\n").unwrap();
        assert_eq!((tum.orientations.len(), tum.times_secs.len()), (1, 1));
        assert_eq!(check("1 2 3 0 0 0 1\n").unwrap().orientations.len(), 1);
    }

    #[test]
    fn names_the_line_of_a_fault() {
        for (text, word) in [
            ("1 2 3\n1 2\n", "line 2: 2 columns"),
            ("1 2 3\nnan 2 3\n", "line 2: a value is not finite"),
            ("1 2 3\nx y z\n", "line 2"),
            ("1 2 3 9 0 0 1\n", "norm"),
            ("1 1 2 3\n0 1 2 3\n", "goes back"),
            ("", "no positions"),
            (&"1 ".repeat(100_000), "longer than 64 KiB"),
        ] {
            let error = check(text).unwrap_err();
            assert!(error.contains(word), "{error}");
        }
    }
}
