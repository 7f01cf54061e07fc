//! Tokenizer of WGSL texts, and places in them. Comments are skipped.

/// The characters that end a line comment: all line breaks of WGSL, so that no code hides behind one.
const LINE_ENDS: [char; 7] = ['\n', '\u{b}', '\u{c}', '\r', '\u{85}', '\u{2028}', '\u{2029}'];

/// Iterator of tokens, each with the byte at which it begins.
pub(crate) struct Tokens<'a> {
    text: &'a str,
    /// Byte of the next token.
    at: usize,
}

impl<'a> Tokens<'a> {
    pub(crate) fn of(text: &'a str) -> Tokens<'a> {
        Tokens { text, at: 0 }
    }
}

impl<'a> Iterator for Tokens<'a> {
    type Item = (usize, &'a str);

    fn next(&mut self) -> Option<(usize, &'a str)> {
        const DOUBLE: [&str; 9] = ["==", "!=", "<=", ">=", "&&", "||", "->", "++", "--"];
        loop {
            let rest = &self.text[self.at..];
            let first = rest.chars().next()?;
            let start = self.at;
            if rest.starts_with("//") {
                self.at += rest.find(LINE_ENDS).unwrap_or(rest.len());
            } else if rest.starts_with("/*") {
                self.at += end_of_comment(rest);
            } else if first.is_alphanumeric() || first == '_' {
                let word =
                    |text: &str| text.find(|c: char| !c.is_alphanumeric() && c != '_').unwrap_or(text.len());
                let mut length = word(rest);
                // A number has a point before a digit (1.5), unlike a member access (1.x).
                if first.is_ascii_digit() && rest[length..].starts_with('.') {
                    let behind = &rest[length + 1..];
                    length +=
                        if behind.starts_with(|c: char| c.is_ascii_digit()) { 1 + word(behind) } else { 0 };
                }
                self.at += length;
                return Some((start, &self.text[start..self.at]));
            } else {
                let length = DOUBLE.iter().find(|d| rest.starts_with(**d)).map_or(first.len_utf8(), |_| 2);
                self.at += length;
                if !first.is_whitespace() {
                    return Some((start, &self.text[start..self.at]));
                }
            }
        }
    }
}

/// Line and column of a byte, both from 1; columns are counted in characters.
pub(crate) fn line_and_column(text: &str, byte: usize) -> (usize, usize) {
    let before = &text[..byte];
    let line_start = before.rfind('\n').map_or(0, |n| n + 1);
    (before.matches('\n').count() + 1, before[line_start..].chars().count() + 1)
}

/// Length in bytes of a block comment, which can contain further block comments.
fn end_of_comment(text: &str) -> usize {
    let (mut depth, mut at) = (0usize, 0);
    while let Some(next) = text[at..].find(['/', '*']) {
        at += next;
        if text[at..].starts_with("/*") {
            depth += 1;
            at += 2;
        } else if text[at..].starts_with("*/") {
            depth -= 1;
            at += 2;
        } else {
            at += 1;
        }
        if depth == 0 {
            return at;
        }
    }
    text.len()
}
