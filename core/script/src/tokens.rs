//! Tokens of a script's text with their positions, for edits of the text.

use rhai::{Engine, LexError, Position, Token};
use std::ops::Range;

/// A token of a script. Comments and blanks are not tokens.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct ScriptToken {
    pub range: Range<usize>,
    pub kind: TokenKind,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum TokenKind {
    /// A name or keyword.
    Word,
    Number,
    /// A string or character. A string with interpolations is one token, and so is an unclosed string up to the end of the text.
    Text,
    /// A unary operator before its operand: `-x`, `!x`.
    Prefix,
    /// Another operator, a bracket or a separator.
    Symbol,
    /// Text that is not a token of the language.
    Error,
}

impl TokenKind {
    fn of(token: &Token, text: &str) -> TokenKind {
        match token {
            Token::LexError(_) => TokenKind::Error,
            Token::IntegerConstant(_) | Token::FloatConstant(_) => TokenKind::Number,
            Token::StringConstant(_) | Token::InterpolatedString(_) | Token::CharConstant(_) => {
                TokenKind::Text
            }
            Token::UnaryMinus | Token::UnaryPlus | Token::Bang => TokenKind::Prefix,
            _ if text.starts_with(|c: char| c.is_alphabetic() || c == '_') => TokenKind::Word,
            _ => TokenKind::Symbol,
        }
    }
}

/// Code inside an interpolated string: `${…}`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct InterpolatedCode {
    /// Byte range of the code with its braces.
    pub range: Range<usize>,
    /// Byte ranges of the tokens of the code, braces included. The text of strings inside the code is not included.
    pub tokens: Vec<Range<usize>>,
}

/// The tokens of a text, and the code inside its interpolated strings, in order.
#[derive(Clone, Debug, Default)]
pub(crate) struct Tokens {
    pub all: Vec<ScriptToken>,
    pub inner: Vec<InterpolatedCode>,
}

/// Byte ranges of all tokens, in order.
pub fn token_ranges(text: &str) -> Vec<Range<usize>> {
    tokens(text).into_iter().map(|token| token.range).collect()
}

/// Byte ranges of all tokens, and the code inside interpolated strings, in order.
pub fn tokens_and_interpolations(text: &str) -> (Vec<Range<usize>>, Vec<InterpolatedCode>) {
    let Tokens { all, inner } = lex(text);
    (all.into_iter().map(|token| token.range).collect(), inner)
}

/// Whether a token opens a bracket; `#{` begins an object map.
pub fn is_opening_bracket(token: &str) -> bool {
    matches!(token, "(" | "[" | "{" | "#{")
}

/// Whether a token closes a bracket.
pub fn is_closing_bracket(token: &str) -> bool {
    matches!(token, ")" | "]" | "}")
}

/// A string as a script literal, with quotes and escapes.
pub fn quoted(text: &str) -> String {
    format!("\"{}\"", text.replace('\\', "\\\\").replace('"', "\\\""))
}

/// Whether a text can be the name of a variable: one word that is not a keyword of Rhai.
pub fn is_name(text: &str) -> bool {
    let (engine, texts) = (Engine::new_raw(), [text]);
    let mut tokens = engine.lex(&texts).0.map(|(token, _)| token);
    matches!(tokens.next(), Some(Token::Identifier(name)) if **name == *text)
        && matches!(tokens.next(), None | Some(Token::EOF))
}

/// All tokens, in order.
pub(crate) fn tokens(text: &str) -> Vec<ScriptToken> {
    lex(text).all
}

/// The tokens of a text, found by Rhai's lexer.
pub(crate) fn lex(text: &str) -> Tokens {
    let engine = Engine::new_raw();
    let texts = [text];
    let (mut tokens, control) = engine.lex(&texts);
    let mut cursor = Cursor { text, line: 1, column: 0, byte: 0 };
    let Tokens { all: mut found, mut inner } = Tokens::default();
    // Stack of interpolated strings that are not closed yet: first byte, and number of open braces inside.
    let mut strings: Vec<(usize, usize)> = Vec::new();
    let mut continues_string = false;
    let string = |range: Range<usize>| ScriptToken { range, kind: TokenKind::Text };
    while let Some((token, at)) = tokens.next() {
        let before = Position::new(at.line().unwrap_or(1) as u16, at.position().unwrap_or(1) as u16 - 1);
        let start = cursor.advance_to(before);
        let end = cursor.advance_to(tokens.pos);
        let is_string_part = std::mem::take(&mut continues_string);
        let is_outermost = strings.len() == 1;
        match &token {
            Token::EOF => break,
            Token::LexError(error) if matches!(**error, LexError::UnterminatedString) => {
                strings.push((start, 0));
                break;
            }
            // A documentation comment of a function.
            Token::Comment(_) => {}
            Token::InterpolatedString(_) if !is_string_part => strings.push((start, 0)),
            Token::InterpolatedString(_) => {}
            Token::StringConstant(_) if is_string_part => {
                if let (Some((start, _)), true) = (strings.pop(), strings.is_empty()) {
                    found.push(string(start..end));
                }
            }
            Token::Unit if strings.is_empty() => {
                let bracket = |range| ScriptToken { range, kind: TokenKind::Symbol };
                found.extend([start..start + 1, end - 1..end].map(bracket));
            }
            _ => match strings.last_mut() {
                None => {
                    let kind = TokenKind::of(&token, &text[start..end]);
                    found.push(ScriptToken { range: start..end, kind });
                }
                Some((_, depth)) => {
                    if is_outermost && *depth == 0 {
                        inner.push(InterpolatedCode { range: start..end, tokens: Vec::new() });
                    }
                    if let Some(code) = inner.last_mut() {
                        code.range.end = end;
                        code.tokens.push(start..end);
                    }
                    *depth += usize::from(matches!(token, Token::LeftBrace | Token::MapStart));
                    *depth -= usize::from(token == Token::RightBrace && *depth > 0);
                    continues_string = token == Token::RightBrace && *depth == 0;
                    control.borrow_mut().is_within_text = continues_string;
                }
            },
        }
    }
    found.extend(strings.first().map(|(start, _)| string(*start..text.len())));
    Tokens { all: found, inner }
}

/// Place and kind of a comment.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CommentRange {
    pub range: Range<usize>,
    pub is_block: bool,
    /// `false` for a block comment that is never closed.
    pub is_closed: bool,
}

/// The comments in a gap between two tokens, which contains only comments and blanks. Their ranges have no blanks at either end.
pub fn comments(text: &str, gap: Range<usize>) -> Vec<CommentRange> {
    let mut found = Vec::new();
    let mut at = gap.start;
    while at < gap.end {
        let rest = &text[at..gap.end];
        let start = at + rest.len() - rest.trim_start().len();
        let rest = &text[start..gap.end];
        let is_block = rest.starts_with("/*");
        let closed = is_block.then(|| block_length(rest)).flatten();
        let length = match is_block {
            true => closed.unwrap_or(rest.len()),
            false => rest.find('\n').unwrap_or(rest.len()),
        };
        at = start + length;
        let end = start + rest[..length].trim_end().len();
        if end > start {
            found.push(CommentRange {
                range: start..end,
                is_block,
                is_closed: !is_block || closed.is_some(),
            });
        }
    }
    found
}

/// Length in bytes of the block comment at the start of a text. Comments nest.
fn block_length(text: &str) -> Option<usize> {
    let (mut depth, mut at) = (0usize, 0);
    while let Some(c) = text[at..].chars().next() {
        let rest = &text[at..];
        let (opens, closes) = (rest.starts_with("/*"), rest.starts_with("*/"));
        depth = depth + usize::from(opens) - usize::from(closes);
        at += if opens || closes { 2 } else { c.len_utf8() };
        if depth == 0 {
            return Some(at);
        }
    }
    None
}

/// Converts ascending Rhai positions, whose columns count characters, to byte offsets.
struct Cursor<'a> {
    text: &'a str,
    line: usize,
    /// Number of characters before the cursor in its line.
    column: usize,
    byte: usize,
}

impl Cursor<'_> {
    /// The byte offset of a position, which must not lie before the cursor.
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

    fn token_texts(text: &str) -> Vec<&str> {
        token_ranges(text).into_iter().map(|range| &text[range]).collect()
    }

    #[test]
    fn token_ranges_cover_tokens_but_not_comments() {
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
        assert_eq!(token_texts(text), expected);
        assert_eq!(token_texts("1.f(1..2)"), ["1", ".", "f", "(", "1", "..", "2", ")"]);
    }

    #[test]
    fn an_interpolated_or_unclosed_string_is_one_token() {
        assert_eq!(
            token_texts("a(`x ${b(#{ c: `${d}` })} y ${e} `, 1)"),
            ["a", "(", "`x ${b(#{ c: `${d}` })} y ${e} `", ",", "1", ")"]
        );
        assert_eq!(token_texts("a(\"x\n b"), ["a", "(", "\"x\n b"]);
        assert_eq!(token_texts("a(`x ${b"), ["a", "(", "`x ${b"]);
    }

    #[test]
    fn code_inside_strings_has_tokens() {
        let text = "é(`x ${ b + f(#{ c: `${d} y` }) } z ${e.g}`); `${h";
        let (_, inner) = tokens_and_interpolations(text);
        let codes: Vec<(&str, Vec<&str>)> = inner
            .into_iter()
            .map(|code| (&text[code.range], code.tokens.into_iter().map(|token| &text[token]).collect()))
            .collect();
        let first = ["{", "b", "+", "f", "(", "#{", "c", ":", "{", "d", "}", "}", ")", "}"];
        let expected = [
            ("{ b + f(#{ c: `${d} y` }) }", first.to_vec()),
            ("{e.g}", vec!["{", "e", ".", "g", "}"]),
            ("{h", vec!["{", "h"]),
        ];
        assert_eq!(codes, expected);
    }

    #[test]
    fn nested_and_unclosed_comments_are_found_in_a_gap() {
        let text = " // é /*\r\n/* /* b */ */// c\n\n /* open";
        let found: Vec<(&str, bool, bool)> = comments(text, 0..text.len())
            .into_iter()
            .map(|c| (&text[c.range], c.is_block, c.is_closed))
            .collect();
        let expected = [
            ("// é /*", false, true),
            ("/* /* b */ */", true, true),
            ("// c", false, true),
            ("/* open", true, false),
        ];
        assert_eq!(found, expected);
    }

    #[test]
    fn is_name_accepts_identifiers_only() {
        assert!(["a", "_b", "loops", "sun"].into_iter().all(is_name));
        assert!(!["loop", "new", "print", "1a", "a b", "a.b", "é", "", "-a", "a-"].into_iter().any(is_name));
    }

    #[test]
    fn tokens_have_the_kind_of_their_syntax() {
        use TokenKind::{Error, Number, Prefix, Symbol, Text, Word};
        let kinds: Vec<TokenKind> =
            tokens("/// doc\nlet a = -b - -1.5 * !c(`${d}`, 'e') \\").into_iter().map(|t| t.kind).collect();
        let expected = [
            Word, Word, Symbol, Prefix, Word, Symbol, Number, Symbol, Prefix, Word, Symbol, Text, Symbol,
            Text, Symbol, Error,
        ];
        assert_eq!(kinds, expected);
    }
}
