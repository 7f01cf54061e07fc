//! Output on a terminal: lines, JSON, progress bars.

pub(crate) mod import_bar;
pub mod json;
pub mod page;
pub mod pages;
pub mod progress;
pub(crate) mod width;
