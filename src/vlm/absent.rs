//! Nobody is asked: a dry run that counts, and a replay that has stored answers or none.

use std::sync::{Mutex, PoisonError};

use super::{LanguageModel, PictureQuestion, Usage};
use crate::error::Result;

/// Counts what would be asked. Its answer says nothing but is one, so that the questions that follow from answers are
/// counted too: the count is the most that a real run asks.
#[derive(Debug)]
pub struct DryRun {
    model: String,
    usage: Mutex<Usage>,
}

impl DryRun {
    /// Stands in for the model of that name.
    #[must_use]
    pub fn new(model: &str) -> Self {
        Self { model: model.to_owned(), usage: Mutex::default() }
    }
}

impl LanguageModel for DryRun {
    fn ask(&self, question: &PictureQuestion) -> Result<Option<String>> {
        self.usage.lock().unwrap_or_else(PoisonError::into_inner).ask(question);
        Ok(Some("unknown".to_owned()))
    }

    fn name(&self) -> &str {
        &self.model
    }

    fn usage(&self) -> Usage {
        self.usage.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}

/// Never answers: what is not in the store ([`super::store::Stored`]) stays open. Needs no network.
#[derive(Debug)]
pub struct StoredOnly {
    model: String,
    usage: Mutex<Usage>,
}

impl StoredOnly {
    /// Stands in for the model of that name.
    #[must_use]
    pub fn new(model: &str) -> Self {
        Self { model: model.to_owned(), usage: Mutex::default() }
    }
}

impl LanguageModel for StoredOnly {
    fn ask(&self, _question: &PictureQuestion) -> Result<Option<String>> {
        self.usage.lock().unwrap_or_else(PoisonError::into_inner).fail("not among the stored answers");
        Ok(None)
    }

    fn name(&self) -> &str {
        &self.model
    }

    fn usage(&self) -> Usage {
        self.usage.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}
