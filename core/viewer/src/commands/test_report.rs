//! Test results, parsed from the report of `choreo test --json`.

use serde_json::Value;
use std::path::PathBuf;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Status {
    Passed,
    Failed,
    Skipped,
    Error,
}

/// A section of a test script.
#[derive(Clone, Debug, PartialEq)]
pub struct Section {
    pub file: String,
    /// Name of the section; empty for a file that could not be read.
    pub name: String,
    pub line: usize,
    pub status: Status,
    /// Reason of an error or of a skipped section.
    pub reason: String,
    pub checks: Vec<Check>,
    pub seconds: f64,
    /// Whether the result of an earlier run was reused, since nothing has changed.
    pub reused: bool,
}

/// A checked expectation.
#[derive(Clone, Debug, PartialEq)]
pub struct Check {
    pub line: usize,
    pub title: String,
    pub passed: bool,
    pub expected: String,
    pub actual: String,
    /// Difference of expected and actual value, with its unit.
    pub difference_text: String,
    pub hint: String,
    pub images: Option<Images>,
}

/// Files of a golden image that does not match.
#[derive(Clone, Debug, PartialEq)]
pub struct Images {
    pub name: String,
    /// The golden image of the project.
    pub golden: PathBuf,
    /// `None` for a new image.
    pub expected: Option<PathBuf>,
    pub actual: Option<PathBuf>,
    pub difference: Option<PathBuf>,
}

impl Section {
    /// Sections of a report.
    pub(crate) fn of_report(report: &Value) -> Vec<Section> {
        report["sections"].as_array().into_iter().flatten().map(Section::new).collect()
    }

    fn new(value: &Value) -> Section {
        let status = match value["status"].as_str() {
            Some("passed") => Status::Passed,
            Some("failed") => Status::Failed,
            Some("skipped") => Status::Skipped,
            _ => Status::Error,
        };
        Section {
            file: text_of(&value["file"]),
            name: text_of(&value["section"]),
            line: value["line"].as_u64().unwrap_or(0) as usize,
            status,
            reason: text_of(&value["text"]),
            checks: value["checks"].as_array().into_iter().flatten().map(Check::new).collect(),
            seconds: value["seconds"].as_f64().unwrap_or(0.0),
            reused: value["reused"].as_bool().unwrap_or(false),
        }
    }

    /// Argument that selects the section: `FILE > SECTION`.
    pub fn filter(&self) -> String {
        format!("{} > {}", self.file, self.name)
    }

    /// Whether the section has failed or could not be run.
    pub fn has_problem(&self) -> bool {
        matches!(self.status, Status::Failed | Status::Error)
    }
}

impl Check {
    fn new(value: &Value) -> Check {
        let picture = &value["picture"];
        let file = |name: &str| picture[name].as_str().map(PathBuf::from);
        let images = picture["name"].as_str().map(|name| Images {
            name: name.to_string(),
            golden: file("stored").unwrap_or_default(),
            expected: file("expected"),
            actual: file("got"),
            difference: file("difference"),
        });
        Check {
            line: value["place"]["line"].as_u64().unwrap_or(0) as usize,
            title: text_of(&value["title"]),
            passed: value["passed"].as_bool().unwrap_or(false),
            expected: text_of(&value["expected"]),
            actual: text_of(&value["got"]),
            difference_text: text_of(&value["by"]),
            hint: text_of(&value["hint"]),
            images,
        }
    }
}

/// A string, or another value as JSON; empty for a missing one.
fn text_of(value: &Value) -> String {
    match value {
        Value::Null => String::new(),
        Value::String(text) => text.clone(),
        other => other.to_string(),
    }
}
