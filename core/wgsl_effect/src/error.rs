//! Errors of an effect's text, with their place.

use std::fmt;
use thiserror::Error;

/// Error of an effect's text. Shown with the line and a caret below the place:
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

/// Characters of a line that are shown.
const WIDTH: usize = 160;

impl fmt::Display for EffectError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let EffectError { file, line, column, message, source_line } = self;
        write!(f, "{file}:{line}:{column}: {message}")?;
        let shown: Vec<char> = source_line.chars().map(|c| if c.is_control() { ' ' } else { c }).collect();
        let indent = shown.iter().take_while(|c| **c == ' ').count();
        let at = column.saturating_sub(1).min(shown.len());
        // A very long line is cut to the part around the place.
        let start = indent.min(at).max(at.saturating_sub(WIDTH - 40));
        let end = shown.len().min(start + WIDTH);
        let code: String = shown[start..end].iter().collect();
        if code.trim().is_empty() {
            return Ok(());
        }
        write!(f, "\n    {}\n    {}^", code.trim_end(), " ".repeat(at - start))
    }
}
