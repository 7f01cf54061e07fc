//! Whether a blank belongs between two tokens or comments on one line.

use super::format_tokens::{FormatToken, Role};

/// Whether a blank belongs between two neighbors on one line. `has_blank`: whether the text has one now, which decides where
/// both are allowed.
pub(super) fn needs_blank(before: &FormatToken, next: &FormatToken, has_blank: bool) -> bool {
    has_blank_by_style(before, next, has_blank) || would_merge(before.text, next.text)
}

/// Whether the style puts a blank between two neighbors.
fn has_blank_by_style(before: &FormatToken, next: &FormatToken, has_blank: bool) -> bool {
    use Role::{
        BlockComment, CallMark, Close, ClosureEnd, ClosureStart, Colon, Dot, LineComment, Open, Operand,
        Other, Prefix, RangeOperator, Separator,
    };
    let is_block = |token: &FormatToken| matches!(token.text, "{" | "#{" | "}");
    match (before.role, next.role) {
        (_, LineComment) => true,
        (BlockComment, Separator) => false,
        (Separator, BlockComment) => true,
        (BlockComment, _) | (_, BlockComment) | (Other, _) | (_, Other) => has_blank,
        (_, Separator | Colon) => false,
        (Open, Close) => false,
        (_, Close) => is_block(next),
        (Open, _) => is_block(before),
        (Dot | RangeOperator | Prefix | CallMark | ClosureStart, _) => false,
        (_, Dot | RangeOperator | CallMark | ClosureEnd) => false,
        (Operand, Open) => is_block(next),
        (Close, Open) if !is_block(next) => before.text == "}" && has_blank,
        _ => true,
    }
}

/// Whether two tokens without a blank between them would be read as different tokens: `- -1`, `| |`, `1. ..`.
fn would_merge(before: &str, next: &str) -> bool {
    let has_on_both_sides = |c| before.ends_with(c) && next.starts_with(c);
    let is_number = before.starts_with(|c: char| c.is_ascii_digit() || c == '-');
    has_on_both_sides('-')
        || has_on_both_sides('+')
        || has_on_both_sides('|')
        || (is_number && has_on_both_sides('.'))
}
