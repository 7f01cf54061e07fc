//! JUnit XML as build servers read it (the schema of Jenkins' xUnit plugin): one suite per file, one case per section.

use super::{accept_command, rerun_command};
use crate::outcome::{Check, Outcome, Status};
use crate::run::Report;
use std::fmt::Write;

pub fn report(report: &Report) -> String {
    let counts = report.counts();
    let mut text = String::from("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n");
    let _ = writeln!(
        text,
        "<testsuites name=\"choreo test\" tests=\"{}\" failures=\"{}\" errors=\"{}\" time=\"{:.3}\">",
        report.outcomes.len(),
        counts.failed,
        counts.errors,
        report.seconds
    );
    for file in report.outcomes.chunk_by(|a, b| a.file == b.file) {
        write_suite(&mut text, file);
    }
    text.push_str("</testsuites>\n");
    text
}

fn write_suite(text: &mut String, outcomes: &[Outcome]) {
    let Some(first) = outcomes.first() else { return };
    let count = |f: &dyn Fn(&Status) -> bool| outcomes.iter().filter(|o| f(&o.status)).count();
    let _ = writeln!(
        text,
        "  <testsuite name=\"{}\" tests=\"{}\" failures=\"{}\" errors=\"{}\" skipped=\"{}\" time=\"{:.3}\">",
        escape_xml(&first.file),
        outcomes.len(),
        count(&|s| *s == Status::Failed),
        count(&|s| matches!(s, Status::Error(_))),
        count(&|s| matches!(s, Status::Skipped(_))),
        outcomes.iter().map(|o| o.seconds).sum::<f64>()
    );
    for outcome in outcomes {
        write_case(text, outcome);
    }
    text.push_str("  </testsuite>\n");
}

fn write_case(text: &mut String, outcome: &Outcome) {
    let name = if outcome.section.is_empty() { "whole file" } else { &outcome.section };
    let _ = write!(
        text,
        "    <testcase classname=\"{}\" name=\"{}\" time=\"{:.3}\"",
        escape_xml(outcome.file.strip_suffix(".rhai").unwrap_or(&outcome.file)),
        escape_xml(name),
        outcome.seconds
    );
    let body = match &outcome.status {
        Status::Passed => {
            text.push_str("/>\n");
            return;
        }
        Status::Skipped(reason) => format!("<skipped message=\"{}\"/>", escape_xml(reason)),
        Status::Error(what) => {
            let first = what.lines().next().unwrap_or_default();
            format!(
                "<error type=\"error\" message=\"{}\">{}</error>",
                escape_xml(first),
                escape_xml(&format!("{what}\n{}", rerun_command(outcome)))
            )
        }
        Status::Failed => outcome
            .checks
            .iter()
            .filter(|c| !c.passed)
            .map(|c| failure_element(outcome, c))
            .collect::<Vec<_>>()
            .join("\n      "),
    };
    let _ = writeln!(text, ">\n      {body}\n    </testcase>");
}

fn failure_element(outcome: &Outcome, c: &Check) -> String {
    let mut details = format!("{}: {}\nexpected {}\ngot {}", c.place, c.title, c.expected, c.got);
    for (word, value) in [("off by ", &c.by), ("", &c.hint)] {
        if !value.is_empty() {
            let _ = write!(details, "\n{word}{value}");
        }
    }
    let _ = write!(details, "\n{}", rerun_command(outcome));
    if let Some(accept) = accept_command(outcome) {
        let _ = write!(details, "\n{accept}");
    }
    let message = format!("{}: got {}", c.title, c.got);
    format!("<failure type=\"check\" message=\"{}\">{}</failure>", escape_xml(&message), escape_xml(&details))
}

/// Escapes a text for elements and attributes. Characters that XML cannot represent become question marks; line breaks are written as
/// character references, because they would become spaces in attributes.
pub fn escape_xml(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '&' => out.push_str("&amp;"),
            '"' => out.push_str("&quot;"),
            '\'' => out.push_str("&apos;"),
            '\n' => out.push_str("&#10;"),
            '\t' => out.push_str("&#9;"),
            c if c.is_control() || matches!(c, '\u{fffe}' | '\u{ffff}') => out.push('?'),
            c => out.push(c),
        }
    }
    out
}
