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

    /// The refusal of a further change of a text that some edits have changed already, with the line of the text before them.
    #[must_use]
    pub fn before(self, text: &str, edits: &[Edit]) -> EditRefused {
        let Some(line) = self.line else { return self };
        let mut texts = vec![text.to_string()];
        for edit in edits {
            texts.push(edit.apply(&texts[texts.len() - 1]));
        }
        let was =
            edits.iter().zip(&texts).rev().fold(line, |line, (edit, before)| edit.line_before(before, line));
        let why = match self.why.strip_prefix(&format!("line {line}: ")) {
            Some(rest) => format!("line {was}: {rest}"),
            None => self.why,
        };
        EditRefused { why, line: Some(was), ..self }
    }
}

impl From<String> for EditRefused {
    fn from(why: String) -> EditRefused {
        EditRefused { why, line: None, over: None, agree: ADD, is_computed: false }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::slice::from_ref;

    #[test]
    fn a_refusal_names_the_line_of_the_text_before_the_edits() {
        let text = "a\nb\nc\nd\n";
        let refused = |line, edits: &[Edit]| {
            let refused = EditRefused::at(line, "no").before(text, edits);
            assert_eq!(refused.why, format!("line {}: no", refused.line.unwrap()));
            refused.line.unwrap()
        };
        let edit = |range, text: &str| Edit { range, text: text.into() };
        assert_eq!(refused(3, &[]), 3);
        // A line goes, two come, and one is longer.
        let gone = edit(2..4, "");
        assert_eq!(refused(2, from_ref(&gone)), 3);
        assert_eq!(refused(1, from_ref(&gone)), 1);
        let come = edit(1..1, "\nx\ny");
        assert_eq!([1, 2, 3, 4, 6].map(|line| refused(line, from_ref(&come))), [1, 1, 1, 2, 4]);
        assert_eq!(refused(3, &[edit(0..1, "a longer one")]), 3);
        // One after the other: of a, x, y, c, d the fourth was the third.
        assert_eq!(refused(4, &[gone, come]), 3);
    }
}
