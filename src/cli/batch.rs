//! `paws batch`: the twins of many recordings, each made by a process of its own, so that a crash costs one of them.

use std::collections::BTreeMap;
use std::ffi::OsString;
use std::fs::{File, OpenOptions, TryLockError};
use std::io::{Read, Seek, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc::{self, Sender};
use std::time::Duration;

use anyhow::{Context, bail};
use clap::Args;
use sha2::{Digest, Sha256};

use super::door::Door;
use super::output::write_file;
use super::progress::Steps;
use super::workers::{self, Plan, Task, read_made, twin_of};
use super::{Answer, ConfigFile, Opening, print, shown};
use crate::batch::estimate;
use crate::batch::journal::{self, Journal, JournalEntry, JournalKey, Status};
use crate::batch::manifest::{self, ManifestRow};
use crate::batch::result_tables;
use crate::report::table::aligned;

#[derive(Debug, Args)]
pub struct BatchArgs {
    /// A table (.csv) with a column "recording", or JSON lines (.jsonl) with such a key, or with a list "recordings" of one
    /// kitchen: folders of recordings, from the manifest's folder on; "name" and "config" may stand beside it
    manifest: PathBuf,
    /// Folder from which the manifest's paths count [default: the manifest's]
    #[arg(long, value_name = "DIR")]
    root: Option<PathBuf>,
    /// Folder for the twins (twins/NAME), the journal and the tables results.csv, joints.csv, predictions.csv, timings.csv.
    /// What its journal says to be finished is not repeated
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Recordings at a time; each takes as much memory as `paws twin` does, and its share of the cores
    /// [default: one for every two cores]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1024))]
    jobs: Option<u32>,
    /// End a recording's process after so many seconds; it counts as failed, and the next run tries it again
    #[arg(long, value_name = "SECS", value_parser = clap::value_parser!(u64).range(1..))]
    time_limit: Option<u64>,
    /// Repeat the recordings that failed
    #[arg(long)]
    retry: bool,
    /// Run only the I-th of N parts of the manifest, I from 1, and write no tables: on several machines that share DIR. After
    /// them, the command without it writes the tables
    #[arg(long, value_name = "I/N", value_parser = shard)]
    shard: Option<(usize, usize)>,
    /// A word of the command that starts `paws` for each recording, from the program's on: for programs that call this
    /// command in their own process
    #[arg(long, value_name = "WORD", hide = true, allow_hyphen_values = true)]
    worker: Vec<OsString>,
    /// Show plain boxes: no textures from the images. It saves most of the time and of the disk
    #[arg(long)]
    no_textures: bool,
    #[command(flatten)]
    opening: Opening,
    #[command(flatten)]
    door: Door,
    #[command(flatten)]
    config: ConfigFile,
}

/// Results of another version are made again.
const VERSION: &str = env!("CARGO_PKG_VERSION");

fn shard(text: &str) -> Result<(usize, usize), String> {
    match text.split_once('/').map(|(i, n)| (i.trim().parse::<usize>(), n.trim().parse::<usize>())) {
        Some((Ok(i), Ok(n))) if 1 <= i && i <= n => Ok((i, n)),
        _ => Err("write I/N, I from 1 to N: 2/8".to_owned()),
    }
}

pub fn run(args: &BatchArgs) -> anyhow::Result<Answer> {
    let rows = manifest::read(&args.manifest, args.root.as_deref())?;
    let command = workers::command(&args.worker)?;
    prepare(&args.out)?;
    let (mut file, begun) = open_journal(&args.out, args.shard)?;
    for line in &begun.unread {
        eprintln!("{}: line {line} is no entry; its recording is made again", shown(&args.out.join(JOURNAL)));
    }
    let mut entries = all_entries(&args.out, &begun)?;
    let mine: Vec<&ManifestRow> = match args.shard {
        None => rows.iter().collect(),
        Some((i, n)) => rows.iter().skip(i - 1).step_by(n).collect(),
    };
    let (tasks, refused, kept) = sorted_out(args, &rows, &mine, &entries);
    if kept > 0 {
        eprintln!("{kept} of {} recordings are finished already", mine.len());
    }
    for entry in refused {
        eprintln!("{}: failed: {}", entry.name, entry.reason);
        if entries.get(&entry.name) != Some(&entry) {
            append(&mut file, &args.out, &entry)?;
            entries.insert(entry.name.clone(), entry);
        }
    }
    for entry in made(args, command, &tasks, &mut file)? {
        entries.insert(entry.name.clone(), entry);
    }
    if args.shard.is_none() {
        write_tables(&args.out, &rows, &entries)?;
    }
    let ended: Vec<&JournalEntry> = mine.iter().filter_map(|row| entries.get(&row.name)).collect();
    let count = |status: Status| ended.iter().filter(|e| e.status == status).count();
    let counts = [Status::Done, Status::No, Status::Failed].map(|status| (status.word(), count(status)));
    let mut table = vec![vec!["status".to_owned(), "recordings".to_owned()]];
    table.extend(counts.iter().map(|(word, count)| vec![(*word).to_owned(), count.to_string()]));
    print(&aligned(&table))?;
    if args.shard.is_none() {
        print(&format!("\n{}\n", shown(&args.out.join("results.csv"))))?;
    }
    Ok(if count(Status::Done) == mine.len() { Answer::Yes } else { Answer::No })
}

/// The journal's name; a shard has one of its own.
const JOURNAL: &str = "journal.jsonl";

fn journal_name(shard: Option<(usize, usize)>) -> String {
    shard.map_or_else(|| JOURNAL.to_owned(), |(i, n)| format!("journal-{i}-of-{n}.jsonl"))
}

/// Makes the output's folder; one that holds something else is refused.
fn prepare(out: &Path) -> anyhow::Result<()> {
    if out.exists() {
        let names: Vec<String> = std::fs::read_dir(out)
            .with_context(|| shown(out))?
            .flatten()
            .map(|entry| entry.file_name().to_string_lossy().into_owned())
            .collect();
        if !names.is_empty() && !names.iter().any(|name| name.starts_with("journal")) {
            bail!("{}: exists and is no folder of a batch (it has no {JOURNAL}); choose another --out", shown(out));
        }
    }
    std::fs::create_dir_all(out).with_context(|| shown(out))
}

/// Opens the journal of this run for itself alone; a line that the end of a run has cut off is removed.
fn open_journal(out: &Path, shard: Option<(usize, usize)>) -> anyhow::Result<(File, Journal)> {
    let path = out.join(journal_name(shard));
    let mut options = OpenOptions::new();
    options.read(true).write(true).create(true).truncate(false);
    let mut file = options.open(&path).with_context(|| shown(&path))?;
    // A file system without locks cannot tell; then nobody is kept out.
    if let Err(TryLockError::WouldBlock) = file.try_lock() {
        bail!("{}: another `paws batch` is at work here; wait for it, or choose another --out", shown(&path));
    }
    // After the journal: it is what makes the folder a batch's.
    for folder in [out.join("twins"), out.join("logs")] {
        std::fs::create_dir_all(&folder).with_context(|| shown(&folder))?;
    }
    let mut bytes = Vec::new();
    file.read_to_end(&mut bytes).with_context(|| shown(&path))?;
    let journal = journal::parse(&bytes);
    file.set_len(journal.whole_bytes as u64).with_context(|| shown(&path))?;
    file.seek(std::io::SeekFrom::End(0)).with_context(|| shown(&path))?;
    Ok((file, journal))
}

/// What this and all other runs in a folder have finished; of several entries of a name one of a twin, made by this version, is
/// the better one.
fn all_entries(out: &Path, own: &Journal) -> anyhow::Result<BTreeMap<String, JournalEntry>> {
    let mut names: Vec<PathBuf> = std::fs::read_dir(out)
        .with_context(|| shown(out))?
        .flatten()
        .map(|entry| entry.path())
        .filter(|path| {
            let name = path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
            name.starts_with("journal-") && name.ends_with(".jsonl")
        })
        .collect();
    names.sort();
    let mut entries = own.entries.clone();
    for path in names {
        let bytes = std::fs::read(&path).with_context(|| shown(&path))?;
        for (name, entry) in journal::parse(&bytes).entries {
            let is_better =
                entries.get(&name).is_none_or(|old| old.status == Status::Failed || old.key.version != VERSION);
            if is_better {
                entries.insert(name, entry);
            }
        }
    }
    Ok(entries)
}

/// The rows that have to be run, those that cannot be, and how many are finished.
fn sorted_out<'a>(
    args: &BatchArgs,
    rows: &[ManifestRow],
    mine: &[&'a ManifestRow],
    entries: &BTreeMap<String, JournalEntry>,
) -> (Vec<Task<'a>>, Vec<JournalEntry>, usize) {
    let out = args.out.canonicalize().ok();
    // Whether recordings are nested or given twice is a matter of the whole manifest.
    let unfit: BTreeMap<usize, String> = rows
        .iter()
        .zip(manifest::unfit(rows, out.as_deref()))
        .filter_map(|(row, why)| Some((row.line, why?)))
        .collect();
    let mut hashes: BTreeMap<Option<PathBuf>, Result<String, String>> = BTreeMap::new();
    let (mut tasks, mut refused, mut kept) = (Vec::new(), Vec::new(), 0);
    for &row in mine {
        let config = row.config.clone().or_else(|| args.config.config.clone());
        let hash = hashes.entry(config.clone()).or_insert_with(|| hashed(args, config.as_ref())).clone();
        let key = JournalKey {
            recordings: row.recordings.iter().map(|r| shown(&r.canonicalize().unwrap_or_else(|_| r.clone()))).collect(),
            config: hash.clone().unwrap_or_default(),
            version: VERSION.to_owned(),
        };
        if let Some(why) = unfit.get(&row.line).cloned().or(hash.err()) {
            refused.push(JournalEntry {
                name: row.name.clone(),
                key,
                status: Status::Failed,
                code: None,
                reason: why,
                secs: 0.0,
            });
        } else if entries.get(&row.name).is_some_and(|entry| is_finished(args, entry, &key)) {
            kept += 1;
        } else {
            tasks.push(Task { row, key, config });
        }
    }
    (tasks, refused, kept)
}

/// Whether an entry is the answer for a key, and its twin is there.
fn is_finished(args: &BatchArgs, entry: &JournalEntry, key: &JournalKey) -> bool {
    if entry.key != *key {
        return false;
    }
    match entry.status {
        // What never began, or was ended by a signal, may find another day: memory, a folder that is there now.
        Status::Failed => entry.code.is_some() && !args.retry,
        Status::Done | Status::No => twin_of(&args.out, &entry.name).join("twin.json").is_file(),
    }
}

/// A hash of all that a twin depends on beside its recording, or why there is none.
fn hashed(args: &BatchArgs, config: Option<&PathBuf>) -> Result<String, String> {
    let config = ConfigFile { config: config.cloned() }.read().map_err(|e| e.to_string())?;
    let mut hash = Sha256::new();
    hash.update(config.to_toml().as_bytes());
    for flag in flags(args) {
        hash.update(flag.as_bytes());
    }
    // Eight bytes are enough to tell the few configurations of a batch apart.
    Ok(hash.finalize().iter().take(8).map(|byte| format!("{byte:02x}")).collect())
}

/// The options of a batch that are those of each twin.
fn flags(args: &BatchArgs) -> Vec<&'static str> {
    let mut flags = args.door.flags();
    if args.opening.follow_links {
        flags.push("--follow-links");
    }
    if args.no_textures {
        flags.push("--no-textures");
    }
    flags
}

/// Writes an entry and waits until the disk has it.
fn append(file: &mut File, out: &Path, entry: &JournalEntry) -> anyhow::Result<()> {
    let line = journal::line(entry)?;
    file.write_all(line.as_bytes()).and_then(|()| file.sync_data()).with_context(|| {
        format!("{}: the journal cannot be written; what is in it is not repeated by the next run", shown(out))
    })
}

/// Stops the workers when the run ends, in whichever way.
struct StopAtEnd<'a>(&'a AtomicBool);

impl Drop for StopAtEnd<'_> {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

/// Cores for all jobs together: what schedulers say in `RAYON_NUM_THREADS`, else those that this process may use.
fn cores() -> usize {
    let told = std::env::var("RAYON_NUM_THREADS").ok().and_then(|n| n.trim().parse::<usize>().ok()).filter(|n| *n > 0);
    told.unwrap_or_else(|| std::thread::available_parallelism().map_or(1, std::num::NonZeroUsize::get))
}

/// Runs all tasks; each is in the journal as soon as it is finished.
fn made(
    args: &BatchArgs,
    command: Vec<OsString>,
    tasks: &[Task],
    file: &mut File,
) -> anyhow::Result<Vec<JournalEntry>> {
    let cores = cores();
    let jobs = args.jobs.map_or(cores.div_ceil(2), |n| n as usize).min(tasks.len().max(1));
    let limit = args.time_limit.map(Duration::from_secs);
    let plan = Plan { out: &args.out, command, flags: flags(args), threads: (cores / jobs).max(1), limit };
    let steps = Steps::new();
    let (next, stop) = (AtomicUsize::new(0), AtomicBool::new(false));
    let (sender, receiver) = mpsc::channel::<anyhow::Result<JournalEntry>>();
    let mut finished: Vec<JournalEntry> = Vec::new();
    let result = std::thread::scope(|scope| {
        let _stop = StopAtEnd(&stop);
        for _ in 0..jobs {
            let (plan, next, stop, sender) = (&plan, &next, &stop, sender.clone());
            scope.spawn(move || work(plan, tasks, next, stop, &sender));
        }
        drop(sender);
        steps.report("twins", 0, tasks.len());
        for entry in receiver {
            let entry = entry?;
            append(file, &args.out, &entry)?;
            if entry.status == Status::Failed {
                eprintln!("{}: failed: {}", entry.name, entry.reason);
            }
            finished.push(entry);
            let secs: Vec<f64> = finished.iter().map(|e| e.secs).collect();
            if let Some(rest) = estimate::rest(&secs, tasks.len() - finished.len(), jobs) {
                steps.note(estimate::words(rest));
            }
            steps.report("twins", finished.len(), tasks.len());
        }
        anyhow::Ok(())
    });
    steps.finish();
    result?;
    Ok(finished)
}

/// Takes tasks until there is none, or the run ends.
fn work(
    plan: &Plan,
    tasks: &[Task],
    next: &AtomicUsize,
    stop: &AtomicBool,
    sender: &Sender<anyhow::Result<JournalEntry>>,
) {
    while let Some(task) = tasks.get(next.fetch_add(1, Ordering::Relaxed)) {
        let entry = match workers::one(plan, task, stop) {
            Ok(Some(entry)) => Ok(entry),
            Ok(None) => return,
            Err(error) => Err(error),
        };
        if stop.load(Ordering::Relaxed) || sender.send(entry).is_err() {
            return;
        }
    }
}

/// Writes the tables of all rows, in the order of the manifest.
fn write_tables(out: &Path, rows: &[ManifestRow], entries: &BTreeMap<String, JournalEntry>) -> anyhow::Result<()> {
    let mut results = result_tables::csv_line(&result_tables::RESULTS);
    let mut joints = result_tables::csv_line(&result_tables::JOINTS);
    let mut predictions = result_tables::csv_line(&result_tables::PREDICTIONS);
    let mut timings = result_tables::csv_line(&result_tables::TIMINGS);
    for row in rows {
        let Some(mut entry) = entries.get(&row.name).cloned() else { continue };
        let made = match entry.status {
            Status::Failed => None,
            Status::Done | Status::No => Some(read_made(&twin_of(out, &row.name))),
        };
        let made = match made.transpose() {
            Ok(made) => made,
            // Damaged since: it costs its row.
            Err(error) => {
                entry.status = Status::Failed;
                entry.reason = format!("{error:#}; remove {} and run again", shown(&twin_of(out, &row.name)));
                None
            }
        };
        results += &result_tables::csv_line(&result_tables::result(&entry, &row.given, made.as_ref()));
        timings += &result_tables::csv_line(&[row.name.clone(), format!("{:.3}", entry.secs)]);
        if let Some(made) = &made {
            joints.extend(result_tables::joints(&row.name, made).iter().map(|cells| result_tables::csv_line(cells)));
            predictions
                .extend(result_tables::predictions(&row.name, made).iter().map(|cells| result_tables::csv_line(cells)));
        }
    }
    let all = [("joints", joints), ("predictions", predictions), ("timings", timings), ("results", results)];
    for (name, text) in all {
        write_file(&out.join(format!("{name}.csv")), text)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_shard_is_one_of_so_many() {
        assert_eq!(shard("2/8"), Ok((2, 8)));
        for wrong in ["0/8", "9/8", "2", "a/b", "1/0"] {
            assert!(shard(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn a_journal_that_is_in_use_or_cut_off_is_told_from_one_that_is_not() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join(JOURNAL);
        let key = JournalKey { recordings: vec![], config: String::new(), version: String::new() };
        let entry = JournalEntry {
            name: "a".to_owned(),
            key,
            status: Status::Done,
            code: Some(0),
            reason: String::new(),
            secs: 1.0,
        };
        let whole = journal::line(&entry).unwrap();
        std::fs::write(&path, format!("{whole}{{\"name\": \"b\"")).unwrap();
        let (mut file, journal) = open_journal(dir.path(), None).unwrap();
        assert_eq!(journal.entries.len(), 1);
        let error = open_journal(dir.path(), None).unwrap_err().to_string();
        assert!(error.contains("another `paws batch`"), "{error}");
        assert!(open_journal(dir.path(), Some((1, 2))).is_ok());
        append(&mut file, dir.path(), &entry).unwrap();
        assert_eq!(std::fs::read_to_string(&path).unwrap(), format!("{whole}{whole}"));
    }
}
