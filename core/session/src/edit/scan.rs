//! Calls, arguments and statements of a script, found in its tokens.

use choreo_script::{is_closing_bracket, is_opening_bracket, token_ranges};
use std::ops::{Deref, Range};
use std::sync::Arc;

/// Byte ranges of tokens.
pub(super) type Tokens = Arc<[Range<usize>]>;

pub(super) fn tokens_of(text: &str) -> Tokens {
    token_ranges(text).into()
}

/// A script's text with the byte ranges of its tokens.
#[derive(Clone)]
pub(super) struct Source<'a> {
    text: &'a str,
    tokens: Tokens,
}

impl Deref for Source<'_> {
    type Target = str;

    fn deref(&self) -> &str {
        self.text
    }
}

/// A call: bytes of its name and of the inside of its parentheses, and the byte after them. An option is a call without parentheses whose inside is
/// its value.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Call {
    pub name: Range<usize>,
    pub inside: Range<usize>,
    pub end: usize,
}

impl Call {
    pub(super) fn is_option(&self) -> bool {
        self.end == self.inside.end
    }
}

/// A `for` loop.
pub(super) struct Loop<'a> {
    pub all: Range<usize>,
    /// Loop variable.
    pub name: &'a str,
    pub values: Range<usize>,
    /// Bytes between the braces.
    pub body: Range<usize>,
}

impl<'a> Source<'a> {
    pub(super) fn new(text: &'a str) -> Source<'a> {
        Source::of(text, tokens_of(text))
    }

    /// A text whose tokens are known.
    pub(super) fn of(text: &'a str, tokens: Tokens) -> Source<'a> {
        Source { text, tokens }
    }

    /// Index of the first token that begins at or after a byte.
    fn token_index_at(&self, at: usize) -> usize {
        self.tokens.partition_point(|token| token.start < at)
    }

    /// Text of a token; empty after the last.
    fn token(&self, index: usize) -> &'a str {
        self.tokens.get(index).map_or("", |token| &self.text[token.clone()])
    }

    /// First byte of a token; the end of the text after the last.
    fn token_start(&self, index: usize) -> usize {
        self.tokens.get(index).map_or(self.text.len(), |token| token.start)
    }

    /// Index of the token that closes the bracket at `open`.
    fn closing_bracket_of(&self, open: usize) -> Option<usize> {
        let mut depth = 0usize;
        for index in open..self.tokens.len() {
            depth += usize::from(is_opening_bracket(self.token(index)));
            if is_closing_bracket(self.token(index)) {
                depth = depth.checked_sub(1)?;
                if depth == 0 {
                    return Some(index);
                }
            }
        }
        None
    }

    /// The first byte at or after `at` that is neither whitespace nor in a comment.
    pub(super) fn next_token_start(&self, at: usize) -> usize {
        self.token_start(self.token_index_at(at))
    }

    /// The end of the last token before a byte, skipping whitespace and comments.
    pub(super) fn code_end(&self, at: usize) -> usize {
        self.token_index_at(at).checked_sub(1).map_or(0, |before| self.tokens[before].end.min(at))
    }

    /// The tokens that begin in a range.
    pub(super) fn tokens_within(&self, range: &Range<usize>) -> impl Iterator<Item = &'a str> {
        (self.token_index_at(range.start)..self.token_index_at(range.end)).map(|index| self.token(index))
    }

    /// Index of the first token from a byte on that `ends` accepts, skipping everything in brackets that open on the way.
    fn find_outside_brackets(&self, at: usize, ends: impl Fn(&str) -> bool) -> usize {
        self.find_outside_brackets_before(self.tokens.len(), at, ends)
    }

    /// Like [`Source::find_outside_brackets`], among the tokens before the index `stop`. Returns `stop` or a greater index if none is found.
    fn find_outside_brackets_before(&self, stop: usize, at: usize, ends: impl Fn(&str) -> bool) -> usize {
        let mut index = self.token_index_at(at);
        while index < stop && !ends(self.token(index)) {
            index = match is_opening_bracket(self.token(index)) {
                true => self.closing_bracket_of(index).map_or(self.tokens.len(), |close| close + 1),
                false => index + 1,
            };
        }
        index
    }

    /// The method calls `.from(x).until(y)` after a call, up to the next `play` or `then`.
    pub(crate) fn chain_after(&self, mut at: usize) -> Vec<Call> {
        let mut chain = Vec::new();
        while self.token(self.token_index_at(at)) == "." {
            let Some(call) = self.call_from(at) else { break };
            if matches!(&self.text[call.name.clone()], "then" | "play" | "then_at") {
                break;
            }
            at = call.end;
            chain.push(call);
        }
        chain
    }

    /// All chains `name.a(…).b(…)` of a variable at the bracket depth of the byte `like`, in order, each with its first byte. Deeper ones apply to
    /// one round of a loop or to one frame only.
    pub(crate) fn chains_of(&self, name: &str, like: usize) -> Vec<(usize, Vec<Call>)> {
        let wanted = self.bracket_depth_at(like);
        let is_it = |index: &usize| {
            self.token(*index) == name
                && self.token(index + 1) == "."
                && (*index == 0 || self.token(index - 1) != ".")
                && self.bracket_depth_at(self.token_start(*index)) == wanted
        };
        let found = (0..self.tokens.len()).filter(is_it);
        found.map(|index| (self.token_start(index), self.chain_after(self.token_start(index + 1)))).collect()
    }

    /// Number of brackets that are open before a byte.
    pub(crate) fn bracket_depth_at(&self, end: usize) -> usize {
        (0..self.token_index_at(end)).fold(0usize, |depth, index| match self.token(index) {
            token if is_opening_bracket(token) => depth + 1,
            token if is_closing_bracket(token) => depth.saturating_sub(1),
            _ => depth,
        })
    }

    /// End of the statement around a byte: after its `;`, else before the bracket that closes around it, else the end of the text.
    pub(crate) fn statement_end(&self, at: usize) -> usize {
        let index = self.find_outside_brackets(at, |token| token == ";" || is_closing_bracket(token));
        self.token_start(index) + usize::from(self.token(index) == ";")
    }

    /// First byte of the statement around a byte, or of the content of the brackets around it.
    pub(super) fn statement_start(&self, at: usize) -> usize {
        let mut index = self.token_index_at(at);
        let mut depth = 0usize;
        while let Some(before) = index.checked_sub(1) {
            match self.token(before) {
                // The closing brace of a block ends the previous statement.
                ";" | "}" if depth == 0 => break,
                token if is_closing_bracket(token) => depth += 1,
                token if is_opening_bracket(token) && depth == 0 => break,
                token if is_opening_bracket(token) => depth -= 1,
                _ => {}
            }
            index = before;
        }
        self.token_start(index)
    }

    /// The statement around a byte at the bracket depth `depth`.
    pub(super) fn statement_around(&self, at: usize, depth: usize) -> Range<usize> {
        let mut start = self.statement_start(at);
        while self.bracket_depth_at(start) > depth {
            start = self.statement_start(self.token_before(start));
        }
        start..self.end_of_statement_from(start)
    }

    /// Whether a byte stands in a function of the script or among its parameters.
    pub(super) fn is_in_function(&self, at: usize) -> bool {
        matches!(self.word_at(self.statement_around(at, 0).start), "fn" | "private")
    }

    /// First byte of the token before a byte; 0 if there is none.
    pub(super) fn token_before(&self, at: usize) -> usize {
        self.token_index_at(at).checked_sub(1).map_or(0, |before| self.token_start(before))
    }

    /// The first token that begins at or after a byte.
    pub(super) fn word_at(&self, at: usize) -> &'a str {
        self.token(self.token_index_at(at))
    }

    /// End of the statement that begins at a byte; for a loop or a condition the end of its last block.
    pub(super) fn end_of_statement_from(&self, start: usize) -> usize {
        const BLOCKS: [&str; 9] = ["for", "while", "loop", "do", "if", "switch", "try", "fn", "{"];
        if !BLOCKS.contains(&self.word_at(start)) {
            return self.statement_end(start);
        }
        let mut at = start;
        loop {
            let open = self.find_outside_brackets(at, |token| token == "{" || token == ";");
            let Some(close) = self.closing_bracket_of(open).filter(|_| self.token(open) == "{") else {
                return self.statement_end(start);
            };
            match self.token(close + 1) {
                "else" | "catch" => at = self.token_start(close + 1),
                "while" | "until" if self.word_at(start) == "do" => {
                    return self.statement_end(self.token_start(close + 1));
                }
                _ => return self.tokens[close].end,
            }
        }
    }

    /// Bytes of the names that statements in a range declare or assign.
    pub(super) fn assigned_names_in(&self, range: &Range<usize>) -> Vec<Range<usize>> {
        let tokens = self.token_index_at(range.start)..self.token_index_at(range.end);
        let is_set = |index: &usize| {
            let before = index.checked_sub(1).map_or("", |before| self.token(before));
            let follows = self.token(index + 1);
            let assigns = matches!(follows, "=" | "+=" | "-=" | "*=" | "/=" | "%=" | "**=" | "<<=" | ">>=")
                || matches!(follows, "&=" | "|=" | "^=");
            before == "let" || before == "const" || (assigns && before != ".")
        };
        tokens.filter(is_set).filter_map(|index| self.tokens.get(index).cloned()).collect()
    }

    /// Whether a statement begins at a byte.
    pub(super) fn begins_statement(&self, at: usize) -> bool {
        self.token_index_at(at)
            .checked_sub(1)
            .is_none_or(|before| matches!(self.token(before), ";" | "{" | "}"))
    }

    /// The variable that a statement declares, `let NAME = …`. `statement`: its first byte.
    pub(super) fn variable_of(&self, statement: usize) -> Option<&'a str> {
        let index = self.token_index_at(statement);
        (self.token(index) == "let" && self.token(index + 2) == "=").then(|| self.token(index + 1))
    }

    /// First bytes of all occurrences of a variable. Names after a dot are properties or methods and do not count.
    pub(super) fn uses_of(&self, name: &str) -> impl Iterator<Item = usize> {
        let is_it =
            move |index: &usize| self.token(*index) == name && (*index == 0 || self.token(index - 1) != ".");
        (0..self.tokens.len()).filter(is_it).map(|index| self.token_start(index))
    }

    /// The function call that has the word at a byte as a whole argument, and the number of that argument, from 0.
    pub(super) fn argument_at(&self, at: usize) -> Option<(Call, usize)> {
        let index = self.token_index_at(at);
        let (mut before, mut depth, mut number) = (index.checked_sub(1)?, 0usize, 0);
        if !matches!(self.token(before), "(" | ",") || !matches!(self.token(index + 1), ")" | ",") {
            return None;
        }
        loop {
            match self.token(before) {
                "(" if depth == 0 => break,
                token if is_opening_bracket(token) => depth = depth.checked_sub(1)?,
                token if is_closing_bracket(token) => depth += 1,
                "," if depth == 0 => number += 1,
                _ => {}
            }
            before = before.checked_sub(1)?;
        }
        let name = before.checked_sub(1)?;
        let is_method = name.checked_sub(1).is_some_and(|dot| self.token(dot) == ".");
        self.call_from(self.token_start(name)).filter(|_| !is_method).map(|call| (call, number))
    }

    /// Name of a parameter of a function, given by its number from 0, and the bytes of the function's body.
    pub(super) fn parameter(&self, function: &str, number: usize) -> Option<(&'a str, Range<usize>)> {
        let is_it = |index: &usize| self.token(*index) == "fn" && self.token(index + 1) == function;
        let definition = (0..self.tokens.len()).find(is_it)?;
        let parameters = self.call_from(self.token_start(definition + 1))?;
        let name = self.tokens_within(&parameters.inside).filter(|token| *token != ",").nth(number)?;
        let brace = self.token_index_at(parameters.end);
        let close = self.closing_bracket_of(brace).filter(|_| self.token(brace) == "{")?;
        Some((name, self.tokens[brace].end..self.token_start(close)))
    }

    /// The range extended to whole lines, with indentation and a comment after it. `None` if other code stands on these lines.
    pub(super) fn whole_lines(&self, range: &Range<usize>) -> Option<Range<usize>> {
        let before = self.text[..range.start].trim_end_matches([' ', '\t']);
        let end = self.text[range.end..].find('\n').map_or(self.text.len(), |at| range.end + at + 1);
        let behind = self.text[range.end..end].trim();
        let is_alone =
            (before.is_empty() || before.ends_with('\n')) && (behind.is_empty() || behind.starts_with("//"));
        is_alone.then_some(before.len()..end)
    }

    /// All calls of a function, in order.
    pub(super) fn calls_of(&self, name: &str) -> impl Iterator<Item = Call> {
        let is_it =
            move |index: &usize| self.token(*index) == name && (*index == 0 || self.token(index - 1) != ".");
        let found = (0..self.tokens.len()).filter(is_it);
        found.filter_map(|index| self.call_from(self.token_start(index)))
    }

    /// The call `name(…)` or `.name(…)` at a byte.
    pub(crate) fn call_from(&self, at: usize) -> Option<Call> {
        let index = self.token_index_at(at);
        let index = index + usize::from(self.token(index) == ".");
        let is_name = self.token(index).starts_with(|c: char| c.is_alphanumeric() || c == '_');
        if !is_name || self.token(index + 1) != "(" {
            return None;
        }
        let close = self.token_start(self.closing_bracket_of(index + 1)?);
        let open = self.token_start(index + 1);
        Some(Call { name: self.tokens[index].clone(), inside: open + 1..close, end: close + 1 })
    }

    /// The option `name: value` of a map whose name begins at a byte.
    pub(super) fn option_from(&self, at: usize) -> Option<Call> {
        let name = self.token_index_at(at);
        if self.token(name + 1) != ":" {
            return None;
        }
        let value = self.token_start(name + 2);
        let end = self.find_outside_brackets(value, |token| token == "," || is_closing_bracket(token));
        let inside = self.trimmed(&(value..self.token_start(end)));
        Some(Call { name: self.tokens[name].clone(), end: inside.end, inside })
    }

    /// The call before the method whose name is at a byte: `a(…)` for `b` in `a(…).b`.
    pub(super) fn call_before(&self, name: usize) -> Option<Call> {
        let dot = self.token_index_at(name).checked_sub(1)?;
        let mut index = dot.checked_sub(1)?;
        if self.token(dot) != "." || self.token(index) != ")" {
            return None;
        }
        let mut depth = 1usize;
        while depth > 0 {
            index = index.checked_sub(1)?;
            depth += usize::from(is_closing_bracket(self.token(index)));
            depth -= usize::from(is_opening_bracket(self.token(index)));
        }
        self.call_from(self.token_start(index.checked_sub(1)?))
    }

    /// The range without whitespace and comments at its ends.
    pub(super) fn trimmed(&self, bytes: &Range<usize>) -> Range<usize> {
        let (first, behind) = (self.token_index_at(bytes.start), self.token_index_at(bytes.end));
        match self.tokens.get(first..behind) {
            Some([first, .., last]) => first.start..last.end.min(bytes.end),
            Some([only]) => only.start..only.end.min(bytes.end),
            _ => bytes.end..bytes.end,
        }
    }

    /// Bytes between the braces of the `#{ … }` that is the last argument.
    pub(crate) fn options_map(&self, inside: &Range<usize>) -> Option<Range<usize>> {
        let mut at = inside.start;
        while at < inside.end {
            let end = self.value_end(at, inside.end);
            let map = self.token_index_at(at);
            if self.token(map) == "#{" {
                let close = self.closing_bracket_of(map)?;
                let is_last = self.token_start(close + 1) >= inside.end;
                return is_last.then(|| self.tokens[map].end..self.token_start(close));
            }
            at = end + 1;
        }
        None
    }

    /// Byte of the comma after a value, or `end`.
    pub(crate) fn value_end(&self, at: usize, end: usize) -> usize {
        self.token_start(
            self.find_outside_brackets_before(self.token_index_at(end), at, |token| token == ","),
        )
        .min(end)
    }

    /// Bytes of an argument without whitespace, given by the inside of the call's parentheses and its number from 0.
    pub(super) fn argument(&self, inside: &Range<usize>, number: usize) -> Option<Range<usize>> {
        let next = |at: usize| Some(self.value_end(at, inside.end) + 1).filter(|at| *at < inside.end);
        let start = (0..number).try_fold(inside.start, |at, _| next(at))?;
        Some(self.trimmed(&(start..self.value_end(start, inside.end)))).filter(|range| !range.is_empty())
    }

    pub(crate) fn count_arguments(&self, inside: &Range<usize>) -> usize {
        let (mut at, mut count) = (inside.start, 0);
        while at < inside.end {
            count += 1;
            at = self.value_end(at, inside.end) + 1;
        }
        count
    }

    /// The variable of `let NAME =` or `NAME =` directly before a byte.
    pub(crate) fn variable_before(&self, at: usize) -> Option<&'a str> {
        let equals = self.token_index_at(at).checked_sub(1)?;
        let name = equals.checked_sub(1)?;
        let before = name.checked_sub(1).map_or("", |index| self.token(index));
        let is_name = self.token(name).starts_with(|c: char| c.is_alphabetic() || c == '_');
        let declares = matches!(before, "let" | "" | ";" | "}" | "{");
        (self.token(equals) == "=" && is_name && declares).then(|| self.token(name))
    }

    /// The innermost `for NAME in VALUES { … }` around a byte.
    pub(crate) fn loop_around(&self, at: usize) -> Option<Loop<'a>> {
        let within = self.token_index_at(at);
        let around = |index: usize| {
            let brace =
                self.token_index_at(self.token_start(
                    self.find_outside_brackets(self.token_start(index + 3), |token| token == "{"),
                ));
            let close = self.closing_bracket_of(brace).filter(|close| brace < within && within < *close)?;
            Some(Loop {
                all: self.token_start(index)..self.token_start(close) + 1,
                name: self.token(index + 1),
                values: self.token_start(index + 3)..self.token_start(brace),
                body: self.token_start(brace) + 1..self.token_start(close),
            })
        };
        let is_loop = |index: &usize| self.token(*index) == "for" && self.token(index + 2) == "in";
        (0..within).rev().filter(is_loop).find_map(around)
    }

    /// The whole text.
    pub(crate) fn whole(&self) -> &'a str {
        self.text
    }

    /// The calls that begin in a range, in order.
    pub(crate) fn calls_within(&self, range: &Range<usize>) -> Vec<Call> {
        let tokens = self.token_index_at(range.start)..self.token_index_at(range.end);
        // A method is found at its name; the dot before it is skipped.
        let call = |index| {
            self.call_from(self.token_start(index)).filter(|call| call.name.start == self.token_start(index))
        };
        tokens.filter_map(call).collect()
    }

    /// First byte of the last call before `before` that is assigned by `let NAME =` or `NAME =`.
    pub(crate) fn assigned_call(&self, name: &str, before: usize) -> Option<usize> {
        let is_it = |index: &usize| {
            self.call_from(self.token_start(*index))
                .is_some_and(|call| call.name.start == self.token_start(*index))
                && self.variable_before(self.token_start(*index)) == Some(name)
        };
        let found = (0..self.token_index_at(before)).rev().find(is_it)?;
        (!name.is_empty()).then(|| self.token_start(found))
    }

    /// Line and column, in characters, of a byte, both from 1.
    pub(crate) fn place_of(&self, at: usize) -> (usize, usize) {
        let before = &self.text[..at];
        let line = before.rfind('\n').map_or(0, |end| end + 1);
        (before.matches('\n').count() + 1, before[line..].chars().count() + 1)
    }

    /// Byte at a line and a column, in characters, both from 1.
    pub(crate) fn byte_at(&self, line: usize, column: usize) -> Option<usize> {
        let start: usize = self.text.split_inclusive('\n').take(line.checked_sub(1)?).map(str::len).sum();
        let rest = self.text.get(start..).filter(|rest| !rest.is_empty())?;
        let within: usize = rest.chars().take(column.saturating_sub(1)).map(char::len_utf8).sum();
        Some(start + within)
    }
}

pub(super) fn last_arguments_of(chain: &[Call], text: &str, name: &str) -> Option<Range<usize>> {
    chain.iter().rev().find(|call| text[call.name.clone()] == *name).map(|call| call.inside.clone())
}
