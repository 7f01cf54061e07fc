//! Runs one section, from its script to its outcome.

use crate::collect::Case;
use crate::evaluate::evaluate;
use crate::golden_image;
use crate::images::{self, Accept, ImageOptions, ImageOutcome, SectionRef};
use crate::outcome::{Check, Evidence, Outcome, SourceLocation, Status};
use crate::painter::{Device, DrawError, ImageRequest, Painter};
use choreo_motion::Time;
use choreo_plugin::Registry;
use choreo_script::Diagnostic;
use choreo_script::testing::{Claim, SectionRun, TestOptions, run_section};
use choreo_stage::Stage;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

/// The outcome of a section, and the files that it depends on.
pub(crate) struct SectionResult {
    pub outcome: Outcome,
    /// Canonical paths with content hashes, sorted.
    pub files: Vec<(PathBuf, [u8; 32])>,
    /// Golden images that were compared, with the hash of the content that was read.
    pub pictures: Vec<(PathBuf, Option<[u8; 32]>)>,
    /// Whether a later run may reuse the outcome if nothing has changed.
    pub is_reusable: bool,
}

/// Outcome of a section before it is run.
pub(crate) fn new_outcome(case: &Case) -> Outcome {
    match &case.section {
        Ok(info) => Outcome::new(&case.file, &info.name, info.line),
        Err(_) => Outcome::new(&case.file, "", 0),
    }
}

fn result_without_files(outcome: Outcome) -> SectionResult {
    SectionResult { outcome, files: Vec::new(), pictures: Vec::new(), is_reusable: false }
}

pub(crate) fn run(
    case: &Case,
    registry: &Registry,
    options: &TestOptions,
    image_options: &ImageOptions,
    painter: &mut Painter,
) -> SectionResult {
    let start = Instant::now();
    let mut outcome = new_outcome(case);
    let info = match &case.section {
        Ok(info) => info,
        Err(diagnostics) => {
            outcome.status = Status::Error(diagnostics_text(diagnostics));
            return result_without_files(outcome);
        }
    };
    if let Some(reason) = &info.skip {
        outcome.status = Status::Skipped(reason.clone());
        return result_without_files(outcome);
    }
    // The root in the options applies only to files below it.
    let options = TestOptions { root: case.root.clone(), ..options.clone() };
    let run = match run_section(&case.path, info.index, registry, &options) {
        Ok(run) => run,
        Err(diagnostics) => {
            outcome.status = Status::Error(diagnostics_text(&diagnostics));
            outcome.seconds = start.elapsed().as_secs_f64();
            return result_without_files(outcome);
        }
    };
    outcome.printed = run.printed.clone();
    // The effects include those of plugin files that the section uses, and perhaps further ones.
    let registry = registry.settled_for(run.stages.iter().map(|stage| &**stage));
    if let Err(DrawError::Failed(why) | DrawError::NoDevice(why)) = painter.set_effects(registry.effects()) {
        outcome.status = Status::Error(why);
        return result_without_files(outcome);
    }
    // An image of a known bug must not become a golden image.
    let without_accept = ImageOptions { accept: Accept::None, ..image_options.clone() };
    let image_options = if info.fails.is_some() { &without_accept } else { image_options };
    let mut result = judge(case, outcome, &run, &registry, image_options, painter);
    if let Some(why) = &info.fails {
        invert_known_bug(&mut result.outcome, why);
    }
    if let Some(Err(why)) = run.timeout.map(|timeout| timeout.check()) {
        result.outcome.status = Status::Error(format!("{}: {why}", result.outcome.place));
        result.outcome.checks.clear();
        result.is_reusable = false;
    }
    result.outcome.seconds = start.elapsed().as_secs_f64();
    result.files = run.files_used;
    result
}

fn judge(
    case: &Case,
    mut outcome: Outcome,
    run: &SectionRun,
    registry: &Registry,
    options: &ImageOptions,
    painter: &mut Painter,
) -> SectionResult {
    let mut pictures = Vec::new();
    if !run.errors.is_empty() {
        let mut texts = vec![diagnostics_text(&run.errors)];
        for e in run.expected.iter().filter(|e| !e.has_occurred) {
            texts.push(format!("{}:{}: expected, but it did not occur: {}", case.file, e.line, e.text));
        }
        outcome.status = Status::Error(texts.join("\n"));
        return result_without_files(outcome);
    }
    if run.asserts_nothing() {
        outcome.status = Status::Error(format!(
            "{}: this section asserts nothing, so it cannot fail\n    hint: add an expect(…) or expect_image(…), or //~ error: TEXT where an error is expected",
            outcome.place
        ));
        return result_without_files(outcome);
    }
    outcome.checks = evaluate(run, registry);
    let mut skipped = None;
    if run.stage_errors.is_empty() {
        for expectation in &run.expectations {
            let Claim::Image(wanted) = &expectation.claim else { continue };
            if run.timeout.is_some_and(|timeout| timeout.check().is_err()) {
                break;
            }
            let at = &expectation.place;
            let place = SourceLocation { file: at.file.clone(), line: at.line, column: at.column };
            let Some(stage) = run.stages.get(expectation.stage) else { continue };
            let section_ref =
                SectionRef { path: &case.path, file: &case.file, section: &outcome.section, place };
            let read = match images::judge(wanted, stage, &section_ref, painter, options) {
                ImageOutcome::Check(check, read) => {
                    outcome.checks.push(*check);
                    read
                }
                ImageOutcome::Skipped(reason) => {
                    skipped = Some(reason);
                    None
                }
            };
            pictures.push((golden_image::path_of(&case.path, &wanted.name), read));
        }
        if let Some(stage) = run.stages.first().filter(|_| run.info.is_whole_file()) {
            outcome.checks.push(check_drawable(case, stage, painter));
        }
    }
    // Most warnings are already failed checks.
    let reported = |d: &&Diagnostic| outcome.checks.iter().any(|c| !c.passed && c.got == d.message);
    outcome.warnings = run.warnings.iter().filter(|d| !reported(d)).map(ToString::to_string).collect();
    // Checks are sorted by their place in the script; checks of the file as a whole come first.
    outcome.checks.sort_by_key(|c| match c.place.file == run.info.file {
        true => (c.place.line, c.place.column),
        false => (0, 0),
    });
    outcome.status = match (outcome.checks.iter().all(|c| c.passed), skipped) {
        (false, _) => Status::Failed,
        (true, Some(reason)) => Status::Skipped(reason),
        (true, None) => Status::Passed,
    };
    let expects_errors = run.expected.iter().any(|e| e.severity == choreo_script::Severity::Error);
    let accepted = outcome.checks.iter().any(|c| c.by == images::ACCEPTED);
    let is_reusable = outcome.status == Status::Passed && !expects_errors && !accepted;
    SectionResult { outcome, files: Vec::new(), pictures, is_reusable }
}

/// Check that a script without sections can be drawn; draws one frame at half its length.
fn check_drawable(case: &Case, stage: &Arc<Stage>, painter: &mut Painter) -> Check {
    let middle = Time(stage.settings.length.0 / 2);
    let [w, h] = stage.settings.size;
    let size = if w > h { [160, (160 * h / w).max(1)] } else { [(160 * w / h.max(1)).max(1), 160] };
    let drawn = painter.draw(stage, &ImageRequest { at: middle, size, samples: 1, device: Device::Cpu });
    let (passed, got) = match drawn {
        Ok((frame, _)) => (true, format!("{}x{} pixels", frame.width, frame.height)),
        Err(DrawError::Failed(why) | DrawError::NoDevice(why)) => (false, why),
    };
    Check {
        place: SourceLocation { file: case.file.clone(), line: 0, column: 0 },
        title: format!("can be drawn, at {} s", middle.as_secs()),
        passed,
        expected: "an image".into(),
        got,
        by: String::new(),
        hint: String::new(),
        evidence: Evidence::None,
    }
}

/// Inverts the outcome of a section marked as known to fail: it passes while it fails, and fails once the bug is fixed.
fn invert_known_bug(outcome: &mut Outcome, why: &str) {
    let first = match &outcome.status {
        Status::Error(text) => Some(text.lines().next().unwrap_or_default().to_string()),
        Status::Failed => {
            outcome.checks.iter().find(|c| !c.passed).map(|c| format!("{}: {}", c.title, c.got))
        }
        Status::Skipped(_) => return,
        Status::Passed => None,
    };
    let passed = first.is_some();
    outcome.status = if passed { Status::Passed } else { Status::Failed };
    outcome.checks = vec![Check {
        place: outcome.place.clone(),
        title: format!("known to fail: {why}"),
        passed,
        expected: "a failure".into(),
        got: first.unwrap_or_else(|| "it passes".into()),
        by: String::new(),
        hint: if passed {
            String::new()
        } else {
            "the bug is fixed: remove its mark from the section".into()
        },
        evidence: Evidence::None,
    }];
}

fn diagnostics_text(diagnostics: &[Diagnostic]) -> String {
    let texts: Vec<String> = diagnostics.iter().map(ToString::to_string).collect();
    texts.join("\n")
}
