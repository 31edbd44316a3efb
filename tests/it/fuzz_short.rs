//! Every reader on its seeds (`fuzz/corpus`) and on what a fixed random sequence makes of them, a few hundred inputs each, the same
//! ones every time: none panics, takes more than five seconds or asks for a memory out of proportion. `fuzz/run` has millions, with
//! coverage.
//!
//! A reader runs in a process of its own, this program again (`one_reader`): so a hang, an abort and a peak of memory are its own.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use paws_twin::import::formats;
use tempfile::TempDir;

use crate::common::skipped;
use crate::readers::files::Files;
use crate::readers::imports;
use crate::readers::targets::{self, Target};

/// Inputs that are made for a reader, besides its seeds.
const INPUTS: usize = 300;
/// An input that takes more of the processor's time is a hang, and one that takes more of anybody's.
const HANG_SECS: f64 = 5.0;
const STUCK: Duration = Duration::from_secs(60);
/// What a reader may hold at once of an input of kilobytes, MiB.
const MOST_MIB: usize = 512;
/// Addresses that a reader's process may take, KiB: a request for more fails at once, whether it would be used or not.
const ADDRESSES_KIB: usize = 2 << 20;
/// Larger files are no seeds, bytes.
const LARGEST_SEED: u64 = 32 << 10;
/// Changes of one input at the most.
const CHANGES: usize = 4;

/// Says to `one_reader` which one it is.
const READER: &str = "PAWS_FUZZ_TARGET";
/// Says to it where it may write.
const FOLDER: &str = "PAWS_FUZZ_DIR";

#[test]
fn readers_of_files_survive_broken_ones() {
    all_survive(|name| !name.starts_with(targets::IMPORT));
}

#[test]
fn readers_of_others_recordings_survive_broken_ones() {
    all_survive(|name| name.starts_with(targets::IMPORT));
}

#[test]
fn every_format_of_import_has_a_seed_that_is_read() {
    let dir = scratch();
    let mut files = Files::new(dir.path());
    for format in formats::ALL {
        let seeds = seeds(&format!("{}{}", targets::IMPORT, format.name));
        let read = seeds.iter().any(|seed| imports::run(format, &mut files, seed));
        assert!(
            read,
            "{}: none of {} seeds in fuzz/corpus is read; fuzz/seeds.py writes them",
            format.name,
            seeds.len()
        );
    }
}

#[test]
fn one_name_makes_the_same_inputs_every_time() {
    let made = |name: &str| {
        let (seeds, mut chance) = (vec![b"1.5,2,x\n".to_vec(), b"\x00\x01".to_vec()], Chance::of(name));
        (0..50).map(|_| mutated(&seeds, &mut chance)).collect::<Vec<_>>()
    };
    assert_eq!(made("a"), made("a"));
    assert_ne!(made("a"), made("b"));
}

/// Runs all readers whose names are `wanted`, each in its process.
fn all_survive(wanted: impl Fn(&str) -> bool) {
    let broken: Vec<String> = targets::names().iter().filter(|name| wanted(name)).filter_map(|n| fault(n)).collect();
    assert!(broken.is_empty(), "{}", broken.join("\n"));
}

/// What broke a reader, with the input that did, or `None`.
fn fault(name: &str) -> Option<String> {
    let dir = scratch();
    let out = start(name, dir.path());
    let said = String::from_utf8_lossy(&out.stdout);
    if out.status.success() && said.contains("1 passed") {
        return None;
    }
    let kept = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("fuzz_short_{name}.bin"));
    let _ = std::fs::copy(dir.path().join("input"), &kept);
    let words = String::from_utf8_lossy(&out.stderr);
    let words: Vec<&str> = words.lines().chain(said.lines()).filter(|line| !line.is_empty()).take(4).collect();
    Some(format!("{name}: {}: {}; the input: {}", out.status, words.join(" | "), kept.display()))
}

/// A reader's process, to its end.
fn start(name: &str, folder: &Path) -> Output {
    // Where addresses cannot be limited, resident memory is still looked at.
    let limited = format!("ulimit -v {ADDRESSES_KIB} 2>/dev/null; exec \"$0\" \"$@\"");
    let mut command = if cfg!(unix) { Command::new("sh") } else { Command::new(std::env::current_exe().unwrap()) };
    if cfg!(unix) {
        command.args(["-c", &limited]).arg(std::env::current_exe().unwrap());
    }
    command.args(["fuzz_short::one_reader", "--exact", "--ignored", "--nocapture"]);
    command.env(READER, name).env(FOLDER, folder).env("RAYON_NUM_THREADS", "1").output().unwrap()
}

#[test]
#[ignore = "the other tests of this file start it, with the name of a reader"]
fn one_reader() {
    let (Ok(name), Some(folder)) = (std::env::var(READER), std::env::var_os(FOLDER)) else {
        return skipped("a reader alone is tried where the other tests of fuzz_short start it");
    };
    let folder = PathBuf::from(folder);
    let target = Target::named(&name).unwrap();
    let seeds = seeds(&name);
    assert!(!seeds.is_empty(), "there are no seeds in fuzz/corpus");
    let (mut files, mut chance) = (Files::new(&folder), Chance::of(&name));
    end_where_it_hangs();
    let before = peak_mib().unwrap_or_default();
    for n in 0..seeds.len() + INPUTS {
        let input = seeds.get(n).cloned().unwrap_or_else(|| mutated(&seeds, &mut chance));
        std::fs::write(folder.join("input"), &input).unwrap();
        target.run(&mut files, &input);
        let more = peak_mib().unwrap_or_default().saturating_sub(before);
        assert!(more < MOST_MIB, "an input of {} bytes makes it hold {more} MiB", input.len());
        READ.fetch_add(1, Ordering::Relaxed);
    }
}

/// Inputs that were read in this process.
static READ: AtomicUsize = AtomicUsize::new(0);

/// Ends the process where one input takes too long. Where others take the processor, a reader only waits.
fn end_where_it_hangs() {
    std::thread::spawn(|| {
        let (mut read, mut since, mut spent) = (usize::MAX, Instant::now(), None);
        loop {
            let now = READ.load(Ordering::Relaxed);
            if now != read {
                (read, since, spent) = (now, Instant::now(), processor_secs());
            }
            let is_busy = spent.zip(processor_secs()).is_some_and(|(before, now)| now - before > HANG_SECS);
            if is_busy || since.elapsed() > STUCK {
                eprintln!("a hang: an input takes more than {HANG_SECS} s");
                std::process::exit(3);
            }
            std::thread::sleep(Duration::from_millis(250));
        }
    });
}

/// What this process has taken of the processor, seconds; `None` where the system does not tell.
fn processor_secs() -> Option<f64> {
    let stat = std::fs::read_to_string("/proc/self/stat").ok()?;
    // Behind the program's name, which may hold anything: the twelfth and thirteenth number, in hundredths of a second.
    let mut cells = stat.rsplit_once(')')?.1.split_whitespace().skip(11);
    let mut ticks = || cells.next()?.parse::<f64>().ok();
    Some((ticks()? + ticks()?) / 100.0)
}

/// Most memory that this process has held, MiB; `None` where the system does not tell.
fn peak_mib() -> Option<usize> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    Some(line.split_whitespace().next()?.parse::<usize>().ok()? / 1024)
}

/// A folder in memory where there is one.
fn scratch() -> TempDir {
    let shared = Path::new("/dev/shm");
    if shared.is_dir() { tempfile::tempdir_in(shared).unwrap() } else { tempfile::tempdir().unwrap() }
}

/// The seeds of a reader by name: its folder of the corpus, and files of the tests that `fuzz/seeds.json` lists.
fn seeds(name: &str) -> Vec<Vec<u8>> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let name = name.strip_suffix("_check").unwrap_or(name);
    let listed = std::fs::read_to_string(root.join("fuzz/seeds.json")).unwrap();
    let listed: BTreeMap<String, Vec<String>> = serde_json::from_str(&listed).unwrap();
    let more = listed.get(name).into_iter().flatten().map(|folder| root.join("tests/data").join(folder));
    let mut found = Vec::new();
    for folder in std::iter::once(root.join("fuzz/corpus").join(name)).chain(more) {
        collect(&folder, &mut found);
    }
    found.sort();
    found.iter().map(|path| std::fs::read(path).unwrap()).collect()
}

/// Files below a folder that are small enough; none where there is no such folder.
fn collect(folder: &Path, out: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).into_iter().flatten() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            collect(&path, out);
        } else if path.metadata().unwrap().len() <= LARGEST_SEED {
            out.push(path);
        }
    }
}

/// A random sequence (splitmix64) that a name decides.
struct Chance(u64);

impl Chance {
    fn of(name: &str) -> Self {
        Self(name.bytes().fold(1_u64, |all, byte| all.wrapping_mul(257).wrapping_add(u64::from(byte))))
    }

    fn draw(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mixed = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        let mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        mixed ^ (mixed >> 31)
    }

    /// A number below `count`; 0 where that is 0.
    fn below(&mut self, count: usize) -> usize {
        (self.draw() % count.max(1) as u64) as usize
    }

    fn one<'a, T>(&mut self, of: &'a [T]) -> &'a T {
        &of[self.below(of.len())]
    }
}

/// What stands for a number in a text.
const NUMBERS: [&str; 14] = [
    "0",
    "-1",
    "0.5",
    "1e-320",
    "1e308",
    "-1e308",
    "1e400",
    "NaN",
    "inf",
    "4294967296",
    "18446744073709551615",
    "-9223372036854775809",
    "\"1\"",
    "",
];
/// What stands for a number among bytes.
const WORDS: [&[u8]; 8] = [
    &[0xFF; 8],
    &[0xFF; 4],
    &[0xFF, 0xFF, 0xFF, 0x7F],
    &[0x7F, 0xFF, 0xFF, 0xFF],
    &[0; 4],
    &[0, 0, 0, 0, 0, 0, 0xF8, 0x7F],
    &[0, 0, 0, 0x80],
    &[0, 1],
];

/// One of the seeds, changed.
fn mutated(seeds: &[Vec<u8>], chance: &mut Chance) -> Vec<u8> {
    let mut bytes = chance.one(seeds).clone();
    for _ in 0..=chance.below(CHANGES) {
        change(&mut bytes, seeds, chance);
    }
    bytes
}

/// One change at one place.
fn change(bytes: &mut Vec<u8>, seeds: &[Vec<u8>], chance: &mut Chance) {
    if bytes.is_empty() {
        return bytes.push(chance.below(256) as u8);
    }
    let at = chance.below(bytes.len());
    let end = (at + 1 + chance.below(16)).min(bytes.len());
    match chance.below(9) {
        0 => bytes[at] ^= 1 << chance.below(8),
        1 => bytes[at] = chance.below(256) as u8,
        2 => drop(bytes.drain(at..end)),
        3 => {
            let piece = bytes[at..end].to_vec();
            drop(bytes.splice(at..at, piece));
        }
        4 | 5 => renumber(bytes, at, chance),
        6 => {
            for (byte, value) in bytes[at..].iter_mut().zip(*chance.one(&WORDS)) {
                *byte = *value;
            }
        }
        7 => bytes.truncate(at),
        _ => {
            let other = chance.one(seeds);
            let from = chance.below(other.len());
            let piece = other[from..other.len().min(from + 64)].to_vec();
            drop(bytes.splice(at..end, piece));
        }
    }
}

/// Puts another number in the place of the next one of a text.
fn renumber(bytes: &mut Vec<u8>, at: usize, chance: &mut Chance) {
    let belongs = |byte: &u8| byte.is_ascii_digit() || b"+-.eE".contains(byte);
    let Some(start) = (at..bytes.len()).find(|&i| bytes[i].is_ascii_digit()) else { return };
    let end = (start..bytes.len()).find(|&i| !belongs(&bytes[i])).unwrap_or(bytes.len());
    let number = chance.one(&NUMBERS);
    drop(bytes.splice(start..end, number.bytes()));
}
