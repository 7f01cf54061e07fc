//! The report as JSON, for other programs.

use super::{accept_command, rerun_command};
use crate::collect::{Case, display_path};
use crate::outcome::{Evidence, Outcome, SourceLocation, Status};
use crate::run::Report;
use serde_json::{Value, json};

/// Version of the format. It is raised when a field changes its meaning; new fields may be added at any time.
pub(crate) const FORMAT: u32 = 1;

pub fn report(report: &Report, options: &Value) -> Value {
    let counts = report.counts();
    json!({
        "format": FORMAT,
        "ok": report.failure().is_none(),
        "failure": report.failure(),
        "passed": counts.passed,
        "failed": counts.failed,
        "errors": counts.errors,
        "skipped": counts.skipped,
        "reused": counts.reused,
        "accepted": counts.accepted,
        "checks": counts.checks,
        "seconds": report.seconds,
        "options": options,
        "unused_pictures": report.unused_images.iter().map(|p| display_path(p)).collect::<Vec<_>>(),
        "sections": report.outcomes.iter().map(outcome_json).collect::<Vec<_>>(),
    })
}

fn outcome_json(o: &Outcome) -> Value {
    let (status, text) = match &o.status {
        Status::Passed => ("passed", None),
        Status::Failed => ("failed", None),
        Status::Skipped(reason) => ("skipped", Some(reason)),
        Status::Error(what) => ("error", Some(what)),
    };
    let checks: Vec<Value> = o
        .checks
        .iter()
        .map(|c| {
            let mut value = json!({
                "place": place_json(&c.place), "title": c.title, "passed": c.passed,
                "expected": c.expected, "got": c.got, "by": c.by, "hint": c.hint,
            });
            match &c.evidence {
                Evidence::None => {}
                // Numbers without a finite value (NaN, or infinite for an unbounded side) become null.
                Evidence::Traces(traces) => value["traces"] = json!(traces),
                Evidence::Pictures(p) => {
                    let written: Vec<String> = p.written.iter().map(|path| display_path(path)).collect();
                    let at = |i: usize| written.get(i).filter(|w| !w.is_empty());
                    value["picture"] = json!({
                        "name": p.name, "stored": display_path(&p.stored), "measures": p.measures,
                        "expected": at(0), "got": at(1), "difference": at(2),
                    });
                }
            }
            value
        })
        .collect();
    json!({
        "file": o.file, "section": o.section, "line": o.place.line, "status": status, "text": text,
        "checks": checks, "warnings": o.warnings, "printed": o.printed, "seconds": o.seconds, "reused": o.reused,
        "rerun": rerun_command(o), "accept": accept_command(o),
    })
}

fn place_json(place: &SourceLocation) -> Value {
    json!({ "file": place.file, "line": place.line, "column": place.column })
}

/// Output of `--list --json`.
pub fn list(cases: &[Case]) -> Value {
    let section_json = |c: &Case| match &c.section {
        Ok(s) => json!({
            "file": c.file, "section": s.name, "line": s.line, "skip": s.skip, "fails": s.fails, "tags": s.tags,
        }),
        Err(d) => json!({
            "file": c.file, "errors": d.iter().map(ToString::to_string).collect::<Vec<_>>(),
        }),
    };
    json!({ "format": FORMAT, "sections": cases.iter().map(section_json).collect::<Vec<_>>() })
}
