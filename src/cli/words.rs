//! `--vlm-url` and what goes with it: a language model's words about the pictures.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use anyhow::bail;
use clap::Args;

use super::progress::Steps;
use super::{Answer, print};
use crate::config::Config;
use crate::make;
use crate::pipeline::{self, LookStore, Scene};
use crate::reasoning::Reasoner;
use crate::reasoning::asking::Asking;
use crate::reasoning::heuristic::Geometric;
use crate::reasoning::naming::{self, Naming};
use crate::reasoning::prompts::Prompts;
use crate::recording::Recording;
use crate::vlm::absent::{DryRun, StoredOnly};
use crate::vlm::server::{self, ApiKey, RequestLimits, Server};
use crate::vlm::store::Stored;
use crate::vlm::{LanguageModel, PictureQuestion, Usage};

const HEADING: &str = "Language model (optional)";
/// Where a key is looked for when nobody says where.
const USUAL_KEY: &str = "OPENAI_API_KEY";

/// Arguments of the commands that can ask a language model.
#[derive(Debug, Clone, Args)]
pub struct WordsArgs {
    /// Ask a vision-language model at this OpenAI-compatible address (OpenAI, vLLM, Ollama, llama.cpp)
    #[arg(long, value_name = "URL", requires = "vlm_model", help_heading = HEADING)]
    vlm_url: Option<String>,
    /// The model, as its server calls it
    #[arg(long, value_name = "NAME", help_heading = HEADING)]
    vlm_model: Option<String>,
    /// Environment variable that holds the key [default: OPENAI_API_KEY, for https and this machine only]
    #[arg(long, value_name = "NAME", help_heading = HEADING)]
    vlm_key_env: Option<String>,
    /// Requests under way at the same time
    #[arg(long, value_name = "N", default_value_t = 4, help_heading = HEADING,
        value_parser = clap::value_parser!(u32).range(1..=64))]
    vlm_concurrency: u32,
    /// Seconds until a request without an answer is given up
    #[arg(long, value_name = "SECS", default_value_t = 120, help_heading = HEADING,
        value_parser = clap::value_parser!(u64).range(1..=3600))]
    vlm_timeout: u64,
    /// Send no more requests than this, repetitions included
    #[arg(long, value_name = "N", default_value_t = 1000, help_heading = HEADING)]
    max_requests: usize,
    /// Ask nothing: count requests, pictures and tokens
    #[arg(long, requires = "vlm_model", conflicts_with = "replay", help_heading = HEADING)]
    dry_run: bool,
    /// Folder where answers are kept and looked up [default: answers/ in the recording]
    #[arg(long, value_name = "DIR", requires = "vlm_model", help_heading = HEADING)]
    answers: Option<PathBuf>,
    /// Use only answers that an earlier run kept (--answers): asks nobody, needs no network. It has nothing to do with the
    /// replay in physics
    #[arg(long, visible_alias = "kept-answers", requires = "vlm_model", help_heading = HEADING)]
    replay: bool,
    /// Folder with prompts of your own: motion_type.txt, summary.txt, axis_choice.txt, naming.txt
    #[arg(long, value_name = "DIR", requires = "vlm_model", help_heading = HEADING)]
    templates: Option<PathBuf>,
}

/// What becomes of questions.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Mode {
    Ask,
    DryRun,
    Replay,
}

/// Who is asked, and how.
pub struct Asked {
    base: Box<dyn LanguageModel>,
    mode: Mode,
    prompts: Prompts,
    at_once: usize,
    answers: Option<PathBuf>,
}

impl WordsArgs {
    /// `None` where no model is to be asked.
    pub fn open(&self) -> anyhow::Result<Option<Asked>> {
        let Some(model) = &self.vlm_model else { return Ok(None) };
        let (mode, base): (Mode, Box<dyn LanguageModel>) = match &self.vlm_url {
            _ if self.dry_run => (Mode::DryRun, Box::new(DryRun::new(model))),
            _ if self.replay => (Mode::Replay, Box::new(StoredOnly::new(model))),
            Some(url) => {
                let limits = RequestLimits {
                    request: Duration::from_secs(self.vlm_timeout),
                    at_once: self.vlm_concurrency as usize,
                    max_requests: self.max_requests,
                    ..RequestLimits::default()
                };
                (Mode::Ask, Box::new(Server::new(url, model, self.key(url)?, limits)?))
            }
            None => bail!("--vlm-model needs to know who answers: --vlm-url, --replay, or --dry-run"),
        };
        let prompts = self.templates.as_deref().map_or_else(Prompts::built_in, Prompts::read)?;
        let at_once = self.vlm_concurrency as usize;
        Ok(Some(Asked { base, mode, prompts, at_once, answers: self.answers.clone() }))
    }

    fn key(&self, url: &str) -> anyhow::Result<Option<ApiKey>> {
        let Some(variable) = &self.vlm_key_env else {
            // Somebody's key for one service is nobody else's business, and no unencrypted line's.
            let safe = url.trim().to_ascii_lowercase().starts_with("https://") || server::is_loopback(url);
            return Ok(if safe { ApiKey::from_env(USUAL_KEY)? } else { None });
        };
        // What was given is not repeated: it may be the key itself.
        if !variable.chars().all(|c| c.is_ascii_alphanumeric() || c == '_') {
            bail!("--vlm-key-env takes the name of an environment variable, not a key");
        }
        match ApiKey::from_env(variable)? {
            Some(key) => Ok(Some(key)),
            None => bail!("the environment variable that --vlm-key-env names is not set"),
        }
    }
}

impl Asked {
    /// The model's name.
    pub fn model(&self) -> &str {
        self.base.name()
    }

    /// The folder of answers, where it is not the recording's own.
    pub fn answers(&self) -> Option<&Path> {
        self.answers.as_deref()
    }

    /// Whether nothing is to be asked or written.
    pub fn is_dry(&self) -> bool {
        self.mode == Mode::DryRun
    }

    /// Counts what would be asked about some recordings.
    pub fn count(&self, recordings: &[Recording], config: &Config) -> anyhow::Result<Answer> {
        let mut total: Option<Usage> = None;
        for recording in recordings {
            let steps = Steps::new();
            let how = How { config, asked: Some(self), store: &pipeline::Forgetful, keep: false };
            let usage = infer(recording, how, &steps)?.usage;
            steps.finish();
            total = added(total, usage);
        }
        let usage = total.unwrap_or_default();
        print(&format!(
            "{}: at most {} questions with {} pictures, about {} tokens of prompts (a token for four bytes of text, pictures \
             as OpenAI counts them); {} more are answered already. Nothing was asked.\n",
            self.model(),
            usage.asked,
            usage.pictures,
            usage.tokens,
            usage.from_store
        ))?;
        Ok(Answer::Yes)
    }

    /// The model with its answers beside a recording.
    fn beside<'a>(&'a self, recording: &Recording, steps: &'a Steps, keep: bool) -> anyhow::Result<Watched<'a>> {
        let dir = self.answers.clone().unwrap_or_else(|| recording.dir.join("answers"));
        let base: &'a dyn LanguageModel = &*self.base;
        let stored = match self.mode {
            Mode::Ask => Stored::new(base, &dir)?,
            Mode::DryRun | Mode::Replay => Stored::reading(base, &dir),
        };
        Ok(Watched { stored, steps, count: AtomicUsize::new(0), keep, exchanges: Mutex::default() })
    }
}

/// A question with its answer.
pub struct Exchange {
    /// What was asked.
    pub question: PictureQuestion,
    /// What was said.
    pub answer: Option<String>,
}

impl Exchange {
    /// The clip that it is about.
    pub fn clip(&self) -> &str {
        self.question.purpose.rsplit_once('/').map_or("", |(clip, _)| clip)
    }

    /// A name among the clip's exchanges.
    pub fn name(&self) -> &str {
        self.question.purpose.rsplit_once('/').map_or(&self.question.purpose, |(_, name)| name)
    }
}

/// A model under a progress bar, whose exchanges are kept where somebody wants to see them.
struct Watched<'a> {
    stored: Stored<&'a dyn LanguageModel>,
    steps: &'a Steps,
    count: AtomicUsize,
    keep: bool,
    exchanges: Mutex<Vec<Exchange>>,
}

impl LanguageModel for Watched<'_> {
    fn ask(&self, question: &PictureQuestion) -> crate::error::Result<Option<String>> {
        let answer = self.stored.ask(question)?;
        let count = self.count.fetch_add(1, Ordering::Relaxed) + 1;
        self.steps.note(format!("{count} questions"));
        if self.keep {
            let exchange = Exchange { question: question.clone(), answer: answer.clone() };
            self.exchanges.lock().unwrap_or_else(PoisonError::into_inner).push(exchange);
        }
        Ok(answer)
    }

    fn name(&self) -> &str {
        self.stored.name()
    }

    fn usage(&self) -> Usage {
        self.stored.usage()
    }
}

/// What the pipeline found, and what was asked on the way.
pub struct Inferred {
    /// The scene.
    pub scene: Scene,
    /// Who answered, for the evidence.
    pub reasoner: String,
    /// What was asked so far, where a model is asked.
    pub usage: Option<Usage>,
    /// All questions with their answers, where they were to be kept.
    pub exchanges: Vec<Exchange>,
    /// Files of frames that could not be read, with the reason: the frames were used without them.
    pub lost: Vec<String>,
}

/// The joints, without the few files of frames that cannot be read, which are told.
fn scene_of(
    recording: &Recording,
    how: How,
    reasoner: &dyn Reasoner,
    progress: pipeline::Progress,
) -> crate::error::Result<(Scene, Vec<String>)> {
    let (scene, lost) = make::scene(recording, how.config, reasoner, progress, how.store)?;
    for why in &lost {
        eprintln!("left out: {why}");
    }
    Ok((scene, lost))
}

/// How a recording is worked on.
#[derive(Clone, Copy)]
pub struct How<'a> {
    /// The parameters.
    pub config: &'a Config,
    /// Who is asked, if anybody.
    pub asked: Option<&'a Asked>,
    /// What keeps what frames show.
    pub store: &'a dyn LookStore,
    /// Whether questions are kept with their answers.
    pub keep: bool,
}

/// Runs the pipeline, with a model's words where one is to be asked.
pub fn infer(recording: &Recording, how: How, steps: &Steps) -> anyhow::Result<Inferred> {
    let How { config, asked, keep, .. } = how;
    let geometric = Geometric::of(config);
    let report = |step: &str, done: usize, total: usize| steps.report(step, done, total);
    let Some(asked) = asked else {
        let (scene, lost) = scene_of(recording, how, &geometric, &report)?;
        let reasoner = geometric.name().to_owned();
        return Ok(Inferred { scene, reasoner, usage: None, exchanges: Vec::new(), lost });
    };
    let model = asked.beside(recording, steps, keep)?;
    let named = named(recording, config, asked, &model)?;
    let recording = named.as_ref().unwrap_or(recording);
    let asking = Asking { geometric: &geometric, model: &model, prompts: &asked.prompts, at_once: asked.at_once };
    let (scene, lost) = scene_of(recording, how, &asking, &report)?;
    let reasoner = format!("{} ({})", asking.name(), asked.model());
    let usage = Some(model.usage());
    let exchanges = model.exchanges.into_inner().unwrap_or_else(PoisonError::into_inner);
    Ok(Inferred { scene, reasoner, usage, exchanges, lost })
}

/// The recording with a model's names for the clips that nobody named; `None` where there are none, or names are not to be used.
fn named(
    recording: &Recording,
    config: &Config,
    asked: &Asked,
    model: &Watched,
) -> crate::error::Result<Option<Recording>> {
    if !config.reasoning.use_names || !recording.clips.iter().any(naming::is_unnamed) {
        return Ok(None);
    }
    let naming = Naming { model, prompts: &asked.prompts, config: &config.reasoning, at_once: asked.at_once };
    Ok(Some(Recording { clips: naming.clips(recording)?, ..recording.clone() }))
}

/// The usage after one more recording: the model counts over all of them, stored answers are counted by recording.
pub fn added(total: Option<Usage>, usage: Option<Usage>) -> Option<Usage> {
    let (before, damaged) = total.map_or_else(Default::default, |t| (t.from_store, t.damaged));
    usage.map(|mut u| {
        u.from_store += before;
        u.damaged.extend(damaged);
        u
    })
}
