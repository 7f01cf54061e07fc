//! Constant folding in a script's text: expressions of literals alone become the literals that they evaluate to.

use crate::tokens::{ScriptToken, TokenKind, Tokens, is_closing_bracket, is_opening_bracket, lex};
use rhai::{Dynamic, Engine};
use std::ops::Range;

/// Maximum number of characters of a folded number. A longer number is harder to read than the expression.
const MAX_NUMBER_LENGTH: usize = 32;

/// Byte ranges of constant expressions that contain one of the byte offsets `places`, in order, with the literals that replace
/// them: `"post 1"` for `"post " + 1`. An expression is the text between brackets, commas and other separators. If it has names
/// or calls, only the expressions within its brackets and interpolations are folded. An expression that fails to evaluate is not
/// folded. Rhai evaluates the expressions.
pub fn constant_expressions(text: &str, places: &[usize]) -> Vec<(Range<usize>, String)> {
    let Tokens { all, inner } = lex(text);
    let interpolations = inner.into_iter().map(|code| code.range).collect();
    let engine = choreo_sandbox::engine();
    let mut folding =
        Folding { text, tokens: all, interpolations, places, engine: &engine, found: Vec::new() };
    folding.fold_tokens(0..folding.tokens.len());
    folding.found
}

struct Folding<'t> {
    text: &'t str,
    tokens: Vec<ScriptToken>,
    /// Code inside interpolated strings, with its braces.
    interpolations: Vec<Range<usize>>,
    places: &'t [usize],
    engine: &'t Engine,
    found: Vec<(Range<usize>, String)>,
}

impl Folding<'_> {
    /// Folds the expressions in a range of tokens.
    fn fold_tokens(&mut self, tokens: Range<usize>) {
        let (mut start, mut at) = (tokens.start, tokens.start);
        while at < tokens.end {
            let last = if is_opening_bracket(self.token(at)) { self.closing(at, tokens.end) } else { at };
            if is_separator(self.token(at)) {
                self.fold_expression(start..at);
                start = last + 1;
            }
            if self.token(at) == "{" {
                // The block may be the left side of an operator.
                let is_left_operand = last + 1 < tokens.end
                    && self.is_operator(last + 1)
                    && !is_separator(self.token(last + 1));
                match is_left_operand {
                    true => start = at,
                    false => self.fold_tokens(at + 1..last),
                }
            }
            at = last + 1;
        }
        self.fold_expression(start..tokens.end);
    }

    /// Folds the expression that a range of tokens forms, else the expressions inside it.
    fn fold_expression(&mut self, tokens: Range<usize>) {
        if tokens.is_empty() || !self.has_place(&self.bytes(&tokens)) {
            return;
        }
        let bytes = self.bytes(&tokens);
        if let Some(literal) = evaluated_literal(self.engine, &self.text[bytes.clone()]) {
            self.found.push((bytes, literal));
            return;
        }
        let mut at = tokens.start;
        while at < tokens.end {
            if is_opening_bracket(self.token(at)) {
                let close = self.closing(at, tokens.end);
                self.fold_brackets(&tokens, at, close);
                at = close;
            } else if self.token(at).starts_with('`') {
                self.fold_string(at);
            }
            at += 1;
        }
    }

    /// Folds the inside of brackets. Parentheses that only group a literal are removed if they have no effect. `expression`: the
    /// tokens of the expression around the brackets.
    fn fold_brackets(&mut self, expression: &Range<usize>, open: usize, close: usize) {
        let is_group = self.token(open) == "("
            && close < expression.end
            && (open == expression.start || self.is_operator(open - 1));
        let inside = self.bytes(&(open + 1..close));
        let next = if close + 1 < expression.end { self.token(close + 1) } else { "" };
        let has_member_access = matches!(next, "." | "?." | "[" | "?[");
        let literal = evaluated_literal(self.engine, &self.text[inside.clone()]).or_else(|| {
            is_literal(&self.text[inside.clone()]).then(|| self.text[inside.clone()].to_string())
        });
        match literal {
            Some(literal)
                if is_group && !has_member_access && !literal.starts_with('-') && self.has_place(&inside) =>
            {
                self.found.push((self.bytes(&(open..close + 1)), literal));
            }
            _ => self.fold_tokens(open + 1..close),
        }
    }

    /// Folds a string with interpolations, or only its constant interpolations: `${1}` becomes text.
    fn fold_string(&mut self, at: usize) {
        let string = self.tokens[at].range.clone();
        if let Some(literal) = evaluated_literal(self.engine, &self.text[string.clone()]) {
            self.found.extend(self.has_place(&string).then_some((string, literal)));
            return;
        }
        let mut found = Vec::new();
        for code in
            self.interpolations.iter().filter(|code| string.contains(&code.start) && self.has_place(code))
        {
            let interpolation = code.start - "$".len()..code.end;
            let literal = evaluated_literal(self.engine, &format!("`{}`", &self.text[interpolation.clone()]));
            let shown = literal.as_deref().and_then(|literal| literal.strip_prefix('"')?.strip_suffix('"'));
            if let Some(shown) = shown.filter(|shown| !shown.contains(['`', '$', '\\'])) {
                found.push((interpolation, shown.to_string()));
                continue;
            }
            let inside = code.start + 1..code.end - 1;
            let Some(text) = self.text.get(inside.clone()) else { continue };
            let places: Vec<usize> =
                self.places.iter().filter_map(|place| place.checked_sub(inside.start)).collect();
            let inner = constant_expressions(text, &places).into_iter();
            found
                .extend(inner.map(|(at, literal)| (at.start + inside.start..at.end + inside.start, literal)));
        }
        self.found.extend(found);
    }

    /// Text of a token; empty after the last one.
    fn token(&self, at: usize) -> &str {
        self.tokens.get(at).map_or("", |token| &self.text[token.range.clone()])
    }

    fn is_operator(&self, at: usize) -> bool {
        let is_symbol = matches!(self.tokens[at].kind, TokenKind::Symbol | TokenKind::Prefix);
        is_symbol && !is_closing_bracket(self.token(at))
    }

    /// Index of the token that closes a bracket, or `end`.
    fn closing(&self, open: usize, end: usize) -> usize {
        let mut depth = 0usize;
        for at in open..end {
            depth += usize::from(is_opening_bracket(self.token(at)));
            depth -= usize::from(is_closing_bracket(self.token(at)) && depth > 0);
            if depth == 0 {
                return at;
            }
        }
        end
    }

    /// Byte range of a range of tokens.
    fn bytes(&self, tokens: &Range<usize>) -> Range<usize> {
        match self.tokens.get(tokens.start..tokens.end) {
            Some([first, .., last]) => first.range.start..last.range.end,
            Some([only]) => only.range.clone(),
            _ => 0..0,
        }
    }

    /// Whether a byte range contains one of the requested places.
    fn has_place(&self, bytes: &Range<usize>) -> bool {
        self.places.iter().any(|place| bytes.contains(place))
    }
}

/// Whether a token separates two expressions.
fn is_separator(token: &str) -> bool {
    matches!(
        token,
        "{" | ","
            | ";"
            | ":"
            | "=>"
            | "="
            | "+="
            | "-="
            | "*="
            | "/="
            | "%="
            | "**="
            | ".."
            | "..="
            | "|"
            | ")"
            | "]"
            | "}"
    )
}

/// The literal that a constant expression evaluates to. `None` if it is a literal already, contains names, or fails to evaluate.
fn evaluated_literal(engine: &Engine, expression: &str) -> Option<String> {
    if is_literal(expression) || !is_constant(expression) {
        return None;
    }
    let value: Dynamic = engine.eval(expression).ok()?;
    let literal = literal(&value)?;
    let read: Dynamic = engine.eval(&literal).ok()?;
    is_identical(&value, &read).then_some(literal)
}

/// Whether a text is one number, with or without a sign, or one string.
fn is_literal(text: &str) -> bool {
    match lex(text).all.as_slice() {
        [only] => {
            matches!(only.kind, TokenKind::Number) || only.kind == TokenKind::Text && !text.contains("${")
        }
        [sign, number] => sign.kind == TokenKind::Prefix && number.kind == TokenKind::Number,
        _ => false,
    }
}

/// Whether an expression consists only of numbers, strings, allowed arithmetic operators and parentheses, without comments.
fn is_constant(expression: &str) -> bool {
    let Tokens { all, inner } = lex(expression);
    let is_blank = |from: usize, to: usize| expression[from..to].trim().is_empty();
    let ends = all.iter().map(|token| token.range.end);
    let mut gaps = std::iter::once(0).chain(ends).zip(all.iter().map(|token| token.range.start));
    let is_part = |token: &ScriptToken| match token.kind {
        TokenKind::Number | TokenKind::Text => true,
        TokenKind::Prefix | TokenKind::Symbol => {
            matches!(&expression[token.range.clone()], "+" | "-" | "*" | "/" | "%" | "(" | ")")
        }
        TokenKind::Word | TokenKind::Error => false,
    };
    let is_code = |code: &Range<usize>| {
        let inside = expression.get(code.start + 1..code.end.saturating_sub(1));
        inside.is_some_and(|inside| !inside.trim().is_empty() && is_constant(inside))
    };
    !all.is_empty()
        && all.iter().all(is_part)
        && gaps.all(|(from, to)| is_blank(from, to))
        && inner.iter().all(|code| is_code(&code.range))
}

/// The literal of a number or string.
fn literal(value: &Dynamic) -> Option<String> {
    if let Ok(number) = value.as_int() {
        return Some(number.to_string());
    }
    if let Ok(number) = value.as_float() {
        let digits = number.to_string();
        let point = if digits.contains('.') { "" } else { ".0" };
        let is_short = number.is_finite() && digits.len() <= MAX_NUMBER_LENGTH;
        return is_short.then(|| format!("{digits}{point}"));
    }
    let text = value.read_lock::<rhai::ImmutableString>()?;
    let mut written = String::from('"');
    for c in text.chars() {
        match c {
            '"' | '\\' => written.extend(['\\', c]),
            '\n' => written += "\\n",
            '\r' => written += "\\r",
            '\t' => written += "\\t",
            c => written.push(c),
        }
    }
    Some(written + "\"")
}

/// Whether two values have the same type and bits.
fn is_identical(a: &Dynamic, b: &Dynamic) -> bool {
    match (a.as_int(), b.as_int(), a.as_float(), b.as_float()) {
        (Ok(a), Ok(b), ..) => a == b,
        (Err(_), Err(_), Ok(a), Ok(b)) => a.to_bits() == b.to_bits(),
        (Err(_), Err(_), Err(_), Err(_)) => {
            let text =
                |value: &Dynamic| value.read_lock::<rhai::ImmutableString>().map(|text| text.to_string());
            text(a).is_some() && text(a) == text(b)
        }
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Folds all constant expressions of a text.
    fn folded(text: &str) -> String {
        let places: Vec<usize> = (0..text.len()).collect();
        let mut after = text.to_string();
        for (range, literal) in constant_expressions(text, &places).into_iter().rev() {
            after.replace_range(range, &literal);
        }
        after
    }

    #[test]
    fn constant_expressions_become_literals() {
        for (text, expected) in [
            ("\"post \" + 1", "\"post 1\""),
            ("`post ${1 + 1}`", "\"post 2\""),
            ("a.at(-2 + 1, 3 * 0.5, 0).turn(-(2 + 1))", "a.at(-1, 1.5, 0).turn(-3)"),
            ("x * (1 + 2) - (1 - 3)", "x * 3 - (-2)"),
            ("f(g(1 + 1), [2 * 3, x + 1], #{ a: 1 + 1, b: y })", "f(g(2), [6, x + 1], #{ a: 2, b: y })"),
            ("let a = 7 / 2; a += 7.0 / 2; a", "let a = 3; a += 3.5; a"),
            ("0.1 + 0.2", "0.30000000000000004"),
            ("1 * 2.0", "2.0"),
            ("0.0 * -1", "-0.0"),
            ("(1 + 2).abs() + (1 + 2)", "(3).abs() + 3"),
            ("`${1} of ${n + (1 + 1)}`", "`1 of ${n + 2}`"),
            ("\"a \\\" \\\\ \" + 'b'", "\"a \\\" \\\\ b\""),
            ("`a ${\"\\n\"}`", "\"a \\n\""),
            ("for i in 1 + 1..2 + 3 { f(i) }", "for i in 1 + 1..5 { f(i) }"),
            ("f(|t| 1 + 1)", "f(|t| 2)"),
            ("if x { 1 + 1 } else { 0 } + 1 + 2", "if x { 2 } else { 0 } + 1 + 2"),
        ] {
            assert_eq!(folded(text), expected, "{text}");
        }
    }

    #[test]
    fn expressions_that_fail_or_give_no_number_or_string_are_kept() {
        for text in [
            "f(1 / 0)",
            "f(9223372036854775807 + 1)",
            "f(1 - \"a\")",
            "f(1 < 2)",
            "f(!true)",
            "f(1 + /* one */ 2)",
            "f(1.0 / 0.0)",
            "f(1e300 * 10)",
            "f(x + 1 + 2)",
            // Scripts may not use `**`.
            "f(2 ** 3)",
            "f(\"a\")",
            "f(-1, `a`, 1.50)",
            "f((1 + ",
            "`a ${",
        ] {
            assert_eq!(folded(text), text);
        }
    }

    #[test]
    fn only_expressions_that_contain_a_place_are_folded() {
        let text = "a.at(1.0 / 3.0, 1 * 2.0, x + (1 + 1))";
        assert_eq!(constant_expressions(text, &[16]), [(16..23, "2.0".to_string())]);
        assert_eq!(constant_expressions(text, &[]), []);
    }
}
