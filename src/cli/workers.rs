//! The processes of `paws batch`: each makes one twin, so that a crash costs one row.

use std::ffi::OsString;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::process::{Child, Command as Process, ExitStatus, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use anyhow::{Context, bail};

use super::export::read_twin;
use super::shown;
use crate::batch::journal::{JournalEntry, JournalKey, Status};
use crate::batch::manifest::ManifestRow;
use crate::batch::result_tables::{self, TwinFiles};
use crate::evaluation::Predictions;
use crate::json;

/// Between two looks at a process: at first, and at the most.
const LOOK: [Duration; 2] = [Duration::from_millis(1), Duration::from_millis(20)];
/// Of what a process says that much is kept in a table, characters.
const MAX_REASON: usize = 2000;

/// A row that is to be run.
pub struct Task<'a> {
    /// The row.
    pub row: &'a ManifestRow,
    /// What its result will be made of.
    pub key: JournalKey,
    /// `--config`, where there is one.
    pub config: Option<PathBuf>,
}

/// What all processes have in common.
pub struct Plan<'a> {
    /// The batch's folder.
    pub out: &'a Path,
    /// What starts `paws`: a program and its first arguments.
    pub command: Vec<OsString>,
    /// Options of `paws twin`.
    pub flags: Vec<&'static str>,
    /// Threads of each process.
    pub threads: usize,
    /// How long a process may take.
    pub limit: Option<Duration>,
}

/// How a process came to its end.
enum End {
    /// By itself.
    Itself(ExitStatus),
    /// It took longer than it may.
    Late,
    /// The run ended before.
    Stopped,
}

/// What starts `paws`: what was given, or this program. A process that calls our commands (Python) is another program: started
/// with the arguments of `paws`, it would do whatever these mean to it.
pub fn command(given: &[OsString]) -> anyhow::Result<Vec<OsString>> {
    if !given.is_empty() {
        return Ok(given.to_vec());
    }
    if !super::is_program() {
        bail!("this process is not the program `paws`: say what starts it, a --worker for each word of the command");
    }
    Ok(vec![std::env::current_exe().context("where this program lies")?.into_os_string()])
}

/// Makes one twin; `None` where the run ended before. An error is one that all other rows would meet as well.
pub fn one(plan: &Plan, task: &Task, stop: &AtomicBool) -> anyhow::Result<Option<JournalEntry>> {
    let name = &task.row.name;
    let begun = Instant::now();
    let log = plan.out.join("logs").join(format!("{name}.txt"));
    let log_file = File::create(&log).with_context(|| shown(&log))?;
    let mut child = started(plan, task, log_file)?;
    let end = waited(&mut child, stop, plan.limit)?;
    let said = std::fs::read(&log).map(|bytes| String::from_utf8_lossy(&bytes).into_owned()).unwrap_or_default();
    let (status, code, reason) = match end {
        End::Stopped => return Ok(None),
        End::Late => {
            let secs = plan.limit.unwrap_or_default().as_secs();
            (Status::Failed, None, format!("it took longer than --time-limit {secs} (seconds)"))
        }
        End::Itself(status) => judged(status, &said, &twin_of(plan.out, name)),
    };
    if status == Status::Done {
        // There is nothing in it that the twin does not say.
        let _ = std::fs::remove_file(&log);
    }
    let secs = begun.elapsed().as_secs_f64();
    Ok(Some(JournalEntry { name: name.clone(), key: task.key.clone(), status, code, reason, secs }))
}

/// Starts the process of a task; it ends when its standard input does.
fn started(plan: &Plan, task: &Task, log: File) -> anyhow::Result<Child> {
    let Some((program, words)) = plan.command.split_first() else { bail!("no command starts `paws`") };
    let mut process = Process::new(program);
    process.args(words).args(["twin", "--with-parent"]).args(&plan.flags);
    process.arg("--out").arg(twin_of(plan.out, &task.row.name));
    if let Some(config) = &task.config {
        process.arg("--config").arg(config);
    }
    process.arg("--").args(&task.row.recordings);
    process.env("RAYON_NUM_THREADS", plan.threads.to_string()).stdin(Stdio::piped()).stdout(Stdio::null());
    process.stderr(log).spawn().with_context(|| shown(Path::new(program)))
}

/// Waits for a process; it is no more where it did not end by itself. (`Child::wait` would close its standard input, which is
/// what tells it that its parent is gone.)
fn waited(child: &mut Child, stop: &AtomicBool, limit: Option<Duration>) -> anyhow::Result<End> {
    let begun = Instant::now();
    let [mut pause, longest] = LOOK;
    loop {
        if let Some(status) = child.try_wait().context("a twin's process")? {
            return Ok(End::Itself(status));
        }
        let stopped = stop.load(Ordering::Relaxed);
        if stopped || limit.is_some_and(|limit| begun.elapsed() > limit) {
            let _ = child.kill();
            let _ = child.wait();
            return Ok(if stopped { End::Stopped } else { End::Late });
        }
        std::thread::sleep(pause);
        pause = (2 * pause).min(longest);
    }
}

/// Status, code and reason of a process that has ended.
fn judged(ended: ExitStatus, said: &str, twin: &Path) -> (Status, Option<i32>, String) {
    let not_done: Vec<&str> = said.lines().filter_map(|line| line.strip_prefix("not done: ")).collect();
    let status = match ended.code() {
        Some(0) => Status::Done,
        Some(1) => Status::No,
        _ => Status::Failed,
    };
    if status == Status::Failed {
        let error = format!("\n{said}").rsplit_once("\nerror: ").map(|(_, error)| error.trim().to_owned());
        let why = match ended.code() {
            Some(_) => error.unwrap_or_else(|| last_words(said)),
            None => format!("{ended}; was the memory short? fewer --jobs take less"),
        };
        return (status, ended.code(), why.chars().take(MAX_REASON).collect());
    }
    match read_made(twin) {
        Ok(made) => (status, ended.code(), result_tables::complaint(status, &not_done.join("; "), &made)),
        Err(error) => (Status::Failed, ended.code(), format!("{error:#}")),
    }
}

/// What a process said when it came to a bad end: where it panicked, else its last line.
fn last_words(said: &str) -> String {
    let lines: Vec<&str> = said.lines().map(str::trim).filter(|line| !line.is_empty()).collect();
    match lines.iter().position(|line| line.contains("panicked at")) {
        // The place, and on the next line the reason.
        Some(at) => lines.iter().skip(at).take(2).copied().collect::<Vec<&str>>().join(" "),
        None => lines.last().copied().unwrap_or("it said nothing").to_owned(),
    }
}

/// What a twin's folder holds for the tables.
pub fn read_made(twin: &Path) -> anyhow::Result<TwinFiles> {
    Ok(TwinFiles {
        predictions: Predictions::read(&twin.join("predictions.json"))?,
        twin: read_twin(twin)?,
        validation: json::read(&twin.join("validation.json"))?,
    })
}

/// The folder of a row's twin.
pub fn twin_of(out: &Path, name: &str) -> PathBuf {
    out.join("twins").join(name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_process_that_is_not_paws_has_to_say_what_starts_it() {
        let words: Vec<OsString> = ["python", "-m", "paws_twin"].map(OsString::from).into();
        assert_eq!(command(&words).unwrap(), words);
        // The program that runs the tests is not `paws`.
        let error = command(&[]).unwrap_err().to_string();
        assert!(error.contains("--worker"), "{error}");
    }

    #[test]
    fn a_panic_is_told_by_its_place_and_reason() {
        let said = "a note\n\nthread 'main' panicked at src/a.rs:1:2:\nindex out of bounds\nnote: run with more\n";
        assert_eq!(last_words(said), "thread 'main' panicked at src/a.rs:1:2: index out of bounds");
        assert_eq!((last_words("one\ntwo\n\n"), last_words("")), ("two".to_owned(), "it said nothing".to_owned()));
    }
}
