//! What a file is that is no table of numbers: its first bytes tell, and a way out goes with the answer.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use crate::json::POINTER;

/// Bytes that are looked at.
pub(super) const LOOKED_AT: usize = 4096;

/// What a file that begins so is, and what to do, where it is surely no text table; `None` else.
pub(super) fn no_table(start: &[u8]) -> Option<String> {
    const SIGNS: [(&[u8], &str, &str); 13] = [
        (&[0x1f, 0x8b], "is compressed with gzip", "unpack it with gunzip"),
        (b"BZh", "is compressed with bzip2", "unpack it with bunzip2"),
        (&[0xfd, b'7', b'z', b'X', b'Z'], "is compressed with xz", "unpack it with unxz"),
        (&[0x28, 0xb5, 0x2f, 0xfd], "is compressed with zstd", "unpack it with unzstd"),
        (b"PK\x03\x04", "is a zip archive (or a spreadsheet)", "unpack it, or save the sheet as CSV"),
        (&[0xff, 0xfe], "is UTF-16 text", "save it as UTF-8: iconv -f UTF-16 -t UTF-8"),
        (&[0xfe, 0xff], "is UTF-16 text", "save it as UTF-8: iconv -f UTF-16 -t UTF-8"),
        (b"\x93NUMPY", "is a NumPy array", "write it with numpy.savetxt"),
        (b"\x89HDF", "is HDF5", "write the positions as text"),
        (b"#ROSBAG V", "is a ROS 1 bag", "write the topic's positions as CSV (rostopic echo -p)"),
        (
            b"\x89MCAP",
            "is an MCAP recording",
            "write the topic's positions as CSV, or import the recording (paws import)",
        ),
        (b"SQLite format 3", "is an SQLite file, as rosbag2 writes", "write the topic's positions as CSV"),
        (b"MATLAB 5.0", "is a MATLAB file", "write the positions with writematrix"),
    ];
    if start.starts_with(POINTER.0) {
        return Some(POINTER.1.to_owned());
    }
    if let Some((_, what, way)) = SIGNS.iter().find(|(sign, ..)| start.starts_with(sign)) {
        return Some(format!("{what}; {way}"));
    }
    if start.contains(&0) {
        return Some("holds zero bytes: it is no UTF-8 text; write the positions as lines of x y z".to_owned());
    }
    let text = start.strip_prefix(b"\xef\xbb\xbf").unwrap_or(start).trim_ascii_start();
    let next = |sign: u8| text.strip_prefix(&[sign]).map(|rest| rest.trim_ascii_start().first().copied());
    if next(b'{').is_some() || next(b'[').is_some_and(|after| matches!(after, Some(b'[' | b'{'))) {
        return Some("is JSON; write the positions as lines of x y z, with a header for other columns".to_owned());
    }
    if next(b'<').is_some() {
        return Some("is HTML or XML; write the positions as lines of x y z".to_owned());
    }
    if is_yaml(text) {
        return Some("is YAML; write the positions as lines of x y z, with a header for other columns".to_owned());
    }
    (!text.contains(&b'\n') && text.contains(&b'\r'))
        .then(|| "has carriage returns and no line ends; save it with the line ends of Unix or Windows".to_owned())
}

/// Whether a file is a Git LFS pointer, which stands for a file that was not fetched.
pub(super) fn is_pointer(path: &Path) -> bool {
    let mut start = Vec::new();
    let read = File::open(path).and_then(|file| file.take(POINTER.0.len() as u64).read_to_end(&mut start));
    read.is_ok() && start == POINTER.0
}

/// Whether text begins as YAML does: with its mark, a list of lists or objects, or a key and what is indented below it.
fn is_yaml(text: &[u8]) -> bool {
    let text = String::from_utf8_lossy(text);
    let mut lines = text.lines().filter(|l| !l.trim().is_empty() && !l.starts_with('#'));
    let (Some(first), second) = (lines.next(), lines.next().unwrap_or_default()) else { return false };
    let is_key = |text: &str| {
        text.split_once(':').is_some_and(|(key, rest)| {
            let is_word = |c: char| c.is_ascii_alphanumeric() || matches!(c, '_' | '-');
            !key.is_empty() && key.chars().all(is_word) && (rest.is_empty() || rest.starts_with(' '))
        })
    };
    let is_item = |text: &str| {
        text.trim_start()
            .strip_prefix("- ")
            .map(str::trim_start)
            .is_some_and(|t| t.starts_with(['[', '{']) || is_key(t))
    };
    let is_below = second.starts_with([' ', '-']) && (is_item(second) || is_key(second.trim_start()));
    first.trim_end() == "---" || first.starts_with("%YAML") || is_item(first) || (is_key(first.trim_end()) && is_below)
}

/// Whether a line that is not all numbers stands above them as a title or a header: it is words, with few numbers among them.
pub(super) fn is_title(line: &str) -> bool {
    let in_word = |c: char| c.is_alphanumeric() || matches!(c, '.' | '-' | '+' | '_');
    let (mut all, mut numbers) = (0, 0);
    for word in line.split(|c: char| !in_word(c)).filter(|w| !w.is_empty()) {
        all += 1;
        numbers += usize::from(word.parse::<f64>().is_ok());
    }
    // A row has three numbers; the settings of a program may have as many among many words.
    2 * numbers <= all && (numbers < 3 || 4 * numbers < all)
}

/// Whether a row says in words that nothing was seen: `NA`, `null`, `-`, alone or beside numbers.
pub(super) fn not_seen(cells: &[&str]) -> bool {
    const WORDS: [&str; 10] = ["na", "n/a", "nan", "null", "nil", "none", "lost", "missing", "-", "--"];
    let is_word = |cell: &str| WORDS.iter().any(|w| cell.eq_ignore_ascii_case(w));
    cells.len() >= 3
        && cells.iter().any(|c| is_word(c))
        && cells.iter().all(|c| is_word(c) || c.is_empty() || c.parse::<f64>().is_ok())
}

/// What is odd about a line of a table that is not all numbers, with the way out.
pub(super) fn hint(line: &str, cells: &[&str]) -> String {
    let is_clock = |c: &&str| {
        let digit = |side: Option<char>| side.is_some_and(|c| c.is_ascii_digit());
        c.split_once(':').is_some_and(|(a, b)| digit(a.chars().next_back()) && digit(b.chars().next()))
    };
    let begins_with_number =
        |rest: &str| rest.trim_start().starts_with(|c: char| c.is_ascii_digit() || matches!(c, '-' | '+' | '.'));
    let known = if line.starts_with('{') {
        "; is it JSON? write the numbers alone, with a header for their names"
    } else if line.split(['[', '(']).skip(1).any(begins_with_number) {
        "; leave the brackets out"
    } else if line.contains('|') {
        "; separate columns by commas or spaces"
    } else if cells.iter().any(is_clock) {
        "; time stamps must be seconds"
    } else if cells.iter().any(|c| c.starts_with("0x") || c.starts_with("-0x")) {
        "; write numbers as decimals"
    } else {
        ""
    };
    let odd = cells.iter().find(|c| c.parse::<f64>().is_err()).filter(|_| known.is_empty() && cells.len() > 1);
    odd.map_or_else(
        || known.to_owned(),
        |word| format!("; \"{}\" is no number", word.chars().take(20).collect::<String>()),
    )
}

/// A way out for a row whose decimal commas were taken for separators: twice the columns of a position, whole numbers all.
pub(super) fn split_decimals(line: &str, cells: &[&str]) -> &'static str {
    let whole = |c: &&str| {
        let digits = c.trim_start_matches(['-', '+']);
        !digits.is_empty() && digits.bytes().all(|b| b.is_ascii_digit())
    };
    if line.contains(',') && cells.len() >= 6 && cells.len().is_multiple_of(2) && cells.iter().all(whole) {
        "; are these decimal commas? write decimal points"
    } else {
        ""
    }
}

/// Whether a line writes its numbers with decimal commas: `0,25;0,5;-0,1`, or the same with white space between, or in quotes.
pub(super) fn decimal_commas(line: &str) -> bool {
    let cells: Vec<&str> = if line.contains([';', '"']) {
        super::trajectory::cells(line).into_iter().filter(|c| !c.is_empty()).collect()
    } else {
        line.split_whitespace().collect()
    };
    let digits = |text: &str| !text.is_empty() && text.bytes().all(|b| b.is_ascii_digit());
    let number = |cell: &str| match cell.trim_start_matches(['-', '+']).split_once(',') {
        Some((whole, rest)) => {
            let mantissa = rest.split(['e', 'E']).next().unwrap_or_default();
            digits(whole) && digits(mantissa)
        }
        None => false,
    };
    let whole = |cell: &str| digits(cell.trim_start_matches(['-', '+']));
    let commas = cells.iter().filter(|c| number(c)).count();
    cells.len() >= 3 && 2 * commas > cells.len() && cells.iter().all(|c| number(c) || whole(c))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_no_table_is_named() {
        for (bytes, word) in [
            (&b"\x1f\x8b\x08"[..], "gunzip"),
            (&b"\xff\xfet\0"[..], "UTF-16"),
            (&b"{\"t\": 0}\n"[..], "JSON"),
            (&b" [[0, 1, 2]]"[..], "JSON"),
            (&b"<!doctype html>"[..], "HTML"),
            (&b"1 2 3\r4 5 6\r"[..], "carriage returns"),
            (&b"1 2\0 3"[..], "zero bytes"),
            (&b"version https://git-lfs.github.com/spec/v1\noid sha256:0\n"[..], "git lfs pull"),
            (&b"#ROSBAG V2.0\n\x01"[..], "ROS 1 bag"),
            (&b"\x89MCAP0\r\n\0"[..], "MCAP"),
            (&b"SQLite format 3\0"[..], "SQLite"),
            (&b"MATLAB 5.0 MAT-file\0"[..], "MATLAB"),
            (&b"- [0.1, 0.2, 0.3]\n- [0.1, 0.2, 0.4]\n"[..], "YAML"),
            (&b"# made by hand\nposes:\n  - {x: 1, y: 2, z: 3}\n"[..], "YAML"),
            (&b"header:\n  seq: 1\n"[..], "YAML"),
            (&b"---\nx: 1\n"[..], "YAML"),
        ] {
            let said = no_table(bytes).unwrap_or_default();
            assert!(said.contains(word), "{word}: {said}");
        }
        for bytes in [&b"1 2 3\r\n4 5 6\r\n"[..], b"\xef\xbb\xbft,x,y,z\n", b"", b"# {a}\n1 2 3", b"[1, 2, 3]\n"]
            .into_iter()
            .chain([&b"Positions:\n-0.1 0.2 0.3\n"[..], b"Rate: 120\nt,x,y,z\n", b"- 0.1 0.2\n", b"- - -\n1 2 3\n"])
        {
            assert_eq!(no_table(bytes), None);
        }
    }

    #[test]
    fn titles_are_told_from_rows() {
        for line in
            ["t,x,y,z", "OptiTrack export 3.0", "Marker 12", "recorded 2025-01-02 12:30", "Rate,120.0,Units,Meters"]
        {
            assert!(is_title(line), "{line}");
        }
        for line in ["0.1|0.2|0.3", "hand 0.1 0.2 0.3", "x: 1 y: 2 z: 3", "[0.1, 0.2, 0.3]", "1 2 three", "0x1p0 0 0"] {
            assert!(!is_title(line), "{line}");
        }
    }

    #[test]
    fn decimal_commas_are_told_from_separators() {
        for line in [
            "0,5;1,25;-3,0",
            "0;0,25;-0,1;0,5",
            "0,250000 -0,030000 0,500000",
            "\"0,5\",\"1,25\",\"-3,0\"",
            "\"0,5\";\"1,25\";\"-3,0\"",
        ] {
            assert!(decimal_commas(line), "{line}");
        }
        for line in ["0.5;1.25;3.0", "1, 2, 3", "1,2,3", "0.1,0.2,0.3", "1 2 3", "t;x;y;z", "1;2;3"] {
            assert!(!decimal_commas(line), "{line}");
        }
    }
}
