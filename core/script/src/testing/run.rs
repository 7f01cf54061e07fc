//! Lists and runs the test sections of a file.

use super::file::Listing;
use super::*;
use crate::build::{RunMode, ScriptContext};
use crate::compile::UnknownVariable;
use crate::content::add_to_hash;
use crate::resolve::resolve_test_stage;
use crate::run::{Opened, begin, execute, on_script_thread, open};
use choreo_plugin::Registry;
use std::collections::BTreeSet;
use std::path::Path;
use std::sync::PoisonError;

/// The sections of a file in order, or one for the whole file if it has no sections. The file is run without its sections; errors
/// of that run are reported by the run of each section.
///
/// # Errors
/// Returns an error if the file cannot be read.
pub fn list_sections(
    path: &Path,
    registry: &Registry,
    options: &TestOptions,
) -> Result<Vec<SectionInfo>, Vec<Diagnostic>> {
    let root = options.root.as_deref();
    let opened = open(path, root, RunMode::ListTests, registry, &options.script).map_err(|e| vec![e])?;
    let files = options.files.clone();
    on_script_thread(move || {
        let Opened { name, text, context } = &opened;
        // The engine is kept until the end, because handles refer to parts of it.
        let engine = begin(name, text, context);
        let file = files.read(&engine, context, name, text);
        execute(
            &engine,
            name,
            context,
            file.as_ref().map(|f| (&f.parsed, &f.parsed.ast)).map_err(Clone::clone),
        );
        let mut test = std::mem::take(&mut *context.test());
        if test.sections.is_empty() {
            return Ok(vec![whole_file_section(name, text)]);
        }
        if let Ok(file) = &file
            && !test.has_failed_test_call
        {
            files.store_listing(file, Listing::new(&file.parsed, test.sections.clone(), &test.calls));
        }
        Ok(std::mem::take(&mut test.sections))
    })
}

/// Errors that `check` finds in the sections of a file.
#[derive(Clone, Debug, Default)]
pub struct SectionErrors {
    /// Errors that no comment expects, in the order of the sections, without duplicates.
    pub errors: Vec<Diagnostic>,
    /// Canonical paths of all files that the sections have read; sorted.
    pub read: BTreeSet<PathBuf>,
}

/// Runs all sections of a file without judging expectations. Skipped sections and those with a known bug are left out, and so are
/// all sections after `should_continue` has returned false.
pub fn check_sections(
    path: &Path,
    registry: &Registry,
    options: &TestOptions,
    should_continue: &dyn Fn() -> bool,
) -> SectionErrors {
    let mut found = SectionErrors::default();
    let sections = list_sections(path, registry, options).unwrap_or_default();
    let is_checked =
        |info: &&SectionInfo| !info.is_whole_file() && info.skip.is_none() && info.fails.is_none();
    for info in sections.iter().filter(is_checked) {
        if !should_continue() {
            break;
        }
        let errors = match run_section(path, info.index, registry, options) {
            Err(errors) => errors,
            Ok(run) => {
                found.read.extend(run.files_used.iter().map(|(path, _)| path.clone()));
                let mut errors = run.errors.clone();
                if errors.is_empty() && run.asserts_nothing() {
                    errors.push(no_assertion_error(&run.info));
                }
                errors
            }
        };
        for error in errors {
            if !found.errors.contains(&error) {
                found.errors.push(error);
            }
        }
    }
    found
}

/// The error of a section that cannot fail.
fn no_assertion_error(info: &SectionInfo) -> Diagnostic {
    let text = format!("the section \"{}\" asserts nothing, so it cannot fail", info.name);
    Diagnostic {
        line: info.line,
        hint: Some(
            "add an expect(…) or expect_image(…), or //~ error: TEXT where an error is expected".into(),
        ),
        ..Diagnostic::error(text).in_file(&info.file)
    }
}

/// Whether a text calls `test` anywhere.
pub fn has_sections(text: &str) -> bool {
    let tokens = crate::tokens::token_ranges(text);
    let word = |at: usize| tokens.get(at).map_or("", |range| &text[range.clone()]);
    (0..tokens.len()).any(|at| word(at) == "test" && word(at + 1) == "(" && (at == 0 || word(at - 1) != "."))
}

/// The section that stands for a whole file without sections.
fn whole_file_section(file: &str, text: &str) -> SectionInfo {
    SectionInfo {
        index: 0,
        name: String::new(),
        file: file.to_string(),
        line: 0,
        end_line: text.lines().count(),
        skip: None,
        fails: None,
        tags: Vec::new(),
    }
}

/// Runs one section, by its index in [`list_sections`], on its own stage.
///
/// # Errors
/// Returns an error if the file cannot be read or no longer has the section.
pub fn run_section(
    path: &Path,
    index: usize,
    registry: &Registry,
    options: &TestOptions,
) -> Result<SectionRun, Vec<Diagnostic>> {
    let opened = open_section(path, index, registry, options)?;
    if !needs_pixels(&opened.text) && options.script.requested_parts.pixels {
        // Decoding images takes longer than everything else, so it is skipped if the text shows that the test does not need
        // pixels.
        let mut without_pixels = options.clone();
        without_pixels.script.requested_parts.pixels = false;
        let opened = open_section(path, index, registry, &without_pixels)?;
        let context = opened.context.clone();
        let run = run_opened_section(path, index, registry, &without_pixels, opened)?;
        // An imported module may need pixels.
        let sources = context.sources.lock().unwrap_or_else(PoisonError::into_inner);
        if !sources.values().any(|text| needs_pixels(text)) {
            return Ok(run);
        }
    }
    run_opened_section(path, index, registry, options, opened)
}

/// Whether a test compares images or inspects plans, by the names of the functions in its text.
fn needs_pixels(text: &str) -> bool {
    ["expect_image", "expect_picture", "plan(", "same_as", "costs_at_most"]
        .iter()
        .any(|word| text.contains(word))
}

/// Runs one section of an opened file, and a file without sections twice.
fn run_opened_section(
    path: &Path,
    index: usize,
    registry: &Registry,
    options: &TestOptions,
    opened: Opened,
) -> Result<SectionRun, Vec<Diagnostic>> {
    let run = |opened: Opened, run_all: bool| {
        let files = options.files.clone();
        on_script_thread(move || run_section_on_this_thread(&opened, index, &files, run_all))
    };
    let reopen = || open_section(path, index, registry, options);
    let mut section = match run(opened, false)? {
        Some(section) => section,
        // The file behaves differently than when its sections were listed.
        None => run(reopen()?, true)?.ok_or_else(Vec::new)?,
    };
    if section.info.is_whole_file() && section.errors.is_empty() && section.stage_errors.is_empty() {
        let second_run = run(reopen()?, true)?.ok_or_else(Vec::new)?;
        section.second_run_hash = Some(second_run.stages[0].content_hash());
    }
    Ok(section)
}

/// Reads a test file to run one of its sections.
fn open_section(
    path: &Path,
    index: usize,
    registry: &Registry,
    options: &TestOptions,
) -> Result<Opened, Vec<Diagnostic>> {
    let root = options.root.as_deref();
    let mut opened =
        open(path, root, RunMode::RunTest(index), registry, &options.script).map_err(|e| vec![e])?;
    if let Some(context) = Arc::get_mut(&mut opened.context) {
        context.timeout = options.timeout;
    }
    Ok(opened)
}

/// Runs a section on this thread. `run_all`: runs the complete file, as if its sections were not known. Returns `None` if the
/// sections are known, but the run has not reached the wanted section.
fn run_section_on_this_thread(
    opened: &Opened,
    index: usize,
    files: &TestFiles,
    run_all: bool,
) -> Result<Option<SectionRun>, Vec<Diagnostic>> {
    let Opened { name, text, context } = opened;
    let engine = begin(name, text, context);
    let file = files.read(&engine, context, name, text);
    let listing = file.as_ref().ok().and_then(|f| f.listing()).filter(|_| !run_all).cloned();
    let listing = listing.filter(|listing| index < listing.sections.len());
    let section_ast = match (&file, &listing) {
        (Ok(file), Some(listing)) => {
            context.test().wanted_section = Some(listing.sections[index].clone());
            Some(listing.ast_of_section(index, &file.parsed))
        }
        _ => None,
    };
    let script = file.as_ref().map(|f| (&f.parsed, section_ast.as_ref().unwrap_or(&f.parsed.ast)));
    execute(&engine, name, context, script.map_err(Clone::clone));
    let (mut stage, mut stage_errors) = resolve_test_stage(context, &engine);
    let mut test = std::mem::take(&mut *context.test());
    if test.wanted_section.is_some() && !test.has_started {
        return Ok(None);
    }
    let sections = listing.as_ref().map_or(&test.sections, |listing| &listing.sections);
    let info = section_info(sections, index, name, text)?;
    let (all_expected, wrong_comments) = match &file {
        Ok(file) => (&file.expected, file.wrong_comments.clone()),
        Err(_) => {
            let (expected, wrong) = comments::parse_expected(name, text);
            (&expected.clone(), wrong)
        }
    };
    let mut expected = expected_in_section(all_expected, &info, sections);
    if let Ok(file) = &file {
        let unknown = unknown_in_section(&file.parsed.unknown, &info, sections);
        crate::errors::report_unknown_variables(&unknown, name, context);
    }
    let mut stage_draft = context.stage_draft.lock().unwrap_or_else(PoisonError::into_inner);
    let mut diagnostics = std::mem::take(&mut stage_draft.diagnostics);
    let is_warning = |d: &Diagnostic| d.severity == Severity::Warning;
    stage.warnings.extend(diagnostics.iter().filter(|d| is_warning(d)).map(ToString::to_string));
    comments::match_expected(name, &test.scenes, &mut expected, &mut diagnostics);
    let (warnings, mut errors): (Vec<_>, Vec<_>) = diagnostics.into_iter().partition(is_warning);
    errors.extend(wrong_comments);
    errors.extend(stage_draft.error_about_limit());
    if errors.is_empty() && expected.iter().all(|e| e.severity == Severity::Warning) {
        // No expected error explains the invalid stage, so its errors are reported.
        errors.append(&mut stage_errors);
    }
    let files_used: Vec<_> = context.loader.files_read().into_iter().collect();
    let mut stages = vec![Arc::new(stage)];
    stages.append(&mut test.stages);
    Ok(Some(SectionRun {
        hash: hash_section(&info, context, &files_used),
        info,
        stages,
        expectations: test.expectations,
        expected,
        errors,
        warnings,
        stage_errors,
        second_run_hash: None,
        // Judging a stage at many times takes longer than the script, which has its own limit.
        seconds: 3.0 * context.limits.seconds,
        timeout: context.timeout,
        printed: stage_draft.take_printed(context.limits.printed),
        files_used,
    }))
}

/// The section with this index, or the section of a whole file without sections.
fn section_info(
    sections: &[SectionInfo],
    index: usize,
    name: &str,
    text: &str,
) -> Result<SectionInfo, Vec<Diagnostic>> {
    match sections.get(index) {
        Some(info) => Ok(info.clone()),
        None if sections.is_empty() && index == 0 => Ok(whole_file_section(name, text)),
        None => {
            let count = sections.len();
            let error =
                Diagnostic::error(format!("section {index} no longer exists: the file now has {count}"));
            Err(vec![error.in_file(name)])
        }
    }
}

/// The unknown variables, except those in other sections.
fn unknown_in_section(
    all: &[UnknownVariable],
    own: &SectionInfo,
    sections: &[SectionInfo],
) -> Vec<UnknownVariable> {
    let within = |s: &SectionInfo, line: usize| (s.line..=s.end_line).contains(&line);
    let line = |variable: &UnknownVariable| variable.at.line().unwrap_or(0);
    let is_own = |v: &&UnknownVariable| within(own, line(v)) || !sections.iter().any(|s| within(s, line(v)));
    all.iter().filter(is_own).cloned().collect()
}

/// The expected diagnostics, except those in other sections.
fn expected_in_section(
    expected: &[ExpectedDiagnostic],
    own: &SectionInfo,
    all: &[SectionInfo],
) -> Vec<ExpectedDiagnostic> {
    let Some(last) = expected.iter().map(|e| e.line).max() else { return Vec::new() };
    let mut in_section = vec![false; last + 1];
    for s in all.iter().filter(|s| s.line <= last) {
        in_section[s.line..=s.end_line.min(last)].fill(true);
    }
    let own = own.line..=own.end_line;
    expected.iter().filter(|e| own.contains(&e.line) || !in_section[e.line]).cloned().collect()
}

/// Hash of everything on which the outcome of a section depends, apart from program and device.
fn hash_section(info: &SectionInfo, context: &ScriptContext, files: &[(PathBuf, [u8; 32])]) -> [u8; 32] {
    let mut hasher = blake3::Hasher::new();
    let mut add = |bytes: &[u8]| add_to_hash(&mut hasher, bytes);
    add(info.name.as_bytes());
    for (name, value) in &context.set_parameters {
        add(name.as_bytes());
        add(value.as_bytes());
    }
    add(format!("{:?}", context.limits).as_bytes());
    // Sorted by hash, so that the paths of the files do not matter.
    let mut contents: Vec<_> = files.iter().map(|(_, content)| content).collect();
    contents.sort_unstable();
    contents.into_iter().for_each(|content| add(content));
    *hasher.finalize().as_bytes()
}
