//! `choreo test`: runs sections of scripts as tests, and reports the results on the terminal and in files.

mod progress;
mod watch;

use crate::args::values;
use crate::args::{Device, TestArgs};
use crate::drawing::device;
use crate::failure::{Failure, print, print_json, write_failure};
use crate::output::target::check_folder_exists;
use crate::plugins::plugin_files;
use crate::process::threads::too_few_threads;
use crate::project_file;
use crate::scene::inputs::Inputs;
use crate::scene::pack::{self, Unpacked};
use choreo_files::{Folder, WriteError, write_whole};
use choreo_plugin::Registry;
use choreo_script::testing::TestOptions;
use choreo_script::{NO_THREAD, ScriptOptions, did_you_mean};
use choreo_session::plugin_files::Listing;
use choreo_test_runner::collect::{self, Case, NothingToRun, Selection, shell_quote};
use choreo_test_runner::images::{Accept, ImageOptions};
use choreo_test_runner::outcome::Status;
use choreo_test_runner::report::{html, json, junit, terminal};
use choreo_test_runner::run::{Report, RunOptions, run as run_cases};
use choreo_test_runner::{painter, results};
use serde_json::json;
use std::path::{Path, PathBuf};

/// Folders that are searched for tests if the command line names none.
const DEFAULT_FOLDERS: [&str; 2] = ["tests/suite", "scripts"];

pub(crate) fn run(mut args: TestArgs, no_project_file: bool, plugins: &Registry) -> Result<(), Failure> {
    // The unpacked folders are removed when this value is dropped.
    let _unpacked = unpack_scenes(&mut args)?;
    let job = TestJob { may_read_project: !no_project_file, ..TestJob::new(&args)? };
    if args.watch {
        return watch::run(&args, &job, plugins);
    }
    let listing = job.list_plugins(&args, plugins)?;
    let cases = job.select_cases(&listing.registry)?;
    if args.list {
        return match args.json {
            true => print_json(&json::list(&cases)),
            false => print(&terminal::list(&cases)),
        };
    }
    check_report(&run_once(&args, &job, &cases, &listing.registry)?)
}

fn check_report(report: &Report) -> Result<(), Failure> {
    match report.failure() {
        None => Ok(()),
        Some(why) if was_refused_a_thread(report) => {
            Err(too_few_threads(&format!("no thread can be started for some sections; {why}")))
        }
        Some(why) => Err(Failure::Tests(why)),
    }
}

/// Unpacks the packed scenes among the paths, and replaces them by their scripts and folders.
fn unpack_scenes(args: &mut TestArgs) -> Result<Vec<Unpacked>, Failure> {
    let limits = values::parse_limits(&args.limit)?;
    let mut all = Vec::new();
    for path in args.paths.iter_mut().filter(|path| pack::is_packed(path)) {
        if !args.accept.is_empty() || args.watch {
            let what = format!("{}: it is packed; --accept and --watch are for scripts", path.display());
            return Err(Failure::Usage(what));
        }
        let unpacked = Unpacked::open(path, limits.file)?;
        let manifest = &unpacked.manifest;
        *path = unpacked.unpacked_path(&manifest.input);
        args.search.extend(manifest.search.iter().map(|folder| unpacked.unpacked_path(folder)));
        args.plugins.extend(manifest.plugins.iter().map(|folder| unpacked.unpacked_path(folder)));
        all.push(unpacked);
    }
    Ok(all)
}

/// Runs the test scripts of a package with its plugins; tests may read in its folder. Returns the effects of plugin files that no test
/// used.
pub(crate) fn run_package(args: TestArgs, folder: &Path, plugins: &Registry) -> Result<Vec<String>, Failure> {
    let folder = vec![folder.to_path_buf()];
    let args = TestArgs { search: folder.clone(), plugins: folder, ..args };
    let job = TestJob::new(&args)?;
    let listing = job.list_plugins(&args, plugins)?;
    let cases = job.select_cases(&listing.registry)?;
    check_report(&run_once(&args, &job, &cases, &listing.registry)?)?;
    Ok(listing.unused_effects())
}

/// Tests to run: the command line, checked.
pub(crate) struct TestJob {
    paths: Vec<PathBuf>,
    selection: Selection,
    options: RunOptions,
    /// Whether tests may read files in the folder of their project.
    may_read_project: bool,
}

impl TestJob {
    fn new(args: &TestArgs) -> Result<TestJob, Failure> {
        let limits = values::parse_limits(&args.limit)?;
        let script = ScriptOptions { search_paths: args.search.clone(), limits, ..ScriptOptions::default() };
        let mut paths = args.paths.clone();
        if paths.is_empty() {
            paths = DEFAULT_FOLDERS.iter().map(PathBuf::from).filter(|p| p.is_dir()).collect();
        }
        if paths.is_empty() {
            paths.push(PathBuf::from("."));
        }
        let accept = match args.accept.as_slice() {
            [] => Accept::None,
            names if names.iter().any(String::is_empty) => Accept::All,
            names => Accept::Named(names.to_vec()),
        };
        let device = match args.device {
            None => None,
            Some(Device::Cpu) => Some(painter::Device::Cpu),
            Some(Device::Vulkan) => Some(painter::Device::Vulkan),
            Some(Device::Auto) => {
                return Err(Failure::Usage(
                    "--device auto: an image belongs to one device; write cpu or vulkan".into(),
                ));
            }
        };
        let (image_folder, results) = if args.list { (None, None) } else { work_folders()? };
        // A program that cannot be distinguished from another build must not reuse the results of that build.
        let program = results::program_identity();
        let options = RunOptions {
            // The current folder is the project if there is no `choreo.toml`: tests may use the scenes and assets in it.
            test: TestOptions { script, root: std::env::current_dir().ok(), ..TestOptions::default() },
            images: ImageOptions { accept, device, any_device: args.any_device, failures: image_folder },
            timeout: Some(values::parse_timeout(&args.timeout)?),
            jobs: args.jobs.as_deref().map(values::parse_jobs).transpose()?.unwrap_or(0),
            results: results.filter(|_| program.is_some()),
            // Only the affected sections run after a save with --watch.
            changed: args.changed || args.watch,
            program: program.unwrap_or_default(),
            gpu_cache: device::cache_dir(),
            rerun_arguments: folder_options(args),
        };
        let shard = args.shard.as_deref().map(parse_shard).transpose()?;
        for path in [&args.junit, &args.html].into_iter().flatten() {
            check_writable(path)?;
        }
        let selection = Selection { filter: args.filter.clone(), shard };
        Ok(TestJob { paths, selection, options, may_read_project: false })
    }

    /// Registry with the plugin files found now. Plugin files beside any test are available to all tests.
    fn list_plugins(&self, args: &TestArgs, plugins: &Registry) -> Result<Listing, Failure> {
        let files = collect::find_scripts(&self.paths).map_err(nothing_to_run_failure)?;
        let beside: Vec<&Path> = files.iter().map(|(file, _)| file.as_path()).collect();
        plugin_files::listing(plugins, &args.plugins, &beside)
    }

    /// Sections of the scripts, reduced to those that the command line selects.
    fn select_cases(&self, registry: &Registry) -> Result<Vec<Case>, Failure> {
        let project = |file: &Path| project_file::project_root(file).filter(|_| self.may_read_project);
        let cases = collect::collect(&self.paths, registry, &self.options.test, project)
            .map_err(nothing_to_run_failure)?;
        collect::select(cases, &self.selection).map_err(nothing_to_run_failure)
    }
}

/// Options for the folders that were given, for the commands in messages that run sections again.
fn folder_options(args: &TestArgs) -> String {
    let folder_option =
        |flag: &str, folder: &PathBuf| format!(" {flag} {}", shell_quote(&folder.display().to_string()));
    let plugins = args.plugins.iter().map(|folder| folder_option("--plugins", folder));
    plugins.chain(args.search.iter().map(|folder| folder_option("--search", folder))).collect()
}

fn nothing_to_run_failure(why: NothingToRun) -> Failure {
    match why {
        NothingToRun::Usage(text) => Failure::Usage(text),
        NothingToRun::Input(text) => Failure::input(text),
    }
}

/// Parses a shard: `2/5` → (2, 5).
fn parse_shard(text: &str) -> Result<(usize, usize), Failure> {
    let parsed = text.split_once('/').and_then(|(i, n)| Some((i.parse().ok()?, n.parse().ok()?)));
    match parsed {
        Some((i, n)) if (1..=n).contains(&i) => Ok((i, n)),
        _ => Err(Failure::Usage(format!("--shard {text}: write I/N with I from 1 to N, as 2/5"))),
    }
}

/// Fails before the tests run if a report cannot be written.
fn check_writable(path: &Path) -> Result<(), Failure> {
    if path.is_dir() {
        return Err(Failure::Output(format!("{}: cannot write: it is a folder", path.display())));
    }
    check_folder_exists(path)
}

/// Folders for images of failed tests and for earlier results: in `target` if the project has such a folder, else in the user's cache
/// folder. No other user may write to them, which excludes a shared temporary folder.
fn work_folders() -> Result<(Option<PathBuf>, Option<PathBuf>), Failure> {
    let target = Path::new("target");
    if std::fs::symlink_metadata(target).is_ok_and(|m| m.is_dir()) {
        let work = target.join("choreo-test");
        let folder = |name: &str| {
            let folder = work.join(name);
            let made =
                Folder::open(Path::new("")).map_err(WriteError::Io).and_then(|f| f.create_folders(&folder));
            match made {
                // The tests run even if results and images cannot be stored.
                Ok(_) | Err(WriteError::Io(_)) => Ok(Some(folder)),
                Err(e) => Err(write_failure(&work.display().to_string(), e)),
            }
        };
        return Ok((folder("pictures")?, folder("results")?));
    }
    let here = std::env::current_dir().unwrap_or_default();
    let cache = device::cache_dir().map(|cache| cache.join("test"));
    let image_folder = cache.as_ref().map(|c| c.join("pictures").join(results::short_hash(&here)));
    Ok((image_folder, cache))
}

/// Whether the system refused a thread to a section, which says nothing about the section.
fn was_refused_a_thread(report: &Report) -> bool {
    let mut statuses = report.outcomes.iter().map(|outcome| &outcome.status);
    statuses.any(|status| matches!(status, Status::Error(text) if text.contains(NO_THREAD)))
}

/// Runs the tests once and writes all reports.
fn run_once(args: &TestArgs, job: &TestJob, cases: &[Case], registry: &Registry) -> Result<Report, Failure> {
    let inputs = Inputs::new(cases.iter().map(|case| case.path.clone()));
    [&args.junit, &args.html].into_iter().flatten().try_for_each(|path| inputs.check_output(path))?;
    let mut reporter = progress::ProgressReporter::new(args, cases);
    let report = run_cases(cases, registry, &job.options, &mut |outcome| reporter.report(outcome));
    reporter.finish(&report)?;
    if let Accept::Named(names) = &job.options.images.accept
        && let Some(name) = names.iter().find(|n| !report.images.contains(*n))
    {
        return Err(Failure::Usage(format!(
            "--accept={}: no section that ran has an image of this name{}",
            shell_quote(name),
            did_you_mean(name, report.images.iter().map(String::as_str))
        )));
    }
    let inputs = Inputs::new(report.files.iter().cloned());
    let write = |path: &Path, text: String| {
        inputs.check_output(path)?;
        write_whole(path, text.as_bytes()).map_err(|e| write_failure(&path.display().to_string(), e))
    };
    if let Some(path) = &args.junit {
        write(path, junit::report(&report))?;
    }
    if let Some(path) = &args.html {
        let paths: Vec<String> = job.paths.iter().map(|p| collect::display_path(p)).collect();
        let about = format!("choreo {}: {}", env!("CARGO_PKG_VERSION"), paths.join(", "));
        write(path, html::report(&report, &about))?;
    }
    if args.json {
        let about = json!({
            "version": env!("CARGO_PKG_VERSION"),
            "paths": job.paths.iter().map(|p| collect::display_path(p)).collect::<Vec<_>>(),
            "filter": job.selection.filter,
            "shard": job.selection.shard,
            "changed": job.options.changed,
            "any_device": job.options.images.any_device,
        });
        print_json(&json::report(&report, &about))?;
    }
    Ok(report)
}
