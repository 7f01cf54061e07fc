//! Runs sections on all cores. Outcomes are reported in the order of the sections, regardless of which finishes first.

use crate::collect::Case;
use crate::images::ImageOptions;
use crate::outcome::{Check, Evidence, Outcome, Status};
use crate::painter::Painter;
use crate::results::Results;
use crate::section::{self, SectionResult, new_outcome};
use choreo_plugin::{PluginPanic, Registry};
use choreo_script::testing::{TestOptions, Timeout};
use std::collections::{BTreeMap, BTreeSet};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::Instant;

#[derive(Clone, Debug, Default)]
pub struct RunOptions {
    pub test: TestOptions,
    pub images: ImageOptions,
    /// Number of sections run at the same time; 0 stands for one per core.
    pub jobs: usize,
    /// Time limit of a section in seconds; `None` for no limit.
    pub timeout: Option<f64>,
    /// Folder in which outcomes are stored for later runs, if any.
    pub results: Option<PathBuf>,
    /// Whether outcomes of earlier runs are reused if nothing has changed.
    pub changed: bool,
    /// Identifies this build of the program.
    pub program: String,
    /// Folder for the pipeline cache, kept between runs.
    pub gpu_cache: Option<PathBuf>,
    /// Further arguments of the command that runs a section again, such as ` --plugins DIR`; empty if none is needed.
    pub rerun_arguments: String,
}

/// Results of a run.
#[derive(Clone, Debug, Default)]
pub struct Report {
    /// Outcomes in the order of the sections.
    pub outcomes: Vec<Outcome>,
    /// Wall time in seconds.
    pub seconds: f64,
    /// Canonical paths of all files that were read, for watching them.
    pub files: BTreeSet<PathBuf>,
    /// Names of all images that were compared.
    pub images: BTreeSet<String>,
    /// Golden images of the files that were run which no section requests.
    pub unused_images: Vec<PathBuf>,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    pub passed: usize,
    pub failed: usize,
    /// Number of sections that could not be judged.
    pub errors: usize,
    pub skipped: usize,
    /// Number of passed sections whose result was reused from an earlier run.
    pub reused: usize,
    pub checks: usize,
    pub warnings: usize,
    /// Number of images accepted as golden images.
    pub accepted: usize,
}

impl Report {
    pub fn counts(&self) -> Counts {
        let mut counts = Counts::default();
        for outcome in &self.outcomes {
            match outcome.status {
                Status::Passed => counts.passed += 1,
                Status::Failed => counts.failed += 1,
                Status::Error(_) => counts.errors += 1,
                Status::Skipped(_) => counts.skipped += 1,
            }
            counts.reused += usize::from(outcome.reused);
            counts.checks += outcome.checks.len();
            counts.warnings += outcome.warnings.len();
            counts.accepted += outcome.checks.iter().filter(|c| c.by == crate::images::ACCEPTED).count();
        }
        counts
    }

    /// Reason why the run as a whole failed; `None` if it succeeded.
    pub fn failure(&self) -> Option<String> {
        let counts = self.counts();
        let bad = counts.failed + counts.errors;
        let all = self.outcomes.len();
        match (bad, all, counts.passed) {
            (0, 0, _) => Some("no section was found, so nothing was tested".into()),
            (0, 1, 0) => Some("the only section was skipped, so nothing was tested".into()),
            (0, _, 0) => Some(format!("all {all} sections were skipped, so nothing was tested")),
            (0, ..) => None,
            (1, ..) => Some("1 section failed".into()),
            (n, ..) => Some(format!("{n} sections failed")),
        }
    }
}

/// Runs the sections. `on_outcome` gets the outcomes in order, each as soon as all before it are known.
pub fn run(
    cases: &[Case],
    registry: &Registry,
    options: &RunOptions,
    on_outcome: &mut (dyn FnMut(&Outcome) + Send),
) -> Report {
    let start = Instant::now();
    let results = options.results.as_ref().map(|folder| {
        let p = &options.images;
        let s = &options.test.script;
        let identity = [
            options.program.clone(),
            format!("{:?} {:?} {:?} {:?}", s.search_paths, s.set_parameters, s.limits, s.requested_parts),
            format!("{:?} {:?} {}", options.test.root, p.device, p.any_device),
        ];
        Results::new(folder.clone(), &identity.each_ref().map(String::as_str))
    });
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let jobs = if options.jobs == 0 { cores } else { options.jobs };
    let workers = jobs.min(cases.len()).max(1);
    let next = AtomicUsize::new(0);
    let reporter = Mutex::new(OutcomeReporter {
        waiting: BTreeMap::new(),
        on_outcome,
        report: Report::default(),
        image_owners: BTreeMap::new(),
        rerun_arguments: &options.rerun_arguments,
    });
    let worker = || {
        // If there are fewer sections than cores, each image is drawn by several threads.
        let pool = rayon::ThreadPoolBuilder::new().num_threads((jobs / workers).max(1)).build();
        let mut painter = Painter::new(registry.effects(), options.gpu_cache.clone());
        loop {
            let index = next.fetch_add(1, Ordering::SeqCst);
            let Some(case) = cases.get(index) else { return };
            let mut work = || run_case(case, registry, options, results.as_ref(), &mut painter);
            let result = catch_unwind(AssertUnwindSafe(|| match &pool {
                Ok(pool) => pool.install(&mut work),
                Err(_) => work(),
            }));
            let result = result.unwrap_or_else(|panic| {
                painter = Painter::new(registry.effects(), options.gpu_cache.clone());
                outcome_of_panic(case, panic.as_ref())
            });
            reporter.lock().unwrap_or_else(PoisonError::into_inner).report(index, result);
        }
    };
    std::thread::scope(|scope| {
        let thread = || std::thread::Builder::new().name("section".into()).spawn_scoped(scope, worker);
        // If some threads cannot be started, the run only takes longer; if none can, this thread does the work.
        if (0..workers).map_while(|_| thread().ok()).count() == 0 {
            worker();
        }
    });
    let OutcomeReporter { mut report, image_owners, .. } =
        reporter.into_inner().unwrap_or_else(PoisonError::into_inner);
    let name = |path: &PathBuf| Some(path.file_stem()?.to_string_lossy().into_owned());
    report.images = image_owners.keys().filter_map(name).collect();
    report.unused_images = unused_golden_images(cases, &report, &image_owners);
    report.seconds = start.elapsed().as_secs_f64();
    report
}

fn run_case(
    case: &Case,
    registry: &Registry,
    options: &RunOptions,
    results: Option<&Results>,
    painter: &mut Painter,
) -> SectionResult {
    if let Some(found) = results.filter(|_| options.changed).and_then(|r| r.find(case)) {
        // Hashes of these files have been compared already, and are not needed again.
        let files = found.files.into_iter().map(|f| (f, [0; 32])).collect();
        let pictures = found.pictures.into_iter().map(|p| (p, None)).collect();
        return SectionResult { outcome: found.outcome, files, pictures, is_reusable: false };
    }
    let timeout = options.timeout.map(Timeout::after);
    let test = TestOptions { timeout, ..options.test.clone() };
    let mut result = section::run(case, registry, &test, &options.images, painter);
    if let Some(results) = results {
        if result.is_reusable {
            let folders = search_folders(case, &options.test);
            results.store(case, &mut result.outcome, &result.files, &result.pictures, &folders);
        } else {
            results.remove(case);
        }
    }
    result
}

/// Folders in which a section's files are looked for.
fn search_folders(case: &Case, options: &TestOptions) -> Vec<PathBuf> {
    let own =
        case.path.parent().map(|p| if p.as_os_str().is_empty() { PathBuf::from(".") } else { p.into() });
    let all = own.into_iter().chain(case.root.clone()).chain(options.script.search_paths.iter().cloned());
    all.filter_map(|folder| folder.canonicalize().ok()).collect()
}

/// Outcome of a section in which a plugin or the program itself panicked; other sections continue.
fn outcome_of_panic(case: &Case, panic: &(dyn std::any::Any + Send)) -> SectionResult {
    let own = || {
        let text = panic.downcast_ref::<String>().map(String::as_str);
        let text = text.or_else(|| panic.downcast_ref::<&str>().copied()).unwrap_or("no message");
        format!("a fault of choreo itself, please report it: {text}")
    };
    let text = panic.downcast_ref::<PluginPanic>().map_or_else(own, ToString::to_string);
    let mut outcome = new_outcome(case);
    outcome.status = Status::Error(format!("{}: {text}", case.file));
    SectionResult { outcome, files: Vec::new(), pictures: Vec::new(), is_reusable: false }
}

/// Restores the order of outcomes that arrive in any order.
struct OutcomeReporter<'a> {
    waiting: BTreeMap<usize, SectionResult>,
    on_outcome: &'a mut (dyn FnMut(&Outcome) + Send),
    report: Report,
    /// Golden images, each with the section that owns it.
    image_owners: BTreeMap<PathBuf, String>,
    rerun_arguments: &'a str,
}

impl OutcomeReporter<'_> {
    fn report(&mut self, index: usize, result: SectionResult) {
        self.waiting.insert(index, result);
        while let Some(mut result) = self.waiting.remove(&self.report.outcomes.len()) {
            self.check_unique_images(&mut result);
            result.outcome.rerun_arguments = self.rerun_arguments.to_string();
            self.report.files.extend(result.files.into_iter().map(|(path, _)| path));
            (self.on_outcome)(&result.outcome);
            self.report.outcomes.push(result.outcome);
        }
    }

    /// Fails a section that uses the golden image of another one: both would be compared with the same image, and overwrite it when
    /// accepted.
    fn check_unique_images(&mut self, result: &mut SectionResult) {
        for (path, _) in &result.pictures {
            let name = result.outcome.name();
            let Some(owner) = self.image_owners.insert(path.clone(), name) else { continue };
            let stem = path.file_stem().unwrap_or_default().to_string_lossy();
            result.outcome.checks.push(Check {
                place: result.outcome.place.clone(),
                title: format!("image \"{stem}\" has a unique name"),
                passed: false,
                expected: "different names within a file".into(),
                got: format!("{owner} has an image of this name too"),
                by: String::new(),
                hint: "give one of them another name".into(),
                evidence: Evidence::None,
            });
            if !result.outcome.has_failed() {
                result.outcome.status = Status::Failed;
            }
        }
    }
}

/// Golden images that no section requests, in files whose sections have all been judged.
fn unused_golden_images(
    cases: &[Case],
    report: &Report,
    image_owners: &BTreeMap<PathBuf, String>,
) -> Vec<PathBuf> {
    let mut found = Vec::new();
    let mut files: BTreeMap<&PathBuf, (usize, usize, bool)> = BTreeMap::new();
    for (case, outcome) in cases.iter().zip(&report.outcomes) {
        let judged = matches!(outcome.status, Status::Passed | Status::Failed);
        let entry = files.entry(&case.path).or_insert((0, case.section_lines.len(), true));
        entry.0 += 1;
        entry.2 &= judged;
    }
    for (path, (ran, all, judged)) in files {
        let folder = crate::golden_image::path_of(path, "any");
        let Some(folder) = folder.parent().filter(|_| ran == all && judged) else { continue };
        let Ok(entries) = std::fs::read_dir(folder) else { continue };
        for entry in entries.flatten() {
            let place = folder.join(entry.file_name());
            if place.extension().is_some_and(|e| e == "png") && !image_owners.contains_key(&place) {
                found.push(place);
            }
        }
    }
    found.sort();
    found
}
