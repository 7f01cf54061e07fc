//! Things that a script makes and never uses.

use super::PlacedFinding;
use crate::api_error::Place;
use crate::build::{Build, Declared};
use rhai::{AST, ASTNode, Stmt};
use std::collections::{HashMap, HashSet};

/// Calls that put something on stage: a name for it is good for the reader, used or not.
const STAGED: [&str; 12] = [
    "cast(",
    "camera(",
    "sun(",
    "point(",
    "spot(",
    "effect(",
    ".play(",
    ".then(",
    ".look_at(",
    ".attach(",
    "param(",
    "import",
];

/// Variables whose name stands nowhere else in the file, not even in a comment. Takes time proportional to the file's length.
pub fn declared(ast: &AST, file: &str, text: &str) -> Vec<Declared> {
    let (words, statements) = (words(text), Statements::of(text));
    let mut found: Vec<Declared> = Vec::new();
    ast.walk(&mut |nodes| {
        if let Some(ASTNode::Stmt(Stmt::Var(variable, _, position))) = nodes.last()
            && let (Some(line), Some(column)) = (position.line(), position.position())
        {
            let name = variable.0.name.as_str();
            let unused = || !name.starts_with('_') && words.get(name) == Some(&1);
            if unused() && !statements.stages((line, column)) {
                found.push(Declared {
                    name: name.to_string(),
                    at: Place { file: file.to_string(), line, column },
                });
            }
        }
        true
    });
    found
}

/// How often each word stands in a text.
fn words(text: &str) -> HashMap<&str, usize> {
    let mut counts = HashMap::new();
    for word in text.split(|c: char| !c.is_alphanumeric() && c != '_').filter(|word| !word.is_empty()) {
        *counts.entry(word).or_default() += 1;
    }
    counts
}

/// Line and column from 1, as Rhai counts them.
type At = (usize, usize);

/// Ends of the statements of a text, and beginnings of calls of [`STAGED`]; sorted. Places and not bytes: finding the byte of
/// each variable takes time proportional to the length of its line.
struct Statements {
    ends: Vec<At>,
    staged: Vec<At>,
}

impl Statements {
    fn of(text: &str) -> Statements {
        let mut statements = Statements { ends: Vec::new(), staged: Vec::new() };
        let (mut line, mut column) = (1, 1);
        for (byte, c) in text.char_indices() {
            if c == ';' {
                statements.ends.push((line, column));
            }
            if STAGED.iter().any(|call| text[byte..].starts_with(call)) {
                statements.staged.push((line, column));
            }
            (line, column) = if c == '\n' { (line + 1, 1) } else { (line, column + 1) };
        }
        statements
    }

    /// Whether the statement that begins at a place puts something on stage.
    fn stages(&self, from: At) -> bool {
        let next = |places: &[At]| places.get(places.partition_point(|at| *at < from)).copied();
        next(&self.staged).is_some_and(|call| next(&self.ends).is_none_or(|end| call < end))
    }
}

pub fn look(build: &Build, found: &mut Vec<PlacedFinding>) {
    for load in build.loads.iter().filter(|l| !l.used) {
        // Another call may have got the same asset and used it.
        let shared = |other: &&crate::build::LoadDraft| {
            let same = || Some((other.load.ready()?, load.load.ready()?));
            let same = same().is_some_and(|(a, b)| std::sync::Arc::ptr_eq(a, b));
            other.used && (same || other.load.at == load.load.at)
        };
        if build.loads.iter().any(|other| shared(&other)) {
            continue;
        }
        // A failed load is reported as an error.
        if load.load.ready().is_none() {
            continue;
        }
        let (name, at) = (&load.load.name, &load.load.at);
        found.push(match load.made {
            true => {
                let text = format!("the {name} is made, but nothing is cast from it");
                PlacedFinding::warning("unused_load", at, text)
            }
            false => {
                let text =
                    format!("\"{name}\" is loaded, but nothing is cast from it and no clip of it is played");
                PlacedFinding::warning("unused_load", at, text).hint("leave it out: loading takes time")
            }
        });
    }
    // A load that is not used is reported already.
    let reported: HashSet<usize> =
        found.iter().filter(|r| r.rule == "unused_load").map(|r| r.place.line).collect();
    for variable in build.declared.iter().filter(|v| !reported.contains(&v.at.line)) {
        let text = format!("the variable \"{}\" is never used", variable.name);
        found.push(
            PlacedFinding::note("unused_variable", &variable.at, text)
                .hint(format!("call it _{} where that is meant", variable.name)),
        );
    }
}

#[cfg(test)]
mod tests {
    use super::{Statements, declared, words};

    #[test]
    fn words_are_counted_whole() {
        assert_eq!(words("let a = ab + a_b + a;\n// a")["a"], 3);
        assert_eq!(words("läuft; auf; auf")["auf"], 2);
        assert_eq!(words("läuft; auf; auf").get("uft"), None);
    }

    #[test]
    fn a_call_counts_until_the_statement_ends() {
        let text = "let a = 1; let b = cast(x); let c = 2";
        let stages = |part: &str| Statements::of(text).stages((1, 1 + text.find(part).unwrap()));
        assert_eq!([stages("a ="), stages("b ="), stages("c =")], [false, true, false]);
    }

    #[test]
    fn each_place_is_found_in_lines_of_any_letters() {
        let text = "/* ä€ */ let a = 1;\r\nlet used = 2; let _b = used;\n\
                    if used > 1 { let c = 3; }\nlet d = sun(1); let e = 2; // e";
        let mut engine = rhai::Engine::new();
        engine.set_optimization_level(rhai::OptimizationLevel::None);
        let ast = engine.compile(text).unwrap();
        let found: Vec<_> =
            declared(&ast, "f", text).iter().map(|d| (d.name.clone(), d.at.line, d.at.column)).collect();
        assert_eq!(found, [("a".to_string(), 1, 10), ("c".to_string(), 3, 15)]);
    }
}
