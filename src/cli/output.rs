//! Outputs that are whole or not there, whatever ends the run.
//!
//! A folder NAME is written as `.NAME.partial-PID` beside its place. When it is complete it changes places with the old one
//! in one step of the file system, and the old one is removed: at every moment NAME is the old folder or the new one. Where
//! the file system cannot do that, the old folder is first moved to `.NAME.old-PID`; a run that is killed between the two
//! moves leaves no NAME, and the next command that reads or writes NAME brings the old one back.
//!
//! Who writes a hidden folder or file holds a lock on it, which the system drops when the process ends. What nobody holds
//! was left behind by a run that was killed: the next run that writes NAME removes it.

use std::fs::File;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};

/// What a folder of ours holds: only a folder of the same kind is replaced.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// A twin.
    Twin,
    /// A synthetic recording.
    Recording,
    /// Pictures of a twin beside the recorded frames.
    Comparison,
}

impl Kind {
    /// The file that marks such a folder.
    fn marker(self) -> &'static str {
        match self {
            Self::Twin => ".paws-twin",
            Self::Recording => ".paws-recording",
            Self::Comparison => ".paws-comparison",
        }
    }
}

/// A folder that is written beside its place and moved there when it is complete.
pub struct Output {
    target: PathBuf,
    staging: PathBuf,
    /// The marker of the staged folder, locked while it is ours.
    _lock: File,
    done: bool,
}

impl Output {
    /// Prepares to write `target`. An existing folder is replaced only if this program made it as the same kind, or if it
    /// is empty; never if it is, or contains, one of the `inputs`.
    pub fn new(target: &Path, kind: Kind, inputs: &[&Path]) -> anyhow::Result<Self> {
        restore(target);
        if let Ok(out) = target.canonicalize() {
            for input in inputs {
                if input.canonicalize().is_ok_and(|i| i.starts_with(&out)) {
                    bail!("{}: is or contains the input {}; choose another --out", target.display(), input.display());
                }
            }
        }
        if target.exists() {
            let ours = target.join(kind.marker()).is_file();
            let empty = target.is_dir() && std::fs::read_dir(target).is_ok_and(|mut d| d.next().is_none());
            if !ours && !empty {
                bail!(
                    "{}: exists and was not made by paws; choose another --out, or remove it yourself",
                    target.display()
                );
            }
        }
        let parent = parent_of(target);
        std::fs::create_dir_all(parent).with_context(|| parent.display().to_string())?;
        clear(target);
        let staging = hidden(target, PARTIAL);
        // Of a run before this one that had the same number.
        let _ = std::fs::remove_dir_all(&staging);
        std::fs::create_dir_all(&staging).with_context(|| staging.display().to_string())?;
        let marker = staging.join(kind.marker());
        let lock = locked(&marker, b"made by paws; replaced as a whole when the command runs again\n")
            .with_context(|| marker.display().to_string())?;
        Ok(Self { target: target.to_owned(), staging, _lock: lock, done: false })
    }

    /// Writes one file, creating folders on the way.
    pub fn write(&self, name: &str, bytes: impl AsRef<[u8]>) -> anyhow::Result<()> {
        let path = self.path(name)?;
        std::fs::write(&path, bytes).with_context(|| path.display().to_string())
    }

    /// The staged path of a file, its folder made.
    pub fn path(&self, name: &str) -> anyhow::Result<PathBuf> {
        let path = self.staging.join(name);
        if name.split('/').any(|part| part.is_empty() || part == "..") {
            bail!("{name}: not a name for a file of the output");
        }
        if let Some(dir) = path.parent() {
            std::fs::create_dir_all(dir).with_context(|| dir.display().to_string())?;
        }
        Ok(path)
    }

    /// Moves the folder to its place.
    pub fn finish(mut self) -> anyhow::Result<()> {
        replace(&self.staging, &self.target).with_context(|| self.target.display().to_string())?;
        self.done = true;
        Ok(())
    }
}

impl Drop for Output {
    fn drop(&mut self) {
        if !self.done {
            // Nothing half-written stays; there is nobody left to tell if this fails too.
            let _ = std::fs::remove_dir_all(&self.staging);
        }
    }
}

/// Kinds of folders that carry a marker.
const MARKED: [Kind; 3] = [Kind::Twin, Kind::Recording, Kind::Comparison];

/// Words in the names of what is being written, and of what is being replaced.
const PARTIAL: &str = "partial";
const OLD: &str = "old";

fn name_of(target: &Path) -> String {
    target.file_name().map_or_else(|| "out".into(), |n| n.to_string_lossy().into_owned())
}

fn parent_of(target: &Path) -> &Path {
    target.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// The name beside `target` under which this process writes it or keeps the old one.
fn hidden(target: &Path, what: &str) -> PathBuf {
    parent_of(target).join(format!(".{}.{what}-{}", name_of(target), std::process::id()))
}

/// All such names that are there, of whatever process, in the order of their names.
fn all_hidden(target: &Path, what: &str) -> Vec<PathBuf> {
    let start = format!(".{}.{what}-", name_of(target));
    let Ok(entries) = std::fs::read_dir(parent_of(target)) else { return Vec::new() };
    let is_ours = |name: &str| {
        name.strip_prefix(&start).is_some_and(|id| !id.is_empty() && id.bytes().all(|b| b.is_ascii_digit()))
    };
    let mut found: Vec<PathBuf> =
        entries.flatten().filter(|e| is_ours(&e.file_name().to_string_lossy())).map(|e| e.path()).collect();
    found.sort();
    found
}

/// A new file that is ours as long as it is open. Where the file system has no locks it is nobody's, and nobody clears.
fn locked(path: &Path, bytes: &[u8]) -> std::io::Result<File> {
    use std::io::Write;
    let mut file = File::create(path)?;
    let _ = file.try_lock();
    file.write_all(bytes)?;
    Ok(file)
}

/// Whether no living process holds a hidden folder (by its marker) or file.
fn is_left_behind(path: &Path) -> bool {
    let free = |file: &Path| File::open(file).is_ok_and(|f| f.try_lock().is_ok());
    if path.is_dir() {
        // One without a marker was left before it had any, or by a version that knew no locks.
        let markers: Vec<PathBuf> = MARKED.map(|k| path.join(k.marker())).into_iter().filter(|m| m.is_file()).collect();
        markers.iter().all(|m| free(m))
    } else {
        free(path)
    }
}

/// Removes what runs that were killed left beside `target`. What cannot be removed does no harm.
fn clear(target: &Path) {
    // An old folder is rubbish only where there is another one in its place.
    let old = if target.exists() { all_hidden(target, OLD) } else { Vec::new() };
    for path in all_hidden(target, PARTIAL).into_iter().chain(old).filter(|path| is_left_behind(path)) {
        let _ = if path.is_dir() { std::fs::remove_dir_all(&path) } else { std::fs::remove_file(&path) };
    }
}

/// Brings back the folder that a run moved away and was killed before it had put the new one in its place.
pub fn restore(target: &Path) {
    if target.symlink_metadata().is_ok() {
        return;
    }
    if let Some(old) = all_hidden(target, OLD).into_iter().rfind(|old| is_left_behind(old)) {
        let _ = std::fs::rename(old, target);
    }
}

/// Puts `staging` in the place of `target`, and removes what was there.
fn replace(staging: &Path, target: &Path) -> std::io::Result<()> {
    if !target.exists() {
        return std::fs::rename(staging, target);
    }
    if exchanged(staging, target) {
        // The old folder has the staged one's name now; what is left of it is cleared by the next run.
        let _ = std::fs::remove_dir_all(staging);
        return Ok(());
    }
    let old = hidden(target, OLD);
    // Between the moves the old folder is ours, too: nobody else brings it back or clears it.
    let _held: Vec<File> = MARKED
        .iter()
        .filter_map(|kind| File::open(target.join(kind.marker())).ok())
        .filter(|marker| marker.try_lock().is_ok())
        .collect();
    std::fs::rename(target, &old)?;
    if let Err(error) = std::fs::rename(staging, target) {
        std::fs::rename(&old, target)?;
        return Err(error);
    }
    let _ = std::fs::remove_dir_all(&old);
    Ok(())
}

/// Lets two folders change places in one step; false where the system or the file system cannot.
#[cfg(any(target_os = "linux", target_vendor = "apple"))]
fn exchanged(a: &Path, b: &Path) -> bool {
    use rustix::fs::{CWD, RenameFlags, renameat_with};
    renameat_with(CWD, a, CWD, b, RenameFlags::EXCHANGE).is_ok()
}

#[cfg(not(any(target_os = "linux", target_vendor = "apple")))]
fn exchanged(_: &Path, _: &Path) -> bool {
    false
}

/// Writes one file through a temporary one beside it.
pub fn write_file(path: &Path, bytes: impl AsRef<[u8]>) -> anyhow::Result<()> {
    for left in all_hidden(path, PARTIAL).into_iter().filter(|left| left.is_file() && is_left_behind(left)) {
        let _ = std::fs::remove_file(left);
    }
    let staging = hidden(path, PARTIAL);
    let result = locked(&staging, bytes.as_ref()).and_then(|_lock| std::fs::rename(&staging, path));
    if result.is_err() {
        let _ = std::fs::remove_file(&staging);
    }
    result.with_context(|| path.display().to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(dir: &Path) -> Vec<String> {
        let mut names: Vec<String> =
            std::fs::read_dir(dir).unwrap().map(|e| e.unwrap().file_name().to_string_lossy().into_owned()).collect();
        names.sort();
        names
    }

    fn made(target: &Path, text: &str) -> anyhow::Result<()> {
        let output = Output::new(target, Kind::Twin, &[])?;
        output.write("a/b.txt", text)?;
        output.finish()
    }

    #[test]
    fn a_folder_is_replaced_as_a_whole_and_nothing_else_stays() {
        let dir = tempfile::tempdir().unwrap();
        let target = dir.path().join("out");
        for text in ["one", "two"] {
            made(&target, text).unwrap();
            assert_eq!(std::fs::read_to_string(target.join("a/b.txt")).unwrap(), text);
            assert_eq!(names(dir.path()), ["out"]);
        }
        // Given up on the way, the old one stays.
        drop(Output::new(&target, Kind::Twin, &[]).unwrap());
        assert_eq!(std::fs::read_to_string(target.join("a/b.txt")).unwrap(), "two");
        assert_eq!(names(dir.path()), ["out"]);
    }

    #[test]
    fn what_a_killed_run_left_is_cleared_and_what_a_living_one_writes_is_not() {
        let dir = tempfile::tempdir().unwrap();
        let target = dir.path().join("out");
        let dead = dir.path().join(".out.partial-1");
        std::fs::create_dir_all(&dead).unwrap();
        std::fs::write(dead.join(Kind::Twin.marker()), "").unwrap();
        std::fs::create_dir_all(dir.path().join(".out.partial-2/steps")).unwrap();
        let living = dir.path().join(".out.partial-3");
        std::fs::create_dir_all(&living).unwrap();
        let _held = locked(&living.join(Kind::Twin.marker()), b"").unwrap();
        std::fs::create_dir_all(dir.path().join(".out.partial-mine")).unwrap();
        made(&target, "new").unwrap();
        assert_eq!(names(dir.path()), [".out.partial-3", ".out.partial-mine", "out"]);
    }

    #[test]
    fn a_folder_that_was_moved_away_comes_back() {
        let dir = tempfile::tempdir().unwrap();
        let (target, old) = (dir.path().join("out"), dir.path().join(".out.old-1"));
        made(&target, "old").unwrap();
        std::fs::rename(&target, &old).unwrap();
        restore(&target);
        assert_eq!(std::fs::read_to_string(target.join("a/b.txt")).unwrap(), "old");
        assert_eq!(names(dir.path()), ["out"]);
    }

    #[test]
    fn a_file_is_written_as_a_whole() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.json");
        std::fs::write(dir.path().join(".a.json.partial-1"), "{").unwrap();
        write_file(&path, "{}").unwrap();
        assert_eq!(names(dir.path()), ["a.json"]);
    }
}
