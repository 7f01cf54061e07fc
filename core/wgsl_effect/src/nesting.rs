//! How deeply a text is nested, found before it is parsed: naga's parser hands on trees that its other parts walk by
//! recursion, and so does the evaluator here. A text of a few kilobytes could use up a thread's stack, which ends the program.

/// Levels of nesting of an expression or statement: brackets, operators (of `a + b + c` each is one level more), members,
/// `else if`s. In builds for tests `else if`s overflow 2 MiB of stack at 1,500 levels, the others at 4,000 (`tests/deep.rs`).
pub(crate) const MOST_LEVELS: usize = 350;
/// Levels of a bracket, and of a `<`, which can be one: the parser goes down a dozen functions for each. At its own limit of 200 it
/// takes up to 1 MiB.
const BRACKET: usize = 5;
/// Declarations of a text. Each can use another, and naga orders them by recursion: 4,200 structs overflow 2 MiB.
pub(crate) const MOST_DECLARATIONS: usize = 1_000;

/// The characters that end a line comment: all line breaks of WGSL, so that no code hides behind one.
const LINE_ENDS: [char; 7] = ['\n', '\u{b}', '\u{c}', '\r', '\u{85}', '\u{2028}', '\u{2029}'];

/// The place where a text is nested too deeply, with the message.
#[derive(Debug, PartialEq, Eq)]
pub(crate) struct TooDeep {
    /// Column in characters, from 1.
    pub line: usize,
    pub column: usize,
    pub message: String,
}

/// The state between an opening and a closing bracket.
#[derive(Clone, Copy, Default)]
struct Level {
    /// Levels of the expression so far.
    expression: usize,
    /// The deepest expression before it, among those that commas part.
    deepest: usize,
    /// `else if`s of the statement so far.
    else_ifs: usize,
}

struct Scan<'a> {
    text: &'a str,
    /// Byte.
    at: usize,
    open: Vec<Level>,
    /// Levels of all that is open.
    levels: usize,
    declarations: usize,
}

/// Refuses a text that is nested too deeply. Brackets that do not match are left to the parser.
pub fn check(text: &str) -> Result<(), TooDeep> {
    let mut scan = Scan { text, at: 0, open: vec![Level::default()], levels: 0, declarations: 0 };
    let mut before = "";
    while let Some((start, token)) = scan.token() {
        scan.take(token, before);
        before = token;
        let what = if scan.levels > MOST_LEVELS {
            format!(
                "nested more than {MOST_LEVELS} levels deep: a bracket counts {BRACKET}, an operator or else if of one \
                 statement 1; part it into several with let, or use a loop or switch"
            )
        } else if scan.declarations > MOST_DECLARATIONS {
            format!("more than {MOST_DECLARATIONS} declarations")
        } else {
            continue;
        };
        let before = &text[..start];
        let line_start = before.rfind('\n').map_or(0, |n| n + 1);
        return Err(TooDeep {
            line: before.matches('\n').count() + 1,
            column: before[line_start..].chars().count() + 1,
            message: what,
        });
    }
    Ok(())
}

impl<'a> Scan<'a> {
    /// The next token and where it begins; comments and blanks are passed over.
    fn token(&mut self) -> Option<(usize, &'a str)> {
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
                // 1.5, and not 1.x
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

    fn take(&mut self, token: &str, before: &str) {
        let is_global = self.open.len() == 1;
        let Some(level) = self.open.last_mut() else { return };
        if before == "}" && token != "else" {
            // Another statement.
            self.levels -= std::mem::take(&mut level.else_ifs);
        }
        match token {
            "(" | "[" | "{" => {
                self.open.push(Level::default());
                self.levels += BRACKET;
            }
            ")" | "]" | "}" if !is_global => self.close(token == "}"),
            "," | ";" => {
                level.deepest = level.deepest.max(level.expression);
                self.levels -= std::mem::take(&mut level.expression);
            }
            "if" if before == "else" => {
                level.else_ifs += 1;
                self.levels += 1;
            }
            "fn" | "struct" | "const" | "alias" | "var" | "override" if is_global => self.declarations += 1,
            "<" => {
                level.expression += BRACKET;
                self.levels += BRACKET;
            }
            _ if token.starts_with(|c: char| "+-*/%&|^!~<>=.".contains(c)) => {
                level.expression += 1;
                self.levels += 1;
            }
            _ => {}
        }
    }

    /// The content of a bracket is one level deeper than its deepest part; a block ends the statement that it belongs to.
    fn close(&mut self, is_block: bool) {
        let Some(inner) = self.open.pop() else { return };
        let Some(level) = self.open.last_mut() else { return };
        self.levels -= BRACKET + inner.expression + inner.else_ifs + level.expression;
        let within = inner.deepest.max(inner.expression);
        level.expression = if is_block { 0 } else { level.expression.max(within) + 1 };
        self.levels += level.expression;
    }
}

/// Bytes of a comment, in which others may begin and end.
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
