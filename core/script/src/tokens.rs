//! Positions of the tokens of a script's text, for edits of the text.

use rhai::{Engine, LexError, Position, Token};
use std::ops::Range;

/// Byte ranges of all tokens, in order; comments and blanks are none. A string with interpolations is one token, and so is the
/// rest of a text whose last string is not closed.
pub fn token_ranges(text: &str) -> Vec<Range<usize>> {
    let engine = Engine::new_raw();
    let texts = [text];
    let (mut tokens, control) = engine.lex(&texts);
    let mut cursor = Cursor { text, line: 1, column: 0, byte: 0 };
    let mut ranges: Vec<Range<usize>> = Vec::new();
    // Interpolated strings that are open: the first byte, and the braces open inside.
    let mut strings: Vec<(usize, usize)> = Vec::new();
    let mut is_text = false;
    while let Some((token, at)) = tokens.next() {
        let before = Position::new(at.line().unwrap_or(1) as u16, at.position().unwrap_or(1) as u16 - 1);
        let start = cursor.advance_to(before);
        let end = cursor.advance_to(tokens.pos);
        let resumed = std::mem::take(&mut is_text);
        match &token {
            Token::EOF => break,
            Token::LexError(error) if matches!(**error, LexError::UnterminatedString) => {
                strings.push((start, 0));
                break;
            }
            Token::InterpolatedString(_) if !resumed => strings.push((start, 0)),
            Token::InterpolatedString(_) => {}
            Token::StringConstant(_) if resumed => {
                if let (Some((start, _)), true) = (strings.pop(), strings.is_empty()) {
                    ranges.push(start..end);
                }
            }
            Token::Unit if strings.is_empty() => ranges.extend([start..start + 1, end - 1..end]),
            _ => match strings.last_mut() {
                None => ranges.push(start..end),
                Some((_, depth)) => {
                    *depth += usize::from(matches!(token, Token::LeftBrace | Token::MapStart));
                    *depth -= usize::from(token == Token::RightBrace && *depth > 0);
                    is_text = token == Token::RightBrace && *depth == 0;
                    control.borrow_mut().is_within_text = is_text;
                }
            },
        }
    }
    ranges.extend(strings.first().map(|(start, _)| *start..text.len()));
    ranges
}

/// Follows Rhai's positions, whose columns count characters, through a text.
struct Cursor<'a> {
    text: &'a str,
    line: usize,
    /// Characters of the line that lie behind.
    column: usize,
    byte: usize,
}

impl Cursor<'_> {
    /// The byte at a position that does not lie behind.
    fn advance_to(&mut self, at: Position) -> usize {
        let wanted = (at.line().unwrap_or(1), at.position().unwrap_or(0));
        for c in self.text[self.byte..].chars() {
            if (self.line, self.column) >= wanted {
                break;
            }
            self.byte += c.len_utf8();
            (self.line, self.column) =
                if c == '\n' { (self.line + 1, 0) } else { (self.line, self.column + 1) };
        }
        self.byte
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tokens(text: &str) -> Vec<&str> {
        token_ranges(text).into_iter().map(|range| &text[range]).collect()
    }

    #[test]
    fn tokens_are_found_where_they_stand() {
        let text = "let é = f(); // no\n/* /* b */ */ x.y(-1.5, \"a\\\"(\", 'c', #{ t: 2 })";
        let expected = [
            "let",
            "é",
            "=",
            "f",
            "(",
            ")",
            ";",
            "x",
            ".",
            "y",
            "(",
            "-1.5",
            ",",
            "\"a\\\"(\"",
            ",",
            "'c'",
            ",",
            "#{",
            "t",
            ":",
            "2",
            "}",
            ")",
        ];
        assert_eq!(tokens(text), expected);
        assert_eq!(tokens("1.f(1..2)"), ["1", ".", "f", "(", "1", "..", "2", ")"]);
    }

    #[test]
    fn an_interpolated_string_is_one_token() {
        assert_eq!(
            tokens("a(`x ${b(#{ c: `${d}` })} y ${e} `, 1)"),
            ["a", "(", "`x ${b(#{ c: `${d}` })} y ${e} `", ",", "1", ")"]
        );
        assert_eq!(tokens("a(\"x\n b"), ["a", "(", "\"x\n b"]);
        assert_eq!(tokens("a(`x ${b"), ["a", "(", "`x ${b"]);
    }
}
