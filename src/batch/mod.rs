//! Many recordings: which ones, what is finished, how long the rest takes, and the tables of all.
//!
//! Nothing here runs a twin: `paws batch` starts `paws twin` for each row in a process of its own, so that a crash costs one row.

pub mod estimate;
pub mod journal;
pub mod manifest;
pub mod result_tables;
