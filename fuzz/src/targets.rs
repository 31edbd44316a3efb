//! Which reader is fuzzed, and what becomes of an input.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, OnceLock};

use libfuzzer_sys::Corpus;

use crate::memory;
use crate::readers::files::Files;
use crate::readers::targets::{self, Target};

static CHOSEN: OnceLock<Mutex<(Target, Files)>> = OnceLock::new();

/// How many more inputs others may be made of. All, where the run learns from what it reaches; in a run of the same inputs every
/// time (`PAWS_FUZZ_FIRST`) the seeds alone, since what is reached is not the same twice: hash tables have random seeds.
static FIRST: AtomicUsize = AtomicUsize::new(usize::MAX);

/// The target that `PAWS_FUZZ_TARGET` names. Without one, or with another name, the names are printed and the process ends.
pub fn choose() {
    if let Some(first) = std::env::var("PAWS_FUZZ_FIRST").ok().and_then(|n| n.parse().ok()) {
        FIRST.store(first, Ordering::Relaxed);
    }
    let name = std::env::var("PAWS_FUZZ_TARGET").unwrap_or_default();
    let Some(target) = Target::named(&name) else {
        for name in targets::names() {
            println!("{name}");
        }
        std::process::exit(if name == "list" { 0 } else { 2 });
    };
    assert!(CHOSEN.set(Mutex::new((target, Files::new(&folder())))).is_ok(), "chosen twice");
}

/// Where files of inputs go: the folder that `fuzz/run` made and removes, else one in memory where there is one.
fn folder() -> PathBuf {
    let shared = Path::new("/dev/shm");
    match std::env::var_os("PAWS_FUZZ_DIR") {
        Some(dir) => PathBuf::from(dir),
        None if shared.is_dir() => shared.to_owned(),
        None => std::env::temp_dir(),
    }
}

/// Reads one input; whether others may be made of it.
pub fn run(bytes: &[u8]) -> Corpus {
    let Some(chosen) = CHOSEN.get() else { return Corpus::Reject };
    let mut chosen = chosen.lock().expect("a reader that panics ends the process");
    let (target, files) = &mut *chosen;
    memory::watch();
    target.run(files, bytes);
    memory::rest();
    match FIRST.load(Ordering::Relaxed) {
        usize::MAX => Corpus::Keep,
        0 => Corpus::Reject,
        left => {
            FIRST.store(left - 1, Ordering::Relaxed);
            Corpus::Keep
        }
    }
}
