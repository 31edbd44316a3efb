//! Who answers questions about pictures: an OpenAI-compatible server, stored answers, or nobody (§3.3, §A.6).
//!
//! Everything is reached through [`LanguageModel`]. An answer that cannot be had is `None`, counted with its reason in [`Usage`]:
//! the inference goes on without it.

pub mod absent;
#[cfg(feature = "vlm-http")]
pub mod server;
pub mod store;

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;

use crate::error::Result;

/// An encoded picture.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct EncodedPicture {
    /// JPEG or PNG.
    pub bytes: Vec<u8>,
    /// `image/jpeg` or `image/png`.
    pub mime: &'static str,
    /// Width and height, pixels.
    pub size: [u32; 2],
}

/// How a model draws its answer (§B.1).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sampling {
    /// Temperature.
    pub temperature: f64,
    /// Nucleus.
    pub top_p: f64,
    /// Longest answer, tokens.
    pub max_tokens: usize,
}

/// One question.
#[derive(Debug, Clone, PartialEq)]
pub struct PictureQuestion {
    /// What it is for: the clip's name, a slash, and a name for a file ("clip_000/motion_01_frame_000031").
    pub purpose: String,
    /// The prompt.
    pub text: String,
    /// What goes with it.
    pub pictures: Vec<EncodedPicture>,
    /// How to answer.
    pub sampling: Sampling,
}

impl PictureQuestion {
    /// Estimated tokens of prompt and pictures: one per four bytes of text; a picture as OpenAI counts it in high detail,
    /// 85 plus 170 for each tile of 512 pixels after fitting it into 2048 x 2048 and its shorter side into 768.
    #[must_use]
    pub fn tokens(&self) -> usize {
        let picture = |p: &EncodedPicture| {
            let size = p.size.map(f64::from);
            let (long, short) = (size[0].max(size[1]).max(1.0), size[0].min(size[1]).max(1.0));
            let scale = (2048.0 / long).min(1.0);
            let scale = scale * (768.0 / (short * scale)).min(1.0);
            let tiles = size.map(|s| (s * scale / 512.0).ceil().max(1.0) as usize);
            85 + 170 * tiles[0] * tiles[1]
        };
        self.text.len().div_ceil(4) + self.pictures.iter().map(picture).sum::<usize>()
    }
}

/// Whoever answers.
pub trait LanguageModel: Sync {
    /// The answer as text; `None` where there is none that could be used, the reason counted in [`LanguageModel::usage`].
    ///
    /// # Errors
    /// Only what must end the run: a refused key, an answer that cannot be stored.
    fn ask(&self, question: &PictureQuestion) -> Result<Option<String>>;

    /// The model's name.
    fn name(&self) -> &str;

    /// What has been asked so far.
    fn usage(&self) -> Usage;
}

impl<M: LanguageModel + ?Sized> LanguageModel for &M {
    fn ask(&self, question: &PictureQuestion) -> Result<Option<String>> {
        (**self).ask(question)
    }

    fn name(&self) -> &str {
        (**self).name()
    }

    fn usage(&self) -> Usage {
        (**self).usage()
    }
}

/// What was asked, and what became of it.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Usage {
    /// Questions put to the model (in a dry run: that would be).
    pub asked: usize,
    /// HTTP requests sent, repetitions included.
    pub requests: usize,
    /// Questions that a stored answer settled.
    pub from_store: usize,
    /// Stored answers that cannot be read, each with what is wrong with it: they count as no answer.
    pub damaged: BTreeSet<String>,
    /// Questions not asked because all allowed requests were used.
    pub refused: usize,
    /// Questions without a usable answer, by reason.
    pub failed: BTreeMap<String, usize>,
    /// Pictures that went with the questions asked.
    pub pictures: usize,
    /// Estimated tokens of the questions asked ([`PictureQuestion::tokens`]).
    pub tokens: usize,
}

impl Usage {
    /// Counts a question as asked.
    fn ask(&mut self, question: &PictureQuestion) {
        self.asked += 1;
        self.pictures += question.pictures.len();
        self.tokens += question.tokens();
    }

    /// Counts a question as failed.
    fn fail(&mut self, reason: &str) {
        // Servers word their messages as they like: the list stays short whatever they say.
        const REASONS: usize = 8;
        let key =
            if self.failed.contains_key(reason) || self.failed.len() < REASONS { reason } else { "other reasons" };
        *self.failed.entry(key.to_owned()).or_default() += 1;
    }

    /// Questions without a usable answer.
    #[must_use]
    pub fn failures(&self) -> usize {
        self.failed.values().sum()
    }

    /// One line for people.
    #[must_use]
    pub fn sentence(&self, model: &str) -> String {
        let mut text = format!(
            "{model}: {} questions asked in {} requests ({} pictures, about {} tokens), {} answered from stored answers",
            self.asked, self.requests, self.pictures, self.tokens, self.from_store
        );
        if self.refused > 0 {
            let _ = write!(text, ", {} not asked (--max-requests is used up; run again to go on)", self.refused);
        }
        if self.failures() > 0 {
            let reasons: Vec<String> = self.failed.iter().map(|(reason, n)| format!("{n} x {reason}")).collect();
            let _ = write!(text, ", {} without an answer: {}", self.failures(), reasons.join("; "));
        }
        for damaged in &self.damaged {
            let _ = write!(text, "\n{damaged}; mend or delete this answer");
        }
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_cost_what_openai_says() {
        let tokens = |size: [u32; 2]| {
            let picture = EncodedPicture { bytes: Vec::new(), mime: "image/jpeg", size };
            let sampling = Sampling { temperature: 0.5, top_p: 0.3, max_tokens: 9 };
            PictureQuestion { purpose: String::new(), text: "abcde".to_owned(), pictures: vec![picture], sampling }
                .tokens()
        };
        // 1024 x 1024 shrinks to 768 x 768: four tiles. 2048 x 4096 to 768 x 1536: six. Text adds two.
        assert_eq!(tokens([1024, 1024]), 2 + 765);
        assert_eq!(tokens([2048, 4096]), 2 + 1105);
        assert_eq!(tokens([320, 240]), 2 + 255);
    }

    #[test]
    fn the_list_of_reasons_stays_short() {
        let mut usage = Usage::default();
        for i in 0..100 {
            usage.fail(&format!("reason {}", i % 50));
        }
        assert_eq!(usage.failures(), 100);
        assert!(usage.failed.len() <= 9 && usage.sentence("m").contains("other reasons"));
    }
}
