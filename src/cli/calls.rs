//! Commands that a program calls in its own process, as the Python module does: what they would print is collected, their
//! steps go to a listener, and a listener that has had enough ends them.
//!
//! One call at a time: a second one waits for its turn. A command uses all cores by itself.

use std::any::Any;
use std::ffi::OsString;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use clap::Parser;

use super::{Cli, answer_of};

/// Hears a step's name, how much of it is done, and of how much; false ends the command at once. It may be called from any
/// thread.
pub type Listener = dyn Fn(&str, usize, usize) -> bool + Send + Sync;

/// What a called command left.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Called {
    /// The exit code of the command: 0 done, 1 ran but the answer is no or not whole, 2 error.
    pub code: u8,
    /// What it would have written to standard output.
    pub out: String,
    /// What it would have written to standard error, without the error itself.
    pub notes: String,
    /// Why it failed; there where the code is 2.
    pub error: Option<String>,
}

/// The call under way.
struct Call {
    out: String,
    notes: String,
    listener: Arc<Listener>,
}

static CALL: Mutex<Option<Call>> = Mutex::new(None);
static TURN: Mutex<()> = Mutex::new(());

/// What a listener that has had enough throws.
struct Ended;

/// Runs a command as `paws` does, `args` without the program's name, and prints nothing. Files are written as by `paws`; a
/// command that is ended on the way leaves none of them.
#[must_use]
pub fn call(args: &[OsString], listener: Arc<Listener>) -> Called {
    let program = OsString::from("paws");
    let cli = match Cli::try_parse_from(std::iter::once(&program).chain(args)) {
        Ok(cli) => cli,
        Err(error) => return parsed(&error),
    };
    let _turn = TURN.lock().unwrap_or_else(PoisonError::into_inner);
    *current() = Some(Call { out: String::new(), notes: String::new(), listener });
    let result = catch_unwind(AssertUnwindSafe(|| answer_of(cli)));
    let (out, notes) = current().take().map(|call| (call.out, call.notes)).unwrap_or_default();
    let (code, error) = match result {
        Ok(Ok(answer)) => (answer.code(), None),
        Ok(Err(error)) => (2, Some(format!("{error:#}"))),
        Err(thrown) => (2, Some(told(thrown.as_ref()))),
    };
    Called { code, out, notes, error }
}

/// Arguments that do not fit, or that ask for help.
fn parsed(error: &clap::Error) -> Called {
    let text = error.render().to_string();
    if error.use_stderr() {
        let text = text.strip_prefix("error: ").unwrap_or(&text).trim_end().to_owned();
        return Called { code: 2, out: String::new(), notes: String::new(), error: Some(text) };
    }
    Called { code: 0, out: text, notes: String::new(), error: None }
}

/// What was thrown, in words.
fn told(thrown: &(dyn Any + Send)) -> String {
    if thrown.is::<Ended>() {
        return "ended by its caller".to_owned();
    }
    let text = thrown.downcast_ref::<&str>().map(|text| (*text).to_owned());
    let text = text.or_else(|| thrown.downcast_ref::<String>().cloned()).unwrap_or_default();
    format!("a fault of paws itself: {text}")
}

fn current() -> MutexGuard<'static, Option<Call>> {
    CALL.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Whether a program listens, and nobody watches a terminal.
pub(super) fn is_called() -> bool {
    current().is_some()
}

/// Takes what is for standard output; false where no call is under way.
pub(super) fn took(text: &str) -> bool {
    match current().as_mut() {
        Some(call) => {
            call.out += text;
            true
        }
        None => false,
    }
}

/// A line for standard error.
pub(super) fn note(text: &str) {
    match current().as_mut() {
        Some(call) => {
            call.notes += text;
            call.notes.push('\n');
        }
        None => std::eprintln!("{text}"),
    }
}

/// Tells the listener how far a step is; unwinds where it has had enough.
pub(super) fn report(step: &str, done: usize, total: usize) {
    // The listener is called without the lock: it may take its time, or print.
    let listener = current().as_ref().map(|call| Arc::clone(&call.listener));
    if listener.is_some_and(|listener| !listener(step, done, total)) {
        resume_unwind(Box::new(Ended));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::{AtomicUsize, Ordering};

    fn args(words: &[&str]) -> Vec<OsString> {
        words.iter().map(OsString::from).collect()
    }

    #[test]
    fn what_a_called_command_says_is_collected() {
        let called = call(&args(&["config", "--toml"]), Arc::new(|_, _, _| true));
        assert_eq!((called.code, called.error), (0, None));
        assert!(called.out.contains("[inference]"), "{}", called.out);
        let wrong = call(&args(&["twin", "nowhere", "--out", "nowhere_twin"]), Arc::new(|_, _, _| true));
        assert_eq!(wrong.code, 2);
        assert!(wrong.error.unwrap().starts_with("nowhere: no such folder"));
        let usage = call(&args(&["twim"]), Arc::new(|_, _, _| true));
        assert!(usage.error.unwrap().starts_with("unrecognized subcommand 'twim'"));
        assert_eq!(call(&args(&["--version"]), Arc::new(|_, _, _| true)).code, 0);
    }

    #[test]
    fn a_listener_that_has_had_enough_ends_the_command_and_nothing_is_left() {
        let dir = tempfile::tempdir().unwrap();
        let out = dir.path().join("rec");
        let words = args(&["synth", "--seed", "3", "--tier", "clean", "--width", "64", "--parts", "1", "--out"]);
        let words = [words, vec![out.clone().into_os_string()]].concat();
        let heard = Arc::new(AtomicUsize::new(0));
        let count = Arc::clone(&heard);
        let ended = call(&words, Arc::new(move |_, _, _| count.fetch_add(1, Ordering::Relaxed) < 1));
        assert_eq!((ended.code, ended.error.as_deref()), (2, Some("ended by its caller")));
        assert_eq!(heard.load(Ordering::Relaxed), 2);
        assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 0);
        // The next call is not disturbed by it.
        let called = call(&words, Arc::new(|_, _, _| true));
        assert_eq!(called.code, 0, "{called:?}");
        assert!(out.join("cameras.json").is_file());
    }
}
