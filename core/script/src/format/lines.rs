//! Line breaks and indentation.

use super::format_tokens::{FormatToken, Role};

/// The beginning of a line: blank line before it, and indentation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct LineStart {
    /// Whether a blank line precedes it.
    pub has_blank_line: bool,
    /// Steps of indentation.
    pub depth: usize,
}

/// An open bracket with its content, or the text as a whole.
struct BracketFrame {
    /// Depth of a line that begins with the closing bracket.
    closing_depth: usize,
    /// Depth of lines that begin a statement or element.
    content_depth: usize,
    /// Depth of the line in which the current statement or element began; `None` between statements or elements.
    element_depth: Option<usize>,
    /// Depth of the line with a keyword, such as `if`, whose block follows.
    keyword_depth: Option<usize>,
    /// The content begins on a new line, so the closing bracket gets a line, too.
    is_multiline: bool,
    /// The brackets enclose statements, after which a statement may begin without `;`.
    is_block: bool,
}

/// The line that each token or comment begins, if any. Line breaks are the author's, except that a closing bracket gets a line
/// break if its opening bracket is followed by one.
pub(super) fn line_starts(tokens: &[FormatToken]) -> Vec<Option<LineStart>> {
    let whole_text = BracketFrame {
        closing_depth: 0,
        content_depth: 0,
        element_depth: None,
        keyword_depth: None,
        is_multiline: false,
        is_block: true,
    };
    let mut layout = Layout { tokens, frames: vec![whole_text], depth: 0 };
    (0..tokens.len()).map(|index| layout.next_line_start(index)).collect()
}

struct Layout<'p, 'a> {
    tokens: &'p [FormatToken<'a>],
    frames: Vec<BracketFrame>,
    /// Depth of the current line.
    depth: usize,
}

impl Layout<'_, '_> {
    /// The line that the next token or comment begins, if any. Updates the frames.
    fn next_line_start(&mut self, index: usize) -> Option<LineStart> {
        let token = &self.tokens[index];
        let closes_multiline = token.role == Role::Close && self.top().is_multiline;
        let begins_line = index == 0 || token.line_breaks > 0 || closes_multiline;
        let line = begins_line.then(|| {
            self.depth = self.depth_of(index);
            let before = index.checked_sub(1).map(|before| &self.tokens[before]);
            let is_first = before.is_none_or(|before| before.role == Role::Open);
            let has_blank_line = token.line_breaks > 1 && !is_first && token.role != Role::Close;
            LineStart { has_blank_line, depth: self.depth }
        });
        if !token.is_comment() {
            self.update_frames(index);
        }
        line
    }

    fn top(&mut self) -> &mut BracketFrame {
        // The frame of the text as a whole is never closed.
        let last = self.frames.len() - 1;
        &mut self.frames[last]
    }

    /// The first token at `index` or after it.
    fn token_from(&self, index: usize) -> Option<&FormatToken<'_>> {
        self.tokens[index.min(self.tokens.len())..].iter().find(|token| !token.is_comment())
    }

    /// The last token before `index`.
    fn token_before(&self, index: usize) -> Option<&FormatToken<'_>> {
        self.tokens[..index].iter().rev().find(|token| !token.is_comment())
    }

    /// Depth of a line that begins with the token or comment at `index`. A comment is as deep as the token after it; before a
    /// closing bracket it is as deep as the content of the brackets.
    fn depth_of(&self, index: usize) -> usize {
        let Some(frame) = self.frames.last() else { return 0 };
        let Some(token) = self.token_from(index) else { return frame.content_depth };
        let is_comment = self.tokens[index].is_comment();
        match frame.element_depth {
            _ if token.role == Role::Close && is_comment => frame.content_depth,
            _ if token.role == Role::Close => frame.closing_depth,
            None => frame.content_depth,
            Some(element) => {
                let before = self.token_before(index);
                let opens_block = token.text == "{" && before.is_some_and(|b| b.role != Role::Separator);
                if opens_block || continues_block(token) && before.is_some_and(|b| b.text == "}") {
                    frame.keyword_depth.unwrap_or(element)
                } else {
                    element + 1
                }
            }
        }
    }

    /// Updates the frames with a token: opens or closes a bracket, begins or ends a statement.
    fn update_frames(&mut self, index: usize) {
        let (token, depth) = (&self.tokens[index], self.depth);
        match token.role {
            Role::Close => {
                if self.frames.len() > 1 {
                    let closed = self.frames.pop();
                    let continues_statement = self.token_from(index + 1).is_some_and(continues_statement);
                    if closed.is_some_and(|closed| closed.is_block) && !continues_statement {
                        self.top().element_depth = None;
                    }
                }
                return;
            }
            Role::Separator => {
                let top = self.top();
                (top.element_depth, top.keyword_depth) = (None, None);
                return;
            }
            _ => {}
        }
        let top = self.top();
        top.element_depth.get_or_insert(depth);
        if token.role == Role::Keyword && is_block_keyword(token.text) {
            top.keyword_depth = Some(depth);
        }
        if token.role == Role::Open {
            let is_closure = self
                .token_before(index)
                .is_some_and(|before| matches!(before.role, Role::ClosureEnd | Role::ClosureEmpty));
            let is_block = token.text == "{" && !is_closure;
            let is_multiline = self.is_multiline(index);
            let keyword_depth = if is_block { self.top().keyword_depth.take() } else { None };
            let closing_depth = keyword_depth.unwrap_or(depth);
            self.frames.push(BracketFrame {
                closing_depth,
                content_depth: closing_depth + 1,
                element_depth: None,
                keyword_depth: None,
                is_multiline,
                is_block,
            });
        }
    }

    /// Whether the content of a bracket begins on a new line.
    fn is_multiline(&self, open: usize) -> bool {
        let inside = &self.tokens[open + 1..];
        let first = inside.iter().position(|token| !token.is_comment()).unwrap_or(inside.len());
        let has_break = inside.iter().take(first + 1).any(|token| token.line_breaks > 0);
        has_break && inside.get(first).is_some_and(|token| token.role != Role::Close)
    }
}

/// Whether a block follows a keyword.
fn is_block_keyword(word: &str) -> bool {
    matches!(
        word,
        "if" | "else" | "for" | "while" | "until" | "loop" | "do" | "fn" | "switch" | "try" | "catch"
    )
}

/// Whether a token continues the statement of the block before it, as `else` does.
fn continues_block(token: &FormatToken) -> bool {
    token.role == Role::Keyword && matches!(token.text, "else" | "catch" | "while" | "until")
}

/// Whether a token after a closed block continues the same statement.
fn continues_statement(token: &FormatToken) -> bool {
    matches!(token.role, Role::Dot | Role::Binary | Role::Separator | Role::Close)
        || token.role == Role::Keyword && matches!(token.text, "else" | "catch")
}
