//! Interpolated strings: the code inside `${…}` is formatted like other code, the text stays the same.

use super::formatted;
use crate::tokens::tokens_and_interpolations;

/// A string with its interpolated code formatted. Code of several lines stays the same.
pub(crate) fn formatted_string(string: &str) -> String {
    let (mut new, mut copied) = (String::with_capacity(string.len()), 0);
    for code in tokens_and_interpolations(string).1 {
        let inside = code.range.start + 1..code.range.end - 1;
        new.push_str(&string[copied..inside.start]);
        new.push_str(
            &formatted_line(&string[inside.clone()]).unwrap_or_else(|| string[inside.clone()].to_string()),
        );
        copied = inside.end;
    }
    new + &string[copied..]
}

/// Formatted code; `None` if it has several lines or cannot be formatted.
fn formatted_line(code: &str) -> Option<String> {
    let new = formatted(code).ok().filter(|_| !code.contains('\n'))?;
    let line = new.trim_end();
    (!line.contains('\n')).then(|| line.to_string())
}

/// Whether two strings have the same text and the same tokens in their interpolated code.
pub(crate) fn is_same_string(old: &str, new: &str) -> bool {
    let parts = |string: &str| {
        let (mut letters, mut tokens, mut copied) = (Vec::new(), Vec::new(), 0);
        for code in tokens_and_interpolations(string).1 {
            letters.push(string[copied..code.range.start].to_string());
            tokens.extend(code.tokens.into_iter().map(|token| string[token].to_string()));
            copied = code.range.end;
        }
        letters.push(string[copied..].to_string());
        (letters, tokens)
    };
    let visible = |string: &str| string.chars().filter(|c| !c.is_whitespace()).collect::<String>();
    old == new || (parts(old) == parts(new) && visible(old) == visible(new))
}
