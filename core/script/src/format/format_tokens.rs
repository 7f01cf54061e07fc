//! Tokens and comments of a text in order, each with its role, which decides about the blanks around it.

use super::FormatError;
use crate::tokens::{TokenKind, comments, tokens};
use std::ops::Range;

/// Role of a token or comment, which decides about the blanks around it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Role {
    /// A name, number or text.
    Operand,
    Keyword,
    Open,
    Close,
    /// `,` and `;`.
    Separator,
    /// The colon after a key.
    Colon,
    /// `.`, `?.` and `::`.
    Dot,
    /// `..` and `..=`.
    RangeOperator,
    Prefix,
    /// The `!` of `f!(x)`.
    CallMark,
    Binary,
    /// `|` before and after the parameters of a closure, and `||` if it has none.
    ClosureStart,
    ClosureEnd,
    ClosureEmpty,
    LineComment,
    BlockComment,
    /// A symbol without a meaning in the language.
    Other,
}

/// A token or comment of a text.
#[derive(Clone, Debug)]
pub(super) struct FormatToken<'a> {
    pub text: &'a str,
    pub range: Range<usize>,
    pub role: Role,
    /// Number of line breaks between the previous token or comment and this one.
    pub line_breaks: usize,
}

impl FormatToken<'_> {
    pub(super) fn is_comment(&self) -> bool {
        matches!(self.role, Role::LineComment | Role::BlockComment)
    }

    /// Whether an expression may end here, so that an operator that follows has two operands.
    fn ends_operand(&self) -> bool {
        matches!(self.role, Role::Operand | Role::Close)
    }
}

/// Words that are followed by a blank even before a bracket.
const KEYWORDS: [&str; 24] = [
    "let", "const", "fn", "if", "else", "for", "in", "while", "loop", "do", "until", "return", "break",
    "continue", "switch", "import", "export", "as", "private", "throw", "try", "catch", "case", "default",
];

/// The tokens and comments of a text.
///
/// # Errors
/// Returns an error if a part of the text is not a token, or if a string or comment is never closed.
pub(super) fn format_tokens(text: &str) -> Result<Vec<FormatToken<'_>>, FormatError> {
    let mut found: Vec<FormatToken> = Vec::new();
    let mut last_end = 0;
    let mut in_parameters = false;
    for token in tokens(text) {
        let range = token.range.clone();
        let is_unclosed = token.kind == TokenKind::Text && !is_closed(&text[range.clone()]);
        if token.kind == TokenKind::Error || is_unclosed {
            return Err(FormatError::at_word(text, range.start, "is not valid in a script"));
        }
        push_comments(text, last_end..range.start, &mut found)?;
        last_end = range.end;
        let before = found.iter().rev().find(|token| !token.is_comment());
        let role = role(token.kind, &text[range.clone()], before, &mut in_parameters);
        push_token(text, range, role, &mut found);
    }
    push_comments(text, last_end..text.len(), &mut found)?;
    Ok(found)
}

/// Whether a string ends with the quote that it begins with.
fn is_closed(string: &str) -> bool {
    let quote = string.trim_start_matches('#').chars().next();
    let end = string.trim_end_matches('#');
    string.len() > 1 && quote.is_some_and(|quote| end.ends_with(quote))
}

/// Appends a token or comment with the number of line breaks before it.
fn push_token<'a>(text: &'a str, range: Range<usize>, role: Role, found: &mut Vec<FormatToken<'a>>) {
    let last_end = found.last().map_or(0, |last| last.range.end);
    let line_breaks = text[last_end..range.start].matches('\n').count();
    found.push(FormatToken { text: &text[range.clone()], range, role, line_breaks });
}

/// Appends the comments between two tokens.
fn push_comments<'a>(
    text: &'a str,
    gap: Range<usize>,
    found: &mut Vec<FormatToken<'a>>,
) -> Result<(), FormatError> {
    for comment in comments(text, gap) {
        let start = comment.range.start;
        if !text[start..].starts_with("/*") && !text[start..].starts_with("//") {
            return Err(FormatError::at_word(text, start, "is not valid in a script"));
        }
        if !comment.is_closed {
            return Err(FormatError::at_word(text, start, "begins a comment that is never closed"));
        }
        let role = if comment.is_block { Role::BlockComment } else { Role::LineComment };
        push_token(text, comment.range, role, found);
    }
    Ok(())
}

/// Role of a token. `before`: the token before it; `in_parameters`: whether it is among the parameters of a closure.
fn role(kind: TokenKind, text: &str, before: Option<&FormatToken>, in_parameters: &mut bool) -> Role {
    let is_after_operand = before.is_some_and(FormatToken::ends_operand);
    let is_member = before.is_some_and(|before| before.role == Role::Dot);
    match kind {
        TokenKind::Word if KEYWORDS.contains(&text) && !is_member => Role::Keyword,
        TokenKind::Word | TokenKind::Number | TokenKind::Text => Role::Operand,
        TokenKind::Prefix if text == "!" && is_after_operand => Role::CallMark,
        TokenKind::Prefix => Role::Prefix,
        TokenKind::Error => Role::Other,
        TokenKind::Symbol => match text {
            "(" | "[" | "?[" | "{" | "#{" => Role::Open,
            ")" | "]" | "}" => Role::Close,
            "," | ";" => Role::Separator,
            ":" => Role::Colon,
            "." | "?." | "::" => Role::Dot,
            ".." | "..=" => Role::RangeOperator,
            "|" if *in_parameters => {
                *in_parameters = false;
                Role::ClosureEnd
            }
            "|" if !is_after_operand => {
                *in_parameters = true;
                Role::ClosureStart
            }
            "||" if !is_after_operand => Role::ClosureEmpty,
            "@" | "#" | "$" | "~" | "\\" => Role::Other,
            _ => Role::Binary,
        },
    }
}
