//! Every reader as a function of bytes, for broken inputs: `fuzz_short` has a few hundred for each, the fuzzer of `fuzz/`, which is
//! built of these files too, millions. Errors are what readers are there for.

#![allow(clippy::expect_used, reason = "a reader that cannot be started should say so at once")]

pub mod files;
pub mod imports;
pub mod targets;
