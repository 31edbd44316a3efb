//! All readers under libFuzzer. `PAWS_FUZZ_TARGET` says which one; `fuzz/run` builds and starts this.
//!
//! A crash is a panic (an overflow and a broken debug assertion are panics here), a hang or a memory that no input may ask for.
//! Errors are what readers are there for.

#![no_main]

mod memory;
#[path = "../../tests/it/readers/mod.rs"]
mod readers;
mod targets;

use libfuzzer_sys::{fuzz_target, Corpus};

#[global_allocator]
static ALLOCATOR: memory::Counting = memory::Counting;

fuzz_target!(init: targets::choose(), |bytes: &[u8]| -> Corpus { targets::run(bytes) });
