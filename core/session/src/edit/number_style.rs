//! Whole numbers, which a script may write without a decimal point: a new whole number keeps that style.

use super::Edit;
use choreo_script::token_ranges;
use std::ops::Range;

impl Edit {
    /// Replaces a value in its style: `fov(34)` becomes `fov(40)`, and `fov(34.0)` becomes `fov(40.0)`.
    pub(super) fn in_old_style(text: &str, range: Range<usize>, value: &str) -> Edit {
        Edit { text: in_number_style(&text[range.clone()], value), range }
    }
}

/// A new value in the style of an old one: each whole number is written without a decimal point if the old number in its place is. If the counts
/// differ, no number has a point if no old one had. Numbers in a calculation keep their points, since a script divides numbers without one as
/// integers.
pub(super) fn in_number_style(old: &str, new: &str) -> String {
    let is_whole = |range: &Range<usize>| !old[range.clone()].contains('.');
    let (before, after) = (value_ranges(old), value_ranges(new));
    let is_alike = before.len() == after.len();
    let are_whole = !before.is_empty() && before.iter().all(is_whole);
    let mut written = new.to_string();
    for (index, range) in after.into_iter().enumerate().rev() {
        let is_whole = if is_alike { is_whole(&before[index]) } else { are_whole };
        if let Some(digits) = without_point(&new[range.clone()]).filter(|_| is_whole) {
            written.replace_range(range, digits);
        }
    }
    written
}

/// Digits of a whole number without its decimal point: `40` for `40.0`. `None` if the number does not end with `.0`.
pub(super) fn without_point(number: &str) -> Option<&str> {
    let digits = number.strip_suffix(".0")?;
    digits.trim_start_matches('-').bytes().all(|b| b.is_ascii_digit()).then_some(digits)
}

/// Bytes of the numbers that are values by themselves or components of lists and maps, but not parts of a calculation.
fn value_ranges(text: &str) -> Vec<Range<usize>> {
    let tokens = token_ranges(text);
    let token =
        |index: Option<usize>| index.and_then(|index| tokens.get(index)).map_or("", |t| &text[t.clone()]);
    let is_value = |index: &usize| {
        let sign = index.checked_sub(1).filter(|before| token(Some(*before)) == "-");
        let before = sign.unwrap_or(*index).checked_sub(1);
        token(Some(*index)).trim_start_matches('-').starts_with(|c: char| c.is_ascii_digit())
            && matches!(token(before), "" | "," | "[" | ":")
            && matches!(token(Some(index + 1)), "" | "," | "]" | "}")
    };
    (0..tokens.len()).filter(is_value).map(|index| tokens[index].clone()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_new_whole_number_keeps_the_style_of_the_old_one() {
        for (old, new, wanted) in [
            ("34", "40.0", "40"),
            ("34", "40.5", "40.5"),
            ("34.0", "40.0", "40.0"),
            ("-3", "4.0", "4"),
            ("0", "-0.5", "-0.5"),
            ("1, 2.0, -3", "2.0, 2.0, -4.0", "2, 2.0, -4"),
            ("[0, 1.5]", "[2.0, 2.0]", "[2, 2.0]"),
            ("#{ speed: 2, fade: 0.5 }", "#{ speed: 3.0, fade: 1.0 }", "#{ speed: 3, fade: 1.0 }"),
            // One number becomes three.
            ("2", "1.0, 2.0, 0.5", "1, 2, 0.5"),
            ("2.0", "1.0, 2.0, 0.5", "1.0, 2.0, 0.5"),
            ("true", "2.0", "2.0"),
            ("\"1\", 2", "\"3.0\", 4.0", "\"3.0\", 4"),
            // The script would divide integers if the numbers had no points.
            ("2", "4.0 / 3.0", "4.0 / 3.0"),
            ("6 / 2", "9.0", "9.0"),
            ("6 / 2", "9.0 / 4.0", "9.0 / 4.0"),
            ("2", "-(4.0)", "-(4.0)"),
        ] {
            assert_eq!(in_number_style(old, new), wanted, "{new} over {old}");
        }
    }
}
