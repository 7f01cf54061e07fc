//! The outcome of one section: plain data that every report reads.

use choreo_image_diff::ImageDifference;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// Result of a section, or of a script without sections.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Outcome {
    /// Path as the user can type it, with `/`.
    pub file: String,
    /// Name of the section; empty for a script without sections.
    pub section: String,
    pub place: SourceLocation,
    pub status: Status,
    /// Checks in the order of the script.
    pub checks: Vec<Check>,
    /// Warnings of the script, its stage and its assets; each includes its place.
    pub warnings: Vec<String>,
    /// Lines that the section printed.
    pub printed: Vec<String>,
    /// Wall time in seconds; of the earlier run if the outcome was reused.
    pub seconds: f64,
    /// Whether the outcome was reused from an earlier run with the same content.
    pub reused: bool,
    /// Hash of everything that the outcome depends on, in hexadecimal digits; empty if unknown.
    pub key: String,
    /// Further arguments of the command that runs the section: folders of plugins and assets.
    #[serde(skip)]
    pub rerun_arguments: String,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Status {
    Passed,
    /// At least one check failed.
    Failed,
    /// The section was skipped; contains the reason given by the section or the runner.
    Skipped(String),
    /// The section could not be judged: an error of the script, or no assertion. The message includes place and hint.
    Error(String),
}

/// A place in a file; line and column are counted from 1, and 0 is unknown.
#[derive(Clone, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct SourceLocation {
    pub file: String,
    pub line: usize,
    pub column: usize,
}

/// A judged expectation. Each text fits on one line.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Check {
    pub place: SourceLocation,
    /// The assertion, for a reader of the report: `anna.joint("LeftHand") near [0.1, 1.2, 0.0] at 1.5 s`.
    pub title: String,
    pub passed: bool,
    /// Expected value, such as `[0.100, 1.200, 0.000] ± 0.001 m`.
    pub expected: String,
    /// Actual value, such as `[0.100, 1.214, 0.000] m`.
    pub got: String,
    /// Error of the actual value, such as `0.014 m, 14 times the tolerance`; empty if there is no measure.
    pub by: String,
    /// How to resolve a failure, with a command to type; empty if there is nothing beyond the obvious.
    pub hint: String,
    pub evidence: Evidence,
}

/// Evidence of a check for reports, in addition to its texts. Filled only for failures.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub enum Evidence {
    #[default]
    None,
    /// Curves over time, one plot each: the x, y and z of a joint, a speed, a weight.
    Traces(Vec<Trace>),
    Pictures(Box<Pictures>),
}

/// A value over time, with its allowed range.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Trace {
    /// Name of the value, such as `anna LeftHand y`.
    pub label: String,
    /// Unit: `m`, `°`, `m/s`; empty for a plain number.
    pub unit: String,
    /// Times in seconds, ascending.
    pub times: Vec<f64>,
    /// Actual value at each of `times`; NaN if it is unknown.
    pub got: Vec<f64>,
    /// Expected values at each of `times`, if a whole curve is expected; else empty.
    pub expected: Vec<f64>,
    /// Lowest and highest allowed value at each of `times`; infinite if that side is unbounded, NaN if nothing is asserted.
    pub band: Vec<[f64; 2]>,
    /// Time of the assertion, or of the worst value.
    pub mark: Option<f64>,
}

/// The expected image, the drawn image and the difference, as PNG files, with measures of the difference.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Pictures {
    /// Name of the image in the script.
    pub name: String,
    /// Path of the golden image, even if it does not exist.
    pub stored: PathBuf,
    /// PNG files; empty if there is none. They are not stored with reused outcomes, nor printed in JSON.
    #[serde(skip)]
    pub expected: Vec<u8>,
    #[serde(skip)]
    pub got: Vec<u8>,
    #[serde(skip)]
    pub difference: Vec<u8>,
    /// Map of the perceived difference (ꟻLIP), from black over violet and orange to pale yellow.
    #[serde(skip)]
    pub visible_difference: Vec<u8>,
    /// Paths of the three written images, in the order expected, got, difference; empty if they were not written.
    pub written: Vec<PathBuf>,
    pub measures: Option<Measures>,
}

/// Measured differences between two images of one size.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Measures {
    /// Fraction of pixels with a channel that differs by more than `tolerance` steps of 255, 0..=1.
    pub share_beyond: f64,
    pub tolerance: u8,
    /// Largest difference of a channel in steps of 255, and its pixel.
    pub worst: u8,
    pub worst_at: [u32; 2],
    /// Smallest rectangle with all pixels beyond the tolerance: x, y, width, height.
    pub region: Option<[u32; 4]>,
    /// Perceived difference when the images alternate (ꟻLIP), 0 to 1: mean and largest.
    pub visible_mean: f64,
    pub visible_worst: f64,
    /// Visibility of the difference to a viewer, as a text.
    pub words: String,
}

impl Measures {
    pub(crate) fn of(difference: &ImageDifference) -> Measures {
        let ImageDifference { pixels, visible, .. } = difference;
        Measures {
            share_beyond: pixels.share_beyond,
            tolerance: pixels.tolerance,
            worst: pixels.worst,
            worst_at: pixels.worst_at,
            region: pixels.region,
            visible_mean: visible.mean,
            visible_worst: visible.worst,
            words: visible.description().to_string(),
        }
    }
}

impl std::fmt::Display for SourceLocation {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}", self.file)?;
        for number in [self.line, self.column].into_iter().take_while(|n| *n > 0) {
            write!(f, ":{number}")?;
        }
        Ok(())
    }
}

impl Outcome {
    /// An outcome for a section at a line of a file, before it is run.
    pub fn new(file: &str, section: &str, line: usize) -> Outcome {
        Outcome {
            file: file.to_string(),
            section: section.to_string(),
            place: SourceLocation { file: file.to_string(), line, column: 0 },
            status: Status::Passed,
            checks: Vec::new(),
            warnings: Vec::new(),
            printed: Vec::new(),
            seconds: 0.0,
            reused: false,
            key: String::new(),
            rerun_arguments: String::new(),
        }
    }

    /// Name for messages: `tests/suite/walk.rhai > feet stay on the floor`, or the file alone.
    pub fn name(&self) -> String {
        match self.section.as_str() {
            "" => self.file.clone(),
            section => format!("{} > {section}", self.file),
        }
    }

    /// Whether the section failed or could not be judged.
    pub fn has_failed(&self) -> bool {
        matches!(self.status, Status::Failed | Status::Error(_))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_and_names_are_written_as_a_user_types_them() {
        let place = |line, column| SourceLocation { file: "a/b.rhai".into(), line, column }.to_string();
        assert_eq!([place(0, 0), place(3, 0), place(3, 7)], ["a/b.rhai", "a/b.rhai:3", "a/b.rhai:3:7"]);
        let skipped = Status::Skipped("why".into());
        let mut outcome = Outcome { status: skipped, ..Outcome::new("a.rhai", "", 0) };
        assert_eq!((outcome.name().as_str(), outcome.has_failed()), ("a.rhai", false));
        (outcome.section, outcome.status) = ("one".into(), Status::Error("what".into()));
        assert_eq!((outcome.name().as_str(), outcome.has_failed()), ("a.rhai > one", true));
    }
}
