//! Output on a terminal: lines, progress bars.

pub(crate) mod import_bar;
pub mod page;
pub mod progress;
