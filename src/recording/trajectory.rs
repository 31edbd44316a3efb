//! A bare trajectory: white-space or CSV, positions with or without orientations and time stamps.

use std::collections::HashMap;
use std::fs::File;
use std::io::{BufRead, BufReader};
use std::path::Path;

use nalgebra::{Quaternion, UnitQuaternion};

pub use super::columns::LengthUnit;
use super::columns::{self, EXPECTED, Layout};
use super::read::bounded_line;
use super::sniff;
use crate::error::{Error, Result};
use crate::math::{Point, Vector, stats};

/// A point that moved with the part, and the part's orientation where it was recorded.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct BareTrajectory {
    /// Seconds; empty where the file has no time stamps.
    pub times_secs: Vec<f64>,
    /// Positions, metres.
    pub positions: Vec<Point>,
    /// Orientations (file order `x y z w`, unless a header names another); empty where the file has none.
    pub orientations: Vec<UnitQuaternion<f64>>,
    /// What was left out, in words for people.
    pub notes: Vec<String>,
}

/// What is wrong where times go back, and where the last column of a table without names rises meanwhile.
const TIME_BACK: &str = "the time stamp goes back; sort the lines";
const TIME_LAST: &str = "the time stamp goes back, and the last column rises: is the time last? Name the columns in a header \
                         (x y z t); else sort the lines";

/// Text lines that may stand above the numbers.
const MAX_TITLES: usize = 20;

/// Reads positions in metres: [`read_in`] without a unit.
///
/// # Errors
/// Those of [`read_in`].
pub fn read(path: &Path) -> Result<BareTrajectory> {
    read_in(path, None)
}

/// Reads `x y z`, `x y z qx qy qz qw`, or either with a time stamp in front (the TUM form), separated by white space, commas
/// or semicolons. Where a header (also one in a comment) names the columns, the names decide. `unit` is that of the
/// positions where the names do not say it; metres else. `#` starts a comment anywhere, `%`, `;` and `//` at the start of a
/// line. Rows that only say that the hand was lost are left out.
///
/// # Errors
/// Where the file is no such table, a row is unlike the others, or the positions cannot be in this unit.
pub fn read_in(path: &Path, unit: Option<LengthUnit>) -> Result<BareTrajectory> {
    let file = File::open(path).map_err(|e| Error::io(path, &e))?;
    let mut reader = BufReader::with_capacity(sniff::LOOKED_AT, file);
    if let Some(what) = sniff::no_table(reader.fill_buf().map_err(|e| Error::io(path, &e))?) {
        return Err(Error::format(path, "start of file", what));
    }
    let mut table = Table::new(path);
    let mut number = 0;
    loop {
        number += 1;
        let Some(line) = bounded_line(&mut reader, path, number)? else { break };
        table.line(number, line.trim_start_matches('\u{feff}').trim())?;
    }
    table.finish(unit)
}

/// The cells of a line: of CSV those between the separators, also empty ones, of tables with tabs those that hold something, of
/// anything else its words. A separator within quotes separates nothing.
pub(super) fn cells(line: &str) -> Vec<&str> {
    let separator = [';', ',', '\t'].into_iter().find(|s| line.contains(*s) && outside_quotes(line, *s).len() > 1);
    let Some(separator) = separator else { return line.split_whitespace().map(bare).collect() };
    let mut cells: Vec<&str> = outside_quotes(line, separator).into_iter().map(bare).collect();
    if separator == '\t' {
        // Several tabs align columns.
        cells.retain(|c| !c.is_empty());
    } else if cells.last().is_some_and(|c| c.is_empty()) {
        // A separator at the end of a line opens no cell.
        cells.pop();
    }
    cells
}

/// What lies between the separators that stand outside of quotes.
fn outside_quotes(line: &str, separator: char) -> Vec<&str> {
    let mut quoted = false;
    line.split(|c: char| {
        quoted ^= c == '"';
        !quoted && c == separator
    })
    .collect()
}

fn bare(cell: &str) -> &str {
    cell.trim().trim_matches('"').trim()
}

/// The numbers of a line: one or more in each cell; `None` where a word is none.
fn numbers(cells: &[&str]) -> Option<Vec<f64>> {
    cells.iter().flat_map(|c| c.split_whitespace()).map(|word| word.parse::<f64>().ok()).collect()
}

/// A table while it is read.
struct Table<'a> {
    path: &'a Path,
    /// Text lines above the numbers: number of the line, text, whether it is a comment.
    titles: Vec<(usize, String, bool)>,
    layout: Option<Layout>,
    /// The last column of the row before, while it rises from row to row.
    rising: Option<f64>,
    out: BareTrajectory,
}

impl<'a> Table<'a> {
    fn new(path: &'a Path) -> Self {
        let rising = Some(f64::NEG_INFINITY);
        Self { path, titles: Vec::new(), layout: None, rising, out: BareTrajectory::default() }
    }

    fn fault(&self, number: usize, message: impl Into<String>) -> Error {
        Error::format(self.path, format!("line {number}"), message)
    }

    fn line(&mut self, number: usize, line: &str) -> Result<()> {
        let (text, comment) = match line.split_once('#') {
            Some((text, comment)) => (text.trim(), comment.trim()),
            None => match ["%", ";", "//"].iter().find_map(|mark| line.strip_prefix(*mark)) {
                Some(comment) => ("", comment.trim_start_matches(['%', ';', '/']).trim()),
                None => (line, ""),
            },
        };
        if text.is_empty() {
            if !comment.is_empty() && self.layout.is_none() {
                // Of a long preamble only its end can be a header.
                if self.titles.len() >= MAX_TITLES {
                    self.titles.retain(|(.., is_comment)| !is_comment);
                }
                self.titles.push((number, comment.to_owned(), true));
            }
            return Ok(());
        }
        if sniff::decimal_commas(text) {
            let message = "has decimal commas; write decimal points (sed 's/,/./g' does where commas separate nothing)";
            return Err(self.fault(number, message));
        }
        let cells = cells(text);
        if let Some(values) = numbers(&cells) {
            return self.row(number, text, &values);
        }
        if sniff::not_seen(&cells) {
            return Err(self.fault(number, "a value is missing; leave the line out where the hand was not seen"));
        }
        // A title or a header stands above the numbers.
        let is_title = sniff::is_title(text);
        if is_title && self.layout.is_none() {
            if self.titles.iter().filter(|(.., is_comment)| !is_comment).count() >= MAX_TITLES {
                return Err(self.no_numbers());
            }
            self.titles.push((number, text.to_owned(), false));
            return Ok(());
        }
        if is_title && columns::understood(&cells) >= 3 {
            return Err(self.not_all_numbers(number, text, "; a second header: one file holds one motion"));
        }
        Err(self.not_all_numbers(number, text, &sniff::hint(text, &cells)))
    }

    fn not_all_numbers(&self, number: usize, text: &str, hint: &str) -> Error {
        let start: String = text.chars().take(40).collect();
        self.fault(number, format!("\"{start}\" is not all numbers; {EXPECTED}{hint}"))
    }

    /// The fault of a file in which no line has numbers: its first line shows what it is.
    fn no_numbers(&self) -> Error {
        match self.titles.iter().find(|(.., is_comment)| !is_comment) {
            Some((number, text, _)) => {
                let names = cells(text);
                let is_header = columns::understood(&names) >= 3;
                let hint =
                    if is_header { "; it is a header, and no row follows".into() } else { sniff::hint(text, &names) };
                self.not_all_numbers(*number, text, &hint)
            }
            None => Error::format(self.path, "end of file", "no positions; expected lines of x y z"),
        }
    }

    /// The columns of a row: what the nearest header above says, with the units of a line below it, else by their number.
    fn columns(&self, number: usize, row: &str, count: usize) -> Result<Layout> {
        let by_count = Layout::by_count(count);
        let mut units: Option<(usize, Vec<&str>)> = None;
        for (at, text, is_comment) in self.titles.iter().rev() {
            let names = cells(text);
            if units.is_none() && names.len() == count && columns::are_units(&names) {
                units = Some((*at, names));
                continue;
            }
            let understood = columns::understood(&names);
            let names_all = names.len() == count;
            let is_header = if *is_comment {
                // A comment may be about anything: it is a header where nothing else can be meant.
                names_all && understood >= 2 && (understood == count || by_count.is_none())
            } else {
                understood >= 2 || (names_all && count > 1)
            };
            if !is_header {
                continue;
            }
            if !names_all {
                let hint = sniff::split_decimals(row, &cells(row));
                let message =
                    format!("the header in line {at} names {} columns, the row has {count}{hint}", names.len());
                return Err(self.fault(number, message));
            }
            let layout = match &units {
                None => Layout::by_names(&names),
                Some((_, units)) => {
                    let with: Vec<String> =
                        names.iter().zip(units).map(|(name, unit)| format!("{name} {unit}")).collect();
                    Layout::by_names(&with.iter().map(String::as_str).collect::<Vec<_>>())
                }
            };
            return layout.map_err(|e| self.fault(*at, e));
        }
        if let Some((at, _)) = units {
            return Err(self.fault(at, "has units, and no line above it names the columns"));
        }
        by_count.ok_or_else(|| {
            let hint = match (count, sniff::split_decimals(row, &cells(row))) {
                (12 | 16, _) => "; of a matrix a line the 4th, 8th and 12th number are x y z",
                (13 | 17, _) => {
                    "; of a matrix a line, with one number before it, the 5th, 9th and 13th number are x y z"
                }
                (_, "") => "; a header may name other columns",
                (_, decimals) => decimals,
            };
            self.fault(number, format!("{count} columns; {EXPECTED}{hint}"))
        })
    }

    fn row(&mut self, number: usize, row: &str, values: &[f64]) -> Result<()> {
        let cells = cells(row);
        if cells.iter().any(|c| c.is_empty()) {
            return Err(self.fault(number, "a cell is empty; leave the line out where the hand was not seen"));
        }
        let layout = match self.layout {
            Some(layout) => layout,
            None => self.columns(number, row, values.len())?,
        };
        self.layout = Some(layout);
        if values.len() != layout.count {
            let message = format!("{} columns, the lines before have {}", values.len(), layout.count);
            return Err(self.fault(number, message));
        }
        if values.iter().any(|v| !v.is_finite()) {
            return Err(self.fault(number, "a value is not finite; leave the line out"));
        }
        let value = |column: usize| values.get(column).copied().unwrap_or(0.0);
        self.rising = self.rising.and_then(|before| values.last().copied().filter(|last| *last > before));
        if let Some((column, seconds)) = layout.time {
            let time = value(column) * seconds;
            if self.out.times_secs.last().is_some_and(|&last| time < last) {
                let is_last = self.rising.is_some() && self.titles.is_empty();
                return Err(self.fault(number, if is_last { TIME_LAST } else { TIME_BACK }));
            }
            self.out.times_secs.push(time);
        }
        let [x, y, z] = layout.position.map(value);
        self.out.positions.push(Point::new(x, y, z));
        if let Some(columns) = layout.orientation {
            let [x, y, z, w] = columns.map(value);
            let q = Quaternion::new(w, x, y, z);
            if (q.norm() - 1.0).abs() > 1e-2 {
                let message = format!(
                    "the quaternion (x y z w) has norm {:.4}, expected 1; name the columns in a header where their order is \
                     another, leave the line out where nothing was seen{}",
                    q.norm(),
                    sniff::split_decimals(row, &cells)
                );
                return Err(self.fault(number, message));
            }
            self.out.orientations.push(UnitQuaternion::from_quaternion(q));
        }
        Ok(())
    }

    fn finish(mut self, unit: Option<LengthUnit>) -> Result<BareTrajectory> {
        if self.out.positions.is_empty() {
            return Err(self.no_numbers());
        }
        let named = self.layout.and_then(|l| l.unit);
        if let (Some(named), Some(unit)) = (named, unit)
            && named != unit
        {
            let message =
                format!("the header says {}, --units {}; leave one of the two out", named.sign(), unit.sign());
            return Err(Error::format(self.path, "header", message));
        }
        leave_out_lost(&mut self.out);
        let unit = named.or(unit).unwrap_or(LengthUnit::Metre);
        for p in &mut self.out.positions {
            p.coords *= unit.metres();
        }
        if let Some(message) = other_unit(&self.out.positions, unit) {
            return Err(Error::format(self.path, "whole file", message));
        }
        Ok(self.out)
    }
}

/// Leaves out rows by which trackers say that they saw nothing, far from where the hand was seen before and after.
fn leave_out_lost(out: &mut BareTrajectory) {
    let signs = signs(&out.positions);
    // Rows that could be such a sign do not tell how far the hand goes from row to row.
    let steps: Vec<f64> = out
        .positions
        .windows(2)
        .zip(signs.windows(2))
        .filter(|(_, s)| !s[0] && !s[1])
        .map(|(w, _)| (w[1] - w[0]).norm())
        .collect();
    let Some(usual) = stats::quantile(&steps, 0.95).filter(|s| *s > 0.0) else { return };
    // No hand speeds up like this from one row to the next.
    let far = 10.0 * usual;
    let seen: Vec<Option<Point>> = out.positions.iter().zip(&signs).map(|(p, s)| (!s).then_some(*p)).collect();
    let mut before = Vec::with_capacity(seen.len());
    let mut last = None;
    for p in &seen {
        last = p.or(last);
        before.push(last);
    }
    let mut next = None;
    let mut lost = vec![false; seen.len()];
    for (i, p) in seen.iter().enumerate().rev() {
        next = p.or(next);
        let here = out.positions[i];
        let is_far = |other: Option<Point>| other.is_none_or(|o| (o - here).norm() > far);
        lost[i] = p.is_none() && is_far(before[i]) && is_far(next);
    }
    let count = lost.iter().filter(|l| **l).count();
    let mut values: Vec<Point> = out.positions.iter().zip(&lost).filter(|(_, l)| **l).map(|(p, _)| *p).collect();
    values.sort_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)).then(a.z.total_cmp(&b.z)));
    values.dedup();
    // One value may stand in most rows; many of them are no sign.
    if count == 0 || (2 * count > lost.len() && values.len() > 1) {
        return;
    }
    let shown: Vec<String> = values.iter().take(3).map(|p| format!("{} {} {}", p.x, p.y, p.z)).collect();
    out.notes.push(format!("{count} rows of {} are left out: nothing was seen there", shown.join(", ")));
    let keep = |i: usize| !lost.get(i).copied().unwrap_or(false);
    out.positions = kept(&out.positions, &keep);
    out.times_secs = kept(&out.times_secs, &keep);
    out.orientations = kept(&out.orientations, &keep);
}

/// Rows that could say that nothing was seen: one and the same number thrice, or one and the same point in several rows, to which
/// the positions jump and from which they come back to where they were.
fn signs(points: &[Point]) -> Vec<bool> {
    let mut signs: Vec<bool> = points.iter().map(|p| p.x == p.y && p.y == p.z).collect();
    let steps: Vec<f64> = points.windows(2).map(|w| (w[1] - w[0]).norm()).filter(|s| *s > 0.0).collect();
    let jump = 10.0 * stats::median(&steps).unwrap_or(0.0);
    let key = |p: &Point| [p.x, p.y, p.z].map(f64::to_bits);
    let mut rows: HashMap<[u64; 3], usize> = HashMap::new();
    let mut away = Vec::new();
    let mut from = 0;
    for run in points.chunk_by(|a, b| a == b) {
        let to = from + run.len();
        if from > 0
            && let (Some(before), Some(here), Some(after)) = (points.get(from - 1), run.first(), points.get(to))
        {
            let least = (here - before).norm().min((here - after).norm());
            if least > jump && least > 2.0 * (after - before).norm() {
                *rows.entry(key(here)).or_default() += run.len();
                away.push(from..to);
            }
        }
        from = to;
    }
    for range in away {
        let is_repeated = points.get(range.start).and_then(|p| rows.get(&key(p))).is_some_and(|n| *n > 1);
        for sign in signs.get_mut(range).into_iter().flatten() {
            *sign |= is_repeated;
        }
    }
    signs
}

fn kept<T: Copy>(all: &[T], keep: &dyn Fn(usize) -> bool) -> Vec<T> {
    all.iter().enumerate().filter(|(i, _)| keep(*i)).map(|(_, x)| *x).collect()
}

/// Why the positions (metres, read in `unit`) cannot be those of a hand that opens something, and the unit that would do.
fn other_unit(positions: &[Point], unit: LengthUnit) -> Option<String> {
    // A person opens a part within reach and a few steps; the middle nine tenths are not misled by single jumps.
    const MOST_M: f64 = 5.0;
    // What moves less is not told from noise.
    const LEAST_M: f64 = 0.02;
    // What a handle travels, in the order of magnitude.
    const USUAL_M: f64 = 0.5;
    let side = |k: usize| {
        let all: Vec<f64> = positions.iter().map(|p| p[k]).collect();
        stats::quantile(&all, 0.95).unwrap_or(0.0) - stats::quantile(&all, 0.05).unwrap_or(0.0)
    };
    let size = Vector::new(side(0), side(1), side(2)).norm();
    if size <= MOST_M {
        return None;
    }
    let sized = |u: LengthUnit| size / unit.metres() * u.metres();
    let mut others: Vec<LengthUnit> = [LengthUnit::Metre, LengthUnit::Centimetre, LengthUnit::Millimetre]
        .into_iter()
        .filter(|u| *u != unit && (LEAST_M..=MOST_M).contains(&sized(*u)))
        .collect();
    let off = |u: LengthUnit| (sized(u) / USUAL_M).ln().abs();
    others.sort_by(|a, b| off(*a).total_cmp(&off(*b)));
    let ways: Vec<String> =
        others.iter().map(|u| format!("in {0} it would be {1:.2} m: say --units {0}", u.sign(), sized(*u))).collect();
    let way = if ways.is_empty() {
        "it is no motion of one part in m, cm or mm; cut it, or mend its columns".to_owned()
    } else {
        ways.join("; ")
    };
    Some(format!("the positions spread over {size:.0} m, which no hand that opens something does; {way}"))
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
            ("1 1 2 3\n0 1 2 3\n", "goes back; sort the lines"),
            ("0.5 1 2 0.0\n0.4 1 2 0.1\n", "is the time last?"),
            ("t x y z\n0.5 1 2 0.0\n0.4 1 2 0.1\n", "goes back; sort the lines"),
            ("", "no positions"),
            (&"1 ".repeat(100_000), "longer than 64 KiB"),
        ] {
            let error = check(text).unwrap_err();
            assert!(error.contains(word), "{error}");
        }
    }

    #[test]
    fn names_decide_where_there_are_any_and_the_nearest_header_counts() {
        let swapped = check("t,qw,qx,qy,qz,x,y,z\n0,1,0,0,0,1,2,3\n").unwrap();
        assert_eq!(swapped.positions, [Point::new(1.0, 2.0, 3.0)]);
        assert!(swapped.orientations[0].angle() < 1e-9);
        for text in [
            "x,y,z,timestamp\n1,2,3,0.5\n",
            "# timestamp x y z\n0.5 1 2 3\n",
            "\u{feff}timestamp,x,y,z\n0.5,1,2,3\n",
            "\u{feff}0.5,1,2,3\n",
            "\n# made by foo\n\ntime [s],x,y,z\n0.5,1,2,3\n",
            "recorded by foo\n\"t\",\"x\",\"y\",\"z\"\n\"0.5\",\"1\",\"2\",\"3\"\n",
            "% written by a tool\n% t x y z\n0.5 1 2 3\n",
            "t,x,y,z,\n0.5,1,2,3,\n",
            "frame,t_ms,x,y,z\n7,500,1,2,3\n",
            "x_mm,y_mm,z_mm,t\n1000,2000,3000,0.5\n",
        ] {
            let read = check(text).unwrap();
            assert_eq!((read.times_secs, read.positions), (vec![0.5], vec![Point::new(1.0, 2.0, 3.0)]), "{text}");
        }
    }

    #[test]
    fn what_cannot_be_understood_is_refused_with_the_way_out() {
        for (text, word) in [
            ("t,x,y\n0,1,2\n", "does not name all of x, y, z"),
            ("hand,x,y,z\n0,1,2,3\n", "column hand is not understood"),
            ("a,b,c\n1,2,3\n", "line 1: column a is not understood"),
            ("t,x,y,z\n1,2,3\n", "names 4 columns, the row has 3"),
            ("t;x;y;z\n0,0;0,1;0,2;0,3\n", "line 2: has decimal commas"),
            ("0,1 0,2 0,3\n", "decimal commas"),
            ("t,x,y,z\n0.0,1,,3\n", "a cell is empty"),
            ("t,x,y,z\n2024-06-03T16:00:00.000,1,2,3\n", "time stamps must be seconds"),
            ("[1, 2, 3]\n", "leave the brackets out"),
            ("{\"t\": 0}\n", "is JSON"),
            ("x y z\n1 2 3\nx y z\n4 5 6\n", "a second header"),
            ("1 0 0 0 0 1 0 0 0 0 1 0\n", "4th, 8th and 12th"),
            ("x y z\n", "is not all numbers"),
            ("t,x,y,z\n", "it is a header, and no row follows"),
        ] {
            let error = check(text).unwrap_err();
            assert!(error.contains(word), "{text}: {error}");
        }
    }

    #[test]
    fn rows_of_a_lost_hand_are_left_out_and_a_path_through_the_origin_is_not() {
        let path = |lost: &str| -> String {
            let row = |i: u32| match i {
                10..15 | 20 => format!("{i} {lost}\n"),
                _ => format!("{i} {} 1.0 0.5\n", 0.01 * f64::from(i)),
            };
            (0..40).map(row).collect()
        };
        for lost in ["-1 -1 -1", "0 0 0"] {
            let read = check(&path(lost)).unwrap();
            assert_eq!((read.positions.len(), read.times_secs.len()), (34, 34), "{lost}");
            assert!(read.notes[0].contains(&format!("6 rows of {lost}")), "{:?}", read.notes);
        }
        let through: String = (0..41u32).map(|i| format!("{} 0 0\n", 0.01 * (f64::from(i) - 20.0))).collect();
        assert_eq!(check(&through).unwrap().positions.len(), 41);
    }

    #[test]
    fn millimetres_are_told_from_metres() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("t.log");
        let write = |scale: f64| {
            let rows: String = (0..50u32).map(|i| format!("{} 0.1 0.2\n", scale * 0.01 * f64::from(i))).collect();
            std::fs::write(&path, rows).unwrap();
        };
        for (scale, unit, sign) in [(1000.0, LengthUnit::Millimetre, "mm"), (100.0, LengthUnit::Centimetre, "cm")] {
            write(scale);
            let error = read(&path).unwrap_err().to_string();
            assert!(error.contains(&format!("--units {sign}")), "{error}");
            let mended = read_in(&path, Some(unit)).unwrap();
            assert!((mended.positions[49].x - 0.49).abs() < 1e-9);
        }
    }
}
