//! What a person reads: tables, files of results, pictures, the page.

pub mod accuracy;
pub mod files;
pub mod page;
pub mod parts;
pub mod pictures;
pub mod table;
pub mod words;
