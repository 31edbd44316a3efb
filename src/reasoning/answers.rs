//! Answers of a language model: read leniently, checked strictly. What cannot be understood is "unknown".

use crate::articulation::JointKind;

/// What an answer to the question for the motion type says.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Motion {
    /// The furniture, in lower case.
    pub furniture: Option<String>,
    /// How its part moves.
    pub kind: Option<JointKind>,
}

/// Beginnings of words that mean turning, in the languages that models fall into.
const ROTATION: &[&str] = &[
    "rotat",
    "rotac",
    "rotaç",
    "rotaz",
    "revolut",
    "hinge",
    "pivot",
    "swing",
    "swivel",
    "turning",
    "dreh",
    "schwenk",
    "giro",
    "girar",
    "giratori",
    "tourn",
    "вращ",
    "поворот",
    "旋转",
    "轉動",
    "转动",
    "回転",
];
/// Beginnings of words that mean sliding.
const TRANSLATION: &[&str] = &[
    "translat",
    "translac",
    "traslac",
    "traslad",
    "translaç",
    "traslaz",
    "prismat",
    "linear",
    "linéair",
    "lineal",
    "slid",
    "verschieb",
    "verschob",
    "schieb",
    "gleit",
    "desliz",
    "glisse",
    "couliss",
    "scorr",
    "поступ",
    "сдвиг",
    "скольж",
    "平移",
    "滑动",
    "滑動",
    "スライド",
    "並進",
];
/// Beginnings of words that say that nothing can be said.
const UNKNOWN: &[&str] = &[
    "unknown",
    "unclear",
    "uncertain",
    "undetermined",
    "undefined",
    "unable",
    "cannot",
    "unsure",
    "ambiguous",
    "unbekannt",
    "unklar",
    "desconocid",
    "inconnu",
    "sconosciut",
    "desconhecid",
    "неизвест",
    "未知",
    "不明",
];
/// Words that turn what follows into its opposite.
const NEGATION: &[&str] = &[
    "no", "not", "never", "without", "neither", "nor", "isn", "doesn", "than", "nicht", "kein", "keine", "ohne", "sin",
    "pas",
];
/// Words that say that no line is meant.
const NONE: &[&str] = &[
    "none", "nothing", "neither", "keine", "keiner", "nichts", "ninguno", "ninguna", "aucun", "aucune", "nessuno",
    "nessuna", "nenhum", "nenhuma", "нет", "没有", "無し", "なし", "无", "無",
];
/// Beginnings of words in front of the number of a line.
const LINE: &[&str] = &[
    "line", "lini", "líne", "lign", "linh", "лини", "number", "numbers", "nummer", "option", "label", "axis", "axes",
    "线", "線",
];
/// Names of fields, in front of what they hold.
const FURNITURE_FIELDS: &[&str] = &["furniture", "furniture name", "object", "fixture", "name", "möbel"];
const MOTION_FIELDS: &[&str] = &["motion", "motion type", "type", "movement", "joint", "joint type", "bewegung"];
const ANSWER_FIELDS: &[&str] = &["answer", "final answer", "response", "output", "result", "antwort"];

/// Format: longer texts are cut, an answer is a line.
const LONGEST: usize = 4000;

/// Reads "cupboard:rotation" and whatever models make of it.
#[must_use]
pub fn motion(text: &str) -> Motion {
    let text = said(text);
    let mut furniture = None;
    let mut named: Vec<(Option<String>, Option<JointKind>)> = Vec::new();
    // "a:b, c:d", JSON, one field a line: pieces with a colon.
    for piece in text.split(['\n', ',', ';', '{', '}', '(', ')', '。']) {
        let parts: Vec<String> = piece.split([':', '：']).map(plain).filter(|p| !p.is_empty()).collect();
        let [.., field, value] = parts.as_slice() else { continue };
        if FURNITURE_FIELDS.contains(&field.as_str()) {
            furniture = furniture.or_else(|| name(value));
        } else if MOTION_FIELDS.contains(&field.as_str()) || ANSWER_FIELDS.contains(&field.as_str()) {
            if says_motion(value) {
                named.push((None, kind(value)));
            }
        } else if says_motion(value) {
            named.push((name(field), kind(value)));
        }
    }
    if named.is_empty() {
        // No field says it: the whole text does, or nothing.
        return Motion { furniture, kind: kind(&plain(&text)) };
    }
    let furniture = furniture.or_else(|| named.iter().find_map(|(name, _)| name.clone()));
    // Several that differ are examples or a discussion.
    let first = named[0].1;
    let kind = first.filter(|_| named.iter().all(|(_, kind)| *kind == first));
    Motion { furniture, kind }
}

/// Reads "Line 2: cupboard door hinge", "1, 3", "none": numbers from 1 to `offered`, ascending; empty for none of them,
/// `None` where the answer says neither. Numbers that were not offered do not count.
#[must_use]
pub fn lines(text: &str, offered: usize) -> Option<Vec<usize>> {
    let text = said(text);
    let (mut explicit, mut alone, mut leading, mut none) = (Vec::new(), Vec::new(), Vec::new(), false);
    for piece in pieces(&text) {
        let tokens = tokens(&piece);
        if tokens.iter().any(|t| NONE.contains(&t.as_str())) {
            none = true;
            continue;
        }
        if tokens.iter().any(|t| NEGATION.contains(&t.as_str())) {
            // "no line": none. "line 3 is not a hinge": says nothing of the others.
            none |= tokens.windows(2).any(|w| NEGATION.contains(&w[0].as_str()) && begins(&w[1], LINE));
            continue;
        }
        let numbers = |tokens: &[String]| -> Vec<usize> { tokens.iter().map_while(|t| number(t)).collect() };
        let listed: Vec<String> =
            tokens.iter().filter(|t| !["and", "or", "und", "y", "et", "e"].contains(&t.as_str())).cloned().collect();
        for (i, token) in listed.iter().enumerate() {
            if begins(token, LINE) {
                let follow = numbers(&listed[i + 1..]);
                // "line two", but not "two lines".
                let word = listed.get(i + 1).and_then(|t| WORDS.iter().position(|w| *w == t.as_str())).map(|n| n + 1);
                explicit.extend(follow.into_iter().chain(word));
            }
        }
        let first = numbers(&listed);
        if !first.is_empty() {
            if first.len() == listed.len() { alone.extend(first) } else { leading.extend(first) }
        }
    }
    let offered_of = |numbers: Vec<usize>| -> Option<Vec<usize>> {
        let mut kept: Vec<usize> = numbers.into_iter().filter(|n| (1..=offered).contains(n)).collect();
        kept.sort_unstable();
        kept.dedup();
        (!kept.is_empty()).then_some(kept)
    };
    // "the 2 doors ... none" names no line; "2" does, and "Line 2" does whatever else is said.
    offered_of(explicit).or_else(|| offered_of(alone)).or_else(|| none.then(Vec::new)).or_else(|| offered_of(leading))
}

const WORDS: [&str; 9] = ["one", "two", "three", "four", "five", "six", "seven", "eight", "nine"];

/// What is said in the end, in lower case: without the thoughts of models that think aloud, and cut.
fn said(text: &str) -> String {
    let text = text.rsplit_once("</think>").map_or(text, |(_, said)| said);
    text.chars().take(LONGEST).collect::<String>().to_lowercase()
}

/// Words separated by single blanks, marks and quotes left out.
fn plain(text: &str) -> String {
    let text: String = text.chars().map(|c| if c.is_alphanumeric() { c } else { ' ' }).collect();
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// Whether a word begins with one of the stems; scripts without blanks hold it anywhere.
fn begins(word: &str, stems: &[&str]) -> bool {
    stems.iter().any(|stem| word.starts_with(stem) || (!stem.is_ascii() && word.contains(stem)))
}

fn says_motion(value: &str) -> bool {
    value.split(' ').any(|word| [ROTATION, TRANSLATION, UNKNOWN].iter().any(|stems| begins(word, stems)))
}

/// The one kind of motion that a text names without taking it back.
fn kind(text: &str) -> Option<JointKind> {
    let words: Vec<&str> = text.split(' ').collect();
    if words.iter().any(|word| begins(word, UNKNOWN)) {
        return None;
    }
    let named = |stems: &[&str]| {
        (0..words.len()).any(|i| {
            // "no rotation", "not a rotation", "rather than rotating".
            begins(words[i], stems) && !words[i.saturating_sub(2)..i].iter().any(|w| NEGATION.contains(w))
        })
    };
    match (named(ROTATION), named(TRANSLATION)) {
        (true, false) => Some(JointKind::Revolute),
        (false, true) => Some(JointKind::Prismatic),
        _ => None,
    }
}

/// A name of furniture: a few words, none of which says that there is none.
fn name(text: &str) -> Option<String> {
    /// Format: words of a name.
    const MOST_WORDS: usize = 3;
    let words: Vec<&str> = text.split(' ').collect();
    let fits = words.len() <= MOST_WORDS
        && !words.iter().any(|w| begins(w, UNKNOWN) || w.chars().any(|c| c.is_ascii_digit()))
        && !ANSWER_FIELDS.contains(&text)
        && !MOTION_FIELDS.contains(&text);
    (fits && !text.is_empty()).then(|| text.to_owned())
}

/// Sentences and clauses; a full stop or a comma inside of a list of numbers or a decimal number does not end one.
fn pieces(text: &str) -> Vec<String> {
    let chars: Vec<char> = text.chars().collect();
    let mut out = vec![String::new()];
    for (i, &c) in chars.iter().enumerate() {
        let ends = match c {
            '\n' | ';' | '!' | '?' | '。' => true,
            '.' => !chars.get(i + 1).is_some_and(char::is_ascii_digit),
            ',' => !chars[i + 1..].iter().find(|n| !n.is_whitespace()).is_some_and(char::is_ascii_digit),
            _ => false,
        };
        if ends {
            out.push(String::new());
        } else if let Some(last) = out.last_mut() {
            last.push(c);
        }
    }
    out
}

/// Words and numbers; "line2" is two of them, "2.5" is one.
fn tokens(text: &str) -> Vec<String> {
    let mut out: Vec<String> = Vec::new();
    let mut last = ' ';
    for c in text.chars() {
        let joins = match (last, c) {
            (a, b) if a.is_ascii_digit() => b.is_ascii_digit() || b == '.',
            ('.', b) => b.is_ascii_digit(),
            (a, b) => a.is_alphabetic() && b.is_alphabetic(),
        };
        let begins_one = c.is_alphabetic() || c.is_ascii_digit();
        if joins && let Some(token) = out.last_mut() {
            token.push(c);
        } else if begins_one {
            out.push(c.to_string());
        }
        last = c;
    }
    out
}

/// The number that a token is; "2." is 2, "2.5" is none.
fn number(token: &str) -> Option<usize> {
    token.trim_end_matches('.').parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use JointKind::{Prismatic, Revolute};

    #[test]
    fn motion_types_are_understood_in_many_forms() {
        for (text, furniture, kind) in [
            ("cupboard:rotation", Some("cupboard"), Some(Revolute)),
            ("**Drawer : Translation**.", Some("drawer"), Some(Prismatic)),
            ("`fridge:rotation`\n", Some("fridge"), Some(Revolute)),
            ("Washing machine: rotational", Some("washing machine"), Some(Revolute)),
            ("Answer: drawer:translation", Some("drawer"), Some(Prismatic)),
            ("Answer: translation", None, Some(Prismatic)),
            ("Furniture: oven\nMotion type: rotation", Some("oven"), Some(Revolute)),
            (r#"{"furniture": "drawer", "motion_type": "translation"}"#, Some("drawer"), Some(Prismatic)),
            ("```json\n{\"furniture\":\"cabinet\",\n\"motion\":\"rotation\"}\n```", Some("cabinet"), Some(Revolute)),
            ("The part is a drawer, so it slides out: drawer:translation", Some("drawer"), Some(Prismatic)),
            ("It is a translation, not a rotation.", None, Some(Prismatic)),
            ("The door swings rather than slides.", None, Some(Revolute)),
            ("revolute", None, Some(Revolute)),
            (
                "<think>rotation? translation? a:translation</think>\n\ncupboard:rotation",
                Some("cupboard"),
                Some(Revolute),
            ),
            // Other languages.
            ("Schrank: Drehung", Some("schrank"), Some(Revolute)),
            ("Schublade: Verschiebung", Some("schublade"), Some(Prismatic)),
            ("cajón: traslación", Some("cajón"), Some(Prismatic)),
            ("armario:rotación", Some("armario"), Some(Revolute)),
            ("placard : rotation", Some("placard"), Some(Revolute)),
            ("шкаф: вращение", Some("шкаф"), Some(Revolute)),
            ("抽屉：平移", Some("抽屉"), Some(Prismatic)),
            ("冰箱:旋转", Some("冰箱"), Some(Revolute)),
        ] {
            let read = motion(text);
            assert_eq!((read.furniture.as_deref(), read.kind), (furniture, kind), "{text}");
        }
    }

    #[test]
    fn motion_types_that_say_nothing_are_unknown() {
        for (text, furniture) in [
            ("unknown:unknown", None),
            ("cupboard:unknown", Some("cupboard")),
            ("unknown", None),
            ("I cannot determine whether this is a rotation or a translation.", None),
            ("cupboard:rotation or translation", Some("cupboard")),
            // The examples of the prompt, recited.
            ("cupboard:rotation\ndrawer:translation\nunknown:unknown", Some("cupboard")),
            ("Sorry, I can't help with that.", None),
            ("", None),
            ("\u{0}\u{fffd}:::::\n,,,{{{{", None),
            ("0:1", None),
            ("no rotation", None),
        ] {
            let read = motion(text);
            assert_eq!((read.furniture.as_deref(), read.kind), (furniture, None), "{text}");
        }
        // A name is a name, not a story.
        let story = "the hand that comes from the left is at the lower door: rotation";
        assert_eq!(motion(story), Motion { furniture: None, kind: Some(Revolute) });
        assert_eq!(motion(&"rotation:".repeat(100_000)).kind, Some(Revolute));
    }

    #[test]
    fn line_numbers_are_understood_in_many_forms() {
        for (text, expected) in [
            ("Line 2: cupboard door hinge", &[2][..]),
            ("1, 3", &[1, 3]),
            ("1 and 3", &[1, 3]),
            ("lines 2 and 4", &[2, 4]),
            ("Lines 4, 2, 2 are hinges", &[2, 4]),
            ("**Line 3**: fridge door", &[3]),
            ("2", &[2]),
            ("2.", &[2]),
            ("#4", &[4]),
            ("(1)", &[1]),
            ("line2", &[2]),
            ("Line two", &[2]),
            ("2: cupboard door hinge", &[2]),
            ("1, 3: left and right door", &[1, 3]),
            (r#"{"lines": [2, 4]}"#, &[2, 4]),
            (r#"{"line": 2, "furniture": "cupboard"}"#, &[2]),
            ("[1,3]", &[1, 3]),
            ("Line 1: none, Line 2: cupboard hinge", &[2]),
            ("Line 2. None of the others.", &[2]),
            ("1, none of the others", &[1]),
            ("Line 2, not 3", &[2]),
            ("Line 2, 7", &[2]),
            ("Line 2 (90% sure)", &[2]),
            ("- Line 1: oven door\n- Line 4: fridge door", &[1, 4]),
            ("<think>line 1 or line 3?</think>Line 4", &[4]),
            ("Linie 3: Schranktür", &[3]),
            ("línea 2", &[2]),
            ("线2：柜门", &[2]),
        ] {
            assert_eq!(lines(text, 4).as_deref(), Some(expected), "{text}");
        }
    }

    #[test]
    fn no_line_is_an_answer_and_garbage_is_none() {
        for text in [
            "none",
            "None.",
            "**none**",
            "none of the lines 1, 3 are hinges",
            "the 2 doors in the picture have hinges that are not drawn; none",
            "2 doors are to be seen. none",
            "No line is a hinge",
            "There is no line that fits",
            "keine",
            "ninguna",
            r#"{"answer": "none"}"#,
            "没有",
        ] {
            assert_eq!(lines(text, 4), Some(Vec::new()), "{text}");
        }
        for text in [
            "",
            "7",
            "Line 9",
            "0",
            "two lines",
            "I see a kitchen with 2 doors",
            "Line 3 is not a hinge",
            "99999999999999999999999",
            "2.5",
            "cupboard:rotation",
            "\u{0}\u{fffd}",
        ] {
            assert_eq!(lines(text, 4), None, "{text}");
        }
        assert_eq!(lines(&"line 1, ".repeat(100_000), 4), Some(vec![1]));
    }
}
