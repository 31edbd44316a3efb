//! Where in a JSON text an offset lies, as far as the text before it tells: for text that cannot be parsed.

/// A list or an object that is open at the offset.
#[derive(Default)]
struct Level {
    is_list: bool,
    /// Items of a list before the one at the offset.
    index: usize,
    /// Key of an object's entry at the offset.
    key: Option<String>,
    /// What people call the object.
    name: Option<String>,
}

/// Keys whose values name an object.
const NAMES: [&str; 4] = ["id", "clip", "joint", "frame"];
/// A file of nothing but brackets has no place worth telling.
const MAX_DEPTH: usize = 64;

/// The way to the value at a byte offset: `joints[0] (door): origin[1]`; empty at the top and for deeper nesting than any
/// file of ours has.
pub(super) fn at(text: &str, offset: usize) -> String {
    let bytes = text.as_bytes().get(..offset).unwrap_or(text.as_bytes());
    let mut open: Vec<Level> = Vec::new();
    let mut i = 0;
    while let Some(&byte) = bytes.get(i) {
        i += 1;
        match byte {
            b'{' | b'[' if open.len() < MAX_DEPTH => open.push(Level { is_list: byte == b'[', ..Level::default() }),
            b'{' | b'[' => return String::new(),
            b'}' | b']' => {
                open.pop();
            }
            b',' => {
                if let Some(level) = open.last_mut() {
                    level.index += 1;
                    level.key = None;
                }
            }
            b'"' => {
                let end = string_end(bytes, i);
                let word = String::from_utf8_lossy(bytes.get(i..end).unwrap_or_default()).into_owned();
                i = end + 1;
                if let Some(level) = open.last_mut().filter(|l| !l.is_list) {
                    match level.key.as_deref() {
                        None => level.key = Some(word),
                        Some(key) if NAMES.contains(&key) && word.len() <= 60 => level.name = Some(word),
                        Some(_) => {}
                    }
                }
            }
            b'0'..=b'9' => {
                let digits = bytes.get(i - 1..).unwrap_or_default().iter().take_while(|b| b.is_ascii_digit()).count();
                let number = String::from_utf8_lossy(bytes.get(i - 1..i - 1 + digits).unwrap_or_default()).into_owned();
                i += digits - 1;
                if let Some(level) = open.last_mut().filter(|l| l.key.as_deref() == Some("frame")) {
                    level.name = Some(format!("frame {number}"));
                }
            }
            _ => {}
        }
    }
    told(&open)
}

/// The index of the quote that ends a string which begins at `from`; the end of the text where none does.
fn string_end(bytes: &[u8], from: usize) -> usize {
    let mut i = from;
    while let Some(byte) = bytes.get(i) {
        match byte {
            b'"' => return i,
            b'\\' => i += 2,
            _ => i += 1,
        }
    }
    bytes.len()
}

fn told(open: &[Level]) -> String {
    let mut text = String::new();
    for level in open {
        if level.is_list {
            text += &format!("[{}]", level.index);
            continue;
        }
        let name = level.name.as_ref().filter(|_| !text.is_empty());
        if let Some(name) = name {
            text += &format!(" ({name})");
        }
        if let Some(key) = &level.key {
            let between = match (text.is_empty(), name.is_some()) {
                (true, _) => "",
                (false, true) => ": ",
                (false, false) => ".",
            };
            text += &format!("{between}{key}");
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::at;

    #[test]
    fn the_way_to_an_offset_has_keys_indices_and_names() {
        let text = r#"{"scene": "a, \"b\" [", "joints": [{"id": "x"}, {"id": "door", "origin": [0.5, NaN]}]}"#;
        let offset = text.find("NaN").unwrap_or(0);
        assert_eq!(at(text, offset), "joints[1] (door): origin[1]");
        assert_eq!(at("{\"frames\": [{\"frame\": 12, \"at\": ", 999), "frames[0] (frame 12): at");
        assert_eq!((at("", 0), at("{", 1), at("é\"", 2)), (String::new(), String::new(), String::new()));
        assert_eq!(at(&"[".repeat(1000), 1000), "");
    }
}
