//! Aligns comments after code in a common column and indents comments of several lines.

use super::lines::Line;
use super::pieces::{Piece, Role};
use super::{Gap, STEP};
use std::collections::BTreeMap;

/// A comment at the end of a line.
struct Trailing {
    index: usize,
    /// Blanks before it, as written.
    blanks: usize,
    /// Column in which the code before it ends, once formatted.
    end: usize,
}

fn width(text: &str) -> usize {
    text.chars().count()
}

/// The last line of a text.
fn last_line(text: &str) -> &str {
    text.rsplit('\n').next().unwrap_or(text)
}

/// Keeps comments after code in one column if they are written in one column without a blank line between them.
pub fn align(text: &str, pieces: &[Piece], gaps: &mut [Gap]) {
    let mut groups: BTreeMap<(usize, usize), Vec<Trailing>> = BTreeMap::new();
    let (mut paragraph, mut column) = (0, 0);
    for (index, piece) in pieces.iter().enumerate() {
        match gaps[index] {
            Gap::Line(Line { apart, depth }) => {
                paragraph += usize::from(apart);
                column = depth * STEP;
            }
            Gap::Blanks(_) if piece.role == Role::LineComment => {
                let written = width(last_line(&text[..piece.range.start]));
                let before = index.checked_sub(1).map_or(0, |before| pieces[before].range.end);
                let blanks = width(&text[before..piece.range.start]);
                groups.entry((paragraph, written)).or_default().push(Trailing { index, blanks, end: column });
            }
            Gap::Blanks(count) => column += count,
        }
        let is_long = piece.text.contains('\n');
        column = if is_long { width(last_line(piece.text)) } else { column + width(piece.text) };
    }
    for group in groups.values().filter(|group| group.len() > 1) {
        let blanks = group.iter().map(|comment| comment.blanks).min().unwrap_or(1).max(1);
        let end = group.iter().map(|comment| comment.end).max().unwrap_or(0);
        for comment in group {
            gaps[comment.index] = Gap::Blanks(end + blanks - comment.end);
        }
    }
}

/// A comment of several lines, moved so that its first line stands in `column`. The other lines move equally far.
pub fn align_comment(text: &str, comment: &Piece, column: usize, line_break: &str) -> String {
    let before = last_line(&text[..comment.range.start]);
    let old = if before.trim().is_empty() { width(before) } else { column };
    let mut lines = comment.text.lines();
    let mut moved = lines.next().unwrap_or_default().trim_end().to_string();
    for line in lines {
        let blanks = line.len() - line.trim_start_matches(' ').len();
        let blanks = (blanks + column).saturating_sub(old);
        let line = line.trim_start_matches(' ').trim_end();
        moved.push_str(line_break);
        if !line.is_empty() {
            moved.push_str(&" ".repeat(blanks));
            moved.push_str(line);
        }
    }
    moved
}
