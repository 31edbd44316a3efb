//! Names for interactions that nobody named: a language model sees a few pictures of each and says what is opened or closed.
//!
//! What it says is taken for what a person might have said, and weighs no more (`reasoning.name_accuracy`): a name counts where it
//! is one of furniture that the lexicon knows, a verb where the model's own words on before and after bear it out and geometry
//! has none. Words never lose a clip.

use serde_json::Value;

use super::asking::in_order;
use super::marks;
use super::prompts::{NameQuestion, Prompts};
use crate::config;
use crate::error::Result;
use crate::math::sampling;
use crate::recording::{Clip, Recording, narration};
use crate::vlm::{LanguageModel, PictureQuestion, Sampling};

/// What a model said of an interaction; empty where it does not know.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Named {
    /// "open" or "close".
    pub verb: &'static str,
    /// The furniture, as the lexicon writes it.
    pub noun: &'static str,
}

/// Who names interactions, and how.
#[derive(Clone, Copy)]
pub struct Naming<'a> {
    /// Who is asked.
    pub model: &'a dyn LanguageModel,
    /// How.
    pub prompts: &'a Prompts,
    /// How many pictures, and how to answer.
    pub config: &'a config::Reasoning,
    /// Questions under way at the same time.
    pub at_once: usize,
}

/// Whether nobody said what a clip is about.
#[must_use]
pub fn is_unnamed(clip: &Clip) -> bool {
    clip.narration.trim().is_empty() && clip.noun.trim().is_empty()
}

impl Naming<'_> {
    /// The clips of a recording in their order, with words for those that had none where the model has them.
    ///
    /// # Errors
    /// What [`LanguageModel::ask`] calls an error, and a template that cannot be filled.
    pub fn clips(&self, recording: &Recording) -> Result<Vec<Clip>> {
        let clips = &recording.clips;
        in_order(clips.len(), self.at_once, |i| {
            let clip = &clips[i];
            let answer = if is_unnamed(clip) { self.ask(recording, clip)? } else { None };
            Ok(answer.map_or_else(|| clip.clone(), |said| with_words(clip, read(&said))))
        })
    }

    /// The answer about one clip; `None` where there is nothing to show, or no answer.
    fn ask(&self, recording: &Recording, clip: &Clip) -> Result<Option<String>> {
        let seen: Vec<usize> = (clip.start_frame..=clip.end_frame)
            .filter(|&f| recording.frames.get(f).is_some_and(|f| f.files.rgb.is_some()))
            .collect();
        let mut pictures = Vec::new();
        for frame in sampling::evenly(&seen, self.config.vlm_name_frames) {
            // What cannot be decoded is not shown; the pipeline names it.
            if let Ok(Some(image)) = recording.rgb(frame) {
                pictures.push(marks::jpeg(&marks::shrunk(&image, self.config.vlm_picture_px))?);
            }
        }
        if pictures.is_empty() {
            return Ok(None);
        }
        let names = narration::furniture_names().join(", ");
        let text = self.prompts.naming(&NameQuestion { count: pictures.len(), names: &names })?;
        let sampling = Sampling {
            temperature: self.config.vlm_temperature,
            top_p: self.config.vlm_top_p,
            max_tokens: self.config.vlm_max_tokens,
        };
        self.model.ask(&PictureQuestion { purpose: format!("{}/name", clip.clip), text, pictures, sampling })
    }
}

/// Reads an answer: leniently where it stands, strictly what it says.
#[must_use]
pub fn read(answer: &str) -> Named {
    let said = answer.rsplit_once("</think>").map_or(answer, |(_, said)| said);
    let inside = said.find('{').zip(said.rfind('}')).and_then(|(from, to)| said.get(from..=to));
    let Some(Value::Object(said)) = inside.and_then(|text| serde_json::from_str::<Value>(text).ok()) else {
        return Named::default();
    };
    let word = |key: &str| said.get(key).and_then(Value::as_str).unwrap_or_default().trim().to_lowercase();
    let noun = narration::furniture_word(&word("noun")).unwrap_or_default();
    // Who says that something opens has to say that it was closed and is open: a slip of one word is told from the other two.
    let verb = match (word("verb").as_str(), word("before").as_str(), word("after").as_str()) {
        ("open", "closed", "open") => "open",
        ("close", "open", "closed") => "close",
        _ => "",
    };
    Named { verb, noun }
}

/// The clip with these words. Its own verb stays; where the words would say that nothing is moved, the clip does.
fn with_words(clip: &Clip, said: Named) -> Clip {
    /// Format: of the words for a motion that say no way, one that is said of anything.
    const EITHER: &str = "swing";
    let verb = [clip.verb.as_str(), said.verb, if said.noun.is_empty() { "" } else { EITHER }]
        .into_iter()
        .find(|verb| !verb.trim().is_empty())
        .unwrap_or_default();
    let named = Clip { verb: verb.to_owned(), noun: said.noun.to_owned(), ..clip.clone() };
    if narration::read(&named).moves_joint == Some(false) { clip.clone() } else { named }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::articulation::Action;

    fn clip(verb: &str) -> Clip {
        Clip {
            clip: "found_000".to_owned(),
            start_frame: 0,
            end_frame: 9,
            narration: String::new(),
            verb: verb.to_owned(),
            noun: String::new(),
        }
    }

    #[test]
    fn answers_are_read_wherever_they_stand_and_believed_where_they_agree_with_themselves() {
        let said = |text: &str| {
            let Named { verb, noun } = read(text);
            (verb, noun)
        };
        let open = r#"{"verb": "open", "noun": "cupboard", "before": "closed", "after": "open"}"#;
        assert_eq!(said(open), ("open", "cupboard"));
        assert_eq!(said(&format!("<think>a {{drawer}}?</think>Sure!\n```json\n{open}\n```")), ("open", "cupboard"));
        let close = r#"{"verb": "Close", "noun": " Drawers ", "before": "open", "after": "CLOSED"}"#;
        assert_eq!(said(close), ("close", "drawer"));
        // It contradicts itself: of the way nothing is taken.
        assert_eq!(said(r#"{"verb": "open", "noun": "oven", "before": "open", "after": "closed"}"#), ("", "oven"));
        assert_eq!(said(r#"{"verb": "open", "noun": "bottle", "before": "closed", "after": "open"}"#), ("open", ""));
        for nothing in ["unknown", "", "{", "{}", "[1]", r#"{"noun": 7, "verb": ["open"]}"#, "} {"] {
            assert_eq!(read(nothing), Named::default(), "{nothing}");
        }
    }

    #[test]
    fn words_add_to_a_clip_and_never_lose_it() {
        let drawer = Named { verb: "", noun: "drawer" };
        let named = with_words(&clip(""), drawer);
        let reading = narration::read(&named);
        assert_eq!((reading.moves_joint, reading.action), (Some(true), None));
        assert_eq!(reading.furniture.as_deref(), Some("drawer"));
        // What the motion told stands.
        let named = with_words(&clip("close"), Named { verb: "open", ..drawer });
        assert_eq!(narration::read(&named).action, Some(Action::Close));
        let named = with_words(&clip(""), Named { verb: "open", ..drawer });
        assert_eq!(narration::read(&named).action, Some(Action::Open));
        // Of every name that can be said, with and without a verb.
        for noun in narration::furniture_names() {
            for verb in ["", "open", "close"] {
                let said = Named { verb: "", noun: narration::furniture_word(noun).unwrap() };
                assert_ne!(narration::read(&with_words(&clip(verb), said)).moves_joint, Some(false), "{verb} {noun}");
            }
        }
        assert_eq!(with_words(&clip(""), Named::default()), clip(""));
    }
}
