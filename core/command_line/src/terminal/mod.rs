//! Output on a terminal: lines, JSON, progress bars.

pub(crate) mod import_bar;
pub mod json;
pub mod page;
pub mod pages;
pub mod progress;
pub(crate) mod width;

/// Formats a number with its noun, whose plural ends in s: "1 frame", "2 frames".
pub(crate) fn counted(number: u64, singular: &str) -> String {
    match number {
        1 => format!("1 {singular}"),
        _ => format!("{number} {singular}s"),
    }
}
