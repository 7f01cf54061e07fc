//! Why an edit of a script is not made.

use super::Edit;

/// Why a change was not made, for the user, and the line that would make it all the same.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{why}")]
pub struct EditRefused {
    pub why: String,
    /// Line of the script that decides, from 1.
    pub line: Option<usize>,
    /// A line to add that overrides a computed value, or replaces the line in the way.
    pub over: Option<Edit>,
    /// Label of the button for `over`.
    pub agree: &'static str,
    /// The script computes what was to be changed.
    pub is_computed: bool,
}

/// Label of the button that adds a line.
pub(super) const ADD: &str = "Add the line";

impl EditRefused {
    /// Refused because of a line.
    pub fn at(line: usize, why: &str) -> EditRefused {
        EditRefused { line: Some(line), ..EditRefused::from(format!("line {line}: {why}")) }
    }
}

impl From<String> for EditRefused {
    fn from(why: String) -> EditRefused {
        EditRefused { why, line: None, over: None, agree: ADD, is_computed: false }
    }
}
