//! Text for a terminal, built line by line.

use choreo_script::printable_line;
use std::fmt::Arguments;

/// Lines of text. Control characters in file names or file contents are replaced, so each line stays one line.
#[derive(Default)]
pub(crate) struct Page(String);

impl Page {
    pub(crate) fn line(&mut self, line: Arguments<'_>) {
        self.0.push_str(&printable_line(&line.to_string()));
        self.0.push('\n');
    }

    /// Adds a line for each item.
    pub(crate) fn lines(&mut self, items: impl IntoIterator<Item = impl std::fmt::Display>) {
        items.into_iter().for_each(|item| self.line(format_args!("{item}")));
    }

    /// Adds text whose lines are safe already.
    pub(crate) fn text(&mut self, text: &str) {
        self.0.push_str(text);
    }

    pub(crate) fn as_str(&self) -> &str {
        &self.0
    }
}
