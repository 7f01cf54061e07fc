//! How deeply a text is nested, found before it is parsed: naga's parser hands on trees that its other parts walk by
//! recursion, and so does the evaluator here. A text of a few kilobytes could use up a thread's stack, which ends the program.

use crate::tokens::Tokens;

/// Levels of nesting of an expression or statement: brackets, operators (of `a + b + c` each is one level more), members,
/// `else if`s. In builds for tests `else if`s overflow 2 MiB of stack at 1,500 levels, the others at 4,000 (`tests/effects/deep.rs`).
pub(crate) const MOST_LEVELS: usize = 350;
/// Levels of a bracket, and of a `<`, which can be one: the parser goes down a dozen functions for each. At its own limit of 200 it
/// takes up to 1 MiB.
const BRACKET: usize = 5;
/// Declarations of a text. Each can use another, and naga orders them by recursion: 4,200 structs overflow 2 MiB.
pub(crate) const MOST_DECLARATIONS: usize = 1_000;

/// The place where a text is nested too deeply, with the message.
#[derive(Debug, PartialEq, Eq)]
pub(crate) struct TooDeep {
    /// Byte of the text.
    pub at: usize,
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

#[derive(Default)]
struct Scan {
    open: Vec<Level>,
    /// Levels of all that is open.
    levels: usize,
    declarations: usize,
}

/// Refuses a text that is nested too deeply. Brackets that do not match are left to the parser.
pub fn check(text: &str) -> Result<(), TooDeep> {
    let mut scan = Scan { open: vec![Level::default()], ..Scan::default() };
    let mut before = "";
    for (start, token) in Tokens::of(text) {
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
        return Err(TooDeep { at: start, message: what });
    }
    Ok(())
}

impl Scan {
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
