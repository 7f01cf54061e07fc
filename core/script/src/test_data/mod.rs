//! Tests in scripts as data: sections, expectations and time limits.

mod expectation;
mod state;
mod timeout;

pub(crate) use expectation::Measure;
pub use expectation::{
    Claim, ComparedObject, ComparedWith, Contact, Count, EventPattern, EventsTest, Expectation, Flag,
    Formula, ImageExpectation, InFrame, NumberGoal, NumberTest, PlanCount, PlanOptions, Quantity,
    RotationGoal, RotationQuantity, Subject, TextsQuantity, TextsTest, Value, ValueTest, VectorGoal,
    VectorQuantity, VectorTest, When,
};
pub(crate) use state::{PendingExpect, RunningScript, TestState};
pub use timeout::{TimeUsedUp, Timeout};

/// A test section: a `test(…)` call of a file, whose function is not run to list it; or a whole file without sections.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SectionInfo {
    /// Index among the sections of its file, from 0.
    pub index: usize,
    /// Name, unique in its file. Empty: the file has no sections and is tested as a whole.
    pub name: String,
    /// Path of the file as the caller named it.
    pub file: String,
    /// Line of its call of `test`, from 1; 0 for a whole file.
    pub line: usize,
    /// Last line of its function.
    pub end_line: usize,
    /// Reason to skip the section; `None`: it is run.
    pub skip: Option<String>,
    /// Known bug that makes the section fail. A section with a known bug must not pass.
    pub fails: Option<String>,
    /// Tags in the order of the script.
    pub tags: Vec<String>,
}

impl SectionInfo {
    /// Whether this is a file without sections, which must run without errors and warnings, and whose frames must be finite and
    /// equal in two runs.
    pub fn is_whole_file(&self) -> bool {
        self.name.is_empty()
    }
}
