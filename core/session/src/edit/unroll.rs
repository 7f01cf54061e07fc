//! Loop unrolling: the body is written once for each value, so that each object that it makes has a line of its own.

use super::scan::Source;
use super::values::parse_literal;
use super::{Edit, EditRefused};
use choreo_script::{constant_expressions, token_ranges, tokens_and_interpolations};
use std::ops::Range;

/// Largest number of rounds that are written out.
const MAX_ROUNDS: usize = 64;

/// Unrolls the innermost loop around a position, `for NAME in [a, b]` or `in 0..3`, with the values in place of the name. Constant expressions
/// become literals, which can be edited: `"post " + i` becomes `"post 1"`. A variable that holds such a literal and is never set again is replaced
/// by the literal. Other variables of the body get a number to tell them apart: the value of the loop variable if a string ends with it, else a
/// count from 1.
///
/// # Errors
/// There is no such loop, or its values or its body cannot be written out. The text is for the user.
pub fn unroll(text: &str, line: usize, column: usize) -> Result<Edit, EditRefused> {
    let source = Source::new(text);
    let refuse = |why: &str| EditRefused::at(line, why);
    let at = source.byte_at(line, column).ok_or_else(|| refuse("the script has no such line"))?;
    let found = source.loop_around(at).ok_or_else(|| refuse("it is not in a loop"))?;
    let values = loop_values(&source, &found.values)
        .ok_or_else(|| refuse("the values of the loop are computed; write it out in the script"))?;
    if values.len() > MAX_ROUNDS {
        return Err(refuse("the loop has too many iterations to be written out"));
    }
    let words = words_within(text, &found.body);
    let is_way_out = |word: &&Range<usize>| matches!(&text[(*word).clone()], "break" | "continue" | "return");
    if words.iter().any(|word| is_way_out(&word)) {
        return Err(refuse("the loop contains break, continue or return; write it out in the script"));
    }
    let mut made: Vec<&str> = Vec::new();
    for pair in words.windows(2).filter(|pair| &text[pair[0].clone()] == "let") {
        made.push(&text[pair[1].clone()]);
    }
    let is_anew =
        |pair: &[Range<usize>]| text[pair[0].clone()] == *"for" && text[pair[1].clone()] == *found.name;
    if made.contains(&found.name) || words.windows(2).any(is_anew) {
        return Err(refuse(
            "its body declares a variable with the loop variable's name; write it out in the script",
        ));
    }
    let indent = indent_before(text, found.all.start);
    let round = |number: &str, value: &str| {
        let mut round = LoopIteration::default();
        let mut at = found.body.start;
        for word in words.iter().filter(|word| is_variable(text, word)) {
            let name = &text[(*word).clone()];
            round.text += &text[at..word.start];
            match name == found.name {
                true => round.insert_value(text, word, value),
                false if made.contains(&name) => round.text += &format!("{name}_{number}"),
                false => round.text += name,
            }
            at = word.end;
        }
        round.text += &text[at..found.body.end];
        let mut written = round.folded();
        for name in &made {
            written = without_constant(&written, &format!("{name}_{number}")).unwrap_or(written);
        }
        dedented(&written, indent)
    };
    // `let post_0 = cast("post 0", …)`
    let is_named = |value: &String| {
        let (written, end) = (round("1", value), format!("{value}\""));
        let mut ends = written.match_indices(&end).map(|(at, _)| &written[..at]);
        let is_digit = |c: char| c.is_ascii_digit();
        value.chars().all(is_digit) && ends.any(|before| !before.ends_with(is_digit))
    };
    let is_counted = text[found.values.clone()].contains("..") && values.first().is_some_and(is_named);
    let rounds = values.iter().enumerate().map(|(number, value)| match is_counted {
        true => round(value, value),
        false => round(&(number + 1).to_string(), value),
    });
    let rounds: Vec<String> = rounds.collect();
    Ok(Edit { range: found.all.clone(), text: rounds.join(&format!("\n{indent}")) })
}

/// A body without the declaration of a variable that holds a literal, and with the literal in its place. `None` if it holds anything else, is set
/// again, or its declaration has a comment.
fn without_constant(text: &str, name: &str) -> Option<String> {
    let words = words_within(text, &(0..text.len()));
    let is_it = |word: &Range<usize>| text[word.clone()] == *name && is_variable(text, word);
    let (place, made) = words.iter().enumerate().find(|(_, word)| is_it(word))?;
    let start = place
        .checked_sub(1)
        .map(|before| words[before].clone())
        .filter(|word| text[word.clone()] == *"let")?
        .start;
    let tokens = token_ranges(&text[made.end..]);
    let mut tokens = tokens.into_iter().map(|token| token.start + made.end..token.end + made.end);
    tokens.next().filter(|sign| text[sign.clone()] == *"=")?;
    let value =
        tokens.by_ref().take_while(|token| text[token.clone()] != *";").reduce(|a, b| a.start..b.end)?;
    let is_text = text[value.clone()].starts_with('"') && token_ranges(&text[value.clone()]).len() == 1;
    if !is_text && parse_literal(text, &value).is_none() {
        return None;
    }
    let end = value.end + text[value.end..].find(';')? + 1;
    let line_end = text[end..].find('\n').map_or(text.len(), |at| end + at);
    if text[end..line_end].trim_start().starts_with('/') {
        return None;
    }
    let is_read = |word: &Range<usize>| {
        let (before, behind) = (text[..word.start].trim_end(), text[word.end..].trim_start());
        let sign = behind.trim_start_matches(['+', '-', '*', '/', '%', '<', '>', '&', '|', '^', '?']);
        let is_set = sign.starts_with('=') && !sign.starts_with("==") && !behind.starts_with(['<', '>']);
        !is_set && !behind.starts_with(['.', '[', '(']) && !before.ends_with('|') && !before.ends_with("let")
    };
    let uses: Vec<&Range<usize>> = words[place + 1..].iter().filter(|word| is_it(word)).collect();
    if !uses.iter().all(|word| is_read(word)) {
        return None;
    }
    let whole = start..end;
    let lines = Source::new(text).whole_lines(&whole).unwrap_or(start..end + blanks(&text[end..]));
    let (mut round, mut at) =
        (LoopIteration { text: text[..lines.start].to_string(), ..LoopIteration::default() }, lines.end);
    for word in uses {
        round.text += &text[at..word.start];
        round.insert_value(text, word, &text[value.clone()]);
        at = word.end;
    }
    round.text += &text[at..];
    Some(round.folded())
}

/// Source text of the values of a loop: the items of an array, or the numbers of a range of literals.
fn loop_values(source: &Source, range: &Range<usize>) -> Option<Vec<String>> {
    let inside = source[range.clone()].trim();
    if let Some((from, to)) = inside.split_once("..").filter(|_| !inside.starts_with('[')) {
        let (last, add) = to.strip_prefix('=').map_or((to, 0), |to| (to, 1));
        let (from, to): (i64, i64) = (from.trim().parse().ok()?, last.trim().parse().ok()?);
        return Some((from..to.checked_add(add)?).take(MAX_ROUNDS + 1).map(|n| n.to_string()).collect());
    }
    let start = range.start + source[range.clone()].find('[')?;
    let end = range.start + source[range.clone()].rfind(']')?;
    let is_array =
        source[range.start..start].trim().is_empty() && source[end + 1..range.end].trim().is_empty();
    let (mut at, mut items) = (start + 1, Vec::new());
    while is_array && at < end {
        let to = source.value_end(at, end);
        let item = &source[source.trimmed(&(at..to))];
        if !item.is_empty() {
            items.push(item.to_string());
        }
        at = to + 1;
    }
    (!items.is_empty()).then_some(items)
}

/// Words in a range that may be names, including those within `${…}` of strings.
fn words_within(text: &str, range: &Range<usize>) -> Vec<Range<usize>> {
    let (mut tokens, inner) = tokens_and_interpolations(text);
    tokens.extend(inner.into_iter().flat_map(|code| code.tokens));
    let is_word = |token: &Range<usize>| {
        range.contains(&token.start)
            && text[token.clone()].starts_with(|c: char| c.is_alphabetic() || c == '_')
    };
    tokens.retain(is_word);
    tokens.sort_by_key(|token| token.start);
    tokens
}

/// Whether a word is the name of a variable, and not that of a property or of an option (`at: 1.0`).
fn is_variable(text: &str, word: &Range<usize>) -> bool {
    let before = text[..word.start].trim_end();
    let behind = text[word.end..].trim_start();
    let is_property = before.ends_with('.') && !before.ends_with("..");
    !is_property && (!behind.starts_with(':') || behind.starts_with("::"))
}

/// The body of a loop with a value in place of the variable.
#[derive(Default)]
struct LoopIteration {
    text: String,
    /// One byte of each inserted value.
    places: Vec<usize>,
}

impl LoopIteration {
    /// Writes a value in place of a word, in parentheses where operator precedence would change its meaning.
    fn insert_value(&mut self, text: &str, word: &Range<usize>, value: &str) {
        let (before, behind) = (text[..word.start].trim_end(), text[word.end..].trim_start());
        let begins = before.ends_with(['(', '[', '{', ',', ';', ':'])
            || before.ends_with('=') && !["==", "!=", "<=", ">="].iter().any(|sign| before.ends_with(sign));
        let ends = behind.starts_with([')', ']', '}', ',', ';']);
        let digits = value.strip_prefix('-').filter(|digits| needs_no_parentheses(digits));
        let is_negative = digits.is_some() && parse_literal(value, &(0..value.len())).is_some();
        let is_summand = is_negative && behind.starts_with(['+', '-', '*', '/', '%']);
        let is_safe = begins && (ends || is_summand) || needs_no_parentheses(value);
        self.places.push(self.text.len() + usize::from(!is_safe));
        self.text += &if is_safe { value.to_string() } else { format!("({value})") };
    }

    /// The text with constant expressions around the inserted values folded into literals.
    fn folded(self) -> String {
        let mut text = self.text;
        for (range, literal) in constant_expressions(&text, &self.places).into_iter().rev() {
            text.replace_range(range, &literal);
        }
        text
    }
}

/// Whether a value needs no parentheses in any expression: it has no operators outside brackets.
fn needs_no_parentheses(value: &str) -> bool {
    let mut depth = 0usize;
    token_ranges(value).into_iter().map(|token| &value[token]).all(|token| {
        match token {
            "(" | "[" | "{" | "#{" => depth += 1,
            ")" | "]" | "}" => depth = depth.saturating_sub(1),
            _ => {}
        }
        let is_plain = |c: char| c.is_alphanumeric() || matches!(c, '_' | '"' | '\'' | '`' | ')' | ']' | '}');
        depth > 0 || token.starts_with(is_plain) || matches!(token, "." | "::")
    })
}

/// Indentation of the line that holds a byte.
fn indent_before(text: &str, at: usize) -> &str {
    let line = text[..at].rfind('\n').map_or(0, |end| end + 1);
    let rest = &text[line..];
    &rest[..blanks(rest)]
}

/// Number of blanks and tabs at the beginning of a text.
fn blanks(text: &str) -> usize {
    text.len() - text.trim_start_matches([' ', '\t']).len()
}

/// The body with the indentation of the loop.
fn dedented(body: &str, indent: &str) -> String {
    let lines: Vec<&str> = body.trim_matches(['\n', '\r']).trim_end().lines().collect();
    let blank = |line: &str| line.len() - line.trim_start().len();
    let own = lines.iter().filter(|line| !line.trim().is_empty()).map(|line| blank(line)).min().unwrap_or(0);
    let cut = lines.iter().map(|line| line.get(own.min(blank(line))..).unwrap_or_default().to_string());
    cut.collect::<Vec<_>>().join(&format!("\n{indent}"))
}
