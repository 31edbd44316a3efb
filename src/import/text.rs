//! Text tables: bounded lines, numbers and columns, with errors that name the file and the place.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};

use flate2::bufread::MultiGzDecoder;

use crate::error::{Error, Result};

/// The longest line that is kept; longer ones can be passed over.
const MAX_LINE_BYTES: usize = 1 << 20;

/// Lines of a text file, one at a time.
pub struct Lines<R = Box<dyn BufRead>> {
    reader: R,
    path: PathBuf,
    number: usize,
}

impl Lines {
    /// Of a file; one that is gzip by its content is unpacked on the way.
    ///
    /// # Errors
    /// Where it cannot be opened.
    pub fn open(path: &Path) -> Result<Self> {
        let mut file = BufReader::new(File::open(path).map_err(|e| Error::io(path, &e))?);
        let is_packed = file.fill_buf().map_err(|e| Error::io(path, &e))?.starts_with(&[0x1f, 0x8b]);
        let reader: Box<dyn BufRead> =
            if is_packed { Box::new(BufReader::new(MultiGzDecoder::new(file))) } else { Box::new(file) };
        Ok(Self::of(reader, path))
    }
}

impl<R: BufRead> Lines<R> {
    /// Of a reader; `path` is for messages.
    pub fn of(reader: R, path: &Path) -> Self {
        Self { reader, path: path.to_owned(), number: 0 }
    }

    /// The next line without its end, white space at both sides cut; `None` at the end of the file. A byte order mark is left
    /// out.
    ///
    /// # Errors
    /// Where it is not UTF-8 text or longer than 1 MiB.
    pub fn line(&mut self) -> Result<Option<String>> {
        self.number += 1;
        let mut bytes = Vec::new();
        let limit = MAX_LINE_BYTES as u64 + 1;
        let read = self.reader.by_ref().take(limit).read_until(b'\n', &mut bytes);
        let read = read.map_err(|e| self.fault(format!("cannot be read ({e}); was the file copied as a whole?")))?;
        if read == 0 {
            return Ok(None);
        }
        if read > MAX_LINE_BYTES {
            return Err(self.fault("is longer than 1 MiB; is this a text table?"));
        }
        let text = String::from_utf8(bytes).map_err(|_| self.fault("is not UTF-8 text"))?;
        Ok(Some(text.trim_start_matches('\u{feff}').trim().to_owned()))
    }

    /// The next line that is neither empty nor a comment (`#`).
    ///
    /// # Errors
    /// As [`Lines::line`].
    pub fn content(&mut self) -> Result<Option<String>> {
        loop {
            match self.line()? {
                Some(line) if line.is_empty() || line.starts_with('#') => {}
                other => return Ok(other),
            }
        }
    }

    /// Passes over a line of any length without keeping it; `false` at the end of the file.
    ///
    /// # Errors
    /// Where the file cannot be read.
    pub fn skip(&mut self) -> Result<bool> {
        self.number += 1;
        let mut any = false;
        loop {
            let buffer = self.reader.fill_buf().map_err(|e| Error::io(&self.path, &e))?;
            if buffer.is_empty() {
                return Ok(any);
            }
            any = true;
            let end = buffer.iter().position(|b| *b == b'\n');
            let used = end.map_or(buffer.len(), |i| i + 1);
            self.reader.consume(used);
            if end.is_some() {
                return Ok(true);
            }
        }
    }

    /// An error at the line that was read last.
    pub fn fault(&self, message: impl Into<String>) -> Error {
        Error::format(&self.path, format!("line {}", self.number), message)
    }

    /// Number of the line that was read last, from 1.
    pub fn last(&self) -> usize {
        self.number
    }

    /// A finite number in the line that was read last.
    ///
    /// # Errors
    /// Where the text is no finite number.
    pub fn number(&self, what: &str, text: &str) -> Result<f64> {
        match text.trim().parse::<f64>() {
            Ok(value) if value.is_finite() => Ok(value),
            Ok(_) => Err(self.fault(format!("{what}: \"{}\" is not finite; leave the line out", start(text)))),
            Err(_) => Err(self.fault(format!("{what}: \"{}\" is not a number", start(text)))),
        }
    }

    /// A whole number, from 0, in the line that was read last. `000012` and `12.0` are whole numbers too.
    ///
    /// # Errors
    /// Where the text is no such number.
    pub fn whole(&self, what: &str, text: &str) -> Result<usize> {
        let value = self.number(what, text)?;
        if value < 0.0 || value.fract() != 0.0 || value > 1e15 {
            return Err(self.fault(format!("{what}: \"{}\" is not a whole number from 0", start(text))));
        }
        Ok(value as usize)
    }
}

/// Rows, or frames, of a source that cannot be read while most can: each costs only itself.
#[derive(Debug, Default)]
pub struct Unread {
    count: usize,
    first: Option<Error>,
}

impl Unread {
    /// What a row holds; `None`, and one more that cannot be read, where it cannot be.
    pub fn keep<T>(&mut self, row: Result<T>) -> Option<T> {
        match row {
            Ok(value) => Some(value),
            Err(error) => {
                self.count += 1;
                self.first.get_or_insert(error);
                None
            }
        }
    }

    /// What was left out, in words for people; `None` where all could be read. `read` of them could, `what` they are.
    ///
    /// # Errors
    /// The first fault, where fewer could be read than could not.
    pub fn told(self, what: &str, read: usize) -> Result<Option<String>> {
        match self.first {
            None => Ok(None),
            Some(error) if self.count > read => Err(error),
            Some(error) => Ok(Some(format!("{} {what} that cannot be read, the first one: {error}", self.count))),
        }
    }
}

/// The start of a text, for messages.
fn start(text: &str) -> String {
    text.trim().chars().take(40).collect()
}

/// Cells of a line: separated by commas (or semicolons), or by white space where there are none. Commas within double quotes
/// separate nothing; quotes about a cell stay.
#[must_use]
pub fn cells(line: &str) -> Vec<&str> {
    split(line, separator(line))
}

/// What separates the cells of a line; `None`: white space.
fn separator(line: &str) -> Option<char> {
    [',', ';'].into_iter().find(|c| line.contains(*c))
}

fn split(line: &str, separator: Option<char>) -> Vec<&str> {
    let Some(separator) = separator else { return line.split_whitespace().collect() };
    let mut is_quoted = false;
    line.split(|c: char| {
        is_quoted ^= c == '"';
        c == separator && !is_quoted
    })
    .map(str::trim)
    .collect()
}

/// A cell without the quotes about it; two quotes within are one.
fn unquoted(cell: &str) -> Cow<'_, str> {
    match cell.strip_prefix('"').and_then(|c| c.strip_suffix('"')) {
        Some(inner) => Cow::Owned(inner.replace("\"\"", "\"")),
        None => Cow::Borrowed(cell),
    }
}

/// A table with a header line, read row by row; columns are found by their names.
pub struct TextTable {
    lines: Lines,
    columns: BTreeMap<String, usize>,
    header: Vec<String>,
    /// The header's: text in a row may hold other ones.
    separator: Option<char>,
}

/// A row of a [`TextTable`].
pub struct TableRow<'a> {
    table: &'a TextTable,
    /// The cells without their quotes, one behind the other.
    content: String,
    /// First byte of each cell in it, and the first one behind.
    bounds: Vec<(usize, usize)>,
}

impl TextTable {
    /// Opens a file and reads its header; names are taken without quotes and in lower case.
    ///
    /// # Errors
    /// Where the file cannot be read or is empty.
    pub fn open(path: &Path) -> Result<Self> {
        let mut lines = Lines::open(path)?;
        let Some(first) = lines.content()? else {
            return Err(Error::format(path, "line 1", "the file is empty; expected a header line"));
        };
        let header: Vec<String> = cells(&first).into_iter().map(|c| unquoted(c).to_ascii_lowercase()).collect();
        // Of two columns with one name the first counts.
        let columns = header.iter().enumerate().rev().map(|(i, name)| (name.clone(), i)).collect();
        Ok(Self { lines, columns, header, separator: separator(&first) })
    }

    /// Whether there is a column.
    #[must_use]
    pub fn has(&self, name: &str) -> bool {
        self.columns.contains_key(name)
    }

    /// Checks that there are columns.
    ///
    /// # Errors
    /// With the first one that is not there, and those that are.
    pub fn need(&self, names: &[&str]) -> Result<()> {
        match names.iter().find(|n| !self.has(n)) {
            None => Ok(()),
            Some(name) => {
                let found: String = self.header.join(", ").chars().take(200).collect();
                Err(self.lines.fault(format!("no column \"{name}\"; found: {found}")))
            }
        }
    }

    /// The next row; empty lines are passed over. `None` at the end.
    ///
    /// # Errors
    /// Where a row has another number of cells than the header.
    pub fn row(&mut self) -> Result<Option<TableRow<'_>>> {
        let Some(line) = self.lines.content()? else { return Ok(None) };
        // A table may have millions of rows: no text of its own for each cell.
        let mut content = String::with_capacity(line.len());
        let mut bounds = Vec::with_capacity(self.header.len());
        for cell in split(&line, self.separator) {
            let start = content.len();
            content.push_str(&unquoted(cell));
            bounds.push((start, content.len()));
        }
        if bounds.len() != self.header.len() {
            let (found, expected) = (bounds.len(), self.header.len());
            return Err(self.lines.fault(format!(
                "{found} cells, the header has {expected}; a file that ends early is a copy that was not finished"
            )));
        }
        Ok(Some(TableRow { table: self, content, bounds }))
    }
}

impl TableRow<'_> {
    /// A cell's text; empty where there is no such column.
    #[must_use]
    pub fn text(&self, column: &str) -> &str {
        let bounds = self.table.columns.get(column).and_then(|i| self.bounds.get(*i));
        bounds.and_then(|(start, end)| self.content.get(*start..*end)).unwrap_or_default()
    }

    /// A finite number.
    ///
    /// # Errors
    /// With line and column where it is none.
    pub fn number(&self, column: &str) -> Result<f64> {
        self.table.lines.number(&format!("column {column}"), self.text(column))
    }

    /// A whole number from 0.
    ///
    /// # Errors
    /// With line and column where it is none.
    pub fn whole(&self, column: &str) -> Result<usize> {
        self.table.lines.whole(&format!("column {column}"), self.text(column))
    }

    /// Several finite numbers.
    ///
    /// # Errors
    /// With line and column of the first one that is none.
    pub fn numbers<const N: usize>(&self, columns: [&str; N]) -> Result<[f64; N]> {
        let mut out = [0.0; N];
        for (value, column) in out.iter_mut().zip(columns) {
            *value = self.number(column)?;
        }
        Ok(out)
    }

    /// Number of the row's line in the file, from 1.
    #[must_use]
    pub fn line(&self) -> usize {
        self.table.lines.number
    }

    /// An error at this row.
    #[must_use]
    pub fn fault(&self, message: &str) -> Error {
        self.table.lines.fault(message)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn written(text: &str) -> (tempfile::TempDir, PathBuf) {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("t.csv");
        std::fs::write(&path, text).unwrap();
        (dir, path)
    }

    #[test]
    fn columns_are_found_by_name_in_any_order() {
        let (_dir, path) = written("\u{feff}b, \"A\"\r\n\r\n2.5, 000007\r\n");
        let mut table = TextTable::open(&path).unwrap();
        table.need(&["a", "b"]).unwrap();
        let row = table.row().unwrap().unwrap();
        assert_eq!((row.number("b").unwrap(), row.whole("a").unwrap()), (2.5, 7));
        assert!(table.row().unwrap().is_none());
    }

    #[test]
    fn a_quoted_comma_separates_nothing() {
        let (_dir, path) = written("a,b\n\"open \"\"the\"\" door, slowly\",2\n");
        let mut table = TextTable::open(&path).unwrap();
        let row = table.row().unwrap().unwrap();
        assert_eq!((row.text("a"), row.whole("b").unwrap()), ("open \"the\" door, slowly", 2));
    }

    #[test]
    fn faults_name_line_and_column() {
        for (text, word) in [
            ("a,b\n1,2\n1\n", "line 3: 1 cells"),
            ("a,b\n1,x\n", "line 2: column b: \"x\" is not a number"),
            ("a,b\n1,nan\n", "line 2: column b: \"nan\" is not finite"),
            ("a,c\n1,2\n", "no column \"b\"; found: a, c"),
            ("", "empty"),
        ] {
            let (_dir, path) = written(text);
            let read = || -> Result<()> {
                let mut table = TextTable::open(&path)?;
                table.need(&["a", "b"])?;
                while let Some(row) = table.row()? {
                    row.numbers(["a", "b"])?;
                }
                Ok(())
            };
            let error = read().unwrap_err().to_string();
            assert!(error.contains(word) && error.contains("t.csv"), "{error}");
        }
    }

    #[test]
    fn packed_tables_are_read_as_they_are() {
        use std::io::Write as _;
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("t.csv.gz");
        let mut packer = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
        packer.write_all(b"a,b\n1,2\n3,4\n").unwrap();
        let bytes = packer.finish().unwrap();
        std::fs::write(&path, &bytes).unwrap();
        let mut table = TextTable::open(&path).unwrap();
        assert_eq!(table.row().unwrap().unwrap().numbers(["b", "a"]).unwrap(), [2.0, 1.0]);
        assert_eq!(table.row().unwrap().unwrap().number("a").unwrap(), 3.0);
        assert!(table.row().unwrap().is_none());
        // Without its end.
        std::fs::write(&path, &bytes[..bytes.len() - 6]).unwrap();
        let read = || -> Result<()> {
            let mut table = TextTable::open(&path)?;
            while table.row()?.is_some() {}
            Ok(())
        };
        let error = read().unwrap_err().to_string();
        assert!(error.contains("t.csv.gz") && error.contains("copied as a whole"), "{error}");
    }

    #[test]
    fn a_line_of_any_length_is_passed_over() {
        let (_dir, path) = written(&format!("a\n{}\nb\n", "x".repeat(3 << 20)));
        let mut lines = Lines::open(&path).unwrap();
        assert_eq!(lines.line().unwrap().unwrap(), "a");
        assert!(lines.skip().unwrap());
        assert_eq!(lines.line().unwrap().unwrap(), "b");
        assert!(!lines.skip().unwrap());
        let mut lines = Lines::open(&path).unwrap();
        lines.line().unwrap();
        assert!(lines.line().unwrap_err().to_string().contains("1 MiB"));
    }
}
