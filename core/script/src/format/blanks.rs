//! Whether a blank belongs between two pieces on one line.

use super::pieces::{Piece, Role};

/// Whether a blank belongs between two neighbors on one line. `has_blank`: whether the text has one now, which decides where
/// both are allowed.
pub fn blank(before: &Piece, next: &Piece, has_blank: bool) -> bool {
    style_wants_blank(before, next, has_blank) || would_join(before.text, next.text)
}

fn style_wants_blank(before: &Piece, next: &Piece, has_blank: bool) -> bool {
    use Role::{
        BlockComment, CallMark, Close, ClosureEnd, ClosureStart, Colon, Dot, LineComment, Open, Operand,
        Other, Prefix, RangeOperator, Separator,
    };
    let is_block = |piece: &Piece| matches!(piece.text, "{" | "#{" | "}");
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
fn would_join(before: &str, next: &str) -> bool {
    let ends = |c| before.ends_with(c) && next.starts_with(c);
    let is_number = before.starts_with(|c: char| c.is_ascii_digit() || c == '-');
    ends('-') || ends('+') || ends('|') || (is_number && ends('.'))
}
