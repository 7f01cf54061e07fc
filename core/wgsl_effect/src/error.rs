//! Errors in an effect's text, with their place.

use choreo_plugin::excerpt;
use std::fmt;
use thiserror::Error;

/// Error in an effect's text. It is shown with the line and a caret below the place:
/// ```text
/// my.wgsl:3:10: no definition in scope for identifier: `colr`
///     return colr;
///            ^
/// ```
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub struct EffectError {
    /// Name of the text in messages.
    pub file: String,
    /// Line, from 1.
    pub line: usize,
    /// Column in characters, from 1.
    pub column: usize,
    /// The problem.
    pub message: String,
    /// The line as its author wrote it.
    pub source_line: String,
}

impl EffectError {
    /// An error in a text.
    pub(crate) fn new(
        file: &str,
        text: &str,
        (line, column): (usize, usize),
        message: String,
    ) -> EffectError {
        let source_line = text.lines().nth(line.saturating_sub(1)).unwrap_or_default().to_string();
        EffectError { file: file.into(), line, column, message, source_line }
    }
}

impl fmt::Display for EffectError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let EffectError { file, line, column, message, source_line } = self;
        write!(f, "{file}:{line}:{column}: {message}{}", excerpt::below(source_line, *column))
    }
}
