//! Text for a terminal: a failure states the expected value, the actual value, the error, where to look and what to type.

use super::{accept_command, rerun_command};
use crate::collect::{Case, display_path};
use crate::images::ACCEPTED;
use crate::outcome::{Check, Evidence, Outcome, Status};
use crate::run::Report;
use choreo_script::{printable, printable_line};
use std::fmt::Write;

/// Largest number of failed checks of a section that are printed; for the others only their number is printed.
const MAX_CHECKS: usize = 10;

/// The text about a failed section; empty for others.
pub fn failure(outcome: &Outcome) -> String {
    let mut text = String::new();
    match &outcome.status {
        Status::Passed | Status::Skipped(_) => return text,
        Status::Error(what) => {
            let _ = writeln!(text, "ERROR {}", printable_line(&outcome.name()));
            indent(&mut text, what);
        }
        Status::Failed => {
            let _ = writeln!(text, "FAILED {}", printable_line(&outcome.name()));
        }
    }
    for line in &outcome.printed {
        let _ = writeln!(text, "    printed: {}", line.replace('\n', "\n             "));
    }
    let failed = || outcome.checks.iter().filter(|c| !c.passed);
    for check in failed().take(MAX_CHECKS) {
        write_check(&mut text, check);
    }
    let more = failed().count().saturating_sub(MAX_CHECKS);
    if more > 0 {
        let s = if more == 1 { "" } else { "s" };
        let _ = writeln!(text, "  and {more} more failed check{s}");
    }
    for warning in &outcome.warnings {
        indent(&mut text, warning);
    }
    let _ = writeln!(text, "  alone:  {}", printable_line(&rerun_command(outcome)));
    if let Some(accept) = accept_command(outcome) {
        let _ = writeln!(text, "  accept: {}", printable_line(&accept));
    }
    printable(&text)
}

fn write_check(text: &mut String, check: &Check) {
    let _ = writeln!(text, "  {}: {}", check.place, check.title);
    let mut row = |name: &str, value: &str| {
        if !value.is_empty() {
            let _ = writeln!(text, "      {name:<9} {}", value.replace('\n', "\n                "));
        }
    };
    if let Evidence::Traces(traces) = &check.evidence
        && let Some(first) = traces.first()
    {
        // The line of the script does not identify the subject in a loop or a function. The label of a component ends with its axis.
        let name = first.label.rsplit_once(' ').filter(|_| traces.len() > 1);
        row("of", name.map_or(first.label.as_str(), |(name, _)| name));
    }
    row("expected", &check.expected);
    row("got", &check.got);
    row("off by", &check.by);
    if let Evidence::Pictures(pictures) = &check.evidence {
        for path in pictures.written.iter().filter(|p| !p.as_os_str().is_empty()) {
            row("see", &display_path(path));
        }
    }
    row("hint", &check.hint);
}

fn indent(text: &mut String, what: &str) {
    for line in what.lines() {
        let _ = writeln!(text, "  {line}");
    }
}

/// Final lines: skipped sections with their reasons, then the totals in one line.
pub fn summary(report: &Report) -> String {
    let mut text = String::new();
    let mut skips: Vec<(&str, usize)> = Vec::new();
    for outcome in &report.outcomes {
        if let Status::Skipped(reason) = &outcome.status {
            match skips.iter_mut().find(|(r, _)| r == reason) {
                Some((_, count)) => *count += 1,
                None => skips.push((reason, 1)),
            }
        }
    }
    for (reason, count) in skips {
        let _ = writeln!(text, "skipped {count}: {}", printable_line(reason));
    }
    for check in report.outcomes.iter().flat_map(|o| &o.checks).filter(|c| c.by == ACCEPTED) {
        let _ = writeln!(text, "accepted {}", check.expected);
    }
    for path in &report.unused_images {
        let _ = writeln!(text, "no section uses {}: remove it if it is not needed", display_path(path));
    }
    let counts = report.counts();
    let mut parts = vec![format!("{} passed", counts.passed)];
    if counts.reused > 0 {
        parts[0].push_str(&format!(" (reused {})", counts.reused));
    }
    parts.push(format!("{} failed", counts.failed + counts.errors));
    parts.push(format!("{} skipped", counts.skipped));
    if counts.accepted > 0 {
        let s = if counts.accepted == 1 { "" } else { "s" };
        parts.push(format!("{} image{s} accepted", counts.accepted));
    }
    if counts.warnings > 0 {
        let s = if counts.warnings == 1 { "" } else { "s" };
        parts.push(format!("{} warning{s}", counts.warnings));
    }
    let s = if counts.checks == 1 { "" } else { "s" };
    let _ = writeln!(text, "{}; {} check{s} in {:.1} s", parts.join(", "), counts.checks, report.seconds);
    printable(&text)
}

/// Line about a file whose sections have all run: `ok     tests/suite/walk.rhai  12`.
pub fn file_line(outcomes: &[Outcome]) -> String {
    let Some(first) = outcomes.first() else { return String::new() };
    let bad = outcomes.iter().filter(|o| o.has_failed()).count();
    let skipped = outcomes.iter().filter(|o| matches!(o.status, Status::Skipped(_))).count();
    let reused = outcomes.iter().filter(|o| o.reused).count();
    let word = match (bad, skipped) {
        (0, s) if s == outcomes.len() => "skip",
        (0, _) => "ok",
        _ => "FAILED",
    };
    let plural = if outcomes.len() == 1 { "" } else { "s" };
    let mut line = format!("{word:<6} {}  {} section{plural}", first.file, outcomes.len());
    for (count, what) in [(bad, "failed"), (skipped, "skipped"), (reused, "reused")] {
        if count > 0 {
            let _ = write!(line, ", {count} {what}");
        }
    }
    printable(&line)
}

/// Output of `--list`: every section with its place.
pub fn list(cases: &[Case]) -> String {
    let mut text = String::new();
    for case in cases {
        match &case.section {
            Ok(info) if info.is_whole_file() => {
                let _ = writeln!(text, "{}  (whole file)", case.file);
            }
            Ok(info) => {
                let mut line = format!("{}:{}  {}", case.file, info.line, info.name);
                info.tags.iter().for_each(|tag| line += &format!("  #{tag}"));
                line += &info.skip.as_ref().map(|why| format!("  (skipped: {why})")).unwrap_or_default();
                line +=
                    &info.fails.as_ref().map(|why| format!("  (known to fail: {why})")).unwrap_or_default();
                let _ = writeln!(text, "{}", printable_line(&line));
            }
            Err(_) => {
                let _ = writeln!(text, "{}  (cannot be read)", case.file);
            }
        }
    }
    printable(&text)
}
