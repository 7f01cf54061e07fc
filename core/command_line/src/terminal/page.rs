//! Text for a terminal, line by line.

use choreo_script::printable_line;
use std::fmt::Arguments;

/// Lines of which each stays one line, whatever names of files and from files are in it.
#[derive(Default)]
pub(crate) struct Page(String);

impl Page {
    pub fn line(&mut self, line: Arguments<'_>) {
        self.0.push_str(&printable_line(&line.to_string()));
        self.0.push('\n');
    }

    /// A line for each item.
    pub fn lines(&mut self, items: impl IntoIterator<Item = impl std::fmt::Display>) {
        items.into_iter().for_each(|item| self.line(format_args!("{item}")));
    }

    /// Text that was made line by line elsewhere.
    pub fn text(&mut self, text: &str) {
        self.0.push_str(text);
    }

    pub fn as_str(&self) -> &str {
        &self.0
    }
}
