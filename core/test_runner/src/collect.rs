//! Collects the sections to run from the paths on the command line: the files that are tests, and their selected sections.

use choreo_plugin::Registry;
use choreo_script::testing::{SectionInfo, TestOptions, list_sections};
use choreo_script::{Diagnostic, did_you_mean};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Largest number of files; more are a mistake (`choreo test /`).
const MAX_FILES: usize = 20_000;
/// Folders that contain no tests: imported modules, golden images, build output, packages.
const SKIPPED_FOLDERS: &[&str] = &["modules", "pictures", "target", "node_modules"];
/// Extensions of plugins written in Rhai, which are not tests.
const PLUGIN_EXTENSIONS: [&str; 2] = [".importer.rhai", ".exporter.rhai"];

/// One section to run.
#[derive(Clone, Debug, PartialEq)]
pub struct Case {
    pub path: PathBuf,
    /// Path in messages, with `/`.
    pub file: String,
    /// Folder around the file in which its test may read: that of its project, else the root in the options, else the folder given.
    pub root: Option<PathBuf>,
    /// The section, or the errors if the file cannot be read.
    pub section: Result<SectionInfo, Vec<Diagnostic>>,
    /// First and last line of each section in the file.
    pub section_lines: Arc<[(usize, usize)]>,
}

/// Reason why no section can be run: a complete message that says what to type.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum NothingToRun {
    /// The command line is wrong.
    Usage(String),
    /// A folder or file cannot be read.
    Input(String),
}

/// Choice of the sections to run.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Selection {
    /// Substrings of `FILE > SECTION` in any case, or tags; empty selects all. Each must match at least one section.
    pub filter: Vec<String>,
    /// The I-th of N equal parts, counted from 1.
    pub shard: Option<(usize, usize)>,
}

impl Case {
    pub fn name(&self) -> String {
        match &self.section {
            Ok(info) if !info.name.is_empty() => format!("{} > {}", self.file, info.name),
            _ => self.file.clone(),
        }
    }

    fn matches_filter(&self, filter: &str) -> bool {
        let tagged = self.section.as_ref().is_ok_and(|s| s.tags.iter().any(|t| t == filter));
        tagged || self.name().to_lowercase().contains(&filter.to_lowercase())
    }
}

/// Scripts named by the paths, and in the folders named by the paths, in the given order; each with the folder in which it was found. The
/// content of a folder is sorted by name.
pub fn find_scripts(paths: &[PathBuf]) -> Result<Vec<(PathBuf, Option<PathBuf>)>, NothingToRun> {
    let mut files: Vec<(PathBuf, Option<PathBuf>)> = Vec::new();
    for path in paths {
        let shown = display_path(path);
        if path.is_dir() {
            let before = files.len();
            find_scripts_in_folder(path, path, &mut files)?;
            if files.len() == before {
                return Err(NothingToRun::Input(format!("{shown}: no scripts (.rhai) in this folder")));
            }
        } else if path.is_file() {
            if path.extension().is_none_or(|e| !e.eq_ignore_ascii_case("rhai")) {
                return Err(NothingToRun::Usage(format!(
                    "{shown}: a test is a script (.rhai) or a folder of them"
                )));
            }
            files.push((path.clone(), None));
        } else {
            return Err(NothingToRun::Input(format!("{shown}: no such file or folder")));
        }
    }
    let mut seen = std::collections::BTreeSet::new();
    files.retain(|(path, _)| seen.insert(path.canonicalize().unwrap_or_else(|_| path.clone())));
    Ok(files)
}

/// Whether a file lies in a folder or in a folder below it.
pub fn contains_file(folder: &Path, file: &Path) -> bool {
    let real = file.canonicalize().ok().zip(folder.canonicalize().ok());
    real.is_some_and(|(file, folder)| file.starts_with(folder))
}

/// Collects all sections of the scripts that the paths name ([`find_scripts`]). The root of a file is the folder of its project, else
/// `options.root` if the file lies in it, else the folder in which the file was found.
pub fn collect(
    paths: &[PathBuf],
    registry: &Registry,
    options: &TestOptions,
    project: impl Fn(&Path) -> Option<PathBuf>,
) -> Result<Vec<Case>, NothingToRun> {
    let mut cases = Vec::new();
    for (path, root) in find_scripts(paths)? {
        let file = display_path(&path);
        let given_root = || options.root.clone().filter(|root| contains_file(root, &path));
        let root = project(&path).or_else(given_root).or_else(|| root.clone());
        let options = TestOptions { root, ..options.clone() };
        let listed = list_sections(&path, registry, &options);
        let section_lines: Arc<[(usize, usize)]> =
            listed.iter().flatten().map(|s| (s.line, s.end_line)).collect();
        let case = |section| Case {
            path: path.clone(),
            file: file.clone(),
            root: options.root.clone(),
            section,
            section_lines: section_lines.clone(),
        };
        match listed {
            Ok(sections) => cases.extend(sections.into_iter().map(|s| case(Ok(s)))),
            Err(diagnostics) => cases.push(case(Err(diagnostics))),
        }
    }
    Ok(cases)
}

fn find_scripts_in_folder(
    folder: &Path,
    root: &Path,
    files: &mut Vec<(PathBuf, Option<PathBuf>)>,
) -> Result<(), NothingToRun> {
    let failed = |e: std::io::Error| NothingToRun::Input(format!("{}: {e}", display_path(folder)));
    for (name, kind) in choreo_files::entries(folder).map_err(failed)? {
        let path = folder.join(&name);
        let text = name.to_string_lossy();
        if text.starts_with('.') {
            continue;
        }
        // Links to folders are not followed, since they may form a cycle.
        if kind.is_dir() {
            if !SKIPPED_FOLDERS.contains(&text.as_ref()) {
                find_scripts_in_folder(&path, root, files)?;
            }
        } else if text.to_ascii_lowercase().ends_with(".rhai")
            && !PLUGIN_EXTENSIONS.iter().any(|ending| text.ends_with(ending))
            && path.is_file()
        {
            if files.len() >= MAX_FILES {
                return Err(NothingToRun::Usage(format!(
                    "more than {MAX_FILES} scripts below {}; name the folder of the tests",
                    display_path(root)
                )));
            }
            // A file that is found in a folder must really lie in it: its text may appear in messages.
            if kind.is_symlink() && !contains_file(root, &path) {
                return Err(NothingToRun::Input(format!(
                    "{}: it is a symbolic link that leads out of {}; remove it, or name the file itself",
                    display_path(&path),
                    display_path(root)
                )));
            }
            // The prefix "./" is left out of all names.
            let path = path.strip_prefix(".").map_or(path.clone(), Path::to_path_buf);
            files.push((path, Some(root.to_path_buf())));
        }
    }
    Ok(())
}

/// Selected sections, in order.
pub fn select(cases: Vec<Case>, selection: &Selection) -> Result<Vec<Case>, NothingToRun> {
    for filter in &selection.filter {
        if cases.iter().any(|c| c.matches_filter(filter)) {
            continue;
        }
        let names: Vec<&str> = cases
            .iter()
            .filter_map(|c| c.section.as_ref().ok())
            .flat_map(|s| s.tags.iter().map(String::as_str).chain([s.name.as_str()]))
            .filter(|n| !n.is_empty())
            .collect();
        return Err(NothingToRun::Usage(format!(
            "--filter {}: {}{}\n    --list shows all of them",
            shell_quote(filter),
            match cases.len() {
                1 => "the only section does not match".to_string(),
                n => format!("none of the {n} sections matches"),
            },
            did_you_mean(filter, names)
        )));
    }
    let mut cases = cases;
    if !selection.filter.is_empty() {
        cases.retain(|c| selection.filter.iter().any(|f| c.matches_filter(f)));
    }
    let Some((part, parts)) = selection.shard else { return Ok(cases) };
    let count = cases.len();
    // Neighboring sections take about the same time, so they are distributed round-robin to balance the parts.
    let cases: Vec<Case> = cases.into_iter().skip(part - 1).step_by(parts).collect();
    match cases.is_empty() {
        true => Err(NothingToRun::Usage(format!(
            "--shard {part}/{parts}: there {}, so this part is empty",
            if count == 1 { "is only 1 section".to_string() } else { format!("are only {count} sections") }
        ))),
        false => Ok(cases),
    }
}

/// Formats a path for messages.
pub fn display_path(path: &Path) -> String {
    let text = path.display().to_string().replace('\\', "/");
    match text.strip_prefix("./") {
        Some(rest) if !rest.is_empty() => rest.to_string(),
        _ => text,
    }
}

/// Quotes a text so that a shell reads it as one word.
pub fn shell_quote(text: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "-_./:=+,@%".contains(c);
    match !text.is_empty() && text.chars().all(plain) {
        true => text.to_string(),
        false => format!("'{}'", text.replace('\'', "'\\''")),
    }
}
