//! Refusals of script edits.

use super::Edit;

/// Why an edit was not made, for the user, and an alternative edit that has the same effect.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{why}")]
pub struct EditRefused {
    pub why: String,
    /// Line of the script that caused the refusal, from 1.
    pub line: Option<usize>,
    /// Alternative edit: adds a line that overrides a computed value, or replaces the line that prevents the edit.
    pub alternative: Option<Edit>,
    /// Label of the button for `alternative`.
    pub alternative_label: &'static str,
    /// Whether the script computes the value that was to be changed.
    pub is_computed: bool,
}

/// Label of the button that adds a line.
pub(super) const ADD_LINE_LABEL: &str = "Add the line";

impl EditRefused {
    /// A refusal caused by a line of the script, from 1.
    pub fn at(line: usize, why: &str) -> EditRefused {
        EditRefused { line: Some(line), ..EditRefused::from(format!("line {line}: {why}")) }
    }

    /// The refusal with its line converted to the text before `edits`. `text`: that text. For a refusal of an edit that follows other edits.
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
        EditRefused {
            why,
            line: None,
            alternative: None,
            alternative_label: ADD_LINE_LABEL,
            is_computed: false,
        }
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
        // One line is removed, two are added, and one gets longer.
        let gone = edit(2..4, "");
        assert_eq!(refused(2, from_ref(&gone)), 3);
        assert_eq!(refused(1, from_ref(&gone)), 1);
        let come = edit(1..1, "\nx\ny");
        assert_eq!([1, 2, 3, 4, 6].map(|line| refused(line, from_ref(&come))), [1, 1, 1, 2, 4]);
        assert_eq!(refused(3, &[edit(0..1, "a longer one")]), 3);
        // The edits apply in order: of a, x, y, c, d the fourth line was the third.
        assert_eq!(refused(4, &[gone, come]), 3);
    }
}
