//! Aligns comments after code in a common column and indents comments of several lines.

use super::format_tokens::{FormatToken, Role};
use super::lines::LineStart;
use super::{Gap, INDENTATION};
use std::collections::BTreeMap;

/// A comment at the end of a line.
struct TrailingComment {
    /// Index of the comment among the tokens and comments.
    index: usize,
    /// Number of blanks before it, as written.
    blanks: usize,
    /// Column in which the formatted code before it ends.
    code_end: usize,
}

fn width(text: &str) -> usize {
    text.chars().count()
}

/// The last line of a text.
fn last_line(text: &str) -> &str {
    text.rsplit('\n').next().unwrap_or(text)
}

/// Keeps comments after code in one column if they are written in one column without a blank line between them.
pub(super) fn align_trailing_comments(text: &str, tokens: &[FormatToken], gaps: &mut [Gap]) {
    // Comments by paragraph and column as written.
    let mut groups: BTreeMap<(usize, usize), Vec<TrailingComment>> = BTreeMap::new();
    let (mut paragraph, mut column) = (0, 0);
    for (index, token) in tokens.iter().enumerate() {
        match gaps[index] {
            Gap::Line(LineStart { has_blank_line, depth }) => {
                paragraph += usize::from(has_blank_line);
                column = depth * INDENTATION;
            }
            Gap::Blanks(_) if token.role == Role::LineComment => {
                let written = width(last_line(&text[..token.range.start]));
                let before = index.checked_sub(1).map_or(0, |before| tokens[before].range.end);
                let blanks = width(&text[before..token.range.start]);
                let comment = TrailingComment { index, blanks, code_end: column };
                groups.entry((paragraph, written)).or_default().push(comment);
            }
            Gap::Blanks(count) => column += count,
        }
        let is_long = token.text.contains('\n');
        column = if is_long { width(last_line(token.text)) } else { column + width(token.text) };
    }
    for group in groups.values().filter(|group| group.len() > 1) {
        let blanks = group.iter().map(|comment| comment.blanks).min().unwrap_or(1).max(1);
        let longest = group.iter().map(|comment| comment.code_end).max().unwrap_or(0);
        for comment in group {
            gaps[comment.index] = Gap::Blanks(longest + blanks - comment.code_end);
        }
    }
}

/// A comment of several lines, moved so that its first line begins in `column`. The other lines move by the same number of
/// columns.
pub(super) fn moved_comment(text: &str, comment: &FormatToken, column: usize, line_break: &str) -> String {
    let before = last_line(&text[..comment.range.start]);
    let old_column = if before.trim().is_empty() { width(before) } else { column };
    let mut lines = comment.text.lines();
    let mut moved = lines.next().unwrap_or_default().trim_end().to_string();
    for line in lines {
        let blanks = line.len() - line.trim_start_matches(' ').len();
        let blanks = (blanks + column).saturating_sub(old_column);
        let line = line.trim_start_matches(' ').trim_end();
        moved.push_str(line_break);
        if !line.is_empty() {
            moved.push_str(&" ".repeat(blanks));
            moved.push_str(line);
        }
    }
    moved
}
