//! A test file that is parsed once for all of its sections, and the statements that the run of one section needs.

use super::{ExpectedDiagnostic, SectionInfo, comments};
use crate::build::ScriptContext;
use crate::diagnostic::Diagnostic;
use crate::limits::Limits;
use crate::parsed::{ParseFailure, ParsedScript};
use rhai::{AST, Engine, Expr, Stmt};
use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

pub(crate) struct TestFile {
    name: String,
    text: String,
    limits: Limits,
    pub parsed: ParsedScript,
    pub expected: Vec<ExpectedDiagnostic>,
    pub wrong_comments: Vec<Diagnostic>,
    /// Set by the first listing in which no call of `test` was refused.
    listing: OnceLock<Arc<Listing>>,
}

/// The sections of a file, and the statements that each of them needs.
#[derive(Debug)]
pub struct Listing {
    pub sections: Vec<SectionInfo>,
    /// Index of the `test` statement of each section in the file. `None`: the section is not a plain top-level statement, for
    /// example because a loop or a function calls `test`.
    own: Vec<Option<usize>>,
    /// The statements outside all sections, each with its index in the file.
    common: Vec<(usize, Stmt)>,
}

impl Listing {
    /// `calls`: line and column of the `test` of each section.
    pub fn new(parsed: &ParsedScript, sections: Vec<SectionInfo>, calls: &[(usize, usize)]) -> Listing {
        let section_at: BTreeMap<(usize, usize), usize> = calls.iter().copied().zip(0..).collect();
        let mut own = vec![None; sections.len()];
        let mut common = Vec::new();
        let mut shared = BTreeSet::new();
        for (index, statement) in parsed.ast.statements().iter().enumerate() {
            let section = plain_test(statement).and_then(|at| section_at.get(&at));
            match section {
                Some(section) => {
                    own[*section] = Some(index);
                    // A variable is shared from the first closure that captures it, whichever section runs.
                    let captures = captures(statement).filter(|(name, _)| shared.insert(name.clone()));
                    common.extend(captures.map(|(_, share)| (index, share)));
                }
                None => {
                    if let Stmt::Var(variable, ..) = statement {
                        shared.remove(variable.0.name.as_str());
                    }
                    common.push((index, statement.clone()));
                }
            }
        }
        Listing { sections, own, common }
    }

    /// The syntax tree with one section only: the plain top-level `test` statements of all others are left out.
    pub fn alone(&self, section: usize, parsed: &ParsedScript) -> AST {
        let own = self.own.get(section).copied().flatten();
        let own = own.and_then(|at| Some((at, parsed.ast.statements().get(at)?)));
        let at = own.map_or(usize::MAX, |(at, _)| at);
        let common = |wanted: fn(usize, usize) -> bool| {
            self.common.iter().filter(move |(place, _)| wanted(*place, at)).map(|(_, statement)| statement)
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

/// Line and column of a plain test statement: `test("…", || …)` or `test("…", #{ … }, || …)` whose arguments have no side
/// effects.
fn plain_test(statement: &Stmt) -> Option<(usize, usize)> {
    let (call, at) = match statement {
        Stmt::FnCall(call, at) => (call, at),
        Stmt::Expr(expr) => match &**expr {
            Expr::FnCall(call, at) => (call, at),
            _ => return None,
        },
        _ => return None,
    };
    let (last, others) = call.args.split_last()?;
    let plain = call.name == "test"
        && call.namespace.is_empty()
        && others.iter().all(Expr::is_constant)
        && (last.is_constant() || closure(last).is_some());
    plain.then_some((at.line()?, at.position()?))
}

/// The `Share` statement of a closure's captured variables: Rhai compiles the closure to `{ share a, b; curry(function, a, b) }`.
fn closure(expr: &Expr) -> Option<&Stmt> {
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
fn captures(statement: &Stmt) -> impl Iterator<Item = (String, Stmt)> {
    let call = match statement {
        Stmt::FnCall(call, _) => Some(call),
        Stmt::Expr(expr) => match &**expr {
            Expr::FnCall(call, _) => Some(call),
            _ => None,
        },
        _ => None,
    };
    let share = call.and_then(|call| closure(call.args.last()?));
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
    /// Maximum number of parsed files: syntax trees take many times the memory of their text.
    const MOST: usize = 16;

    pub(crate) fn read(
        &self,
        engine: &Engine,
        shared: &ScriptContext,
        name: &str,
        text: &str,
    ) -> Result<Arc<TestFile>, ParseFailure> {
        let same = |f: &&Arc<TestFile>| f.name == name && f.text == text && f.limits == shared.limits;
        if let Some(known) = self.lock().recent.iter().find(same) {
            return Ok(known.clone());
        }
        let parsed = ParsedScript::new(engine, shared, name, text)?;
        let (expected, wrong_comments) = comments::parse(name, text);
        let file = Arc::new(TestFile {
            name: name.to_string(),
            text: text.to_string(),
            limits: shared.limits.clone(),
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
        store.recent.truncate(Self::MOST);
        Ok(file)
    }

    /// Stores the sections that a listing has found.
    pub(crate) fn list(&self, file: &TestFile, listing: Listing) {
        let listing = Arc::new(listing);
        self.lock().listings.insert(file.name.clone(), (file.hash(), listing.clone()));
        // A listing that is set already is equal.
        let _ = file.listing.set(listing);
    }

    fn lock(&self) -> std::sync::MutexGuard<'_, TestFileStore> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl TestFile {
    /// The sections of the file, if they are known.
    pub fn listing(&self) -> Option<&Arc<Listing>> {
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
    fn statements(text: &str, calls: &[(usize, usize)]) -> Vec<usize> {
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
        (0..calls.len()).map(|i| listing.alone(i, &parsed).statements().len()).collect()
    }

    #[test]
    fn a_section_alone_has_what_is_common_and_itself() {
        let common = "let n = 1;\nlet m = 2;\n";
        let plain: String =
            (0..50).map(|i| format!("test(\"{i}\", #{{ tags: [\"a\"] }}, || 1);\n")).collect();
        let calls: Vec<_> = (0..50).map(|i| (i + 3, 1)).collect();
        assert_eq!(statements(&(format!("{common}{plain}")), &calls), vec![3; 50]);
        // One statement more for each variable that is captured, however often.
        let captures: String = (0..50).map(|i| format!("test(\"{i}\", || n + m);\n")).collect();
        let alone = statements(&(format!("{common}{captures}")), &calls);
        assert!(alone.iter().all(|count| (3..=5).contains(count)), "{alone:?}");
    }

    #[test]
    fn what_may_do_something_stays() {
        for text in
            ["test(f(), || 1);", "test(\"a\", f());", "x.test(\"a\", || 1);", "if x { test(\"a\", || 1); }"]
        {
            let text = format!("let x = 1; fn f() {{ 1 }}\n{text}\ntest(\"b\", || 2);");
            assert_eq!(statements(&text, &[(2, 1), (3, 1)])[1], 3, "{text}");
        }
    }
}
