//! What a narration says without any network: does it move a joint, which way, and what furniture does it name?
//!
//! The words are data (`assets/narration.toml`).

use std::sync::LazyLock;

use serde::{Deserialize, Serialize};

use super::{Clip, Recording};
use crate::articulation::{Action, JointKind};

/// The lexicon, parsed once.
static LEXICON: LazyLock<Lexicon> =
    LazyLock::new(|| toml::from_str(include_str!("../../assets/narration.toml")).unwrap_or_default());

#[derive(Debug, Default, Deserialize)]
struct Lexicon {
    open: Vec<String>,
    close: Vec<String>,
    either: Vec<String>,
    weak: Vec<String>,
    grasp: Vec<String>,
    hinge: Vec<String>,
    generic: Vec<String>,
    slide: Vec<String>,
    unspecific: Vec<String>,
    portable: Vec<String>,
    handheld: Vec<String>,
    control: Vec<String>,
}

/// Names of all furniture that is known, lower case: of what turns, what slides, and what is said of either. How each is hung is
/// `priors.hung` of the config.
#[must_use]
pub fn furniture_names() -> Vec<&'static str> {
    let lexicon = &*LEXICON;
    [&lexicon.hinge, &lexicon.slide, &lexicon.generic].into_iter().flatten().map(String::as_str).collect()
}

/// A name of furniture as the lexicon writes it, where it knows it: lower case, singular.
#[must_use]
pub fn furniture_word(said: &str) -> Option<&'static str> {
    let said = plain(said);
    furniture_names().into_iter().find(|name| same(&said, name))
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

impl Reading {
    /// What its words are worth: "door", said of whatever opens, half of what a name is.
    #[must_use]
    pub fn strength(&self) -> f64 {
        if self.generic { 0.5 } else { 1.0 }
    }

    /// Whether they name a piece of furniture that opens, rather than "door" or "it".
    #[must_use]
    pub fn names_furniture(&self) -> bool {
        self.kind.is_some() && !self.generic
    }
}

/// Reads a clip's narration, verb and noun.
#[must_use]
pub fn read(clip: &Clip) -> Reading {
    let narration = plain(&clip.narration);
    let columns = plain(&format!("{} {}", clip.verb, clip.noun));
    let tokens: Vec<&str> = narration.split(' ').chain(columns.split(' ')).filter(|t| !t.is_empty()).collect();
    if tokens.is_empty() {
        return Reading { moves_joint: None, action: None, furniture: None, kind: None, generic: false };
    }
    let lexicon = &*LEXICON;
    let verb = |words: &'static [String]| longest(&tokens, words, VERB_REACH);
    let noun = |words: &'static [String]| longest(&tokens, words, 1);

    let (open, close, either) = (verb(&lexicon.open), verb(&lexicon.close), verb(&lexicon.either));
    let action = match (open, close) {
        (Some(o), Some(c)) if o.len() > c.len() => Some(Action::Open),
        (Some(o), Some(c)) if o.len() == c.len() => None,
        (_, Some(_)) => Some(Action::Close),
        (Some(_), None) => Some(Action::Open),
        (None, None) => None,
    };
    let (hinge, slide) = (noun(&lexicon.hinge), noun(&lexicon.slide));
    // "the dishwasher drawer" slides, "the drawer door" does too: the slide's word is the rarer, so it decides.
    let generic = noun(&lexicon.generic).filter(|_| hinge.is_none() && slide.is_none());
    let (furniture, kind) = match (hinge.or(generic), slide) {
        (_, Some(w)) => (Some(w.clone()), Some(JointKind::Prismatic)),
        (Some(w), None) => (Some(w.clone()), Some(JointKind::Revolute)),
        (None, None) => (None, None),
    };

    // Furniture that is never carried about; of two words the one that is decides ("the lid of the chest").
    let fixed =
        [hinge, slide].into_iter().flatten().any(|w| !lexicon.portable.contains(w)) || noun(&lexicon.generic).is_some();
    let strong = [open, close, either].into_iter().flatten().any(|w| !lexicon.weak.contains(w));
    let weak =
        [open, close, either].into_iter().flatten().next().is_some() && (fixed || noun(&lexicon.unspecific).is_some());
    let grasped = grasps(if narration.is_empty() { &columns } else { &narration }, lexicon);
    let names_motion = strong || weak || grasped;
    let object = object(if narration.is_empty() { &columns } else { &narration }, lexicon);
    let handheld = ends_with(&object, &lexicon.handheld) || (!fixed && noun(&lexicon.handheld).is_some());
    let worked = noun(&lexicon.control).is_some();
    Reading {
        moves_joint: Some(names_motion && !handheld && !worked),
        action,
        furniture,
        kind,
        generic: generic.is_some(),
    }
}

/// The recording as if people had called all furniture "it", and masks had no names: of what a clip says, its motion stays. Clips
/// that move nothing keep their words, which only say so.
#[must_use]
pub fn without_names(recording: &Recording) -> Recording {
    let clips = recording.clips.iter().map(unnamed).collect();
    let mut left_out = recording.left_out.clone();
    left_out.clips.iter_mut().for_each(|(clip, _)| *clip = unnamed(clip));
    Recording { clips, left_out, labels: Default::default(), ..recording.clone() }
}

fn unnamed(clip: &Clip) -> Clip {
    let reading = read(clip);
    if reading.moves_joint == Some(false) {
        return clip.clone();
    }
    let (verb, noun) = match reading.action {
        Some(Action::Open) => ("open", "it"),
        Some(Action::Close) => ("close", "it"),
        // A verb that tells no way may tell the type ("slide", "swing").
        None => ("", ""),
    };
    let narration = format!("{verb} {noun}").trim().to_owned();
    Clip { narration, verb: verb.to_owned(), noun: noun.to_owned(), ..clip.clone() }
}

/// How far the next word of a verb's phrase may stand: "pull the fridge door right open".
const VERB_REACH: usize = 5;

/// Lower case, words separated by single blanks.
fn plain(text: &str) -> String {
    let text = text.to_lowercase();
    let text: String = text.chars().map(|c| if c.is_alphanumeric() || c == '-' { c } else { ' ' }).collect();
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// Whether a token is a word or its plural.
fn same(token: &str, word: &str) -> bool {
    token == word || token.strip_suffix('s') == Some(word) || token.strip_suffix("es") == Some(word)
}

/// Whether a phrase stands in the text, each of its words at most `reach` after the one before.
fn stands(tokens: &[&str], phrase: &str, reach: usize) -> bool {
    let words: Vec<&str> = phrase.split(' ').collect();
    (0..tokens.len()).filter(|&i| same(tokens[i], words[0])).any(|first| {
        let next = |at: usize, word: &&str| {
            (at + 1..=at + reach).find(|&i| tokens.get(i).is_some_and(|token| same(token, word)))
        };
        words[1..].iter().try_fold(first, next).is_some()
    })
}

/// The longest of the words or phrases that stand in the text.
fn longest<'a>(tokens: &[&str], words: &'a [String], reach: usize) -> Option<&'a String> {
    words.iter().filter(|w| stands(tokens, w, reach)).max_by_key(|w| w.len())
}

/// What is opened or closed: the words after the first verb of motion, up to where the sentence goes on.
fn object<'a>(text: &'a str, lexicon: &Lexicon) -> Vec<&'a str> {
    const PASSED: [&str; 12] = ["out", "in", "up", "down", "back", "open", "shut", "closed", "the", "a", "an", "some"];
    const END: [&str; 22] = [
        "of", "with", "in", "from", "and", "to", "on", "onto", "into", "for", "then", "using", "by", "off", "at",
        "but", "out", "back", "open", "shut", "closed", "again",
    ];
    let begins = |token: &str| {
        [&lexicon.open, &lexicon.close, &lexicon.either]
            .into_iter()
            .flatten()
            .any(|w| w.split(' ').next().is_some_and(|first| same(token, first)))
    };
    text.split(' ')
        .skip_while(|token| !begins(token))
        .skip(1)
        .skip_while(|token| PASSED.contains(token))
        .take_while(|token| !END.contains(token))
        .collect()
}

/// Whether the last words of a text are one of the phrases.
fn ends_with(tokens: &[&str], phrases: &[String]) -> bool {
    phrases.iter().any(|phrase| {
        let words: Vec<&str> = phrase.split(' ').collect();
        tokens.len() >= words.len()
            && tokens[tokens.len() - words.len()..].iter().zip(&words).all(|(token, word)| same(token, word))
    })
}

/// Whether somebody takes hold of a door or a drawer and of nothing else.
fn grasps(text: &str, lexicon: &Lexicon) -> bool {
    let mut tokens = text.split(' ');
    if !tokens.next().is_some_and(|first| lexicon.grasp.iter().any(|w| same(first, w))) {
        return false;
    }
    let rest: Vec<&str> = tokens.filter(|t| !["the", "a", "of"].contains(t)).collect();
    let named = |token: &&str| {
        [&lexicon.hinge, &lexicon.slide, &lexicon.generic]
            .into_iter()
            .flatten()
            .flat_map(|w| w.split(' '))
            .any(|word| same(token, word))
    };
    rest.iter().all(named) && rest.iter().any(|token| same(token, "door") || same(token, "drawer"))
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
    fn furniture_is_known_by_its_names() {
        assert_eq!(furniture_word(" Washing Machines"), Some("washing machine"));
        assert_eq!(furniture_word("drawers"), Some("drawer"));
        assert_eq!(furniture_word("bottle"), None);
        assert_eq!(furniture_word(""), None);
        assert!(furniture_names().contains(&"door") && furniture_names().len() > 20);
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
            // As EPIC-KITCHENS narrates.
            ("shut dishwasher", true, Some(Close), Some(Revolute)),
            ("close window", true, Some(Close), Some(Revolute)),
            ("pull the drawer out", true, Some(Open), Some(Prismatic)),
            ("push the drawer back in", true, Some(Close), Some(Prismatic)),
            ("push the door open", true, Some(Open), Some(Revolute)),
            ("pull the door shut", true, Some(Close), Some(Revolute)),
            ("open draw", true, Some(Open), Some(Prismatic)),
            ("close coffee machine drawer", true, Some(Close), Some(Prismatic)),
            ("pull drawer of oven", true, Some(Open), Some(Prismatic)),
            ("open door and put down water bottle", true, Some(Open), Some(Revolute)),
            ("take spatula and close drawer", true, Some(Close), Some(Prismatic)),
            ("open oven again", true, Some(Open), Some(Revolute)),
            ("open bin", true, Some(Open), Some(Revolute)),
            ("lift the lid of the chest", true, Some(Open), Some(Revolute)),
            ("pull it open", true, Some(Open), None),
            ("take fridge door", true, None, Some(Revolute)),
            ("open the lid of the pan", false, Some(Open), Some(Revolute)),
            ("open dishwasher tablet packet", false, Some(Open), Some(Revolute)),
            ("open the box in the fridge", false, Some(Open), Some(Revolute)),
            ("put plate in cupboard", false, None, Some(Revolute)),
            ("take plate from drawer", false, None, Some(Prismatic)),
            ("turn on the oven", false, None, Some(Revolute)),
            ("push the button of the microwave", false, Some(Close), Some(Revolute)),
            ("push bin back", false, Some(Close), Some(Revolute)),
            ("pull out plate", false, Some(Open), None),
            ("push oven tray", false, Some(Close), Some(Revolute)),
            ("open tap", false, Some(Open), None),
            ("close box of carrots", false, Some(Close), None),
            ("open olive oil bottles", false, Some(Open), None),
        ] {
            let r = reading(text);
            assert_eq!((r.moves_joint, r.action, r.kind), (Some(moves), action, kind), "{text}");
        }
        assert_eq!(reading("").moves_joint, None);
    }

    #[test]
    fn without_names_the_motion_is_all_that_a_narration_tells() {
        for (text, verb, noun) in [
            ("open the fridge", "open", "fridge"),
            ("push the drawer back in", "push", "drawer"),
            ("lift the lid of the chest", "lift", "lid"),
            ("pull the door shut", "", ""),
            ("", "close", "oven"),
            ("shut it", "shut", "it"),
            ("slide the drawer", "slide", "drawer"),
        ] {
            let [narration, verb, noun] = [text, verb, noun].map(str::to_owned);
            let clip = Clip { clip: "c".to_owned(), start_frame: 3, end_frame: 9, narration, verb, noun };
            let (before, after) = (read(&clip), read(&unnamed(&clip)));
            assert_eq!((after.action, after.furniture, after.kind), (before.action, None, None), "{text}");
            assert_eq!(after.moves_joint, before.action.map(|_| true), "{text}");
            assert_eq!((unnamed(&clip).start_frame, unnamed(&clip).end_frame), (3, 9));
        }
        let [clip, verb, noun] = [(); 3].map(|()| String::new());
        let washing = Clip { clip, start_frame: 0, end_frame: 1, narration: "wash hands".to_owned(), verb, noun };
        assert_eq!(unnamed(&washing), washing);
    }
}
