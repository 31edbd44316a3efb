//! Answers on disk, one JSON file each, named by what was asked: a second run asks nothing.

use std::collections::BTreeSet;
use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use super::{LanguageModel, PictureQuestion, Usage};
use crate::error::{Error, Result};
use crate::json;

/// A stored answer. The name of the file follows from model, sampling, prompt and pictures; the answer may be corrected by
/// hand.
#[derive(Debug, Serialize, Deserialize)]
struct Record {
    model: String,
    purpose: String,
    temperature: f64,
    top_p: f64,
    max_tokens: usize,
    prompt: String,
    /// SHA-256 of each picture's bytes.
    pictures: Vec<String>,
    answer: String,
}

/// A model with a memory.
#[derive(Debug)]
pub struct Stored<M> {
    inner: M,
    dir: PathBuf,
    writes: bool,
    from_store: AtomicUsize,
    written: AtomicUsize,
    damaged: Mutex<BTreeSet<String>>,
}

impl<M: LanguageModel> Stored<M> {
    /// Answers from `dir` where it can, asks `inner` where it cannot, and keeps what `inner` says.
    ///
    /// # Errors
    /// Where the folder cannot be made.
    pub fn new(inner: M, dir: &Path) -> Result<Self> {
        std::fs::create_dir_all(dir).map_err(|e| {
            let mut error = Error::io(dir, &e);
            if let Error::Io { message, .. } = &mut error {
                *message += "; answers are kept there, choose another folder with --answers";
            }
            error
        })?;
        Ok(Self { writes: true, ..Self::reading(inner, dir) })
    }

    /// The same, but keeps nothing: for a dry run and a replay.
    #[must_use]
    pub fn reading(inner: M, dir: &Path) -> Self {
        Self {
            inner,
            dir: dir.to_owned(),
            writes: false,
            from_store: AtomicUsize::new(0),
            written: AtomicUsize::new(0),
            damaged: Mutex::default(),
        }
    }

    fn path(&self, question: &PictureQuestion) -> PathBuf {
        self.dir.join(format!("{}.json", key(self.inner.name(), question)))
    }

    /// Through a file beside its place: a reader never sees half an answer.
    fn keep(&self, question: &PictureQuestion, answer: &str) -> Result<()> {
        let record = Record {
            model: self.inner.name().to_owned(),
            purpose: question.purpose.clone(),
            temperature: question.sampling.temperature,
            top_p: question.sampling.top_p,
            max_tokens: question.sampling.max_tokens,
            prompt: question.text.clone(),
            pictures: question.pictures.iter().map(|p| hex(&Sha256::digest(&p.bytes))).collect(),
            answer: answer.to_owned(),
        };
        let path = self.path(question);
        let number = self.written.fetch_add(1, Ordering::Relaxed);
        let staging = self.dir.join(format!(".partial-{}-{number}", std::process::id()));
        let text = json::text(&record)?;
        std::fs::write(&staging, text).and_then(|()| std::fs::rename(&staging, &path)).map_err(|e| {
            let _ = std::fs::remove_file(&staging);
            Error::io(&path, &e)
        })
    }
}

impl<M: LanguageModel> LanguageModel for Stored<M> {
    fn ask(&self, question: &PictureQuestion) -> Result<Option<String>> {
        let path = self.path(question);
        if path.is_file() {
            // A damaged one is not asked for again: somebody may have mended it by hand, all but a comma.
            return Ok(match json::read::<Record>(&path) {
                Ok(record) => {
                    self.from_store.fetch_add(1, Ordering::Relaxed);
                    Some(record.answer)
                }
                Err(error) => {
                    self.damaged.lock().unwrap_or_else(PoisonError::into_inner).insert(error.to_string());
                    None
                }
            });
        }
        let answer = self.inner.ask(question)?;
        if let Some(answer) = answer.as_deref().filter(|_| self.writes) {
            self.keep(question, answer)?;
        }
        Ok(answer)
    }

    fn name(&self) -> &str {
        self.inner.name()
    }

    fn usage(&self) -> Usage {
        let mut usage = self.inner.usage();
        usage.from_store += self.from_store.load(Ordering::Relaxed);
        usage.damaged.extend(self.damaged.lock().unwrap_or_else(PoisonError::into_inner).iter().cloned());
        usage
    }
}

/// Names an answer by everything that it depends on; where the model is served does not matter.
fn key(model: &str, question: &PictureQuestion) -> String {
    let mut hash = Sha256::new();
    // Lengths in front, so that no two questions run together to the same bytes.
    let mut add = |bytes: &[u8]| {
        hash.update((bytes.len() as u64).to_le_bytes());
        hash.update(bytes);
    };
    let sampling = question.sampling;
    add(b"paws answer 1");
    add(model.as_bytes());
    add(format!("{:?} {:?} {}", sampling.temperature, sampling.top_p, sampling.max_tokens).as_bytes());
    add(question.text.as_bytes());
    for picture in &question.pictures {
        add(picture.mime.as_bytes());
        add(&picture.bytes);
    }
    hex(&hash.finalize())
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().fold(String::with_capacity(2 * bytes.len()), |mut text, byte| {
        let _ = write!(text, "{byte:02x}");
        text
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vlm::absent::{DryRun, StoredOnly};
    use crate::vlm::{EncodedPicture, Sampling};

    fn question(text: &str, bytes: &[u8]) -> PictureQuestion {
        PictureQuestion {
            purpose: "clip/name".to_owned(),
            text: text.to_owned(),
            pictures: vec![EncodedPicture { bytes: bytes.to_vec(), mime: "image/jpeg", size: [8, 8] }],
            sampling: Sampling { temperature: 0.5, top_p: 0.3, max_tokens: 300 },
        }
    }

    #[test]
    fn the_name_of_an_answer_changes_with_everything_it_depends_on() {
        let base = question("a", &[1, 2]);
        let hotter = PictureQuestion { sampling: Sampling { temperature: 0.6, ..base.sampling }, ..base.clone() };
        let elsewhere = PictureQuestion { purpose: "other/name".to_owned(), ..base.clone() };
        let name = key("m", &base);
        assert_eq!(name.len(), 64);
        assert_eq!(name, key("m", &elsewhere));
        for other in
            [key("n", &base), key("m", &hotter), key("m", &question("b", &[1, 2])), key("m", &question("a", &[1]))]
        {
            assert_ne!(name, other);
        }
    }

    #[test]
    fn an_answer_is_given_once_and_kept() {
        let dir = tempfile::tempdir().unwrap();
        let stored = Stored::new(DryRun::new("m"), dir.path()).unwrap();
        let q = question("a", &[1]);
        assert_eq!(stored.ask(&q).unwrap().as_deref(), Some("unknown"));
        assert_eq!(stored.ask(&q).unwrap().as_deref(), Some("unknown"));
        let usage = stored.usage();
        assert_eq!((usage.asked, usage.from_store), (1, 1));

        let replay = Stored::reading(StoredOnly::new("m"), dir.path());
        assert_eq!(replay.ask(&q).unwrap().as_deref(), Some("unknown"));
        assert_eq!(replay.ask(&question("b", &[1])).unwrap(), None);
        assert_eq!((replay.usage().from_store, replay.usage().failures()), (1, 1));
        let names: Vec<_> = std::fs::read_dir(dir.path()).unwrap().map(|e| e.unwrap().file_name()).collect();
        assert_eq!(names.len(), 1, "{names:?}");
    }

    #[test]
    fn a_damaged_answer_costs_itself_and_is_named() {
        let dir = tempfile::tempdir().unwrap();
        let stored = Stored::new(StoredOnly::new("m"), dir.path()).unwrap();
        let q = question("a", &[1]);
        std::fs::write(stored.path(&q), "{").unwrap();
        assert_eq!(stored.ask(&q).unwrap(), None);
        let usage = stored.usage();
        assert!(usage.damaged.len() == 1 && usage.sentence("m").contains(".json: line 1"), "{usage:?}");
        assert_eq!(std::fs::read_to_string(stored.path(&q)).unwrap(), "{");
    }
}
