//! The text of a script and its tokens, found by Rhai's own lexer. Unlike a syntax tree, tokens exist even for a text that is being typed.

use crate::position::Lines;
use choreo_script::{InterpolatedCode, is_opening_bracket, tokens_and_interpolations};
use std::ops::Range;
use std::sync::Arc;

pub(crate) struct Source {
    pub text: Arc<str>,
    pub lines: Lines,
    pub tokens: Vec<Range<usize>>,
    /// Code inside interpolated strings, in order.
    inner: Vec<InterpolatedCode>,
    /// The matching bracket of each bracket.
    matching_bracket: Vec<Option<usize>>,
    /// The innermost bracket around each token.
    enclosing_bracket: Vec<Option<usize>>,
}

fn brackets_match(open: &str, close: &str) -> bool {
    matches!((open, close), ("(", ")") | ("[", "]") | ("{" | "#{", "}"))
}

/// Whether a token is a name or a keyword.
pub(crate) fn is_word(token: &str) -> bool {
    token.starts_with(|c: char| c.is_alphabetic() || c == '_')
}

pub(crate) fn is_string(token: &str) -> bool {
    token.starts_with(['"', '`'])
}

/// A word in the code inside an interpolated string.
pub(crate) struct InnerWord<'s> {
    pub text: &'s str,
    pub range: Range<usize>,
    /// Token of the string.
    pub string: usize,
    /// The two tokens before it, and the token after it.
    pub before: [&'s str; 2],
    pub next: &'s str,
}

impl<'s> InnerWord<'s> {
    pub(crate) fn new(source: &'s Source, code: &InterpolatedCode, at: usize) -> InnerWord<'s> {
        let get = |at: Option<usize>| {
            let range = at.and_then(|at| code.tokens.get(at));
            range.map_or("", |range| &source.text[range.clone()])
        };
        let range = code.tokens[at].clone();
        InnerWord {
            text: get(Some(at)),
            string: source.count_tokens_before(range.end).saturating_sub(1),
            range,
            before: [get(at.checked_sub(1)), get(at.checked_sub(2))],
            next: get(Some(at + 1)),
        }
    }

    /// Whether the word is a method, a property, or the key of an object map.
    pub(crate) fn is_member(&self) -> bool {
        matches!(self.before[0], "." | "?.") || (matches!(self.before[0], "#{" | ",") && self.next == ":")
    }
}

impl Source {
    pub(crate) fn new(text: &str) -> Source {
        let (tokens, inner) = tokenize(text);
        let mut source = Source {
            text: text.into(),
            lines: Lines::new(text),
            matching_bracket: vec![None; tokens.len()],
            enclosing_bracket: vec![None; tokens.len()],
            tokens,
            inner,
        };
        let mut open_brackets: Vec<usize> = Vec::new();
        for index in 0..source.tokens.len() {
            let token = source.get(index);
            let is_close = matches!(token, ")" | "]" | "}");
            // A bracket that is not closed ends with the bracket around it.
            let matching =
                open_brackets.iter().rposition(|o| is_close && brackets_match(source.get(*o), token));
            if let Some(depth) = matching {
                source.matching_bracket[index] = Some(open_brackets[depth]);
                let opened = open_brackets[depth];
                source.matching_bracket[opened] = Some(index);
                open_brackets.truncate(depth);
            }
            source.enclosing_bracket[index] = open_brackets.last().copied();
            if is_opening_bracket(source.get(index)) {
                open_brackets.push(index);
            }
        }
        source
    }

    /// Text of a token; empty after the last token.
    pub(crate) fn get(&self, index: usize) -> &str {
        self.tokens.get(index).map_or("", |token| &self.text[token.clone()])
    }

    /// Text of the token that is `places` tokens before another; empty before the first token.
    pub(crate) fn token_before(&self, index: usize, places: usize) -> &str {
        index.checked_sub(places).map_or("", |index| self.get(index))
    }

    /// Token of the bracket that opens or closes the bracket at a token; `None` if there is none.
    pub(crate) fn matching_bracket(&self, index: usize) -> Option<usize> {
        self.matching_bracket.get(index).copied().flatten()
    }

    /// Token of the innermost opening bracket around a token.
    pub(crate) fn enclosing_bracket(&self, index: usize) -> Option<usize> {
        self.enclosing_bracket.get(index).copied().flatten()
    }

    /// Token of the name of a function that the script defines.
    pub(crate) fn function_named(&self, name: &str) -> Option<usize> {
        (1..self.tokens.len()).find(|i| self.get(*i) == name && self.get(i - 1) == "fn")
    }

    /// Number of tokens that begin before a byte.
    pub(crate) fn count_tokens_before(&self, byte: usize) -> usize {
        self.tokens.partition_point(|token| token.start < byte)
    }

    /// The token that contains a byte or ends there. If two tokens touch there, the word or string.
    pub(crate) fn token_at(&self, byte: usize) -> Option<usize> {
        let count = self.tokens.partition_point(|token| token.start <= byte);
        let touches = |index: &usize| self.tokens[*index].end >= byte;
        let found: Vec<usize> = (count.saturating_sub(2)..count).rev().filter(touches).collect();
        let named = |index: &&usize| is_word(self.get(**index)) || is_string(self.get(**index));
        found.iter().find(named).or(found.first()).copied()
    }

    /// Code inside an interpolated string.
    pub(crate) fn inner_code(&self, token: usize) -> &[InterpolatedCode] {
        let range = self.tokens[token].clone();
        let first = self.inner.partition_point(|code| code.range.start < range.start);
        let end = self.inner.partition_point(|code| code.range.start < range.end);
        &self.inner[first..end]
    }

    /// The text in which an interpolated string is replaced by its code around a byte; all bytes keep their positions: `` `a ${b.c}` ``
    /// becomes ``     (b.c) ``. `None` if the byte is in no such code.
    pub(crate) fn with_code_of_string(&self, byte: usize) -> Option<Source> {
        let string = self.token_at(byte).filter(|token| self.get(*token).starts_with('`'))?;
        let token = self.tokens[string].clone();
        // Braces are counted, since code in an interpolation may contain blocks.
        let (mut code, mut depth, mut before) = (None, 0usize, ' ');
        for (at, c) in self.text[token.start..byte.min(token.end)].char_indices() {
            match c {
                '{' if depth > 0 => depth += 1,
                '{' if before == '$' => (code, depth) = (Some(token.start + at + 1), 1),
                '}' => depth = depth.saturating_sub(1),
                _ => {}
            }
            before = c;
        }
        let start = code.filter(|_| depth > 0)?;
        let rest = &self.text[byte..token.end];
        let is_final_brace = |c: char| {
            depth = if c == '{' { depth + 1 } else { depth - usize::from(c == '}') };
            depth == 0
        };
        let end =
            rest.find(is_final_brace).or_else(|| rest.find(['\n', '`'])).map_or(token.end, |at| byte + at);
        let mut text = self.text.as_bytes().to_vec();
        let blank = |text: &mut Vec<u8>, range: Range<usize>| {
            text[range].iter_mut().filter(|byte| **byte != b'\n').for_each(|byte| *byte = b' ');
        };
        blank(&mut text, token.start..start);
        // If the brace is not closed, the lexer takes the rest of the string for code too.
        let is_closed = self.text[end..].starts_with('}');
        let rest = self.text[end..token.end].find('`').filter(|_| !is_closed);
        blank(&mut text, end..rest.map_or(token.end, |at| end + at + 1));
        text[start - 1] = b'(';
        if end < token.end && text[end] != b'\n' {
            text[end] = b')';
        }
        String::from_utf8(text).ok().map(|text| Source::new(&text))
    }

    /// Words in the code inside all interpolated strings.
    pub(crate) fn inner_words(&self) -> impl Iterator<Item = InnerWord<'_>> {
        self.inner.iter().flat_map(move |code| {
            let words = (0..code.tokens.len()).filter(|at| is_word(&self.text[code.tokens[*at].clone()]));
            words.map(move |at| InnerWord::new(self, code, at))
        })
    }

    /// Whether the script declares a test.
    pub(crate) fn has_tests(&self) -> bool {
        let is_test = |at: &usize| self.get(*at) == "test" && self.get(at + 1) == "(";
        (0..self.tokens.len()).any(|at| is_test(&at) && self.token_before(at, 1) != ".")
    }

    /// Whether a byte is in a comment: between two tokens, after `//` or inside `/* */`.
    pub(crate) fn in_comment(&self, byte: usize) -> bool {
        let count = self.count_tokens_before(byte);
        let start = count.checked_sub(1).map_or(0, |last| self.tokens[last].end);
        if start >= byte {
            return false;
        }
        let gap = &self.text[start..byte];
        let line = gap.rsplit('\n').next().unwrap_or(gap);
        let block = |text: &str| text.matches("/*").count() > text.matches("*/").count();
        line.contains("//") || block(gap)
    }

    /// Contents of a plain string, with escapes resolved.
    pub(crate) fn string_value(&self, index: usize) -> Option<String> {
        let token = self.get(index);
        let quote = token.chars().next().filter(|c| matches!(c, '"' | '`'))?;
        let inside = &token[1..];
        let inside = inside.strip_suffix(quote).unwrap_or(inside);
        if quote == '`' {
            return (!inside.contains("${")).then(|| inside.to_string());
        }
        let (mut plain, mut escaped) = (String::new(), false);
        for c in inside.chars() {
            match (escaped, c) {
                (false, '\\') => escaped = true,
                (true, 'n') => plain.push('\n'),
                (true, 't') => plain.push('\t'),
                (_, c) => plain.push(c),
            }
            escaped &= c == '\\' && !plain.ends_with('\\');
        }
        Some(plain)
    }

    /// Bytes between the quotes of a string.
    pub(crate) fn string_content_range(&self, index: usize) -> Range<usize> {
        let range = self.tokens[index].clone();
        let token = self.get(index);
        let closed = token.len() > 1 && token.ends_with(&token[..1]);
        range.start + 1..range.end - usize::from(closed)
    }

    /// Arguments of a call as ranges of tokens, given its opening parenthesis.
    pub(crate) fn arguments(&self, open: usize) -> Vec<Range<usize>> {
        let end = self.matching_bracket(open).unwrap_or(self.tokens.len());
        let mut arguments = Vec::new();
        let mut start = open + 1;
        let mut index = start;
        while index < end {
            match self.get(index) {
                "," => {
                    arguments.push(start..index);
                    start = index + 1;
                }
                ";" => break,
                token if is_opening_bracket(token) => index = self.matching_bracket(index).unwrap_or(end),
                _ => {}
            }
            index += 1;
        }
        if start < index.min(end) {
            arguments.push(start..index.min(end));
        }
        arguments
    }

    /// Bytes as a range of the protocol.
    pub(crate) fn range(&self, bytes: &Range<usize>) -> serde_json::Value {
        self.lines.range(&self.text, bytes)
    }
}

/// Tokens of a text, and the code inside its strings. A string that is not closed ends with its line, so that the text after it is still
/// parsed.
fn tokenize(text: &str) -> (Vec<Range<usize>>, Vec<InterpolatedCode>) {
    let mut tokens: Vec<Range<usize>> = Vec::new();
    let mut inner: Vec<InterpolatedCode> = Vec::new();
    let mut base = 0;
    loop {
        let moved = |range: Range<usize>| base + range.start..base + range.end;
        let (found, codes) = tokens_and_interpolations(&text[base..]);
        tokens.extend(found.into_iter().filter(|token| !token.is_empty()).map(moved));
        inner.extend(codes.into_iter().map(|code| InterpolatedCode {
            range: moved(code.range),
            tokens: code.tokens.into_iter().map(moved).collect(),
        }));
        let Some(last) = tokens.last_mut().filter(|last| last.end == text.len()) else { break };
        let token = &text[last.clone()];
        let open = token.starts_with('"') && (token.len() == 1 || token.contains('\n'));
        let Some(end) = token.find('\n').filter(|_| open) else { break };
        last.end = last.start + token[..end].trim_end_matches('\r').len();
        base = last.start + end;
    }
    (tokens, inner)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_unclosed_string_ends_at_the_end_of_its_line() {
        let source = Source::new("load(\"kni\nlet é = [1, \"a\\\"b\"];\nf(`x ${y}`)");
        let all: Vec<&str> = (0..source.tokens.len()).map(|i| source.get(i)).collect();
        let expected = [
            "load",
            "(",
            "\"kni",
            "let",
            "é",
            "=",
            "[",
            "1",
            ",",
            "\"a\\\"b\"",
            "]",
            ";",
            "f",
            "(",
            "`x ${y}`",
            ")",
        ];
        assert_eq!(all, expected);
        assert_eq!(source.string_value(2).unwrap(), "kni");
        assert_eq!(source.string_value(9).unwrap(), "a\"b");
        assert_eq!(source.string_value(14), None);
        assert_eq!((source.matching_bracket(6), source.enclosing_bracket(7)), (Some(10), Some(6)));
    }

    #[test]
    fn arguments_are_found_in_unfinished_calls() {
        let source = Source::new("a(b(1, 2), #{ c: [3, 4] }, ); d(5, ; e");
        assert_eq!(source.arguments(1).len(), 2);
        let open = (0..source.tokens.len()).find(|i| source.get(*i) == "d").unwrap() + 1;
        assert_eq!(source.arguments(open).len(), 1);
    }

    /// The cursor is written as `¦`.
    #[test]
    fn an_interpolated_string_is_replaced_by_its_code_at_the_cursor() {
        for (written, expected) in [
            ("f(`é ${a.¦b} x ${c}`, 1);", Some("f(     (a.b)        , 1);")),
            ("f(`${#{ a: 1 }.¦}`);", Some("f(  (#{ a: 1 }.) );")),
            ("f(`x\n${a¦}`); g", Some("f(  \n (a) ); g")),
            ("f(`${a} ¦ ${b}`);", None),
            ("f(\"${a¦}\");", None),
            ("f(a¦);", None),
        ] {
            let byte = written.find('¦').unwrap();
            let source = Source::new(&written.replacen('¦', "", 1));
            let inner = source.with_code_of_string(byte).map(|source| source.text.to_string());
            assert_eq!(inner.as_deref(), expected, "{written}");
        }
    }

    #[test]
    fn positions_in_line_and_block_comments_are_detected() {
        let text = "a; // b\nc /* d\n e */ f";
        let source = Source::new(text);
        let inside = |part: &str| source.in_comment(text.find(part).unwrap() + 1);
        assert_eq!(
            [inside("a"), inside(" b"), inside("c"), inside(" e"), inside("f")],
            [false, true, false, true, false]
        );
    }
}
