//! Headers of numpy arrays, looked at before a parser is let near them: their text may be of any size and nest at will, and
//! a small file must ask neither for a large memory nor for a deep stack.

/// The longest header, bytes: what numpy itself reads of a file that it does not trust.
const MAX_HEADER_BYTES: usize = 10_000;
/// Brackets within brackets; arrays of records within records have six.
const MAX_DEPTH: usize = 8;
/// Numbers of an array: no file of a recording has as many, and no product of them overflows.
const MAX_ITEMS: u64 = 1 << 40;
/// Letters of the words in a header (True, False) and of old Python's long numbers.
const LETTERS: &[u8] = b"TrueFalsL";

/// Why an array's bytes are not given to a parser, in words; `None` where its header is like those that numpy writes.
#[must_use]
pub fn refused(bytes: &[u8]) -> Option<String> {
    header(bytes).and_then(scan).err()
}

/// The header's text.
fn header(bytes: &[u8]) -> Result<&[u8], String> {
    let Some(rest) = bytes.strip_prefix(b"\x93NUMPY") else { return Err("it does not begin as one".to_owned()) };
    let (length, rest) = match rest {
        [1, _, a, b, rest @ ..] => (usize::from(u16::from_le_bytes([*a, *b])), rest),
        [2 | 3, _, a, b, c, d, rest @ ..] => {
            (usize::try_from(u32::from_le_bytes([*a, *b, *c, *d])).unwrap_or(usize::MAX), rest)
        }
        _ => return Err("its version is not 1, 2 or 3".to_owned()),
    };
    if length > MAX_HEADER_BYTES {
        return Err(format!("its header has {length} bytes, more than {MAX_HEADER_BYTES}"));
    }
    rest.get(..length).ok_or_else(|| "it is cut off within its header".to_owned())
}

/// Whether a header's text is flat, has no more numbers than an array can have, and nothing else in it.
fn scan(text: &[u8]) -> Result<(), String> {
    let (mut depth, mut items) = (0usize, 1u64);
    let mut rest = text;
    while let [byte, behind @ ..] = rest {
        rest = behind;
        match byte {
            b'\'' | b'"' => rest = behind_text(behind, *byte)?,
            b'{' | b'[' | b'(' => {
                depth += 1;
                if depth > MAX_DEPTH {
                    return Err(format!("its header nests deeper than {MAX_DEPTH}"));
                }
            }
            b'}' | b']' | b')' => depth = depth.saturating_sub(1),
            b'0'..=b'9' => {
                let digits = behind.iter().take_while(|b| b.is_ascii_digit()).count();
                let (more, after) = behind.split_at_checked(digits).unwrap_or((behind, b"".as_slice()));
                rest = after;
                let digits = more.iter().try_fold(u64::from(byte - b'0'), |sum, digit| {
                    sum.checked_mul(10)?.checked_add(u64::from(digit.saturating_sub(b'0')))
                });
                let product = digits.and_then(|n| items.checked_mul(n.max(1))).filter(|n| *n <= MAX_ITEMS);
                items = product.ok_or_else(|| "its header claims more numbers than any file has".to_owned())?;
            }
            b':' | b',' | b' ' | b'\n' => {}
            letter if LETTERS.contains(letter) => {}
            other => return Err(format!("its header has '{}' in it", other.escape_ascii())),
        }
    }
    Ok(())
}

/// What stands behind a text whose opening quote was read.
fn behind_text(text: &[u8], quote: u8) -> Result<&[u8], String> {
    let end = text.iter().position(|b| *b == quote || *b == b'\\' || *b == b'\n');
    match end.and_then(|end| text.get(end..)) {
        // Two texts in a row are one to Python, and three quotes begin a longer one.
        Some([b, next, ..]) if *b == quote && matches!(next, b'\'' | b'"') => {
            Err("its header has quotes in a row".to_owned())
        }
        Some([b, rest @ ..]) if *b == quote => Ok(rest),
        _ => Err("a text in its header does not end, or has a backslash in it".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn array(version: u8, length: usize, text: &str) -> Vec<u8> {
        let mut bytes = b"\x93NUMPY".to_vec();
        bytes.extend([version, 0]);
        match version {
            1 => bytes.extend((length as u16).to_le_bytes()),
            _ => bytes.extend((length as u32).to_le_bytes()),
        }
        bytes.extend(text.as_bytes());
        bytes
    }

    #[test]
    fn headers_of_numpy_pass() {
        for text in [
            "{'descr': '<f4', 'fortran_order': False, 'shape': (3, 2, 2), }   \n",
            "{'descr': '|u1', 'fortran_order': True, 'shape': (), }\n",
            "{'descr': '<f8', 'fortran_order': False, 'shape': (0L, 4L), }\n",
            "{'descr': [('a', [('b', '<f4', (2, 3))])], 'fortran_order': False, 'shape': (7,), }\n",
        ] {
            for version in [1, 2, 3] {
                assert_eq!(refused(&array(version, text.len(), text)), None, "{text}");
            }
        }
    }

    #[test]
    fn what_would_cost_more_than_the_file_is_refused() {
        let deep = format!("{{'descr': {}1", "(".repeat(5000));
        let long = " ".repeat(20_000);
        for (version, length, text, word) in [
            (1, deep.len(), deep.as_str(), "deeper"),
            (2, u32::MAX as usize, "{}", "4294967295 bytes"),
            (2, long.len(), long.as_str(), "20000 bytes"),
            (1, 40, "{}", "cut off"),
            (9, 2, "{}", "version"),
            (1, 28, "{'shape': (4294967296,65536)}", "more numbers"),
            (1, 33, "{'shape': (99999999999999999999,)}", "more numbers"),
            (1, 17, "{'shape': (0x10,)}", "'x' in it"),
            (1, 13, "{'shape': -1}", "'-' in it"),
            (1, 11, "{'''a': 1}}", "quotes in a row"),
            (1, 10, "{'a\\'': 1}", "backslash"),
            (1, 4, "{'a}", "does not end"),
        ] {
            let said = refused(&array(version, length, text)).unwrap_or_default();
            assert!(said.contains(word), "{word}: {said}");
        }
        assert!(refused(b"PK\x03\x04").is_some_and(|said| said.contains("begin")));
    }
}
