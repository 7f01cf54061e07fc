//! Judges the expectations of a section, which are data, without drawing; the results are checks.
//!
//! ```text
//! Expectation ─► times to look at ─► SnapshotCache ─► values ─► Check { expected, got, by how much, traces }
//! ```
//! A claim about a span of time is judged at every frame in it; the check reports the worst time.

mod band;
mod bitwise;
mod contact;
mod cost;
mod default_checks;
mod events;
mod flags;
mod frame;
mod judge_error;
mod number;
mod plan;
mod rotation;
mod snapshot_cache;
mod text_format;
mod texts;
mod value;
mod vector;

use crate::outcome::{Check, Evidence, SourceLocation, Trace};
use choreo_motion::Time;
use choreo_plugin::Registry;
use choreo_script::Severity;
use choreo_script::testing::{Claim, Expectation, SectionRun, TextsQuantity, When};
use judge_error::JudgeError;
use snapshot_cache::{Deadline, SnapshotCache};

/// All checks of a section except its images, in the order of the script: its expectations, its `//~` comments, and unexpected errors and
/// warnings. A file without sections gets the default checks.
pub fn evaluate(run: &SectionRun, registry: &Registry) -> Vec<Check> {
    let mut checks = judge_diagnostics(run);
    // An unexpected error explains everything; checks of the incomplete stage would only confuse.
    if !run.errors.is_empty() {
        return checks;
    }
    if let Some(problem) = run.stage_errors.first() {
        if !run.expectations.is_empty() {
            let place = SourceLocation { file: run.info.file.clone(), line: run.info.line, column: 0 };
            let mut check = failed_check(
                place,
                "the stage can be evaluated",
                "a stage without errors",
                problem.message.clone(),
            );
            check.hint =
                "after errors there is no stage to check: expect the errors in a section of their own".into();
            checks.push(check);
        }
        return checks;
    }
    let deadline = Deadline::after(run.seconds, run.timeout);
    let mut snapshots: Vec<SnapshotCache> =
        run.stages.iter().map(|stage| SnapshotCache::new(stage, registry, deadline)).collect();
    if run.info.is_whole_file() {
        checks.extend(default_checks::judge(run, &mut snapshots));
        return checks;
    }
    for expectation in &run.expectations {
        if let Some(judged) = judge(run, expectation, &mut snapshots) {
            checks.push(judged.into_check(expectation));
        }
    }
    checks.sort_by_key(|c| (c.place.line, c.place.column));
    checks
}

/// Result of comparing a claim with the actual values.
pub(crate) struct Judgment {
    pub passed: bool,
    pub expected: String,
    pub got: String,
    pub by: String,
    pub hint: String,
    pub traces: Vec<Trace>,
}

impl Judgment {
    fn new(passed: bool, expected: impl Into<String>, got: impl Into<String>) -> Judgment {
        Judgment {
            passed,
            expected: expected.into(),
            got: got.into(),
            by: String::new(),
            hint: String::new(),
            traces: Vec::new(),
        }
    }

    /// Result for a claim that cannot be judged: it fails, whether negated or not.
    fn impossible(expected: impl Into<String>, why: impl std::fmt::Display) -> Judgment {
        Judgment::new(false, expected, why.to_string())
    }

    fn with_error(mut self, by: impl Into<String>) -> Judgment {
        self.by = by.into();
        self
    }

    fn into_check(self, expectation: &Expectation) -> Check {
        let place = &expectation.place;
        let evidence = match self.passed || self.traces.is_empty() {
            true => Evidence::None,
            false => Evidence::Traces(self.traces),
        };
        Check {
            place: SourceLocation { file: place.file.clone(), line: place.line, column: place.column },
            title: expectation.source.trim_end_matches(';').to_string(),
            passed: self.passed,
            expected: self.expected,
            got: self.got,
            by: if self.passed { String::new() } else { self.by },
            hint: if self.passed { String::new() } else { self.hint },
            evidence,
        }
    }
}

fn judge(run: &SectionRun, e: &Expectation, snapshots: &mut [SnapshotCache]) -> Option<Judgment> {
    let cache = snapshots.get_mut(e.stage);
    let Some(own) = cache else {
        return Some(Judgment::impossible("a stage", format!("stage {} does not exist", e.stage)));
    };
    let length = own.stage.settings.length;
    let times = match e.when {
        When::Always => [Time::ZERO; 2],
        When::At(time) => [time; 2],
        When::During(from, until) => [from, until],
    };
    if let Some(outside) = times.into_iter().find(|time| !(Time::ZERO..=length).contains(time)) {
        let [time, length] = [outside, length].map(Time::as_secs);
        return Some(Judgment::impossible(
            "a time within the stage",
            JudgeError::OutsideStage { time, length },
        ));
    }
    Some(match &e.claim {
        // Images are drawn and compared by the runner.
        Claim::Image(_) => return None,
        Claim::Number { quantity, test } => number::judge(own, e, quantity, test),
        Claim::Vector { quantity, test } => vector::judge(own, e, quantity, test),
        Claim::Rotation { quantity, goal, tolerance_deg } => {
            rotation::judge(own, e, quantity, goal, *tolerance_deg)
        }
        Claim::Flag(flag) => flags::judge(own, e, flag),
        Claim::InFrame(claim) => frame::judge(own, e, claim),
        Claim::Same { what, other } => bitwise::judge(snapshots, e, *what, *other),
        Claim::Events { of, test } => events::judge(own, e, *of, test),
        Claim::Texts { texts, test } => texts::judge(run, own, e, *texts, test),
        Claim::Value { got, test } => value::judge(e, got, test),
        Claim::Cost { other, factor } => cost::judge(snapshots, e, *other, *factor),
    })
}

/// Checks of expected errors, unexpected errors, and warnings.
fn judge_diagnostics(run: &SectionRun) -> Vec<Check> {
    let mut checks = Vec::new();
    for e in &run.expected {
        let word = if e.severity == Severity::Error { "error" } else { "warning" };
        let place = SourceLocation { file: run.info.file.clone(), line: e.line, column: 0 };
        let expected = format!("{word}: {}", e.text);
        let title = format!("//~ {expected}");
        checks.push(match e.has_occurred {
            true => Check { passed: true, ..failed_check(place, title, expected.clone(), expected) },
            false => failed_check(place, title, expected, format!("no such {word} in this line")),
        });
    }
    let unexpected = |d: &choreo_script::Diagnostic, word: &str| {
        let place = SourceLocation { file: d.file.clone(), line: d.line, column: d.column };
        let title = format!("no {word} but those expected");
        let mut check = failed_check(place, title, format!("no {word}"), d.message.clone());
        check.hint = d.hint.clone().unwrap_or_default();
        check
    };
    checks.extend(run.errors.iter().map(|d| unexpected(d, "error")));
    // If a section tests its warnings, they are not checked again here.
    let tests_warnings =
        |e: &Expectation| matches!(e.claim, Claim::Texts { texts: TextsQuantity::Warnings, .. });
    if !run.expectations.iter().any(tests_warnings) {
        checks.extend(run.warnings.iter().map(|d| unexpected(d, "warning")));
    }
    checks
}

/// A failed check.
fn failed_check(
    place: SourceLocation,
    title: impl Into<String>,
    expected: impl Into<String>,
    got: impl Into<String>,
) -> Check {
    Check {
        place,
        title: title.into(),
        passed: false,
        expected: expected.into(),
        got: got.into(),
        by: String::new(),
        hint: String::new(),
        evidence: Evidence::None,
    }
}
