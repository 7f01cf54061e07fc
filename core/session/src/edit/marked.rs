//! Texts of tests in which `|` marks a position.

/// The text without its first `|`, and the line and column of the mark, from 1.
pub(crate) fn marked(text: &str) -> (String, usize, usize) {
    let at = text.find('|').unwrap();
    let before = &text[..at];
    let column = before.rsplit('\n').next().unwrap().chars().count() + 1;
    (text.replacen('|', "", 1), before.matches('\n').count() + 1, column)
}
