//! Numbers that the user typed, written into the script as they were typed.

use super::number_style::without_point;
use super::times::EditTime;
use super::values::format_number;
use super::{Edit, EditRefused};

/// A number with its source text, which may be an expression: `1.0 / 3.0` or `f(12)`.
#[derive(Clone, Debug, PartialEq)]
pub struct TypedNumber {
    pub value: f64,
    pub text: String,
}

impl From<f64> for TypedNumber {
    fn from(value: f64) -> TypedNumber {
        TypedNumber { value, text: format_number(value) }
    }
}

impl TypedNumber {
    /// Replaces the digits of the number in an edit with the typed text; also in the line that a refusal offers. `made`: the edit with digits.
    ///
    /// # Errors
    /// `made` is a refusal.
    pub fn keep(&self, text: &str, made: Result<Edit, EditRefused>) -> Result<Edit, EditRefused> {
        self.replace_digits(&[format_number(self.value)], text, made)
    }

    /// Like [`TypedNumber::keep`] for a time in seconds. `fps`: frame rate of the stage.
    ///
    /// # Errors
    /// `made` is a refusal.
    pub fn keep_time(
        &self,
        text: &str,
        made: Result<Edit, EditRefused>,
        fps: f64,
    ) -> Result<Edit, EditRefused> {
        let time = EditTime { secs: self.value, fps };
        self.replace_digits(&[time.text(true), time.text(false), format_number(self.value)], text, made)
    }

    fn replace_digits(
        &self,
        digits: &[String],
        text: &str,
        made: Result<Edit, EditRefused>,
    ) -> Result<Edit, EditRefused> {
        if self.text == format_number(self.value) {
            return made;
        }
        // Whole numbers may be written without a decimal point.
        let wholes = digits.iter().filter_map(|digits| without_point(digits));
        let digits: Vec<&str> = digits.iter().map(String::as_str).chain(wholes).collect();
        let kept = |edit: Edit| {
            digits.iter().find_map(|digits| self.with_typed_text(digits, text, &edit)).unwrap_or(edit)
        };
        match made {
            Ok(edit) => Ok(kept(edit)),
            Err(refused) => Err(EditRefused { alternative: refused.alternative.map(kept), ..refused }),
        }
    }

    /// The edit with the typed text in place of these digits. `None` if it does not write them.
    fn with_typed_text(&self, digits: &str, text: &str, edit: &Edit) -> Option<Edit> {
        let after = edit.apply(text);
        let changed = Edit::between(text, &after);
        // Digits of an unchanged text are replaced, too.
        let stays = after == text;
        let Edit { range, text: written } = if stays { edit } else { &changed };
        let written = range.start..range.start + written.len();
        let is_part = |c: char| c.is_alphanumeric() || matches!(c, '_' | '.');
        let is_it = |at: &usize| {
            let end = at + digits.len();
            let is_whole =
                !after[..*at].ends_with(|c| is_part(c) || c == '-') && !after[end..].starts_with(is_part);
            is_whole && *at <= written.end && end >= written.start
        };
        let mut found: Vec<usize> = after.match_indices(digits).map(|(at, _)| at).filter(is_it).collect();
        // If several numbers match and the text is unchanged or the digits are exact, nothing is replaced: the typed one is unknown, and exact
        // digits are as good.
        let is_exact = digits.parse() == Ok(self.value);
        if found.is_empty() || found.len() > 1 && (stays || is_exact) {
            return None;
        }
        let mut typed = after.clone();
        while let Some(at) = found.pop() {
            typed.replace_range(at..at + digits.len(), &self.text);
        }
        Some(Edit::between(text, &typed))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn one_third() -> TypedNumber {
        TypedNumber { value: 1.0 / 3.0, text: "1.0 / 3.0".to_string() }
    }

    /// The text after an edit from `before` to `after` that keeps the typed number.
    fn kept(typed: &TypedNumber, before: &str, after: &str) -> String {
        let edit = Edit::between(before, after);
        typed.keep_time(before, Ok(edit), 25.0).unwrap().apply(before)
    }

    #[test]
    fn typed_expressions_replace_the_digits_of_an_edit() {
        for (before, after, wanted) in [
            ("at(0.0, 2.0)", "at(0.333, 2.0)", "at(1.0 / 3.0, 2.0)"),
            // Other numbers with the same digits stay.
            ("at(0.333, 2.0, 0.333)", "at(0.333, 0.333, 0.333)", "at(0.333, 1.0 / 3.0, 0.333)"),
            ("a()", "a().at(0.0, 0.333, -0.333)", "a().at(0.0, 1.0 / 3.0, -0.333)"),
            ("a(10.333)", "a(20.333)", "a(20.333)"),
        ] {
            assert_eq!(kept(&one_third(), before, after), wanted);
        }
        for (text, wanted) in
            [("at(0.333, 1.0)", "at(1.0 / 3.0, 1.0)"), ("at(0.333, 0.333)", "at(0.333, 0.333)")]
        {
            let same = Edit { range: 3..text.len() - 1, text: text[3..text.len() - 1].to_string() };
            assert_eq!(one_third().keep(text, Ok(same)).unwrap().apply(text), wanted);
        }
    }

    #[test]
    fn a_time_typed_as_a_frame_is_written_as_a_frame() {
        let frame = TypedNumber { value: 0.48, text: "f(12)".to_string() };
        assert_eq!(kept(&frame, "from(0.5)", "from(0.48)"), "from(f(12))");
        assert_eq!(kept(&frame, "from(f(3))", "from(f(12))"), "from(f(12))");
        // A typed number without an expression is written in the style of the script.
        assert_eq!(kept(&0.48.into(), "from(f(3))", "from(f(12))"), "from(f(12))");
    }
}
