//! Finds causes of parser errors that lie before the place at which the parser stops: a bracket that is not closed, an object map
//! without `#`, a reserved word as a key. They are found from the tokens around that place.

use crate::api_error::ApiError;
use crate::tokens::{ScriptToken, TokenKind, tokens};
use rhai::{LexError, ParseErrorType};

/// An error about the cause of a parser error, with the line and column of the cause, from 1.
pub(crate) struct EarlierCause {
    pub line: usize,
    pub column: usize,
    pub error: ApiError,
}

/// The tokens of a text, and for each opening bracket the index of its closing bracket.
struct Brackets<'t> {
    text: &'t str,
    tokens: Vec<ScriptToken>,
    closed_by: Vec<Option<usize>>,
}

impl EarlierCause {
    /// The cause of an error that the parser found at a line and column.
    pub(crate) fn find(kind: &ParseErrorType, at: (usize, usize), text: &str) -> Option<EarlierCause> {
        let may_miss_bracket = match kind {
            ParseErrorType::MissingToken(token, _) => matches!(&**token, ")" | "]" | "}" | ","),
            ParseErrorType::UnexpectedEOF => true,
            _ => false,
        };
        let may_be_key = matches!(
            kind,
            ParseErrorType::MissingToken(..)
                | ParseErrorType::VariableUndefined(_)
                | ParseErrorType::PropertyExpected
                | ParseErrorType::Reserved(_)
                | ParseErrorType::BadInput(_)
                | ParseErrorType::UnexpectedEOF
        );
        if !may_miss_bracket && !may_be_key {
            return None;
        }
        let brackets = Brackets::new(text);
        let stop = brackets.token_at(at);
        let enclosing = brackets.enclosing_bracket(stop);
        let key = brackets.key_near(stop).filter(|_| may_be_key).zip(enclosing);
        if let Some(cause) = key.and_then(|(key, open)| brackets.key_error(key, open)) {
            return Some(cause);
        }
        let stops_at_statement = begins_statement(kind, brackets.get(stop));
        let may_be_cause =
            |open: &usize| may_miss_bracket || (stops_at_statement && brackets.get(*open) != "{");
        let is_unclosed = |open: &usize| brackets.closed_by[*open].is_none() && may_be_cause(open);
        let open = enclosing.filter(is_unclosed)?;
        Some(brackets.unclosed_error(open, stop))
    }
}

impl Brackets<'_> {
    fn new(text: &str) -> Brackets<'_> {
        let tokens = tokens(text);
        let mut brackets = Brackets { text, closed_by: vec![None; tokens.len()], tokens };
        let mut open: Vec<usize> = Vec::new();
        for index in 0..brackets.tokens.len() {
            if brackets.closing(index).is_some() {
                open.push(index);
            }
            let token = brackets.get(index);
            // An unclosed bracket ends with the bracket around it.
            let Some(depth) = open.iter().rposition(|o| brackets.closing(*o) == Some(token)) else {
                continue;
            };
            brackets.closed_by[open[depth]] = Some(index);
            open.truncate(depth);
        }
        brackets
    }

    /// Text of a token; empty after the last one.
    fn get(&self, index: usize) -> &str {
        self.tokens.get(index).map_or("", |token| &self.text[token.range.clone()])
    }

    /// Text of the token `count` tokens before another one.
    fn before(&self, index: usize, count: usize) -> &str {
        index.checked_sub(count).map_or("", |index| self.get(index))
    }

    fn kind(&self, index: usize) -> Option<TokenKind> {
        self.tokens.get(index).map(|token| token.kind)
    }

    /// The closing bracket for an opening one; `None` for other tokens.
    fn closing(&self, index: usize) -> Option<&'static str> {
        match self.get(index) {
            "(" => Some(")"),
            "[" | "?[" => Some("]"),
            "{" | "#{" => Some("}"),
            _ => None,
        }
    }

    /// Index of the first token that begins at a line and column or after it.
    fn token_at(&self, (line, column): (usize, usize)) -> usize {
        let start: usize = self.text.split_inclusive('\n').take(line.saturating_sub(1)).map(str::len).sum();
        let rest = self.text[start..].chars().take(column.saturating_sub(1));
        let byte = start + rest.map(char::len_utf8).sum::<usize>();
        self.tokens.partition_point(|token| token.range.start < byte)
    }

    /// Line and column of a token, or of the end of the text.
    fn place(&self, index: usize) -> (usize, usize) {
        let before = &self.text[..self.tokens.get(index).map_or(self.text.len(), |token| token.range.start)];
        let line = before.rsplit('\n').next().unwrap_or(before);
        (before.matches('\n').count() + 1, line.chars().count() + 1)
    }

    /// The innermost bracket that is open before a token.
    fn enclosing_bracket(&self, index: usize) -> Option<usize> {
        let is_open = |open: &usize| {
            self.closing(*open).is_some() && self.closed_by[*open].is_none_or(|end| end >= index)
        };
        (0..index.min(self.tokens.len())).rev().find(is_open)
    }

    /// Index of a key (a word or text before a colon) if the parser stops at the key or at the colon.
    fn key_near(&self, stop: usize) -> Option<usize> {
        let is_key = |index: &usize| {
            matches!(self.kind(*index), Some(TokenKind::Word | TokenKind::Text)) && self.get(index + 1) == ":"
        };
        [Some(stop), stop.checked_sub(1)].into_iter().flatten().find(is_key)
    }

    /// An error at the place of a token.
    fn error_at(&self, index: usize, text: String, hint: String) -> EarlierCause {
        let (line, column) = self.place(index);
        EarlierCause { line, column, error: ApiError::new(text).hint(hint) }
    }

    /// The error about `KEY:` inside a bracket other than that of an object map, or about a reserved word as a key.
    fn key_error(&self, key: usize, open: usize) -> Option<EarlierCause> {
        let name = self.get(key);
        let begins_entry = matches!(self.before(key, 1), "#{" | ",");
        let is_value = matches!(self.before(open, 1), "(" | "," | "[" | "=" | ":" | "return");
        match self.get(open) {
            "#{" if begins_entry && self.kind(key) == Some(TokenKind::Word) => Some(self.error_at(
                key,
                format!("\"{name}\" is a reserved word and cannot be a key"),
                format!("put it in quotes, #{{ \"{name}\": … }}, or take another name"),
            )),
            "{" if is_value && open + 1 == key => Some(self.error_at(
                open,
                "an object map begins with #{, a block of statements with {".to_string(),
                format!("write #{{ {name}: … }}"),
            )),
            "(" if matches!(self.before(key, 1), "(" | ",") && self.is_call(open) => Some(self.error_at(
                key,
                format!("\"{name}:\" is not an argument: write options in an object map"),
                format!(
                    "write {}({}#{{ {name}: … }})",
                    self.before(open, 1),
                    if key == open + 1 { "" } else { "…, " }
                ),
            )),
            _ => None,
        }
    }

    fn is_call(&self, open: usize) -> bool {
        open.checked_sub(1).is_some_and(|name| self.kind(name) == Some(TokenKind::Word))
    }

    /// The error about a bracket that is not closed before the token at which the parser stops.
    fn unclosed_error(&self, open: usize, stop: usize) -> EarlierCause {
        let end = self.closing(open).unwrap_or_default();
        let before = match stop < self.tokens.len() {
            true => format!("before \"{}\" in line {}", self.get(stop), self.place(stop).0),
            false => "before the end of the script".to_string(),
        };
        let text = format!("this \"{}\" is never closed", self.get(open));
        self.error_at(open, text, format!("a \"{end}\" is missing {before}"))
    }
}

/// Whether the parser stops at a word that begins a statement, as in an unclosed list.
fn begins_statement(kind: &ParseErrorType, stop: &str) -> bool {
    let is_word = matches!(stop, "let" | "const" | "fn" | "for" | "while" | "import" | "export" | "return");
    is_word && matches!(kind, ParseErrorType::BadInput(LexError::UnexpectedInput(_)))
}
