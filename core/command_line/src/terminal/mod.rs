//! Output on a terminal: lines, progress bars.

pub mod import_bar;
pub mod page;
pub mod progress;
