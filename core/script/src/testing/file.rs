//! Test files, each parsed once for all of its sections, and the statements that the run of one section needs.

use super::{ExpectedDiagnostic, SectionInfo, comments};
use crate::build::ScriptContext;
use crate::diagnostic::Diagnostic;
use crate::limits::Limits;
use crate::parsed::{ParseFailure, ParsedScript};
use rhai::{AST, Engine, Expr, Stmt};
use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

/// A parsed test file.
pub(crate) struct TestFile {
    name: String,
    text: String,
    limits: Limits,
    pub parsed: ParsedScript,
    pub expected: Vec<ExpectedDiagnostic>,
    pub wrong_comments: Vec<Diagnostic>,
    /// The sections, set by the first listing in which no call of `test` has failed.
    listing: OnceLock<Arc<Listing>>,
}

/// The sections of a file, and the statements that each of them needs.
#[derive(Debug)]
pub(crate) struct Listing {
    pub sections: Vec<SectionInfo>,
    /// Index of the `test` statement of each section in the file. `None`: the section is not a plain top-level statement, for
    /// example because a loop or a function calls `test`.
    section_statements: Vec<Option<usize>>,
    /// The statements that the runs of all sections need, each with its index in the file.
    common_statements: Vec<(usize, Stmt)>,
}

impl Listing {
    /// Finds the statements of each section. `calls`: line and column of the call of `test` for each section.
    pub(crate) fn new(
        parsed: &ParsedScript,
        sections: Vec<SectionInfo>,
        calls: &[(usize, usize)],
    ) -> Listing {
        let section_at: BTreeMap<(usize, usize), usize> = calls.iter().copied().zip(0..).collect();
        let mut section_statements = vec![None; sections.len()];
        let mut common_statements = Vec::new();
        let mut shared_variables = BTreeSet::new();
        for (index, statement) in parsed.ast.statements().iter().enumerate() {
            let section = plain_test_call(statement).and_then(|at| section_at.get(&at));
            match section {
                Some(section) => {
                    section_statements[*section] = Some(index);
                    // A variable is shared from the first closure that captures it, whichever section runs.
                    let captures = captured_variables(statement);
                    let captures = captures.filter(|(name, _)| shared_variables.insert(name.clone()));
                    common_statements.extend(captures.map(|(_, share)| (index, share)));
                }
                None => {
                    if let Stmt::Var(variable, ..) = statement {
                        shared_variables.remove(variable.0.name.as_str());
                    }
                    common_statements.push((index, statement.clone()));
                }
            }
        }
        Listing { sections, section_statements, common_statements }
    }

    /// The syntax tree to run one section: the plain top-level `test` statements of all other sections are left out.
    pub(crate) fn ast_of_section(&self, section: usize, parsed: &ParsedScript) -> AST {
        let own = self.section_statements.get(section).copied().flatten();
        let own = own.and_then(|at| Some((at, parsed.ast.statements().get(at)?)));
        let at = own.map_or(usize::MAX, |(at, _)| at);
        let common = |is_wanted: fn(usize, usize) -> bool| {
            let statements = self.common_statements.iter();
            statements.filter(move |(place, _)| is_wanted(*place, at)).map(|(_, statement)| statement)
        };
        let statements =
            common(|place, at| place < at).chain(own.map(|(_, s)| s)).chain(common(|p, at| p > at));
        let mut ast = AST::new(statements.cloned(), parsed.ast.shared_lib().clone());
        if let Some(source) = parsed.ast.source() {
            ast.set_source(source);
        }
        ast
    }
}

/// Line and column of the call of `test` in a plain test statement, which is `test("…", || …)` or `test("…", #{ … }, || …)` with
/// arguments that have no side effects. `None` for other statements.
fn plain_test_call(statement: &Stmt) -> Option<(usize, usize)> {
    let (call, at) = match statement {
        Stmt::FnCall(call, at) => (call, at),
        Stmt::Expr(expr) => match &**expr {
            Expr::FnCall(call, at) => (call, at),
            _ => return None,
        },
        _ => return None,
    };
    let (last, others) = call.args.split_last()?;
    let is_plain = call.name == "test"
        && call.namespace.is_empty()
        && others.iter().all(Expr::is_constant)
        && (last.is_constant() || captures_of_closure(last).is_some());
    is_plain.then_some((at.line()?, at.position()?))
}

/// The `Share` statement of a closure's captured variables: Rhai compiles the closure to `{ share a, b; curry(function, a, b) }`.
fn captures_of_closure(expr: &Expr) -> Option<&Stmt> {
    let Expr::Stmt(block) = expr else { return None };
    match block.statements() {
        [share @ Stmt::Share(..), Stmt::Expr(expr)] => {
            matches!(&**expr, Expr::FnCall(call, _) if call.name == "curry").then_some(share)
        }
        [share @ Stmt::Share(..), Stmt::FnCall(call, _)] => (call.name == "curry").then_some(share),
        _ => None,
    }
}

/// Names and `Share` statements of the variables that the closure of a plain test captures.
fn captured_variables(statement: &Stmt) -> impl Iterator<Item = (String, Stmt)> {
    let call = match statement {
        Stmt::FnCall(call, _) => Some(call),
        Stmt::Expr(expr) => match &**expr {
            Expr::FnCall(call, _) => Some(call),
            _ => None,
        },
        _ => None,
    };
    let share = call.and_then(|call| captures_of_closure(call.args.last()?));
    let variables = match share {
        Some(Stmt::Share(variables)) => variables.to_vec(),
        _ => Vec::new(),
    };
    variables.into_iter().map(|variable| {
        let name = variable.0.name.to_string();
        (name, Stmt::Share(Box::new([variable].into_iter().collect())))
    })
}

/// Cache of recently read test files, because workers run the sections of a file one after the other.
#[derive(Clone, Default)]
pub struct TestFiles(Arc<Mutex<TestFileStore>>);

#[derive(Default)]
struct TestFileStore {
    recent: VecDeque<Arc<TestFile>>,
    /// Sections of each file by its name, with the hash of the text to which they belong.
    listings: BTreeMap<String, (blake3::Hash, Arc<Listing>)>,
}

impl TestFiles {
    /// Maximum number of parsed files, because syntax trees take many times the memory of their text.
    const MAX_FILES: usize = 16;

    pub(crate) fn read(
        &self,
        engine: &Engine,
        context: &ScriptContext,
        name: &str,
        text: &str,
    ) -> Result<Arc<TestFile>, ParseFailure> {
        let is_same = |f: &&Arc<TestFile>| f.name == name && f.text == text && f.limits == context.limits;
        if let Some(known) = self.lock().recent.iter().find(is_same) {
            return Ok(known.clone());
        }
        let parsed = ParsedScript::new(engine, context, name, text)?;
        let (expected, wrong_comments) = comments::parse_expected(name, text);
        let file = Arc::new(TestFile {
            name: name.to_string(),
            text: text.to_string(),
            limits: context.limits.clone(),
            parsed,
            expected,
            wrong_comments,
            listing: OnceLock::new(),
        });
        let mut store = self.lock();
        if let Some((_, listing)) = store.listings.get(name).filter(|(hash, _)| *hash == file.hash()) {
            // The new file has no listing yet, so this cannot fail.
            let _ = file.listing.set(listing.clone());
        }
        store.recent.push_front(file.clone());
        store.recent.truncate(Self::MAX_FILES);
        Ok(file)
    }

    /// Stores the sections of a file.
    pub(crate) fn store_listing(&self, file: &TestFile, listing: Listing) {
        let listing = Arc::new(listing);
        self.lock().listings.insert(file.name.clone(), (file.hash(), listing.clone()));
        // If a listing is already set, it is equal.
        let _ = file.listing.set(listing);
    }

    fn lock(&self) -> std::sync::MutexGuard<'_, TestFileStore> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl TestFile {
    /// The sections of the file, if they are known.
    pub(crate) fn listing(&self) -> Option<&Arc<Listing>> {
        self.listing.get()
    }

    /// The hash of everything that determines the sections of the file.
    fn hash(&self) -> blake3::Hash {
        blake3::hash(format!("{:?}{}", self.limits, self.text).as_bytes())
    }
}

impl std::fmt::Debug for TestFiles {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} test files", self.lock().listings.len())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Number of statements in the run of each section.
    fn statement_counts(text: &str, calls: &[(usize, usize)]) -> Vec<usize> {
        let mut engine = Engine::new_raw();
        engine.set_allow_shadowing(true);
        let ast = engine.compile(text).unwrap();
        let parsed = ParsedScript {
            ast,
            functions: Arc::default(),
            function_ends: Arc::default(),
            clips_only: Vec::new(),
            unknown: Vec::new(),
        };
        let section = |index: usize| SectionInfo {
            index,
            name: index.to_string(),
            file: String::new(),
            line: calls[index].0,
            end_line: calls[index].0,
            skip: None,
            fails: None,
            tags: Vec::new(),
        };
        let listing = Listing::new(&parsed, (0..calls.len()).map(section).collect(), calls);
        (0..calls.len()).map(|i| listing.ast_of_section(i, &parsed).statements().len()).collect()
    }

    #[test]
    fn the_run_of_a_section_has_the_common_statements_and_its_own() {
        let common = "let n = 1;\nlet m = 2;\n";
        let plain: String =
            (0..50).map(|i| format!("test(\"{i}\", #{{ tags: [\"a\"] }}, || 1);\n")).collect();
        let calls: Vec<_> = (0..50).map(|i| (i + 3, 1)).collect();
        assert_eq!(statement_counts(&(format!("{common}{plain}")), &calls), vec![3; 50]);
        // Each captured variable adds one statement, however often it is captured.
        let captures: String = (0..50).map(|i| format!("test(\"{i}\", || n + m);\n")).collect();
        let counts = statement_counts(&(format!("{common}{captures}")), &calls);
        assert!(counts.iter().all(|count| (3..=5).contains(count)), "{counts:?}");
    }

    #[test]
    fn test_calls_with_possible_side_effects_are_kept() {
        for text in
            ["test(f(), || 1);", "test(\"a\", f());", "x.test(\"a\", || 1);", "if x { test(\"a\", || 1); }"]
        {
            let text = format!("let x = 1; fn f() {{ 1 }}\n{text}\ntest(\"b\", || 2);");
            assert_eq!(statement_counts(&text, &[(2, 1), (3, 1)])[1], 3, "{text}");
        }
    }
}
