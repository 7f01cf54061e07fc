//! Output on a terminal: lines, JSON, progress bars.

pub(crate) mod import_bar;
pub(crate) mod json;
pub(crate) mod page;
pub(crate) mod pages;
pub(crate) mod progress;
pub(crate) mod width;

/// Formats a number with its noun: "1 frame", "2 frames", "2 meshes".
pub(crate) fn counted(number: u64, singular: &str) -> String {
    match (number, singular) {
        (1, _) => format!("1 {singular}"),
        (_, "mesh") => format!("{number} meshes"),
        (_, "vertex") => format!("{number} vertices"),
        (_, "joint matrix") => format!("{number} joint matrices"),
        (_, "copy") => format!("{number} copies"),
        _ => format!("{number} {singular}s"),
    }
}
