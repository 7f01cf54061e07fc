//! Loops that cannot be shown to end. Their rounds are counted, by the same text on every device: `effect_round` stands at the beginning of
//! the body, and ends the loop if a call of the effect took too many steps (decision 41). All other loops stay as they are.

use crate::tokens::{Tokens, line_and_column};
use std::collections::HashSet;
use std::ops::Range;

/// Largest number of rounds of an uncounted loop, multiplied by the rounds of the loops around it.
const MAX_ROUNDS: u64 = 1024;
/// Largest number in the head of an uncounted loop, so that additions cannot overflow an integer.
const MAX_BOUND: i64 = 1_000_000;

/// A text whose loops are counted where needed.
pub(crate) struct Bounded {
    /// The text; its line breaks are unchanged.
    pub text: String,
    /// Places of the counted loops, lines and columns from 1, in the order of their numbers.
    pub loops: Vec<(usize, usize)>,
}

/// Adds counting to the loops of a text that the parser accepts.
pub(crate) fn bounded(text: &str) -> Bounded {
    let tokens: Vec<(usize, &str)> = Tokens::of(text).collect();
    let words = LoopCounter {
        constants: constants(&tokens),
        looping: functions_with_loops(&tokens),
        tokens: &tokens,
    };
    let mut counted = Vec::new();
    words.count(0..tokens.len(), 1, &mut counted);
    counted.sort_unstable();
    let mut inserts: Vec<(usize, String)> = Vec::new();
    for (number, head) in (1..).zip(&counted) {
        let body = words.body(*head);
        // The round itself is a step, too, so that a loop of one statement reaches the limit before lavapipe leaves it, without an error,
        // after 65,535 rounds.
        let cost = words.tokens[body.clone()].iter().filter(|(_, t)| *t == ";").count() + 1;
        let at = tokens[body.start].0 + 1;
        inserts.push((at, format!(" if effect_round({cost}u, {number}u) {{ break; }}")));
    }
    let mut out = String::with_capacity(text.len() + 64 * inserts.len());
    let mut before = 0;
    for (at, insert) in inserts {
        out.push_str(&text[before..at]);
        out.push_str(&insert);
        before = at;
    }
    out.push_str(&text[before..]);
    Bounded { text: out, loops: counted.iter().map(|head| line_and_column(text, tokens[*head].0)).collect() }
}

fn is_loop(token: &str) -> bool {
    matches!(token, "loop" | "while" | "for")
}

/// Index of the token behind the brace that closes the one at `open`.
fn index_after_block(tokens: &[(usize, &str)], open: usize) -> usize {
    let mut depth = 0usize;
    for (i, (_, token)) in tokens.iter().enumerate().skip(open) {
        depth = match *token {
            "{" => depth + 1,
            "}" => depth.saturating_sub(1),
            _ => depth,
        };
        if depth == 0 && matches!(*token, "{" | "}") {
            return i + 1;
        }
    }
    tokens.len()
}

/// Functions: the name, and the range of tokens from the opening brace to behind the closing one.
fn functions<'a>(tokens: &[(usize, &'a str)]) -> Vec<(&'a str, Range<usize>)> {
    let starts = (0..tokens.len()).filter(|i| tokens[*i].1 == "fn");
    let function = |at: usize| {
        let open = at + tokens[at..].iter().position(|(_, t)| *t == "{")?;
        Some((tokens.get(at + 1)?.1, open..index_after_block(tokens, open)))
    };
    starts.filter_map(function).collect()
}

/// Names of functions that have a loop, or call a function that has one.
fn functions_with_loops<'a>(tokens: &[(usize, &'a str)]) -> HashSet<&'a str> {
    let functions = functions(tokens);
    let mut known: HashSet<&str> = HashSet::new();
    loop {
        let before = known.len();
        for (name, body) in &functions {
            if tokens[body.clone()].iter().any(|(_, t)| is_loop(t) || known.contains(t)) {
                known.insert(name);
            }
        }
        if known.len() == before {
            return known;
        }
    }
}

/// Integer constants of the module, whose names are declared only once in the text.
fn constants<'a>(tokens: &[(usize, &'a str)]) -> Vec<(&'a str, i64)> {
    let token = |i: usize| tokens.get(i).map_or("", |(_, t)| *t);
    let mut found = Vec::new();
    for i in (0..tokens.len()).filter(|i| token(*i) == "const") {
        let name = token(i + 1);
        let value = if token(i + 2) == ":" { i + 5 } else { i + 3 };
        let declared = |j: usize| {
            let before = if j == 0 { "" } else { token(j - 1) };
            matches!(before, "let" | "var" | "const" | "fn" | "struct") || token(j + 1) == ":"
        };
        let meanings = (0..tokens.len()).filter(|j| token(*j) == name && declared(*j)).count();
        if let Some(number) = integer(token(value))
            && (token(value - 1), token(value + 1), meanings) == ("=", ";", 1)
        {
            found.push((name, number));
        }
    }
    found
}

/// Value of `12`, `12i` or `12u`.
fn integer(token: &str) -> Option<i64> {
    token.strip_suffix(['i', 'u']).unwrap_or(token).parse().ok().filter(|n: &i64| *n <= MAX_BOUND)
}

struct LoopCounter<'a> {
    tokens: &'a [(usize, &'a str)],
    constants: Vec<(&'a str, i64)>,
    looping: HashSet<&'a str>,
}

impl LoopCounter<'_> {
    fn token(&self, i: usize) -> &str {
        self.tokens.get(i).map_or("", |(_, t)| *t)
    }

    /// Range of tokens from the opening brace of a loop's body to behind the closing one.
    fn body(&self, head: usize) -> Range<usize> {
        let open = (head..self.tokens.len()).find(|i| self.token(*i) == "{").unwrap_or(head);
        open..index_after_block(self.tokens, open)
    }

    /// Adds the loops of a range of tokens that must be counted. `rounds`: product of the rounds of the uncounted loops around the range.
    fn count(&self, range: Range<usize>, rounds: u64, counted: &mut Vec<usize>) {
        let mut at = range.start;
        while at < range.end {
            if !is_loop(self.token(at)) {
                at += 1;
                continue;
            }
            let body = self.body(at);
            let calls_loops = self.tokens[body.clone()].iter().any(|(_, t)| self.looping.contains(t));
            let own = self.rounds(at, &body).map(|own| own.max(1) * rounds);
            let inner = match own {
                Some(together) if together <= MAX_ROUNDS && !calls_loops => together,
                // Each round of a counted loop also stands for the rounds of its uncounted inner loops.
                _ => {
                    counted.push(at);
                    1
                }
            };
            self.count(body.start + 1..body.end, inner, counted);
            at = body.end.max(at + 1);
        }
    }

    /// Rounds of `for (var i = 0; i < 8; i++)`, if nothing in its body changes `i`. `None`: the number of rounds cannot be shown.
    fn rounds(&self, head: usize, body: &Range<usize>) -> Option<u64> {
        let t = |i: usize| self.token(head + i);
        let starts = (t(0), t(1), t(2)) == ("for", "(", "var");
        let name = t(3);
        let mut i = if t(4) == ":" { 6 } else { 4 };
        let expect = |i: usize, what: &str| (t(i) == what).then_some(());
        starts.then_some(())?;
        expect(i, "=")?;
        let first = self.number(t(i + 1))?;
        expect(i + 2, ";")?;
        expect(i + 3, name)?;
        let comparison = t(i + 4);
        let bound = self.number(t(i + 5))?;
        expect(i + 6, ";")?;
        expect(i + 7, name)?;
        i += 8;
        let (step, close) = match (t(i), t(i + 1)) {
            ("++", _) => (1, i + 1),
            ("--", _) => (-1, i + 1),
            ("+", "=") => (self.number(t(i + 2))?, i + 3),
            _ => return None,
        };
        expect(close, ")")?;
        (!self.changes(name, body)).then_some(())?;
        let span = match (comparison, step) {
            ("<", 1..) => bound - first,
            ("<=", 1..) => bound - first + 1,
            (">", ..0) => first - bound,
            // An unsigned number is never below 0, so that a loop with `>= 0` may not end.
            (">=", ..0) if bound > 0 => first - bound + 1,
            _ => return None,
        };
        Some((span.max(0) as u64).div_ceil(step.unsigned_abs()))
    }

    /// Value of a number or of a known constant.
    fn number(&self, token: &str) -> Option<i64> {
        let constant = || self.constants.iter().find(|(name, _)| *name == token).map(|(_, value)| *value);
        integer(token).or_else(constant)
    }

    /// Whether a variable may get another value in a range of tokens.
    fn changes(&self, name: &str, range: &Range<usize>) -> bool {
        let changed = |i: usize| {
            let (next, after) = (self.token(i + 1), self.token(i + 2));
            let is_operator = matches!(next, "+" | "-" | "*" | "/" | "%" | "&" | "|" | "^");
            matches!(next, "=" | "++" | "--")
                || is_operator && after == "="
                || matches!((next, after), ("<", "<" | "<=") | (">", ">" | ">="))
                || matches!(self.token(i - 1), "&" | "let" | "var")
        };
        range.clone().any(|i| self.token(i) == name && changed(i))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The numbers of the lines on which a loop is counted.
    fn counted(text: &str) -> Vec<usize> {
        bounded(text).loops.into_iter().map(|(line, _)| line).collect()
    }

    #[test]
    fn loops_that_end_are_not_counted() {
        let text = "const n = 16;\nfn f() -> f32 { var s = 0.0;\n\
            for (var i = 0; i < 8; i++) { s += f32(i); }\n\
            for (var i: u32 = 0u; i <= n; i += 2u) { s += f32(i); }\n\
            for (var i = 9; i > 0; i--) { for (var j = 1; j < n; j++) { if i == j { continue; } } }\n\
            return s; }";
        let made = bounded(text);
        assert_eq!((made.loops.as_slice(), made.text.as_str()), (&[][..], text));
    }

    #[test]
    fn loops_that_may_not_end_are_counted() {
        let heads = [
            "loop",
            "while x < 1.0",
            "for (;;)",
            "for (var i = 0; i < m; i++)",
            "for (var i = 0; i < 8; i += m)",
            "for (var i = 0; i < 8; i += 0)",
            "for (var i = 0; i < 2000; i++)",
            "for (var i = 8u; i >= 0u; i--)",
            "for (var i = 0; i != 8; i++)",
            "for (var i = 0; i < 8; i--)",
            "for (var t = 0.0; t < 1.0; t += 0.25)",
            "for (var i = 0; i < local; i++)",
        ];
        for head in heads {
            let text = format!("const local = 3;\nfn f(local: i32) {{\n{head} {{ g(); }} }}\nfn g() {{ }}");
            assert_eq!(counted(&text), [3], "{head}");
        }
        for change in ["i = 0;", "i -= 1;", "i++;", "i <<= 1u;", "let q = &i;", "g();"] {
            let text =
                format!("fn f() {{\nfor (var i = 0; i < 8; i++) {{ {change} }} }}\nfn g() {{\nloop {{ }} }}");
            assert_eq!(counted(&text), [2, 4], "{change}");
        }
    }

    #[test]
    fn rounds_of_nested_loops_are_multiplied() {
        let text = "fn f() {\nfor (var i = 0; i < 64; i++) {\nfor (var j = 0; j < 32; j++) { } } }";
        assert_eq!(counted(text), [3]);
    }

    #[test]
    fn counting_is_added_to_the_text() {
        let text =
            "fn f(x: f32) -> f32 { // loop {\n  loop { /* { */ if x > 1.0 { return x; } }\n return x; }";
        let counts = text.replace("loop { /*", "loop { if effect_round(2u, 1u) { break; } /*");
        assert_eq!(bounded(text).text, counts);
        assert_eq!(bounded(text).loops, [(2, 3)]);
    }
}
