//! Tokens and comments of a text in order, with the role of each, which decides about blanks around it.

use super::FormatError;
use crate::tokens::{TokenKind, comments, tokens};
use std::ops::Range;

/// Role of a piece, which decides about the blanks around it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// A name, number or text.
    Operand,
    Keyword,
    Open,
    Close,
    /// `,` and `;`.
    Separator,
    /// The colon behind a key.
    Colon,
    /// `.`, `?.` and `::`.
    Dot,
    /// `..` and `..=`.
    RangeOperator,
    Prefix,
    /// The `!` of `f!(x)`.
    CallMark,
    Binary,
    /// `|` before and behind the parameters of a closure, and `||` where there are none.
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
pub struct Piece<'a> {
    pub text: &'a str,
    pub range: Range<usize>,
    pub role: Role,
    /// Line breaks between the piece before and this one.
    pub breaks: usize,
}

impl Piece<'_> {
    pub fn is_comment(&self) -> bool {
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

/// The tokens and comments of a text. Error: a part of the text is not a token.
pub fn pieces(text: &str) -> Result<Vec<Piece<'_>>, FormatError> {
    let mut found: Vec<Piece> = Vec::new();
    let mut behind = 0;
    let mut in_parameters = false;
    for token in tokens(text) {
        let range = token.range.clone();
        let is_open = token.kind == TokenKind::Text && !is_closed(&text[range.clone()]);
        if token.kind == TokenKind::Error || is_open {
            return Err(FormatError::at(text, range.start, "is not valid in a script"));
        }
        push_comments(text, behind..range.start, &mut found)?;
        behind = range.end;
        let before = found.iter().rev().find(|piece| !piece.is_comment());
        let role = role(token.kind, &text[range.clone()], before, &mut in_parameters);
        push(text, range, role, &mut found);
    }
    push_comments(text, behind..text.len(), &mut found)?;
    Ok(found)
}

/// Whether a string ends with the quote that it begins with.
fn is_closed(string: &str) -> bool {
    let quote = string.trim_start_matches('#').chars().next();
    let end = string.trim_end_matches('#');
    string.len() > 1 && quote.is_some_and(|quote| end.ends_with(quote))
}

fn push<'a>(text: &'a str, range: Range<usize>, role: Role, found: &mut Vec<Piece<'a>>) {
    let behind = found.last().map_or(0, |last| last.range.end);
    let breaks = text[behind..range.start].matches('\n').count();
    found.push(Piece { text: &text[range.clone()], range, role, breaks });
}

/// The comments between two tokens.
fn push_comments<'a>(
    text: &'a str,
    gap: Range<usize>,
    found: &mut Vec<Piece<'a>>,
) -> Result<(), FormatError> {
    for comment in comments(text, gap) {
        let start = comment.range.start;
        if !text[start..].starts_with("/*") && !text[start..].starts_with("//") {
            return Err(FormatError::at(text, start, "is not valid in a script"));
        }
        if !comment.is_closed {
            return Err(FormatError::at(text, start, "begins a comment that is never closed"));
        }
        let role = if comment.is_block { Role::BlockComment } else { Role::LineComment };
        push(text, comment.range, role, found);
    }
    Ok(())
}

fn role(kind: TokenKind, text: &str, before: Option<&Piece>, in_parameters: &mut bool) -> Role {
    let behind_operand = before.is_some_and(Piece::ends_operand);
    let is_member = before.is_some_and(|before| before.role == Role::Dot);
    match kind {
        TokenKind::Word if KEYWORDS.contains(&text) && !is_member => Role::Keyword,
        TokenKind::Word | TokenKind::Number | TokenKind::Text => Role::Operand,
        TokenKind::Prefix if text == "!" && behind_operand => Role::CallMark,
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
            "|" if !behind_operand => {
                *in_parameters = true;
                Role::ClosureStart
            }
            "||" if !behind_operand => Role::ClosureEmpty,
            "@" | "#" | "$" | "~" | "\\" => Role::Other,
            _ => Role::Binary,
        },
    }
}
