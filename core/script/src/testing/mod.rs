//! Tests in scripts: lists the sections of a file and runs each on its own stage; expectations are returned as data.
//!
//! ```text
//! path ─► list_sections ─► SectionInfo ─► run_section ─► SectionRun { stage, expectations } ─► choreo-test-runner judges
//! ```

mod comments;
mod file;
mod run;

pub use crate::test_data::{
    Claim, ComparedObject, ComparedWith, Contact, Count, EventPattern, EventsTest, Expectation, Flag,
    Formula, ImageExpectation, InFrame, NumberGoal, NumberTest, PlanCount, PlanOptions, Quantity,
    RotationGoal, RotationQuantity, SectionInfo, Subject, TextsQuantity, TextsTest, TimeUsedUp, Timeout,
    Value, ValueTest, VectorGoal, VectorQuantity, VectorTest, When,
};
pub use file::TestFiles;
pub use run::{SectionErrors, check_sections, has_sections, list_sections, run_section};

use crate::diagnostic::{Diagnostic, Severity};
use crate::run::ScriptOptions;
use choreo_stage::Stage;
use std::path::PathBuf;
use std::sync::Arc;

/// A comment `//~ error: text` in the script: a diagnostic that must occur at its line.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ExpectedDiagnostic {
    pub severity: Severity,
    /// Line number from 1.
    pub line: usize,
    /// Part of the message.
    pub text: String,
    /// A diagnostic with this text has occurred at this line.
    pub has_occurred: bool,
}

/// Options of test runs.
#[derive(Clone, Debug, Default)]
pub struct TestOptions {
    pub script: ScriptOptions,
    /// A folder that contains the test file. `scene` and `load` may read in it, by paths relative to the test file or to this
    /// folder.
    pub root: Option<PathBuf>,
    /// Time limit of the section.
    pub timeout: Option<Timeout>,
    /// Cache of test files, shared with other runs by clones: each is parsed once for all of its sections.
    pub files: TestFiles,
}

/// One section after its run. Its diagnostics are compared with the expected ones; its expectations are not judged yet.
#[derive(Clone, Debug)]
pub struct SectionRun {
    pub info: SectionInfo,
    /// The section's own stage, then those made with `stage_of`. They must not be evaluated if `stage_errors` is not empty.
    pub stages: Vec<Arc<Stage>>,
    /// Expectations in the order of the script.
    pub expectations: Vec<Expectation>,
    /// The `//~` comments in this section and outside all sections.
    pub expected: Vec<ExpectedDiagnostic>,
    /// Errors that no comment expects. If there are any, the section has failed.
    pub errors: Vec<Diagnostic>,
    /// Warnings of the script that no comment expects.
    pub warnings: Vec<Diagnostic>,
    /// Errors of the stages that make their evaluation impossible; empty unless expected errors have left an invalid stage.
    pub stage_errors: Vec<Diagnostic>,
    /// Content hash of the stage of a second run, for a file without sections and without errors.
    pub second_run_hash: Option<[u8; 32]>,
    /// Maximum time for judging the section, seconds.
    pub seconds: f64,
    /// Time limit of the whole run.
    pub timeout: Option<Timeout>,
    /// Lines of `print` and `debug`.
    pub printed: Vec<String>,
    /// Canonical paths of all files read, the test file included, with the BLAKE3 hash of their content; sorted.
    pub files_used: Vec<(PathBuf, [u8; 32])>,
    /// Hash of the section's name, parameters, limits and files. Runs of equal hash by the same program on the same device have the
    /// same outcome.
    pub hash: [u8; 32],
}

impl SectionRun {
    /// Whether the section has neither an expectation nor a `//~` comment, so that it cannot fail.
    pub fn asserts_nothing(&self) -> bool {
        let is_in_section = |e: &ExpectedDiagnostic| (self.info.line..=self.info.end_line).contains(&e.line);
        !self.info.is_whole_file() && self.expectations.is_empty() && !self.expected.iter().any(is_in_section)
    }
}
