//! Lists and runs the sections of a file.

use super::*;
use crate::build::{Mode, Shared};
use crate::call::{ApiError, Place};
use crate::finish::finish;
use crate::run::{Opened, execute, hex, on_own_thread, open};
use choreo_plugin::Registry;
use rhai::Engine;
use std::path::Path;
use std::sync::PoisonError;

/// The sections of a file, in its order; of a file without any, the one that is the file as it stands. The file is run, but none
/// of its sections; its errors are those of each section's run. An error: the file cannot be read.
pub fn list_sections(
    path: &Path,
    registry: &Registry,
    options: &TestOptions,
) -> Result<Vec<SectionInfo>, Vec<Diagnostic>> {
    let root = options.root.as_deref();
    let opened = open(path, root, Mode::List, registry, &options.script).map_err(|e| vec![e])?;
    on_own_thread(move || {
        // Kept alive to the end: handles hold parts of it.
        let _engine = execute(&opened.name, &opened.text, &opened.shared);
        let mut sections = std::mem::take(&mut opened.shared.test().sections);
        if sections.is_empty() {
            sections.push(as_it_stands(&opened.name, &opened.text));
        }
        Ok(sections)
    })
}

fn as_it_stands(file: &str, text: &str) -> SectionInfo {
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

/// Runs one section, by its index in [`list_sections`], on a stage of its own. An error: the file cannot be read, or has no such
/// section any more.
pub fn run_section(
    path: &Path,
    index: usize,
    registry: &Registry,
    options: &TestOptions,
) -> Result<SectionRun, Vec<Diagnostic>> {
    let root = options.root.as_deref();
    let opened = open(path, root, Mode::Section(index), registry, &options.script).map_err(|e| vec![e])?;
    if !sees_pixels(&opened.text) && options.script.needs.pixels {
        // Decoding pictures takes longer than everything else: it is left out where the text shows that nobody looks.
        let mut script = options.script.clone();
        script.needs.pixels = false;
        let opened = open(path, root, Mode::Section(index), registry, &script).map_err(|e| vec![e])?;
        let shared = opened.shared.clone();
        let plain = TestOptions { script, root: options.root.clone() };
        let run = section(path, index, registry, &plain, opened)?;
        // A module may look in its place.
        let sources = shared.sources.lock().unwrap_or_else(PoisonError::into_inner);
        if !sources.values().any(|text| sees_pixels(text)) {
            return Ok(run);
        }
    }
    section(path, index, registry, options, opened)
}

/// What compares pictures, or what they are made of, is called so.
fn sees_pixels(text: &str) -> bool {
    ["expect_picture", "plan(", "same_as", "costs_at_most"].iter().any(|word| text.contains(word))
}

fn section(
    path: &Path,
    index: usize,
    registry: &Registry,
    options: &TestOptions,
    opened: Opened,
) -> Result<SectionRun, Vec<Diagnostic>> {
    let root = options.root.as_deref();
    let mut run = on_own_thread(move || run_here(&opened.name, &opened.text, index, &opened.shared))?;
    if run.info.as_it_stands() && run.errors.is_empty() && run.broken.is_empty() {
        let opened =
            open(path, root, Mode::Section(index), registry, &options.script).map_err(|e| vec![e])?;
        let again = on_own_thread(move || run_here(&opened.name, &opened.text, index, &opened.shared))?;
        run.hash_again = Some(again.stages[0].content_hash());
    }
    Ok(run)
}

fn run_here(
    name: &str,
    text: &str,
    index: usize,
    shared: &Arc<Shared>,
) -> Result<SectionRun, Vec<Diagnostic>> {
    let engine = execute(name, text, shared);
    let (mut stage, mut broken) = finish_stage(shared, &engine);
    let mut test = std::mem::take(&mut *shared.test());
    let info = match test.sections.get(index) {
        Some(info) => info.clone(),
        None if test.sections.is_empty() && index == 0 => as_it_stands(name, text),
        None => {
            let count = test.sections.len();
            let error = Diagnostic::error(format!("section {index} is gone: the file has {count} now"));
            return Err(vec![error.in_file(name)]);
        }
    };
    let (mut expected, wrong_comments) = comments::parse(name, text);
    // What the other sections expect is theirs.
    let in_section = |s: &SectionInfo, line: usize| (s.line..=s.end_line).contains(&line);
    expected.retain(|e| {
        in_section(&info, e.line) || !test.sections.iter().any(|other| in_section(other, e.line))
    });
    let mut build = shared.build.lock().unwrap_or_else(PoisonError::into_inner);
    let mut came = std::mem::take(&mut build.diagnostics);
    let warning = |d: &Diagnostic| d.severity == Severity::Warning;
    stage.warnings.extend(came.iter().filter(|d| warning(d)).map(ToString::to_string));
    comments::meet(name, &test.scenes, &mut expected, &mut came);
    let (warnings, mut errors): (Vec<_>, Vec<_>) = came.into_iter().partition(warning);
    errors.extend(wrong_comments);
    if build.more > 0 {
        errors.push(Diagnostic::error(format!("and {} more", build.more)));
    }
    if errors.is_empty() && expected.iter().all(|e| e.severity == Severity::Warning) {
        // Nothing explains them away.
        errors.append(&mut broken);
    }
    let files_used: Vec<_> = shared.loader.used().into_iter().collect();
    let mut stages = vec![Arc::new(stage)];
    stages.append(&mut test.stages);
    Ok(SectionRun {
        hash: hash(&info, shared, &files_used),
        info,
        stages,
        expectations: test.expectations,
        expected,
        errors,
        warnings,
        broken,
        hash_again: None,
        // Running the script may take as long; looking at it at many times takes longer.
        seconds: 3.0 * shared.limits.seconds,
        printed: std::mem::take(&mut build.printed),
        files_used,
    })
}

/// The stage that has been built, and what is wrong with it as a whole.
pub fn finish_stage(shared: &Arc<Shared>, engine: &Arc<Engine>) -> (Stage, Vec<Diagnostic>) {
    // A callback is told from others by the text that it stands in.
    let identity = |place: &Place| {
        let sources = shared.sources.lock().unwrap_or_else(PoisonError::into_inner);
        let text = sources.get(&place.file).cloned().unwrap_or_default();
        hex(blake3::hash(text.as_bytes()).as_bytes())
    };
    let (stage, _) = finish(shared, engine, &identity);
    let broken = stage.check().iter().map(|problem| Diagnostic::error(problem.to_string())).collect();
    (stage, broken)
}

fn hash(info: &SectionInfo, shared: &Shared, files: &[(PathBuf, [u8; 32])]) -> [u8; 32] {
    let mut hasher = blake3::Hasher::new();
    let mut add = |bytes: &[u8]| {
        hasher.update(&(bytes.len() as u64).to_le_bytes());
        hasher.update(bytes);
    };
    add(info.name.as_bytes());
    for (name, value) in &shared.set {
        add(name.as_bytes());
        add(value.as_bytes());
    }
    add(format!("{:?}", shared.limits).as_bytes());
    // Sorted by content: where the files lie does not matter.
    let mut contents: Vec<_> = files.iter().map(|(_, content)| content).collect();
    contents.sort_unstable();
    contents.into_iter().for_each(|content| add(content));
    *hasher.finalize().as_bytes()
}

/// Notes what a section has left undone.
pub fn end_section(shared: &Shared) {
    let open: Vec<Place> = {
        let test = shared.test();
        test.asked.iter().filter(|(_, compared)| *compared == 0).map(|(place, _)| place.clone()).collect()
    };
    for place in open {
        let error = ApiError::new("this expect compares with nothing")
            .hint("end it with a comparison, as .near(…), .below(…), .equals(…) or .in_frame()");
        shared.note(Severity::Error, &place, &error);
    }
}
