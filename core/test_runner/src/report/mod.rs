//! Reports of the outcomes: text for a terminal, JUnit XML and JSON for build servers, HTML for a browser.

pub mod html;
mod html_trace;
pub mod json;
pub mod junit;
pub mod terminal;

use crate::collect::shell_quote;
use crate::outcome::{Evidence, Outcome};

/// The command that runs one section alone.
pub fn rerun_command(outcome: &Outcome) -> String {
    let (file, arguments) = (shell_quote(&outcome.file), &outcome.rerun_arguments);
    match outcome.section.as_str() {
        "" => format!("choreo test {file}{arguments}"),
        section => format!("choreo test {file}{arguments} --filter {}", shell_quote(section)),
    }
}

/// The command that accepts a section's images; `None` if no image of it failed.
pub fn accept_command(outcome: &Outcome) -> Option<String> {
    let names: Vec<String> = outcome
        .checks
        .iter()
        .filter(|c| !c.passed)
        .filter_map(|c| match &c.evidence {
            Evidence::Pictures(p) => Some(format!("--accept={}", shell_quote(&p.name))),
            _ => None,
        })
        .collect();
    let (file, arguments) = (shell_quote(&outcome.file), &outcome.rerun_arguments);
    (!names.is_empty()).then(|| format!("choreo test {file}{arguments} {}", names.join(" ")))
}
