//! Tests in scripts as data: sections, what they expect, and how long they may take.

mod expectation;
mod state;
mod timeout;

pub use expectation::{
    Claim, Contact, Count, EventPattern, EventsTest, Expectation, Flag, Formula, ImageExpectation, InFrame,
    Measure, NumberGoal, NumberTest, PlanCount, PlanOptions, Quantity, RotationGoal, RotationQuantity,
    SameOther, SameWhat, Subject, TextsQuantity, TextsTest, Value, ValueTest, VectorGoal, VectorQuantity,
    VectorTest, When,
};
pub(crate) use state::{Asked, RunningScript, TestState};
pub use timeout::{TimeUsedUp, Timeout};

/// A `test(…)` of a file, found without running it; or a file without any, which is a test as it stands.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SectionInfo {
    /// Index among the sections of its file, from 0.
    pub index: usize,
    /// Unlike every other of its file. Empty: the file has no sections and is tested as it stands.
    pub name: String,
    /// The file as the caller named it.
    pub file: String,
    /// Line of its call of `test`, from 1; 0 where there is none.
    pub line: usize,
    /// Last line of its function.
    pub end_line: usize,
    /// Why it is not to be run.
    pub skip: Option<String>,
    /// A known bug: why it is expected to fail. It must not pass.
    pub fails: Option<String>,
    /// Tags in the order of the script.
    pub tags: Vec<String>,
}

impl SectionInfo {
    /// The file has no sections: it is to run without errors and warnings, and to give the same finite frames again.
    pub fn as_it_stands(&self) -> bool {
        self.name.is_empty()
    }
}
