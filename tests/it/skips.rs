//! The list of checks that were skipped: the tests of `it` write it, `zz_skips`, which cargo runs after them, tells it.

use std::path::{Path, PathBuf};

/// The file of the list: a line that names the run, then a line for each check, why it was skipped.
pub fn list() -> PathBuf {
    Path::new(env!("CARGO_TARGET_TMPDIR")).join("skipped.txt")
}

/// What the binaries of one run have in common: the cargo that runs them.
#[cfg(unix)]
pub fn run() -> String {
    format!("run {}", std::os::unix::process::parent_id())
}

/// One name for all runs, where a process does not know its parent.
#[cfg(not(unix))]
pub fn run() -> String {
    "run".to_owned()
}

/// A list without a check.
pub fn begun(run: &str) -> String {
    format!("{run}\n")
}

/// The reasons on a list; `None` where it is not of this run.
pub fn reasons<'a>(list: &'a str, run: &str) -> Option<Vec<&'a str>> {
    let mut lines = list.lines();
    (lines.next() == Some(run)).then(|| lines.filter(|line| !line.is_empty()).collect())
}

/// One line for people: how many checks were skipped, and each reason once.
pub fn sentence(reasons: &[&str]) -> String {
    let mut once: Vec<&str> = Vec::new();
    for reason in reasons {
        if !once.contains(reason) {
            once.push(reason);
        }
    }
    let checks = if reasons.len() == 1 { "check" } else { "checks" };
    let why = if once.is_empty() { String::new() } else { format!(": {}", once.join("; ")) };
    format!("{} {checks} skipped{why}", reasons.len())
}
