//! What a person reads: tables, files of results, the page.

pub mod accuracy;
pub mod files;
pub mod page;
pub mod table;
pub mod words;
