//! What a person reads: tables, files of results, pictures, the page.

pub mod accuracy;
pub mod drawings;
pub mod files;
pub mod likeness_table;
#[cfg(feature = "cli")]
pub mod page;
pub mod page_frames;
pub mod part_table;
pub mod phrases;
pub mod table;
