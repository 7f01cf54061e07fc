//! What a script makes and never uses.

use super::Remark;
use crate::build::Build;
use crate::call::Place;
use rhai::{AST, ASTNode, Stmt};

/// A variable of the script that nothing reads.
pub struct Declared {
    name: String,
    at: Place,
}

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

/// Variables whose name stands nowhere else in the file, not even in a comment.
pub fn declared(ast: &AST, file: &str, text: &str) -> Vec<Declared> {
    let mut found: Vec<Declared> = Vec::new();
    ast.walk(&mut |nodes| {
        if let Some(ASTNode::Stmt(Stmt::Var(variable, _, position))) = nodes.last()
            && let (Some(line), Some(column)) = (position.line(), position.position())
        {
            let name = variable.0.name.as_str();
            let rest = text.lines().skip(line - 1).collect::<Vec<_>>().join("\n");
            let from: usize = rest.chars().take(column - 1).map(char::len_utf8).sum();
            let statement = rest.get(from..).unwrap_or("").split(';').next().unwrap_or("");
            let staged = STAGED.iter().any(|call| statement.contains(call));
            if !staged && !name.starts_with('_') && words(text, name) == 1 {
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

/// How often a word stands in a text.
fn words(text: &str, word: &str) -> usize {
    let part = |c: char| c.is_alphanumeric() || c == '_';
    text.match_indices(word)
        .filter(|(at, _)| {
            !text[..*at].chars().next_back().is_some_and(part)
                && !text[at + word.len()..].chars().next().is_some_and(part)
        })
        .count()
}

pub fn look(build: &Build, found: &mut Vec<Remark>) {
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
        // What could not be read is reported as an error.
        if load.load.ready().is_none() {
            continue;
        }
        let (name, at) = (&load.load.name, &load.load.at);
        found.push(match load.made {
            true => {
                let text = format!("the {name} is made, but nothing is cast from it");
                Remark::warning("unused_load", at, text)
            }
            false => {
                let text =
                    format!("\"{name}\" is loaded, but nothing is cast from it and no clip of it is played");
                Remark::warning("unused_load", at, text).hint("leave it out: loading takes time")
            }
        });
    }
    for variable in &build.declared {
        // A load that is not used is reported already.
        if found.iter().any(|r| r.rule == "unused_load" && r.place.line == variable.at.line) {
            continue;
        }
        let text = format!("the variable \"{}\" is never used", variable.name);
        found.push(
            Remark::note("unused_variable", &variable.at, text)
                .hint(format!("call it _{} where that is meant", variable.name)),
        );
    }
}

#[cfg(test)]
mod tests {
    #[test]
    fn words_are_counted_whole() {
        assert_eq!(super::words("let a = ab + a_b + a;\n// a", "a"), 3);
        assert_eq!(super::words("läuft; auf; auf", "auf"), 2);
    }
}
