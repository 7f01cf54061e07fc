//! Tests in scripts: sections of a file, each run on a stage of its own, and what they expect, as data.
//!
//! ```text
//! path ─► list_sections ─► SectionInfo ─► run_section ─► SectionRun { stage, expectations } ─► choreo-test-runner judges
//! ```

mod comments;
mod file;
mod run;

pub use crate::test_data::{
    Claim, Contact, Count, EventPattern, EventsTest, Expectation, Flag, Formula, ImageExpectation, InFrame,
    NumberGoal, NumberTest, PlanCount, PlanOptions, Quantity, RotationGoal, RotationQuantity, SameOther,
    SameWhat, SectionInfo, Subject, TextsQuantity, TextsTest, TimeUsedUp, Timeout, Value, ValueTest,
    VectorGoal, VectorQuantity, VectorTest, When,
};
pub use file::TestFiles;
pub use run::{SectionErrors, has_sections, list_sections, run_section, section_errors};

use crate::diagnostic::{Diagnostic, Severity};
use crate::run::ScriptOptions;
use choreo_stage::Stage;
use std::path::PathBuf;
use std::sync::Arc;

/// `//~ error: text` in the script: a diagnostic that must come, at its line.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ExpectedDiagnostic {
    pub severity: Severity,
    /// Line number from 1.
    pub line: usize,
    /// Part of its message.
    pub text: String,
    /// One came.
    pub met: bool,
}

/// How tests are run.
#[derive(Clone, Debug, Default)]
pub struct TestOptions {
    pub script: ScriptOptions,
    /// A folder that holds the test file; `scene` and `load` may read in it, by paths relative to the test file or to it.
    pub root: Option<PathBuf>,
    /// The time at which the section that is run must be over.
    pub timeout: Option<Timeout>,
    /// Files that runs with clones of this have read: each is parsed once for all of its sections.
    pub files: TestFiles,
}

/// One section after its run. Nothing has been judged but its diagnostics.
#[derive(Clone, Debug)]
pub struct SectionRun {
    pub info: SectionInfo,
    /// The section's own stage first, then those made with `stage_of`. Where `broken` is not empty they must not be evaluated.
    pub stages: Vec<Arc<Stage>>,
    /// Expectations in the order of the script.
    pub expectations: Vec<Expectation>,
    /// The `//~` comments that count for this section.
    pub expected: Vec<ExpectedDiagnostic>,
    /// Errors that no comment expects: the section has failed.
    pub errors: Vec<Diagnostic>,
    /// Warnings of the script that no comment expects.
    pub warnings: Vec<Diagnostic>,
    /// Why the stages cannot be evaluated, where errors were expected and left nothing sound.
    pub broken: Vec<Diagnostic>,
    /// Content hash of the stage that a second run gave, for a file without sections and without errors.
    pub hash_again: Option<[u8; 32]>,
    /// How long judging it may take.
    pub seconds: f64,
    /// The time at which the whole run must be over.
    pub timeout: Option<Timeout>,
    /// Lines of `print` and `debug`.
    pub printed: Vec<String>,
    /// Canonical paths of all that was read, the file itself included, with the BLAKE3 of their content; sorted.
    pub files_used: Vec<(PathBuf, [u8; 32])>,
    /// Hash of the section's name and all files used: equal hash, equal outcome (apart from program and device).
    pub hash: [u8; 32],
}

impl SectionRun {
    /// Whether it has neither an expectation nor a `//~` comment: such a test cannot fail.
    pub fn asserts_nothing(&self) -> bool {
        let own = |e: &ExpectedDiagnostic| (self.info.line..=self.info.end_line).contains(&e.line);
        !self.info.as_it_stands() && self.expectations.is_empty() && !self.expected.iter().any(own)
    }
}
