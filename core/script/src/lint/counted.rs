//! Access of rules to the text and drafts of a script, with a counter of steps for tests: characters read, nodes and loads
//! visited, places compared. The steps of a rule must grow linearly with the script.
//!
//! Texts, trees and lists are private to this module, so that no rule can read them uncounted.

use crate::build::{LoadDraft, StageDraft, UnusedVariable};
use rhai::{AST, ASTNode, Stmt};
use std::collections::{BTreeMap, HashMap};
use std::sync::Arc;

/// Adds steps to the counter of this thread; does nothing outside tests.
#[cfg(not(test))]
#[inline(always)]
fn count_steps(_: usize) {}

#[cfg(test)]
use steps::count_steps;
#[cfg(test)]
pub(super) use steps::take_step_count;

/// Line and column from 1, as Rhai counts them.
pub(super) type LineColumn = (usize, usize);

/// One file of a script.
pub(super) struct Source<'a> {
    ast: &'a AST,
    text: &'a str,
}

impl<'a> Source<'a> {
    pub(super) fn new(ast: &'a AST, text: &'a str) -> Source<'a> {
        Source { ast, text }
    }

    /// Calls `visit` with name and place of each variable that the file declares.
    pub(super) fn visit_variables(&self, mut visit: impl FnMut(&str, LineColumn)) {
        self.ast.walk(&mut |nodes| {
            count_steps(1);
            if let Some(ASTNode::Stmt(Stmt::Var(variable, _, position))) = nodes.last()
                && let (Some(line), Some(column)) = (position.line(), position.position())
            {
                visit(variable.0.name.as_str(), (line, column));
            }
            true
        });
    }

    /// Number of occurrences of each word of the text.
    pub(super) fn count_words(&self) -> HashMap<&'a str, usize> {
        let mut counts = HashMap::new();
        count_steps(self.text.len());
        let words = self.text.split(|c: char| !c.is_alphanumeric() && c != '_');
        words.filter(|word| !word.is_empty()).for_each(|word| *counts.entry(word).or_default() += 1);
        counts
    }

    /// The places at which one of `parts` occurs, in the order of the text.
    pub(super) fn places_of(&self, parts: &[&str]) -> SortedPositions {
        let mut found = SortedPositions(Vec::new());
        let (mut line, mut column) = (1, 1);
        for (byte, c) in self.text.char_indices() {
            count_steps(1);
            if parts.iter().any(|part| self.text[byte..].starts_with(part)) {
                found.0.push((line, column));
            }
            (line, column) = if c == '\n' { (line + 1, 1) } else { (line, column + 1) };
        }
        found
    }
}

/// Places in the order of a text. They are lines and columns, because finding the byte of a place takes time proportional to the
/// length of its line.
pub(super) struct SortedPositions(Vec<LineColumn>);

impl SortedPositions {
    /// The first place at or after `from`.
    pub(super) fn first_from(&self, from: LineColumn) -> Option<LineColumn> {
        let is_before = |at: &LineColumn| {
            count_steps(1);
            *at < from
        };
        self.0.get(self.0.partition_point(is_before)).copied()
    }
}

/// Loads and variables of a script that has run.
pub(super) struct Drafts<'a>(&'a StageDraft);

impl<'a> Drafts<'a> {
    pub(super) fn new(stage_draft: &'a StageDraft) -> Drafts<'a> {
        Drafts(stage_draft)
    }

    pub(super) fn loads(&self) -> impl Iterator<Item = &'a LoadDraft> {
        self.0.loads.iter().inspect(|_| count_steps(1))
    }

    /// Variables that nothing reads.
    pub(super) fn unused_variables(&self) -> impl Iterator<Item = &'a UnusedVariable> {
        self.0.unused_variables.iter().inspect(|_| count_steps(1))
    }
}

/// The lines of each file.
pub(super) struct Lines<'a>(BTreeMap<&'a str, Vec<&'a str>>);

impl<'a> Lines<'a> {
    /// Splits the texts (by file) to lines, once for all findings.
    pub(super) fn of(sources: &'a BTreeMap<String, Arc<str>>) -> Lines<'a> {
        sources.values().for_each(|text| count_steps(text.len()));
        Lines(sources.iter().map(|(file, text)| (file.as_str(), text.lines().collect())).collect())
    }

    /// A line of a file by its number from 1.
    pub(super) fn get(&self, file: &str, number: usize) -> Option<&'a str> {
        count_steps(1);
        self.0.get(file)?.get(number.checked_sub(1)?).copied()
    }
}

#[cfg(test)]
mod steps {
    use std::cell::Cell;

    thread_local! {
        static STEPS: Cell<usize> = const { Cell::new(0) };
    }

    pub(super) fn count_steps(steps: usize) {
        STEPS.set(STEPS.get() + steps);
    }

    /// The number of steps since the last call.
    pub(in super::super) fn take_step_count() -> usize {
        STEPS.take()
    }
}
