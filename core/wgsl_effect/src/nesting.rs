//! Limits the nesting of a text before it is parsed: naga's other parts, and the evaluator here, walk the parser's trees by recursion. A
//! text of a few kilobytes could overflow a thread's stack, which ends the program.

use crate::tokens::Tokens;

/// Largest nesting of an expression or statement, in levels: brackets, operators (each of those in `a + b + c` is one level), members,
/// `else if`s. In builds for tests, `else if`s overflow 2 MiB of stack at 1,500 levels, the others at 4,000 (`tests/effects/deep.rs`).
pub(crate) const MAX_LEVELS: usize = 350;
/// Levels of a bracket, and of `<`, which can be a bracket: the parser calls a dozen nested functions for each. At its own limit of 200
/// brackets it takes up to 1 MiB.
const LEVELS_PER_BRACKET: usize = 5;
/// Largest number of declarations of a text. Each can use another, and naga orders them by recursion: 4,200 structs overflow 2 MiB.
pub(crate) const MAX_DECLARATIONS: usize = 1_000;

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
    /// Levels of the current expression so far.
    expression: usize,
    /// Levels of the deepest expression before it; commas separate expressions.
    deepest: usize,
    /// Number of `else if`s of the current statement so far.
    else_ifs: usize,
}

#[derive(Default)]
struct Scan {
    open: Vec<Level>,
    /// Levels of all open brackets, expressions and statements together.
    levels: usize,
    declarations: usize,
}

/// Refuses a text that is nested too deeply. Brackets that do not match are left to the parser.
pub(crate) fn check(text: &str) -> Result<(), TooDeep> {
    let mut scan = Scan { open: vec![Level::default()], ..Scan::default() };
    let mut before = "";
    for (start, token) in Tokens::of(text) {
        scan.take(token, before);
        before = token;
        let what = if scan.levels > MAX_LEVELS {
            format!(
                "nested more than {MAX_LEVELS} levels deep: each bracket counts {LEVELS_PER_BRACKET}, each operator and else if \
                 of a statement 1; split it with let, or use a loop or switch"
            )
        } else if scan.declarations > MAX_DECLARATIONS {
            format!("more than {MAX_DECLARATIONS} declarations")
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
            // Another statement begins.
            self.levels -= std::mem::take(&mut level.else_ifs);
        }
        match token {
            "(" | "[" | "{" => {
                self.open.push(Level::default());
                self.levels += LEVELS_PER_BRACKET;
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
                level.expression += LEVELS_PER_BRACKET;
                self.levels += LEVELS_PER_BRACKET;
            }
            _ if token.starts_with(|c: char| "+-*/%&|^!~<>=.".contains(c)) => {
                level.expression += 1;
                self.levels += 1;
            }
            _ => {}
        }
    }

    /// A bracket is one level deeper than the deepest expression in it; a block ends the statement to which it belongs.
    fn close(&mut self, is_block: bool) {
        let Some(inner) = self.open.pop() else { return };
        let Some(level) = self.open.last_mut() else { return };
        self.levels -= LEVELS_PER_BRACKET + inner.expression + inner.else_ifs + level.expression;
        let within = inner.deepest.max(inner.expression);
        level.expression = if is_block { 0 } else { level.expression.max(within) + 1 };
        self.levels += level.expression;
    }
}
