//! Finds variables and assets that a script makes and never uses.

use super::PlacedFinding;
use super::counted::{Drafts, LineColumn, SortedPositions, Source};
use crate::api_error::Place;
use crate::build::UnusedVariable;
use crate::def::{Def, Defs, ResultType};
use crate::value::HandleKind;
use std::collections::{BTreeSet, HashSet};
use std::sync::Arc;

/// Calls that put something on stage, apart from functions that return an object of the stage. An unused variable for their
/// result is no finding, because its name documents the script.
const STAGING_CALLS: [&str; 6] = [".play(", ".then(", ".look_at(", ".attach(", "param(", "import"];

/// [`STAGING_CALLS`], and the functions that return an actor, a camera, a light or an effect.
fn staging_calls(defs: &Defs) -> Vec<String> {
    use HandleKind::{Actor, Camera, Effect, Light};
    let returns_stage_object = |def: &&Def| {
        def.on == HandleKind::None
            && matches!(def.returns, ResultType::Handle(Actor | Camera | Light | Effect))
    };
    let functions = defs.iter().filter(returns_stage_object).map(|def| format!("{}(", def.name));
    functions.chain(STAGING_CALLS.map(str::to_string)).collect()
}

/// Variables whose name occurs only once in the file, comments included. Takes time proportional to the length of the file.
pub(super) fn unused_variables(source: &Source, file: &str, defs: &Defs) -> Vec<UnusedVariable> {
    let (words, statements) = (source.count_words(), Statements::of(source, &staging_calls(defs)));
    let mut found: Vec<UnusedVariable> = Vec::new();
    source.visit_variables(|name, (line, column)| {
        let is_unused = || !name.starts_with('_') && words.get(name) == Some(&1);
        if is_unused() && !statements.has_staging_call((line, column)) {
            let at = Place { file: file.to_string(), line, column };
            found.push(UnusedVariable { name: name.to_string(), at });
        }
    });
    found
}

/// Places where statements end, and where calls that put something on stage begin.
struct Statements {
    ends: SortedPositions,
    staging_calls: SortedPositions,
}

impl Statements {
    fn of(source: &Source, staging_calls: &[String]) -> Statements {
        let staging_calls: Vec<&str> = staging_calls.iter().map(String::as_str).collect();
        let ends = source.places_of(&[";"]);
        Statements { ends, staging_calls: source.places_of(&staging_calls) }
    }

    /// Whether the statement that begins at a place puts something on stage.
    fn has_staging_call(&self, from: LineColumn) -> bool {
        let end = self.ends.first_from(from);
        self.staging_calls.first_from(from).is_some_and(|call| end.is_none_or(|end| call < end))
    }
}

/// Finds loaded or made assets, and variables, that the script never uses.
pub(super) fn check_unused(drafts: &Drafts, found: &mut Vec<PlacedFinding>) {
    let used = || drafts.loads().filter(|load| load.is_used);
    let used_assets: HashSet<_> = used().filter_map(|load| load.load.ready()).map(Arc::as_ptr).collect();
    let used_places: BTreeSet<&Place> = used().map(|load| &load.load.at).collect();
    for load in drafts.loads().filter(|l| !l.is_used) {
        // Another call may have loaded the same asset and used it.
        let is_asset_used = load.load.ready().is_some_and(|asset| used_assets.contains(&Arc::as_ptr(asset)));
        if is_asset_used || used_places.contains(&load.load.at) {
            continue;
        }
        // A failed load is reported as an error.
        if load.load.ready().is_none() {
            continue;
        }
        let (name, at) = (&load.load.name, &load.load.at);
        found.push(match load.is_procedural {
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
    // An unused variable for an unused load is not reported again.
    let reported: HashSet<usize> =
        found.iter().filter(|r| r.rule == "unused_load").map(|r| r.place.line).collect();
    for variable in drafts.unused_variables().filter(|v| !reported.contains(&v.at.line)) {
        let text = format!("the variable \"{}\" is never used", variable.name);
        found.push(
            PlacedFinding::note("unused_variable", &variable.at, text)
                .hint(format!("name it _{} if that is intended", variable.name)),
        );
    }
}

#[cfg(test)]
mod tests {
    use super::{
        Arc, Drafts, Place, PlacedFinding, Source, Statements, check_unused, staging_calls, unused_variables,
    };
    use crate::api::defs;
    use crate::build::{LoadDraft, StageDraft};
    use crate::lint::{Places, counted};
    use crate::load::Load;
    use choreo_asset::Asset;
    use rhai::AST;

    #[test]
    fn count_words_counts_whole_words_only() {
        let count =
            |text: &str, word: &str| Source::new(&AST::empty(), text).count_words().get(word).copied();
        assert_eq!(count("let a = ab + a_b + a;\n// a", "a"), Some(3));
        assert_eq!(count("läuft; auf; auf", "auf"), Some(2));
        assert_eq!(count("läuft; auf; auf", "uft"), None);
    }

    #[test]
    fn has_staging_call_looks_up_to_the_end_of_the_statement() {
        let text = "let a = 1; let b = cast(x); let c = 2";
        let ast = AST::empty();
        let statements = Statements::of(&Source::new(&ast, text), &staging_calls(defs()));
        let stages = |part: &str| statements.has_staging_call((1, 1 + text.find(part).unwrap()));
        assert_eq!([stages("a ="), stages("b ="), stages("c =")], [false, true, false]);
    }

    #[test]
    fn unused_variables_have_their_columns_in_characters() {
        let text = "/* ä€ */ let a = 1;\r\nlet used = 2; let _b = used;\n\
                    if used > 1 { let c = 3; }\nlet d = sun(1); let e = 2; // e";
        let mut engine = rhai::Engine::new();
        engine.set_optimization_level(rhai::OptimizationLevel::None);
        let ast = engine.compile(text).unwrap();
        let found = unused_variables(&Source::new(&ast, text), "f", defs());
        let found: Vec<_> = found.iter().map(|d| (d.name.clone(), d.at.line, d.at.column)).collect();
        assert_eq!(found, [("a".to_string(), 1, 10), ("c".to_string(), 3, 15)]);
    }

    /// A script of `statements` statements, each with an unused variable between calls. The text `between` separates them.
    fn script(statements: usize, between: &str) -> String {
        let statement =
            |i: usize| format!("cast(x); let variable_{i:06} = {i}; let kept = sun({i}); /* ä */{between}");
        (0..statements).map(statement).collect()
    }

    /// Number of steps that the rule about variables takes.
    fn steps_for(text: &str, found: usize) -> usize {
        let mut engine = rhai::Engine::new();
        engine.set_optimization_level(rhai::OptimizationLevel::None);
        let ast = engine.compile(text).unwrap();
        counted::take_step_count();
        assert_eq!(unused_variables(&Source::new(&ast, text), "f", defs()).len(), found);
        counted::take_step_count()
    }

    /// Asserts that the number of steps grows linearly with the size, apart from the logarithm of a search.
    fn assert_linear(name: &str, steps: impl Fn(usize) -> usize) {
        let [short, long] = [250, 2_000].map(|size| steps(size) as f64 / size as f64);
        assert!(short > 1.0, "{name}: nothing is counted");
        assert!(long < 1.25 * short, "{name}: {short} steps each, then {long}");
    }

    /// Regression: 16,000 lines took 10 s when the place of each variable was searched for in the whole text.
    #[test]
    fn steps_of_rules_grow_linearly_with_the_script() {
        assert_linear("lines", |n| steps_for(&script(n, "\n"), n));
        assert_linear("one line", |n| steps_for(&script(n, " "), n));
        assert_linear("findings", |n| {
            let text: Arc<str> = script(n, "\n").into();
            let place = |line| Place { file: "f".into(), line, column: 1 };
            let finding = |line| PlacedFinding::note("unused_variable", &place(line), "unused".into());
            let script_findings = (1..=n).map(finding).collect();
            let sources = Arc::new([("f".to_string(), text)].into());
            counted::take_step_count();
            let found = Places { script_findings, sources, ..Places::default() }.findings(&[]);
            assert!(found.len() == n && found[n - 1].source_line.contains(&format!("variable_{:06}", n - 1)));
            counted::take_step_count()
        });
        assert_linear("loads", |n| {
            let load = |line| {
                let asset = Arc::new(Asset { name: format!("shape {line}"), ..Asset::default() });
                let at = Place { file: "f".into(), line, column: 1 };
                let is_used = line % 2 == 0;
                LoadDraft {
                    load: Arc::new(Load::procedural(&asset, &at)),
                    is_procedural: true,
                    clips_only: false,
                    is_used,
                }
            };
            let mut stage_draft = StageDraft::default();
            stage_draft.loads.extend((0..n).map(load));
            let mut found = Vec::new();
            counted::take_step_count();
            check_unused(&Drafts::new(&stage_draft), &mut found);
            assert_eq!(found.len(), n / 2);
            counted::take_step_count()
        });
    }
}
