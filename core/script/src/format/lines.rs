//! Line breaks and indentation.

use super::pieces::{Piece, Role};

/// The beginning of a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Line {
    /// Whether a blank line stands before it.
    pub apart: bool,
    /// Steps of indentation.
    pub depth: usize,
}

/// An open bracket, or the text as a whole.
struct Frame {
    /// Depth of a line that begins with the closing bracket.
    outer: usize,
    /// Depth of lines that begin a statement or element.
    inner: usize,
    /// Depth of the line in which the current statement or element began; `None` between two of them.
    element: Option<usize>,
    /// Depth of the line with the keyword whose block follows.
    control: Option<usize>,
    /// The closing bracket has a line of its own, because what the bracket contains begins on a new line.
    spread: bool,
    /// A block of statements, after which a statement may begin without `;`.
    is_block: bool,
}

/// The line that each piece begins, if any. Line breaks are the author's, except that a closing bracket gets one if its opening
/// bracket is followed by one.
pub fn lines(pieces: &[Piece]) -> Vec<Option<Line>> {
    let base = Frame { outer: 0, inner: 0, element: None, control: None, spread: false, is_block: true };
    let mut layout = Layout { pieces, frames: vec![base], depth: 0 };
    (0..pieces.len()).map(|index| layout.step(index)).collect()
}

struct Layout<'p, 'a> {
    pieces: &'p [Piece<'a>],
    frames: Vec<Frame>,
    /// Depth of the current line.
    depth: usize,
}

impl Layout<'_, '_> {
    fn step(&mut self, index: usize) -> Option<Line> {
        let piece = &self.pieces[index];
        let closes_spread = piece.role == Role::Close && self.top().spread;
        let begins = index == 0 || piece.breaks > 0 || closes_spread;
        let line = begins.then(|| {
            self.depth = self.depth_of(index);
            let before = index.checked_sub(1).map(|before| &self.pieces[before]);
            let opens = before.is_none_or(|before| before.role == Role::Open);
            Line { apart: piece.breaks > 1 && !opens && piece.role != Role::Close, depth: self.depth }
        });
        if !piece.is_comment() {
            self.follow(index);
        }
        line
    }

    fn top(&mut self) -> &mut Frame {
        // The frame of the text as a whole is never closed.
        let last = self.frames.len() - 1;
        &mut self.frames[last]
    }

    /// The piece at `index` or the first one after it that is not a comment.
    fn token(&self, index: usize) -> Option<&Piece<'_>> {
        self.pieces[index.min(self.pieces.len())..].iter().find(|piece| !piece.is_comment())
    }

    fn before(&self, index: usize) -> Option<&Piece<'_>> {
        self.pieces[..index].iter().rev().find(|piece| !piece.is_comment())
    }

    /// Depth of a line that begins with a piece. A comment is as deep as the token after it; before a closing bracket it is as
    /// deep as the content of the brackets.
    fn depth_of(&self, index: usize) -> usize {
        let Some(frame) = self.frames.last() else { return 0 };
        let Some(token) = self.token(index) else { return frame.inner };
        let is_comment = self.pieces[index].is_comment();
        match frame.element {
            _ if token.role == Role::Close && is_comment => frame.inner,
            _ if token.role == Role::Close => frame.outer,
            None => frame.inner,
            Some(element) => {
                let heads_block =
                    token.text == "{" && self.before(index).is_some_and(|b| b.role != Role::Separator);
                if heads_block || continues_block(token) && self.before(index).is_some_and(|b| b.text == "}")
                {
                    frame.control.unwrap_or(element)
                } else {
                    element + 1
                }
            }
        }
    }

    /// Updates the open frames with a token.
    fn follow(&mut self, index: usize) {
        let (piece, depth) = (&self.pieces[index], self.depth);
        match piece.role {
            Role::Close => {
                if self.frames.len() > 1 {
                    let closed = self.frames.pop();
                    let continues_statement = self.token(index + 1).is_some_and(continues_statement);
                    if closed.is_some_and(|closed| closed.is_block) && !continues_statement {
                        self.top().element = None;
                    }
                }
                return;
            }
            Role::Separator => {
                let top = self.top();
                (top.element, top.control) = (None, None);
                return;
            }
            _ => {}
        }
        let top = self.top();
        top.element.get_or_insert(depth);
        if piece.role == Role::Keyword && heads(piece.text) {
            top.control = Some(depth);
        }
        if piece.role == Role::Open {
            let is_closure = self
                .before(index)
                .is_some_and(|before| matches!(before.role, Role::ClosureEnd | Role::ClosureEmpty));
            let is_block = piece.text == "{" && !is_closure;
            let spread = self.spread(index);
            let control = if is_block { self.top().control.take() } else { None };
            let outer = control.unwrap_or(depth);
            self.frames.push(Frame {
                outer,
                inner: outer + 1,
                element: None,
                control: None,
                spread,
                is_block,
            });
        }
    }

    /// Whether the content of a bracket begins on a new line.
    fn spread(&self, open: usize) -> bool {
        let inside = &self.pieces[open + 1..];
        let first = inside.iter().position(|piece| !piece.is_comment()).unwrap_or(inside.len());
        let broken = inside.iter().take(first + 1).any(|piece| piece.breaks > 0);
        broken && inside.get(first).is_some_and(|token| token.role != Role::Close)
    }
}

/// Whether a keyword is followed by a block.
fn heads(word: &str) -> bool {
    matches!(
        word,
        "if" | "else" | "for" | "while" | "until" | "loop" | "do" | "fn" | "switch" | "try" | "catch"
    )
}

/// Whether a token continues the statement of the block before it, as `else` does.
fn continues_block(token: &Piece) -> bool {
    token.role == Role::Keyword && matches!(token.text, "else" | "catch" | "while" | "until")
}

/// Whether a token after a closed block continues the same statement.
fn continues_statement(token: &Piece) -> bool {
    matches!(token.role, Role::Dot | Role::Binary | Role::Separator | Role::Close)
        || token.role == Role::Keyword && matches!(token.text, "else" | "catch")
}
