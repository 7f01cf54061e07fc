//! Things that a script makes and never uses.

use super::{PlacedFinding, steps};
use crate::api_error::Place;
use crate::build::{Build, Declared};
use crate::def::{Def, Defs, Gives};
use crate::value::HandleKind;
use rhai::{AST, ASTNode, Stmt};
use std::collections::{BTreeSet, HashMap, HashSet};
use std::sync::Arc;

/// Calls that put something on stage, beside functions that give what stands there: a name for it is good for the reader, used or
/// not.
const STAGED: [&str; 6] = [".play(", ".then(", ".look_at(", ".attach(", "param(", "import"];

/// [`STAGED`], and the functions that give an actor, a camera, a light or an effect.
fn staged(defs: &Defs) -> Vec<String> {
    use HandleKind::{Actor, Camera, Effect, Light};
    let gives = |def: &&Def| {
        def.on == HandleKind::None && matches!(def.gives, Gives::A(Actor | Camera | Light | Effect))
    };
    let functions = defs.iter().filter(gives).map(|def| format!("{}(", def.name));
    functions.chain(STAGED.map(str::to_string)).collect()
}

/// Variables whose name stands nowhere else in the file, not even in a comment. Takes time proportional to the file's length.
pub fn declared(ast: &AST, file: &str, text: &str, defs: &Defs) -> Vec<Declared> {
    let (words, statements) = (words(text), Statements::of(text, &staged(defs)));
    let mut found: Vec<Declared> = Vec::new();
    ast.walk(&mut |nodes| {
        steps::count(1);
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
    steps::count(text.len());
    for word in text.split(|c: char| !c.is_alphanumeric() && c != '_').filter(|word| !word.is_empty()) {
        *counts.entry(word).or_default() += 1;
    }
    counts
}

/// Line and column from 1, as Rhai counts them.
type At = (usize, usize);

/// Ends of the statements of a text, and beginnings of calls that put something on stage; sorted. Places and not bytes: finding the byte of
/// each variable takes time proportional to the length of its line.
struct Statements {
    ends: Vec<At>,
    staged: Vec<At>,
}

impl Statements {
    fn of(text: &str, staged: &[String]) -> Statements {
        let mut statements = Statements { ends: Vec::new(), staged: Vec::new() };
        let (mut line, mut column) = (1, 1);
        for (byte, c) in text.char_indices() {
            if c == ';' {
                statements.ends.push((line, column));
            }
            steps::count(1);
            if staged.iter().any(|call| text[byte..].starts_with(call.as_str())) {
                statements.staged.push((line, column));
            }
            (line, column) = if c == '\n' { (line + 1, 1) } else { (line, column + 1) };
        }
        statements
    }

    /// Whether the statement that begins at a place puts something on stage.
    fn stages(&self, from: At) -> bool {
        let next = |places: &[At]| {
            let is_before = |at: &At| {
                steps::count(1);
                *at < from
            };
            places.get(places.partition_point(is_before)).copied()
        };
        next(&self.staged).is_some_and(|call| next(&self.ends).is_none_or(|end| call < end))
    }
}

pub fn look(build: &Build, found: &mut Vec<PlacedFinding>) {
    let used = || build.loads.iter().inspect(|_| steps::count(1)).filter(|load| load.used);
    let used_assets: HashSet<_> = used().filter_map(|load| load.load.ready()).map(Arc::as_ptr).collect();
    let used_places: BTreeSet<&Place> = used().map(|load| &load.load.at).collect();
    for load in build.loads.iter().filter(|l| !l.used) {
        steps::count(1);
        // Another call may have got the same asset and used it.
        let shared = load.load.ready().is_some_and(|asset| used_assets.contains(&Arc::as_ptr(asset)));
        if shared || used_places.contains(&load.load.at) {
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
    use super::{Arc, Build, Place, PlacedFinding, Statements, declared, look, staged, words};
    use crate::api::defs;
    use crate::build::LoadDraft;
    use crate::lint::{Places, steps};
    use crate::load::Load;
    use choreo_asset::Asset;

    #[test]
    fn words_are_counted_whole() {
        assert_eq!(words("let a = ab + a_b + a;\n// a")["a"], 3);
        assert_eq!(words("läuft; auf; auf")["auf"], 2);
        assert_eq!(words("läuft; auf; auf").get("uft"), None);
    }

    #[test]
    fn a_call_counts_until_the_statement_ends() {
        let text = "let a = 1; let b = cast(x); let c = 2";
        let stages =
            |part: &str| Statements::of(text, &staged(defs())).stages((1, 1 + text.find(part).unwrap()));
        assert_eq!([stages("a ="), stages("b ="), stages("c =")], [false, true, false]);
    }

    #[test]
    fn each_place_is_found_in_lines_of_any_letters() {
        let text = "/* ä€ */ let a = 1;\r\nlet used = 2; let _b = used;\n\
                    if used > 1 { let c = 3; }\nlet d = sun(1); let e = 2; // e";
        let mut engine = rhai::Engine::new();
        engine.set_optimization_level(rhai::OptimizationLevel::None);
        let ast = engine.compile(text).unwrap();
        let found: Vec<_> = declared(&ast, "f", text, defs())
            .iter()
            .map(|d| (d.name.clone(), d.at.line, d.at.column))
            .collect();
        assert_eq!(found, [("a".to_string(), 1, 10), ("c".to_string(), 3, 15)]);
    }

    /// A script of so many statements, each with a variable that nothing uses between calls, with this between them.
    fn script(statements: usize, between: &str) -> String {
        let one =
            |i: usize| format!("cast(x); let variable_{i:06} = {i}; let kept = sun({i}); /* ä */{between}");
        (0..statements).map(one).collect()
    }

    /// Steps of the rule about variables.
    fn steps_for(text: &str, found: usize) -> usize {
        let mut engine = rhai::Engine::new();
        engine.set_optimization_level(rhai::OptimizationLevel::None);
        let ast = engine.compile(text).unwrap();
        steps::taken();
        assert_eq!(declared(&ast, "f", text, defs()).len(), found);
        steps::taken()
    }

    /// Whether something takes no more than in proportion to its size, but for the logarithm of a search.
    fn is_linear(name: &str, steps: impl Fn(usize) -> usize) {
        let [short, long] = [250, 2_000].map(|size| steps(size) as f64 / size as f64);
        assert!(short > 1.0, "{name}: nothing is counted");
        assert!(long < 1.25 * short, "{name}: {short} steps each, then {long}");
    }

    /// 16,000 lines once took 10 s, since the place of each variable was looked for in the whole text.
    #[test]
    fn what_long_scripts_take_grows_with_their_length() {
        is_linear("lines", |n| steps_for(&script(n, "\n"), n));
        is_linear("one line", |n| steps_for(&script(n, " "), n));
        is_linear("findings", |n| {
            let text: Arc<str> = script(n, "\n").into();
            let place = |line| Place { file: "f".into(), line, column: 1 };
            let finding = |line| PlacedFinding::note("unused_variable", &place(line), "unused".into());
            let script_findings = (1..=n).map(finding).collect();
            let sources = Arc::new([("f".to_string(), text)].into());
            steps::taken();
            let found = Places { script_findings, sources, ..Places::default() }.findings(&[]);
            assert!(found.len() == n && found[n - 1].source_line.contains(&format!("variable_{:06}", n - 1)));
            steps::taken()
        });
        is_linear("loads", |n| {
            let load = |line| {
                let asset = Arc::new(Asset { name: format!("shape {line}"), ..Asset::default() });
                let at = Place { file: "f".into(), line, column: 1 };
                let used = line % 2 == 0;
                LoadDraft { load: Arc::new(Load::made(&asset, &at)), made: true, clips_only: false, used }
            };
            let mut build = Build::default();
            build.loads.extend((0..n).map(load));
            let mut found = Vec::new();
            steps::taken();
            look(&build, &mut found);
            assert_eq!(found.len(), n / 2);
            steps::taken()
        });
    }
}
