//! Tests in scripts as data: sections, expectations and time limits.

mod expectation;
mod state;
mod timeout;

pub use expectation::{
    Claim, Contact, Count, EventPattern, EventsTest, Expectation, Flag, Formula, ImageExpectation, InFrame,
    Measure, NumberGoal, NumberTest, PlanCount, PlanOptions, Quantity, RotationGoal, RotationQuantity,
    SameOther, SameWhat, Subject, TextsQuantity, TextsTest, Value, ValueTest, VectorGoal, VectorQuantity,
    VectorTest, When,
};
pub(crate) use state::{PendingExpect, RunningScript, TestState};
pub use timeout::{TimeUsedUp, Timeout};

/// A test section, which is a `test(…)` call of a file, found without running its function; or a whole file without sections.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SectionInfo {
    /// Index among the sections of its file, from 0.
    pub index: usize,
    /// Name, unique in its file. Empty: the file has no sections and is tested as a whole.
    pub name: String,
    /// The file as the caller named it.
    pub file: String,
    /// Line of its call of `test`, from 1; 0 where there is none.
    pub line: usize,
    /// Last line of its function.
    pub end_line: usize,
    /// Why the section is skipped.
    pub skip: Option<String>,
    /// Known bug: why the section is expected to fail. It must not pass.
    pub fails: Option<String>,
    /// Tags in the order of the script.
    pub tags: Vec<String>,
}

impl SectionInfo {
    /// Whether this is a file without sections, which must run without errors and warnings and give the same finite frames twice.
    pub fn as_it_stands(&self) -> bool {
        self.name.is_empty()
    }
}
