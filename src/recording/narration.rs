//! What a narration says without any network: does it move a joint, which way, and what furniture does it name?
//!
//! The words are data (`assets/narration.toml`).

use std::sync::LazyLock;

use serde::{Deserialize, Serialize};

use super::Clip;
use crate::articulation::{Action, JointKind};

/// The lexicon, parsed once.
static LEXICON: LazyLock<Lexicon> =
    LazyLock::new(|| toml::from_str(include_str!("../../assets/narration.toml")).unwrap_or_default());

#[derive(Debug, Default, Deserialize)]
struct Lexicon {
    open: Vec<String>,
    close: Vec<String>,
    either: Vec<String>,
    hinge: Vec<String>,
    slide: Vec<String>,
    generic: Vec<String>,
    handheld: Vec<String>,
}

/// What the words say. `None` where they say nothing.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Reading {
    /// `Some(false)`: the narration is about something that moves no joint of the scene.
    pub moves_joint: Option<bool>,
    /// Opening or closing.
    pub action: Option<Action>,
    /// The word for the furniture, as found.
    pub furniture: Option<String>,
    /// The motion type that the furniture's name suggests.
    pub kind: Option<JointKind>,
    /// The name is a generic one ("door"), said of whatever opens.
    pub generic: bool,
}

/// Reads a clip's narration, verb and noun.
#[must_use]
pub fn read(clip: &Clip) -> Reading {
    let text = [&clip.narration, &clip.verb, &clip.noun].map(|s| s.to_lowercase()).join(" ");
    let text: String = text.chars().map(|c| if c.is_alphanumeric() || c == '-' { c } else { ' ' }).collect();
    let text = format!(" {} ", text.split_whitespace().collect::<Vec<_>>().join(" "));
    if text.trim().is_empty() {
        return Reading { moves_joint: None, action: None, furniture: None, kind: None, generic: false };
    }
    let lexicon = &*LEXICON;

    let (open, close) = (longest(&text, &lexicon.open), longest(&text, &lexicon.close));
    let action = match (open, close) {
        (Some(o), Some(c)) if o.len() > c.len() => Some(Action::Open),
        (Some(o), Some(c)) if o.len() == c.len() => None,
        (_, Some(_)) => Some(Action::Close),
        (Some(_), None) => Some(Action::Open),
        (None, None) => None,
    };
    let (hinge, slide) = (longest(&text, &lexicon.hinge), longest(&text, &lexicon.slide));
    // "the dishwasher drawer" slides, "the drawer door" does too: the slide's word is the rarer, so it decides.
    let generic = longest(&text, &lexicon.generic).filter(|_| hinge.is_none() && slide.is_none());
    let (furniture, kind) = match (hinge.or(generic), slide) {
        (_, Some(w)) => (Some(w.clone()), Some(JointKind::Prismatic)),
        (Some(w), None) => (Some(w.clone()), Some(JointKind::Revolute)),
        (None, None) => (None, None),
    };
    let names_motion = open.is_some() || close.is_some() || longest(&text, &lexicon.either).is_some();
    let handheld = longest(&text, &lexicon.handheld).is_some() && furniture.is_none();
    Reading { moves_joint: Some(names_motion && !handheld), action, furniture, kind, generic: generic.is_some() }
}

/// The longest of the words (or phrases, or their plurals) that stand in the text.
fn longest<'a>(text: &str, words: &'a [String]) -> Option<&'a String> {
    words
        .iter()
        .filter(|w| text.contains(&format!(" {w} ")) || text.contains(&format!(" {w}s ")))
        .max_by_key(|w| w.len())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn reading(narration: &str) -> Reading {
        read(&Clip {
            clip: String::new(),
            start_frame: 0,
            end_frame: 1,
            narration: narration.to_owned(),
            verb: String::new(),
            noun: String::new(),
        })
    }

    #[test]
    fn the_lexicon_parses() {
        assert!(LEXICON.open.len() > 3 && LEXICON.handheld.len() > 3);
    }

    #[test]
    fn narrations_of_kitchens_are_read_as_a_person_reads_them() {
        use Action::{Close, Open};
        use JointKind::{Prismatic, Revolute};
        for (text, moves, action, kind) in [
            ("open the fridge", true, Some(Open), Some(Revolute)),
            ("push closed the drawer", true, Some(Close), Some(Prismatic)),
            ("pull open the refrigerator", true, Some(Open), Some(Revolute)),
            ("close the compartment", true, Some(Close), None),
            ("shut it", true, Some(Close), None),
            ("Opens the drawers.", true, Some(Open), Some(Prismatic)),
            ("open the packet of rice", false, Some(Open), None),
            ("close the bottle", false, Some(Close), None),
            ("wash hands", false, None, None),
            ("pick up the knife", false, None, None),
            ("slide the drawer", true, None, Some(Prismatic)),
        ] {
            let r = reading(text);
            assert_eq!((r.moves_joint, r.action, r.kind), (Some(moves), action, kind), "{text}");
        }
        assert_eq!(reading("").moves_joint, None);
    }
}
